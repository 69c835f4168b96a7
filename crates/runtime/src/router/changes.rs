//! Changes on their way to the executors and back.

use types::AgentId;

use super::{Committed, Fabric, Known, Reply, Router};
use crate::executor::{Answer, Change, heaps_for};
use crate::request::Refusal;

impl Router {
    /// Computes the data-flow order of an executor and gives it to it.
    pub(super) fn commit_order(&mut self, executor: usize, fabric: &mut dyn Fabric) -> Reply<()> {
        self.rank_receivers();
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
    pub(super) fn data_flow_order(&self, executor: usize) -> Vec<u32> {
        let mut members: Vec<&Known> =
            self.agents.iter().filter(|agent| agent.executor == executor).collect();
        members.sort_by(|a, b| a.plan.name.cmp(&b.plan.name));
        let place = |id: AgentId| members.iter().position(|member| member.id == id);
        let mut behind: Vec<Vec<usize>> = vec![Vec::new(); members.len()];
        let mut before = vec![0usize; members.len()];
        let wires = self.wires.iter().filter(|wire| !wire.is_answer).map(|wire| (wire.from.0, wire.to.0));
        for (from, to) in wires.chain(self.flow_of_queues()) {
            if let (Some(a), Some(b)) = (place(from), place(to))
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

    pub(super) fn commit(&mut self, executor: usize, change: Change, fabric: &mut dyn Fabric) -> Reply<()> {
        self.commit_and_get(executor, change, fabric)?;
        if !self.owed.is_empty() {
            self.make_up(executor, fabric);
        }
        Ok(())
    }

    /// Gives a change to an executor and waits until it has answered. What comes back is freed here. When it does not answer, the
    /// change is taken back: it will never be done.
    pub(super) fn commit_and_get(
        &mut self,
        executor: usize,
        change: Change,
        fabric: &mut dyn Fabric,
    ) -> Reply<Committed> {
        let busy = || {
            Refusal::new("the executor does not answer").help("an agent in it does not return from its step")
        };
        if !self.executors[executor].link.change(change) {
            return Err(busy());
        }
        let given = self.executors[executor].link.last_given();
        let mut too_late = false;
        loop {
            let go_on = fabric.pump(executor);
            while let Some(answer) = self.executors[executor].link.answer() {
                match answer {
                    Answer::Done(number, change) if number == given => {
                        fabric.answered();
                        drop(change);
                        return Ok(Committed::Done);
                    }
                    Answer::NotDrained(number, change) if number == given => {
                        fabric.answered();
                        drop(change);
                        return Ok(Committed::NotDrained);
                    }
                    // Of a request that was refused earlier.
                    Answer::TakenBack(change) | Answer::Done(_, change) | Answer::NotDrained(_, change) => {
                        drop(change)
                    }
                    died @ Answer::Died { .. } => self.died.push((executor, died)),
                }
            }
            if go_on {
                continue;
            }
            // One that the executor has begun is not taken back: its answer is on the way, unless an agent does not return from
            // its stop.
            if too_late {
                return Err(Refusal::new("the executor has begun it, and does not answer")
                    .help("an agent in it does not return from its stop, or from taking over"));
            }
            if self.executors[executor].link.take_back() {
                return Err(busy());
            }
            too_late = true;
        }
    }

    /// Ends all agents.
    pub(crate) fn stop_all(&mut self, fabric: &mut dyn Fabric) {
        for executor in 0..self.executors.len() {
            // An executor that does not answer is left behind; there is nobody to tell any more.
            let _ = self.commit(executor, Change::Stop, fabric);
        }
    }
}
