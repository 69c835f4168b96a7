//! Wires to and from queues, while executors cease to answer and agents are lost.

use super::*;
use crate::queue_plan::QueuePlan;

/// A queue into which a sends, and out of which b and c take, b before c. No other wire touches these ports.
fn world() -> World {
    let mut world = World::new();
    world
        .ask(Request::All(vec![
            unwire("a.go", "b.come"),
            unwire("b.go", "c.come"),
            unwire("a.kept", "c.come"),
            queue("work"),
            wire("a.go", "work"),
            out("b.come", 90),
            out("c.come", 10),
        ]))
        .unwrap();
    world.settle();
    world
}

fn queue(name: &str) -> Request {
    Request::Queue(QueuePlan { depth: Some(4), ..QueuePlan::new(name) })
}

fn out(to: &str, serving: u8) -> Request {
    Request::Wire(WirePlan { serving: Some(serving), ..WirePlan::new("work", to) })
}

/// A bit of everything that can be done to it.
fn much() -> Vec<Request> {
    vec![
        queue("more"),
        wire("a.kept", "more"),
        wire("more", "a.come"),
        unwire("work", "b.come"),
        unwire("a.go", "work"),
        wire("b.go", "work"),
        out("a.come", 50),
        Request::Remove("c".into()),
        Request::Add(agent("c", "control")),
        out("c.come", 30),
        queue("spare"),
        Request::Remove("spare".into()),
    ]
}

/// What the registry says, and what the executors have.
fn said(world: &World) -> String {
    let (_, queues, wires) = world.router.to_plan();
    let queues: Vec<String> = queues.into_iter().map(|queue| queue.name).collect();
    let mut wires: Vec<String> =
        wires.iter().map(|wire| format!("{} {} {:?}", wire.from, wire.to, wire.serving)).collect();
    wires.sort();
    let names: Vec<String> = world.router.in_order().iter().map(|known| known.plan.name.clone()).collect();
    let ends = names.iter().map(|name| {
        let ends = world.ends(name);
        let routes = [&ends[1], &ends[2]].map(|end| world.routes(end));
        let mut come = Input::<Twist>::default();
        come.bind(&ends[0]);
        format!("{name} {routes:?} {}", come.is_wired())
    });
    let ends: Vec<String> = ends.collect();
    format!("{queues:?}\n{wires:?}\n{ends:?}\n{:?}", world.rings())
}

fn send(world: &mut World, port: &str) {
    let cdr = [0, 1, 0, 0].into_iter().chain([0; 48]).collect();
    world.ask(Request::Send { port: port.into(), cdr }).unwrap();
}

/// Whether an agent is called for something that it has not taken yet.
fn is_called(world: &mut World, name: &str) -> bool {
    let (_, executor, slot) = world.slot(name);
    let (core, now) = (&mut world.cores[executor], world.now);
    let _ = core.look_at_door();
    std::iter::from_fn(|| core.next(now)).any(|job| job.slot == slot)
}

fn take(ends: &[PortEnds]) -> usize {
    let mut come = Input::<Twist>::default();
    come.bind(&ends[0]);
    std::iter::from_fn(|| come.take().map(drop)).count()
}

#[test]
fn what_is_asked_of_queues_is_done_whole_or_refused_whole_whenever_executors_cease_to_answer() {
    let whole = {
        let mut world = world();
        world.ask(Request::All(much())).unwrap();
        world.settle();
        said(&world)
    };
    let nothing = said(&world());
    let (mut done, mut refused) = (0, 0);
    for serves in 0..50 {
        let mut world = world();
        let answer =
            world.with(serves, |router, fabric, now| router.apply(Request::All(much()), now, fabric));
        world.settle();
        assert_eq!(said(&world), if answer.is_ok() { &*whole } else { &*nothing }, "{serves} {answer:?}");
        done += usize::from(answer.is_ok());
        refused += usize::from(answer.is_err());
    }
    assert!(done > 20 && refused > 2, "{done} {refused}");
}

#[test]
fn what_is_refused_or_comes_and_goes_takes_no_place_for_ever() {
    let mut world = world();
    let nothing = said(&world);
    for _ in 0..100 {
        let mut requests = much();
        requests.push(wire("a.go", "nobody.come"));
        world.ask(Request::All(requests)).unwrap_err();
        let again =
            vec![unwire("work", "b.come"), out("b.come", 90), unwire("a.go", "work"), wire("a.go", "work")];
        world.ask(Request::All(again)).unwrap();
        world.settle();
    }
    let queue = &world.router.view(world.now).queues[0];
    assert_eq!((queue.sent, queue.refused), (1, 0), "the one with which it was looked who is wired");
    assert_eq!(take(&world.ends("c")), 1);
    assert_eq!(said(&world), nothing);
}

#[test]
fn nobody_touches_the_ends_of_queues_of_an_agent_that_is_lost() {
    for lost in ["a", "b"] {
        for request in [
            Request::Restart(lost.into()),
            unwire("a.go", "work"),
            unwire("work", "b.come"),
            wire("b.go", "work"),
            out("a.come", 50),
            Request::Remove("a".into()),
            Request::Remove("b".into()),
            Request::All(much()),
        ] {
            let whole = {
                let mut world = world();
                world.ask(request.clone()).unwrap();
                world.settle();
                said(&world)
            };
            let mut world = world();
            let (_, executor, slot) = world.slot(lost);
            let old = world.ends(lost);
            let mut staged = Staged::default();
            world.router.stage(request.clone(), &mut staged).unwrap();
            world.router.decide(staged);
            let now = world.now;
            world.cores[executor].give_up(slot, now);
            world.cores[executor].find_ready();
            let before = wired(&old);
            for _ in 0..4 {
                for executor in 0..world.cores.len() {
                    world.with(usize::MAX, |router, fabric, _| {
                        router.give(fabric);
                        fabric.ring(executor);
                    });
                }
                world.settle();
                assert_eq!(
                    wired(&old),
                    before,
                    "{lost} {request:?}: an end was changed while a step may use it"
                );
                world.now += Duration::secs(1);
            }
            assert_eq!(said(&world), whole, "{lost} {request:?}");
            // Nothing goes in or out by the old ends.
            let waiting = |world: &World| world.router.view(world.now).queues[0].waiting;
            let before = waiting(&world);
            world.routes(&old[1]);
            assert_eq!(
                (take(&old), waiting(&world)),
                (0, before),
                "{lost} {request:?}: the lost one uses the queue still"
            );
        }
    }
}

#[test]
fn who_is_lost_with_a_call_keeps_the_message_from_nobody() {
    let mut world = world();
    send(&mut world, "a.go");
    assert!(is_called(&mut world, "b") && !is_called(&mut world, "c"), "the first of both");
    let ((_, executor, slot), old) = (world.slot("b"), world.ends("b"));
    let now = world.now;
    world.cores[executor].give_up(slot, now);
    world.settle();
    assert!(is_called(&mut world, "c"));
    assert_eq!((take(&old), take(&world.ends("c"))), (0, 1));
}

#[test]
fn who_is_cut_off_with_a_call_keeps_the_message_from_nobody() {
    for request in [unwire("work", "b.come"), Request::Remove("b".into())] {
        let mut world = world();
        send(&mut world, "a.go");
        assert!(is_called(&mut world, "b"));
        let old = world.ends("b");
        // No executor answers any more: it is decided all the same that b takes nothing.
        let mut staged = Staged::default();
        world.router.stage(request.clone(), &mut staged).unwrap();
        world.router.decide(staged);
        assert!(is_called(&mut world, "c"), "{request:?}");
        assert_eq!((take(&old), take(&world.ends("c"))), (0, 1), "{request:?}");
        world.settle();
    }
}

#[test]
fn the_calls_of_a_sender_that_is_lost_are_made() {
    let mut world = world();
    let ((id, executor, slot), ends) = (world.slot("a"), world.ends("a"));
    {
        // It sends in a step that does not end.
        let _entered = world.context.enter();
        world.context.enter_executor(executor as u32);
        world.context.begin(id, world.now);
        let mut go = Output::<Twist>::default();
        go.bind(&ends[1]);
        go.send(Twist::ZERO);
    }
    assert!(!is_called(&mut world, "b") && !is_called(&mut world, "c"));
    let now = world.now;
    world.cores[executor].give_up(slot, now);
    world.settle();
    assert!(is_called(&mut world, "b"), "it was called, and nobody told it");
    assert_eq!(world.router.view(now).queues[0].waiting, 1);
}
