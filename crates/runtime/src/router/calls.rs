//! Calls from outside: a service is called by somebody who is no agent, and no wire of the system is touched.
//!
//! ```text
//!   control side                              the service's executor
//!   call ── join, send ─────────────────────▶ its mailbox ─▶ its step
//!   answer, or time-out ◀── a ring of its own ◀───────────── its answer
//!   end  ── forget, leave ──────────────────▶
//! ```
//!
//! Each call has ends of its own and a number of its own as sender, so no answer is taken for another, however late it comes.

use std::sync::Arc;
use std::sync::mpsc::{SyncSender, sync_channel};

use types::definition::Definition;
use types::{AgentId, Category, Duration, Filter, Priority, Time};

use super::script::{Cut, Step, Tally, What};
use super::{AgentState, Fabric, PortId, Reply, Router};
use crate::executor::Change;
use crate::port::{
    Direction, Envelope, InputEnd, NoSeat, OutputEnd, PortEnds, PreparedWire, Target, WireCounts, WireId,
    WireSpec,
};
use crate::request::{Refusal, Request};
use crate::ring::Overload;
use crate::service::answers_for;

/// How many calls from outside can be under way. Each holds two rings; people and scripts make a few.
const CALLS: usize = 64;

/// What a service takes and gives.
#[derive(Clone, Debug)]
pub struct ServiceShape {
    /// What is asked.
    pub question: Definition,
    /// What is answered.
    pub answer: Definition,
}

/// A call from outside, as it is asked for.
#[derive(Debug)]
pub(crate) struct OutsideCall {
    pub service: String,
    /// The question, as CDR.
    pub cdr: Vec<u8>,
    pub within: Duration,
    /// Who waits for the answer.
    pub asker: SyncSender<Reply<Vec<u8>>>,
}

impl OutsideCall {
    /// One whose answer nobody waits for.
    pub(super) fn unheard(service: String, cdr: Vec<u8>, within: Duration) -> OutsideCall {
        let (asker, _) = sync_channel(1);
        OutsideCall { service, cdr, within, asker }
    }

    /// What is asked, for the log: as of the request that it is.
    pub(crate) fn said(&self) -> String {
        let (service, cdr) = (self.service.clone(), self.cdr.clone());
        format!("{:?}", Request::Call { service, cdr, within: self.within })
    }
}

/// A call from outside that is under way.
pub(super) struct UnderWay {
    call: OutsideCall,
    deadline: Time,
    service: PortId,
    question: WireId,
    asked: Arc<WireCounts>,
    answer: WireId,
    /// Where the answer comes in. Only the control side touches it.
    answers: Arc<dyn InputEnd>,
}

/// A service and its ends.
type Ends = (PortId, Arc<dyn InputEnd>, Arc<dyn OutputEnd>);

impl Router {
    /// What a service takes and gives.
    pub(crate) fn service(&self, port: &str) -> Reply<ServiceShape> {
        let (_, calls, answers) = self.service_ends(port)?;
        Ok(ServiceShape {
            question: (calls.message_type().definition)(),
            answer: (answers.message_type().definition)(),
        })
    }

    fn service_ends(&self, name: &str) -> Reply<Ends> {
        let unknown = |agent: &super::Known, port: &str| {
            let services = agent.kind.ports.iter().filter(|port| port.shape.direction == Direction::Service);
            let services: Vec<&str> = services.map(|port| port.name).collect();
            let what = format!("service of {}", agent.plan.name);
            Refusal::unknown(&what, port, services)
        };
        let (agent, port) = self.port(name).or_else(|refusal| match name.rsplit_once('.') {
            Some((agent, port)) => Err(unknown(self.known(agent)?, port)),
            None => Err(refusal),
        })?;
        let known = &self.agents[&agent];
        let (shape, ends) = (&known.kind.ports[port], &known.ends[port]);
        match (shape.shape.direction, &ends.input, &ends.output) {
            (Direction::Service, Some(calls), Some(answers)) => {
                Ok(((agent, port), calls.clone(), answers.clone()))
            }
            _ => Err(unknown(known, shape.name)),
        }
    }

    /// Begins a call. Its answer, or the news that none came, goes to the asker later; a refusal goes there at once.
    pub(crate) fn call(&mut self, call: OutsideCall, now: Time, fabric: &mut dyn Fabric) -> Reply<()> {
        let asker = call.asker.clone();
        self.begin_call(call, now, fabric).inspect_err(|refusal| {
            // Whoever asked may be gone.
            let _ = asker.send(Err(refusal.clone()));
        })
    }

    fn begin_call(&mut self, call: OutsideCall, now: Time, fabric: &mut dyn Fabric) -> Reply<()> {
        self.now = now;
        let (service, calls, answers) = self.service_ends(&call.service)?;
        let (id, port) = service;
        let known = &self.agents[&id];
        if known.state == AgentState::Dead {
            return Err(Refusal::new(format!("{} is dead and answers no calls", known.plan.name))
                .help("restart it, and call again"));
        }
        if self.calls.len() >= CALLS {
            return Err(Refusal::new(format!("{CALLS} calls from outside are under way already"))
                .help("wait for the answers"));
        }
        let (executor, slot, wakes, rings) =
            (known.executor, known.slot, known.wakes(port), known.rings[port]);
        let priorities = known.priorities(port);
        let deadline = now.saturating_add(call.within);
        // Numbers from the other end: those of agents stay what they are without the call.
        self.next_caller -= 1;
        let caller = AgentId(self.next_caller);

        let questions = calls.facing();
        questions.set_sender(caller, 0);
        let message =
            questions.prepare_message(&call.cdr).map_err(|error| Refusal::new(error.to_string()))?;
        let asking = self.spec(executor, slot, wakes, Filter::ALL);
        let lanes = rings.into * Priority::ALL.len();
        let PreparedWire { mut route, lanes } = prepared(&questions, &asking, &[Priority::Normal], 0, lanes)?;
        // Nobody else has these ends yet, so they are touched here.
        questions.add_route(route.as_mut());

        let facing = answers.facing();
        let answering = self.spec(executor, slot, false, answers_for(caller));
        let PreparedWire { route, lanes: mut back } =
            prepared(&answers, &answering, &priorities, rings.out, 0)?;
        facing.join(back.as_mut());

        let envelope = Envelope { deadline, marker: 1, category: Category::Call, ..Envelope::default() };
        let (question, answer, asked) = (asking.id, answering.id, asking.counts.clone());
        self.calls.push(UnderWay { call, deadline, service, question, asked, answer, answers: facing });
        self.of_mut(id, |known| {
            known.joined(port, 1);
            known.routed(port, 1);
        });
        let steps = [
            (answer, Change::Route { end: answers, route, slot }),
            (question, Change::Join { end: calls, lanes, slot }),
            (question, Change::Send { end: questions, message, envelope, slot }),
        ];
        let steps = steps.map(|(ring, change)| {
            let (ring, what) = (Some(ring), What::Change(change));
            Step { executor, of: id, ring, what }
        });
        // Nobody waits for its executor: who asks is told when the time is over.
        self.begin(steps.into());
        self.advance(fabric);
        Ok(())
    }

    /// A wire for one message to or from the agent in a slot.
    fn spec(&mut self, executor: usize, slot: u32, wakes: bool, filter: Filter) -> WireSpec {
        let door = self.executors[executor].link.door.clone();
        let target = Target { agent: AgentId::NONE, executor: executor as u32, slot, door, wakes };
        let counts = Arc::new(WireCounts::default());
        WireSpec { id: self.wire_id(), depth: 1, overload: Overload::Refuse, filter, target, counts }
    }

    /// Passes on the answers that have come, and tells those who have waited long enough. Gives the time of the next deadline.
    pub(crate) fn answer_calls(&mut self, now: Time, fabric: &mut dyn Fabric) -> Time {
        self.now = now;
        let mut next = Time::NEVER;
        let mut at = 0;
        while let Some(under_way) = self.calls.get(at) {
            let outcome = match under_way.answers.take_cdr() {
                Some(cdr) => Ok(cdr),
                None if under_way.deadline <= now => Err(too_late(&under_way.call)),
                None => {
                    next = next.min(under_way.deadline);
                    at += 1;
                    continue;
                }
            };
            let under_way = self.calls.remove(at);
            // Whoever asked may be gone.
            let _ = under_way.call.asker.send(outcome);
            self.hang_up(&under_way, fabric);
        }
        next
    }

    /// Whether anybody outside waits for an answer.
    pub(crate) fn has_calls(&self) -> bool {
        !self.calls.is_empty()
    }

    /// Takes the ends of a call away from the service: when its executor comes to it, and nobody waits for that.
    fn hang_up(&mut self, under_way: &UnderWay, fabric: &mut dyn Fabric) {
        let (id, port) = under_way.service;
        let Some(known) = self.by_id(id) else { return };
        let (executor, slot) = (known.executor, known.slot);
        let PortEnds { input: Some(input), output: Some(output), .. } = known.ends[port].clone() else {
            return;
        };
        let into = output.forgetting_box();
        let forget = Change::Forget { end: output, wire: under_way.answer, into, slot };
        let cut = Cut {
            slot,
            to: under_way.service,
            from: under_way.service,
            end: input,
            ring: under_way.question,
            counts: under_way.asked.clone(),
            into: Tally::Nowhere,
            until: self.now,
        };
        let step = |what| Step { executor, of: id, ring: None, what };
        self.begin(vec![step(What::Change(forget)), step(What::Cut(cut))]);
        self.advance(fabric);
    }

    /// The agent is gone or about to go, and with it all that its callers wait for.
    pub(super) fn end_calls_of(&mut self, agent: AgentId, why: &str) {
        self.calls.retain(|under_way| {
            let is_its = under_way.service.0 == agent;
            if is_its {
                let what = format!("{} {why}", under_way.call.service);
                // Whoever asked may be gone.
                let _ = under_way.call.asker.send(Err(Refusal::new(what)));
            }
            !is_its
        });
    }
}

fn prepared(
    output: &Arc<dyn OutputEnd>,
    spec: &WireSpec,
    priorities: &[Priority],
    routes: usize,
    lanes: usize,
) -> Reply<PreparedWire> {
    output.prepare(spec, priorities, routes, lanes).map_err(|NoSeat { seats }| {
        Refusal::new(format!("the answers have readers on all {seats} seats of their memory"))
    })
}

fn too_late(call: &OutsideCall) -> Refusal {
    let agent = crate::plan::owner(&call.service);
    Refusal::new(format!("{} did not answer within {}", call.service, call.within))
        .help(format!("see whether {agent} runs and takes its calls"))
}
