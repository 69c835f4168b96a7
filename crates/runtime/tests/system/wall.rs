//! On the wall clock. What is claimed is what arrives and who survives, never how fast.

use runtime::{Live, Observer, Options, Request, Verdict, WirePlan};
use std::sync::{Arc, Mutex};
use types::{Duration, Time};

use crate::{Sink, Source, SourceParams, chain, heard, options, sink, types};

/// Ends the run when the test has heard enough, or after ten seconds, when something is wrong.
struct Enough {
    test: &'static str,
    wanted: usize,
    begun: Option<Time>,
}

impl Observer for Enough {
    fn every(&self) -> Duration {
        Duration::millis(10)
    }
    fn observe(&mut self, now: Time, _: &[runtime::Incident]) -> Verdict {
        let begun = *self.begun.get_or_insert(now);
        if heard(self.test).len() >= self.wanted || now - begun > Duration::secs(10) {
            return Verdict::End("enough".into());
        }
        Verdict::GoOn
    }
}

fn until(test: &'static str, wanted: usize) -> Options {
    Options { limit: None, observer: Box::new(Enough { test, wanted, begun: None }), ..options(0) }
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
    let report = Live::new(&plan, &types(), until("wall-chain", 200)).unwrap().run().unwrap();
    let numbers = numbers("wall-chain");
    assert!(numbers.len() >= 200, "{report:#?}");
    assert_eq!(numbers, (1..=numbers.len() as i64).collect::<Vec<_>>());
    assert!(
        report.view.agents.iter().all(|agent| !agent.granted.is_empty() && agent.granted != "simulated"),
        "{:?}",
        report.view.agents
    );
}

#[test]
fn a_panic_is_survived() {
    let mut plan = chain("wall-panic");
    plan.requests = vec![crate::at(100, "fault relay panic")];
    let report = Live::new(&plan, &types(), until("wall-panic", 60)).unwrap().run().unwrap();
    let numbers = numbers("wall-panic");
    assert!(numbers.len() >= 60, "{:?}", report.incidents);
    assert_eq!(
        numbers,
        (1..=numbers.len() as i64).collect::<Vec<_>>(),
        "nothing is lost in a mailbox of sixteen"
    );
    assert!(
        report.incidents.iter().any(|incident| incident.what.contains("asked to panic")),
        "{:?}",
        report.incidents
    );
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
    let report = Live::new(&plan, &types(), until("wall-hang", 100)).unwrap().run().unwrap();
    let relay = report.view.agents.iter().find(|agent| agent.name == "relay").unwrap();
    assert_eq!((relay.counts.hangs, relay.state.name()), (1, "running"), "{:?}", report.incidents);
    assert!(numbers("wall-hang").len() >= 100, "{:?}", report.incidents);
    let other = numbers("wall-hang-other");
    assert_eq!(other, (1..=other.len() as i64).collect::<Vec<_>>(), "the bystander loses nothing");
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
