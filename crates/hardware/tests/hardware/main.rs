//! The crate from outside: real recordings, whole robots in simulated time, and a replay of what was logged.

// A test says what it skips, and a failed step ends it.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

mod busy;
mod data;
mod hands;
mod past;
mod replay;
mod whole;
