//! Where the robot is: counting wheels, set right by what it sees of landmarks, of other robots and of walls.
//!
//! In plain words: wheels tell each small step well, but their errors add up; a landmark whose place is known tells little at a time, but
//! its errors do not. A filter weighs the two by how much each is to be trusted, and learns meanwhile by how much the wheels are wrong.
//!
//! | module | from | to |
//! |---|---|---|
//! | [`filter`] | steps of the wheels | a pose, how uncertain it is, and the lasting errors of the wheels |
//! | [`sighting`] | range and bearing of something, or from another robot | the filter set right |
//! | [`association`] | a sighting of one does not know what | which landmark it is, if that can be told |
//! | [`localizer`] | steps and sightings in any order of time | the pose at any time of the last seconds, and a little ahead |
//!
//! A gyro comes in before: [`motion::heading`] fuses it with the wheels, learns its bias, and what it gives is a step of the wheels for the filter.

pub mod association;
pub mod filter;
pub mod localizer;
pub mod sighting;

pub use filter::{Errors, Filter, Parameters};
pub use localizer::Localizer;
pub use sighting::{Effect, Sight, Sighting};
