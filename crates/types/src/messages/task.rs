//! What the reactive layer is asked to do, and what becomes of it.

use crate::definition::{Definition, Kind};
use crate::geometry::Pose;
use crate::message::{Field, Message};
use crate::text::{Name, Text};

/// A place to go to, as people and programs ask for it. What is not said of x, y and the heading is no number (NaN).
#[derive(Clone, Copy, Debug, PartialEq, Field)]
#[repr(C)]
pub struct Goal {
    /// (m); it must be said.
    pub x: f64,
    /// (m); it must be said.
    pub y: f64,
    /// The heading at the end (rad); no number (NaN) for any.
    pub heading: f64,
    /// Whether the robot is to have a heading at the end: 0 where `heading` says no other. A heading that is said counts without it.
    pub turned: bool,
    /// Whether to come to the pose to a centimetre, slowly at the end.
    pub dock: bool,
    /// The highest speed on the way (m/s); zero for the robot's own.
    pub speed: f64,
    /// How long it may take (s); zero for as long as the navigation module gives by itself.
    pub seconds: f64,
    /// The mode in which to go there; empty for the navigation module's choice.
    pub mode: Name,
}

impl Default for Goal {
    fn default() -> Goal {
        Goal {
            x: f64::NAN,
            y: f64::NAN,
            heading: f64::NAN,
            turned: false,
            dock: false,
            speed: 0.0,
            seconds: 0.0,
            mode: Name::EMPTY,
        }
    }
}

/// Makes a message of a struct that derives [`Field`], with what is to be added to its definition.
macro_rules! message {
    ($name:ident, $more:expr) => {
        impl Message for $name {
            type Element = crate::cdr::NoElement;
            const NAME: &'static str = concat!("sinew_msgs/msg/", stringify!($name));

            fn definition() -> Definition {
                match <$name as crate::cdr::Field>::kind() {
                    Kind::Struct(definition) => $more(definition),
                    _ => Definition::new(Self::NAME, []),
                }
            }

            fn encode(&self, _: &[crate::cdr::NoElement], _: crate::Time, out: &mut crate::cdr::Writer) {
                crate::cdr::Field::write(self, out);
            }

            fn decode(
                input: &mut crate::cdr::Reader<'_>,
                _: &mut crate::cdr::NoRow,
            ) -> Result<$name, crate::cdr::Error> {
                crate::cdr::Field::read(input)
            }

            fn disturb(
                &mut self,
                _: &mut [crate::cdr::NoElement],
                wild: bool,
                draw: &mut dyn FnMut() -> f64,
            ) {
                crate::cdr::Field::disturb(self, wild, draw);
            }
        }
    };
}

message!(Goal, |definition: Definition| definition.or_nan(&["x", "y", "heading"]));
message!(Report, |definition: Definition| definition.with_constants(Progress::CONSTANTS));

/// A motion without a place, as people and programs ask for it: a speed for a time, or a distance, or an angle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct Manoeuvre {
    /// Speed (m/s): for a time, forward positive; on a distance, the highest, zero for the robot's own.
    pub linear: f64,
    /// Turn rate (rad/s): for a time, counter-clockwise positive; on an angle, the highest, zero for the robot's own.
    pub angular: f64,
    /// For how long to drive at these speeds (s); zero for a distance or an angle.
    pub seconds: f64,
    /// How far to drive straight on (m), backwards where negative.
    pub distance: f64,
    /// How far to turn on the spot (rad), counter-clockwise positive.
    pub angle: f64,
}

/// A wall to follow, as people and programs ask for it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct WallWish {
    /// The side on which the wall is: "left" or "right"; empty for the left.
    pub side: Name,
    /// How far from the wall the middle of the robot is to be (m); zero for the action's own.
    pub distance: f64,
    /// The highest speed (m/s); zero for the robot's own.
    pub speed: f64,
    /// For how long (s); zero for as long as the navigation module gives by itself.
    pub seconds: f64,
}

/// A wish that the robot ends what it does, as people and programs ask for it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct Halt {
    /// Why, for whoever reads the log.
    pub why: Text<63>,
}

/// What becomes of a request.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct Answer {
    /// Whether it will be tried.
    pub accepted: bool,
    /// The number under which [`Report`] tells of it; zero where it is refused.
    pub task: u32,
    /// Why not; or what will be done.
    pub why: Text<127>,
}

/// A kind of motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Field)]
#[repr(u8)]
pub enum Motion {
    /// To stand still.
    #[default]
    Stand = 0,
    /// To drive at a speed for a time.
    Velocity = 1,
    /// To drive straight on for a distance.
    Distance = 2,
    /// To turn on the spot.
    Turn = 3,
    /// To go to a place, straight or around what is in the way.
    Goto = 4,
    /// To go to a place along a planned path.
    Path = 5,
    /// To come to a pose to a centimetre.
    Dock = 6,
    /// To turn to a place, to drive straight to it by the wheels alone, and to turn to a heading.
    To = 7,
    /// To follow a wall for a time.
    Wall = 8,
}

impl Motion {
    /// Whether it has a place where it ends, so that it can be begun anew from elsewhere.
    pub const fn has_place(self) -> bool {
        matches!(self, Motion::Goto | Motion::Path | Motion::Dock | Motion::To)
    }
}

/// What the robot does until the next task. Actions act on the newest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct Task {
    /// Counts up; zero is none.
    pub number: u32,
    /// The mode in which it is done.
    pub mode: Name,
    /// What is done.
    pub motion: Motion,
    /// The frame of the target.
    pub frame: Name,
    /// Where to.
    pub target: Pose,
    /// Whether the heading of the target counts.
    pub turned: bool,
    /// Speed (m/s): what a velocity has, and what everything else has at most; zero for the action's own.
    pub linear: f64,
    /// Turn rate (rad/s): what a velocity has, and what everything else has at most; zero for the action's own.
    pub angular: f64,
    /// How far to drive, or to keep from a wall (m).
    pub distance: f64,
    /// How far to turn (rad).
    pub angle: f64,
    /// Whether a wall is on the left.
    pub left: bool,
    /// How long: what a velocity and following a wall take, and what everything else may take (s); zero for no end.
    pub seconds: f64,
}

/// How far a task has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Field)]
#[repr(u8)]
pub enum Progress {
    /// There is none.
    #[default]
    Idle = 0,
    /// It is being done.
    Underway = 1,
    /// It is done: the robot is there.
    Arrived = 2,
    /// It took longer than it may.
    TimedOut = 3,
    /// There is no way, or the robot does not get on.
    Unreachable = 4,
    /// Somebody or something ended it before its time.
    Halted = 5,
    /// It cannot be done.
    Refused = 6,
    /// The robot does not know where it is.
    Lost = 7,
    /// Another task has taken its place.
    Replaced = 8,
}

impl Progress {
    /// The numbers in a [`Report`], by name.
    pub const CONSTANTS: [(&'static str, u8); 9] = [
        ("PROGRESS_IDLE", Progress::Idle as u8),
        ("PROGRESS_UNDERWAY", Progress::Underway as u8),
        ("PROGRESS_ARRIVED", Progress::Arrived as u8),
        ("PROGRESS_TIMED_OUT", Progress::TimedOut as u8),
        ("PROGRESS_UNREACHABLE", Progress::Unreachable as u8),
        ("PROGRESS_HALTED", Progress::Halted as u8),
        ("PROGRESS_REFUSED", Progress::Refused as u8),
        ("PROGRESS_LOST", Progress::Lost as u8),
        ("PROGRESS_REPLACED", Progress::Replaced as u8),
    ];

    /// Whether nothing more will become of it.
    pub const fn is_over(self) -> bool {
        !matches!(self, Progress::Idle | Progress::Underway)
    }

    /// In a word.
    pub const fn word(self) -> &'static str {
        match self {
            Progress::Idle => "idle",
            Progress::Underway => "underway",
            Progress::Arrived => "arrived",
            Progress::TimedOut => "timed out",
            Progress::Unreachable => "unreachable",
            Progress::Halted => "halted",
            Progress::Refused => "refused",
            Progress::Lost => "lost",
            Progress::Replaced => "replaced",
        }
    }
}

/// What becomes of a task, from who does it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Field)]
#[repr(C)]
pub struct Report {
    /// The number of the task.
    pub task: u32,
    /// How far it has come: 0 idle, 1 underway, 2 arrived, 3 timed out, 4 unreachable, 5 halted, 6 refused, 7 lost, 8 replaced.
    pub progress: Progress,
    /// What is left of the way, by the robot's own pose (m): to a place as the crow flies, of a manoeuvre what is not driven yet.
    pub distance: f64,
    /// What is left of the turn, by the robot's own pose (rad); 0 where no heading was asked for.
    pub angle: f64,
    /// For how long it has been done (s).
    pub seconds: f64,
    /// Why it ended as it did, where it did not arrive.
    pub why: Text<127>,
}

impl Report {
    /// That a task cannot be done, and why.
    pub fn refused(task: u32, why: &str) -> Report {
        Report { task, progress: Progress::Refused, why: why.into(), ..Report::default() }
    }
}

impl crate::cdr::Field for Pose {
    fn kind() -> crate::definition::Kind {
        let entry = |name: &'static str| (name, crate::definition::Kind::F64);
        let fields = [entry("x"), entry("y"), entry("theta")];
        crate::definition::Kind::Struct(crate::definition::Definition::new(
            "geometry_msgs/msg/Pose2D",
            fields,
        ))
    }

    fn write(&self, out: &mut crate::cdr::Writer) {
        out.put(self.x).put(self.y).put(self.heading);
    }

    fn read(input: &mut crate::cdr::Reader<'_>) -> Result<Pose, crate::cdr::Error> {
        Ok(Pose { x: input.get()?, y: input.get()?, heading: input.get()? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cdr::{Reader, Writer};

    #[test]
    fn the_numbers_of_a_report_have_names_in_its_definition() {
        let text = Report::definition().text();
        for (name, value) in Progress::CONSTANTS {
            assert!(text.contains(&alloc::format!("uint8 {name}={value}\n")), "{text}");
            let bytes = [0, 1, 0, 0, value];
            let read: Progress = Reader::new(&bytes).unwrap().get().unwrap();
            let word = read.word().replace(' ', "_").to_uppercase();
            assert_eq!(name, alloc::format!("PROGRESS_{word}"));
        }
    }

    #[test]
    fn what_is_not_said_of_a_place_is_no_number() {
        let definition = Goal::definition();
        let or_nan = definition.fields.iter().filter(|field| field.or_nan).map(|field| field.name);
        assert!(or_nan.eq(["x", "y", "heading"]));
        let goal = Goal::default();
        assert!(goal.x.is_nan() && goal.y.is_nan() && goal.heading.is_nan());
        let mut out = Writer::new();
        Goal { x: 1.0, ..goal }.encode(&[], crate::Time::ZERO, &mut out);
        let read = Goal::decode(&mut Reader::new(out.bytes()).unwrap(), &mut Default::default()).unwrap();
        assert!(read.x == 1.0 && read.y.is_nan());
    }
}
