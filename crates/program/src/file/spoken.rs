//! Messages in words: `call navigation.go x=3 y=1` becomes the question's bytes, by the type of the port.

use control::words::read_value;
use record::dynamic;
use record::schema::Schema;
use runtime::{Direction, PortInfo, Refusal};
use types::definition::Definition;
use types::value::{Entry, Table, Value};

/// The requests that carry a message.
pub(crate) const VERBS: [&str; 2] = ["send", "call"];

/// The same request with its message in bytes, as the runtime takes it. `find` gives a port by its name. What is no `send` or `call`, or has
/// its bytes already, stays as it is.
///
/// # Errors
/// When there is no such port, or the words are no message of its type.
pub(crate) fn in_bytes<'p>(
    words: &[String],
    find: impl Fn(&str) -> Option<&'p PortInfo>,
) -> Result<Vec<String>, Refusal> {
    let [verb, name, rest @ ..] = words else { return Ok(words.to_vec()) };
    if !VERBS.contains(&verb.as_str()) || rest.iter().any(|word| word.starts_with("cdr=")) {
        return Ok(words.to_vec());
    }
    let wanted = if verb == "call" { Direction::Service } else { Direction::Output };
    let port = find(name)
        .filter(|port| port.shape.direction == wanted)
        .ok_or_else(|| Refusal::new(format!("\"{name}\" is no {} to {verb}", kind(wanted))))?;
    let message = if verb == "call" { port.shape.input } else { port.shape.output };
    let message = message.ok_or_else(|| Refusal::new(format!("\"{name}\" takes no message")))?;
    let (own, fields): (Vec<_>, Vec<_>) = rest.iter().partition(|word| word.starts_with("within="));
    let bytes = encode(&(message.definition)(), &table(&fields)?)?;
    let hex: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
    let mut out = vec![verb.clone(), name.clone(), format!("cdr={hex}")];
    out.extend(own.into_iter().cloned());
    Ok(out)
}

fn kind(direction: Direction) -> &'static str {
    if direction == Direction::Service { "service" } else { "output" }
}

fn table(pairs: &[&String]) -> Result<Table, Refusal> {
    let mut table = Table::new();
    for word in pairs {
        let Some((key, text)) = word.split_once('=').filter(|(key, _)| !key.is_empty()) else {
            return Err(Refusal::new(format!("\"{word}\" is no FIELD=VALUE")));
        };
        table.set_path(key, Entry { value: read_value(text)?, at: Default::default() })?;
    }
    Ok(table)
}

fn encode(definition: &Definition, fields: &Table) -> Result<Vec<u8>, Refusal> {
    let schema = Schema::parse(definition.name, &definition.text())
        .map_err(|error| Refusal::new(error.to_string()))?;
    let entry = Entry { value: Value::Table(fields.clone()), at: Default::default() };
    dynamic::encode(&schema, &entry).map_err(|mistakes| {
        let told: Vec<String> = mistakes.iter().map(ToString::to_string).collect();
        Refusal::new(told.join("; "))
    })
}
