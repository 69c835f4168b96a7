//! One value in one word: a number, a truth value, a list, a table, else a text.

use runtime::Refusal;
use types::value::{Entry, Row, Span, Table, Value};

use super::MOST_PAIRS;

/// Lists and tables inside each other, at most: people write three.
const DEEPEST: usize = 32;

/// Reads a value as people type it.
///
/// What begins with `[`, `{` or `"` is read as TOML reads it, but that texts in lists need no quotes. Otherwise a number is a
/// number, `true` and `false` are truth values, and everything else is a text as it stands.
///
/// ```
/// use control::words::{read_value, write_value};
/// use types::value::Value;
///
/// assert_eq!(read_value("0.45").unwrap(), Value::Float(0.45));
/// assert_eq!(read_value("250ms").unwrap(), Value::from("250ms"));
/// assert_eq!(read_value("[left, right]").unwrap().to_string(), "[\"left\", \"right\"]");
/// assert_eq!(write_value(&Value::from("7")), "\"7\"", "a text that looks like a number keeps its quotes");
/// ```
///
/// # Errors
/// When what begins like a list, a table or a quoted text does not end like one.
pub fn read_value(text: &str) -> Result<Value, Refusal> {
    if !text.starts_with(['[', '{', '"']) {
        return Ok(scalar(text));
    }
    let mut reader = Reader { text, at: 0 };
    let read = reader.value(0).and_then(|value| {
        reader.skip_space();
        if reader.at == text.len() { Ok(value) } else { Err("the end".to_owned()) }
    });
    read.map_err(|wanted| {
        let shown: String = text.chars().take(60).collect();
        Refusal::new(format!("\"{shown}\" is no value: at byte {} {wanted} is missing", reader.at))
            .help("write a list as [1, 2], a table as {a = 1}, and a text that begins like one in quotes")
    })
}

/// Writes a value so that [`read_value`] reads the same.
pub fn write_value(value: &Value) -> String {
    match value {
        Value::Text(text) if read_value(text).is_ok_and(|read| read == *value) => text.clone(),
        _ => value.to_string(),
    }
}

fn scalar(text: &str) -> Value {
    match text {
        "true" => return Value::Bool(true),
        "false" => return Value::Bool(false),
        _ => {}
    }
    if let Ok(n) = text.parse::<i64>() {
        return Value::Int(n);
    }
    // Rust would also take "Infinity" and "NaN", which may well be names.
    let unsigned = text.strip_prefix(['+', '-']).unwrap_or(text);
    let looks_like_a_number = unsigned.starts_with(|c: char| c.is_ascii_digit() || c == '.');
    match text.parse::<f64>() {
        Ok(x) if looks_like_a_number || matches!(unsigned, "inf" | "nan") => Value::Float(x),
        _ => Value::Text(text.to_owned()),
    }
}

struct Reader<'a> {
    text: &'a str,
    at: usize,
}

/// What was wanted in the place where the reader stands.
type Wanted = String;

impl Reader<'_> {
    fn rest(&self) -> &str {
        &self.text[self.at..]
    }

    fn skip_space(&mut self) {
        self.at = self.text.len() - self.rest().trim_start().len();
    }

    /// Passes over `c`, if it comes next.
    fn take(&mut self, c: char) -> bool {
        self.skip_space();
        let found = self.rest().starts_with(c);
        self.at += if found { c.len_utf8() } else { 0 };
        found
    }

    fn value(&mut self, depth: usize) -> Result<Value, Wanted> {
        if depth > DEEPEST {
            return Err(format!("a value that is not nested deeper than {DEEPEST} times"));
        }
        if self.take('[') {
            self.list(depth)
        } else if self.take('{') {
            self.table(depth)
        } else if self.take('"') {
            self.quoted().map(Value::Text)
        } else {
            let bare = self.bare(&[',', ']', '}']);
            if bare.is_empty() { Err("a value".into()) } else { Ok(scalar(&bare)) }
        }
    }

    fn list(&mut self, depth: usize) -> Result<Value, Wanted> {
        let mut list: Vec<Entry> = Vec::new();
        while !self.take(']') {
            list.push(self.value(depth + 1)?.into());
            if !self.take(',') && !self.rest().starts_with(']') {
                return Err("\",\" or \"]\"".into());
            }
        }
        Ok(Value::List(list))
    }

    fn table(&mut self, depth: usize) -> Result<Value, Wanted> {
        let mut table = Table::new();
        while !self.take('}') {
            if table.len() == MOST_PAIRS {
                return Err(format!("the end of a table of at most {MOST_PAIRS} rows"));
            }
            let key = if self.take('"') { self.quoted()? } else { self.bare(&['=', ',', '}']) };
            if !self.take('=') {
                return Err("\"=\"".into());
            }
            if table.get(&key).is_some() {
                return Err(format!("another name: \"{key}\" is there already, which"));
            }
            let entry = self.value(depth + 1)?.into();
            table.push(Row { key, key_at: Span::default(), entry });
            if !self.take(',') && !self.rest().starts_with('}') {
                return Err("\",\" or \"}\"".into());
            }
        }
        Ok(Value::Table(table))
    }

    /// What stands before one of `ends`, without the space around it.
    fn bare(&mut self, ends: &[char]) -> String {
        self.skip_space();
        let rest = self.rest();
        let len = rest.find(ends).unwrap_or(rest.len());
        let found = rest[..len].trim_end().to_owned();
        self.at += len;
        found
    }

    /// The rest of a text behind its first quotation mark.
    fn quoted(&mut self) -> Result<String, Wanted> {
        let mut out = String::new();
        let mut chars = self.text[self.at..].char_indices();
        while let Some((place, c)) = chars.next() {
            match c {
                '"' => {
                    self.at += place + 1;
                    return Ok(out);
                }
                '\\' => match chars.next().map(|(_, c)| c) {
                    Some('n') => out.push('\n'),
                    Some('t') => out.push('\t'),
                    Some('r') => out.push('\r'),
                    Some('u') => {
                        let digits: String = chars.by_ref().take(4).map(|(_, c)| c).collect();
                        let c = u32::from_str_radix(&digits, 16).ok().and_then(char::from_u32);
                        out.push(c.ok_or("a character of four hexadecimal digits")?);
                    }
                    Some(c @ ('"' | '\\')) => out.push(c),
                    _ => return Err("one of \\\" \\\\ \\n \\t \\r \\u".into()),
                },
                c => out.push(c),
            }
        }
        self.at = self.text.len();
        Err("a quotation mark".into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_is_read_as_it_looks() {
        for (word, value) in [
            ("5", Value::Int(5)),
            ("-5", Value::Int(-5)),
            (".5", Value::Float(0.5)),
            ("1e3", Value::Float(1000.0)),
            ("-inf", Value::Float(f64::NEG_INFINITY)),
            ("Infinity", Value::from("Infinity")),
            ("true", Value::Bool(true)),
            ("True", Value::from("True")),
            ("\"5\"", Value::from("5")),
            ("\"a\\u0041\\n\"", Value::from("aA\n")),
            ("", Value::from("")),
            ("a, b", Value::from("a, b")),
            ("[]", Value::List(vec![])),
        ] {
            assert_eq!(read_value(word).unwrap(), value, "{word}");
        }
        let nested = read_value("{ a = [1, 2.5, far wall,], \"b c\" = {d = true} }").unwrap();
        assert_eq!(nested.to_string(), "{ a = [1, 2.5, \"far wall\"], \"b c\" = { d = true } }");
    }

    #[test]
    fn what_does_not_end_is_refused_with_its_place() {
        for word in
            ["[", "[1", "[1,,2]", "{a}", "{a = }", "{a = 1, a = 2}", "\"a", "\"\\x\"", "[1] 2", "\"\\ud800\""]
        {
            assert!(read_value(word).is_err(), "{word}");
        }
        let deep = "[".repeat(100_000);
        assert!(
            read_value(&deep).unwrap_err().what.contains("nested"),
            "a deep value must not break the stack"
        );
    }
}
