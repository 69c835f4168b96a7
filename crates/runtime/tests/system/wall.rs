//! On the wall clock. What is claimed is what arrives and who survives, never how fast.

use runtime::{Live, Observer, Options, Request, Verdict, WirePlan};
use std::sync::{Arc, Mutex};
use types::{Duration, Time};

use crate::{Sink, Source, SourceParams, chain, heard, options, sink, types};

/// Ends the run when an incident was seen and the test has heard so many messages after it, or after twenty seconds, when
/// something is wrong. The machine may be busy with other things, so nothing is said of how long it takes.
struct Enough {
    test: &'static str,
    incident: &'static str,
    wanted: usize,
    heard_before: Option<usize>,
    begun: Option<Time>,
}

impl Observer for Enough {
    fn every(&self) -> Duration {
        Duration::millis(10)
    }
    fn observe(&mut self, now: Time, incidents: &[runtime::Incident]) -> Verdict {
        let begun = *self.begun.get_or_insert(now);
        let heard = heard(self.test).len();
        if self.incident.is_empty() || incidents.iter().any(|incident| incident.what.contains(self.incident))
        {
            self.heard_before.get_or_insert(heard);
        }
        let enough = self.heard_before.is_some_and(|before| heard >= before + self.wanted);
        if enough || now - begun > Duration::secs(20) {
            return Verdict::End("enough".into());
        }
        Verdict::GoOn
    }
}

fn until(test: &'static str, incident: &'static str, wanted: usize) -> Options {
    let observer = Box::new(Enough { test, incident, wanted, heard_before: None, begun: None });
    Options { limit: None, observer, ..options(0) }
}

/// Each message arrives at most once and in order, and what did not arrive was counted where it was given back.
fn accounted(report: &runtime::Report, test: &str) {
    let numbers = numbers(test);
    assert!(numbers.windows(2).all(|pair| pair[0] < pair[1]), "doubled or out of order: {numbers:?}");
    let wire = |from: &str| report.view.wires.iter().find(|wire| wire.from == from).unwrap();
    let (first, last) = (wire("source.out"), wire("relay.to"));
    assert_eq!(last.taken, numbers.len() as u64);
    let missing = numbers.last().copied().unwrap_or(0) as u64 - numbers.len() as u64;
    assert!(missing <= first.refused + last.refused, "{missing} lost in silence: {:#?}", report.view.wires);
}

fn numbers(test: &str) -> Vec<i64> {
    heard(test).iter().map(|(_, twist)| twist.linear as i64).collect()
}

#[test]
fn a_chain_across_executors_delivers_each_message_once_in_order() {
    let mut plan = chain("wall-chain");
    for (agent, executor) in [("source", "reflex"), ("relay", "control"), ("sink", "ordinary")] {
        plan.agent_mut(agent).unwrap().executor = Some(executor.into());
    }
    plan.every("source", Duration::millis(2));
    let report = Live::new(&plan, &types(), until("wall-chain", "", 200)).unwrap().run().unwrap();
    assert!(numbers("wall-chain").len() >= 200, "{report:#?}");
    accounted(&report, "wall-chain");
    let granted = |agent: &runtime::AgentView| !agent.granted.is_empty() && agent.granted != "simulated";
    assert!(report.view.agents.iter().all(granted), "{:?}", report.view.agents);
}

#[test]
fn a_panic_is_survived() {
    let mut plan = chain("wall-panic");
    plan.requests = vec![crate::at(100, "fault relay panic")];
    let report = Live::new(&plan, &types(), until("wall-panic", "started again", 30)).unwrap().run().unwrap();
    accounted(&report, "wall-panic");
    let said = |part: &str| report.incidents.iter().any(|incident| incident.what.contains(part));
    assert!(said("asked to panic") && said("started again"), "{:?}", report.incidents);
}

#[test]
fn a_step_that_never_returns_costs_only_its_own_agent() {
    let mut plan = chain("wall-hang");
    // A bystander in the same executor as the agent that hangs.
    let source = plan.add::<Source>("other", SourceParams::default());
    let end = plan.add::<Sink>("other-sink", sink("wall-hang-other"));
    plan.wire(&source.out, &end.count);
    plan.every("other", Duration::millis(10));
    plan.on("other-sink", "count");
    for agent in &mut plan.agents {
        agent.executor = Some("control".into());
    }
    plan.requests = vec![crate::at(100, "fault relay hang")];
    let report = Live::new(&plan, &types(), until("wall-hang", "started again", 50)).unwrap().run().unwrap();
    let relay = report.view.agents.iter().find(|agent| agent.name == "relay").unwrap();
    assert_eq!((relay.counts.hangs, relay.state.name()), (1, "running"), "{:?}", report.incidents);
    let (first, other) = (numbers("wall-hang"), numbers("wall-hang-other"));
    assert!(first.len() > 50 && other.len() > 50, "{} {}", first.len(), other.len());
    let whole: Vec<i64> = (1..=other.len() as i64).collect();
    assert_eq!(other, whole, "the bystander, who stands in the same executor, loses nothing");
}

#[test]
fn requests_change_a_running_system_and_are_refused_with_reasons() {
    let live = Live::new(&chain("wall-requests"), &types(), Options { limit: None, ..options(0) }).unwrap();
    let control = live.control();
    let refused = Arc::<Mutex<Vec<String>>>::default();
    let said = refused.clone();
    let other = std::thread::Builder::new().name("asker".into()).spawn(move || {
        let say = |result: Result<(), runtime::Refusal>| {
            said.lock().unwrap().push(result.err().map_or("ok".into(), |e| e.what))
        };
        say(control.request(Request::Unwire { from: "relay.to".into(), to: "sink.count".into() }));
        say(control.request(Request::Wire(WirePlan::new("source.out", "sink.count"))));
        say(control.request(Request::Remove("relay".into())));
        say(control.request(Request::Remove("relay".into())));
        let view = control.view().unwrap();
        assert_eq!((view.agents.len(), view.wires.len()), (2, 1));
        say(control.request(Request::Quit));
    });
    let report = live.run().unwrap();
    other.unwrap().join().unwrap();
    assert_eq!(report.ended, "asked to quit");
    assert_eq!(*refused.lock().unwrap(), ["ok", "ok", "ok", "there is no agent \"relay\"", "ok"]);
}
