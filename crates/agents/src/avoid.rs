//! The avoidance: towards a goal past what is near, by what is seen at this moment, with the situation that says why.
//!
//! As an action beside others it wishes to drive only while something is in the way or near: who stands below it then drives to the goal.

use motion::ring::Ring;
use navigation::avoid::nearness::{self, NearnessDiagram};
use navigation::avoid::smooth::{self, SmoothNearness};
use navigation::avoid::{Body, Memory, Sectors, memory};
use runtime::{Agent, Fault, Input, Output, Step};
use types::geometry::PI;
use types::messages::{
    Avoidance, Drive, LaserScan, Mode, Motion, Odometry, Offer, Path as Way, Ranges, Report, Situation, Task,
};
use types::params::Params;
use types::{Duration, Point, Pose, Text, Time};

use crate::action::{Duty, NOTHING, Whereabouts, offer};
use crate::shared::echoes;
use crate::trust::Again;

/// How it avoids.
#[derive(Clone, Debug, Params)]
pub struct AvoidParams {
    /// The law: "nearness" for the Nearness Diagram with its situations, "smooth" for the one without.
    #[param(default = "nearness", words = ["nearness", "smooth"])]
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
    /// How long it keeps in mind what its laser saw and cannot see now (time); 0 for not at all. 10 s are the way past a thing of its own size.
    #[param(default = Duration::secs(10), min = 0.0, max = 600.0)]
    pub remember: Duration,
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

    fn memory(&self) -> memory::Parameters {
        let body = self.body();
        let passage = nearness::Parameters::new(body).passage;
        memory::Parameters { keep: self.remember.seconds(), ..memory::Parameters::new(body.core(), passage) }
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
        self.sight.law.get_or_insert_with(|| self.params.law());
        self.sight.memory.get_or_insert_with(|| Memory::new(self.params.memory()));
        Ok(())
    }

    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        if let Some(goal) = self.goal.newest() {
            let goal = goal.points.last().map(|end| Point::from(*end));
            if self.sight.heard != Some(goal) {
                self.sight.forget();
            }
            self.sight.heard = Some(goal);
        }
        self.place.listen(&mut self.odometry, &mut self.pose, step.now);
        if let Some(odometry) = self.place.odometry {
            self.sight.pose = odometry.pose;
        }
        let is_action = self.task.is_wired();
        if is_action {
            self.duty.listen(&mut self.mode, &mut self.task);
            let task = self.duty.task(step.name_of(step.agent).unwrap_or_default().as_str());
            if self.duty.is_new(task.as_ref(), step.now) {
                self.sight.forget();
            }
            let goal =
                task.filter(|task| task.motion == Motion::Goto).and_then(|task| self.place.goal(&task));
            self.sight.heard = Some(goal);
            self.report.send(NOTHING);
        }
        if let Some(scan) = self.scan.newest() {
            let stamp = scan.header().stamp;
            self.sight.laser.scan(&scan, scan.row(), stamp);
            // Where it was when it looked: without odometry it has nothing to remember by.
            let then = self.odometry.at(stamp).map(|found| found.value().pose);
            self.sight.again.scan(&scan, scan.row(), stamp, then);
            if let Some(then) = then.filter(|_| !self.sight.again.is_frozen()) {
                self.sight.remember(then, &scan, scan.row(), stamp);
            }
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

/// Where a laser sits, its beams, and the range from which on they met nothing (m).
fn beams<'a>(scan: &LaserScan, row: &'a [f32]) -> (Pose, Ring<'a>, f64) {
    let sweep =
        Ring::Sweep { angle_min: scan.angle_min.into(), angle_step: scan.angle_step.into(), ranges: row };
    let mount = Pose::new(scan.mount_x.into(), scan.mount_y.into(), scan.mount_heading.into());
    (mount, sweep, f64::from(scan.range_max) * 0.999)
}

/// What one sensor told last.
#[derive(Debug, Default)]
struct Seen {
    sectors: Sectors,
    at: Option<Time>,
}

impl Seen {
    fn scan(&mut self, scan: &LaserScan, row: &[f32], stamp: Time) {
        let (mount, beams, range_max) = beams(scan, row);
        self.sectors.clear();
        self.sectors.add_scan(mount, beams, range_max);
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
    /// Whether the laser shows the same scan again and again.
    again: Again,
    /// What the laser saw a moment ago.
    memory: Option<Memory>,
    pose: Pose,
    heard: Option<Option<Point>>,
}

impl Sight {
    /// For another goal another way may be the better one.
    fn forget(&mut self) {
        match &mut self.law {
            Some(Law::Nearness(law)) => law.forget(),
            Some(Law::Smooth(law)) => law.forget(),
            None => {}
        }
    }

    /// Keeps in mind a scan that was made while the robot was at `then`.
    fn remember(&mut self, then: Pose, scan: &LaserScan, row: &[f32], stamp: Time) {
        if let Some(memory) = &mut self.memory {
            let (mount, beams, range_max) = beams(scan, row);
            memory.look(then.then(mount), beams, range_max, stamp.seconds());
        }
    }

    /// What the law makes of it; nothing without a goal. Each sensor that is wired must have told something lately.
    fn step(&mut self, params: &AvoidParams, wired: (bool, bool), now: Time) -> Option<Avoidance> {
        let own = || params.has_goal.then(|| Point::new(params.goal_x, params.goal_y));
        let goal = self.pose.inverse().transform(self.heard.unwrap_or_else(own)?);
        let of = [(wired.0, &self.laser), (wired.1, &self.sonar)];
        // A laser that shows the same from everywhere shows nothing.
        let sees = (wired.0 || wired.1)
            && !(wired.0 && self.again.is_frozen())
            && of.iter().all(|(wired, seen)| !wired || seen.is_fresh(params.stale, now));
        self.both.clear();
        for (_, seen) in of.iter().filter(|(wired, _)| *wired) {
            self.both.add(&seen.sectors);
        }
        if let Some(memory) = &self.memory {
            memory.recall(self.pose, &mut self.both);
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
    fn a_laser_that_falls_silent_or_shows_the_same_from_elsewhere_blinds_it_until_it_is_well_again() {
        let params = params("nearness");
        let mut sight = sight("nearness");
        let head = LaserScan { range_max: 8.0, ..LaserScan::default() };
        let mut look = |row: [f32; 4], seconds: f64, x: f64| {
            sight.laser.scan(&head, &row, at(seconds));
            sight.again.scan(&head, &row, at(seconds), Some(Pose::new(x, 0.0, 0.0)));
            sight.step(&params, (true, false), at(seconds)).unwrap().situation == Situation::Blind
        };
        let scan = [3.0, 3.1, 3.2, 3.3];
        assert!(!look(scan, 0.0, 0.0));
        // While it stands a laser without noise may show the same.
        assert!(!look(scan, 0.1, 0.01) && !look(scan, 0.2, 0.03));
        assert!(look(scan, 0.3, 0.07) && look(scan, 0.4, 0.07), "the robot has come away");
        assert!(!look([2.9, 3.0, 3.1, 3.2], 0.5, 0.07), "it is well again");
        let silent = sight.step(&params, (true, false), at(1.2)).unwrap();
        assert_eq!((silent.situation, silent.twist), (Situation::Blind, Twist::ZERO));
    }

    #[test]
    fn what_a_half_turn_laser_has_turned_away_from_still_counts() {
        let params = params("nearness");
        let mut sight = sight("nearness");
        sight.memory = Some(Memory::new(params.memory()));
        let step = (PI / 180.0) as f32;
        let head = LaserScan {
            angle_min: (-PI / 2.0) as f32,
            angle_step: step,
            range_max: 8.0,
            ..LaserScan::default()
        };
        // A wall half a metre ahead, and a robot that turns away from it to the right.
        let row = |heading: f32| {
            let range = |i: i16| 0.5 / (f32::from(i - 90) * step + heading).cos();
            (0..=180)
                .map(range)
                .map(|range| if range > 0.0 { range.min(8.0) } else { 8.0 })
                .collect::<Vec<_>>()
        };
        let mut look = |heading: f64, seconds: f64| {
            let row = row(heading as f32);
            sight.pose = Pose::new(0.0, 0.0, heading);
            sight.laser.scan(&head, &row, at(seconds));
            sight.remember(sight.pose, &head, &row, at(seconds));
            sight.step(&params, (true, false), at(seconds)).unwrap()
        };
        look(0.0, 0.0);
        look(-PI / 2.0, 1.0);
        let behind = look(-3.0, 2.0);
        assert!((behind.nearest - 0.275).abs() < 0.02, "{behind:?}");
        assert!((behind.nearest_bearing.abs() - 3.0).abs() < 0.1, "{behind:?}");
        assert!(look(-3.0, 13.0).nearest > 0.5, "after ten seconds it is forgotten");
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
