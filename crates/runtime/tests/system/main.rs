//! Whole systems, in simulated time and on the wall clock.

#![allow(clippy::unwrap_used)] // a test may

mod admission;
mod asking;
#[cfg(rtsan)]
mod blocking;
mod busy;
mod calls;
mod cuts;
mod deadline;
mod deaths;
mod filters;
mod fire;
mod gaps;
mod means;
mod memory;
mod queues;
mod requests;
mod stuck;
mod successor;
mod thousand;
mod wakes;
mod wall;

use runtime::{
    Agent, AgentPlan, Client, Direction, Fault, FaultKind, Input, Options, Output, Params, Plan, QueuePlan,
    Refusal, Registry, Reply, Request, Service, Simulation, Step, TimedRequest, WirePlan, registry,
};
use std::sync::{Arc, Mutex};
use types::messages::{Image, Twist};
use types::value::{Span, Value};
use types::{Duration, Time};

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
        ["add", name, kind] => Request::Add(AgentPlan {
            name: name.into(),
            kind: kind.into(),
            period: Some(Duration::millis(10)),
            ..AgentPlan::default()
        }),
        ["call", service, speed] => Request::Call {
            service: service.into(),
            cdr: calls::cdr(Twist::new(speed.parse().map_err(|_| Refusal::new("no number"))?, 0.0)),
            within: Duration::millis(50),
        },
        ["call", service, speed, ";", "quit"] => {
            Request::All(vec![parse(&["call", service, speed].map(str::to_owned))?, Request::Quit])
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
    registry![Source, Relay, Sink, Asker, Answerer, Loop, Painter, Viewer, filters::Postman]
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

/// The relay hangs, and the source behind it on the same executor is late: its log says by how much, and why.
#[test]
fn a_missed_deadline_names_its_cause() {
    let mut plan = chain("late");
    plan.requests = vec![at(200, "fault relay hang")];
    ["relay", "source"]
        .into_iter()
        .for_each(|name| plan.agent_mut(name).unwrap().executor = Some("reflex".into()));
    // It hangs at 210 ms for 400 ms: the last release of the source meanwhile is that at 600 ms.
    plan.every("source", Duration::millis(30));
    plan.agent_mut("source").unwrap().deadline = Some(Duration::millis(4));
    let bytes = Arc::<Mutex<Vec<u8>>>::default();
    let options = Options { recorder: Some(Box::new(Written(bytes.clone()))), ..options(2000) };
    let report = Simulation::new(&plan, &types(), options).unwrap().run().unwrap();
    let source = report.view.agents.iter().find(|agent| agent.name == "source").unwrap();
    assert_eq!(source.counts.missed, 1, "{:?}", report.incidents);
    let log = String::from_utf8_lossy(&bytes.lock().unwrap()).into_owned();
    let said: Vec<&str> = log.matches("sourcemissed").collect();
    assert_eq!(said.len(), 1, "{log}");
    let text = "sourcemissed its deadline by 6 ms: its step began 10 ms late, behind others";
    assert!(log.contains(text), "{log}");
}

#[test]
fn ports_are_known_by_their_shape() {
    let types = types();
    let asker = types.get("asker").unwrap();
    let directions: Vec<Direction> = asker.ports.iter().map(|port| port.shape.direction).collect();
    assert_eq!(directions, [Direction::Client, Direction::Output]);
    assert_eq!(types.get("source").unwrap().params[0].doc, "By how much.");
}
