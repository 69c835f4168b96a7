//! Requests: each is done whole, or refused.

use types::Time;

use super::admission::Asked;
use super::{Fabric, OutsideCall, Reply, Router, Staged, timing_of};
use crate::census::Given;
use crate::plan::WirePlan;
use crate::request::{Refusal, Request};

impl Router {
    /// Checks a request and does it whole, or refuses it.
    pub(crate) fn apply(&mut self, request: Request, now: Time, fabric: &mut dyn Fabric) -> Reply<()> {
        if let Request::Call { service, cdr, within } = request {
            return self.call(OutsideCall::unheard(service, cdr, within), now, fabric);
        }
        self.now = now;
        let mut concerned = Vec::new();
        self.concerned(&request, &mut concerned);
        self.carry_out(concerned, fabric, |router, staged| match request {
            Request::Forced(request) => router.stage(*request, staged).map(|()| router.note_forced()),
            request => router.stage_admitted(request, staged),
        })
    }

    /// Sets all that a resource manager says, or nothing.
    pub(super) fn apply_given(&mut self, given: &[Given], now: Time, fabric: &mut dyn Fabric) -> Reply<()> {
        self.now = now;
        let of = |given: &Given| self.owner_of(&given.agent).map(|known| known.executor);
        let concerned = given.iter().filter_map(of).collect();
        self.carry_out(concerned, fabric, |router, staged| {
            given.iter().try_for_each(|given| router.set_given(given, staged))
        })
    }

    /// Stages something, and does it where all executors concerned answer and nothing is against it.
    fn carry_out(
        &mut self,
        mut concerned: Vec<usize>,
        fabric: &mut dyn Fabric,
        stage: impl FnOnce(&mut Router, &mut Staged) -> Reply<()>,
    ) -> Reply<()> {
        concerned.sort_unstable();
        concerned.dedup();
        self.ask_all(&concerned, fabric)?;
        let mut staged = Staged::default();
        match stage(self, &mut staged) {
            Ok(()) => {
                let script = self.decide(staged);
                self.finish(script, fabric);
                self.publish(fabric);
                Ok(())
            }
            Err(refusal) => {
                self.take_back(staged);
                Err(refusal)
            }
        }
    }

    /// The executors that have to do with a request.
    fn concerned(&self, request: &Request, executors: &mut Vec<usize>) {
        let of = |name: &str| self.owner_of(name).map(|known| known.executor);
        match request {
            Request::Wire(WirePlan { from, to, .. }) | Request::Unwire { from, to } => {
                executors.extend([of(from), of(to)].into_iter().flatten());
            }
            Request::Remove(name) => {
                let Some(known) = self.owner_of(name) else { return };
                executors.push(known.executor);
                let wires = known.wires.iter().filter_map(|id| self.wires.get(id));
                let ends = wires.flat_map(|wire| [wire.from.0, wire.to.0]);
                executors.extend(ends.filter_map(|id| self.by_id(id)).map(|known| known.executor));
            }
            Request::Add(plan) => {
                let timing = timing_of(plan);
                executors.extend(timing.and_then(|timing| self.executor_for(plan, timing)));
                let robot = self.robot_wires(plan);
                executors.extend(robot.iter().flat_map(|wire| [of(&wire.from), of(&wire.to)]).flatten());
            }
            Request::Restart(target)
            | Request::Replace { agent: target, .. }
            | Request::Set { agent: target, .. }
            | Request::Fault { target, .. }
            | Request::Send { port: target, .. } => executors.extend(of(target)),
            Request::All(requests) => requests.iter().for_each(|request| self.concerned(request, executors)),
            Request::Forced(request) => self.concerned(request, executors),
            Request::Queue(_) | Request::Call { .. } | Request::Quit => {}
        }
    }

    /// The same as [`stage`](Self::stage), and refuses it where deadlines would be missed by it that are met now.
    fn stage_admitted(&mut self, request: Request, staged: &mut Staged) -> Reply<()> {
        let asked = if self.admits() { Asked::of(&request) } else { None };
        let Some(asked) = asked else { return self.stage(request, staged) };
        if !self.reaches_real_time(&request) {
            self.stage(request, staged)?;
            self.note_unjudged(&asked.own);
            return Ok(());
        }
        // What cannot be analysed as it is is no reason to refuse something else.
        let before = self.judged().ok().flatten();
        self.stage(request, staged)?;
        self.admit(before.as_ref(), &asked)
    }

    /// Checks a request and writes it into the registry. When it is refused, what was written is to be taken back.
    pub(super) fn stage(&mut self, request: Request, staged: &mut Staged) -> Reply<()> {
        match request {
            Request::Add(plan) => self.add_wired(plan, staged),
            Request::Remove(agent) => self.remove(&agent, staged),
            Request::Restart(agent) => self.restart_now(&agent, staged),
            Request::Replace { agent, kind, params } => self.replace(&agent, &kind, &params, staged),
            Request::Queue(plan) => self.add_queue(plan, staged),
            Request::Wire(plan) => self.wire(&plan, staged),
            Request::Unwire { from, to } => self.unwire(&from, &to, staged),
            Request::Set { agent, key, value } => self.set(&agent, &key, value, staged),
            Request::Fault { target, fault } => self.fault(&target, fault, staged),
            Request::Send { port, cdr } => self.send(&port, &cdr, staged),
            Request::Call { service, .. } => {
                Err(Refusal::new(format!("a call of {service} cannot be done together with other requests"))
                    .help("ask for it alone"))
            }
            Request::Quit => Ok(()),
            Request::Forced(request) => self.stage(*request, staged),
            Request::All(requests) => {
                requests.into_iter().try_for_each(|request| self.stage(request, staged))
            }
        }
    }

    /// Does what was staged where nobody runs yet.
    pub(crate) fn settle(&mut self, staged: Staged, fabric: &mut dyn Fabric) {
        let script = self.decide(staged);
        self.finish(script, fabric);
        self.publish(fabric);
    }
}
