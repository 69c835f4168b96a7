//! Going along the walls of an unknown place until one has been everywhere: the hand rule with a memory.
//!
//! ```text
//!             something in the way                once around it, or no way on
//!  ┌────────┐ ─────────────────▶ ┌───────────┐ ──────────────────────────────▶ ┌─────────┐
//!  │ Search │                    │ Following │                                 │ Leaving │
//!  └────────┘ ◀───────────────── └───────────┘ ◀────────────────────────────── └─────────┘
//!               nothing near                       something in the way
//! ```
//!
//! Inside a room the way along the walls turns by −2π a lap, away from the wall; around an island by +2π. So the turned angle since
//! its lowest value tells the two apart, whatever corners lie between (the counting of Lumelsky's and of Pledge's bugs). An island is
//! left towards where the robot has been least.

use crate::boundary::{Compass, DIRECTIONS, Fan, apart, bearing, direction};
use crate::kinematics::Twist;
use crate::odometry::Increment;
use crate::wall::Side;
use libm::{fabs, floor, fmax, fmin};
use types::geometry::{TAU, wrap};
use types::{Point, Pose};

/// How to roam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// On which side the wall is.
    pub side: Side,
    /// Distance to keep from the robot's middle to everything where there is room (m).
    pub keep: f64,
    /// Distance with which it still goes through (m).
    pub least: f64,
    /// Way that must be free ahead (m). A niche that is not deeper is wall.
    pub look: f64,
    /// Speed with all free (m/s).
    pub speed: f64,
    /// Speed at which it still creeps along while it turns (m/s).
    pub creep: f64,
    /// How fast the wished speed grows while all is free (m/s²).
    pub growth: f64,
    /// Highest turn rate (rad/s).
    pub turn_max: f64,
    /// Turn rate for an error of heading of 1 rad (1/s).
    pub turn_gain: f64,
    /// It leaves what it follows when it has not got away from one place for this long (s).
    pub patience: f64,
    /// When it has come to no new place for this long, it tries the ways that are not straight for long; after twice that it leaves what it
    /// follows (s).
    pub keen_after: f64,
}

impl Parameters {
    /// For a round robot of `radius` (m).
    ///
    /// `keep` is two radii less a little: at a door of four radii that is the middle. The least room is 4 cm beside the body: twice the error of a
    /// sonar nearby. It looks three radii ahead, which is what a turn in place needs and the step aside after it. 0.4 m/s and a gain of 2
    /// need 0.2 m of way for an error to fall to 1/e, less than `keep`. It creeps at an eighth of the speed, so the view changes. Two seconds to
    /// full speed let a false start be noticed. Fifteen seconds are enough to turn around twice, forty to go along the walls of a small room.
    pub fn new(radius: f64) -> Parameters {
        Parameters {
            side: Side::Left,
            keep: 1.9 * radius,
            least: radius + 0.04,
            look: 3.0 * radius,
            speed: 0.4,
            creep: 0.05,
            growth: 0.3,
            turn_max: 1.0,
            turn_gain: 2.0,
            patience: 15.0,
            keen_after: 40.0,
        }
    }
}

/// On which sides something may be nearer than the points tell, because the sensors tell nothing of what is so near.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Beside {
    /// To the left, up to straight to the side.
    pub left: bool,
    /// To the right.
    pub right: bool,
}

impl Beside {
    /// The turn (rad) that does not lead nearer to what is beside it: a little away from it, except for one that is made in place. Between two
    /// such things it goes as wanted.
    fn shy(self, error: f64) -> f64 {
        match (self.left, self.right) {
            (true, false) if error < IN_PLACE => fmin(error, -SHY),
            (false, true) if error > -IN_PLACE => fmax(error, SHY),
            _ => error,
        }
    }
}

/// What the roamer is about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Mode {
    /// Straight on until something is in the way.
    #[default]
    Search,
    /// Along a wall.
    Following,
    /// Away from an island.
    Leaving,
}

/// A loop that is being driven, since the turned angle was lowest.
#[derive(Clone, Copy, Debug, Default)]
struct Lap {
    start: Point,
    turned_at_start: f64,
    path: f64,
}

/// A roomier way is taken in place of the one along the wall when it leads nearly the same way (rad): 35° is how far the two differ along a
/// straight wall. What differs more is a gap.
const SAME_WAY: f64 = 0.6;
/// A touched point is let go when it is this far behind the side (rad): 115°.
const BEHIND: f64 = 2.0;
/// A touched point is still there when something is within this of it (m): three cells of a map of 5 cm.
const STILL_THERE: f64 = 0.15;
/// The part of the way ahead that is enough where there is no other.
const LAST: f64 = 0.35;
/// A turn by this and more is made in place (rad).
const IN_PLACE: f64 = 0.8;
/// How far it turns away from what is as near as can be told (rad): a hand's width in a metre.
const SHY: f64 = 0.1;
/// The part of the way ahead that must be free for one who is keen.
const KEEN: f64 = 0.6;
/// Farther from where a lap began it is not back there (m).
const CIRCLED: f64 = 1.2;
/// As long as it moves no farther than this it has not got away (m).
const SPOT: f64 = 0.5;

/// Roams along walls. One `step` a reading, or more often.
#[derive(Clone, Copy, Debug)]
pub struct Roamer {
    parameters: Parameters,
    compass: Compass,
    mode: Mode,
    /// Dead reckoning of its own, mirrored so that the wall is on the left.
    pose: Pose,
    turned: f64,
    speed: f64,
    lap: Lap,
    anchor: Point,
    /// Where it goes while it searches or leaves (rad).
    heading: f64,
    visits: Visits,
    spot: Point,
    spot_since: f64,
    /// How long it has seen nothing new (s).
    stale: f64,
    left: usize,
}

impl Roamer {
    /// Begins with a search.
    pub fn new(parameters: Parameters) -> Roamer {
        Roamer {
            parameters,
            compass: Compass::default(),
            mode: Mode::Search,
            pose: Pose::default(),
            turned: 0.0,
            speed: parameters.creep,
            lap: Lap::default(),
            anchor: Point::default(),
            heading: 0.0,
            visits: Visits::default(),
            spot: Point::default(),
            spot_since: 0.0,
            stale: 0.0,
            left: 0,
        }
    }

    /// What it is about.
    pub const fn mode(&self) -> Mode {
        self.mode
    }

    /// How often it has left what it followed.
    pub const fn times_left(&self) -> usize {
        self.left
    }

    /// Changes how to roam. A change of side begins anew.
    pub fn set_parameters(&mut self, parameters: Parameters) {
        if parameters.side != self.parameters.side {
            *self = Roamer::new(parameters);
        }
        self.parameters = parameters;
    }

    /// The motion among `points` (m, in the frame of the robot), after the robot has moved by `moved` during the last `dt` (s).
    pub fn step(
        &mut self,
        points: impl Iterator<Item = Point> + Clone,
        beside: Beside,
        moved: Increment,
        dt: f64,
    ) -> Twist {
        let sign = self.parameters.side.sign();
        let points = points.map(|p| Point::new(p.x, p.y * sign));
        self.remember(Increment { turn: moved.turn * sign, ..moved }, fmax(dt, 0.0));
        let fans = self.fans(points.clone());
        if self.mode == Mode::Following && (self.circled() || self.is_stuck()) {
            self.start_leaving(&fans);
        }
        let wanted = match self.mode {
            Mode::Search | Mode::Leaving => self.straight(&fans),
            Mode::Following => self.follow(points, &fans),
        };
        let beside = if sign > 0.0 { beside } else { Beside { left: beside.right, right: beside.left } };
        let twist = self.drive(wanted, &fans, beside, dt);
        Twist::new(twist.linear, twist.angular * sign)
    }

    fn remember(&mut self, moved: Increment, dt: f64) {
        self.pose = self.pose.along_arc(moved.distance, moved.turn);
        self.turned += moved.turn;
        self.lap.path += fabs(moved.distance);
        if self.turned < self.lap.turned_at_start {
            self.begin_lap();
        }
        let here = self.pose.position();
        self.stale = if self.visits.is_new(here) { 0.0 } else { self.stale + dt };
        self.visits.add(here, dt);
        if here.distance(self.spot) > SPOT {
            (self.spot, self.spot_since) = (here, 0.0);
        }
        self.spot_since += dt;
    }

    /// Whether it has not got away from one place, or has been everywhere that it gets to, for too long.
    fn is_stuck(&self) -> bool {
        self.spot_since > self.parameters.patience || self.stale > 5.0 * self.parameters.keen_after
    }

    /// The way that must be free ahead: less when it has found nothing new for long.
    fn look(&self) -> f64 {
        if self.stale > self.parameters.keen_after {
            KEEN * self.parameters.look
        } else {
            self.parameters.look
        }
    }

    fn begin_lap(&mut self) {
        self.lap = Lap { start: self.pose.position(), turned_at_start: self.turned, path: 0.0 };
    }

    /// Once around towards the wall's side, and near the start: within a fifth of the lap's length, as odometry drifts with it, but not so far that any place would do.
    fn circled(&self) -> bool {
        let near = fmin(fmax(0.2 * self.lap.path, SPOT), CIRCLED);
        self.turned - self.lap.turned_at_start >= TAU
            && self.lap.path > 0.0
            && self.pose.position().distance(self.lap.start) <= near
    }

    /// The free ways with much room, with some and with the least.
    fn fans(&self, points: impl Iterator<Item = Point> + Clone) -> [Fan; 3] {
        let Parameters { keep, least, .. } = self.parameters;
        [keep, (keep + least) / 2.0, least].map(|room| Fan::new(&self.compass, points.clone(), room))
    }

    /// The direction in which it goes on straight, or along what is in the way.
    fn straight(&mut self, fans: &[Fan; 3]) -> Option<usize> {
        let ahead = direction(wrap(self.heading - self.pose.heading));
        let look = self.look();
        let free = fans.iter().find_map(|fan| fan.nearest_free(ahead, look, SAME_WAY));
        if free.is_none() {
            self.anchor = self.pose.transform(fans[2].stop(ahead));
            self.mode = Mode::Following;
            self.begin_lap();
            return fans[2].sweep(ahead, look).map(|found| found.direction);
        }
        free
    }

    fn follow(&mut self, points: impl Iterator<Item = Point> + Clone, fans: &[Fan; 3]) -> Option<usize> {
        let look = self.look();
        if !self.find_anchor(points) {
            self.mode = Mode::Search;
            self.heading = self.pose.heading;
            return Some(0);
        }
        let start = direction(self.pose.inverse().transform(self.anchor).bearing());
        let found = fans[2].sweep(start, look).or_else(|| fans[2].sweep(start, LAST * look))?;
        let behind = bearing(start) > BEHIND || bearing(start) < -BEHIND;
        if let Some(touched) = found.touched.filter(|_| behind) {
            self.anchor = self.pose.transform(touched);
        }
        let roomy = fans[..2].iter().find_map(|fan| {
            let way = fan.sweep(start, look)?.direction;
            (apart(way, found.direction) <= SAME_WAY).then_some(way)
        });
        Some(roomy.unwrap_or(found.direction))
    }

    /// Whether there is something to follow: what is touched, or else what is nearest on the wall's side.
    fn find_anchor(&mut self, points: impl Iterator<Item = Point> + Clone) -> bool {
        let local = self.pose.inverse().transform(self.anchor);
        if points.clone().any(|p| p.distance(local) <= STILL_THERE) {
            return true;
        }
        let reach = self.parameters.look + self.parameters.keep;
        let beside = points.filter(|p| p.y > 0.0 && p.norm() <= reach);
        let nearest = beside.fold(None, |best: Option<Point>, p| match best {
            Some(known) if known.norm() <= p.norm() => best,
            _ => Some(p),
        });
        if let Some(point) = nearest {
            self.anchor = self.pose.transform(point);
        }
        nearest.is_some()
    }

    fn start_leaving(&mut self, fans: &[Fan; 3]) {
        let worth = |i: usize| {
            let heading = self.pose.heading + bearing(i);
            let way = fmin(fans[2].way(i), 3.0 * self.parameters.look);
            let known: f64 = (1..=4)
                .map(|k| {
                    let there = self.pose.position() + Point::polar(0.5 * f64::from(k), heading);
                    self.visits.at(there)
                })
                .sum();
            way - 0.05 * known
        };
        let best =
            (0..DIRECTIONS).step_by(3).fold(0, |best, i| if worth(i) > worth(best) { i } else { best });
        self.heading = wrap(self.pose.heading + bearing(best));
        self.mode = Mode::Leaving;
        self.left += 1;
        (self.spot, self.spot_since) = (self.pose.position(), 0.0);
        self.stale = 0.0;
        self.begin_lap();
    }

    fn drive(&mut self, wanted: Option<usize>, fans: &[Fan; 3], beside: Beside, dt: f64) -> Twist {
        let p = self.parameters;
        let Some(wanted) = wanted else {
            // No way at all: look around, what was heard may not be there any more.
            self.speed = 0.0;
            return Twist::new(0.0, -p.turn_max / 2.0);
        };
        let error = beside.shy(bearing(wanted));
        let straightness = fmax(1.0 - fabs(error) / IN_PLACE, 0.0);
        let ahead = fmin(fans[2].way(0), fans[2].way(wanted));
        let clearness = fmin(fmax(ahead / (2.0 * p.look), 0.0), 1.0);
        let allowed = p.speed * straightness * clearness;
        let allowed = if ahead > 0.1 && straightness > 0.0 { fmax(allowed, p.creep) } else { 0.0 };
        self.speed = fmin(allowed, self.speed + p.growth * fmax(dt, 0.0));
        Twist::new(self.speed, fmin(fmax(p.turn_gain * error, -p.turn_max), p.turn_max))
    }
}

/// Side of a square of the memory of visits (m), and squares on a side; beyond 16 m places fall together.
const SQUARE: f64 = 0.5;
const SQUARES: usize = 32;

/// How long it has been where.
#[derive(Clone, Copy, Debug)]
struct Visits([[f32; SQUARES]; SQUARES]);

impl Default for Visits {
    fn default() -> Visits {
        Visits([[0.0; SQUARES]; SQUARES])
    }
}

impl Visits {
    fn square(point: Point) -> (usize, usize) {
        let index = |x: f64| (floor(x / SQUARE) as i64).rem_euclid(SQUARES as i64) as usize;
        (index(point.x), index(point.y))
    }

    fn add(&mut self, point: Point, dt: f64) {
        let (x, y) = Visits::square(point);
        self.0[x][y] += dt as f32;
    }

    /// Whether it has been neither there nor beside it.
    fn is_new(&self, point: Point) -> bool {
        let (x, y) = Visits::square(point);
        let around = |i: usize| [i + SQUARES - 1, i, i + 1].map(|i| i % SQUARES);
        around(x).iter().all(|&x| around(y).iter().all(|&y| self.0[x][y] == 0.0))
    }

    fn at(&self, point: Point) -> f64 {
        let (x, y) = Visits::square(point);
        fmin(self.0[x][y].into(), 20.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    /// A straight wall, a point every 5 cm.
    fn wall(from: (f64, f64), to: (f64, f64)) -> Vec<Point> {
        let (a, b) = (Point::new(from.0, from.1), Point::new(to.0, to.1));
        let n = (a.distance(b) / 0.05) as usize;
        (0..=n).map(|i| a + (b - a) * (i as f64 / n as f64)).collect()
    }

    fn square(at: (f64, f64), side: f64) -> Vec<Point> {
        let (x, y, h) = (at.0, at.1, side / 2.0);
        let corners = [(x - h, y - h), (x + h, y - h), (x + h, y + h), (x - h, y + h)];
        (0..4).flat_map(|i| wall(corners[i], corners[(i + 1) % 4])).collect()
    }

    /// A room of 5 m by 4 m with a door of 0.9 m in its upper wall.
    fn room() -> Vec<Point> {
        let mut points = wall((0.0, 0.0), (5.0, 0.0));
        points.extend(wall((5.0, 0.0), (5.0, 4.0)));
        points.extend(wall((5.0, 4.0), (3.9, 4.0)));
        points.extend(wall((3.0, 4.0), (0.0, 4.0)));
        points.extend(wall((0.0, 4.0), (0.0, 0.0)));
        points
    }

    /// Drives until `done` says so, five steps a second; gives the poses and how near it came to anything.
    fn drive(
        parameters: Parameters,
        world: &[Point],
        start: Pose,
        seconds: f64,
        done: impl Fn(&Roamer, Pose) -> bool,
    ) -> (Pose, f64, Roamer) {
        let mut roamer = Roamer::new(parameters);
        let (mut pose, mut moved, mut nearest) = (start, Increment::default(), f64::INFINITY);
        for _ in 0..(seconds / 0.2) as usize {
            let inverse = pose.inverse();
            let seen = world.iter().map(|p| inverse.transform(*p)).filter(|p| p.norm() < 2.0);
            nearest = seen.clone().fold(nearest, |near, p| fmin(near, p.norm()));
            let twist = roamer.step(seen, Beside::default(), moved, 0.2);
            moved = Increment { distance: 0.2 * twist.linear, turn: 0.2 * twist.angular };
            pose = pose.along_arc(moved.distance, moved.turn);
            if done(&roamer, pose) {
                break;
            }
        }
        (pose, nearest, roamer)
    }

    #[test]
    fn it_leaves_a_room_by_its_door_from_anywhere_with_the_wall_on_either_side() {
        for side in [Side::Left, Side::Right] {
            for (x, y, heading) in [(2.5, 2.0, 0.0), (1.0, 1.0, 2.0), (4.0, 1.0, -1.5), (2.0, 3.0, 3.0)] {
                let parameters = Parameters { side, ..Parameters::new(0.225) };
                let start = Pose::new(x, y, heading);
                let (pose, nearest, _) = drive(parameters, &room(), start, 200.0, |_, pose| pose.y > 4.3);
                assert!(pose.y > 4.3, "{side:?} from {start:?}: at {pose:?}");
                assert!(nearest > 0.25, "{side:?} from {start:?}: {nearest} m");
            }
        }
    }

    #[test]
    fn it_circles_an_island_once_and_leaves_it() {
        let start = Pose::new(-1.5, 0.0, 0.0);
        let parameters = Parameters::new(0.225);
        let (_, nearest, roamer) =
            drive(parameters, &square((0.0, 0.0), 0.6), start, 120.0, |roamer, _| roamer.times_left() > 0);
        assert_eq!((roamer.times_left(), roamer.mode()), (1, Mode::Leaving));
        assert!(nearest > 0.25, "{nearest}");
    }

    #[test]
    fn all_around_closed_it_looks_around_and_does_not_move() {
        let start = Pose::new(0.0, 0.0, 0.0);
        let (pose, _, roamer) =
            drive(Parameters::new(0.225), &square((0.0, 0.0), 0.6), start, 10.0, |_, _| false);
        assert!(pose.position().norm() < 0.1, "{pose:?}");
        assert!(roamer.turned.abs() > 1.0);
    }

    #[test]
    fn it_does_not_turn_towards_what_may_be_nearer_than_told_except_in_place() {
        let left = Beside { left: true, right: false };
        assert_eq!([0.3, 0.0, -0.4, 1.2].map(|error| left.shy(error)), [-SHY, -SHY, -0.4, 1.2]);
        let both = Beside { left: true, right: true };
        assert_eq!(both.shy(0.3), 0.3);
    }
}
