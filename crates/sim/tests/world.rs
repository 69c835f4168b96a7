//! The simulator from outside: closed forms, statistics, determinism, and the worlds that come with the program.

use sim::camera::{Canvas, Pinhole};
use sim::model::{Camera, Sonar};
use sim::plan::{Leg, Person, Region, Round, Thing, Wall};
use sim::vary::FREE_WIDTH;
use sim::{Goal, Model, RobotId, Simulator, Vary, WorldPlan, free_way};
use types::geometry::{PI, TAU, wrap};
use types::value::{Span, Table, Value};
use types::{Duration, Point, Pose, Time};

mod body;
mod common;
mod crowd;
mod hand;
mod home;
mod landmarks;

const LABORATORY: &str = include_str!("../../../worlds/laboratory.toml");
const ANNEX: &str = include_str!("../../../worlds/annex.toml");

/// A robot without noise, lag or slip.
fn exact() -> Model {
    let mut model = Model::h1();
    model.drive.slip = 0.0;
    model.drive.lag = 0.0;
    if let Some(sonar) = &mut model.sonar {
        *sonar = Sonar { noise: 0.0, relative_noise: 0.0, crosstalk: 0.0, ..*sonar };
    }
    if let Some(camera) = &mut model.camera {
        camera.noise = 0.0;
    }
    model
}

fn alone(plan: &WorldPlan, model: Model, pose: Pose) -> (Simulator, RobotId) {
    let mut world = Simulator::new(plan, 11);
    let id = world.add_robot("h1", model, pose).expect("the place is free");
    (world, id)
}

/// Drives with a speed (m/s) and a turn rate (rad/s) for some time (s).
fn drive(world: &mut Simulator, id: RobotId, linear: f64, angular: f64, seconds: f64) {
    let drive = world.model(id).drive;
    let until = world.time() + Duration::from_seconds(seconds);
    while world.time() < until {
        let (left, right) = (linear - angular * drive.axle / 2.0, linear + angular * drive.axle / 2.0);
        world.command_wheels(id, left / drive.wheel_radius, right / drive.wheel_radius);
        world.step();
    }
}

fn wall(from: Point, to: Point) -> Wall {
    Wall { line: vec![from, to], ..Wall::default() }
}

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
fn a_wall_ahead_is_heard_at_its_distance_and_a_slanting_one_at_its_foot() {
    for degrees in [-12.0f64, -5.0, 0.0, 3.0, 10.0] {
        let normal = Point::polar(1.0, degrees.to_radians());
        let (foot, along) = (normal * 3.0, Point::new(-normal.y, normal.x) * 12.0);
        let plan = WorldPlan { walls: vec![wall(foot - along, foot + along)], ..WorldPlan::default() };
        let (world, id) = alone(&plan, exact(), Pose::default());
        let echo = world.sonar_echo(id, 0).unwrap().unwrap();
        // The transducer sits on the rim; the foot of the perpendicular lies inside its cone.
        let expected = 3.0 - 0.225 * degrees.to_radians().cos();
        assert!((echo / expected - 1.0).abs() < 1.2e-3, "{degrees}: {echo} {expected}");
    }
}

#[test]
fn a_smooth_wall_that_is_too_oblique_sends_no_echo_but_its_edge_does() {
    let direction = Point::polar(1.0, 45f64.to_radians());
    let from = Point::new(2.0, -0.3);
    let long = WorldPlan {
        walls: vec![wall(from - direction * 20.0, from + direction * 20.0)],
        ..WorldPlan::default()
    };
    let mut model = exact();
    if let Some(sonar) = &mut model.sonar {
        sonar.specular_angle = 25f64.to_radians();
    }
    let (world, id) = alone(&long, model.clone(), Pose::default());
    assert_eq!(world.sonar_echo(id, 0), Some(None));
    let mut reading = [0.0f32; 12];
    assert_eq!(world.sonar(id, 0, &mut reading), 12);
    assert_eq!(reading[0], 6.0, "no echo reads as the longest range");
    let short = WorldPlan { walls: vec![wall(from, from + direction * 20.0)], ..WorldPlan::default() };
    let (world, id) = alone(&short, model, Pose::default());
    let edge = world.sonar_echo(id, 0).unwrap().unwrap();
    assert!((edge - from.distance(Point::new(0.225, 0.0))).abs() < 1e-9, "{edge}");
}

#[test]
fn a_thin_pole_between_the_rays_is_heard_and_one_beside_the_cone_is_not() {
    for (degrees, heard) in [(2.5f64, true), (-7.5, true), (14.0, true), (17.0, false)] {
        let at = Point::new(0.225, 0.0) + Point::polar(3.0, degrees.to_radians());
        let round = Round { at, radius: 0.01, height: 1.0, ..Round::default() };
        let (world, id) =
            alone(&WorldPlan { rounds: vec![round], ..WorldPlan::default() }, exact(), Pose::default());
        let echo = world.sonar_echo(id, 0).unwrap();
        assert_eq!(echo.is_some(), heard, "{degrees}");
        assert!(echo.is_none_or(|echo| (echo - 2.99).abs() < 1e-9));
    }
}

#[test]
fn an_edge_behind_a_wall_is_not_heard() {
    let screen = wall(Point::new(1.5, -3.0), Point::new(1.5, 3.0));
    let pole = Round { at: Point::new(2.5, 0.0), radius: 0.05, height: 1.0, ..Round::default() };
    let plan = WorldPlan { walls: vec![screen], rounds: vec![pole], ..WorldPlan::default() };
    let (world, id) = alone(&plan, exact(), Pose::default());
    assert!((world.sonar_echo(id, 0).unwrap().unwrap() - 1.275).abs() < 1e-9);
}

#[test]
fn the_noise_of_a_sonar_has_its_parameters() {
    let (world, id) = alone(&WorldPlan::hall(8.0, 8.0), Model::h1(), Pose::new(4.0, 4.0, 0.0));
    let truth = 4.0 - 0.225;
    let sigma = 0.02 + 0.01 * truth;
    let n = 40_000u64;
    let readings: Vec<f64> = (0..n).map(|k| f64::from(world.sonar_range(id, 0, k).unwrap())).collect();
    let near: Vec<f64> = readings.iter().copied().filter(|x| (x - truth).abs() < 4.0 * sigma).collect();
    let mean = near.iter().sum::<f64>() / near.len() as f64;
    let variance = near.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / near.len() as f64;
    // What crosstalk puts into the band by chance is a thousandth of all.
    assert!((mean - truth).abs() < 0.002, "{mean}");
    assert!((variance.sqrt() / sigma - 1.0).abs() < 0.03, "{} {sigma}", variance.sqrt());
    let short = readings.iter().filter(|&&x| x < truth - 5.0 * sigma).count() as f64 / n as f64;
    let expected = 0.02 * (truth - 5.0 * sigma - 0.15) / (truth - 0.15);
    assert!((short - expected).abs() < 0.002, "{short} {expected}");
}

#[test]
fn a_laser_measures_a_hall() {
    let mut model = exact().with_laser(181, PI);
    if let Some(laser) = &mut model.laser {
        laser.dropout = 0.0;
    }
    let (world, id) = alone(&WorldPlan::hall(6.0, 4.0), model, Pose::new(2.0, 1.0, 0.0));
    let n = 500u64;
    let (mut ranges, mut sums) = (vec![0.0f32; 181], vec![0.0f64; 181]);
    let mut square = 0.0;
    for k in 0..n {
        assert_eq!(world.scan(id, k, &mut ranges), 181);
        sums.iter_mut().zip(&ranges).for_each(|(sum, &range)| *sum += f64::from(range));
        square += (f64::from(ranges[90]) - 4.0).powi(2);
    }
    for (k, sum) in sums.iter().enumerate() {
        let angle = (k as f64 - 90.0).to_radians();
        let side = if angle < 0.0 { 1.0 / -angle.sin() } else { 3.0 / angle.sin().max(1e-12) };
        let expected = side.min(4.0 / angle.cos().max(1e-12));
        assert!((sum / n as f64 - expected).abs() < 0.003, "beam {k}: {} {expected}", sum / n as f64);
    }
    assert!(((square / n as f64).sqrt() / 0.01 - 1.0).abs() < 0.1);
}

/// The smallest rectangle of red pixels: left, right, top, bottom, each as the border of the pixels.
fn red(image: &[u8], width: usize) -> Option<[f64; 4]> {
    let mut found: Option<[f64; 4]> = None;
    for (k, pixel) in image.chunks_exact(3).enumerate() {
        if pixel[0] > 60 && pixel[1] < pixel[0] / 3 && pixel[2] < pixel[0] / 3 {
            let (x, y) = ((k % width) as f64, (k / width) as f64);
            let [left, right, top, bottom] = found.unwrap_or([x, x, y, y]);
            found = Some([left.min(x), right.max(x + 1.0), top.min(y), bottom.max(y + 1.0)]);
        }
    }
    found
}

#[test]
fn a_red_ball_covers_the_pixels_of_the_pinhole() {
    let camera = Camera { noise: 0.0, ..Camera::default() };
    let focal = 160.0 / 30f64.to_radians().tan();
    for (distance, degrees, radius, pan, tilt) in [
        (3.0, 0.0f64, 0.15, 0.0, 0.0f64),
        (2.0, 10.0, 0.12, 0.0, 0.0),
        (4.0, -20.0, 0.2, -0.2, 0.0),
        (2.5, 35.0, 0.14, 0.5, 0.2),
    ] {
        let bearing = degrees.to_radians();
        let thing = Thing {
            name: "ball".into(),
            at: Point::polar(distance, bearing),
            radius,
            height: 1.0,
            ..Thing::default()
        };
        let mut plan = WorldPlan::hall(1.0, 1.0);
        plan.walls[0].line.iter_mut().for_each(|corner| *corner = (*corner - Point::new(0.5, 0.5)) * 14.0);
        plan.things.push(thing);
        let (mut world, id) = alone(&plan, Model { camera: Some(camera), ..exact() }, Pose::default());
        world.command_head(id, pan, tilt);
        world.run_until(Time::from_seconds(1.0));
        let mut image = vec![0u8; 320 * 240 * 3];
        assert_eq!(world.render(id, 0, &mut Canvas::default(), &mut image), Some((320, 240)));
        let [left, right, top, bottom] = red(&image, 320).unwrap();
        // The ball at the height of the camera is seen under ± asin(r / d) to either side.
        let half = (radius / distance).asin();
        let aside = bearing - pan;
        let column = |angle: f64| 160.0 - focal * angle.tan();
        assert!((left - column(aside + half)).abs() < 1.0, "left {left} {}", column(aside + half));
        assert!((right - column(aside - half)).abs() < 1.0, "right {right} {}", column(aside - half));
        // In the column through its middle the picture plane is further away by 1 / cos.
        let rise = focal / aside.cos() * half.tan();
        let horizon = 120.0 + focal * tilt.tan();
        assert!((top - (horizon - rise)).abs() < 1.0, "top {top} {}", horizon - rise);
        assert!((bottom - (horizon + rise)).abs() < 1.0, "bottom {bottom} {}", horizon + rise);
        assert_eq!(Pinhole::new(&camera, tilt).horizon, horizon);
    }
}

#[test]
fn what_stands_in_front_hides_what_is_behind() {
    let mut plan = WorldPlan::hall(8.0, 4.0);
    plan.things.push(Thing { name: "ball".into(), at: Point::new(6.0, 2.0), ..Thing::default() });
    let seen = |plan: &WorldPlan| {
        let (world, id) = alone(plan, exact(), Pose::new(1.0, 2.0, 0.0));
        let mut image = vec![0u8; 320 * 240 * 3];
        world.render(id, 0, &mut Canvas::default(), &mut image).unwrap();
        red(&image, 320).is_some()
    };
    assert!(seen(&plan));
    plan.people.push(Person { at: Point::new(3.0, 2.0), ..Person::default() });
    assert!(!seen(&plan), "a person stands before it");
    plan.people[0].at = Point::new(7.0, 2.0);
    assert!(seen(&plan), "the person stands behind it");
    plan.walls.push(wall(Point::new(4.0, 1.0), Point::new(4.0, 3.0)));
    assert!(!seen(&plan), "a wall stands before it");
    plan.walls[1].height = 0.7;
    assert!(seen(&plan), "one sees over a low wall");
}

#[test]
fn a_canvas_keeps_nothing_of_the_picture_before() {
    let mut plan = WorldPlan::hall(8.0, 4.0);
    plan.people.push(Person { at: Point::new(3.0, 2.0), ..Person::default() });
    let picture = |width: u32, height: u32, heading: f64, canvas: &mut Canvas| {
        let camera = Camera { width, height, ..Camera::default() };
        let (world, id) =
            alone(&plan, Model { camera: Some(camera), ..exact() }, Pose::new(1.0, 2.0, heading));
        let mut image = vec![0u8; (width * height * 3) as usize];
        world.render(id, 0, canvas, &mut image).unwrap();
        image
    };
    let mut kept = Canvas::default();
    for (width, height, heading) in [(320, 240, 0.0), (81, 50, PI), (33, 60, 0.1), (320, 240, PI)] {
        let image = picture(width, height, heading, &mut kept);
        assert_eq!(image, picture(width, height, heading, &mut Canvas::default()), "{width} x {height}");
    }
}

#[test]
fn the_noise_of_a_picture_has_its_deviation() {
    let mut model = exact();
    let (clear, id) = alone(&WorldPlan::hall(6.0, 4.0), model.clone(), Pose::new(2.0, 2.0, 0.0));
    model.camera = Some(Camera { noise: 5.0, ..Camera::default() });
    let (noisy, _) = alone(&WorldPlan::hall(6.0, 4.0), model, Pose::new(2.0, 2.0, 0.0));
    let mut images = [vec![0u8; 320 * 240 * 3], vec![0u8; 320 * 240 * 3], vec![0u8; 320 * 240 * 3]];
    clear.render(id, 0, &mut Canvas::default(), &mut images[0]).unwrap();
    noisy.render(id, 0, &mut Canvas::default(), &mut images[1]).unwrap();
    noisy.render(id, 1, &mut Canvas::default(), &mut images[2]).unwrap();
    assert_ne!(images[1], images[2]);
    let (mut sum, mut square) = (0.0, 0.0);
    for (a, b) in images[0].iter().zip(&images[1]) {
        let difference = f64::from(*b) - f64::from(*a);
        sum += difference;
        square += difference * difference;
    }
    let n = images[0].len() as f64;
    assert!((sum / n).abs() < 0.2, "{}", sum / n);
    assert!(((square / n).sqrt() / 5.0 - 1.0).abs() < 0.05, "{}", (square / n).sqrt());
}

#[test]
fn listening_changes_no_world() {
    let plan = drawn(LABORATORY, 5).plan;
    let run = |listen: bool, camera: bool| {
        let mut model = Model::h1().with_laser(180, PI);
        if !camera {
            model.camera = None;
        }
        let mut world = Simulator::new(&plan, 77);
        let id = world.add_robot("h1", model, Pose::new(9.0, 3.0, 1.5)).unwrap();
        let (mut sonar, mut scan, mut image) = ([0.0f32; 12], [0.0f32; 180], vec![0u8; 320 * 240 * 3]);
        let mut canvas = Canvas::default();
        for k in 0..400u64 {
            world.command_wheels(id, 4.0, 4.3);
            if listen {
                world.sonar(id, k, &mut sonar);
                world.scan(id, k, &mut scan);
                world.gyro(id, k);
                world.render(id, k, &mut canvas, &mut image);
            }
            world.step();
        }
        world.sonar(id, 1000, &mut sonar);
        (world.truth(id), world.ticks(id), sonar)
    };
    let heard = run(true, true);
    assert_eq!(heard, run(false, true));
    assert_eq!(heard, run(false, false), "a robot without a camera drives the same way");
    let mut other = Simulator::new(&plan, 78);
    let id = other.add_robot("h1", Model::h1(), Pose::new(9.0, 3.0, 1.5)).unwrap();
    for _ in 0..400 {
        other.command_wheels(id, 4.0, 4.3);
        other.step();
    }
    assert_ne!(other.truth(id).pose, heard.0.pose, "another seed slips otherwise");
}

fn led() -> WorldPlan {
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

fn goal(text: &str, plan: &WorldPlan) -> Goal {
    let mut mistakes = Vec::new();
    let goal = Goal::read(&common::table(text), Span::default(), plan, &mut mistakes);
    goal.unwrap_or_else(|| panic!("{mistakes:?}"))
}

#[test]
fn a_goal_is_met_stage_by_stage_and_says_what_is_missing() {
    let plan = led();
    let goal = goal(
        r#"within = "100s"
           stage = [{ inside = "mark" }, { near = "guide", distance = 1.6, hold = "1s" },
                    { follows = "guide", distance = 1.7, time = "2s" }, { turned = "90deg" }]"#,
        &plan,
    );
    let (mut world, id) = alone(&plan, exact(), Pose::default());
    let mut progress = goal.begin();
    let mut seen = vec![goal.why(&progress)];
    let mut step = |world: &mut Simulator, linear: f64, angular: f64, seconds: i32| {
        for _ in 0..seconds * 100 {
            drive(world, id, linear, angular, 0.01);
            goal.watch(&mut progress, world, id);
        }
        seen.push(goal.why(&progress));
        progress.stages_done()
    };
    assert_eq!(step(&mut world, 0.4, 0.0, 4), 0);
    assert_eq!(step(&mut world, 0.4, 0.0, 3), 1);
    assert_eq!(step(&mut world, 0.35, 0.0, 4), 2);
    assert_eq!(step(&mut world, 0.35, 0.0, 4), 3);
    assert_eq!(step(&mut world, 0.0, -1.0, 1), 3);
    assert_eq!(step(&mut world, 0.0, -1.0, 1), 4);
    assert!(progress.met() && progress.decided());
    assert_eq!(seen[0], "stage 1 of 4: the robot was not inside \"mark\"");
    assert!(
        seen[2].starts_with("stage 2 of 4: the robot was not within 1.6 m of \"guide\" for 1s (now 2.2"),
        "{}",
        seen[2]
    );
    assert!(seen[5].starts_with("stage 4 of 4: the robot had turned by 5"), "{}", seen[5]);
    assert!(seen[6].starts_with("all 4 stages met after 16.5"), "{}", seen[6]);
}

#[test]
fn a_goal_fails_by_time_and_by_touching() {
    let plan = led();
    let short = goal("within = \"2s\"\nstage = [{ inside = \"end\" }]", &plan);
    let (mut world, id) = alone(&plan, exact(), Pose::default());
    let mut progress = short.begin();
    while !short.watch(&mut progress, &world, id) {
        world.step();
    }
    assert!(!progress.met());
    assert_eq!(short.why(&progress), "stage 1 of 1: the robot was not inside \"end\" when the 2s were over");
    let statue = Person { at: Point::new(1.0, 0.0), ..Person::default() };
    let plan = WorldPlan { people: vec![statue], regions: plan.regions, ..WorldPlan::default() };
    let (mut world, id) = alone(&plan, exact(), Pose::default());
    let mut progress = short.begin();
    while !short.watch(&mut progress, &world, id) {
        drive(&mut world, id, 0.6, 0.0, 0.01);
    }
    assert!(short.why(&progress).contains("touched something"), "{}", short.why(&progress));
}

#[test]
fn the_mistakes_of_a_goal_name_the_right_word() {
    let mut mistakes = Vec::new();
    let text = r#"stage = [{ inside = "mrak" }, { near = "ballon" }, { inside = "mark", turned = "x" }, {}]"#;
    assert_eq!(Goal::read(&common::table(text), Span::default(), &led(), &mut mistakes), None);
    let said = mistakes.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n");
    assert!(said.contains("did you mean \"mark\"") && said.contains("did you mean \"balloon\""), "{said}");
    assert_eq!(mistakes.len(), 4, "{said}");
}

fn vary_of(world: &Table) -> Vary {
    let mut mistakes = Vec::new();
    let table = world.get("vary").and_then(|entry| entry.value.as_table()).expect("the world has draws");
    Vary::read(table, &mut mistakes).unwrap_or_else(|| panic!("{mistakes:?}"))
}

fn one_robot() -> Table {
    let mut robots = Table::new();
    robots.set("h1", Value::Table(common::table("[drive]\nlag = 0.1")));
    robots
}

fn drawn(text: &str, seed: u64) -> sim::Drawn {
    let world = common::table(text);
    vary_of(&world)
        .draw(&world, &one_robot(), &["room", "corridor", "far corridor", "hall"], seed)
        .unwrap_or_else(|mistakes| panic!("seed {seed}: {mistakes:?}"))
}

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

#[test]
fn all_mistakes_of_a_world_are_told_at_once() {
    let text = r##"
        ligth = 1.0
        [[wall]]
        line = [[0, 0]]
        [[box]]
        at = [1, 2]
        colour = "purpel"
        angle = "east"
        [[person]]
        at = [0, 0]
        appears = "kitchen"
        [[door]]
        places = { east = [50, 1] }
        open = "west"
    "##;
    let mut mistakes = Vec::new();
    assert_eq!(WorldPlan::read(&common::table(text), &mut mistakes), None);
    let said = mistakes.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n");
    for expect in [
        "\"light\"",
        "at least 2 points",
        "\"purple\"",
        "must be an angle",
        "no region \"kitchen\"",
        "lies on no wall",
        "\"west\"",
    ] {
        assert!(said.contains(expect), "{expect} not in\n{said}");
    }
}

/// What is said of a world, with the text of the place where it stands.
fn said_of(world: &str, find: impl Fn(&Table) -> Span) -> (Vec<types::value::Mistake>, Span, &str) {
    let mut table = common::table(world);
    common::number_places(&mut table);
    let mut mistakes = Vec::new();
    assert_eq!(WorldPlan::read(&table, &mut mistakes), None, "{world}");
    let place = find(&table);
    (mistakes, place, world)
}

#[test]
fn a_world_that_is_too_large_for_its_grid_is_refused_at_what_makes_it_so() {
    let wide = "[[wall]]\nline = [[-1000, 0], [1000, 0]]\n[[round]]\nat = [0, 1000]\n";
    let of_round = |table: &Table| table.get("round").unwrap().value.as_list().unwrap()[0].at;
    let (mistakes, place, _) = said_of(wide, of_round);
    assert_eq!(mistakes.len(), 1, "{mistakes:?}");
    assert!(mistakes[0].what.contains("2000 m by 1000 m"), "{}", mistakes[0]);
    assert_eq!(mistakes[0].at, place);
    // A long corridor is no large world.
    let long = "[[wall]]\nline = [[-1000, 0], [1000, 0]]\n[[wall]]\nline = [[-1000, 2], [1000, 2]]\n";
    assert!(WorldPlan::read(&common::table(long), &mut Vec::new()).is_some());
}

#[test]
fn corners_that_are_no_place_are_refused() {
    for (world, said) in [
        ("[[region]]\nname = \"a\"\nrect = [0, 0, 1e300, 1]\n", "\"rect\" lies more than 1000 m away"),
        ("[[region]]\nname = \"a\"\nrect = [0, nan, 1, 1]\n", "\"rect\" lies more than 1000 m away"),
    ] {
        let (mistakes, ..) = said_of(world, |_| Span::default());
        assert!(mistakes.iter().any(|mistake| mistake.what == said), "{world}: {mistakes:?}");
    }
}

#[test]
fn names_that_are_taken_and_doors_off_the_walls_are_told_at_their_place() {
    let doubled =
        "[[region]]\nname = \"a\"\nrect = [0, 0, 1, 1]\n[[region]]\nname = \"a\"\nrect = [0, 0, 1, 1]\n";
    let second = |table: &Table| {
        table.get("region").unwrap().value.as_list().unwrap()[1]
            .value
            .as_table()
            .unwrap()
            .get("name")
            .unwrap()
            .at
    };
    let (mistakes, place, _) = said_of(doubled, second);
    assert_eq!((mistakes.len(), mistakes[0].at), (1, place), "{mistakes:?}");
    let off = "[[wall]]\nline = [[0, 0], [9, 0]]\n[[door]]\nplaces = { on = [4, 0], off = [4, 2] }\n";
    let of_place = |table: &Table| {
        let door = table.get("door").unwrap().value.as_list().unwrap()[0].value.as_table().unwrap().clone();
        door.get("places").unwrap().value.as_table().unwrap().get("off").unwrap().at
    };
    let (mistakes, place, _) = said_of(off, of_place);
    assert_eq!((mistakes.len(), mistakes[0].at), (1, place), "{mistakes:?}");
}

#[test]
fn a_robot_needs_a_free_place_and_a_name_of_its_own() {
    let (mut world, id) = alone(&WorldPlan::hall(4.0, 4.0), Model::h1(), Pose::new(1.0, 1.0, 0.0));
    assert!(world.add_robot("h1", Model::h1(), Pose::new(3.0, 3.0, 0.0)).is_err());
    assert!(world.add_robot("h2", Model::h1(), Pose::new(1.3, 1.0, 0.0)).is_err());
    assert!(world.add_robot("h2", Model::h1(), Pose::new(0.1, 3.0, 0.0)).is_err());
    assert!(world.add_robot("h2", Model::h1(), Pose::new(f64::NAN, 3.0, 0.0)).is_err());
    assert!(world.put(id, Pose::new(3.9, 3.0, 0.0)).is_err());
    assert_eq!(world.truth(id).pose, Pose::new(1.0, 1.0, 0.0));
    assert_eq!(world.robots().count(), 1);
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
