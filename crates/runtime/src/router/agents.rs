//! Agents: adding and removing them, and what can be asked of one.

use std::collections::BTreeSet;
use std::sync::Arc;

use types::value::Table;
use types::{AgentId, Name, Time};

use super::script::{Step, What};
use super::timing::{Nominal, TIMING_KEYS};
use super::{Known, Reply, Rings, Router, SPARE_SEATS, Staged, Wire, first, robot_wires};
use crate::agent::{AgentType, Body};
use crate::executor::{Change, Seat, StepFault};
use crate::plan::{AgentPlan, WirePlan};
use crate::port::{Envelope, OutputFault, PortEnds, WireId};
use crate::request::{AgentState, FaultKind, Refusal};
use crate::stats::{AgentStats, Window};

impl Router {
    /// Adds an agent. `readers` is how many wires the plan leads from each of its ports.
    pub(crate) fn add(&mut self, plan: AgentPlan, readers: &[usize], staged: &mut Staged) -> Reply<AgentId> {
        if self.names.contains_key(&plan.name) || self.is_queue(&plan.name) {
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
        let timing = self.timing_for(&plan, &kind)?;
        let executor = self.executor_for(&plan, timing)?;
        self.check_budget(&plan, &timing, executor)?;
        let ends = new_ends(&plan, &kind, body.as_mut(), readers)?;
        let Some(id) = self.directory.give(&plan.name) else {
            return Err(Refusal::new("there are as many agents as there can be"));
        };
        for output in ends.iter().filter_map(|end| end.output.as_ref()) {
            output.set_sender(id, 0);
        }
        self.number_outputs(&plan.name, &kind, &ends);

        let slots = &mut self.executors[executor].slots;
        let slot = slots.iter().position(Option::is_none).unwrap_or(slots.len());
        if slot == slots.len() {
            slots.push(Some(id));
        } else {
            slots[slot] = Some(id);
        }
        let slot = slot as u32;
        let spare = kind.build(&plan.params).ok();
        self.added += 1;
        let ports = kind.ports.len();
        let known = Known {
            id,
            added: self.added,
            kind,
            params,
            executor,
            slot,
            rings: vec![Rings::default(); ports],
            wires: BTreeSet::new(),
            ends,
            stats: Arc::new(AgentStats::default()),
            window: Window::default(),
            long_window: Window::default(),
            admitted: None,
            nominal: Nominal::of(&plan),
            timing,
            fault: StepFault::None,
            output_faults: vec![OutputFault::None; ports],
            state: AgentState::Running,
            restart_at: Time::NEVER,
            starting: false,
            deaths: Vec::new(),
            last_death: None,
            spare,
            plan,
        };
        staged.step(self.seat_step(&known, Some(body)));
        staged.reorder(executor);
        staged.undo(move |router| {
            if let Some(known) = router.agents.remove(&id) {
                router.names.remove(&known.plan.name);
            }
            router.executors[executor].slots[slot as usize] = None;
            router.directory.take_back(id);
        });
        self.names.insert(known.plan.name.clone(), id);
        self.agents.insert(id, known);
        staged.when_decided(move |router| router.acquaint(id));
        Ok(id)
    }

    /// Puts an agent on its seat, with a body or without.
    pub(super) fn seat_step(&self, known: &Known, body: Option<Box<dyn Body>>) -> Step {
        let seat = Seat {
            id: known.id,
            name: Name::new(&known.plan.name),
            body,
            at_rest: None,
            in_step: false,
            on: known.on(),
            serves: false,
            timing: known.timing,
            stats: known.stats.clone(),
            next_release: Time::NEVER,
            is_due: false,
            alarm: Time::NEVER,
            put_off: Time::NEVER,
            wish: Time::NEVER,
            last_wake: Time(i64::MIN / 2),
            refined: 0,
            last_step: Time(i64::MIN / 2),
            ready_at: Time::NEVER,
            started: false,
            fault: known.fault,
            lost: false,
        };
        let change = Change::Seat { slot: known.slot, seat: Some(Box::new(seat)) };
        Step { executor: known.executor, of: known.id, ring: None, what: What::Change(change) }
    }

    /// Gives each output its number in the log, the same as before where an agent of that name was there before.
    pub(super) fn number_outputs(&self, agent: &str, kind: &AgentType, ends: &[PortEnds]) {
        let mut topics = self.log_shared.topics();
        for (port, made) in kind.ports.iter().zip(ends) {
            let Some(output) = &made.output else { continue };
            let name = format!("{agent}.{}", port.name);
            let every = self.log.every(&name, output.message_type());
            let number = topics.number_of(name, output.message_type(), every);
            let tapped = topics.taps.iter().any(|(tapped, _)| *tapped == number);
            output.set_log(number, if tapped { 1 } else { every });
        }
    }

    /// The wires that join an agent to its robot.
    pub(super) fn robot_wires(&self, plan: &AgentPlan) -> Vec<WirePlan> {
        let (Some(robot), Some(kind)) = (&plan.robot, self.registry.get(&plan.kind)) else {
            return Vec::new();
        };
        robot_wires(plan, kind, robot)
    }

    /// Adds an agent and wires it to its robot.
    pub(super) fn add_wired(&mut self, plan: AgentPlan, staged: &mut Staged) -> Reply<()> {
        let wires = self.robot_wires(&plan);
        self.add(plan, &[], staged)?;
        wires.iter().try_for_each(|wire| self.wire(wire, staged))
    }

    pub(super) fn remove(&mut self, name: &str, staged: &mut Staged) -> Reply<()> {
        if self.is_queue(name) {
            return self.remove_queue(name, staged);
        }
        let id = self.id_of(name)?;
        if self.robots.iter().any(|robot| robot == name) {
            return Err(Refusal::new(format!(
                "\"{name}\" is a robot, and the gate in front of it cannot be removed"
            )));
        }
        let is_for_it = |wire: &&Wire| wire.filter.recipient.as_deref() == Some(name);
        let others = |wire: &&Wire| wire.from.0 != id && wire.to.0 != id;
        if let Some(wire) = self.wires.values().filter(is_for_it).find(others) {
            // Whoever gets the name later has another number, and the filter would let nothing for it through.
            let WirePlan { from, to, .. } = self.plan_of(wire);
            return Err(Refusal::new(format!("the wire from {from} to {to} takes what is for {name}"))
                .help("cut that wire first"));
        }
        if let Some(WirePlan { from, to, .. }) = self.queue_wire_for(name, id) {
            return Err(Refusal::new(format!("the wire from {from} to {to} takes what is for {name}"))
                .help("cut that wire first"));
        }
        // First nobody sends to it any more, and it is gone from the wires to others, who take what is on them yet; then it stops.
        for wire in self.agents[&id].wires.iter().copied().collect::<Vec<WireId>>() {
            let receives = self.wires.get(&wire).is_some_and(|wire| wire.to.0 == id);
            self.cut(wire, !receives, staged);
        }
        self.leave_queues(id, staged);
        let Some(known) = self.agents.remove(&id) else { return Ok(()) };
        self.names.remove(name);
        let (executor, slot) = (known.executor, known.slot);
        let unseat = Change::Unseat { slot, seat: None };
        staged.step(Step { executor, of: id, ring: None, what: What::Change(unseat) });
        staged.reorder(executor);
        staged.when_decided(move |router| {
            router.end_calls_of(id, "was removed before it answered");
            router.dismiss(id);
            router.directory.take_back(id);
        });
        staged.undo(move |router| {
            router.names.insert(known.plan.name.clone(), id);
            router.agents.insert(id, known);
        });
        Ok(())
    }

    pub(super) fn restart_now(&mut self, name: &str, staged: &mut Staged) -> Reply<()> {
        let id = self.id_of(name)?;
        let body = self.agents[&id].kind.build(&self.agents[&id].params).map_err(first)?;
        staged.step(self.install(id, body, false));
        Ok(())
    }

    pub(super) fn replace(
        &mut self,
        name: &str,
        kind: &str,
        params: &Table,
        staged: &mut Staged,
    ) -> Reply<()> {
        let id = self.id_of(name)?;
        let new = self
            .registry
            .get(kind)
            .ok_or_else(|| {
                Refusal::unknown("type of agent", kind, self.registry.types().iter().map(|t| t.kind))
            })?
            .clone();
        let old = &self.agents[&id].kind;
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
        let spare = new.build(params).ok();
        staged.step(self.install(id, body, true));
        let (kind, params) = (kind.to_owned(), params.clone());
        self.alter(id, staged, move |known| {
            known.spare = spare;
            known.kind = new;
            known.params = table;
            known.plan.kind = kind;
            known.plan.params = params;
        });
        Ok(())
    }

    /// Puts a new instance in the place of the present one, in front of the same mailboxes and routes; on demand it takes over what
    /// that has learnt.
    pub(super) fn install(&self, id: AgentId, mut body: Box<dyn Body>, hands_over: bool) -> Step {
        let known = &self.agents[&id];
        let mut ends = known.ends.iter();
        body.visit_ports(&mut |visit| {
            if let Some(end) = ends.next() {
                visit.port.bind(end);
            }
        });
        let change = Change::Body { slot: known.slot, body: Some(body), hands_over };
        Step { executor: known.executor, of: id, ring: None, what: What::Change(change) }
    }

    /// Changes what is known of an agent, so that it can be taken back.
    pub(super) fn alter(&mut self, id: AgentId, staged: &mut Staged, change: impl FnOnce(&mut Known)) {
        let Some(known) = self.agents.get_mut(&id) else { return };
        let (kind, plan, params, timing) =
            (known.kind.clone(), known.plan.clone(), known.params.clone(), known.timing);
        let nominal = known.nominal.clone();
        let (fault, output_faults) = (known.fault, known.output_faults.clone());
        change(known);
        staged.undo(move |router| {
            router.of_mut(id, |known| {
                known.spare = kind.build(&params).ok();
                (known.kind, known.plan, known.params, known.timing) = (kind, plan, params, timing);
                known.nominal = nominal;
                (known.fault, known.output_faults) = (fault, output_faults);
            });
        });
    }

    pub(super) fn set(
        &mut self,
        name: &str,
        key: &str,
        value: types::value::Value,
        staged: &mut Staged,
    ) -> Reply<()> {
        let id = self.id_of(name)?;
        if TIMING_KEYS.contains(&key) {
            return self.set_timing(id, key, &value, staged);
        }
        let known = &self.agents[&id];
        let mut params = known.params.clone();
        params.set(key, value);
        let (boxed, table) = known.kind.read_params(&params).map_err(first)?;
        let spare = known.kind.build(&table).ok();
        let change = Change::Params { slot: known.slot, params: boxed };
        staged.step(Step { executor: known.executor, of: id, ring: None, what: What::Change(change) });
        self.alter(id, staged, move |known| {
            known.plan.params = table.clone();
            known.params = table;
            known.spare = spare;
        });
        Ok(())
    }

    pub(super) fn fault(&mut self, target: &str, fault: FaultKind, staged: &mut Staged) -> Reply<()> {
        if let Some(id) = self.names.get(target).copied() {
            let step = fault.of_step();
            if step.is_none() || fault == FaultKind::Ok {
                let output = fault.of_output().unwrap_or_default();
                for port in 0..self.agents[&id].ends.len() {
                    self.output_fault(id, port, output, staged);
                }
            }
            if let Some(fault) = step {
                let known = &self.agents[&id];
                let change = Change::Fault { slot: known.slot, fault };
                let executor = known.executor;
                staged.step(Step { executor, of: id, ring: None, what: What::Change(change) });
                // To panic or hang is for once.
                let lasts = matches!(fault, StepFault::Off | StepFault::Slow | StepFault::Heavy);
                let fault = if lasts { fault } else { StepFault::None };
                self.alter(id, staged, move |known| known.fault = fault);
            }
            return Ok(());
        }
        let (agent, port) = self.port(target).map_err(|refusal| {
            if target.contains('.') { refusal } else { self.id_of(target).err().unwrap_or(refusal) }
        })?;
        match (&self.agents[&agent].ends[port].output, fault.of_output()) {
            (Some(_), Some(fault)) => {
                self.output_fault(agent, port, fault, staged);
                Ok(())
            }
            (None, _) => {
                Err(Refusal::new(format!("{target} sends nothing")).help("name an output, or the agent"))
            }
            (_, None) => {
                Err(Refusal::new(format!("an output cannot {}", fault.name())).help("name the agent"))
            }
        }
    }

    fn output_fault(&mut self, id: AgentId, port: usize, fault: OutputFault, staged: &mut Staged) {
        let known = &self.agents[&id];
        let Some(end) = known.ends[port].output.clone() else { return };
        let faulty = end.prepare_fault(fault);
        let change = Change::OutputFault { end, faulty, slot: known.slot };
        staged.step(Step { executor: known.executor, of: id, ring: None, what: What::Change(change) });
        self.alter(id, staged, move |known| known.output_faults[port] = fault);
    }

    pub(super) fn send(&mut self, port: &str, bytes: &[u8], staged: &mut Staged) -> Reply<()> {
        let (agent, place) = self.port(port)?;
        let known = &self.agents[&agent];
        let Some(end) = known.ends[place].output.clone() else {
            return Err(Refusal::new(format!("{port} takes messages but sends none")).help(
                "name the output from which the message shall go, and all who are wired to it get it",
            ));
        };
        let message = end.prepare_message(bytes).map_err(|error| Refusal::new(error.to_string()))?;
        let change = Change::Send { end, message, envelope: Envelope::default(), slot: known.slot };
        staged.step(Step { executor: known.executor, of: agent, ring: None, what: What::Change(change) });
        Ok(())
    }
}

/// Makes what stands behind the ports of an agent.
pub(super) fn new_ends(
    plan: &AgentPlan,
    kind: &AgentType,
    body: &mut dyn Body,
    readers: &[usize],
) -> Reply<Vec<PortEnds>> {
    let mut ends: Vec<PortEnds> = Vec::new();
    body.visit_ports(&mut |visit| {
        let seats = readers.get(ends.len()).copied().unwrap_or(0) + SPARE_SEATS;
        let made = visit.port.create(&visit.options, seats);
        visit.port.bind(&made);
        ends.push(made);
    });
    for input in &plan.on {
        let place = kind.ports.iter().position(|port| port.name == input);
        if place.is_none_or(|place| ends[place].input.is_none()) {
            let known = kind.ports.iter().filter(|port| port.shape.input.is_some()).map(|port| port.name);
            return Err(Refusal::unknown(&format!("input of {}", plan.name), input, known));
        }
    }
    Ok(ends)
}
