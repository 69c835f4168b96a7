//! How long a step of each avoidance takes on a scan of 360 beams, beside a copy of that scan.
//!
//! `cargo run --release -p sinew-navigation --example avoid_speed`
#![allow(clippy::print_stdout, clippy::disallowed_methods)]

use std::hint::black_box;
use std::time::Instant;

use motion::ring::Ring;
use navigation::avoid::{Body, NearnessDiagram, Sectors, SmoothNearness, nearness, smooth};
use types::geometry::TAU;
use types::{Point, Pose};

const BEAMS: usize = 360;
const ROUNDS: usize = 20_000;

/// A corridor with posts in it, seen from places along it.
fn scan(round: usize) -> [f32; BEAMS] {
    let shift = round as f64 * 0.01;
    std::array::from_fn(|i| {
        let bearing = i as f64 / BEAMS as f64 * TAU;
        let wall = 0.9 / libm::fabs(libm::sin(bearing)).max(0.09);
        let post = 1.0 + 0.8 * libm::sin(7.0 * bearing + shift);
        (if (i / 9) % 3 == 0 { wall.min(post) } else { wall }) as f32
    })
}

/// The median of what `work` takes (ns).
fn median(mut work: impl FnMut(usize)) -> f64 {
    let mut took: Vec<f64> = (0..ROUNDS)
        .map(|round| {
            let start = Instant::now();
            work(round);
            start.elapsed().as_secs_f64() * 1e9
        })
        .collect();
    took.sort_by(f64::total_cmp);
    took[ROUNDS / 2]
}

fn main() {
    let scans: Vec<[f32; BEAMS]> = (0..64).map(scan).collect();
    let goal = Point::new(4.0, 1.0);
    let body = Body::Rectangle { front: 0.255, rear: 0.255, half_width: 0.215 };
    let mut copy = [0f32; BEAMS];
    let copied = median(|round| {
        copy.copy_from_slice(black_box(&scans[round % 64]));
        black_box(&mut copy);
    });
    println!("copy of the scan        {copied:8.0} ns");
    for (place, mount) in [("centre", Pose::default()), ("behind", Pose::new(-0.065, 0.0, 0.0))] {
        let mut around = Sectors::new();
        let fill = |round: usize, around: &mut Sectors| {
            around.clear();
            let ranges = &scans[round % 64];
            let step = TAU / BEAMS as f64;
            around.add_scan(mount, Ring::Sweep { angle_min: 0.0, angle_step: step, ranges }, 10.0);
        };
        let mut diagram = NearnessDiagram::new(nearness::Parameters::new(body));
        let took = median(|round| {
            fill(round, &mut around);
            black_box(diagram.step(Some(&around), goal));
        });
        println!("nearness diagram, {place} {took:8.0} ns  {:6.0} copies", took / copied);
        let mut smooth = SmoothNearness::new(smooth::Parameters::new(body));
        let took = median(|round| {
            fill(round, &mut around);
            black_box(smooth.step(Some(&around), goal));
        });
        println!("smooth,           {place} {took:8.0} ns  {:6.0} copies", took / copied);
    }
}
