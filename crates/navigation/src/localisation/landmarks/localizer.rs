//! The filter with a memory: steps and sightings may come late, and poses may be asked for of the past and a little ahead.
//!
//! In plain words: a camera needs a while to find a landmark in its picture, and meanwhile the robot goes on. What it found was true when
//! the picture was taken. So the localizer remembers what it was told and what it believed in the last seconds, puts a late sighting where
//! it belongs, and goes again through what came after it.
//!
//! ```text
//!   oldest                                         newest        ahead
//!   [filter]──motion──[sight, filter]──motion──[sight, filter]──the last motion──▶
//!                 ▲ a late sight parts the motion in two; all filters behind it are reckoned anew
//! ```
//!
//! Motion is what the wheels did between two times, as a speed and a turn rate that hold meanwhile. Ahead of the last that is known it is
//! taken to go on; when it becomes known, what was reckoned with it is reckoned anew. So what is believed does not depend on the order in
//! which things come, but on their times alone, as long as they come before they are older than the memory.

use std::collections::VecDeque;

use motion::odometry::Increment;
use types::{Pose, Time};

use super::association::{Association, Landmark, associate};
use super::filter::{Filter, Parameters};
use super::sighting::{Effect, Sight, Sighting};

/// Why something was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Late {
    /// It is older than all that is remembered.
    #[error(
        "it is of {at}, and the memory begins at {oldest}; send it sooner, or give the localizer more memory"
    )]
    Forgotten {
        /// Its time.
        at: Time,
        /// The oldest that is remembered.
        oldest: Time,
    },
    /// Motion comes in the order of time.
    #[error(
        "the motion is of {at}, and that until {known} is known already; each tells the time after the last"
    )]
    Known {
        /// Its time.
        at: Time,
        /// Until when motion is known.
        known: Time,
    },
}

/// Speed (m/s) and turn rate (rad/s) that hold for a while.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Rates {
    linear: f64,
    angular: f64,
}

impl Rates {
    fn during(self, dt: f64) -> Increment {
        Increment { distance: self.linear * dt, turn: self.angular * dt }
    }
}

/// A time of which something is known.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Moment {
    at: Time,
    /// How the robot moved since the moment before.
    rates: Rates,
    sight: Option<Sight>,
    /// What is believed after all that.
    after: Filter,
}

/// Believes where the robot is and was.
#[derive(Clone, Debug)]
pub struct LandmarkLocalizer {
    parameters: Parameters,
    /// In the order of time, never empty. The first is where all reckoning begins.
    moments: VecDeque<Moment>,
    most: usize,
    /// How the robot goes on after the last that is known.
    rates: Rates,
    known: Time,
}

impl LandmarkLocalizer {
    /// Begins at a time with a belief, and remembers so many steps and sightings, at least two. All memory is taken here.
    pub fn new(parameters: Parameters, start: Filter, at: Time, memory: usize) -> LandmarkLocalizer {
        let most = memory.max(2);
        let mut moments = VecDeque::with_capacity(most);
        moments.push_back(Moment { at, rates: Rates::default(), sight: None, after: start });
        LandmarkLocalizer { parameters, moments, most, rates: Rates::default(), known: at }
    }

    /// What it goes by.
    pub const fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// Goes by other parameters from now on.
    pub fn set_parameters(&mut self, parameters: Parameters) {
        self.parameters = parameters;
    }

    /// From `at` on the robot goes at a speed (m/s) and a turn rate (rad/s), until it is told otherwise.
    ///
    /// # Errors
    /// When motion after `at` is known already, or `at` is forgotten.
    pub fn drives(&mut self, at: Time, linear: f64, angular: f64) -> Result<(), Late> {
        self.follows(at)?;
        let place = self.place(at)?;
        let before = self.rates;
        self.rates = Rates { linear, angular };
        self.known = at;
        let place = self.insert(place, at, before, None);
        self.rates_from(place + 1);
        self.reckon(place);
        Ok(())
    }

    /// Until `at` the robot went so far since the time until which its motion was known.
    ///
    /// # Errors
    /// When motion until `at` is known already, or `at` is forgotten.
    pub fn moved(&mut self, at: Time, step: Increment) -> Result<(), Late> {
        self.follows(at)?;
        let seconds = (at - self.known).seconds();
        if seconds <= 0.0 {
            return Ok(());
        }
        let place = self.place(at)?;
        self.rates = Rates { linear: step.distance / seconds, angular: step.turn / seconds };
        let first = self.moments.partition_point(|moment| moment.at <= self.known).max(1);
        self.known = at;
        let place = self.insert(place, at, self.rates, None);
        // One that was forgotten meanwhile moved all others down.
        let first = first.min(place);
        self.rates_from(first);
        self.reckon(first);
        Ok(())
    }

    /// At `at` something was seen.
    ///
    /// # Errors
    /// When `at` is forgotten.
    pub fn sees(&mut self, at: Time, sight: Sight) -> Result<Effect, Late> {
        let place = self.place(at)?;
        let rates = self.moments.get(place).map_or(self.rates, |next| next.rates);
        let place = self.insert(place, at, rates, Some(sight));
        Ok(self.reckon(place))
    }

    /// At `at` one of these landmarks was seen, who knows which. It is used when that [can be told](associate).
    ///
    /// # Errors
    /// When `at` is forgotten.
    pub fn sees_one_of(
        &mut self,
        at: Time,
        seen: Sighting,
        landmarks: &[Landmark],
    ) -> Result<Association, Late> {
        let believed = self.at(at).ok_or(Late::Forgotten { at, oldest: self.oldest() })?;
        let which = associate(&believed, &self.parameters, seen, landmarks);
        if let Association::One(number) = which {
            self.sees(at, landmarks[number].seen(seen))?;
        }
        Ok(which)
    }

    /// At `at` something else has found where the robot is. All that was before is forgotten, but for the errors of the wheels.
    ///
    /// # Errors
    /// When `at` is forgotten.
    pub fn relocate(&mut self, at: Time, pose: Pose, spread: [[f64; 3]; 3]) -> Result<(), Late> {
        let place = self.place(at)?;
        let mut start = self.at(at).ok_or(Late::Forgotten { at, oldest: self.oldest() })?;
        start.relocate(pose, spread);
        let rates = self.moments.get(place).map_or(self.rates, |next| next.rates);
        // What came later is kept, since it is no worse than before.
        self.moments.drain(..place);
        let whole = self.moments.len() == self.most;
        if whole {
            self.moments.pop_front();
        }
        self.moments.push_front(Moment { at, rates, sight: None, after: start });
        self.reckon(1);
        Ok(())
    }

    /// What is believed of a time; nothing of one that is forgotten. After the last that is known the motion is taken to go on.
    pub fn at(&self, at: Time) -> Option<Filter> {
        let (last, rates) = self.around(at)?;
        let mut filter = last.after;
        let dt = (at - last.at).seconds();
        filter.predict(&self.parameters, rates.during(dt), dt);
        Some(filter)
    }

    /// The pose at a time, likewise; for control, which wants no covariance.
    pub fn pose_at(&self, at: Time) -> Option<Pose> {
        let (last, rates) = self.around(at)?;
        let dt = (at - last.at).seconds();
        Some(last.after.ahead(rates.during(dt), dt))
    }

    /// What was believed last, and of when.
    pub fn newest(&self) -> (Time, &Filter) {
        let last = &self.moments[self.moments.len() - 1];
        (last.at, &last.after)
    }

    /// The pose that was believed last.
    pub fn pose(&self) -> Pose {
        self.newest().1.pose()
    }

    /// The oldest time that is remembered.
    pub fn oldest(&self) -> Time {
        self.moments[0].at
    }

    /// The last moment that is not after a time, and the motion since.
    fn around(&self, at: Time) -> Option<(&Moment, Rates)> {
        let next = self.moments.partition_point(|moment| moment.at <= at);
        let last = self.moments.get(next.checked_sub(1)?)?;
        Some((last, self.moments.get(next).map_or(self.rates, |next| next.rates)))
    }

    fn follows(&self, at: Time) -> Result<(), Late> {
        if at < self.known { Err(Late::Known { at, known: self.known }) } else { Ok(()) }
    }

    /// Where a moment belongs: behind all that are not later.
    fn place(&self, at: Time) -> Result<usize, Late> {
        match self.moments.partition_point(|moment| moment.at <= at) {
            0 => Err(Late::Forgotten { at, oldest: self.oldest() }),
            place => Ok(place),
        }
    }

    /// Puts a moment in, and forgets the oldest where there is no room. Gives its place.
    fn insert(&mut self, mut place: usize, at: Time, rates: Rates, sight: Option<Sight>) -> usize {
        if self.moments.len() == self.most && place > 1 {
            self.moments.pop_front();
            place -= 1;
        } else if self.moments.len() == self.most {
            // It belongs right behind the oldest: it takes over its place, and then is the oldest itself.
            let mut after = self.moments[0].after;
            let dt = (at - self.moments[0].at).seconds();
            after.predict(&self.parameters, rates.during(dt), dt);
            if let Some(sight) = &sight {
                after.correct(&self.parameters, sight);
            }
            self.moments[0] = Moment { at, rates, sight: None, after };
            return 0;
        }
        let after = self.moments[place - 1].after;
        self.moments.insert(place, Moment { at, rates, sight, after });
        place
    }

    /// From here on motion is the last that was told.
    fn rates_from(&mut self, first: usize) {
        for moment in self.moments.range_mut(first.min(self.moments.len())..) {
            moment.rates = self.rates;
        }
    }

    /// Reckons all beliefs from here on anew. Gives the effect of the first.
    fn reckon(&mut self, first: usize) -> Effect {
        let first = first.max(1);
        let mut effect = None;
        for i in first..self.moments.len() {
            let before = self.moments[i - 1];
            let moment = &mut self.moments[i];
            let dt = (moment.at - before.at).seconds();
            moment.after = before.after;
            moment.after.predict(&self.parameters, moment.rates.during(dt), dt);
            let now = moment.sight.map(|sight| moment.after.correct(&self.parameters, &sight));
            if i == first {
                effect = now;
            }
        }
        effect.unwrap_or(Effect { surprise: 0.0, used: false, moved: 0.0 })
    }
}

#[cfg(test)]
mod tests;
