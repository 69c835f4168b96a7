//! Escape: notices that the robot does not come on towards its goal, gets it out with a few tries, and tells when they are of no use.
//!
//! It stands above the actions that lead the robot to its goal, and wishes nothing while they get on. The states of an escape are in
//! [`navigation::avoid::escape`]; between turning and watching it drives ahead as far as that is free, so that the others see the place from elsewhere.

use motion::stopping::way_to;
use navigation::avoid::escape::{self, Escape, Phase, Room};
use runtime::{Agent, Fault, Input, Output, Step};
use types::geometry::{PI, wrap};
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
    /// It is stuck when it has a goal and comes no farther than `distance` in so long (time), however it turns. 8 s are more than it stands and turns anywhere on its way.
    #[param(default = Duration::secs(8), min = 0.5, max = 600.0)]
    pub patience: Duration,
    /// See `patience` (m).
    #[param(default = 0.25, min = 0.01, max = 5.0)]
    pub distance: f64,
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
    /// How far it drives ahead once it has turned, where that is free (m). A metre is past the end of what it stood before.
    #[param(default = 1.0, min = 0.0, max = 5.0)]
    pub ahead: f64,
    /// How fast it drives ahead (m/s).
    #[param(default = 0.2, min = 0.01, max = 2.0)]
    pub ahead_speed: f64,
    /// Room that it leaves behind it, and ahead (m). 0.2: a sonar tells 0.15 m of all that is nearer, and is a few centimetres wrong.
    #[param(default = 0.2, min = 0.0, max = 2.0)]
    pub margin: f64,
    /// Half the opening angle of one beam (rad). PI / 12 is 15°, that of a common ultrasonic transducer; 0 for a laser.
    #[param(default = PI / 12.0, min = 0.0, max = 1.6)]
    pub cone: f64,
    /// Ranges older than this tell nothing of what is behind (time). 600 ms is two missed readings of a sonar at 4 Hz.
    #[param(default = Duration::millis(600), min = 0.02, max = 10.0)]
    pub stale: Duration,
}

impl EscapeParams {
    fn parameters(&self) -> escape::Parameters {
        escape::Parameters {
            patience: self.patience.seconds(),
            distance: self.distance,
            // One that turns to and fro before what is in its way comes on no more than one that stands.
            turned: f64::INFINITY,
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
    out: Option<Out>,
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
            self.out = Some(Out { escape: Escape::new(self.params.parameters()), ahead: None });
        }
        let (Some(task), Some(out), Some(here)) = (task, &mut self.out, self.place.odometry) else {
            self.report.send(NOTHING);
            return Ok(());
        };
        let far = self.place.goal(&task).map(|goal| goal.distance(here.pose.position()));
        let is_on_its_way = far.is_some_and(|far| far > self.params.near);
        let seen = self.around.fresh(&self.params, now);
        if let Some(twist) = out.advance(&self.params, here.pose, is_on_its_way, seen, now) {
            self.drive.send(offer(twist, now));
        }
        let over = Report {
            task: task.number,
            progress: Progress::Unreachable,
            distance: far.unwrap_or(0.0),
            angle: 0.0,
            seconds: self.duty.seconds(now),
            why: "it does not come on, and no try to get out has helped".into(),
        };
        self.report.send(if out.escape.phase() == Phase::GivenUp { over } else { NOTHING });
        Ok(())
    }
}

/// The way out.
#[derive(Clone, Copy, Debug)]
struct Out {
    escape: Escape,
    /// While it drives ahead: from where, and since when.
    ahead: Option<(Pose, Time)>,
}

impl Out {
    /// The motion to get out, while there is something to get out of.
    fn advance(
        &mut self,
        params: &EscapeParams,
        here: Pose,
        is_on_its_way: bool,
        seen: Around,
        now: Time,
    ) -> Option<Twist> {
        let (tries, before) = (self.escape.tries(), self.escape.phase());
        let is_ahead = self.ahead.is_some();
        let twist =
            self.escape.step((now - Time::ZERO).seconds(), here, is_on_its_way && !is_ahead, seen.room);
        if self.escape.tries() > tries {
            runtime::note!("it does not come on to its goal: try to get out number {}", self.escape.tries());
        }
        if before == Phase::Turning && self.escape.phase() == Phase::Watching {
            self.ahead = Some((here, now));
        }
        if twist.is_some() {
            return twist;
        }
        let (from, since) = self.ahead?;
        let left = (params.ahead - from.position().distance(here.position())).min(seen.ahead - params.margin);
        // Twice the time that it takes is more than enough.
        if left <= 0.0 || (now - since).seconds() > 2.0 * params.ahead / params.ahead_speed {
            self.ahead = None;
            return None;
        }
        Some(Twist::new(params.ahead_speed.min(CREEP + left), 0.0))
    }
}

/// So fast it is at the end of its way ahead (m/s); so fast it also slows on the last metre (1/s).
const CREEP: f64 = 0.05;

/// What was heard around the robot.
#[derive(Clone, Copy, Debug, Default)]
struct Around {
    room: Room,
    /// Free way ahead (m).
    ahead: f64,
    heard: Option<Time>,
}

impl Around {
    fn of(params: &EscapeParams, ranges: &Ranges, stamp: Time) -> Around {
        let farthest = f64::from(ranges.range_max);
        let mut around =
            Around { room: Room { behind: farthest, wider: 0.0 }, ahead: farthest, heard: Some(stamp) };
        for (bearing, range) in echoes(ranges) {
            // What is heard may be anywhere in the beam: where it is most in the way counts.
            let way = |sign: f64, straight: f64| {
                let at = bearing + wrap(straight - bearing).clamp(-params.cone, params.cone);
                way_to(params.radius, Twist::new(sign, 0.0), range * libm::cos(at), range * libm::sin(at))
            };
            around.room.behind = around.room.behind.min(way(-1.0, PI));
            around.ahead = around.ahead.min(way(1.0, 0.0));
            // What is near on one side pushes to the other.
            around.room.wider -= libm::sin(bearing) / range.max(0.1);
        }
        around
    }

    /// The same, without any room where it was heard too long ago.
    fn fresh(&self, params: &EscapeParams, now: Time) -> Around {
        match self.heard {
            Some(heard) if now - heard <= params.stale => *self,
            _ => Around { room: Room { behind: 0.0, ..self.room }, ahead: 0.0, ..*self },
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
        (ranges.values[8], ranges.values[0]) = (1.0, 1.5);
        let seen = Around::of(&params, &ranges, at(0)).fresh(&params, at(100));
        assert!((seen.room.behind - 0.7).abs() < 1e-6 && (seen.ahead - 1.2).abs() < 1e-6, "{seen:?}");
        let old = Around::of(&params, &ranges, at(0)).fresh(&params, at(700));
        assert_eq!((old.room.behind, old.ahead), (0.0, 0.0), "too old");
        assert_eq!(Around::default().fresh(&params, at(0)).room.behind, 0.0, "never heard");
        // In the middle of its beam it would be 0.38 m beside the way back; at the edge of the beam it is in the way.
        ranges.values.fill(5.0);
        ranges.values[7] = 1.0;
        let behind =
            |cone: f64| Around::of(&EscapeParams { cone, ..params.clone() }, &ranges, at(0)).room.behind;
        let off = types::geometry::PI * (22.5 - 15.0) / 180.0;
        let expected = off.cos() - (0.09 - off.sin() * off.sin()).sqrt();
        assert!(
            (behind(params.cone) - expected).abs() < 1e-6 && behind(0.0) == 5.0,
            "{}",
            behind(params.cone)
        );
        // A wall on the left, and so the wider side is the right.
        (ranges.values[4], ranges.values[7]) = (0.5, 5.0);
        let room = Around::of(&params, &ranges, at(0)).room;
        assert!(room.wider < -1.0 && room.behind == 5.0, "{room:?}");
    }

    fn out() -> Out {
        Out { escape: Escape::new(EscapeParams::default().parameters()), ahead: None }
    }

    #[test]
    fn a_robot_that_is_held_is_given_up_after_its_tries_and_one_at_its_goal_is_not_stuck() {
        let params = EscapeParams::default();
        let given_up = |is_on_its_way: bool| {
            let mut out = out();
            let told = |i: i64| {
                out.advance(&params, Pose::default(), is_on_its_way, Around::default(), at(20 * i));
                out.escape.phase() == Phase::GivenUp
            };
            (0..6000).position(told).map(|i| 0.02 * i as f64)
        };
        // Four tries of 8 s of patience and 3 s of turning in vain, and the patience with the last.
        let after = given_up(true).unwrap();
        assert!((51.5..53.0).contains(&after), "{after}");
        assert_eq!(given_up(false), None);
    }

    #[test]
    fn it_backs_off_turns_and_drives_ahead_before_it_lets_the_others_drive() {
        let params = EscapeParams::default();
        let (mut out, mut body) = (out(), Pose::default());
        let free = Around { room: Room { behind: 3.0, wider: 1.0 }, ahead: 3.0, heard: None };
        let mut done: Vec<(i64, i64)> = Vec::new();
        for i in 0..1200 {
            let twist = out.advance(&params, body, true, free, at(20 * i)).unwrap_or(Twist::ZERO);
            let sign = |x: f64| if x == 0.0 { 0 } else { x.signum() as i64 };
            let now = (sign(twist.linear), sign(twist.angular));
            if done.last() != Some(&now) {
                done.push(now);
            }
            body = body.advanced(twist.linear, twist.angular, 0.02);
            if done.len() == 5 {
                break;
            }
        }
        assert_eq!(done, [(0, 0), (-1, 0), (0, 1), (1, 0), (0, 0)]);
        // 0.3 m back, 0.7 rad to the left, a metre ahead.
        let expected = (-0.3 + 0.7f64.cos(), 0.7f64.sin());
        assert!((body.x - expected.0).abs() < 0.05 && (body.y - expected.1).abs() < 0.05, "{body:?}");
    }
}
