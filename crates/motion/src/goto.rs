//! Going to a goal: steering from odometry, put right by a localizer, to a point, to a pose or to a dock.
//!
//! ```text
//!            goal ahead            near           aligned, still, and put right
//!  ┌─────────┐ ──────▶ ┌──────────┐ ────▶ ┌──────────┐ ─────────▶ ┌─────────┐
//!  │ Turning │         │ Steering │       │ Aligning │            │ Arrived │
//!  └─────────┘ ◀────── └──────────┘ ◀──── └──────────┘            └─────────┘
//!              behind       ▲      pushed off │ ▲  there and beside the axis by little
//!                           │                 │ │                 ┌───────────┐
//!                     dock: to the standoff   │ └──────────────── │ Docking   │
//!                                     aligned └─────────────────▶ └───────────┘
//!                                                                missed │ ▲ back at the standoff
//!                                                                       ▼ │
//!                                                                 ┌────────────┐
//!                                                                 │ BackingOff │
//!                                                                 └────────────┘
//!     any ──▶ TimedOut   the time is over
//!     any ──▶ Stuck      it was ordered to move for `patience` and came no nearer, or has missed the dock too often
//!     any ──▶ Lost       a pose is not finite
//! ```
//!
//! Turning and steering are [`crate::steering`]; the goal of a dock is first the standoff, on the dock's axis before it. Along the axis it
//! goes slowly by [`crate::trajectory`]. The localizer's corrections come in through [`crate::blend`], and every order passes
//! [`crate::limits`], from the order before: whatever happens, an order differs from the one before by no more than the limits allow.
//! That is so at the end as well: after the end it brakes, so it is to be stepped until its order is nothing.
//!
//! It holds for steps of 5 to 50 ms and corrections more often than the time to stop at the goal (about 1 s).

use crate::blend::{self, Blend};
use crate::kinematics::{self, Twist};
use crate::limits::{Forward, Limits, limit};
use crate::steering::{self, Mode, Polar, Steering};
use crate::trajectory::{self, Gains};
use libm::{copysign, fabs, fmin, sqrt};
use types::geometry::wrap;
use types::{Point, Pose};

/// How to be at the goal.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Arrival {
    /// With any heading.
    #[default]
    Anyhow,
    /// With this heading on the map (rad).
    Heading(f64),
    /// With this heading on the map (rad), having come slowly along it.
    Dock(f64),
}

/// Where to go, on the map.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Goal {
    /// Where.
    pub point: Point,
    /// And how to be there.
    pub arrival: Arrival,
}

impl Goal {
    /// To a point, with any heading.
    pub const fn point(point: Point) -> Goal {
        Goal { point, arrival: Arrival::Anyhow }
    }

    /// To a pose.
    pub const fn pose(pose: Pose) -> Goal {
        Goal { point: pose.position(), arrival: Arrival::Heading(pose.heading) }
    }

    /// To a pose that is approached along its heading.
    pub const fn dock(pose: Pose) -> Goal {
        Goal { point: pose.position(), arrival: Arrival::Dock(pose.heading) }
    }

    /// The pose, where there is one.
    fn heading(&self) -> Option<f64> {
        match self.arrival {
            Arrival::Anyhow => None,
            Arrival::Heading(heading) | Arrival::Dock(heading) => Some(heading),
        }
    }
}

/// How a dock is approached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Docking {
    /// How far before the dock the approach begins (m).
    pub standoff: f64,
    /// Speed of the approach (m/s).
    pub speed: f64,
    /// Speed for a metre of way left (1/s).
    pub slowing: f64,
    /// How firmly the axis is held.
    pub gains: Gains,
    /// Within this of the dock, along the axis, it is there (m).
    pub near: f64,
    /// Farther beside the axis than this (m) it has missed, and backs off to try again.
    pub across: f64,
    /// How often it tries.
    pub attempts: u32,
}

impl Default for Docking {
    /// For a dock with contacts a centimetre wide.
    ///
    /// On 0.4 m the error across falls to a tenth with a length of 0.1 m, from what the standoff leaves of it. 0.1 m/s leave time for
    /// twenty corrections. 4 mm along and 7 mm across make 8 mm, which leaves 2 mm of a centimetre to the localizer. What three times
    /// did not fit will not fit a fourth time.
    fn default() -> Docking {
        Docking {
            standoff: 0.4,
            speed: 0.1,
            slowing: 1.0,
            gains: Gains { along: 2.0, length: 0.1, heading: 1.0 },
            near: 0.004,
            across: 0.007,
            attempts: 3,
        }
    }
}

/// How to go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// The law, its speeds, and within what the position is reached (`near`).
    pub steering: steering::Parameters,
    /// What the drive can do.
    pub limits: Limits,
    /// How fast a correction comes in.
    pub blend: blend::Parameters,
    /// Once there, it steers again if it is farther off than this (m). It is what is promised of the position.
    pub tolerance: f64,
    /// Within this of the wanted heading it is aligned (rad).
    pub aligned: f64,
    /// Turn rate for a radian while it aligns (1/s).
    pub align_gain: f64,
    /// How long it must have stood before it counts as standing (s): some lags of the drive.
    pub still: f64,
    /// How a dock is approached.
    pub docking: Docking,
    /// Without coming nearer for so long, though ordered to, it cannot get there (s).
    pub patience: f64,
    /// What counts as nearer, of the position (m) and of an angle (rad): by this, or by a tenth.
    pub progress: (f64, f64),
    /// The time for all (s).
    pub time_out: f64,
}

impl Parameters {
    /// For a drive with these limits.
    ///
    /// It counts as there within 8 mm and promises 2 cm, so noise of the localizer of 5 mm, averaged, does not send it off again. One degree
    /// is what a localizer tells. A rate of 1.5/s bears a lag of 0.2 s without swinging. 0.3 s
    /// let a drive roll out that answers within 0.1 s. In 4 s it moves by a metre, so 2 cm or 3° less to
    /// go are no progress at all. A minute is 15 m and a turn.
    pub fn new(limits: Limits) -> Parameters {
        Parameters {
            steering: steering::Parameters { near: 0.008, ..steering::Parameters::default() },
            limits,
            blend: blend::Parameters::default(),
            tolerance: 0.02,
            aligned: 0.0175,
            align_gain: 1.5,
            still: 0.3,
            docking: Docking::default(),
            patience: 4.0,
            progress: (0.02, 0.05),
            time_out: 60.0,
        }
    }
}

/// What it is about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Phase {
    /// It turns in place towards the goal.
    Turning,
    /// It drives to the goal, or to the dock's standoff.
    #[default]
    Steering,
    /// It turns to the final heading, or waits until the corrections have come in.
    Aligning,
    /// It drives along the axis of the dock.
    Docking,
    /// It drives back along the axis to try again.
    BackingOff,
    /// It is there.
    Arrived,
    /// The time was over.
    TimedOut,
    /// It cannot get there: it does not come nearer.
    Stuck,
    /// A pose was not finite.
    Lost,
}

impl Phase {
    /// Whether it has ended, well or badly.
    pub fn is_over(self) -> bool {
        matches!(self, Phase::Arrived | Phase::TimedOut | Phase::Stuck | Phase::Lost)
    }
}

/// What to drive, and how it stands.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Report {
    /// What is to be driven.
    pub twist: Twist,
    /// What it is about.
    pub phase: Phase,
    /// Where it believes to be on the map.
    pub pose: Pose,
    /// Distance to the goal's point (m).
    pub distance: f64,
    /// What is missing to the goal's heading (rad), to the left; 0 for a goal without one.
    pub turn: f64,
    /// Since it began (s).
    pub seconds: f64,
}

/// The nearest it was, and since when it is not nearer (s).
#[derive(Clone, Copy, Debug)]
struct Progress {
    distance: f64,
    angle: f64,
    since: f64,
}

impl Progress {
    const NONE: Progress = Progress { distance: f64::INFINITY, angle: f64::INFINITY, since: 0.0 };

    fn see(&mut self, (by_distance, by_angle): (f64, f64), distance: f64, angle: f64, seconds: f64) {
        self.since += seconds;
        let is_less = |now: f64, best: f64, by: f64| now < best - by || now < 0.9 * best;
        if is_less(distance, self.distance, by_distance) || is_less(angle, self.angle, by_angle) {
            self.since = 0.0;
            self.distance = fmin(self.distance, distance);
            self.angle = fmin(self.angle, angle);
        }
    }
}

/// The way to one goal, from its beginning to its end.
#[derive(Clone, Copy, Debug)]
pub struct Goto {
    parameters: Parameters,
    goal: Goal,
    blend: Blend,
    steering: Steering,
    phase: Phase,
    /// Whether it has been at the standoff; `true` where there is none.
    past_standoff: bool,
    attempts: u32,
    progress: Progress,
    last: Twist,
    /// Since when nothing was ordered (s).
    still: f64,
    seconds: f64,
}

impl Goto {
    /// Sets off to `goal`, moving by `present`, from where odometry has it (`odometry`), with what is known of odometry on the map.
    pub fn new(
        parameters: Parameters,
        goal: Goal,
        map_from_odometry: Pose,
        odometry: Pose,
        present: Twist,
    ) -> Goto {
        let law = match goal.arrival {
            Arrival::Anyhow => parameters.steering.law.to_a_point(),
            _ => parameters.steering.law,
        };
        let steering = Steering::new(steering::Parameters { law, ..parameters.steering });
        let lost = !(blend::is_finite(map_from_odometry) && blend::is_finite(odometry) && is_finite(&goal));
        Goto {
            parameters,
            goal,
            blend: Blend::new(parameters.blend, map_from_odometry, odometry),
            steering,
            phase: if lost { Phase::Lost } else { Phase::Steering },
            past_standoff: !matches!(goal.arrival, Arrival::Dock(_)),
            attempts: 0,
            progress: Progress::NONE,
            last: present,
            still: 0.0,
            seconds: 0.0,
        }
    }

    /// Takes what the localizer found: the pose of odometry's frame on the map, of where both had the body at one and the same time; how old
    /// that is matters little then. What is not finite is left out, and `false` told.
    pub fn correct(&mut self, map_from_odometry: Pose) -> bool {
        self.blend.correct(map_from_odometry)
    }

    /// Tells that something else drove it since the last step, and that it moves by `present` now (a coordinator chose another, a safety
    /// monitor held it): the next order goes on from there, and patience begins anew. The time for all runs on.
    pub fn yielded(&mut self, present: Twist) {
        self.last = if kinematics::is_finite(present) { present } else { Twist::ZERO };
        self.progress = Progress::NONE;
    }

    /// The next order, for a body that odometry has at `odometry`, `dt` (s) after the one before.
    pub fn step(&mut self, odometry: Pose, dt: f64) -> Report {
        let dt = if dt > 0.0 && dt.is_finite() { dt } else { 0.0 };
        if !blend::is_finite(odometry) {
            self.end(Phase::Lost);
        }
        let over = self.phase.is_over();
        let pose = if self.phase == Phase::Lost { self.blend.pose() } else { self.blend.step(odometry, dt) };
        let wish = if over { Twist::ZERO } else { self.advance(pose, dt) };
        let wish = if self.phase.is_over() { Twist::ZERO } else { wish };
        self.last = limit(&self.parameters.limits, wish, self.last, Forward::Allowed, dt).twist;
        Report {
            twist: self.last,
            phase: self.phase,
            pose,
            distance: pose.position().distance(self.goal.point),
            turn: self.turn_left(pose),
            seconds: self.seconds,
        }
    }

    /// What it is about.
    pub const fn phase(&self) -> Phase {
        self.phase
    }

    fn advance(&mut self, pose: Pose, dt: f64) -> Twist {
        self.seconds += dt;
        self.still = if self.last == Twist::ZERO { self.still + dt } else { 0.0 };
        let wish = match self.phase {
            Phase::Turning | Phase::Steering => self.steer(pose),
            Phase::Aligning => self.align(pose),
            Phase::Docking => self.dock(pose),
            _ => self.back_off(pose),
        };
        self.watch(dt);
        wish
    }

    /// Towards the goal, or towards the standoff.
    fn steer(&mut self, pose: Pose) -> Twist {
        let order = self.steering.step(pose, self.target(pose));
        match order.mode {
            Mode::Driving => self.go_on(Phase::Steering),
            Mode::Rotating => self.go_on(Phase::Turning),
            Mode::Near => {
                self.go_on(Phase::Aligning);
                return self.align(pose);
            }
        }
        order.twist
    }

    fn align(&mut self, pose: Pose) -> Twist {
        let p = &self.parameters;
        let off = pose.position().distance(self.target(pose).position());
        if off > p.tolerance && !self.is_docked() {
            self.steering = self.steering.forgotten();
            self.go_on(Phase::Steering);
            return self.steer(pose);
        }
        let left = self.turn_left(pose);
        let (far, turned) = self.blend.rest();
        if fabs(left) > p.aligned {
            return Twist::new(0.0, self.turn_rate(left));
        }
        // What has not come in yet would push it off again.
        let settled = far < p.steering.near / 2.0 && turned < p.aligned / 2.0;
        if settled && self.still >= p.still {
            if self.past_standoff {
                self.end(Phase::Arrived);
            } else {
                self.past_standoff = true;
                self.attempts += 1;
                self.go_on(Phase::Docking);
            }
        }
        Twist::ZERO
    }

    /// Fast while there is far to turn, and never faster than can be stopped.
    fn turn_rate(&self, left: f64) -> f64 {
        let p = &self.parameters;
        let off = fabs(left);
        let stopping = sqrt(2.0 * p.limits.angular_acceleration * off);
        copysign(fmin(fmin(p.align_gain * off, stopping), p.steering.angular_max), left)
    }

    fn dock(&mut self, pose: Pose) -> Twist {
        let docking = self.parameters.docking;
        let at = self.target(pose).inverse().then(pose);
        let left = -at.x;
        if left > docking.near {
            let speed = fmin(docking.speed, docking.slowing * left);
            return self.along_axis(pose, speed);
        }
        if fabs(at.y) <= docking.across {
            self.go_on(Phase::Aligning);
        } else if self.attempts < docking.attempts {
            self.go_on(Phase::BackingOff);
        } else {
            self.end(Phase::Stuck);
        }
        Twist::ZERO
    }

    fn back_off(&mut self, pose: Pose) -> Twist {
        let docking = self.parameters.docking;
        let at = self.target(pose).inverse().then(pose);
        if -at.x >= docking.standoff {
            self.past_standoff = false;
            self.go_on(Phase::Aligning);
            return Twist::ZERO;
        }
        self.along_axis(pose, -docking.speed)
    }

    fn along_axis(&self, pose: Pose, speed: f64) -> Twist {
        let (reference, _) = trajectory::beside(pose, self.target(pose));
        let error = trajectory::error(pose, reference);
        trajectory::follow(&self.parameters.docking.gains, error, Twist::new(speed, 0.0))
    }

    /// Whether it stands in the dock, where it must not be steered out of again.
    fn is_docked(&self) -> bool {
        self.past_standoff && matches!(self.goal.arrival, Arrival::Dock(_))
    }

    /// Where it goes just now: the goal, or the standoff. Without a heading of its own the goal has that of the way to it.
    fn target(&self, pose: Pose) -> Pose {
        let point = self.goal.point;
        let heading = self.goal.heading().unwrap_or_else(|| (point - pose.position()).bearing());
        let goal = Pose { x: point.x, y: point.y, heading };
        if self.past_standoff { goal } else { goal.along_arc(-self.parameters.docking.standoff, 0.0) }
    }

    fn turn_left(&self, pose: Pose) -> f64 {
        self.goal.heading().map_or(0.0, |heading| wrap(heading - pose.heading))
    }

    fn watch(&mut self, dt: f64) {
        if self.phase.is_over() {
            return;
        }
        let p = &self.parameters;
        // As the last correction has it: of slipping wheels the blended pose hears late.
        let pose = self.blend.target();
        let at = Polar::of(pose, self.target(pose));
        let angle = match self.phase {
            Phase::Turning | Phase::Steering => fabs(at.alpha),
            Phase::Aligning => fabs(self.turn_left(pose)),
            _ => 0.0,
        };
        // Backing off, the way left is what is missing to the standoff.
        let distance = match self.phase {
            Phase::BackingOff => p.docking.standoff - at.distance,
            _ => at.distance,
        };
        // Nobody comes nearer without an order to.
        let ordered = if self.last == Twist::ZERO { 0.0 } else { dt };
        self.progress.see(p.progress, distance, angle, ordered);
        if self.progress.since > p.patience {
            self.end(Phase::Stuck);
        } else if self.seconds > p.time_out {
            self.end(Phase::TimedOut);
        }
    }

    fn go_on(&mut self, phase: Phase) {
        let driving = |phase: Phase| matches!(phase, Phase::Turning | Phase::Steering);
        // Between turning and steering the goal is the same, so what was won counts on.
        if phase != self.phase && !(driving(phase) && driving(self.phase)) {
            self.progress = Progress::NONE;
        }
        self.phase = phase;
    }

    fn end(&mut self, phase: Phase) {
        if !self.phase.is_over() {
            self.phase = phase;
        }
    }
}

fn is_finite(goal: &Goal) -> bool {
    goal.point.x.is_finite() && goal.point.y.is_finite() && goal.heading().unwrap_or(0.0).is_finite()
}

#[cfg(test)]
mod tests;
