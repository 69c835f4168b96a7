//! `[decide]`: the table of the decision maker.

use agents::DecisionMaker;
use agents::decision_maker::{DecisionTable, SETTINGS, Situation};
use runtime::{AgentPlan, Declare as _, Registry};
use types::value::{Entry, Mistake, Row, Span, Table, Value};

use super::read::{Reader, unknown};
use super::{Mistakes, Sources, set, tree};

/// The type of the agent to which the section belongs.
pub(crate) const KIND: &str = DecisionMaker::KIND;
/// Its parameter.
pub(crate) const PARAM: &str = "table";

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

/// Whoever is named must be there, and be able to do what it is told.
fn agents(reader: &mut Reader<'_>, table: &Table) {
    for row in DecisionTable::agents(table) {
        let mistake = match reader.plan.agent(&row.key) {
            None => Some(reader.no_agent(&row.key, row.key_at)),
            Some(agent) => no_method(agent, reader.registry, row),
        };
        reader.mistakes.extend(mistake);
    }
}

/// What a table says of agents that are not in a running system, or of methods that they have not.
pub(crate) fn strangers(agents: &[AgentPlan], registry: &Registry, table: &Table) -> Vec<Mistake> {
    let wrong = |row: &Row| match agents.iter().find(|agent| agent.name == row.key) {
        None => {
            let what = format!("there is no agent \"{}\"", row.key);
            Some(unknown(row.key_at, what, &row.key, agents.iter().map(|agent| agent.name.as_str())))
        }
        Some(agent) => no_method(agent, registry, row),
    };
    DecisionTable::agents(table).filter_map(wrong).collect()
}

/// The method that a row gives an agent, where it has none of that name.
fn no_method(agent: &AgentPlan, registry: &Registry, row: &Row) -> Option<Mistake> {
    let entry = row.entry.value.as_table()?.get("method")?;
    let (method, kind) = (entry.value.as_text()?, registry.get(&agent.kind)?);
    if kind.methods.iter().any(|known| known.name == method) {
        return None;
    }
    let what = format!("agent \"{}\" has no method \"{method}\"", agent.name);
    if kind.methods.is_empty() {
        return Some(Mistake::new(entry.at, what).help("it has one way to work: leave the method out"));
    }
    Some(unknown(entry.at, what, method, kind.methods.iter().map(|known| known.name)))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agents_that_are_not_there_and_methods_that_they_have_not_are_told_with_the_right_ones() {
        let registry = crate::run::with_robots(::agents::registry());
        let agents = crate::file::load("overload", &[], &registry).unwrap().plan.agents;
        let said = |agent: &str, method: &str| {
            let nested = |key: &str, value: Value| {
                let mut table = Table::new();
                table.set(key, value);
                Value::Table(table)
            };
            let row = nested(agent, nested("method", Value::Text(method.to_owned())));
            let Value::Table(table) = nested("free", row) else { unreachable!("it is one") };
            let told = |mistake: Mistake| format!("{}; {}", mistake.what, mistake.help.unwrap_or_default());
            strangers(&agents, &registry, &table).into_iter().map(told).collect::<Vec<_>>()
        };
        assert_eq!(said("track", "rough"), [""; 0]);
        assert_eq!(said("trak", "rough"), ["there is no agent \"trak\"; did you mean \"track\"?"]);
        assert_eq!(
            said("track", "ruogh"),
            ["agent \"track\" has no method \"ruogh\"; did you mean \"rough\"?"]
        );
        assert_eq!(
            said("planner", "fast"),
            ["agent \"planner\" has no method \"fast\"; it has one way to work: leave the method out"]
        );
    }
}
