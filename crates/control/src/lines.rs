//! Lines of a bounded length from a stream that may have nothing to say for a while.

use std::io::{self, Read};

/// What is read at once.
const CHUNK: usize = 16 * 1024;

/// Why there is no line.
#[derive(Debug, thiserror::Error)]
pub(crate) enum NoLine {
    /// It is longer than it may be; what follows it cannot be told apart any more.
    #[error("the line is longer than {0} bytes")]
    TooLong(usize),
    /// The stream failed, or had nothing for as long as it was given.
    #[error(transparent)]
    Io(#[from] io::Error),
}

/// Reads lines. After a time-out it goes on where it was.
pub(crate) struct Lines<R> {
    stream: R,
    longest: usize,
    waiting: Vec<u8>,
    /// Bytes of `waiting` that are known to hold no end of a line.
    searched: usize,
}

impl<R: Read> Lines<R> {
    pub(crate) fn new(stream: R, longest: usize) -> Lines<R> {
        Lines { stream, longest, waiting: Vec::new(), searched: 0 }
    }

    /// The next line without its end; nothing when the stream is at its end.
    pub(crate) fn next(&mut self) -> Result<Option<Vec<u8>>, NoLine> {
        loop {
            if let Some(found) = self.waiting[self.searched..].iter().position(|byte| *byte == b'\n') {
                let end = self.searched + found;
                let rest = self.waiting.split_off(end + 1);
                let mut line = core::mem::replace(&mut self.waiting, rest);
                line.pop();
                self.searched = 0;
                return if line.len() > self.longest {
                    Err(NoLine::TooLong(self.longest))
                } else {
                    Ok(Some(line))
                };
            }
            self.searched = self.waiting.len();
            if self.searched > self.longest {
                return Err(NoLine::TooLong(self.longest));
            }
            self.waiting.resize(self.searched + CHUNK, 0);
            let read = self.stream.read(&mut self.waiting[self.searched..]);
            self.waiting.truncate(self.searched + *read.as_ref().unwrap_or(&0));
            match read {
                Ok(0) => return Ok(None),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error.into()),
                Ok(_) => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gives its pieces one after another, and fails where there is none.
    struct Pieces(Vec<Option<&'static str>>);

    impl Read for Pieces {
        fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
            if self.0.is_empty() {
                return Ok(0);
            }
            let piece = self.0.remove(0).ok_or_else(|| io::Error::from(io::ErrorKind::WouldBlock))?;
            out[..piece.len()].copy_from_slice(piece.as_bytes());
            Ok(piece.len())
        }
    }

    #[test]
    fn lines_come_whole_however_they_arrive() {
        let mut lines = Lines::new(Pieces(vec![Some("a"), None, Some("b\n\nc"), Some("\nlost")]), 10);
        assert!(matches!(lines.next(), Err(NoLine::Io(_))));
        for expected in ["ab", "", "c"] {
            assert_eq!(lines.next().unwrap().unwrap(), expected.as_bytes());
        }
        assert!(lines.next().unwrap().is_none());
    }

    #[test]
    fn a_line_without_end_is_refused() {
        assert!(matches!(Lines::new(Pieces(vec![Some("12345678")]), 7).next(), Err(NoLine::TooLong(7))));
        assert!(matches!(Lines::new(Pieces(vec![Some("12345678\n")]), 7).next(), Err(NoLine::TooLong(7))));
        assert!(Lines::new(Pieces(vec![Some("1234567\n")]), 7).next().is_ok());
    }
}
