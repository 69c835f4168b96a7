//! What a step of navigation takes, beside a copy of a scan: the laws of avoidance on that very scan, and the filter that believes where
//! the robot is on a step of the wheels and a landmark.

use std::hint::black_box;

use motion::ring::Ring;
use navigation::avoid::{Body, NearnessDiagram, Sectors, SmoothNearness, nearness, smooth};
use types::geometry::TAU;
use types::{Point, Pose};

use super::Setting;
use super::localize;
use super::outcome::{Measured, Outcome};
use super::turns::mean;
use crate::error::Failure;
use crate::terminal::host_now;

/// Beams of a scan.
const BEAMS: usize = 360;
/// Rounds in which ours and the copy take turns, and steps of each in one.
const ROUNDS: usize = 9;
const STEPS: usize = 20_000;
/// So many steps are timed together: a copy takes no longer than a look at the clock.
const TOGETHER: usize = 50;
/// Different scans, one after the other.
const SCANS: usize = 64;

/// A step of something on a scan.
type Work<'a> = Box<dyn FnMut(&[f32; BEAMS]) + 'a>;

pub(super) fn measure(setting: &Setting<'_>) -> Result<Outcome, Failure> {
    let mut outcome = Outcome::default();
    let scans: Vec<[f32; BEAMS]> = (0..SCANS).map(scan).collect();
    let (rounds, steps) = (setting.of(ROUNDS, 1), setting.of(STEPS, 200));
    let mut works = avoidance();
    let mut believe = localize::step_of_filter();
    works.push(("ekf/memcpy", "ekf", Box::new(move |_| believe())));
    for (name, figure, work) in &mut works {
        let (mut ours, mut ratios) = (Vec::new(), Vec::new());
        for _ in 0..rounds {
            let mut buffer = [0f32; BEAMS];
            let copies = timed(&scans, steps, &mut |scan| {
                buffer.copy_from_slice(black_box(scan));
                black_box(&mut buffer);
            });
            let taken = timed(&scans, steps, work);
            ratios.push((mean(&taken), mean(&copies)));
            ours.extend(taken);
        }
        outcome.figures.push(Measured::new(*figure, "ns", ours));
        outcome.compare(name, ratios);
    }
    Ok(outcome)
}

/// The laws of avoidance, each from the scan of a laser off the middle to a motion of a rectangular robot.
fn avoidance<'a>() -> Vec<(&'static str, &'static str, Work<'a>)> {
    let goal = Point::new(4.0, 1.0);
    let body = Body::Rectangle { front: 0.255, rear: 0.255, half_width: 0.215 };
    let mut diagram = NearnessDiagram::new(nearness::Parameters::new(body));
    let mut smooth = SmoothNearness::new(smooth::Parameters::new(body));
    let (mut one, mut other) = (Sectors::new(), Sectors::new());
    vec![
        (
            "nearness/memcpy",
            "nearness_diagram",
            Box::new(move |scan| {
                fill(&mut one, scan);
                black_box(diagram.step(Some(&one), goal));
            }),
        ),
        (
            "smooth/memcpy",
            "smooth_nearness",
            Box::new(move |scan| {
                fill(&mut other, scan);
                black_box(smooth.step(Some(&other), goal));
            }),
        ),
    ]
}

fn fill(around: &mut Sectors, ranges: &[f32; BEAMS]) {
    around.clear();
    let sweep = Ring::Sweep { angle_min: 0.0, angle_step: TAU / BEAMS as f64, ranges };
    around.add_scan(Pose::new(-0.065, 0.0, 0.0), sweep, 10.0);
}

/// What a step takes (ns), the mean of some together.
fn timed(scans: &[[f32; BEAMS]], steps: usize, work: &mut dyn FnMut(&[f32; BEAMS])) -> Vec<f64> {
    let groups = (steps / TOGETHER).max(1);
    let group = |first: usize| {
        let begun = host_now();
        for i in 0..TOGETHER {
            work(&scans[(first * TOGETHER + i) % SCANS]);
        }
        begun.elapsed().as_secs_f64() * 1e9 / TOGETHER as f64
    };
    (0..groups).map(group).collect()
}

/// A corridor with posts in it, another one each time.
fn scan(which: usize) -> [f32; BEAMS] {
    let shift = which as f64 * 0.1;
    std::array::from_fn(|i| {
        let bearing = i as f64 / BEAMS as f64 * TAU;
        let wall = 0.9 / bearing.sin().abs().max(0.09);
        let post = 1.0 + 0.8 * (7.0 * bearing + shift).sin();
        (if (i / 9) % 3 == 0 { wall.min(post) } else { wall }) as f32
    })
}
