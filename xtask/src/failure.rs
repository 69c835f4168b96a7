//! What went wrong and what to do about it.

use std::fmt;

/// The end of a chore that could not be done.
#[derive(Debug)]
pub(crate) struct Failure {
    what: String,
    remedy: String,
    /// The exit code: 1 when a check failed, 2 for wrong usage.
    pub(crate) code: u8,
}

impl Failure {
    pub(crate) fn new(what: impl Into<String>, remedy: impl Into<String>) -> Failure {
        Failure { what: what.into(), remedy: remedy.into(), code: 1 }
    }

    pub(crate) fn usage(what: impl Into<String>, remedy: impl Into<String>) -> Failure {
        Failure { code: 2, ..Failure::new(what, remedy) }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "failed: {}", self.what)?;
        if self.remedy.is_empty() { Ok(()) } else { write!(out, "\n\n{}", self.remedy) }
    }
}
