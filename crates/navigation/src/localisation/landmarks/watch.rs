//! What comes of the landmarks that are seen and heard: corrections for who knows where the robot is, and a place for who does not.

use types::messages::LandmarkSighting;
use types::{Pose, Time};

use super::constellation::Constellation;
use super::filter::{Filter, Parameters};
use super::marks::{Ears, Marks, Meant, sighting};
use super::sighting::{Effect, Sight};
use crate::linear::Matrix;

/// Who believes where the robot was when something was seen.
pub trait Believer {
    /// What it believes; nothing while it does not know.
    fn belief(&self) -> Option<Filter>;

    /// Takes what was seen.
    fn take(&mut self, sight: &Sight) -> Effect;
}

/// What came of what a sensor told at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Told {
    /// So many sightings were as they should be.
    pub fitted: u32,
    /// And so many were not, though they were of landmarks.
    pub misfitted: u32,
    /// Where the robot was and its covariance, if that was not known and has been found.
    pub found: Option<(Pose, Matrix)>,
}

/// Watches the landmarks. All memory is taken when it is made.
#[derive(Clone, Debug)]
pub struct Watch {
    marks: Marks,
    parameters: Parameters,
    ears: Ears,
    constellation: Constellation,
}

impl Watch {
    /// Of these landmarks, by a sensor with the noise of these parameters.
    pub fn new(marks: Marks, parameters: Parameters) -> Watch {
        Watch { marks, parameters, ears: Ears::default(), constellation: Constellation::default() }
    }

    /// The landmarks that it knows.
    pub const fn marks(&self) -> &Marks {
        &self.marks
    }

    /// What it goes by.
    pub const fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// Goes by other parameters.
    pub fn set_parameters(&mut self, parameters: Parameters) {
        self.parameters = parameters;
    }

    /// What was seen so far says nothing of where the robot is now: it was carried, or nobody knows.
    pub fn forget(&mut self) {
        self.constellation.clear();
    }

    /// Takes what a sensor told at a time, when the wheels said that the robot is at `odometry`.
    pub fn take(
        &mut self,
        at: Time,
        odometry: Pose,
        seen: &[LandmarkSighting],
        believer: &mut impl Believer,
    ) -> Told {
        let Watch { marks, parameters, ears, constellation } = self;
        let (mut told, mut worth) = (Told::default(), false);
        for seen in seen {
            let is_beacon = sighting(seen).is_none();
            if is_beacon && !(seen.known_id().is_some_and(|id| ears.hear(at, id, seen.side))) {
                continue;
            }
            let Some(believed) = believer.belief() else {
                worth |= constellation.take(odometry, parameters, marks, seen);
                continue;
            };
            match marks.meant(&believed, parameters, seen) {
                Meant::Sight(sight) => {
                    let fits = believer.take(&sight).surprise <= parameters.gate;
                    told.fitted += u32::from(fits);
                    told.misfitted += u32::from(!fits);
                }
                // A name that nobody knows tells nothing of where the robot is.
                Meant::Nothing => told.misfitted += u32::from(seen.known_id().is_none()),
                Meant::Open => {}
            }
        }
        if worth {
            told.found = constellation.find(odometry, marks);
            if told.found.is_some() {
                constellation.clear();
            }
        }
        told
    }
}
