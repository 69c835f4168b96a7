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
//! | [`landmark_finder`] | a picture, head | where upright tubes of two colours stand |
//! | [`path_planner`] | ranges, odometry | a way to a place, and how good it is |
//! | [`goto`] | a task, odometry, the pose of a localizer | a wish to steer to a point, a pose or a dock |
//! | [`mover`] | a task, odometry | a wish to drive a distance, an angle, a velocity for a time, or to a place |
//! | [`path_follower`] | a task, a path, odometry | a wish to drive along the path |
//! | [`along_wall`] | a task, ranges | a wish to drive along a wall at a distance |
//! | [`escape`] | a task, odometry, ranges | a wish to get out where the robot does not come on, or that there is no way |
//! | [`emergency_stop`] | scan, ranges, how the robot moves | a bound that ramps it down before what it would meet |
//! | [`navigation`] | goals and manoeuvres of people and programs | tasks, and what becomes of them |
//! | [`teleoperator`] | orders of people | the same for the drive, and that people drive |
//! | [`tour`] | places | the wish to go there, one after another |
//! | [`process_supervisor`] | tasks, who lives | the mode: who is heard, and how |
//! | [`real_time_supervisor`] | modes, tasks, reports of actions | the same for the real-time side, together; standing when one is silent |
//! | [`localizer`] | scans and a floor plan, landmarks and their places, odometry | where the robot is, or that it is not known |
//! | [`avoid`] | a scan, ranges, a goal | a wish to drive past what is near, and the situation |
//! | [`navigator`] | a scan, odometry, a goal | a motion to the goal through what nobody told it |
//! | [`coordinator`] | wishes, safety, decision, mode | one command for the drive |
//! | [`decision_maker`] | safety, target, risk, battery, odometry, load, signals | situations, goal, everybody's weight and orders, reasons |
//! | [`resource_manager`] | the load of the computer, orders | periods, methods, budgets and rest for all |
//! | [`drive`] | a command, orders of people, a reflex | what the wheels can do of it |
//! | [`head`] | wishes, orders of people | what the head can do of it |
//!
//! Nothing here knows a simulator or a driver: a robot's ports are wired by the names that stand at the agents' ports.
#![forbid(unsafe_code)]

mod action;
pub mod along_wall;
pub mod avoid;
pub mod camera;
pub mod coordinator;
pub mod decision_maker;
pub mod drive;
pub mod emergency_stop;
pub mod escape;
pub mod goto;
pub mod head;
pub mod image_tracker;
pub mod landmark_finder;
pub mod laser;
pub mod localizer;
pub mod lookout;
pub mod mover;
pub mod navigation;
pub mod navigator;
pub mod odometry;
pub mod path_follower;
pub mod path_planner;
pub mod process_supervisor;
pub mod real_time_supervisor;
pub mod recogniser;
pub mod resource_manager;
pub mod safety_monitor;
mod shared;
pub mod sonar;
pub mod teleoperator;
pub mod tour;
mod trust;
pub mod wall_follower;

pub use along_wall::AlongWall;
pub use avoid::Avoid;
pub use camera::Camera;
pub use coordinator::Coordinator;
pub use decision_maker::DecisionMaker;
pub use drive::DriveBase;
pub use emergency_stop::EmergencyStopAction;
pub use escape::EscapeAction;
pub use goto::GotoAction;
pub use head::PanTilt;
pub use image_tracker::ImageTracker;
pub use landmark_finder::LandmarkFinder;
pub use laser::Laser;
pub use localizer::Localizer;
pub use lookout::Lookout;
pub use mover::MoveAction;
pub use navigation::Navigation;
pub use navigator::Navigator;
pub use odometry::DeadReckoning;
pub use path_follower::PathFollower;
pub use path_planner::PathPlanner;
pub use process_supervisor::ProcessSupervisor;
pub use real_time_supervisor::RealTimeSupervisor;
pub use recogniser::Recogniser;
pub use resource_manager::ResourceManager;
pub use safety_monitor::SafetyMonitor;
pub use sonar::Sonar;
pub use teleoperator::Teleoperator;
pub use tour::Tour;
pub use wall_follower::WallFollower;

/// All agents of this crate, by their kinds.
pub fn registry() -> runtime::Registry {
    runtime::registry![
        Sonar,
        Laser,
        Camera,
        DeadReckoning,
        Localizer,
        Lookout,
        SafetyMonitor,
        WallFollower,
        ImageTracker,
        Recogniser,
        LandmarkFinder,
        PathPlanner,
        GotoAction,
        MoveAction,
        PathFollower,
        AlongWall,
        EscapeAction,
        EmergencyStopAction,
        Navigation,
        Teleoperator,
        Tour,
        ProcessSupervisor,
        RealTimeSupervisor,
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
            "localizer",
            "lookout",
            "safety-monitor",
            "wall-follower",
            "image-tracker",
            "recogniser",
            "landmark-finder",
            "path-planner",
            "goto",
            "move",
            "path-follower",
            "along-wall",
            "escape",
            "emergency-stop",
            "navigation",
            "teleoperator",
            "tour",
            "process-supervisor",
            "real-time-supervisor",
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
    fn a_parameter_that_takes_one_of_a_few_words_takes_no_other() {
        let set = |word: &str, key: &str| {
            let mut table = types::value::Table::new();
            table.set(key, types::value::Value::from(word));
            table
        };
        let mut found = Vec::new();
        for known in registry().types() {
            for field in known.params.iter().filter(|field| !field.words.is_empty()) {
                found.push(format!("{}.{}", known.kind, field.name));
                let default = field.default.as_text().unwrap();
                assert!(field.words.contains(&default), "{default} of {}", known.kind);
                // Each is told in the text of the parameter, too.
                assert!(field.words.iter().all(|word| field.doc.contains(word)), "{}", field.doc);
                assert!(field.words.iter().all(|word| known.check_params(&set(word, field.name)).is_empty()));
                let told = known.check_params(&set("top", field.name));
                let words = field.words.iter().map(|word| format!("\"{word}\""));
                assert!(words.into_iter().all(|word| told[0].what.contains(&word)), "{told:?}");
            }
        }
        found.sort();
        let all = [
            "avoid.law",
            "coordinator.coordination",
            "goto.behind",
            "goto.law",
            "move.profile",
            "resource-manager.policy",
            "wall-follower.side",
        ];
        assert_eq!(found, all);
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
