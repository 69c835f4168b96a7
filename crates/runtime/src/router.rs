//! The registry of agents, ports and wires: who is there, who talks to whom. Never on a message's path.
//!
//! A change is prepared here (checked, allocated), committed by each executor concerned between two of its steps, and retired
//! here once all have answered. The order is fixed: the receiver joins before the sender adds; the sender forgets before the
//! receiver leaves, and a receiver that is not drained yet is asked again.

mod calls;
mod deaths;
mod view;
mod wires;

use core::sync::atomic::Ordering::Relaxed;
use std::sync::Arc;

use types::value::Table;
use types::{AgentId, Duration, Name, Priority, Time};

use crate::agent::{AgentType, Body, Registry};
use crate::executor::{Answer, Change, Link, Seat, Timing, heaps_for};
use crate::log::{LogChoice, LogShared};
use crate::names::Directory;
use crate::plan::{AgentPlan, ExecutorPlan, WireFilter, WirePlan};
use crate::port::{Direction, Envelope, OutputEnd, OutputFault, PortEnds, WireCounts, WireId};
use crate::request::{AgentState, FaultKind, Refusal, Request};
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
            executors,
            next_agent: 0,
            next_wire: 0,
            next_caller: AgentId::NONE.0,
            calls: Vec::new(),
            incidents: Vec::new(),
            restarting: 0,
            died: Vec::new(),
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

    /// Checks a request and does it whole, or refuses it.
    pub(crate) fn apply(&mut self, request: Request, now: Time, fabric: &mut dyn Fabric) -> Reply<()> {
        match request {
            Request::Add(plan) => self.add_wired(plan, now, fabric),
            Request::Remove(agent) => self.remove(&agent, fabric),
            Request::Restart(agent) => self.restart_now(&agent, fabric),
            Request::Replace { agent, kind, params } => self.replace(&agent, &kind, &params, fabric),
            Request::Wire(plan) => self.wire(&plan, fabric),
            Request::Unwire { from, to } => self.unwire(&from, &to, fabric),
            Request::Set { agent, key, value } => self.set(&agent, &key, value, fabric),
            Request::Fault { target, fault } => self.fault(&target, fault, fabric),
            Request::Send { port, cdr } => self.send(&port, &cdr, fabric),
            Request::Quit => Ok(()),
            Request::All(requests) => self.apply_all(requests, now, fabric),
        }
    }

    /// Does several in order; when one is refused, those before it are undone where that is possible without loss.
    fn apply_all(&mut self, requests: Vec<Request>, now: Time, fabric: &mut dyn Fabric) -> Reply<()> {
        let mut undo: Vec<Request> = Vec::new();
        for request in requests {
            let inverse = self.inverse(&request);
            match self.apply(request, now, fabric) {
                Ok(()) => undo.extend(inverse),
                Err(refusal) => {
                    for inverse in undo.into_iter().rev() {
                        // What was just done can be undone: the names are known to be right.
                        let _ = self.apply(inverse, now, fabric);
                    }
                    return Err(refusal);
                }
            }
        }
        Ok(())
    }

    /// Adds an agent and wires it to its robot; when that cannot be, it is not added.
    fn add_wired(&mut self, plan: AgentPlan, now: Time, fabric: &mut dyn Fabric) -> Reply<()> {
        let wires = self.robot_wires(&plan);
        let name = plan.name.clone();
        self.add(plan, &[], fabric)?;
        let wires = wires.into_iter().map(Request::Wire).collect();
        self.apply_all(wires, now, fabric).inspect_err(|_| {
            // It is there, and nothing holds it.
            let _ = self.remove(&name, fabric);
        })
    }

    fn inverse(&self, request: &Request) -> Option<Request> {
        match request {
            Request::Add(plan) => Some(Request::Remove(plan.name.clone())),
            Request::Wire(wire) => Some(Request::Unwire { from: wire.from.clone(), to: wire.to.clone() }),
            Request::Unwire { from, to } => {
                let wire = self.find_wire(from, to)?;
                Some(Request::Wire(self.plan_of(wire)))
            }
            Request::Set { agent, key, .. } => {
                let value = self.known(agent).ok()?.params.get(key)?.value.clone();
                Some(Request::Set { agent: agent.clone(), key: key.clone(), value })
            }
            Request::Fault { target, .. } => {
                Some(Request::Fault { target: target.clone(), fault: FaultKind::Ok })
            }
            Request::All(_)
            | Request::Remove(_)
            | Request::Restart(_)
            | Request::Replace { .. }
            | Request::Send { .. }
            | Request::Quit => None,
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

    /// Adds an agent. `readers` is how many wires the plan leads from each of its ports.
    pub(crate) fn add(
        &mut self,
        plan: AgentPlan,
        readers: &[usize],
        fabric: &mut dyn Fabric,
    ) -> Reply<AgentId> {
        if self.agents.iter().any(|agent| agent.plan.name == plan.name) {
            return Err(Refusal::new(format!("there is already an agent \"{}\"", plan.name))
                .help("names are given once"));
        }
        let kind = self
            .registry
            .get(&plan.kind)
            .ok_or_else(|| {
                Refusal::unknown("type of agent", &plan.kind, self.registry.types().iter().map(|t| t.kind))
            })?
            .clone();
        let (_, params) = kind.read_params(&plan.params).map_err(first)?;
        let mut body = kind.build(&plan.params).map_err(first)?;
        let timing = timing_of(&plan)?;
        let executor = self.executor_for(&plan, timing)?;
        let id = AgentId(self.next_agent);

        let mut ends = Vec::new();
        body.visit_ports(&mut |visit| {
            let seats = readers.get(ends.len()).copied().unwrap_or(0) + SPARE_SEATS;
            let made = visit.port.create(&visit.options, seats);
            visit.port.bind(&made);
            if let Some(output) = &made.output {
                output.set_sender(id);
            }
            ends.push(made);
        });
        let mut on = Vec::new();
        for input in &plan.on {
            let place = kind
                .ports
                .iter()
                .position(|port| port.name == input)
                .filter(|place| ends[*place].input.is_some());
            let Some(place) = place else {
                let known = kind.ports.iter().filter(|port| port.shape.input.is_some()).map(|port| port.name);
                return Err(Refusal::unknown(&format!("input of {}", plan.name), input, known));
            };
            on.extend(ends[place].input.clone());
        }
        // Answers make a client run, wherever they come from.
        let clients =
            kind.ports.iter().zip(&ends).filter(|(port, _)| port.shape.direction == Direction::Client);
        on.extend(clients.filter_map(|(_, end)| end.input.clone()));
        self.number_outputs(&plan.name, &kind, &ends);

        self.next_agent += 1;
        let slots = &mut self.executors[executor].slots;
        let slot = slots.iter().position(|taken| !taken).unwrap_or(slots.len());
        if slot == slots.len() {
            slots.push(true);
        } else {
            slots[slot] = true;
        }
        let room = slots.len();
        let slot = slot as u32;
        let stats = Arc::new(AgentStats::default());
        let seat = Seat {
            id,
            name: Name::new(&plan.name),
            body: Some(body),
            on,
            timing,
            stats: stats.clone(),
            next_release: Time::NEVER,
            alarm: Time::NEVER,
            put_off: Time::NEVER,
            last_step: Time(i64::MIN / 2),
            started: false,
            fault: Default::default(),
        };
        let spare = kind.build(&plan.params).ok();
        self.agents.push(Known {
            id,
            kind,
            params,
            executor,
            slot,
            ends,
            stats,
            timing,
            state: AgentState::Running,
            restart_at: Time::NEVER,
            deaths: Vec::new(),
            last_death: None,
            spare,
            plan,
        });
        self.directory.remember(id, &self.agents[self.agents.len() - 1].plan.name);
        // The order first: a seat that is due must have its place.
        self.commit_order(executor, fabric)?;
        let seats = Vec::with_capacity((room * 2).max(8));
        self.commit(executor, Change::Seat { slot, seat: Some(Box::new(seat)), seats, room }, fabric)?;
        Ok(id)
    }

    /// Gives each output its number in the log, the same as before where an agent of that name was there before.
    fn number_outputs(&self, agent: &str, kind: &AgentType, ends: &[PortEnds]) {
        let mut topics = self.log_shared.topics();
        for (port, made) in kind.ports.iter().zip(ends) {
            let Some(output) = &made.output else { continue };
            let name = format!("{agent}.{}", port.name);
            let every = self.log.every(&name, output.message_type());
            let known = topics
                .outputs
                .iter()
                .position(|(known, message)| *known == name && *message == output.message_type());
            let number = known.unwrap_or_else(|| {
                topics.outputs.push((name, output.message_type()));
                topics.every.push(every);
                topics.outputs.len() - 1
            });
            let tapped = topics.taps.iter().any(|(tapped, _)| *tapped == number as u32);
            output.set_log(number as u32, if tapped { 1 } else { every });
        }
    }

    /// The wires that join an agent to its robot.
    fn robot_wires(&self, plan: &AgentPlan) -> Vec<WirePlan> {
        let (Some(robot), Some(kind)) = (&plan.robot, self.registry.get(&plan.kind)) else {
            return Vec::new();
        };
        robot_wires(plan, kind, robot)
    }

    fn remove(&mut self, name: &str, fabric: &mut dyn Fabric) -> Reply<()> {
        let at = self.index(name)?;
        if self.robots.iter().any(|robot| robot == name) {
            return Err(Refusal::new(format!(
                "\"{name}\" is a robot, and the gate in front of it cannot be removed"
            )));
        }
        let (id, executor, slot) = (self.agents[at].id, self.agents[at].executor, self.agents[at].slot);
        let is_for_it = |wire: &&Wire| wire.filter.recipient.as_deref() == Some(name);
        if let Some(wire) =
            self.wires.iter().filter(is_for_it).find(|wire| wire.from.0 != id && wire.to.0 != id)
        {
            // Whoever gets the name later has another number, and the filter would let nothing for it through.
            let WirePlan { from, to, .. } = self.plan_of(wire);
            return Err(Refusal::new(format!("the wire from {from} to {to} takes what is for {name}"))
                .help("cut that wire first"));
        }
        let wires: Vec<WireId> = self
            .wires
            .iter()
            .filter(|wire| wire.from.0 == id || wire.to.0 == id)
            .map(|wire| wire.id)
            .collect();
        self.end_calls_of(id);
        // First nobody sends to it any more, then it stops, then it is gone from the wires to others.
        for wire in &wires {
            self.cut(*wire, true, fabric)?;
        }
        self.commit(executor, Change::Unseat { slot, seat: None }, fabric)?;
        self.agents.retain(|agent| agent.id != id);
        self.executors[executor].slots[slot as usize] = false;
        self.commit_order(executor, fabric)
    }

    fn restart_now(&mut self, name: &str, fabric: &mut dyn Fabric) -> Reply<()> {
        let at = self.index(name)?;
        let body = self.agents[at].kind.build(&self.agents[at].params).map_err(first)?;
        self.install(at, body, fabric)
    }

    fn replace(&mut self, name: &str, kind: &str, params: &Table, fabric: &mut dyn Fabric) -> Reply<()> {
        let at = self.index(name)?;
        let new = self
            .registry
            .get(kind)
            .ok_or_else(|| {
                Refusal::unknown("type of agent", kind, self.registry.types().iter().map(|t| t.kind))
            })?
            .clone();
        let old = &self.agents[at].kind;
        let same = old.ports.len() == new.ports.len()
            && old.ports.iter().zip(&new.ports).all(|(a, b)| {
                a.name == b.name
                    && a.shape.direction == b.shape.direction
                    && a.shape.input == b.shape.input
                    && a.shape.output == b.shape.output
            });
        if !same {
            return Err(Refusal::new(format!(
                "a \"{kind}\" has other ports than the \"{}\" in whose place it would come",
                old.kind
            ))
            .help("remove the one and add the other"));
        }
        let (_, table) = new.read_params(params).map_err(first)?;
        let body = new.build(params).map_err(first)?;
        let known = &mut self.agents[at];
        known.spare = new.build(params).ok();
        known.kind = new;
        known.params = table;
        known.plan.kind = kind.to_owned();
        known.plan.params = params.clone();
        self.install(at, body, fabric)
    }

    /// Puts a new instance in the place of the present one, in front of the same mailboxes and routes.
    fn install(&mut self, at: usize, mut body: Box<dyn Body>, fabric: &mut dyn Fabric) -> Reply<()> {
        let known = &mut self.agents[at];
        let mut ends = known.ends.iter();
        body.visit_ports(&mut |visit| {
            if let Some(end) = ends.next() {
                visit.port.bind(end);
            }
        });
        known.state = AgentState::Running;
        known.restart_at = Time::NEVER;
        known.stats.restarts.store(known.stats.restarts.load(Relaxed) + 1, Relaxed);
        let (executor, slot) = (known.executor, known.slot);
        self.commit(executor, Change::Body { slot, body: Some(body) }, fabric)
    }

    fn set(
        &mut self,
        name: &str,
        key: &str,
        value: types::value::Value,
        fabric: &mut dyn Fabric,
    ) -> Reply<()> {
        let at = self.index(name)?;
        if matches!(key, "period" | "deadline" | "min_gap") {
            return self.set_timing(at, key, &value, fabric);
        }
        let known = &self.agents[at];
        let mut params = known.params.clone();
        params.set(key, value);
        let (boxed, table) = known.kind.read_params(&params).map_err(first)?;
        let (executor, slot) = (known.executor, known.slot);
        let spare = known.kind.build(&table).ok();
        self.commit(executor, Change::Params { slot, params: boxed }, fabric)?;
        let known = &mut self.agents[at];
        known.plan.params = table.clone();
        known.params = table;
        known.spare = spare;
        Ok(())
    }

    fn set_timing(
        &mut self,
        at: usize,
        key: &str,
        value: &types::value::Value,
        fabric: &mut dyn Fabric,
    ) -> Reply<()> {
        let text = value
            .as_text()
            .ok_or_else(|| Refusal::new(format!("{key} must be a time such as \"250ms\", not {value}")))?;
        let span: Duration =
            text.parse().map_err(|error| Refusal::new(format!("{key} is \"{text}\": {error}")))?;
        let known = &self.agents[at];
        let mut plan = known.plan.clone();
        match key {
            "period" => plan.period = Some(span),
            "deadline" => plan.deadline = Some(span),
            _ => plan.min_gap = span,
        }
        if let (Some(period), Some((least, most))) = (plan.period, plan.period_range)
            && !(least..=most).contains(&period)
        {
            return Err(Refusal::new(format!(
                "the period of {} must lie from {least} to {most}, not {period}",
                plan.name
            )));
        }
        let timing = timing_of(&plan)?;
        let (executor, slot) = (known.executor, known.slot);
        self.commit(executor, Change::Timing { slot, timing }, fabric)?;
        let known = &mut self.agents[at];
        known.plan = plan;
        known.timing = timing;
        Ok(())
    }

    fn fault(&mut self, target: &str, fault: FaultKind, fabric: &mut dyn Fabric) -> Reply<()> {
        if let Ok(at) = self.index(target) {
            let known = &self.agents[at];
            let (executor, slot) = (known.executor, known.slot);
            let step = fault.of_step();
            if step.is_none() || fault == FaultKind::Ok {
                let output = fault.of_output().unwrap_or_default();
                let ends: Vec<_> = known.ends.iter().filter_map(|end| end.output.clone()).collect();
                for end in ends {
                    self.output_fault(executor, end, output, fabric)?;
                }
            }
            return step.map_or(Ok(()), |fault| self.commit(executor, Change::Fault { slot, fault }, fabric));
        }
        let (agent, port) = self.port(target).map_err(|refusal| {
            if target.contains('.') { refusal } else { self.index(target).err().unwrap_or(refusal) }
        })?;
        let end = self.agents[agent].ends[port].output.clone();
        match (end, fault.of_output()) {
            (Some(end), Some(fault)) => self.output_fault(self.agents[agent].executor, end, fault, fabric),
            (None, _) => {
                Err(Refusal::new(format!("{target} sends nothing")).help("name an output, or the agent"))
            }
            (_, None) => {
                Err(Refusal::new(format!("an output cannot {}", fault.name())).help("name the agent"))
            }
        }
    }

    fn output_fault(
        &mut self,
        executor: usize,
        end: Arc<dyn OutputEnd>,
        fault: OutputFault,
        fabric: &mut dyn Fabric,
    ) -> Reply<()> {
        let faulty = end.prepare_fault(fault);
        self.commit(executor, Change::OutputFault { end, faulty }, fabric)
    }

    fn send(&mut self, port: &str, bytes: &[u8], fabric: &mut dyn Fabric) -> Reply<()> {
        let (agent, place) = self.port(port)?;
        let Some(end) = self.agents[agent].ends[place].output.clone() else {
            return Err(Refusal::new(format!("{port} takes messages but sends none")).help(
                "name the output from which the message shall go, and all who are wired to it get it",
            ));
        };
        let executor = self.agents[agent].executor;
        let message = end.prepare_message(bytes).map_err(|error| Refusal::new(error.to_string()))?;
        self.commit(executor, Change::Send { end, message, envelope: Envelope::default() }, fabric)
    }

    /// Computes the data-flow order of an executor and gives it to it.
    fn commit_order(&mut self, executor: usize, fabric: &mut dyn Fabric) -> Reply<()> {
        let order = self.data_flow_order(executor);
        let slots = self.executors[executor].slots.len();
        let mut ranks = vec![u32::MAX; slots];
        for (rank, slot) in order.iter().enumerate() {
            ranks[*slot as usize] = rank as u32;
        }
        let words = vec![0; slots.div_ceil(64).max(1)];
        let (releases, due) = heaps_for(slots);
        self.commit(executor, Change::Order { order, ranks, words, releases, due }, fabric)
    }

    /// The slots of an executor's agents so that senders stand before receivers; cycles are broken by name.
    fn data_flow_order(&self, executor: usize) -> Vec<u32> {
        let mut members: Vec<&Known> =
            self.agents.iter().filter(|agent| agent.executor == executor).collect();
        members.sort_by(|a, b| a.plan.name.cmp(&b.plan.name));
        let place = |id: AgentId| members.iter().position(|member| member.id == id);
        let mut behind: Vec<Vec<usize>> = vec![Vec::new(); members.len()];
        let mut before = vec![0usize; members.len()];
        for wire in self.wires.iter().filter(|wire| !wire.is_answer) {
            if let (Some(a), Some(b)) = (place(wire.from.0), place(wire.to.0))
                && a != b
            {
                behind[a].push(b);
                before[b] += 1;
            }
        }
        let mut order = Vec::with_capacity(members.len());
        let mut done = vec![false; members.len()];
        while order.len() < members.len() {
            // The first by name that waits for nobody; in a cycle, the first by name.
            let next = (0..members.len()).filter(|i| !done[*i]).min_by_key(|i| (before[*i] > 0, *i));
            let Some(next) = next else { break };
            done[next] = true;
            order.push(members[next].slot);
            for after in &behind[next] {
                before[*after] = before[*after].saturating_sub(1);
            }
        }
        order
    }

    fn commit(&mut self, executor: usize, change: Change, fabric: &mut dyn Fabric) -> Reply<()> {
        self.commit_and_get(executor, change, fabric).map(drop)
    }

    /// Gives a change to an executor and waits until it has answered. What comes back is freed here.
    fn commit_and_get(&mut self, executor: usize, change: Change, fabric: &mut dyn Fabric) -> Reply<Change> {
        let busy = || {
            Refusal::new("the executor does not answer").help("an agent in it does not return from its step")
        };
        if !self.executors[executor].link.change(change) {
            return Err(busy());
        }
        loop {
            let go_on = fabric.pump(executor);
            while let Some(answer) = self.executors[executor].link.answer() {
                match answer {
                    Answer::Done(change) => {
                        fabric.answered();
                        return Ok(change);
                    }
                    Answer::NotDrained(change) => {
                        fabric.answered();
                        drop(change);
                        return Err(Refusal::new("not drained yet"));
                    }
                    died @ Answer::Died { .. } => self.died.push((executor, died)),
                }
            }
            if !go_on {
                return Err(busy());
            }
        }
    }

    /// Ends all agents.
    pub(crate) fn stop_all(&mut self, fabric: &mut dyn Fabric) {
        for executor in 0..self.executors.len() {
            // An executor that does not answer is left behind; there is nobody to tell any more.
            let _ = self.commit(executor, Change::Stop, fabric);
        }
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
    pub(crate) fn to_plan(&self) -> (Vec<AgentPlan>, Vec<WirePlan>) {
        let agents =
            self.agents.iter().map(|known| AgentPlan { params: known.params.clone(), ..known.plan.clone() });
        let wires = self.wires.iter().filter(|wire| !wire.is_answer).map(|wire| self.plan_of(wire));
        (agents.collect(), wires.collect())
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
