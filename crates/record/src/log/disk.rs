//! Where the bytes of a log go: collected until a chunk is closed, then written in one piece.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};

/// What a log can be written to.
pub trait Sink: Write + Send {
    /// Sees to it that what was written outlives a loss of power.
    fn secure(&mut self) -> io::Result<()>;
    /// Takes back everything behind the first `len` bytes.
    fn cut(&mut self, len: u64) -> io::Result<()>;
}

impl Sink for File {
    fn secure(&mut self) -> io::Result<()> {
        self.sync_data()
    }

    fn cut(&mut self, len: u64) -> io::Result<()> {
        self.set_len(len)
    }
}

/// Collects bytes; a flush brings them to the sink, all or none.
pub(super) struct Disk {
    sink: Box<dyn Sink>,
    pending: Vec<u8>,
    /// Bytes that the sink has.
    written: u64,
    /// Whether each flush waits for the disk itself.
    secure: bool,
}

impl Disk {
    pub(super) fn new(sink: Box<dyn Sink>, secure: bool) -> Disk {
        Disk { sink, pending: Vec::new(), written: 0, secure }
    }

    /// Bytes of the log so far.
    pub(super) fn len(&self) -> u64 {
        self.written + self.pending.len() as u64
    }
}

impl Write for Disk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.pending.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    /// On an error, the part of a piece that got through is taken back, so that the file ends behind a whole chunk.
    fn flush(&mut self) -> io::Result<()> {
        let done = self.sink.write_all(&self.pending).and_then(|()| self.sink.flush());
        let done = if self.secure { done.and_then(|()| self.sink.secure()) } else { done };
        match &done {
            Ok(()) => {
                self.written += self.pending.len() as u64;
                self.pending.clear();
            }
            // A torn end does no harm to a reader, so it does not matter if this fails too.
            Err(_) => drop(self.sink.cut(self.written)),
        }
        done
    }
}

/// Only to ask where it is: a log is written from front to back.
impl Seek for Disk {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match to {
            SeekFrom::Current(0) => Ok(self.len()),
            _ => Err(io::Error::new(io::ErrorKind::Unsupported, "a log is written from front to back")),
        }
    }
}
