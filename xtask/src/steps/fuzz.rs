//! Whatever parses, fed with what nobody wrote, for a short while. `fuzz/README.md` says how to look longer.

use std::path::{Path, PathBuf};

use super::Done;
use crate::failure::Failure;
use crate::tool::{Tool, end_of};
use crate::workspace::Workspace;

/// What cargo-fuzz asks of the compiler too, without a sanitizer, so that the stable compiler does it: counters on all edges,
/// which tell the fuzzer what an input reached, and calls at comparisons, which tell it what an input should have been.
const FLAGS: &str = "-Cpasses=sancov-module \
    -Cllvm-args=-sanitizer-coverage-level=4 \
    -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
    -Cllvm-args=-sanitizer-coverage-pc-table \
    -Cllvm-args=-sanitizer-coverage-trace-compares";

/// How many inputs a target gets: some seconds of them, enough to take every file of the corpus apart, and for the mistakes that lie on
/// top. A number of inputs and not of seconds, so that every machine sees the same ones.
const RUNS: u64 = 50_000;
/// Those that are slower get fewer.
const SLOW: [(&str, u64); 4] = [("floor", 10_000), ("log", 4_000), ("system", 500), ("world", 300)];
/// How long a target may take for that (s).
const AT_MOST: u32 = 120;
/// Makes each target run for so many seconds instead.
const LONGER: &str = "SINEW_FUZZ_SECONDS";
/// No input may take longer (s) or need more (MB). The bounds of the parsers are lower: other work shares this machine.
const SLOWEST: u32 = 5;
const MOST_MEMORY: u32 = 1024;

pub(super) fn run(workspace: &Workspace) -> Result<Done, Failure> {
    let seconds = seconds(std::env::var(LONGER).ok().as_deref())?;
    let built = workspace.target.join("fuzz");
    let words = ["build", "--quiet", "--manifest-path", "fuzz/Cargo.toml", "--target", &workspace.host];
    let cargo = Tool::cargo(&workspace.root).args(words).flags("RUSTFLAGS", FLAGS);
    cargo.env("CARGO_TARGET_DIR", &built).run("The targets in fuzz/targets cannot be built.")?;
    let programs = built.join(&workspace.host).join("debug");
    let targets = targets(&workspace.root.join("fuzz/targets"))?;
    let mut runs = 0;
    for target in &targets {
        runs += feed(workspace, &programs.join(target), target, seconds)?.runs;
    }
    Ok(Done::Passed(format!("{} targets, {runs} runs", targets.len())))
}

fn seconds(said: Option<&str>) -> Result<Option<u32>, Failure> {
    let Some(said) = said else { return Ok(None) };
    let known = said.parse().ok().filter(|seconds| *seconds > 0);
    known
        .map(Some)
        .ok_or_else(|| Failure::usage(format!("{LONGER} is \"{said}\""), "It is a number of seconds."))
}

/// How much a target gets, as it is told.
fn amount(target: &str, seconds: Option<u32>) -> String {
    let runs = SLOW.iter().find(|(slow, _)| *slow == target).map_or(RUNS, |(_, runs)| *runs);
    seconds.map_or(format!("-runs={runs}"), |seconds| format!("-max_total_time={seconds}"))
}

/// The names of the targets, in order.
fn targets(folder: &Path) -> Result<Vec<String>, Failure> {
    let mut names: Vec<String> = files(folder)?
        .iter()
        .filter(|file| file.extension().is_some_and(|ending| ending == "rs"))
        .filter_map(|file| Some(file.file_stem()?.to_str()?.to_owned()))
        .collect();
    names.sort();
    Ok(names)
}

fn files(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let read = || -> std::io::Result<Vec<PathBuf>> {
        std::fs::read_dir(folder)?.map(|entry| Ok(entry?.path())).collect()
    };
    read().map_err(|error| unreadable(folder, &error))
}

fn unreadable(path: &Path, error: &std::io::Error) -> Failure {
    Failure::new(
        format!("{}: {error}", path.display()),
        "Every target has a folder of its name in fuzz/corpus.",
    )
}

/// Runs one target on a copy of its corpus.
fn feed(workspace: &Workspace, program: &Path, target: &str, seconds: Option<u32>) -> Result<Seen, Failure> {
    let scratch = workspace.fresh_scratch(&format!("fuzz/{target}"))?;
    let (corpus, temporary) = (scratch.join("corpus"), scratch.join("temporary"));
    for folder in [&corpus, &temporary] {
        std::fs::create_dir(folder).map_err(|error| unreadable(folder, &error))?;
    }
    let kept = workspace.root.join("fuzz/corpus").join(target);
    for file in files(&kept)? {
        let copy = corpus.join(file.file_name().unwrap_or_default());
        std::fs::copy(&file, copy).map_err(|error| unreadable(&file, &error))?;
    }
    let found = workspace.target.join("fuzz/found").join(target);
    std::fs::create_dir_all(&found).map_err(|error| unreadable(&found, &error))?;
    let words = workspace.root.join("fuzz/words").join(target);
    // The same seed always: a change is judged by what it changes. Longer runs draw their own.
    // A target that is stopped in the middle of an allocation may hang in its own last words: then it is killed.
    let mut tool = Tool::new("timeout", &scratch).env("TMPDIR", &temporary);
    let limit = seconds.map_or(AT_MOST, |seconds| seconds + 60);
    tool = tool.args(["--kill-after=5s".to_owned(), format!("{limit}s")]).arg(program).args([
        "-seed=1".to_owned(),
        amount(target, seconds),
        format!("-timeout={SLOWEST}"),
        format!("-rss_limit_mb={MOST_MEMORY}"),
        format!("-artifact_prefix={}/", found.display()),
    ]);
    if words.exists() {
        tool = tool.arg(format!("-dict={}", words.display()));
    }
    let (well, text) = tool.arg("corpus").told()?;
    match seen(&text).filter(|_| well) {
        Some(seen) => {
            println!("    {target}: {} runs, {} edges reached", seen.runs, seen.edges);
            Ok(seen)
        }
        None => Err(Failure::new(
            format!("{target}\n{}", end_of(&text)),
            match input(&text) {
                Some(input) => {
                    format!("The input is kept. It fails again with:\n{} {input}", program.display())
                }
                None => "The target ended without naming an input.".to_owned(),
            },
        )),
    }
}

/// What a target says at its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Seen {
    runs: u64,
    edges: u64,
}

/// From the line `#4096 DONE   cov: 512 ft: …`.
fn seen(text: &str) -> Option<Seen> {
    let line = text.lines().rev().find(|line| line.starts_with('#') && line.contains("DONE"))?;
    let mut words = line.trim_start_matches('#').split_whitespace();
    let runs = words.next()?.parse().ok()?;
    let edges = words.skip_while(|word| *word != "cov:").nth(1)?.parse().ok()?;
    Some(Seen { runs, edges })
}

/// The file from a line such as `Test unit written to found/crash-0a1b`.
fn input(text: &str) -> Option<&str> {
    text.lines().find_map(|line| Some(line.split_once("Test unit written to ")?.1.trim()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_end_of_a_run_is_understood() {
        let text = "#2\tINITED cov: 9 ft: 9\n#4096\tDONE   cov: 512 ft: 811 corp: 3/9b lim: 9 exec/s: 1\nDone 4096 runs";
        assert_eq!(seen(text), Some(Seen { runs: 4096, edges: 512 }));
        assert_eq!(seen("#2\tINITED cov: 9 ft: 9"), None, "a run that did not end says so");
    }

    #[test]
    fn the_input_that_failed_is_named() {
        let text = "panicked at …\nartifact_prefix='/t/'; Test unit written to /t/crash-0a1b\nBase64: eA==";
        assert_eq!(input(text), Some("/t/crash-0a1b"));
        assert_eq!(input("panicked"), None);
    }

    #[test]
    fn a_time_is_a_number_of_seconds() {
        assert_eq!((seconds(None).unwrap(), seconds(Some("300")).unwrap()), (None, Some(300)));
        assert_eq!(
            [amount("word", None), amount("world", None), amount("world", Some(9))],
            ["-runs=50000", "-runs=300", "-max_total_time=9"]
        );
        assert_eq!(seconds(Some("5min")).unwrap_err().code, 2);
        assert!(seconds(Some("0")).is_err());
    }
}
