//! How robots drive and touch, beside closed forms.

use super::*;

#[test]
fn wheels_without_errors_drive_the_exact_arc() {
    let (mut world, id) = alone(&WorldPlan::default(), exact(), Pose::default());
    drive(&mut world, id, 0.4, 0.5, 3.0);
    let expected = Pose::default().advanced(0.4, 0.5, 3.0);
    let pose = world.truth(id).pose;
    assert!(pose.position().distance(expected.position()) < 1e-9, "{pose:?} {expected:?}");
    assert!((world.truth(id).distance - 1.2).abs() < 1e-9);
    assert!((world.truth(id).turned - 1.5).abs() < 1e-9);
}

#[test]
fn a_lagging_wheel_follows_the_exponential() {
    let mut model = exact();
    model.drive.lag = 0.2;
    let (mut world, id) = alone(&WorldPlan::default(), model, Pose::default());
    drive(&mut world, id, 0.5, 0.0, 0.4);
    // The integral of v (1 − e^(−t/τ)).
    let expected = 0.5 * (0.4 - 0.2 * (1.0 - (-0.4f64 / 0.2).exp()));
    assert!((world.truth(id).pose.x - expected).abs() < 1e-9, "{}", world.truth(id).pose.x);
}

#[test]
fn ticks_without_errors_lead_to_the_true_pose() {
    let mut model = exact();
    model.drive.lag = 0.1;
    model.drive.ticks_per_turn = 1e6;
    let drives = model.drive;
    let (mut world, id) = alone(&WorldPlan::default(), model, Pose::new(1.0, 2.0, 0.3));
    let mut pose = world.truth(id).pose;
    let mut before = world.ticks(id);
    for k in 0..2000u32 {
        let phase = f64::from(k) * 0.005;
        world.command_wheels(id, 5.0 * phase.sin() + 2.0, 4.0 * (1.3 * phase).cos());
        world.step();
        let now = world.ticks(id);
        let way = [0, 1].map(|side| (now[side] - before[side]) as f64 / 1e6 * TAU * drives.wheel_radius);
        pose = pose.along_arc((way[0] + way[1]) / 2.0, (way[1] - way[0]) / drives.axle);
        before = now;
    }
    let truth = world.truth(id).pose;
    assert!(pose.position().distance(truth.position()) < 1e-4, "{pose:?} {truth:?}");
    assert!(wrap(pose.heading - truth.heading).abs() < 1e-4);
}

#[test]
fn a_larger_left_wheel_bends_the_way_as_the_formula_says() {
    let mut model = exact();
    model.drive.left_scale = 1.01;
    let (mut world, id) = alone(&WorldPlan::default(), model, Pose::default());
    drive(&mut world, id, 0.5, 0.0, 4.0);
    assert!((world.truth(id).turned - 2.0 * (1.0 - 1.01) / 0.36).abs() < 1e-9, "{}", world.truth(id).turned);
}

#[test]
fn without_commands_the_motors_stop() {
    let (mut world, id) = alone(&WorldPlan::default(), exact(), Pose::default());
    world.command_wheels(id, 4.0, 4.0);
    world.run_until(Time::from_seconds(3.0));
    // Half a second at 4 rad/s on a wheel of 75 mm.
    assert!((world.truth(id).pose.x - 0.15).abs() < 1e-9, "{}", world.truth(id).pose.x);
    world.command_wheels(id, f64::NAN, 4.0e9);
    world.step();
    assert!(world.truth(id).pose.x.is_finite() && world.truth(id).linear <= 0.375 + 1e-9);
}

#[test]
fn a_contact_is_found_inside_the_step_and_counted_once() {
    let (mut world, id) = alone(&WorldPlan::hall(5.0, 4.0), exact(), Pose::new(1.0, 2.0, 0.0));
    drive(&mut world, id, 0.431, 0.0, 12.0);
    let truth = world.truth(id);
    assert!((truth.pose.x - (5.0 - 0.225)).abs() < 1e-8, "{}", truth.pose.x);
    assert_eq!((truth.collisions, truth.closest < 1e-8, world.bumper(id)), (1, true, 1));
    // The odometer counts the way to the contact, not the pushing.
    assert!((truth.distance - (4.0 - 0.225)).abs() < 1e-6, "{}", truth.distance);
    drive(&mut world, id, -0.3, 0.0, 1.0);
    assert_eq!((world.truth(id).collisions, world.bumper(id)), (1, 0));
    drive(&mut world, id, 0.0, 1.0, PI / 2.0);
    drive(&mut world, id, 0.3, 0.0, 12.0);
    assert_eq!(world.truth(id).collisions, 2);
    assert!((world.truth(id).pose.y - (4.0 - 0.225)).abs() < 1e-8);
}

#[test]
fn a_slanting_contact_presses_the_sector_on_its_side() {
    let (mut world, id) = alone(&WorldPlan::hall(5.0, 4.0), exact(), Pose::new(3.0, 3.0, 60f64.to_radians()));
    drive(&mut world, id, 0.3, 0.0, 5.0);
    // The wall lies 30° to the left of ahead: the first of twelve sectors to the left.
    assert_eq!(world.bumper(id), 0b10);
}

#[test]
fn robots_and_people_stop_robots() {
    let person = Person { name: "statue".into(), at: Point::new(4.0, 0.0), ..Person::default() };
    let plan = WorldPlan { people: vec![person], ..WorldPlan::default() };
    let (mut world, id) = alone(&plan, exact(), Pose::default());
    let other = world.add_robot("other", exact(), Pose::new(0.0, 3.0, -PI / 2.0)).unwrap();
    drive(&mut world, other, 0.3, 0.0, 12.0);
    assert!((world.truth(other).pose.y - 0.45).abs() < 1e-8);
    assert_eq!((world.truth(other).collisions, world.truth(id).collisions), (1, 1), "both feel a touch");
    drive(&mut world, id, 0.4, 0.0, 12.0);
    assert!((world.truth(id).pose.x - (4.0 - 0.475)).abs() < 1e-8, "{:?}", world.truth(id));
    assert_eq!(world.truth(id).collisions, 2);
}

#[test]
fn the_closest_clearance_is_that_of_a_dense_scan() {
    let mut plan = WorldPlan::hall(6.0, 5.0);
    plan.rounds.push(Round { at: Point::new(3.0, 2.9), radius: 0.2, height: 1.0, ..Round::default() });
    let mut model = exact().with_laser(3600, TAU);
    if let Some(laser) = &mut model.laser {
        (laser.noise, laser.dropout) = (0.0, 0.0);
    }
    let (mut world, id) = alone(&plan, model, Pose::new(0.8, 2.0, 0.0));
    let mut ranges = vec![0.0f32; 3600];
    let mut closest = f64::INFINITY;
    for k in 0..900 {
        drive(&mut world, id, 0.45, if k < 300 { 0.05 } else { 0.6 }, 0.01);
        assert_eq!(world.scan(id, 0, &mut ranges), 3600);
        closest = ranges.iter().fold(closest, |least, &range| least.min(f64::from(range) - 0.225));
        assert!(
            (world.truth(id).closest - closest).abs() < 1e-4,
            "{k}: {} {closest}",
            world.truth(id).closest
        );
    }
    assert!(closest < 0.4, "the way must lead by something: {closest}");
}

#[test]
fn a_robot_that_drives_blindly_gets_into_nothing() {
    for seed in 0..4 {
        let drawn = drawn(LABORATORY, seed);
        let mut model = exact().with_laser(720, TAU);
        if let Some(laser) = &mut model.laser {
            (laser.noise, laser.dropout) = (0.0, 0.0);
        }
        let (mut world, id) = alone(&drawn.plan, model, drawn.starts[0].1);
        let chance = sim::Stream::new(seed, "blind");
        let mut ranges = vec![0.0f32; 720];
        for k in 0..600 {
            let draw = chance.sample(k / 20);
            let before = world.truth(id);
            drive(&mut world, id, draw.between(0, -0.4, 0.6), draw.between(1, -1.5, 1.5), 0.1);
            world.scan(id, k, &mut ranges);
            let nearest = ranges.iter().copied().fold(f32::INFINITY, f32::min);
            assert!(nearest >= 0.225 - 1e-5, "seed {seed}, {k}: {nearest}");
            let moved = world.truth(id).pose.position().distance(before.pose.position());
            assert!(moved <= 0.06 + 1e-9, "seed {seed}, {k}: it jumped by {moved}");
        }
        assert!(
            world.truth(id).collisions > 0 && world.truth(id).distance > 2.0,
            "seed {seed}: {:?}",
            world.truth(id)
        );
    }
}

#[test]
fn a_battery_drains_and_then_nothing_moves() {
    let mut model = exact();
    model.battery.capacity = 0.01;
    let (mut world, id) = alone(&WorldPlan::default(), model, Pose::default());
    drive(&mut world, id, 0.5, 0.0, 0.3);
    // 36 J, less 25 W of electronics for 0.3 s and 60 W a metre a second over 0.15 m.
    assert!(
        (world.battery(id).fraction - (1.0 - (7.5 + 9.0) / 36.0)).abs() < 1e-9,
        "{:?}",
        world.battery(id)
    );
    drive(&mut world, id, 0.5, 0.0, 5.0);
    assert_eq!((world.battery(id).fraction, world.truth(id).linear), (0.0, 0.0));
}
