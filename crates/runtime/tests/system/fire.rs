//! Changes under fire: a system is rewired ten thousand times while messages go through it.
//!
//! It runs in a process of its own, so that memory and threads are those of the system alone.

use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::process::Command;

use runtime::{
    Agent, AgentPlan, Fault, Input, Live, Observer, Options, Output, Plan, Registry, Request, Step, Verdict,
    WirePlan, registry,
};
use types::chance::Stream;
use types::messages::Twist;
use types::{Duration, Time};

use crate::{Source, SourceParams, options};

const CHANGES: u64 = 10_000;
/// After so many, everything that is made once is there.
const WARM: u64 = 2_000;
/// A machine that is busy with other things may let a step wait for a long time.
const PATIENCE: Duration = Duration::secs(30);
/// The agents that come and go.
const GUESTS: u64 = 8;

/// The number of the last message on the wire that nobody touches, and how many came in another order.
static LAST: AtomicU64 = AtomicU64::new(0);
static OUT_OF_ORDER: AtomicU64 = AtomicU64::new(0);

/// Stands at the end of the wire that nobody touches.
#[derive(Agent)]
struct Host {
    /// Numbered messages.
    count: Input<Twist>,
}

impl Agent for Host {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while let Some(twist) = self.count.take() {
            let expected = LAST.fetch_add(1, Ordering::Relaxed) + 1;
            OUT_OF_ORDER.fetch_add(u64::from(twist.linear as u64 != expected), Ordering::Relaxed);
        }
        Ok(())
    }
}

/// Comes and goes. What it hears grows, however it is wired.
#[derive(Agent)]
struct Guest {
    /// Numbered messages.
    count: Input<Twist>,
    /// The same.
    out: Output<Twist>,
    last: f64,
}

impl Agent for Guest {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while let Some(twist) = self.count.take() {
            OUT_OF_ORDER.fetch_add(u64::from(twist.linear <= self.last), Ordering::Relaxed);
            self.last = twist.linear;
        }
        self.out.send(Twist::new(self.last, 0.0));
        Ok(())
    }
}

fn types() -> Registry {
    registry![Source, Host, Guest]
}

/// A source and a host on executors of their own.
fn plan() -> Plan {
    let mut plan = Plan::new("fire");
    plan.add::<Source>("source", SourceParams::default());
    plan.add::<Host>("host", Default::default());
    let mut wire = WirePlan::new("source.out", "host.count");
    wire.depth = Some(4096);
    plan.wires.push(wire);
    plan.every("source", Duration::millis(1));
    plan.on("host", "count");
    for (agent, executor) in [("source", "reflex"), ("host", "control")] {
        let agent = plan.agent_mut(agent).unwrap();
        (agent.executor, agent.hang_after) = (Some(executor.into()), Some(PATIENCE));
    }
    plan
}

fn guest(name: &str, place: usize) -> AgentPlan {
    let mut plan = AgentPlan { name: name.into(), kind: "guest".into(), ..AgentPlan::default() };
    plan.executor = Some(["reflex", "control", "vision"][place % 3].into());
    plan.on = vec!["count".into()];
    (plan.deadline, plan.hang_after) = (Some(Duration::millis(10)), Some(PATIENCE));
    plan
}

struct Until(std::sync::Arc<AtomicBool>);

impl Observer for Until {
    fn every(&self) -> Duration {
        Duration::millis(10)
    }
    fn observe(&mut self, _: Time, _: &[runtime::Incident]) -> Verdict {
        if self.0.load(Ordering::Acquire) { Verdict::End("all was asked".into()) } else { Verdict::GoOn }
    }
}

/// Bytes in use and threads, as the kernel and the allocator know them.
fn in_use() -> (i64, usize) {
    let threads = std::fs::read_dir("/proc/self/task").unwrap().count();
    (crate::memory::BYTES.load(Ordering::Relaxed), threads)
}

/// One request of its own number, and whether it must be refused.
fn request(number: u64, here: &mut [bool; GUESTS as usize]) -> (Request, Option<bool>) {
    let draws = Stream::new(1, "fire").sample(number);
    let which = draws.index(0, GUESTS as usize);
    let name = format!("guest{which}");
    let input = format!("{name}.count");
    let wire = || Request::Wire(WirePlan::new("source.out", &input));
    if !here[which] {
        here[which] = true;
        return (Request::Add(guest(&name, which)), Some(false));
    }
    match draws.index(1, 8) {
        0 => {
            here[which] = false;
            (Request::Remove(name), Some(false))
        }
        1 => (Request::Restart(name), Some(false)),
        2 => {
            (Request::Replace { agent: name, kind: "guest".into(), params: Default::default() }, Some(false))
        }
        3 => {
            // The first could be done; the second cannot, so neither is.
            let wrong = Request::Wire(WirePlan::new("source.out", "host.nothing"));
            let all = Request::All(vec![Request::Add(guest("late", which)), wrong]);
            (all, Some(true))
        }
        // Whether it is wired by now is not kept here.
        4 | 5 => (wire(), None),
        _ => (Request::Unwire { from: "source.out".into(), to: input }, None),
    }
}

const CHILD: &str = "SINEW_TEST_UNDER_FIRE";

#[test]
fn ten_thousand_changes_lose_no_message_and_no_memory() {
    if std::env::var_os(CHILD).is_some() {
        return under_fire();
    }
    let mut child = Command::new(std::env::current_exe().unwrap());
    let name = "fire::ten_thousand_changes_lose_no_message_and_no_memory";
    let done = child.args(["--exact", name, "--nocapture"]).env(CHILD, "1").output().unwrap();
    let said = String::from_utf8_lossy(&done.stdout) + String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success() && said.contains("1 passed"), "{said}");
}

fn under_fire() {
    let done = std::sync::Arc::<AtomicBool>::default();
    let options = Options { limit: None, observer: Box::new(Until(done.clone())), ..options(0) };
    let live = Live::new(&plan(), &types(), options).unwrap();
    let control = live.control();
    let asker = std::thread::Builder::new().name("asker".into()).spawn(move || {
        let mut here = [false; GUESTS as usize];
        let leave = |here: &mut [bool; GUESTS as usize]| {
            for (which, _) in here.iter().enumerate().filter(|(_, here)| **here) {
                control.request(Request::Remove(format!("guest{which}"))).unwrap();
            }
            *here = Default::default();
            in_use()
        };
        let mut before = None;
        for number in 0..WARM + CHANGES {
            if number == WARM {
                before = Some(leave(&mut here));
            }
            let (request, must_be_refused) = request(number, &mut here);
            let said = format!("{request:?}");
            let refused = control.request(request).err();
            if let Some(expected) = must_be_refused {
                assert_eq!(refused.is_some(), expected, "{said}: {refused:?}");
            }
        }
        let after = leave(&mut here);
        let view = control.view().unwrap();
        done.store(true, Ordering::Release);
        (before.unwrap(), after, view)
    });
    let report = live.run().unwrap();
    let (before, after, view) = asker.unwrap().join().unwrap();
    assert_eq!(
        (view.agents.len(), view.wires.len()),
        (2, 1),
        "nothing is left of what was refused or removed"
    );
    let wire = &report.view.wires[0];
    // What was sent when the receiver had stopped is still on the wire; that none before is missing, the numbers show.
    assert!((wire.dropped, wire.refused) == (0, 0) && wire.sent >= wire.taken, "{wire:?}");
    assert!(wire.taken > 100, "{wire:?}");
    assert_eq!((OUT_OF_ORDER.load(Ordering::Relaxed), LAST.load(Ordering::Relaxed)), (0, wire.taken));
    assert_eq!(after.1, before.1, "threads");
    // Nobody who came and went has left anything; what the log and the askers have under way comes and goes.
    assert!(after.0 - before.0 < 32 * 1024, "{} bytes more are in use", after.0 - before.0);
    assert!(report.incidents.is_empty(), "{:?}", report.incidents);
    let took: u64 = report.view.executors.iter().filter(|e| e.real_time).map(|e| e.allocations).sum();
    assert_eq!(took, 0, "executors take no memory");
}
