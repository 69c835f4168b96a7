//! A queue behind the ports of agents: the route of who sends into it, the lane of who takes out of it.
//!
//! Both are put into the same arrays as those of a wire, by the same changes, so ports know nothing of queues but an arm each.

use std::any::Any;
use std::sync::Arc;

use types::message::is_large;
use types::{AgentId, Filter, Header, Message, Priority};

use super::input::{InputInner, Lane, NewLanes, Source};
use super::output::NewRoute;
use super::route::{Route, Way};
use super::{Parcel, Target, WireCounts, WireId};
use crate::context::Context;
use crate::door::Door;
use crate::message_type::MessageType;
use crate::queue::{Called, Key, Shared};
use crate::ring::{Overload, Pushed};

/// How a queue is made.
pub(crate) struct QueueForm {
    pub depth: usize,
    pub overload: Overload,
    /// The doors of all executors, by number.
    pub doors: Vec<Arc<Door>>,
}

/// What the router asks of a queue.
pub(crate) trait QueueEnd: Send + Sync {
    fn message_type(&self) -> &'static MessageType;
    /// The route of a new sender, for an output that has `routes` already, and the numbers of its rings; nothing where there are
    /// rings for no more senders.
    fn prepare_sender(
        &self,
        wire: &QueueWire,
        routes: usize,
        priorities: &[Priority],
    ) -> Option<(AnyBox, Vec<usize>)>;
    /// The lane of a new receiver, for an input that has `lanes` at most already, and the number of its place; nothing where there
    /// are places for no more.
    fn prepare_receiver(
        &self,
        wire: &QueueWire,
        lanes: usize,
        executor: u32,
        slot: u32,
    ) -> Option<(AnyBox, u32)>;
    /// Says who is called first: a lower rank before a higher one.
    fn set_rank(&self, seat: u32, rank: u32);
    /// Nothing more is put in by anybody.
    fn close(&self);
    /// Nothing comes from these rings any more but what is in them.
    fn close_sender(&self, rings: &[usize]);
    /// Nothing is taken by this receiver any more.
    fn close_receiver(&self, seat: u32);
    /// Calls others, when somebody was called who does not come.
    fn call_again(&self);
    /// How many messages wait.
    fn waiting(&self) -> usize;
}

pub(crate) type AnyBox = Box<dyn Any + Send>;

/// A wire into a queue or out of it.
pub(crate) struct QueueWire {
    pub id: WireId,
    pub filter: Filter,
    pub counts: Arc<WireCounts>,
}

/// A queue of messages of one type.
struct QueueCore<T: Message> {
    shared: Arc<Shared<Parcel<T>>>,
    form: QueueForm,
}

/// Makes a queue; nothing where the messages are large, and travel as links to the memory of their sender.
pub(super) fn queue_core<T: Message>(form: QueueForm) -> Option<Arc<dyn QueueEnd>> {
    if is_large::<T>() {
        return None;
    }
    let shared = Shared::new(form.depth, form.overload == Overload::NewestWins, form.doors.clone());
    Some(Arc::new(QueueCore::<T> { shared, form }))
}

impl<T: Message> QueueEnd for QueueCore<T> {
    fn message_type(&self) -> &'static MessageType {
        MessageType::of::<T>()
    }

    fn prepare_sender(
        &self,
        wire: &QueueWire,
        routes: usize,
        priorities: &[Priority],
    ) -> Option<(AnyBox, Vec<usize>)> {
        let sender = self.shared.sender(priorities)?;
        let rings = sender.rings();
        // Whom a message wakes is found out for each one.
        let door = self.form.doors.first()?.clone();
        let target = Target { agent: AgentId::NONE, executor: 0, slot: 0, door, wakes: false };
        let way = Way::Queue(Box::new(sender));
        let route =
            Route::<T>::new(wire.id, wire.filter, self.form.overload, target, wire.counts.clone(), way);
        Some((Box::new(NewRoute { route: Some(route), room: Vec::with_capacity(routes + 1) }), rings))
    }

    fn prepare_receiver(
        &self,
        wire: &QueueWire,
        lanes: usize,
        executor: u32,
        slot: u32,
    ) -> Option<(AnyBox, u32)> {
        let receiver = self.shared.receiver(executor, slot)?;
        let seat = receiver.number();
        let source = Source::Queue(Box::new(receiver));
        let lane = Lane::<T> { wire: wire.id, source, counts: wire.counts.clone(), staged: false };
        Some((Box::new(NewLanes { lanes: vec![lane], room: Vec::with_capacity(lanes + 1) }), seat))
    }

    fn set_rank(&self, seat: u32, rank: u32) {
        self.shared.set_rank(seat, rank);
    }

    fn close(&self) {
        self.shared.close();
    }

    fn close_sender(&self, rings: &[usize]) {
        self.shared.close_rings(rings);
    }

    fn close_receiver(&self, seat: u32) {
        self.shared.close_receiver(seat);
    }

    fn call_again(&self) {
        self.shared.call_again();
    }

    fn waiting(&self) -> usize {
        self.shared.waiting()
    }
}

impl<T: Message> Route<T> {
    /// Puts a message into the queue to which this leads, and tells whoever is called for it.
    #[inline(never)]
    pub(super) fn put_queued(
        &mut self,
        header: &Header,
        fill: impl FnOnce(&mut T),
        context: Option<&Context>,
    ) -> Pushed {
        let Way::Queue(queue) = &mut self.way else { return Pushed::Full };
        let put = |parcel: &mut Parcel<T>| {
            parcel.header = *header;
            fill(&mut parcel.payload);
        };
        queue.push(header.priority, Key::of(header), put, |called| {
            if let Some(context) = context {
                context.wake(called.executor, called.slot, called.door);
            }
        })
    }
}

/// How an agent comes to rest, for the queues that it serves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rest {
    /// Its step ended; whether it took a message.
    Stepped(bool),
    /// It has just come, or was called.
    Ready,
    /// Its step was left out.
    LeftOut,
    /// It died, or runs later whatever comes.
    Away,
}

/// Who tells others that a message waits, between steps: at once, and without a door for those of the same executor.
pub(crate) struct Teller<'a> {
    pub executor: u32,
    /// Makes the agent in a slot of that executor ready.
    pub mark: &'a mut dyn FnMut(u32),
}

impl Teller<'_> {
    fn tell(&mut self, called: Option<Called<'_>>) {
        match called {
            Some(called) if called.executor == self.executor => (self.mark)(called.slot),
            Some(called) => called.ring(),
            None => {}
        }
    }
}

impl<T: Message> InputInner<T> {
    fn queues(&self) -> impl Iterator<Item = &crate::queue::Receiver<Parcel<T>>> {
        self.lanes.iter().filter_map(|lane| match &lane.source {
            Source::Queue(queue) => Some(&**queue),
            _ => None,
        })
    }

    /// A step begins: whoever calls passes over this input.
    pub(super) fn begin_step(&self) {
        self.queues().for_each(crate::queue::Receiver::begin_step);
    }

    /// Comes to rest at the queues. Says whether to run again at once.
    pub(super) fn rest_at_queues(&self, why: Rest, teller: &mut Teller<'_>) -> bool {
        let mut again = false;
        for queue in self.queues() {
            match why {
                Rest::Stepped(_) if !queue.asks() && queue.has_message() => {
                    teller.tell(queue.leave_to_others());
                }
                Rest::Stepped(_) | Rest::Ready => {
                    again |= !queue.wait(|called| teller.tell(Some(called)));
                }
                Rest::LeftOut => teller.tell(queue.leave_to_others()),
                Rest::Away => teller.tell(queue.withdraw()),
            }
        }
        again
    }

    /// The lane whose message is next and was taken, where there are queues among several lanes. Nothing is taken out of a queue
    /// only to be compared: somebody else may have it.
    pub(super) fn next_with_queues(&mut self) -> Option<usize> {
        loop {
            let mut best: Option<(usize, Key, Option<crate::queue::Seen>)> = None;
            for (at, lane) in self.lanes.iter_mut().enumerate() {
                let (key, seen) = match &mut lane.source {
                    Source::Queue(queue) => match queue.peek() {
                        Some(seen) => (seen.key(), Some(seen)),
                        None => continue,
                    },
                    source => {
                        lane.staged = lane.staged || source.advance();
                        if !lane.staged {
                            continue;
                        }
                        (Key::of(source.header()), None)
                    }
                };
                if best.is_none_or(|(_, least, _)| key < least) {
                    best = Some((at, key, seen));
                }
            }
            let (at, _, seen) = best?;
            let lane = &mut self.lanes[at];
            match (&mut lane.source, seen) {
                (Source::Queue(queue), Some(seen)) => {
                    if queue.take(&seen) {
                        return Some(at);
                    }
                }
                _ => {
                    lane.staged = false;
                    return Some(at);
                }
            }
        }
    }
}
