//! The ends of an agent: where messages come in and go out.
//!
//! What an agent holds is a handle. The mailbox and the routes behind it belong to the router: they outlive the agent, and its
//! successor takes them over.

mod faulty;
mod input;
mod manager;
mod output;
mod queue;
mod route;
mod router;

use core::sync::atomic::{AtomicU64, Ordering};
use std::any::Any;
use std::sync::Arc;

use types::{AgentId, Filter, Header, Priority, Time};

use crate::door::Door;
use crate::fetch::Depth;
use crate::message_type::MessageType;
use crate::ring::Overload;

/// The number of a wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct WireId(pub u32);

/// What became of the messages of a wire. Each number is written by one side alone.
#[derive(Debug, Default)]
#[repr(C, align(64))]
pub struct WireCounts {
    /// Put into the ring.
    pub sent: AtomicU64,
    /// Displaced by newer ones.
    pub displaced: AtomicU64,
    /// Dropped because older ones stayed.
    pub dropped: AtomicU64,
    /// Given back to the sender.
    pub refused: AtomicU64,
    /// The two sides are often on two processors, and would take a line of memory from one another.
    _apart: [u64; 4],
    /// Taken one by one by the receiver.
    pub taken: AtomicU64,
    /// Taken by a receiver that asked for the newest, those among them that it passed over.
    pub newest: AtomicU64,
    /// How often the receiver looked into the memory of the sender instead.
    pub looked: AtomicU64,
    /// Links whose message had left the memory before it was read.
    pub expired: AtomicU64,
}

/// Adds one to a counter that nobody else writes.
#[inline]
pub(crate) fn count(counter: &AtomicU64) {
    counter.store(counter.load(Ordering::Relaxed) + 1, Ordering::Relaxed);
}

/// How an end is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PortOptions {
    /// How many messages an output keeps in memory; zero for none, where messages travel by value.
    pub history: usize,
    /// The greatest length of the row of a large message.
    pub rows: usize,
    /// The priorities that an output uses, as in `"urgent, normal"`.
    pub priorities: &'static str,
    /// The port of the robot to which this one is wired when the plan names a robot for the agent.
    pub robot: Option<&'static str>,
    /// Whether one sender of ordinary messages at most may be wired to it: whoever commands an actuator commands it alone. Those that can
    /// say something more urgent stand above it.
    pub single: bool,
    /// How far what it gives is from the hardware; nothing where it gives no reading of a sensor.
    pub processing: Option<Processing>,
}

/// How far a reading is from the hardware: what a resource gives is raw, filtered or interpreted. Each can be pushed, by a wire that makes
/// its receiver run, and pulled, by looking into the memory of an output that keeps one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Processing {
    /// As the sensor says it.
    Raw,
    /// Without what cannot be true, and in a form that is the same for all sensors of a kind.
    Filtered,
    /// What it means: a pose, a risk, a thing that was found.
    Interpreted,
}

impl Processing {
    /// In a word.
    pub const fn name(self) -> &'static str {
        match self {
            Processing::Raw => "raw",
            Processing::Filtered => "filtered",
            Processing::Interpreted => "interpreted",
        }
    }
}

impl PortOptions {
    /// By value, with normal priority, for no robot, with any number of senders.
    pub const DEFAULT: PortOptions = PortOptions {
        history: 0,
        rows: 0,
        priorities: "normal",
        robot: None,
        single: false,
        processing: None,
    };

    /// Whether nothing that goes out here is more urgent than usual.
    pub(crate) fn is_ordinary(&self) -> bool {
        self.priorities().all(|priority| priority <= Priority::Normal)
    }

    pub(crate) fn priorities(&self) -> impl Iterator<Item = Priority> + '_ {
        self.priorities.split(',').filter_map(|name| Priority::named(name.trim()))
    }
}

/// Which way messages go through a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// They come in.
    Input,
    /// They go out.
    Output,
    /// Calls come in and answers go out.
    Service,
    /// Calls go out and answers come in.
    Client,
    /// Requests to the router go out and what it decided comes in.
    Router,
    /// What the resource manager sets goes out, and how things are comes in.
    Manager,
}

impl Direction {
    /// Its name on the screen.
    pub const fn name(self) -> &'static str {
        match self {
            Direction::Input => "input",
            Direction::Output => "output",
            Direction::Service => "service",
            Direction::Client => "client",
            Direction::Router => "router",
            Direction::Manager => "manager",
        }
    }
}

/// What a port takes and gives.
#[derive(Clone, Copy, Debug)]
pub struct PortShape {
    /// Which way messages go.
    pub direction: Direction,
    /// What comes in.
    pub input: Option<&'static MessageType>,
    /// What goes out.
    pub output: Option<&'static MessageType>,
}

impl PortShape {
    /// Whether something comes in that can make an agent run.
    pub fn comes_in(&self) -> bool {
        self.input.is_some() || self.direction == Direction::Router
    }
}

/// What stands behind a port: the parts that belong to the router.
#[derive(Clone, Default)]
pub struct PortEnds {
    pub(crate) input: Option<Arc<dyn InputEnd>>,
    pub(crate) output: Option<Arc<dyn OutputEnd>>,
    pub(crate) manager: Option<Arc<ManagerEnd>>,
}

/// A port of any type.
pub trait Port {
    /// What it takes and gives.
    fn shape(&self) -> PortShape;
    /// Makes what stands behind it. `seats` is how many readers its memory has room for.
    fn create(&self, options: &PortOptions, seats: usize) -> PortEnds;
    /// Puts it in front of what [`create`](Self::create) made for the same type.
    fn bind(&mut self, ends: &PortEnds);
    /// Has fetched what the next message touches, when what lies before it on the way was fetched already.
    fn fetch(&self, depth: Depth);
}

/// A port on the way to whoever asks for the ports of an agent.
pub struct PortVisit<'a> {
    /// Its name.
    pub name: &'static str,
    /// What it is for.
    pub doc: &'static str,
    /// How it is made.
    pub options: PortOptions,
    /// The port.
    pub port: &'a mut dyn Port,
}

/// Where a wire leads.
#[derive(Clone)]
pub(crate) struct Target {
    /// Who receives; nobody where that is found out for each message, or is nobody in the system.
    pub agent: AgentId,
    pub executor: u32,
    pub slot: u32,
    pub door: Arc<Door>,
    /// Whether the receiver runs when a message comes.
    pub wakes: bool,
}

/// How a wire is made.
#[derive(Clone)]
pub(crate) struct WireSpec {
    pub id: WireId,
    pub depth: usize,
    pub overload: Overload,
    pub filter: Filter,
    pub target: Target,
    pub counts: Arc<WireCounts>,
}

/// Both ends of a new wire, and spare room for the arrays into which they go.
pub(crate) struct PreparedWire {
    pub route: Box<dyn Any + Send>,
    pub lanes: Box<dyn Any + Send>,
}

/// The memory of the output has readers on all its seats.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct NoSeat {
    pub seats: usize,
}

/// What a step did with the messages of an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Settled {
    /// It took some.
    pub took: bool,
    /// Some are left.
    pub left: bool,
}

/// What the executor asks of the receiving side of a port.
pub(crate) trait InputEnd: Any + Send + Sync {
    /// Adds the lanes of a wire, using the room that comes with them. The box goes back to be freed.
    fn join(&self, lanes: &mut (dyn Any + Send));
    /// Whether the wire has no message left.
    fn is_drained(&self, wire: WireId) -> bool;
    /// Takes the lanes of a wire out, to be freed elsewhere.
    fn leave(&self, wire: WireId, into: &mut (dyn Any + Send));
    /// A box for [`leave`](Self::leave) to fill.
    fn leaving_box(&self) -> Box<dyn Any + Send>;
    /// Whether any message waits.
    fn has_message(&self) -> bool;
    /// The stamp of the oldest message that waits; nothing where none does, or it is not known whose it will be.
    fn oldest(&self) -> Option<Time> {
        None
    }
    /// After the step with this number: what it did with the messages that waited.
    fn settle(&self, step: u64) -> Settled;
    /// Before a step of an agent that takes messages out of a queue: nobody counts on it meanwhile.
    fn begin_step(&self);
    /// Whether it takes messages out of a queue.
    fn serves(&self) -> bool;
    /// Comes to rest between two steps. Says whether a message waits for which the agent is to run again at once.
    fn rest(&self, why: Rest, teller: &mut Teller<'_>) -> bool;
    /// A queue of such messages; nothing where they are large.
    fn queue(&self, form: QueueForm) -> Option<Arc<dyn QueueEnd>>;
    fn message_type(&self) -> &'static MessageType;
    /// An output of the same type that belongs to no agent: for a caller from outside.
    fn facing(&self) -> Arc<dyn OutputEnd>;
    /// Takes the next message, as CDR: for an end that belongs to no agent.
    fn take_cdr(&self) -> Option<Vec<u8>>;
}

/// What the executor asks of the sending side of a port.
pub(crate) trait OutputEnd: Any + Send + Sync {
    fn message_type(&self) -> &'static MessageType;
    /// Makes both ends of a wire from here to `input`. `routes` is how many there are already, `lanes` how many the input has.
    fn prepare(
        &self,
        spec: &WireSpec,
        priorities: &[Priority],
        routes: usize,
        lanes: usize,
    ) -> Result<PreparedWire, NoSeat>;
    /// Says whose output it is, and with which sequence number it goes on. Nobody else may have it yet.
    fn set_sender(&self, sender: AgentId, sequence: u64);
    /// Adds a route, using the room that comes with it.
    fn add_route(&self, route: &mut (dyn Any + Send));
    /// Takes the route of a wire out, to be freed elsewhere.
    fn forget(&self, wire: WireId, into: &mut (dyn Any + Send));
    /// A box for [`forget`](Self::forget) to fill.
    fn forgetting_box(&self) -> Box<dyn Any + Send>;
    /// Under which number the log knows it, and whether it is logged.
    fn set_log(&self, number: u32, every: u32);
    /// Messages sent since the start, whoever listens.
    fn sent(&self) -> u64;
    /// What it takes to make the output misbehave, or behave again.
    fn prepare_fault(&self, fault: OutputFault) -> Box<dyn Any + Send>;
    /// Makes it so. What it kept before goes back, to be freed elsewhere.
    fn set_fault(&self, faulty: &mut (dyn Any + Send));
    /// Reads a message from CDR, to be sent with [`send_prepared`](Self::send_prepared).
    fn prepare_message(&self, bytes: &[u8]) -> Result<Box<dyn Any + Send>, types::cdr::Error>;
    /// Sends a message that was prepared by an output of the same type.
    fn send_prepared(&self, envelope: &Envelope, message: &(dyn Any + Send));
    /// From now on keeps back what is sent, until [`release`](Self::release).
    fn hold(&self);
    /// Sends what was kept back, in its order, and keeps nothing back any more.
    fn release(&self);
    /// An input of the same type that belongs to no agent: for a caller from outside.
    fn facing(&self) -> Arc<dyn InputEnd>;
    /// A queue of such messages; nothing where they are large.
    fn queue(&self, form: QueueForm) -> Option<Arc<dyn QueueEnd>>;
}

/// How an output misbehaves on request.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum OutputFault {
    /// It does not.
    #[default]
    None = 0,
    /// It sends nothing.
    Off = 1,
    /// It sends the first value of the fault again and again.
    Stuck = 2,
    /// It sends every other message, by chance.
    Intermittent = 3,
    /// Numbers out of nowhere.
    Garbage = 4,
    /// Numbers that are wrong but look right.
    Wrong = 5,
    /// Messages come some messages later.
    Delayed = 6,
}

/// A message on its way.
#[derive(Clone, Copy, Default)]
struct Parcel<P> {
    header: Header,
    payload: P,
}

pub use input::{Input, Received};
pub(crate) use input::{InputCore, downcast_input, input_core};
pub use manager::Manager;
pub(crate) use manager::{Asked, ManagerEnd};
pub use output::{Envelope, Output};
pub(crate) use output::{OutputCore, downcast_output, output_core};
pub(crate) use queue::{QueueEnd, QueueForm, QueueWire, Rest, Teller};
pub use route::Sent;
pub(crate) use router::{Acquaintance, Ask, Deed, RouterEnd, Told, router_end};
pub use router::{
    Decision, Gives, Look, NotAsked, OwnAddress, OwnPort, Place, REQUESTS_UNDER_WAY, Router, Takes, Why,
    Wiring,
};
