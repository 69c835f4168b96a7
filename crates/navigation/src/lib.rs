//! Where to go: what is known of the floor, the ways over it, and how to roam through a place that nobody knows.
//!
//! Values in, values out: no clock, no thread, no agent. All memory is taken when a value is made; no step allocates.
//! Metres, radians and seconds; x forward, y left, counter-clockwise positive.
//!
//! | module | from | to |
//! |---|---|---|
//! | [`ground`] | where it is free, where something stands, where the robot has been | the way to the nearest new ground |
//! | [`path`] | a grid, a start and a goal | the shortest way, or one at once and then better ones; smoothed, with a time table |
//! | [`calibration`] | measurements of the robot itself | its wheels, and distances by sizes in the picture |
//! | [`localisation`] | steps of the wheels, sightings of landmarks and robots, scans on a known map | where the robot is, was and will be |
//! | [`mapping`] | poses and scans | a map of what stands where |
//! | [`roam`] | what is around, and the ground | a motion along the walls, through every gap, to where the robot has not been |
#![forbid(unsafe_code)]

pub mod calibration;
pub mod ground;
mod layer;
pub mod localisation;
pub mod mapping;
pub mod path;
pub mod roam;
mod search;
