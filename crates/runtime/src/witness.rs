//! The witness: a bare thread on each processor, above everything, that only reads the clock. When it is late, nobody in the
//! process is to blame.

use core::sync::atomic::{AtomicBool, AtomicI64, AtomicU64, Ordering};

use types::{Duration, Time};

use crate::os;
use crate::sync::Futex;

/// Processors that are watched.
const PROCESSORS: usize = 64;
/// How often it looks.
const PERIOD: i64 = 1_000_000;
/// Later than this, and it was a stall (ns).
const STALL: i64 = 500_000;

#[derive(Debug)]
struct Seen {
    begin: AtomicI64,
    end: AtomicI64,
}

/// The last stall of each processor, and how many there were.
#[derive(Debug)]
pub(crate) struct Witness {
    seen: Box<[Seen]>,
    stalls: AtomicU64,
}

impl Witness {
    pub(crate) fn new() -> Witness {
        let seen = (0..PROCESSORS)
            .map(|_| Seen { begin: AtomicI64::new(i64::MAX), end: AtomicI64::new(i64::MIN) })
            .collect();
        Witness { seen, stalls: AtomicU64::new(0) }
    }

    /// Watches a processor, on which the calling thread must stand, until the run is over. `offset` leads from the monotonic
    /// clock to the run's.
    pub(crate) fn watch(&self, cpu: usize, over: &AtomicBool, offset: i64) {
        let Some(seen) = self.seen.get(cpu) else { return };
        let word = Futex::new(0);
        let mut due = os::monotonic() + PERIOD;
        while !over.load(Ordering::Acquire) {
            word.wait(0, Some(due));
            let now = os::monotonic();
            if now - due > STALL {
                seen.end.store(i64::MIN, Ordering::Release);
                seen.begin.store(due + offset, Ordering::Release);
                seen.end.store(now + offset, Ordering::Release);
                // Release: partner of the acquire in `stalls`.
                self.stalls.fetch_add(1, Ordering::Release);
            }
            due = if now > due + PERIOD { now + PERIOD } else { due + PERIOD };
        }
    }

    /// Whether any processor stood still at some time from `begin` to `end`.
    pub(crate) fn saw_stall(&self, begin: Time, end: Time) -> bool {
        let slack = Duration(STALL).0;
        self.seen.iter().any(|seen| {
            let (from, to) = (seen.begin.load(Ordering::Acquire), seen.end.load(Ordering::Acquire));
            to != i64::MIN && from <= end.0 && to >= begin.0 - slack
        })
    }

    /// How many stalls there were.
    #[inline]
    pub(crate) fn stalls(&self) -> u64 {
        // Acquire: who sees the number sees when the last of them was.
        self.stalls.load(Ordering::Acquire)
    }
}
