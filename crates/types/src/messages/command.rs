//! What a drive can be asked to do.

use alloc::vec::Vec;

use crate::cdr::{Error, Field as _, NoElement, Reader, Writer};
use crate::definition::{Definition, Kind};
use crate::message::{Field, Message, ros};
use crate::time::Time;

/// A velocity in the plane; to ROS 2 a `geometry_msgs/Twist`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Twist {
    /// Forward speed (m/s).
    pub linear: f64,
    /// Turn rate, counter-clockwise positive (rad/s).
    pub angular: f64,
}

impl Twist {
    /// Standing still.
    pub const ZERO: Twist = Twist { linear: 0.0, angular: 0.0 };

    /// A forward speed (m/s) and a turn rate (rad/s).
    pub const fn new(linear: f64, angular: f64) -> Twist {
        Twist { linear, angular }
    }

    pub(crate) fn write(self, out: &mut Writer) {
        out.put(self.linear).zeros_f64(2);
        out.zeros_f64(2);
        out.put(self.angular);
    }

    pub(crate) fn read(input: &mut Reader<'_>) -> Result<Twist, Error> {
        let linear = input.get()?;
        input.skip_f64(4)?;
        Ok(Twist { linear, angular: input.get()? })
    }

    pub(crate) fn ros() -> Definition {
        let vector = || Kind::Struct(ros::vector());
        Definition::new("geometry_msgs/msg/Twist", [("linear", vector()), ("angular", vector())])
    }
}

impl Message for Twist {
    type Element = NoElement;
    const NAME: &'static str = "geometry_msgs/msg/Twist";

    fn definition() -> Definition {
        Twist::ros()
    }

    fn encode(&self, _: &[NoElement], _: Time, out: &mut Writer) {
        self.write(out);
    }

    fn decode(input: &mut Reader<'_>, _: &mut Vec<NoElement>) -> Result<Twist, Error> {
        Twist::read(input)
    }

    fn disturb(&mut self, _: &mut [NoElement], wild: bool, draw: &mut dyn FnMut() -> f64) {
        self.linear.disturb(wild, draw);
        self.angular.disturb(wild, draw);
    }

    fn between(earlier: &Twist, later: &Twist, ratio: f64) -> Option<Twist> {
        let mix = |a: f64, b: f64| a + (b - a) * ratio;
        Some(Twist::new(mix(earlier.linear, later.linear), mix(earlier.angular, later.angular)))
    }
}

/// What a linguistic command is about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Field)]
#[repr(u8)]
pub enum Verb {
    /// Turn to a side.
    Turn = 0,
    /// Drive forward or back.
    Go = 1,
    /// Change the speed.
    Speed = 2,
    /// Stand still.
    #[default]
    Stop = 3,
}

/// Where to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Field)]
#[repr(u8)]
pub enum Direction {
    /// Nowhere in particular.
    #[default]
    None = 0,
    /// To the left.
    Left = 1,
    /// To the right.
    Right = 2,
    /// Ahead.
    Forward = 3,
    /// Backwards.
    Back = 4,
    /// Faster.
    Up = 5,
    /// Slower.
    Down = 6,
}

/// How much.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Field)]
#[repr(u8)]
pub enum Amount {
    /// As it is said, without a word for it.
    #[default]
    Plain = 0,
    /// "a little bit"
    LittleBit = 1,
    /// "slightly"
    Slightly = 2,
    /// "somewhat", "more or less"
    Somewhat = 3,
    /// "very much"
    Very = 4,
    /// "extremely"
    Extremely = 5,
}

/// A command in words, such as "turn right a little bit".
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Field)]
#[repr(C)]
pub struct Word {
    /// What it is about.
    pub verb: Verb,
    /// Where to.
    pub direction: Direction,
    /// How much.
    pub amount: Amount,
}

/// Whether a command is in numbers or in words.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Field)]
#[repr(u8)]
pub enum Drive {
    /// The numbers of [`Offer::twist`].
    #[default]
    Numeric = 0,
    /// The words of [`Offer::word`].
    Linguistic = 1,
}

/// A command that somebody wishes the drive to follow: the coordinator weighs it against the others.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct Offer {
    /// The wish in numbers.
    pub twist: Twist,
    /// How much it matters to the one who offers, from 0 to 1.
    pub weight: f64,
    /// Until when it holds.
    pub valid_until: Time,
    /// The wish in words.
    pub word: Word,
    /// Which of the two counts.
    pub form: Drive,
}

impl crate::cdr::Field for Twist {
    fn kind() -> Kind {
        Kind::Struct(Twist::ros())
    }
    fn write(&self, out: &mut Writer) {
        Twist::write(*self, out);
    }
    fn read(input: &mut Reader<'_>) -> Result<Twist, Error> {
        Twist::read(input)
    }
}
