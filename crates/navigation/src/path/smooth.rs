//! Straight lines instead of steps: a way over a grid has eight directions, a robot has all.

use super::grid::{Cell, Grid};
use super::planner::Size;

/// Whether a body that fits into every open cell can go straight from the middle of one cell to that of another: all cells that the line goes through are
/// open, and where it goes through the corner of four, so are those beside it.
pub fn is_clear(grid: &Grid, from: Cell, to: Cell) -> bool {
    let (dx, dy) = (i64::from(from.x.abs_diff(to.x)), i64::from(from.y.abs_diff(to.y)));
    let toward = |at: u32, to: u32| if at < to { at + 1 } else { at - u32::from(at > to) };
    let (mut at, mut columns, mut rows) = (from, 0, 0);
    while columns < dx || rows < dy {
        if grid.is_closed(at) {
            return false;
        }
        // Which rim of the cell the line meets first: that to the next column lies at (½ + columns) / dx of it, that to the next row at (½ + rows) / dy.
        let first = ((1 + 2 * columns) * dy).cmp(&((1 + 2 * rows) * dx));
        let (x, y) = (toward(at.x, to.x), toward(at.y, to.y));
        if first.is_eq() && (grid.is_closed(Cell::new(x, at.y)) || grid.is_closed(Cell::new(at.x, y))) {
            return false;
        }
        if first.is_le() {
            (at.x, columns) = (x, columns + 1);
        }
        if first.is_ge() {
            (at.y, rows) = (y, rows + 1);
        }
    }
    !grid.is_closed(at)
}

/// Straightens ways. The memory for the longest is taken when it is made.
#[derive(Clone, Debug)]
pub struct Smoother(Vec<Cell>);

impl Smoother {
    /// For grids of so many columns and rows.
    pub fn new(width: u32, height: u32) -> Smoother {
        Smoother(Vec::with_capacity(Size::new(width, height).longest() + 1))
    }

    /// The cells at which a way turns when it is pulled straight as far as nothing is in between; its ends among them. It is no longer than the way, and goes
    /// over open cells alone if the way does. Without a way there are none.
    pub fn smooth(&mut self, grid: &Grid, way: &[Cell]) -> &[Cell] {
        self.0.clear();
        for (i, cell) in way.iter().enumerate().take(self.0.capacity()) {
            match self.0.last() {
                None => self.0.push(*cell),
                // What was seen last is where the line bends.
                Some(corner) if !is_clear(grid, *corner, *cell) => self.0.push(way[i - 1]),
                Some(_) => {}
            }
        }
        if let Some(last) = way.last().filter(|last| self.0.last() != Some(last)) {
            self.0.push(*last);
        }
        self.pull(grid);
        &self.0
    }

    /// Leaves out the corners between two that see each other.
    fn pull(&mut self, grid: &Grid) {
        let mut kept = 1;
        for i in 1..self.0.len() {
            let is_last = i + 1 == self.0.len();
            if is_last || !is_clear(grid, self.0[kept - 1], self.0[i + 1]) {
                self.0[kept] = self.0[i];
                kept += 1;
            }
        }
        self.0.truncate(kept.min(self.0.len()));
    }
}

/// The length of the straight lines between cells (sides of a cell).
pub fn length(corners: &[Cell]) -> f64 {
    let far = |two: &[Cell]| {
        libm::hypot(f64::from(two[0].x.abs_diff(two[1].x)), f64::from(two[0].y.abs_diff(two[1].y)))
    };
    corners.windows(2).map(far).sum()
}

#[cfg(test)]
mod tests {
    use super::super::tests::floors;
    use super::super::{Jump, Planner};
    use super::*;
    use proptest::prelude::*;

    /// The cells of a drawing that are closed are marked.
    fn drawn(rows: &[&str]) -> Grid {
        let mut grid = Grid::new(rows[0].len() as u32, rows.len() as u32);
        for (y, row) in rows.iter().enumerate() {
            row.bytes()
                .enumerate()
                .for_each(|(x, byte)| grid.set(Cell::new(x as u32, y as u32), byte == b'#'));
        }
        grid.inflate(0.0);
        grid
    }

    #[test]
    fn a_line_meets_what_it_goes_through_and_no_corner_is_cut() {
        let grid = drawn(&["....", "..#.", "....", "...."]);
        let check = |a: (u32, u32), b: (u32, u32), expect: bool| {
            let (a, b) = (Cell::new(a.0, a.1), Cell::new(b.0, b.1));
            assert_eq!((is_clear(&grid, a, b), is_clear(&grid, b, a)), (expect, expect), "{a:?} {b:?}");
        };
        check((0, 0), (3, 3), false);
        // Through the corner of the closed cell, and past it.
        check((1, 0), (3, 2), false);
        check((0, 1), (2, 3), true);
        check((1, 1), (2, 2), false);
        check((0, 0), (3, 0), true);
        check((0, 2), (3, 3), true);
        // It leaves the second row where the closed cell begins, through it or along its corner.
        check((0, 0), (3, 1), false);
        check((0, 1), (3, 0), false);
        check((0, 1), (3, 2), false);
        check((2, 1), (2, 1), false);
        check((3, 0), (3, 9), false);
    }

    #[test]
    fn around_one_thing_a_way_bends_once() {
        let grid = drawn(&[".......", ".......", "...#...", ".......", "......."]);
        let mut smoother = Smoother::new(7, 5);
        let mut jump = Jump::new(7, 5);
        let way = jump.plan(&grid, Cell::new(0, 2), Cell::new(6, 2)).unwrap().cells();
        let corners = smoother.smooth(&grid, way);
        assert!(corners.len() <= 4, "{corners:?}");
        assert!(length(corners) < 7.0, "{corners:?}");
        assert_eq!(smoother.smooth(&grid, &[]), []);
        assert_eq!(smoother.smooth(&grid, &[Cell::new(1, 1)]), [Cell::new(1, 1)]);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(80))]

        #[test]
        fn a_smoothed_way_is_no_longer_and_goes_over_open_cells_alone((grid, start, goal) in floors()) {
            let mut jump = Jump::new(grid.width(), grid.height());
            let Ok(path) = jump.plan(&grid, start, goal) else { return Ok(()) };
            let mut smoother = Smoother::new(grid.width(), grid.height());
            let corners = smoother.smooth(&grid, path.cells());
            prop_assert_eq!((corners.first(), corners.last()), (Some(&start), Some(&goal)));
            prop_assert!(length(corners) <= path.length() + 1e-9);
            for two in corners.windows(2) {
                prop_assert!(is_clear(&grid, two[0], two[1]));
                // By points that stand close: 200 on each line, each in an open cell.
                for i in 0..=200 {
                    let between = |a: u32, b: u32| f64::from(a) + (f64::from(b) - f64::from(a)) * f64::from(i) / 200.0;
                    let at = |x: f64| libm::round(x) as u32;
                    let (x, y) = (between(two[0].x, two[1].x), between(two[0].y, two[1].y));
                    prop_assert!(!grid.is_closed(Cell::new(at(x), at(y))), "{:?} at {} {}", two, x, y);
                }
            }
        }
    }
}
