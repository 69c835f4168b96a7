//! Draws a world: `picture FILE.toml OUT_DIR [SEED]` writes `top.png` and what a robot sees from several places.

use std::error::Error;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use sim::camera::Canvas;
use sim::{Model, Simulator, Vary};
use types::value::Table;
use types::{Point, Pose};

#[path = "../tests/world/common.rs"]
mod common;

/// Pixels a metre of the plan of the floor.
const SCALE: f64 = 60.0;

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let file = words.next().ok_or("which world file?")?;
    let out = words.next().ok_or("which folder for the pictures?")?;
    let seed = words.next().unwrap_or("1".into()).parse()?;
    let world = common::table(&std::fs::read_to_string(file)?);
    let mut mistakes = Vec::new();
    let vary = world.get("vary").and_then(|entry| entry.value.as_table()).cloned().unwrap_or_default();
    let vary = Vary::read(&vary, &mut mistakes).ok_or("the draws have mistakes")?;
    let mut robots = Table::new();
    robots.set("h1", types::value::Value::Table(Table::new()));
    let regions = sim::WorldPlan::read(&world, &mut mistakes).ok_or("the world has mistakes")?.regions;
    let through: Vec<&str> = regions.iter().map(|region| region.name.as_str()).collect();
    let drawn = vary.draw(&world, &robots, &through, seed).map_err(|all| format!("{all:?}"))?;
    let mut simulator = Simulator::new(&drawn.plan, seed);
    let id = simulator.add_robot("h1", Model::h1(), drawn.starts[0].1)?;
    let out = Path::new(&out);
    std::fs::create_dir_all(out)?;
    let far = drawn.plan.region("far corridor").map(|region| region.bounds());
    view(&simulator, id, &out.join("start.png"))?;
    let start = drawn.starts[0].1;
    for (name, turn) in [("left", 1.2), ("back", 3.1), ("right", -1.2)] {
        simulator.put(id, Pose { heading: start.heading + turn, ..start })?;
        view(&simulator, id, &out.join(format!("{name}.png")))?;
    }
    // Whoever stands there is seen from before.
    for person in drawn.plan.people.iter().filter(|person| person.appears.is_none()) {
        let before = person.at + Point::polar(1.6, person.facing);
        simulator.put(id, Pose::new(before.x, before.y, (person.at - before).bearing()))?;
        view(&simulator, id, &out.join(format!("{}.png", person.name)))?;
    }
    simulator.put(id, start)?;
    if let Some((min, max)) = far {
        let middle = (min + max) * 0.5;
        let guide = drawn.plan.people.iter().find(|person| person.name == "guide").ok_or("no guide")?;
        simulator.put(id, Pose::new(middle.x, middle.y, (guide.at - middle).bearing()))?;
        simulator.step();
        view(&simulator, id, &out.join("guide.png"))?;
        simulator.command_head(id, 0.4, -0.3);
        (0..100).for_each(|_| simulator.step());
        view(&simulator, id, &out.join("head.png"))?;
        simulator.put(id, start)?;
    }
    top_view(&simulator, &out.join("top.png"))
}

fn view(simulator: &Simulator, id: sim::RobotId, path: &Path) -> Result<(), Box<dyn Error>> {
    let mut image = vec![0u8; 320 * 240 * 3];
    let (width, height) = simulator.render(id, 0, &mut Canvas::default(), &mut image).ok_or("no camera")?;
    save(path, width, height, &image)
}

fn save(path: &Path, width: u32, height: u32, image: &[u8]) -> Result<(), Box<dyn Error>> {
    let mut encoder = png::Encoder::new(BufWriter::new(File::create(path)?), width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header()?.write_image_data(image)?;
    Ok(())
}

struct Sheet {
    min: Point,
    width: usize,
    height: usize,
    pixels: Vec<u8>,
}

impl Sheet {
    fn dot(&mut self, at: Point, colour: [u8; 3]) {
        let x = ((at.x - self.min.x) * SCALE) as isize;
        let y = self.height as isize - 1 - ((at.y - self.min.y) * SCALE) as isize;
        if (0..self.width as isize).contains(&x) && (0..self.height as isize).contains(&y) {
            let from = (y as usize * self.width + x as usize) * 3;
            self.pixels[from..from + 3].copy_from_slice(&colour);
        }
    }

    fn line(&mut self, from: Point, to: Point, colour: [u8; 3]) {
        let steps = (from.distance(to) * SCALE * 2.0) as usize + 1;
        (0..=steps).for_each(|k| self.dot(from + (to - from) * (k as f64 / steps as f64), colour));
    }

    fn disc(&mut self, centre: Point, radius: f64, colour: [u8; 3]) {
        let steps = (radius * SCALE) as i32 + 1;
        for (x, y) in (-steps..=steps).flat_map(|x| (-steps..=steps).map(move |y| (x, y))) {
            let offset = Point::new(f64::from(x) / SCALE, f64::from(y) / SCALE);
            if offset.norm() <= radius {
                self.dot(centre + offset, colour);
            }
        }
    }
}

fn top_view(simulator: &Simulator, path: &Path) -> Result<(), Box<dyn Error>> {
    let scenery = simulator.scenery();
    let margin = Point::new(0.3, 0.3);
    let (min, max) = (scenery.bounds.0 - margin, scenery.bounds.1 + margin);
    let size = (max - min) * SCALE;
    let (width, height) = (size.x as usize, size.y as usize);
    let mut sheet = Sheet { min, width, height, pixels: vec![250; width * height * 3] };
    for (number, region) in scenery.regions.iter().enumerate() {
        let tint = [[232, 240, 250], [240, 248, 232], [252, 240, 220], [248, 228, 240]][number % 4];
        for k in 0..width * height {
            let at = min + Point::new((k % width) as f64 / SCALE, (height - 1 - k / width) as f64 / SCALE);
            if region.contains(at) {
                sheet.pixels[k * 3..k * 3 + 3].copy_from_slice(&tint);
            }
        }
    }
    for line in &scenery.lines {
        sheet.line(line.from, line.to, line.colour.0.map(|channel| channel / 2));
    }
    scenery.discs.iter().for_each(|disc| sheet.disc(disc.centre, disc.radius, disc.colour.0));
    let moment = simulator.snapshot();
    for person in &moment.people {
        sheet.disc(person.disc.centre, person.disc.radius, person.disc.colour.0);
        let nose = person.disc.centre + Point::polar(person.disc.radius + 0.1, person.facing);
        sheet.line(person.disc.centre, nose, [0, 0, 0]);
    }
    moment.things.iter().for_each(|thing| sheet.disc(thing.centre, thing.radius, thing.colour.0));
    for robot in &moment.robots {
        match robot.shape.corners(robot.pose) {
            None => sheet.disc(robot.pose.position(), robot.shape.reach(), [20, 20, 20]),
            Some(corners) => {
                (0..4).for_each(|k| sheet.line(corners[k], corners[(k + 1) % 4], [20, 20, 20]));
            }
        }
        let ahead = robot.pose.position() + Point::polar(0.5, robot.pose.heading);
        sheet.line(robot.pose.position(), ahead, [255, 0, 0]);
    }
    save(path, width as u32, height as u32, &sheet.pixels)
}
