//! Makes a whole log of one that was cut.

use std::fs::File;
use std::io::{self, BufReader, Write};
use std::path::Path;

use mcap::McapError;
use mcap::records::Record;
use types::Time;

use super::disk::Disk;
use super::pieces::{Damage, Piece, Pieces};
use super::records::HEADERS;
use super::writer::options;

/// What was saved and what was lost.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Repaired {
    /// Messages in the new file, the headers' own not counted.
    pub messages: u64,
    /// The times of the first and the last of them.
    pub span: Option<(Time, Time)>,
    /// Whether the old file was whole and only copied.
    pub was_whole: bool,
    /// What could not be read, with its place, its size and where possible its times.
    pub lost: Vec<Damage>,
    /// Messages that could be read, but whose topic stood in a lost part.
    pub nameless: u64,
}

impl Repaired {
    /// How many messages were lost; nothing when it cannot be known, as for the end of a file that was cut.
    pub fn lost_messages(&self) -> Option<u64> {
        self.lost.iter().try_fold(self.nameless, |sum, damage| Some(sum + damage.messages?))
    }

    /// The times of the first and the last message that are known to be lost; nothing when no times are known.
    pub fn lost_span(&self) -> Option<(Time, Time)> {
        let first = self.lost.iter().filter_map(|damage| damage.span).map(|span| span.0).min()?;
        let last = self.lost.iter().filter_map(|damage| damage.span).map(|span| span.1).max()?;
        Some((first, last))
    }
}

/// Why a log cannot be mended.
#[derive(Debug, thiserror::Error)]
pub enum RepairError {
    /// The old file cannot be read.
    #[error("the log {path} cannot be read: {cause}")]
    Read {
        /// The file.
        path: String,
        /// What the system says.
        cause: io::Error,
    },
    /// The old file does not begin as an MCAP file does.
    #[error("{0} is no log: it does not begin as an MCAP file does, so nothing of it can be saved")]
    NoLog(String),
    /// The new file is the old one.
    #[error("{0} cannot be mended in place: name another file for the whole log")]
    InPlace(String),
    /// The new file cannot be written.
    #[error("the new log {path} cannot be written: {cause}")]
    Write {
        /// The file.
        path: String,
        /// What is wrong.
        cause: McapError,
    },
}

/// Writes what can be read of the log `path` into the new log `out`, with an index, and tells what was saved and lost.
///
/// Works on files of other programs too, where they are not compressed or compressed by lz4. The old file stays as it is.
pub fn repair(path: impl AsRef<Path>, out: impl AsRef<Path>) -> Result<Repaired, RepairError> {
    let (path, out) = (path.as_ref(), out.as_ref());
    let name = path.display().to_string();
    if same_file(path, out) {
        return Err(RepairError::InPlace(name));
    }
    let read = |cause| RepairError::Read { path: name.clone(), cause };
    let write = |cause| RepairError::Write { path: out.display().to_string(), cause };
    let file = File::open(path).map_err(read)?;
    let len = file.metadata().map_err(read)?.len();
    let pieces = Pieces::new(BufReader::with_capacity(1 << 16, file), len).map_err(read)?;
    let mut pieces = pieces.ok_or_else(|| RepairError::NoLog(name.clone()))?;

    let disk = Disk::new(Box::new(File::create(out).map_err(|cause| write(cause.into()))?), false);
    let mut copy = Copy {
        out: None,
        disk: Some(disk),
        headers: None,
        behind_damage: false,
        report: Repaired::default(),
    };
    while let Some(piece) = pieces.next().map_err(read)? {
        copy.piece(piece).map_err(write)?;
    }
    copy.report.was_whole = pieces.whole && copy.report.lost.is_empty();
    copy.finish().map_err(write)
}

fn same_file(a: &Path, b: &Path) -> bool {
    matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

struct Copy {
    /// Made when the old file's header is known.
    out: Option<mcap::Writer<Disk>>,
    disk: Option<Disk>,
    headers: Option<u16>,
    /// The last chunk could not be read, and the index of what was in it may follow.
    behind_damage: bool,
    report: Repaired,
}

impl Copy {
    fn piece(&mut self, piece: Piece) -> Result<(), McapError> {
        match piece {
            Piece::Single(Record::Header(header)) if self.out.is_none() => {
                let options = options().profile(header.profile).library(header.library);
                self.out = self.disk.take().map(|disk| options.create(disk)).transpose()?;
                Ok(())
            }
            Piece::Single(record) => self.record(record),
            Piece::Index(channel, messages) => {
                let counts = self.behind_damage && self.headers != Some(channel);
                if let Some(damage) = self.report.lost.last_mut().filter(|_| counts) {
                    damage.count(messages);
                }
                Ok(())
            }
            Piece::Chunk(records) => {
                self.behind_damage = false;
                for record in records {
                    self.record(record)?;
                }
                self.out.as_mut().map_or(Ok(()), mcap::Writer::flush)
            }
            Piece::Damaged(damage) => {
                self.behind_damage = true;
                self.report.lost.push(damage);
                Ok(())
            }
        }
    }

    fn record(&mut self, record: Record<'_>) -> Result<(), McapError> {
        // Where the old file's header is lost, ours stands in its place: it names no more than profile and program.
        if self.out.is_none() {
            self.out = self.disk.take().map(|disk| options().create(disk)).transpose()?;
        }
        let Some(out) = self.out.as_mut() else { return Ok(()) };
        match record {
            Record::Schema { header, data } => {
                // The summary repeats it; a second one is the same one.
                out.add_schema_with_id(header.id, &header.name, &header.encoding, &data).map(drop)
            }
            Record::Channel(channel) => {
                if channel.topic == HEADERS {
                    self.headers = Some(channel.id);
                }
                let (id, schema) = (channel.id, channel.schema_id);
                out.add_channel_with_id(
                    id,
                    schema,
                    &channel.topic,
                    &channel.message_encoding,
                    &channel.metadata,
                )
                .map(drop)
            }
            Record::Message { header, data } => match out.write_to_known_channel(&header, &data) {
                Err(McapError::UnknownChannel(..)) => {
                    self.report.nameless += 1;
                    Ok(())
                }
                done => {
                    if self.headers != Some(header.channel_id) {
                        self.report.messages += 1;
                        let time = Time(i64::try_from(header.log_time).unwrap_or(i64::MAX));
                        let (first, last) = self.report.span.unwrap_or((time, time));
                        self.report.span = Some((first.min(time), last.max(time)));
                    }
                    done
                }
            },
            Record::Metadata(metadata) => out.write_metadata(&metadata),
            Record::Attachment { header, data, .. } => out.attach(&mcap::Attachment {
                log_time: header.log_time,
                create_time: header.create_time,
                name: header.name,
                media_type: header.media_type,
                data,
            }),
            // Index and counts are made anew.
            _ => Ok(()),
        }
    }

    fn finish(mut self) -> Result<Repaired, McapError> {
        let out = match (self.out.take(), self.disk.take()) {
            (Some(out), _) => Some(out),
            // Not even the header was there: a log without messages.
            (None, Some(disk)) => Some(options().create(disk)?),
            (None, None) => None,
        };
        if let Some(mut out) = out {
            out.finish()?;
            out.into_inner().flush()?;
        }
        Ok(self.report)
    }
}
