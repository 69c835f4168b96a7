//! Positions, poses and velocities in the plane. Metres, radians, counter-clockwise positive, x forward, y left.

use libm::{atan2, floor, hypot, sin, sincos};

/// π, and the full turn.
pub use core::f64::consts::{PI, TAU};

/// A point or a vector in the plane (m).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Point {
    /// Along x (m).
    pub x: f64,
    /// Along y (m).
    pub y: f64,
}

/// A position and a heading in the plane.
///
/// As a transform it reads `frame_from_body`: it takes a point given in the body's frame to the frame
/// in which the pose is given.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Pose {
    /// Along x (m).
    pub x: f64,
    /// Along y (m).
    pub y: f64,
    /// Counter-clockwise from x (rad).
    pub heading: f64,
}

/// The angle in [−π, π) that differs from `angle` by whole turns (rad).
pub fn wrap(angle: f64) -> f64 {
    let turned = angle + PI;
    // Most angles are in the range already. Next to its end the quotient decides.
    let turns = if (0.0..TAU - 1e-9).contains(&turned) { 0.0 } else { floor(turned / TAU) };
    let wrapped = turned - TAU * turns - PI;
    // Rounding can land exactly on the open end.
    if wrapped >= PI { wrapped - TAU } else { wrapped }
}

/// The greatest whole number that is not above `x`: what rounding down and a conversion give, in fewer instructions.
#[inline]
pub fn whole(x: f64) -> i32 {
    /// 1.5 · 2⁵²: next to it numbers have no places behind the point, so the sum is rounded, and its lowest bits are the whole number.
    const ROUNDING: f64 = 6_755_399_441_055_744.0;
    if libm::fabs(x) < 1e9 {
        let sum = x + ROUNDING;
        (sum.to_bits() as i32) - i32::from(sum - ROUNDING > x)
    } else {
        let cut = x as i32;
        cut.saturating_sub(i32::from(f64::from(cut) > x))
    }
}

impl Point {
    /// The point (x, y).
    pub const fn new(x: f64, y: f64) -> Point {
        Point { x, y }
    }

    /// The point at `distance` in the direction `bearing`.
    pub fn polar(distance: f64, bearing: f64) -> Point {
        let (s, c) = sincos(bearing);
        Point { x: distance * c, y: distance * s }
    }

    /// Length of the vector (m).
    pub fn norm(self) -> f64 {
        hypot(self.x, self.y)
    }

    /// Whether the vector is at most as long as `reach` (m, not negative). The length itself is dear and seldom needed to tell that.
    #[inline]
    pub fn is_within(self, reach: f64) -> bool {
        let (square, most) = (self.dot(self), reach * reach);
        let sure = 1e-12 * most;
        if libm::fabs(square - most) > sure { square < most } else { self.norm() <= reach }
    }

    /// Direction of the vector (rad).
    pub fn bearing(self) -> f64 {
        atan2(self.y, self.x)
    }

    /// Distance to `other` (m).
    pub fn distance(self, other: Point) -> f64 {
        (self - other).norm()
    }

    /// Scalar product.
    pub fn dot(self, other: Point) -> f64 {
        self.x * other.x + self.y * other.y
    }

    /// The z component of the vector product: positive when `other` lies to the left.
    pub fn cross(self, other: Point) -> f64 {
        self.x * other.y - self.y * other.x
    }
}

impl core::ops::Add for Point {
    type Output = Point;
    fn add(self, other: Point) -> Point {
        Point { x: self.x + other.x, y: self.y + other.y }
    }
}

impl core::ops::Sub for Point {
    type Output = Point;
    fn sub(self, other: Point) -> Point {
        Point { x: self.x - other.x, y: self.y - other.y }
    }
}

impl core::ops::Mul<f64> for Point {
    type Output = Point;
    fn mul(self, factor: f64) -> Point {
        Point { x: self.x * factor, y: self.y * factor }
    }
}

impl Pose {
    /// The pose (x, y, heading).
    pub const fn new(x: f64, y: f64, heading: f64) -> Pose {
        Pose { x, y, heading }
    }

    /// Where it is.
    pub const fn position(self) -> Point {
        Point { x: self.x, y: self.y }
    }

    /// `a_from_c` of `self = a_from_b` and `b_from_c`. The heading is wrapped.
    pub fn then(self, b_from_c: Pose) -> Pose {
        let p = self.transform(b_from_c.position());
        Pose { x: p.x, y: p.y, heading: wrap(self.heading + b_from_c.heading) }
    }

    /// `b_from_a` of `self = a_from_b`.
    pub fn inverse(self) -> Pose {
        let (s, c) = sincos(self.heading);
        Pose { x: -c * self.x - s * self.y, y: s * self.x - c * self.y, heading: wrap(-self.heading) }
    }

    /// The point in the frame of the pose, for a point given in the body's frame.
    pub fn transform(self, point: Point) -> Point {
        let (s, c) = sincos(self.heading);
        Point { x: self.x + c * point.x - s * point.y, y: self.y + s * point.x + c * point.y }
    }

    /// The pose after driving for `seconds` at a constant speed (m/s) and turn rate (rad/s): an exact arc.
    pub fn advanced(self, linear: f64, angular: f64, seconds: f64) -> Pose {
        self.along_arc(linear * seconds, angular * seconds)
    }

    /// The pose after an arc of length `distance` (m) over which the heading turns by `turn` (rad).
    pub fn along_arc(self, distance: f64, turn: f64) -> Pose {
        // The chord of an arc is 2 sin(turn/2)/turn times as long and points along the mean heading.
        let half = turn / 2.0;
        let shrink = if libm::fabs(half) < 1e-4 { 1.0 - half * half / 6.0 } else { sin(half) / half };
        let chord = Point::polar(distance * shrink, self.heading + half);
        Pose { x: self.x + chord.x, y: self.y + chord.y, heading: wrap(self.heading + turn) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use libm::cos;

    fn close(a: f64, b: f64) -> bool {
        libm::fabs(a - b) < 1e-9
    }

    #[test]
    fn a_quarter_circle_of_radius_one_ends_beside_its_centre() {
        let end = Pose::default().along_arc(PI / 2.0, PI / 2.0);
        assert!(close(end.x, 1.0) && close(end.y, 1.0) && close(end.heading, PI / 2.0), "{end:?}");
    }

    proptest::proptest! {
        #[test]
        fn wrap_keeps_the_direction(angle in -1e3f64..1e3) {
            let w = wrap(angle);
            proptest::prop_assert!((-PI..PI).contains(&w));
            proptest::prop_assert!(libm::fabs(sin(w) - sin(angle)) < 1e-9 && libm::fabs(cos(w) - cos(angle)) < 1e-9);
        }

        #[test]
        fn sine_and_cosine_together_are_to_the_last_bit_those_alone(angle in -1e6f64..1e6, exponent in -40i32..3) {
            for angle in [angle, angle * 1e-6, libm::ldexp(angle * 1e-6, exponent)] {
                proptest::prop_assert_eq!(sincos(angle), (sin(angle), cos(angle)));
            }
        }

        #[test]
        fn the_short_way_to_round_down_is_rounding_down(x in proptest::num::f64::ANY, near in -1000i32..1000) {
            for x in [x, 1e9 * libm::fmod(x, 2.0), f64::from(near) / 7.0, f64::from(near) + 0.5, f64::from(near), f64::from(near).next_down(), f64::from(near).next_up(), -0.0] {
                proptest::prop_assert_eq!(whole(x), floor(x) as i32);
            }
        }

        #[test]
        fn the_short_way_to_compare_a_length_is_to_compare_it(angle in -4f64..4.0, reach in 0f64..4.0, off in -4i64..4) {
            // As near to the reach as numbers can be.
            let point = Point::polar(f64::from_bits((reach.to_bits() as i64 + off).max(0) as u64), angle);
            proptest::prop_assert_eq!(point.is_within(reach), point.norm() <= reach);
        }

        #[test]
        fn a_pose_and_its_inverse_cancel(x in -50f64..50., y in -50f64..50., h in -3f64..3.) {
            let there_and_back = Pose::new(x, y, h).then(Pose::new(x, y, h).inverse());
            proptest::prop_assert!(there_and_back.position().norm() < 1e-9 && libm::fabs(there_and_back.heading) < 1e-9);
        }

        #[test]
        fn two_half_arcs_make_the_whole(d in -2f64..2., t in -3f64..3.) {
            let whole = Pose::default().along_arc(d, t);
            let halves = Pose::default().along_arc(d / 2.0, t / 2.0).along_arc(d / 2.0, t / 2.0);
            proptest::prop_assert!(whole.position().distance(halves.position()) < 1e-9);
        }
    }
}
