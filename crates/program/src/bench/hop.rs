//! A message of 64 bytes from a source over three agents to a sink.
//!
//! All stand on one executor of a system in simulated time, where mailboxes, routes and steps are those of the wall clock and
//! nothing sleeps. A hop is timed from the source's step to the sink's; an iteration is what the host needs for one whole round,
//! with the release, the sweep over the agents and their statistics.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use runtime::{
    Agent, AgentType, Declare as _, Fault, Input, Options, Output, Plan, Registry, Simulation, Step,
};
use types::{Duration, Message};

use super::peers::{self, Peers};
use super::{Measured, Outcome};
use crate::error::Failure;
use crate::terminal::host_now;

/// Iterations of one run, and runs.
const ITERATIONS: i64 = 100_000;
const RUNS: usize = 5;

/// A message of 64 bytes.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
pub(super) struct Parcel {
    /// When it was sent, on the host's clock (ns since the start of the run).
    pub(super) sent: u64,
    /// Whatever fills it up.
    pub(super) load: [u64; 7],
}

/// Where the sink puts what it measured. The rows are made before the run.
pub(super) type Spans = Arc<Mutex<Vec<f64>>>;

/// Sends a parcel each time.
#[derive(Agent)]
pub(super) struct Source {
    /// The parcel.
    out: Output<Parcel>,
    begun: Option<Instant>,
}

impl Agent for Source {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        let sent = self.begun.map_or(0, |begun| (host_now() - begun).as_nanos() as u64);
        self.out.send(Parcel { sent, ..Parcel::default() });
        Ok(())
    }
}

/// Hands a parcel on.
#[derive(Agent)]
struct Hand {
    /// What comes.
    take: Input<Parcel>,
    /// What goes.
    give: Output<Parcel>,
}

impl Agent for Hand {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while let Some(parcel) = self.take.take() {
            self.give.send(*parcel);
        }
        Ok(())
    }
}

/// Takes parcels and says how long they were under way.
#[derive(Agent)]
pub(super) struct Sink {
    /// What comes.
    take: Input<Parcel>,
    begun: Option<Instant>,
    spans: Spans,
}

impl Agent for Sink {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while let Some(parcel) = self.take.take() {
            let now = self.begun.map_or(0, |begun| (host_now() - begun).as_nanos() as u64);
            let mut spans = self.spans.lock().unwrap_or_else(PoisonError::into_inner);
            if spans.len() < spans.capacity() {
                spans.push(now.saturating_sub(parcel.sent) as f64);
            }
        }
        Ok(())
    }
}

/// The types of a run, which share a clock and a place for what is measured.
pub(super) fn types(room: usize) -> (Registry, Spans) {
    let spans: Spans = Arc::new(Mutex::new(Vec::with_capacity(room)));
    let begun = host_now();
    let sink = spans.clone();
    let registry = Registry::new([
        AgentType::made_by(move |params| Source { begun: Some(begun), ..Source::build(params) })
            .named("source"),
        AgentType::of::<Hand>().named("hand"),
        AgentType::made_by(move |params| Sink {
            begun: Some(begun),
            spans: sink.clone(),
            ..Sink::build(params)
        })
        .named("sink"),
    ]);
    (registry, spans)
}

/// What a run measured.
pub(super) fn taken(spans: &Spans) -> Vec<f64> {
    std::mem::take(&mut *spans.lock().unwrap_or_else(PoisonError::into_inner))
}

fn plan() -> Plan {
    let mut plan = Plan::new("hop");
    let source = plan.add::<Source>("source", Default::default());
    let hands = ["first", "second", "third"].map(|name| plan.add::<Hand>(name, Default::default()));
    let sink = plan.add::<Sink>("sink", Default::default());
    plan.wire(&source.out, &hands[0].take);
    plan.wire(&hands[0].give, &hands[1].take);
    plan.wire(&hands[1].give, &hands[2].take);
    plan.wire(&hands[2].give, &sink.take);
    plan.every("source", Duration::millis(1));
    for agent in &mut plan.agents {
        agent.executor = Some("reflex".into());
        if agent.name != "source" {
            agent.on.push("take".into());
        }
    }
    plan
}

pub(super) fn measure() -> Result<Outcome, Failure> {
    let (mut hops, mut iterations) = (Vec::new(), Vec::new());
    let mut copper = Peers::find().map(Copper::new);
    for _ in 0..RUNS {
        let (registry, spans) = types(ITERATIONS as usize + 1);
        let options = Options { limit: Some(Duration::millis(ITERATIONS)), ..Options::default() };
        let report = Simulation::new(&plan(), &registry, options).and_then(Simulation::run);
        let report = report.map_err(|error| Failure::new(error.to_string()).code(1))?;
        iterations.push(report.wall * 1e9 / ITERATIONS as f64);
        hops.extend(taken(&spans));
        if let Some(copper) = &mut copper {
            copper.round();
        }
    }
    let mut outcome = Outcome {
        figures: vec![Measured::new("hop", "ns", hops), Measured::new("iteration", "ns", iterations.clone())],
        missing: vec!["hop_logged/copper_logged", "fanout64/rtrb"],
        ..Outcome::default()
    };
    match copper {
        Some(copper) => copper.beside(&iterations, &mut outcome),
        None => outcome.missing.push("hop/copper"),
    }
    Ok(outcome)
}

/// Copper's rounds, each right after one of ours.
struct Copper {
    peers: Peers,
    hops: Vec<f64>,
    iterations: Vec<f64>,
    failure: Option<Failure>,
}

impl Copper {
    fn new(peers: Peers) -> Copper {
        Copper { peers, hops: Vec::new(), iterations: Vec::new(), failure: None }
    }

    /// One round; after the first failure there are no more.
    fn round(&mut self) {
        if self.failure.is_none() {
            self.failure = self.measure().err();
        }
    }

    fn measure(&mut self) -> Result<(), Failure> {
        let mut figures = self.peers.measure("hop", &["--iterations", &ITERATIONS.to_string()])?;
        let means = peers::take(&mut figures, "iteration", "ns")?;
        self.iterations.push(means.iter().sum::<f64>() / means.len() as f64);
        self.hops.extend(peers::take(&mut figures, "hop", "ns")?);
        Ok(())
    }

    /// Adds its figures, and the ratio of what an iteration takes.
    fn beside(self, ours: &[f64], outcome: &mut Outcome) {
        match self.failure {
            Some(failure) => outcome.failed.push(("hop/copper", failure)),
            None => {
                outcome.compare(
                    "hop/copper",
                    ours.iter().copied().zip(self.iterations.iter().copied()).collect(),
                );
                outcome.figures.push(Measured::new("hop_copper", "ns", self.hops));
                outcome.figures.push(Measured::new("iteration_copper", "ns", self.iterations));
            }
        }
    }
}
