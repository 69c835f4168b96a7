//! Where to go: what is known of the floor, the ways over it, and how to roam through a place that nobody knows.
//!
//! Values in, values out: no clock, no thread, no agent. All memory is taken when a value is made; no step allocates.
//! Metres, radians and seconds; x forward, y left, counter-clockwise positive.
//!
//! | module | from | to |
//! |---|---|---|
//! | [`ground`] | where it is free, where something stands, where the robot has been | the way to the nearest new ground |
//! | [`field`] | a grid, a start and a goal | a first way at once, then better ones up to the shortest |
//! | [`floor`] | a plan of walls, or a grid | how far any point is from them, exactly |
//! | [`matching`] | a scan, a floor, and about where | where the scan was taken, and how sure that is |
//! | [`drift`] | a motion by the wheels | how far it may be off |
//! | [`monte_carlo`] | motions and scans | the places where the robot may be, from none known |
//! | [`localiser`] | what the wheels say, and scans | where the robot is on a known floor, or that it is not known |
//! | [`roam`] | what is around, and the ground | a motion along the walls, through every gap, to where the robot has not been |
#![forbid(unsafe_code)]

pub mod drift;
pub mod field;
pub mod floor;
pub mod ground;
#[cfg(test)]
mod laboratory;
mod layer;
mod linear;
pub mod localiser;
pub mod matching;
pub mod monte_carlo;
pub mod roam;
mod search;
