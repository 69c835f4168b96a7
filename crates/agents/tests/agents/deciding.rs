//! The decision maker in a system: it takes no memory in real time, what it sends is enough to decide again, and a table that is wrong
//! changes nothing.

use std::sync::Mutex;

use agents::DecisionMaker;
use agents::decision_maker::{DecisionParams, Judgement, Verdict};
use runtime::{
    Agent, Fault, Input, LogChoice, Options, Output, Plan, Registry, Report, Request, Simulation, Step,
    TimedRequest, registry,
};
use types::messages::{
    Battery, Decision, Load, Odometry, Orders, Reasons, Risk, Safety, Signal, Target, Twist,
};
use types::params::Params as _;
use types::value::{Span, Table, Value};
use types::{Duration, Time};

#[global_allocator]
static MEMORY: runtime::Watched = runtime::Watched::SYSTEM;

/// Plays a world: everything that a decision maker can hear goes up and down, each at its own pace, and some of it falls silent.
#[derive(Agent)]
struct World {
    /// Danger, and room.
    safety: Output<Safety>,
    /// Somebody to follow.
    target: Output<Target>,
    /// Risk ahead.
    risk: Output<Risk>,
    /// Charge.
    battery: Output<Battery>,
    /// Speed.
    odometry: Output<Odometry>,
    /// Work.
    load: Output<Load>,
    /// How many faces, and what nobody declared.
    signals: Output<Signal>,
    n: f64,
}

impl Agent for World {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        self.n += 1.0;
        // Between 0 and 1, each with a period of its own (steps).
        let wave = |period: f64| 0.5 - 0.5 * (self.n * core::f64::consts::TAU / period).cos();
        let silent = self.n % 130.0 > 120.0;
        if !silent {
            let (danger, nearest_bearing) = (wave(47.0), 2.0 * wave(31.0));
            let narrow = wave(61.0) > 0.5;
            self.safety.send(Safety { danger, nearest_bearing, narrow, ..Safety::default() });
        }
        self.target.send(Target { desire: wave(83.0), share: wave(29.0), ..Target::default() });
        let values = [wave(37.0) as f32].into_iter().collect();
        self.risk.send(Risk { angle_step: 1.0, values, ..Risk::default() });
        self.battery.send(Battery { charge: wave(97.0), ..Battery::default() });
        self.odometry.send(Odometry { twist: Twist::new(wave(41.0), 0.0), ..Odometry::default() });
        self.load.send(Load { processors: [wave(53.0) as f32].into_iter().collect(), ..Load::default() });
        let valid_until = step.now + Duration::millis(30);
        for name in ["faces", "strange"] {
            self.signals.send(Signal { name: name.into(), value: 4.0 * wave(59.0), valid_until });
        }
        Ok(())
    }
}

static HEARD: Mutex<Vec<(Time, Decision, Reasons)>> = Mutex::new(Vec::new());
static ORDERED: Mutex<Vec<(Time, Orders)>> = Mutex::new(Vec::new());

/// Writes down what is decided.
#[derive(Agent)]
struct Witness {
    /// Decisions.
    decision: Input<Decision>,
    /// Reasons.
    reasons: Input<Reasons>,
    /// Orders.
    orders: Input<Orders>,
}

impl Agent for Witness {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        let (mut heard, mut ordered) = (HEARD.lock().unwrap(), ORDERED.lock().unwrap());
        while let (Some(decision), Some(reasons)) = (self.decision.take(), self.reasons.take()) {
            let stamp = decision.header().stamp;
            assert_eq!(stamp, reasons.header().stamp, "they are of one step");
            heard.push((stamp, *decision, *reasons));
        }
        while let Some(orders) = self.orders.take() {
            ordered.push((orders.header().stamp, *orders));
        }
        Ok(())
    }
}

fn types() -> Registry {
    registry![DecisionMaker, World, Witness]
}

fn table(rows: &[(&str, &[(&str, Value)])]) -> Table {
    let mut table = Table::new();
    for (situation, entries) in rows {
        let mut row = Table::new();
        entries.iter().for_each(|(key, value)| row.set_path(key, value.clone()).unwrap());
        table.set(situation, Value::Table(row));
    }
    table
}

fn params() -> DecisionParams {
    let text = |text: &str| Value::from(text);
    let table = table(&[
        ("danger.near", &[("safety", Value::Float(1.0)), ("wall", Value::Float(0.0))]),
        (
            "battery.low",
            &[
                ("when", text("battery < 0.2 || min(load, 1 - battery) > 0.9")),
                ("until", text("battery > 0.3 && known(load)")),
                ("priority", Value::Int(75)),
                ("goal", text("charge")),
                ("faces.active", Value::Bool(false)),
            ],
        ),
        (
            "crowd",
            &[("when", text("faces > 3")), ("faces.rate", Value::Float(0.5)), ("wall", Value::Float(0.25))],
        ),
        ("hurried", &[("when", text("abs(speed) > 0.5 && !blind")), ("faces.method", text("rough"))]),
        ("target.seen", &[("goal", text("follow")), ("track", Value::Float(1.0))]),
        ("free", &[("wall", Value::Float(1.0))]),
    ]);
    DecisionParams { table: table.into(), signals: vec!["faces".into()], ..DecisionParams::default() }
}

fn plan(name: &str) -> Plan {
    let mut plan = Plan::new(name);
    let world = plan.add::<World>("world", Default::default());
    let decision = plan.add::<DecisionMaker>("decision", params());
    plan.wire(&world.safety, &decision.safety);
    plan.wire(&world.target, &decision.target);
    plan.wire(&world.risk, &decision.risk);
    plan.wire(&world.battery, &decision.battery);
    plan.wire(&world.odometry, &decision.odometry);
    plan.wire(&world.load, &decision.load);
    plan.wire(&world.signals, &decision.signals);
    for agent in ["world", "decision"] {
        plan.every(agent, Duration::millis(100));
        plan.agent_mut(agent).unwrap().executor = Some("reflex".into());
    }
    plan
}

fn run(plan: &Plan, seconds: i64) -> Report {
    let options = Options {
        limit: Some(Duration::secs(seconds)),
        log: LogChoice::by(|_, _| 1),
        parse: |words| control_words(words),
        ..Options::default()
    };
    Simulation::new(plan, &types(), options).unwrap().run().unwrap()
}

/// `right` puts another table in place, `wrong` one that cannot be.
fn control_words(words: &[String]) -> Result<Request, runtime::Refusal> {
    let Some(Value::Table(mut table)) = params().get("table") else { panic!("the table is one") };
    let wall = if words[0] == "right" { 0.5 } else { 5.0 };
    table.set_path("free.wall", Value::Float(wall)).unwrap();
    table
        .set_path(
            "\"battery.low\".when",
            Value::from(if words[0] == "right" { "battery < 0.1" } else { "batery < 0.1" }),
        )
        .unwrap();
    Ok(Request::Set { agent: "decision".into(), key: "table".into(), value: Value::Table(table) })
}

#[test]
fn deciding_takes_no_memory_in_real_time() {
    let mut plan = plan("memory");
    let requests = [(500, "right"), (600, "wrong"), (700, "right")];
    plan.requests = requests.map(|(millis, word)| at(millis, word)).to_vec();
    let report = run(&plan, 60);
    assert!(report.view.allocations_watched);
    let decision = report.view.agents.iter().find(|agent| agent.name == "decision").unwrap();
    assert!(decision.counts.releases > 500, "{:?}", decision.counts);
    assert_eq!(decision.counts.allocations, 0);
    assert!(report.view.executors.iter().all(|executor| executor.allocations == 0));
}

fn at(millis: i64, word: &str) -> TimedRequest {
    TimedRequest { at: Duration::millis(millis), words: vec![word.to_owned()], place: Span::default() }
}

#[test]
fn a_table_that_is_wrong_changes_nothing_while_running() {
    let wall = |requests: &[TimedRequest]| {
        let mut plan = plan("set");
        plan.requests = requests.to_vec();
        let report = run(&plan, 2);
        let decision = report.view.agents.iter().find(|agent| agent.name == "decision").unwrap();
        let table = decision.params.get("table").unwrap().value.as_table().unwrap();
        let refused = report.incidents.iter().filter(|incident| incident.what.contains("refused"));
        let refused: Vec<String> = refused.map(|incident| incident.what.clone()).collect();
        (table.at_path("free.wall").unwrap().value.as_float().unwrap(), refused)
    };
    assert_eq!(wall(&[at(500, "right")]), (0.5, vec![]));
    let (weight, refused) = wall(&[at(500, "wrong")]);
    assert_eq!((weight, refused.len()), (1.0, 1), "{refused:?}");
    assert!(refused[0].contains("there is no signal \"batery\""), "{refused:?}");
}

#[test]
fn what_a_run_recorded_gives_every_decision_again() {
    let mut plan = plan("again");
    let witness = plan.add::<Witness>("witness", Default::default());
    let end = |port: &str| format!("decision.{port}");
    for (port, to) in
        [("decision", "witness.decision"), ("reasons", "witness.reasons"), ("orders", "witness.orders")]
    {
        plan.wires.push(runtime::WirePlan { depth: Some(64), ..runtime::WirePlan::new(end(port), to) });
    }
    drop(witness);
    plan.every("witness", Duration::millis(100));
    run(&plan, 120);
    let (heard, ordered) = (HEARD.lock().unwrap(), ORDERED.lock().unwrap());
    assert!(heard.len() > 1000, "{}", heard.len());
    let params = params();
    let (mut judgement, mut orders, mut situations) = (Judgement::default(), Orders::default(), Vec::new());
    let mut told = ordered.iter().peekable();
    for (time, decision, reasons) in heard.iter() {
        let Verdict { orders: expected, .. } = {
            let verdict = judgement.again(&params, reasons);
            assert_eq!((verdict.decision, verdict.reasons), (*decision, *reasons), "at {time:?}");
            assert_eq!(
                Judgement::before(decision, reasons).again(&params, reasons),
                verdict,
                "from here alone"
            );
            verdict
        };
        while let Some((_, newer)) = told.next_if(|(at, _)| at <= time) {
            orders = *newer;
        }
        assert_eq!(orders, expected, "at {time:?}");
        if !situations.contains(&decision.situation.as_str().to_owned()) {
            situations.push(decision.situation.as_str().to_owned());
        }
    }
    situations.sort();
    let all = [
        "battery.low",
        "blind",
        "crowd",
        "danger.near",
        "free",
        "hurried",
        "narrow",
        "target.near",
        "target.seen",
    ];
    assert_eq!(situations, all, "the run has been everywhere");
    let gaps = ordered.windows(2).map(|pair| (pair[1].0 - pair[0].0, pair[0].1 == pair[1].1));
    for (gap, same) in gaps {
        assert!(gap <= Duration::secs(1) && (!same || gap == Duration::secs(1)), "{gap} {same}");
    }
}
