//! UMBmark: the lasting errors of wheels, from squares driven clockwise and counter-clockwise.
//!
//! In plain words: a robot that drives a square by its wheels alone does not end where it began. With a wrong track it turns too much or too
//! little at each corner, whichever way around; with unequal wheels its sides are bent, always to the same side. Driven both ways around,
//! the two errors add in one and take from each other in the other, and so can be told apart.
//!
//! The robot starts at the origin along x, and turns left (counter-clockwise) or right at the corners of a square with sides L. With α what it turns
//! too much at a corner, and β the turn that goes with a side, to the left, the centres of where it truly ends, seen from where its odometry ends, are
//! to first order
//!
//! ```text
//! ccw: ( 2L(α+β), −2L(α+β) )        cw: ( 2L(α−β), 2L(α−β) )
//! R = (L/2) / sin(β/2)     E_d = r_right/r_left = (R + b/2)/(R − b/2)     E_b = (π/2)/(π/2 + α) = b true / b believed
//! ```
//!
//! It holds for errors of some percent. It does not find a scale that both wheels share: drive a straight line for that ([`wheels`](super::wheels)).
//! (Borenstein and Feng, "Measurement and correction of systematic odometry errors in mobile robots", 1996, equations 7 to 18; their α has
//! the other sign.)

use libm::sin;
use motion::Differential;
use types::Point;
use types::geometry::PI;

/// Ends of runs: where the robot truly ended, seen from where its odometry ended, in the axes of the start (m).
#[derive(Clone, Copy, Debug)]
pub struct Ends<'a> {
    /// Of squares driven clockwise.
    pub clockwise: &'a [Point],
    /// Of squares driven counter-clockwise.
    pub counterclockwise: &'a [Point],
}

/// What the squares tell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Squares {
    /// What it turns too much at each corner (rad).
    pub corner: f64,
    /// Turn to the left that goes with each side (rad).
    pub bend: f64,
    /// E_d: radius of the right wheel over that of the left one.
    pub unequal: f64,
    /// E_b: the true track over the one that it goes by.
    pub track: f64,
    /// The drive to go by from now on. The mean of the radii stays.
    pub drive: Differential,
    /// The centres of the ends, clockwise and counter-clockwise (m).
    pub centres: [Point; 2],
    /// How far the farther centre is from the start (m): the measure of lasting errors.
    pub lasting: f64,
    /// Root mean squared distance of the ends to their centres (m): what the errors by chance are.
    pub chance: f64,
}

/// Why squares tell nothing.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SquareError {
    /// Squares one way around cannot tell the errors apart.
    #[error("there are no squares driven {0}; it takes both ways around, five of each are usual")]
    OneWay(&'static str),
    /// The side is not a length.
    #[error("the side of the squares is {0} m, and must be longer than nothing")]
    Side(f64),
    /// Errors too large for the formula.
    #[error(
        "the corners are off by {0:.2} rad; mend what is far wrong first, the method is for some percent"
    )]
    TooWrong(f64),
}

/// Finds the errors from squares of a side (m), driven by what `drive` says.
///
/// # Errors
/// When runs of one way around are missing, or the errors are far too large.
pub fn squares(drive: Differential, side: f64, ends: Ends<'_>) -> Result<Squares, SquareError> {
    if !(side > 0.0 && side.is_finite()) {
        return Err(SquareError::Side(side));
    }
    let cw = centre(ends.clockwise).ok_or(SquareError::OneWay("clockwise"))?;
    let ccw = centre(ends.counterclockwise).ok_or(SquareError::OneWay("counter-clockwise"))?;
    // Each axis tells it; their mean is less uncertain.
    let corner = (cw.x + ccw.x + cw.y - ccw.y) / (8.0 * side);
    let bend = (ccw.x - cw.x - cw.y - ccw.y) / (8.0 * side);
    let wrong = libm::fmax(libm::fabs(corner), libm::fabs(bend));
    if wrong.is_nan() || wrong >= 0.5 {
        return Err(SquareError::TooWrong(wrong));
    }
    // (R + b/2)/(R − b/2) with 1/R = 2 sin(β/2)/L, which may be zero.
    let half = drive.track * sin(bend / 2.0) / side;
    let unequal = (1.0 + half) / (1.0 - half);
    let track = (PI / 2.0) / (PI / 2.0 + corner);
    // The ratio is of what the wheels truly are to what is believed of them.
    let mean = (drive.left_radius + drive.right_radius) / 2.0;
    let [left, right] =
        [drive.left_radius * 2.0 / (unequal + 1.0), drive.right_radius * 2.0 * unequal / (unequal + 1.0)];
    let keep = 2.0 * mean / (left + right);
    let distances =
        |ends: &[Point], centre: Point| ends.iter().map(|end| end.distance(centre)).collect::<Vec<_>>();
    let mut apart = distances(ends.clockwise, cw);
    apart.extend(distances(ends.counterclockwise, ccw));
    Ok(Squares {
        corner,
        bend,
        unequal,
        track,
        drive: Differential {
            left_radius: left * keep,
            right_radius: right * keep,
            track: drive.track * track,
        },
        centres: [cw, ccw],
        lasting: libm::fmax(cw.norm(), ccw.norm()),
        chance: super::least_squares::rms(apart),
    })
}

fn centre(ends: &[Point]) -> Option<Point> {
    let count = ends.len() as f64;
    let sum = ends.iter().fold(Point::default(), |sum, end| sum + *end);
    (count > 0.0 && sum.norm().is_finite()).then(|| sum * (1.0 / count))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use types::Pose;
    use types::chance::Stream;

    /// Drives a square by what `believed` says with wheels that are `truly` otherwise; gives the true end seen from the believed one.
    fn end(believed: Differential, truly: Differential, side: f64, left: bool) -> Point {
        let mut pose = Pose::default();
        let mut go = |distance: f64, turn: f64| {
            // Angles of the wheels that odometry takes for this, and what they do.
            let (l, r) = (distance - turn * believed.track / 2.0, distance + turn * believed.track / 2.0);
            let (l, r) = (
                l / believed.left_radius * truly.left_radius,
                r / believed.right_radius * truly.right_radius,
            );
            pose = pose.along_arc((l + r) / 2.0, (r - l) / truly.track);
        };
        for _ in 0..4 {
            go(side, 0.0);
            go(0.0, if left { PI / 2.0 } else { -PI / 2.0 });
        }
        pose.position()
    }

    fn found(believed: Differential, truly: Differential, noise: f64) -> Squares {
        let stream = Stream::new(4, "squares");
        let ends = |left: bool| -> Vec<Point> {
            (0..5)
                .map(|run| {
                    let (a, b) = stream.sample(run + 10 * u64::from(left)).normals(0);
                    end(believed, truly, 4.0, left) + Point::new(noise * a, noise * b)
                })
                .collect()
        };
        let (clockwise, counterclockwise) = (ends(false), ends(true));
        squares(believed, 4.0, Ends { clockwise: &clockwise, counterclockwise: &counterclockwise }).unwrap()
    }

    #[test]
    fn only_unequal_wheels_or_only_a_wrong_track_shows_as_such() {
        let believed = Differential::new(0.05, 0.34);
        let wide = found(believed, Differential { track: 0.34 * 1.01, ..believed }, 0.0);
        assert!((wide.track - 1.01).abs() < 5e-4 && (wide.unequal - 1.0).abs() < 1e-4, "{wide:?}");
        let bent =
            found(believed, Differential { left_radius: 0.04995, right_radius: 0.05005, ..believed }, 0.0);
        assert!((bent.unequal - 1.002).abs() < 1e-4 && (bent.track - 1.0).abs() < 5e-4, "{bent:?}");
        assert!(bent.bend > 0.0, "a larger right wheel bends to the left");
    }

    #[test]
    fn after_mending_the_lasting_error_is_a_tenth_of_before_also_with_noise() {
        // The paper's robots: 0.3 to 0.5 m after squares of 4 m, ten times and more better after mending.
        let (believed, truly) = (
            Differential::new(0.05, 0.34),
            Differential { left_radius: 0.0499, right_radius: 0.0501, track: 0.345 },
        );
        let before = found(believed, truly, 0.01);
        assert!(before.lasting > 0.2 && (before.chance - 0.014).abs() < 0.01, "{before:?}");
        let after = found(before.drive, truly, 0.0);
        assert!(after.lasting < before.lasting / 10.0, "{} after {}", after.lasting, before.lasting);
    }

    #[test]
    fn one_way_around_tells_nothing() {
        let there = [Point::new(0.1, 0.0)];
        let drive = Differential::new(0.05, 0.3);
        let ends = Ends { clockwise: &there, counterclockwise: &[] };
        assert_eq!(squares(drive, 4.0, ends), Err(SquareError::OneWay("counter-clockwise")));
        let far = [Point::new(100.0, 0.0)];
        let ends = Ends { clockwise: &far, counterclockwise: &far };
        assert!(matches!(squares(drive, 4.0, ends), Err(SquareError::TooWrong(_))));
    }

    proptest! {
        #[test]
        fn errors_of_a_percent_are_found_to_a_tenth(track in 0.985f64..1.015, unequal in 0.997f64..1.003) {
            let believed = Differential::new(0.05, 0.34);
            let mean = 2.0 / (1.0 + unequal);
            let truly = Differential { left_radius: 0.05 * mean, right_radius: 0.05 * mean * unequal, track: 0.34 * track };
            let found = found(believed, truly, 0.0);
            // Second order: the errors times what they do to a side.
            let slack = 0.1 * ((track - 1.0).abs() + 10.0 * (unequal - 1.0).abs()) + 1e-5;
            prop_assert!((found.track - track).abs() < slack, "{} for {track}", found.track);
            prop_assert!((found.unequal - unequal).abs() < slack / 10.0, "{} for {unequal}", found.unequal);
        }
    }
}
