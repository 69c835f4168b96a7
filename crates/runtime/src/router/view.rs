//! What a running system says of itself.

use core::sync::atomic::Ordering::Relaxed;

use types::{Duration, Time};

use super::{Known, Router, Wire};
use crate::allocations;
use crate::plan::ExecutorPlan;
use crate::request::{AgentView, Counts, ExecutorView, PortView, SystemView, WireTotals, WireView};

/// The scheduling that an executor asks for when it runs this agent.
fn asked_for(executor: &ExecutorPlan, known: &Known) -> String {
    match (known.timing.budget, executor.priority) {
        (Some(budget), _) if executor.is_by_deadline() => budget.to_string(),
        (_, Some(priority)) => format!("fifo {priority}"),
        (_, None) => "ordinary".into(),
    }
}

impl Router {
    /// What there is, as people ask for it.
    pub(crate) fn view(&self, now: Time) -> SystemView {
        let agents = self.in_order().into_iter().map(|known| self.view_agent(known)).collect();
        let wires = self.wires.values().filter(|wire| !wire.is_answer).map(|wire| self.view_wire(wire));
        let executors = self.executors.iter().map(|executor| ExecutorView {
            name: executor.plan.name.clone(),
            real_time: executor.plan.level().is_some(),
            allocations: executor.link.running.allocations.load(Relaxed),
        });
        SystemView {
            name: self.name.clone(),
            now,
            executors: executors.collect(),
            allocations_watched: allocations::are_watched(),
            agents,
            queues: self.view_queues(),
            wires: wires.chain(self.view_queue_wires()).collect(),
            past: self.past,
        }
    }

    pub(super) fn view_agent(&self, known: &Known) -> AgentView {
        let stats = &known.stats;
        let executor = &self.executors[known.executor];
        let ports =
            known.kind.ports.iter().zip(&known.ends).enumerate().map(|(place, (port, end))| PortView {
                name: port.name,
                doc: port.doc,
                direction: port.shape.direction,
                message: port.shape.input.or(port.shape.output).map_or("", |message| message.short_name()),
                processing: port.options.processing,
                sent: end.output.as_ref().map_or(0, |output| output.sent()),
                asked: self.asked_through((known.id, place)),
            });
        AgentView {
            id: known.id,
            name: known.plan.name.clone(),
            kind: known.kind.kind,
            doc: known.kind.doc,
            executor: executor.plan.name.clone(),
            asked: asked_for(&executor.plan, known),
            granted: executor.granted.clone(),
            state: known.state,
            last_death: known.last_death.clone(),
            period: (known.timing.period > Duration::ZERO).then_some(known.timing.period),
            deadline: known.timing.deadline,
            method: known.kind.methods.get(usize::from(known.timing.means.method)).map(|method| method.name),
            budget: (known.timing.means.budget > Duration::ZERO).then_some(known.timing.means.budget),
            is_suspended: !known.timing.means.is_active,
            params: known.params.clone(),
            fields: known.kind.params.clone(),
            ports: ports.collect(),
            counts: Counts {
                releases: stats.releases.load(Relaxed),
                missed: stats.missed.load(Relaxed),
                stalled: stats.stalled.load(Relaxed),
                skipped: stats.skipped.load(Relaxed),
                faults: stats.faults.load(Relaxed),
                panics: stats.panics.load(Relaxed),
                hangs: stats.hangs.load(Relaxed),
                restarts: stats.restarts.load(Relaxed),
                refinements: stats.refinements.load(Relaxed),
                overruns: stats.overruns.load(Relaxed),
                quality_lost: stats.quality_lost.load(Relaxed) as f64 / f64::from(u8::MAX),
                left_out: stats.left_out.load(Relaxed),
                checked: stats.checked.load(Relaxed),
                disagreed: stats.disagreed.load(Relaxed),
                allocations: stats.allocations.load(Relaxed),
            },
            exec: stats.exec(),
            jitter: stats.jitter.figure(),
            response: stats.response(),
            exec_steps: stats.exec_steps(),
            jitter_steps: stats.jitter.steps(),
        }
    }

    fn view_wire(&self, wire: &Wire) -> WireView {
        let plan = self.plan_of(wire);
        let message = self
            .by_id(wire.from.0)
            .and_then(|known| known.ends[wire.from.1].output.as_ref())
            .map_or("", |end| end.message_type().short_name());
        let mut totals = WireTotals::of(&wire.counts);
        totals += wire.past;
        WireView {
            from: plan.from,
            to: plan.to,
            message,
            depth: wire.depth,
            overload: wire.overload,
            filter: plan.filter,
            sent: totals.sent,
            replaced: totals.replaced,
            dropped: totals.dropped,
            refused: totals.refused,
            taken: totals.taken,
            expired: totals.expired,
        }
    }
}
