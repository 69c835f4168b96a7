//! Against the searches of the crate `pathfinding`.

use super::*;
use pathfinding::prelude::{bfs, dijkstra};
use proptest::prelude::*;

/// A straight step and one aslant in whole numbers, as the oracle adds them; √2 but for a part in 10⁹.
const STRAIGHT: u64 = 1_000_000_000;
const ASLANT: u64 = 1_414_213_562;

/// The open cells next to one, and what a step there costs.
fn steps(grid: &Grid, cell: Cell) -> Vec<(Cell, u64)> {
    let open = |dx: i32, dy: i32| {
        let next = Cell::new(cell.x.checked_add_signed(dx)?, cell.y.checked_add_signed(dy)?);
        (!grid.is_closed(next)).then_some(next)
    };
    let all = [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)];
    let step = |(dx, dy): (i32, i32)| {
        let beside = open(dx, 0).is_some() && open(0, dy).is_some();
        let aslant = dx != 0 && dy != 0;
        let next = open(dx, dy).filter(|_| !aslant || beside)?;
        Some((next, if aslant { ASLANT } else { STRAIGHT }))
    };
    all.into_iter().filter_map(step).collect()
}

/// The length of the shortest way (sides of a cell).
fn optimum(grid: &Grid, start: Cell, goal: Cell) -> Option<f64> {
    let (_, cost) = dijkstra(&start, |cell| steps(grid, *cell), |cell| *cell == goal)?;
    Some(cost as f64 / STRAIGHT as f64)
}

/// Every step of a path is one that the grid allows, from the start to the goal; gives its length.
fn walked(grid: &Grid, path: &Path, start: Cell, goal: Cell) -> f64 {
    assert_eq!((path.cells().first(), path.cells().last()), (Some(&start), Some(&goal)));
    let cost: u64 = path
        .cells()
        .windows(2)
        .map(|two| {
            let step = steps(grid, two[0]).into_iter().find(|(next, _)| *next == two[1]);
            step.unwrap_or_else(|| panic!("no step from {:?} to {:?}", two[0], two[1])).1
        })
        .sum();
    cost as f64 / STRAIGHT as f64
}

/// Blots on a floor, up to a maze; a start and a goal.
fn floors() -> impl Strategy<Value = (Grid, Cell, Cell)> {
    let size = (1u32..48, 1u32..40);
    (size, 0.0..2.5f64, 0.0..0.45f64).prop_flat_map(|((width, height), radius, density)| {
        let cells = (width * height) as usize;
        let density = density / (1.0 + radius * radius);
        let taken = proptest::collection::vec(0.0..1.0f64, cells);
        let cell = move || (0..width, 0..height).prop_map(|(x, y)| Cell::new(x, y));
        (taken, cell(), cell()).prop_map(move |(taken, start, goal)| {
            let mut grid = Grid::new(width, height);
            for (i, chance) in taken.into_iter().enumerate() {
                grid.set(Cell::new(i as u32 % width, i as u32 / width), chance < density);
            }
            grid.inflate(radius);
            (grid, start, goal)
        })
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn a_path_is_found_exactly_when_there_is_one((grid, start, goal) in floors()) {
        let mut field = Field::new(grid.width(), grid.height());
        let reached = |grid: &Grid| bfs(&start, |cell| steps(grid, *cell).into_iter().map(|s| s.0), |cell| *cell == goal);
        let expect = match (grid.is_closed(start), grid.is_closed(goal)) {
            (true, _) => Err(NoPath::StartClosed),
            (_, true) => Err(NoPath::GoalClosed),
            _ => reached(&grid).map(|_| ()).ok_or(NoPath::CutOff),
        };
        prop_assert_eq!(field.begin(&grid, start, goal), expect);
        prop_assert_eq!(field.best().cells().is_empty(), expect.is_err());
    }

    #[test]
    fn a_path_is_free_and_never_grows_and_is_the_shortest_at_last((grid, start, goal) in floors()) {
        let mut field = Field::new(grid.width(), grid.height());
        prop_assume!(field.begin(&grid, start, goal).is_ok());
        let optimum = optimum(&grid, start, goal).unwrap();
        let mut before = (f64::INFINITY, 0.0);
        loop {
            let now = (field.best().length(), field.best().quality());
            prop_assert!((walked(&grid, field.best(), start, goal) - now.0).abs() < 1e-6);
            prop_assert!(now.0 <= before.0 && now.1 >= before.1, "{:?} after {:?}", now, before);
            // The bound holds: no way is shorter than this.
            prop_assert!(now.1 * now.0 <= optimum + 1e-6, "{} of {} but {}", now.1, now.0, optimum);
            let refined = field.refine();
            let shorter = field.best().length() < now.0;
            prop_assert!(refined == Refined::Final || (refined == Refined::Improved) == shorter);
            before = now;
            if refined == Refined::Final {
                break;
            }
        }
        prop_assert!((field.best().length() - optimum).abs() < 1e-6);
        prop_assert!((walked(&grid, field.best(), start, goal) - optimum).abs() < 1e-6);
        prop_assert_eq!(field.best().quality(), 1.0);
        prop_assert_eq!(field.refine(), Refined::Final);
    }
}

/// A floor of rooms: walls in every sixteenth row with a gap at alternating ends.
fn winding(size: u32) -> Grid {
    let mut grid = Grid::new(size, size);
    for y in (16..size).step_by(16) {
        for x in 0..size - 10 {
            grid.set(Cell::new(if y % 32 == 0 { x } else { size - 1 - x }, y), true);
        }
    }
    grid.inflate(1.0);
    grid
}

#[test]
fn a_long_way_begins_coarse_and_gets_better_in_many_small_pieces() {
    let grid = winding(128);
    let (start, goal) = (Cell::new(3, 4), Cell::new(120, 122));
    let mut field = Field::new(128, 128);
    field.begin(&grid, start, goal).unwrap();
    let first = (field.best().length(), field.best().quality());
    let (mut pieces, mut improved) = (0, 0);
    loop {
        pieces += 1;
        match field.refine() {
            Refined::Final => break,
            Refined::Improved => improved += 1,
            Refined::Unchanged => {}
        }
    }
    let optimum = optimum(&grid, start, goal).unwrap();
    assert!((field.best().length() - optimum).abs() < 1e-6);
    assert!(first.0 > optimum + 1.0 && first.1 < 0.5, "{first:?} {optimum}");
    assert!(improved >= 3, "{improved} of {pieces}");
    // All open cells are a 60th of so many pieces.
    assert!((20..100).contains(&pieces), "{pieces}");
}

#[test]
fn a_field_is_used_again_and_knows_nothing_of_before() {
    let grid = winding(64);
    let mut field = Field::new(64, 64);
    field.begin(&grid, Cell::new(3, 4), Cell::new(60, 60)).unwrap();
    field.refine();
    let free = Grid::new(64, 64);
    field.begin(&free, Cell::new(3, 4), Cell::new(60, 60)).unwrap();
    while field.refine() != Refined::Final {}
    assert_eq!(field.best().length(), Cell::new(3, 4).octile(Cell::new(60, 60)));
    assert_eq!(field.begin(&Grid::new(64, 63), Cell::default(), Cell::default()), Err(NoPath::OtherSize));
    assert!(field.best().cells().is_empty());
    assert_eq!(field.refine(), Refined::Final);
}
