//! The form of the file: which tables there are, and the steps from each form to the next.

use std::path::Path;

use rusqlite::{Connection, TransactionBehavior};

use crate::error::Result;
use crate::{KnowledgeError, seal};

/// Marks a file as a knowledge base: `SNWK` in ASCII.
pub(crate) const MARK: i64 = 0x534E_574B;

/// Step `n` leads from form `n` to form `n + 1`. A step that was released never changes; a new form is a new step.
pub(crate) const STEPS: &[&str] = &[
    "
CREATE TABLE decision_table (
    name TEXT NOT NULL,
    version INTEGER NOT NULL,
    time INTEGER NOT NULL,
    weights TEXT NOT NULL,
    PRIMARY KEY (name, version)
) STRICT, WITHOUT ROWID;

CREATE TABLE fact (
    id INTEGER PRIMARY KEY,
    subject TEXT NOT NULL,
    predicate TEXT NOT NULL,
    object TEXT NOT NULL,
    source TEXT NOT NULL,
    confidence REAL NOT NULL CHECK (confidence BETWEEN 0 AND 1),
    time INTEGER NOT NULL,
    UNIQUE (subject, predicate, object, source)
) STRICT;
CREATE INDEX fact_by_object ON fact (predicate, object);

CREATE TABLE pattern (
    name TEXT NOT NULL PRIMARY KEY,
    kind TEXT NOT NULL,
    media_type TEXT NOT NULL,
    parameters TEXT NOT NULL,
    bytes BLOB NOT NULL
) STRICT, WITHOUT ROWID;

CREATE TABLE schedule (
    name TEXT NOT NULL PRIMARY KEY,
    kind TEXT NOT NULL CHECK (kind IN ('once', 'every', 'cron')),
    first INTEGER,
    period INTEGER,
    cron TEXT,
    words TEXT NOT NULL
) STRICT, WITHOUT ROWID;

CREATE TABLE map (
    name TEXT NOT NULL PRIMARY KEY,
    time INTEGER NOT NULL,
    resolution REAL NOT NULL,
    x REAL NOT NULL,
    y REAL NOT NULL,
    heading REAL NOT NULL,
    width INTEGER NOT NULL,
    height INTEGER NOT NULL,
    cells BLOB NOT NULL
) STRICT;
",
    seal::STEP,
];

/// From this form on rows have sums.
const SEALED: usize = 2;

/// What a file is, by its head and its list of tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Form {
    /// Nothing was ever written into it.
    Fresh,
    /// A knowledge base of this form, which is known.
    Known(usize),
}

/// Looks what a file is, and changes nothing.
pub(crate) fn look(connection: &Connection, file: &Path, steps: &[&str]) -> Result<Form> {
    let (mark, version, tables) = head(connection).map_err(|error| KnowledgeError::of(file, &error))?;
    match usize::try_from(version) {
        _ if mark == 0 && version == 0 && tables == 0 => Ok(Form::Fresh),
        _ if mark != MARK => Err(KnowledgeError::Foreign {
            file: file.to_owned(),
            why: "it is a database of another program".to_owned(),
        }),
        Ok(form) if (1..=steps.len()).contains(&form) => Ok(Form::Known(form)),
        Ok(form) if form > steps.len() => {
            Err(KnowledgeError::Newer { file: file.to_owned(), found: version, known: steps.len() as i64 })
        }
        _ => Err(KnowledgeError::damaged(file, format!("there is no form {version}"))),
    }
}

/// The same, and refuses a file of a known form that is damaged; all of one moment.
pub(crate) fn look_through(connection: &Connection, file: &Path, steps: &[&str]) -> Result<Form> {
    let moment = connection.unchecked_transaction().map_err(|error| KnowledgeError::of(file, &error))?;
    let form = look(&moment, file, steps)?;
    if let Form::Known(form) = form {
        check(&moment, file, &steps[..form])?;
    }
    Ok(form)
}

/// Mark, number of the form, and how many tables there are, all of one moment.
fn head(connection: &Connection) -> rusqlite::Result<(i64, i64, i64)> {
    let _moment = connection.is_autocommit().then(|| connection.unchecked_transaction()).transpose()?;
    let number = |sql: &str| connection.query_row(sql, [], |row| row.get(0));
    Ok((
        number("PRAGMA application_id")?,
        number("PRAGMA user_version")?,
        number("SELECT count(*) FROM sqlite_schema")?,
    ))
}

/// Brings a file to the newest form, all steps or none.
pub(crate) fn bring_up(connection: &mut Connection, file: &Path, steps: &[&str]) -> Result<()> {
    let failed = |error: rusqlite::Error| KnowledgeError::of(file, &error);
    if look(connection, file, steps)? == Form::Known(steps.len()) {
        return Ok(());
    }
    let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate).map_err(failed)?;
    // Another process may have done it meanwhile.
    let from = match look(&transaction, file, steps)? {
        Form::Fresh => 0,
        Form::Known(form) => form,
    };
    for step in &steps[from..] {
        transaction.execute_batch(step).map_err(failed)?;
    }
    if from < SEALED && steps.len() >= SEALED {
        seal::fill(&transaction).map_err(failed)?;
    }
    transaction
        .execute_batch(&format!("PRAGMA application_id = {MARK}; PRAGMA user_version = {};", steps.len()))
        .map_err(failed)?;
    transaction.commit().map_err(failed)
}

/// Refuses a file whose tables are not the ones of its form, whose pages or indices do not fit together, or whose rows are not those
/// that were written.
fn check(connection: &Connection, file: &Path, steps: &[&str]) -> Result<()> {
    let failed = |error: rusqlite::Error| KnowledgeError::of(file, &error);
    let right = Connection::open_in_memory().map_err(failed)?;
    steps.iter().try_for_each(|step| right.execute_batch(step)).map_err(failed)?;
    if schema(connection).map_err(failed)? != schema(&right).map_err(failed)? {
        return Err(KnowledgeError::damaged(file, "its tables are not those of a knowledge base"));
    }
    let found: String =
        connection.query_row("PRAGMA integrity_check(1)", [], |row| row.get(0)).map_err(failed)?;
    if found != "ok" {
        return Err(KnowledgeError::damaged(file, found));
    }
    if steps.len() < SEALED {
        return Ok(());
    }
    seal::check(connection).map_err(failed)?.map_err(|why| KnowledgeError::damaged(file, why))
}

/// All that was ever created, as it was written. Statistics that tools add change nothing.
fn schema(connection: &Connection) -> rusqlite::Result<Vec<(String, Option<String>)>> {
    let sql =
        "SELECT type || ' ' || name, sql FROM sqlite_schema WHERE name NOT LIKE 'sqlite_stat%' ORDER BY name";
    let mut statement = connection.prepare(sql)?;
    statement.query_map([], |row| Ok((row.get(0)?, row.get(1)?)))?.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = "knowledge.db";
    const NEXT: &str = "ALTER TABLE fact ADD COLUMN place TEXT NOT NULL DEFAULT '';";

    fn with(steps: &[&str]) -> Connection {
        let mut connection = Connection::open_in_memory().unwrap();
        bring_up(&mut connection, Path::new(FILE), steps).unwrap();
        connection
    }

    fn facts(connection: &Connection) -> i64 {
        connection.query_row("SELECT count(*) FROM fact", [], |row| row.get(0)).unwrap()
    }

    const CUP: &str = "INSERT INTO fact (subject, predicate, object, source, confidence, time)
        VALUES ('cup', 'in', 'kitchen', '', 1.0, 0)";

    #[test]
    fn a_fresh_file_gets_the_newest_form_and_an_old_one_keeps_what_is_in_it() {
        let steps = [STEPS[0], STEPS[1], NEXT];
        let file = Path::new(FILE);
        assert_eq!(look(&with(&steps), file, &steps), Ok(Form::Known(3)));
        let mut old = with(&steps[..1]);
        old.execute_batch(CUP).unwrap();
        assert_eq!(look(&old, file, &steps), Ok(Form::Known(1)));
        bring_up(&mut old, file, &steps).unwrap();
        assert_eq!((look(&old, file, &steps), facts(&old)), (Ok(Form::Known(3)), 1));
        assert_eq!(check(&old, file, &steps), Ok(()), "its rows have sums now");
        old.execute_batch("UPDATE fact SET object = 'kitchem'").unwrap();
        assert!(matches!(check(&old, file, &steps), Err(KnowledgeError::Damaged { .. })));
    }

    #[test]
    fn rows_of_all_kinds_get_their_sums() {
        let mut old = with(&STEPS[..1]);
        old.execute_batch(CUP).unwrap();
        old.execute_batch(
            "INSERT INTO fact (subject, predicate, object, source, confidence, time)
                 VALUES ('cup', 'in', 'kitchen', 'camera', 0.5, 1);
             INSERT INTO decision_table VALUES ('home', 1, 0, '{}'), ('home', 2, 0, '{ a = 1 }');
             INSERT INTO pattern VALUES ('ball', 'colour', '', '{ hue_from = 350 }', x'');
             INSERT INTO schedule VALUES ('bell', 'every', 0, 60, NULL, '{}'), ('once', 'once', 1, NULL, NULL, '{}');
             INSERT INTO map VALUES ('hall', 0, 0.5, -0.0, 1, 2, 1, 1, x'07');",
        )
        .unwrap();
        bring_up(&mut old, Path::new(FILE), STEPS).unwrap();
        assert_eq!(check(&old, Path::new(FILE), STEPS), Ok(()));
        let rows = |name: &str| -> (i64, i64) {
            let sealed = format!(
                "SELECT rows, (SELECT count(DISTINCT crc) FROM {name}) FROM seal WHERE name = '{name}'"
            );
            old.query_row(&sealed, [], |row| Ok((row.get(0)?, row.get(1)?))).unwrap()
        };
        let kinds = ["fact", "decision_table", "pattern", "schedule", "map"];
        assert_eq!(kinds.map(rows), [(2, 2), (2, 2), (1, 1), (2, 2), (1, 1)]);
    }

    #[test]
    fn a_step_that_fails_changes_nothing() {
        let before = &STEPS[..1];
        let mut old = with(before);
        old.execute_batch(CUP).unwrap();
        let steps = [STEPS[0], STEPS[1], NEXT, "CREATE TABLE fact (x);"];
        assert!(bring_up(&mut old, Path::new(FILE), &steps).is_err());
        assert_eq!(look(&old, Path::new(FILE), &steps), Ok(Form::Known(1)));
        assert_eq!((check(&old, Path::new(FILE), before), facts(&old)), (Ok(()), 1));
    }

    #[test]
    fn a_form_that_comes_later_is_too_new() {
        let newer = with(&[STEPS[0], STEPS[1], NEXT]);
        let said = look(&newer, Path::new(FILE), STEPS).unwrap_err();
        assert_eq!(said.to_string(), "knowledge.db has form 3, and this program knows forms up to 2");
    }
}
