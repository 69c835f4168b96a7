//! What a robot is: sensors, mounts, limits, the kind of its clock.

use motion::limits::Limits;
use types::messages::FrameTransform;
use types::{Duration, Name, Pose};

/// Which clock a driver keeps time with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ClockKind {
    /// Its world is simulated: it is where the caller's time says.
    #[default]
    Simulated,
    /// It plays what was recorded: any clock will do, and a simulated one is fastest.
    Recorded,
    /// It is a thing in the world: only the wall clock will do.
    Wall,
}

/// How often each sensor is read; nothing for a sensor that the robot has not. Recorded sensors come when they came, which is
/// said by a period of zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Periods {
    /// The ring of sonars.
    pub sonar: Option<Duration>,
    /// The laser.
    pub scan: Option<Duration>,
    /// The camera.
    pub image: Option<Duration>,
    /// The wheel encoders.
    pub ticks: Option<Duration>,
    /// The bumper; it is also told at once when it changes.
    pub bumper: Option<Duration>,
    /// The gyro.
    pub gyro: Option<Duration>,
    /// The battery.
    pub battery: Option<Duration>,
    /// The joints of the head.
    pub head: Option<Duration>,
    /// Poses that came with a recording.
    pub pose: Option<Duration>,
    /// What sees or hears landmarks; where there is both, the more frequent.
    pub landmarks: Option<Duration>,
}

/// How far a head turns and nods.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadLimits {
    /// To either side (rad).
    pub pan_max: f64,
    /// Up or down (rad).
    pub tilt_max: f64,
}

/// What a driver says of its robot.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotDescription {
    /// The driver: `sim`, `carmen` …
    pub driver: &'static str,
    /// The clock it keeps time with.
    pub clock: ClockKind,
    /// Its sensors.
    pub periods: Periods,
    /// Where its sensors sit.
    pub mounts: Vec<FrameTransform>,
    /// What its drive can do; nothing when it cannot be driven, and commands only leave a trace in the counts.
    pub limits: Option<Limits>,
    /// Sectors of its bumper, the first straight ahead, the others counter-clockwise.
    pub bumper_sectors: u32,
    /// What its head can do, if it has one.
    pub head: Option<HeadLimits>,
    /// Without a command for this long the hardware stops by itself.
    pub watchdog: Duration,
    /// The most beams of a scan.
    pub beams: usize,
    /// Bytes of a picture.
    pub picture: usize,
}

impl RobotDescription {
    /// A robot that has nothing and cannot be driven: the start from which a driver describes its own.
    pub fn bare(driver: &'static str, clock: ClockKind) -> RobotDescription {
        RobotDescription {
            driver,
            clock,
            periods: Periods::default(),
            mounts: Vec::new(),
            limits: None,
            bumper_sectors: 0,
            head: None,
            watchdog: Duration::ZERO,
            beams: 0,
            picture: 0,
        }
    }

    /// Adds the place of a sensor on the robot's body.
    pub fn mount(&mut self, child: &str, base_from_child: Pose, z: f64) {
        let edge =
            FrameTransform { parent: Name::new(BASE), child: Name::new(child), pose: base_from_child, z };
        self.mounts.push(edge);
    }
}

/// The frame of the robot's body: its origin is on the floor between the wheels.
pub const BASE: &str = "base_link";
/// The frame of the laser.
pub const LASER: &str = "laser";
/// The frame of the camera.
pub const CAMERA: &str = "camera";
/// The frame of poses that came with a recording. Nobody knows how they were made.
pub const LOG: &str = "log";
