//! A thread that asks for real time, in the way in which every executor does.

use runtime::{Agent, Fault, Live, Options, Plan, Step, registry};
use types::Duration;

/// Does nothing, in real time.
#[derive(Agent)]
struct Probe {}

impl Agent for Probe {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        Ok(())
    }
}

/// What an executor of priority 70 is granted here: `fifo 70`, or why not.
pub(super) fn granted() -> String {
    let mut plan = Plan::new("doctor");
    let _ports = plan.add::<Probe>("probe", Default::default());
    plan.every("probe", Duration::millis(5));
    if let Some(probe) = plan.agent_mut("probe") {
        probe.executor = Some("reflex".to_owned());
    }
    let options = Options { limit: Some(Duration::millis(20)), ..Options::default() };
    let report = Live::new(&plan, &registry![Probe], options).and_then(Live::run);
    match report {
        Ok(report) => report.view.agents.first().map_or_else(String::new, |probe| probe.granted.clone()),
        Err(error) => format!("nothing: {error}"),
    }
}
