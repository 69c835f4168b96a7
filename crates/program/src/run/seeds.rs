//! Many seeds of one scenario, on all cores.

use std::collections::BTreeMap;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use serde_json::{Value as Json, json};

use super::knowing::Knowing;
use super::prepare::Scenario;
use super::summary::{Summary, seconds, table};
use super::{One, Place, many, options};
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
    let seed = |number: usize| range.first + number as u64;
    let run = |number| one(args, scenario, knowing.as_ref(), seed(number), asked_to_end);
    let count = (range.last - range.first + 1) as usize;
    let done = many::each("runs", count, asked_to_end, run)?;
    let done: BTreeMap<u64, Summary> =
        done.into_iter().map(|(number, summary)| (seed(number), summary)).collect();
    let took = begun.elapsed().as_secs_f64();
    let met = done.values().filter(|summary| summary.is_success()).count();
    if json {
        terminal::say_json(&document(&scenario.file.plan.name, range, &done, took));
    } else {
        terminal::say(&text(&scenario.file.plan.name, range, &done, took));
    }
    Ok(if met == count { ExitCode::SUCCESS } else { ExitCode::FAILURE })
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
