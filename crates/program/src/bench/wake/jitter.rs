//! How late the steps of an agent begin that runs at 1 kHz, beside a bare thread of the same priority on the same processor, which
//! sleeps until times half a period apart from the agent's.
//!
//! Both run at the same time, so what the machine does to one it does to the other. A release that was passed over because the
//! agent was late counts as late as the step was that came instead.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use runtime::{
    Agent, AgentType, Declare as _, ExecutorPlan, Fault, Incident, Input, Observer, Options, Output, Plan,
    Registry, Step, Verdict,
};
use types::{Duration, Time};

use super::PRIORITY;
use crate::bench::Setting;
use crate::bench::load::Load;
use crate::bench::outcome::{Measured, Outcome};
use crate::bench::parcel::{self, Parcel, Shelf, end, keep, live, monotonic, now, offset, room, thread};
use crate::error::Failure;

/// How often both wake.
const PERIOD: Duration = Duration::millis(1);
/// Releases of each; in so many rounds, since each round draws anew how the threads of the runtime stand to both.
const RELEASES: usize = 200_000;
const ROUNDS: usize = 4;
/// Releases before the phase is told.
const WARM_UP: u64 = 100;
/// The processor.
const CPU: usize = 0;
const UNKNOWN: u64 = u64::MAX;

/// What the agent and the one who starts the bare thread share.
#[derive(Debug)]
struct Shared {
    /// The remainder of the agent's releases by the period (ns), on the monotonic clock.
    phase: AtomicU64,
    /// Whether lateness is kept.
    keeps: AtomicBool,
    over: AtomicBool,
    /// From the agent's time to the monotonic clock (ns).
    offset: u64,
}

/// Looks how late it is.
#[derive(Agent)]
struct Punctual {
    /// Nobody listens, and nobody speaks.
    never: Input<Parcel>,
    /// As little.
    nothing: Output<Parcel>,
    shared: Option<Arc<Shared>>,
    done: u64,
    /// The release of the last step (ns).
    last: u64,
    late: Vec<f64>,
    shelf: Shelf,
}

impl Agent for Punctual {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        let now = now();
        let Some(shared) = &self.shared else { return Ok(()) };
        // The deadline is a period behind the release.
        let release = monotonic(step.deadline - step.period, shared.offset);
        self.done += 1;
        if self.done == WARM_UP {
            shared.phase.store(release % PERIOD.0 as u64, Ordering::Release);
        }
        if shared.keeps.load(Ordering::Relaxed) {
            let mut owed = (self.last + PERIOD.0 as u64).min(release);
            while owed <= release {
                keep(&mut self.late, now.saturating_sub(owed) as f64);
                owed += PERIOD.0 as u64;
            }
        }
        self.last = release;
        Ok(())
    }

    fn stop(&mut self, _: &mut Step) {
        self.shelf.put(&self.late);
    }
}

/// Ends the run when the bare thread has ended.
struct Finish(Arc<Shared>);

impl Observer for Finish {
    fn every(&self) -> Duration {
        Duration::millis(10)
    }
    fn observe(&mut self, _: Time, _: &[Incident]) -> Verdict {
        if self.0.over.load(Ordering::Acquire) {
            return Verdict::End("all releases are over".into());
        }
        Verdict::GoOn
    }
}

/// Idle and under load.
pub(super) fn measure(setting: &Setting<'_>, outcome: &mut Outcome) -> Result<(), Failure> {
    side_by_side(setting, outcome, "jitter_idle", "jitter_idle/bare")?;
    let Some(program) = &setting.program else {
        outcome.without("jitter_loaded/bare", None);
        return Ok(());
    };
    let load = Load::start(program)?;
    side_by_side(setting, outcome, "jitter_loaded", "jitter_loaded/bare")?;
    drop(load);
    Ok(())
}

fn side_by_side(
    setting: &Setting<'_>,
    outcome: &mut Outcome,
    name: &str,
    ratio: &'static str,
) -> Result<(), Failure> {
    let (mut ours, mut theirs, mut failed) = (Vec::new(), Vec::new(), None);
    let rounds = if setting.shorter > 100 { 1 } else { ROUNDS };
    for _ in 0..rounds {
        let (own, bare) = round(setting, setting.of(RELEASES, 100) / rounds, outcome)?;
        ours.extend(own);
        match bare {
            Ok(bare) => theirs.extend(bare),
            Err(failure) => failed = Some(failure),
        }
    }
    let (ours, theirs) =
        (Measured::new(name, "ns", ours), Measured::new(format!("{name}_bare"), "ns", theirs));
    if theirs.is_empty() || failed.is_some() {
        outcome.without(ratio, failed);
        outcome.figures.push(ours);
    } else {
        outcome.compare_tails(ratio, &ours, &theirs);
        outcome.figures.extend([ours, theirs]);
    }
    Ok(())
}

/// One run of the system, and within it the bare thread's releases: of each how late they were (ns).
#[allow(clippy::type_complexity)] // two of the same, of which one can fail
fn round(
    setting: &Setting<'_>,
    releases: usize,
    outcome: &mut Outcome,
) -> Result<(Vec<f64>, Result<Vec<f64>, Failure>), Failure> {
    let shared = Arc::new(Shared {
        phase: AtomicU64::new(UNKNOWN),
        keeps: AtomicBool::new(false),
        over: AtomicBool::new(false),
        offset: offset(),
    });
    let shelf = Shelf::default();
    let (theirs, kept) = (shared.clone(), shelf.clone());
    let registry = Registry::new([AgentType::made_by(move |params| Punctual {
        shared: Some(theirs.clone()),
        late: room(releases + releases / 10),
        shelf: kept.clone(),
        ..Punctual::build(params)
    })
    .named("punctual")]);
    let mut plan = Plan::new("jitter");
    plan.add::<Punctual>("punctual", Default::default());
    plan.every("punctual", PERIOD);
    plan.executors.push(ExecutorPlan { cpus: vec![CPU], ..ExecutorPlan::new("clocked", Some(PRIORITY)) });
    if let Some(agent) = plan.agent_mut("punctual") {
        agent.executor = Some("clocked".into());
    }
    let options = Options {
        limit: Some(PERIOD * (2 * releases as i64) + Duration::secs(20)),
        observer: Box::new(Finish(shared.clone())),
        ..Options::default()
    };
    let live = live(&plan, &registry, options)?;
    let (peers, at) = (setting.peers.clone(), shared.clone());
    let bare = thread("bench-bare", move || {
        while at.phase.load(Ordering::Acquire) == UNKNOWN {
            crate::terminal::pause(std::time::Duration::from_millis(10));
        }
        at.keeps.store(true, Ordering::Relaxed);
        let bare = peers.map(|peers| {
            let phase = (at.phase.load(Ordering::Acquire) + PERIOD.0 as u64 / 2) % PERIOD.0 as u64;
            let words = [
                ("--cpu", CPU as u64),
                ("--fifo", PRIORITY.into()),
                ("--iterations", releases as u64),
                ("--period", PERIOD.0 as u64),
                ("--phase", phase),
            ];
            let words = words.iter().flat_map(|(name, value)| [(*name).to_owned(), value.to_string()]);
            let mut figures = peers.measure("nanosleep", &words.collect::<Vec<_>>())?;
            crate::bench::peers::take(&mut figures, "late", "ns")
        });
        if bare.is_none() {
            crate::terminal::pause(std::time::Duration::from_millis(releases as u64));
        }
        at.over.store(true, Ordering::Release);
        bare.unwrap_or_else(|| Ok(Vec::new()))
    })?;
    let ran = parcel::run(live, outcome);
    let bare = end(bare)?;
    ran?;
    Ok((shelf.take(), bare))
}
