//! Set moves: a velocity for a time, a distance, an angle, a point. Each is planned as a whole and driven with the loop closed over odometry.
//!
//! ```text
//!                      its end      reached                     last leg
//!  ┌──────┐ begin ┌─────┐ passed ┌──────────┐ leg done ┌─────┐ ─────────▶ Done
//!  │ plan │ ────▶ │ leg │ ─────▶ │ settling │ ───────▶ │ leg │
//!  └──────┘       └─────┘        └──────────┘          └─────┘
//!                    │ error along      │ settle over
//!                    ▼ > lag_max        ▼
//!                 Blocked            Missed
//! ```
//!
//! A leg is an arc: the reference has driven L p(t) along and turned by A p(t), with p a [`Profile`]; L is 0 for a turn, A for a straight
//! way. A timed velocity (v, ω) is the arc L = v, A = ω with p in seconds: both parts grow together, so the body keeps the curve, and as
//! long as braking takes as long as starting the way is v times the time. The motion is the reference's, led by the drive's lag, and
//! corrected by [`trajectory::follow`].
//!
//! It holds for a drive that answers as a lag of first order within about 0.2 s, and for steps of 5 to 50 ms.

use crate::kinematics::{Twist, is_finite};
use crate::profile::{Bounds, Profile, State, Unfit};
use crate::steering::saturated;
use crate::trajectory::{self, Gains};
use libm::{fabs, fmin, hypot};
use types::geometry::{PI, wrap};
use types::{Point, Pose};

/// What to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Move {
    /// A velocity for so long. The time is that from the start of starting to the start of braking.
    Velocity {
        /// Speed and turn rate.
        twist: Twist,
        /// For how long (s).
        seconds: f64,
    },
    /// Straight on (m); negative is backward.
    Distance(f64),
    /// In place (rad), to the left; also more than a turn.
    Turn(f64),
    /// Turn to the point, drive to it, and turn to the heading (rad) if there is one; both in the frame of odometry.
    To {
        /// Where to.
        point: Point,
        /// Final heading (rad).
        heading: Option<f64>,
    },
}

/// How to move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// What the speed may do (m/s, m/s², m/s³).
    pub linear: Bounds,
    /// What the turn rate may do (rad/s, rad/s², rad/s³).
    pub angular: Bounds,
    /// How firmly odometry is held to the plan.
    pub gains: Gains,
    /// Lag of the drive (s): the order leads by what it loses.
    pub lag: f64,
    /// A leg is done within this of its end along the way (m).
    pub near: f64,
    /// And within this of its heading (rad).
    pub aligned: f64,
    /// How long it may take after the end of the plan (s).
    pub settle: f64,
    /// Farther behind the plan than this (m) it is blocked; for a turn the same in rad.
    pub lag_max: f64,
    /// How much faster than the bounds the correction may make it, as a factor, 1 or more.
    pub reserve: f64,
}

impl Default for Parameters {
    /// For an indoor base.
    ///
    /// Speed and acceleration are those of [`crate::limits::Limits::indoor`], and a quarter of a second to full acceleration keeps a tall body
    /// from nodding. No lag is led: too much of it overshoots. 5 mm and half a degree are a few counts of a wheel. A second lets
    /// an error along decay to a seventh. 0.2 m are a wheel that slips or a wall, and not the lag of a drive at 0.6 m/s.
    fn default() -> Parameters {
        Parameters {
            linear: Bounds { velocity: 0.6, acceleration: 0.5, jerk: 2.0 },
            angular: Bounds { velocity: 1.0, acceleration: 2.0, jerk: 8.0 },
            gains: Gains::default(),
            lag: 0.0,
            near: 0.005,
            aligned: 0.01,
            settle: 1.0,
            lag_max: 0.2,
            reserve: 1.2,
        }
    }
}

/// How a move stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Outcome {
    /// It is on its way.
    #[default]
    Running,
    /// It ended where it should.
    Done,
    /// It ended, but not where it should: the report says by how much.
    Missed,
    /// It does not follow its plan: something holds it, or its wheels slip.
    Blocked,
    /// A pose was not finite, so nobody knows where it is.
    Lost,
}

/// What to drive, and how it stands.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Report {
    /// What is to be driven; nothing once it has ended.
    pub twist: Twist,
    /// How it stands.
    pub outcome: Outcome,
    /// Which leg it is in, from 0.
    pub leg: usize,
    /// Where the reference is, seen from the body: ahead (m), to the left (m), heading (rad).
    pub error: Pose,
    /// What of the whole move is not driven yet, by odometry: of a way (m), not negative; of a point the straight way there.
    pub distance: f64,
    /// And of the turn (rad), to the left; of a point what is missing to its heading.
    pub angle: f64,
    /// Since the move began (s).
    pub seconds: f64,
}

/// An arc, the profile of its progress, and where it begins.
#[derive(Clone, Copy, Debug)]
struct Leg {
    profile: Profile,
    per: Twist,
    start: Pose,
}

impl Leg {
    fn reference(&self, at: State) -> (Pose, Twist) {
        let pose = self.start.along_arc(self.per.linear * at.position, self.per.angular * at.position);
        (pose, Twist::new(self.per.linear * at.velocity, self.per.angular * at.velocity))
    }
}

/// One move from its beginning to its end.
#[derive(Clone, Copy, Debug)]
pub struct Manoeuvre {
    parameters: Parameters,
    wanted: Move,
    leg: Option<Leg>,
    index: usize,
    in_leg: f64,
    report: Report,
}

impl Manoeuvre {
    /// Plans a move that begins at rest, with the first step. What has no plan is refused.
    pub fn new(parameters: Parameters, wanted: Move) -> Result<Manoeuvre, Unfit> {
        Profile::new(parameters.linear, 0.0)?;
        Profile::new(parameters.angular, 0.0)?;
        match wanted {
            Move::Velocity { twist, seconds } => {
                if !is_finite(twist) || seconds < 0.0 || seconds.is_nan() {
                    return Err(Unfit::Nonsense);
                }
                if fabs(twist.linear) > parameters.linear.velocity
                    || fabs(twist.angular) > parameters.angular.velocity
                {
                    return Err(Unfit::TooFast);
                }
                Profile::new(shared_bounds(&parameters, twist), seconds)?;
            }
            Move::Distance(way) => {
                Profile::new(parameters.linear, way)?;
            }
            Move::Turn(angle) => {
                Profile::new(parameters.angular, angle)?;
            }
            Move::To { point, heading } => {
                if !(point.x.is_finite() && point.y.is_finite() && heading.unwrap_or(0.0).is_finite()) {
                    return Err(Unfit::Nonsense);
                }
            }
        }
        let report = Report::default();
        Ok(Manoeuvre { parameters, wanted, leg: None, index: 0, in_leg: 0.0, report })
    }

    /// The next order, for a body that odometry has at `pose`, `dt` (s) after the one before.
    pub fn step(&mut self, pose: Pose, dt: f64) -> Report {
        if self.report.outcome != Outcome::Running {
            return self.report;
        }
        if !(pose.x.is_finite() && pose.y.is_finite() && pose.heading.is_finite()) {
            return self.end(Outcome::Lost);
        }
        let dt = if dt > 0.0 && dt.is_finite() { dt } else { 0.0 };
        if self.leg.is_some() {
            self.in_leg += dt;
            self.report.seconds += dt;
        }
        loop {
            let Some(leg) = self.leg.or_else(|| self.plan(pose)) else {
                return self.end(Outcome::Done);
            };
            self.leg = Some(leg);
            self.drive(&leg, pose);
            self.tell_rest(&leg, pose);
            if self.in_leg < leg.profile.seconds() || !self.is_there() {
                return self.judge(&leg);
            }
            self.leg = None;
            self.index += 1;
            self.in_leg = 0.0;
        }
    }

    /// What it said last.
    pub const fn report(&self) -> Report {
        self.report
    }

    /// The leg that comes now, from where the body is; `None` after the last one.
    fn plan(&self, pose: Pose) -> Option<Leg> {
        let p = self.parameters;
        let straight = |way: f64| (Profile::new(p.linear, way), Twist::new(1.0, 0.0));
        let turn = |angle: f64| (Profile::new(p.angular, angle), Twist::new(0.0, 1.0));
        let (profile, per) = match (self.wanted, self.index) {
            (Move::Velocity { twist, seconds }, 0) => {
                (Profile::new(shared_bounds(&p, twist), seconds), twist)
            }
            (Move::Distance(way), 0) => straight(way),
            (Move::Turn(angle), 0) => turn(angle),
            (Move::To { point, .. }, 0) => {
                let way = point - pose.position();
                // There already: no direction to turn to.
                turn(if way.norm() > p.near { wrap(way.bearing() - pose.heading) } else { 0.0 })
            }
            (Move::To { point, .. }, 1) => straight((point - pose.position()).norm()),
            (Move::To { heading: Some(heading), .. }, 2) => turn(wrap(heading - pose.heading)),
            _ => return None,
        };
        let start = match (self.wanted, self.index) {
            // The line leads to the point, not along the heading that the turn left.
            (Move::To { point, .. }, 1) if pose.position().distance(point) > p.near => {
                Pose { heading: (point - pose.position()).bearing(), ..pose }
            }
            _ => pose,
        };
        Some(Leg { profile: profile.ok()?, per, start })
    }

    fn drive(&mut self, leg: &Leg, pose: Pose) {
        let p = self.parameters;
        let at = leg.profile.at(self.in_leg);
        let (reference, moving) = leg.reference(at);
        let mut error = trajectory::error(pose, reference);
        if leg.per.linear == 0.0 {
            // Driving to and fro while it turns would only add to the drift.
            error = Pose { x: 0.0, y: 0.0, ..error };
        }
        let corrected = trajectory::follow(&p.gains, error, moving);
        let lead = p.lag * at.acceleration;
        let wish =
            Twist::new(corrected.linear + lead * leg.per.linear, corrected.angular + lead * leg.per.angular);
        self.report.twist = saturated(wish, p.reserve * p.linear.velocity, p.reserve * p.angular.velocity);
        self.report.error = error;
        self.report.leg = self.index;
    }

    /// The rest of the plan, and what the body is behind it.
    fn tell_rest(&mut self, leg: &Leg, pose: Pose) {
        let Report { error, .. } = self.report;
        let (distance, angle) = match self.wanted {
            Move::To { point, heading } => {
                let turn = heading.map_or(0.0, |heading| wrap(heading - pose.heading));
                (pose.position().distance(point), turn)
            }
            _ => {
                let planned = leg.profile.distance() - leg.profile.at(self.in_leg).position;
                let along = leg.per.linear * planned + error.x;
                // Beside a straight way it is off; beside an arc that is a matter of how much of it is driven.
                let across = if leg.per.angular == 0.0 { error.y } else { 0.0 };
                (hypot(along, across), leg.per.angular * planned + error.heading)
            }
        };
        (self.report.distance, self.report.angle) = (distance, angle);
    }

    fn is_there(&self) -> bool {
        let Report { error, .. } = self.report;
        fabs(error.x) <= self.parameters.near && fabs(error.heading) <= self.parameters.aligned
    }

    fn judge(&mut self, leg: &Leg) -> Report {
        let Report { error, .. } = self.report;
        // Half a turn behind, nobody can tell any more which way it is.
        let behind = fabs(error.x) > self.parameters.lag_max
            || fabs(error.heading) > fmin(self.parameters.lag_max, PI / 2.0) && leg.per.linear == 0.0;
        if behind {
            return self.end(Outcome::Blocked);
        }
        if self.in_leg > leg.profile.seconds() + self.parameters.settle {
            return self.end(Outcome::Missed);
        }
        self.report
    }

    fn end(&mut self, outcome: Outcome) -> Report {
        self.report = Report { twist: Twist::ZERO, outcome, ..self.report };
        self.report
    }
}

/// Bounds for the share of a velocity that is driven: 1 at most, and as fast growing as the slower of the two axes can.
fn shared_bounds(parameters: &Parameters, twist: Twist) -> Bounds {
    // An axis that stands needs no time to start.
    let slower = |linear: f64, angular: f64| fmin(linear / fabs(twist.linear), angular / fabs(twist.angular));
    let Parameters { linear, angular, .. } = parameters;
    // Where both stand, the share still needs a finite bound.
    let acceleration = fmin(slower(linear.acceleration, angular.acceleration), 1e9);
    Bounds { velocity: 1.0, acceleration, jerk: slower(linear.jerk, angular.jerk) }
}

#[cfg(test)]
mod tests;
