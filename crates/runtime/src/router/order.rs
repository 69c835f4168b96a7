//! The order in which an executor runs its agents: senders before receivers.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use types::AgentId;

use super::script::{Step, What};
use super::{Known, Router};
use crate::executor::{Change, Room};

/// An executor has room for so many agents at least.
const LEAST_ROOM: usize = 8;

impl Router {
    /// Gives an executor its data-flow order, and room for its agents where they have become more. It is given what is said here: the step
    /// may not be dropped.
    pub(super) fn order_step(&mut self, executor: usize) -> Step {
        let order = self.data_flow_order(executor);
        let known = &mut self.executors[executor];
        let slots = known.slots.len();
        let room = (slots > known.room).then(|| {
            known.room = slots.next_power_of_two().max(LEAST_ROOM);
            Box::new(Room::of(known.room))
        });
        let mut ranks = vec![u32::MAX; slots];
        for (rank, slot) in order.iter().enumerate() {
            ranks[*slot as usize] = rank as u32;
        }
        let words = vec![0; slots.div_ceil(64).max(1)];
        let change = Change::Order { order, ranks, words, room };
        Step { executor, of: AgentId::NONE, ring: None, what: What::Change(change) }
    }

    /// The slots of an executor's agents so that senders stand before receivers; cycles are broken by name.
    pub(super) fn data_flow_order(&self, executor: usize) -> Vec<u32> {
        let known = self.names.values().filter_map(|id| self.agents.get(id));
        let members: Vec<&Known> = known.filter(|known| known.executor == executor).collect();
        let mut place = vec![usize::MAX; self.executors[executor].slots.len()];
        for (i, member) in members.iter().enumerate() {
            place[member.slot as usize] = i;
        }
        let mut flow = Flow::of(members.len());
        let mut goes_before = |from: &Known, to: AgentId| {
            if let Some(to) = self.agents.get(&to)
                && to.executor == executor
                && to.id != from.id
            {
                flow.add(place[from.slot as usize], place[to.slot as usize]);
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
        flow.in_order().map(|place| members[place].slot).collect()
    }
}

/// Who goes before whom, by their places among all.
struct Flow {
    /// For each, the last of those behind it that were added; and for each of these the one added before.
    last: Vec<usize>,
    behind: Vec<(usize, usize)>,
    /// How many go before each.
    before: Vec<usize>,
}

/// Behind nobody.
const NONE: usize = usize::MAX;

impl Flow {
    fn of(members: usize) -> Flow {
        Flow { last: vec![NONE; members], behind: Vec::with_capacity(members), before: vec![0; members] }
    }

    fn add(&mut self, from: usize, to: usize) {
        let at = self.behind.len();
        self.behind.push((to, core::mem::replace(&mut self.last[from], at)));
        self.before[to] += 1;
    }

    /// All, one after another: the first that waits for nobody; in a cycle, the first.
    fn in_order(mut self) -> impl Iterator<Item = usize> {
        let mut free: BinaryHeap<Reverse<usize>> =
            (0..self.before.len()).filter(|i| self.before[*i] == 0).map(Reverse).collect();
        let mut done = vec![false; self.before.len()];
        let mut in_cycle = 0;
        core::iter::from_fn(move || {
            let next = loop {
                let next = match free.pop() {
                    Some(Reverse(next)) => next,
                    None => {
                        in_cycle += done[in_cycle..].iter().position(|done| !done)?;
                        in_cycle
                    }
                };
                if !core::mem::replace(&mut done[next], true) {
                    break next;
                }
            };
            let mut at = self.last[next];
            while let Some((after, previous)) = self.behind.get(at).copied() {
                self.before[after] = self.before[after].saturating_sub(1);
                if self.before[after] == 0 && !done[after] {
                    free.push(Reverse(after));
                }
                at = previous;
            }
            Some(next)
        })
    }
}

#[cfg(test)]
#[cfg(not(loom))]
mod tests {
    use super::*;

    proptest::proptest! {
        /// Everybody once; and without cycles, senders before receivers and the first free one first.
        #[test]
        fn all_stand_in_order(edges in proptest::collection::vec((0usize..30, 0usize..30), 0..80), may_cycle: bool) {
            let edges: Vec<_> = edges.into_iter().filter(|(a, b)| if may_cycle { a != b } else { a < b }).collect();
            // Names need not be in the order of the flow.
            let named = |i: usize| (i * 7) % 30;
            let mut flow = Flow::of(30);
            edges.iter().for_each(|(a, b)| flow.add(named(*a), named(*b)));
            let order: Vec<usize> = flow.in_order().collect();
            let mut sorted = order.clone();
            sorted.sort_unstable();
            proptest::prop_assert_eq!(sorted, (0..30).collect::<Vec<_>>());
            let place = |i: usize| order.iter().position(|other| *other == i).unwrap();
            let waits = |i: usize, at: usize| edges.iter().any(|(a, b)| named(*b) == i && place(named(*a)) >= at);
            for (at, chosen) in order.iter().enumerate() {
                let free = (0..30).find(|i| place(*i) >= at && !waits(*i, at));
                if let Some(free) = free {
                    proptest::prop_assert_eq!(*chosen, free);
                } else {
                    proptest::prop_assert!(may_cycle);
                    proptest::prop_assert_eq!(Some(*chosen), (0..30).find(|i| place(*i) >= at));
                }
            }
        }
    }
}
