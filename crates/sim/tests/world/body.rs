//! Rectangular robots: where they touch, what they press, how they are seen.

use proptest::prelude::*;
use sim::model::{Laser, Shape};
use sim::plan::{Person, Round};
use sim::{Model, RobotId, Simulator, WorldPlan};
use types::geometry::{PI, TAU, wrap};
use types::{Point, Pose};

use super::{alone, drive, exact, wall};

fn rectangle(length: f64, width: f64, ahead: f64) -> Model {
    Model { shape: Shape::Rectangle { length, width, ahead }, ..exact() }
}

/// Turns on the spot until something is touched, and gives the turn (rad).
fn turned_until_touch(world: &mut Simulator, id: RobotId, rate: f64) -> f64 {
    for _ in 0..2000 {
        drive(world, id, 0.0, rate, 0.01);
        if world.truth(id).collisions > 0 {
            break;
        }
    }
    world.truth(id).turned
}

#[test]
fn a_square_that_turns_beside_a_wall_touches_when_its_corner_reaches_it() {
    // A square of 0.4 m has corners 0.2 √2 = 0.2828 m from its middle. With the wall 0.25 m to the left of the middle the
    // corner touches where 0.2828 sin(45° + turn) = 0.25: after asin(0.25 / 0.2828) − 45° = 62.114° − 45° = 17.114°.
    let plan = WorldPlan {
        walls: vec![wall(Point::new(-3.0, 0.25), Point::new(3.0, 0.25))],
        ..WorldPlan::default()
    };
    for (rate, corner) in [(1.0, 1.0), (-1.0, -1.0), (3.7, 1.0)] {
        let (mut world, id) = alone(&plan, rectangle(0.4, 0.4, 0.0), Pose::default());
        let turn = turned_until_touch(&mut world, id, rate);
        assert!((turn.abs() - 17.114_430_742_f64.to_radians()).abs() < 1e-7, "{}", turn.to_degrees());
        // The wall is touched where the corner is: 0.2828 cos 62.114° = 0.1323 m ahead or behind.
        let bearing = (0.25f64).atan2(corner * (0.08f64 - 0.0625).sqrt()) - turn;
        let sector = (wrap(bearing).rem_euclid(TAU) / TAU * 12.0 + 0.5).floor() as u32 % 12;
        assert_eq!(world.bumper(id), 1 << sector, "{rate}");
        assert!(world.truth(id).closest < 1e-6);
    }
    // A disc of the same width turns freely.
    let disc = Model { shape: Shape::Round { radius: 0.2 }, ..exact() };
    let (mut world, id) = alone(&plan, disc, Pose::default());
    turned_until_touch(&mut world, id, 1.0);
    assert_eq!(world.truth(id).collisions, 0);
}

#[test]
fn a_rectangle_stops_with_its_front_at_the_wall() {
    for (ahead, front) in [(0.0, 0.3), (0.1, 0.4), (-0.2, 0.1)] {
        let (mut world, id) =
            alone(&WorldPlan::hall(5.0, 4.0), rectangle(0.6, 0.4, ahead), Pose::new(2.0, 2.0, 0.0));
        drive(&mut world, id, 0.4, 0.0, 10.0);
        let truth = world.truth(id);
        assert!((truth.pose.x - (5.0 - front)).abs() < 1e-8, "{ahead}: {}", truth.pose.x);
        assert_eq!((truth.collisions, truth.closest < 1e-8), (1, true));
    }
}

#[test]
fn a_corner_does_not_pass_a_thin_end_of_wall_within_a_step() {
    // The tip of a thin wall reaches 2 mm into the circle of the corners. At 20 rad/s a corner moves 57 mm a step.
    let tip = Point::new(0.0, 0.08f64.sqrt() - 0.002);
    let plan = WorldPlan { walls: vec![wall(tip, Point::new(0.0, 3.0))], ..WorldPlan::default() };
    for start in 0..40 {
        let mut model = rectangle(0.4, 0.4, 0.0);
        model.drive.max_wheel_speed = 100.0;
        let (mut world, id) = alone(&plan, model, Pose::new(0.0, 0.0, f64::from(start) * 0.002));
        drive(&mut world, id, 0.0, 20.0, 0.3);
        assert_eq!(world.truth(id).collisions, 1, "{start}");
    }
}

#[test]
fn rectangles_people_and_posts_stop_each_other() {
    let person = Person { name: "statue".into(), at: Point::new(4.0, 0.05), ..Person::default() };
    let post = Round { at: Point::new(-2.0, 0.0), radius: 0.1, height: 1.0, ..Round::default() };
    let plan = WorldPlan { people: vec![person], rounds: vec![post], ..WorldPlan::default() };
    let (mut world, id) = alone(&plan, rectangle(0.6, 0.4, 0.0), Pose::default());
    let other = world.add_robot("other", rectangle(0.6, 0.4, 0.0), Pose::new(0.0, 3.0, -PI / 2.0)).unwrap();
    drive(&mut world, other, 0.3, 0.0, 12.0);
    // The front of the other meets the side of the first: 0.3 m + 0.2 m apart.
    assert!((world.truth(other).pose.y - 0.5).abs() < 1e-8, "{:?}", world.truth(other));
    assert_eq!((world.truth(other).collisions, world.truth(id).collisions), (1, 1), "both feel a touch");
    drive(&mut world, other, -0.3, 0.0, 1.0);
    drive(&mut world, id, 0.4, 0.0, 12.0);
    assert!((world.truth(id).pose.x - (4.0 - 0.25 - 0.3)).abs() < 1e-8, "{:?}", world.truth(id));
    drive(&mut world, id, -0.4, 0.0, 20.0);
    assert!((world.truth(id).pose.x - (-2.0 + 0.1 + 0.3)).abs() < 1e-8, "{:?}", world.truth(id));
    assert_eq!(world.bumper(id), 1 << 6, "behind");
}

#[test]
fn a_rectangle_needs_room_for_its_corners_only_where_they_are() {
    let (mut world, id) =
        alone(&WorldPlan::hall(4.0, 4.0), rectangle(0.6, 0.4, 0.0), Pose::new(0.31, 2.0, 0.0));
    assert!(world.put(id, Pose::new(0.31, 2.0, PI / 4.0)).is_err(), "a corner stands in the wall");
    assert!(world.put(id, Pose::new(0.21, 2.0, PI / 2.0)).is_ok());
    assert!(world.put(id, Pose::new(0.21, 2.0, 0.0)).is_err());
    let inside = world.add_robot("h2", rectangle(0.1, 0.1, 0.0), Pose::new(0.21, 2.0, 0.3));
    assert!(inside.is_err(), "one in another");
}

#[test]
fn robots_see_the_sides_of_each_other() {
    let mut model = rectangle(0.6, 0.4, 0.1).with_laser(3, PI / 2.0);
    model.laser = model.laser.map(|laser| Laser { noise: 0.0, dropout: 0.0, ..laser });
    let (mut world, id) = alone(&WorldPlan::default(), model, Pose::default());
    world.add_robot("other", rectangle(0.8, 0.2, 0.0), Pose::new(3.0, 0.0, 0.0)).unwrap();
    let mut ranges = [0.0f32; 3];
    assert_eq!(world.scan(id, 0, &mut ranges), 3);
    assert!((ranges[1] - 2.6).abs() < 1e-6 && ranges[0] == 8.0, "{ranges:?}");
    // The sonar ahead sits on the front, 0.4 m ahead of the wheels.
    let echo = world.sonar_echo(id, 0).unwrap().unwrap();
    assert!((echo - 2.2).abs() < 1e-9, "{echo}");
}

#[test]
fn a_laser_measures_from_where_it_sits() {
    let mut model = exact().with_laser(5, PI);
    model.laser = model.laser.map(|laser| Laser {
        noise: 0.0,
        dropout: 0.0,
        x: -0.065,
        y: 0.1,
        heading: PI / 4.0,
        ..laser
    });
    let (world, id) = alone(&WorldPlan::hall(6.0, 4.0), model, Pose::new(2.0, 1.0, PI / 2.0));
    let mut ranges = [0.0f32; 5];
    assert_eq!(world.scan(id, 0, &mut ranges), 5);
    // It sits at (1.9, 0.935) and looks to 135°; its beams to 45°, 90°, 135°, 180° and 225°.
    let expected = [3.065 * 2f64.sqrt(), 3.065, 1.9 * 2f64.sqrt(), 1.9, 0.935 * 2f64.sqrt()];
    for (range, expected) in ranges.iter().zip(expected) {
        assert!((f64::from(*range) - expected).abs() < 1e-5, "{ranges:?}");
    }
}

proptest! {
    #[test]
    fn a_rectangle_that_drives_anywhere_gets_into_nothing(
        length in 0.2f64..0.8, width in 0.2f64..0.6, ahead in -0.09f64..0.09, seed in 0u64..1000
    ) {
        let mut plan = WorldPlan::hall(3.0, 3.0);
        plan.rounds.push(Round { at: Point::new(2.3, 2.2), radius: 0.15, height: 1.0, ..Round::default() });
        plan.walls.push(wall(Point::new(0.0, 2.4), Point::new(0.8, 2.4)));
        let (mut world, id) = alone(&plan, rectangle(length, width, ahead), Pose::new(1.2, 1.2, 0.0));
        let chance = sim::Stream::new(seed, "blind");
        let steps = 24;
        let mut least = f64::INFINITY;
        for k in 0..60 {
            let draw = chance.sample(k / 6);
            drive(&mut world, id, draw.between(0, -0.5, 0.6), draw.between(1, -2.5, 2.5), 0.1);
            let pose = world.truth(id).pose;
            // Points of the rim, and how far each is from the walls and the round thing.
            for (i, j) in (0..=steps).flat_map(|i| (0..=steps).map(move |j| (i, j))) {
                if i != 0 && i != steps && j != 0 && j != steps {
                    continue;
                }
                let part = |k: i32| f64::from(k) / f64::from(steps) - 0.5;
                let p = pose.transform(Point::new(ahead + part(i) * length, part(j) * width));
                let walls = p.x.min(3.0 - p.x).min(p.y).min(3.0 - p.y);
                let round = p.distance(Point::new(2.3, 2.2)) - 0.15;
                let end = p.distance(Point::new(p.x.clamp(0.0, 0.8), 2.4));
                prop_assert!(walls > -1e-8 && round > -1e-8, "{:?}", p);
                least = least.min(walls).min(round).min(end);
            }
            let closest = world.truth(id).closest;
            // Nothing that was sampled at any time was nearer than the judge says.
            prop_assert!(closest <= least + 1e-8, "{} {}", closest, least);
        }
    }
}
