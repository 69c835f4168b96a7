//! What a robot knows of its own body.

use alloc::vec::Vec;

use crate::cdr::{Error, Field as _, NoElement, Reader, Writer};
use crate::definition::{Definition, Kind};
use crate::message::{Message, ros};
use crate::time::Time;

/// Counts of the wheel encoders since the start, and what a count means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct WheelTicks {
    /// Of the left wheel.
    pub left: i64,
    /// Of the right wheel.
    pub right: i64,
    /// Counts of one turn of a wheel.
    pub ticks_per_turn: f64,
    /// Radius of a wheel (m).
    pub wheel_radius: f64,
    /// From wheel to wheel (m).
    pub track: f64,
}

/// Which parts of the bumper are pressed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Message)]
#[repr(C)]
pub struct Bumper {
    /// A bit for each sector, counter-clockwise, the first straight ahead.
    pub sectors: u32,
}

impl Bumper {
    /// Whether anything is touched.
    pub const fn pressed(self) -> bool {
        self.sectors != 0
    }
}

/// The turn rate that a gyroscope feels; to ROS 2 a `sensor_msgs/Imu` that knows nothing else.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Gyro {
    /// Counter-clockwise (rad/s).
    pub rate: f64,
}

impl Message for Gyro {
    type Element = NoElement;
    const NAME: &'static str = "sensor_msgs/msg/Imu";

    fn definition() -> Definition {
        let nine = || Kind::Array(Kind::F64.into(), 9);
        Definition::new(
            Self::NAME,
            [
                ("header", Kind::Struct(ros::header())),
                ("orientation", Kind::Struct(ros::quaternion())),
                ("orientation_covariance", nine()),
                ("angular_velocity", Kind::Struct(ros::vector())),
                ("angular_velocity_covariance", nine()),
                ("linear_acceleration", Kind::Struct(ros::vector())),
                ("linear_acceleration_covariance", nine()),
            ],
        )
    }

    /// A covariance that begins with −1 says that the quantity is not measured.
    fn encode(&self, _: &[NoElement], stamp: Time, out: &mut Writer) {
        out.header(stamp, "base_link");
        out.zeros_f64(3);
        out.put(1.0).put(-1.0).zeros_f64(8);
        out.zeros_f64(2);
        out.put(self.rate).zeros_f64(9);
        out.zeros_f64(3);
        out.put(-1.0).zeros_f64(8);
    }

    fn decode(input: &mut Reader<'_>, _: &mut Vec<NoElement>) -> Result<Gyro, Error> {
        input.header()?;
        input.skip_f64(4 + 9 + 2)?;
        let rate = input.get()?;
        input.skip_f64(9 + 3 + 9)?;
        Ok(Gyro { rate })
    }

    fn disturb(&mut self, _: &mut [NoElement], wild: bool, draw: &mut dyn FnMut() -> f64) {
        self.rate.disturb(wild, draw);
    }
}

/// What is left in the battery; to ROS 2 a `sensor_msgs/BatteryState`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Battery {
    /// (V)
    pub voltage: f64,
    /// What is left, from 0 to 1.
    pub charge: f64,
}

impl Message for Battery {
    type Element = NoElement;
    const NAME: &'static str = "sensor_msgs/msg/BatteryState";

    fn definition() -> Definition {
        Definition::new(
            Self::NAME,
            [
                ("header", Kind::Struct(ros::header())),
                ("voltage", Kind::F32),
                ("temperature", Kind::F32),
                ("current", Kind::F32),
                ("charge", Kind::F32),
                ("capacity", Kind::F32),
                ("design_capacity", Kind::F32),
                ("percentage", Kind::F32),
                ("power_supply_status", Kind::U8),
                ("power_supply_health", Kind::U8),
                ("power_supply_technology", Kind::U8),
                ("present", Kind::Bool),
                ("cell_voltage", Kind::Sequence(Kind::F32.into())),
                ("cell_temperature", Kind::Sequence(Kind::F32.into())),
                ("location", Kind::String),
                ("serial_number", Kind::String),
            ],
        )
    }

    /// What is not measured is NaN, as the definition asks.
    fn encode(&self, _: &[NoElement], stamp: Time, out: &mut Writer) {
        out.header(stamp, "base_link");
        out.put(self.voltage as f32);
        for _ in 0..5 {
            out.put(f32::NAN);
        }
        out.put(self.charge as f32).put(0u8).put(0u8).put(0u8).put(true);
        out.row::<f32>(&[]);
        out.row::<f32>(&[]);
        out.text("");
        out.text("");
    }

    fn decode(input: &mut Reader<'_>, _: &mut Vec<NoElement>) -> Result<Battery, Error> {
        input.header()?;
        let voltage: f32 = input.get()?;
        for _ in 0..5 {
            let _: f32 = input.get()?;
        }
        let charge: f32 = input.get()?;
        Ok(Battery { voltage: voltage.into(), charge: charge.into() })
    }
}

/// Where a pan-tilt head looks, or shall look.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct Head {
    /// To the left (rad).
    pub pan: f64,
    /// Upwards (rad).
    pub tilt: f64,
}
