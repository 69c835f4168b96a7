//! Dead reckoning: wheel counters to a pose and to how uncertain it is.

use crate::kinematics::Differential;
use libm::{fabs, sincos};
use types::Pose;
use types::geometry::TAU;

/// What the counters mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// Wheels and track.
    pub drive: Differential,
    /// Counts for one turn of a wheel, gear and edges included; positive.
    pub ticks_per_turn: f64,
    /// Width of the counters, 2 to 64. A board that counts in 16 bits starts over at 32 768.
    pub counter_bits: u32,
    /// k of var(dl) = k |dl|: variance that a metre of wheel travel adds (m).
    pub slip: f64,
}

impl Parameters {
    /// Counters of 64 bits, and a slip of 0.3 mm: the middle of what indoor robots show, 0.1 to 1 mm (a metre driven is uncertain
    /// by 1.7 cm).
    pub const fn new(drive: Differential, ticks_per_turn: f64) -> Parameters {
        Parameters { drive, ticks_per_turn, counter_bits: 64, slip: 3e-4 }
    }
}

/// What the body did between two readings.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Increment {
    /// Length of the path of the axle's middle (m); backward is negative.
    pub distance: f64,
    /// Change of heading (rad).
    pub turn: f64,
}

/// The counts from `before` to `now` of a counter of `bits` bits, across at most one wrap.
pub fn ticks_between(before: i64, now: i64, bits: u32) -> i64 {
    let unused = 64 - bits.clamp(2, 64);
    // Shifting the unused bits out and back in extends the sign of the narrow difference.
    (now.wrapping_sub(before) << unused) >> unused
}

/// Adds up wheel counts.
///
/// The pose moves along exact arcs. The covariance P (3 × 3, of x, y, heading) grows as
///
/// ```text
/// P ← F P Fᵀ + G diag(k|dl|, k|dr|) Gᵀ
/// ```
///
/// with F and G the derivatives of the step by the pose and by the two wheel travels, taken at the middle heading. It is exact to
/// second order in the turn of one step, so steps should turn by less than about 0.5 rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Odometer {
    parameters: Parameters,
    last: Option<(i64, i64)>,
    pose: Pose,
    covariance: [[f64; 3]; 3],
    travelled: f64,
}

impl Odometer {
    /// Starts at `pose`, known exactly.
    pub const fn new(parameters: Parameters, pose: Pose) -> Odometer {
        Odometer { parameters, last: None, pose, covariance: [[0.0; 3]; 3], travelled: 0.0 }
    }

    /// Takes the totals of both counters. The first reading only sets the start and gives no motion.
    pub fn update(&mut self, left: i64, right: i64) -> Increment {
        self.update_with(left, right, |step| step.turn)
    }

    /// Likewise, with the turn (rad) that something better than counting makes of what the wheels say.
    pub fn update_with(&mut self, left: i64, right: i64, turn: impl FnOnce(Increment) -> f64) -> Increment {
        let Some((last_left, last_right)) = self.last.replace((left, right)) else {
            return Increment::default();
        };
        let drive = self.parameters.drive;
        let (metres_left, metres_right) = (
            self.metres(last_left, left, drive.left_radius),
            self.metres(last_right, right, drive.right_radius),
        );
        let mut step = Increment {
            distance: (metres_left + metres_right) / 2.0,
            turn: (metres_right - metres_left) / drive.track,
        };
        step.turn = turn(step);
        self.spread(step, fabs(metres_left), fabs(metres_right));
        self.pose = self.pose.along_arc(step.distance, step.turn);
        self.travelled += fabs(step.distance);
        step
    }

    /// Where it believes to be.
    pub const fn pose(&self) -> Pose {
        self.pose
    }

    /// Covariance of x (m), y (m), heading (rad).
    pub const fn covariance(&self) -> [[f64; 3]; 3] {
        self.covariance
    }

    /// Length of the whole path (m), forward and backward.
    pub const fn travelled(&self) -> f64 {
        self.travelled
    }

    /// Puts it at a pose that something better than counting has found. The counters go on.
    pub fn correct(&mut self, pose: Pose, covariance: [[f64; 3]; 3]) {
        self.pose = pose;
        self.covariance = covariance;
    }

    fn metres(&self, before: i64, now: i64, radius: f64) -> f64 {
        let ticks = ticks_between(before, now, self.parameters.counter_bits) as f64;
        ticks / self.parameters.ticks_per_turn * TAU * radius
    }

    fn spread(&mut self, step: Increment, left: f64, right: f64) {
        let middle = self.pose.heading + step.turn / 2.0;
        let (s, c) = sincos(middle);
        let f = [[1.0, 0.0, -step.distance * s], [0.0, 1.0, step.distance * c], [0.0, 0.0, 1.0]];
        let b = self.parameters.drive.track;
        let bend = step.distance / (2.0 * b);
        // Columns: by the travel of the left wheel, by that of the right one.
        let g = [
            [c / 2.0 + bend * s, c / 2.0 - bend * s],
            [s / 2.0 - bend * c, s / 2.0 + bend * c],
            [-1.0 / b, 1.0 / b],
        ];
        let q = [self.parameters.slip * left, self.parameters.slip * right];
        let p = self.covariance;
        let mut grown = [[0.0; 3]; 3];
        for i in 0..3 {
            for j in 0..3 {
                let mut sum = g[i][0] * q[0] * g[j][0] + g[i][1] * q[1] * g[j][1];
                for k in 0..3 {
                    for l in 0..3 {
                        sum += f[i][k] * p[k][l] * f[j][l];
                    }
                }
                grown[i][j] = sum;
            }
        }
        self.covariance = grown;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use libm::{cos, sin};
    use types::geometry::PI;

    /// 1000 counts a metre on both sides.
    fn metric(track: f64) -> Parameters {
        Parameters::new(Differential::new(1.0 / TAU, track), 1000.0)
    }

    #[test]
    fn one_wheel_alone_draws_a_circle_around_the_other() {
        let mut odometer = Odometer::new(metric(0.5), Pose::default());
        odometer.update(0, 0);
        // The right wheel runs half the circumference of a circle of radius 0.5 m: a half turn.
        let mut last = 0;
        for i in 1..=100 {
            last = libm::round(i as f64 / 100.0 * PI * 0.5 * 1000.0) as i64;
            odometer.update(0, last);
        }
        let turned = last as f64 / 1000.0 / 0.5;
        let pose = odometer.pose();
        // The middle of the axle runs on a circle of radius 0.25 m around the left wheel.
        assert!(
            fabs(pose.x - 0.25 * sin(turned)) < 1e-9 && fabs(pose.y - 0.25 * (1.0 - cos(turned))) < 1e-9,
            "{pose:?}"
        );
    }

    #[test]
    fn straight_travel_grows_the_covariance_as_the_integral_says() {
        let (length, track, k) = (4.0, 0.4, 3e-4);
        let mut odometer = Odometer::new(metric(track), Pose::default());
        for i in 0..=4000 {
            odometer.update(i, i);
        }
        let p = odometer.covariance();
        // Closed forms: along k L/2, heading 2 k L/b², across 2 k L³/(3 b²), and the correlation k L²/b².
        for (got, want) in [
            (p[0][0], k * length / 2.0),
            (p[2][2], 2.0 * k * length / (track * track)),
            (p[1][1], 2.0 * k * length * length * length / (3.0 * track * track)),
            (p[1][2], k * length * length / (track * track)),
        ] {
            assert!(fabs(got / want - 1.0) < 2e-3, "{got} for {want}");
        }
    }

    #[test]
    fn counters_wrap_at_their_width() {
        assert_eq!(ticks_between(32_767, -32_768, 16), 1);
        assert_eq!(ticks_between(2, 65_535, 16), -3);
        assert_eq!(ticks_between(i64::MAX, i64::MIN, 64), 1);
        assert_eq!(ticks_between(5, 12, 64), 7);
    }

    proptest::proptest! {
        #[test]
        fn driving_back_the_same_counts_returns(steps in proptest::collection::vec((-40i64..40, -40i64..40), 1..50)) {
            let mut odometer = Odometer::new(metric(0.3), Pose::default());
            let (mut l, mut r) = (0, 0);
            odometer.update(l, r);
            for (dl, dr) in &steps {
                (l, r) = (l + dl, r + dr);
                odometer.update(l, r);
            }
            for (dl, dr) in steps.iter().rev() {
                (l, r) = (l - dl, r - dr);
                odometer.update(l, r);
            }
            let home = odometer.pose();
            proptest::prop_assert!(home.position().norm() < 1e-9 && fabs(home.heading) < 1e-9);
        }

        #[test]
        fn a_narrow_counter_tells_the_same_as_a_wide_one(start in -1_000_000i64..1_000_000, step in -30_000i64..30_000) {
            let narrow = |total: i64| i64::from(total as i16);
            proptest::prop_assert_eq!(ticks_between(narrow(start), narrow(start + step), 16), step);
        }
    }
}
