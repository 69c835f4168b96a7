//! The radius of each wheel and the track, from stretches whose true way and turn were measured.
//!
//! In plain words: how much the robot turned tells the wheels apart, and how far it came tells the scale.
//!
//! A stretch is driven with a steady bend, straight, along an arc, or on the spot. With counts n_l, n_r and c the way of a wheel for each count,
//!
//! ```text
//! φ = (c_r/b) n_r − (c_l/b) n_l                     linear in c_r/b and c_l/b: first fit
//! (x, y) = b · s · (sinc cos, sinc sin)(φ/2)        s = ((c_r/b) n_r + (c_l/b) n_l)/2, linear in b: second fit
//! ```
//!
//! with sinc u = sin u / u, and φ in the second fit as the first one gives it. It holds while no wheel slips.
//! (Antonelli, Chiaverini and Fusco, "A calibration method for odometry of mobile robots based on the least-squares technique", 2005.)

use libm::{fabs, sin, sincos};
use motion::Differential;
use nalgebra::{DMatrix, DVector};
use types::geometry::TAU;

use super::least_squares::{rms, solve};

/// One stretch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stretch {
    /// Counts of the left wheel, backward negative.
    pub left: f64,
    /// Counts of the right wheel.
    pub right: f64,
    /// Where it came, in the axes of its start (m).
    pub x: f64,
    /// To the left (m).
    pub y: f64,
    /// How far it turned, whole turns too (rad).
    pub turn: f64,
}

/// What the stretches tell.
#[derive(Clone, Debug, PartialEq)]
pub struct Wheels {
    /// The drive to go by.
    pub drive: Differential,
    /// What is left of each stretch: x, y (m) and turn (rad), measured less reckoned.
    pub residuals: Vec<[f64; 3]>,
    /// Root mean squared of what is left of ways (m), and of turns (rad).
    pub rms: [f64; 2],
    /// How well the wheels could be told apart: 1 is best, thousands say that all stretches are alike.
    pub condition: f64,
}

/// Why stretches tell nothing.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum WheelsError {
    /// The wheels cannot be told apart.
    #[error(
        "the stretches do not tell the wheels apart; drive some that bend or turn either way, and some that go straight"
    )]
    Alike,
    /// No stretch goes anywhere.
    #[error("no stretch goes anywhere, so nothing tells the scale; drive some straight on")]
    OnTheSpot,
    /// The wheels come out as none.
    #[error(
        "a radius or the track comes out as {0} m; look whether left and right, or a sign, are exchanged"
    )]
    Impossible(f64),
}

/// Fits radii and track to stretches, for wheels of so many counts a turn.
///
/// # Errors
/// When the stretches leave something open, or contradict each other so far that no wheels would do.
pub fn wheels(stretches: &[Stretch], ticks_per_turn: f64) -> Result<Wheels, WheelsError> {
    let turns =
        DMatrix::from_fn(
            stretches.len(),
            2,
            |i, j| if j == 0 { -stretches[i].left } else { stretches[i].right },
        );
    let turned = DVector::from_fn(stretches.len(), |i, _| stretches[i].turn);
    let first = solve(&turns, &turned).ok_or(WheelsError::Alike)?;
    let (left, right) = (first.x[0], first.x[1]);
    let unit = |stretch: &Stretch| reckoned(stretch, left, right);
    let ways = DMatrix::from_fn(2 * stretches.len(), 1, |i, _| unit(&stretches[i / 2])[i % 2]);
    let came = DVector::from_fn(2 * stretches.len(), |i, _| {
        let stretch = &stretches[i / 2];
        if i % 2 == 0 { stretch.x } else { stretch.y }
    });
    let second = solve(&ways, &came).ok_or(WheelsError::OnTheSpot)?;
    let track = second.x[0];
    let radius = |share: f64| share * track * ticks_per_turn / TAU;
    let drive = Differential { left_radius: radius(left), right_radius: radius(right), track };
    for length in [drive.left_radius, drive.right_radius, drive.track] {
        if !(length > 0.0 && length.is_finite()) {
            return Err(WheelsError::Impossible(length));
        }
    }
    let residual = |i: usize| [second.residuals[2 * i], second.residuals[2 * i + 1], first.residuals[i]];
    Ok(Wheels {
        drive,
        residuals: (0..stretches.len()).map(residual).collect(),
        rms: [rms(second.residuals.iter().copied()), rms(first.residuals.iter().copied())],
        condition: first.condition,
    })
}

/// Where a stretch comes for a track of one, from the ways for each count over the track.
fn reckoned(stretch: &Stretch, left: f64, right: f64) -> [f64; 2] {
    let way = (right * stretch.right + left * stretch.left) / 2.0;
    let half = (right * stretch.right - left * stretch.left) / 2.0;
    let sinc = if fabs(half) < 1e-6 { 1.0 } else { sin(half) / half };
    let (s, c) = sincos(half);
    [way * sinc * c, way * sinc * s]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use types::Pose;
    use types::chance::Stream;

    const TICKS: f64 = 2000.0;

    /// Turns on the spot, arcs and straight stretches, with noise in what was measured (m and rad).
    fn driven(truly: Differential, noise: f64) -> Vec<Stretch> {
        let stream = Stream::new(2, "stretches");
        let plans = [
            (1.0, 0.0),
            (3.0, 0.0),
            (0.0, 6.0),
            (0.0, -6.0),
            (2.0, 1.5),
            (2.0, -1.5),
            (-1.0, 0.3),
            (1.5, 7.0),
        ];
        plans
            .iter()
            .enumerate()
            .map(|(i, (way, turn))| {
                let counts = |way: f64, radius: f64| way / (TAU * radius) * TICKS;
                let end = Pose::default().along_arc(*way, *turn);
                let sample = stream.sample(i as u64);
                let ((a, b), (c, _)) = (sample.normals(0), sample.normals(2));
                Stretch {
                    left: counts(way - turn * truly.track / 2.0, truly.left_radius),
                    right: counts(way + turn * truly.track / 2.0, truly.right_radius),
                    x: end.x + noise * a,
                    y: end.y + noise * b,
                    turn: turn + noise * c,
                }
            })
            .collect()
    }

    proptest! {
        #[test]
        fn wheels_are_found_from_what_they_did(l in 0.02f64..0.2, part in 0.9f64..1.1, track in 0.1f64..1.0) {
            let truly = Differential { left_radius: l, right_radius: l * part, track };
            let found = wheels(&driven(truly, 0.0), TICKS).unwrap();
            for (got, want) in [(found.drive.left_radius, l), (found.drive.right_radius, l * part), (found.drive.track, track)] {
                prop_assert!((got / want - 1.0).abs() < 1e-9, "{got} for {want}");
            }
            prop_assert!(found.rms[0] < 1e-9 && found.rms[1] < 1e-9);
        }
    }

    #[test]
    fn noise_is_left_over_and_moves_the_wheels_little() {
        let truly = Differential { left_radius: 0.0762, right_radius: 0.0771, track: 0.332 };
        let found = wheels(&driven(truly, 3e-3), TICKS).unwrap();
        assert!((found.rms[0] - 3e-3).abs() < 1.5e-3 && found.rms[1] < 5e-3, "{:?}", found.rms);
        for (got, want) in [
            (found.drive.left_radius, 0.0762),
            (found.drive.right_radius, 0.0771),
            (found.drive.track, 0.332),
        ] {
            assert!((got / want - 1.0).abs() < 2e-3, "{got} for {want}");
        }
    }

    #[test]
    fn what_is_left_open_is_told() {
        let truly = Differential::new(0.08, 0.33);
        let all = driven(truly, 0.0);
        assert_eq!(wheels(&all[..2], TICKS), Err(WheelsError::Alike), "straight stretches alone");
        assert_eq!(wheels(&[], TICKS), Err(WheelsError::Alike));
        let exchanged: Vec<Stretch> = all
            .iter()
            .map(|stretch| Stretch { left: stretch.right, right: stretch.left, ..*stretch })
            .collect();
        assert!(matches!(wheels(&exchanged, TICKS), Err(WheelsError::Impossible(_))));
        let spot = |turn: f64, left: f64, right: f64| Stretch { left, right, turn, ..Stretch::default() };
        let still = [spot(1.0, -100.0, 100.0), spot(2.0, -250.0, 150.0), spot(-1.0, 100.0, -100.0)];
        assert!(wheels(&still, TICKS).is_err());
    }
}
