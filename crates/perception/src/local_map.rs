//! What is around the robot, from the echoes of a ring of sonars while it moves: evidence on a fine grid.
//!
//! In plain words: a sonar tells how far the nearest thing in its cone is, but not where in the cone. Between two neighbouring
//! sonars on a rim lies a strip that neither hears, and a smooth face that is met obliquely is silent. So one reading alone
//! knows little. The readings of the last seconds, each put where the robot was when it was made, know much more:
//! a corner is where the arcs of many echoes cross, a door is where an echo came from behind it, and a thing that cannot be heard just
//! now is where it was.
//!
//! How it works, for each echo at distance r from its sensor:
//!
//! | cells | evidence | why |
//! |---|---|---|
//! | nearer than r by more than the noise, well inside the cone | less | the echo would have come from there |
//! | on the arc at r, some of them surely occupied already | more, for those alone | they explain the echo |
//! | on the arc at r, else | more, for all | it came from one of them |
//!
//! Near echoes count more than far ones, because their arcs are short. Silence says nothing. (Free space and evidence on a grid: Moravec
//! and Elfes 1985. One echo one cause: the "mutual exclusion" of Konolige 1997.)

use libm::{cos, sin};
use types::geometry::whole;
use types::{Duration, Point, Pose, Time};

mod cells;
mod cone;
pub use cells::Squares;
use cells::{Cells, EVIDENCE, SIDE, SURE};
use cone::Cone;

/// Side of a cell (m). Half the reach of what two readings of one thing differ by, at 1 m.
pub const CELL: f64 = 0.05;
/// The part of a cone on which an echo is put, and the part in which it says that nothing is nearer: at the edges of a cone echoes are faint.
const ARC: f64 = 0.95;
const INSIDE: f64 = 0.9;
/// Within this of a sensor its cone is narrow, and what it tells counts double (m).
const NEARBY: f64 = 0.8;

/// The parts of a cone of which each is in the shadow of a face or not.
const SHADES: usize = 41;
/// So far around a cell its face is looked at (cells).
const FACE: i32 = 3;
/// A smooth face that is met farther than this off its normal is silent (rad): 20°, of the 15 to 25° that are measured.
const OBLIQUE: f64 = 0.4;

/// What is known of the sensors, and how long to remember.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapParams {
    /// From the robot's centre to the sensors, which is also the radius of its body (m). Default 0.225.
    pub rim: f64,
    /// Half the opening of a cone (rad). Default 15°, that of a common ultrasonic transducer.
    pub cone: f64,
    /// Echoes nearer to the sensor than this are told as this (m). Default 0.15.
    pub shortest: f64,
    /// Echoes farther than this from the robot's centre are not put into the map (m). Default 2: beyond, an arc is longer than a door is wide.
    pub reach: f64,
    /// An echo this much behind a cell says that the cell is free (m). Default 0.12: three standard deviations of a range, and a cell.
    pub behind: f64,
    /// How long a cell stays occupied that is not heard again. Default 30 s: so long may a robot turn about in a corner, and on so short a way
    /// the odometry drifts by centimetres.
    pub keep: Duration,
}

impl Default for MapParams {
    fn default() -> MapParams {
        MapParams {
            rim: 0.225,
            cone: 15.0 * types::geometry::PI / 180.0,
            shortest: 0.15,
            reach: 2.0,
            behind: 0.12,
            keep: Duration::secs(30),
        }
    }
}

/// The surroundings of a robot in the frame of its odometry: 6.4 m by 6.4 m, which move with it.
#[derive(Clone, Debug)]
pub struct LocalMap {
    params: MapParams,
    cells: Cells,
    arcs: Arcs,
    /// The places of the cells around the arc of an echo. There is room for the widest one, so no reading takes memory.
    arc: Vec<usize>,
}

/// Cells around an arc: as many as half a turn has at the usual reach, and twice that.
const ARC_CELLS: usize = 1024;

impl Default for LocalMap {
    fn default() -> LocalMap {
        LocalMap::new(MapParams::default())
    }
}

impl LocalMap {
    /// A map that knows nothing. The memory for all of it is taken here.
    pub fn new(params: MapParams) -> LocalMap {
        let arcs = Arcs::new(ARC * params.cone);
        LocalMap { params, cells: Cells::new(), arcs, arc: Vec::with_capacity(ARC_CELLS) }
    }

    /// Changes the parameters; what was heard is kept.
    pub fn set_params(&mut self, params: MapParams) {
        if params.cone != self.params.cone {
            self.arcs.open(ARC * params.cone);
        }
        self.params = params;
    }

    /// Forgets everything.
    pub fn reset(&mut self) {
        self.cells.clear();
    }

    /// Takes over a reading that was made at `pose`: bearing (rad) and distance from the robot's centre (m) of each echo. Directions
    /// without an echo are left out by the caller.
    pub fn update(&mut self, echoes: impl Iterator<Item = (f64, f64)> + Clone, pose: Pose, now: Time) {
        let tick = ticks(now);
        self.cells.follow(index(pose.position()));
        let heard = echoes.filter(|(bearing, range)| bearing.is_finite() && range.is_finite());
        for (bearing, range) in heard.clone() {
            self.clear_cone(Sensor::new(&self.params, pose, bearing), range - self.params.rim);
        }
        let reach = self.params.reach;
        for (bearing, range) in heard.filter(|(_, range)| *range <= reach) {
            self.put(Sensor::new(&self.params, pose, bearing), (range - self.params.rim).max(0.0), tick);
        }
        self.clear_body(pose);
    }

    /// The middles of the occupied cells within `reach` (m) of the robot, in its frame; `reach` is at most half of the map's width. Cells with
    /// less evidence than `least` are left out: 1 for those that may be occupied, 2 for those that were heard twice, or from nearby.
    pub fn around(
        &self,
        pose: Pose,
        reach: f64,
        now: Time,
        least: i8,
    ) -> impl Iterator<Item = Point> + Clone + '_ {
        let reach = reach.clamp(0.0, f64::from(SIDE / 2 - 1) * CELL);
        let ((x, y), span) = (index(pose.position()), whole(reach / CELL));
        let oldest = ticks(now).saturating_sub(ticks(Time::ZERO + self.params.keep));
        let (s, c) = (sin(pose.heading), cos(pose.heading));
        (y - span..=y + span)
            .flat_map(move |iy| {
                let off_y = middle_of(iy) - pose.y;
                let (ahead, left) = (s * off_y, c * off_y);
                let occupied = self.cells.occupied_in(iy, x - span, 2 * span + 1).filter(move |&ix| {
                    self.cells.heard(ix, iy) >= oldest
                        && self.cells.evidence(ix, iy).is_some_and(|evidence| evidence >= least)
                });
                occupied.map(move |ix| {
                    let off_x = middle_of(ix) - pose.x;
                    Point::new(c * off_x + ahead, left - s * off_x)
                })
            })
            .filter(move |point| point.is_within(reach))
    }

    /// What is known within `reach` (m, at most 3) of a place on squares of two cells by two, in rows: the middle of the first square of each row,
    /// the others follow along x. Nothing is known of what is farther than half the map's width from where the robot was at the last
    /// reading.
    pub fn squares(&self, place: Point, reach: f64) -> impl Iterator<Item = (Point, Squares)> + '_ {
        let reach = reach.clamp(0.0, 3.0);
        let half = |i: i32| i.div_euclid(2);
        let ((x, y), span) = (index(place), whole(reach / (2.0 * CELL)));
        let first = 2 * (half(x) - span);
        (half(y) - span..=half(y) + span).map(move |iy| {
            let middle = Point::new(f64::from(first + 1) * CELL, f64::from(2 * iy + 1) * CELL);
            (middle, self.cells.squares_in(first, 2 * iy, 2 * span + 1))
        })
    }

    /// Less evidence for what is nearer than an echo at `range` (m) from the sensor.
    fn clear_cone(&mut self, sensor: Sensor, range: f64) {
        let free = (range - self.params.behind).min(self.params.reach);
        // At its shortest range a sensor tells nothing of what is nearer.
        if range <= self.params.shortest + self.params.behind {
            return;
        }
        let widest = INSIDE * self.params.cone;
        let (origin, length) = (sensor.origin * (1.0 / CELL), free / CELL);
        // Where it is known to be free nothing changes, in a shadow or not.
        let doubtful = Cone { origin, axis: sensor.axis, length, slope: widest }.doubtful(&self.cells);
        let mut shadow = Shadow::new(widest);
        let (mut ring, mut away) = (0, CELL / 2.0);
        while away < free {
            let steps = whole(widest * away / CELL);
            let mut clear = |step| self.clear_place(sensor, away, f64::from(step) * CELL, &mut shadow);
            match &doubtful {
                Some(places) => places.on(ring).filter(|step| step.abs() <= steps).for_each(&mut clear),
                None => (-steps..=steps).for_each(&mut clear),
            }
            (ring, away) = (ring + 1, away + CELL);
        }
    }

    /// Less evidence for what is `away` from the sensor along its axis and `off` it to the left (m).
    fn clear_place(&mut self, sensor: Sensor, away: f64, off: f64, shadow: &mut Shadow) {
        let (ix, iy) = index(sensor.point(away, off));
        if self.cells.is_free(ix, iy) || shadow.covers(off / away) {
            return;
        }
        let at = self.cells.slot_for(ix, iy);
        if self.cells.get(at) >= SURE && self.is_met_obliquely(ix, iy, sensor) {
            shadow.cast((off - CELL / 2.0) / away, (off + CELL / 2.0) / away);
            return;
        }
        let loss = if away < NEARBY { 2 } else { 1 };
        self.cells.set(at, (self.cells.get(at) - loss).max(EVIDENCE.0));
    }

    /// Whether a cell lies on a face that a sensor meets so obliquely that it is silent: then an echo from behind it says nothing against it.
    fn is_met_obliquely(&self, x: i32, y: i32, sensor: Sensor) -> bool {
        let (mut n, mut sum, mut xx, mut xy, mut yy) = (0.0, Point::default(), 0.0, 0.0, 0.0);
        for dy in -FACE..=FACE {
            for ix in self.cells.sure_in(y + dy, x - FACE, 2 * FACE + 1) {
                if self.cells.evidence(ix, y + dy).is_some() {
                    let at = Point::new(f64::from(ix - x), f64::from(dy));
                    n += 1.0;
                    sum = sum + at;
                    (xx, xy, yy) = (xx + at.x * at.x, xy + at.x * at.y, yy + at.y * at.y);
                }
            }
        }
        if n < 4.0 {
            return false;
        }
        let (xx, xy, yy) = (
            xx / n - sum.x * sum.x / (n * n),
            xy / n - sum.x * sum.y / (n * n),
            yy / n - sum.y * sum.y / (n * n),
        );
        // The eigenvalues of the covariance: the face is long in one direction and thin in the other.
        let (mean, off) = ((xx + yy) / 2.0, libm::sqrt((xx - yy) * (xx - yy) / 4.0 + xy * xy));
        if mean - off > 0.25 * (mean + off) {
            return false;
        }
        let along = Point::polar(1.0, 0.5 * libm::atan2(2.0 * xy, xx - yy));
        let ray = middle(x, y) - sensor.origin;
        // Sine of the angle between ray and face is the cosine of that to its normal.
        libm::fabs(ray.cross(along)) < cos(OBLIQUE) * ray.norm()
    }

    /// More evidence for that from which an echo at `range` (m) from the sensor came.
    fn put(&mut self, sensor: Sensor, range: f64, tick: i32) {
        let steps = self.arcs.steps(range);
        // What is told as the shortest range may be as near as nothing.
        let at_shortest = range <= self.params.shortest + CELL / 2.0;
        let nearest = if at_shortest { 0.0 } else { range - CELL };
        let range_to = range + 1.01 * CELL;
        let surest = self.look_along(sensor, steps, (nearest, range_to));
        if surest >= SURE {
            self.strengthen((surest - 1).max(SURE), tick);
            return;
        }
        let gain = if range < 0.6 {
            3
        } else if range < 1.2 {
            2
        } else {
            1
        };
        for step in -steps..=steps {
            let at = self.slot_of(sensor.turned(range, self.arcs.way(step, steps)));
            self.cells.set(at, (self.cells.get(at) + gain).min(EVIDENCE.1));
            self.cells.set_heard(at, tick);
        }
    }

    /// Notes the cells between two ranges on an arc, and gives the greatest evidence of them.
    fn look_along(&mut self, sensor: Sensor, steps: i32, between: (f64, f64)) -> i8 {
        let mut surest = EVIDENCE.0;
        self.arc.clear();
        for step in -steps..=steps {
            let way = self.arcs.way(step, steps);
            let mut away = between.0;
            while away <= between.1 {
                let at = self.slot_of(sensor.turned(away, way));
                surest = surest.max(self.cells.get(at));
                self.arc.push(at);
                away += CELL;
            }
        }
        surest
    }

    /// More evidence for those of the noted cells that have this much already.
    fn strengthen(&mut self, least: i8, tick: i32) {
        for &at in &self.arc {
            let evidence = self.cells.get(at);
            if evidence >= least {
                self.cells.set_heard(at, tick);
                self.cells.set(at, (evidence + 1).min(EVIDENCE.1));
            }
        }
    }

    /// Where the body is nothing else can be.
    fn clear_body(&mut self, pose: Pose) {
        let inner = self.params.rim - CELL;
        let ((x, y), span) = (index(pose.position()), whole(inner / CELL));
        for iy in y - span..=y + span {
            for ix in x - span..=x + span {
                // The body was there before, for the most part.
                if !self.cells.is_free(ix, iy) && (middle(ix, iy) - pose.position()).is_within(inner) {
                    let at = self.cells.slot_for(ix, iy);
                    self.cells.set(at, EVIDENCE.0);
                }
            }
        }
    }

    /// The place in the memory of the cell of a point, emptied first if it still speaks of another place.
    #[inline]
    fn slot_of(&mut self, point: Point) -> usize {
        let (ix, iy) = index(point);
        self.cells.slot_for(ix, iy)
    }
}

/// The parts of a cone in which a silent face hides what is behind it.
struct Shadow {
    /// How far the cone is open to each side, for each metre along its axis.
    widest: f64,
    parts: [bool; SHADES],
    /// Whether there is any: mostly there is none.
    any: bool,
}

impl Shadow {
    fn new(widest: f64) -> Shadow {
        Shadow { widest, parts: [false; SHADES], any: false }
    }

    /// The part in a direction that is given like `widest`.
    fn part(&self, across: f64) -> usize {
        let part = ((across / self.widest + 1.0) * 0.5 * (SHADES - 1) as f64) as usize;
        part.min(SHADES - 1)
    }

    #[inline]
    fn covers(&self, across: f64) -> bool {
        self.any && self.parts[self.part(across)]
    }

    fn cast(&mut self, from: f64, to: f64) {
        let (from, to) = (self.part(from), self.part(to));
        self.parts[from..=to].fill(true);
        self.any = true;
    }
}

/// The directions in which an echo is put, relative to the axis of the sensor: in equal steps over the arc, so that cells are not
/// left out. They depend on the number of steps alone and are computed once; those of far echoes are not kept.
#[derive(Clone, Debug)]
struct Arcs {
    /// Half of the arc (rad).
    half: f64,
    /// For 1, 2, 3 … steps to either side, one arc after another.
    ways: Vec<Point>,
}

impl Arcs {
    /// So many steps to either side are kept: up to 4.8 m with the usual cone.
    const KEPT: i32 = 30;

    fn new(half: f64) -> Arcs {
        let kept = (Arcs::KEPT + 1) * (Arcs::KEPT + 1) - 1;
        let mut arcs = Arcs { half, ways: vec![Point::default(); kept as usize] };
        arcs.open(half);
        arcs
    }

    /// Changes half of the arc, without new memory: parameters change while the robot drives.
    fn open(&mut self, half: f64) {
        let arcs = (1..=Arcs::KEPT).flat_map(|steps| (-steps..=steps).map(move |step| (step, steps)));
        self.half = half;
        for (way, (step, steps)) in self.ways.iter_mut().zip(arcs) {
            *way = Arcs::compute(half, step, steps);
        }
    }

    /// How many steps to either side there are at `range` (m).
    fn steps(&self, range: f64) -> i32 {
        libm::ceil(self.half * range / (0.8 * CELL)).max(1.0) as i32
    }

    /// The direction of a step of so many to either side.
    #[inline]
    fn way(&self, step: i32, steps: i32) -> Point {
        if steps > Arcs::KEPT {
            return Arcs::compute(self.half, step, steps);
        }
        // Before the arc with n steps lie those with fewer: 3 + 5 + … + (2n − 1) = n² − 1 directions.
        self.ways[(steps * steps - 1 + steps + step) as usize]
    }

    fn compute(half: f64, step: i32, steps: i32) -> Point {
        Point::polar(1.0, half * f64::from(step) / f64::from(steps))
    }
}

/// A sensor on the rim in the frame of the map.
#[derive(Clone, Copy)]
struct Sensor {
    origin: Point,
    axis: Point,
}

impl Sensor {
    fn new(params: &MapParams, pose: Pose, bearing: f64) -> Sensor {
        let axis = Point::polar(1.0, pose.heading + bearing);
        Sensor { origin: pose.position() + axis * params.rim, axis }
    }

    /// The direction to the left of its axis.
    fn left(self) -> Point {
        Point::new(-self.axis.y, self.axis.x)
    }

    /// The point `along` its axis and `across` it to the left (m).
    fn point(self, along: f64, across: f64) -> Point {
        self.origin + self.axis * along + self.left() * across
    }

    /// The point at `range` (m) in a direction that is given relative to its axis.
    fn turned(self, range: f64, way: Point) -> Point {
        self.point(range * way.x, range * way.y)
    }
}

/// Time in tenths of a second.
fn ticks(time: Time) -> i32 {
    (time.seconds() * 10.0) as i32
}

#[inline]
fn index(point: Point) -> (i32, i32) {
    (whole(point.x / CELL), whole(point.y / CELL))
}

fn middle(ix: i32, iy: i32) -> Point {
    Point::new(middle_of(ix), middle_of(iy))
}

/// The middle of a column or a row.
#[inline]
fn middle_of(i: i32) -> f64 {
    (f64::from(i) + 0.5) * CELL
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::collection;
    use proptest::prelude::*;
    use types::geometry::PI;

    fn at(seconds: f64) -> Time {
        Time::from_seconds(seconds)
    }

    fn nearest(map: &LocalMap, pose: Pose, now: f64) -> Point {
        let far = Point::new(f64::INFINITY, 0.0);
        map.around(pose, 2.0, at(now), 1).fold(far, |best, p| if p.norm() < best.norm() { p } else { best })
    }

    fn hear(map: &mut LocalMap, echoes: &[(f64, f64)], pose: Pose, now: f64) {
        map.update(echoes.iter().copied(), pose, at(now));
    }

    #[test]
    fn a_thing_that_is_not_heard_any_more_is_still_where_it_was_until_it_is_too_old() {
        let mut map = LocalMap::default();
        hear(&mut map, &[(0.0, 1.0)], Pose::default(), 0.0);
        let later = Pose::new(0.4, 0.0, PI / 2.0);
        hear(&mut map, &[], later, 1.0);
        let point = nearest(&map, later, 1.0);
        assert!((point.norm() - 0.6).abs() < 0.05 && (point.bearing() + PI / 2.0).abs() < 0.3, "{point:?}");
        assert_eq!(nearest(&map, later, 30.2).norm(), f64::INFINITY);
    }

    #[test]
    fn an_echo_from_behind_takes_a_thing_away_and_silence_does_not() {
        let mut map = LocalMap::default();
        hear(&mut map, &[(0.0, 1.0)], Pose::default(), 0.0);
        hear(&mut map, &[], Pose::default(), 0.2);
        assert!(nearest(&map, Pose::default(), 0.2).norm() < 1.05);
        for _ in 0..2 {
            hear(&mut map, &[(0.0, 1.6)], Pose::default(), 0.4);
        }
        // What is left of the arc lies at the edge of the cone.
        assert!(nearest(&map, Pose::default(), 0.4).y.abs() > 0.1);
    }

    /// A wall half a metre to the left, heard while the robot goes along it.
    fn along_a_wall() -> LocalMap {
        let mut map = LocalMap::default();
        for i in 0..40 {
            let pose = Pose::new(0.05 * f64::from(i), 0.0, 0.0);
            hear(&mut map, &[(PI / 2.0, 0.5)], pose, 0.2 * f64::from(i));
        }
        map
    }

    #[test]
    fn an_echo_from_behind_a_face_that_is_met_obliquely_says_nothing_against_it() {
        let wall = Point::new(1.525, 0.475);
        let is_there =
            |map: &LocalMap| map.around(Pose::default(), 2.0, at(9.0), 1).any(|p| p.distance(wall) < 0.03);
        let mut map = along_a_wall();
        assert!(is_there(&map));
        // 45° off the normal, through the wall.
        for _ in 0..10 {
            hear(&mut map, &[(PI / 4.0, 2.2)], Pose::new(1.0, 0.0, 0.0), 8.0);
        }
        assert!(is_there(&map));
        // Straight through it: the wall is gone.
        for _ in 0..10 {
            hear(&mut map, &[(PI / 2.0, 1.5)], Pose::new(1.525, -0.02, 0.0), 8.5);
        }
        assert!(!is_there(&map));
    }

    #[test]
    fn squares_tell_what_is_surely_taken_and_surely_free() {
        let map = along_a_wall();
        let squares = squares(&map, Point::new(1.0, 0.0), 1.0);
        let of = |x: f64, y: f64| {
            let found = squares.iter().find(|(p, _)| (p.x - x).abs() < 0.051 && (p.y - y).abs() < 0.051);
            found.and_then(|(_, taken)| *taken)
        };
        assert_eq!((of(1.0, 0.5), of(1.0, 0.3), of(1.0, -0.5)), (Some(true), Some(false), None));
    }

    #[test]
    fn the_shortest_echo_says_nothing_against_what_is_nearer() {
        let mut map = LocalMap::default();
        hear(&mut map, &[(0.0, 0.6)], Pose::default(), 0.0);
        let near = Pose::new(0.3, 0.0, 0.0);
        for i in 0..10 {
            hear(&mut map, &[(0.0, 0.375)], near, 0.1 * f64::from(i));
        }
        assert!((nearest(&map, near, 1.0).norm() - 0.3).abs() < 0.05);
    }

    #[test]
    fn arcs_from_two_places_leave_the_corner_where_they_cross() {
        // A post half a metre to the left of the way, heard while the robot passes it by the sensors that look at it.
        let post = Point::new(1.0, 0.5);
        let mut map = LocalMap::default();
        for i in 0..40 {
            let pose = Pose::new(0.05 * f64::from(i), 0.0, 0.0);
            let seen = pose.inverse().transform(post);
            let echoes = (0..12).map(|k| {
                let bearing = f64::from(k) * PI / 6.0;
                let off = seen - Point::polar(0.225, bearing);
                let hears = types::geometry::wrap(off.bearing() - bearing).abs() < PI / 12.0;
                (bearing, if hears { 0.225 + off.norm() } else { 4.0 })
            });
            map.update(echoes, pose, at(0.2 * f64::from(i)));
        }
        let end = Pose::new(2.0, 0.0, 0.0);
        let places: Vec<Point> = map.around(end, 2.0, at(8.0), 1).map(|p| end.transform(p)).collect();
        assert!(places.iter().any(|p| p.distance(post) < 0.08), "{places:?}");
        assert!(places.iter().all(|p| p.distance(post) < 0.3), "{places:?}");
    }

    /// What [`LocalMap::around`] is to give, by looking at each cell, without the row of bits and the short ways.
    fn around_by_hand(map: &LocalMap, pose: Pose, reach: f64, now: Time) -> Vec<Point> {
        let ((x, y), span) = (index(pose.position()), (reach / CELL).floor() as i32);
        let oldest = ticks(now) - ticks(Time::ZERO + map.params.keep);
        let cells = (y - span..=y + span).flat_map(|iy| (x - span..=x + span).map(move |ix| (ix, iy)));
        let occupied = cells.filter(|&(ix, iy)| {
            map.cells.evidence(ix, iy).is_some_and(|evidence| evidence > 0)
                && map.cells.heard(ix, iy) >= oldest
        });
        let (s, c) = (sin(pose.heading), cos(pose.heading));
        occupied
            .map(|(ix, iy)| middle(ix, iy) - pose.position())
            .map(|off| Point::new(c * off.x + s * off.y, c * off.y - s * off.x))
            .filter(|point| point.norm() <= reach)
            .collect()
    }

    /// The squares of [`LocalMap::squares`] one by one.
    fn squares(map: &LocalMap, place: Point, reach: f64) -> Vec<(Point, Option<bool>)> {
        let rows = map.squares(place, reach);
        let each = rows.flat_map(|(first, row)| (0..64).map(move |i| (first, row, i)));
        let known = each.filter(|(_, row, i)| row.known >> i & 1 == 1);
        let told = known.map(|(first, row, i)| {
            // It lies where four cells meet.
            let (ix, iy) = (libm::round(first.x / CELL) as i32, libm::round(first.y / CELL) as i32);
            let middle = Point::new(f64::from(ix + 2 * i) * CELL, f64::from(iy) * CELL);
            let (taken, free) = (row.taken >> i & 1 == 1, row.free >> i & 1 == 1);
            assert!(!(taken && free));
            (middle, (taken || free).then_some(taken))
        });
        told.collect()
    }

    /// What [`LocalMap::squares`] is to give, cell by cell.
    fn squares_by_hand(map: &LocalMap, place: Point, reach: f64) -> Vec<(Point, Option<bool>)> {
        let ((x, y), span) = (index(place), (reach.min(62.0 * CELL) / (2.0 * CELL)).floor() as i32);
        let low = |i: i32| 2 * i.div_euclid(2);
        let corners = (-span..=span).flat_map(|dy| (-span..=span).map(move |dx| (dx, dy)));
        let squares = corners.filter_map(|(dx, dy)| {
            let (ix, iy) = (low(x) + 2 * dx, low(y) + 2 * dy);
            let four = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| (ix + dx, iy + dy));
            let known = four.into_iter().filter_map(|(x, y)| map.cells.evidence(x, y));
            let most = known.filter(|evidence| *evidence != 0).max()?;
            let middle = Point::new(f64::from(ix + 1) * CELL, f64::from(iy + 1) * CELL);
            Some((middle, if most >= SURE { Some(true) } else { (most < 0).then_some(false) }))
        });
        squares.collect()
    }

    proptest! {
        #[test]
        fn looking_at_occupied_cells_alone_finds_what_looking_at_all_finds(
            turn in -0.5f64..0.5, speed in -1f64..1.0, reach in 0f64..4.0,
            readings in collection::vec(collection::vec(0.2f64..3.0, 12), 1..20)
        ) {
            let mut map = LocalMap::default();
            let mut pose = Pose::new(-2.0, 3.0, 1.0);
            for (i, reading) in readings.iter().enumerate() {
                // Some go out of the map and come in again at the other side.
                pose = pose.along_arc(speed, turn);
                let echoes = reading.iter().enumerate().map(|(k, range)| (k as f64 * PI / 6.0, *range));
                map.update(echoes, pose, at(2.0 * i as f64));
            }
            let now = at(40.0);
            let reach = reach.min(3.15);
            let found: Vec<Point> = map.around(pose, reach, now, 1).collect();
            prop_assert_eq!(found, around_by_hand(&map, pose, reach, now));
            let (found, reach) = (squares(&map, pose.position(), reach), reach.min(3.0));
            prop_assert_eq!(found, squares_by_hand(&map, pose.position(), reach));
        }
    }

    #[test]
    fn the_arcs_that_are_kept_are_those_that_would_be_computed() {
        let arcs = Arcs::new(0.25);
        for steps in 1..=Arcs::KEPT + 2 {
            for step in -steps..=steps {
                assert_eq!(arcs.way(step, steps), Arcs::compute(0.25, step, steps), "{step} of {steps}");
            }
        }
    }

    /// What [`LocalMap::clear_cone`] is to do, place by place.
    fn clear_by_hand(map: &mut LocalMap, sensor: Sensor, range: f64) {
        if range <= map.params.shortest + map.params.behind {
            return;
        }
        let (free, widest) = ((range - map.params.behind).min(map.params.reach), INSIDE * map.params.cone);
        let (mut shadow, mut away) = (Shadow::new(widest), CELL / 2.0);
        while away < free {
            let steps = (widest * away / CELL).floor() as i32;
            (-steps..=steps)
                .for_each(|step| map.clear_place(sensor, away, f64::from(step) * CELL, &mut shadow));
            away += CELL;
        }
    }

    proptest! {
        #[test]
        fn clearing_what_is_not_free_alone_does_what_clearing_all_does(
            turn in -0.5f64..0.5, speed in -0.3f64..0.3, cone in 0.1f64..0.6, reach in 1f64..4.0,
            readings in collection::vec(collection::vec(0.2f64..3.0, 12), 1..20)
        ) {
            let mut map = LocalMap::new(MapParams { cone, reach, ..MapParams::default() });
            let mut pose = Pose::new(-2.0, 3.0, 1.0);
            for (i, reading) in readings.iter().enumerate() {
                pose = pose.along_arc(speed, turn);
                let echoes = reading.iter().enumerate().map(|(k, range)| (k as f64 * PI / 6.0, *range));
                map.update(echoes.clone(), pose, at(i as f64));
                let mut by_hand = map.clone();
                for (bearing, range) in echoes {
                    let sensor = Sensor::new(&map.params, pose, bearing);
                    map.clear_cone(sensor, range);
                    clear_by_hand(&mut by_hand, sensor, range);
                }
                prop_assert!(map.cells == by_hand.cells);
            }
        }
    }

    #[test]
    fn what_is_left_behind_does_not_come_back_a_maps_width_on() {
        let mut map = LocalMap::default();
        hear(&mut map, &[(0.0, 1.0)], Pose::default(), 0.0);
        let width = f64::from(SIDE) * CELL;
        assert_eq!(nearest(&map, Pose::new(width, 0.0, 0.0), 0.0).norm(), f64::INFINITY);
        hear(&mut map, &[(0.0, 1.0)], Pose::new(width, 0.0, 0.0), 0.0);
        assert!(nearest(&map, Pose::new(width, 0.0, 0.0), 0.0).norm() < 1.05);
        assert_eq!(nearest(&map, Pose::default(), 0.0).norm(), f64::INFINITY);
    }
}
