//! When a sensor is read.

use types::{Duration, Time};

/// Regular releases of one sensor. The number of a release depends on the time alone, so leaving some out changes no other.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cadence {
    period: Duration,
    next: Time,
}

impl Cadence {
    /// Releases at zero, `period`, twice that …; none for a sensor that is not there.
    pub(crate) fn every(period: Option<Duration>) -> Cadence {
        let period = period.unwrap_or(Duration::ZERO);
        Cadence { period, next: if period > Duration::ZERO { Time::ZERO } else { Time::NEVER } }
    }

    /// The number of the release that has become due; of several only the last.
    pub(crate) fn due(&mut self, now: Time) -> Option<u64> {
        if now < self.next {
            return None;
        }
        let number = now.0.div_euclid(self.period.0);
        self.next = Time((number + 1).saturating_mul(self.period.0));
        Some(number.max(0) as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fifteen_a_second_polled_every_ten_milliseconds_is_fifteen_a_second() {
        let mut camera = Cadence::every(Some(Duration(66_666_667)));
        let numbers: Vec<u64> = (0..100).filter_map(|k| camera.due(Time(k * 10_000_000))).collect();
        assert_eq!(numbers, (0..15).collect::<Vec<u64>>());
    }

    #[test]
    fn missed_releases_are_not_made_up_and_keep_their_numbers() {
        let mut gyro = Cadence::every(Some(Duration::millis(10)));
        assert_eq!(gyro.due(Time::ZERO), Some(0));
        assert_eq!(gyro.due(Time(57_000_000)), Some(5));
        assert_eq!(gyro.due(Time(59_000_000)), None);
        assert_eq!(gyro.due(Time(60_000_000)), Some(6));
        assert_eq!(Cadence::every(None).due(Time(1 << 60)), None);
    }
}
