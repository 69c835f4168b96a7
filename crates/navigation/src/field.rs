//! A way to a goal over a grid that is there at once and gets better as long as there is time: a potential, from coarse to fine.
//!
//! In plain words: water that rises from the goal through all that is free tells in each cell how long the way to the goal is;
//! downhill is the shortest way. On blocks of many cells it rises quickly but passes no narrow place, and its ways have corners
//! that they need not have. So the coarsest blocks that let it through give a first way, and while that way is gone by, finer ones give better.
//!
//! How it works: a block of 8, 4, 2 or 1 cells to a side may be gone through where all its cells are free, straight or
//! aslant, aslant only where both corners beside the step are free. The potential is spread from the goal, most promising
//! blocks first (A* with the octile distance to the start). A way over blocks is one over their cells with the same
//! length, so one on finer blocks is never longer, but at the ends; the best that was found is kept. On the cells themselves the
//! potential helps before it has reached the start: where the best way so far meets a cell whose potential is known, it goes on downhill from there.
//!
//! ```text
//!              a way on blocks of 8 … 1           the next finer blocks
//!   begin ────────────────────────────▶ refine ─┐ ◀───────────────────┐
//!     │ no way on any                           ├─▶ Improved, Unchanged┘
//!     ▼                                         └─▶ Final: on cells the start is reached
//!   NoPath
//! ```
//!
//! The quality is a bound: the least length that a way can have, divided by that of the best. At first the least is the octile
//! distance, on cells it is the least estimate of what waits, at the end it is the length itself. (The potential: Barraquand and
//! Latombe 1991, "NF1"; bounds while a search runs: Hansen and Zhou 2007, "Anytime Heuristic Search", section 2.)

mod grid;
mod level;
mod path;

pub use grid::{Cell, Grid};
use level::{Level, Progress};
pub use path::Path;

/// Sides of the blocks (cells), the finest first.
const SIDES: [u32; 4] = [1, 2, 4, 8];
/// So many blocks one refinement settles.
const SETTLED: usize = 256;

/// The length of so many steps straight and aslant (sides of a cell). It is reckoned from whole numbers, so ways of equal length have equal lengths.
pub(crate) fn length(straight: u32, aslant: u32) -> f64 {
    f64::from(straight) + f64::from(aslant) * core::f64::consts::SQRT_2
}

/// Why there is no path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoPath {
    /// The grid is of another size than the field was made for; make a field for it.
    OtherSize,
    /// The start is closed or outside; begin at the [nearest open cell](Grid::nearest_open).
    StartClosed,
    /// The goal is closed or outside; go to the [nearest open cell](Grid::nearest_open).
    GoalClosed,
    /// Nothing that is free leads from one to the other.
    CutOff,
}

impl core::fmt::Display for NoPath {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            NoPath::OtherSize => "the grid is of another size than the field; make a field for it",
            NoPath::StartClosed => "the start is closed; begin at the nearest open cell",
            NoPath::GoalClosed => "the goal is closed; go to the nearest open cell",
            NoPath::CutOff => "nothing that is free leads to the goal",
        })
    }
}

impl core::error::Error for NoPath {}

/// What a refinement has brought.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refined {
    /// The best path is shorter than before.
    Improved,
    /// The best path is the same; it may have become known to be better.
    Unchanged,
    /// The best path is the shortest, or there is none; more refinements change nothing.
    Final,
}

/// The potential around a goal, on blocks from coarse to fine. All memory is taken when it is made, about 70 bytes a cell.
#[derive(Clone, Debug)]
pub struct Field {
    width: u32,
    height: u32,
    levels: [Level; SIDES.len()],
    /// The level that is being worked on; none when all is done.
    at: Option<usize>,
    start: Cell,
    goal: Cell,
    best: Path,
    other: Path,
}

impl Field {
    /// Takes the memory for grids of this size.
    pub fn new(width: u32, height: u32) -> Field {
        let (width, height) = (width.clamp(1, 4096), height.clamp(1, 4096));
        // A way is one over blocks, none of them twice, and two walks within one; where a best one is gone on from, it is two.
        let room = 2 * (width * height) as usize + 64;
        Field {
            width,
            height,
            levels: SIDES.map(|side| Level::new(width, height, side)),
            at: None,
            start: Cell::default(),
            goal: Cell::default(),
            best: Path::with_room(room),
            other: Path::with_room(room),
        }
    }

    /// Finds a first path, on the coarsest blocks on which there is one.
    pub fn begin(&mut self, grid: &Grid, start: Cell, goal: Cell) -> Result<(), NoPath> {
        self.at = None;
        self.best.clear();
        if (grid.width(), grid.height()) != (self.width, self.height) {
            return Err(NoPath::OtherSize);
        }
        if grid.is_closed(start) {
            return Err(NoPath::StartClosed);
        }
        if grid.is_closed(goal) {
            return Err(NoPath::GoalClosed);
        }
        (self.start, self.goal) = (start, goal);
        let mut found = None;
        for (number, level) in self.levels.iter_mut().enumerate().rev() {
            level.draw(grid.closed(), grid.width());
            // The finer ones are made ready as well, so that no refinement has to do it.
            if level.begin(start, goal) && found.is_none() && level.expand(usize::MAX) == Progress::Arrived {
                found = Some(number);
            }
        }
        let found = found.ok_or(NoPath::CutOff)?;
        self.embed(found);
        self.best.least = if found == 0 { self.best.length() } else { start.octile(goal) };
        self.at = found.checked_sub(1);
        Ok(())
    }

    /// Does one bounded piece of work: settles 256 blocks, and looks at the best path once.
    pub fn refine(&mut self) -> Refined {
        let Some(at) = self.at else { return Refined::Final };
        let progress = self.levels[at].expand(SETTLED);
        let before = self.best.length();
        if at == 0 {
            self.go_on_downhill();
            if progress != Progress::Working {
                self.best.least = self.best.length();
                self.at = None;
                return Refined::Final;
            }
            self.best.least =
                self.levels[0].least().map_or(self.best.least, |least| least.max(self.best.least));
        } else if progress != Progress::Working {
            if progress == Progress::Arrived {
                self.embed(at);
            }
            self.at = Some(at - 1);
        }
        if self.best.length() < before { Refined::Improved } else { Refined::Unchanged }
    }

    /// The best path so far; an empty one where there is none.
    pub fn best(&self) -> &Path {
        &self.best
    }

    /// Takes the way over the blocks of a level as the best, if it is shorter.
    fn embed(&mut self, number: usize) {
        let Field { levels, start, goal, other, .. } = self;
        let level = &levels[number];
        // Each block is gone through at the place at which the goal lies in its own: a step between such places crosses only the blocks of
        // the step and the corners beside it, which are all free.
        let place = |block: Cell| {
            Cell::new(block.x * level.side + goal.x % level.side, block.y * level.side + goal.y % level.side)
        };
        other.clear();
        other.go(*start);
        level.descent(level.block(*start)).for_each(|block| other.walk(place(block)));
        other.walk(*goal);
        self.take_better();
    }

    /// From the cell of the best path from which that is shortest it goes downhill, among those whose potential is known.
    fn go_on_downhill(&mut self) {
        let Field { levels, best, other, .. } = self;
        let level = &levels[0];
        let (mut straight, mut aslant, mut before) = (0, 0, None);
        let mut shortest: Option<(f64, usize)> = None;
        for (i, cell) in best.cells().iter().enumerate() {
            if let Some(Cell { x, y }) = before.replace(*cell) {
                let is_aslant = x != cell.x && y != cell.y;
                aslant += u32::from(is_aslant);
                straight += u32::from(!is_aslant);
            }
            let Some(rest) = level.settled(*cell) else { continue };
            let all = length(straight, aslant) + rest;
            if shortest.is_none_or(|(least, _)| all < least - 1e-9) {
                shortest = Some((all, i));
            }
        }
        // What is shorter by rounding alone is not shorter.
        if let Some((all, i)) = shortest
            && all < best.length() - 1e-9
        {
            let from = best.cells()[i];
            other.begin_as(best, i + 1);
            level.descent(from).for_each(|cell| other.go(cell));
            self.take_better();
        }
    }

    /// Keeps the shorter of the two paths as the best.
    fn take_better(&mut self) {
        if self.best.cells().is_empty() || self.other.length() < self.best.length() {
            self.other.least = self.best.least;
            core::mem::swap(&mut self.best, &mut self.other);
        }
    }
}

#[cfg(test)]
mod tests;
