//! The crate from outside: real recordings, whole robots in simulated time, and a replay of what was logged.

// A test says what it skips, and a failed step ends it.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

mod barn;
mod busy;
mod data;
mod finding;
mod hands;
mod mapping;
mod past;
mod replay;
mod whole;
