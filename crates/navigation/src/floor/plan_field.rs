//! Exact distances to what a plan shows.

use libm::{ceil, sqrt};
use types::Point;
use types::geometry::whole;

use super::element::Element;
use super::{Distances, FloorPlan, Nearest};

/// Side of a cell where the floor is not too large for it (m). A cell of 0.1 m beside a wall has one element to look at, or two.
const CELL: f64 = 0.1;
/// So many cells a field has at most, 12 bytes each; on a larger floor the cells are larger. A million are 100 m by 100 m.
const CELLS_MOST: f64 = 1_048_576.0;
/// So far from what stands there a field tells what is nearest (m): farther off nothing that was seen can be meant.
const REACH: f64 = 1.0;
/// So many elements can be the nearest within one cell, the far sides of walls among them. More need a star of corners within a tenth of a metre.
const RIVALS: usize = 6;
/// The two sides of a wall are told apart up to this thickness (m); behind the near side of a thicker one nothing is met.
const THICK: f64 = 0.2;
/// The number that names no element.
const NONE: u16 = u16::MAX;
/// So many elements a plan may have.
const ELEMENTS_MOST: usize = NONE as usize;

/// The plan is too large.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooManyElements {
    /// So many lines and circles it has; 65535 are possible. Leave out what is not needed to tell where one is.
    pub elements: usize,
}

impl core::fmt::Display for TooManyElements {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "the plan has {} lines and circles, {ELEMENTS_MOST} are possible", self.elements)
    }
}

impl core::error::Error for TooManyElements {}

/// How far any point is from what a plan shows: exact, up to one metre off. Where more than six elements meet within one cell, the
/// distance can be too large there, by at most the diagonal of the cell.
///
/// All memory is taken when it is made: 12 bytes for each cell of 0.1 m, at most 12 MB, and 40 bytes for each line.
#[derive(Clone, Debug)]
pub struct PlanField {
    plan: FloorPlan,
    elements: Vec<Element>,
    corner: Point,
    cell: f64,
    width: i32,
    height: i32,
    /// For each cell the elements that can be the nearest, that of its middle first.
    rivals: Vec<[u16; RIVALS]>,
}

impl PlanField {
    /// The field of a plan, which reaches one metre beyond it.
    ///
    /// # Errors
    /// A plan of more than 65535 lines and circles.
    pub fn new(plan: &FloorPlan) -> Result<PlanField, TooManyElements> {
        let elements = plan.elements();
        if elements.len() > ELEMENTS_MOST {
            return Err(TooManyElements { elements: elements.len() });
        }
        let (low, high) = around(&elements);
        let size = high - low;
        let cell = CELL.max(sqrt(size.x * size.y / CELLS_MOST));
        let (width, height) = (ceil(size.x / cell).max(1.0) as i32, ceil(size.y / cell).max(1.0) as i32);
        let rivals = vec![[NONE; RIVALS]; (width * height) as usize];
        let mut field = PlanField { plan: plan.clone(), elements, corner: low, cell, width, height, rivals };
        field.fill();
        Ok(field)
    }

    /// The plan that it was made of.
    pub fn plan(&self) -> &FloorPlan {
        &self.plan
    }

    /// Bytes of memory that it has taken.
    pub fn memory(&self) -> usize {
        size_of_val(&*self.rivals) + size_of_val(&*self.elements)
    }

    /// Looks at squares of cells, the whole first: what cannot be the nearest anywhere in a square cannot be in its quarters.
    fn fill(&mut self) {
        let side = (self.width.max(self.height) as u32).next_power_of_two() as i32;
        let mut stack: Vec<u16> = (0..self.elements.len() as u16).collect();
        let all = stack.len();
        self.fill_square(0, 0, side, 0..all, &mut stack);
    }

    fn fill_square(&mut self, x: i32, y: i32, side: i32, of: core::ops::Range<usize>, stack: &mut Vec<u16>) {
        if x >= self.width || y >= self.height {
            return;
        }
        let half = f64::from(side) * self.cell / 2.0;
        let middle =
            self.corner + Point::new(f64::from(x), f64::from(y)) * self.cell + Point::new(half, half);
        let far = half * core::f64::consts::SQRT_2;
        let distance = |one: u16, elements: &[Element]| elements[usize::from(one)].distance(middle);
        let least =
            stack[of.clone()].iter().map(|one| distance(*one, &self.elements)).fold(f64::INFINITY, f64::min);
        if least > REACH + far {
            return;
        }
        let begin = stack.len();
        for i in of {
            if distance(stack[i], &self.elements) <= least + THICK + 2.0 * far + 1e-9 {
                stack.push(stack[i]);
            }
        }
        if side == 1 {
            let elements = &self.elements;
            stack[begin..].sort_by(|a, b| distance(*a, elements).total_cmp(&distance(*b, elements)));
            let first = stack[begin];
            let near = |one: &&u16| {
                distance(**one, elements) <= least + 2.0 * far + 1e-9
                    || elements[usize::from(**one)].is_opposite(&elements[usize::from(first)])
            };
            let place = &mut self.rivals[(y * self.width + x) as usize];
            place.iter_mut().zip(stack[begin..].iter().filter(near)).for_each(|(place, one)| *place = *one);
        } else {
            let (end, half) = (stack.len(), side / 2);
            for (dx, dy) in [(0, 0), (half, 0), (0, half), (half, half)] {
                self.fill_square(x + dx, y + dy, half, begin..end, stack);
            }
        }
        stack.truncate(begin);
    }

    /// What a beam that ends here can have met, with the square of the distance (m²).
    #[inline]
    fn met_by(&self, at: Point, direction: Point) -> impl Iterator<Item = (f64, &Element)> {
        let rivals = self.rivals(at).into_iter().flatten().take_while(|one| **one != NONE);
        let elements = rivals.map(|one| &self.elements[usize::from(*one)]);
        elements.filter(move |one| one.is_met(at, direction)).map(move |one| (one.square(at), one))
    }

    #[inline]
    fn rivals(&self, at: Point) -> Option<&[u16; RIVALS]> {
        let off = (at - self.corner) * (1.0 / self.cell);
        let (x, y) = (whole(off.x), whole(off.y));
        let inside = (0..self.width).contains(&x) && (0..self.height).contains(&y);
        inside.then(|| &self.rivals[(y * self.width + x) as usize])
    }
}

/// The corners of what a field covers.
fn around(elements: &[Element]) -> (Point, Point) {
    let (low, high) = elements.iter().map(Element::bounds).fold(
        (Point::new(f64::INFINITY, f64::INFINITY), Point::new(f64::NEG_INFINITY, f64::NEG_INFINITY)),
        |(low, high), (a, b)| {
            (Point::new(low.x.min(a.x), low.y.min(a.y)), Point::new(high.x.max(b.x), high.y.max(b.y)))
        },
    );
    if elements.is_empty() {
        return (Point::new(-REACH, -REACH), Point::new(REACH, REACH));
    }
    let room = Point::new(REACH, REACH);
    (low - room, high + room)
}

impl Distances for PlanField {
    #[inline]
    fn nearest(&self, at: Point) -> Option<Nearest> {
        let rivals = self.rivals(at)?;
        let (mut best, mut least) = (NONE, f64::INFINITY);
        for one in rivals.iter().take_while(|one| **one != NONE) {
            let square = self.elements[usize::from(*one)].square(at);
            if square < least {
                (best, least) = (*one, square);
            }
        }
        (least <= REACH * REACH).then(|| self.elements[usize::from(best)].nearest(at))
    }

    #[inline]
    fn square(&self, at: Point) -> Option<f64> {
        let rivals = self.rivals(at)?.iter().take_while(|one| **one != NONE);
        let least =
            rivals.map(|one| self.elements[usize::from(*one)].square(at)).fold(f64::INFINITY, f64::min);
        (least <= REACH * REACH).then_some(least)
    }

    #[inline]
    fn met(&self, at: Point, direction: Point) -> Option<Nearest> {
        let met = self.met_by(at, direction);
        let (least, best) =
            met.fold(
                (f64::INFINITY, None),
                |best, (square, one)| if square < best.0 { (square, Some(one)) } else { best },
            );
        best.filter(|_| least <= REACH * REACH).map(|one| one.nearest(at))
    }

    #[inline]
    fn met_square(&self, at: Point, direction: Point) -> Option<f64> {
        let least = self.met_by(at, direction).map(|(square, _)| square).fold(f64::INFINITY, f64::min);
        (least <= REACH * REACH).then_some(least)
    }

    fn bounds(&self) -> (Point, Point) {
        let room = Point::new(REACH, REACH);
        let size = Point::new(f64::from(self.width), f64::from(self.height)) * self.cell;
        (self.corner + room, self.corner + size - room)
    }

    fn is_free(&self, at: Point, radius: f64) -> bool {
        self.nearest(at).is_none_or(|nearest| nearest.distance >= radius) && !self.plan.is_solid(at)
    }

    /// From cell to cell: what a ray meets in a cell is among what can be the nearest there.
    fn cast(&self, from: Point, direction: Point, most: f64) -> Option<f64> {
        let mut t = 0.0;
        while t <= most {
            let at = from + direction * t;
            let leave = t + self.until_next(at, direction);
            let hits = self.rivals(at).into_iter().flatten().take_while(|one| **one != NONE);
            let hit = hits
                .filter_map(|one| self.elements[usize::from(*one)].cast(from, direction))
                .fold(f64::INFINITY, f64::min);
            if hit <= leave + 1e-9 {
                return (hit <= most).then_some(hit);
            }
            t = leave + 1e-9;
        }
        None
    }
}

impl PlanField {
    /// How far a ray goes until it leaves the cell of a point (m).
    fn until_next(&self, at: Point, direction: Point) -> f64 {
        let off = (at - self.corner) * (1.0 / self.cell);
        let along = |off: f64, direction: f64| {
            let low = f64::from(whole(off));
            let edge = if direction > 0.0 { low + 1.0 } else { low };
            if direction == 0.0 { f64::INFINITY } else { (edge - off) * self.cell / direction }
        };
        along(off.x, direction.x).min(along(off.y, direction.y)).max(0.0)
    }
}
