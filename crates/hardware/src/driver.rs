//! What a driver must do, whatever it drives.

use std::borrow::Cow;

use types::Time;
use types::messages::{
    Battery, Bumper, Echoes, Gyro, Head, Image, Landmarks, LaserScan, Odometry, Twist, WheelTicks,
};

use crate::description::RobotDescription;
use crate::gate::Permit;

/// The way from a driver to a robot's body, real, simulated or recorded.
///
/// The contract:
///
/// - [`poll`](Driver::poll) and [`drive`](Driver::drive) MUST NOT block, and after the first poll MUST NOT allocate.
/// - A driver MUST stop the wheels by itself in the poll in which it finds the bumper newly pressed, before it returns.
/// - A driver MUST stop the wheels by itself when [`drive`](Driver::drive) was not called for
///   [`watchdog`](RobotDescription::watchdog): who owns the driver may be dead. A board does it on the board.
/// - A driver MUST NOT compute a reading that nobody wants, and what it leaves out MUST NOT change what it delivers.
/// - A driver MUST NOT deliver anything that the robot's own sensors could not know.
///
/// A driver is given to a [`Gate`](crate::Gate) and from then on reached only through it. What moves the robot asks for a [`Permit`], and
/// only gates have one:
///
/// ```compile_fail,E0423
/// # use hardware::{Driver, gate::Permit};
/// # use types::{Time, messages::Twist};
/// fn past_the_gate(driver: &mut dyn Driver) {
///     let _ = driver.drive(&Permit(()), Time::ZERO, Twist::new(0.3, 0.0));
/// }
/// ```
///
/// ```compile_fail,E0061
/// # use hardware::{Driver, gate::Permit};
/// # use types::{Time, messages::Twist};
/// fn without_asking(driver: &mut dyn Driver) {
///     let _ = driver.drive(Time::ZERO, Twist::new(0.3, 0.0));
/// }
/// ```
pub trait Driver: Send {
    /// What the robot is. It never changes.
    fn describe(&self) -> &RobotDescription;

    /// Delivers the readings that have become due up to `now`.
    ///
    /// # Errors
    /// When the hardware cannot be reached. The gate then stands still.
    fn poll(&mut self, now: Time, wanted: &Listening, sink: &mut dyn Sink) -> Result<Polled, DriverError>;

    /// Sets the wheels in motion until the next call, or the watchdog. `twist` is finite and within the robot's limits.
    fn drive(&mut self, permit: &Permit, now: Time, twist: Twist) -> Result<(), DriverError>;

    /// Turns the head. `head` is finite and within the robot's limits.
    fn turn_head(&mut self, permit: &Permit, now: Time, head: Head) -> Result<(), DriverError>;

    /// Holds the head where it is: a stop is for everything that moves.
    fn hold_head(&mut self, permit: &Permit, now: Time) -> Result<(), DriverError>;
}

/// Which readings somebody wants.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Listening {
    /// [`Sink::sonar`]
    pub sonar: bool,
    /// [`Sink::scan`]
    pub scan: bool,
    /// [`Sink::image`]
    pub image: bool,
    /// [`Sink::ticks`]
    pub ticks: bool,
    /// [`Sink::bumper`]
    pub bumper: bool,
    /// [`Sink::gyro`]
    pub gyro: bool,
    /// [`Sink::battery`]
    pub battery: bool,
    /// [`Sink::head`]
    pub head: bool,
    /// [`Sink::pose`]
    pub pose: bool,
    /// [`Sink::landmarks`]
    pub landmarks: bool,
}

impl Listening {
    /// To everything.
    pub const ALL: Listening = Listening {
        sonar: true,
        scan: true,
        image: true,
        ticks: true,
        bumper: true,
        gyro: true,
        battery: true,
        head: true,
        pose: true,
        landmarks: true,
    };
}

/// Fills a scan in place: its head and as many ranges as have room, and says how many those are.
pub type FillScan<'a> = &'a mut dyn FnMut(&mut LaserScan, &mut [f32]) -> usize;
/// Fills a picture in place: its head and its bytes, and says how many those are.
pub type FillImage<'a> = &'a mut dyn FnMut(&mut Image, &mut [u8]) -> usize;

/// Where readings go. Each comes with the time at which it was true. What a sink does not name it does not take.
pub trait Sink {
    /// A firing of the sonar ring.
    fn sonar(&mut self, stamp: Time, echoes: &Echoes) {
        let _ = (stamp, echoes);
    }
    /// A scan of the laser.
    fn scan(&mut self, stamp: Time, fill: FillScan<'_>) {
        let _ = (stamp, fill);
    }
    /// A picture of the camera.
    fn image(&mut self, stamp: Time, fill: FillImage<'_>) {
        let _ = (stamp, fill);
    }
    /// Counts of the wheels.
    fn ticks(&mut self, stamp: Time, ticks: &WheelTicks) {
        let _ = (stamp, ticks);
    }
    /// The state of the bumper.
    fn bumper(&mut self, stamp: Time, bumper: &Bumper) {
        let _ = (stamp, bumper);
    }
    /// The turn rate.
    fn gyro(&mut self, stamp: Time, gyro: &Gyro) {
        let _ = (stamp, gyro);
    }
    /// The battery.
    fn battery(&mut self, stamp: Time, battery: &Battery) {
        let _ = (stamp, battery);
    }
    /// Where the head looks.
    fn head(&mut self, stamp: Time, head: &Head) {
        let _ = (stamp, head);
    }
    /// A pose that came with a recording, in the frame [`LOG`](crate::description::LOG).
    fn pose(&mut self, stamp: Time, pose: &Odometry) {
        let _ = (stamp, pose);
    }
    /// What is seen or heard of landmarks.
    fn landmarks(&mut self, stamp: Time, landmarks: &Landmarks) {
        let _ = (stamp, landmarks);
    }
}

/// What a poll found besides the readings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Polled {
    /// The sectors of the bumper that are pressed.
    pub pressed: u32,
    /// Those that became pressed since the last poll, even if they are not any more.
    pub newly_pressed: u32,
    /// When it is worth to poll again, besides the regular cycle.
    pub next: Option<Time>,
    /// Whether nothing will ever come again: the end of a recording.
    pub ended: bool,
}

/// The hardware cannot be reached.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what}")]
pub struct DriverError {
    /// What is wrong.
    pub what: Cow<'static, str>,
}
