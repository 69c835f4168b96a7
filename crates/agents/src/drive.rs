//! The drive: the agent in front of the wheels. What cannot or must not be driven does not pass.
//!
//! ```text
//!  words, offers of people ─▶ fusion ─┐ while one holds
//!  wish of the coordinator ───────────┴─▶ safety ─▶ limits ─▶ reflex ─▶ command ─▶ gate of the robot
//! ```
//!
//! The order of authority is safety, then people, then the robot's own wishes. The gate behind it stands above all of them.

use motion::fusion::{self, Cause, Held, Moment, Veto, fuse};
use motion::kinematics::{Differential, is_finite};
use motion::limits::{Cuts, Forward, Limits, limit};
use motion::safety::aged;
use runtime::{Agent, Fault, Input, Output, Step};
use types::messages::{Odometry, Offer, Safety, Twist};
use types::params::Params;
use types::{Duration, Time};

use crate::shared::{Dated, Offers};

/// What the drive can do.
#[derive(Clone, Debug, Params)]
pub struct DriveParams {
    /// Highest forward speed (m/s). 0.6 is a slow walk, so people can step aside.
    #[param(default = 0.6, min = 0.0, max = 10.0)]
    pub linear_max: f64,
    /// Highest backward speed (m/s). 0.3: few robots see well behind.
    #[param(default = 0.3, min = 0.0, max = 10.0)]
    pub backward_max: f64,
    /// Highest turn rate (rad/s). 1 turns around in three seconds and smears no picture.
    #[param(default = 1.0, min = 0.0, max = 20.0)]
    pub angular_max: f64,
    /// Highest rate at which the speed may grow (m/s²). 0.5 starts without slip on a smooth floor.
    #[param(default = 0.5, min = 0.01, max = 20.0)]
    pub acceleration: f64,
    /// Highest rate at which the speed may fall (m/s²). 1 does not tip a tall body; safety counts on it.
    #[param(default = 1.0, min = 0.01, max = 20.0)]
    pub deceleration: f64,
    /// Highest rate at which the turn rate may change (rad/s²). 3 is at full turn rate after a third of a second.
    #[param(default = 3.0, min = 0.01, max = 100.0)]
    pub angular_acceleration: f64,
    /// Radius of a wheel (m). 0.075 is that of the exploring robot.
    #[param(default = 0.075, min = 0.005, max = 1.0)]
    pub wheel_radius: f64,
    /// From wheel to wheel (m). 0.36 is that of the exploring robot.
    #[param(default = 0.36, min = 0.01, max = 3.0)]
    pub track: f64,
    /// Highest turn rate of a wheel (rad/s). 10 is what the motors of the exploring robot can do.
    #[param(default = 10.0, min = 0.1, max = 1000.0)]
    pub wheel_max: f64,
    /// A wish older than this is standing still (time). 300 ms is six steps of a coordinator at 20 Hz.
    #[param(default = Duration::millis(300), min = 0.01, max = 10.0)]
    pub wish_age: Duration,
    /// A verdict of the safety monitor older than this forbids to move forward (time). 700 ms is two missed readings of a sonar at 4 Hz.
    #[param(default = Duration::millis(700), min = 0.01, max = 60.0)]
    pub safety_age: Duration,
    /// After so long a new verdict was due: from then on the old one allows less and less, as braking makes it (time). 300 ms is a period of a
    /// sonar at 4 Hz and a step of the drive.
    #[param(default = Duration::millis(300), min = 0.01, max = 60.0)]
    pub safety_due: Duration,
    /// How long a reflex bounds the motion (time). 300 ms outlasts one period of a sonar at 4 Hz.
    #[param(default = Duration::millis(300), min = 0.0, max = 10.0)]
    pub reflex_hold: Duration,
    /// Whether it stands while no reflex says how fast it may drive: then whoever sends the reflex must not fall silent. An emergency stop speaks in
    /// each of its steps, the reflex of a sonar only when it has something to say.
    #[param(default = false)]
    pub reflex_needed: bool,
    /// Change of speed for the greatest "speed up" (m/s). 0.3: no one word takes it from rest to full speed.
    #[param(default = 0.3, min = 0.0, max = 10.0)]
    pub speed_change: f64,
}

impl DriveParams {
    fn limits(&self) -> Limits {
        Limits {
            linear_max: self.linear_max,
            backward_max: self.backward_max,
            angular_max: self.angular_max,
            acceleration: self.acceleration,
            deceleration: self.deceleration,
            angular_acceleration: self.angular_acceleration,
            wheel_max: self.wheel_max,
            drive: Differential::new(self.wheel_radius, self.track),
        }
    }

    fn fusion(&self) -> fusion::Parameters {
        fusion::Parameters {
            linear_max: self.linear_max,
            angular_max: self.angular_max,
            speed_change: self.speed_change,
            // An order of a person holds as long as the person said, and no longer.
            hold: Duration::ZERO,
            ..fusion::Parameters::default()
        }
    }
}

/// Passes to the wheels what they can do of what is wished: people before the robot's own wishes, safety before people, and a reflex
/// that can only slow or stop.
#[derive(Agent)]
#[agent(kind = "drive")]
pub struct DriveBase {
    /// What the coordinator chose.
    wish: Input<Twist>,
    /// Orders of people, in numbers or in words such as "turn right a little bit"; while one holds, the coordinator is not heard.
    words: Input<Offer>,
    /// What is allowed. Once wired, its silence forbids to move forward.
    safety: Input<Safety>,
    /// A bound from a sensor: each part of the motion is at most as fast as that of the reflex. It can only slow or stop.
    reflex: Input<Twist>,
    /// How the robot really moves, from its wheels.
    odometry: Input<Odometry>,
    /// What the wheels shall do.
    #[robot("drive")]
    #[port(history = 64)]
    command: Output<Twist>,
    /// How the robot really moves.
    #[port(history = 64)]
    state: Output<Twist>,
    params: DriveParams,
    hands: Hands,
}

impl Agent for DriveBase {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        let now = step.now;
        while let Some(offer) = self.words.take() {
            self.hands.orders.put(offer.header().sender, *offer, now);
        }
        if let Some(received) = self.wish.newest() {
            self.hands.wish = Some(Dated { value: *received, stamp: received.header().stamp });
        }
        if let Some(received) = self.safety.newest() {
            self.hands.safety = Some(Dated { value: *received, stamp: received.header().stamp });
        }
        while let Some(received) = self.reflex.take() {
            self.hands.reflex = Some(Dated { value: *received, stamp: received.header().stamp });
        }
        if let Some(odometry) = self.odometry.latest() {
            self.hands.motion = Some(odometry.twist);
        }
        let command = self.hands.command(&self.params, self.safety.is_wired(), now);
        self.command.send(command);
        self.state.send(self.hands.motion.unwrap_or(command));
        Ok(())
    }
}

/// The wheels are told to turn (m/s), and do not (m/s).
const TOLD: f64 = 0.05;
const STILL: f64 = 0.01;
/// After so long of that it is no lag of the motors: somebody stopped them, or nobody counts them any more.
const UNANSWERED: Duration = Duration::millis(600);
/// For so long it then stands, and for the last part of that nothing may be heard of a turn (rad/s).
const PAUSE: Duration = Duration::secs(5);
const QUIET: Duration = Duration::secs(1);
const NO_TURN: f64 = 0.05;
/// Then it tries to turn on the spot (rad/s), for as long as wheels take to answer: where nobody says how the robot moves, that leads it
/// nowhere.
const TRY: f64 = 0.4;

/// Whether the wheels do what they are told.
#[derive(Clone, Copy, Debug, Default)]
struct Answer {
    /// Since when they do not.
    told: Option<Time>,
    /// Since when the robot stands for that.
    stands: Option<Time>,
    /// Since when it tries again.
    tries: Option<Time>,
}

impl Answer {
    /// What of a wish is commanded now, after a command that the wheels answer, or do not, with `motion`.
    fn heeded(&mut self, wanted: Twist, commanded: Twist, motion: Option<Twist>, now: Time) -> Twist {
        let Some(motion) = motion else { return wanted };
        let turned = self.tries.is_some() && motion.angular > 0.5 * TRY;
        if turned || motion.linear.abs() >= STILL {
            *self = Answer::default();
            return wanted;
        }
        let Some(stands) = self.stands else {
            if commanded.linear.abs() < TOLD {
                self.told = None;
            } else if now - *self.told.get_or_insert(now) > UNANSWERED {
                runtime::note!("the wheels are told to turn and do not: standing");
                self.stands = Some(now);
                return Twist::ZERO;
            }
            return wanted;
        };
        match self.tries {
            Some(since) if now - since > UNANSWERED => (self.stands, self.tries) = (Some(now), None),
            Some(_) => {}
            // What tells of a turn while it stands tells nothing by it.
            None if now - stands > PAUSE - QUIET && motion.angular.abs() > NO_TURN => self.stands = Some(now),
            None if now - stands > PAUSE && wanted != Twist::ZERO => self.tries = Some(now),
            None => {}
        }
        if self.tries.is_some() && wanted != Twist::ZERO { Twist::new(0.0, TRY) } else { Twist::ZERO }
    }
}

/// Who wishes to drive hears how fast is safe, too, and obeys at once. One who does not for so long does not listen, or says the same
/// again and again.
const HEEDLESS: Duration = Duration::secs(1);
/// For so long it must then have obeyed before it is heard again.
const OBEYS: Duration = Duration::secs(5);

/// Whether the wishes of the coordinator obey the safety monitor.
#[derive(Clone, Copy, Debug, Default)]
struct Heed {
    /// Since when each was faster than is safe.
    faster: Option<Time>,
    /// When one was that for too long last.
    broken: Option<Time>,
}

impl Heed {
    /// Whether a wish is heard while it is safe to go as fast as `safe` (m/s).
    fn hears(&mut self, wish: Twist, safe: f64, now: Time) -> bool {
        if wish.linear > safe {
            let since = *self.faster.get_or_insert(now);
            if now - since > HEEDLESS || self.broken.is_some() {
                if self.broken.is_none() {
                    runtime::note!("the wishes go on to be faster than is safe: they are not heard");
                }
                self.broken = Some(now);
            }
        } else {
            self.faster = None;
            self.broken = self.broken.filter(|broken| now - *broken <= OBEYS);
        }
        self.broken.is_none()
    }
}

/// The longest time between two steps that the limits of acceleration are granted at once (s).
const LONGEST_STEP: f64 = 0.1;

/// What was said last, and what was commanded.
#[derive(Clone, Copy, Debug, Default)]
struct Hands {
    wish: Option<Dated<Twist>>,
    orders: Offers,
    safety: Option<Dated<Safety>>,
    reflex: Option<Dated<Twist>>,
    is_unguarded: bool,
    motion: Option<Twist>,
    answer: Answer,
    heed: Heed,
    commanded: Twist,
    cuts: Cuts,
    last: Option<Time>,
}

impl Hands {
    fn command(&mut self, params: &DriveParams, guarded: bool, now: Time) -> Twist {
        let dt = self.last.replace(now).map_or(0.0, |last| (now - last).seconds().min(LONGEST_STEP));
        let veto = self.veto(params, guarded, now);
        let mut wanted = self.wanted(params, &veto, now);
        let forward = if veto.forward { Forward::Allowed } else { Forward::Forbidden };
        if wanted.linear > veto.linear_max {
            // Slower on the same path.
            wanted = motion::kinematics::scaled(wanted, veto.linear_max.max(0.0) / wanted.linear);
        }
        wanted = self.answer.heeded(wanted, self.commanded, self.motion, now);
        let limited = limit(&params.limits(), wanted, self.commanded, forward, dt);
        self.cuts = limited.cuts;
        let bound = Dated::fresh(&self.reflex, now, params.reflex_hold);
        let is_unguarded = params.reflex_needed && bound.is_none();
        if is_unguarded && !self.is_unguarded {
            runtime::note!("nobody says how fast it may drive: standing");
        }
        self.is_unguarded = is_unguarded;
        self.commanded = match bound {
            Some(bound) => bounded(limited.twist, bound),
            None if is_unguarded => Twist::ZERO,
            None => limited.twist,
        };
        self.commanded
    }

    /// The orders of people while one holds, else the wish of the coordinator while it is fresh, else nothing.
    fn wanted(&mut self, params: &DriveParams, veto: &Veto, now: Time) -> Twist {
        self.orders.forget_expired(now);
        let moment = Moment { now, present: self.motion.unwrap_or(self.commanded), veto: *veto };
        let orders = self.orders.weighed(|_| 1.0);
        let fused = fuse(&params.fusion(), orders, &moment, &mut Held::default());
        match fused.cause {
            Cause::Offers | Cause::Stop => fused.twist,
            Cause::Held | Cause::Silence => {
                let wish = Dated::fresh(&self.wish, now, params.wish_age).unwrap_or(Twist::ZERO);
                let safe = if veto.forward { veto.linear_max } else { 0.0 };
                if self.heed.hears(wish, safe, now) { wish } else { Twist::ZERO }
            }
        }
    }

    fn veto(&self, params: &DriveParams, guarded: bool, now: Time) -> Veto {
        match Dated::fresh(&self.safety, now, params.safety_age) {
            Some(safety) => {
                let age = self.safety.map_or(Duration::ZERO, |heard| now - heard.stamp);
                let due = params.safety_due.seconds();
                let linear_max = aged(safety.linear_max, age.seconds(), due, params.deceleration);
                Veto { forward: !safety.blind && linear_max > 0.0, linear_max, wider: safety.wider }
            }
            None if guarded => Veto { forward: false, ..Veto::NONE },
            None => Veto::NONE,
        }
    }
}

/// Each part at most as fast as that of the bound; a bound that is no number stops.
fn bounded(twist: Twist, bound: Twist) -> Twist {
    if !is_finite(bound) {
        return Twist::ZERO;
    }
    let part = |value: f64, most: f64| value.clamp(-most.abs(), most.abs());
    Twist::new(part(twist.linear, bound.linear), part(twist.angular, bound.angular))
}

#[cfg(test)]
mod tests {
    use super::*;
    use motion::word;
    use types::AgentId;
    use types::messages::Drive;

    fn at(millis: i64) -> Time {
        Time::ZERO + Duration::millis(millis)
    }

    fn dated<T>(value: T) -> Option<Dated<T>> {
        Some(Dated { value, stamp: Time::ZERO })
    }

    /// What is commanded after a tenth of a second, from driving at 0.3 m/s.
    fn after(mut hands: Hands, guarded: bool) -> Twist {
        hands.commanded = Twist::new(0.3, 0.0);
        hands.last = Some(Time::ZERO);
        hands.command(&DriveParams::default(), guarded, at(100))
    }

    fn words(text: &str) -> Offer {
        let word = word::parse(text).unwrap();
        Offer { word, weight: 1.0, valid_until: at(1000), form: Drive::Linguistic, ..Offer::default() }
    }

    /// What is commanded in steps of 20 ms while `wheels` say of each command, at its time in ms, how the robot moves.
    fn driven(millis: i64, wheels: impl Fn(i64, Twist) -> Twist) -> Vec<Twist> {
        let mut hands = Hands { motion: Some(Twist::new(0.2, 0.0)), ..Hands::default() };
        (0..millis)
            .step_by(20)
            .map(|time| {
                hands.wish = Some(Dated { value: Twist::new(0.3, 0.2), stamp: at(time) });
                let command = hands.command(&DriveParams::default(), false, at(time));
                hands.motion = Some(wheels(time, command));
                command
            })
            .collect()
    }

    #[test]
    fn where_nobody_says_how_it_moves_it_drives_for_less_than_a_second_and_then_turns_on_the_spot_now_and_then()
     {
        let commands = driven(60_000, |_, _| Twist::ZERO);
        let way: f64 = commands.iter().map(|command| command.linear * 0.02).sum();
        assert!((0.1..0.35).contains(&way), "{way} m");
        assert!(commands[80..].iter().all(|command| command.linear == 0.0));
        let tries = commands.windows(2).filter(|two| two[0].angular <= 0.0 && two[1].angular > 0.0).count();
        assert!((9..12).contains(&tries), "{tries} in a minute");
        // Nor is it moved by one who says at all times that it turns.
        let commands = driven(60_000, |_, _| Twist::new(0.0, 0.5));
        assert!(commands[80..].iter().all(|command| *command == Twist::ZERO));
    }

    #[test]
    fn a_verdict_that_no_newer_one_follows_allows_less_and_less() {
        let allowed = |age| {
            let safety = Safety { linear_max: 0.4, ..Safety::default() };
            let hands = Hands { safety: dated(safety), ..Hands::default() };
            let veto = hands.veto(&DriveParams::default(), true, at(age));
            (veto.forward, (veto.linear_max * 1000.0).round())
        };
        // From 0.3 s on it brakes by 1 m/s².
        assert_eq!(
            [0, 300, 400, 650].map(allowed),
            [(true, 400.0), (true, 400.0), (true, 300.0), (true, 50.0)]
        );
        assert_eq!([701, 5000].map(|age| allowed(age).0), [false, false]);
    }

    #[test]
    fn wheels_that_answer_again_are_driven_again() {
        // Locked for ten seconds, as behind a latch that is set.
        let commands = driven(30_000, |time, told| if time < 10_000 { Twist::ZERO } else { told });
        assert!(commands[100..500].iter().all(|command| command.linear == 0.0));
        assert!(commands[900..].iter().all(|command| command.linear > 0.29));
    }

    #[test]
    fn a_wish_is_followed_as_fast_as_the_wheels_allow() {
        let hands = Hands { wish: dated(Twist::new(0.6, 0.0)), ..Hands::default() };
        assert!((after(hands, false).linear - 0.35).abs() < 1e-12, "0.5 m/s² for 0.1 s");
        let nonsense = Hands { wish: dated(Twist::new(f64::NAN, 1.0)), ..Hands::default() };
        assert!((after(nonsense, false).linear - 0.2).abs() < 1e-12, "braking at 1 m/s²");
    }

    #[test]
    fn an_old_wish_is_standing_still() {
        let mut hands = Hands { wish: dated(Twist::new(0.3, 0.0)), ..Hands::default() };
        let params = DriveParams::default();
        hands.command(&params, false, at(0));
        let mut command = |millis: i64| hands.command(&params, false, at(millis)).linear;
        let driving = (1..=6).map(|i| command(50 * i)).last().unwrap();
        assert!((driving - 0.15).abs() < 1e-12, "{driving}");
        let stopped = (7..=13).map(|i| command(50 * i)).last().unwrap();
        assert_eq!(stopped, 0.0);
    }

    #[test]
    fn people_come_before_the_robots_wish_and_safety_before_people() {
        let mut hands = Hands { wish: dated(Twist::new(0.3, 0.0)), ..Hands::default() };
        hands.orders.put(AgentId(7), words("turn right"), Time::ZERO);
        let turned = after(hands, false);
        assert!(turned.angular < -0.2, "{turned:?}");
        hands.orders.put(AgentId(7), words("stop"), Time::ZERO);
        assert!((after(hands, false).linear - 0.2).abs() < 1e-12);
        hands.orders.put(AgentId(7), words("go forward"), Time::ZERO);
        assert!(after(hands, false).linear > 0.3);
        assert!(after(hands, true).linear < 0.21, "safety was not heard");
        hands.safety = dated(Safety { linear_max: 0.25, ..Safety::default() });
        assert!((after(hands, true).linear - 0.25).abs() < 1e-12);
    }

    #[test]
    fn wishes_that_do_not_obey_safety_are_not_heard_until_they_have_obeyed_for_long() {
        let params = DriveParams::default();
        let mut hands = Hands::default();
        let mut speed = |millis: i64, wish: f64, safe: f64| {
            hands.wish = Some(Dated { value: Twist::new(wish, 0.0), stamp: at(millis) });
            hands.safety =
                Some(Dated { value: Safety { linear_max: safe, ..Safety::default() }, stamp: at(millis) });
            hands.command(&params, true, at(millis)).linear
        };
        let mut last = |from: i64, to: i64, wish, safe| {
            (from / 50..to / 50).map(|i| speed(50 * i, wish, safe)).last().unwrap()
        };
        assert_eq!(last(0, 1000, 0.4, 0.1), 0.1, "slowed, and perhaps a little late");
        assert_eq!(last(1000, 1500, 0.4, 0.1), 0.0);
        assert_eq!(last(1500, 3000, 0.4, 0.6), 0.0, "that it is safe now makes it no better");
        assert!(last(3000, 9000, 0.4, 0.6) > 0.39);
    }

    #[test]
    fn a_drive_that_needs_a_reflex_stands_while_nobody_says_how_fast_it_may_drive() {
        let params = DriveParams { reflex_needed: true, acceleration: 100.0, ..DriveParams::default() };
        let mut hands = Hands::default();
        let mut command = |millis: i64, reflex: bool| {
            let now = Time::ZERO + Duration::millis(millis);
            hands.wish = Some(Dated { value: Twist::new(0.3, 0.0), stamp: now });
            if reflex {
                hands.reflex = Some(Dated { value: Twist::new(1e3, 1e3), stamp: now });
            }
            hands.command(&params, false, now).linear
        };
        assert_eq!((command(0, false), command(20, false)), (0.0, 0.0), "nobody has spoken yet");
        assert!(command(40, true) > 0.0 && command(60, true) > 0.0);
        assert!(command(360, false) > 0.0, "the last word counts for 300 ms");
        assert_eq!((command(380, false), command(400, false)), (0.0, 0.0));
        assert!(command(420, true) > 0.0, "and it goes on when somebody speaks again");
    }

    #[test]
    fn a_reflex_slows_and_stops_but_never_drives() {
        let wish = dated(Twist::new(0.3, 0.2));
        let with = |reflex: Twist| after(Hands { wish, reflex: dated(reflex), ..Hands::default() }, false);
        assert_eq!(with(Twist::ZERO), Twist::ZERO, "at once, whatever the limits of braking");
        assert_eq!(with(Twist::new(0.1, 5.0)).linear, 0.1);
        assert_eq!(with(Twist::new(f64::NAN, 0.0)), Twist::ZERO);
        let standing = Hands { reflex: dated(Twist::new(0.5, 0.5)), ..Hands::default() };
        assert!(after(standing, false).linear <= 0.2 + 1e-12, "nobody wished to move");
    }
}
