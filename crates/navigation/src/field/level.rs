//! The potential on blocks of one size: what the way from a block to the goal costs, spread from the goal towards the start.
//!
//! A* with the octile distance to the start, which is consistent: a block that was taken from the heap has its true cost, and no block
//! that still waits can be on a way that costs less than the least estimate in the heap (Hart, Nilsson and Raphael 1968).

use super::grid::Cell;
use super::length;

/// The eight neighbours, as columns and rows, the straight ones first.
const AROUND: [(i32, i32); 8] = [(1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (-1, 1), (-1, -1), (1, -1)];
/// Where a block stands that is in no heap: not yet met, or done with.
const NEW: u32 = u32::MAX;
const DONE: u32 = u32::MAX - 1;
/// The goal leads nowhere.
const HERE: u8 = 8;

/// How far a search is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Progress {
    /// Blocks are waiting.
    Working,
    /// The start has its true cost.
    Arrived,
    /// There is no way.
    Exhausted,
}

/// A search on blocks of `side` by `side` cells. Only blocks that are free all over may be gone through.
#[derive(Clone, Debug)]
pub(super) struct Level {
    /// Cells along a side of a block.
    pub(super) side: u32,
    width: u32,
    height: u32,
    free: Box<[bool]>,
    /// What the way to the goal costs (sides of a block), and at least costs from the start over here.
    cost: Box<[f64]>,
    rank: Box<[f64]>,
    /// The neighbour through which it goes.
    toward: Box<[u8]>,
    /// The blocks that wait, the one of least rank first, and where each stands there.
    heap: Box<[u32]>,
    waiting: usize,
    place: Box<[u32]>,
    start: Cell,
}

impl Level {
    /// Takes the memory for a floor of so many cells.
    pub(super) fn new(columns: u32, rows: u32, side: u32) -> Level {
        // A block that reaches beyond the rim is not free all over.
        let (width, height) = (columns / side, rows / side);
        let blocks = (width * height) as usize;
        Level {
            side,
            width,
            height,
            free: vec![false; blocks].into_boxed_slice(),
            cost: vec![0.0; blocks].into_boxed_slice(),
            rank: vec![0.0; blocks].into_boxed_slice(),
            toward: vec![HERE; blocks].into_boxed_slice(),
            heap: vec![0; blocks].into_boxed_slice(),
            waiting: 0,
            place: vec![NEW; blocks].into_boxed_slice(),
            start: Cell::default(),
        }
    }

    /// Takes over which cells are closed, in rows of `columns`.
    pub(super) fn draw(&mut self, closed: &[bool], columns: u32) {
        let (side, columns) = (self.side as usize, columns as usize);
        self.free.fill(true);
        if self.width == 0 {
            return;
        }
        let blocks = self.free.chunks_exact_mut(self.width as usize);
        for (free, rows) in blocks.zip(closed.chunks_exact(side * columns)) {
            for row in rows.chunks_exact(columns) {
                for (free, cells) in free.iter_mut().zip(row.chunks_exact(side)) {
                    *free &= !cells.contains(&true);
                }
            }
        }
    }

    /// Begins a search between two cells; whether both lie in blocks that are free.
    pub(super) fn begin(&mut self, start: Cell, goal: Cell) -> bool {
        self.place.fill(NEW);
        self.waiting = 0;
        self.start = self.block(start);
        let goal = self.block(goal);
        if !self.is_free(self.start) || !self.is_free(goal) {
            return false;
        }
        self.offer(goal, 0.0, HERE);
        true
    }

    /// Settles up to `most` blocks.
    pub(super) fn expand(&mut self, most: usize) -> Progress {
        for _ in 0..most {
            let Some(block) = self.take() else { return Progress::Exhausted };
            if block == self.start {
                return Progress::Arrived;
            }
            let cost = self.cost[self.index(block)];
            for (direction, step) in AROUND.into_iter().enumerate() {
                if let Some(next) = self.neighbour(block, step) {
                    let sides = if direction < 4 { length(1, 0) } else { length(0, 1) };
                    // The way leads back from the neighbour.
                    self.offer(next, cost + sides, opposite(direction));
                }
            }
        }
        Progress::Working
    }

    /// What a way from the start costs at least (sides of a block); nothing where none is left.
    pub(super) fn least(&self) -> Option<f64> {
        (self.waiting > 0).then(|| self.rank[self.heap[0] as usize])
    }

    /// What the way from a block costs (sides of a block), where that is known for sure.
    pub(super) fn settled(&self, block: Cell) -> Option<f64> {
        let index = self.inside(block)?;
        (self.place[index] == DONE).then(|| self.cost[index])
    }

    /// The blocks behind a settled one, down to the goal.
    pub(super) fn descent(&self, from: Cell) -> impl Iterator<Item = Cell> + '_ {
        let below = |block: Cell| {
            let step = AROUND.get(usize::from(self.toward[self.inside(block)?]))?;
            Some(moved(block, *step))
        };
        core::iter::successors(below(from), move |block| below(*block))
    }

    /// The block of a cell.
    pub(super) fn block(&self, cell: Cell) -> Cell {
        Cell::new(cell.x / self.side, cell.y / self.side)
    }

    fn index(&self, block: Cell) -> usize {
        (block.y * self.width + block.x) as usize
    }

    fn inside(&self, block: Cell) -> Option<usize> {
        (block.x < self.width && block.y < self.height).then(|| self.index(block))
    }

    fn is_free(&self, block: Cell) -> bool {
        self.inside(block).is_some_and(|index| self.free[index])
    }

    /// A free neighbour; aslant only where both corners beside the way are free.
    fn neighbour(&self, block: Cell, (dx, dy): (i32, i32)) -> Option<Cell> {
        let next = moved(block, (dx, dy));
        let corners = self.is_free(moved(block, (dx, 0))) && self.is_free(moved(block, (0, dy)));
        (self.is_free(next) && (dx == 0 || dy == 0 || corners)).then_some(next)
    }

    /// Lets a block wait at this cost, unless it is done with or was met at less.
    fn offer(&mut self, block: Cell, cost: f64, toward: u8) {
        let index = self.index(block);
        let place = match self.place[index] {
            DONE => return,
            NEW => {
                self.waiting += 1;
                self.waiting - 1
            }
            _ if self.cost[index] <= cost => return,
            place => place as usize,
        };
        self.cost[index] = cost;
        self.rank[index] = cost + block.octile(self.start);
        self.toward[index] = toward;
        self.rise(index as u32, place);
    }

    /// Takes the block of least rank.
    fn take(&mut self) -> Option<Cell> {
        let last = self.waiting.checked_sub(1)?;
        let (first, moved) = (self.heap[0], self.heap[last]);
        self.place[first as usize] = DONE;
        self.waiting = last;
        if last > 0 {
            self.sink(moved);
        }
        Some(Cell::new(first % self.width, first / self.width))
    }

    /// Of equal rank the one that is farther from the goal: it is nearer to the start.
    fn precedes(&self, a: u32, b: u32) -> bool {
        let key = |block: u32| (self.rank[block as usize], -self.cost[block as usize]);
        key(a) < key(b)
    }

    /// Puts a block where it belongs, from `place` upwards.
    fn rise(&mut self, block: u32, mut place: usize) {
        while place > 0 {
            let above = (place - 1) / 2;
            if !self.precedes(block, self.heap[above]) {
                break;
            }
            self.put(self.heap[above], place);
            place = above;
        }
        self.put(block, place);
    }

    /// Puts a block where it belongs, from the top downwards.
    fn sink(&mut self, block: u32) {
        let mut place = 0;
        loop {
            let mut below = 2 * place + 1;
            if below >= self.waiting {
                break;
            }
            if below + 1 < self.waiting && self.precedes(self.heap[below + 1], self.heap[below]) {
                below += 1;
            }
            if !self.precedes(self.heap[below], block) {
                break;
            }
            self.put(self.heap[below], place);
            place = below;
        }
        self.put(block, place);
    }

    fn put(&mut self, block: u32, place: usize) {
        self.heap[place] = block;
        self.place[block as usize] = place as u32;
    }
}

/// The neighbour that is so many columns and rows on; outside what is beyond the first wraps to where no block is.
fn moved(block: Cell, (dx, dy): (i32, i32)) -> Cell {
    Cell::new(block.x.wrapping_add_signed(dx), block.y.wrapping_add_signed(dy))
}

/// The direction that leads back.
fn opposite(direction: usize) -> u8 {
    // The straight ones are four in a circle, and so are those aslant.
    (direction / 4 * 4 + (direction + 2) % 4) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_direction_has_one_that_leads_back() {
        for (direction, (dx, dy)) in AROUND.into_iter().enumerate() {
            assert_eq!(AROUND[usize::from(opposite(direction))], (-dx, -dy));
        }
    }

    #[test]
    fn a_block_is_free_when_all_its_cells_are() {
        let mut closed = vec![false; 7 * 5];
        closed[2 * 7 + 3] = true;
        let mut level = Level::new(7, 5, 2);
        level.draw(&closed, 7);
        assert_eq!(*level.free, [true, true, true, true, false, true]);
        // The last column and row are no whole blocks.
        assert!(
            level.is_free(Cell::new(2, 0))
                && !level.is_free(Cell::new(3, 0))
                && !level.is_free(Cell::new(0, 2))
        );
        assert_eq!(level.neighbour(Cell::new(0, 0), (1, 1)), None, "the block itself is taken");
        assert_eq!(level.neighbour(Cell::new(1, 0), (1, 1)), None, "a corner is taken");
        assert_eq!(level.neighbour(Cell::new(1, 0), (1, 0)), Some(Cell::new(2, 0)));
    }

    #[test]
    fn the_heap_gives_what_waits_in_the_order_of_its_rank() {
        let mut level = Level::new(8, 8, 1);
        level.draw(&[false; 64], 8);
        assert!(level.begin(Cell::new(7, 7), Cell::new(0, 0)));
        level.take();
        let costs = [9.0, 3.0, 7.0, 1.0, 8.0, 2.0, 5.0];
        for (i, cost) in costs.into_iter().enumerate() {
            level.offer(Cell::new(i as u32 + 1, 0), cost, HERE);
        }
        // Less than before moves up, more changes nothing, and what is done with stays so.
        level.offer(Cell::new(1, 0), 0.5, HERE);
        level.offer(Cell::new(4, 0), 4.0, HERE);
        level.offer(Cell::new(0, 0), 0.0, HERE);
        let mut ranks = Vec::new();
        while let Some(least) = level.least() {
            let block = level.take().unwrap();
            assert_eq!(least, level.settled(block).unwrap() + block.octile(Cell::new(7, 7)));
            ranks.push(least);
        }
        assert_eq!(ranks.len(), 7);
        assert!(ranks.is_sorted(), "{ranks:?}");
    }
}
