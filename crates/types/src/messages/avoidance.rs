//! What an avoidance sees around the robot and makes of it, and what a navigator is doing.

use crate::message::{Field, Message};
use crate::messages::Twist;

/// What the surroundings are like to one that avoids obstacles.
///
/// The six in the middle are those of the Nearness Diagram: is an obstacle nearer than the security distance, on which sides of the way,
/// does the goal lie in the chosen region of free directions, and how wide is that.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Field)]
#[repr(u8)]
pub enum Situation {
    /// Nothing was measured lately: whatever is not seen is an obstacle.
    #[default]
    Blind = 0,
    /// Something touches the body, or is within the shell around it: it stands.
    Touching = 1,
    /// No region leads anywhere: it stands.
    NoWay = 2,
    /// HSGR: nothing is near, and the goal lies in the region: towards the goal.
    HighSafetyGoalInRegion = 3,
    /// HSWR: nothing is near, the region is wide: along its obstacle, at the security distance.
    HighSafetyWideRegion = 4,
    /// HSNR: nothing is near, the region is narrow: through its middle.
    HighSafetyNarrowRegion = 5,
    /// LS1: obstacles are near on one side: away from the nearest one.
    LowSafetyOneSide = 6,
    /// LSGR: obstacles are near on one side, and the goal lies in the region.
    LowSafetyGoalInRegion = 7,
    /// LS2: obstacles are near on both sides: between the nearest ones.
    LowSafetyTwoSides = 8,
    /// The goal is reached: it stands.
    AtGoal = 9,
    /// By a law that knows no situations: it moves.
    Moving = 10,
}

impl Situation {
    /// Whether it is a reason to drive otherwise than straight to the goal.
    pub const fn is_reason(self) -> bool {
        !matches!(self, Situation::HighSafetyGoalInRegion | Situation::AtGoal)
    }

    /// The short name by which the literature calls it, or a word.
    pub const fn label(self) -> &'static str {
        match self {
            Situation::Blind => "blind",
            Situation::Touching => "touching",
            Situation::NoWay => "no way",
            Situation::HighSafetyGoalInRegion => "HSGR",
            Situation::HighSafetyWideRegion => "HSWR",
            Situation::HighSafetyNarrowRegion => "HSNR",
            Situation::LowSafetyOneSide => "LS1",
            Situation::LowSafetyGoalInRegion => "LSGR",
            Situation::LowSafetyTwoSides => "LS2",
            Situation::AtGoal => "at goal",
            Situation::Moving => "moving",
        }
    }
}

/// What an avoidance made of the surroundings, with the numbers that say why.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct Avoidance {
    /// What the surroundings are like.
    pub situation: Situation,
    /// The motion that follows.
    pub twist: Twist,
    /// Where to (rad, from ahead to the left).
    pub direction: f64,
    /// Where the goal is (rad).
    pub goal: f64,
    /// Where it would go if nothing were near (rad).
    pub free: f64,
    /// The right end of the chosen region (rad).
    pub region_right: f64,
    /// The left end of the chosen region (rad); further to the left than the right end, beyond π if it must.
    pub region_left: f64,
    /// How much of the security distance the nearest obstacle on the left leaves: from 0, it touches, to 1, it is not near.
    pub left: f64,
    /// The same on the right.
    pub right: f64,
    /// Distance of what is nearest from the edge of the body (m); infinite if nothing is around.
    pub nearest: f64,
    /// Where that is (rad).
    pub nearest_bearing: f64,
}

/// What a navigator is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Field)]
#[repr(u8)]
pub enum Doing {
    /// Standing: it has seen nothing lately.
    #[default]
    Blind = 0,
    /// Standing: it has no goal.
    Idle = 1,
    /// Standing at the goal.
    Arrived = 2,
    /// Pursuing its way.
    Pursuing = 3,
    /// Braking where that leaves most room.
    Braking = 4,
    /// Avoiding what is near, for no pursuit of the way ends well.
    Avoiding = 5,
    /// Turning in place towards the way.
    Turning = 6,
    /// Backing off.
    Backing = 7,
    /// Getting out of where it is stuck.
    Escaping = 8,
    /// Standing: no way is open.
    NoWay = 9,
    /// Standing: it was stuck, and no try got it out.
    GivenUp = 10,
}

/// What a navigator makes of what it sees.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct Navigation {
    /// What it is doing.
    pub doing: Doing,
    /// The motion that follows.
    pub twist: Twist,
    /// Room that this leaves around the body until it stands (m).
    pub room: f64,
    /// Length of the way that is left, as far as it is known (m).
    pub left: f64,
}
