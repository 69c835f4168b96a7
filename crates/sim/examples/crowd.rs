//! How fast the crowd of `worlds/crowd.toml` walks: an hour of simulated time with a robot in it that drives about blindly.
//!
//! ```text
//! cargo run --release -p sinew-sim --example crowd
//! ```

#![allow(clippy::print_stdout, clippy::disallowed_methods)] // it tells what it measured by the host's clock

use std::error::Error;
use std::time::Instant;

use sim::{Model, Simulator, Stream, WorldPlan};
use types::Time;

#[path = "../tests/world/common.rs"]
mod common;

const HOUR: f64 = 3600.0;

fn main() -> Result<(), Box<dyn Error>> {
    let mut mistakes = Vec::new();
    let world = common::table(include_str!("../../../worlds/crowd.toml"));
    let plan = WorldPlan::read(&world, &mut mistakes).ok_or_else(|| format!("{mistakes:?}"))?;
    let mut world = Simulator::new(&plan, 1);
    let id = world.add_robot("r1", Model::r1(), plan.start)?;
    let (begun, chance) = (Instant::now(), Stream::new(1, "blind"));
    let mut ranges = [0.0f32; 181];
    for k in 0.. {
        let draw = chance.sample(k / 20);
        let (speed, turn) = (draw.between(0, -1.0, 3.0), draw.between(1, -2.0, 2.0));
        world.command_wheels(id, speed - turn, speed + turn);
        // The laser scans ten times a second.
        world.scan(id, k, &mut ranges);
        world.run_until(Time::from_seconds((k + 1) as f64 * 0.1));
        if world.time() >= Time::from_seconds(HOUR) {
            break;
        }
    }
    let (took, truth) = (begun.elapsed().as_secs_f64(), world.truth(id));
    println!(
        "an hour in {took:.2} s: {:.0} times real time; way {:.0} m, {} collisions, bumped {} times",
        HOUR / took,
        truth.distance,
        truth.collisions,
        truth.bumped
    );
    Ok(())
}
