//! A way to a goal that is there at once and gets better as long as there is time: a potential that is spread from the goal and revised.
//!
//! In plain words: each cell that was met knows how long a way from it to the goal is, and which neighbour to go to; so whoever stands on it goes downhill. At first the potential is
//! spread straight towards the start, and what it says is too much here and there. Then it is revised, where a shorter way can still lie, until
//! none can.
//!
//! How it works: the potential of a cell is what a way from it costs that is known. A cell whose potential has fallen waits, to tell its neighbours. In
//! the first wave those go first from which the start seems near, by potential + 2 · octile(cell, start); it ends when the start is met, and that
//! is the first way. In the further waves the weight falls to 1. A cell falls strictly when it is told, and its neighbour below it is lower by a step at least, so
//!
//! - going downhill from the start never ends before the goal, and never in a circle, at whatever time;
//! - when a way is published, the potential along it is made what the rest of it costs. Whatever falls on it later makes the way shorter: it never grows;
//! - on every way there is a cell that waits, or all of it is known: no way costs less than the least of potential + octile(cell, start) over all that wait.
//!   That is the bound, and when the way costs no more, it is the shortest.
//!
//! ```text
//!              the start is met              a cell of the way has fallen
//!   begin ────────────────────────▶ refine ─┐ ◀────────────────────┐
//!     │ nobody waits any more               ├─▶ Improved, Unchanged ┘
//!     ▼                                     └─▶ Final: nobody who waits can make the way shorter
//!   NoPath
//! ```
//!
//! (The potential: Barraquand and Latombe 1991, "NF1"; the weight and its bound: Hansen and Zhou 2007, "Anytime heuristic search", section 2, and
//! Likhachev, Gordon and Thrun 2003. That the potential itself is corrected along each way that it gives is of our own.)

mod queue;

use super::bits::{AROUND, Bits, NO_WAY, opposite};
use super::cost::{ASLANT, Cost, NEVER, STRAIGHT, octile, sides};
use super::grid::{Cell, Grid};
use super::planner::{Anytime, NoPath, Planner, Refined, Size};
use super::way::Path;
use queue::Queue;

/// How much more the distance to the start counts in each wave, in halves.
const WEIGHTS: [Cost; 2] = [4, 2];
const ONE: Cost = 2;
/// So many cells one refinement goes on from.
const PIECE: usize = 256;
/// The goal leads nowhere.
const HERE: u8 = NO_WAY as u8;

/// The way by which the potential came to a cell from the one below it.
fn came(down: u8) -> usize {
    if down == HERE { NO_WAY } else { opposite(usize::from(down)) }
}

/// The potential around a goal. All memory is taken when it is made, about 35 bytes a cell.
#[derive(Clone, Debug)]
pub struct Field {
    size: Size,
    closed: Bits,
    spots: Queue,
    /// The wave that is being spread; none when all is done.
    wave: Option<usize>,
    start: u32,
    goal: u32,
    /// The least that any way can cost, as far as is known.
    least: Cost,
    /// Whether the potential of a cell of the best way has fallen.
    has_fallen: bool,
    best: Path,
    expanded: usize,
}

impl Field {
    /// Takes the memory for grids of so many columns and rows.
    pub fn new(width: u32, height: u32) -> Field {
        let size = Size::new(width, height);
        let (columns, rows) = size.with_rim();
        Field {
            size,
            closed: Bits::new(columns, rows),
            spots: Queue::new(size.cells()),
            wave: None,
            start: 0,
            goal: 0,
            least: 0,
            has_fallen: false,
            best: Path::with_room(size.longest()),
            expanded: 0,
        }
    }

    /// How long a way from a cell to the goal is that is known (sides of a cell); none where none is.
    pub fn potential(&self, cell: Cell) -> Option<f64> {
        let (width, height) = self.size.with_rim();
        if cell.x >= width - 2 || cell.y >= height - 2 {
            return None;
        }
        let potential = self.spots.potential(self.size.number(cell));
        (potential < NEVER).then(|| sides(potential))
    }

    /// Goes on from up to `most` cells, those that promise most first. Gives whether the wave is over.
    fn spread(&mut self, wave: usize, most: usize) -> bool {
        let Field { size, closed, spots, .. } = self;
        let (start, steps) = (size.place(self.start), size.steps());
        let is_last = wave == WEIGHTS.len() - 1;
        let mut known = spots.potential(self.start);
        let key = |at: (u32, u32), potential: Cost| potential + octile(at, start) * WEIGHTS[wave] / ONE;
        for _ in 0..most {
            if spots.is_out_of_reach() || !spots.has_room(8) {
                spots.order(false, |cell, potential| Some(key(size.place(cell), potential)));
            }
            if spots.least() >= known {
                return true;
            }
            let Some(cell) = spots.take() else { return true };
            let (x, y) = size.place(cell);
            let potential = spots.potential(cell);
            // From here the way to the start would be longer than one that is known.
            if potential + octile((x, y), start) >= known {
                continue;
            }
            self.expanded += 1;
            let mut worth = closed.worth_around(x, y, came(spots.down(cell)));
            while worth != 0 {
                let way = worth.trailing_zeros() as usize;
                worth &= worth - 1;
                let next = cell.wrapping_add_signed(steps[way]);
                let potential = potential + if way < 4 { STRAIGHT } else { ASLANT };
                if !spots.is_lower(next, potential) {
                    continue;
                }
                let at = (x.wrapping_add_signed(AROUND[way].0), y.wrapping_add_signed(AROUND[way].1));
                if potential + octile(at, start) >= known {
                    continue;
                }
                self.has_fallen |= spots.fall(next, potential, opposite(way) as u8);
                // Who has told its neighbours in this wave waits for the next: many fall more than once while the order is a bad one.
                if is_last || !spots.has_told(next, wave) {
                    spots.wait(next, key(at, potential));
                } else {
                    spots.wait_long(next);
                }
                if next == self.start {
                    known = potential;
                    self.has_fallen = true;
                }
            }
            spots.tell(cell, wave);
            if self.has_fallen && self.best.cells().is_empty() {
                return true;
            }
        }
        false
    }

    /// Begins a wave: all that wait do so in its order. What can make no way shorter waits no more.
    fn begin_wave(&mut self, wave: usize) {
        let (size, start) = (self.size, self.size.place(self.start));
        let known = self.spots.potential(self.start);
        let left = |cell: u32| octile(size.place(cell), start);
        let least = self.spots.waiting().map(|(cell, potential)| potential + left(cell)).min();
        self.least = self.least.max(least.unwrap_or(NEVER).min(known));
        self.spots.order(true, |cell, potential| {
            let left = left(cell);
            (potential + left < known).then(|| potential + left * WEIGHTS[wave] / ONE)
        });
        self.wave = Some(wave);
    }

    /// Goes downhill from the start, and makes the potential along this way what the rest of it costs.
    fn publish(&mut self) {
        let Field { size, spots, best, .. } = self;
        self.has_fallen = false;
        best.cells().iter().for_each(|cell| spots.mark(size.number(*cell), false));
        best.clear();
        let mut at = self.start;
        best.go(size.cell(at));
        while let Some(step) = size.steps().get(usize::from(spots.down(at))) {
            at = at.wrapping_add_signed(*step);
            best.go(size.cell(at));
        }
        let (start, weight) = (size.place(self.start), WEIGHTS[self.wave.unwrap_or(0)]);
        let mut rest = 0;
        for i in (0..best.cells().len()).rev() {
            let cell = best.cells()[i];
            if let Some(below) = best.cells().get(i + 1) {
                rest += if cell.x == below.x || cell.y == below.y { STRAIGHT } else { ASLANT };
            }
            let number = size.number(cell);
            if rest < spots.potential(number) {
                if !spots.has_room(1) {
                    spots.order(false, |cell, potential| {
                        Some(potential + octile(size.place(cell), start) * weight / ONE)
                    });
                }
                spots.fall(number, rest, spots.down(number));
                spots.wait(number, rest + octile(size.place(number), start) * weight / ONE);
            }
            spots.mark(number, true);
        }
    }

    /// Notes how good the best way is at least.
    fn judge(&mut self, is_done: bool) {
        let known = self.spots.potential(self.start);
        if self.wave == Some(WEIGHTS.len() - 1) {
            self.least = self.least.max(self.spots.least().min(known));
        }
        let length = self.best.length();
        self.best.least = if is_done || self.least >= known { length } else { sides(self.least).min(length) };
    }
}

impl Anytime for Field {
    /// Spreads the potential straight towards the start until it is met.
    fn begin(&mut self, grid: &Grid, start: Cell, goal: Cell) -> Result<(), NoPath> {
        self.wave = None;
        self.best.clear();
        self.expanded = 0;
        self.size.check(grid, start, goal)?;
        self.closed.copy_from(grid.closed());
        (self.start, self.goal) = (self.size.number(start), self.size.number(goal));
        self.spots.forget();
        self.least = octile(self.size.place(self.start), self.size.place(self.goal));
        self.has_fallen = false;
        self.spots.fall(self.goal, 0, HERE);
        self.spots.wait(self.goal, self.least * WEIGHTS[0] / ONE);
        if self.start != self.goal {
            self.spread(0, usize::MAX);
        }
        if self.spots.potential(self.start) == NEVER {
            return Err(NoPath::CutOff);
        }
        self.publish();
        self.begin_wave(1);
        self.judge(false);
        Ok(())
    }

    /// Goes on from 256 cells, and publishes a better way where one was found.
    fn refine(&mut self) -> Refined {
        let Some(wave) = self.wave else { return Refined::Final };
        let is_over = self.spread(wave, PIECE);
        let has_fallen = self.has_fallen;
        if has_fallen {
            self.publish();
        }
        let is_done = is_over && wave + 1 == WEIGHTS.len();
        if is_done {
            self.judge(true);
            self.wave = None;
            return Refined::Final;
        }
        if is_over {
            self.begin_wave(wave + 1);
        }
        self.judge(false);
        if has_fallen { Refined::Improved } else { Refined::Unchanged }
    }

    fn best(&self) -> &Path {
        &self.best
    }
}

impl Planner for Field {
    fn plan(&mut self, grid: &Grid, start: Cell, goal: Cell) -> Result<&Path, NoPath> {
        self.begin(grid, start, goal)?;
        while self.refine() != Refined::Final {}
        Ok(&self.best)
    }

    fn expanded(&self) -> usize {
        self.expanded
    }
}
