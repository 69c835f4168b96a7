//! TOML to a tree of values with the place of every key and value.

use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};
use types::value::{Entry, Mistake, Row, Span, Table, Value};

use super::{Sources, syntax};

/// Reads the text that begins at `base`. Gives nothing when it is no TOML, and all mistakes.
pub(crate) fn read(sources: &Sources, base: u32, mistakes: &mut Vec<Mistake>) -> Option<Table> {
    let before = mistakes.len();
    let text = sources.text(base);
    let mut reader = Reader { base, mistakes };
    for (range, mistake) in syntax::mistakes(text) {
        let at = reader.span(&range);
        reader.mistakes.push(Mistake { at, ..mistake });
    }
    if reader.mistakes.len() > before {
        return None;
    }
    let (document, _) = DeTable::parse_recoverable(text);
    let table = reader.table(document.get_ref());
    (mistakes.len() == before).then_some(table)
}

/// Reads the value of `KEY=VALUE`: as TOML, and as a text when it is none, so that `250ms` needs no quotes.
pub(super) fn value(text: &str, at: Span) -> Value {
    let line = format!("x = {text}");
    let Ok(document) = DeTable::parse(&line) else { return Value::Text(text.to_owned()) };
    let mut mistakes = Vec::new();
    let table = Reader { base: 0, mistakes: &mut mistakes }.table(document.get_ref());
    match table.rows() {
        [row] if mistakes.is_empty() => placed(row.entry.value.clone(), at),
        _ => Value::Text(text.to_owned()),
    }
}

/// The same value with everything in it at one place.
fn placed(value: Value, at: Span) -> Value {
    match value {
        Value::List(list) => {
            Value::List(list.into_iter().map(|entry| Entry { value: placed(entry.value, at), at }).collect())
        }
        Value::Table(table) => {
            let mut out = Table::new();
            for row in table.rows() {
                let entry = Entry { value: placed(row.entry.value.clone(), at), at };
                out.push(Row { key: row.key.clone(), key_at: at, entry });
            }
            Value::Table(out)
        }
        other => other,
    }
}

struct Reader<'m> {
    base: u32,
    mistakes: &'m mut Vec<Mistake>,
}

impl Reader<'_> {
    fn span(&self, range: &Range<usize>) -> Span {
        Span { start: self.base + range.start as u32, end: self.base + range.end as u32 }
    }

    fn table(&mut self, table: &DeTable<'_>) -> Table {
        let mut rows: Vec<Row> = Vec::new();
        for (key, value) in table {
            let key_at = self.span(&key.span());
            rows.push(Row { key: key.get_ref().to_string(), key_at, entry: self.entry(value) });
        }
        // The parser orders by name; people order by what belongs together.
        rows.sort_by_key(|row| row.key_at.start);
        let mut table = Table::new();
        rows.into_iter().for_each(|row| table.push(row));
        table
    }

    fn entry(&mut self, value: &Spanned<DeValue<'_>>) -> Entry {
        let at = self.span(&value.span());
        let value = match value.get_ref() {
            DeValue::String(text) => Value::Text(text.to_string()),
            DeValue::Boolean(b) => Value::Bool(*b),
            DeValue::Integer(n) => match i64::from_str_radix(n.as_str(), n.radix()) {
                Ok(n) => Value::Int(n),
                Err(_) => self.bad(at, "the number is too large"),
            },
            DeValue::Float(x) => match x.as_str().parse::<f64>() {
                Ok(x) => Value::Float(x),
                Err(_) => self.bad(at, "this is no number"),
            },
            DeValue::Array(list) => Value::List(list.iter().map(|item| self.entry(item)).collect()),
            DeValue::Table(table) => Value::Table(self.table(table)),
            DeValue::Datetime(_) => {
                self.bad(at, "a date means nothing here; a time is a text such as \"30s\"")
            }
        };
        Entry { value, at }
    }

    fn bad(&mut self, at: Span, what: &str) -> Value {
        self.mistakes.push(Mistake::new(at, what));
        Value::Bool(false)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> Table {
        let mut sources = Sources::default();
        let base = sources.add("a.toml", text);
        let mut mistakes = Vec::new();
        read(&sources, base, &mut mistakes).unwrap_or_else(|| panic!("{mistakes:?}"))
    }

    #[test]
    fn rows_keep_the_order_of_the_file_and_know_their_places() {
        let text = "zeta = 1\n[b]\nx = 0x10\n[a]\ny = [1.5, \"t\"]\n[[at]]\nk = true\n[[at]]\n";
        let table = table(text);
        let keys: Vec<&str> = table.rows().iter().map(|row| row.key.as_str()).collect();
        assert_eq!(keys, ["zeta", "b", "a", "at"]);
        let x = table.at_path("b.x").unwrap();
        assert_eq!(x.value, Value::Int(16));
        assert_eq!(&text[x.at.start as usize..x.at.end as usize], "0x10");
        assert_eq!(table.get("at").unwrap().value.as_list().unwrap().len(), 2);
    }

    #[test]
    fn a_value_of_a_command_line_needs_no_quotes() {
        let at = Span::default();
        for (text, wanted) in [
            ("250ms", Value::from("250ms")),
            ("-3", Value::Int(-3)),
            ("1e-3", Value::Float(1e-3)),
            ("true", Value::Bool(true)),
            ("\"a b\"", Value::from("a b")),
            ("1\ny = 2", Value::from("1\ny = 2")),
        ] {
            assert_eq!(value(text, at), wanted, "{text}");
        }
    }
}
