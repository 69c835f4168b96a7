//! Where to go: what is known of the floor, the ways over it, and how to roam through a place that nobody knows.
//!
//! Values in, values out: no clock, no thread, no agent. All memory is taken when a value is made; no step allocates.
//! Metres, radians and seconds; x forward, y left, counter-clockwise positive.
//!
//! | module | from | to |
//! |---|---|---|
//! | [`avoid`] | what is around, and where the goal is | a motion past what is near, by the Nearness Diagram |
//! | [`ground`] | where it is free, where something stands, where the robot has been | the way to the nearest new ground |
//! | [`path`] | a grid, a start and a goal | the shortest way, or one at once and then better ones; smoothed, with a time table |
//! | [`calibration`] | measurements of the robot itself | its wheels, and distances by sizes in the picture |
//! | [`localisation`] | what the wheels say, scans on a known floor, sightings of landmarks and robots | where the robot is, was and will be, or that it is not known |
//! | [`mapping`] | poses and scans | a map of what stands where |
//! | [`floor`] | a plan of walls, or a grid | how far any point is from them, exactly |
//! | [`matching`] | a scan, a floor, and about where | where the scan was taken, and how sure that is |
//! | [`drift`] | a motion by the wheels | how far it may be off |
//! | [`monte_carlo`] | motions and scans | the places where the robot may be, from none known |
//! | [`navigator`] | a scan, the odometry and a goal | a motion to the goal through what nobody told it, as fast as there is room for |
//! | [`roam`] | what is around, and the ground | a motion along the walls, through every gap, to where the robot has not been |
#![forbid(unsafe_code)]

pub mod avoid;
pub mod calibration;
pub mod drift;
pub mod floor;
pub mod ground;
#[cfg(test)]
mod laboratory;
mod layer;
mod linear;
pub mod localisation;
pub mod mapping;
pub mod matching;
pub mod monte_carlo;
pub mod navigator;
pub mod path;
pub mod roam;
mod search;
