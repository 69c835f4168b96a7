//! The scenarios that come with Sinew, each over ten seeds.

use serde_json::Value;

use super::{Done, reactive, sinew};
use crate::failure::Failure;
use crate::tool::Tool;
use crate::workspace::Workspace;

const SCENARIOS: [&str; 4] = ["exploration", "annex", "home", "landmarks"];
const SEEDS: usize = 10;

/// So many of the seeds must reach the goal; none may touch anything.
const ENOUGH: usize = 9;

pub(super) fn run(workspace: &Workspace) -> Result<Done, Failure> {
    let program = sinew::build(workspace)?;
    let mut seen = Vec::new();
    for name in SCENARIOS {
        let seeds = format!("1..{SEEDS}");
        let out = workspace.fresh_scratch(name)?;
        let words = ["run", name, "--seeds", &seeds, "--no-log", "--json", "--out"];
        let document =
            sinew::document(Tool::new(&program, &workspace.root).args(words).arg(&out), &remedy(name))?;
        let met = judge(&document).map_err(|what| Failure::new(format!("{name}: {what}"), remedy(name)))?;
        seen.push(format!("{name} {met} of {SEEDS}"));
    }
    let out = workspace.fresh_scratch("logged")?;
    let words = ["run", SCENARIOS[0], "--json", "--out"];
    let logged = Tool::new(&program, &workspace.root).args(words).arg(&out);
    let logged = sinew::document(logged, &remedy(SCENARIOS[0]))?;
    takes_no_memory(&logged).map_err(|what| Failure::new(what, remedy(SCENARIOS[0])))?;
    seen.push("no memory taken in real time".to_owned());
    let out = workspace.fresh_scratch("overload")?;
    let words = ["run", "overload", "--json", "--out"];
    let run =
        sinew::document(Tool::new(&program, &workspace.root).args(words).arg(&out), &remedy("overload"))?;
    keeps_in_time(&run)
        .and_then(|()| takes_no_memory(&run))
        .map_err(|what| Failure::new(what, remedy("overload")))?;
    if !out.join("bands.png").is_file() {
        return Err(Failure::new("overload: there is no figure bands.png".to_owned(), remedy("overload")));
    }
    seen.push("overload managed".to_owned());
    seen.push(reactive::run(workspace, &program)?);
    Ok(Done::Passed(seen.join(", ")))
}

/// Who must not miss a deadline, whatever there is to do.
const IN_TIME: [&str; 3] = ["safety", "drive", "sonar"];

/// Under overload those miss nothing, and the robot touches nothing.
fn keeps_in_time(run: &Value) -> Result<(), String> {
    for name in IN_TIME {
        let agent = run["agents"].as_array().into_iter().flatten().find(|agent| agent["name"] == name);
        match agent.and_then(|agent| agent["missed"].as_u64()) {
            Some(0) => {}
            Some(missed) => return Err(format!("{name} missed {missed} deadlines")),
            None => return Err(format!("the document does not tell what {name} missed")),
        }
    }
    if run["collisions"] != 0 {
        return Err(format!("collisions: {}", run["collisions"]));
    }
    let runs = run["compared"]["runs"].as_array().ok_or("the document compares nothing")?;
    let useful: Vec<f64> = runs.iter().filter_map(|run| run["useful"].as_f64()).collect();
    match useful[..] {
        [managed, none, ladder] if managed > none && managed > ladder => Ok(()),
        _ => Err(format!("useful work managed, not managed, with halved rates: {useful:?}")),
    }
}

/// No step of a real-time agent, nor its executor, may take or free memory.
fn takes_no_memory(run: &Value) -> Result<(), String> {
    match run["allocations"]["real_time"].as_u64() {
        Some(0) => Ok(()),
        Some(_) => {
            let by = &run["allocations"]["by"];
            Err(format!("seed {}: memory taken or freed in real time by {by}", run["seed"]))
        }
        None => Err(format!("seed {}: no \"allocations\" in the document", run["seed"])),
    }
}

fn remedy(name: &str) -> String {
    format!(
        "Look at one seed: cargo run --release -- run {name} --seed N; its figures lie in the folder that the summary names."
    )
}

/// How many seeds reached the goal, if they are enough and nothing was touched.
fn judge(document: &Value) -> Result<usize, String> {
    let runs =
        document["runs"].as_array().or_else(|| document.as_array()).ok_or("the document has no \"runs\"")?;
    if runs.len() != SEEDS {
        return Err(format!("{} runs instead of {SEEDS}", runs.len()));
    }
    for run in runs {
        takes_no_memory(run)?;
        match run["collisions"].as_u64() {
            Some(0) => {}
            Some(count) => return Err(format!("seed {}: {count} collisions", run["seed"])),
            None => return Err(format!("seed {}: no \"collisions\" in the document", run["seed"])),
        }
    }
    let missed: Vec<String> = runs
        .iter()
        .filter(|run| run["goal"]["met"] != true)
        .map(|run| {
            format!("seed {}: {}", run["seed"], run["goal"]["why"].as_str().unwrap_or("no reason given"))
        })
        .collect();
    let met = runs.len() - missed.len();
    if met >= ENOUGH {
        Ok(met)
    } else {
        Err(format!("{met} of {SEEDS} reached the goal\n{}", missed.join("\n")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn document(missed: usize, collisions: u64) -> Value {
        let run = |seed: usize| {
            json!({
                "seed": seed, "goal": {"met": seed > missed, "why": "stuck"}, "collisions": collisions,
                "allocations": {"real_time": 0, "by": {}},
            })
        };
        json!({"runs": (1..=SEEDS).map(run).collect::<Vec<_>>()})
    }

    #[test]
    fn enough_is_enough_and_one_less_is_not() {
        assert_eq!(judge(&document(0, 0)), Ok(SEEDS));
        assert_eq!(judge(&document(SEEDS - ENOUGH, 0)), Ok(ENOUGH));
        let refused = judge(&document(SEEDS - ENOUGH + 1, 0)).unwrap_err();
        assert!(refused.contains(" of 10 reached the goal\nseed 1: stuck\nseed 2"), "{refused}");
    }

    #[test]
    fn who_takes_memory_in_real_time_is_named() {
        let mut greedy = document(0, 0);
        greedy["runs"][3]["allocations"] = json!({"real_time": 2, "by": {"wall": 2}});
        assert!(judge(&greedy).unwrap_err().contains("{\"wall\":2}"));
        greedy["runs"][3]["allocations"] = Value::Null;
        assert!(judge(&greedy).unwrap_err().contains("no \"allocations\""), "nobody watched");
    }

    #[test]
    fn under_overload_who_misses_is_named() {
        let of = |missed: u64| {
            let agents: Vec<Value> = IN_TIME
                .iter()
                .map(|name| json!({"name": name, "missed": if *name == "drive" { missed } else { 0 }}))
                .collect();
            let runs = [0.9, 0.8, 0.85].map(|useful| json!({"useful": useful}));
            json!({"agents": agents, "collisions": 0, "compared": {"runs": runs}})
        };
        assert_eq!(keeps_in_time(&of(0)), Ok(()));
        let mut worse = of(0);
        worse["compared"]["runs"][2]["useful"] = json!(0.95);
        assert!(keeps_in_time(&worse).unwrap_err().contains("0.95"));
        assert_eq!(keeps_in_time(&of(2)).unwrap_err(), "drive missed 2 deadlines");
        assert!(keeps_in_time(&json!({"agents": [], "collisions": 0})).is_err(), "nobody is there");
    }

    #[test]
    fn one_collision_is_too_many_and_a_document_without_runs_is_no_success() {
        assert!(judge(&document(0, 1)).unwrap_err().contains("collisions"));
        for broken in [json!({}), json!({"runs": []}), json!([{"seed": 1}])] {
            assert!(judge(&broken).is_err(), "{broken}");
        }
    }
}
