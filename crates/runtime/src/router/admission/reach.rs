//! Which changes can make somebody in real time late: others need no analysis.

use std::collections::BTreeSet;

use types::AgentId;

use super::super::{Known, Router, TIMING_KEYS, timing_of};
use crate::plan::{AgentPlan, WirePlan, owner};
use crate::port::Direction;
use crate::request::Request;

/// What is to be admitted.
#[derive(Debug, Default, PartialEq, Eq)]
pub(in crate::router) struct Asked {
    /// The agent whose least period is told where it does not fit; nothing where the whole system is to begin.
    pub whose: Option<String>,
    /// The agents of which the request says itself when they run and how long they take.
    pub own: Vec<String>,
}

impl Asked {
    /// That the whole system may begin.
    pub(super) fn to_begin() -> Asked {
        Asked::default()
    }

    /// What a request asks for that changes when agents run or how long they take; nothing where it does neither.
    pub(in crate::router) fn of(request: &Request) -> Option<Asked> {
        let mut asked = Asked::default();
        asked.take_in(request);
        asked.whose.is_some().then_some(asked)
    }

    fn take_in(&mut self, request: &Request) {
        match request {
            Request::Add(AgentPlan { name, .. }) => self.says_of(name),
            Request::Set { agent, key, .. } if is_timing(key) => self.says_of(agent),
            Request::Wire(wire) => self.tells_of(owner(&wire.to)),
            Request::All(requests) => requests.iter().for_each(|request| self.take_in(request)),
            _ => {}
        }
    }

    fn says_of(&mut self, agent: &str) {
        self.tells_of(agent);
        self.own.push(agent.to_owned());
    }

    fn tells_of(&mut self, agent: &str) {
        self.whose.get_or_insert_with(|| agent.to_owned());
    }
}

/// Whether an entry of a plan says when an agent runs, or for how long.
fn is_timing(key: &str) -> bool {
    key != "importance" && TIMING_KEYS.contains(&key)
}

/// Agents that are looked at, and those that they make run.
#[derive(Default)]
struct Reached {
    seen: BTreeSet<AgentId>,
    open: Vec<AgentId>,
    /// Whether one of them is in real time.
    real_time: bool,
    /// Who sends by new wires that make somebody run, and how many of these there are.
    senders: Vec<AgentId>,
    wires: usize,
}

impl Reached {
    fn take_in(&mut self, router: &Router, known: &Known) {
        if self.seen.insert(known.id) {
            self.open.push(known.id);
            self.real_time |= router.executors[known.executor].plan.level().is_some();
        }
    }
}

impl Router {
    /// Whether a request can change how late anybody in real time is, or can close a circle of agents that make each other run: it concerns one
    /// in real time, or one that makes such a one run.
    pub(in crate::router) fn reaches_real_time(&self, request: &Request) -> bool {
        let mut reached = Reached::default();
        self.seed(request, &mut reached);
        while let Some(id) = reached.open.pop() {
            self.follow(id, &mut reached);
        }
        // Several wires at once can close a circle together.
        let closes = reached.wires > 1 || reached.senders.iter().any(|sender| reached.seen.contains(sender));
        reached.real_time || closes
    }

    /// Takes in whom a request concerns at once.
    fn seed(&self, request: &Request, reached: &mut Reached) {
        match request {
            Request::Add(plan) => {
                let timing = timing_of(plan);
                let executor = timing.and_then(|timing| self.executor_for(plan, timing));
                // One that is refused needs no analysis either.
                reached.real_time |= executor.is_ok_and(|at| self.executors[at].plan.level().is_some());
                self.robot_wires(plan).iter().for_each(|wire| self.seed_wire(wire, reached));
            }
            Request::Set { agent, key, .. } if is_timing(key) => {
                self.owner_of(agent).into_iter().for_each(|known| reached.take_in(self, known));
            }
            Request::Wire(wire) => self.seed_wire(wire, reached),
            Request::All(requests) => requests.iter().for_each(|request| self.seed(request, reached)),
            _ => {}
        }
    }

    fn seed_wire(&self, wire: &WirePlan, reached: &mut Reached) {
        let port = |name: &str| name.rsplit_once('.').map_or(String::new(), |(_, port)| port.to_owned());
        let sender = self.owner_of(&wire.from);
        // Answers make it run as often again.
        let is_call = |known: &&Known| {
            let port = known.kind.port(&port(&wire.from));
            port.is_some_and(|port| port.shape.direction == Direction::Client)
        };
        sender.filter(is_call).into_iter().for_each(|known| reached.take_in(self, known));
        if self.is_queue(&wire.to) {
            self.receivers_of_queue(&wire.to).for_each(|known| reached.take_in(self, known));
        } else {
            let receiver = self.owner_of(&wire.to);
            if receiver.is_some_and(|known| !known.plan.on.contains(&port(&wire.to))) {
                return;
            }
            receiver.into_iter().for_each(|known| reached.take_in(self, known));
        }
        reached.wires += 1;
        reached.senders.extend(sender.map(|known| known.id));
        reached.senders.extend(self.senders_of_queue(&wire.from));
    }

    /// Takes in those that one agent makes run.
    fn follow(&self, id: AgentId, reached: &mut Reached) {
        let Some(known) = self.by_id(id) else { return };
        let wires = known.wires.iter().filter_map(|wire| self.wires.get(wire));
        for wire in wires.filter(|wire| wire.from.0 == id && !wire.is_answer) {
            if let Some(receiver) = self.by_id(wire.to.0).filter(|receiver| receiver.is_on(wire.to.1)) {
                reached.take_in(self, receiver);
            }
        }
        self.served_by(id).for_each(|receiver| reached.take_in(self, receiver));
    }
}
