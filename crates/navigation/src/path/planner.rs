//! What all planners have in common.

use super::cost::octile;
use super::grid::{Cell, Grid, LARGEST};
use super::way::Path;

/// Why there is no path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoPath {
    /// The grid is of another size than the planner was made for; make a planner for it.
    #[error("the grid is of another size than the planner; make a planner for it")]
    OtherSize,
    /// The start is closed or outside; begin at the [nearest open cell](Grid::nearest_open).
    #[error("the start is closed; begin at the nearest open cell")]
    StartClosed,
    /// The goal is closed or outside; go to the [nearest open cell](Grid::nearest_open).
    #[error("the goal is closed; go to the nearest open cell")]
    GoalClosed,
    /// Nothing that is free leads from one to the other.
    #[error("nothing that is free leads to the goal")]
    CutOff,
}

/// What a refinement has brought.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refined {
    /// The best path is shorter than before.
    Improved,
    /// The best path is as long as before; it may have become known to be better.
    Unchanged,
    /// The best path is the shortest, or there is none; more refinements change nothing.
    Final,
}

/// Finds ways over grids of one size. All its memory is taken when it is made: a query allocates nothing.
pub trait Planner {
    /// The shortest way from one cell to another. It is kept until the next query.
    fn plan(&mut self, grid: &Grid, start: Cell, goal: Cell) -> Result<&Path, NoPath>;

    /// How many cells the last query has gone on from: a measure of its work that is the same on every machine.
    fn expanded(&self) -> usize;
}

/// Has a way at once, and better ones as long as there is time.
pub trait Anytime {
    /// Finds a first path.
    fn begin(&mut self, grid: &Grid, start: Cell, goal: Cell) -> Result<(), NoPath>;

    /// Does one bounded piece of work for a better one.
    fn refine(&mut self) -> Refined;

    /// The best path so far; an empty one where there is none.
    fn best(&self) -> &Path;
}

/// The grids that a planner is for, and how it counts their cells: row by row, with the rim.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Size {
    width: u32,
    height: u32,
    /// 2⁴⁰ divided by the columns with the rim, rounded up: to divide by them takes a multiplication.
    inverse: u64,
}

impl Size {
    pub(super) fn new(width: u32, height: u32) -> Size {
        let (width, height) = (width.clamp(1, LARGEST), height.clamp(1, LARGEST));
        Size { width, height, inverse: (1u64 << 40).div_ceil(u64::from(width + 2)) }
    }

    /// Cells, with the rim.
    pub(super) fn cells(self) -> usize {
        (self.width + 2) as usize * (self.height + 2) as usize
    }

    /// The cells of the longest way.
    pub(super) fn longest(self) -> usize {
        (self.width * self.height) as usize
    }

    /// Columns and rows with the rim.
    pub(super) fn with_rim(self) -> (u32, u32) {
        (self.width + 2, self.height + 2)
    }

    #[inline]
    pub(super) fn number(self, cell: Cell) -> u32 {
        (cell.y + 1) * (self.width + 2) + cell.x + 1
    }

    /// The column and row of a cell, with the rim.
    #[inline]
    pub(super) fn place(self, number: u32) -> (u32, u32) {
        // The inverse is too large by less than 2⁻⁴⁰ of itself times the columns; a number below 2²⁵ makes less than a row of that.
        let y = ((u64::from(number) * self.inverse) >> 40) as u32;
        (number - y * (self.width + 2), y)
    }

    #[inline]
    pub(super) fn cell(self, number: u32) -> Cell {
        let (x, y) = self.place(number);
        Cell::new(x - 1, y - 1)
    }

    /// What is added to the number of a cell to go each way of [`AROUND`](super::bits::AROUND).
    pub(super) fn steps(self) -> [i32; 8] {
        super::bits::AROUND.map(|(dx, dy)| dy * (self.width + 2) as i32 + dx)
    }

    /// Whether a query can be answered at all.
    pub(super) fn check(self, grid: &Grid, start: Cell, goal: Cell) -> Result<(), NoPath> {
        if (self.width, self.height) != (grid.width(), grid.height()) {
            return Err(NoPath::OtherSize);
        }
        if grid.is_closed(start) {
            return Err(NoPath::StartClosed);
        }
        if grid.is_closed(goal) {
            return Err(NoPath::GoalClosed);
        }
        Ok(())
    }
}

/// The least cost between two numbers of cells.
#[inline]
pub(super) fn between(size: Size, from: u32, to: (u32, u32)) -> super::cost::Cost {
    octile(size.place(from), to)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_has_its_place() {
        for (width, height) in [(1, 4096), (4096, 1), (4096, 4096), (194, 194), (1491, 656)] {
            let size = Size::new(width, height);
            for y in (0..height).step_by(17).chain([height - 1]) {
                for x in [0, 1, width / 2, width - 1] {
                    let cell = Cell::new(x.min(width - 1), y);
                    assert_eq!(size.cell(size.number(cell)), cell);
                }
            }
        }
    }
}
