//! Where to go: what is known of the floor, the ways over it, and how to roam through a place that nobody knows.
//!
//! Values in, values out: no clock, no thread, no agent. All memory is taken when a value is made; no step allocates.
//! Metres, radians and seconds; x forward, y left, counter-clockwise positive.
//!
//! | module | from | to |
//! |---|---|---|
//! | [`avoid`] | what is around, and where the goal is | a motion past what is near, by the Nearness Diagram |
//! | [`ground`] | where it is free, where something stands, where the robot has been | the way to the nearest new ground |
//! | [`field`] | a grid, a start and a goal | a first way at once, then better ones up to the shortest |
//! | [`navigator`] | a scan, the odometry and a goal | a motion to the goal through what nobody told it, as fast as there is room for |
//! | [`roam`] | what is around, and the ground | a motion along the walls, through every gap, to where the robot has not been |
#![forbid(unsafe_code)]

pub mod avoid;
pub mod field;
pub mod ground;
mod layer;
pub mod navigator;
pub mod roam;
mod search;
