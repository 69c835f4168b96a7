//! What is decided on what is heard.

use types::messages::{Order, Twist};
use types::value::Value;

use super::*;

mod again;
mod old;
mod wrong;

fn weights(rows: &[(&str, f64)]) -> Value {
    let mut table = Table::new();
    rows.iter().for_each(|(agent, weight)| table.set(agent, Value::Float(*weight)));
    Value::Table(table)
}

/// A row from keys and values, `weight` or another setting of an agent as `agent.setting`.
fn row(entries: &[(&str, Value)]) -> Value {
    let mut table = Table::new();
    entries.iter().for_each(|(key, value)| table.set_path(key, value.clone()).unwrap());
    Value::Table(table)
}

fn table(rows: &[(&str, Value)]) -> Table {
    let mut table = Table::new();
    rows.iter().for_each(|(situation, row)| table.set(situation, row.clone()));
    table
}

fn with(table: Table) -> DecisionParams {
    DecisionParams { table: table.into(), ..DecisionParams::default() }
}

fn params() -> DecisionParams {
    with(table(&[
        ("danger.near", weights(&[("safety", 1.0), ("track", 0.0), ("wall", 0.0)])),
        ("target.seen", weights(&[("safety", 0.0), ("track", 1.0), ("wall", 0.0)])),
        ("free", weights(&[("safety", 0.0), ("track", 0.0), ("wall", 1.0)])),
    ]))
}

/// A decision maker without ports.
#[derive(Clone, Copy, Debug, Default)]
struct Mind {
    hearing: Hearing,
    judgement: Judgement,
}

impl Mind {
    /// One that has just heard these.
    fn heard(danger: f64, desire: f64) -> Mind {
        let safety = Safety { danger, nearest_bearing: 2.0, ..Safety::default() };
        let target = Target { desire, share: 0.05, visible: desire > 0.0, ..Target::default() };
        let mut mind = Mind::default();
        mind.hearing.safety = Some(Dated { value: safety, stamp: Time::ZERO });
        mind.hearing.target = Some(Dated { value: target, stamp: Time::ZERO });
        mind
    }

    fn safety(&mut self) -> &mut Safety {
        &mut self.hearing.safety.as_mut().unwrap().value
    }

    fn charged(mut self, charge: f64) -> Mind {
        let battery = Battery { charge, ..Battery::default() };
        self.hearing.battery = Some(Dated { value: battery, stamp: Time::ZERO });
        self
    }

    fn judge(&mut self, params: &DecisionParams, now: Time) -> Verdict {
        self.judgement.judge(params, &self.hearing.values(params, now))
    }

    fn decide(&mut self, params: &DecisionParams) -> (String, String) {
        let decision = self.judge(params, Time::ZERO).decision;
        (decision.situation.as_str().to_owned(), decision.active.as_str().to_owned())
    }
}

fn pair(situation: &str, active: &str) -> (String, String) {
    (situation.to_owned(), active.to_owned())
}

#[test]
fn danger_beats_desire_and_desire_beats_the_wall() {
    let decide = |danger, desire| Mind::heard(danger, desire).decide(&params());
    assert_eq!(decide(0.2, 0.0), pair("free", "wall"));
    assert_eq!(decide(0.2, 1.0), pair("target.seen", "track"));
    assert_eq!(decide(1.0, 1.0), pair("danger.near", "safety"));
}

#[test]
fn what_is_near_and_followed_is_faced() {
    let mut mind = Mind::heard(1.0, 1.0);
    mind.safety().nearest_bearing = 0.3;
    assert_eq!(mind.decide(&params()), pair("target.near", "track"), "with the row of what is active below");
}

#[test]
fn narrow_without_a_row_is_as_free() {
    let mut mind = Mind::heard(0.2, 0.0);
    mind.safety().narrow = true;
    assert_eq!(mind.decide(&params()), pair("narrow", "wall"));
}

#[test]
fn silence_of_safety_is_blindness_and_moves_nobody() {
    assert_eq!(Mind::default().decide(&params()), pair("blind", ""));
    let late = Time::ZERO + Duration::millis(701);
    let decision = Mind::heard(0.2, 1.0).judge(&params(), late).decision;
    assert_eq!((decision.situation.as_str(), decision.active.as_str()), ("blind", ""));
    let silenced: Vec<_> = decision.rows.iter().map(|row| (row.weight, row.by.as_str())).collect();
    assert_eq!(silenced, [(0.0, "blind"); 3], "without a row of the table");
}

#[test]
fn a_trembling_reading_changes_nothing_between_the_two_levels() {
    let params = params();
    let mut mind = Mind::heard(0.0, 0.0);
    let situations = [0.94, 0.96, 0.94, 0.86, 0.84, 0.94].map(|danger| {
        mind.safety().danger = danger;
        mind.decide(&params).0
    });
    assert_eq!(situations, ["free", "danger.near", "danger.near", "danger.near", "free", "free"]);
    assert_eq!(mind.judge(&params, Time::ZERO).decision.before.as_str(), "danger.near");
}

#[test]
fn risk_counts_in_front_only() {
    let params = params();
    let mut risk = Risk { angle_step: 1.0, values: [1.0, 0.0, 0.0].into_iter().collect(), ..Risk::default() };
    let danger = |risk: Risk| {
        let mut mind = Mind::heard(0.2, 0.0);
        mind.hearing.risk = Some(Dated { value: risk, stamp: Time::ZERO });
        mind.judge(&params, Time::ZERO).decision.danger
    };
    assert_eq!(danger(risk), 0.9);
    risk.values = [0.0, 1.0, 0.0].into_iter().collect();
    assert_eq!(danger(risk), 0.2);
}

/// A table with situations of its own: one with two levels, one with one, and one that says nothing of weights.
fn own() -> Table {
    let text = |text: &str| Value::from(text);
    table(&[
        (
            "battery.low",
            row(&[
                ("when", text("battery < 0.2")),
                ("until", text("battery > 0.3")),
                ("priority", Value::Int(75)),
                ("goal", text("charge")),
                ("track", Value::Float(0.0)),
                ("faces.active", Value::Bool(false)),
            ]),
        ),
        ("hurried", row(&[("when", text("speed > 0.4")), ("faces.rate", Value::Float(0.5))])),
        (
            "crowd",
            row(&[
                ("when", text("faces > 2 && !blind")),
                ("goal", text("greet")),
                ("faces.method", text("exact")),
                ("faces.importance", Value::Int(1)),
            ]),
        ),
        (
            "target.seen",
            row(&[
                ("goal", text("follow")),
                ("track.weight", Value::Float(1.0)),
                ("track.importance", Value::Float(0.8)),
                ("faces.rate", Value::Float(0.25)),
                ("faces.active", Value::Bool(true)),
            ]),
        ),
        ("free", weights(&[("wall", 1.0), ("track", 0.1)])),
    ])
}

fn own_params() -> DecisionParams {
    DecisionParams { signals: vec!["faces".into()], ..with(own()) }
}

#[test]
fn a_situation_begins_at_one_level_and_ends_at_the_other() {
    let params = own_params();
    let mut mind = Mind::heard(0.0, 0.0);
    let situations = [0.25, 0.19, 0.25, 0.3, 0.31, 0.25].map(|charge| {
        mind = mind.charged(charge);
        mind.decide(&params).0
    });
    assert_eq!(situations, ["free", "battery.low", "battery.low", "battery.low", "free", "free"]);
    let late = Time::ZERO + params.battery_age + Duration::millis(1);
    let mut mind = Mind::heard(0.0, 0.0).charged(0.1);
    mind.judge(&params, Time::ZERO);
    let held = mind.judge(&params, late).reasons.situations;
    let low = held.iter().find(|held| held.situation.as_str() == "battery.low").unwrap();
    assert!(low.was && low.is, "what is unknown ends nothing");
}

#[test]
fn without_an_end_a_situation_ends_with_its_beginning() {
    let params = own_params();
    let mut mind = Mind::heard(0.0, 0.0);
    let situations = [0.5, 0.4, 0.41].map(|linear| {
        let odometry = Odometry { twist: Twist::new(linear, 0.0), ..Odometry::default() };
        mind.hearing.odometry = Some(Dated { value: odometry, stamp: Time::ZERO });
        mind.decide(&params).0
    });
    assert_eq!(situations, ["hurried", "free", "hurried"]);
}

#[test]
fn active_situations_combine_by_agent_and_by_setting() {
    let params = own_params();
    let mut mind = Mind::heard(0.0, 1.0).charged(0.1);
    let faces = Signal { name: "faces".into(), value: 3.0, valid_until: Time::ZERO };
    mind.hearing.told(&params.signals, faces, Time::ZERO);
    let verdict = mind.judge(&params, Time::ZERO);
    let decision = verdict.decision;
    assert_eq!((decision.situation.as_str(), decision.goal.as_str()), ("battery.low", "charge"));
    let rows: Vec<_> =
        decision.rows.iter().map(|row| (row.agent.as_str(), row.weight, row.by.as_str())).collect();
    assert_eq!(rows, [("track", 0.0, "battery.low"), ("wall", 1.0, "free")], "target.seen is overruled");
    let order = |agent: &str| {
        let orders = verdict.orders.orders.iter().find(|order| order.agent.as_str() == agent);
        let order = orders.unwrap();
        (order.importance(), order.rate(), order.active(), order.method().map(str::to_owned))
    };
    // Whether it works is said by "battery.low", the rate by "target.seen", the rest by "crowd".
    assert_eq!(order("faces"), (Some(1.0), Some(0.25), Some(false), Some("exact".into())));
    assert_eq!(order("track"), (Some(0.8), None, None, None));
    let active: Vec<_> = verdict.reasons.situations.iter().filter(|held| held.is).collect();
    let active: Vec<_> = active.iter().map(|held| held.situation.as_str()).collect();
    assert_eq!(active, ["battery.low", "target.seen", "crowd", "free"], "the highest priority first");

    let mut mind = Mind::heard(0.0, 1.0).charged(0.9);
    let verdict = mind.judge(&params, Time::ZERO);
    assert_eq!(verdict.decision.goal.as_str(), "follow");
    assert_eq!(verdict.decision.rows[0].by.as_str(), "target.seen");
    let calm = Mind::heard(0.0, 0.0).judge(&params, Time::ZERO);
    assert_eq!(calm.decision.goal.as_str(), "", "nobody says one");
    let unsaid: Vec<_> = calm.orders.orders.iter().map(|order| *order == Order::of(order.agent)).collect();
    assert_eq!(unsaid, [true; 2], "an agent of which nothing is said any more is told so");
}

#[test]
fn priorities_are_the_tables_and_its_order_breaks_ties() {
    let low = || Value::from("battery < 0.2");
    let situation = |rows: &[(&str, Value)]| Mind::heard(0.0, 1.0).charged(0.1).decide(&with(table(rows))).0;
    assert_eq!(situation(&[("low", row(&[("when", low())]))]), "target.seen", "50 by itself");
    let at = |priority| row(&[("when", low()), ("priority", Value::Int(priority))]);
    assert_eq!(situation(&[("low", at(71))]), "low");
    assert_eq!(situation(&[("low", at(70)), ("target.seen", weights(&[]))]), "low");
    assert_eq!(situation(&[("target.seen", weights(&[])), ("low", at(70))]), "target.seen");
    let free = row(&[("priority", Value::Int(500))]);
    assert_eq!(situation(&[("low", at(71)), ("free", free)]), "free");
}

#[test]
fn what_nobody_sent_or_is_too_old_is_unknown() {
    let text = |text: &str| Value::from(text);
    let table = table(&[
        ("dark", row(&[("when", text("!known(battery)")), ("priority", Value::Int(60))])),
        ("few", row(&[("when", text("faces < 2 || battery < 0.5"))])),
    ]);
    let params = DecisionParams { signals: vec!["faces".into()], ..with(table) };
    assert_eq!(Mind::heard(0.0, 0.0).decide(&params).0, "dark");
    let mut mind = Mind::heard(0.0, 0.0).charged(0.9);
    assert_eq!(mind.decide(&params).0, "free");
    let told = |name: &str, value, millis| Signal {
        name: name.into(),
        value,
        valid_until: Time::ZERO + Duration::millis(millis),
    };
    mind.hearing.told(&params.signals, told("faces", 1.0, 100), Time::ZERO);
    let at = |mind: &mut Mind, millis| {
        mind.judge(&params, Time::ZERO + Duration::millis(millis)).decision.situation.as_str().to_owned()
    };
    assert_eq!(at(&mut mind, 100), "few");
    assert_eq!(at(&mut mind, 101), "free", "it held until then");
    let later = Time::ZERO + Duration::millis(50);
    mind.hearing.told(&params.signals, told("faces", 1.0, 500), later);
    mind.hearing.told(&params.signals, told("faces", 9.0, 500), Time::ZERO);
    assert_eq!(at(&mut mind, 200), "few", "what was sent earlier is not newer");
    mind.hearing.told(&params.signals, told("faces", f64::NAN, 500), later);
    assert_eq!(at(&mut mind, 200), "free", "no number is unknown");
}

#[test]
fn names_that_nobody_declared_push_nobody_out() {
    let declared: Vec<String> = (0..MOST_TOLD).map(|i| format!("s{i}")).collect();
    let table = table(&[("all", row(&[("when", Value::from("s15 > 0"))]))]);
    let params = DecisionParams { signals: declared.clone(), ..with(table) };
    let mut mind = Mind::heard(0.0, 0.0);
    let strange: Vec<String> = (0..40).map(|i| format!("strange{i}")).collect();
    for name in strange.iter().chain(&declared) {
        let signal = Signal { name: name.as_str().into(), value: 1.0, valid_until: Time::NEVER };
        mind.hearing.told(&declared, signal, Time::ZERO);
    }
    assert_eq!(mind.decide(&params).0, "all");
}

#[test]
fn each_signal_is_what_its_name_says() {
    let mut mind = Mind::heard(0.25, 0.5).charged(0.625);
    let value = Odometry { twist: Twist::new(0.375, -0.75), ..Odometry::default() };
    mind.hearing.odometry = Some(Dated { value, stamp: Time::ZERO });
    let value = Load {
        processors: [0.25, 0.75].into_iter().collect(),
        pressure_cpu: 0.125,
        pressure_memory: 0.25,
        ..Load::default()
    };
    mind.hearing.load = Some(Dated { value, stamp: Time::ZERO });
    let risk = Risk { angle_step: 1.0, values: [0.125, 1.0].into_iter().collect(), ..Risk::default() };
    mind.hearing.risk = Some(Dated { value: risk, stamp: Time::ZERO });
    *mind.safety() = Safety { nearest: 0.5, linear_max: 0.25, narrow: true, ..*mind.safety() };
    let values = mind.hearing.values(&DecisionParams::default(), Time::ZERO + Duration::millis(500));
    let is = [
        ("danger", 0.25),
        ("desire", 0.5),
        ("risk", 0.125),
        ("blind", 0.0),
        ("narrow", 1.0),
        ("nearest", 0.5),
        ("nearest_bearing", 2.0),
        ("linear_max", 0.25),
        ("safety_age", 0.5),
        ("target_share", 0.05),
        ("target_bearing", 0.0),
        ("target_visible", 1.0),
        ("target_age", 0.5),
        ("battery", 0.625),
        ("battery_age", 0.5),
        ("speed", 0.375),
        ("turn", -0.75),
        ("load", 0.5),
        ("pressure", 0.25),
    ];
    let found: Vec<_> = Known::ALL.iter().map(|known| (known.name(), values.get(*known).unwrap())).collect();
    assert_eq!(found, is);
    let fields = DecisionParams::fields();
    let doc = fields.iter().find(|field| field.name == "table").unwrap().doc;
    assert!(Known::ALL.iter().all(|known| doc.contains(known.name())), "all are documented: {doc}");
    let unknown = Mind::default().hearing.values(&DecisionParams::default(), Time::ZERO);
    let known: Vec<_> = Known::ALL.iter().filter(|known| unknown.get(**known).is_some()).collect();
    assert_eq!(known, [&Known::Danger, &Known::Desire, &Known::Blind]);
}

#[test]
fn what_is_written_comes_back_as_it_was() {
    let params = own_params();
    let table = params.to_table();
    let again = DecisionParams::read(&table, "decision-maker").unwrap();
    assert_eq!(again.table, params.table);
    assert_eq!(params.get("table"), Some(Value::Table(own())));
    let keys = |table: &Table| table.rows().iter().map(|row| row.key.clone()).collect::<Vec<_>>();
    let Some(Value::Table(written)) = again.get("table") else { panic!("it is a table") };
    assert_eq!(keys(&written), keys(&own()), "in the same order");
}
