//! ARA*: A* that believes too much of its estimate at first, and less from round to round.
//!
//! A cell waits by the cost of the way to it plus ε times what is left over free floor; the larger ε, the straighter the search goes for the goal, and
//! the way that it finds costs at most ε times the least. In a round each cell is gone on from once; one that is found to be nearer afterwards waits for
//! the next round, in which nothing of the work is lost. At the end of a round the least that any way can cost is that of what waits, so
//!
//! ```text
//!   ε' = min(ε, cost of the way / least over all that waits of (cost + left))
//! ```
//!
//! is proven. (Likhachev, Gordon and Thrun 2003, "ARA*: Anytime A* with provable bounds on sub-optimality", figures 1 to 3.)

use super::bits::Bits;
use super::cost::{ASLANT, Cost, NEVER, STRAIGHT, octile, sides};
use super::grid::{Cell, Grid};
use super::heap::Heap;
use super::nodes::{HERE, Nodes};
use super::planner::{Anytime, NoPath, Planner, Refined, Size, between};
use super::way::Path;

/// How much more the estimate counts, and how that falls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AraParams {
    /// ε of the first round (1..16). 3: a first way soon, and seldom a bad one; that of the authors' experiments.
    pub first: f64,
    /// So much less is ε from round to round (1/64..16). 0.5: five rounds, each of which has something to do.
    pub step: f64,
}

impl Default for AraParams {
    fn default() -> AraParams {
        AraParams { first: 3.0, step: 0.5 }
    }
}

/// ε is counted in parts of one.
const ONE: Cost = 256;
/// So many cells one refinement goes on from.
const PIECE: usize = 256;

/// Ways with a proven bound, from round to round. For comparison with the book; [`Field`](super::Field) has its ways sooner. About 65 bytes a cell.
#[derive(Clone, Debug)]
pub struct Ara {
    size: Size,
    first: Cost,
    step: Cost,
    closed: Bits,
    nodes: Nodes,
    heap: Heap<Cost>,
    /// The round in which a cell was gone on from, twice; one more where it waits for the next.
    marks: Box<[u64]>,
    /// What waits for the next round.
    later: Vec<u32>,
    round: u64,
    /// ε of this round; none where nothing is left to do.
    weight: Option<Cost>,
    start: u32,
    goal: u32,
    best: Path,
    other: Path,
    expanded: usize,
}

impl Ara {
    /// Takes the memory for grids of so many columns and rows.
    pub fn new(width: u32, height: u32, params: AraParams) -> Ara {
        let size = Size::new(width, height);
        let (columns, rows) = size.with_rim();
        let part = |x: f64, least: f64| libm::round(x.clamp(least, 16.0) * ONE as f64) as Cost;
        Ara {
            size,
            first: part(params.first, 1.0),
            step: part(params.step, 1.0 / 64.0),
            closed: Bits::new(columns, rows),
            nodes: Nodes::new(size.cells()),
            heap: Heap::new(size.cells()),
            marks: vec![0; size.cells()].into_boxed_slice(),
            later: Vec::with_capacity(size.cells()),
            round: 0,
            weight: None,
            start: 0,
            goal: 0,
            best: Path::with_room(size.longest()),
            other: Path::with_room(size.longest()),
            expanded: 0,
        }
    }

    /// So many times as long as the shortest way is the best one at most; none where there is no way.
    pub fn bound(&self) -> Option<f64> {
        let quality = self.best.quality();
        (quality > 0.0).then(|| 1.0 / quality)
    }

    fn key(&self, cell: u32, weight: Cost) -> Cost {
        let left = between(self.size, cell, self.size.place(self.goal));
        self.nodes.cost(cell) + left * weight / ONE
    }

    /// Goes on from up to `most` cells; whether the round is over.
    fn improve(&mut self, weight: Cost, most: usize) -> bool {
        let goal = self.size.place(self.goal);
        let steps = self.size.steps();
        for _ in 0..most {
            match self.heap.first() {
                Some((key, _)) if key < self.nodes.cost(self.goal) => {}
                _ => return true,
            }
            let Some((_, cell)) = self.heap.take() else { return true };
            self.expanded += 1;
            self.marks[cell as usize] = 2 * self.round;
            let (x, y) = self.size.place(cell);
            let cost = self.nodes.cost(cell);
            let mut open = self.closed.open_around(x, y);
            while open != 0 {
                let way = open.trailing_zeros() as usize;
                open &= open - 1;
                let next = cell.wrapping_add_signed(steps[way]);
                let cost = cost + if way < 4 { STRAIGHT } else { ASLANT };
                if !self.nodes.improve(next, cost, cell) {
                    continue;
                }
                let mark = &mut self.marks[next as usize];
                if *mark < 2 * self.round {
                    self.heap.put(next, cost + octile(self.size.place(next), goal) * weight / ONE);
                } else if *mark == 2 * self.round {
                    *mark += 1;
                    self.later.push(next);
                }
            }
        }
        false
    }

    /// Ends a round: publishes its way with its bound, and begins the next.
    fn publish(&mut self, weight: Cost) -> Refined {
        let cost = self.nodes.cost(self.goal);
        let goal = self.size.place(self.goal);
        let waiting = self.heap.iter().chain(self.later.iter().copied());
        let least = waiting.map(|cell| self.nodes.cost(cell) + between(self.size, cell, goal)).min();
        let least = least.unwrap_or(NEVER).max(cost * ONE / weight).min(cost);
        let is_better = self.trace();
        self.best.least = self.best.least.max(sides(least)).min(self.best.length());
        if least == cost || weight == ONE {
            self.best.least = self.best.length();
            self.weight = None;
            return Refined::Final;
        }
        let proven = (cost * ONE).div_ceil(least.max(1)).min(weight);
        let weight = proven.saturating_sub(self.step).max(ONE);
        self.round += 1;
        while let Some(cell) = self.later.pop() {
            self.heap.put(cell, 0);
        }
        let Ara { heap, nodes, size, .. } = self;
        heap.order(|cell| nodes.cost(cell) + between(*size, cell, goal) * weight / ONE);
        self.weight = Some(weight);
        if is_better { Refined::Improved } else { Refined::Unchanged }
    }

    /// Follows the way back from the goal, and keeps it where it is the best; whether it is better than the last.
    fn trace(&mut self) -> bool {
        self.other.clear();
        let mut at = self.goal;
        while at != HERE {
            self.other.go(self.size.cell(at));
            at = self.nodes.from(at);
        }
        let is_better = self.best.cells().is_empty() || self.other.length() < self.best.length();
        if is_better {
            self.other.reverse();
            self.other.least = self.best.least;
            core::mem::swap(&mut self.best, &mut self.other);
        }
        is_better
    }
}

impl Anytime for Ara {
    /// The way of the first round.
    fn begin(&mut self, grid: &Grid, start: Cell, goal: Cell) -> Result<(), NoPath> {
        self.weight = None;
        self.best.clear();
        self.expanded = 0;
        self.size.check(grid, start, goal)?;
        self.closed.copy_from(grid.closed());
        (self.start, self.goal) = (self.size.number(start), self.size.number(goal));
        self.nodes.forget();
        self.heap.clear();
        self.later.clear();
        self.round += 1;
        self.nodes.improve(self.start, 0, HERE);
        let key = self.key(self.start, self.first);
        self.heap.put(self.start, key);
        self.improve(self.first, usize::MAX);
        if self.nodes.cost(self.goal) == NEVER {
            return Err(NoPath::CutOff);
        }
        self.publish(self.first);
        Ok(())
    }

    /// Goes on from 256 cells; a way is published at the end of each round.
    fn refine(&mut self) -> Refined {
        let Some(weight) = self.weight else { return Refined::Final };
        if self.improve(weight, PIECE) { self.publish(weight) } else { Refined::Unchanged }
    }

    fn best(&self) -> &Path {
        &self.best
    }
}

impl Planner for Ara {
    fn plan(&mut self, grid: &Grid, start: Cell, goal: Cell) -> Result<&Path, NoPath> {
        self.begin(grid, start, goal)?;
        while self.refine() != Refined::Final {}
        Ok(&self.best)
    }

    fn expanded(&self) -> usize {
        self.expanded
    }
}
