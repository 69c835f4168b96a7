//! A system in which agents run as they are set.

use num_traits::Zero;

use crate::Exact;
use crate::manage::{Managed, Setting};
use crate::system::{Agent, Source, System};

/// The system with the managed agents as they are set; `system` has nominal timings.
///
/// A longer period is that of the clock, and of the deadline where this is the period; of an agent that has no clock it is the least gap between
/// two steps. Who is suspended needs nothing and makes nobody run.
pub fn apply(system: &System, managed: &[Managed], settings: &[Setting]) -> System {
    let mut system = system.clone();
    let mut asleep = Vec::new();
    for (at, (managed, setting)) in managed.iter().zip(settings).enumerate() {
        let Some(agent) = system.agents.get_mut(at).filter(|_| !managed.rigid) else { continue };
        if !setting.active {
            agent.cost = Exact::zero();
            agent.sources.clear();
            asleep.push(at);
            continue;
        }
        agent.cost = cost(managed, setting, agent.cost);
        if let Some(period) = setting.period.filter(|period| managed.nominal.is_some_and(|it| *period > it)) {
            slow_down(agent, period);
        }
    }
    if !asleep.is_empty() {
        let is_awake = |source: &Source| source.agent().is_none_or(|from| !asleep.contains(&from));
        system.agents.iter_mut().for_each(|agent| agent.sources.retain(is_awake));
    }
    system
}

/// Processor time of a step at worst, in nanoseconds, of an agent that is set so; `usual` where it has one method only.
pub(super) fn cost(managed: &Managed, setting: &Setting, usual: Exact) -> Exact {
    let whole = managed.methods.get(setting.method).map_or(usual, |way| way.cost);
    match (managed.anytime, setting.budget) {
        // The mandatory part stays, whatever was measured of the whole.
        (Some(anytime), Some(budget)) if budget < anytime.most => {
            (whole - (anytime.most - budget)).max(anytime.least.min(whole))
        }
        _ => whole,
    }
}

fn slow_down(agent: &mut Agent, period: Exact) {
    let mut has_clock = false;
    let mut keeps_pace = false;
    for source in &mut agent.sources {
        if let Source::Clock { period: nominal } = source {
            has_clock = true;
            keeps_pace |= *nominal == agent.deadline;
            *nominal = period;
        }
    }
    if keeps_pace {
        agent.deadline = period;
    }
    if !has_clock {
        agent.least_gap = agent.least_gap.max(period);
    }
}
