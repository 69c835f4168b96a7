//! A recording in memory, and the driver that plays it.

use types::messages::{Head, LaserScan, Odometry, Twist, WheelTicks};
use types::{Duration, Time};

use crate::description::RobotDescription;
use crate::driver::{Driver, DriverError, Listening, Polled, Sink};
use crate::gate::Permit;
use crate::lines::Report;

/// One record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Record {
    /// A pose that came with the recording.
    Pose(Odometry),
    /// Counts of the wheels.
    Ticks(WheelTicks),
    /// A scan, and where its ranges stand.
    Scan {
        /// All but the ranges.
        form: LaserScan,
        /// Index of its first range.
        first: usize,
        /// How many there are.
        len: usize,
    },
}

/// What was recorded, in the order of the file.
#[derive(Clone, Debug)]
pub struct Recording {
    /// The robot that it was recorded with.
    pub description: RobotDescription,
    /// The records and their times since the first; these never decrease.
    pub records: Vec<(Duration, Record)>,
    /// The ranges of all scans (m).
    pub ranges: Vec<f32>,
    /// The stamp of the first record on the recording's own clock (s).
    pub origin: f64,
    /// What was in the file.
    pub report: Report,
}

impl Recording {
    /// An empty one.
    pub(crate) fn new(description: RobotDescription) -> Recording {
        Recording {
            description,
            records: Vec::new(),
            ranges: Vec::new(),
            origin: 0.0,
            report: Report::default(),
        }
    }

    /// Adds a record with its stamp (s). Files keep their order: a stamp that runs backwards takes the time of the record before.
    pub(crate) fn push(&mut self, stamp: f64, record: Record) {
        let Some((last, _)) = self.records.last() else {
            self.origin = stamp;
            return self.records.push((Duration::ZERO, record));
        };
        let at = Duration::from_seconds(stamp - self.origin);
        self.report.backwards += u64::from(at < *last);
        self.report.repeated += u64::from(at == *last);
        self.records.push((at.max(*last), record));
    }

    /// Adds a scan at the time of the last record, with which it came. What is no echo becomes the longest range.
    pub(crate) fn push_scan(&mut self, form: LaserScan, ranges: impl Iterator<Item = f32>) {
        let first = self.ranges.len();
        let far = form.range_max;
        self.ranges.extend(ranges.map(|range| if range > 0.0 && range < far { range } else { far }));
        let len = self.ranges.len() - first;
        self.description.beams = self.description.beams.max(len);
        let at = self.length();
        self.records.push((at, Record::Scan { form, first, len }));
    }

    /// How long it plays.
    pub fn length(&self) -> Duration {
        self.records.last().map_or(Duration::ZERO, |(at, _)| *at)
    }

    /// A scan's ranges (m).
    pub fn ranges_of(&self, record: &Record) -> &[f32] {
        match record {
            Record::Scan { first, len, .. } => &self.ranges[*first..*first + *len],
            _ => &[],
        }
    }

    /// The driver that plays it. Its first record comes at the first poll.
    pub fn play(self) -> Recorded {
        Recorded { recording: self, next: 0, origin: None }
    }
}

/// The driver of a recorded robot. What it is told to do goes nowhere: the recorded robot went its own way.
#[derive(Clone, Debug)]
pub struct Recorded {
    recording: Recording,
    next: usize,
    origin: Option<Time>,
}

impl Driver for Recorded {
    fn describe(&self) -> &RobotDescription {
        &self.recording.description
    }

    fn poll(&mut self, now: Time, wanted: &Listening, sink: &mut dyn Sink) -> Result<Polled, DriverError> {
        let origin = *self.origin.get_or_insert(now);
        while let Some((at, record)) = self.recording.records.get(self.next) {
            let stamp = origin.saturating_add(*at);
            if stamp > now {
                return Ok(Polled { next: Some(stamp), ..Polled::default() });
            }
            self.next += 1;
            match record {
                Record::Pose(pose) if wanted.pose => sink.pose(stamp, pose),
                Record::Ticks(ticks) if wanted.ticks => sink.ticks(stamp, ticks),
                Record::Scan { form, .. } if wanted.scan => {
                    let ranges = self.recording.ranges_of(record);
                    sink.scan(stamp, &mut |head, room| {
                        *head = *form;
                        let len = ranges.len().min(room.len());
                        room[..len].copy_from_slice(&ranges[..len]);
                        len
                    });
                }
                _ => {}
            }
        }
        Ok(Polled { ended: true, ..Polled::default() })
    }

    fn drive(&mut self, _: &Permit, _: Time, _: Twist) -> Result<(), DriverError> {
        Ok(())
    }

    fn turn_head(&mut self, _: &Permit, _: Time, _: Head) -> Result<(), DriverError> {
        Ok(())
    }

    fn hold_head(&mut self, _: &Permit, _: Time) -> Result<(), DriverError> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::description::ClockKind;

    #[derive(Default)]
    struct Heard(Vec<(i64, i64)>);

    impl Sink for Heard {
        fn ticks(&mut self, stamp: Time, ticks: &WheelTicks) {
            self.0.push((stamp.0, ticks.left));
        }
    }

    fn recording(stamps: &[f64]) -> Recording {
        let mut recording = Recording::new(RobotDescription::bare("test", ClockKind::Recorded));
        for (left, stamp) in stamps.iter().enumerate() {
            recording.push(*stamp, Record::Ticks(WheelTicks { left: left as i64, ..WheelTicks::default() }));
        }
        recording
    }

    #[test]
    fn stamps_that_run_backwards_keep_the_order_of_the_file_and_are_counted() {
        let recording = recording(&[32.0, 33.0, 0.0, 33.5, 33.5, 33.25, 34.0]);
        let times: Vec<f64> = recording.records.iter().map(|(at, _)| at.seconds()).collect();
        assert_eq!(times, [0.0, 1.0, 1.0, 1.5, 1.5, 1.5, 2.0]);
        assert_eq!((recording.report.backwards, recording.report.repeated), (2, 1));
        assert_eq!((recording.origin, recording.length()), (32.0, Duration::secs(2)));
    }

    #[test]
    fn stamps_that_no_time_can_hold_come_never_and_overflow_nothing() {
        let mut driver = recording(&[-8.9e9, 8.9e9]).play();
        let now = Time(1_900_000_000_000_000_000);
        let polled = driver.poll(now, &Listening::ALL, &mut Heard::default()).unwrap();
        assert_eq!(polled.next, Some(Time::NEVER));
    }

    #[test]
    fn it_plays_by_its_stamps_on_the_clock_of_who_polls() {
        let mut driver = recording(&[5.0, 5.1, 5.3]).play();
        let mut heard = Heard::default();
        let ticks = Listening { ticks: true, ..Listening::default() };
        let mut poll = |ms: i64| driver.poll(Time(ms * 1_000_000), &ticks, &mut heard).unwrap();
        assert_eq!(poll(1000).next, Some(Time(1_100_000_000)));
        assert!(!poll(1299).ended);
        assert!(poll(1300).ended);
        assert_eq!(heard.0, [(1_000_000_000, 0), (1_100_000_000, 1), (1_300_000_000, 2)]);
    }
}
