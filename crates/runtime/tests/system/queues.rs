//! Queues: several inputs share a mailbox, and each message goes to one of them.

use core::sync::atomic::{AtomicBool, Ordering};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use runtime::{
    Agent, Envelope, Fault, Input, Live, Options, Output, Overload, Params, Plan, Registry, Report, Request,
    Simulation, Step, SystemView, WirePlan, registry,
};
use types::chance::Stream;
use types::messages::{Image, Twist};
use types::value::Value;
use types::{Duration, Priority};

use crate::{Painter, at, options, parse};

/// Who took which number of which sender, and when (ms).
type Taken = (String, u64, u64, i64);

static TAKEN: Mutex<BTreeMap<String, Vec<Taken>>> = Mutex::new(BTreeMap::new());
/// How many messages could not be sent, of each test.
static UNSENT: Mutex<BTreeMap<String, u64>> = Mutex::new(BTreeMap::new());

fn taken(test: &str) -> Vec<Taken> {
    TAKEN.lock().unwrap().get(test).cloned().unwrap_or_default()
}

/// Which numbers a worker took.
fn numbers(test: &str, worker: &str) -> Vec<u64> {
    let taken = taken(test);
    taken.iter().filter(|(who, ..)| who == worker).map(|(_, number, ..)| *number).collect()
}

/// Puts numbered work into a queue.
#[derive(Agent)]
struct Feeder {
    /// The number of the work, and that of the sender.
    #[port(priorities = "urgent, normal")]
    work: Output<Twist>,
    params: FeederParams,
    number: u64,
}

/// How it does that.
#[derive(Clone, Debug, Params)]
struct FeederParams {
    /// The name of the test.
    test: String,
    /// Its own number.
    #[param(default = 0u32)]
    sender: u32,
    /// How much in one step.
    #[param(default = 1u32)]
    burst: u32,
    /// After so much there is no more.
    #[param(default = 1000000000u32)]
    most: u32,
    /// Every so many messages one is urgent; zero for none.
    #[param(default = 0u32)]
    urgent: u32,
    /// Of what time they speak, from now on (ms).
    #[param(default = 0)]
    ahead: i64,
}

impl Agent for Feeder {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        if !self.work.has_listeners() {
            return Ok(());
        }
        let FeederParams { sender, burst, most, urgent, ahead, .. } = self.params;
        if urgent > 0 {
            for _ in 0..burst {
                self.number += 1;
                let priority = if self.number.is_multiple_of(urgent.into()) {
                    Priority::Urgent
                } else {
                    Priority::Normal
                };
                let work = Twist::new(self.number as f64, f64::from(sender));
                let stamp = Some(step.now + Duration::millis(ahead));
                self.work.send_as(Envelope { priority, stamp, ..Envelope::default() }, work);
            }
            return Ok(());
        }
        let mut room = [Twist::default(); 64];
        let burst = u64::from(burst).min(u64::from(most).saturating_sub(self.number)) as usize;
        for (i, work) in room[..burst].iter_mut().enumerate() {
            *work = Twist::new((self.number + 1 + i as u64) as f64, f64::from(sender));
        }
        let unsent = self.work.send_all(&room[..burst]).len();
        self.number += (burst - unsent) as u64;
        if unsent > 0 {
            *UNSENT.lock().unwrap().entry(self.params.test.clone()).or_default() += unsent as u64;
        }
        Ok(())
    }
}

/// Takes work and writes down what.
#[derive(Agent)]
struct Worker {
    /// What is to be done.
    work: Input<Twist>,
    params: WorkerParams,
}

/// Who it is, and how it works.
#[derive(Clone, Debug, Params)]
struct WorkerParams {
    /// The name of the test.
    test: String,
    /// Its own name.
    name: String,
    /// How many it takes in one step; zero for all there are.
    #[param(default = 1u32)]
    each: u32,
    /// It panics when it has taken a multiple of this.
    #[param(default = 0u32)]
    breaks: u32,
}

impl Agent for Worker {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        let mut left = if self.params.each == 0 { u32::MAX } else { self.params.each };
        while left > 0
            && let Some(work) = self.work.take()
        {
            left -= 1;
            let (number, sender) = (work.linear as u64, work.angular as u64);
            let entry = (self.params.name.clone(), number, sender, step.now.0 / 1_000_000);
            TAKEN.lock().unwrap().entry(self.params.test.clone()).or_default().push(entry);
            assert!(
                self.params.breaks == 0 || !number.is_multiple_of(self.params.breaks.into()),
                "this is too hard"
            );
        }
        Ok(())
    }
}

/// Looks whether there is work, and leaves it.
#[derive(Agent)]
struct Idler {
    /// What is to be done.
    work: Input<Twist>,
}

impl Agent for Idler {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        assert!(self.work.has_message() || !self.work.has_message());
        Ok(())
    }
}

/// Takes pictures.
#[derive(Agent)]
struct Viewer {
    /// Pictures.
    picture: Input<Image>,
}

impl Agent for Viewer {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.picture.newest();
        Ok(())
    }
}

fn types() -> Registry {
    registry![Feeder, Worker, Idler, Painter, Viewer]
}

fn feeder(test: &str) -> FeederParams {
    FeederParams { test: test.to_owned(), sender: 0, burst: 1, most: 1_000_000_000, urgent: 0, ahead: 0 }
}

fn worker(test: &str, name: &str) -> WorkerParams {
    WorkerParams { test: test.to_owned(), name: name.to_owned(), each: 1, breaks: 0 }
}

/// One who finds work every 10 ms, a queue, and workers on executors of falling priority.
fn plan(test: &str, workers: &[(&str, &str)]) -> Plan {
    let mut plan = Plan::new(test);
    let from = plan.add::<Feeder>("feeder", feeder(test));
    plan.every("feeder", Duration::millis(10));
    plan.agent_mut("feeder").unwrap().executor = Some("vision".into());
    let work = plan.queue::<Twist>("work");
    plan.wire(&from.work, &work);
    for (name, executor) in workers {
        let to = plan.add::<Worker>(name, worker(test, name));
        plan.wire(&work, &to.work);
        plan.on(name, "work");
        let agent = plan.agent_mut(name).unwrap();
        (agent.executor, agent.hang_after) = (Some((*executor).into()), Some(Duration::millis(50)));
    }
    plan
}

const THREE: [(&str, &str); 3] = [("low", "ordinary"), ("high", "reflex"), ("middle", "control")];

fn simulate(plan: &Plan, millis: i64) -> Report {
    let report = Simulation::new(plan, &types(), options(millis)).unwrap().run().unwrap();
    balanced(&report.view);
    report
}

/// What was put in was taken or waits still: nothing is lost and nothing doubled, as far as it is counted.
fn balanced(view: &SystemView) {
    for queue in view.queues.iter().filter(|queue| queue.overload == Overload::Refuse) {
        assert_eq!(queue.sent, queue.taken + queue.waiting as u64, "{queue:?}");
    }
}

/// The same as far as it is seen: each number of each sender once, and those of one sender in order of taking.
fn once_and_in_order(test: &str, sent: u64, waiting: u64) {
    let taken = taken(test);
    let mut of_sender: BTreeMap<u64, Vec<u64>> = BTreeMap::new();
    for (_, number, sender, _) in &taken {
        of_sender.entry(*sender).or_default().push(*number);
    }
    for (sender, numbers) in of_sender {
        let expected: Vec<u64> = (1..=numbers.len() as u64).collect();
        assert_eq!(numbers, expected, "of sender {sender}");
    }
    assert_eq!(taken.len() as u64 + waiting, sent);
}

#[test]
fn of_those_who_wait_the_one_of_highest_priority_gets_the_message() {
    let mut usual = plan("highest", &THREE);
    simulate(&usual, 200);
    assert_eq!(numbers("highest", "high"), (1..=21).collect::<Vec<_>>(), "that of its executor");
    let low = usual.wires.iter_mut().find(|wire| wire.to == "low.work").unwrap();
    low.serving = Some(99);
    usual.agents.iter_mut().for_each(|agent| agent.params.set("test", Value::from("chosen")));
    let report = simulate(&usual, 200);
    assert_eq!(numbers("chosen", "low"), (1..=21).collect::<Vec<_>>(), "that which is chosen");
    let receivers: Vec<_> =
        report.view.queues[0].receivers.iter().map(|to| (to.to.as_str(), to.serving)).collect();
    assert_eq!(receivers, [("low.work", 99), ("high.work", 70), ("middle.work", 60)]);
}

#[test]
fn of_equals_the_first_in_the_data_flow_is_called() {
    let mut equals = plan("equals", &[("b", "control"), ("a", "control"), ("c", "control")]);
    simulate(&equals, 100);
    assert_eq!(numbers("equals", "a"), (1..=11).collect::<Vec<_>>());
    // One that sends to the others goes before them.
    let from = equals.add::<Feeder>("d", FeederParams { sender: 1, most: 0, ..feeder("equals-flow") });
    equals.wires.push(WirePlan::new(from.work.name, "b.work"));
    equals.every("d", Duration::millis(10));
    equals.agents.iter_mut().for_each(|agent| agent.params.set("test", Value::from("equals-flow")));
    simulate(&equals, 100);
    assert_eq!(numbers("equals-flow", "a"), (1..=11).collect::<Vec<_>>());
}

#[test]
fn who_must_wait_passes_the_message_on_at_once() {
    let mut plan = plan("gap", &THREE);
    plan.agent_mut("high").unwrap().min_gap = Duration::millis(25);
    simulate(&plan, 100);
    let when = |name: &str| -> Vec<i64> {
        taken("gap").iter().filter(|(who, ..)| who == name).map(|(.., at)| *at).collect()
    };
    assert_eq!(when("high"), [0, 30, 60, 90]);
    assert_eq!(when("middle"), [10, 20, 40, 50, 70, 80, 100], "at the instant at which it was sent");
    once_and_in_order("gap", 11, 0);
}

#[test]
fn a_burst_is_shared_among_those_who_wait_and_the_rest_is_worked_off() {
    let mut plan = plan("burst", &THREE);
    plan.agent_mut("feeder").unwrap().params.set("burst", Value::from(8));
    simulate(&plan, 5);
    // In simulated time the highest goes on until nothing is left; but all were called.
    once_and_in_order("burst", 8, 0);
    assert!(taken("burst").iter().all(|(.., at)| *at == 0));
    let mut same = plan.clone();
    same.agents.iter_mut().for_each(|agent| agent.params.set("test", Value::from("burst-again")));
    simulate(&same, 5);
    let who = |test: &str| taken(test).into_iter().map(|(who, number, ..)| (who, number)).collect::<Vec<_>>();
    assert_eq!(who("burst"), who("burst-again"), "the same run makes the same choices");
}

#[test]
fn messages_are_taken_by_priority_then_stamp_then_sender() {
    let mut plan = plan("order", &[]);
    let params = FeederParams { burst: 4, urgent: 3, ..feeder("order") };
    for (name, sender, ahead) in [("second", 2, 20), ("first", 1, 20), ("early", 3, 15)] {
        let from = plan.add::<Feeder>(name, FeederParams { sender, ahead, ..params.clone() });
        plan.wires.push(WirePlan::new(from.work.name, "work"));
        plan.every(name, Duration::millis(1000));
    }
    plan.agents.retain(|agent| agent.name != "feeder");
    plan.wires.retain(|wire| wire.from != "feeder.work");
    // It goes last, and finds everything there.
    let to = plan.add::<Worker>("worker", WorkerParams { each: 0, ..worker("order", "worker") });
    plan.wires.push(WirePlan::new("work", to.work.name));
    plan.every("worker", Duration::millis(50));
    plan.agent_mut("worker").unwrap().executor = Some("ordinary".into());
    simulate(&plan, 60);
    let order: Vec<(u64, u64)> =
        taken("order").iter().map(|(_, number, sender, _)| (*sender, *number)).collect();
    // Numbers of agents go by their place in the plan: second, first, early.
    let urgent = [(3, 3), (2, 3), (1, 3)];
    let normal = [(3, 1), (3, 2), (3, 4), (2, 1), (2, 2), (2, 4), (1, 1), (1, 2), (1, 4)];
    assert_eq!(order, [&urgent[..], &normal[..]].concat());
}

#[test]
fn what_has_no_room_is_told_to_its_sender() {
    let mut plan = plan("full", &[("worker", "control")]);
    plan.queue_mut("work").unwrap().depth = Some(4);
    plan.agent_mut("feeder").unwrap().params.set("burst", Value::from(10));
    // Three at a time, every 10 ms; the feeder has ten.
    let agent = plan.agent_mut("worker").unwrap();
    agent.on.clear();
    agent.period = Some(Duration::millis(10));
    agent.params.set("each", Value::from(3));
    let report = simulate(&plan, 100);
    let queue = &report.view.queues[0];
    assert_eq!((queue.sent, queue.refused, queue.waiting), (4 + 10 * 3, 0, 4));
    assert_eq!(UNSENT.lock().unwrap()["full"], 6 + 10 * 7);
    once_and_in_order("full", queue.sent, 4);

    // Who does not ask is refused, and who wants the newest gets it.
    for (policy, sent, refused, dropped) in
        [(Overload::Refuse, 4, 6, 0), (Overload::OldestWins, 4, 0, 6), (Overload::NewestWins, 10, 0, 6)]
    {
        let mut plan = plan.clone();
        plan.agents.retain(|agent| agent.name == "feeder");
        plan.wires.retain(|wire| wire.to == "work");
        plan.queue_mut("work").unwrap().overload = Some(policy);
        plan.agent_mut("feeder").unwrap().params.set("urgent", Value::from(100));
        let queue = &simulate(&plan, 5).view.queues[0];
        assert_eq!(
            (queue.sent, queue.refused, queue.dropped, queue.waiting),
            (sent, refused, dropped, 4),
            "{policy:?}"
        );
    }
}

#[test]
fn what_a_queue_holds_outlives_its_senders_and_receivers() {
    let mut plan = plan("outlives", &[("worker", "control")]);
    plan.queue_mut("work").unwrap().depth = Some(64);
    plan.requests = vec![
        at(45, "unwire work worker.work"),
        at(95, "remove feeder"),
        at(96, "remove work"),
        at(105, "wire work worker.work"),
        at(115, "unwire work worker.work"),
        at(116, "remove work"),
        at(117, "queue work"),
        at(118, "queue worker"),
    ];
    let report = simulate(&plan, 200);
    let when: Vec<(u64, i64)> = taken("outlives").iter().map(|(_, number, _, at)| (*number, *at)).collect();
    let first = (1..=5).map(|number| (number, 10 * (number as i64 - 1)));
    let later = (6..=10).map(|number| (number, 105));
    assert_eq!(when, first.chain(later).collect::<Vec<_>>());
    let said: Vec<&str> = report.incidents.iter().map(|incident| incident.what.as_str()).collect();
    let refused = said.iter().filter(|what| what.contains("refused")).collect::<Vec<_>>();
    assert_eq!(
        refused,
        [
            &"asked: remove work; refused: 5 messages wait in queue \"work\"; wire it to an input that takes them",
            &"asked: queue worker; refused: there is already something called \"worker\"; names are given once",
        ]
    );
    assert_eq!(report.view.queues.len(), 1);
}

#[test]
fn a_dead_worker_keeps_nothing_from_the_others() {
    for kind in ["panic", "hang", "off", "slow"] {
        let test = format!("dead-{kind}");
        let mut plan = plan(&test, &THREE);
        plan.requests = vec![at(45, &format!("fault high {kind}"))];
        if matches!(kind, "off" | "slow") {
            plan.requests.push(at(145, "fault high ok"));
        }
        let report = simulate(&plan, 1000);
        once_and_in_order(&test, 101, 0);
        let incidents = &report.incidents;
        let late: Vec<_> = taken(&test)
            .iter()
            .filter(|(_, number, _, at)| *at != 10 * (*number as i64 - 1))
            .cloned()
            .collect();
        if kind == "hang" {
            // It was called for the sixth and nobody knows yet; who is called for the next one takes both.
            assert_eq!(late, [("middle".to_owned(), 6, 0, 60)], "{incidents:?}");
        } else {
            assert_eq!(late, [], "{kind}: {incidents:?}");
        }
        let back = numbers(&test, "high");
        assert!(
            back.contains(&5) && !back.contains(&6) && back.contains(&101),
            "{kind}: {back:?} {incidents:?}"
        );
        // Whoever dies of each message leaves the next one to others all the same.
        assert!(numbers(&test, "low").is_empty(), "{kind}");
    }
}

#[test]
fn a_hung_sender_leaves_what_it_sent_and_sends_no_more() {
    let mut plan = plan("hung-sender", &THREE);
    plan.agent_mut("feeder").unwrap().hang_after = Some(Duration::millis(50));
    plan.requests = vec![at(45, "fault feeder hang")];
    let report = simulate(&plan, 1000);
    let view = &report.view.queues[0];
    assert_eq!(view.taken, view.sent);
    let feeder = report.view.agents.iter().find(|agent| agent.name == "feeder").unwrap();
    assert_eq!(feeder.counts.hangs, 1, "{:?}", report.incidents);
    // It begins anew when it comes back.
    let numbers = numbers("hung-sender", "high");
    let anew = numbers.iter().rposition(|number| *number == 1).unwrap();
    let counts = |numbers: &[u64]| numbers.iter().zip(1..).all(|(a, b)| *a == b);
    assert!(anew >= 5 && numbers.len() > 50, "{numbers:?}");
    assert!(counts(&numbers[..anew]) && counts(&numbers[anew..]), "{numbers:?}");
}

#[test]
fn who_does_not_take_what_is_there_does_not_keep_it_from_others() {
    let mut plan = plan("idler", &[("worker", "ordinary")]);
    let idler = plan.add::<Idler>("idler", Default::default());
    plan.wires.push(WirePlan { serving: Some(90), ..WirePlan::new("work", idler.work.name) });
    plan.on("idler", "work");
    plan.agent_mut("idler").unwrap().executor = Some("reflex".into());
    let report = simulate(&plan, 100);
    let late: Vec<_> =
        taken("idler").into_iter().filter(|(_, number, _, at)| *at != 10 * (*number as i64 - 1)).collect();
    assert_eq!(late, []);
    once_and_in_order("idler", 11, 0);
    let idler = report.view.agents.iter().find(|agent| agent.name == "idler").unwrap();
    assert_eq!(
        idler.counts.releases, 1,
        "after that the other one waits for each message, and is called first"
    );
}

#[test]
fn an_input_of_a_queue_may_have_wires_of_its_own() {
    let mut plan = plan("both", &THREE[..2]);
    let own = plan.add::<Feeder>("own", FeederParams { sender: 7, ..feeder("both") });
    plan.wires.push(WirePlan::new(own.work.name, "low.work"));
    plan.every("own", Duration::millis(10));
    plan.agent_mut("own").unwrap().executor = Some("vision".into());
    let report = simulate(&plan, 100);
    let of = |worker: &str, sender: u64| -> Vec<u64> {
        let taken = taken("both");
        let own = taken.iter().filter(|(who, _, from, _)| who == worker && *from == sender);
        own.map(|(_, number, ..)| *number).collect()
    };
    let all: Vec<u64> = (1..=11).collect();
    assert_eq!((of("low", 7), of("high", 0)), (all.clone(), all));
    assert_eq!(of("low", 0), [0u64; 0]);
    let wires = report
        .view
        .wires
        .iter()
        .map(|wire| format!("{} {} {} {}", wire.from, wire.to, wire.sent, wire.taken));
    assert_eq!(
        wires.collect::<Vec<_>>(),
        ["own.work low.work 11 11", "feeder.work work 11 0", "work low.work 0 0", "work high.work 0 11"]
    );
}

#[test]
fn what_cannot_be_wired_to_a_queue_is_refused_in_one_sentence() {
    let base = || {
        let mut plan = plan("refused", &[("worker", "control")]);
        plan.add::<Painter>("painter", Default::default());
        plan.add::<Viewer>("viewer", Default::default());
        plan.every("painter", Duration::millis(10));
        plan.on("viewer", "picture");
        plan
    };
    let wire = |from: &str, to: &str| WirePlan::new(from, to);
    let mut filtered = wire("work", "worker.work");
    filtered.filter.marker = Some(3);
    let cases: [(WirePlan, &str); 8] = [
        (
            wire("painter.picture", "work"),
            "painter.picture has Image: large messages lie in the memory of their sender",
        ),
        (wire("work", "viewer.picture"), "viewer.picture has Image"),
        (wire("work", "work"), "work and work are both queues"),
        (wire("work", "feeder.work"), "feeder.work is an output, and work is a queue"),
        (wire("worker.work", "work"), "worker.work is an input, and work is a queue"),
        (
            WirePlan { depth: Some(3), ..wire("feeder.work", "work") },
            "depth and overload are those of queue \"work\"",
        ),
        (filtered, "has a filter: what it kept out would stand in everybody's way"),
        (
            WirePlan { serving: Some(3), ..wire("feeder.work", "worker.work") },
            "\"serving\" is for wires out of a queue, and feeder.work is none",
        ),
    ];
    for (wrong, expected) in cases {
        let mut plan = base();
        plan.wires.retain(|wire| (&wire.from, &wire.to) != (&wrong.from, &wrong.to));
        plan.wires.push(wrong.clone());
        let said: Vec<String> = runtime::check(&plan, &types()).iter().map(ToString::to_string).collect();
        assert!(said.len() == 1 && said[0].contains(expected), "{wrong:?}: {said:?}");
        // A running system says the same.
        plan.wires.pop();
        let simulation = Simulation::new(&plan, &types(), Options { limit: None, ..options(0) }).unwrap();
        let control = simulation.control();
        let asker = std::thread::Builder::new().spawn(move || {
            let said = control.request(Request::Wire(wrong));
            control.request(Request::Quit).unwrap();
            said
        });
        simulation.run().unwrap();
        let refusal = asker.unwrap().join().unwrap().unwrap_err();
        assert!(refusal.what.contains(expected), "{refusal}");
    }
}

/// Any changes, in simulated time: who sends and who takes comes, goes, panics and hangs.
#[test]
fn each_message_is_taken_once_whoever_comes_goes_dies_and_hangs() {
    for seed in 0..20 {
        let test = format!("storm-{seed}");
        let mut plan = plan(&test, &THREE);
        plan.queue_mut("work").unwrap().depth = Some(512);
        for agent in &mut plan.agents {
            (agent.params).set("each", Value::from(1 + seed as i64 % 3));
        }
        plan.agents[0].params = FeederParams { burst: 2, ..feeder(&test) }.to_table();
        let second = plan.add::<Feeder>("second", FeederParams { sender: 1, burst: 3, ..feeder(&test) });
        plan.wires.push(WirePlan::new(second.work.name, "work"));
        plan.every("second", Duration::millis(7));
        for i in 0..100 {
            let draws = Stream::new(seed, "storm").sample(i);
            let who = ["low", "high", "middle"][draws.index(0, 3)];
            let from = ["feeder", "second"][draws.index(1, 2)];
            let words = match draws.index(2, 8) {
                0 => format!("fault {who} panic"),
                1 => format!("fault {who} hang"),
                2 => format!("unwire work {who}.work"),
                3 | 4 => format!("wire work {who}.work"),
                5 => format!("unwire {from}.work work"),
                6 => format!("wire {from}.work work"),
                _ => format!("restart {who}"),
            };
            plan.requests.push(at(10 * i as i64 + draws.index(3, 10) as i64, &words));
        }
        plan.requests.sort_by_key(|request| request.at);
        let report = simulate(&plan, 1100);
        let queue = &report.view.queues[0];
        assert!(queue.sent > 50, "{queue:?}");
        // A worker that panics does so before it takes; what was taken was written down.
        once_and_in_order(&test, queue.sent, queue.waiting as u64);
    }
}

/// A machine that is busy with other things makes nobody hang.
fn patient(plan: &mut Plan) {
    for agent in &mut plan.agents {
        let is_worker = agent.kind == "worker";
        agent.hang_after = Some(if is_worker { Duration::secs(1) } else { Duration::secs(60) });
    }
}

/// Ends when everything was taken.
struct AllTaken {
    test: &'static str,
    most: usize,
    looks: u32,
}

impl runtime::Observer for AllTaken {
    fn every(&self) -> Duration {
        Duration::millis(10)
    }
    fn observe(&mut self, _: types::Time, _: &[runtime::Incident]) -> runtime::Verdict {
        self.looks += 1;
        // Something is wrong after a minute.
        if taken(self.test).len() >= self.most || self.looks > 6000 {
            runtime::Verdict::End("everything was taken".into())
        } else {
            runtime::Verdict::GoOn
        }
    }
}

#[test]
fn on_the_wall_clock_each_message_is_taken_once_while_workers_come_and_go_and_die() {
    const MOST: u32 = 2000;
    let test = "wall-queue";
    let mut plan = plan(test, &THREE);
    plan.queue_mut("work").unwrap().depth = Some(1024);
    plan.agents[0].params = FeederParams { burst: 2, most: MOST, ..feeder(test) }.to_table();
    plan.every("feeder", Duration::millis(1));
    let second =
        plan.add::<Feeder>("second", FeederParams { sender: 1, burst: 2, most: MOST, ..feeder(test) });
    plan.wires.push(WirePlan::new(second.work.name, "work"));
    plan.every("second", Duration::millis(1));
    plan.agent_mut("second").unwrap().executor = Some("receive".into());
    patient(&mut plan);
    // The highest dies of some work that it has taken.
    plan.agent_mut("high").unwrap().params.set("breaks", Value::from(500));
    let observer = Box::new(AllTaken { test, most: 2 * MOST as usize, looks: 0 });
    let options = Options { limit: None, observer, ..options(0) };
    let live = Live::new(&plan, &types(), options).unwrap();
    let control = live.control();
    let done = Arc::<AtomicBool>::default();
    let asking = done.clone();
    let asker = std::thread::Builder::new().name("asker".into()).spawn(move || {
        let (mut asked, mut hangs) = (0, 0);
        for words in [
            "unwire work high.work",
            "wire work high.work",
            "unwire work middle.work",
            "restart low",
            "wire work middle.work",
            "fault middle hang",
            "unwire feeder.work work",
            "wire feeder.work work",
        ]
        .iter()
        .cycle()
        {
            if asking.load(Ordering::Acquire) {
                break;
            }
            // However long the run takes: after more than four steps that did not return a system ends.
            if words.ends_with("hang") {
                hangs += 1;
                if hangs > 2 {
                    continue;
                }
            }
            let words: Vec<String> = words.split(' ').map(str::to_owned).collect();
            // One who is in a hang is not there to be asked.
            asked += u64::from(control.request(parse(&words).unwrap()).is_ok());
            let before = taken("wall-queue").len();
            for _ in 0..100 {
                if taken("wall-queue").len() > before + 20 || control.view().is_err() {
                    break;
                }
                std::thread::yield_now();
            }
        }
        asked
    });
    let report = live.run().unwrap();
    done.store(true, Ordering::Release);
    let asked = asker.unwrap().join().unwrap();
    assert!(asked > 8, "{asked}");
    assert_eq!(report.ended, "everything was taken");
    balanced(&report.view);
    let mut of_sender: BTreeMap<u64, Vec<u64>> = BTreeMap::new();
    for (_, number, sender, _) in taken(test) {
        of_sender.entry(sender).or_default().push(number);
    }
    for (sender, mut numbers) in of_sender {
        // They are written down by several: the order is that of writing.
        numbers.sort_unstable();
        assert_eq!(numbers, (1..=u64::from(MOST)).collect::<Vec<_>>(), "of sender {sender}");
    }
}

#[test]
fn on_the_wall_clock_the_highest_who_waits_gets_nearly_all_of_a_slow_stream() {
    let test = "wall-highest";
    let mut plan = plan(test, &THREE);
    plan.agents[0].params = FeederParams { most: 100, ..feeder(test) }.to_table();
    plan.every("feeder", Duration::millis(2));
    patient(&mut plan);
    let observer = Box::new(AllTaken { test, most: 100, looks: 0 });
    let report =
        Live::new(&plan, &types(), Options { limit: None, observer, ..options(0) }).unwrap().run().unwrap();
    balanced(&report.view);
    assert_eq!(taken(test).len(), 100);
    // On a machine that is busy it may still be at work with the last one when the next one comes.
    let of = |who| numbers(test, who).len();
    assert!(of("high") > of("middle") + of("low"), "{} {} {}", of("high"), of("middle"), of("low"));
}
