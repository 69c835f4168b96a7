//! Agents that ask the router, while executors serve when the test lets them.

use std::sync::Arc;

use super::{World, wire};
use crate::agent::{Agent, Fault, Step};
use crate::plan::{AgentPlan, Plan, WirePlan};
use crate::port::{Decision, Input, NotAsked, Output, Port, REQUESTS_UNDER_WAY, Router, Why};
use crate::request::{FaultKind, Request};
use crate::{Options, registry};
use types::messages::Twist;
use types::{Duration, Time};

/// Has an end at the router.
#[derive(Agent)]
struct Asks {
    /// What comes.
    come: Input<Twist>,
    /// What goes.
    go: Output<Twist>,
    /// The router.
    router: Router,
}

impl Agent for Asks {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        Ok(())
    }
}

/// What an agent holds in its hand.
struct Hand {
    come: Input<Twist>,
    router: Router,
}

fn agent(name: &str, executor: &str) -> AgentPlan {
    let mut plan = AgentPlan { name: name.into(), kind: "asks".into(), ..AgentPlan::default() };
    (plan.executor, plan.on) = (Some(executor.into()), vec!["come".into()]);
    plan
}

fn world() -> World {
    let mut plan = Plan::new("world");
    plan.agents = vec![agent("a", "reflex"), agent("b", "control"), agent("c", "vision")];
    let built = crate::system::build(&plan, &registry![Asks], &mut Options::default(), Time::ZERO).unwrap();
    let context = crate::context::Context::new(None, built.directory);
    World { router: built.router, cores: built.cores, context, now: Time::ZERO }
}

impl World {
    fn hand(&self, name: &str) -> Hand {
        let ends = self.ends(name);
        let mut hand = Hand { come: Input::default(), router: Router::default() };
        hand.come.bind(&ends[0]);
        hand.router.bind(&ends[2]);
        hand
    }

    /// Decides what was asked, while only one executor serves, or all do.
    fn decide(&mut self, only: Option<usize>) -> Vec<String> {
        self.with(usize::MAX, |router, fabric, now| {
            fabric.only = only;
            router.decide_asked(now, fabric).into_iter().map(|said| said.agent + " " + &said.what).collect()
        })
    }

    fn wired(&self) -> Vec<(String, String)> {
        self.router.view(self.now).wires.into_iter().map(|wire| (wire.from, wire.to)).collect()
    }
}

#[test]
fn a_request_waits_for_the_control_side_and_its_decision_for_the_executor() {
    let mut world = world();
    let hand = world.hand("a");
    let ticket = hand.router.subscribe(&hand.come, "b.go").unwrap();
    assert!(world.router.is_asked());
    assert!(hand.router.decision().is_none() && world.wired().is_empty());
    assert_eq!(world.decide(None), ["a asked the router: wire b.go a.come"]);
    assert_eq!(hand.router.decision(), Some((ticket, Decision::Done)));
    assert_eq!((hand.router.decision(), hand.router.under_way()), (None, 0));
    let system = hand.router.news().unwrap();
    let wire = system.wires().next().unwrap();
    assert_eq!(wire.from.port().map(|port| (port.agent().name(), port.name())), Some(("b", "go")));
    assert!(system.is_wired(wire.from.port().unwrap().at(), hand.router.own(&hand.come).unwrap()));
    assert!(!world.router.is_asked() && !world.router.has_to_do());
}

#[test]
fn an_executor_that_does_not_answer_is_told_once_and_then_the_last_state() {
    let mut world = world();
    let hand = world.hand("a");
    let before = hand.router.system().version();
    let freed = Arc::downgrade(&world.router.asking.composition);
    let (_, own, _) = world.slot("a");
    let others = world.slot("b").1;
    for n in 0..20 {
        let request = if n % 2 == 0 { wire("b.go", "b.come") } else { super::unwire("b.go", "b.come") };
        world.with(usize::MAX, |router, fabric, now| {
            fabric.only = Some(others);
            router.apply(request, now, fabric).unwrap();
        });
        assert_eq!(hand.router.system().version(), before, "nothing comes before its executor serves");
    }
    assert!(world.router.scripts.len() <= 2, "a and c are told once: {}", world.router.scripts.len());
    assert!(freed.upgrade().is_some());
    world.settle();
    assert_eq!(hand.router.news().unwrap().version(), before + 20);
    assert!(freed.upgrade().is_none(), "what nobody sees any more was freed, here");
    assert_eq!(world.executor_of(own), 0, "and nothing is under way");
}

impl World {
    /// How many changes an executor owes.
    fn executor_of(&self, executor: usize) -> u64 {
        let known = &self.router.executors[executor];
        known.link.last_given() - known.answered
    }
}

#[test]
fn while_an_executor_does_not_answer_what_concerns_it_is_refused_whole_and_others_wait_one_look() {
    let mut world = world();
    let hand = world.hand("a");
    let (own, first) = (world.slot("a").1, hand.router.subscribe(&hand.come, "b.go").unwrap());
    let second = hand.router.subscribe(&hand.come, "a.go").unwrap();
    let said = world.decide(Some(own));
    assert_eq!(said.len(), 1, "{said:?}");
    assert!(said[0].starts_with("a asked the router: wire b.go a.come; refused: the executor does not"));
    let (ticket, decision) = hand.router.decision().unwrap();
    assert!(ticket == first && matches!(decision, Decision::Refused { why: Why::Busy, .. }), "{decision:?}");
    assert!(world.wired().is_empty() && world.router.is_asked());
    assert_eq!(world.decide(Some(own)), ["a asked the router: wire a.go a.come"]);
    assert_eq!(hand.router.decision(), Some((second, Decision::Done)));
    world.settle();
    hand.router.subscribe(&hand.come, "b.go").unwrap();
    world.decide(None);
    assert_eq!(hand.router.decision().unwrap().1, Decision::Done, "later it may");
}

#[test]
fn what_was_decided_for_another_instance_is_passed_over() {
    let mut world = world();
    let before = world.hand("a");
    let old = before.router.subscribe(&before.come, "b.go").unwrap();
    world.ask(Request::Restart("a".into())).unwrap();
    let after = world.hand("a");
    assert!(after.router.decision().is_none());
    world.decide(None);
    assert!(after.router.decision().is_none(), "it did not ask");
    let new = after.router.unsubscribe(&after.come, "b.go").unwrap();
    assert_ne!(new, old);
    world.decide(None);
    assert_eq!(
        after.router.decision(),
        Some((new, Decision::Done)),
        "but the wire of the one before is its own"
    );
}

#[test]
fn who_goes_or_is_lost_with_requests_under_way_leaves_nothing() {
    for hangs in [false, true] {
        let mut world = world();
        let hand = world.hand("a");
        (0..REQUESTS_UNDER_WAY).for_each(|_| assert!(hand.router.subscribe(&hand.come, "b.go").is_ok()));
        assert_eq!(hand.router.subscribe(&hand.come, "b.go"), Err(NotAsked::TooMany));
        let (_, executor, slot) = world.slot("a");
        if hangs {
            world.ask(Request::Fault { target: "a".into(), fault: FaultKind::Hang }).unwrap();
            world.cores[executor].give_up(slot, Time::ZERO);
            world.with(usize::MAX, |router, fabric, now| router.supervise(now, fabric));
            world.now = Time::ZERO + Duration::secs(1);
        } else {
            world.ask(Request::Remove("a".into())).unwrap();
        }
        assert_eq!(world.decide(None), [] as [&str; 0], "nobody waits for it");
        world.settle();
        assert!(world.wired().is_empty());
        // What the lost step still asks reaches nobody.
        assert!(hand.router.decision().is_none());
        if hangs {
            let again = world.hand("a");
            assert_eq!(again.router.under_way(), 0);
            let ticket = again.router.subscribe(&again.come, "b.go").unwrap();
            world.decide(None);
            assert_eq!(again.router.decision(), Some((ticket, Decision::Done)));
            let asked = world.router.view(world.now).agents[0].ports[2].asked;
            assert_eq!(asked, Some((REQUESTS_UNDER_WAY as u64 + 1, 1)), "its numbers go on");
        }
    }
}

/// An agent that keeps a look for ever keeps what it looks at, and learns nothing new.
#[test]
fn what_is_looked_at_is_not_taken_away() {
    let mut world = world();
    let hand = world.hand("a");
    let looked_at = Arc::downgrade(&world.router.asking.composition);
    let look = hand.router.system();
    world.ask(wire("b.go", "c.come")).unwrap();
    assert!(looked_at.upgrade().is_some());
    assert_eq!(look.wires().count(), 0);
    drop(look);
    world.ask(Request::Wire(WirePlan::new("c.go", "b.come"))).unwrap();
    assert_eq!(hand.router.system().wires().count(), 2);
    assert!(looked_at.upgrade().is_none());
}

#[test]
fn outside_of_any_system_nobody_is_there_and_nothing_is_asked() {
    let hand = Hand { come: Input::default(), router: Router::default() };
    assert_eq!(hand.router.system().members().len(), 0);
    assert!(hand.router.news().is_none() && hand.router.decision().is_none());
    assert_eq!(hand.router.subscribe(&hand.come, "b.go"), Err(NotAsked::Nowhere));
}
