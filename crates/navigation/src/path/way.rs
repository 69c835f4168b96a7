//! A way over a grid.

use super::cost::length;
use super::grid::Cell;

/// A way from cell to neighbouring cell. The memory for the longest is taken when it is made.
#[derive(Clone, Debug)]
pub struct Path {
    cells: Vec<Cell>,
    straight: u32,
    aslant: u32,
    pub(super) least: f64,
}

impl Path {
    /// With room for so many cells.
    pub(super) fn with_room(cells: usize) -> Path {
        Path { cells: Vec::with_capacity(cells), straight: 0, aslant: 0, least: 0.0 }
    }

    /// The cells from the start to the goal; none where there is no way.
    pub fn cells(&self) -> &[Cell] {
        &self.cells
    }

    /// How long it is (sides of a cell).
    pub fn length(&self) -> f64 {
        length(self.straight, self.aslant)
    }

    /// How good it is at least (0..1): no way is shorter than this share of its length. 1 where it is the shortest, 0 where there is no way.
    pub fn quality(&self) -> f64 {
        match (self.cells.len(), self.length()) {
            (0, _) => 0.0,
            (_, length) if length > 0.0 => (self.least / length).min(1.0),
            _ => 1.0,
        }
    }

    /// The cells at which it turns, its ends among them.
    pub fn corners(&self) -> impl Iterator<Item = Cell> + '_ {
        let last = self.cells.len().saturating_sub(1);
        let turns = move |i: &usize| {
            let step =
                |i: usize| (way(self.cells[i], self.cells[i + 1]), way(self.cells[i - 1], self.cells[i]));
            *i == 0 || *i == last || {
                let (after, before) = step(*i);
                after != before
            }
        };
        (0..self.cells.len()).filter(turns).map(|i| self.cells[i])
    }

    pub(super) fn clear(&mut self) {
        self.cells.clear();
        (self.straight, self.aslant) = (0, 0);
    }

    /// Goes on to a cell next to the last.
    pub(super) fn go(&mut self, next: Cell) {
        // It has room for every way; a longer one would be no way of a search.
        if self.cells.len() == self.cells.capacity() {
            return;
        }
        if let Some(last) = self.cells.last() {
            let aslant = last.x != next.x && last.y != next.y;
            self.aslant += u32::from(aslant);
            self.straight += u32::from(!aslant);
        }
        self.cells.push(next);
    }

    /// Goes on to a cell of which nothing between here and there is closed: aslant as far as it goes, then straight.
    pub(super) fn walk(&mut self, to: Cell) {
        let nearer = |from: u32, to: u32| if from < to { from + 1 } else { from - u32::from(from > to) };
        while let Some(last) = self.cells.last().copied().filter(|last| *last != to) {
            let before = self.cells.len();
            self.go(Cell::new(nearer(last.x, to.x), nearer(last.y, to.y)));
            if self.cells.len() == before {
                break;
            }
        }
    }

    /// The same, but straight as far as that is to go, then aslant.
    pub(super) fn walk_straight_first(&mut self, to: Cell) {
        let Some(last) = self.cells.last().copied() else { return };
        let (dx, dy) = (last.x.abs_diff(to.x), last.y.abs_diff(to.y));
        let toward = |from: u32, to: u32, by: u32| if from < to { from + by } else { from - by };
        let turn = if dx > dy {
            Cell::new(toward(last.x, to.x, dx - dy), last.y)
        } else {
            Cell::new(last.x, toward(last.y, to.y, dy - dx))
        };
        self.walk(turn);
        self.walk(to);
    }

    /// Leads the other way.
    pub(super) fn reverse(&mut self) {
        self.cells.reverse();
    }
}

/// From a cell to its neighbour, as columns and rows.
fn way(from: Cell, to: Cell) -> (i64, i64) {
    (i64::from(to.x) - i64::from(from.x), i64::from(to.y) - i64::from(from.y))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_walk_is_as_long_as_the_octile_distance_and_turns_once() {
        let mut path = Path::with_room(64);
        path.go(Cell::new(9, 2));
        path.walk(Cell::new(2, 5));
        assert_eq!(path.length(), Cell::new(9, 2).octile(Cell::new(2, 5)));
        assert_eq!((path.straight, path.aslant, path.cells.len()), (4, 3, 8));
        let corners: Vec<Cell> = path.corners().collect();
        assert_eq!(corners, [Cell::new(9, 2), Cell::new(6, 5), Cell::new(2, 5)]);
    }

    #[test]
    fn without_room_it_ends_and_a_single_cell_is_the_shortest_way_to_itself() {
        let mut path = Path::with_room(2);
        assert_eq!(path.quality(), 0.0);
        path.go(Cell::default());
        assert_eq!((path.quality(), path.corners().count()), (1.0, 1));
        path.walk(Cell::new(9, 9));
        assert_eq!(path.cells.len(), 2);
    }
}
