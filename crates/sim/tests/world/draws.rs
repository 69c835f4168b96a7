//! What is drawn by the seed.

use super::*;

#[test]
fn the_worlds_give_a_free_way_for_every_seed() {
    for text in [LABORATORY, ANNEX] {
        let mut doors = [0; 2];
        for seed in 0..40 {
            let drawn = drawn(text, seed);
            assert_eq!(drawn, self::drawn(text, seed), "seed {seed}");
            assert!(drawn.moved >= 8, "seed {seed}");
            doors[drawn.plan.doors[0].open.unwrap()] += 1;
            let start = drawn.starts[0].1;
            assert!(drawn.plan.region("room").unwrap().contains(start.position()), "seed {seed}");
            assert!(free_way::exists(&drawn.plan, start.position(), &["hall"], FREE_WIDTH), "seed {seed}");
            let mut world = Simulator::new(&drawn.plan, seed);
            let id = world.add_robot("h1", Model::h1(), start).unwrap();
            world.step();
            assert!(world.truth(id).closest > 0.09, "seed {seed}: {:?}", world.truth(id));
        }
        assert!(doors.iter().all(|&count| count > 5), "{doors:?}");
    }
}

/// A robot that knows the truth keeps 1.2 m to the balloon: the guide must lead it around and back.
#[test]
fn the_guides_of_the_worlds_lead_through_a_u_turn() {
    for text in [LABORATORY, ANNEX] {
        let plan = drawn(text, 1).plan;
        let (min, max) = plan.region("far corridor").unwrap().bounds();
        let guide = &plan.people[plan.person("guide").unwrap()];
        let middle = (min + max) * 0.5;
        let start = Pose::new(middle.x, middle.y, (guide.at - middle).bearing());
        let end = guide.walk.last().unwrap().to;
        let (mut world, id) = alone(&plan, exact(), start);
        let mut most_turned = 0.0f64;
        let mut seconds = 0.0;
        while world.locate("guide").is_none_or(|(at, _)| at.distance(end) > 0.01) {
            let truth = world.truth(id);
            let target = world
                .locate(&guide.carries.as_ref().unwrap().name)
                .map_or(truth.pose.position(), |(at, _)| at);
            let to = target - truth.pose.position();
            let bearing = wrap(to.bearing() - truth.pose.heading);
            let linear = if bearing.abs() < 0.6 { (to.norm() - 0.75).clamp(0.0, 0.3) } else { 0.0 };
            drive(&mut world, id, linear, (2.0 * bearing).clamp(-1.0, 1.0), 0.01);
            most_turned = most_turned.max(truth.turned.abs());
            seconds += 0.01;
            assert!(
                seconds < 180.0,
                "{}: the guide is stuck at {:?}, the robot at {truth:?}",
                plan.name,
                world.locate("guide")
            );
        }
        assert_eq!(world.truth(id).collisions, 0, "{}", plan.name);
        assert!(most_turned > 150f64.to_radians(), "{}: {most_turned}", plan.name);
    }
}

#[test]
fn a_draw_changes_what_it_names() {
    let world = common::table(LABORATORY);
    let vary = common::table(
        r#""robot.h1.drive.lag" = { factor = [0.5, 2.0] }
           "robot.h1.drive.left_scale" = { normal = [1.0, 0.01] }
           "box.island.height" = { uniform = [0.5, 0.9] }
           "round.0.colour" = { one_of = ["green", "teal"] }"#,
    );
    let vary = Vary::read(&vary, &mut Vec::new()).unwrap();
    let lag = |robots: &Table| robots.at_path("h1.drive.lag").unwrap().value.as_float().unwrap();
    let mut lags = Vec::new();
    for seed in 0..20 {
        let drawn = vary.draw(&world, &one_robot(), &["hall"], seed).unwrap();
        lags.push(lag(&drawn.robots));
        let island = drawn.plan.boxes.iter().find(|item| item.name == "island").unwrap();
        assert!((0.5..0.9).contains(&island.height));
        assert!(drawn.robots.at_path("h1.drive.left_scale").is_some());
        assert_eq!(drawn.starts[0].1, drawn.plan.start);
    }
    assert!(lags.iter().all(|lag| (0.05..0.2).contains(lag)) && lags[0] != lags[1], "{lags:?}");
}

#[test]
fn the_mistakes_of_a_draw_are_told() {
    let world = common::table(LABORATORY);
    let read = |text: &str| {
        let mut mistakes = Vec::new();
        let vary = Vary::read(&common::table(text), &mut mistakes);
        vary.map(|vary| vary.draw(&world, &one_robot(), &["hall"], 1).map(drop)).unwrap_or(Err(mistakes))
    };
    for (text, expect) in [
        (r#""light" = { unifrom = [0, 1] }"#, "did you mean \"uniform\""),
        (r#""light" = { uniform = [2, 1] }"#, "wrong order"),
        (r#""start" = { anywhere_in = "rom" }"#, "did you mean \"room\""),
        (r#""box.iland.height" = { uniform = [0.5, 1] }"#, "no item \"iland\""),
        (r#""robot.h1.drive.slip" = { factor = [0.5, 1] }"#, "no number"),
        (r#""clutter" = { scatter = { by = [0.5, 1.5], at_least = 80 } }"#, "80 are to be moved"),
        (r#""door.entrance.open" = { one_of = [false] }"#, "no draw of seed 1 leaves a free way"),
    ] {
        let said = read(text).unwrap_err().iter().map(ToString::to_string).collect::<String>();
        assert!(said.contains(expect), "{text}: {said}");
    }
}
