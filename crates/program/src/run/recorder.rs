//! From what agents send to the log file.

use std::collections::{HashMap, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use record::log::{ChannelId, RunInfo, Severity, Tally, WriteError, Writer};
use record::picture;
use runtime::{LogChoice, Recorder};
use types::cdr::{self, NoElement};
use types::definition::Definition;
use types::message::{Message, describe};
use types::messages::{FrameTransform, Image, Odometry, Transforms};
use types::{Duration, Header, Time};

use super::asked::{Asked, OUTSIDE};
use super::judge::{Facts, What};
use super::prepare::Ready;
use crate::terminal;

/// What became of a log, for the summary.
#[derive(Clone, Debug, Default)]
pub(crate) struct LogOutcome {
    /// How many messages went where.
    pub(crate) tally: Tally,
    /// How many pictures are in it.
    pub(crate) images: u64,
    /// What went wrong, each thing once.
    pub(crate) errors: Vec<String>,
    /// Whether the file was ended.
    pub(crate) finished: bool,
}

/// Shared between the log's thread, which writes it, and the summary.
pub(crate) type SharedOutcome = Arc<Mutex<LogOutcome>>;

/// Writes everything that is sent on topics `/agent/port`, notes on `/rosout`, pictures packed and at a rate of their own, and
/// what the judge saw on `/truth/NAME`.
pub(crate) struct LogFile {
    writer: Option<Writer>,
    path: PathBuf,
    channels: HashMap<String, ChannelId>,
    kinds: HashMap<String, Kind>,
    pictures: HashMap<String, Pictures>,
    /// The least time between two pictures of an output.
    picture_gap: Duration,
    facts: Facts,
    asked: Asked,
    /// What was asked from outside, until time has gone on. At one instant it stands behind all else, whether it was asked in the
    /// middle of the instant or, in a repeated run, at its beginning.
    held: VecDeque<(Time, String)>,
    fact_numbers: HashMap<String, u64>,
    /// When the next place of each body goes to the frame tree.
    places: HashMap<String, Time>,
    scratch: cdr::Writer,
    outcome: SharedOutcome,
}

/// An output of pictures.
struct Pictures {
    channel: ChannelId,
    next: Time,
}

/// What is done with the messages of a topic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Kind {
    /// Packed, and not each.
    Picture,
    /// To the topic where viewers look for the frame tree.
    Tree,
    /// Also to the frame tree.
    Place,
    /// As it is.
    #[default]
    Other,
}

impl Kind {
    fn of(definition: &str) -> Kind {
        match definition {
            IMAGE => Kind::Picture,
            Transforms::NAME => Kind::Tree,
            Odometry::NAME => Kind::Place,
            _ => Kind::Other,
        }
    }
}

/// Where viewers look for the frame tree.
const TREE: &str = "/tf";
/// The least time between two places of a body in the frame tree: smooth to the eye.
const PLACES: Duration = Duration::millis(100);

/// The name of the messages of cameras.
const IMAGE: &str = Image::NAME;

impl LogFile {
    /// Begins a log. `images` is how many pictures a second are kept of each output.
    pub(crate) fn create(
        path: &Path,
        run: &RunInfo,
        images: f64,
        facts: Facts,
        asked: Asked,
    ) -> Result<(LogFile, SharedOutcome), WriteError> {
        let outcome = SharedOutcome::default();
        let file = LogFile {
            writer: Some(Writer::create(path, run)?),
            path: path.to_owned(),
            channels: HashMap::new(),
            kinds: HashMap::new(),
            pictures: HashMap::new(),
            picture_gap: if images > 0.0 { Duration::from_seconds(1.0 / images) } else { Duration(i64::MAX) },
            facts,
            asked,
            held: VecDeque::new(),
            fact_numbers: HashMap::new(),
            places: HashMap::new(),
            scratch: cdr::Writer::new(),
            outcome: outcome.clone(),
        };
        Ok((file, outcome))
    }

    fn outcome(&self) -> std::sync::MutexGuard<'_, LogOutcome> {
        self.outcome.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// An error is told once, to people at once and in the summary again; the run goes on.
    fn failed(&self, error: impl std::fmt::Display) {
        let text = error.to_string();
        let mut outcome = self.outcome();
        if !outcome.errors.contains(&text) {
            terminal::tell(&format!("warning: {text}"));
            outcome.errors.push(text);
        }
    }

    /// What cannot be written: said with where it is and what can be done, when the log has ended by it.
    fn not_written(&self, error: &WriteError) {
        match error {
            WriteError::Ended(_) => self.failed(ended(&self.path, error)),
            _ => self.failed(error),
        }
    }

    fn channel(&mut self, topic: &str, definition: &dyn Fn() -> Definition) -> Option<ChannelId> {
        if let Some(known) = self.channels.get(topic) {
            return Some(*known);
        }
        match self.writer.as_mut()?.channel(topic, &definition()) {
            Ok(channel) => {
                self.channels.insert(topic.to_owned(), channel);
                Some(channel)
            }
            Err(error) => {
                self.not_written(&error);
                None
            }
        }
    }

    fn write(&mut self, topic: &str, definition: &dyn Fn() -> Definition, header: &Header, cdr: &[u8]) {
        let Some(channel) = self.channel(topic, definition) else { return };
        if let Some(Err(error)) =
            self.writer.as_mut().map(|out| out.write(channel, header, header.stamp, cdr))
        {
            self.not_written(&error);
        }
    }

    /// What the judge saw before `time`. All of it is there when a message of that time arrives, so the order is always the same.
    fn write_facts(&mut self, time: Time) {
        while let Some(fact) = self.facts.before(time) {
            self.write_held(fact.time);
            match fact.what {
                What::Place(odometry) => self.write_truth(fact.time, &odometry),
                What::Asked { by, text } => self.write_note(fact.time, by, &text),
            }
        }
        self.write_held(time);
    }

    fn write_held(&mut self, time: Time) {
        while let Some((at, text)) = self.held.pop_front_if(|(at, _)| *at < time) {
            self.write_note(at, OUTSIDE, &text);
        }
    }

    fn write_truth(&mut self, time: Time, odometry: &Odometry) {
        let topic = format!("/truth/{}", odometry.body);
        let number = self.fact_numbers.entry(topic.clone()).or_default();
        let header = Header { stamp: time, sequence: *number, ..Header::default() };
        *number += 1;
        let mut scratch = std::mem::take(&mut self.scratch);
        scratch.clear();
        odometry.encode(&[] as &[NoElement], time, &mut scratch);
        self.write(&topic, &describe::<Odometry>, &header, scratch.bytes());
        self.scratch = scratch;
    }

    fn write_note(&mut self, time: Time, who: &str, text: &str) {
        let severity = severity(text);
        if let Some(Err(error)) = self.writer.as_mut().map(|out| out.note(time, severity, who, text)) {
            self.not_written(&error);
        }
    }

    /// Where odometry puts the body, for viewers that draw by the frame tree.
    fn write_place(&mut self, output: &str, header: &Header, cdr: &[u8]) {
        let stamp = header.stamp;
        if self.places.get(output).is_some_and(|next| stamp < *next) {
            return;
        }
        let decoded =
            cdr::Reader::new(cdr).and_then(|mut reader| Odometry::decode(&mut reader, &mut Vec::new()));
        let Ok(Odometry { frame, body, pose, .. }) = decoded else { return };
        self.places.insert(output.to_owned(), stamp + PLACES);
        let edge = FrameTransform { parent: frame, child: body, pose, z: 0.0 };
        let mut scratch = std::mem::take(&mut self.scratch);
        scratch.clear();
        Transforms.encode(&[edge], stamp, &mut scratch);
        self.write(TREE, &describe::<Transforms>, header, scratch.bytes());
        self.scratch = scratch;
    }

    fn write_picture(&mut self, topic: &str, header: &Header, cdr: &[u8]) {
        let topic = format!("{topic}/compressed");
        let Some(channel) = self.channel(&topic, &picture::compressed_image) else { return };
        let gap = self.picture_gap;
        let output = self.pictures.entry(topic).or_insert(Pictures { channel, next: header.stamp });
        // Pictures come a little early or late; half a thousandth of the gap is no reason to leave one out.
        if header.stamp + Duration(gap.0 / 2000) < output.next {
            return;
        }
        output.next = output.next.saturating_add(gap).max(header.stamp);
        let channel = output.channel;
        let packed = packed(cdr, header.stamp);
        match packed {
            Ok(packed) => {
                if let Some(Err(error)) =
                    self.writer.as_mut().map(|out| out.write(channel, header, header.stamp, &packed))
                {
                    self.not_written(&error);
                }
                self.outcome().images += 1;
            }
            Err(error) => self.failed(error),
        }
    }
}

fn packed(cdr: &[u8], stamp: Time) -> Result<Vec<u8>, String> {
    let mut pixels = Vec::new();
    let mut reader = cdr::Reader::new(cdr).map_err(|error| error.to_string())?;
    let image = Image::decode(&mut reader, &mut pixels).map_err(|error| error.to_string())?;
    picture::compress(&image, &pixels, stamp).map_err(|error| error.to_string())
}

impl Recorder for LogFile {
    fn message(&mut self, topic: &str, definition: &dyn Fn() -> Definition, header: &Header, cdr: &[u8]) {
        self.write_facts(header.stamp);
        let output = topic;
        let topic = topic_of(topic);
        // The definition of a topic is made when its first message comes, and not again.
        if !self.kinds.contains_key(&topic) {
            self.kinds.insert(topic.clone(), Kind::of(definition().name));
        }
        match self.kinds.get(&topic).copied().unwrap_or_default() {
            Kind::Picture => self.write_picture(&topic, header, cdr),
            Kind::Tree => self.write(TREE, definition, header, cdr),
            Kind::Place => {
                self.write(&topic, definition, header, cdr);
                self.write_place(output, header, cdr);
            }
            Kind::Other => self.write(&topic, definition, header, cdr),
        }
    }

    fn note(&mut self, time: Time, who: &str, text: &str) {
        self.write_facts(time);
        match self.asked.told(who, text) {
            Some(text) => self.held.push_back((time, text)),
            None => self.write_note(time, who, text),
        }
    }

    fn finish(&mut self) {
        self.held.extend(self.asked.untold_end());
        self.write_facts(Time::NEVER);
        let Some(writer) = self.writer.take() else { return };
        let before = writer.tally();
        match writer.finish() {
            Ok(tally) => self.outcome().tally = tally,
            Err(error) => {
                self.not_written(&error);
                self.outcome().tally = before;
            }
        }
        self.outcome().finished = true;
    }
}

/// What is said of a log that has ended before the run.
fn ended(path: &Path, error: &WriteError) -> String {
    let path = path.display();
    let mend = format!("`sinew log repair {path}` gives it a proper end");
    format!(
        "{path}: {error}; the run goes on. {mend}; for the next run make room there, or name another folder by --out"
    )
}

/// `agent.port` as a topic.
fn topic_of(output: &str) -> String {
    format!("/{}", output.replace('.', "/"))
}

/// How grave a note is. Agents say only what; the supervisor's own words tell the rest.
fn severity(text: &str) -> Severity {
    if ["panicked", "did not return", "failed"].iter().any(|word| text.contains(word)) {
        Severity::Error
    } else if ["latch is set", "refused", "standing", "faults"].iter().any(|word| text.contains(word)) {
        Severity::Warning
    } else {
        Severity::Info
    }
}

/// Which outputs are logged: all, and of pictures only about as many as are kept.
pub(crate) fn choice(ready: &Ready, images: f64) -> LogChoice {
    let periods = ready.robots.iter().filter_map(|robot| robot.description.periods.image);
    let fastest = periods.filter(|period| *period > Duration::ZERO).min();
    let every = match fastest {
        Some(period) if images > 0.0 => (1.0 / (images * period.seconds())).round().max(1.0) as u32,
        Some(_) => 0,
        // A recording's pictures come as they come.
        None => u32::from(images > 0.0),
    };
    LogChoice::by(move |_, message| if message.name == IMAGE { every } else { 1 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_that_ended_is_told_with_its_place_and_what_mends_it() {
        let full = std::io::Error::from_raw_os_error(28);
        let said = ended(Path::new("/tmp/run.mcap"), &WriteError::Ended(full.into()));
        for part in [
            "/tmp/run.mcap: the log ends here: No space left",
            "goes on",
            "sinew log repair /tmp/run.mcap",
            "--out",
        ] {
            assert!(said.contains(part), "{part}: {said}");
        }
    }

    #[test]
    fn outputs_become_topics() {
        assert_eq!(topic_of("sonar.filtered"), "/sonar/filtered");
        assert_eq!(topic_of("left.arm.speed"), "/left/arm/speed");
    }
}
