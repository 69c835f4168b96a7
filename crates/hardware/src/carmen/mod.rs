//! CARMEN logs: recordings of laser robots, plain or compressed.
//!
//! The poses in such a log are somebody's: raw odometry in some, corrected by hand or by a program in others. They come out of a
//! port of their own, in the frame [`LOG`]; nobody should take them for odometry without knowing the file.

mod parse;

use std::io::{self, BufRead};
use std::path::Path;

use types::geometry::PI;
use types::messages::{LaserScan, Odometry, Twist};
use types::{Duration, Name, Pose};

pub use parse::{BadLine, Line, Odom, Scan, Which, parse};

use crate::description::{BASE, ClockKind, LASER, LOG, RobotDescription};
use crate::lines::{self, Lines, Read1};
use crate::recording::{Record, Recording};

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

fn read_lines(mut lines: Lines<impl BufRead>) -> Recording {
    let mut description = RobotDescription::bare("carmen", ClockKind::Recorded);
    description.periods.scan = Some(Duration::ZERO);
    description.periods.pose = Some(Duration::ZERO);
    let mut recording = Recording::new(description);
    let mut ranges = Vec::new();
    let mut mount = None;
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
            Read1::Line(text) => parse(text, &mut ranges),
            Read1::NotText => Err(BadLine::NotText),
            Read1::Long => Err(BadLine::Long),
        };
        match parsed {
            Ok(Line::Odom(odom)) => {
                recording.report.odometry += 1;
                recording.push(odom.stamp, pose(odom.pose, Twist::new(odom.linear, odom.angular)));
            }
            Ok(Line::Scan(scan)) if scan.which == Which::Front => {
                recording.report.scans += 1;
                let place = *mount.get_or_insert_with(|| mount_of(&scan));
                recording.push(scan.stamp, pose(scan.robot, Twist::new(scan.linear, scan.angular)));
                recording.push_scan(form(&scan, place), ranges.iter().copied());
            }
            // Two lasers on one port would be one laser that jumps to and fro.
            Ok(Line::Scan(_)) => recording.report.other_scans += 1,
            Ok(Line::Comment) => recording.report.comments += 1,
            Ok(Line::Other) => recording.report.other += 1,
            Err(why) => recording.report.tell(why),
        }
    }
    recording.description.mount(LASER, mount.unwrap_or_default(), 0.0);
    recording
}

fn pose(pose: Pose, twist: Twist) -> Record {
    Record::Pose(Odometry { frame: Name::new(LOG), body: Name::new(BASE), pose, twist })
}

/// Where the laser sits, from the two poses of a line; a tenth of a millimetre is the accuracy of the text.
fn mount_of(scan: &Scan) -> Pose {
    let fine = |x: f64| (x * 1e4).round() / 1e4;
    let robot_from_laser = scan.robot.inverse().then(scan.laser);
    Pose::new(fine(robot_from_laser.x), fine(robot_from_laser.y), fine(robot_from_laser.heading))
}

fn form(scan: &Scan, mount: Pose) -> LaserScan {
    LaserScan {
        frame: Name::new(LASER),
        angle_min: scan.start as f32,
        angle_step: if scan.step > 0.0 { scan.step } else { PI / 180.0 } as f32,
        range_min: 0.0,
        range_max: scan.max_range as f32,
        scan_time: 0.0,
        mount_x: mount.x as f32,
        mount_y: mount.y as f32,
        mount_heading: mount.heading as f32,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOG: &str = "\
# CARMEN log
PARAM laser_front_laser_offset 0.1
ODOM 0 0 0 0.1 0 0 10.0 host 0
FLASER 3 1 2 81.83 0.1 0 0 0 0 0 10.5 host 0.5
RLASER 1 1 0 0 3.14 0 0 0 10.5 host 0.5
FLASER 3 1 2
ODOM 0.1 0 0 0.1 0 0 10.2 host 0.2
";

    #[test]
    fn a_log_line_by_line() {
        let recording = read(LOG.as_bytes());
        let report = &recording.report;
        assert_eq!((report.lines, report.comments, report.other, report.odometry), (7, 1, 1, 2));
        assert_eq!(
            (report.scans, report.other_scans, report.bad, report.backwards, report.repeated),
            (1, 1, 1, 1, 0)
        );
        assert_eq!(report.told[0].line, 6);
        assert!(report.to_string().contains("line 6: the line ends before the last range"), "{report}");
        let times: Vec<i64> = recording.records.iter().map(|(at, _)| at.0 / 1_000_000).collect();
        assert_eq!(times, [0, 500, 500, 500]);
        let Record::Scan { form, .. } = recording.records[2].1 else { panic!("{:?}", recording.records[2]) };
        assert_eq!((form.mount_x, form.range_max), (0.1, 81.8));
        assert_eq!(recording.ranges, [1.0, 2.0, 81.8], "no echo is the longest range");
    }

    #[test]
    fn a_file_that_is_cut_is_read_up_to_there() {
        use std::io::Write;
        let scratch = crate::scratch::Scratch::new("carmen");
        let path = scratch.path().join("cut.log.gz");
        let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::none());
        packer.write_all(LOG.repeat(2000).as_bytes()).unwrap();
        let bytes = packer.finish().unwrap();
        std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
        let recording = open(&path).unwrap();
        assert!(recording.report.cut.is_some() && recording.report.scans > 500, "{}", recording.report);
    }
}
