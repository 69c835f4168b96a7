//! Making and cutting wires.

use std::sync::Arc;

use types::{AgentId, Filter, Priority};

use super::{Committed, Fabric, Owed, OwedEnd, Reply, Router, Wire};
use crate::executor::Change;
use crate::plan::{USUAL_DEPTH, USUAL_DEPTH_ON, WirePlan};
use crate::port::{Direction, InputEnd, NoSeat, OutputEnd, PortEnds, Target, WireCounts, WireId, WireSpec};
use crate::request::Refusal;
use crate::ring::Overload;
use crate::service::answers_for;

impl Router {
    pub(super) fn find_wire(&self, from: &str, to: &str) -> Option<&Wire> {
        let (from, to) = (self.port(from).ok()?, self.port(to).ok()?);
        let (from, to) = ((self.agents[from.0].id, from.1), (self.agents[to.0].id, to.1));
        self.wires.iter().find(|wire| wire.from == from && wire.to == to && !wire.is_answer)
    }

    pub(super) fn plan_of(&self, wire: &Wire) -> WirePlan {
        let name = |(id, port): (AgentId, usize)| {
            self.by_id(id).map_or_else(String::new, |known| {
                format!("{}.{}", known.plan.name, known.kind.ports[port].name)
            })
        };
        let mut plan = WirePlan::new(name(wire.from), name(wire.to));
        (plan.depth, plan.overload) = (Some(wire.depth), Some(wire.overload));
        plan.filter = wire.filter.clone();
        plan
    }

    /// Makes a wire.
    pub(crate) fn wire(&mut self, plan: &WirePlan, fabric: &mut dyn Fabric) -> Reply<()> {
        if let Some(done) = self.wire_queue(plan, fabric) {
            return done;
        }
        let (from, to) = (self.port(&plan.from)?, self.port(&plan.to)?);
        if self.find_wire(&plan.from, &plan.to).is_some() {
            return Err(Refusal::new(format!("{} is already wired to {}", plan.from, plan.to)));
        }
        let recipient = plan.filter.recipient.as_ref().map(|name| self.known(name)).transpose()?;
        let filter = plan.filter.with_recipient(recipient.map(|known| known.id));
        let (out_port, in_port) =
            (&self.agents[from.0].kind.ports[from.1], &self.agents[to.0].kind.ports[to.1]);
        match (out_port.shape.direction, in_port.shape.direction) {
            (Direction::Output, Direction::Input) => {
                self.check_types(plan, from, to)?;
                self.join(from, to, plan, filter, false, fabric).map(drop)
            }
            (Direction::Client, Direction::Service) => {
                self.check_types(plan, from, to)?;
                self.check_types(plan, to, from)?;
                let for_client = answers_for(self.agents[from.0].id);
                let answers = self.join(to, from, plan, for_client, true, fabric)?;
                let calls = self.join(from, to, plan, filter, false, fabric)?;
                if let Some(wire) = self.wires.iter_mut().find(|wire| wire.id == calls) {
                    wire.partner = Some(answers);
                }
                Ok(())
            }
            (Direction::Input, Direction::Output) | (Direction::Service, Direction::Client) => {
                Err(Refusal::new(format!("{} and {} are the wrong way round", plan.from, plan.to))
                    .help(format!("\"{}\" = [\"{}\"]", plan.to, plan.from)))
            }
            (a, b) => {
                Err(Refusal::new(format!("{} is an {}, {} an {}", plan.from, a.name(), plan.to, b.name()))
                    .help("a wire leads from an output to an input, or from a client to a service"))
            }
        }
    }

    fn check_types(&self, plan: &WirePlan, from: (usize, usize), to: (usize, usize)) -> Reply<()> {
        let out = self.agents[from.0].ends[from.1].output.as_ref().map(|end| end.message_type());
        let into = self.agents[to.0].ends[to.1].input.as_ref().map(|end| end.message_type());
        match (out, into) {
            (Some(out), Some(into)) if out == into => Ok(()),
            (Some(out), Some(into)) => {
                let fits: Vec<String> = self.agents[from.0]
                    .kind
                    .ports
                    .iter()
                    .filter(|port| port.shape.output == Some(into))
                    .map(|port| format!("{}.{}", self.agents[from.0].plan.name, port.name))
                    .collect();
                let refusal = Refusal::new(format!(
                    "{} sends {}, {} takes {}",
                    plan.from,
                    out.short_name(),
                    plan.to,
                    into.short_name()
                ));
                Err(if fits.is_empty() {
                    refusal
                } else {
                    refusal.help(format!("did you mean {}?", fits.join(" or ")))
                })
            }
            _ => Err(Refusal::new(format!("{} cannot be wired to {}", plan.from, plan.to))),
        }
    }

    /// Makes one ring wire: the receiver joins, then the sender adds.
    fn join(
        &mut self,
        from: (usize, usize),
        to: (usize, usize),
        plan: &WirePlan,
        filter: Filter,
        is_answer: bool,
        fabric: &mut dyn Fabric,
    ) -> Reply<WireId> {
        let (sender, receiver) = (&self.agents[from.0], &self.agents[to.0]);
        let (Some(output), Some(input)) =
            (sender.ends[from.1].output.clone(), receiver.ends[to.1].input.clone())
        else {
            return Err(Refusal::new(format!("{} cannot be wired to {}", plan.from, plan.to)));
        };
        let port = &receiver.kind.ports[to.1];
        let answers = port.shape.direction == Direction::Client;
        let wakes = answers || receiver.plan.on.iter().any(|on| on == port.name);
        let depth = plan.depth.unwrap_or(if wakes { USUAL_DEPTH_ON } else { USUAL_DEPTH });
        let overload = plan.overload.unwrap_or(if wakes { Overload::Refuse } else { Overload::NewestWins });
        if depth == 0 || depth > crate::ring::MOST_MESSAGES {
            let most = crate::ring::MOST_MESSAGES;
            return Err(Refusal::new(format!("a wire holds from 1 to {most} messages, not {depth}")));
        }
        let target = Target {
            executor: receiver.executor as u32,
            slot: receiver.slot,
            door: self.executors[receiver.executor].link.door.clone(),
            wakes,
        };
        let id = self.wire_id();
        let (sender, receiver) = (&self.agents[from.0], &self.agents[to.0]);
        let counts = Arc::new(WireCounts::default());
        let spec = WireSpec { id, depth, overload, filter, target, counts: counts.clone() };
        let priorities = sender.priorities(from.1);
        let (from_id, to_id) = ((sender.id, from.1), (receiver.id, to.1));
        let (routes, lanes) = (self.routes_from(from_id), self.lanes_into(to_id));
        let prepared = output.prepare(&spec, &priorities, routes, lanes).map_err(|NoSeat { seats }| {
            Refusal::new(format!("{} has readers on all {seats} seats of its memory", plan.from))
        })?;
        let (sender_executor, receiver_executor, slot) = (sender.executor, receiver.executor, receiver.slot);
        let joined = input.clone();
        self.commit(receiver_executor, Change::Join { end: input, lanes: prepared.lanes, slot }, fabric)?;
        let route = Change::Route { end: output, route: prepared.route };
        self.commit(sender_executor, route, fabric).inspect_err(|_| {
            // Nobody has sent anything: the receiver leaves again.
            self.leave(receiver_executor, joined, id, true, fabric);
        })?;
        self.wires.push(Wire {
            id,
            from: from_id,
            to: to_id,
            partner: None,
            is_answer,
            depth,
            overload,
            filter: plan.filter.clone(),
            counts,
        });
        if sender_executor == receiver_executor && wakes {
            self.commit_order(sender_executor, fabric)?;
        }
        Ok(id)
    }

    pub(super) fn wire_id(&mut self) -> WireId {
        self.next_wire += 1;
        WireId(self.next_wire - 1)
    }

    /// How many routes lead out of a port.
    pub(super) fn routes_from(&self, port: (AgentId, usize)) -> usize {
        self.wires.iter().filter(|wire| wire.from == port).count()
            + self.queues_from(port)
            + self.calls_of(port)
    }

    /// How many lanes lead into a port at most.
    pub(super) fn lanes_into(&self, port: (AgentId, usize)) -> usize {
        let wires = self.wires.iter().filter(|wire| wire.to == port).count();
        (wires + self.calls_of(port)) * Priority::ALL.len() + self.queues_into(port)
    }

    pub(super) fn unwire(&mut self, from: &str, to: &str, fabric: &mut dyn Fabric) -> Reply<()> {
        if let Some(done) = self.unwire_queue(from, to, fabric) {
            return done;
        }
        self.port(from)?;
        self.port(to)?;
        let Some(wire) = self.find_wire(from, to) else {
            let ends = self.port(from)?;
            let id = (self.agents[ends.0].id, ends.1);
            let known: Vec<String> =
                self.wires.iter().filter(|wire| wire.from == id).map(|w| self.plan_of(w).to).collect();
            let refusal = Refusal::new(format!("{from} is not wired to {to}"));
            return Err(if known.is_empty() {
                refusal
            } else {
                refusal.help(format!("it is wired to {}", known.join(", ")))
            });
        };
        let (id, partner) = (wire.id, wire.partner);
        self.cut(id, false, fabric)?;
        partner.map_or(Ok(()), |partner| self.cut(partner, false, fabric))
    }

    /// Cuts one ring wire: the sender forgets, then the receiver leaves, when it is drained unless that is not waited for.
    pub(super) fn cut(&mut self, id: WireId, force: bool, fabric: &mut dyn Fabric) -> Reply<()> {
        let Some(wire) = self.wires.iter().find(|wire| wire.id == id) else { return Ok(()) };
        let (from, to) = (wire.from, wire.to);
        let end =
            |id: AgentId, port: usize| self.by_id(id).map(|known| (known.executor, known.ends[port].clone()));
        if let Some((executor, PortEnds { output: Some(end), .. })) = end(from.0, from.1) {
            let into = end.forgetting_box();
            self.commit(executor, Change::Forget { end, wire: id, into }, fabric)?;
        }
        let end =
            |id: AgentId, port: usize| self.by_id(id).map(|known| (known.executor, known.ends[port].clone()));
        if let Some((executor, PortEnds { input: Some(end), .. })) = end(to.0, to.1) {
            self.leave(executor, end, id, force, fabric);
        }
        self.wires.retain(|wire| wire.id != id);
        Ok(())
    }

    /// Takes the lanes of a wire out of a mailbox, when it is drained unless that is not waited for. An executor that does not answer does it
    /// when it does: nobody sends on that wire any more.
    pub(super) fn leave(
        &mut self,
        executor: usize,
        end: Arc<dyn InputEnd>,
        wire: WireId,
        force: bool,
        fabric: &mut dyn Fabric,
    ) {
        // A receiver that takes nothing any more is not waited for: what lies in its mailbox is lost with it.
        const PATIENCE: usize = 100;
        for attempt in 0..=PATIENCE {
            let (into, force) = (end.leaving_box(), force || attempt == PATIENCE);
            let change = Change::Leave { end: end.clone(), wire, into, force };
            match self.commit_and_get(executor, change, fabric) {
                Ok(Committed::Done) => return,
                Ok(Committed::NotDrained) => {}
                Err(_) => {
                    self.owed.push(Owed { executor, wire, end: OwedEnd::Leave(end) });
                    return;
                }
            }
        }
    }

    /// Takes the route of a wire out of an output. An executor that does not answer does it when it does.
    pub(super) fn forget(
        &mut self,
        executor: usize,
        end: Arc<dyn OutputEnd>,
        wire: WireId,
        fabric: &mut dyn Fabric,
    ) {
        let into = end.forgetting_box();
        if self.commit_and_get(executor, Change::Forget { end: end.clone(), wire, into }, fabric).is_err() {
            self.owed.push(Owed { executor, wire, end: OwedEnd::Forget(end) });
        }
    }

    /// An executor has answered: what it owes from the time when it did not is made up for.
    pub(super) fn make_up(&mut self, executor: usize, fabric: &mut dyn Fabric) {
        while let Some(at) = self.owed.iter().position(|owed| owed.executor == executor) {
            let Owed { wire, end, .. } = self.owed.swap_remove(at);
            let before = self.owed.len();
            match end {
                OwedEnd::Forget(end) => self.forget(executor, end, wire, fabric),
                OwedEnd::Leave(end) => self.leave(executor, end, wire, true, fabric),
            }
            if self.owed.len() > before {
                return;
            }
        }
    }
}
