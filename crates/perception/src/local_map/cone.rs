//! Where in a cone there is anything to do: the places on it that may lie in a cell that is not known to be free.
//!
//! A cone is looked at on rings: straight lines across its axis, a cell apart, with a place in each step of a cell. Of most cells it is
//! known already that they are free, and to see that place by place would be most of the work. So the cells are looked at first, in rows:
//! each side of the cone cuts a row, what is left of it is a mask for the bits of its cells, and few cells come through. What is found may
//! be a place too many, but never one too few.

use types::Point;
use types::geometry::whole;

use super::cells::Cells;

/// What is this near to a border counts as both sides of it (cells): far more than rounding can tell apart.
const SLACK: f64 = 1e-3;
/// A cell in whole numbers: in the rows they are cheaper, and 2⁻³² of a cell is far below the slack.
const ONE: i64 = 1 << 32;
/// So many rings there is room for, and for fewer steps than this to each side.
const RINGS: usize = 64;
const STEPS: f64 = 32.0;

/// A cone in the plane, in cells.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cone {
    /// The tip.
    pub(super) origin: Point,
    /// Its direction, of length 1.
    pub(super) axis: Point,
    /// To where it is looked at, along the axis.
    pub(super) length: f64,
    /// How far it is open to each side for each cell along the axis.
    pub(super) slope: f64,
}

/// Places in a cone, a bit for each step on each ring. Steps to the right have the upper bits, as negative numbers do.
pub(super) struct Places([u64; RINGS]);

impl Cone {
    /// The places that may lie in a cell that is not known to be free; none can be told if the cone is not within the window of the cells,
    /// or too large.
    pub(super) fn doubtful(&self, cells: &Cells) -> Option<Places> {
        let (low, high) = self.bounds();
        let (first, last) = (whole(low.x), whole(high.x));
        let is_small = self.length < RINGS as f64 && self.slope * self.length < STEPS - 1.0;
        if !(is_small && cells.takes_in(low, high) && last - first < u64::BITS as i32) {
            return None;
        }
        let rows = whole(low.y)..=whole(high.y);
        // The middle of the first cell of the first row, as it is seen from the tip.
        let corner = Point::new(f64::from(first) + 0.5, f64::from(*rows.start()) + 0.5) - self.origin;
        let mut sides = self.sides().map(|(normal, most)| Side::new(normal, most, corner));
        let (mut along, mut across) = (parts(self.axis.dot(corner)), parts(self.axis.cross(corner)));
        let (x, y) = (parts(self.axis.x), parts(self.axis.y));
        let half = parts(reach(self.axis) + SLACK);
        let mut places = Places([0; RINGS]);
        for iy in rows {
            let (mut from, mut to) = (0, i64::from(last - first) * ONE);
            sides.iter_mut().for_each(|side| side.cut(&mut from, &mut to));
            let mut columns = cells.doubtful_from(iy, first) & between((from + ONE - 1) >> 32, to >> 32);
            while columns != 0 {
                let column = i64::from(columns.trailing_zeros());
                places.insert(along + column * x, across - column * y, half);
                columns &= columns - 1;
            }
            (along, across) = (along + y, across + x);
        }
        Some(places)
    }

    /// The lowest and the highest corner of the rectangle around it.
    fn bounds(&self) -> (Point, Point) {
        let (along, across) = (self.axis * self.length, self.left() * (self.slope * self.length));
        let (a, b, c) = (self.origin, self.origin + along + across, self.origin + along - across);
        let low = Point::new(a.x.min(b.x).min(c.x) - SLACK, a.y.min(b.y).min(c.y) - SLACK);
        (low, Point::new(a.x.max(b.x).max(c.x) + SLACK, a.y.max(b.y).max(c.y) + SLACK))
    }

    fn left(&self) -> Point {
        Point::new(-self.axis.y, self.axis.x)
    }

    /// The sides: outward normals, and how far in their direction the cone goes from its tip.
    fn sides(&self) -> [(Point, f64); 3] {
        let (left, back) = (self.left(), self.axis * self.slope);
        [(left - back, 0.0), (left * -1.0 - back, 0.0), (self.axis, self.length)]
    }
}

impl Places {
    /// The steps on a ring, from right to left.
    pub(super) fn on(&self, ring: usize) -> impl Iterator<Item = i32> + use<> {
        let mut left = self.0.get(ring).map_or(0, |steps| steps.rotate_left(32));
        core::iter::from_fn(move || {
            let step = left.trailing_zeros() as i32 - 32;
            let more = left != 0;
            left &= left.wrapping_sub(1);
            more.then_some(step)
        })
    }

    /// Takes in the places in a cell, which reaches as far as this from its middle.
    #[inline]
    fn insert(&mut self, along: i64, across: i64, half: i64) {
        // A cell is at least one step wide, and less than two; the first ring is half a step off the tip.
        let steps = [(across - half + ONE) >> 32, (across + half) >> 32];
        let rings = [(along - half + ONE / 2) >> 32, (along + half - ONE / 2) >> 32];
        let bits = steps.iter().fold(0, |bits, step| bits | 1 << (step & 63));
        for ring in rings {
            if let Some(places) = self.0.get_mut(ring as usize) {
                *places |= bits;
            }
        }
    }
}

/// Where a side of a cone cuts a row of middles, counted from the first one, in whole numbers; from row to row it moves by a step.
struct Side {
    at: i64,
    step: i64,
    is_left: bool,
}

impl Side {
    fn new(normal: Point, most: f64, corner: Point) -> Side {
        /// A side that is this level is cut by no row: rather the rectangle around the cone ends it.
        const LEVEL: f64 = 1e-6;
        if normal.x.abs() < LEVEL {
            return Side { at: i64::MIN / 2, step: 0, is_left: true };
        }
        let most = most + reach(normal) + SLACK;
        let at = (most - normal.y * corner.y) / normal.x - corner.x;
        Side { at: parts(at), step: parts(-normal.y / normal.x), is_left: normal.x < 0.0 }
    }

    /// Takes away what of a row is beyond the side, and goes on to the next one.
    #[inline]
    fn cut(&mut self, from: &mut i64, to: &mut i64) {
        if self.is_left {
            *from = self.at.max(*from);
        } else {
            *to = self.at.min(*to);
        }
        self.at += self.step;
    }
}

/// How far a cell reaches from its middle in the direction of a normal.
fn reach(normal: Point) -> f64 {
    0.5 * (normal.x.abs() + normal.y.abs())
}

fn parts(cells: f64) -> i64 {
    (cells * ONE as f64) as i64
}

/// The bits of columns from one to another; none if they are the wrong way round.
#[inline]
fn between(from: i64, to: i64) -> u64 {
    if from > to { 0 } else { (u64::MAX << from) & (u64::MAX >> (63 - to)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::local_map::cells::{EVIDENCE, SIDE};
    use proptest::prelude::*;

    /// The cells at the places of a cone.
    fn places(cone: Cone) -> impl Iterator<Item = (usize, i32, (i32, i32))> {
        let rings = (0..64)
            .map(|ring| (ring, f64::from(ring) + 0.5))
            .take_while(move |(_, along)| *along < cone.length);
        rings.flat_map(move |(ring, along)| {
            let steps = (cone.slope * along).floor() as i32;
            (-steps..=steps).map(move |step| {
                let at = cone.origin + cone.axis * along + cone.left() * f64::from(step);
                (ring as usize, step, (whole(at.x), whole(at.y)))
            })
        })
    }

    proptest! {
        #[test]
        fn every_place_in_a_cell_that_is_not_free_is_found_and_none_far_off(
            x in -15f64..15.0, y in -15f64..15.0, heading in -4f64..4.0, length in 0f64..42.0, slope in 0f64..0.6,
            lined: bool, holes in proptest::collection::vec((-64i32..64, -64i32..64), 0..60)
        ) {
            let mut cells = Cells::new();
            cells.follow((0, 0));
            for (ix, iy) in (-SIDE / 2..SIDE / 2).flat_map(|iy| (-SIDE / 2..SIDE / 2).map(move |ix| (ix, iy))) {
                let at = cells.slot_for(ix, iy);
                cells.set(at, if holes.contains(&(ix, iy)) { 0 } else { EVIDENCE.0 });
            }
            // With everything on the lattice the places lie on borders.
            let quarter = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)][(heading.abs() as usize) % 4];
            let (origin, axis) = if lined {
                (Point::new(x.trunc(), y.trunc()), Point::new(quarter.0, quarter.1))
            } else {
                (Point::new(x, y), Point::polar(1.0, heading))
            };
            let cone = Cone { origin, axis, length, slope };
            let found = cone.doubtful(&cells);
            prop_assert!(found.is_some());
            let found: Vec<Vec<i32>> = (0..RINGS).map(|ring| found.iter().flat_map(|places| places.on(ring)).collect()).collect();
            prop_assert!(found.iter().all(|steps| steps.is_sorted()));
            for (ring, step, (ix, iy)) in places(cone) {
                let is_found = found[ring].contains(&step);
                prop_assert!(is_found || !holes.contains(&(ix, iy)), "{ring} {step} of {cone:?}");
                let near = |&(x, y): &(i32, i32)| (x - ix).abs() <= 2 && (y - iy).abs() <= 2;
                prop_assert!(!is_found || holes.iter().any(near), "{ring} {step} of {cone:?}");
            }
        }
    }

    #[test]
    fn of_a_cone_that_leaves_the_window_or_is_too_large_nothing_is_told() {
        let mut cells = Cells::new();
        cells.follow((0, 0));
        let is_told = |x, length, slope| {
            Cone { origin: Point::new(x, 0.0), axis: Point::new(1.0, 0.0), length, slope }
                .doubtful(&cells)
                .is_some()
        };
        assert!(is_told(0.0, 30.0, 0.2) && is_told(-60.0, 60.0, 0.2));
        assert!(!is_told(40.0, 30.0, 0.2) && !is_told(f64::NAN, 30.0, 0.2) && !is_told(-64.5, 30.0, 0.2));
        assert!(!is_told(-60.0, 64.5, 0.2) && !is_told(0.0, 30.0, 1.1));
    }
}
