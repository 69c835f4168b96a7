//! The vocabulary that all parts of Sinew share: values without behaviour, without heap in a message, without a clock.
#![no_std]
#![forbid(unsafe_code)]

extern crate alloc;
// The derives name this crate as users of it do.
extern crate self as types;
#[cfg(test)]
extern crate std;

pub mod cdr;
pub mod chance;
pub mod definition;
pub mod geometry;
pub mod header;
pub mod message;
pub mod messages;
pub mod params;
pub mod text;
pub mod time;
pub mod value;

pub use geometry::{Point, Pose};
pub use header::{AgentId, Category, Filter, Header, Priority};
pub use message::Message;
pub use text::{Name, Sequence, Text};
pub use time::{Duration, Time};
