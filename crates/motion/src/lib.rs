//! How a robot on two driven wheels moves: plain laws, values in and values out.
//!
//! Nothing here allocates, reads a clock or knows an agent. The step `dt` and the present time come in as arguments.
//! Metres, radians and seconds; x forward, y left, counter-clockwise positive.
//!
//! | module | what it answers |
//! |---|---|
//! | [`kinematics`] | wheel speeds for a motion of the body, and back |
//! | [`odometry`] | where the body is, from wheel counters |
//! | [`heading`] | how far the body turned, from a gyro and the wheels |
//! | [`blend`] | where the body is on the map, without jumps, from odometry and a localizer |
//! | [`motor`] | how a wheel under speed control follows its set point |
//! | [`limits`] | what of a wish can be driven |
//! | [`profile`] | the fastest motion along an axis within velocity, acceleration and jerk |
//! | [`steering`] | closed-loop steering to a pose |
//! | [`trajectory`] | staying with a pose that moves |
//! | [`goto`] | going to a point, a pose or a dock |
//! | [`manoeuvre`] | a velocity for a time, a distance, an angle, a point |
//! | [`track`] | following a path |
//! | [`fuzzy`] | terms, hedges, inference |
//! | [`word`] | commands in words |
//! | [`fusion`] | one command out of many offers |
//! | [`coordination`] | the same by priority, by layers, as vectors, or fused |
//! | [`ring`] | ranges around the robot, of a few sonars or of a laser |
//! | [`safety`] | how fast is still safe, and where there is room |
//! | [`stopping`] | when to stop softly, how, and until when |
//! | [`passive`] | how fast, so that whoever walks into it finds it standing |
//! | [`wall`] | steering along a wall |
//! | [`boundary`] | which ways a body fits through, and which of them is along the wall |
//! | [`pursuit`] | following what a camera on a turning head sees |
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod blend;
pub mod boundary;
pub mod coordination;
pub mod fusion;
pub mod fuzzy;
pub mod goto;
pub mod heading;
pub mod kinematics;
pub mod limits;
pub mod manoeuvre;
pub mod motor;
pub mod odometry;
pub mod passive;
pub mod profile;
pub mod pursuit;
pub mod ring;
pub mod safety;
pub mod steering;
pub mod stopping;
pub mod track;
pub mod trajectory;
pub mod wall;
pub mod word;

pub use kinematics::{Differential, Twist, WheelSpeeds};
pub use word::Word;
