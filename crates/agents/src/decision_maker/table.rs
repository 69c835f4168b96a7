//! The decision table: rows that say when a situation is active, and what it gives to whom.
//!
//! A table is read on the control side, with all that is wrong in it, and lies ready for the steps: situations in the order of
//! their priority, conditions as programs, names as plain values.

mod read;

use types::Name;
use types::messages::{Activity, Order};
use types::params::ParamValue;
use types::value::{Mistake, Row, Table, Value};

use super::condition::Condition;
use super::signal::{Known, Values};
use super::situation::Situation;

/// The keys of a row that name no agent.
pub const RESERVED: [&str; 4] = ["when", "until", "priority", "goal"];
/// What a row can say of an agent.
pub const SETTINGS: [&str; 5] = ["weight", "importance", "rate", "active", "method"];

/// A decision table as it is written, and as the steps need it.
#[derive(Clone, Debug)]
pub struct DecisionTable {
    written: Table,
    /// The situations, the highest priority first; of equal ones the first of the table.
    pub(super) rows: Vec<SituationRow>,
    /// The agents of which the table says more than weights.
    pub(super) ordered: Vec<Name>,
    /// The names that agents tell, of those that conditions use.
    pub(super) told: Vec<Name>,
    /// The places of all signals that the situations need.
    pub(super) needed: Vec<usize>,
}

/// When a situation is active, and what it says.
#[derive(Clone, Debug)]
pub(super) struct SituationRow {
    pub(super) name: Name,
    pub(super) when: When,
    pub(super) priority: i32,
    /// Empty where it says none.
    pub(super) goal: Name,
    pub(super) weights: Vec<(Name, f64)>,
    pub(super) orders: Vec<Order>,
}

/// How it is told whether a situation is active.
#[derive(Clone, Debug)]
pub(super) enum When {
    BuiltIn(Situation),
    Own {
        when: Condition,
        /// Where it is missing, the situation ends with its beginning.
        until: Option<Condition>,
    },
}

impl DecisionTable {
    /// Makes a table ready. What is wrong in it counts for nothing: [`mistakes`](Self::mistakes) says what that is.
    pub fn new(written: &Table) -> DecisionTable {
        read::read(written, None).0
    }

    /// All that is wrong with a table, with the places. `declared` are the names that conditions can use beside the signals that every
    /// decision maker knows; without them any name can be one.
    pub fn mistakes(written: &Table, declared: Option<&[String]>) -> Vec<Mistake> {
        read::read(written, declared).1
    }

    /// The rows of a table's rows that name agents, with their places.
    pub fn agents(written: &Table) -> impl Iterator<Item = &Row> {
        let rows = written.rows().iter().filter_map(|row| row.entry.value.as_table());
        rows.flat_map(Table::rows).filter(|row| !RESERVED.contains(&row.key.as_str()))
    }

    /// The name of the signal at a place.
    pub(super) fn signal(&self, place: usize) -> Name {
        match Known::ALL.get(place) {
            Some(known) => known.name().into(),
            None => self.told.get(place - Known::ALL.len()).copied().unwrap_or_default(),
        }
    }

    /// The places of the names that agents tell.
    pub(super) fn told(&self) -> impl Iterator<Item = (usize, &Name)> {
        self.told.iter().enumerate().map(|(i, name)| (Values::place_of_told(i), name))
    }
}

impl Default for DecisionTable {
    /// The situations that are built in; they say nothing.
    fn default() -> DecisionTable {
        DecisionTable::new(&Table::new())
    }
}

/// Tables are equal when they say the same.
impl PartialEq for DecisionTable {
    fn eq(&self, other: &DecisionTable) -> bool {
        self.written == other.written
    }
}

impl From<Table> for DecisionTable {
    fn from(written: Table) -> DecisionTable {
        DecisionTable::new(&written)
    }
}

/// Whether the table is right depends on the names that are declared beside it: the parameters as a whole say that.
impl ParamValue for DecisionTable {
    const KIND: &'static str = "a decision table";

    fn from_value(value: &Value) -> Option<DecisionTable> {
        value.as_table().map(DecisionTable::new)
    }

    fn to_value(&self) -> Value {
        Value::Table(self.written.clone())
    }
}

/// What `own` leaves unsaid, `other` may say.
pub(super) fn filled(own: &Order, other: &Order) -> Order {
    Order {
        agent: own.agent,
        importance: if own.importance().is_some() { own.importance } else { other.importance },
        rate: if own.rate().is_some() { own.rate } else { other.rate },
        method: if own.method.is_empty() { other.method } else { own.method },
        activity: if own.activity == Activity::Unsaid { other.activity } else { own.activity },
    }
}
