//! What stands in files and what stands on the screen.

#![allow(clippy::unwrap_used)] // a test that cannot go on says where

mod landmarks;
mod localizer;
mod memory;
mod mistakes;
mod round_trip;
mod schema;
mod templates;

use runtime::{AgentType, Registry};

/// All ready-made agents and the robot.
fn registry() -> Registry {
    let mut registry = agents::registry();
    registry.extend([AgentType::of::<hardware::Robot>()]);
    registry
}
