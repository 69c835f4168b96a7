//! By landmarks and other robots: counting wheels, set right by what is seen of them.
//!
//! | module | from | to |
//! |---|---|---|
//! | [`filter`] | steps of the wheels | a pose, how uncertain it is, and the lasting errors of the wheels |
//! | [`sighting`] | range and bearing of something, or from another robot | the filter set right |
//! | [`association`] | a sighting of one does not know what | which landmark it is, if that can be told |
//! | [`localizer`] | steps and sightings in any order of time | the pose at any time of the last seconds, and a little ahead |
//! | [`marks`] | what a camera or a receiver of infrared tells of one | what that means for the filter |
//! | [`watch`] | all that such sensors tell | corrections for who knows where the robot is, a place for who does not |
//! | [`tracker`] | the wheels and that | where the robot is, or that it is not known |

pub mod association;
mod constellation;
pub mod filter;
pub mod localizer;
pub mod marks;
pub mod sighting;
pub mod tracker;
pub mod watch;

pub use association::{Association, Landmark};
pub use filter::{Errors, Filter, Parameters};
pub use localizer::LandmarkLocalizer;
pub use marks::{Mark, Marks};
pub use sighting::{Effect, Sight, Sighting};
pub use tracker::{LandmarkTracker, TrackerParams};
pub use watch::{Believer, Watch};
