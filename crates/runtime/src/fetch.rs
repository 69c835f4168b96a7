//! Memory that the processor is asked for before it is used.
//!
//! Of thousands of agents none is still near the processor when its turn comes again: its step would wait for one line of memory
//! after another, each of which says where the next one lies. Who knows whose turn comes soon has them fetched meanwhile.

#![allow(unsafe_code)]

/// How much memory comes at once (bytes).
const LINE: usize = 64;

/// How far on the way to what a message touches: each part lies where the one before says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Depth {
    /// What stands behind a port.
    Ends,
    /// Its wires.
    Wires,
    /// The places of the next messages.
    Places,
}

/// Has the first `lines` lines of a value fetched. It need not be there any more, and nothing is read.
#[inline]
pub(crate) fn fetch<T: ?Sized>(value: *const T, lines: usize) {
    let start = value.cast::<i8>();
    for line in 0..lines {
        fetch_line(start.wrapping_add(line * LINE));
    }
}

#[cfg(target_arch = "x86_64")]
#[inline]
fn fetch_line(at: *const i8) {
    use core::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
    // SAFETY: a hint, which no address makes fail.
    unsafe { _mm_prefetch::<_MM_HINT_T0>(at) }
}

/// Other processors find it when it is used.
#[cfg(not(target_arch = "x86_64"))]
#[inline]
fn fetch_line(_: *const i8) {}
