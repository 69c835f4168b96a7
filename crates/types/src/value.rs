//! A tree of values with the places where they were written: what a system or world file says.
//!
//! The reader of a text format makes the tree; whoever owns a part of it reads that part with a [`TableReader`], which
//! collects every mistake instead of stopping at the first.

use alloc::borrow::ToOwned;
use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::fmt;

use crate::time::Duration;

/// A place in a text: byte offsets from its start. Empty for values that were made in code.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Span {
    /// First byte.
    pub start: u32,
    /// One past the last byte.
    pub end: u32,
}

/// A value as a file gives it.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// `true` or `false`.
    Bool(bool),
    /// A whole number.
    Int(i64),
    /// A number.
    Float(f64),
    /// A text.
    Text(String),
    /// A row of values.
    List(Vec<Entry>),
    /// Named values.
    Table(Table),
}

/// A value and its place.
#[derive(Clone, Debug)]
pub struct Entry {
    /// The value.
    pub value: Value,
    /// Where it stands.
    pub at: Span,
}

/// Two entries are equal when they say the same, wherever they stand.
impl PartialEq for Entry {
    fn eq(&self, other: &Entry) -> bool {
        self.value == other.value
    }
}

/// Named values in the order in which they were written.
#[derive(Clone, Debug, Default)]
pub struct Table {
    rows: Vec<Row>,
}

/// Order says nothing about the meaning of a table.
impl PartialEq for Table {
    fn eq(&self, other: &Table) -> bool {
        self.rows.len() == other.rows.len()
            && self.rows.iter().all(|row| other.get(&row.key) == Some(&row.entry))
    }
}

/// A name, its place, and what it names.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The name.
    pub key: String,
    /// Where the name stands.
    pub key_at: Span,
    /// What it names.
    pub entry: Entry,
}

/// Something wrong in a text: what, where, and how to mend it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mistake {
    /// The place.
    pub at: Span,
    /// What is wrong, as a whole sentence without the place.
    pub what: String,
    /// How to mend it.
    pub help: Option<String>,
}

impl Mistake {
    /// A mistake without advice.
    pub fn new(at: Span, what: impl Into<String>) -> Mistake {
        Mistake { at, what: what.into(), help: None }
    }

    /// The same with advice.
    pub fn help(mut self, help: impl Into<String>) -> Mistake {
        self.help = Some(help.into());
        self
    }

    /// `word` is none of `known`: names the nearest right one when there is one that is near, else all of them.
    pub fn unknown<'a>(
        at: Span,
        kind: &str,
        word: &str,
        known: impl IntoIterator<Item = &'a str>,
    ) -> Mistake {
        let known: Vec<&str> = known.into_iter().collect();
        let mistake = Mistake::new(at, format!("there is no {kind} \"{word}\""));
        match nearest(word, known.iter().copied()) {
            Some(right) => mistake.help(format!("did you mean \"{right}\"?")),
            None if known.is_empty() => mistake,
            None => mistake.help(format!("it can be: {}", known.join(", "))),
        }
    }
}

impl fmt::Display for Mistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.what)?;
        match &self.help {
            Some(help) => write!(f, "; {help}"),
            None => Ok(()),
        }
    }
}

impl core::error::Error for Mistake {}

/// The candidate that differs least from `word`, if it is near enough to be meant: at most a third of the letters wrong.
pub fn nearest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let limit = (word.chars().count() / 3).max(1) + usize::from(word.len() > 4);
    candidates
        .into_iter()
        .map(|candidate| (edit_distance(word, candidate), candidate))
        .filter(|(distance, _)| *distance <= limit)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
}

/// Levenshtein distance with neighbouring swaps counted once (optimal string alignment).
fn edit_distance(a: &str, b: &str) -> usize {
    let a: Vec<char> = a.to_lowercase().chars().collect();
    let b: Vec<char> = b.to_lowercase().chars().collect();
    let mut before: Vec<usize> = Vec::new();
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut row = alloc::vec![i; b.len() + 1];
        for j in 1..=b.len() {
            let cost = usize::from(a[i - 1] != b[j - 1]);
            row[j] = (last[j] + 1).min(row[j - 1] + 1).min(last[j - 1] + cost);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                row[j] = row[j].min(before[j - 2] + 1);
            }
        }
        before = core::mem::replace(&mut last, row);
    }
    last[b.len()]
}

impl Value {
    /// What kind of value it is, with its article.
    pub const fn kind(&self) -> &'static str {
        match self {
            Value::Bool(_) => "a truth value",
            Value::Int(_) => "a whole number",
            Value::Float(_) => "a number",
            Value::Text(_) => "a text",
            Value::List(_) => "a list",
            Value::Table(_) => "a table",
        }
    }

    /// The number, if it is one.
    pub fn as_float(&self) -> Option<f64> {
        match self {
            Value::Float(x) => Some(*x),
            Value::Int(n) => Some(*n as f64),
            _ => None,
        }
    }

    /// The text, if it is one.
    pub fn as_text(&self) -> Option<&str> {
        if let Value::Text(text) = self { Some(text) } else { None }
    }

    /// The table, if it is one.
    pub fn as_table(&self) -> Option<&Table> {
        if let Value::Table(table) = self { Some(table) } else { None }
    }

    /// The list, if it is one.
    pub fn as_list(&self) -> Option<&[Entry]> {
        if let Value::List(list) = self { Some(list) } else { None }
    }
}

impl fmt::Display for Value {
    /// Writes the value as TOML does in one line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Value::Bool(b) => write!(f, "{b}"),
            Value::Int(n) => write!(f, "{n}"),
            Value::Float(x) if x.is_nan() => f.write_str("nan"),
            Value::Float(x) if x.is_infinite() => f.write_str(if *x > 0.0 { "inf" } else { "-inf" }),
            Value::Float(x) => write!(f, "{x:?}"),
            Value::Text(text) => {
                f.write_str("\"")?;
                for c in text.chars() {
                    match c {
                        '"' => f.write_str("\\\"")?,
                        '\\' => f.write_str("\\\\")?,
                        '\n' => f.write_str("\\n")?,
                        '\t' => f.write_str("\\t")?,
                        '\r' => f.write_str("\\r")?,
                        c if c.is_control() => write!(f, "\\u{:04X}", c as u32)?,
                        c => write!(f, "{c}")?,
                    }
                }
                f.write_str("\"")
            }
            Value::List(list) => {
                f.write_str("[")?;
                for (i, entry) in list.iter().enumerate() {
                    write!(f, "{}{}", if i > 0 { ", " } else { "" }, entry.value)?;
                }
                f.write_str("]")
            }
            Value::Table(table) => {
                f.write_str("{")?;
                for (i, row) in table.rows.iter().enumerate() {
                    write!(f, "{} {} = {}", if i > 0 { "," } else { "" }, Key(&row.key), row.entry.value)?;
                }
                f.write_str(if table.rows.is_empty() { "}" } else { " }" })
            }
        }
    }
}

/// A key as TOML writes it: bare where that is allowed, else quoted.
pub struct Key<'a>(pub &'a str);

impl fmt::Display for Key<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let bare =
            !self.0.is_empty() && self.0.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
        if bare { f.write_str(self.0) } else { write!(f, "{}", Value::Text(self.0.to_owned())) }
    }
}

impl From<Value> for Entry {
    fn from(value: Value) -> Entry {
        Entry { value, at: Span::default() }
    }
}

macro_rules! value_from {
    ($($from:ty => $variant:ident ($x:ident) $make:expr;)*) => { $(
        impl From<$from> for Value {
            fn from($x: $from) -> Value {
                Value::$variant($make)
            }
        }
    )* };
}

value_from! {
    bool => Bool(x) x;
    i64 => Int(x) x;
    i32 => Int(x) x.into();
    u32 => Int(x) x.into();
    f64 => Float(x) x;
    &str => Text(x) x.to_owned();
    String => Text(x) x;
    Duration => Text(x) x.to_string();
    Table => Table(x) x;
    Vec<Entry> => List(x) x;
}

impl Table {
    /// An empty table.
    pub const fn new() -> Table {
        Table { rows: Vec::new() }
    }

    /// What `key` names.
    pub fn get(&self, key: &str) -> Option<&Entry> {
        self.rows.iter().find(|row| row.key == key).map(|row| &row.entry)
    }

    /// What `key` names, to change it.
    pub fn get_mut(&mut self, key: &str) -> Option<&mut Entry> {
        self.rows.iter_mut().find(|row| row.key == key).map(|row| &mut row.entry)
    }

    /// What a dotted path such as `agent.sonar.period` names. A part may be quoted where a key itself has a dot.
    pub fn at_path(&self, path: &str) -> Option<&Entry> {
        let (key, rest) = split_path(path);
        let entry = self.get(&key)?;
        match rest {
            None => Some(entry),
            Some(rest) => entry.value.as_table()?.at_path(rest),
        }
    }

    /// Sets what a dotted path names, making the tables on the way.
    pub fn set_path(&mut self, path: &str, value: impl Into<Entry>) -> Result<(), Mistake> {
        let (key, rest) = split_path(path);
        let Some(rest) = rest else {
            self.set(&key, value);
            return Ok(());
        };
        if self.get(&key).is_none() {
            self.set(&key, Value::Table(Table::new()));
        }
        match self.get_mut(&key).map(|entry| (&mut entry.value, entry.at)) {
            Some((Value::Table(table), _)) => table.set_path(rest, value),
            Some((other, at)) => {
                Err(Mistake::new(at, format!("\"{key}\" is {}, it has no entry \"{rest}\"", other.kind())))
            }
            None => Ok(()),
        }
    }

    /// Sets what `key` names; a new key goes to the end.
    pub fn set(&mut self, key: &str, value: impl Into<Entry>) {
        let entry = value.into();
        match self.get_mut(key) {
            Some(old) => *old = entry,
            None => self.rows.push(Row { key: key.to_owned(), key_at: Span::default(), entry }),
        }
    }

    /// Adds a row at the end, with its place.
    pub fn push(&mut self, row: Row) {
        self.rows.push(row);
    }

    /// Takes `key` out of the table.
    pub fn remove(&mut self, key: &str) -> Option<Entry> {
        let at = self.rows.iter().position(|row| row.key == key)?;
        Some(self.rows.remove(at).entry)
    }

    /// The rows in order.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// The rows in order, to change what they name.
    pub fn rows_mut(&mut self) -> &mut [Row] {
        &mut self.rows
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }
}

/// Splits the first part off a dotted path.
fn split_path(path: &str) -> (String, Option<&str>) {
    if let Some(quoted) = path.strip_prefix('"')
        && let Some((key, rest)) = quoted.split_once('"')
    {
        return (key.to_owned(), rest.strip_prefix('.'));
    }
    match path.split_once('.') {
        Some((key, rest)) => (key.to_owned(), Some(rest)),
        None => (path.to_owned(), None),
    }
}

/// Reads the entries of one table and collects every mistake in it.
///
/// Each entry is asked for by name and kind; what was never asked for is an unknown key, which [`finish`](Self::finish) reports.
pub struct TableReader<'a> {
    table: &'a Table,
    at: Span,
    what: String,
    known: Vec<String>,
    mistakes: Vec<Mistake>,
}

impl<'a> TableReader<'a> {
    /// Begins to read `table`, which stands at `at`; `what` names it in messages, as in `agent "sonar"`.
    pub fn new(table: &'a Table, at: Span, what: impl Into<String>) -> TableReader<'a> {
        TableReader { table, at, what: what.into(), known: Vec::new(), mistakes: Vec::new() }
    }

    /// The entry named `key`, of any kind.
    pub fn entry(&mut self, key: &str) -> Option<&'a Entry> {
        if !self.known.iter().any(|k| k == key) {
            self.known.push(key.to_owned());
        }
        self.table.get(key)
    }

    /// Names a key that may stand here but is read elsewhere.
    pub fn allow(&mut self, key: &str) {
        let _ = self.entry(key);
    }

    /// Reports a mistake of the caller's own finding.
    pub fn report(&mut self, mistake: Mistake) {
        self.mistakes.push(mistake);
    }

    /// Reports that `key` is missing.
    pub fn missing(&mut self, key: &str, wanted: &str) {
        self.report(Mistake::new(self.at, format!("{} needs \"{key}\", {wanted}", self.what)));
    }

    fn typed<T>(&mut self, key: &str, wanted: &str, convert: impl Fn(&'a Value) -> Option<T>) -> Option<T> {
        let entry = self.entry(key)?;
        let value = convert(&entry.value);
        if value.is_none() {
            self.report(Mistake::new(
                entry.at,
                format!("\"{key}\" must be {wanted}, not {} ({})", entry.value.kind(), entry.value),
            ));
        }
        value
    }

    /// A number.
    pub fn float(&mut self, key: &str) -> Option<f64> {
        self.typed(key, "a number", Value::as_float)
    }

    /// A number within `least..=most`.
    pub fn float_in(&mut self, key: &str, least: f64, most: f64) -> Option<f64> {
        let x = self.float(key)?;
        if (least..=most).contains(&x) {
            return Some(x);
        }
        let at = self.table.get(key).map_or(self.at, |entry| entry.at);
        self.report(Mistake::new(at, format!("\"{key}\" is {x}, it must lie from {least} to {most}")));
        None
    }

    /// A whole number.
    pub fn int(&mut self, key: &str) -> Option<i64> {
        self.typed(key, "a whole number", |value| if let Value::Int(n) = value { Some(*n) } else { None })
    }

    /// A truth value.
    pub fn bool(&mut self, key: &str) -> Option<bool> {
        self.typed(key, "true or false", |value| if let Value::Bool(b) = value { Some(*b) } else { None })
    }

    /// A text.
    pub fn text(&mut self, key: &str) -> Option<&'a str> {
        self.typed(key, "a text", Value::as_text)
    }

    /// A text that must be there.
    pub fn required_text(&mut self, key: &str, wanted: &str) -> Option<&'a str> {
        if self.entry(key).is_none() {
            self.missing(key, wanted);
        }
        self.text(key)
    }

    /// A span of time such as `"250ms"`.
    pub fn duration(&mut self, key: &str) -> Option<Duration> {
        let text = self.text(key)?;
        match text.parse() {
            Ok(span) => Some(span),
            Err(error) => {
                let at = self.table.get(key).map_or(self.at, |entry| entry.at);
                self.report(Mistake::new(at, format!("\"{key}\" is \"{text}\": {error}")));
                None
            }
        }
    }

    /// A list.
    pub fn list(&mut self, key: &str) -> Option<&'a [Entry]> {
        self.typed(key, "a list", Value::as_list)
    }

    /// A list of `N` numbers, such as a point or a colour.
    pub fn floats<const N: usize>(&mut self, key: &str) -> Option<[f64; N]> {
        self.typed(key, &format!("a list of {N} numbers"), floats)
    }

    /// A list of lists of `N` numbers, such as a poly-line.
    pub fn rows_of_floats<const N: usize>(&mut self, key: &str) -> Option<Vec<[f64; N]>> {
        self.typed(key, &format!("a list of lists of {N} numbers"), |value| {
            value.as_list()?.iter().map(|entry| floats(&entry.value)).collect()
        })
    }

    /// A list of texts, or a single one.
    pub fn texts(&mut self, key: &str) -> Option<Vec<(&'a str, Span)>> {
        let at = self.table.get(key).map_or(self.at, |entry| entry.at);
        self.typed(key, "a text or a list of texts", |value| match value {
            Value::Text(text) => Some(alloc::vec![(text.as_str(), at)]),
            Value::List(list) => list.iter().map(|entry| Some((entry.value.as_text()?, entry.at))).collect(),
            _ => None,
        })
    }

    /// A table.
    pub fn table(&mut self, key: &str) -> Option<&'a Table> {
        self.typed(key, "a table", Value::as_table)
    }

    /// A list of tables (`[[key]]`), each with its place.
    pub fn tables(&mut self, key: &str) -> Vec<(&'a Table, Span)> {
        self.typed(key, "a list of tables", |value| {
            value.as_list()?.iter().map(|entry| Some((entry.value.as_table()?, entry.at))).collect()
        })
        .unwrap_or_default()
    }

    /// The place of the entry `key`, or of the whole table.
    pub fn place(&self, key: &str) -> Span {
        self.table.get(key).map_or(self.at, |entry| entry.at)
    }

    /// Ends the reading: unknown keys become mistakes, and all mistakes go to `mistakes`. Says whether there were none.
    pub fn finish(mut self, mistakes: &mut Vec<Mistake>) -> bool {
        for row in self.table.rows() {
            if !self.known.contains(&row.key) {
                let known = self.known.iter().map(String::as_str);
                self.mistakes.push(Mistake::unknown(
                    row.key_at,
                    &format!("entry in {}", self.what),
                    &row.key,
                    known,
                ));
            }
        }
        let clean = self.mistakes.is_empty();
        mistakes.append(&mut self.mistakes);
        clean
    }
}

fn floats<const N: usize>(value: &Value) -> Option<[f64; N]> {
    let list = value.as_list()?;
    let mut out = [0.0; N];
    if list.len() != N {
        return None;
    }
    for (x, entry) in out.iter_mut().zip(list) {
        *x = entry.value.as_float()?;
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_word_is_the_one_that_was_meant() {
        let known = ["period", "deadline", "executor", "stop_distance"];
        for (typed, meant) in [
            ("perod", Some("period")),
            ("stop_distanse", Some("stop_distance")),
            ("deadlien", Some("deadline")),
            ("banana", None),
        ] {
            assert_eq!(nearest(typed, known), meant, "{typed}");
        }
    }

    #[test]
    fn all_mistakes_are_found_at_once() {
        let mut table = Table::new();
        table.set("radius", Value::from("wide"));
        table.set("perod", Value::from("250ms"));
        table.set("period", Value::from("250"));
        let mut reader = TableReader::new(&table, Span::default(), "agent \"sonar\"");
        assert_eq!(reader.float("radius"), None);
        assert_eq!(reader.duration("period"), None);
        let mut mistakes = Vec::new();
        assert!(!reader.finish(&mut mistakes));
        let said: Vec<String> = mistakes.iter().map(ToString::to_string).collect();
        assert_eq!(said.len(), 3, "{said:?}");
        assert_eq!(said[0], "\"radius\" must be a number, not a text (\"wide\")");
        assert_eq!(said[2], "there is no entry in agent \"sonar\" \"perod\"; did you mean \"period\"?");
    }

    #[test]
    fn a_path_reaches_through_tables() {
        let mut table = Table::new();
        table.set_path("agent.sonar.period", Value::from("250ms")).unwrap();
        table.set_path("wires.\"sonar.raw\"", Value::from("x")).unwrap();
        assert_eq!(table.at_path("agent.sonar.period").unwrap().value, Value::from("250ms"));
        assert_eq!(table.at_path("wires.\"sonar.raw\"").unwrap().value, Value::from("x"));
        assert!(table.set_path("agent.sonar.period.x", Value::from(1.0)).is_err());
    }
}
