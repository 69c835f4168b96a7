//! The thread that keeps the log: it drains the rings of the threads that run agents, encodes what it finds, and gives it to a
//! recorder and to those who listen.

#![allow(unsafe_code)]

use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Mutex, PoisonError};

use types::cdr::Writer;
use types::definition::Definition;
use types::{AgentId, Header, Time};

use crate::message_type::MessageType;
use crate::names::Directory;
use crate::system::CannotRun;
use crate::tap::{Heard, Tap};
use crate::trace;

/// Where the log goes.
pub trait Recorder: Send {
    /// A message of the output called `topic`.
    fn message(&mut self, topic: &str, definition: &dyn Fn() -> Definition, header: &Header, cdr: &[u8]);
    /// What an agent, or the supervisor, says.
    fn note(&mut self, time: Time, who: &str, text: &str);
    /// The run is over.
    fn finish(&mut self);
}

type Choose = dyn Fn(&str, &'static MessageType) -> u32 + Send + Sync;

/// Which outputs are logged.
#[derive(Clone)]
pub struct LogChoice {
    every: Arc<Choose>,
}

impl Default for LogChoice {
    /// None.
    fn default() -> LogChoice {
        LogChoice::by(|_, _| 0)
    }
}

impl LogChoice {
    /// For each output, by name and type, every how many messages one is logged; zero for none.
    pub fn by(every: impl Fn(&str, &'static MessageType) -> u32 + Send + Sync + 'static) -> LogChoice {
        LogChoice { every: Arc::new(every) }
    }

    pub(crate) fn every(&self, name: &str, message: &'static MessageType) -> u32 {
        (self.every)(name, message)
    }
}

/// Outputs by their number in the log, and who listens to them: shared by the router and the log thread, both ordinary.
#[derive(Default)]
pub(crate) struct Topics {
    pub outputs: Vec<(String, &'static MessageType)>,
    pub taps: Vec<(u32, Tap)>,
    /// For each output, every how many messages the recorder gets one.
    pub every: Vec<u32>,
    /// The numbers of each name: one for each type of message that it ever had.
    numbers: HashMap<String, Vec<u32>>,
}

impl Topics {
    /// The number of an output, the same as before where one of that name and type was there before; else a new one, of which the recorder
    /// gets one message of `every`.
    pub(crate) fn number_of(&mut self, name: String, message: &'static MessageType, every: u32) -> u32 {
        let known = self.numbers.get(&name).into_iter().flatten();
        if let Some(number) = known.copied().find(|number| self.outputs[*number as usize].1 == message) {
            return number;
        }
        let number = self.outputs.len() as u32;
        self.numbers.entry(name.clone()).or_default().push(number);
        self.outputs.push((name, message));
        self.every.push(every);
        number
    }
}

/// What the log thread is told by others.
pub(crate) struct LogShared {
    pub topics: Mutex<Topics>,
    notes: Mutex<Vec<(Time, String, String)>>,
    stop: AtomicBool,
    pub dropped: AtomicU64,
}

impl LogShared {
    pub(crate) fn new() -> Arc<LogShared> {
        Arc::new(LogShared {
            topics: Mutex::default(),
            notes: Mutex::default(),
            stop: AtomicBool::new(false),
            dropped: AtomicU64::new(0),
        })
    }

    pub(crate) fn topics(&self) -> std::sync::MutexGuard<'_, Topics> {
        self.topics.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a line from an ordinary thread.
    pub(crate) fn note(&self, time: Time, who: &str, text: &str) {
        let mut notes = self.notes.lock().unwrap_or_else(PoisonError::into_inner);
        notes.push((time, who.to_owned(), text.to_owned()));
    }
}

/// The log thread.
pub(crate) struct LogThread {
    shared: Arc<LogShared>,
    thread: Option<std::thread::JoinHandle<Vec<Noted>>>,
}

/// What an agent noted in a run, whether that was logged or not: each text once.
#[derive(Clone, Debug, PartialEq)]
pub struct Noted {
    /// Who.
    pub agent: String,
    /// What; with its numbers as they were the last time.
    pub what: String,
    /// When for the first time.
    pub first: Time,
    /// When for the last time.
    pub last: Time,
    /// How often.
    pub count: u64,
}

/// So many different notes are kept for the end of a run; what is noted beyond is in the log alone.
const MOST_NOTED: usize = 1024;

/// The notes of a run so far, by who and by the text as it stands in the code.
#[derive(Default)]
struct Notes(BTreeMap<(AgentId, &'static str), Kept>);

/// A note that is kept.
struct Kept {
    numbers: Vec<f64>,
    first: Time,
    last: Time,
    count: u64,
}

impl Notes {
    fn keep(&mut self, time: Time, agent: AgentId, text: &'static str, numbers: &[f64]) {
        let is_full = self.0.len() >= MOST_NOTED;
        match self.0.entry((agent, text)) {
            Entry::Occupied(mut known) => {
                let known = known.get_mut();
                known.numbers.clear();
                known.numbers.extend_from_slice(numbers);
                (known.last, known.count) = (time, known.count + 1);
            }
            Entry::Vacant(place) if !is_full => {
                place.insert(Kept { numbers: numbers.to_vec(), first: time, last: time, count: 1 });
            }
            Entry::Vacant(_) => {}
        }
    }

    /// In the order in which they were first noted.
    fn told(self, directory: &Directory) -> Vec<Noted> {
        let told = |((agent, text), kept): ((AgentId, &'static str), Kept)| Noted {
            agent: name_of(directory, agent),
            what: filled(text, &kept.numbers),
            first: kept.first,
            last: kept.last,
            count: kept.count,
        };
        let mut told: Vec<Noted> = self.0.into_iter().map(told).collect();
        told.sort_by_key(|noted| noted.first);
        told
    }
}

/// How long the log thread sleeps when there is nothing to do.
const PAUSE: std::time::Duration = std::time::Duration::from_millis(2);

impl LogThread {
    pub(crate) fn start(
        shared: Arc<LogShared>,
        readers: Vec<trace::Reader>,
        recorder: Option<Box<dyn Recorder>>,
        directory: Arc<Directory>,
    ) -> Result<LogThread, CannotRun> {
        let mine = shared.clone();
        let thread = std::thread::Builder::new()
            .name("sinew-log".into())
            .spawn(move || keep(&mine, readers, recorder, &directory))
            .map_err(|error| CannotRun::NoThread(error.to_string()))?;
        Ok(LogThread { shared, thread: Some(thread) })
    }

    /// Ends the thread after it has drained everything. Gives how many records found no room, and what was noted.
    pub(crate) fn finish(mut self) -> (u64, Vec<Noted>) {
        self.shared.stop.store(true, Ordering::Release);
        let mut noted = Vec::new();
        if let Some(thread) = self.thread.take() {
            // It need not sleep to the end of its pause: to a minute of simulated time that adds a millisecond or two.
            thread.thread().unpark();
            // A recorder that panicked has said so; the run itself is not harmed.
            noted = thread.join().unwrap_or_default();
        }
        (self.shared.dropped.load(Ordering::Relaxed), noted)
    }
}

fn keep(
    shared: &LogShared,
    mut readers: Vec<trace::Reader>,
    mut recorder: Option<Box<dyn Recorder>>,
    directory: &Directory,
) -> Vec<Noted> {
    let mut writer = Writer::new();
    let mut notes_so_far = Notes::default();
    loop {
        let last = shared.stop.load(Ordering::Acquire);
        let mut records = 0;
        for reader in &mut readers {
            records += reader.drain(|record| {
                let topics = shared.topics();
                if let trace::Record::Note { time, agent, text, numbers } = &record {
                    notes_so_far.keep(*time, *agent, text, numbers);
                }
                handle(record, &topics, &mut recorder, directory, &mut writer);
            });
        }
        let notes = core::mem::take(&mut *shared.notes.lock().unwrap_or_else(PoisonError::into_inner));
        if let Some(recorder) = &mut recorder {
            notes.iter().for_each(|(time, who, text)| recorder.note(*time, who, text));
        }
        shared.dropped.store(readers.iter().map(trace::Reader::dropped).sum(), Ordering::Relaxed);
        if records == 0 {
            if last {
                break;
            }
            std::thread::park_timeout(PAUSE);
        }
    }
    if let Some(mut recorder) = recorder {
        recorder.finish();
    }
    notes_so_far.told(directory)
}

fn handle(
    record: trace::Record<'_>,
    topics: &Topics,
    recorder: &mut Option<Box<dyn Recorder>>,
    directory: &Directory,
    writer: &mut Writer,
) {
    match record {
        trace::Record::Message { output, header, head, len, row } => {
            let Some((name, message)) = topics.outputs.get(output as usize) else { return };
            writer.clear();
            // SAFETY: the record was written by the output with this number, which is of this type for as long as it lives.
            unsafe { message.encode(head, row, len, header.stamp, writer) };
            let every = topics.every.get(output as usize).copied().unwrap_or(0);
            if let Some(recorder) = recorder
                && every > 0
                && header.sequence.is_multiple_of(every.into())
            {
                recorder.message(name, &message.definition, &header, writer.bytes());
            }
            for (_, tap) in topics.taps.iter().filter(|(number, _)| *number == output) {
                tap.give(Heard { header, cdr: writer.bytes().to_vec() });
            }
        }
        trace::Record::Note { time, agent, text, numbers } => {
            if let Some(recorder) = recorder {
                recorder.note(time, &name_of(directory, agent), &filled(text, numbers));
            }
        }
        trace::Record::Line { time, text } => {
            let (who, what) = text.split_once('\n').unwrap_or(("", text));
            if let Some(recorder) = recorder {
                recorder.note(time, who, what);
            }
        }
    }
}

fn name_of(directory: &Directory, agent: AgentId) -> String {
    directory.name(agent).map_or_else(|| "sinew".to_owned(), |name| name.as_str().to_owned())
}

/// The text with its numbers in the places of `{}`.
fn filled(text: &str, numbers: &[f64]) -> String {
    let mut out = String::new();
    let mut numbers = numbers.iter();
    let mut parts = text.split("{}");
    out.push_str(parts.next().unwrap_or_default());
    for part in parts {
        match numbers.next() {
            Some(number) => out += &format!("{}", (number * 1e6).round() / 1e6),
            None => out.push_str("{}"),
        }
        out.push_str(part);
    }
    out
}

/// Notes a static text with up to four numbers in the places of `{}`, from within a step: it is formatted later, elsewhere.
///
/// ```
/// runtime::note!("a wall {} m ahead, {} m to the left", 0.5, 1.25);
/// ```
#[macro_export]
macro_rules! note {
    ($text:literal $(, $number:expr)* $(,)?) => {
        $crate::write_note($text, &[$($number as f64),*])
    };
}

/// What [`note!`] calls.
pub fn write_note(text: &'static str, numbers: &[f64]) {
    if let Some(context) = crate::context::current() {
        context.log(|log| log.note(context.now(), context.agent(), text, &numbers[..numbers.len().min(4)]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_note_is_kept_once_for_each_agent_with_its_last_numbers() {
        let at = |secs| Time::from_seconds(secs);
        let mut notes = Notes::default();
        notes.keep(at(2.0), AgentId(1), "at {}", &[2.0]);
        notes.keep(at(1.0), AgentId(0), "at {}", &[1.0]);
        notes.keep(at(3.0), AgentId(1), "at {}", &[3.0]);
        let told = notes.told(&Directory::new());
        let told: Vec<_> =
            told.iter().map(|noted| (noted.what.as_str(), noted.first, noted.last, noted.count)).collect();
        assert_eq!(told, [("at 1", at(1.0), at(1.0), 1), ("at 3", at(2.0), at(3.0), 2)]);
        let mut full = Notes::default();
        (0..2000).for_each(|i| full.keep(at(0.0), AgentId(i), "again", &[]));
        assert_eq!(full.told(&Directory::new()).len(), MOST_NOTED);
    }

    #[test]
    fn numbers_take_their_places() {
        assert_eq!(filled("at {} of {}", &[0.25, 3.0]), "at 0.25 of 3");
        assert_eq!(filled("{}{}", &[1.0]), "1{}");
        assert_eq!(filled("none", &[1.0]), "none");
    }
}
