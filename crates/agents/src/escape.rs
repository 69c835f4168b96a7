//! Escape: notices that the robot does not come on towards its goal, gets it out with a few tries, and tells when they are of no use.
//!
//! It stands above the actions that lead the robot to its goal, and wishes nothing while they get on. The states of an escape are in
//! [`navigation::avoid::escape`].

use motion::stopping::way_to;
use navigation::avoid::escape::{self, Escape, Phase, Room};
use runtime::{Agent, Fault, Input, Output, Step};
use types::messages::{Mode, Motion, Odometry, Offer, Progress, Ranges, Report, Task, Twist};
use types::params::Params;
use types::{Duration, Pose, Time};

use crate::action::{Duty, NOTHING, Whereabouts, offer};
use crate::shared::echoes;

/// When the robot is stuck, and how it gets out.
#[derive(Clone, Debug, Params)]
pub struct EscapeParams {
    /// Radius of the robot (m). 0.225 is that of the exploring robot.
    #[param(default = 0.225, min = 0.01, max = 2.0)]
    pub radius: f64,
    /// It is stuck when it has a goal and comes no farther than `distance` in so long (time), and turns by no more than `turned`. 4 s are more than it stands anywhere on its way.
    #[param(default = Duration::secs(4), min = 0.5, max = 600.0)]
    pub patience: Duration,
    /// See `patience` (m).
    #[param(default = 0.1, min = 0.01, max = 5.0)]
    pub distance: f64,
    /// See `patience` (rad). 20°.
    #[param(default = 0.35, min = 0.01, max = 3.0)]
    pub turned: f64,
    /// Nearer to its goal than this it may stand as long as it likes (m): it turns to its heading there.
    #[param(default = 0.5, min = 0.0, max = 10.0)]
    pub near: f64,
    /// How often it tries to get out. Four look to both sides twice.
    #[param(default = 4u32, max = 100)]
    pub tries: u32,
    /// How far it backs off (m).
    #[param(default = 0.3, min = 0.0, max = 5.0)]
    pub back: f64,
    /// How fast it backs off (m/s).
    #[param(default = 0.15, min = 0.01, max = 2.0)]
    pub back_speed: f64,
    /// Room that it leaves behind it (m). 8 cm are four times the error of a sonar nearby.
    #[param(default = 0.08, min = 0.0, max = 2.0)]
    pub margin: f64,
    /// Ranges older than this tell nothing of what is behind (time). 600 ms is two missed readings of a sonar at 4 Hz.
    #[param(default = Duration::millis(600), min = 0.02, max = 10.0)]
    pub stale: Duration,
}

impl EscapeParams {
    fn parameters(&self) -> escape::Parameters {
        escape::Parameters {
            patience: self.patience.seconds(),
            distance: self.distance,
            turned: self.turned,
            tries: self.tries,
            back: self.back,
            back_speed: self.back_speed,
            margin: self.margin,
            ..escape::Parameters::default()
        }
    }
}

/// Backs the robot off and turns it where it does not come on to its goal, and gives its task up when that does not help.
#[derive(Agent)]
#[agent(kind = "escape")]
pub struct EscapeAction {
    /// Whether it is heard.
    mode: Input<Mode>,
    /// Where to.
    task: Input<Task>,
    /// Where the robot is by its wheels.
    odometry: Input<Odometry>,
    /// Where it is on the map, from the localizer: for goals that are there.
    pose: Input<Odometry>,
    /// What is around, behind it as well: without it, it does not back off.
    ranges: Input<Ranges>,
    /// How it wishes to drive while it gets out.
    drive: Output<Offer>,
    /// That it is there, or that there is no way out.
    #[port(history = 64)]
    report: Output<Report>,
    params: EscapeParams,
    duty: Duty,
    place: Whereabouts,
    around: Around,
    escape: Option<Escape>,
}

impl Agent for EscapeAction {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        let now = step.now;
        self.duty.listen(&mut self.mode, &mut self.task);
        self.place.listen(&mut self.odometry, &mut self.pose, now);
        if let Some(ranges) = self.ranges.newest() {
            self.around = Around::of(&self.params, &ranges, ranges.header().stamp);
        }
        let task = self.duty.task(step.name_of(step.agent).unwrap_or_default().as_str());
        let task = task.filter(|task| matches!(task.motion, Motion::Goto | Motion::Path));
        if self.duty.is_new(task.as_ref(), now) {
            self.escape = Some(Escape::new(self.params.parameters()));
        }
        let (Some(task), Some(escape), Some(here)) = (task, &mut self.escape, self.place.odometry) else {
            self.report.send(NOTHING);
            return Ok(());
        };
        let far = self.place.goal(&task).map(|goal| goal.distance(here.pose.position()));
        let is_on_its_way = far.is_some_and(|far| far > self.params.near);
        let room = self.around.room(&self.params, now);
        let (twist, is_over) = advance(escape, here.pose, is_on_its_way, room, now);
        if let Some(twist) = twist {
            self.drive.send(offer(twist, now));
        }
        let over = Report {
            task: task.number,
            progress: Progress::Unreachable,
            distance: far.unwrap_or(0.0),
            angle: 0.0,
            seconds: self.duty.seconds(now),
        };
        self.report.send(if is_over { over } else { NOTHING });
        Ok(())
    }
}

/// The motion to get out, while there is something to get out of, and whether that is of no use.
fn advance(
    escape: &mut Escape,
    here: Pose,
    is_on_its_way: bool,
    room: Room,
    now: Time,
) -> (Option<Twist>, bool) {
    let tries = escape.tries();
    let twist = escape.step((now - Time::ZERO).seconds(), here, is_on_its_way, room);
    if escape.tries() > tries {
        runtime::note!("it does not come on to its goal: try to get out number {}", escape.tries());
    }
    (twist, escape.phase() == Phase::GivenUp)
}

/// What was heard around the robot.
#[derive(Clone, Copy, Debug, Default)]
struct Around {
    room: Room,
    heard: Option<Time>,
}

impl Around {
    fn of(params: &EscapeParams, ranges: &Ranges, stamp: Time) -> Around {
        let back = Twist::new(-1.0, 0.0);
        let mut room = Room { behind: f64::from(ranges.range_max), wider: 0.0 };
        for (bearing, range) in echoes(ranges) {
            let (x, y) = (range * libm::cos(bearing), range * libm::sin(bearing));
            room.behind = room.behind.min(way_to(params.radius, back, x, y));
            // What is near on one side pushes to the other.
            room.wider -= libm::sin(bearing) / range.max(0.1);
        }
        Around { room, heard: Some(stamp) }
    }

    fn room(&self, params: &EscapeParams, now: Time) -> Room {
        match self.heard {
            Some(heard) if now - heard <= params.stale => self.room,
            _ => Room { behind: 0.0, ..self.room },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::blank;

    fn at(millis: i64) -> Time {
        Time::ZERO + Duration::millis(millis)
    }

    #[test]
    fn what_is_behind_is_as_near_as_straight_back_it_would_be_touched() {
        let params = EscapeParams { radius: 0.3, ..EscapeParams::default() };
        let mut ranges = blank(16, 0.15, 5.0);
        ranges.values.fill(5.0);
        ranges.values[8] = 1.0;
        let room = Around::of(&params, &ranges, at(0)).room(&params, at(100));
        assert!((room.behind - 0.7).abs() < 1e-6, "{room:?}");
        assert_eq!(Around::of(&params, &ranges, at(0)).room(&params, at(700)).behind, 0.0, "too old");
        assert_eq!(Around::default().room(&params, at(0)).behind, 0.0, "never heard");
        // A wall on the left, and so the wider side is the right.
        (ranges.values[4], ranges.values[8]) = (0.5, 5.0);
        let room = Around::of(&params, &ranges, at(0)).room(&params, at(0));
        assert!(room.wider < -1.0 && room.behind == 5.0, "{room:?}");
    }

    #[test]
    fn a_robot_that_is_held_is_given_up_after_its_tries_and_one_at_its_goal_is_not_stuck() {
        let params = EscapeParams::default();
        let shut = Room { behind: 0.0, wider: 0.0 };
        let given_up = |is_on_its_way: bool| {
            let mut escape = Escape::new(params.parameters());
            let told = |i: i64| advance(&mut escape, Pose::default(), is_on_its_way, shut, at(20 * i)).1;
            (0..6000).map(told).position(|is_over| is_over).map(|i| 0.02 * i as f64)
        };
        // Four tries of 4 s of patience and 3 s of turning in vain, and the patience with the last.
        let after = given_up(true).unwrap();
        assert!((31.5..33.5).contains(&after), "{after}");
        assert_eq!(given_up(false), None);
    }
}
