//! Who comes in the place of another.

use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::any::Any;
use std::sync::Mutex;

use runtime::{
    Agent, Fault, Input, Live, Options, Output, Params, Plan, Registry, Request, Simulation, Step, WirePlan,
    registry,
};
use types::Duration;
use types::messages::Twist;

use crate::{Sink, Source, at, heard, options, sink};

/// Which counters were stopped, by test and at which count.
static STOPPED: Mutex<Vec<(String, i64)>> = Mutex::new(Vec::new());

/// Counts its steps, and goes on with the count of whom it replaces.
#[derive(Agent)]
struct Counter {
    /// The count, as a speed.
    out: Output<Twist>,
    params: CounterParams,
    count: i64,
    started: bool,
}

/// Who it is.
#[derive(Clone, Debug, Default, Params)]
struct CounterParams {
    /// The name of the test.
    test: String,
    /// Whether it panics when it takes over.
    clumsy: bool,
}

impl Agent for Counter {
    fn start(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.started = true;
        Ok(())
    }

    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        assert!(self.started, "a step before the start");
        self.count += 1;
        self.out.send(Twist::new(self.count as f64, 0.0));
        Ok(())
    }

    fn take_over(&mut self, before: &mut dyn Any) {
        assert!(!self.params.clumsy, "dropped it");
        assert!(!self.started, "started before it took over");
        if let Some(before) = before.downcast_mut::<Counter>() {
            self.count = before.count;
        }
    }

    fn stop(&mut self, _: &mut Step) {
        STOPPED.lock().unwrap().push((self.params.test.clone(), self.count));
    }
}

/// Counts down; it has the ports of a counter.
#[derive(Agent)]
struct Reverse {
    /// The count, as a speed.
    out: Output<Twist>,
    params: CounterParams,
    count: i64,
}

impl Agent for Reverse {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        assert!(!self.params.clumsy);
        self.count -= 1;
        self.out.send(Twist::new(self.count as f64, 0.0));
        Ok(())
    }

    fn take_over(&mut self, before: &mut dyn Any) {
        if let Some(before) = before.downcast_mut::<Counter>() {
            self.count = before.count;
        }
    }
}

fn types() -> Registry {
    registry![Counter, Reverse, Sink]
}

fn plan(test: &str, clumsy: bool, requests: &[(i64, &str)]) -> Plan {
    let mut plan = Plan::new(test);
    let counter = plan.add::<Counter>("counter", CounterParams { test: test.into(), clumsy });
    let end = plan.add::<Sink>("sink", sink(test));
    plan.wire(&counter.out, &end.count);
    plan.every("counter", Duration::millis(10));
    plan.on("sink", "count");
    plan.requests = requests.iter().map(|(millis, words)| at(*millis, words)).collect();
    plan
}

fn counts(test: &str) -> Vec<i64> {
    heard(test).iter().map(|(_, twist)| twist.linear as i64).collect()
}

fn stopped(test: &str) -> Vec<i64> {
    let stopped = STOPPED.lock().unwrap();
    stopped.iter().filter(|(name, _)| name == test).map(|(_, count)| *count).collect()
}

#[test]
fn a_replacement_goes_on_where_the_one_before_stood_and_a_restart_begins_anew() {
    let test = "successor";
    let requests = [(45, "replace counter counter"), (85, "replace counter reverse")];
    let report =
        Simulation::new(&plan(test, false, &requests), &types(), options(115)).unwrap().run().unwrap();
    assert_eq!(counts(test), [1, 2, 3, 4, 5, 6, 7, 8, 9, 8, 7, 6]);
    // The second counter was made without the parameters of the first, so it stops under no name.
    assert_eq!(stopped(test), [5], "who is replaced is stopped, once");
    assert_eq!(report.view.agents[0].kind, "reverse");

    let test = "successor-restart";
    let restarts = [(45, "restart counter")];
    Simulation::new(&plan(test, false, &restarts), &types(), options(75)).unwrap().run().unwrap();
    assert_eq!(counts(test), [1, 2, 3, 4, 5, 1, 2, 3]);
    assert_eq!(stopped(test), [5, 3]);
}

#[test]
fn a_panic_while_taking_over_is_a_death_like_any_other() {
    let test = "successor-clumsy";
    let mut plan = plan(test, false, &[]);
    plan.requests = vec![at(45, "replace counter counter clumsy")];
    let report = Simulation::new(&plan, &types(), options(200)).unwrap().run().unwrap();
    let said: Vec<&str> = report.incidents.iter().map(|incident| incident.what.as_str()).collect();
    assert!(said.iter().any(|what| what.starts_with("panic: dropped it")), "{said:?}");
    assert!(said.contains(&"started again"), "{said:?}");
    let counts = counts(test);
    assert_eq!(counts[..6], [1, 2, 3, 4, 5, 1], "it knows nothing of what was before");
    assert_eq!(stopped(test), [5], "who was replaced is stopped all the same");
}

/// Whether those who do not want to go may.
static LET_GO: AtomicBool = AtomicBool::new(false);
/// Whose stop or taking over has begun.
static HOLDING: AtomicU64 = AtomicU64::new(0);

/// Does not return from its stop, or from taking over, until it is let go.
#[derive(Agent)]
struct Clinging {
    /// What comes.
    count: Input<Twist>,
    params: ClingingParams,
}

/// To what it clings.
#[derive(Clone, Debug, Default, Params)]
struct ClingingParams {
    /// To its place, when another shall come.
    stop: bool,
    /// To that of the other.
    take_over: bool,
}

impl Clinging {
    fn cling() {
        HOLDING.fetch_add(1, Ordering::AcqRel);
        while !LET_GO.load(Ordering::Acquire) {
            std::thread::yield_now();
        }
    }
}

impl Agent for Clinging {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while self.count.take().is_some() {}
        Ok(())
    }
    fn take_over(&mut self, _: &mut dyn Any) {
        if self.params.take_over {
            Clinging::cling();
        }
    }
    fn stop(&mut self, _: &mut Step) {
        if self.params.stop {
            Clinging::cling();
        }
    }
}

#[test]
fn who_does_not_return_from_its_stop_or_from_taking_over_is_found_and_keeps_nobody_waiting() {
    let types = registry![Source, Sink, Clinging];
    let mut plan = Plan::new("clinging");
    plan.add::<Source>("source", Default::default());
    plan.every("source", Duration::millis(5));
    for (name, stop) in [("goes", true), ("stays", false)] {
        plan.add::<Clinging>(name, ClingingParams { stop, take_over: false });
        plan.on(name, "count");
        plan.wires.push(WirePlan::new("source.out", format!("{name}.count")));
    }
    plan.add::<Sink>("sink", sink("clinging"));
    plan.on("sink", "count");
    plan.wires.push(WirePlan::new("source.out", "sink.count"));
    for agent in &mut plan.agents {
        agent.executor = Some("control".into());
    }
    let live = Live::new(&plan, &types, Options { limit: None, ..options(0) }).unwrap();
    let control = live.control();
    let asker = std::thread::Builder::new().name("asker".into()).spawn(move || {
        let wait = |what: &dyn Fn(&runtime::SystemView) -> bool| {
            // Half a minute, in which something would be wrong.
            for _ in 0..30_000 {
                if what(&control.view().unwrap()) {
                    return true;
                }
                std::thread::park_timeout(std::time::Duration::from_millis(1));
            }
            false
        };
        let of = |view: &runtime::SystemView, name: &str| {
            view.agents.iter().find(|agent| agent.name == name).map(|agent| agent.counts)
        };
        let stepped = |view: &runtime::SystemView| {
            of(view, "goes").is_none_or(|c| c.releases > 2)
                && of(view, "stays").is_some_and(|c| c.releases > 2)
        };
        let ran = wait(&stepped);
        let removed = control.request(Request::Remove("goes".into()));
        let mut params = types::value::Table::default();
        params.set("take_over", types::value::Value::from(true));
        let (agent, kind) = ("stays".to_owned(), "clinging".to_owned());
        let replaced = control.request(Request::Replace { agent, kind, params });
        let back = wait(&|view| of(view, "stays").is_some_and(|counts| counts.restarts == 1));
        let before = heard("clinging").len();
        let goes_on = wait(&|_| heard("clinging").len() > before + 20);
        LET_GO.store(true, Ordering::Release);
        control.request(Request::Quit).unwrap();
        (ran, removed, replaced, back, goes_on)
    });
    let report = live.run().unwrap();
    let (ran, removed, replaced, back, goes_on) = asker.unwrap().join().unwrap();
    assert!(ran && back && goes_on, "{ran} {back} {goes_on} {:?}", report.incidents);
    assert_eq!((removed, replaced), (Ok(()), Ok(())));
    assert_eq!(HOLDING.load(Ordering::Acquire), 2);
    let said: Vec<String> =
        report.incidents.iter().map(|incident| format!("{}: {}", incident.agent, incident.what)).collect();
    let hung = "it did not return from its stop, or from taking over";
    assert_eq!(
        said,
        [format!("goes: {hung}; it was removed"), format!("stays: {hung}"), "stays: started again".into()]
    );
    let numbers: Vec<i64> = heard("clinging").iter().map(|(_, twist)| twist.linear as i64).collect();
    assert_eq!(numbers, (1..=numbers.len() as i64).collect::<Vec<_>>(), "the bystander misses nothing");
    let names: Vec<&str> = report.view.agents.iter().map(|agent| agent.name.as_str()).collect();
    assert_eq!(names, ["source", "stays", "sink"]);
}

/// Takes memory where it may: when it starts, takes over and stops.
#[derive(Agent)]
struct Hoarder {
    /// Nothing.
    out: Output<Twist>,
    kept: Vec<Vec<u8>>,
}

impl Agent for Hoarder {
    fn start(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.kept.push(vec![1; 100]);
        Ok(())
    }
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        Ok(())
    }
    fn take_over(&mut self, before: &mut dyn Any) {
        if let Some(before) = before.downcast_mut::<Hoarder>() {
            self.kept = before.kept.clone();
        }
    }
    fn stop(&mut self, _: &mut Step) {
        self.kept.clear();
    }
}

#[test]
fn what_an_agent_takes_once_in_its_life_is_nobodys_fault() {
    let mut plan = Plan::new("hoarder");
    plan.add::<Hoarder>("hoarder", Default::default());
    plan.every("hoarder", Duration::millis(10));
    plan.agent_mut("hoarder").unwrap().executor = Some("reflex".into());
    plan.requests =
        vec![at(45, "replace hoarder hoarder"), at(65, "restart hoarder"), at(85, "remove hoarder")];
    // Somebody without whom the run would end.
    plan.add::<Source>("source", Default::default());
    plan.every("source", Duration::millis(10));
    let report = Simulation::new(&plan, &registry![Hoarder, Source], options(100)).unwrap().run().unwrap();
    assert!(report.incidents.iter().all(|incident| !incident.what.contains("refused")), "{report:#?}");
    let took: u64 = report.view.executors.iter().map(|executor| executor.allocations).sum();
    assert_eq!(took, 0, "{:?}", report.view.executors);
}
