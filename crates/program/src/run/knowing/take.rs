//! From a store to what a run knows, and into its plan.

use std::path::Path;

use knowledge::{DecisionTable, Kind, Knowledge, KnowledgeError, Snapshot, colours};
use types::value::{Mistake, Span, Table, Value, nearest};

use super::known::{Known, Taken};
use crate::error::Failure;
use crate::file::knowledge::{Section, Wanted, decider, judge, patterns, put_pattern, table_of, with_table};
use crate::file::{Loaded, Mistakes};
use crate::run::prepare::Scenario;
use crate::terminal;

/// Takes out of the store what the system needs of it. A decision table that only the system file has becomes the first version.
pub(super) fn take(
    scenario: &Scenario,
    section: &Section,
    store: &Path,
    tell: &dyn Fn(&str),
) -> Result<Known, Failure> {
    let file = &scenario.file;
    let failed = |error: KnowledgeError| of_store(file, section, &error);
    if let Some(folder) = store.parent() {
        // Where it cannot be made, the store says what is wrong.
        let _ = std::fs::create_dir_all(folder);
    }
    let mut knowledge = Knowledge::open(store).map_err(failed)?;
    let mut known = {
        let now = knowledge.read().map_err(failed)?;
        let wanted = patterns(&file.plan, &scenario.registry);
        Known {
            table: None,
            patterns: wanted
                .iter()
                .map(|wanted| Ok((wanted.name.clone(), pattern(&now, file, section, wanted, store)?)))
                .collect::<Result<_, Failure>>()?,
            schedules: now.schedules().map_err(failed)?,
        }
    };
    if let Some((name, at)) = &section.decide {
        let newest = knowledge.read().and_then(|now| now.newest(name)).map_err(failed)?;
        known.table = Some(match (newest, decider(&file.plan).and_then(table_of)) {
            (Some(version), own) => {
                let text = |table: &Table| Value::Table(table.clone()).to_string();
                if own.is_some_and(|own| text(own) != text(&version.weights)) {
                    tell(&format!(
                        "table \"{name}\", version {}, in {} is in force; [decide] says something else",
                        version.number,
                        store.display()
                    ));
                }
                Taken { version: version.number, table: version.weights }
            }
            (None, Some(table)) => {
                let first =
                    DecisionTable { name: name.clone(), weights: table.clone(), time: terminal::host_date() };
                knowledge.put(first).map_err(|error| wrong(file, *at, error.to_string(), error.help()))?;
                tell(&format!("[decide] is now table \"{name}\", version 1, in {}", store.display()));
                Taken { version: 1, table: table.clone() }
            }
            (None, None) => {
                let now = knowledge.read().map_err(failed)?;
                let what = format!(
                    "there is no decision table \"{name}\" in {}, and no section [decide]",
                    store.display()
                );
                let put = format!("put one: sinew know --file {} put table {name} FILE", store.display());
                let help = near(&now, Kind::Table, name).unwrap_or(put);
                return Err(wrong(file, *at, what, help));
            }
        });
    }
    Ok(known)
}

/// Puts into the plan what is known, and judges it as if it stood in the file.
pub(super) fn put_into(
    known: &Known,
    mut scenario: Scenario,
    section: &Section,
    store: &Path,
) -> Result<Scenario, Failure> {
    let Scenario { file, registry } = &mut scenario;
    for wanted in patterns(&file.plan, registry) {
        let known = known.patterns.iter().find(|(name, _)| *name == wanted.name);
        if let Some((_, table)) = known {
            put_pattern(&mut file.plan, &wanted, table.clone());
        }
    }
    if let (Some((name, _)), Some(taken)) = (&section.decide, &known.table) {
        *file = with_table(file, registry, &shown(name, taken.version, store), &taken.table)?;
    }
    judge(file, registry)?;
    Ok(scenario)
}

/// What messages call a version of a table.
pub(super) fn shown(name: &str, version: u32, store: &Path) -> String {
    format!("table \"{name}\", version {version}, in {}", store.display())
}

/// The pattern that an agent names, as a table for it.
fn pattern(
    now: &Snapshot<'_>,
    file: &Loaded,
    section: &Section,
    wanted: &Wanted,
    store: &Path,
) -> Result<Table, Failure> {
    let Wanted { name, at, .. } = wanted;
    match now.pattern(name).map_err(|error| of_store(file, section, &error))? {
        Some(pattern) => colours(&pattern).map_err(|why| {
            let help = "a range of colours is put by: sinew know put pattern NAME --set hue_from=350 --set hue_to=10";
            wrong(file, *at, format!("the pattern \"{name}\" in {} cannot be used: {why}", store.display()), help)
        }),
        None => {
            let what = format!("there is no pattern \"{name}\" in {}", store.display());
            let put = format!("put it: sinew know --file {} put pattern {name} --set hue_from=350 --set hue_to=10", store.display());
            Err(wrong(file, *at, what, near(now, Kind::Pattern, name).unwrap_or(put)))
        }
    }
}

/// What a place is called that is no place of a file.
const OF_COMMAND_LINE: &str = "--set";

/// The name that may be meant.
fn near(now: &Snapshot<'_>, kind: Kind, name: &str) -> Option<String> {
    let names: Vec<String> = now.list(kind).ok()?.into_iter().map(|listed| listed.name).collect();
    nearest(name, names.iter().map(String::as_str)).map(|near| format!("did you mean \"{near}\"?"))
}

/// The store cannot be read: the place is where the system file names it, if that does.
fn of_store(file: &Loaded, section: &Section, error: &KnowledgeError) -> Failure {
    let named = file.sources.place(section.file_at).is_some_and(|place| place.file != OF_COMMAND_LINE);
    let at = if named { section.file_at } else { Span::default() };
    wrong(file, at, error.to_string(), error.help())
}

fn wrong(file: &Loaded, at: Span, what: String, help: impl Into<String>) -> Failure {
    let list = vec![Mistake::new(at, what).help(help)];
    Mistakes { sources: file.sources.clone(), list }.into()
}
