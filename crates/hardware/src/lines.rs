//! Lines of a text file, plain or compressed, with an account of what was in them.

use std::fmt;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use flate2::bufread::MultiGzDecoder;

/// Lines beyond this are no data (bytes): a scan of 20 000 beams has less.
const LINE_MAX: u64 = 1 << 20;
/// How many bad lines are told in full.
const TOLD: usize = 10;

/// A line that could not be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Told {
    /// Its number, from 1.
    pub line: u64,
    /// What is wrong with it.
    pub why: String,
}

/// What was in a recording.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Lines in all.
    pub lines: u64,
    /// Scans of the laser that is played.
    pub scans: u64,
    /// Scans of another laser, which are not played.
    pub other_scans: u64,
    /// Lines of odometry or of wheel counts.
    pub odometry: u64,
    /// Lines of kinds that are not read.
    pub other: u64,
    /// Comments and empty lines.
    pub comments: u64,
    /// Lines that were left out because they could not be read.
    pub bad: u64,
    /// The first of those.
    pub told: Vec<Told>,
    /// Records whose stamp lies before that of their predecessor. They are played at its time.
    pub backwards: u64,
    /// Records that have the stamp of their predecessor.
    pub repeated: u64,
    /// Why the file could not be read to its end.
    pub cut: Option<String>,
}

impl Report {
    pub(crate) fn tell(&mut self, why: impl fmt::Display) {
        self.bad += 1;
        if self.told.len() < TOLD {
            self.told.push(Told { line: self.lines, why: why.to_string() });
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} scans, {} poses or counts, {} other lines, {} bad",
            self.scans, self.odometry, self.other, self.bad
        )?;
        if self.backwards > 0 {
            write!(f, ", {} stamps run backwards", self.backwards)?;
        }
        if let Some(cut) = &self.cut {
            write!(f, ", cut off: {cut}")?;
        }
        self.told.iter().try_for_each(|told| write!(f, "\n  line {}: {}", told.line, told.why))
    }
}

/// One line, or why it is none.
pub(crate) enum Read1<'a> {
    Line(&'a str),
    NotText,
    Long,
}

/// The lines of a stream, one after another, in one buffer.
pub(crate) struct Lines<R> {
    input: R,
    buffer: Vec<u8>,
}

/// A file, through gzip where it begins as such a file does.
pub(crate) fn open(path: &Path) -> io::Result<Lines<Box<dyn BufRead>>> {
    let mut file = BufReader::new(File::open(path)?);
    let packed = file.fill_buf()?.starts_with(&[0x1f, 0x8b]);
    let input: Box<dyn BufRead> =
        if packed { Box::new(BufReader::new(MultiGzDecoder::new(file))) } else { Box::new(file) };
    Ok(Lines::new(input))
}

impl<R: BufRead> Lines<R> {
    pub(crate) fn new(input: R) -> Lines<R> {
        Lines { input, buffer: Vec::new() }
    }

    /// The next line without its end; nothing at the end.
    pub(crate) fn next(&mut self) -> io::Result<Option<Read1<'_>>> {
        self.buffer.clear();
        let len = (&mut self.input).take(LINE_MAX).read_until(b'\n', &mut self.buffer)?;
        if len == 0 {
            return Ok(None);
        }
        if len as u64 == LINE_MAX && self.buffer.last() != Some(&b'\n') {
            while self.skip_part()? {}
            return Ok(Some(Read1::Long));
        }
        Ok(Some(core::str::from_utf8(&self.buffer).map_or(Read1::NotText, Read1::Line)))
    }

    /// Passes over a part of the line; false when its end was in it.
    fn skip_part(&mut self) -> io::Result<bool> {
        self.buffer.clear();
        let len = (&mut self.input).take(LINE_MAX).read_until(b'\n', &mut self.buffer)?;
        Ok(len > 0 && self.buffer.last() != Some(&b'\n'))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_without_an_end_in_sight_is_passed_over() {
        let mut text = vec![b'x'; 3 << 20];
        text.extend(b"\nODOM\n\xff\xfe\nlast");
        let mut lines = Lines::new(&text[..]);
        assert!(matches!(lines.next().unwrap(), Some(Read1::Long)));
        assert!(matches!(lines.next().unwrap(), Some(Read1::Line("ODOM\n"))));
        assert!(matches!(lines.next().unwrap(), Some(Read1::NotText)));
        assert!(matches!(lines.next().unwrap(), Some(Read1::Line("last"))));
        assert!(lines.next().unwrap().is_none());
    }
}
