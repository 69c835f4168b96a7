//! The sonar agent: a ring of echoes becomes ranges around the robot, raw and filtered, and a risk for each direction.
//!
//! ```text
//!            ┌─▶ around the centre ─▶ raw
//!  echoes ───┤                   └─▶ filter ─▶ filtered
//!  (robot)   └                            └─▶ change between two samples ─▶ risk
//! ```

use libm::{hypot, sincos};
use perception::sonar::{FilterParams, RiskParams, SonarFilter};
use runtime::{Agent, Envelope, Fault, Input, Output, Step};
use types::messages::{Echo, Echoes, Ranges, Risk};
use types::params::Params;
use types::{Sequence, Time, geometry::TAU};

use crate::shared::{Before, blank};
use crate::trust::{Mounts, can_be};

/// How echoes are filtered and when a direction is risky.
#[derive(Clone, Debug, Params)]
pub struct SonarParams {
    /// Scatter of the distance to a thing at rest (m). 0.10 is three standard deviations of 1 % of 3 m, and a little for the width of the beam.
    #[param(default = 0.1, min = 0.0, max = 2.0)]
    pub noise: f64,
    /// Fastest that robot and obstacle approach each other (m/s). 1.0 is somebody who walks; more lets false echoes through, less delays true ones.
    #[param(default = 1.0, min = 0.0, max = 20.0)]
    pub speed_max: f64,
    /// Distance from the robot's centre at which the risk is 1 (m). 0.48 leaves 0.25 m to the rim of a robot 0.45 m wide.
    #[param(default = 0.48, min = 0.0, max = 5.0)]
    pub risk_stop: f64,
    /// Distance from the robot's centre beyond which a thing at rest is no risk (m). 1.4 is half the width of a corridor and the robot's radius.
    #[param(default = 1.4, min = 0.0, max = 10.0)]
    pub risk_clear: f64,
    /// The risk is 1 when the stop distance is reached within this time (s). 0.5 is two samples at 4 Hz.
    #[param(default = 0.5, min = 0.0, max = 10.0)]
    pub risk_react: f64,
    /// An approach that takes longer than this is no risk (s). 4 is time to go round it.
    #[param(default = 4.0, min = 0.0, max = 60.0)]
    pub risk_late: f64,
    /// Closing speeds below this are scatter (m/s). 0.1 is a scatter of 2.5 cm between two samples at 4 Hz.
    #[param(default = 0.1, min = 0.0, max = 5.0)]
    pub closing_min: f64,
}

impl SonarParams {
    fn filter(&self, raw: &Ranges, closed: bool) -> FilterParams {
        FilterParams {
            range_min: raw.range_min,
            range_max: raw.range_max,
            noise: self.noise as f32,
            speed_max: self.speed_max as f32,
            closed,
        }
    }

    fn risk(&self) -> RiskParams {
        RiskParams {
            stop_distance: self.risk_stop,
            clear_distance: self.risk_clear,
            react_time: self.risk_react,
            clear_time: self.risk_late,
            speed_min: self.closing_min,
        }
    }
}

/// Gives the distances around the robot, raw and filtered, and the risk in each direction, from a ring of sonars.
#[derive(Agent)]
pub struct Sonar {
    /// What the transducers heard.
    #[robot("sonar")]
    echoes: Input<Echoes>,
    /// Distances from the robot's centre, as they were measured.
    #[port(history = 16, raw)]
    raw: Output<Ranges>,
    /// The same without echoes that cannot be true.
    #[port(history = 16, filtered)]
    filtered: Output<Ranges>,
    /// How likely something in a direction will be run into, from the change between two samples.
    #[port(interpreted)]
    risk: Output<Risk>,
    params: SonarParams,
    chain: Chain,
    mounts: Mounts,
    /// Whether the last ring could not be true.
    doubted: bool,
}

impl Agent for Sonar {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        let Some(received) = self.echoes.newest() else { return Ok(()) };
        let stamp = received.header().stamp;
        let envelope = Envelope { stamp: Some(stamp), ..Envelope::default() };
        if !can_be(&received) || !self.mounts.are_where_they_were(&received) {
            if !std::mem::replace(&mut self.doubted, true) {
                runtime::note!("the ring of sonars says what cannot be; it is not listened to");
            }
            return Ok(());
        }
        self.doubted = false;
        let raw = around_centre(&received);
        if self.raw.has_listeners() {
            self.raw.send_as(envelope, raw);
        }
        if !self.filtered.has_listeners() && !self.risk.has_listeners() {
            // What nobody hears is not computed; when somebody listens again the filter begins anew.
            self.chain = Chain::default();
            return Ok(());
        }
        let (filtered, risk) = self.chain.update(&self.params, raw, stamp)?;
        self.filtered.send_as(envelope, filtered);
        self.risk.send_as(envelope, risk);
        Ok(())
    }
}

/// The distances from the robot's centre, in as many directions as there are transducers.
///
/// A transducer counts for the direction in which it looks; its distance is that of the point in the middle of its cone. Of two that
/// look in one direction the nearer one counts. A direction into which none looks is not a number: nothing is known of it.
pub fn around_centre(echoes: &Echoes) -> Ranges {
    let row = &echoes.echoes;
    let directions = directions(row);
    let beams = row.iter().zip(directions.iter());
    let reach = |echo: &Echo, (sine, cosine): (f64, f64), range: f64| {
        hypot(f64::from(echo.x) + range * cosine, f64::from(echo.y) + range * sine) as f32
    };
    let reach_of_all = |range: f64| beams.clone().map(move |(echo, way)| reach(echo, *way, range));
    let silent = f64::from(echoes.range_max);
    let range_max = reach_of_all(silent).fold(echoes.range_max, f32::max);
    let range_min = reach_of_all(echoes.range_min.into()).fold(range_max, f32::min);
    let mut ranges = blank(row.len(), range_min, range_max);
    for (echo, way) in beams.clone() {
        let range = f64::from(echo.range);
        // What is not a number, infinite or the longest range was no echo.
        let distance = if range < silent { reach(echo, *way, range).min(range_max) } else { range_max };
        let place = &mut ranges.values[perception::laser::direction_of(echo.bearing.into(), row.len())];
        *place = place.min(distance);
    }
    ranges
}

/// Sine and cosine of where each transducer looks.
fn directions<const N: usize>(row: &Sequence<Echo, N>) -> Sequence<(f64, f64), N> {
    row.iter().map(|echo| sincos(echo.bearing.into())).collect()
}

/// The filters behind the receiver.
#[derive(Clone, Debug)]
struct Chain {
    filter: SonarFilter,
    before: Before,
}

impl Default for Chain {
    fn default() -> Chain {
        Chain { filter: SonarFilter::new(FilterParams::default()), before: Before::default() }
    }
}

/// The algorithms refuse rings of more directions than they have room for; a message has not that many.
const TOO_MANY: Fault = Fault::new("a ring of sonars has more directions than the filter has room for");

impl Chain {
    fn update(&mut self, params: &SonarParams, raw: Ranges, stamp: Time) -> Result<(Ranges, Risk), Fault> {
        let n = raw.values.len();
        let closed =
            raw.values.iter().all(|range| !range.is_nan()) && n as f32 * raw.angle_step > 0.99 * TAU as f32;
        self.filter.set_params(params.filter(&raw, closed));
        let dt = self.before.since(&raw, stamp);
        let mut filtered = raw;
        self.filter.update(&raw.values, dt, &mut filtered.values).map_err(|_| TOO_MANY)?;
        for (out, raw) in filtered.values.iter_mut().zip(raw.values.iter()) {
            // The filter takes an unknown direction for a free one.
            *out = if raw.is_nan() { f32::NAN } else { *out };
        }
        let risk = self.before.risk(filtered, stamp, &params.risk()).ok_or(TOO_MANY)?;
        Ok((filtered, risk))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use libm::{cos, sin};
    use types::Duration;

    /// `n` transducers on the rim of a robot of 0.2 m radius.
    fn heard(ranges: &[f32]) -> Echoes {
        let n = ranges.len() as f64;
        let echo = |(i, range): (usize, &f32)| {
            let bearing = i as f64 * TAU / n;
            Echo {
                x: (0.2 * cos(bearing)) as f32,
                y: (0.2 * sin(bearing)) as f32,
                bearing: bearing as f32,
                range: *range,
            }
        };
        let echoes = ranges.iter().enumerate().map(echo).collect();
        Echoes { range_min: 0.15, range_max: 6.0, cone: 0.5, echoes }
    }

    #[test]
    fn distances_begin_at_the_robots_centre() {
        let ranges = around_centre(&heard(&[1.0, 2.0, 6.0, f32::NAN]));
        let expect = [1.2, 2.2, 6.2, 6.2];
        assert!(ranges.values.iter().zip(expect).all(|(got, want)| (got - want).abs() < 1e-5), "{ranges:?}");
        assert!((ranges.range_max - 6.2).abs() < 1e-5 && (ranges.range_min - 0.35).abs() < 1e-5);
        assert_eq!(ranges.points().count(), 2, "silence is no point");
    }

    #[test]
    fn a_direction_without_a_transducer_is_unknown_and_stays_so() {
        let mut echoes = heard(&[1.0, 2.0, 3.0, 4.0]);
        echoes.echoes[3].bearing = echoes.echoes[2].bearing;
        let raw = around_centre(&echoes);
        assert!(raw.values[3].is_nan() && raw.values[2] < 3.3, "{raw:?}");
        let (filtered, risk) = Chain::default().update(&SonarParams::default(), raw, Time::ZERO).unwrap();
        assert!(filtered.values[3].is_nan());
        assert_eq!(risk.values[3], 1.0, "the unknown is risky");
    }

    #[test]
    fn one_false_echo_is_in_the_raw_ranges_only() {
        let mut chain = Chain::default();
        let (mut stamp, mut last) = (Time::ZERO, None);
        for front in [3.0, 3.0, 0.4] {
            let raw = around_centre(&heard(&[front, 3.0, 3.0, 3.0]));
            last = Some((raw, chain.update(&SonarParams::default(), raw, stamp).unwrap()));
            stamp += Duration::millis(250);
        }
        let (raw, (filtered, _)) = last.unwrap();
        assert!((raw.values[0] - 0.6).abs() < 1e-5 && (filtered.values[0] - 3.2).abs() < 1e-5);
    }

    #[test]
    fn an_approach_is_riskier_than_a_thing_at_rest() {
        let risk_of = |fronts: [f32; 2]| {
            let mut chain = Chain::default();
            let at = |front: f32| around_centre(&heard(&[front, 3.0, 3.0, 3.0]));
            chain.update(&SonarParams::default(), at(fronts[0]), Time::ZERO).unwrap();
            let later = Time::ZERO + Duration::millis(250);
            chain.update(&SonarParams::default(), at(fronts[1]), later).unwrap().1.values[0]
        };
        // 1 m away at 1 m/s: 0.72 s to the stop distance, (4 − 0.72) / 3.5 of a risk, besides the distance itself.
        let near = ((1.4f64 - 1.2) / 0.92) * ((1.4 - 1.2) / 0.92);
        let soon = (4.0 - 0.72) / 3.5;
        assert!((f64::from(risk_of([1.25, 1.0])) - (1.0 - (1.0 - near) * (1.0 - soon))).abs() < 1e-4);
        assert!((f64::from(risk_of([1.0, 1.0])) - near).abs() < 1e-4);
    }
}
