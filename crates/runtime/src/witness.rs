//! The witness: a bare thread on each processor, above everything, that only reads the clock. When it is late, nobody in the
//! process is to blame.
//!
//! Executors under `SCHED_DEADLINE` stand above it all the same. What they used of its processor before they slept, and the budgets of those who
//! are at work or were held back in the middle of it, is no part of a stall. So a witness that looks up to a period before it is late takes away a
//! little too much rather than too little: a stall that it does not see counts against us.

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
/// The kernel looks at its tick whether a budget is used up, so a thread can have so much more (ns): the longest tick there is.
const TICK: i64 = 10_000_000;

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
    /// What executors that stand above it have used of each processor (ns).
    above: Box<[AtomicI64]>,
    /// The budget of each such executor while it is at work (ns).
    at_work: Box<[AtomicI64]>,
}

impl Witness {
    /// Among so many executors.
    pub(crate) fn new(executors: usize) -> Witness {
        let seen = (0..PROCESSORS)
            .map(|_| Seen { begin: AtomicI64::new(i64::MAX), end: AtomicI64::new(i64::MIN) })
            .collect();
        let zeros = |count| (0..count).map(|_| AtomicI64::new(0)).collect();
        Witness { seen, stalls: AtomicU64::new(0), above: zeros(PROCESSORS), at_work: zeros(executors) }
    }

    /// An executor that stands above the witness is at work, with this budget; with none, it does not stand there.
    #[inline]
    pub(crate) fn works(&self, executor: usize, budget: Duration) {
        if let Some(at_work) = self.at_work.get(executor) {
            at_work.store(budget.0, Ordering::Relaxed);
        }
    }

    /// It rests, and has used so much of each of these processors at most.
    pub(crate) fn rests(&self, executor: usize, processors: [Option<usize>; 2], used: Duration) {
        for above in processors.into_iter().flatten().filter_map(|cpu| self.above.get(cpu)) {
            above.fetch_add(used.0, Ordering::Relaxed);
        }
        if let Some(at_work) = self.at_work.get(executor) {
            // Release: partner of the acquire in `taken`; who sees it at rest sees what it used.
            at_work.store(0, Ordering::Release);
        }
    }

    /// What those above can have taken of a processor since `before`, which becomes the present (ns).
    fn taken(&self, cpu: usize, before: &mut i64) -> i64 {
        let budgets = self.at_work.iter().map(|budget| budget.load(Ordering::Acquire));
        let at_work: i64 = budgets.filter(|budget| *budget > 0).map(|budget| budget + TICK).sum();
        let above = self.above.get(cpu).map_or(0, |above| above.load(Ordering::Relaxed));
        at_work + above - core::mem::replace(before, above)
    }

    /// Watches a processor, on which the calling thread must stand, until the run is over. `offset` leads from the monotonic
    /// clock to the run's.
    pub(crate) fn watch(&self, cpu: usize, over: &AtomicBool, offset: i64) {
        let Some(seen) = self.seen.get(cpu) else { return };
        let word = Futex::new(0);
        let mut due = os::monotonic() + PERIOD;
        let mut above = 0;
        while !over.load(Ordering::Acquire) {
            word.wait(0, Some(due));
            let now = os::monotonic();
            if now - due - self.taken(cpu, &mut above) > STALL {
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

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;

    #[test]
    fn what_those_above_took_is_no_stall() {
        let witness = Witness::new(2);
        let mut before = 0;
        assert_eq!(witness.taken(0, &mut before), 0);
        // At work, or held back in the middle of it: up to its budget and a tick. Then what it used, once, and only where it was.
        witness.works(1, Duration::millis(2));
        assert_eq!(witness.taken(0, &mut before), 2_000_000 + TICK);
        witness.rests(1, [Some(0), None], Duration::micros(1500));
        let mut other = 0;
        assert_eq!((witness.taken(0, &mut before), witness.taken(3, &mut other)), (1_500_000, 0));
        assert_eq!(witness.taken(0, &mut before), 0);
        // One that moved may have used it on either.
        witness.rests(0, [Some(0), Some(3)], Duration::micros(10));
        assert_eq!((witness.taken(0, &mut before), witness.taken(3, &mut other)), (10_000, 10_000));
        witness.rests(7, [Some(PROCESSORS), None], Duration::micros(10));
        assert_eq!(witness.taken(0, &mut before), 0);
    }
}
