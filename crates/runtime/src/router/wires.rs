//! Making and cutting wires.

use std::sync::Arc;

use super::script::{Cut, DRAINS_WITHIN, Step, Tally, What};
use super::{PortId, Reply, Router, Staged, Wire};
use crate::executor::Change;
use crate::plan::{USUAL_DEPTH, USUAL_DEPTH_ON, WirePlan};
use crate::port::{Direction, NoSeat, Target, WireCounts, WireId, WireSpec};
use crate::request::{Refusal, WireTotals};
use crate::ring::Overload;
use crate::service::answers_for;
use types::{Filter, Priority, Time};

/// Why a second sender cannot be wired to a port that takes one.
pub(crate) fn commanded_by_two(one: &str, other: &str, port: &str) -> Refusal {
    Refusal::new(format!("both {one} and {other} command {port}"))
        .help("wire both to a coordinator, which chooses or fuses, and that to the actuator")
}

impl Router {
    pub(super) fn find_wire(&self, from: PortId, to: PortId) -> Option<&Wire> {
        let wires = self.agents.get(&from.0)?.wires.iter().filter_map(|id| self.wires.get(id));
        wires.into_iter().find(|wire| wire.from == from && wire.to == to && !wire.is_answer)
    }

    pub(super) fn plan_of(&self, wire: &Wire) -> WirePlan {
        let name = |(id, port): PortId| {
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
    pub(crate) fn wire(&mut self, plan: &WirePlan, staged: &mut Staged) -> Reply<()> {
        if let Some(side) = self.queue_side(plan)? {
            return self.wire_queue(plan, side, staged);
        }
        let (from, to) = (self.port(&plan.from)?, self.port(&plan.to)?);
        if self.find_wire(from, to).is_some() {
            return Err(Refusal::new(format!("{} is already wired to {}", plan.from, plan.to)));
        }
        let is_ordinary = |port: PortId| self.agents[&port.0].kind.ports[port.1].options.is_ordinary();
        if self.agents[&to.0].kind.ports[to.1].options.single && is_ordinary(from) {
            let wires = self.agents[&to.0].wires.iter().filter_map(|id| self.wires.get(id));
            if let Some(other) = wires.into_iter().find(|wire| wire.to == to && is_ordinary(wire.from)) {
                return Err(commanded_by_two(&self.plan_of(other).from, &plan.from, &plan.to));
            }
        }
        let recipient = plan.filter.recipient.as_ref().map(|name| self.id_of(name)).transpose()?;
        let filter = plan.filter.with_recipient(recipient);
        let (sender, receiver) = (&self.agents[&from.0], &self.agents[&to.0]);
        let (out_port, in_port) = (&sender.kind.ports[from.1], &receiver.kind.ports[to.1]);
        match (out_port.shape.direction, in_port.shape.direction) {
            (Direction::Output, Direction::Input) => {
                self.check_types(plan, from, to)?;
                self.lay(from, to, plan, filter, false, staged).map(drop)
            }
            (Direction::Client, Direction::Service) => {
                self.check_types(plan, from, to)?;
                self.check_types(plan, to, from)?;
                let answers = self.lay(to, from, plan, answers_for(from.0), true, staged)?;
                let calls = self.lay(from, to, plan, filter, false, staged)?;
                if let Some(wire) = self.wires.get_mut(&calls) {
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

    fn check_types(&self, plan: &WirePlan, from: PortId, to: PortId) -> Reply<()> {
        let (sender, receiver) = (&self.agents[&from.0], &self.agents[&to.0]);
        let out = sender.ends[from.1].output.as_ref().map(|end| end.message_type());
        let into = receiver.ends[to.1].input.as_ref().map(|end| end.message_type());
        match (out, into) {
            (Some(out), Some(into)) if out == into => Ok(()),
            (Some(out), Some(into)) => {
                let fitting = sender.kind.ports.iter().filter(|port| port.shape.output == Some(into));
                let fits: Vec<String> =
                    fitting.map(|port| format!("{}.{}", sender.plan.name, port.name)).collect();
                let (sends, takes) = (out.short_name(), into.short_name());
                let refusal = Refusal::new(format!("{} sends {sends}, {} takes {takes}", plan.from, plan.to));
                Err(if fits.is_empty() {
                    refusal
                } else {
                    refusal.help(format!("did you mean {}?", fits.join(" or ")))
                })
            }
            _ => Err(Refusal::new(format!("{} cannot be wired to {}", plan.from, plan.to))),
        }
    }

    /// Makes one wire of rings: the receiver joins, then the sender adds.
    fn lay(
        &mut self,
        from: PortId,
        to: PortId,
        plan: &WirePlan,
        passes: Filter,
        is_answer: bool,
        staged: &mut Staged,
    ) -> Reply<WireId> {
        let wakes = self.agents[&to.0].wakes(to.1);
        let depth = plan.depth.unwrap_or(if wakes { USUAL_DEPTH_ON } else { USUAL_DEPTH });
        let overload = plan.overload.unwrap_or(if wakes { Overload::Refuse } else { Overload::NewestWins });
        if depth == 0 || depth > crate::ring::MOST_MESSAGES {
            let most = crate::ring::MOST_MESSAGES;
            return Err(Refusal::new(format!("a wire holds from 1 to {most} messages, not {depth}")));
        }
        let id = self.wire_id();
        let wire = Wire {
            id,
            ring: id,
            from,
            to,
            partner: None,
            is_answer,
            depth,
            overload,
            filter: plan.filter.clone(),
            passes,
            counts: Arc::new(WireCounts::default()),
            past: WireTotals::default(),
        };
        let steps = self.connect(&wire)?;
        staged.undo(move |router| {
            router.unlist(id);
            router.of_mut(to.0, |known| known.joined(to.1, -1));
            router.of_mut(from.0, |known| known.routed(from.1, -1));
        });
        steps.into_iter().for_each(|step| staged.step(step));
        let (sender, receiver) = (self.agents[&from.0].executor, self.agents[&to.0].executor);
        if sender == receiver && wakes {
            staged.reorder(sender);
        }
        self.list(wire);
        Ok(id)
    }

    /// Prepares the rings of a wire, and counts them.
    pub(super) fn connect(&mut self, wire: &Wire) -> Reply<[Step; 2]> {
        let (sender, receiver) = (&self.agents[&wire.from.0], &self.agents[&wire.to.0]);
        let ends = (sender.ends[wire.from.1].output.clone(), receiver.ends[wire.to.1].input.clone());
        let (Some(output), Some(input)) = ends else {
            let WirePlan { from, to, .. } = self.plan_of(wire);
            return Err(Refusal::new(format!("{from} cannot be wired to {to}")));
        };
        let target = Target {
            agent: receiver.id,
            executor: receiver.executor as u32,
            slot: receiver.slot,
            door: self.executors[receiver.executor].link.door.clone(),
            wakes: receiver.wakes(wire.to.1),
        };
        let (depth, overload, counts) = (wire.depth, wire.overload, wire.counts.clone());
        let spec = WireSpec { id: wire.ring, depth, overload, filter: wire.passes, target, counts };
        let (routes, lanes) = (sender.rings[wire.from.1].out, receiver.rings[wire.to.1].into);
        let priorities = sender.priorities(wire.from.1);
        let made = output.prepare(&spec, &priorities, routes, lanes * Priority::ALL.len());
        let made = made.map_err(|NoSeat { seats }| {
            let from = self.plan_of(wire).from;
            Refusal::new(format!("{from} has readers on all {seats} seats of its memory"))
        })?;
        let step =
            |executor, of, change| Step { executor, of, ring: Some(wire.ring), what: What::Change(change) };
        let join = Change::Join { end: input, lanes: made.lanes, slot: receiver.slot };
        let route = Change::Route { end: output, route: made.route, slot: sender.slot };
        let steps = [step(receiver.executor, receiver.id, join), step(sender.executor, sender.id, route)];
        self.of_mut(wire.to.0, |known| known.joined(wire.to.1, 1));
        self.of_mut(wire.from.0, |known| known.routed(wire.from.1, 1));
        Ok(steps)
    }

    pub(super) fn list(&mut self, wire: Wire) {
        for id in [wire.from.0, wire.to.0] {
            self.of_mut(id, |known| _ = known.wires.insert(wire.id));
        }
        self.wires.insert(wire.id, wire);
    }

    pub(super) fn unlist(&mut self, id: WireId) -> Option<Wire> {
        let wire = self.wires.remove(&id)?;
        for agent in [wire.from.0, wire.to.0] {
            self.of_mut(agent, |known| _ = known.wires.remove(&id));
        }
        Some(wire)
    }

    pub(super) fn wire_id(&mut self) -> WireId {
        self.next_wire += 1;
        WireId(self.next_wire - 1)
    }

    pub(super) fn unwire(&mut self, from: &str, to: &str, staged: &mut Staged) -> Reply<()> {
        if self.is_queue(from) || self.is_queue(to) {
            return self.unwire_queue(from, to, staged);
        }
        let (out, into) = (self.port(from)?, self.port(to)?);
        let Some(wire) = self.find_wire(out, into) else {
            let wires = self.agents[&out.0].wires.iter().filter_map(|id| self.wires.get(id));
            let known: Vec<String> =
                wires.filter(|wire| wire.from == out).map(|wire| self.plan_of(wire).to).collect();
            let refusal = Refusal::new(format!("{from} is not wired to {to}"));
            return Err(if known.is_empty() {
                refusal
            } else {
                refusal.help(format!("it is wired to {}", known.join(", ")))
            });
        };
        let (id, partner) = (wire.id, wire.partner);
        self.cut(id, true, staged);
        if let Some(partner) = partner {
            self.cut(partner, true, staged);
        }
        Ok(())
    }

    /// Cuts one wire of rings: the sender forgets, then the receiver leaves; when it is drained, if that is waited for.
    pub(super) fn cut(&mut self, id: WireId, drains: bool, staged: &mut Staged) {
        let Some(wire) = self.unlist(id) else { return };
        if let Some(step) = self.forget_step(&wire) {
            staged.step(step);
        }
        let until = if drains { self.now + DRAINS_WITHIN } else { self.now };
        if let Some((executor, cut)) = self.cut_of(&wire, Tally::Wire(wire.id, wire.past), until) {
            staged.cut(executor, cut);
        }
        staged.undo(move |router| router.list(wire));
    }

    /// The sender of a wire forgets its present ring.
    pub(super) fn forget_step(&self, wire: &Wire) -> Option<Step> {
        let sender = self.by_id(wire.from.0)?;
        let end = sender.ends[wire.from.1].output.clone()?;
        let (into, slot) = (end.forgetting_box(), sender.slot);
        let change = Change::Forget { end, wire: wire.ring, into, slot };
        Some(Step { executor: sender.executor, of: sender.id, ring: None, what: What::Change(change) })
    }

    /// The receiver of a wire leaves its present ring.
    pub(super) fn cut_of(&self, wire: &Wire, into: Tally, until: Time) -> Option<(usize, Cut)> {
        let receiver = self.by_id(wire.to.0)?;
        let end = receiver.ends[wire.to.1].input.clone()?;
        let Wire { from, to, ring, .. } = *wire;
        let counts = wire.counts.clone();
        let cut = Cut { slot: receiver.slot, to, from, end, ring, counts, into, until };
        Some((receiver.executor, cut))
    }
}
