//! Recordings of real robots. Run where the files are, skipped in one line where they are not.

use std::path::PathBuf;

use hardware::recording::{Record, Recording};
use hardware::{Driver, Listening, Sink, carmen, ticks};
use types::Time;
use types::messages::{LaserScan, Odometry, WheelTicks};

/// Where the files are: the folder that `SINEW_DATA` names, else one beside the workspace.
pub(crate) fn file(name: &str) -> Option<PathBuf> {
    let beside = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..").join("../shared/data");
    let path = std::env::var_os("SINEW_DATA").map_or(beside, PathBuf::from).join(name);
    if !path.is_file() {
        println!("skipped: there is no {}", path.display());
        return None;
    }
    Some(path)
}

/// Counts what a driver delivers, and checks that time never runs backwards.
#[derive(Default)]
struct Counted {
    scans: usize,
    beams: usize,
    poses: usize,
    ticks: Vec<WheelTicks>,
    last: Time,
}

impl Counted {
    fn at(&mut self, stamp: Time) {
        assert!(stamp >= self.last);
        self.last = stamp;
    }
}

impl Sink for Counted {
    fn scan(&mut self, stamp: Time, fill: hardware::driver::FillScan<'_>) {
        let (mut head, mut room) = (LaserScan::default(), [0f32; 1024]);
        self.beams = fill(&mut head, &mut room);
        assert!(room[..self.beams].iter().all(|range| (0.0..=head.range_max).contains(range)));
        self.scans += 1;
        self.at(stamp);
    }
    fn pose(&mut self, stamp: Time, pose: &Odometry) {
        assert_eq!(pose.frame.as_str(), "log");
        self.poses += 1;
        self.at(stamp);
    }
    fn ticks(&mut self, stamp: Time, ticks: &WheelTicks) {
        self.ticks.push(*ticks);
        self.at(stamp);
    }
}

fn played(recording: Recording) -> Counted {
    let length = recording.length();
    let mut driver = recording.play();
    let mut counted = Counted::default();
    let mut now = Time::ZERO;
    loop {
        let polled = driver.poll(now, &Listening::ALL, &mut counted).unwrap();
        if polled.ended {
            assert_eq!(now.since_start(), length);
            return counted;
        }
        now = polled.next.unwrap();
    }
}

#[test]
fn fr079_has_1464_scans_of_360_beams_and_no_bad_line() {
    let Some(path) = file("carmen/fr079.log.gz") else { return };
    let recording = carmen::open(&path).unwrap();
    let report = recording.report.clone();
    assert_eq!((report.scans, report.bad, report.odometry, report.backwards), (1464, 0, 0, 0));
    assert_eq!(report.other, 1464 + 2307, "VERTEX2 and EDGE2");
    let laser = recording.description.mounts[0];
    assert_eq!(
        (laser.child.as_str(), laser.pose.x, laser.pose.y, laser.pose.heading),
        ("laser", -0.04, 0.0, 0.0)
    );
    let first = recording.records.iter().find(|(_, record)| matches!(record, Record::Scan { .. })).unwrap().1;
    let ranges = recording.ranges_of(&first);
    assert_eq!((ranges[0], ranges[359]), (1.67, 1.0), "the first line of the file");
    // 1211.520329 is the stamp of the first line; what comes later keeps its distance to it.
    assert!((recording.origin - 1_211.520_329).abs() < 1e-6);
    let counted = played(recording);
    assert_eq!((counted.scans, counted.beams, counted.poses), (1464, 360, 1464));
}

#[test]
fn intel_has_910_scans_of_180_beams_and_14541_lines_of_odometry() {
    let Some(path) = file("carmen/intel.gfs.log.gz") else { return };
    let recording = carmen::open(&path).unwrap();
    let report = recording.report.clone();
    assert_eq!((report.scans, report.odometry, report.other, report.bad), (910, 14_541, 910, 0));
    // 910 lines have the stamp 0, and more are a little late; the file keeps its order, and its length of 2691.29 s.
    assert!(report.backwards > 910, "{report}");
    assert!((recording.length().seconds() - 2691.29).abs() < 0.01);
    let counted = played(recording);
    assert_eq!((counted.scans, counted.beams, counted.poses), (910, 180, 910 + 14_541));
}

#[test]
fn exp1_has_756_scans_and_its_counts_tell_a_robot_that_comes_to_rest() {
    let Some(path) = file("ticks/exp1.dat.gz") else { return };
    let recording = ticks::open(&path).unwrap();
    assert_eq!((recording.report.scans, recording.report.bad, recording.report.backwards), (756, 0, 0));
    let text =
        std::io::read_to_string(flate2::read::GzDecoder::new(std::fs::File::open(&path).unwrap())).unwrap();
    let mut ranges = [0; ticks::BEAMS];
    let first = ticks::parse(text.lines().next().unwrap(), &mut ranges).unwrap();
    assert_eq!((first.micros, first.left, first.right), (212_387_282, 29_221, 25_178));
    let echoes = text.lines().map(|line| {
        ticks::parse(line, &mut ranges).unwrap();
        ranges.iter().filter(|range| **range == 0).count()
    });
    assert_eq!(echoes.sum::<usize>(), 270_547, "readings without an echo, counted by another program");
    let counted = played(recording);
    assert_eq!((counted.scans, counted.beams), (756, ticks::BEAMS - 2 * ticks::MARGIN));
    let last = counted.ticks.last().unwrap();
    assert_eq!((last.left, last.right), (211_786, 210_289), "the last line of the file");
}
