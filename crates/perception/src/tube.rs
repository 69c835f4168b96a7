//! Upright tubes of two colours, one above the other, in a picture.
//!
//! In plain words: of each of the two colours the connected regions are looked for; where one of the upper colour stands right on top of one of the
//! lower, as wide as that and about as high, there is a tube. How far apart their middles are tells how far away it is; which colour is above
//! tells which kind of tube.
//!
//! The middles are those of the whole halves only where both are whole in the picture. One that is cut off by its rim, or half hidden, still
//! has a direction, but no distance.

use libm::{fabs, hypot};

use crate::blobs::{Blob, BlobFinder, BlobParams};
use crate::colour::{ColourRange, Converter, in_range};
use crate::picture::{Size, WrongLength, check};
use crate::recognise::Form;

/// The most regions of a colour, and so the most tubes.
pub const MOST_TUBES: usize = 16;
/// So many rows may lie between the colours, or be both: noise, and the edge of the two in one pixel.
const SEAM: f64 = 3.0;
/// One half may be so many times as wide or as high as the other.
const ALIKE: f64 = 1.4;
/// What is added to both before they are compared (pixels): small ones are counted in few.
const GRAIN: f64 = 2.0;

/// Which tubes are looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TubePattern {
    /// The colour of the upper half.
    pub upper: ColourRange,
    /// The colour of the lower half.
    pub lower: ColourRange,
}

/// A tube in a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tube {
    /// Its upper half.
    pub upper: Blob,
    /// Its lower half.
    pub lower: Blob,
    /// Whether both are there as a whole.
    pub whole: bool,
}

impl Tube {
    /// How far apart the middles of the halves are (pixels).
    pub fn apart(&self) -> f64 {
        hypot(self.upper.x - self.lower.x, self.upper.y - self.lower.y)
    }

    /// The middle between both (x to the right, y down, pixels).
    pub fn middle(&self) -> (f64, f64) {
        ((self.upper.x + self.lower.x) / 2.0, (self.upper.y + self.lower.y) / 2.0)
    }

    /// The tube of two regions, if they are one.
    fn of(upper: &Blob, lower: &Blob, size: Size) -> Option<Tube> {
        let [above, below] = [upper, lower].map(Extent::of);
        let gap = f64::from(lower.top) - f64::from(upper.bottom) - 1.0;
        let aside = fabs(upper.x - lower.x);
        let is_one = fabs(gap) <= SEAM
            && aside <= 0.5 * above.width.min(below.width).max(GRAIN)
            && are_alike(above.width, below.width);
        let is_cut = [upper, lower].iter().any(|half| {
            half.left == 0
                || half.top == 0
                || half.right as usize + 1 >= size.width
                || half.bottom as usize + 1 >= size.height
        });
        let whole = !is_cut && are_alike(above.height, below.height);
        is_one.then_some(Tube { upper: *upper, lower: *lower, whole })
    }
}

/// How wide and high a region is (pixels).
struct Extent {
    width: f64,
    height: f64,
}

impl Extent {
    fn of(blob: &Blob) -> Extent {
        let pixels = |first: u32, last: u32| f64::from(last - first) + 1.0;
        Extent { width: pixels(blob.left, blob.right), height: pixels(blob.top, blob.bottom) }
    }
}

fn are_alike(a: f64, b: f64) -> bool {
    a.max(b) + GRAIN <= ALIKE * (a.min(b) + GRAIN)
}

/// Finds tubes in pictures of one size. All memory is taken when it is made.
#[derive(Clone, Debug)]
pub struct TubeFinder {
    colours: Converter,
    mask: Vec<u8>,
    upper: BlobFinder<MOST_TUBES>,
    lower: BlobFinder<MOST_TUBES>,
    tubes: Vec<Tube>,
}

impl TubeFinder {
    /// Takes the memory for pictures of `size`, and the table of hues.
    pub fn new(size: Size) -> TubeFinder {
        TubeFinder {
            colours: Converter::new(),
            mask: vec![0; size.pixels()],
            upper: BlobFinder::new(size, BlobParams::default()),
            lower: BlobFinder::new(size, BlobParams::default()),
            tubes: Vec::with_capacity(MOST_TUBES),
        }
    }

    /// The size of the pictures.
    pub fn size(&self) -> Size {
        self.upper.size()
    }

    /// The tubes of the pattern, that with the largest lower half first. Each region belongs to one at most.
    ///
    /// # Errors
    /// When the picture has another size.
    pub fn find(
        &mut self,
        picture: &[u8],
        form: Form,
        pattern: &TubePattern,
    ) -> Result<&[Tube], WrongLength> {
        let TubeFinder { colours, mask, upper, lower, tubes } = self;
        let size = upper.size();
        check("picture", picture.len(), 3 * size.pixels())?;
        let split = |range: &ColourRange, mask: &mut [u8]| match form {
            Form::Rgb => colours.split(picture, range, mask),
            Form::Hsi => in_range(picture, range, mask),
        };
        split(&pattern.upper, mask)?;
        let above = upper.find(mask)?.blobs;
        split(&pattern.lower, mask)?;
        let below = lower.find(mask)?.blobs;
        tubes.clear();
        for foot in below {
            let is_free = |head: &&Blob| tubes.iter().all(|tube| tube.upper != **head);
            let gap = |tube: &Tube| fabs(f64::from(tube.lower.top) - f64::from(tube.upper.bottom) - 1.0);
            let found = above.iter().filter(is_free).filter_map(|head| Tube::of(head, foot, size));
            if let Some(tube) = found.min_by(|a, b| gap(a).total_cmp(&gap(b))) {
                tubes.push(tube);
            }
        }
        Ok(tubes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Size = Size::new(320, 240);
    const RED: [u8; 3] = [200, 25, 20];
    const GREEN: [u8; 3] = [40, 150, 60];

    fn pattern() -> TubePattern {
        let green = ColourRange {
            hue_from: 100f64.to_radians(),
            hue_to: 160f64.to_radians(),
            ..ColourRange::default()
        };
        TubePattern { upper: green, lower: ColourRange::default() }
    }

    /// A grey picture with boards: left, top, width, height, colour.
    fn picture(boards: &[(usize, usize, usize, usize, [u8; 3])]) -> Vec<u8> {
        let pixel = |i: usize| {
            let (x, y) = (i % SIZE.width, i / SIZE.width);
            let covers = |&&(left, top, width, height, _): &&(usize, usize, usize, usize, [u8; 3])| {
                (left..left + width).contains(&x) && (top..top + height).contains(&y)
            };
            boards.iter().rev().find(covers).map_or([120, 118, 116], |board| board.4)
        };
        (0..SIZE.pixels()).flat_map(pixel).collect()
    }

    fn found(boards: &[(usize, usize, usize, usize, [u8; 3])]) -> Vec<Tube> {
        TubeFinder::new(SIZE).find(&picture(boards), Form::Rgb, &pattern()).unwrap().to_vec()
    }

    #[test]
    fn the_middles_of_a_tube_are_as_far_apart_as_a_half_is_high() {
        let tubes = found(&[(100, 80, 12, 30, GREEN), (100, 110, 12, 30, RED)]);
        let [tube] = tubes[..] else { panic!("{tubes:?}") };
        assert!(tube.whole && (tube.apart() - 30.0).abs() < 1e-9, "{tube:?}");
        assert_eq!(tube.middle(), (105.5, 109.5));
        let mut hsi = vec![0; 3 * SIZE.pixels()];
        let rgb = picture(&[(100, 80, 12, 30, GREEN), (100, 110, 12, 30, RED)]);
        Converter::new().convert(&rgb, &mut hsi).unwrap();
        assert_eq!(TubeFinder::new(SIZE).find(&hsi, Form::Hsi, &pattern()).unwrap(), [tube]);
    }

    #[test]
    fn what_stands_upside_down_beside_or_apart_is_no_tube() {
        assert_eq!(found(&[(100, 80, 12, 30, RED), (100, 110, 12, 30, GREEN)]), []);
        assert_eq!(found(&[(100, 80, 12, 30, GREEN), (112, 110, 12, 30, RED)]), []);
        assert_eq!(found(&[(100, 80, 12, 30, GREEN), (100, 116, 12, 30, RED)]), []);
        assert_eq!(found(&[(100, 80, 30, 30, GREEN), (100, 110, 12, 30, RED)]), [], "a bush on a post");
        assert_eq!(found(&[(100, 80, 12, 30, GREEN)]), []);
    }

    #[test]
    fn one_that_is_cut_off_or_half_hidden_has_no_distance() {
        for boards in [
            [(100, 0, 12, 30, GREEN), (100, 30, 12, 30, RED)],
            [(100, 180, 12, 30, GREEN), (100, 210, 12, 30, RED)],
            [(0, 80, 12, 30, GREEN), (0, 110, 12, 30, RED)],
            [(100, 80, 12, 30, GREEN), (100, 110, 12, 12, RED)],
        ] {
            let tubes = found(&boards);
            assert!(matches!(tubes[..], [Tube { whole: false, .. }]), "{tubes:?}");
        }
    }

    #[test]
    fn of_several_each_half_belongs_to_one() {
        let boards = [
            (50, 80, 10, 25, GREEN),
            (50, 105, 10, 25, RED),
            (200, 90, 20, 40, GREEN),
            (200, 130, 20, 40, RED),
            (270, 20, 20, 20, RED),
        ];
        let tubes = found(&boards);
        let middles: Vec<f64> = tubes.iter().map(|tube| tube.middle().0).collect();
        assert_eq!(middles, [209.5, 54.5]);
    }

    #[test]
    fn a_picture_of_another_size_is_refused() {
        assert!(TubeFinder::new(SIZE).find(&[0; 12], Form::Rgb, &pattern()).is_err());
    }
}
