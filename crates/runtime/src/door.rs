//! The one place where an executor is woken.
//!
//! The sender pushes, sets its bit, and looks whether the executor sleeps. The executor takes all bits at once and only then
//! looks at rings and changes: the other order loses wake-ups.

use crate::sync::{AtomicU64, Futex, Ordering, named};

/// The bit that says that changes wait; the others stand for groups of agents.
pub(crate) const CHANGES: u64 = 1 << 63;

const AWAKE: u32 = 0;
const ASLEEP: u32 = 1;
/// Somebody is about to wake the executor. Until that is done others do it too: who is about to may have been pre-empted.
const RINGING: u32 = 2;

/// A word of ready bits and a flag that says whether somebody sleeps behind it.
///
/// Both sides change the ready word, so of the two one comes second: either the executor sees the bit, or the sender sees the sleeper.
#[derive(Debug)]
pub(crate) struct Door {
    ready: AtomicU64,
    sleeping: Futex,
}

/// The bit of the agent in this slot.
pub(crate) const fn bit_of(slot: u32) -> u64 {
    1 << (slot % 63)
}

impl Door {
    pub(crate) fn new() -> Door {
        Door { ready: AtomicU64::new(0), sleeping: Futex::new(AWAKE) }
    }

    /// Sets bits, and wakes the executor if it sleeps.
    #[inline]
    pub(crate) fn ring(&self, bits: u64) {
        // Release, for what was pushed, pairs with the acquire in `take`; acquire, for the flag, with the release in `sleep`.
        self.ready.fetch_or(bits, named("door: ring", Ordering::AcqRel));
        if self.sleeping.word.load(Ordering::Relaxed) != AWAKE {
            self.wake();
        }
    }

    fn wake(&self) {
        let sleeping = &self.sleeping.word;
        let seen = sleeping.compare_exchange(ASLEEP, RINGING, Ordering::Relaxed, Ordering::Relaxed);
        if seen != Err(AWAKE) {
            self.sleeping.wake();
            // Done: whoever comes now need not do it again. Where the executor was awake and sleeps again, nothing changes.
            let _ = sleeping.compare_exchange(RINGING, AWAKE, Ordering::Relaxed, Ordering::Relaxed);
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
        // Pairs with the release in `ring`.
        self.ready.swap(0, named("door: take", Ordering::Acquire))
    }

    /// Sleeps until a bit is set or the time (monotonic, ns) has come.
    pub(crate) fn sleep(&self, until: Option<i64>) {
        self.sleeping.word.swap(ASLEEP, Ordering::Relaxed);
        // A change of the word that changes nothing: a sender that comes after it sees the flag. Release pairs with the acquire in `ring`.
        if self.ready.fetch_or(0, named("door: sleep", Ordering::Release)) == 0 {
            self.sleeping.wait(ASLEEP, until);
        }
        self.sleeping.word.swap(AWAKE, Ordering::Relaxed);
    }
}

#[cfg(test)]
#[cfg(not(loom))]
mod tests {
    use super::*;
    use std::sync::Arc;

    /// A sender of low priority was pre-empted when it was about to wake the executor: another one does it.
    #[test]
    fn who_was_about_to_ring_is_not_waited_for() {
        let door = Arc::new(Door::new());
        let behind = door.clone();
        let sleeper = std::thread::Builder::new().spawn(move || behind.sleep(None)).unwrap();
        while door
            .sleeping
            .word
            .compare_exchange(ASLEEP, RINGING, Ordering::Relaxed, Ordering::Relaxed)
            .is_err()
        {
            std::thread::yield_now();
        }
        // It may not have gone to sleep yet, and then need not be woken.
        let mut patience = 1_000_000;
        while !sleeper.is_finished() {
            door.sleeping.word.store(RINGING, Ordering::Relaxed);
            door.ring(CHANGES);
            std::thread::yield_now();
            patience -= 1;
            assert!(patience > 0, "it sleeps on behind a door that rings");
        }
        sleeper.join().unwrap();
    }
}

#[cfg(test)]
#[cfg(loom)]
mod model {
    use super::*;
    use crate::ring::ring;
    use crate::sync::weaken;
    use loom::{sync::Arc, thread};

    /// The door passes on what was pushed, too; that the ring does so by itself is shown with the ring.
    const RING: [&str; 4] =
        ["ring: refuse, look", "ring: refuse, put", "ring: take", "ring: refuse, give back"];

    /// Two senders; the receiver sleeps whenever it has found nothing. A wake-up that is lost leaves it asleep for ever.
    #[test]
    fn nobody_who_rings_is_missed() {
        weaken::check(&RING, || {
            let door = Arc::new(Door::new());
            let mut lanes = Vec::new();
            let senders: Vec<_> = [1u32, 2]
                .into_iter()
                .map(|number| {
                    let (mut sender, receiver) = ring::<u32>(1, false);
                    lanes.push(receiver);
                    let door = door.clone();
                    thread::spawn(move || {
                        sender.push(|slot| *slot = number);
                        door.ring(bit_of(number));
                    })
                })
                .collect();
            let mut taken = 0;
            while taken < 3 {
                let bits = door.take();
                let mut found = false;
                for (lane, number) in lanes.iter_mut().zip([1u32, 2]) {
                    if bits & bit_of(number) != 0 {
                        assert!(lane.advance(), "the bit was set, and the message is not there");
                        assert_eq!(*lane.current(), number);
                        taken += number;
                        found = true;
                    }
                }
                if !found {
                    door.sleep(None);
                }
            }
            senders.into_iter().for_each(|sender| sender.join().unwrap());
        });
    }
}
