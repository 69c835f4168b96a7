//! Where messages go out: the routes, and the agent's handle on them.

#![allow(unsafe_code)]

mod chosen;
mod held;

use core::sync::atomic::{AtomicU64, Ordering};
use std::any::Any;
use std::cell::UnsafeCell;
use std::sync::Arc;

use types::cdr::NoElement;
use types::chance::Stream;
use types::header::Quality;
use types::message::is_large;
use types::{AgentId, Category, Header, Message, Priority, Time};

use self::held::Held;
use super::faulty::Faulty;
use super::input::{Lane, NewLanes, Source};
use super::queue::{QueueEnd, QueueForm, queue_core};
use super::route::{Route, Sent, Way};
use super::{
    Direction, InputEnd, NoSeat, OutputEnd, OutputFault, Port, PortEnds, PortOptions, PortShape,
    PreparedWire, WireId, WireSpec, input_core,
};
use crate::context::{Context, current};
use crate::fetch::{Depth, fetch};
use crate::memory::{self, Seat};
use crate::message_type::{self, MessageType};
use crate::ring::{self, Overload};

pub(super) struct NewRoute<T: Message> {
    pub(super) route: Option<Route<T>>,
    pub(super) room: Vec<Route<T>>,
}

/// Of so many wires of an output it is fetched what the next message will touch.
const WIRES: usize = 2;

/// What every message uses stands first, together.
#[repr(C)]
struct OutputInner<T: Message> {
    routes: Vec<Route<T>>,
    sequence: u64,
    sender: AgentId,
    /// Whether it has one wire with one priority, which takes all messages as they are: most outputs do.
    is_plain: bool,
    /// How it misbehaves, if it does.
    faulty: Option<Box<Faulty<T>>>,
    memory: Option<memory::Writer<T>>,
    /// What is kept back, where that is done.
    held: Option<Box<Held<T>>>,
}

impl<T: Message> OutputInner<T> {
    /// After a change of what it has.
    fn changed(&mut self) {
        let is_usual = self.faulty.is_none() && self.held.is_none();
        self.is_plain = is_usual && matches!(&self.routes[..], [only] if only.is_plain());
    }
}

/// The routes behind an output.
#[repr(C)]
pub(crate) struct OutputCore<T: Message> {
    log_every: AtomicU64,
    sent: AtomicU64,
    inner: UnsafeCell<OutputInner<T>>,
    log_number: AtomicU64,
    /// What the readers of its memory share, and on how many seats: the memory of an output is never replaced.
    shared: Option<(memory::Shared<T>, usize)>,
    /// The greatest length of the row of a message.
    rows: usize,
}

// SAFETY: as for `InputCore`: routes are touched only by the thread that runs the executor.
unsafe impl<T: Message> Sync for OutputCore<T> {}
// SAFETY: messages are plain data.
unsafe impl<T: Message> Send for OutputCore<T> {}

impl<T: Message> OutputCore<T> {
    #[allow(clippy::mut_from_ref)]
    #[inline]
    fn inner(&self) -> &mut OutputInner<T> {
        // SAFETY: see `Sync`.
        unsafe { &mut *self.inner.get() }
    }
}

impl<T: Message> OutputEnd for OutputCore<T> {
    fn message_type(&self) -> &'static MessageType {
        MessageType::of::<T>()
    }

    fn prepare(
        &self,
        spec: &WireSpec,
        priorities: &[Priority],
        routes: usize,
        lanes: usize,
    ) -> Result<PreparedWire, NoSeat> {
        if let Some((_, seats)) = &self.shared
            && routes >= *seats
        {
            return Err(NoSeat { seats: *seats });
        }
        let displaces = spec.overload == Overload::NewestWins;
        let (mut values, mut links, mut new_lanes) = (Vec::new(), Vec::new(), Vec::new());
        for priority in priorities {
            let source = match &self.shared {
                None => {
                    let (sender, receiver) = ring::ring(spec.depth, displaces);
                    values.push((*priority, sender));
                    Source::Value(receiver)
                }
                Some((memory, _)) => {
                    let (sender, receiver) = ring::ring(spec.depth, displaces);
                    links.push((*priority, sender));
                    Source::Link(receiver, Seat::new(memory.clone()))
                }
            };
            new_lanes.push(Lane { wire: spec.id, source, counts: spec.counts.clone(), staged: false });
        }
        let room = Vec::with_capacity(lanes + new_lanes.len());
        let lanes = Box::new(NewLanes { lanes: new_lanes, room });
        let way = match self.shared {
            Some(_) if links.len() == 1 => links.pop().map_or(Way::Links(links), |(_, only)| Way::Link(only)),
            Some(_) => Way::Links(links),
            None if values.len() == 1 => {
                values.pop().map_or(Way::Values(values), |(_, only)| Way::Value(only))
            }
            None => Way::Values(values),
        };
        let WireSpec { id, filter, overload, target, counts, .. } = spec;
        let route = Route::new(*id, *filter, *overload, target.clone(), counts.clone(), way);
        let route = Box::new(NewRoute { route: Some(route), room: Vec::with_capacity(routes + 1) });
        Ok(PreparedWire { route, lanes })
    }

    fn set_sender(&self, sender: AgentId, sequence: u64) {
        (self.inner().sender, self.inner().sequence) = (sender, sequence);
        self.sent.store(sequence, Ordering::Relaxed);
    }

    fn add_route(&self, route: &mut (dyn Any + Send)) {
        let Some(new) = route.downcast_mut::<NewRoute<T>>() else { return };
        let inner = self.inner();
        if inner.routes.capacity() == inner.routes.len() {
            new.room.append(&mut inner.routes);
            core::mem::swap(&mut new.room, &mut inner.routes);
        }
        inner.routes.extend(new.route.take());
        inner.changed();
    }

    fn forget(&self, wire: WireId, into: &mut (dyn Any + Send)) {
        let Some(into) = into.downcast_mut::<Option<Route<T>>>() else { return };
        let inner = self.inner();
        if let Some(at) = inner.routes.iter().position(|route| route.wire == wire) {
            *into = Some(inner.routes.remove(at));
            inner.changed();
        }
    }

    fn forgetting_box(&self) -> Box<dyn Any + Send> {
        Box::new(None::<Route<T>>)
    }

    fn set_log(&self, number: u32, every: u32) {
        self.log_number.store(number.into(), Ordering::Relaxed);
        self.log_every.store(every.into(), Ordering::Relaxed);
    }

    fn sent(&self) -> u64 {
        self.sent.load(Ordering::Relaxed)
    }

    fn prepare_fault(&self, fault: OutputFault) -> Box<dyn Any + Send> {
        let faulty = (fault != OutputFault::None).then(|| Box::new(Faulty::<T>::new(fault, self.rows)));
        Box::new(faulty)
    }

    fn set_fault(&self, faulty: &mut (dyn Any + Send)) {
        if let Some(faulty) = faulty.downcast_mut::<Option<Box<Faulty<T>>>>() {
            core::mem::swap(&mut self.inner().faulty, faulty);
            self.inner().changed();
        }
    }

    fn prepare_message(&self, bytes: &[u8]) -> Result<Box<dyn Any + Send>, types::cdr::Error> {
        Ok(Box::new(message_type::decode::<T>(bytes)?))
    }

    fn send_prepared(&self, envelope: &Envelope, message: &(dyn Any + Send)) {
        let Some((head, row)) = message.downcast_ref::<(T, Vec<T::Element>)>() else { return };
        self.send(*envelope, |place, room| {
            *place = *head;
            let len = row.len().min(room.len());
            room[..len].copy_from_slice(&row[..len]);
            len
        });
    }

    fn hold(&self) {
        self.keep_back();
    }

    fn release(&self) {
        self.send_held();
    }

    fn facing(&self) -> Arc<dyn InputEnd> {
        input_core::<T>()
    }

    fn queue(&self, form: QueueForm) -> Option<Arc<dyn QueueEnd>> {
        queue_core::<T>(form)
    }
}

/// What a sender can say of a message; the rest of the header is filled in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Envelope {
    /// The time that the message speaks of; by default that of the step.
    pub stamp: Option<Time>,
    /// Until when it is of use.
    pub deadline: Time,
    /// Whom it is for.
    pub recipient: AgentId,
    /// Free for the agents' own use.
    pub marker: u32,
    /// What sort of thing it is.
    pub category: Category,
    /// How urgent it is; one of those that the output declares.
    pub priority: Priority,
}

impl Default for Envelope {
    fn default() -> Envelope {
        Envelope {
            stamp: None,
            deadline: Time::NEVER,
            recipient: AgentId::NONE,
            marker: 0,
            category: Category::Data,
            priority: Priority::Normal,
        }
    }
}

impl Envelope {
    /// Fills in a header, word by word: one that is put together elsewhere and copied takes longer than a small payload.
    #[inline(always)]
    fn put(&self, header: &mut Header, stamp: Time, sequence: u64, sender: AgentId, quality: Quality) {
        (header.stamp, header.sequence, header.deadline) = (stamp, sequence, self.deadline);
        (header.sender, header.recipient, header.marker) = (sender, self.recipient, self.marker);
        (header.category, header.priority, header.quality) = (self.category, self.priority, quality);
    }
}

/// An end where messages of type `T` go out.
pub struct Output<T: Message> {
    core: Option<Arc<OutputCore<T>>>,
}

impl<T: Message> Default for Output<T> {
    fn default() -> Output<T> {
        Output { core: None }
    }
}

impl<T: Message> Output<T> {
    /// Sends a small message to everybody who is wired to this output.
    #[inline]
    pub fn send(&mut self, message: T) -> Sent
    where
        T: Message<Element = NoElement>,
    {
        self.send_as(Envelope::default(), message)
    }

    /// Sends a small message with an envelope of its own.
    #[inline]
    pub fn send_as(&mut self, envelope: Envelope, message: T) -> Sent
    where
        T: Message<Element = NoElement>,
    {
        self.fill_as(envelope, |place, _| {
            *place = message;
            0
        })
    }

    /// Sends a message that is filled in place. `fill` gets the head and the whole room for the row, and says how much of the row is in
    /// use. What was in the place before is some earlier message, or the default. A large message that nobody would hear, as the log
    /// takes only some, is not filled.
    #[inline]
    pub fn send_with(&mut self, fill: impl FnOnce(&mut T, &mut [T::Element]) -> usize) -> Sent {
        self.fill_as(Envelope::default(), fill)
    }

    /// The same with an envelope of its own.
    #[inline(always)]
    pub fn fill_as(
        &mut self,
        envelope: Envelope,
        fill: impl FnOnce(&mut T, &mut [T::Element]) -> usize,
    ) -> Sent {
        match &self.core {
            Some(core) => core.send(envelope, fill),
            None => Sent::default(),
        }
    }

    /// Sends as many of the messages as have room on every wire, in order, and gives back those that were not sent.
    pub fn send_all<'a>(&mut self, messages: &'a [T]) -> &'a [T]
    where
        T: Message<Element = NoElement>,
    {
        let mut rest = messages;
        while let Some((first, behind)) = rest.split_first() {
            if !self.has_room() {
                break;
            }
            self.send(*first);
            rest = behind;
        }
        rest
    }

    /// Whether every wire has room for a message of normal priority without losing another.
    pub fn has_room(&self) -> bool {
        self.core.as_ref().is_none_or(|core| {
            core.inner().routes.iter().all(|route| match &route.way {
                Way::Value(ring) => ring.has_room(),
                Way::Values(rings) => rings.iter().all(|(_, ring)| ring.has_room()),
                Way::Link(ring) => ring.has_room(),
                Way::Links(rings) => rings.iter().all(|(_, ring)| ring.has_room()),
                Way::Queue(queue) => queue.has_room(),
            })
        })
    }

    /// Whether anybody listens: a wire, or the log, be it to one message of many. What nobody hears need not be computed.
    #[inline]
    pub fn has_listeners(&self) -> bool {
        self.core.as_ref().is_some_and(|core| {
            !core.inner().routes.is_empty() || core.log_every.load(Ordering::Relaxed) != 0
        })
    }

    pub(crate) fn set_core(&mut self, core: Option<Arc<OutputCore<T>>>) {
        self.core = core;
    }

    /// Where its routes lie: a number to know it by.
    pub(crate) fn core_address(&self) -> Option<usize> {
        self.core.as_ref().map(|core| Arc::as_ptr(core).addr())
    }

    /// The greatest length of the row of a message.
    pub fn row_capacity(&self) -> usize {
        self.core.as_ref().map_or(0, |core| core.rows)
    }
}

impl<T: Message> OutputCore<T> {
    #[inline(always)]
    fn send(&self, envelope: Envelope, fill: impl FnOnce(&mut T, &mut [T::Element]) -> usize) -> Sent {
        let inner = self.inner();
        let context = current();
        let stamp = match envelope.stamp {
            Some(stamp) => stamp,
            None => context.map_or(Time::ZERO, Context::now),
        };
        let (sequence, sender) = (inner.sequence, inner.sender);
        let quality = context.map_or(Quality::FULL, Context::quality);
        inner.sequence += 1;
        self.sent.store(inner.sequence, Ordering::Relaxed);
        if inner.is_plain
            && self.log_every.load(Ordering::Relaxed) == 0
            && let [route] = &mut inner.routes[..]
        {
            if !is_large::<T>()
                && let Way::Value(ring) = &mut route.way
            {
                let pushed = ring.push(|parcel| {
                    envelope.put(&mut parcel.header, stamp, sequence, sender, quality);
                    fill(&mut parcel.payload, &mut []);
                });
                return route.account(pushed, Sent::default(), context);
            }
            if is_large::<T>()
                && let Way::Link(ring) = &mut route.way
                && let Some(memory) = &mut inner.memory
            {
                let Some(mut loan) = memory.loan() else { return Sent::default() };
                let (head, row) = loan.parts();
                let len = fill(head, row);
                let link = loan.publish(len, |header| envelope.put(header, stamp, sequence, sender, quality));
                let pushed = ring.push(|parcel| {
                    envelope.put(&mut parcel.header, stamp, sequence, sender, quality);
                    parcel.payload = link;
                });
                return route.account(pushed, Sent::default(), context);
            }
        }
        let Envelope { deadline, recipient, marker, category, priority, .. } = envelope;
        let header =
            Header { stamp, sequence, deadline, sender, recipient, marker, category, priority, quality };
        self.send_any(&header, fill, context)
    }

    /// Not the usual way: said to be cold, so that what stands before the call is inlined, as it is short.
    #[cold]
    #[inline(never)]
    fn send_any(
        &self,
        header: &Header,
        fill: impl FnOnce(&mut T, &mut [T::Element]) -> usize,
        context: Option<&Context>,
    ) -> Sent {
        let inner = self.inner();
        if inner.held.is_some() {
            return self.hold_back(inner, header, fill);
        }
        if inner.faulty.is_some() {
            return self.send_faulty(inner, header, fill, context);
        }
        match &mut inner.memory {
            Some(_) => self.send_link(inner, header, fill, context),
            None => self.send_value(inner, header, fill, context),
        }
    }

    #[inline]
    fn logs(&self, sequence: u64) -> bool {
        match self.log_every.load(Ordering::Relaxed) {
            0 => false,
            1 => true,
            every => sequence.is_multiple_of(every),
        }
    }

    fn log(&self, header: &Header, head: &T, row: &[T::Element], context: Option<&Context>) {
        if let Some(context) = context
            && self.logs(header.sequence)
        {
            let number = self.log_number.load(Ordering::Relaxed) as u32;
            context.log(|log| log.message(number, header, head, row));
        }
    }

    fn send_value(
        &self,
        inner: &mut OutputInner<T>,
        header: &Header,
        fill: impl FnOnce(&mut T, &mut [T::Element]) -> usize,
        context: Option<&Context>,
    ) -> Sent {
        let mut sent = Sent::default();
        if let [route] = &mut inner.routes[..]
            && !self.logs(header.sequence)
        {
            // A filter counts: it is asked once for each message.
            if !route.lets_pass(header) {
                return sent;
            }
            // The one wire: filled in place.
            route.put_value(
                header,
                |place| {
                    fill(place, &mut []);
                },
                &mut sent,
                context,
            );
            return sent;
        }
        let mut message = T::default();
        fill(&mut message, &mut []);
        self.log(header, &message, &[], context);
        for route in &mut inner.routes {
            if route.lets_pass(header) {
                route.put_value(header, |place| *place = message, &mut sent, context);
            }
        }
        sent
    }

    fn send_link(
        &self,
        inner: &mut OutputInner<T>,
        header: &Header,
        fill: impl FnOnce(&mut T, &mut [T::Element]) -> usize,
        context: Option<&Context>,
    ) -> Sent {
        let mut sent = Sent::default();
        // Of large messages the log takes only some: the others need not be made for it.
        if inner.routes.is_empty() && !self.logs(header.sequence) {
            return sent;
        }
        let Some(mut loan) = inner.memory.as_mut().and_then(memory::Writer::loan) else {
            return sent;
        };
        let (head, row) = loan.parts();
        let len = fill(head, row).min(row.len());
        self.log(header, head, &row[..len], context);
        if !is_large::<T>() {
            // Into a queue goes the message itself.
            for route in inner.routes.iter_mut().filter(|route| route.leads_to_queue()) {
                if route.lets_pass(header) {
                    route.put_value(header, |place| *place = *head, &mut sent, context);
                }
            }
        }
        let link = loan.publish(len, |place| *place = *header);
        for route in inner.routes.iter_mut().filter(|route| !route.leads_to_queue()) {
            if route.lets_pass(header) {
                route.put_link(header, link, &mut sent, context);
            }
        }
        sent
    }

    /// The slow way of an output that was made to misbehave.
    #[cold]
    fn send_faulty(
        &self,
        inner: &mut OutputInner<T>,
        header: &Header,
        fill: impl FnOnce(&mut T, &mut [T::Element]) -> usize,
        context: Option<&Context>,
    ) -> Sent {
        // A pure function of the message's number: the same run misbehaves in the same way.
        let draws = Stream::new(0, "output fault").sample(inner.sender.0.into()).sample(header.sequence);
        let Some(faulty) = inner.faulty.take() else { return Sent::default() };
        let mut sent = Sent::default();
        // It goes back to its place also when `fill` panics.
        let mut faulty = Restored { faulty: Some(faulty), place: &raw mut inner.faulty };
        if let Some(kept) = faulty.get().and_then(|faulty| faulty.in_place_of(header.stamp, draws, fill)) {
            let header = Header { stamp: kept.stamp, ..*header };
            let put = |place: &mut T, room: &mut [T::Element]| {
                *place = kept.head;
                let len = kept.row().len().min(room.len());
                room[..len].copy_from_slice(&kept.row()[..len]);
                len
            };
            sent = match inner.memory {
                Some(_) => self.send_link(inner, &header, put, context),
                None => self.send_value(inner, &header, put, context),
            };
        }
        sent
    }
}

/// The fault of an output on its way through a send.
struct Restored<T: Message> {
    faulty: Option<Box<Faulty<T>>>,
    place: *mut Option<Box<Faulty<T>>>,
}

impl<T: Message> Restored<T> {
    fn get(&mut self) -> Option<&mut Faulty<T>> {
        self.faulty.as_deref_mut()
    }
}

impl<T: Message> Drop for Restored<T> {
    fn drop(&mut self) {
        // SAFETY: the place is in the output, which is borrowed for longer than the send lasts; nothing else goes there meanwhile.
        unsafe { *self.place = self.faulty.take() };
    }
}

/// Makes what stands behind an output of type `T`.
pub(crate) fn output_core<T: Message>(options: &PortOptions, seats: usize) -> Arc<OutputCore<T>> {
    let large = is_large::<T>();
    let history = if large { options.history.max(4) } else { options.history };
    let rows = if history > 0 { options.rows } else { 0 };
    let memory = (history > 0).then(|| memory::memory(memory::Form { history, seats, rows }));
    let shared = memory.as_ref().map(|memory| (memory.shared(), memory.seats()));
    Arc::new(OutputCore {
        inner: UnsafeCell::new(OutputInner {
            sender: AgentId::NONE,
            sequence: 0,
            routes: Vec::new(),
            memory,
            faulty: None,
            held: None,
            is_plain: false,
        }),
        shared,
        rows,
        log_number: AtomicU64::new(u64::from(u32::MAX)),
        log_every: AtomicU64::new(0),
        sent: AtomicU64::new(0),
    })
}

impl<T: Message> Port for Output<T> {
    fn shape(&self) -> PortShape {
        PortShape { direction: Direction::Output, input: None, output: Some(MessageType::of::<T>()) }
    }

    fn create(&self, options: &PortOptions, seats: usize) -> PortEnds {
        PortEnds { output: Some(output_core::<T>(options, seats)), ..PortEnds::default() }
    }

    fn bind(&mut self, ends: &PortEnds) {
        self.core = ends.output.as_ref().and_then(downcast_output);
    }

    fn fetch(&self, depth: Depth) {
        let Some(core) = self.core.as_deref() else { return };
        match depth {
            Depth::Ends => fetch(core, 2),
            Depth::Wires => core.inner().routes.iter().take(WIRES).for_each(|route| fetch(route, 3)),
            Depth::Places => core.inner().routes.iter().take(WIRES).for_each(Route::fetch),
        }
    }
}

pub(crate) fn downcast_output<T: Message>(end: &Arc<dyn OutputEnd>) -> Option<Arc<OutputCore<T>>> {
    let any: Arc<dyn Any + Send + Sync> = end.clone();
    any.downcast().ok()
}
