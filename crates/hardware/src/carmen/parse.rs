//! Lines of a CARMEN log, one at a time. Pure: text in, values out.

use types::Pose;
use types::geometry::PI;

/// Which laser a scan is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Which {
    /// The first, as a rule in front: `FLASER`, `ROBOTLASER1`.
    Front,
    /// The second, as a rule at the back: `RLASER`, `ROBOTLASER2`.
    Rear,
}

/// A scan without its ranges, which are in the buffer of the caller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scan {
    /// Which laser.
    pub which: Which,
    /// Direction of the first beam, from where the laser looks (rad).
    pub start: f64,
    /// From one beam to the next (rad).
    pub step: f64,
    /// Nothing was met from here on (m).
    pub max_range: f64,
    /// Where the laser was.
    pub laser: Pose,
    /// Where the robot was.
    pub robot: Pose,
    /// Speed of the robot, where the line has it (m/s).
    pub linear: f64,
    /// Turn rate of the robot, where the line has it (rad/s).
    pub angular: f64,
    /// When (s).
    pub stamp: f64,
}

/// A line of odometry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Odom {
    /// Where the robot was.
    pub pose: Pose,
    /// Its speed (m/s).
    pub linear: f64,
    /// Its turn rate (rad/s).
    pub angular: f64,
    /// When (s).
    pub stamp: f64,
}

/// What a line says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Line {
    /// `ODOM`
    Odom(Odom),
    /// `FLASER`, `RLASER`, `ROBOTLASER1`, `ROBOTLASER2`
    Scan(Scan),
    /// A line that begins with `#`, or an empty one.
    Comment,
    /// A tag that is not read here.
    Other,
}

/// What is wrong with a line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BadLine {
    /// It ends too soon.
    #[error("the line ends before the {0}")]
    Short(&'static str),
    /// A word is not what it should be.
    #[error("the {what} is \"{found}\", which is not {wanted}")]
    Word {
        /// What it should tell.
        what: &'static str,
        /// The word, cut after a few letters.
        found: String,
        /// What it should be.
        wanted: &'static str,
    },
    /// It is not text.
    #[error("the line is not text")]
    NotText,
    /// It is longer than any scan.
    #[error("the line is too long")]
    Long,
}

/// The most beams that a line may hold: more than any planar laser has.
const BEAMS_MAX: usize = 20_000;
/// What a SICK of that time gives where there is no echo is 81.83 or 81.91 m, and the lines `FLASER` and `RLASER` do not say so.
const SICK_NO_ECHO: f64 = 81.8;

/// Reads a line. The ranges of a scan (m) replace what is in `ranges`, as the line has them.
///
/// The forms are those of the CARMEN toolkit (2002 and 2008):
///
/// ```text
/// ODOM x y theta tv rv accel  stamp host logger_stamp
/// FLASER n r₁…rₙ  laser_x laser_y laser_theta  x y theta  stamp host logger_stamp
/// ROBOTLASER1 type start_angle field_of_view step max_range accuracy remission_mode n r₁…rₙ m s₁…sₘ
///             laser_x laser_y laser_theta  x y theta  tv rv forward side turn_axis  stamp host logger_stamp
/// ```
///
/// # Errors
/// When a known line does not have its form.
pub fn parse(line: &str, ranges: &mut Vec<f32>) -> Result<Line, BadLine> {
    let mut words = Words(line.split_ascii_whitespace());
    let Some(tag) = words.0.next() else { return Ok(Line::Comment) };
    match tag {
        "ODOM" => odom(&mut words).map(Line::Odom),
        "FLASER" => old_scan(&mut words, Which::Front, ranges).map(Line::Scan),
        "RLASER" => old_scan(&mut words, Which::Rear, ranges).map(Line::Scan),
        "ROBOTLASER1" => new_scan(&mut words, Which::Front, ranges).map(Line::Scan),
        "ROBOTLASER2" => new_scan(&mut words, Which::Rear, ranges).map(Line::Scan),
        _ if tag.starts_with('#') => Ok(Line::Comment),
        _ => Ok(Line::Other),
    }
}

struct Words<'a>(core::str::SplitAsciiWhitespace<'a>);

impl Words<'_> {
    fn word(&mut self, what: &'static str) -> Result<&str, BadLine> {
        self.0.next().ok_or(BadLine::Short(what))
    }

    fn bad<T>(what: &'static str, found: &str, wanted: &'static str) -> Result<T, BadLine> {
        Err(BadLine::Word { what, found: found.chars().take(20).collect(), wanted })
    }

    fn number(&mut self, what: &'static str) -> Result<f64, BadLine> {
        let word = self.word(what)?;
        match word.parse::<f64>() {
            Ok(x) if x.is_finite() => Ok(x),
            _ => Words::bad(what, word, "a number"),
        }
    }

    fn count(&mut self, what: &'static str) -> Result<usize, BadLine> {
        let word = self.word(what)?;
        match word.parse::<usize>() {
            Ok(n) if n <= BEAMS_MAX => Ok(n),
            _ => Words::bad(what, word, "a count of beams"),
        }
    }

    fn pose(&mut self, what: &'static str) -> Result<Pose, BadLine> {
        Ok(Pose::new(self.number(what)?, self.number(what)?, self.number(what)?))
    }

    /// The time stamp. The host and the logger's own stamp behind it are not used.
    fn stamp(&mut self) -> Result<f64, BadLine> {
        let stamp = self.number("time stamp")?;
        // Up to the year 2255, which the nanoseconds of a `Time` can hold.
        if stamp.abs() < 9e9 {
            Ok(stamp)
        } else {
            Words::bad("time stamp", &format!("{stamp:e}"), "a time in seconds")
        }
    }

    fn ranges(&mut self, n: usize, ranges: &mut Vec<f32>) -> Result<(), BadLine> {
        ranges.clear();
        for _ in 0..n {
            let word = self.word("last range")?;
            match word.parse::<f32>() {
                Ok(range) => ranges.push(range),
                Err(_) => return Words::bad("range", word, "a number"),
            }
        }
        Ok(())
    }
}

fn odom(words: &mut Words<'_>) -> Result<Odom, BadLine> {
    let pose = words.pose("pose")?;
    let (linear, angular) = (words.number("speed")?, words.number("turn rate")?);
    words.number("acceleration")?;
    Ok(Odom { pose, linear, angular, stamp: words.stamp()? })
}

fn old_scan(words: &mut Words<'_>, which: Which, ranges: &mut Vec<f32>) -> Result<Scan, BadLine> {
    let n = words.count("number of ranges")?;
    words.ranges(n, ranges)?;
    let laser = words.pose("pose of the laser")?;
    let robot = words.pose("pose of the robot")?;
    Ok(Scan {
        which,
        start: -PI / 2.0,
        step: old_step(n),
        max_range: SICK_NO_ECHO,
        laser,
        robot,
        linear: 0.0,
        angular: 0.0,
        stamp: words.stamp()?,
    })
}

/// The line does not say how far its beams are apart. A SICK over half a turn has steps of 1° or 0.5°, and some programs left its
/// last beam out; other lasers are taken to spread theirs over half a turn.
fn old_step(n: usize) -> f64 {
    match n {
        180 | 181 => PI / 180.0,
        360 | 361 => PI / 360.0,
        _ => PI / n.saturating_sub(1).max(1) as f64,
    }
}

fn new_scan(words: &mut Words<'_>, which: Which, ranges: &mut Vec<f32>) -> Result<Scan, BadLine> {
    words.word("type of the laser")?;
    let start = words.number("start angle")?;
    words.number("field of view")?;
    let step = words.number("angular resolution")?;
    let max_range = words.number("maximum range")?;
    words.number("accuracy")?;
    words.word("remission mode")?;
    let n = words.count("number of ranges")?;
    words.ranges(n, ranges)?;
    for _ in 0..words.count("number of remissions")? {
        words.word("last remission")?;
    }
    let laser = words.pose("pose of the laser")?;
    let robot = words.pose("pose of the robot")?;
    let (linear, angular) = (words.number("speed")?, words.number("turn rate")?);
    for what in ["forward safety distance", "side safety distance", "turn axis"] {
        words.number(what)?;
    }
    Ok(Scan { which, start, step, max_range, laser, robot, linear, angular, stamp: words.stamp()? })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn ok(line: &str) -> (Line, Vec<f32>) {
        let mut ranges = vec![9.0];
        (parse(line, &mut ranges).unwrap(), ranges)
    }

    fn bad(line: &str) -> String {
        parse(line, &mut Vec::new()).unwrap_err().to_string()
    }

    #[test]
    fn odometry() {
        let (line, _) = ok("ODOM 1.5 -2 0.25 0.3 -0.1 0 976052857.33 nohost 0.25");
        let pose = Pose::new(1.5, -2.0, 0.25);
        assert_eq!(line, Line::Odom(Odom { pose, linear: 0.3, angular: -0.1, stamp: 976_052_857.33 }));
    }

    #[test]
    fn a_scan_of_the_old_form() {
        let (line, ranges) = ok("FLASER 3 1 2.5 81.83 0.1 0 0 0 0 0 32.9 pippo 32.9");
        let Line::Scan(scan) = line else { panic!("{line:?}") };
        assert_eq!(ranges, [1.0, 2.5, 81.83]);
        assert_eq!((scan.which, scan.start, scan.step), (Which::Front, -PI / 2.0, PI / 2.0));
        assert_eq!((scan.laser.x, scan.robot.x, scan.stamp), (0.1, 0.0, 32.9));
        assert!(matches!(ok("RLASER 0 0 0 3.14 0 0 0 1 h 1").0, Line::Scan(Scan { which: Which::Rear, .. })));
    }

    #[test]
    fn a_scan_of_the_new_form_with_remissions() {
        let line = "ROBOTLASER1 0 -1.57 3.14 0.0087 50.0 0.1 0 2 1.67 51 2 7 8 \
                    -0.04 0 0.5 0.1 0.2 0.3 0.4 0.5 0.6 0.7 0.8 1211.5 x 0.016";
        let (line, ranges) = ok(line);
        let Line::Scan(scan) = line else { panic!("{line:?}") };
        assert_eq!(ranges, [1.67, 51.0]);
        assert_eq!((scan.start, scan.step, scan.max_range), (-1.57, 0.0087, 50.0));
        assert_eq!((scan.laser, scan.robot), (Pose::new(-0.04, 0.0, 0.5), Pose::new(0.1, 0.2, 0.3)));
        assert_eq!((scan.linear, scan.angular, scan.stamp), (0.4, 0.5, 1211.5));
    }

    #[test]
    fn what_is_not_read_is_no_mistake() {
        assert_eq!(ok("VERTEX2 0 0 0 0").0, Line::Other);
        assert_eq!(ok("PARAM robot_length 0.5").0, Line::Other);
        assert_eq!(ok("# a comment").0, Line::Comment);
        assert_eq!(ok("#LOOP").0, Line::Comment);
        assert_eq!(ok("  ").0, Line::Comment);
    }

    #[test]
    fn mistakes_say_what_is_missing_or_wrong() {
        assert_eq!(bad("ODOM 1 2"), "the line ends before the pose");
        assert_eq!(bad("ODOM 1 2 x 0 0 0 1 h 1"), "the pose is \"x\", which is not a number");
        assert_eq!(bad("ODOM 1 2 nan 0 0 0 1 h 1"), "the pose is \"nan\", which is not a number");
        assert_eq!(bad("FLASER 3 1 2"), "the line ends before the last range");
        assert_eq!(bad("FLASER -1"), "the number of ranges is \"-1\", which is not a count of beams");
        assert_eq!(
            bad("FLASER 99999999999"),
            "the number of ranges is \"99999999999\", which is not a count of beams"
        );
        assert!(bad("FLASER 0 0 0 0 0 0 0 1e300 h 1").contains("time in seconds"));
    }

    proptest! {
        #[test]
        fn garbage_never_panics(line in "(ODOM|FLASER|RLASER|ROBOTLASER1|ROBOTLASER2|[A-Z#]{0,9})( (-?[0-9]{1,4}(\\.[0-9]{0,3})?|nan|inf|1e999|x|\\PC{1,4})){0,30}") {
            let _ = parse(&line, &mut Vec::new());
        }

        #[test]
        fn what_is_written_is_read(values in prop::array::uniform7(-1e4f64..1e4)) {
            let [x, y, heading, linear, angular, accel, stamp] = values;
            let line = format!("ODOM {x} {y} {heading} {linear} {angular} {accel} {stamp} host 0");
            let expected = Odom { pose: Pose::new(x, y, heading), linear, angular, stamp };
            prop_assert_eq!(parse(&line, &mut Vec::new()), Ok(Line::Odom(expected)));
        }
    }
}
