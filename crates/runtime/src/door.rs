//! The one place where an executor is woken.
//!
//! The sender pushes, sets its bit, and looks whether the executor sleeps. The executor takes all bits at once and only then
//! looks at rings and changes: the other order loses wake-ups.

use core::sync::atomic::AtomicU32;
use core::sync::atomic::Ordering::{Relaxed, SeqCst};

use crate::os;
use crate::sync::{AtomicU64, Ordering};

/// The bit that says that changes wait; the others stand for groups of agents.
pub(crate) const CHANGES: u64 = 1 << 63;

const AWAKE: u32 = 0;
const ASLEEP: u32 = 1;

/// A word of ready bits and a flag that says whether somebody sleeps behind it.
#[derive(Debug)]
pub(crate) struct Door {
    ready: AtomicU64,
    sleeping: AtomicU32,
}

/// The bit of the agent in this slot.
pub(crate) const fn bit_of(slot: u32) -> u64 {
    1 << (slot % 63)
}

impl Door {
    pub(crate) fn new() -> Door {
        Door { ready: AtomicU64::new(0), sleeping: AtomicU32::new(AWAKE) }
    }

    /// Sets bits, and wakes the executor if it sleeps.
    #[inline]
    pub(crate) fn ring(&self, bits: u64) {
        // Sequentially consistent with the store in `sleep`: either this side sees the sleeper, or the sleeper sees the bits.
        self.ready.fetch_or(bits, Ordering::SeqCst);
        if self.sleeping.load(SeqCst) == ASLEEP && self.sleeping.swap(AWAKE, SeqCst) == ASLEEP {
            os::futex_wake(&self.sleeping);
        }
    }

    /// Whether any bit is set.
    #[inline]
    pub(crate) fn is_rung(&self) -> bool {
        self.ready.load(Ordering::Relaxed) != 0
    }

    /// Takes all bits. What was pushed before they were set is seen after this.
    #[inline]
    pub(crate) fn take(&self) -> u64 {
        if self.ready.load(Ordering::Relaxed) == 0 {
            return 0;
        }
        self.ready.swap(0, Ordering::Acquire)
    }

    /// Sleeps until a bit is set or the time (monotonic, ns) has come.
    pub(crate) fn sleep(&self, until: Option<i64>) {
        self.sleeping.store(ASLEEP, SeqCst);
        // The partner is `ring`.
        if self.ready.load(Ordering::SeqCst) == 0 {
            os::futex_wait(&self.sleeping, ASLEEP, until);
        }
        self.sleeping.store(AWAKE, Relaxed);
    }
}
