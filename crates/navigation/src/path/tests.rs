//! Against the searches of the crate `pathfinding`, over floors of chance.

use super::*;
use pathfinding::prelude::dijkstra;
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

/// All planners for a size of grid, with their names.
fn planners(width: u32, height: u32) -> Vec<(&'static str, Box<dyn Planner>)> {
    vec![
        ("A*", Box::new(AStar::new(width, height))),
        ("Dijkstra", Box::new(Dijkstra::new(width, height))),
        ("jump points", Box::new(Jump::new(width, height))),
        ("ARA*", Box::new(Ara::new(width, height, AraParams::default()))),
        ("D* Lite", Box::new(DStarLite::new(width, height))),
        ("field", Box::new(Field::new(width, height))),
    ]
}

/// What a planner must answer.
fn expected(grid: &Grid, start: Cell, goal: Cell) -> Result<f64, NoPath> {
    match (grid.is_closed(start), grid.is_closed(goal)) {
        (true, _) => Err(NoPath::StartClosed),
        (_, true) => Err(NoPath::GoalClosed),
        _ => optimum(grid, start, goal).ok_or(NoPath::CutOff),
    }
}

/// The answer is the expected one, and a way.
fn check(name: &str, answer: Result<&Path, NoPath>, grid: &Grid, start: Cell, goal: Cell) {
    match (answer, expected(grid, start, goal)) {
        (Ok(path), Ok(optimum)) => {
            let length = walked(grid, path, start, goal);
            assert!((length - optimum).abs() < 1e-5, "{name}: {length}, not {optimum}");
            assert!((path.length() - optimum).abs() < 1e-5 && path.quality() == 1.0, "{name}");
        }
        (answer, expect) => assert_eq!(answer.map(Path::length), expect, "{name}"),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn a_path_is_found_exactly_when_there_is_one_and_is_the_shortest((grid, start, goal) in floors()) {
        for (name, mut planner) in planners(grid.width(), grid.height()) {
            check(name, planner.plan(&grid, start, goal), &grid, start, goal);
            // The way back is as long, and nothing is left of the way there.
            check(name, planner.plan(&grid, goal, start), &grid, goal, start);
        }
    }

    #[test]
    fn dijkstra_knows_the_ways_to_all_cells((grid, start, goal) in floors()) {
        let mut dijkstra = Dijkstra::new(grid.width(), grid.height());
        prop_assume!(dijkstra.flood(&grid, start).is_ok());
        let known = dijkstra.length(goal);
        let optimum = optimum(&grid, start, goal).filter(|_| !grid.is_closed(goal));
        prop_assert!(known.is_some() == optimum.is_some());
        prop_assert!((known.unwrap_or(0.0) - optimum.unwrap_or(0.0)).abs() < 1e-5);
    }

    #[test]
    fn a_path_of_the_field_is_free_and_never_grows_and_is_the_shortest_at_last((grid, start, goal) in floors()) {
        let mut field = Field::new(grid.width(), grid.height());
        prop_assume!(field.begin(&grid, start, goal).is_ok());
        anytime(&mut field, &grid, start, goal);
    }

    #[test]
    fn a_path_of_ara_is_free_and_never_grows_and_is_the_shortest_at_last(
        (grid, start, goal) in floors(), first in 1.0..6.0f64, step in 0.02..2.0f64,
    ) {
        let mut ara = Ara::new(grid.width(), grid.height(), AraParams { first, step });
        prop_assume!(ara.begin(&grid, start, goal).is_ok());
        // What the first round proves is what it was asked for.
        prop_assert!(ara.bound().unwrap() <= first.max(1.0) + 1.0 / 256.0);
        anytime(&mut ara, &grid, start, goal);
    }

    #[test]
    fn each_path_descends_the_potential_and_the_potential_only_falls((grid, start, goal) in floors()) {
        let mut field = Field::new(grid.width(), grid.height());
        prop_assume!(field.begin(&grid, start, goal).is_ok());
        let cells: Vec<Cell> = all(&grid).collect();
        let potential = |field: &Field| cells.iter().map(|c| field.potential(*c)).collect::<Vec<_>>();
        let mut before = vec![None; cells.len()];
        let mut distance = Dijkstra::new(grid.width(), grid.height());
        distance.flood(&grid, goal).unwrap();
        loop {
            let path = field.best().cells();
            let along: Vec<f64> = path.iter().map(|cell| field.potential(*cell).unwrap()).collect();
            prop_assert!(along.windows(2).all(|two| two[1] <= two[0] - 1.0 + 1e-9), "{:?}", along);
            prop_assert!(along.last() == Some(&0.0) && (along[0] - field.best().length()).abs() < 1e-5);
            let now = potential(&field);
            for ((now, before), cell) in now.iter().zip(&before).zip(&cells) {
                // A number does not become none, and no potential is less than the way is long.
                prop_assert!(before.is_none_or(|before: f64| now.is_some_and(|now| now <= before)));
                prop_assert!(now.is_none_or(|now| now >= distance.length(*cell).unwrap() - 1e-5));
            }
            before = now;
            if field.refine() == Refined::Final {
                break;
            }
        }
    }

    #[test]
    fn after_so_many_refinements_the_field_has_that_path((grid, start, goal) in floors(), count in 0usize..9) {
        let paths = |count: usize| {
            let mut field = Field::new(grid.width(), grid.height());
            field.begin(&grid, start, goal)?;
            let mut paths = vec![field.best().cells().to_vec()];
            paths.extend((0..count).map(|_| {
                field.refine();
                field.best().cells().to_vec()
            }));
            Ok::<_, NoPath>(paths)
        };
        prop_assert_eq!(paths(count).map(|p| p[count].clone()), paths(9).map(|p| p[count].clone()));
    }

    #[test]
    fn d_star_lite_plans_anew_what_a_fresh_search_would(
        (grid, start, goal) in floors(),
        changes in proptest::collection::vec((any::<bool>(), proptest::collection::vec((0u32..48, 0u32..40), 0..12), (0u32..48, 0u32..40)), 1..6),
    ) {
        let mut grid = grid;
        let mut planner = DStarLite::new(grid.width(), grid.height());
        check("D* Lite", planner.plan(&grid, start, goal), &grid, start, goal);
        prop_assume!(!grid.is_closed(start) && !grid.is_closed(goal));
        for (taken, cells, (x, y)) in changes {
            cells.iter().for_each(|(x, y)| grid.set(Cell::new(*x, *y), taken));
            grid.inflate(0.0);
            // The robot goes along its way, or is put elsewhere.
            let there = Cell::new(x % grid.width(), y % grid.height());
            let start = if taken { there } else { planner.path().get(1).copied().unwrap_or(there) };
            check("D* Lite", planner.replan(&grid, start), &grid, start, goal);
        }
    }
}

/// Every cell of a grid.
fn all(grid: &Grid) -> impl Iterator<Item = Cell> + use<> {
    let (width, height) = (grid.width(), grid.height());
    (0..height).flat_map(move |y| (0..width).map(move |x| Cell::new(x, y)))
}

/// What holds of a planner that has begun, until it is done.
fn anytime(planner: &mut dyn Anytime, grid: &Grid, start: Cell, goal: Cell) {
    let optimum = optimum(grid, start, goal).unwrap();
    let mut before = (f64::INFINITY, 0.0);
    loop {
        let now = (planner.best().length(), planner.best().quality());
        assert!((walked(grid, planner.best(), start, goal) - now.0).abs() < 1e-5);
        assert!(now.0 <= before.0 && now.1 >= before.1, "{now:?} after {before:?}");
        // The bound holds: no way is shorter than this.
        assert!(now.1 * now.0 <= optimum + 1e-5, "{} of {} but {optimum}", now.1, now.0);
        let refined = planner.refine();
        let shorter = planner.best().length() < now.0;
        assert!(refined == Refined::Final || (refined == Refined::Improved) == shorter);
        before = now;
        if refined == Refined::Final {
            break;
        }
    }
    assert!((planner.best().length() - optimum).abs() < 1e-5);
    assert!((walked(grid, planner.best(), start, goal) - optimum).abs() < 1e-5);
    assert_eq!(planner.best().quality(), 1.0);
    assert_eq!(planner.refine(), Refined::Final);
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

/// Pillars in rows, each two cells wide.
fn pillars(size: u32) -> Grid {
    let mut grid = Grid::new(size, size);
    for cell in all(&grid) {
        grid.set(cell, cell.x % 7 < 2 && (cell.y + cell.x / 7 * 3) % 9 < 2);
    }
    grid.inflate(0.0);
    grid
}

/// Single things everywhere, so many of a hundred cells.
fn strewn(size: u32, share: f64, seed: u64) -> Grid {
    let mut grid = Grid::new(size, size);
    let chance = types::chance::Stream::new(seed, "strewn");
    for cell in all(&grid) {
        grid.set(cell, chance.uniform(u64::from(cell.y * size + cell.x)) < share);
    }
    grid.inflate(0.0);
    grid
}

#[test]
fn a_long_way_begins_rough_and_gets_better_in_small_pieces() {
    let (mut improved, mut rough, mut pieces) = (0, 0, 0);
    for seed in 0..8 {
        let grid = strewn(256, 0.35, seed);
        let [start, goal] = [5, 250].map(|at| grid.nearest_open(Cell::new(at, at), 9).unwrap());
        let Some(optimum) = optimum(&grid, start, goal) else { continue };
        let mut field = Field::new(256, 256);
        field.begin(&grid, start, goal).unwrap();
        rough += usize::from(field.best().length() > optimum + 1e-5);
        loop {
            pieces += 1;
            let before = field.expanded();
            let refined = field.refine();
            assert!(field.expanded() - before <= 256);
            match refined {
                Refined::Final => break,
                Refined::Improved => improved += 1,
                Refined::Unchanged => {}
            }
        }
        assert!((field.best().length() - optimum).abs() < 1e-4);
    }
    assert!(rough >= 4 && improved > rough && pieces > 4 * improved, "{rough} {improved} {pieces}");
}

#[test]
fn a_planner_is_used_again_and_knows_nothing_of_before() {
    let (grid, free) = (winding(64), Grid::new(64, 64));
    let (start, goal) = (Cell::new(3, 4), Cell::new(60, 60));
    for (name, mut planner) in planners(64, 64) {
        assert!(planner.plan(&grid, start, goal).unwrap().length() > 2.0 * start.octile(goal), "{name}");
        assert_eq!(planner.plan(&free, start, goal).unwrap().length(), start.octile(goal), "{name}");
        let other = planner.plan(&Grid::new(64, 63), start, Cell::default());
        assert_eq!(other.err(), Some(NoPath::OtherSize), "{name}");
        let none = planner.plan(&grid, start, start).unwrap();
        assert_eq!((none.cells(), none.length(), none.quality()), (&[start][..], 0.0, 1.0), "{name}");
    }
}

#[test]
fn jump_points_look_at_a_small_part_and_d_star_lite_at_what_has_changed() {
    let mut grid = pillars(256);
    let (start, goal) = (Cell::new(3, 4), Cell::new(250, 180));
    let mut dijkstra = Dijkstra::new(256, 256);
    dijkstra.plan(&grid, start, goal).unwrap();
    let mut jump = Jump::new(256, 256);
    jump.plan(&grid, start, goal).unwrap();
    assert!(jump.expanded() * 4 < dijkstra.expanded(), "{} {}", jump.expanded(), dijkstra.expanded());
    let mut planner = DStarLite::new(256, 256);
    let path = planner.plan(&grid, start, goal).unwrap();
    let on_the_way = path.cells()[12];
    let fresh = planner.expanded();
    grid.set(on_the_way, true);
    grid.inflate(0.0);
    check("D* Lite", planner.replan(&grid, start), &grid, start, goal);
    assert!(planner.expanded() * 10 < fresh, "{} {fresh}", planner.expanded());
    // Nothing has changed.
    planner.replan(&grid, start).unwrap();
    assert_eq!(planner.expanded(), 0);
}
