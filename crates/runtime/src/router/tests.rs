//! The registry and its executors, which serve changes when the test lets them.

#![allow(clippy::unwrap_used)] // a test may

mod admitting;
mod asking;
mod queues;

use std::sync::Arc;

use types::messages::Twist;
use types::value::Value;
use types::{AgentId, Duration, Time};

use super::{Fabric, Rings, Router, Staged};
use crate::agent::{Agent, Fault, Step};
use crate::context::Context;
use crate::executor::{Core, RawCause};
use crate::plan::{AgentPlan, Plan, WirePlan};
use crate::port::{Input, Output, Port, PortEnds};
use crate::request::{AgentState, FaultKind, Refusal, Request};
use crate::service::{Client, Service};
use crate::system::{Still, build};
use crate::{Options, Params, registry};

/// Has an end of each kind.
#[derive(Agent)]
struct Both {
    /// What comes.
    come: Input<Twist>,
    /// What goes.
    go: Output<Twist>,
    /// What is kept.
    #[port(history = 2)]
    kept: Output<Twist>,
    /// What is asked.
    ask: Client<Twist, Twist>,
    /// What is answered.
    answer: Service<Twist, Twist>,
    params: BothParams,
}

/// How it is.
#[derive(Clone, Debug, Params)]
struct BothParams {
    /// Anything.
    #[param(default = 1.0, min = 0.0)]
    number: f64,
}

impl Agent for Both {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        Ok(())
    }
}

/// Serves so many times, and not again.
struct Serves<'a> {
    still: Still<'a>,
    left: usize,
    /// Only this one, if only one does.
    only: Option<usize>,
    waits: usize,
}

impl Fabric for Serves<'_> {
    fn ring(&mut self, executor: usize) {
        if self.only.is_none_or(|only| only == executor)
            && let Some(left) = self.left.checked_sub(1)
        {
            self.left = left;
            self.still.ring(executor);
        }
    }
    fn wait(&mut self) -> bool {
        self.waits += 1;
        false
    }
}

struct World {
    router: Router,
    cores: Vec<Core>,
    context: Box<Context>,
    now: Time,
}

fn agent(name: &str, executor: &str) -> AgentPlan {
    let mut plan = AgentPlan { name: name.into(), kind: "both".into(), ..AgentPlan::default() };
    (plan.executor, plan.on) = (Some(executor.into()), vec!["come".into()]);
    plan
}

fn wire(from: &str, to: &str) -> Request {
    Request::Wire(WirePlan::new(from, to))
}

fn unwire(from: &str, to: &str) -> Request {
    Request::Unwire { from: from.into(), to: to.into() }
}

impl World {
    /// a → b → c and a → c on three executors, where b asks c.
    fn new() -> World {
        let mut plan = Plan::new("world");
        plan.agents = vec![agent("a", "reflex"), agent("b", "control"), agent("c", "vision")];
        plan.wires = [("a.go", "b.come"), ("b.go", "c.come"), ("a.kept", "c.come"), ("b.ask", "c.answer")]
            .map(|(from, to)| WirePlan::new(from, to))
            .into();
        let built = build(&plan, &registry![Both], &mut Options::default(), Time::ZERO).unwrap();
        let context = Context::new(None, built.directory);
        World { router: built.router, cores: built.cores, context, now: Time::ZERO }
    }

    /// With executors that serve so many times.
    fn with<R>(&mut self, serves: usize, work: impl FnOnce(&mut Router, &mut Serves<'_>, Time) -> R) -> R {
        let _entered = self.context.enter();
        let still = Still { cores: &mut self.cores, context: &self.context, now: self.now };
        work(&mut self.router, &mut Serves { still, left: serves, only: None, waits: 0 }, self.now)
    }

    fn ask(&mut self, request: Request) -> Result<(), Refusal> {
        self.with(usize::MAX, |router, fabric, now| router.apply(request, now, fabric))
    }

    /// Everybody answers again, and what is owed is done.
    fn settle(&mut self) {
        for executor in 0..self.cores.len() {
            self.with(usize::MAX, |_, fabric, _| fabric.ring(executor));
        }
        self.with(usize::MAX, |router, fabric, now| router.supervise(now, fabric));
        assert!(!self.router.has_to_do(), "something is left to do");
    }

    fn slot(&self, name: &str) -> (AgentId, usize, u32) {
        let known = self.router.known(name).unwrap();
        (known.id, known.executor, known.slot)
    }

    fn ends(&self, name: &str) -> Vec<PortEnds> {
        self.router.known(name).unwrap().ends.clone()
    }

    /// What the registry says.
    fn registry(&self) -> String {
        let (agents, _, wires) = self.router.to_plan();
        let known = |plan: &AgentPlan| {
            let known = self.router.known(&plan.name).unwrap();
            let params: Vec<_> = plan.params.rows().iter().map(|row| &row.entry.value).collect();
            let faults = (known.fault, &known.output_faults);
            format!("{} {} {params:?} {:?} {faults:?}\n", plan.name, known.slot, known.timing)
        };
        let agents: String = agents.iter().map(known).collect();
        let slots = self.router.executors.iter().map(|executor| executor.slots.iter().flatten());
        let slots: Vec<Vec<_>> = slots.map(Iterator::collect).collect();
        let wires: Vec<String> = wires.iter().map(|wire| format!("{} {}", wire.from, wire.to)).collect();
        format!("{agents}{wires:?}\n{slots:?}\n{}", self.router.wires.len())
    }

    /// How many rings lead into and out of each port of each agent.
    fn rings(&self) -> Vec<Vec<Rings>> {
        self.router.in_order().iter().map(|known| known.rings.clone()).collect()
    }

    /// What the executors do: who sits where, and to how many a message goes that is sent from each output.
    fn executors(&mut self) -> Vec<String> {
        let mut said = Vec::new();
        for core in &self.cores {
            let seated = core.seats.iter().enumerate();
            let seated = seated.filter_map(|(slot, seat)| Some((slot, seat.as_ref()?)));
            said.extend(seated.map(|(slot, seat)| {
                format!("{} {slot} {} {:?} {:?}", core.number, seat.name, seat.fault, seat.timing)
            }));
        }
        let names: Vec<String> = self.router.in_order().iter().map(|known| known.plan.name.clone()).collect();
        for port in
            names.iter().flat_map(|name| ["go", "kept", "ask", "answer"].map(|p| format!("{name}.{p}")))
        {
            let before: Vec<u64> = self.sent();
            let cdr = [0, 1, 0, 0].into_iter().chain([0; 48]).collect();
            self.ask(Request::Send { port: port.clone(), cdr }).unwrap();
            let after = self.sent();
            let got = self.router.wires.values().zip(before.iter().zip(&after));
            for (wire, (before, after)) in got.filter(|(_, (before, after))| before != after) {
                said.push(format!("{port} {} {:?} {}", wire.to.0.0, wire.to.1, after - before));
            }
        }
        let ends = names.iter().map(|name| (name.clone(), self.ends(name)));
        for (name, ends) in ends.collect::<Vec<_>>() {
            let routes = [&ends[1], &ends[2]].map(|end| self.routes(end));
            said.push(format!("{name} has {routes:?} routes"));
        }
        said
    }

    /// How many rings lead out of an output, whether the registry knows them or not.
    fn routes(&self, end: &PortEnds) -> u32 {
        let mut out = Output::<Twist>::default();
        out.bind(end);
        let _entered = self.context.enter();
        self.context.enter_executor(u32::MAX);
        self.context.begin(AgentId::NONE, self.now);
        let sent = out.send(Twist::ZERO);
        self.context.end();
        sent.taken + sent.refused
    }

    fn sent(&self) -> Vec<u64> {
        use core::sync::atomic::Ordering::Relaxed;
        self.router.wires.values().map(|wire| wire.counts.sent.load(Relaxed)).collect()
    }
}

/// A bit of everything.
fn much() -> Vec<Request> {
    vec![
        Request::Add(agent("d", "reflex")),
        wire("a.go", "d.come"),
        wire("d.ask", "b.answer"),
        unwire("a.go", "b.come"),
        Request::Set { agent: "a".into(), key: "number".into(), value: Value::from(2.0) },
        Request::Set { agent: "a".into(), key: "deadline".into(), value: Value::from("20ms") },
        Request::Fault { target: "a.go".into(), fault: FaultKind::Intermittent },
        Request::Fault { target: "a".into(), fault: FaultKind::Slow },
        Request::Replace { agent: "b".into(), kind: "both".into(), params: Default::default() },
        Request::Remove("c".into()),
        Request::Add(agent("c", "control")),
        Request::Restart("b".into()),
    ]
}

#[test]
fn a_request_is_done_whole_or_refused_whole_whenever_executors_cease_to_answer() {
    let whole = {
        let mut world = World::new();
        world.ask(Request::All(much())).unwrap();
        world.settle();
        (world.registry(), world.executors())
    };
    let nothing = (World::new().registry(), World::new().executors());
    let (mut done, mut refused) = (0, 0);
    for serves in 0..60 {
        let mut world = World::new();
        let answer =
            world.with(serves, |router, fabric, now| router.apply(Request::All(much()), now, fabric));
        world.settle();
        let expected = if answer.is_ok() { &whole } else { &nothing };
        assert_eq!(world.registry(), expected.0, "{serves} {answer:?}");
        assert_eq!(world.executors(), expected.1, "{serves} {answer:?}");
        for (known, rings) in world.router.in_order().iter().zip(world.rings()) {
            let wires = || known.wires.iter().map(|id| &world.router.wires[id]);
            for (port, rings) in rings.iter().enumerate() {
                let into = wires().filter(|wire| wire.to == (known.id, port)).count();
                let out = wires().filter(|wire| wire.from == (known.id, port)).count();
                assert_eq!(*rings, Rings { into, out }, "{serves} {}", known.plan.name);
            }
        }
        done += usize::from(answer.is_ok());
        refused += usize::from(answer.is_err());
    }
    assert!(done > 20 && refused > 2, "{done} {refused}");
}

#[test]
fn what_is_refused_in_the_middle_leaves_nothing_behind() {
    let nothing = (World::new().registry(), World::new().executors());
    let wrong = [
        wire("a.go", "nobody.come"),
        // All seats of that memory are taken before the last of these.
        Request::All((0..8).map(|i| wire("b.kept", &format!("late{i}.come"))).collect()),
        Request::Set { agent: "b".into(), key: "number".into(), value: Value::from(-1.0) },
        Request::Send { port: "b.go".into(), cdr: vec![1] },
        Request::Remove("nobody".into()),
    ];
    for wrong in wrong {
        let mut requests = much();
        requests.extend((0..9).map(|i| Request::Add(agent(&format!("late{i}"), "reflex"))));
        requests.push(wire("b.kept", "late8.come"));
        requests.push(wrong);
        let mut world = World::new();
        world.ask(Request::All(requests)).unwrap_err();
        assert_eq!(world.registry(), nothing.0);
        assert_eq!(world.rings(), World::new().rings());
        assert_eq!(world.executors(), nothing.1);
    }
}

/// Whether anybody is wired to the input and the output of these ends.
fn wired(ends: &[PortEnds]) -> (bool, bool) {
    let (mut come, mut go) = (Input::<Twist>::default(), Output::<Twist>::default());
    come.bind(&ends[0]);
    go.bind(&ends[1]);
    (come.is_wired(), go.has_listeners())
}

#[test]
fn nobody_touches_the_ends_of_an_agent_that_is_lost() {
    for request in [
        wire("c.go", "b.come"),
        unwire("a.go", "b.come"),
        unwire("b.go", "c.come"),
        wire("b.go", "a.come"),
        Request::Restart("b".into()),
        Request::Fault { target: "b.go".into(), fault: FaultKind::Off },
        Request::Fault { target: "b".into(), fault: FaultKind::Slow },
        Request::Remove("b".into()),
        Request::Remove("a".into()),
        Request::Replace { agent: "b".into(), kind: "both".into(), params: Default::default() },
        Request::All(much()),
    ] {
        let whole = {
            let mut world = World::new();
            world.ask(request.clone()).unwrap();
            world.settle();
            (world.registry(), world.executors())
        };
        let mut world = World::new();
        let (id, executor, slot) = world.slot("b");
        let old = world.ends("b");
        let cdr = [0, 1, 0, 0].into_iter().chain([0; 48]).collect();
        world.ask(Request::Send { port: "b.go".into(), cdr }).unwrap();
        // It is decided, and before any executor comes to it, the agent is lost in a step.
        let mut staged = Staged::default();
        world.router.stage(request.clone(), &mut staged).unwrap();
        world.router.decide(staged);
        let now = world.now;
        world.cores[executor].give_up(slot, now);
        world.cores[executor].find_ready();
        assert!(world.cores[executor].seats[slot as usize].as_ref().unwrap().on.is_empty(), "looked at");
        let before = wired(&old);
        // They serve what they were given, and the control side hears of it later.
        for executor in 0..world.cores.len() {
            world.with(usize::MAX, |router, fabric, _| {
                router.give(fabric);
                fabric.ring(executor);
            });
        }
        assert_eq!(wired(&old), before, "{request:?}: an end was changed while a step may use it");
        for _ in 0..3 {
            world.settle();
        }
        assert_eq!(wired(&old), before, "{request:?}: an end was changed later");
        if let Ok(known) = world.router.known("b") {
            let same = |a: &PortEnds, b: &PortEnds| {
                Arc::ptr_eq(a.input.as_ref().unwrap(), b.input.as_ref().unwrap())
            };
            assert!(!same(&known.ends[0], &old[0]), "{request:?}: it has new ones");
            let sent = known.ends[1].output.as_ref().unwrap().sent();
            assert_eq!(
                (known.id, sent),
                (id, 1),
                "{request:?}: its number, and those of its messages, go on"
            );
        }
        // What was asked for is so, with the new ends.
        let restarted = world.now + Duration::secs(1);
        world.now = restarted;
        world.settle();
        assert_eq!(world.registry(), whole.0, "{request:?}");
        assert_eq!(world.executors(), whole.1, "{request:?}");
    }
}

#[test]
fn what_was_decided_first_is_done_first_whoever_answers_first() {
    let before = (World::new().registry(), World::new().executors());
    for first in ["a", "c"] {
        let mut world = World::new();
        let (_, executor, _) = world.slot(first);
        for request in [wire("c.go", "a.come"), unwire("c.go", "a.come")] {
            let mut staged = Staged::default();
            world.router.stage(request, &mut staged).unwrap();
            world.router.decide(staged);
        }
        world.with(usize::MAX, |router, fabric, _| {
            fabric.only = Some(executor);
            router.advance(fabric);
        });
        world.settle();
        assert_eq!((world.registry(), world.executors()), before, "{first} answers first");
    }
}

#[test]
fn a_restart_waits_for_a_neighbour_that_takes_its_time() {
    let mut world = World::new();
    let (id, _, slot) = world.slot("b");
    world.router.died(slot, id, Time::ZERO, RawCause::Fault(Fault::new("tired")), true);
    world.now = Time::ZERO + Duration::millis(100);
    for _ in 0..5 {
        world.with(0, |router, fabric, now| router.supervise(now, fabric));
        assert_eq!(world.router.known("b").unwrap().state, AgentState::Restarting);
        world.now += Duration::secs(3);
    }
    world.settle();
    let known = world.router.known("b").unwrap();
    assert_eq!(known.state, AgentState::Running);
    let said: Vec<&str> = world.router.incidents.iter().map(|incident| incident.what.as_str()).collect();
    assert_eq!(said, ["fault: tired", "started again"], "once");
}

#[test]
fn a_call_from_outside_keeps_nobody_waiting() {
    let mut world = World::new();
    let (asker, answered) = std::sync::mpsc::sync_channel(1);
    let cdr = [0, 1, 0, 0].into_iter().chain([0; 48]).collect();
    let (service, within) = ("c.answer".to_owned(), Duration::millis(10));
    let call = super::OutsideCall { service, cdr, within, asker };
    let before = world.registry();
    let waits = world.with(0, |router, fabric, now| {
        router.call(call, now, fabric).unwrap();
        router.answer_calls(now + Duration::secs(1), fabric);
        fabric.waits
    });
    assert_eq!(waits, 0, "the control side waited for an executor");
    let said = answered.try_recv().unwrap().unwrap_err().what;
    assert_eq!(said, "c.answer did not answer within 10ms");
    world.settle();
    assert_eq!(world.registry(), before, "and nothing of it is left");
}
