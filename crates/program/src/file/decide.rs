//! `[decide]`: the table of the decision maker.

use agents::DecisionMaker;
use agents::decision_maker::{DecisionTable, SETTINGS, Situation};
use runtime::Declare as _;
use types::value::{Entry, Mistake, Row, Span, Table, Value};

use super::read::Reader;
use super::{Mistakes, Sources, set, tree};

/// The type of the agent to which the section belongs.
pub(super) const KIND: &str = DecisionMaker::KIND;
/// Its parameter.
pub(super) const PARAM: &str = "table";

/// Reads the section into the parameters of the decision maker.
pub(super) fn read(reader: &mut Reader<'_>, tree: &Table) {
    let Some(entry) = tree.get("decide") else { return };
    let Some(table) = entry.value.as_table() else {
        reader.say(entry.at, format!("\"decide\" is {}, not a section", entry.value.kind()));
        return;
    };
    let mut joined = Table::new();
    flatten(table, &mut joined);
    agents(reader, &joined);
    let mut makers = reader.plan.agents.iter_mut().filter(|agent| agent.kind == KIND);
    let mistake = match (makers.next(), makers.next()) {
        (None, _) => Some(
            Mistake::new(entry.at, "nobody reads [decide]")
                .help(format!("add an agent with is = \"{KIND}\", or take the section out")),
        ),
        (Some(first), Some(second)) => Some(
            Mistake::new(entry.at, format!("both {} and {} could read [decide]", first.name, second.name))
                .help(format!("give each its own, as in [agent.{}.{PARAM}]", first.name)),
        ),
        (Some(maker), None) if maker.params.get(PARAM).is_some() => Some(Mistake::new(
            entry.at,
            format!("agent \"{}\" has a \"{PARAM}\" of its own beside [decide]", maker.name),
        )),
        (Some(maker), None) => {
            // What is wrong in it is told with the other parameters, which may declare signals.
            maker.params.set(PARAM, Entry { value: Value::Table(joined), at: entry.at });
            return;
        }
    };
    reader.mistakes.extend(mistake);
    reader.mistakes.extend(DecisionTable::mistakes(&joined, None));
}

/// Whoever is named must be there.
fn agents(reader: &mut Reader<'_>, table: &Table) {
    for agent in DecisionTable::agents(table).filter(|agent| reader.plan.agent(&agent.key).is_none()) {
        let mistake = reader.no_agent(&agent.key, agent.key_at);
        reader.mistakes.push(mistake);
    }
}

/// Reads a table that stands by itself: the rows of a file, or of its section `[decide]`, else those of `base`; then the
/// `KEY=VALUE` changes. `text` is the name of the file and what stands in it. Any word of a condition may be a signal here: who tells it
/// is known where the table is used.
///
/// # Errors
/// All mistakes.
pub(crate) fn read_alone(
    text: Option<(&str, &str)>,
    base: Table,
    sets: &[String],
) -> Result<Table, Mistakes> {
    let (mut sources, mut list) = (Sources::default(), Vec::new());
    let mut table = base;
    if let Some((name, text)) = text {
        let start = sources.add(name, text);
        let tree = tree::read(&sources, start, &mut list).unwrap_or_default();
        let section = tree.get("decide").and_then(|entry| entry.value.as_table());
        table = Table::new();
        flatten(section.unwrap_or(&tree), &mut table);
    }
    for assignment in sets {
        list.extend(set::set_in(&mut table, &mut sources, assignment, "decide").err());
    }
    list.extend(DecisionTable::mistakes(&table, None));
    list.sort_by_key(|mistake| mistake.at.start);
    if list.is_empty() { Ok(table) } else { Err(Mistakes { sources, list }) }
}

/// Names without quotes are tables in tables for TOML: they are joined again.
fn flatten(table: &Table, out: &mut Table) {
    for row in table.rows() {
        let nested =
            row.entry.value.as_table().filter(|inner| {
                !inner.is_empty() && inner.rows().iter().all(|deeper| is_row(&row.key, deeper))
            });
        match nested {
            Some(inner) => {
                for deeper in inner.rows() {
                    let key_at = Span { start: row.key_at.start, end: deeper.key_at.end };
                    out.push(Row { key: joined(&row.key, deeper), key_at, ..deeper.clone() });
                }
            }
            None => out.push(row.clone()),
        }
    }
}

fn joined(key: &str, deeper: &Row) -> String {
    format!("{key}.{}", deeper.key)
}

/// Whether a table in a table is the row of a situation, and not what the outer one says of an agent.
fn is_row(key: &str, deeper: &Row) -> bool {
    let Some(table) = deeper.entry.value.as_table() else { return false };
    let has = |keys: &[&str]| table.rows().iter().any(|row| keys.contains(&row.key.as_str()));
    has(&["when"]) || Situation::named(&joined(key, deeper)).is_some() || !has(&SETTINGS)
}
