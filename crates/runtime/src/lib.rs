//! The runtime: agents with typed ports, the router that wires them, memory, executors and supervision.
//!
//! A system is described by a [`Plan`] and made of agents that a [`Registry`] knows. In simulated time a [`Simulation`] runs
//! it: one thread plays all executors, and the same plan gives the same bytes.
//!
//! ```
//! use runtime::{Agent, Fault, Input, Options, Output, Plan, Simulation, Step, registry};
//! use types::{Duration, messages::Twist};
//!
//! /// Counts up.
//! #[derive(Agent)]
//! struct Source {
//!     /// The count, as a speed.
//!     out: Output<Twist>,
//!     n: f64,
//! }
//!
//! impl Agent for Source {
//!     fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
//!         self.n += 1.0;
//!         self.out.send(Twist::new(self.n, 0.0));
//!         Ok(())
//!     }
//! }
//!
//! /// Takes what comes.
//! #[derive(Agent)]
//! struct Sink {
//!     /// What comes.
//!     count: Input<Twist>,
//! }
//!
//! impl Agent for Sink {
//!     fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
//!         while let Some(twist) = self.count.take() {
//!             assert!(twist.linear > 0.0);
//!         }
//!         Ok(())
//!     }
//! }
//!
//! let mut plan = Plan::new("lesson");
//! let source = plan.add::<Source>("source", Default::default());
//! let sink = plan.add::<Sink>("sink", Default::default());
//! plan.wire(&source.out, &sink.count);
//! plan.every("source", Duration::millis(10));
//! plan.on("sink", "count");
//! let options = Options { limit: Some(Duration::secs(1)), ..Options::default() };
//! let report = Simulation::new(&plan, &registry![Source, Sink], options).unwrap().run().unwrap();
//! assert_eq!(report.view.agents[1].counts.releases, 101);
//! ```
//!
//! Several inputs can share a mailbox: a [`Queue`]. Each message in it goes to one of them, and of those that wait the one of highest
//! priority is called; [`Plan::queue`] makes one. In a system file:
//!
//! ```toml
//! [queue.work]
//! depth = 32                          # of each sender and priority; "refuse" when it is full
//!
//! [wires]
//! "finder.work" = ["work"]
//! "sorter.work" = ["work"]
//! work = ["fast.work", { to = "slow.work", serving = 10 }]
//! ```

// Derived code names the crate from outside.
#[cfg(test)]
extern crate self as runtime;

mod agent;
mod allocations;
mod budget;
mod census;
mod check;
mod composition;
mod context;
mod door;
mod executor;
mod fetch;
mod folder;
mod handover;
mod log;
mod means;
mod memory;
mod message_type;
mod names;
mod nonblocking;
mod os;
mod plan;
mod port;
mod processor;
mod queue;
mod queue_plan;
mod request;
mod ring;
mod router;
mod service;
mod simulated;
mod stats;
mod sync;
mod system;
mod tap;
mod timetable;
mod trace;
mod wall;
mod witness;

pub use agent::{
    Agent, AgentType, ClientEnd, Declare, Fault, InputEnd, NoParams, OutputEnd, PortInfo, Registry,
    ServiceEnd, Step,
};
pub use allocations::Watched;
pub use census::{Burden, Census, Foreign, Given, Host, HostReading, Resident};
pub use check::{check, executors_of, not_by_deadline, wires_of};
pub use composition::{Composition, End, Left, Member, PortAt, PortSeen, QueueSeen, WireSeen};
pub use executor::{Cause, StepFault};
pub use fetch::Depth;
pub use folder::{FolderError, RunFolder};
pub use log::{LogChoice, Noted, Recorder, write_note};
pub use means::Method;
pub use memory::Found;
pub use message_type::{LARGEST_BY_VALUE, MessageType};
pub use os::processor_time;
pub use plan::{
    AgentPlan, ExecutorPlan, Giving, OnDeath, Plan, Policy, TimedRequest, USUAL_DEPTH, USUAL_DEPTH_ON,
    Wirable, WireFilter, WirePlan, owner, value_of,
};
pub use port::{
    Decision, Direction, Envelope, Gives, Input, Look, Manager, NotAsked, Output, OutputFault, OwnAddress,
    OwnPort, Place, Port, PortEnds, PortOptions, PortShape, PortVisit, Processing, REQUESTS_UNDER_WAY,
    Received, Router, Sent, Takes, Why, WireCounts, WireId, Wiring,
};
pub use queue_plan::{MOST_SERVING, PlanParts, Queue, QueuePlan};
pub use request::{
    AgentState, AgentView, Counts, ExecutorView, FaultKind, PortView, QueueView, ReceiverView, Refusal,
    Request, SystemView, WireTotals, WireView,
};
pub use ring::{MOST_MESSAGES, Overload};
pub use router::{Admission, Incident, ServiceShape, TIMING_KEYS, robot_wires, with_set};
pub use service::{CALLS_UNDER_WAY, Call, Client, Reply, Service, Ticket};
pub use simulated::Simulation;
pub use stats::{AgentStats, Figure, Histogram};
pub use system::{CannotRun, Control, NoObserver, Observer, Options, Report, Verdict};
pub use tap::{Heard, Tap};
pub use timetable::{Assumed, Timetable, timetable, why_unsound};
pub use types::params::Params;
pub use wall::Live;
