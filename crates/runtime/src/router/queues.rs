//! Queues: making them, wiring senders and receivers to them, and whose turn it is.
//!
//! A sender's end and a receiver's end go to their executors by the same steps as the ends of a wire. What waits in a queue belongs to
//! the queue: no sender or receiver that comes or goes takes it away. A receiver that is to go is closed as soon as that is decided:
//! from then on it takes nothing, whenever its executor comes to it, and others are called for what waits.

use core::cmp::Reverse;
use std::collections::BTreeMap;
use std::sync::Arc;

use types::{AgentId, Filter, Priority};

use super::asking::row_of_queue;
use super::script::{Step, What};
use super::{Known, PortId, Reply, Router, Staged};
use crate::composition::WireRow;
use crate::door::bit_of;
use crate::executor::Change;
use crate::message_type::MessageType;
use crate::plan::{WireFilter, WirePlan};
use crate::port::{QueueEnd, QueueForm, QueueWire, WireCounts, WireId};
use crate::queue_plan::{
    QueuePlan, QueueSide, between_queues, check_wire, is_full, other_type, serving_elsewhere,
};
use crate::request::{QueueView, ReceiverView, Refusal, WireTotals, WireView};

/// A queue as the router knows it.
pub(super) struct Queue {
    plan: QueuePlan,
    /// It is never given twice, as its name may be.
    number: u64,
    /// Made when the first wire says what it holds.
    end: Option<Arc<dyn QueueEnd>>,
    senders: Vec<Into>,
    receivers: Vec<OutOf>,
    /// Wires that are cut, while an executor has their ends still.
    gone: Vec<Gone>,
    /// What was counted on wires that are no more.
    past: WireTotals,
}

/// A wire into a queue.
#[derive(Clone)]
struct Into {
    id: WireId,
    from: PortId,
    filter: WireFilter,
    /// The same with the number of the recipient.
    passes: Filter,
    rings: Vec<usize>,
    counted: Counted,
}

/// A wire out of a queue.
#[derive(Clone)]
struct OutOf {
    id: WireId,
    to: PortId,
    serving: Option<u8>,
    seat: u32,
    counted: Counted,
}

/// A wire that was cut.
struct Gone {
    id: WireId,
    /// Whose end it has.
    of: AgentId,
    /// Those of a sender.
    rings: Vec<usize>,
    counted: Counted,
}

/// What was counted on a wire. An end that was lost, or is on its way back, counts for as long as somebody has it.
#[derive(Clone, Default)]
struct Counted {
    now: Arc<WireCounts>,
    before: Vec<Arc<WireCounts>>,
}

impl Counted {
    fn totals(&self) -> WireTotals {
        let mut totals = WireTotals::of(&self.now);
        self.before.iter().for_each(|counts| totals += WireTotals::of(counts));
        totals
    }

    /// Another end counts from now on.
    fn begin_anew(&mut self) {
        self.before.push(core::mem::take(&mut self.now));
    }

    /// Whether nobody has the ends any more.
    fn is_final(&mut self) -> bool {
        Arc::get_mut(&mut self.now).is_some() && self.before.iter_mut().all(|it| Arc::get_mut(it).is_some())
    }
}

impl Queue {
    fn totals(&self) -> WireTotals {
        let mut totals = self.past;
        let senders = self.senders.iter().map(|wire| &wire.counted);
        let receivers = self.receivers.iter().map(|wire| &wire.counted);
        let gone = self.gone.iter().map(|wire| &wire.counted);
        senders.chain(receivers).chain(gone).for_each(|counted| totals += counted.totals());
        totals
    }

    /// Forgets wires whose ends are back.
    fn settle(&mut self) {
        let past = &mut self.past;
        self.gone.retain_mut(|wire| {
            let is_final = wire.counted.is_final();
            if is_final {
                *past += wire.counted.totals();
            }
            !is_final
        });
    }

    fn is_of_nobody(&self) -> bool {
        let is_empty = self.end.as_ref().is_none_or(|end| end.waiting() == 0);
        is_empty && self.senders.is_empty() && self.receivers.is_empty()
    }
}

/// The names of queues with what they hold, and wires.
type PartsOfQueues<'a> = (Vec<(&'a str, Option<&'static MessageType>)>, Vec<WireRow>);

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

    /// Those whom messages of a queue make run.
    pub(super) fn receivers_of_queue(&self, name: &str) -> impl Iterator<Item = &Known> {
        let queue = self.queue_at(name).map(|at| &self.queues[at]);
        queue.into_iter().flat_map(|queue| self.woken_by(queue))
    }

    /// Those that send into a queue.
    pub(super) fn senders_of_queue(&self, name: &str) -> impl Iterator<Item = AgentId> {
        let queue = self.queue_at(name).map(|at| &self.queues[at]);
        queue.into_iter().flat_map(|queue| queue.senders.iter().map(|wire| wire.from.0))
    }

    /// Those whom an agent makes run by what it sends into queues.
    pub(super) fn served_by(&self, id: AgentId) -> impl Iterator<Item = &Known> {
        let queues =
            self.queues.iter().filter(move |queue| queue.senders.iter().any(|wire| wire.from.0 == id));
        queues.flat_map(|queue| self.woken_by(queue))
    }

    fn woken_by(&self, queue: &Queue) -> impl Iterator<Item = &Known> {
        let receivers = queue.receivers.iter().filter_map(|wire| self.by_id(wire.to.0).zip(Some(wire.to.1)));
        receivers.filter(|(known, port)| known.is_on(*port)).map(|(known, _)| known)
    }

    /// All queues with what they hold, and the wires to and from them.
    pub(super) fn parts_of_queues(&self) -> PartsOfQueues<'_> {
        let queues = self.queues.iter().map(|queue| {
            let message = queue.end.as_ref().map(|end| end.message_type());
            (queue.plan.name.as_str(), message)
        });
        let wires = self.queues.iter().enumerate().flat_map(|(at, queue)| {
            let into = queue.senders.iter().map(move |wire| row_of_queue(wire.from, at, true));
            into.chain(queue.receivers.iter().map(move |wire| row_of_queue(wire.to, at, false)))
        });
        (queues.collect(), wires.collect())
    }

    fn of_queue(&mut self, number: u64, change: impl FnOnce(&mut Queue)) {
        if let Some(queue) = self.queues.iter_mut().find(|queue| queue.number == number) {
            change(queue);
        }
    }

    /// Adds a queue.
    pub(crate) fn add_queue(&mut self, plan: QueuePlan, staged: &mut Staged) -> Reply<()> {
        plan.check()?;
        let name = &plan.name;
        if self.is_queue(name) || self.names.contains_key(name) {
            return Err(Refusal::new(format!("there is already something called \"{name}\""))
                .help("names are given once"));
        }
        let plan = QueuePlan { depth: Some(plan.depth()), overload: Some(plan.overload()), ..plan };
        self.added += 1;
        let number = self.added;
        let (senders, receivers, gone) = (Vec::new(), Vec::new(), Vec::new());
        let past = WireTotals::default();
        self.queues.push(Queue { plan, number, end: None, senders, receivers, gone, past });
        staged.undo(move |router| router.queues.retain(|queue| queue.number != number));
        Ok(())
    }

    /// Removes a queue that nobody is wired to and that holds nothing.
    pub(super) fn remove_queue(&mut self, name: &str, staged: &mut Staged) -> Reply<()> {
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
        let queue = self.queues.remove(at);
        let (end, totals) = (queue.end.clone(), queue.totals());
        staged.when_decided(move |router| {
            // Who has not forgotten it yet sends nothing more into it.
            if let Some(end) = end {
                end.close();
            }
            router.past += totals;
        });
        staged.undo(move |router| router.queues.insert(at, queue));
        Ok(())
    }

    fn no_queue(&self, name: &str) -> Refusal {
        Refusal::unknown("queue", name, self.queues.iter().map(|queue| queue.plan.name.as_str()))
    }

    /// The side on which a wire has a queue; an error where it has one on both.
    pub(super) fn queue_side(&self, wire: &WirePlan) -> Reply<Option<QueueSide>> {
        match (self.is_queue(&wire.from), self.is_queue(&wire.to)) {
            (true, true) => Err(between_queues(wire)),
            (true, false) => Ok(Some(QueueSide::OutOf)),
            (false, true) => Ok(Some(QueueSide::Into)),
            (false, false) if wire.serving.is_some() => Err(serving_elsewhere(wire)),
            (false, false) => Ok(None),
        }
    }

    /// Makes a wire to or from a queue.
    pub(super) fn wire_queue(&mut self, wire: &WirePlan, side: QueueSide, staged: &mut Staged) -> Reply<()> {
        match side {
            QueueSide::Into => self.wire_into(wire, staged),
            QueueSide::OutOf => self.wire_out_of(wire, staged),
        }
    }

    fn wire_into(&mut self, plan: &WirePlan, staged: &mut Staged) -> Reply<()> {
        let from = self.port(&plan.from)?;
        let known = &self.agents[&from.0];
        check_wire(plan, QueueSide::Into, &known.kind.ports[from.1].shape)?;
        self.not_twice(plan)?;
        let Some(output) = known.ends[from.1].output.clone() else {
            return Err(Refusal::new(format!("{} sends nothing", plan.from)));
        };
        let recipient = plan.filter.recipient.as_ref().map(|name| self.id_of(name)).transpose()?;
        let (filter, passes) = (plan.filter.clone(), plan.filter.with_recipient(recipient));
        let made = |form: QueueForm| output.queue(form);
        let at = self.queue_for(&plan.to, &plan.from, output.message_type(), made, staged)?;
        let id = self.wire_id();
        let mut wire = Into { id, from, filter, passes, rings: Vec::new(), counted: Counted::default() };
        let step = self.connect_into(at, &mut wire)?;
        let (number, executor) = (self.queues[at].number, step.executor);
        staged.step(step);
        self.queues[at].senders.push(wire);
        staged.undo(move |router| {
            router.of_queue(number, |queue| queue.senders.retain(|wire| wire.id != id));
            router.of_mut(from.0, |known| known.routed(from.1, -1));
        });
        self.order_anew(at, executor, staged);
        Ok(())
    }

    fn wire_out_of(&mut self, plan: &WirePlan, staged: &mut Staged) -> Reply<()> {
        let to = self.port(&plan.to)?;
        let known = &self.agents[&to.0];
        check_wire(plan, QueueSide::OutOf, &known.kind.ports[to.1].shape)?;
        self.not_twice(plan)?;
        let Some(input) = known.ends[to.1].input.clone() else {
            return Err(Refusal::new(format!("{} takes nothing", plan.to)));
        };
        let made = |form: QueueForm| input.queue(form);
        let at = self.queue_for(&plan.from, &plan.to, input.message_type(), made, staged)?;
        let (id, serving) = (self.wire_id(), plan.serving);
        let mut wire = OutOf { id, to, serving, seat: 0, counted: Counted::default() };
        let step = self.connect_out_of(at, &mut wire)?;
        let (number, executor) = (self.queues[at].number, step.executor);
        staged.step(step);
        // Whose turn it is must be known before it waits.
        staged.rank();
        self.queues[at].receivers.push(wire);
        staged.undo(move |router| {
            router.of_queue(number, |queue| queue.receivers.retain(|wire| wire.id != id));
            router.of_mut(to.0, |known| known.joined(to.1, -1));
        });
        self.order_anew(at, executor, staged);
        Ok(())
    }

    /// Prepares the end of a sender, and counts it.
    fn connect_into(&mut self, at: usize, wire: &mut Into) -> Reply<Step> {
        let full = || is_full(&self.queues[at].plan.name, QueueSide::Into);
        let known = &self.agents[&wire.from.0];
        let ends = (known.ends[wire.from.1].output.clone(), self.queues[at].end.clone());
        let (Some(output), Some(end)) = ends else { return Err(full()) };
        let spec = QueueWire { id: wire.id, filter: wire.passes, counts: wire.counted.now.clone() };
        let (routes, priorities) = (known.rings[wire.from.1].out, known.priorities(wire.from.1));
        let (route, rings) = end.prepare_sender(&spec, routes, &priorities).ok_or_else(full)?;
        wire.rings = rings;
        let change = Change::Route { end: output, route, slot: known.slot };
        let step = Step { executor: known.executor, of: known.id, ring: None, what: What::Change(change) };
        self.of_mut(wire.from.0, |known| known.routed(wire.from.1, 1));
        Ok(step)
    }

    /// Prepares the end of a receiver, and counts it.
    fn connect_out_of(&mut self, at: usize, wire: &mut OutOf) -> Reply<Step> {
        let full = || is_full(&self.queues[at].plan.name, QueueSide::OutOf);
        let known = &self.agents[&wire.to.0];
        let ends = (known.ends[wire.to.1].input.clone(), self.queues[at].end.clone());
        let (Some(input), Some(end)) = ends else { return Err(full()) };
        let spec = QueueWire { id: wire.id, filter: Filter::ALL, counts: wire.counted.now.clone() };
        let lanes = known.rings[wire.to.1].into * Priority::ALL.len();
        let (executor, slot) = (known.executor, known.slot);
        let (lanes, seat) = end.prepare_receiver(&spec, lanes, executor as u32, slot).ok_or_else(full)?;
        wire.seat = seat;
        let change = Change::Join { end: input, lanes, slot };
        let step = Step { executor, of: known.id, ring: None, what: What::Change(change) };
        self.of_mut(wire.to.0, |known| known.joined(wire.to.1, 1));
        Ok(step)
    }

    fn not_twice(&self, wire: &WirePlan) -> Reply<()> {
        match self.find_queue_wire(&wire.from, &wire.to) {
            Some(_) => Err(Refusal::new(format!("{} is already wired to {}", wire.from, wire.to))),
            None => Ok(()),
        }
    }

    /// The place of the queue of this name, which holds messages of this type, or does from now on.
    fn queue_for(
        &mut self,
        name: &str,
        port: &str,
        message: &'static MessageType,
        make: impl FnOnce(QueueForm) -> Option<Arc<dyn QueueEnd>>,
        staged: &mut Staged,
    ) -> Reply<usize> {
        let at = self.queue_at(name).ok_or_else(|| self.no_queue(name))?;
        let queue = &self.queues[at];
        if let Some(end) = &queue.end {
            if end.message_type() == message {
                return Ok(at);
            }
            // When nobody is left to whom the old type matters, it holds another.
            if !queue.is_of_nobody() {
                return Err(other_type(name, end.message_type(), port, message));
            }
        }
        let doors = self.executors.iter().map(|executor| executor.link.door.clone()).collect();
        let form = QueueForm { depth: queue.plan.depth(), overload: queue.plan.overload(), doors };
        let end = make(form).ok_or_else(|| Refusal::new(format!("{port} cannot be wired to a queue")))?;
        let (number, before) = (queue.number, self.queues[at].end.replace(end));
        let old = before.clone();
        staged.when_decided(move |_| {
            if let Some(old) = old {
                old.close();
            }
        });
        staged.undo(move |router| router.of_queue(number, |queue| queue.end = before));
        Ok(at)
    }

    /// Senders go before receivers where they are of one executor.
    fn order_anew(&self, at: usize, executor: usize, staged: &mut Staged) {
        let queue = &self.queues[at];
        let ends = queue.senders.iter().map(|wire| wire.from.0);
        let ends = ends.chain(queue.receivers.iter().map(|wire| wire.to.0));
        let here = |id: &AgentId| self.by_id(*id).is_some_and(|known| known.executor == executor);
        if ends.filter(here).nth(1).is_some() {
            staged.reorder(executor);
        }
    }

    /// Says whose turn it is: the highest serving priority, then the executor, then the data flow.
    pub(super) fn rank_receivers(&self) {
        let mut flows: BTreeMap<usize, Vec<u32>> = BTreeMap::new();
        for queue in &self.queues {
            let Some(end) = &queue.end else { continue };
            let mut order = Vec::with_capacity(queue.receivers.len());
            for wire in &queue.receivers {
                let Some(known) = self.by_id(wire.to.0) else { continue };
                let usual = self.executors[known.executor].plan.usual_serving();
                let flow =
                    flows.entry(known.executor).or_insert_with(|| self.data_flow_order(known.executor));
                let rank = flow.iter().position(|slot| *slot == known.slot);
                let serving = Reverse(wire.serving.unwrap_or(usual));
                order.push((serving, known.executor, rank, wire.to.1, wire.seat));
            }
            order.sort_unstable();
            for (rank, (.., seat)) in order.iter().enumerate() {
                end.set_rank(*seat, rank as u32);
            }
        }
    }

    fn find_queue_wire(&self, from: &str, to: &str) -> Option<Found> {
        if let Some(at) = self.queue_at(to) {
            let from = self.port(from).ok()?;
            let place = self.queues[at].senders.iter().position(|wire| wire.from == from)?;
            return Some((at, QueueSide::Into, place));
        }
        let at = self.queue_at(from)?;
        let to = self.port(to).ok()?;
        let place = self.queues[at].receivers.iter().position(|wire| wire.to == to)?;
        Some((at, QueueSide::OutOf, place))
    }

    fn plan_of_found(&self, (at, side, place): Found) -> WirePlan {
        let queue = &self.queues[at];
        let name = queue.plan.name.clone();
        match side {
            QueueSide::Into => {
                let wire = &queue.senders[place];
                let filter = wire.filter.clone();
                WirePlan { filter, ..WirePlan::new(self.port_name(wire.from), name) }
            }
            QueueSide::OutOf => {
                let wire = &queue.receivers[place];
                let serving = wire.serving;
                WirePlan { serving, ..WirePlan::new(name, self.port_name(wire.to)) }
            }
        }
    }

    pub(super) fn port_name(&self, (id, port): PortId) -> String {
        self.by_id(id)
            .map_or_else(String::new, |known| format!("{}.{}", known.plan.name, known.kind.ports[port].name))
    }

    /// Cuts a wire to or from a queue.
    pub(super) fn unwire_queue(&mut self, from: &str, to: &str, staged: &mut Staged) -> Reply<()> {
        let Some(found) = self.find_queue_wire(from, to) else {
            // Which end is wrong is said first.
            let mut ports = [from, to].into_iter().filter(|name| !self.is_queue(name));
            let wrong = ports.find_map(|name| self.port(name).err());
            return Err(wrong.unwrap_or_else(|| Refusal::new(format!("{from} is not wired to {to}"))));
        };
        self.cut_queue_wire(found, staged);
        Ok(())
    }

    fn cut_queue_wire(&mut self, (at, side, place): Found, staged: &mut Staged) {
        self.queues[at].settle();
        match side {
            QueueSide::Into => self.cut_into(at, place, staged),
            QueueSide::OutOf => self.cut_out_of(at, place, staged),
        }
    }

    /// What the sender has sent stays in the queue.
    fn cut_into(&mut self, at: usize, place: usize, staged: &mut Staged) {
        let queue = &mut self.queues[at];
        let (number, wire) = (queue.number, queue.senders.remove(place));
        let Into { id, from, ref rings, ref counted, .. } = wire;
        queue.gone.push(Gone { id, of: from.0, rings: rings.clone(), counted: counted.clone() });
        if let Some(known) = self.by_id(from.0)
            && let Some(end) = known.ends[from.1].output.clone()
        {
            let (into, slot) = (end.forgetting_box(), known.slot);
            let change = Change::Forget { end, wire: id, into, slot };
            staged.step(Step {
                executor: known.executor,
                of: known.id,
                ring: None,
                what: What::Change(change),
            });
        }
        // What is decided later comes to the executor later.
        self.of_mut(from.0, |known| known.routed(from.1, -1));
        staged.undo(move |router| {
            router.of_mut(from.0, |known| known.routed(from.1, 1));
            router.of_queue(number, |queue| {
                queue.gone.retain(|gone| gone.id != id);
                queue.senders.insert(place, wire);
            });
        });
    }

    /// What the receiver has not taken goes to others.
    fn cut_out_of(&mut self, at: usize, place: usize, staged: &mut Staged) {
        let queue = &mut self.queues[at];
        let (number, wire) = (queue.number, queue.receivers.remove(place));
        let OutOf { id, to, seat, ref counted, .. } = wire;
        queue.gone.push(Gone { id, of: to.0, rings: Vec::new(), counted: counted.clone() });
        if let Some(end) = queue.end.clone() {
            staged.when_decided(move |_| {
                end.close_receiver(seat);
                end.call_again();
            });
        }
        if let Some(known) = self.by_id(to.0)
            && let Some(end) = known.ends[to.1].input.clone()
        {
            let (into, slot) = (end.leaving_box(), known.slot);
            // There is nothing to be waited for: what is in the queue is everybody's.
            let change = Change::Leave { end, wire: id, into, force: true, slot };
            staged.step(Step {
                executor: known.executor,
                of: known.id,
                ring: None,
                what: What::Change(change),
            });
        }
        self.of_mut(to.0, |known| known.joined(to.1, -1));
        staged.undo(move |router| {
            router.of_mut(to.0, |known| known.joined(to.1, 1));
            router.of_queue(number, |queue| {
                queue.gone.retain(|gone| gone.id != id);
                queue.receivers.insert(place, wire);
            });
        });
    }

    fn queue_wires_of(&self, id: AgentId) -> Vec<Found> {
        let is_of_it = |(at, side, place): &Found| match side {
            QueueSide::Into => self.queues[*at].senders[*place].from.0 == id,
            QueueSide::OutOf => self.queues[*at].receivers[*place].to.0 == id,
        };
        self.all_queue_wires().filter(is_of_it).collect()
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
    pub(super) fn leave_queues(&mut self, id: AgentId, staged: &mut Staged) {
        // From the last to the first, so that the places stay right.
        self.queue_wires_of(id).into_iter().rev().for_each(|found| self.cut_queue_wire(found, staged));
    }

    /// An agent does not come back from its step, and may still use ends of queues that were cut: nothing is sent with them any more.
    pub(super) fn abandon_cut_queues(&mut self, id: AgentId) {
        for at in 0..self.queues.len() {
            let queue = &mut self.queues[at];
            // Rings that are back may be somebody else's by now.
            queue.settle();
            let Some(end) = queue.end.clone() else { continue };
            let mut gone = queue.gone.iter_mut().filter(|wire| wire.of == id).peekable();
            if gone.peek().is_some() {
                gone.for_each(|wire| end.close_sender(&core::mem::take(&mut wire.rings)));
                self.tell_receivers(at);
            }
        }
    }

    /// The same for the wires that it has: nothing comes from its ends and nothing is taken by them any more. Others are called for
    /// what it has not taken, and for what it has sent and told nobody of. The wires wait to be made anew.
    pub(super) fn abandon_queues(&mut self, id: AgentId) {
        for at in 0..self.queues.len() {
            let queue = &mut self.queues[at];
            let Some(end) = queue.end.clone() else { continue };
            let mut is_wired = false;
            for wire in queue.senders.iter_mut().filter(|wire| wire.from.0 == id) {
                end.close_sender(&wire.rings);
                wire.counted.begin_anew();
                is_wired = true;
            }
            for wire in queue.receivers.iter_mut().filter(|wire| wire.to.0 == id) {
                end.close_receiver(wire.seat);
                wire.counted.begin_anew();
                is_wired = true;
            }
            if is_wired {
                self.tell_receivers(at);
            }
        }
    }

    /// Others are called in the place of who does not come; and who was called by somebody who did not come to tell it, is told.
    fn tell_receivers(&self, at: usize) {
        let queue = &self.queues[at];
        let Some(end) = &queue.end else { return };
        end.call_again();
        if end.waiting() == 0 {
            return;
        }
        for known in queue.receivers.iter().filter_map(|wire| self.by_id(wire.to.0)) {
            self.executors[known.executor].link.door.ring(bit_of(known.slot));
        }
    }

    /// Makes the wires of an agent that got new ports anew. Gives those that are lost, and why.
    pub(super) fn renew_queue_wires(
        &mut self,
        id: AgentId,
        steps: &mut Vec<Step>,
    ) -> Vec<(WirePlan, Refusal)> {
        let mut lost = Vec::new();
        // From the last to the first, so that the places stay right.
        for found in self.queue_wires_of(id).into_iter().rev() {
            let (at, side, place) = found;
            let connected = match side {
                QueueSide::Into => {
                    let mut wire = self.queues[at].senders[place].clone();
                    let connected = self.connect_into(at, &mut wire);
                    self.queues[at].senders[place] = wire;
                    connected
                }
                QueueSide::OutOf => {
                    let mut wire = self.queues[at].receivers[place].clone();
                    let connected = self.connect_out_of(at, &mut wire);
                    self.queues[at].receivers[place] = wire;
                    connected
                }
            };
            match connected {
                Ok(step) => steps.push(step),
                Err(refusal) => {
                    lost.push((self.plan_of_found(found), refusal));
                    self.lose_queue_wire(found, id);
                }
            }
        }
        self.rank_receivers();
        lost
    }

    fn lose_queue_wire(&mut self, (at, side, place): Found, of: AgentId) {
        let queue = &mut self.queues[at];
        let (id, counted) = match side {
            QueueSide::Into => {
                let wire = queue.senders.remove(place);
                (wire.id, wire.counted)
            }
            QueueSide::OutOf => {
                let wire = queue.receivers.remove(place);
                (wire.id, wire.counted)
            }
        };
        queue.gone.push(Gone { id, of, rings: Vec::new(), counted });
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
        let receivers = queue.receivers.iter().map(|wire| {
            let known = self.by_id(wire.to.0);
            let usual = known.map(|known| self.executors[known.executor].plan.usual_serving());
            ReceiverView {
                to: self.port_name(wire.to),
                serving: wire.serving.or(usual).unwrap_or(0),
                taken: wire.counted.totals().taken,
            }
        });
        let WireTotals { sent, dropped, refused, taken, .. } = queue.totals();
        QueueView {
            name: queue.plan.name.clone(),
            message: queue.end.as_ref().map_or("", |end| end.message_type().short_name()),
            depth: queue.plan.depth(),
            overload: queue.plan.overload(),
            waiting: queue.end.as_ref().map_or(0, |end| end.waiting()),
            sent,
            dropped,
            refused,
            taken,
            receivers: receivers.collect(),
        }
    }

    /// What it says of the wires to and from them.
    pub(super) fn view_queue_wires(&self) -> Vec<WireView> {
        self.all_queue_wires().map(|found| self.view_queue_wire(found)).collect()
    }

    fn view_queue_wire(&self, found: Found) -> WireView {
        let (at, side, place) = found;
        let queue = &self.queues[at];
        let WireTotals { sent, replaced, dropped, refused, taken, expired } = match side {
            QueueSide::Into => queue.senders[place].counted.totals(),
            QueueSide::OutOf => queue.receivers[place].counted.totals(),
        };
        let plan = self.plan_of_found(found);
        WireView {
            from: plan.from,
            to: plan.to,
            message: queue.end.as_ref().map_or("", |end| end.message_type().short_name()),
            depth: queue.plan.depth(),
            overload: queue.plan.overload(),
            filter: plan.filter,
            sent,
            replaced,
            dropped,
            refused,
            taken,
            expired,
        }
    }
}
