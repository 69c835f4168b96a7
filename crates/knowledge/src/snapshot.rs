//! Reading, all from one moment.

use std::path::Path;

use rusqlite::{Connection, Transaction};

use crate::error::Result;
use crate::{
    DecisionTable, Fact, Kind, KnowledgeError, Listed, Map, Pattern, Query, Reach, Reached, Schedule,
    Version, fact, map, pattern, schedule, table,
};

/// All that was known when it was taken. Writers go on meanwhile and are not seen; the file grows until it is dropped.
///
/// Every answer may be a [`KnowledgeError`]: what was read is damaged, or the system does not let it be read.
#[derive(Debug)]
pub struct Snapshot<'k> {
    file: &'k Path,
    transaction: Transaction<'k>,
}

impl<'k> Snapshot<'k> {
    pub(crate) fn take(file: &'k Path, connection: &'k mut Connection) -> Result<Snapshot<'k>> {
        let taken = connection.transaction().and_then(|transaction| {
            // The moment is that of the first look.
            transaction.query_row("SELECT count(*) FROM sqlite_schema", [], |_| Ok(()))?;
            Ok(transaction)
        });
        taken
            .map(|transaction| Snapshot { file, transaction })
            .map_err(|error| KnowledgeError::of(file, &error))
    }

    /// The newest version of a decision table.
    pub fn table(&self, name: &str) -> Result<Option<DecisionTable>> {
        let newest = self.newest(name)?;
        Ok(newest.map(|Version { weights, time, .. }| DecisionTable { name: name.to_owned(), weights, time }))
    }

    /// The same with its number.
    pub fn newest(&self, name: &str) -> Result<Option<Version>> {
        Ok(table::history(self.file, &self.transaction, name, 1)?.pop())
    }

    /// All versions of a decision table, the newest first.
    pub fn history(&self, name: &str) -> Result<Vec<Version>> {
        table::history(self.file, &self.transaction, name, u32::MAX)
    }

    /// The facts that fit, the newest first.
    pub fn facts(&self, query: &Query) -> Result<Vec<Fact>> {
        self.done(query.run(&self.transaction))
    }

    /// What is reached over many steps, the nearest first. Where the steps begin is not named.
    pub fn reach(&self, reach: &Reach) -> Result<Vec<Reached>> {
        self.done(reach.run(&self.transaction))
    }

    /// A pattern.
    pub fn pattern(&self, name: &str) -> Result<Option<Pattern>> {
        pattern::get(self.file, &self.transaction, name)
    }

    /// A schedule.
    pub fn schedule(&self, name: &str) -> Result<Option<Schedule>> {
        Ok(self.schedules()?.into_iter().find(|schedule| schedule.name == name))
    }

    /// All schedules, by their names; [`due`](crate::due) says which are due.
    pub fn schedules(&self) -> Result<Vec<Schedule>> {
        schedule::all(self.file, &self.transaction)
    }

    /// A map.
    pub fn map(&self, name: &str) -> Result<Option<Map>> {
        map::get(self.file, &self.transaction, name)
    }

    /// All of a kind, by their names; facts the newest first.
    pub fn list(&self, kind: Kind) -> Result<Vec<Listed>> {
        match kind {
            Kind::Table => self.done(table::list(&self.transaction)),
            Kind::Fact => self.done(fact::list(&self.transaction)),
            Kind::Pattern => self.done(pattern::list(&self.transaction)),
            Kind::Map => self.done(map::list(&self.transaction)),
            Kind::Schedule => Ok(self.schedules()?.iter().map(Schedule::listed).collect()),
        }
    }

    fn done<T>(&self, done: rusqlite::Result<T>) -> Result<T> {
        done.map_err(|error| KnowledgeError::of(self.file, &error))
    }
}
