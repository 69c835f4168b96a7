//! How far the body turned: a gyro and the wheels together, each where it is good.
//!
//! In plain words: a gyro feels every turn, but believes to turn a little when it stands. Wheels know when they stand, but with one a little
//! larger than the other, or a track that is not quite what was measured, each metre and each turn adds to the error. What differs between the
//! two is a sum of the three, and driving about tells them apart.
//!
//! Over a window of time the gyro turned by ∫ω dt, the wheels say Δφ for a way Δs, and
//!
//! ```text
//! ∫ω dt − Δφ = b Δt + d Δs + t Δφ + noise
//! ```
//!
//! | symbol | is | unit |
//! |---|---|---|
//! | b | bias of the gyro | rad/s |
//! | d | unequal wheels: turn for each metre | rad/m |
//! | t | wrong track: part of each turn | 1 |
//!
//! The three are estimated by recursive least squares with what is usual as the first guess. The turn is then ∫(ω − b) dt; without a
//! gyro it is that of the wheels, mended: Δφ + d Δs + t Δφ. (The errors of the wheels as in UMBmark, Borenstein and Feng 1996; the gyro beside
//! them as in their "gyrodometry", 1996.)

use crate::odometry::Increment;
use libm::fabs;

/// What is known beforehand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// Usual bias of the gyro (rad/s). 0.005 is that of a small one that has warmed up.
    pub bias: f64,
    /// Usual turn of the wheels for a metre straight on (rad/m). 0.06 is wheels that differ by 2 % on a track of a third of a metre.
    pub unequal: f64,
    /// Usual error of the track. 0.03 is a centimetre on a third of a metre.
    pub track: f64,
    /// What gyro and wheels differ by in a window in which the robot stands (rad). 0.0006 is the noise of a small gyro.
    pub still: f64,
    /// What they differ by besides for each metre, and for each radian, of the way (rad). 0.005: wheels that slip by a few millimetres a metre.
    pub slip: f64,
    /// Length of a window (s). 0.5 is long beside the time between two readings, and short beside what is done in one.
    pub window: f64,
}

impl Default for Parameters {
    fn default() -> Parameters {
        Parameters { bias: 0.005, unequal: 0.06, track: 0.03, still: 6e-4, slip: 5e-3, window: 0.5 }
    }
}

type Three = [f64; 3];

/// Tells how far the body turned, and learns the errors of gyro and wheels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turning {
    parameters: Parameters,
    /// b, d, t and their covariance.
    errors: Three,
    covariance: [Three; 3],
    /// Of the window: what gyro and wheels differ by, and Δt, Δs, Δφ.
    differ: f64,
    window: Three,
}

impl Turning {
    /// Knows no more than what is usual.
    pub fn new(parameters: Parameters) -> Turning {
        let Parameters { bias, unequal, track, .. } = parameters;
        let usual = [bias, unequal, track];
        let mut covariance = [[0.0; 3]; 3];
        for (i, row) in covariance.iter_mut().enumerate() {
            row[i] = usual[i] * usual[i];
        }
        Turning { parameters, errors: [0.0; 3], covariance, differ: 0.0, window: [0.0; 3] }
    }

    /// The turn (rad) of a step in which the wheels say `wheels`, and the gyro told a mean of `rate` (rad/s), during `dt` (s).
    pub fn turn(&mut self, wheels: Increment, rate: Option<f64>, dt: f64) -> f64 {
        let [bias, unequal, track] = self.errors;
        let Some(rate) = rate.filter(|rate| rate.is_finite() && dt > 0.0) else {
            return wheels.turn + unequal * wheels.distance + track * wheels.turn;
        };
        self.differ += rate * dt - wheels.turn;
        for (sum, part) in self.window.iter_mut().zip([dt, wheels.distance, wheels.turn]) {
            *sum += part;
        }
        if self.window[0] >= self.parameters.window {
            self.learn();
            (self.differ, self.window) = (0.0, [0.0; 3]);
        }
        (rate - bias) * dt
    }

    /// Bias of the gyro (rad/s), turn for each metre (rad/m), part of each turn: what it has learnt.
    pub const fn errors(&self) -> Three {
        self.errors
    }

    /// A step of recursive least squares.
    fn learn(&mut self) {
        let x = self.window;
        let px = self.covariance.map(|row| dot(row, x));
        let noise = self.parameters.still + self.parameters.slip * (fabs(x[1]) + fabs(x[2]));
        let spread = dot(px, x) + noise * noise;
        let surprise = self.differ - dot(self.errors, x);
        // What no error explains is a wheel that lost its grip.
        if surprise * surprise > 25.0 * spread {
            return;
        }
        for i in 0..3 {
            self.errors[i] += px[i] / spread * surprise;
            for j in 0..3 {
                self.covariance[i][j] -= px[i] * px[j] / spread;
            }
        }
    }
}

fn dot(a: Three, b: Three) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use types::chance::Stream;

    const DT: f64 = 0.02;

    /// Drives in bends for `seconds`, with a gyro and wheels that err by `errors`, and tells the true turn, the turn it believes, and what it learnt.
    fn drive(errors: Three, noise: f64, seconds: f64) -> (f64, f64, Three) {
        let mut turning = Turning::new(Parameters::default());
        let draws = Stream::new(1, "gyro");
        let (mut truth, mut believed) = (0.0, 0.0);
        for i in 0..(seconds / DT) as u64 {
            let t = i as f64 * DT;
            let (speed, rate) = match (t / 3.0) as u64 % 4 {
                0 => (0.0, 0.0),
                1 => (0.4, 0.2),
                2 => (0.3, -0.5),
                _ => (0.0, 0.8),
            };
            let way = speed * DT;
            // What the wheels say so that, with their errors, it comes to the true turn.
            let wheels = (rate * DT - errors[1] * way) / (1.0 + errors[2]);
            let felt = rate + errors[0] + noise * draws.normal(i);
            truth += rate * DT;
            believed += turning.turn(Increment { distance: way, turn: wheels }, Some(felt), DT);
        }
        (truth, believed, turning.errors())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        #[test]
        fn it_learns_the_errors_it_was_driven_with(
            bias in -0.01..0.01f64, unequal in -0.06..0.06f64, track in -0.04..0.04f64,
        ) {
            let (truth, believed, learnt) = drive([bias, unequal, track], 0.0, 120.0);
            prop_assert!((learnt[0] - bias).abs() < 2e-4, "{learnt:?}");
            prop_assert!((learnt[1] - unequal).abs() < 5e-3, "{learnt:?}");
            prop_assert!((learnt[2] - track).abs() < 5e-3, "{learnt:?}");
            // Until it has learnt the bias, some ten seconds, it turns by that.
            prop_assert!((truth - believed).abs() < 0.08, "{truth} {believed}");
        }
    }

    #[test]
    fn with_noise_ten_minutes_turn_it_by_less_than_three_degrees() {
        let (truth, believed, _) = drive([0.004, 0.03, -0.02], 0.005, 600.0);
        assert!((truth - believed).abs() < 0.052, "{truth} {believed}");
    }

    #[test]
    fn without_a_gyro_the_turn_is_that_of_the_wheels_and_of_what_it_learnt_of_them() {
        let step = Increment { distance: 0.1, turn: 0.2 };
        let mut turning = Turning::new(Parameters::default());
        assert_eq!(turning.turn(step, None, DT), 0.2);
        turning.errors = [9.0, 0.5, 0.1];
        assert!((turning.turn(step, None, DT) - (0.2 + 0.05 + 0.02)).abs() < 1e-12);
        assert!((turning.turn(step, Some(f64::NAN), DT) - 0.27).abs() < 1e-12);
    }
}
