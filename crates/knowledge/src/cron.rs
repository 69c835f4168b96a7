//! Times by the calendar, in the five fields of crontab(5).

use std::fmt;
use std::str::FromStr;

use types::{Duration, Time};

use crate::Date;

/// Minute, hour, day of the month, month and day of the week, as in `30 8 * * mon-fri`: half past eight on working days.
///
/// | field | values |
/// |---|---|
/// | minute | 0–59 |
/// | hour | 0–23 |
/// | day | 1–31 |
/// | month | 1–12, or jan–dec |
/// | weekday | 0–7, or sun–sat; 0 and 7 are Sunday |
///
/// A field is `*`, a value, a range `8-12`, either of the ranges with a step `*/15` or `8-18/2`, or several of these with commas.
/// As crontab(5) has it, a day counts when both its fields fit; but when neither begins with `*`, one of them is enough.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cron {
    text: String,
    /// Bit `n` is set where value `n` fits, for each field.
    fits: [u64; 5],
    /// One fitting day is enough: of the month or of the week.
    either: bool,
}

/// Why a text is no time by the calendar: what is wrong, and how it is written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}; five fields are needed, minute hour day month weekday, as in \"30 8 * * mon-fri\"")]
pub struct NotCron(String);

struct Field {
    name: &'static str,
    least: u32,
    most: u32,
    words: &'static [&'static str],
}

const MONTHS: [&str; 12] =
    ["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"];
const DAYS: [&str; 8] = ["sun", "mon", "tue", "wed", "thu", "fri", "sat", "sun"];
/// Days of each month, in a leap year.
const LENGTHS: [u32; 12] = [31, 29, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];

const FIELDS: [Field; 5] = [
    Field { name: "minute", least: 0, most: 59, words: &[] },
    Field { name: "hour", least: 0, most: 23, words: &[] },
    Field { name: "day", least: 1, most: 31, words: &[] },
    Field { name: "month", least: 1, most: 12, words: &MONTHS },
    Field { name: "weekday", least: 0, most: 7, words: &DAYS },
];

impl FromStr for Cron {
    type Err = NotCron;

    fn from_str(text: &str) -> Result<Cron, NotCron> {
        let parts: Vec<&str> = text.split_whitespace().collect();
        let [minute, hour, day, month, weekday] = parts[..] else {
            return Err(NotCron(format!("\"{text}\" has {} fields", parts.len())));
        };
        let mut fits = [0; 5];
        for ((fits, field), part) in fits.iter_mut().zip(&FIELDS).zip([minute, hour, day, month, weekday]) {
            *fits = field.read(part)?;
        }
        // Sunday is 7, and 0.
        fits[4] = (fits[4] | fits[4] >> 7) & 0x7f;
        let either = !day.starts_with('*') && !weekday.starts_with('*');
        let cron = Cron { text: parts.join(" "), fits, either };
        let comes = (1..=12).any(|month| {
            cron.fits(3, month) && (1..=LENGTHS[month as usize - 1]).any(|day| cron.fits(2, day))
        });
        if either || comes {
            Ok(cron)
        } else {
            Err(NotCron(format!("there is no day {day} in month {month}")))
        }
    }
}

impl fmt::Display for Cron {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl Field {
    /// The values that fit, as bits.
    fn read(&self, text: &str) -> Result<u64, NotCron> {
        text.split(',').try_fold(0, |fits, part| Ok(fits | self.part(part)?))
    }

    fn part(&self, text: &str) -> Result<u64, NotCron> {
        let (range, step) = match text.split_once('/') {
            Some((range, step)) => (range, Some(step)),
            None => (text, None),
        };
        let (first, last) = match range.split_once('-') {
            _ if range == "*" => (self.least, self.most),
            Some((first, last)) => (self.value(first, false)?, self.value(last, true)?),
            None if step.is_some() => {
                return Err(NotCron(format!("\"{text}\" has a step without a range ({})", self.name)));
            }
            None => (self.value(range, false)?, self.value(range, false)?),
        };
        if first > last {
            return Err(NotCron(format!("\"{text}\" ends before it begins ({})", self.name)));
        }
        let step = match step.map(str::parse::<usize>) {
            None => 1,
            Some(Ok(step)) if step > 0 => step,
            Some(_) => return Err(NotCron(format!("\"{text}\" has no step ({})", self.name))),
        };
        Ok((first..=last).step_by(step).fold(0, |fits, value| fits | 1 << value))
    }

    /// A number or a word. At the end of a range `sun` is 7, so that `sat-sun` is one.
    fn value(&self, text: &str, at_end: bool) -> Result<u32, NotCron> {
        let lower = text.to_ascii_lowercase();
        let word = if at_end {
            self.words.iter().rposition(|word| *word == lower)
        } else {
            self.words.iter().position(|word| *word == lower)
        };
        let base = if self.words.len() == MONTHS.len() { 1 } else { 0 };
        let digits = text.bytes().all(|byte| byte.is_ascii_digit());
        let number = word.map(|word| word as u32 + base);
        let number = number.or_else(|| text.parse().ok().filter(|_| digits));
        number.filter(|number| (self.least..=self.most).contains(number)).ok_or_else(|| {
            let Field { name, least, most, .. } = self;
            NotCron(format!("\"{text}\" is no {name}, which goes from {least} to {most}"))
        })
    }
}

impl Cron {
    fn fits(&self, field: usize, value: u32) -> bool {
        self.fits[field] >> value & 1 == 1
    }

    /// All times from `from` (included) to `to` (not included). `epoch` is what the calendar shows at the zero of the clock.
    pub(crate) fn between(&self, epoch: Duration, from: Time, to: Time) -> Vec<Time> {
        const MINUTE: i128 = 60_000_000_000;
        let epoch = i128::from(epoch.0);
        let minute = |time: Time| (i128::from(time.0) + epoch + MINUTE - 1).div_euclid(MINUTE);
        let (first, end) = (minute(from), minute(to));
        let mut times = Vec::new();
        if first >= end {
            return times;
        }
        for day in first.div_euclid(1440)..=(end - 1).div_euclid(1440) {
            if !self.has_day(day as i64) {
                continue;
            }
            for hour in (0..24).filter(|hour| self.fits(1, *hour)) {
                for minute in (0..60).filter(|minute| self.fits(0, *minute)) {
                    let at = day * 1440 + i128::from(hour * 60 + minute);
                    if (first..end).contains(&at) {
                        times.push(Time((at * MINUTE - epoch) as i64));
                    }
                }
            }
        }
        times
    }

    /// Whether the day, counted from 1970-01-01, fits.
    fn has_day(&self, day: i64) -> bool {
        let Date { month, day: day_of_month, .. } = Date::of_day(day);
        // The first day was a Thursday.
        let weekday = (day + 4).rem_euclid(7) as u32;
        let (by_month, by_week) = (self.fits(2, day_of_month), self.fits(4, weekday));
        self.fits(3, month) && if self.either { by_month || by_week } else { by_month && by_week }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MINUTE: i64 = 60_000_000_000;

    /// The first four minutes since 1970 at or after this one.
    fn four(text: &str, from: i64) -> Vec<i64> {
        let cron: Cron = text.parse().unwrap();
        let far = Time((from + 20 * 366 * 1440) * MINUTE);
        let times = cron.between(Duration::ZERO, Time(from * MINUTE), far);
        times.iter().take(4).map(|time| time.0 / MINUTE).collect()
    }

    /// What croner 4.0.3 says, which is another implementation, in minutes since 1970 after 2026-02-27 12:00 UTC.
    const BY_CRONER: [(&str, [i64; 4]); 12] = [
        ("*/20 * * * *", [29536580, 29536600, 29536620, 29536640]),
        ("30 8 * * mon-fri", [29540670, 29542110, 29543550, 29544990]),
        ("0 0 29 2 *", [30589920, 32693760, 34797600, 36901440]),
        ("0 12 31 * *", [29582640, 29670480, 29758320, 29802960]),
        ("15 6 1 jan,jul *", [29714775, 29979735, 30240375, 30505335]),
        ("0 0 13 * fri", [29545920, 29556000, 29566080, 29576160]),
        ("0 0 */10 * *", [29538720, 29553120, 29567520, 29581920]),
        ("5-59/27 22,23 * * 0", [29540045, 29540072, 29540099, 29540105]),
        ("0 0 * * 7", [29538720, 29548800, 29558880, 29568960]),
        ("59 23 28-31 2 *", [29538719, 30064319, 30589919, 30591359]),
        ("0 9 1-7 * *", [29539260, 29540700, 29542140, 29543580]),
        ("0 0 * mar-may 6", [29547360, 29557440, 29567520, 29577600]),
    ];

    #[test]
    fn the_calendar_agrees_with_croner() {
        for (text, minutes) in BY_CRONER {
            assert_eq!(four(text, 29_536_561), minutes, "{text}");
        }
    }

    #[test]
    fn a_calendar_begins_where_the_caller_says() {
        let morning: Cron = "0 8 * * *".parse().unwrap();
        let hour = Duration::secs(3600);
        // A run that begins at seven: eight is after an hour.
        let times = morning.between(hour * 7, Time::ZERO, Time::ZERO + hour * 48);
        assert_eq!(times, [Time::ZERO + hour, Time::ZERO + hour * 25]);
    }

    #[test]
    fn what_is_no_calendar_is_refused_with_the_field() {
        for (text, said) in [
            ("", "\"\" has 0 fields"),
            ("* * * *", "\"* * * *\" has 4 fields"),
            ("60 * * * *", "\"60\" is no minute, which goes from 0 to 59"),
            ("* * 0 * *", "\"0\" is no day, which goes from 1 to 31"),
            ("* * * foo *", "\"foo\" is no month, which goes from 1 to 12"),
            ("* 22-2 * * *", "\"22-2\" ends before it begins (hour)"),
            ("5/10 * * * *", "\"5/10\" has a step without a range (minute)"),
            ("*/0 * * * *", "\"*/0\" has no step (minute)"),
            ("+5 * * * *", "\"+5\" is no minute, which goes from 0 to 59"),
            ("0 0 31 feb,apr *", "there is no day 31 in month feb,apr"),
        ] {
            let refused = text.parse::<Cron>().unwrap_err().to_string();
            assert!(refused.starts_with(&format!("{said}; five fields")), "{text}: {refused}");
        }
        assert!("* * * * sat-sun,1,mon-tue/2".parse::<Cron>().is_ok());
    }

    proptest::proptest! {
        #[test]
        fn any_text_is_read_or_refused(text in "[0-9*,/a-z -]{0,30}|([0-9*/-]{1,4} ){5}") {
            let _ = text.parse::<Cron>();
        }
    }
}
