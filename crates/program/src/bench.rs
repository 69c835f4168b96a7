//! `sinew bench`: what a machine makes of the runtime and the simulator, beside other systems that do the same work.
//!
//! | to find | look in |
//! |---|---|
//! | how often and how long, with which other system | [`Setting`] |
//! | figures, ratios, how they are printed | [`outcome`] |
//! | the machine, how near its processors are just now | [`machine`], [`spin`] |
//! | other systems, and rounds in which ours and theirs take turns | [`peers`], [`turns`] |
//! | what the agents of the measurements share | [`parcel`] |

mod grow;
mod hop;
mod load;
mod localize;
mod machine;
mod nav;
mod outcome;
mod parcel;
mod peers;
mod plan;
mod reflex;
mod simulation;
mod spin;
mod threads;
mod turns;
mod wake;
mod watch;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use runtime::Registry;
use serde_json::json;

use crate::error::Failure;
use crate::terminal;
use outcome::{Measured, Outcome};
use peers::Peers;

/// What `sinew bench` can be told.
#[derive(Args, Debug)]
pub(crate) struct BenchArgs {
    /// Which; "list" says what there is.
    #[arg(value_name = "NAME")]
    name: String,
    /// A tenth of the rounds and samples: to see that it works, not to publish.
    #[arg(long)]
    quick: bool,
    /// The recording to be measured with, a folder or an archive; else one of the folder that SINEW_DATA names.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Draws figures, where the measurement has any, into this folder.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    plan: plan::PlanArgs,
}

/// One measurement.
struct Bench {
    name: &'static str,
    what: &'static str,
    /// What is aimed at.
    goal: &'static str,
    measure: fn(&Setting<'_>) -> Result<Outcome, Failure>,
}

/// All of them.
const BENCHES: &[Bench] = &[
    Bench {
        name: "hop",
        what: "messages between agents of one executor, with and without a log, to one and to 64, small and large",
        goal: "hop/copper 0.5, hop_logged/copper_logged 0.25, fanout64/rtrb 3, fanout64_ports/rtrb 1.3, picture/hop64 1.15, caterpillar/copper 0.5",
        measure: hop::measure,
    },
    Bench {
        name: "wake",
        what: "from sending to the step of an agent that slept, and how late periodic steps begin, idle and under load",
        goal: "wake_same/futex 1.15, wake_cross/futex 1.1, jitter_idle/bare and jitter_loaded/bare 1.15",
        measure: wake::measure,
    },
    Bench {
        name: "reflex",
        what: "from a contact to the slower command at the wheels, over safety monitor and coordinator, and over avoidance, coordinator and drive",
        goal: "reflex/bare_chain 1.25; papers tell of 20 ms",
        measure: reflex::measure,
    },
    Bench {
        name: "sim",
        what: "how many times as fast as real time simulations run",
        goal: "1000 robots with twelve sonars and a laser in one world: real time",
        measure: simulation::measure,
    },
    Bench {
        name: "grow",
        what: "adding an agent to a live system of 1000 and removing it; up to 10 000 agents at 10 Hz in simulated time",
        goal: "a change in less than 1 ms whatever is wired elsewhere; a step as long among 10 000 as among 1000, and 20 times real time",
        measure: grow::measure,
    },
    Bench {
        name: "nav",
        what: "steps of the laws of avoidance on a scan of 360 beams, and of the filter of the pose, beside a copy of the scan",
        goal: "30 us a step of avoidance, 5 us one of the filter; told beside it nearness/memcpy, smooth/memcpy, ekf/memcpy",
        measure: nav::measure,
    },
    Bench {
        name: "plan",
        what: "ways over maps by all planners, beside A* of the crate pathfinding; and anew after a change",
        goal: "plan/pathfinding 0.1, the first way of the field in a fifth of its time, 95 % of its ways the shortest when that has finished",
        measure: plan::measure,
    },
    Bench {
        name: "watch",
        what: "what a log, top, a tap and changes take of a processor while a robot drives on the wall clock",
        goal: "less than 3 % of a processor, and nothing on threads in real time",
        measure: watch::measure,
    },
    Bench {
        name: "localize",
        what: "how far five real robots, that see coded landmarks and each other, are from where they believe to be",
        goal: "a mean of 0.15 m over the robots, 100 times as fast as it was recorded; a step of the filter in less than 5 us",
        measure: localize::measure,
    },
];

/// Recordings of real robots, beside the working folder unless `SINEW_DATA` names another one.
const DATA_BESIDE: &str = "../shared/data";

/// Where recordings are on this machine; nothing where there are none.
fn data() -> Option<PathBuf> {
    let folder = std::env::var_os("SINEW_DATA").map_or_else(|| PathBuf::from(DATA_BESIDE), PathBuf::from);
    folder.is_dir().then_some(folder)
}

/// How a measurement is to be done.
pub(super) struct Setting<'a> {
    /// The agents that the program knows.
    registry: &'a Registry,
    /// The program that measures other systems, where there is one.
    peers: Option<Peers>,
    /// The program that makes load: this one. Nobody, and nothing is measured under load.
    program: Option<PathBuf>,
    /// Of so many rounds or samples one is done.
    shorter: usize,
    /// The recording that was named.
    data: Option<PathBuf>,
    /// Where figures go; nowhere, and none are drawn.
    out: Option<PathBuf>,
    /// What only the measurement of planners is told.
    plan: plan::PlanArgs,
}

impl Setting<'_> {
    /// How many of `full` rounds or samples are done, at least `least`.
    fn of(&self, full: usize, least: usize) -> usize {
        (full / self.shorter).max(least)
    }
}

/// Measures.
pub(crate) fn bench(args: &BenchArgs, registry: &Registry, json: bool) -> Result<ExitCode, Failure> {
    match args.name.as_str() {
        "list" => {
            list(json);
            return Ok(ExitCode::SUCCESS);
        }
        load::NAME => {
            load::make()?;
            return Ok(ExitCode::SUCCESS);
        }
        _ => {}
    }
    let Some(bench) = BENCHES.iter().find(|bench| bench.name == args.name) else {
        let known = BENCHES.iter().map(|bench| bench.name).chain(["list", load::NAME]);
        return Err(Failure::unknown("bench", &args.name, known));
    };
    let setting = Setting {
        registry,
        peers: Peers::find(),
        program: std::env::current_exe().ok(),
        shorter: if args.quick { 10 } else { 1 },
        data: args.data.clone(),
        out: args.out.clone(),
        plan: args.plan.clone(),
    };
    if bench.name != "plan" && args.plan != plan::PlanArgs::default() {
        let failure =
            Failure::new(format!("--maps, --scen and --picture are not for the bench {}", bench.name));
        return Err(failure.help("leave them out, or measure the planners: sinew bench plan"));
    }
    let mut spins = spin::round_trips();
    let mut outcome = (bench.measure)(&setting)?;
    spins.extend(spin::round_trips());
    if !spins.is_empty() {
        outcome.figures.push(Measured::new("spin_round_trip", "ns", spins));
    }
    if json {
        terminal::say_json(&outcome.to_json(bench.name));
    } else {
        terminal::say(&outcome.to_text(bench.name));
    }
    outcome.tell_missing();
    if !outcome.missing.is_empty() && setting.peers.is_none() {
        terminal::tell("`cargo xtask peers` builds the program that measures other systems");
    }
    Ok(if outcome.is_whole() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn list(json: bool) {
    if json {
        let row = |bench: &Bench| json!({"name": bench.name, "what": bench.what, "goal": bench.goal});
        terminal::say_json(&json!({"benches": BENCHES.iter().map(row).collect::<Vec<_>>()}));
    } else {
        let row = |bench: &Bench| format!("{:<7} {}\n        goal: {}", bench.name, bench.what, bench.goal);
        let mut rows: Vec<String> = BENCHES.iter().map(row).collect();
        rows.push(format!("{:<7} {}", load::NAME, load::WHAT));
        terminal::say(&rows.join("\n"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each with as few rounds and samples as there can be: what it gives has its form. How long anything took is not looked at.
    #[test]
    fn every_bench_gives_figures_and_names_the_ratios_that_want_another_system() {
        let registry = agents::registry();
        let plan = plan::PlanArgs::default();
        let setting = Setting {
            registry: &registry,
            peers: None,
            program: None,
            shorter: 1000,
            data: None,
            out: None,
            plan,
        };
        for bench in BENCHES {
            let outcome = (bench.measure)(&setting).unwrap();
            let document = outcome.to_json(bench.name);
            let figures = document["figures"].as_array().unwrap();
            assert!(!figures.is_empty(), "{}", bench.name);
            for figure in figures {
                assert!(figure["n"].as_u64() > Some(0), "{}: {figure}", bench.name);
                assert!(figure["p50"].as_f64() <= figure["max"].as_f64(), "{}: {figure}", bench.name);
            }
            let named: Vec<&str> = outcome.ratios.iter().map(|ratio| ratio.name).collect();
            for name in bench.goal.split([' ', ',']).filter(|word| word.contains('/')) {
                assert!(named.contains(&name) || outcome.missing.contains(&name), "{}: {name}", bench.name);
            }
            assert!(outcome.to_text(bench.name).starts_with(bench.name));
        }
    }
}
