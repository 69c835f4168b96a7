//! Does a set of tasks meet its deadlines? Values in, values out, verdicts in exact arithmetic.
//!
//! A [`Task`] needs a cost of processor time every period, and has a deadline. A [`TaskSet`] is checked for sense when it is made;
//! then the classic tests answer for one processor:
//!
//! | question | answer |
//! |---|---|
//! | is the utilisation low enough, whatever the periods are? | [`utilization`]: Liu and Layland, hyperbolic |
//! | how long does each task take at worst, under fixed priorities? | [`response`] |
//! | are all deadlines met when the earliest goes first? | [`demand`] |
//! | how much faster or costlier may a task become? | [`sensitivity`] |
//! | which processor runs which task? | [`partition`] |
//! | which periods fit, within limits, by elasticity? | [`elastic`] |
//! | what does it look like in time? | [`simulate`] |
//! | what of agents that share threads, and trigger each other? | [`system`] |
//! | who gives way when it is too much: periods, methods, budgets, lives? | [`manage`] |
//! | how seldom may an encoder be read? | [`encoder`] |
//!
//! Times are exact fractions of a nanosecond ([`Exact`]), so that a set that is just feasible is found to be so.
#![forbid(unsafe_code)]

pub mod demand;
pub mod elastic;
pub mod encoder;
mod exact;
pub mod manage;
pub mod partition;
pub mod processors;
pub mod response;
pub mod sensitivity;
pub mod simulate;
pub mod system;
mod task;
pub mod utilization;

pub use exact::Exact;
pub use task::{Task, TaskSet, What, Wrong};
