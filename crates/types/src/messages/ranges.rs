//! Distances to what is around.

use alloc::vec::Vec;

use crate::cdr::{Error, Field as _, NoElement, Reader, Writer};
use crate::definition::{Definition, Kind};
use crate::geometry::Point;
use crate::message::{Field, Message, ros};
use crate::text::{Name, Sequence};
use crate::time::Time;

/// The most directions that a [`Ranges`] or [`Risk`] can have.
pub const DIRECTIONS: usize = 64;

/// What one transducer of a ring heard, with its place on the robot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Field)]
#[repr(C)]
pub struct Echo {
    /// Its place ahead of the robot's centre (m).
    pub x: f32,
    /// Its place to the left of the robot's centre (m).
    pub y: f32,
    /// Where it looks (rad, counter-clockwise from ahead).
    pub bearing: f32,
    /// Distance from it to the first echo (m); `range_max` of the ring when there was none.
    pub range: f32,
}

/// One firing of a whole ring of sonars, as the hardware gives it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct Echoes {
    /// Nearer things cannot be told (m).
    pub range_min: f32,
    /// Farther things cannot be heard (m).
    pub range_max: f32,
    /// Opening of the cone, from side to side (rad).
    pub cone: f32,
    /// One for each transducer.
    pub echoes: Sequence<Echo, 32>,
}

/// Distances around the robot's centre in evenly spaced directions, whatever measured them; to ROS 2 a
/// `sensor_msgs/LaserScan` of few beams.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Ranges {
    /// The frame at whose origin the distances begin.
    pub frame: Name,
    /// The first direction (rad, counter-clockwise from ahead).
    pub angle_min: f32,
    /// From one direction to the next (rad).
    pub angle_step: f32,
    /// Nearer things cannot be told (m).
    pub range_min: f32,
    /// Nothing was met up to here (m).
    pub range_max: f32,
    /// The distances (m).
    pub values: Sequence<f32, DIRECTIONS>,
}

/// How likely it is that something in a direction will be run into: a number from 0 to 1 for each direction of a [`Ranges`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct Risk {
    /// The first direction (rad, counter-clockwise from ahead).
    pub angle_min: f32,
    /// From one direction to the next (rad).
    pub angle_step: f32,
    /// From 0 (none) to 1.
    pub values: Sequence<f32, DIRECTIONS>,
}

/// A scan of a laser range finder: the distances (m) are the row behind it; to ROS 2 a `sensor_msgs/LaserScan`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct LaserScan {
    /// The frame of the laser.
    pub frame: Name,
    /// Direction of the first beam (rad).
    pub angle_min: f32,
    /// From one beam to the next (rad).
    pub angle_step: f32,
    /// Nearer things cannot be told (m).
    pub range_min: f32,
    /// Nothing was met up to here (m).
    pub range_max: f32,
    /// How long one scan takes (s).
    pub scan_time: f32,
    /// Where the laser sits ahead of the robot's centre (m).
    pub mount_x: f32,
    /// Where it sits to the left of the robot's centre (m).
    pub mount_y: f32,
    /// Where it looks (rad).
    pub mount_heading: f32,
}

impl Ranges {
    /// The direction of value `i` (rad).
    pub fn bearing(&self, i: usize) -> f64 {
        f64::from(self.angle_min) + i as f64 * f64::from(self.angle_step)
    }

    /// Direction (rad) and distance (m) of each value.
    pub fn polar(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.values.iter().enumerate().map(|(i, range)| (self.bearing(i), f64::from(*range)))
    }

    /// The points that were met, around the robot's centre (m); directions in which nothing was met give none.
    pub fn points(&self) -> impl Iterator<Item = Point> + '_ {
        let far = f64::from(self.range_max) - 1e-3;
        self.polar()
            .filter(move |(_, range)| *range < far)
            .map(|(bearing, range)| Point::polar(range, bearing))
    }
}

/// `sensor_msgs/LaserScan`.
fn laser_scan() -> Definition {
    Definition::new(
        "sensor_msgs/msg/LaserScan",
        [
            ("header", Kind::Struct(ros::header())),
            ("angle_min", Kind::F32),
            ("angle_max", Kind::F32),
            ("angle_increment", Kind::F32),
            ("time_increment", Kind::F32),
            ("scan_time", Kind::F32),
            ("range_min", Kind::F32),
            ("range_max", Kind::F32),
            ("ranges", Kind::Sequence(Kind::F32.into())),
            ("intensities", Kind::Sequence(Kind::F32.into())),
        ],
    )
}

/// The fields of a `sensor_msgs/LaserScan` that both types know.
struct Beams<'a> {
    frame: &'a str,
    angle_min: f32,
    angle_step: f32,
    scan_time: f32,
    range_min: f32,
    range_max: f32,
}

impl Beams<'_> {
    fn write(&self, stamp: Time, ranges: &[f32], out: &mut Writer) {
        let angle_max = self.angle_min + self.angle_step * ranges.len().saturating_sub(1) as f32;
        out.header(stamp, self.frame);
        out.put(self.angle_min).put(angle_max).put(self.angle_step).put(0f32).put(self.scan_time);
        out.put(self.range_min).put(self.range_max);
        out.row(ranges);
        out.row::<f32>(&[]);
    }

    fn read<'a>(input: &mut Reader<'a>) -> Result<Beams<'a>, Error> {
        let (_, frame) = input.header()?;
        let angle_min = input.get()?;
        let _angle_max: f32 = input.get()?;
        let angle_step = input.get()?;
        let _time_step: f32 = input.get()?;
        Ok(Beams {
            frame,
            angle_min,
            angle_step,
            scan_time: input.get()?,
            range_min: input.get()?,
            range_max: input.get()?,
        })
    }
}

impl Message for Ranges {
    type Element = NoElement;
    const NAME: &'static str = "sensor_msgs/msg/LaserScan";

    fn definition() -> Definition {
        laser_scan()
    }

    fn encode(&self, _: &[NoElement], stamp: Time, out: &mut Writer) {
        let Ranges { angle_min, angle_step, range_min, range_max, .. } = *self;
        let beams =
            Beams { frame: self.frame.as_str(), angle_min, angle_step, scan_time: 0.0, range_min, range_max };
        beams.write(stamp, &self.values, out);
    }

    fn decode(input: &mut Reader<'_>, _: &mut Vec<NoElement>) -> Result<Ranges, Error> {
        let Beams { frame, angle_min, angle_step, range_min, range_max, .. } = Beams::read(input)?;
        let frame = Name::new(frame);
        Ok(Ranges { frame, angle_min, angle_step, range_min, range_max, values: input.get()? })
    }

    fn disturb(&mut self, _: &mut [NoElement], wild: bool, draw: &mut dyn FnMut() -> f64) {
        self.values.disturb(wild, draw);
    }
}

impl Message for LaserScan {
    type Element = f32;
    const NAME: &'static str = "sensor_msgs/msg/LaserScan";

    fn definition() -> Definition {
        laser_scan()
    }

    fn encode(&self, row: &[f32], stamp: Time, out: &mut Writer) {
        let LaserScan { angle_min, angle_step, range_min, range_max, scan_time, .. } = *self;
        Beams { frame: self.frame.as_str(), angle_min, angle_step, scan_time, range_min, range_max }
            .write(stamp, row, out);
    }

    /// The mount is not part of a `sensor_msgs/LaserScan`: it comes back as zero, and stands in the frame tree.
    fn decode(input: &mut Reader<'_>, row: &mut Vec<f32>) -> Result<LaserScan, Error> {
        let Beams { frame, angle_min, angle_step, scan_time, range_min, range_max } = Beams::read(input)?;
        let frame = Name::new(frame);
        input.row(row)?;
        Ok(LaserScan {
            frame,
            angle_min,
            angle_step,
            range_min,
            range_max,
            scan_time,
            ..LaserScan::default()
        })
    }
}
