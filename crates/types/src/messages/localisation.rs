//! Whether it is known where the robot is, and how well.

use crate::message::{Field, Message};
use crate::text::Sequence;

/// The most places that a [`Localisation`] names.
pub const GUESSES: usize = 8;

/// Whether it is known where the robot is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Field)]
#[repr(u8)]
pub enum Whereabouts {
    /// Not known, and nothing is seen by which it could be found.
    #[default]
    Lost = 0,
    /// Not known; it is searched for.
    Searching = 1,
    /// Known.
    Tracking = 2,
}

/// A place where the robot may be.
#[derive(Clone, Copy, Debug, Default, PartialEq, Field)]
#[repr(C)]
pub struct Guess {
    /// (m)
    pub x: f64,
    /// (m)
    pub y: f64,
    /// (rad)
    pub heading: f64,
    /// The share of what is seen that fits there, from 0 to 1.
    pub inliers: f64,
}

/// How well it is known where the robot is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct Localisation {
    /// Whether it is known.
    pub state: Whereabouts,
    /// Standard deviation of the place, along the axis in which it is larger (m).
    pub deviation: f64,
    /// Standard deviation of the heading (rad).
    pub heading_deviation: f64,
    /// The share of what is seen that the floor plan shows, from 0 to 1.
    pub inliers: f64,
    /// While it is searched: the places that fit, the best first. Several that stay are places that look the same.
    pub guesses: Sequence<Guess, GUESSES>,
}

impl Localisation {
    /// Whether it is known where the robot is.
    pub const fn is_known(&self) -> bool {
        matches!(self.state, Whereabouts::Tracking)
    }
}

/// Somebody says where the robot is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct Placement {
    /// (m)
    pub x: f64,
    /// (m)
    pub y: f64,
    /// (rad)
    pub heading: f64,
    /// Standard deviation of the place (m); 0 for what the one who is told takes for usual.
    pub deviation: f64,
    /// Standard deviation of the heading (rad); 0 for what the one who is told takes for usual.
    pub heading_deviation: f64,
    /// Whether it is not known at all: the rest does not count then, and the robot is searched for everywhere.
    pub anywhere: bool,
}

/// What became of a [`Placement`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Message)]
#[repr(C)]
pub struct Placed {
    /// Whether it was taken.
    pub taken: bool,
}
