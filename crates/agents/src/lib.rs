//! Ready-made agents: the place where the algorithms meet the runtime.
//!
//! An agent here is thin. It reads ports, calls an algorithm of `motion` or `perception`, and writes ports. What it decides by itself
//! is a plain value with methods beside it, which its tests call without a runtime.
//!
//! | kind | takes | gives |
//! |---|---|---|
//! | [`sonar`] | a ring of echoes | ranges raw and filtered, risk in each direction |
//! | [`laser`] | a scan | ranges around the robot, risk in each direction |
//! | [`camera`] | a picture | RGB, HSI, edges, motion |
//! | [`odometry`] | wheel counts | where the robot believes to be |
//! | [`safety_monitor`] | ranges | how fast is safe, and a way out |
//! | [`wall_follower`] | ranges, odometry | a wish to drive along the wall |
//! | [`image_tracker`] | HSI picture, head | the target, wishes for feet and head |
//! | [`coordinator`] | wishes, safety, decision | one command for the drive |
//! | [`decision_maker`] | safety, target, risk, battery, odometry, load, signals | situations, goal, everybody's weight and orders, reasons |
//! | [`drive`] | a command, orders of people, a reflex | what the wheels can do of it |
//! | [`head`] | wishes, orders of people | what the head can do of it |
//!
//! Nothing here knows a simulator or a driver: a robot's ports are wired by the names that stand at the agents' ports.
#![forbid(unsafe_code)]

pub mod camera;
pub mod coordinator;
pub mod decision_maker;
pub mod drive;
pub mod head;
pub mod image_tracker;
pub mod laser;
pub mod odometry;
pub mod safety_monitor;
mod shared;
pub mod sonar;
mod trust;
pub mod wall_follower;

pub use camera::Camera;
pub use coordinator::Coordinator;
pub use decision_maker::DecisionMaker;
pub use drive::DriveBase;
pub use head::PanTilt;
pub use image_tracker::ImageTracker;
pub use laser::Laser;
pub use odometry::DeadReckoning;
pub use safety_monitor::SafetyMonitor;
pub use sonar::Sonar;
pub use wall_follower::WallFollower;

/// All agents of this crate, by their kinds.
pub fn registry() -> runtime::Registry {
    runtime::registry![
        Sonar,
        Laser,
        Camera,
        DeadReckoning,
        SafetyMonitor,
        WallFollower,
        ImageTracker,
        PanTilt,
        Coordinator,
        DriveBase,
        DecisionMaker,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_agent_is_known_by_its_kind_and_says_what_it_does() {
        let registry = registry();
        let kinds: Vec<_> = registry.types().iter().map(|known| known.kind).collect();
        let expected = [
            "sonar",
            "laser",
            "camera",
            "odometry",
            "safety-monitor",
            "wall-follower",
            "image-tracker",
            "head",
            "coordinator",
            "drive",
            "decision-maker",
        ];
        assert_eq!(kinds, expected);
        for known in registry.types() {
            assert!(known.doc.len() > 20, "{}", known.kind);
            assert!(known.ports.iter().all(|port| !port.doc.is_empty()), "a port of {}", known.kind);
        }
    }

    #[test]
    fn every_default_lies_within_the_range_of_its_parameter() {
        for known in registry().types() {
            for field in &known.params {
                let Some(x) = field.default.as_float() else { continue };
                let within = field.min.is_none_or(|min| x >= min) && field.max.is_none_or(|max| x <= max);
                assert!(within, "{} of {}: {x}", field.name, known.kind);
            }
        }
    }
}
