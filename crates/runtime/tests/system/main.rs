//! Whole systems, in simulated time and on the wall clock.

#![allow(clippy::unwrap_used)] // a test may

mod calls;
mod cuts;
mod deaths;
mod fire;
mod memory;
mod queues;
mod stuck;
mod successor;
mod thousand;
mod wall;

use runtime::{
    Agent, Client, Direction, Envelope, Fault, FaultKind, Input, Options, Output, Params, Plan, QueuePlan,
    Refusal, Registry, Reply, Request, Service, Simulation, Step, TimedRequest, WirePlan, registry,
};
use std::sync::{Arc, Mutex};
use types::messages::{Image, Twist};
use types::value::{Span, Value};
use types::{AgentId, Duration, Time};

/// Counts up.
#[derive(Agent)]
struct Source {
    /// The count, as a speed.
    out: Output<Twist>,
    params: SourceParams,
    n: f64,
}

/// How it counts.
#[derive(Clone, Debug, Params)]
struct SourceParams {
    /// By how much.
    #[param(default = 1.0, min = 0.0)]
    by: f64,
}

impl Agent for Source {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.n += self.params.by;
        self.out.send(Twist::new(self.n, 0.0));
        Ok(())
    }
}

/// Passes on what comes, turned by one.
#[derive(Agent)]
struct Relay {
    /// What comes.
    from: Input<Twist>,
    /// What goes.
    to: Output<Twist>,
}

impl Agent for Relay {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while let Some(twist) = self.from.take() {
            let on = Twist::new(twist.linear, twist.angular + 1.0);
            self.to.send(on);
        }
        Ok(())
    }
}

static HEARD: Mutex<Vec<(String, Time, Twist)>> = Mutex::new(Vec::new());

/// Writes down what comes, under a name of its own.
#[derive(Agent)]
struct Sink {
    /// What comes.
    count: Input<Twist>,
    params: SinkParams,
}

/// Under which name.
#[derive(Clone, Debug, Default, Params)]
struct SinkParams {
    /// The name of the test.
    test: String,
}

impl Agent for Sink {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        while let Some(twist) = self.count.take() {
            HEARD.lock().unwrap().push((self.params.test.clone(), step.now, *twist));
        }
        Ok(())
    }
}

fn heard(test: &str) -> Vec<(Time, Twist)> {
    let heard = HEARD.lock().unwrap();
    heard.iter().filter(|(name, _, _)| name == test).map(|(_, time, twist)| (*time, *twist)).collect()
}

fn sink(test: &str) -> SinkParams {
    SinkParams { test: test.to_owned() }
}

fn parse(words: &[String]) -> Result<Request, Refusal> {
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    Ok(match words[..] {
        ["fault", target, kind] => Request::Fault {
            target: target.into(),
            fault: FaultKind::named(kind).ok_or_else(|| Refusal::new("no such fault"))?,
        },
        ["set", agent, key, value] => {
            Request::Set { agent: agent.into(), key: key.into(), value: runtime::value_of(value) }
        }
        ["replace", agent, kind, ref more @ ..] => {
            let mut params = types::value::Table::default();
            more.iter().for_each(|key| params.set(key, Value::from(true)));
            Request::Replace { agent: agent.into(), kind: kind.into(), params }
        }
        ["queue", name] => Request::Queue(QueuePlan::new(name)),
        ["remove", agent] => Request::Remove(agent.into()),
        ["restart", agent] => Request::Restart(agent.into()),
        ["unwire", from, to] => Request::Unwire { from: from.into(), to: to.into() },
        ["wire", from, to] => Request::Wire(WirePlan::new(from, to)),
        _ => return Err(Refusal::new("no such request")),
    })
}

fn at(millis: i64, words: &str) -> TimedRequest {
    let words = words.split(' ').map(str::to_owned).collect();
    TimedRequest { at: Duration::millis(millis), words, place: Span::default() }
}

fn options(millis: i64) -> Options {
    Options { limit: Some(Duration::millis(millis)), parse, ..Options::default() }
}

fn types() -> Registry {
    registry![Source, Relay, Sink, Asker, Answerer, Loop, Painter, Viewer, Postman]
}

/// source → relay → sink, the source every 10 ms.
fn chain(test: &str) -> Plan {
    let mut plan = Plan::new(test);
    let source = plan.add::<Source>("source", SourceParams::default());
    let relay = plan.add::<Relay>("relay", Default::default());
    let end = plan.add::<Sink>("sink", sink(test));
    plan.wire(&source.out, &relay.from);
    plan.wire(&relay.to, &end.count);
    plan.every("source", Duration::millis(10));
    plan.on("relay", "from");
    plan.on("sink", "count");
    plan
}

#[test]
fn a_chain_delivers_each_message_once_in_order_at_the_instant_it_was_sent() {
    let report = Simulation::new(&chain("chain"), &types(), options(1000)).unwrap().run().unwrap();
    let heard = heard("chain");
    assert_eq!(heard.len(), 101);
    for (i, (time, twist)) in heard.iter().enumerate() {
        assert_eq!(
            (*time, *twist),
            (Time::ZERO + Duration::millis(10 * i as i64), Twist::new(i as f64 + 1.0, 1.0))
        );
    }
    assert_eq!(report.ended, "the time is over");
    assert!(
        report.view.wires.iter().all(|wire| (wire.sent, wire.dropped, wire.taken) == (101, 0, 101)),
        "{:?}",
        report.view.wires
    );
}

#[test]
fn a_panic_is_survived_and_the_agent_comes_back() {
    let mut plan = chain("panic");
    plan.requests = vec![at(200, "fault relay panic")];
    let report = Simulation::new(&plan, &types(), options(1000)).unwrap().run().unwrap();
    let relay = report.view.agents.iter().find(|agent| agent.name == "relay").unwrap();
    assert_eq!((relay.counts.panics, relay.counts.restarts), (1, 1));
    assert!(relay.last_death.as_ref().unwrap().contains("asked to panic"), "{:?}", relay.last_death);
    let source = report.view.agents.iter().find(|agent| agent.name == "source").unwrap();
    assert_eq!(source.counts.releases, 101, "the others miss nothing");
    let numbers: Vec<i64> = heard("panic").iter().map(|(_, twist)| twist.linear as i64).collect();
    // It was dead for 0.1 s: ten messages wait in its mailbox of sixteen, and none is lost.
    assert_eq!(numbers, (1..=101).collect::<Vec<_>>());
}

#[test]
fn a_step_that_hangs_is_given_up_and_the_agent_comes_back() {
    let mut plan = chain("hang");
    plan.requests = vec![at(200, "fault relay hang")];
    plan.agent_mut("relay").unwrap().executor = Some("reflex".into());
    let report = Simulation::new(&plan, &types(), options(2000)).unwrap().run().unwrap();
    let relay = report.view.agents.iter().find(|agent| agent.name == "relay").unwrap();
    assert_eq!((relay.counts.hangs, relay.counts.restarts), (1, 1), "{:?}", report.incidents);
    assert!(heard("hang").last().unwrap().0 > Time::from_seconds(1.9));
}

#[test]
fn an_agent_that_dies_again_and_again_is_left_dead() {
    let mut plan = chain("again");
    plan.requests = (0..60).map(|i| at(100 + i * 400, "fault relay panic")).collect();
    let report = Simulation::new(&plan, &types(), options(30_000)).unwrap().run().unwrap();
    let relay = report.view.agents.iter().find(|agent| agent.name == "relay").unwrap();
    assert_eq!(relay.counts.restarts, 5, "{:?}", report.incidents);
    assert_eq!(relay.state.name(), "dead");
}

#[test]
fn a_filter_for_every_third_message_counts_each_message_once() {
    for (test, wires) in [("every-alone", 1), ("every-beside", 2)] {
        let mut plan = chain(test);
        let to_relay = plan.wires.iter_mut().find(|wire| wire.to == "relay.from").unwrap();
        to_relay.filter.every = 3;
        if wires == 2 {
            // A second route takes the other way through the output.
            plan.add::<Sink>("beside", sink("nobody asks"));
            plan.on("beside", "count");
            plan.wires.push(WirePlan::new("source.out", "beside.count"));
        }
        Simulation::new(&plan, &types(), options(100)).unwrap().run().unwrap();
        let numbers: Vec<i64> = heard(test).iter().map(|(_, twist)| twist.linear as i64).collect();
        assert_eq!(numbers, [1, 4, 7, 10], "{test}");
    }
}

#[test]
fn a_least_gap_makes_an_agent_wait_for_messages_and_no_longer() {
    let mut plan = Plan::new("gap");
    let source = plan.add::<Source>("source", SourceParams::default());
    let end = plan.add::<Sink>("sink", sink("gap"));
    plan.wire(&source.out, &end.count);
    plan.every("source", Duration::millis(10));
    plan.on("sink", "count");
    plan.agent_mut("sink").unwrap().min_gap = Duration::millis(25);
    plan.requests = vec![
        at(105, "fault source off"),
        at(205, "fault source ok"),
        at(245, "set sink min_gap 0ms"),
        at(265, "fault source off"),
    ];
    let report = Simulation::new(&plan, &types(), options(400)).unwrap().run().unwrap();
    let heard: Vec<(i64, i64)> =
        heard("gap").iter().map(|(time, twist)| (time.0 / 1_000_000, twist.linear as i64)).collect();
    let expected = [
        // The first at once; then a step each 25 ms, which takes all that has come meanwhile, each message once.
        [(0, 1)].as_slice(),
        &[(25, 2), (25, 3)],
        &[(50, 4), (50, 5), (50, 6)],
        &[(75, 7), (75, 8)],
        &[(100, 9), (100, 10), (100, 11)],
        // After a pause longer than the gap nothing is waited for.
        &[(210, 12)],
        &[(235, 13), (235, 14)],
        // Without a gap the next message makes it run at once, and the step that was put off is not made up for.
        &[(245, 15)],
        &[(250, 16)],
        &[(260, 17)],
    ];
    assert_eq!(heard, expected.concat());
    let steps = &report.view.agents[1];
    assert_eq!(steps.counts.releases, expected.len() as u64, "no step without a message");
    assert_eq!((steps.counts.missed, steps.jitter.max), (0, 0.0), "waiting for the gap is not being late");
}

#[test]
fn a_least_gap_holds_for_messages_alone() {
    let mut plan = Plan::new("gap-period");
    let source = plan.add::<Source>("source", SourceParams::default());
    let end = plan.add::<Sink>("sink", sink("gap-period"));
    plan.wire(&source.out, &end.count);
    plan.every("source", Duration::millis(10));
    plan.on("sink", "count");
    plan.every("sink", Duration::millis(50));
    plan.agent_mut("sink").unwrap().min_gap = Duration::millis(30);
    let report = Simulation::new(&plan, &types(), options(199)).unwrap().run().unwrap();
    let mut steps: Vec<i64> = heard("gap-period").iter().map(|(time, _)| time.0 / 1_000_000).collect();
    steps.dedup();
    // By the clock at 0, 50, 100, 150; by messages 30 ms after the last step, whatever that was for.
    assert_eq!(steps, [0, 30, 50, 80, 100, 130, 150, 180]);
    assert_eq!(report.view.agents[1].counts.releases, steps.len() as u64);
}

/// Sends to the agents with the numbers 1 and 2 and to everybody, in turn.
#[derive(Agent)]
struct Postman {
    /// The count, as a speed.
    out: Output<Twist>,
    n: u32,
}

impl Agent for Postman {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.n += 1;
        let recipient = [AgentId::NONE, AgentId(1), AgentId(2)][self.n as usize % 3];
        let envelope = Envelope { recipient, ..Envelope::default() };
        self.out.send_as(envelope, Twist::new(f64::from(self.n), 0.0));
        Ok(())
    }
}

#[test]
fn a_filter_for_a_recipient_passes_what_is_for_it_or_for_everybody() {
    let mut plan = Plan::new("recipients");
    plan.add::<Postman>("postman", Default::default());
    plan.every("postman", Duration::millis(10));
    for (name, recipient) in [("one", Some("one")), ("two", Some("two")), ("all", None), ("spy", Some("one"))]
    {
        plan.add::<Sink>(name, sink(&format!("recipients-{name}")));
        plan.on(name, "count");
        let mut wire = WirePlan::new("postman.out", format!("{name}.count"));
        wire.filter.recipient = recipient.map(str::to_owned);
        plan.wires.push(wire);
    }
    plan.requests = vec![at(55, "remove one"), at(56, "unwire postman.out spy.count"), at(57, "remove one")];
    let report = Simulation::new(&plan, &types(), options(80)).unwrap().run().unwrap();
    let heard = |name: &str| -> Vec<f64> {
        heard(&format!("recipients-{name}")).iter().map(|(_, twist)| twist.linear).collect()
    };
    assert_eq!(heard("one"), [1.0, 3.0, 4.0, 6.0]);
    assert_eq!(heard("two"), [2.0, 3.0, 5.0, 6.0, 8.0, 9.0]);
    assert_eq!(heard("all"), (1..10).map(f64::from).collect::<Vec<_>>());
    assert_eq!(heard("spy"), heard("one"), "whoever is wired so hears what is for another");
    let said: Vec<&str> = report.incidents.iter().map(|incident| incident.what.as_str()).collect();
    let refused = "asked: remove one; refused: the wire from postman.out to spy.count takes what is for one";
    assert_eq!(
        said,
        [
            &format!("{refused}; cut that wire first"),
            "asked: unwire postman.out spy.count",
            "asked: remove one"
        ]
    );
    assert_eq!(report.view.wires[0].filter.recipient.as_deref(), Some("two"), "people see the name");

    plan.wires[0].filter.recipient = Some("oen".into());
    let said = Simulation::new(&plan, &types(), options(80)).map(drop).unwrap_err().to_string();
    assert_eq!(said, "the plan has 1 mistakes, the first: there is no agent \"oen\"; did you mean \"one\"?");
}

#[test]
fn who_was_given_up_comes_back_under_its_number_and_its_wires_go_on_counting() {
    let mut plan = Plan::new("recipient-back");
    plan.add::<Postman>("postman", Default::default());
    plan.every("postman", Duration::millis(10));
    for name in ["one", "two", "spy"] {
        let test = if name == "two" { "recipient-back-two".into() } else { format!("recipient-back-{name}") };
        plan.add::<Sink>(name, sink(&test));
        plan.on(name, "count");
        plan.agent_mut(name).unwrap().executor = Some(["reflex", "control", "vision"][name.len() % 3].into());
    }
    plan.agent_mut("one").unwrap().executor = Some("ordinary".into());
    for (to, recipient) in [("one", "one"), ("spy", "one"), ("two", "two")] {
        let mut wire = WirePlan::new("postman.out", format!("{to}.count"));
        wire.filter.recipient = Some(recipient.into());
        plan.wires.push(wire);
    }
    plan.requests = vec![at(105, "fault one hang")];
    let report = Simulation::new(&plan, &types(), options(3000)).unwrap().run().unwrap();
    let one = &report.view.agents[1];
    assert_eq!((one.id, one.counts.hangs, one.counts.restarts), (AgentId(1), 1, 1), "{:?}", report.incidents);
    let heard = |name: &str| -> Vec<f64> {
        heard(&format!("recipient-back-{name}")).iter().map(|(_, twist)| twist.linear).collect()
    };
    let all: Vec<f64> = (1..=301).filter(|n| n % 3 != 2).map(f64::from).collect();
    assert_eq!(heard("spy"), all, "whoever hears what is for it");
    let (first, last) = (heard("one")[0], heard("one").last().copied());
    assert_eq!((first, last), (all[0], all.last().copied()), "it hears again");
    let wire = &report.view.wires[0];
    assert_eq!(wire.sent + wire.refused, all.len() as u64, "{wire:?}");
    assert_eq!(wire.sent, wire.taken + wire.dropped, "what lay in its mailbox is counted: {wire:?}");
    assert_eq!(wire.taken, heard("one").len() as u64);
}

#[test]
fn an_output_misbehaves_as_it_is_asked_to() {
    let mut plan = chain("faults");
    let faults = ["stuck", "ok", "delayed", "ok", "off", "ok"];
    plan.requests = faults
        .iter()
        .enumerate()
        .map(|(i, kind)| at(95 + 100 * i as i64, &format!("fault source.out {kind}")))
        .collect();
    Simulation::new(&plan, &types(), options(700)).unwrap().run().unwrap();
    let heard: Vec<(i64, i64)> =
        heard("faults").iter().map(|(t, twist)| (t.0 / 1_000_000, twist.linear as i64)).collect();
    let at = |from: i64, to: i64| {
        heard.iter().filter(|(t, _)| (from..to).contains(t)).map(|(_, n)| *n).collect::<Vec<_>>()
    };
    assert_eq!(at(100, 195), [11; 10], "stuck at the first value of the fault");
    assert_eq!(at(200, 295), (21..=30).collect::<Vec<_>>(), "well again");
    assert_eq!(at(300, 395), (31..=37).collect::<Vec<_>>(), "three messages late");
    assert_eq!(at(500, 595), [], "off");
    assert_eq!(at(600, 695), (61..=70).collect::<Vec<_>>());
}

#[test]
fn wiring_changes_while_the_rest_runs() {
    let mut plan = chain("wiring");
    plan.requests = vec![
        at(205, "unwire source.out relay.from"),
        at(405, "wire source.out relay.from"),
        at(605, "remove relay"),
    ];
    let report = Simulation::new(&plan, &types(), options(1000)).unwrap().run().unwrap();
    let numbers: Vec<i64> = heard("wiring").iter().map(|(_, twist)| twist.linear as i64).collect();
    let expected: Vec<i64> = (1..=21).chain(42..=61).collect();
    assert_eq!(numbers, expected);
    assert_eq!(report.view.agents.len(), 2);
    assert!(report.view.wires.is_empty());
}

#[test]
fn a_parameter_and_a_period_change_between_steps() {
    let mut plan = chain("set");
    plan.requests = vec![at(95, "set source by 10"), at(195, "set source period 50ms")];
    Simulation::new(&plan, &types(), options(400)).unwrap().run().unwrap();
    let heard = heard("set");
    let numbers: Vec<i64> = heard.iter().map(|(_, twist)| twist.linear as i64).collect();
    assert_eq!(&numbers[..12], [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 20, 30]);
    let times: Vec<i64> = heard.iter().map(|(time, _)| time.0 / 1_000_000).filter(|t| *t >= 190).collect();
    assert_eq!(times, [190, 240, 290, 340, 390]);
}

#[test]
fn what_is_wrong_is_refused_with_the_reason_and_nothing_changes() {
    let mut plan = chain("refused");
    plan.requests = vec![
        at(10, "wire source.out sink.cuont"),
        at(20, "set source by -1"),
        at(30, "wire sorce.out sink.count"),
        at(40, "wire relay.from sink.count"),
    ];
    let report = Simulation::new(&plan, &types(), options(100)).unwrap().run().unwrap();
    let said: Vec<&str> = report.incidents.iter().map(|incident| incident.what.as_str()).collect();
    assert!(said[0].contains("there is no port of sink \"cuont\"; did you mean \"count\"?"), "{said:?}");
    assert!(said[1].contains("\"by\" must be at least 0, not -1"), "{said:?}");
    assert!(said[2].contains("did you mean \"source\"?"), "{said:?}");
    assert!(said[3].contains("relay.from is an input"), "{said:?}");
    assert_eq!(report.view.wires.len(), 2);
}

#[test]
fn all_mistakes_of_a_plan_are_found_at_once() {
    let mut plan = chain("mistakes");
    plan.agent_mut("source").unwrap().kind = "sorce".into();
    plan.agent_mut("relay").unwrap().on = vec!["frm".into()];
    plan.agent_mut("sink").unwrap().executor = Some("reflx".into());
    plan.wires.push(WirePlan::new("relay.to", "sink.counts"));
    plan.agent_mut("sink").unwrap().params.set("tset", Value::from("x"));
    let said: Vec<String> = runtime::check(&plan, &types()).iter().map(ToString::to_string).collect();
    for part in [
        "did you mean \"source\"?",
        "did you mean \"from\"?",
        "did you mean \"reflex\"?",
        "did you mean \"count\"?",
        "did you mean \"test\"?",
    ] {
        assert!(said.iter().any(|mistake| mistake.contains(part)), "{part} in {said:#?}");
    }
}

/// Asks every 100 ms.
#[derive(Agent)]
struct Asker {
    /// Half of a speed.
    half: Client<Twist, Twist>,
    /// What was answered; a negative speed for none in time.
    out: Output<Twist>,
    n: f64,
    next: Time,
}

impl Agent for Asker {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        while let Some((_, reply)) = self.half.reply() {
            self.out.send(match reply {
                Reply::Answer(half) => half,
                Reply::TimeOut => Twist::new(-1.0, 0.0),
            });
        }
        // The answer makes it run again at the same instant.
        if step.now >= self.next {
            self.next = step.now + Duration::millis(100);
            self.n += 2.0;
            let _ = self.half.call(Twist::new(self.n, 0.0), Duration::millis(30));
        }
        Ok(())
    }
}

/// Answers.
#[derive(Agent)]
struct Answerer {
    /// Half of a speed.
    half: Service<Twist, Twist>,
}

impl Agent for Answerer {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.half.serve(|twist| Twist::new(twist.linear / 2.0, 0.0));
        Ok(())
    }
}

#[test]
fn a_call_is_answered_or_its_time_out_comes_as_a_message() {
    let mut plan = Plan::new("calls");
    let asker = plan.add::<Asker>("asker", Default::default());
    let answerer = plan.add::<Answerer>("answerer", Default::default());
    let end = plan.add::<Sink>("sink", sink("calls"));
    plan.wire(&asker.half, &answerer.half);
    plan.wire(&asker.out, &end.count);
    plan.every("asker", Duration::millis(100));
    plan.on("answerer", "half");
    plan.on("sink", "count");
    plan.requests = vec![at(150, "fault answerer off")];
    // The answer comes from another executor than the one that waits for it.
    plan.agent_mut("answerer").unwrap().executor = Some("ordinary".into());
    Simulation::new(&plan, &types(), options(350)).unwrap().run().unwrap();
    let heard: Vec<(i64, f64)> =
        heard("calls").iter().map(|(time, twist)| (time.0 / 1_000_000, twist.linear)).collect();
    // Answers make the client run at once; without one, the time-out does.
    assert_eq!(heard, [(0, 1.0), (100, 2.0), (230, -1.0), (330, -1.0)]);
}

/// Sends to itself through another.
#[derive(Agent)]
struct Loop {
    /// What comes.
    from: Input<Twist>,
    /// What goes.
    to: Output<Twist>,
}

impl Agent for Loop {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while self.from.take().is_some() {}
        self.to.send(Twist::ZERO);
        Ok(())
    }
}

#[test]
fn an_endless_loop_at_one_instant_is_named() {
    let mut plan = Plan::new("loop");
    let ping = plan.add::<Loop>("ping", Default::default());
    let pong = plan.add::<Loop>("pong", Default::default());
    plan.wire(&ping.to, &pong.from);
    plan.wire(&pong.to, &ping.from);
    plan.every("ping", Duration::secs(1));
    plan.on("ping", "from");
    plan.on("pong", "from");
    let error = Simulation::new(&plan, &types(), options(2000)).unwrap().run().unwrap_err().to_string();
    assert!(error.contains("ping") && error.contains("pong"), "{error}");
}

/// Paints a picture.
#[derive(Agent)]
struct Painter {
    /// The picture.
    #[port(rows = 64, history = 4)]
    picture: Output<Image>,
    n: u8,
}

impl Agent for Painter {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.n += 1;
        let n = self.n;
        self.picture.send_with(|image, pixels| {
            (image.width, image.height) = (4, 4);
            pixels[..48].fill(n);
            48
        });
        Ok(())
    }
}

/// Looks at pictures.
#[derive(Agent)]
struct Viewer {
    /// The picture.
    picture: Input<Image>,
    /// What was seen, as a speed.
    out: Output<Twist>,
}

impl Agent for Viewer {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while let Some(picture) = self.picture.take() {
            assert_eq!(picture.row().len(), 48);
            let seen = Twist::new(f64::from(picture.row()[47]), f64::from(picture.width));
            drop(picture);
            self.out.send(seen);
        }
        Ok(())
    }
}

#[test]
fn a_picture_travels_by_link() {
    let mut plan = Plan::new("pictures");
    let painter = plan.add::<Painter>("painter", Default::default());
    let viewer = plan.add::<Viewer>("viewer", Default::default());
    let end = plan.add::<Sink>("sink", sink("pictures"));
    plan.wire(&painter.picture, &viewer.picture);
    plan.wire(&viewer.out, &end.count);
    plan.every("painter", Duration::millis(10));
    plan.on("viewer", "picture");
    plan.on("sink", "count");
    Simulation::new(&plan, &types(), options(100)).unwrap().run().unwrap();
    let seen: Vec<f64> = heard("pictures").iter().map(|(_, twist)| twist.linear).collect();
    assert_eq!(seen, (1..=11).map(f64::from).collect::<Vec<_>>());
}

#[derive(Default)]
struct Written(Arc<Mutex<Vec<u8>>>);

impl runtime::Recorder for Written {
    fn message(
        &mut self,
        topic: &str,
        _: &dyn Fn() -> types::definition::Definition,
        header: &types::Header,
        cdr: &[u8],
    ) {
        let mut bytes = self.0.lock().unwrap();
        bytes.extend_from_slice(topic.as_bytes());
        bytes.extend_from_slice(format!("{header:?}").as_bytes());
        bytes.extend_from_slice(cdr);
    }
    fn note(&mut self, time: Time, who: &str, text: &str) {
        self.0.lock().unwrap().extend_from_slice(format!("{time}{who}{text}").as_bytes());
    }
    fn finish(&mut self) {}
}

#[test]
fn two_runs_write_the_same_bytes() {
    let run = || {
        let mut plan = chain("bytes");
        plan.requests = vec![
            at(200, "fault relay panic"),
            at(300, "fault source.out intermittent"),
            at(500, "fault source.out wrong"),
        ];
        let bytes = Arc::<Mutex<Vec<u8>>>::default();
        let log = runtime::LogChoice::by(|_, _| 1);
        let options = Options { recorder: Some(Box::new(Written(bytes.clone()))), log, ..options(1000) };
        Simulation::new(&plan, &types(), options).unwrap().run().unwrap();
        bytes.lock().unwrap().clone()
    };
    let (a, b) = (run(), run());
    assert!(a.len() > 10_000);
    assert!(a == b, "the bytes differ");
}

#[test]
fn ports_are_known_by_their_shape() {
    let types = types();
    let asker = types.get("asker").unwrap();
    let directions: Vec<Direction> = asker.ports.iter().map(|port| port.shape.direction).collect();
    assert_eq!(directions, [Direction::Client, Direction::Output]);
    assert_eq!(types.get("source").unwrap().params[0].doc, "By how much.");
}
