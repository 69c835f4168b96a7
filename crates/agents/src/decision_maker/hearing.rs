//! What the decision maker has heard, and what the signals are at a time.

use types::geometry::wrap;
use types::messages::{Battery, Load, Odometry, Risk, Safety, Signal, Target};
use types::{Sequence, Time};

use super::DecisionParams;
use super::signal::{Known, MOST_TOLD, Values};
use crate::shared::Dated;

/// The last that was heard of each.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Hearing {
    pub(super) safety: Option<Dated<Safety>>,
    pub(super) target: Option<Dated<Target>>,
    pub(super) risk: Option<Dated<Risk>>,
    pub(super) battery: Option<Dated<Battery>>,
    pub(super) odometry: Option<Dated<Odometry>>,
    pub(super) load: Option<Dated<Load>>,
    told: Sequence<Told, MOST_TOLD>,
    /// Signals that were passed over: nobody declared them.
    turned_away: u64,
}

/// The newest signal of a name.
#[derive(Clone, Copy, Debug, Default)]
struct Told {
    signal: Signal,
    stamp: Time,
}

impl Hearing {
    /// Keeps what an agent tells, the newest of each name. A name that is not declared is passed over, so that those which are always
    /// have room.
    pub(super) fn told(&mut self, declared: &[String], signal: Signal, stamp: Time) {
        let told = Told { signal, stamp };
        if let Some(known) = self.told.iter_mut().find(|known| known.signal.name == signal.name) {
            if stamp >= known.stamp {
                *known = told;
            }
            return;
        }
        let is_declared = |name: &str| declared.iter().any(|declared| declared == name);
        if is_declared(signal.name.as_str()) {
            // Names that were declared once, before the parameter was set anew, make room.
            if self.told.len() == MOST_TOLD
                && let Some(stale) =
                    self.told.iter_mut().find(|known| !is_declared(known.signal.name.as_str()))
            {
                *stale = told;
                return;
            }
            if self.told.push(told).is_ok() {
                return;
            }
        }
        self.turned_away += 1;
        if self.turned_away == 1 {
            runtime::note!("a signal came that is not declared in \"signals\": it counts for nothing");
        }
    }

    /// What the signals are now. What nobody sent, or is too old, is unknown.
    pub(super) fn values(&self, params: &DecisionParams, now: Time) -> Values {
        let mut values = Values::UNKNOWN;
        self.safety(params, now, &mut values);
        self.target(params, now, &mut values);
        self.body(params, now, &mut values);
        for (place, name) in params.table.told() {
            let told = self.told.iter().find(|told| told.signal.name == *name);
            let holds = told.filter(|told| told.signal.valid_until >= now);
            values.put(place, holds.map(|told| told.signal.value));
        }
        values
    }

    fn safety(&self, params: &DecisionParams, now: Time, values: &mut Values) {
        let safety = Dated::fresh(&self.safety, now, params.safety_age).filter(|safety| !safety.blind);
        let risk = self.risk_ahead(params, now);
        let counts = params.risk_share * risk.unwrap_or(0.0);
        values.put(Known::Danger as usize, safety.map_or(1.0, |safety| safety.danger.max(counts)));
        values.put(Known::Risk as usize, risk);
        values.put_truth(Known::Blind, safety.is_none());
        values.put_truth(Known::Narrow, safety.map(|safety| safety.narrow));
        values.put(Known::Nearest as usize, safety.map(|safety| safety.nearest));
        values.put(Known::NearestBearing as usize, safety.map(|safety| safety.nearest_bearing));
        values.put(Known::LinearMax as usize, safety.map(|safety| safety.linear_max));
        values.put(Known::SafetyAge as usize, age(&self.safety, now));
    }

    fn target(&self, params: &DecisionParams, now: Time, values: &mut Values) {
        let target = Dated::fresh(&self.target, now, params.target_age);
        values.put(Known::Desire as usize, target.map_or(0.0, |target| target.desire));
        values.put(Known::TargetShare as usize, target.map(|target| target.share));
        values.put(Known::TargetBearing as usize, target.map(|target| target.bearing));
        values.put_truth(Known::TargetVisible, target.map(|target| target.visible));
        values.put(Known::TargetAge as usize, age(&self.target, now));
    }

    fn body(&self, params: &DecisionParams, now: Time, values: &mut Values) {
        let battery = Dated::fresh(&self.battery, now, params.battery_age);
        values.put(Known::Battery as usize, battery.map(|battery| battery.charge));
        values.put(Known::BatteryAge as usize, age(&self.battery, now));
        let odometry = Dated::fresh(&self.odometry, now, params.motion_age);
        values.put(Known::Speed as usize, odometry.map(|odometry| odometry.twist.linear));
        values.put(Known::Turn as usize, odometry.map(|odometry| odometry.twist.angular));
        let load = Dated::fresh(&self.load, now, params.load_age);
        values.put(Known::Load as usize, load.and_then(|load| load.mean()));
        let pressure = load.map(|load| f64::from(load.pressure_cpu.max(load.pressure_memory)));
        values.put(Known::Pressure as usize, pressure);
    }

    /// The greatest risk in front. A direction of which nothing is known adds none: safety judges that.
    fn risk_ahead(&self, params: &DecisionParams, now: Time) -> Option<f64> {
        let risk = Dated::fresh(&self.risk, now, params.safety_age)?;
        let bearing = |i: usize| wrap(f64::from(risk.angle_min) + i as f64 * f64::from(risk.angle_step));
        let ahead = risk.values.iter().enumerate().filter(|(i, _)| bearing(*i).abs() <= params.front);
        Some(ahead.map(|(_, risk)| f64::from(*risk)).fold(0.0, f64::max))
    }
}

/// How old a message is (s).
fn age<T>(held: &Option<Dated<T>>, now: Time) -> Option<f64> {
    held.as_ref().map(|dated| (now - dated.stamp).seconds())
}
