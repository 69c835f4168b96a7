//! By landmarks and other robots: counting wheels, set right by what is seen of them.
//!
//! | module | from | to |
//! |---|---|---|
//! | [`filter`] | steps of the wheels | a pose, how uncertain it is, and the lasting errors of the wheels |
//! | [`sighting`] | range and bearing of something, or from another robot | the filter set right |
//! | [`association`] | a sighting of one does not know what | which landmark it is, if that can be told |
//! | [`localizer`] | steps and sightings in any order of time | the pose at any time of the last seconds, and a little ahead |

pub mod association;
pub mod filter;
pub mod localizer;
pub mod sighting;

pub use association::{Association, Landmark};
pub use filter::{Errors, Filter, Parameters};
pub use localizer::LandmarkLocalizer;
pub use sighting::{Effect, Sight, Sighting};
