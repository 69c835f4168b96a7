//! A message of 64 bytes from a source over three agents to a sink, and from there back to the source, which sends the next one then.
//!
//! An iteration is a whole lap, five steps and five messages, each released, timed and counted as always; a hop is timed from the
//! source's step to the sink's. While the laps go on, one of their outputs and one of their mailboxes get another wire and lose
//! it again, many times; each is there only for as long as the requests take, or the lap would be one of more messages.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration as Pause;

use runtime::{
    Agent, AgentType, Control, Declare as _, Fault, Input, Output, Plan, Registry, Request, Step, WirePlan,
};
use types::Duration;

use super::CPU;
use super::chain::{self, Hand, Trace};
use crate::bench::Setting;
use crate::bench::outcome::Outcome;
use crate::bench::parcel::{self, Parcel, Shelf, end, keep, live, now, room, thread, until};
use crate::bench::turns::{Turns, mean};
use crate::error::Failure;
use crate::terminal::pause;

/// Iterations of one run, and rounds.
const ITERATIONS: usize = 100_000;
const ROUNDS: usize = 5;
/// How long a wire that comes and goes stays away.
const STAYS_AWAY: Pause = Pause::from_millis(2);
/// The pace at which a robot might send, and messages at that pace.
const PACE: Duration = Duration::millis(1);
const PACED: usize = 1000;

/// What the two ends of the laps share.
#[derive(Debug)]
struct Laps {
    iterations: u64,
    /// From the first lap to the last (ns).
    whole: AtomicU64,
    over: Arc<AtomicBool>,
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
    done: u64,
    first: u64,
    laps: Option<Arc<Laps>>,
}

impl Agent for Starter {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        let Some(laps) = &self.laps else { return Ok(()) };
        if self.again.take().is_some() {
            self.done += 1;
        } else {
            self.first = now();
        }
        if self.done == laps.iterations {
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
    spans: Vec<f64>,
    shelf: Shelf,
}

impl Agent for Finisher {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while let Some(parcel) = self.take.take() {
            if parcel.sent != 0 {
                keep(&mut self.spans, now().saturating_sub(parcel.sent) as f64);
            }
            self.give.send(Parcel::default());
        }
        Ok(())
    }

    fn stop(&mut self, _: &mut Step) {
        self.shelf.put(&self.spans);
    }
}

/// All on one executor, and beside the laps an agent to whom wires come and go.
fn plan() -> Plan {
    let mut plan = Plan::new("hop");
    let starter = plan.add::<Starter>("starter", Default::default());
    let hands = ["first", "second", "third"].map(|name| plan.add::<Hand>(name, Default::default()));
    let finisher = plan.add::<Finisher>("finisher", Default::default());
    plan.add::<Hand>("aside", Default::default());
    plan.wire(&starter.out, &hands[0].take);
    plan.wire(&hands[0].give, &hands[1].take);
    plan.wire(&hands[1].give, &hands[2].take);
    plan.wire(&hands[2].give, &finisher.take);
    plan.wire(&finisher.give, &starter.again);
    // The clock begins the first lap; the others are begun by the parcel that is back.
    plan.every("starter", Duration::secs(3600));
    plan.every("aside", Duration::secs(3600));
    plan.on("starter", "again");
    for name in ["first", "second", "third", "finisher"] {
        plan.on(name, "take");
    }
    super::on_one_executor(&mut plan);
    plan
}

/// Makes and cuts two wires of the running laps until they are over: one more out of an output, one more into a mailbox. Gives how
/// many times.
fn rewire(control: &Control, over: &AtomicBool) -> Result<usize, Failure> {
    let wires = [("first.give", "aside.take"), ("aside.give", "third.take")];
    let made = || Request::All(wires.map(|(from, to)| Request::Wire(WirePlan::new(from, to))).into());
    let cut = || {
        let cut = |(from, to): (&str, &str)| Request::Unwire { from: from.into(), to: to.into() };
        Request::All(wires.map(cut).into())
    };
    let mut times = 0;
    while !over.load(Ordering::Acquire) {
        for request in [made(), cut()] {
            // A run that ends refuses, too.
            match control.request(request) {
                Ok(()) => times += 1,
                Err(_) if over.load(Ordering::Acquire) => return Ok(times),
                Err(refusal) => return Err(Failure::new(refusal.to_string()).code(1)),
            }
        }
        pause(STAYS_AWAY);
    }
    Ok(times)
}

/// What a run of laps gives.
struct Ran {
    /// The mean of a lap (ns).
    iteration: f64,
    /// How long each parcel was under way (ns).
    hops: Vec<f64>,
    /// How often wires were made and cut meanwhile.
    rewired: usize,
}

fn laps(iterations: usize, stamps: bool, outcome: &mut Outcome) -> Result<Ran, Failure> {
    let over = Arc::new(AtomicBool::new(false));
    let laps = Arc::new(Laps {
        iterations: iterations as u64,
        whole: AtomicU64::new(0),
        over: over.clone(),
        stamps,
    });
    let shelf = Shelf::default();
    let (starts, kept) = (laps.clone(), shelf.clone());
    let registry = Registry::new([
        AgentType::made_by(move |params| Starter { laps: Some(starts.clone()), ..Starter::build(params) })
            .named("starter"),
        AgentType::of::<Hand>().named("hand"),
        AgentType::made_by(move |params| Finisher {
            spans: room(if stamps { iterations } else { 0 }),
            shelf: kept.clone(),
            ..Finisher::build(params)
        })
        .named("finisher"),
    ]);
    let live = live(&plan(), &registry, until(&over, Duration::secs(10)))?;
    let control = live.control();
    let rewires = thread("bench-rewires", move || rewire(&control, &over))?;
    let ran = parcel::run(live, outcome);
    laps.over.store(true, Ordering::Release);
    let rewired = end(rewires)?;
    ran?;
    let whole = laps.whole.load(Ordering::Relaxed) as f64;
    if whole == 0.0 {
        return Err(Failure::new("the laps did not end within a minute").code(1));
    }
    Ok(Ran { iteration: whole / iterations as f64, hops: shelf.take(), rewired: rewired? })
}

/// Rounds of ours and of copper's, in turns.
pub(super) fn measure(setting: &Setting<'_>, outcome: &mut Outcome) -> Result<(), Failure> {
    let iterations = setting.of(ITERATIONS, 1000);
    let mut turns = Turns::new(setting.peers.clone());
    let (mut hops, mut means, mut rewired) = (Vec::new(), Vec::new(), Vec::new());
    let (mut their_hops, mut their_means) = (Vec::new(), Vec::new());
    let args = ["--iterations".to_owned(), iterations.to_string(), "--cpu".to_owned(), CPU.to_string()];
    for _ in 0..setting.of(ROUNDS, if setting.shorter > 100 { 1 } else { 3 }) {
        let ran = laps(iterations, false, outcome)?;
        means.push(ran.iteration);
        rewired.push(ran.rewired as f64);
        let mut round = turns.round("hop", &args);
        let blocks = turns.take(&mut round, "iteration", "ns");
        if !blocks.is_empty() {
            their_means.push(mean(&blocks));
        }
        their_hops.extend(turns.take(&mut round, "hop", "ns"));
        hops.extend(laps(iterations, true, outcome)?.hops);
    }
    let rounds = means.iter().copied().zip(their_means.iter().copied()).collect();
    outcome.figure("hop", "ns", hops);
    outcome.figure("iteration", "ns", means);
    outcome.figure("rewired", "1", rewired);
    outcome.figure("hop_copper", "ns", their_hops);
    outcome.figure("iteration_copper", "ns", their_means);
    turns.compare(outcome, "hop/copper", rounds);
    Ok(())
}

/// The hop at the pace of a robot: whoever sleeps between two messages finds the processor's memory cold.
pub(super) fn paced(setting: &Setting<'_>, outcome: &mut Outcome) -> Result<(), Failure> {
    let messages = setting.of(PACED, 50);
    let mut turns = Turns::new(setting.peers.clone());
    let (mut ours, mut theirs) = (Vec::new(), Vec::new());
    let words = [("--iterations", messages as u64), ("--cpu", CPU as u64), ("--period", PACE.0 as u64)];
    let args: Vec<String> =
        words.iter().flat_map(|(name, value)| [(*name).to_owned(), value.to_string()]).collect();
    for _ in 0..setting.of(ROUNDS, 1) {
        let trace = Trace::of(messages);
        let live = live(&chain::plan(PACE, false), &trace.registry(), trace.options(PACE))?;
        parcel::run(live, outcome)?;
        ours.extend(trace.spans.take());
        let mut round = turns.round("hop", &args);
        theirs.extend(turns.take(&mut round, "hop", "ns"));
    }
    outcome.figure("hop_paced", "ns", ours);
    outcome.figure("hop_paced_copper", "ns", theirs);
    // What went wrong here went wrong with the laps, and is told there.
    drop(turns);
    Ok(())
}
