//! The laws drive a round robot with a laser over half a turn, in a plane of boxes and discs.

use super::memory::{self, Memory};
use super::nearness::{self, NearnessDiagram};
use super::smooth::{self, SmoothNearness};
use super::{Body, Sectors};
use libm::{fabs, hypot};
use motion::ring::Ring;
use types::geometry::PI;
use types::messages::{Avoidance, Situation};
use types::{Point, Pose};

/// That of a drum of 0.68 m.
const RADIUS: f64 = 0.34;
/// A laser over half a turn, at 10 Hz.
const BEAMS: usize = 181;
const RANGE: f64 = 8.0;
const STEP: f64 = 0.1;

/// What stands around.
#[derive(Clone, Copy, Debug)]
enum Thing {
    /// From its right rear corner to its left front one.
    Box(Point, Point),
    Disc(Point, f64),
}

fn slab(x: (f64, f64), y: (f64, f64)) -> Thing {
    Thing::Box(Point::new(x.0, y.0), Point::new(x.1, y.1))
}

impl Thing {
    /// From outside to its edge (m); nothing or less inside.
    fn distance(&self, at: Point) -> f64 {
        match *self {
            Thing::Disc(middle, radius) => at.distance(middle) - radius,
            Thing::Box(low, high) => {
                let off = |x: f64, low: f64, high: f64| (low - x).max(x - high).max(0.0);
                hypot(off(at.x, low.x, high.x), off(at.y, low.y, high.y))
            }
        }
    }

    fn mirrored(&self) -> Thing {
        match *self {
            Thing::Disc(middle, radius) => Thing::Disc(Point::new(middle.x, -middle.y), radius),
            Thing::Box(low, high) => slab((low.x, high.x), (-high.y, -low.y)),
        }
    }
}

/// A ray cast through free space by steps as long as nothing can be in the way.
fn ray(things: &[Thing], from: Pose) -> f32 {
    let mut range = 0.0;
    while range < RANGE {
        let at = from.transform(Point::new(range, 0.0));
        let free = things.iter().map(|thing| thing.distance(at)).fold(f64::INFINITY, f64::min);
        if free < 1e-4 {
            return range.max(1e-3) as f32;
        }
        range += free;
    }
    RANGE as f32
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Which {
    Nearness,
    Smooth,
}

const BOTH: [Which; 2] = [Which::Nearness, Which::Smooth];

enum Law {
    Nearness(Box<NearnessDiagram>),
    Smooth(Box<SmoothNearness>),
}

impl Law {
    fn new(which: Which) -> Law {
        let body = Body::Round { radius: RADIUS };
        match which {
            Which::Nearness => Law::Nearness(Box::new(NearnessDiagram::new(nearness::Parameters::new(body)))),
            Which::Smooth => Law::Smooth(Box::new(SmoothNearness::new(smooth::Parameters {
                security: 0.5,
                linear_max: 0.3,
                angular_max: PI / 4.0,
                goal_tolerance: 0.5,
                ..smooth::Parameters::new(body)
            }))),
        }
    }

    fn step(&mut self, around: &Sectors, goal: Point) -> Avoidance {
        match self {
            Law::Nearness(law) => law.step(Some(around), goal),
            Law::Smooth(law) => law.step(Some(around), goal),
        }
    }
}

/// How a drive went.
#[derive(Debug)]
struct Drive {
    /// Poses at each step.
    way: Vec<Pose>,
    /// The least distance from the edge (m).
    nearest: f64,
    last: Avoidance,
    /// How often it saw no way.
    no_ways: usize,
    /// How often it turned on the spot the other way than before.
    dithers: usize,
}

impl Drive {
    fn has_arrived(&self) -> bool {
        self.last.situation == Situation::AtGoal
    }
}

fn drive(which: Which, things: &[Thing], start: Pose, goal: Point, seconds: f64) -> Drive {
    drive_seeing(0.0, which, things, start, goal, seconds)
}

/// With the laser so far ahead of the middle (m).
fn drive_seeing(ahead: f64, which: Which, things: &[Thing], start: Pose, goal: Point, seconds: f64) -> Drive {
    let mount = Pose::new(ahead, 0.0, 0.0);
    let mut law = Law::new(which);
    let mut memory = Memory::new(memory::Parameters::new(RADIUS, 2.2 * RADIUS));
    let mut pose = start;
    let mut drive =
        Drive { way: vec![], nearest: f64::INFINITY, last: Avoidance::default(), no_ways: 0, dithers: 0 };
    let mut turned = 0.0;
    for i in 0..(seconds / STEP) as u32 {
        let angle = PI / (BEAMS - 1) as f64;
        let laser = pose.then(mount);
        let beam = |k: usize| {
            let heading = laser.heading - PI / 2.0 + angle * k as f64;
            ray(things, Pose { heading, ..laser })
        };
        let ranges: Vec<f32> = (0..BEAMS).map(beam).collect();
        let scan = Ring::Sweep { angle_min: -PI / 2.0, angle_step: angle, ranges: &ranges };
        let mut around = Sectors::new();
        around.add_scan(mount, scan, RANGE * 0.999);
        memory.look(laser, scan, RANGE * 0.999, f64::from(i) * STEP);
        memory.recall(pose, &mut around);
        drive.last = law.step(&around, pose.inverse().transform(goal));
        drive.way.push(pose);
        drive.no_ways += usize::from(drive.last.situation == Situation::NoWay);
        if drive.last.situation == Situation::AtGoal {
            break;
        }
        let twist = drive.last.twist;
        if fabs(twist.linear) < 0.01 && fabs(twist.angular) > 0.05 {
            drive.dithers += usize::from(turned * twist.angular < 0.0);
            turned = twist.angular;
        }
        pose = pose.advanced(twist.linear, twist.angular, STEP);
        let distance = |thing: &Thing| thing.distance(pose.position()) - RADIUS;
        drive.nearest = things.iter().map(distance).fold(drive.nearest, f64::min);
    }
    drive
}

/// The walls of a room, 12 m long and 8 m wide, its middle at the origin.
fn room() -> [Thing; 4] {
    [
        slab((-6.2, -6.0), (-4.2, 4.2)),
        slab((6.0, 6.2), (-4.2, 4.2)),
        slab((-6.2, 6.2), (4.0, 4.2)),
        slab((-6.2, 6.2), (-4.2, -4.0)),
    ]
}

/// The practice room: a crate, two pillars and a shelf, seen from the middle of the room.
fn practice() -> Vec<Thing> {
    let mut things = room().to_vec();
    things.push(slab((-0.45, 0.45), (0.7, 1.7)));
    things.push(slab((-3.8, -1.4), (3.4, 3.8)));
    things.push(Thing::Disc(Point::new(2.6, 2.2), 0.2));
    things.push(Thing::Disc(Point::new(0.2, -1.1), 0.2));
    things
}

fn arrives(which: Which, things: &[Thing], start: Pose, goal: Point, seconds: f64) -> Drive {
    let drive = drive(which, things, start, goal, seconds);
    assert!(drive.nearest > 0.0, "{which:?} touches: {}", drive.nearest);
    assert!(
        drive.has_arrived(),
        "{which:?} stands at {:?}, {:?}, {} dithers",
        drive.way.last(),
        drive.last,
        drive.dithers
    );
    drive
}

#[test]
fn a_robot_close_before_a_crate_decides_for_the_nearer_edge_and_passes_it() {
    for which in BOTH {
        let drive = arrives(which, &practice(), Pose::new(-0.92, 1.0, 0.0), Point::new(3.5, 1.2), 60.0);
        let lowest = drive.way.iter().map(|pose| pose.y).fold(f64::INFINITY, f64::min);
        assert!(lowest < 0.4 && drive.dithers <= 1, "{which:?}: {lowest}, {} dithers", drive.dithers);
    }
}

#[test]
fn a_laser_at_the_front_of_the_robot_sees_less_beside_it_and_that_is_enough() {
    for which in BOTH {
        let (start, goal) = (Pose::new(-0.92, 1.0, 0.0), Point::new(3.5, 1.2));
        let drive = drive_seeing(0.25, which, &practice(), start, goal, 60.0);
        assert!(drive.has_arrived() && drive.nearest > 0.0 && drive.dithers <= 1, "{which:?}: {drive:?}");
    }
}

#[test]
fn a_box_is_passed_from_near_and_from_a_metre_away_whatever_the_middle() {
    let mut things = room().to_vec();
    things.push(slab((-0.5, 0.5), (-0.5, 0.5)));
    for which in BOTH {
        for (gap, off) in [(0.12, 0.0), (0.12, 0.2), (1.0, 0.0), (1.0, -0.3)] {
            arrives(which, &things, Pose::new(-0.5 - RADIUS - gap, off, 0.0), Point::new(3.5, 0.0), 90.0);
        }
    }
}

#[test]
fn a_door_of_ninety_centimetres_is_passed() {
    let mut things = room().to_vec();
    things.push(slab((-0.1, 0.1), (0.45, 4.0)));
    things.push(slab((-0.1, 0.1), (-4.0, -0.45)));
    for which in BOTH {
        for start in [Pose::new(-2.5, 0.0, 0.0), Pose::new(-2.5, 1.5, 0.0)] {
            arrives(which, &things, start, Point::new(3.0, 0.0), 120.0);
        }
    }
}

#[test]
fn a_corridor_is_followed() {
    let things = [slab((-9.0, 9.0), (0.6, 0.8)), slab((-9.0, 9.0), (-0.8, -0.6))];
    for which in BOTH {
        arrives(which, &things, Pose::new(-3.0, 0.1, 0.3), Point::new(3.0, 0.0), 120.0);
    }
}

#[test]
fn a_row_of_pillars_is_passed_between_them() {
    let mut things = room().to_vec();
    things.extend((-2..=2).map(|i| Thing::Disc(Point::new(0.0, 1.4 * f64::from(i)), 0.15)));
    for which in BOTH {
        arrives(which, &things, Pose::new(-2.5, 0.05, 0.0), Point::new(3.0, 0.0), 120.0);
    }
}

#[test]
fn in_a_trap_it_neither_touches_nor_says_that_it_has_arrived() {
    // Three walls around, open behind, twice as deep as wide.
    let trap =
        [slab((1.0, 1.2), (-1.2, 1.2)), slab((-3.0, 1.2), (1.0, 1.2)), slab((-3.0, 1.2), (-1.2, -1.0))];
    for which in BOTH {
        let drive = drive(which, &trap, Pose::new(-2.0, 0.0, 0.0), Point::new(4.0, 0.0), 60.0);
        assert!(drive.nearest > 0.0 && !drive.has_arrived(), "{which:?}: {drive:?}");
    }
}

#[test]
fn shut_in_it_looks_around_and_says_that_there_is_no_way() {
    let cell = [
        slab((1.5, 1.7), (-1.7, 1.7)),
        slab((-1.7, -1.5), (-1.7, 1.7)),
        slab((-1.7, 1.7), (1.5, 1.7)),
        slab((-1.7, 1.7), (-1.7, -1.5)),
    ];
    for which in BOTH {
        let drive = drive(which, &cell, Pose::new(0.0, 0.0, 0.0), Point::new(4.0, 0.0), 60.0);
        let ways = drive.no_ways;
        assert!(
            drive.nearest > 0.0 && !drive.has_arrived() && ways > 0,
            "{which:?}: {ways}, {:?}",
            drive.last
        );
    }
}

#[test]
fn the_mirror_image_of_a_room_gives_the_mirror_image_of_the_way() {
    let things = practice();
    let twin: Vec<Thing> = things.iter().map(Thing::mirrored).collect();
    for which in BOTH {
        let one = drive(which, &things, Pose::new(-0.92, 1.013, 0.02), Point::new(3.5, 1.2), 60.0);
        let other = drive(which, &twin, Pose::new(-0.92, -1.013, -0.02), Point::new(3.5, -1.2), 60.0);
        assert!(one.has_arrived() && other.has_arrived());
        // A beam on the border of two sectors falls to the left one in both rooms, so the ways are not the same to the last digit.
        for (a, b) in one.way.iter().zip(&other.way) {
            assert!(fabs(a.x - b.x) < 0.1 && fabs(a.y + b.y) < 0.1, "{which:?}: {a:?} and {b:?}");
        }
    }
}
