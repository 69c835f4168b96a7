//! A hand that takes a robot up and puts it elsewhere.

use std::sync::{Arc, Mutex};

use sim::RobotId;
use sim::simulator::AddError;
use types::Pose;

use super::world::World;
use super::{Simulated, locked};

/// A hand at a robot, for whoever plays people in simulated time. It takes the lock of the world: on the wall clock drivers would wait for it.
#[derive(Clone, Debug)]
pub struct Hand {
    world: Arc<Mutex<World>>,
    id: RobotId,
}

impl Simulated {
    /// A hand at this robot.
    pub fn hand(&self) -> Hand {
        Hand { world: self.world.clone(), id: self.id }
    }
}

impl Hand {
    /// Puts the robot elsewhere; its wheels do not turn on the way.
    ///
    /// # Errors
    /// When the place is not free; then it stays where it is.
    pub fn put(&self, pose: Pose) -> Result<(), AddError> {
        locked(&self.world).put(self.id, pose)
    }
}
