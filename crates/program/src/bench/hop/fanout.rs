//! One message of 64 bytes to 64 receivers.
//!
//! | what | beside |
//! |---|---|
//! | a step of each receiver on the sender's executor, and back to the sender from one of them | a push and a pop of `rtrb` for each |
//! | the ports alone: sent and taken in one step | the same |
//! | receivers on four executors that sleep: how often each of their threads is woken by a message | once |

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use runtime::{
    Agent, AgentType, Declare, ExecutorPlan, Fault, Input, NoParams, Options, Output, Plan, PortOptions,
    PortVisit, Registry, Step, WirePlan,
};
use types::Duration;

use super::CPU;
use crate::bench::Setting;
use crate::bench::outcome::Outcome;
use crate::bench::parcel::{self, Parcel, Shelf, end, live, now, thread, until};
use crate::bench::turns::{Turns, mean};
use crate::error::Failure;

/// Receivers.
const RECEIVERS: usize = 64;
/// Messages to all of them in a round, and rounds.
const MESSAGES: usize = 10_000;
const ROUNDS: usize = 5;
/// Messages in one step, where ports are measured alone.
const BLOCK: u64 = 100;
/// Executors of the receivers, and messages, where wakes are counted.
const EXECUTORS: usize = 4;
const WAKES: usize = 200;

/// What both ends share.
#[derive(Debug, Default)]
struct Shared {
    messages: u64,
    /// From the first message to the last (ns).
    whole: AtomicU64,
    over: Arc<AtomicBool>,
}

impl Shared {
    fn of(messages: usize) -> Arc<Shared> {
        Arc::new(Shared { messages: messages as u64, ..Shared::default() })
    }

    fn options(&self) -> Options {
        until(&self.over, Duration::secs(10))
    }

    /// Whoever sends has sent all; it took so long (ns).
    fn end(&self, whole: u64) {
        self.whole.store(whole, Ordering::Relaxed);
        self.over.store(true, Ordering::Release);
    }

    /// The mean of a message to all (ns).
    fn mean(&self) -> Result<f64, Failure> {
        match self.whole.load(Ordering::Relaxed) {
            0 => Err(Failure::new("the messages to many were not all sent within a minute").code(1)),
            whole => Ok(whole as f64 / self.messages as f64),
        }
    }
}

/// Sends a parcel to all, and the next one when it is back from one of them.
#[derive(Agent)]
struct Herald {
    /// What is back.
    again: Input<Parcel>,
    /// What goes to all.
    out: Output<Parcel>,
    sent: u64,
    first: u64,
    shared: Arc<Shared>,
}

impl Agent for Herald {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        if self.again.take().is_none() && self.sent == 0 {
            self.first = now();
        }
        if self.sent == self.shared.messages {
            self.shared.end(now() - self.first);
            return Ok(());
        }
        self.sent += 1;
        self.out.send(Parcel { number: self.sent, ..Parcel::default() });
        Ok(())
    }
}

/// Takes what comes, and gives it back where a wire leads back.
#[derive(Agent)]
struct Listener {
    /// What comes.
    take: Input<Parcel>,
    /// What goes back.
    give: Output<Parcel>,
    last: u64,
}

impl Agent for Listener {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while let Some(parcel) = self.take.take() {
            if parcel.number != self.last + 1 {
                return Err(Fault::new("a parcel is missing"));
            }
            self.last = parcel.number;
            if self.give.has_listeners() {
                self.give.send(*parcel);
            }
        }
        Ok(())
    }
}

/// An output and as many inputs in one agent: sends to itself.
struct Ports {
    out: Output<Parcel>,
    takes: Vec<Input<Parcel>>,
    sent: u64,
    whole: u64,
    shared: Arc<Shared>,
}

/// The inputs of [`Ports`]: names of ports live as long as the program.
const NAMES: [&str; RECEIVERS] = [
    "i0", "i1", "i2", "i3", "i4", "i5", "i6", "i7", "i8", "i9", "i10", "i11", "i12", "i13", "i14", "i15",
    "i16", "i17", "i18", "i19", "i20", "i21", "i22", "i23", "i24", "i25", "i26", "i27", "i28", "i29", "i30",
    "i31", "i32", "i33", "i34", "i35", "i36", "i37", "i38", "i39", "i40", "i41", "i42", "i43", "i44", "i45",
    "i46", "i47", "i48", "i49", "i50", "i51", "i52", "i53", "i54", "i55", "i56", "i57", "i58", "i59", "i60",
    "i61", "i62", "i63",
];

impl Declare for Ports {
    const KIND: &'static str = "ports";
    const DOC: &'static str = "Sends to itself.";
    type Params = NoParams;
    type Ports = ();

    fn build(_: NoParams) -> Ports {
        Ports {
            out: Output::default(),
            takes: NAMES.iter().map(|_| Input::default()).collect(),
            sent: 0,
            whole: 0,
            shared: Arc::default(),
        }
    }
    fn swap_params(&mut self, _: &mut NoParams) {}
    fn visit_ports(&mut self, visit: &mut dyn FnMut(PortVisit<'_>)) {
        let options = PortOptions::DEFAULT;
        visit(PortVisit { name: "out", doc: "What goes.", options, port: &mut self.out });
        for (name, port) in NAMES.into_iter().zip(&mut self.takes) {
            visit(PortVisit { name, doc: "What comes.", options, port });
        }
    }
    fn ports_of(_: &str) {}
}

impl Agent for Ports {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        let begun = now();
        for _ in 0..BLOCK.min(self.shared.messages - self.sent) {
            self.sent += 1;
            self.out.send(Parcel { number: self.sent, ..Parcel::default() });
            for take in &mut self.takes {
                match take.take() {
                    Some(parcel) if parcel.number == self.sent => {}
                    _ => return Err(Fault::new("a parcel is missing")),
                }
            }
        }
        self.whole += now() - begun;
        if self.sent < self.shared.messages {
            step.wake_at(step.now);
        } else {
            self.shared.end(self.whole);
        }
        Ok(())
    }
}

fn registry(shared: &Arc<Shared>) -> Registry {
    let (herald, ports, waker) = (shared.clone(), shared.clone(), shared.clone());
    Registry::new([
        AgentType::made_by(move |params| Herald { shared: herald.clone(), ..Herald::build(params) })
            .named("herald"),
        AgentType::of::<Listener>(),
        AgentType::made_by(move |params| Ports { shared: ports.clone(), ..Ports::build(params) }),
        AgentType::made_by(move |params| Crier { shared: waker.clone(), ..Crier::build(params) })
            .named("crier"),
    ])
}

/// A step of each receiver for each message: the mean of a message to all (ns).
fn steps(messages: usize, outcome: &mut Outcome) -> Result<f64, Failure> {
    let shared = Shared::of(messages);
    let mut plan = Plan::new("fanout");
    let herald = plan.add::<Herald>("herald", Default::default());
    plan.every("herald", Duration::secs(3600));
    plan.on("herald", "again");
    for number in 0..RECEIVERS {
        let name = format!("listener{number}");
        let listener = plan.add::<Listener>(&name, Default::default());
        plan.wire(&herald.out, &listener.take);
        plan.on(&name, "take");
        if number + 1 == RECEIVERS {
            plan.wire(&listener.give, &herald.again);
        }
    }
    super::on_one_executor(&mut plan);
    parcel::run(live(&plan, &registry(&shared), shared.options())?, outcome)?;
    shared.mean()
}

/// The ports alone: the mean of a message to all (ns).
fn ports(messages: usize, outcome: &mut Outcome) -> Result<f64, Failure> {
    let shared = Shared::of(messages);
    let mut plan = Plan::new("fanout");
    plan.add::<Ports>("ports", NoParams);
    plan.every("ports", Duration::secs(3600));
    plan.wires = NAMES.map(|name| WirePlan::new("ports.out", format!("ports.{name}"))).into();
    super::on_one_executor(&mut plan);
    parcel::run(live(&plan, &registry(&shared), shared.options())?, outcome)?;
    shared.mean()
}

/// Sends a parcel each time.
#[derive(Agent)]
struct Crier {
    /// What goes to all.
    out: Output<Parcel>,
    sent: u64,
    shared: Arc<Shared>,
}

impl Agent for Crier {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        if self.sent == self.shared.messages {
            self.shared.end(1);
            return Ok(());
        }
        self.sent += 1;
        self.out.send(Parcel { number: self.sent, ..Parcel::default() });
        Ok(())
    }
}

/// How often the thread of each of several executors is woken by a message to 16 receivers on it.
fn wakes(messages: usize, outcome: &mut Outcome) -> Result<Vec<f64>, Failure> {
    let shared = Shared::of(messages);
    let mut plan = Plan::new("fanout");
    let crier = plan.add::<Crier>("crier", Default::default());
    plan.every("crier", Duration::millis(2));
    plan.executors = ["ears0", "ears1", "ears2", "ears3", "one"]
        .map(|name| ExecutorPlan { cpus: vec![CPU], ..ExecutorPlan::new(name, None) })
        .into();
    for number in 0..RECEIVERS {
        let name = format!("listener{number}");
        let listener = plan.add::<Listener>(&name, Default::default());
        plan.wire(&crier.out, &listener.take);
        plan.on(&name, "take");
        if let Some(agent) = plan.agent_mut(&name) {
            agent.executor = Some(format!("ears{}", number % EXECUTORS));
        }
    }
    if let Some(agent) = plan.agent_mut("crier") {
        agent.executor = Some("one".into());
    }
    let live = live(&plan, &registry(&shared), shared.options())?;
    let shelf = Shelf::default();
    let (kept, over) = (shelf.clone(), shared.over.clone());
    // The counts are those of threads that live, so they are read before the run ends.
    let reads = thread("bench-reads", move || {
        let before = crate::bench::threads::sleeps("sinew-ears");
        while !over.load(Ordering::Acquire) {
            let now = crate::bench::threads::sleeps("sinew-ears");
            if !now.is_empty() {
                kept.take();
                kept.put(&now);
            }
            crate::terminal::pause(std::time::Duration::from_millis(1));
        }
        before.len()
    })?;
    let ran = parcel::run(live, outcome);
    shared.over.store(true, Ordering::Release);
    end(reads)?;
    ran?;
    // Of each executor there is a second thread that sleeps all the time.
    let sleeps = shelf.take().into_iter().filter(|sleeps| *sleeps > messages as f64 / 2.0);
    Ok(sleeps.map(|sleeps| sleeps / messages as f64).collect())
}

/// Rounds of ours and of `rtrb`, in turns.
pub(super) fn measure(setting: &Setting<'_>, outcome: &mut Outcome) -> Result<(), Failure> {
    let messages = setting.of(MESSAGES, 200);
    let mut turns = Turns::new(setting.peers.clone());
    let (mut with_steps, mut alone, mut theirs) = (Vec::new(), Vec::new(), Vec::new());
    // Of what it is told, a sixteenth goes to 64.
    let args = ["--iterations".to_owned(), (16 * messages).to_string(), "--cpu".to_owned(), CPU.to_string()];
    for _ in 0..setting.of(ROUNDS, if setting.shorter > 100 { 1 } else { 3 }) {
        with_steps.push(steps(messages, outcome)?);
        let mut round = turns.round("rtrb", &args);
        let means = turns.take(&mut round, "fanout64", "ns");
        if !means.is_empty() {
            theirs.push(mean(&means));
        }
        alone.push(ports(messages, outcome)?);
    }
    let beside =
        |ours: &[f64]| -> Vec<(f64, f64)> { ours.iter().copied().zip(theirs.iter().copied()).collect() };
    let (rounds, rounds_alone) = (beside(&with_steps), beside(&alone));
    outcome.figure("fanout64", "ns", with_steps);
    outcome.figure("fanout64_ports", "ns", alone);
    outcome.figure("fanout64_rtrb", "ns", theirs);
    if rounds.is_empty() {
        outcome.without("fanout64_ports/rtrb", None);
    } else {
        outcome.compare("fanout64_ports/rtrb", rounds_alone);
    }
    turns.compare(outcome, "fanout64/rtrb", rounds);
    let wakes = wakes(setting.of(WAKES, 50), outcome)?;
    outcome.figure("fanout64_wakes", "1", wakes);
    Ok(())
}
