//! A message of 64 bytes from a source over three agents to a sink, and from there back to the source, which sends the next one then.
//!
//! All stand on one executor of the wall clock, an ordinary thread on one processor, as what it is measured beside. An iteration is a whole
//! lap, five steps and five messages, each released, timed and counted as always; a hop is timed from the source's step to the sink's.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use runtime::{
    Agent, AgentType, Declare as _, ExecutorPlan, Fault, Incident, Input, Live, Observer, Options, Output,
    Plan, Registry, Step, Verdict,
};
use types::{Duration, Message, Time};

use super::peers::{self, Peers};
use super::{Measured, Outcome};
use crate::error::Failure;
use crate::terminal::host_now;

/// Iterations of one run, and runs.
const ITERATIONS: i64 = 100_000;
const RUNS: usize = 5;
/// The processor, for both sides.
const CPU: usize = 0;

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

/// What the two ends of the laps share.
#[derive(Debug)]
struct Laps {
    begun: Instant,
    /// From the first lap to the last (ns).
    whole: AtomicU64,
    over: AtomicBool,
    /// Whether each parcel says when it was sent: to look at the clock is part of a lap then.
    stamps: bool,
}

/// Sends a parcel, and the next one when that is back.
#[derive(Agent)]
struct Starter {
    /// What is back.
    again: Input<Parcel>,
    /// What goes.
    out: Output<Parcel>,
    done: i64,
    first: u64,
    laps: Option<Arc<Laps>>,
}

impl Agent for Starter {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        let Some(laps) = &self.laps else { return Ok(()) };
        let now = || (host_now() - laps.begun).as_nanos() as u64;
        if self.again.take().is_some() {
            self.done += 1;
        } else {
            self.first = now();
        }
        if self.done == ITERATIONS {
            laps.whole.store(now() - self.first, Ordering::Relaxed);
            laps.over.store(true, Ordering::Release);
            return Ok(());
        }
        let sent = if laps.stamps { now() } else { 0 };
        self.out.send(Parcel { sent, ..Parcel::default() });
        Ok(())
    }
}

/// Takes the parcel, says how long it was under way, and gives it back.
#[derive(Agent)]
struct Finisher {
    /// What comes.
    take: Input<Parcel>,
    /// What goes back.
    give: Output<Parcel>,
    laps: Option<Arc<Laps>>,
    spans: Spans,
}

impl Agent for Finisher {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while let Some(parcel) = self.take.take() {
            if let Some(laps) = self.laps.as_ref().filter(|laps| laps.stamps) {
                let now = (host_now() - laps.begun).as_nanos() as u64;
                let mut spans = self.spans.lock().unwrap_or_else(PoisonError::into_inner);
                if spans.len() < spans.capacity() {
                    spans.push(now.saturating_sub(parcel.sent) as f64);
                }
            }
            self.give.send(Parcel::default());
        }
        Ok(())
    }
}

/// Ends the run when all laps are done.
struct Finish(Arc<Laps>);

impl Observer for Finish {
    fn every(&self) -> Duration {
        Duration::millis(1)
    }
    fn observe(&mut self, _: Time, _: &[Incident]) -> Verdict {
        if self.0.over.load(Ordering::Acquire) {
            return Verdict::End("all laps are done".into());
        }
        Verdict::GoOn
    }
}

/// All on one executor, on one processor.
fn plan() -> Plan {
    let mut plan = Plan::new("hop");
    let starter = plan.add::<Starter>("starter", Default::default());
    let hands = ["first", "second", "third"].map(|name| plan.add::<Hand>(name, Default::default()));
    let finisher = plan.add::<Finisher>("finisher", Default::default());
    plan.wire(&starter.out, &hands[0].take);
    plan.wire(&hands[0].give, &hands[1].take);
    plan.wire(&hands[1].give, &hands[2].take);
    plan.wire(&hands[2].give, &finisher.take);
    plan.wire(&finisher.give, &starter.again);
    // The clock begins the first lap; the others are begun by the parcel that is back.
    plan.every("starter", Duration::secs(3600));
    plan.executors.push(ExecutorPlan { cpus: vec![CPU], ..ExecutorPlan::new("lap", None) });
    for agent in &mut plan.agents {
        agent.executor = Some("lap".into());
        agent.on = vec![if agent.name == "starter" { "again" } else { "take" }.into()];
    }
    plan
}

/// Runs all laps. Gives the mean of one (ns), and how long each parcel was under way.
fn laps(stamps: bool) -> Result<(f64, Vec<f64>), Failure> {
    let laps =
        Arc::new(Laps { begun: host_now(), whole: AtomicU64::new(0), over: AtomicBool::new(false), stamps });
    let spans: Spans = Arc::new(Mutex::new(Vec::with_capacity(if stamps { ITERATIONS as usize } else { 0 })));
    let (starts, ends, kept) = (laps.clone(), laps.clone(), spans.clone());
    let registry = Registry::new([
        AgentType::made_by(move |params| Starter { laps: Some(starts.clone()), ..Starter::build(params) })
            .named("starter"),
        AgentType::of::<Hand>().named("hand"),
        AgentType::made_by(move |params| Finisher {
            laps: Some(ends.clone()),
            spans: kept.clone(),
            ..Finisher::build(params)
        })
        .named("finisher"),
    ]);
    let observer = Box::new(Finish(laps.clone()));
    let options = Options { limit: Some(Duration::secs(60)), observer, ..Options::default() };
    let report = Live::new(&plan(), &registry, options).and_then(Live::run);
    report.map_err(|error| Failure::new(error.to_string()).code(1))?;
    if !laps.over.load(Ordering::Acquire) {
        return Err(
            Failure::new("the parcel did not come around a hundred thousand times in a minute").code(1)
        );
    }
    Ok((laps.whole.load(Ordering::Relaxed) as f64 / ITERATIONS as f64, taken(&spans)))
}

pub(super) fn measure() -> Result<Outcome, Failure> {
    let (mut hops, mut iterations) = (Vec::new(), Vec::new());
    let mut copper = Peers::find().map(Copper::new);
    for _ in 0..RUNS {
        iterations.push(laps(false)?.0);
        if let Some(copper) = &mut copper {
            copper.round();
        }
        hops.extend(laps(true)?.1);
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
        let mut figures = self
            .peers
            .measure("hop", &["--iterations", &ITERATIONS.to_string(), "--cpu", &CPU.to_string()])?;
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
