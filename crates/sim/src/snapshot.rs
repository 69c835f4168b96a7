//! A moment of the world as plain data to draw, for pictures on a terminal, a page or in a figure.

use types::{Point, Pose, Time};

use crate::colour::Colour;
use crate::hand::Standing;
use crate::model::Shape;
use crate::plan::Region;
use crate::simulator::Simulator;

/// A straight line to draw.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// One end (m).
    pub from: Point,
    /// The other (m).
    pub to: Point,
    /// Height of its upper end (m).
    pub height: f64,
    /// Its colour.
    pub colour: Colour,
}

/// A circle to draw.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disc {
    /// Its middle (m).
    pub centre: Point,
    /// Its radius (m).
    pub radius: f64,
    /// Its colour.
    pub colour: Colour,
}

/// A person to draw.
#[derive(Clone, Debug, PartialEq)]
pub struct PersonMark {
    /// The name.
    pub name: String,
    /// The body; its colour is that of the shirt.
    pub disc: Disc,
    /// Where the person looks (rad).
    pub facing: f64,
}

/// A robot to draw.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotMark {
    /// The name.
    pub name: String,
    /// Where it is.
    pub pose: Pose,
    /// Its outline on the floor.
    pub shape: Shape,
    /// Where its head looks, in the world (rad).
    pub gaze: f64,
    /// Whether it touches something.
    pub touching: bool,
    /// Its colour.
    pub colour: Colour,
}

/// The parts of a world that stand still: drawn once.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenery {
    /// Lower left and upper right corner of everything (m).
    pub bounds: (Point, Point),
    /// Walls and the sides of boxes.
    pub lines: Vec<Line>,
    /// Round things.
    pub discs: Vec<Disc>,
    /// Named parts of the floor.
    pub regions: Vec<Region>,
}

/// What moves, at one moment.
#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot {
    /// When.
    pub time: Time,
    /// People that are there.
    pub people: Vec<PersonMark>,
    /// Coloured things, carried ones among them.
    pub things: Vec<Disc>,
    /// What was added to the running world.
    pub added: Vec<Standing>,
    /// Robots.
    pub robots: Vec<RobotMark>,
}

impl Simulator {
    /// What stands still.
    pub fn scenery(&self) -> Scenery {
        let look = |index: u32| self.looks.get(index as usize).map(|look| look.colour);
        let line = |face: &crate::field::Face| {
            let (from, to) = (face.segment.a, face.segment.b());
            look(face.look).map(|colour| Line { from, to, height: face.high, colour })
        };
        let disc = |post: &crate::field::Post| {
            look(post.look).map(|colour| Disc {
                centre: post.circle.centre,
                radius: post.circle.radius,
                colour,
            })
        };
        Scenery {
            bounds: self.field.bounds(),
            lines: self.field.faces.iter().filter_map(line).collect(),
            discs: self.field.posts.iter().filter_map(disc).collect(),
            regions: self.plan.regions.clone(),
        }
    }

    /// What moves, now.
    pub fn snapshot(&self) -> Snapshot {
        let present = || self.people.iter().filter(|walker| walker.present);
        let standing = self.plan.things.iter().map(|thing| (thing, thing.at));
        let carried = present().filter_map(|walker| Some((walker.plan.carries.as_ref()?, walker.hands()?)));
        Snapshot {
            time: self.time(),
            people: present()
                .map(|walker| PersonMark {
                    name: walker.plan.name.clone(),
                    disc: Disc { centre: walker.at, radius: walker.plan.radius, colour: walker.plan.shirt },
                    facing: walker.facing,
                })
                .collect(),
            things: standing
                .chain(carried)
                .map(|(thing, centre)| Disc { centre, radius: thing.radius, colour: thing.colour })
                .collect(),
            added: self.added().iter().flatten().copied().collect(),
            robots: self
                .robots
                .iter()
                .map(|robot| RobotMark {
                    name: robot.name.clone(),
                    pose: robot.truth.pose,
                    shape: robot.model.shape,
                    gaze: robot.truth.pose.heading + robot.head.pan,
                    touching: robot.contact.is_some(),
                    colour: robot.model.colour,
                })
                .collect(),
        }
    }
}
