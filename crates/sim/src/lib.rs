//! The world in the plane, pure and seeded: bodies, contacts, sensors with noise, a camera, people, goals and draws.
//!
//! | to find | look in |
//! |---|---|
//! | what a world file says | [`plan`] |
//! | what of a world a plan of the building shows | [`building`] |
//! | what a robot is made of | [`model`] |
//! | the running world | [`simulator`], with `robot` (motion, contacts), `people` (scripts) and `crowd` |
//! | what a hand does to it meanwhile | [`hand`] |
//! | sensors | `sonar`, [`laser`], [`camera`], [`landmarks`]; all are methods of [`Simulator`] |
//! | what makes a run a success | [`goal`] |
//! | what a seed changes | [`vary`], with [`free_way`] |
//! | plain data to draw | [`snapshot`] |
//! | rays, grid and chance underneath | [`shape`], `solid`, `field`, [`types::chance`] |
//!
//! There is no clock, file, thread or generator here. The same plan, seed and commands give the same bytes.
#![forbid(unsafe_code)]

pub mod building;
pub mod camera;
pub mod colour;
mod crowd;
mod field;
pub mod free_way;
pub mod goal;
pub mod hand;
pub mod landmarks;
pub mod laser;
pub mod model;
mod outline;
mod people;
pub mod plan;
mod read;
mod robot;
pub mod shape;
pub mod simulator;
pub mod snapshot;
mod solid;
mod sonar;
pub mod vary;

pub use colour::Colour;
pub use goal::{Goal, Progress};
pub use model::Model;
pub use people::POLITE;
pub use plan::WorldPlan;
pub use read::read_pose;
pub use robot::{CLEARANCE_LIMIT, Charge, HeadState, Truth};
pub use simulator::{AddError, PHYSICS_STEP, RobotId, Simulator};
pub use types::chance::Stream;
pub use vary::{Drawn, Vary};
