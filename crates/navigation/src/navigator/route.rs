//! The way to the goal through what is known: the search of Hart, Nilsson and Raphael (A*) over the cells, where a step costs more the
//! nearer something stands, and a smoothing of what it finds.

use types::Point;

use super::surroundings::{CELL, FAR, SIDE, Surroundings};

/// The most points of a way.
pub(super) const POINTS: usize = 1024;
/// What a step costs in the open, straight and aslant: 7/5 is √2 but for 1 %.
const STRAIGHT: u32 = 50;
const ASLANT: u32 = 70;
/// How many times more a step costs where the robot just fits.
const TIGHT: f64 = 4.0;
/// How many times more a step costs that leads out of where the robot does not fit.
const OUT: u32 = 10;
/// From so far around the start (cells) it may come out of there: the body stands there, so it fits.
const AROUND: usize = 8;
/// More than any step changes the cost of a way and what is left of it.
const BUCKETS: usize = 2048;
/// A cell may wait at several costs.
const PLACES: usize = 4 * SIDE * SIDE;
const NONE: u32 = u32::MAX;
/// So much dearer may the old way be than a new one and be kept: else it would go to and fro between two that are equally good.
const LOYALTY: f64 = 1.1;
/// A way that ends at the border of what is known is not kept when it is shorter than this (m).
const LONG: f64 = 5.0;
/// Nor is one that the robot is farther away from than this (m): it has overshot it.
const BESIDE: f64 = 0.25;
/// Rounds of smoothing.
const SMOOTHING: usize = 24;

/// How near to what stands a way may lead.
#[derive(Clone, Copy, Debug)]
pub(super) struct Room {
    /// Nearer than this it shall not lead (m).
    pub(super) least: f64,
    /// Nearer than this it does not fit (m): so near a way leads where there is no other.
    pub(super) tightest: f64,
    /// From here on more room is no better (m), at most [`FAR`].
    pub(super) plenty: f64,
}

/// A way, and the memory of the search for it.
#[derive(Clone, Debug)]
pub(super) struct Route {
    room: Room,
    /// Nearer than this the way of now does not lead (m).
    least: f64,
    /// What a step onto a cell costs, by its distance to what stands in hundredths of [`FAR`].
    factors: [f32; 101],
    costs: Box<[u32]>,
    before: Box<[u32]>,
    buckets: Box<[u32]>,
    places: Box<[(u32, u32)]>,
    used: usize,
    waiting: usize,
    points: Vec<Point>,
    fresh: Vec<Point>,
    spare: Vec<Point>,
    goal: Point,
}

impl Route {
    pub(super) fn new(room: Room) -> Route {
        let factor = |i: usize| {
            let distance = i as f64 / 100.0 * FAR;
            let lack = ((room.plenty - distance) / (room.plenty - room.least)).clamp(0.0, 1.0);
            (1.0 + TIGHT * lack * lack) as f32
        };
        Route {
            room,
            least: room.least,
            factors: std::array::from_fn(factor),
            costs: vec![NONE; SIDE * SIDE].into_boxed_slice(),
            before: vec![NONE; SIDE * SIDE].into_boxed_slice(),
            buckets: vec![NONE; BUCKETS].into_boxed_slice(),
            places: vec![(0, NONE); PLACES].into_boxed_slice(),
            used: 0,
            waiting: 0,
            points: Vec::with_capacity(POINTS),
            fresh: Vec::with_capacity(POINTS),
            spare: Vec::with_capacity(POINTS),
            goal: Point::default(),
        }
    }

    /// The way, from next to the robot to the goal or the border of what is known; empty where there is none.
    pub(super) fn points(&self) -> &[Point] {
        &self.points
    }

    pub(super) fn forget(&mut self) {
        self.points.clear();
    }

    /// Plans from `start` to `goal`. The way before is kept if it is still open and hardly dearer.
    pub(super) fn plan(&mut self, around: &Surroundings, start: Point, goal: Point) {
        if goal.distance(self.goal) > CELL {
            self.points.clear();
            self.goal = goal;
        }
        let found = [self.room.least, self.room.tightest].into_iter().find_map(|least| {
            self.least = least;
            self.search(around, start, goal)
        });
        let Some(cost) = found else {
            self.points.clear();
            return;
        };
        self.trim(start);
        let old = self.cost(around).filter(|_| self.leads_on(around, start));
        if old.is_none_or(|old| old > cost * LOYALTY) {
            std::mem::swap(&mut self.points, &mut self.fresh);
        }
        self.smooth(around);
    }

    /// Searches, and gives what the way costs (m of open ground).
    fn search(&mut self, around: &Surroundings, start: Point, goal: Point) -> Option<f64> {
        let from = around.cell(start)?;
        let target = around.cell(goal);
        let towards = around.place(goal);
        let ahead = |cell: usize| left(cell, towards);
        self.forget_search();
        self.costs[from] = 0;
        self.before[from] = NONE;
        self.offer(from, ahead(from));
        let mut total = ahead(from);
        while self.waiting > 0 {
            let Some(cell) = self.take(total) else {
                total += 1;
                continue;
            };
            let cost = self.costs[cell];
            if cost + ahead(cell) != total {
                continue;
            }
            if Some(cell) == target || Surroundings::is_at_border(cell) {
                self.trace(around, cell, target.map(|_| goal));
                return self.fresh_cost(around).or(Some(f64::from(total) / f64::from(STRAIGHT) * CELL));
            }
            for (next, step) in neighbours(cell) {
                if cost + step >= self.costs[next] {
                    continue;
                }
                let Some(factor) = self.factor(around, next, from) else { continue };
                let reached = cost + (step as f32 * factor) as u32;
                if reached < self.costs[next] {
                    self.costs[next] = reached;
                    self.before[next] = cell as u32;
                    self.offer(next, reached + ahead(next));
                }
            }
        }
        None
    }

    /// How many times more a step onto a cell costs; none where the robot does not fit.
    fn factor(&self, around: &Surroundings, cell: usize, start: usize) -> Option<f32> {
        let distance = around.distance(cell);
        if distance >= self.least {
            return Some(self.by_distance(distance));
        }
        let apart = (cell % SIDE).abs_diff(start % SIDE).max((cell / SIDE).abs_diff(start / SIDE));
        (apart <= AROUND && !around.is_taken(cell)).then_some(OUT as f32)
    }

    fn by_distance(&self, distance: f64) -> f32 {
        self.factors[((distance / FAR * 100.0) as usize).min(100)]
    }

    fn trace(&mut self, around: &Surroundings, end: usize, goal: Option<Point>) {
        self.fresh.clear();
        self.fresh.extend(goal);
        let mut cell = end;
        while self.fresh.len() < POINTS {
            self.fresh.push(around.middle(cell));
            match self.before[cell] {
                NONE => break,
                before => cell = before as usize,
            }
        }
        self.fresh.reverse();
    }

    /// Drops what of the way lies behind the robot.
    fn trim(&mut self, start: Point) {
        let near = |i: &usize| self.points[*i].distance(start);
        // Only its beginning can lie behind.
        let ahead = self.points.len().min(40);
        if let Some(nearest) = (0..ahead).min_by(|a, b| near(a).total_cmp(&near(b))) {
            self.points.drain(..nearest);
        }
    }

    /// Whether the way begins at the robot and leads to the goal, or to the border of what is known while the goal is beyond.
    fn leads_on(&self, around: &Surroundings, start: Point) -> bool {
        let (Some(first), Some(last)) = (self.points.first(), self.points.last()) else { return false };
        if first.distance(start) > BESIDE {
            return false;
        }
        last.distance(self.goal) < CELL || around.cell(self.goal).is_none() && last.distance(start) > LONG
    }

    /// What the way costs (m of open ground); none if it is shut.
    fn cost(&self, around: &Surroundings) -> Option<f64> {
        self.cost_of(around, &self.points)
    }

    fn fresh_cost(&self, around: &Surroundings) -> Option<f64> {
        self.cost_of(around, &self.fresh)
    }

    fn cost_of(&self, around: &Surroundings, points: &[Point]) -> Option<f64> {
        let last = points.last()?;
        let mut cost = last.distance(self.goal);
        for (i, pair) in points.windows(2).enumerate() {
            let distance = around.distance_at(pair[1]);
            // Where it is now the robot stands, so it fits.
            if distance < self.least && i > AROUND {
                return None;
            }
            cost += pair[0].distance(pair[1]) * f64::from(self.by_distance(distance));
        }
        Some(cost)
    }

    /// Pulls the corners straight, where that leads no nearer to anything than there is plenty of room.
    fn smooth(&mut self, around: &Surroundings) {
        for _ in 0..SMOOTHING {
            self.spare.clear();
            self.spare.extend_from_slice(&self.points);
            for i in 1..self.points.len().saturating_sub(1) {
                let (before, here, after) = (self.spare[i - 1], self.spare[i], self.spare[i + 1]);
                let middle = (before + after) * 0.5;
                let moved = here + (middle - here) * 0.7;
                let (old, new) = (around.distance_at(here), around.distance_at(moved));
                if new >= old - 1e-9 || new >= self.room.plenty * 0.6 {
                    self.points[i] = moved;
                }
            }
        }
    }

    fn forget_search(&mut self) {
        for (cell, _) in &self.places[..self.used] {
            self.costs[*cell as usize] = NONE;
        }
        self.buckets.fill(NONE);
        (self.used, self.waiting) = (0, 0);
    }

    fn offer(&mut self, cell: usize, total: u32) {
        let Some(place) = self.places.get_mut(self.used) else { return };
        let bucket = &mut self.buckets[total as usize % BUCKETS];
        *place = (cell as u32, *bucket);
        *bucket = self.used as u32;
        self.used += 1;
        self.waiting += 1;
    }

    fn take(&mut self, total: u32) -> Option<usize> {
        let bucket = &mut self.buckets[total as usize % BUCKETS];
        let (cell, next) = *self.places.get(*bucket as usize)?;
        *bucket = next;
        self.waiting -= 1;
        Some(cell as usize)
    }
}

/// What is left at least from a cell to the column and row of the goal, which may lie outside of the square.
fn left(cell: usize, (column, row): (i32, i32)) -> u32 {
    let x = column.abs_diff((cell % SIDE) as i32);
    let y = row.abs_diff((cell / SIDE) as i32);
    let (long, short) = if x > y { (x, y) } else { (y, x) };
    (long - short) * STRAIGHT + short * ASLANT
}

/// The eight cells around one that is not at the border, and what a step there costs.
fn neighbours(cell: usize) -> [(usize, u32); 8] {
    [
        (cell + 1, STRAIGHT),
        (cell + SIDE, STRAIGHT),
        (cell - 1, STRAIGHT),
        (cell - SIDE, STRAIGHT),
        (cell + SIDE + 1, ASLANT),
        (cell + SIDE - 1, ASLANT),
        (cell - SIDE - 1, ASLANT),
        (cell - SIDE + 1, ASLANT),
    ]
}
