//! Square cells over a part of the floor, and the cells that a beam goes through.
//!
//! The next cell is the one beyond the nearer of the next upright and the next level line. (Amanatides and Woo, "A fast voxel traversal
//! algorithm for ray tracing", 1987.)

use libm::{fabs, floor};
use types::geometry::Point;

/// Cells to a side at most.
pub const MOST: u32 = 4096;

/// Square cells: row by row from the corner, along x first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    corner: Point,
    side: f64,
    columns: u32,
    rows: u32,
}

impl Lattice {
    /// Cells of a side (m) from the corner with the least x and y on. Columns and rows are held within 1 and [`MOST`], the side within a
    /// millimetre and a kilometre.
    pub fn new(corner: Point, side: f64, columns: u32, rows: u32) -> Lattice {
        let side = if side.is_finite() { side.clamp(1e-3, 1e3) } else { 1.0 };
        Lattice { corner, side, columns: columns.clamp(1, MOST), rows: rows.clamp(1, MOST) }
    }

    /// As many cells of a side (m) as cover what lies between two corners.
    pub fn covering(low: Point, high: Point, side: f64) -> Lattice {
        let count = |length: f64| libm::ceil(length / side).clamp(1.0, f64::from(MOST)) as u32;
        Lattice::new(low, side, count(high.x - low.x), count(high.y - low.y))
    }

    /// How many there are.
    pub const fn cells(&self) -> usize {
        self.columns as usize * self.rows as usize
    }

    /// Columns.
    pub const fn columns(&self) -> u32 {
        self.columns
    }

    /// Rows.
    pub const fn rows(&self) -> u32 {
        self.rows
    }

    /// The side of a cell (m).
    pub const fn side(&self) -> f64 {
        self.side
    }

    /// The corner with the least x and y.
    pub const fn corner(&self) -> Point {
        self.corner
    }

    /// The cell in which a point lies; nothing outside.
    pub fn cell(&self, point: Point) -> Option<usize> {
        let (x, y) =
            (floor((point.x - self.corner.x) / self.side), floor((point.y - self.corner.y) / self.side));
        self.inside(x, y)
    }

    /// The middle of a cell.
    pub fn middle(&self, cell: usize) -> Point {
        let (x, y) = (cell % self.columns as usize, cell / self.columns as usize);
        Point::new(self.corner.x + (x as f64 + 0.5) * self.side, self.corner.y + (y as f64 + 0.5) * self.side)
    }

    fn inside(&self, x: f64, y: f64) -> Option<usize> {
        let is_in = (0.0..f64::from(self.columns)).contains(&x) && (0.0..f64::from(self.rows)).contains(&y);
        is_in.then(|| y as usize * self.columns as usize + x as usize)
    }
}

/// The cells from one point to another, without the one in which the other lies. It begins where the beam enters the lattice, and ends
/// where it leaves it.
#[derive(Clone, Debug)]
pub struct Ray {
    lattice: Lattice,
    /// Column and row, as numbers.
    at: [f64; 2],
    step: [f64; 2],
    /// Which part of the beam is over at the next line, and what lies between two lines.
    next: [f64; 2],
    every: [f64; 2],
    last: [f64; 2],
    left: u32,
}

impl Ray {
    /// From a point to another.
    pub fn new(lattice: &Lattice, from: Point, to: Point) -> Ray {
        let place =
            |p: Point| [(p.x - lattice.corner.x) / lattice.side, (p.y - lattice.corner.y) / lattice.side];
        let (begin, end) = (place(from), place(to));
        let way = [end[0] - begin[0], end[1] - begin[1]];
        let most = [f64::from(lattice.columns), f64::from(lattice.rows)];
        let mut ray = Ray {
            lattice: *lattice,
            at: [0.0; 2],
            step: [0.0; 2],
            next: [f64::INFINITY; 2],
            every: [f64::INFINITY; 2],
            last: [floor(end[0]), floor(end[1])],
            left: 0,
        };
        let Some(enters) = enters(begin, way, most) else { return ray };
        for axis in 0..2 {
            let place = begin[axis] + enters * way[axis];
            // Where it enters rounding may put it a hair outside.
            let inside = floor(place).clamp(0.0, most[axis] - 1.0);
            ray.at[axis] = if enters > 0.0 { inside } else { floor(place) };
            if way[axis] != 0.0 {
                ray.step[axis] = if way[axis] > 0.0 { 1.0 } else { -1.0 };
                ray.every[axis] = fabs(1.0 / way[axis]);
                let line = if way[axis] > 0.0 { ray.at[axis] + 1.0 } else { ray.at[axis] };
                ray.next[axis] = (line - begin[axis]) / way[axis];
            }
        }
        // A beam never needs more than one step for each line that it crosses.
        ray.left = lattice.columns + lattice.rows + 2;
        ray
    }
}

/// Which part of the beam lies before the lattice; nothing when it misses it or is no beam.
fn enters(begin: [f64; 2], way: [f64; 2], most: [f64; 2]) -> Option<f64> {
    let (mut enters, mut leaves) = (0.0f64, 1.0f64);
    for axis in 0..2 {
        if !(begin[axis].is_finite() && way[axis].is_finite()) {
            return None;
        }
        if way[axis] == 0.0 {
            if !(0.0..most[axis]).contains(&begin[axis]) {
                return None;
            }
            continue;
        }
        let (a, b) = (-begin[axis] / way[axis], (most[axis] - begin[axis]) / way[axis]);
        enters = enters.max(a.min(b));
        leaves = leaves.min(a.max(b));
    }
    (enters <= leaves).then_some(enters)
}

impl Iterator for Ray {
    type Item = usize;

    fn next(&mut self) -> Option<usize> {
        if self.left == 0 || self.at == self.last {
            return None;
        }
        self.left -= 1;
        let Some(cell) = self.lattice.inside(self.at[0], self.at[1]) else {
            self.left = 0;
            return None;
        };
        let axis = usize::from(self.next[1] < self.next[0]);
        if self.next[axis] > 1.0 {
            // What is left of the beam ends in this cell; rounding put its end elsewhere.
            self.left = 0;
        }
        self.at[axis] += self.step[axis];
        self.next[axis] += self.every[axis];
        Some(cell)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn cells(from: Point, to: Point) -> Vec<(usize, usize)> {
        let lattice = Lattice::new(Point::new(-1.0, -1.0), 0.5, 8, 6);
        Ray::new(&lattice, from, to).map(|cell| (cell % 8, cell / 8)).collect()
    }

    #[test]
    fn a_beam_goes_through_neighbours_and_not_into_the_cell_of_its_end() {
        assert_eq!(cells(Point::new(-0.75, -0.75), Point::new(0.8, -0.6)), [(0, 0), (1, 0), (2, 0)]);
        assert_eq!(cells(Point::new(-0.75, -0.75), Point::new(-0.1, 0.1)), [(0, 0), (0, 1), (1, 1)]);
        assert_eq!(cells(Point::new(0.8, 0.3), Point::new(0.8, -0.9)), [(3, 2), (3, 1)]);
        assert_eq!(cells(Point::new(0.1, 0.1), Point::new(0.2, 0.2)), []);
    }

    #[test]
    fn what_begins_or_ends_outside_is_seen_where_it_is_inside() {
        assert_eq!(cells(Point::new(-3.0, -0.75), Point::new(-0.2, -0.75)), [(0, 0)]);
        assert_eq!(cells(Point::new(2.3, 1.6), Point::new(9.0, 1.6)), [(6, 5), (7, 5)]);
        assert_eq!(cells(Point::new(-3.0, 5.0), Point::new(9.0, 5.0)), []);
        assert_eq!(cells(Point::new(f64::NAN, 0.0), Point::new(1.0, 1.0)), []);
    }

    proptest! {
        #[test]
        fn a_beam_is_what_its_points_say(x in -3.0..5.0f64, y in -3.0..4.0f64, u in -3.0..5.0f64, v in -3.0..4.0f64) {
            let lattice = Lattice::new(Point::new(-1.0, -1.0), 0.25, 16, 12);
            let (from, to) = (Point::new(x, y), Point::new(u, v));
            let ray: Vec<usize> = Ray::new(&lattice, from, to).collect();
            // No cell twice, and each a neighbour of the one before.
            for pair in ray.windows(2) {
                let apart = pair[0].abs_diff(pair[1]);
                prop_assert!(apart == 1 || apart == 16, "{ray:?}");
            }
            // All that many points on the beam find, but for those that lie on a line.
            for i in 0..2000 {
                let point = from + (to - from) * (f64::from(i) / 2000.0);
                if let Some(cell) = lattice.cell(point).filter(|cell| lattice.cell(to) != Some(*cell)) {
                    let middle = lattice.middle(cell);
                    let rim = 0.125 - fabs(point.x - middle.x).max(fabs(point.y - middle.y));
                    prop_assert!(ray.contains(&cell) || rim < 1e-9, "{point:?} {ray:?}");
                }
            }
            // And none that the beam does not touch.
            for cell in &ray {
                let (middle, way) = (lattice.middle(*cell), to - from);
                let aside = fabs(way.cross(middle - from)) / way.norm();
                prop_assert!(aside <= 0.25 * core::f64::consts::FRAC_1_SQRT_2 + 1e-9);
            }
        }
    }
}
