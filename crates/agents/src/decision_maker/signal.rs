//! The signals: what the decision maker knows, as numbers with names.

use types::Name;
use types::messages::Reasons;

/// What a condition, or a part of it, is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Number,
    Truth,
}

macro_rules! signals {
    ($($signal:ident, $name:literal, $kind:ident;)*) => {
        /// A signal that every decision maker knows. What each of them is stands at the parameter `table`.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(super) enum Known {
            $($signal),*
        }

        impl Known {
            /// All of them, in the order of their places.
            pub(super) const ALL: &[Known] = &[$(Known::$signal),*];

            /// What conditions call it.
            pub(super) const fn name(self) -> &'static str {
                match self {
                    $(Known::$signal => $name),*
                }
            }

            /// Whether it is a number, or yes or no.
            pub(super) const fn kind(self) -> Kind {
                match self {
                    $(Known::$signal => Kind::$kind),*
                }
            }
        }
    };
}

signals! {
    Danger, "danger", Number;
    Desire, "desire", Number;
    Risk, "risk", Number;
    Blind, "blind", Truth;
    Narrow, "narrow", Truth;
    Nearest, "nearest", Number;
    NearestBearing, "nearest_bearing", Number;
    LinearMax, "linear_max", Number;
    SafetyAge, "safety_age", Number;
    TargetShare, "target_share", Number;
    TargetBearing, "target_bearing", Number;
    TargetVisible, "target_visible", Truth;
    TargetAge, "target_age", Number;
    Battery, "battery", Number;
    BatteryAge, "battery_age", Number;
    Speed, "speed", Number;
    Turn, "turn", Number;
    Load, "load", Number;
    Pressure, "pressure", Number;
}

/// How many names of their own agents can use.
pub(super) const MOST_TOLD: usize = 16;
const PLACES: usize = Known::ALL.len() + MOST_TOLD;

/// The values of all signals at one time. A signal has a place: that of [`Known`], and behind them those that a table names.
#[derive(Clone, Copy, Debug)]
pub(super) struct Values([f64; PLACES]);

impl Values {
    /// Nothing is known.
    pub(super) const UNKNOWN: Values = Values([f64::NAN; PLACES]);

    /// The place of a name that agents tell, the `i`-th that a table uses.
    pub(super) const fn place_of_told(i: usize) -> usize {
        Known::ALL.len() + i
    }

    /// What was recorded of a decision; `told` are the names that its table uses beside the known ones.
    pub(super) fn recorded(reasons: &Reasons, told: &[Name]) -> Values {
        let mut values = Values::UNKNOWN;
        for reason in reasons.values.iter() {
            let name = reason.signal.as_str();
            let known = Known::ALL.iter().position(|known| known.name() == name);
            let told = || told.iter().position(|told| told.as_str() == name).map(Values::place_of_told);
            if let Some(place) = known.or_else(told) {
                values.0[place] = reason.value;
            }
        }
        values
    }

    /// The value at a place; NaN where it is unknown.
    pub(super) fn at(&self, place: usize) -> f64 {
        self.0[place]
    }

    /// The value of a signal, where it is known.
    pub(super) fn get(&self, signal: Known) -> Option<f64> {
        Some(self.0[signal as usize]).filter(|value| !value.is_nan())
    }

    /// Whether a signal is yes: what is unknown is not.
    pub(super) fn is(&self, signal: Known) -> bool {
        is_true(self.0[signal as usize])
    }

    /// The same with a value at a place.
    pub(super) fn put(&mut self, place: usize, value: impl Into<Option<f64>>) {
        self.0[place] = value.into().unwrap_or(f64::NAN);
    }

    /// The same with yes or no.
    pub(super) fn put_truth(&mut self, signal: Known, truth: impl Into<Option<bool>>) {
        self.put(signal as usize, truth.into().map(of_truth));
    }
}

/// Yes and no as numbers.
pub(super) fn of_truth(truth: bool) -> f64 {
    if truth { 1.0 } else { 0.0 }
}

/// What is unknown is not true.
pub(super) fn is_true(number: f64) -> bool {
    number >= 0.5
}
