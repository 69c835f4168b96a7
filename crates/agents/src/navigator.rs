//! The navigator: from scans and odometry to a motion towards a goal, through what nobody told it.

use std::any::Any;

use motion::ring::Ring;
use navigation::avoid::Body;
use navigation::navigator::{Navigator as Stack, Parameters, Scan};
use runtime::{Agent, Fault, Input, Output, Step};
use types::messages::{
    Doing, Drive, EmergencyStop, LaserScan, Mode, Motion, Navigation, Odometry, Offer, Path as Way, Progress,
    Report, Task, Twist, WAYPOINTS,
};
use types::params::Params;
use types::{Duration, Point, Pose, Time};

use crate::action::{Aligning, Duty, NO_POSE, NOTHING, TOO_LONG, Whereabouts, turn_left};
use crate::odometry::ODOM;

/// What the robot is, and where it shall go.
#[derive(Clone, Debug, Params)]
pub struct NavigatorParams {
    /// Where to, ahead of where the odometry began (m); a goal that is heard takes its place.
    #[param(default = 0.0, min = -1000.0, max = 1000.0)]
    pub goal_x: f64,
    /// Where to, to the left of where the odometry began (m).
    #[param(default = 0.0, min = -1000.0, max = 1000.0)]
    pub goal_y: f64,
    /// Whether the two above are a goal. Without one it waits until it hears of one.
    #[param(default = false)]
    pub has_goal: bool,
    /// Length of a rectangular body (m); 0 for a round one.
    #[param(default = 0.0, min = 0.0, max = 5.0)]
    pub length: f64,
    /// Width of the body (m): of a round one its diameter. 0.45 is that of the exploring robot.
    #[param(default = 0.45, min = 0.02, max = 5.0)]
    pub width: f64,
    /// How far the middle of a rectangular body lies ahead of the point between the wheels (m).
    #[param(default = 0.0, min = -2.0, max = 2.0)]
    pub ahead: f64,
    /// Highest speed (m/s). 0.6 is a slow walk.
    #[param(default = 0.6, min = 0.05, max = 5.0)]
    pub linear_max: f64,
    /// Highest turn rate (rad/s). 1 turns around in three seconds.
    #[param(default = 1.0, min = 0.1, max = 10.0)]
    pub angular_max: f64,
    /// How fast it speeds up (m/s²), as the drive lets it. 0.5 starts without slip on a smooth floor.
    #[param(default = 0.5, min = 0.05, max = 10.0)]
    pub acceleration: f64,
    /// How fast it brakes (m/s²). 1 does not tip a tall body.
    #[param(default = 1.0, min = 0.05, max = 10.0)]
    pub deceleration: f64,
    /// How fast its turn rate changes (rad/s²). 3 is at full turn rate after a third of a second.
    #[param(default = 3.0, min = 0.1, max = 50.0)]
    pub angular_acceleration: f64,
    /// From a scan to the wheels' answer (s). 0.1 are a period of a drive and the lag of small motors.
    #[param(default = 0.1, min = 0.0, max = 1.0)]
    pub latency: f64,
    /// Nearer to the goal than this it has arrived (m). 0.2 is what odometry is good for over some metres.
    #[param(default = 0.2, min = 0.02, max = 5.0)]
    pub goal_tolerance: f64,
    /// Without a scan for so long it stands (time). 300 ms is three missed ones at 10 Hz.
    #[param(default = Duration::millis(300), min = 0.02, max = 10.0)]
    pub stale: Duration,
    /// How long it keeps in mind what its laser cannot see now (time). An hour: things stay. People walk on, so among them some seconds are enough.
    #[param(default = Duration::secs(3600), min = 0.1, max = 86400.0)]
    pub remember: Duration,
    /// How long it waits while a stop holds it back before it counts as stuck (time). A minute: people who stand and talk go on at some time.
    #[param(default = Duration::secs(60), min = 0.0, max = 3600.0)]
    pub wait: Duration,
    /// How much its wish matters to it, from 0 to 1. 1: it is made for nothing else.
    #[param(default = 1.0, min = 0.0, max = 1.0)]
    pub weight: f64,
    /// How long a wish of it holds (time). 300 ms is three steps at 10 Hz.
    #[param(default = Duration::millis(300), min = 0.01, max = 10.0)]
    pub hold: Duration,
}

impl NavigatorParams {
    fn body(&self) -> Body {
        let half_width = self.width / 2.0;
        if self.length > 0.0 {
            let half = self.length / 2.0;
            Body::Rectangle { front: half + self.ahead, rear: half - self.ahead, half_width }
        } else {
            Body::Round { radius: half_width }
        }
    }

    fn law(&self) -> Parameters {
        Parameters {
            angular_max: self.angular_max,
            acceleration: self.acceleration,
            deceleration: self.deceleration,
            angular_acceleration: self.angular_acceleration,
            latency: self.latency,
            goal_tolerance: self.goal_tolerance,
            stale: self.stale.seconds(),
            remember: self.remember.seconds(),
            ..Parameters::new(self.body(), self.linear_max)
        }
    }

    fn goal(&self) -> Option<Point> {
        self.has_goal.then(|| Point::new(self.goal_x, self.goal_y))
    }
}

/// Drives to a place around whatever its laser sees, as fast as there is room for; stuck, it gets out by itself or says that it cannot.
#[derive(Agent)]
pub struct Navigator {
    /// What is around.
    #[robot("scan")]
    scan: Input<LaserScan>,
    /// Where the robot believes to be and how it moves.
    odometry: Input<Odometry>,
    /// Where to: the end of the way, in the frame of the odometry. One without points takes the goal away.
    goal: Input<Way>,
    /// Whether it is heard, as an action beside others. Where it is not wired, it is.
    mode: Input<Mode>,
    /// Where to, as an action: it drives while the task is to go to a place.
    task: Input<Task>,
    /// Where the robot is on the map, from the localizer: for tasks whose goal is there.
    pose: Input<Odometry>,
    /// What a stop allows: while that holds it back it waits, and is not stuck.
    stop: Input<EmergencyStop>,
    /// A wish to drive, for a coordinator.
    drive: Output<Offer>,
    /// How far it has come with its task.
    #[port(history = 64)]
    report: Output<Report>,
    /// The same as a plain motion, for a drive without one.
    wish: Output<Twist>,
    /// What it is doing.
    #[port(history = 64)]
    state: Output<Navigation>,
    /// The way that it means to take.
    #[port(history = 64)]
    path: Output<Way>,
    params: NavigatorParams,
    duty: Duty,
    place: Whereabouts,
    helm: Helm,
}

impl Agent for Navigator {
    fn start(&mut self, _: &mut Step) -> Result<(), Fault> {
        let half = self.params.length / 2.0;
        if self.params.length > 0.0 && self.params.ahead.abs() >= half {
            return Err(Fault::new("the body of a navigator must hold the point between its wheels"));
        }
        // All that it remembers is made here, so a step needs no memory.
        self.helm.stack.get_or_insert_with(|| Stack::new(self.params.law()));
        Ok(())
    }

    /// What it remembers of its surroundings, and where it was going.
    fn take_over(&mut self, before: &mut dyn Any) {
        if let Some(before) = before.downcast_mut::<Navigator>() {
            core::mem::swap(&mut self.helm, &mut before.helm);
        }
    }

    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        if let Some(goal) = self.goal.newest() {
            self.helm.heard = Some(goal.points.last().map(|end| Point::from(*end)));
        }
        if let Some(odometry) = self.odometry.latest() {
            self.helm.moves = Some((odometry.pose, odometry.twist));
        }
        let is_action = self.task.is_wired();
        let mut task = None;
        if is_action {
            self.duty.listen(&mut self.mode, &mut self.task);
            self.place.listen(&mut self.odometry, &mut self.pose, step.now);
            task = self.duty.task(step.name_of(step.agent).unwrap_or_default().as_str());
            task = task.filter(|task| task.motion == Motion::Goto);
            let is_new = self.duty.is_new(task.as_ref(), step.now);
            self.helm.aim(task.and_then(|task| self.place.goal(&task)), is_new);
        }
        if let Some(scan) = self.scan.newest() {
            let stamp = scan.header().stamp;
            let at = self.odometry.at(stamp).map(|found| found.value().pose);
            self.helm.look(&scan, scan.row(), at, stamp);
        }
        if let Some(stop) = self.stop.latest() {
            self.helm.hear(&self.params, stop.allowed, step.now);
        }
        let mut state = self.helm.step(&self.params, step.now);
        let (now, dt) = (step.now, self.duty.dt(step.now));
        if is_action {
            let seconds = self.duty.seconds(now);
            let target = task.and_then(|task| self.place.target(&task));
            let here = self.helm.moves.map(|(pose, _)| pose);
            let report = task.map_or(NOTHING, |task| {
                let rest = self.helm.rest(&self.params, &task, (target, here), &mut state, dt);
                told(&task, &state, rest, seconds)
            });
            self.report.send(report);
        }
        let twist = state.twist;
        let drives = !matches!(state.doing, Doing::Idle | Doing::Blind);
        self.drive.send(Offer {
            twist,
            weight: if drives { self.params.weight } else { 0.0 },
            valid_until: now + self.params.hold,
            form: Drive::Numeric,
            ..Offer::default()
        });
        self.wish.send(twist);
        self.state.send(state);
        if self.path.has_listeners() {
            self.path.send(self.helm.path(&state));
        }
        Ok(())
    }
}

/// What becomes of a task, of which so much is left (m, rad); nothing where nobody knows where the robot or its goal is.
fn told(task: &Task, state: &Navigation, rest: Option<(f64, f64)>, seconds: f64) -> Report {
    let is_late = task.seconds > 0.0 && seconds > task.seconds;
    let (progress, why) = match state.doing {
        Doing::Arrived => (Progress::Arrived, ""),
        Doing::GivenUp => (Progress::Unreachable, "it was stuck, and no try got it out"),
        Doing::Blind if is_late => {
            (Progress::TimedOut, "it took longer than it may, and the laser tells nothing")
        }
        Doing::NoWay if is_late => (Progress::TimedOut, "it took longer than it may, and no way is open"),
        _ if is_late && rest.is_none() => (Progress::TimedOut, NO_POSE),
        _ if is_late => (Progress::TimedOut, TOO_LONG),
        _ => (Progress::Underway, ""),
    };
    let (distance, angle) = rest.unwrap_or_default();
    Report { task: task.number, progress, distance, angle, seconds, why: why.into() }
}

/// A goal that a correction of the localizer moves by less than this stays where it is (m): another one is begun anew.
const MOVED: f64 = 0.1;
/// Allowed less than this a robot is held back (m/s): hardly more than one that counts as stuck comes along.
const HELD: f64 = 0.15;

/// The stack, and what it was told last.
#[derive(Debug, Default)]
struct Helm {
    stack: Option<Stack>,
    moves: Option<(Pose, Twist)>,
    /// The goal that was heard last; one that was taken away is none.
    heard: Option<Option<Point>>,
    /// The goal before this step.
    goal: Option<Point>,
    /// Since when a stop holds it back.
    held: Option<Time>,
    /// The turn at the goal.
    aligning: Aligning,
}

impl Helm {
    /// Takes over the goal of a task, by the wheels.
    fn aim(&mut self, goal: Option<Point>, is_new: bool) {
        if let (Some(Some(before)), Some(goal), false) = (self.heard, goal, is_new)
            && before.distance(goal) < MOVED
        {
            return;
        }
        self.heard = Some(goal);
        self.aligning = Aligning::default();
    }

    /// What is left of the way to the target and of the turn there (m, rad), by the pose of the robot, both in the frame of the wheels. At the place
    /// it turns to the heading of its task, and has arrived when it has that.
    fn rest(
        &mut self,
        params: &NavigatorParams,
        task: &Task,
        (target, here): (Option<Pose>, Option<Pose>),
        state: &mut Navigation,
        dt: f64,
    ) -> Option<(f64, f64)> {
        let (target, here) = (target?, here?);
        let turn = turn_left(task, target, here);
        if state.doing == Doing::Arrived && task.turned {
            let limits = (params.angular_max, params.angular_acceleration);
            if let Some(rate) = self.aligning.step(turn, limits, dt) {
                (state.doing, state.twist) = (Doing::Turning, Twist::new(0.0, rate));
            }
        } else {
            self.aligning = Aligning::default();
        }
        Some((here.position().distance(target.position()), turn))
    }

    /// Hears what speed a stop allows (m/s).
    fn hear(&mut self, params: &NavigatorParams, allowed: f64, now: Time) {
        self.held = if allowed < HELD { self.held.or(Some(now)) } else { None };
        if let Some(stack) = &mut self.stack {
            stack.wait(self.held.is_some_and(|since| now - since <= params.wait));
        }
    }

    /// Takes in a scan that was made at `at`; without it the last pose that was heard counts.
    fn look(&mut self, scan: &LaserScan, row: &[f32], at: Option<Pose>, stamp: Time) {
        let (Some(stack), Some((here, _))) = (&mut self.stack, self.moves) else { return };
        let beams =
            Ring::Sweep { angle_min: scan.angle_min.into(), angle_step: scan.angle_step.into(), ranges: row };
        let robot_from_sensor =
            Pose::new(scan.mount_x.into(), scan.mount_y.into(), scan.mount_heading.into());
        // The longest range stands for nothing met; noise may take a hair of it.
        let range_max = f64::from(scan.range_max) * 0.999;
        stack.look(&Scan { time: seconds(stamp), robot_from_sensor, beams, range_max }, at.unwrap_or(here));
    }

    fn step(&mut self, params: &NavigatorParams, now: Time) -> Navigation {
        let idle = Navigation { doing: Doing::Idle, ..Navigation::default() };
        let goal = self.heard.unwrap_or_else(|| params.goal());
        if let Some(stack) = &mut self.stack
            && goal != self.goal
        {
            stack.begin();
        }
        self.goal = goal;
        let (Some(stack), Some(goal)) = (&mut self.stack, goal) else { return idle };
        let Some((pose, twist)) = self.moves else { return Navigation::default() };
        stack.step(seconds(now), pose, twist, goal)
    }

    /// The way, thinned to what a message holds.
    fn path(&self, state: &Navigation) -> Way {
        let points = self.stack.as_ref().map_or(&[][..], Stack::way);
        let mut path =
            Way { frame: ODOM.into(), found: !points.is_empty(), length: state.left, ..Way::default() };
        let step = points.len().div_ceil(WAYPOINTS - 1).max(1);
        for point in points.iter().step_by(step).chain(points.last()) {
            path.cut |= path.points.push((*point).into()).is_err();
        }
        path
    }
}

fn seconds(time: Time) -> f64 {
    time.since_start().seconds()
}

#[cfg(test)]
mod tests {
    use super::*;
    use types::geometry::PI;

    #[test]
    fn a_goal_that_a_correction_moves_by_a_little_stays_and_another_does_not() {
        let mut helm = Helm::default();
        let at = |x| Some(Point::new(x, 1.0));
        helm.aim(at(3.0), true);
        helm.aim(at(3.05), false);
        assert_eq!(helm.heard, Some(at(3.0)));
        helm.aim(at(3.15), false);
        assert_eq!(helm.heard, Some(at(3.15)));
        helm.aim(at(3.2), true);
        assert_eq!(helm.heard, Some(at(3.2)), "another task");
        helm.aim(None, false);
        assert_eq!(helm.heard, Some(None));
    }

    fn params() -> NavigatorParams {
        NavigatorParams { goal_x: 3.0, has_goal: true, ..NavigatorParams::default() }
    }

    fn scan() -> LaserScan {
        LaserScan {
            angle_min: (-PI / 2.0) as f32,
            angle_step: (PI / 180.0) as f32,
            range_max: 8.0,
            ..LaserScan::default()
        }
    }

    fn helm() -> Helm {
        Helm {
            stack: Some(Stack::new(params().law())),
            moves: Some((Pose::default(), Twist::ZERO)),
            ..Helm::default()
        }
    }

    fn at(seconds: f64) -> Time {
        Time::ZERO + Duration::from_seconds(seconds)
    }

    #[test]
    fn over_free_floor_it_goes_to_the_goal_and_a_wall_across_makes_it_go_around() {
        let mut helm = helm();
        helm.look(&scan(), &[8.0; 181], None, at(0.0));
        let free = helm.step(&params(), at(0.0));
        assert_eq!(free.doing, Doing::Pursuing);
        assert!(free.twist.linear > 0.3 && free.twist.angular.abs() < 0.1, "{free:?}");
        assert!((free.left - 3.0).abs() < 0.2);
        // 1.2 m ahead, to the left without an end.
        let mut row = [8.0f32; 181];
        for (i, range) in row.iter_mut().enumerate() {
            let bearing = (i as f64 - 90.0).to_radians();
            if (-0.35..1.2).contains(&bearing) {
                *range = (1.2 / libm::cos(bearing)) as f32;
            }
        }
        (1..10).for_each(|_| helm.look(&scan(), &row, None, at(0.1)));
        let around = helm.step(&params(), at(0.1));
        assert!(around.left > 3.1 && around.twist.angular < 0.0, "{around:?}");
        let path = helm.path(&around);
        assert!(path.found && !path.cut && path.points.iter().any(|point| point.y < -0.5), "{path:?}");
    }

    #[test]
    fn without_a_goal_it_is_idle_without_a_scan_blind_and_with_an_old_one_too() {
        let mut helm = helm();
        assert_eq!(helm.step(&NavigatorParams::default(), at(0.0)).doing, Doing::Idle);
        assert_eq!(helm.step(&params(), at(0.0)).doing, Doing::Blind);
        helm.look(&scan(), &[8.0; 181], None, at(0.0));
        assert_eq!(helm.step(&params(), at(0.2)).doing, Doing::Pursuing);
        let old = helm.step(&params(), at(0.4));
        assert_eq!((old.doing, old.twist), (Doing::Blind, Twist::ZERO));
    }

    #[test]
    fn while_a_stop_holds_it_back_it_waits_for_a_while_and_then_tries_to_get_out() {
        // It is told to stand, and does; a scan comes ten times a second.
        let gets_out = |allowed: f64| {
            let mut helm = helm();
            (0..900).find(|tenth| {
                let now = at(f64::from(*tenth) / 10.0);
                helm.look(&scan(), &[8.0; 181], None, now);
                helm.hear(&params(), allowed, now);
                helm.step(&params(), now).doing == Doing::Escaping
            })
        };
        // Two seconds of no progress are stuck; 60 s are waited before those.
        assert!(gets_out(f64::INFINITY).is_some_and(|tenth| (20..25).contains(&tenth)));
        assert!(gets_out(0.0).is_some_and(|tenth| (620..626).contains(&tenth)), "{:?}", gets_out(0.0));
    }

    #[test]
    fn at_the_goal_it_turns_to_the_heading_that_was_asked_for_and_tells_what_is_left() {
        let mut helm = helm();
        let target = Pose::new(0.1, 0.0, 2.0);
        let task = Task { number: 1, motion: Motion::Goto, target, turned: true, ..Task::default() };
        let mut body = Pose::default();
        let report = (0..400).find_map(|step| {
            let now = at(f64::from(step) * 0.05);
            helm.look(&scan(), &[8.0; 181], None, now);
            helm.moves = Some((body, Twist::ZERO));
            helm.aim(Some(target.position()), step == 0);
            let mut state = helm.step(&params(), now);
            assert_eq!(state.doing, Doing::Arrived, "0.2 m are near enough");
            let rest = helm.rest(&params(), &task, (Some(target), Some(body)), &mut state, 0.05);
            body = body.advanced(state.twist.linear, state.twist.angular, 0.05);
            let report = told(&task, &state, rest, now.seconds());
            report.progress.is_over().then_some(report)
        });
        let report = report.unwrap();
        assert_eq!(report.progress, Progress::Arrived);
        assert!((body.heading - 2.0).abs() < 0.02 && report.angle.abs() < 0.02, "{body:?}");
        assert!((report.distance - 0.1).abs() < 1e-9, "the truth: {report:?}");
    }

    #[test]
    fn a_goal_that_is_heard_takes_the_place_of_the_other_and_can_be_taken_away() {
        let mut helm = helm();
        helm.look(&scan(), &[8.0; 181], None, at(0.0));
        helm.heard = Some(Some(Point::new(0.0, 3.0)));
        assert!(helm.step(&params(), at(0.0)).twist.angular > 0.1);
        helm.heard = Some(None);
        assert_eq!(helm.step(&params(), at(0.0)).doing, Doing::Idle);
        helm.heard = Some(Some(Point::new(0.1, 0.0)));
        assert_eq!(helm.step(&params(), at(0.0)).doing, Doing::Arrived);
    }
}
