//! The laws in a closed loop with a round point robot between line segments.

use motion::island::{Follower, Mode};
use motion::limits::{Forward, Limits, limit};
use motion::odometry::Increment;
use motion::ring::Ring;
use motion::safety;
use motion::wall::{Parameters, Side};
use motion::{Differential, Twist};
use types::geometry::{PI, TAU};
use types::{Point, Pose};

const RADIUS: f64 = 0.225;

/// Line segments, and a ring of beams that look at them.
#[derive(Clone)]
struct Room {
    walls: Vec<(Point, Point)>,
    beams: usize,
    cone: f64,
}

impl Room {
    fn of(beams: usize, walls: Vec<(Point, Point)>) -> Room {
        let cone = if beams <= 12 { PI / 12.0 } else { 0.0 };
        Room { walls, beams, cone }
    }

    /// Distance along a ray. A sonar hears nothing from a smooth wall that it meets at more than 25° from the perpendicular, except
    /// from the 5 cm next to an edge; a laser always does.
    fn ray(&self, from: Point, angle: f64) -> f64 {
        let way = Point::polar(1.0, angle);
        let (mut nearest, mut heard) = (f64::INFINITY, true);
        for &(a, b) in &self.walls {
            let (wall, off) = (b - a, a - from);
            let slant = way.cross(wall);
            let (t, s) = (off.cross(wall) / slant, off.cross(way) / slant);
            if slant != 0.0 && t > 0.0 && (0.0..=1.0).contains(&s) && t < nearest {
                let edge = s.min(1.0 - s) * wall.norm() < 0.05;
                let steep = slant.abs() / wall.norm() > 25f64.to_radians().cos();
                (nearest, heard) = (t, self.cone == 0.0 || edge || steep);
            }
        }
        if heard { nearest } else { f64::INFINITY }
    }

    /// First echo in each cone; nothing beyond 6 m.
    fn ring(&self, pose: Pose) -> Vec<(f64, f64)> {
        (0..self.beams)
            .map(|i| {
                let bearing = TAU * i as f64 / self.beams as f64;
                let rays = if self.cone > 0.0 { 15 } else { 0 };
                let range = (-rays..=rays)
                    .map(|k| bearing + self.cone * f64::from(k) / f64::from(rays.max(1)))
                    .map(|angle| self.ray(pose.position(), pose.heading + angle))
                    .fold(f64::INFINITY, f64::min);
                (bearing, if range > 6.0 { f64::INFINITY } else { range })
            })
            .collect()
    }

    fn clearance(&self, at: Point) -> f64 {
        let to = |&(a, b): &(Point, Point)| {
            let along = b - a;
            let s = ((at - a).dot(along) / along.dot(along)).clamp(0.0, 1.0);
            at.distance(a + along * s)
        };
        self.walls.iter().map(to).fold(f64::INFINITY, f64::min) - RADIUS
    }
}

fn loop_of(points: &[(f64, f64)]) -> Vec<(Point, Point)> {
    let at = |i: usize| Point::new(points[i % points.len()].0, points[i % points.len()].1);
    (0..points.len()).map(|i| (at(i), at(i + 1))).collect()
}

struct Run {
    path: Vec<Pose>,
    closest: f64,
    follower: Follower,
}

/// Readings four times a second, motion in between in small exact arcs.
///
/// The safety law and the limits stand between the follower and the wheels, as they do on a robot. The odometry reads 1 % long and
/// the ranges carry the noise of a sonar, 1 % and 1 cm, drawn from the number of the reading.
fn run(room: &Room, side: Side, start: Pose, seconds: f64) -> Run {
    let mut follower = Follower::new(Parameters { side, ..Parameters::new(RADIUS, room.cone) });
    let (mut pose, mut moved, mut path, mut closest) =
        (start, Increment::default(), vec![start], f64::INFINITY);
    let dt = 0.25;
    let careful = safety::Parameters::new(RADIUS, room.cone, dt);
    let limits = Limits::indoor(Differential::new(0.08, 0.36));
    let mut present = Twist::ZERO;
    for _ in 0..(seconds / dt) as usize {
        let ring = noisy(room.ring(pose), path.len());
        let ring = Ring::Beams(&ring);
        let wish = follower.step(ring, Increment { distance: moved.distance * 1.01, ..moved }, dt);
        let verdict = safety::judge(&careful, ring, ring, present);
        let wish = Twist { linear: wish.linear.min(verdict.linear_max), ..wish };
        let twist = limit(&limits, wish, present, Forward::Allowed, dt).twist;
        present = twist;
        assert!(twist.angular.is_finite() && twist.linear >= 0.0, "{twist:?}");
        moved = Increment { distance: twist.linear * dt, turn: twist.angular * dt };
        for _ in 0..5 {
            pose = pose.along_arc(moved.distance / 5.0, moved.turn / 5.0);
            closest = closest.min(room.clearance(pose.position()));
        }
        path.push(pose);
    }
    Run { path, closest, follower }
}

/// Uniform noise of ±(1 % + 1 cm), a pure function of reading and beam.
fn noisy(mut ring: Vec<(f64, f64)>, reading: usize) -> Vec<(f64, f64)> {
    for (i, (_, range)) in ring.iter_mut().enumerate() {
        let mut bits = (reading as u64 * 1009 + i as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        bits = (bits ^ (bits >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let unit = (bits >> 11) as f64 / (1u64 << 52) as f64 - 1.0;
        *range += unit * (0.01 * *range + 0.01);
    }
    ring
}

fn each(check: impl Fn(usize, Side)) {
    for beams in [12, 36, 90] {
        for side in [Side::Left, Side::Right] {
            check(beams, side);
        }
    }
}

/// The world is built for a wall on the left; its image serves the right.
fn mirrored(side: Side, walls: Vec<(Point, Point)>) -> Vec<(Point, Point)> {
    let flip = |p: Point| Point::new(p.x, p.y * side.sign());
    walls.into_iter().map(|(a, b)| (flip(a), flip(b))).collect()
}

#[test]
fn a_straight_wall_is_kept_at_its_distance_from_every_start() {
    each(|beams, side| {
        for (y, heading) in [(0.5, 0.0), (0.0, 0.4), (0.75, -0.4), (0.2, -0.5), (0.3, 0.9)] {
            let walls = mirrored(side, vec![(Point::new(-5.0, 1.0), Point::new(40.0, 1.0))]);
            let room = Room::of(beams, walls);
            let start = Pose::new(0.0, y * side.sign(), heading * side.sign());
            let run = run(&room, side, start, 60.0);
            assert!(run.closest > 0.0, "{beams} {side:?} from {y} {heading}: touched");
            for pose in &run.path[120..] {
                let distance = (1.0 - pose.y * side.sign()).abs();
                assert!(
                    (distance - 0.45).abs() < 0.05,
                    "{beams} {side:?} from {y} {heading}: {distance} m at {pose:?}"
                );
            }
            assert!(run.path.last().unwrap().x > 12.0, "{beams} {side:?}: {:?}", run.path.last());
        }
    });
}

#[test]
fn a_room_with_concave_and_convex_corners_is_gone_round() {
    each(|beams, side| {
        let l = loop_of(&[(0.0, 0.0), (6.0, 0.0), (6.0, 5.0), (3.0, 5.0), (3.0, 2.5), (0.0, 2.5)]);
        let room = Room::of(beams, mirrored(side, l));
        let run = run(&room, side, Pose::new(1.0, 1.8 * side.sign(), 0.0), 200.0);
        assert!(run.closest > 0.0, "{beams} {side:?}: {}", run.closest);
        // All arms of the room are visited, and it is no island.
        for (x, y) in [(0.6, 0.6), (5.4, 0.6), (5.4, 4.4), (3.6, 4.4), (0.6, 1.9)] {
            let near = run
                .path
                .iter()
                .map(|p| p.position().distance(Point::new(x, y * side.sign())))
                .fold(9.0, f64::min);
            assert!(near < 0.5, "{beams} {side:?}: never came near ({x}, {y})");
        }
        assert_eq!((run.follower.islands_left(), run.follower.mode()), (0, Mode::Following));
    });
}

/// A room of 4 m × 4 m with a door 0.9 m wide in the wall at y = 4, out to a corridor 1.6 m wide.
fn room_with_door(thickness: f64) -> Vec<(Point, Point)> {
    let outside = 4.0 + thickness;
    let mut walls = loop_of(&[(-4.0, 4.0), (2.0, 4.0), (2.0, outside), (-4.0, outside)]);
    let house = [
        (2.9, 4.0),
        (4.0, 4.0),
        (4.0, 0.0),
        (0.0, 0.0),
        (0.0, -0.2),
        (8.0, -0.2),
        (8.0, outside),
        (2.9, outside),
    ];
    walls.extend(loop_of(&house));
    walls.push((Point::new(0.0, 0.0), Point::new(0.0, 4.0)));
    walls.push((Point::new(-4.0, outside + 1.6), Point::new(8.0, outside + 1.6)));
    walls
}

#[test]
fn a_door_of_90_cm_is_passed_where_the_wall_leads_there() {
    each(|beams, side| {
        for (thickness, x, y, heading) in
            [(0.05, 0.5, 3.55, -0.4), (0.15, 0.8, 3.4, 0.0), (0.3, 1.0, 3.2, 0.3), (0.15, 0.5, 2.8, 0.0)]
        {
            let room = Room::of(beams, mirrored(side, room_with_door(thickness)));
            let run = run(&room, side, Pose::new(x, y * side.sign(), heading * side.sign()), 60.0);
            assert!(run.closest > 0.0, "{beams} {side:?}: {}", run.closest);
            let out = run.path.iter().any(|p| p.y * side.sign() > 4.4 + thickness);
            assert!(out, "{beams} {side:?} through {thickness} m from {x} {y} {heading}: stayed inside");
        }
    });
}

#[test]
fn an_island_of_any_size_is_circled_once_and_left_for_the_wall() {
    each(|beams, side| {
        for (width, depth) in [(0.1, 0.1), (0.4, 0.4), (1.5, 0.8), (0.05, 2.0)] {
            let mut walls = loop_of(&[(0.0, 0.0), (10.0, 0.0), (10.0, 8.0), (0.0, 8.0)]);
            walls.extend(loop_of(&[
                (4.0, 3.5),
                (4.0 + width, 3.5),
                (4.0 + width, 3.5 + depth),
                (4.0, 3.5 + depth),
            ]));
            let room = Room::of(beams, mirrored(side, walls));
            // Beside the island, with it on the followed side.
            let run = run(&room, side, Pose::new(3.8, 3.0 * side.sign(), 0.0), 240.0);
            assert!(run.closest > 0.0, "{beams} {side:?}: {}", run.closest);
            assert_eq!(run.follower.islands_left(), 1, "{beams} {side:?} around {width} by {depth}");
            let at_wall = |p: &Pose| p.x < 0.7 || p.x > 9.3 || p.y.abs() < 0.7 || p.y.abs() > 7.3;
            let late = run.path[run.path.len() - 200..].iter().filter(|p| at_wall(p)).count();
            assert!(late > 190, "{beams} {side:?}: at the wall for {late} of the last 200 readings");
        }
    });
}

#[test]
fn a_crowded_room_is_left_by_its_door() {
    // Left, lower edge, width, depth: tables at the walls and in the middle, ways of 0.75 m and more between them.
    let crowds: [&[(f64, f64, f64, f64)]; 3] = [
        &[(1.2, 1.2, 0.8, 0.6), (0.0, 2.6, 0.6, 0.6), (2.8, 0.0, 0.5, 1.0)],
        &[(2.0, 2.0, 0.5, 0.5), (1.4, 0.0, 0.6, 0.7), (3.3, 1.2, 0.7, 0.7)],
        &[(1.5, 1.0, 0.3, 1.4), (2.9, 1.2, 0.3, 0.3), (0.0, 2.0, 0.5, 0.4)],
    ];
    each(|beams, side| {
        for (i, crowd) in crowds.iter().enumerate() {
            let mut walls = room_with_door(0.15);
            for &(x, y, w, h) in *crowd {
                walls.extend(loop_of(&[(x, y), (x + w, y), (x + w, y + h), (x, y + h)]));
            }
            let room = Room::of(beams, mirrored(side, walls));
            let run = run(&room, side, Pose::new(0.6, 0.6 * side.sign(), 0.6 * side.sign()), 180.0);
            assert!(run.closest > 0.0, "{beams} {side:?} crowd {i}: {}", run.closest);
            let out = run.path.iter().any(|p| p.y * side.sign() > 4.5);
            assert!(
                out,
                "{beams} {side:?} crowd {i}: stayed inside, {} islands",
                run.follower.islands_left()
            );
        }
    });
}

#[test]
fn in_a_narrow_corridor_it_keeps_to_the_middle() {
    each(|beams, side| {
        let ends = |y: f64| (Point::new(-3.0, y), Point::new(40.0, y));
        let room = Room::of(beams, mirrored(side, vec![ends(0.35), ends(-0.35)]));
        let run = run(&room, side, Pose::new(0.0, 0.06, 0.1), 60.0);
        assert!(run.closest > 0.0, "{beams} {side:?}: touched");
        for pose in &run.path[80..] {
            assert!(pose.y.abs() < 0.05, "{beams} {side:?}: {} m off the middle", pose.y);
        }
        assert!(run.path.last().unwrap().x > 10.0, "{beams} {side:?}: {:?}", run.path.last());
    });
}
