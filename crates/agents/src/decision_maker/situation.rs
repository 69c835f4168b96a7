//! The situations that the decision maker recognises by itself.

use types::geometry::wrap;

use super::DecisionParams;
use super::signal::{Known, Values};

/// What the decision maker recognises without a condition in the table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Situation {
    /// Nothing is known of the surroundings.
    #[default]
    Blind,
    /// What is near is what is followed.
    TargetNear,
    /// Something is too near.
    DangerNear,
    /// There is something to follow.
    TargetSeen,
    /// There is little room on both sides.
    Narrow,
    /// Always.
    Free,
}

impl Situation {
    /// All of them, the first before the others.
    pub const ALL: [Situation; 6] = [
        Situation::Blind,
        Situation::TargetNear,
        Situation::DangerNear,
        Situation::TargetSeen,
        Situation::Narrow,
        Situation::Free,
    ];

    /// What they look at.
    pub(super) const SIGNALS: [Known; 7] = [
        Known::Danger,
        Known::Desire,
        Known::Blind,
        Known::Narrow,
        Known::NearestBearing,
        Known::TargetShare,
        Known::TargetBearing,
    ];

    /// Its key in the table.
    pub const fn name(self) -> &'static str {
        match self {
            Situation::Blind => "blind",
            Situation::TargetNear => "target.near",
            Situation::DangerNear => "danger.near",
            Situation::TargetSeen => "target.seen",
            Situation::Narrow => "narrow",
            Situation::Free => "free",
        }
    }

    /// The situation with this key.
    pub fn named(name: &str) -> Option<Situation> {
        Situation::ALL.into_iter().find(|situation| situation.name() == name)
    }

    /// Its priority where the table says no other.
    pub const fn priority(self) -> i32 {
        match self {
            Situation::Blind => 100,
            Situation::TargetNear => 90,
            Situation::DangerNear => 80,
            Situation::TargetSeen => 70,
            Situation::Narrow => 20,
            Situation::Free => 0,
        }
    }

    /// Whether it silences all agents where the table gives it no weights: then nothing is known that would speak for moving.
    pub(super) const fn silences(self) -> bool {
        matches!(self, Situation::Blind | Situation::DangerNear)
    }
}

/// Which of them are active; found once for all, since they share their levels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Recognised {
    endangered: bool,
    desiring: bool,
    blind: bool,
    narrow: bool,
    is_the_target: bool,
}

impl Recognised {
    /// `was` says of each whether it was active before.
    pub(super) fn of(
        params: &DecisionParams,
        values: &Values,
        was: impl Fn(Situation) -> bool,
    ) -> Recognised {
        let with_hysteresis =
            |is: bool, value: f64, from: f64, until: f64| value >= if is { until.min(from) } else { from };
        let endangered = was(Situation::TargetNear) || was(Situation::DangerNear);
        let danger = values.at(Known::Danger as usize);
        let endangered = with_hysteresis(endangered, danger, params.danger_from, params.danger_until);
        let desire = values.at(Known::Desire as usize);
        let desiring = was(Situation::TargetSeen);
        let desiring = with_hysteresis(desiring, desire, params.desire_from, params.desire_until);
        let blind = values.is(Known::Blind);
        let is_the_target = desiring && !blind && is_the_target(params, values);
        Recognised { endangered, desiring, blind, narrow: values.is(Known::Narrow), is_the_target }
    }

    pub(super) fn is(&self, situation: Situation) -> bool {
        match situation {
            Situation::Blind => self.blind,
            Situation::TargetNear => self.endangered && self.is_the_target,
            Situation::DangerNear => self.endangered && !self.is_the_target,
            Situation::TargetSeen => self.desiring,
            Situation::Narrow => self.narrow,
            Situation::Free => true,
        }
    }
}

/// Whether the thing that is near is the one that is followed: then it is faced, not fled. What is unknown is not.
fn is_the_target(params: &DecisionParams, values: &Values) -> bool {
    let value = |signal: Known| values.at(signal as usize);
    let off = wrap(value(Known::NearestBearing) - value(Known::TargetBearing)).abs();
    value(Known::TargetShare) >= params.target_share && off <= params.target_width
}
