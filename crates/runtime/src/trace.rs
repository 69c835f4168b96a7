//! The way from the threads that run agents to the log: a ring of words for each thread, drained by an ordinary one.
//!
//! The sender pays for a copy into its own ring and nothing else. When the ring is full the record is dropped and counted; in
//! simulated time the sender waits instead, and nothing is lost.

#![allow(unsafe_code)]

use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::cell::UnsafeCell;
use std::sync::Arc;

use types::{AgentId, Header, Time};

/// Words of the ring of a simulation, whose one thread writes everything: 4 MiB, some twenty pictures.
pub(crate) const LARGE: usize = 1 << 19;
/// Words of the ring of one thread of many: 1 MiB.
pub(crate) const SMALL: usize = 1 << 17;

const WORD: usize = size_of::<u64>();
/// The kind of a record stands in the upper half of its first word, its length in words in the lower.
const MESSAGE: u64 = 1 << 32;
const NOTE: u64 = 2 << 32;
const SKIP: u64 = 3 << 32;
const LINE: u64 = 4 << 32;

struct Shared {
    words: Box<[UnsafeCell<u64>]>,
    /// Words written since the start; the writer's.
    written: Line,
    /// Words read since the start; the reader's.
    read: Line,
    dropped: AtomicU64,
    closed: AtomicBool,
}

/// A counter with a line of memory of its own: the two ends stand on two processors, and would take it from one another.
#[derive(Default)]
#[repr(align(128))]
struct Line(AtomicU64);

// SAFETY: words between `read` and `written` are the reader's, the others the writer's; the two counters pass them on with
// release and acquire.
unsafe impl Sync for Shared {}
// SAFETY: plain words.
unsafe impl Send for Shared {}

/// The end of a thread that runs agents.
pub(crate) struct Writer {
    shared: Arc<Shared>,
    written: u64,
    /// How many words had been read when that was last looked at: only when there seems to be no room, since the look is dear.
    read: u64,
    /// One less than the number of words, which is a power of two.
    mask: usize,
    waits: bool,
}

/// The end of the thread that keeps the log.
pub(crate) struct Reader {
    shared: Arc<Shared>,
}

/// Makes a ring of so many words, or of the next power of two. A writer that `waits` never drops.
pub(crate) fn ring(words: usize, waits: bool) -> (Writer, Reader) {
    let words: Box<[_]> = (0..words.next_power_of_two()).map(|_| UnsafeCell::new(0)).collect();
    let mask = words.len() - 1;
    let shared = Arc::new(Shared {
        words,
        written: Line::default(),
        read: Line::default(),
        dropped: AtomicU64::new(0),
        closed: AtomicBool::new(false),
    });
    (Writer { shared: shared.clone(), written: 0, read: 0, mask, waits }, Reader { shared })
}

/// What stands in the log.
pub(crate) enum Record<'a> {
    /// A message that an output sent.
    Message {
        /// The number of the output.
        output: u32,
        /// Its header.
        header: Header,
        /// The bytes of its head, as they lie in memory.
        head: &'a [u64],
        /// Number of elements of the row behind it.
        len: usize,
        /// The bytes of the row.
        row: &'a [u64],
    },
    /// What an agent noted.
    Note {
        /// When.
        time: Time,
        /// Who.
        agent: AgentId,
        /// The text, with `{}` for each number.
        text: &'static str,
        /// The numbers.
        numbers: &'a [f64],
    },
    /// What the control side says, when it shares its thread with the agents.
    Line {
        /// When.
        time: Time,
        /// Who, a line break, and what.
        text: &'a str,
    },
}

fn words_for(bytes: usize) -> usize {
    bytes.div_ceil(WORD)
}

const HEADER_WORDS: usize = size_of::<Header>().div_ceil(WORD);

impl Writer {
    /// Finds room for a record of `len` words that lie together. Nothing when there is none and the writer does not wait.
    #[inline]
    fn room(&mut self, len: usize) -> Option<usize> {
        let words = self.mask + 1;
        let at = self.written as usize & self.mask;
        // Most of the time there is room behind the last record, and was when the reader was last looked at.
        if at + len <= words && self.written + len as u64 - self.read <= words as u64 {
            return Some(at);
        }
        self.find_room(len)
    }

    #[inline(never)]
    fn find_room(&mut self, len: usize) -> Option<usize> {
        let words = self.mask + 1;
        if len >= words / 2 {
            self.shared.dropped.fetch_add(1, Ordering::Relaxed);
            return None;
        }
        let at = self.written as usize & self.mask;
        let skipped = if at + len > words { words - at } else { 0 };
        loop {
            // Pairs with the release in `Reader::drain`.
            self.read = self.shared.read.0.load(Ordering::Acquire);
            if self.written + (skipped + len) as u64 - self.read <= words as u64 {
                break;
            }
            if !self.waits || self.shared.closed.load(Ordering::Relaxed) {
                self.shared.dropped.fetch_add(1, Ordering::Relaxed);
                return None;
            }
            std::thread::yield_now();
        }
        if skipped > 0 {
            self.put(at, SKIP | skipped as u64);
            self.written += skipped as u64;
        }
        Some(self.written as usize & self.mask)
    }

    #[inline]
    fn put(&self, at: usize, word: u64) {
        // SAFETY: `room` gave this word to the writer.
        unsafe { *self.shared.words[at].get() = word };
    }

    /// # Safety
    /// `bytes` bytes can be read at `from`, and `room` gave as many words at `at`.
    #[inline]
    unsafe fn copy(&self, at: usize, from: *const u8, bytes: usize) {
        debug_assert!(at + words_for(bytes) <= self.shared.words.len());
        // What is empty may stand behind the last word, where there is no place to name.
        if bytes == 0 {
            return;
        }
        // SAFETY: the caller's promise; the words lie together.
        unsafe { core::ptr::copy_nonoverlapping(from, self.shared.words[at].get().cast::<u8>(), bytes) };
    }

    #[inline]
    fn publish(&mut self, len: usize) {
        self.written += len as u64;
        // Pairs with the acquire in `Reader::drain`.
        self.shared.written.0.store(self.written, Ordering::Release);
    }

    /// Writes a message.
    #[inline]
    pub(crate) fn message<T: Copy, E: Copy>(&mut self, output: u32, header: &Header, head: &T, row: &[E]) {
        let (head_words, row_words) = (words_for(size_of::<T>()), words_for(size_of_val(row)));
        let len = 3 + HEADER_WORDS + head_words + row_words;
        let Some(at) = self.room(len) else { return };
        self.put(at, MESSAGE | len as u64);
        self.put(at + 1, u64::from(output) << 32 | head_words as u64);
        self.put(at + 2, row.len() as u64);
        // SAFETY: both are plain values that live through the call, and `len` counts their words.
        unsafe {
            self.copy(at + 3, core::ptr::from_ref(header).cast(), size_of::<Header>());
            self.copy(at + 3 + HEADER_WORDS, core::ptr::from_ref(head).cast(), size_of::<T>());
            self.copy(at + 3 + HEADER_WORDS + head_words, row.as_ptr().cast(), size_of_val(row));
        }
        self.publish(len);
    }

    /// Writes a line of text, from a thread that may use memory.
    pub(crate) fn line(&mut self, time: Time, who: &str, what: &str) {
        let text = format!("{who}\n{what}");
        let len = 3 + words_for(text.len());
        let Some(at) = self.room(len) else { return };
        self.put(at, LINE | len as u64);
        self.put(at + 1, time.0 as u64);
        self.put(at + 2, text.len() as u64);
        // SAFETY: the text lives through the call, and `len` counts its words.
        unsafe { self.copy(at + 3, text.as_ptr(), text.len()) };
        self.publish(len);
    }

    /// Writes a note.
    pub(crate) fn note(&mut self, time: Time, agent: AgentId, text: &'static str, numbers: &[f64]) {
        let len = 5 + numbers.len();
        let Some(at) = self.room(len) else { return };
        self.put(at, NOTE | len as u64);
        self.put(at + 1, time.0 as u64);
        self.put(at + 2, u64::from(agent.0));
        self.put(at + 3, text.as_ptr() as u64);
        self.put(at + 4, text.len() as u64);
        for (i, number) in numbers.iter().enumerate() {
            self.put(at + 5 + i, number.to_bits());
        }
        self.publish(len);
    }
}

impl Reader {
    /// Hands every record that waits to `each`. Says how many there were.
    pub(crate) fn drain(&mut self, mut each: impl FnMut(Record<'_>)) -> usize {
        let mut read = self.shared.read.0.load(Ordering::Relaxed);
        // Pairs with the release in `Writer::publish`.
        let written = self.shared.written.0.load(Ordering::Acquire);
        let mut records = 0;
        while read < written {
            let at = read as usize % self.shared.words.len();
            let first = self.word(at);
            let len = (first & 0xffff_ffff) as usize;
            if first >> 32 != SKIP >> 32 {
                each(self.record(at, first, len));
                records += 1;
            }
            read += len as u64;
            // Pairs with the acquire in `Writer::room`.
            self.shared.read.0.store(read, Ordering::Release);
        }
        records
    }

    /// How many records found no room.
    pub(crate) fn dropped(&self) -> u64 {
        self.shared.dropped.load(Ordering::Relaxed)
    }

    fn word(&self, at: usize) -> u64 {
        // SAFETY: words before `written` are the reader's until it gives them back.
        unsafe { *self.shared.words[at].get() }
    }

    fn words(&self, at: usize, len: usize) -> &[u64] {
        if len == 0 {
            return &[];
        }
        // SAFETY: as in `word`; they lie together because the writer skips to the start instead of wrapping.
        unsafe { core::slice::from_raw_parts(self.shared.words[at].get(), len) }
    }

    fn record(&self, at: usize, first: u64, len: usize) -> Record<'_> {
        if first >> 32 == NOTE >> 32 {
            let (start, text_len) = (self.word(at + 3) as *const u8, self.word(at + 4) as usize);
            // SAFETY: the writer took both from a `&'static str`.
            let text =
                unsafe { core::str::from_utf8_unchecked(core::slice::from_raw_parts(start, text_len)) };
            let numbers = self.words(at + 5, len - 5);
            // SAFETY: the writer wrote doubles bit by bit; size and alignment are the same.
            let numbers =
                unsafe { core::slice::from_raw_parts(numbers.as_ptr().cast::<f64>(), numbers.len()) };
            let (time, agent) = (Time(self.word(at + 1) as i64), AgentId(self.word(at + 2) as u32));
            return Record::Note { time, agent, text, numbers };
        }
        if first >> 32 == LINE >> 32 {
            let (time, bytes) = (Time(self.word(at + 1) as i64), self.word(at + 2) as usize);
            let words = self.words(at + 3, len - 3);
            // SAFETY: the writer copied this many bytes of a `str` to these words.
            let text = unsafe {
                core::str::from_utf8_unchecked(core::slice::from_raw_parts(words.as_ptr().cast(), bytes))
            };
            return Record::Line { time, text };
        }
        let second = self.word(at + 1);
        let head_words = (second & 0xffff_ffff) as usize;
        // SAFETY: the writer copied a whole header to this place; words are at least as aligned as it is.
        let header = unsafe { *self.words(at + 3, HEADER_WORDS).as_ptr().cast::<Header>() };
        Record::Message {
            output: (second >> 32) as u32,
            header,
            len: self.word(at + 2) as usize,
            head: self.words(at + 3 + HEADER_WORDS, head_words),
            row: self.words(at + 3 + HEADER_WORDS + head_words, len - 3 - HEADER_WORDS - head_words),
        }
    }
}

impl Drop for Reader {
    fn drop(&mut self) {
        // A writer that waits must not wait for a reader that is gone.
        self.shared.closed.store(true, Ordering::Relaxed);
    }
}

const _: () = assert!(align_of::<Header>() <= WORD);

#[cfg(test)]
mod tests {
    use super::*;
    use types::messages::Twist;

    #[test]
    fn what_is_written_is_read_in_order_past_the_wrap() {
        let (mut writer, mut reader) = ring(LARGE, false);
        let row = [7u8; 100_001];
        let mut seen = 0u64;
        for i in 0..200u64 {
            let header = Header { sequence: i, ..Header::default() };
            writer.message(3, &header, &Twist::new(i as f64, 0.0), &row);
            writer.note(Time(i as i64), AgentId(1), "at {}", &[i as f64]);
            reader.drain(|record| match record {
                Record::Message { output, header, head, len, row } => {
                    assert_eq!((output, header.sequence, len), (3, seen, 100_001));
                    assert_eq!(f64::from_bits(head[0]), seen as f64);
                    assert_eq!(row[12_499].to_le_bytes(), [7; 8]);
                }
                Record::Note { time, numbers, text, .. } => {
                    assert_eq!((time, numbers, text), (Time(seen as i64), &[seen as f64][..], "at {}"));
                    seen += 1;
                }
                Record::Line { .. } => panic!("nobody wrote a line"),
            });
        }
        assert_eq!((seen, reader.dropped()), (200, 0));
    }

    #[test]
    fn an_empty_row_may_stand_behind_the_last_word() {
        let record = 3 + HEADER_WORDS + 2;
        // A ring in which the records end exactly at its end.
        let (mut writer, mut reader) = ring(record * 4, false);
        for _ in 0..50 {
            writer.message(0, &Header::default(), &Twist::ZERO, &[0u8; 0]);
            assert_eq!(reader.drain(|_| {}), 1);
        }
        assert_eq!(reader.dropped(), 0);
    }

    #[test]
    fn a_full_ring_drops_and_counts() {
        let (mut writer, mut reader) = ring(LARGE, false);
        for _ in 0..100 {
            writer.message(0, &Header::default(), &Twist::ZERO, &[0u8; 100_000]);
        }
        let kept = reader.drain(|_| {});
        assert!(kept > 0 && kept < 100);
        assert_eq!(reader.dropped(), 100 - kept as u64);
    }
}
