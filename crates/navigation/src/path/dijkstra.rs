//! Dijkstra's search: what the way from one cell to every other costs.

use super::best_first::BestFirst;
use super::cost::sides;
use super::grid::{Cell, Grid};
use super::planner::{NoPath, Planner};
use super::way::Path;

/// Dijkstra's search (1959). For when the ways to many goals are wanted at once, and as the measure of all the others. About 50 bytes a cell.
#[derive(Clone, Debug)]
pub struct Dijkstra(BestFirst);

impl Dijkstra {
    /// Takes the memory for grids of so many columns and rows.
    pub fn new(width: u32, height: u32) -> Dijkstra {
        Dijkstra(BestFirst::new(width, height))
    }

    /// Finds what the ways between all cells and one cost; [`length`](Self::length) tells it.
    pub fn flood(&mut self, grid: &Grid, from: Cell) -> Result<(), NoPath> {
        self.0.size.check(grid, from, from)?;
        self.0.path.clear();
        self.0.expanded = 0;
        self.0.spread(grid, from, None, |_| 0);
        Ok(())
    }

    /// The length of the shortest way between a cell and where the last search began (sides of a cell); none where there is no way, or it was not
    /// needed.
    pub fn length(&self, cell: Cell) -> Option<f64> {
        self.0.cost(cell).map(sides)
    }
}

impl Planner for Dijkstra {
    fn plan(&mut self, grid: &Grid, start: Cell, goal: Cell) -> Result<&Path, NoPath> {
        self.0.run(grid, start, goal, |_| 0)
    }

    fn expanded(&self) -> usize {
        self.0.expanded
    }
}
