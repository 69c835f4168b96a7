//! How far away a tube of two colours is, by how far apart the middles of the colours are in the picture.
//!
//! In plain words: what is twice as far away looks half as large, but lenses and the edges of coloured areas bend that a little. A polynomial
//! is fitted to how much.
//!
//! ```text
//! Z = f D ( 1/d + a₁/(d−h)² + a₂/(d−h)³ + a₃/(d−h)⁴ + a₄/(d−h)⁵ )
//! ```
//!
//! | symbol | is | unit |
//! |---|---|---|
//! | Z | distance of the tube | m |
//! | d | distance of the middles in the picture | px |
//! | f, D | focal length, and the true distance of the middles | px, m |
//! | h, a₁ … a₄ | fitted; h lies outside of all d, where the polynomial has its pole | px, px^(k) |
//!
//! For a given h the rest is linear, and solved by singular values; over h the least remainder is searched (variable projection: Golub and
//! Pereyra, 1973). It holds from the least to the greatest d that was fitted, and nowhere else: a polynomial of the fifth order runs away.

use nalgebra::{DMatrix, DVector};

use super::least_squares::{Solution, rms, solve};

/// Terms beside the pinhole's.
const TERMS: usize = 4;
/// Fewer samples than this leave nothing over to judge the fit by.
const LEAST: usize = TERMS + 2;
/// Values of h that are tried at each side, from near to far.
const TRIES: u32 = 160;
/// How near to the samples, and how far from them, h is tried (in widths of the samples).
const NEAR: f64 = 0.02;
const FAR: f64 = 30.0;

/// A measurement.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Distance of the middles in the picture (px).
    pub pixels: f64,
    /// Distance of the tube (m).
    pub distance: f64,
}

/// From pixels to metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tube {
    /// Focal length times the true distance of the middles (px m).
    pub scale: f64,
    /// The pole (px).
    pub h: f64,
    /// a₁ … a₄.
    pub a: [f64; TERMS],
    /// The least and the greatest distance in the picture for which it holds (px).
    pub holds: [f64; 2],
}

/// A fit.
#[derive(Clone, Debug, PartialEq)]
pub struct Fitted {
    /// From pixels to metres.
    pub tube: Tube,
    /// Measured less fitted, of each sample (m).
    pub residuals: Vec<f64>,
    /// Root mean squared remainder of the pinhole alone, and of the fit (m).
    pub rms: [f64; 2],
    /// Condition of the terms.
    pub condition: f64,
}

/// Why there is no fit.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TubeError {
    /// Too few samples at different distances.
    #[error("{0} different distances in the picture are too few, it takes {LEAST} and better twice as many")]
    Few(usize),
    /// A sample cannot be.
    #[error(
        "sample {0} is not of a tube in front of the camera: pixels and metres must be greater than zero"
    )]
    Impossible(usize),
    /// Focal length or width cannot be.
    #[error("focal length and width must be greater than zero")]
    Camera,
    /// No value of h lets the terms be told apart.
    #[error("the terms cannot be told apart; take samples at more distances")]
    Alike,
}

impl Tube {
    /// Distance of a tube (m) whose middles are so far apart in the picture (px); nothing where it was not fitted.
    pub fn distance(&self, pixels: f64) -> Option<f64> {
        let [least, most] = self.holds;
        (least..=most).contains(&pixels).then(|| self.scale * (1.0 / pixels + self.bent(pixels)))
    }

    /// By how much the distance is wrong (m) for so many wrong pixels: |dZ/dd|, by the pinhole Z²/(f D).
    pub fn uncertainty(&self, pixels: f64, wrong: f64) -> Option<f64> {
        let distance = self.distance(pixels)?;
        Some(distance * distance / self.scale * wrong)
    }

    fn bent(&self, pixels: f64) -> f64 {
        let inverse = 1.0 / (pixels - self.h);
        self.a.iter().rev().fold(0.0, |sum, a| (sum + a) * inverse) * inverse
    }
}

/// Fits to samples, for a camera of a focal length (px) and a tube whose middles are `width` (m) apart.
///
/// # Errors
/// When the samples are too few, or cannot be.
pub fn fit(samples: &[Sample], focal: f64, width: f64) -> Result<Fitted, TubeError> {
    let scale = focal * width;
    if !(scale > 0.0 && scale.is_finite() && focal > 0.0) {
        return Err(TubeError::Camera);
    }
    let is_one = |x: f64| x > 0.0 && x.is_finite();
    if let Some(wrong) = samples.iter().position(|sample| !is_one(sample.pixels) || !is_one(sample.distance))
    {
        return Err(TubeError::Impossible(wrong + 1));
    }
    let mut pixels: Vec<f64> = samples.iter().map(|sample| sample.pixels).collect();
    pixels.sort_by(f64::total_cmp);
    let holds = [pixels.first(), pixels.last()].map(|end| end.copied().unwrap_or_default());
    pixels.dedup();
    if pixels.len() < LEAST {
        return Err(TubeError::Few(pixels.len()));
    }
    let fitting = Fitting::new(samples, scale, holds);
    let (h, solution) = fitting.search().ok_or(TubeError::Alike)?;
    let tube = Tube { scale, h, a: core::array::from_fn(|k| solution.x[k]), holds };
    Ok(Fitted {
        tube,
        residuals: solution.residuals.iter().copied().collect(),
        rms: [rms(fitting.rest.iter().copied()), rms(solution.residuals.iter().copied())],
        condition: solution.condition,
    })
}

struct Fitting<'a> {
    samples: &'a [Sample],
    scale: f64,
    holds: [f64; 2],
    /// What the pinhole leaves over (m).
    rest: DVector<f64>,
}

impl Fitting<'_> {
    fn new(samples: &[Sample], scale: f64, holds: [f64; 2]) -> Fitting<'_> {
        let rest = DVector::from_fn(samples.len(), |i, _| samples[i].distance - scale / samples[i].pixels);
        Fitting { samples, scale, holds, rest }
    }

    /// The h outside of the samples that leaves least over: first among many, then ever closer around the best.
    fn search(&self) -> Option<(f64, Solution)> {
        let [least, most] = self.holds;
        let width = most - least;
        let place = |side: usize, far: f64| if side == 0 { least - far * width } else { most + far * width };
        let step = libm::pow(FAR / NEAR, 1.0 / f64::from(TRIES));
        let tries = (0..=TRIES).flat_map(|i| [0, 1].map(|side| (side, NEAR * libm::pow(step, f64::from(i)))));
        let left = |h: f64| self.at(h).map_or(f64::INFINITY, |solution| solution.residuals.norm_squared());
        let (side, best) =
            tries.min_by(|(a, x), (b, y)| left(place(*a, *x)).total_cmp(&left(place(*b, *y))))?;
        let (mut near, mut far) = (best / step, best * step);
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        for _ in 0..60 {
            let (a, b) = (far - GOLDEN * (far - near), near + GOLDEN * (far - near));
            if left(place(side, a)) < left(place(side, b)) { far = b } else { near = a }
        }
        let refined = place(side, (near + far) / 2.0);
        let h = if left(refined) <= left(place(side, best)) { refined } else { place(side, best) };
        Some((h, self.at(h)?))
    }

    fn at(&self, h: f64) -> Option<Solution> {
        let term = |i: usize, k: usize| self.scale * libm::pow(self.samples[i].pixels - h, -(k as f64) - 2.0);
        solve(&DMatrix::from_fn(self.samples.len(), TERMS, term), &self.rest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use types::chance::Stream;

    /// A lens that makes pixels of 1.02 d + 1.5, for a focal length of 350 px, middles 0.3 m apart, from 0.8 to 3 m.
    fn samples(noise: f64, count: u32) -> Vec<Sample> {
        let stream = Stream::new(1, "tube");
        (0..count)
            .map(|i| {
                let distance = 0.8 + 2.2 * f64::from(i) / f64::from(count - 1);
                let (a, _) = stream.sample(u64::from(i)).normals(0);
                Sample { pixels: 1.02 * 105.0 / distance + 1.5 + noise * a, distance }
            })
            .collect()
    }

    #[test]
    fn a_bent_lens_is_fitted_a_thousand_times_better_than_by_the_pinhole() {
        // Reckoned apart, by another program: 0.1023 m before and 8.9e-5 m after, with a condition of some 1.7e3.
        let fitted = fit(&samples(0.0, 23), 350.0, 0.3).unwrap();
        assert!((fitted.rms[0] - 0.1023).abs() < 0.01, "{:?}", fitted.rms);
        assert!(fitted.rms[1] < 1.0e-4, "{:?}, h {}", fitted.rms, fitted.tube.h);
        assert!(fitted.condition < 1e6, "{}", fitted.condition);
        for sample in samples(0.0, 41) {
            let distance = fitted.tube.distance(sample.pixels).unwrap();
            assert!((distance - sample.distance).abs() < 5e-4, "{distance} for {}", sample.distance);
        }
    }

    #[test]
    fn noise_of_pixels_is_what_is_left_over() {
        // Mean errors 0.0909 m by the pinhole, 0.0085 m and 0.0168 m by the fit, for 0.25 px and 0.5 px.
        for (noise, mean) in [(0.25, 0.0085), (0.5, 0.0168)] {
            let fitted = fit(&samples(noise, 45), 350.0, 0.3).unwrap();
            let left = fitted.residuals.iter().map(|rest| rest.abs()).sum::<f64>() / 45.0;
            assert!((0.6..1.4).contains(&(left / mean)), "{left} for {mean}");
        }
        // Z²/(f D) Δd: 3 mm at 0.8 m, 12 mm at 1.6 m, 43 mm at 3 m for half a pixel.
        let tube = fit(&samples(0.0, 23), 350.0, 0.3).unwrap().tube;
        for (distance, wrong) in [(0.81, 3.0), (1.6, 12.0), (2.99, 43.0)] {
            let told = tube.uncertainty(1.02 * 105.0 / distance + 1.5, 0.5).unwrap();
            assert!((told * 1e3 - wrong).abs() < 0.6, "{told} at {distance} m");
        }
    }

    #[test]
    fn it_holds_where_it_was_fitted_and_has_no_pole_there() {
        let fitted = fit(&samples(0.5, 30), 350.0, 0.3).unwrap().tube;
        let [least, most] = fitted.holds;
        assert!(fitted.h < least || fitted.h > most);
        assert_eq!((fitted.distance(least - 0.01), fitted.distance(most + 0.01)), (None, None));
        assert_eq!(fitted.distance(f64::NAN), None);
    }

    #[test]
    fn what_cannot_be_fitted_is_told() {
        let good = samples(0.0, 20);
        assert_eq!(fit(&good[..5], 350.0, 0.3), Err(TubeError::Few(5)));
        assert_eq!(fit(&[good[3]; 20], 350.0, 0.3), Err(TubeError::Few(1)));
        assert_eq!(fit(&good, 0.0, 0.3), Err(TubeError::Camera));
        let mut wrong = good;
        wrong[4].pixels = -1.0;
        assert_eq!(fit(&wrong, 350.0, 0.3), Err(TubeError::Impossible(5)));
    }

    proptest! {
        #[test]
        fn any_samples_give_a_fit_or_a_reason(pairs in prop::collection::vec((1.0..500.0f64, 0.1..9.0f64), 0..30)) {
            let samples: Vec<Sample> = pairs.iter().map(|(pixels, distance)| Sample { pixels: *pixels, distance: *distance }).collect();
            if let Ok(fitted) = fit(&samples, 300.0, 0.2) {
                prop_assert!(fitted.residuals.iter().all(|rest| rest.is_finite()));
                prop_assert!(fitted.rms[1] <= fitted.rms[0] * (1.0 + 1e-9));
            }
        }
    }
}
