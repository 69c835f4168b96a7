//! A ring of sonars: echoes that cannot be true are taken out, and each direction gets a risk.
//!
//! In plain words: a sonar sometimes hears the pulse of another one (too short), or hears nothing because the wall
//! turned the pulse away (too long). One such reading must not stop the robot nor send it into the wall. But a true
//! short echo must not wait: it passes at once when the direction beside it says the same, and at the next sample in any
//! case.
//!
//! How it works, per direction: m is the median of the new reading r and the two before it, and the tolerance is
//! t = `noise` + `speed_max` · dt.
//!
//! | reading | output | why |
//! |---|---|---|
//! | within t of m | r | agrees with what was heard before: no delay at all |
//! | below m, and a neighbour's new reading is within t of it or nearer | r | two sonars hear it |
//! | anything else | m | alone in space and in time |
//!
//! A reading that agrees with the last one is within t of m, so what is heard twice passes. Two false readings of the same
//! kind among three in one direction pass too: more would take memory that delays true ones.

use crate::picture::{WrongLength, check};

/// Most directions of a ring.
pub const CAPACITY: usize = 64;

/// What the filter takes for true.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterParams {
    /// Shortest range that the sensor can measure (m). Default 0.05. Below it is a fault of the reading.
    pub range_min: f32,
    /// Longest range (m). Default 6. A reading above it, infinite or not a number is no echo, and becomes this value.
    pub range_max: f32,
    /// Scatter of the range of a thing at rest (m). Default 0.10: three standard deviations, 1 % of 3 m each, and a
    /// little for the width of the beam.
    pub noise: f32,
    /// Fastest that robot and obstacle approach each other (m/s). Default 1: a walking person, or the robot. At 4 Hz
    /// that is 0.25 m a sample; a larger value lets false echoes through, a smaller one delays true ones by a sample.
    pub speed_max: f32,
    /// Whether the last direction is beside the first. Default true: a ring around the robot.
    pub closed: bool,
}

/// When a direction is dangerous.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RiskParams {
    /// At this distance and below the risk is 1 (m). Default 0.25: the robot must not touch it with what sticks out.
    pub stop_distance: f64,
    /// Beyond this distance a thing at rest is no risk (m). Default 1.2: half the width of a corridor.
    pub clear_distance: f64,
    /// When the stop distance is reached within this time the risk is 1 (s). Default 0.5: two samples at 4 Hz.
    pub react_time: f64,
    /// When it takes longer than this time the approach is no risk (s). Default 4: time to go round it.
    pub clear_time: f64,
    /// Closing speeds below this are scatter (m/s). Default 0.1: a scatter of 2 cm between two samples at 4 Hz.
    pub speed_min: f64,
}

/// Filters the readings of a ring of up to [`CAPACITY`] sonars.
#[derive(Clone, Debug)]
pub struct SonarFilter {
    params: FilterParams,
    /// The readings before: the last, and the one before that. Readings that there were not are copies of the first.
    before: [[f32; CAPACITY]; 2],
    directions: usize,
}

impl Default for FilterParams {
    fn default() -> FilterParams {
        FilterParams { range_min: 0.05, range_max: 6.0, noise: 0.10, speed_max: 1.0, closed: true }
    }
}

impl Default for RiskParams {
    fn default() -> RiskParams {
        RiskParams {
            stop_distance: 0.25,
            clear_distance: 1.2,
            react_time: 0.5,
            clear_time: 4.0,
            speed_min: 0.1,
        }
    }
}

impl SonarFilter {
    /// A filter that has heard nothing yet.
    pub fn new(params: FilterParams) -> SonarFilter {
        SonarFilter { params, before: [[0.0; CAPACITY]; 2], directions: 0 }
    }

    /// The parameters.
    pub fn params(&self) -> &FilterParams {
        &self.params
    }

    /// Changes the parameters; what was heard is kept.
    pub fn set_params(&mut self, params: FilterParams) {
        self.params = params;
    }

    /// Forgets what was heard.
    pub fn reset(&mut self) {
        self.directions = 0;
    }

    /// Filters the readings `raw` (m) of all directions, `dt` seconds after the last ones, to `filtered` (m).
    ///
    /// The first readings, and those after a change of the number of directions, pass as they are. `filtered` must be as
    /// long as `raw`, and `raw` at most [`CAPACITY`] long.
    pub fn update(&mut self, raw: &[f32], dt: f64, filtered: &mut [f32]) -> Result<(), WrongLength> {
        let n = raw.len();
        check("raw", n, n.min(CAPACITY))?;
        check("filtered", filtered.len(), n)?;
        let mut now = [0.0; CAPACITY];
        for (out, reading) in now.iter_mut().zip(raw) {
            *out = self.range(*reading);
        }
        if n != self.directions {
            self.before = [now, now];
            self.directions = n;
        }
        let tolerance = self.params.noise + self.params.speed_max * dt.max(0.0) as f32;
        for i in 0..n {
            filtered[i] = self.filter(&now[..n], i, tolerance);
        }
        self.before = [now, self.before[0]];
        Ok(())
    }

    /// The reading as a range that the sensor can measure.
    fn range(&self, reading: f32) -> f32 {
        if reading < self.params.range_max {
            reading.max(self.params.range_min)
        } else {
            self.params.range_max
        }
    }

    fn filter(&self, now: &[f32], i: usize, tolerance: f32) -> f32 {
        let new = now[i];
        let middle = median(new, self.before[0][i], self.before[1][i]);
        let agrees = (new - middle).abs() <= tolerance;
        // A neighbour that hears something nearer still confirms it too: the obstacle reaches over there.
        let confirmed =
            || self.neighbours(i, now.len()).into_iter().flatten().any(|k| now[k] <= new + tolerance);
        if agrees || (new < middle && confirmed()) { new } else { middle }
    }

    fn neighbours(&self, i: usize, n: usize) -> [Option<usize>; 2] {
        let wrapped = |k: usize| (self.params.closed && k != i).then_some(k);
        [if i > 0 { Some(i - 1) } else { wrapped(n - 1) }, if i + 1 < n { Some(i + 1) } else { wrapped(0) }]
    }
}

/// Writes the risk (0..1) of each direction, from two samples of its range (m) that are `dt` seconds apart.
///
/// A range that is not a number is a direction of which nothing is known: its risk is 1. Without a sample before (not a
/// number, or `dt` not above 0) only the distance counts. All slices are of one length.
pub fn risk(
    before: &[f32],
    now: &[f32],
    dt: f64,
    params: &RiskParams,
    risk: &mut [f32],
) -> Result<(), WrongLength> {
    check("before", before.len(), now.len())?;
    check("risk", risk.len(), now.len())?;
    for i in 0..now.len() {
        let closing = if dt > 0.0 { (f64::from(before[i]) - f64::from(now[i])) / dt } else { 0.0 };
        risk[i] = risk_of(f64::from(now[i]), closing, params) as f32;
    }
    Ok(())
}

/// The risk (0..1) of a thing at `distance` (m) that comes nearer by `closing` (m/s).
///
/// Two causes, taken as independent: near, which grows as the square of how far it is inside the clear distance, and
/// soon, which grows evenly from 0 at the clear time to 1 at the reaction time before the stop distance is reached:
///
/// ```text
/// near = ((clear_distance − d) / (clear_distance − stop_distance))²     t = (d − stop_distance) / closing
/// soon = (clear_time − t) / (clear_time − react_time)                   risk = 1 − (1 − near)(1 − soon)
/// ```
///
/// with each of the two cut to 0..1. Nearer is never less risky, faster is never less risky.
pub fn risk_of(distance: f64, closing: f64, params: &RiskParams) -> f64 {
    if distance.is_nan() {
        return 1.0;
    }
    let margin = distance - params.stop_distance;
    if margin <= 0.0 {
        return 1.0;
    }
    let near = share(params.clear_distance - distance, params.clear_distance - params.stop_distance);
    let approaches = closing > 0.0 && closing >= params.speed_min;
    let soon = if approaches {
        share(params.clear_time - margin / closing, params.clear_time - params.react_time)
    } else {
        0.0
    };
    1.0 - (1.0 - near * near) * (1.0 - soon)
}

/// `part` of `whole`, cut to 0..1. A whole of nothing is a step.
fn share(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { (part / whole).clamp(0.0, 1.0) } else { f64::from(u8::from(part > 0.0)) }
}

fn median(a: f32, b: f32, c: f32) -> f32 {
    a.min(b).max(a.max(b).min(c))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test::single;
    use proptest::prelude::*;

    const DT: f64 = 0.25;

    /// What comes out of one direction of a ring of three; the two others hear the wall at 3 m.
    fn alone(readings: &[f32]) -> Vec<f32> {
        let mut filter = SonarFilter::new(FilterParams::default());
        let out = |r: &f32| {
            let mut out = [0.0; 3];
            filter.update(&[3.0, *r, 3.0], DT, &mut out).unwrap();
            assert_eq!((out[0], out[2]), (3.0, 3.0));
            out[1]
        };
        readings.iter().map(out).collect()
    }

    #[test]
    fn one_false_echo_is_taken_out() {
        assert_eq!(alone(&[3.0, 3.0, 0.4, 3.0, 3.0]), [3.0; 5], "crosstalk");
        assert_eq!(alone(&[2.0, 2.0, 6.0, 2.0, 2.0]), [2.0; 5], "specular loss");
        assert_eq!(alone(&[2.0, 2.0, f32::INFINITY, 2.0, 2.0, f32::NAN, 2.0]), [2.0; 7], "no echo");
    }

    #[test]
    fn what_is_heard_twice_passes() {
        assert_eq!(alone(&[3.0, 3.0, 1.0, 0.9, 0.8]), [3.0, 3.0, 3.0, 0.9, 0.8]);
        assert_eq!(alone(&[1.0, 1.0, 2.5, 2.5, 2.5]), [1.0, 1.0, 1.0, 2.5, 2.5]);
    }

    #[test]
    fn two_losses_among_three_readings_pass() {
        assert_eq!(alone(&[2.0, 2.0, 6.0, 2.0, 6.0, 2.0]), [2.0, 2.0, 2.0, 2.0, 6.0, 2.0], "the known limit");
    }

    #[test]
    fn an_approach_within_the_speed_limit_is_not_delayed() {
        let walk = [3.0, 2.75, 2.5, 2.2, 1.9, 1.6, 1.3];
        assert_eq!(alone(&walk), walk);
    }

    #[test]
    fn a_short_echo_that_a_neighbour_hears_too_passes_at_once() {
        let mut filter = SonarFilter::new(FilterParams::default());
        let mut out = [0.0; 4];
        filter.update(&[3.0; 4], DT, &mut out).unwrap();
        filter.update(&[0.8, 3.0, 3.0, 1.0], DT, &mut out).unwrap();
        assert_eq!(out, [0.8, 3.0, 3.0, 1.0], "the ring is closed");
        let open = FilterParams { closed: false, ..FilterParams::default() };
        let mut filter = SonarFilter::new(open);
        filter.update(&[3.0; 4], DT, &mut out).unwrap();
        filter.update(&[0.8, 3.0, 3.0, 1.0], DT, &mut out).unwrap();
        assert_eq!(out, [3.0; 4], "the ring is open");
    }

    #[test]
    fn rings_of_any_size_up_to_the_capacity() {
        let mut filter = SonarFilter::new(FilterParams::default());
        for n in [0, 1, 2, CAPACITY] {
            let mut out = vec![0.0; n];
            filter.update(&vec![9.0; n], DT, &mut out).unwrap();
            assert_eq!(out, vec![6.0; n]);
        }
        assert_eq!(
            filter.update(&[1.0; 65], DT, &mut [0.0; 65]),
            Err(WrongLength { buffer: "raw", expected: 64, got: 65 })
        );
    }

    #[test]
    fn risk_at_the_corners_of_its_definition() {
        let p = RiskParams::default();
        let check = |distance: f64, closing: f64, expect: f64| {
            assert!((risk_of(distance, closing, &p) - expect).abs() < 1e-12, "{distance} m at {closing} m/s");
        };
        check(0.25, 0.0, 1.0);
        check(1.2, 0.0, 0.0);
        check(0.725, 0.0, 0.25); // half way: ½²
        check(2.5, 1.0, 0.5); // 2.25 s, half way between 4 s and 0.5 s
        check(0.725, 0.475 / 2.25, 1.0 - 0.75 * 0.5); // both
        check(0.725, 0.09, 0.25); // scatter
        check(0.725, -1.0, 0.25); // it goes away
        check(f64::NAN, 0.0, 1.0);
    }

    #[test]
    fn risk_takes_the_speed_from_two_samples() {
        let mut out = [9.0; 3];
        let (before, now) = ([2.75, f32::NAN, 6.0], [2.5, 2.5, f32::NAN]);
        risk(&before, &now, DT, &RiskParams::default(), &mut out).unwrap();
        assert_eq!(out, [0.5, 0.0, 1.0]);
        risk(&before, &now, 0.0, &RiskParams::default(), &mut out).unwrap();
        assert_eq!(out, [0.0, 0.0, 1.0]);
        assert!(risk(&before, &now[..2], DT, &RiskParams::default(), &mut out).is_err());
    }

    proptest! {
        #[test]
        fn nearer_or_faster_is_never_less_risky(
            d in 0.0..8.0f64, nearer in 0.0..4.0f64, v in -2.0..3.0f64, faster in 0.0..2.0f64,
        ) {
            let p = RiskParams::default();
            let base = risk_of(d, v, &p);
            prop_assert!((0.0..=1.0).contains(&base));
            prop_assert!(risk_of(d - nearer, v, &p) >= base - 1e-12);
            prop_assert!(risk_of(d, v + faster, &p) >= base - 1e-12);
        }

        #[test]
        fn the_output_is_always_one_of_the_last_three_readings(
            readings in proptest::collection::vec(proptest::collection::vec(single(0.1..5.9), 5), 3..12)
        ) {
            let mut filter = SonarFilter::new(FilterParams::default());
            let mut out = [0.0; 5];
            for (k, ring) in readings.iter().enumerate() {
                filter.update(ring, DT, &mut out).unwrap();
                for i in 0..5 {
                    prop_assert!((k.saturating_sub(2)..=k).any(|j| readings[j][i] == out[i]));
                }
            }
        }
    }
}
