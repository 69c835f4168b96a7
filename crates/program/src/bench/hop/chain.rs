//! The agents of a chain that a clock drives: a source, who hands on, a sink.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use runtime::{Agent, AgentType, Declare as _, Fault, Input, Options, Output, Plan, Registry, Step};
use types::Duration;

use crate::bench::parcel::{Parcel, Shelf, keep, now, process_time, room, thread_time, until};

/// Messages before anything is kept.
const WARM_UP: u64 = 100;

/// What a run of the chain leaves.
#[derive(Clone, Debug, Default)]
pub(super) struct Trace {
    /// From the source's step to the sink's, of each message (ns).
    pub(super) spans: Shelf,
    /// From the first message that counts to the last: processor time of the executor's thread and of the process, and the time that
    /// went by (ns).
    pub(super) used: Shelf,
    over: Arc<AtomicBool>,
    /// Messages that count.
    messages: u64,
}

impl Trace {
    pub(super) fn of(messages: usize) -> Trace {
        Trace { messages: messages as u64, ..Trace::default() }
    }

    /// Options of a run that ends when all messages are sent, at a period.
    pub(super) fn options(&self, period: Duration) -> Options {
        until(&self.over, period * self.messages as i64)
    }

    /// The agents.
    pub(super) fn registry(&self) -> Registry {
        let (source, sink) = (self.clone(), self.clone());
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
        ])
    }
}

/// Sends a parcel each time, until it has sent all.
#[derive(Agent)]
pub(super) struct Source {
    /// The parcel.
    pub(super) out: Output<Parcel>,
    number: u64,
    /// What thread and process had used, and what time it was, when the first message that counts was sent.
    used: [u64; 3],
    trace: Trace,
}

impl Agent for Source {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.number += 1;
        if self.number == WARM_UP + 1 {
            self.used = [thread_time(), process_time(), now()];
        }
        if self.number > WARM_UP + self.trace.messages {
            if !self.trace.over.load(Ordering::Relaxed) {
                let [thread, process, begun] = self.used;
                let used = [thread_time() - thread, process_time() - process, now() - begun];
                self.trace.used.put(&used.map(|used| used as f64));
                self.trace.over.store(true, Ordering::Release);
            }
            return Ok(());
        }
        self.out.send(Parcel { sent: now(), number: self.number, ..Parcel::default() });
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
            if parcel.number > WARM_UP {
                keep(&mut self.spans, now().saturating_sub(parcel.sent) as f64);
            }
        }
        Ok(())
    }

    fn stop(&mut self, _: &mut Step) {
        self.trace.spans.put(&self.spans);
    }
}

/// A source at a period, three who hand on and a sink, on one executor.
pub(super) fn plan(period: Duration) -> Plan {
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
    super::on_one_executor(&mut plan);
    plan
}
