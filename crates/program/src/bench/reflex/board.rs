//! A robot whose sensors see something appear and go in turns, and that says how long it took until its wheels were told.

use hardware::driver::{DriverError, Polled};
use hardware::gate::Permit;
use hardware::{ClockKind, Driver, Listening, RobotDescription, Sink};
use motion::kinematics::Differential;
use motion::limits::Limits;
use types::geometry::TAU;
use types::messages::{Echo, Echoes, Head, LaserScan, Twist, WheelTicks};
use types::{Duration, Sequence, Time};

use super::{CYCLE, WARM_UP};
use crate::bench::parcel::{Shelf, now, room};

/// Transducers of the ring, and beams of the laser.
const TRANSDUCERS: usize = 12;
const BEAMS: usize = 181;
/// What is ahead at a contact, and what is around else (m).
const NEAR: f32 = 0.1;
const FAR: f32 = 4.0;
/// Radius of a wheel, and from wheel to wheel (m).
const WHEEL: f64 = 0.1;
const TRACK: f64 = 0.4;

/// With which sensor it sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Eye {
    /// A ring of sonars.
    Sonar,
    /// A laser; and the wheels are counted.
    Laser,
}

pub(super) struct Board {
    description: RobotDescription,
    eye: Eye,
    cycle: u64,
    next: Time,
    /// When the contact was that has not been answered (ns); 0 when there is none.
    contact: u64,
    /// How fast the wheels were told to go last (m/s).
    speed: f64,
    spans: Vec<f64>,
    shelf: Shelf,
}

impl Board {
    pub(super) fn new(eye: Eye, contacts: usize, shelf: Shelf) -> Board {
        let mut description = RobotDescription::bare("board", ClockKind::Wall);
        match eye {
            Eye::Sonar => description.periods.sonar = Some(CYCLE),
            Eye::Laser => {
                (description.periods.scan, description.periods.ticks) = (Some(CYCLE), Some(CYCLE));
                description.beams = BEAMS;
            }
        }
        description.watchdog = Duration::secs(1);
        // As fast as the command says: a ramp is no part of the chain.
        let quick = Limits::indoor(Differential::new(WHEEL, TRACK));
        description.limits = Some(Limits {
            acceleration: 1e9,
            deceleration: 1e9,
            angular_acceleration: 1e9,
            wheel_max: 1e3,
            ..quick
        });
        let (spans, next) = (room(contacts), Time::ZERO);
        Board { description, eye, cycle: 0, next, contact: 0, speed: 0.0, spans, shelf }
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        self.shelf.put(&self.spans);
    }
}

fn ring(ahead: f32) -> Echoes {
    let mut echoes = Sequence::default();
    for number in 0..TRANSDUCERS {
        let bearing = number as f64 * TAU / TRANSDUCERS as f64;
        let range = if number == 0 { ahead } else { FAR };
        let (x, y) = ((0.2 * bearing.cos()) as f32, (0.2 * bearing.sin()) as f32);
        // There is room for all of them.
        let _ = echoes.push(Echo { x, y, bearing: bearing as f32, range });
    }
    Echoes { range_min: 0.03, range_max: 6.0, cone: 0.26, echoes }
}

/// Over half a turn, of which the contact takes ten degrees.
fn scan(ahead: f32, head: &mut LaserScan, row: &mut [f32]) -> usize {
    let step = TAU / 2.0 / (BEAMS - 1) as f64;
    (head.angle_min, head.angle_step) = ((-TAU / 4.0) as f32, step as f32);
    (head.range_min, head.range_max) = (0.02, 8.0);
    for (i, range) in row.iter_mut().enumerate().take(BEAMS) {
        *range = if i.abs_diff(BEAMS / 2) <= 5 { ahead } else { FAR };
    }
    BEAMS
}

impl Driver for Board {
    fn describe(&self) -> &RobotDescription {
        &self.description
    }

    fn poll(&mut self, time: Time, _: &Listening, sink: &mut dyn Sink) -> Result<Polled, DriverError> {
        if time >= self.next {
            self.next = time + CYCLE / 2;
            self.cycle += 1;
            let is_near = self.cycle.is_multiple_of(2);
            let ahead = if is_near { NEAR } else { FAR };
            let echoes = (self.eye == Eye::Sonar).then(|| ring(ahead));
            if is_near && self.cycle > WARM_UP {
                self.contact = now();
            }
            match echoes {
                Some(echoes) => sink.sonar(time, &echoes),
                None => {
                    let (ticks_per_turn, wheel_radius, track) = (1000.0, WHEEL, TRACK);
                    sink.ticks(time, &WheelTicks { left: 0, right: 0, ticks_per_turn, wheel_radius, track });
                    sink.scan(time, &mut |head, row| scan(ahead, head, row));
                }
            }
        }
        Ok(Polled::default())
    }

    fn drive(&mut self, _: &Permit, _: Time, twist: Twist) -> Result<(), DriverError> {
        let is_slower = twist.linear < self.speed;
        self.speed = twist.linear;
        if self.contact != 0 && is_slower {
            let span = now().saturating_sub(self.contact);
            self.shelf.keep(&mut self.spans, span as f64);
            self.contact = 0;
        }
        Ok(())
    }

    fn turn_head(&mut self, _: &Permit, _: Time, _: Head) -> Result<(), DriverError> {
        Ok(())
    }

    fn hold_head(&mut self, _: &Permit, _: Time) -> Result<(), DriverError> {
        Ok(())
    }
}
