//! `[knowledge]`: the store that a run reads, and what of it goes into the plan.
//!
//! | entry | what |
//! |---|---|
//! | `file` | the store, beside the system file; made where it is not there |
//! | `begins` | the date that the calendar shows when a simulated run begins, as in `"2026-03-02 07:59"`; 1970-01-01 when nothing is said |
//! | `decide` | the decision table of the store that is the decision maker's; that of `[decide]` when nothing is said |
//!
//! An agent that has a parameter `pattern` which is a table may be given the name of a pattern instead: `pattern = "ball"`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use knowledge::Date;
use runtime::{AgentPlan, Plan, Registry};
use types::Duration;
use types::value::{Entry, Key, Mistake, Row, Span, Table, TableReader, Value};

use super::read::Reader;
use super::{Loaded, Mistakes, decide, tree};

/// The name of the section.
const SECTION: &str = "knowledge";
/// The parameter that a pattern of the store can stand for.
const PATTERN: &str = "pattern";

/// What the section says.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Section {
    /// The store, as it is written, and where.
    pub(crate) file: String,
    pub(crate) file_at: Span,
    /// What the calendar shows at the zero of a simulated clock, counted from 1970-01-01.
    pub(crate) begins: Duration,
    /// The table of the decision maker, and where it is named.
    pub(crate) decide: Option<(String, Span)>,
}

/// An agent that names a pattern.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Wanted {
    /// The agent.
    pub(crate) agent: String,
    /// The pattern.
    pub(crate) name: String,
    /// Where it is named.
    pub(crate) at: Span,
}

/// Reads the section. Agents are known by then.
pub(super) fn read(reader: &mut Reader<'_>, tree: &Table) {
    if let Some(entry) = tree.get(SECTION) {
        match &entry.value {
            Value::Table(table) => {
                let section = section_of(table, entry.at, &mut reader.mistakes);
                if let Some((_, at)) = section.decide {
                    maker(reader, at);
                }
                reader.plan.sections.set(SECTION, entry.clone());
            }
            other => reader.say(entry.at, format!("\"{SECTION}\" is {}, not a section", other.kind())),
        }
    }
    for Wanted { agent, name, at } in patterns(&reader.plan, reader.registry) {
        // It is a table when the run begins.
        reader.spoiled.push(at);
        if tree.get(SECTION).is_none() {
            let what =
                format!("agent \"{agent}\" names the pattern \"{name}\", and there is no store of patterns");
            let help = "write [knowledge] and file = \"home.db\" below it, or run it with --know FILE";
            reader.mistakes.push(Mistake::new(at, what).help(help));
        }
    }
}

fn section_of(table: &Table, at: Span, mistakes: &mut Vec<Mistake>) -> Section {
    let mut r = TableReader::new(table, at, "[knowledge]");
    let file = r.required_text("file", "as in file = \"home.db\"").unwrap_or_default().to_owned();
    let file_at = r.place("file");
    if file.trim().is_empty() && r.entry("file").is_some_and(|entry| entry.value.as_text().is_some()) {
        r.report(Mistake::new(file_at, "\"file\" names nothing").help("as in file = \"home.db\""));
    }
    let begins = r.text("begins").map(|text| (text, text.parse::<Date>()));
    let begins = match begins {
        Some((_, Ok(date))) => date.time().map(|time| time.since_start()).unwrap_or_default(),
        Some((text, Err(error))) => {
            let what = format!("\"begins\" is \"{text}\", which is no date");
            r.report(Mistake::new(r.place("begins"), what).help(error.to_string()));
            Duration::ZERO
        }
        None => Duration::ZERO,
    };
    let decide = r.text("decide").map(|name| (name.to_owned(), r.place("decide")));
    r.finish(mistakes);
    Section { file, file_at, begins, decide }
}

/// Somebody must read the table that is named, and one alone.
fn maker(reader: &mut Reader<'_>, at: Span) {
    let mut makers = reader.plan.agents.iter().filter(|agent| agent.kind == decide::KIND);
    let mistake = match (makers.next(), makers.next()) {
        (None, _) => Some(
            Mistake::new(at, "nobody reads the decision table")
                .help(format!("add an agent with is = \"{}\", or take \"decide\" out", decide::KIND)),
        ),
        (Some(first), Some(second)) => Some(
            Mistake::new(
                at,
                format!("both {} and {} could read the decision table", first.name, second.name),
            )
            .help("a system whose table lies in a store has one decision maker"),
        ),
        _ => None,
    };
    reader.mistakes.extend(mistake);
}

/// The section of a plan that was read.
pub(crate) fn section(plan: &Plan) -> Option<Section> {
    let entry = plan.sections.get(SECTION)?;
    Some(section_of(entry.value.as_table()?, entry.at, &mut Vec::new()))
}

/// Where the store lies: beside the system file.
pub(super) fn store(plan: &Plan, folder: &Path) -> Option<PathBuf> {
    section(plan).map(|section| folder.join(section.file))
}

/// The agents that name a pattern where they could have its table.
pub(crate) fn patterns(plan: &Plan, registry: &Registry) -> Vec<Wanted> {
    let named = |agent: &AgentPlan| {
        let kind = registry.get(&agent.kind)?;
        let field = kind.params.iter().find(|field| field.name == PATTERN)?;
        field.default.as_table()?;
        let entry = agent.params.get(PATTERN)?;
        let name = entry.value.as_text()?.to_owned();
        Some(Wanted { agent: agent.name.clone(), name, at: entry.at })
    };
    plan.agents.iter().filter_map(named).collect()
}

/// Puts a pattern into the place of its name.
pub(crate) fn put_pattern(plan: &mut Plan, wanted: &Wanted, table: Table) {
    if let Some(agent) = plan.agent_mut(&wanted.agent) {
        agent.params.set(PATTERN, Entry { value: Value::Table(table), at: wanted.at });
    }
}

/// The decision maker of a plan, if it is one alone.
pub(crate) fn decider(plan: &Plan) -> Option<&AgentPlan> {
    let mut makers = plan.agents.iter().filter(|agent| agent.kind == decide::KIND);
    makers.next().filter(|_| makers.next().is_none())
}

/// The table that a decision maker has.
pub(crate) fn table_of(maker: &AgentPlan) -> Option<&Table> {
    maker.params.get(decide::PARAM)?.value.as_table()
}

/// The parameter of a decision maker that is its table.
pub(crate) const TABLE: &str = decide::PARAM;

/// The same system with another table for its decision maker, judged as the section `[decide]` would be. `shown` is what messages call
/// the table; they show its rows.
///
/// # Errors
/// All that is wrong with the table.
pub(crate) fn with_table(
    loaded: &Loaded,
    registry: &Registry,
    shown: &str,
    table: &Table,
) -> Result<Loaded, Mistakes> {
    let mut reader = Reader::over(loaded, registry);
    let mut text = String::new();
    for row in table.rows() {
        // Writing to a text cannot fail.
        let _ = writeln!(text, "{} = {}", Key(&row.key), row.entry.value);
    }
    let length = text.len() as u32;
    let start = reader.sources.add(shown, text);
    if let Some(rows) = tree::read(&reader.sources, start, &mut reader.mistakes) {
        if let Some(maker) = reader.plan.agents.iter_mut().find(|agent| agent.kind == decide::KIND) {
            maker.params.remove(decide::PARAM);
        }
        let at = Span { start, end: start + length };
        let mut section = Table::new();
        let entry = Entry { value: Value::Table(rows), at };
        section.push(Row { key: "decide".to_owned(), key_at: at, entry });
        decide::read(&mut reader, &section);
        // What the decision maker itself says of its table; of the rest of the plan this is not the place to speak.
        let judged = runtime::check(&reader.plan, registry);
        let of_table = |mistake: &Mistake| (start..=start + length).contains(&mistake.at.start);
        reader.mistakes.extend(judged.into_iter().filter(of_table));
    }
    let store = loaded.store.clone();
    reader.finish().map(|file| Loaded { store, ..file })
}

/// Judges a plan once more, when what stood in a store is in it.
///
/// # Errors
/// All mistakes.
pub(crate) fn judge(loaded: &Loaded, registry: &Registry) -> Result<(), Mistakes> {
    let list = runtime::check(&loaded.plan, registry);
    if list.is_empty() { Ok(()) } else { Err(Mistakes { sources: loaded.sources.clone(), list }) }
}
