//! Where something stands on the floor, and where the middle of a body may be.

use core::ops::RangeInclusive;

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

    /// The length of the shortest octile way to another over free floor (sides of a cell): diagonal as far as it goes, then straight.
    pub fn octile(self, other: Cell) -> f64 {
        let (dx, dy) = (self.x.abs_diff(other.x), self.y.abs_diff(other.y));
        super::length(dx.max(dy) - dx.min(dy), dx.min(dy))
    }
}

/// A floor of cells, some of which are taken. The memory for all of it is taken when it is made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grid {
    width: u32,
    height: u32,
    taken: Box<[bool]>,
    closed: Box<[bool]>,
}

impl Grid {
    /// A free floor of so many columns and rows, each at least 1 and at most 4096.
    pub fn new(width: u32, height: u32) -> Grid {
        let (width, height) = (width.clamp(1, 4096), height.clamp(1, 4096));
        let cells = || vec![false; (width * height) as usize].into_boxed_slice();
        Grid { width, height, taken: cells(), closed: cells() }
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
        self.taken.fill(false);
        self.closed.fill(false);
    }

    /// Says whether something stands in a cell; one outside is passed over. What that closes is known after [`inflate`](Self::inflate).
    pub fn set(&mut self, cell: Cell, taken: bool) {
        if let Some(place) = self.place(cell) {
            self.taken[place] = taken;
        }
    }

    /// Whether something stands in a cell; outside something does everywhere.
    pub fn is_taken(&self, cell: Cell) -> bool {
        self.place(cell).is_none_or(|place| self.taken[place])
    }

    /// Whether the middle of the body cannot be in a cell, as of the last [`inflate`](Self::inflate).
    pub fn is_closed(&self, cell: Cell) -> bool {
        self.place(cell).is_none_or(|place| self.closed[place])
    }

    /// Closes the cells whose middle is within `radius` (sides of a cell) of the middle of a taken one, and opens all others. The rim of
    /// the floor closes nothing.
    pub fn inflate(&mut self, radius: f64) {
        self.closed.copy_from_slice(&self.taken);
        let square = radius.max(0.0) * radius.max(0.0);
        let reach = libm::floor(radius.clamp(0.0, 4096.0)) as u32;
        for dy in 0..=reach {
            // The disc is as wide as this in the rows that are so far off.
            let off = f64::from(dy) * f64::from(dy);
            let wide = libm::floor(libm::sqrt((square - off).max(0.0)) + 1e-9) as u32;
            self.spread(dy, wide);
        }
    }

    /// Closes what is `dy` rows off a taken cell, up to `wide` columns aside.
    fn spread(&mut self, dy: u32, wide: u32) {
        let width = self.width as usize;
        for (row, taken) in self.taken.chunks_exact(width).enumerate() {
            for (x, _) in taken.iter().enumerate().filter(|(_, taken)| **taken) {
                let from = x.saturating_sub(wide as usize);
                let to = (x + wide as usize + 1).min(width);
                let (above, below) = (row.checked_sub(dy as usize), row + dy as usize);
                for y in above.into_iter().chain([below]).filter(|y| *y < self.height as usize) {
                    self.closed[y * width + from..y * width + to].fill(true);
                }
            }
        }
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

    /// The rows of the cells that are closed.
    pub(super) fn closed(&self) -> &[bool] {
        &self.closed
    }

    fn place(&self, cell: Cell) -> Option<usize> {
        (cell.x < self.width && cell.y < self.height).then(|| (cell.y * self.width + cell.x) as usize)
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
            width in 1u32..24, height in 1u32..24, radius in 0.0..5.0f64,
            taken in proptest::collection::vec((0u32..24, 0u32..24), 0..8),
        ) {
            let mut grid = Grid::new(width, height);
            taken.iter().for_each(|(x, y)| grid.set(Cell::new(*x, *y), true));
            grid.inflate(radius);
            let far = |a: Cell, b: Cell| f64::from(a.x.abs_diff(b.x)).hypot(f64::from(a.y.abs_diff(b.y)));
            for cell in all(&grid) {
                let near = all(&grid).any(|other| grid.is_taken(other) && far(cell, other) <= radius);
                prop_assert_eq!(grid.is_closed(cell), near, "{:?}", cell);
            }
            let from = Cell::new(width / 2, height / 2);
            let nearest = all(&grid)
                .filter(|cell| !grid.is_closed(*cell))
                .min_by(|a, b| far(*a, from).total_cmp(&far(*b, from)));
            let found = grid.nearest_open(from, 24);
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
        assert_eq!(grid.nearest_open(Cell::new(9, 9), 1), None);
    }
}
