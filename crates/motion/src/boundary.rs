//! The hand rule for a round body among points: which ways are free, and which of them keeps a hand on the wall.
//!
//! ```text
//!        · · ·  anchor                 The sweep begins at the anchor, the point that the hand touches, and turns away from it until
//!       ·     ╲  │  ╱ first free way   the body fits through: that is the way along the wall. A gap that is wide enough is entered, a
//!      ·       ╲ │ ╱                   narrower one is wall.
//!     ·         (R)  ──▶ sweep
//! ```
//!
//! What is in the way is a set of points in the frame of the robot, of a map or of a scan; the wall is on the left. For a wall on the
//! right mirror the points and the answer.

use libm::{cos, fabs, fmin, sin, sqrt};
use types::Point;
use types::geometry::{TAU, wrap};

/// Directions of a fan: 5° apart, so two ways are told apart that differ by 4 cm at half a metre.
pub const DIRECTIONS: usize = 72;

/// The unit vectors of all directions, counter-clockwise from straight ahead; made once.
#[derive(Clone, Copy, Debug)]
pub struct Compass([Point; DIRECTIONS]);

impl Default for Compass {
    fn default() -> Compass {
        Compass(core::array::from_fn(|i| Point::new(cos(bearing(i)), sin(bearing(i)))))
    }
}

/// The bearing of a direction (rad), within ±π.
pub fn bearing(direction: usize) -> f64 {
    wrap(direction as f64 * TAU / DIRECTIONS as f64)
}

/// The direction that is nearest to a bearing (rad).
pub fn direction(bearing: f64) -> usize {
    let steps = libm::round(bearing * DIRECTIONS as f64 / TAU) as i64;
    steps.rem_euclid(DIRECTIONS as i64) as usize
}

/// How far a body may go straight on in each direction (m), and what stops it there.
///
/// A direction is looked at when it is asked for: a way is chosen after a few of them, and for the question whether one is free the
/// first point that is in the way is answer enough.
#[derive(Clone, Copy, Debug)]
pub struct Fan<'a, P> {
    compass: &'a Compass,
    points: P,
    room: f64,
}

/// What is nearer than wanted already may stay as near, less this (m).
const NO_NEARER: f64 = 0.01;

impl<'a, P: Iterator<Item = Point> + Clone> Fan<'a, P> {
    /// The free ways among `points` for a body that wants `room` (m) from its middle to everything.
    ///
    /// A point at distance ρ, off the direction by δ, stops the body after ρ cos δ − √(room² − ρ² sin² δ). With a point nearer than
    /// `room` already it may go where it comes no nearer: then its distance counts in place of the room.
    pub fn new(compass: &'a Compass, points: P, room: f64) -> Fan<'a, P> {
        Fan { compass, points, room }
    }

    /// The free way in a direction (m); infinite if nothing is there.
    pub fn way(&self, direction: usize) -> f64 {
        self.nearest(direction).0
    }

    /// What stops the body in a direction; of two points that stop it at the same place the first.
    pub fn stop(&self, direction: usize) -> Option<Point> {
        self.nearest(direction).1
    }

    /// Whether the way in a direction is free for `look` (m).
    pub fn is_free(&self, direction: usize, look: f64) -> bool {
        self.first_free([direction], look).is_some()
    }

    /// The first direction, from `start` clockwise, in which the way is free for `look` (m).
    pub fn sweep(&self, start: usize, look: f64) -> Option<Found> {
        let clockwise = (0..DIRECTIONS).map(|step| (start + DIRECTIONS - step) % DIRECTIONS);
        let direction = self.first_free(clockwise, look)?;
        Some(Found { turned: (start + DIRECTIONS - direction) % DIRECTIONS, direction })
    }

    /// What the hand touches: the point that stopped the last try of a sweep. None if the first one was free.
    pub fn touched(&self, found: Found) -> Option<Point> {
        if found.turned == 0 { None } else { self.stop(found.direction + 1) }
    }

    /// The free direction that is nearest to `wanted`, off by no more than `most` (rad).
    pub fn nearest_free(&self, wanted: usize, look: f64, most: f64) -> Option<usize> {
        let steps = (most / TAU * DIRECTIONS as f64) as usize;
        let outwards = (0..=steps).flat_map(|step| [wanted + DIRECTIONS - step, wanted + step]);
        self.first_free(outwards.map(|i| i % DIRECTIONS), look)
    }

    /// The first of these directions in which the way is free for `look` (m).
    fn first_free(&self, directions: impl IntoIterator<Item = usize>, look: f64) -> Option<usize> {
        let mut known = None;
        directions.into_iter().find(|direction| {
            let towards = self.towards(*direction);
            let is_in_the_way = |point: &Point| self.way_to(*point, towards) < look;
            // What was in the way in one direction mostly is in the next one too.
            known = known.filter(is_in_the_way).or_else(|| self.points.clone().find(is_in_the_way));
            known.is_none()
        })
    }

    /// The free way in a direction (m), and what ends it.
    fn nearest(&self, direction: usize) -> (f64, Option<Point>) {
        let towards = self.towards(direction);
        self.points.clone().fold((f64::INFINITY, None), |(way, stop), point| {
            let to = self.way_to(point, towards);
            if to < way { (to, Some(point)) } else { (way, stop) }
        })
    }

    fn towards(&self, direction: usize) -> Point {
        self.compass.0[direction % DIRECTIONS]
    }

    /// How far it may go `towards` (a unit vector) for all that one point is in the way (m).
    fn way_to(&self, point: Point, towards: Point) -> f64 {
        let (along, across) = (point.dot(towards), point.cross(towards));
        // Most points are behind or beside the way, and their distance is dear.
        if !(along > 0.0 && across * across < self.room * self.room) {
            return f64::INFINITY;
        }
        let room = self.room_to(point);
        let under = room * room - across * across;
        if room > 0.0 && under > 0.0 { along - sqrt(under) } else { f64::INFINITY }
    }

    /// How much room is kept to a point (m): as much as is wanted, or as there is.
    fn room_to(&self, point: Point) -> f64 {
        // The last digit counts only for what is nearer than wanted.
        let enough = self.room + 2.0 * NO_NEARER;
        if point.dot(point) > enough * enough { self.room } else { fmin(self.room, point.norm() - NO_NEARER) }
    }
}

/// The way along the wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// How many directions were tried in vain.
    pub turned: usize,
    /// The free one.
    pub direction: usize,
}

/// How far two directions are apart (rad).
pub fn apart(a: usize, b: usize) -> f64 {
    fabs(wrap(bearing(a) - bearing(b)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;
    use types::geometry::PI;

    /// A wall along x at y, from a to b, a point every 5 cm.
    fn wall(y: f64, from: f64, to: f64) -> Vec<Point> {
        (0..=((to - from) / 0.05) as usize).map(|i| Point::new(from + 0.05 * i as f64, y)).collect()
    }

    fn fan<'a>(
        compass: &'a Compass,
        points: &'a [Point],
        room: f64,
    ) -> Fan<'a, impl Iterator<Item = Point> + Clone> {
        Fan::new(compass, points.iter().copied(), room)
    }

    #[test]
    fn a_single_point_stops_a_disc_where_it_touches() {
        let (compass, points) = (Compass::default(), [Point::new(1.0, 0.1)]);
        let fan = fan(&compass, &points, 0.3);
        assert!((fan.way(0) - (1.0 - (0.09f64 - 0.01).sqrt())).abs() < 1e-12);
        assert_eq!((fan.way(direction(PI / 2.0)), fan.stop(direction(PI / 2.0))), (f64::INFINITY, None));
    }

    #[test]
    fn the_sweep_goes_along_a_wall_on_the_left() {
        let (compass, points) = (Compass::default(), wall(0.3, -2.0, 2.0));
        let fan = fan(&compass, &points, 0.28);
        let found = fan.sweep(direction(PI / 2.0), 0.7).unwrap();
        assert_eq!(bearing(found.direction).to_degrees().round(), 0.0);
        assert!(fan.touched(found).unwrap().x > 0.0);
        assert_eq!(fan.touched(fan.sweep(direction(-PI / 2.0), 0.7).unwrap()), None);
    }

    #[test]
    fn a_gap_is_entered_when_the_body_fits_and_passed_when_not() {
        for (gap, enters) in [(0.66, true), (0.5, false)] {
            let mut points = wall(0.4, -2.0, -gap / 2.0);
            points.extend(wall(0.4, gap / 2.0, 2.0));
            let found = fan(&Compass::default(), &points, 0.28).sweep(direction(2.5), 0.7).unwrap();
            assert_eq!(bearing(found.direction) > 1.2, enters, "{gap} m: {found:?}");
        }
    }

    #[test]
    fn from_too_near_it_may_go_away_and_along_but_not_nearer() {
        let (compass, points) = (Compass::default(), wall(0.2, -2.0, 2.0));
        let fan = fan(&compass, &points, 0.4);
        assert!(fan.way(direction(PI / 2.0)) < 0.05 && fan.way(direction(-PI / 2.0)).is_infinite());
        assert!(fan.sweep(direction(PI / 2.0), 0.5).is_some_and(|found| bearing(found.direction) > -1.3));
    }

    #[test]
    fn all_around_closed_there_is_no_way() {
        let ring: Vec<Point> = (0..72).map(|i| Point::polar(0.5, f64::from(i) * PI / 36.0)).collect();
        assert_eq!(fan(&Compass::default(), &ring, 0.28).sweep(0, 0.7), None);
    }

    /// The ways as their law says it: each point, each direction, no shorter way.
    fn by_hand(points: &[Point], room: f64) -> [(f64, Option<Point>); DIRECTIONS] {
        let compass = Compass::default();
        let mut ways = [(f64::INFINITY, None); DIRECTIONS];
        for &point in points {
            let room = fmin(room, point.norm() - NO_NEARER);
            for (towards, way) in compass.0.into_iter().zip(&mut ways) {
                let (along, across) = (point.dot(towards), point.cross(towards));
                let under = room * room - across * across;
                if room > 0.0 && along > 0.0 && under > 0.0 && along - sqrt(under) < way.0 {
                    *way = (along - sqrt(under), Some(point));
                }
            }
        }
        ways
    }

    proptest! {
        #[test]
        fn a_fan_is_to_the_last_bit_that_of_the_law(
            points in proptest::collection::vec((0.0f64..2.0, -3.2f64..3.2), 0..60), room in 0.0f64..0.6,
            look in 0.0f64..1.5, start in 0..DIRECTIONS, most in 0.0f64..2.0
        ) {
            let mut points: Vec<Point> = points.iter().map(|(r, b)| Point::polar(*r, *b)).collect();
            // Next to the edges: on the axes, and at the distances up to which a point counts in place of the room.
            points.extend([Point::new(0.0, 0.5), Point::new(-0.7, 0.0), Point::new(0.0, 0.0)]);
            points.extend([NO_NEARER, 2.0 * NO_NEARER].map(|more| Point::new(room + more, 0.0)));
            let compass = Compass::default();
            let fan = fan(&compass, &points, room);
            let known = by_hand(&points, room);
            for (i, way) in known.iter().enumerate() {
                prop_assert_eq!((fan.way(i), fan.stop(i)), *way);
                prop_assert_eq!(fan.is_free(i, look), way.0 >= look);
            }
            let is_free = |i: &usize| known[i % DIRECTIONS].0 >= look;
            let turned = (0..DIRECTIONS).find(|step| is_free(&(start + DIRECTIONS - step)));
            let found = fan.sweep(start, look);
            prop_assert_eq!(found.map(|found| found.turned), turned);
            if let Some(found) = found {
                let before = (found.direction + 1) % DIRECTIONS;
                prop_assert_eq!(found.direction, (start + DIRECTIONS - found.turned) % DIRECTIONS);
                prop_assert_eq!(fan.touched(found), if found.turned == 0 { None } else { known[before].1 });
            }
            let nearest = (0..DIRECTIONS)
                .filter(|i| is_free(i) && apart(start, *i) <= most)
                .fold(PI, |nearest, i| fmin(nearest, apart(start, i)));
            let found = fan.nearest_free(start, look, most).map_or(PI, |i| apart(start, i));
            prop_assert!(fabs(found - nearest) < 1e-9, "{found} {nearest}");
        }

        /// At the end of a free way nothing is nearer than the room, or nearer than it was.
        #[test]
        fn a_free_way_is_free(points in proptest::collection::vec((0.3f64..2.0, -3.1f64..3.1), 1..40), i in 0usize..72) {
            let points: Vec<Point> = points.iter().map(|(r, b)| Point::polar(*r, *b)).collect();
            let way = fmin(fan(&Compass::default(), &points, 0.3).way(i), 3.0);
            for k in 0..=20 {
                let here = Point::polar(way * f64::from(k) / 20.0, bearing(i));
                for p in &points {
                    prop_assert!(here.distance(*p) >= fmin(0.3, p.norm() - NO_NEARER) - 1e-9);
                }
            }
        }
    }
}
