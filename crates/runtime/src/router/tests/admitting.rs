//! What is analysed before a request is done, and what need not be.

use std::collections::BTreeMap;

use proptest::prelude::*;
use schedule::Exact;

use super::*;
use crate::queue_plan::QueuePlan;
use crate::{Admission, TIMING_KEYS};

/// An agent by the clock, or for messages.
fn timed(name: &str, executor: &str, period: Option<i64>) -> AgentPlan {
    let mut plan = AgentPlan { cost: Some(Duration::millis(1)), ..agent(name, executor) };
    plan.period = period.map(Duration::millis);
    plan.on = if period.is_some() { Vec::new() } else { vec!["come".into()] };
    plan
}

fn world(agents: Vec<AgentPlan>, wires: &[(&str, &str)]) -> World {
    let mut plan = Plan::new("world");
    plan.agents = agents;
    plan.wires = wires.iter().map(|(from, to)| WirePlan::new(*from, *to)).collect();
    let built = build(&plan, &registry![Both], &mut Options::default(), Time::ZERO).unwrap();
    let context = Context::new(None, built.directory);
    let mut world = World { router: built.router, cores: built.cores, context, now: Time::ZERO };
    world.router.set_admission(Some(Admission { processors: 1, ..Admission::default() }));
    world
}

fn set(agent: &str, key: &str, value: impl Into<Value>) -> Request {
    Request::Set { agent: agent.into(), key: key.into(), value: value.into() }
}

/// A fast one in real time, one for its messages, and three ordinary ones, of which the first makes one in real time run.
fn mixed() -> World {
    let agents = vec![
        timed("fast", "reflex", Some(10)),
        timed("act", "control", None),
        timed("plan", "ordinary", Some(100)),
        timed("log", "ordinary", Some(100)),
        timed("show", "ordinary", None),
    ];
    world(agents, &[("plan.go", "act.come"), ("log.go", "show.come")])
}

#[test]
fn what_cannot_make_anybody_late_is_not_analysed_and_nothing_is_analysed_twice() {
    let mut world = mixed();
    let mut analyses = |request: Request| {
        let before = world.router.analyses;
        world.ask(request).unwrap();
        world.settle();
        world.router.analyses - before
    };
    // As it is, and as it would be.
    assert_eq!(analyses(set("fast", "period", "11ms")), 2);
    assert_eq!(analyses(set("fast", "period", "12ms")), 1, "as it is was analysed as it would be");
    assert_eq!(analyses(set("fast", "period", "12ms")), 0, "nothing is otherwise");
    assert_eq!(analyses(set("fast", "importance", 0.75)), 0);
    assert_eq!(analyses(set("fast", "number", 2.0)), 0);
    assert_eq!(analyses(set("show", "cost", "90ms")), 0, "it is ordinary, and makes nobody run");
    assert_eq!(analyses(set("log", "period", "1ms")), 0, "who runs for it is ordinary, too");
    // An ordinary one that makes one in real time run.
    assert_eq!(analyses(set("plan", "period", "90ms")), 2);
    assert_eq!(analyses(wire("log.kept", "fast.come")), 0, "who does not run for what comes is no later");
    assert_eq!(analyses(wire("plan.kept", "show.come")), 0);
    assert_eq!(analyses(Request::Add(timed("guest", "ordinary", None))), 0);
    assert_eq!(analyses(Request::Add(timed("hand", "control", Some(100)))), 2);
    assert_eq!(analyses(wire("plan.kept", "act.come")), 1);
    // Through a queue.
    assert_eq!(analyses(set("log", "period", "90ms")), 0);
    let queue = Request::Queue(QueuePlan::new("work"));
    let out = Request::Wire(WirePlan::new("work", "act.come"));
    assert_eq!(
        analyses(Request::All(vec![queue, out])),
        1,
        "nobody sends into it, but the period of one is another now"
    );
    assert!(analyses(wire("show.go", "work")) > 0);
    assert!(analyses(set("log", "period", "80ms")) > 0, "it makes one run that sends into the queue");
}

#[test]
fn a_circle_of_ordinary_agents_is_found_all_the_same() {
    let mut world = mixed();
    world.ask(Request::Add(timed("back", "ordinary", None))).unwrap();
    world.ask(wire("show.go", "back.come")).unwrap();
    let refused = world.ask(wire("back.go", "show.come")).unwrap_err();
    assert!(refused.what.contains("in a circle"), "{refused}");
    let two = [timed("one", "ordinary", None), timed("two", "ordinary", None)].map(Request::Add);
    let wires = [wire("one.go", "two.come"), wire("two.go", "one.come")];
    let refused = world.ask(Request::All(two.into_iter().chain(wires).collect())).unwrap_err();
    assert!(refused.what.contains("in a circle"), "{refused}");
}

#[test]
fn who_is_admitted_unseen_is_still_told_when_it_outgrows_what_it_said() {
    let mut world = mixed();
    world.ask(Request::Add(timed("guest", "ordinary", Some(50)))).unwrap();
    assert_eq!(world.router.known("guest").unwrap().admitted, Some(Duration::millis(1)));
    world.ask(set("guest", "cost", "2ms")).unwrap();
    assert_eq!(world.router.known("guest").unwrap().admitted, Some(Duration::millis(2)));
}

/// How long each in real time takes at worst, with all that there is.
fn responses(world: &mut World) -> Result<BTreeMap<String, Option<Exact>>, Refusal> {
    world.router.analysed = None;
    Ok(world.router.judged()?.unwrap().responses())
}

fn any_agent(number: usize) -> impl Strategy<Value = AgentPlan> {
    let period = prop_oneof![Just(None), (2_i64..9).prop_map(|tens| Some(tens * 10))];
    let executor = prop_oneof![2 => Just("ordinary"), 1 => Just("control"), 1 => Just("reflex")];
    (period, executor).prop_map(move |(period, executor)| timed(&format!("a{number}"), executor, period))
}

/// A request about agents from a0 on, `count` of them.
fn any_request(count: usize) -> impl Strategy<Value = Request> {
    let name = move || (0..count).prop_map(|at| format!("a{at}"));
    let ports = prop_oneof![
        2 => Just(("go", "come")), 1 => Just(("kept", "come")), 1 => Just(("ask", "answer"))
    ];
    let wires = (name(), name(), ports)
        .prop_map(|(from, to, (out, into))| wire(&format!("{from}.{out}"), &format!("{to}.{into}")));
    let sets = (name(), prop_oneof![Just("cost"), Just("min_gap"), Just("deadline")], 1_i64..9)
        .prop_map(|(name, key, millis)| set(&name, key, format!("{millis}ms")));
    let one = prop_oneof![3 => wires, 1 => sets, 1 => any_agent(count).prop_map(Request::Add)];
    prop_oneof![3 => one.clone(), 1 => prop::collection::vec(one, 2..4).prop_map(Request::All)]
}

proptest! {
    /// What is not analysed changes nothing for anybody in real time.
    #[test]
    fn who_is_not_reached_is_as_late_as_before(
        agents in [0, 1, 2, 3, 4, 5, 6].map(any_agent),
        wires in prop::collection::vec((0..7_usize, 0..7_usize, any::<bool>()), 0..8),
        request in any_request(7),
    ) {
        let mut world = world(agents.into(), &[]);
        for (from, to, kept) in wires {
            // Each sends to those behind it only: no circle.
            let (from, to) = (from.min(to), from.max(to));
            let port = if kept { "kept" } else { "go" };
            let _ = world.ask(Request::Forced(Box::new(wire(&format!("a{from}.{port}"), &format!("a{to}.come")))));
        }
        let Ok(before) = responses(&mut world) else { return Ok(()) };
        if !world.router.reaches_real_time(&request) && world.ask(request).is_ok() {
            let after = responses(&mut world);
            prop_assert!(after.is_ok(), "a circle was closed");
            prop_assert_eq!(before, after.unwrap());
        }
    }
}

#[test]
fn every_entry_that_is_timing_but_how_important_it_is_can_make_somebody_late() {
    let mut world = mixed();
    for key in TIMING_KEYS {
        let reaches = world.router.reaches_real_time(&set("fast", key, "1ms"));
        assert_eq!(reaches, key != "importance", "{key}");
    }
    world.settle();
}
