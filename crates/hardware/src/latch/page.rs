//! The page of memory in which a latch lives: shared between processes, or private to one.

#![allow(unsafe_code)]

use std::fs::File;
use std::io;

#[cfg(not(loom))]
use memmap2::{MmapMut, MmapOptions};

#[cfg(loom)]
pub(super) use explored::{AtomicU64, Ordering};
#[cfg(not(loom))]
pub(super) use std::sync::atomic::{AtomicU64, Ordering};

/// A word of a model, where every access is a place at which another thread may go on. For `loom` the last access of a thread to a word
/// hides the ones before, and orders are left out; an access to one word that all share makes it try them all. (The runtime's own shim
/// does the same, for its own types of words.)
#[cfg(loom)]
mod explored {
    use loom::sync::atomic as plain;
    pub(crate) use plain::Ordering;

    loom::lazy_static! {
        static ref TURN: plain::AtomicU32 = plain::AtomicU32::new(0);
    }

    fn turn() {
        TURN.fetch_add(1, Ordering::Relaxed);
    }

    #[derive(Debug)]
    pub(crate) struct AtomicU64(plain::AtomicU64);

    impl AtomicU64 {
        pub(crate) fn new(value: u64) -> AtomicU64 {
            AtomicU64(plain::AtomicU64::new(value))
        }

        pub(crate) fn load(&self, ordering: Ordering) -> u64 {
            turn();
            self.0.load(ordering)
        }

        pub(crate) fn store(&self, value: u64, ordering: Ordering) {
            turn();
            self.0.store(value, ordering);
        }

        pub(crate) fn fetch_or(&self, value: u64, ordering: Ordering) -> u64 {
            turn();
            self.0.fetch_or(value, ordering)
        }

        pub(crate) fn compare_exchange(
            &self,
            from: u64,
            to: u64,
            ordering: Ordering,
            otherwise: Ordering,
        ) -> Result<u64, u64> {
            turn();
            self.0.compare_exchange(from, to, ordering, otherwise)
        }

        /// As the standard library does it: a load, and an exchange that is tried until nobody came between.
        pub(crate) fn fetch_update(
            &self,
            set: Ordering,
            fetch: Ordering,
            mut change: impl FnMut(u64) -> Option<u64>,
        ) -> Result<u64, u64> {
            let mut before = self.load(fetch);
            while let Some(after) = change(before) {
                match self.compare_exchange(before, after, set, fetch) {
                    Ok(before) => return Ok(before),
                    Err(found) => before = found,
                }
            }
            Err(before)
        }
    }
}

/// Bytes of a page. A file of a latch has this length.
pub(super) const PAGE: usize = 4096;
/// Words of it that are used.
const WORDS: usize = 4;

/// A few words that several threads, and for a mapped page several processes, see alike.
#[derive(Debug)]
pub(super) enum Page {
    /// Of a file that is mapped by everybody concerned. Models know nothing of files.
    #[cfg(not(loom))]
    Mapped(MmapMut),
    /// Of this process alone.
    Private([AtomicU64; WORDS]),
}

impl Page {
    /// A page that nobody else sees.
    pub(super) fn private() -> Page {
        Page::Private(std::array::from_fn(|_| AtomicU64::new(0)))
    }

    /// The page of a file that is at least [`PAGE`] bytes long.
    #[cfg(not(loom))]
    pub(super) fn map(file: &File) -> io::Result<Page> {
        // SAFETY: the map is only ever looked at through atomics (see `words`), so that others write to it is no race. Its
        // folder belongs to this user alone and the file is never made shorter by this program, so the page stays there.
        let map = unsafe { MmapOptions::new().len(PAGE).map_mut(file)? };
        Ok(Page::Mapped(map))
    }

    /// There is none in a model.
    #[cfg(loom)]
    pub(super) fn map(_: &File) -> io::Result<Page> {
        Err(io::ErrorKind::Unsupported.into())
    }

    /// Its words.
    #[inline]
    pub(super) fn words(&self) -> &[AtomicU64; WORDS] {
        match self {
            Page::Private(words) => words,
            #[cfg(not(loom))]
            Page::Mapped(map) => {
                // SAFETY: a map begins at a page, so it is aligned to eight bytes; it is PAGE bytes long, more than WORDS
                // words; it lives as long as `self`; an atomic word may be changed through a shared reference, and every
                // pattern of bits is a word.
                unsafe { &*map.as_ptr().cast::<[AtomicU64; WORDS]>() }
            }
        }
    }
}
