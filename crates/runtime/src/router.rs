//! The registry of agents, ports and wires: who is there, who talks to whom. Never on a message's path.
//!
//! A change is prepared here (checked, allocated), committed by each executor concerned between two of its steps, and retired
//! here once all have answered. The order is fixed: the receiver joins before the sender adds; the sender forgets before the
//! receiver leaves, and a receiver that is not drained yet is asked again.

mod agents;
mod calls;
mod changes;
mod deaths;
mod queues;
mod requests;
mod view;
mod wires;

use std::sync::Arc;

use types::value::Table;
use types::{AgentId, Duration, Priority, Time};

use crate::agent::{AgentType, Body, Registry};
use crate::executor::{Answer, Link, Timing};
use crate::log::{LogChoice, LogShared};
use crate::names::Directory;
use crate::plan::{AgentPlan, ExecutorPlan, WireFilter, WirePlan};
use crate::port::{Direction, InputEnd, OutputEnd, PortEnds, WireCounts, WireId};
use crate::queue_plan::PlanParts;
use crate::request::{AgentState, Refusal};
use crate::ring::Overload;
use crate::stats::AgentStats;
use crate::tap::Tap;

pub(crate) use calls::OutsideCall;
pub use calls::ServiceShape;

/// Readers for which an output's memory has room besides those in the plan.
const SPARE_SEATS: usize = 8;

/// Unless the plan says otherwise, a step hangs when it takes four times its deadline, and at least this.
const LEAST_HANG: Duration = Duration::millis(50);

/// How the router gets an executor to serve its changes: by waking its thread and waiting, or by doing it on the spot.
pub(crate) trait Fabric {
    /// Makes the executor serve what was given to it, or gives it time to. Says whether to go on waiting.
    fn pump(&mut self, executor: usize) -> bool;
    /// The executor has answered.
    fn answered(&mut self) {}
}

struct Known {
    id: AgentId,
    kind: AgentType,
    plan: AgentPlan,
    params: Table,
    executor: usize,
    slot: u32,
    ends: Vec<PortEnds>,
    stats: Arc<AgentStats>,
    timing: Timing,
    state: AgentState,
    restart_at: Time,
    deaths: Vec<Time>,
    last_death: Option<String>,
    /// Built ahead, so that a restart waits for nothing.
    spare: Option<Box<dyn Body>>,
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
}

/// What an executor made of a change.
enum Committed {
    Done,
    /// The wire has messages still.
    NotDrained,
}

/// An end of a wire that is no more, which an executor did not let go of because it did not answer.
struct Owed {
    executor: usize,
    wire: WireId,
    end: OwedEnd,
}

enum OwedEnd {
    /// Somebody sends still, into a mailbox that nobody reads.
    Forget(Arc<dyn OutputEnd>),
    /// Nobody sends any more.
    Leave(Arc<dyn InputEnd>),
}

struct Wire {
    id: WireId,
    from: (AgentId, usize),
    to: (AgentId, usize),
    /// The wire of the answers, for a client and a service.
    partner: Option<WireId>,
    /// Whether it is the partner of another, and so is not shown.
    is_answer: bool,
    depth: usize,
    overload: Overload,
    filter: WireFilter,
    counts: Arc<WireCounts>,
}

/// An executor as the router knows it.
pub(crate) struct ExecutorKnown {
    pub plan: ExecutorPlan,
    pub link: Link,
    /// The scheduling that the thread got, once it runs.
    pub granted: String,
    slots: Vec<bool>,
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

/// The registry of agents, ports and wires.
pub(crate) struct Router {
    name: String,
    registry: Registry,
    agents: Vec<Known>,
    wires: Vec<Wire>,
    queues: Vec<queues::Queue>,
    pub executors: Vec<ExecutorKnown>,
    next_agent: u32,
    next_wire: u32,
    /// The number of the last caller from outside.
    next_caller: u32,
    /// Calls from outside that wait for their answers.
    calls: Vec<calls::UnderWay>,
    pub incidents: Vec<Incident>,
    /// At least as many as wait to be started again: who is dead is looked for only when somebody is.
    restarting: usize,
    /// Deaths that were read while waiting for something else.
    died: Vec<(usize, Answer)>,
    /// What executors owe from a time when they did not answer.
    owed: Vec<Owed>,
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
            agents: Vec::new(),
            wires: Vec::new(),
            queues: Vec::new(),
            executors,
            next_agent: 0,
            next_wire: 0,
            next_caller: AgentId::NONE.0,
            calls: Vec::new(),
            incidents: Vec::new(),
            restarting: 0,
            died: Vec::new(),
            owed: Vec::new(),
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
        let known = self.agents.iter().find(|known| known.executor == executor && known.slot == slot);
        known.map_or(LEAST_HANG, |known| {
            known.plan.hang_after.unwrap_or((known.timing.deadline * 4).max(LEAST_HANG))
        })
    }

    fn index(&self, name: &str) -> Reply<usize> {
        self.agents.iter().position(|agent| agent.plan.name == name).ok_or_else(|| {
            Refusal::unknown("agent", name, self.agents.iter().map(|agent| agent.plan.name.as_str()))
        })
    }

    fn known(&self, name: &str) -> Reply<&Known> {
        self.index(name).map(|at| &self.agents[at])
    }

    fn by_id(&self, id: AgentId) -> Option<&Known> {
        self.agents.iter().find(|agent| agent.id == id)
    }

    /// The agent and the place of the port named `agent.port`.
    fn port(&self, name: &str) -> Reply<(usize, usize)> {
        let (agent, port) = name.rsplit_once('.').ok_or_else(|| {
            Refusal::new(format!("\"{name}\" is no port")).help("write it as in \"sonar.filtered\"")
        })?;
        let agent = self.index(agent)?;
        let ports = &self.agents[agent].kind.ports;
        let place = ports.iter().position(|known| known.name == port).ok_or_else(|| {
            Refusal::unknown(
                &format!("port of {}", self.agents[agent].plan.name),
                port,
                ports.iter().map(|known| known.name),
            )
        })?;
        Ok((agent, place))
    }

    fn executor_for(&self, plan: &AgentPlan, timing: Timing) -> Reply<usize> {
        let name = match &plan.executor {
            Some(name) => name.as_str(),
            None if timing.deadline <= Duration::ZERO => "ordinary",
            None if timing.deadline <= Duration::millis(10) => "reflex",
            None if timing.deadline <= Duration::millis(100) => "control",
            None => "ordinary",
        };
        self.executors.iter().position(|executor| executor.plan.name == name).ok_or_else(|| {
            Refusal::unknown("executor", name, self.executors.iter().map(|e| e.plan.name.as_str()))
        })
    }

    fn output(&self, port: &str) -> Reply<Arc<dyn OutputEnd>> {
        let (agent, place) = self.port(port)?;
        let known = &self.agents[agent];
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

    /// The running system as a plan that would start it.
    pub(crate) fn to_plan(&self) -> PlanParts {
        let agents =
            self.agents.iter().map(|known| AgentPlan { params: known.params.clone(), ..known.plan.clone() });
        let wires = self.wires.iter().filter(|wire| !wire.is_answer).map(|wire| self.plan_of(wire));
        let (queues, to_queues) = self.plans_of_queues();
        (agents.collect(), queues, wires.chain(to_queues).collect())
    }
}

impl ExecutorKnown {
    /// Whether any agent is on it.
    pub(crate) fn is_used(&self) -> bool {
        self.slots.iter().any(|taken| *taken)
    }

    pub(crate) fn new(plan: ExecutorPlan, link: Link) -> ExecutorKnown {
        ExecutorKnown { plan, link, granted: "simulated".into(), slots: Vec::new() }
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

fn first(mistakes: Vec<types::value::Mistake>) -> Refusal {
    let mut mistakes = mistakes.into_iter();
    let mut refusal = mistakes.next().map_or_else(|| Refusal::new("the parameters are wrong"), Refusal::from);
    for more in mistakes {
        refusal.what = format!("{}; {more}", refusal.what);
    }
    refusal
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
    let usual = plan.period.unwrap_or(DEADLINE_ON);
    let deadline = plan.deadline.unwrap_or(usual);
    if deadline <= Duration::ZERO || plan.period.is_some_and(|period| deadline > period) {
        return Err(Refusal::new(format!(
            "the deadline of {name} must lie between zero and its period ({usual}), not {deadline}"
        )));
    }
    let hang_after = plan.hang_after.unwrap_or((deadline * 4).max(LEAST_HANG));
    Ok(Timing { period, deadline, min_gap: plan.min_gap, hang_after })
}
