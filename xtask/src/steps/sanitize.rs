//! The threads of the runtime under ThreadSanitizer, which sees accesses to memory that no order makes safe; and those in real time under
//! another one, see [`realtime`].

use std::path::Path;

use super::cargo::tests_run;
use super::{Done, realtime};
use crate::failure::Failure;
use crate::tool::Tool;
use crate::workspace::Workspace;

/// What the compiler must be told.
const FLAGS: &str = "-Zsanitizer=thread -Cunsafe-allow-abi-mismatch=sanitizer";
const REMEDY: &str = "Both accesses, the memory and the threads stand in the files that are named. A race is one even where it never did harm.";

/// What orders its memory by itself. The rest does so by locks and channels of the standard library, which was built without the
/// sanitizer: what these order looks like a race to it.
const LOCK_FREE: [&str; 15] = [
    "context.rs",
    "door.rs",
    "executor.rs",
    "executor/",
    "handover.rs",
    "memory.rs",
    "port.rs",
    "port/",
    "processor.rs",
    "queue.rs",
    "queue/",
    "ring.rs",
    "stats.rs",
    "trace.rs",
    "witness.rs",
];
/// Counts bytes, and those of the sanitizer with them.
const NOT_HERE: &str = "ten_thousand_changes";

pub(super) fn run(workspace: &Workspace) -> Result<Done, Failure> {
    let nightly = || Tool::new("rustup", &workspace.root).args(["run", "nightly"]);
    if !nightly().args(["rustc", "--version"]).works() {
        return Ok(Done::Skipped(
            "sanitizers need a nightly compiler: rustup toolchain install nightly".to_owned(),
        ));
    }
    // The quicker one first.
    let blocked = realtime::run(workspace, &nightly)?;
    println!("  {blocked} tests and a robot without a call that blocks in real time");
    let reports = workspace.fresh_scratch("sanitize")?;
    // Races are told when all is done: those that the standard library seems to have must not end a test.
    let options = format!("halt_on_error=0 exitcode=0 log_path={}", reports.join("race").display());
    let words =
        ["cargo", "test", "--quiet", "--target", &workspace.host, "-p", "sinew-runtime", "--lib", "--tests"];
    let tests =
        nightly().args(words).args(["--", "--test-threads=1", "--skip", NOT_HERE]).flags("RUSTFLAGS", FLAGS);
    let tests = tests.env("CARGO_TARGET_DIR", workspace.target.join("sanitize")).env("TSAN_OPTIONS", options);
    let ran = tests_run(&tests.text(REMEDY)?);
    if ran == 0 {
        return Err(Failure::new("no test was run", REMEDY));
    }
    let text =
        all(&reports).map_err(|error| Failure::new(format!("{}: {error}", reports.display()), REMEDY))?;
    let races = races(&text);
    if races.is_empty() {
        let what = format!(
            "{ran} tests without a race, {blocked} and a robot without a call that blocks in real time"
        );
        return Ok(Done::Passed(what));
    }
    Err(Failure::new(format!("races, told in {}:\n{}", reports.display(), races.join("\n")), REMEDY))
}

/// What stands in all files of a folder.
fn all(folder: &Path) -> std::io::Result<String> {
    let mut text = String::new();
    for entry in std::fs::read_dir(folder)? {
        text += &String::from_utf8_lossy(&std::fs::read(entry?.path())?);
    }
    Ok(text)
}

/// The reports in which one of both accesses is made by what orders its memory by itself: where, once each.
fn races(text: &str) -> Vec<String> {
    let mut races: Vec<String> = text
        .split("==================")
        .filter(|report| report.contains("WARNING: ThreadSanitizer"))
        .filter_map(|report| {
            // The two accesses stand first; what follows tells where the memory and the threads come from.
            let ours: Vec<&str> = report.split("\n\n").take(2).filter_map(nearest).collect();
            ours.iter().any(|place| is_lock_free(place)).then(|| ours.join(" and "))
        })
        .collect();
    races.sort();
    races.dedup();
    races
}

/// The first place of the runtime in a stack, from its `src` on.
fn nearest(stack: &str) -> Option<&str> {
    let frames = stack.lines().filter(|line| line.trim_start().starts_with('#'));
    let mut ours = frames.filter_map(|line| line.split_once("crates/runtime/src/").map(|(_, place)| place));
    ours.next().map(|place| place.split(' ').next().unwrap_or(place))
}

fn is_lock_free(place: &str) -> bool {
    LOCK_FREE.iter().any(|file| place.starts_with(file))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(one: &str, other: &str) -> String {
        let stack = |file: &str| {
            format!(
                "    #0 memcpy std/x.rs:1 (t+0x1)\n    #1 push clone/crates/runtime/src/{file} (t+0x2)\n    #2 f clone/crates/runtime/src/ring.rs:1:1 (t+0x3)"
            )
        };
        format!(
            "==================\nWARNING: ThreadSanitizer: data race (pid=1)\n  Write:\n{}\n\n  Previous read:\n{}\n\n  Thread:\n{}\n==================\n",
            stack(one),
            stack(other),
            stack("door.rs:9:9")
        )
    }

    #[test]
    fn races_of_locks_that_were_built_without_the_sanitizer_are_none_of_ours() {
        assert_eq!(races(&report("system.rs:42:19", "wall.rs:285:29")), [""; 0]);
        let ours = report("ring.rs:7:9", "system.rs:42:19");
        assert_eq!(races(&format!("{ours}{ours}")), ["ring.rs:7:9 and system.rs:42:19"]);
        assert_eq!(races(&report("log.rs:1:1", "port/input.rs:4:1")).len(), 1);
    }
}
