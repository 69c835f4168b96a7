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
}

impl Parameters {
    /// For a round robot of `radius` (m).
    ///
    /// `keep` is two radii less a little: at a door of four radii that is the middle. The least room is 4 cm beside the body: twice the error of a
    /// sonar nearby. It looks three radii ahead, which is what a turn in place needs and the step aside after it. 0.4 m/s and a gain of 2
    /// need 0.2 m of way for an error to fall to 1/e, less than `keep`. It creeps at an eighth of the speed, so the view changes. Two seconds to
    /// full speed let a false start be noticed. Fifteen seconds are enough to turn around twice.
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
    pub fn step(&mut self, points: impl Iterator<Item = Point> + Clone, moved: Increment, dt: f64) -> Twist {
        let sign = self.parameters.side.sign();
        let points = points.map(|p| Point::new(p.x, p.y * sign));
        self.remember(Increment { turn: moved.turn * sign, ..moved }, fmax(dt, 0.0));
        let fans = self.fans(points.clone());
        if self.mode == Mode::Following && (self.circled() || self.spot_since > self.parameters.patience) {
            self.start_leaving(&fans);
        }
        let wanted = match self.mode {
            Mode::Search | Mode::Leaving => self.straight(&fans),
            Mode::Following => self.follow(points, &fans),
        };
        let twist = self.drive(wanted, &fans, dt);
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
        self.visits.add(here, dt);
        if here.distance(self.spot) > SPOT {
            (self.spot, self.spot_since) = (here, 0.0);
        }
        self.spot_since += dt;
    }

    fn begin_lap(&mut self) {
        self.lap = Lap { start: self.pose.position(), turned_at_start: self.turned, path: 0.0 };
    }

    /// Once around towards the wall's side, and near the start: within a fifth of the lap's length, as odometry drifts with it.
    fn circled(&self) -> bool {
        let near = fmax(0.2 * self.lap.path, SPOT);
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
        let look = self.parameters.look;
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
        let look = self.parameters.look;
        if !self.find_anchor(points) {
            self.mode = Mode::Search;
            self.heading = self.pose.heading;
            return Some(0);
        }
        let start = direction(self.pose.inverse().transform(self.anchor).bearing());
        let found = fans[2].sweep(start, look)?;
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
        self.begin_lap();
    }

    fn drive(&mut self, wanted: Option<usize>, fans: &[Fan; 3], dt: f64) -> Twist {
        let p = self.parameters;
        let Some(wanted) = wanted else {
            // No way at all: look around, what was heard may not be there any more.
            self.speed = 0.0;
            return Twist::new(0.0, -p.turn_max / 2.0);
        };
        let error = bearing(wanted);
        let straightness = fmax(1.0 - fabs(error) / 0.8, 0.0);
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

    fn at(&self, point: Point) -> f64 {
        let (x, y) = Visits::square(point);
        fmin(self.0[x][y].into(), 20.0)
    }
}
