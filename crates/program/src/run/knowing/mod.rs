//! What a run knows from the runs before it: a store that it reads.
//!
//! ```text
//!   store ──take──▶ Known ──┬─▶ plan: the decision maker's table, the patterns of agents
//!     │       ▲             ├─▶ schedules that fire, as timed requests
//!     │       │             └─▶ note ──▶ log
//!     │       └── a repeated run has it from the log
//!     └── Watch, ten times a second ──▶ Control: the table when it is another one; on the wall clock, what is due
//! ```
//!
//! In simulated time all that a run knows at its start is in its log, and what it learns later is asked of it as people ask: so a run
//! can be repeated, whatever became of the store.

mod firing;
mod known;
mod take;
#[cfg(test)]
mod tests;
mod watch;

use std::path::PathBuf;
use std::sync::Arc;

use knowledge::Schedule;
use runtime::Control;
use types::Duration;
use types::value::Value;

use super::asked::{Asked, Repeat};
use super::prepare::Scenario;
use crate::cli::{ClockChoice, RunArgs};
use crate::error::Failure;
use crate::file::knowledge::{Section, section};
use known::Known;

pub(crate) use firing::{Firing, is_schedule};
pub(crate) use watch::Looking;

/// The name of the note in a log that holds what the run knew at its start.
pub(super) const NOTE: &str = "knowledge";

/// Says something to people.
type Tell = Arc<dyn Fn(&str) + Send + Sync>;

/// What a run knows, and from where.
#[derive(Clone)]
pub(crate) struct Knowing {
    store: PathBuf,
    section: Section,
    known: Known,
    /// The whole system, and the types of its agents.
    system: Scenario,
    /// The schedules whose words are right.
    schedules: Vec<Schedule>,
    /// Whether the store is looked at while the run goes.
    live: bool,
    tell: Tell,
}

/// The changes of the command line to the system file: the store that it names is one of them. The plan, and with it the log, keeps
/// the name of the file and not where it lies.
pub(super) fn sets(args: &RunArgs) -> Vec<String> {
    let name = args.know.as_ref().map(|path| path.file_name().unwrap_or(path.as_os_str()).to_string_lossy());
    let set = name.map(|name| format!("knowledge.file={}", Value::from(name.into_owned())));
    args.set.iter().cloned().chain(set).collect()
}

/// Reads the store that a system names, or what a repeated log has of it, and puts into the plan what belongs there. A system without
/// a store is left as it is.
///
/// # Errors
/// With its place in the system file, what keeps the store from being read; and what is wrong with what it holds.
pub(super) fn begin(
    scenario: Scenario,
    repeat: Option<&Repeat>,
    tell: impl Fn(&str) + Send + Sync + 'static,
) -> Result<(Scenario, Option<Knowing>), Failure> {
    let Some(section) = section(&scenario.file.plan) else { return Ok((scenario, None)) };
    let store = scenario.file.store.clone().unwrap_or_default();
    let known = match repeat {
        Some(repeat) => Known::of_note(repeat.known.as_deref().unwrap_or_default()).ok_or_else(|| {
            Failure::new(format!("{}: what the run knew cannot be read", repeat.path.display()))
        })?,
        None => take::take(&scenario, &section, &store, &tell)?,
    };
    let scenario = take::put_into(&known, scenario, &section, &store)?;
    let (schedules, left_out) = firing::judged(&known.schedules);
    left_out.iter().for_each(|text| tell(&format!("warning: {text}")));
    let (live, system) = (repeat.is_none(), scenario.clone());
    let knowing = Knowing { store, section, known, system, schedules, live, tell: Arc::new(tell) };
    Ok((scenario, Some(knowing)))
}

impl Knowing {
    /// The same, for a run that does not look at the store again.
    pub(super) fn still(&self) -> Knowing {
        Knowing { live: false, ..self.clone() }
    }

    /// What is known, for the log: its name and its text.
    pub(super) fn note(&self) -> (String, String) {
        (NOTE.to_owned(), self.known.to_note())
    }

    /// All that schedules ask in a simulated run. On the wall clock they are asked as they become due.
    pub(super) fn firings(&self, clock: ClockChoice, limit: Option<Duration>) -> Vec<Firing> {
        if clock == ClockChoice::Wall {
            return Vec::new();
        }
        let (firings, until) = firing::firings(&self.schedules, self.section.begins, limit);
        if let Some(until) = until {
            (self.tell)(&format!("warning: the schedules fire until {until} of the run, and not after that"));
        }
        firings
    }

    /// Looks at the store while a run goes, until what is given back is dropped. A run without that is still a run, so what goes wrong is
    /// told and no more.
    pub(super) fn look(&self, control: &Control, asked: &Asked, clock: ClockChoice) -> Option<Looking> {
        if !self.live {
            return None;
        }
        let started = watch::start(self, control, asked, clock);
        started.map_err(|why| (self.tell)(&format!("warning: {why}; this run learns nothing new"))).ok()
    }
}
