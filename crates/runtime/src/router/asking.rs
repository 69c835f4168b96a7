//! What agents ask of the router: they are told what the system is made of, and what became of their requests.
//!
//! Whoever has an end at the router is told by a change for its executor, as any other change: at most one that only tells what there is
//! is on its way to each, so an executor that does not answer costs one, and gets the last state when it does. A request of an agent goes
//! the way of anybody's: it is checked and done whole, or refused.

use core::sync::atomic::{AtomicU64, Ordering};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::sync::Arc;

use types::{AgentId, Priority, Text, Time};

use super::script::{Step, What};
use super::{Fabric, Known, PortId, Router};
use crate::composition::{Composition, EndRow, NewMember, Parts, PortAt, WireRow};
use crate::executor::Change;
use crate::plan::{WireFilter, WirePlan};
use crate::port::{
    Acquaintance, Ask, Decision, Deed, Direction, Place, REQUESTS_UNDER_WAY, RouterEnd, Told, Why, router_end,
};
use crate::request::Request;

/// Who asks, and what there is to be known.
#[derive(Default)]
pub(super) struct Asking {
    /// By the agent's number and the place of the port.
    askers: BTreeMap<PortId, Asker>,
    /// How often agents have asked.
    bell: Arc<AtomicU64>,
    /// Up to which of these all was decided.
    heard: u64,
    pub(super) composition: Arc<Composition>,
    /// Whether what it says may be different now.
    is_stale: bool,
}

/// An agent's end at the router.
struct Asker {
    end: Arc<RouterEnd>,
    /// The version that it was told last, or will be told by what is on its way.
    told: u64,
    /// The script that tells it.
    telling: u64,
}

/// A request of an agent and what became of it, for the log.
pub(crate) struct Said {
    /// Who asked.
    pub agent: String,
    /// What, in words.
    pub what: String,
}

/// Why a request was refused, for the agent and for people.
type Judged<T> = Result<T, (Why, String)>;

impl Asking {
    /// From here on it may be another system.
    pub(super) fn changes(&mut self) {
        self.is_stale = true;
    }
}

impl Router {
    /// Takes in the ends of an agent that is new, or has new ones, before anybody else has them.
    pub(super) fn acquaint(&mut self, id: AgentId) {
        self.acquaint_manager(id);
        let Some(known) = self.agents.get(&id) else { return };
        let ends = known.ends.iter().enumerate();
        let ends: Vec<(usize, Arc<RouterEnd>)> =
            ends.filter_map(|(port, ends)| Some((port, router_end(ends)?))).collect();
        if ends.is_empty() {
            return;
        }
        let on: Vec<bool> = ends.iter().map(|(port, _)| known.is_on(*port)).collect();
        let own = addresses(known);
        self.compose();
        for ((port, end), runs_for_news) in ends.into_iter().zip(on) {
            let Asking { askers, bell, composition, .. } = &mut self.asking;
            let before = askers.get(&(id, port)).map(|asker| asker.end.clone());
            let (composition, bell, own) = (composition.clone(), bell.clone(), own.clone());
            end.acquaint(Acquaintance { composition, bell, own, runs_for_news }, before.as_deref());
            askers.insert((id, port), Asker { end, told: 0, telling: 0 });
        }
    }

    /// The agent is gone, and nobody waits for what it asked.
    pub(super) fn dismiss(&mut self, id: AgentId) {
        self.asking.askers.retain(|(agent, _), _| *agent != id);
        self.dismiss_manager(id);
    }

    /// Another instance of the agent has seen nothing yet.
    pub(super) fn tell_anew(&mut self, id: AgentId) {
        for (_, asker) in self.asking.askers.range_mut((id, 0)..=(id, usize::MAX)) {
            asker.told = 0;
        }
    }

    /// Brings what is known up to date.
    fn compose(&mut self) {
        if !core::mem::take(&mut self.asking.is_stale) {
            return;
        }
        let parts = self.parts();
        if let Some(next) = self.asking.composition.next(parts) {
            self.asking.composition = Arc::new(next);
        }
    }

    fn parts(&self) -> Parts<'_> {
        let members = self.agents.values().map(|known| NewMember {
            id: known.id,
            name: &known.plan.name,
            kind: known.kind.kind,
            doc: known.kind.doc,
            state: known.state,
            ports: &known.kind.ports,
        });
        let wires = self.wires.values().filter(|wire| !wire.is_answer);
        let wires = wires.map(|wire| (row_of(wire.from), row_of(wire.to)));
        let (queues, to_queues) = self.parts_of_queues();
        Parts { members: members.collect(), queues, wires: wires.chain(to_queues).collect() }
    }

    /// Tells all who have an end here what the system is made of now, where they do not know it yet.
    pub(super) fn publish(&mut self, fabric: &mut dyn Fabric) {
        if self.asking.askers.is_empty() {
            return;
        }
        self.compose();
        let version = self.asking.composition.version();
        let is_under_way = |telling: u64| self.scripts.iter().any(|script| script.is(telling));
        let askers = self.asking.askers.iter();
        let behind: Vec<PortId> = askers
            .filter(|(_, asker)| asker.told < version && !is_under_way(asker.telling))
            .map(|(asker, _)| *asker)
            .collect();
        if behind.is_empty() {
            return;
        }
        // One script for each executor, however many agents it has.
        let mut steps: BTreeMap<usize, (Vec<PortId>, Vec<Step>)> = BTreeMap::new();
        for asker in behind {
            if let Some(step) = self.telling_step(asker, None) {
                let (askers, steps) = steps.entry(step.executor).or_default();
                askers.push(asker);
                steps.push(step);
            }
        }
        for (askers, steps) in steps.into_values() {
            self.tell(&askers, steps);
        }
        self.advance(fabric);
    }

    /// Tells agents of one executor.
    fn tell(&mut self, askers: &[PortId], steps: Vec<Step>) {
        let script = self.begin(steps);
        for asker in askers {
            if let Some(asker) = self.asking.askers.get_mut(asker) {
                asker.telling = script;
            }
        }
    }

    /// What tells an agent what there is, and what became of a request.
    fn telling_step(&mut self, asker: PortId, decision: Option<(u32, Decision)>) -> Option<Step> {
        let known = self.agents.get(&asker.0)?;
        let (executor, slot, of) = (known.executor, known.slot, known.id);
        let known = self.asking.askers.get_mut(&asker)?;
        let composition = self.asking.composition.clone();
        let anew = core::mem::replace(&mut known.told, composition.version()) == 0;
        let told = Box::new(Told { composition: Some(composition), anew, decision });
        let change = Change::Tell { end: known.end.clone(), told, slot };
        Some(Step { executor, of, ring: None, what: What::Change(change) })
    }

    /// Whether an agent has asked for something that is not decided yet.
    pub(crate) fn is_asked(&self) -> bool {
        // Pairs with the release where an agent asks.
        self.asking.bell.load(Ordering::Acquire) != self.asking.heard
    }

    /// Decides what agents have asked for until now, in the order of their numbers. What one asks meanwhile waits for the next time.
    pub(crate) fn decide_asked(&mut self, now: Time, fabric: &mut dyn Fabric) -> Vec<Said> {
        let mut said = Vec::new();
        let rung = self.asking.bell.load(Ordering::Acquire);
        if rung == self.asking.heard {
            return said;
        }
        self.now = now;
        let askers: Vec<PortId> = self.asking.askers.keys().copied().collect();
        for asker in askers {
            for _ in 0..REQUESTS_UNDER_WAY {
                let Some(ask) = self.asking.askers.get(&asker).and_then(|asker| asker.end.take_ask()) else {
                    break;
                };
                let (what, decided) = self.decide_for(asker.0, &ask, now, fabric);
                let mut is_busy = false;
                let (decision, outcome) = match decided {
                    Ok(()) => (Decision::Done, String::new()),
                    Err((why, reason)) => {
                        is_busy = why == Why::Busy;
                        (Decision::Refused { why, what: Text::new(&reason) }, format!("; refused: {reason}"))
                    }
                };
                let agent = self.by_id(asker.0).map_or_else(String::new, |known| known.plan.name.clone());
                said.push(Said { agent, what: format!("asked the router: {what}{outcome}") });
                let step = self.telling_step(asker, Some((ask.ticket, decision)));
                self.tell(&[asker], step.into_iter().collect());
                self.advance(fabric);
                if is_busy {
                    // An executor was waited for as long as there is patience. Others are served before the next request is.
                    return said;
                }
            }
        }
        self.asking.heard = rung;
        said
    }

    fn decide_for(
        &mut self,
        id: AgentId,
        ask: &Ask,
        now: Time,
        fabric: &mut dyn Fabric,
    ) -> (String, Judged<()>) {
        let mut what = words_of(ask.deed).to_owned();
        let judged = self.judge(id, ask, &mut what);
        let decided = judged.and_then(|(request, executors)| {
            self.ask_all(&executors, fabric).map_err(|refusal| (Why::Busy, refusal.to_string()))?;
            self.apply(request, now, fabric).map_err(|refusal| (Why::Other, refusal.to_string()))
        });
        (what, decided)
    }

    /// Checks what the agent has to know of a request, and gives it in the form in which anybody asks, with the executors concerned.
    fn judge(&self, id: AgentId, ask: &Ask, what: &mut String) -> Judged<(Request, Vec<usize>)> {
        let other = self.place_of(&ask.other, what)?;
        let own = (id, usize::from(ask.own));
        let own = (self.port_name(own), Some(own));
        let (from, to) = match ask.deed {
            Deed::Subscribe | Deed::Unsubscribe => (other, own),
            Deed::Connect | Deed::Disconnect => (own, other),
        };
        let mut plan = WirePlan::new(from.0, to.0);
        let wiring = &ask.wiring;
        (plan.depth, plan.overload, plan.serving) = (wiring.depth, wiring.overload, wiring.serving);
        plan.filter = self.filter_of(ask)?;
        let makes = matches!(ask.deed, Deed::Subscribe | Deed::Connect);
        *what = if makes { in_words(&plan) } else { format!("unwire {} {}", plan.from, plan.to) };
        if let (Some(from), Some(to)) = (from.1, to.1) {
            self.judge_wire(&plan, from, to, makes)?;
        }
        let ends = [from.1, to.1].into_iter().flatten();
        let executors = ends.filter_map(|(id, _)| self.by_id(id)).map(|known| known.executor).collect();
        let WirePlan { from, to, .. } = &plan;
        let unwire = Request::Unwire { from: from.clone(), to: to.clone() };
        Ok((if makes { Request::Wire(plan) } else { unwire }, executors))
    }

    /// The name of the other end, and its port where it is one.
    fn place_of(&self, place: &Place, what: &mut String) -> Judged<(String, Option<PortId>)> {
        match place {
            Place::Port(PortAt { agent, port }) => {
                let at = (*agent, usize::from(*port));
                let there = self.by_id(at.0).filter(|known| at.1 < known.kind.ports.len());
                if there.is_none() {
                    let who =
                        self.directory.name(*agent).map_or_else(|| "its agent".into(), |it| it.to_string());
                    let _ = write!(what, " with {who}");
                    return Err((Why::Unknown, format!("{who} is gone")));
                }
                Ok((self.port_name(at), Some(at)))
            }
            Place::Named(name) if self.is_queue(name.as_str()) => Ok((name.to_string(), None)),
            Place::Named(name) => {
                let _ = write!(what, " with {name}");
                let port = self.port(name.as_str()).map_err(|refusal| (Why::Unknown, refusal.to_string()))?;
                Ok((name.to_string(), Some(port)))
            }
            Place::TooLong => Err((Why::Unknown, "a name is too long".into())),
        }
    }

    fn judge_wire(&self, plan: &WirePlan, from: PortId, to: PortId, makes: bool) -> Judged<()> {
        let is_there = self.find_wire(from, to).is_some();
        let WirePlan { from: sender, to: receiver, .. } = plan;
        match (makes, is_there) {
            (true, true) => {
                return Err((Why::AlreadyWired, format!("{sender} is already wired to {receiver}")));
            }
            (false, false) => return Err((Why::NotWired, format!("{sender} is not wired to {receiver}"))),
            (false, true) => return Ok(()),
            (true, false) => {}
        }
        let shape = |(id, port): PortId| self.agents[&id].kind.ports[port].shape;
        let (out, into) = (shape(from), shape(to));
        let fits = match (out.direction, into.direction) {
            (Direction::Output, Direction::Input) => out.output == into.input,
            (Direction::Client, Direction::Service) => out.output == into.input && into.output == out.input,
            _ => false,
        };
        let name =
            |message: Option<&'static crate::MessageType>| message.map_or("nothing", |it| it.short_name());
        if fits {
            return Ok(());
        }
        let (sends, takes) = (name(out.output), name(into.input));
        Err((Why::Unfit, format!("{sender} sends {sends}, {receiver} takes {takes}")))
    }

    fn filter_of(&self, ask: &Ask) -> Judged<WireFilter> {
        let filter = ask.wiring.filter;
        let name = |id: AgentId| match self.by_id(id) {
            Some(known) => Ok(known.plan.name.clone()),
            None => Err((Why::Unknown, "the recipient in the filter is gone".to_owned())),
        };
        Ok(WireFilter {
            category: filter.category,
            least_priority: filter.least_priority,
            marker: filter.marker,
            recipient: filter.recipient.map(name).transpose()?,
            every: filter.every,
        })
    }

    /// What was asked through a port, and what was not because too much was under way; nothing for ports of messages.
    pub(super) fn asked_through(&self, port: PortId) -> Option<(u64, u64)> {
        self.asking.askers.get(&port).map(|asker| (asker.end.sent(), asker.end.turned_away()))
    }
}

pub(super) fn row_of((agent, port): PortId) -> EndRow {
    EndRow::Port(PortAt { agent, port: port as u16 })
}

/// A wire to or from a queue, by the place of the queue.
pub(super) fn row_of_queue(port: PortId, queue: usize, goes_in: bool) -> WireRow {
    let queue = EndRow::Queue(queue as u32);
    if goes_in { (row_of(port), queue) } else { (queue, row_of(port)) }
}

/// The ports of an agent, by the addresses of what stands behind them.
fn addresses(known: &Known) -> Vec<(usize, PortAt)> {
    let ends = known.ends.iter().enumerate().flat_map(|(port, ends)| {
        let input = ends.input.as_ref().map(|end| Arc::as_ptr(end).addr());
        let output = ends.output.as_ref().map(|end| Arc::as_ptr(end).addr());
        let at = PortAt { agent: known.id, port: port as u16 };
        [input, output].into_iter().flatten().map(move |address| (address, at))
    });
    ends.collect()
}

fn words_of(deed: Deed) -> &'static str {
    match deed {
        Deed::Subscribe | Deed::Connect => "wire",
        Deed::Unsubscribe | Deed::Disconnect => "unwire",
    }
}

/// A wire as the command line would ask for it.
fn in_words(plan: &WirePlan) -> String {
    let mut out = format!("wire {} {}", plan.from, plan.to);
    let mut push = |key: &str, value: Option<String>| {
        if let Some(value) = value {
            let _ = write!(out, " {key}={value}");
        }
    };
    let filter = &plan.filter;
    let least = filter.least_priority.0;
    push("depth", plan.depth.map(|depth| depth.to_string()));
    push("overload", plan.overload.map(|policy| policy.name().into()));
    push("every", (filter.every != 0).then(|| filter.every.to_string()));
    push("priority", (least != Priority::Low).then(|| least.name().into()));
    push("marker", filter.marker.map(|marker| marker.to_string()));
    push("category", filter.category.map(|category| category.name().into()));
    push("recipient", filter.recipient.clone());
    push("serving", plan.serving.map(|rank| rank.to_string()));
    out
}
