//! The same plan and seed give the same bytes: on a busy machine, with faults and with what people ask meanwhile.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use serde_json::Value;

use super::live::Running;
use super::{Done, sinew};
use crate::failure::Failure;
use crate::tool::Tool;
use crate::workspace::Workspace;

const SCENARIOS: [&str; 2] = ["exploration", "annex"];
const REMEDY: &str = "A run is no longer determined by its plan, its seed and what was asked. `sinew run NAME --repeat LOG` says where two logs begin to differ.";

/// What is asked while a run goes: changes, faults, a stop with its reset, and what is refused.
const ASKED: [&str; 14] = [
    "fault wall panic",
    "set wall speed=0.4",
    "fault h1.sonar intermittent",
    "stop somebody in the way",
    "reset",
    "restart safety",
    "send coordinator.command linear.x=0.2",
    "add second is wall-follower robot=h1 period=100ms",
    "wire sonar.filtered second.ranges",
    "remove nobody",
    "fault second garbage",
    "remove second",
    "fault sonar hang",
    "replace wall is wall-follower speed=0.3",
];

/// How long a run goes in which things are asked; at its speed people have half a second for it.
const LIVE: &str = "20s";

pub(super) fn run(workspace: &Workspace) -> Result<Done, Failure> {
    let program = sinew::build(workspace)?;
    let scratch = workspace.fresh_scratch("repeat")?;
    let mut asked = 0;
    for name in SCENARIOS {
        let runs = ["once", "busy"].map(|folder| scratch.join(name).join(folder));
        whole(workspace, &program, name, &runs[0])?;
        while_busy(|| whole(workspace, &program, name, &runs[1]))?;
        same(name, &runs[0].join("run.mcap"), &runs[1].join("run.mcap"))?;
        // People end a run in these ways, and it may end by itself.
        for (round, end) in ["", "quit", "INT"].into_iter().enumerate() {
            let folder = scratch.join(name).join(format!("asked{round}"));
            live(&program, name, &folder, end)?;
            asked += again(workspace, &program, name, &folder)?;
        }
    }
    let recorded = recorded(workspace, &program, &scratch)?;
    let recorded = if recorded { ", a recording" } else { "" };
    Ok(Done::Passed(format!("{} scenarios, {asked} live requests{recorded}", SCENARIOS.len())))
}

/// A run until after its plan's own fault, which comes after 40 s.
fn whole(workspace: &Workspace, program: &Path, name: &str, out: &Path) -> Result<(), Failure> {
    let tool = Tool::new(program, &workspace.root)
        .args(["run", name, "--seed", "2", "--for", "60s", "--json", "--out"])
        .arg(out);
    sinew::document(tool, REMEDY).map(drop)
}

/// A run in which things are asked as they come, at instants that nobody chose.
fn live(program: &Path, name: &str, folder: &Path, end: &str) -> Result<(), Failure> {
    let words = [name, "--seed", "3", "--speed", "20", "--for", LIVE];
    let running = Running::start(program, folder, &words, REMEDY)?;
    let done = ASKED.iter().filter(|line| running.ask(&line.split(' ').collect::<Vec<_>>())).count();
    let ended = match end {
        "" => true,
        "quit" => running.ask(&["quit"]),
        signal => running.signal(signal),
    };
    // One of them is refused; a run that was over too soon refuses more.
    if done < ASKED.len() / 2 || !ended {
        return Err(Failure::new(
            format!("{name}: only {done} of {} requests were done", ASKED.len()),
            REMEDY,
        ));
    }
    running.end().map(drop)
}

/// Repeats a run from its log; says how many requests that had.
fn again(workspace: &Workspace, program: &Path, name: &str, folder: &Path) -> Result<u64, Failure> {
    let (log, out) = (Running::log(folder), folder.join("again"));
    let tool = Tool::new(program, &workspace.root).args(["run", name, "--for", LIVE, "--json", "--repeat"]);
    let document = sinew::document(tool.arg(&log).arg("--out").arg(&out), REMEDY)?;
    same(name, &log, &out.join("run.mcap"))?;
    judge(&document["repeat"]).map_err(|what| Failure::new(format!("{name}: {what}"), REMEDY))
}

/// What the program itself says of the repeated run.
fn judge(repeat: &Value) -> Result<u64, String> {
    let requests = repeat["requests"].as_u64().unwrap_or_default();
    match repeat["same"].as_bool() {
        Some(true) if requests > ASKED.len() as u64 / 2 => Ok(requests),
        Some(true) => Err(format!("only {requests} requests are in the log")),
        _ => Err(format!("the repeated run differs: {}", repeat["differs"])),
    }
}

fn same(name: &str, one: &Path, other: &Path) -> Result<(), Failure> {
    let bytes = |path: &Path| {
        std::fs::read(path).map_err(|error| Failure::new(format!("{}: {error}", path.display()), REMEDY))
    };
    if bytes(one)? == bytes(other)? {
        return Ok(());
    }
    Err(Failure::new(format!("{name}: {} and {} differ", one.display(), other.display()), REMEDY))
}

/// Does it while every processor has something else to do.
fn while_busy<T>(work: impl FnOnce() -> T) -> T {
    let over = AtomicBool::new(false);
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..processors {
            scope.spawn(|| {
                while !over.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        let done = work();
        over.store(true, Ordering::Relaxed);
        done
    })
}

/// A recording of a real robot, played twice. The recordings are no part of the repository.
fn recorded(workspace: &Workspace, program: &Path, scratch: &Path) -> Result<bool, Failure> {
    let folder = workspace.data().join("ticks");
    let Ok(entries) = std::fs::read_dir(folder) else { return Ok(false) };
    let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    files.sort();
    let Some(file) = files.first() else { return Ok(false) };
    let outs = ["recorded1", "recorded2"].map(|name| scratch.join(name));
    for out in &outs {
        let tool =
            Tool::new(program, &workspace.root).args(["run", "recorded", "--for", "20s", "--json", "--from"]);
        sinew::document(tool.arg(file).arg("--out").arg(out), REMEDY)?;
    }
    same("recorded", &outs[0].join("run.mcap"), &outs[1].join("run.mcap"))?;
    Ok(true)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_repeated_run_must_be_the_same_and_have_been_asked_something() {
        assert_eq!(judge(&json!({"same": true, "requests": 12})), Ok(12));
        assert!(judge(&json!({"same": true, "requests": 2})).unwrap_err().contains("only 2"));
        assert!(
            judge(&json!({"same": false, "requests": 12, "differs": "at 3s"})).unwrap_err().contains("3s")
        );
        assert!(judge(&json!(null)).is_err());
    }
}
