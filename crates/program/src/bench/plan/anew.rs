//! What is planned anew after a change: D* Lite from what has changed, beside a fresh search over the changed map.

use navigation::path::{Cell, DStarLite, Jump, Path, Planner};

use super::super::outcome::Outcome;
use super::Floor;
use crate::terminal::host_now;

/// Something of so many cells to each side steps into the way.
const REACH: u32 = 1;
/// At most so many queries of a map.
const QUERIES: usize = 60;

/// On each query something steps into the way ahead of the robot: D* Lite, its own fresh search, and jump points find another way.
pub(super) fn measure(floors: &[Floor], outcome: &mut Outcome) {
    let (mut anew, mut fresh, mut exact) = (Vec::new(), Vec::new(), Vec::new());
    let mut wrong = 0;
    for floor in floors {
        let (width, height) = (floor.grid.width(), floor.grid.height());
        let (mut planner, mut other, mut jump) =
            (DStarLite::new(width, height), DStarLite::new(width, height), Jump::new(width, height));
        for query in floor.queries.iter().filter(|query| query.length.is_some()).take(QUERIES) {
            let Ok(path) = planner.plan(&floor.grid, query.start, query.goal) else { continue };
            let mut grid = floor.grid.clone();
            // A quarter of the way ahead.
            let at = path.cells()[path.cells().len() / 4];
            let beside = |at: u32| at.saturating_sub(REACH)..=at + REACH;
            let thing = beside(at.y).flat_map(|y| beside(at.x).map(move |x| Cell::new(x, y)));
            // The floor may have been inflated: what was closed stays so.
            for cell in all(width, height) {
                grid.set(cell, floor.grid.is_closed(cell));
            }
            thing
                .filter(|cell| *cell != query.start && *cell != query.goal)
                .for_each(|cell| grid.set(cell, true));
            grid.inflate(0.0);
            let begun = host_now();
            let found = planner.replan(&grid, query.start).map(Path::length);
            anew.push(begun.elapsed().as_nanos() as f64 * 1e-3);
            let begun = host_now();
            let _ = other.plan(&grid, query.start, query.goal).map(Path::length);
            fresh.push(begun.elapsed().as_nanos() as f64 * 1e-3);
            let begun = host_now();
            let expected = jump.plan(&grid, query.start, query.goal).map(Path::length);
            exact.push(begun.elapsed().as_nanos() as f64 * 1e-3);
            let is_same = match (found, expected) {
                (Ok(found), Ok(expected)) => (found - expected).abs() <= super::SAME,
                (found, expected) => found == expected,
            };
            wrong += usize::from(!is_same);
        }
    }
    outcome.figure("changed_d_star_lite", "us", anew);
    outcome.figure("changed_d_star_lite_fresh", "us", fresh);
    outcome.figure("changed_jump", "us", exact);
    outcome.note("changed: a thing of 3 × 3 cells stands in the way a quarter ahead; D* Lite plans anew from what has changed, beside its own fresh search and jump points");
    if wrong > 0 {
        outcome.note(format!("WRONG: in {wrong} of them D* Lite found another length than the fresh search"));
    }
}

fn all(width: u32, height: u32) -> impl Iterator<Item = Cell> {
    (0..height).flat_map(move |y| (0..width).map(move |x| Cell::new(x, y)))
}
