//! What happens when agents die.

use types::{AgentId, Duration, Time};

use super::agents::new_ends;
use super::script::{Step, Tally, What};
use super::{Fabric, Incident, Known, Reply, Rings, Router, Wire};
use crate::agent::Body;
use crate::executor::{Cause, RawCause};
use crate::plan::OnDeath;
use crate::port::{OutputFault, WireId};
use crate::request::{AgentState, Refusal, WireTotals};

/// Restart waits this long after the first death, and twice as long after each that follows.
const FIRST_PAUSE: Duration = Duration::millis(100);
const LONGEST_PAUSE: Duration = Duration::secs(5);
/// More deaths than this within a minute, and the agent is left dead.
const MOST_RESTARTS: usize = 5;
const RESTARTS_WITHIN: Duration = Duration::secs(60);

impl Router {
    /// Looks for deaths, starts again who is due, and goes on with what is not done yet. Gives the time at which it wants to look
    /// again.
    pub(crate) fn supervise(&mut self, now: Time, fabric: &mut dyn Fabric) -> Time {
        self.now = now;
        self.take_answers();
        self.note_outgrown(now);
        let mut next = Time::NEVER;
        if self.restarting > 0 {
            next = self.restart_who_is_due();
        }
        if self.has_to_do() {
            next = next.min(self.ask_again());
            self.advance(fabric);
        }
        self.publish(fabric);
        next
    }

    fn restart_who_is_due(&mut self) -> Time {
        let waits = |known: &&Known| known.state == AgentState::Restarting;
        let waiting: Vec<(AgentId, Time, bool)> = (self.agents.values().filter(waits))
            .map(|known| (known.id, known.restart_at, known.starting))
            .collect();
        self.restarting = waiting.len();
        let mut next = Time::NEVER;
        for (id, at, _) in waiting.into_iter().filter(|(_, _, starting)| !starting) {
            if at > self.now {
                next = next.min(at);
            } else if let Err(refusal) = self.start_again(id) {
                self.of_mut(id, |known| known.state = AgentState::Dead);
                self.asking.changes();
                self.say_of(id, format!("left dead, for it cannot be built: {refusal}"));
            }
        }
        next
    }

    /// Has another instance put in the place of one that died. Its executor does so when it comes to it.
    fn start_again(&mut self, id: AgentId) -> Reply<()> {
        let Some(known) = self.agents.get_mut(&id) else { return Ok(()) };
        let body = built(known)?;
        known.spare = known.kind.build(&known.params).ok();
        known.starting = true;
        let step = self.install(id, body, false);
        self.begin(vec![step]);
        Ok(())
    }

    fn say_of(&mut self, id: AgentId, what: String) {
        let agent = match self.by_id(id) {
            Some(known) => known.plan.name.clone(),
            None => self.directory.name(id).map_or_else(String::new, |name| name.as_str().to_owned()),
        };
        self.incidents.push(Incident { time: self.now, agent, what });
    }

    /// An executor says that an agent died. One that was lost is back when its body is: in simulated time.
    pub(super) fn died(&mut self, slot: u32, id: AgentId, time: Time, cause: RawCause, is_back: bool) {
        let lost = matches!(cause, RawCause::Hang | RawCause::Stop);
        let cause = match cause {
            RawCause::Fault(fault) => Cause::Fault(fault),
            RawCause::Hang => Cause::Hang,
            RawCause::Stop => Cause::Stop,
            RawCause::Panic(record, payload) => {
                drop(payload);
                Cause::Panic(record.to_text())
            }
        };
        self.asking.changes();
        if self.by_id(id).is_some_and(|known| known.slot == slot) {
            self.bury(id, time, &cause);
            if lost {
                self.renew(id, is_back);
            }
        } else if lost {
            // It was removed meanwhile, or that is where it is lost.
            self.abandon(id, &[], is_back);
            self.abandon_cut_queues(id);
            self.say_of(id, format!("{cause}; it was removed"));
        }
    }

    fn bury(&mut self, id: AgentId, time: Time, cause: &Cause) {
        let Some(known) = self.agents.get_mut(&id) else { return };
        known.starting = false;
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

    /// Gives an agent that is lost in a step new ports under its old number. Its old ones may still be in use there: they are left to
    /// it, nobody listens to them any more, and nobody sends to them.
    fn renew(&mut self, id: AgentId, is_back: bool) {
        let Some(known) = self.by_id(id) else { return };
        let touching: Vec<Wire> =
            known.wires.iter().filter_map(|wire| self.wires.get(wire)).cloned().collect();
        let rings: Vec<WireId> = touching.iter().map(|wire| wire.ring).collect();
        self.abandon(id, &rings, is_back);
        self.abandon_cut_queues(id);
        self.abandon_queues(id);
        self.end_calls_of(id, "does not return from its step");
        if let Err(refusal) = self.new_ports(id) {
            self.of_mut(id, |known| known.state = AgentState::Dead);
            self.say_of(id, format!("left dead, for it cannot be built: {refusal}"));
            return;
        }
        let order = self.order_step(self.agents[&id].executor);
        // What stands ready for the next hand-over is used up.
        let mut steps = vec![order, self.seat_step(&self.agents[&id], None)];
        for old in touching {
            let mut wire = Wire { ring: self.wire_id(), counts: Default::default(), ..old.clone() };
            match self.connect(&wire) {
                Ok(made) => steps.extend(made),
                Err(refusal) => self.lose(&wire, refusal),
            }
            // The sender forgets the old ring when it has the new one, so that no message of it falls between the two.
            if old.from.0 != id {
                steps.extend(self.forget_step(&old));
            }
            if old.to.0 == id {
                if is_back && old.from.0 != id {
                    // Else it keeps its place in the memory of the sender.
                    self.of_mut(old.from.0, |known| known.routed(old.from.1, -1));
                }
                wire.past += WireTotals::at_the_end(&old.counts);
            } else if let Some((executor, mut cut)) =
                self.cut_of(&old, Tally::Wire(old.id, WireTotals::default()), self.now)
            {
                cut.from = (AgentId::NONE, 0);
                let of = cut.to.0;
                steps.push(Step { executor, of, ring: None, what: What::Cut(cut) });
            }
            if let Some(listed) = self.wires.get_mut(&old.id) {
                *listed = wire;
            }
        }
        for (plan, refusal) in self.renew_queue_wires(id, &mut steps) {
            self.say_of(id, format!("the wire from {} to {} is lost: {refusal}", plan.from, plan.to));
        }
        self.begin(steps);
    }

    /// A wire that cannot be made again.
    fn lose(&mut self, wire: &Wire, refusal: Refusal) {
        let plan = self.plan_of(wire);
        self.say_of(wire.from.0, format!("the wire from {} to {} is lost: {refusal}", plan.from, plan.to));
        self.asking.changes();
        let lost = self.unlist(wire.id).and_then(|wire| wire.partner);
        if let Some(partner) = lost {
            self.unlist(partner);
        }
    }

    fn new_ports(&mut self, id: AgentId) -> Reply<()> {
        let Some(known) = self.agents.get_mut(&id) else { return Ok(()) };
        let mut body = built(known)?;
        let outs = known.rings.iter().map(|rings| rings.out).collect::<Vec<_>>();
        let made = new_ends(&known.plan, &known.kind, body.as_mut(), &outs)?;
        for (new, old) in made.iter().zip(&known.ends) {
            if let (Some(new), Some(old)) = (&new.output, &old.output) {
                // What is sent in the lost step from now on is not of the run any more.
                old.set_log(u32::MAX, 0);
                new.set_sender(id, old.sent());
            }
        }
        for (end, fault) in made.iter().zip(&known.output_faults) {
            if let Some(output) = &end.output
                && *fault != OutputFault::None
            {
                // Nobody else has it yet.
                output.set_fault(output.prepare_fault(*fault).as_mut());
            }
        }
        known.spare = Some(body);
        known.ends = made;
        known.rings.fill(Rings::default());
        let (name, kind, ends) = (known.plan.name.clone(), known.kind.clone(), known.ends.clone());
        self.number_outputs(&name, &kind, &ends);
        self.acquaint(id);
        Ok(())
    }
}

/// An instance, made ahead or now.
fn built(known: &mut Known) -> Reply<Box<dyn Body>> {
    match known.spare.take() {
        Some(body) => Ok(body),
        None => known.kind.build(&known.params).map_err(super::first),
    }
}
