//! Tables of values as a line of text, and back without a change: the line is the one that [`Value`] writes, which is TOML.

use std::collections::BTreeSet;

use types::value::{Row, Span, Table, Value};

/// Tables and lists stand in each other no deeper than this.
const DEEPEST: usize = 32;

/// The line of a table.
///
/// # Errors
/// Why it cannot be a line: two rows of one name, or too deep.
pub(crate) fn write(table: &Table) -> Result<String, String> {
    let value = Value::Table(table.clone());
    check(&value, 0)?;
    Ok(value.to_string())
}

/// The table of a line; nothing for a line that [`write`] does not make.
pub(crate) fn read(line: &str) -> Option<Table> {
    let mut reader = Reader { rest: line };
    let Value::Table(table) = reader.value(0)? else { return None };
    reader.rest.is_empty().then_some(table)
}

fn check(value: &Value, depth: usize) -> Result<(), String> {
    if depth > DEEPEST {
        return Err(format!("its values stand deeper than {DEEPEST} in each other"));
    }
    match value {
        Value::List(list) => list.iter().try_for_each(|entry| check(&entry.value, depth + 1)),
        Value::Table(table) => {
            let mut seen = BTreeSet::new();
            table.rows().iter().try_for_each(|row| {
                if !seen.insert(&row.key) {
                    return Err(format!("\"{}\" stands in it twice", row.key));
                }
                check(&row.entry.value, depth + 1)
            })
        }
        _ => Ok(()),
    }
}

/// Goes through a line.
struct Reader<'l> {
    rest: &'l str,
}

impl<'l> Reader<'l> {
    /// Passes over `word`, if it comes next.
    fn take(&mut self, word: &str) -> Option<()> {
        self.rest = self.rest.strip_prefix(word)?;
        Some(())
    }

    /// All up to the first letter that is no part of it.
    fn run(&mut self, part: impl Fn(char) -> bool) -> &'l str {
        let end = self.rest.find(|c| !part(c)).unwrap_or(self.rest.len());
        let (run, rest) = self.rest.split_at(end);
        self.rest = rest;
        run
    }

    fn value(&mut self, depth: usize) -> Option<Value> {
        if depth > DEEPEST {
            return None;
        }
        match self.rest.chars().next()? {
            '"' => Some(Value::Text(self.text()?)),
            '[' => self.list(depth),
            '{' => self.table(depth),
            _ => plain(self.run(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))),
        }
    }

    fn list(&mut self, depth: usize) -> Option<Value> {
        self.take("[")?;
        let mut list = Vec::new();
        while self.take("]").is_none() {
            if !list.is_empty() {
                self.take(", ")?;
            }
            list.push(self.value(depth + 1)?.into());
        }
        Some(Value::List(list))
    }

    fn table(&mut self, depth: usize) -> Option<Value> {
        self.take("{")?;
        let mut table = Table::new();
        if self.take("}").is_some() {
            return Some(Value::Table(table));
        }
        loop {
            self.take(" ")?;
            let key = match self.rest.chars().next()? {
                '"' => self.text()?,
                _ => self.run(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-').to_owned(),
            };
            self.take(" = ")?;
            let entry = self.value(depth + 1)?.into();
            table.push(Row { key, key_at: Span::default(), entry });
            if self.take(" }").is_some() {
                return Some(Value::Table(table));
            }
            self.take(",")?;
        }
    }

    fn text(&mut self) -> Option<String> {
        self.take("\"")?;
        let mut text = String::new();
        loop {
            text.push_str(self.run(|c| c != '"' && c != '\\'));
            if self.take("\"").is_some() {
                return Some(text);
            }
            self.take("\\")?;
            let letter = self.rest.chars().next()?;
            self.rest = &self.rest[letter.len_utf8()..];
            text.push(match letter {
                'n' => '\n',
                't' => '\t',
                'r' => '\r',
                'u' => {
                    let digits = self.rest.get(..4)?;
                    self.rest = &self.rest[4..];
                    char::from_u32(u32::from_str_radix(digits, 16).ok()?)?
                }
                '"' | '\\' => letter,
                _ => return None,
            });
        }
    }
}

/// A truth value or a number.
fn plain(word: &str) -> Option<Value> {
    match word {
        "true" => Some(Value::Bool(true)),
        "false" => Some(Value::Bool(false)),
        "nan" => Some(Value::Float(f64::NAN)),
        "inf" => Some(Value::Float(f64::INFINITY)),
        "-inf" => Some(Value::Float(f64::NEG_INFINITY)),
        _ if word.contains(['.', 'e']) => word.parse().ok().map(Value::Float),
        _ => word.parse().ok().map(Value::Int),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Any value that is equal to itself.
    fn value() -> impl Strategy<Value = Value> {
        let leaf = prop_oneof![
            any::<bool>().prop_map(Value::Bool),
            any::<i64>().prop_map(Value::Int),
            any::<f64>().prop_filter("not a number is not itself", |x| !x.is_nan()).prop_map(Value::Float),
            any::<String>().prop_map(Value::Text),
        ];
        leaf.prop_recursive(4, 32, 6, |inner| {
            prop_oneof![
                prop::collection::vec(inner.clone(), 0..6)
                    .prop_map(|list| Value::List(list.into_iter().map(Into::into).collect())),
                prop::collection::btree_map(any::<String>(), inner, 0..6).prop_map(|rows| {
                    let mut table = Table::new();
                    rows.into_iter().for_each(|(key, value)| table.set(&key, value));
                    Value::Table(table)
                }),
            ]
        })
    }

    proptest! {
        #[test]
        fn a_table_is_read_as_it_was_written(rows in prop::collection::vec((any::<String>(), value()), 0..6)) {
            let mut table = Table::new();
            rows.into_iter().for_each(|(key, value)| table.set(&key, value));
            let read = read(&write(&table).unwrap()).unwrap();
            prop_assert_eq!(&read, &table);
            let keys = |table: &Table| table.rows().iter().map(|row| row.key.clone()).collect::<Vec<_>>();
            prop_assert_eq!(keys(&read), keys(&table), "in its order");
        }

        #[test]
        fn any_line_is_read_or_refused(line in "[{}\\[\\]=\", a1.\\\\u-]{0,40}|.*") {
            let _ = read(&line);
        }
    }

    #[test]
    fn what_nobody_writes_is_refused() {
        for line in
            ["", "{", "{ a = 1", "{ a = 1 } ", "{ a = }", "[1]", "{ a = \"\\u12\" }", "{ a = \"\\uD800\" }"]
        {
            assert_eq!(read(line), None, "{line}");
        }
        let deep = "{ a = ".repeat(100_000);
        assert_eq!(read(&deep), None, "however deep it is");
    }

    #[test]
    fn what_cannot_be_read_again_is_not_written() {
        let mut twice = Table::new();
        for _ in 0..2 {
            twice.push(Row { key: "a".into(), key_at: Span::default(), entry: Value::Int(1).into() });
        }
        assert_eq!(write(&twice), Err("\"a\" stands in it twice".into()));
        let mut deep = Value::Int(1);
        for _ in 0..40 {
            deep = Value::List(vec![deep.into()]);
        }
        let mut table = Table::new();
        table.set("a", deep);
        assert!(write(&table).unwrap_err().contains("deeper"));
    }
}
