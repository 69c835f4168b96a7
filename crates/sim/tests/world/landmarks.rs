//! Landmarks: who sees and hears which, from where, how well.

use sim::landmarks::Sightings;
use sim::model::{Infrared, LandmarkSensor};
use sim::plan::{Landmark, Person};
use sim::{Model, RobotId, Simulator, WorldPlan};
use types::geometry::{PI, wrap};
use types::value::Span;
use types::{Point, Pose};

use super::common::table;
use super::{alone, exact, wall};

fn tube(id: u32, x: f64, y: f64) -> Landmark {
    Landmark { name: format!("c{id}"), id, at: Point::new(x, y), ..Landmark::default() }
}

/// A sensor without noise that tells tubes apart.
fn plain() -> LandmarkSensor {
    LandmarkSensor {
        relative_noise: 0.0,
        noise: 0.0,
        bearing_noise: 0.0,
        identifies: true,
        miss: 0.0,
        ..LandmarkSensor::default()
    }
}

fn with(sensor: LandmarkSensor) -> Model {
    let infrared = Some(Infrared { miss: 0.0, ..Infrared::default() });
    Model { landmarks: Some(sensor), infrared, ..exact() }
}

fn ids(seen: &Sightings) -> Vec<u32> {
    seen.iter().map(|sighting| sighting.id).collect()
}

/// A robot before four tubes: near, in the middle, far and beside.
fn four(sensor: LandmarkSensor) -> (Simulator, RobotId) {
    let landmarks = vec![tube(1, 0.7, 0.0), tube(2, 2.0, 0.4), tube(3, 3.2, 0.0), tube(4, 0.0, 1.5)];
    alone(&WorldPlan { landmarks, ..WorldPlan::default() }, with(sensor), Pose::default())
}

#[test]
fn range_bearing_and_side_are_those_of_the_plane() {
    let landmarks = vec![tube(5, 3.0, 2.0)];
    let plan = WorldPlan { landmarks, ..WorldPlan::default() };
    for (x, y, heading, side) in [
        (1.5f64, 2.0f64, 0.1f64, 3),
        (3.0, 3.4, -PI / 2.0 + 0.2, 2),
        (4.2, 1.9, PI - 0.1, 1),
        (3.1, 0.6, PI / 2.0 - 0.3, 4),
    ] {
        let (world, id) = alone(&plan, with(plain()), Pose::new(x, y, heading));
        let seen = world.landmarks(id, 0);
        assert_eq!(ids(&seen), [5]);
        let (range, bearing) = (seen[0].known_range().unwrap(), seen[0].known_bearing().unwrap());
        assert!((range - (3.0 - x).hypot(2.0 - y)).abs() < 1e-6, "{range}");
        assert!(wrap(bearing - ((2.0 - y).atan2(3.0 - x) - heading)).abs() < 1e-6, "{bearing}");
        let heard = world.infrared(id, 0);
        assert_eq!((heard[0].id, heard[0].side), (5, side), "{x} {y}");
        assert_eq!((heard[0].known_range(), heard[0].known_bearing()), (None, None));
        // A pose fix: the robot stands where range and bearing say.
        let fix = Point::new(3.0, 2.0) - Point::polar(range, heading + bearing);
        assert!(fix.distance(Point::new(x, y)) < 1e-5);
    }
}

#[test]
fn only_what_is_in_view_is_seen_and_the_head_turns_the_view() {
    let (mut world, id) = four(plain());
    assert_eq!(ids(&world.landmarks(id, 0)), [2], "one is too near, one too far, one beside");
    assert_eq!(ids(&world.infrared(id, 0)), [1, 4], "infrared is heard all around, up to 2 m");
    world.command_head(id, 1.2, 0.0);
    (0..200).for_each(|_| world.step());
    let seen = world.landmarks(id, 0);
    assert_eq!(ids(&seen), [4]);
    assert!((seen[0].known_bearing().unwrap() - PI / 2.0).abs() < 1e-6, "bearings count from the body");
    let (mut world, id) = four(LandmarkSensor { on_head: false, ..plain() });
    world.command_head(id, 1.2, 0.0);
    (0..200).for_each(|_| world.step());
    assert_eq!(ids(&world.landmarks(id, 0)), [2]);
    let (world, id) = four(LandmarkSensor { identifies: false, ..plain() });
    assert_eq!(ids(&world.landmarks(id, 0)), [0], "all tubes look the same");
}

#[test]
fn walls_people_and_robots_hide_landmarks() {
    let landmarks = vec![tube(1, 2.5, 0.0)];
    let free = WorldPlan { landmarks, ..WorldPlan::default() };
    let (mut world, id) = alone(&free, with(plain()), Pose::default());
    assert_eq!(ids(&world.landmarks(id, 0)), [1]);
    world.add_robot("other", exact(), Pose::new(1.0, 0.05, 0.0)).unwrap();
    assert_eq!(ids(&world.landmarks(id, 0)), []);
    let screened =
        WorldPlan { walls: vec![wall(Point::new(1.0, -1.0), Point::new(1.0, 1.0))], ..free.clone() };
    let (world, id) = alone(&screened, with(plain()), Pose::default());
    assert_eq!(ids(&world.landmarks(id, 0)), []);
    let person = Person { name: "p".into(), at: Point::new(1.2, 0.1), ..Person::default() };
    let (world, id) = alone(&WorldPlan { people: vec![person], ..free }, with(plain()), Pose::default());
    assert_eq!((ids(&world.landmarks(id, 0)), ids(&world.infrared(id, 0))), (vec![], vec![]));
}

#[test]
fn noise_misses_and_mistakes_have_their_parameters() {
    let sensor = LandmarkSensor {
        relative_noise: 0.02,
        noise: 0.03,
        bearing_noise: 0.015,
        miss: 0.2,
        mistake: 0.1,
        ..plain()
    };
    let (world, id) = four(sensor);
    let n = 20_000u64;
    let (mut seen, mut wrong, mut ranges, mut bearings) = (0.0, 0.0, Vec::new(), Vec::new());
    for sample in 0..n {
        for sighting in world.landmarks(id, sample).iter() {
            seen += 1.0;
            wrong += f64::from(u8::from(sighting.id != 2));
            assert!((1..=4).contains(&sighting.id));
            ranges.push(sighting.known_range().unwrap() - 2f64.hypot(0.4));
            bearings.push(sighting.known_bearing().unwrap() - 0.4f64.atan2(2.0));
        }
    }
    let deviation = |list: &[f64]| (list.iter().map(|x| x * x).sum::<f64>() / list.len() as f64).sqrt();
    let expected = 0.03 + 0.02 * 2f64.hypot(0.4);
    assert!((deviation(&ranges) / expected - 1.0).abs() < 0.03, "{} {expected}", deviation(&ranges));
    assert!((deviation(&bearings) / 0.015 - 1.0).abs() < 0.03);
    assert!((seen / n as f64 - 0.8).abs() < 0.01 && (wrong / seen - 0.1).abs() < 0.01, "{seen} {wrong}");
    // The same sample gives the same, whoever listens to what else.
    assert_eq!(world.landmarks(id, 7), world.landmarks(id, 7));
}

#[test]
fn landmarks_of_a_file_are_numbered_named_and_solid() {
    let text = r#"
        [[landmark]]
        name = "first"
        at = [1.0, 0.0]
        facing = "90deg"
        [[landmark]]
        at = [2.0, 0.0]
        id = 7
        radius = 0.2
        infrared = false
        [[landmark]]
        name = "mark"
        at = [3.0, 0.0]
        radius = 0.0
    "#;
    let mut mistakes = Vec::new();
    let plan = WorldPlan::read(&table(text), &mut mistakes).unwrap();
    assert_eq!(plan.landmarks.iter().map(|it| it.id).collect::<Vec<_>>(), [1, 7, 8]);
    let mut world = Simulator::new(&plan, 1);
    assert_eq!(world.locate("first"), Some((Point::new(1.0, 0.0), 0.05)));
    assert!(world.add_robot("a", exact(), Pose::new(2.3, 0.0, 0.0)).is_err(), "in a tube");
    assert!(world.add_robot("b", exact(), Pose::new(3.0, 0.0, 0.0)).is_ok(), "a mark has no body");
    let goal = sim::Goal::read(
        &table(r#"stage = [{ near = "mark", distance = 0.5 }]"#),
        Span::default(),
        &plan,
        &mut mistakes,
    );
    assert!(goal.is_some(), "{mistakes:?}");
    let twice = table("[[landmark]]\nat = [0, 0]\n[[landmark]]\nid = 1\nat = [1, 0]\n");
    assert_eq!(WorldPlan::read(&twice, &mut mistakes), None);
    assert!(mistakes[0].to_string().contains("two landmarks have the number 1"), "{mistakes:?}");
}
