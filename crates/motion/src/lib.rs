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
//! | [`motor`] | how a wheel under speed control follows its set point |
//! | [`limits`] | what of a wish can be driven |
//! | [`fuzzy`] | terms, hedges, inference |
//! | [`word`] | commands in words |
//! | [`fusion`] | one command out of many offers |
//! | [`ring`] | ranges around the robot, of a few sonars or of a laser |
//! | [`safety`] | how fast is still safe, and where there is room |
//! | [`soft_stop`] | whether it must stop by itself, and when it may go again |
//! | [`wall`] | steering along a wall |
//! | [`boundary`] | which ways a body fits through, and which of them is along the wall |
//! | [`pursuit`] | following what a camera on a turning head sees |
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod boundary;
pub mod fusion;
pub mod fuzzy;
pub mod heading;
pub mod kinematics;
pub mod limits;
pub mod motor;
pub mod odometry;
pub mod pursuit;
pub mod ring;
pub mod safety;
pub mod soft_stop;
pub mod wall;
pub mod word;

pub use kinematics::{Differential, Twist, WheelSpeeds};
pub use word::Word;
