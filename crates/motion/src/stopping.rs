//! The soft emergency stop: whoever comes closer to something than it can still stop before is ramped down, and let go when the way is clear.
//!
//! ```text
//!            way ahead < critical range, or nobody sees it
//!  ┌───────┐ ────────────────────────────────────────────▶ ┌──────────┐
//!  │ Clear │                                               │ Stopping │ allowed: v₀ − a t
//!  └───────┘ ◀──────────────────────────────────────────── └──────────┘
//!            way ahead ≥ critical range + release, for `calm`
//! ```
//!
//! The critical range at a speed v, from the rim of the body:
//!
//! ```text
//! d(v) = v t + v² / 2a + m     t reaction (s), a deceleration (m/s²), m what is left after stopping (m)
//! ```
//!
//! The way ahead is measured along the arc that the body drives: on a circle of radius r = v/ω about the centre of turning, a body of radius
//! R meets a point at polar coordinates (ρ, θ) about that centre after the angle θ − acos((r² + ρ² − R²) / 2 r ρ). What is not seen, or
//! was seen too long ago, is no free way: a stale sensor is an obstacle.
//!
//! It is one of two stops. The other is no law but a latch in front of the driver:
//!
//! | kind | asked for by | order | category of IEC 60204-1, 9.2.2 | ends |
//! |---|---|---|---|---|
//! | soft | something within the critical range | a ramp | 2: controlled, the drive keeps its power | by itself, when the way is clear |
//! | hard | a contact, a person, a referee, a fault | zero, at once: the board brakes as hard as it can | 1, or 0 where hardware cuts the power | by a reset, which moves nothing |
//!
//! Software alone is never category 0. ISO 13850 wants an emergency stop to be category 0 or 1, to come before everything and to latch.

use crate::kinematics::Twist;
use crate::safety::stopping_distance;
use libm::{acos, atan2, fabs, fmax, fmin, hypot, sqrt};
use types::geometry::TAU;

/// When to stop, and how hard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// R: radius of the body, with the room kept beside it (m).
    pub radius: f64,
    /// t: from seeing to the answer of the wheels (s).
    pub reaction: f64,
    /// a: how hard the ramp brakes (m/s²).
    pub deceleration: f64,
    /// m: what is left of the way after stopping (m).
    pub margin: f64,
    /// How much more way than critical it must be before it is let go (m).
    pub release: f64,
    /// For how long that must be so (s).
    pub calm: f64,
    /// Slower than this counts as this (m/s): from standing it may begin to move when there is as much way as this needs.
    pub least: f64,
}

impl Default for Parameters {
    /// For the reactive layer's robot, 0.68 m wide.
    ///
    /// 2 cm beside the body; 0.2 s from a scan to the wheels; 1 m/s² does not tip a tall body; 10 cm are left. 10 cm more than critical for
    /// 0.3 s keep it from stuttering in front of somebody who moves. 0.1 m/s is a creep.
    fn default() -> Parameters {
        Parameters {
            radius: 0.36,
            reaction: 0.2,
            deceleration: 1.0,
            margin: 0.1,
            release: 0.1,
            calm: 0.3,
            least: 0.1,
        }
    }
}

/// The critical range at a speed (m/s), from the rim (m).
pub fn critical_range(parameters: &Parameters, speed: f64) -> f64 {
    stopping_distance(fabs(speed), parameters.reaction, parameters.deceleration) + parameters.margin
}

/// The way that a body moving by `twist` has before it meets a point (m), seen from the middle of the body; infinite where it passes it.
pub fn way_to(radius: f64, twist: Twist, x: f64, y: f64) -> f64 {
    let sign = if twist.linear < 0.0 { -1.0 } else { 1.0 };
    // Driving backwards is driving forward for one who looks back.
    let (x, y) = (sign * x, sign * y);
    if hypot(x, y) <= radius {
        // It touches: only what lies ahead of the middle is pushed on.
        return if x > 0.0 { 0.0 } else { f64::INFINITY };
    }
    let curvature = twist.angular / fmax(fabs(twist.linear), 1e-6);
    if fabs(curvature) < 1e-3 {
        let reach = radius * radius - y * y;
        return if x > 0.0 && reach > 0.0 { x - sqrt(reach) } else { f64::INFINITY };
    }
    let turn = 1.0 / fabs(curvature);
    // Seen so that it turns to the left.
    let y = if curvature > 0.0 { y } else { -y };
    let from_centre = (x, y - turn);
    let distance = hypot(from_centre.0, from_centre.1);
    let cosine = (turn * turn + distance * distance - radius * radius) / (2.0 * turn * distance);
    if !(-1.0..=1.0).contains(&cosine) {
        return f64::INFINITY;
    }
    // The angle about the centre of turning, from below it, where the body is, on.
    let bearing = atan2(from_centre.0, -from_centre.1);
    let angle = bearing - acos(cosine);
    turn * if angle < 0.0 { angle + TAU } else { angle }
}

/// What is said of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Verdict {
    /// Whether it is stopping, or stands for that.
    pub stopping: bool,
    /// The highest speed that is allowed, forward or backward (m/s); infinite while the way is clear.
    pub allowed: f64,
    /// The way ahead from the rim (m); infinite where nothing is in it, zero where nobody sees.
    pub ahead: f64,
    /// The critical range at the present speed (m).
    pub critical: f64,
}

/// Stops softly. One `step` each time something is seen, and in between.
#[derive(Clone, Copy, Debug)]
pub struct Stopping {
    parameters: Parameters,
    /// The speed that is still allowed while it stops (m/s).
    ramp: Option<f64>,
    /// For how long the way has been clear since (s).
    clear: f64,
}

impl Stopping {
    /// With a clear way.
    pub const fn new(parameters: Parameters) -> Stopping {
        Stopping { parameters, ramp: None, clear: 0.0 }
    }

    /// Goes on with other parameters.
    pub fn set_parameters(&mut self, parameters: Parameters) {
        self.parameters = parameters;
    }

    /// Judges the motion `twist`, `dt` (s) after the step before; `ahead` is the way to what is next, from the middle of the body (m):
    /// the least of [`way_to`] over all that is seen, nothing where nobody sees. What is no number is as good as not seen.
    pub fn step(&mut self, ahead: Option<f64>, twist: Twist, dt: f64) -> Verdict {
        let p = &self.parameters;
        let ahead = ahead.filter(|way| !way.is_nan()).map_or(0.0, |way| fmax(way, 0.0));
        let speed = fabs(if twist.linear.is_finite() { twist.linear } else { 0.0 });
        let critical = critical_range(p, speed);
        match self.ramp {
            None => {
                // Who stands does not come closer; who moves at all is judged at no less than a creep.
                if ahead < critical {
                    self.ramp = Some(speed);
                    self.clear = 0.0;
                }
            }
            Some(ramp) => {
                let is_free = ahead >= critical_range(p, fmax(speed, p.least)) + p.release;
                self.clear = if is_free { self.clear + dt } else { 0.0 };
                self.ramp = if self.clear >= p.calm && is_free {
                    None
                } else {
                    Some(fmax(fmin(ramp, speed_or(ramp, speed)) - p.deceleration * dt, 0.0))
                };
            }
        }
        Verdict {
            stopping: self.ramp.is_some(),
            allowed: self.ramp.unwrap_or(f64::INFINITY),
            ahead,
            critical,
        }
    }
}

/// Where the body is slower than the ramp already, the ramp goes on from there, but no faster than the body can be measured to slow.
fn speed_or(ramp: f64, speed: f64) -> f64 {
    if speed < 0.5 * ramp { speed } else { ramp }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use types::geometry::PI;
    use types::{Point, Pose};

    #[test]
    fn the_critical_range_is_that_of_the_stopping_distance() {
        let parameters =
            Parameters { reaction: 0.2, deceleration: 1.0, margin: 0.0, ..Parameters::default() };
        // 0.3 · 0.2 + 0.09 / 2
        assert!((critical_range(&parameters, 0.3) - 0.105).abs() < 1e-12);
        assert!((critical_range(&parameters, -0.3) - 0.105).abs() < 1e-12);
    }

    #[test]
    fn ways_along_lines_and_arcs_are_right_by_hand() {
        let straight = Twist::new(0.3, 0.0);
        assert!((way_to(0.3, straight, 1.0, 0.0) - 0.7).abs() < 1e-12);
        // 0.3² = 0.18² + 0.24²
        assert!((way_to(0.3, straight, 1.0, 0.18) - 0.76).abs() < 1e-12);
        assert_eq!(way_to(0.3, straight, 1.0, 0.31), f64::INFINITY, "beside");
        assert_eq!(way_to(0.3, straight, -1.0, 0.0), f64::INFINITY, "behind");
        assert!((way_to(0.3, Twist::new(-0.3, 0.0), -1.0, 0.0) - 0.7).abs() < 1e-12, "backwards");
        // On a circle of 1 m to the left the middle comes to (1, 1) after a quarter; a body of 0.1 m meets it 2 asin(0.05) before.
        let left = Twist::new(0.5, 0.5);
        let expected = PI / 2.0 - 2.0 * libm::asin(0.05);
        assert!((way_to(0.1, left, 1.0, 1.0) - expected).abs() < 1e-9);
        assert!((way_to(0.1, Twist::new(0.5, -0.5), 1.0, -1.0) - expected).abs() < 1e-9, "to the right");
        assert_eq!(way_to(0.1, left, 1.0, 0.0), f64::INFINITY, "straight on, which it leaves");
        assert_eq!(way_to(0.3, straight, 0.2, 0.1), 0.0, "it touches");
        assert_eq!(way_to(0.3, straight, -0.2, 0.1), f64::INFINITY, "what it touches stays behind");
    }

    #[test]
    fn it_ramps_down_stands_and_lets_go_by_itself() {
        let parameters = Parameters { calm: 0.1, ..Parameters::default() };
        let mut stopping = Stopping::new(parameters);
        let drive = |speed| Twist::new(speed, 0.0);
        assert!(!stopping.step(Some(1.0), drive(0.5), 0.02).stopping);
        // 0.5 · 0.2 + 0.125 + 0.1 = 0.325
        assert!(stopping.step(Some(0.32), drive(0.5), 0.02).stopping);
        let mut speed = 0.5;
        for i in 1..=25 {
            let verdict = stopping.step(Some(0.2), drive(speed), 0.02);
            assert!(
                (verdict.allowed - (0.5 - 0.02 * f64::from(i)).max(0.0)).abs() < 1e-12,
                "{i}: {verdict:?}"
            );
            speed = verdict.allowed;
        }
        assert_eq!(speed, 0.0);
        // A creep needs 0.02 + 0.005 + 0.1, and 0.1 more.
        assert!(stopping.step(Some(0.22), drive(0.0), 1.0).stopping, "not yet");
        for _ in 0..4 {
            assert!(stopping.step(Some(0.23), drive(0.0), 0.02).stopping, "not long enough");
        }
        assert!(stopping.step(Some(0.22), drive(0.0), 0.02).stopping, "from the beginning");
        for _ in 0..4 {
            assert!(stopping.step(Some(0.23), drive(0.0), 0.02).stopping);
        }
        assert_eq!(stopping.step(Some(0.23), drive(0.0), 0.02).allowed, f64::INFINITY);
    }

    #[test]
    fn what_nobody_sees_is_an_obstacle() {
        for blind in [None, Some(f64::NAN)] {
            let mut stopping = Stopping::new(Parameters::default());
            let verdict = stopping.step(blind, Twist::new(0.3, 0.0), 0.02);
            assert_eq!((verdict.stopping, verdict.ahead), (true, 0.0));
            assert!(stopping.step(blind, Twist::ZERO, 60.0).stopping, "for as long as it lasts");
        }
    }

    proptest! {
        #[test]
        fn the_way_along_an_arc_is_that_to_the_first_touch(
            radius in 0.1..0.5f64, linear in 0.1..1.0f64, angular in -1.5..1.5f64, x in -3.0..3.0f64, y in -3.0..3.0f64,
        ) {
            prop_assume!(hypot(x, y) > radius + 0.02);
            let twist = Twist::new(linear, angular);
            let way = way_to(radius, twist, x, y);
            let whole_turn = TAU * linear / fabs(angular).max(1e-9);
            let touched = |way: f64| {
                let pose = Pose::default().along_arc(way, way * angular / linear);
                pose.position().distance(Point::new(x, y)) < radius
            };
            let first = (0..8000).map(|i| 0.001 * f64::from(i)).take_while(|way| *way < whole_turn).find(|way| touched(*way));
            match first {
                Some(first) => prop_assert!((first - way).abs() < 0.05, "{first} {way}"),
                None => prop_assert!(way > 7.9 || way > whole_turn - 0.05 || {
                    // It only grazes it.
                    let pose = Pose::default().along_arc(way, way * angular / linear);
                    (pose.position().distance(Point::new(x, y)) - radius).abs() < 1e-6
                }, "{way}"),
            }
        }

        #[test]
        fn it_never_touches_a_wall_whatever_it_is_told_to_drive(
            wishes in proptest::collection::vec(0.0..0.8f64, 1..12), start in 1.0..4.0f64, lag in 1u32..9,
        ) {
            // The wheels answer what was allowed `lag` steps ago, which is less than the reaction, and brake no harder than the ramp.
            let parameters = Parameters::default();
            let mut stopping = Stopping::new(parameters);
            let (mut at, mut speed) = (0.0, 0.0);
            let mut late = std::collections::VecDeque::from(std::vec![0.0; lag as usize]);
            for i in 0..600 {
                let ahead = way_to(parameters.radius, Twist::new(1.0, 0.0), start - at, 0.0);
                let verdict = stopping.step(Some(ahead), Twist::new(speed, 0.0), 0.02);
                late.push_back(wishes[i / 50 % wishes.len()].min(verdict.allowed));
                let wish: f64 = late.pop_front().unwrap();
                speed += (wish - speed).clamp(-parameters.deceleration * 0.02, 0.5 * 0.02);
                at += speed * 0.02;
                prop_assert!(at < start - parameters.radius, "after {i} steps at {speed} m/s");
            }
        }
    }
}
