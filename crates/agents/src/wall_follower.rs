//! The wall follower: along the walls, and away from what it only circles.

use libm::sin;
use motion::island::Follower;
use motion::odometry::Increment;
use motion::wall::{Parameters, Side};
use runtime::{Agent, Fault, Input, Output, Step};
use types::geometry::{PI, wrap};
use types::messages::{Drive, Odometry, Offer, Ranges};
use types::params::Params;
use types::{Duration, Pose, Text, Time};

use crate::shared::ring;

/// How the wall is followed.
#[derive(Clone, Debug, Params)]
pub struct WallParams {
    /// The side on which the wall is kept: "left" or "right". With the wall on the left it goes around a room clockwise.
    #[param(default = "left")]
    pub side: Text<8>,
    /// Radius of the robot (m). 0.225 is that of the exploring robot.
    #[param(default = 0.225, min = 0.01, max = 2.0)]
    pub radius: f64,
    /// Half the opening angle of one beam (rad). PI / 12 is 15°, that of a common ultrasonic transducer; 0 for a laser.
    #[param(default = PI / 12.0, min = 0.0, max = 1.6)]
    pub cone: f64,
    /// Distance to keep from the wall to the robot's centre (m). 0.45 is the middle of a door of 0.9 m.
    #[param(default = 0.45, min = 0.05, max = 5.0)]
    pub keep: f64,
    /// A thing on the side counts as a wall up to this distance (m). 1.35 is three times what is kept: the other side of a corridor is farther.
    #[param(default = 1.35, min = 0.1, max = 20.0)]
    pub reach: f64,
    /// Speed with all free (m/s). 0.4 lets an error of direction fall to 1/e within the distance that is kept, also at four readings a second.
    #[param(default = 0.4, min = 0.0, max = 5.0)]
    pub speed: f64,
    /// How fast the wished speed grows while all is free (m/s²). 0.2 takes two seconds to full speed.
    #[param(default = 0.2, min = 0.0, max = 5.0)]
    pub growth: f64,
    /// Free way ahead, from the rim, below which it begins to turn away (m). 0.65 is before the safety monitor forbids to go on.
    #[param(default = 0.65, min = 0.05, max = 10.0)]
    pub front_far: f64,
    /// Free way ahead at which it turns in place (m). 0.3 is still clear of where the safety monitor forbids to go on.
    #[param(default = 0.3, min = 0.0, max = 10.0)]
    pub front_near: f64,
    /// How long a wish of it holds (time). 600 ms is two missed readings of a sonar at 4 Hz.
    #[param(default = Duration::millis(600), min = 0.01, max = 60.0)]
    pub hold: Duration,
}

impl WallParams {
    fn law(&self) -> Parameters {
        Parameters {
            side: if self.side.as_str() == "right" { Side::Right } else { Side::Left },
            keep: self.keep,
            reach: self.reach,
            speed: self.speed,
            growth: self.growth,
            front_far: self.front_far,
            front_near: self.front_near,
            ..Parameters::new(self.radius, self.cone)
        }
    }
}

/// Keeps a distance to the wall at its side and goes the faster the freer the way is; leaves an island that it has circled.
#[derive(Agent)]
pub struct WallFollower {
    /// What is around.
    ranges: Input<Ranges>,
    /// Where the robot believes to be; without it no circle is noticed.
    odometry: Input<Odometry>,
    /// A wish to drive along the wall.
    drive: Output<Offer>,
    params: WallParams,
    walk: Walk,
}

impl Agent for WallFollower {
    fn start(&mut self, _: &mut Step) -> Result<(), Fault> {
        match self.params.side.as_str() {
            "left" | "right" => Ok(()),
            _ => Err(Fault::new("\"side\" of a wall follower is \"left\" or \"right\"")),
        }
    }

    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        if let Some(odometry) = self.odometry.latest() {
            self.walk.now_at = Some(odometry.pose);
        }
        let Some(received) = self.ranges.newest() else { return Ok(()) };
        let stamp = received.header().stamp;
        let at = self.odometry.at(stamp).map(|found| found.value().pose);
        let offer = self.walk.advance(&self.params, &received, at, stamp);
        self.drive.send(offer);
        Ok(())
    }
}

/// The follower and where it was at the reading before.
#[derive(Clone, Copy, Debug, Default)]
struct Walk {
    follower: Option<Follower>,
    last: Option<(Option<Pose>, Time)>,
    now_at: Option<Pose>,
}

impl Walk {
    /// `at` is where the robot was when the ranges were measured; without it the last pose that was heard counts.
    fn advance(&mut self, params: &WallParams, ranges: &Ranges, at: Option<Pose>, stamp: Time) -> Offer {
        let here = at.or(self.now_at);
        let (moved, dt) = match self.last.replace((here, stamp)) {
            Some((before, then)) => (moved(before, here), (stamp - then).seconds()),
            None => (Increment::default(), 0.0),
        };
        let law = params.law();
        let follower = self.follower.get_or_insert_with(|| Follower::new(law));
        follower.set_parameters(law);
        let left = follower.islands_left();
        let twist = follower.step(ring(ranges), moved, dt);
        if follower.islands_left() > left {
            runtime::note!("leaves an island after circling it; islands so far: {}", follower.islands_left());
        }
        Offer {
            twist,
            weight: 1.0,
            valid_until: stamp + params.hold,
            form: Drive::Numeric,
            ..Offer::default()
        }
    }
}

/// The motion between two poses, as if along an arc.
fn moved(before: Option<Pose>, now: Option<Pose>) -> Increment {
    let (Some(before), Some(now)) = (before, now) else { return Increment::default() };
    let there = before.inverse().transform(now.position());
    let turn = wrap(now.heading - before.heading);
    let half = turn / 2.0;
    let longer = if half.abs() > 1e-6 { half / sin(half) } else { 1.0 };
    // Across the half turned heading the motion has no part, so its sign is that of the part along it.
    let along = there.x * libm::cos(half) + there.y * sin(half);
    Increment { distance: along * longer, turn }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::blank;

    #[test]
    fn the_motion_between_two_poses_is_the_arc_between_them() {
        let start = Pose::new(1.0, -2.0, 2.9);
        for (distance, turn) in [(0.1, 0.5), (-0.1, 0.3), (0.2, -0.4), (0.15, 0.0), (0.0, 1.0)] {
            let got = moved(Some(start), Some(start.along_arc(distance, turn)));
            assert!((got.distance - distance).abs() < 1e-9 && (got.turn - turn).abs() < 1e-9, "{got:?}");
        }
        assert_eq!(moved(None, Some(start)), Increment::default());
    }

    #[test]
    fn the_side_and_the_speed_of_the_parameters_count_at_once() {
        // A wall on both sides at half of what is kept too much: towards the chosen one.
        let mut ranges = blank(12, 0.3, 6.2);
        ranges.values.fill(6.2);
        let near = |from: usize| {
            [0.8 / 0.866, 0.8, 0.8 / 0.866].into_iter().enumerate().map(move |(i, r)| (from + i, r as f32))
        };
        near(2).chain(near(8)).for_each(|(i, r)| ranges.values[i] = r);
        let turn = |side: &str| {
            let params = WallParams { side: side.into(), ..WallParams::default() };
            Walk::default().advance(&params, &ranges, None, Time::ZERO).twist.angular
        };
        assert!(turn("left") > 0.05 && turn("right") < -0.05, "{} {}", turn("left"), turn("right"));
        let mut walk = Walk::default();
        let mut params = WallParams::default();
        let mut speed = 0.0;
        for i in 0..40 {
            params.speed = if i < 20 { 0.4 } else { 0.1 };
            let stamp = Time::ZERO + Duration::millis(250 * i);
            speed = walk.advance(&params, &ranges, None, stamp).twist.linear;
            assert!(i != 19 || speed > 0.15, "{speed}");
        }
        assert!(speed <= 0.1);
    }
}
