//! Jump point search on rows of bits: the shortest way, from the few cells at which it can turn.
//!
//! In plain words: of all ways that are equally long only the one is followed that goes aslant as early as it can. Such a way turns only at its start, and
//! where it has just passed the end of an obstacle beside it. Those cells are found 64 at a time, and only they wait and are compared.
//!
//! How it works: going along a row, a cell is a jump point where the cell beside the one before it is closed and the cell beside itself is open:
//! only from here the row beside is reached soonest.
//!
//! ```text
//!        closed │ open          forced = (closed << 1) & !closed, of the row above and of the one below
//!   ────────────┼──▲──▲         the first bit of forced | closed(own row) is what is met first
//!    p ──────▶ ─┼─ n  │
//!               │  └──┘ n goes on ahead, straight to the side and aslant
//! ```
//!
//! Going aslant, which takes three open cells, no corner is ever passed, so no cell is a jump point by itself: from each the row and the column ahead are
//! looked along, and what is found there follows the cell from which the way came ("intermediate pruning"). So a cell that waits was
//! reached aslant first, then straight. Columns are the rows of the grid turned about its diagonal.
//!
//! A way aslant halts where what can be reached over it costs more than what waits, and waits like a cell until its turn comes: of the four that
//! lead away from a start hardly more is walked than promises something, however wide the floor is.
//!
//! Harabor and Grastien 2011, "Online graph pruning for pathfinding on grid maps", and 2014, "Improving jump point search", with the rules for moves that cut no
//! corner.

use super::bits::Bits;
use super::cost::{Cost, octile};
use super::grid::{Cell, Grid};
use super::heap::Heap;
use super::nodes::{HERE, Nodes};
use super::planner::{NoPath, Planner, Size};
use super::way::Path;

/// So many ways aslant can halt at once; where more would, they go on instead, as they soon do in the tests.
const HALTS: usize = if cfg!(test) { 3 } else { 256 };
/// After so many steps a way aslant looks whether it halts; sooner on the small floors of the tests.
const LEG: usize = if cfg!(test) { 2 } else { 8 };

/// The shortest way, soonest. It prepares nothing: the grid may change from query to query. About 45 bytes a cell.
#[derive(Clone, Debug)]
pub struct Jump {
    size: Size,
    nodes: Nodes,
    /// The numbers after those of the cells are of ways that have halted.
    heap: Heap<Cost>,
    halts: Halts,
    path: Path,
    expanded: usize,
}

/// A way aslant: whether to the right and down, from a cell that it left, and where it is.
#[derive(Clone, Copy, Debug, Default)]
struct Aslant {
    from: Here,
    at: (u32, u32),
    to: [bool; 2],
}

/// Ways aslant that have halted, by their numbers. The memory for all is taken when it is made.
#[derive(Clone, Debug)]
struct Halts {
    ways: Box<[Aslant]>,
    free: Vec<u32>,
}

/// A query while it is answered.
struct Search<'a> {
    rows: &'a Bits,
    columns: &'a Bits,
    size: Size,
    nodes: &'a mut Nodes,
    heap: &'a mut Heap<Cost>,
    halts: &'a mut Halts,
    goal: (u32, u32),
}

/// A cell that is gone on from.
#[derive(Clone, Copy, Debug, Default)]
struct Here {
    number: u32,
    at: (u32, u32),
    cost: Cost,
}

impl Halts {
    fn new() -> Halts {
        let mut halts = Halts {
            ways: vec![Aslant::default(); HALTS].into_boxed_slice(),
            free: Vec::with_capacity(HALTS),
        };
        halts.clear();
        halts
    }

    fn clear(&mut self) {
        self.free.clear();
        self.free.extend((0..HALTS as u32).rev());
    }

    /// Keeps a way, and gives its number; none where there is no room.
    fn keep(&mut self, way: Aslant) -> Option<u32> {
        let number = self.free.pop()?;
        self.ways[number as usize] = way;
        Some(number)
    }

    /// Gives a way back.
    fn take(&mut self, number: u32) -> Aslant {
        self.free.push(number);
        self.ways[number as usize]
    }
}

impl Jump {
    /// Takes the memory for grids of so many columns and rows.
    pub fn new(width: u32, height: u32) -> Jump {
        let size = Size::new(width, height);
        Jump {
            size,
            nodes: Nodes::new(size.cells()),
            heap: Heap::new(size.cells() + HALTS),
            halts: Halts::new(),
            path: Path::with_room(size.longest()),
            expanded: 0,
        }
    }

    /// Follows the way back from the goal.
    fn trace(&mut self, goal: u32) {
        let mut at = goal;
        while at != HERE {
            if self.path.cells().is_empty() {
                self.path.go(self.size.cell(at));
            } else {
                self.path.walk_straight_first(self.size.cell(at));
            }
            at = self.nodes.from(at);
        }
        self.path.reverse();
        self.path.least = self.path.length();
    }
}

impl Planner for Jump {
    fn plan(&mut self, grid: &Grid, start: Cell, goal: Cell) -> Result<&Path, NoPath> {
        self.path.clear();
        self.expanded = 0;
        self.size.check(grid, start, goal)?;
        self.nodes.forget();
        self.heap.clear();
        self.halts.clear();
        let cells = self.size.cells() as u32;
        let (start, goal) = (self.size.number(start), self.size.number(goal));
        let mut search = Search {
            rows: grid.closed(),
            columns: grid.columns(),
            size: self.size,
            nodes: &mut self.nodes,
            heap: &mut self.heap,
            halts: &mut self.halts,
            goal: self.size.place(goal),
        };
        search.nodes.improve(start, 0, HERE);
        search.heap.put(start, 0);
        while let Some((_, cell)) = search.heap.take() {
            if cell >= cells {
                let way = search.halts.take(cell - cells);
                search.aslant(way);
                continue;
            }
            if cell == goal {
                self.trace(goal);
                return Ok(&self.path);
            }
            self.expanded += 1;
            search.go_on(cell);
        }
        Err(NoPath::CutOff)
    }

    fn expanded(&self) -> usize {
        self.expanded
    }
}

impl Search<'_> {
    /// Goes on from a cell in the ways that are worth it, after the way by which it was reached.
    fn go_on(&mut self, number: u32) {
        let here = Here { number, at: self.size.place(number), cost: self.nodes.cost(number) };
        let from = self.nodes.from(number);
        if from == HERE {
            for forward in [true, false] {
                self.along(here, here.at, true, forward);
                self.along(here, here.at, false, forward);
            }
            // The one towards the goal first: the others halt where it promises more.
            let (right, down) = (self.goal.0 >= here.at.0, self.goal.1 >= here.at.1);
            for to in [[right, down], [right, !down], [!right, down], [!right, !down]] {
                self.aslant(Aslant { from: here, at: here.at, to });
            }
            return;
        }
        let (x, y) = here.at;
        let (before_x, before_y) = self.size.place(from);
        if before_x.abs_diff(x) > before_y.abs_diff(y) {
            let forward = before_x < x;
            self.along(here, here.at, true, forward);
            for side in [true, false] {
                if is_forced(self.rows, y, x, forward, side) {
                    self.along(here, here.at, false, side);
                    self.aslant(Aslant { from: here, at: here.at, to: [forward, side] });
                }
            }
        } else {
            let forward = before_y < y;
            self.along(here, here.at, false, forward);
            for side in [true, false] {
                if is_forced(self.columns, x, y, forward, side) {
                    self.along(here, here.at, true, side);
                    self.aslant(Aslant { from: here, at: here.at, to: [side, forward] });
                }
            }
        }
    }

    /// Looks along a row or a column, from a cell that is straight aslant of `here` or `here` itself.
    #[inline(always)] // with what is known at compile time, it is half as long
    fn along(&mut self, here: Here, (x, y): (u32, u32), in_row: bool, forward: bool) {
        let found = if in_row {
            let goal = if self.goal.1 == y { self.goal.0 } else { 0 };
            next(self.rows, y, x, forward, goal).map(|x| (x, y))
        } else {
            let goal = if self.goal.0 == x { self.goal.1 } else { 0 };
            next(self.columns, x, y, forward, goal).map(|y| (x, y))
        };
        if let Some(at) = found {
            self.offer(here, at);
        }
    }

    /// Goes aslant as far as it is open, and looks along the row and the column ahead from each cell. Halts where others promise more.
    fn aslant(&mut self, way: Aslant) {
        // Made for each way of its own, it knows at each step whether bits are counted up or down.
        match way.to {
            [true, true] => self.go_aslant::<true, true>(way),
            [true, false] => self.go_aslant::<true, false>(way),
            [false, true] => self.go_aslant::<false, true>(way),
            [false, false] => self.go_aslant::<false, false>(way),
        }
    }

    fn go_aslant<const RIGHT: bool, const DOWN: bool>(&mut self, way: Aslant) {
        let Aslant { from, at: (mut x, mut y), .. } = way;
        let go = |at: u32, forward: bool| if forward { at + 1 } else { at - 1 };
        loop {
            for _ in 0..LEG {
                let (next_x, next_y) = (go(x, RIGHT), go(y, DOWN));
                let is_closed =
                    self.rows.get(next_x, y) | self.rows.get(x, next_y) | self.rows.get(next_x, next_y);
                if is_closed {
                    return;
                }
                (x, y) = (next_x, next_y);
                if (x, y) == self.goal {
                    return self.offer(from, (x, y));
                }
                self.along(from, (x, y), true, RIGHT);
                self.along(from, (x, y), false, DOWN);
            }
            let least = from.cost + octile(from.at, (x, y)) + octile((x, y), self.goal);
            if self.heap.first().is_some_and(|(key, _)| key < least)
                && let Some(number) = self.halts.keep(Aslant { at: (x, y), ..way })
            {
                return self.heap.put(self.size.cells() as u32 + number, least);
            }
        }
    }

    /// Lets a cell wait, if this way to it costs less than those known.
    #[inline]
    fn offer(&mut self, here: Here, at: (u32, u32)) {
        let number = at.1 * self.size.with_rim().0 + at.0;
        let cost = here.cost + octile(here.at, at);
        if self.nodes.improve(number, cost, here.number) {
            self.heap.put(number, cost + octile(at, self.goal));
        }
    }
}

/// Whether the way along a line past a cell opens to a side there: beside the cell before it is closed, beside itself open.
fn is_forced(lines: &Bits, line: u32, at: u32, forward: bool, side: bool) -> bool {
    let beside = if side { line + 1 } else { line - 1 };
    let before = if forward { at - 1 } else { at + 1 };
    lines.get(before, beside) && !lines.get(at, beside)
}

/// The next place along a line that is a jump point or the goal; none where the line ends before. A goal of 0 is none.
#[inline(always)]
fn next(lines: &Bits, line: u32, at: u32, forward: bool, goal: u32) -> Option<u32> {
    if forward { next_up(lines, line, at, goal) } else { next_down(lines, line, at, goal) }
}

#[inline(always)]
fn next_up(lines: &Bits, line: u32, at: u32, goal: u32) -> Option<u32> {
    let (stride, three) = (lines.stride(), lines.three(line));
    let mut i = (at / 64) as usize;
    // What lies behind does not count; of a shift by 64 nothing is left. So in the first word nothing is wanted from the one before it.
    let mut ahead = u64::MAX << (at % 64) << 1;
    let mut last = [0; 2];
    loop {
        let (one, own, other) = (three[i], three[stride + i], three[2 * stride + i]);
        let forced = (one << 1 | last[0]) & !one | (other << 1 | last[1]) & !other;
        let met = (own | forced) & ahead;
        if met != 0 {
            let bit = met.trailing_zeros();
            let place = 64 * i as u32 + bit;
            if at < goal && goal <= place {
                return Some(goal);
            }
            return (own >> bit & 1 == 0).then_some(place);
        }
        last = [one >> 63, other >> 63];
        ahead = u64::MAX;
        i += 1;
    }
}

#[inline(always)]
fn next_down(lines: &Bits, line: u32, at: u32, goal: u32) -> Option<u32> {
    let (stride, three) = (lines.stride(), lines.three(line));
    let mut i = (at / 64) as usize;
    let mut ahead = (1u64 << (at % 64)) - 1;
    let mut last = [0; 2];
    loop {
        let (one, own, other) = (three[i], three[stride + i], three[2 * stride + i]);
        let forced = (one >> 1 | last[0]) & !one | (other >> 1 | last[1]) & !other;
        let met = (own | forced) & ahead;
        if met != 0 {
            let bit = 63 - met.leading_zeros();
            let place = 64 * i as u32 + bit;
            if goal != 0 && goal < at && goal >= place {
                return Some(goal);
            }
            return (own >> bit & 1 == 0).then_some(place);
        }
        last = [one << 63, other << 63];
        ahead = u64::MAX;
        i -= 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A line with what lies beside it; `#` is closed.
    fn lines(rows: [&str; 3]) -> Bits {
        let mut bits = Bits::new(rows[0].len() as u32, 3);
        for (y, row) in rows.iter().enumerate() {
            row.bytes().enumerate().for_each(|(x, byte)| bits.set(x as u32, y as u32, byte == b'#'));
        }
        bits
    }

    #[test]
    fn what_is_met_first_along_a_line_is_where_an_obstacle_beside_it_ends() {
        let long = format!("#{}##.....#", ".".repeat(70));
        let plain = format!("#{}#", ".".repeat(77));
        let one_side = lines([&long, &plain, &plain]);
        assert_eq!(next(&one_side, 1, 3, true, 0), Some(73));
        assert_eq!(next(&one_side, 1, 77, false, 0), Some(70));
        assert_eq!(next(&one_side, 1, 73, true, 0), None, "the line ends");
        assert_eq!(next(&one_side, 1, 70, false, 0), None);
        let other_side = lines([&plain, &plain, &long]);
        assert_eq!(
            (next(&other_side, 1, 3, true, 0), next(&other_side, 1, 77, false, 0)),
            (Some(73), Some(70))
        );
        // What ends beside the first step counts, since the way comes from here.
        assert_eq!(
            (next(&other_side, 1, 72, true, 0), next(&other_side, 1, 71, false, 0)),
            (Some(73), Some(70))
        );
    }

    #[test]
    fn the_goal_is_met_before_what_lies_behind_it() {
        let plain = format!("#{}#", ".".repeat(77));
        let free = lines([&plain, &plain, &plain]);
        for (at, goal, forward) in
            [(3, 77, true), (3, 4, true), (64, 63, false), (63, 64, true), (77, 1, false)]
        {
            assert_eq!(next(&free, 1, at, forward, goal), Some(goal));
            assert_eq!(next(&free, 1, at, !forward, goal), None);
        }
    }
}
