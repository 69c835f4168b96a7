//! What a system knows from one run to the next, in one file: decision tables, facts, patterns, schedules and maps.
//!
//! | to find | look in |
//! |---|---|
//! | opening, writing, removing | [`Knowledge`] |
//! | reading, all from one moment | [`Snapshot`] |
//! | what is kept | [`DecisionTable`], [`Fact`], [`Pattern`], [`Schedule`], [`Map`] |
//! | which schedules are due, on any clock | [`due`] |
//! | a pattern as the colours that an agent looks for | [`colours`] |
//! | what can go wrong, and how it is mended | [`KnowledgeError`] |
//!
//! ```
//! # fn main() -> Result<(), knowledge::KnowledgeError> {
//! use knowledge::{Fact, Knowledge, Query};
//! use types::Time;
//!
//! # let folder = std::env::temp_dir().join(format!("sinew-knowledge-doc-{}", std::process::id()));
//! # std::fs::create_dir_all(&folder).unwrap();
//! # let file = folder.join("knowledge.db");
//! let mut knowledge = Knowledge::open(&file)?;
//! knowledge.put(Fact::new("cup", "in", "kitchen", Time::ZERO))?;
//! let facts = knowledge.read()?.facts(&Query::of(["_", "in", "kitchen"]))?;
//! assert_eq!(facts[0].subject, "cup");
//! # drop(knowledge);
//! # std::fs::remove_dir_all(&folder).unwrap();
//! # Ok(())
//! # }
//! ```
//!
//! # What holds
//!
//! - A write that was answered with `Ok` is on the disk: it outlives the end of the process and of the power.
//! - A write is done whole or not at all; so is [`Knowledge::put_all`].
//! - One writes at a time, over all processes; a writer waits for another at most [`PATIENCE`]. Readers neither wait nor are waited for.
//! - Each row has a sum: a byte that changed is told, and nothing else is read in its place.
//! - A file that is damaged, foreign or too new is told and left as it is.
//! - Nothing here reads a clock: times come in as arguments.
//!
//! All of it waits for the disk: it is for ordinary threads, never for one in real time. The file lies on a local disk, since
//! computers that share one over a network would spoil it.
#![forbid(unsafe_code)]

mod colour;
mod cron;
mod date;
mod error;
mod fact;
mod item;
mod layout;
mod map;
mod pattern;
mod schedule;
mod seal;
mod snapshot;
mod store;
mod table;
mod text;

pub use colour::{NoColour, colours};
pub use cron::{Cron, NotCron};
pub use date::{Date, NotADate};
pub use error::KnowledgeError;
pub use fact::{Fact, Query, Reach, Reached};
pub use item::{Item, Kind, Listed};
pub use map::Map;
pub use pattern::{Pattern, PatternKind};
pub use schedule::{Schedule, When, due};
pub use snapshot::Snapshot;
pub use store::{Knowledge, PATIENCE};
pub use table::{DecisionTable, Version};
