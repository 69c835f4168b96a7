//! Passive safety: whoever walks into the robot finds it standing.
//!
//! Nobody can keep all people from touching a robot, for they are faster. What it can do is not to drive into anybody: it goes only as
//! fast as it can stop before somebody reaches the half of its rim that goes ahead, wherever he comes from. Everything that is
//! seen may begin to walk, and people behind it are farther away; so no one need be recognised, followed or foreseen.
//!
//! ```text
//!   gap g ≥ u' (t + v/a)  +  c (v t + v²/2a)  +  m
//!            what he walks     what it drives     what is left
//!
//!   u' = u + |ω| R: how fast he comes, and the rim turns towards him; c: cosine between the motion and him, not below 0
//!   t: reaction (s), a: deceleration (m/s²)
//! ```
//!
//! The highest speed with which that holds is the positive root of a quadratic equation; there is none where he is nearer than he
//! walks before it answers. A touch of the half that goes behind is not of its doing.
//!
//! Macek, Vasquez Govea, Fraichard and Siegwart 2009, "Towards safe vehicle navigation in dynamic urban scenarios"; Bouraine, Fraichard and Salhi
//! 2012, "Provably safe navigation for mobile robots with limited field-of-views in dynamic environments".

use libm::{fabs, fmax, hypot, sqrt};

use crate::kinematics::Twist;

/// A round robot, and those who may come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// R: radius of the body (m).
    pub radius: f64,
    /// t: from seeing to the answer of the wheels (s).
    pub reaction: f64,
    /// a: how hard it brakes (m/s²).
    pub deceleration: f64,
    /// m: what is left between the two (m).
    pub margin: f64,
    /// u: how fast people walk (m/s).
    pub people: f64,
}

/// The highest speed (m/s) at which a robot that moves by `twist` can stop before somebody who is seen at (x, y) reaches the half of the rim
/// that goes ahead. In the robot's frame (m).
pub fn speed(parameters: &Parameters, twist: Twist, x: f64, y: f64) -> f64 {
    let p = parameters;
    let x = if twist.linear < 0.0 { -x } else { x };
    // The nearest point of the half disc that goes ahead: for one behind it, of its chord.
    let (gap, cosine) = if x >= 0.0 {
        let distance = fmax(hypot(x, y), 1e-9);
        (distance - p.radius, x / distance)
    } else {
        (hypot(x, fmax(fabs(y) - p.radius, 0.0)), 0.0)
    };
    let people = p.people + fabs(twist.angular) * p.radius;
    // a v² + b v + c = 0
    let a = cosine / (2.0 * p.deceleration);
    let b = cosine * p.reaction + people / p.deceleration;
    let c = people * p.reaction + p.margin - gap;
    if c >= 0.0 {
        return 0.0;
    }
    // Of the two ways to write the root the one that stays right where a is small.
    2.0 * -c / (b + sqrt(b * b - 4.0 * a * c))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use types::{Point, Pose};

    const PARAMETERS: Parameters =
        Parameters { radius: 0.34, reaction: 0.2, deceleration: 1.0, margin: 0.05, people: 1.5 };

    #[test]
    fn speeds_are_right_by_hand() {
        let ahead = Twist::new(0.3, 0.0);
        // 1.5 (0.2 + 0.3) + 0.3 · 0.2 + 0.09/2 + 0.05 = 0.905
        assert!((speed(&PARAMETERS, ahead, 0.34 + 0.905, 0.0) - 0.3).abs() < 1e-12);
        // At the side it drives past him: 1.5 (0.2 + 0.3) + 0.05
        assert!((speed(&PARAMETERS, ahead, 0.0, -0.34 - 0.8) - 0.3).abs() < 1e-12);
        // Behind, to the end of the chord: 0.48² + 0.64² = 0.8²
        assert!((speed(&PARAMETERS, ahead, -0.48, 0.34 + 0.64) - 0.3).abs() < 1e-12);
        assert_eq!(speed(&PARAMETERS, ahead, 0.34 + 0.35, 0.0), 0.0, "he is there before it answers");
        assert!(speed(&PARAMETERS, ahead, 0.34 + 0.36, 0.0) > 0.0);
        let back = Twist::new(-0.3, 0.0);
        assert!((speed(&PARAMETERS, back, -0.34 - 0.905, 0.0) - 0.3).abs() < 1e-12);
        // The rim turns by 1 · 0.34 m/s: 1.84 (0.2 + 0.3) + 0.105 + 0.05
        assert!((speed(&PARAMETERS, Twist::new(0.3, -1.0), 0.34 + 1.075, 0.0) - 0.3).abs() < 1e-12);
        // Where nobody walks it is the critical range.
        let still = Parameters { people: 0.0, ..PARAMETERS };
        assert!((speed(&still, ahead, 0.34 + 0.155, 0.0) - 0.3).abs() < 1e-12);
        assert!(speed(&still, ahead, -1.0, 0.0) > 1e3, "what stands behind is in nobody's way");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        /// Somebody walks straight at a point of the robot, from anywhere and at any moment; it drives arcs as fast as it is allowed, and its wheels
        /// answer late. When the two touch it stands, or he touches what goes behind.
        #[test]
        fn whoever_touches_it_finds_it_standing(
            start in (-4.0..4.0f64, -4.0..4.0f64), pace in 0.0..1.5f64, aim in 0.0..360.0f64, lag in 1u32..9,
            turn in -0.8..0.8f64, wish in 0.05..0.8f64,
        ) {
            prop_assume!(hypot(start.0, start.1) > 1.2);
            let mut person = Point::new(start.0, start.1);
            let (mut pose, mut moves) = (Pose::default(), 0.0f64);
            let mut late = std::collections::VecDeque::from(std::vec![0.0; lag as usize]);
            for i in 0..400 {
                let seen = pose.inverse().transform(person);
                let twist = Twist::new(moves.max(0.01), turn);
                late.push_back(speed(&PARAMETERS, twist, seen.x, seen.y).min(wish));
                let allowed: f64 = late.pop_front().unwrap();
                moves = (moves + (allowed - moves).clamp(-0.02, 0.01)).max(0.0);
                pose = pose.advanced(moves, turn, 0.02);
                // He walks towards some place of the rim.
                let place = pose.transform(Point::polar(0.3, aim.to_radians()));
                person = person + Point::polar(pace * 0.02, (place - person).bearing());
                let seen = pose.inverse().transform(person);
                if seen.norm() < PARAMETERS.radius {
                    prop_assert!(moves < 1e-9 || seen.x < 0.0, "after {i} steps at {moves} m/s, {seen:?}");
                    return Ok(());
                }
            }
        }
    }
}
