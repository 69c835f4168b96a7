//! What a run knows at its start, and the same as a text in its log.

use std::fmt::Write as _;

use knowledge::{Schedule, When};
use types::value::{Entry, Key, Table, Value};
use types::{Duration, Time};

use crate::file;

/// What was taken out of a store.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Known {
    /// The decision maker's table.
    pub(super) table: Option<Taken>,
    /// The patterns that agents name, as tables for them.
    pub(super) patterns: Vec<(String, Table)>,
    /// All schedules.
    pub(super) schedules: Vec<Schedule>,
}

/// A version of a decision table.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Taken {
    /// Its number.
    pub(super) version: u32,
    /// Its rows.
    pub(super) table: Table,
}

impl Known {
    /// The text of it, which is TOML. Times are whole nanoseconds, so that none is rounded.
    pub(super) fn to_note(&self) -> String {
        let mut sections = Table::new();
        if let Some(Taken { version, table }) = &self.table {
            let rows = [("version", Value::from(*version)), ("table", Value::from(table.clone()))];
            sections.set("decide", table_of(rows));
        }
        for (section, rows) in [("pattern", self.pattern_rows()), ("schedule", self.schedule_rows())] {
            if !rows.is_empty() {
                sections.set(section, Value::Table(rows));
            }
        }
        let mut text = String::new();
        for row in sections.rows() {
            // Writing to a text cannot fail.
            let _ = writeln!(text, "{} = {}", Key(&row.key), row.entry.value);
        }
        text
    }

    fn pattern_rows(&self) -> Table {
        let mut rows = Table::new();
        self.patterns.iter().for_each(|(name, table)| rows.set(name, Value::from(table.clone())));
        rows
    }

    fn schedule_rows(&self) -> Table {
        let mut rows = Table::new();
        for Schedule { name, when, words } in &self.schedules {
            let words = words.iter().map(|word| Entry::from(Value::from(word.as_str()))).collect::<Vec<_>>();
            let asks = ("do", Value::from(words));
            rows.set(
                name,
                match when {
                    When::Once(at) => table_of([("at", Value::from(at.0)), asks]),
                    When::Every { first, period } => {
                        table_of([("every", Value::from(period.0)), ("at", Value::from(first.0)), asks])
                    }
                    When::Cron(cron) => table_of([("cron", Value::from(cron.to_string())), asks]),
                },
            );
        }
        rows
    }

    /// Reads the text again; nothing where it is none of ours.
    pub(super) fn of_note(text: &str) -> Option<Known> {
        let tree = file::tree(text).ok()?;
        let tree = tree.as_table()?;
        let section = |name| tree.get(name).and_then(|entry| entry.value.as_table());
        let table = section("decide").map(|decide| {
            let Value::Int(version) = decide.get("version")?.value else { return None };
            let table = decide.get("table")?.value.as_table()?;
            Some(Taken { version: version.try_into().ok()?, table: bare(table) })
        });
        let patterns = section("pattern").map(Table::rows).unwrap_or_default().iter();
        let schedules = section("schedule").map(Table::rows).unwrap_or_default().iter();
        let pattern = |name: &str, value: &Value| Some((name.to_owned(), bare(value.as_table()?)));
        Some(Known {
            table: match table {
                Some(table) => Some(table?),
                None => None,
            },
            patterns: patterns.map(|row| pattern(&row.key, &row.entry.value)).collect::<Option<_>>()?,
            schedules: schedules.map(|row| schedule_of(&row.key, &row.entry.value)).collect::<Option<_>>()?,
        })
    }
}

fn table_of<const N: usize>(rows: [(&str, Value); N]) -> Value {
    let mut table = Table::new();
    rows.into_iter().for_each(|(key, value)| table.set(key, value));
    Value::Table(table)
}

fn schedule_of(name: &str, value: &Value) -> Option<Schedule> {
    let table = value.as_table()?;
    let number = |key: &str| match table.get(key)?.value {
        Value::Int(number) => Some(number),
        _ => None,
    };
    let when = match (table.get("cron"), number("every"), number("at")) {
        (Some(cron), None, None) => When::Cron(cron.value.as_text()?.parse().ok()?),
        (None, Some(every), Some(at)) => When::Every { first: Time(at), period: Duration(every) },
        (None, None, Some(at)) => When::Once(Time(at)),
        _ => return None,
    };
    let words = table.get("do")?.value.as_list()?.iter();
    let words = words.map(|word| word.value.as_text().map(str::to_owned)).collect::<Option<_>>()?;
    Some(Schedule { name: name.to_owned(), when, words })
}

/// A table without places: those of the text are no places of a file.
fn bare(table: &Table) -> Table {
    let mut out = Table::new();
    table.rows().iter().for_each(|row| out.set(&row.key, bare_value(&row.entry.value)));
    out
}

fn bare_value(value: &Value) -> Value {
    match value {
        Value::Table(table) => Value::Table(bare(table)),
        Value::List(list) => Value::List(list.iter().map(|entry| bare_value(&entry.value).into()).collect()),
        other => other.clone(),
    }
}
