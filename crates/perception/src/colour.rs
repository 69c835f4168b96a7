//! RGB to HSI, and the split of a picture by colour.
//!
//! In plain words: hue says which colour, saturation how much of it, intensity how bright. A red ball keeps its hue
//! in the shade, so it is looked for by hue.
//!
//! Gonzalez and Woods, *Digital Image Processing*, 3rd ed., eq. 6.2-2 to 6.2-4, with R, G, B in 0..1:
//!
//! ```text
//! θ = acos( ½((R−G)+(R−B)) / √((R−G)² + (R−B)(G−B)) )      H = θ if B ≤ G, else 2π − θ
//! S = 1 − 3 min(R,G,B) / (R+G+B)                           I = (R+G+B) / 3
//! ```
//!
//! A grey has no hue; it is given hue 0 and saturation 0. Hue is a circle and red lies on its seam: a range from
//! 350° to 10° runs through 0.
//!
//! In a picture the three channels are bytes, interleaved H S I, each the exact value rounded to the nearest step:
//! 256 steps of hue make a full turn, so step k stands for k · 360°/256 and step 256 is step 0 again; saturation and
//! intensity run from 0 to 255 for 0 to 1.

use crate::picture::{WrongLength, check};
use libm::{acos, floor, round, sqrt};
use types::geometry::TAU;

/// What a set pixel of a mask is. A pixel that is not set is 0.
pub const SET: u8 = 255;

/// A hue table has a row of 512 for the 511 differences of two bytes, so that an index is two masks and a shift.
const SIDE: usize = 512;
/// Pixels that are converted at a time: what lies between the loops stays in the nearest cache.
const BLOCK: usize = 256;
/// Bytes after which both the three channels and vectors of 16 bytes repeat.
const PATTERN: usize = 48;

/// A colour as hue, saturation and intensity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Hsi {
    /// Which colour: red 0, green 2π/3, blue 4π/3 (rad, in [0, 2π)).
    pub hue: f64,
    /// How far from grey (0..1).
    pub saturation: f64,
    /// How bright (0..1).
    pub intensity: f64,
}

/// A range of colours. The defaults are the red object of the exploration experiment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColourRange {
    /// Where the range of hues begins, going up (rad). Default 350°: the red of the experiment.
    pub hue_from: f64,
    /// Where it ends (rad). Less than `hue_from` when the range runs through 0. Default 10°.
    ///
    /// A range of a full turn or more takes every hue.
    pub hue_to: f64,
    /// Least saturation (0..1). Default 0.35: skin, wood and brick are reddish but stay below it.
    pub saturation_min: f64,
    /// Least intensity (0..1). Default 0.12: below it the noise of a byte makes the hue of a shadow arbitrary.
    pub intensity_min: f64,
}

/// Converts pictures from RGB to HSI. Every byte is the exact value rounded to the nearest step, for all 2²⁴ colours.
///
/// Hue depends only on R−G and R−B, so it is read from a table of 512 × 512 bytes, filled from the exact formula once; a
/// picture of few colours touches little of it.
#[derive(Clone, Debug)]
pub struct Converter {
    // The length is in the type: an index into it needs no check.
    hue: Box<[u8; SIDE * SIDE]>,
}

/// A [`ColourRange`] in the steps of a picture: per channel the first step and how many follow it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Steps {
    pub(crate) first: [u8; 3],
    pub(crate) more: [u8; 3],
}

/// The exact hue, saturation and intensity of a colour given as R, G, B bytes.
pub fn hsi(rgb: [u8; 3]) -> Hsi {
    let [r, g, b] = rgb.map(f64::from);
    let sum = r + g + b;
    let saturation = if sum > 0.0 { 1.0 - 3.0 * r.min(g).min(b) / sum } else { 0.0 };
    Hsi { hue: hue(r - g, r - b), saturation, intensity: sum / 765.0 }
}

/// The hue of the step `step` of a picture (rad).
pub fn hue_of_step(step: u8) -> f64 {
    f64::from(step) * TAU / 256.0
}

/// The step of a picture that is nearest to `hue` (rad, any turn).
pub fn step_of_hue(hue: f64) -> u8 {
    let steps = round(hue * 256.0 / TAU);
    (steps - 256.0 * floor(steps / 256.0)) as u8
}

/// Sets each pixel of `mask` to [`SET`] where the HSI picture `hsi` lies in `range`, and to 0 elsewhere.
///
/// `hsi` has three bytes for each byte of `mask`. Every colour inside the range is taken; at each end one that is up
/// to half a step outside (0.7° of hue) can be taken too. A grey has no hue: it is taken only by a range of all hues.
pub fn in_range(hsi: &[u8], range: &ColourRange, mask: &mut [u8]) -> Result<(), WrongLength> {
    check("hsi", hsi.len(), 3 * mask.len())?;
    let steps = Steps::of(range);
    // The three channels repeat, so one pattern of 48 bytes compares 16 pixels without pulling the channels apart.
    let first: [u8; PATTERN] = core::array::from_fn(|i| steps.first[i % 3]);
    let more: [u8; PATTERN] = core::array::from_fn(|i| steps.more[i % 3]);
    let (blocks, rest) = hsi.as_chunks::<PATTERN>();
    let (mask_blocks, mask_rest) = mask.as_chunks_mut::<16>();
    for (pixels, out) in blocks.iter().zip(mask_blocks) {
        *out = split_block(pixels, &first, &more);
    }
    for (pixel, out) in rest.as_chunks::<3>().0.iter().zip(mask_rest) {
        *out = if steps.contain(*pixel) { SET } else { 0 };
    }
    Ok(())
}

/// Copies the intensity channel of the HSI picture `hsi` (three bytes a pixel) to `intensity` (one byte a pixel).
pub fn intensity(hsi: &[u8], intensity: &mut [u8]) -> Result<(), WrongLength> {
    check("hsi", hsi.len(), 3 * intensity.len())?;
    for (pixel, out) in hsi.as_chunks::<3>().0.iter().zip(intensity) {
        *out = pixel[2];
    }
    Ok(())
}

impl Default for ColourRange {
    fn default() -> ColourRange {
        ColourRange {
            hue_from: 350f64.to_radians(),
            hue_to: 10f64.to_radians(),
            saturation_min: 0.35,
            intensity_min: 0.12,
        }
    }
}

impl ColourRange {
    /// Whether the range takes every hue.
    pub fn is_full_turn(&self) -> bool {
        self.hue_to - self.hue_from >= TAU
    }
}

impl Default for Converter {
    fn default() -> Converter {
        Converter::new()
    }
}

impl Converter {
    /// Fills the tables: about 260 kB and some milliseconds, once.
    pub fn new() -> Converter {
        let mut table = Box::new([0; SIDE * SIDE]);
        let mut set = |red_green: i32, red_blue: i32, hue: f64| {
            table[hue_index(red_green, red_blue) as usize % (SIDE * SIDE)] = step_of_hue(hue);
        };
        for red_green in -255i32..=255 {
            // Green is not below blue here; with the two exchanged the hue is mirrored. No two bytes differ by more than 255.
            for red_blue in red_green..=(red_green + 255).min(255) {
                let exact = hue(f64::from(red_green), f64::from(red_blue));
                set(red_green, red_blue, exact);
                set(red_blue, red_green, TAU - exact);
            }
        }
        Converter { hue: table }
    }

    /// The step of hue of a pixel whose bytes are R G B x.
    #[inline(always)]
    pub(crate) fn hue_step(&self, pixel: u32) -> u8 {
        let channel = |shift: u32| ((pixel >> shift) & 0xff) as i32;
        let (r, g, b) = (channel(0), channel(8), channel(16));
        self.hue[hue_index(r - g, r - b) as usize % (SIDE * SIDE)]
    }

    /// Converts the picture `rgb` to `hsi`, three bytes a pixel in both.
    pub fn convert(&self, rgb: &[u8], hsi: &mut [u8]) -> Result<(), WrongLength> {
        check("rgb", rgb.len(), rgb.len() / 3 * 3)?;
        check("hsi", hsi.len(), rgb.len())?;
        let hue = &*self.hue;
        let (blocks, rest) = rgb.as_chunks::<3>().0.as_chunks::<BLOCK>();
        let (hsi_blocks, hsi_rest) = hsi.as_chunks_mut::<3>().0.as_chunks_mut::<BLOCK>();
        let mut scratch = Scratch::new();
        for (from, to) in blocks.iter().zip(hsi_blocks) {
            convert_block(hue, from, to, &mut scratch);
        }
        let mut scratch = Scratch::new();
        for (from, to) in rest.as_chunks::<1>().0.iter().zip(hsi_rest.as_chunks_mut::<1>().0) {
            convert_block(hue, from, to, &mut scratch);
        }
        Ok(())
    }
}

impl Steps {
    pub(crate) fn of(range: &ColourRange) -> Steps {
        let (from, to) = (step_of_hue(range.hue_from), step_of_hue(range.hue_to));
        let width = range.hue_to - range.hue_from;
        let width = width - TAU * floor(width / TAU);
        // A range that is nearly a whole turn ends on the step where it begins.
        let all = range.is_full_turn() || (from == to && width > TAU / 2.0);
        let hues = if all { 255 } else { to.wrapping_sub(from) };
        let unit = |share: f64| round(share.clamp(0.0, 1.0) * 255.0) as u8;
        let saturation =
            if range.is_full_turn() { unit(range.saturation_min) } else { unit(range.saturation_min).max(1) };
        let intensity = unit(range.intensity_min);
        Steps { first: [from, saturation, intensity], more: [hues, 255 - saturation, 255 - intensity] }
    }

    fn contain(&self, pixel: [u8; 3]) -> bool {
        // Subtraction of bytes wraps as the hue does, so the seam at red needs no case of its own.
        (0..3).all(|c| pixel[c].wrapping_sub(self.first[c]) <= self.more[c])
    }
}

/// The mask of 16 pixels.
#[inline(always)]
fn split_block(pixels: &[u8; PATTERN], first: &[u8; PATTERN], more: &[u8; PATTERN]) -> [u8; 16] {
    let mut inside = [0u8; PATTERN];
    for i in 0..PATTERN {
        inside[i] = if pixels[i].wrapping_sub(first[i]) <= more[i] { SET } else { 0 };
    }
    // Most of a picture is not of the colour that is looked for: no pixel has the hue, or none is coloured enough.
    if !any_of_channel(&inside, 0) || !any_of_channel(&inside, 1) {
        return [0; 16];
    }
    let mut mask = [0; 16];
    for (inside, out) in inside.as_chunks::<24>().0.iter().zip(mask.as_chunks_mut::<8>().0) {
        *out = all_three(inside);
    }
    mask
}

/// Whether one of 16 pixels has its byte of the channel set.
#[inline(always)]
fn any_of_channel(inside: &[u8; PATTERN], channel: usize) -> bool {
    let mut union = [0u8; 16];
    for p in 0..16 {
        let at = |offset: usize| if (offset + p) % 3 == channel { inside[offset + p] } else { 0 };
        union[p] = at(0) | at(16) | at(32);
    }
    u128::from_le_bytes(union) != 0
}

/// Of 8 pixels, three bytes each of which is [`SET`] or 0: what is set in all three, 8 pixels at once in whole words.
#[inline(always)]
fn all_three(inside: &[u8; 24]) -> [u8; 8] {
    const A: u64 = 0x00ff_0000_ff00_00ff;
    const B: u64 = 0xff00_00ff_0000_ff00;
    const C: u64 = 0x0000_ff00_00ff_0000;
    let word = |i: usize| u64::from_le_bytes(core::array::from_fn(|k| inside[8 * i + k]));
    let (low, middle, high) = (word(0), word(1), word(2));
    // In the three words the bytes of one channel stand at places of their own: pixel k at place 3k mod 8 of the union,
    // and one place further for each channel.
    let hue = (low & A) | (middle & B) | (high & C);
    let saturation = (low & B) | (middle & C) | (high & A);
    let intensity = (low & C) | (middle & A) | (high & B);
    let all = hue & saturation.rotate_right(8) & intensity.rotate_right(16);
    // Back into order: the places 1 and 3 change, 5 and 7, and 2 and 6.
    let near = (all ^ (all >> 16)) & 0x0000_ff00_0000_ff00;
    let all = all ^ near ^ (near << 16);
    let far = (all ^ (all >> 32)) & 0x0000_0000_00ff_0000;
    (all ^ far ^ (far << 32)).to_le_bytes()
}

/// What lies between the loops of a conversion.
struct Scratch<const N: usize> {
    pixel: [u32; N],
    index: [u32; N],
    shade: [u32; N],
}

impl<const N: usize> Scratch<N> {
    fn new() -> Scratch<N> {
        Scratch { pixel: [0; N], index: [0; N], shade: [0; N] }
    }
}

/// Converts N pixels. The loops are apart so that the middle one, the arithmetic, runs on whole vectors; a pixel is read
/// and written as one word of four bytes, since byte by byte the writing would take longer than the rest.
#[inline(always)]
fn convert_block<const N: usize>(
    hue: &[u8; SIDE * SIDE],
    rgb: &[[u8; 3]; N],
    hsi: &mut [[u8; 3]; N],
    scratch: &mut Scratch<N>,
) {
    let Scratch { pixel, index, shade } = scratch;
    load(rgb, pixel);
    for i in 0..N {
        (index[i], shade[i]) = index_and_shade(pixel[i]);
    }
    let hsi = hsi.as_flattened_mut();
    for i in 0..N - 1 {
        let word = shade[i] | u32::from(hue[index[i] as usize % (SIDE * SIDE)]);
        // The fourth byte is overwritten by the next pixel.
        hsi[3 * i..3 * i + 4].copy_from_slice(&word.to_le_bytes());
    }
    let word = shade[N - 1] | u32::from(hue[index[N - 1] as usize % (SIDE * SIDE)]);
    hsi[3 * N - 3..].copy_from_slice(&word.to_le_bytes()[..3]);
}

/// Reads pixels as words, R lowest. The fourth byte is the next pixel's first, and of the last pixel 0.
#[inline(always)]
pub(crate) fn load<const N: usize>(rgb: &[[u8; 3]; N], pixel: &mut [u32; N]) {
    let rgb = rgb.as_flattened();
    for i in 0..N - 1 {
        pixel[i] = u32::from_le_bytes([rgb[3 * i], rgb[3 * i + 1], rgb[3 * i + 2], rgb[3 * i + 3]]);
    }
    pixel[N - 1] = u32::from_le_bytes([rgb[3 * N - 3], rgb[3 * N - 2], rgb[3 * N - 1], 0]);
}

/// Where the table has the hue of a pixel, and the word 0 S I 0 that lacks only the hue. The bytes of `pixel` are R G B x.
///
/// In whole numbers but for the one division, which is in single precision: of both every processor has vectors.
#[inline(always)]
fn index_and_shade(pixel: u32) -> (u32, u32) {
    /// Of 765 a little less. The share of grey, 765 least / sum, is to be rounded with halves down, so that what it leaves of 255 is
    /// rounded with halves up. Any other value of this fraction is at least 1/1530 away from a half, and this moves it by less.
    const NEARLY_765: f32 = 765.0 * (1.0 - 1.0 / 1_048_576.0);
    /// So little that only 0 / 0 changes by it: black, too, is all grey.
    const NOTHING: f32 = 1e-30;
    let channel = |shift: u32| ((pixel >> shift) & 0xff) as i32;
    let (r, g, b) = (channel(0), channel(8), channel(16));
    let (sum, least) = (r + g + b, r.min(g).min(b));
    let grey = (least as f32 * NEARLY_765 + 255.0 * NOTHING) / (sum as f32 + NOTHING);
    // 21846 / 2¹⁶ is a third and a hundred-thousandth: too little more to reach the next whole number. Its third byte is I.
    let intensity = (21_846 * sum + 21_846) as u32 & 0x00ff_0000;
    (hue_index(r - g, r - b), (!(nearest(grey) << 8) & 0xff00) | intensity)
}

/// The whole number nearest to `x`, for x in 0 ..= 255, in the lowest byte: adding 2²³ leaves it there.
#[inline(always)]
fn nearest(x: f32) -> u32 {
    (x + 8_388_608.0).to_bits()
}

/// Where the table has the hue for the two differences of two bytes, but for whole turns of the table.
#[inline(always)]
fn hue_index(red_green: i32, red_blue: i32) -> u32 {
    (red_green * SIDE as i32 + red_blue) as u32
}

/// Hue from R−G and R−B, on any common scale (rad, in [0, 2π)).
fn hue(red_green: f64, red_blue: f64) -> f64 {
    let green_blue = red_blue - red_green;
    let length = sqrt(red_green * red_green + red_blue * green_blue);
    if length == 0.0 {
        return 0.0;
    }
    let angle = acos((0.5 * (red_green + red_blue) / length).clamp(-1.0, 1.0));
    if green_blue >= 0.0 { angle } else { TAU - angle }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn degrees(rgb: [u8; 3]) -> f64 {
        hsi(rgb).hue.to_degrees()
    }

    /// The colours of a cube with a corner in black and one in white, every fifth value of a channel.
    fn dense_sample() -> impl Iterator<Item = [u8; 3]> {
        let values = || (0..=255u8).step_by(5);
        values().flat_map(move |r| values().flat_map(move |g| values().map(move |b| [r, g, b])))
    }

    fn steps(colour: Hsi) -> [u8; 3] {
        let unit = |x: f64| round(x * 255.0 + 1e-9) as u8;
        [step_of_hue(colour.hue), unit(colour.saturation), unit(colour.intensity)]
    }

    #[test]
    fn the_corners_of_the_colour_cube_are_sixty_degrees_apart() {
        let corners = [[255, 0, 0], [255, 255, 0], [0, 255, 0], [0, 255, 255], [0, 0, 255], [255, 0, 255]];
        for (corner, expect) in corners.into_iter().zip([0.0, 60.0, 120.0, 180.0, 240.0, 300.0]) {
            assert!((degrees(corner) - expect).abs() < 1e-5, "{corner:?}: {}", degrees(corner));
            assert_eq!(hsi(corner).saturation, 1.0);
        }
        assert_eq!(hsi([255, 255, 255]), Hsi { hue: 0.0, saturation: 0.0, intensity: 1.0 });
        assert_eq!(hsi([0, 0, 0]), Hsi::default());
    }

    #[test]
    fn hue_agrees_with_the_angle_in_the_plane_across_the_grey_axis() {
        // The same angle from other mathematics: the polar angle of the colour seen along the grey axis.
        for rgb in dense_sample().filter(|c| c[0] != c[1] || c[1] != c[2]) {
            let [r, g, b] = rgb.map(f64::from);
            let polar = libm::atan2(libm::sqrt(3.0) * (g - b), 2.0 * r - g - b);
            assert!(types::geometry::wrap(hsi(rgb).hue - polar).abs() < 1e-7, "{rgb:?}");
        }
    }

    #[test]
    fn the_fast_conversion_is_the_exact_one_rounded() {
        let converter = Converter::new();
        let rgb: Vec<u8> = dense_sample().flatten().collect();
        let mut fast = vec![0; rgb.len()];
        converter.convert(&rgb, &mut fast).unwrap();
        for (colour, got) in dense_sample().zip(fast.as_chunks::<3>().0) {
            assert_eq!(*got, steps(hsi(colour)), "{colour:?}");
        }
    }

    #[test]
    fn every_hue_of_a_picture_is_the_nearest_step() {
        // Hue depends on the two differences alone, so one colour for each pair of them stands for all 2²⁴.
        let converter = Converter::new();
        for (red_green, red_blue) in (-255..=255i32).flat_map(|a| (-255..=255).map(move |b| (a, b))) {
            let r = red_green.max(red_blue).max(0);
            let (g, b) = (r - red_green, r - red_blue);
            if r.max(g).max(b) > 255 || (red_green, red_blue) == (0, 0) {
                continue;
            }
            let mut got = [0; 3];
            converter.convert(&[r, g, b].map(|c| c as u8), &mut got).unwrap();
            let polar = libm::atan2(libm::sqrt(3.0) * f64::from(g - b), f64::from(2 * r - g - b));
            let off = types::geometry::wrap(hue_of_step(got[0]) - polar).abs();
            assert!(off <= TAU / 512.0 + 1e-7, "{r} {g} {b}: {off}");
        }
    }

    #[test]
    fn saturation_and_intensity_are_exact_for_every_minimum_and_sum() {
        let converter = Converter::new();
        for min in 0..=255u32 {
            for sum in 3 * min..=510 + min {
                // Two channels share what is above the minimum.
                let above = sum - 3 * min;
                let first = above.min(255 - min);
                let rgb = [min, min + first, min + above - first].map(|c| c as u8);
                let mut got = [0; 3];
                converter.convert(&rgb, &mut got).unwrap();
                // Whole numbers, halves up: an oracle without rounding of its own.
                let saturation = (2 * 255 * above + sum).checked_div(2 * sum).unwrap_or(0);
                assert_eq!(u32::from(got[1]), saturation, "{rgb:?}");
                assert_eq!(u32::from(got[2]), (2 * sum + 3) / 6, "{rgb:?}");
            }
        }
    }

    #[test]
    fn red_runs_through_zero() {
        let inside = |hue: u8| {
            let mut mask = [7];
            in_range(&[hue, 255, 128], &ColourRange::default(), &mut mask).unwrap();
            mask[0] == SET
        };
        // 350° is step 248.9 and 10° is step 7.1.
        let taken: Vec<u8> = (0..=255).filter(|h| inside(*h)).collect();
        assert_eq!(taken, [0, 1, 2, 3, 4, 5, 6, 7, 249, 250, 251, 252, 253, 254, 255]);
    }

    #[test]
    fn a_grey_is_not_red_though_its_hue_is_zero() {
        let greedy = ColourRange { saturation_min: 0.0, intensity_min: 0.0, ..ColourRange::default() };
        let mut mask = [7; 2];
        in_range(&[0, 0, 128, 0, 1, 128], &greedy, &mut mask).unwrap();
        assert_eq!(mask, [0, SET]);
    }

    #[test]
    fn a_full_turn_takes_every_hue() {
        let all = ColourRange { hue_from: 0.0, hue_to: TAU, saturation_min: 0.0, intensity_min: 0.5 };
        let picture: Vec<u8> = (0..=255).flat_map(|h| [h, 0, if h < 100 { 10 } else { 200 }]).collect();
        let mut mask = [7; 256];
        in_range(&picture, &all, &mut mask).unwrap();
        assert_eq!(mask.iter().filter(|m| **m == SET).count(), 156);
    }

    #[test]
    fn a_wrong_length_is_refused_with_its_name() {
        let error = Converter::new().convert(&[0; 6], &mut [0; 3]).unwrap_err();
        assert_eq!(error, WrongLength { buffer: "hsi", expected: 6, got: 3 });
        assert!(in_range(&[0; 5], &ColourRange::default(), &mut [0; 2]).is_err());
    }

    proptest! {
        #[test]
        fn the_split_agrees_with_the_exact_colour_to_half_a_step(
            rgb: [u8; 3], from in 0.0..TAU, width in 0.02..6.2f64,
        ) {
            let range = ColourRange { hue_from: from, hue_to: (from + width) % TAU, saturation_min: 0.2, intensity_min: 0.2 };
            let (mut picture, mut mask) = ([0; 3], [0]);
            Converter::new().convert(&rgb, &mut picture).unwrap();
            in_range(&picture, &range, &mut mask).unwrap();
            let exact = hsi(rgb);
            // How far the hue lies behind the beginning of the range, as a turn.
            let behind = (exact.hue - from).rem_euclid(TAU);
            let half = TAU / 512.0 + 1e-9;
            let surely_in = behind <= width && exact.saturation > 0.203 && exact.intensity > 0.203;
            let surely_out = (behind > width + 2.0 * half && behind < TAU - 2.0 * half)
                || exact.saturation < 0.197 || exact.intensity < 0.197;
            if surely_in { prop_assert_eq!(mask[0], SET) }
            if surely_out { prop_assert_eq!(mask[0], 0) }
        }

        #[test]
        fn blocks_and_the_rest_are_split_alike(picture in proptest::collection::vec(any::<u8>(), 3 * 533)) {
            let range = ColourRange { hue_to: 3.0, ..ColourRange::default() };
            let mut together = [0; 533];
            in_range(&picture, &range, &mut together).unwrap();
            for (pixel, expect) in picture.as_chunks::<3>().0.iter().zip(together) {
                let mut alone = [0];
                in_range(pixel, &range, &mut alone).unwrap();
                prop_assert_eq!(alone[0], expect);
            }
        }
    }
}
