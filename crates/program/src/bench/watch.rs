//! What it costs to watch a robot: the scenario of the exploration on the wall clock, without its eyes, in turns alone and watched by
//! a log of all that is sent, `sinew top` twice a second, a tap of its ranges, and a change of a parameter each second.
//!
//! The share of a processor is that of the whole process, with whoever watches in it. The threads in real time are looked at by
//! themselves: what they run, what of that the kernel does for them, and whether they take memory.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration as Pause;

use control::{Client, ClientError};
use record::log::RunInfo;
use runtime::{Control, Live, Options, Recorder, Report};
use types::Duration;

use super::Setting;
use super::outcome::Outcome;
use super::parcel::{end, now, process_time, thread};
use super::threads::{self, Used};
use crate::cli::ClockChoice;
use crate::error::Failure;
use crate::file;
use crate::run::{Asked, Facts, Judge, LogFile, Scenario, choice, failure, serve, with_robots};
use crate::terminal::pause;

/// How long the robot drives in a round (s), and rounds.
const LENGTH: usize = 20;
const ROUNDS: usize = 3;
/// The part of a round at its end after which nothing is counted any more.
const SPARE: Pause = Pause::from_millis(300);
/// How long nothing is counted at the beginning: threads start, memory is touched.
const WARM_UP: Pause = Pause::from_millis(500);
/// How often `sinew top` looks.
const LOOK: Pause = Pause::from_millis(500);
/// What a robot without eyes does not have.
const EYES: [&str; 3] = ["camera", "track", "head"];
/// The parameter that is set again and again, and its value.
const SET: [&str; 3] = ["set", "wall", "keep=0.5"];
const TAPPED: &str = "sonar.filtered";

/// What a round used, as shares of a processor.
#[derive(Clone, Copy, Debug, Default)]
struct Shares {
    /// All threads of the process.
    process: f64,
    /// The threads in real time; and of that, what the kernel did for them.
    real_time: f64,
    system: f64,
    /// How often threads in real time took or freed memory after the start, the runtime around the steps included.
    allocations: f64,
}

pub(super) fn measure(setting: &Setting<'_>) -> Result<Outcome, Failure> {
    let mut outcome = Outcome::default();
    let length = Duration::secs(setting.of(LENGTH, 2) as i64);
    let (mut alone, mut watched) = (Vec::new(), Vec::new());
    for _ in 0..setting.of(ROUNDS, 1) {
        alone.push(drive(setting, length, false, &mut outcome)?);
        watched.push(drive(setting, length, true, &mut outcome)?);
    }
    let per_cent = |of: fn(&Shares) -> f64, rows: &[Shares]| -> Vec<f64> {
        rows.iter().map(|row| 100.0 * of(row)).collect()
    };
    let rounds = alone.iter().zip(&watched);
    let more = rounds.map(|(alone, watched)| 100.0 * (watched.process - alone.process)).collect();
    outcome.figure("watching", "% of a processor", more);
    for (name, rows) in [("alone", &alone), ("watched", &watched)] {
        outcome.figure(format!("process_{name}"), "% of a processor", per_cent(|row| row.process, rows));
        outcome.figure(format!("real_time_{name}"), "% of a processor", per_cent(|row| row.real_time, rows));
        let system = per_cent(|row| row.system, rows);
        outcome.figure(format!("real_time_system_{name}"), "% of a processor", system);
        let allocations = rows.iter().map(|row| row.allocations).collect();
        outcome.figure(format!("real_time_allocations_{name}"), "1", allocations);
    }
    Ok(outcome)
}

/// One run of the scenario.
fn drive(
    setting: &Setting<'_>,
    length: Duration,
    watched: bool,
    outcome: &mut Outcome,
) -> Result<Shares, Failure> {
    let registry = with_robots(setting.registry.clone());
    let mut loaded = file::load("exploration", &[], &registry)?;
    let names = loaded.plan.agents.iter().map(|agent| agent.name.clone());
    let names: Vec<String> = names.filter(|name| !EYES.contains(&name.as_str())).collect();
    loaded.plan.only(&names).map_err(runtime::Refusal::from)?;
    loaded.plan.name = format!("bench-watch-{}", std::process::id());
    let scenario = Scenario { file: loaded, registry };
    let ready = scenario.prepare(1)?;
    let (facts, asked) = (Facts::default(), Asked::default());
    let recorder = if watched { Some(recorder(&facts, &asked)?) } else { None };
    let options = Options {
        limit: Some(length),
        log: if watched { choice(&ready, 0.0) } else { Default::default() },
        observer: Box::new(Judge::new(&ready, Arc::default(), asked.clone(), watched.then_some(facts))),
        recorder,
        parse: control::words::parse,
        ..Options::default()
    };
    let live = Live::new(&ready.plan, &ready.registry, options);
    let live = live.map_err(|error| failure(error, &scenario.file.sources))?;
    let control = live.control();
    let serving = watched.then(|| serve(&ready, &control, &asked, ClockChoice::Wall)).flatten();
    if watched && serving.is_none() {
        return Err(Failure::new("the control interface is not open, so nobody can watch").code(1));
    }
    let over = Arc::new(AtomicBool::new(false));
    let mut watchers = Vec::new();
    if watched {
        let name = ready.plan.name.clone();
        for watch in [looks as Watch, taps, sets] {
            let client = Client::connect(Some(&name));
            let client = client.map_err(|error| Failure::new(error.to_string()).code(1))?;
            let over = over.clone();
            watchers.push(thread("bench-watches", move || watch(client, &over))?);
        }
    }
    let reads = thread("bench-reads", move || shares(&control, length))?;
    let report = live.run();
    over.store(true, Ordering::Release);
    let watched: Vec<Result<u64, ClientError>> =
        watchers.into_iter().map(end).collect::<Result<_, Failure>>()?;
    let shares = end(reads)?;
    for answers in watched {
        let answers =
            answers.map_err(|error| Failure::new(format!("a watcher was refused: {error}")).code(1))?;
        if answers == 0 {
            return Err(Failure::new("a watcher saw nothing").code(1));
        }
    }
    drop(serving);
    let report = report.map_err(|error| failure(error, &scenario.file.sources))?;
    for agent in &report.view.agents {
        outcome.grant(&agent.executor, &agent.granted);
    }
    Ok(Shares { allocations: allocations(&report), ..shares? })
}

/// How often executors in real time, and the steps of their agents, took or freed memory.
fn allocations(report: &Report) -> f64 {
    let executors = report.view.executors.iter().filter(|executor| executor.real_time);
    let runtime: u64 = executors.clone().map(|executor| executor.allocations).sum();
    let names: Vec<&str> = executors.map(|executor| executor.name.as_str()).collect();
    let agents = report.view.agents.iter().filter(|agent| names.contains(&agent.executor.as_str()));
    (runtime + agents.map(|agent| agent.counts.allocations).sum::<u64>()) as f64
}

/// A log in the folder for such files, which is gone when it is written.
fn recorder(facts: &Facts, asked: &Asked) -> Result<Box<dyn Recorder>, Failure> {
    let path = std::env::temp_dir().join(format!("sinew-bench-watch-{}.mcap", std::process::id()));
    let run = RunInfo { system: "exploration".into(), seed: Some(1), ..RunInfo::default() };
    let made = LogFile::create(&path, &run, 0.0, facts.clone(), asked.clone());
    // The open file lives on without its name until it is closed.
    let _ = std::fs::remove_file(&path);
    made.map(|(file, _)| Box::new(file) as Box<dyn Recorder>)
        .map_err(|error| Failure::new(error.to_string()).code(1))
}

/// What is used from a while after the beginning of a run until shortly before its end.
fn shares(control: &Control, length: Duration) -> Result<Shares, Failure> {
    let begun = now();
    pause(WARM_UP);
    let view = control.view().map_err(|refusal| Failure::new(refusal.to_string()).code(1))?;
    let names: Vec<String> = view
        .executors
        .iter()
        .filter(|executor| executor.real_time)
        // The kernel keeps 15 letters of a name.
        .map(|executor| format!("sinew-{}", executor.name).chars().take(15).collect())
        .collect();
    let real_time = || {
        let used: Vec<Used> = threads::all().into_iter().filter(|used| names.contains(&used.name)).collect();
        let run: u64 = used.iter().map(|used| used.run).sum();
        (run as f64 * 1e-9, used.iter().map(|used| used.system).sum::<f64>())
    };
    let (from, process, before) = (now(), process_time(), real_time());
    let left = length.seconds() - (from - begun) as f64 * 1e-9 - SPARE.as_secs_f64();
    pause(Pause::from_secs_f64(left.max(0.1)));
    let after = real_time();
    let wall = (now() - from) as f64 * 1e-9;
    Ok(Shares {
        process: (process_time() - process) as f64 * 1e-9 / wall,
        real_time: (after.0 - before.0) / wall,
        system: (after.1 - before.1) / wall,
        allocations: 0.0,
    })
}

/// Watches until the run is over; gives how many answers came.
type Watch = fn(Client, &AtomicBool) -> Result<u64, ClientError>;

/// Whether the run ends now: whoever asks a system that has just ended is refused a little before that is known here.
fn ends(over: &AtomicBool) -> bool {
    for _ in 0..100 {
        if over.load(Ordering::Acquire) {
            return true;
        }
        pause(Pause::from_millis(20));
    }
    false
}

/// Asks again and again until the run is over.
fn asks(mut client: Client, over: &AtomicBool, words: &[&str], every: Pause) -> Result<u64, ClientError> {
    let mut answers = 0;
    while !over.load(Ordering::Acquire) {
        match client.call(words) {
            Ok(_) => answers += 1,
            Err(_) if ends(over) => break,
            Err(error) => return Err(error),
        }
        pause(every);
    }
    Ok(answers)
}

/// Looks as `sinew top` does.
fn looks(client: Client, over: &AtomicBool) -> Result<u64, ClientError> {
    asks(client, over, &["top"], LOOK)
}

/// Sets a parameter each second, as `sinew set` does.
fn sets(client: Client, over: &AtomicBool) -> Result<u64, ClientError> {
    asks(client, over, &SET, LOOK * 2)
}

/// Takes what an output sends, as `sinew tap` does.
fn taps(mut client: Client, over: &AtomicBool) -> Result<u64, ClientError> {
    client.call(&["tap", TAPPED])?;
    let mut heard = 0;
    while !over.load(Ordering::Acquire) {
        match client.next_event(Some(LOOK)) {
            Ok(event) => heard += u64::from(event.is_some()),
            Err(_) if ends(over) => break,
            Err(error) => return Err(error),
        }
    }
    Ok(heard)
}
