//! `cargo xtask test`: everything that must hold, step by step.

mod cargo;
mod faults;
mod fuzz;
mod hardship;
mod lessons;
mod live;
mod log;
mod new_agent;
mod reactive;
mod realtime;
mod recorded;
mod repeat;
mod sanitize;
mod scenarios;
mod setup;
mod sinew;
mod stop;

pub(crate) use lessons::expected_output;
pub(crate) use setup::{Need, provide};

use std::time::{Duration, Instant};

use crate::failure::Failure;
use crate::tidy;
use crate::workspace::Workspace;

/// How a step ended that did not fail.
pub(crate) enum Done {
    /// It holds; with what was seen, if that says more than the name.
    Passed(String),
    /// It could not be looked at, and why.
    Skipped(String),
}

/// One thing that must hold.
pub(crate) struct Step {
    name: &'static str,
    shows: &'static str,
    needs: &'static [Need],
    run: fn(&Workspace) -> Result<Done, Failure>,
}

/// In the order in which mistakes are cheapest to find.
pub(crate) const ALL: [Step; 16] = [
    Step {
        name: "format",
        shows: "every file is as rustfmt writes it",
        needs: &[Need::Rustfmt],
        run: cargo::format,
    },
    Step {
        name: "tidy",
        shows: "layers, purity, lengths, names in the documents",
        needs: &[],
        run: check_structure,
    },
    Step {
        name: "clippy",
        shows: "no warning in any target",
        needs: &[Need::Compiler, Need::Clippy],
        run: cargo::clippy,
    },
    Step {
        name: "unit",
        shows: "tests of all crates, and the examples in their documentation",
        needs: &[Need::Compiler],
        run: cargo::unit,
    },
    Step {
        name: "loom",
        shows: "rings, memory and the latch under every order of events",
        needs: &[Need::Compiler],
        run: cargo::loom,
    },
    Step {
        name: "fuzz",
        shows: "whatever parses, fed with what nobody wrote",
        needs: &[Need::Compiler, Need::CppCompiler],
        run: fuzz::run,
    },
    Step {
        name: "docs",
        shows: "the documentation builds, every link leads somewhere",
        needs: &[Need::Compiler],
        run: cargo::docs,
    },
    Step {
        name: "lessons",
        shows: "the numbered examples print what they say",
        needs: &[Need::Compiler],
        run: lessons::run,
    },
    Step {
        name: "scenarios",
        shows: "exploration and annex over ten seeds",
        needs: &[Need::Compiler],
        run: scenarios::run,
    },
    Step {
        name: "repeat",
        shows: "the same plan, seed and requests give the same bytes",
        needs: &[Need::Compiler],
        run: repeat::run,
    },
    Step {
        name: "faults",
        shows: "faults of sensors and agents lead to no collision",
        needs: &[Need::Compiler],
        run: faults::run,
    },
    Step {
        name: "hardship",
        shows: "a full disk, a closed terminal and rude clients do not reach the robot",
        needs: &[Need::Compiler],
        run: hardship::run,
    },
    Step {
        name: "stop",
        shows: "the emergency stop and signals win on a busy machine",
        needs: &[Need::Compiler],
        run: stop::run,
    },
    Step {
        name: "recorded",
        shows: "recordings of real robots, where there are any",
        needs: &[Need::Compiler],
        run: recorded::run,
    },
    Step {
        name: "log",
        shows: "an independent reader opens the log of a run",
        needs: &[Need::Compiler, Need::PythonVenv],
        run: log::run,
    },
    Step {
        name: "new-agent",
        shows: "a fresh agent builds, passes its test and runs",
        needs: &[Need::Compiler],
        run: new_agent::run,
    },
];

/// What takes long, or a compiler that not everybody has: only where it is named.
pub(crate) const MORE: [Step; 1] = [Step {
    name: "sanitize",
    shows: "no race between the threads of the runtime, and nothing that blocks on those in real time (by name only; needs a nightly compiler with rust-src)",
    needs: &[Need::Compiler],
    run: sanitize::run,
}];

fn check_structure(workspace: &Workspace) -> Result<Done, Failure> {
    tidy::run(workspace)?;
    Ok(Done::Passed(String::new()))
}

/// Prints the steps.
pub(crate) fn list() {
    for step in ALL.iter().chain(&MORE) {
        println!("{:<10} {}", step.name, step.shows);
    }
}

/// The steps with these names, divided by commas, in their usual order.
pub(crate) fn named(names: &str) -> Result<Vec<Step>, Failure> {
    let names: Vec<&str> = names.split(',').map(str::trim).collect();
    let known = || ALL.iter().chain(&MORE);
    if let Some(wrong) = names.iter().find(|name| !known().any(|step| step.name == **name)) {
        let right: Vec<&str> = known().map(|step| step.name).collect();
        return Err(Failure::usage(
            format!("there is no step \"{wrong}\""),
            format!("There are: {}.", right.join(", ")),
        ));
    }
    Ok(ALL.into_iter().chain(MORE).filter(|step| names.contains(&step.name)).collect())
}

/// Runs steps until one fails, then says how each ended.
pub(crate) fn run(workspace: &Workspace, steps: &[Step]) -> Result<(), Failure> {
    let begun = now();
    let mut lines = Vec::new();
    let mut result = perform("setup", &mut lines, || setup::run(steps.iter().flat_map(|step| step.needs)));
    for step in steps {
        if result.is_ok() {
            result = perform(step.name, &mut lines, || (step.run)(workspace));
        } else {
            lines.push(format!("  {:<10} {:>7}  not run", step.name, ""));
        }
    }
    println!("\nsummary");
    lines.iter().for_each(|line| println!("{line}"));
    println!("  {:<10} {}", "in all", show(begun.elapsed()));
    result
}

fn perform(
    name: &str,
    lines: &mut Vec<String>,
    work: impl FnOnce() -> Result<Done, Failure>,
) -> Result<(), Failure> {
    println!("\n== {name}");
    let begun = now();
    let result = work();
    let (word, more) = match &result {
        Ok(Done::Passed(seen)) => ("ok", seen.as_str()),
        Ok(Done::Skipped(why)) => ("skipped", why.as_str()),
        Err(_) => ("FAILED", ""),
    };
    let gap = if more.is_empty() { "" } else { ": " };
    println!("== {name}: {word}{gap}{more}");
    lines.push(format!("  {name:<10} {}  {word}{gap}{more}", show(begun.elapsed())));
    result.map(drop)
}

#[allow(clippy::disallowed_methods, reason = "people wait for these steps, so the wall clock is meant")]
fn now() -> Instant {
    Instant::now()
}

fn show(time: Duration) -> String {
    format!("{:>5.1} s", time.as_secs_f64())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_chosen_by_name_and_keep_their_order() {
        let names: Vec<&str> = named("unit, tidy").unwrap().iter().map(|step| step.name).collect();
        assert_eq!(names, ["tidy", "unit"]);
        assert!(named("tidy,untidy").err().unwrap().to_string().contains("\"untidy\""));
    }

    #[test]
    fn a_failure_is_counted_and_told() {
        let mut lines = Vec::new();
        let failed = perform("odd", &mut lines, || Err(Failure::new("it is odd", "Make it even.")));
        assert_eq!(failed.unwrap_err().to_string(), "failed: it is odd\n\nMake it even.");
        assert!(lines[0].contains("FAILED"), "{lines:?}");
    }
}
