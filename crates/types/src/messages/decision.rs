//! What the robot makes of what it sees.

use crate::message::{Field, Message};
use crate::text::{Name, Sequence};

/// What the safety monitor says of the surroundings and allows the drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct Safety {
    /// How dangerous it is, from 0 to 1.
    pub danger: f64,
    /// The greatest forward speed that stops in time (m/s); zero forbids to move forward, not to turn.
    pub linear_max: f64,
    /// The wider side: positive is left, from −1 to 1.
    pub wider: f64,
    /// Distance from the robot's rim to what is nearest (m).
    pub nearest: f64,
    /// Where that is (rad, counter-clockwise from ahead).
    pub nearest_bearing: f64,
    /// Whether there is little room on both sides.
    pub narrow: bool,
    /// Whether the readings are too old to be trusted.
    pub blind: bool,
}

/// What the tracker follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct Target {
    /// Where it is from the robot (rad, counter-clockwise from ahead), the pan of the head included.
    pub bearing: f64,
    /// How high it is from the camera (rad), the tilt of the head included.
    pub elevation: f64,
    /// Its share of the picture's area, from 0 to 1.
    pub share: f64,
    /// How much it is to be followed, from 0 to 1.
    pub desire: f64,
    /// Whether it is in the picture.
    pub visible: bool,
}

/// How many agents a decision has room for.
pub const MOST_AGENTS: usize = 12;

/// What a decision gives one agent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Field)]
#[repr(C)]
pub struct Row {
    /// The agent.
    pub agent: Name,
    /// The weight of its offers, from 0 to 1.
    pub weight: f64,
    /// The situation whose row says so.
    pub by: Name,
}

/// What the decision maker recognises, and what it sets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct Decision {
    /// The situation, a key of the decision table: of those that are active the one of the highest priority.
    pub situation: Name,
    /// The situation before.
    pub before: Name,
    /// The agent with the greatest weight.
    pub active: Name,
    /// The danger it was decided on, from 0 to 1.
    pub danger: f64,
    /// The desire it was decided on, from 0 to 1.
    pub desire: f64,
    /// What the robot is to strive for; empty where no active situation says.
    pub goal: Name,
    /// The weights.
    pub rows: Sequence<Row, MOST_AGENTS>,
}
