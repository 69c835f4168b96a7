//! Where something stands on the floor, and where the middle of a body may be: a bit for each cell.

use core::ops::RangeInclusive;

use super::bits::{self, Bits};

/// A cell by its column and row, the first of each is 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Cell {
    /// Its column.
    pub x: u32,
    /// Its row.
    pub y: u32,
}

impl Cell {
    /// The cell in a column and a row.
    pub const fn new(x: u32, y: u32) -> Cell {
        Cell { x, y }
    }
}

/// The most columns and rows that a grid can have.
pub const LARGEST: u32 = 4096;

/// A floor of cells, some of which are taken. The memory for all of it is taken when it is made, three bits a cell.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grid {
    width: u32,
    height: u32,
    taken: Bits,
    closed: Bits,
    /// The same with columns for rows: a search along a column is one along a row.
    columns: Bits,
    /// Rows while they grow wider.
    wide: Box<[u64]>,
}

impl Grid {
    /// A free floor of so many columns and rows, each at least 1 and at most [`LARGEST`].
    pub fn new(width: u32, height: u32) -> Grid {
        let (width, height) = (width.clamp(1, LARGEST), height.clamp(1, LARGEST));
        let bits = Bits::new(width + 2, height + 2);
        let wide = vec![0; bits.stride()].into_boxed_slice();
        let columns = Bits::new(height + 2, width + 2);
        let mut grid = Grid { width, height, taken: bits.clone(), closed: bits, columns, wide };
        grid.close_rim();
        grid
    }

    /// Columns.
    pub const fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    pub const fn height(&self) -> u32 {
        self.height
    }

    /// Frees the whole floor.
    pub fn clear(&mut self) {
        self.taken.fill(0);
        self.closed.fill(0);
        self.close_rim();
    }

    /// Says whether something stands in a cell; one outside is passed over. What that closes is known after [`inflate`](Self::inflate).
    pub fn set(&mut self, cell: Cell, taken: bool) {
        if self.is_inside(cell) {
            self.taken.set(cell.x + 1, cell.y + 1, taken);
        }
    }

    /// Whether something stands in a cell; outside something does everywhere.
    pub fn is_taken(&self, cell: Cell) -> bool {
        !self.is_inside(cell) || self.taken.get(cell.x + 1, cell.y + 1)
    }

    /// Whether the middle of the body cannot be in a cell, as of the last [`inflate`](Self::inflate).
    pub fn is_closed(&self, cell: Cell) -> bool {
        !self.is_inside(cell) || self.closed.get(cell.x + 1, cell.y + 1)
    }

    /// Closes the cells whose middle is within `radius` (sides of a cell) of the middle of a taken one, and opens all others. The rim of
    /// the floor closes nothing.
    pub fn inflate(&mut self, radius: f64) {
        self.closed.copy_from(&self.taken);
        let square = radius.max(0.0) * radius.max(0.0);
        let reach = libm::floor(radius.clamp(0.0, f64::from(LARGEST))) as u32;
        for y in 1..=self.height {
            if reach == 0 || bits::is_empty(self.taken.row(y)) {
                continue;
            }
            self.wide.copy_from_slice(self.taken.row(y));
            let mut width = 0;
            // From the ends of the disc to its middle it grows wider.
            for dy in (0..=reach).rev() {
                let off = f64::from(dy) * f64::from(dy);
                let wide = libm::floor(libm::sqrt((square - off).max(0.0)) + 1e-9) as u32;
                bits::widen(&mut self.wide, wide - width);
                width = wide;
                let below = y.checked_sub(dy).filter(|below| *below > 0);
                for y in below.into_iter().chain([y + dy]).filter(|y| *y <= self.height) {
                    bits::unite(self.closed.row_mut(y), &self.wide);
                }
            }
        }
        self.close_rim();
    }

    /// The open cell that is nearest to a cell, at most `reach` columns and rows away.
    pub fn nearest_open(&self, cell: Cell, reach: u32) -> Option<Cell> {
        let around = |at: u32, size: u32| -> RangeInclusive<u32> {
            at.saturating_sub(reach)..=at.saturating_add(reach).min(size - 1)
        };
        let far = |other: &Cell| {
            let (dx, dy) = (u64::from(cell.x.abs_diff(other.x)), u64::from(cell.y.abs_diff(other.y)));
            dx * dx + dy * dy
        };
        around(cell.y, self.height)
            .flat_map(|y| around(cell.x, self.width).map(move |x| Cell::new(x, y)))
            .filter(|other| !self.is_closed(*other))
            .min_by_key(far)
    }

    /// The cells that are closed, within a rim of closed ones: a cell is found one column and one row on.
    pub(super) fn closed(&self) -> &Bits {
        &self.closed
    }

    /// The same cells, where each column is a row.
    pub(super) fn columns(&self) -> &Bits {
        &self.columns
    }

    fn is_inside(&self, cell: Cell) -> bool {
        cell.x < self.width && cell.y < self.height
    }

    /// Closes what is around the floor, so that no search has to ask where it ends, and turns it.
    fn close_rim(&mut self) {
        for y in [0, self.height + 1] {
            self.closed.row_mut(y).fill(u64::MAX);
        }
        for y in 1..=self.height {
            self.closed.set(0, y, true);
            bits::fill_from(self.closed.row_mut(y), self.width + 1);
        }
        self.columns.transpose(&self.closed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn all(grid: &Grid) -> impl Iterator<Item = Cell> + use<> {
        let (width, height) = (grid.width, grid.height);
        (0..height).flat_map(move |y| (0..width).map(move |x| Cell::new(x, y)))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn closed_is_what_is_within_the_radius_of_something(
            width in 1u32..140, height in 1u32..24, radius in 0.0..9.0f64,
            taken in proptest::collection::vec((0u32..140, 0u32..24), 0..8),
        ) {
            let mut grid = Grid::new(width, height);
            taken.iter().for_each(|(x, y)| grid.set(Cell::new(*x, *y), true));
            grid.inflate(radius);
            let far = |a: Cell, b: Cell| f64::from(a.x.abs_diff(b.x)).hypot(f64::from(a.y.abs_diff(b.y)));
            let standing: Vec<Cell> = all(&grid).filter(|cell| grid.is_taken(*cell)).collect();
            for cell in all(&grid) {
                let near = standing.iter().any(|other| far(cell, *other) <= radius);
                prop_assert_eq!(grid.is_closed(cell), near, "{:?}", cell);
            }
            let from = Cell::new(width / 2, height / 2);
            let nearest = all(&grid)
                .filter(|cell| !grid.is_closed(*cell))
                .min_by(|a, b| far(*a, from).total_cmp(&far(*b, from)));
            let found = grid.nearest_open(from, 140);
            prop_assert_eq!(found.map(|cell| far(cell, from)), nearest.map(|cell| far(cell, from)));
        }
    }

    #[test]
    fn outside_everything_is_taken() {
        let mut grid = Grid::new(3, 2);
        grid.set(Cell::new(3, 0), true);
        grid.inflate(5.0);
        assert!(all(&grid).all(|cell| !grid.is_closed(cell)), "what is outside closes nothing");
        assert!(grid.is_closed(Cell::new(3, 1)) && grid.is_taken(Cell::new(0, 2)));
        assert!(grid.is_closed(Cell::new(u32::MAX, 0)) && grid.is_taken(Cell::new(0, u32::MAX)));
        assert_eq!(grid.nearest_open(Cell::new(9, 9), 1), None);
        grid.clear();
        assert!(grid.is_closed(Cell::new(3, 1)) && !grid.is_closed(Cell::new(2, 1)));
    }
}
