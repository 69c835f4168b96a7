//! Move: a velocity for a time, a distance, an angle, a place; by a profile, with the loop closed over the wheels.

use motion::manoeuvre::{self, Manoeuvre, Move, Outcome};
use motion::profile::{Bounds, Unfit};
use runtime::{Agent, Fault, Input, Output, Step};
use types::messages::{Mode, Motion, Odometry, Offer, Progress, Report, Task, Twist};
use types::params::Params;
use types::{Text, Time};

use crate::action::{Duty, NO_POSE, NOTHING, TOO_LONG, Whereabouts, bounded, offer};

/// Why something ended: short enough to be handed back by value.
type Why = Text<119>;

/// What a motion may do.
#[derive(Clone, Debug, Params)]
pub struct MoveParams {
    /// How the speed grows and falls: "trapezoid", at once with full acceleration, or "s-curve", which bounds the jerk as well and does not let a tall body nod.
    #[param(default = "s-curve", words = ["trapezoid", "s-curve"])]
    pub profile: Text<12>,
    /// Highest speed (m/s). 0.5 is a slow walk.
    #[param(default = 0.5, min = 0.01, max = 10.0)]
    pub linear_max: f64,
    /// Highest speed backwards (m/s), as a positive number; no higher than that of the drive, or it falls behind its plan. 0.3: it sees less there.
    #[param(default = 0.3, min = 0.01, max = 10.0)]
    pub backward_max: f64,
    /// Acceleration (m/s²). 0.5 starts without slip on a smooth floor.
    #[param(default = 0.5, min = 0.01, max = 20.0)]
    pub acceleration: f64,
    /// Jerk (m/s³): 2 is at full acceleration after a quarter of a second.
    #[param(default = 2.0, min = 0.01, max = 1000.0)]
    pub jerk: f64,
    /// Highest turn rate (rad/s).
    #[param(default = 1.0, min = 0.01, max = 20.0)]
    pub angular_max: f64,
    /// Angular acceleration (rad/s²). Less than what the drive can do, so that corrections have room.
    #[param(default = 2.0, min = 0.01, max = 100.0)]
    pub angular_acceleration: f64,
    /// Angular jerk (rad/s³).
    #[param(default = 8.0, min = 0.01, max = 10000.0)]
    pub angular_jerk: f64,
    /// Lag of the drive (s): commands lead by what it loses.
    #[param(default = 0.0, min = 0.0, max = 1.0)]
    pub lag: f64,
    /// A way is done within this of its end (m).
    #[param(default = 0.005, min = 0.0005, max = 1.0)]
    pub near: f64,
    /// And within this of its heading (rad).
    #[param(default = 0.01, min = 0.001, max = 1.0)]
    pub aligned: f64,
    /// Farther behind the plan than this (m, or rad of a turn) something holds it.
    #[param(default = 0.2, min = 0.01, max = 5.0)]
    pub lag_max: f64,
}

impl MoveParams {
    /// The parameter that says how fast a task may be, and what it says (m/s).
    fn fastest(&self, task: &Task) -> (&'static str, f64) {
        let is_backward = match task.motion {
            Motion::Distance => task.distance < 0.0,
            Motion::Velocity => task.linear < 0.0,
            _ => false,
        };
        if is_backward && self.backward_max < self.linear_max {
            ("backward_max", self.backward_max)
        } else {
            ("linear_max", self.linear_max)
        }
    }

    /// Why a task has no plan.
    fn unfit(&self, task: &Task, unfit: Unfit) -> Why {
        let (name, fastest) = self.fastest(task);
        match unfit {
            Unfit::TooFast if task.linear.abs() > fastest => Text::format(format_args!(
                "{} m/s is faster than the move action's {name} of {fastest} m/s",
                task.linear
            )),
            Unfit::TooFast => Text::format(format_args!(
                "{} rad/s is faster than the move action's angular_max of {} rad/s",
                task.angular, self.angular_max
            )),
            _ => "no profile leads there: it is farther or finer than a plan can be".into(),
        }
    }

    fn parameters(&self, task: &Task) -> manoeuvre::Parameters {
        let jerk = |jerk: f64| if self.profile.as_str() == "trapezoid" { f64::INFINITY } else { jerk };
        // A timed velocity is driven as it is said: too fast a one is refused, not slowed.
        let asked = |speed: f64| if task.motion == Motion::Velocity { 0.0 } else { speed.abs() };
        manoeuvre::Parameters {
            linear: Bounds {
                velocity: bounded(self.fastest(task).1, asked(task.linear)),
                acceleration: self.acceleration,
                jerk: jerk(self.jerk),
            },
            angular: Bounds {
                velocity: bounded(self.angular_max, asked(task.angular)),
                acceleration: self.angular_acceleration,
                jerk: jerk(self.angular_jerk),
            },
            lag: self.lag,
            near: self.near,
            aligned: self.aligned,
            lag_max: self.lag_max,
            ..manoeuvre::Parameters::default()
        }
    }
}

const BLOCKED: &str =
    "it fell behind its plan: something holds it, its wheels slip, or its latch is set (then: sinew reset)";

/// Drives the manoeuvre of its task, and tells when it is done or something holds it.
#[derive(Agent)]
#[agent(kind = "move")]
pub struct MoveAction {
    /// Whether it is heard.
    mode: Input<Mode>,
    /// What to drive.
    task: Input<Task>,
    /// Where the robot is by its wheels.
    odometry: Input<Odometry>,
    /// Where it is on the map, from the localizer, for places of the map: what it knows when it sets off counts.
    pose: Input<Odometry>,
    /// How it wishes to drive.
    drive: Output<Offer>,
    /// How far it has come.
    #[port(history = 64)]
    report: Output<Report>,
    params: MoveParams,
    duty: Duty,
    place: Whereabouts,
    /// What it drives, or why it cannot.
    manoeuvre: Option<Result<Manoeuvre, (Progress, Why)>>,
    /// Odometry as one reading gave it: what is held to a plan must not be predicted from the plan's own commands.
    measured: Option<Odometry>,
}

impl Agent for MoveAction {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        let now = step.now;
        self.duty.listen(&mut self.mode, &mut self.task);
        self.measured = self.odometry.latest().or(self.measured);
        self.place.listen(&mut self.odometry, &mut self.pose, now);
        let task = self.duty.task(step.name_of(step.agent).unwrap_or_default().as_str());
        let is_mine =
            |motion| matches!(motion, Motion::Velocity | Motion::Distance | Motion::Turn | Motion::To);
        let task = task.filter(|task| is_mine(task.motion));
        let (is_new, dt) = (self.duty.is_new(task.as_ref(), now), self.duty.dt(now));
        let Some(task) = task else {
            self.manoeuvre = None;
            self.report.send(NOTHING);
            return Ok(());
        };
        if is_new {
            self.manoeuvre = Some(begin(&self.params, &task, &self.place));
        }
        let (twist, report) = self.advance(&task, dt, now);
        self.drive.send(offer(twist, now));
        self.report.send(report);
        Ok(())
    }
}

fn begin(params: &MoveParams, task: &Task, place: &Whereabouts) -> Result<Manoeuvre, (Progress, Why)> {
    let wanted = match task.motion {
        Motion::To => {
            let target = place.target(task).ok_or((Progress::Lost, NO_POSE.into()))?;
            Move::To { point: target.position(), heading: task.turned.then_some(target.heading) }
        }
        Motion::Distance => Move::Distance(task.distance),
        Motion::Turn => Move::Turn(task.angle),
        _ => Move::Velocity { twist: Twist::new(task.linear, task.angular), seconds: task.seconds },
    };
    Manoeuvre::new(params.parameters(task), wanted)
        .map_err(|unfit| (Progress::Refused, params.unfit(task, unfit)))
}

impl MoveAction {
    fn advance(&mut self, task: &Task, dt: f64, now: Time) -> (Twist, Report) {
        let seconds = self.duty.seconds(now);
        let report = Report { task: task.number, progress: Progress::Underway, seconds, ..Report::default() };
        let manoeuvre = match &mut self.manoeuvre {
            Some(Ok(manoeuvre)) => manoeuvre,
            Some(Err((progress, why))) => {
                let (distance, angle) = (task.distance.abs(), task.angle);
                return (
                    Twist::ZERO,
                    Report { progress: *progress, distance, angle, why: why.as_str().into(), ..report },
                );
            }
            None => return (Twist::ZERO, report),
        };
        let Some(measured) = self.measured else { return (Twist::ZERO, report) };
        let gone = manoeuvre.step(measured.pose, dt);
        let is_late = task.motion != Motion::Velocity && task.seconds > 0.0 && seconds > task.seconds;
        let (progress, why) = match gone.outcome {
            Outcome::Running if is_late => (Progress::TimedOut, TOO_LONG),
            Outcome::Running => (Progress::Underway, ""),
            Outcome::Done => (Progress::Arrived, ""),
            Outcome::Missed => {
                (Progress::Unreachable, "its plan is over and the wheels have not come to its end")
            }
            Outcome::Blocked => (Progress::Unreachable, BLOCKED),
            Outcome::Lost => (Progress::Lost, "the odometry tells no numbers"),
        };
        let twist = if progress == Progress::TimedOut { Twist::ZERO } else { gone.twist };
        let (distance, angle) = (gone.distance, gone.angle);
        (twist, Report { progress, distance, angle, why: why.into(), ..report })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use types::{Duration, Pose};

    /// Drives a body that follows at once; gives where it ends, how, and the greatest speed.
    fn driven(params: &MoveParams, task: Task) -> (Pose, Progress, f64) {
        let mut agent = MoveAction { params: params.clone(), ..blank() };
        agent.place.map_from_odometry = Some(Pose::new(5.0, 1.0, types::geometry::PI / 2.0));
        agent.manoeuvre = Some(begin(params, &task, &agent.place));
        let (mut body, mut fastest) = (Pose::default(), 0.0_f64);
        for i in 0..3000 {
            let now = Time::ZERO + Duration::millis(20 * i);
            agent.duty.is_new(Some(&task), now);
            agent.measured = Some(Odometry { pose: body, ..Odometry::default() });
            let (twist, report) = agent.advance(&task, 0.02, now);
            if report.progress.is_over() {
                return (body, report.progress, fastest);
            }
            fastest = fastest.max(twist.linear.abs());
            body = body.advanced(twist.linear, twist.angular, 0.02);
        }
        panic!("it does not end: {body:?}");
    }

    fn blank() -> MoveAction {
        MoveAction {
            mode: Default::default(),
            task: Default::default(),
            odometry: Default::default(),
            pose: Default::default(),
            drive: Default::default(),
            report: Default::default(),
            params: MoveParams::default(),
            duty: Duty::default(),
            place: Whereabouts::default(),
            manoeuvre: None,
            measured: None,
        }
    }

    #[test]
    fn distances_angles_and_timed_velocities_end_where_they_should() {
        for profile in ["trapezoid", "s-curve"] {
            let params = MoveParams { profile: profile.into(), ..MoveParams::default() };
            let task = Task { number: 1, ..Task::default() };
            let (end, how, fastest) =
                driven(&params, Task { motion: Motion::Distance, distance: 1.0, linear: 0.2, ..task });
            assert_eq!(how, Progress::Arrived, "{profile}");
            assert!((end.x - 1.0).abs() < 0.006 && end.y.abs() < 0.006, "{profile}: {end:?}");
            assert!(fastest < 0.2 * 1.2 + 1e-9, "{profile}: {fastest}");
            let (end, how, _) = driven(&params, Task { motion: Motion::Turn, angle: -1.5, ..task });
            assert_eq!(how, Progress::Arrived, "{profile}");
            assert!((end.heading + 1.5).abs() < 0.011, "{profile}: {end:?}");
            // 30 cm/s and 15 °/s for 4 s are 1.2 m and 60° of a circle of 1.146 m.
            let turn = 15f64.to_radians();
            let velocity =
                Task { motion: Motion::Velocity, linear: 0.3, angular: turn, seconds: 4.0, ..task };
            let (end, how, _) = driven(&params, velocity);
            assert_eq!(how, Progress::Arrived, "{profile}");
            assert!((end.heading - 4.0 * turn).abs() < 0.02, "{profile}: {end:?}");
        }
    }

    #[test]
    fn a_place_of_the_map_is_driven_to_by_the_wheels_and_without_a_map_nobody_knows_where_that_is() {
        // Odometry began at (5, 1) of the map, looking along its y: two metres ahead there is (5, 3), one to the left is (4, 1).
        let target = Pose::new(4.0, 3.0, types::geometry::PI);
        let task = Task { number: 1, motion: Motion::To, frame: "map".into(), target, ..Task::default() };
        let (end, how, fastest) = driven(&MoveParams::default(), Task { turned: true, linear: 0.2, ..task });
        assert_eq!(how, Progress::Arrived);
        assert!(end.position().distance(types::Point::new(2.0, 1.0)) < 0.01, "{end:?}");
        assert!(
            (end.heading - types::geometry::PI / 2.0).abs() < 0.011 && fastest < 0.2 * 1.2 + 1e-9,
            "{end:?}"
        );
        let (end, how, _) = driven(&MoveParams::default(), task);
        assert_eq!(how, Progress::Arrived);
        assert!((end.heading - 0.5f64.atan()).abs() < 0.02, "as it came: {end:?}");
        let unknown = begin(&MoveParams::default(), &task, &Whereabouts::default());
        assert_eq!(unknown.err().map(|(progress, _)| progress), Some(Progress::Lost));
        let by_wheels = Task { frame: crate::odometry::ODOM.into(), ..task };
        assert!(begin(&MoveParams::default(), &by_wheels, &Whereabouts::default()).is_ok());
    }

    #[test]
    fn what_cannot_be_driven_is_refused_and_what_is_held_is_told() {
        let fast = Task { number: 1, motion: Motion::Velocity, linear: 2.0, seconds: 1.0, ..Task::default() };
        assert_eq!(driven(&MoveParams::default(), fast).1, Progress::Refused);
        let params = MoveParams::default();
        let task = Task { number: 1, motion: Motion::Distance, distance: 2.0, ..Task::default() };
        let mut agent = blank();
        agent.manoeuvre = Some(begin(&params, &task, &agent.place));
        agent.measured = Some(Odometry::default());
        let held = (0..500).map(|i| agent.advance(&task, 0.02, Time::ZERO + Duration::millis(20 * i)).1);
        let last = held.last().unwrap();
        assert!(last.progress == Progress::Unreachable && last.why.as_str().contains("latch"), "{last:?}");
        assert_eq!(last.distance, 2.0, "all of it is left");
    }

    #[test]
    fn too_fast_a_velocity_is_refused_with_the_limit() {
        let params = MoveParams::default();
        let task = Task { number: 1, motion: Motion::Velocity, seconds: 1.0, ..Task::default() };
        let why = |task: Task| begin(&params, &task, &Whereabouts::default()).unwrap_err().1;
        let told = why(Task { linear: 5.0, ..task });
        assert_eq!(told.as_str(), "5 m/s is faster than the move action's linear_max of 0.5 m/s");
        assert!(why(Task { linear: -0.4, ..task }).as_str().contains("backward_max of 0.3"));
        assert!(why(Task { angular: 5.0, ..task }).as_str().contains("angular_max of 1 rad/s"));
    }

    #[test]
    fn a_way_back_is_planned_no_faster_than_the_drive_goes_back() {
        let task = Task { number: 1, motion: Motion::Distance, distance: -3.0, ..Task::default() };
        let (end, how, fastest) = driven(&MoveParams::default(), task);
        assert_eq!(how, Progress::Arrived);
        assert!((end.x + 3.0).abs() < 0.006 && fastest < 0.3 * 1.2 + 1e-9, "{end:?}, {fastest} m/s");
    }
}
