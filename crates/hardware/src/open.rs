//! From the word in a system file to a driver.

use std::io;
use std::path::{Path, PathBuf};

use types::value::nearest;

use crate::driver::Driver;
use crate::lines::Report;
use crate::replay::{ReplayError, Replayed};
use crate::{carmen, ticks};

/// What `driver = "…"` of a robot says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Spec {
    /// `sim`: in the simulated world of the plan.
    Simulated,
    /// `carmen:FILE`: a CARMEN log.
    Carmen(PathBuf),
    /// `ticks:FILE`: raw wheel counts and scans.
    Ticks(PathBuf),
    /// `replay:FILE`: a log of a run.
    Replay(PathBuf),
}

/// The words that a spec begins with.
const WORDS: [&str; 4] = ["sim", "carmen", "ticks", "replay"];

/// Why there is no driver.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// There is no driver of this name.
    #[error("there is no driver \"{word}\"{}; there are \"sim\", \"carmen:FILE\", \"ticks:FILE\" and \"replay:FILE\"", meant(.nearest))]
    Unknown {
        /// The word.
        word: String,
        /// The most similar one that there is.
        nearest: Option<&'static str>,
    },
    /// The driver plays a file, and none is named.
    #[error("the driver \"{0}\" needs a file, as in \"{0}:run.log\"")]
    NoFile(&'static str),
    /// `sim` takes no file.
    #[error("the driver \"sim\" takes no file; the world is named by \"world\" in the plan")]
    FileForSim,
    /// A simulated robot lives in the world of its plan.
    #[error("a robot with the driver \"sim\" belongs into a world; name one with \"world\" in the plan")]
    NeedsWorld,
    /// The file cannot be read.
    #[error("{path} cannot be read: {cause}. {help}")]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        cause: io::Error,
        /// How to get one.
        help: &'static str,
    },
    /// There is nothing in the file that could be played.
    #[error("{path} holds nothing to play ({report}). {help}")]
    Empty {
        /// The file.
        path: PathBuf,
        /// What was in it.
        report: Box<Report>,
        /// How to get one.
        help: &'static str,
    },
    /// A log cannot be played.
    #[error("{0}. Logs are written by a run with a log file")]
    Replay(#[from] ReplayError),
}

fn meant(nearest: &Option<&'static str>) -> String {
    nearest.map_or_else(String::new, |word| format!(", did you mean \"{word}\"?"))
}

/// How to get a CARMEN log.
const CARMEN_HELP: &str = "A CARMEN log, plain or gzip, holds lines such as ODOM, FLASER or ROBOTLASER1; \
    the public SLAM collections of Freiburg and of radish offer them";
/// How to get a file of counts.
const TICKS_HELP: &str = "A file of counts has 707 words a line: a time in microseconds, wheel counts, and 682 ranges in millimetres";

impl Spec {
    /// Reads a spec.
    ///
    /// # Errors
    /// When it names no driver, or a file is missing or too much.
    pub fn parse(text: &str) -> Result<Spec, OpenError> {
        let (word, file) = match text.split_once(':') {
            Some((word, file)) => (word, Some(file.trim()).filter(|file| !file.is_empty())),
            None => (text, None),
        };
        let path = |driver| file.map(PathBuf::from).ok_or(OpenError::NoFile(driver));
        match word {
            "sim" if text.contains(':') => Err(OpenError::FileForSim),
            "sim" => Ok(Spec::Simulated),
            "carmen" => path("carmen").map(Spec::Carmen),
            "ticks" => path("ticks").map(Spec::Ticks),
            "replay" => path("replay").map(Spec::Replay),
            _ => {
                let near =
                    nearest(word, WORDS).and_then(|near| WORDS.into_iter().find(|known| *known == near));
                Err(OpenError::Unknown { word: word.to_owned(), nearest: near })
            }
        }
    }

    /// Whether a simulated clock can drive it: for all but hardware.
    pub fn is_for_simulated_clock(&self) -> bool {
        match self {
            Spec::Simulated | Spec::Carmen(_) | Spec::Ticks(_) | Spec::Replay(_) => true,
        }
    }
}

/// An opened driver, and what was in its file.
pub struct Opened {
    /// To be given to a [`Gate`](crate::Gate).
    pub driver: Box<dyn Driver>,
    /// What was in the file; nothing for a log of a run.
    pub report: Option<Report>,
}

impl std::fmt::Debug for Opened {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Opened").field("robot", self.driver.describe()).field("report", &self.report).finish()
    }
}

/// Opens the driver of a robot. Relative files are looked for in `folder`. Simulated robots come from
/// [`simulated::raise`](crate::simulated::raise), all of a world at once.
///
/// # Errors
/// When the spec or its file is not what it should be.
pub fn open(spec: &str, robot: &str, folder: &Path) -> Result<Opened, OpenError> {
    match Spec::parse(spec)? {
        Spec::Simulated => Err(OpenError::NeedsWorld),
        Spec::Carmen(path) => recorded(&folder.join(path), carmen::open, CARMEN_HELP),
        Spec::Ticks(path) => recorded(&folder.join(path), ticks::open, TICKS_HELP),
        Spec::Replay(path) => {
            let driver = Replayed::open(&folder.join(path), robot)?;
            Ok(Opened { driver: Box::new(driver), report: None })
        }
    }
}

fn recorded(
    path: &Path,
    read: fn(&Path) -> io::Result<crate::recording::Recording>,
    help: &'static str,
) -> Result<Opened, OpenError> {
    let recording = read(path).map_err(|cause| OpenError::File { path: path.to_owned(), cause, help })?;
    let report = recording.report.clone();
    if recording.records.is_empty() {
        return Err(OpenError::Empty { path: path.to_owned(), report: Box::new(report), help });
    }
    Ok(Opened { driver: Box::new(recording.play()), report: Some(report) })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(spec: &str) -> String {
        open(spec, "h1", Path::new(".")).unwrap_err().to_string()
    }

    #[test]
    fn specs() {
        assert_eq!(Spec::parse("sim").unwrap(), Spec::Simulated);
        assert_eq!(Spec::parse("carmen:a:b.log").unwrap(), Spec::Carmen("a:b.log".into()));
        assert_eq!(Spec::parse("ticks:exp1.dat.gz").unwrap(), Spec::Ticks("exp1.dat.gz".into()));
        assert_eq!(Spec::parse("replay:run.mcap").unwrap(), Spec::Replay("run.mcap".into()));
    }

    #[test]
    fn errors_name_the_nearest_word_the_missing_part_and_the_file() {
        assert!(said("carman:x.log").starts_with("there is no driver \"carman\", did you mean \"carmen\"?"));
        assert!(said("quantum").starts_with("there is no driver \"quantum\"; there are \"sim\""));
        assert_eq!(said("replay:"), "the driver \"replay\" needs a file, as in \"replay:run.log\"");
        assert!(said("sim:lab").contains("takes no file"));
        assert!(said("sim").contains("world"));
        let missing = said("carmen:nowhere.log");
        assert!(
            missing.contains("nowhere.log") && missing.contains("CARMEN log, plain or gzip"),
            "{missing}"
        );
        assert!(said("replay:nowhere.mcap").contains("nowhere.mcap"));
        assert!(said("carmen:Cargo.toml").contains("holds nothing to play"));
    }
}
