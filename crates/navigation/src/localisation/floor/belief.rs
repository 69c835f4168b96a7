//! A pose and how sure it is.

use libm::sincos;
use types::Pose;
use types::geometry::wrap;

use super::FloorParams;
use crate::drift::Drift;
use crate::linear::{Matrix, Vector, ZERO, deviations, diagonal, dot, inverse, product, sum, through, times};

/// Deviations of a robot of which nothing is known (m, rad): as large as floors are.
const UNKNOWN: (f64, f64) = (100.0, 10.0);
/// Deviations after a search, in directions that the scan does not tell (m, rad).
const FOUND: (f64, f64) = (0.3, 0.2);
/// So much is added from scan to scan (m, rad): the errors of the plan are the same from scan to scan, so that many scans know no more than a few.
const CREEP: (f64, f64) = (0.0007, 0.0004);

/// A normal law over poses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Belief {
    pub(super) pose: Pose,
    pub(super) covariance: Matrix,
}

fn squares((place, heading): (f64, f64)) -> Matrix {
    diagonal([place * place, place * place, heading * heading])
}

impl Default for Belief {
    fn default() -> Belief {
        Belief { pose: Pose::default(), covariance: squares(UNKNOWN) }
    }
}

impl Belief {
    /// What a scan alone says.
    pub(super) fn of(pose: Pose, information: &Matrix) -> Belief {
        let prior = inverse(&squares(FOUND)).unwrap_or(ZERO);
        let covariance = inverse(&sum(information, &prior)).unwrap_or(squares(FOUND));
        Belief { pose, covariance }
    }

    /// Whether anything is known.
    pub(super) fn is_known(&self) -> bool {
        self.covariance[0][0] < UNKNOWN.0 * UNKNOWN.0 / 4.0
    }

    /// After a motion.
    pub(super) fn predict(&mut self, moved: Pose, drift: &Drift) {
        let Pose { x, y, heading } = self.pose;
        self.pose = self.pose.then(moved);
        let (dx, dy) = (self.pose.x - x, self.pose.y - y);
        let with = [[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 1.0]];
        let (s, c) = sincos(heading);
        let turn = [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]];
        let noise = through(&turn, &drift.covariance(moved));
        self.covariance = sum(&sum(&through(&with, &self.covariance), &noise), &squares(CREEP));
    }

    /// Takes a measurement over, and gives whether it lies within the gate; else nothing changes.
    pub(super) fn correct(&mut self, measured: Pose, information: &Matrix, gate: f64) -> bool {
        let off: Vector =
            [measured.x - self.pose.x, measured.y - self.pose.y, wrap(measured.heading - self.pose.heading)];
        let Some(prior) = inverse(&self.covariance) else { return false };
        let Some(covariance) = inverse(&sum(&prior, information)) else { return false };
        // (P + R)⁻¹ = I − I (P⁻¹ + I)⁻¹ I, also where the measurement says nothing in some direction.
        let told = times(information, &off);
        let far = dot(&off, &told) - dot(&told, &times(&covariance, &told));
        if far > gate || far.is_nan() {
            return false;
        }
        let step = times(&product(&covariance, information), &off);
        self.pose =
            Pose::new(self.pose.x + step[0], self.pose.y + step[1], wrap(self.pose.heading + step[2]));
        self.covariance = covariance;
        true
    }

    /// Deviations of the place along the axis in which it is larger (m), and of the heading (rad).
    pub(super) fn deviations(&self) -> (f64, f64) {
        deviations(&self.covariance)
    }

    /// So far off (m) may be what is looked for.
    pub(super) fn reach(&self, params: &FloorParams) -> f64 {
        const LEVER: f64 = 3.0;
        let (place, heading) = self.deviations();
        (0.1 + 3.0 * (place + LEVER * heading)).min(params.matching.reach)
    }
}
