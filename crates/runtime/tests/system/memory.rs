//! Nobody takes or frees memory in real time, whatever is asked of a running system.

#![allow(unsafe_code)] // an allocator that counts

use core::sync::atomic::{AtomicI64, AtomicU64, Ordering};
use std::alloc::{GlobalAlloc, Layout, System};

use runtime::{
    Agent, Fault, FaultKind, Input, Live, LogChoice, Observer, Options, Output, Plan, Registry, Report,
    Request, Simulation, Step, Verdict, WirePlan, registry,
};
use types::messages::{Image, Twist};
use types::{Duration, Time};

use crate::{Painter, Relay, Source, SourceParams, options};

#[global_allocator]
static MEMORY: runtime::Watched<Bytes> = runtime::Watched::new(Bytes);

/// Bytes in use in this process.
pub(crate) static BYTES: AtomicI64 = AtomicI64::new(0);

/// The allocator of the system, with a count of the bytes in use.
struct Bytes;

// SAFETY: every call goes on to the allocator of the system as it came.
unsafe impl GlobalAlloc for Bytes {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        BYTES.fetch_add(layout.size() as i64, Ordering::Relaxed);
        // SAFETY: the caller's promises.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        BYTES.fetch_sub(layout.size() as i64, Ordering::Relaxed);
        // SAFETY: the caller's promises.
        unsafe { System.dealloc(place, layout) }
    }
}

static TAKEN: AtomicU64 = AtomicU64::new(0);

/// Takes speeds and pictures, and remembers nothing of them.
#[derive(Agent)]
struct Taker {
    /// Speeds.
    count: Input<Twist>,
    /// Pictures.
    picture: Input<Image>,
}

impl Agent for Taker {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        let mut taken = 0;
        while let Some(twist) = self.count.take() {
            taken += u64::from(twist.linear.is_finite());
        }
        while let Some(picture) = self.picture.take() {
            taken += picture.row().len() as u64;
        }
        TAKEN.fetch_add(taken, Ordering::Relaxed);
        Ok(())
    }
}

/// Takes memory in each step.
#[derive(Agent)]
struct Greedy {
    /// What it took.
    out: Output<Twist>,
    kept: Vec<Vec<u8>>,
}

impl Agent for Greedy {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        self.kept = vec![vec![1; 100 + step.now.0 as usize % 7]];
        self.out.send(Twist::new(self.kept.len() as f64, 0.0));
        Ok(())
    }
}

fn types() -> Registry {
    registry![Source, Relay, Painter, Taker, Greedy]
}

/// A counter and a painter, each on an executor of its own, and on a third one who takes what they send; all in real time.
fn plan(name: &str) -> Plan {
    let mut plan = Plan::new(name);
    let source = plan.add::<Source>("source", SourceParams::default());
    let relay = plan.add::<Relay>("relay", Default::default());
    let painter = plan.add::<Painter>("painter", Default::default());
    let taker = plan.add::<Taker>("taker", Default::default());
    plan.wire(&source.out, &relay.from);
    plan.wire(&relay.to, &taker.count);
    plan.wire(&painter.picture, &taker.picture);
    // The source also sends into a queue that two serve: both are called by others and by each other.
    let work = plan.queue::<Twist>("work");
    let other = plan.add::<Taker>("other", Default::default());
    plan.wire(&source.out, &work);
    plan.wire(&work, &taker.count);
    plan.wire(&work, &other.count);
    plan.on("other", "count");
    plan.every("source", Duration::millis(2));
    plan.every("painter", Duration::millis(5));
    plan.on("relay", "from");
    plan.on("taker", "count");
    for (agent, executor) in [
        ("source", "reflex"),
        ("relay", "reflex"),
        ("painter", "vision"),
        ("taker", "control"),
        ("other", "vision"),
    ] {
        plan.agent_mut(agent).unwrap().executor = Some(executor.into());
    }
    plan
}

/// What can be asked of it while it runs.
fn requests() -> Vec<String> {
    let mut asked: Vec<String> = [
        "wire source.out taker.count",
        "unwire source.out relay.from",
        "wire source.out relay.from",
        "unwire source.out taker.count",
        "set source period 1ms",
        "set source by 3",
        "restart relay",
        "fault relay panic",
        "unwire painter.picture taker.picture",
        "wire painter.picture taker.picture",
        "unwire work taker.count",
        "unwire source.out work",
        "wire source.out work",
        "wire work taker.count",
        "fault taker slow",
        "fault taker off",
        "fault taker ok",
        "unwire work other.count",
        "fault taker panic",
        "wire work other.count",
        "restart other",
        "queue more",
        "wire source.out more",
        "wire more other.count",
        "remove relay",
    ]
    .map(str::to_owned)
    .to_vec();
    for kind in FaultKind::ALL.iter().filter(|kind| !matches!(kind, FaultKind::Hang | FaultKind::Panic)) {
        asked.extend(["source", "painter", "source.out", "painter.picture"].iter().filter_map(|target| {
            let is_of_steps = matches!(kind, FaultKind::Slow | FaultKind::Heavy);
            (!is_of_steps || !target.contains('.')).then(|| format!("fault {target} {}", kind.name()))
        }));
        asked.extend(["source", "painter"].map(|target| format!("fault {target} ok")));
    }
    asked
}

fn nobody_took_any(report: &Report) {
    assert!(report.view.allocations_watched);
    let agents = report.view.agents.iter().map(|agent| (agent.name.clone(), agent.counts.allocations));
    let executors = report.view.executors.iter().filter(|known| known.real_time);
    let executors = executors.map(|known| (format!("executor {}", known.name), known.allocations));
    let took: Vec<_> = agents.chain(executors).filter(|(_, count)| *count > 0).collect();
    assert!(took.is_empty(), "{took:?}");
}

fn all() -> LogChoice {
    LogChoice::by(|_, _| 1)
}

#[test]
fn in_simulated_time_no_request_makes_a_real_time_step_take_memory() {
    let mut plan = plan("memory");
    let asked = requests();
    plan.requests =
        asked.iter().enumerate().map(|(i, words)| crate::at(100 + 50 * i as i64, words)).collect();
    let length = 200 + 50 * asked.len() as i64;
    let options = Options { log: all(), ..options(length) };
    let report = Simulation::new(&plan, &types(), options).unwrap().run().unwrap();
    let refused: Vec<_> =
        report.incidents.iter().filter(|incident| incident.what.contains("refused")).collect();
    assert!(refused.is_empty(), "{refused:?}");
    nobody_took_any(&report);
}

#[test]
fn many_periodic_agents_on_one_executor_take_none_either() {
    let mut plan = Plan::new("many");
    for i in 0..200 {
        let name = format!("source{i}");
        plan.add::<Source>(&name, SourceParams::default());
        plan.every(&name, Duration::millis(5 + i % 7));
        plan.agent_mut(&name).unwrap().executor = Some("reflex".into());
    }
    let report = Simulation::new(&plan, &types(), options(200)).unwrap().run().unwrap();
    assert!(report.view.agents.iter().all(|agent| agent.counts.releases > 15));
    nobody_took_any(&report);
}

#[test]
fn who_takes_memory_is_told() {
    let mut plan = plan("greedy");
    plan.add::<Greedy>("greedy", Default::default());
    plan.every("greedy", Duration::millis(10));
    plan.agent_mut("greedy").unwrap().executor = Some("reflex".into());
    let report = Simulation::new(&plan, &types(), options(100)).unwrap().run().unwrap();
    for agent in &report.view.agents {
        // Each step takes two and, from the second on, frees two.
        let expected = if agent.name == "greedy" { 11 * 2 + 10 * 2 } else { 0 };
        assert_eq!(agent.counts.allocations, expected, "{}", agent.name);
    }
    assert!(report.view.executors.iter().all(|executor| executor.allocations == 0));
}

/// Ends the run when all was asked.
struct Until(std::sync::Arc<std::sync::atomic::AtomicBool>);

impl Observer for Until {
    fn every(&self) -> Duration {
        Duration::millis(10)
    }
    fn observe(&mut self, _: Time, _: &[runtime::Incident]) -> Verdict {
        if self.0.load(Ordering::Acquire) { Verdict::End("all was asked".into()) } else { Verdict::GoOn }
    }
}

#[test]
fn on_the_wall_clock_no_request_makes_a_real_time_step_take_memory() {
    let done = std::sync::Arc::<std::sync::atomic::AtomicBool>::default();
    let observer = Box::new(Until(done.clone()));
    let options = Options { limit: None, log: all(), observer, ..options(0) };
    let live = Live::new(&plan("memory-wall"), &types(), options).unwrap();
    let control = live.control();
    let asker = std::thread::Builder::new().name("asker".into()).spawn(move || {
        let taps = ["source.out", "painter.picture"].map(|port| control.tap(port).unwrap());
        let mut refused = Vec::new();
        for words in requests() {
            let words: Vec<String> = words.split(' ').map(str::to_owned).collect();
            refused.extend(control.request(crate::parse(&words).unwrap()).err().map(|why| (words, why.what)));
            let before = TAKEN.load(Ordering::Relaxed);
            // Some messages with it; an output that sends nothing on request does not keep the test.
            for _ in 0..20 {
                if TAKEN.load(Ordering::Relaxed) > before + 100 {
                    break;
                }
                std::thread::yield_now();
                let _ = control.view();
            }
        }
        let back = ["painter.picture", "source.out"].map(|from| WirePlan::new(from, "taker.none"));
        assert!(back.into_iter().all(|wire| control.request(Request::Wire(wire)).is_err()));
        let heard = taps.map(|tap| tap.take().0.len());
        done.store(true, Ordering::Release);
        (refused, heard)
    });
    let report = live.run().unwrap();
    let (refused, heard) = asker.unwrap().join().unwrap();
    assert!(refused.is_empty(), "{refused:?}");
    assert!(heard.iter().all(|count| *count > 0), "{heard:?}");
    nobody_took_any(&report);
}
