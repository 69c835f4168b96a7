//! Measures what localisation costs: `cargo run --release -p sinew-navigation --example localise`.
//!
//! A flat of 70 m², a laser of half a turn; the least and the middle of many runs are printed.
#![allow(
    clippy::disallowed_methods,
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "it measures and prints; the library does neither"
)]

use std::hint::black_box;
use std::time::Instant;

use navigation::drift::Drift;
use navigation::floor::{Block, Distances, FloorPlan, PlanField};
use navigation::localisation::floor::{FloorLocalizer, FloorParams};
use navigation::matching::{Geometry, MatchParams, Scan, match_scan};
use navigation::monte_carlo::{MonteCarlo, MonteCarloParams};
use types::chance::Stream;
use types::geometry::PI;
use types::{Point, Pose};

const HERE: Pose = Pose::new(2.0, 2.5, 0.3);

fn main() {
    let plan = flat();
    measure("field of the flat", 20, |_| PlanField::new(&plan));
    let floor = PlanField::new(&plan).unwrap();
    println!("  {} kB", floor.memory() / 1024);
    for beams in [181, 361] {
        let (geometry, ranges) = (geometry(beams), look(&floor, beams, HERE, 0));
        let mut scan = Scan::new();
        measure(&format!("take {beams} beams"), 2000, |_| scan.take(&ranges, &geometry, 181));
        let near = Pose::new(HERE.x + 0.01, HERE.y - 0.01, HERE.heading + 0.01);
        let far = Pose::new(HERE.x + 0.15, HERE.y - 0.1, HERE.heading + 0.08);
        let params = MatchParams { reach: 0.15, ..MatchParams::default() };
        measure("  match from 1 cm off", 2000, |_| match_scan(&floor, &scan, near, &params));
        measure("  match from 18 cm off", 2000, |_| match_scan(&floor, &scan, far, &MatchParams::default()));
        track(&floor, beams);
    }
    for particles in [500, 2000, 8000] {
        cloud(&floor, particles);
    }
    search(&floor);
}

fn track(floor: &PlanField, beams: usize) {
    let mut localizer = FloorLocalizer::new(floor.clone(), FloorParams::default(), Stream::new(1, "speed"));
    localizer.place(HERE, 0.1, 0.1);
    let scans: Vec<Vec<f32>> = (0..64).map(|i| look(floor, beams, HERE, i)).collect();
    let geometry = geometry(beams);
    measure(&format!("  one correction of {beams} beams"), 2000, |i| {
        localizer.update(HERE, &scans[i % scans.len()], &geometry)
    });
}

fn cloud(floor: &PlanField, particles: usize) {
    let params = MonteCarloParams {
        particles_least: particles,
        particles_most: particles,
        ..MonteCarloParams::default()
    };
    let mut cloud = MonteCarlo::new(floor, 0.2, params, Stream::new(1, "speed"));
    let mut scan = Scan::new();
    scan.take(&look(floor, 181, HERE, 0), &geometry(181), 181);
    let mut out = Vec::with_capacity(8);
    let moved = Pose::new(0.05, 0.0, 0.01);
    measure(&format!("cloud of {particles}: predict"), 100, |_| cloud.predict(moved, &Drift::default()));
    measure("  weigh by 40 beams", 100, |_| cloud.weigh(floor, &scan));
    measure("  hypotheses", 100, |_| cloud.hypotheses(&mut out));
    measure("  resample", 100, |_| cloud.resample());
}

/// The rounds of a search: the first twelve, in which it is not decided.
fn search(floor: &PlanField) {
    let scans: Vec<Vec<f32>> = (0..12).map(|i| look(floor, 181, HERE, i)).collect();
    let geometry = geometry(181);
    let mut localizer = FloorLocalizer::new(floor.clone(), FloorParams::default(), Stream::new(1, "speed"));
    measure("one round of a search", 240, |i| {
        if i % 11 == 0 {
            localizer.forget();
        }
        localizer.update(HERE, &scans[i % 12], &geometry)
    });
}

fn measure<T>(what: &str, runs: usize, mut work: impl FnMut(usize) -> T) {
    let mut times: Vec<u128> = (0..runs)
        .map(|i| {
            let begin = Instant::now();
            black_box(work(i));
            begin.elapsed().as_nanos()
        })
        .collect();
    times.sort_unstable();
    let micros = |nanos: u128| nanos as f64 / 1e3;
    println!(
        "{what:<36} least {:>9.1} µs   middle {:>9.1} µs   most {:>9.1} µs",
        micros(times[0]),
        micros(times[runs / 2]),
        micros(times[runs - 1])
    );
}

fn geometry(beams: usize) -> Geometry {
    let angle_step = PI / (beams - 1) as f64;
    Geometry {
        angle_min: -PI / 2.0,
        angle_step,
        range_min: 0.02,
        range_max: 8.0,
        mount: Pose::new(0.08, 0.0, 0.0),
    }
}

fn look(floor: &PlanField, beams: usize, pose: Pose, number: u64) -> Vec<f32> {
    let (geometry, draw) = (geometry(beams), Stream::new(7, "look").sample(number));
    let laser = pose.then(geometry.mount);
    let range = |i: usize| {
        let bearing = laser.heading + geometry.angle_min + i as f64 * geometry.angle_step;
        let met = floor.cast(laser.position(), Point::polar(1.0, bearing), 8.0);
        met.map_or(8.0, |met| met + 0.01 * draw.normal(i as u64)) as f32
    };
    (0..beams).map(range).collect()
}

fn flat() -> FloorPlan {
    let mut plan = FloorPlan::room(10.0, 7.0);
    for l in [
        [0.0, 5.2, 1.2, 5.2],
        [2.1, 5.2, 5.0, 5.2],
        [5.9, 5.2, 8.6, 5.2],
        [9.5, 5.2, 10.0, 5.2],
        [4.0, 0.0, 4.0, 5.2],
        [7.2, 0.0, 7.2, 2.0],
        [7.2, 2.9, 7.2, 5.2],
    ] {
        plan.line(&[Point::new(l[0], l[1]), Point::new(l[2], l[3])]);
    }
    plan.boxes.push(Block { at: Pose::new(1.2, 0.5, 0.0), length: 1.8, depth: 0.8 });
    plan.boxes.push(Block { at: Pose::new(9.5, 1.2, PI / 2.0), length: 1.6, depth: 0.6 });
    plan
}
