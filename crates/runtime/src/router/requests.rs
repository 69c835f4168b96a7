//! Requests: each is done whole, or refused.

use types::Time;

use super::{Fabric, Reply, Router, timing_of};
use crate::executor::Change;
use crate::plan::{AgentPlan, WirePlan};
use crate::request::{FaultKind, Request};

impl Router {
    /// Checks a request and does it whole, or refuses it.
    pub(crate) fn apply(&mut self, request: Request, now: Time, fabric: &mut dyn Fabric) -> Reply<()> {
        // A request of several changes begins when all answer whom they concern: so nothing is left half done when one does not.
        let mut concerned = Vec::new();
        self.concerned(&request, &mut concerned);
        concerned.sort_unstable();
        concerned.dedup();
        for executor in concerned {
            self.commit(executor, Change::Nothing, fabric)?;
        }
        self.perform(request, now, fabric)
    }

    /// The executors that have to do with a request of several changes.
    pub(super) fn concerned(&self, request: &Request, executors: &mut Vec<usize>) {
        let of = |port: &str| self.port(port).ok().map(|(agent, _)| self.agents[agent].executor);
        match request {
            Request::Wire(WirePlan { from, to, .. }) | Request::Unwire { from, to } => {
                executors.extend([of(from), of(to)].into_iter().flatten());
            }
            Request::Remove(name) => {
                let Ok(known) = self.known(name) else { return };
                executors.push(known.executor);
                let wires = self.wires.iter().filter(|wire| wire.from.0 == known.id || wire.to.0 == known.id);
                let ends = wires.flat_map(|wire| [wire.from.0, wire.to.0]);
                executors.extend(ends.filter_map(|id| self.by_id(id)).map(|known| known.executor));
            }
            Request::Add(plan) => {
                let timing = timing_of(plan);
                executors.extend(timing.and_then(|timing| self.executor_for(plan, timing)));
                let robot = self.robot_wires(plan);
                executors.extend(robot.iter().flat_map(|wire| [of(&wire.from), of(&wire.to)]).flatten());
            }
            Request::All(requests) => requests.iter().for_each(|request| self.concerned(request, executors)),
            Request::Queue(_)
            | Request::Restart(_)
            | Request::Replace { .. }
            | Request::Set { .. }
            | Request::Fault { .. }
            | Request::Send { .. }
            | Request::Quit => {}
        }
    }

    pub(super) fn perform(&mut self, request: Request, now: Time, fabric: &mut dyn Fabric) -> Reply<()> {
        match request {
            Request::Add(plan) => self.add_wired(plan, now, fabric),
            Request::Remove(agent) => self.remove(&agent, fabric),
            Request::Restart(agent) => self.restart_now(&agent, fabric),
            Request::Replace { agent, kind, params } => self.replace(&agent, &kind, &params, fabric),
            Request::Queue(plan) => self.add_queue(plan),
            Request::Wire(plan) => self.wire(&plan, fabric),
            Request::Unwire { from, to } => self.unwire(&from, &to, fabric),
            Request::Set { agent, key, value } => self.set(&agent, &key, value, fabric),
            Request::Fault { target, fault } => self.fault(&target, fault, fabric),
            Request::Send { port, cdr } => self.send(&port, &cdr, fabric),
            Request::Quit => Ok(()),
            Request::All(requests) => self.apply_all(requests, now, fabric),
        }
    }

    /// Does several in order; when one is refused, those before it are undone where that is possible without loss.
    pub(super) fn apply_all(
        &mut self,
        requests: Vec<Request>,
        now: Time,
        fabric: &mut dyn Fabric,
    ) -> Reply<()> {
        let mut undo: Vec<Request> = Vec::new();
        for request in requests {
            let inverse = self.inverse(&request);
            match self.perform(request, now, fabric) {
                Ok(()) => undo.extend(inverse),
                Err(refusal) => {
                    for inverse in undo.into_iter().rev() {
                        // What was just done can be undone: the names are known to be right.
                        let _ = self.perform(inverse, now, fabric);
                    }
                    return Err(refusal);
                }
            }
        }
        Ok(())
    }

    /// Adds an agent and wires it to its robot; when that cannot be, it is not added.
    pub(super) fn add_wired(&mut self, plan: AgentPlan, now: Time, fabric: &mut dyn Fabric) -> Reply<()> {
        let wires = self.robot_wires(&plan);
        let name = plan.name.clone();
        self.add(plan, &[], fabric)?;
        let wires = wires.into_iter().map(Request::Wire).collect();
        self.apply_all(wires, now, fabric).inspect_err(|_| {
            // It is there, and nothing holds it.
            let _ = self.remove(&name, fabric);
        })
    }

    pub(super) fn inverse(&self, request: &Request) -> Option<Request> {
        match request {
            Request::Add(plan) => Some(Request::Remove(plan.name.clone())),
            Request::Queue(plan) => Some(Request::Remove(plan.name.clone())),
            Request::Wire(wire) => Some(Request::Unwire { from: wire.from.clone(), to: wire.to.clone() }),
            Request::Unwire { from, to } => {
                if let Some(plan) = self.queue_wire(from, to) {
                    return Some(Request::Wire(plan));
                }
                let wire = self.find_wire(from, to)?;
                Some(Request::Wire(self.plan_of(wire)))
            }
            Request::Set { agent, key, .. } => {
                let value = self.known(agent).ok()?.params.get(key)?.value.clone();
                Some(Request::Set { agent: agent.clone(), key: key.clone(), value })
            }
            Request::Fault { target, .. } => {
                Some(Request::Fault { target: target.clone(), fault: FaultKind::Ok })
            }
            Request::All(_)
            | Request::Remove(_)
            | Request::Restart(_)
            | Request::Replace { .. }
            | Request::Send { .. }
            | Request::Quit => None,
        }
    }
}
