//! Floors, lasers and drives for tests.

use types::chance::Stream;
use types::geometry::PI;
use types::{Point, Pose};

use crate::drift::Drift;
use crate::floor::{Block, Disc, Distances, FloorPlan, PlanField};
use crate::matching::{Geometry, MOST_BEAMS, Scan};

/// The range of the lasers here (m).
pub(crate) const FAR: f64 = 8.0;

/// A laser of half a turn.
pub(crate) fn geometry(beams: usize) -> Geometry {
    Geometry {
        angle_min: -PI / 2.0,
        angle_step: PI / (beams - 1) as f64,
        range_min: 0.02,
        range_max: FAR,
        mount: Pose::new(0.08, 0.0, 0.0),
    }
}

/// The ranges that a laser without noise measures.
pub(crate) fn exact(floor: &PlanField, geometry: &Geometry, pose: Pose, beams: usize) -> Vec<f64> {
    let laser = pose.then(geometry.mount);
    let range = |i: usize| {
        let bearing = laser.heading + geometry.angle_min + i as f64 * geometry.angle_step;
        floor
            .cast(laser.position(), Point::polar(1.0, bearing), geometry.range_max)
            .unwrap_or(geometry.range_max)
    };
    (0..beams).map(range).collect()
}

pub(crate) fn noisy(exact: &[f64], noise: f64, draw: Stream) -> Vec<f32> {
    let range = |(i, range): (usize, &f64)| {
        if *range < FAR { (range + noise * draw.normal(i as u64)).min(FAR) as f32 } else { FAR as f32 }
    };
    exact.iter().enumerate().map(range).collect()
}

pub(crate) fn taken(ranges: &[f32], geometry: &Geometry) -> Scan {
    let mut scan = Scan::new();
    scan.take(ranges, geometry, MOST_BEAMS);
    scan
}

/// A room with a box and a pillar.
pub(crate) fn room() -> FloorPlan {
    let mut plan = FloorPlan::room(6.0, 4.5);
    plan.boxes.push(Block { at: Pose::new(4.6, 3.2, 0.4), length: 1.2, depth: 0.5 });
    plan.discs.push(Disc { centre: Point::new(1.0, 3.4), radius: 0.3 });
    plan
}

/// Three rooms and a corridor, 10 m by 7 m, no two of them alike.
pub(crate) fn flat() -> FloorPlan {
    let mut plan = FloorPlan::room(10.0, 7.0);
    let mut lines = |lines: &[[f64; 4]]| {
        lines.iter().for_each(|l| plan.line(&[Point::new(l[0], l[1]), Point::new(l[2], l[3])]));
    };
    // The corridor along the upper side, with three doors; then the walls between the rooms.
    lines(&[[0.0, 5.2, 1.2, 5.2], [2.1, 5.2, 5.0, 5.2], [5.9, 5.2, 8.6, 5.2], [9.5, 5.2, 10.0, 5.2]]);
    lines(&[[4.0, 0.0, 4.0, 5.2], [7.2, 0.0, 7.2, 2.0], [7.2, 2.9, 7.2, 5.2]]);
    plan.boxes.push(Block { at: Pose::new(1.2, 0.5, 0.0), length: 1.8, depth: 0.8 });
    plan.boxes.push(Block { at: Pose::new(9.5, 1.2, PI / 2.0), length: 1.6, depth: 0.6 });
    plan.boxes.push(Block { at: Pose::new(5.2, 0.4, 0.3), length: 0.9, depth: 0.4 });
    plan.discs.push(Disc { centre: Point::new(3.2, 3.9), radius: 0.25 });
    plan
}

/// A robot that roams: ahead where there is room, else it turns.
pub(crate) struct Roamer<'f> {
    pub(crate) floor: &'f PlanField,
    pub(crate) pose: Pose,
    pub(crate) geometry: Geometry,
    pub(crate) beams: usize,
    stream: Stream,
    number: u64,
    /// Where its wheels say that it is.
    pub(crate) odometry: Pose,
    turning: f64,
}

impl<'f> Roamer<'f> {
    pub(crate) fn new(floor: &'f PlanField, pose: Pose, seed: u64) -> Roamer<'f> {
        let stream = Stream::new(seed, "roamer");
        let beams = 181;
        Roamer {
            floor,
            pose,
            geometry: geometry(beams),
            beams,
            stream,
            number: 0,
            odometry: Pose::new(3.0, -2.0, 1.0),
            turning: 0.0,
        }
    }

    /// Moves for a fifth of a second, and tells what the wheels say of it: one per cent too much, and what slips.
    pub(crate) fn go(&mut self) -> Pose {
        self.number += 1;
        let room = |bearing: f64| {
            self.floor
                .cast(self.pose.position(), Point::polar(1.0, self.pose.heading + bearing), FAR)
                .unwrap_or(FAR)
        };
        let ahead = room(0.0).min(room(0.35)).min(room(-0.35));
        self.turning = match ahead < 0.7 {
            true if self.turning != 0.0 => self.turning,
            true => {
                if room(1.2) > room(-1.2) {
                    0.25
                } else {
                    -0.25
                }
            }
            false => 0.0,
        };
        let turn = self.turning + 0.02 * self.stream.sample(self.number).normal(9);
        let moved = Pose::default().along_arc(if self.turning == 0.0 { 0.08 } else { 0.0 }, turn);
        self.pose = self.pose.then(moved);
        let slips = Drift { wheel: 1e-4, ..Drift::default() };
        let told = Pose::default().along_arc(moved.position().norm() * 1.01, moved.heading * 1.01);
        let told = slips.draw(told, self.stream.sample(self.number));
        self.odometry = self.odometry.then(told);
        told
    }

    /// A scan of 10 mm noise from where it is.
    pub(crate) fn look(&self) -> Vec<f32> {
        let ideal = exact(self.floor, &self.geometry, self.pose, self.beams);
        noisy(&ideal, 0.01, self.stream.sample(1_000_000 + self.number))
    }
}
