//! Where the robot is by landmarks alone: tracked, or searched for.
//!
//! ```text
//!            what was seen fits the map in one way only
//!   Searching ───────────────────────────────────────────▶ Tracking
//!       ▲                                                      │
//!       └── nothing that is seen fits, again and again; ───────┘
//!           or the wheels alone have told for too long
//! ```
//!
//! While it tracks, the [filter with a memory](super::localizer) goes on by the wheels, and each sighting sets it right at the time when it was
//! made. While it searches, what is seen is laid over the map ([`Watch`]).

use types::messages::LandmarkSighting;
use types::{Pose, Time};

use super::filter::{Filter, Parameters};
use super::localizer::LandmarkLocalizer;
use super::sighting::{Effect, Sight};
use super::watch::{Believer, Watch};
use crate::drift::arc;
use crate::linear::{deviations, diagonal};
use crate::localisation::State;

/// Steps and sightings that are remembered: more than two seconds of wheels and a camera at 20 Hz each.
const MEMORY: usize = 96;
/// The share that fits is that of about so many sightings.
const SIGHTINGS: f64 = 20.0;

/// When a robot is lost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackerParams {
    /// So many readings in a row in which nothing fits. 15: a second and more of pictures, in which somebody with colourful clothes may walk by.
    pub misses: u32,
    /// Deviations of the place (m) and the heading (rad) above which it is not known any more. 1.5 m and 0.5 rad: above them a landmark that has no
    /// name is taken for its neighbour.
    pub lost: (f64, f64),
}

impl Default for TrackerParams {
    fn default() -> TrackerParams {
        TrackerParams { misses: 15, lost: (1.5, 0.5) }
    }
}

/// Keeps track of a robot by landmarks. All memory is taken when it is made.
#[derive(Clone, Debug)]
pub struct LandmarkTracker {
    watch: Watch,
    params: TrackerParams,
    localizer: LandmarkLocalizer,
    state: State,
    /// Where the wheels said that the robot is, and when.
    wheels: Option<(Time, Pose)>,
    misses: u32,
    fitting: f64,
}

/// The filter at the time of a sighting.
struct Moment<'a> {
    localizer: &'a mut LandmarkLocalizer,
    at: Time,
    is_known: bool,
}

impl Believer for Moment<'_> {
    fn belief(&self) -> Option<Filter> {
        self.is_known.then(|| self.localizer.at(self.at)).flatten()
    }

    fn take(&mut self, sight: &Sight) -> Effect {
        self.localizer.sees(self.at, *sight).unwrap_or(Effect::NONE)
    }
}

impl LandmarkTracker {
    /// Of a robot that may be anywhere.
    pub fn new(watch: Watch, params: TrackerParams) -> LandmarkTracker {
        let parameters = *watch.parameters();
        let nowhere = Filter::new(&parameters, Pose::default(), diagonal([1.0, 1.0, 1.0]));
        let localizer = LandmarkLocalizer::new(parameters, nowhere, Time::ZERO, MEMORY);
        let state = State::Searching;
        LandmarkTracker { watch, params, localizer, state, wheels: None, misses: 0, fitting: 0.0 }
    }

    /// Goes by other parameters from now on.
    pub fn set_parameters(&mut self, parameters: Parameters, params: TrackerParams) {
        self.watch.set_parameters(parameters);
        self.localizer.set_parameters(parameters);
        self.params = params;
    }

    /// Somebody says where the robot is, with deviations of the place (m) and the heading (rad).
    pub fn place(&mut self, pose: Pose, place: f64, heading: f64) {
        let at = self.wheels.map_or(self.localizer.newest().0, |(at, _)| at);
        self.begin(at, pose, diagonal([place * place, place * place, heading * heading]));
    }

    /// Nothing is known any more: the robot may be anywhere.
    pub fn forget(&mut self) {
        self.watch.forget();
        (self.state, self.misses, self.fitting) = (State::Searching, 0, 0.0);
    }

    /// Takes where the wheels say that the robot is (in any frame that does not jump). What comes late is left out.
    pub fn moved(&mut self, at: Time, odometry: Pose) {
        let before = match self.wheels {
            Some((known, _)) if at <= known => return,
            Some((_, before)) => before,
            None => odometry,
        };
        self.wheels = Some((at, odometry));
        // In the order of time it is never refused.
        let _ = self.localizer.moved(at, arc(before.inverse().then(odometry)));
        let (place, heading) = self.deviations();
        if self.state == State::Tracking && (place > self.params.lost.0 || heading > self.params.lost.1) {
            self.forget();
        }
    }

    /// Takes what a sensor told at a time, when the wheels said that the robot is at `odometry`. Gives whether anything in it told where that is.
    pub fn sees(&mut self, at: Time, odometry: Pose, seen: &[LandmarkSighting]) -> bool {
        let is_known = self.state == State::Tracking;
        let mut moment = Moment { localizer: &mut self.localizer, at, is_known };
        let told = self.watch.take(at, odometry, seen, &mut moment);
        if let Some((pose, spread)) = told.found {
            self.begin(at, pose, spread);
            return true;
        }
        for (count, fits) in [(told.fitted, 1.0), (told.misfitted, 0.0)] {
            (0..count).for_each(|_| self.fitting += (fits - self.fitting) / SIGHTINGS);
        }
        if told.fitted > 0 {
            self.misses = 0;
        } else if told.misfitted > 0 {
            self.misses += 1;
            if self.misses >= self.params.misses {
                self.forget();
            }
        }
        told.fitted > 0
    }

    fn begin(&mut self, at: Time, pose: Pose, spread: [[f64; 3]; 3]) {
        // What is older than the memory was found too late to be of use.
        if self.localizer.relocate(at, pose, spread).is_ok() {
            (self.state, self.misses, self.fitting) = (State::Tracking, 0, 1.0);
        }
    }

    /// What it sees them by.
    pub const fn watch(&self) -> &Watch {
        &self.watch
    }

    /// What is known.
    pub fn state(&self) -> State {
        self.state
    }

    /// Where the robot was when its wheels were last heard, and when that was; nothing unless that is known.
    pub fn pose(&self) -> Option<(Time, Pose)> {
        let (at, _) = self.wheels.filter(|_| self.state == State::Tracking)?;
        Some((at, self.localizer.pose_at(at)?))
    }

    /// Deviations of the place, along the axis in which it is larger (m), and of the heading (rad).
    pub fn deviations(&self) -> (f64, f64) {
        deviations(&self.localizer.newest().1.spread())
    }

    /// The share of what was seen lately that was as it should be.
    pub fn fitting(&self) -> f64 {
        self.fitting
    }

    /// The filter, with what it has learnt.
    pub fn filter(&self) -> &Filter {
        self.localizer.newest().1
    }
}

#[cfg(test)]
mod tests;
