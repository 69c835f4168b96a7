//! Every n-th pixel of a picture in both directions, and what a region of those is in the whole picture.
//!
//! In plain words: to know roughly where something large is, a part of the pixels is enough. With every fourth in both
//! directions that is a sixteenth of the work; what is smaller than the gaps can slip through them.
//!
//! With the step s and the first sample o, sample k lies at pixel o + k s, and a region whose pixels are as likely to begin
//! anywhere has, in the mean, the moments (m of the samples, n = s² times as many)
//!
//! ```text
//! area = s² m      x = o + s x̄      xx = s² xx̄ + (s² − 1)/12      xy = s² xȳ
//! ```
//!
//! The (s² − 1)/12 is the spread of s pixels around their middle: m samples at distances of s have the variance s²(m² − 1)/12,
//! n = s m pixels side by side (n² − 1)/12.

use crate::blobs::Blob;
use crate::picture::{Size, WrongLength, check};

/// A picture of which every `step`-th pixel of every `step`-th row is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Thinning {
    /// The size of the whole picture.
    pub size: Size,
    /// From one pixel that is looked at to the next (pixels, at least 1).
    pub step: usize,
}

impl Thinning {
    /// Looks at every `step`-th pixel of a picture of `size` in both directions; a step of 0 counts as 1.
    pub const fn new(size: Size, step: usize) -> Thinning {
        Thinning { size, step: if step == 0 { 1 } else { step } }
    }

    /// The first row and column that are looked at: the middle of the first step.
    const fn first(self) -> usize {
        self.step / 2
    }

    /// The size of the picture of the pixels that are looked at.
    pub fn thin(self) -> Size {
        let first = self.first();
        let along = |all: usize| all.saturating_sub(first).div_ceil(self.step);
        Size::new(along(self.size.width), along(self.size.height))
    }

    /// Copies the pixels that are looked at from `picture` to `out`, three bytes a pixel in both.
    pub fn copy(self, picture: &[u8], out: &mut [u8]) -> Result<(), WrongLength> {
        let thin = self.thin();
        check("picture", picture.len(), 3 * self.size.pixels())?;
        check("out", out.len(), 3 * thin.pixels())?;
        if thin.pixels() == 0 {
            return Ok(());
        }
        let rows = picture.chunks_exact(3 * self.size.width).skip(self.first()).step_by(self.step);
        for (row, out) in rows.zip(out.chunks_exact_mut(3 * thin.width)) {
            let pixels = row.as_chunks::<3>().0.iter().skip(self.first()).step_by(self.step);
            for (pixel, out) in pixels.zip(out.as_chunks_mut::<3>().0) {
                *out = *pixel;
            }
        }
        Ok(())
    }

    /// The region of the whole picture that a region of the pixels that are looked at stands for. Its box is that of these
    /// pixels, so each side of it may be a step too near to the middle, of a pointed one more.
    pub fn whole(self, blob: &Blob) -> Blob {
        let (step, first) = (self.step as f64, self.first() as f64);
        let (square, within) = (step * step, (step * step - 1.0) / 12.0);
        let pixel = |sample: u32| (self.first() + self.step * sample as usize) as u32;
        Blob {
            area: blob.area.saturating_mul((self.step * self.step) as u32),
            x: first + step * blob.x,
            y: first + step * blob.y,
            left: pixel(blob.left),
            top: pixel(blob.top),
            right: pixel(blob.right),
            bottom: pixel(blob.bottom),
            xx: square * blob.xx + within,
            yy: square * blob.yy + within,
            xy: square * blob.xy,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::blobs::{BlobFinder, BlobParams};
    use proptest::prelude::*;

    /// A picture whose pixels say where they are: column, row, nothing.
    fn places(size: Size) -> Vec<u8> {
        (0..size.pixels()).flat_map(|i| [(i % size.width) as u8, (i / size.width) as u8, 0]).collect()
    }

    #[test]
    fn the_pixels_that_are_looked_at_lie_in_the_middle_of_their_steps() {
        let thinning = Thinning::new(Size::new(11, 6), 4);
        assert_eq!(thinning.thin(), Size::new(3, 1));
        let mut out = vec![9; 9];
        thinning.copy(&places(thinning.size), &mut out).unwrap();
        assert_eq!(out, [2, 2, 0, 6, 2, 0, 10, 2, 0]);
        let wrong = thinning.copy(&[0; 5], &mut out).unwrap_err();
        assert_eq!(wrong, WrongLength { buffer: "picture", expected: 198, got: 5 });
    }

    #[test]
    fn a_picture_smaller_than_a_step_has_no_pixels_to_be_looked_at() {
        for (width, height) in [(0, 5), (2, 2), (1, 9)] {
            let thinning = Thinning::new(Size::new(width, height), 4);
            assert_eq!(thinning.thin().pixels(), 0);
            thinning.copy(&vec![0; 3 * width * height], &mut []).unwrap();
        }
        assert_eq!(Thinning::new(Size::new(3, 2), 0).thin(), Size::new(3, 2));
    }

    /// The largest region of the pixels that `inside` says, with every pixel and with every `step`-th.
    fn both(size: Size, step: usize, inside: impl Fn(usize, usize) -> bool) -> Option<(Blob, Blob)> {
        let picture: Vec<u8> =
            (0..size.pixels()).flat_map(|i| [u8::from(inside(i % size.width, i / size.width)); 3]).collect();
        let thinning = Thinning::new(size, step);
        let mut thin = vec![0; 3 * thinning.thin().pixels()];
        thinning.copy(&picture, &mut thin).unwrap();
        let largest = |size: Size, picture: &[u8]| {
            let mask: Vec<u8> = picture.iter().copied().step_by(3).collect();
            BlobFinder::<8>::new(size, BlobParams { area_min: 1 }).largest(&mask).unwrap()
        };
        let found = largest(thinning.thin(), &thin)?;
        Some((largest(size, &picture)?, thinning.whole(&found)))
    }

    #[test]
    fn a_box_of_whole_steps_is_measured_as_all_its_pixels_say() {
        // Twelve columns from the beginning of a step on, eight rows.
        let (exact, rough) =
            both(Size::new(64, 48), 4, |x, y| (20..32).contains(&x) && (8..16).contains(&y)).unwrap();
        assert_eq!((exact.area, exact.x, exact.y), (96, 25.5, 11.5));
        assert_eq!(
            (rough.area, rough.x, rough.y),
            (96, 26.0, 12.0),
            "half a pixel aside, as an even step lies"
        );
        // (n² − 1)/12 of n pixels side by side.
        assert!((rough.xx - 143.0 / 12.0).abs() < 1e-9 && (rough.yy - 63.0 / 12.0).abs() < 1e-9);
        assert!((exact.xx - rough.xx).abs() < 1e-9 && (exact.yy - rough.yy).abs() < 1e-9);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(128))]

        #[test]
        fn with_a_step_of_one_nothing_changes(
            width in 1usize..20, height in 1usize..12, mask in proptest::collection::vec(any::<bool>(), 240),
        ) {
            if let Some((exact, whole)) = both(Size::new(width, height), 1, |x, y| mask[y * width + x]) {
                prop_assert_eq!(exact, whole);
            }
        }

        /// Of a disc the row of samples nearest to its middle is hardly shorter than it is wide: a pixel at most, for these.
        #[test]
        fn a_disc_is_found_within_a_step_of_where_it_is(
            x in 20.0..108.0f64, y in 20.0..76.0f64, radius in 4.0..18.0f64, step in 1usize..6,
        ) {
            let inside = |px: usize, py: usize| (px as f64 - x).hypot(py as f64 - y) <= radius;
            let (exact, rough) = both(Size::new(128, 96), step, inside).unwrap();
            let most = step as f64;
            prop_assert!((rough.x - exact.x).abs() <= most && (rough.y - exact.y).abs() <= most);
            for (rough, exact) in [(rough.left, exact.left), (rough.top, exact.top)] {
                prop_assert!((0..=step as i64 + 1).contains(&(i64::from(rough) - i64::from(exact))));
            }
            for (rough, exact) in [(rough.right, exact.right), (rough.bottom, exact.bottom)] {
                prop_assert!((0..=step as i64 + 1).contains(&(i64::from(exact) - i64::from(rough))));
            }
        }
    }
}
