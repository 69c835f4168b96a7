//! What is in a log, at a glance.

use std::collections::BTreeMap;
use std::path::Path;

use types::Time;

use super::RunInfo;
use super::pieces::Damage;
use super::reader::{ReadError, Reader};

/// What is in a log.
#[derive(Clone, Debug, PartialEq)]
pub struct Info {
    /// What the log says of its run; nothing in files of other programs.
    pub run: Option<RunInfo>,
    /// The convention that the file keeps, `ros2` in ours.
    pub profile: String,
    /// The program that wrote it.
    pub library: String,
    /// Its topics by name.
    pub topics: Vec<TopicInfo>,
    /// All messages.
    pub messages: u64,
    /// The times of the first and the last message.
    pub span: Option<(Time, Time)>,
    /// Chunks that could be read.
    pub chunks: u64,
    /// Whether the file has its proper end; if not, [`repair`](super::repair) makes one.
    pub whole: bool,
    /// The parts that cannot be read.
    pub damage: Vec<Damage>,
}

/// What is in a topic of a log.
#[derive(Clone, Debug, PartialEq)]
pub struct TopicInfo {
    /// Its name.
    pub topic: String,
    /// The name of its definition.
    pub definition: String,
    /// Number of messages.
    pub messages: u64,
    /// Bytes of the messages.
    pub bytes: u64,
    /// The time of the earliest message.
    pub first: Time,
    /// The time of the latest message.
    pub last: Time,
}

impl TopicInfo {
    /// Messages in a second (Hz), from the first to the last; nothing for fewer than two, or all at once.
    pub fn rate(&self) -> Option<f64> {
        let span = (self.last - self.first).seconds();
        (self.messages > 1 && span > 0.0).then(|| (self.messages - 1) as f64 / span)
    }
}

/// Reads the log `path` from front to back and tells what is in it.
pub fn info(path: impl AsRef<Path>) -> Result<Info, ReadError> {
    let mut reader = Reader::open(path)?;
    let mut topics: BTreeMap<(String, u16), TopicInfo> = BTreeMap::new();
    while let Some(message) = reader.next_message()? {
        let channel = &message.channel;
        let topic = topics.entry((channel.topic.clone(), channel.id)).or_insert_with(|| TopicInfo {
            topic: channel.topic.clone(),
            definition: channel.definition.to_string(),
            messages: 0,
            bytes: 0,
            first: message.time,
            last: message.time,
        });
        topic.messages += 1;
        topic.bytes += message.cdr.len() as u64;
        topic.first = topic.first.min(message.time);
        topic.last = topic.last.max(message.time);
    }
    let topics: Vec<TopicInfo> = topics.into_values().collect();
    let first = topics.iter().map(|topic| topic.first).min();
    let last = topics.iter().map(|topic| topic.last).max();
    Ok(Info {
        messages: topics.iter().map(|topic| topic.messages).sum(),
        span: first.zip(last),
        topics,
        whole: reader.is_whole(),
        run: reader.run,
        profile: reader.profile,
        library: reader.library,
        chunks: reader.chunks,
        damage: reader.damage,
    })
}
