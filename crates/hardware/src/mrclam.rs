//! Recordings of several robots among coded landmarks: odometry, range and bearing, and where they truly were.
//!
//! ```text
//! Barcodes.dat                 subject, barcode                 who bears which code: robots come first, then landmarks
//! Landmark_Groundtruth.dat     subject, x, y, σx, σy            (m)
//! RobotN_Odometry.dat          time, speed, turn rate           (s, m/s, rad/s), which hold until the next line
//! RobotN_Measurement.dat       time, barcode, range, bearing    (s, m, rad)
//! RobotN_Groundtruth.dat       time, x, y, heading              (s, m, rad)
//! ```
//!
//! Words are parted by white space; what begins with `#`, and empty lines, are comments. The robot of the files `RobotN_…` is subject N. What a
//! camera tells is a barcode, which is no subject; a code that nobody bears was misread, and is kept apart. (Leung, Halpern, Barfoot and
//! Liu, "The UTIAS multi-robot cooperative localization and mapping dataset", 2011.) There is no driver that plays these: the files have no
//! sensor but the finished sightings, so an estimator takes them as they are.

use std::collections::BTreeMap;

use types::{Point, Pose, Time};

/// Stamps beyond this are no times (s): a clock of nanoseconds in 64 bits ends there.
const LATEST: f64 = 9e9;

/// What a camera told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// When.
    pub at: Time,
    /// The code that was read.
    pub barcode: u32,
    /// Who bears it; nobody when it was misread.
    pub subject: Option<u32>,
    /// How far it is (m).
    pub range: f64,
    /// Where it is, from straight ahead to the left (rad).
    pub bearing: f64,
}

/// Speed and turn rate that hold from a time on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rates {
    /// From when.
    pub at: Time,
    /// Forward speed (m/s).
    pub linear: f64,
    /// Turn rate (rad/s).
    pub angular: f64,
}

/// All of one robot, each in the order of time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Member {
    /// Its number.
    pub subject: u32,
    /// What its wheels told.
    pub odometry: Vec<Rates>,
    /// What its camera told.
    pub seen: Vec<Seen>,
    /// Where it truly was; perhaps empty. Never for an estimator.
    pub truth: Vec<(Time, Pose)>,
}

/// A landmark.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mark {
    /// Its number.
    pub subject: u32,
    /// Its place (m).
    pub at: Point,
    /// Standard deviations of x and y (m).
    pub deviation: [f64; 2],
}

/// A recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Team {
    /// The robots, by their numbers.
    pub robots: Vec<Member>,
    /// The landmarks, by their numbers.
    pub landmarks: Vec<Mark>,
}

/// Why the files are no recording.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Bad {
    /// A file that must be there is not.
    #[error(
        "there is no {0}; a recording has Barcodes.dat, Landmark_Groundtruth.dat, and for each robot N the files RobotN_Odometry.dat, RobotN_Measurement.dat and RobotN_Groundtruth.dat"
    )]
    Missing(String),
    /// A line does not have its form.
    #[error("{file}, line {line}: {why}")]
    Line {
        /// The file.
        file: String,
        /// The line, from 1.
        line: usize,
        /// What is wrong.
        why: String,
    },
}

impl Team {
    /// Puts together what is in files, each given by its name, without folders, and its text. Others than those above are passed over.
    ///
    /// # Errors
    /// When one is missing, or has a line that is not of its form.
    pub fn read(files: &BTreeMap<String, String>) -> Result<Team, Bad> {
        let text = |name: &str| files.get(name).ok_or_else(|| Bad::Missing(name.to_owned()));
        let codes = rows::<2>("Barcodes.dat", text("Barcodes.dat")?)?;
        let mut bearers = BTreeMap::new();
        for (line, [subject, barcode]) in codes {
            let whole = |x| whole("Barcodes.dat", line, x);
            bearers.insert(whole(barcode)?, whole(subject)?);
        }
        let marks = "Landmark_Groundtruth.dat";
        let mut landmarks = Vec::new();
        for (line, [subject, x, y, dx, dy]) in rows::<5>(marks, text(marks)?)? {
            let subject = whole(marks, line, subject)?;
            landmarks.push(Mark { subject, at: Point::new(x, y), deviation: [dx, dy] });
        }
        landmarks.sort_by_key(|mark| mark.subject);
        let mut robots = Vec::new();
        for subject in members(files) {
            let name = |kind: &str| format!("Robot{subject}_{kind}.dat");
            robots.push(Member {
                subject,
                odometry: odometry(&name("Odometry"), text(&name("Odometry"))?)?,
                seen: sightings(&name("Measurement"), text(&name("Measurement"))?, &bearers)?,
                truth: truth(&name("Groundtruth"), text(&name("Groundtruth"))?)?,
            });
        }
        robots.sort_by_key(|robot| robot.subject);
        if robots.is_empty() {
            return Err(Bad::Missing("Robot1_Odometry.dat".into()));
        }
        Ok(Team { robots, landmarks })
    }

    /// The place of a landmark.
    pub fn landmark(&self, subject: u32) -> Option<&Mark> {
        let place = self.landmarks.binary_search_by_key(&subject, |mark| mark.subject).ok()?;
        self.landmarks.get(place)
    }

    /// Which of the robots a subject is.
    pub fn robot(&self, subject: u32) -> Option<usize> {
        self.robots.binary_search_by_key(&subject, |robot| robot.subject).ok()
    }
}

/// Numbers of the robots that have a file of any kind.
fn members(files: &BTreeMap<String, String>) -> impl Iterator<Item = u32> {
    let number =
        |name: &String| name.strip_prefix("Robot")?.strip_suffix("_Odometry.dat")?.parse::<u32>().ok();
    files.keys().filter_map(number)
}

fn odometry(file: &str, text: &str) -> Result<Vec<Rates>, Bad> {
    let rows = rows::<3>(file, text)?.into_iter();
    let mut told = rows
        .map(|(line, [t, linear, angular])| Ok(Rates { at: stamp(file, line, t)?, linear, angular }))
        .collect::<Result<Vec<_>, Bad>>()?;
    told.sort_by_key(|rates| rates.at);
    Ok(told)
}

fn sightings(file: &str, text: &str, bearers: &BTreeMap<u32, u32>) -> Result<Vec<Seen>, Bad> {
    let rows = rows::<4>(file, text)?.into_iter();
    let mut seen = rows
        .map(|(line, [t, barcode, range, bearing])| {
            let barcode = whole(file, line, barcode)?;
            let subject = bearers.get(&barcode).copied();
            Ok(Seen { at: stamp(file, line, t)?, barcode, subject, range, bearing })
        })
        .collect::<Result<Vec<_>, Bad>>()?;
    seen.sort_by_key(|seen| seen.at);
    Ok(seen)
}

fn truth(file: &str, text: &str) -> Result<Vec<(Time, Pose)>, Bad> {
    let rows = rows::<4>(file, text)?.into_iter();
    let mut truth = rows
        .map(|(line, [t, x, y, heading])| Ok((stamp(file, line, t)?, Pose::new(x, y, heading))))
        .collect::<Result<Vec<_>, Bad>>()?;
    truth.sort_by_key(|(at, _)| *at);
    Ok(truth)
}

/// The numbers of each line that is no comment, with its number.
fn rows<const N: usize>(file: &str, text: &str) -> Result<Vec<(usize, [f64; N])>, Bad> {
    let mut rows = Vec::new();
    for (line, words) in text.lines().enumerate() {
        let bad = |why: String| Bad::Line { file: file.to_owned(), line: line + 1, why };
        let words = words.trim();
        if words.is_empty() || words.starts_with('#') {
            continue;
        }
        let mut row = [0.0; N];
        let mut count = 0;
        for word in words.split_ascii_whitespace() {
            if let Some(place) = row.get_mut(count) {
                let number = word.parse::<f64>().ok().filter(|number| number.is_finite());
                let shown = || word.chars().take(20).collect::<String>();
                *place = number.ok_or_else(|| bad(format!("\"{}\" is no number", shown())))?;
            }
            count += 1;
        }
        if count != N {
            return Err(bad(format!("it has {count} words, and must have {N}")));
        }
        rows.push((line + 1, row));
    }
    Ok(rows)
}

fn stamp(file: &str, line: usize, seconds: f64) -> Result<Time, Bad> {
    if seconds.abs() < LATEST {
        return Ok(Time::from_seconds(seconds));
    }
    Err(Bad::Line { file: file.to_owned(), line, why: format!("{seconds} is no time in seconds") })
}

fn whole(file: &str, line: usize, number: f64) -> Result<u32, Bad> {
    if number.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&number) {
        return Ok(number as u32);
    }
    Err(Bad::Line { file: file.to_owned(), line, why: format!("{number} is no whole number of somebody") })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const FILES: [(&str, &str); 5] = [
        ("Barcodes.dat", "# codes\n  1 \t 5\n  6 \t 72\n"),
        ("Landmark_Groundtruth.dat", "  6 \t 0.5 \t -4.25 \t 0.00004 \t 0.0002\n"),
        ("Robot1_Odometry.dat", "10.5 0.086 -0.398\n10.6 0.067 0\n"),
        ("Robot1_Measurement.dat", "11.25 72 4.5 -0.5\n11.0 99 1 0\n"),
        ("Robot1_Groundtruth.dat", "10.0 1 2 3\n"),
    ];

    fn files() -> BTreeMap<String, String> {
        FILES.iter().map(|(name, text)| ((*name).to_owned(), (*text).to_owned())).collect()
    }

    #[test]
    fn barcodes_are_not_subjects_and_what_nobody_bears_is_kept_apart() {
        let team = Team::read(&files()).unwrap();
        let robot = &team.robots[0];
        assert_eq!((team.robots.len(), robot.subject, team.robot(1), team.robot(6)), (1, 1, Some(0), None));
        assert_eq!(robot.odometry[1], Rates { at: Time(10_600_000_000), linear: 0.067, angular: 0.0 });
        let subjects: Vec<_> = robot.seen.iter().map(|seen| (seen.at.0 / 10_000_000, seen.subject)).collect();
        assert_eq!(subjects, [(1100, None), (1125, Some(6))], "in the order of time");
        assert_eq!(team.landmark(6).unwrap().at, Point::new(0.5, -4.25));
        assert_eq!(team.landmark(72), None);
        assert_eq!(robot.truth, [(Time(10_000_000_000), Pose::new(1.0, 2.0, 3.0))]);
    }

    #[test]
    fn what_is_missing_or_wrong_is_told_with_its_file_and_line() {
        let mut without = files();
        without.remove("Robot1_Measurement.dat");
        assert_eq!(Team::read(&without), Err(Bad::Missing("Robot1_Measurement.dat".into())));
        for (name, text, told) in [
            ("Barcodes.dat", "1 5\n2\n", "Barcodes.dat, line 2: it has 1 words, and must have 2"),
            ("Barcodes.dat", "1.5 5\n", "Barcodes.dat, line 1: 1.5 is no whole number of somebody"),
            ("Robot1_Odometry.dat", "#\n1 x 0\n", "Robot1_Odometry.dat, line 2: \"x\" is no number"),
            ("Robot1_Groundtruth.dat", "1 nan 0 0\n", "Robot1_Groundtruth.dat, line 1: \"nan\" is no number"),
            (
                "Robot1_Groundtruth.dat",
                "1e10 0 0 0\n",
                "Robot1_Groundtruth.dat, line 1: 10000000000 is no time in seconds",
            ),
        ] {
            let mut files = files();
            files.insert(name.into(), text.into());
            assert_eq!(Team::read(&files).unwrap_err().to_string(), told);
        }
    }

    proptest! {
        #[test]
        fn garbage_never_panics(which in 0usize..5, text in "(-?[0-9]{1,12}(\\.[0-9]{0,3})?|1e99|nan|\\PC{1,3}|#|[ \t]|\n){0,60}") {
            let mut files = files();
            files.insert(FILES[which].0.into(), text);
            let _ = Team::read(&files);
        }
    }
}
