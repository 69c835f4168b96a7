//! Reads the log of a run, whole or cut.

use std::collections::{HashMap, VecDeque};
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;
use std::sync::{Arc, OnceLock};

use mcap::records::Record;
use types::value::Value;
use types::{Header, Time, cdr};

use super::pieces::{Damage, Piece, Pieces};
use super::records::{HEADERS, read_header};
use super::{METADATA, PLAN, RunInfo};
use crate::dynamic;
use crate::schema::{ParseError, Schema};

/// Why a log cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file cannot be opened or read.
    #[error("the log {path} cannot be read: {cause}")]
    File {
        /// The file.
        path: String,
        /// What the system says.
        cause: io::Error,
    },
    /// The file does not begin as an MCAP file does.
    #[error("{0} is no log: it does not begin as an MCAP file does")]
    NoLog(String),
}

/// A topic of a log.
#[derive(Debug)]
pub struct Channel {
    /// Its number in the file.
    pub id: u16,
    /// Its name.
    pub topic: String,
    /// The name of its definition, as in `geometry_msgs/msg/Twist`.
    pub definition: Arc<str>,
    /// The definition as the file has it.
    pub definition_text: Arc<str>,
    /// How the messages are encoded; `cdr` for those of ROS 2.
    pub encoding: String,
    schema: Arc<OnceLock<Result<Schema, ParseError>>>,
}

/// A definition of a file. All its topics share it: a file may give a long one to each of 65 535 topics in a few bytes.
#[derive(Clone, Default)]
struct Form {
    name: Arc<str>,
    text: Arc<str>,
    schema: Arc<OnceLock<Result<Schema, ParseError>>>,
}

impl Channel {
    /// The form of its messages, read from the file's own text.
    pub fn schema(&self) -> Result<&Schema, &ParseError> {
        self.schema.get_or_init(|| Schema::parse(&self.definition, &self.definition_text)).as_ref()
    }
}

/// A message of a log.
#[derive(Clone, Debug)]
pub struct Message {
    /// Its topic.
    pub channel: Arc<Channel>,
    /// What came with it; nothing in files of other programs.
    pub header: Option<Header>,
    /// When it was sent.
    pub time: Time,
    /// Its bytes, with the four that name the encoding.
    pub cdr: Vec<u8>,
}

/// Why the bytes of a message say nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DecodeError {
    /// The file's definition cannot be read.
    #[error("the definition of {definition} in the file cannot be read: {cause}")]
    Definition {
        /// Its name.
        definition: String,
        /// What is wrong in it.
        cause: ParseError,
    },
    /// The bytes do not fit the definition.
    #[error(transparent)]
    Bytes(#[from] cdr::Error),
}

impl Message {
    /// The message as a tree of values.
    pub fn value(&self) -> Result<Value, DecodeError> {
        let schema = self.channel.schema().map_err(|cause| DecodeError::Definition {
            definition: self.channel.definition.to_string(),
            cause: cause.clone(),
        })?;
        Ok(dynamic::decode(schema, &self.cdr)?)
    }
}

/// Reads the messages of a log in the order in which they were written, one chunk in memory at a time.
///
/// Parts that cannot be read are passed over and told by [`damage`](Self::damage). The headers' own topic is not among the
/// messages: each message brings its header.
pub struct Reader {
    path: String,
    pieces: Pieces<Box<dyn Read + Send>>,
    schemas: HashMap<u16, Form>,
    channels: HashMap<u16, Arc<Channel>>,
    /// The header that was read last, for the message behind it.
    waiting: Option<(u16, Header)>,
    messages: VecDeque<Message>,
    /// The last chunk could not be read, and the index of what was in it may follow.
    behind_damage: bool,
    pub(super) run: Option<RunInfo>,
    pub(super) damage: Vec<Damage>,
    pub(super) chunks: u64,
    pub(super) profile: String,
    pub(super) library: String,
}

impl Reader {
    /// Begins to read the log `path`.
    pub fn open(path: impl AsRef<Path>) -> Result<Reader, ReadError> {
        let path = path.as_ref();
        let name = path.display().to_string();
        let open = || -> io::Result<(u64, File)> {
            let file = File::open(path)?;
            Ok((file.metadata()?.len(), file))
        };
        let (len, file) = open().map_err(|cause| ReadError::File { path: name.clone(), cause })?;
        Reader::from(Box::new(BufReader::with_capacity(1 << 16, file)), len, name)
    }

    /// Begins to read `len` bytes from any place; `name` stands for it in errors.
    pub fn from(input: Box<dyn Read + Send>, len: u64, name: impl Into<String>) -> Result<Reader, ReadError> {
        let path = name.into();
        let pieces =
            Pieces::new(input, len).map_err(|cause| ReadError::File { path: path.clone(), cause })?;
        let pieces = pieces.ok_or_else(|| ReadError::NoLog(path.clone()))?;
        let mut reader = Reader {
            path,
            pieces,
            schemas: HashMap::new(),
            channels: HashMap::new(),
            waiting: None,
            messages: VecDeque::new(),
            behind_damage: false,
            run: None,
            damage: Vec::new(),
            chunks: 0,
            profile: String::new(),
            library: String::new(),
        };
        // What the log says of its run stands in front of the first message.
        while reader.messages.is_empty() && reader.advance()? {}
        Ok(reader)
    }

    /// What the log says of its run; nothing in files of other programs.
    pub fn run(&self) -> Option<&RunInfo> {
        self.run.as_ref()
    }

    /// The parts that could not be read, as far as the reader has come.
    pub fn damage(&self) -> &[Damage] {
        &self.damage
    }

    /// Whether the file was met with its proper end. False until all messages are read, and for a run that was cut off.
    pub fn is_whole(&self) -> bool {
        self.pieces.whole
    }

    /// The next message, nothing at the end.
    pub fn next_message(&mut self) -> Result<Option<Message>, ReadError> {
        while self.messages.is_empty() {
            if !self.advance()? {
                return Ok(None);
            }
        }
        Ok(self.messages.pop_front())
    }

    /// Takes in the next piece; false at the end.
    fn advance(&mut self) -> Result<bool, ReadError> {
        let next = self.pieces.next().map_err(|cause| ReadError::File { path: self.path.clone(), cause })?;
        match next {
            None => return Ok(false),
            Some(Piece::Single(record)) => self.take(record),
            Some(Piece::Index(channel, messages)) => {
                let ours = self.channels.get(&channel).is_some_and(|channel| channel.topic == HEADERS);
                if let Some(damage) = self.damage.last_mut().filter(|_| self.behind_damage && !ours) {
                    damage.count(messages);
                }
            }
            Some(Piece::Chunk(records)) => {
                self.behind_damage = false;
                self.chunks += 1;
                for record in records {
                    self.take(record);
                }
            }
            Some(Piece::Damaged(damage)) => {
                self.behind_damage = true;
                self.damage.push(damage);
            }
        }
        Ok(true)
    }

    fn take(&mut self, record: Record<'static>) {
        match record {
            Record::Header(header) => (self.profile, self.library) = (header.profile, header.library),
            Record::Schema { header, data } => {
                let (name, text) = (header.name.into(), String::from_utf8_lossy(&data).into());
                self.schemas.insert(header.id, Form { name, text, schema: Arc::default() });
            }
            Record::Channel(channel) => {
                let form = self.schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                self.channels.entry(channel.id).or_insert_with(|| {
                    Arc::new(Channel {
                        id: channel.id,
                        topic: channel.topic,
                        definition: form.name,
                        definition_text: form.text,
                        encoding: channel.message_encoding,
                        schema: form.schema,
                    })
                });
            }
            Record::Message { header, data } => self.take_message(header, data.into_owned()),
            Record::Metadata(data) if data.name == METADATA => {
                let plan = self.run.take().map(|run| run.plan).unwrap_or_default();
                self.run = Some(RunInfo { plan, ..RunInfo::from_metadata(&data.metadata) });
            }
            Record::Attachment { header, data, .. } if header.name == PLAN => {
                self.run.get_or_insert_default().plan = String::from_utf8_lossy(&data).into_owned();
            }
            _ => {}
        }
    }

    fn take_message(&mut self, record: mcap::records::MessageHeader, cdr: Vec<u8>) {
        // Where the chunk that names the channel is lost, its messages cannot be understood.
        let Some(channel) = self.channels.get(&record.channel_id) else { return };
        if channel.topic == HEADERS {
            self.waiting = read_header(&cdr).ok();
            return;
        }
        let header = self.waiting.take().filter(|(of, _)| *of == record.channel_id).map(|(_, header)| header);
        let time = Time(i64::try_from(record.log_time).unwrap_or(i64::MAX));
        self.messages.push_back(Message { channel: channel.clone(), header, time, cdr });
    }
}

impl Iterator for Reader {
    type Item = Result<Message, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.next_message().transpose()
    }
}
