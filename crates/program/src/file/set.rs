//! `--set KEY=VALUE`: changes any entry of a system file before it is read.

use types::value::{Entry, Mistake, Row, Span, Table, Value};

use super::{Sources, tree};

/// Does one `KEY=VALUE` to the tree of a system file. The key is a dotted path as in `agent.sonar.period`; names that have
/// dots themselves need no quotes, for what is there already is found by the longest name that fits. An item of a list is named
/// by its number from 0.
///
/// # Errors
/// When there is no `=`, or the path leads to no entry that could be.
pub(super) fn set(tree: &mut Table, sources: &mut Sources, assignment: &str) -> Result<(), Mistake> {
    let Assignment { parts, key_at, entry } = Assignment::read(sources, assignment)?;
    let parts: Vec<&str> = parts.iter().map(String::as_str).collect();
    known_owner(tree, &parts, key_at)?;
    put(tree, &parts, entry, key_at, parts[0])
}

/// Does one `KEY=VALUE` to a section that stands by itself: its name is no part of the key.
///
/// # Errors
/// As [`set`].
pub(crate) fn set_in(
    table: &mut Table,
    sources: &mut Sources,
    assignment: &str,
    section: &str,
) -> Result<(), Mistake> {
    let Assignment { parts, key_at, entry } = Assignment::read(sources, assignment)?;
    let parts: Vec<&str> = parts.iter().map(String::as_str).collect();
    put(table, &parts, entry, key_at, section)
}

/// A `KEY=VALUE` that was taken apart.
struct Assignment {
    /// The parts of the key, at least one, none of them empty.
    parts: Vec<String>,
    key_at: Span,
    entry: Entry,
}

impl Assignment {
    fn read(sources: &mut Sources, assignment: &str) -> Result<Assignment, Mistake> {
        let base = sources.add("--set", assignment);
        let length = assignment.len() as u32;
        let Some((key, value)) = assignment.split_once('=') else {
            return Err(Mistake::new(Span { start: base, end: base + length.max(1) }, "there is no \"=\"")
                .help("write KEY=VALUE, as in --set agent.sonar.period=250ms"));
        };
        let key_at = Span { start: base, end: base + key.len().max(1) as u32 };
        let value_at = Span { start: key_at.end + 1, end: base + length };
        let path = key.replace('"', "");
        let parts: Vec<String> = path.trim().split('.').map(|part| part.trim().to_owned()).collect();
        if parts.iter().any(String::is_empty) {
            return Err(Mistake::new(key_at, format!("\"{}\" is no path of names", key.trim()))
                .help("write it as in agent.sonar.period"));
        }
        let entry = Entry { value: tree::value(value.trim(), value_at), at: value_at };
        Ok(Assignment { parts, key_at, entry })
    }
}

/// A misspelt agent or robot would make a new one: it is refused instead.
fn known_owner(tree: &Table, parts: &[&str], at: Span) -> Result<(), Mistake> {
    let [section @ ("agent" | "robot"), rest @ ..] = parts else { return Ok(()) };
    let Some(owners) = tree.get(section).and_then(|entry| entry.value.as_table()) else { return Ok(()) };
    if rest.len() < 2 || longest(owners, rest).is_some() {
        return Ok(());
    }
    Err(Mistake::unknown(at, section, rest[0], owners.rows().iter().map(|row| row.key.as_str())))
}

/// How many of the parts, joined by dots, are a name in the table; the most that fit.
fn longest(table: &Table, parts: &[&str]) -> Option<usize> {
    (1..=parts.len()).rev().find(|&n| table.get(&parts[..n].join(".")).is_some())
}

/// How many of the parts make up a new name: the keys of some sections have dots.
fn new_name(section: &str, inside: bool, parts: &[&str]) -> usize {
    match section {
        "wires" | "vary" if inside => parts.len(),
        "decide" if inside => (parts.len() - 1).max(1),
        _ => 1,
    }
}

fn put(table: &mut Table, parts: &[&str], entry: Entry, at: Span, section: &str) -> Result<(), Mistake> {
    let known = longest(table, parts);
    let n = known.unwrap_or_else(|| new_name(section, parts[0] != section, parts));
    let name = parts[..n].join(".");
    let rest = &parts[n..];
    if known.is_none() {
        let value = if rest.is_empty() { entry.clone() } else { Value::Table(Table::new()).into() };
        table.push(Row { key: name.clone(), key_at: at, entry: value });
    }
    let Some(place) = table.get_mut(&name) else { return Ok(()) };
    put_in(place, rest, entry, at, &name, section)
}

fn put_in(
    place: &mut Entry,
    rest: &[&str],
    entry: Entry,
    at: Span,
    name: &str,
    section: &str,
) -> Result<(), Mistake> {
    let [first, others @ ..] = rest else {
        *place = entry;
        return Ok(());
    };
    match &mut place.value {
        Value::Table(inner) => put(inner, rest, entry, at, section),
        Value::List(list) => {
            let count = list.len();
            match first.parse::<usize>().ok().and_then(|index| list.get_mut(index)) {
                Some(item) => put_in(item, others, entry, at, first, section),
                None => Err(Mistake::new(at, format!("\"{name}\" has no item {first}"))
                    .help(format!("it has {count}, numbered from 0"))),
            }
        }
        other => {
            Err(Mistake::new(at, format!("\"{name}\" is {}, it has no entry \"{first}\"", other.kind())))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "[agent.sonar]\nperiod = \"1s\"\n[agent.\"arm.grip\"]\nis = \"x\"\n[wires]\n\
        \"sonar.raw\" = [\"a.b\"]\n[decide]\n\"danger.near\" = { wall = 0.0 }\n[[at]]\ntime = \"1s\"\n";

    fn done(assignment: &str) -> Result<Table, String> {
        let mut sources = Sources::default();
        let base = sources.add("a.toml", TEXT);
        let mut tree = tree::read(&sources, base, &mut Vec::new()).unwrap();
        set(&mut tree, &mut sources, assignment).map_err(|mistake| mistake.to_string())?;
        Ok(tree)
    }

    #[test]
    fn any_entry_can_be_changed() {
        for (assignment, path, value) in [
            ("agent.sonar.period=250ms", "agent.sonar.period", Value::from("250ms")),
            ("agent.sonar.keep = 0.5", "agent.sonar.keep", Value::from(0.5)),
            ("agent.sonar.on=[\"a\"]", "agent.sonar.on", Value::List(vec![Value::from("a").into()])),
            ("agent.arm.grip.is=y", "agent.\"arm.grip\".is", Value::from("y")),
            ("wires.sonar.raw=c.d", "wires.\"sonar.raw\"", Value::from("c.d")),
            ("wires.sonar.new=c.d", "wires.\"sonar.new\"", Value::from("c.d")),
            ("decide.danger.near.wall=1.0", "decide.\"danger.near\".wall", Value::from(1.0)),
            ("decide.target.seen.wall=1.0", "decide.\"target.seen\".wall", Value::from(1.0)),
            ("executor.reflex.priority=70", "executor.reflex.priority", Value::Int(70)),
            ("name=other", "name", Value::from("other")),
        ] {
            let tree = done(assignment).unwrap();
            assert_eq!(tree.at_path(path).map(|entry| &entry.value), Some(&value), "{assignment}");
        }
        let list = done("at.0.time=9s").unwrap();
        let item = list.get("at").unwrap().value.as_list().unwrap()[0].value.as_table().unwrap();
        assert_eq!(item.get("time").unwrap().value, Value::from("9s"));
    }

    #[test]
    fn what_cannot_be_is_refused_with_the_right_word() {
        for (assignment, said) in [
            ("agent.sonra.period=1s", "there is no agent \"sonra\"; did you mean \"sonar\"?"),
            ("agent.sonar.period.x=1", "\"period\" is a text, it has no entry \"x\""),
            ("at.3.time=1s", "\"at\" has no item 3; it has 1, numbered from 0"),
            ("period", "there is no \"=\"; write KEY=VALUE, as in --set agent.sonar.period=250ms"),
            (".x=1", "\".x\" is no path of names; write it as in agent.sonar.period"),
        ] {
            assert_eq!(done(assignment).unwrap_err(), said);
        }
    }
}
