//! What was seen: range and bearing of something whose place is known, or from somebody who knows where they are.
//!
//! ```text
//! z = (r, β)      ẑ = (|d|, atan2(d) − heading + e_b)      d from who sees to what is seen
//! S = H P Hᵀ + R      K = P Hᵀ S⁻¹      P ← (I − K H) P (I − K H)ᵀ + K R Kᵀ
//! ```
//!
//! The last form (Joseph's) keeps P symmetric and positive whatever K is. R is the noise of range and bearing, and where the other end is
//! uncertain too, what that does to them. An outlier is left out, or, with [`tails`](Parameters::tails) ν, R of range and of bearing grow by
//! (ν + y²/s)/(ν + 1) where that is more than one: the weight that the expectation gives to a draw of Student's distribution with the
//! innovation y of variance s (Lange, Little and Taylor, "Robust statistical modeling using the t distribution", 1989).

use libm::{atan2, hypot, sincos};
use nalgebra::{SMatrix, SVector};
use types::geometry::wrap;
use types::{Point, Pose};

use super::filter::{Covariance, Filter, Parameters, STATES};

/// Nearer than this a bearing means nothing (m).
const NEAREST: f64 = 0.05;

type Gradient = SMatrix<f64, 2, STATES>;
pub(super) type Two = SMatrix<f64, 2, 2>;

/// Range and bearing of something.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sighting {
    /// How far it is (m).
    pub range: f64,
    /// Where it is, from straight ahead to the left (rad).
    pub bearing: f64,
}

/// A sighting and what is known of its other end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sight {
    /// The robot sees something that stands at a place known as well as its covariance says (m²).
    Of(Sighting, Point, [[f64; 2]; 2]),
    /// The robot sees another one that believes to be at a place.
    OfRobot(Sighting, View),
    /// Another robot sees this one.
    FromRobot(Sighting, View),
    /// The robot is about at a place, as well as its covariance says (m²): who hears a beacon is near it.
    Near(Point, [[f64; 2]; 2]),
}

/// What a robot tells others, so that they know where it is and what its sightings mean.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct View {
    /// Where it is, and the direction in which it sees what it says to be straight ahead.
    pub pose: Pose,
    /// Covariance of x (m), y (m), that direction (rad).
    pub spread: [[f64; 3]; 3],
}

/// What came of a sighting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effect {
    /// How far from what was expected (squared Mahalanobis distance).
    pub surprise: f64,
    /// Whether it was used.
    pub used: bool,
    /// How far the pose was moved (m).
    pub moved: f64,
}

impl Effect {
    pub(super) const NONE: Effect = Effect { surprise: f64::INFINITY, used: false, moved: 0.0 };
}

/// A sighting as the filter sees it.
pub(super) struct Expected {
    gradient: Gradient,
    /// By where the other end is: x, y, direction.
    by_other: SMatrix<f64, 2, 3>,
    innovation: SVector<f64, 2>,
}

impl Filter {
    /// What others are told.
    pub fn view(&self) -> View {
        // x, y and heading less the error of the bearing.
        let mut take = SMatrix::<f64, 3, STATES>::identity();
        take[(2, 7)] = -1.0;
        let spread = take * self.covariance * take.transpose();
        let pose = self.pose();
        View {
            pose: Pose::new(pose.x, pose.y, wrap(pose.heading - self.state[7])),
            spread: core::array::from_fn(|i| core::array::from_fn(|j| spread[(i, j)])),
        }
    }

    /// Sets the state right by a sighting. One that is no number, or nearer than a hand, is not used.
    pub fn correct(&mut self, parameters: &Parameters, sight: &Sight) -> Effect {
        let Some((expected, noise)) = self.expect(parameters, sight) else { return Effect::NONE };
        let spread = self.innovation_spread(&expected, noise);
        let Some(surprise) = surprise(&expected, spread) else { return Effect::NONE };
        let noise = match parameters.tails {
            Some(freedom) => noise + heavier(freedom, &expected, spread, noise),
            None if surprise > parameters.gate => return Effect { surprise, ..Effect::NONE },
            None => noise,
        };
        let moved = self.apply(&expected, noise);
        Effect { surprise, used: moved.is_some(), moved: moved.unwrap_or(0.0) }
    }

    /// What is expected, and the noise of it.
    pub(super) fn expect(&self, parameters: &Parameters, sight: &Sight) -> Option<(Expected, Two)> {
        let (seen, other, spread) = match sight {
            Sight::Near(at, [[xx, xy], [yx, yy]]) => {
                return Some((self.nearness(*at), Two::new(*xx, *xy, *yx, *yy)));
            }
            Sight::Of(seen, at, [[xx, xy], [yx, yy]]) => {
                let spread = SMatrix::<f64, 3, 3>::new(*xx, *xy, 0.0, *yx, *yy, 0.0, 0.0, 0.0, 0.0);
                (seen, Pose::new(at.x, at.y, 0.0), spread)
            }
            Sight::OfRobot(seen, view) | Sight::FromRobot(seen, view) => {
                let spread = SMatrix::<f64, 3, 3>::from_fn(|i, j| view.spread[i][j]);
                (seen, view.pose, spread * parameters.doubt)
            }
        };
        let is_seen = matches!(sight, Sight::FromRobot(..));
        let expected = self.geometry(*seen, other, is_seen)?;
        let spread_of_other = expected.by_other * spread * expected.by_other.transpose();
        let deviation = parameters.range + parameters.range_part * seen.range;
        let mut noise = Two::new(deviation * deviation, 0.0, 0.0, parameters.bearing * parameters.bearing);
        if !matches!(sight, Sight::Of(..)) {
            let body = parameters.body;
            let far = hypot(other.x - self.state[0], other.y - self.state[1]);
            noise += Two::new(body * body, 0.0, 0.0, body * body / (far * far));
        }
        Some((expected, noise + spread_of_other))
    }

    fn nearness(&self, at: Point) -> Expected {
        let mut gradient = Gradient::zeros();
        (gradient[(0, 0)], gradient[(1, 1)]) = (1.0, 1.0);
        let innovation = SVector::<f64, 2>::new(at.x - self.state[0], at.y - self.state[1]);
        Expected { gradient, by_other: SMatrix::zeros(), innovation }
    }

    fn geometry(&self, seen: Sighting, other: Pose, is_seen: bool) -> Option<Expected> {
        let [x, y, heading] = [self.state[0], self.state[1], self.state[2]];
        // From who sees to what is seen.
        let sign = if is_seen { -1.0 } else { 1.0 };
        let (dx, dy) = (sign * (other.x - x), sign * (other.y - y));
        let range = hypot(dx, dy);
        if !(range >= NEAREST && seen.range.is_finite() && seen.bearing.is_finite()) {
            return None;
        }
        let direction = if is_seen { other.heading } else { heading - self.state[7] };
        let (towards, aside) = ([dx / range, dy / range], [-dy / (range * range), dx / (range * range)]);
        let mut gradient = Gradient::zeros();
        let mut by_other = SMatrix::<f64, 2, 3>::zeros();
        for axis in 0..2 {
            gradient[(0, axis)] = -sign * towards[axis];
            gradient[(1, axis)] = -sign * aside[axis];
            by_other[(0, axis)] = sign * towards[axis];
            by_other[(1, axis)] = sign * aside[axis];
        }
        if is_seen {
            by_other[(1, 2)] = -1.0;
        } else {
            gradient[(1, 2)] = -1.0;
            gradient[(1, 7)] = 1.0;
        }
        let bearing = wrap(seen.bearing - (atan2(dy, dx) - direction));
        Some(Expected { gradient, by_other, innovation: SVector::<f64, 2>::new(seen.range - range, bearing) })
    }

    pub(super) fn innovation_spread(&self, expected: &Expected, noise: Two) -> Two {
        expected.gradient * self.covariance * expected.gradient.transpose() + noise
    }

    /// How far the pose was moved; nothing when the spread cannot be inverted.
    fn apply(&mut self, expected: &Expected, noise: Two) -> Option<f64> {
        let h = expected.gradient;
        let ph = self.covariance * h.transpose();
        let gain = ph * inverse(h * ph + noise)?;
        let step = gain * expected.innovation;
        if !step.iter().all(|entry| entry.is_finite()) {
            return None;
        }
        self.state += step;
        self.state[2] = wrap(self.state[2]);
        let keep = Covariance::identity() - gain * h;
        let joined = keep * self.covariance * keep.transpose() + gain * noise * gain.transpose();
        self.covariance = (joined + joined.transpose()) * 0.5;
        Some(hypot(step[0], step[1]))
    }
}

/// Squared Mahalanobis distance of the innovation.
pub(super) fn surprise(expected: &Expected, spread: Two) -> Option<f64> {
    let y = expected.innovation;
    let distance = (y.transpose() * inverse(spread)? * y)[(0, 0)];
    distance.is_finite().then_some(distance)
}

/// What is added to the noise of range and bearing so that Student's distribution is served.
fn heavier(freedom: f64, expected: &Expected, spread: Two, noise: Two) -> Two {
    let more = |axis: usize| {
        let y = expected.innovation[axis];
        let factor = (freedom + y * y / spread[(axis, axis)]) / (freedom + 1.0);
        (factor - 1.0).max(0.0) * noise[(axis, axis)]
    };
    Two::new(more(0), 0.0, 0.0, more(1))
}

/// Nothing where it is not positive definite.
fn inverse(m: Two) -> Option<Two> {
    let determinant = m[(0, 0)] * m[(1, 1)] - m[(0, 1)] * m[(1, 0)];
    (determinant > 0.0 && determinant.is_finite() && m[(0, 0)] > 0.0)
        .then(|| Two::new(m[(1, 1)], -m[(0, 1)], -m[(1, 0)], m[(0, 0)]) / determinant)
}

/// What a robot at `pose` sees of a point: for simulations and tests.
pub fn seen_from(pose: Pose, point: Point) -> Sighting {
    let (s, c) = sincos(pose.heading);
    let (dx, dy) = (point.x - pose.x, point.y - pose.y);
    Sighting { range: hypot(dx, dy), bearing: atan2(c * dy - s * dx, c * dx + s * dy) }
}

#[cfg(test)]
mod tests {
    use super::super::filter::{Errors, Vector};
    use super::*;
    use proptest::prelude::*;

    /// What is expected less what is seen changes with the state, and with where the other end is, as the gradients say.
    fn check(state: Vector, other: Pose, is_seen: bool) -> Result<(), TestCaseError> {
        let seen = Sighting { range: 2.0, bearing: 0.3 };
        let filter = |state: Vector| Filter { state, covariance: Covariance::identity() };
        let Some(expected) = filter(state).geometry(seen, other, is_seen) else { return Ok(()) };
        let close = |more: SVector<f64, 2>, less: SVector<f64, 2>, want: [f64; 2]| {
            let by = [(less[0] - more[0]) / 2e-6, wrap(less[1] - more[1]) / 2e-6];
            (by[0] - want[0]).abs() < 1e-5 && (by[1] - want[1]).abs() < 1e-5 * (1.0 + want[1].abs())
        };
        for k in 0..STATES {
            let mut off = Vector::zeros();
            off[k] = 1e-6;
            let at = |state| filter(state).geometry(seen, other, is_seen).unwrap().innovation;
            let want = [expected.gradient[(0, k)], expected.gradient[(1, k)]];
            prop_assert!(close(at(state + off), at(state - off), want), "state {k}");
        }
        for k in 0..3 {
            let moved = |by: f64| {
                let [dx, dy, dh] = [0, 1, 2].map(|axis| if axis == k { by } else { 0.0 });
                let other = Pose::new(other.x + dx, other.y + dy, other.heading + dh);
                filter(state).geometry(seen, other, is_seen).unwrap().innovation
            };
            let want = [expected.by_other[(0, k)], expected.by_other[(1, k)]];
            // A point has no direction, and what is seen needs none.
            prop_assert!(close(moved(1e-6), moved(-1e-6), want), "other {k}");
        }
        Ok(())
    }

    proptest! {
        #[test]
        fn gradients_are_what_small_changes_do(
            x in -3.0..3.0f64, y in -3.0..3.0f64, heading in -3.0..3.0f64, error in -0.2..0.2f64,
            u in -3.0..3.0f64, v in -3.0..3.0f64, direction in -3.0..3.0f64, is_seen in any::<bool>()
        ) {
            prop_assume!(hypot(u - x, v - y) > 0.2);
            let mut state = Vector::zeros();
            (state[0], state[1], state[2], state[7]) = (x, y, heading, error);
            check(state, Pose::new(u, v, direction), is_seen)?;
        }

        #[test]
        fn who_sees_and_who_is_seen_agree_where_both_are(
            x in -3.0..3.0f64, y in -3.0..3.0f64, heading in -3.0..3.0f64, u in -3.0..3.0f64, v in -3.0..3.0f64, error in -0.1..0.1f64
        ) {
            prop_assume!(hypot(u - x, v - y) > 0.3);
            let parameters = Parameters { usual: Errors::default(), ..Parameters::default() };
            let small = [[1e-6, 0.0, 0.0], [0.0, 1e-6, 0.0], [0.0, 0.0, 1e-6]];
            let large = [[0.04, 0.0, 0.0], [0.0, 0.04, 0.0], [0.0, 0.0, 0.04]];
            let (here, there) = (Pose::new(x, y, heading), Pose::new(u, v, 1.0));
            let exact = seen_from(here, there.position());
            let seen = Sighting { bearing: wrap(exact.bearing + error), ..exact };
            let knows = Filter::new(&parameters, here, small).with_errors(Errors { bearing: error, ..Errors::default() });
            // Who is seen was wrong by some centimetres, and is set right by what the other tells.
            let mut lost = Filter::new(&parameters, Pose::new(u + 0.1, v - 0.1, 1.0), large);
            let before = lost.pose().position().distance(there.position());
            for _ in 0..40 {
                lost.correct(&parameters, &Sight::FromRobot(seen, knows.view()));
            }
            prop_assert!(lost.pose().position().distance(there.position()) < 0.2 * before, "{:?}", lost.pose());
        }
    }

    #[test]
    fn what_others_are_told_of_the_direction_takes_in_the_camera() {
        let parameters = Parameters::default();
        let spread = [[0.01, 0.0, 0.0], [0.0, 0.02, 0.0], [0.0, 0.0, 0.03]];
        let filter = Filter::new(&parameters, Pose::new(1.0, 2.0, 0.5), spread)
            .with_errors(Errors { bearing: 0.1, ..Errors::default() });
        let view = filter.view();
        assert!((view.pose.heading - 0.4).abs() < 1e-12);
        // Independent, so their variances add.
        let usual = parameters.usual.bearing;
        assert!((view.spread[2][2] - (0.03 + usual * usual)).abs() < 1e-12, "{:?}", view.spread);
        assert_eq!((view.spread[0][0], view.spread[1][1]), (0.01, 0.02));
    }

    #[test]
    fn what_is_no_number_or_too_near_is_not_used() {
        let parameters = Parameters::default();
        let mut filter =
            Filter::new(&parameters, Pose::default(), [[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]]);
        let before = filter;
        for (range, bearing, at) in [
            (f64::NAN, 0.0, Point::new(1.0, 0.0)),
            (1.0, f64::INFINITY, Point::new(1.0, 0.0)),
            (1.0, 0.0, Point::new(0.01, 0.0)),
            (1.0, 0.0, Point::new(f64::NAN, 0.0)),
        ] {
            assert!(
                !filter.correct(&parameters, &Sight::Of(Sighting { range, bearing }, at, [[0.0; 2]; 2])).used
            );
        }
        assert_eq!(filter, before);
    }
}
