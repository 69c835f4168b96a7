//! From sending to the step of an agent whose executor slept, and the same with two bare threads.
//!
//! Both sides are ordinary threads on given processors, and take turns, so that what else the machine does meets both alike.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration as HostDuration;

use runtime::{ExecutorPlan, Live, Options, Plan};
use rustix::thread::{CpuSet, sched_setaffinity};
use types::Duration;

use super::hop::{self, Sink, Source};
use super::{Measured, Outcome, Ratio, median};
use crate::error::Failure;
use crate::terminal::{host_now, pause};

/// How often a message is sent.
const PERIOD: Duration = Duration::millis(1);
/// How long a run lasts, and how often ours and theirs take turns.
const LENGTH: Duration = Duration::millis(800);
const TURNS: usize = 3;

pub(super) fn measure() -> Result<Outcome, Failure> {
    let mut outcome =
        Outcome { missing: vec!["jitter_idle/bare", "jitter_loaded/bare"], ..Outcome::default() };
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    pair(&mut outcome, "wake_same", "wake_same/futex", (0, 0))?;
    if cores > 1 {
        pair(&mut outcome, "wake_cross", "wake_cross/futex", (0, 1))?;
    } else {
        outcome.missing.push("wake_cross/futex");
    }
    Ok(outcome)
}

fn pair(outcome: &mut Outcome, name: &str, ratio: &'static str, cpus: (usize, usize)) -> Result<(), Failure> {
    let (mut ours, mut theirs) = (Vec::new(), Vec::new());
    let mut values = Vec::new();
    let mut jitter = Vec::new();
    for _ in 0..TURNS {
        let (own, late) = system(cpus)?;
        let bare = threads(cpus)?;
        let middle = |spans: &[f64]| median(spans.to_vec());
        values.push((middle(&own) / middle(&bare), middle(&own), middle(&bare)));
        ours.extend(own);
        theirs.extend(bare);
        jitter.push(late);
    }
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (value, own, bare) = values[values.len() / 2];
    outcome.figures.push(Measured::new(name, "ns", ours));
    outcome.figures.push(Measured::new(format!("{name}_futex"), "ns", theirs));
    outcome.figures.push(Measured::new(format!("{name}_worst_jitter"), "ns", jitter));
    outcome.ratios.push(Ratio { name: ratio, ours: own, theirs: bare, value });
    Ok(())
}

/// A source and a sink on two executors. Gives the spans, and how late the source began at worst (ns).
fn system(cpus: (usize, usize)) -> Result<(Vec<f64>, f64), Failure> {
    let mut plan = Plan::new("wake");
    let source = plan.add::<Source>("source", Default::default());
    let sink = plan.add::<Sink>("sink", Default::default());
    plan.wire(&source.out, &sink.take);
    plan.every("source", PERIOD);
    plan.on("sink", "take");
    for (name, agent, cpu) in [("sends", "source", cpus.0), ("takes", "sink", cpus.1)] {
        plan.executors.push(ExecutorPlan { cpus: vec![cpu], ..ExecutorPlan::new(name, None) });
        if let Some(agent) = plan.agent_mut(agent) {
            agent.executor = Some(name.into());
        }
    }
    let (registry, spans) = hop::types((LENGTH.0 / PERIOD.0) as usize + 16);
    let options = Options { limit: Some(LENGTH), ..Options::default() };
    let report = Live::new(&plan, &registry, options).and_then(Live::run);
    let report = report.map_err(|error| Failure::new(error.to_string()).code(1))?;
    let late = report.view.agents.first().map_or(0.0, |source| source.jitter.max);
    Ok((hop::taken(&spans), late))
}

/// Two threads: one sends, the other sleeps on the futex of its parker.
fn threads(cpus: (usize, usize)) -> Result<Vec<f64>, Failure> {
    let begun = host_now();
    let (sent, over) = (Arc::new(AtomicU64::new(0)), Arc::new(AtomicBool::new(false)));
    let (theirs, ended) = (sent.clone(), over.clone());
    let room = (LENGTH.0 / PERIOD.0) as usize + 16;
    let waits = move || {
        let mut spans = Vec::with_capacity(room);
        pin(cpus.1);
        while !ended.load(Ordering::Acquire) {
            std::thread::park();
            // Acquire: partner of the release below.
            let at = theirs.swap(0, Ordering::AcqRel);
            if at != 0 && spans.len() < room {
                spans.push((host_now() - begun).as_nanos() as f64 - at as f64);
            }
        }
        spans
    };
    let waiting = std::thread::Builder::new().name("bench-bare".into()).spawn(waits);
    let waiting =
        waiting.map_err(|error| Failure::new(format!("no thread could be started: {error}")).code(1))?;
    let target = waiting.thread().clone();
    let sends = move || {
        pin(cpus.0);
        let end = begun + HostDuration::from_nanos(LENGTH.0 as u64);
        while host_now() < end {
            pause(HostDuration::from_nanos(PERIOD.0 as u64));
            sent.store((host_now() - begun).as_nanos() as u64, Ordering::Release);
            target.unpark();
        }
        over.store(true, Ordering::Release);
        target.unpark();
    };
    let sending = std::thread::Builder::new().name("bench-sends".into()).spawn(sends);
    let sending =
        sending.map_err(|error| Failure::new(format!("no thread could be started: {error}")).code(1))?;
    let failed = || Failure::new("a thread of the measurement panicked").code(1);
    sending.join().map_err(|_| failed())?;
    waiting.join().map_err(|_| failed())
}

/// Keeps the calling thread on a processor. Where that is refused, the figure is that of wherever it ran.
fn pin(cpu: usize) {
    let mut set = CpuSet::new();
    set.set(cpu);
    let _ = sched_setaffinity(None, &set);
}
