//! Edges: the strength of the change of intensity, after Sobel.
//!
//! ```text
//!        −1 0 1            −1 −2 −1
//! gx  =  −2 0 2     gy  =   0  0  0      strength = ¼ √(gx² + gy²), at most 255
//!        −1 0 1             1  2  1
//! ```
//!
//! The weights of one side sum to 4, so a straight vertical or horizontal step of h from one pixel to the next has the
//! strength h on both sides of it. The outermost pixels have no neighbours on one side; their strength is 0.

use crate::picture::{Size, WrongLength, check};

/// Writes the edge strength of the picture `intensity` to `strength`, both of `size`, one byte a pixel.
pub fn sobel(intensity: &[u8], size: Size, strength: &mut [u8]) -> Result<(), WrongLength> {
    check("intensity", intensity.len(), size.pixels())?;
    check("strength", strength.len(), size.pixels())?;
    strength.fill(0);
    let width = size.width;
    if width < 3 || size.height < 3 {
        return Ok(());
    }
    for y in 1..size.height - 1 {
        let row = |y: usize| &intensity[y * width..(y + 1) * width];
        sobel_row(row(y - 1), row(y), row(y + 1), &mut strength[y * width + 1..(y + 1) * width - 1]);
    }
    Ok(())
}

/// Sets each byte of `mask` to 255 where `picture` is at least `least`, and to 0 elsewhere.
pub fn at_least(picture: &[u8], least: u8, mask: &mut [u8]) -> Result<(), WrongLength> {
    check("mask", mask.len(), picture.len())?;
    for (value, out) in picture.iter().zip(mask) {
        *out = if *value >= least { 255 } else { 0 };
    }
    Ok(())
}

/// The strength of all pixels of a row but the first and the last.
fn sobel_row(above: &[u8], here: &[u8], below: &[u8], out: &mut [u8]) {
    // Slices of one length let the loop run on vectors without a check of each index.
    let n = out.len();
    let (a, b, c) = (&above[..n], &above[1..n + 1], &above[2..n + 2]);
    let (d, f) = (&here[..n], &here[2..n + 2]);
    let (g, h, i) = (&below[..n], &below[1..n + 1], &below[2..n + 2]);
    for k in 0..n {
        let v = |slice: &[u8]| i16::from(slice[k]);
        let gx = v(c) + 2 * v(f) + v(i) - v(a) - 2 * v(d) - v(g);
        let gy = v(g) + 2 * v(h) + v(i) - v(a) - 2 * v(b) - v(c);
        let (gx, gy) = (i32::from(gx), i32::from(gy));
        // The root of IEEE 754 is exact to the last bit everywhere, and a square sum below 2²⁴ is exact as f32.
        let strength = ((gx * gx + gy * gy) as f32).sqrt() * 0.25 + 0.5;
        out[k] = strength.min(255.0) as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Expected: scipy 1.17.1, `floor(hypot(ndimage.sobel(p, 1), ndimage.sobel(p, 0)) / 4 + 0.5)`, cut at 255.
    #[test]
    fn a_small_picture_has_the_edges_that_scipy_finds() {
        let picture = [
            0, 7, 28, 63, 112, 175, 13, 25, 51, 91, 145, 213, 52, 69, 100, 145, 204, 21, 117, 139, 175, 225,
            33, 111, 208, 235, 20, 75, 144, 227,
        ];
        let expect = [
            0, 0, 0, 0, 0, 0, 0, 73, 98, 125, 64, 0, 0, 124, 145, 81, 77, 0, 0, 102, 27, 71, 50, 0, 0, 0, 0,
            0, 0, 0,
        ];
        let mut got = [7; 30];
        sobel(&picture, Size::new(6, 5), &mut got).unwrap();
        assert_eq!(got, expect);
    }

    #[test]
    fn a_step_has_its_own_height_as_strength_on_both_sides() {
        let picture: Vec<u8> = (0..64).map(|i| if i % 8 < 4 { 30 } else { 200 }).collect();
        let mut got = [0; 64];
        sobel(&picture, Size::new(8, 8), &mut got).unwrap();
        assert_eq!(got[24..32], [0, 0, 0, 170, 170, 0, 0, 0]);
        let mut mask = [7; 64];
        at_least(&got, 170, &mut mask).unwrap();
        assert_eq!(mask[24..32], [0, 0, 0, 255, 255, 0, 0, 0]);
    }

    #[test]
    fn the_strongest_corner_is_cut_at_the_largest_byte() {
        let mut got = [0; 9];
        sobel(&[0, 0, 255, 0, 0, 255, 255, 255, 255], Size::new(3, 3), &mut got).unwrap();
        assert_eq!(got, [0, 0, 0, 0, 255, 0, 0, 0, 0]);
        sobel(&[1, 2], Size::new(2, 1), &mut got[..2]).unwrap();
        assert_eq!(got[..2], [0, 0]);
        assert!(sobel(&[0; 8], Size::new(3, 3), &mut got).is_err());
    }
}
