//! Facts: who says that something holds between a subject and an object, how surely, and since when.

use std::path::Path;

use rusqlite::types::Value as Sql;
use rusqlite::{Connection, Transaction, params_from_iter};
use types::Time;

use crate::error::{Result, check_word};
use crate::{KnowledgeError, Listed, seal};

/// A fact such as `cup in kitchen`. A subject may have several objects for one predicate.
///
/// What two sources say are two facts; what one source says again takes the place of what it said before.
#[derive(Clone, Debug, PartialEq)]
pub struct Fact {
    /// Of what it is said.
    pub subject: String,
    /// What holds between the two.
    pub predicate: String,
    /// With what it holds.
    pub object: String,
    /// How sure it is, from 0 to 1.
    pub confidence: f64,
    /// When it was learnt, on the writer's clock.
    pub time: Time,
    /// Who says it; empty when nobody is named.
    pub source: String,
}

impl Fact {
    /// A sure fact from nobody in particular.
    pub fn new(
        subject: impl Into<String>,
        predicate: impl Into<String>,
        object: impl Into<String>,
        time: Time,
    ) -> Fact {
        Fact {
            subject: subject.into(),
            predicate: predicate.into(),
            object: object.into(),
            confidence: 1.0,
            time,
            source: String::new(),
        }
    }

    pub(crate) fn check(&self) -> Result<()> {
        check_word("the subject of a fact", &self.subject)?;
        check_word("the predicate of a fact", &self.predicate)?;
        check_word("the object of a fact", &self.object)?;
        if !self.source.is_empty() {
            check_word("the source of a fact", &self.source)?;
        }
        check_confidence(self.confidence)
    }

    pub(crate) fn put(&self, file: &Path, transaction: &Transaction<'_>) -> Result<()> {
        // A new row each time, so that the last of those with one time is the one that was put last.
        let Fact { subject, predicate, object, confidence, time, source } = self;
        let put = seal::put(transaction, "fact", &[subject, predicate, object, confidence, &time.0, source]);
        put.map_err(|error| KnowledgeError::of(file, &error))
    }
}

fn check_confidence(confidence: f64) -> Result<()> {
    if (0.0..=1.0).contains(&confidence) {
        return Ok(());
    }
    let help = "1 is sure, 0 is not at all";
    Err(KnowledgeError::wrong(format!("the confidence is {confidence}, not a number from 0 to 1"), help))
}

/// Which facts are wanted. What is `None` may be anything.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Query {
    /// The subject.
    pub subject: Option<String>,
    /// The predicate.
    pub predicate: Option<String>,
    /// The object.
    pub object: Option<String>,
    /// The source; `Some` of an empty text is nobody in particular.
    pub source: Option<String>,
    /// The least confidence, from 0 to 1.
    pub least_confidence: f64,
    /// How many at most; all when nothing is said.
    pub most: Option<u32>,
}

impl Query {
    /// Subject, predicate and object; `_` and `*` stand for anything.
    pub fn of(parts: [&str; 3]) -> Query {
        let [subject, predicate, object] = parts.map(|part| match part {
            "_" | "*" => None,
            part => Some(part.to_owned()),
        });
        Query { subject, predicate, object, ..Query::default() }
    }

    /// The condition of a statement, and what its marks stand for.
    fn condition(&self) -> (String, Vec<Sql>) {
        let mut condition = "confidence >= ?".to_owned();
        let mut values = vec![Sql::Real(self.least_confidence)];
        let parts = [
            ("subject", &self.subject),
            ("predicate", &self.predicate),
            ("object", &self.object),
            ("source", &self.source),
        ];
        for (column, part) in parts {
            if let Some(part) = part {
                condition += &format!(" AND {column} = ?");
                values.push(Sql::Text(part.clone()));
            }
        }
        (condition, values)
    }

    pub(crate) fn run(&self, connection: &Connection) -> rusqlite::Result<Vec<Fact>> {
        let (condition, mut values) = self.condition();
        values.push(Sql::Integer(self.most.map_or(-1, i64::from)));
        let mut statement = connection.prepare(&format!(
            "SELECT subject, predicate, object, confidence, time, source, crc FROM fact
             WHERE {condition} ORDER BY time DESC, id DESC LIMIT ?"
        ))?;
        let facts = statement.query_map(params_from_iter(values), |row| {
            seal::verify(row, 6)?;
            Ok(Fact {
                subject: row.get(0)?,
                predicate: row.get(1)?,
                object: row.get(2)?,
                confidence: row.get(3)?,
                time: Time(row.get(4)?),
                source: row.get(5)?,
            })
        })?;
        facts.collect()
    }

    pub(crate) fn retract(&self, file: &Path, transaction: &Transaction<'_>) -> Result<usize> {
        let (condition, values) = self.condition();
        transaction
            .execute(&format!("DELETE FROM fact WHERE {condition}"), params_from_iter(values))
            .map_err(|error| KnowledgeError::of(file, &error))
    }
}

/// A question over many steps: what is in the house, when the cup is in the kitchen and the kitchen in the house?
#[derive(Clone, Debug, PartialEq)]
pub struct Reach {
    /// From where the steps go.
    pub from: String,
    /// The predicate of every step.
    pub predicate: String,
    /// `true` goes from subjects to their objects (what the cup is in), `false` from objects to their subjects (what is in the
    /// house).
    pub to_objects: bool,
    /// The least confidence of each step, from 0 to 1.
    pub least_confidence: f64,
    /// The most steps. It bounds the work: each thing is looked at once for each number of steps at most, so circles end.
    pub most_steps: u32,
}

/// Something that was reached.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reached {
    /// What.
    pub name: String,
    /// After how many steps at least.
    pub steps: u32,
}

impl Reach {
    /// The most steps that a question has by itself. 64: deeper places are a circle, not a house.
    pub const MOST_STEPS: u32 = 64;

    /// All that is `predicate` something that is … `predicate` the object, as all that is in the house.
    pub fn to(predicate: impl Into<String>, object: impl Into<String>) -> Reach {
        let most_steps = Reach::MOST_STEPS;
        Reach {
            from: object.into(),
            predicate: predicate.into(),
            to_objects: false,
            least_confidence: 0.0,
            most_steps,
        }
    }

    /// All that the subject is `predicate` of over any steps, as all that the cup is in.
    pub fn from(subject: impl Into<String>, predicate: impl Into<String>) -> Reach {
        Reach { to_objects: true, ..Reach::to(predicate, subject) }
    }

    pub(crate) fn run(&self, connection: &Connection) -> rusqlite::Result<Vec<Reached>> {
        let (near, far) = if self.to_objects { ("subject", "object") } else { ("object", "subject") };
        let mut statement = connection.prepare(&format!(
            "WITH RECURSIVE reached (name, steps) AS (
                 SELECT ?2, 0
                 UNION
                 SELECT fact.{far}, steps + 1 FROM reached
                 JOIN fact ON fact.{near} = reached.name AND fact.predicate = ?1 AND fact.confidence >= ?3
                 WHERE steps < ?4
             )
             SELECT name, min(steps) FROM reached WHERE name <> ?2 GROUP BY name ORDER BY 2, 1"
        ))?;
        let found = statement
            .query_map((&self.predicate, &self.from, self.least_confidence, self.most_steps), |row| {
                Ok(Reached { name: row.get(0)?, steps: row.get(1)? })
            })?;
        found.collect()
    }
}

pub(crate) fn list(connection: &Connection) -> rusqlite::Result<Vec<Listed>> {
    let listed = |fact: Fact| {
        let said = if fact.source.is_empty() { String::new() } else { format!(", says {}", fact.source) };
        Listed {
            name: format!("{} {} {}", fact.subject, fact.predicate, fact.object),
            what: format!("confidence {}{said}", fact.confidence),
        }
    };
    Ok(Query::default().run(connection)?.into_iter().map(listed).collect())
}
