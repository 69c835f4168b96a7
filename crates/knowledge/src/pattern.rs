//! Patterns: what something looks like.

use std::path::Path;

use rusqlite::{Connection, OptionalExtension as _, Transaction};
use types::value::Table;

use crate::error::{Result, check_word};
use crate::{KnowledgeError, Listed, seal, text};

/// Larger blobs than this do not belong into a database (bytes).
pub(crate) const LARGEST: usize = 256 << 20;

/// What something looks like: a picture, or a range of colours.
#[derive(Clone, Debug, PartialEq)]
pub struct Pattern {
    /// What it is called.
    pub name: String,
    /// What its bytes and parameters are.
    pub kind: PatternKind,
    /// The form of the bytes, as in `image/png`; empty when there are none.
    pub media_type: String,
    /// The bytes, as they came; at most 256 MiB.
    pub bytes: Vec<u8>,
    /// Whatever else belongs to it, as the bounds of a colour.
    pub parameters: Table,
}

/// What a pattern is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PatternKind {
    /// A picture.
    Image,
    /// A range of colours, by its parameters.
    ColourRange,
}

impl PatternKind {
    /// All of them.
    pub const ALL: [PatternKind; 2] = [PatternKind::Image, PatternKind::ColourRange];

    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            PatternKind::Image => "image",
            PatternKind::ColourRange => "colour",
        }
    }

    /// The kind of this name.
    pub fn named(name: &str) -> Option<PatternKind> {
        PatternKind::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

impl Pattern {
    pub(crate) fn check(&self) -> Result<()> {
        check_word("the name of a pattern", &self.name)?;
        let wrong = |why: String, help: &str| {
            Err(KnowledgeError::wrong(format!("pattern \"{}\" {why}", self.name), help))
        };
        if self.bytes.len() > LARGEST {
            return wrong(
                format!("has {} bytes, and there is room for {LARGEST}", self.bytes.len()),
                "make it smaller",
            );
        }
        match self.kind {
            PatternKind::Image if self.bytes.is_empty() => {
                return wrong("has no bytes".into(), "an image needs its picture");
            }
            PatternKind::ColourRange if self.parameters.is_empty() && self.bytes.is_empty() => {
                return wrong("has no parameters".into(), "a range of colours needs its bounds");
            }
            _ => {}
        }
        if !self.media_type.is_empty() {
            check_word("the media type of a pattern", &self.media_type)?;
        }
        text::write(&self.parameters)
            .map(drop)
            .or_else(|why| wrong(format!("has parameters of which {why}"), ""))
    }

    pub(crate) fn put(&self, file: &Path, transaction: &Transaction<'_>) -> Result<()> {
        let parameters = text::write(&self.parameters).map_err(|why| KnowledgeError::wrong(why, ""))?;
        let Pattern { name, media_type, bytes, .. } = self;
        let put =
            seal::put(transaction, "pattern", &[name, &self.kind.name(), media_type, &parameters, bytes]);
        put.map_err(|error| KnowledgeError::of(file, &error))
    }
}

pub(crate) fn get(file: &Path, connection: &Connection, name: &str) -> Result<Option<Pattern>> {
    let sql = "SELECT name, kind, media_type, parameters, bytes, crc FROM pattern WHERE name = ?1";
    let found: Option<(String, String, String, Vec<u8>)> = connection
        .query_row(sql, [name], |row| {
            seal::verify(row, 5)?;
            Ok((row.get(1)?, row.get(2)?, row.get(3)?, row.get(4)?))
        })
        .optional()
        .map_err(|error| KnowledgeError::of(file, &error))?;
    let Some((kind, media_type, parameters, bytes)) = found else { return Ok(None) };
    let damaged = |what: &str| {
        KnowledgeError::damaged(file, format!("the {what} of pattern \"{name}\" cannot be read"))
    };
    Ok(Some(Pattern {
        name: name.to_owned(),
        kind: PatternKind::named(&kind).ok_or_else(|| damaged("kind"))?,
        media_type,
        bytes,
        parameters: text::read(&parameters).ok_or_else(|| damaged("parameters"))?,
    }))
}

pub(crate) fn list(connection: &Connection) -> rusqlite::Result<Vec<Listed>> {
    let mut statement =
        connection.prepare("SELECT name, kind, media_type, length(bytes) FROM pattern ORDER BY name")?;
    let listed = statement.query_map([], |row| {
        let (kind, media_type): (String, String) = (row.get(1)?, row.get(2)?);
        let bytes = match row.get::<_, i64>(3)? {
            0 => String::new(),
            bytes => format!(", {media_type}, {bytes} bytes"),
        };
        Ok(Listed { name: row.get(0)?, what: format!("{kind}{bytes}") })
    })?;
    listed.collect()
}
