//! Robots in a simulated world. Those of one world share its simulator: the first that is polled at a time steps it.
//!
//! ```text
//!   Gate ─▶ Simulated ─┐                       ┌─▶ Truth (any thread, never an agent)
//!   Gate ─▶ Simulated ─┴─▶ world ─ publishes ──┘
//! ```
//!
//! What the judge knows leaves through [`Truth`] alone; no output of a robot carries it.

mod hands;
mod truth;
mod world;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use motion::Differential;
use motion::limits::Limits;
use sim::camera::Canvas;
use sim::{Goal, Model, RobotId, WorldPlan};
use types::messages::{
    Battery, Bumper, Echo, Echoes, Encoding, Gyro, Head, Image, Landmarks, LaserScan, Twist, WheelTicks,
};
use types::{Duration, Name, Pose, Time};

pub use hands::{Hands, SERVICES, World as WorldAgent, services};
pub use truth::{PersonMoment, RobotMoment, Truth};
use world::World;

use crate::cadence::Cadence;
use crate::description::{BASE, CAMERA, ClockKind, HeadLimits, LASER, Periods, RobotDescription};
use crate::driver::{Driver, DriverError, Listening, Polled, Sink};
use crate::gate::Permit;

/// A robot to be put into a world.
#[derive(Clone, Debug)]
pub struct Robot {
    /// Its name, which is also that of its streams of chance.
    pub name: String,
    /// What it is made of.
    pub model: Model,
    /// Where it starts.
    pub start: Pose,
    /// What makes its run a success.
    pub goal: Option<Goal>,
}

/// Why a world cannot be set up.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SetupError {
    /// A robot cannot be added.
    #[error("robot \"{robot}\": {cause}")]
    Add {
        /// Its name.
        robot: String,
        /// Why.
        cause: sim::simulator::AddError,
    },
    /// A ring has more sonars than a message has room for.
    #[error("robot \"{robot}\" has {count} sonars; a message of the ring has room for {room}")]
    Sonars {
        /// Its name.
        robot: String,
        /// Its sonars.
        count: u32,
        /// The most there can be.
        room: usize,
    },
}

/// Makes a world of `plan` with its robots, in their order: a driver for each, and the only way to the truth.
///
/// # Errors
/// When a robot has no room where it starts, or has a name or sensors that cannot be.
pub fn raise(plan: &WorldPlan, seed: u64, robots: &[Robot]) -> Result<(Vec<Simulated>, Truth), SetupError> {
    let room = Echoes::default().echoes.capacity();
    for robot in robots {
        let count = robot.model.sonar.map_or(0, |sonar| sonar.count);
        if count as usize > room {
            return Err(SetupError::Sonars { robot: robot.name.clone(), count, room });
        }
    }
    let (world, truth) = World::new(plan, seed, robots)?;
    let canvases: Vec<(RobotId, Canvas)> = world.ids().map(|id| (id, world.canvas(id))).collect();
    let world = Arc::new(Mutex::new(world));
    let drivers = canvases
        .into_iter()
        .zip(robots)
        .map(|((id, canvas), robot)| Simulated::new(world.clone(), id, canvas, &robot.model));
    Ok((drivers.collect(), truth))
}

/// What a robot of this model is to its gate.
pub fn describe(model: &Model) -> RobotDescription {
    let mut description = RobotDescription::bare("sim", ClockKind::Simulated);
    description.periods = Periods {
        sonar: model.sonar.map(|sonar| sonar.period),
        scan: model.laser.map(|laser| laser.period),
        image: model.camera.map(|camera| camera.period),
        ticks: Some(model.drive.period),
        bumper: Some(model.bumper_period),
        gyro: Some(model.gyro.period),
        battery: Some(model.battery.period),
        head: Some(model.head.period),
        pose: None,
        landmarks: both(model.landmarks.map(|it| it.period), model.infrared.map(|it| it.period)),
    };
    if let Some(laser) = &model.laser {
        description.mount(LASER, laser.mount(), laser.height);
        description.beams = laser.beams as usize;
    }
    if let Some(camera) = &model.camera {
        description.mount(CAMERA, Pose::default(), camera.mount);
        description.picture = camera.width as usize * camera.height as usize * 3;
    }
    for (k, place) in model.ring().into_iter().enumerate() {
        description.mount(&format!("sonar_{k}"), place, model.sonar.map_or(0.0, |sonar| sonar.height));
    }
    description.limits = Some(limits(model));
    description.bumper_sectors = model.bumper_sectors;
    description.head = Some(HeadLimits { pan_max: model.head.max_pan, tilt_max: model.head.max_tilt });
    description.watchdog = Duration::from_seconds(model.drive.watchdog);
    description
}

/// The mean time between two readings of either of two sensors.
fn both(one: Option<Duration>, other: Option<Duration>) -> Option<Duration> {
    match (one, other) {
        (Some(one), Some(other)) => {
            Some(Duration::from_seconds(1.0 / (1.0 / one.seconds() + 1.0 / other.seconds())))
        }
        (one, other) => one.or(other),
    }
}

/// What the motors can do. There is no ramp: the wheels follow with a lag of their own, and a ramp in the gate would delay a stop.
fn limits(model: &Model) -> Limits {
    /// So high that it is never met (m/s², rad/s²).
    const NO_RAMP: f64 = 1e6;
    let drive = &model.drive;
    let rim = drive.max_wheel_speed * drive.wheel_radius;
    Limits {
        linear_max: rim,
        backward_max: rim,
        angular_max: 2.0 * rim / drive.axle,
        acceleration: NO_RAMP,
        deceleration: NO_RAMP,
        angular_acceleration: NO_RAMP,
        wheel_max: drive.max_wheel_speed,
        drive: Differential::new(drive.wheel_radius, drive.axle),
    }
}

/// When each sensor of one robot is read.
#[derive(Debug)]
struct Cadences {
    sonar: Cadence,
    scan: Cadence,
    image: Cadence,
    ticks: Cadence,
    bumper: Cadence,
    gyro: Cadence,
    battery: Cadence,
    head: Cadence,
    landmarks: Cadence,
    infrared: Cadence,
}

/// The driver of a simulated robot.
#[derive(Debug)]
pub struct Simulated {
    world: Arc<Mutex<World>>,
    id: RobotId,
    description: RobotDescription,
    cadences: Cadences,
    /// The ring without its ranges.
    echoes: Echoes,
    /// A scan without its ranges.
    scan: LaserScan,
    image: Image,
    canvas: Canvas,
    wheels: WheelTicks,
    pressed: u32,
}

impl Simulated {
    fn new(world: Arc<Mutex<World>>, id: RobotId, canvas: Canvas, model: &Model) -> Simulated {
        let description = describe(model);
        let periods = description.periods;
        Simulated {
            world,
            id,
            cadences: Cadences {
                sonar: Cadence::every(periods.sonar),
                scan: Cadence::every(periods.scan),
                image: Cadence::every(periods.image),
                ticks: Cadence::every(periods.ticks),
                bumper: Cadence::every(periods.bumper),
                gyro: Cadence::every(periods.gyro),
                battery: Cadence::every(periods.battery),
                head: Cadence::every(periods.head),
                landmarks: Cadence::every(model.landmarks.map(|sensor| sensor.period)),
                infrared: Cadence::every(model.infrared.map(|sensor| sensor.period)),
            },
            description,
            echoes: empty_ring(model),
            scan: empty_scan(model),
            image: empty_image(model),
            canvas,
            wheels: WheelTicks {
                ticks_per_turn: model.drive.ticks_per_turn,
                wheel_radius: model.drive.wheel_radius,
                track: model.drive.axle,
                ..WheelTicks::default()
            },
            pressed: 0,
        }
    }
}

impl Simulated {
    /// A way to change the world of this robot while it runs.
    pub fn hands(&self) -> Hands {
        Hands(self.world.clone())
    }
}

fn empty_ring(model: &Model) -> Echoes {
    let Some(sonar) = &model.sonar else { return Echoes::default() };
    let echo = |place: Pose| Echo {
        x: place.x as f32,
        y: place.y as f32,
        bearing: place.heading as f32,
        range: 0.0,
    };
    Echoes {
        range_min: sonar.min_range as f32,
        range_max: sonar.max_range as f32,
        cone: (2.0 * sonar.half_angle) as f32,
        echoes: model.ring().into_iter().map(echo).collect(),
    }
}

fn empty_scan(model: &Model) -> LaserScan {
    let Some(laser) = &model.laser else { return LaserScan::default() };
    let first = sim::laser::beam_angle(laser, 0);
    LaserScan {
        frame: Name::new(LASER),
        angle_min: first as f32,
        angle_step: (sim::laser::beam_angle(laser, 1) - first) as f32,
        range_min: 0.0,
        range_max: laser.max_range as f32,
        mount_x: laser.x as f32,
        mount_y: laser.y as f32,
        mount_heading: laser.heading as f32,
        ..LaserScan::default()
    }
}

fn empty_image(model: &Model) -> Image {
    let Some(camera) = &model.camera else { return Image::default() };
    Image {
        frame: Name::new(CAMERA),
        width: camera.width,
        height: camera.height,
        encoding: Encoding::Rgb8,
        field_of_view: camera.field as f32,
    }
}

/// Only drivers of the same world take this lock, and drivers live on the gates' thread: no ordinary thread can hold it.
fn locked(world: &Mutex<World>) -> MutexGuard<'_, World> {
    // The world of a robot whose step panicked goes on for the others.
    world.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Driver for Simulated {
    fn describe(&self) -> &RobotDescription {
        &self.description
    }

    fn poll(&mut self, now: Time, wanted: &Listening, sink: &mut dyn Sink) -> Result<Polled, DriverError> {
        let mut world = locked(&self.world);
        let stamp = world.advance(now);
        let newly_pressed = world.take_presses(self.id);
        let (sim, time, id) = (world.simulator(), world.simulator().time(), self.id);
        let due = &mut self.cadences;
        let pressed = sim.bumper(id);
        let bumper_due = due.bumper.due(time).is_some();
        if wanted.bumper && (bumper_due || pressed != self.pressed) {
            sink.bumper(stamp, &Bumper { sectors: pressed });
        }
        self.pressed = pressed;
        if let Some(sample) = due.gyro.due(time).filter(|_| wanted.gyro) {
            sink.gyro(stamp, &Gyro { rate: sim.gyro(id, sample) });
        }
        if due.ticks.due(time).is_some() && wanted.ticks {
            let [left, right] = sim.ticks(id);
            sink.ticks(stamp, &WheelTicks { left, right, ..self.wheels });
        }
        if due.head.due(time).is_some() && wanted.head {
            let head = sim.head(id);
            sink.head(stamp, &Head { pan: head.pan, tilt: head.tilt });
        }
        if due.battery.due(time).is_some() && wanted.battery {
            let charge = sim.battery(id);
            sink.battery(stamp, &Battery { voltage: charge.voltage, charge: charge.fraction });
        }
        if let Some(sample) = due.sonar.due(time).filter(|_| wanted.sonar) {
            for (which, echo) in self.echoes.echoes.iter_mut().enumerate() {
                echo.range = sim.sonar_range(id, which, sample).unwrap_or(self.echoes.range_max);
            }
            sink.sonar(stamp, &self.echoes);
        }
        if let Some(sample) = due.scan.due(time).filter(|_| wanted.scan) {
            let form = self.scan;
            sink.scan(stamp, &mut |head, ranges| {
                *head = form;
                sim.scan(id, sample, ranges)
            });
        }
        if let Some(sample) = due.landmarks.due(time).filter(|_| wanted.landmarks) {
            sink.landmarks(stamp, &Landmarks { frame: Name::new(BASE), seen: sim.landmarks(id, sample) });
        }
        if let Some(sample) = due.infrared.due(time).filter(|_| wanted.landmarks) {
            sink.landmarks(stamp, &Landmarks { frame: Name::new(BASE), seen: sim.infrared(id, sample) });
        }
        if let Some(sample) = due.image.due(time).filter(|_| wanted.image) {
            let (form, canvas) = (self.image, &mut self.canvas);
            sink.image(stamp, &mut |head, room| {
                *head = form;
                let Some(bytes) = room.get_mut(..form.len()) else { return 0 };
                sim.render(id, sample, canvas, bytes).map_or(0, |_| form.len())
            });
        }
        Ok(Polled { pressed, newly_pressed, next: None, ended: false })
    }

    fn drive(&mut self, _: &Permit, _: Time, twist: Twist) -> Result<(), DriverError> {
        let Some(limits) = &self.description.limits else { return Ok(()) };
        let wheels = limits.drive.wheels(twist);
        locked(&self.world).command_wheels(self.id, wheels.left, wheels.right);
        Ok(())
    }

    fn turn_head(&mut self, _: &Permit, _: Time, head: Head) -> Result<(), DriverError> {
        locked(&self.world).command_head(self.id, head.pan, head.tilt);
        Ok(())
    }

    fn hold_head(&mut self, _: &Permit, _: Time) -> Result<(), DriverError> {
        let mut world = locked(&self.world);
        let head = world.simulator().head(self.id);
        world.command_head(self.id, head.pan, head.tilt);
        Ok(())
    }
}
