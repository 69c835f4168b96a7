//! Goto: to a point, a pose or a dock, by the wheels at 50 Hz and the localizer at 5 Hz.
//!
//! ```text
//!  odometry (20 ms) ───────▶ ┌───────┐   pose without   ┌─────────────────┐   limits    ┌───────┐
//!  pose of the localizer ──▶ │ blend │ ────────────────▶ │ law of steering │ ──────────▶ │ offer │
//!  (200 ms, at its own time) └───────┘      a jump       └─────────────────┘             └───────┘
//! ```
//!
//! The laws and the states of a goal are in [`motion::goto`] and [`motion::steering`].

use motion::blend;
use motion::goto::{Docking, Goal, Goto, Parameters, Phase};
use motion::steering::{self, Behind, Law};
use runtime::{Agent, Fault, Input, Output, Step};
use types::messages::{Mode, Motion, Odometry, Offer, Progress, Report, Task, Twist};
use types::params::Params;
use types::{Duration, Pose, Text, Time};

use crate::action::{Duty, NO_POSE, NOTHING, TOO_LONG, Whereabouts, bounded, limits, offer};

/// The law, and what is good enough.
#[derive(Clone, Debug, Params)]
pub struct GotoParams {
    /// The law that steers: "aicardi", smooth from everywhere, or "linear".
    #[param(default = "aicardi", words = ["aicardi", "linear"])]
    pub law: Text<8>,
    /// How fast the law lets the distance fall (1/s). 1 slows down over the last 0.3 m, and bears a hold of the command of 0.3 s.
    #[param(default = 1.0, min = 0.05, max = 10.0)]
    pub rate: f64,
    /// What it does about a goal that lies behind: "rotate" turns on the spot first, so that a laser in front sees where it goes; "reverse" backs up; "as-law" leaves it to the law.
    #[param(default = "rotate", words = ["rotate", "reverse", "as-law"])]
    pub behind: Text<8>,
    /// Highest speed (m/s). 0.3 is what the reactive layer's robot drove with.
    #[param(default = 0.3, min = 0.01, max = 10.0)]
    pub linear_max: f64,
    /// Highest turn rate (rad/s). 1 turns around in three seconds.
    #[param(default = 1.0, min = 0.05, max = 20.0)]
    pub angular_max: f64,
    /// Highest change of speed (m/s²). 0.5 starts and stops without slip on a smooth floor.
    #[param(default = 0.5, min = 0.01, max = 20.0)]
    pub acceleration: f64,
    /// Highest change of the turn rate (rad/s²).
    #[param(default = 3.0, min = 0.01, max = 100.0)]
    pub angular_acceleration: f64,
    /// Within this of the goal its position is reached (m). 8 mm leave more than a centimetre to the localizer.
    #[param(default = 0.008, min = 0.001, max = 1.0)]
    pub near: f64,
    /// What is promised of the position (m): farther off than this it steers again.
    #[param(default = 0.02, min = 0.002, max = 2.0)]
    pub tolerance: f64,
    /// Within this of the wanted heading it is aligned (rad). One degree.
    #[param(default = 0.0175, min = 0.001, max = 1.0)]
    pub aligned: f64,
    /// So long it must have stood to count as standing (s). 0.3 s are some lags of a drive that answers within 0.1 s.
    #[param(default = 0.3, min = 0.0, max = 5.0)]
    pub still: f64,
    /// Without coming nearer for so long, though it alone drives, it cannot get there (time).
    #[param(default = Duration::secs(4), min = 0.1, max = 600.0)]
    pub patience: Duration,
    /// The same where others are heard as well and may lead it around something (time). 40 s is 12 m of a way around.
    #[param(default = Duration::secs(40), min = 0.1, max = 3600.0)]
    pub patience_among_others: Duration,
    /// How long a correction of the localizer takes to come in (s): the low-pass also averages its noise.
    #[param(default = 0.3, min = 0.02, max = 10.0)]
    pub blend: f64,
    /// Without a pose of the localizer for so long it is lost (time). 2 s is 0.6 m by odometry alone.
    #[param(default = Duration::secs(2), min = 0.1, max = 600.0)]
    pub pose_age: Duration,
    /// How far before a dock the slow approach begins (m).
    #[param(default = 0.4, min = 0.05, max = 3.0)]
    pub standoff: f64,
}

impl GotoParams {
    fn parameters(&self, task: &Task, is_shared: bool) -> Parameters {
        let linear_max = bounded(self.linear_max, task.linear);
        let angular_max = bounded(self.angular_max, task.angular);
        let limits = limits(linear_max, angular_max, self.acceleration, self.angular_acceleration);
        let law =
            if self.law.as_str() == "linear" { Law::linear(self.rate) } else { Law::aicardi(self.rate) };
        let behind = match self.behind.as_str() {
            "reverse" => Behind::Reverse,
            "as-law" => Behind::AsLaw,
            _ => Behind::Rotate,
        };
        let usual = Parameters::new(limits);
        let patience = if is_shared { self.patience_among_others } else { self.patience };
        Parameters {
            steering: steering::Parameters {
                law,
                behind,
                linear_max,
                angular_max,
                near: self.near,
                ..usual.steering
            },
            blend: blend::Parameters { time_constant: self.blend, ..usual.blend },
            tolerance: self.tolerance,
            aligned: self.aligned,
            still: self.still,
            docking: Docking { standoff: self.standoff, ..Docking::default() },
            patience: patience.seconds(),
            time_out: if task.seconds > 0.0 { task.seconds } else { f64::INFINITY },
            ..usual
        }
    }
}

/// Steers to the goal of its task, and tells when it is there, cannot get there, takes too long, or is lost.
#[derive(Agent)]
#[agent(kind = "goto")]
pub struct GotoAction {
    /// Whether it is heard.
    mode: Input<Mode>,
    /// Where to.
    task: Input<Task>,
    /// Where the robot is by its wheels.
    odometry: Input<Odometry>,
    /// Where it is on the map, from the localizer. Where that is not wired, goals are in the frame of odometry.
    pose: Input<Odometry>,
    /// How it wishes to drive.
    drive: Output<Offer>,
    /// How far it has come.
    #[port(history = 64)]
    report: Output<Report>,
    params: GotoParams,
    duty: Duty,
    going: Going,
}

impl Agent for GotoAction {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        let now = step.now;
        self.duty.listen(&mut self.mode, &mut self.task);
        self.going.place.listen(&mut self.odometry, &mut self.pose, now);
        let task = self.duty.task(step.name_of(step.agent).unwrap_or_default().as_str());
        let task = task.filter(|task| matches!(task.motion, Motion::Goto | Motion::Dock));
        let (is_new, dt) = (self.duty.is_new(task.as_ref(), now), self.duty.dt(now));
        let Some(task) = task else {
            self.going.goto = None;
            self.report.send(NOTHING);
            return Ok(());
        };
        if is_new {
            self.going.begin(self.params.parameters(&task, self.duty.is_shared()), &task);
        }
        let needs_pose = self.pose.is_wired();
        let (twist, report) = self.going.advance(&self.params, &task, needs_pose, now, dt);
        self.drive.send(offer(twist, now));
        self.report.send(Report { seconds: self.duty.seconds(now), ..report });
        Ok(())
    }
}

const STUCK: &str =
    "it comes no nearer: something is in its way or holds it, or its latch is set (then: sinew reset)";

/// The way to one goal.
#[derive(Clone, Copy, Debug, Default)]
struct Going {
    place: Whereabouts,
    wanted: Option<(Parameters, Goal)>,
    goto: Option<Goto>,
}

impl Going {
    fn begin(&mut self, parameters: Parameters, task: &Task) {
        let goal = match (task.motion, task.turned) {
            (Motion::Dock, _) => Goal::dock(task.target),
            (_, true) => Goal::pose(task.target),
            (_, false) => Goal::point(task.target.position()),
        };
        (self.wanted, self.goto) = (Some((parameters, goal)), None);
    }

    fn advance(
        &mut self,
        params: &GotoParams,
        task: &Task,
        needs_pose: bool,
        now: Time,
        dt: f64,
    ) -> (Twist, Report) {
        let report = Report { task: task.number, progress: Progress::Underway, ..Report::default() };
        let Some(odometry) = self.place.odometry else { return (Twist::ZERO, report) };
        let is_old = |at: Time| now - at > params.pose_age;
        let correction = if needs_pose { self.place.map_from_odometry } else { Some(Pose::default()) };
        let (Some(correction), Some((parameters, goal))) = (correction, self.wanted) else {
            return (Twist::ZERO, Report { progress: Progress::Lost, why: NO_POSE.into(), ..report });
        };
        let goto = self
            .goto
            .get_or_insert_with(|| Goto::new(parameters, goal, correction, odometry.pose, odometry.twist));
        if self.place.is_news {
            goto.correct(correction);
        }
        let gone = goto.step(odometry.pose, dt);
        let report = Report { distance: gone.distance, angle: gone.turn, ..report };
        if needs_pose && self.place.corrected.is_none_or(is_old) {
            return (Twist::ZERO, Report { progress: Progress::Lost, why: NO_POSE.into(), ..report });
        }
        let (progress, why) = match gone.phase {
            Phase::Arrived => (Progress::Arrived, ""),
            Phase::TimedOut => (Progress::TimedOut, TOO_LONG),
            Phase::Stuck => (Progress::Unreachable, STUCK),
            Phase::Lost => (Progress::Lost, "the odometry tells no numbers"),
            _ => (Progress::Underway, ""),
        };
        (gone.twist, Report { progress, why: why.into(), ..report })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: f64 = 0.02;

    /// Drives a body without lag to a goal; the localizer says the truth five times a second, on a map that begins at (2, 1).
    fn driven(params: &GotoParams, task: Task, steps: usize) -> (Pose, Report, usize) {
        let map = Pose::new(2.0, 1.0, 0.5);
        let (mut body, mut twist) = (Pose::default(), Twist::ZERO);
        let mut going = Going::default();
        going.begin(params.parameters(&task, false), &task);
        let mut last = Report::default();
        for i in 0..steps {
            let now = Time::ZERO + Duration::millis(20 * i as i64);
            going.place.odometry = Some(Odometry { pose: body, twist, ..Odometry::default() });
            going.place.is_news = i % 10 == 0;
            if going.place.is_news {
                going.place.map_from_odometry = Some(map);
                going.place.corrected = Some(now);
            }
            (twist, last) = going.advance(params, &task, true, now, STEP);
            if last.progress.is_over() {
                return (map.then(body), last, i);
            }
            body = body.advanced(twist.linear, twist.angular, STEP);
        }
        (map.then(body), last, steps)
    }

    fn to(x: f64, y: f64, heading: Option<f64>) -> Task {
        let target = Pose::new(x, y, heading.unwrap_or(0.0));
        Task { number: 1, motion: Motion::Goto, target, turned: heading.is_some(), ..Task::default() }
    }

    #[test]
    fn it_gets_to_points_and_poses_of_the_map_by_both_laws() {
        for law in ["aicardi", "linear"] {
            let params = GotoParams { law: law.into(), ..GotoParams::default() };
            for (x, y, heading) in [(4.0, 2.0, None), (1.0, 0.0, None), (3.0, 1.0, Some(-2.0))] {
                let (end, report, _) = driven(&params, to(x, y, heading), 4000);
                assert_eq!(report.progress, Progress::Arrived, "{law} to {x}, {y}: {end:?}");
                let off = (end.x - x).hypot(end.y - y);
                assert!(off < 0.02, "{law} to {x}, {y}: {off}");
                if let Some(heading) = heading {
                    assert!(types::geometry::wrap(end.heading - heading).abs() < 0.02, "{end:?}");
                }
            }
        }
    }

    #[test]
    fn what_takes_too_long_is_told_and_the_speed_of_the_task_is_kept() {
        let params = GotoParams::default();
        let (_, report, steps) = driven(&params, Task { seconds: 2.0, ..to(9.0, 1.0, None) }, 4000);
        assert!(report.progress == Progress::TimedOut && (99..=101).contains(&steps), "{report:?} {steps}");
        let (end, _, _) = driven(&params, Task { linear: 0.1, ..to(9.0, 1.0, None) }, 250);
        assert!(end.position().distance(types::Point::new(2.0, 1.0)) < 0.5, "{end:?}");
    }

    #[test]
    fn without_a_pose_it_is_lost() {
        let params = GotoParams::default();
        let mut going = Going { place: Whereabouts::default(), ..Going::default() };
        let task = to(3.0, 1.0, None);
        going.begin(params.parameters(&task, false), &task);
        going.place.odometry = Some(Odometry::default());
        let lost = going.advance(&params, &task, true, Time::ZERO, STEP).1;
        assert_eq!(lost.progress, Progress::Lost, "there was none");
        (going.place.map_from_odometry, going.place.corrected) = (Some(Pose::default()), Some(Time::ZERO));
        let at = |millis| Time::ZERO + Duration::millis(millis);
        let (twist, report) = going.advance(&params, &task, true, at(1000), STEP);
        assert!(report.progress == Progress::Underway && twist != Twist::ZERO);
        let (twist, report) = going.advance(&params, &task, true, at(2001), STEP);
        assert_eq!((twist, report.progress), (Twist::ZERO, Progress::Lost), "it is too old");
    }
}
