//! When an agent runs, how, and for how long: what is set of that while it runs, by people or by the resource manager.

use types::Duration;
use types::value::Value;

use super::script::{Step, What};
use super::{Reply, Router, Staged, first, timing_as};
use crate::agent::AgentType;
use crate::census::Given;
use crate::executor::Change;
use crate::plan::AgentPlan;
use crate::request::Refusal;
use crate::stats::Window;

/// What can be set of any agent beside its parameters.
pub const TIMING_KEYS: [&str; 10] = [
    "period",
    "deadline",
    "min_gap",
    "wake_gap",
    "cost",
    "method",
    "refinement",
    "budget",
    "importance",
    "suspended",
];

/// What was asked for of that which the resource manager may set otherwise.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Nominal {
    period: Option<Duration>,
    min_gap: Duration,
    method: Option<String>,
    budget: Option<Duration>,
    is_suspended: bool,
}

impl Nominal {
    pub(super) fn of(plan: &AgentPlan) -> Nominal {
        Nominal {
            period: plan.period,
            min_gap: plan.min_gap,
            method: plan.method.clone(),
            budget: plan.budget,
            is_suspended: plan.giving.is_suspended,
        }
    }

    /// Puts it into a plan.
    pub(super) fn put(&self, plan: &mut AgentPlan) {
        (plan.period, plan.min_gap, plan.budget) = (self.period, self.min_gap, self.budget);
        plan.method.clone_from(&self.method);
        plan.giving.is_suspended = self.is_suspended;
    }

    /// The same with one entry of a plan.
    fn with(&mut self, key: &str, plan: &AgentPlan) {
        match key {
            "period" => self.period = plan.period,
            "min_gap" => self.min_gap = plan.min_gap,
            "method" => self.method.clone_from(&plan.method),
            "budget" => self.budget = plan.budget,
            "suspended" => self.is_suspended = plan.giving.is_suspended,
            _ => {}
        }
    }
}

fn span(key: &str, value: &Value) -> Reply<Duration> {
    let text = value
        .as_text()
        .ok_or_else(|| Refusal::new(format!("{key} must be a time such as \"250ms\", not {value}")))?;
    text.parse().map_err(|error| Refusal::new(format!("{key} is \"{text}\": {error}")))
}

fn put(plan: &mut AgentPlan, key: &str, value: &Value) -> Reply<()> {
    match key {
        "period" => plan.period = Some(span(key, value)?),
        "deadline" => plan.deadline = Some(span(key, value)?),
        "cost" => plan.cost = Some(span(key, value)?),
        "refinement" => plan.refinement = Some(span(key, value)?),
        "budget" => plan.budget = Some(span(key, value)?),
        "min_gap" => plan.min_gap = span(key, value)?,
        "wake_gap" => plan.wake_gap = span(key, value)?,
        "method" => {
            let name = value.as_text();
            let refusal = || Refusal::new(format!("method must be the name of one, not {value}"));
            plan.method = Some(name.ok_or_else(refusal)?.to_owned());
        }
        "importance" => {
            let number = value.as_float();
            let refusal = || Refusal::new(format!("importance must be a number from 0 to 1, not {value}"));
            plan.giving.importance = Some(number.ok_or_else(refusal)?);
        }
        _ => {
            let refusal = || Refusal::new(format!("suspended must be true or false, not {value}"));
            let Value::Bool(suspended) = value else { return Err(refusal()) };
            plan.giving.is_suspended = *suspended;
        }
    }
    Ok(())
}

/// Keeps a period within what its designer allows.
fn check_range(plan: &AgentPlan) -> Reply<()> {
    match (plan.period, plan.period_range) {
        (Some(period), Some((least, most))) if !(least..=most).contains(&period) => Err(Refusal::new(
            format!("the period of {} must lie from {least} to {most}, not {period}", plan.name),
        )),
        _ => Ok(()),
    }
}

/// An agent of a plan as it is when a parameter, or an entry of [`TIMING_KEYS`], was set: what can be seen of a request before a system runs.
/// Nothing is said of an agent with which something is wrong already.
///
/// # Errors
/// Why it would be refused.
pub fn with_set(agent: &AgentPlan, kind: &AgentType, key: &str, value: &Value) -> Result<AgentPlan, Refusal> {
    let mut plan = agent.clone();
    if TIMING_KEYS.contains(&key) {
        put(&mut plan, key, value)?;
        if timing_as(agent, kind).is_ok() {
            timing_as(&plan, kind)?;
            check_range(&plan)?;
        }
        return Ok(plan);
    }
    if let Ok((_, mut params)) = kind.read_params(&agent.params) {
        params.set(key, value.clone());
        plan.params = kind.read_params(&params).map_err(first)?.1;
    }
    Ok(plan)
}

impl Router {
    pub(super) fn set_timing(
        &mut self,
        id: types::AgentId,
        key: &str,
        value: &Value,
        staged: &mut Staged,
    ) -> Reply<()> {
        let mut plan = self.agents[&id].plan.clone();
        put(&mut plan, key, value)?;
        if key == "suspended" && plan.giving.is_suspended && self.robots.contains(&plan.name) {
            let what =
                format!("\"{}\" is a robot, and the gate in front of it is never suspended", plan.name);
            return Err(Refusal::new(what));
        }
        let mut nominal = self.agents[&id].nominal.clone();
        nominal.with(key, &plan);
        self.stage_timing(id, plan, staged)?;
        self.of_mut(id, |known| known.nominal = nominal);
        Ok(())
    }

    /// Sets what the resource manager says; what was asked for stays known.
    pub(super) fn set_given(&mut self, given: &Given, staged: &mut Staged) -> Reply<()> {
        let id = self.id_of(&given.agent)?;
        let mut plan = self.agents[&id].plan.clone();
        plan.period = given.period.or(plan.period);
        plan.min_gap = given.gap.unwrap_or(plan.min_gap);
        plan.budget = given.budget.or(plan.budget);
        plan.giving.is_suspended = given.is_suspended;
        if let Some(method) = given.method {
            plan.method = Some(method.to_owned());
        }
        self.stage_timing(id, plan, staged)
    }

    fn stage_timing(&mut self, id: types::AgentId, plan: AgentPlan, staged: &mut Staged) -> Reply<()> {
        let known = &self.agents[&id];
        check_range(&plan)?;
        let timing = self.timing_for(&plan, &known.kind)?;
        self.check_budget(&plan, &timing, known.executor)?;
        let change = Change::Timing { slot: known.slot, timing };
        let step = Step { executor: known.executor, of: id, ring: None, what: What::Change(change) };
        let is_other_work = timing.means.method != known.timing.means.method;
        staged.step(step);
        self.alter(id, staged, move |known| {
            (known.plan, known.timing, known.admitted) = (plan, timing, None);
            if is_other_work {
                // What steps took until now says nothing of it.
                known.window = Window::of(&known.stats);
                known.long_window = Window::of(&known.stats);
            }
        });
        Ok(())
    }
}
