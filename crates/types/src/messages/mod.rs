//! The messages of the abstract robot and of the agents that come with Sinew.

mod body;
mod command;
mod decision;
mod grant;
mod image;
mod landmarks;
mod load;
mod localisation;
mod mode;
mod orders;
mod path;
mod pose;
mod ranges;
mod reasons;
mod sighting;
mod stop;
mod task;
mod world;

pub use body::{Battery, Bumper, Gyro, Head, WheelTicks};
pub use command::{Amount, Direction, Drive, Offer, Twist, Verb, Word};
pub use decision::{Decision, MOST_AGENTS, Row, Safety, Target};
pub use grant::Grant;
pub use image::{Encoding, Image};
pub use landmarks::{LandmarkSighting, Landmarks, MOST_LANDMARKS};
pub use load::Load;
pub use localisation::{GUESSES, Guess, Localisation, Placed, Placement, Whereabouts};
pub use mode::{Coordination, Mode, ModeRow};
pub use orders::{Activity, Order, Orders};
pub use path::{Path, WAYPOINTS, Waypoint};
pub use pose::{FrameTransform, Odometry, Transforms};
pub use ranges::{DIRECTIONS, Echo, Echoes, LaserScan, Ranges, Risk};
pub use reasons::{Held, MOST_REASONS, MOST_SITUATIONS, Reason, Reasons, Signal};
pub use sighting::Sighting;
pub use stop::{EmergencyStop, StopKind};
pub use task::{Answer, Goal, Halt, Manoeuvre, Motion, Progress, Report, Task};
pub use world::{WorldAnswer, WorldName, WorldPlace, WorldPush, WorldSlip, WorldThing};
