//! What can be kept, of any kind.

use std::path::Path;

use rusqlite::Transaction;

use crate::error::Result;
use crate::{DecisionTable, Fact, Map, Pattern, Schedule};

/// The kinds of things that are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// Decision tables: [`DecisionTable`].
    Table,
    /// Facts: [`Fact`].
    Fact,
    /// Patterns: [`Pattern`].
    Pattern,
    /// Schedules: [`Schedule`].
    Schedule,
    /// Maps: [`Map`].
    Map,
}

impl Kind {
    /// All of them.
    pub const ALL: [Kind; 5] = [Kind::Table, Kind::Fact, Kind::Pattern, Kind::Schedule, Kind::Map];

    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Kind::Table => "table",
            Kind::Fact => "fact",
            Kind::Pattern => "pattern",
            Kind::Schedule => "schedule",
            Kind::Map => "map",
        }
    }

    /// The kind of this name.
    pub fn named(name: &str) -> Option<Kind> {
        Kind::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

/// One thing that is put.
#[derive(Clone, Debug, PartialEq)]
pub enum Item {
    /// A decision table.
    Table(DecisionTable),
    /// A fact.
    Fact(Fact),
    /// A pattern.
    Pattern(Pattern),
    /// A schedule.
    Schedule(Schedule),
    /// A map.
    Map(Map),
}

macro_rules! item_from {
    ($($from:ty => $variant:ident;)*) => { $(
        impl From<$from> for Item {
            fn from(one: $from) -> Item {
                Item::$variant(one)
            }
        }
    )* };
}

item_from! {
    DecisionTable => Table;
    Fact => Fact;
    Pattern => Pattern;
    Schedule => Schedule;
    Map => Map;
}

/// A thing in a list: what it is called and, in a few words, what it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Listed {
    /// Its name; of a fact its three parts.
    pub name: String,
    /// What it is, for people.
    pub what: String,
}

impl Item {
    /// Whether it is as it must be; what is not is never put.
    ///
    /// # Errors
    /// [`KnowledgeError::Wrong`](crate::KnowledgeError::Wrong) says what is wrong, and how it is mended.
    pub fn check(&self) -> Result<()> {
        match self {
            Item::Table(one) => one.check(),
            Item::Fact(one) => one.check(),
            Item::Pattern(one) => one.check(),
            Item::Schedule(one) => one.check(),
            Item::Map(one) => one.check(),
        }
    }

    pub(crate) fn put(&self, file: &Path, transaction: &Transaction<'_>) -> Result<()> {
        match self {
            Item::Table(one) => one.put(file, transaction),
            Item::Fact(one) => one.put(file, transaction),
            Item::Pattern(one) => one.put(file, transaction),
            Item::Schedule(one) => one.put(file, transaction),
            Item::Map(one) => one.put(file, transaction),
        }
    }
}
