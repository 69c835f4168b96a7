//! From sending to the step of an agent whose executor slept; beside it a bare wake of a futex with the same priority on the
//! same processors.

use runtime::{Agent, AgentType, Declare as _, ExecutorPlan, Fault, Input, Output, Plan, Registry, Step};
use types::Duration;

use super::PRIORITY;
use crate::bench::Setting;
use crate::bench::outcome::{Outcome, median};
use crate::bench::parcel::{self, Parcel, Shelf, live, now, room};
use crate::bench::turns::Turns;
use crate::error::Failure;

/// How often a message is sent.
const PERIOD: Duration = Duration::millis(1);
/// Messages of a round, and rounds.
const WAKES: usize = 1000;
const ROUNDS: usize = 5;
/// Messages before anything is kept.
const WARM_UP: u64 = 20;

/// Sends a parcel each time.
#[derive(Agent)]
struct Source {
    /// The parcel.
    out: Output<Parcel>,
    number: u64,
}

impl Agent for Source {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.number += 1;
        self.out.send(Parcel { sent: now(), number: self.number, ..Parcel::default() });
        Ok(())
    }
}

/// Takes parcels and says how long they were under way.
#[derive(Agent)]
struct Sink {
    /// What comes.
    take: Input<Parcel>,
    spans: Vec<f64>,
    shelf: Shelf,
}

impl Agent for Sink {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while let Some(parcel) = self.take.take() {
            let span = now().saturating_sub(parcel.sent);
            if parcel.number > WARM_UP {
                self.shelf.keep(&mut self.spans, span as f64);
            }
        }
        Ok(())
    }

    fn stop(&mut self, _: &mut Step) {
        self.shelf.put(&self.spans);
    }
}

/// Rounds of ours and of the bare futex, in turns.
pub(super) fn measure(
    setting: &Setting<'_>,
    outcome: &mut Outcome,
    name: &str,
    ratio: &'static str,
    cpus: (usize, usize),
) -> Result<(), Failure> {
    let wakes = setting.of(WAKES, 30);
    let mut turns = Turns::new(setting.peers.clone());
    let (mut ours, mut theirs, mut rounds) = (Vec::new(), Vec::new(), Vec::new());
    let args = [
        "--cpu".to_owned(),
        format!("{},{}", cpus.0, cpus.1),
        "--fifo".to_owned(),
        PRIORITY.to_string(),
        "--iterations".to_owned(),
        wakes.to_string(),
    ];
    for _ in 0..setting.of(ROUNDS, if setting.shorter > 100 { 1 } else { 3 }) {
        let own = system(cpus, wakes, outcome)?;
        let mut round = turns.round("futex", &args);
        let bare = turns.take(&mut round, "wake", "ns");
        if !bare.is_empty() {
            rounds.push((median(own.clone()), median(bare.clone())));
        }
        ours.extend(own);
        theirs.extend(bare);
    }
    outcome.figure(name, "ns", ours);
    outcome.figure(format!("{name}_futex"), "ns", theirs);
    turns.compare(outcome, ratio, rounds);
    Ok(())
}

/// A source and a sink on two executors. Gives how long each parcel was under way (ns).
fn system(cpus: (usize, usize), wakes: usize, outcome: &mut Outcome) -> Result<Vec<f64>, Failure> {
    let mut plan = Plan::new("wake");
    let source = plan.add::<Source>("source", Default::default());
    let sink = plan.add::<Sink>("sink", Default::default());
    plan.wire(&source.out, &sink.take);
    plan.every("source", PERIOD);
    plan.on("sink", "take");
    for (name, agent, cpu) in [("sends", "source", cpus.0), ("takes", "sink", cpus.1)] {
        plan.executors.push(ExecutorPlan { cpus: vec![cpu], ..ExecutorPlan::new(name, Some(PRIORITY)) });
        if let Some(agent) = plan.agent_mut(agent) {
            agent.executor = Some(name.into());
        }
    }
    let shelf = Shelf::default();
    let theirs = shelf.clone();
    let registry = Registry::new([
        AgentType::of::<Source>(),
        AgentType::made_by(move |params| Sink {
            spans: room(wakes),
            shelf: theirs.clone(),
            ..Sink::build(params)
        })
        .named("sink"),
    ]);
    let options = shelf.until_full(PERIOD * (wakes as i64 + WARM_UP as i64));
    parcel::run(live(&plan, &registry, options)?, outcome)?;
    Ok(shelf.take())
}
