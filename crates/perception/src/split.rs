//! The split of an RGB picture by colour, without its conversion.
//!
//! In plain words: who only wants to know which pixels are red need not know the hue of the others. In what is red, red exceeds
//! green and blue by so much, which the bytes tell as they lie; most of a picture shows nothing of that. Of what is left most is
//! not coloured enough or too dark, which two comparisons tell; only for the rest the hue is looked up.
//!
//! With s and i the least steps of saturation and intensity, and with the rounding of [`Converter::convert`], in whole numbers
//!
//! ```text
//! S ≥ s   ⇔   (511 − 2s)(R+G+B) ≥ 1530 min(R,G,B)          I ≥ i   ⇔   R+G+B ≥ 3i − 1
//! ```

use crate::colour::{ColourRange, Converter, SET, Steps, load};
use crate::lead::{GROUP, Lead};
use crate::picture::{WrongLength, check};

impl Converter {
    /// Sets each pixel of `mask` to [`SET`] where the RGB picture `rgb` lies in `range`, and to 0 elsewhere.
    ///
    /// The mask is that of [`convert`](Converter::convert) and [`in_range`](crate::colour::in_range) one after the other, to
    /// the last pixel. `rgb` has three bytes for each byte of `mask`.
    pub fn split(&self, rgb: &[u8], range: &ColourRange, mask: &mut [u8]) -> Result<(), WrongLength> {
        check("rgb", rgb.len(), 3 * mask.len())?;
        let steps = Steps::of(range);
        let (bounds, lead) = (Bounds::of(steps), Lead::of(steps));
        let (groups, rest) = rgb.as_chunks::<3>().0.as_chunks::<GROUP>();
        let (mask_groups, mask_rest) = mask.as_chunks_mut::<GROUP>();
        for (number, (from, out)) in groups.iter().zip(mask_groups).enumerate() {
            let passed_over = lead.as_ref().is_some_and(|lead| lead.is_missing(rgb, number));
            *out = if passed_over { [0; GROUP] } else { self.split_group(from, bounds) };
        }
        for ([r, g, b], out) in rest.iter().zip(mask_rest) {
            let pixel = u32::from_le_bytes([*r, *g, *b, 0]);
            *out = self.decide(pixel, bounds.is_vivid(pixel), bounds.hues);
        }
        Ok(())
    }

    fn split_group(&self, rgb: &[[u8; 3]; GROUP], bounds: Bounds) -> [u8; GROUP] {
        let (mut pixels, mut vivid, mut mask) = ([0; GROUP], [0; GROUP], [0; GROUP]);
        load(rgb, &mut pixels);
        let mut any = 0;
        for (vivid, pixel) in vivid.iter_mut().zip(&pixels) {
            *vivid = bounds.is_vivid(*pixel);
            any |= *vivid;
        }
        if any != 0 {
            for ((pixel, vivid), out) in pixels.iter().zip(&vivid).zip(&mut mask) {
                *out = self.decide(*pixel, *vivid, bounds.hues);
            }
        }
        mask
    }

    #[inline(always)]
    fn decide(&self, pixel: u32, vivid: u32, (first, more): (u8, u8)) -> u8 {
        // Subtraction of bytes wraps as the hue does, so the seam at red needs no case of its own.
        let inside = self.hue_step(pixel).wrapping_sub(first) <= more;
        if inside & (vivid != 0) { SET } else { 0 }
    }
}

/// The bounds of a range as the pixels are compared with them.
#[derive(Clone, Copy)]
struct Bounds {
    /// The first step of hue, and how many follow it.
    hues: (u8, u8),
    /// 511 − 2s.
    paleness: f32,
    /// The least R+G+B.
    sum: f32,
}

impl Bounds {
    fn of(steps: Steps) -> Bounds {
        let [hue, saturation, intensity] = steps.first;
        // Black has no saturation; the comparison of products would give it every one.
        let least = u16::from(saturation > 0);
        Bounds {
            hues: (hue, steps.more[0]),
            paleness: f32::from(511 - 2 * u16::from(saturation)),
            sum: f32::from((3 * u16::from(intensity)).saturating_sub(1).max(least)),
        }
    }

    /// Whether a pixel is coloured and bright enough: not 0 when it is. The bytes of `pixel` are R G B x.
    #[inline(always)]
    fn is_vivid(self, pixel: u32) -> u32 {
        let channel = |shift: u32| ((pixel >> shift) & 0xff) as i32 as f32;
        let (r, g, b) = (channel(0), channel(8), channel(16));
        // Of numbers every processor finds the lesser at once, as long as nobody asks what becomes of those that are none.
        let lesser = |a: f32, b: f32| if a < b { a } else { b };
        let (sum, least) = (r + g + b, lesser(lesser(r, g), b));
        // All are whole numbers below 2²⁴, so nothing is rounded. A difference has its sign bit set when a bound is missed.
        let misses = (sum * self.paleness - 1530.0 * least).to_bits() | (sum - self.sum).to_bits();
        !misses & (1 << 31)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colour::in_range;
    use proptest::prelude::*;
    use types::geometry::TAU;

    /// The mask by the long way: over the converted picture.
    fn by_conversion(converter: &Converter, rgb: &[u8], range: &ColourRange) -> Vec<u8> {
        let (mut hsi, mut mask) = (vec![0; rgb.len()], vec![7; rgb.len() / 3]);
        converter.convert(rgb, &mut hsi).unwrap();
        in_range(&hsi, range, &mut mask).unwrap();
        mask
    }

    fn split(converter: &Converter, rgb: &[u8], range: &ColourRange) -> Vec<u8> {
        let mut mask = vec![7; rgb.len() / 3];
        converter.split(rgb, range, &mut mask).unwrap();
        mask
    }

    #[test]
    fn the_split_of_the_whole_cube_is_that_of_its_conversion() {
        let converter = Converter::new();
        let grey_too = ColourRange { hue_from: 0.0, hue_to: TAU, saturation_min: 0.0, intensity_min: 0.0 };
        let ranges = [
            ColourRange::default(),
            ColourRange { saturation_min: 0.0, intensity_min: 0.0, ..ColourRange::default() },
            ColourRange { hue_from: 1.0, hue_to: 3.0, saturation_min: 1.0, intensity_min: 0.3 },
            ColourRange { hue_from: 1.8, hue_to: 2.5, ..ColourRange::default() },
            ColourRange { hue_from: 4.0, hue_to: 4.1, saturation_min: 0.02, intensity_min: 0.05 },
            ColourRange { hue_from: 3.3, hue_to: 5.1, saturation_min: 0.1, ..ColourRange::default() },
            ColourRange { intensity_min: 1.0, ..grey_too },
            grey_too,
        ];
        // Every third value of a channel, and both ends: black, white and the edges are among them.
        let values = || (0..=255u8).step_by(3);
        let cube: Vec<u8> = values()
            .flat_map(|r| values().flat_map(move |g| values().flat_map(move |b| [r, g, b])))
            .collect();
        for range in ranges {
            assert!(
                split(&converter, &cube, &range) == by_conversion(&converter, &cube, &range),
                "{range:?}"
            );
        }
    }

    #[test]
    fn black_is_taken_only_by_a_range_of_all_colours() {
        let converter = Converter::new();
        let dark = ColourRange { saturation_min: 0.0, intensity_min: 0.0, ..ColourRange::default() };
        assert_eq!(split(&converter, &[0; 3], &dark), [0]);
        let all = ColourRange { hue_from: 0.0, hue_to: TAU, ..dark };
        assert_eq!(split(&converter, &[0; 3], &all), [SET]);
    }

    #[test]
    fn a_wrong_length_is_refused() {
        let error = Converter::new().split(&[0; 5], &ColourRange::default(), &mut [0; 2]).unwrap_err();
        assert_eq!(error, WrongLength { buffer: "rgb", expected: 6, got: 5 });
    }

    proptest! {
        #[test]
        fn any_range_splits_any_picture_as_its_conversion_does(
            picture in proptest::collection::vec(any::<u8>(), 3 * 533),
            from in 0.0..TAU, width in 0.0..6.4f64, saturation_min in 0.0..1.0f64, intensity_min in 0.0..1.0f64,
        ) {
            let converter = Converter::new();
            let range = ColourRange { hue_from: from, hue_to: from + width, saturation_min, intensity_min };
            prop_assert_eq!(split(&converter, &picture, &range), by_conversion(&converter, &picture, &range));
        }
    }
}
