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

use core::ops::Range;
use libm::{cos, fabs, fmax, fmin, sin, sqrt};
use types::Point;
use types::geometry::{PI, TAU, wrap};

/// Directions of a fan: 5° apart, so two ways are told apart that differ by 4 cm at half a metre.
pub const DIRECTIONS: usize = 72;

/// The unit vectors of all directions, counter-clockwise from straight ahead; made once.
#[derive(Clone, Copy, Debug)]
pub struct Compass {
    /// Their coordinates in rows of their own, so that several directions are compared at a time.
    x: [f64; DIRECTIONS],
    y: [f64; DIRECTIONS],
}

impl Default for Compass {
    fn default() -> Compass {
        Compass { x: core::array::from_fn(|i| cos(bearing(i))), y: core::array::from_fn(|i| sin(bearing(i))) }
    }
}

impl Compass {
    #[inline]
    fn at(&self, direction: usize) -> Point {
        Point::new(self.x[direction], self.y[direction])
    }

    /// Whether a point lies less far ahead than `limits` in one of these directions.
    #[inline]
    fn is_within(&self, directions: Range<usize>, point: Point, limits: &[f64; DIRECTIONS]) -> bool {
        let (x, y) = (&self.x[directions.clone()], &self.y[directions.clone()]);
        let limits = &limits[directions];
        // No way out at the first one: that would keep it from being done for several at a time.
        let rows = x.iter().zip(y).zip(limits);
        rows.fold(false, |any, ((x, y), limit)| any | (point.x * x + point.y * y < *limit))
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

/// The direction of a point to within 0.55 steps: half a step more is within the steps that [`span`] gives.
///
/// The arc tangent by a parabola, which errs by 0.004 rad at most (Rajan et al., "Efficient approximations for the arctangent
/// function", 2006).
fn roughly(point: Point) -> usize {
    let (x, y) = (fabs(point.x), fabs(point.y));
    let arc = |ratio: f64| ratio * (PI / 4.0 + 0.273 * (1.0 - ratio));
    let acute = if y <= x { arc(y / x) } else { PI / 2.0 - arc(x / y) };
    let ahead = if point.x < 0.0 { PI - acute } else { acute };
    let around = if point.y < 0.0 { TAU - ahead } else { ahead };
    (around * (DIRECTIONS as f64 / TAU) + 0.5) as usize % DIRECTIONS
}

/// So many steps to either side, at least, a point can be in the way whose room is `ratio` of its distance.
///
/// Those within asin(ratio) of its bearing; asin(x) ≤ x + (π/2 − 1) x³, as all terms of its series are positive.
fn span(ratio: f64) -> usize {
    let half = ratio + (PI / 2.0 - 1.0) * ratio * ratio * ratio;
    // The direction next to the bearing is up to 0.55 steps off, and 0.45 steps lie between a whole number and the next of these.
    (half * (DIRECTIONS as f64 / TAU) + 1.0) as usize
}

/// How far a body may go straight on in each direction (m), and what stops it there.
#[derive(Clone, Copy, Debug)]
pub struct Fan {
    ways: [f64; DIRECTIONS],
    stops: [Point; DIRECTIONS],
}

/// What is nearer than wanted already may stay as near, less this (m).
const NO_NEARER: f64 = 0.01;

impl Fan {
    /// The free ways for a body that wants `room` (m) from its middle to everything.
    ///
    /// A point at distance ρ, off the direction by δ, stops the body after ρ cos δ − √(room² − ρ² sin² δ). With a point nearer than
    /// `room` already it may go where it comes no nearer: then its distance counts in place of the room.
    pub fn new(compass: &Compass, points: impl Iterator<Item = Point>, room: f64) -> Fan {
        let [fan] = Fan::of_rooms(compass, points, [room]);
        fan
    }

    /// The fans for several rooms (m), at little more than the price of the largest.
    pub fn of_rooms<const N: usize>(
        compass: &Compass,
        points: impl Iterator<Item = Point>,
        rooms: [f64; N],
    ) -> [Fan; N] {
        let mut drawing = Drawing::new(compass, rooms);
        let mut batch = Batch::default();
        for (number, point) in points.enumerate() {
            batch.put(number, point);
            if batch.len == BATCH {
                batch.draw(&mut drawing);
            }
        }
        batch.draw(&mut drawing);
        drawing.fans
    }

    /// The free way in a direction (m); infinite if nothing is there.
    pub fn way(&self, direction: usize) -> f64 {
        self.ways[direction % DIRECTIONS]
    }

    /// What stops the body in a direction.
    pub fn stop(&self, direction: usize) -> Point {
        self.stops[direction % DIRECTIONS]
    }

    /// The first direction, from `start` clockwise, in which the way is free for `look` (m), and the point that stopped the direction before.
    pub fn sweep(&self, start: usize, look: f64) -> Option<Found> {
        let mut touched = None;
        for step in 0..DIRECTIONS {
            let i = (start + DIRECTIONS - step) % DIRECTIONS;
            if self.ways[i] >= look {
                return Some(Found { turned: step, direction: i, touched });
            }
            touched = Some(self.stops[i]);
        }
        None
    }

    /// The free direction that is nearest to `wanted`, off by no more than `most` (rad).
    pub fn nearest_free(&self, wanted: usize, look: f64, most: f64) -> Option<usize> {
        let steps = (most / TAU * DIRECTIONS as f64) as usize;
        (0..=steps)
            .flat_map(|step| [wanted + DIRECTIONS - step, wanted + step])
            .map(|i| i % DIRECTIONS)
            .find(|&i| self.ways[i] >= look)
    }
}

/// Points that are looked at together; a map of a room gives fewer.
const BATCH: usize = 512;

/// Points in the order of their distance: what is near hides most of the rest, which then costs next to nothing.
struct Batch {
    points: [Point; BATCH],
    /// The square of the distance as bits, which are in order where numbers are; in the low digits the place of the point.
    keys: [u64; BATCH],
    len: usize,
    /// The number of the first point.
    first: usize,
}

impl Default for Batch {
    fn default() -> Batch {
        Batch { points: [Point::new(0.0, 0.0); BATCH], keys: [0; BATCH], len: 0, first: 0 }
    }
}

impl Batch {
    fn put(&mut self, number: usize, point: Point) {
        if self.len == 0 {
            self.first = number;
        }
        self.points[self.len] = point;
        self.keys[self.len] = point.dot(point).to_bits() & !(BATCH as u64 - 1) | self.len as u64;
        self.len += 1;
    }

    /// Draws the points and forgets them.
    fn draw<const N: usize>(&mut self, drawing: &mut Drawing<'_, N>) {
        let keys = &mut self.keys[..self.len];
        keys.sort_unstable();
        for key in keys {
            let place = *key as usize % BATCH;
            drawing.add(self.first + place, self.points[place]);
        }
        self.len = 0;
    }
}

/// Fans in the making.
struct Drawing<'a, const N: usize> {
    compass: &'a Compass,
    rooms: [f64; N],
    /// The largest of them.
    most: f64,
    fans: [Fan; N],
    /// The numbers of the points that stop the body: of two that stop it at the same place the first counts, whatever the order in
    /// which they are looked at.
    numbers: [[usize; DIRECTIONS]; N],
    /// What lies as far ahead as this shortens no way of any fan.
    limits: [f64; DIRECTIONS],
}

/// More than the error of a sum of two lengths (m).
const HAIR: f64 = 1e-9;

impl<'a, const N: usize> Drawing<'a, N> {
    fn new(compass: &'a Compass, rooms: [f64; N]) -> Drawing<'a, N> {
        const FREE: Fan =
            Fan { ways: [f64::INFINITY; DIRECTIONS], stops: [Point::new(0.0, 0.0); DIRECTIONS] };
        Drawing {
            compass,
            rooms,
            most: rooms.iter().copied().fold(0.0, fmax),
            fans: [FREE; N],
            numbers: [[0; DIRECTIONS]; N],
            limits: [f64::INFINITY; DIRECTIONS],
        }
    }

    /// Takes in a point.
    fn add(&mut self, number: usize, point: Point) {
        let away = sqrt(point.dot(point));
        // The last digit counts only for what is nearer than wanted, and it is dear.
        let distance = if away > self.most + 2.0 * NO_NEARER { away } else { point.norm() };
        let rooms = self.rooms.map(|room| fmin(room, distance - NO_NEARER));
        let widest = rooms.iter().copied().fold(0.0, fmax);
        if widest <= 0.0 {
            return;
        }
        let span = span(widest / distance);
        let first = (roughly(point) + DIRECTIONS - span) % DIRECTIONS;
        let last = first + 2 * span + 1;
        // The directions lie in a circle.
        for directions in [first..last.min(DIRECTIONS), 0..last.saturating_sub(DIRECTIONS)] {
            if self.compass.is_within(directions.clone(), point, &self.limits) {
                directions.for_each(|i| self.offer(i, number, point, &rooms));
            }
        }
    }

    /// A point that may stop the body in direction `i`.
    fn offer(&mut self, i: usize, number: usize, point: Point, rooms: &[f64; N]) {
        let along = point.dot(self.compass.at(i));
        if along <= 0.0 || along >= self.limits[i] {
            return;
        }
        let across = point.cross(self.compass.at(i));
        // Most is too late for all fans: one branch for them together.
        let may_stop: [bool; N] = core::array::from_fn(|k| {
            let under = rooms[k] * rooms[k] - across * across;
            let behind = along - self.fans[k].ways[i];
            // along − √under > way where (along − way)² > under. What is as near to equal as rounding may be is looked at.
            let too_late = (behind > 0.0) & (behind * behind > under + HAIR * (1.0 + along * along));
            (rooms[k] > 0.0) & (under > 0.0) & !too_late
        });
        if !may_stop.iter().fold(false, |any, may| any | may) {
            return;
        }
        for k in (0..N).filter(|k| may_stop[*k]) {
            let fan = &mut self.fans[k];
            let way = along - sqrt(rooms[k] * rooms[k] - across * across);
            if way < fan.ways[i] || (way == fan.ways[i] && number < self.numbers[k][i]) {
                (fan.ways[i], fan.stops[i], self.numbers[k][i]) = (way, point, number);
            }
        }
        self.limit(i);
    }

    fn limit(&mut self, i: usize) {
        let farthest = self.fans.iter().zip(self.rooms).map(|(fan, room)| fan.ways[i] + fmax(room, 0.0));
        self.limits[i] = farthest.fold(0.0, fmax) + HAIR;
    }
}

/// The way along the wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// How many directions were tried in vain.
    pub turned: usize,
    /// The free one.
    pub direction: usize,
    /// What the hand touches: the point that stopped the last try. None if the first one was free.
    pub touched: Option<Point>,
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

    fn fan(points: &[Point], room: f64) -> Fan {
        Fan::new(&Compass::default(), points.iter().copied(), room)
    }

    #[test]
    fn a_single_point_stops_a_disc_where_it_touches() {
        let fan = fan(&[Point::new(1.0, 0.1)], 0.3);
        assert!((fan.way(0) - (1.0 - (0.09f64 - 0.01).sqrt())).abs() < 1e-12);
        assert_eq!(fan.way(direction(PI / 2.0)), f64::INFINITY);
    }

    #[test]
    fn the_sweep_goes_along_a_wall_on_the_left() {
        let points = wall(0.3, -2.0, 2.0);
        let found = fan(&points, 0.28).sweep(direction(PI / 2.0), 0.7).unwrap();
        assert_eq!(bearing(found.direction).to_degrees().round(), 0.0);
        assert!(found.touched.unwrap().x > 0.0);
    }

    #[test]
    fn a_gap_is_entered_when_the_body_fits_and_passed_when_not() {
        for (gap, enters) in [(0.66, true), (0.5, false)] {
            let mut points = wall(0.4, -2.0, -gap / 2.0);
            points.extend(wall(0.4, gap / 2.0, 2.0));
            let found = fan(&points, 0.28).sweep(direction(2.5), 0.7).unwrap();
            assert_eq!(bearing(found.direction) > 1.2, enters, "{gap} m: {found:?}");
        }
    }

    #[test]
    fn from_too_near_it_may_go_away_and_along_but_not_nearer() {
        let fan = fan(&wall(0.2, -2.0, 2.0), 0.4);
        assert!(fan.way(direction(PI / 2.0)) < 0.05 && fan.way(direction(-PI / 2.0)).is_infinite());
        assert!(fan.sweep(direction(PI / 2.0), 0.5).is_some_and(|found| bearing(found.direction) > -1.3));
    }

    #[test]
    fn all_around_closed_there_is_no_way() {
        let ring: Vec<Point> = (0..72).map(|i| Point::polar(0.5, f64::from(i) * PI / 36.0)).collect();
        assert_eq!(fan(&ring, 0.28).sweep(0, 0.7), None);
    }

    /// The fan for one room as its law says it: each point, each direction, no shorter way.
    fn by_hand(points: &[Point], room: f64) -> Fan {
        let compass = Compass::default();
        let mut fan = Fan { ways: [f64::INFINITY; DIRECTIONS], stops: [Point::default(); DIRECTIONS] };
        for &point in points {
            let room = fmin(room, point.norm() - NO_NEARER);
            for i in 0..if room > 0.0 { DIRECTIONS } else { 0 } {
                let (along, across) = (point.dot(compass.at(i)), point.cross(compass.at(i)));
                let under = room * room - across * across;
                if along > 0.0 && under > 0.0 && along - sqrt(under) < fan.ways[i] {
                    (fan.ways[i], fan.stops[i]) = (along - sqrt(under), point);
                }
            }
        }
        fan
    }

    proptest! {
        #[test]
        fn fans_made_together_are_to_the_last_bit_those_of_the_law(
            points in proptest::collection::vec((0.0f64..2.0, -3.2f64..3.2), 0..60),
            rooms in [0.0f64..0.6, 0.0f64..0.6, 0.0f64..0.6]
        ) {
            let mut points: Vec<Point> = points.iter().map(|(r, b)| Point::polar(*r, *b)).collect();
            // Next to the edges: on the axes, and at the distance up to which a point counts in place of the room.
            points.extend([Point::new(0.0, 0.5), Point::new(-0.7, 0.0), Point::new(0.0, 0.0), Point::new(rooms[0] + NO_NEARER, 0.0)]);
            let fans = Fan::of_rooms(&Compass::default(), points.iter().copied(), rooms);
            for (fan, room) in fans.iter().zip(rooms) {
                let known = by_hand(&points, room);
                prop_assert_eq!(fan.ways, known.ways);
                prop_assert_eq!(fan.stops, known.stops);
            }
        }

        /// At the end of a free way nothing is nearer than the room, or nearer than it was.
        #[test]
        fn a_free_way_is_free(points in proptest::collection::vec((0.3f64..2.0, -3.1f64..3.1), 1..40), i in 0usize..72) {
            let points: Vec<Point> = points.iter().map(|(r, b)| Point::polar(*r, *b)).collect();
            let fan = fan(&points, 0.3);
            let way = fmin(fan.way(i), 3.0);
            for k in 0..=20 {
                let here = Point::polar(way * f64::from(k) / 20.0, bearing(i));
                for p in &points {
                    prop_assert!(here.distance(*p) >= fmin(0.3, p.norm() - NO_NEARER) - 1e-9);
                }
            }
        }
    }
}
