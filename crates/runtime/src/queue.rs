//! The lock-free part of a queue: what several senders put in and several receivers take out.
//!
//! A queue has a ring for each sender and each priority that it uses, so senders never meet: one that stands still in the middle of
//! a message keeps nobody else's. Receivers meet at the front of a ring, where one exchange decides who has the message; the others
//! look on. Each receiver has a slot of its own in each ring, so what it has taken is its own for as long as it likes.
//!
//! ```text
//!   sender a ──► ring ──┐   look at all fronts     ┌──► receiver 1, its slots
//!   sender b ──► ring ──┼── first by priority, ────┼──► receiver 2
//!   sender c ──► ring ──┘   stamp, sender          └──► receiver 3
//!                  │                                         │
//!                  └── call the highest who waits ◄── wait ──┘
//! ```
//!
//! Places for senders and receivers are numbered and given out by the control side. Whoever leaves gives its place back when its
//! end is dropped; one that cannot leave, because its step does not return, is closed: it puts nothing in and takes nothing out.

mod calls;
mod ring;

use std::cell::Cell;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use types::Priority;

use crate::door::{Door, bit_of};
use crate::ring::Pushed;
use crate::sync::{AtomicU64, Ordering};

use calls::Calls;
pub(crate) use calls::SEATS;
pub(crate) use ring::Key;
use ring::{Filling, Front, Ring, Taking};

/// The most rings of a queue: one for each sender and each priority that it uses. All fronts are looked at for each message.
pub(crate) const RINGS: usize = if cfg!(loom) { 4 } else { 64 };
/// The most messages of one sender and one priority: slots are numbered in sixteen bits, and each receiver has one.
pub(crate) const MOST_IN_QUEUE: usize = (1 << 16) - 2 - SEATS;

/// What the ends of a queue share.
pub(crate) struct Shared<P> {
    depth: usize,
    displaces: bool,
    /// Made in order, when the first sender needs them, and kept.
    rings: Box<[OnceLock<Ring<P>>]>,
    calls: Calls,
    /// A bit for each receiver that takes nothing any more.
    closed: AtomicU64,
    /// The executor and the slot of each receiver.
    targets: Box<[AtomicU64]>,
    /// The doors of all executors.
    doors: Vec<Arc<Door>>,
    /// Of the control side, and of threads that have lost their priority.
    free: Mutex<Free>,
}

/// Places that nobody has.
struct Free {
    seats: Vec<Seat>,
    /// The number of a ring, and how far it is filled.
    rings: Vec<(usize, Filling)>,
}

struct Seat {
    number: u32,
    ends: Box<[Taking]>,
}

/// Somebody who is to be told that a message waits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Called<'a> {
    pub executor: u32,
    pub slot: u32,
    pub door: &'a Arc<Door>,
}

impl Called<'_> {
    /// Tells it.
    pub(crate) fn ring(self) {
        self.door.ring(bit_of(self.slot));
    }
}

/// The end of one sender: a ring for each of its priorities, the most urgent first.
pub(crate) struct Sender<P> {
    shared: Arc<Shared<P>>,
    lanes: Vec<(Priority, usize, Filling)>,
}

/// The end of one receiver.
pub(crate) struct Receiver<P> {
    shared: Arc<Shared<P>>,
    seat: Option<Seat>,
    number: u32,
    /// The ring from which it took last.
    last: Cell<usize>,
    /// Whether it has asked for a message in this step: one that does not is not called for ever.
    asks: Cell<bool>,
}

/// A message that was seen at the front of a ring, and may be taken by somebody else meanwhile.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seen {
    ring: usize,
    front: Front,
}

impl Seen {
    /// What decides when it is to be taken.
    pub(crate) fn key(&self) -> Key {
        self.front.key
    }
}

impl<P: Default + Send> Shared<P> {
    /// A queue in which `depth` messages of each sender and priority wait at most.
    pub(crate) fn new(depth: usize, displaces: bool, doors: Vec<Arc<Door>>) -> Arc<Shared<P>> {
        let depth = depth.clamp(1, MOST_IN_QUEUE);
        let seat = |number: usize| Seat {
            number: number as u32,
            ends: (0..RINGS).map(|_| Taking::new((depth + 1 + number) as u16)).collect(),
        };
        Arc::new(Shared {
            depth,
            displaces,
            rings: (0..RINGS).map(|_| OnceLock::new()).collect(),
            calls: Calls::new(),
            closed: AtomicU64::new(0),
            targets: (0..SEATS).map(|_| AtomicU64::new(0)).collect(),
            doors,
            // The first are taken from the end.
            free: Mutex::new(Free { seats: (0..SEATS).rev().map(seat).collect(), rings: Vec::new() }),
        })
    }

    /// An end for a sender with these priorities; nothing where there are rings for no more.
    pub(crate) fn sender(self: &Arc<Self>, priorities: &[Priority]) -> Option<Sender<P>> {
        let mut free = self.free();
        // One in which something is left of another sender would let that go first, however urgent the new one's messages are: it is
        // given only where there is no other.
        let made = self.rings().count();
        let empty = free.rings.iter().filter(|(number, _)| self.ring(*number).waiting() == 0).count();
        let missing = priorities.len().saturating_sub(empty).min(RINGS - made);
        if free.rings.len() + missing < priorities.len() {
            return None;
        }
        for number in made..made + missing {
            let _ = self.rings[number].set(Ring::new(self.depth, SEATS));
            free.rings.push((number, Filling::new(self.depth as u16)));
        }
        // Then the lowest number first: so the same changes give the same rings.
        free.rings.sort_by_cached_key(|(number, _)| (self.ring(*number).waiting() > 0, *number));
        let rings: Vec<(usize, Filling)> = free.rings.drain(..priorities.len()).collect();
        for (number, _) in &rings {
            self.ring(*number).open();
        }
        let lanes =
            priorities.iter().zip(rings).map(|(priority, (ring, filling))| (*priority, ring, filling));
        Some(Sender { shared: self.clone(), lanes: lanes.collect() })
    }

    /// An end for the receiver in this slot of this executor; nothing where there are places for no more.
    pub(crate) fn receiver(self: &Arc<Self>, executor: u32, slot: u32) -> Option<Receiver<P>> {
        let seat = self.free().seats.pop()?;
        let number = seat.number;
        // Whoever was here before waits no more.
        self.calls.stop_waiting(number);
        self.targets[number as usize].store(u64::from(executor) << 32 | u64::from(slot), Ordering::Relaxed);
        self.closed.fetch_and(!(1 << number), Ordering::Relaxed);
        Some(Receiver {
            shared: self.clone(),
            seat: Some(seat),
            number,
            last: Cell::new(0),
            asks: Cell::new(false),
        })
    }
}

impl<P> Shared<P> {
    fn free(&self) -> std::sync::MutexGuard<'_, Free> {
        self.free.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn ring(&self, number: usize) -> &Ring<P> {
        match self.rings[number].get() {
            Some(ring) => ring,
            None => unreachable!("a number is given out with its ring"),
        }
    }

    fn rings(&self) -> impl Iterator<Item = &Ring<P>> {
        self.rings.iter().map_while(OnceLock::get)
    }

    /// Says who is served first: a lower rank before a higher one.
    pub(crate) fn set_rank(&self, seat: u32, rank: u32) {
        self.calls.set_rank(seat, rank);
    }

    /// From now on this receiver takes nothing, wherever it is. Others are to be called again after this.
    pub(crate) fn close_receiver(&self, seat: u32) {
        self.closed.fetch_or(1 << seat, Ordering::Relaxed);
        self.calls.close(seat);
    }

    /// From now on what anybody sends into it is dropped, but for messages that are just being sent.
    pub(crate) fn close(&self) {
        self.rings().for_each(Ring::close);
    }

    /// From now on what this sender sends into these rings is dropped, but for a message that it is just sending.
    pub(crate) fn close_rings(&self, rings: &[usize]) {
        rings.iter().for_each(|number| self.ring(*number).close());
    }

    /// How many messages wait.
    pub(crate) fn waiting(&self) -> usize {
        self.rings().map(Ring::waiting).sum()
    }

    fn called(&self, seat: u32) -> Option<Called<'_>> {
        let target = self.targets[seat as usize].load(Ordering::Relaxed);
        let (executor, slot) = ((target >> 32) as u32, target as u32);
        Some(Called { executor, slot, door: self.doors.get(executor as usize)? })
    }

    /// For the control side, when somebody was called who does not come: calls others for what waits.
    pub(crate) fn call_again(&self) {
        self.calls.look();
        for _ in 0..self.waiting() {
            let Some(called) = self.calls.call(false).and_then(|seat| self.called(seat)) else { return };
            called.ring();
        }
    }
}

impl<P> Sender<P> {
    /// The numbers of its rings.
    pub(crate) fn rings(&self) -> Vec<usize> {
        self.lanes.iter().map(|(_, ring, _)| *ring).collect()
    }

    /// Whether a message of any of its priorities can be sent without displacing another.
    pub(crate) fn has_room(&self) -> bool {
        self.lanes.iter().all(|(_, ring, filling)| self.shared.ring(*ring).has_room(filling))
    }

    /// Fills the next message in place and sends it, as the ring behind a wire does. Where it was stored, whoever is to be told is
    /// given to `tell`.
    #[inline]
    pub(crate) fn push(
        &mut self,
        priority: Priority,
        key: Key,
        fill: impl FnOnce(&mut P),
        tell: impl FnOnce(Called<'_>),
    ) -> Pushed {
        let at = self.lanes.iter().position(|(lane, _, _)| *lane <= priority);
        let at = at.unwrap_or(self.lanes.len().saturating_sub(1));
        let Some((_, ring, filling)) = self.lanes.get_mut(at) else { return Pushed::Full };
        let pushed = self.shared.ring(*ring).push(filling, self.shared.displaces, key, fill);
        if pushed != Pushed::Full
            && let Some(called) = self.shared.calls.call(true).and_then(|seat| self.shared.called(seat))
        {
            tell(called);
        }
        pushed
    }
}

impl<P> Drop for Sender<P> {
    fn drop(&mut self) {
        // What waits in them is served still; the next sender goes on behind it.
        let mut free = self.shared.free();
        free.rings.extend(self.lanes.drain(..).map(|(_, ring, filling)| (ring, filling)));
    }
}

impl<P> Receiver<P> {
    /// Its place.
    pub(crate) fn number(&self) -> u32 {
        self.number
    }

    fn ends(&self) -> &[Taking] {
        self.seat.as_ref().map_or(&[], |seat| &seat.ends)
    }

    fn is_closed(&self) -> bool {
        self.shared.closed.load(Ordering::Relaxed) & 1 << self.number != 0
    }

    /// Whether a message waits.
    #[inline]
    pub(crate) fn has_message(&self) -> bool {
        !self.is_closed() && self.shared.rings().zip(self.ends()).any(|(ring, end)| ring.front(end).is_some())
    }

    /// The message that is next, of those that wait.
    #[inline]
    pub(crate) fn peek(&self) -> Option<Seen> {
        self.asks.set(true);
        if self.is_closed() {
            return None;
        }
        let mut best: Option<Seen> = None;
        for (number, (ring, end)) in self.shared.rings().zip(self.ends()).enumerate() {
            if let Some(front) = ring.front(end)
                && best.is_none_or(|best| front.key < best.front.key)
            {
                best = Some(Seen { ring: number, front });
            }
        }
        best
    }

    /// Takes a message that was seen into this end's slot, where [`current`](Self::current) reads it. False when somebody else
    /// has it.
    #[inline]
    pub(crate) fn take(&mut self, seen: &Seen) -> bool {
        let taken = self.shared.ring(seen.ring).take(&self.ends()[seen.ring], &seen.front);
        if taken {
            self.last.set(seen.ring);
        }
        taken
    }

    /// Takes the message that is next. Says whether there was one.
    #[inline]
    pub(crate) fn advance(&mut self) -> bool {
        while let Some(seen) = self.peek() {
            if self.take(&seen) {
                return true;
            }
        }
        false
    }

    /// The message that was taken last.
    #[inline]
    pub(crate) fn current(&self) -> &P {
        let last = self.last.get();
        self.shared.ring(last).slot_of(&self.ends()[last])
    }

    /// A step begins: whoever looks for somebody who waits passes it over.
    #[inline]
    pub(crate) fn begin_step(&self) {
        self.asks.set(false);
        self.shared.calls.stop_waiting(self.number);
    }

    /// Whether it has asked for a message in this step.
    pub(crate) fn asks(&self) -> bool {
        self.asks.get()
    }

    /// It has done what there was, and waits. False when there is a message: then it is to look for it at once. One that was closed
    /// does not wait; if it was called just before, the call goes on to whom `tell` is given.
    pub(crate) fn wait(&self, tell: impl FnOnce(Called<'_>)) -> bool {
        if self.is_closed() {
            return true;
        }
        if self.has_message() {
            return false;
        }
        self.shared.calls.wait(self.number);
        if self.is_closed() {
            self.withdraw().map(tell);
            return true;
        }
        // A message that came before that was seen by nobody who could call.
        if self.has_message() {
            self.shared.calls.stop_waiting(self.number);
            return false;
        }
        true
    }

    /// It leaves what waits to others, and is called only for what comes later and when nobody else waits.
    pub(crate) fn leave_to_others(&self) -> Option<Called<'_>> {
        if self.is_closed() {
            return None;
        }
        self.shared.calls.withdraw(self.number);
        self.shared.calls.pass(self.number);
        self.call_another()
    }

    /// It takes nothing for some time, or never again. Gives who is to be told instead.
    pub(crate) fn withdraw(&self) -> Option<Called<'_>> {
        self.shared.calls.withdraw(self.number);
        self.call_another()
    }

    fn call_another(&self) -> Option<Called<'_>> {
        // Asked of the rings themselves: whether this end is closed does not matter to the others.
        let any = self.shared.rings().zip(self.ends()).any(|(ring, end)| ring.front(end).is_some());
        any.then(|| self.shared.calls.call(false)).flatten().and_then(|seat| self.shared.called(seat))
    }
}

impl<P> Drop for Receiver<P> {
    fn drop(&mut self) {
        let mut free = self.shared.free();
        free.seats.extend(self.seat.take());
        // The lowest number is given out next.
        free.seats.sort_unstable_by_key(|seat| core::cmp::Reverse(seat.number));
    }
}

#[cfg(test)]
mod tests;
