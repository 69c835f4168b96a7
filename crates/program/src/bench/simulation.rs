//! How many times as fast as real time simulations run.

use std::sync::Arc;

use record::log::RunInfo;
use runtime::{Options, Recorder, Registry, Simulation};
use sim::plan::Cuboid;
use sim::{Model, Simulator, WorldPlan};
use types::geometry::TAU;
use types::{Duration, Point, Pose, Time};

use super::Setting;
use super::outcome::{Measured, Outcome};
use crate::error::Failure;
use crate::file;
use crate::run::{Asked, Facts, Judge, LogFile, Scenario, choice, failure, with_robots};
use crate::terminal::host_now;

/// Runs of each kind; the same seeds in each.
const RUNS: u64 = 3;
/// How much of the scenario is run (s of simulated time): about as long as the robot needs to its goal.
const LENGTH: usize = 300;
/// Robots in one world, and how long they drive together (s of all robots).
const ROBOTS: [usize; 4] = [1, 10, 100, 1000];
const ROBOT_SECONDS: usize = 10_000;
/// What a robot without eyes does not have.
const EYES: [&str; 3] = ["camera", "track", "head"];

pub(super) fn measure(setting: &Setting<'_>) -> Result<Outcome, Failure> {
    let mut outcome = Outcome::default();
    let runs = setting.of(RUNS as usize, 1) as u64;
    let length = Duration::secs(setting.of(LENGTH, 2) as i64);
    let kinds = [
        ("exploration", false, false),
        ("exploration_log", false, true),
        ("exploration_camera", true, false),
    ];
    for (name, eyes, log) in kinds {
        let mut speeds = Vec::new();
        for seed in 1..=runs {
            speeds.push(exploration(setting.registry, seed, eyes, log, length)?);
        }
        outcome.figures.push(Measured::new(name, "x real time", speeds));
    }
    for count in ROBOTS {
        // As many steps of robots in each, but no less than a second.
        let length = Duration::secs((setting.of(ROBOT_SECONDS, 10) / count).clamp(1, 60) as i64);
        let speeds = (0..runs).map(|seed| robots(count, seed, length)).collect();
        outcome.figures.push(Measured::new(format!("robots_{count}"), "x real time", speeds));
    }
    Ok(outcome)
}

/// The scenario with or without its eyes and its log.
fn exploration(
    registry: &Registry,
    seed: u64,
    eyes: bool,
    log: bool,
    length: Duration,
) -> Result<f64, Failure> {
    let registry = with_robots(registry.clone());
    let mut loaded = file::load("exploration", &[], &registry)?;
    if !eyes {
        let names = loaded.plan.agents.iter().map(|agent| agent.name.clone());
        let names: Vec<String> = names.filter(|name| !EYES.contains(&name.as_str())).collect();
        loaded.plan.only(&names).map_err(runtime::Refusal::from)?;
    }
    let scenario = Scenario { file: loaded, registry };
    let ready = scenario.prepare(seed)?;
    let facts = Facts::default();
    let recorder = if log { Some(recorder(&facts, seed)?) } else { None };
    let options = Options {
        limit: Some(length),
        log: if log { choice(&ready, 0.0) } else { Default::default() },
        observer: Box::new(Judge::new(&ready, Arc::default(), Asked::default(), log.then_some(facts))),
        recorder,
        parse: control::words::parse,
        ..Options::default()
    };
    let report = Simulation::new(&ready.plan, &ready.registry, options).and_then(Simulation::run);
    let report = report.map_err(|error| failure(error, &scenario.file.sources))?;
    Ok(report.time.seconds() / report.wall)
}

/// A log in the folder for such files, which is gone when it is written.
fn recorder(facts: &Facts, seed: u64) -> Result<Box<dyn Recorder>, Failure> {
    let path = std::env::temp_dir().join(format!("sinew-bench-{}.mcap", std::process::id()));
    let run = RunInfo { system: "exploration".into(), seed: Some(seed), ..RunInfo::default() };
    let made = LogFile::create(&path, &run, 0.0, facts.clone(), Asked::default());
    // The open file lives on without its name until it is closed.
    let _ = std::fs::remove_file(&path);
    made.map(|(file, _)| Box::new(file) as Box<dyn Recorder>)
        .map_err(|error| Failure::new(error.to_string()).code(1))
}

/// The simulator alone: so many robots that drive in circles, each with twelve sonars (4 Hz) and a laser of 180 beams (10 Hz).
fn robots(count: usize, seed: u64, length: Duration) -> f64 {
    let side = (count as f64).sqrt().ceil();
    let room = 4.0 * side + 2.0;
    let mut world = WorldPlan::hall(room, room);
    let mut simulator = {
        for row in 0..side as usize {
            for column in 0..side as usize {
                let at = Point::new(1.0 + 4.0 * column as f64, 1.0 + 4.0 * row as f64);
                world.boxes.push(Cuboid { at, size: Point::new(0.5, 0.5), ..Cuboid::default() });
            }
        }
        Simulator::new(&world, seed)
    };
    let model = Model::h1().with_laser(180, TAU / 2.0);
    for i in 0..count {
        let (column, row) = ((i as f64) % side, (i as f64 / side).floor());
        let pose = Pose::new(3.0 + 4.0 * column, 3.0 + 4.0 * row, i as f64);
        // All places are free: robots stand in the middle between boxes.
        if let Ok(id) = simulator.add_robot(&format!("r{i}"), model.clone(), pose) {
            simulator.command_wheels(id, 4.0, 6.0);
        }
    }
    let ids: Vec<_> = simulator.robots().collect();
    let (mut ring, mut scan) = ([0f32; 32], [0f32; 180]);
    let begun = host_now();
    let mut step = 0u64;
    while simulator.time() < Time::ZERO + length {
        for id in &ids {
            simulator.command_wheels(*id, 4.0, 6.0);
            if step.is_multiple_of(25) {
                simulator.sonar(*id, step / 25, &mut ring);
            }
            if step.is_multiple_of(10) {
                simulator.scan(*id, step / 10, &mut scan);
            }
        }
        simulator.step();
        step += 1;
    }
    length.seconds() / begun.elapsed().as_secs_f64()
}
