//! A source, eight agents that hand on and a sink beside each of them, with a log of all that is sent: the shape of copper's own
//! example of this name, at the same rate as it.

use runtime::{Agent, AgentType, Declare as _, Fault, Input, Output, Plan, Registry, Step};
use types::Message;

use super::beside::{self, PERIOD, Ran, Work};
use super::iteration::{Ending, Iteration};
use super::recorded;
use crate::bench::Setting;
use crate::bench::outcome::Outcome;
use crate::bench::parcel::{Shelf, now, process_time, until};
use crate::error::Failure;
use std::hint::black_box;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Iterations before anything is kept.
const WARM_UP: u64 = 100;
/// Agents that hand on.
const SEGMENTS: usize = 8;
const WORK: Work = Work {
    name: "caterpillar",
    theirs: "caterpillar_paced",
    ratios: ["caterpillar_median/copper", "caterpillar/copper", "caterpillar_p99/copper"],
    prefix: "caterpillar_",
    messages: 1.0 + SEGMENTS as f64,
};

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
    /// What the process had used, and what time it was, when the first message that counts was sent.
    used: [u64; 2],
    shelf: Shelf,
    over: Arc<AtomicBool>,
    iteration: Option<Iteration>,
}

impl Agent for Head {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        if self.number == WARM_UP {
            self.used = [process_time(), now()];
        }
        if self.number == WARM_UP + self.messages {
            if !self.over.load(Ordering::Relaxed) {
                let used = [process_time() - self.used[0], now() - self.used[1]];
                self.shelf.put(&used.map(|used| used as f64));
                self.over.store(true, Ordering::Release);
            }
            return Ok(());
        }
        if let Some(iteration) = &self.iteration {
            iteration.begin();
        }
        self.number += 1;
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
    iteration: Option<Iteration>,
}

impl Agent for Foot {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while let Some(light) = self.take.take() {
            self.on = black_box(light.on != 0);
            if let Some(iteration) = &self.iteration {
                iteration.sink();
            }
        }
        Ok(())
    }
}

/// Comes after all others and says when an iteration is over.
#[derive(Agent)]
struct Tail {
    /// What the last foot is told, too.
    take: Input<Light>,
    ending: Ending,
}

impl Agent for Tail {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        let time = now();
        while self.take.take().is_some() {
            self.ending.end(time);
        }
        Ok(())
    }

    fn stop(&mut self, _: &mut Step) {
        self.ending.put();
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
    // Of those that wait for the same output the first by name comes first.
    let tail = plan.add::<Tail>("tail", Default::default());
    plan.wire(&last, &tail.take);
    plan.on("tail", "take");
    super::on_one_executor(&mut plan);
    plan
}

fn run(iterations: usize, outcome: &mut Outcome) -> Result<Ran, Failure> {
    let (shelf, over) = (Shelf::default(), Arc::new(AtomicBool::new(false)));
    let iteration = Iteration::of(SEGMENTS as u64, WARM_UP, iterations);
    let (kept, ends) = (shelf.clone(), over.clone());
    let [head, foot, tail] = [(); 3].map(|()| iteration.clone());
    let registry = Registry::new([
        AgentType::made_by(move |params| Head {
            messages: iterations as u64,
            shelf: kept.clone(),
            over: ends.clone(),
            iteration: Some(head.clone()),
            ..Head::build(params)
        })
        .named("head"),
        AgentType::of::<Segment>(),
        AgentType::made_by(move |params| Foot { iteration: Some(foot.clone()), ..Foot::build(params) })
            .named("foot"),
        AgentType::made_by(move |params| Tail { ending: Ending::of(&tail), ..Tail::build(params) })
            .named("tail"),
    ]);
    let options = until(&over, PERIOD * iterations as i64);
    let kept = recorded::run(&plan(), &registry, options, outcome)?;
    let &[process, whole] = &shelf.take()[..] else {
        return Err(Failure::new("the lights were not all sent in time").code(1));
    };
    let iterations = iterations as f64;
    Ok(Ran { spans: iteration.spans()?, process: process / iterations, rate: iterations * 1e9 / whole, kept })
}

/// Rounds of ours and of copper's, in turns.
pub(super) fn measure(setting: &Setting<'_>, outcome: &mut Outcome) -> Result<(), Failure> {
    beside::measure(setting, outcome, &WORK, &mut run)
}
