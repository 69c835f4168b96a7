//! Queues in a plan.
//!
//! A queue is a named mailbox that several inputs share: each message goes to one of them, and of those that wait the one with the
//! highest priority is called. It is wired like a port; a name that is a queue's takes the place of an agent and its port.

use std::marker::PhantomData;

use types::Message;
use types::value::Span;

use crate::agent::{InputEnd as To, OutputEnd as From};
use crate::message_type::MessageType;
use crate::plan::{AgentPlan, Plan, Wirable, WireFilter, WirePlan};
use crate::port::{Direction, PortShape};
use crate::queue::{MOST_IN_QUEUE, RINGS, SEATS};
use crate::request::Refusal;
use crate::ring::Overload;

/// The highest priority with which an input can be served: that of the highest executor.
pub const MOST_SERVING: u8 = 99;

/// The agents, queues and wires of a running system, as a plan would give them.
pub type PlanParts = (Vec<AgentPlan>, Vec<QueuePlan>, Vec<WirePlan>);

/// A queue in a plan. The type of its messages is that of the ports that are wired to it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct QueuePlan {
    /// Its name.
    pub name: String,
    /// How many messages of one sender and one priority wait at most; [`USUAL_DEPTH_ON`](crate::USUAL_DEPTH_ON) when nothing is
    /// said. A sender that sends much takes no room from the others.
    pub depth: Option<usize>,
    /// What happens when there is no room; when nothing is said the message is given back to its sender, since nobody else takes
    /// what a queue has lost.
    pub overload: Option<Overload>,
    /// Where it is written.
    pub at: Span,
}

impl QueuePlan {
    /// A queue with the usual depth and policy.
    pub fn new(name: impl Into<String>) -> QueuePlan {
        QueuePlan { name: name.into(), ..QueuePlan::default() }
    }

    /// How many messages of one sender and one priority wait at most.
    pub fn depth(&self) -> usize {
        self.depth.unwrap_or(crate::plan::USUAL_DEPTH_ON)
    }

    /// What happens when there is no room.
    pub fn overload(&self) -> Overload {
        self.overload.unwrap_or(Overload::Refuse)
    }

    /// What is wrong with it by itself.
    pub(crate) fn check(&self) -> Result<(), Refusal> {
        let depth = self.depth();
        if depth == 0 || depth > MOST_IN_QUEUE {
            let name = &self.name;
            return Err(Refusal::new(format!(
                "queue \"{name}\" holds from 1 to {MOST_IN_QUEUE} messages of a sender, not {depth}"
            )));
        }
        Ok(())
    }
}

/// A queue of messages of type `T` in a plan.
#[derive(Clone, Debug)]
pub struct Queue<T: Message> {
    /// Its name.
    pub name: String,
    types: PhantomData<fn() -> T>,
}

impl<T: Message> Queue<T> {
    /// The queue of this name.
    pub fn new(name: &str) -> Queue<T> {
        Queue { name: name.to_owned(), types: PhantomData }
    }
}

impl<T: Message> Wirable<Queue<T>> for From<T> {
    fn ends(self, queue: Queue<T>) -> (String, String) {
        (self.name, queue.name)
    }
}

impl<T: Message> Wirable<To<T>> for Queue<T> {
    fn ends(self, other: To<T>) -> (String, String) {
        (self.name, other.name)
    }
}

/// Which end of a wire is a queue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum QueueSide {
    /// It leads into one.
    Into,
    /// It leads out of one.
    OutOf,
}

/// What is wrong with a wire from or to a queue, whose other end is a port of this shape.
pub(crate) fn check_wire(wire: &WirePlan, side: QueueSide, shape: &PortShape) -> Result<(), Refusal> {
    let (queue, port, right, message) = match side {
        QueueSide::Into => (&wire.to, &wire.from, Direction::Output, shape.output),
        QueueSide::OutOf => (&wire.from, &wire.to, Direction::Input, shape.input),
    };
    if shape.direction != right {
        return Err(Refusal::new(format!("{port} is an {}, and {queue} is a queue", shape.direction.name()))
            .help("outputs lead into a queue, and it leads to inputs"));
    }
    if let Some(message) = message.filter(|message| message.large) {
        return Err(Refusal::new(format!(
            "{port} has {}: large messages lie in the memory of their sender, and a queue holds messages themselves",
            message.short_name()
        ))
        .help("wire the ports to each other"));
    }
    if wire.depth.is_some() || wire.overload.is_some() {
        return Err(Refusal::new(format!(
            "depth and overload are those of queue \"{queue}\", not of a wire to or from it"
        ))
        .help(format!("write them into [queue.{queue}]")));
    }
    match side {
        QueueSide::Into if wire.serving.is_some() => Err(serving_elsewhere(wire)),
        QueueSide::OutOf if wire.filter != WireFilter::default() => Err(Refusal::new(format!(
            "the wire from queue \"{queue}\" to {port} has a filter: what it kept out would stand in everybody's way"
        ))
        .help(format!("put the filter on the wires into {queue}"))),
        QueueSide::OutOf if wire.serving.is_some_and(|serving| serving > MOST_SERVING) => {
            Err(Refusal::new(format!("\"serving\" lies from 0 to {MOST_SERVING}")))
        }
        _ => Ok(()),
    }
}

/// A wire that leads out of no queue says how its receiver is served.
pub(crate) fn serving_elsewhere(wire: &WirePlan) -> Refusal {
    Refusal::new(format!("\"serving\" is for wires out of a queue, and {} is none", wire.from))
}

/// The messages of a queue are all of one type.
pub(crate) fn other_type(queue: &str, holds: &MessageType, port: &str, has: &MessageType) -> Refusal {
    Refusal::new(format!("queue \"{queue}\" holds {}, {port} has {}", holds.short_name(), has.short_name()))
}

/// A wire from a queue to a queue.
pub(crate) fn between_queues(wire: &WirePlan) -> Refusal {
    Refusal::new(format!("{} and {} are both queues", wire.from, wire.to))
        .help("outputs lead into a queue, and it leads to inputs")
}

/// A queue has no more receivers, or rings for no more senders.
pub(crate) fn is_full(queue: &str, side: QueueSide) -> Refusal {
    match side {
        QueueSide::Into => Refusal::new(format!(
            "queue \"{queue}\" has no more than {RINGS} rings: one for each priority of each sender"
        )),
        QueueSide::OutOf => Refusal::new(format!("queue \"{queue}\" has no more than {SEATS} receivers")),
    }
}

impl Plan {
    /// Whether a wire leads into a queue, or out of one; an error where both of its ends are queues.
    pub(crate) fn queue_side(&self, wire: &WirePlan) -> Result<Option<QueueSide>, Refusal> {
        match (self.is_queue(&wire.from), self.is_queue(&wire.to)) {
            (true, true) => Err(between_queues(wire)),
            (true, false) => Ok(Some(QueueSide::OutOf)),
            (false, true) => Ok(Some(QueueSide::Into)),
            (false, false) => Ok(None),
        }
    }
}
