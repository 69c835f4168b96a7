//! `know put`.

use std::fs;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use knowledge::{Cron, DecisionTable, Fact, Item, Knowledge, Map, Pattern, PatternKind, Schedule, When};
use record::grey::Grey;
use types::value::Table;
use types::{Duration, Pose, Time};

use super::{Answer, show};
use crate::cli::duration;
use crate::error::Failure;
use crate::file::{self, Mistakes, Sources};

/// What can be put.
#[derive(Debug, Subcommand)]
pub(super) enum PutCommand {
    /// A decision table: the rows of a TOML file, or of its section [decide], or the newest version with changes.
    Table(TableArgs),
    /// A fact: sinew know put fact cup in kitchen
    Fact(FactArgs),
    /// What something looks like: a file with a picture, or a range of colours.
    Pattern(PatternArgs),
    /// What is to be asked of the system, and when: sinew know put schedule nightly --cron "0 3 * * *" set wall keep=0.6
    Schedule(ScheduleArgs),
    /// A map from a picture, PNG or PGM, whose lowest row lies at its origin.
    Map(MapArgs),
}

#[derive(Args, Debug)]
pub(super) struct TableArgs {
    /// Its name.
    name: String,
    /// The file with its rows, as in "danger.near" = { safety = 1.0, wall = 0.0 }.
    #[arg(value_name = "FILE", required_unless_present = "set")]
    from: Option<PathBuf>,
    /// Changes a weight, as in danger.near.wall=0.2; may be given several times.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
}

#[derive(Args, Debug)]
pub(super) struct FactArgs {
    /// Of what it is said.
    #[arg(allow_negative_numbers = true)]
    subject: String,
    /// What holds between the two.
    #[arg(allow_negative_numbers = true)]
    predicate: String,
    /// With what it holds.
    #[arg(allow_negative_numbers = true)]
    object: String,
    /// How sure it is, from 0 to 1.
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = confidence)]
    confidence: f64,
    /// Who says it. What one source says again takes the place of what it said before.
    #[arg(long, value_name = "NAME", default_value = "")]
    source: String,
}

#[derive(Args, Debug)]
pub(super) struct PatternArgs {
    /// Its name.
    name: String,
    /// The file with its picture.
    #[arg(value_name = "FILE", required_unless_present = "set")]
    from: Option<PathBuf>,
    /// The form of the file, as in image/png; seen by its first bytes when nothing is said.
    #[arg(long, value_name = "TYPE", requires = "from")]
    media_type: Option<String>,
    /// What else belongs to it; without a file it is a range of colours, as in hue_from=350 or hue=[5.9,0.3] (rad), saturation=0.4.
    /// May be given several times.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
}

#[derive(Args, Debug)]
pub(super) struct ScheduleArgs {
    /// Its name.
    name: String,
    /// By the calendar: minute hour day month weekday, as in "30 8 * * mon-fri".
    #[arg(long, value_name = "FIELDS", required_unless_present_any = ["every", "at"], conflicts_with_all = ["every", "at"])]
    cron: Option<Cron>,
    /// Again and again after so long, as in 10min; from --at on, else from the start of a run on.
    #[arg(long, value_name = "TIME", value_parser = duration)]
    every: Option<Duration>,
    /// So long after the start of a run, as in 30s; once, unless --every is given.
    #[arg(long, value_name = "TIME")]
    at: Option<Duration>,
    /// What to ask, as the timed requests of a system file do.
    #[arg(value_name = "DO", required = true)]
    words: Vec<String>,
}

#[derive(Args, Debug)]
pub(super) struct MapArgs {
    /// Its name.
    name: String,
    /// The picture.
    #[arg(value_name = "FILE")]
    from: PathBuf,
    /// The side of a cell (m).
    #[arg(long, value_name = "M")]
    resolution: f64,
    /// Where the outer corner of the lower left cell lies, and how the map is turned (m, m, rad).
    #[arg(long, value_name = "X,Y,HEADING", default_value = "0,0,0", allow_hyphen_values = true, value_parser = pose)]
    origin: Pose,
}

/// A number from 0 to 1.
pub(super) fn confidence(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if (0.0..=1.0).contains(&x) => Ok(x),
        _ => Err("it is a number from 0 to 1".into()),
    }
}

fn pose(text: &str) -> Result<Pose, String> {
    let numbers: Option<Vec<f64>> =
        text.split(',').map(|part| part.trim().parse().ok().filter(|x: &f64| x.is_finite())).collect();
    match numbers.as_deref() {
        Some(&[x, y, heading]) => Ok(Pose { x, y, heading }),
        _ => Err("it is three numbers, as in -3.5,2,0.1".into()),
    }
}

impl PutCommand {
    pub(super) fn answer(&self, file: &Path, now: Time) -> Result<Answer, Failure> {
        // What can be seen to be wrong without the file makes none.
        let item: Item = match self {
            PutCommand::Table(args) => args.item(file, now)?.into(),
            PutCommand::Fact(args) => args.item(now).into(),
            PutCommand::Pattern(args) => args.item()?.into(),
            PutCommand::Schedule(args) => args.item()?.into(),
            PutCommand::Map(args) => args.item(now)?.into(),
        };
        item.check()?;
        let mut knowledge = Knowledge::open(file)?;
        knowledge.put(item.clone())?;
        let version = match &item {
            Item::Table(table) => {
                knowledge.read()?.history(&table.name)?.first().map(|version| version.number)
            }
            _ => None,
        };
        Ok(show::put(file, &item, version))
    }
}

impl TableArgs {
    fn item(&self, file: &Path, now: Time) -> Result<DecisionTable, Failure> {
        let text =
            self.from.as_deref().map(|from| Ok::<_, Failure>((from.display().to_string(), text(from)?)));
        let text = text.transpose()?;
        let base = match &text {
            None if file.exists() => {
                let known = Knowledge::open_read_only(file)?.read()?.table(&self.name)?;
                known.map(|table| table.weights).unwrap_or_default()
            }
            _ => Table::new(),
        };
        let text = text.as_ref().map(|(name, text)| (name.as_str(), text.as_str()));
        let weights = file::read_alone(text, base, &self.set)?;
        Ok(DecisionTable { name: self.name.clone(), weights, time: now })
    }
}

impl FactArgs {
    fn item(&self, now: Time) -> Fact {
        let FactArgs { subject, predicate, object, confidence, source } = self;
        let fact = Fact::new(subject, predicate, object, now);
        Fact { confidence: *confidence, source: source.clone(), ..fact }
    }
}

impl PatternArgs {
    fn item(&self) -> Result<Pattern, Failure> {
        let (mut sources, mut list, mut parameters) = (Sources::default(), Vec::new(), Table::new());
        for assignment in &self.set {
            list.extend(file::set_in(&mut parameters, &mut sources, assignment, "").err());
        }
        if !list.is_empty() {
            return Err(Mistakes { sources, list }.into());
        }
        let bytes = self.from.as_deref().map(bytes).transpose()?;
        let kind = if bytes.is_some() { PatternKind::Image } else { PatternKind::ColourRange };
        let bytes = bytes.unwrap_or_default();
        let media_type = self.media_type.clone().unwrap_or_else(|| media_type(&bytes).to_owned());
        Ok(Pattern { name: self.name.clone(), kind, media_type, bytes, parameters })
    }
}

/// The form of a file by its first bytes.
fn media_type(bytes: &[u8]) -> &'static str {
    match bytes {
        [] => "",
        [0x89, b'P', b'N', b'G', ..] => "image/png",
        [0xff, 0xd8, 0xff, ..] => "image/jpeg",
        [b'P', b'2' | b'5', ..] => "image/x-portable-graymap",
        [b'P', b'3' | b'6', ..] => "image/x-portable-pixmap",
        _ => "application/octet-stream",
    }
}

impl ScheduleArgs {
    fn item(&self) -> Result<Schedule, Failure> {
        let when = match (&self.cron, self.every, self.at) {
            (Some(cron), ..) => When::Cron(cron.clone()),
            (None, Some(period), first) => {
                When::Every { first: Time::ZERO + first.unwrap_or(Duration::ZERO), period }
            }
            (None, None, at) => When::Once(Time::ZERO + at.unwrap_or(Duration::ZERO)),
        };
        let words = match self.words.as_slice() {
            [line] => control::words::split(line)?,
            several => several.to_vec(),
        };
        // The two that no request to the router is.
        if !matches!(words.first().map(String::as_str), Some("stop" | "reset")) {
            control::words::parse(&words)?;
        }
        Ok(Schedule { name: self.name.clone(), when, words })
    }
}

impl MapArgs {
    fn item(&self, now: Time) -> Result<Map, Failure> {
        let Grey { width, height, pixels } = Grey::read(&bytes(&self.from)?).map_err(|error| {
            Failure::new(format!("{}: {error}", self.from.display()))
                .help("a map is a PNG, or a PGM of 8 bits; keep other files with \"sinew know put pattern\"")
        })?;
        // The first row of a map is its lowest, that of a picture its highest.
        let cells = pixels.chunks_exact(width as usize).rev().flatten().copied().collect();
        let (name, resolution, origin) = (self.name.clone(), self.resolution, self.origin);
        Ok(Map { name, resolution, origin, width, height, cells, time: now })
    }
}

/// The largest file that is read (bytes).
const LARGEST: u64 = 1 << 30;

fn bytes(from: &Path) -> Result<Vec<u8>, Failure> {
    let wrong = |why: String| Failure::new(format!("{} {why}", from.display()));
    match fs::metadata(from) {
        Ok(found) if !found.is_file() => return Err(wrong("is no file".into())),
        Ok(found) if found.len() > LARGEST => return Err(wrong("is larger than 1 GiB".into())),
        _ => {}
    }
    fs::read(from).map_err(|error| wrong(format!("cannot be read: {error}")))
}

fn text(from: &Path) -> Result<String, Failure> {
    String::from_utf8(bytes(from)?)
        .map_err(|_| Failure::new(format!("{} is no text", from.display())).help("a table is TOML in UTF-8"))
}
