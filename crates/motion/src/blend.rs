//! Odometry put right by a localizer without a jump: a pose that a control loop can bear.
//!
//! ```text
//!   odometry, every 20 ms ────────────────▶ ┌───────┐
//!                                           │ blend │ ───▶ pose = target ∘ odometry + what is left
//!   map from odometry, every 200 ms ──────▶ └───────┘
//! ```
//!
//! A correction takes effect where the body is: what it changes there is kept as a rest, added to the pose so that nothing changes yet,
//! and let go with the time constant τ, no faster than a rate r:
//!
//! ```text
//! rest ← rest − min(|rest| (1 − exp(−dt/τ)), r dt) · rest/|rest|
//! ```
//!
//! So between two steps the pose moves by what odometry says and at most r dt more, however far it was put, up to a bound: a rest beyond
//! that is no correction but news (the wheels slip, somebody carried the body), and what is beyond counts at once. The same low-pass
//! averages the localizer's noise: with one correction each T its variance falls to (1 − q)/(1 + q), with q = exp(−T/τ).

use libm::{exp, fabs, fmax, fmin};
use types::geometry::wrap;
use types::{Point, Pose};

/// How fast a correction comes in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// τ: in this time a correction comes in to all but 1/e (s).
    pub time_constant: f64,
    /// Highest rate of the position (m/s).
    pub linear_rate: f64,
    /// Highest rate of the heading (rad/s).
    pub angular_rate: f64,
    /// Most of the position that may be left to come in (m).
    pub linear_rest: f64,
    /// Most of the heading that may be left to come in (rad).
    pub angular_rest: f64,
}

impl Default for Parameters {
    /// For corrections every 0.2 s.
    ///
    /// 0.3 s average the noise to 0.6 of its size, and end well before a goal is reached. A decimetre in a second and 20° in a second are
    /// less than what the body itself does. 0.3 m and 30° are more than a localizer that knows where it is can be wrong by.
    fn default() -> Parameters {
        Parameters {
            time_constant: 0.3,
            linear_rate: 0.1,
            angular_rate: 0.35,
            linear_rest: 0.3,
            angular_rest: 0.5,
        }
    }
}

/// The corrected pose. One `step` a reading of odometry, one `correct` a result of the localizer.
#[derive(Clone, Copy, Debug)]
pub struct Blend {
    parameters: Parameters,
    map_from_odometry: Pose,
    odometry: Pose,
    rest: Point,
    rest_heading: f64,
}

impl Blend {
    /// Starts with a correction that counts at once, and the body at `odometry`.
    pub const fn new(parameters: Parameters, map_from_odometry: Pose, odometry: Pose) -> Blend {
        Blend { parameters, map_from_odometry, odometry, rest: Point::new(0.0, 0.0), rest_heading: 0.0 }
    }

    /// Takes what the localizer found, as the pose of odometry's frame in the map. What is not finite is left out, and `false` told.
    pub fn correct(&mut self, map_from_odometry: Pose) -> bool {
        if !is_finite(map_from_odometry) {
            return false;
        }
        let before = self.pose();
        self.map_from_odometry = map_from_odometry;
        let (target, p) = (self.target(), self.parameters);
        let rest = before.position() - target.position();
        self.rest = rest * (p.linear_rest / fmax(rest.norm(), p.linear_rest));
        let turned = wrap(before.heading - target.heading);
        self.rest_heading = fmin(fmax(turned, -p.angular_rest), p.angular_rest);
        true
    }

    /// Takes a reading of odometry, `dt` (s) after the one before, and gives the pose in the map.
    pub fn step(&mut self, odometry: Pose, dt: f64) -> Pose {
        let p = self.parameters;
        self.odometry = odometry;
        let dt = if dt > 0.0 { dt } else { 0.0 };
        let part = 1.0 - exp(-dt / p.time_constant);
        let (far, turned) = (self.rest.norm(), fabs(self.rest_heading));
        if far > 0.0 {
            self.rest = self.rest * (1.0 - fmin(part, p.linear_rate * dt / far));
        }
        if turned > 0.0 {
            self.rest_heading *= 1.0 - fmin(part, p.angular_rate * dt / turned);
        }
        self.pose()
    }

    /// Where the body is in the map.
    pub fn pose(&self) -> Pose {
        let target = self.target();
        Pose {
            x: target.x + self.rest.x,
            y: target.y + self.rest.y,
            heading: wrap(target.heading + self.rest_heading),
        }
    }

    /// Where the body is in the map as the last correction has it, all at once.
    pub fn target(&self) -> Pose {
        self.map_from_odometry.then(self.odometry)
    }

    /// How much of the corrections has not come in yet: of the position (m) and of the heading (rad).
    pub fn rest(&self) -> (f64, f64) {
        (self.rest.norm(), fabs(self.rest_heading))
    }
}

/// Whether all parts are numbers and not infinite.
pub(crate) fn is_finite(pose: Pose) -> bool {
    pose.x.is_finite() && pose.y.is_finite() && pose.heading.is_finite()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use types::chance::Stream;

    const DT: f64 = 0.02;

    #[test]
    fn a_correction_comes_in_exponentially_and_ends_where_it_should() {
        let p = Parameters { linear_rate: 1.0, angular_rate: 1.0, ..Parameters::default() };
        let body = Pose::new(1.0, 2.0, 0.5);
        let mut blend = Blend::new(p, Pose::default(), body);
        let target = Pose::new(0.03, -0.02, 0.01);
        assert!(blend.correct(target));
        assert_eq!(blend.pose().position(), body.position());
        for _ in 0..15 {
            blend.step(body, DT);
        }
        // One time constant.
        let missing = blend.pose().position() - target.then(body).position();
        let whole = body.position() - target.then(body).position();
        assert!(fabs(missing.norm() / whole.norm() - exp(-1.0)) < 1e-9);
        for _ in 0..500 {
            blend.step(body, DT);
        }
        assert!(blend.pose().position().distance(target.then(body).position()) < 1e-9);
        assert!(fabs(blend.pose().heading - 0.51) < 1e-9 && blend.rest().0 < 1e-9);
    }

    #[test]
    fn a_large_correction_comes_in_at_its_rate() {
        let p = Parameters { linear_rest: 2.0, angular_rest: 3.0, ..Parameters::default() };
        let mut blend = Blend::new(p, Pose::default(), Pose::default());
        blend.correct(Pose::new(1.0, 0.0, 2.0));
        for _ in 0..50 {
            blend.step(Pose::default(), DT);
        }
        assert!(fabs(blend.pose().x - 0.1) < 1e-9 && fabs(blend.pose().heading - 0.35) < 1e-9);
    }

    #[test]
    fn noise_is_averaged_as_its_formula_says() {
        let draws = Stream::new(3, "localizer");
        let mut blend = Blend::new(
            Parameters { linear_rate: 1e3, ..Parameters::default() },
            Pose::default(),
            Pose::default(),
        );
        let (mut sum, n) = (0.0, 20_000);
        for i in 0..n {
            blend.correct(Pose::new(0.01 * draws.normal(i), 0.0, 0.0));
            for _ in 0..10 {
                blend.step(Pose::default(), DT);
            }
            sum += blend.pose().x * blend.pose().x;
        }
        let q = exp(-0.2 / 0.3);
        let ratio = sum / n as f64 / 1e-4;
        assert!(fabs(ratio - (1.0 - q) / (1.0 + q)) < 0.02, "{ratio}");
    }

    #[test]
    fn what_is_beyond_the_bound_counts_at_once() {
        let mut blend = Blend::new(Parameters::default(), Pose::default(), Pose::default());
        blend.correct(Pose::new(1.0, 0.0, -2.0));
        assert!(fabs(blend.pose().x - 0.7) < 1e-12 && fabs(blend.pose().heading + 1.5) < 1e-12, "{blend:?}");
    }

    #[test]
    fn nonsense_is_left_out() {
        let mut blend = Blend::new(Parameters::default(), Pose::default(), Pose::new(1.0, 0.0, 0.0));
        assert!(!blend.correct(Pose::new(f64::NAN, 0.0, 0.0)));
        assert_eq!(blend.pose(), Pose::new(1.0, 0.0, 0.0));
    }

    proptest! {
        #[test]
        fn the_pose_never_jumps(seed in 0u64..1000, size in 0f64..2., speed in -1f64..1., turn in -2f64..2.) {
            let draws = Stream::new(seed, "corrections");
            let p = Parameters { linear_rest: 20.0, angular_rest: 4.0, ..Parameters::default() };
            let mut odometry = Pose::new(3.0, -2.0, 1.0);
            let mut blend = Blend::new(p, Pose::default(), odometry);
            let mut before = blend.pose();
            for i in 0..300u64 {
                if i % 10 == 0 {
                    let draw = |k: u64| draws.between(3 * i + k, -size, size);
                    blend.correct(Pose::new(draw(0), draw(1), draw(2)));
                    let now = blend.pose();
                    prop_assert!(now.position().distance(before.position()) < 1e-9);
                    prop_assert!(fabs(wrap(now.heading - before.heading)) < 1e-9);
                }
                odometry = odometry.advanced(speed, turn, DT);
                let now = blend.step(odometry, DT);
                prop_assert!(now.position().distance(before.position()) <= (fabs(speed) + p.linear_rate) * DT + 1e-9);
                prop_assert!(fabs(wrap(now.heading - before.heading)) <= (fabs(turn) + p.angular_rate) * DT + 1e-9);
                before = now;
            }
        }
    }
}
