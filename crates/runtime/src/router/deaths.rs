//! What happens when agents die.

use core::sync::atomic::Ordering::Relaxed;

use types::{AgentId, Duration, Time};

use super::{Fabric, Incident, Router, Wire};
use crate::executor::{Answer, Cause, Change, RawCause};
use crate::plan::{OnDeath, WirePlan};
use crate::port::{PortEnds, WireId};
use crate::request::AgentState;

/// Restart waits this long after the first death, and twice as long after each that follows.
const FIRST_PAUSE: Duration = Duration::millis(100);
const LONGEST_PAUSE: Duration = Duration::secs(5);
/// More deaths than this within a minute, and the agent is left dead.
const MOST_RESTARTS: usize = 5;
const RESTARTS_WITHIN: Duration = Duration::secs(60);

impl Router {
    /// Looks for deaths, and starts again who is due. Gives the time at which it wants to look again.
    pub(crate) fn supervise(&mut self, now: Time, fabric: &mut dyn Fabric) -> Time {
        for executor in 0..self.executors.len() {
            while let Some(answer) = self.executors[executor].link.answer() {
                self.died.push((executor, answer));
            }
        }
        for (executor, answer) in core::mem::take(&mut self.died) {
            if let Answer::Died { slot, id, time, cause, body } = answer {
                let hung = matches!(cause, RawCause::Hang);
                self.bury(executor, slot, id, time, cause);
                drop(body);
                if hung {
                    self.renew(id, fabric);
                }
            }
        }
        if self.restarting == 0 {
            return Time::NEVER;
        }
        self.restarting = self.agents.iter().filter(|known| known.state == AgentState::Restarting).count();
        let mut next = Time::NEVER;
        for at in 0..self.agents.len() {
            let known = &mut self.agents[at];
            if known.state != AgentState::Restarting {
                continue;
            }
            if known.restart_at > now {
                next = next.min(known.restart_at);
                continue;
            }
            let body = known.spare.take().map_or_else(|| known.kind.build(&known.params), Ok);
            match body {
                Ok(body) => {
                    let name = known.plan.name.clone();
                    match self.install(at, body, false, fabric) {
                        Ok(()) => self.incidents.push(Incident {
                            time: now,
                            agent: name,
                            what: "started again".into(),
                        }),
                        Err(refusal) => {
                            self.incidents.push(Incident {
                                time: now,
                                agent: name,
                                what: format!("not started again: {refusal}"),
                            });
                            self.agents[at].state = AgentState::Dead;
                        }
                    }
                    let known = &mut self.agents[at];
                    known.spare = known.kind.build(&known.params).ok();
                }
                Err(_) => known.state = AgentState::Dead,
            }
        }
        next
    }

    /// Gives an agent whose step did not return new ports and a new number. Its old ones may still be in use by the step: they
    /// are left to it, nobody listens to them any more, and nobody sends to them.
    pub(super) fn renew(&mut self, id: AgentId, fabric: &mut dyn Fabric) {
        let Some(at) = self.agents.iter().position(|known| known.id == id) else { return };
        let touched = |wire: &Wire| wire.from.0 == id || wire.to.0 == id;
        let mut plans: Vec<WirePlan> = self
            .wires
            .iter()
            .filter(|wire| touched(wire) && !wire.is_answer)
            .map(|wire| self.plan_of(wire))
            .collect();
        type Ends = (WireId, (AgentId, usize), (AgentId, usize));
        let old: Vec<Ends> = self
            .wires
            .iter()
            .filter(|wire| touched(wire))
            .map(|wire| (wire.id, wire.from, wire.to))
            .collect();
        for (wire, from, to) in old {
            let side = |id: AgentId, port: usize| {
                self.by_id(id).map(|known| (known.executor, known.ends[port].clone()))
            };
            // What an executor does not let go of now, it does when it answers again.
            if from.0 != id
                && let Some((executor, PortEnds { output: Some(end), .. })) = side(from.0, from.1)
            {
                self.forget(executor, end, wire, fabric);
            } else if to.0 != id
                && let Some((executor, PortEnds { input: Some(end), .. })) = side(to.0, to.1)
            {
                self.leave(executor, end, wire, true, fabric);
            }
        }
        self.wires.retain(|wire| wire.from.0 != id && wire.to.0 != id);
        plans.extend(self.abandon_queues(id));
        let known = self.agents.remove(at);
        let _ = self.commit(known.executor, Change::Unseat { slot: known.slot, seat: None }, fabric);
        self.executors[known.executor].slots[known.slot as usize] = false;
        if self.add(known.plan, &[], fabric).is_err() {
            return;
        }
        for plan in plans {
            let _ = self.wire(&plan, fabric);
        }
        if let Some(new) = self.agents.last_mut() {
            (new.deaths, new.last_death, new.restart_at) = (known.deaths, known.last_death, known.restart_at);
            new.state = known.state;
            let hangs = known.stats.hangs.load(Relaxed);
            new.stats.hangs.store(hangs, Relaxed);
            new.stats.restarts.store(known.stats.restarts.load(Relaxed), Relaxed);
            let (executor, slot) = (new.executor, new.slot);
            // It waits for its restart like everybody who died.
            let _ = self.commit(executor, Change::Body { slot, body: None, hands_over: false }, fabric);
        }
    }

    pub(super) fn bury(&mut self, executor: usize, slot: u32, id: AgentId, time: Time, cause: RawCause) {
        let _ = executor;
        let cause = match cause {
            RawCause::Fault(fault) => Cause::Fault(fault),
            RawCause::Hang => Cause::Hang,
            RawCause::Panic(record, payload) => {
                drop(payload);
                Cause::Panic(record.to_text())
            }
        };
        let Some(known) = self.agents.iter_mut().find(|known| known.id == id && known.slot == slot) else {
            return;
        };
        known.last_death = Some(cause.to_string());
        known.deaths.retain(|death| *death + RESTARTS_WITHIN > time);
        known.deaths.push(time);
        let deaths = known.deaths.len();
        let mut what = cause.to_string();
        if known.plan.on_death == OnDeath::Leave {
            known.state = AgentState::Dead;
            what += "; left dead, as its plan says";
        } else if deaths > MOST_RESTARTS {
            known.state = AgentState::Dead;
            what += &format!("; left dead after {MOST_RESTARTS} restarts within a minute");
        } else {
            known.state = AgentState::Restarting;
            self.restarting += 1;
            let pause = Duration((FIRST_PAUSE.0 << (deaths - 1).min(16)).min(LONGEST_PAUSE.0));
            known.restart_at = time + pause;
        }
        self.incidents.push(Incident { time, agent: known.plan.name.clone(), what });
    }
}
