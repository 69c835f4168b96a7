//! Following a pose that moves: what keeps a robot on a planned line, arc or turn.
//!
//! ```text
//!                 e_x, e_y, e_θ: the reference seen from the body: how far ahead, how far to the left, how much turned
//!       ▶ ref
//!    ◯▶           v = v_r cos e_θ + k_x e_x
//!   body          ω = ω_r + v_r (sin e_θ / e_θ) e_y / L² + k_θ e_θ        k_θ = max(k_0, 2 |v_r| / L)
//! ```
//!
//! With V = (e_x² + e_y²)/2L² + e_θ²/2 it makes V′ = −k_x e_x²/L² − k_θ e_θ² ≤ 0, whatever the reference does (Kanayama, Kimura, Miyazaki,
//! Noguchi, *A stable tracking control method for an autonomous mobile robot*, ICRA 1990; in this form Samson and Ait-Abderrahim, ICRA
//! 1991). Over the way s an error across decays as (1 + s/L) exp(−s/L), critically damped, at every speed and backward too; while the
//! reference stands or turns in place it stays. L is the one number to choose.
//!
//! An error across counts up to ±L, so the line is met at half a radian at most.

use crate::kinematics::Twist;
use crate::steering::sine_ratio;
use libm::{fabs, fmax, fmin, sincos};
use types::Pose;

/// How firmly to follow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    /// k_x (1/s): speed for a metre that the reference is ahead.
    pub along: f64,
    /// L (m): the way on which an error across decays.
    pub length: f64,
    /// k_0 (1/s): least turn rate for a radian of error.
    pub heading: f64,
}

impl Default for Gains {
    /// For an indoor base whose drive answers within 0.1 s.
    ///
    /// 2/s along and for the heading are a fifth of what that lag bears (1/0.1 s). 0.3 m across are about a body's width, and with 0.3 m/s
    /// they need the same 2/s of the heading.
    fn default() -> Gains {
        Gains { along: 2.0, length: 0.3, heading: 2.0 }
    }
}

/// The reference seen from the body: x ahead (m), y to the left (m), heading (rad).
pub fn error(pose: Pose, reference: Pose) -> Pose {
    pose.inverse().then(reference)
}

/// What to drive when the reference is seen from the body at `error` and itself moves by `wanted`.
pub fn follow(gains: &Gains, error: Pose, wanted: Twist) -> Twist {
    let (sine, cosine) = sincos(error.heading);
    let across = fmin(fmax(error.y, -gains.length), gains.length);
    let pull = sine_ratio(error.heading, sine) * across / (gains.length * gains.length);
    let heading = fmax(gains.heading, 2.0 * fabs(wanted.linear) / gains.length);
    Twist::new(
        wanted.linear * cosine + gains.along * error.x,
        wanted.angular + wanted.linear * pull + heading * error.heading,
    )
}

/// The reference on a straight line from `start` along its heading that is beside the body at `pose`, and how far along it is (m).
pub fn beside(pose: Pose, start: Pose) -> (Pose, f64) {
    let along = start.inverse().transform(pose.position()).x;
    (start.along_arc(along, 0.0), along)
}

#[cfg(test)]
mod tests {
    use super::*;
    use libm::exp;
    use proptest::prelude::*;

    #[test]
    fn an_error_across_decays_over_the_way_as_the_closed_form_says() {
        let gains = Gains { along: 2.0, length: 0.3, heading: 0.0 };
        for speed in [0.1, 0.5, -0.3] {
            let line = Pose::default();
            let (mut pose, mut driven) = (Pose::new(0.0, 0.01, 0.0), 0.0);
            while driven < 1.5 {
                let (reference, _) = beside(pose, line);
                let twist = follow(&gains, error(pose, reference), Twist::new(speed, 0.0));
                pose = pose.advanced(twist.linear, twist.angular, 1e-3);
                driven += fabs(twist.linear) * 1e-3;
                let want = 0.01 * (1.0 + driven / 0.3) * exp(-driven / 0.3);
                assert!(fabs(pose.y - want) < 2e-5, "{speed}: {} for {want} after {driven}", pose.y);
            }
        }
    }

    #[test]
    fn a_line_far_away_is_met_at_half_a_radian_at_most() {
        let gains = Gains { heading: 0.0, ..Gains::default() };
        let (mut pose, mut steepest) = (Pose::new(0.0, 5.0, 0.0), 0f64);
        for _ in 0..80_000 {
            let (reference, _) = beside(pose, Pose::default());
            let twist = follow(&gains, error(pose, reference), Twist::new(0.3, 0.0));
            pose = pose.advanced(twist.linear, twist.angular, 1e-3);
            steepest = fmax(steepest, fabs(pose.heading));
        }
        assert!(steepest > 0.45 && steepest < 0.56 && fabs(pose.y) < 1e-3, "{steepest} {pose:?}");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn the_lyapunov_function_never_grows_along_any_reference(
            x in -0.3f64..0.3, y in -0.2f64..0.2, h in -1.5f64..1.5, v in -0.5f64..0.5, w in -1f64..1., heading in 0f64..3.,
        ) {
            let gains = Gains { heading, ..Gains::default() };
            let square = |x: f64| x * x;
            let value = |e: Pose| (square(e.x) + square(e.y)) / square(gains.length) + square(e.heading);
            let (mut pose, mut reference) = (Pose::new(x, y, h), Pose::default());
            let mut before = f64::INFINITY;
            for _ in 0..20_000 {
                let e = error(pose, reference);
                // Farther across than L the law is held back, and V is another one.
                if fabs(e.y) < gains.length {
                    prop_assert!(value(e) <= before * (1.0 + 1e-5) + 1e-10, "{} {before}", value(e));
                    before = value(e);
                }
                let twist = follow(&gains, e, Twist::new(v, w));
                pose = pose.advanced(twist.linear, twist.angular, 5e-4);
                reference = reference.advanced(v, w, 5e-4);
            }
        }

        #[test]
        fn the_place_beside_is_the_nearest_of_the_line(x in -3f64..3., y in -3f64..3., h in -3f64..3., more in -1f64..1.) {
            let start = Pose::new(0.3, -0.2, h);
            let here = Pose::new(x, y, 0.0);
            let (reference, along) = beside(here, start);
            let other = start.along_arc(along + more, 0.0);
            let distance = here.position().distance(reference.position());
            prop_assert!(distance <= here.position().distance(other.position()) + 1e-12);
            let parallel = error(Pose::new(x, y, h), reference);
            prop_assert!(fabs(parallel.x) < 1e-9);
        }
    }
}
