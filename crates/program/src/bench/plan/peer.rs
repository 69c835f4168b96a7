//! A* of the crate `pathfinding`, used as its documents advise, and as well as it can be here.
//!
//! A node is the number of a cell, the costs are whole numbers, the estimate is the octile distance, the neighbours come out of an array on the stack,
//! and whether a cell is closed is a byte in an array with a rim, made once a map and not timed.

use navigation::path::{Cell, Grid};

/// A straight step and one aslant, in parts of a side of a cell: √2 to 10⁻⁹.
const STRAIGHT: u64 = 1_000_000_000;
const ASLANT: u64 = 1_414_213_562;

/// The map as it is best for it.
pub(super) struct Peer {
    width: u32,
    closed: Vec<bool>,
}

impl Peer {
    pub(super) fn new(grid: &Grid) -> Peer {
        let width = grid.width() + 2;
        let rows = 0..grid.height() + 2;
        let closed = rows.flat_map(|y| {
            (0..width).map(move |x| grid.is_closed(Cell::new(x.wrapping_sub(1), y.wrapping_sub(1))))
        });
        Peer { width, closed: closed.collect() }
    }

    fn number(&self, cell: Cell) -> u32 {
        (cell.y + 1) * self.width + cell.x + 1
    }

    fn octile(&self, a: u32, b: u32) -> u64 {
        let dx = u64::from((a % self.width).abs_diff(b % self.width));
        let dy = u64::from((a / self.width).abs_diff(b / self.width));
        STRAIGHT * dx.max(dy) + (ASLANT - STRAIGHT) * dx.min(dy)
    }

    /// The open neighbours and what a step there costs; aslant only where both corners beside the step are open.
    fn steps(&self, cell: u32) -> impl Iterator<Item = (u32, u64)> + use<> {
        let width = self.width;
        let open = |number: u32| !self.closed[number as usize];
        let (east, west, south, north) = (cell + 1, cell - 1, cell + width, cell - width);
        let [e, w, s, n] = [east, west, south, north].map(open);
        let straight = |is_open: bool, next: u32| is_open.then_some((next, STRAIGHT));
        let aslant = |corners: bool, next: u32| (corners && open(next)).then_some((next, ASLANT));
        [
            straight(e, east),
            straight(w, west),
            straight(s, south),
            straight(n, north),
            aslant(s && e, south + 1),
            aslant(s && w, south - 1),
            aslant(n && e, north + 1),
            aslant(n && w, north - 1),
        ]
        .into_iter()
        .flatten()
    }

    /// The length of the shortest way (sides of a cell); none where there is none.
    pub(super) fn length(&self, start: Cell, goal: Cell) -> Option<f64> {
        let (start, goal) = (self.number(start), self.number(goal));
        if self.closed[start as usize] || self.closed[goal as usize] {
            return None;
        }
        let found = pathfinding::prelude::astar(
            &start,
            |cell| self.steps(*cell),
            |cell| self.octile(*cell, goal),
            |cell| *cell == goal,
        );
        found.map(|(_, cost)| cost as f64 / STRAIGHT as f64)
    }
}
