//! What was recorded gives the decision again, and whole rows decide as they always did.

use proptest::prelude::*;
use types::cdr::{Reader, Writer};
use types::message::Message;
use types::messages::Activity;

use super::*;

fn coded<T: Message>(message: &T) -> T {
    let mut out = Writer::new();
    message.encode(&[], Time::ZERO, &mut out);
    T::decode(&mut Reader::new(out.bytes()).unwrap(), &mut Vec::new()).unwrap()
}

#[test]
fn what_is_sent_is_small_and_the_same_behind_cdr() {
    let sizes = [size_of::<Decision>(), size_of::<Orders>(), size_of::<Reasons>()];
    assert!(sizes.iter().all(|size| *size <= runtime::LARGEST_BY_VALUE), "{sizes:?}");
    let verdict = Mind::heard(0.5, 1.0).charged(0.1).judge(&own_params(), Time::ZERO);
    assert_eq!(coded(&verdict.decision), verdict.decision);
    assert_eq!(coded(&verdict.orders), verdict.orders);
    assert_eq!(coded(&verdict.reasons), verdict.reasons);
    let unsaid = Order::of("faces".into());
    assert_eq!(
        (unsaid.importance(), unsaid.rate(), unsaid.active(), unsaid.method()),
        (None, None, None, None)
    );
    assert_eq!(unsaid.activity, Activity::Unsaid);
}

fn numbers() -> impl Strategy<Value = f64> {
    prop_oneof![4 => 0.0f64..1.0, 1 => Just(f64::NAN), 1 => Just(0.95), 1 => Just(0.2)]
}

/// Values for all signals and one name that agents tell, at some steps.
fn runs() -> impl Strategy<Value = Vec<Vec<f64>>> {
    let values = proptest::collection::vec(numbers(), Known::ALL.len() + 1);
    proptest::collection::vec(values, 1..20)
}

/// Tables of situations with conditions over some of the signals.
fn tables() -> impl Strategy<Value = Table> {
    let signal = || proptest::sample::select(vec!["battery", "speed", "faces", "risk", "load", "nearest"]);
    let when = (signal(), signal(), 0.0f64..1.0, any::<bool>());
    let one = (when, proptest::option::of((signal(), 0.0f64..1.0)), 0i64..100, 0usize..4, 0.0f64..=1.0);
    proptest::collection::vec(one, 0..6).prop_map(|all| {
        let mut out = own();
        for (i, ((a, b, level, both), until, priority, agent, weight)) in all.into_iter().enumerate() {
            let join = if both { "&&" } else { "||" };
            let mut entries = vec![
                ("when", Value::from(format!("{a} < {level} {join} !({b} > {a} || narrow)"))),
                ("priority", Value::Int(priority)),
                (["wall", "track", "faces.weight", "wall.rate"][agent], Value::Float(weight.max(0.01))),
            ];
            if i % 2 == 0 {
                entries.push(("goal", Value::from(["charge", "greet", "rest"][i / 2])));
            }
            entries
                .extend(until.map(|(signal, level)| ("until", Value::from(format!("{signal} > {level}")))));
            if i < 5 {
                out.set(&format!("own{i}"), row(&entries));
            }
        }
        out
    })
}

proptest! {
    /// Recorded, sent and read again, the values and the table give every verdict again: from the first on, and from any one alone.
    #[test]
    fn the_recorded_values_alone_give_the_decision_again(table in tables(), run in runs()) {
        let params = DecisionParams { signals: vec!["faces".into()], ..with(table.clone()) };
        prop_assert_eq!(DecisionTable::mistakes(&table, Some(&params.signals)), []);
        let (mut judgement, mut again) = (Judgement::default(), Judgement::default());
        for numbers in run {
            let mut values = signal::Values::UNKNOWN;
            numbers.iter().enumerate().for_each(|(place, number)| values.put(place, *number));
            values.put_truth(Known::Blind, numbers[0] > 0.8);
            let verdict = judgement.judge(&params, &values);
            let (decision, reasons) = (coded(&verdict.decision), coded(&verdict.reasons));
            prop_assert_eq!(again.again(&params, &reasons), verdict);
            prop_assert_eq!(Judgement::before(&decision, &reasons).again(&params, &reasons), verdict);
        }
    }

    /// Where the situations that are built in have whole rows, the highest one decides alone, as tables without conditions always have it.
    #[test]
    fn whole_rows_of_built_in_situations_are_taken_whole(run in runs(), rows in proptest::collection::vec(0.0f64..=1.0, 18)) {
        let agents = ["safety", "track", "wall"];
        let rows: Vec<Vec<(&str, f64)>> =
            rows.chunks(3).map(|weights| agents.into_iter().zip(weights.iter().copied()).collect()).collect();
        let named: Vec<_> =
            Situation::ALL.iter().zip(&rows).map(|(situation, row)| (situation.name(), weights(row))).collect();
        let (new, table) = (with(table(&named)), table(&named));
        let (mut judgement, mut before) = (Judgement::default(), old::Judgement::default());
        for numbers in run {
            let mut mind = Mind::heard(numbers[0], numbers[1].max(0.0));
            *mind.safety() = Safety { narrow: numbers[2] > 0.5, nearest_bearing: numbers[3], blind: numbers[4] > 0.9, ..*mind.safety() };
            let now = Time::ZERO + Duration::millis(if numbers[5] > 0.8 { 800 } else { 100 });
            let decision = judgement.judge(&new, &mind.hearing.values(&new, now)).decision;
            let expected = before.decide(&new, &table, &mind.hearing, now);
            let found: Vec<_> = decision.rows.iter().map(|row| (row.agent, row.weight)).collect();
            let found = (decision.situation, decision.before, decision.active, decision.danger, decision.desire, found);
            prop_assert_eq!(found, expected);
        }
    }
}
