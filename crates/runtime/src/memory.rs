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

struct Content<T: Message> {
    header: Header,
    head: T,
    row: Box<[T::Element]>,
    len: usize,
}

struct Slot<T: Message> {
    state: AtomicU64,
    content: UnsafeCell<Content<T>>,
}

pub(crate) struct Shared<T: Message> {
    slots: Box<[Slot<T>]>,
    /// The last published, as sequence and slot, at place `sequence % (history + 1)`.
    recent: Box<[AtomicU64]>,
    /// How many were published.
    published: AtomicU64,
}

// SAFETY: the content of a slot is written only by the one writer while its state is unreadable, and read only under a pin.
unsafe impl<T: Message> Sync for Shared<T> {}
// SAFETY: messages are plain data.
unsafe impl<T: Message> Send for Shared<T> {}

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
    shared: Arc<Shared<T>>,
    /// Slots that left the history, or were never used, the oldest first.
    waiting: std::collections::VecDeque<u32>,
    history: std::collections::VecDeque<u32>,
    next: u64,
}

/// A reader's place.
pub(crate) struct Seat<T: Message> {
    shared: Arc<Shared<T>>,
    held: Arc<core::sync::atomic::AtomicU32>,
}

/// A slot that is being read.
pub(crate) struct Pin<'a, T: Message> {
    shared: &'a Shared<T>,
    held: &'a core::sync::atomic::AtomicU32,
    slot: u32,
}

/// Makes a memory.
pub(crate) fn memory<T: Message>(form: Form) -> Writer<T> {
    let history = form.history.max(1);
    let n = history + form.seats * HELD_BY_A_SEAT + 1;
    let slots = (0..n)
        .map(|_| Slot {
            state: AtomicU64::new(UNREADABLE),
            content: UnsafeCell::new(Content {
                header: Header::default(),
                head: T::default(),
                row: vec![T::Element::default(); form.rows].into_boxed_slice(),
                len: 0,
            }),
        })
        .collect();
    let recent = (0..=history).map(|_| AtomicU64::new(UNREADABLE)).collect();
    let shared = Arc::new(Shared { slots, recent, published: AtomicU64::new(0) });
    let mut waiting = std::collections::VecDeque::with_capacity(n);
    waiting.extend(0..n as u32);
    Writer { shared, waiting, history: std::collections::VecDeque::with_capacity(history + 1), next: 0 }
}

/// A slot that is being filled.
pub(crate) struct Loan<'a, T: Message> {
    writer: &'a mut Writer<T>,
    slot: u32,
    done: bool,
}

impl<T: Message> Writer<T> {
    /// How many messages stay to be looked up.
    pub(crate) fn history(&self) -> usize {
        self.shared.history()
    }

    /// How many readers can be seated.
    pub(crate) fn seats(&self) -> usize {
        (self.shared.slots.len() - 1 - self.history()) / HELD_BY_A_SEAT
    }

    pub(crate) fn shared(&self) -> Arc<Shared<T>> {
        self.shared.clone()
    }

    /// Takes a slot to fill. It fails only when readers hold more than their seats allow, which they cannot.
    pub(crate) fn loan(&mut self) -> Option<Loan<'_, T>> {
        for _ in 0..self.waiting.len() {
            let slot = self.waiting.pop_front()?;
            let state = &self.shared.slots[slot as usize].state;
            let seen = state.load(Ordering::Relaxed);
            // Acquire pairs with the release in `Pin::drop`: the last reader has done reading.
            let free = seen == UNREADABLE
                || (seen & PINS == 0
                    && state
                        .compare_exchange(
                            seen,
                            UNREADABLE,
                            named("memory: take back", Ordering::Acquire),
                            Ordering::Relaxed,
                        )
                        .is_ok());
            if free {
                return Some(Loan { writer: self, slot, done: false });
            }
            self.waiting.push_back(slot);
        }
        None
    }
}

impl<T: Message> Loan<'_, T> {
    /// The parts to fill: the head, and the whole room for the row.
    pub(crate) fn parts(&mut self) -> (&mut T, &mut [T::Element]) {
        self.writer.shared.slots[self.slot as usize].content.with_mut(|content| {
            // SAFETY: the slot is unreadable and this writer is the only one; the loan is borrowed exclusively.
            let content = unsafe { &mut *content };
            (&mut content.head, &mut content.row[..])
        })
    }

    /// Publishes the slot with `len` elements of its row in use.
    pub(crate) fn publish(mut self, header: Header, len: usize) -> Link {
        self.done = true;
        let (slot, writer) = (self.slot, &mut *self.writer);
        let sequence = writer.next;
        writer.next += 1;
        writer.shared.slots[slot as usize].content.with_mut(|content| {
            // SAFETY: as in `parts`.
            let content = unsafe { &mut *content };
            content.header = header;
            content.len = len.min(content.row.len());
        });
        // Pairs with the acquire in `Shared::pin`: who pins this sequence sees the content.
        writer.shared.slots[slot as usize]
            .state
            .store(sequence << SEQUENCE_SHIFT, named("memory: publish", Ordering::Release));
        let place = (sequence % writer.shared.recent.len() as u64) as usize;
        writer.shared.recent[place].store(sequence << 24 | u64::from(slot), Ordering::Relaxed);
        // Pairs with the acquire in `Seat::at`: who sees the number finds the link.
        writer.shared.published.store(writer.next, named("memory: publish count", Ordering::Release));
        writer.history.push_back(slot);
        if writer.history.len() > writer.shared.history()
            && let Some(old) = writer.history.pop_front()
        {
            writer.waiting.push_back(old);
        }
        Link { sequence, slot }
    }
}

impl<T: Message> Drop for Loan<'_, T> {
    fn drop(&mut self) {
        if !self.done {
            // The slot is still unreadable, which is what a free one looks like to the writer.
            self.writer.waiting.push_front(self.slot);
        }
    }
}

impl<T: Message> Shared<T> {
    /// Pins the slot if it still holds that message.
    fn pin(&self, link: Link) -> bool {
        let state = &self.slots[link.slot as usize].state;
        let mut seen = state.load(Ordering::Relaxed);
        loop {
            if seen == UNREADABLE || seen >> SEQUENCE_SHIFT != link.sequence || seen & PINS == PINS - 1 {
                return false;
            }
            // Acquire pairs with the release in `Loan::publish`; a writer that takes the slot makes the exchange fail.
            match state.compare_exchange(
                seen,
                seen + 1,
                named("memory: pin", Ordering::Acquire),
                Ordering::Relaxed,
            ) {
                Ok(_) => return true,
                Err(now) => seen = now,
            }
        }
    }

    fn unpin(&self, slot: u32) {
        // Pairs with the acquire in `Writer::loan`.
        self.slots[slot as usize].state.fetch_sub(1, named("memory: unpin", Ordering::Release));
    }

    /// How many messages are kept. There is a link more: that of a new message comes before it is counted, and takes none of theirs.
    fn history(&self) -> usize {
        self.recent.len() - 1
    }

    /// The link to the message with this sequence, if it is still in the history.
    fn recent(&self, sequence: u64) -> Option<Link> {
        let place = (sequence % self.recent.len() as u64) as usize;
        // Who pins what it leads to sees the content.
        let seen = self.recent[place].load(Ordering::Relaxed);
        (seen != UNREADABLE && seen >> 24 == sequence & (u64::MAX >> 24))
            .then_some(Link { sequence, slot: (seen & 0xff_ffff) as u32 })
    }
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
    pub(crate) fn new(shared: Arc<Shared<T>>) -> Seat<T> {
        Seat { shared, held: Arc::default() }
    }

    /// Reads the message that a link points to; nothing if it has left the memory, or if this seat holds all it may.
    pub(crate) fn pin(&self, link: Link) -> Option<Pin<'_, T>> {
        let held = self.held.load(core::sync::atomic::Ordering::Relaxed);
        if held as usize >= HELD_BY_A_SEAT || !self.shared.pin(link) {
            return None;
        }
        self.held.store(held + 1, core::sync::atomic::Ordering::Relaxed);
        Some(Pin { shared: &self.shared, held: &self.held, slot: link.slot })
    }

    fn copy(&self, sequence: u64) -> Option<(T, Time)> {
        let pin = self.pin(self.shared.recent(sequence)?)?;
        Some((*pin.head(), pin.header().stamp))
    }

    /// The value at a time: between two messages or beyond the last where the type says how, else the nearest message.
    pub(crate) fn at(&self, time: Time) -> Option<Found<T>> {
        /// A writer that is quicker than this many looks leaves nothing to find.
        const LOOKS: usize = 16;
        (0..LOOKS).find_map(|_| {
            // Pairs with the release in `Loan::publish`: what was counted is found.
            let end = self.shared.published.load(named("memory: find count", Ordering::Acquire));
            if end == 0 { Some(None) } else { self.look(time, end).map(Some) }
        })?
    }

    /// The same among the first `end` messages; nothing when the writer has taken back even the last of them meanwhile.
    fn look(&self, time: Time, end: u64) -> Option<Found<T>> {
        let mut later: Option<(T, Time)> = None;
        let mut sequence = end;
        while sequence > end.saturating_sub(self.shared.history() as u64) {
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
    fn content(&self) -> &Content<T> {
        // SAFETY: the slot is pinned, so the writer leaves it alone.
        self.shared.slots[self.slot as usize].content.with(|content| unsafe { &*content })
    }

    pub(crate) fn header(&self) -> &Header {
        &self.content().header
    }

    pub(crate) fn head(&self) -> &T {
        &self.content().head
    }

    pub(crate) fn row(&self) -> &[T::Element] {
        let content = self.content();
        &content.row[..content.len]
    }
}

impl<T: Message> Drop for Pin<'_, T> {
    fn drop(&mut self) {
        self.shared.unpin(self.slot);
        let held = self.held.load(core::sync::atomic::Ordering::Relaxed);
        self.held.store(held.saturating_sub(1), core::sync::atomic::Ordering::Relaxed);
    }
}

#[cfg(test)]
#[cfg(not(loom))]
mod tests {
    use super::*;
    use types::messages::{Image, Odometry, Twist};
    use types::{Duration, Pose};

    fn publish<T: Message>(writer: &mut Writer<T>, head: T, at: Time, row: &[T::Element]) -> Link {
        let mut loan = writer.loan().unwrap();
        let (place, room) = loan.parts();
        *place = head;
        room[..row.len()].copy_from_slice(row);
        loan.publish(Header { stamp: at, ..Header::default() }, row.len())
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
            drop(writer.loan().unwrap());
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
        loan.publish(Header { stamp: Time(i), ..Header::default() }, 0);
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
            let link = writer.shared.recent(0).expect("it was published");
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
                    if let Some(link) = seat.shared.recent(sequence)
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
