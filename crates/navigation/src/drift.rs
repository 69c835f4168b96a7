//! How far dead reckoning may be off after a motion.
//!
//! Each wheel errs by itself, with a variance that grows with its way (Chong and Kleeman 1997, "Accurate odometry and error modelling for a
//! mobile robot"):
//!
//! ```text
//!   var(left) = k |left|,  var(right) = k |right|,  distance = (left + right)/2,  turn = (right − left)/b
//! ```
//!
//! with `k` (m) and the distance `b` of the wheels (m).

use libm::{fabs, sin, sincos, sqrt};
use motion::odometry::Increment;
use types::Pose;
use types::chance::Stream;

use crate::linear::Matrix;

/// What is known of the errors of dead reckoning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drift {
    /// Variance of the way of a wheel for each metre of it (m). 0.0005 is a deviation of 2 cm after a metre: more than wheels slip, as wheels that
    /// are larger than was thought go wrong in the same way all the time.
    pub wheel: f64,
    /// Distance between the wheels (m). 0.36 is that of the exploring robot.
    pub track: f64,
    /// Deviation across the way for each square root of a metre (m). 0.005: tyres give way a little in turns.
    pub aside: f64,
}

impl Default for Drift {
    fn default() -> Drift {
        Drift { wheel: 0.0005, track: 0.36, aside: 0.005 }
    }
}

/// The arc of a motion; backwards is negative.
pub(crate) fn arc(moved: Pose) -> Increment {
    let half = moved.heading / 2.0;
    let (s, c) = sincos(half);
    let chord = moved.x * c + moved.y * s;
    let longer = if fabs(half) < 1e-4 { 1.0 + half * half / 6.0 } else { half / sin(half) };
    Increment { distance: chord * longer, turn: moved.heading }
}

impl Drift {
    /// Variances of the ways of both wheels (m²).
    fn wheels(&self, arc: Increment) -> (f64, f64) {
        let half = arc.turn * self.track / 2.0;
        (self.wheel * fabs(arc.distance - half), self.wheel * fabs(arc.distance + half))
    }

    /// The covariance of a motion, in the frame in which it began.
    pub(crate) fn covariance(&self, moved: Pose) -> Matrix {
        let arc = arc(moved);
        let (left, right) = self.wheels(arc);
        let (distance, turn) = ((left + right) / 4.0, (left + right) / (self.track * self.track));
        let both = (right - left) / (2.0 * self.track);
        let half = arc.turn / 2.0;
        let (s, c) = sincos(half);
        // The chord is so much shorter than the arc, and becomes shorter by so much of it when it turns more.
        let small = fabs(half) < 1e-4;
        let shrink = if small { 1.0 - half * half / 6.0 } else { s / half };
        let shrinks = arc.distance * if small { -half / 6.0 } else { (c - shrink) / (2.0 * half) };
        // How the end moves with the length of the arc and with its turn.
        let (by_distance, chord) = ([c * shrink, s * shrink, 0.0], arc.distance * shrink);
        let by_turn = [shrinks * c - chord / 2.0 * s, shrinks * s + chord / 2.0 * c, 1.0];
        let aside = self.aside * self.aside * fabs(arc.distance);
        let (s, c) = sincos(arc.turn);
        let across = [-s, c, 0.0];
        core::array::from_fn(|i| {
            core::array::from_fn(|j| {
                distance * by_distance[i] * by_distance[j]
                    + turn * by_turn[i] * by_turn[j]
                    + both * (by_distance[i] * by_turn[j] + by_turn[i] * by_distance[j])
                    + aside * across[i] * across[j]
            })
        })
    }

    /// A motion as it may have been, by the draws 0 and 1 of a stream.
    pub(crate) fn draw(&self, moved: Pose, stream: Stream) -> Pose {
        let arc = arc(moved);
        let (left, right) = self.wheels(arc);
        let (a, b) = stream.normals(0);
        let (left, right) = (sqrt(left) * a, sqrt(right) * b);
        let aside = self.aside * sqrt(fabs(arc.distance)) * stream.normal(1);
        let moved = Pose::default()
            .along_arc(arc.distance + (left + right) / 2.0, arc.turn + (right - left) / self.track);
        moved.then(Pose::new(0.0, aside, 0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use types::geometry::wrap;

    #[test]
    fn the_covariance_is_that_of_what_is_drawn() {
        let drift = Drift::default();
        for moved in [
            Pose::default().along_arc(0.3, 0.4),
            Pose::default().along_arc(-0.2, 0.1),
            Pose::default().along_arc(0.0, -0.6),
            Pose::new(0.25, 0.0, 0.0),
        ] {
            let expected = drift.covariance(moved);
            let n = 40_000u64;
            let mut found = [[0.0; 3]; 3];
            for i in 0..n {
                let drawn = drift.draw(moved, Stream::new(5, "drift").sample(i));
                let off = [drawn.x - moved.x, drawn.y - moved.y, wrap(drawn.heading - moved.heading)];
                for (row, a) in found.iter_mut().zip(off) {
                    row.iter_mut().zip(off).for_each(|(place, b)| *place += a * b / n as f64);
                }
            }
            for i in 0..3 {
                for j in 0..3 {
                    let scale = (expected[i][i] * expected[j][j]).sqrt();
                    let off = (found[i][j] - expected[i][j]).abs();
                    assert!(
                        off <= 0.05 * scale + 1e-9,
                        "{moved:?} {i} {j}: {} for {}",
                        found[i][j],
                        expected[i][j]
                    );
                }
            }
        }
    }

    #[test]
    fn a_metre_ahead_is_off_by_what_both_wheels_are_off() {
        // var(distance) = k (1 + 1)/4, var(turn) = k (1 + 1)/b².
        let drift = Drift { wheel: 0.0004, track: 0.4, aside: 0.0 };
        let covariance = drift.covariance(Pose::new(1.0, 0.0, 0.0));
        assert!((covariance[0][0] - 0.0002).abs() < 1e-12 && (covariance[2][2] - 0.005).abs() < 1e-12);
        // The turn comes on the way, so it counts half.
        assert!((covariance[1][1] - 0.005 / 4.0).abs() < 1e-12);
    }
}
