//! How much of what the agents were to do they did: in time, and how well.

use runtime::{AgentPlan, AgentView, Assumed, timetable};
use schedule::manage::{Work, useful_work};
use types::Duration;

use super::prepare::Ready;

/// What an agent did of what it was to do.
#[derive(Clone, Debug)]
pub(crate) struct Done {
    pub(crate) name: String,
    pub(crate) work: Work,
    pub(crate) missed: u64,
}

impl Done {
    /// The share of its work that was useful, from 0 to 1.
    pub(crate) fn share(&self) -> f64 {
        useful_work(&[Work { importance: 1.0, ..self.work }])
    }
}

/// The agents whose plan says how important they are, in its order, with what they did in so long.
pub(crate) fn done(ready: &Ready, agents: &[AgentView], time: Duration) -> Vec<Done> {
    let pace = |port: &str| ready.pace(port);
    let cost = |agent: &AgentPlan| agent.cost.unwrap_or(Duration::ZERO);
    let assumed = Assumed { cost: &cost, processors: 1, overhead: Duration::ZERO, pace: &pace };
    let table = timetable(&ready.plan, &ready.registry, &assumed);
    let Ok(found) = table.system.analyse() else { return Vec::new() };
    let told = ready.plan.agents.iter().zip(found).filter_map(|(plan, found)| {
        let importance = plan.giving.importance?;
        let view = agents.iter().find(|agent| agent.name == plan.name)?;
        let rate = |period: schedule::Exact| *period.denom() as f64 / *period.numer() as f64;
        // What a message makes one with a period run besides is not what it was to do.
        let is_periodic = plan.period.is_some();
        let counts = |stream: &&schedule::system::Stream| !is_periodic || stream.after.is_none();
        let rates: f64 = found.streams.iter().filter(counts).map(|stream| rate(stream.period)).sum();
        let steps = view.counts.releases as f64;
        let work = Work {
            importance,
            nominal: (rates * time.0 as f64).floor(),
            in_time: steps - view.counts.missed as f64,
            quality: if steps > 0.0 { 1.0 - view.counts.quality_lost / steps } else { 0.0 },
        };
        Some(Done { name: plan.name.clone(), work, missed: view.counts.missed })
    });
    told.collect()
}

/// The share of all that was useful, each by its importance; nothing where no plan says how important anybody is.
pub(crate) fn useful(done: &[Done]) -> Option<f64> {
    let works: Vec<Work> = done.iter().map(|done| done.work).collect();
    (!works.is_empty()).then(|| useful_work(&works))
}
