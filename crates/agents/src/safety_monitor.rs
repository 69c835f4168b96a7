//! The safety monitor: how fast is safe, whether the robot may move forward at all, and a way out of danger.
//!
//! It runs when ranges come, and once more when they stay away: then it is blind, and says so. What its sensors say that cannot be true
//! blinds it as well.

use motion::ring::Ring;
use motion::safety::{Parameters, Verdict, Way, judge, judge_way};
use perception::local_map::{LocalMap, MapParams};
use runtime::{Agent, Fault, Input, Output, Step};
use types::geometry::{PI, wrap};
use types::messages::{Drive, Odometry, Offer, Ranges, Safety, Twist};
use types::params::Params;
use types::{Duration, Point, Pose, Time};

use crate::shared::{Dated, bearings, echoes, ring};
use crate::trust::{Doubt, Trust};

/// What the robot is, and how careful it shall be.
#[derive(Clone, Debug, Params)]
pub struct SafetyParams {
    /// Radius of the round body (m). 0.225 is that of the exploring robot.
    #[param(default = 0.225, min = 0.01, max = 2.0)]
    pub radius: f64,
    /// Half the opening angle of one beam (rad). PI / 12 is 15°, that of a common ultrasonic transducer; 0 for a laser.
    #[param(default = PI / 12.0, min = 0.0, max = 1.6)]
    pub cone: f64,
    /// Room kept on both sides of the way ahead (m). 0.02 lets it through doors.
    #[param(default = 0.02, min = 0.0, max = 1.0)]
    pub side_margin: f64,
    /// Way left in front after stopping, from the body's rim (m). 0.05 keeps it from creeping up on what it stopped for.
    #[param(default = 0.05, min = 0.0, max = 2.0)]
    pub margin: f64,
    /// Way ahead, from the body's rim, below which it must not move forward (m). 0.1 is what is left beside the body in the narrowest way, and a creep stops within half of it.
    #[param(default = 0.1, min = 0.0, max = 5.0)]
    pub stop_distance: f64,
    /// From an echo to the wheels' answer (s). 0.35 is a period of the sonar, one of the drive and the lag of the motors.
    #[param(default = 0.35, min = 0.0, max = 5.0)]
    pub reaction: f64,
    /// Braking (m/s²). 1 brakes without tipping.
    #[param(default = 1.0, min = 0.05, max = 20.0)]
    pub deceleration: f64,
    /// Highest speed at all (m/s). 0.6 is a slow walk, so people can step aside.
    #[param(default = 0.6, min = 0.0, max = 10.0)]
    pub linear_max: f64,
    /// Room from the rim to both sides together, below which it is narrow (m). 0.45 is where a second robot would not fit.
    #[param(default = 0.45, min = 0.0, max = 10.0)]
    pub narrow: f64,
    /// Way from the rim beyond which nothing is a danger (m). 1.5 is four seconds at a slow walk.
    #[param(default = 1.5, min = 0.05, max = 50.0)]
    pub horizon: f64,
    /// Ranges older than this are not trusted (time). 600 ms is two missed readings of a sonar at 4 Hz.
    #[param(default = Duration::millis(600), min = 0.01, max = 60.0)]
    pub stale: Duration,
    /// From this danger on it turns away from what is near (0 to 1). 0.5 is half way to where stopping in time ends.
    #[param(default = 0.5, min = 0.0, max = 1.0)]
    pub avoid_from: f64,
    /// Turn rate at which it turns away (rad/s). 0.7 turns by a beam of 30° in three readings.
    #[param(default = 0.7, min = 0.0, max = 10.0)]
    pub avoid_turn: f64,
    /// Highest speed while it turns away (m/s). 0.2 keeps the curve short.
    #[param(default = 0.2, min = 0.0, max = 10.0)]
    pub avoid_speed: f64,
    /// Distance from the rim to what is beside it, at which it goes slowly (m). 0.17: a sonar tells 0.15 m of all that is nearer.
    #[param(default = 0.17, min = 0.0, max = 2.0)]
    pub touch: f64,
    /// Highest speed with something that close obliquely ahead (m/s). 0.1 is 2.5 cm between two readings at 4 Hz.
    #[param(default = 0.1, min = 0.0, max = 10.0)]
    pub creep: f64,
    /// Highest speed past something that close beside it (m/s). 0.35 is 9 cm between two readings at 4 Hz, half of what `touch` leaves.
    #[param(default = 0.35, min = 0.0, max = 10.0)]
    pub pass: f64,
    /// How long what was near is remembered while no sensor hears it (time). 10 s is a metre at a creep; longer, and somebody who was followed still stands where he has left.
    #[param(default = Duration::secs(10), min = 0.0, max = 60.0)]
    pub remember: Duration,
    /// How long a wish of it holds (time). 500 ms is two readings of a sonar at 4 Hz.
    #[param(default = Duration::millis(500), min = 0.01, max = 60.0)]
    pub hold: Duration,
}

impl SafetyParams {
    fn law(&self) -> Parameters {
        Parameters {
            radius: self.radius,
            // Where in its cone an echo came from is what the map is for.
            cone: 0.0,
            side_margin: self.side_margin,
            margin: self.margin,
            stop: self.stop_distance,
            reaction: self.reaction,
            deceleration: self.deceleration,
            linear_max: self.linear_max,
            narrow: self.narrow,
            horizon: self.horizon,
        }
    }
}

/// Says how fast is safe, forbids to move forward (not to turn) when something is too close, and offers to turn to the wider side.
#[derive(Agent)]
pub struct SafetyMonitor {
    /// What is around, filtered.
    ranges: Input<Ranges>,
    /// The same as it was measured: without delay, but perhaps with false echoes. Without a wire the filtered ones count for both.
    raw: Input<Ranges>,
    /// How the robot moves.
    odometry: Input<Odometry>,
    /// The verdict: danger, the speed that is allowed, the wider side.
    #[port(history = 64, interpreted)]
    safety: Output<Safety>,
    /// A wish to turn away from what is near.
    drive: Output<Offer>,
    params: SafetyParams,
    watch: Watch,
}

impl Agent for SafetyMonitor {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        if let Some(received) = self.ranges.newest() {
            self.watch.filtered = Some(Dated { value: *received, stamp: received.header().stamp });
        }
        if let Some(received) = self.raw.newest() {
            self.watch.raw = Some(Dated { value: *received, stamp: received.header().stamp });
        }
        while let Some(odometry) = self.odometry.take() {
            if self.watch.trust.hear(&odometry, odometry.header().stamp, step.now) {
                self.watch.motion = odometry.twist;
                self.watch.pose = Some(odometry.pose);
            }
        }
        self.watch.hear_again();
        if let Some(filtered) = &self.watch.filtered {
            self.watch.heard_at = self.odometry.at(filtered.stamp).map(|found| found.value().pose);
        }
        let was_blind = self.watch.blind;
        let was_doubted = self.watch.doubt;
        let (safety, offer) = self.watch.judge(&self.params, step.now);
        if safety.blind && !(was_blind && was_doubted == self.watch.doubt) {
            note(self.watch.doubt);
        }
        self.watch.blind = safety.blind;
        self.safety.send(safety);
        if let Some(offer) = offer {
            self.drive.send(offer);
        }
        // When no ranges come, this is when those that are here become too old.
        if let Some(ranges) = self.watch.filtered.filter(|_| !safety.blind) {
            step.wake_at(ranges.stamp + self.params.stale + Duration::nanos(1));
        }
        Ok(())
    }
}

/// Says why it is blind.
fn note(doubt: Option<Doubt>) {
    match doubt {
        None => runtime::note!("blind: no ranges that can be trusted"),
        Some(Doubt::Silent) => runtime::note!("blind: nothing is heard of the wheels"),
        Some(Doubt::Jumps) => runtime::note!("blind: the wheels tell of a motion that cannot be"),
        Some(Doubt::Stays) => runtime::note!("blind: the wheels tell of a motion that leads nowhere"),
        Some(Doubt::Frozen) => runtime::note!("blind: the ranges stay the same while the robot moves"),
    }
}

/// The most occupied cells that are looked at.
const POINTS: usize = 2048;

/// What is farther behind the middle of the robot than this is behind, however it is rounded (m).
const HAIR: f64 = 1e-6;
/// What is nearer to straight ahead than this is in front (rad): 40°, the beams that look ahead.
const IN_FRONT: f64 = 0.7;
/// What is nearer to straight ahead than this comes nearer still (rad): 65°. To what is farther off, a robot that goes straight on comes
/// nearer by 9 % of its distance from the middle of the body, which is 4 cm of what is touched.
const OBLIQUE: f64 = 1.13;
/// What is farther from the rim than this is afar (m): of the false echoes that fall short of it few are as near as a touch.
const AFAR: f64 = 2.0;
/// What is farther from straight ahead than this is left behind (rad): 110°.
const BESIDE: f64 = 0.6 * PI;
/// A turn at this rate is one (rad/s), not the noise of a controller.
const TURNING: f64 = 0.2;

/// What was heard last, and the side on which the robot turns away.
#[derive(Debug)]
struct Watch {
    filtered: Option<Dated<Ranges>>,
    raw: Option<Dated<Ranges>>,
    motion: Twist,
    /// Where the robot is, and where it was when the ranges were measured.
    pose: Option<Pose>,
    heard_at: Option<Pose>,
    map: LocalMap,
    /// Bearing (rad) and distance (m) of what is looked at. Its memory is taken when the agent is made, so no step takes any.
    points: Vec<(f64, f64)>,
    /// The stamp of the ranges that were put into the map last.
    mapped: Option<Time>,
    /// 1 for left, −1 for right; 0 while nothing is to be avoided.
    side: f64,
    /// Whether that was said already.
    blind: bool,
    trust: Trust,
    doubt: Option<Doubt>,
}

impl Default for Watch {
    fn default() -> Watch {
        Watch {
            filtered: None,
            raw: None,
            motion: Twist::ZERO,
            pose: None,
            heard_at: None,
            map: LocalMap::default(),
            points: Vec::with_capacity(POINTS),
            mapped: None,
            side: 0.0,
            blind: false,
            trust: Trust::default(),
            doubt: None,
        }
    }
}

impl Watch {
    fn hear_again(&mut self) {
        for (which, heard) in [&self.raw, &self.filtered].into_iter().enumerate() {
            if let Some(heard) = heard {
                self.trust.ring(which, &heard.value, heard.stamp, self.pose);
            }
        }
    }

    fn judge(&mut self, params: &SafetyParams, now: Time) -> (Safety, Option<Offer>) {
        self.doubt = self.trust.doubt(now);
        let heard = Dated::fresh(&self.filtered, now, params.stale).filter(|_| self.doubt.is_none());
        let Some(filtered) = heard else {
            self.side = 0.0;
            return (Safety { danger: 1.0, blind: true, ..Safety::default() }, None);
        };
        let raw = Dated::fresh(&self.raw, now, params.stale).unwrap_or(filtered);
        let mut verdict = judge(&params.law(), ring(&raw), ring(&filtered), self.motion);
        let stamp = self.filtered.map_or(now, |filtered| filtered.stamp);
        if let Some(remembered) = self.remembered(params, &filtered, stamp) {
            verdict.forward &= remembered.forward;
            verdict.linear_max = verdict.linear_max.min(remembered.linear_max);
            verdict.danger = verdict.danger.max(remembered.danger);
            if remembered.nearest < verdict.nearest {
                (verdict.nearest, verdict.nearest_bearing) = (remembered.nearest, remembered.nearest_bearing);
            }
        }
        self.touch(params, &raw, &filtered, &mut verdict);
        let offer = self.avoid(params, &mut verdict, now);
        let nothing_heard =
            [ring(&raw), ring(&filtered)].iter().all(|ring: &Ring<'_>| ring.echoes().next().is_none());
        let safety = Safety {
            danger: verdict.danger,
            linear_max: verdict.linear_max,
            wider: verdict.wider,
            nearest: verdict.nearest,
            nearest_bearing: verdict.nearest_bearing,
            narrow: verdict.narrow,
            blind: nothing_heard,
        };
        (safety, offer)
    }

    /// What it remembers counts as well as what it hears: there it is known where in its cone an echo came from.
    fn remembered(&mut self, params: &SafetyParams, filtered: &Ranges, stamp: Time) -> Option<Way> {
        let pose = self.pose?;
        if self.mapped != Some(stamp) {
            self.map.set_params(MapParams {
                rim: params.radius,
                cone: params.cone,
                keep: params.remember,
                ..MapParams::default()
            });
            self.map.update(echoes(filtered), self.heard_at.unwrap_or(pose), stamp);
            self.mapped = Some(stamp);
        }
        let points = self.map.around(pose, params.radius + params.horizon, stamp, 1).take(POINTS);
        self.points.clear();
        // Going through all of them at once, from the inside, is cheaper than asking for one after another.
        that_count(points).for_each(|point| self.points.push(point));
        (!self.points.is_empty()).then(|| judge_way(&params.law(), Ring::Beams(&self.points), self.motion))
    }

    /// With something obliquely ahead as near as can be told it creeps, and past it, beside it, it goes slowly, the more so while it turns
    /// to it; with that in front it may be nearer than told, and it stands. An echo from there that the filter does not yet believe is
    /// believed where the last one came from afar: a false one seldom falls just there, and a smooth thing that was silent until now may
    /// be silent again.
    fn touch(&self, params: &SafetyParams, raw: &Ranges, filtered: &Ranges, verdict: &mut Verdict) {
        let close = f64::from(filtered.range_min).max(params.radius + params.touch);
        if echoes(filtered).any(|(bearing, range)| range <= close && wrap(bearing).abs() < IN_FRONT) {
            (verdict.forward, verdict.linear_max) = (false, 0.0);
        }
        let touched = |(bearing, range): (f64, f64)| {
            range - params.radius <= params.touch && wrap(bearing).abs() <= OBLIQUE
        };
        let afar =
            |i: usize| filtered.values.get(i).is_none_or(|range| f64::from(*range) > params.radius + AFAR);
        let appeared = (0..).zip(bearings(raw)).filter(|(i, _)| afar(*i)).map(|(_, echo)| echo);
        if echoes(filtered).chain(appeared).chain(self.points.iter().copied()).any(touched) {
            verdict.linear_max = verdict.linear_max.min(params.creep);
        } else if verdict.nearest <= params.touch && verdict.nearest_bearing.abs() <= BESIDE {
            // Nearer than a sonar tells it is where it was heard before, and its cone is as wide as what is left.
            let untold = params.radius + verdict.nearest < f64::from(filtered.range_min);
            let ahead = verdict.nearest_bearing.abs() < PI / 2.0;
            let turns_to_it = self.motion.angular * verdict.nearest_bearing.signum() > TURNING;
            let speed = if untold && ahead && turns_to_it { params.avoid_speed } else { params.pass };
            verdict.linear_max = verdict.linear_max.min(speed);
        }
    }

    /// Away from what is near. It goes on to the side to which it turns already, else to the wider one, and keeps to that for as long as
    /// the danger lasts: to choose anew at every reading is to dither before a pillar.
    fn avoid(&mut self, params: &SafetyParams, verdict: &mut Verdict, now: Time) -> Option<Offer> {
        if verdict.danger < params.avoid_from {
            self.side = 0.0;
            return None;
        }
        if self.motion.angular.abs() > TURNING {
            self.side = self.motion.angular.signum();
        } else if self.side == 0.0 {
            self.side = if verdict.wider < 0.0 { -1.0 } else { 1.0 };
        }
        verdict.wider = self.side;
        // With room ahead it is no wall but a neighbour: the nearer it is in front, the harder the turn.
        let turn = if verdict.forward { params.avoid_turn * verdict.danger } else { params.avoid_turn };
        let close = verdict.nearest <= params.touch;
        let speed = if close { 0.0 } else { verdict.linear_max.min(params.avoid_speed) };
        Some(Offer {
            twist: Twist::new(speed, self.side * turn),
            weight: verdict.danger,
            valid_until: now + params.hold,
            form: Drive::Numeric,
            ..Offer::default()
        })
    }
}

/// Bearing (rad) and distance (m) of the points that count: what is behind is in no way, and counts only where it is nearest.
fn that_count(points: impl Iterator<Item = Point>) -> impl Iterator<Item = (f64, f64)> {
    let mut nearest = f64::INFINITY;
    points.filter_map(move |point| {
        // Most of what is behind is farther off than something else, and to see that takes no root.
        if point.x < -HAIR && !point.is_within(nearest) {
            return None;
        }
        let range = point.norm();
        let counts = point.x >= -HAIR || range < nearest;
        nearest = nearest.min(range);
        counts.then(|| (point.bearing(), range))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::blank;

    /// Twelve directions; `front` straight ahead, `left` and `right` in the three of each side, 4 m elsewhere.
    fn around(front: f32, left: f32, right: f32) -> Ranges {
        let mut ranges = blank(12, 0.3, 6.2);
        ranges.values.fill(4.0);
        ranges.values[0] = front;
        ranges.values[2..=4].fill(left);
        ranges.values[8..=10].fill(right);
        ranges
    }

    fn watch(ranges: Ranges) -> Watch {
        Watch { filtered: Some(Dated { value: ranges, stamp: Time::ZERO }), ..Watch::default() }
    }

    #[test]
    fn too_close_ahead_it_turns_to_the_wider_side_and_does_not_move() {
        for (left, right, side) in [(3.0, 0.6, 1.0), (0.6, 3.0, -1.0)] {
            let (safety, offer) =
                watch(around(0.38, left, right)).judge(&SafetyParams::default(), Time::ZERO);
            let offer = offer.unwrap();
            assert_eq!((safety.linear_max, offer.twist.linear), (0.0, 0.0));
            assert!(offer.weight > 0.85, "{}", offer.weight);
            assert_eq!(offer.twist.angular, side * 0.7);
        }
    }

    #[test]
    fn once_it_turns_away_it_keeps_the_side_until_the_danger_is_over() {
        let params = SafetyParams::default();
        let mut watch = watch(around(0.4, 3.0, 2.9));
        let mut turn = |front, left, right| {
            watch.filtered = Some(Dated { value: around(front, left, right), stamp: Time::ZERO });
            watch.judge(&params, Time::ZERO).1.map(|offer| offer.twist.angular.signum())
        };
        let turns = [turn(0.4, 3.0, 2.9), turn(0.4, 1.4, 1.5), turn(4.0, 4.0, 4.0), turn(0.4, 1.4, 1.5)];
        assert_eq!(turns, [Some(1.0), Some(1.0), None, Some(-1.0)]);
    }

    #[test]
    fn old_ranges_are_none() {
        let mut watch = watch(around(4.0, 4.0, 4.0));
        let params = SafetyParams::default();
        assert!(!watch.judge(&params, Time::ZERO + params.stale).0.blind);
        let (safety, offer) = watch.judge(&params, Time::ZERO + params.stale + Duration::nanos(1));
        assert!(safety.blind && safety.linear_max == 0.0 && safety.danger == 1.0 && offer.is_none());
    }

    #[test]
    fn what_no_sensor_hears_any_more_still_stops_it() {
        let params = SafetyParams::default();
        let mut watch = watch(around(0.7, 4.0, 4.0));
        watch.pose = Some(Pose::default());
        watch.judge(&params, Time::ZERO);
        // A smooth box that is silent now, and a robot that has come nearer.
        let later = Time::from_seconds(2.0);
        watch.filtered = Some(Dated { value: around(6.2, 4.0, 4.0), stamp: later });
        watch.pose = Some(Pose::new(0.4, 0.0, 0.0));
        assert_eq!(watch.judge(&params, later).0.linear_max, 0.0);
        let unaware = SafetyParams { remember: Duration::ZERO, ..params };
        let later = Time::from_seconds(2.1);
        watch.filtered = Some(Dated { value: around(6.2, 4.0, 4.0), stamp: later });
        assert!(watch.judge(&unaware, later).0.linear_max > 0.0);
    }

    #[test]
    fn points_that_do_not_count_change_no_verdict() {
        let stream = types::chance::Stream::new(1, "points");
        let law = SafetyParams::default().law();
        let mut left_out = 0;
        for run in 0..500 {
            let draw = stream.sample(run);
            let points = (0..20)
                .map(|k| Point::new(draw.between(2 * k, -1.5, 1.5), draw.between(2 * k + 1, -1.5, 1.5)));
            let all: Vec<_> = points.clone().map(|point| (point.bearing(), point.norm())).collect();
            let some: Vec<_> = that_count(points).collect();
            let motion = Twist::new(draw.between(100, -0.1, 0.6), draw.between(101, -1.0, 1.0));
            let judged = |points: &[(f64, f64)]| judge_way(&law, Ring::Beams(points), motion);
            assert_eq!(judged(&some), judged(&all), "run {run}");
            left_out += all.len() - some.len();
        }
        assert!(left_out > 2000, "{left_out}");
    }

    #[test]
    fn it_creeps_up_to_something_close_obliquely_ahead_and_goes_slowly_past_it() {
        let params = SafetyParams::default();
        let close = |beam: usize, range| {
            let mut ranges = around(4.0, 4.0, 4.0);
            ranges.values[beam] = range;
            watch(ranges).judge(&params, Time::ZERO).0.linear_max
        };
        // At 60°, at 90° and at 120°.
        assert_eq!([2, 3, 4].map(|beam| close(beam, 0.375)), [0.1, 0.35, 0.6]);
        assert_eq!([10, 9, 8].map(|beam| close(beam, 0.375)), [0.1, 0.35, 0.6]);
        assert_eq!([2, 3].map(|beam| close(beam, 0.45)), [0.6, 0.6]);
    }

    #[test]
    fn past_what_is_nearer_than_a_sonar_tells_it_goes_slower_while_it_turns_to_it() {
        let params = SafetyParams { creep: 0.1, avoid_speed: 0.2, pass: 0.35, ..SafetyParams::default() };
        // Heard at 80° on the left, 0.16 m from the rim; a step to the left later it is 0.12 m away, and silent.
        let fastest = |angular, moved| {
            let mut ranges = Ranges { range_min: 0.375, ..around(6.2, 6.2, 6.2) };
            ranges.values.fill(6.2);
            ranges.values[3] = 0.385;
            let mut watch = watch(ranges);
            watch.pose = Some(Pose::default());
            watch.judge(&params, Time::ZERO);
            ranges.values[3] = 4.0;
            let later = Time::from_seconds(0.25);
            watch.filtered = Some(Dated { value: ranges, stamp: later });
            watch.pose = Some(Pose::new(-0.08, moved, 0.0));
            watch.motion = Twist::new(0.0, angular);
            watch.judge(&params, later).0.linear_max
        };
        assert_eq!([fastest(0.0, 0.04), fastest(-0.3, 0.04), fastest(0.3, 0.04)], [0.35, 0.35, 0.2]);
        // As far as a sonar tells it is known how near it is.
        assert_eq!(fastest(0.3, -0.01), 0.35);
    }

    #[test]
    fn what_appears_close_obliquely_ahead_out_of_silence_is_believed_at_once() {
        let params = SafetyParams::default();
        // At 60°, where the filter still has silence, or something half a metre from the rim, of which near echoes may be false.
        let fastest = |filtered: f32| {
            let mut ranges = around(4.0, 4.0, 4.0);
            ranges.values[2] = filtered;
            let mut watch = watch(ranges);
            ranges.values[2] = 0.375;
            watch.raw = Some(Dated { value: ranges, stamp: Time::ZERO });
            watch.judge(&params, Time::ZERO).0.linear_max
        };
        assert_eq!([6.2, 4.0, 0.7].map(fastest), [params.creep, params.creep, 0.6]);
    }

    #[test]
    fn what_is_remembered_obliquely_ahead_counts_although_something_beside_it_is_nearer() {
        let params = SafetyParams::default();
        let mut near = around(4.0, 4.0, 4.0);
        (near.values[2], near.values[3]) = (0.385, 0.375);
        let mut watch = watch(near);
        watch.pose = Some(Pose::default());
        watch.judge(&params, Time::ZERO);
        near.values[2] = 6.2;
        let later = Time::from_seconds(0.25);
        watch.filtered = Some(Dated { value: near, stamp: later });
        assert_eq!(watch.judge(&params, later).0.linear_max, params.creep);
    }

    #[test]
    fn it_goes_on_turning_to_the_side_to_which_it_turns_already() {
        let side = |angular| {
            let mut watch = watch(around(0.38, 3.0, 0.6));
            watch.motion = Twist::new(0.0, angular);
            let (safety, offer) = watch.judge(&SafetyParams::default(), Time::ZERO);
            (safety.wider, offer.unwrap().twist.angular)
        };
        assert_eq!((side(-0.3), side(0.1)), ((-1.0, -0.7), (1.0, 0.7)));
    }

    #[test]
    fn a_raw_echo_right_ahead_forbids_to_move_before_the_filter_believes_it() {
        let mut watch = watch(around(4.0, 4.0, 4.0));
        watch.raw = Some(Dated { value: around(0.32, 4.0, 4.0), stamp: Time::ZERO });
        assert_eq!(watch.judge(&SafetyParams::default(), Time::ZERO).0.linear_max, 0.0);
    }
}
