//! Decision tables: what a situation gives to whom.

use std::path::Path;

use rusqlite::{Connection, OptionalExtension as _, Transaction};
use types::Time;
use types::value::{Row, Table, Value};

use crate::error::{Result, check_word};
use crate::{KnowledgeError, Listed, seal, text};

/// A decision table: for each situation the weight of each agent, from 0 to 1, or a table of what else it shall do.
///
/// Each put of another table is a version of its own; those before are kept.
#[derive(Clone, Debug, PartialEq)]
pub struct DecisionTable {
    /// What it is called.
    pub name: String,
    /// The weights, as in `"danger.near" = { safety = 1.0, wall = 0.0 }`.
    pub weights: Table,
    /// When it was put, on the writer's clock.
    pub time: Time,
}

/// One of the versions of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct Version {
    /// Its number, from 1.
    pub number: u32,
    /// When it was put, on the writer's clock.
    pub time: Time,
    /// The weights.
    pub weights: Table,
}

impl DecisionTable {
    /// Whether situations, agents and their entries are known is for those to say who know them: here a row needs a name and a table of
    /// what could be entries.
    pub(crate) fn check(&self) -> Result<()> {
        check_word("the name of a decision table", &self.name)?;
        let name = &self.name;
        let wrong =
            |why: String, help: &str| Err(KnowledgeError::wrong(format!("table \"{name}\": {why}"), help));
        let help = "a row is as in free = { safety = 0.0, wall = 1.0 }";
        if self.weights.is_empty() {
            let help = "give it one at least, as in free = { wall = 1.0 }";
            return Err(KnowledgeError::wrong(format!("table \"{name}\" has no row"), help));
        }
        for row in self.weights.rows() {
            if row.key.is_empty() {
                return wrong("a row has no name".into(), help);
            }
            let Some(entries) = row.entry.value.as_table() else {
                let kind = row.entry.value.kind();
                return wrong(format!("\"{}\" is {kind}, not a table of weights", row.key), help);
            };
            if let Some(why) = entries.rows().iter().find_map(|entry| mistake(entry, &row.key)) {
                return wrong(why, help);
            }
        }
        text::write(&self.weights).map(drop).or_else(|why| wrong(why, "each name stands once"))
    }

    /// A new version, unless the newest says the same.
    pub(crate) fn put(&self, file: &Path, transaction: &Transaction<'_>) -> Result<()> {
        let failed = |error: rusqlite::Error| KnowledgeError::of(file, &error);
        let weights = text::write(&self.weights).map_err(|why| KnowledgeError::wrong(why, ""))?;
        let newest: Option<(u32, String)> = transaction
            .query_row(
                "SELECT version, weights FROM decision_table WHERE name = ?1 ORDER BY version DESC LIMIT 1",
                [&self.name],
                |row| Ok((row.get(0)?, row.get(1)?)),
            )
            .optional()
            .map_err(failed)?;
        let version = match newest {
            Some((_, same)) if same == weights => return Ok(()),
            Some((version, _)) => version.saturating_add(1),
            None => 1,
        };
        seal::put(transaction, "decision_table", &[&self.name, &version, &self.time.0, &weights])
            .map_err(failed)
    }
}

/// The entries of a row that are numbers but no weights.
const NO_WEIGHTS: [&str; 3] = ["when", "until", "priority"];

/// What is wrong with an entry of a row.
fn mistake(entry: &Row, row: &str) -> Option<String> {
    let Row { key, entry, .. } = entry;
    let value = &entry.value;
    let finite = value.as_float().is_some_and(f64::is_finite);
    match value {
        Value::Text(_) | Value::Bool(_) => None,
        Value::Table(inner) => inner.rows().iter().find_map(|deeper| {
            let value = &deeper.entry.value;
            let fits = match value {
                Value::Text(_) | Value::Bool(_) => true,
                value if ["weight", "importance"].contains(&deeper.key.as_str()) => is_weight(value),
                value => value.as_float().is_some_and(|number| number.is_finite() && number >= 0.0),
            };
            let what = || format!("\"{}\" of \"{key}\" in \"{row}\" cannot be {value}", deeper.key);
            (!fits).then(what)
        }),
        _ if NO_WEIGHTS.contains(&key.as_str()) && finite => None,
        value if is_weight(value) => None,
        value => Some(format!("the weight of \"{key}\" in \"{row}\" is {value}, not a number from 0 to 1")),
    }
}

fn is_weight(value: &Value) -> bool {
    value.as_float().is_some_and(|weight| (0.0..=1.0).contains(&weight))
}

/// The versions of a table, the newest first, so many at most.
pub(crate) fn history(file: &Path, connection: &Connection, name: &str, most: u32) -> Result<Vec<Version>> {
    let failed = |error: rusqlite::Error| KnowledgeError::of(file, &error);
    let mut statement = connection
        .prepare(
            "SELECT name, version, time, weights, crc FROM decision_table WHERE name = ?1 ORDER BY version DESC LIMIT ?2",
        )
        .map_err(failed)?;
    let mut rows = statement.query((name, most)).map_err(failed)?;
    let mut versions = Vec::new();
    while let Some(row) = rows.next().map_err(failed)? {
        seal::verify(row, 4).map_err(failed)?;
        let line: String = row.get(3).map_err(failed)?;
        versions.push(Version {
            number: row.get(1).map_err(failed)?,
            time: Time(row.get(2).map_err(failed)?),
            weights: text::read(&line).ok_or_else(|| {
                KnowledgeError::damaged(file, format!("the table \"{name}\" cannot be read"))
            })?,
        });
    }
    Ok(versions)
}

pub(crate) fn list(connection: &Connection) -> rusqlite::Result<Vec<Listed>> {
    let mut statement =
        connection.prepare("SELECT name, max(version) FROM decision_table GROUP BY name ORDER BY name")?;
    let listed = statement.query_map([], |row| {
        Ok(Listed { name: row.get(0)?, what: format!("version {}", row.get::<_, u32>(1)?) })
    })?;
    listed.collect()
}
