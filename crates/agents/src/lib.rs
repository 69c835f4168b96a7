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
//! | [`lookout`] | ranges, sightings | the nearer of what is heard and who is seen |
//! | [`safety_monitor`] | ranges | how fast is safe, and a way out |
//! | [`wall_follower`] | ranges, odometry | a wish to drive along the wall |
//! | [`image_tracker`] | HSI picture, head | the target, wishes for feet and head |
//! | [`recogniser`] | a picture, head | whether a thing of a colour and shape is there, and where |
//! | [`path_planner`] | ranges, odometry | a way to a place, and how good it is |
//! | [`avoid`] | a scan, ranges, a goal | a wish to drive past what is near, and the situation |
//! | [`navigator`] | a scan, odometry, a goal | a motion to the goal through what nobody told it |
//! | [`coordinator`] | wishes, safety, decision | one command for the drive |
//! | [`decision_maker`] | safety, target, risk, battery, odometry, load, signals | situations, goal, everybody's weight and orders, reasons |
//! | [`resource_manager`] | the load of the computer, orders | periods, methods, budgets and rest for all |
//! | [`drive`] | a command, orders of people, a reflex | what the wheels can do of it |
//! | [`head`] | wishes, orders of people | what the head can do of it |
//!
//! Nothing here knows a simulator or a driver: a robot's ports are wired by the names that stand at the agents' ports.
#![forbid(unsafe_code)]

pub mod avoid;
pub mod camera;
pub mod coordinator;
pub mod decision_maker;
pub mod drive;
pub mod head;
pub mod image_tracker;
pub mod laser;
pub mod lookout;
pub mod navigator;
pub mod odometry;
pub mod path_planner;
pub mod recogniser;
pub mod resource_manager;
pub mod safety_monitor;
mod shared;
pub mod sonar;
mod trust;
pub mod wall_follower;

pub use avoid::Avoid;
pub use camera::Camera;
pub use coordinator::Coordinator;
pub use decision_maker::DecisionMaker;
pub use drive::DriveBase;
pub use head::PanTilt;
pub use image_tracker::ImageTracker;
pub use laser::Laser;
pub use lookout::Lookout;
pub use navigator::Navigator;
pub use odometry::DeadReckoning;
pub use path_planner::PathPlanner;
pub use recogniser::Recogniser;
pub use resource_manager::ResourceManager;
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
        Lookout,
        SafetyMonitor,
        WallFollower,
        ImageTracker,
        Recogniser,
        PathPlanner,
        Avoid,
        Navigator,
        PanTilt,
        Coordinator,
        DriveBase,
        DecisionMaker,
        ResourceManager,
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
            "lookout",
            "safety-monitor",
            "wall-follower",
            "image-tracker",
            "recogniser",
            "path-planner",
            "avoid",
            "navigator",
            "head",
            "coordinator",
            "drive",
            "decision-maker",
            "resource-manager",
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
