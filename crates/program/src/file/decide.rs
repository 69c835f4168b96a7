//! `[decide]`: the table of the decision maker.

use agents::DecisionMaker;
use agents::decision_maker::Situation;
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
    check(reader, &joined);
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
            maker.params.set(PARAM, Entry { value: Value::Table(joined), at: entry.at });
            None
        }
    };
    reader.mistakes.extend(mistake);
}

fn check(reader: &mut Reader<'_>, table: &Table) {
    judge(table, &mut reader.mistakes);
    for weights in table.rows().iter().filter_map(|row| row.entry.value.as_table()) {
        for weight in weights.rows().iter().filter(|weight| reader.plan.agent(&weight.key).is_none()) {
            let mistake = reader.no_agent(&weight.key, weight.key_at);
            reader.mistakes.push(mistake);
        }
    }
}

/// What is wrong with a table whoever the agents are: situations that nobody recognises, and weights that are none.
fn judge(table: &Table, mistakes: &mut Vec<Mistake>) {
    for row in table.rows() {
        if !Situation::ALL.iter().any(|situation| situation.name() == row.key) {
            let known = Situation::ALL.map(Situation::name);
            mistakes.push(Mistake::unknown(row.key_at, "situation", &row.key, known));
        }
        let Some(weights) = row.entry.value.as_table() else {
            mistakes.push(
                Mistake::new(row.entry.at, format!("\"{}\" must be a table of weights", row.key))
                    .help("as in { safety = 1.0, wall = 0.0 }"),
            );
            continue;
        };
        for weight in weights.rows() {
            if !weight.entry.value.as_float().is_some_and(|weight| (0.0..=1.0).contains(&weight)) {
                let what = format!(
                    "the weight of \"{}\" is {}, not a number from 0 to 1",
                    weight.key, weight.entry.value
                );
                mistakes.push(Mistake::new(weight.entry.at, what));
            }
        }
    }
}

/// Reads a table that stands by itself: the rows of a file, or of its section `[decide]`, else those of `base`; then the
/// `KEY=VALUE` changes. `text` is the name of the file and what stands in it.
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
    judge(&table, &mut list);
    list.sort_by_key(|mistake| mistake.at.start);
    if list.is_empty() { Ok(table) } else { Err(Mistakes { sources, list }) }
}

/// Names without quotes are tables in tables for TOML: they are joined again.
fn flatten(table: &Table, out: &mut Table) {
    for row in table.rows() {
        let nested = row.entry.value.as_table().filter(|inner| {
            !inner.is_empty() && inner.rows().iter().all(|row| row.entry.value.as_table().is_some())
        });
        match nested {
            Some(inner) => {
                for deeper in inner.rows() {
                    let key_at = Span { start: row.key_at.start, end: deeper.key_at.end };
                    out.push(Row { key: format!("{}.{}", row.key, deeper.key), key_at, ..deeper.clone() });
                }
            }
            None => out.push(row.clone()),
        }
    }
}
