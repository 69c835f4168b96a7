//! The wall follower: along the walls, through every gap that is wide enough, and away from what it only circles.

use std::any::Any;

use motion::wall::Side;
use navigation::ground::Ground;
use navigation::roam::{Beside, Parameters, Roamer};
use perception::local_map::{LocalMap, MapParams};
use runtime::{Agent, Fault, Input, Output, Step};
use types::geometry::{PI, wrap};
use types::messages::{Drive, Odometry, Offer, Ranges};
use types::params::Params;
use types::{Duration, Point, Pose, Text, Time};

use crate::shared::echoes;

/// How the wall is followed.
#[derive(Clone, Debug, Params)]
pub struct WallParams {
    /// The side on which the wall is kept: "left" or "right". With the wall on the left it goes around a room clockwise.
    #[param(default = "left", words = ["left", "right"])]
    pub side: Text<8>,
    /// Radius of the robot (m). 0.225 is that of the exploring robot.
    #[param(default = 0.225, min = 0.01, max = 2.0)]
    pub radius: f64,
    /// Half the opening angle of one beam (rad). PI / 12 is 15°, that of a common ultrasonic transducer; 0 for a laser.
    #[param(default = PI / 12.0, min = 0.0, max = 1.6)]
    pub cone: f64,
    /// Distance to keep from its middle to everything where there is room (m). 0.42 leaves what a sonar can tell apart beside the body, and fits into a door of 0.9 m.
    #[param(default = 0.42, min = 0.05, max = 5.0)]
    pub keep: f64,
    /// Distance from its middle with which it still goes through (m). 0.3 leaves three times the error of a sonar beside the body.
    #[param(default = 0.3, min = 0.05, max = 5.0)]
    pub least: f64,
    /// Way that must be free ahead (m). 0.65 is more than the body is long; a niche that is not deeper is taken for wall.
    #[param(default = 0.65, min = 0.05, max = 3.0)]
    pub look: f64,
    /// Speed with all free (m/s). 0.5 is what a ring that is heard four times a second allows: an eighth of a metre a reading.
    #[param(default = 0.5, min = 0.0, max = 5.0)]
    pub speed: f64,
    /// How fast the wished speed grows while all is free (m/s²). 0.3 takes a second and a half to full speed, in which more is heard.
    #[param(default = 0.3, min = 0.0, max = 5.0)]
    pub growth: f64,
    /// Distance from the rim up to which a thing may be nearer than it is told (m). 0.17: a sonar tells 0.15 m of all that is nearer.
    #[param(default = 0.17, min = 0.0, max = 2.0)]
    pub touch: f64,
    /// How long what was near is remembered while no sensor hears it (time). 30 s is how long a robot may turn about in a corner; on so short a way the odometry drifts by centimetres.
    #[param(default = Duration::secs(30), min = 0.0, max = 600.0)]
    pub remember: Duration,
    /// Ground that it has come as near to is not new any more (m). 0.9: a ring of sonars sees a place well from as near.
    #[param(default = 0.9, min = 0.05, max = 5.0)]
    pub near: f64,
    /// It leaves what it follows when it has come to no new ground for this long (s). 4 are a metre and a half of way among things.
    #[param(default = 4.0, min = 0.5, max = 600.0)]
    pub restless: f64,
    /// It gives up a place when it has not got away from one spot for this long (s). 15 is time to turn around twice.
    #[param(default = 15.0, min = 1.0, max = 600.0)]
    pub patience: f64,
    /// How long a wish of it holds (time). 600 ms is two missed readings of a sonar at 4 Hz.
    #[param(default = Duration::millis(600), min = 0.01, max = 60.0)]
    pub hold: Duration,
}

impl WallParams {
    fn law(&self) -> Parameters {
        Parameters {
            side: if self.side.as_str() == "right" { Side::Right } else { Side::Left },
            keep: self.keep,
            least: self.least,
            look: self.look,
            speed: self.speed,
            growth: self.growth,
            near: self.near,
            restless: self.restless,
            patience: self.patience,
            ..Parameters::new(self.radius)
        }
    }

    fn map(&self) -> MapParams {
        MapParams { rim: self.radius, cone: self.cone, keep: self.remember, ..MapParams::default() }
    }

    /// How far the ways are looked at (m).
    fn reach(&self) -> f64 {
        3.0 * self.look
    }
}

/// So far around it the robot takes over what it has heard (m): the echoes that go into its map.
const SEEN: f64 = 2.2;

/// What may be there within this is not gone nearer to (m); farther away only what was heard twice is in the way.
const CLOSE: f64 = 0.45;

/// Keeps to the wall at its side and goes the faster the freer the way is; leaves an island that it has circled.
#[derive(Agent)]
pub struct WallFollower {
    /// What is around.
    ranges: Input<Ranges>,
    /// Where the robot believes to be; without it nothing is remembered.
    odometry: Input<Odometry>,
    /// A wish to drive along the wall.
    drive: Output<Offer>,
    params: WallParams,
    walk: Walk,
}

impl Agent for WallFollower {
    /// What it remembers of the room, and where it was going.
    fn take_over(&mut self, before: &mut dyn Any) {
        if let Some(before) = before.downcast_mut::<WallFollower>() {
            core::mem::swap(&mut self.walk, &mut before.walk);
        }
    }

    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        if let Some(odometry) = self.odometry.latest() {
            self.walk.pose = Some(odometry.pose);
        }
        if let Some(received) = self.ranges.newest() {
            let stamp = received.header().stamp;
            let at = self.odometry.at(stamp).map(|found| found.value().pose);
            self.walk.hear(&self.params, &received, at, stamp);
        }
        if let Some(offer) = self.walk.advance(&self.params, step.now) {
            self.drive.send(offer);
        }
        Ok(())
    }
}

/// The roamer, what it remembers, and where it was at the step before.
#[derive(Debug)]
struct Walk {
    map: LocalMap,
    ground: Ground,
    /// What is around in this step. Its memory is taken when the agent is made, so no step takes any.
    points: Vec<Point>,
    roamer: Option<Roamer>,
    pose: Option<Pose>,
    heard: Option<Time>,
    beside: Beside,
    last: Option<Time>,
}

/// So many points are looked at; with all cells taken there would be as many within the longest reach.
const POINTS: usize = 16_384;

impl Default for Walk {
    fn default() -> Walk {
        Walk {
            map: LocalMap::default(),
            ground: Ground::default(),
            points: Vec::with_capacity(POINTS),
            roamer: None,
            pose: None,
            heard: None,
            beside: Beside::default(),
            last: None,
        }
    }
}

impl Walk {
    /// Takes over ranges that were measured at `at`; without it the last pose that was heard counts.
    fn hear(&mut self, params: &WallParams, ranges: &Ranges, at: Option<Pose>, stamp: Time) {
        if self.pose.is_none() {
            // Without odometry what was heard before may be anywhere.
            self.map.reset();
            self.ground.forget();
        }
        let here = at.or(self.pose).unwrap_or_default();
        self.map.set_params(params.map());
        self.map.update(echoes(ranges), here, stamp);
        for (first, row) in self.map.squares(here.position(), SEEN) {
            self.ground.see_row(first, row.known, row.free, row.taken);
        }
        self.heard = Some(stamp);
        self.beside = beside(params, ranges);
    }

    /// A wish as long as the ranges are not too old.
    fn advance(&mut self, params: &WallParams, now: Time) -> Option<Offer> {
        let heard = self.heard.filter(|heard| now - *heard <= params.hold)?;
        let here = self.pose.unwrap_or_default();
        let before = self.last.replace(now).unwrap_or(now);
        let law = params.law();
        let roamer = self.roamer.get_or_insert_with(|| Roamer::new(law, here));
        roamer.set_parameters(law);
        let left = roamer.times_left();
        // The roamer looks at them several times; finding them is dear.
        self.points.clear();
        let close = self.map.around(here, CLOSE, now, 1);
        let around = self.map.around(here, params.reach(), now, 2).chain(close).take(POINTS);
        // Going through all of them at once, from the inside, is cheaper than asking for one after another.
        around.for_each(|point| self.points.push(point));
        let points = self.points.iter().copied();
        let twist = roamer.step(points, self.beside, here, &mut self.ground, (now - before).seconds());
        if roamer.times_left() > left {
            runtime::note!("leaves what it followed; times so far: {}", roamer.times_left());
        }
        let valid_until = heard + params.hold;
        Some(Offer { twist, weight: 1.0, valid_until, form: Drive::Numeric, ..Offer::default() })
    }
}

/// On which sides something is as near as can be told.
fn beside(params: &WallParams, ranges: &Ranges) -> Beside {
    let close = f64::from(ranges.range_min).max(params.radius + params.touch);
    let on = |side: f64| {
        echoes(ranges).any(|(bearing, range)| range <= close && (0.2..=1.8).contains(&(side * wrap(bearing))))
    };
    Beside { left: on(1.0), right: on(-1.0) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::blank;
    use runtime::Declare as _;

    #[test]
    fn before_a_wall_it_turns_so_that_the_wall_is_on_the_chosen_side() {
        let mut ranges = blank(12, 0.3, 6.2);
        ranges.values.fill(6.2);
        for (i, range) in [(11, 0.5), (0, 0.45), (1, 0.5)] {
            ranges.values[i] = range;
        }
        let turn = |side: &str| {
            let params = WallParams { side: side.into(), ..WallParams::default() };
            let mut walk = Walk { pose: Some(Pose::default()), ..Walk::default() };
            walk.hear(&params, &ranges, None, Time::ZERO);
            walk.advance(&params, Time::ZERO).unwrap().twist.angular
        };
        assert!(turn("left") < -0.3 && turn("right") > 0.3, "{} {}", turn("left"), turn("right"));
    }

    #[test]
    fn a_replacement_knows_the_room_that_the_one_before_has_seen() {
        let [mut before, mut after] = [(); 2].map(|()| WallFollower::build(WallParams::default()));
        let mut ranges = blank(12, 0.3, 6.2);
        ranges.values.fill(1.0);
        before.walk.pose = Some(Pose::default());
        before.walk.hear(&before.params, &ranges, None, Time::ZERO);
        let near = |wall: &WallFollower| wall.walk.map.around(Pose::default(), 2.0, Time::ZERO, 1).count();
        let seen = near(&before);
        assert!(seen > 0 && near(&after) == 0);
        after.take_over(&mut before);
        assert_eq!((near(&after), after.walk.heard), (seen, Some(Time::ZERO)));
    }

    #[test]
    fn the_speed_grows_to_that_of_the_parameters_and_old_ranges_are_none() {
        let mut walk = Walk { pose: Some(Pose::default()), ..Walk::default() };
        let mut params = WallParams::default();
        let mut speed = 0.0;
        let mut ranges = blank(12, 0.3, 6.2);
        ranges.values.fill(6.2);
        for i in 0..40 {
            params.speed = if i < 20 { 0.4 } else { 0.1 };
            let stamp = Time::ZERO + Duration::millis(250 * i);
            walk.pose = Some(Pose::new(0.1 * i as f64, 0.0, 0.0));
            walk.hear(&params, &ranges, None, stamp);
            speed = walk.advance(&params, stamp).unwrap().twist.linear;
            assert!(i != 19 || speed > 0.3, "{speed}");
        }
        assert!(speed <= 0.1);
        let late = Time::ZERO + Duration::millis(250 * 39) + params.hold + Duration::nanos(1);
        assert!(walk.advance(&params, late).is_none());
    }
}
