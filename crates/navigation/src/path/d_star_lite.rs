//! D* Lite: the shortest way anew while obstacles and the robot move, from what has changed alone.
//!
//! The search goes from the goal to the robot, so that what it has found stays true while the robot moves. Each cell has what the way from it costs as far as was
//! searched (g), and what that would be by its neighbours (rhs). Where an obstacle comes or goes the two differ around it, and only from such cells the search
//! goes on:
//!
//! ```text
//!   key = [min(g, rhs) + octile(start, cell) + k_m ; min(g, rhs)]
//! ```
//!
//! k_m grows by what the robot has moved, so that keys in the heap stay lower bounds and need not be made anew. (Koenig and Likhachev 2002, "D* Lite", figure 4,
//! the optimised version.)

use super::bits::Bits;
use super::cost::{ASLANT, Cost, NEVER, STRAIGHT, octile};
use super::grid::{Cell, Grid};
use super::heap::Heap;
use super::planner::{NoPath, Planner, Size};
use super::way::Path;

/// What is known of a cell.
#[derive(Clone, Copy, Debug)]
struct Vertex {
    cost: Cost,
    /// Of the best neighbour, with the step there.
    ahead: Cost,
    round: u32,
}

const UNKNOWN: Vertex = Vertex { cost: NEVER, ahead: NEVER, round: 0 };

type Key = (Cost, Cost);

/// The shortest way to a goal that stays, while obstacles come and go and the robot moves. For a single query [`Jump`](super::Jump) is much sooner. About 65 bytes
/// a cell.
#[derive(Clone, Debug)]
pub struct DStarLite {
    size: Size,
    closed: Bits,
    vertices: Box<[Vertex]>,
    round: u32,
    heap: Heap<Key>,
    /// k_m: what the robot has moved since the search began.
    moved: Cost,
    start: u32,
    /// None before the first search, and after one whose goal was closed.
    goal: Option<u32>,
    changed: Vec<u32>,
    path: Path,
    expanded: usize,
}

impl DStarLite {
    /// Takes the memory for grids of so many columns and rows.
    pub fn new(width: u32, height: u32) -> DStarLite {
        let size = Size::new(width, height);
        let (columns, rows) = size.with_rim();
        DStarLite {
            size,
            closed: Bits::new(columns, rows),
            vertices: vec![UNKNOWN; size.cells()].into_boxed_slice(),
            round: 0,
            heap: Heap::new(size.cells()),
            moved: 0,
            start: 0,
            goal: None,
            changed: Vec::with_capacity(size.cells()),
            path: Path::with_room(size.longest()),
            expanded: 0,
        }
    }

    /// The shortest way from where the robot is now to the goal of the last [`plan`](Planner::plan), over a grid in which some cells may have been closed
    /// or opened since: it looks itself for those that were. Without a plan before there is no goal.
    pub fn replan(&mut self, grid: &Grid, start: Cell) -> Result<&Path, NoPath> {
        let goal = self.goal.ok_or(NoPath::GoalClosed)?;
        self.path.clear();
        self.expanded = 0;
        self.size.check(grid, start, self.size.cell(goal))?;
        let before = self.size.place(self.start);
        self.start = self.size.number(start);
        self.moved += octile(before, self.size.place(self.start));
        self.follow(grid);
        self.search(goal);
        self.descend(goal)
    }

    /// The cells of the last way; none where there was none.
    pub fn path(&self) -> &[Cell] {
        self.path.cells()
    }

    /// Takes over which cells are closed, and looks again at what is around each that has changed.
    fn follow(&mut self, grid: &Grid) {
        let DStarLite { size, closed, changed, .. } = self;
        changed.clear();
        closed.follow(grid.closed(), |at| changed.push(at.y * size.with_rim().0 + at.x));
        for i in 0..self.changed.len() {
            let at = self.changed[i];
            self.look(at);
            // A step past a cell aslant is one between two of its neighbours.
            for step in self.size.steps() {
                let next = at.wrapping_add_signed(step);
                let (x, y) = self.size.place(next);
                let (width, height) = self.size.with_rim();
                if (1..width - 1).contains(&x) && (1..height - 1).contains(&y) {
                    self.look(next);
                }
            }
        }
    }

    fn vertex(&self, cell: u32) -> Vertex {
        let vertex = self.vertices[cell as usize];
        if vertex.round == self.round { vertex } else { UNKNOWN }
    }

    fn key(&self, cell: u32, vertex: Vertex) -> Key {
        let least = vertex.cost.min(vertex.ahead);
        (least + octile(self.size.place(self.start), self.size.place(cell)) + self.moved, least)
    }

    /// Reckons anew what the way from a cell costs by its neighbours.
    fn look(&mut self, cell: u32) {
        if Some(cell) != self.goal {
            let ahead = self.best_step(cell).map_or(NEVER, |(cost, _)| cost);
            self.set(cell, Vertex { ahead, ..self.vertex(cell) });
        }
    }

    /// The neighbour through which the way from a cell costs least, and what it costs.
    fn best_step(&self, cell: u32) -> Option<(Cost, u32)> {
        let (x, y) = self.size.place(cell);
        if self.closed.get(x, y) {
            return None;
        }
        let best = self.around(cell).map(|(next, step)| (self.vertex(next).cost + step, next)).min();
        best.filter(|(cost, _)| *cost < NEVER)
    }

    /// The neighbours that can be stepped to, and what that costs.
    fn around(&self, cell: u32) -> impl Iterator<Item = (u32, Cost)> + use<> {
        let (x, y) = self.size.place(cell);
        let (open, steps) = (self.closed.open_around(x, y), self.size.steps());
        (0..8)
            .filter(move |way| open >> way & 1 == 1)
            .map(move |way| (cell.wrapping_add_signed(steps[way]), if way < 4 { STRAIGHT } else { ASLANT }))
    }

    /// Notes what is known of a cell; it waits where it does not agree with its neighbours.
    fn set(&mut self, cell: u32, vertex: Vertex) {
        self.vertices[cell as usize] = Vertex { round: self.round, ..vertex };
        if vertex.cost == vertex.ahead {
            self.heap.remove(cell);
        } else {
            self.heap.put(cell, self.key(cell, vertex));
        }
    }

    /// Makes cells agree with their neighbours until the start has its true cost.
    fn search(&mut self, goal: u32) {
        while let Some((key, cell)) = self.heap.first() {
            let start = self.vertex(self.start);
            if key >= self.key(self.start, start) && start.ahead <= start.cost {
                return;
            }
            let vertex = self.vertex(cell);
            let now = self.key(cell, vertex);
            if key < now {
                // The robot has moved since it began to wait.
                self.heap.put(cell, now);
                continue;
            }
            self.expanded += 1;
            if vertex.ahead < vertex.cost {
                self.set(cell, Vertex { cost: vertex.ahead, ..vertex });
                self.lower(cell, vertex.ahead, goal);
            } else {
                self.set(cell, Vertex { cost: NEVER, ..vertex });
                self.raise(cell, vertex.cost, goal);
            }
        }
    }

    /// Lets the neighbours of a cell know that the way from it costs less.
    fn lower(&mut self, cell: u32, cost: Cost, goal: u32) {
        for (next, step) in self.around(cell) {
            let vertex = self.vertex(next);
            if next != goal && cost + step < vertex.ahead {
                self.set(next, Vertex { ahead: cost + step, ..vertex });
            }
        }
    }

    /// Lets those neighbours look for another way that went over a cell, which costs more now.
    fn raise(&mut self, cell: u32, before: Cost, goal: u32) {
        for (next, step) in self.around(cell) {
            if next != goal && self.vertex(next).ahead == before + step {
                self.look(next);
            }
        }
    }

    /// Follows the potential down to the goal.
    fn descend(&mut self, goal: u32) -> Result<&Path, NoPath> {
        let mut at = self.start;
        self.path.go(self.size.cell(at));
        while at != goal {
            let Some((_, next)) = self.best_step(at) else {
                self.path.clear();
                return Err(NoPath::CutOff);
            };
            at = next;
            self.path.go(self.size.cell(at));
        }
        self.path.least = self.path.length();
        Ok(&self.path)
    }
}

impl Planner for DStarLite {
    fn plan(&mut self, grid: &Grid, start: Cell, goal: Cell) -> Result<&Path, NoPath> {
        self.path.clear();
        self.expanded = 0;
        self.goal = None;
        self.size.check(grid, start, goal)?;
        self.round = self.round.wrapping_add(1);
        if self.round == 0 {
            self.vertices.fill(UNKNOWN);
            self.round = 1;
        }
        self.closed.copy_from(grid.closed());
        self.heap.clear();
        self.moved = 0;
        let goal = self.size.number(goal);
        (self.start, self.goal) = (self.size.number(start), Some(goal));
        self.set(goal, Vertex { ahead: 0, ..UNKNOWN });
        self.search(goal);
        self.descend(goal)
    }

    fn expanded(&self) -> usize {
        self.expanded
    }
}
