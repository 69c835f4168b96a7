//! Dates of the Gregorian calendar.

use std::fmt;
use std::str::FromStr;

use types::Time;

/// Nanoseconds of a day.
const DAY: i64 = 86_400_000_000_000;

/// A date and a time of day, to the second. A [`Time`] has one when its clock counts from 1970-01-01 00:00, as a wall clock does:
/// in UTC, without leap seconds.
///
/// ```
/// use knowledge::Date;
/// use types::Time;
///
/// assert_eq!(Date::of(Time::from_seconds(1_000_000_000.0)).to_string(), "2001-09-09 01:46:40");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Date {
    /// The year.
    pub year: i64,
    /// The month, from 1.
    pub month: u32,
    /// The day of the month, from 1.
    pub day: u32,
    /// The second of the day, from 0.
    pub second: u32,
}

impl Date {
    /// The date of a time that counts from 1970.
    pub fn of(time: Time) -> Date {
        let second = (time.0.rem_euclid(DAY) / 1_000_000_000) as u32;
        Date { second, ..Date::of_day(time.0.div_euclid(DAY)) }
    }

    /// The beginning of a day that is counted from 1970-01-01.
    ///
    /// Years are thought to begin in March, so that the leap day is their last (Howard Hinnant, "chrono-Compatible Low-Level
    /// Date Algorithms", `civil_from_days`).
    pub(crate) fn of_day(day: i64) -> Date {
        let day = day + 719_468;
        let (era, day_of_era) = (day.div_euclid(146_097), day.rem_euclid(146_097));
        let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
        let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
        let month = (5 * day_of_year + 2) / 153;
        let day = day_of_year - (153 * month + 2) / 5 + 1;
        let month = if month < 10 { month + 3 } else { month - 9 };
        let year = year_of_era + era * 400 + i64::from(month <= 2);
        Date { year, month: month as u32, day: day as u32, second: 0 }
    }
}

impl Date {
    /// The time, counted from 1970; nothing for a date so far away that no [`Time`] is it.
    pub fn time(self) -> Option<Time> {
        let time = i128::from(self.to_day()) * i128::from(DAY) + i128::from(self.second) * 1_000_000_000;
        i64::try_from(time).ok().map(Time)
    }

    /// Its day, counted from 1970-01-01 (the same source, `days_from_civil`).
    fn to_day(self) -> i64 {
        let year = self.year - i64::from(self.month <= 2);
        let (era, year_of_era) = (year.div_euclid(400), year.rem_euclid(400));
        let month = if self.month > 2 { self.month - 3 } else { self.month + 9 };
        let day_of_year = (153 * i64::from(month) + 2) / 5 + i64::from(self.day) - 1;
        let day_of_era = year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year;
        era * 146_097 + day_of_era - 719_468
    }
}

/// A text is no date.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a date is as in \"2026-03-02 07:59\", with or without the time of day, from 1678 to 2261")]
pub struct NotADate;

impl FromStr for Date {
    type Err = NotADate;

    /// Reads `2026-03-02`, `2026-03-02 07:59` and `2026-03-02 07:59:30`.
    fn from_str(text: &str) -> Result<Date, NotADate> {
        let (day, clock) = text.trim().split_once(' ').unwrap_or((text.trim(), "00:00"));
        let [year, month, day] = numbers(day, '-', [4, 2, 2]).ok_or(NotADate)?;
        let clock = clock.trim_start();
        let of_day = numbers(clock, ':', [2, 2, 2]);
        let of_day = of_day.or_else(|| numbers(clock, ':', [2, 2]).map(|[hour, minute]| [hour, minute, 0]));
        let [hour, minute, second] = of_day.ok_or(NotADate)?;
        if hour > 23 || minute > 59 || second > 59 || !(1678..=2261).contains(&year) {
            return Err(NotADate);
        }
        let date = Date { year: year.into(), month, day, second: hour * 3600 + minute * 60 + second };
        // A day that no month has is another one when it comes back.
        let back = date.time().map(Date::of);
        back.filter(|back| *back == date && (1..=12).contains(&month)).ok_or(NotADate)
    }
}

/// Numbers of so many digits, with a letter between them.
fn numbers<const N: usize>(text: &str, between: char, digits: [usize; N]) -> Option<[u32; N]> {
    let parts: Vec<&str> = text.split(between).collect();
    let fits = |(part, digits): (&&str, usize)| {
        part.len() == digits && part.bytes().all(|byte| byte.is_ascii_digit())
    };
    if parts.len() != N || !parts.iter().zip(digits).all(fits) {
        return None;
    }
    let mut numbers = [0; N];
    for (number, part) in numbers.iter_mut().zip(parts) {
        *number = part.parse().ok()?;
    }
    Some(numbers)
}

impl fmt::Display for Date {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Date { year, month, day, second } = self;
        let (hour, minute, second) = (second / 3600, second / 60 % 60, second % 60);
        write!(f, "{year:04}-{month:02}-{day:02} {hour:02}:{minute:02}:{second:02}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What `date -u -d @SECONDS` of GNU coreutils says.
    const BY_DATE: [(i64, &str); 6] = [
        (0, "1970-01-01 00:00:00"),
        (-1, "1969-12-31 23:59:59"),
        (951_782_399, "2000-02-28 23:59:59"),
        (951_782_400, "2000-02-29 00:00:00"),
        (4_107_542_400, "2100-03-01 00:00:00"),
        (-9_000_000_000, "1684-10-19 08:00:00"),
    ];

    #[test]
    fn dates_are_those_of_the_system() {
        for (seconds, date) in BY_DATE {
            assert_eq!(Date::of(Time(seconds * 1_000_000_000)).to_string(), date);
            let read: Date = date.parse().unwrap();
            assert_eq!(read.time(), Some(Time(seconds * 1_000_000_000)), "{date}");
        }
    }

    #[test]
    fn a_date_is_read_with_and_without_its_time_of_day() {
        for (text, read) in [
            ("2026-03-02", "2026-03-02 00:00:00"),
            ("2026-03-02 07:59", "2026-03-02 07:59:00"),
            (" 2024-02-29  23:59:59 ", "2024-02-29 23:59:59"),
        ] {
            assert_eq!(text.parse::<Date>().unwrap().to_string(), read);
        }
        for text in [
            "",
            "today",
            "2026-3-2",
            "02.03.2026",
            "2026-02-29",
            "2026-13-01",
            "2026-00-10",
            "2026-04-31",
            "2026-03-02 24:00",
            "2026-03-02 07:60",
            "2026-03-02 7:59",
            "2026-03-02T07:59",
            "1200-01-01",
            "9999-01-01",
            "2026-03-02 07:59:30.5",
        ] {
            assert_eq!(text.parse::<Date>(), Err(NotADate), "{text}");
        }
    }

    proptest::proptest! {
        #[test]
        fn every_date_that_is_shown_is_read_back(second in -9_214_560_000_i64..9_214_646_400) {
            let date = Date::of(Time(second * 1_000_000_000));
            proptest::prop_assert_eq!(date.to_string().parse::<Date>(), Ok(date));
            proptest::prop_assert_eq!(date.time(), Some(Time(second * 1_000_000_000)));
        }

        #[test]
        fn any_text_is_a_date_or_none(text in "[0-9]{4}-[0-9]{2}-[0-9]{2}( [0-9:]{5,8})?|.{0,20}") {
            let _ = text.parse::<Date>();
        }
    }

    #[test]
    fn the_ends_of_time_have_dates() {
        assert_eq!(Date::of(Time::NEVER).year, 2262);
        assert_eq!(Date::of(Time(i64::MIN)).year, 1677);
    }
}
