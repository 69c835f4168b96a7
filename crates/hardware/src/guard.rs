//! What a gate lets through: a pure function of commands, time, latch and bumper.

use motion::limits::{Cuts, Forward, Limits, limit};
use types::messages::Twist;
use types::{Duration, Priority, Time};

use crate::latch::LatchState;

/// Who commands. The higher one is obeyed while its command is fresh. The latch stands above all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Authority {
    /// The robot's own agents.
    #[default]
    Robot = 0,
    /// A person with a joystick, a page or a word.
    Person = 1,
    /// A referee, or an emergency.
    Referee = 2,
}

impl Authority {
    /// The authority that a message claims by its priority: urgent for a referee, high for a person.
    pub const fn of(priority: Priority) -> Authority {
        match priority {
            Priority::Urgent => Authority::Referee,
            Priority::High => Authority::Person,
            Priority::Normal | Priority::Low => Authority::Robot,
        }
    }
}

/// What can be set of a guard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Policy {
    /// A command older than this is zero. 300 ms: three periods of a slow controller, and 0.2 m at a walking pace.
    pub age_limit: Duration,
    /// No faster than this forward or backward (m/s). Infinite: as fast as the robot can.
    pub linear_max: f64,
    /// No faster turns than this (rad/s). Infinite: as fast as the robot can.
    pub angular_max: f64,
    /// Whether somebody who is not the one who commands says how fast is safe. Then nobody goes forward faster, and without a fresh word
    /// of it nobody goes forward at all.
    pub guarded: bool,
    /// Such a word older than this allows nothing. 700 ms is two missed readings of a sonar at 4 Hz.
    pub safety_age: Duration,
    /// How fast the speed falls to what is safe (m/s²). 1 does not tip a tall body.
    pub braking: f64,
}

impl Default for Policy {
    fn default() -> Policy {
        Policy {
            age_limit: Duration::millis(300),
            linear_max: f64::INFINITY,
            angular_max: f64::INFINITY,
            guarded: false,
            safety_age: Duration::millis(700),
            braking: 1.0,
        }
    }
}

/// Why a command was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// It holds a NaN or an infinity. The robot stands at once.
    NotFinite,
    /// The latch is set.
    Latched,
    /// It was made before the latch was seen to be reset.
    BeforeReset,
    /// It was too old when it came.
    Stale,
}

/// Which ways contact bars.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Contact {
    /// Something touches the front.
    pub ahead: bool,
    /// Something touches the back.
    pub behind: bool,
}

impl Contact {
    /// What pressed sectors bar: a sector bars the way to whose half it belongs, one that looks square to the side none.
    pub fn of(pressed: u32, sectors: u32) -> Contact {
        let mut contact = Contact::default();
        for sector in (0..sectors.min(32)).filter(|sector| pressed & (1 << sector) != 0) {
            let cosine = ahead_of(sector, sectors);
            contact.ahead |= cosine > 1e-9;
            contact.behind |= cosine < -1e-9;
        }
        contact
    }
}

/// How far ahead the middle of a sector lies on a ring of radius 1.
fn ahead_of(sector: u32, sectors: u32) -> f64 {
    types::Point::polar(1.0, types::geometry::TAU * f64::from(sector) / f64::from(sectors)).x
}

/// Why the wheels do what they do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reason {
    /// Nobody commands.
    Idle,
    /// The latch is set.
    Latched,
    /// The last command has become too old, in this very decision.
    Stale,
    /// A command is followed; what was cut of it.
    Followed(Authority, Cuts),
    /// A command is followed, more slowly: it wanted to go forward faster than is safe.
    Slowed(Authority),
}

/// A decision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Verdict {
    /// What goes to the wheels.
    pub twist: Twist,
    /// Why.
    pub reason: Reason,
}

#[derive(Clone, Copy, Debug)]
struct Held {
    /// Nothing for a command that was not finite: the robot stands while it would have been fresh.
    twist: Option<Twist>,
    stamp: Time,
}

/// The rules of a gate.
///
/// ```text
///   offer ──▶ one place per authority ──▶ latch? ──▶ age? ──▶ contact? ──▶ limits ──▶ safe? ──▶ wheels
///                                          zero      next     no way        cut       slower
///                                                  authority  there
/// ```
///
/// What is safe comes past all who command ([`allow`](Self::allow)), so nothing that goes wrong with them reaches a wall: a command that is
/// said again and again is fresh, finite and within all limits, and still wrong.
///
/// Nothing in it allocates, waits, or reads a clock.
#[derive(Clone, Debug)]
pub struct Guard {
    limits: Limits,
    policy: Policy,
    held: [Option<Held>; 3],
    resets: Option<u64>,
    /// Commands up to this time were made before a reset was seen.
    barrier: Option<Time>,
    /// What was decided last, and when.
    last: Twist,
    decided: Option<Time>,
    /// What was decided before this instant, and how long before: several decisions at one instant replace each other.
    before: Twist,
    since: Duration,
    safe: Safe,
}

/// How fast is safe.
#[derive(Clone, Copy, Debug, Default)]
struct Safe {
    /// The last word of it (m/s), and of when it is.
    said: Option<(f64, Time)>,
    /// What counted of it last (m/s).
    speed: f64,
    fall: Option<Fall>,
}

/// It has become less, and the robot may still be faster.
#[derive(Clone, Copy, Debug)]
struct Fall {
    since: Time,
    /// How fast was safe before (m/s).
    from: f64,
    /// How fast the robot was at most when it heard of it (m/s).
    fastest: f64,
}

/// For so long whoever commands may be behind what is safe: two periods of a drive at 50 Hz. It should be the one who brakes, as it keeps
/// the robot on its path.
const GRACE: Duration = Duration::millis(40);

/// The time that a change may have taken where nobody knows it: at the first decision, and when the clock was turned back.
const USUAL_STEP: Duration = Duration::millis(10);
/// A change may have taken no longer than this: after a stall of the thread nobody may jump to full speed.
const LONGEST_STEP: Duration = Duration::millis(100);

impl Guard {
    /// A guard that stands and waits for a command.
    pub fn new(limits: Limits, policy: Policy) -> Guard {
        Guard {
            limits,
            policy,
            held: [None; 3],
            resets: None,
            barrier: None,
            last: Twist::ZERO,
            decided: None,
            before: Twist::ZERO,
            since: USUAL_STEP,
            safe: Safe::default(),
        }
    }

    /// Changes what can be set.
    pub fn set_policy(&mut self, policy: Policy) {
        self.policy = policy;
    }

    /// Takes a command that was made at `stamp`. A stamp from the future counts as now.
    ///
    /// # Errors
    /// Says why it was not taken. One that is not finite takes the place of the one before it, and the robot stands.
    pub fn offer(
        &mut self,
        now: Time,
        latch: LatchState,
        authority: Authority,
        stamp: Time,
        twist: Twist,
    ) -> Result<(), Refusal> {
        self.see(now, latch);
        if latch.is_set() {
            return Err(Refusal::Latched);
        }
        let stamp = stamp.min(now);
        if self.barrier.is_some_and(|barrier| stamp <= barrier) {
            return Err(Refusal::BeforeReset);
        }
        if !self.is_fresh(now, stamp) {
            return Err(Refusal::Stale);
        }
        let finite = motion::kinematics::is_finite(twist);
        self.held[authority as usize] = Some(Held { twist: finite.then_some(twist), stamp });
        if finite { Ok(()) } else { Err(Refusal::NotFinite) }
    }

    /// Takes the word of somebody who is not the one who commands: at `stamp` it was safe to go forward as fast as `linear_max` (m/s). It
    /// can only slow or stop, and counts while the policy says that the robot is guarded. What is no number allows nothing.
    pub fn allow(&mut self, now: Time, stamp: Time, linear_max: f64) {
        self.safe.said =
            Some((if linear_max.is_finite() { linear_max.max(0.0) } else { 0.0 }, stamp.min(now)));
    }

    /// Whether a command of this authority would be followed, or a higher one stands in its way.
    pub fn is_overruled(&self, authority: Authority) -> bool {
        self.held[authority as usize + 1..].iter().any(Option::is_some)
    }

    /// What goes to the wheels now.
    pub fn decide(&mut self, now: Time, latch: LatchState, contact: Contact) -> Verdict {
        self.see(now, latch);
        if self.decided != Some(now) {
            let since = self.decided.map_or(USUAL_STEP, |decided| now - decided);
            self.since = if since < Duration::ZERO { USUAL_STEP } else { since.min(LONGEST_STEP) };
            (self.before, self.decided) = (self.last, Some(now));
        }
        if latch.is_set() {
            return self.stand(Reason::Latched);
        }
        let safe = self.safe_speed(now);
        let mut gone_stale = false;
        for authority in [Authority::Referee, Authority::Person, Authority::Robot] {
            let Some(held) = self.held[authority as usize] else { continue };
            if !self.is_fresh(now, held.stamp) {
                self.held[authority as usize] = None;
                // Falling silent after a zero is the ordinary end of a drive.
                gone_stale |= held.twist != Some(Twist::ZERO);
                continue;
            }
            return match held.twist {
                Some(twist) => self.follow(authority, twist, contact, safe),
                None => self.stand(Reason::Followed(authority, Cuts { not_finite: true, ..Cuts::default() })),
            };
        }
        self.stand(if gone_stale { Reason::Stale } else { Reason::Idle })
    }

    fn stand(&mut self, reason: Reason) -> Verdict {
        // A stop has no ramp, and what follows it begins from rest.
        (self.last, self.before) = (Twist::ZERO, Twist::ZERO);
        Verdict { twist: Twist::ZERO, reason }
    }

    fn follow(&mut self, authority: Authority, wanted: Twist, contact: Contact, safe: f64) -> Verdict {
        let mut limits = self.limits;
        limits.linear_max = limits.linear_max.min(self.policy.linear_max);
        limits.backward_max = limits.backward_max.min(self.policy.linear_max);
        limits.angular_max = limits.angular_max.min(self.policy.angular_max);
        let forward = if contact.ahead { Forward::Forbidden } else { Forward::Allowed };
        let mut limited = limit(&limits, wanted, self.before, forward, self.since.seconds());
        if contact.ahead && limited.twist.linear > 0.0 || contact.behind && limited.twist.linear < 0.0 {
            limited.twist.linear = 0.0;
            limited.cuts.forward = true;
        }
        let mut reason = Reason::Followed(authority, limited.cuts);
        if limited.twist.linear > safe {
            // Slower on the same path; a stop ends the turn as well.
            limited.twist = motion::kinematics::scaled(limited.twist, safe / limited.twist.linear);
            reason = Reason::Slowed(authority);
        }
        self.last = limited.twist;
        Verdict { twist: limited.twist, reason }
    }

    /// How fast it may go forward (m/s): as fast as is safe, and while it is faster than that, as fast as braking leaves it.
    fn safe_speed(&mut self, now: Time) -> f64 {
        if !self.policy.guarded {
            self.safe.speed = f64::INFINITY;
            return f64::INFINITY;
        }
        let is_fresh = |stamp: Time| (Duration::ZERO..=self.policy.safety_age).contains(&(now - stamp));
        let safe = self.safe.said.filter(|(_, stamp)| is_fresh(*stamp)).map_or(0.0, |(speed, _)| speed);
        let from = std::mem::replace(&mut self.safe.speed, safe);
        if safe < from && self.safe.fall.is_none() {
            self.safe.fall = Some(Fall { since: now, from, fastest: self.before.linear });
        }
        let Some(fall) = &mut self.safe.fall else { return safe };
        let late = now - fall.since - GRACE;
        if late <= Duration::ZERO {
            fall.fastest = fall.fastest.max(self.last.linear);
            return safe.max(fall.from);
        }
        let braked = fall.fastest - self.policy.braking * late.seconds();
        if self.before.linear <= safe {
            self.safe.fall = None;
        }
        safe.max(braked)
    }

    /// A command is fresh for as long as the limit says. One from the future is not: the clock has been turned back.
    fn is_fresh(&self, now: Time, stamp: Time) -> bool {
        (Duration::ZERO..=self.policy.age_limit).contains(&(now - stamp))
    }

    /// Forgets all commands when the latch is set, or was set and reset since it was last looked at.
    fn see(&mut self, now: Time, latch: LatchState) {
        let was_reset = self.resets.is_some_and(|resets| resets != latch.resets());
        self.resets = Some(latch.resets());
        if latch.is_set() || was_reset {
            self.held = [None; 3];
            (self.last, self.before) = (Twist::ZERO, Twist::ZERO);
            self.barrier = Some(self.barrier.map_or(now, |barrier| barrier.max(now)));
        }
    }
}

#[cfg(test)]
mod tests {
    use motion::Differential;
    use proptest::prelude::*;

    use super::*;
    use crate::latch::{Cause, Latch};

    fn limits() -> Limits {
        Limits::indoor(Differential::new(0.075, 0.36))
    }

    fn ms(ms: i64) -> Time {
        Time(ms * 1_000_000)
    }

    const AHEAD: Twist = Twist::new(0.3, 0.0);

    fn brisk() -> Guard {
        Guard::new(
            Limits { acceleration: 1e6, deceleration: 1e6, angular_acceleration: 1e6, ..limits() },
            Policy::default(),
        )
    }

    #[test]
    fn a_command_holds_for_its_time_and_then_is_zero() {
        let (mut guard, latch) = (brisk(), Latch::private());
        let mut at = |t: i64| guard.decide(ms(t), latch.state(), Contact::default());
        assert_eq!(at(0), Verdict { twist: Twist::ZERO, reason: Reason::Idle });
        guard.offer(ms(5), latch.state(), Authority::Robot, ms(5), AHEAD).unwrap();
        let mut at = |t: i64| guard.decide(ms(t), latch.state(), Contact::default());
        assert_eq!(at(10).twist, AHEAD);
        assert_eq!(at(305).twist, AHEAD);
        assert_eq!(at(306), Verdict { twist: Twist::ZERO, reason: Reason::Stale });
        assert_eq!(at(316), Verdict { twist: Twist::ZERO, reason: Reason::Idle });
    }

    #[test]
    fn the_referee_stands_over_the_person_and_the_person_over_the_robot() {
        let (mut guard, latch) = (brisk(), Latch::private());
        let mut offer =
            |who, t, linear| guard.offer(ms(t), latch.state(), who, ms(t), Twist::new(linear, 0.0)).unwrap();
        offer(Authority::Referee, 0, 0.0);
        offer(Authority::Person, 100, 0.1);
        offer(Authority::Robot, 200, 0.2);
        assert!(guard.is_overruled(Authority::Robot) && !guard.is_overruled(Authority::Referee));
        let mut speed = |t| guard.decide(ms(t), latch.state(), Contact::default()).twist.linear;
        assert_eq!(speed(250), 0.0);
        assert_eq!(speed(350), 0.1);
        assert_eq!(speed(450), 0.2);
    }

    #[test]
    fn a_reset_moves_nothing_until_a_younger_command_comes() {
        let (mut guard, latch) = (brisk(), Latch::private());
        guard.offer(ms(0), latch.state(), Authority::Robot, ms(0), AHEAD).unwrap();
        latch.set(Cause::Person, ms(10));
        assert_eq!(guard.decide(ms(10), latch.state(), Contact::default()).reason, Reason::Latched);
        assert_eq!(
            guard.offer(ms(20), latch.state(), Authority::Referee, ms(20), AHEAD),
            Err(Refusal::Latched)
        );
        latch.reset(ms(30));
        assert_eq!(guard.decide(ms(30), latch.state(), Contact::default()).twist, Twist::ZERO);
        assert_eq!(
            guard.offer(ms(40), latch.state(), Authority::Robot, ms(29), AHEAD),
            Err(Refusal::BeforeReset)
        );
        assert_eq!(guard.decide(ms(40), latch.state(), Contact::default()).twist, Twist::ZERO);
        guard.offer(ms(50), latch.state(), Authority::Robot, ms(45), AHEAD).unwrap();
        assert_eq!(guard.decide(ms(50), latch.state(), Contact::default()).twist, AHEAD);
    }

    #[test]
    fn a_set_and_a_reset_that_nobody_saw_still_drop_the_command() {
        let (mut guard, latch) = (brisk(), Latch::private());
        guard.offer(ms(0), latch.state(), Authority::Robot, ms(0), AHEAD).unwrap();
        latch.set(Cause::Bumper, ms(3));
        latch.reset(ms(4));
        assert_eq!(guard.decide(ms(10), latch.state(), Contact::default()).twist, Twist::ZERO);
    }

    #[test]
    fn contact_bars_its_own_way_only() {
        assert_eq!(Contact::of(0b0000_0001, 12), Contact { ahead: true, behind: false });
        assert_eq!(Contact::of(1 << 6, 12), Contact { ahead: false, behind: true });
        assert_eq!(Contact::of(1 << 3, 12), Contact::default(), "square to the left");
        let (mut guard, latch) = (brisk(), Latch::private());
        guard.offer(ms(0), latch.state(), Authority::Robot, ms(0), Twist::new(0.3, 0.5)).unwrap();
        let bumped = guard.decide(ms(10), latch.state(), Contact { ahead: true, behind: false }).twist;
        assert_eq!(bumped, Twist::new(0.0, 0.5));
        guard.offer(ms(20), latch.state(), Authority::Robot, ms(20), Twist::new(-0.2, 0.0)).unwrap();
        assert_eq!(
            guard.decide(ms(20), latch.state(), Contact { ahead: true, behind: false }).twist.linear,
            -0.2
        );
        assert_eq!(
            guard.decide(ms(20), latch.state(), Contact { ahead: true, behind: true }).twist.linear,
            0.0
        );
    }

    #[test]
    fn a_ramp_begins_where_the_robot_was_before_this_instant() {
        let mut guard = Guard::new(Limits { deceleration: 2.0, ..limits() }, Policy::default());
        let latch = Latch::private();
        let mut speed = |t, wanted| {
            guard.offer(ms(t), latch.state(), Authority::Robot, ms(t), Twist::new(wanted, 0.0)).unwrap();
            guard.decide(ms(t), latch.state(), Contact::default()).twist.linear
        };
        // 0.5 m/s² over 10 ms; a second wish at the same instant replaces the first and gains nothing by it.
        assert!((speed(0, 0.3) - 0.005).abs() < 1e-12);
        assert!((speed(0, 0.3) - 0.005).abs() < 1e-12);
        assert!((speed(20, 0.3) - 0.015).abs() < 1e-12);
        assert_eq!(speed(20, 0.0), 0.0, "it may stop in the instant in which it was to go on");
        // After a stall of a second it may be no faster than after 0.1 s.
        assert!((speed(1020, 0.3) - 0.05).abs() < 1e-12);
    }

    #[test]
    fn a_command_that_is_no_number_stops_at_once_whatever_the_ramp() {
        let (mut guard, latch) = (Guard::new(limits(), Policy::default()), Latch::private());
        guard.offer(ms(0), latch.state(), Authority::Robot, ms(0), AHEAD).unwrap();
        assert!(guard.decide(ms(0), latch.state(), Contact::default()).twist.linear > 0.0);
        let not_finite = Twist::new(0.3, f64::NAN);
        assert_eq!(
            guard.offer(ms(10), latch.state(), Authority::Robot, ms(10), not_finite),
            Err(Refusal::NotFinite)
        );
        let verdict = guard.decide(ms(10), latch.state(), Contact::default());
        assert!(
            verdict.twist == Twist::ZERO
                && matches!(verdict.reason, Reason::Followed(_, cuts) if cuts.not_finite)
        );
    }

    #[test]
    fn a_clock_that_is_turned_back_stops_the_robot() {
        let (mut guard, latch) = (brisk(), Latch::private());
        guard.offer(ms(5000), latch.state(), Authority::Robot, ms(5000), AHEAD).unwrap();
        assert_eq!(guard.decide(ms(1000), latch.state(), Contact::default()).twist, Twist::ZERO);
    }

    fn guarded() -> Guard {
        let mut guard = brisk();
        guard.set_policy(Policy { guarded: true, ..Policy::default() });
        guard
    }

    /// What comes of a command that is said every 10 ms, from `from` to `to`; `said` is how fast is safe at each.
    fn stuck(
        guard: &mut Guard,
        from: i64,
        to: i64,
        twist: Twist,
        said: impl Fn(i64) -> Option<f64>,
    ) -> Vec<Twist> {
        let latch = Latch::private();
        let mut decide = |t: i64| {
            if let Some(safe) = said(t) {
                guard.allow(ms(t), ms(t), safe);
            }
            guard.offer(ms(t), latch.state(), Authority::Robot, ms(t), twist).unwrap();
            guard.decide(ms(t), latch.state(), Contact::default()).twist
        };
        (from / 10..=to / 10).map(|cycle| decide(10 * cycle)).collect()
    }

    #[test]
    fn a_command_that_is_said_again_and_again_goes_no_faster_than_is_safe() {
        let mut guard = guarded();
        let curve = Twist::new(0.5, 0.25);
        assert_eq!(stuck(&mut guard, 0, 200, curve, |_| Some(0.6)).last(), Some(&curve));
        let braking = stuck(&mut guard, 210, 800, curve, |_| Some(0.1));
        // Two periods of a drive are granted, then it brakes at 1 m/s² on its curve.
        assert_eq!(braking[4], curve);
        assert!(braking.windows(2).all(|pair| pair[0].linear - pair[1].linear < 0.0100001), "{braking:?}");
        let slow = braking.last().unwrap();
        assert!((slow.linear - 0.1).abs() < 1e-12 && (slow.angular - 0.05).abs() < 1e-12, "{slow:?}");
        assert_eq!(stuck(&mut guard, 810, 1200, curve, |_| Some(0.0)).last(), Some(&Twist::ZERO));
        assert_eq!(
            guard.decide(ms(1200), Latch::private().state(), Contact::default()).reason,
            Reason::Slowed(Authority::Robot)
        );
        assert_eq!(
            stuck(&mut guard, 1210, 1300, Twist::new(0.0, 0.5), |_| Some(0.0))[0].angular,
            0.5,
            "a turn"
        );
        assert_eq!(stuck(&mut guard, 1310, 1400, Twist::new(-0.2, 0.0), |_| Some(0.0))[0].linear, -0.2);
        assert_eq!(stuck(&mut guard, 1410, 1500, curve, |_| Some(f64::NAN)).last(), Some(&Twist::ZERO));
    }

    #[test]
    fn a_guarded_robot_does_not_go_forward_when_nobody_says_how_fast_is_safe() {
        let mut guard = guarded();
        assert_eq!(stuck(&mut guard, 0, 100, AHEAD, |_| None).last(), Some(&Twist::ZERO), "not yet");
        let heard = stuck(&mut guard, 110, 2000, AHEAD, |t| (t <= 200).then_some(0.6));
        let at = |t: i64| heard[(t as usize - 110) / 10].linear;
        assert_eq!((at(200), at(900), at(940)), (0.3, 0.3, 0.3));
        assert!(at(1000) < 0.3 && at(1250) == 0.0, "{heard:?}");
        guard.set_policy(Policy::default());
        assert_eq!(stuck(&mut guard, 2010, 2100, AHEAD, |_| None).last(), Some(&AHEAD), "cut off from it");
    }

    #[test]
    fn a_drive_that_brakes_as_it_should_is_never_slowed() {
        let (mut guard, latch) = (guarded(), Latch::private());
        let mut speed = 0.0f64;
        let safe = |t: i64| [0.6, 0.35, 0.1, 0.6, 0.0][(t / 700 % 5) as usize];
        for t in (0..7000).step_by(10) {
            // The drive steps every 20 ms, at the same instant before the new word comes.
            if t % 20 == 0 {
                let heard = safe((t - 20).max(0));
                speed = if speed > heard { (speed - 0.02).max(heard) } else { (speed + 0.01).min(heard) };
                guard.offer(ms(t), latch.state(), Authority::Robot, ms(t), Twist::new(speed, 0.1)).unwrap();
            }
            for said in [safe((t - 10).max(0)), safe(t)] {
                guard.allow(ms(t), ms(t), said);
                let verdict = guard.decide(ms(t), latch.state(), Contact::default());
                assert_eq!(verdict.twist.linear, speed, "at {t} ms: {verdict:?}");
            }
        }
    }

    #[derive(Clone, Debug)]
    enum Act {
        Offer(u8, i64, f64, f64),
        Decide,
        Set,
        Reset,
        Wait(i64),
    }

    fn speed() -> impl Strategy<Value = f64> {
        prop_oneof![
            4 => -3.0f64..3.0,
            1 => prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(f64::NEG_INFINITY), Just(1e308), Just(-1e308), Just(1e-320)],
        ]
    }

    fn act() -> impl Strategy<Value = Act> {
        prop_oneof![
            6 => (0u8..3, -400i64..400, speed(), speed()).prop_map(|(who, age, v, w)| Act::Offer(who, age, v, w)),
            6 => Just(Act::Decide),
            1 => Just(Act::Set),
            1 => Just(Act::Reset),
            4 => (-50i64..250).prop_map(Act::Wait),
        ]
    }

    proptest! {
        /// Nothing but zero while the latch is set or without a fresh, finite command since the last set; never beyond limits.
        #[test]
        fn no_sequence_gets_an_unsafe_command_out(
            acts in prop::collection::vec(act(), 1..80),
            ramps in any::<bool>(),
            linear_max in 0.05f64..1.0,
        ) {
            let policy = Policy { linear_max, ..Policy::default() };
            let mut guard = if ramps { Guard::new(limits(), policy) } else { brisk() };
            guard.set_policy(policy);
            let latch = Latch::private();
            let mut now = ms(10_000);
            // The model: stamps of finite commands that came since the last set of the latch.
            let mut stamps: Vec<Time> = Vec::new();
            for act in acts {
                match act {
                    Act::Wait(span) => now += Duration::millis(span),
                    Act::Set => {
                        latch.set(Cause::Safety, now);
                        stamps.clear();
                    }
                    Act::Reset => { latch.reset(now); }
                    Act::Offer(who, age, linear, angular) => {
                        let who = [Authority::Robot, Authority::Person, Authority::Referee][usize::from(who)];
                        let stamp = now - Duration::millis(age);
                        let taken = guard.offer(now, latch.state(), who, stamp, Twist::new(linear, angular));
                        if taken.is_ok() {
                            prop_assert!(!latch.is_set() && linear.is_finite() && angular.is_finite() && age <= 300);
                            stamps.push(stamp.min(now));
                        }
                    }
                    Act::Decide => {
                        let out = guard.decide(now, latch.state(), Contact::default()).twist;
                        prop_assert!(out.linear.is_finite() && out.angular.is_finite());
                        let fresh = stamps.iter().any(|stamp| (0..=300_000_000).contains(&(now - *stamp).0));
                        if latch.is_set() || !fresh {
                            prop_assert_eq!(out, Twist::ZERO);
                        }
                        let wheels = limits().drive.wheels(out).fastest();
                        prop_assert!(out.linear <= linear_max.min(0.6) + 1e-9 && out.linear >= -linear_max.min(0.3) - 1e-9);
                        prop_assert!(out.angular.abs() <= 1.0 + 1e-9 && wheels <= limits().wheel_max + 1e-9);
                    }
                }
            }
        }
    }
}
