//! The abstract robot: what agents see of any robot, the gate in front of it, and the drivers behind the gate.
//!
//! ```text
//!   agents ──▶ Robot (agent) ──▶ Gate ──▶ Driver: simulated, recorded …
//!                                 │
//!                               Latch (this process, another process, a signal)
//! ```
//!
//! | to find | look in |
//! |---|---|
//! | what a driver must do | [`driver`], [`description`] |
//! | stop, age of commands, limits | [`latch`], [`guard`], [`gate`] |
//! | the agent with the ports of a robot | [`robot`] |
//! | drivers | [`simulated`], [`recording`] with [`carmen`], [`ticks`] and [`replay`] |
//! | recordings without a driver: robots among coded landmarks | [`mrclam`] |
//! | from a word in a file to a driver | [`open`](mod@open) |
//!
//! A robot in a simulated hall, for three seconds:
//!
//! ```
//! use hardware::{Berth, Gate, Latch, Robot, simulated};
//! use runtime::{Options, Plan, Registry, Simulation};
//! use sim::{Model, WorldPlan};
//! use types::{Duration, Pose, Time};
//!
//! let body = simulated::Robot { name: "h1".into(), model: Model::h1(), start: Pose::new(5.0, 5.0, 0.0), goal: None };
//! let (bodies, truth) = simulated::raise(&WorldPlan::hall(10.0, 10.0), 7, &[body])?;
//! let gates = bodies.into_iter().map(|body| Gate::new(body, Latch::private()));
//! let registry = Registry::new(gates.map(|gate| Berth::with(gate).agent_type("robot")));
//!
//! let mut plan = Plan::new("hall");
//! plan.add::<Robot>("h1", Default::default());
//! plan.every("h1", hardware::robot::CYCLE);
//! plan.on("h1", "drive");
//! Simulation::new(&plan, &registry, Options { limit: Some(Duration::secs(3)), ..Options::default() })?.run()?;
//! assert_eq!(truth.time(), Time::from_seconds(3.0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod cadence;
pub mod carmen;
pub mod description;
pub mod driver;
pub mod gate;
pub mod guard;
pub mod host;
pub mod latch;
mod lines;
pub mod mrclam;
mod newest;
pub mod open;
pub mod recording;
pub mod replay;
pub mod robot;
pub mod simulated;
pub mod ticks;

#[cfg(test)]
mod scratch;

pub use description::{ClockKind, RobotDescription};
pub use driver::{Driver, Listening, Sink};
pub use gate::Gate;
pub use guard::{Authority, Policy};
pub use latch::{Cause, Latch};
pub use lines::{Report, Told};
pub use open::{OpenError, Opened, Spec, open};
pub use robot::{Berth, Robot};
