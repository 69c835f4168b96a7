//! A wall follower with a memory, which notices that it circles an island and leaves it.
//!
//! ```text
//!             wall within reach                    turned by 2π towards the wall's side
//!  ┌────────┐ ─────────────────▶ ┌───────────┐     and back where it began     ┌─────────┐
//!  │ Search │                    │ Following │ ──────────────────────────────▶ │ Leaving │
//!  └────────┘ ◀───────────────── └───────────┘                                 └─────────┘
//!      ▲        wall lost for more than a turn                                      │
//!      └────────────────────────────────────────────────────────────────────────────┘
//!                              far enough from the island
//! ```
//!
//! Inside a room the way along the walls turns by −2π a lap, away from the wall; around an island by +2π. So the turned angle since
//! its lowest value tells the two apart, whatever corners lie between (the counting of Lumelsky's and of Pledge's bugs).

use crate::kinematics::Twist;
use crate::odometry::Increment;
use crate::ring::Ring;
use crate::wall::{self, Parameters, Side, Wall};
use libm::{fabs, fmin};
use types::geometry::{PI, TAU, wrap};
use types::{Point, Pose};

/// How many left islands are remembered; the oldest is forgotten first.
pub const ISLANDS_MAX: usize = 8;

/// Way after which an island is forgotten (m): dead reckoning drifts by a hundredth or two of the way, so by then the place is no
/// longer known to a metre.
const MEMORY: f64 = 60.0;

/// What the follower is about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Mode {
    /// Straight on until there is a wall.
    #[default]
    Search,
    /// Along a wall.
    Following,
    /// Away from an island.
    Leaving,
}

/// A place that was circled, in the frame of the follower's own dead reckoning.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Island {
    centre: Point,
    radius: f64,
    /// Way driven when it was left (m).
    left_at: f64,
}

/// A loop that is being driven, since the turned angle was lowest.
#[derive(Clone, Copy, Debug, Default)]
struct Lap {
    start: Point,
    turned_at_start: f64,
    path: f64,
    low: Point,
    high: Point,
}

/// Follows walls and leaves islands. One `step` a reading.
#[derive(Clone, Copy, Debug)]
pub struct Follower {
    parameters: Parameters,
    mode: Mode,
    pose: Pose,
    turned: f64,
    speed: f64,
    travelled: f64,
    lap: Lap,
    lost_turn: f64,
    leaving: Leaving,
    islands: [Island; ISLANDS_MAX],
    left: usize,
}

#[derive(Clone, Copy, Debug, Default)]
struct Leaving {
    heading: f64,
    path: f64,
}

impl Follower {
    /// Begins with a search.
    pub fn new(parameters: Parameters) -> Follower {
        Follower {
            parameters,
            mode: Mode::Search,
            pose: Pose::default(),
            turned: 0.0,
            speed: parameters.creep,
            travelled: 0.0,
            lap: Lap::default(),
            lost_turn: 0.0,
            leaving: Leaving::default(),
            islands: [Island::default(); ISLANDS_MAX],
            left: 0,
        }
    }

    /// What it is about.
    pub const fn mode(&self) -> Mode {
        self.mode
    }

    /// How many islands it has left so far.
    pub const fn islands_left(&self) -> usize {
        self.left
    }

    /// Changes how to follow. Islands stay remembered; a change of side begins a new lap.
    pub fn set_parameters(&mut self, parameters: Parameters) {
        if parameters.side != self.parameters.side {
            self.begin_lap();
        }
        self.parameters = parameters;
    }

    /// The motion for the reading `ring`, after the robot has moved by `moved` during the last `dt` (s).
    pub fn step(&mut self, ring: Ring<'_>, moved: Increment, dt: f64) -> Twist {
        self.remember(moved);
        let wall = wall::look(&self.parameters, ring).filter(|wall| !self.belongs_to_an_island(wall));
        self.choose_mode(ring, wall, moved);
        match self.mode {
            Mode::Leaving => self.leave(ring, dt),
            Mode::Following if wall.is_none() => self.around_the_corner(ring),
            Mode::Following | Mode::Search => {
                let steering = wall::steer(&self.parameters, ring, wall);
                let speed = self.grown(steering.speed, dt);
                wall::drive(&self.parameters, &steering, speed)
            }
        }
    }

    fn remember(&mut self, moved: Increment) {
        self.pose = self.pose.along_arc(moved.distance, moved.turn);
        self.turned += moved.turn * self.parameters.side.sign();
        let here = self.pose.position();
        self.travelled += fabs(moved.distance);
        self.lap.path += fabs(moved.distance);
        self.lap.low = Point::new(fmin(self.lap.low.x, here.x), fmin(self.lap.low.y, here.y));
        self.lap.high = Point::new(libm::fmax(self.lap.high.x, here.x), libm::fmax(self.lap.high.y, here.y));
        if self.turned < self.lap.turned_at_start {
            self.begin_lap();
        }
    }

    fn begin_lap(&mut self) {
        let here = self.pose.position();
        self.lap = Lap { start: here, turned_at_start: self.turned, path: 0.0, low: here, high: here };
    }

    fn choose_mode(&mut self, ring: Ring<'_>, wall: Option<Wall>, moved: Increment) {
        match self.mode {
            Mode::Search if wall.is_some() => {
                self.mode = Mode::Following;
                self.lost_turn = 0.0;
                self.begin_lap();
            }
            Mode::Following if self.circled() => self.start_leaving(ring),
            Mode::Following => {
                let towards = moved.turn * self.parameters.side.sign();
                self.lost_turn = if wall.is_some() { 0.0 } else { self.lost_turn + towards };
                // No corner is sharper than the end of a thin wall, a half turn; a quarter more is for its thickness.
                if self.lost_turn > 1.25 * PI {
                    self.mode = Mode::Search;
                }
            }
            Mode::Leaving
                if self.leaving.path
                    > self.islands[(self.left - 1) % ISLANDS_MAX].radius + 2.0 * self.parameters.reach =>
            {
                self.mode = Mode::Search;
            }
            Mode::Search | Mode::Leaving => {}
        }
        self.leaving.path += fabs(moved.distance);
    }

    /// Once around towards the wall's side, and near the start: within a fifth of the lap's length, as odometry drifts with it.
    fn circled(&self) -> bool {
        let near = libm::fmax(0.2 * self.lap.path, 2.0 * self.parameters.radius);
        self.turned - self.lap.turned_at_start >= TAU
            && self.lap.path > 0.0
            && self.pose.position().distance(self.lap.start) <= near
    }

    fn start_leaving(&mut self, ring: Ring<'_>) {
        let (low, high) = (self.lap.low, self.lap.high);
        let centre = (low + high) * 0.5;
        // What was followed lies inside the path, nearer by the distance that was kept.
        let radius = low.distance(high) / 2.0;
        self.islands[self.left % ISLANDS_MAX] = Island { centre, radius, left_at: self.travelled };
        self.left += 1;
        self.leaving = Leaving { heading: self.way_out(ring, centre), path: 0.0 };
        self.mode = Mode::Leaving;
        self.begin_lap();
    }

    /// The heading with the longest free way that does not lead across the island.
    fn way_out(&self, ring: Ring<'_>, centre: Point) -> f64 {
        let outward = (self.pose.position() - centre).bearing();
        let half_width = self.parameters.radius + self.parameters.margin;
        let mut best = (outward, f64::NEG_INFINITY);
        for i in -6..=6 {
            let heading = wrap(outward + f64::from(i) * PI / 12.0);
            let way =
                wall::free_way(ring, wrap(heading - self.pose.heading), half_width, self.parameters.radius);
            // Ten metres are as good as endless; among equals the straightest way out wins.
            let worth = fmin(way, 10.0) - fabs(f64::from(i)) * 0.1;
            if worth > best.1 {
                best = (heading, worth);
            }
        }
        best.0
    }

    fn leave(&mut self, ring: Ring<'_>, dt: f64) -> Twist {
        let off = wrap(self.leaving.heading - self.pose.heading) * self.parameters.side.sign();
        let mut steering = wall::steer(&self.parameters, ring, None);
        if steering.push > 0.9 && fabs(off) < 0.5 {
            // The way out is blocked after all: what blocks it is worth following unless it is the island.
            self.mode = Mode::Search;
        }
        steering.error = off;
        steering.speed *= libm::fmax(1.0 - fabs(off), 0.0);
        let speed = self.grown(steering.speed, dt);
        wall::drive(&self.parameters, &steering, speed)
    }

    /// An arc of the kept radius towards the lost wall, unless something stands in front.
    fn around_the_corner(&mut self, ring: Ring<'_>) -> Twist {
        let mut steering = wall::steer(&self.parameters, ring, None);
        self.speed = fmin(steering.speed, self.parameters.speed / 2.0);
        if steering.push < 0.5 {
            steering.error = self.speed / self.parameters.keep / self.parameters.turn_gain;
        }
        wall::drive(&self.parameters, &steering, self.speed)
    }

    /// The speed grows slowly and falls at once.
    fn grown(&mut self, allowed: f64, dt: f64) -> f64 {
        self.speed = fmin(allowed, self.speed + self.parameters.growth * libm::fmax(dt, 0.0));
        self.speed
    }

    fn belongs_to_an_island(&self, wall: &Wall) -> bool {
        let bearing = wall.bearing * self.parameters.side.sign();
        let point = self.pose.transform(Point::polar(wall.distance, bearing));
        let known = self.left.min(ISLANDS_MAX);
        self.islands[..known].iter().any(|island| {
            self.travelled - island.left_at < MEMORY && island.centre.distance(point) <= island.radius
        })
    }

    /// The side on which it follows.
    pub const fn side(&self) -> Side {
        self.parameters.side
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Something 0.6 m to the left of the robot, and nothing else.
    const LEFT: [(f64, f64); 2] = [(PI / 2.0, 0.6), (PI, f64::INFINITY)];

    #[test]
    fn a_left_island_is_not_followed_again_until_it_is_forgotten() {
        let mut follower = Follower::new(Parameters::new(0.225, 0.0));
        follower.islands[0] = Island { centre: Point::new(0.0, 0.5), radius: 0.8, left_at: 0.0 };
        follower.left = 1;
        let still = Increment::default();
        follower.step(Ring::Beams(&LEFT), still, 0.25);
        assert_eq!(follower.mode(), Mode::Search);
        // Sixty metres to and fro end at the same place.
        for distance in [30.0, -30.0] {
            follower.step(Ring::Beams(&[(PI, f64::INFINITY)]), Increment { distance, turn: 0.0 }, 0.25);
        }
        follower.step(Ring::Beams(&LEFT), still, 0.25);
        assert_eq!(follower.mode(), Mode::Following);
    }

    #[test]
    fn something_beside_a_left_island_is_followed() {
        let mut follower = Follower::new(Parameters::new(0.225, 0.0));
        follower.islands[0] = Island { centre: Point::new(0.0, -0.5), radius: 0.8, left_at: 0.0 };
        follower.left = 1;
        follower.step(Ring::Beams(&LEFT), Increment::default(), 0.25);
        assert_eq!(follower.mode(), Mode::Following);
    }
}
