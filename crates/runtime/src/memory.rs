//! Short-term memory: a named ring of timestamped slots with one writer and many readers.
//!
//! A slot is free, being written, or published. A published slot can be pinned by readers; the writer takes only slots that
//! nobody pins. A memory of history `h` for `r` seats that each hold at most `q` slots has `h + r·q + 1` of them, so the writer
//! always finds one, and a reader that is stuck keeps only what was set aside for it:
//!
//! ```text
//!   FREE ──loan──► WRITING ──publish──► PUBLISHED(sequence, pins) ──leaves the history, pins = 0──► FREE
//!                     └──── dropped loan ────► FREE
//! ```

#![allow(unsafe_code)]

use std::sync::Arc;

use crate::sync::{AtomicU64, Ordering, UnsafeCell, named};
use types::{Header, Message, Time};

/// Pins are counted in the low bits of a slot's state, the sequence stands above them.
const PINS: u64 = 0xffff;
const SEQUENCE_SHIFT: u32 = 16;
/// The state of a slot that no reader may pin.
const UNREADABLE: u64 = u64::MAX;

/// What a reader looks at stands first: with the state it lies in one line of memory where the head is small.
#[repr(C)]
struct Content<T: Message> {
    len: usize,
    row: Box<[T::Element]>,
    head: T,
    header: Header,
}

#[repr(C, align(64))]
struct Slot<T: Message> {
    state: AtomicU64,
    content: UnsafeCell<Content<T>>,
}

// SAFETY: the content of a slot is written only by the one writer while its state is unreadable, and read only under a pin.
unsafe impl<T: Message> Sync for Slot<T> {}
// SAFETY: messages are plain data.
unsafe impl<T: Message> Send for Slot<T> {}

impl<T: Message> Slot<T> {
    /// Takes it back from its readers, where none has pinned it.
    #[inline]
    fn take_back(&self) -> bool {
        let seen = self.state.load(Ordering::Relaxed);
        // Acquire pairs with the release in `Pin::drop`: the last reader has done reading.
        let ordering = named("memory: take back", Ordering::Acquire);
        seen == UNREADABLE
            || seen & PINS == 0
                && self.state.compare_exchange(seen, UNREADABLE, ordering, Ordering::Relaxed).is_ok()
    }

    /// Pins it if it still holds the message with that sequence.
    #[inline]
    fn pin(&self, sequence: u64) -> bool {
        let mut seen = self.state.load(Ordering::Relaxed);
        loop {
            if seen == UNREADABLE || seen >> SEQUENCE_SHIFT != sequence || seen & PINS == PINS - 1 {
                return false;
            }
            // Acquire pairs with the release in `Loan::publish`; a writer that takes the slot makes the exchange fail.
            let ordering = named("memory: pin", Ordering::Acquire);
            match self.state.compare_exchange(seen, seen + 1, ordering, Ordering::Relaxed) {
                Ok(_) => return true,
                Err(now) => seen = now,
            }
        }
    }

    #[inline]
    fn unpin(&self) {
        // Pairs with the acquire in `Slot::take_back`.
        self.state.fetch_sub(1, named("memory: unpin", Ordering::Release));
    }
}

/// What the writer and its readers have in common.
pub(crate) struct Shared<T: Message> {
    slots: Arc<[Slot<T>]>,
    recent: Arc<Recent>,
}

impl<T: Message> Clone for Shared<T> {
    fn clone(&self) -> Shared<T> {
        Shared { slots: self.slots.clone(), recent: self.recent.clone() }
    }
}

/// What was published last. Readers look here only for a message of some time: a link says where its message is.
struct Recent {
    /// How many were published.
    published: AtomicU64,
    /// The last published, as sequence and slot, at place `sequence % (history + 1)`.
    links: Box<[AtomicU64]>,
}

impl Recent {
    /// How many messages are kept. There is a link more: that of a new message comes before it is counted, and takes none of theirs.
    #[inline]
    fn history(&self) -> usize {
        self.links.len() - 1
    }

    /// The link to the message with this sequence, if it is still in the history.
    fn link(&self, sequence: u64) -> Option<Link> {
        let place = (sequence % self.links.len() as u64) as usize;
        // Who pins what it leads to sees the content.
        let seen = self.links[place].load(Ordering::Relaxed);
        (seen != UNREADABLE && seen >> 24 == sequence & (u64::MAX >> 24))
            .then_some(Link { sequence, slot: (seen & 0xff_ffff) as u32 })
    }
}

/// A link to a slot: what is sent in place of a large message.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Link {
    sequence: u64,
    slot: u32,
}

/// How much a memory holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Form {
    /// How many messages stay to be looked up.
    pub history: usize,
    /// How many readers can be seated.
    pub seats: usize,
    /// The greatest length of the row behind a message.
    pub rows: usize,
}

/// How many slots one reader can hold at once.
pub(crate) const HELD_BY_A_SEAT: usize = 2;

/// The writing end.
pub(crate) struct Writer<T: Message> {
    shared: Shared<T>,
    order: Order,
}

/// Where the writer is.
struct Order {
    /// All slots, in a circle. From the front on those that left the history, or were never used, the oldest first; behind them the
    /// history, whose newest lies before the front. So the slot at the front is published where it is.
    slots: Box<[u32]>,
    front: usize,
    /// The sequence of the next message, and the place of its link.
    next: u64,
    place: usize,
}

/// A reader's place.
pub(crate) struct Seat<T: Message> {
    shared: Shared<T>,
    held: core::sync::atomic::AtomicU32,
}

/// A slot that is being read.
pub(crate) struct Pin<'a, T: Message> {
    slot: &'a Slot<T>,
    held: &'a core::sync::atomic::AtomicU32,
}

/// Makes a memory.
pub(crate) fn memory<T: Message>(form: Form) -> Writer<T> {
    let history = form.history.max(1);
    let n = history + form.seats * HELD_BY_A_SEAT + 1;
    let slots = (0..n)
        .map(|_| Slot {
            state: AtomicU64::new(UNREADABLE),
            content: UnsafeCell::new(Content {
                len: 0,
                row: vec![T::Element::default(); form.rows].into_boxed_slice(),
                head: T::default(),
                header: Header::default(),
            }),
        })
        .collect();
    let links = (0..=history).map(|_| AtomicU64::new(UNREADABLE)).collect();
    let recent = Arc::new(Recent { published: AtomicU64::new(0), links });
    let order = Order { slots: (0..n as u32).collect(), front: 0, next: 0, place: 0 };
    Writer { shared: Shared { slots, recent }, order }
}

/// A slot that is being filled: the one at the front. One that is dropped instead of being published stays unreadable, which is what
/// a free one looks like to the writer.
pub(crate) struct Loan<'a, T: Message> {
    recent: &'a Recent,
    order: &'a mut Order,
    slot: &'a Slot<T>,
    number: u32,
}

impl<T: Message> Writer<T> {
    /// How many messages stay to be looked up.
    pub(crate) fn history(&self) -> usize {
        self.shared.recent.history()
    }

    /// How many readers can be seated.
    pub(crate) fn seats(&self) -> usize {
        (self.shared.slots.len() - 1 - self.history()) / HELD_BY_A_SEAT
    }

    pub(crate) fn shared(&self) -> Shared<T> {
        self.shared.clone()
    }

    /// Takes a slot to fill. It fails only when readers hold more than their seats allow, which they cannot.
    #[inline(always)]
    pub(crate) fn loan(&mut self) -> Option<Loan<'_, T>> {
        let Writer { shared: Shared { slots, recent }, order } = self;
        let mut number = order.slots[order.front];
        let mut slot = &slots[number as usize];
        if !slot.take_back() {
            number = order.pass_over(recent.history(), |slot| slots[slot as usize].take_back())?;
            slot = &slots[number as usize];
        }
        Some(Loan { recent, order, slot, number })
    }
}

impl Order {
    /// Brings the next slot that can be taken to the front, where the one there is being read: that and others that are go behind all
    /// that wait.
    #[cold]
    fn pass_over(&mut self, history: usize, take: impl Fn(u32) -> bool) -> Option<u32> {
        let waiting = self.slots.len() - history.min(self.next as usize);
        let pinned = (1..waiting).find(|i| take(self.slots[self.at(*i)]))?;
        for (from, to) in [(0, pinned), (pinned, waiting), (0, waiting)] {
            self.turn(from, to);
        }
        Some(self.slots[self.front])
    }

    /// A place, counted from the front.
    fn at(&self, i: usize) -> usize {
        (self.front + i) % self.slots.len()
    }

    /// Turns a part of it round.
    fn turn(&mut self, mut from: usize, mut to: usize) {
        while from + 1 < to {
            to -= 1;
            self.slots.swap(self.at(from), self.at(to));
            from += 1;
        }
    }
}

impl<T: Message> Loan<'_, T> {
    /// The parts to fill: the head, and the whole room for the row.
    #[inline(always)]
    pub(crate) fn parts(&mut self) -> (&mut T, &mut [T::Element]) {
        self.slot.content.with_mut(|content| {
            // SAFETY: the slot is unreadable and this writer is the only one; the loan is borrowed exclusively.
            let content = unsafe { &mut *content };
            (&mut content.head, &mut content.row[..])
        })
    }

    /// Publishes the slot with `len` elements of its row in use, and with the header that `fill` puts there.
    #[inline(always)]
    pub(crate) fn publish(self, len: usize, fill: impl FnOnce(&mut Header)) -> Link {
        let Loan { recent, order, slot, number } = self;
        let sequence = order.next;
        slot.content.with_mut(|content| {
            // SAFETY: as in `parts`.
            let content = unsafe { &mut *content };
            fill(&mut content.header);
            content.len = len.min(content.row.len());
        });
        // Pairs with the acquire in `Slot::pin`: who pins this sequence sees the content.
        slot.state.store(sequence << SEQUENCE_SHIFT, named("memory: publish", Ordering::Release));
        recent.links[order.place].store(sequence << 24 | u64::from(number), Ordering::Relaxed);
        // Pairs with the acquire in `Seat::at`: who sees the number finds the link.
        recent.published.store(sequence + 1, named("memory: publish count", Ordering::Release));
        order.next = sequence + 1;
        order.place = behind(order.place, recent.links.len());
        order.front = behind(order.front, order.slots.len());
        Link { sequence, slot: number }
    }
}

/// The next place in a circle of so many.
#[inline]
fn behind(place: usize, len: usize) -> usize {
    if place + 1 == len { 0 } else { place + 1 }
}

/// What a look-up by time found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Found<T> {
    /// A message of exactly that time, or the nearest where the type says neither between nor beyond.
    Nearest(T, Time),
    /// Between two messages.
    Between(T),
    /// Beyond the last, predicted.
    Beyond(T),
}

impl<T> Found<T> {
    /// The value, however it was found.
    pub fn value(self) -> T {
        match self {
            Found::Nearest(value, _) | Found::Between(value) | Found::Beyond(value) => value,
        }
    }
}

impl<T: Message> Seat<T> {
    pub(crate) fn new(shared: Shared<T>) -> Seat<T> {
        Seat { shared, held: Default::default() }
    }

    /// Reads the message that a link points to; nothing if it has left the memory, or if this seat holds all it may.
    #[inline]
    pub(crate) fn pin(&self, link: Link) -> Option<Pin<'_, T>> {
        let held = self.held.load(core::sync::atomic::Ordering::Relaxed);
        let slot = self.shared.slots.get(link.slot as usize)?;
        if held as usize >= HELD_BY_A_SEAT || !slot.pin(link.sequence) {
            return None;
        }
        self.held.store(held + 1, core::sync::atomic::Ordering::Relaxed);
        Some(Pin { slot, held: &self.held })
    }

    fn copy(&self, sequence: u64) -> Option<(T, Time)> {
        let pin = self.pin(self.shared.recent.link(sequence)?)?;
        Some((*pin.head(), pin.header().stamp))
    }

    /// The value at a time: between two messages or beyond the last where the type says how, else the nearest message.
    pub(crate) fn at(&self, time: Time) -> Option<Found<T>> {
        /// A writer that is quicker than this many looks leaves nothing to find.
        const LOOKS: usize = 16;
        (0..LOOKS).find_map(|_| {
            // Pairs with the release in `Loan::publish`: what was counted is found.
            let end = self.shared.recent.published.load(named("memory: find count", Ordering::Acquire));
            if end == 0 { Some(None) } else { self.look(time, end).map(Some) }
        })?
    }

    /// The same among the first `end` messages; nothing when the writer has taken back even the last of them meanwhile.
    fn look(&self, time: Time, end: u64) -> Option<Found<T>> {
        let mut later: Option<(T, Time)> = None;
        let mut sequence = end;
        while sequence > end.saturating_sub(self.shared.recent.history() as u64) {
            sequence -= 1;
            // What the writer has taken back meanwhile, and all before it, is no longer known.
            let Some((value, stamp)) = self.copy(sequence) else { break };
            if stamp <= time {
                return Some(between((value, stamp), later, time));
            }
            later = Some((value, stamp));
        }
        later.map(|(value, stamp)| Found::Nearest(value, stamp))
    }
}

fn between<T: Message>(earlier: (T, Time), later: Option<(T, Time)>, time: Time) -> Found<T> {
    let (before, at) = earlier;
    let nearest = |later: Option<(T, Time)>| match later {
        Some((after, then)) if then - time < time - at => Found::Nearest(after, then),
        _ => Found::Nearest(before, at),
    };
    if at == time {
        return Found::Nearest(before, at);
    }
    match later {
        Some((after, then)) => {
            let ratio = (time - at).seconds() / (then - at).seconds();
            T::between(&before, &after, ratio).map_or_else(|| nearest(later), Found::Between)
        }
        None => T::beyond(&before, time - at).map_or_else(|| nearest(None), Found::Beyond),
    }
}

impl<T: Message> Pin<'_, T> {
    #[inline]
    fn content(&self) -> &Content<T> {
        // SAFETY: the slot is pinned, so the writer leaves it alone.
        self.slot.content.with(|content| unsafe { &*content })
    }

    pub(crate) fn header(&self) -> &Header {
        &self.content().header
    }

    #[inline]
    pub(crate) fn head(&self) -> &T {
        &self.content().head
    }

    #[inline]
    pub(crate) fn row(&self) -> &[T::Element] {
        let content = self.content();
        &content.row[..content.len]
    }
}

impl<T: Message> Drop for Pin<'_, T> {
    #[inline]
    fn drop(&mut self) {
        self.slot.unpin();
        let held = self.held.load(core::sync::atomic::Ordering::Relaxed);
        self.held.store(held.saturating_sub(1), core::sync::atomic::Ordering::Relaxed);
    }
}

#[cfg(test)]
#[cfg(not(loom))]
mod tests {
    use super::*;
    use std::collections::VecDeque;
    use types::messages::{Image, Odometry, Twist};
    use types::{Duration, Pose};

    fn publish<T: Message>(writer: &mut Writer<T>, head: T, at: Time, row: &[T::Element]) -> Link {
        let mut loan = writer.loan().unwrap();
        let (place, room) = loan.parts();
        *place = head;
        room[..row.len()].copy_from_slice(row);
        loan.publish(row.len(), |header| header.stamp = at)
    }

    #[test]
    fn a_reader_that_is_stuck_never_stops_the_writer() {
        let mut writer = memory::<Image>(Form { history: 2, seats: 2, rows: 4 });
        let seats = [Seat::new(writer.shared()), Seat::new(writer.shared())];
        let mut pins = Vec::new();
        for i in 0..100u8 {
            let link = publish(&mut writer, Image::default(), Time(i.into()), &[i; 4]);
            pins.extend(seats[usize::from(i) % 2].pin(link));
        }
        assert_eq!(pins.len(), 4, "two seats of two");
        let read: Vec<u8> = pins.iter().map(|pin| pin.row()[0]).collect();
        assert_eq!(read, [0, 1, 2, 3], "what is pinned stays as it was");
        drop(pins);
        let link = publish(&mut writer, Image::default(), Time(100), &[100; 4]);
        assert!(seats[0].pin(link).is_some(), "the seat is free again");
    }

    proptest::proptest! {
        /// Slots are taken as from a queue of those that wait, in which those that are being read go to the end.
        #[test]
        fn the_slot_that_waited_longest_is_taken(history in 1usize..4, seats in 0usize..4, ops in proptest::collection::vec((0u8..4, 0usize..64), 0..200)) {
            let mut writer = memory::<Twist>(Form { history, seats, rows: 0 });
            let readers: Vec<_> = (0..seats).map(|_| Seat::new(writer.shared())).collect();
            let mut waiting: VecDeque<u32> = (0..(history + 2 * seats + 1) as u32).collect();
            let (mut kept, mut links, mut pins) = (VecDeque::new(), Vec::new(), Vec::new());
            for (op, which) in ops {
                match op {
                    0 if seats > 0 && !links.is_empty() => {
                        let link: Link = links[links.len().saturating_sub(1 + which % 8)];
                        pins.extend(readers[which % seats].pin(link).map(|pin| (link.slot, pin)));
                    }
                    1 if !pins.is_empty() => drop(pins.swap_remove(which % pins.len())),
                    _ => {
                        while pins.iter().any(|(slot, _)| *slot == waiting[0]) {
                            waiting.rotate_left(1);
                        }
                        if op == 2 {
                            let _ = writer.loan();
                            continue;
                        }
                        links.push(publish(&mut writer, Twist::ZERO, Time(0), &[]));
                        proptest::prop_assert_eq!(links.last().map(|link| link.slot), waiting.pop_front());
                        kept.extend(links.last().map(|link| link.slot));
                        if kept.len() > history {
                            waiting.extend(kept.pop_front());
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn a_link_to_what_is_gone_reads_nothing() {
        let mut writer = memory::<Image>(Form { history: 1, seats: 1, rows: 1 });
        let seat = Seat::new(writer.shared());
        let old = publish(&mut writer, Image::default(), Time(0), &[1]);
        for i in 0..8 {
            publish(&mut writer, Image::default(), Time(i), &[2]);
        }
        assert!(seat.pin(old).is_none());
    }

    #[test]
    fn a_dropped_loan_gives_its_slot_back() {
        let mut writer = memory::<Twist>(Form { history: 1, seats: 0, rows: 0 });
        for _ in 0..10 {
            let _ = writer.loan().unwrap();
        }
        publish(&mut writer, Twist::ZERO, Time(0), &[]);
    }

    #[test]
    fn a_look_up_interpolates_predicts_and_falls_back_to_the_nearest() {
        let mut writer = memory::<Odometry>(Form { history: 3, seats: 1, rows: 0 });
        let seat = Seat::new(writer.shared());
        assert!(seat.at(Time::ZERO).is_none(), "nothing yet");
        for i in 0..5i64 {
            let pose = Pose::new(i as f64, 0.0, 0.0);
            let odometry = Odometry { pose, twist: Twist::new(1.0, 0.0), ..Odometry::default() };
            publish(&mut writer, odometry, Time::ZERO + Duration::secs(i), &[]);
        }
        let x = |seconds| seat.at(Time::from_seconds(seconds)).map(|found| (found, found.value().pose.x));
        assert!(matches!(x(3.25), Some((Found::Between(_), at)) if (at - 3.25).abs() < 1e-9));
        assert!(matches!(x(4.5), Some((Found::Beyond(_), at)) if (at - 4.5).abs() < 1e-9));
        assert!(matches!(x(3.0), Some((Found::Nearest(..), at)) if at == 3.0));
        assert!(
            matches!(x(0.0), Some((Found::Nearest(..), at)) if at == 2.0),
            "the oldest that is still known"
        );
    }
}

#[cfg(test)]
#[cfg(loom)]
mod model {
    use super::*;
    use crate::sync::weaken;
    use loom::thread;
    use types::messages::Twist;

    fn write(writer: &mut Writer<Twist>, i: i64) {
        let mut loan = writer.loan().expect("a slot for every loan");
        *loan.parts().0 = Twist::new(i as f64, i as f64);
        loan.publish(0, |header| header.stamp = Time(i));
    }

    fn read(pin: &Pin<'_, Twist>, sequence: u64) {
        let (twist, stamp) = (*pin.head(), pin.header().stamp);
        assert_eq!(twist.linear, twist.angular, "torn");
        assert_eq!(twist.linear, stamp.0 as f64, "another's content");
        assert_eq!(stamp.0 as u64, sequence + 1, "another message than the link meant");
    }

    /// Two readers pin while the writer goes around all four slots.
    #[test]
    fn a_pinned_slot_is_never_written() {
        let elsewhere = ["memory: pin", "memory: publish", "memory: publish count"];
        weaken::check(&elsewhere, || {
            let mut writer = memory::<Twist>(Form { history: 1, seats: 1, rows: 0 });
            write(&mut writer, 1);
            let link = writer.shared.recent.link(0).expect("it was published");
            // Half a seat for each.
            let readers = [(); 2].map(|()| {
                let seat = Seat::new(writer.shared());
                thread::spawn(move || seat.pin(link).inspect(|pin| read(pin, 0)).is_some())
            });
            (2..=5).for_each(|i| write(&mut writer, i));
            readers.into_iter().for_each(|reader| assert!(reader.join().is_ok()));
        });
    }

    /// A reader follows links to messages that come while it reads.
    #[test]
    fn a_link_leads_to_its_message_or_nowhere() {
        let elsewhere = ["memory: publish count", "memory: unpin", "memory: take back"];
        weaken::check(&elsewhere, || {
            let mut writer = memory::<Twist>(Form { history: 1, seats: 1, rows: 0 });
            let seat = Seat::new(writer.shared());
            let reader = thread::spawn(move || {
                for sequence in 0..2 {
                    if let Some(link) = seat.shared.recent.link(sequence)
                        && let Some(pin) = seat.pin(link)
                    {
                        read(&pin, sequence);
                    }
                }
            });
            (1..=3).for_each(|i| write(&mut writer, i));
            reader.join().unwrap();
        });
    }

    /// A look-up by time finds what was published last, or what stood there before it.
    #[test]
    fn a_look_up_finds_a_whole_message_while_another_is_written() {
        let elsewhere = ["memory: unpin", "memory: take back", "memory: pin", "memory: publish"];
        look_up_while_another_is_written(2, &elsewhere);
    }

    /// The same where the one that it is about to read is taken back.
    #[test]
    fn a_look_up_finds_a_message_also_where_only_the_last_is_kept() {
        let elsewhere = ["memory: unpin", "memory: pin", "memory: publish", "memory: take back"];
        look_up_while_another_is_written(1, &elsewhere);
    }

    fn look_up_while_another_is_written(history: usize, elsewhere: &[&'static str]) {
        weaken::check(elsewhere, move || {
            let mut writer = memory::<Twist>(Form { history, seats: 1, rows: 0 });
            let seat = Seat::new(writer.shared());
            write(&mut writer, 1);
            let reader = thread::spawn(move || {
                let Some(Found::Nearest(twist, stamp)) = seat.at(Time(3)) else {
                    panic!("nothing was found");
                };
                assert_eq!(twist.linear, twist.angular, "torn");
                assert_eq!(twist.linear, stamp.0 as f64, "another's content");
            });
            write(&mut writer, 2);
            reader.join().unwrap();
        });
    }
}
