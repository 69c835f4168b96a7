//! A way over the floor.

use crate::geometry::Point;
use crate::message::{Field, Message};
use crate::text::{Name, Sequence};

/// The most points that a [`Path`] can have.
pub const WAYPOINTS: usize = 32;

/// A place on the way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Field)]
#[repr(C)]
pub struct Waypoint {
    /// (m)
    pub x: f64,
    /// (m)
    pub y: f64,
    /// How fast to be there (m/s); between two points its square is linear along the line. It counts where the path has a time.
    pub speed: f64,
}

impl From<Point> for Waypoint {
    fn from(point: Point) -> Waypoint {
        Waypoint { x: point.x, y: point.y, speed: 0.0 }
    }
}

impl From<Waypoint> for Point {
    fn from(at: Waypoint) -> Point {
        Point::new(at.x, at.y)
    }
}

/// A way from where the robot is to its goal: straight from each point to the next.
///
/// `nav_msgs/Path` names a frame and a time at every point and has no end to their number; this has a speed for each, which holds also for who is late.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct Path {
    /// The frame of the points.
    pub frame: Name,
    /// Whether there is a way, as far as is known.
    pub found: bool,
    /// Whether the points end before the goal, because there is no room for more.
    pub cut: bool,
    /// How long the whole way is (m).
    pub length: f64,
    /// How good it is at least, from 0 to 1: the length of the shortest way over a grid divided by that of the one of which this is made.
    pub quality: f64,
    /// How long a robot takes at the speeds of the points (s); zero where they have none.
    pub seconds: f64,
    /// The points, from where the robot is on; none where there is no way.
    pub points: Sequence<Waypoint, WAYPOINTS>,
}
