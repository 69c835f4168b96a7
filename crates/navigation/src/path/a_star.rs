//! A*: the shortest way, searched for where it would be over free floor.

use super::best_first::{BestFirst, left};
use super::grid::{Cell, Grid};
use super::planner::{NoPath, Planner};
use super::way::Path;

/// A* with the octile distance (Hart, Nilsson and Raphael 1968). For when the way is wanted, on any machine, from a program that anybody can follow;
/// [`Jump`](super::Jump) gives ways of the same length several times sooner. About 50 bytes a cell.
#[derive(Clone, Debug)]
pub struct AStar(BestFirst);

impl AStar {
    /// Takes the memory for grids of so many columns and rows.
    pub fn new(width: u32, height: u32) -> AStar {
        AStar(BestFirst::new(width, height))
    }
}

impl Planner for AStar {
    fn plan(&mut self, grid: &Grid, start: Cell, goal: Cell) -> Result<&Path, NoPath> {
        let left = left(self.0.size, goal);
        self.0.run(grid, start, goal, left)
    }

    fn expanded(&self) -> usize {
        self.0.expanded
    }
}
