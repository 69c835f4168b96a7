//! What can go wrong with a knowledge base.

use std::path::{Path, PathBuf};

use rusqlite::ErrorCode;

/// Why something could not be read or written. The text says what and where, [`help`](KnowledgeError::help) how to mend it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum KnowledgeError {
    /// There is no file, or an empty one, and it was to be read only.
    #[error("there is no knowledge base {}", file.display())]
    NotThere {
        /// The file that was asked for.
        file: PathBuf,
    },
    /// The path leads to a folder, a device or a pipe.
    #[error("{} is {what}, not a file", file.display())]
    NotAFile {
        /// The path.
        file: PathBuf,
        /// What it is instead.
        what: &'static str,
    },
    /// The file is something else: a text, a picture, the database of another program.
    #[error("{} is no knowledge base: {why}", file.display())]
    Foreign {
        /// The file.
        file: PathBuf,
        /// How that was seen.
        why: String,
    },
    /// A newer program wrote the file, in a form that this one does not know.
    #[error("{} has form {found}, and this program knows forms up to {known}", file.display())]
    Newer {
        /// The file.
        file: PathBuf,
        /// The number of its form.
        found: i64,
        /// The newest form that is known.
        known: i64,
    },
    /// An older program wrote the file, and it was opened for reading only.
    #[error("{} has the old form {found}, which is brought up to {known} first", file.display())]
    Older {
        /// The file.
        file: PathBuf,
        /// The number of its form.
        found: i64,
        /// The form that is wanted.
        known: i64,
    },
    /// Parts of the file are missing, or are not what was written.
    #[error("{} is damaged: {why}", file.display())]
    Damaged {
        /// The file.
        file: PathBuf,
        /// What was found.
        why: String,
    },
    /// The system does not let the file be read or written: no rights, no folder, no room on the disk.
    #[error("{} cannot be read or written: {why}", file.display())]
    NoAccess {
        /// The file.
        file: PathBuf,
        /// What the system says.
        why: String,
    },
    /// Another process has been writing for longer than [`PATIENCE`](crate::PATIENCE).
    #[error("{} is being written by another process", file.display())]
    Busy {
        /// The file.
        file: PathBuf,
    },
    /// What was to be written is not what it must be; nothing was changed.
    #[error("{what}")]
    Wrong {
        /// What is wrong, and where in it.
        what: String,
        /// How to mend it.
        help: String,
    },
    /// Anything else that the database refuses.
    #[error("{}: {why}", file.display())]
    Failed {
        /// The file.
        file: PathBuf,
        /// What the database says.
        why: String,
    },
}

/// What went wrong, or what was asked for.
pub(crate) type Result<T> = std::result::Result<T, KnowledgeError>;

impl KnowledgeError {
    /// How to mend it.
    pub fn help(&self) -> String {
        match self {
            KnowledgeError::NotThere { .. } => {
                "the first thing that is put makes it; or name the file that you mean".into()
            }
            KnowledgeError::NotAFile { .. } => "name a file, as in knowledge.db".into(),
            KnowledgeError::Foreign { .. } => {
                "it was left as it is; name another file, which is made when something is put into it".into()
            }
            KnowledgeError::Newer { .. } => "it was left as it is; take the newer program".into(),
            KnowledgeError::Older { .. } => "open it for writing once; what is in it stays".into(),
            KnowledgeError::Damaged { file, .. } => format!(
                "it was left as it is; take a copy from before, or save what can be read: sqlite3 {} .recover",
                file.display()
            ),
            KnowledgeError::NoAccess { .. } => {
                "nothing was changed; look at the folder, the rights of both, and the room on the disk".into()
            }
            KnowledgeError::Busy { .. } => "nothing was changed; try again when the other is done".into(),
            KnowledgeError::Wrong { help, .. } => help.clone(),
            KnowledgeError::Failed { .. } => "nothing was changed".into(),
        }
    }

    /// Something that is not what it must be.
    pub(crate) fn wrong(what: impl Into<String>, help: impl Into<String>) -> KnowledgeError {
        KnowledgeError::Wrong { what: what.into(), help: help.into() }
    }

    /// What the database said about the file.
    pub(crate) fn of(file: &Path, error: &rusqlite::Error) -> KnowledgeError {
        let (file, why) = (file.to_owned(), error.to_string());
        match error.sqlite_error_code() {
            Some(ErrorCode::NotADatabase) => KnowledgeError::Foreign { file, why },
            Some(ErrorCode::DatabaseBusy | ErrorCode::DatabaseLocked) => KnowledgeError::Busy { file },
            Some(
                ErrorCode::CannotOpen
                | ErrorCode::PermissionDenied
                | ErrorCode::ReadOnly
                | ErrorCode::DiskFull
                | ErrorCode::SystemIoFailure
                | ErrorCode::NoLargeFileSupport
                | ErrorCode::FileLockingProtocolFailed,
            ) => KnowledgeError::NoAccess { file, why },
            Some(ErrorCode::OutOfMemory | ErrorCode::TooBig | ErrorCode::OperationInterrupted) => {
                KnowledgeError::Failed { file, why }
            }
            // All that is asked for was written here: what does not fit was changed since.
            _ => KnowledgeError::Damaged { file, why },
        }
    }

    /// A value in the file that nobody here has written.
    pub(crate) fn damaged(file: &Path, why: impl Into<String>) -> KnowledgeError {
        KnowledgeError::Damaged { file: file.to_owned(), why: why.into() }
    }
}

/// Refuses what cannot be a name or a part of a fact: nothing, a wildcard, or what people do not see.
pub(crate) fn check_word(what: &str, word: &str) -> Result<()> {
    /// Longer ones are texts, not names (bytes).
    const LONGEST: usize = 1000;
    let why = match word {
        "" => "is empty".to_owned(),
        "_" | "*" => format!("is \"{word}\", which stands for anything in a query"),
        word if word.len() > LONGEST => {
            format!("has {} bytes, and there is room for {LONGEST}", word.len())
        }
        word if word.chars().any(char::is_control) => "has letters that cannot be seen".to_owned(),
        word if word.trim() != word => format!("begins or ends with a blank (\"{word}\")"),
        _ => return Ok(()),
    };
    Err(KnowledgeError::wrong(format!("{what} {why}"), "use a word such as kitchen"))
}
