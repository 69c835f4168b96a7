//! From a scan, the odometry and a goal to a motion: a local planner that drives as fast as there is room for.
//!
//! ```text
//! scan ──▶ what stands around ──▶ way to the goal ──▶ rollouts of its pursuit ──▶ the fastest that ends well
//!          (surroundings)         (route)             (rollouts)                      │ none
//!                                                                                     ▼
//!                                              the smooth Nearness Diagram ──▶ turn in place ──▶ back off ──▶ escape
//! ```
//!
//! | to find | look in |
//! |---|---|
//! | the square of cells that goes along, and the distances in it | `surroundings` |
//! | the way, nearer to the goal and farther from what stands | `route` |
//! | what would become of a motion | `rollouts` |
//! | out of where it is stuck | [`crate::avoid::escape`] |
//!
//! What is not known counts as free, for the laser sees it long before the robot is there. It knows no map: what is farther away than some
//! metres is forgotten. All memory is taken when a value is made; no step allocates.

mod rollouts;
mod route;
mod surroundings;
#[cfg(test)]
mod tests;

use libm::{fabs, fmax, fmin};
use motion::ring::Ring;
use types::geometry::{PI, wrap};
use types::messages::{Doing, Navigation, Twist};
use types::{Point, Pose};

use crate::avoid::escape::{self, Escape, Phase, Room};
use crate::avoid::{Body, Sectors, SmoothNearness, smooth};
use rollouts::{Cover, Outcome, Track, Try};
use route::Route;
use surroundings::Surroundings;

/// What the robot is, what its drive can do, and how careful it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// Its outline.
    pub body: Body,
    /// Highest speed (m/s).
    pub linear_max: f64,
    /// Highest speed backward (m/s), as a positive number.
    pub backward_max: f64,
    /// Highest turn rate (rad/s).
    pub angular_max: f64,
    /// How fast it speeds up (m/s²).
    pub acceleration: f64,
    /// How fast it brakes (m/s²).
    pub deceleration: f64,
    /// How fast its turn rate changes (rad/s²).
    pub angular_acceleration: f64,
    /// Highest sideways acceleration in a curve (m/s²).
    pub lateral_max: f64,
    /// From a scan to the wheels' answer (s).
    pub latency: f64,
    /// Room that is kept around the body (m).
    pub margin: f64,
    /// More of it for each metre a second (s).
    pub margin_time: f64,
    /// Highest speed into what was never seen (m/s).
    pub unseen_max: f64,
    /// Room beyond the body's half width from which on more is no better for a way (m).
    pub plenty: f64,
    /// How far ahead a motion is played before it must be able to stop (s).
    pub horizon: f64,
    /// Nearer to the goal than this the robot has reached it (m).
    pub goal_tolerance: f64,
    /// Without a scan for so long it stands (s).
    pub stale: f64,
    /// How long it keeps in mind what no beam touches (s).
    pub remember: f64,
}

impl Parameters {
    /// For a body that goes up to `linear_max` (m/s).
    ///
    /// 2 m/s² is what rubber wheels on a smooth floor give without slipping, to start, to brake and sideways half as much again; half a metre a second is as fast as it may go where it looks only by memory. 4 rad/s and
    /// 8 rad/s² turn a small robot. 0.1 s are a scan, a step and the lag of the motors. 3 cm around the body are the size of a cell and the
    /// noise of a laser, and four more for each metre a second what the wheels are late. 0.4 m/s are a slow walk, from which it stops in a hand's breadth.
    /// 0.5 m beside it are plenty. Things stay where they are, so it remembers them for as long as they are near. Played for
    /// a second, then braked: farther ahead the way will be another one.
    pub fn new(body: Body, linear_max: f64) -> Parameters {
        Parameters {
            body,
            linear_max,
            backward_max: fmin(0.5, linear_max),
            angular_max: 4.0,
            acceleration: 2.0,
            deceleration: 2.0,
            angular_acceleration: 8.0,
            lateral_max: 3.0,
            latency: 0.1,
            margin: 0.03,
            margin_time: 0.04,
            unseen_max: fmin(0.4, linear_max),
            plenty: 0.5,
            horizon: 1.0,
            goal_tolerance: 0.2,
            stale: 0.3,
            remember: f64::INFINITY,
        }
    }
}

/// A scan as it is handed in.
#[derive(Clone, Copy, Debug)]
pub struct Scan<'a> {
    /// When it was made (s).
    pub time: f64,
    /// The laser on the robot.
    pub robot_from_sensor: Pose,
    /// Its beams.
    pub beams: Ring<'a>,
    /// Ranges of so much and more met nothing (m).
    pub range_max: f64,
}

/// The navigator with all its memory.
#[derive(Clone, Debug)]
pub struct Navigator {
    parameters: Parameters,
    around: Surroundings,
    route: Route,
    track: Track,
    cover: Cover,
    sectors: Sectors,
    smooth: SmoothNearness,
    escape: Escape,
    seen: Option<f64>,
    /// Whether somebody else makes it wait.
    waits: bool,
}

impl Navigator {
    /// A navigator that has seen nothing yet.
    pub fn new(parameters: Parameters) -> Navigator {
        let half = parameters.body.half_width();
        let cover = Cover::new(&parameters.body);
        let room = route::Room {
            least: cover.radius() + parameters.margin + 0.02,
            tightest: cover.radius() - 0.02,
            plenty: fmin(half + parameters.plenty, surroundings::FAR),
        };
        Navigator {
            parameters,
            around: Surroundings::new(),
            route: Route::new(room),
            track: Track::new(),
            cover,
            sectors: Sectors::new(),
            smooth: SmoothNearness::new(smooth::Parameters {
                security: 0.3,
                linear_max: fmin(0.4, parameters.linear_max),
                angular_max: fmin(1.5, parameters.angular_max),
                goal_tolerance: 0.0,
                ..smooth::Parameters::new(parameters.body)
            }),
            escape: Escape::new(escape::Parameters::default()),
            seen: None,
            waits: false,
        }
    }

    /// What it was made with.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// The way to the goal as it is planned, in the frame of the odometry.
    pub fn way(&self) -> &[Point] {
        self.route.points()
    }

    /// Begins with a new goal: what it gave up before is tried again, what it has seen is kept.
    pub fn begin(&mut self) {
        self.route.forget();
        self.escape.reset();
    }

    /// Forgets all that was seen, and that it gave up.
    pub fn forget(&mut self) {
        self.around.forget();
        self.route.forget();
        self.escape.reset();
        self.seen = None;
    }

    /// Whether somebody else holds the robot back from now on, as a stop in front of people does: who waits is not stuck.
    pub fn wait(&mut self, waits: bool) {
        self.waits = waits;
    }

    /// Takes in a scan that was made at `pose` of the odometry.
    pub fn look(&mut self, scan: &Scan<'_>, pose: Pose) {
        let apart = self.seen.map_or(0.0, |before| scan.time - before);
        let scans = self.parameters.remember / apart;
        let keep = (apart > 0.0 && scans < f64::from(u16::MAX / 2)).then_some(scans as u16);
        self.around.look(pose.then(scan.robot_from_sensor), scan.beams, scan.range_max, keep);
        self.sectors.clear();
        self.sectors.add_scan(scan.robot_from_sensor, scan.beams, scan.range_max);
        self.seen = Some(scan.time);
    }

    /// The motion at `now` (s) for a robot at `pose` that moves with `present`, towards `goal` in the frame of the odometry.
    pub fn step(&mut self, now: f64, pose: Pose, present: Twist, goal: Point) -> Navigation {
        let stand = |doing: Doing| Navigation { doing, ..Navigation::default() };
        if self.seen.is_none_or(|at| now - at > self.parameters.stale) {
            return stand(Doing::Blind);
        }
        if pose.position().distance(goal) <= self.parameters.goal_tolerance {
            self.escape.reset();
            return stand(Doing::Arrived);
        }
        self.route.plan(&self.around, pose.position(), goal);
        self.track.set(self.route.points());
        let orders = self.orders(pose, present, goal);
        let room = Room { behind: self.behind(pose), wider: self.wider(pose) };
        match self.escape.step(now, pose, orders.doing != Doing::Arrived && !self.waits, room) {
            None => orders,
            Some(_) if self.escape.phase() == Phase::GivenUp => stand(Doing::GivenUp),
            Some(twist) => self.checked(pose, present, twist),
        }
    }

    fn orders(&mut self, pose: Pose, present: Twist, goal: Point) -> Navigation {
        if self.track.is_empty() {
            return Navigation { doing: Doing::NoWay, ..Navigation::default() };
        }
        // The wheels answer late: it acts from where the robot will be by then.
        let late = self.parameters.latency;
        let from = (pose.advanced(present.linear, present.angular, late), present);
        let left = self.track.lengths_left();
        // Where nothing keeps all of the room, what keeps some of it is next.
        if let Some(best) = [1.0, 0.5, 0.0].into_iter().find_map(|care| self.best(from, care)) {
            return Navigation { twist: best.first, doing: Doing::Pursuing, room: best.room, left };
        }
        if present.linear > 0.1 {
            let brake = self.brake(from);
            return Navigation { twist: brake.first, doing: Doing::Braking, room: brake.room, left };
        }
        let target = self.track.ahead(0, 0.8);
        if let Some((twist, room)) = self.avoiding(pose, from, if left < 0.8 { goal } else { target }) {
            return Navigation { twist, doing: Doing::Avoiding, room, left };
        }
        if let Some(back) = self.reverse(from) {
            return Navigation { twist: back.first, doing: Doing::Backing, room: back.room, left };
        }
        if let Some((twist, room)) = self.turning(from, self.track.ahead(0, 0.4)) {
            return Navigation { twist, doing: Doing::Turning, room, left };
        }
        if let Some((twist, room)) = self.backing(from) {
            return Navigation { twist, doing: Doing::Backing, room, left };
        }
        Navigation { doing: Doing::NoWay, left, ..Navigation::default() }
    }

    /// The rollout that comes farthest; a little room is worth a little way.
    fn best(&self, from: (Pose, Twist), care: f64) -> Option<Outcome> {
        const SPEEDS: [f64; 10] = [1.0, 0.875, 0.75, 0.625, 0.5, 0.4, 0.3, 0.2, 0.125, 0.075];
        const AHEAD: [f64; 4] = [0.3, 0.45, 0.65, 0.9];
        let tries = [1.0, 0.25].into_iter().flat_map(|turn_first| {
            let of = move |share: f64| AHEAD.map(|ahead| (share, ahead, turn_first));
            SPEEDS.into_iter().flat_map(of)
        });
        let tries = tries.map(|(share, ahead, turn_first)| Try {
            speed: share * self.parameters.linear_max,
            ahead,
            turn_first,
        });
        farthest(tries.filter_map(|attempt| self.play(from, &self.cover, attempt, care)))
    }

    /// The same backward, as one drives who looks back: where there is no room to turn.
    fn reverse(&self, (pose, present): (Pose, Twist)) -> Option<Outcome> {
        const SPEEDS: [f64; 4] = [1.0, 0.6, 0.3, 0.15];
        const AHEAD: [f64; 3] = [0.2, 0.35, 0.6];
        let from = (pose.then(Pose::new(0.0, 0.0, PI)), Twist::new(-present.linear, present.angular));
        let cover = self.cover.reversed();
        let tries = SPEEDS.into_iter().flat_map(|share| {
            AHEAD.map(|ahead| Try { speed: share * self.parameters.backward_max, ahead, turn_first: 1.0 })
        });
        let best = [1.0, 0.5, 0.0].into_iter().find_map(|care| {
            farthest(tries.clone().filter_map(|attempt| self.play(from, &cover, attempt, care)))
        })?;
        let first = Twist::new(-best.first.linear, best.first.angular);
        (first.linear < 0.0).then_some(Outcome { first, ..best })
    }

    fn play(&self, from: (Pose, Twist), cover: &Cover, attempt: Try, care: f64) -> Option<Outcome> {
        rollouts::play(&self.parameters, cover, &self.around, &self.track, from, attempt, care)
    }

    /// The arc on which braking leaves most room.
    fn brake(&self, from: (Pose, Twist)) -> Outcome {
        let brake = |bend: i32| {
            rollouts::brake(&self.parameters, &self.cover, &self.around, from, f64::from(bend) * 0.4)
        };
        // Straight on first: of two that leave as much the first is taken.
        (1..=10)
            .flat_map(|bend| [brake(bend), brake(-bend)])
            .fold(brake(0), |best, other| if other.room > best.room + 1e-6 { other } else { best })
    }

    fn avoiding(&mut self, pose: Pose, from: (Pose, Twist), target: Point) -> Option<(Twist, f64)> {
        let goal = pose.inverse().transform(target);
        let out = self.smooth.step(Some(&self.sectors), goal);
        let moves = out.twist.linear > 0.02;
        let room = self.sweep(from, out.twist, 0.5).filter(|_| moves)?;
        Some((out.twist, room))
    }

    fn turning(&self, from: (Pose, Twist), target: Point) -> Option<(Twist, f64)> {
        let (pose, _) = from;
        let off = wrap((target - pose.position()).bearing() - pose.heading);
        if fabs(off) < 0.15 {
            return None;
        }
        let twist = Twist::new(0.0, (2.0 * off).clamp(-1.0, 1.0));
        self.sweep(from, twist, 0.4).map(|room| (twist, room))
    }

    /// Back to where there is most room.
    fn backing(&self, from: (Pose, Twist)) -> Option<(Twist, f64)> {
        [-0.6, -0.3, 0.0, 0.3, 0.6]
            .into_iter()
            .filter_map(|turn| {
                let twist = Twist::new(-0.2, turn);
                self.sweep(from, twist, 0.6).map(|room| (twist, room))
            })
            .max_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// The motion of an escape, if the body fits.
    fn checked(&self, pose: Pose, present: Twist, twist: Twist) -> Navigation {
        let room = self.sweep((pose, present), twist, 0.3);
        Navigation {
            twist: if room.is_some() { twist } else { Twist::ZERO },
            doing: Doing::Escaping,
            room: room.unwrap_or(0.0),
            left: self.track.lengths_left(),
        }
    }

    fn sweep(&self, from: (Pose, Twist), twist: Twist, seconds: f64) -> Option<f64> {
        rollouts::sweep(&self.parameters, &self.cover, &self.around, from, twist, seconds)
    }

    /// Free way behind the body (m).
    fn behind(&self, pose: Pose) -> f64 {
        let mut way = 0.0;
        while way < 0.5 && self.cover.room(&self.around, pose.along_arc(-way - 0.05, 0.0)) > 0.0 {
            way += 0.05;
        }
        way
    }

    fn wider(&self, pose: Pose) -> f64 {
        let side = |y: f64| self.around.distance_at(pose.transform(Point::new(0.0, y)));
        fmax(side(0.4), 0.0) - fmax(side(-0.4), 0.0)
    }
}

/// The one that comes farthest along the way, if any gets on; a little room is worth a little way.
fn farthest(outcomes: impl Iterator<Item = Outcome>) -> Option<Outcome> {
    let worth = |outcome: &Outcome| outcome.progress + 0.5 * fmin(outcome.room, 0.15);
    let best = outcomes.fold(None, |best: Option<Outcome>, other| match best {
        Some(best) if worth(&best) >= worth(&other) => Some(best),
        _ => Some(other),
    });
    best.filter(|outcome| {
        outcome.progress > 0.03 || outcome.first.linear == 0.0 && fabs(outcome.first.angular) > 0.1
    })
}
