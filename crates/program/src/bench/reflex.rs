//! From a contact to the zero command at the wheels: sensor, safety monitor, coordinator and gate, the ready-made agents, each on
//! the executor that it has in a robot, all on one processor.
//!
//! ```text
//!  gate 90          receive 80     reflex 70                        gate 90
//!  driver's poll ──▶ sonar ──────▶ safety monitor ─▶ coordinator ──▶ driver's drive
//! ```
//!
//! Beside it three bare threads of the same priorities on the same processor wake each other in the same order and do nothing else. A
//! third row is the same agents' places with agents that only hand on: what is between it and the bare threads is the runtime's, what
//! is above it are the algorithms.

use hardware::driver::{DriverError, Polled};
use hardware::gate::Permit;
use hardware::{Berth, ClockKind, Driver, Gate, Latch, Listening, RobotDescription, Sink};
use motion::kinematics::Differential;
use motion::limits::Limits;
use runtime::{
    Agent, AgentType, Declare as _, ExecutorPlan, Fault, Input, Output, Plan, Registry, Step, WirePlan,
};
use types::geometry::TAU;
use types::messages::{Echo, Echoes, Head, Offer, Twist};
use types::{Duration, Sequence, Time};

use super::Setting;
use super::outcome::{Measured, Outcome};
use super::parcel::{self, Parcel, Shelf, live, now, room};
use super::turns::Turns;
use crate::error::Failure;

/// The processor.
const CPU: usize = 0;
/// The driver's cycle. In every other one there is a contact.
const CYCLE: Duration = Duration::millis(1);
/// Contacts of a round, and rounds.
const CONTACTS: usize = 2000;
const ROUNDS: usize = 3;
/// Cycles before anything is kept.
const WARM_UP: u64 = 40;
/// The executors: those of a robot.
const EXECUTORS: [(&str, u8); 3] = [("gate", 90), ("receive", 80), ("reflex", 70)];
/// Speed while nothing is near (m/s).
const SPEED: f64 = 0.3;
/// Transducers of the ring; what the one ahead hears of a contact, and what all hear else (m).
const TRANSDUCERS: usize = 12;
const NEAR: f32 = 0.1;
const FAR: f32 = 4.0;

/// A robot whose ring of sonars sees something appear and go in turns.
struct Board {
    description: RobotDescription,
    cycle: u64,
    next: Time,
    /// When the contact was that has not been answered (ns); 0 when there is none.
    contact: u64,
    spans: Vec<f64>,
    shelf: Shelf,
}

impl Board {
    fn new(contacts: usize, shelf: Shelf) -> Board {
        let mut description = RobotDescription::bare("board", ClockKind::Wall);
        description.periods.sonar = Some(CYCLE);
        description.watchdog = Duration::secs(1);
        // As fast as the command says: a ramp is no part of the chain.
        let quick = Limits::indoor(Differential::new(0.1, 0.4));
        description.limits = Some(Limits {
            acceleration: 1e9,
            deceleration: 1e9,
            angular_acceleration: 1e9,
            wheel_max: 1e3,
            ..quick
        });
        let spans = room(contacts);
        Board { description, cycle: 0, next: Time::ZERO, contact: 0, spans, shelf }
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        self.shelf.put(&self.spans);
    }
}

fn ring(ahead: f32) -> Echoes {
    let mut echoes = Sequence::default();
    for number in 0..TRANSDUCERS {
        let bearing = number as f64 * TAU / TRANSDUCERS as f64;
        let range = if number == 0 { ahead } else { FAR };
        let (x, y) = ((0.2 * bearing.cos()) as f32, (0.2 * bearing.sin()) as f32);
        // There is room for all of them.
        let _ = echoes.push(Echo { x, y, bearing: bearing as f32, range });
    }
    Echoes { range_min: 0.03, range_max: 6.0, cone: 0.26, echoes }
}

impl Driver for Board {
    fn describe(&self) -> &RobotDescription {
        &self.description
    }

    fn poll(&mut self, time: Time, _: &Listening, sink: &mut dyn Sink) -> Result<Polled, DriverError> {
        if time >= self.next {
            self.next = time + CYCLE / 2;
            self.cycle += 1;
            let near = self.cycle.is_multiple_of(2);
            let echoes = ring(if near { NEAR } else { FAR });
            if near && self.cycle > WARM_UP {
                self.contact = now();
            }
            sink.sonar(time, &echoes);
        }
        Ok(Polled::default())
    }

    fn drive(&mut self, _: &Permit, _: Time, twist: Twist) -> Result<(), DriverError> {
        if self.contact != 0 && twist.linear == 0.0 {
            let span = now().saturating_sub(self.contact);
            self.shelf.keep(&mut self.spans, span as f64);
            self.contact = 0;
        }
        Ok(())
    }

    fn turn_head(&mut self, _: &Permit, _: Time, _: Head) -> Result<(), DriverError> {
        Ok(())
    }

    fn hold_head(&mut self, _: &Permit, _: Time) -> Result<(), DriverError> {
        Ok(())
    }
}

/// Wishes to drive straight on, for ever.
#[derive(Agent)]
struct Eager {
    /// The wish.
    wish: Output<Offer>,
}

impl Agent for Eager {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        let twist = Twist::new(SPEED, 0.0);
        self.wish.send(Offer { twist, weight: 1.0, valid_until: Time::NEVER, ..Offer::default() });
        Ok(())
    }
}

/// The ready-made agents of the chain behind a driver. Gives how long each contact took (ns).
fn robot(contacts: usize, outcome: &mut Outcome) -> Result<Vec<f64>, Failure> {
    let shelf = Shelf::default();
    let berth = Berth::with(Gate::new(Board::new(contacts, shelf.clone()), Latch::private()));
    let mut registry = agents::registry();
    registry.extend([berth.agent_type("robot"), AgentType::of::<Eager>()]);
    drop(berth);
    let mut plan = Plan::new("reflex");
    plan.add::<hardware::Robot>("robot", Default::default());
    plan.add::<agents::Sonar>("sonar", Default::default());
    plan.add::<agents::SafetyMonitor>("safety", Default::default());
    plan.add::<agents::Coordinator>("coordinator", Default::default());
    plan.add::<Eager>("eager", Default::default());
    plan.every("robot", CYCLE);
    plan.every("eager", Duration::millis(100));
    for (from, to) in [
        ("robot.sonar", "sonar.echoes"),
        ("sonar.raw", "safety.ranges"),
        ("safety.safety", "coordinator.safety"),
        ("coordinator.command", "robot.drive"),
        ("eager.wish", "coordinator.offers"),
    ] {
        plan.wires.push(WirePlan::new(from, to));
    }
    for (agent, input) in
        [("robot", "drive"), ("sonar", "echoes"), ("safety", "ranges"), ("coordinator", "safety")]
    {
        plan.on(agent, input);
    }
    place(&mut plan, [("robot", 0), ("sonar", 1), ("safety", 2), ("coordinator", 2)]);
    parcel::run(
        live(&plan, &registry, shelf.until_full(CYCLE * (2 * contacts as i64 + WARM_UP as i64)))?,
        outcome,
    )?;
    // The board is dropped with its gate, and that with the types that know its berth.
    drop(registry);
    Ok(shelf.take())
}

/// Puts agents on the executors of a robot, all on one processor.
fn place<const N: usize>(plan: &mut Plan, agents: [(&str, usize); N]) {
    for (name, priority) in EXECUTORS {
        plan.executors.push(ExecutorPlan { cpus: vec![CPU], ..ExecutorPlan::new(name, Some(priority)) });
    }
    for (agent, executor) in agents {
        if let Some(agent) = plan.agent_mut(agent) {
            agent.executor = Some(EXECUTORS[executor].0.into());
        }
    }
}

/// Where the chain begins and ends when its agents do nothing.
#[derive(Agent)]
struct Ends {
    /// What is back.
    back: Input<Parcel>,
    /// What goes.
    out: Output<Parcel>,
    next: Time,
    cycle: u64,
    spans: Vec<f64>,
    shelf: Shelf,
}

impl Agent for Ends {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        if let Some(parcel) = self.back.take() {
            let span = now().saturating_sub(parcel.sent);
            if parcel.number > WARM_UP {
                self.shelf.keep(&mut self.spans, span as f64);
            }
        }
        if step.now >= self.next {
            self.next = step.now + CYCLE / 2;
            self.cycle += 1;
            self.out.send(Parcel { sent: now(), number: self.cycle, ..Parcel::default() });
        }
        Ok(())
    }

    fn stop(&mut self, _: &mut Step) {
        self.shelf.put(&self.spans);
    }
}

/// Hands on.
#[derive(Agent)]
struct Relay {
    /// What comes.
    take: Input<Parcel>,
    /// What goes.
    give: Output<Parcel>,
}

impl Agent for Relay {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while let Some(parcel) = self.take.take() {
            self.give.send(*parcel);
        }
        Ok(())
    }
}

/// The same with agents that only hand on.
fn runtime_alone(contacts: usize, outcome: &mut Outcome) -> Result<Vec<f64>, Failure> {
    let shelf = Shelf::default();
    let kept = shelf.clone();
    let registry = Registry::new([
        AgentType::made_by(move |params| Ends {
            spans: room(contacts),
            shelf: kept.clone(),
            ..Ends::build(params)
        })
        .named("ends"),
        AgentType::of::<Relay>(),
    ]);
    let mut plan = Plan::new("reflex");
    let ends = plan.add::<Ends>("ends", Default::default());
    let hands = ["sensor", "safety", "coordinator"].map(|name| plan.add::<Relay>(name, Default::default()));
    plan.wire(&ends.out, &hands[0].take);
    plan.wire(&hands[0].give, &hands[1].take);
    plan.wire(&hands[1].give, &hands[2].take);
    plan.wire(&hands[2].give, &ends.back);
    plan.every("ends", CYCLE);
    plan.on("ends", "back");
    for name in ["sensor", "safety", "coordinator"] {
        plan.on(name, "take");
    }
    place(&mut plan, [("ends", 0), ("sensor", 1), ("safety", 2), ("coordinator", 2)]);
    let options = shelf.until_full(CYCLE * (contacts as i64 + WARM_UP as i64));
    parcel::run(live(&plan, &registry, options)?, outcome)?;
    Ok(shelf.take())
}

/// Rounds of ours and of the bare threads, in turns.
pub(super) fn measure(setting: &Setting<'_>) -> Result<Outcome, Failure> {
    let mut outcome = Outcome::default();
    let contacts = setting.of(CONTACTS, 50);
    let mut turns = Turns::new(setting.peers.clone());
    let (mut ours, mut thin, mut theirs) = (Vec::new(), Vec::new(), Vec::new());
    let words = [
        ("--iterations", contacts as u64),
        ("--period", 2 * CYCLE.0 as u64),
        ("--fifo", EXECUTORS[0].1.into()),
        ("--cpu", CPU as u64),
    ];
    let args: Vec<String> =
        words.iter().flat_map(|(name, value)| [(*name).to_owned(), value.to_string()]).collect();
    for _ in 0..setting.of(ROUNDS, if setting.shorter > 100 { 1 } else { 3 }) {
        ours.extend(robot(contacts, &mut outcome)?);
        let mut round = turns.round("chain", &args);
        theirs.extend(turns.take(&mut round, "chain", "ns"));
        thin.extend(runtime_alone(contacts, &mut outcome)?);
    }
    let (ours, theirs) =
        (Measured::new("reflex", "ns", ours), Measured::new("reflex_bare_chain", "ns", theirs));
    if ours.is_empty() {
        return Err(Failure::new("no contact was answered").code(1));
    }
    let thin = Measured::new("reflex_runtime_alone", "ns", thin);
    if theirs.is_empty() {
        outcome.without("reflex/bare_chain", turns.failure());
        outcome.figures.extend([ours, thin]);
    } else {
        outcome.compare_tails("reflex/bare_chain", &ours, &theirs);
        outcome.compare_tails("reflex_runtime_alone/bare_chain", &thin, &theirs);
        outcome.figures.extend([ours, thin, theirs]);
    }
    outcome.figure("program", "MB", mapped().map(|bytes| bytes as f64 * 1e-6).into_iter().collect());
    Ok(outcome)
}

/// How much of the program's file is mapped into memory (bytes): its code and its data, of every part, without what a debugger reads.
fn mapped() -> Option<u64> {
    let program = std::env::current_exe().ok()?;
    let maps = std::fs::read_to_string("/proc/self/maps").ok()?;
    let of_program = maps.lines().filter(|line| line.ends_with(&*program.to_string_lossy()));
    let ends = of_program.filter_map(|line| line.split(' ').next()?.split_once('-'));
    let address = |text: &str| u64::from_str_radix(text, 16).ok();
    ends.map(|(begin, end)| Some(address(end)? - address(begin)?)).sum()
}
