//! Decision tables: what a situation gives to whom.

use std::path::Path;

use rusqlite::{Connection, OptionalExtension as _, Transaction};
use types::Time;
use types::value::Table;

use crate::error::{Result, check_word};
use crate::{KnowledgeError, Listed, text};

/// A decision table: for each situation the weight of each agent, from 0 to 1.
///
/// Each put of other weights is a version of its own; those before are kept.
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
    /// Whether situations and agents are known is for those to say who know them: here a row needs a name and a table of weights.
    pub(crate) fn check(&self) -> Result<()> {
        check_word("the name of a decision table", &self.name)?;
        let name = &self.name;
        if self.weights.is_empty() {
            let help = "give it one at least, as in free = { wall = 1.0 }";
            return Err(KnowledgeError::wrong(format!("table \"{name}\" has no row"), help));
        }
        for row in self.weights.rows() {
            let help = "a row is as in free = { safety = 0.0, wall = 1.0 }";
            let Some(agents) = row.entry.value.as_table() else {
                let what = format!(
                    "table \"{name}\": \"{}\" is {}, not a table of weights",
                    row.key,
                    row.entry.value.kind()
                );
                return Err(KnowledgeError::wrong(what, help));
            };
            for agent in agents.rows() {
                let value = &agent.entry.value;
                if !value.as_float().is_some_and(|weight| (0.0..=1.0).contains(&weight)) {
                    let (row, agent) = (&row.key, &agent.key);
                    let what = format!(
                        "table \"{name}\": the weight of \"{agent}\" in \"{row}\" is {value}, not a number from 0 to 1"
                    );
                    return Err(KnowledgeError::wrong(what, help));
                }
            }
        }
        let written = text::write(&self.weights);
        written
            .map(drop)
            .map_err(|why| KnowledgeError::wrong(format!("table \"{name}\": {why}"), "each name stands once"))
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
        transaction
            .execute(
                "INSERT INTO decision_table (name, version, time, weights) VALUES (?1, ?2, ?3, ?4)",
                (&self.name, version, self.time.0, weights),
            )
            .map(drop)
            .map_err(failed)
    }
}

/// All versions of a table, the newest first.
pub(crate) fn history(file: &Path, connection: &Connection, name: &str) -> Result<Vec<Version>> {
    let failed = |error: rusqlite::Error| KnowledgeError::of(file, &error);
    let mut statement = connection
        .prepare("SELECT version, time, weights FROM decision_table WHERE name = ?1 ORDER BY version DESC")
        .map_err(failed)?;
    let mut rows = statement.query([name]).map_err(failed)?;
    let mut versions = Vec::new();
    while let Some(row) = rows.next().map_err(failed)? {
        let line: String = row.get(2).map_err(failed)?;
        versions.push(Version {
            number: row.get(0).map_err(failed)?,
            time: Time(row.get(1).map_err(failed)?),
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
