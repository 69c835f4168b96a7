use record::log::{RunInfo, Writer};
use types::message::describe;
use types::messages::{Activity, Held, Reason, Row};

use super::super::because;
use super::*;

fn held(situations: &[(&str, bool, bool)]) -> Reasons {
    let held = |(name, was, is): &(&str, bool, bool)| Held { situation: (*name).into(), was: *was, is: *is };
    Reasons { situations: situations.iter().map(held).collect(), ..Reasons::default() }
}

fn on(mut reasons: Reasons, values: &[(&str, f64)]) -> Reasons {
    let value = |(name, value): &(&str, f64)| Reason { signal: (*name).into(), value: *value };
    reasons.values = values.iter().map(value).collect();
    reasons
}

fn decision(situation: &str, before: &str, rows: &[(&str, f64, &str)]) -> Decision {
    let row = |(agent, weight, by): &(&str, f64, &str)| Row {
        agent: (*agent).into(),
        weight: *weight,
        by: (*by).into(),
    };
    let active = rows.iter().find(|row| row.1 > 0.0).map_or(Name::EMPTY, |row| row.0.into());
    let rows = rows.iter().map(row).collect();
    Decision {
        situation: situation.into(),
        before: before.into(),
        active,
        danger: 0.25,
        rows,
        ..Decision::default()
    }
}

/// Three steps: all is well, the same again, and the battery is low.
fn steps() -> Vec<(f64, Decision, Reasons, Option<Orders>)> {
    let free = decision("free", "blind", &[("wall", 1.0, "free")]);
    let low = decision("battery.low", "free", &[("wall", 0.5, "battery.low"), ("track", 0.0, "battery.low")]);
    let order = Order { rate: 0.5, activity: Activity::Inactive, ..Order::of("faces".into()) };
    let orders = |orders: &[Order]| Orders { goal: Name::EMPTY, orders: orders.iter().copied().collect() };
    let calm = |was| held(&[("battery.low", false, false), ("free", was, true)]);
    let values = |battery| [("danger", 0.25), ("blind", 0.0), ("battery", battery)];
    vec![
        (1.0, free, on(calm(false), &values(0.5)), Some(orders(&[Order::of("faces".into())]))),
        (2.0, free, on(calm(true), &values(0.3)), None),
        (
            3.0,
            Decision { goal: "charge".into(), ..low },
            on(held(&[("battery.low", false, true), ("free", true, true)]), &values(0.125)),
            Some(orders(&[order])),
        ),
    ]
}

fn bytes<T: Message>(message: &T) -> Vec<u8> {
    let mut out = cdr::Writer::new();
    message.encode(&[], Time::ZERO, &mut out);
    out.bytes().to_vec()
}

fn header(seconds: f64, sequence: u64) -> Header {
    Header { stamp: Time::from_seconds(seconds), sequence, ..Header::default() }
}

fn changes() -> Changes {
    let mut changes = Changes::new(8);
    for (number, (time, decision, reasons, orders)) in steps().into_iter().enumerate() {
        let header = header(time, number as u64);
        changes.hear(Reasons::NAME, &header, &bytes(&reasons));
        changes.hear(Decision::NAME, &header, &bytes(&decision));
        orders.iter().for_each(|orders| changes.hear(Orders::NAME, &header, &bytes(orders)));
    }
    changes
}

const READ: &str = "     1.00 s  blind → free: wall has the say
             began    free
             active   free
             because  battery 0.500, blind no, danger 0.250
             weights  wall 1.0 by free

     3.00 s  free → battery.low: wall has the say
             began    battery.low
             active   battery.low, free
             because  battery 0.125 (was 0.500), blind no, danger 0.250
             weights  wall 0.5 by battery.low, was 1.0; track 0.0 by battery.low, was unsaid
             orders   faces active false, rate 0.5 (new)
             goal     charge (was none)
";

#[test]
fn the_last_changes_are_told_with_what_is_new_in_them() {
    let answer = Json::from(changes().last(10));
    assert_eq!(because::why(&answer), READ);
    assert_eq!(answer[1]["changed"]["weights"], json!({"wall": [1.0, 0.5], "track": [null, 0.0]}));
    assert_eq!(answer[1]["changed"]["goal"], json!([null, "charge"]));
    assert_eq!(answer[1]["values"], json!({"danger": 0.25, "blind": false, "battery": 0.125}));
    assert_eq!(answer[1]["orders"], json!({"faces": {"rate": 0.5, "active": false}}));
    assert_eq!(changes().last(1).len(), 1);
}

#[test]
fn messages_of_one_step_belong_together_in_whatever_order_they_come() {
    let expected = changes().last(10);
    let steps = || steps().into_iter().enumerate();
    let mut later = Changes::new(8);
    for (number, (time, decision, ..)) in steps() {
        later.hear(Decision::NAME, &header(time, number as u64), &bytes(&decision));
    }
    for (number, (time, _, reasons, orders)) in steps() {
        let header = header(time, number as u64);
        orders.iter().for_each(|orders| later.hear(Orders::NAME, &header, &bytes(orders)));
        later.hear(Reasons::NAME, &header, &bytes(&reasons));
    }
    assert_eq!(later.last(10), expected);
}

#[test]
fn two_steps_at_one_instant_keep_their_own_reasons() {
    let mut changes = Changes::new(8);
    let all = steps();
    for number in [0, 2] {
        changes.hear(Reasons::NAME, &header(1.0, number), &bytes(&all[number as usize].2));
    }
    for number in [0, 2] {
        changes.hear(Decision::NAME, &header(1.0, number), &bytes(&all[number as usize].1));
    }
    let battery =
        changes.last(10).iter().map(|change| change["values"]["battery"].as_f64()).collect::<Vec<_>>();
    assert_eq!(battery, [Some(0.5), Some(0.125)]);
}

#[test]
fn a_change_within_a_situation_is_told_as_that() {
    let mut changes = Changes::new(8);
    for (number, weight) in [(1, 1.0), (2, 0.5)] {
        let decision = decision("free", "blind", &[("wall", weight, "free")]);
        changes.hear(Decision::NAME, &header(1.0, number), &bytes(&decision));
    }
    let told = because::why(&changes.last(10).into());
    let heads: Vec<&str> = told.lines().filter(|line| line.contains(" s  ")).map(str::trim).collect();
    assert_eq!(heads, ["1.00 s  blind → free: wall has the say", "1.00 s  still free: wall has the say"]);
}

#[test]
fn only_the_last_are_kept_and_what_they_change_is_known() {
    let mut changes = Changes::new(2);
    for i in 0..10 {
        let decision = decision("free", "blind", &[("wall", f64::from(i) / 16.0, "free")]);
        changes.hear(Decision::NAME, &header(f64::from(i), i as u64), &bytes(&decision));
    }
    let last = changes.last(10);
    assert_eq!(last.len(), 2);
    assert_eq!(last[0]["changed"]["weights"], json!({"wall": [0.4375, 0.5]}));
}

#[test]
fn a_log_says_the_same_as_the_run_did() {
    let folder = std::env::temp_dir().join(format!("sinew-why-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("run.mcap");
    let mut log = Writer::create(&path, &RunInfo::default()).unwrap();
    let topics = [
        ("/decision/reasons", describe::<Reasons>()),
        ("/decision/decision", describe::<Decision>()),
        ("/decision/orders", describe::<Orders>()),
    ];
    let channels = topics.map(|(topic, definition)| log.channel(topic, &definition).unwrap());
    for (number, (time, decision, reasons, orders)) in steps().into_iter().enumerate() {
        let header = header(time, number as u64);
        let messages = [Some(bytes(&reasons)), Some(bytes(&decision)), orders.map(|orders| bytes(&orders))];
        for (channel, message) in channels.iter().zip(messages) {
            message.iter().for_each(|message| log.write(*channel, &header, header.stamp, message).unwrap());
        }
    }
    log.finish().unwrap();
    let said = of_log(&path, 10).unwrap();
    std::fs::remove_dir_all(&folder).unwrap();
    assert_eq!(said, Json::from(changes().last(10)));
}
