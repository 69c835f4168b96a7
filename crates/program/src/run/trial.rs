//! Runs of a built-in scenario with other requests, for the tests of the whole system.

use std::sync::Arc;

use runtime::TimedRequest;
use types::messages::{Mode, Progress, Twist};
use types::{Duration, Pose};

use super::summary::Summary;
use super::{ClockChoice, One, Place, RunArgs, options, with_robots};
use crate::cli::run_args;
use crate::figures::{self, TaskOutcome, Told};

/// What came of it.
pub(super) struct Trial {
    pub(super) summary: Summary,
    /// Where the only robot truly was, and when (s).
    pub(super) way: Vec<(f64, Pose)>,
    /// The modes of the process supervisor (s).
    pub(super) modes: Told<Mode>,
    /// What the drive commanded (s).
    pub(super) commands: Told<Twist>,
}

/// Runs the reactive layer for so many seconds with these requests, each at its second.
pub(super) fn asked(name: &str, requests: &[(i64, &str)], seconds: i64) -> Summary {
    tried(name, requests, seconds).summary
}

/// The same, with what the log tells.
pub(super) fn tried(name: &str, requests: &[(i64, &str)], seconds: i64) -> Trial {
    let timed = |(at, text): &(i64, &str)| TimedRequest {
        at: Duration::secs(*at),
        words: text.split_whitespace().map(str::to_owned).collect(),
        place: Default::default(),
    };
    run(name, &["reactive"], Some(requests.iter().map(timed).collect()), seconds)
}

/// Runs a scenario as the command line says it, with its own requests or with these.
pub(super) fn run(name: &str, words: &[&str], requests: Option<Vec<TimedRequest>>, seconds: i64) -> Trial {
    let folder = std::env::temp_dir().join(format!("sinew-trial-{}-{name}", std::process::id()));
    let told = run_args(&[&["run"], words].concat());
    let args = RunArgs { limit: Some(Duration::secs(seconds)), ..told };
    let mut scenario = options::scenario(&args, with_robots(agents::registry())).unwrap();
    if let Some(requests) = requests {
        scenario.file.plan.requests = requests;
        // Its goal and its figures are of what it would have done by itself.
        scenario.file.plan.sections.remove("figure");
    }
    let ready = scenario.prepare(1).unwrap();
    let one = One {
        facts: None,
        args: &args,
        scenario: &scenario,
        seed: 1,
        clock: ClockChoice::Sim,
        watched: false,
        place: Some(Place::in_folder(folder.clone(), &args).unwrap()),
        asked_to_end: Arc::default(),
        serves: false,
        repeat: None,
        knowing: None,
    };
    let summary = one.run(ready).unwrap();
    let refused: Vec<_> = summary.incidents.iter().filter(|told| told.what.contains("refused")).collect();
    assert!(refused.is_empty(), "{refused:?}");
    let log = folder.join("run.mcap");
    let trial = Trial {
        way: figures::way(&log).unwrap(),
        modes: figures::told(&log, "/processes/mode").unwrap(),
        commands: figures::told(&log, "/drive/command").unwrap(),
        summary,
    };
    std::fs::remove_dir_all(folder).unwrap();
    trial
}

pub(super) fn ended(summary: &Summary, task: u32) -> &TaskOutcome {
    summary.tasks.iter().find(|known| known.task == task).unwrap_or_else(|| panic!("{:?}", summary.tasks))
}

pub(super) fn ends(summary: &Summary, task: u32, expected: Progress) -> &TaskOutcome {
    let task = ended(summary, task);
    assert_eq!(task.last.progress, expected, "{task:?}");
    task
}

pub(super) fn nothing_touched(summary: &Summary) {
    assert_eq!(summary.collisions(), Some(0), "{:?}", summary.tasks);
}
