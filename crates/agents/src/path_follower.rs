//! The path follower: along a planned path, by regulated pure pursuit.

use motion::track::{self, Mode as Following, Track};
use runtime::{Agent, Fault, Input, Output, Step};
use types::messages::{
    Mode, Motion, Odometry, Offer, Path, Progress, Report, Safety, Task, Twist, WAYPOINTS,
};
use types::params::Params;
use types::{Duration, Name, Point, Pose, Sequence};

use crate::action::{
    Aligning, Duty, HELD, Held, NO_POSE, NOTHING, TOO_LONG, Whereabouts, bounded, limits, offer, turn_left,
};
use crate::odometry::ODOM;
use crate::shared::Dated;

/// How to follow.
#[derive(Clone, Debug, Params)]
pub struct FollowerParams {
    /// Highest speed (m/s), on a path without speeds the one where nothing asks for less. 0.4 is a slow walk.
    #[param(default = 0.4, min = 0.02, max = 10.0)]
    pub speed: f64,
    /// Highest turn rate (rad/s).
    #[param(default = 1.0, min = 0.05, max = 20.0)]
    pub angular_max: f64,
    /// Highest change of speed (m/s²).
    #[param(default = 0.5, min = 0.01, max = 20.0)]
    pub acceleration: f64,
    /// Highest change of the turn rate (rad/s²).
    #[param(default = 3.0, min = 0.01, max = 100.0)]
    pub angular_acceleration: f64,
    /// How far ahead it looks (s). 1.5 s at 0.4 m/s is 0.6 m, a body's length.
    #[param(default = 1.5, min = 0.1, max = 10.0)]
    pub lookahead: f64,
    /// It looks ahead at least so far (m): less, and it swings.
    #[param(default = 0.3, min = 0.05, max = 5.0)]
    pub lookahead_least: f64,
    /// It looks ahead at most so far (m): more, and it cuts doors.
    #[param(default = 0.9, min = 0.1, max = 10.0)]
    pub lookahead_most: f64,
    /// On a path without speeds it slows in curves of a smaller radius than this (m).
    #[param(default = 0.9, min = 0.0, max = 10.0)]
    pub curve_radius: f64,
    /// What is nearer to the rim than this slows it (m).
    #[param(default = 0.5, min = 0.0, max = 5.0)]
    pub proximity: f64,
    /// Within this of the end of the path it is there (m). 5 mm leave the other half of a centimetre to the localizer.
    #[param(default = 0.005, min = 0.002, max = 2.0)]
    pub near: f64,
    /// The end of the path counts as the goal within this of it (m): a goal that stands in something is neared only so far, and that is told as unreachable.
    #[param(default = 0.15, min = 0.01, max = 5.0)]
    pub goal_near: f64,
    /// When it wishes to drive and gets nowhere for so long, it cannot get there (time). 8 s: people who stand in the way go on.
    #[param(default = Duration::secs(8), min = 0.5, max = 600.0)]
    pub patience: Duration,
}

impl FollowerParams {
    fn parameters(&self, task: &Task) -> track::Parameters {
        let speed = bounded(self.speed, task.linear);
        let angular_max = bounded(self.angular_max, task.angular);
        let limits = limits(speed, angular_max, self.acceleration, self.angular_acceleration);
        track::Parameters {
            speed,
            lookahead: self.lookahead,
            lookahead_within: (self.lookahead_least, self.lookahead_most.max(self.lookahead_least)),
            radius: self.curve_radius,
            proximity: self.proximity,
            near: self.near,
            ..track::Parameters::new(limits)
        }
    }
}

/// Follows the newest path of the planner while its task is to go along one, and tells when it is at the goal.
#[derive(Agent)]
#[agent(kind = "path-follower")]
pub struct PathFollower {
    /// Whether it is heard.
    mode: Input<Mode>,
    /// Where to.
    task: Input<Task>,
    /// The way there.
    path: Input<Path>,
    /// Where the robot is by its wheels.
    odometry: Input<Odometry>,
    /// Where it is on the map, from the localizer; for paths on the map.
    pose: Input<Odometry>,
    /// How near is what is nearest.
    safety: Input<Safety>,
    /// How it wishes to drive.
    drive: Output<Offer>,
    /// How far it has come.
    #[port(history = 64)]
    report: Output<Report>,
    params: FollowerParams,
    duty: Duty,
    way: Way,
}

impl Agent for PathFollower {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        let now = step.now;
        self.duty.listen(&mut self.mode, &mut self.task);
        self.way.place.listen(&mut self.odometry, &mut self.pose, now);
        if let Some(safety) = self.safety.latest() {
            self.way.clearance = Some(Dated { value: safety.nearest, stamp: now });
        }
        let task = self.duty.task(step.name_of(step.agent).unwrap_or_default().as_str());
        let task = task.filter(|task| task.motion == Motion::Path);
        let (is_new, dt) = (self.duty.is_new(task.as_ref(), now), self.duty.dt(now));
        if is_new {
            // A path to another goal leads elsewhere.
            self.way.last_left = Default::default();
            (self.way.course, self.way.held, self.way.aligning) = Default::default();
        }
        while let Some(path) = self.path.take() {
            if task.is_some() {
                self.way.change(&self.params, &path, task.as_ref());
            }
        }
        let Some(task) = task else {
            self.report.send(NOTHING);
            return Ok(());
        };
        let (twist, report) = self.way.advance(&self.params, &task, self.duty.seconds(now), dt);
        self.drive.send(offer(twist, now));
        self.report.send(report);
        Ok(())
    }
}

/// A path, in the form that the law takes.
#[derive(Clone, Copy, Debug)]
struct Course {
    track: Track,
    frame: Name,
    /// Whether it ends before the goal.
    cut: bool,
    points: Sequence<Point, WAYPOINTS>,
    /// Those at the points (m/s); none where the path has none.
    speeds: Sequence<f64, WAYPOINTS>,
}

/// The path, and how far the robot is on it.
#[derive(Clone, Copy, Debug, Default)]
struct Way {
    place: Whereabouts,
    clearance: Option<Dated<f64>>,
    course: Option<Course>,
    last: Twist,
    /// What was left of the way (m) and of the turn (rad).
    last_left: (f64, f64),
    held: Held,
    aligning: Aligning,
}

impl Way {
    fn change(&mut self, params: &FollowerParams, path: &Path, task: Option<&Task>) {
        let Some(task) = task else { return };
        if !path.found {
            self.course = None;
            return;
        }
        let is_timed = path.seconds > 0.0;
        self.course = Some(Course {
            track: Track::new(params.parameters(task), self.last),
            frame: path.frame,
            cut: path.cut,
            points: path.points.iter().map(|point| Point::from(*point)).collect(),
            speeds: path.points.iter().filter(|_| is_timed).map(|point| point.speed).collect(),
        });
    }

    /// Where the robot is, in the frame of the path.
    fn here(&self, course: &Course) -> Option<Pose> {
        let odometry = self.place.odometry?.pose;
        if course.frame.as_str() == ODOM {
            Some(odometry)
        } else {
            Some(self.place.map_from_odometry?.then(odometry))
        }
    }

    /// Where a task leads, in the frame of the path.
    fn target(&self, course: &Course, task: &Task) -> Pose {
        if course.frame == task.frame || task.frame.is_empty() {
            return task.target;
        }
        self.place.map_from_odometry.map_or(task.target, |map| map.inverse().then(task.target))
    }

    fn advance(&mut self, params: &FollowerParams, task: &Task, seconds: f64, dt: f64) -> (Twist, Report) {
        let report = Report { task: task.number, progress: Progress::Underway, seconds, ..Report::default() };
        if task.seconds > 0.0 && seconds > task.seconds {
            self.last = Twist::ZERO;
            let (distance, angle) = self.last_left;
            let report = Report { progress: Progress::TimedOut, distance, angle, ..report };
            let why = if self.course.is_some() { TOO_LONG } else { "the planner has found no way in time" };
            return (Twist::ZERO, Report { why: why.into(), ..report });
        }
        let clearance = self.clearance.map_or(f64::INFINITY, |near| near.value.max(0.0));
        let Some(mut course) = self.course else {
            self.last = Twist::ZERO;
            return (Twist::ZERO, report);
        };
        let Some(here) = self.here(&course) else {
            self.last = Twist::ZERO;
            return (Twist::ZERO, Report { progress: Progress::Lost, why: NO_POSE.into(), ..report });
        };
        let gone = course.track.step(&course.points, &course.speeds, here, clearance, dt);
        self.course = Some(course);
        let odometry = self.place.odometry.map_or(here, |odometry| odometry.pose);
        let is_held = self.held.see(odometry, self.last != Twist::ZERO, dt) > params.patience.seconds();
        let target = self.target(&course, task);
        let (left, turn) = (here.position().distance(target.position()), turn_left(task, target, here));
        self.last_left = (left, turn);
        self.last = gone.twist;
        let is_there = gone.mode == Following::Arrived && !course.cut && left <= params.goal_near;
        let limits = (bounded(params.angular_max, task.angular), params.angular_acceleration);
        let turning = if is_there && task.turned { self.aligning.step(turn, limits, dt) } else { None };
        if let Some(rate) = turning {
            self.last = Twist::new(0.0, rate);
        }
        let (progress, why) = match gone.mode {
            // A path that was cut goes on with the next.
            Following::Arrived if course.cut => (Progress::Underway, ""),
            Following::Arrived if !is_there => (Progress::Unreachable, "the path ends before the goal"),
            Following::Arrived if turning.is_none() => (Progress::Arrived, ""),
            _ if is_held => (Progress::Unreachable, HELD),
            _ => (Progress::Underway, ""),
        };
        (self.last, Report { progress, distance: left, angle: turn, why: why.into(), ..report })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(points: &[(f64, f64)]) -> Path {
        let points = points.iter().map(|(x, y)| Point::new(*x, *y).into()).collect();
        Path { frame: ODOM.into(), found: true, points, quality: 1.0, ..Path::default() }
    }

    fn to(x: f64, y: f64) -> Task {
        let target = Pose::new(x, y, 0.0);
        Task { number: 1, motion: Motion::Path, frame: ODOM.into(), target, ..Task::default() }
    }

    fn driven(way: &mut Way, task: &Task) -> (Pose, Report) {
        let (params, mut body, mut last) = (FollowerParams::default(), Pose::default(), Report::default());
        for i in 0..5000 {
            way.place.odometry = Some(Odometry { pose: body, ..Odometry::default() });
            let (twist, report) = way.advance(&params, task, 0.02 * f64::from(i), 0.02);
            last = report;
            if report.progress.is_over() {
                break;
            }
            body = body.advanced(twist.linear, twist.angular, 0.02);
        }
        (body, last)
    }

    #[test]
    fn it_follows_a_path_to_its_end() {
        let (params, task) = (FollowerParams::default(), to(2.0, 2.0));
        let mut way = Way::default();
        way.change(&params, &path(&[(0.0, 0.0), (2.0, 0.0), (2.0, 2.0)]), Some(&task));
        let (end, report) = driven(&mut way, &task);
        assert_eq!(report.progress, Progress::Arrived);
        assert!(end.position().distance(Point::new(2.0, 2.0)) < 0.05, "{end:?}");
    }

    #[test]
    fn a_path_that_ends_elsewhere_does_not_reach_the_goal_and_one_that_is_cut_goes_on() {
        let (params, task) = (FollowerParams::default(), to(2.0, 0.0));
        let mut way = Way::default();
        way.change(&params, &path(&[(0.0, 0.0), (1.0, 0.0)]), Some(&task));
        assert_eq!(driven(&mut way, &task).1.progress, Progress::Unreachable);
        let mut way = Way::default();
        way.change(&params, &Path { cut: true, ..path(&[(0.0, 0.0), (1.0, 0.0)]) }, Some(&task));
        assert_eq!(driven(&mut way, &task).1.progress, Progress::Underway);
    }

    #[test]
    fn what_is_held_for_too_long_does_not_get_there() {
        let (params, task) = (FollowerParams::default(), to(2.0, 0.0));
        let mut way = Way::default();
        way.change(&params, &path(&[(0.0, 0.0), (2.0, 0.0)]), Some(&task));
        way.place.odometry = Some(Odometry::default());
        let held = |i: i32| way.advance(&params, &task, 0.02 * f64::from(i), 0.02).1.progress;
        let told: Vec<Progress> = (0..410).map(held).collect();
        let first = told.iter().position(|progress| *progress == Progress::Unreachable);
        assert!(first.is_some_and(|first| (395..=405).contains(&first)), "{first:?}");
    }

    #[test]
    fn without_a_path_it_stands_and_waits_until_its_time_is_over() {
        let (params, task) = (FollowerParams::default(), Task { seconds: 3.0, ..to(2.0, 0.0) });
        let mut way = Way::default();
        way.change(&params, &Path { found: false, ..path(&[]) }, Some(&task));
        way.place.odometry = Some(Odometry::default());
        let (twist, report) = way.advance(&params, &task, 2.9, 0.02);
        assert_eq!((twist, report.progress), (Twist::ZERO, Progress::Underway));
        assert_eq!(way.advance(&params, &task, 3.1, 0.02).1.progress, Progress::TimedOut);
    }
}
