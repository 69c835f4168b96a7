//! Messages between agents of one executor of the wall clock, an ordinary thread on one processor, as what it is measured beside.
//!
//! | to find | look in |
//! |---|---|
//! | source, three agents, sink: one lap after the other, and paced | [`lap`] |
//! | the same with a log, at a given rate | [`logged`] |
//! | one message to 64 receivers | [`fanout`] |
//! | a large message beside a small one | [`picture`] |
//! | a source, eight agents and eight sinks, with a log | [`caterpillar`] |
//! | what these share: agents, runs with a log | [`chain`], [`recorded`] |
//! | how whole iterations are timed, and set beside copper's | [`iteration`], [`beside`] |

mod beside;
mod caterpillar;
mod chain;
mod fanout;
mod iteration;
mod lap;
mod logged;
mod picture;
mod recorded;

use runtime::{ExecutorPlan, Plan};

use super::Setting;
use super::outcome::Outcome;
use crate::error::Failure;

/// The processor, for both sides.
const CPU: usize = 0;

pub(super) fn measure(setting: &Setting<'_>) -> Result<Outcome, Failure> {
    let mut outcome = Outcome::default();
    lap::measure(setting, &mut outcome)?;
    lap::paced(setting, &mut outcome)?;
    logged::measure(setting, &mut outcome)?;
    fanout::measure(setting, &mut outcome)?;
    picture::measure(setting, &mut outcome)?;
    caterpillar::measure(setting, &mut outcome)?;
    Ok(outcome)
}

/// Puts all agents of a plan on one executor, an ordinary thread on one processor.
fn on_one_executor(plan: &mut Plan) {
    plan.executors.push(ExecutorPlan { cpus: vec![CPU], ..ExecutorPlan::new("one", None) });
    for agent in &mut plan.agents {
        agent.executor = Some("one".into());
    }
}
