//! The registry of agents, ports and wires: who is there, who talks to whom. Never on a message's path.
//!
//! What is asked for is first *staged*: checked and allocated, and written into the registry, from which it can still be taken back
//! without anybody having noticed. When all of it is right and all executors concerned answer, it is decided, and what it takes is given to
//! them, one thing after another ([`script`]); each commits its part between two of its steps, and what comes back is freed here. From
//! then on the registry is the truth that the executors follow: one that does not answer does its part when it does.
//!
//! The order is fixed: the receiver joins before the sender adds; the sender forgets before the receiver leaves, and a receiver that is
//! not drained yet is asked again.

mod admission;
mod agents;
mod asking;
mod calls;
mod deaths;
mod managing;
mod order;
mod queues;
mod requests;
mod script;
mod staged;
#[cfg(all(test, not(loom)))]
mod tests;
mod timing;
mod view;
mod wires;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use types::value::Table;
use types::{AgentId, Duration, Filter, Priority, Time};

use crate::agent::{AgentType, Body, Registry};
use crate::budget::budget_of;
use crate::executor::{HEAVY, Link, StepFault, Timing};
use crate::log::{LogChoice, LogShared};
use crate::means::Means;
use crate::names::Directory;
use crate::plan::{AgentPlan, ExecutorPlan, WireFilter, WirePlan};
use crate::port::{Direction, InputEnd, OutputEnd, OutputFault, PortEnds, WireCounts, WireId};
use crate::queue_plan::PlanParts;
use crate::request::{AgentState, Refusal, WireTotals};
use crate::ring::Overload;
use crate::stats::{AgentStats, Window};
use crate::tap::Tap;

pub use admission::Admission;
pub(crate) use admission::{AS_PLAYED, WITH_MARGIN};
pub(crate) use asking::Said;
pub(crate) use calls::OutsideCall;
pub use calls::ServiceShape;
pub(crate) use staged::Staged;
pub use timing::{TIMING_KEYS, with_set};
pub(crate) use wires::commanded_by_two;

use timing::Nominal;

/// Readers for which an output's memory has room besides those in the plan.
const SPARE_SEATS: usize = 8;

/// Unless the plan says otherwise, a step hangs when it takes four times its deadline, and at least this.
const LEAST_HANG: Duration = Duration::millis(50);

/// How the router gets an executor to serve its changes: by waking its thread, or by doing it on the spot.
pub(crate) trait Fabric {
    /// Tells an executor that changes wait for it.
    fn ring(&mut self, executor: usize);
    /// Gives the executors some time. Says whether to go on waiting.
    fn wait(&mut self) -> bool;
}

struct Known {
    id: AgentId,
    /// How many were added before it.
    added: u64,
    kind: AgentType,
    plan: AgentPlan,
    params: Table,
    executor: usize,
    slot: u32,
    ends: Vec<PortEnds>,
    /// For each port, how many rings lead into and out of it, those that are being cut among them.
    rings: Vec<Rings>,
    /// The wires that touch it.
    wires: BTreeSet<WireId>,
    stats: Arc<AgentStats>,
    /// What its steps took of late, for resource managers and for admission.
    window: Window,
    long_window: Window,
    /// What it was admitted with: what a longer step is told of.
    admitted: Option<Duration>,
    /// What its plan says, or a person, where the resource manager has set something else.
    nominal: Nominal,
    timing: Timing,
    fault: StepFault,
    output_faults: Vec<OutputFault>,
    state: AgentState,
    restart_at: Time,
    /// Whether its executor has been told to start it again, and has not answered yet.
    starting: bool,
    deaths: Vec<Time>,
    last_death: Option<String>,
    /// Built ahead, so that a restart waits for nothing.
    spare: Option<Box<dyn Body>>,
}

/// How many rings lead into and out of a port.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Rings {
    into: usize,
    out: usize,
}

impl Known {
    /// The priorities that a port of it uses, the most urgent first.
    fn priorities(&self, port: usize) -> Vec<Priority> {
        let mut priorities: Vec<Priority> = self.kind.ports[port].options.priorities().collect();
        priorities.sort_unstable_by(|a, b| b.cmp(a));
        if priorities.is_empty() {
            priorities.push(Priority::Normal);
        }
        priorities
    }

    /// The inputs that make it run.
    fn on(&self) -> Vec<Arc<dyn InputEnd>> {
        let inputs = (0..self.ends.len()).filter(|port| self.wakes(*port));
        inputs.filter_map(|port| self.ends[port].input.clone()).collect()
    }

    /// One ring more or less leads into a port.
    fn joined(&mut self, port: usize, by: isize) {
        let into = &mut self.rings[port].into;
        *into = into.saturating_add_signed(by);
    }

    /// One ring more or less leads out of a port.
    fn routed(&mut self, port: usize, by: isize) {
        let out = &mut self.rings[port].out;
        *out = out.saturating_add_signed(by);
    }

    /// Whether a message for this port makes it run. Answers and decisions do, wherever they come from.
    fn wakes(&self, port: usize) -> bool {
        let direction = self.kind.ports[port].shape.direction;
        matches!(direction, Direction::Client | Direction::Router) || self.is_on(port)
    }

    /// Whether its plan says that it runs for this port.
    fn is_on(&self, port: usize) -> bool {
        let name = self.kind.ports[port].name;
        self.plan.on.iter().any(|on| on == name)
    }
}

/// What is to be known of an agent whose step is played on a virtual processor.
pub(crate) struct Played {
    pub of: AgentId,
    /// Where it sends.
    pub outputs: Vec<Arc<dyn OutputEnd>>,
    /// What its step takes without refinements.
    pub cost: Duration,
    /// What one refinement takes.
    pub refinement: Duration,
    /// How long it may take with them; zero where there are none.
    pub budget: Duration,
}

/// A port of an agent.
type PortId = (AgentId, usize);

#[derive(Clone)]
struct Wire {
    id: WireId,
    /// Its number in the ports, which is another one when an agent that is lost gets new ports.
    ring: WireId,
    from: PortId,
    to: PortId,
    /// The wire of the answers, for a client and a service.
    partner: Option<WireId>,
    /// Whether it is the partner of another, and so is not shown.
    is_answer: bool,
    depth: usize,
    overload: Overload,
    filter: WireFilter,
    /// The same with the number of the recipient.
    passes: Filter,
    counts: Arc<WireCounts>,
    /// What was counted before it had its present rings.
    past: WireTotals,
}

/// An executor as the router knows it.
pub(crate) struct ExecutorKnown {
    pub plan: ExecutorPlan,
    pub link: Link,
    /// The scheduling that the thread got, once it runs.
    pub granted: String,
    /// Who sits where. A place is free when the executor has let go of it.
    slots: Vec<Option<AgentId>>,
    /// For how many agents it was given room.
    room: usize,
    /// The number of the last change to which it has answered.
    answered: u64,
    /// What that was when it was last told that there is room for more answers.
    rung_at: u64,
}

/// Something that the supervisor did or saw, to be told to people.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Incident {
    /// When.
    pub time: Time,
    /// Which agent.
    pub agent: String,
    /// What.
    pub what: String,
}

impl Incident {
    /// What was asked from outside and is told at the end of the run: faults, in words, and what came of it.
    pub(crate) fn of_faults(faults: Vec<String>, time: Time, outcome: &str) -> Vec<Incident> {
        let incident =
            |fault| Incident { time, agent: "control".into(), what: format!("asked: {fault}{outcome}") };
        faults.into_iter().map(incident).collect()
    }
}

/// The registry of agents, ports and wires.
pub(crate) struct Router {
    name: String,
    registry: Registry,
    agents: BTreeMap<AgentId, Known>,
    /// In the order of names: agents that are free to go first in the data flow go so.
    names: BTreeMap<String, AgentId>,
    wires: BTreeMap<WireId, Wire>,
    queues: Vec<queues::Queue>,
    asking: asking::Asking,
    managing: managing::Managing,
    pub executors: Vec<ExecutorKnown>,
    added: u64,
    next_wire: u32,
    /// The number of the last caller from outside.
    next_caller: u32,
    /// Calls from outside that wait for their answers.
    calls: Vec<calls::UnderWay>,
    pub incidents: Vec<Incident>,
    /// At least as many as wait to be started again: who is dead is looked for only when somebody is.
    restarting: usize,
    /// What was decided and is not done yet, in the order of the decisions.
    scripts: Vec<script::Script>,
    next_script: u64,
    /// Rings whose receivers have messages to take yet.
    leaving: Vec<script::Leaving>,
    /// What went over wires that are cut.
    past: WireTotals,
    /// The time of the request that is being done, or of the last look.
    now: Time,
    /// What admission counts with; nothing where everything is admitted.
    admission: Option<Admission>,
    /// What was analysed last, and how often that was done.
    analysed: Option<Arc<admission::Analysed>>,
    analyses: u64,
    /// By how many percent of what was measured of late the next step is counted, where steps are measured: in simulated time what the host
    /// took for them says nothing, and what they were played to take is exact.
    pub measures: Option<i64>,
    /// Whether on the wall clock steps take what is declared for them.
    pub as_declared: bool,
    /// When it was last looked whether somebody has outgrown what it was admitted with.
    grown_at: Time,
    /// When it was last looked at what steps took of late.
    windows_at: Time,
    log: LogChoice,
    pub log_shared: Arc<LogShared>,
    robots: Vec<String>,
    directory: Arc<Directory>,
}

type Reply<T> = Result<T, Refusal>;

impl Router {
    pub(crate) fn new(
        name: &str,
        registry: Registry,
        executors: Vec<ExecutorKnown>,
        robots: Vec<String>,
        directory: Arc<Directory>,
    ) -> Router {
        Router {
            name: name.to_owned(),
            registry,
            agents: BTreeMap::new(),
            names: BTreeMap::new(),
            wires: BTreeMap::new(),
            queues: Vec::new(),
            asking: asking::Asking::default(),
            managing: managing::Managing::default(),
            executors,
            added: 0,
            next_wire: 0,
            next_caller: AgentId::NONE.0,
            calls: Vec::new(),
            incidents: Vec::new(),
            restarting: 0,
            scripts: Vec::new(),
            next_script: 0,
            leaving: Vec::new(),
            past: WireTotals::default(),
            now: Time::ZERO,
            admission: None,
            analysed: None,
            analyses: 0,
            measures: None,
            as_declared: false,
            grown_at: Time(i64::MIN / 2),
            windows_at: Time(i64::MIN / 2),
            log: LogChoice::default(),
            log_shared: LogShared::new(),
            robots,
            directory,
        }
    }

    /// Says which outputs are logged.
    pub(crate) fn set_log(&mut self, log: LogChoice) {
        self.log = log;
    }

    /// Listens to an output.
    pub(crate) fn tap(&mut self, port: &str) -> Reply<Tap> {
        let end = self.output(port)?;
        let mut topics = self.log_shared.topics();
        let number = topics.outputs.iter().position(|(known, _)| known == port).unwrap_or(0);
        let tap = Tap::new(port, (end.message_type().definition)());
        topics.taps.push((number as u32, tap.clone()));
        end.set_log(number as u32, 1);
        Ok(tap)
    }

    /// Ends listening.
    pub(crate) fn untap(&mut self, tap: &Tap) {
        let mut topics = self.log_shared.topics();
        let Some(at) = topics.taps.iter().position(|(_, known)| known.is(tap)) else { return };
        let (number, _) = topics.taps.remove(at);
        let others = topics.taps.iter().any(|(tapped, _)| *tapped == number);
        let every = topics.every.get(number as usize).copied().unwrap_or(0);
        drop(topics);
        // Without the agent there is no output any more that could be told.
        if !others && let Ok(end) = self.output(tap.name()) {
            end.set_log(number, every);
        }
    }

    pub(crate) fn agents_count(&self) -> usize {
        self.agents.len()
    }

    /// How long a step of the agent in this slot may last before it is taken for one that does not return.
    pub(crate) fn hang_limit(&self, executor: usize, slot: u32) -> Duration {
        self.seated(executor, slot).map_or(LEAST_HANG, |known| known.timing.hang_after)
    }

    /// The agent in a slot, where it sends, and what its step takes.
    pub(crate) fn played(&self, executor: usize, slot: u32) -> Option<Played> {
        let known = self.seated(executor, slot)?;
        let outputs = known.ends.iter().filter_map(|ends| ends.output.clone());
        let times = if known.fault == StepFault::Heavy { HEAVY } else { 1 };
        Some(Played {
            of: known.id,
            outputs: outputs.collect(),
            cost: known.plan.cost_of_step(known.kind.methods).unwrap_or(Duration::ZERO) * times,
            refinement: known.plan.refinement.unwrap_or(Duration::ZERO) * times,
            budget: known.timing.means.budget,
        })
    }

    /// Who sits in a slot.
    fn seated(&self, executor: usize, slot: u32) -> Option<&Known> {
        let id = self.executors[executor].slots.get(slot as usize).copied().flatten()?;
        self.agents.get(&id)
    }

    fn id_of(&self, name: &str) -> Reply<AgentId> {
        self.names.get(name).copied().ok_or_else(|| {
            Refusal::unknown("agent", name, self.in_order().into_iter().map(|agent| agent.plan.name.as_str()))
        })
    }

    /// The agent of this name, or that of this port, where there is one: who only looks needs no words for that there is none.
    fn owner_of(&self, name: &str) -> Option<&Known> {
        let agent = self.names.get(name).or_else(|| self.names.get(name.rsplit_once('.')?.0))?;
        self.by_id(*agent)
    }

    fn known(&self, name: &str) -> Reply<&Known> {
        self.id_of(name).map(|id| &self.agents[&id])
    }

    /// All agents, in the order in which they were added.
    fn in_order(&self) -> Vec<&Known> {
        let mut agents: Vec<&Known> = self.agents.values().collect();
        agents.sort_unstable_by_key(|known| known.added);
        agents
    }

    fn by_id(&self, id: AgentId) -> Option<&Known> {
        self.agents.get(&id)
    }

    /// What is known of an agent that is there.
    fn of_mut(&mut self, id: AgentId, change: impl FnOnce(&mut Known)) {
        if let Some(known) = self.agents.get_mut(&id) {
            change(known);
        }
    }

    /// The port named `agent.port`.
    fn port(&self, name: &str) -> Reply<PortId> {
        let (agent, port) = name.rsplit_once('.').ok_or_else(|| {
            Refusal::new(format!("\"{name}\" is no port")).help("write it as in \"sonar.filtered\"")
        })?;
        let known = self.known(agent)?;
        let ports = &known.kind.ports;
        let place = ports.iter().position(|known| known.name == port).ok_or_else(|| {
            let names = ports.iter().map(|known| known.name);
            Refusal::unknown(&format!("port of {}", known.plan.name), port, names)
        })?;
        Ok((known.id, place))
    }

    /// When an agent of this type runs, how, and for how long.
    fn timing_for(&self, plan: &AgentPlan, kind: &AgentType) -> Reply<Timing> {
        let mut timing = timing_as(plan, kind)?;
        timing.means.fills = self.as_declared && timing.means.cost > Duration::ZERO;
        Ok(timing)
    }

    fn executor_for(&self, plan: &AgentPlan, timing: Timing) -> Reply<usize> {
        let name = plan.executor.as_deref().unwrap_or(usual_executor(timing.deadline));
        self.executors.iter().position(|executor| executor.plan.name == name).ok_or_else(|| {
            Refusal::unknown("executor", name, self.executors.iter().map(|e| e.plan.name.as_str()))
        })
    }

    /// Refuses an agent that needs what its executor cannot give, where that runs by its agent's deadline.
    fn check_budget(&self, plan: &AgentPlan, timing: &Timing, executor: usize) -> Reply<()> {
        let on = &self.executors[executor].plan;
        if !on.is_by_deadline() {
            return Ok(());
        }
        let mut agents = self.agents.values().filter(|known| known.executor == executor);
        if let Some(other) = agents.find(|known| known.plan.name != plan.name) {
            return Err(has_its_agent(&on.name, &other.plan.name, &plan.name));
        }
        budget_of(plan, timing).map(drop).map_err(all)
    }

    fn output(&self, port: &str) -> Reply<Arc<dyn OutputEnd>> {
        let (agent, place) = self.port(port)?;
        let known = &self.agents[&agent];
        let end = known.ends[place].output.clone();
        end.ok_or_else(|| {
            let outputs: Vec<&str> =
                known.kind.ports.iter().filter(|p| p.shape.output.is_some()).map(|p| p.name).collect();
            Refusal::new(format!("{port} sends nothing")).help(format!(
                "{} sends: {}",
                known.plan.name,
                outputs.join(", ")
            ))
        })
    }

    /// The running system as a plan that would start it: with what was asked for, not with what the resource manager makes of it.
    pub(crate) fn to_plan(&self) -> PlanParts {
        let mut parts = self.to_plan_as_it_is();
        for (plan, known) in parts.0.iter_mut().zip(self.in_order()) {
            known.nominal.put(plan);
        }
        parts
    }

    /// The running system as it is at the moment.
    pub(crate) fn to_plan_as_it_is(&self) -> PlanParts {
        let agents = self.in_order().into_iter();
        let agents = agents.map(|known| AgentPlan { params: known.params.clone(), ..known.plan.clone() });
        let wires = self.wires.values().filter(|wire| !wire.is_answer).map(|wire| self.plan_of(wire));
        let (queues, to_queues) = self.plans_of_queues();
        (agents.collect(), queues, wires.chain(to_queues).collect())
    }
}

impl ExecutorKnown {
    /// Whether any agent is on it.
    pub(crate) fn is_used(&self) -> bool {
        self.slots.iter().any(Option::is_some)
    }

    pub(crate) fn new(plan: ExecutorPlan, link: Link) -> ExecutorKnown {
        ExecutorKnown {
            plan,
            link,
            granted: "simulated".into(),
            slots: Vec::new(),
            room: 0,
            answered: 0,
            rung_at: 0,
        }
    }
}

/// The wires that join an agent of this type to the robot: each port that names a port of the robot.
pub fn robot_wires(plan: &AgentPlan, kind: &AgentType, robot: &str) -> Vec<WirePlan> {
    let mut wires = Vec::new();
    for port in &kind.ports {
        let Some(name) = port.options.robot else { continue };
        let (own, robots) = (format!("{}.{}", plan.name, port.name), format!("{robot}.{name}"));
        wires.push(match port.shape.direction {
            Direction::Input => WirePlan::new(robots, own),
            _ => WirePlan::new(own, robots),
        });
    }
    for wire in &mut wires {
        wire.at = plan.at;
    }
    wires
}

/// Why an agent cannot come to an executor that runs by the deadline of another.
pub(crate) fn has_its_agent(executor: &str, agent: &str, other: &str) -> Refusal {
    Refusal::new(format!(
        "executor \"{executor}\" runs by the deadline of {agent}, and has no room for {other}"
    ))
    .help("give each an executor of its own")
}

/// All reasons in one.
fn all(refusals: Vec<Refusal>) -> Refusal {
    let mut refusals = refusals.into_iter();
    let mut refusal = refusals.next().unwrap_or_else(|| Refusal::new("it cannot be"));
    for more in refusals {
        refusal.what = format!("{}; {}", refusal.what, more.what);
    }
    refusal
}

fn first(mistakes: Vec<types::value::Mistake>) -> Refusal {
    let mut mistakes = mistakes.into_iter();
    let mut refusal = mistakes.next().map_or_else(|| Refusal::new("the parameters are wrong"), Refusal::from);
    for more in mistakes {
        refusal.what = format!("{}; {more}", refusal.what);
    }
    refusal
}

/// The executor of an agent that names none.
pub(crate) fn usual_executor(deadline: Duration) -> &'static str {
    match deadline {
        deadline if deadline <= Duration::ZERO => "ordinary",
        deadline if deadline <= Duration::millis(10) => "reflex",
        deadline if deadline <= Duration::millis(100) => "control",
        _ => "ordinary",
    }
}

/// The usual deadline of an agent that only messages make run.
const DEADLINE_ON: Duration = Duration::millis(100);

/// Reads and checks when an agent runs.
pub(crate) fn timing_of(plan: &AgentPlan) -> Result<Timing, Refusal> {
    let name = &plan.name;
    let period = plan.period.unwrap_or(Duration::ZERO);
    if plan.period.is_some_and(|period| period <= Duration::ZERO) {
        return Err(Refusal::new(format!("the period of {name} must be longer than zero, not {period}")));
    }
    if plan.period.is_none() && plan.on.is_empty() {
        return Err(Refusal::new(format!("{name} would never run"))
            .help("give it a period, or name the inputs it is on"));
    }
    if let Some(cost) = plan.cost.filter(|cost| *cost < Duration::ZERO) {
        return Err(Refusal::new(format!("the cost of {name} is {cost}; no step gives time back")));
    }
    if plan.wake_gap < Duration::ZERO {
        let what = format!("the wake_gap of {name} is {}; no step comes before the last one", plan.wake_gap);
        return Err(Refusal::new(what).help("write wake_gap = \"50ms\", say"));
    }
    let usual = plan.period.unwrap_or(DEADLINE_ON);
    let deadline = plan.deadline.unwrap_or(usual);
    if deadline <= Duration::ZERO || plan.period.is_some_and(|period| deadline > period) {
        return Err(Refusal::new(format!(
            "the deadline of {name} must lie between zero and its period ({usual}), not {deadline}"
        )));
    }
    let hang_after = plan.hang_after.unwrap_or((deadline * 4).max(LEAST_HANG));
    let means = Means::PLAIN;
    let AgentPlan { min_gap, wake_gap, .. } = *plan;
    let mut timing = Timing { period, deadline, min_gap, wake_gap, hang_after, budget: None, means };
    timing.budget = budget_of(plan, &timing).ok();
    Ok(timing)
}

/// The same of an agent of this type, with what it may use.
pub(crate) fn timing_as(plan: &AgentPlan, kind: &AgentType) -> Result<Timing, Refusal> {
    let means = Means::of(plan, kind).map_err(all)?;
    Ok(Timing { means, ..timing_of(plan)? })
}
