//! The navigator among posts, in a world of its own: a robot that drives exactly what its accelerations let it, and a laser without noise.

use super::*;
use libm::{hypot, sqrt};
use types::geometry::TAU;

const HALF: (f64, f64) = (0.254, 0.215);
const BODY: Body = Body::Rectangle { front: HALF.0, rear: HALF.0, half_width: HALF.1 };
const POST: f64 = 0.075;
const BEAMS: usize = 541;
const FIELD: f64 = 0.75 * TAU;

/// A robot among posts.
struct World {
    posts: Vec<Point>,
    pose: Pose,
    twist: Twist,
    /// The least distance of its outline from a post so far (m).
    closest: f64,
    ranges: [f32; BEAMS],
}

impl World {
    fn new(posts: Vec<Point>) -> World {
        World { posts, pose: Pose::default(), twist: Twist::ZERO, closest: 9.0, ranges: [10.0; BEAMS] }
    }

    fn scan(&mut self) {
        for i in 0..BEAMS {
            let bearing = self.pose.heading - FIELD / 2.0 + FIELD * i as f64 / (BEAMS - 1) as f64;
            let beam = Point::polar(1.0, bearing);
            let hit = self.posts.iter().filter_map(|post| {
                let to = *post - self.pose.position();
                let (along, across) = (to.dot(beam), beam.cross(to));
                let reach = POST * POST - across * across;
                (along > 0.0 && reach > 0.0).then(|| along - sqrt(reach))
            });
            self.ranges[i] = hit.fold(10.0, f64::min) as f32;
        }
    }

    /// Moves for a twentieth of a second as the wheels can.
    fn drive(&mut self, wish: Twist) {
        for _ in 0..5 {
            let (linear, angular) = (self.twist.linear, self.twist.angular);
            self.twist.linear += (wish.linear - linear).clamp(-0.02, 0.02);
            self.twist.angular += (wish.angular - angular).clamp(-0.08, 0.08);
            self.pose = self.pose.advanced(self.twist.linear, self.twist.angular, 0.01);
            for post in &self.posts {
                self.closest = self.closest.min(BODY.distance(self.pose.inverse().transform(*post)) - POST);
            }
        }
    }

    /// Runs until it arrives or the time (s) is over; gives when it arrived, and what it did.
    fn run(&mut self, navigator: &mut Navigator, goal: Point, seconds: f64) -> (Option<f64>, Vec<Doing>) {
        let mut done = Vec::new();
        for i in 0..(seconds / 0.05) as u32 {
            let now = f64::from(i) * 0.05;
            self.scan();
            let beams = Ring::Sweep {
                angle_min: -FIELD / 2.0,
                angle_step: FIELD / (BEAMS - 1) as f64,
                ranges: &self.ranges,
            };
            let scan = Scan { time: now, robot_from_sensor: Pose::default(), beams, range_max: 9.9 };
            navigator.look(&scan, self.pose);
            let out = navigator.step(now, self.pose, self.twist, goal);
            if done.last() != Some(&out.doing) {
                done.push(out.doing);
            }
            if out.doing == Doing::Arrived {
                return (Some(now), done);
            }
            self.drive(out.twist);
        }
        (None, done)
    }
}

fn navigator() -> Navigator {
    Navigator::new(Parameters { latency: 0.05, ..Parameters::new(BODY, 2.0) })
}

/// Posts side by side from one place to another.
fn fence(from: (f64, f64), to: (f64, f64)) -> impl Iterator<Item = Point> {
    let n = (hypot(to.0 - from.0, to.1 - from.1) / 0.15) as usize;
    (0..=n).map(move |i| {
        let t = i as f64 / n.max(1) as f64;
        Point::new(from.0 + (to.0 - from.0) * t, from.1 + (to.1 - from.1) * t)
    })
}

#[test]
fn over_open_ground_it_is_as_fast_as_it_may_be() {
    let mut world = World::new(Vec::new());
    let (arrived, done) = world.run(&mut navigator(), Point::new(10.0, 0.0), 20.0);
    // Speeding up and braking at 2 m/s² take a second and a metre each; the rest of 8 m goes at 2 m/s: 6 s at best.
    let at = arrived.unwrap();
    assert!((5.9..8.0).contains(&at), "{at}");
    assert_eq!(done, [Doing::Pursuing, Doing::Arrived]);
    assert!(world.pose.y.abs() < 0.1);
}

#[test]
fn through_a_gap_that_is_hardly_wider_than_it_can_turn_in_it_goes_without_touching() {
    // 0.8 m clear: the body is 0.43 m wide, and 0.67 m across its corners.
    let posts = fence((2.0, -3.0), (2.0, -0.475)).chain(fence((2.0, 0.475), (2.0, 3.0)));
    let mut world = World::new(posts.collect());
    let (arrived, done) = world.run(&mut navigator(), Point::new(5.0, 0.0), 20.0);
    assert!(arrived.is_some_and(|at| at < 8.0), "{arrived:?} {done:?}");
    assert!(world.closest > 0.1, "{}", world.closest);
}

#[test]
fn out_of_a_dead_end_that_it_went_into_it_finds_the_way_around() {
    // A pocket across the way, open towards the robot, whose end is seen late behind a fence.
    let posts = fence((1.5, 0.9), (4.0, 0.9))
        .chain(fence((1.5, -0.9), (4.0, -0.9)))
        .chain(fence((4.0, -0.9), (4.0, 0.9)))
        .chain(fence((1.5, 0.9), (1.5, 3.0)));
    let mut world = World::new(posts.collect());
    let (arrived, done) = world.run(&mut navigator(), Point::new(6.0, 0.0), 40.0);
    assert!(arrived.is_some(), "{done:?} at {:?}", world.pose);
    assert!(world.closest > 0.02, "{}", world.closest);
}

#[test]
fn shut_in_it_tries_and_then_says_that_it_gave_up_and_touches_nothing() {
    let corners = [(1.2, 1.2), (-1.2, 1.2), (-1.2, -1.2), (1.2, -1.2), (1.2, 1.2)];
    let posts = corners.windows(2).flat_map(|pair| fence(pair[0], pair[1]));
    let mut world = World::new(posts.collect());
    let (arrived, done) = world.run(&mut navigator(), Point::new(5.0, 0.0), 120.0);
    assert_eq!(arrived, None);
    assert!(done.contains(&Doing::NoWay) && done.contains(&Doing::Escaping), "{done:?}");
    assert_eq!(done.last(), Some(&Doing::GivenUp));
    assert!(world.closest > 0.02, "{}", world.closest);
}

#[test]
fn posts_at_random_are_passed_without_touching() {
    for seed in 0..6 {
        let draw = types::chance::Stream::new(seed, "posts");
        let posts =
            (0..40).map(|i| Point::new(draw.between(3 * i, 1.5, 8.0), draw.between(3 * i + 1, -3.0, 3.0)));
        let mut world = World::new(posts.collect());
        let (arrived, done) = world.run(&mut navigator(), Point::new(10.0, 0.0), 40.0);
        assert!(world.closest > 0.0, "world {seed}: {done:?}");
        assert!(arrived.is_some(), "world {seed}: {done:?} at {:?}", world.pose);
    }
}

#[test]
fn without_a_scan_or_with_an_old_one_it_stands() {
    let mut navigator = navigator();
    let step = |navigator: &mut Navigator, now: f64| {
        navigator.step(now, Pose::default(), Twist::ZERO, Point::new(3.0, 0.0))
    };
    assert_eq!(step(&mut navigator, 0.0).doing, Doing::Blind);
    let ranges = [10.0f32; 9];
    let beams = Ring::Sweep { angle_min: -1.0, angle_step: 0.25, ranges: &ranges };
    let scan = Scan { time: 0.0, robot_from_sensor: Pose::default(), beams, range_max: 9.9 };
    navigator.look(&scan, Pose::default());
    assert_eq!(step(&mut navigator, 0.2).doing, Doing::Pursuing);
    let old = step(&mut navigator, 0.4);
    assert_eq!((old.doing, old.twist), (Doing::Blind, Twist::ZERO));
}
