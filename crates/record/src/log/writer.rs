//! Writes the log of a run.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

use mcap::records::{MessageHeader, Metadata};
use types::definition::Definition;
use types::{Header, Time, cdr};

use super::disk::{Disk, Sink};
use super::records::{HEADERS, ROSOUT, Severity, message_header, rosout_log, write_header, write_note};
use super::{Clock, METADATA, PLAN, RunInfo};

/// A chunk closes when run time passes a multiple of this (s · 10⁻⁹): what a crash may cost.
const CHUNK_NANOSECONDS: i64 = 500_000_000;
/// A chunk closes early when its messages have so many bytes, so that a camera does not fill the memory.
const CHUNK_BYTES: usize = 8 << 20;
/// The name of the program in the file, without a version, which would change the bytes.
const LIBRARY: &str = "sinew";

/// A topic of a log that is being written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ChannelId(pub u16);

/// How many messages went where.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Messages in closed chunks, which outlive the process.
    pub safe: u64,
    /// Messages in the open chunk.
    pub open: u64,
    /// Messages that are not in the log, because it could not be written any more.
    pub lost: u64,
    /// Bytes of the closed chunks and what stands around them.
    pub bytes: u64,
}

/// Why a log cannot be written. Told once: from then on messages are counted as lost.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The file cannot be made.
    #[error("the log {path} cannot be made: {cause}")]
    Create {
        /// The file.
        path: String,
        /// What the system says.
        cause: std::io::Error,
    },
    /// The file cannot be written any more: a full disk, mostly. What is in it can still be read.
    #[error(
        "the log ends here: {}; what was written before can be read, later messages are lost and counted",
        cause(.0)
    )]
    Ended(mcap::McapError),
    /// A definition has the name of another one that differs.
    #[error("\"{0}\" is already in the log with other fields")]
    TwoForms(String),
    /// A file holds at most 65 535 topics and as many definitions.
    #[error("the log has no room for another topic: {0}")]
    TooMany(mcap::McapError),
}

/// What went wrong as the system says it: the library's own words hide whether the disk is full or gone.
fn cause(error: &mcap::McapError) -> String {
    match error {
        mcap::McapError::Io(cause) => cause.to_string(),
        other => other.to_string(),
    }
}

/// Writes the log of a run. Dropping it ends the file as [`finish`](Self::finish) does, but tells no errors.
pub struct Writer {
    /// Nothing when it failed or was finished.
    out: Option<mcap::Writer<Disk>>,
    schemas: BTreeMap<String, (u16, String)>,
    channels: BTreeMap<(String, u16), ChannelId>,
    headers: ChannelId,
    rosout: Option<ChannelId>,
    notes: u64,
    scratch: cdr::Writer,
    chunk: i64,
    open_bytes: usize,
    tally: Tally,
}

impl Writer {
    /// Begins the log `path`, over what may be there. On the wall clock each chunk waits for the disk itself, so that it
    /// outlives a loss of power; a simulated run does not wait for it.
    pub fn create(path: impl AsRef<Path>, run: &RunInfo) -> Result<Writer, WriteError> {
        let path = path.as_ref();
        let file = File::create(path)
            .map_err(|cause| WriteError::Create { path: path.display().to_string(), cause })?;
        Writer::to(Box::new(file), run)
    }

    /// Begins a log in any sink.
    pub fn to(sink: Box<dyn Sink>, run: &RunInfo) -> Result<Writer, WriteError> {
        let disk = Disk::new(sink, run.clock == Clock::Wall);
        let mut out = options().create(disk).map_err(WriteError::Ended)?;
        begin(&mut out, run).map_err(WriteError::Ended)?;
        let mut writer = Writer {
            out: Some(out),
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
            headers: ChannelId(0),
            rosout: None,
            notes: 0,
            scratch: cdr::Writer::new(),
            chunk: i64::MIN,
            open_bytes: 0,
            tally: Tally::default(),
        };
        writer.headers = writer.channel(HEADERS, &message_header())?;
        writer.close_chunk()?;
        Ok(writer)
    }

    /// A topic for messages of a definition; asked for again, the same one. After the log ended any answer serves as well.
    pub fn channel(&mut self, topic: &str, definition: &Definition) -> Result<ChannelId, WriteError> {
        let Some(out) = self.out.as_mut() else { return Ok(ChannelId(0)) };
        let text = definition.text();
        let schema = match self.schemas.get(definition.name) {
            Some((id, known)) if *known == text => *id,
            Some(_) => return Err(WriteError::TwoForms(definition.name.to_owned())),
            None => {
                let id = out
                    .add_schema(definition.name, "ros2msg", text.as_bytes())
                    .map_err(WriteError::TooMany)?;
                self.schemas.insert(definition.name.to_owned(), (id, text));
                id
            }
        };
        let key = (topic.to_owned(), schema);
        if let Some(known) = self.channels.get(&key) {
            return Ok(*known);
        }
        let id = out.add_channel(schema, topic, "cdr", &BTreeMap::new()).map_err(WriteError::TooMany)?;
        self.channels.insert(key, ChannelId(id));
        Ok(ChannelId(id))
    }

    /// Writes a message that was sent at `time`, its CDR bytes with the four that name the encoding.
    ///
    /// An error is told once; later messages are counted in [`tally`](Self::tally) and are no error again.
    pub fn write(
        &mut self,
        channel: ChannelId,
        header: &Header,
        time: Time,
        cdr: &[u8],
    ) -> Result<(), WriteError> {
        let full = self.open_bytes > CHUNK_BYTES;
        let ready = self.advance(time).and_then(|()| if full { self.close_chunk() } else { Ok(()) });
        if let Err(error) = ready {
            self.tally.lost += 1;
            return Err(error);
        }
        let Some(out) = self.out.as_mut() else {
            self.tally.lost += 1;
            return Ok(());
        };
        write_header(channel.0, header, &mut self.scratch);
        let log_time = nanoseconds(time);
        let mut record = MessageHeader {
            channel_id: self.headers.0,
            // The whole number is in the header's own message.
            sequence: header.sequence as u32,
            log_time,
            publish_time: nanoseconds(header.stamp),
        };
        let mut done = out.write_to_known_channel(&record, self.scratch.bytes());
        record.channel_id = channel.0;
        done = done.and_then(|()| out.write_to_known_channel(&record, cdr));
        self.tally.open += 1;
        self.open_bytes += cdr.len() + self.scratch.bytes().len();
        done.map_err(|cause| self.fail(cause))
    }

    /// Writes a note to people on `/rosout`; `name` is that of the agent or part that says it.
    pub fn note(&mut self, time: Time, severity: Severity, name: &str, text: &str) -> Result<(), WriteError> {
        let channel = match self.rosout {
            Some(channel) => channel,
            None => self.channel(ROSOUT, &rosout_log())?,
        };
        self.rosout = Some(channel);
        let mut note = cdr::Writer::new();
        write_note(time, severity, name, text, &mut note);
        let header = Header {
            stamp: time,
            sequence: self.notes,
            category: types::Category::Event,
            ..Header::default()
        };
        self.notes += 1;
        self.write(channel, &header, time, note.bytes())
    }

    /// Tells the log that run time has come to `now`: closes the chunk when half a second is over. Each message does so too;
    /// call it when there are none.
    pub fn advance(&mut self, now: Time) -> Result<(), WriteError> {
        let chunk = now.0.div_euclid(CHUNK_NANOSECONDS);
        let over = chunk > self.chunk && self.tally.open > 0;
        self.chunk = self.chunk.max(chunk);
        if over { self.close_chunk() } else { Ok(()) }
    }

    /// How many messages went where so far.
    pub fn tally(&self) -> Tally {
        self.tally
    }

    /// Ends the file with its index.
    pub fn finish(mut self) -> Result<Tally, WriteError> {
        self.end()?;
        Ok(self.tally)
    }

    fn close_chunk(&mut self) -> Result<(), WriteError> {
        let Some(out) = self.out.as_mut() else { return Ok(()) };
        self.open_bytes = 0;
        match out.flush() {
            Ok(()) => {
                self.settle();
                Ok(())
            }
            Err(cause) => Err(self.fail(cause)),
        }
    }

    fn settle(&mut self) {
        self.tally.safe += std::mem::take(&mut self.tally.open);
    }

    fn fail(&mut self, cause: mcap::McapError) -> WriteError {
        self.tally.lost += std::mem::take(&mut self.tally.open);
        if let Some(out) = self.out.take() {
            // Without this the writer would try to end a file that it cannot write.
            drop(out.into_inner());
        }
        WriteError::Ended(cause)
    }

    fn end(&mut self) -> Result<(), WriteError> {
        self.close_chunk()?;
        let Some(mut out) = self.out.take() else { return Ok(()) };
        let done = out.finish();
        let mut disk = out.into_inner();
        let done = done.and_then(|_| Ok(std::io::Write::flush(&mut disk)?));
        self.tally.bytes = disk.len();
        done.map_err(WriteError::Ended)
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        // Nobody is left to be told.
        let _ = self.end();
    }
}

/// Options under which the same messages give the same bytes, and a chunk is either whole in the file or not there.
pub(super) fn options() -> mcap::WriteOptions {
    mcap::WriteOptions::new()
        .profile("ros2")
        .library(LIBRARY)
        .compression(Some(mcap::Compression::Lz4))
        // Chunks are closed by run time, see above.
        .chunk_size(None)
        .disable_seeking(true)
}

fn begin(out: &mut mcap::Writer<Disk>, run: &RunInfo) -> mcap::McapResult<()> {
    out.write_metadata(&Metadata { name: METADATA.into(), metadata: run.to_metadata() })?;
    out.attach(&mcap::Attachment {
        log_time: 0,
        create_time: 0,
        name: PLAN.into(),
        media_type: "application/toml".into(),
        data: run.plan.as_bytes().into(),
    })
}

/// Time in a file has no sign; times before the start of the clock become its start.
fn nanoseconds(time: Time) -> u64 {
    time.0.max(0) as u64
}
