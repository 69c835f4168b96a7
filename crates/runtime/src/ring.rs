//! The bounded one-sender, one-receiver ring behind every wire.
//!
//! It holds `n` messages in `n + 2` slots, and each slot has one owner at a time: the sender owns the one that it fills next,
//! the receiver the one that it reads, and each of the `n` entries of the ring names one more. Sending exchanges the sender's
//! slot for the one that the entry names; taking exchanges the receiver's. So a payload is written and read in place, nothing
//! is read torn, and a sender that displaces the oldest message never waits:
//!
//! ```text
//!            send: entry.swap(FULL, my slot, position) ──► free slot, or the oldest message, displaced
//!   EMPTY(slot) ─────────────────────────────────────► FULL(slot, position)
//!        ▲                                                  │
//!        └──────────── take: entry.cas(EMPTY, my slot) ◄────┘
//! ```
//!
//! Where the sender refuses instead of displacing, an entry is only ever changed by the side whose turn it is, and plain
//! stores take the place of the exchanges.

#![allow(unsafe_code)]

use std::sync::Arc;

use crate::fetch::fetch;
use crate::sync::{AtomicU64, Ordering, UnsafeCell, named};

/// What a sender does when the ring is full.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Overload {
    /// The oldest message makes room: for readings and states.
    #[default]
    NewestWins,
    /// The new message is dropped and counted: for a backlog that must stay in order.
    OldestWins,
    /// The new message is given back to the sender, who is told: for what must not be lost in silence.
    Refuse,
}

impl Overload {
    /// Its name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Overload::NewestWins => "newest-wins",
            Overload::OldestWins => "oldest-wins",
            Overload::Refuse => "refuse",
        }
    }

    /// The policy with this name.
    pub fn named(name: &str) -> Option<Overload> {
        [Overload::NewestWins, Overload::OldestWins, Overload::Refuse]
            .into_iter()
            .find(|policy| policy.name() == name)
    }
}

/// What became of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pushed {
    Stored,
    Displaced,
    Full,
}

/// The most messages that a ring can hold: slots are numbered in sixteen bits, and two belong to the ends.
pub const MOST_MESSAGES: usize = (1 << 16) - 3;

const FULL: u64 = 1;
const POSITION_SHIFT: u32 = 17;

fn full(slot: u16, position: u64) -> u64 {
    FULL | u64::from(slot) << 1 | position << POSITION_SHIFT
}

fn empty(slot: u16) -> u64 {
    u64::from(slot) << 1
}

fn slot_of(entry: u64) -> u16 {
    (entry >> 1) as u16
}

/// Lines of a slot that are fetched before it is used.
const MOST_OF_A_SLOT: usize = 4;

struct Shared<T> {
    entries: Box<[AtomicU64]>,
    slots: Box<[UnsafeCell<T>]>,
}

// SAFETY: a slot is touched only by the end that owns its number, and numbers pass between the ends through the entries with
// release and acquire.
unsafe impl<T: Send> Sync for Shared<T> {}
// SAFETY: as above; the slots hold plain `T`s.
unsafe impl<T: Send> Send for Shared<T> {}

/// What both ends have: the way to the shared memory without looking at the bounds again, and the slot that is their own.
struct End<T> {
    entries: *const [AtomicU64],
    slots: *const [UnsafeCell<T>],
    /// Always within `entries`.
    index: usize,
    /// Always within `slots`: every number in the ring is, and ends only exchange them.
    slot: u16,
    displaces: bool,
    /// Which message it is at, where the sender displaces.
    position: u64,
    /// Keeps the memory.
    _shared: Arc<Shared<T>>,
}

// SAFETY: the pointers lead into what `_shared` keeps, and that can be sent and shared where `T` can be sent.
unsafe impl<T: Send> Send for End<T> {}
// SAFETY: as above; by a shared reference an end only reads entries and its own slot.
unsafe impl<T: Send + Sync> Sync for End<T> {}

impl<T> End<T> {
    fn new(shared: Arc<Shared<T>>, slot: u16, displaces: bool) -> End<T> {
        let (entries, slots) = (&raw const *shared.entries, &raw const *shared.slots);
        End { entries, slots, index: 0, slot, displaces, position: 0, _shared: shared }
    }

    #[inline(always)]
    fn len(&self) -> usize {
        self.entries.len()
    }

    #[inline(always)]
    fn entry(&self) -> &AtomicU64 {
        // SAFETY: `_shared` keeps the entries, and `index` is within them.
        unsafe { (&*self.entries).get_unchecked(self.index) }
    }

    #[inline(always)]
    fn place(&self) -> &UnsafeCell<T> {
        // SAFETY: `_shared` keeps the slots, and `slot` is within them.
        unsafe { (&*self.slots).get_unchecked(usize::from(self.slot)) }
    }

    /// Has the next entry and the own slot fetched.
    fn fetch(&self) {
        fetch(self.entry(), 1);
        fetch(self.place(), size_of::<T>().div_ceil(64).min(MOST_OF_A_SLOT));
    }

    #[inline(always)]
    fn step(&mut self) {
        self.index = if self.index + 1 == self.len() { 0 } else { self.index + 1 };
    }
}

/// The end that sends.
pub(crate) struct Sender<T>(End<T>);

/// The end that takes.
pub(crate) struct Receiver<T>(End<T>);

/// A ring for `capacity` messages. With `displaces` the sender may push out the oldest.
pub(crate) fn ring<T: Default + Send>(capacity: usize, displaces: bool) -> (Sender<T>, Receiver<T>) {
    let n = capacity.clamp(1, MOST_MESSAGES);
    let entries = (0..n).map(|i| AtomicU64::new(empty(i as u16))).collect();
    let slots = (0..n + 2).map(|_| UnsafeCell::new(T::default())).collect();
    let shared = Arc::new(Shared { entries, slots });
    let sender = Sender(End::new(shared.clone(), n as u16, displaces));
    (sender, Receiver(End::new(shared, n as u16 + 1, displaces)))
}

impl<T> Sender<T> {
    /// Has fetched what the next message touches.
    pub(crate) fn fetch(&self) {
        self.0.fetch();
    }

    /// Whether a message can be sent without displacing another.
    #[inline]
    pub(crate) fn has_room(&self) -> bool {
        // Whether the receiver is done with the slot that the entry names is seen by `push`.
        self.0.entry().load(Ordering::Relaxed) & FULL == 0
    }

    /// Fills the next message in place and sends it. Where there is no room it displaces the oldest if the ring allows that,
    /// else answers [`Pushed::Full`] without calling `fill`.
    #[inline(always)]
    pub(crate) fn push(&mut self, fill: impl FnOnce(&mut T)) -> Pushed {
        let end = &mut self.0;
        let mut old = 0;
        if !end.displaces {
            // Pairs with the release in `Receiver::advance`.
            old = end.entry().load(named("ring: refuse, look", Ordering::Acquire));
            if old & FULL != 0 {
                return Pushed::Full;
            }
        }
        // SAFETY: the slot is this end's own.
        end.place().with_mut(|place| fill(unsafe { &mut *place }));
        if end.displaces {
            return self.put_displacing();
        }
        // Pairs with the acquire in `Receiver::advance`. An empty entry is the sender's to change. Nobody laps, so no position.
        end.entry().store(full(end.slot, 0), named("ring: refuse, put", Ordering::Release));
        end.slot = slot_of(old);
        end.step();
        Pushed::Stored
    }

    /// Sends what this end's slot was filled with, where the oldest message makes room.
    #[inline(never)]
    fn put_displacing(&mut self) -> Pushed {
        let end = &mut self.0;
        // Release pairs with the acquire in `Receiver::advance`, for what was filled; acquire pairs with its release,
        // for the slot that comes back.
        let ordering = named("ring: displace", Ordering::AcqRel);
        let old = end.entry().swap(full(end.slot, end.position), ordering);
        end.slot = slot_of(old);
        end.position += 1;
        end.step();
        if old & FULL == 0 { Pushed::Stored } else { Pushed::Displaced }
    }
}

impl<T> Receiver<T> {
    /// Has fetched what the next message touches.
    pub(crate) fn fetch(&self) {
        self.0.fetch();
    }

    /// Whether a message waits.
    #[inline]
    pub(crate) fn has_message(&self) -> bool {
        self.0.entry().load(Ordering::Relaxed) & FULL != 0
    }

    /// Takes the oldest message into this end's slot, where [`current`](Self::current) reads it. Says whether there was one.
    #[inline]
    pub(crate) fn advance(&mut self) -> bool {
        let end = &mut self.0;
        // Pairs with the release in `Sender::push`.
        let seen = end.entry().load(named("ring: take", Ordering::Acquire));
        if seen & FULL == 0 {
            return false;
        }
        if end.displaces {
            return self.advance_displaceable(seen);
        }
        // A full entry is the receiver's to change where the sender never displaces.
        end.entry().store(empty(end.slot), named("ring: refuse, give back", Ordering::Release));
        end.slot = slot_of(seen);
        end.step();
        true
    }

    /// The same where the sender may displace what was just seen.
    #[inline(never)]
    fn advance_displaceable(&mut self, mut seen: u64) -> bool {
        let end = &mut self.0;
        loop {
            let position = seen >> POSITION_SHIFT;
            if position != end.position {
                // The sender has lapped this end: it has displaced everything up to a whole ring before what was seen.
                end.position = position + 1 - end.len() as u64;
                end.index = (end.position % end.len() as u64) as usize;
            } else {
                // Release pairs with the acquire in `Sender::push`: this end has done reading the slot that it gives back.
                let ordering = named("ring: displaceable, give back", Ordering::Release);
                let exchange =
                    end.entry().compare_exchange(seen, empty(end.slot), ordering, Ordering::Relaxed);
                if exchange.is_ok() {
                    end.slot = slot_of(seen);
                    end.position += 1;
                    end.step();
                    return true;
                }
            }
            seen = end.entry().load(named("ring: take", Ordering::Acquire));
            if seen & FULL == 0 {
                return false;
            }
        }
    }

    /// The message that was taken last.
    #[inline]
    pub(crate) fn current(&self) -> &T {
        // SAFETY: the slot is this end's own until the next `advance`, which needs it exclusively.
        self.0.place().with(|place| unsafe { &*place })
    }

    /// The same, to be changed or taken out: nobody else sees it.
    #[inline]
    pub(crate) fn current_mut(&mut self) -> &mut T {
        // SAFETY: as in `current`, and this end is borrowed exclusively.
        self.0.place().with_mut(|place| unsafe { &mut *place })
    }
}

#[cfg(test)]
#[cfg(not(loom))]
mod tests {
    use super::*;
    use std::collections::VecDeque;

    fn drain(receiver: &mut Receiver<u32>) -> Vec<u32> {
        std::iter::from_fn(|| receiver.advance().then(|| *receiver.current())).collect()
    }

    #[test]
    fn the_newest_win_and_stay_in_order() {
        let (mut sender, mut receiver) = ring(3, true);
        let became: Vec<Pushed> = (0..5).map(|i| sender.push(|slot| *slot = i)).collect();
        assert_eq!(
            became,
            [Pushed::Stored, Pushed::Stored, Pushed::Stored, Pushed::Displaced, Pushed::Displaced]
        );
        assert_eq!(drain(&mut receiver), [2, 3, 4]);
    }

    #[test]
    fn a_full_ring_that_refuses_keeps_the_oldest() {
        let (mut sender, mut receiver) = ring(2, false);
        assert_eq!(sender.push(|slot| *slot = 1), Pushed::Stored);
        assert_eq!(sender.push(|slot| *slot = 2), Pushed::Stored);
        assert!(!sender.has_room());
        assert_eq!(sender.push(|_| panic!("a refused message is not filled")), Pushed::Full);
        assert_eq!(drain(&mut receiver), [1, 2]);
    }

    proptest::proptest! {
        /// Against a queue that does the same with one thread.
        #[test]
        fn it_does_what_a_plain_queue_does(capacity in 1usize..6, displaces: bool, sends in proptest::collection::vec(proptest::bool::ANY, 0..200)) {
            let (mut sender, mut receiver) = ring(capacity, displaces);
            let mut model = VecDeque::new();
            for (i, send) in sends.into_iter().enumerate() {
                if send {
                    let pushed = sender.push(|slot| *slot = i);
                    proptest::prop_assert_eq!(pushed == Pushed::Stored, model.len() < capacity);
                    if model.len() < capacity {
                        model.push_back(i);
                    } else if displaces {
                        model.pop_front();
                        model.push_back(i);
                    }
                } else {
                    proptest::prop_assert_eq!(receiver.has_message(), !model.is_empty());
                    let taken = receiver.advance().then(|| *receiver.current());
                    proptest::prop_assert_eq!(taken, model.pop_front());
                }
            }
        }
    }
}

#[cfg(test)]
#[cfg(loom)]
mod model {
    use super::*;
    use crate::sync::weaken;
    use loom::thread;

    /// Both halves of a payload are written apart: a torn read would show them apart.
    #[derive(Default)]
    struct Pair(u32, u32);

    /// A sender and a receiver at once, with a ring that was full before: so the slots go around within few messages.
    fn exchange(capacity: u32, displaces: bool, sends: u32, takes: u32) {
        let (mut sender, mut receiver) = ring::<Pair>(capacity as usize, displaces);
        let send = |sender: &mut Sender<Pair>, i: u32| sender.push(|pair| *pair = Pair(i, i));
        (1..=capacity).for_each(|i| assert_eq!(send(&mut sender, i), Pushed::Stored));
        let other = thread::spawn(move || {
            let became = (capacity + 1..=capacity + sends).map(|i| send(&mut sender, i));
            became.filter(|pushed| *pushed != Pushed::Full).count() as u32
        });
        let (mut last, mut taken) = (0, 0);
        let mut take = |receiver: &mut Receiver<Pair>| {
            let some = receiver.advance();
            if some {
                let pair = receiver.current();
                assert_eq!(pair.0, pair.1, "torn");
                assert!(pair.0 > last, "out of order or doubled: {} after {last}", pair.0);
                last = pair.0;
                taken += 1;
            }
            some
        };
        for _ in 0..takes {
            take(&mut receiver);
        }
        let stored = capacity + other.join().unwrap();
        while take(&mut receiver) {}
        assert!(taken <= stored);
        if displaces {
            assert_eq!(last, capacity + sends, "the newest is never lost");
        } else {
            assert_eq!(taken, stored, "what was accepted arrives");
        }
    }

    #[test]
    fn newest_wins_with_one_place() {
        weaken::check(&[], || exchange(1, true, 3, 2));
    }

    #[test]
    fn newest_wins_past_the_wrap() {
        weaken::check(&[], || exchange(2, true, 3, 2));
    }

    #[test]
    fn refuse_past_the_wrap() {
        weaken::check(&[], || exchange(2, false, 3, 3));
    }

    /// What is asked goes one way and comes back the other, to be freed where it was made.
    #[test]
    fn what_is_lent_comes_back() {
        weaken::check(&["ring: refuse, look", "ring: refuse, give back"], || {
            let (mut ask, mut asked) = ring::<Option<Box<Pair>>>(1, false);
            let (mut answer, mut answered) = ring::<Option<Box<Pair>>>(1, false);
            let other = thread::spawn(move || {
                let mut done = 0;
                while done < 2 {
                    if answer.has_room() && asked.advance() {
                        let mut pair = asked.current_mut().take().expect("an empty message");
                        pair.1 = pair.0;
                        answer.push(|slot| *slot = Some(pair));
                        done += 1;
                    } else {
                        thread::yield_now();
                    }
                }
            });
            let (mut sent, mut back) = (0, 0);
            while back < 2 {
                if sent < 2 && ask.has_room() {
                    sent += 1;
                    ask.push(|slot| *slot = Some(Box::new(Pair(sent, 0))));
                }
                if answered.advance() {
                    back += 1;
                    let pair = answered.current_mut().take().expect("an empty answer");
                    assert_eq!((pair.0, pair.1), (back, back));
                } else {
                    thread::yield_now();
                }
            }
            other.join().unwrap();
        });
    }
}
