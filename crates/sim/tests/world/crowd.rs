//! Crowds: they walk for ever, get into nothing, give way or not, and what they do to a robot is theirs.

use sim::plan::{Crowd, Leg, Person, Region, Roam, Round};
use sim::{Model, RobotId, Simulator, WorldPlan};
use types::geometry::PI;
use types::{Point, Pose, Time};

use super::common::table;
use super::{alone, drive, exact};

const CROWD: &str = include_str!("../../../../worlds/crowd.toml");

fn hall(crowd: Crowd) -> WorldPlan {
    let corners = [(0.3, 0.3), (9.7, 0.3), (9.7, 7.7), (0.3, 7.7)].map(|(x, y)| Point::new(x, y));
    let mut plan = WorldPlan::hall(10.0, 8.0);
    plan.start = Pose::new(5.0, 4.0, 0.0);
    plan.regions.push(Region { name: "hall".into(), polygon: corners.to_vec() });
    plan.rounds.push(Round { at: Point::new(3.0, 4.0), radius: 0.3, height: 2.0, ..Round::default() });
    plan.crowds.push(Crowd { area: "hall".into(), ..crowd });
    plan
}

fn places(world: &Simulator) -> Vec<Point> {
    (0..world.plan().people.len()).filter_map(|k| Some(world.person(k)?.0)).collect()
}

#[test]
fn a_crowd_walks_for_ever_at_its_speeds_and_gets_into_nothing() {
    let (mut world, _) = alone(&hall(Crowd::default()), exact(), Pose::new(5.0, 4.0, 0.0));
    assert_eq!(world.plan().people.len(), 12);
    let speeds: Vec<f64> = world.plan().people.iter().map(|person| person.speed).collect();
    assert!(speeds.iter().all(|speed| (0.5..=1.5).contains(speed)), "{speeds:?}");
    let yielding = |person: &Person| person.roams.as_ref().is_some_and(|roam| roam.yields);
    assert_eq!(world.plan().people.iter().filter(|person| yielding(person)).count(), 6);
    let mut before = places(&world);
    let mut way = [0.0; 12];
    for k in 0..30_000 {
        world.step();
        let now = places(&world);
        for (i, (a, b)) in before.iter().zip(&now).enumerate() {
            let moved = a.distance(*b);
            assert!(moved <= speeds[i] * 0.01 + 1e-9, "{k}: walker {i} went {moved} m in a step");
            way[i] += moved;
            assert!(b.distance(Point::new(3.0, 4.0)) >= 0.55 - 1e-9, "{k}: in the pillar");
            assert!((0.25 - 1e-9..=9.75 + 1e-9).contains(&b.x) && (0.25 - 1e-9..=7.75 + 1e-9).contains(&b.y));
            assert!(b.distance(Point::new(5.0, 4.0)) >= 0.475 - 1e-9, "{k}: in the robot");
            for other in &now[i + 1..] {
                assert!(other.distance(*b) >= 0.5 - 1e-9, "{k}: in each other");
            }
        }
        before = now;
    }
    // In five minutes everybody has gone on for most of the time.
    for (way, speed) in way.iter().zip(&speeds) {
        assert!(*way > 0.5 * speed * 300.0, "{way} m at {speed} m/s");
    }
}

#[test]
fn people_bump_into_a_robot_that_stands_and_that_is_not_its_doing() {
    for (yields, bumped) in [(1.0, false), (0.0, true)] {
        let mut sum = 0;
        for seed in 0..3 {
            let mut world = Simulator::new(&hall(Crowd { yields, ..Crowd::default() }), seed);
            let id = world.add_robot("h1", exact(), Pose::new(5.0, 4.0, 0.0)).unwrap();
            world.run_until(Time::from_seconds(120.0));
            let truth = world.truth(id);
            assert_eq!(truth.collisions, 0, "yields {yields}, seed {seed}");
            sum += truth.bumped;
        }
        assert_eq!(sum > 0, bumped, "yields {yields}: {sum}");
    }
}

/// Somebody who walks east along y = 0 from the origin, and yields to nobody.
fn walker(world: &mut WorldPlan) {
    let corners = [(20.0, -0.1), (20.3, -0.1), (20.3, 0.1), (20.0, 0.1)].map(|(x, y)| Point::new(x, y));
    world.regions.push(Region { name: "there".into(), polygon: corners.to_vec() });
    world.people.push(Person {
        name: "walker".into(),
        speed: 1.0,
        roams: Some(Roam { area: "there".into(), yields: false }),
        ..Person::default()
    });
}

fn meets(pose: Pose, linear: f64, angular: f64) -> (u32, u32) {
    let mut plan = WorldPlan::default();
    walker(&mut plan);
    let (mut world, id) = alone(&plan, exact(), pose);
    for _ in 0..600 {
        drive(&mut world, id, linear, angular, 0.01);
        if world.truth(id).collisions + world.truth(id).bumped > 0 {
            break;
        }
    }
    (world.truth(id).collisions, world.truth(id).bumped)
}

#[test]
fn who_moves_towards_whom_decides_whose_touch_it_is() {
    assert_eq!(meets(Pose::new(4.0, 0.05, 0.0), 0.0, 0.0), (0, 1), "the robot stands");
    assert_eq!(meets(Pose::new(4.0, 0.05, 0.0), 0.3, 0.0), (0, 1), "it drives away and is overtaken");
    assert_eq!(meets(Pose::new(4.0, 0.05, PI), 0.3, 0.0), (1, 0), "it drives towards the person");
    assert_eq!(meets(Pose::new(4.0, 0.05, 0.0), 0.0, 1.0), (0, 1), "a disc that turns goes nowhere");
    assert_eq!(meets(Pose::new(4.0, 0.05, 0.0), -0.3, 0.0), (1, 0), "it backs into the person");
}

#[test]
fn a_robot_that_drives_into_somebody_who_stands_collides() {
    let person = Person { name: "p".into(), at: Point::new(2.0, 0.0), ..Person::default() };
    let plan = WorldPlan { people: vec![person], ..WorldPlan::default() };
    let (mut world, id) = alone(&plan, exact(), Pose::default());
    drive(&mut world, id, 0.4, 0.0, 6.0);
    assert_eq!((world.truth(id).collisions, world.truth(id).bumped), (1, 0));
}

#[test]
fn people_on_scripts_do_what_they_did_beside_a_crowd() {
    let script = |plan: &mut WorldPlan| {
        let walk = vec![Leg { to: Point::new(9.0, 0.8), when: None, wait: types::Duration::ZERO }];
        plan.people
            .insert(0, Person { name: "guide".into(), at: Point::new(1.0, 0.8), walk, ..Person::default() });
    };
    let (mut without, mut with) = (WorldPlan::hall(10.0, 8.0), hall(Crowd { count: 3, ..Crowd::default() }));
    script(&mut without);
    script(&mut with);
    let (mut a, mut b) = (Simulator::new(&without, 4), Simulator::new(&with, 4));
    for _ in 0..1000 {
        a.step();
        b.step();
        assert_eq!(a.person(0), b.person(0));
    }
}

#[test]
fn a_seed_gives_the_same_crowd_and_another_seed_another() {
    let mut mistakes = Vec::new();
    let plan = WorldPlan::read(&table(CROWD), &mut mistakes).unwrap_or_else(|| panic!("{mistakes:?}"));
    let run = |seed: u64| {
        let mut world = Simulator::new(&plan, seed);
        let id: RobotId = world.add_robot("r1", Model::r1(), plan.start).unwrap();
        assert_eq!(places(&world).len(), 12);
        world.run_until(Time::from_seconds(20.0));
        (places(&world), world.truth(id))
    };
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2));
}

#[test]
fn a_crowd_makes_room_where_a_robot_begins_and_its_mistakes_are_told() {
    let plan = hall(Crowd { count: 40, ..Crowd::default() });
    for seed in 0..5 {
        let mut world = Simulator::new(&plan, seed);
        assert!(world.add_robot("h1", exact(), Pose::new(8.0, 6.5, 0.0)).is_ok(), "seed {seed}");
        assert!(places(&world).iter().all(|at| at.distance(Point::new(8.0, 6.5)) >= 1.2), "seed {seed}");
    }
    let wrong = table(
        "[[people]]\narea = \"hal\"\ncount = 0\nspeed = [2, 1]\n[[region]]\nname = \"hall\"\nrect = [0, 0, 1, 1]\n",
    );
    let mut mistakes = Vec::new();
    assert_eq!(WorldPlan::read(&wrong, &mut mistakes), None);
    assert_eq!(mistakes.len(), 3, "{mistakes:?}");
}
