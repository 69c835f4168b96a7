//! What was known, as the log has it.

use proptest::prelude::*;

use super::*;

fn known() -> impl Strategy<Value = Known> {
    let number = any::<f64>().prop_filter("finite", |x| x.is_finite()).prop_map(Value::Float);
    let value =
        prop_oneof![number, any::<bool>().prop_map(Value::Bool), any::<String>().prop_map(Value::Text)];
    let rows = prop::collection::btree_map(any::<String>(), value, 0..4);
    let rows = rows.prop_map(|rows| {
        let mut table = Table::new();
        rows.into_iter().for_each(|(key, value)| table.set(&key, value));
        table
    });
    let nested = (any::<String>(), rows.clone()).prop_map(|(key, rows)| {
        let mut table = Table::new();
        table.set(&key, Value::Table(rows));
        table
    });
    let when = prop_oneof![
        any::<i64>().prop_map(|at| When::Once(Time(at))),
        (any::<i64>(), any::<i64>())
            .prop_map(|(first, period)| When::Every { first: Time(first), period: Duration(period) }),
        Just(When::Cron("30 8 * * mon-fri".parse().unwrap())),
    ];
    let schedules = prop::collection::btree_map(
        any::<String>(),
        (when, prop::collection::vec(any::<String>(), 0..3)),
        0..4,
    );
    let patterns = prop::collection::btree_map(any::<String>(), rows, 0..3);
    let table = proptest::option::of((any::<u32>(), nested));
    (table, patterns, schedules).prop_map(|(table, patterns, schedules)| Known {
        table: table.map(|(version, table)| Taken { version, table }),
        patterns: patterns.into_iter().collect(),
        schedules: schedules
            .into_iter()
            .map(|(name, (when, words))| Schedule { name, when, words })
            .collect(),
    })
}

proptest! {
    #[test]
    fn what_is_known_is_read_from_a_log_as_it_was_written(known in known()) {
        prop_assert_eq!(Known::of_note(&known.to_note()), Some(known));
    }

    #[test]
    fn any_note_is_read_or_refused(text in "(decide|pattern|schedule) = [{} =a-z0-9\"\\[\\]]{0,30}|.{0,20}") {
        let _ = Known::of_note(&text);
    }
}
