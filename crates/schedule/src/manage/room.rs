//! What an agent can still give.

use num_traits::One;

use crate::Exact;
use crate::manage::{Managed, Setting};

/// The room between what is ordered of an agent and the least that its designer allows.
#[derive(Clone, Debug)]
pub(super) struct Room {
    /// From the period that is ordered to the longest.
    pub period: Option<(Exact, Exact)>,
    /// The places of its methods, the ordered one first, each cheaper than all before.
    pub ways: Vec<usize>,
    /// From the most to the least.
    pub budget: Option<(Exact, Exact)>,
    /// Whether it is to run.
    pub active: bool,
    /// Whether it may be put to sleep.
    pub may_suspend: bool,
    /// How readily its period gives way, its importance considered.
    pub give: f64,
    /// Its importance, within reason.
    pub importance: f64,
}

/// Who is not important at all counts a hundredth of the most important: to divide by it.
const LEAST_IMPORTANCE: f64 = 0.01;

impl Room {
    pub(super) fn of(managed: &Managed) -> Room {
        let importance = sound(managed.importance).clamp(LEAST_IMPORTANCE, 1.0);
        let ordered = managed.orders.method.min(managed.methods.len().saturating_sub(1));
        let room = Room {
            period: managed.nominal.map(|nominal| (nominal, nominal)),
            ways: vec![if managed.rigid { 0 } else { ordered }],
            budget: managed.anytime.map(|anytime| (anytime.most, anytime.most)),
            active: true,
            may_suspend: false,
            give: 0.0,
            importance,
        };
        if managed.rigid {
            return room;
        }
        Room {
            period: managed.nominal.map(|nominal| periods(managed, nominal)),
            ways: ways(managed, ordered),
            budget: managed.anytime.map(|anytime| (anytime.most, anytime.least.min(anytime.most))),
            active: managed.orders.active,
            may_suspend: managed.may_suspend && managed.orders.active,
            give: sound(managed.elasticity).max(0.0) / importance,
            ..room
        }
    }

    /// As it is ordered.
    pub(super) fn most(&self) -> Setting {
        Setting {
            period: self.period.map(|(from, _)| from),
            method: self.ways[0],
            budget: self.budget.map(|(most, _)| most),
            active: self.active,
        }
    }

    /// When it has given all.
    pub(super) fn least(&self) -> Setting {
        Setting {
            period: self.longest(),
            method: self.ways[self.ways.len() - 1],
            budget: self.budget.map(|(_, least)| least),
            active: self.active && !self.may_suspend,
        }
    }

    /// Its longest period.
    pub(super) fn longest(&self) -> Option<Exact> {
        self.period.map(|(from, to)| if self.give > 0.0 { to } else { from })
    }

    /// When it has given all but its life, and there is nothing left to be given.
    pub(super) fn at_least(&self) -> Room {
        let setting = self.least();
        Room { active: self.active, ..self.fixed_at(setting) }
    }

    /// When nothing but its period may be asked of it.
    pub(super) fn of_period_alone(&self) -> Room {
        let fixed = self.fixed_at(self.most());
        Room { period: self.period, give: self.give, ..fixed }
    }

    /// When it need not give anything.
    pub(super) fn at_most(&self) -> Room {
        self.fixed_at(self.most())
    }

    fn fixed_at(&self, setting: Setting) -> Room {
        Room {
            period: setting.period.map(|period| (period, period)),
            ways: vec![setting.method],
            budget: setting.budget.map(|budget| (budget, budget)),
            active: setting.active,
            may_suspend: false,
            give: 0.0,
            importance: self.importance,
        }
    }
}

/// From the period of the ordered rate to the longest.
fn periods(managed: &Managed, nominal: Exact) -> (Exact, Exact) {
    let longest = managed.longest.map_or(nominal, |longest| longest.floor().max(nominal));
    let rate = sound(managed.orders.rate);
    let ordered =
        if rate >= 1.0 { nominal } else { rounded_up(crate::exact::near(nominal) / rate.max(1e-6)) };
    (ordered.clamp(nominal, longest), longest)
}

/// The ordered method and those behind it that are cheaper than all before.
fn ways(managed: &Managed, ordered: usize) -> Vec<usize> {
    let mut ways = vec![ordered];
    for (at, way) in managed.methods.iter().enumerate().skip(ordered + 1) {
        if way.cost < managed.methods[ways[ways.len() - 1]].cost {
            ways.push(at);
        }
    }
    ways
}

/// From this on times are told in whole microseconds: to a thousandth, or less.
const LONG: f64 = 1e6;

/// A time in whole nanoseconds, or microseconds where it is long, so that all times keep a small common denominator; no less than it is.
pub(super) fn rounded_up(time: f64) -> Exact {
    let grain = grain(time);
    // What was reckoned a hair above a whole number is that number.
    Exact::from_integer((time / grain - 1e-9).ceil() as i128) * whole(grain)
}

/// The same, no more than it is.
pub(super) fn rounded_down(time: f64) -> Exact {
    let grain = grain(time);
    Exact::from_integer((time / grain + 1e-9).floor() as i128) * whole(grain)
}

fn grain(time: f64) -> f64 {
    if time >= LONG { 1e3 } else { 1.0 }
}

fn whole(grain: f64) -> Exact {
    if grain > 1.0 { Exact::from_integer(1000) } else { Exact::one() }
}

fn sound(number: f64) -> f64 {
    if number.is_finite() { number } else { 0.0 }
}
