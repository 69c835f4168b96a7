//! From TOML text to the tree of values, for tests and pictures.

use types::value::{Entry, Row, Span, Table, Value};

/// The tree of a TOML text, without places.
pub(crate) fn table(text: &str) -> Table {
    match value(toml::Value::Table(text.parse().expect("the text is TOML"))) {
        Value::Table(table) => table,
        _ => unreachable!("a document is a table"),
    }
}

fn value(from: toml::Value) -> Value {
    match from {
        toml::Value::String(text) => Value::Text(text),
        toml::Value::Integer(n) => Value::Int(n),
        toml::Value::Float(x) => Value::Float(x),
        toml::Value::Boolean(b) => Value::Bool(b),
        toml::Value::Datetime(time) => Value::Text(time.to_string()),
        toml::Value::Array(list) => {
            Value::List(list.into_iter().map(|item| Entry::from(value(item))).collect())
        }
        toml::Value::Table(rows) => {
            let mut table = Table::new();
            for (key, item) in rows {
                table.push(Row { key, key_at: Span::default(), entry: value(item).into() });
            }
            Value::Table(table)
        }
    }
}

/// Gives every entry a place of its own, so that tests can tell where a mistake was seen.
#[allow(dead_code, reason = "the pictures need no places")]
pub(crate) fn number_places(table: &mut Table) {
    fn entry_of(entry: &mut Entry, next: &mut u32) {
        *next += 1;
        entry.at = Span { start: *next, end: *next + 1 };
        match &mut entry.value {
            Value::Table(table) => table.rows_mut().iter_mut().for_each(|row| entry_of(&mut row.entry, next)),
            Value::List(list) => list.iter_mut().for_each(|item| entry_of(item, next)),
            _ => {}
        }
    }
    let mut next = 0;
    table.rows_mut().iter_mut().for_each(|row| entry_of(&mut row.entry, &mut next));
}
