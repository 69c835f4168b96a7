//! Runs with a log of every message, and what is found in the file afterwards.

use std::path::PathBuf;

use record::log::RunInfo;
use runtime::{LogChoice, Options, Plan, Registry};

use crate::bench::outcome::Outcome;
use crate::bench::parcel::{self, live};
use crate::error::Failure;
use crate::run::{Asked, Facts, LogFile};

/// What became of the messages of a run.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Kept {
    /// Sent by all outputs.
    pub(super) sent: u64,
    /// Of those, in the file.
    pub(super) found: u64,
    /// Lost before a receiver or before the log.
    pub(super) lost: u64,
    /// The length of the file (bytes).
    pub(super) size: u64,
}

impl Kept {
    /// Whether every message is where it belongs.
    pub(super) fn is_all(&self) -> bool {
        self.lost == 0 && self.found == self.sent
    }

    /// Why the run does not count.
    pub(super) fn failure(&self) -> Option<Failure> {
        let Kept { sent, found, lost, .. } = self;
        let what = || format!("of {sent} messages {found} are in the log, and {lost} were dropped");
        (!self.is_all()).then(|| Failure::new(what()).code(1))
    }
}

/// A file that is gone when this is dropped.
struct Scratch(PathBuf);

impl Drop for Scratch {
    fn drop(&mut self) {
        // What cannot be removed is left to whoever cleans the temporary folder.
        let _ = std::fs::remove_file(&self.0);
    }
}

/// Runs a plan with a log of all that is sent, and counts what is in it.
pub(super) fn run(
    plan: &Plan,
    registry: &Registry,
    options: Options,
    outcome: &mut Outcome,
) -> Result<Kept, Failure> {
    let path = std::env::temp_dir().join(format!("sinew-bench-{}.mcap", std::process::id()));
    let scratch = Scratch(path);
    let failed = |error: &dyn std::fmt::Display| Failure::new(error.to_string()).code(1);
    let info = RunInfo { system: plan.name.clone(), ..RunInfo::default() };
    let (file, written) = LogFile::create(&scratch.0, &info, 0.0, Facts::default(), Asked::default())
        .map_err(|error| failed(&error))?;
    let options = Options { recorder: Some(Box::new(file)), log: LogChoice::by(|_, _| 1), ..options };
    let report = parcel::run(live(plan, registry, options)?, outcome)?;
    let errors = written.lock().map(|written| written.errors.clone()).unwrap_or_default();
    if let Some(error) = errors.first() {
        return Err(failed(error));
    }
    let info = record::log::info(&scratch.0).map_err(|error| failed(&error))?;
    let outputs: Vec<(String, u64)> = report
        .view
        .agents
        .iter()
        .flat_map(|agent| {
            agent.ports.iter().map(|port| (format!("/{}/{}", agent.name, port.name), port.sent))
        })
        .collect();
    let found = |topic: &String| info.topics.iter().find(|found| found.topic == *topic);
    Ok(Kept {
        sent: outputs.iter().map(|(_, sent)| sent).sum(),
        found: outputs.iter().filter_map(|(topic, _)| found(topic)).map(|topic| topic.messages).sum(),
        lost: report.log_dropped
            + report.view.wires.iter().map(|wire| wire.replaced + wire.dropped + wire.refused).sum::<u64>(),
        size: std::fs::metadata(&scratch.0).map_or(0, |data| data.len()),
    })
}
