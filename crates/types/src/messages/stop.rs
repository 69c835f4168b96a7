//! Why a robot stops, or would have to.

use crate::message::{Field, Message};

/// How a robot is being stopped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Field)]
#[repr(u8)]
pub enum StopKind {
    /// It is not.
    #[default]
    None = 0,
    /// By a ramp, since it came closer than it may: it goes on by itself when the way is clear.
    Soft = 1,
    /// At once, since it touches something or the latch is set: it goes on when somebody has reset that.
    Hard = 2,
}

/// Whether the robot is latched: it stands, whoever commands, until somebody resets that.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Message)]
#[repr(C)]
pub struct Latch {
    /// Whether it is.
    pub is_set: bool,
    /// How often it was reset.
    pub resets: u64,
}

/// What the emergency stop makes of the way ahead.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct EmergencyStop {
    /// Whether and how it stops the robot.
    pub kind: StopKind,
    /// Whether nobody sees what is ahead: that counts as an obstacle.
    pub blind: bool,
    /// Whether the latch is set, by what touched the robot, by a person, or by whoever else may.
    pub latched: bool,
    /// The way ahead, from the rim (m); infinite where nothing is in it.
    pub ahead: f64,
    /// The critical range at the present speed (m).
    pub critical: f64,
    /// The highest speed that is allowed (m/s); infinite while the way is clear.
    pub allowed: f64,
    /// The present speed (m/s).
    pub speed: f64,
}
