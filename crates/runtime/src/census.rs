//! What a resource manager sees of a running system and of the computer below it, and what it sets.

use std::sync::Arc;

use schedule::processors::{ANYWHERE, Mask};
use schedule::system::System;
use types::{Duration, Time};

use crate::means::Method;
use crate::plan::{AgentPlan, ExecutorPlan};
use crate::request::{AgentState, Counts, Refusal};

/// A running system at one moment.
#[derive(Clone, Debug)]
pub struct Census {
    /// When.
    pub now: Time,
    /// The system as the analysis sees it, with the timing that was asked for, and with costs as the plan declares them and what the runtime
    /// needs around a step. Its agents are those of `residents`, in the same order.
    pub system: System,
    /// Its executors, in the order of the system's.
    pub executors: Vec<ExecutorPlan>,
    /// Its agents.
    pub residents: Vec<Resident>,
    /// What the runtime needs around a step: it is in the costs of `system`.
    pub overhead: Duration,
    /// By how many percent of what was measured the next step is to be counted.
    pub percent: i64,
    /// Why what was set last was refused.
    pub refused: Option<Refusal>,
}

/// An agent at that moment.
#[derive(Clone, Debug)]
pub struct Resident {
    /// Its plan, as it is at the moment.
    pub plan: AgentPlan,
    /// Its plan, as it was asked for.
    pub nominal: AgentPlan,
    /// The methods of its type.
    pub methods: &'static [Method],
    /// Which of them it uses.
    pub method: usize,
    /// Whether it refines its results while it may.
    pub is_anytime: bool,
    /// The time between two messages that make it run, at the rates that were asked for; nothing where it runs by its period, or for none.
    pub gap: Option<Duration>,
    /// Whether its executor has a real-time priority.
    pub is_real_time: bool,
    /// Whether it is a robot's gate.
    pub is_robot: bool,
    /// How it is.
    pub state: AgentState,
    /// What was counted.
    pub counts: Counts,
    /// How long all its steps together used their processor.
    pub used: Duration,
    /// How many steps it made of late, and how long the longest of them used its processor: of the last half second to a second. In
    /// simulated time without virtual processors steps take none.
    pub recent: (u64, Duration),
}

/// What a resource manager gives an agent. What is nothing stays as it is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Given {
    /// Whom.
    pub agent: String,
    /// The time between two steps.
    pub period: Option<Duration>,
    /// The least time between two steps that messages make it run.
    pub gap: Option<Duration>,
    /// Its method.
    pub method: Option<&'static str>,
    /// How long a step may take with refinements.
    pub budget: Option<Duration>,
    /// Whether it is suspended.
    pub is_suspended: bool,
}

/// What the computer tells of its load, since it was asked last.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HostReading {
    /// How much of each processor was at work, from 0 to 1.
    pub processors: Vec<f32>,
    /// Processors' worth of work of other processes.
    pub foreign: f32,
    /// Other processes that have a real-time priority.
    pub burdens: Vec<Foreign>,
    /// Memory that this process uses (bytes).
    pub memory: u64,
    /// Memory that is left (bytes).
    pub memory_free: u64,
    /// Share of the time in which somebody waited for a processor, from 0 to 1, where the kernel tells.
    pub pressure_cpu: Option<f32>,
    /// The same for memory.
    pub pressure_memory: Option<f32>,
}

/// Work of another process with a real-time priority.
#[derive(Clone, Debug, PartialEq)]
pub struct Foreign {
    /// What it is called.
    pub name: String,
    /// Its priority; 0 for one that runs by its deadline, above all.
    pub priority: u8,
    /// Where it may run.
    pub may: Mask,
    /// How much of a processor it takes, from 0 to 1.
    pub share: f32,
}

/// Work of another process with a real-time priority, as a plan has it: for seeing what becomes of a system beside it.
#[derive(Clone, Debug, PartialEq)]
pub struct Burden {
    /// What it is called.
    pub name: String,
    /// Its priority, from 1 to 99.
    pub priority: u8,
    /// The processors on which it may run; all when empty.
    pub cpus: Vec<usize>,
    /// How much of a processor it takes, from 0 to 1.
    pub share: f64,
    /// The time between two pieces of its work.
    pub period: Duration,
    /// When it begins, counted from the start.
    pub from: Duration,
    /// When it ends.
    pub until: Duration,
}

impl Burden {
    /// One piece of its work.
    pub fn work(&self) -> Duration {
        Duration((self.period.0 as f64 * self.share) as i64)
    }
}

/// Processors as bits; all where none is named.
pub(crate) fn mask_of(cpus: &[usize]) -> Mask {
    let mask = cpus.iter().fold(0, |mask, cpu| mask | Mask::from(1u8) << (cpu & 63));
    if mask == 0 { ANYWHERE } else { mask }
}

/// Who tells of the load of the computer, for an ordinary thread: in simulated time the virtual processors do.
pub trait Host: Send {
    /// What there was since it was asked last.
    fn read(&mut self) -> HostReading;
}

/// Where it is read.
pub(crate) type SharedHost = Arc<std::sync::Mutex<Box<dyn Host>>>;
