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
mod draws;
mod driving;
mod goals;
mod hand;
mod home;
mod landmarks;
mod mistakes;
mod people;
mod pictures;
mod sensors;

const LABORATORY: &str = include_str!("../../../../worlds/laboratory.toml");
const ANNEX: &str = include_str!("../../../../worlds/annex.toml");

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
