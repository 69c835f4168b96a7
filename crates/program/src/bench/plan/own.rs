//! Maps of our own, for where there are no others: the same on every machine.

use navigation::path::{Cell, Grid};
use types::chance::Stream;

use super::peer::Peer;
use super::{Floor, Query};

/// Columns and rows of a map, and queries on it.
const SIDE: u32 = 384;
const QUERIES: usize = 60;

/// What is drawn for all maps.
const SEED: u64 = 1;

/// What draws a floor.
type Draw = dyn Fn(&mut Grid, Stream);

/// The maps with their queries; smaller and fewer where little is to be measured.
pub(super) fn floors(shorter: usize) -> Vec<Floor> {
    let (side, queries) = if shorter > 100 { (48, 4) } else { (SIDE, (QUERIES / shorter).max(10)) };
    let strewn = |grid: &mut Grid, chance: Stream| strew(grid, chance, 0.25, 1);
    let boxes = |grid: &mut Grid, chance: Stream| {
        strew(grid, chance, 0.012, 5);
        grid.inflate(2.5);
    };
    let kinds: [(&str, &Draw); 4] =
        [("strewn", &strewn), ("boxes", &boxes), ("rooms", &rooms), ("caves", &caves)];
    let floor = |(name, draw): &(&str, &Draw)| {
        let mut grid = Grid::new(side, side);
        draw(&mut grid, Stream::new(SEED, name));
        let queries = queries_of_chance(&grid, name, queries);
        Floor { name: (*name).to_owned(), grid, queries }
    };
    kinds.iter().map(floor).collect()
}

/// Queries between open cells, with what the other system says of their lengths.
pub(super) fn queries_of_chance(grid: &Grid, name: &str, count: usize) -> Vec<Query> {
    let peer = Peer::new(grid);
    let chance = Stream::new(SEED, name).sample(1);
    let cell = |i: u64| {
        let at = |i: u64, size: u32| chance.index(i, size as usize) as u32;
        Cell::new(at(2 * i, grid.width()), at(2 * i + 1, grid.height()))
    };
    // A map on which hardly anything is open has fewer.
    let open = (0..200 * count as u64).map(cell).filter(|cell| !grid.is_closed(*cell));
    let open: Vec<Cell> = open.take(2 * count).collect();
    let query = |two: &[Cell]| {
        let (start, goal) = (two[0], two[1]);
        Query { start, goal, length: peer.length(start, goal) }
    };
    open.chunks_exact(2).map(query).collect()
}

/// Things of so many cells to a side, at so many of a hundred cells.
fn strew(grid: &mut Grid, chance: Stream, share: f64, side: u32) {
    let width = grid.width();
    for (i, cell) in all(grid).enumerate().collect::<Vec<_>>() {
        if chance.uniform(i as u64) < share {
            for beside in 0..side * side {
                grid.set(Cell::new((cell.x + beside % side).min(width), cell.y + beside / side), true);
            }
        }
    }
    grid.inflate(0.0);
}

/// Rooms of 24 cells with a door of three in each wall, here and there none.
fn rooms(grid: &mut Grid, chance: Stream) {
    const ROOM: u32 = 24;
    for cell in all(grid).collect::<Vec<_>>() {
        // A wall to the left of each room and one above it; its door is somewhere in it.
        let wall = |across: u32, along: u32, which: u64| {
            let number = u64::from(across / ROOM * 4096 + along / ROOM) * 2 + which;
            let door = 2 + chance.index(2 * number, ROOM as usize - 6) as u32;
            let is_shut = chance.uniform(2 * number + 1) < 0.15;
            across.is_multiple_of(ROOM) && (is_shut || !(door..door + 3).contains(&(along % ROOM)))
        };
        grid.set(cell, wall(cell.x, cell.y, 0) || wall(cell.y, cell.x, 1));
    }
    grid.inflate(0.0);
}

/// Caves: what is left where, four times, each cell becomes like most of those around it.
fn caves(grid: &mut Grid, chance: Stream) {
    let cells: Vec<Cell> = all(grid).collect();
    for (i, cell) in cells.iter().enumerate() {
        grid.set(*cell, chance.uniform(i as u64) < 0.43);
    }
    for _ in 0..4 {
        let before = grid.clone();
        for cell in &cells {
            let around = (0..9u32).filter(|i| {
                let (x, y) =
                    (cell.x.wrapping_add(i % 3).wrapping_sub(1), cell.y.wrapping_add(i / 3).wrapping_sub(1));
                before.is_taken(Cell::new(x, y))
            });
            grid.set(*cell, around.count() >= 5);
        }
    }
    grid.inflate(0.0);
}

fn all(grid: &Grid) -> impl Iterator<Item = Cell> + use<> {
    let (width, height) = (grid.width(), grid.height());
    (0..height).flat_map(move |y| (0..width).map(move |x| Cell::new(x, y)))
}
