//! A bounded ring with one sender and several receivers, made of owned slots as the ring behind a wire is.
//!
//! Each entry says whether it is full, which slot it names, and its position. The position of an empty one is that of the message
//! that comes next, so a receiver that was away sees from any entry how far the others have come:
//!
//! ```text
//!            push: my slot in, the entry's slot out
//!   EMPTY(slot, p) ─────────────────────────────────► FULL(slot, p)
//!        ▲                                                │
//!        │ p + n                                          │
//!        └──────────── take: cas(EMPTY(my slot, p + n)) ◄─┘
//! ```
//!
//! Messages leave in order, since a receiver takes only what stands at its own position, and moves on only over what is gone. Of
//! several that try for the same message the exchange lets one have it. The rest of them have lost nothing but time.

#![allow(unsafe_code)]

use std::cell::Cell;

use crate::ring::Pushed;
use crate::sync::{AtomicU32, AtomicU64, Ordering, UnsafeCell, named};
use types::{AgentId, Header, Priority, Time};

const FULL: u64 = 1;
const POSITION_SHIFT: u32 = 17;

fn full(slot: u16, position: u64) -> u64 {
    FULL | u64::from(slot) << 1 | position << POSITION_SHIFT
}

fn empty(slot: u16, position: u64) -> u64 {
    u64::from(slot) << 1 | position << POSITION_SHIFT
}

fn slot_of(state: u64) -> u16 {
    (state >> 1) as u16
}

fn position_of(state: u64) -> u64 {
    state >> POSITION_SHIFT
}

/// What decides which message is next: the smaller is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Key {
    /// How far below the most urgent priority.
    below: u32,
    stamp: i64,
    sender: u32,
}

impl Key {
    pub(crate) fn new(priority: Priority, stamp: Time, sender: AgentId) -> Key {
        Key { below: u32::from(u8::MAX - priority as u8), stamp: stamp.0, sender: sender.0 }
    }

    pub(crate) fn of(header: &Header) -> Key {
        Key::new(header.priority, header.stamp, header.sender)
    }
}

/// The key of the message in a slot, beside it: a slot is read only by its owner, and whoever compares fronts owns none of them.
#[derive(Default)]
struct Label {
    stamp: AtomicU64,
    who: AtomicU64,
}

impl Label {
    fn set(&self, key: Key) {
        self.stamp.store(key.stamp as u64, Ordering::Relaxed);
        self.who.store(u64::from(key.below) << 32 | u64::from(key.sender), Ordering::Relaxed);
    }

    fn key(&self) -> Key {
        let who = self.who.load(Ordering::Relaxed);
        let stamp = self.stamp.load(Ordering::Relaxed) as i64;
        Key { below: (who >> 32) as u32, stamp, sender: who as u32 }
    }
}

/// How far the sender is, and the slot that it owns.
#[derive(Debug)]
pub(super) struct Filling {
    position: u64,
    slot: u16,
}

impl Filling {
    pub(super) fn new(slot: u16) -> Filling {
        Filling { position: 0, slot }
    }
}

/// How far a receiver is, and the slot that it owns.
#[derive(Debug)]
pub(super) struct Taking {
    position: Cell<u64>,
    slot: Cell<u16>,
}

impl Taking {
    pub(super) fn new(slot: u16) -> Taking {
        Taking { position: Cell::new(0), slot: Cell::new(slot) }
    }
}

/// A message that was seen at the front.
#[derive(Clone, Copy, Debug)]
pub(super) struct Front {
    state: u64,
    pub(super) key: Key,
}

pub(super) struct Ring<P> {
    entries: Box<[AtomicU64]>,
    labels: Box<[Label]>,
    slots: Box<[UnsafeCell<P>]>,
    closed: AtomicU32,
}

// SAFETY: a slot is touched only by the end that owns its number, and numbers pass between the ends through the entries with
// release and acquire.
unsafe impl<P: Send> Sync for Ring<P> {}
// SAFETY: as above; the slots hold plain messages.
unsafe impl<P: Send> Send for Ring<P> {}

impl<P: Default> Ring<P> {
    /// A ring for `depth` messages: the entries name the first slots, the sender owns the next one, and each receiver one more.
    pub(super) fn new(depth: usize, receivers: usize) -> Ring<P> {
        let slots = depth + 1 + receivers;
        Ring {
            entries: (0..depth).map(|i| AtomicU64::new(empty(i as u16, i as u64))).collect(),
            labels: (0..slots).map(|_| Label::default()).collect(),
            slots: (0..slots).map(|_| UnsafeCell::new(P::default())).collect(),
            closed: AtomicU32::new(0),
        }
    }
}

impl<P> Ring<P> {
    pub(super) fn close(&self) {
        self.closed.store(1, Ordering::Relaxed);
    }

    pub(super) fn open(&self) {
        self.closed.store(0, Ordering::Relaxed);
    }

    fn entry(&self, position: u64) -> &AtomicU64 {
        &self.entries[(position % self.entries.len() as u64) as usize]
    }

    /// How many messages wait, for people.
    pub(super) fn waiting(&self) -> usize {
        self.entries.iter().filter(|entry| entry.load(Ordering::Relaxed) & FULL != 0).count()
    }

    /// Whether the sender has room for a message without displacing another.
    pub(super) fn has_room(&self, filling: &Filling) -> bool {
        self.entry(filling.position).load(Ordering::Relaxed) & FULL == 0
    }

    /// Fills the next message in place and sends it. Where there is no room it displaces the oldest if it may, else answers
    /// [`Pushed::Full`] without calling `fill`. Only the sender may call this.
    #[inline]
    pub(super) fn push(
        &self,
        filling: &mut Filling,
        displaces: bool,
        key: Key,
        fill: impl FnOnce(&mut P),
    ) -> Pushed {
        if self.closed.load(Ordering::Relaxed) != 0 {
            return Pushed::Full;
        }
        let entry = self.entry(filling.position);
        let put = || {
            // SAFETY: `filling.slot` is the sender's own.
            self.slots[usize::from(filling.slot)].with_mut(|place| fill(unsafe { &mut *place }));
            self.labels[usize::from(filling.slot)].set(key);
        };
        let next = full(filling.slot, filling.position);
        let old = if displaces {
            put();
            // Release pairs with the acquire in `front`, for what was filled; acquire pairs with the release in `take`, for the
            // slot that comes back.
            entry.swap(next, named("queue: displace", Ordering::AcqRel))
        } else {
            // Pairs with the release in `take`.
            let old = entry.load(named("queue: refuse, look", Ordering::Acquire));
            if old & FULL != 0 {
                return Pushed::Full;
            }
            put();
            // Pairs with the acquire in `front`. An empty entry is the sender's to change.
            entry.store(next, named("queue: refuse, put", Ordering::Release));
            old
        };
        filling.slot = slot_of(old);
        filling.position += 1;
        if old & FULL == 0 { Pushed::Stored } else { Pushed::Displaced }
    }

    /// The oldest message. What is gone before it is passed over: a step for each at most that others took since the last look, and
    /// at most as many as the ring holds.
    #[inline]
    pub(super) fn front(&self, taking: &Taking) -> Option<Front> {
        loop {
            let position = taking.position.get();
            let entry = self.entry(position);
            // Pairs with the release in `push`: key and message are those of this state.
            let state = entry.load(named("queue: look", Ordering::Acquire));
            let at = position_of(state);
            if at > position {
                // The one a whole ring before it is gone, and so is everything before that.
                taking.position.set(at + 1 - self.entries.len() as u64);
                continue;
            }
            if at < position || state & FULL == 0 {
                return None;
            }
            return Some(Front { state, key: self.labels[usize::from(slot_of(state))].key() });
        }
    }

    /// Takes a message that was seen. False when it is gone.
    #[inline]
    pub(super) fn take(&self, taking: &Taking, front: &Front) -> bool {
        let position = position_of(front.state);
        let next = empty(taking.slot.get(), position + self.entries.len() as u64);
        // Release pairs with the acquire in `push`: this end has done reading the slot that it gives back, and the key.
        let ordering = named("queue: give back", Ordering::Release);
        let entry = self.entry(position);
        if entry.compare_exchange(front.state, next, ordering, Ordering::Relaxed).is_err() {
            return false;
        }
        taking.slot.set(slot_of(front.state));
        taking.position.set(position + 1);
        true
    }

    /// The message that this receiver took last.
    #[inline]
    pub(super) fn slot_of(&self, taking: &Taking) -> &P {
        // SAFETY: the slot is the receiver's own until its next `take`, which needs the receiver exclusively.
        self.slots[usize::from(taking.slot.get())].with(|place| unsafe { &*place })
    }
}
