//! `[compare]`: one entry of the plan with several values, whose runs are shown one above the other.

use runtime::Plan;
use types::value::{Mistake, Table, Value};

use super::read::Reader;

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

/// The entry, and its values as `--set` takes them.
pub(crate) fn compared(plan: &Plan) -> Option<(String, Vec<String>)> {
    let row = plan.section(COMPARE)?.rows().first()?;
    let values = row.entry.value.as_list()?.iter().map(|value| match &value.value {
        Value::Text(text) => text.clone(),
        other => other.to_string(),
    });
    Some((row.key.clone(), values.collect()))
}
