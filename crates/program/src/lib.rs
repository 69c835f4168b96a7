//! The command line and the system file, as a library.
//!
//! | to find | look in |
//! |---|---|
//! | from a system file to a plan and back | [`mod@file`] |
//! | its schema for editors | [`schema`] |
//! | templates of agents and systems | [`new`] |
//! | what a machine can do for real time | [`doctor`] |
//! | how mistakes look, for people and programs | [`Failure`] |
//! | the command line | [`program`], `cli` |
//! | a run from its file to its summary, log and figures | `run`, `figures` |
//! | asking a system that runs | `live` |
//! | what is done with logs | `log` |
//! | what is known from run to run | `know` |
//! | measurements | `bench` |
//! | fits to measurements of a robot | `calibrate` |

mod analyze;
mod bench;
mod calibrate;
mod cli;
pub mod doctor;
mod error;
mod figures;
pub mod file;
mod know;
mod live;
mod log;
pub mod new;
mod run;
pub mod schema;
mod signals;
mod terminal;
mod tools;

pub use cli::program;
pub use error::{Failure, Paint, Place, Problem};
