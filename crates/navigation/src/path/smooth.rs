//! Straight lines instead of steps: a way over a grid has eight directions, a robot has all.

use types::Point;

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

/// The same from one point of the floor to another (m), over cells that are `side` wide. A line along the rim of a cell touches it.
fn is_clear_between(grid: &Grid, from: Point, to: Point, side: f64) -> bool {
    let (from, to) = (in_cells(from, side), in_cells(to, side));
    let along = |x: fn(Point) -> f64| {
        let (x0, x1) = (x(from), x(to));
        let cell = |x: f64| libm::round(x.max(0.0)) as u32;
        cell(x0.min(x1) - 0.5)..=cell(x0.max(x1) + 0.5)
    };
    let columns = along(|at| at.x);
    along(|at| at.y)
        .all(|y| columns.clone().all(|x| !(grid.is_closed(Cell::new(x, y)) && meets(from, to, x, y))))
}

/// Whether a line, in sides of a cell from the middle of the first one, meets a cell: whether what of it lies in the cell's column also lies in its row.
fn meets(from: Point, to: Point, x: u32, y: u32) -> bool {
    let within = |from: f64, to: f64, at: u32| {
        let (low, high) = (f64::from(at) - 0.5 - 1e-9 - from, f64::from(at) + 0.5 + 1e-9 - from);
        match to - from {
            0.0 if low <= 0.0 && high >= 0.0 => (0.0, 1.0),
            0.0 => (1.0, 0.0),
            way => ((low / way).min(high / way), (low / way).max(high / way)),
        }
    };
    let (a, b) = (within(from.x, to.x, x), within(from.y, to.y, y));
    a.0.max(b.0).max(0.0) <= a.1.min(b.1).min(1.0)
}

/// Straightens ways. The memory for the longest is taken when it is made.
#[derive(Clone, Debug)]
pub struct Smoother {
    corners: Vec<Cell>,
    points: Vec<Point>,
}

impl Smoother {
    /// For grids of so many columns and rows.
    pub fn new(width: u32, height: u32) -> Smoother {
        let longest = Size::new(width, height).longest() + 1;
        // Two more for ends that lie beside the middles of their cells.
        Smoother { corners: Vec::with_capacity(longest), points: Vec::with_capacity(longest + 2) }
    }

    /// The cells at which a way turns when it is pulled straight as far as nothing is in between; its ends among them. It is no longer than the way, and goes
    /// over open cells alone if the way does. Without a way there are none.
    pub fn smooth(&mut self, grid: &Grid, way: &[Cell]) -> &[Cell] {
        self.corners.clear();
        for (i, cell) in way.iter().enumerate().take(self.corners.capacity()) {
            match self.corners.last() {
                None => self.corners.push(*cell),
                // What was seen last is where the line bends.
                Some(corner) if !is_clear(grid, *corner, *cell) => self.corners.push(way[i - 1]),
                Some(_) => {}
            }
        }
        if let Some(last) = way.last().filter(|last| self.corners.last() != Some(last)) {
            self.corners.push(*last);
        }
        self.pull(grid);
        &self.corners
    }

    /// The same as points of the floor (m), x along the columns and y along the rows from the first corner of the first cell, each of which is `side` wide: from
    /// `start` to `goal`, which lie in the first and the last cell of the way and not in the middle of them. Where one is not given, that middle is the end. It begins
    /// there, too, where something is between `start` and the first corner; that is by no more than half a cell beside it.
    pub fn lead(
        &mut self,
        grid: &Grid,
        way: &[Cell],
        side: f64,
        start: Option<Point>,
        goal: Option<Point>,
    ) -> &[Point] {
        self.smooth(grid, way);
        self.points.clear();
        let points = self.corners.iter().map(|cell| middle(*cell, side));
        self.points.extend(points);
        let sees = |from: Point, to: Point| is_clear_between(grid, from, to, side);
        match (&mut self.points[..], start) {
            ([first, next, ..], Some(start)) if sees(start, *next) => *first = start,
            ([only], Some(start)) => {
                // In one cell all is free: straight from one to the other.
                let only = core::mem::replace(only, start);
                self.points.extend(goal.is_none().then_some(only));
            }
            _ => {}
        }
        if let (Some(goal), false) = (goal, self.points.is_empty()) {
            let is_seen = matches!(self.points[..], [.., before, _] if sees(before, goal));
            if is_seen {
                self.points.pop();
            }
            self.points.push(goal);
        }
        &self.points
    }

    /// Leaves out the corners between two that see each other.
    fn pull(&mut self, grid: &Grid) {
        let mut kept = 1;
        for i in 1..self.corners.len() {
            let is_last = i + 1 == self.corners.len();
            if is_last || !is_clear(grid, self.corners[kept - 1], self.corners[i + 1]) {
                self.corners[kept] = self.corners[i];
                kept += 1;
            }
        }
        self.corners.truncate(kept.min(self.corners.len()));
    }
}

/// The length of the straight lines between cells (sides of a cell).
pub fn length(corners: &[Cell]) -> f64 {
    let far = |two: &[Cell]| {
        libm::hypot(f64::from(two[0].x.abs_diff(two[1].x)), f64::from(two[0].y.abs_diff(two[1].y)))
    };
    corners.windows(2).map(far).sum()
}

/// The middle of a cell (m).
pub(super) fn middle(cell: Cell, side: f64) -> Point {
    Point::new((f64::from(cell.x) + 0.5) * side, (f64::from(cell.y) + 0.5) * side)
}

/// A point of the floor in sides of a cell, from the middle of the first one.
fn in_cells(at: Point, side: f64) -> Point {
    Point::new(at.x / side - 0.5, at.y / side - 0.5)
}

/// Whether all cells that a triangle touches are open, of cells that are `side` wide (m). A cell counts where its middle is nearer to the triangle than
/// its corners are: then more of them count than must.
pub(super) fn is_open(grid: &Grid, corners: [Point; 3], side: f64) -> bool {
    let corners = corners.map(|at| in_cells(at, side));
    let least = |of: fn(&Point) -> f64| corners.iter().map(of).fold(f64::INFINITY, f64::min);
    let most = |of: fn(&Point) -> f64| corners.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
    let whole = |x: f64| libm::floor(x.max(0.0)) as u32;
    let (columns, rows) = (
        whole(least(|p| p.x) - 1.0)..=whole(most(|p| p.x) + 2.0),
        whole(least(|p| p.y) - 1.0)..=whole(most(|p| p.y) + 2.0),
    );
    rows.into_iter().all(|y| {
        columns.clone().all(|x| {
            let at = Point::new(f64::from(x), f64::from(y));
            !grid.is_closed(Cell::new(x, y)) || distance(at, corners) > core::f64::consts::FRAC_1_SQRT_2
        })
    })
}

/// How far a point is from a triangle; nothing inside.
fn distance(at: Point, [a, b, c]: [Point; 3]) -> f64 {
    let sides = [(a, b), (b, c), (c, a)];
    let left = sides.map(|(p, q)| (q - p).cross(at - p) >= 0.0);
    if left == [true; 3] || left == [false; 3] {
        return 0.0;
    }
    let to_line = |(p, q): (Point, Point)| {
        let (along, square) = ((at - p).dot(q - p), (q - p).dot(q - p));
        let share = if square > 0.0 { (along / square).clamp(0.0, 1.0) } else { 0.0 };
        at.distance(Point::new(p.x + (q.x - p.x) * share, p.y + (q.y - p.y) * share))
    };
    sides.map(to_line).into_iter().fold(f64::INFINITY, f64::min)
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

    #[test]
    fn within_one_cell_it_is_straight_and_without_a_place_the_middle_is_meant() {
        let grid = Grid::new(4, 4);
        let mut smoother = Smoother::new(4, 4);
        let (from, to, only) = (Point::new(0.11, 0.12), Point::new(0.18, 0.17), [Cell::new(1, 1)]);
        let mut lead = |start, goal| smoother.lead(&grid, &only, 0.1, start, goal).to_vec();
        assert_eq!(lead(Some(from), Some(to)), [from, to]);
        assert_eq!(lead(Some(from), None), [from, middle(only[0], 0.1)]);
        assert_eq!(lead(None, Some(to)), [middle(only[0], 0.1), to]);
        assert_eq!(lead(None, None), [middle(only[0], 0.1)]);
        assert_eq!(smoother.lead(&grid, &[], 0.1, Some(from), Some(to)), []);
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

        #[test]
        fn a_way_leads_to_the_very_place_over_open_cells_alone(
            (grid, start, goal) in floors(), side in 0.05..0.5f64, off in proptest::array::uniform4(-0.49..0.49f64),
        ) {
            let mut jump = Jump::new(grid.width(), grid.height());
            let Ok(path) = jump.plan(&grid, start, goal) else { return Ok(()) };
            let mut smoother = Smoother::new(grid.width(), grid.height());
            let beside = |cell, dx: f64, dy: f64| middle(cell, side) + Point::new(dx, dy) * side;
            let (from, to) = (beside(start, off[0], off[1]), beside(goal, off[2], off[3]));
            let points = smoother.lead(&grid, path.cells(), side, Some(from), Some(to));
            prop_assert!(points[0] == from || points[0] == middle(start, side), "{:?}", points);
            prop_assert_eq!(points.last(), Some(&to));
            for two in points.windows(2) {
                for i in 0..=200 {
                    let at = two[0] + (two[1] - two[0]) * (f64::from(i) / 200.0);
                    let cell = |at: f64| libm::floor(at / side) as u32;
                    prop_assert!(!grid.is_closed(Cell::new(cell(at.x), cell(at.y))), "{:?} at {:?}", two, at);
                }
            }
        }
    }
}
