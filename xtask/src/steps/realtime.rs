//! The threads in real time under RealtimeSanitizer, which sees each call that can block: memory, locks, files, sleep.

use std::collections::BTreeSet;

use super::cargo::tests_run;
use crate::failure::Failure;
use crate::tool::Tool;
use crate::workspace::Workspace;

/// What the compiler must be told.
const FLAGS: &str = "-Zsanitizer=realtime --cfg rtsan";
/// All reports, not the first alone.
const OPTIONS: &str = "halt_on_error=0:print_stats_on_exit=0";
const REMEDY: &str = "Between two sleeps a thread in real time waits for nobody: make room at the start, or hand the work to another thread. \
Each call stands above with what called it, nearest first.";

/// A call is as it should be below a function of such a name, and why.
const MAY: [(&str, &str); 6] = [
    ("futex_wake", "who wakes another thread does not wait for it"),
    ("Body>::start", "an agent may take memory before its first step"),
    ("Body>::stop", "the last that an agent does is no step"),
    ("Body>::take_over", "nor is the first, in the place of another"),
    ("panicking::panic", "a step that panics is the agent's last; it takes memory for that"),
    ("__rust_panic_cleanup", "as before"),
];
/// Counts what goes by and hands it on: the caller is meant.
const BETWEEN: [&str; 2] = ["runtime/src/allocations.rs", "runtime/tests/system/memory.rs"];
/// Agents of the tests do as they like.
const TESTS: &str = "runtime/tests/";
/// What agents do that block on purpose: in real time, where it must be seen, and elsewhere, where it must not.
const SEEN: [&str; 2] = ["opens_a_file_in_real_time", "takes_memory_in_real_time"];
const UNSEEN: &str = "opens_a_file_where_it_may";

/// Runs the systems of the tests, and a robot on the wall clock. Says how many tests that were.
pub(super) fn run(workspace: &Workspace, nightly: &dyn Fn() -> Tool) -> Result<u64, Failure> {
    let built = |words: &[&str]| {
        let tool = nightly().args(["cargo"]).args(words).args(["--quiet", "--target", &workspace.host]);
        let tool = tool.flags("RUSTFLAGS", FLAGS).env("RTSAN_OPTIONS", OPTIONS);
        tool.env("CARGO_TARGET_DIR", workspace.target.join("realtime"))
    };
    let tests = built(&["test"]).args(["-p", "sinew-runtime", "--test", "system", "--", "--test-threads=1"]);
    let (passed, said, told) = tests.heard()?;
    let ran = tests_run(&said);
    if !passed || ran == 0 {
        return Err(Failure::new(
            format!("{ran} tests passed under RealtimeSanitizer, and others did not\n{said}"),
            REMEDY,
        ));
    }
    tests_are_seen(&told).map_err(|what| Failure::new(what, REMEDY))?;
    none(&told)?;
    built(&["build"]).args(["-p", "sinew-cli"]).run("The program does not build for the sanitizer.")?;
    let program = workspace.target.join("realtime").join(&workspace.host).join("debug/sinew");
    let out = workspace.fresh_scratch("realtime")?;
    let words = ["run", "exploration", "--seed", "4", "--clock", "wall", "--for", "10s", "--json", "--out"];
    let (_, said, told) =
        Tool::new(program, &workspace.root).args(words).arg(out).env("RTSAN_OPTIONS", OPTIONS).heard()?;
    if !said.contains("\"time_s\"") {
        return Err(Failure::new(format!("the robot did not run under RealtimeSanitizer\n{told}"), REMEDY));
    }
    none(&told)?;
    Ok(ran)
}

/// Whether the agents that block on purpose were seen where they may not, and only there.
fn tests_are_seen(told: &str) -> Result<(), String> {
    if let Some(missing) = SEEN.iter().find(|name| !told.contains(**name)) {
        return Err(format!(
            "an agent that blocks on purpose ({missing}) was not seen: the sanitizer sees nothing"
        ));
    }
    if told.contains(UNSEEN) {
        return Err(format!("an agent that is not in real time ({UNSEEN}) was taken for one"));
    }
    Ok(())
}

fn none(told: &str) -> Result<(), Failure> {
    let blocking = blocking(told);
    if blocking.is_empty() {
        return Ok(());
    }
    Err(Failure::new(format!("threads in real time could block:\n{}", blocking.join("\n")), REMEDY))
}

/// The calls that are not as they should be: which, and through which of our functions; once each.
fn blocking(told: &str) -> Vec<String> {
    let reports = told.split("ERROR: RealtimeSanitizer").skip(1);
    let found = reports.filter_map(|report| {
        let call = report.split('`').nth(1).unwrap_or("a call");
        let stack: Vec<&str> =
            report.lines().skip_while(|line| !is_frame(line)).take_while(|line| is_frame(line)).collect();
        if stack.iter().any(|frame| MAY.iter().any(|(name, _)| frame.contains(name))) {
            return None;
        }
        let places = stack.iter().filter_map(|frame| frame.split_once("/crates/").map(|(_, place)| place));
        let ours: Vec<&str> = places
            .filter(|place| !BETWEEN.iter().any(|between| place.starts_with(between)))
            .take(3)
            .collect();
        let of_a_test = ours.first().is_some_and(|place| place.starts_with(TESTS));
        (!of_a_test).then(|| format!("  {call}: {}", ours.join(", from ")))
    });
    found.collect::<BTreeSet<String>>().into_iter().collect()
}

fn is_frame(line: &str) -> bool {
    line.trim_start().starts_with('#')
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(call: &str, frames: &[&str]) -> String {
        let frames: Vec<String> =
            frames.iter().enumerate().map(|(n, frame)| format!("    #{n} 0x5 in {frame}\n")).collect();
        format!(
            "==7==ERROR: RealtimeSanitizer: unsafe-library-call\nIntercepted call to real-time unsafe function `{call}` in real-time context!\n{}\nSUMMARY: x\n",
            frames.concat()
        )
    }

    #[test]
    fn a_call_is_told_once_with_who_made_it_and_the_allocator_between_is_no_caller() {
        let one = report(
            "malloc",
            &[
                "malloc rtsan.cpp:1",
                "alloc /w/crates/runtime/src/allocations.rs:3:4",
                "send /w/crates/runtime/src/port.rs:5:6",
                "step /w/crates/agents/src/map.rs:7:8",
            ],
        );
        let expected = ["  malloc: runtime/src/port.rs:5:6, from agents/src/map.rs:7:8"];
        assert_eq!(blocking(&format!("noise\n{one}{one}test a ... ok\n")), expected);
    }

    #[test]
    fn what_may_be_and_what_a_test_does_is_no_finding() {
        for frame in
            ["futex_wake /w/crates/runtime/src/os.rs:1:1", "<A as agent::Body>::start /w/crates/a.rs:1:1"]
        {
            assert_eq!(blocking(&report("syscall", &[frame])), [""; 0]);
        }
        assert_eq!(blocking(&report("free", &["step /w/crates/runtime/tests/system/main.rs:1:1"])), [""; 0]);
        assert_eq!(blocking(&report("free", &["drop /rustc/x.rs:1:1"])).len(), 1);
    }

    #[test]
    fn a_sanitizer_that_sees_nothing_or_too_much_is_refused() {
        let both = SEEN.join(" ");
        assert_eq!(tests_are_seen(&both), Ok(()));
        assert!(tests_are_seen(SEEN[0]).unwrap_err().contains(SEEN[1]));
        assert!(tests_are_seen(&format!("{both} {UNSEEN}")).is_err());
    }
}
