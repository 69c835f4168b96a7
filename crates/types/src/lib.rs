//! The vocabulary that all parts of Sinew share: values without behaviour, without heap in a message, without a clock.
#![no_std]
#![forbid(unsafe_code)]

extern crate alloc;
#[cfg(test)]
extern crate std;

pub mod geometry;
pub mod time;

pub use geometry::{Point, Pose};
pub use time::{Duration, Time};
