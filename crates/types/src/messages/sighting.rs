//! What a recogniser sees.

use crate::message::Message;
use crate::text::Name;

/// Whether a thing is in the picture, and where.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct Sighting {
    /// What it is: the word that the recogniser was given for what it looks for.
    pub what: Name,
    /// Where it is from the robot (rad, counter-clockwise from ahead), the pan of the head included.
    pub bearing: f64,
    /// How high it is from the camera (rad), the tilt of the head included.
    pub elevation: f64,
    /// Its share of the picture's area, from 0 to 1.
    pub share: f64,
    /// How sure the recogniser is, from 0 to 1.
    pub confidence: f64,
    /// Whether it is in the picture; where it is not, the other numbers are those of the last time.
    pub visible: bool,
}
