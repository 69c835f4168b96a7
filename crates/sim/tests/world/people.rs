//! People who walk, lead and get out of the way.

use super::*;

pub(super) fn led() -> WorldPlan {
    let region = |name: &str, x: f64| Region {
        name: name.into(),
        polygon: vec![
            Point::new(x, -1.0),
            Point::new(x + 1.0, -1.0),
            Point::new(x + 1.0, 1.0),
            Point::new(x, 1.0),
        ],
    };
    let leg = |x: f64, wait: i64| Leg { to: Point::new(x, 0.0), when: None, wait: Duration::secs(wait) };
    let guide = Person {
        name: "guide".into(),
        at: Point::new(5.0, 0.0),
        appears: Some("mark".into()),
        speed: 0.4,
        gap: Some(1.5),
        walk: vec![leg(7.0, 2), leg(9.0, 0)],
        carries: Some(Thing { name: "balloon".into(), ..Thing::default() }),
        ..Person::default()
    };
    WorldPlan {
        people: vec![guide],
        regions: vec![region("mark", 2.0), region("end", 7.0)],
        ..WorldPlan::default()
    }
}

#[test]
fn a_guide_appears_waits_and_leads_with_its_gap() {
    let (mut world, id) = alone(&led(), exact(), Pose::default());
    drive(&mut world, id, 0.4, 0.0, 4.9);
    assert_eq!((world.locate("guide"), world.locate("balloon")), (None, None));
    drive(&mut world, id, 0.4, 0.0, 0.2);
    assert_eq!(world.locate("guide").unwrap().0, Point::new(5.0, 0.0));
    assert!(
        (world.locate("balloon").unwrap().0.x - (5.0 - 0.25 - 0.12 - 0.05)).abs() < 1e-9,
        "held towards the robot"
    );
    world.run_until(Time::from_seconds(20.0));
    assert_eq!(world.locate("guide").unwrap().0, Point::new(5.0, 0.0), "the robot is too far away to be led");
    drive(&mut world, id, 0.4, 0.0, 4.0);
    // The robot is at 3.64 now: the guide keeps 1.5 m, to a step of either.
    let at = world.locate("guide").unwrap().0.x;
    let robot = world.truth(id).pose.x;
    assert!((at - robot - 1.5).abs() < 0.01, "{at} {robot}");
    drive(&mut world, id, 0.4, 0.0, 30.0);
    assert_eq!(world.locate("guide").unwrap().0.x, 9.0, "the walk ends at its last point");
}

/// Somebody who walks to and fro between 4 m and -4 m at 1 m/s, with a robot at a place on the way; tells how far the walk went to either side.
fn to_and_fro(robot: f64) -> (f64, f64, sim::Truth) {
    let leg = |x: f64| Leg { to: Point::new(x, 0.0), when: None, wait: Duration::ZERO };
    let person = Person {
        name: "walker".into(),
        at: Point::new(4.0, 0.0),
        speed: 1.0,
        walk: vec![leg(-4.0), leg(4.0)],
        repeat: true,
        ..Person::default()
    };
    let plan = WorldPlan { people: vec![person], ..WorldPlan::default() };
    let (mut world, id) = alone(&plan, exact(), Pose::new(robot, 0.0, 0.0));
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for i in 1..=400 {
        world.run_until(Time::from_seconds(0.1 * f64::from(i)));
        let x = world.locate("walker").expect("the walker is in the world").0.x;
        // The first five seconds are the way to the far end.
        (low, high) = (low.min(x), if i > 50 { high.max(x) } else { high });
    }
    (low, high, world.truth(id))
}

#[test]
fn people_walk_around_a_robot_in_their_way() {
    let (low, high, truth) = to_and_fro(0.0);
    // Looked at each tenth of a second.
    assert!(low < -3.89 && high > 3.89, "{low} {high}");
    assert_eq!(truth.collisions, 0);
    assert!((truth.closest - sim::POLITE).abs() < 0.011, "{}", truth.closest);
}

#[test]
fn people_turn_back_where_a_robot_stands_in_their_place() {
    let (low, high, truth) = to_and_fro(-4.0);
    assert!((-3.89..-3.0).contains(&low) && high > 3.89, "{low} {high}");
    assert_eq!(truth.collisions, 0);
    assert!(truth.closest > sim::POLITE - 0.011, "{}", truth.closest);
}
