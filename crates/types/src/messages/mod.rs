//! The messages of the abstract robot and of the agents that come with Sinew.

mod avoidance;
mod body;
mod command;
mod decision;
mod grant;
mod image;
mod landmarks;
mod load;
mod orders;
mod path;
mod pose;
mod ranges;
mod reasons;
mod sighting;

pub use avoidance::{Avoidance, Doing, Navigation, Situation};
pub use body::{Battery, Bumper, Gyro, Head, WheelTicks};
pub use command::{Amount, Direction, Drive, Offer, Twist, Verb, Word};
pub use decision::{Decision, MOST_AGENTS, Row, Safety, Target};
pub use grant::Grant;
pub use image::{Encoding, Image};
pub use landmarks::{LandmarkSighting, Landmarks, MOST_LANDMARKS};
pub use load::Load;
pub use orders::{Activity, Order, Orders};
pub use path::{Path, WAYPOINTS, Waypoint};
pub use pose::{FrameTransform, Odometry, Transforms};
pub use ranges::{DIRECTIONS, Echo, Echoes, LaserScan, Ranges, Risk};
pub use reasons::{Held, MOST_REASONS, MOST_SITUATIONS, Reason, Reasons, Signal};
pub use sighting::Sighting;
