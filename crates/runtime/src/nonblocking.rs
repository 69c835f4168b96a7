//! What a thread in real time may not do: told to RealtimeSanitizer, where the program is built with it.
//!
//! Between two sleeps a thread of an executor with a real-time priority neither takes memory nor waits for a lock, nor does it open a file or
//! write to one. RealtimeSanitizer sees each call that could, with its stack, from [`RealTime::enter`] on. Where it is not built in, nothing
//! of this is left.

#![cfg_attr(rtsan, allow(unsafe_code))]

#[cfg(rtsan)]
use core::cell::Cell;

/// A thread in real time, until this is dropped or the thread has lost its executor.
#[derive(Debug)]
pub(crate) struct RealTime {
    /// Whether it is one.
    #[cfg(rtsan)]
    is_real: Cell<bool>,
}

#[cfg(rtsan)]
unsafe extern "C" {
    safe fn __rtsan_realtime_enter();
    safe fn __rtsan_realtime_exit();
}

impl RealTime {
    /// From here on the calling thread may not block, if it is one in real time.
    #[inline(always)]
    pub(crate) fn enter(is_real: bool) -> RealTime {
        #[cfg(rtsan)]
        if is_real {
            __rtsan_realtime_enter();
        }
        #[cfg(not(rtsan))]
        let _ = is_real;
        RealTime {
            #[cfg(rtsan)]
            is_real: Cell::new(is_real),
        }
    }

    /// Does what may block: the thread has nothing to do.
    #[inline(always)]
    pub(crate) fn pause<R>(&self, work: impl FnOnce() -> R) -> R {
        #[cfg(rtsan)]
        let is_real = self.leave();
        let result = work();
        #[cfg(rtsan)]
        if is_real {
            __rtsan_realtime_enter();
            self.is_real.set(true);
        }
        result
    }

    /// Whether the executor is still this thread's. Who has lost it was given up, has no priority any more, and may free what it left.
    #[inline(always)]
    pub(crate) fn still(&self, mine: bool) -> bool {
        #[cfg(rtsan)]
        if !mine {
            self.leave();
        }
        mine
    }

    #[cfg(rtsan)]
    fn leave(&self) -> bool {
        let was = self.is_real.replace(false);
        if was {
            __rtsan_realtime_exit();
        }
        was
    }
}

#[cfg(rtsan)]
impl Drop for RealTime {
    fn drop(&mut self) {
        self.leave();
    }
}
