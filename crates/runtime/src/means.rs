//! How an agent may do its step: by one of several methods, and for how long it may refine what it has.
//!
//! ```text
//!   released ──▶ mandatory part ──▶ may it refine? ──yes──▶ one refinement ─┐
//!                                        │    ▲                             │
//!                                        no   └─────────────────────────────┘
//!                                        ▼
//!                                  the result, with its quality
//! ```

use types::header::Quality;
use types::{Duration, Time};

use crate::agent::AgentType;
use crate::os;
use crate::plan::AgentPlan;
use crate::processor::scaled;
use crate::request::Refusal;

/// One of several ways in which an agent can do its step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Method {
    /// What it is called.
    pub name: &'static str,
    /// How good its result is, from 0 to 1 for the best that the agent can do.
    pub quality: f64,
}

/// What a step may use, as the plan and the resource manager say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Means {
    /// Which of the agent's methods.
    pub method: u8,
    /// How good that is.
    pub quality: Quality,
    /// How long a step with refinements may take; zero where there are none.
    pub budget: Duration,
    /// What the step takes without refinements at worst, as its plan declares.
    pub cost: Duration,
    /// What one refinement takes at worst, as its plan declares.
    pub refinement: Duration,
    /// Whether it runs at all.
    pub is_active: bool,
    /// Whether on the wall clock, too, a step takes what is declared for it.
    pub fills: bool,
}

impl Means {
    /// The one method, without refinements, of a step that costs nothing.
    pub(crate) const PLAIN: Means = Means {
        method: 0,
        quality: Quality::FULL,
        budget: Duration::ZERO,
        cost: Duration::ZERO,
        refinement: Duration::ZERO,
        is_active: true,
        fills: false,
    };

    /// Whether a step needs nothing to be told.
    #[inline(always)]
    pub(crate) fn is_plain(&self) -> bool {
        self.budget == Duration::ZERO && self.quality == Quality::FULL && self.method == 0 && !self.fills
    }

    /// What a plan gives an agent of this type, or all that is against it.
    pub(crate) fn of(plan: &AgentPlan, kind: &AgentType) -> Result<Means, Vec<Refusal>> {
        let mut against = Vec::new();
        let method = plan.method.as_deref().map_or(0, |name| place_of(name, plan, kind, &mut against));
        for (name, cost) in &plan.methods {
            place_of(name, plan, kind, &mut against);
            against.extend(not_negative(&format!("cost of method \"{name}\""), *cost, plan));
        }
        against.extend(refine(plan, kind));
        against.extend(giving(plan));
        if !against.is_empty() {
            return Err(against);
        }
        let quality = kind.methods.get(method).map_or(Quality::FULL, |method| Quality::of(method.quality));
        let is_active = !plan.giving.is_suspended;
        let budget = plan.budget.unwrap_or(Duration::ZERO);
        let cost = plan.cost_of_step(kind.methods).unwrap_or(Duration::ZERO);
        let refinement = plan.refinement.unwrap_or(Duration::ZERO);
        Ok(Means { method: method as u8, quality, budget, cost, refinement, is_active, fills: false })
    }
}

fn place_of(name: &str, plan: &AgentPlan, kind: &AgentType, against: &mut Vec<Refusal>) -> usize {
    let place = kind.methods.iter().position(|method| method.name == name);
    if place.is_none() {
        against.push(if kind.methods.is_empty() {
            Refusal::new(format!("a \"{}\" has no methods, but {} names \"{name}\"", kind.kind, plan.name))
        } else {
            let known = kind.methods.iter().map(|method| method.name);
            Refusal::unknown(&format!("method of {}", plan.name), name, known)
        });
    }
    place.unwrap_or(0)
}

fn not_negative(what: &str, span: Duration, plan: &AgentPlan) -> Option<Refusal> {
    let refusal = || Refusal::new(format!("the {what} of {} is {span}; no step gives time back", plan.name));
    (span < Duration::ZERO).then(refusal)
}

fn refine(plan: &AgentPlan, kind: &AgentType) -> Vec<Refusal> {
    let name = &plan.name;
    let mut against = Vec::new();
    if !kind.is_anytime {
        for (key, said) in [("budget", plan.budget), ("refinement", plan.refinement)] {
            if said.is_some() {
                against.push(
                    Refusal::new(format!("{name} has a {key}, and a \"{}\" does not refine", kind.kind))
                        .help("only anytime agents do"),
                );
            }
        }
        return against;
    }
    if plan.budget.is_some() && plan.refinement.is_none_or(|cost| cost <= Duration::ZERO) {
        against.push(
            Refusal::new(format!("{name} has a budget for refinements, and does not say what one takes"))
                .help("write refinement = \"500us\", say: what one takes at worst"),
        );
    }
    if let Some(budget) = plan.budget.filter(|budget| *budget <= Duration::ZERO) {
        against.push(Refusal::new(format!("the budget of {name} must be longer than zero, not {budget}")));
    }
    against
}

fn giving(plan: &AgentPlan) -> Vec<Refusal> {
    let (name, giving) = (&plan.name, &plan.giving);
    let mut against = Vec::new();
    if !(0.0..=1.0).contains(&giving.importance()) {
        let what = format!("the importance of {name} must lie from 0 to 1, not {}", giving.importance());
        against.push(Refusal::new(what));
    }
    if !giving.elasticity().is_finite() || giving.elasticity() < 0.0 {
        let what = format!("the elasticity of {name} must be 0 or greater, not {}", giving.elasticity());
        against.push(Refusal::new(what));
    }
    if let Some(most) = giving.gap_max {
        if plan.on.is_empty() {
            against.push(
                Refusal::new(format!("{name} has \"gap_max\", and no messages make it run"))
                    .help("its period gives way up to \"period_max\""),
            );
        }
        if most < plan.min_gap || most <= Duration::ZERO {
            let what = format!("the gap_max of {name} is {most}, less than its min_gap {}", plan.min_gap);
            against.push(Refusal::new(what));
        }
    }
    against
}

/// What is left of a step for refinements.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Refining {
    /// How long the step may take (ns); zero where it may not refine.
    limit: u64,
    /// When the step began, in ticks of the processor; zero in simulated time.
    begun: u64,
    /// Nanoseconds in a tick, as [`scaled`] takes it.
    rate: u64,
    /// Up to where the step has come, as it was asked last (ns), and the longest of its refinements: what the plan says, before the first.
    used: u64,
    longest: u64,
    /// How many refinements were begun.
    pub count: u32,
}

impl Refining {
    /// None.
    pub(crate) const NONE: Refining = Refining { limit: 0, begun: 0, rate: 0, used: 0, longest: 0, count: 0 };

    /// For a step that begins at `now` and must be done by `deadline`. `clock` are the ticks of the processor at its beginning, and
    /// nanoseconds in a tick; in simulated time nothing.
    pub(crate) fn of(means: &Means, now: Time, deadline: Time, clock: Option<(u64, u64)>) -> Refining {
        let nanos = |span: Duration| span.0.max(0) as u64;
        let limit = nanos(means.budget.min(deadline - now));
        let (begun, rate) = clock.unwrap_or((0, 0));
        let used = if clock.is_some() { 0 } else { nanos(means.cost) };
        Refining { limit, begun, rate, used, longest: nanos(means.refinement), count: 0 }
    }

    pub(crate) fn may_go_on(&mut self) -> bool {
        if self.limit == 0 {
            return false;
        }
        if self.rate > 0 {
            let used = scaled(os::ticks().saturating_sub(self.begun), self.rate);
            if self.count > 0 {
                self.longest = self.longest.max(used - self.used.min(used));
            }
            self.used = used;
        } else if self.count > 0 {
            self.used += self.longest;
        }
        // In simulated time one that takes none would go on for ever.
        let goes_on = self.used + self.longest <= self.limit && (self.rate > 0 || self.longest > 0);
        self.count += u32::from(goes_on);
        goes_on
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refinements(budget: i64, cost: i64, refinement: i64, deadline: i64) -> u32 {
        let [budget, cost, refinement] = [budget, cost, refinement].map(Duration::millis);
        let means = Means { budget, cost, refinement, ..Means::PLAIN };
        let mut refining = Refining::of(&means, Time::ZERO, Time::ZERO + Duration::millis(deadline), None);
        while refining.may_go_on() {}
        refining.count
    }

    #[test]
    fn in_simulated_time_as_many_fit_as_the_plan_says() {
        assert_eq!(refinements(10, 2, 3, 100), 2, "2 + 3 + 3 = 8, and 11 is too much");
        assert_eq!(refinements(11, 2, 3, 100), 3, "exactly the budget");
        assert_eq!(refinements(10, 2, 3, 6), 1, "the deadline comes before the end of the budget");
        assert_eq!(refinements(0, 2, 3, 100), 0, "without a budget");
        assert_eq!(refinements(2, 5, 3, 100), 0, "what must be done has used it up");
        assert_eq!(refinements(10, 2, 0, 100), 0, "what takes no time never ends");
    }

    #[test]
    fn on_the_wall_clock_it_ends_when_the_time_is_used() {
        let means = Means { budget: Duration::millis(2), ..Means::PLAIN };
        let rate = crate::processor::rate(os::nanos_per_tick());
        let mut refining = Refining::of(&means, Time::ZERO, Time::NEVER, Some((os::ticks(), rate)));
        while refining.may_go_on() {}
        assert!(refining.used + refining.longest > 2_000_000, "{refining:?}");
        assert!(refining.count > 0);
        let late = Some((os::ticks() - (4e6 / os::nanos_per_tick()) as u64, rate));
        assert!(!Refining::of(&means, Time::ZERO, Time::NEVER, late).may_go_on(), "it is used up");
    }
}
