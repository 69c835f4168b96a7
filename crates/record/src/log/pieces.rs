//! A log as its pieces: single records and chunks of them, each taken whole or not at all.

use std::io::{self, Read};

use mcap::records::{AttachmentHeader, ChunkHeader, Record};
use mcap::{McapError, parse_record};
use types::Time;

/// Operation code and length in front of a record.
const PREFIX: usize = 9;
/// Operation codes of MCAP.
const HEADER: u8 = 0x01;
const FOOTER: u8 = 0x02;
const SCHEMA: u8 = 0x03;
const CHANNEL: u8 = 0x04;
const MESSAGE: u8 = 0x05;
const CHUNK: u8 = 0x06;
const MESSAGE_INDEX: u8 = 0x07;
const ATTACHMENT: u8 = 0x09;
const METADATA: u8 = 0x0c;

/// More than a chunk has (bytes): ours close at 8 MiB, those of others at one or a few. It is in memory as a whole, and a few
/// packed bytes may claim any size.
const MOST_IN_CHUNK: u64 = 256 << 20;

/// A part of a log that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Damage {
    /// Its first byte in the file.
    pub at: u64,
    /// How many bytes it has.
    pub bytes: u64,
    /// The times of the first and last message in it, where that can still be told.
    pub span: Option<(Time, Time)>,
    /// How many messages are in it, where the index behind it tells: not where the file was cut.
    pub messages: Option<u64>,
    /// What is wrong.
    pub cause: Cause,
}

/// What is wrong with a part of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// The file ends in the middle of it.
    Cut,
    /// The bytes are not those that were written.
    Changed,
    /// It is packed in a way that is not supported: only lz4 is.
    Packing,
    /// It would need more memory than a chunk may: 256 MiB.
    TooLarge,
}

impl Damage {
    /// Takes in what an index behind it says of one channel.
    pub(super) fn count(&mut self, messages: u64) {
        *self.messages.get_or_insert(0) += messages;
    }
}

impl std::fmt::Display for Damage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let what = match self.cause {
            Cause::Cut => "the file ends in the middle of a record",
            Cause::Changed => "the bytes are not those that were written",
            Cause::Packing => "it is packed in a way that is not supported (only lz4 is)",
            Cause::TooLarge => "it is larger than a chunk may be (256 MiB)",
        };
        write!(f, "byte {}: {what}, {} bytes cannot be read", self.at, self.bytes)?;
        match (self.messages, self.span) {
            (Some(n), Some((first, last))) => write!(f, " ({n} messages from {first} to {last})"),
            (None, Some((first, last))) => write!(f, " (messages from {first} to {last})"),
            (_, None) => Ok(()),
        }
    }
}

/// A piece of a log.
pub(super) enum Piece {
    /// A record outside of chunks.
    Single(Record<'static>),
    /// The records of a chunk.
    Chunk(Vec<Record<'static>>),
    /// How many messages of a channel are in the chunk before it.
    Index(u16, u64),
    /// A part that cannot be read.
    Damaged(Damage),
}

/// Reads a log piece by piece.
pub(super) struct Pieces<R> {
    input: R,
    len: u64,
    at: u64,
    ended: bool,
    /// The file has its end: nothing is missing behind.
    pub(super) whole: bool,
}

impl<R: Read> Pieces<R> {
    /// Begins to read `len` bytes; answers nothing when they are no MCAP file.
    pub(super) fn new(mut input: R, len: u64) -> io::Result<Option<Pieces<R>>> {
        let mut magic = [0; mcap::MAGIC.len()];
        if len < magic.len() as u64 {
            return Ok(None);
        }
        input.read_exact(&mut magic)?;
        let pieces = Pieces { input, len, at: magic.len() as u64, ended: false, whole: false };
        Ok((magic == mcap::MAGIC).then_some(pieces))
    }

    /// The next piece, nothing at the end and behind an error.
    pub(super) fn next(&mut self) -> io::Result<Option<Piece>> {
        let next = self.piece();
        self.ended |= next.is_err();
        next
    }

    fn piece(&mut self) -> io::Result<Option<Piece>> {
        let start = self.at;
        let left = self.len.saturating_sub(start);
        if self.ended || left == 0 {
            return Ok(None);
        }
        let mut prefix = [0; PREFIX];
        if left < PREFIX as u64 {
            return Ok(Some(self.cut(start, None)));
        }
        self.input.read_exact(&mut prefix)?;
        let [op, length @ ..] = prefix;
        let length = u64::from_le_bytes(length);
        let room = left - PREFIX as u64;
        let mut body = vec![0; length.min(room) as usize];
        self.input.read_exact(&mut body)?;
        self.at = start + PREFIX as u64 + body.len() as u64;
        if length > room {
            return Ok(Some(self.cut(start, if op == CHUNK { span(&body) } else { None })));
        }
        if op == FOOTER {
            self.ended = true;
            let mut magic = Vec::new();
            self.input.by_ref().take(mcap::MAGIC.len() as u64).read_to_end(&mut magic)?;
            self.whole = magic == mcap::MAGIC;
        }
        let piece = match op {
            CHUNK => chunk_records(&body).map(Piece::Chunk),
            MESSAGE_INDEX => index(&body).ok_or(Bad(Cause::Changed)),
            _ => single(op, &body).map(Piece::Single),
        };
        Ok(Some(piece.unwrap_or_else(|Bad(cause)| {
            let span = if op == CHUNK { span(&body) } else { None };
            Piece::Damaged(Damage { at: start, bytes: self.at - start, span, messages: None, cause })
        })))
    }

    fn cut(&mut self, start: u64, span: Option<(Time, Time)>) -> Piece {
        self.ended = true;
        Piece::Damaged(Damage { at: start, bytes: self.len - start, span, messages: None, cause: Cause::Cut })
    }
}

/// Why a piece cannot be taken.
struct Bad(Cause);

impl From<McapError> for Bad {
    fn from(_: McapError) -> Bad {
        Bad(Cause::Changed)
    }
}

/// All records of a chunk, or none when its checksum is wrong.
///
/// Done here and not by [`mcap::read::ChunkReader`], which takes the memory that the chunk claims to need on trust.
fn chunk_records(body: &[u8]) -> Result<Vec<Record<'static>>, Bad> {
    let bytes = match parse_record(CHUNK, body)? {
        Record::Chunk { header, data } => unpacked(&header, data.into_owned())?,
        _ => return Err(Bad(Cause::Changed)),
    };
    let mut records = Vec::new();
    let mut rest = Bytes(&bytes);
    while !rest.0.is_empty() {
        let mut next = || {
            let (op, length) = (rest.number(1)?, rest.number(8)?);
            Some((op as u8, rest.take(length)?))
        };
        let (op, record) = next().ok_or(Bad(Cause::Changed))?;
        match single(op, record)? {
            // Only a place of its number would be left of it, which is larger than itself.
            Record::Unknown { .. } => {}
            known => records.push(known),
        }
    }
    Ok(records)
}

/// The bytes of a chunk, checked.
fn unpacked(header: &ChunkHeader, data: Vec<u8>) -> Result<Vec<u8>, Bad> {
    let changed = |_| Bad(Cause::Changed);
    if header.uncompressed_size > MOST_IN_CHUNK {
        return Err(Bad(Cause::TooLarge));
    }
    let bytes = match header.compression.as_str() {
        "" => data,
        "lz4" => {
            let mut bytes = Vec::new();
            let packed = lz4::Decoder::new(data.as_slice()).map_err(changed)?;
            packed
                .take(header.uncompressed_size.saturating_add(1))
                .read_to_end(&mut bytes)
                .map_err(changed)?;
            bytes
        }
        _ => return Err(Bad(Cause::Packing)),
    };
    // A writer may leave the checksum out.
    let known = header.uncompressed_crc == 0 || header.uncompressed_crc == crc32fast::hash(&bytes);
    if known && bytes.len() as u64 == header.uncompressed_size { Ok(bytes) } else { Err(Bad(Cause::Changed)) }
}

/// Takes values off the front of bytes.
struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn take(&mut self, n: u64) -> Option<&'a [u8]> {
        let (taken, behind) = self.0.split_at_checked(usize::try_from(n).ok()?)?;
        self.0 = behind;
        Some(taken)
    }

    /// A number of `n` bytes, the lowest first.
    fn number(&mut self, n: u64) -> Option<u64> {
        Some(self.take(n)?.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte)))
    }

    fn text(&mut self) -> Option<String> {
        let len = self.number(4)?;
        String::from_utf8(self.take(len)?.to_vec()).ok()
    }
}

/// The number of messages of a channel: as many as there are pairs of time and offset.
fn index(body: &[u8]) -> Option<Piece> {
    let mut input = Bytes(body);
    let channel = u16::try_from(input.number(2)?).ok()?;
    Some(Piece::Index(channel, input.number(4)? / 16))
}

/// A record that stands by itself. What only the index needs stays unread.
fn single(op: u8, body: &[u8]) -> Result<Record<'static>, Bad> {
    match op {
        HEADER | SCHEMA | CHANNEL | MESSAGE | METADATA => Ok(parse_record(op, body)?.into_owned()),
        ATTACHMENT => attachment(body).ok_or(Bad(Cause::Changed)),
        opcode => Ok(Record::Unknown { opcode, data: Vec::new().into() }),
    }
}

/// An attachment, its checksum tested.
///
/// Done here and not by [`parse_record`], which trusts the lengths of the names.
fn attachment(body: &[u8]) -> Option<Record<'static>> {
    let mut input = Bytes(body);
    let (log_time, create_time) = (input.number(8)?, input.number(8)?);
    let name = input.text()?;
    let media_type = input.text()?;
    let len = input.number(8)?;
    let data = input.take(len)?.to_vec();
    let crc = u32::try_from(input.number(4)?).ok()?;
    let header = AttachmentHeader { log_time, create_time, name, media_type };
    let known = crc == 0 || body.len().checked_sub(4).is_some_and(|end| crc32fast::hash(&body[..end]) == crc);
    known.then(|| Record::Attachment { header, data: data.into(), crc })
}

/// The first and last time of a chunk, which stand in front of everything else.
fn span(body: &[u8]) -> Option<(Time, Time)> {
    let mut input = Bytes(body);
    let mut time = || Some(Time(i64::try_from(input.number(8)?).ok()?));
    Some((time()?, time()?))
}
