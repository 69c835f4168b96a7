//! A thread that asks for real time, in the way in which every executor does.

use std::sync::{Arc, Mutex, PoisonError};

use runtime::{
    Agent, AgentType, CannotRun, Fault, Live, Options, Plan, Registry, Report, Step, processor_time, registry,
};
use types::Duration;

/// Does nothing, in real time, but to look how long its thread has had a processor.
#[derive(Agent)]
struct Probe {
    looks: Option<Arc<Mutex<Vec<Duration>>>>,
}

impl Agent for Probe {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        if let Some(looks) = &self.looks {
            looks.lock().unwrap_or_else(PoisonError::into_inner).push(processor_time());
        }
        Ok(())
    }
}

/// What the runtime needs of a processor around a step: waking, choosing, counting, going to sleep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Overhead {
    /// Of half of the steps at most: what admission counts with. What is above it is mostly not the runtime's.
    pub(crate) median: Duration,
    /// Of all but one in a hundred.
    pub(crate) most: Duration,
}

fn run(registry: &Registry, period: Duration, limit: Duration) -> Result<Report, CannotRun> {
    let mut plan = Plan::new("doctor");
    let _ports = plan.add::<Probe>("probe", Default::default());
    plan.every("probe", period);
    if let Some(probe) = plan.agent_mut("probe") {
        probe.executor = Some("reflex".to_owned());
    }
    let options = Options { limit: Some(limit), ..Options::default() };
    Live::new(&plan, registry, options).and_then(Live::run)
}

/// What an executor of priority 70 is granted here: `fifo 70`, or why not.
pub(super) fn granted() -> String {
    match run(&registry![Probe], Duration::millis(5), Duration::millis(20)) {
        Ok(report) => report.view.agents.first().map_or_else(String::new, |probe| probe.granted.clone()),
        Err(error) => format!("nothing: {error}"),
    }
}

/// Measures it on this machine, with a thread of priority 70 that is released two hundred times, each time out of its sleep.
pub(crate) fn overhead() -> Option<Overhead> {
    let looks = Arc::new(Mutex::new(Vec::with_capacity(300)));
    let shared = looks.clone();
    let kind = AgentType::made_by(move |_| Probe { looks: Some(shared.clone()) });
    run(&Registry::new([kind]), Duration::millis(1), Duration::millis(200)).ok()?;
    let looks = looks.lock().unwrap_or_else(PoisonError::into_inner);
    // The first steps find everything cold.
    let mut took: Vec<Duration> = looks.windows(2).skip(10).map(|pair| pair[1] - pair[0]).collect();
    took.sort_unstable();
    let at = |share: f64| {
        took.get(((took.len() as f64 * share) as usize).min(took.len().saturating_sub(1))).copied()
    };
    Some(Overhead { median: at(0.5)?, most: at(0.99)? })
}
