//! Stops: how the speed falls over time, and how far that is.
//!
//! | kind | asked for by | order | category of IEC 60204-1 | ends |
//! |---|---|---|---|---|
//! | hard | a bumper, a person, a fault | nothing, at once: the board brakes as hard as it can | 1, or 0 where hardware cuts the power | by a reset, which moves nothing |
//! | soft | something within the critical range | a ramp on the curve that it drives | 2: power is kept | by itself, when it is clear |
//!
//! Software alone is never category 0. ISO 13850 wants an emergency stop to be category 0 or 1, to come before everything and to latch; that
//! is the gate's part. Here is what both look like over time:
//!
//! ```text
//!  v ┤────╮ hard            v ┤─────╮ soft                    way = v t_r + v²/2a             a step of the acceleration
//!    │    │╲                  │      ╲                        way = v t_r + v²/2a + v a/2j    with jerk j, where v ≥ a²/j
//!  0 ┴────┴─╲──── t         0 ┴───────╰──── t
//!     t_r                      t_r
//! ```
//!
//! with the reaction time t_r, in which nothing happens yet. A body in a curve stays on it: speed and turn rate fall in one ratio, as fast as
//! the slower of both can. Where a stop is asked for by v t_r + v²/2a, its margin has to cover the v a/2j of a soft ramp as well: 1.5 cm at
//! 0.3 m/s with the defaults.

use crate::kinematics::{Twist, is_finite, scaled};
use crate::profile::{Bounds, Profile};
use libm::{fabs, fmax, fmin};

/// What the brakes can do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// Deceleration of a hard stop (m/s²): what the board's own brake makes.
    pub hard: f64,
    /// Deceleration of a soft stop (m/s²).
    pub soft: f64,
    /// Highest jerk of a soft stop (m/s³); infinite for a ramp with corners.
    pub jerk: f64,
    /// Angular deceleration of a soft stop, and of a hard one (rad/s²).
    pub angular: f64,
    /// From the cause to the first answer of the wheels (s).
    pub reaction: f64,
}

impl Default for Parameters {
    /// For an indoor base.
    ///
    /// 3 m/s² is what rubber on a floor holds with a body that does not tip; 1 m/s² is what [`crate::limits::Limits::indoor`] brakes with,
    /// and what the safety law counts on. 10 m/s³ reach it in 0.1 s. 0.1 s is a period of the board and the lag of the motors.
    fn default() -> Parameters {
        Parameters { hard: 3.0, soft: 1.0, jerk: 10.0, angular: 3.0, reaction: 0.1 }
    }
}

/// Which stop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// At once, and latched.
    #[default]
    Hard,
    /// On a ramp, and released.
    Soft,
}

/// The course of one stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    kind: Kind,
    from: Twist,
    /// The share of `from` that is left; its way is the time for which `from` would cover what the stop covers.
    share: Option<Profile>,
    reaction: f64,
}

impl Stop {
    /// A stop from the motion `present`. What is not finite counts as standing.
    pub fn new(parameters: &Parameters, kind: Kind, present: Twist) -> Stop {
        let p = parameters;
        let from = if is_finite(present) { present } else { Twist::ZERO };
        let (linear, jerk) = match kind {
            Kind::Hard => (p.hard, f64::INFINITY),
            Kind::Soft => (p.soft, p.jerk),
        };
        // As shares of the motion; one that stands does not count.
        let acceleration = fmin(linear / fabs(from.linear), p.angular / fabs(from.angular));
        let bounds = Bounds { velocity: 1.0, acceleration, jerk: jerk / linear * acceleration };
        let share = Profile::ramp(bounds, 1.0, 0.0).ok();
        Stop { kind, from, share, reaction: fmax(p.reaction, 0.0) }
    }

    /// What to order `seconds` after its cause.
    pub fn order(&self, seconds: f64) -> Twist {
        match self.kind {
            Kind::Hard => Twist::ZERO,
            Kind::Soft => self.braked(seconds),
        }
    }

    /// How the body moves `seconds` after the cause, where it brakes as it is counted on.
    pub fn motion(&self, seconds: f64) -> Twist {
        if seconds < self.reaction { self.from } else { self.braked(seconds - self.reaction) }
    }

    /// Time from the cause to standing (s).
    pub fn seconds(&self) -> f64 {
        self.share.map_or(0.0, |share| share.seconds() + self.reaction)
    }

    /// Way from the cause to standing (m); backward is negative.
    pub fn way(&self) -> f64 {
        self.share.map_or(0.0, |share| self.from.linear * (self.reaction + share.distance()))
    }

    fn braked(&self, seconds: f64) -> Twist {
        self.share.map_or(Twist::ZERO, |share| scaled(self.from, share.at(seconds).velocity))
    }
}

/// The order in front of a soft stop: the wish, or the ramp while somebody says stop.
///
/// ```text
///  ┌─────────┐  stop   ┌─────────┐ ramp over ┌──────────┐
///  │ Passing │ ──────▶ │ Braking │ ────────▶ │ Standing │
///  └─────────┘         └─────────┘           └──────────┘
///       ▲       no stop     │                     │
///       └───────────────────┴─────────────────────┘
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Soft {
    parameters: Parameters,
    /// The stop, and since when (s).
    stop: Option<(Stop, f64)>,
}

/// What a soft stop does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum State {
    /// Nothing: the wish passes.
    #[default]
    Passing,
    /// It brakes.
    Braking,
    /// It holds the body where it stands.
    Standing,
}

impl Soft {
    /// No stop yet.
    pub const fn new(parameters: Parameters) -> Soft {
        Soft { parameters, stop: None }
    }

    /// What to order for a `wish` of a body that was ordered `present` the step before, `dt` (s) ago, while it has to `stop` or not. After
    /// the stop the wish passes as it is: how fast it starts again is the business of [`crate::limits`]. When to stop and when to go on is
    /// not said here: it wants a hysteresis.
    pub fn step(&mut self, stop: bool, wish: Twist, present: Twist, dt: f64) -> (Twist, State) {
        if !stop {
            self.stop = None;
            return (wish, State::Passing);
        }
        let dt = if dt > 0.0 && dt.is_finite() { dt } else { 0.0 };
        let (course, since) =
            self.stop.unwrap_or_else(|| (Stop::new(&self.parameters, Kind::Soft, present), 0.0));
        let since = since + dt;
        self.stop = Some((course, since));
        let order = course.order(since);
        (order, if order == Twist::ZERO { State::Standing } else { State::Braking })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::safety::stopping_distance;
    use proptest::prelude::*;

    fn parameters() -> Parameters {
        Parameters { reaction: 0.2, jerk: f64::INFINITY, ..Parameters::default() }
    }

    #[test]
    fn the_way_is_that_of_the_textbook() {
        // 0.3 m/s, 0.2 s, 1 m/s²: 0.105 m.
        let stop = Stop::new(&parameters(), Kind::Soft, Twist::new(0.3, 0.0));
        assert!(fabs(stop.way() - 0.105) < 1e-12 && fabs(stop.seconds() - 0.5) < 1e-12, "{stop:?}");
        assert!(fabs(stop.way() - stopping_distance(0.3, 0.2, 1.0)) < 1e-12);
        // Three times as hard: 0.06 m of reaction and 0.015 m of braking.
        let hard = Stop::new(&parameters(), Kind::Hard, Twist::new(0.3, 0.0));
        assert!(fabs(hard.way() - 0.075) < 1e-12, "{hard:?}");
        // With jerk v a/2j = 0.015 m more.
        let smooth = Stop::new(&Parameters { jerk: 10.0, ..parameters() }, Kind::Soft, Twist::new(-0.3, 0.0));
        assert!(fabs(smooth.way() + 0.12) < 1e-12, "{smooth:?}");
    }

    #[test]
    fn a_hard_stop_orders_nothing_at_once_and_a_soft_one_a_ramp() {
        let from = Twist::new(0.3, 0.15);
        let (hard, soft) =
            (Stop::new(&parameters(), Kind::Hard, from), Stop::new(&parameters(), Kind::Soft, from));
        assert_eq!((hard.order(0.0), hard.motion(0.1), soft.order(0.0)), (Twist::ZERO, from, from));
        let half = soft.order(0.15);
        assert!(fabs(half.linear - 0.15) < 1e-12 && fabs(half.angular - 0.075) < 1e-12, "{half:?}");
        assert_eq!((soft.order(0.301), hard.motion(0.301)), (Twist::ZERO, Twist::ZERO));
        assert!(hard.motion(0.25).linear < soft.motion(0.25).linear);
    }

    #[test]
    fn a_soft_stop_ends_by_itself_and_begins_anew() {
        let wish = Twist::new(0.3, 0.0);
        let mut soft = Soft::new(Parameters::default());
        let mut last = wish;
        let mut run = |critical: bool, steps: usize| {
            let mut seen = std::vec::Vec::new();
            for _ in 0..steps {
                let (order, state) = soft.step(critical, wish, last, 0.02);
                last = order;
                seen.push(state);
            }
            (last, seen)
        };
        assert_eq!(run(false, 3), (wish, std::vec![State::Passing; 3]));
        let (order, seen) = run(true, 30);
        assert_eq!((order, seen[0], seen[29]), (Twist::ZERO, State::Braking, State::Standing));
        // v/a + a/j = 0.4 s.
        assert_eq!(seen.iter().filter(|state| **state == State::Braking).count(), 19);
        assert_eq!(run(false, 1), (wish, std::vec![State::Passing]));
        assert_eq!(run(true, 1).1, [State::Braking]);
    }

    #[test]
    fn standing_needs_no_stop() {
        for present in [Twist::ZERO, Twist::new(f64::NAN, 0.0)] {
            let stop = Stop::new(&parameters(), Kind::Soft, present);
            assert_eq!((stop.order(0.0), stop.way(), stop.seconds()), (Twist::ZERO, 0.0, 0.0));
        }
    }

    proptest! {
        #[test]
        fn a_ramp_keeps_its_curve_and_its_limits_and_its_way(
            v in -1f64..1., w in -2f64..2., jerk in prop_oneof![Just(f64::INFINITY), 1f64..30.], hard: bool,
        ) {
            prop_assume!(fabs(v) + fabs(w) > 1e-3);
            let p = Parameters { jerk, ..parameters() };
            let stop = Stop::new(&p, if hard { Kind::Hard } else { Kind::Soft }, Twist::new(v, w));
            let (n, mut way) = (2000, 0.0);
            let dt = stop.seconds() / n as f64;
            let mut before = stop.motion(0.0);
            for i in 1..=n {
                let now = stop.motion(i as f64 * dt);
                prop_assert!(fabs(now.linear * w - now.angular * v) < 1e-9);
                prop_assert!(fabs(now.linear) <= fabs(before.linear) + 1e-12);
                let most = if hard { p.hard } else { p.soft };
                prop_assert!(fabs(now.linear - before.linear) <= most * dt + 1e-9);
                prop_assert!(fabs(now.angular - before.angular) <= p.angular * dt + 1e-9);
                way += (now.linear + before.linear) / 2.0 * dt;
                before = now;
            }
            prop_assert!(fabs(before.linear) < 1e-9 && fabs(way - stop.way()) < 1e-3 * (1.0 + fabs(way)));
        }
    }
}
