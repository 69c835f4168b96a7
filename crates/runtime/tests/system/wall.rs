//! On the wall clock. What is claimed is what arrives and who survives, never how fast.

use runtime::{
    Agent, Fault, Live, Observer, Options, Output, Plan, Request, Step, Verdict, WirePlan, registry,
};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use types::messages::Twist;
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
        let agent = plan.agent_mut(agent).unwrap();
        // On a machine that is busy with something else a step may last. It is not to be given up: what it took then would count nowhere.
        (agent.executor, agent.hang_after) = (Some(executor.into()), Some(Duration::secs(60)));
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

/// Steps of [`Busy`], and what keeps it busy.
static BUSY_STEPS: AtomicU64 = AtomicU64::new(0);
static WORK: AtomicU64 = AtomicU64::new(0);

/// Keeps its processor busy for some milliseconds.
#[derive(Agent)]
struct Busy {
    /// Nothing.
    out: Output<Twist>,
}

impl Agent for Busy {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        for n in 0..300_000 {
            WORK.fetch_add(n, Ordering::Relaxed);
        }
        BUSY_STEPS.fetch_add(1, Ordering::Relaxed);
        Ok(())
    }
}

/// Is at work until another has done three steps meanwhile.
#[derive(Agent)]
struct Patient {
    /// A message when a step is done.
    out: Output<Twist>,
}

impl Agent for Patient {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        let begun = BUSY_STEPS.load(Ordering::Relaxed);
        // Without a priority on either side the other may not come at all; then this goes on after some seconds.
        for _ in 0..3_000_000_000u64 {
            if BUSY_STEPS.load(Ordering::Relaxed) >= begun + 3 {
                break;
            }
            std::hint::spin_loop();
        }
        self.out.send(Twist::ZERO);
        Ok(())
    }
}

#[test]
fn what_higher_executors_take_from_a_step_is_not_its_execution_time() {
    let types = registry![Busy, Patient, Sink];
    let mut plan = Plan::new("pre-empted");
    plan.add::<Busy>("busy", Default::default());
    let patient = plan.add::<Patient>("patient", Default::default());
    let end = plan.add::<Sink>("sink", sink("pre-empted"));
    plan.wire(&patient.out, &end.count);
    plan.on("sink", "count");
    plan.every("busy", Duration::millis(10));
    plan.every("patient", Duration::millis(100));
    for (agent, priority) in [("busy", 42), ("patient", 41)] {
        let mut executor = runtime::ExecutorPlan::new(agent, Some(priority));
        executor.cpus = vec![0];
        plan.executors.push(executor);
        let agent = plan.agent_mut(agent).unwrap();
        agent.executor = Some(agent.name.clone());
        agent.hang_after = Some(Duration::secs(15));
    }
    let report = Live::new(&plan, &types, until("pre-empted", "", 5)).unwrap().run().unwrap();
    let [busy, patient, _] = &report.view.agents[..] else { panic!("{report:#?}") };
    if busy.granted != "fifo 42" || patient.granted != "fifo 41" {
        println!("skipped: asked for fifo, granted {} and {}", busy.granted, patient.granted);
        return;
    }
    // From the release to the end, less from the release to the beginning: the steps as they looked from outside.
    let sum = |figure: &runtime::Figure| figure.mean * figure.n as f64;
    let (elapsed, own) = (sum(&patient.response) - sum(&patient.jitter), sum(&patient.exec));
    // In each step of the lower one lie three whole steps of the higher one, and those are not its own.
    let taken = 3.0 * patient.exec.n as f64 * busy.exec.min;
    assert!(own <= elapsed - taken, "{own} of {elapsed}, and {taken} were another's");
    let counts = patient.counts;
    assert!(counts.checked > 0 && counts.checked + counts.left_out <= counts.releases, "{counts:?}");
    assert_eq!(patient.exec.n + counts.left_out, counts.releases);
}
