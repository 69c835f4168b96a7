//! Every fault on every sensor and agent of the exploration: the robot may give up, but it touches nothing.

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

/// What leads to a touch now and then: between the drive and the gate stands nobody who knows what is around, and a command that stays the
/// same looks like any other. The bumper ends it; a second touch would be a fault of the gate.
const OPEN: [(&str, &str); 1] = [("drive", "stuck")];

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
    let mut met = 0;
    let mut touched = Vec::new();
    for (target, kind) in &cells {
        let file = system(workspace, &scratch, target, kind)?;
        let range = format!("1..{seeds}");
        let words = ["--seeds", &range, "--no-log", "--json"];
        let tool = Tool::new(&program, &workspace.root).arg("run").arg(&file).args(words);
        let document = sinew::document(tool, &remedy(target, kind))?;
        let seen = judge(&document, target, kind).map_err(|what| Failure::new(what, remedy(target, kind)))?;
        met += seen.met;
        touched.extend(seen.collided.into_iter().map(|seed| (*target, *kind, seed)));
    }
    if let Some((target, kind, _)) = touched.first() {
        let list: Vec<String> = touched
            .iter()
            .map(|(target, kind, seed)| format!("fault {target} {kind}, seed {seed}"))
            .collect();
        return Err(Failure::new(format!("collisions:\n{}", list.join("\n")), remedy(target, kind)));
    }
    let runs = cells.len() as u64 * seeds;
    Ok(Done::Passed(format!(
        "{} faults over {seeds} seeds, {met} of {runs} runs reach the goal all the same",
        cells.len()
    )))
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

#[derive(Debug, PartialEq)]
struct Seen {
    met: u64,
    collided: Vec<u64>,
}

/// Which seeds touched something; the summary must say what was done to each.
fn judge(document: &Value, target: &str, kind: &str) -> Result<Seen, String> {
    let runs =
        document["runs"].as_array().filter(|runs| !runs.is_empty()).ok_or("the document has no \"runs\"")?;
    let mut seen = Seen { met: 0, collided: Vec::new() };
    for run in runs {
        let seed = run["seed"].as_u64().unwrap_or_default();
        let words = format!("asked: fault {target} {kind}");
        let told = run["incidents"]
            .as_array()
            .is_some_and(|all| all.iter().any(|one| one["what"] == words.as_str()));
        // One that reached its goal before had no fault.
        if !told && run["time_s"].as_f64() > Some(45.0) {
            return Err(format!("seed {seed}: the summary does not tell of the fault {target} {kind}"));
        }
        match run["collisions"].as_u64() {
            Some(0) => {}
            Some(1) if OPEN.contains(&(target, kind)) && run["robots"][0]["latched"] == true => {}
            Some(_) => seen.collided.push(seed),
            None => return Err(format!("seed {seed}: no \"collisions\" in the document")),
        }
        seen.met += u64::from(run["goal"]["met"] == true);
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
        let run = |what: &str, collisions: u64| json!({"seed": 3, "time_s": 90.0, "collisions": collisions, "goal": {"met": true}, "incidents": [{"what": what}]});
        let judged = |run| judge(&json!({"runs": [run]}), "wall", "off");
        assert_eq!(judged(run("asked: fault wall off", 0)), Ok(Seen { met: 1, collided: vec![] }));
        assert_eq!(judged(run("asked: fault wall off", 1)), Ok(Seen { met: 1, collided: vec![3] }));
        let open = |collisions: u64, latched: bool| {
            let mut run = run("asked: fault drive stuck", collisions);
            run["robots"] = json!([{"latched": latched}]);
            judge(&json!({"runs": [run]}), "drive", "stuck").unwrap().collided
        };
        assert_eq!((open(1, true), open(1, false), open(2, true)), (vec![], vec![3], vec![3]));
        assert!(judged(run("asked: fault wall stuck", 0)).unwrap_err().contains("does not tell"));
        assert!(judge(&json!({}), "wall", "off").is_err());
    }
}
