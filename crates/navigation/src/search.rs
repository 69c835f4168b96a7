//! Dijkstra's search over a grid on a torus, with Dial's buckets: the costs are small whole numbers, so a ring of lists sorts them.

use crate::layer::{Layer, SIDE};

/// What a step costs, straight and aslant: 7/5 is √2 but for 1 %.
const STRAIGHT: u32 = 5;
const ASLANT: u32 = 7;
/// How many times more a step costs onto a cell with little room and out of one with too little room.
const TIGHT: u32 = 4;
const CLOSED: u32 = 8;
/// More than any step costs.
const BUCKETS: usize = (ASLANT * (TIGHT + CLOSED)) as usize + 1;
/// From so far around the start (cells) it may get out of what is closed: the body stands there, so it fits.
const AROUND: usize = 4;
/// A place in a list. A cell may wait at several costs; the search gives up where there is no place left, which no floor has reached.
const PLACES: usize = 4 * SIDE * SIDE;
const NONE: u32 = u32::MAX;

/// What may be gone over.
pub(crate) struct Floor<'a> {
    /// Where a body does not fit.
    pub(crate) closed: &'a Layer,
    /// Where it has little room.
    pub(crate) tight: &'a Layer,
    /// Where something stands.
    pub(crate) taken: &'a Layer,
    /// Where it may go at all.
    pub(crate) within: &'a Layer,
}

/// The memory of a search.
#[derive(Clone, Debug)]
pub(crate) struct Search {
    costs: Box<[u32]>,
    before: Box<[u32]>,
    /// The first place of the list of a cost, modulo the number of buckets.
    buckets: [u32; BUCKETS],
    /// A cell and the next place.
    places: Box<[(u32, u32)]>,
    used: usize,
    waiting: usize,
}

impl Search {
    pub(crate) fn new() -> Search {
        Search {
            costs: vec![NONE; SIDE * SIDE].into_boxed_slice(),
            before: vec![NONE; SIDE * SIDE].into_boxed_slice(),
            buckets: [NONE; BUCKETS],
            places: vec![(0, NONE); PLACES].into_boxed_slice(),
            used: 0,
            waiting: 0,
        }
    }

    /// The cell of `goals` for which its cost less what it is `worth` is least. Nothing is worth more than `most`, nor less than nothing; both in
    /// straight steps.
    pub(crate) fn run(
        &mut self,
        start: usize,
        floor: &Floor<'_>,
        goals: &Layer,
        most: u32,
        worth: impl Fn(usize) -> Option<u32>,
    ) -> Option<usize> {
        let mut best: Option<(u32, usize)> = None;
        let most = most * STRAIGHT;
        self.forget();
        self.offer(start, 0, NONE);
        let mut cost = 0;
        while self.waiting > 0 {
            let Some(cell) = self.take(cost) else {
                cost += 1;
                continue;
            };
            // It was found at less cost since it was put here.
            if self.costs[cell] != cost {
                continue;
            }
            if goals.get(cell)
                && let Some(worth) = worth(cell)
            {
                let price = cost + most - (worth * STRAIGHT).min(most);
                if best.is_none_or(|(least, _)| price < least) {
                    best = Some((price, cell));
                }
            }
            if best.is_some_and(|(least, _)| least <= cost) {
                break;
            }
            for (next, step) in neighbours(cell) {
                // Most have been reached at less cost already.
                if cost + step < self.costs[next]
                    && let Some(factor) = floor.factor(next, start)
                {
                    let total = cost + step * factor;
                    if total < self.costs[next] {
                        self.offer(next, total, cell as u32);
                    }
                }
            }
        }
        best.map(|(_, cell)| cell)
    }

    /// Forgets the search before, whose cells are those in its lists: mostly a small part of the floor.
    fn forget(&mut self) {
        for (cell, _) in &self.places[..self.used] {
            self.costs[*cell as usize] = NONE;
        }
        self.buckets.fill(NONE);
        (self.used, self.waiting) = (0, 0);
    }

    /// The cell before a cell on the way to it; none at the start.
    pub(crate) fn before(&self, cell: usize) -> Option<usize> {
        let before = self.before[cell];
        (before != NONE).then_some(before as usize)
    }

    /// The cost of the way to a cell that was reached, in straight steps.
    pub(crate) fn cost(&self, cell: usize) -> f64 {
        f64::from(self.costs[cell]) / f64::from(STRAIGHT)
    }

    fn offer(&mut self, cell: usize, cost: u32, before: u32) {
        let Some(place) = self.places.get_mut(self.used) else { return };
        let bucket = &mut self.buckets[cost as usize % BUCKETS];
        *place = (cell as u32, *bucket);
        *bucket = self.used as u32;
        self.used += 1;
        self.waiting += 1;
        (self.costs[cell], self.before[cell]) = (cost, before);
    }

    fn take(&mut self, cost: u32) -> Option<usize> {
        let bucket = &mut self.buckets[cost as usize % BUCKETS];
        let (cell, next) = *self.places.get(*bucket as usize)?;
        *bucket = next;
        self.waiting -= 1;
        Some(cell as usize)
    }
}

impl Floor<'_> {
    /// How many times more a step onto a cell costs; none where it cannot go.
    fn factor(&self, cell: usize, start: usize) -> Option<u32> {
        let mut factor = 1;
        if self.tight.get(cell) {
            factor += TIGHT - 1;
        }
        if !self.within.get(cell) {
            return None;
        }
        if self.closed.get(cell) {
            if self.taken.get(cell) || apart(cell, start) > AROUND {
                return None;
            }
            factor += CLOSED;
        }
        Some(factor)
    }
}

/// How many rows or columns two cells are apart, whichever is more.
fn apart(a: usize, b: usize) -> usize {
    let ring = |a: usize, b: usize| a.abs_diff(b).min(SIDE - a.abs_diff(b));
    ring(a % SIDE, b % SIDE).max(ring(a / SIDE, b / SIDE))
}

/// The eight cells around one, and what a step there costs.
fn neighbours(cell: usize) -> [(usize, u32); 8] {
    let (row, column) = (cell / SIDE, cell % SIDE);
    let [up, down] = [row + 1, row + SIDE - 1].map(|row| row % SIDE * SIDE);
    let [right, left] = [column + 1, column + SIDE - 1].map(|column| column % SIDE);
    let here = row * SIDE;
    [
        (here + right, STRAIGHT),
        (up + column, STRAIGHT),
        (here + left, STRAIGHT),
        (down + column, STRAIGHT),
        (up + right, ASLANT),
        (up + left, ASLANT),
        (down + left, ASLANT),
        (down + right, ASLANT),
    ]
}
