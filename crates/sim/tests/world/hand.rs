//! What a hand does to a running world: things come and go, robots are pushed, slip and are carried.

use proptest::prelude::*;
use sim::camera::Canvas;
use sim::hand::{HandError, MOST_ADDED, Standing};
use sim::model::{Laser, Shape};
use sim::{Colour, Simulator, WorldPlan};
use types::geometry::{PI, TAU};
use types::{Duration, Name, Point, Pose};

use super::{alone, drive, exact};

fn thing(name: &str, length: f64, width: f64, pose: Pose) -> Standing {
    let shape = Shape::Rectangle { length, width, ahead: 0.0 };
    Standing { name: Name::new(name), shape, pose, height: 1.0, colour: Colour([200, 20, 20]) }
}

#[test]
fn a_wall_that_is_put_in_the_way_is_seen_heard_and_stops_the_robot() {
    let mut model = exact().with_laser(1, 0.0);
    model.laser = model.laser.map(|laser| Laser { noise: 0.0, dropout: 0.0, ..laser });
    let (mut world, id) = alone(&WorldPlan::hall(10.0, 6.0), model, Pose::new(2.0, 3.0, 0.0));
    let (mut range, mut picture) = ([0.0f32], vec![0u8; 320 * 240 * 3]);
    let sees = |world: &Simulator, picture: &mut Vec<u8>| {
        world.render(id, 0, &mut Canvas::default(), picture).unwrap();
        picture.chunks_exact(3).filter(|p| p[0] > 60 && p[1] < 40).count()
    };
    world.scan(id, 0, &mut range);
    assert_eq!((range[0], sees(&world, &mut picture)), (8.0, 0));
    world.add(thing("wall", 0.1, 2.0, Pose::new(4.0, 3.0, 0.0))).unwrap();
    world.scan(id, 0, &mut range);
    assert!((range[0] - 1.95).abs() < 1e-6, "{range:?}");
    assert!((world.sonar_echo(id, 0).unwrap().unwrap() - 1.725).abs() < 1e-9);
    assert!(sees(&world, &mut picture) > 2000);
    assert_eq!(world.snapshot().added.len(), 1);
    drive(&mut world, id, 0.5, 0.0, 6.0);
    assert!((world.truth(id).pose.x - (3.95 - 0.225)).abs() < 1e-8);
    assert_eq!((world.truth(id).collisions, world.truth(id).bumped), (1, 0), "it drove into it by itself");
    world.remove("wall").unwrap();
    drive(&mut world, id, 0.5, 0.0, 2.0);
    assert!(world.truth(id).pose.x > 4.5, "the way is free again");
    assert_eq!(world.snapshot().added.len(), 0);
}

#[test]
fn what_cannot_be_done_is_refused_with_the_reason_and_nothing_changes() {
    let (mut world, id) = alone(&WorldPlan::hall(10.0, 6.0), exact(), Pose::new(2.0, 3.0, 0.0));
    let free = Pose::new(6.0, 3.0, 0.3);
    world.add(thing("a", 1.0, 0.1, free)).unwrap();
    let before = world.clone();
    let refused = |world: &mut Simulator, thing: Standing| world.add(thing).unwrap_err();
    assert_eq!(refused(&mut world, thing("", 1.0, 0.1, free)), HandError::NoName);
    assert_eq!(refused(&mut world, thing("a", 1.0, 0.1, free)), HandError::NameTaken(Name::new("a")));
    assert_eq!(refused(&mut world, thing("h1", 1.0, 0.1, free)), HandError::NameTaken(Name::new("h1")));
    assert_eq!(refused(&mut world, thing("b", 0.0, 0.1, free)), HandError::Number("size"));
    assert_eq!(refused(&mut world, thing("b", f64::NAN, 0.1, free)), HandError::Number("size"));
    assert_eq!(
        refused(&mut world, thing("b", 1.0, 0.1, Pose::new(1e9, 0.0, 0.0))),
        HandError::Number("place")
    );
    let corner = thing("b", 1.0, 1.0, Pose::new(2.5, 3.5, PI / 4.0));
    assert_eq!(refused(&mut world, corner), HandError::Within(Name::new("h1")));
    assert_eq!(refused(&mut world, corner).to_string(), "it would stand in h1");
    assert_eq!(world.remove("nobody"), Err(HandError::NoSuch(Name::new("nobody"))));
    assert_eq!(world.relocate("a", Pose::new(2.1, 3.0, 0.0)), Err(HandError::Within(Name::new("h1"))));
    assert!(matches!(world.relocate("h1", free), Err(HandError::NotFree(_))));
    assert_eq!(world.push(id, f64::NAN, 0.0, 0.0), Err(HandError::Number("push")));
    assert_eq!(world.push(id, 3.0, 0.0, 0.0), Err(HandError::Number("push")));
    assert_eq!(world.slip(id, 1.1, 0.0, Duration::secs(1)), Err(HandError::Number("share")));
    assert_eq!((world.truth(id), world.added()), (before.truth(id), before.added()));
    for k in 1..MOST_ADDED {
        world.add(thing(&format!("t{k}"), 0.1, 0.1, free)).unwrap();
    }
    assert_eq!(world.add(thing("more", 0.1, 0.1, free)), Err(HandError::Full));
    world.remove("t3").unwrap();
    assert_eq!(world.add(thing("more", 0.1, 0.1, free)), Ok(()));
}

#[test]
fn a_push_moves_the_robot_and_its_wheels_count_nothing_of_it() {
    let (mut world, id) = alone(&WorldPlan::hall(10.0, 6.0), exact(), Pose::new(2.0, 3.0, PI / 2.0));
    assert_eq!(world.push(id, 0.5, 0.2, 0.3), Ok(1.0));
    let truth = world.truth(id);
    assert!(truth.pose.position().distance(Point::new(1.8, 3.5)) < 1e-12, "{:?}", truth.pose);
    assert!((truth.pose.heading - (PI / 2.0 + 0.3)).abs() < 1e-12 && (truth.turned - 0.3).abs() < 1e-12);
    assert_eq!((world.ticks(id), truth.distance, truth.bumped), ([0, 0], 0.0, 0));
    // Pushed against the wall on its left it goes as far as that.
    world.put(id, Pose::new(1.0, 3.0, PI / 2.0)).unwrap();
    let part = world.push(id, 0.0, 1.0, 0.0).unwrap();
    assert!((part - 0.775).abs() < 1e-8, "{part}");
    assert_eq!((world.truth(id).collisions, world.truth(id).bumped, world.bumper(id)), (0, 1, 1 << 3));
    world.step();
    assert_eq!((world.truth(id).collisions, world.truth(id).bumped), (0, 1), "the touch goes on");
}

#[test]
fn a_wheel_that_slips_loses_its_share_of_the_way_and_counts_on() {
    let (mut world, id) = alone(&WorldPlan::hall(20.0, 6.0), exact(), Pose::new(2.0, 3.0, 0.0));
    world.slip(id, 0.25, 0.25, Duration::secs(2)).unwrap();
    drive(&mut world, id, 0.5, 0.0, 4.0);
    // Two seconds at three quarters of the speed, and two at all of it.
    assert!((world.truth(id).pose.x - (2.0 + 0.75 + 1.0)).abs() < 1e-9, "{}", world.truth(id).pose.x);
    let counted = world.ticks(id)[0] as f64 / 2000.0 * TAU * 0.075;
    assert!((counted - 2.0).abs() < 1e-3, "{counted}");
    // One wheel alone bends the way: over 1 m of the other it falls back by half a metre on an axle of 0.36 m.
    let before = world.truth(id).turned;
    world.slip(id, 0.5, 0.0, Duration::secs(2)).unwrap();
    drive(&mut world, id, 0.5, 0.0, 2.0);
    assert!((world.truth(id).turned - before - 0.5 / 0.36).abs() < 1e-9);
}

#[test]
fn a_robot_that_is_carried_away_wakes_up_elsewhere() {
    let (mut world, id) = alone(&WorldPlan::hall(10.0, 6.0), exact(), Pose::new(2.0, 3.0, 0.0));
    drive(&mut world, id, 0.5, 0.0, 1.0);
    let ticks = world.ticks(id);
    world.relocate("h1", Pose::new(7.0, 2.0, 1.0)).unwrap();
    assert_eq!((world.truth(id).pose, world.ticks(id)), (Pose::new(7.0, 2.0, 1.0), ticks));
}

proptest! {
    #[test]
    fn whatever_hands_do_no_robot_gets_into_anything(seed in 0u64..10_000) {
        let (mut world, id) = alone(&WorldPlan::hall(4.0, 4.0), exact(), Pose::new(2.0, 2.0, 0.0));
        let again = world.clone();
        let play = |mut world: Simulator| {
            let chance = sim::Stream::new(seed, "hands");
            for k in 0..40 {
                let draw = chance.sample(k);
                let name = format!("t{}", draw.index(0, 4));
                let pose = Pose::new(draw.between(1, 0.0, 4.0), draw.between(2, 0.0, 4.0), draw.between(3, -PI, PI));
                match draw.index(4, 6) {
                    0 | 1 => drop(world.add(thing(&name, draw.between(5, 0.05, 1.0), 0.1, pose))),
                    2 => drop(world.remove(&name)),
                    3 => drop(world.relocate(&name, pose)),
                    4 => drop(world.push(id, draw.between(5, -1.0, 1.0), draw.between(6, -1.0, 1.0), pose.heading)),
                    _ => drop(world.slip(id, draw.uniform(5), draw.uniform(6), Duration::millis(300))),
                }
                drive(&mut world, id, draw.between(7, -0.3, 0.5), draw.between(8, -1.0, 1.0), 0.2);
                let at = world.truth(id).pose.position();
                let wall = at.x.min(4.0 - at.x).min(at.y).min(4.0 - at.y);
                assert!(wall >= 0.225 - 1e-8, "in a wall: {wall}");
                for thing in world.added().iter().flatten() {
                    let Shape::Rectangle { length, width, .. } = thing.shape else { continue };
                    let local = thing.pose.inverse().transform(at);
                    let out = Point::new((local.x.abs() - length / 2.0).max(0.0), (local.y.abs() - width / 2.0).max(0.0));
                    assert!(out.norm() >= 0.225 - 1e-8, "in {}: {}", thing.name, out.norm());
                }
            }
            (world.truth(id), world.ticks(id), *world.added())
        };
        // The same deeds give the same world.
        prop_assert_eq!(play(world.clone()), play(again));
        world.step();
    }
}
