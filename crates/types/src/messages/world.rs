//! What a simulated world can be asked while it runs.

use crate::message::Message;
use crate::text::{Name, Text};

/// A thing to be put into the world: a box, or a cylinder where it has a radius.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct WorldThing {
    /// Its name, by which it is put elsewhere and taken away.
    pub name: Name,
    /// Its middle (m).
    pub x: f64,
    /// Its middle (m).
    pub y: f64,
    /// How it is turned (rad).
    pub heading: f64,
    /// Length of a box (m).
    pub length: f64,
    /// Width of a box (m).
    pub width: f64,
    /// Radius of a cylinder (m); 0 for a box.
    pub radius: f64,
    /// Its height (m); 0 is 1 m.
    pub height: f64,
    /// Its colour by name, as in a world file; without one it is grey.
    pub colour: Name,
}

/// Where something is to be put that has a name: a thing that was added, or a robot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct WorldPlace {
    /// Its name.
    pub name: Name,
    /// Its middle (m).
    pub x: f64,
    /// Its middle (m).
    pub y: f64,
    /// How it is turned (rad).
    pub heading: f64,
}

/// The name of a thing that was added.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct WorldName {
    /// Its name.
    pub name: Name,
}

/// A push: the robot is displaced, and its wheels count nothing of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct WorldPush {
    /// The robot.
    pub robot: Name,
    /// How far it is pushed ahead (m).
    pub ahead: f64,
    /// How far it is pushed to its left (m).
    pub left: f64,
    /// How far it is turned to its left (rad).
    pub turn: f64,
}

/// For some time the wheels of a robot lose a share of their way, and count it all the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct WorldSlip {
    /// The robot.
    pub robot: Name,
    /// The share that the left wheel loses, 0 to 1.
    pub left: f64,
    /// The share that the right wheel loses, 0 to 1.
    pub right: f64,
    /// For how long (s).
    pub seconds: f64,
}

/// What became of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct WorldAnswer {
    /// Whether it was done; where it was not, nothing changed.
    pub done: bool,
    /// Why it was not done.
    pub why: Text<64>,
    /// The part of a push that was free, 0 to 1; 1 for all else that was done.
    pub part: f64,
}
