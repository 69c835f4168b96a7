//! The page of memory in which a latch lives: shared between processes, or private to one.

#![allow(unsafe_code)]

use std::fs::File;
use std::io;

#[cfg(not(loom))]
use memmap2::{MmapMut, MmapOptions};

#[cfg(loom)]
pub(super) use loom::sync::atomic::{AtomicU64, Ordering};
#[cfg(not(loom))]
pub(super) use std::sync::atomic::{AtomicU64, Ordering};

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
