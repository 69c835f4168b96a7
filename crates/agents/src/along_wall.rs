//! Wall following as an action: along the wall of a side, at a distance, for a time.
//!
//! The law is [`motion::wall`]: it looks at one reading and remembers nothing. Who wants to see all of an unknown place takes the
//! [`wall_follower`](crate::wall_follower), which leaves what it has circled.

use motion::wall::{self, Parameters, Side};
use runtime::{Agent, Fault, Input, Output, Step};
use types::geometry::PI;
use types::messages::{Mode, Motion, Odometry, Offer, Progress, Ranges, Report, Task, Twist};
use types::params::Params;
use types::{Duration, Pose, Time};

use crate::action::{Duty, HELD, Held, NOTHING, bounded, offer};
use crate::shared::ring;

/// How the wall is followed.
#[derive(Clone, Debug, Params)]
pub struct AlongParams {
    /// Radius of the robot (m). 0.225 is that of the exploring robot.
    #[param(default = 0.225, min = 0.01, max = 2.0)]
    pub radius: f64,
    /// Distance from the wall to the middle of the robot where the task says none (m). 0.45 are two radii: at a door of four radii that is the middle.
    #[param(default = 0.45, min = 0.05, max = 5.0)]
    pub keep: f64,
    /// Half the opening angle of one beam (rad). PI / 12 is 15°, that of a common ultrasonic transducer; 0 for a laser.
    #[param(default = PI / 12.0, min = 0.0, max = 1.6)]
    pub cone: f64,
    /// Highest speed (m/s). 0.3 is what a ring that is heard four times a second allows.
    #[param(default = 0.3, min = 0.02, max = 5.0)]
    pub speed: f64,
    /// How fast the speed grows (m/s²).
    #[param(default = 0.3, min = 0.01, max = 5.0)]
    pub growth: f64,
    /// When it wishes to drive and gets nowhere for so long, or has no ranges, it gives up (time). 8 s: people who stand in the way go on.
    #[param(default = Duration::secs(8), min = 0.5, max = 600.0)]
    pub patience: Duration,
    /// With ranges older than this it stands (time). 600 ms is two missed readings of a sonar at 4 Hz.
    #[param(default = Duration::millis(600), min = 0.02, max = 10.0)]
    pub stale: Duration,
}

impl AlongParams {
    fn law(&self, task: &Task) -> Parameters {
        let usual = Parameters::new(self.radius, self.cone);
        let keep = if task.distance > 0.0 { task.distance } else { self.keep };
        Parameters {
            side: if task.left { Side::Left } else { Side::Right },
            keep: keep.max(self.radius + usual.margin),
            reach: usual.reach.max(2.0 * keep),
            speed: bounded(self.speed, task.linear),
            growth: self.growth,
            ..usual
        }
    }
}

/// Follows the wall of its task at the distance of its task, until its time is over.
#[derive(Agent)]
#[agent(kind = "along-wall")]
pub struct AlongWall {
    /// Whether it is heard.
    mode: Input<Mode>,
    /// Which wall, how far from it, and for how long.
    task: Input<Task>,
    /// What is around.
    ranges: Input<Ranges>,
    /// Where the robot is by its wheels: without it nobody notices that it does not get on.
    odometry: Input<Odometry>,
    /// How it wishes to drive.
    drive: Output<Offer>,
    /// How far it has come.
    #[port(history = 64)]
    report: Output<Report>,
    params: AlongParams,
    duty: Duty,
    walk: Walk,
}

impl Agent for AlongWall {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        let now = step.now;
        self.duty.listen(&mut self.mode, &mut self.task);
        if let Some(ranges) = self.ranges.newest() {
            (self.walk.ranges, self.walk.heard) = (*ranges, Some(ranges.header().stamp));
        }
        let task = self.duty.task(step.name_of(step.agent).unwrap_or_default().as_str());
        let task = task.filter(|task| task.motion == Motion::Wall);
        let (is_new, dt) = (self.duty.is_new(task.as_ref(), now), self.duty.dt(now));
        if let Some(odometry) = self.odometry.latest() {
            self.walk.here = Some(odometry.pose);
        }
        if is_new {
            self.walk = Walk { speed: 0.0, held: Held::default(), stuck: 0.0, ..self.walk };
        }
        let Some(task) = task else {
            self.report.send(NOTHING);
            return Ok(());
        };
        let seconds = self.duty.seconds(now);
        let (twist, report) = self.walk.walk(&self.params, &task, seconds, now, dt);
        self.drive.send(offer(twist, now));
        self.report.send(report);
        Ok(())
    }
}

/// What was heard last, and how fast it goes.
#[derive(Clone, Copy, Debug, Default)]
struct Walk {
    ranges: Ranges,
    heard: Option<Time>,
    speed: f64,
    /// Where it is by its wheels.
    here: Option<Pose>,
    held: Held,
    /// For how long it has not got on (s).
    stuck: f64,
}

/// Who has not got on for so long at the end of the time (s) has not followed the wall to that end.
const STUCK: f64 = 1.5;

impl Walk {
    /// What is to be driven, and what becomes of the task.
    fn walk(
        &mut self,
        params: &AlongParams,
        task: &Task,
        seconds: f64,
        now: Time,
        dt: f64,
    ) -> (Twist, Report) {
        let is_over = task.seconds > 0.0 && seconds >= task.seconds;
        let twist = if is_over { Twist::ZERO } else { self.advance(params, task, now, dt) };
        let is_blind = self.is_blind(params, now);
        if let Some(here) = self.here
            && !is_over
        {
            self.stuck = self.held.see(here, is_blind || twist != Twist::ZERO, dt);
        }
        let why = if is_blind { "it hears no ranges" } else { HELD };
        let (progress, why) = match is_over {
            _ if self.stuck > params.patience.seconds() => (Progress::Unreachable, why),
            true if self.stuck > STUCK => (Progress::Unreachable, why),
            true => (Progress::Arrived, ""),
            false => (Progress::Underway, ""),
        };
        let twist = if progress.is_over() { Twist::ZERO } else { twist };
        (twist, Report { task: task.number, progress, seconds, why: why.into(), ..Report::default() })
    }

    fn is_blind(&self, params: &AlongParams, now: Time) -> bool {
        self.heard.is_none_or(|heard| now - heard > params.stale)
    }

    fn advance(&mut self, params: &AlongParams, task: &Task, now: Time, dt: f64) -> Twist {
        if self.is_blind(params, now) {
            self.speed = 0.0;
            return Twist::ZERO;
        }
        let law = params.law(task);
        let ring = ring(&self.ranges);
        let steering = wall::steer(&law, ring, wall::look(&law, ring));
        self.speed = steering.speed.min(self.speed + law.growth * dt);
        wall::drive(&law, &steering, self.speed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::blank;

    /// What a ring of 16 exact beams hears at `pose` in a room of 8 m by 6 m with its corner at the origin.
    fn heard(pose: Pose) -> Ranges {
        let mut ranges = blank(16, 0.15, 10.0);
        for i in 0..16 {
            let bearing = pose.heading + f64::from(ranges.angle_step) * f64::from(i);
            let along = |at: f64, size: f64, way: f64| match way {
                way if way > 1e-9 => (size - at) / way,
                way if way < -1e-9 => -at / way,
                _ => f64::INFINITY,
            };
            let range = along(pose.x, 8.0, bearing.cos()).min(along(pose.y, 6.0, bearing.sin()));
            ranges.values[i as usize] = range.min(10.0) as f32;
        }
        ranges
    }

    #[test]
    fn it_goes_around_a_room_at_its_distance_on_either_side() {
        let params = AlongParams { radius: 0.34, cone: 0.0, ..AlongParams::default() };
        for left in [true, false] {
            let task = Task { number: 1, motion: Motion::Wall, distance: 0.8, left, ..Task::default() };
            let (mut walk, mut body) = (Walk::default(), Pose::new(4.0, 1.5, 0.0));
            let (mut off, mut way, mut turned): (Vec<f64>, f64, f64) = (Vec::new(), 0.0, 0.0);
            for i in 0..9000 {
                let now = Time::ZERO + Duration::millis(20 * i);
                (walk.ranges, walk.heard) = (heard(body), Some(now));
                let twist = walk.advance(&params, &task, now, 0.02);
                body = body.advanced(twist.linear, twist.angular, 0.02);
                way += twist.linear * 0.02;
                turned += twist.angular * 0.02;
                // Where it is beside a wall and not in a corner.
                let mut walls = [body.x, 8.0 - body.x, body.y, 6.0 - body.y];
                walls.sort_by(f64::total_cmp);
                if i > 2000 && walls[1] > 1.8 {
                    off.push((walls[0] - 0.8).abs());
                }
                assert!(walls[0] > 0.4, "{body:?}");
            }
            let worst = off.iter().copied().fold(0.0, f64::max);
            assert!(off.len() > 2000 && worst < 0.05, "{worst} m of {}", off.len());
            // More than once around, with the wall on the left clockwise.
            assert!(way > 25.0 && (turned < -6.0) == left && turned.abs() > 6.0, "{way} m, {turned} rad");
        }
    }

    #[test]
    fn who_is_held_at_the_wall_has_not_arrived() {
        let params = AlongParams::default();
        let task = Task { number: 1, motion: Motion::Wall, seconds: 20.0, ..Task::default() };
        let ends = |task: Task, moves: bool| {
            let (mut walk, mut body) = (Walk::default(), Pose::new(4.0, 3.0, 0.0));
            (0..2000).find_map(|i| {
                let now = Time::ZERO + Duration::millis(20 * i);
                (walk.ranges, walk.heard, walk.here) = (heard(body), Some(now), Some(body));
                let (twist, report) = walk.walk(&params, &task, 0.02 * i as f64, now, 0.02);
                if moves {
                    body = body.advanced(twist.linear, twist.angular, 0.02);
                }
                report.progress.is_over().then_some(report)
            })
        };
        let free = ends(task, true).unwrap();
        assert!(free.progress == Progress::Arrived && free.why.is_empty(), "{free:?}");
        let held = ends(task, false).unwrap();
        assert!(held.progress == Progress::Unreachable && (8.0..8.1).contains(&held.seconds), "{held:?}");
        assert!(held.why.as_str().contains("latch"), "{held:?}");
        // Nor has who was held only at the end of a short time.
        assert_eq!(ends(Task { seconds: 3.0, ..task }, false).unwrap().progress, Progress::Unreachable);
    }

    #[test]
    fn without_ranges_it_stands() {
        let params = AlongParams::default();
        let task = Task { number: 1, motion: Motion::Wall, ..Task::default() };
        let mut walk = Walk::default();
        assert_eq!(walk.advance(&params, &task, Time::ZERO, 0.02), Twist::ZERO);
        (walk.ranges, walk.heard) = (heard(Pose::new(4.0, 3.0, 0.0)), Some(Time::ZERO));
        assert!(walk.advance(&params, &task, Time::ZERO, 0.02).linear > 0.0);
        let late = Time::ZERO + params.stale + Duration::nanos(1);
        assert_eq!(walk.advance(&params, &task, late, 0.02), Twist::ZERO);
    }
}
