//! Motion: what differs between two pictures of a camera that stands still.
//!
//! In plain words: a pixel has moved when its intensity changed by more than noise can. While the camera itself turns,
//! everything moves: use it only when the robot and its head stand still.

use crate::picture::{Size, WrongLength, check};

/// When a pixel counts as changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MotionParams {
    /// Least difference of intensity (steps of a byte). Default 24: three standard deviations of the difference of two
    /// readings of a web camera in a room, whose noise is 5 to 6 steps a reading.
    pub difference_min: u8,
}

/// What has changed between two pictures.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Changed pixels.
    pub changed: u32,
    /// Their mean x and y (pixel indices, (0, 0) is the centre of the first pixel); none where nothing changed.
    pub centre: Option<(f64, f64)>,
}

impl Default for MotionParams {
    fn default() -> MotionParams {
        MotionParams { difference_min: 24 }
    }
}

/// Compares two intensity pictures of `size`. Each byte of `mask` becomes 255 where the pixel changed, and 0 elsewhere.
pub fn motion(
    before: &[u8],
    now: &[u8],
    size: Size,
    params: &MotionParams,
    mask: &mut [u8],
) -> Result<Motion, WrongLength> {
    check("before", before.len(), size.pixels())?;
    check("now", now.len(), size.pixels())?;
    check("mask", mask.len(), size.pixels())?;
    for ((before, now), out) in before.iter().zip(now).zip(mask.iter_mut()) {
        *out = if before.abs_diff(*now) >= params.difference_min { 255 } else { 0 };
    }
    Ok(measure(mask, size.width))
}

fn measure(mask: &[u8], width: usize) -> Motion {
    if width == 0 {
        return Motion::default();
    }
    let (mut changed, mut x, mut y) = (0u64, 0u64, 0u64);
    for (row, pixels) in mask.chunks_exact(width).enumerate() {
        let count = pixels.iter().map(|p| u32::from(p & 1)).sum::<u32>();
        if count == 0 {
            continue;
        }
        changed += u64::from(count);
        y += u64::from(count) * row as u64;
        x += pixels
            .iter()
            .zip(0u64..)
            .map(|(p, column)| column & (u64::from(*p & 1)).wrapping_neg())
            .sum::<u64>();
    }
    let centre = (changed > 0).then(|| (x as f64 / changed as f64, y as f64 / changed as f64));
    Motion { changed: changed as u32, centre }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_that_moves_changes_where_it_was_and_where_it_is() {
        let size = Size::new(12, 6);
        let square = |left: usize| -> Vec<u8> {
            (0..72)
                .map(|i| {
                    if (left..left + 3).contains(&(i % 12)) && (1..4).contains(&(i / 12)) { 180 } else { 40 }
                })
                .collect()
        };
        let mut mask = vec![7; 72];
        let got = motion(&square(2), &square(4), size, &MotionParams::default(), &mut mask).unwrap();
        // Columns 2 and 3 are freed, 5 and 6 are taken, in rows 1 to 3.
        assert_eq!(got, Motion { changed: 12, centre: Some((4.0, 2.0)) });
        assert_eq!(mask[12..24], [0, 0, 255, 255, 0, 255, 255, 0, 0, 0, 0, 0]);
    }

    #[test]
    fn the_threshold_is_the_least_difference_either_way() {
        let params = MotionParams { difference_min: 24 };
        let mut mask = [7; 4];
        let got =
            motion(&[100, 100, 100, 100], &[123, 124, 77, 76], Size::new(4, 1), &params, &mut mask).unwrap();
        assert_eq!(mask, [0, 255, 0, 255]);
        assert_eq!(got, Motion { changed: 2, centre: Some((2.0, 0.0)) });
    }

    #[test]
    fn nothing_changed_has_no_centre() {
        let mut mask = [7; 6];
        let got = motion(&[9; 6], &[9; 6], Size::new(3, 2), &MotionParams::default(), &mut mask).unwrap();
        assert_eq!((got, mask), (Motion::default(), [0; 6]));
        assert!(motion(&[9; 6], &[9; 5], Size::new(3, 2), &MotionParams::default(), &mut mask).is_err());
    }
}
