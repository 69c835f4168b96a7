//! A thing of a colour and a shape in a picture, with every pixel or with a part of them.
//!
//! In plain words: of all regions of the colour the largest is taken that has the shape. How round a region is, is told by its moments:
//! the ellipse with the same moments has the half axes 2σ₁ ≥ 2σ₂, which are the two [spreads](Blob::spread), and
//!
//! ```text
//! roundness = σ₂ / σ₁ · filling          filling = min(1, area / (4π σ₁ σ₂))
//! ```
//!
//! so a disc has 1, a face of 3 to 4 about 0.75, a board three times as wide as high 0.33, and what has holes or arms less, because
//! its pixels do not fill the ellipse that is as wide as they are spread.
//!
//! How sure it is, is how much of the ellipse is filled, and less where few pixels said so (n of those that were looked at):
//!
//! ```text
//! confidence = filling · n / (n + 8)
//! ```
//!
//! Eight is twice the least region that counts: half of the trust is in what is just more than a speck.

use crate::blobs::{Blob, BlobFinder, BlobParams};
use crate::colour::{ColourRange, Converter, in_range};
use crate::picture::{Size, WrongLength, check};
use crate::thin::Thinning;
use libm::fmin;
use types::geometry::PI;

/// Pixels at which half of the trust is there.
const HALF_TRUST: f64 = 8.0;
/// Regions among which one of the right shape is looked for.
const REGIONS: usize = 16;

/// How a picture is looked at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Every pixel.
    #[default]
    Exact,
    /// Every fourth pixel in both directions: a sixteenth of the work.
    Rough,
}

/// What the bytes of a picture are, three a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Red, green, blue.
    Rgb,
    /// Hue, saturation, intensity, as [`Converter::convert`] makes them.
    Hsi,
}

/// What is looked for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pattern {
    /// Its colour.
    pub colour: ColourRange,
    /// Its least share of the picture (0..1).
    pub share_min: f64,
    /// How round it is at least (0..1). With 0 every shape is right.
    pub roundness_min: f64,
}

/// What was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// The region, in pixels of the whole picture.
    pub blob: Blob,
    /// Its share of the picture (0..1).
    pub share: f64,
    /// How sure it is (0..1).
    pub confidence: f64,
}

/// Finds things in pictures of one size. All memory is taken when it is made.
#[derive(Clone, Debug)]
pub struct Recogniser {
    colours: Converter,
    exact: View,
    rough: View,
}

/// The memory of one method.
#[derive(Clone, Debug)]
struct View {
    thinning: Thinning,
    /// The pixels that are looked at; empty where those are all, which are read where they lie.
    pixels: Vec<u8>,
    mask: Vec<u8>,
    finder: BlobFinder<REGIONS>,
}

impl Method {
    /// From one pixel that is looked at to the next.
    pub const fn step(self) -> usize {
        match self {
            Method::Exact => 1,
            Method::Rough => 4,
        }
    }

    /// What it is worth, against every pixel: 1, and 0.6 for every fourth.
    ///
    /// It is the mean of what [`confidence`] is left of by looking at a sixteenth of the pixels, over a thing at distances evenly
    /// spread between where it fills 8 % of the picture, near enough for a robot to stop before it, and where it
    /// fills the least share that a recogniser takes, 0.05 %; in a picture of 320 × 240.
    pub const fn quality(self) -> f64 {
        match self {
            Method::Exact => 1.0,
            Method::Rough => 0.6,
        }
    }
}

/// How much of the ellipse of its moments a region fills (0..1).
pub fn filling(blob: &Blob) -> f64 {
    // A single pixel has no moments but is as wide as itself: 1/12 each.
    let own = Blob { xx: blob.xx + 1.0 / 12.0, yy: blob.yy + 1.0 / 12.0, ..*blob };
    let (long, short) = own.spread();
    fmin(1.0, f64::from(blob.area) / (4.0 * PI * long * short))
}

/// How round a region is (0..1): 1 for a disc, nearly 0 for a line or a branch.
pub fn roundness(blob: &Blob) -> f64 {
    let own = Blob { xx: blob.xx + 1.0 / 12.0, yy: blob.yy + 1.0 / 12.0, ..*blob };
    let (long, short) = own.spread();
    short / long * filling(blob)
}

/// How sure one may be of a region of which `looked_at` pixels were looked at (0..1).
pub fn confidence(blob: &Blob, looked_at: u32) -> f64 {
    let looked_at = f64::from(looked_at);
    filling(blob) * looked_at / (looked_at + HALF_TRUST)
}

impl Recogniser {
    /// Takes the memory for pictures of `size`, and the table of hues.
    pub fn new(size: Size) -> Recogniser {
        let view = |method: Method| View::new(Thinning::new(size, method.step()));
        Recogniser { colours: Converter::new(), exact: view(Method::Exact), rough: view(Method::Rough) }
    }

    /// The size of the pictures.
    pub fn size(&self) -> Size {
        self.exact.thinning.size
    }

    /// The largest region of the colour that is large and round enough; nothing where there is none.
    pub fn find(
        &mut self,
        picture: &[u8],
        form: Form,
        pattern: &Pattern,
        method: Method,
    ) -> Result<Option<Seen>, WrongLength> {
        let view = match method {
            Method::Exact => &mut self.exact,
            Method::Rough => &mut self.rough,
        };
        check("picture", picture.len(), 3 * view.thinning.size.pixels())?;
        view.split(&self.colours, picture, form, &pattern.colour)?;
        view.choose(pattern)
    }
}

impl View {
    fn new(thinning: Thinning) -> View {
        let thin = thinning.thin();
        // What is a speck among all pixels is none that was met by chance among a sixteenth of them.
        let area_min = if thinning.step > 1 { 1 } else { BlobParams::default().area_min };
        View {
            thinning,
            pixels: vec![0; if thinning.step > 1 { 3 * thin.pixels() } else { 0 }],
            mask: vec![0; thin.pixels()],
            finder: BlobFinder::new(thin, BlobParams { area_min }),
        }
    }

    fn split(
        &mut self,
        colours: &Converter,
        picture: &[u8],
        form: Form,
        range: &ColourRange,
    ) -> Result<(), WrongLength> {
        let pixels = if self.thinning.step > 1 {
            self.thinning.copy(picture, &mut self.pixels)?;
            &self.pixels[..]
        } else {
            picture
        };
        match form {
            Form::Rgb => colours.split(pixels, range, &mut self.mask),
            Form::Hsi => in_range(pixels, range, &mut self.mask),
        }
    }

    fn choose(&mut self, pattern: &Pattern) -> Result<Option<Seen>, WrongLength> {
        let (thinning, all) = (self.thinning, self.thinning.size.pixels().max(1) as f64);
        let found = self.finder.find(&self.mask)?;
        let seen = |blob: &Blob| {
            let (whole, looked_at) = (thinning.whole(blob), blob.area);
            Seen {
                blob: whole,
                share: f64::from(whole.area) / all,
                confidence: confidence(&whole, looked_at),
            }
        };
        let right =
            |seen: &Seen| seen.share >= pattern.share_min && roundness(&seen.blob) >= pattern.roundness_min;
        Ok(found.blobs.iter().map(seen).find(right))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SIZE: Size = Size::new(160, 120);

    /// A grey picture with the places that `inside` says in red.
    fn picture(size: Size, inside: impl Fn(f64, f64) -> bool) -> Vec<u8> {
        let red = |i: usize| inside((i % size.width) as f64, (i / size.width) as f64);
        (0..size.pixels()).flat_map(|i| if red(i) { [200, 25, 20] } else { [120, 118, 116] }).collect()
    }

    fn disc(x: f64, y: f64, radius: f64) -> impl Fn(f64, f64) -> bool {
        move |px, py| (px - x).hypot(py - y) <= radius
    }

    fn round(roundness_min: f64) -> Pattern {
        Pattern { roundness_min, ..Pattern::default() }
    }

    #[test]
    fn shapes_are_as_round_as_their_ellipses() {
        let mut recogniser = Recogniser::new(SIZE);
        let mut shape = |inside: &dyn Fn(f64, f64) -> bool| {
            let picture = picture(SIZE, inside);
            let seen = recogniser.find(&picture, Form::Rgb, &round(0.0), Method::Exact).unwrap().unwrap();
            (roundness(&seen.blob), filling(&seen.blob))
        };
        let near = |(roundness, filling): (f64, f64), expect: (f64, f64)| {
            assert!(
                (roundness - expect.0).abs() < 0.02 && (filling - expect.1).abs() < 0.02,
                "{roundness} {filling}"
            );
        };
        near(shape(&disc(70.0, 60.0, 30.0)), (1.0, 1.0));
        near(shape(&|x, y| ((x - 70.0) / 30.0).hypot((y - 60.0) / 40.0) <= 1.0), (0.75, 1.0));
        // Of a rectangle σ = a/√12 and b/√12: it fills 12/4π.
        let board = |x: f64, y: f64| (x - 70.0).abs() <= 45.0 && (y - 60.0).abs() <= 15.0;
        near(shape(&board), (1.0 / PI, 3.0 / PI));
        // Of a ring with the radii r and R σ² = (R² + r²)/4: it fills (R² − r²)/(R² + r²).
        let ring = |x: f64, y: f64| (20.0..=40.0).contains(&(x - 70.0).hypot(y - 60.0));
        near(shape(&ring), (0.6, 0.6));
    }

    #[test]
    fn a_board_of_the_colour_is_no_face() {
        let mut recogniser = Recogniser::new(SIZE);
        let face = disc(120.0, 40.0, 9.0);
        let board = |x: f64, y: f64| (10.0..90.0).contains(&x) && (70.0..90.0).contains(&y);
        let picture = picture(SIZE, |x, y| face(x, y) || board(x, y));
        for method in [Method::Exact, Method::Rough] {
            let mut x = |roundness| {
                let seen = recogniser.find(&picture, Form::Rgb, &round(roundness), method).unwrap();
                seen.map(|seen| seen.blob.x.round())
            };
            assert!((x(0.0).unwrap() - 49.5).abs() < 4.0, "the larger one");
            assert!((x(0.6).unwrap() - 120.0).abs() < 4.0, "the round one");
            assert_eq!(x(1.0), None);
        }
    }

    #[test]
    fn both_forms_of_a_picture_show_the_same() {
        let mut recogniser = Recogniser::new(SIZE);
        let rgb = picture(SIZE, disc(40.3, 60.8, 12.0));
        let mut hsi = vec![0; rgb.len()];
        Converter::new().convert(&rgb, &mut hsi).unwrap();
        for method in [Method::Exact, Method::Rough] {
            let seen = recogniser.find(&rgb, Form::Rgb, &round(0.0), method).unwrap();
            assert!(seen.is_some());
            assert_eq!(recogniser.find(&hsi, Form::Hsi, &round(0.0), method).unwrap(), seen);
        }
        assert!(recogniser.find(&rgb[3..], Form::Rgb, &round(0.0), Method::Rough).is_err());
    }

    #[test]
    fn what_is_too_small_is_not_seen() {
        let mut recogniser = Recogniser::new(SIZE);
        let picture = picture(SIZE, disc(80.0, 60.0, 10.0));
        let area = recogniser.find(&picture, Form::Rgb, &round(0.0), Method::Exact).unwrap().unwrap().share;
        assert!((area - PI * 100.0 / 19200.0).abs() < 2e-4);
        let mut at_least = |share_min| {
            let pattern = Pattern { share_min, ..round(0.0) };
            recogniser.find(&picture, Form::Rgb, &pattern, Method::Exact).unwrap().is_some()
        };
        assert!(at_least(area) && !at_least(area + 1e-6));
    }

    /// The number that [`Method::quality`] gives, from discs in pictures.
    #[test]
    fn a_sixteenth_of_the_pixels_leaves_six_tenths_of_the_confidence() {
        let size = Size::new(320, 240);
        let mut recogniser = Recogniser::new(size);
        let (near, far) = ((0.08 * 76_800.0 / PI).sqrt(), (0.0005 * 76_800.0 / PI).sqrt());
        let steps = 60;
        let ratios = (0..steps).map(|i| {
            // As the radius goes with one over the distance; the places do not fall on the grid of samples.
            let distance = 1.0 + (near / far - 1.0) * (f64::from(i) + 0.5) / f64::from(steps);
            let at = (150.0 + f64::from(i) * 0.37, 110.0 + f64::from(i) * 0.23);
            let picture = picture(size, disc(at.0, at.1, near / distance));
            let mut sure = |method| {
                recogniser
                    .find(&picture, Form::Rgb, &round(0.0), method)
                    .unwrap()
                    .map_or(0.0, |seen| seen.confidence)
            };
            sure(Method::Rough) / sure(Method::Exact)
        });
        let mean = ratios.sum::<f64>() / f64::from(steps);
        assert!((mean - Method::Rough.quality()).abs() < 0.05, "{mean}");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// A block of pixels is what one that is looked at stands for.
        #[test]
        fn rough_is_exact_within_a_block(x in 20.0..140.0f64, y in 20.0..100.0f64, radius in 4.0..18.0f64) {
            let mut recogniser = Recogniser::new(SIZE);
            let picture = picture(SIZE, disc(x, y, radius));
            let mut seen = |method| recogniser.find(&picture, Form::Rgb, &round(0.0), method).unwrap().unwrap();
            let (exact, rough) = (seen(Method::Exact), seen(Method::Rough));
            let block = Method::Rough.step() as f64;
            prop_assert!((exact.blob.x - rough.blob.x).abs() <= block);
            prop_assert!((exact.blob.y - rough.blob.y).abs() <= block);
            prop_assert!(rough.confidence < exact.confidence);
            // At its rim a disc may be wrong by a block to either side.
            let rim = 2.0 * PI * radius * block + block * block;
            prop_assert!((f64::from(exact.blob.area) - f64::from(rough.blob.area)).abs() <= rim);
        }
    }
}
