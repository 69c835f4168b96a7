//! The agents of a chain that a clock drives: a source, who hands on, a sink; and where whole iterations are timed, one who comes after all.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use runtime::{Agent, AgentType, Declare as _, Fault, Input, Options, Output, Plan, Registry, Step};
use types::Duration;

use super::iteration::{Ending, Iteration};
use crate::bench::parcel::{Parcel, Shelf, keep, now, process_time, room, until};
use crate::error::Failure;

/// Messages before anything is kept.
const WARM_UP: u64 = 100;

/// What a run of the chain leaves.
#[derive(Clone, Debug, Default)]
pub(super) struct Trace {
    /// From the source's step to the sink's, of each message (ns); nothing where iterations are timed.
    pub(super) spans: Shelf,
    /// Whole iterations, where they are timed.
    pub(super) iteration: Option<Iteration>,
    /// From the first message that counts to the last: processor time of the process, and the time that went by (ns).
    used: Shelf,
    over: Arc<AtomicBool>,
    /// Messages that count.
    messages: u64,
}

impl Trace {
    pub(super) fn of(messages: usize) -> Trace {
        Trace { messages: messages as u64, ..Trace::default() }
    }

    /// Times whole iterations in place of the way of each message.
    pub(super) fn of_iterations(messages: usize) -> Trace {
        Trace { iteration: Some(Iteration::of(1, WARM_UP, messages)), ..Trace::of(messages) }
    }

    /// Processor time of the process for each message that counts (ns), and how many of them were sent in a second.
    pub(super) fn each(&self) -> Result<(f64, f64), Failure> {
        let &[process, whole] = &self.used.take()[..] else {
            return Err(Failure::new("the messages were not all sent in time").code(1));
        };
        let messages = self.messages as f64;
        Ok((process / messages, messages * 1e9 / whole))
    }

    /// Options of a run that ends when all messages are sent, at a period.
    pub(super) fn options(&self, period: Duration) -> Options {
        until(&self.over, period * self.messages as i64)
    }

    /// The agents.
    pub(super) fn registry(&self) -> Registry {
        let (source, sink, last) = (self.clone(), self.clone(), self.iteration.clone());
        Registry::new([
            AgentType::made_by(move |params| Source { trace: source.clone(), ..Source::build(params) })
                .named("source"),
            AgentType::of::<Hand>().named("hand"),
            AgentType::made_by(move |params| Sink {
                spans: room(sink.messages as usize),
                trace: sink.clone(),
                ..Sink::build(params)
            })
            .named("sink"),
            AgentType::made_by(move |params| Tail {
                ending: last.as_ref().map(Ending::of).unwrap_or_default(),
                ..Tail::build(params)
            })
            .named("tail"),
        ])
    }
}

/// Sends a parcel each time, until it has sent all.
#[derive(Agent)]
pub(super) struct Source {
    /// The parcel.
    pub(super) out: Output<Parcel>,
    number: u64,
    /// What the process had used, and what time it was, when the first message that counts was sent.
    used: [u64; 2],
    trace: Trace,
}

impl Agent for Source {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        if self.number == WARM_UP {
            self.used = [process_time(), now()];
        }
        if self.number == WARM_UP + self.trace.messages {
            if !self.trace.over.load(Ordering::Relaxed) {
                let [process, begun] = self.used;
                let used = [process_time() - process, now() - begun];
                self.trace.used.put(&used.map(|used| used as f64));
                self.trace.over.store(true, Ordering::Release);
            }
            return Ok(());
        }
        let sent = self.trace.iteration.as_ref().map_or_else(now, Iteration::begin);
        self.number += 1;
        self.out.send(Parcel { sent, number: self.number, ..Parcel::default() });
        Ok(())
    }
}

/// Hands a parcel on.
#[derive(Agent)]
pub(super) struct Hand {
    /// What comes.
    pub(super) take: Input<Parcel>,
    /// What goes.
    pub(super) give: Output<Parcel>,
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
    pub(super) take: Input<Parcel>,
    spans: Vec<f64>,
    trace: Trace,
}

impl Agent for Sink {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while let Some(parcel) = self.take.take() {
            if let Some(iteration) = &self.trace.iteration {
                iteration.sink();
            } else if parcel.number > WARM_UP {
                keep(&mut self.spans, now().saturating_sub(parcel.sent) as f64);
            }
        }
        Ok(())
    }

    fn stop(&mut self, _: &mut Step) {
        self.trace.spans.put(&self.spans);
    }
}

/// Comes after all others and says when an iteration is over.
#[derive(Agent)]
pub(super) struct Tail {
    /// What the sink is told, too.
    pub(super) take: Input<Parcel>,
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

/// A source at a period, three who hand on and a sink, on one executor; and where iterations are timed, one who comes after all of them.
pub(super) fn plan(period: Duration, iterations: bool) -> Plan {
    let mut plan = Plan::new("hop");
    let source = plan.add::<Source>("source", Default::default());
    let hands = ["first", "second", "third"].map(|name| plan.add::<Hand>(name, Default::default()));
    let sink = plan.add::<Sink>("sink", Default::default());
    plan.wire(&source.out, &hands[0].take);
    plan.wire(&hands[0].give, &hands[1].take);
    plan.wire(&hands[1].give, &hands[2].take);
    plan.wire(&hands[2].give, &sink.take);
    plan.every("source", period);
    for name in ["first", "second", "third", "sink"] {
        plan.on(name, "take");
    }
    if iterations {
        // Of those that wait for the same output the first by name comes first.
        let tail = plan.add::<Tail>("tail", Default::default());
        plan.wire(&hands[2].give, &tail.take);
        plan.on("tail", "take");
    }
    super::on_one_executor(&mut plan);
    plan
}
