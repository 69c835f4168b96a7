//! The avoidance: towards a goal past what is near, by what is seen at this moment, with the situation that says why.
//!
//! As an action beside others it wishes to drive only while something is in the way or near: who stands below it then drives to the goal.

use motion::ring::Ring;
use navigation::avoid::nearness::{self, NearnessDiagram};
use navigation::avoid::smooth::{self, SmoothNearness};
use navigation::avoid::{Body, Sectors};
use runtime::{Agent, Fault, Input, Output, Step};
use types::geometry::PI;
use types::messages::{
    Avoidance, Drive, LaserScan, Mode, Motion, Odometry, Offer, Path as Way, Ranges, Report, Situation, Task,
};
use types::params::Params;
use types::{Duration, Point, Pose, Text, Time};

use crate::action::{Duty, NOTHING, Whereabouts, offer};
use crate::shared::echoes;

/// How it avoids.
#[derive(Clone, Debug, Params)]
pub struct AvoidParams {
    /// The law: "nearness" for the Nearness Diagram with its situations, "smooth" for the one without.
    #[param(default = "nearness")]
    pub law: Text<8>,
    /// Where to, ahead of where the odometry began (m); a goal that is heard takes its place.
    #[param(default = 0.0, min = -1000.0, max = 1000.0)]
    pub goal_x: f64,
    /// Where to, to the left of where the odometry began (m).
    #[param(default = 0.0, min = -1000.0, max = 1000.0)]
    pub goal_y: f64,
    /// Whether the two above are a goal. Without one it wishes nothing until it hears of one.
    #[param(default = false)]
    pub has_goal: bool,
    /// Length of a rectangular body (m); 0 for a round one.
    #[param(default = 0.0, min = 0.0, max = 5.0)]
    pub length: f64,
    /// Width of the body (m): of a round one its diameter. 0.45 is that of the exploring robot.
    #[param(default = 0.45, min = 0.02, max = 5.0)]
    pub width: f64,
    /// Distance from the edge below which things push it away (m). 0.5 is that of the robots on which the law was published.
    #[param(default = 0.5, min = 0.05, max = 5.0)]
    pub security: f64,
    /// Highest speed (m/s). 0.3 is that of the robots on which the law was published.
    #[param(default = 0.3, min = 0.01, max = 5.0)]
    pub linear_max: f64,
    /// Highest turn rate (rad/s). PI / 4 is that of the robots on which the law was published.
    #[param(default = PI / 4.0, min = 0.05, max = 10.0)]
    pub angular_max: f64,
    /// How much speed is left near things, by the Nearness Diagram. 1 is the published law.
    #[param(default = 1.0, min = 0.0, max = 10.0)]
    pub gain: f64,
    /// Half the opening angle of the beams of the ranges (rad). PI / 12 is 15°, that of a common ultrasonic transducer; 0 for a laser.
    #[param(default = PI / 12.0, min = 0.0, max = 1.6)]
    pub cone: f64,
    /// Nearer to the goal than this it has arrived (m).
    #[param(default = 0.5, min = 0.02, max = 5.0)]
    pub goal_tolerance: f64,
    /// Of a wired sensor that has told nothing for so long all may be an obstacle: it stands (time). 600 ms is two missed readings of a sonar at 4 Hz.
    #[param(default = Duration::millis(600), min = 0.02, max = 10.0)]
    pub stale: Duration,
    /// How much its wish matters to it, from 0 to 1.
    #[param(default = 1.0, min = 0.0, max = 1.0)]
    pub weight: f64,
    /// How long a wish of it holds (time). 600 ms is two missed readings of a sonar at 4 Hz.
    #[param(default = Duration::millis(600), min = 0.01, max = 10.0)]
    pub hold: Duration,
}

impl AvoidParams {
    fn body(&self) -> Body {
        let half_width = self.width / 2.0;
        match self.length > 0.0 {
            true => Body::Rectangle { front: self.length / 2.0, rear: self.length / 2.0, half_width },
            false => Body::Round { radius: half_width },
        }
    }

    fn law(&self) -> Law {
        if self.law.as_str() == "smooth" {
            Law::Smooth(Box::new(SmoothNearness::new(smooth::Parameters {
                security: self.security,
                linear_max: self.linear_max,
                angular_max: self.angular_max,
                goal_tolerance: self.goal_tolerance,
                ..smooth::Parameters::new(self.body())
            })))
        } else {
            Law::Nearness(Box::new(NearnessDiagram::new(nearness::Parameters {
                security_front: self.security,
                security_rear: self.security,
                linear_max: self.linear_max,
                angular_max: self.angular_max,
                gain: self.gain,
                goal_tolerance: self.goal_tolerance,
                ..nearness::Parameters::new(self.body())
            })))
        }
    }
}

/// Goes towards a goal past what is near, by the Nearness Diagram, and tells the situation in which it sees itself.
#[derive(Agent)]
pub struct Avoid {
    /// What a laser sees.
    #[robot("scan")]
    scan: Input<LaserScan>,
    /// What a ring of sonars hears, or whatever else tells distances around the robot.
    ranges: Input<Ranges>,
    /// Where the robot believes to be.
    odometry: Input<Odometry>,
    /// Where to: the end of the way, in the frame of the odometry. One without points takes the goal away.
    goal: Input<Way>,
    /// Whether it is heard. Where it is not wired, it is.
    mode: Input<Mode>,
    /// Where to: it avoids while the task is to go to a place.
    task: Input<Task>,
    /// Where the robot is on the map, from the localizer: for tasks whose goal is there.
    pose: Input<Odometry>,
    /// A wish to drive.
    drive: Output<Offer>,
    /// That it is there.
    report: Output<Report>,
    /// The situation, and the numbers that say why.
    #[port(history = 64)]
    situation: Output<Avoidance>,
    params: AvoidParams,
    duty: Duty,
    place: Whereabouts,
    sight: Sight,
}

impl Agent for Avoid {
    fn start(&mut self, _: &mut Step) -> Result<(), Fault> {
        match self.params.law.as_str() {
            "nearness" | "smooth" => {}
            _ => return Err(Fault::new("\"law\" of an avoidance is \"nearness\" or \"smooth\"")),
        }
        self.sight.law.get_or_insert_with(|| self.params.law());
        Ok(())
    }

    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        if let Some(goal) = self.goal.newest() {
            self.sight.heard = Some(goal.points.last().map(|end| Point::from(*end)));
        }
        self.place.listen(&mut self.odometry, &mut self.pose, step.now);
        if let Some(odometry) = self.place.odometry {
            self.sight.pose = odometry.pose;
        }
        let is_action = self.task.is_wired();
        if is_action {
            self.duty.listen(&mut self.mode, &mut self.task);
            let task = self.duty.task(step.name_of(step.agent).unwrap_or_default().as_str());
            let goal =
                task.filter(|task| task.motion == Motion::Goto).and_then(|task| self.place.goal(&task));
            self.sight.heard = Some(goal);
            self.report.send(NOTHING);
        }
        if let Some(scan) = self.scan.newest() {
            self.sight.laser.scan(&scan, scan.row(), scan.header().stamp);
        }
        if let Some(ranges) = self.ranges.newest() {
            self.sight.sonar.ranges(&ranges, self.params.cone, ranges.header().stamp);
        }
        let wired = (self.scan.is_wired(), self.ranges.is_wired());
        let Some(out) = self.sight.step(&self.params, wired, step.now) else { return Ok(()) };
        if is_action {
            // What is free it leaves to others, and what it offers no longer than it takes to look again.
            if out.situation.is_reason() {
                self.drive.send(offer(out.twist, step.now));
            }
            self.situation.send(out);
            return Ok(());
        }
        self.drive.send(Offer {
            twist: out.twist,
            weight: if out.situation == Situation::AtGoal { 0.0 } else { self.params.weight },
            valid_until: step.now + self.params.hold,
            form: Drive::Numeric,
            ..Offer::default()
        });
        self.situation.send(out);
        Ok(())
    }
}

/// One of the two laws.
#[derive(Debug)]
enum Law {
    Nearness(Box<NearnessDiagram>),
    Smooth(Box<SmoothNearness>),
}

/// What one sensor told last.
#[derive(Debug, Default)]
struct Seen {
    sectors: Sectors,
    at: Option<Time>,
}

impl Seen {
    fn scan(&mut self, scan: &LaserScan, row: &[f32], stamp: Time) {
        let beams =
            Ring::Sweep { angle_min: scan.angle_min.into(), angle_step: scan.angle_step.into(), ranges: row };
        let mount = Pose::new(scan.mount_x.into(), scan.mount_y.into(), scan.mount_heading.into());
        self.sectors.clear();
        self.sectors.add_scan(mount, beams, f64::from(scan.range_max) * 0.999);
        self.at = Some(stamp);
    }

    fn ranges(&mut self, ranges: &Ranges, cone: f64, stamp: Time) {
        self.sectors.clear();
        for (bearing, range) in echoes(ranges) {
            self.sectors.add_echo(Pose::new(0.0, 0.0, bearing), cone, range);
        }
        self.at = Some(stamp);
    }

    fn is_fresh(&self, stale: Duration, now: Time) -> bool {
        self.at.is_some_and(|at| now - at <= stale)
    }
}

/// What was told last, and the law.
#[derive(Debug, Default)]
struct Sight {
    law: Option<Law>,
    laser: Seen,
    sonar: Seen,
    both: Sectors,
    pose: Pose,
    heard: Option<Option<Point>>,
}

impl Sight {
    /// What the law makes of it; nothing without a goal. Each sensor that is wired must have told something lately.
    fn step(&mut self, params: &AvoidParams, wired: (bool, bool), now: Time) -> Option<Avoidance> {
        let own = || params.has_goal.then(|| Point::new(params.goal_x, params.goal_y));
        let goal = self.pose.inverse().transform(self.heard.unwrap_or_else(own)?);
        let of = [(wired.0, &self.laser), (wired.1, &self.sonar)];
        let sees =
            (wired.0 || wired.1) && of.iter().all(|(wired, seen)| !wired || seen.is_fresh(params.stale, now));
        self.both.clear();
        for (_, seen) in of.iter().filter(|(wired, _)| *wired) {
            self.both.add(&seen.sectors);
        }
        let around = sees.then_some(&self.both);
        Some(match self.law.as_mut()? {
            Law::Nearness(law) => law.step(around, goal),
            Law::Smooth(law) => law.step(around, goal),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::blank;
    use types::messages::Twist;

    fn params(law: &str) -> AvoidParams {
        AvoidParams { law: Text::new(law), goal_x: 3.0, has_goal: true, ..AvoidParams::default() }
    }

    fn sight(law: &str) -> Sight {
        Sight { law: Some(params(law).law()), ..Sight::default() }
    }

    fn at(seconds: f64) -> Time {
        Time::ZERO + Duration::from_seconds(seconds)
    }

    fn sonar(sight: &mut Sight, which: Option<usize>, stamp: Time) {
        let mut ranges = blank(12, 0.15, 5.0);
        ranges.values.fill(5.0);
        which.into_iter().for_each(|i| ranges.values[i] = 0.5);
        sight.sonar.ranges(&ranges, 0.2, stamp);
    }

    #[test]
    fn what_either_sensor_sees_pushes_away_and_the_situation_says_so() {
        for law in ["nearness", "smooth"] {
            let mut sight = sight(law);
            sonar(&mut sight, None, at(0.0));
            sight.laser.scan(&LaserScan { range_max: 8.0, ..LaserScan::default() }, &[8.0; 3], at(0.0));
            let free = sight.step(&params(law), (true, true), at(0.1)).unwrap();
            assert!(free.twist.linear > 0.29 && free.twist.angular == 0.0, "{free:?}");
            // On the left, at 60°.
            sonar(&mut sight, Some(2), at(0.1));
            let out = sight.step(&params(law), (true, true), at(0.1)).unwrap();
            assert!(out.twist.angular < 0.0 && out.left < 1.0 && out.right == 1.0, "{out:?}");
            if law == "nearness" {
                assert_eq!(free.situation, Situation::HighSafetyGoalInRegion);
                assert_eq!(out.situation, Situation::LowSafetyGoalInRegion);
            }
        }
    }

    #[test]
    fn each_wired_sensor_must_have_told_something_lately() {
        let mut sight = sight("nearness");
        let stands = |out: Avoidance| out.situation == Situation::Blind && out.twist == Twist::ZERO;
        assert!(stands(sight.step(&params("nearness"), (false, false), at(0.0)).unwrap()));
        sonar(&mut sight, None, at(0.0));
        assert!(!stands(sight.step(&params("nearness"), (false, true), at(0.5)).unwrap()));
        assert!(
            stands(sight.step(&params("nearness"), (true, true), at(0.5)).unwrap()),
            "the laser is silent"
        );
        assert!(stands(sight.step(&params("nearness"), (false, true), at(0.7)).unwrap()), "too old");
    }

    #[test]
    fn without_a_goal_it_wishes_nothing() {
        let mut sight = sight("nearness");
        sonar(&mut sight, None, at(0.0));
        assert_eq!(sight.step(&AvoidParams::default(), (false, true), at(0.0)), None);
        sight.heard = Some(Some(Point::new(0.0, 2.0)));
        let out = sight.step(&AvoidParams::default(), (false, true), at(0.0)).unwrap();
        assert!((out.goal - PI / 2.0).abs() < 1e-9);
    }
}
