//! Many seeds of one scenario, on all cores.

use std::collections::BTreeMap;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use serde_json::{Value as Json, json};

use super::knowing::Knowing;
use super::prepare::Scenario;
use super::summary::{Summary, seconds, table};
use super::{One, Place, options};
use crate::cli::{RunArgs, Seeds};
use crate::error::Failure;
use crate::terminal;

/// Runs all seeds and prints a table of what became of each.
pub(super) fn run(
    args: &RunArgs,
    scenario: &Scenario,
    knowing: Option<&Knowing>,
    range: Seeds,
    asked_to_end: &Arc<AtomicBool>,
    json: bool,
) -> Result<ExitCode, Failure> {
    if args.log.is_some() {
        return Err(Failure::new("--log names one file, and there are many runs")
            .help("--out DIR gives each a folder of its own"));
    }
    let begun = terminal::host_now();
    let knowing = knowing.map(Knowing::still);
    let done = all(args, scenario, knowing.as_ref(), range, asked_to_end)?;
    let took = begun.elapsed().as_secs_f64();
    let met = done.values().filter(|summary| summary.is_success()).count();
    if json {
        terminal::say_json(&document(&scenario.file.plan.name, range, &done, took));
    } else {
        terminal::say(&text(&scenario.file.plan.name, range, &done, took));
    }
    let all_met = met as u64 == range.last - range.first + 1;
    Ok(if all_met { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Each seed with its summary; those that were not begun when somebody interrupted are missing.
fn all(
    args: &RunArgs,
    scenario: &Scenario,
    knowing: Option<&Knowing>,
    range: Seeds,
    asked_to_end: &Arc<AtomicBool>,
) -> Result<BTreeMap<u64, Summary>, Failure> {
    let count = range.last - range.first + 1;
    let cores = std::thread::available_parallelism().map_or(1, usize::from).min(count as usize);
    let next = AtomicU64::new(range.first);
    let done = Mutex::new(BTreeMap::new());
    let failed = Mutex::new(None);
    let bar = terminal::progress(count, "runs");
    std::thread::scope(|scope| {
        for core in 0..cores {
            let work = || {
                while !asked_to_end.load(Ordering::Relaxed) {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    if seed > range.last || failed.lock().unwrap_or_else(PoisonError::into_inner).is_some() {
                        return;
                    }
                    match one(args, scenario, knowing, seed, asked_to_end) {
                        Ok(summary) => {
                            done.lock().unwrap_or_else(PoisonError::into_inner).insert(seed, summary);
                            bar.inc(1);
                        }
                        Err(failure) => {
                            *failed.lock().unwrap_or_else(PoisonError::into_inner) = Some(failure);
                        }
                    }
                }
            };
            let thread = std::thread::Builder::new().name(format!("sinew-seeds-{core}"));
            if thread.spawn_scoped(scope, work).is_err() && core == 0 {
                let failure = Failure::new("no thread could be started for the runs").code(1);
                *failed.lock().unwrap_or_else(PoisonError::into_inner) = Some(failure);
            }
        }
    });
    bar.finish_and_clear();
    match failed.into_inner().unwrap_or_else(PoisonError::into_inner) {
        Some(failure) => Err(failure),
        None => Ok(done.into_inner().unwrap_or_else(PoisonError::into_inner)),
    }
}

fn one(
    args: &RunArgs,
    scenario: &Scenario,
    knowing: Option<&Knowing>,
    seed: u64,
    asked_to_end: &Arc<AtomicBool>,
) -> Result<Summary, Failure> {
    let ready = scenario.prepare(seed)?;
    let clock = options::clock(args, &ready)?;
    let place = match &args.out {
        Some(out) => Some(Place::in_folder(out.join(format!("seed{seed}")), args)?),
        None => None,
    };
    let asked_to_end = asked_to_end.clone();
    let (watched, serves, repeat) = (false, false, None);
    One { args, scenario, seed, clock, watched, place, asked_to_end, serves, repeat, knowing, facts: None }
        .run(ready)
}

fn text(name: &str, range: Seeds, done: &BTreeMap<u64, Summary>, took: f64) -> String {
    let head = ["seed", "met", "time", "collisions", "closest", "distance"].map(str::to_owned);
    let number =
        |value: Option<f64>, unit: &str| value.map_or("-".to_owned(), |value| format!("{value:.2} {unit}"));
    let row = |(seed, summary): (&u64, &Summary)| {
        let met = match summary.met {
            Some(true) => "yes",
            Some(false) => "no",
            None => "-",
        };
        [
            seed.to_string(),
            met.to_owned(),
            seconds(summary.time.seconds()),
            summary.collisions().map_or("-".to_owned(), |n| n.to_string()),
            number(summary.closest(), "m"),
            number(summary.distance(), "m"),
        ]
    };
    let rows: Vec<[String; 6]> = std::iter::once(head).chain(done.iter().map(row)).collect();
    // Numbers stand right, and behind them a sentence.
    let sentences = std::iter::once("why").chain(done.values().map(|summary| summary.why.as_str()));
    let lines = table(&rows, 0);
    let mut out: String =
        lines.lines().zip(sentences).map(|(line, why)| format!("{line}  {why}\n")).collect();
    let met = done.values().filter(|summary| summary.is_success()).count();
    let collided = done.values().filter(|summary| summary.collisions().is_some_and(|n| n > 0)).count();
    let count = range.last - range.first + 1;
    out += &format!(
        "{name}: {met} of {} succeeded ({:.0} %), {collided} with collisions, in {took:.1} s\n",
        done.len(),
        100.0 * met as f64 / done.len().max(1) as f64
    );
    if (done.len() as u64) < count {
        out += &format!("interrupted: {} of {count} seeds were run\n", done.len());
    }
    out
}

fn document(name: &str, range: Seeds, done: &BTreeMap<u64, Summary>, took: f64) -> Json {
    let met = done.values().filter(|summary| summary.is_success()).count();
    json!({
        "system": name,
        "seeds": {"first": range.first, "last": range.last, "done": done.len()},
        "succeeded": met,
        "rate": met as f64 / done.len().max(1) as f64,
        "collided": done.values().filter(|summary| summary.collisions().is_some_and(|n| n > 0)).count(),
        "wall_s": took,
        "runs": done.values().map(Summary::to_json).collect::<Vec<_>>(),
    })
}
