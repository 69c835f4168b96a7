//! Recordings of raw wheel counts and the scans of a small laser, a line for each scan.
//!
//! ```text
//! word 0        time (µs), 32 bits
//! words 2, 3    counts of the left and the right wheel, 32 bits; 2000 to the turn
//! words 24–705  682 ranges (mm), from right to left; 0 without an echo, below 20 an error of the sensor
//! ```
//!
//! The robot has wheels of 77 mm radius, 330 mm apart, and a Hokuyo URG-04LX 145 mm ahead of their axle. Beams at either end of
//! its field see the robot itself and are left out.

use std::io::{self, BufRead};
use std::path::Path;

use types::geometry::TAU;
use types::messages::{LaserScan, WheelTicks};
use types::{Duration, Name, Pose};

use crate::description::{ClockKind, LASER, RobotDescription};
use crate::lines::{self, Lines, Read1};
use crate::recording::{Record, Recording};

/// Beams of a line.
pub const BEAMS: usize = 682;
/// Beams at either end that are not played.
pub const MARGIN: usize = 70;
/// The first word that is a range.
const FIRST_RANGE: usize = 24;
/// Steps of a full turn of the sensor, and the beam that looks ahead (its data sheet: step 384, where the first beam is step 44).
const STEPS: f64 = 1024.0;
const AHEAD: f64 = 340.0;
/// Readings below this are codes of errors (mm).
const LEAST: u16 = 20;
/// The range that the data sheet promises (m).
const RANGE_MAX: f32 = 4.095;

/// The counts of one line, as it has them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Line {
    /// Time (µs).
    pub micros: u32,
    /// Counts of the left wheel.
    pub left: i32,
    /// Counts of the right wheel.
    pub right: i32,
}

/// What is wrong with a line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BadLine {
    /// It ends too soon.
    #[error("the line has {0} words, it must have at least 706")]
    Short(usize),
    /// A word is no number of its kind.
    #[error("word {at} is \"{found}\", which is not {wanted}")]
    Word {
        /// Its place, from 0.
        at: usize,
        /// The word, cut after a few letters.
        found: String,
        /// What it should be.
        wanted: &'static str,
    },
    /// It is not text, or too long for a line.
    #[error("the line is not text")]
    NotText,
}

/// Reads a line; its ranges (mm) go to `ranges`.
///
/// # Errors
/// When the line does not have its form.
pub fn parse(line: &str, ranges: &mut [u16; BEAMS]) -> Result<Line, BadLine> {
    let mut read = Line::default();
    let mut count = 0;
    for (at, word) in line.split_ascii_whitespace().enumerate() {
        count = at + 1;
        let bad = |wanted| BadLine::Word { at, found: word.chars().take(20).collect(), wanted };
        match at {
            0 => read.micros = wrapped(word).ok_or_else(|| bad("a time in microseconds"))?,
            2 => read.left = wrapped(word).ok_or_else(|| bad("a count of ticks"))? as i32,
            3 => read.right = wrapped(word).ok_or_else(|| bad("a count of ticks"))? as i32,
            FIRST_RANGE.. if at < FIRST_RANGE + BEAMS => {
                ranges[at - FIRST_RANGE] = word.parse().map_err(|_| bad("a range in millimetres"))?;
            }
            _ => {}
        }
    }
    if count < FIRST_RANGE + BEAMS { Err(BadLine::Short(count)) } else { Ok(read) }
}

/// The low 32 bits of a whole number: a counter that runs over begins again.
fn wrapped(word: &str) -> Option<u32> {
    word.parse::<i64>().ok().map(|n| n as u32)
}

/// Puts together a counter of 32 bits that runs over.
#[derive(Clone, Copy, Debug, Default)]
struct Unwrapped {
    low: Option<u32>,
    total: i64,
}

impl Unwrapped {
    /// The whole count; a step of more than half the range is one the other way.
    fn take(&mut self, low: u32) -> i64 {
        match self.low.replace(low) {
            None => self.total = i64::from(low as i32),
            Some(before) => self.total += i64::from(low.wrapping_sub(before) as i32),
        }
        self.total
    }
}

/// Reads a file.
///
/// # Errors
/// When it cannot be opened or its first part cannot be read. A later failure ends the recording there and is told in its report.
pub fn open(path: &Path) -> io::Result<Recording> {
    Ok(read_lines(lines::open(path)?))
}

/// Reads a stream of text.
pub fn read(input: impl BufRead) -> Recording {
    read_lines(Lines::new(input))
}

fn describe() -> RobotDescription {
    let mut description = RobotDescription::bare("ticks", ClockKind::Recorded);
    description.periods.scan = Some(Duration::ZERO);
    description.periods.ticks = Some(Duration::ZERO);
    description.mount(LASER, Pose::new(0.145, 0.0, 0.0), 0.0);
    description
}

fn read_lines(mut lines: Lines<impl BufRead>) -> Recording {
    let mut recording = Recording::new(describe());
    let mut ranges = [0u16; BEAMS];
    let (mut micros, mut left, mut right) =
        (Unwrapped::default(), Unwrapped::default(), Unwrapped::default());
    loop {
        let line = match lines.next() {
            Ok(Some(line)) => line,
            Ok(None) => break,
            Err(error) => {
                recording.report.cut = Some(error.to_string());
                break;
            }
        };
        recording.report.lines += 1;
        let parsed = match line {
            Read1::Line(text) if text.trim_start().is_empty() || text.starts_with('#') => {
                recording.report.comments += 1;
                continue;
            }
            Read1::Line(text) => parse(text, &mut ranges),
            Read1::NotText | Read1::Long => Err(BadLine::NotText),
        };
        match parsed {
            Ok(line) => {
                recording.report.scans += 1;
                recording.report.odometry += 1;
                let stamp = micros.take(line.micros) as f64 * 1e-6;
                let (left, right) = (left.take(line.left as u32), right.take(line.right as u32));
                recording.push(stamp, Record::Ticks(wheels(left, right)));
                let played = ranges[MARGIN..BEAMS - MARGIN].iter();
                let metres = |mm: &u16| if *mm < LEAST { 0.0 } else { f32::from(*mm) / 1000.0 };
                recording.push_scan(form(), played.map(metres));
            }
            Err(why) => recording.report.tell(why),
        }
    }
    recording
}

fn wheels(left: i64, right: i64) -> WheelTicks {
    WheelTicks { left, right, ticks_per_turn: 2000.0, wheel_radius: 0.077, track: 0.33 }
}

fn form() -> LaserScan {
    LaserScan {
        frame: Name::new(LASER),
        angle_min: ((MARGIN as f64 - AHEAD) * TAU / STEPS) as f32,
        angle_step: (TAU / STEPS) as f32,
        range_min: 0.02,
        range_max: RANGE_MAX,
        scan_time: 0.1,
        mount_x: 0.145,
        mount_y: 0.0,
        mount_heading: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn line(micros: i64, left: i64, right: i64, range: u16) -> String {
        let mut words = vec!["0".to_owned(); 707];
        (words[0], words[2], words[3]) = (micros.to_string(), left.to_string(), right.to_string());
        (words[24], words[24 + MARGIN], words[24 + MARGIN + 1]) =
            ("11".into(), range.to_string(), "7".into());
        words.join(" ") + "\n"
    }

    #[test]
    fn a_line_gives_counts_and_the_beams_within_the_margins() {
        let recording = read(line(212_387_282, 29_221, 25_178, 1500).as_bytes());
        assert_eq!((recording.report.scans, recording.report.bad), (1, 0));
        let Record::Ticks(ticks) = recording.records[0].1 else { panic!() };
        assert_eq!((ticks.left, ticks.right), (29_221, 25_178));
        let ranges = recording.ranges_of(&recording.records[1].1);
        assert_eq!(
            (ranges.len(), ranges[0], ranges[1]),
            (BEAMS - 2 * MARGIN, 1.5, RANGE_MAX),
            "7 is an error code"
        );
        assert!((recording.origin - 212.387_282).abs() < 1e-9);
    }

    #[test]
    fn counters_and_the_clock_run_over() {
        let (last, first) = (i64::from(i32::MAX), i64::from(i32::MIN));
        let text = line((1 << 32) - 100_000, last - 4, first + 4, 1)
            + &line(0, first + 5, last - 5, 1)
            + &line(100_000, 0, 0, 1);
        let recording = read(text.as_bytes());
        let counts = |(at, record): &(Duration, Record)| match record {
            Record::Ticks(ticks) => Some((at.0 / 1_000_000, ticks.left - last, ticks.right - first)),
            _ => None,
        };
        let ticks: Vec<_> = recording.records.iter().filter_map(counts).collect();
        assert_eq!(ticks[..2], [(0, -4, 4), (100, 6, -6)]);
        assert_eq!((ticks[2].0, recording.report.backwards, recording.report.repeated), (200, 0, 0));
    }

    #[test]
    fn a_short_line_and_a_wrong_word_are_told() {
        let report = read("1 2 3\n\n# note\n".as_bytes()).report;
        assert_eq!((report.bad, report.comments), (1, 2));
        assert_eq!(report.told[0].why, "the line has 3 words, it must have at least 706");
        let report = read(line(0, 0, 0, 1).replacen('0', "x", 1).as_bytes()).report;
        assert_eq!(report.told[0].why, "word 0 is \"x\", which is not a time in microseconds");
    }

    proptest! {
        #[test]
        fn garbage_never_panics(text in "(-?[0-9]{1,22}|\\PC{1,3}| |\n){0,900}") {
            let _ = read(text.as_bytes());
        }

        #[test]
        fn a_counter_that_runs_over_is_put_together(start in any::<i32>(), steps in prop::collection::vec(-(1i64 << 31)..(1i64 << 31), 0..50)) {
            let (mut counter, mut whole) = (Unwrapped::default(), i64::from(start));
            prop_assert_eq!(counter.take(start as u32), whole);
            for step in steps {
                whole += step;
                prop_assert_eq!(counter.take(whole as u32), whole);
            }
        }
    }
}
