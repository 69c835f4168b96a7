//! Avoiding obstacles by what is seen at this moment, without a map.
//!
//! | to find | look in |
//! |---|---|
//! | the outline of the robot, round or rectangular | [`Body`] |
//! | what is nearest in each direction, of a laser, a ring of sonars, or both | [`Sectors`] |
//! | the Nearness Diagram with its six situations | [`NearnessDiagram`] |
//! | the smooth one, without situations | [`SmoothNearness`] |
//! | what was seen a moment ago beside and behind a robot that looks ahead | [`Memory`] |
//! | whether the robot is stuck, and how it gets out | [`escape`] |
//!
//! Both give a [`types::messages::Avoidance`]: the motion, and the numbers that say why. They need some microseconds a step, so they can follow
//! each scan. They keep the robot off what they see and know no ways round: in a dead end they stand or turn to and fro, so who has a map
//! plans a way first and gives a point on it as the goal.

mod body;
#[cfg(test)]
mod driving;
pub mod escape;
pub mod memory;
pub mod nearness;
mod regions;
pub mod sectors;
pub mod smooth;
#[cfg(test)]
mod tests;

pub use body::Body;
pub use memory::Memory;
pub use nearness::NearnessDiagram;
pub use sectors::{SECTORS, Sectors};
pub use smooth::SmoothNearness;
