use super::*;
use proptest::prelude::*;
use types::geometry::{PI, TAU};
use types::params::ParamValue;

/// Distance from a point to a segment, by looking at many places of it.
fn by_hand(plan: &FloorPlan, at: Point) -> f64 {
    let to_segment = |a: Point, b: Point| {
        // The foot by golden section, no formula in common with the code.
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..80 {
            let (p, q) = (low + (high - low) * 0.381_966, low + (high - low) * 0.618_034);
            let far = |t: f64| (a + (b - a) * t).distance(at);
            if far(p) < far(q) { high = q } else { low = p }
        }
        (a + (b - a) * ((low + high) / 2.0)).distance(at)
    };
    let around = |corners: [Point; 4]| {
        (0..4).map(|i| to_segment(corners[i], corners[(i + 1) % 4])).fold(f64::INFINITY, f64::min)
    };
    let rectangle = |middle: Point, length: f64, depth: f64, angle: f64| {
        let corner = |x: f64, y: f64| {
            let (x, y) = (x * length / 2.0, y * depth / 2.0);
            Point::new(
                middle.x + x * angle.cos() - y * angle.sin(),
                middle.y + x * angle.sin() + y * angle.cos(),
            )
        };
        around([corner(1.0, 1.0), corner(-1.0, 1.0), corner(-1.0, -1.0), corner(1.0, -1.0)])
    };
    let walls = plan.walls.iter().map(|wall| {
        let along = wall.to - wall.from;
        match wall.thickness {
            0.0 => to_segment(wall.from, wall.to),
            thick => rectangle((wall.from + wall.to) * 0.5, along.norm(), thick, along.y.atan2(along.x)),
        }
    });
    let discs = plan.discs.iter().map(|disc| (at.distance(disc.centre) - disc.radius).abs());
    let boxes = plan
        .boxes
        .iter()
        .map(|block| rectangle(block.at.position(), block.length, block.depth, block.at.heading));
    walls.chain(discs).chain(boxes).fold(f64::INFINITY, f64::min)
}

fn floors() -> impl Strategy<Value = FloorPlan> {
    let place = || (-4.0..4.0f64, -4.0..4.0f64).prop_map(|(x, y)| Point::new(x, y));
    let thickness = prop_oneof![Just(0.0), 0.05..0.4f64];
    let wall = (place(), place(), thickness)
        .prop_filter("of a length", |(a, b, _)| a.distance(*b) > 0.05)
        .prop_map(|(from, to, thickness)| Wall { from, to, thickness });
    let disc = (place(), 0.02..1.0f64).prop_map(|(centre, radius)| Disc { centre, radius });
    let block = (place(), 0.1..2.0f64, 0.1..2.0f64, -PI..PI).prop_map(|(at, length, depth, angle)| Block {
        at: Pose::new(at.x, at.y, angle),
        length,
        depth,
    });
    let lists = (
        proptest::collection::vec(wall, 1..5),
        proptest::collection::vec(disc, 0..3),
        proptest::collection::vec(block, 0..3),
    );
    lists.prop_map(|(walls, discs, boxes)| FloorPlan { walls, discs, boxes })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn the_nearest_is_what_is_found_by_looking_at_everything(
        plan in floors(), points in proptest::collection::vec((-5.0..5.0f64, -5.0..5.0f64), 40),
    ) {
        let field = PlanField::new(&plan).unwrap();
        for (x, y) in points {
            let at = Point::new(x, y);
            let expected = by_hand(&plan, at);
            match field.nearest(at) {
                Some(found) => {
                    // More than six elements may compete where many cross.
                    let crowded = found.distance - expected;
                    prop_assert!(crowded > -1e-6 && crowded < 0.15, "{at:?}: {} for {expected}", found.distance);
                    let few = plan.elements().iter().filter(|one| one.distance(at) < expected + 0.5).count() <= 6;
                    prop_assert!(!few || crowded < 1e-6, "{at:?}: {} for {expected}", found.distance);
                    prop_assert!((found.away.norm() - 1.0).abs() < 1e-9);
                }
                None => {
                    let (low, high) = field.bounds();
                    let outside = x < low.x - 0.9 || y < low.y - 0.9 || x > high.x + 0.9 || y > high.y + 0.9;
                    prop_assert!(outside || expected > 1.0 - 1e-6, "{at:?}: none for {expected}");
                }
            }
        }
    }

    #[test]
    fn the_gradient_is_that_of_the_distance(plan in floors(), x in -5.0..5.0f64, y in -5.0..5.0f64) {
        let grid = GridField::new(Point::new(-5.0, -5.0), 0.1, (100, 100), 1.0, |x, y| (x * 7 + y * 13) % 41 == 0);
        let field = PlanField::new(&plan).unwrap();
        let h = 1e-6;
        let check = |field: &dyn Fn(Point) -> Option<Nearest>| {
            let at = Point::new(x, y);
            let all = [(h, 0.0), (-h, 0.0), (0.0, h), (0.0, -h)].map(|(dx, dy)| field(at + Point::new(dx, dy)));
            let (Some(here), [Some(right), Some(left), Some(up), Some(down)]) = (field(at), all) else { return None };
            let slope = Point::new(right.distance - left.distance, up.distance - down.distance) * (0.5 / h);
            // Where two things are equally near there is no gradient: the one-sided ones differ.
            let bend = (right.distance + left.distance + up.distance + down.distance - 4.0 * here.distance).abs();
            Some((slope.distance(here.away), bend))
        };
        let both = [check(&|at| field.nearest(at)), check(&|at| grid.nearest(at))];
        for (off, bend) in both.into_iter().flatten() {
            prop_assert!(off < 1e-4 || bend > 1e-8, "{off} {bend}");
        }
    }

    #[test]
    fn turned_by_half_a_turn_it_is_the_same_floor(plan in floors(), x in -5.0..5.0f64, y in -5.0..5.0f64) {
        let turn = |at: Point| Point::new(-at.x, -at.y);
        let turned = FloorPlan {
            walls: plan.walls.iter().map(|wall| Wall { from: turn(wall.from), to: turn(wall.to), ..*wall }).collect(),
            discs: plan.discs.iter().map(|disc| Disc { centre: turn(disc.centre), ..*disc }).collect(),
            boxes: plan.boxes.iter().map(|block| Block { at: Pose::new(-block.at.x, -block.at.y, block.at.heading), ..*block }).collect(),
        };
        let few = plan.elements().len() <= 6;
        let fields = [&plan, &turned].map(|plan| PlanField::new(plan).unwrap());
        let (one, other) = (fields[0].nearest(Point::new(x, y)), fields[1].nearest(Point::new(-x, -y)));
        if let (Some(one), Some(other), true) = (one, other, few) {
            prop_assert!((one.distance - other.distance).abs() < 1e-9);
        }
    }

    #[test]
    fn a_ray_meets_what_is_first(plan in floors(), x in -4.0..4.0f64, y in -4.0..4.0f64, bearing in -PI..PI) {
        let field = PlanField::new(&plan).unwrap();
        let (from, direction) = (Point::new(x, y), Point::polar(1.0, bearing));
        let all = plan.elements().into_iter().filter_map(|one| one.cast(from, direction)).fold(f64::INFINITY, f64::min);
        match field.cast(from, direction, 6.0) {
            Some(found) => {
                prop_assert!(found > all - 1e-6, "{found} before {all}");
                prop_assert!(by_hand(&plan, from + direction * found) < 1e-5, "nothing is there");
                // Where more than six meet in a cell the first may be missed.
                prop_assert!(plan.elements().len() > 6 || found < all + 1e-6, "{found} for {all}");
            }
            None => prop_assert!(all > 6.0 - 1e-9 || plan.elements().len() > 6, "none for {all}"),
        }
    }

    #[test]
    fn what_is_written_is_read_again(plan in floors()) {
        prop_assert_eq!(FloorPlan::from_value(&plan.to_value()), Some(plan));
    }

    #[test]
    fn a_grid_tells_the_distance_to_the_nearest_taken_cell(
        taken in proptest::collection::vec((0u32..30, 0u32..20), 1..12), x in 0u32..30, y in 0u32..20,
    ) {
        let field = GridField::new(Point::new(2.0, -3.0), 0.05, (30, 20), 9.0, |x, y| taken.contains(&(x, y)));
        let middle = |x: u32, y: u32| Point::new(2.0 + 0.05 * (f64::from(x) + 0.5), -3.0 + 0.05 * (f64::from(y) + 0.5));
        let at = middle(x, y);
        let expected = taken.iter().map(|(x, y)| middle(*x, *y).distance(at)).fold(f64::INFINITY, f64::min);
        let found = field.nearest(at).unwrap();
        prop_assert!((found.distance - expected).abs() < 1e-6, "{} for {expected}", found.distance);
    }
}

#[test]
fn a_wall_of_cells_is_met_in_the_middle_of_them_and_has_a_slope_beside() {
    let field = GridField::new(Point::default(), 0.05, (60, 60), 1.0, |x, _| x == 40);
    let wall = 40.5 * 0.05;
    for off in [0.3, 0.12, 0.03, 0.004] {
        let found = field.nearest(Point::new(wall - off, 1.2)).unwrap();
        assert!(
            (found.distance - off).abs() < 1e-6 && found.away.distance(Point::new(-1.0, 0.0)) < 1e-5,
            "{off}: {found:?}"
        );
    }
    let met = field.cast(Point::new(0.4, 1.0), Point::new(1.0, 0.0), 3.0).unwrap();
    assert!((met - (wall - 0.4)).abs() < 0.03, "{met}");
    assert_eq!(field.cast(Point::new(0.4, 1.0), Point::new(-1.0, 0.0), 3.0), None);
    assert!(field.is_free(Point::new(1.0, 1.0), 0.3) && !field.is_free(Point::new(1.9, 1.0), 0.3));
    assert!(!field.is_free(Point::new(-0.1, 1.0), 0.0), "outside nothing is known to be free");
}

#[test]
fn one_can_stand_where_nothing_is_and_nothing_is_near() {
    let mut plan = FloorPlan::room(6.0, 4.0);
    plan.boxes.push(Block { at: Pose::new(4.0, 2.0, 0.3), length: 1.0, depth: 0.6 });
    plan.walls.push(Wall { from: Point::new(2.0, 0.0), to: Point::new(2.0, 3.0), thickness: 0.2 });
    let field = PlanField::new(&plan).unwrap();
    let free = FreeFloor::new(&field, 0.2);
    // The room less a rim of 0.2 m, less the box and the wall with theirs.
    assert!((free.area() - 16.5).abs() < 0.8, "{}", free.area());
    let stream = types::chance::Stream::new(3, "free");
    for i in 0..2000 {
        let at = free.draw(stream.sample(i));
        assert!(by_hand(&plan, at) > 0.12 && !plan.is_solid(at), "{at:?}");
        assert!((0.0..6.0).contains(&at.x) && (0.0..4.0).contains(&at.y));
    }
}

#[test]
fn a_large_floor_has_larger_cells_and_is_as_exact() {
    let plan = FloorPlan::room(400.0, 300.0);
    let field = PlanField::new(&plan).unwrap();
    assert!(field.memory() < 13 << 20, "{}", field.memory());
    for i in 0..100 {
        let at = Point::polar(120.0, TAU * f64::from(i) / 100.0) + Point::new(200.0, 150.0);
        let near = Point::new(at.x, 0.3);
        assert!((field.nearest(near).unwrap().distance - 0.3).abs() < 1e-9);
        assert_eq!(field.nearest(at).is_some(), by_hand(&plan, at) <= 1.0);
    }
}

#[test]
fn a_plan_of_too_many_lines_is_refused() {
    let wall = Wall { to: Point::new(1.0, 0.0), ..Wall::default() };
    let plan = FloorPlan { walls: vec![wall; 70_000], ..FloorPlan::default() };
    assert_eq!(PlanField::new(&plan).unwrap_err(), TooManyElements { elements: 70_000 });
}

#[test]
fn what_is_wrong_in_a_file_is_said_with_its_place() {
    use types::value::{Entry, Span, Table, Value};
    let item = |numbers: &[f64], start: u32| {
        let entries = numbers.iter().map(|x| Entry::from(Value::Float(*x))).collect();
        Entry { value: Value::List(entries), at: Span { start, end: start + 1 } }
    };
    let mut table = Table::new();
    table.set(
        "walls",
        Value::List(vec![
            item(&[0.0, 0.0, 1.0], 3),
            item(&[0.0, 0.0, 1.0, 0.0], 7),
            item(&[1.0, 2.0, 1.0, 2.0], 9),
        ]),
    );
    table.set("discs", Value::List(vec![item(&[0.0, 0.0, -1.0], 20)]));
    table.set("pillars", Value::Int(3));
    let mut mistakes = Vec::new();
    let plan = FloorPlan::read(&table, &mut mistakes);
    let said: Vec<String> =
        mistakes.iter().map(|mistake| format!("{} {mistake}", mistake.at.start)).collect();
    assert_eq!(plan.walls.len(), 1);
    assert_eq!(said.len(), 4, "{said:?}");
    assert!(said[0].starts_with("3 [0.0, 0.0, 1.0] cannot be one of the walls of a floor"), "{said:?}");
    assert!(said[1].starts_with("9 a wall from [1, 2] to the same place has no length"), "{said:?}");
    assert!(said[2].starts_with("20 a disc cannot have a radius of -1 m"), "{said:?}");
    assert!(said[3].contains("there is no list of a floor \"pillars\""), "{said:?}");
}

#[test]
fn where_nothing_is_known_nobody_stands_and_what_is_near_stays_the_same() {
    let all = GridField::new(Point::default(), 0.05, (60, 60), 1.0, |x, _| x == 40);
    // What lies behind the wall was never seen.
    let seen = all.clone().known_only(|x, _| x <= 40);
    let (before, behind) = (Point::new(0.5, 1.0), Point::new(2.6, 1.0));
    assert!(all.is_free(before, 0.2) && all.is_free(behind, 0.2));
    assert!(seen.is_free(before, 0.2) && !seen.is_free(behind, 0.2));
    assert_eq!(seen.nearest(behind), all.nearest(behind));
    // Of 3 m by 3 m the wall of a cell at 2 m and what is nearer to it than 0.2 m is taken.
    let area = FreeFloor::new(&seen, 0.2).area();
    assert!((area - 1.8 * 3.0).abs() < 0.35, "{area}");
}
