//! Agents: adding and removing them, and what can be asked of one.

use core::sync::atomic::Ordering::Relaxed;
use std::sync::Arc;

use types::value::Table;
use types::{AgentId, Duration, Name, Time};

use super::{Fabric, Known, Reply, Router, SPARE_SEATS, Wire, first, robot_wires, timing_of};
use crate::agent::{AgentType, Body};
use crate::executor::{Change, Seat};
use crate::plan::{AgentPlan, WirePlan};
use crate::port::{Direction, Envelope, OutputEnd, OutputFault, PortEnds, WireId};
use crate::request::{AgentState, FaultKind, Refusal};
use crate::stats::AgentStats;

impl Router {
    /// Adds an agent. `readers` is how many wires the plan leads from each of its ports.
    pub(crate) fn add(
        &mut self,
        plan: AgentPlan,
        readers: &[usize],
        fabric: &mut dyn Fabric,
    ) -> Reply<AgentId> {
        if self.agents.iter().any(|agent| agent.plan.name == plan.name) || self.is_queue(&plan.name) {
            return Err(Refusal::new(format!("there is already something called \"{}\"", plan.name))
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
    pub(super) fn number_outputs(&self, agent: &str, kind: &AgentType, ends: &[PortEnds]) {
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
    pub(super) fn robot_wires(&self, plan: &AgentPlan) -> Vec<WirePlan> {
        let (Some(robot), Some(kind)) = (&plan.robot, self.registry.get(&plan.kind)) else {
            return Vec::new();
        };
        robot_wires(plan, kind, robot)
    }

    pub(super) fn remove(&mut self, name: &str, fabric: &mut dyn Fabric) -> Reply<()> {
        if self.is_queue(name) {
            return self.remove_queue(name);
        }
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
        if let Some(WirePlan { from, to, .. }) = self.queue_wire_for(name, id) {
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
        self.leave_queues(id, fabric)?;
        self.commit(executor, Change::Unseat { slot, seat: None }, fabric)?;
        self.agents.retain(|agent| agent.id != id);
        self.executors[executor].slots[slot as usize] = false;
        self.commit_order(executor, fabric)
    }

    pub(super) fn restart_now(&mut self, name: &str, fabric: &mut dyn Fabric) -> Reply<()> {
        let at = self.index(name)?;
        let body = self.agents[at].kind.build(&self.agents[at].params).map_err(first)?;
        self.install(at, body, false, fabric)
    }

    pub(super) fn replace(
        &mut self,
        name: &str,
        kind: &str,
        params: &Table,
        fabric: &mut dyn Fabric,
    ) -> Reply<()> {
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
        self.install(at, body, true, fabric)?;
        let known = &mut self.agents[at];
        known.spare = new.build(params).ok();
        known.kind = new;
        known.params = table;
        known.plan.kind = kind.to_owned();
        known.plan.params = params.clone();
        Ok(())
    }

    /// Puts a new instance in the place of the present one, in front of the same mailboxes and routes; on demand it takes over what
    /// that has learnt.
    pub(super) fn install(
        &mut self,
        at: usize,
        mut body: Box<dyn Body>,
        hands_over: bool,
        fabric: &mut dyn Fabric,
    ) -> Reply<()> {
        let known = &mut self.agents[at];
        let mut ends = known.ends.iter();
        body.visit_ports(&mut |visit| {
            if let Some(end) = ends.next() {
                visit.port.bind(end);
            }
        });
        let (executor, slot) = (known.executor, known.slot);
        self.commit(executor, Change::Body { slot, body: Some(body), hands_over }, fabric)?;
        let known = &mut self.agents[at];
        known.state = AgentState::Running;
        known.restart_at = Time::NEVER;
        known.stats.restarts.store(known.stats.restarts.load(Relaxed) + 1, Relaxed);
        Ok(())
    }

    pub(super) fn set(
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

    pub(super) fn set_timing(
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

    pub(super) fn fault(&mut self, target: &str, fault: FaultKind, fabric: &mut dyn Fabric) -> Reply<()> {
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

    pub(super) fn output_fault(
        &mut self,
        executor: usize,
        end: Arc<dyn OutputEnd>,
        fault: OutputFault,
        fabric: &mut dyn Fabric,
    ) -> Reply<()> {
        let faulty = end.prepare_fault(fault);
        self.commit(executor, Change::OutputFault { end, faulty }, fabric)
    }

    pub(super) fn send(&mut self, port: &str, bytes: &[u8], fabric: &mut dyn Fabric) -> Reply<()> {
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
}
