//! What a hand does to a world that runs: it puts things in and takes them out, pushes a robot, and greases the floor.
//!
//! All memory is taken when the world begins: there is room for [`MOST_ADDED`] things. The same deeds at the same times give the
//! same world.

use libm::fabs;
use types::{Duration, Name, Point, Pose, Text};

use crate::colour::Colour;
use crate::field::{Body, Field};
use crate::model::Shape;
use crate::robot::Robot;
use crate::simulator::{AddError, RobotId, Simulator};

/// The most things that can have been added at a time.
pub const MOST_ADDED: usize = 16;
/// The furthest push (m), and the largest turn with it (rad): what a hand can do at once.
pub const FURTHEST_PUSH: (f64, f64) = (2.0, core::f64::consts::PI);

/// A thing that was added.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Standing {
    /// Its name.
    pub name: Name,
    /// What it covers of the floor.
    pub shape: Shape,
    /// Where its middle is, and how it is turned.
    pub pose: Pose,
    /// Its height (m).
    pub height: f64,
    /// Its colour.
    pub colour: Colour,
}

/// Why a hand cannot do something.
#[derive(Clone, Debug, PartialEq)]
pub enum HandError {
    /// A thing needs a name, by which it is moved and taken away.
    NoName,
    /// There is something of this name already.
    NameTaken(Name),
    /// There is nothing of this name that could be moved, pushed or taken away.
    NoSuch(Name),
    /// There are as many things as there is room for.
    Full,
    /// A number is none, or out of its range: which.
    Number(&'static str),
    /// It would stand in this robot or person.
    Within(Name),
    /// A robot has no room there.
    NotFree(AddError),
}

impl std::fmt::Display for HandError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            HandError::NoName => f.write_str("a thing needs a name"),
            HandError::NameTaken(name) => write!(f, "there is a {name} already"),
            HandError::NoSuch(name) => write!(f, "there is no {name}"),
            HandError::Full => write!(f, "there is room for {MOST_ADDED} things: take one away"),
            HandError::Number(what) => write!(f, "the {what} is out of range"),
            HandError::Within(name) => write!(f, "it would stand in {name}"),
            HandError::NotFree(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for HandError {}

impl HandError {
    /// The same in a text of fixed size, cut where it is too long. It takes no memory.
    pub fn text<const N: usize>(&self) -> Text<N> {
        let mut buffer = Buffer { bytes: [0; 160], len: 0 };
        // A buffer that is full says so, and what is in it stays.
        let _ = std::fmt::Write::write_fmt(&mut buffer, format_args!("{self}"));
        Text::new(core::str::from_utf8(&buffer.bytes[..buffer.len]).unwrap_or_default())
    }
}

/// Room for a sentence.
struct Buffer {
    bytes: [u8; 160],
    len: usize,
}

impl std::fmt::Write for Buffer {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        let room = self.bytes.get_mut(self.len..self.len + text.len()).ok_or(std::fmt::Error)?;
        room.copy_from_slice(text.as_bytes());
        self.len += text.len();
        Ok(())
    }
}

/// The things that were added, each with the body that it has in the field.
#[derive(Clone, Debug)]
pub(crate) struct Added {
    things: [Option<Standing>; MOST_ADDED],
    bodies: [u32; MOST_ADDED],
}

impl Added {
    pub(crate) fn new(field: &mut Field) -> Added {
        Added { things: [None; MOST_ADDED], bodies: core::array::from_fn(|_| field.add_hidden()) }
    }

    fn find(&self, name: &str) -> Option<usize> {
        self.things.iter().position(|thing| thing.is_some_and(|thing| thing.name.as_str() == name))
    }

    pub(crate) fn get(&self, index: usize) -> Option<&Standing> {
        self.things.get(index)?.as_ref()
    }
}

impl Simulator {
    /// Puts a thing into the world. It may stand in walls and other things, so a wall can be closed with it.
    ///
    /// # Errors
    /// When it would stand in a robot or a person, has no name of its own or no size, or there is no more room; nothing changes
    /// then.
    pub fn add(&mut self, thing: Standing) -> Result<(), HandError> {
        let name = thing.name.as_str();
        if name.is_empty() {
            return Err(HandError::NoName);
        }
        if self.find(name).is_some() || self.locate(name).is_some() || self.added.find(name).is_some() {
            return Err(HandError::NameTaken(thing.name));
        }
        let place = self.added.things.iter().position(Option::is_none).ok_or(HandError::Full)?;
        self.check(&thing)?;
        self.stand(place, thing);
        Ok(())
    }

    /// Takes a thing away that was added.
    ///
    /// # Errors
    /// When there is none of this name.
    pub fn remove(&mut self, name: &str) -> Result<(), HandError> {
        let place = self.added.find(name).ok_or_else(|| HandError::NoSuch(Name::new(name)))?;
        self.added.things[place] = None;
        self.field.hide_body(self.added.bodies[place]);
        self.robots.iter_mut().for_each(Robot::look_again);
        Ok(())
    }

    /// Puts a thing that was added, or a robot, elsewhere. The robot is carried: its wheels count nothing, and it stands then.
    ///
    /// # Errors
    /// When there is none of this name or no room; it stays where it is then.
    pub fn relocate(&mut self, name: &str, pose: Pose) -> Result<(), HandError> {
        if let Some(id) = self.find(name) {
            return self.put(id, pose).map_err(HandError::NotFree);
        }
        let place = self.added.find(name).ok_or_else(|| HandError::NoSuch(Name::new(name)))?;
        let Some(thing) = self.added.things[place] else { return Ok(()) };
        let moved = Standing { pose, ..thing };
        self.check(&moved)?;
        self.stand(place, moved);
        Ok(())
    }

    /// Pushes a robot by `ahead` and `left` (m, as it looks now) and turns it by `turn` (rad), up to the first contact. Its
    /// wheels count nothing of it, and go on turning as they are told. Gives the part of the push that was free, 0 to 1.
    ///
    /// # Errors
    /// When the push is no number or goes further than [`FURTHEST_PUSH`].
    pub fn push(&mut self, id: RobotId, ahead: f64, left: f64, turn: f64) -> Result<f64, HandError> {
        let by = Point::new(ahead, left);
        // What is no number lies in no range.
        if !(0.0..=FURTHEST_PUSH.0).contains(&by.norm()) {
            return Err(HandError::Number("push"));
        }
        if !(0.0..=FURTHEST_PUSH.1).contains(&fabs(turn)) {
            return Err(HandError::Number("turn"));
        }
        let robot = &mut self.robots[id.index()];
        let heading = Pose::new(0.0, 0.0, robot.truth.pose.heading);
        let part = robot.push(&mut self.field, heading.transform(by), turn);
        self.robots.iter_mut().for_each(Robot::look_again);
        Ok(part)
    }

    /// For some time each wheel of a robot loses this share of its way (0 to 1), while its encoder counts on. It ends what was
    /// lost before.
    ///
    /// # Errors
    /// When a share does not lie from 0 to 1, or the time is negative.
    pub fn slip(&mut self, id: RobotId, left: f64, right: f64, time: Duration) -> Result<(), HandError> {
        if !(0.0..=1.0).contains(&left) || !(0.0..=1.0).contains(&right) {
            return Err(HandError::Number("share"));
        }
        if time < Duration::ZERO {
            return Err(HandError::Number("time"));
        }
        let until = self.time().saturating_add(time);
        self.robots[id.index()].lose_grip([left, right], until);
        Ok(())
    }

    /// The things that were added, by their places: there are [`MOST_ADDED`].
    pub fn added(&self) -> &[Option<Standing>; MOST_ADDED] {
        &self.added.things
    }

    /// Whether a thing has a size and stands in nobody.
    fn check(&self, thing: &Standing) -> Result<(), HandError> {
        const SIZES: core::ops::RangeInclusive<f64> = 0.01..=100.0;
        let sizes = match thing.shape {
            Shape::Round { radius } => [radius, radius],
            Shape::Rectangle { length, width, .. } => [length, width],
        };
        if !sizes.iter().all(|size| SIZES.contains(size)) {
            return Err(HandError::Number("size"));
        }
        if !(0.01..=20.0).contains(&thing.height) {
            return Err(HandError::Number("height"));
        }
        let Pose { x, y, heading } = thing.pose;
        let (low, high) = self.field.bounds();
        // A thing outside of the world would have no place in its cells.
        let inside = (low.x..=high.x).contains(&x) && (low.y..=high.y).contains(&y);
        if !inside || !heading.is_finite() {
            return Err(HandError::Number("place"));
        }
        let solid = thing.shape.solid(thing.pose);
        for robot in &self.robots {
            if solid.gap_to(&robot.model.shape.solid(robot.truth.pose)).0 <= 0.0 {
                return Err(HandError::Within(Name::new(&robot.name)));
            }
        }
        for walker in self.people.iter().filter(|walker| walker.present) {
            if solid.gap_to(&walker.solid()).0 <= 0.0 {
                return Err(HandError::Within(Name::new(&walker.plan.name)));
            }
        }
        Ok(())
    }

    fn stand(&mut self, place: usize, thing: Standing) {
        let body = self.added.bodies[place];
        let solid = thing.shape.solid(thing.pose);
        self.field.bodies[body as usize] = Body { solid, high: thing.height, person: false, present: true };
        self.field.place_body(body, solid);
        self.added.things[place] = Some(thing);
        self.robots.iter_mut().for_each(Robot::look_again);
    }
}
