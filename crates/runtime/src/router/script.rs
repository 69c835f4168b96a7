//! What was decided, on its way to the executors.
//!
//! A script is done step by step: a step is given when the one before it was answered, or when both are for the same executor, which serves
//! what it gets in order. Nobody has to wait for it: an executor that does not answer does its part when it does, and until then
//! holds up only what concerns it and was decided later.
//!
//! ```text
//!   step given ──► Done ─────────────────────► the next
//!       ▲    └───► Lost: the agent does not return from its step. The registry says how it shall be: whoever gives it
//!       │          new ports makes it so. Somebody who was lost in the step itself is left, and it is given again.
//!       └────────────┘
//!   a cut: given to the receiver again and again until it has taken what is there, or its time is over
//! ```

use core::sync::atomic::Ordering::Relaxed;
use std::collections::VecDeque;
use std::sync::Arc;

use types::{AgentId, Duration, Time};

use super::{Fabric, Incident, PortId, Reply, Router};
use crate::executor::{Answer, Change};
use crate::port::{InputEnd, WireCounts, WireId};
use crate::request::{AgentState, Refusal, WireTotals};

/// How long a receiver may take for what is on a wire that is cut, on the clock of the system. Then it is lost, and counted.
pub(super) const DRAINS_WITHIN: Duration = Duration::secs(5);

/// One thing that an executor is to do.
pub(super) struct Step {
    pub executor: usize,
    /// The agent whose seat or ends it touches; nobody for the executor as a whole.
    pub of: AgentId,
    /// The ring that it makes, if it does.
    pub ring: Option<WireId>,
    pub what: What,
}

pub(super) enum What {
    Change(Change),
    Cut(Cut),
}

/// The receiving end of a ring whose sender has forgotten it.
pub(super) struct Cut {
    pub slot: u32,
    pub to: PortId,
    pub from: PortId,
    pub end: Arc<dyn InputEnd>,
    pub ring: WireId,
    pub counts: Arc<WireCounts>,
    pub into: Tally,
    /// Until when it is waited for.
    pub until: Time,
}

impl Cut {
    /// The agent will never come back: what it sends is not waited for.
    fn abandon(&mut self, id: AgentId, now: Time) {
        if self.from.0 == id {
            (self.until, self.from) = (now, (AgentId::NONE, 0));
        }
    }
}

/// Where what was counted of a ring goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Tally {
    /// To the wire of this number, or to those that are cut when it is no more.
    Wire(WireId, WireTotals),
    /// Nowhere: it was of no wire.
    Nowhere,
}

/// A cut on its way.
pub(super) struct Leaving {
    executor: usize,
    cut: Cut,
    /// Whether it is time to ask.
    due: bool,
    /// The number of the change by which it was asked for last.
    asked: Option<u64>,
}

/// A change that was given and not answered yet.
struct Given {
    executor: usize,
    number: u64,
    /// What to do when somebody is lost in it.
    again: Option<Change>,
}

pub(super) struct Script {
    number: u64,
    steps: VecDeque<Step>,
    given: VecDeque<Given>,
}

impl Script {
    /// Whether it has this number.
    pub(super) fn is(&self, number: u64) -> bool {
        self.number == number
    }

    /// The executor to which the next step can be given now.
    fn next_executor(&self) -> Option<usize> {
        let next = self.steps.front()?.executor;
        self.given.back().is_none_or(|given| given.executor == next).then_some(next)
    }
}

impl Router {
    /// Begins a script, and gives its number.
    pub(super) fn begin(&mut self, steps: Vec<Step>) -> u64 {
        self.next_script += 1;
        let script = Script { number: self.next_script, steps: steps.into(), given: VecDeque::new() };
        self.scripts.push(script);
        self.next_script
    }

    /// Whether executors owe anything, or receivers have to take what is on wires that are cut.
    pub(crate) fn has_to_do(&self) -> bool {
        !self.scripts.is_empty() || !self.leaving.is_empty()
    }

    /// Takes answers and gives what can be given, until nothing moves any more.
    pub(super) fn advance(&mut self, fabric: &mut dyn Fabric) {
        loop {
            self.take_answers();
            let mut moved = self.give(fabric);
            for (at, executor) in self.executors.iter_mut().enumerate() {
                // One whose answers found no room any more has ceased to serve. Now there is room, and nobody else tells it.
                let owes = executor.answered < executor.link.last_given();
                if owes && core::mem::replace(&mut executor.rung_at, executor.answered) != executor.answered {
                    fabric.ring(at);
                    moved = true;
                }
            }
            if !moved {
                return;
            }
        }
    }

    /// Waits for a script as long as there is patience. What is not done by then is done later.
    pub(super) fn finish(&mut self, number: u64, fabric: &mut dyn Fabric) {
        loop {
            self.advance(fabric);
            if !self.scripts.iter().any(|script| script.number == number) || !fabric.wait() {
                return;
            }
        }
    }

    /// Waits until all these executors have answered, and owe nothing. Refused when one of them does not in time.
    pub(super) fn ask_all(&mut self, executors: &[usize], fabric: &mut dyn Fabric) -> Reply<()> {
        let busy = || {
            Refusal::new("the executor does not answer").help("an agent in it does not return from its step")
        };
        let mut asked = Vec::new();
        for executor in executors {
            let link = &mut self.executors[*executor].link;
            if !link.has_room() {
                return Err(busy());
            }
            asked.push((*executor, link.change(Change::Nothing)));
            fabric.ring(*executor);
        }
        loop {
            self.advance(fabric);
            let owes = |executor: usize| {
                let owed = |script: &Script| {
                    script.steps.iter().any(|step| step.executor == executor)
                        || script.given.iter().any(|given| given.executor == executor)
                };
                self.scripts.iter().any(owed)
            };
            if asked.iter().all(|(at, number)| self.executors[*at].answered >= *number && !owes(*at)) {
                return Ok(());
            }
            if !fabric.wait() {
                return Err(busy());
            }
        }
    }

    /// Gives each script's next step, unless something that was decided sooner has yet to be given to that executor.
    pub(super) fn give(&mut self, fabric: &mut dyn Fabric) -> bool {
        let mut moved = false;
        let mut behind = vec![false; if self.scripts.is_empty() { 0 } else { self.executors.len() }];
        for script in &mut self.scripts {
            while let Some(executor) = script.next_executor().filter(|executor| !behind[*executor]) {
                if !self.executors[executor].link.has_room() {
                    break;
                }
                let Some(step) = script.steps.pop_front() else { break };
                moved = true;
                match step.what {
                    What::Cut(cut) => self.leaving.push(Leaving { executor, cut, due: true, asked: None }),
                    What::Change(change) => {
                        let again = match &change {
                            Change::Unseat { slot, .. } => Some(Change::Unseat { slot: *slot, seat: None }),
                            Change::Stop => Some(Change::Stop),
                            _ => None,
                        };
                        let number = self.executors[executor].link.change(change);
                        script.given.push_back(Given { executor, number, again });
                        fabric.ring(executor);
                    }
                }
            }
            script.steps.iter().for_each(|step| behind[step.executor] = true);
        }
        self.scripts.retain(|script| !script.steps.is_empty() || !script.given.is_empty());
        for leaving in self.leaving.iter_mut().filter(|leaving| leaving.due && leaving.asked.is_none()) {
            let (executor, cut) = (leaving.executor, &leaving.cut);
            if !self.executors[executor].link.has_room() {
                continue;
            }
            leaving.due = false;
            let (end, into, force) = (cut.end.clone(), cut.end.leaving_box(), cut.until <= self.now);
            let change = Change::Leave { end, wire: cut.ring, into, force, slot: cut.slot };
            leaving.asked = Some(self.executors[executor].link.change(change));
            fabric.ring(executor);
            moved = true;
        }
        moved
    }

    /// Asks again those who had not taken all that is on wires that are cut. Gives the time when the first of them is not waited for
    /// any more.
    pub(super) fn ask_again(&mut self) -> Time {
        let mut next = Time::NEVER;
        for leaving in &mut self.leaving {
            leaving.due = true;
            next = next.min(leaving.cut.until);
        }
        next
    }

    pub(super) fn take_answers(&mut self) {
        for executor in 0..self.executors.len() {
            while let Some(answer) = self.executors[executor].link.answer() {
                match answer {
                    Answer::Done(number, change) => self.done(executor, number, change),
                    Answer::NotDrained(number, change) => {
                        drop(change);
                        self.not_drained(executor, number);
                    }
                    Answer::Lost(number, change) => self.lost(executor, number, change),
                    Answer::Died { slot, id, time, cause, body } => {
                        self.died(slot, id, time, cause, body.is_some());
                    }
                }
            }
        }
    }

    /// The change with this number was answered. Gives what is known of it.
    fn answered(&mut self, executor: usize, number: u64) -> Option<(usize, Given)> {
        self.executors[executor].answered = number;
        self.scripts.iter_mut().enumerate().find_map(|(at, script)| {
            let is_it = |given: &Given| given.executor == executor && given.number == number;
            let place = script.given.iter().position(is_it)?;
            Some((at, script.given.remove(place)?))
        })
    }

    fn leaving_at(&self, executor: usize, number: u64) -> Option<usize> {
        self.leaving.iter().position(|leaving| leaving.executor == executor && leaving.asked == Some(number))
    }

    /// What comes back is freed here.
    fn done(&mut self, executor: usize, number: u64, change: Change) {
        self.answered(executor, number);
        match change {
            Change::Unseat { slot, seat } => {
                drop(seat);
                if let Some(place) = self.executors[executor].slots.get_mut(slot as usize) {
                    *place = None;
                }
            }
            Change::Body { slot, body, .. } => {
                drop(body);
                self.started(executor, slot);
            }
            Change::Leave { .. } => {
                drop(change);
                if let Some(at) = self.leaving_at(executor, number) {
                    let cut = self.leaving.swap_remove(at).cut;
                    self.of_mut(cut.to.0, |known| known.joined(cut.to.1, -1));
                    self.of_mut(cut.from.0, |known| known.routed(cut.from.1, -1));
                    self.tally(&cut);
                }
            }
            freed => drop(freed),
        }
    }

    /// Another instance is in its place.
    fn started(&mut self, executor: usize, slot: u32) {
        let Some(id) = self.executors[executor].slots.get(slot as usize).copied().flatten() else { return };
        let Some(known) = self.agents.get_mut(&id) else { return };
        known.stats.restarts.store(known.stats.restarts.load(Relaxed) + 1, Relaxed);
        (known.state, known.restart_at) = (AgentState::Running, Time::NEVER);
        self.asking.changes();
        if core::mem::take(&mut known.starting) {
            let agent = known.plan.name.clone();
            self.incidents.push(Incident { time: self.now, agent, what: "started again".into() });
        }
        self.tell_anew(id);
    }

    fn not_drained(&mut self, executor: usize, number: u64) {
        self.answered(executor, number);
        if let Some(at) = self.leaving_at(executor, number) {
            self.leaving[at].asked = None;
        }
    }

    /// It was not done, for the agent is lost in a step; or somebody was lost in it.
    fn lost(&mut self, executor: usize, number: u64, change: Option<Change>) {
        let again = self.answered(executor, number).and_then(|(at, given)| Some((at, given.again?)));
        if let Some((at, change)) = again {
            let (what, of) = (What::Change(change), AgentId::NONE);
            self.scripts[at].steps.push_front(Step { executor, of, ring: None, what });
        }
        if let Some(at) = self.leaving_at(executor, number) {
            // The place that it had in the memory of the sender is lost with it.
            let cut = self.leaving.swap_remove(at).cut;
            self.tally(&cut);
        }
        if let Some(Change::Send { .. }) = change {
            let what = "a message was not sent: an agent does not return from its step".into();
            self.incidents.push(Incident { time: self.now, agent: "control".into(), what });
        }
    }

    /// An agent will never come back from where it is: nobody touches its ends any more, and what it sends is not waited for.
    pub(super) fn abandon(&mut self, id: AgentId, rings: &[WireId], is_back: bool) {
        let mut cuts = Vec::new();
        for script in &mut self.scripts {
            for mut step in core::mem::take(&mut script.steps) {
                let makes = step.ring.is_some_and(|ring| rings.contains(&ring));
                let is_of_it = step.of == id && !matches!(step.what, What::Change(Change::Unseat { .. }));
                match &mut step.what {
                    What::Cut(cut) => cut.abandon(id, self.now),
                    What::Change(_) => {}
                }
                match step.what {
                    What::Cut(cut) if is_of_it => cuts.push(cut),
                    _ if makes || is_of_it => {}
                    _ => script.steps.push_back(step),
                }
            }
        }
        let mut at = 0;
        while let Some(leaving) = self.leaving.get_mut(at) {
            leaving.cut.abandon(id, self.now);
            if leaving.cut.to.0 == id && leaving.asked.is_none() {
                cuts.push(self.leaving.swap_remove(at).cut);
            } else {
                at += 1;
            }
        }
        for cut in cuts {
            if is_back {
                self.of_mut(cut.from.0, |known| known.routed(cut.from.1, -1));
            }
            self.tally(&cut);
        }
    }

    /// What went over a ring that is no more. What was in it still is lost.
    pub(super) fn tally(&mut self, cut: &Cut) {
        let Tally::Wire(wire, before) = cut.into else { return };
        let totals = WireTotals::at_the_end(&cut.counts);
        match self.wires.get_mut(&wire) {
            Some(wire) => wire.past += totals,
            None => {
                self.past += totals;
                self.past += before;
            }
        }
    }

    /// Ends all agents.
    pub(crate) fn stop_all(&mut self, fabric: &mut dyn Fabric) {
        let stop =
            |executor| Step { executor, of: AgentId::NONE, ring: None, what: What::Change(Change::Stop) };
        // Each on its own: one that does not answer is left behind, and there is nobody to tell any more.
        let scripts: Vec<u64> =
            (0..self.executors.len()).map(|executor| self.begin(vec![stop(executor)])).collect();
        scripts.into_iter().for_each(|script| self.finish(script, fabric));
    }
}
