//! Who takes memory on the real-time side: an allocator that counts what each thread asks of it.
//!
//! Taking memory can wait for a lock or for the kernel, and no real-time step may. A program that stands on [`Watched`] tells of
//! each agent how often its steps took or freed memory, and the same of the runtime around them; without it nobody knows.

#![allow(unsafe_code)]

use core::alloc::{GlobalAlloc, Layout};
use core::cell::Cell;
use core::hint::black_box;
use std::alloc::System;

thread_local! {
    /// How often this thread has taken or freed memory. Neither made nor dropped at run time, so it can be used inside an allocator.
    static COUNT: Cell<u64> = const { Cell::new(0) };
}

/// An allocator that counts what each thread asks of the one behind it.
///
/// ```
/// #[global_allocator]
/// static MEMORY: runtime::Watched = runtime::Watched::SYSTEM;
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Watched<A = System>(A);

impl Watched {
    /// In front of the allocator of the system.
    pub const SYSTEM: Watched = Watched(System);
}

impl<A> Watched<A> {
    /// In front of another allocator.
    pub const fn new(behind: A) -> Watched<A> {
        Watched(behind)
    }
}

#[inline]
fn count() {
    // While a thread goes it has no count any more.
    let _ = COUNT.try_with(|count| count.set(count.get() + 1));
}

// SAFETY: every call goes on to the allocator behind as it came.
unsafe impl<A: GlobalAlloc> GlobalAlloc for Watched<A> {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller's promises are those that the allocator behind asks for.
        unsafe { self.0.alloc(layout) }
    }

    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        count();
        // SAFETY: as in `alloc`.
        unsafe { self.0.dealloc(place, layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: as in `alloc`.
        unsafe { self.0.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, place: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: as in `alloc`.
        unsafe { self.0.realloc(place, layout, size) }
    }
}

/// How often the calling thread has taken or freed memory; always zero where the program does not stand on [`Watched`].
#[inline]
pub(crate) fn so_far() -> u64 {
    COUNT.with(Cell::get)
}

/// Does what takes memory on no real-time thread: what is only there in simulated time.
pub(crate) fn not_counted<R>(what: impl FnOnce() -> R) -> R {
    let before = so_far();
    let done = what();
    COUNT.with(|count| count.set(before));
    done
}

/// Whether the program stands on [`Watched`].
pub(crate) fn are_watched() -> bool {
    let before = so_far();
    drop(black_box(Box::new(0u8)));
    so_far() != before
}
