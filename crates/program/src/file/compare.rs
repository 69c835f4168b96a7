//! `[compare]`: one entry of the plan with several values, whose runs are shown one above the other.

use runtime::Plan;
use types::value::{Entry, Mistake, Table, Value};

use super::read::Reader;
use super::set;

const COMPARE: &str = "compare";

/// Reads the section and keeps it in the plan.
pub(super) fn read(reader: &mut Reader<'_>, tree: &Table) {
    let Some(entry) = tree.get(COMPARE) else { return };
    let help = "as in \"agent.manager.policy\" = [\"elastic\", \"none\"]";
    match entry.value.as_table().map(Table::rows) {
        Some([row]) if row.entry.value.as_list().is_some_and(|values| values.len() > 1) => {
            if tree.at_path(&row.key).is_none() {
                let what = format!("there is no entry \"{}\" to be compared", row.key);
                reader.mistakes.push(Mistake::new(row.key_at, what).help("write it into the file first"));
            }
        }
        _ => {
            let what = "[compare] needs one entry of the plan, and a list of two values or more";
            reader.mistakes.push(Mistake::new(entry.at, what).help(help));
        }
    }
    reader.plan.sections.set(COMPARE, entry.clone());
}

/// Reads the file once with each of the values, as the runs that are compared will: what is wrong with it then is told at the value.
pub(super) fn try_values(reader: &mut Reader<'_>, tree: &Table, file: &str) {
    let Some(row) = tree.get(COMPARE).and_then(|entry| entry.value.as_table()?.rows().first()) else {
        return;
    };
    let values = row.entry.value.as_list().unwrap_or_default();
    if tree.at_path(&row.key).is_none() {
        return;
    }
    let mut plain = tree.clone();
    plain.remove(COMPARE);
    for value in values {
        let mut variant = Reader::new(reader.registry, &reader.folder);
        variant.sources = reader.sources.clone();
        let mut tree = plain.clone();
        match set::set(&mut tree, &mut variant.sources, &format!("{}={}", row.key, as_typed(value))) {
            Ok(()) => variant.system(&tree, file),
            Err(mistake) => variant.mistakes.push(mistake),
        }
        for mistake in variant.mistakes {
            // What is wrong without it has a place of its own.
            if reader.mistakes.iter().all(|known| known.what != mistake.what) {
                reader.mistakes.push(Mistake { at: value.at, ..mistake });
            }
        }
    }
}

fn as_typed(value: &Entry) -> String {
    match &value.value {
        Value::Text(text) => text.clone(),
        other => other.to_string(),
    }
}

/// The entry, and its values as `--set` takes them.
pub(crate) fn compared(plan: &Plan) -> Option<(String, Vec<String>)> {
    let row = plan.section(COMPARE)?.rows().first()?;
    let values = row.entry.value.as_list()?.iter().map(as_typed);
    Some((row.key.clone(), values.collect()))
}
