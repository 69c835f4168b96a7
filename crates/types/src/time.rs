//! Points in time and spans of it, in whole nanoseconds.

use core::fmt;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};
use core::str::FromStr;

/// A point in time: nanoseconds since the start of the clock that made it.
///
/// The wall clock starts at the Unix epoch, a simulated clock at zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct Time(pub i64);

/// A span of time in nanoseconds; may be negative.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct Duration(pub i64);

impl Time {
    /// The start of the clock.
    pub const ZERO: Time = Time(0);
    /// Later than any time that is met.
    pub const NEVER: Time = Time(i64::MAX);

    /// The time `seconds` after the start of the clock.
    pub fn from_seconds(seconds: f64) -> Time {
        Time(Duration::from_seconds(seconds).0)
    }

    /// Seconds since the start of the clock.
    pub fn seconds(self) -> f64 {
        self.0 as f64 / 1e9
    }

    /// The span from the start of the clock.
    pub const fn since_start(self) -> Duration {
        Duration(self.0)
    }

    /// `self + span`, held at the ends of the range.
    pub const fn saturating_add(self, span: Duration) -> Time {
        Time(self.0.saturating_add(span.0))
    }
}

impl Duration {
    /// No time at all.
    pub const ZERO: Duration = Duration(0);

    /// `n` nanoseconds.
    pub const fn nanos(n: i64) -> Duration {
        Duration(n)
    }

    /// `n` microseconds.
    pub const fn micros(n: i64) -> Duration {
        Duration(n * 1_000)
    }

    /// `n` milliseconds.
    pub const fn millis(n: i64) -> Duration {
        Duration(n * 1_000_000)
    }

    /// `n` seconds.
    pub const fn secs(n: i64) -> Duration {
        Duration(n * 1_000_000_000)
    }

    /// `seconds`, rounded to the nearest nanosecond.
    pub fn from_seconds(seconds: f64) -> Duration {
        Duration(libm::round(seconds * 1e9) as i64)
    }

    /// In seconds.
    pub fn seconds(self) -> f64 {
        self.0 as f64 / 1e9
    }
}

impl Add<Duration> for Time {
    type Output = Time;
    fn add(self, span: Duration) -> Time {
        Time(self.0 + span.0)
    }
}

impl AddAssign<Duration> for Time {
    fn add_assign(&mut self, span: Duration) {
        self.0 += span.0;
    }
}

impl Sub<Duration> for Time {
    type Output = Time;
    fn sub(self, span: Duration) -> Time {
        Time(self.0 - span.0)
    }
}

impl Sub for Time {
    type Output = Duration;
    fn sub(self, earlier: Time) -> Duration {
        Duration(self.0 - earlier.0)
    }
}

impl Add for Duration {
    type Output = Duration;
    fn add(self, other: Duration) -> Duration {
        Duration(self.0 + other.0)
    }
}

impl AddAssign for Duration {
    fn add_assign(&mut self, other: Duration) {
        self.0 += other.0;
    }
}

impl Sub for Duration {
    type Output = Duration;
    fn sub(self, other: Duration) -> Duration {
        Duration(self.0 - other.0)
    }
}

impl SubAssign for Duration {
    fn sub_assign(&mut self, other: Duration) {
        self.0 -= other.0;
    }
}

impl Neg for Duration {
    type Output = Duration;
    fn neg(self) -> Duration {
        Duration(-self.0)
    }
}

impl Mul<i64> for Duration {
    type Output = Duration;
    fn mul(self, n: i64) -> Duration {
        Duration(self.0 * n)
    }
}

impl Div<i64> for Duration {
    type Output = Duration;
    fn div(self, n: i64) -> Duration {
        Duration(self.0 / n)
    }
}

/// The text is no span of time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotADuration;

impl fmt::Display for NotADuration {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a time needs a number and one of the units ns, us, ms, s, min, h, as in \"250ms\"")
    }
}

impl core::error::Error for NotADuration {}

impl FromStr for Duration {
    type Err = NotADuration;

    /// Reads `"250ms"`, `"16.3us"`, `"1.5 s"`, `"2min"`, `"1h"`.
    fn from_str(text: &str) -> Result<Duration, NotADuration> {
        let text = text.trim();
        let unit_at =
            text.find(|c: char| c.is_ascii_alphabetic() && c != 'e' && c != 'E').ok_or(NotADuration)?;
        let (number, unit) = text.split_at(unit_at);
        let scale = match unit {
            "ns" => 1.0,
            "us" => 1e3,
            "ms" => 1e6,
            "s" => 1e9,
            "min" => 60e9,
            "h" => 3600e9,
            _ => return Err(NotADuration),
        };
        let number: f64 = number.trim().parse().map_err(|_| NotADuration)?;
        let nanos = libm::round(number * scale);
        if nanos.is_finite() && libm::fabs(nanos) < 9.2e18 {
            Ok(Duration(nanos as i64))
        } else {
            Err(NotADuration)
        }
    }
}

impl fmt::Display for Duration {
    /// Writes the largest unit in which the span is a whole number, so that reading it back gives the same span.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let n = self.0;
        for (unit, scale) in [("s", 1_000_000_000), ("ms", 1_000_000), ("us", 1_000)] {
            if n % scale == 0 {
                return write!(f, "{}{unit}", n / scale);
            }
        }
        write!(f, "{n}ns")
    }
}

impl fmt::Display for Time {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.3} s", self.seconds())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_span_is_read_as_people_write_it() {
        for (text, nanos) in [
            ("250ms", 250_000_000),
            ("16.3us", 16_300),
            ("2 min", 120_000_000_000),
            ("1e-3s", 1_000_000),
            ("-5ns", -5),
        ] {
            assert_eq!(text.parse::<Duration>(), Ok(Duration(nanos)), "{text}");
        }
        for text in ["", "5", "ms", "5 parsecs", "1e99h", "nan s"] {
            assert_eq!(text.parse::<Duration>(), Err(NotADuration), "{text}");
        }
    }

    proptest::proptest! {
        #[test]
        fn what_is_written_is_read_back(n in -1_000_000_000_000i64..1_000_000_000_000) {
            use std::string::ToString;
            let span = Duration(n);
            proptest::prop_assert_eq!(span.to_string().parse::<Duration>(), Ok(span));
        }
    }
}
