//! Queues: making them, wiring senders and receivers to them, and whose turn it is.
//!
//! A sender's end and a receiver's end go to their executors by the same changes as the ends of a wire. What waits in a queue belongs to
//! the queue: no sender or receiver that comes or goes takes it away.

use core::cmp::Reverse;
use core::sync::atomic::Ordering::Relaxed;
use std::sync::Arc;

use types::AgentId;

use super::{Fabric, Reply, Router};
use crate::executor::Change;
use crate::plan::{WireFilter, WirePlan};
use crate::port::{InputEnd, OutputEnd, QueueEnd, QueueForm, QueueWire, WireCounts, WireId};
use crate::queue_plan::{
    QueuePlan, QueueSide, between_queues, check_wire, is_full, other_type, serving_elsewhere,
};
use crate::request::{QueueView, ReceiverView, Refusal, WireView};

/// A queue as the router knows it.
pub(super) struct Queue {
    plan: QueuePlan,
    /// Made when the first wire says what it holds.
    end: Option<Arc<dyn QueueEnd>>,
    senders: Vec<Into>,
    receivers: Vec<OutOf>,
    /// What was counted on wires that are no more.
    past: Past,
}

/// A wire into a queue.
struct Into {
    id: WireId,
    from: (AgentId, usize),
    filter: WireFilter,
    rings: Vec<usize>,
    counts: Arc<WireCounts>,
}

/// A wire out of a queue.
struct OutOf {
    id: WireId,
    to: (AgentId, usize),
    serving: Option<u8>,
    seat: u32,
    counts: Arc<WireCounts>,
}

#[derive(Default)]
struct Past {
    sent: u64,
    dropped: u64,
    refused: u64,
    taken: u64,
}

impl Past {
    fn add(&mut self, counts: &WireCounts) {
        self.sent += counts.sent.load(Relaxed);
        self.dropped += counts.dropped.load(Relaxed);
        self.refused += counts.refused.load(Relaxed);
        self.taken += counts.taken.load(Relaxed);
    }
}

/// A wire to or from a queue: the place of the queue, the side, the place of the wire on that side.
type Found = (usize, QueueSide, usize);

impl Router {
    fn queue_at(&self, name: &str) -> Option<usize> {
        self.queues.iter().position(|queue| queue.plan.name == name)
    }

    /// Whether this is the name of a queue.
    pub(super) fn is_queue(&self, name: &str) -> bool {
        self.queue_at(name).is_some()
    }

    /// Adds a queue.
    pub(crate) fn add_queue(&mut self, plan: QueuePlan) -> Reply<()> {
        plan.check()?;
        let name = &plan.name;
        if self.is_queue(name) || self.agents.iter().any(|agent| agent.plan.name == *name) {
            return Err(Refusal::new(format!("there is already something called \"{name}\""))
                .help("names are given once"));
        }
        let plan = QueuePlan { depth: Some(plan.depth()), overload: Some(plan.overload()), ..plan };
        let (senders, receivers, past) = (Vec::new(), Vec::new(), Past::default());
        self.queues.push(Queue { plan, end: None, senders, receivers, past });
        Ok(())
    }

    /// Removes a queue that nobody is wired to and that holds nothing.
    pub(super) fn remove_queue(&mut self, name: &str) -> Reply<()> {
        let at = self.queue_at(name).ok_or_else(|| self.no_queue(name))?;
        let queue = &self.queues[at];
        let wires = queue.senders.len() + queue.receivers.len();
        if wires > 0 {
            return Err(Refusal::new(format!("{wires} wires lead to queue \"{name}\" or from it"))
                .help("cut them first"));
        }
        let waiting = queue.end.as_ref().map_or(0, |end| end.waiting());
        if waiting > 0 {
            return Err(Refusal::new(format!("{waiting} messages wait in queue \"{name}\""))
                .help("wire it to an input that takes them"));
        }
        self.queues.remove(at);
        Ok(())
    }

    fn no_queue(&self, name: &str) -> Refusal {
        Refusal::unknown("queue", name, self.queues.iter().map(|queue| queue.plan.name.as_str()))
    }

    /// The side on which a wire has a queue; an error where it has one on both.
    fn side_of(&self, wire: &WirePlan) -> Reply<Option<QueueSide>> {
        match (self.is_queue(&wire.from), self.is_queue(&wire.to)) {
            (true, true) => Err(between_queues(wire)),
            (true, false) => Ok(Some(QueueSide::OutOf)),
            (false, true) => Ok(Some(QueueSide::Into)),
            (false, false) if wire.serving.is_some() => Err(serving_elsewhere(wire)),
            (false, false) => Ok(None),
        }
    }

    /// Makes a wire to or from a queue; nothing where neither end is one.
    pub(super) fn wire_queue(&mut self, wire: &WirePlan, fabric: &mut dyn Fabric) -> Option<Reply<()>> {
        let side = match self.side_of(wire) {
            Ok(side) => side?,
            Err(refusal) => return Some(Err(refusal)),
        };
        Some(match side {
            QueueSide::Into => self.wire_into(wire, fabric),
            QueueSide::OutOf => self.wire_out_of(wire, fabric),
        })
    }

    fn wire_into(&mut self, wire: &WirePlan, fabric: &mut dyn Fabric) -> Reply<()> {
        let (agent, port) = self.port(&wire.from)?;
        let known = &self.agents[agent];
        check_wire(wire, QueueSide::Into, &known.kind.ports[port].shape)?;
        self.not_twice(wire)?;
        let Some(output) = known.ends[port].output.clone() else {
            return Err(Refusal::new(format!("{} sends nothing", wire.from)));
        };
        let recipient = wire.filter.recipient.as_ref().map(|name| self.known(name)).transpose()?;
        let filter = wire.filter.with_recipient(recipient.map(|known| known.id));
        let (id, executor) = (known.id, known.executor);
        let priorities = known.priorities(port);
        let from = (id, port);
        let made = |form: QueueForm| output.queue(form);
        let (at, end) = self.queue_for(&wire.to, &wire.from, output.message_type(), made)?;
        let spec = QueueWire { id: self.wire_id(), filter, counts: Arc::default() };
        let routes = self.routes_from(from);
        let (route, rings) = end
            .prepare_sender(&spec, routes, &priorities)
            .ok_or_else(|| is_full(&wire.to, QueueSide::Into))?;
        self.commit(executor, Change::Route { end: output, route }, fabric)?;
        let filter = wire.filter.clone();
        self.queues[at].senders.push(Into { id: spec.id, from, filter, rings, counts: spec.counts });
        self.order_anew(at, executor, fabric)
    }

    fn wire_out_of(&mut self, wire: &WirePlan, fabric: &mut dyn Fabric) -> Reply<()> {
        let (agent, port) = self.port(&wire.to)?;
        let known = &self.agents[agent];
        check_wire(wire, QueueSide::OutOf, &known.kind.ports[port].shape)?;
        self.not_twice(wire)?;
        let Some(input) = known.ends[port].input.clone() else {
            return Err(Refusal::new(format!("{} takes nothing", wire.to)));
        };
        let (to, executor, slot) = ((known.id, port), known.executor, known.slot);
        let made = |form: QueueForm| input.queue(form);
        let (at, end) = self.queue_for(&wire.from, &wire.to, input.message_type(), made)?;
        let spec = QueueWire { id: self.wire_id(), filter: Default::default(), counts: Arc::default() };
        let lanes = self.lanes_into(to);
        let (lanes, seat) = end
            .prepare_receiver(&spec, lanes, executor as u32, slot)
            .ok_or_else(|| is_full(&wire.from, QueueSide::OutOf))?;
        let (serving, counts) = (wire.serving, spec.counts);
        self.queues[at].receivers.push(OutOf { id: spec.id, to, serving, seat, counts });
        // Whose turn it is must be known before it waits.
        self.rank_receivers();
        let joined = self.commit(executor, Change::Join { end: input, lanes, slot }, fabric);
        if joined.is_err() {
            self.queues[at].receivers.pop();
            self.rank_receivers();
            return joined;
        }
        self.order_anew(at, executor, fabric)
    }

    fn not_twice(&self, wire: &WirePlan) -> Reply<()> {
        match self.find_queue_wire(&wire.from, &wire.to) {
            Some(_) => Err(Refusal::new(format!("{} is already wired to {}", wire.from, wire.to))),
            None => Ok(()),
        }
    }

    /// The queue of this name, which holds messages of this type, or does from now on.
    fn queue_for(
        &mut self,
        name: &str,
        port: &str,
        message: &'static crate::message_type::MessageType,
        make: impl FnOnce(QueueForm) -> Option<Arc<dyn QueueEnd>>,
    ) -> Reply<(usize, Arc<dyn QueueEnd>)> {
        let at = self.queue_at(name).ok_or_else(|| self.no_queue(name))?;
        if let Some(end) = &self.queues[at].end
            && end.message_type() != message
            && self.holds_nothing(at)
        {
            // Nobody is left to whom the old type matters.
            self.queues[at].end = None;
        }
        let doors = self.executors.iter().map(|executor| executor.link.door.clone()).collect();
        let queue = &mut self.queues[at];
        if let Some(end) = &queue.end {
            if end.message_type() != message {
                return Err(other_type(name, end.message_type(), port, message));
            }
            return Ok((at, end.clone()));
        }
        let form = QueueForm { depth: queue.plan.depth(), overload: queue.plan.overload(), doors };
        let end = make(form).ok_or_else(|| Refusal::new(format!("{port} cannot be wired to a queue")))?;
        queue.end = Some(end.clone());
        Ok((at, end))
    }

    fn holds_nothing(&self, at: usize) -> bool {
        let queue = &self.queues[at];
        let is_empty = queue.end.as_ref().is_none_or(|end| end.waiting() == 0);
        is_empty && queue.senders.is_empty() && queue.receivers.is_empty()
    }

    /// Senders go before receivers where they are of one executor.
    fn order_anew(&mut self, at: usize, executor: usize, fabric: &mut dyn Fabric) -> Reply<()> {
        let queue = &self.queues[at];
        let ends = queue.senders.iter().map(|wire| wire.from.0);
        let mut ends = ends.chain(queue.receivers.iter().map(|wire| wire.to.0));
        let several = ends
            .by_ref()
            .filter(|id| self.by_id(*id).is_some_and(|known| known.executor == executor))
            .count()
            > 1;
        if several { self.commit_order(executor, fabric) } else { Ok(()) }
    }

    /// Says whose turn it is: the highest serving priority, then the executor, then the data flow.
    pub(super) fn rank_receivers(&mut self) {
        for queue in &self.queues {
            let Some(end) = &queue.end else { continue };
            let mut order: Vec<_> = queue
                .receivers
                .iter()
                .filter_map(|wire| {
                    let known = self.by_id(wire.to.0)?;
                    let usual = self.executors[known.executor].plan.priority.unwrap_or(0);
                    let flow = self.data_flow_order(known.executor);
                    let rank = flow.iter().position(|slot| *slot == known.slot);
                    Some((Reverse(wire.serving.unwrap_or(usual)), known.executor, rank, wire.to.1, wire.seat))
                })
                .collect();
            order.sort_unstable();
            for (rank, (.., seat)) in order.iter().enumerate() {
                end.set_rank(*seat, rank as u32);
            }
        }
    }

    fn find_queue_wire(&self, from: &str, to: &str) -> Option<Found> {
        let end = |name: &str| self.port(name).ok().map(|(agent, port)| (self.agents[agent].id, port));
        if let Some(at) = self.queue_at(to) {
            let from = end(from)?;
            let place = self.queues[at].senders.iter().position(|wire| wire.from == from)?;
            return Some((at, QueueSide::Into, place));
        }
        let at = self.queue_at(from)?;
        let to = end(to)?;
        let place = self.queues[at].receivers.iter().position(|wire| wire.to == to)?;
        Some((at, QueueSide::OutOf, place))
    }

    /// A wire to or from a queue, as a plan would give it.
    pub(super) fn queue_wire(&self, from: &str, to: &str) -> Option<WirePlan> {
        self.find_queue_wire(from, to).map(|found| self.plan_of_found(found))
    }

    fn plan_of_found(&self, (at, side, place): Found) -> WirePlan {
        let queue = &self.queues[at];
        match side {
            QueueSide::Into => {
                let wire = &queue.senders[place];
                let filter = wire.filter.clone();
                WirePlan { filter, ..WirePlan::new(self.port_name(wire.from), queue.plan.name.clone()) }
            }
            QueueSide::OutOf => {
                let wire = &queue.receivers[place];
                let serving = wire.serving;
                WirePlan { serving, ..WirePlan::new(queue.plan.name.clone(), self.port_name(wire.to)) }
            }
        }
    }

    fn port_name(&self, (id, port): (AgentId, usize)) -> String {
        self.by_id(id)
            .map_or_else(String::new, |known| format!("{}.{}", known.plan.name, known.kind.ports[port].name))
    }

    /// Cuts a wire to or from a queue; nothing where neither end is one.
    pub(super) fn unwire_queue(
        &mut self,
        from: &str,
        to: &str,
        fabric: &mut dyn Fabric,
    ) -> Option<Reply<()>> {
        if !self.is_queue(from) && !self.is_queue(to) {
            return None;
        }
        let found = self.find_queue_wire(from, to);
        let missing = || {
            // Which end is wrong is said first.
            let ports = [from, to].into_iter().filter(|name| !self.is_queue(name));
            let wrong = ports.map(|name| self.port(name)).find_map(Result::err);
            wrong.unwrap_or_else(|| Refusal::new(format!("{from} is not wired to {to}")))
        };
        Some(found.ok_or_else(missing).and_then(|found| self.cut_queue_wire(found, fabric)))
    }

    /// What the sender has sent stays in the queue; what the receiver has not taken goes to others.
    fn cut_queue_wire(&mut self, (at, side, place): Found, fabric: &mut dyn Fabric) -> Reply<()> {
        match side {
            QueueSide::Into => {
                let wire = &self.queues[at].senders[place];
                let (id, from) = (wire.id, wire.from);
                if let Some((executor, output)) = self.output_of(from) {
                    let into = output.forgetting_box();
                    self.commit(executor, Change::Forget { end: output, wire: id, into }, fabric)?;
                }
                let queue = &mut self.queues[at];
                let gone = queue.senders.remove(place);
                queue.past.add(&gone.counts);
            }
            QueueSide::OutOf => {
                let queue = &mut self.queues[at];
                let gone = queue.receivers.remove(place);
                if let Some(end) = &queue.end {
                    end.close_receiver(gone.seat);
                }
                if let Some((executor, input)) = self.input_of(gone.to) {
                    self.leave(executor, input, gone.id, true, fabric);
                }
                // Its executor has answered, or does not: what it took is counted as far as is known.
                self.queues[at].past.add(&gone.counts);
                if let Some(end) = &self.queues[at].end {
                    end.call_again();
                }
                self.rank_receivers();
            }
        }
        Ok(())
    }

    fn output_of(&self, (id, port): (AgentId, usize)) -> Option<(usize, Arc<dyn OutputEnd>)> {
        self.by_id(id).and_then(|known| Some((known.executor, known.ends[port].output.clone()?)))
    }

    fn input_of(&self, (id, port): (AgentId, usize)) -> Option<(usize, Arc<dyn InputEnd>)> {
        self.by_id(id).and_then(|known| Some((known.executor, known.ends[port].input.clone()?)))
    }

    /// The wires of an agent to and from queues.
    fn queue_wires_of(&self, id: AgentId) -> Vec<Found> {
        let mut found = Vec::new();
        for (at, queue) in self.queues.iter().enumerate() {
            let senders = queue.senders.iter().enumerate().filter(|(_, wire)| wire.from.0 == id);
            found.extend(senders.map(|(place, _)| (at, QueueSide::Into, place)));
            let receivers = queue.receivers.iter().enumerate().filter(|(_, wire)| wire.to.0 == id);
            found.extend(receivers.map(|(place, _)| (at, QueueSide::OutOf, place)));
        }
        found
    }

    /// The wire of somebody else into a queue that takes only what is for this agent.
    pub(super) fn queue_wire_for(&self, name: &str, id: AgentId) -> Option<WirePlan> {
        let found = self.all_queue_wires().find(|(at, side, place)| {
            *side == QueueSide::Into && {
                let wire = &self.queues[*at].senders[*place];
                wire.from.0 != id && wire.filter.recipient.as_deref() == Some(name)
            }
        });
        found.map(|found| self.plan_of_found(found))
    }

    /// Cuts all wires of an agent to and from queues.
    pub(super) fn leave_queues(&mut self, id: AgentId, fabric: &mut dyn Fabric) -> Reply<()> {
        // From the last to the first, so that the places stay right.
        self.queue_wires_of(id).into_iter().rev().try_for_each(|found| self.cut_queue_wire(found, fabric))
    }

    /// An agent does not come back from its step, and may still use its ends of queues: nothing comes from them and nothing is taken
    /// by them any more. Others are called for what it has not taken, and for what it has sent and told nobody of. Gives its wires,
    /// to be made anew.
    pub(super) fn abandon_queues(&mut self, id: AgentId) -> Vec<WirePlan> {
        let found = self.queue_wires_of(id);
        let plans = found.iter().map(|found| self.plan_of_found(*found)).collect();
        for (at, side, place) in found.into_iter().rev() {
            let queue = &mut self.queues[at];
            let Some(end) = &queue.end else { continue };
            match side {
                QueueSide::Into => {
                    let gone = queue.senders.remove(place);
                    end.close_sender(&gone.rings);
                    queue.past.add(&gone.counts);
                }
                QueueSide::OutOf => {
                    let gone = queue.receivers.remove(place);
                    end.close_receiver(gone.seat);
                    queue.past.add(&gone.counts);
                }
            }
            end.call_again();
        }
        plans
    }

    /// How many routes lead from a port into queues.
    pub(super) fn queues_from(&self, port: (AgentId, usize)) -> usize {
        self.queues.iter().flat_map(|queue| &queue.senders).filter(|wire| wire.from == port).count()
    }

    /// How many lanes lead from queues into a port.
    pub(super) fn queues_into(&self, port: (AgentId, usize)) -> usize {
        self.queues.iter().flat_map(|queue| &queue.receivers).filter(|wire| wire.to == port).count()
    }

    /// Who sends to whom by way of queues.
    pub(super) fn flow_of_queues(&self) -> impl Iterator<Item = (AgentId, AgentId)> {
        self.queues.iter().flat_map(|queue| {
            let senders = queue.senders.iter().map(|wire| wire.from.0);
            senders.flat_map(|from| queue.receivers.iter().map(move |wire| (from, wire.to.0)))
        })
    }

    /// The queues and their wires, as a plan would give them.
    pub(super) fn plans_of_queues(&self) -> (Vec<QueuePlan>, Vec<WirePlan>) {
        let queues = self.queues.iter().map(|queue| queue.plan.clone()).collect();
        (queues, self.all_queue_wires().map(|found| self.plan_of_found(found)).collect())
    }

    fn all_queue_wires(&self) -> impl Iterator<Item = Found> {
        self.queues.iter().enumerate().flat_map(|(at, queue)| {
            let into = (0..queue.senders.len()).map(move |place| (at, QueueSide::Into, place));
            into.chain((0..queue.receivers.len()).map(move |place| (at, QueueSide::OutOf, place)))
        })
    }

    /// What a running system says of its queues.
    pub(super) fn view_queues(&self) -> Vec<QueueView> {
        self.queues.iter().map(|queue| self.view_queue(queue)).collect()
    }

    fn view_queue(&self, queue: &Queue) -> QueueView {
        let mut all = Past { ..queue.past };
        queue.senders.iter().map(|wire| &wire.counts).for_each(|counts| all.add(counts));
        queue.receivers.iter().map(|wire| &wire.counts).for_each(|counts| all.add(counts));
        let receivers = queue.receivers.iter().map(|wire| {
            let known = self.by_id(wire.to.0);
            let usual = known.and_then(|known| self.executors[known.executor].plan.priority);
            ReceiverView {
                to: self.port_name(wire.to),
                serving: wire.serving.or(usual).unwrap_or(0),
                taken: wire.counts.taken.load(Relaxed),
            }
        });
        QueueView {
            name: queue.plan.name.clone(),
            message: queue.end.as_ref().map_or("", |end| end.message_type().short_name()),
            depth: queue.plan.depth(),
            overload: queue.plan.overload(),
            waiting: queue.end.as_ref().map_or(0, |end| end.waiting()),
            sent: all.sent,
            dropped: all.dropped,
            refused: all.refused,
            taken: all.taken,
            receivers: receivers.collect(),
        }
    }

    /// What it says of the wires to and from them.
    pub(super) fn view_queue_wires(&self) -> Vec<WireView> {
        let found = self.all_queue_wires();
        found.map(|(at, side, place)| self.view_queue_wire((at, side, place))).collect()
    }

    fn view_queue_wire(&self, found: Found) -> WireView {
        let (at, side, place) = found;
        let queue = &self.queues[at];
        let counts = match side {
            QueueSide::Into => &queue.senders[place].counts,
            QueueSide::OutOf => &queue.receivers[place].counts,
        };
        let plan = self.plan_of_found(found);
        WireView {
            from: plan.from,
            to: plan.to,
            message: queue.end.as_ref().map_or("", |end| end.message_type().short_name()),
            depth: queue.plan.depth(),
            overload: queue.plan.overload(),
            filter: plan.filter,
            sent: counts.sent.load(Relaxed),
            dropped: counts.dropped.load(Relaxed),
            refused: counts.refused.load(Relaxed),
            taken: counts.taken.load(Relaxed),
            expired: counts.expired.load(Relaxed),
        }
    }
}
