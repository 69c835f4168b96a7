//! `for`: how long a run lasts in simulated time, where neither a goal nor who runs it says so.

use runtime::Plan;
use types::Duration;
use types::value::{Mistake, Span, Table, TableReader};

use super::read::{Reader, span_of_time};

const FOR: &str = "for";

/// Reads the entry and keeps it in the plan.
pub(super) fn read(reader: &mut Reader<'_>, tree: &Table) {
    let Some(entry) = tree.get(FOR) else { return };
    let mut r = TableReader::new(tree, Span::default(), "the file");
    let time = span_of_time(&mut r, FOR);
    if time.is_some_and(|time| time <= Duration::ZERO) {
        r.report(Mistake::new(entry.at, "a run lasts longer than no time").help("as in for = \"10min\""));
    }
    tree.rows().iter().for_each(|row| r.allow(&row.key));
    r.finish(&mut reader.mistakes);
    reader.plan.sections.set(FOR, entry.clone());
}

/// How long a run lasts, where the plan says so.
pub(crate) fn lasting(plan: &Plan) -> Option<Duration> {
    plan.sections.get(FOR)?.value.as_text()?.parse().ok()
}
