//! Sinew: a real-time multi-agent control system for autonomous mobile robots.
//!
//! This is the facade: it names everything else once and adds nothing.
//!
//! ```no_run
//! use sinew::prelude::*;
//! use sinew::types::messages::Twist;
//!
//! /// Drives in a circle.
//! #[derive(Agent)]
//! struct Circle {
//!     /// Where to drive.
//!     drive: Output<Twist>,
//! }
//!
//! impl Agent for Circle {
//!     fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
//!         self.drive.send(Twist::new(0.2, 0.5));
//!         Ok(())
//!     }
//! }
//!
//! fn main() -> std::process::ExitCode {
//!     sinew::program(registry![Circle])
//! }
//! ```

pub use agents;
pub use hardware;
pub use knowledge;
pub use motion;
pub use perception;
pub use program::program;
pub use record;
pub use runtime;
pub use sim;
pub use types;

/// What nearly every agent names.
pub mod prelude {
    pub use runtime::{
        Agent, Client, Decision, Fault, Input, Options, Output, Params, Plan, Registry, Reply, Router,
        Service, Simulation, Step, note, registry,
    };
    pub use types::{Duration, Message, Point, Pose, Time};
}
