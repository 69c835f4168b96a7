//! The order in which an executor runs its agents: senders before receivers.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use types::AgentId;

use super::script::{Step, What};
use super::{Known, Router};
use crate::executor::{Change, heaps_for};

impl Router {
    /// Gives an executor its data-flow order.
    pub(super) fn order_step(&self, executor: usize) -> Step {
        let order = self.data_flow_order(executor);
        let slots = self.executors[executor].slots.len();
        let mut ranks = vec![u32::MAX; slots];
        for (rank, slot) in order.iter().enumerate() {
            ranks[*slot as usize] = rank as u32;
        }
        let words = vec![0; slots.div_ceil(64).max(1)];
        let (releases, due) = heaps_for(slots);
        let change = Change::Order { order, ranks, words, releases, due };
        Step { executor, of: AgentId::NONE, ring: None, what: What::Change(change) }
    }

    /// The slots of an executor's agents so that senders stand before receivers; cycles are broken by name.
    pub(super) fn data_flow_order(&self, executor: usize) -> Vec<u32> {
        let slots = &self.executors[executor].slots;
        let mut members: Vec<&Known> = slots.iter().flatten().filter_map(|id| self.agents.get(id)).collect();
        members.sort_unstable_by(|a, b| a.plan.name.cmp(&b.plan.name));
        let mut place = vec![usize::MAX; slots.len()];
        for (i, member) in members.iter().enumerate() {
            place[member.slot as usize] = i;
        }
        let mut behind: Vec<Vec<usize>> = vec![Vec::new(); members.len()];
        let mut before = vec![0usize; members.len()];
        let mut goes_before = |from: &Known, to: AgentId| {
            if let Some(to) = self.agents.get(&to)
                && to.executor == executor
                && to.id != from.id
            {
                let (a, b) = (place[from.slot as usize], place[to.slot as usize]);
                behind[a].push(b);
                before[b] += 1;
            }
        };
        for member in &members {
            let wires = member.wires.iter().filter_map(|id| self.wires.get(id));
            let wires = wires.filter(|wire| wire.from.0 == member.id && !wire.is_answer);
            wires.for_each(|wire| goes_before(member, wire.to.0));
        }
        for (from, to) in self.flow_of_queues() {
            let from = self.agents.get(&from).filter(|from| from.executor == executor);
            from.into_iter().for_each(|from| goes_before(from, to));
        }
        // The first by name that waits for nobody; in a cycle, the first by name.
        let mut free: BinaryHeap<Reverse<usize>> =
            (0..members.len()).filter(|i| before[*i] == 0).map(Reverse).collect();
        let mut done = vec![false; members.len()];
        let mut in_cycle = 0;
        let mut order = Vec::with_capacity(members.len());
        while order.len() < members.len() {
            let next = free.pop().map(|Reverse(next)| next).unwrap_or_else(|| {
                while done[in_cycle] {
                    in_cycle += 1;
                }
                in_cycle
            });
            if core::mem::replace(&mut done[next], true) {
                continue;
            }
            order.push(members[next].slot);
            for after in &behind[next] {
                before[*after] = before[*after].saturating_sub(1);
                if before[*after] == 0 && !done[*after] {
                    free.push(Reverse(*after));
                }
            }
        }
        order
    }
}
