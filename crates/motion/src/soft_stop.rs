//! The soft stop: it comes when something is within the way that stopping needs, and goes by itself when that is free again.
//!
//! ```text
//!             range ≤ critical range of the present speed, or nothing new was measured
//!  ┌───────┐ ─────────────────────────────────────────────────────────────────────────▶ ┌─────────┐
//!  │ Clear │                                                                            │ Stopped │
//!  └───────┘ ◀───────────────────────────────────────────────────────────────────────── └─────────┘
//!             range > margin + release, for as long as a release takes
//! ```
//!
//! The critical range is r = v t + v²/(2a) + m, with the speed v, the reaction time t, the deceleration a and the margin m.

use crate::safety::stopping_distance;
use libm::fmax;

/// How much room a stop needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// From a measurement to the answer of the wheels (s).
    pub reaction: f64,
    /// How fast it brakes (m/s²), positive.
    pub deceleration: f64,
    /// Way that is left after the stop (m).
    pub margin: f64,
    /// So much more than the margin must be free before it goes again (m).
    pub release: f64,
    /// For so long (s).
    pub release_time: f64,
    /// A measurement that is older than this is none (s): whatever it does not see is an obstacle at the edge.
    pub stale: f64,
}

impl Default for Parameters {
    /// 0.2 s are a period of a slow laser and one of the controller; 1 m/s² brakes without tipping. 5 cm are left. It goes again with 10 cm more
    /// than that, held for 0.3 s, so that the noise of a range and a leg that passes do not make it jerk. Half a second without a measurement
    /// is more than any sensor of a robot that drives may take.
    fn default() -> Parameters {
        Parameters {
            reaction: 0.2,
            deceleration: 1.0,
            margin: 0.05,
            release: 0.1,
            release_time: 0.3,
            stale: 0.5,
        }
    }
}

/// What was measured last.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Free way in the direction of the motion, from the edge of the body (m); infinite if nothing is there.
    pub range: f64,
    /// How long ago (s).
    pub age: f64,
}

/// What the law says, with its numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Verdict {
    /// Whether it must stop, or stay.
    pub stop: bool,
    /// The way that counted (m): zero for what is not known.
    pub range: f64,
    /// The way below which it must stop (m).
    pub critical: f64,
    /// Whether that is so because nothing new was measured.
    pub stale: bool,
}

/// The way within which nothing may be at `speed` (m/s); going back needs as much as going forward.
pub fn critical_range(parameters: &Parameters, speed: f64) -> f64 {
    let Parameters { reaction, deceleration, margin, .. } = *parameters;
    stopping_distance(libm::fabs(speed), reaction, deceleration) + margin
}

/// The soft stop with its memory.
#[derive(Clone, Copy, Debug)]
pub struct SoftStop {
    parameters: Parameters,
    stopped: bool,
    /// For how long the way has been free again (s).
    free: f64,
}

impl SoftStop {
    /// A stop that has not come: nothing was measured yet, so the first step may make it come.
    pub fn new(parameters: Parameters) -> SoftStop {
        SoftStop { parameters, stopped: false, free: 0.0 }
    }

    /// Judges what was measured of each sensor that looks where the robot goes, at `speed` (m/s), `dt` (s) after the step before.
    ///
    /// The shortest way counts. A sensor that has never told anything, or nothing lately, tells an obstacle at the edge; so does none at all.
    pub fn step(&mut self, sensors: &[Option<Measured>], speed: f64, dt: f64) -> Verdict {
        let fresh = |measured: &Measured| measured.range >= 0.0 && measured.age <= self.parameters.stale;
        let known = |sensor: &Option<Measured>| sensor.filter(fresh).map(|measured| measured.range);
        let stale = sensors.is_empty() || sensors.iter().any(|sensor| known(sensor).is_none());
        let range =
            if stale { 0.0 } else { sensors.iter().filter_map(known).fold(f64::INFINITY, libm::fmin) };
        // A speed that is no number may be any.
        let critical =
            if speed.is_finite() { critical_range(&self.parameters, speed) } else { f64::INFINITY };
        if range <= critical {
            (self.stopped, self.free) = (true, 0.0);
        } else if self.stopped {
            let clear = range > self.parameters.margin + self.parameters.release;
            self.free = if clear { self.free + fmax(dt, 0.0) } else { 0.0 };
            self.stopped = self.free < self.parameters.release_time;
        }
        Verdict { stop: self.stopped, range, critical, stale }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(range: f64) -> [Option<Measured>; 1] {
        [Some(Measured { range, age: 0.0 })]
    }

    #[test]
    fn at_three_decimetres_a_second_it_needs_ten_and_a_half_centimetres() {
        // 0.3 · 0.2 + 0.09/2 = 0.105.
        let parameters = Parameters { margin: 0.0, ..Parameters::default() };
        assert!((critical_range(&parameters, 0.3) - 0.105).abs() < 1e-12);
        assert!((critical_range(&parameters, -0.3) - 0.105).abs() < 1e-12);
        assert!((critical_range(&Parameters::default(), 0.3) - 0.155).abs() < 1e-12);
    }

    #[test]
    fn it_stops_within_the_critical_range_and_goes_again_by_itself_when_it_is_clear_for_long_enough() {
        let mut law = SoftStop::new(Parameters::default());
        assert!(!law.step(&at(0.16), 0.3, 0.1).stop);
        assert!(law.step(&at(0.15), 0.3, 0.1).stop);
        // It stands; 0.06 m would not have made it stop, but are too little to go.
        assert!(law.step(&at(0.06), 0.0, 0.1).stop);
        let trace = [0.16, 0.16, 0.14, 0.16, 0.16, 0.16].map(|range| law.step(&at(range), 0.0, 0.101).stop);
        assert_eq!(trace, [true, true, true, true, true, false]);
    }

    #[test]
    fn what_is_stale_or_was_never_there_is_an_obstacle_at_the_edge() {
        let far = |age: f64| Some(Measured { range: 9.0, age });
        let verdict =
            |sensors: &[Option<Measured>]| SoftStop::new(Parameters::default()).step(sensors, 0.0, 0.1);
        assert!(!verdict(&[far(0.5), far(0.0)]).stop);
        for sensors in [&[far(0.0), far(0.51)][..], &[far(0.0), None], &[]] {
            let out = verdict(sensors);
            assert!(out.stop && out.stale && out.range == 0.0, "{sensors:?}");
        }
        assert!(verdict(&[Some(Measured { range: f64::NAN, age: 0.0 })]).stop);
    }

    proptest! {
        #[test]
        fn who_obeys_never_touches(start in 0.2f64..4.0, wish in 0.05f64..1.5) {
            // One that reacts as late as it may and brakes no better than it was said.
            let parameters = Parameters::default();
            let mut law = SoftStop::new(parameters);
            let (dt, mut x, mut v, mut told) = (0.01, start, 0.0f64, None);
            for i in 0..3000 {
                let now = f64::from(i) * dt;
                if law.step(&at(fmax(x, 0.0)), v, dt).stop {
                    told.get_or_insert(now);
                } else {
                    told = None;
                }
                let brakes = told.is_some_and(|since| now >= since + parameters.reaction - 2.0 * dt);
                v = if brakes { fmax(v - parameters.deceleration * dt, 0.0) } else if told.is_some() { v } else { libm::fmin(v + 0.5 * dt, wish) };
                x -= v * dt;
                prop_assert!(x > 0.0, "touched at {v} m/s");
            }
        }
    }
}
