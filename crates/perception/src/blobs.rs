//! Connected regions of a mask: area, centre, box and orientation.
//!
//! In plain words: the split says which pixels are red; this says which of them belong together, so that the largest
//! red thing can be followed. Pixels touch over their sides and corners (8 neighbours).
//!
//! How it works: each row is cut into runs of set pixels. A run is joined with the runs of the row above that it touches
//! (union-find, the earliest run of a region is its root). Areas are summed, the largest regions get a place, and only
//! for these the moments are summed, in whole numbers and by the closed forms for a run.

use crate::picture::{Size, WrongLength, check};
use libm::{atan2, sqrt};

/// What counts as a region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlobParams {
    /// Least area of a region (pixels). Default 4: specks of camera noise are smaller, and a ball of 10 cm still covers
    /// six pixels 10 m in front of a camera of 60° and 320 pixels.
    pub area_min: u32,
}

/// A connected region of a mask. Coordinates are pixel indices: x to the right, y down, (0, 0) is the centre of the
/// first pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Blob {
    /// Set pixels.
    pub area: u32,
    /// Mean x (pixels).
    pub x: f64,
    /// Mean y (pixels).
    pub y: f64,
    /// Smallest x.
    pub left: u32,
    /// Smallest y.
    pub top: u32,
    /// Largest x.
    pub right: u32,
    /// Largest y.
    pub bottom: u32,
    /// Mean of (x − mean x)² (pixels²).
    pub xx: f64,
    /// Mean of (y − mean y)² (pixels²).
    pub yy: f64,
    /// Mean of (x − mean x)(y − mean y) (pixels²).
    pub xy: f64,
}

/// What was found in a mask.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found<'a> {
    /// The largest regions, the largest first; of equal ones first the one whose first pixel comes first.
    pub blobs: &'a [Blob],
    /// Regions that had no place: each is at most as large as the last of `blobs`.
    pub left_out: usize,
    /// Regions smaller than [`BlobParams::area_min`].
    pub too_small: usize,
}

/// Finds the regions of masks of one size, at most `CAPACITY` of them. Made once; a search allocates nothing.
#[derive(Clone, Debug)]
pub struct BlobFinder<const CAPACITY: usize = 32> {
    size: Size,
    params: BlobParams,
    runs: Vec<Run>,
    /// Roots of the regions that have a place, the largest first.
    chosen: Vec<u32>,
    sums: [Sums; CAPACITY],
    blobs: [Blob; CAPACITY],
}

/// Set pixels side by side in a row.
#[derive(Clone, Copy, Debug)]
struct Run {
    row: u32,
    start: u32,
    /// One past the last.
    end: u32,
    /// A run of the same region that is not later; the root is its own parent.
    parent: u32,
    /// Of a root: the area of the region.
    area: u32,
    /// Of a root: its place among the blobs.
    place: u32,
}

/// No place among the blobs.
const NOWHERE: u32 = u32::MAX;

/// Sums over the pixels of a region.
#[derive(Clone, Copy, Debug)]
struct Sums {
    n: u64,
    x: u64,
    y: u64,
    xx: u64,
    yy: u64,
    xy: u64,
    left: u32,
    top: u32,
    right: u32,
    bottom: u32,
}

impl Default for BlobParams {
    fn default() -> BlobParams {
        BlobParams { area_min: 4 }
    }
}

impl Blob {
    /// The direction of the long axis in the picture, from x towards y, that is clockwise as one sees it (rad, in
    /// (−π/2, π/2]). 0 for a region without a long axis.
    pub fn orientation(&self) -> f64 {
        0.5 * atan2(2.0 * self.xy, self.xx - self.yy)
    }

    /// Standard deviations along the long and the short axis (pixels). An ellipse has half axes twice as long.
    pub fn spread(&self) -> (f64, f64) {
        let mean = 0.5 * (self.xx + self.yy);
        let half = 0.5 * sqrt((self.xx - self.yy) * (self.xx - self.yy) + 4.0 * self.xy * self.xy);
        (sqrt(mean + half), sqrt((mean - half).max(0.0)))
    }
}

impl<const CAPACITY: usize> BlobFinder<CAPACITY> {
    /// Makes the scratch for masks of `size`: 24 bytes for every second pixel of a row, which no mask can exceed.
    pub fn new(size: Size, params: BlobParams) -> BlobFinder<CAPACITY> {
        BlobFinder {
            size,
            params,
            runs: Vec::with_capacity(size.height * size.width.div_ceil(2)),
            chosen: Vec::with_capacity(CAPACITY + 1),
            sums: [Sums::EMPTY; CAPACITY],
            blobs: [Blob::default(); CAPACITY],
        }
    }

    /// The size of the masks.
    pub fn size(&self) -> Size {
        self.size
    }

    /// The regions of `mask`, one byte a pixel, where a byte that is not 0 is a set pixel.
    pub fn find(&mut self, mask: &[u8]) -> Result<Found<'_>, WrongLength> {
        check("mask", mask.len(), self.size.pixels())?;
        self.cut_and_join(mask);
        let (left_out, too_small) = self.choose();
        self.measure();
        Ok(Found { blobs: &self.blobs[..self.chosen.len()], left_out, too_small })
    }

    /// The largest region of `mask`, if there is one that is large enough.
    pub fn largest(&mut self, mask: &[u8]) -> Result<Option<Blob>, WrongLength> {
        Ok(self.find(mask)?.blobs.first().copied())
    }

    /// Cuts the rows into runs, and joins each with what it touches above.
    fn cut_and_join(&mut self, mask: &[u8]) {
        self.runs.clear();
        if self.size.width == 0 {
            return;
        }
        let mut above = 0..0;
        for (row, pixels) in mask.chunks_exact(self.size.width).enumerate() {
            let first = self.runs.len();
            let mut at = 0;
            while let Some((start, end)) = next_run(pixels, at) {
                self.runs.push(Run {
                    row: row as u32,
                    start: start as u32,
                    end: end as u32,
                    parent: self.runs.len() as u32,
                    area: 0,
                    place: NOWHERE,
                });
                at = end;
            }
            self.join_rows(above, first);
            above = first..self.runs.len();
        }
    }

    /// Joins the runs from `first` on with the runs `above`: both are in order, so one pass over the two is enough.
    fn join_rows(&mut self, above: core::ops::Range<usize>, first: usize) {
        let (mut upper, mut lower) = (above.start, first);
        while upper < above.end && lower < self.runs.len() {
            let (up, low) = (self.runs[upper], self.runs[lower]);
            // Corners touch, so a gap of no pixel at all still joins.
            if up.start <= low.end && low.start <= up.end {
                join(&mut self.runs, upper as u32, lower as u32);
            }
            if up.end < low.end { upper += 1 } else { lower += 1 }
        }
    }

    /// Sums the areas and gives the largest regions a place. Returns how many had none, and how many were too small.
    fn choose(&mut self) -> (usize, usize) {
        for i in 0..self.runs.len() {
            let root = root(&mut self.runs, i as u32);
            self.runs[root as usize].area += self.runs[i].end - self.runs[i].start;
        }
        let (mut left_out, mut too_small) = (0, 0);
        self.chosen.clear();
        for i in 0..self.runs.len() as u32 {
            let run = self.runs[i as usize];
            if run.parent != i {
                continue;
            }
            if run.area < self.params.area_min {
                too_small += 1;
                continue;
            }
            let runs = &self.runs;
            let place = self.chosen.partition_point(|other| runs[*other as usize].area >= run.area);
            self.chosen.insert(place, i);
            if self.chosen.len() > CAPACITY {
                self.chosen.pop();
                left_out += 1;
            }
        }
        (left_out, too_small)
    }

    /// Sums the moments of the regions that have a place.
    fn measure(&mut self) {
        for (place, root) in self.chosen.iter().enumerate() {
            self.runs[*root as usize].place = place as u32;
            self.sums[place] = Sums::EMPTY;
        }
        for i in 0..self.runs.len() {
            let root = root(&mut self.runs, i as u32);
            if let Some(sums) = self.sums.get_mut(self.runs[root as usize].place as usize) {
                sums.add(self.runs[i]);
            }
        }
        for (blob, sums) in self.blobs.iter_mut().zip(&self.sums[..self.chosen.len()]) {
            *blob = sums.blob();
        }
    }
}

impl Sums {
    const EMPTY: Sums =
        Sums { n: 0, x: 0, y: 0, xx: 0, yy: 0, xy: 0, left: u32::MAX, top: u32::MAX, right: 0, bottom: 0 };

    fn add(&mut self, run: Run) {
        let (row, start, end) = (u64::from(run.row), u64::from(run.start), u64::from(run.end));
        // Σ x and Σ x² below a bound, by the closed forms.
        let below = |end: u64| end * end.saturating_sub(1) / 2;
        let squares_below = |end: u64| end * end.saturating_sub(1) * (2 * end).saturating_sub(1) / 6;
        let (n, x) = (end - start, below(end) - below(start));
        self.n += n;
        self.x += x;
        self.y += n * row;
        self.xx += squares_below(end) - squares_below(start);
        self.yy += n * row * row;
        self.xy += x * row;
        self.left = self.left.min(run.start);
        self.right = self.right.max(run.end - 1);
        self.top = self.top.min(run.row);
        self.bottom = self.bottom.max(run.row);
    }

    fn blob(&self) -> Blob {
        let n = self.n as f64;
        // n Σab − Σa Σb in whole numbers: a difference of two large values must not lose its digits.
        let central = |ab: u64, a: u64, b: u64| {
            let whole = i128::from(self.n) * i128::from(ab) - i128::from(a) * i128::from(b);
            whole as f64 / (n * n)
        };
        Blob {
            area: self.n as u32,
            x: self.x as f64 / n,
            y: self.y as f64 / n,
            left: self.left,
            top: self.top,
            right: self.right,
            bottom: self.bottom,
            xx: central(self.xx, self.x, self.x),
            yy: central(self.yy, self.y, self.y),
            xy: central(self.xy, self.x, self.y),
        }
    }
}

/// The earliest run of the region of run `i`.
fn root(runs: &mut [Run], mut i: u32) -> u32 {
    while runs[i as usize].parent != i {
        // Halving the path on the way keeps the next search short.
        let grandparent = runs[runs[i as usize].parent as usize].parent;
        runs[i as usize].parent = grandparent;
        i = grandparent;
    }
    i
}

/// Makes one region of the regions of two runs.
fn join(runs: &mut [Run], a: u32, b: u32) {
    let (a, b) = (root(runs, a), root(runs, b));
    runs[a.max(b) as usize].parent = a.min(b);
}

/// The first run of set pixels at or behind `from`: its start, and one past its end.
fn next_run(row: &[u8], from: usize) -> Option<(usize, usize)> {
    let start = from + place(&row[from..], |word| word);
    if start >= row.len() {
        return None;
    }
    Some((start, start + place(&row[start..], zeros)))
}

/// The top bit of the lowest byte that is 0, and perhaps of bytes above it, but of none below.
fn zeros(word: u64) -> u64 {
    word.wrapping_sub(0x0101_0101_0101_0101) & !word & 0x8080_8080_8080_8080
}

/// The place of the first byte for which `test` leaves a bit, else the number of bytes. Looks at eight at a time.
#[inline(always)]
fn place(bytes: &[u8], test: impl Fn(u64) -> u64) -> usize {
    let (words, rest) = bytes.as_chunks::<8>();
    for (i, word) in words.iter().enumerate() {
        let found = test(u64::from_le_bytes(*word));
        if found != 0 {
            return 8 * i + found.trailing_zeros() as usize / 8;
        }
    }
    // Only the lowest byte is asked; the others must only not be 0.
    let hit = rest.iter().position(|byte| test(u64::from(*byte) | !0xff) & 0xff != 0);
    8 * words.len() + hit.unwrap_or(rest.len())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn mask_of(rows: &[&str]) -> (Size, Vec<u8>) {
        let mask = rows.iter().flat_map(|row| row.bytes().map(|b| if b == b'#' { 255 } else { 0 })).collect();
        (Size::new(rows[0].len(), rows.len()), mask)
    }

    fn find(size: Size, mask: &[u8]) -> Vec<Blob> {
        let mut finder = BlobFinder::<64>::new(size, BlobParams { area_min: 1 });
        finder.find(mask).unwrap().blobs.to_vec()
    }

    /// Areas, boxes, means and moments by flood fill, pixel by pixel.
    fn flood(size: Size, mask: &[u8]) -> Vec<Blob> {
        let (mut seen, mut blobs) = (vec![false; mask.len()], Vec::new());
        for first in 0..mask.len() {
            if mask[first] == 0 || seen[first] {
                continue;
            }
            let (mut pixels, mut at) = (vec![first], 0);
            seen[first] = true;
            while at < pixels.len() {
                let (x, y) = (pixels[at] % size.width, pixels[at] / size.width);
                for ny in y.saturating_sub(1)..(y + 2).min(size.height) {
                    for nx in x.saturating_sub(1)..(x + 2).min(size.width) {
                        let next = ny * size.width + nx;
                        if mask[next] != 0 && !seen[next] {
                            seen[next] = true;
                            pixels.push(next);
                        }
                    }
                }
                at += 1;
            }
            blobs.push(blob_of(&pixels, size.width));
        }
        blobs.sort_by_key(|b| core::cmp::Reverse(b.area));
        blobs
    }

    fn blob_of(pixels: &[usize], width: usize) -> Blob {
        let n = pixels.len() as f64;
        let at = |p: &usize| ((p % width) as f64, (p / width) as f64);
        let mean = |f: &dyn Fn(f64, f64) -> f64| pixels.iter().map(|p| f(at(p).0, at(p).1)).sum::<f64>() / n;
        let (x, y) = (mean(&|x, _| x), mean(&|_, y| y));
        let columns = || pixels.iter().map(|p| (p % width) as u32);
        let rows = || pixels.iter().map(|p| (p / width) as u32);
        Blob {
            area: pixels.len() as u32,
            x,
            y,
            left: columns().min().unwrap(),
            right: columns().max().unwrap(),
            top: rows().min().unwrap(),
            bottom: rows().max().unwrap(),
            xx: mean(&|px, _| (px - x).powi(2)),
            yy: mean(&|_, py| (py - y).powi(2)),
            xy: mean(&|px, py| (px - x) * (py - y)),
        }
    }

    fn near(a: &Blob, b: &Blob) -> bool {
        let whole = |b: &Blob| (b.area, b.left, b.top, b.right, b.bottom);
        let part = |b: &Blob| [b.x, b.y, b.xx, b.yy, b.xy];
        whole(a) == whole(b) && part(a).iter().zip(part(b)).all(|(a, b)| (a - b).abs() < 1e-9)
    }

    /// Expected: scipy 1.17.1, `ndimage.label(mask, structure=ones((3, 3)))`, `center_of_mass`, `find_objects`, and
    /// numpy's `var` of the coordinates.
    #[test]
    fn a_small_mask_is_cut_as_scipy_cuts_it() {
        let (size, mask) = mask_of(&[
            ".##.......#.",
            ".##......#..",
            "....#...#...",
            "...###......",
            "....#....###",
            "##.......#.#",
            "#........###",
            ".#..........",
            "#....######.",
        ]);
        let blob = |area, x, y, (left, top, right, bottom), xx, yy, xy| Blob {
            area,
            x,
            y,
            left,
            top,
            right,
            bottom,
            xx,
            yy,
            xy,
        };
        let expect = [
            blob(8, 10.0, 5.0, (9, 4, 11, 6), 0.75, 0.75, 0.0),
            blob(6, 7.5, 8.0, (5, 8, 10, 8), 2.9166666666666665, 0.0, 0.0),
            blob(5, 4.0, 3.0, (3, 2, 5, 4), 0.4, 0.4, 0.0),
            blob(5, 0.4, 6.2, (0, 5, 1, 8), 0.24, 1.36, -0.08),
            blob(4, 1.5, 0.5, (1, 0, 2, 1), 0.25, 0.25, 0.0),
            blob(3, 9.0, 1.0, (8, 0, 10, 2), 2.0 / 3.0, 2.0 / 3.0, -2.0 / 3.0),
        ];
        let got = find(size, &mask);
        assert_eq!(got.len(), expect.len());
        for (got, expect) in got.iter().zip(&expect) {
            assert!(near(got, expect), "{got:?}\n{expect:?}");
        }
    }

    #[test]
    fn what_has_no_place_is_counted_and_is_the_smallest() {
        let (size, mask) = mask_of(&["#.##.###.####.##"]);
        let mut finder = BlobFinder::<2>::new(size, BlobParams { area_min: 2 });
        let found = finder.find(&mask).unwrap();
        assert_eq!(found.blobs.iter().map(|b| b.area).collect::<Vec<_>>(), [4, 3]);
        assert_eq!((found.left_out, found.too_small), (2, 1));
    }

    #[test]
    fn the_worst_mask_fits_the_scratch() {
        let size = Size::new(33, 21);
        let mask: Vec<u8> =
            (0..size.pixels()).map(|i| u8::from(i % 33 % 2 == 0 && i / 33 % 2 == 0)).collect();
        let mut finder = BlobFinder::<8>::new(size, BlobParams { area_min: 1 });
        let room = finder.runs.capacity();
        assert_eq!(finder.find(&mask).unwrap().left_out, 17 * 11 - 8);
        let stripes: Vec<u8> = (0..size.pixels()).map(|i| u8::from(i % 33 % 2 == 0)).collect();
        assert_eq!(finder.largest(&stripes).unwrap().map(|b| b.area), Some(21));
        assert_eq!(finder.runs.capacity(), room, "the scratch must not grow");
    }

    #[test]
    fn a_slanting_bar_points_along_itself() {
        let size = Size::new(60, 60);
        let slope = 0.5f64;
        let mask: Vec<u8> = (0..3600)
            .map(|i| {
                let (x, y) = ((i % 60) as f64 - 30.0, (i / 60) as f64 - 30.0);
                u8::from((y - slope * x).abs() < 3.0 && x.abs() < 25.0)
            })
            .collect();
        let bar = BlobFinder::<4>::new(size, BlobParams::default()).largest(&mask).unwrap().unwrap();
        // A parallelogram: x spreads evenly, y is slope·x plus an even spread that does not depend on x.
        let expect = 0.5 * (2.0 * slope * bar.xx).atan2(bar.xx - bar.yy);
        assert!((bar.orientation() - expect).abs() < 1e-6 && (bar.orientation() - slope.atan()).abs() < 0.02);
        let (long, short) = bar.spread();
        assert!((long * long + short * short - bar.xx - bar.yy).abs() < 1e-9 && long > 5.0 * short);
    }

    #[test]
    fn an_empty_mask_and_an_empty_picture_have_no_region() {
        assert_eq!(find(Size::new(8, 4), &[0; 32]), []);
        assert_eq!(find(Size::new(0, 4), &[]), []);
        assert!(BlobFinder::<1>::new(Size::new(2, 2), BlobParams::default()).find(&[0; 5]).is_err());
    }

    proptest! {
        #[test]
        fn regions_are_those_of_a_flood_fill(
            (width, mask) in (1usize..40).prop_flat_map(|width| {
                let pixel = prop_oneof![3 => Just(0u8), 2 => Just(255u8), 1 => Just(1u8)];
                (Just(width), proptest::collection::vec(pixel, width * 12))
            })
        ) {
            let size = Size::new(width, 12);
            let (got, expect) = (find(size, &mask), flood(size, &mask));
            prop_assert_eq!(got.len(), expect.len().min(64));
            for (got, expect) in got.iter().zip(&expect) {
                prop_assert!(near(got, expect), "{:?}\n{:?}", got, expect);
            }
        }
    }
}
