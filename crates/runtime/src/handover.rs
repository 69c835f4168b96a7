//! Whose the agents of an executor are, when a step does not return.
//!
//! A thread cannot be killed, and a step that does not return still holds it. So the core of an executor, with all its agents, can be
//! taken away from its thread and given to a spare one. The thread pays one load a step for that; the watchdog's side makes the
//! barrier that orders it behind what the step published.
//!
//! ```text
//!            watchdog: the step of n lasts too long
//!   n ───────────────────────────────────────────────► n, marked
//!   ▲                                                   │    │
//!   └── n came back in time (n itself, or the watchdog) ┘    │ watchdog: n is still in that step
//!                                                            ▼
//!   m ◄──────────────── the spare thread m claims it ─────  FREE
//! ```

use crate::sync::{AtomicU32, AtomicU64, Ordering, heavy_barrier, named};

/// What the watchdog sees of an executor: which agent is in a step, and since when. Each thread that has the executor in turn has one of
/// its own: one that comes back when it has lost it says so in its own, and hides nobody's step.
#[derive(Debug, Default)]
pub(crate) struct Running {
    /// How many steps there were, and in the lower half the slot of the agent that is in one, plus one; zero there between steps.
    step: AtomicU64,
    /// The number of the agent.
    pub agent: AtomicU32,
    /// When the step began, in [`os::ticks`].
    pub since: AtomicU64,
    /// After how long it is taken for one that does not return (ns).
    pub limit: AtomicU64,
    /// How often the executor itself took or freed memory, between and around the steps of its agents.
    pub allocations: std::sync::Arc<core::sync::atomic::AtomicU64>,
}

/// A step of an agent: no other one is equal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct InStep(u64);

impl InStep {
    /// Whose step it is.
    pub(crate) fn slot(self) -> u32 {
        self.0 as u32 - 1
    }
}

impl Running {
    /// Another one of the same executor, for the next thread that has it.
    pub(crate) fn beside(&self) -> Running {
        Running { allocations: self.allocations.clone(), ..Running::default() }
    }

    /// How many steps there were, modulo 2³². The thread that has the core counts them.
    #[inline]
    pub(crate) fn count(&self) -> u32 {
        (self.step.load(Ordering::Relaxed) >> 32) as u32
    }

    /// The step with this number begins, which is the next one. Only the thread that has the core may say so.
    #[inline]
    pub(crate) fn begin(&self, count: u32, slot: u32) {
        // Release: who gives this step up has seen what was done before it. Pairs with the barrier in `Owner::take_from`.
        let ordering = named("hand-over: step begins", Ordering::Release);
        self.step.store(u64::from(count) << 32 | u64::from(slot + 1), ordering);
    }

    /// It ended.
    #[inline]
    pub(crate) fn end(&self, count: u32) {
        self.step.store(u64::from(count) << 32, Ordering::Relaxed);
    }

    /// The step that is going on. What is said of it in the other words is that of this step or a later one.
    pub(crate) fn in_step(&self) -> Option<InStep> {
        // Pairs with the release in `begin`: since when and how long it may last were written before it.
        let word = self.step.load(Ordering::Acquire);
        (word as u32 != 0).then_some(InStep(word))
    }

    /// Whether it is still going on.
    pub(crate) fn is_still_in(&self, step: InStep) -> bool {
        self.step.load(Ordering::Relaxed) == step.0
    }
}

/// Stands beside the number of a thread that the watchdog is about to give up.
const MARK: u32 = 1 << 31;
/// Stands there while the core waits for a spare thread.
const FREE: u32 = MARK - 1;

/// The number of the thread that owns a core, perhaps marked, or that nobody does.
#[derive(Debug)]
pub(crate) struct Owner(AtomicU32);

impl Owner {
    pub(crate) fn new(number: u32) -> Owner {
        Owner(AtomicU32::new(number))
    }

    /// Whether the core is this thread's, or was given to it.
    pub(crate) fn is(&self, number: u32) -> bool {
        self.0.load(Ordering::Acquire) == number
    }

    /// Whether nobody has taken the core from this thread, whatever the watchdog is about to do.
    pub(crate) fn is_still(&self, number: u32) -> bool {
        self.0.load(Ordering::Acquire) & !MARK == number
    }

    /// After a step: whether the core is still this thread's own. The usual case costs one load.
    #[inline]
    pub(crate) fn keeps(&self, number: u32) -> bool {
        if self.0.load(Ordering::Relaxed) == number {
            return true;
        }
        // The watchdog is about to give this thread up. Whoever makes the exchange first has the core; or it has just seen that the
        // thread is back, and taken the mark away itself.
        let exchanged = self.0.compare_exchange(number | MARK, number, Ordering::Relaxed, Ordering::Relaxed);
        exchanged.is_ok() || exchanged == Err(number)
    }

    /// The watchdog: takes a core away from a thread that is still in this step. Says whether it did.
    pub(crate) fn take_from(&self, running: &Running, step: InStep) -> bool {
        let owner = self.0.load(Ordering::Relaxed);
        if owner >= FREE
            || self.0.compare_exchange(owner, owner | MARK, Ordering::Relaxed, Ordering::Relaxed).is_err()
        {
            // It is on its way already.
            return false;
        }
        // After this, either the thread is still in the step and will see the mark, or it has left it and that is seen here. And what
        // it did before the step is seen by who claims the core: the barrier stands between seeing the step and freeing the core.
        heavy_barrier();
        let still_in = running.is_still_in(step);
        let next = if still_in { FREE } else { owner };
        let done = self.0.compare_exchange(owner | MARK, next, Ordering::Relaxed, Ordering::Relaxed).is_ok();
        // Otherwise it came back and is at work.
        still_in && done
    }

    /// A spare thread: takes a core that was freed.
    pub(crate) fn claim(&self, number: u32) -> bool {
        // Pairs with the barrier in `take_from`.
        let ordering = named("hand-over: claim", Ordering::Acquire);
        self.0.compare_exchange(FREE, number, ordering, Ordering::Relaxed).is_ok()
    }
}

#[cfg(test)]
#[cfg(loom)]
#[allow(unsafe_code)] // the core of the model is used as the real one is
mod model {
    use super::*;
    use crate::sync::{UnsafeCell, light_barrier, weaken};
    use loom::{sync::Arc, thread};

    struct Core {
        owner: Owner,
        running: Running,
        /// What an executor works with: never touched by two threads at once, or loom says so.
        work: UnsafeCell<u32>,
    }
    // SAFETY: that is what the model is to show.
    unsafe impl Sync for Core {}
    // SAFETY: plain numbers.
    unsafe impl Send for Core {}

    fn touch(core: &Core) {
        // SAFETY: as above.
        core.work.with_mut(|work| unsafe { *work += 1 });
    }

    /// A thread makes some steps, the watchdog may take its core in any of them, and the spare thread goes on. One of the two has it.
    fn steps(count: u64) {
        let core =
            Arc::new(Core { owner: Owner::new(1), running: Running::default(), work: UnsafeCell::new(0) });
        let first = core.clone();
        let worker = thread::spawn(move || {
            (1..=count as u32).all(|step| {
                touch(&first);
                let running = &first.running;
                running.begin(step, 0);
                // Here is the step, which touches nothing of the core.
                running.end(step);
                light_barrier();
                let keeps = first.owner.keeps(1);
                if keeps {
                    touch(&first);
                }
                keeps
            })
        });
        let second = core.clone();
        let watchdog = thread::spawn(move || {
            let running = &second.running;
            running.in_step().is_some_and(|step| second.owner.take_from(running, step))
        });
        let claimed = core.owner.claim(2);
        if claimed {
            touch(&core);
        }
        let (kept, taken) = (worker.join().unwrap(), watchdog.join().unwrap());
        assert_ne!(kept, taken, "two have the core, or nobody");
        assert!(taken || !claimed);
    }

    #[test]
    fn a_core_is_never_used_by_two_and_never_lost() {
        weaken::check(&[], || steps(1));
    }

    #[test]
    fn a_later_step_of_the_same_agent_is_another_step() {
        weaken::check(&[], || steps(2));
    }
}
