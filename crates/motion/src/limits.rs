//! The filter in front of the wheels: what cannot or must not be driven is cut, and the result says what was cut.

use crate::kinematics::{Differential, Twist, is_finite, scaled};
use libm::{fabs, fmax, fmin};

/// What the drive can do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Highest forward speed (m/s).
    pub linear_max: f64,
    /// Highest backward speed (m/s), as a positive number.
    pub backward_max: f64,
    /// Highest turn rate (rad/s).
    pub angular_max: f64,
    /// Highest rate at which the speed may grow (m/s²).
    pub acceleration: f64,
    /// Highest rate at which the speed may fall (m/s²).
    pub deceleration: f64,
    /// Highest rate at which the turn rate may change (rad/s²).
    pub angular_acceleration: f64,
    /// Highest turn rate of a wheel (rad/s).
    pub wheel_max: f64,
    /// Wheels and track, for the limit of the wheels.
    pub drive: Differential,
}

impl Limits {
    /// Limits for an indoor robot of some 20 kg.
    ///
    /// 0.6 m/s is a slow walk, so people can step aside. Backward is half as fast, since few robots see well behind. 1 rad/s turns
    /// around in three seconds and smears no camera image. 0.5 m/s² starts without slip on a smooth floor, and braking at 1 m/s²
    /// does not tip a tall body. The wheels may run as fast as driving straight at full speed and turning a third of full rate need.
    pub fn indoor(drive: Differential) -> Limits {
        let rim = 0.6 + drive.track / 6.0;
        Limits {
            linear_max: 0.6,
            backward_max: 0.3,
            angular_max: 1.0,
            acceleration: 0.5,
            deceleration: 1.0,
            angular_acceleration: 3.0,
            wheel_max: rim / fmin(drive.left_radius, drive.right_radius),
            drive,
        }
    }
}

/// Whether moving forward is allowed just now.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Forward {
    /// It is.
    #[default]
    Allowed,
    /// Stop moving, but not turning; backing out is allowed too.
    Forbidden,
}

/// What was taken away from a wish.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cuts {
    /// The wish held a NaN or an infinity: it was refused, and the body is braked instead.
    pub not_finite: bool,
    /// It wanted forward, and that was forbidden.
    pub forward: bool,
    /// It was too fast along (linear_max, backward_max).
    pub linear: bool,
    /// It turned too fast.
    pub angular: bool,
    /// A wheel would have been too fast.
    pub wheel: bool,
    /// The speed would have changed too fast.
    pub acceleration: bool,
    /// The turn rate would have changed too fast.
    pub angular_acceleration: bool,
}

impl Cuts {
    /// Whether the wish passed whole.
    pub fn none(&self) -> bool {
        *self == Cuts::default()
    }
}

/// A wish after the filter.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limited {
    /// What is to be driven.
    pub twist: Twist,
    /// What was cut.
    pub cuts: Cuts,
}

/// Cuts `wanted` to what can be driven within `dt` (s) from the motion `present`.
///
/// Speeds above a limit are scaled together, so the robot stays on the wished path and only takes longer. The limits of
/// acceleration keep the curvature as well where one scale fits both axes, and hold each axis alone where none does. A step that is
/// not a positive number changes nothing; a present motion that is not finite counts as standing.
///
/// Should the limits contradict each other, the wheels have the last word: no controller can make them faster.
pub fn limit(limits: &Limits, wanted: Twist, present: Twist, forward: Forward, dt: f64) -> Limited {
    let present = if is_finite(present) { present } else { Twist::ZERO };
    let mut cuts = Cuts { not_finite: !is_finite(wanted), ..Cuts::default() };
    let mut goal = if cuts.not_finite { Twist::ZERO } else { wanted };
    if forward == Forward::Forbidden && goal.linear > 0.0 {
        cuts.forward = true;
        goal.linear = 0.0;
    }
    let goal = within_speeds(limits, goal, &mut cuts);
    let reached =
        within_reach(limits, goal, present, if dt > 0.0 && dt.is_finite() { dt } else { 0.0 }, &mut cuts);
    Limited { twist: within_wheels(limits, reached, &mut cuts), cuts }
}

fn within_speeds(limits: &Limits, goal: Twist, cuts: &mut Cuts) -> Twist {
    let along = if goal.linear >= 0.0 { limits.linear_max } else { limits.backward_max };
    let by_linear = share(along, goal.linear);
    let by_angular = share(limits.angular_max, goal.angular);
    cuts.linear |= by_linear < 1.0;
    cuts.angular |= by_angular < 1.0;
    within_wheels(limits, scaled(goal, fmin(by_linear, by_angular)), cuts)
}

fn within_wheels(limits: &Limits, goal: Twist, cuts: &mut Cuts) -> Twist {
    let scale = share(limits.wheel_max, limits.drive.wheels(goal).fastest());
    // A rounding of the last digit is no cut.
    cuts.wheel |= scale < 1.0 - 1e-12;
    scaled(goal, scale)
}

/// The largest factor up to 1 that brings `value` within ±`bound`.
fn share(bound: f64, value: f64) -> f64 {
    if fabs(value) > bound { bound / fabs(value) } else { 1.0 }
}

fn within_reach(limits: &Limits, goal: Twist, present: Twist, dt: f64, cuts: &mut Cuts) -> Twist {
    let linear = reachable(present.linear, limits.acceleration, limits.deceleration, dt);
    let angular = reachable(present.angular, limits.angular_acceleration, limits.angular_acceleration, dt);
    let held = Twist::new(clamp(goal.linear, linear), clamp(goal.angular, angular));
    if held == goal {
        return goal;
    }
    cuts.acceleration |= held.linear != goal.linear;
    cuts.angular_acceleration |= held.angular != goal.angular;
    let scale = fmin(part(held.linear, goal.linear), part(held.angular, goal.angular));
    let same_path = scaled(goal, scale);
    let fits = |value: f64, (low, high): (f64, f64)| value >= low - 1e-12 && value <= high + 1e-12;
    if fits(same_path.linear, linear) && fits(same_path.angular, angular) { same_path } else { held }
}

/// The values that can be reached from `now`: towards zero by `deceleration`, and beyond zero or away from it by `acceleration`.
fn reachable(now: f64, acceleration: f64, deceleration: f64, dt: f64) -> (f64, f64) {
    let away = fabs(now) + acceleration * dt;
    let braked = fabs(now) - deceleration * dt;
    // What is left of the step after standing still starts the motion the other way.
    let toward = if braked >= 0.0 { braked } else { braked / deceleration * acceleration };
    if now >= 0.0 { (toward, away) } else { (-away, -toward) }
}

fn clamp(value: f64, (low, high): (f64, f64)) -> f64 {
    fmin(fmax(value, low), high)
}

/// How much of `goal` is `held`, from 0 to 1.
fn part(held: f64, goal: f64) -> f64 {
    if goal == 0.0 { 1.0 } else { fmin(fmax(held / goal, 0.0), 1.0) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn limits() -> Limits {
        Limits::indoor(Differential::new(0.1, 0.4))
    }

    #[test]
    fn a_fast_curve_is_driven_slower_on_the_same_curve() {
        let moving = Twist::new(0.6, 0.6);
        let out = limit(&limits(), Twist::new(1.2, 1.2), moving, Forward::Allowed, 0.1);
        assert!(out.cuts.linear && !out.cuts.not_finite, "{out:?}");
        assert!(fabs(out.twist.linear - out.twist.angular) < 1e-12, "{out:?}");
    }

    #[test]
    fn starting_from_rest_keeps_the_curve() {
        let out = limit(&limits(), Twist::new(0.5, 0.25), Twist::ZERO, Forward::Allowed, 0.1);
        assert!(fabs(out.twist.linear - 0.05) < 1e-12 && fabs(out.twist.angular - 0.025) < 1e-12, "{out:?}");
        assert!(out.cuts.acceleration);
    }

    #[test]
    fn nonsense_brakes_and_is_reported() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let out = limit(&limits(), Twist::new(bad, 0.2), Twist::new(0.4, 0.0), Forward::Allowed, 0.1);
            assert!(
                out.cuts.not_finite && fabs(out.twist.linear - 0.3) < 1e-12 && out.twist.angular == 0.0,
                "{out:?}"
            );
        }
    }

    #[test]
    fn forbidden_forward_stops_moving_but_not_turning() {
        let out = limit(&limits(), Twist::new(0.5, 0.5), Twist::new(0.0, 0.5), Forward::Forbidden, 0.1);
        assert_eq!(out.twist, Twist::new(0.0, 0.5));
        assert!(out.cuts.forward);
        let back = limit(&limits(), Twist::new(-0.05, 0.0), Twist::ZERO, Forward::Forbidden, 0.1);
        assert_eq!((back.twist.linear, back.cuts.none()), (-0.05, true));
    }

    #[test]
    fn reversing_brakes_hard_first_and_then_starts_softly() {
        // 0.1 m/s is braked away within 0.1 s, the other 0.1 s start backward at 0.5 m/s².
        let out = limit(&limits(), Twist::new(-0.3, 0.0), Twist::new(0.1, 0.0), Forward::Allowed, 0.2);
        assert!(fabs(out.twist.linear + 0.05) < 1e-12, "{out:?}");
    }

    proptest! {
        #[test]
        fn nothing_leaves_the_limits(
            v in -3f64..3., w in -5f64..5., v0 in -0.3f64..0.6, w0 in -0.3f64..0.3, dt in 0.001f64..0.5
        ) {
            let l = limits();
            let present = Twist::new(v0, w0);
            // A body that already breaks the limits cannot be within them at once.
            prop_assume!(l.drive.wheels(present).fastest() <= l.wheel_max);
            let out = limit(&l, Twist::new(v, w), present, Forward::Allowed, dt).twist;
            prop_assert!(out.linear <= l.linear_max + 1e-9 && out.linear >= -l.backward_max - 1e-9);
            prop_assert!(fabs(out.angular) <= l.angular_max + 1e-9);
            prop_assert!(l.drive.wheels(out).fastest() <= l.wheel_max + 1e-9);
            prop_assert!(fabs(out.linear) - fabs(v0) <= l.acceleration * dt + 1e-9);
        }

        #[test]
        fn what_fits_passes_untouched(v in -0.29f64..0.5, w in -0.3f64..0.3) {
            let wish = Twist::new(v, w);
            let out = limit(&limits(), wish, wish, Forward::Allowed, 0.01);
            prop_assert!(out.twist == wish && out.cuts.none());
        }
    }
}
