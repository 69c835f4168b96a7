//! Values of files and parameters as JSON, and back.

use serde_json::{Map, Value as Json};
use types::value::{Entry, Row, Span, Table, Value};

/// A value as JSON. Numbers that JSON does not know become the texts `"inf"`, `"-inf"` and `"nan"`.
pub fn to_json(value: &Value) -> Json {
    match value {
        Value::Bool(b) => Json::from(*b),
        Value::Int(n) => Json::from(*n),
        Value::Float(x) if x.is_finite() => Json::from(*x),
        Value::Float(_) => Json::from(value.to_string()),
        Value::Text(text) => Json::from(text.as_str()),
        Value::List(list) => list.iter().map(|entry| to_json(&entry.value)).collect(),
        Value::Table(table) => table_to_json(table),
    }
}

/// A table as a JSON object.
pub fn table_to_json(table: &Table) -> Json {
    let rows = table.rows().iter().map(|row| (row.key.clone(), to_json(&row.entry.value)));
    Json::Object(rows.collect::<Map<String, Json>>())
}

/// JSON as a value. `null` in an object is left out, elsewhere it is an empty text; a whole number above the range of
/// [`Value::Int`] is a text of its digits.
pub fn from_json(json: &Json) -> Value {
    match json {
        Json::Null => Value::from(""),
        Json::Bool(b) => Value::Bool(*b),
        Json::Number(n) => match (n.as_i64(), n.as_u64(), n.as_f64()) {
            (Some(n), _, _) => Value::Int(n),
            (None, Some(n), _) => Value::Text(n.to_string()),
            (_, _, x) => Value::Float(x.unwrap_or(f64::NAN)),
        },
        Json::String(text) => Value::from(text.as_str()),
        Json::Array(row) => Value::List(row.iter().map(|item| Entry::from(from_json(item))).collect()),
        Json::Object(rows) => {
            let mut table = Table::new();
            for (key, item) in rows.iter().filter(|(_, item)| !item.is_null()) {
                // The keys of an object are all different: looking for each among those before would only take long.
                let row = Row { key: key.clone(), key_at: Span::default(), entry: from_json(item).into() };
                table.push(row);
            }
            Value::Table(table)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn what_both_know_is_the_same_in_both() {
        let json = json!({"a": [1, 2.5, true, "x", {"b": {}}], "c": -7});
        assert_eq!(to_json(&from_json(&json)), json);
        assert_eq!(to_json(&Value::Float(f64::NEG_INFINITY)), json!("-inf"));
        assert_eq!(from_json(&json!(u64::MAX)), Value::from("18446744073709551615"));
        assert_eq!(from_json(&json!({"gone": null})), Value::Table(Table::new()));
    }
}
