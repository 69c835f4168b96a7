//! A source, eight agents that hand on and a sink beside each of them, with a log of all that is sent: the shape of copper's own
//! example of this name, at the same rate as it.
//!
//! Compared is what an iteration takes of the processor of the thread that runs the agents, less what sleeping takes.

use runtime::{Agent, AgentType, Declare as _, Fault, Input, Output, Plan, Registry, Step};
use types::{Duration, Message};

use super::{CPU, recorded};
use crate::bench::Setting;
use crate::bench::outcome::Outcome;
use crate::bench::parcel::{Shelf, process_time, thread_time, until};
use crate::bench::turns::{Turns, mean};
use crate::error::Failure;
use std::hint::black_box;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Iterations of a round, the time between them, and rounds.
const ITERATIONS: usize = 20_000;
const PERIOD: Duration = Duration::micros(100);
const ROUNDS: usize = 3;
const WARM_UP: u64 = 100;
/// Agents that hand on.
const SEGMENTS: usize = 8;

/// Whether a light is on.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
struct Light {
    /// It is.
    on: u8,
}

/// Turns the light on and off.
#[derive(Agent)]
struct Head {
    /// The light.
    out: Output<Light>,
    number: u64,
    messages: u64,
    /// What thread and process had used when the first message that counts was sent.
    used: [u64; 2],
    shelf: Shelf,
    over: Arc<AtomicBool>,
}

impl Agent for Head {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.number += 1;
        if self.number == WARM_UP + 1 {
            self.used = [thread_time(), process_time()];
        }
        if self.number > WARM_UP + self.messages {
            if !self.over.load(Ordering::Relaxed) {
                let used = [thread_time() - self.used[0], process_time() - self.used[1]];
                self.shelf.put(&used.map(|used| used as f64 / self.messages as f64));
                self.over.store(true, Ordering::Release);
            }
            return Ok(());
        }
        self.out.send(Light { on: (self.number % 2) as u8 });
        Ok(())
    }
}

/// Hands on what it is told.
#[derive(Agent)]
struct Segment {
    /// What comes.
    take: Input<Light>,
    /// What goes.
    give: Output<Light>,
}

impl Agent for Segment {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while let Some(light) = self.take.take() {
            self.give.send(*light);
        }
        Ok(())
    }
}

/// Does as it is told.
#[derive(Agent)]
struct Foot {
    /// What comes.
    take: Input<Light>,
    on: bool,
}

impl Agent for Foot {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while let Some(light) = self.take.take() {
            self.on = black_box(light.on != 0);
        }
        Ok(())
    }
}

fn plan() -> Plan {
    let mut plan = Plan::new("caterpillar");
    let mut last = plan.add::<Head>("head", Default::default()).out;
    plan.every("head", PERIOD);
    for number in 0..SEGMENTS {
        let names = [format!("segment{number}"), format!("foot{number}")];
        let segment = plan.add::<Segment>(&names[0], Default::default());
        let foot = plan.add::<Foot>(&names[1], Default::default());
        plan.wire(&last, &segment.take);
        plan.wire(&segment.give, &foot.take);
        names.iter().for_each(|name| plan.on(name, "take"));
        last = segment.give;
    }
    super::on_one_executor(&mut plan);
    plan
}

/// Processor time of an iteration: that of the executor's thread, and that of the process (ns).
fn run(iterations: usize, outcome: &mut Outcome) -> Result<([f64; 2], Option<Failure>), Failure> {
    let (shelf, over) = (Shelf::default(), Arc::new(AtomicBool::new(false)));
    let (kept, ends) = (shelf.clone(), over.clone());
    let registry = Registry::new([
        AgentType::made_by(move |params| Head {
            messages: iterations as u64,
            shelf: kept.clone(),
            over: ends.clone(),
            ..Head::build(params)
        })
        .named("head"),
        AgentType::of::<Segment>(),
        AgentType::of::<Foot>(),
    ]);
    let options = until(&over, PERIOD * iterations as i64);
    let kept = recorded::run(&plan(), &registry, options, outcome)?;
    let &[thread, process] = &shelf.take()[..] else {
        return Err(Failure::new("the lights were not all sent in time").code(1));
    };
    Ok(([thread, process], kept.failure()))
}

/// Rounds of ours and of copper's, in turns.
pub(super) fn measure(setting: &Setting<'_>, outcome: &mut Outcome) -> Result<(), Failure> {
    let iterations = setting.of(ITERATIONS, 500);
    let mut turns = Turns::new(setting.peers.clone());
    let (mut rounds, mut lossy) = (Vec::new(), None);
    let (mut works, mut processes) = (Vec::new(), Vec::new());
    let (mut their_works, mut their_processes) = (Vec::new(), Vec::new());
    let args = ["--iterations".to_owned(), iterations.to_string(), "--cpu".to_owned(), CPU.to_string()];
    for _ in 0..setting.of(ROUNDS, if setting.shorter > 100 { 1 } else { 3 }) {
        let before = recorded::idle(PERIOD)?;
        let ([thread, process], lost) = run(iterations, outcome)?;
        let work = thread - (before + recorded::idle(PERIOD)?) / 2.0;
        lossy = lost.or(lossy);
        works.push(work);
        processes.push(process);
        let mut round = turns.round("caterpillar_paced", &args);
        let their_work = turns.take(&mut round, "work", "ns");
        if !their_work.is_empty() {
            rounds.push((work, mean(&their_work)));
            their_works.push(mean(&their_work));
            their_processes.push(mean(&turns.take(&mut round, "process", "ns")));
        }
    }
    outcome.figure("caterpillar_work", "ns", works);
    outcome.figure("caterpillar_process_time", "ns", processes);
    outcome.figure("caterpillar_work_copper", "ns", their_works);
    outcome.figure("caterpillar_process_time_copper", "ns", their_processes);
    match lossy {
        Some(failure) => outcome.without("caterpillar/copper", Some(failure)),
        None => turns.compare(outcome, "caterpillar/copper", rounds),
    }
    Ok(())
}
