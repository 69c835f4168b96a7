//! Resource managers: they are told how things are, and what they set is done.

use core::sync::atomic::{AtomicU64, Ordering};
use std::sync::Arc;

use types::{AgentId, Duration, Time};

use super::{Admission, Fabric, Router, Said};
use crate::census::{Census, HostReading, Resident, SharedHost};
use crate::plan::{AgentPlan, Plan};
use crate::port::{Asked, ManagerEnd};
use crate::request::Refusal;
use crate::timetable::{Assumed, timetable};

/// The span of the windows of what steps took: a load that has gone is forgotten after twice this. Slower agents than two a second are seen less
/// often than that, and what they took last is remembered elsewhere.
const SPAN: Duration = Duration::millis(500);

/// Who manages.
#[derive(Default)]
pub(super) struct Managing {
    ends: Vec<(AgentId, Arc<ManagerEnd>)>,
    bell: Arc<AtomicU64>,
    heard: u64,
    host: Option<SharedHost>,
    /// Why the last request of each was refused, until it has been told.
    refused: Vec<(AgentId, Refusal)>,
}

impl Router {
    /// Where the load of the computer is read.
    pub(crate) fn set_host(&mut self, host: SharedHost) {
        self.managing.host = Some(host);
    }

    /// Whether any agent manages.
    pub(crate) fn has_manager(&self) -> bool {
        !self.managing.ends.is_empty()
    }

    /// Takes in the manager's end of an agent, where it has one.
    pub(super) fn acquaint_manager(&mut self, id: AgentId) {
        let Some(known) = self.agents.get(&id) else { return };
        let Some(end) = known.ends.iter().find_map(|ends| ends.manager.clone()) else { return };
        let Managing { ends, bell, host, .. } = &mut self.managing;
        end.acquaint(bell, host.clone());
        ends.retain(|(agent, _)| *agent != id);
        ends.push((id, end));
    }

    /// The agent is gone.
    pub(super) fn dismiss_manager(&mut self, id: AgentId) {
        self.managing.ends.retain(|(agent, _)| *agent != id);
    }

    /// Whether a manager has asked for something.
    pub(crate) fn is_managed(&self) -> bool {
        // Pairs with the release where a manager asks.
        self.managing.bell.load(Ordering::Acquire) != self.managing.heard
    }

    /// Does what managers have asked for until now, and tells them how things are then. `host` is what virtual processors tell.
    pub(crate) fn manage(
        &mut self,
        now: Time,
        host: Option<&mut dyn FnMut() -> HostReading>,
        fabric: &mut dyn Fabric,
    ) -> Vec<Said> {
        self.managing.heard = self.managing.bell.load(Ordering::Acquire);
        let mut said = Vec::new();
        let mut told = None;
        let mut host = host;
        for (id, end) in self.managing.ends.clone() {
            let (asked, wants) = end.take();
            for Asked { given, cause } in asked {
                said.extend(self.set_all_given(id, given, &cause, now, fabric));
            }
            if wants {
                let census = self.census(id, now);
                if told.is_none() {
                    told = host.as_mut().map(|host| host());
                }
                end.tell(census, told.clone());
            }
        }
        said
    }

    fn set_all_given(
        &mut self,
        id: AgentId,
        given: Vec<crate::census::Given>,
        cause: &str,
        now: Time,
        fabric: &mut dyn Fabric,
    ) -> Option<Said> {
        let before: Vec<String> = given.iter().map(|given| self.setting_of(&given.agent)).collect();
        let names: Vec<String> = given.iter().map(|given| given.agent.clone()).collect();
        let done = self.apply_given(&given, now, fabric);
        let agent = self.by_id(id)?.plan.name.clone();
        if let Err(refusal) = done {
            let what = format!("managed: refused: {refusal} ({cause})");
            self.managing.refused.retain(|(known, _)| *known != id);
            self.managing.refused.push((id, refusal));
            return Some(Said { agent, what });
        }
        let changes = names.iter().zip(before).filter_map(|(name, before)| {
            let after = self.setting_of(name);
            (after != before).then(|| format!("{name}: {before} -> {after}"))
        });
        let changes: Vec<String> = changes.collect();
        let what = format!("managed: {} ({cause})", changes.join("; "));
        (!changes.is_empty()).then_some(Said { agent, what })
    }

    /// What an agent may use at the moment, in words.
    fn setting_of(&self, name: &str) -> String {
        let Ok(known) = self.known(name) else { return "gone".into() };
        let mut words = Vec::new();
        words.extend(known.plan.period.map(|period| format!("period {period}")));
        if known.plan.min_gap > Duration::ZERO {
            words.push(format!("gap {}", known.plan.min_gap));
        }
        let method = known.kind.methods.get(usize::from(known.timing.means.method));
        words.extend(method.map(|method| format!("method {}", method.name)));
        words.extend(known.plan.budget.map(|budget| format!("budget {budget}")));
        if known.plan.giving.is_suspended {
            words.push("suspended".into());
        }
        if words.is_empty() { "as usual".into() } else { words.join(", ") }
    }

    fn census(&mut self, id: AgentId, now: Time) -> Census {
        let admission = self.admission.clone().unwrap_or_default();
        let Admission { processors, overhead, pace, .. } = admission;
        let (agents, queues, wires) = self.to_plan();
        let executors = self.executors.iter().map(|executor| executor.plan.clone()).collect();
        let plan = Plan { agents, queues, wires, executors, ..Plan::default() };
        let registry = &self.registry;
        let cost = |agent: &AgentPlan| {
            let methods = registry.get(&agent.kind).map_or(&[][..], |kind| kind.methods);
            agent.cost_of_step(methods).unwrap_or(Duration::ZERO)
        };
        let pace = |port: &str| pace.get(port).copied();
        let assumed = Assumed { cost: &cost, processors, overhead, pace: &pace };
        let table = timetable(&plan, registry, &assumed);
        let found = table.system.analyse().unwrap_or_default();
        let gap = |at: usize, plan: &AgentPlan| {
            let streams = found.get(at).map(|found| &found.streams[..]).unwrap_or_default();
            // What it asks for itself goes on as it is.
            let by_others = streams.iter().filter(|stream| stream.after.is_some());
            let period = by_others.map(|stream| stream.period).min()?;
            plan.period.is_none().then(|| Duration(period.to_integer() as i64))
        };
        let order: Vec<AgentId> = self.in_order().iter().map(|known| known.id).collect();
        let residents = plan.agents.iter().zip(order).enumerate().filter_map(|(at, (nominal, id))| {
            let known = self.agents.get_mut(&id)?;
            let recent = known.window.look(&known.stats, now, SPAN);
            let view = self.view_agent(&self.agents[&id]);
            let known = &self.agents[&id];
            Some(Resident {
                plan: AgentPlan { params: Default::default(), ..known.plan.clone() },
                nominal: AgentPlan { params: Default::default(), ..nominal.clone() },
                methods: known.kind.methods,
                method: usize::from(known.timing.means.method),
                is_anytime: known.kind.is_anytime,
                gap: gap(at, nominal),
                is_real_time: self.executors[known.executor].plan.level().is_some(),
                is_robot: self.robots.contains(&known.plan.name),
                state: known.state,
                counts: view.counts,
                used: known.stats.used(),
                recent,
            })
        });
        let residents = residents.collect();
        let place = self.managing.refused.iter().position(|(known, _)| *known == id);
        let refused = place.map(|place| self.managing.refused.remove(place).1);
        let percent = self.measures.unwrap_or(super::AS_PLAYED);
        let executors = table.executors;
        Census { now, system: table.system, executors, residents, overhead, percent, refused }
    }
}
