//! The file as it is opened, written and emptied.

use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use rusqlite::config::DbConfig;
use rusqlite::{Connection, OpenFlags, Transaction, TransactionBehavior};

use crate::error::Result;
use crate::layout::{self, Form, STEPS};
use crate::{Item, Kind, KnowledgeError, Query, Snapshot};

/// How long a writer waits for another one before it gives up (5 s: no write of ours takes so long).
pub const PATIENCE: Duration = Duration::from_secs(5);

/// A knowledge base: one file that outlives the run.
///
/// ```text
///  open ──▶ put, put_all, remove, retract   each whole, on the disk when it answers
///       └─▶ read ──▶ Snapshot               all from one moment, whoever writes meanwhile
/// ```
///
/// One thread has it at a time; who needs it in two places opens the file twice.
#[derive(Debug)]
pub struct Knowledge {
    file: PathBuf,
    connection: Connection,
}

impl Knowledge {
    /// Opens a file to read and to write, and makes it if there is none; its folder must be there. A file of an older form is
    /// brought up. The whole file is looked through for damage, which takes as long as reading it.
    ///
    /// # Errors
    /// All that [`KnowledgeError`] says of files. The file is then as it was.
    pub fn open(path: impl AsRef<Path>) -> Result<Knowledge> {
        let file = path.as_ref();
        check_path(file)?;
        let mut connection =
            connect(file, OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_CREATE)?;
        layout::look_through(&connection, file, STEPS)?;
        if connection.is_readonly("main").unwrap_or(true) {
            let why = "it may be read only".to_owned();
            return Err(KnowledgeError::NoAccess { file: file.to_owned(), why });
        }
        log_ahead(&connection, file)?;
        layout::bring_up(&mut connection, file, STEPS)?;
        Ok(Knowledge { file: file.to_owned(), connection })
    }

    /// Opens a file to read it alone. It must be there; whoever writes it meanwhile goes on.
    ///
    /// # Errors
    /// All that [`KnowledgeError`] says of files.
    pub fn open_read_only(path: impl AsRef<Path>) -> Result<Knowledge> {
        let file = path.as_ref();
        check_path(file)?;
        if !file.exists() {
            return Err(KnowledgeError::NotThere { file: file.to_owned() });
        }
        // A connection that may not write cannot clear away the files beside it. Where the file is read only, so is this.
        let connection = connect(file, OpenFlags::SQLITE_OPEN_READ_WRITE)?;
        connection
            .execute_batch("PRAGMA query_only = ON")
            .map_err(|error| KnowledgeError::of(file, &error))?;
        let form = layout::look_through(&connection, file, STEPS).map_err(|error| match error {
            KnowledgeError::NoAccess { file, why } => {
                let why =
                    format!("{why}; who reads needs two files beside it, or a folder in which to make them");
                KnowledgeError::NoAccess { file, why }
            }
            other => other,
        })?;
        match form {
            Form::Fresh => Err(KnowledgeError::NotThere { file: file.to_owned() }),
            Form::Known(found) if found < STEPS.len() => {
                let (found, known) = (found as i64, STEPS.len() as i64);
                Err(KnowledgeError::Older { file: file.to_owned(), found, known })
            }
            Form::Known(_) => Ok(Knowledge { file: file.to_owned(), connection }),
        }
    }

    /// The file.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// All that is known at this moment; what is written later is not seen.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn read(&mut self) -> Result<Snapshot<'_>> {
        Snapshot::take(&self.file, &mut self.connection)
    }

    /// A number that is another one whenever somebody else has written since it was asked for last. It costs next to nothing.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn writes(&self) -> Result<i64> {
        let number = self.connection.query_row("PRAGMA data_version", [], |row| row.get(0));
        number.map_err(|error| KnowledgeError::of(&self.file, &error))
    }

    /// Puts one thing, in the place of the one of its name. It is on the disk when this answers.
    ///
    /// # Errors
    /// [`KnowledgeError::Wrong`] when it is not what it must be, and when the file cannot be written. Nothing is changed then.
    pub fn put(&mut self, item: impl Into<Item>) -> Result<()> {
        self.put_all([item.into()])
    }

    /// Puts several things, all or none.
    ///
    /// # Errors
    /// As [`put`](Knowledge::put), for the first that is wrong.
    pub fn put_all(&mut self, items: impl IntoIterator<Item = Item>) -> Result<()> {
        let items: Vec<Item> = items.into_iter().collect();
        items.iter().try_for_each(Item::check)?;
        self.change(|file, transaction| items.iter().try_for_each(|item| item.put(file, transaction)))
    }

    /// Removes the thing of this kind and name, a decision table with all its versions. Says whether there was one.
    ///
    /// # Errors
    /// [`KnowledgeError::Wrong`] for facts, which have no names; and when the file cannot be written.
    pub fn remove(&mut self, kind: Kind, name: &str) -> Result<bool> {
        let table = match kind {
            Kind::Table => "decision_table",
            Kind::Pattern => "pattern",
            Kind::Schedule => "schedule",
            Kind::Map => "map",
            Kind::Fact => {
                return Err(KnowledgeError::wrong(
                    "a fact has no name",
                    "say its subject, predicate and object",
                ));
            }
        };
        self.change(|file, transaction| {
            let removed = transaction.execute(&format!("DELETE FROM {table} WHERE name = ?1"), [name]);
            removed.map(|rows| rows > 0).map_err(|error| KnowledgeError::of(file, &error))
        })
    }

    /// Takes back all facts that fit, and says how many they were. A limit in the query counts for nothing.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn retract(&mut self, query: &Query) -> Result<usize> {
        self.change(|file, transaction| query.retract(file, transaction))
    }

    /// Does a change whole, or not at all.
    fn change<T>(&mut self, change: impl FnOnce(&Path, &Transaction<'_>) -> Result<T>) -> Result<T> {
        let (file, connection) = (&self.file, &mut self.connection);
        let failed = |error: rusqlite::Error| KnowledgeError::of(file, &error);
        let transaction =
            connection.transaction_with_behavior(TransactionBehavior::Immediate).map_err(failed)?;
        let done = change(file, &transaction)?;
        transaction.commit().map_err(failed)?;
        Ok(done)
    }
}

/// Refuses what is no plain file: opening a pipe would wait for ever.
fn check_path(file: &Path) -> Result<()> {
    let what = match fs::metadata(file) {
        Ok(found) if found.is_file() => return check_ends(file),
        Ok(found) if found.is_dir() => "a folder",
        Ok(_) => "a device or a pipe",
        Err(error) if error.kind() == std::io::ErrorKind::NotFound && file.file_name().is_some() => {
            return Ok(());
        }
        Err(error) => {
            return Err(KnowledgeError::NoAccess { file: file.to_owned(), why: error.to_string() });
        }
    };
    Err(KnowledgeError::NotAFile { file: file.to_owned(), what })
}

/// Refuses a file that begins as none of ours, and one that ends in the middle of a page: SQLite would take the rest for zeros.
fn check_ends(file: &Path) -> Result<()> {
    let failed =
        |error: std::io::Error| KnowledgeError::NoAccess { file: file.to_owned(), why: error.to_string() };
    // Where there is a log, it may have the page whole.
    let mut log = file.as_os_str().to_owned();
    log.push("-wal");
    let has_log = fs::metadata(log).is_ok_and(|log| log.len() > 0);
    let mut head = Vec::new();
    let open = fs::File::open(file).map_err(failed)?;
    let length = open.metadata().map_err(failed)?.len();
    open.take(18).read_to_end(&mut head).map_err(failed)?;
    if length == 0 {
        return Ok(());
    }
    let Some([high, low]) = head.strip_prefix(b"SQLite format 3\0") else {
        let why = "it does not begin as a database does".to_owned();
        return Err(KnowledgeError::Foreign { file: file.to_owned(), why });
    };
    let page = match u64::from(u16::from_be_bytes([*high, *low])) {
        1 => 65_536,
        page => page.max(1),
    };
    if has_log || length.is_multiple_of(page) {
        return Ok(());
    }
    Err(KnowledgeError::damaged(file, format!("its end is missing (it has {length} bytes)")))
}

fn connect(file: &Path, flags: OpenFlags) -> Result<Connection> {
    // Names such as ":memory:" are names of files too.
    let plain = if file.is_relative() { Path::new(".").join(file) } else { file.to_owned() };
    let open = || -> rusqlite::Result<Connection> {
        let connection = Connection::open_with_flags(plain, flags | OpenFlags::SQLITE_OPEN_NO_MUTEX)?;
        connection.busy_timeout(PATIENCE)?;
        // Somebody else may have made the file: nothing in it is run, and nothing writes past its tables.
        connection.set_db_config(DbConfig::SQLITE_DBCONFIG_DEFENSIVE, true)?;
        connection.set_db_config(DbConfig::SQLITE_DBCONFIG_TRUSTED_SCHEMA, false)?;
        connection.execute_batch(
            // Sums over tables are kept by triggers, also where a row takes the place of another. And what was written goes from the log into the
            // file at once: a log that is damaged later takes nothing with it.
            "PRAGMA foreign_keys = ON; PRAGMA cell_size_check = ON; PRAGMA synchronous = FULL;
             PRAGMA recursive_triggers = ON; PRAGMA wal_autocheckpoint = 1;",
        )?;
        Ok(connection)
    };
    open().map_err(|error| KnowledgeError::of(file, &error))
}

/// Lets the file have a write-ahead log, which stays with it from then on.
fn log_ahead(connection: &Connection, file: &Path) -> Result<()> {
    /// Others that make the same file at this moment are waited for, each for as long as [`PATIENCE`].
    const TRIES: usize = 20;
    let failed = |error: rusqlite::Error| KnowledgeError::of(file, &error);
    for _ in 0..TRIES {
        match connection.query_row("PRAGMA journal_mode = WAL", [], |row| row.get::<_, String>(0)) {
            Ok(mode) if mode == "wal" => return Ok(()),
            Ok(mode) => {
                let why = format!("its folder allows no write-ahead log ({mode})");
                return Err(KnowledgeError::NoAccess { file: file.to_owned(), why });
            }
            Err(error) if matches!(KnowledgeError::of(file, &error), KnowledgeError::Busy { .. }) => {
                connection.execute_batch("BEGIN IMMEDIATE; COMMIT;").map_err(failed)?;
            }
            Err(error) => return Err(failed(error)),
        }
    }
    Err(KnowledgeError::Busy { file: file.to_owned() })
}
