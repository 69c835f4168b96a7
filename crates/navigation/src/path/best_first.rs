//! Searches that go on from the cell of least rank: A* and, where nothing is estimated, Dijkstra's.

use super::cost::{ASLANT, Cost, STRAIGHT, octile};
use super::grid::{Cell, Grid};
use super::heap::Heap;
use super::nodes::{HERE, Nodes};
use super::planner::{NoPath, Size};
use super::way::Path;

/// A search with its memory.
#[derive(Clone, Debug)]
pub(super) struct BestFirst {
    pub(super) size: Size,
    nodes: Nodes,
    /// By rank, and of those of equal rank the one that is nearer to the goal.
    heap: Heap<(Cost, Cost)>,
    pub(super) path: Path,
    pub(super) expanded: usize,
}

impl BestFirst {
    pub(super) fn new(width: u32, height: u32) -> BestFirst {
        let size = Size::new(width, height);
        BestFirst {
            size,
            nodes: Nodes::new(size.cells()),
            heap: Heap::new(size.cells()),
            path: Path::with_room(size.longest()),
            expanded: 0,
        }
    }

    /// The shortest way. Of the rest of a way `estimate` tells no more than it costs, and not more less from one cell to the next than the step does;
    /// so a cell that was taken has its true cost (Hart, Nilsson and Raphael 1968).
    pub(super) fn run(
        &mut self,
        grid: &Grid,
        start: Cell,
        goal: Cell,
        estimate: impl Fn((u32, u32)) -> Cost,
    ) -> Result<&Path, NoPath> {
        self.path.clear();
        self.expanded = 0;
        self.size.check(grid, start, goal)?;
        let goal = self.size.number(goal);
        if !self.spread(grid, start, Some(goal), estimate) {
            return Err(NoPath::CutOff);
        }
        let mut at = goal;
        while at != HERE {
            self.path.go(self.size.cell(at));
            at = self.nodes.from(at);
        }
        self.path.reverse();
        self.path.least = self.path.length();
        Ok(&self.path)
    }

    /// Searches from a cell until another has its true cost, or all have; whether that one was reached.
    pub(super) fn spread(
        &mut self,
        grid: &Grid,
        from: Cell,
        to: Option<u32>,
        estimate: impl Fn((u32, u32)) -> Cost,
    ) -> bool {
        self.nodes.forget();
        self.heap.clear();
        let (closed, steps) = (grid.closed(), self.size.steps());
        let from = self.size.number(from);
        self.nodes.improve(from, 0, HERE);
        self.heap.put(from, (0, 0));
        while let Some((_, cell)) = self.heap.take() {
            if Some(cell) == to {
                return true;
            }
            self.expanded += 1;
            let (x, y) = self.size.place(cell);
            let cost = self.nodes.cost(cell);
            let mut open = closed.open_around(x, y);
            while open != 0 {
                let way = open.trailing_zeros() as usize;
                open &= open - 1;
                let next = cell.wrapping_add_signed(steps[way]);
                let cost = cost + if way < 4 { STRAIGHT } else { ASLANT };
                if self.nodes.improve(next, cost, cell) {
                    let left = estimate(self.size.place(next));
                    self.heap.put(next, (cost + left, left));
                }
            }
        }
        false
    }

    /// What the way between a cell and where the last search began costs, where it is known.
    pub(super) fn cost(&self, cell: Cell) -> Option<Cost> {
        let cost = self.nodes.cost(self.size.number(cell));
        (cost < super::cost::NEVER).then_some(cost)
    }
}

/// The estimate of A*: what is left over free floor.
pub(super) fn left(size: Size, goal: Cell) -> impl Fn((u32, u32)) -> Cost {
    let goal = size.place(size.number(goal));
    move |at| octile(at, goal)
}
