//! A step that lasts while something is asked: what is refused is never done.

use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use runtime::{Agent, Fault, Input, Live, Options, Output, Request, Step, WirePlan, registry};
use types::Duration;
use types::messages::Twist;

use crate::{Relay, Sink, Source, chain, options, parse, sink};

/// Whether the agent that lasts may return, and whether it is in its step.
static GO_ON: AtomicBool = AtomicBool::new(false);
static IN_STEP: AtomicBool = AtomicBool::new(false);
/// What it has taken.
static TAKEN: AtomicU64 = AtomicU64::new(0);

/// Stays in its first step until it is told to go on.
#[derive(Agent)]
struct Lasting {
    /// What comes.
    count: Input<Twist>,
    /// Nothing.
    out: Output<Twist>,
}

impl Agent for Lasting {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        IN_STEP.store(true, Ordering::Release);
        while !GO_ON.load(Ordering::Acquire) {
            std::thread::yield_now();
        }
        while self.count.take().is_some() {
            TAKEN.fetch_add(1, Ordering::Relaxed);
        }
        Ok(())
    }
}

#[test]
fn what_an_executor_does_not_answer_to_is_refused_whole_and_never_done_later() {
    let types = registry![Source, Relay, Sink, Lasting];
    let mut plan = chain("stuck");
    plan.add::<Lasting>("lasting", Default::default());
    plan.on("lasting", "count");
    plan.every("lasting", Duration::millis(10));
    plan.add::<Sink>("other", sink("stuck-other"));
    plan.on("other", "count");
    for agent in &mut plan.agents {
        agent.executor = Some("control".into());
        agent.hang_after = Some(Duration::secs(60));
    }
    plan.agent_mut("lasting").unwrap().executor = Some("ordinary".into());
    let live = Live::new(&plan, &types, Options { limit: None, ..options(0) }).unwrap();
    let control = live.control();
    let asker = std::thread::Builder::new().name("asker".into()).spawn(move || {
        let ask = |words: &str| {
            let words: Vec<String> = words.split(' ').map(str::to_owned).collect();
            control.request(parse(&words).unwrap()).map_err(|refusal| refusal.what)
        };
        while !IN_STEP.load(Ordering::Acquire) {
            std::thread::yield_now();
        }
        let busy = Err("the executor does not answer".to_owned());
        // From one that answers to one that does not, the other way round, and with one that could be done before it.
        let into = ask("wire source.out lasting.count");
        let out = ask("wire lasting.out other.count");
        let removed = ask("remove lasting");
        let all = control.request(Request::All(vec![
            Request::Wire(WirePlan::new("source.out", "other.count")),
            Request::Wire(WirePlan::new("source.out", "lasting.count")),
        ]));
        let off = ask("fault lasting off");
        let refused = [into, out, removed, all.map_err(|refusal| refusal.what), off];
        let meanwhile = ask("wire source.out other.count");
        let between = control.view().unwrap();
        GO_ON.store(true, Ordering::Release);
        // Now it answers again, and comes upon what was taken back.
        let mut after = ask("wire source.out lasting.count");
        while after.is_err() {
            after = ask("wire source.out lasting.count");
        }
        let view = control.view().unwrap();
        // It runs: the fault that was refused is not there. As long as it takes; something is wrong after half a minute.
        for _ in 0..30_000 {
            if TAKEN.load(Ordering::Relaxed) > 3 {
                break;
            }
            std::thread::park_timeout(std::time::Duration::from_millis(1));
        }
        control.request(Request::Quit).unwrap();
        (refused.iter().all(|said| *said == busy), refused, meanwhile, between, view)
    });
    live.run().unwrap();
    let (all_refused, refused, meanwhile, between, view) = asker.unwrap().join().unwrap();
    assert!(all_refused, "{refused:?}");
    assert_eq!(meanwhile, Ok(()), "who answers is changed all the same");
    let wires = |view: &runtime::SystemView| {
        view.wires.iter().map(|wire| format!("{} {}", wire.from, wire.to)).collect::<Vec<_>>()
    };
    let chain = ["source.out relay.from", "relay.to sink.count", "source.out other.count"];
    assert_eq!(wires(&between), chain);
    assert_eq!(wires(&view), [&chain[..], &["source.out lasting.count"]].concat());
    assert_eq!(view.agents.len(), 5);
    assert!(TAKEN.load(Ordering::Relaxed) > 3, "what was refused was done later");
}

/// Whether the one that lasts too long may return, and whether it is gone after it did.
static RETURN: AtomicBool = AtomicBool::new(false);
static GONE: AtomicBool = AtomicBool::new(false);
/// Whether the other is in its step, and whether it may leave it in the end.
static OTHER_IN_STEP: AtomicBool = AtomicBool::new(false);
static OTHER_RETURN: AtomicBool = AtomicBool::new(false);

/// Lasts too long, and returns when nobody reckons with it any more.
#[derive(Agent)]
struct Late {
    /// Nothing.
    out: Output<Twist>,
    lasted: bool,
}

impl Agent for Late {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while !RETURN.load(Ordering::Acquire) {
            self.lasted = true;
            std::thread::yield_now();
        }
        Ok(())
    }
}

impl Drop for Late {
    fn drop(&mut self) {
        // Instances that were only made ahead go, too.
        if self.lasted {
            GONE.store(true, Ordering::Release);
        }
    }
}

/// Begins its step when the other is lost, and does not return from it either.
#[derive(Agent)]
struct Then {
    /// Nothing.
    out: Output<Twist>,
    steps: u64,
}

impl Agent for Then {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        if step.agent_named("late").is_some() && !OTHER_IN_STEP.swap(true, Ordering::AcqRel) {
            while !OTHER_RETURN.load(Ordering::Acquire) {
                std::thread::yield_now();
            }
        }
        self.steps += 1;
        Ok(())
    }
}

#[test]
fn a_step_that_returns_after_it_was_given_up_does_not_hide_the_step_of_another() {
    let types = registry![Late, Then];
    let mut plan = runtime::Plan::new("hidden");
    plan.add::<Late>("late", Default::default());
    plan.add::<Then>("then", Default::default());
    for (name, hang_after) in [("late", 100), ("then", 500)] {
        plan.every(name, Duration::millis(10));
        let agent = plan.agent_mut(name).unwrap();
        (agent.executor, agent.hang_after) = (Some("control".into()), Some(Duration::millis(hang_after)));
    }
    let live = Live::new(&plan, &types, Options { limit: None, ..options(0) }).unwrap();
    let control = live.control();
    let asker = std::thread::Builder::new().name("asker".into()).spawn(move || {
        // Half a minute in which something would be wrong.
        let wait = |what: &dyn Fn() -> bool| {
            (0..30_000).any(|_| {
                std::thread::park_timeout(std::time::Duration::from_millis(1));
                what()
            })
        };
        let began = wait(&|| OTHER_IN_STEP.load(Ordering::Acquire));
        RETURN.store(true, Ordering::Release);
        let gone = wait(&|| GONE.load(Ordering::Acquire));
        let hangs = |name: &str| {
            let view = control.view().unwrap();
            view.agents.iter().find(|agent| agent.name == name).unwrap().counts.hangs
        };
        let found = wait(&|| hangs("then") == 1);
        let counted = hangs("late");
        OTHER_RETURN.store(true, Ordering::Release);
        control.request(Request::Quit).unwrap();
        (began, gone, found, counted)
    });
    let report = live.run().unwrap();
    let (began, gone, found, counted) = asker.unwrap().join().unwrap();
    assert!(began && gone, "{began} {gone}");
    assert!(found, "nobody saw that it does not return: {:?}", report.incidents);
    assert_eq!(counted, 1);
}
