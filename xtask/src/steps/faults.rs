//! Every fault on every sensor and agent of the exploration: the robot may give up, but it touches nothing.

use std::fmt;
use std::path::Path;

use serde_json::Value;

use super::{Done, sinew};
use crate::failure::Failure;
use crate::tool::Tool;
use crate::workspace::Workspace;

/// The scenario, and when it is that something fails.
const SCENARIO: &str = "exploration";
const AT: &str = "45s";
/// What can fail: outputs of the robot, and agents.
const SENSORS: [&str; 4] = ["h1.sonar", "h1.ticks", "h1.image", "h1.head"];
const AGENTS: [&str; 11] = [
    "h1",
    "sonar",
    "odometry",
    "camera",
    "safety",
    "wall",
    "track",
    "decision",
    "coordinator",
    "drive",
    "head",
];
/// How it can: what is sent, and for agents also how they step.
const OF_OUTPUTS: [&str; 6] = ["off", "stuck", "garbage", "wrong", "delayed", "intermittent"];
const OF_STEPS: [&str; 3] = ["slow", "panic", "hang"];

/// What did lead to a touch once: always tried, each with the seeds that showed it.
const KNOWN: [(&str, &str, &str); 10] = [
    ("drive", "stuck", "14..15"),
    ("drive", "stuck", "21..23"),
    ("coordinator", "stuck", "15..15"),
    ("odometry", "stuck", "13..13"),
    ("odometry", "intermittent", "3..3"),
    ("h1.sonar", "wrong", "10..15"),
    ("wall", "wrong", "3..3"),
    ("h1", "stuck", "2..2"),
    ("safety", "slow", "4..4"),
    ("sonar", "wrong", "15..15"),
];
/// A robot that has not moved for so long has given up, and its run is over.
const PATIENCE: &str = "60s";

/// So many of all cells, with so many seeds each, are tried by the usual test.
const SAMPLE: (usize, u64) = (8, 2);
/// So many seeds each where everything is tried.
const SEEDS: u64 = 20;
/// Names what is tried: "all", or the number of another sample.
const CHOICE: &str = "SINEW_FAULTS";

pub(super) fn run(workspace: &Workspace) -> Result<Done, Failure> {
    let program = sinew::build(workspace)?;
    let scratch = workspace.fresh_scratch("faults")?;
    let choice = std::env::var(CHOICE).unwrap_or_default();
    let (cells, seeds) = chosen(&choice).ok_or_else(|| {
        Failure::new(
            format!("{CHOICE} is \"{choice}\""),
            "It is \"all\", or the number of a sample, as in 7.",
        )
    })?;
    let all = format!("1..{seeds}");
    let drawn = cells.iter().map(|(target, kind)| (*target, *kind, all.as_str()));
    let mut sum = Seen::default();
    let mut touched = Vec::new();
    for (target, kind, seeds) in drawn.chain(KNOWN) {
        let file = system(workspace, &scratch, target, kind)?;
        let words = ["--seeds", seeds, "--no-log", "--give-up", PATIENCE, "--json"];
        let tool = Tool::new(&program, &workspace.root).arg("run").arg(&file).args(words);
        let document = sinew::document(tool, &remedy(target, kind))?;
        let seen = judge(&document, target, kind).map_err(|what| Failure::new(what, remedy(target, kind)))?;
        touched.extend(seen.collided.iter().map(|seed| (target, kind, *seed)));
        println!("  fault {target} {kind}, seeds {seeds}: {seen}");
        sum.add(seen);
    }
    if let Some((target, kind, _)) = touched.first() {
        let list: Vec<String> = touched
            .iter()
            .map(|(target, kind, seed)| format!("fault {target} {kind}, seed {seed}"))
            .collect();
        return Err(Failure::new(format!("collisions:\n{}", list.join("\n")), remedy(target, kind)));
    }
    Ok(Done::Passed(sum.to_string()))
}

fn remedy(target: &str, kind: &str) -> String {
    format!(
        "An agent trusts what it should not, or waits for what does not come. Write [[at]] with do = \"fault {target} {kind}\" into a copy of the scenario and look at that seed."
    )
}

/// All that can happen.
fn all() -> Vec<(&'static str, &'static str)> {
    let pairs = |target: &'static str, kinds: &[&'static str]| {
        kinds.iter().map(move |kind| (target, *kind)).collect::<Vec<_>>()
    };
    let sensors = SENSORS.iter().flat_map(|target| pairs(target, &OF_OUTPUTS));
    let agents =
        AGENTS.iter().flat_map(|target| [pairs(target, &OF_OUTPUTS), pairs(target, &OF_STEPS)].concat());
    sensors.chain(agents).collect()
}

/// What is tried, and over how many seeds.
fn chosen(choice: &str) -> Option<(Vec<(&'static str, &'static str)>, u64)> {
    let all = all();
    if choice == "all" {
        return Some((all, SEEDS));
    }
    let sample: usize = if choice.is_empty() { 0 } else { choice.parse().ok()? };
    // Steps of a length that shares no divisor with the number of cells, so that samples go through all of them in turn.
    let step = (37..).find(|step| !all.len().is_multiple_of(*step))?;
    let places =
        (0..SAMPLE.0).map(|i| (sample.wrapping_mul(SAMPLE.0).wrapping_add(i)).wrapping_mul(step) % all.len());
    Some((places.map(|place| all[place]).collect(), SAMPLE.1))
}

/// The scenario with this fault in place of its own.
fn system(
    workspace: &Workspace,
    scratch: &Path,
    target: &str,
    kind: &str,
) -> Result<std::path::PathBuf, Failure> {
    let failed = |path: &Path, error: std::io::Error| {
        Failure::new(format!("{}: {error}", path.display()), "Is the clone whole?")
    };
    let path = workspace.root.join("scenarios").join(format!("{SCENARIO}.toml"));
    let text = std::fs::read_to_string(&path).map_err(|error| failed(&path, error))?;
    let plan = text.split("[[at]]").next().unwrap_or_default();
    let file = scratch.join(format!("{target}-{kind}.toml"));
    let text = format!("{plan}\n[[at]]\ntime = \"{AT}\"\ndo = \"fault {target} {kind}\"\n");
    std::fs::write(&file, text).map_err(|error| failed(&file, error))?;
    Ok(file)
}

/// What became of runs.
#[derive(Debug, Default, PartialEq)]
struct Seen {
    runs: u64,
    /// Those that reached the goal all the same.
    met: u64,
    /// Those that ended with the latch set.
    latched: u64,
    /// The seeds of those that touched something.
    collided: Vec<u64>,
}

impl Seen {
    fn add(&mut self, other: Seen) {
        self.runs += other.runs;
        self.met += other.met;
        self.latched += other.latched;
        self.collided.extend(other.collided);
    }
}

impl fmt::Display for Seen {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Seen { runs, met, latched, collided } = self;
        write!(
            out,
            "{runs} runs: {met} reach the goal, {latched} are latched, {} touch something",
            collided.len()
        )
    }
}

/// What became of each seed; the summary must say what was done to it, and what came of that.
fn judge(document: &Value, target: &str, kind: &str) -> Result<Seen, String> {
    let runs =
        document["runs"].as_array().filter(|runs| !runs.is_empty()).ok_or("the document has no \"runs\"")?;
    let mut seen = Seen::default();
    for run in runs {
        let seed = run["seed"].as_u64().unwrap_or_default();
        let words = format!("asked: fault {target} {kind}");
        let told = run["incidents"].as_array().is_some_and(|all| {
            all.iter().any(|one| one["what"] == words.as_str() && one["effect"].is_string())
        });
        // One that reached its goal before had no fault.
        if !told && run["time_s"].as_f64() > Some(45.0) {
            return Err(format!("seed {seed}: the summary does not tell of the fault {target} {kind}"));
        }
        match run["collisions"].as_u64() {
            Some(0) => {}
            Some(_) => seen.collided.push(seed),
            None => return Err(format!("seed {seed}: no \"collisions\" in the document")),
        }
        seen.runs += 1;
        seen.met += u64::from(run["goal"]["met"] == true);
        seen.latched += u64::from(run["robots"][0]["latched"] == true);
    }
    Ok(seen)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;
    use std::collections::BTreeSet;

    #[test]
    fn samples_go_through_all_that_can_happen() {
        let all: BTreeSet<_> = all().into_iter().collect();
        assert_eq!(
            all.len(),
            SENSORS.len() * OF_OUTPUTS.len() + AGENTS.len() * (OF_OUTPUTS.len() + OF_STEPS.len())
        );
        let samples = all.len().div_ceil(SAMPLE.0);
        let seen: BTreeSet<_> = (0..samples).flat_map(|n| chosen(&n.to_string()).unwrap().0).collect();
        assert_eq!(seen, all);
        assert_eq!(chosen("all").unwrap().0.len(), all.len());
        assert!(chosen("some").is_none());
    }

    #[test]
    fn a_collision_and_a_silent_summary_are_seen() {
        let run = |what: &str, collisions: u64| {
            json!({"seed": 3, "time_s": 90.0, "collisions": collisions, "goal": {"met": true}, "robots": [{"latched": true}],
                "incidents": [{"what": what, "effect": "it went on for 3.1 m"}]})
        };
        let judged = |run| judge(&json!({"runs": [run]}), "wall", "off");
        let seen = |collided: &[u64]| Seen { runs: 1, met: 1, latched: 1, collided: collided.to_vec() };
        assert_eq!(judged(run("asked: fault wall off", 0)), Ok(seen(&[])));
        assert_eq!(judged(run("asked: fault wall off", 1)), Ok(seen(&[3])));
        assert!(judged(run("asked: fault wall stuck", 0)).unwrap_err().contains("does not tell"));
        let mut silent = run("asked: fault wall off", 0);
        silent["incidents"][0]["effect"].take();
        assert!(judged(silent).unwrap_err().contains("does not tell"));
        assert!(judge(&json!({}), "wall", "off").is_err());
    }
}
