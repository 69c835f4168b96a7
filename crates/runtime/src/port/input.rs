//! Where messages come in: the mailbox, and the agent's handle on it.

#![allow(unsafe_code)]

use std::any::Any;
use std::cell::UnsafeCell;
use std::sync::Arc;

use types::cdr::{NoElement, Writer};
use types::message::is_large;
use types::{Header, Message, Priority, Time};

use super::queue::{QueueEnd, QueueForm, Rest, Teller, queue_core};
use super::{
    Direction, InputEnd, OutputEnd, Parcel, Port, PortEnds, PortOptions, PortShape, Settled, WireCounts,
    WireId, count, output_core,
};
use crate::context::current;
use crate::fetch::{Depth, fetch};
use crate::memory::{Found, Link, Pin, Seat};
use crate::message_type::MessageType;
use crate::{queue, ring};

pub(super) enum Source<T: Message> {
    Value(ring::Receiver<Parcel<T>>),
    Link(ring::Receiver<Parcel<Link>>, Seat<T>),
    Queue(Box<queue::Receiver<Parcel<T>>>),
}

impl<T: Message> Source<T> {
    pub(super) fn advance(&mut self) -> bool {
        match self {
            Source::Value(receiver) => receiver.advance(),
            Source::Link(receiver, _) => receiver.advance(),
            Source::Queue(receiver) => receiver.advance(),
        }
    }

    fn has_message(&self) -> bool {
        match self {
            Source::Value(receiver) => receiver.has_message(),
            Source::Link(receiver, _) => receiver.has_message(),
            Source::Queue(receiver) => receiver.has_message(),
        }
    }

    pub(super) fn header(&self) -> &Header {
        match self {
            Source::Value(receiver) => &receiver.current().header,
            Source::Link(receiver, _) => &receiver.current().header,
            Source::Queue(receiver) => &receiver.current().header,
        }
    }
}

/// Of so many wires of an input it is fetched what the next step will touch.
const WIRES: usize = 2;

/// The receiving end of one ring of a wire.
pub(super) struct Lane<T: Message> {
    pub(super) wire: WireId,
    pub(super) source: Source<T>,
    pub(super) counts: Arc<WireCounts>,
    /// Whether the ring's front has been taken and waits to be given to the agent.
    pub(super) staged: bool,
}

/// The lanes of a new wire, with room for all that the input will then have.
pub(super) struct NewLanes<T: Message> {
    pub(super) lanes: Vec<Lane<T>>,
    pub(super) room: Vec<Lane<T>>,
}

pub(super) struct InputInner<T: Message> {
    pub(super) lanes: Vec<Lane<T>>,
    /// Whether any lane is one of a queue.
    serves: bool,
    /// The step in which something was taken last, as [`Context::took`] keeps it.
    opened: u64,
    /// The lane that gave the last message, while all are passed over for the newest.
    last: Option<usize>,
}

/// The mailbox behind an input.
pub(crate) struct InputCore<T: Message> {
    inner: UnsafeCell<InputInner<T>>,
}

// SAFETY: a mailbox is touched only by the thread that runs the executor of its agent; hand-overs of an executor between
// threads pass through release and acquire.
unsafe impl<T: Message> Sync for InputCore<T> {}
// SAFETY: messages are plain data.
unsafe impl<T: Message> Send for InputCore<T> {}

impl<T: Message> InputCore<T> {
    #[allow(clippy::mut_from_ref)]
    #[inline]
    fn inner(&self) -> &mut InputInner<T> {
        // SAFETY: see `Sync`; no reference outlives the call of a port or of the executor.
        unsafe { &mut *self.inner.get() }
    }
}

impl<T: Message> InputEnd for InputCore<T> {
    fn join(&self, lanes: &mut (dyn Any + Send)) {
        let Some(new) = lanes.downcast_mut::<NewLanes<T>>() else { return };
        let inner = self.inner();
        if inner.lanes.capacity() < inner.lanes.len() + new.lanes.len() {
            new.room.append(&mut inner.lanes);
            core::mem::swap(&mut new.room, &mut inner.lanes);
        }
        inner.lanes.append(&mut new.lanes);
        inner.count_queues();
    }

    fn is_drained(&self, wire: WireId) -> bool {
        self.inner()
            .lanes
            .iter()
            .filter(|lane| lane.wire == wire)
            // What waits in a queue waits there for others.
            .all(|lane| matches!(lane.source, Source::Queue(_)) || !lane.staged && !lane.source.has_message())
    }

    fn leave(&self, wire: WireId, into: &mut (dyn Any + Send)) {
        let Some(into) = into.downcast_mut::<Vec<Lane<T>>>() else { return };
        let lanes = &mut self.inner().lanes;
        let mut i = 0;
        while i < lanes.len() {
            if lanes[i].wire == wire && into.len() < into.capacity() {
                into.push(lanes.remove(i));
            } else {
                i += 1;
            }
        }
        self.inner().last = None;
        self.inner().count_queues();
    }

    fn leaving_box(&self) -> Box<dyn Any + Send> {
        Box::new(Vec::<Lane<T>>::with_capacity(Priority::ALL.len()))
    }

    fn has_message(&self) -> bool {
        self.inner().has_message()
    }

    fn oldest(&self) -> Option<Time> {
        self.inner().oldest()
    }

    fn settle(&self, step: u64) -> Settled {
        let inner = self.inner();
        Settled { took: inner.opened & !1 == step, left: inner.has_message() }
    }

    fn begin_step(&self) {
        let inner = self.inner();
        if inner.serves {
            inner.begin_step();
        }
    }

    fn serves(&self) -> bool {
        self.inner().serves
    }

    fn rest(&self, why: Rest, teller: &mut Teller<'_>) -> bool {
        let inner = self.inner();
        let again = inner.serves && inner.rest_at_queues(why, teller);
        let looks = matches!(why, Rest::Stepped(true) | Rest::Ready);
        again || looks && inner.lanes.iter().any(Lane::has_own_message)
    }

    fn queue(&self, form: QueueForm) -> Option<Arc<dyn QueueEnd>> {
        queue_core::<T>(form)
    }

    fn message_type(&self) -> &'static MessageType {
        MessageType::of::<T>()
    }

    fn facing(&self) -> Arc<dyn OutputEnd> {
        output_core::<T>(&PortOptions::DEFAULT, 1)
    }

    fn take_cdr(&self) -> Option<Vec<u8>> {
        let inner = self.inner();
        let lane = inner.next()?;
        let received = inner.lanes[lane].current()?;
        let mut writer = Writer::new();
        received.encode(received.row(), received.header().stamp, &mut writer);
        Some(writer.bytes().to_vec())
    }
}

/// An end where messages of type `T` come in.
///
/// Messages arrive while a step runs, never block it, and are taken in the order of priority, stamp and sender.
pub struct Input<T: Message> {
    core: Option<Arc<InputCore<T>>>,
}

impl<T: Message> Default for Input<T> {
    fn default() -> Input<T> {
        Input { core: None }
    }
}

enum Place<'a, T: Message> {
    Value(&'a T),
    Pinned(Pin<'a, T>),
}

/// A message that was taken. It is read in place.
pub struct Received<'a, T: Message> {
    header: &'a Header,
    place: Place<'a, T>,
}

impl<T: Message> Received<'_, T> {
    /// What it carries besides its payload.
    #[inline]
    pub fn header(&self) -> &Header {
        self.header
    }

    /// The row behind a large message.
    #[inline]
    pub fn row(&self) -> &[T::Element] {
        match &self.place {
            Place::Value(_) => &[],
            Place::Pinned(pin) => pin.row(),
        }
    }
}

impl<T: Message> core::ops::Deref for Received<'_, T> {
    type Target = T;
    #[inline]
    fn deref(&self) -> &T {
        match &self.place {
            Place::Value(value) => value,
            Place::Pinned(pin) => pin.head(),
        }
    }
}

impl<T: Message> Input<T> {
    /// The next message in the order of priority, stamp and sender.
    #[inline(always)]
    pub fn take(&mut self) -> Option<Received<'_, T>> {
        let core = self.core.as_ref()?;
        let inner = core.inner();
        match &mut inner.lanes[..] {
            [] => return None,
            // Most inputs have one wire with one priority.
            [lane] => match &mut lane.source {
                Source::Value(receiver) if !is_large::<T>() => {
                    let context = current();
                    if !core::mem::take(&mut lane.staged) && !receiver.advance() {
                        if let Some(context) = context {
                            context.drained(&mut inner.opened);
                        }
                        return None;
                    }
                    if let Some(context) = context {
                        context.took(&mut inner.opened);
                    }
                    count(&lane.counts.taken);
                    let parcel = receiver.current();
                    return Some(Received { header: &parcel.header, place: Place::Value(&parcel.payload) });
                }
                Source::Link(receiver, seat) if is_large::<T>() => {
                    let context = current();
                    if !core::mem::take(&mut lane.staged) && !receiver.advance() {
                        if let Some(context) = context {
                            context.drained(&mut inner.opened);
                        }
                        return None;
                    }
                    let parcel = receiver.current();
                    if let Some(pin) = seat.pin(parcel.payload) {
                        if let Some(context) = context {
                            context.took(&mut inner.opened);
                        }
                        count(&lane.counts.taken);
                        return Some(Received { header: &parcel.header, place: Place::Pinned(pin) });
                    }
                    count(&lane.counts.expired);
                }
                _ => {}
            },
            _ => {}
        }
        core.inner().take()
    }

    /// The newest message, after passing over all that came before it; nothing when none has come since the last call.
    pub fn newest(&mut self) -> Option<Received<'_, T>> {
        let inner = self.core.as_ref()?.inner();
        while let Some(lane) = inner.next() {
            inner.note_taken();
            inner.last = Some(lane);
            count(&inner.lanes[lane].counts.newest);
        }
        let lane = inner.last.take()?;
        inner.lanes[lane].read()
    }

    /// A copy of the newest message; nothing when none has come since the last call.
    pub fn latest(&mut self) -> Option<T>
    where
        T: Message<Element = NoElement>,
    {
        self.newest().map(|received| *received)
    }

    /// Whether a message waits.
    pub fn has_message(&self) -> bool {
        self.core.as_ref().is_some_and(|core| core.has_message())
    }

    pub(crate) fn set_core(&mut self, core: Option<Arc<InputCore<T>>>) {
        self.core = core;
    }

    /// Where its mailbox lies: a number to know it by.
    pub(crate) fn core_address(&self) -> Option<usize> {
        self.core.as_ref().map(|core| Arc::as_ptr(core).addr())
    }

    /// Whether any wire leads here.
    pub fn is_wired(&self) -> bool {
        self.core.as_ref().is_some_and(|core| !core.inner().lanes.is_empty())
    }

    /// The value at a time, looked up in the memory of the first output wired here that keeps one: between two messages or
    /// beyond the last where the type says how, else the nearest.
    pub fn at(&self, time: Time) -> Option<Found<T>> {
        self.core.as_ref()?.inner().lanes.iter().find_map(|lane| match &lane.source {
            Source::Link(_, seat) => {
                count(&lane.counts.looked);
                seat.at(time)
            }
            Source::Value(_) | Source::Queue(_) => None,
        })
    }
}

impl<T: Message> InputInner<T> {
    /// The next message of several lanes, or of one that leads into memory.
    #[inline(never)]
    fn take(&mut self) -> Option<Received<'_, T>> {
        loop {
            let Some(lane) = self.next() else {
                if let Some(context) = current() {
                    context.drained(&mut self.opened);
                }
                return None;
            };
            // The borrow ends here when the message is gone, and the search goes on.
            let lane: *const Lane<T> = &raw const self.lanes[lane];
            // SAFETY: lanes change only between steps; `&mut self` keeps the message from being taken twice.
            if let Some(received) = unsafe { &*lane }.current() {
                self.note_taken();
                return Some(received);
            }
        }
    }

    #[inline]
    fn has_message(&self) -> bool {
        self.lanes.iter().any(|lane| lane.staged || lane.source.has_message())
    }

    #[inline(never)]
    fn oldest(&mut self) -> Option<Time> {
        let own = self.lanes.iter_mut().filter(|lane| !matches!(lane.source, Source::Queue(_)));
        let stamps = own.filter_map(|lane| {
            lane.staged = lane.staged || lane.source.advance();
            lane.staged.then(|| lane.source.header().stamp)
        });
        stamps.min()
    }

    fn note_taken(&mut self) {
        if let Some(context) = current() {
            context.took(&mut self.opened);
        }
    }

    fn count_queues(&mut self) {
        self.serves = self.lanes.iter().any(|lane| matches!(lane.source, Source::Queue(_)));
    }

    /// The lane whose front is next, staged and marked as given.
    #[inline]
    fn next(&mut self) -> Option<usize> {
        if let [lane] = &mut self.lanes[..] {
            let given = core::mem::take(&mut lane.staged) || lane.source.advance();
            return given.then_some(0);
        }
        if self.serves {
            return self.next_with_queues();
        }
        let mut best: Option<usize> = None;
        for i in 0..self.lanes.len() {
            let lane = &mut self.lanes[i];
            lane.staged = lane.staged || lane.source.advance();
            if lane.staged
                && best.is_none_or(|best| {
                    before(self.lanes[i].source.header(), self.lanes[best].source.header())
                })
            {
                best = Some(i);
            }
        }
        self.lanes[best?].staged = false;
        best
    }
}

/// Whether a message with the header `a` is to be taken before one with the header `b`.
fn before(a: &Header, b: &Header) -> bool {
    (core::cmp::Reverse(a.priority), a.stamp, a.sender, a.sequence)
        < (core::cmp::Reverse(b.priority), b.stamp, b.sender, b.sequence)
}

impl<T: Message> Lane<T> {
    /// Has fetched what the next message touches.
    fn fetch(&self) {
        fetch(&raw const *self.counts, 2);
        match &self.source {
            Source::Value(receiver) => receiver.fetch(),
            Source::Link(receiver, _) => receiver.fetch(),
            Source::Queue(_) => {}
        }
    }

    /// Whether a message waits that nobody else can take.
    fn has_own_message(&self) -> bool {
        self.staged || !matches!(self.source, Source::Queue(_)) && self.source.has_message()
    }

    /// What was taken last, read in place and counted.
    fn current(&self) -> Option<Received<'_, T>> {
        let received = self.read();
        count(if received.is_some() { &self.counts.taken } else { &self.counts.expired });
        received
    }

    fn read(&self) -> Option<Received<'_, T>> {
        match &self.source {
            Source::Value(receiver) => {
                let parcel = receiver.current();
                Some(Received { header: &parcel.header, place: Place::Value(&parcel.payload) })
            }
            Source::Link(receiver, seat) => {
                let parcel = receiver.current();
                let pin = seat.pin(parcel.payload)?;
                Some(Received { header: &parcel.header, place: Place::Pinned(pin) })
            }
            Source::Queue(receiver) => {
                let parcel = receiver.current();
                Some(Received { header: &parcel.header, place: Place::Value(&parcel.payload) })
            }
        }
    }
}

/// Makes the mailbox of an input of type `T`.
pub(crate) fn input_core<T: Message>() -> Arc<InputCore<T>> {
    Arc::new(InputCore {
        inner: UnsafeCell::new(InputInner { lanes: Vec::new(), serves: false, opened: 0, last: None }),
    })
}

impl<T: Message> Port for Input<T> {
    fn shape(&self) -> PortShape {
        PortShape { direction: Direction::Input, input: Some(MessageType::of::<T>()), output: None }
    }

    fn create(&self, _: &PortOptions, _: usize) -> PortEnds {
        PortEnds { input: Some(input_core::<T>()), ..PortEnds::default() }
    }

    fn bind(&mut self, ends: &PortEnds) {
        self.core = ends.input.as_ref().and_then(downcast_input);
    }

    fn fetch(&self, depth: Depth) {
        let Some(core) = self.core.as_deref() else { return };
        match depth {
            Depth::Ends => fetch(core, 1),
            Depth::Wires => core.inner().lanes.iter().take(WIRES).for_each(|lane| fetch(lane, 2)),
            Depth::Places => core.inner().lanes.iter().take(WIRES).for_each(Lane::fetch),
        }
    }
}

pub(crate) fn downcast_input<T: Message>(end: &Arc<dyn InputEnd>) -> Option<Arc<InputCore<T>>> {
    let any: Arc<dyn Any + Send + Sync> = end.clone();
    any.downcast().ok()
}

#[cfg(test)]
#[cfg(loom)]
mod model {
    use super::*;
    use crate::door::Door;
    use crate::port::{Envelope, Output, Target, WireSpec};
    use crate::ring::Overload;
    use crate::sync::weaken;
    use loom::thread;
    use types::messages::Twist;
    use types::{AgentId, Filter};

    fn output(options: &PortOptions) -> (Output<Twist>, PortEnds) {
        let mut output = Output::default();
        let ends = output.create(options, 0);
        output.bind(&ends);
        (output, ends)
    }

    fn wire(id: u32, from: &PortEnds, to: &PortEnds, priorities: &[Priority]) {
        let target =
            Target { agent: AgentId::NONE, executor: 0, slot: 0, door: Arc::new(Door::new()), wakes: false };
        let (overload, counts) = (Overload::Refuse, Arc::default());
        let spec = WireSpec { id: WireId(id), depth: 1, overload, filter: Filter::default(), target, counts };
        let (from, to) = (from.output.as_ref().unwrap(), to.input.as_ref().unwrap());
        let mut made = from.prepare(&spec, priorities, 0, 0).ok().unwrap();
        to.join(made.lanes.as_mut());
        from.add_route(made.route.as_mut());
    }

    /// Two agents send to a third, one of them with two priorities; what was accepted arrives once, and in the order of each lane.
    #[test]
    fn two_senders_fill_one_mailbox() {
        weaken::check(&["ring: refuse, look", "ring: refuse, give back"], || {
            let two = PortOptions { priorities: "urgent, normal", ..PortOptions::DEFAULT };
            let ((mut one, one_end), (mut other, other_end)) = (output(&two), output(&PortOptions::DEFAULT));
            let mut input = Input::<Twist>::default();
            let end = input.create(&PortOptions::DEFAULT, 0);
            input.bind(&end);
            wire(1, &one_end, &end, &[Priority::Urgent, Priority::Normal]);
            wire(2, &other_end, &end, &[Priority::Normal]);
            let urgent = Envelope { priority: Priority::Urgent, ..Envelope::default() };
            let first = thread::spawn(move || {
                let normal = one.send(Twist::new(1.0, 1.0)).taken;
                normal + one.send_as(urgent, Twist::new(2.0, 2.0)).taken
            });
            let second = thread::spawn(move || {
                // The ring holds one: the second goes through when the receiver was there.
                other.send(Twist::new(3.0, 3.0)).taken + other.send(Twist::new(4.0, 4.0)).taken
            });
            let mut taken = Vec::new();
            let mut take = |input: &mut Input<Twist>| {
                let received = input.take().map(|twist| (twist.linear, twist.angular));
                taken.extend(received);
                received.is_some()
            };
            take(&mut input);
            let accepted = first.join().unwrap() + second.join().unwrap();
            while take(&mut input) {}
            assert!(taken.iter().all(|(linear, angular)| linear == angular), "torn: {taken:?}");
            assert_eq!(taken.len() as u32, accepted, "what was accepted arrives once: {taken:?}");
            let at = |number: f64| taken.iter().position(|(linear, _)| *linear == number);
            assert!(at(4.0).is_none_or(|later| at(3.0).is_some_and(|sooner| sooner < later)), "{taken:?}");
            // With all there at once the urgent one comes first.
            assert!(at(2.0).is_some_and(|urgent| urgent <= 1), "{taken:?}");
        });
    }
}
