//! The world of the robot at home.

use sim::camera::Canvas;
use sim::plan::Person;
use sim::vary::FREE_WIDTH;
use sim::{Model, Simulator, WorldPlan, free_way};
use types::geometry::PI;
use types::{Point, Pose};

use super::{alone, common, exact, one_robot, vary_of};

const HOME: &str = include_str!("../../../../worlds/home.toml");

/// Every room of the home can be reached, and each person in it, the ball and the cup are where a robot can look at them.
#[test]
fn the_home_gives_a_free_way_into_every_room_for_every_seed() {
    let rooms = ["living room", "corridor", "kitchen"];
    let world = common::table(HOME);
    let mut doors = [0; 4];
    for seed in 0..40 {
        let drawn = vary_of(&world).draw(&world, &one_robot(), &rooms, seed);
        let drawn = drawn.unwrap_or_else(|mistakes| panic!("seed {seed}: {mistakes:?}"));
        assert!(drawn.moved >= 3, "seed {seed}");
        (0..2).for_each(|door| doors[2 * door + drawn.plan.doors[door].open.unwrap()] += 1);
        let start = drawn.starts[0].1;
        assert!(drawn.plan.region("living room").unwrap().contains(start.position()), "seed {seed}");
        assert!(free_way::exists(&drawn.plan, start.position(), &rooms, FREE_WIDTH), "seed {seed}");
        let mut world = Simulator::new(&drawn.plan, seed);
        let id = world.add_robot("h1", Model::h1(), start).unwrap();
        world.step();
        assert!(world.truth(id).closest > 0.09, "seed {seed}: {:?}", world.truth(id));
        for name in ["ball", "cup", "grandmother", "cook"] {
            assert!(world.locate(name).is_some(), "seed {seed}: {name}");
        }
    }
    assert!(doors.iter().all(|&count| count > 5), "{doors:?}");
}

/// Pixels that are as bright and coloured as lit skin, which has 206 : 164 : 122.
fn skin(image: &[u8]) -> usize {
    let ratio = |a: u8, b: u8| f64::from(a) / f64::from(b.max(1));
    let is_skin = |pixel: &&[u8]| {
        let (to_green, to_blue) = (ratio(pixel[0], pixel[1]), ratio(pixel[0], pixel[2]));
        pixel[0] > 100 && (to_green - 206.0 / 164.0).abs() < 0.04 && (to_blue - 206.0 / 122.0).abs() < 0.06
    };
    image.chunks_exact(3).filter(is_skin).count()
}

#[test]
fn who_looks_at_the_robot_shows_a_face_and_who_looks_away_hair() {
    let seen = |facing: f64| {
        let person = Person { at: Point::new(1.5, 0.0), facing, ..Person::default() };
        let plan = WorldPlan { people: vec![person], ..WorldPlan::default() };
        let (world, id) = alone(&plan, exact(), Pose::default());
        let mut image = vec![0u8; 320 * 240 * 3];
        world.render(id, 0, &mut Canvas::default(), &mut image).unwrap();
        // The head is in the upper half; the hands, which have the same colour, are below.
        skin(&image[..320 * 100 * 3])
    };
    let (here, away) = (seen(PI), seen(0.0));
    assert!(here > 500 && here > 2 * away, "{here} {away}");
    assert!(seen(PI / 2.0 + 0.1) > 500, "a little aside is still here");
}
