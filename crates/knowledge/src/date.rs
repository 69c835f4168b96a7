//! Dates of the Gregorian calendar.

use std::fmt;

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
        }
    }

    #[test]
    fn the_ends_of_time_have_dates() {
        assert_eq!(Date::of(Time::NEVER).year, 2262);
        assert_eq!(Date::of(Time(i64::MIN)).year, 1677);
    }
}
