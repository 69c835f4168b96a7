//! From a contact to the first slower command at the wheels, over the ready-made agents, each on the executor that it has in a robot, all on
//! one processor: once over sensor, safety monitor, coordinator and gate, once over laser, avoidance, coordinator, drive and gate.
//!
//! ```text
//!  gate 90          receive 80     reflex 70                                 gate 90
//!  driver's poll ──▶ sonar ──────▶ safety monitor ─▶ coordinator ───────────▶ driver's drive
//!  driver's poll ──▶ odometry ───▶ avoidance ──────▶ coordinator ─▶ drive ──▶ driver's drive
//! ```
//!
//! Beside them three bare threads of the same priorities on the same processor wake each other in the same order and do nothing else. A
//! further row is the same agents' places with agents that only hand on: what is between it and the bare threads is the runtime's, what
//! is above it are the algorithms. And papers told of their architectures how long they take from sensor to actuator.

mod board;
mod relays;

use agents::avoid::AvoidParams;
use agents::drive::DriveParams;
use hardware::{Berth, Gate, Latch};
use runtime::{Agent, AgentType, ExecutorPlan, Fault, Output, Plan, Step, WirePlan};
use serde_json::json;
use types::messages::{Offer, Twist};
use types::{Duration, Time};

use super::Setting;
use super::outcome::{Measured, Outcome};
use super::parcel::{self, Shelf, live};
use super::turns::Turns;
use crate::error::Failure;
use board::{Board, Eye};

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
/// From sensor to actuator, of other architectures as papers tell it (s): the chain of what reacts, and of all where both are told. They were
/// measured on robots of their time, with their motors and sensors.
const PAPERS: [(&str, Option<f64>, f64); 4] = [
    ("reactive layer of the paper", Some(0.02), 0.2),
    ("BERRA", None, 0.17),
    ("TeamBots", None, 0.4),
    ("Saphira", None, 0.6),
];

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

/// A chain of ready-made agents behind a driver.
struct Chain {
    eye: Eye,
    /// Adds the agents to the plan of a robot.
    agents: fn(&mut Plan),
    wires: &'static [(&'static str, &'static str)],
    /// What makes an agent run, and the place of its executor among those of a robot.
    on: &'static [(&'static str, &'static str, usize)],
}

/// From a sonar over the safety monitor to the coordinator.
const SAFETY: Chain = Chain {
    eye: Eye::Sonar,
    agents: |plan| {
        plan.add::<agents::Sonar>("sonar", Default::default());
        plan.add::<agents::SafetyMonitor>("safety", Default::default());
        plan.add::<agents::Coordinator>("coordinator", Default::default());
        plan.add::<Eager>("eager", Default::default());
        plan.every("eager", Duration::millis(100));
    },
    wires: &[
        ("robot.sonar", "sonar.echoes"),
        ("sonar.raw", "safety.ranges"),
        ("safety.safety", "coordinator.safety"),
        ("coordinator.command", "robot.drive"),
        ("eager.wish", "coordinator.offers"),
    ],
    on: &[
        ("robot", "drive", 0),
        ("sonar", "echoes", 1),
        ("safety", "ranges", 2),
        ("coordinator", "safety", 2),
    ],
};

/// From a laser, and wheels that are counted, over the avoidance and the coordinator to the drive.
const AVOIDANCE: Chain = Chain {
    eye: Eye::Laser,
    agents: |plan| {
        plan.add::<agents::DeadReckoning>("odometry", Default::default());
        let avoid =
            AvoidParams { has_goal: true, goal_x: 1000.0, linear_max: SPEED, ..AvoidParams::default() };
        plan.add::<agents::Avoid>("avoid", avoid);
        plan.add::<agents::Coordinator>("coordinator", Default::default());
        // What the wheels can do in a cycle of the driver is little, but it shows.
        let quick = DriveParams { acceleration: 20.0, deceleration: 20.0, ..DriveParams::default() };
        plan.add::<agents::DriveBase>("drive", quick);
    },
    wires: &[
        ("robot.ticks", "odometry.ticks"),
        ("odometry.odometry", "avoid.odometry"),
        ("robot.scan", "avoid.scan"),
        ("avoid.drive", "coordinator.offers"),
        ("coordinator.command", "drive.wish"),
        ("drive.command", "robot.drive"),
    ],
    on: &[
        ("robot", "drive", 0),
        ("odometry", "ticks", 1),
        ("avoid", "scan", 2),
        ("coordinator", "offers", 2),
        ("drive", "wish", 2),
    ],
};

impl Chain {
    /// Gives how long each contact took (ns).
    fn run(&self, contacts: usize, outcome: &mut Outcome) -> Result<Vec<f64>, Failure> {
        let shelf = Shelf::default();
        let board = Board::new(self.eye, contacts, shelf.clone());
        let berth = Berth::with(Gate::new(board, Latch::private()));
        let mut registry = agents::registry();
        registry.extend([berth.agent_type("robot"), AgentType::of::<Eager>()]);
        drop(berth);
        let mut plan = Plan::new("reflex");
        plan.add::<hardware::Robot>("robot", Default::default());
        plan.every("robot", CYCLE);
        (self.agents)(&mut plan);
        plan.wires.extend(self.wires.iter().map(|(from, to)| WirePlan::new(*from, *to)));
        self.on.iter().for_each(|(agent, input, _)| plan.on(agent, input));
        place(&mut plan, self.on.iter().map(|(agent, _, executor)| (*agent, *executor)));
        let length = CYCLE * (2 * contacts as i64 + WARM_UP as i64);
        parcel::run(live(&plan, &registry, shelf.until_full(length))?, outcome)?;
        // The board is dropped with its gate, and that with the types that know its berth.
        drop(registry);
        Ok(shelf.take())
    }
}

/// Puts agents on the executors of a robot, all on one processor.
fn place<'a>(plan: &mut Plan, agents: impl IntoIterator<Item = (&'a str, usize)>) {
    for (name, priority) in EXECUTORS {
        plan.executors.push(ExecutorPlan { cpus: vec![CPU], ..ExecutorPlan::new(name, Some(priority)) });
    }
    for (agent, executor) in agents {
        if let Some(agent) = plan.agent_mut(agent) {
            agent.executor = Some(EXECUTORS[executor].0.into());
        }
    }
}

/// Rounds of ours and of the bare threads, in turns.
pub(super) fn measure(setting: &Setting<'_>) -> Result<Outcome, Failure> {
    let mut outcome = Outcome::default();
    let contacts = setting.of(CONTACTS, 50);
    let mut turns = Turns::new(setting.peers.clone());
    let (mut ours, mut avoiding, mut thin, mut theirs) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let words = [
        ("--iterations", contacts as u64),
        ("--period", 2 * CYCLE.0 as u64),
        ("--fifo", EXECUTORS[0].1.into()),
        ("--cpu", CPU as u64),
    ];
    let args: Vec<String> =
        words.iter().flat_map(|(name, value)| [(*name).to_owned(), value.to_string()]).collect();
    for _ in 0..setting.of(ROUNDS, if setting.shorter > 100 { 1 } else { 3 }) {
        ours.extend(SAFETY.run(contacts, &mut outcome)?);
        let mut round = turns.round("chain", &args);
        theirs.extend(turns.take(&mut round, "chain", "ns"));
        avoiding.extend(AVOIDANCE.run(contacts, &mut outcome)?);
        thin.extend(relays::run(contacts, &mut outcome)?);
    }
    let (ours, theirs) =
        (Measured::new("reflex", "ns", ours), Measured::new("reflex_bare_chain", "ns", theirs));
    let avoiding = Measured::new("reflex_avoid", "ns", avoiding);
    if ours.is_empty() || avoiding.is_empty() {
        return Err(Failure::new("no contact was answered").code(1));
    }
    let thin = Measured::new("reflex_runtime_alone", "ns", thin);
    beside_papers(&mut outcome, [&ours, &avoiding]);
    if theirs.is_empty() {
        outcome.without("reflex/bare_chain", turns.failure());
        outcome.figures.extend([ours, avoiding, thin]);
    } else {
        outcome.compare_tails("reflex/bare_chain", &ours, &theirs);
        outcome.compare_tails("reflex_avoid/bare_chain", &avoiding, &theirs);
        outcome.compare_tails("reflex_runtime_alone/bare_chain", &thin, &theirs);
        outcome.figures.extend([ours, avoiding, thin, theirs]);
    }
    outcome.figure("program", "MB", mapped().map(|bytes| bytes as f64 * 1e-6).into_iter().collect());
    Ok(outcome)
}

/// Tells what papers say of their architectures beside ours.
fn beside_papers(outcome: &mut Outcome, [safety, avoidance]: [&Measured; 2]) {
    let seconds = |value: f64| format!("{value} s");
    let mut rows = vec![["sensor to actuator", "what reacts", "all"].map(str::to_owned)];
    for (name, ours) in
        [("safety monitor, coordinator", safety), ("avoidance, coordinator, drive", avoidance)]
    {
        rows.push([
            name.to_owned(),
            format!("{} (99 of 100)", crate::run::span(ours.at(0.99))),
            "-".to_owned(),
        ]);
    }
    let told = |(name, reacts, all): (&str, Option<f64>, f64)| {
        [name.to_owned(), reacts.map_or("-".to_owned(), seconds), seconds(all)]
    };
    rows.extend(PAPERS.map(told));
    outcome.text(crate::run::table(&rows, 1));
    let row = |(name, reacts, all): (&str, Option<f64>, f64)| json!({"name": name, "reactive_s": reacts, "all_s": all});
    outcome.add("papers", json!(PAPERS.map(row)));
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
