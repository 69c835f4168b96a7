//! `[burden.NAME]`: work of other processes with a real-time priority, for seeing what becomes of a system beside it; and `processors`: on how
//! many virtual ones simulated steps take their time; and `as_declared`: whether they do so on the wall clock, too.

use runtime::{Burden, Plan};
use types::Duration;
use types::value::{Entry, Mistake, Span, Table, TableReader, Value};

use super::read::{Reader, none_to_run_on, span_of_time};

/// The sections that are read here.
const BURDEN: &str = "burden";
const PROCESSORS: &str = "processors";
const AS_DECLARED: &str = "as_declared";
/// As many virtual processors as there can be.
const MOST_PROCESSORS: i64 = 64;
/// How often a burden works when nothing is said.
const USUAL_PERIOD: Duration = Duration::millis(10);

/// Reads both, and keeps them in the plan.
pub(super) fn read(reader: &mut Reader<'_>, tree: &Table) {
    for (name, at, table) in reader.each(tree, BURDEN) {
        one(name, at, table, &mut reader.mistakes);
    }
    if let Some(entry) = tree.get(PROCESSORS)
        && processors_of(&entry.value).is_none()
    {
        let what = format!("\"{PROCESSORS}\" is {}, not a number from 1 to {MOST_PROCESSORS}", entry.value);
        reader.mistakes.push(Mistake::new(entry.at, what));
    }
    if let Some(entry) = tree.get(AS_DECLARED)
        && !matches!(entry.value, Value::Bool(_))
    {
        let what = format!("\"{AS_DECLARED}\" is {}, not true or false", entry.value);
        reader.mistakes.push(Mistake::new(entry.at, what));
    }
    for section in [PROCESSORS, AS_DECLARED, BURDEN] {
        if let Some(entry) = tree.get(section) {
            reader.plan.sections.set(section, entry.clone());
        }
    }
}

fn processors_of(value: &Value) -> Option<usize> {
    let Value::Int(count) = value else { return None };
    (1..=MOST_PROCESSORS).contains(count).then_some(*count as usize)
}

/// On how many virtual processors simulated steps take their time, where the plan says so.
pub(crate) fn processors(plan: &Plan) -> Option<usize> {
    processors_of(&plan.sections.get(PROCESSORS)?.value)
}

/// Whether steps take what is declared for them on the wall clock, too.
pub(crate) fn as_declared(plan: &Plan) -> bool {
    plan.sections.get(AS_DECLARED).is_some_and(|entry| entry.value == Value::Bool(true))
}

/// The burdens of a plan that was read without mistakes.
pub(crate) fn burdens(plan: &Plan) -> Vec<Burden> {
    let rows = plan.section(BURDEN).map(Table::rows).unwrap_or_default();
    let read =
        rows.iter().filter_map(|row| one(&row.key, row.key_at, row.entry.value.as_table()?, &mut Vec::new()));
    read.collect()
}

fn one(name: &str, at: Span, table: &Table, mistakes: &mut Vec<Mistake>) -> Option<Burden> {
    let mut r = TableReader::new(table, at, format!("burden \"{name}\""));
    let priority = r.int("priority");
    if priority.is_none() && table.get("priority").is_none() {
        r.missing("priority", "its real-time priority, as in priority = 65");
    }
    if let Some(priority) = priority.filter(|priority| !(1..=94).contains(priority)) {
        let what = format!("the priority of burden \"{name}\" must lie from 1 to 94, not {priority}");
        r.report(Mistake::new(r.place("priority"), what));
    }
    if table.get("share").is_none() {
        r.missing("share", "how much of a processor it takes, as in share = 0.9");
    }
    let share = r.float_in("share", 0.0, 0.99);
    let period = span_of_time(&mut r, "period").unwrap_or(USUAL_PERIOD);
    if period <= Duration::ZERO {
        let what = format!("the period of burden \"{name}\" must be longer than zero, not {period}");
        r.report(Mistake::new(r.place("period"), what));
    }
    let from = span_of_time(&mut r, "from").unwrap_or(Duration::ZERO);
    let until = span_of_time(&mut r, "until").unwrap_or(Duration(i64::MAX));
    if until <= from {
        let what = format!("burden \"{name}\" ends at {until}, before it begins at {from}");
        r.report(Mistake::new(r.place("until"), what));
    }
    let mut cpus = Vec::new();
    let listed = r.list("cpus");
    if listed.is_some_and(<[Entry]>::is_empty) {
        r.report(none_to_run_on(r.place("cpus")));
    }
    for entry in listed.unwrap_or_default() {
        match entry.value {
            Value::Int(cpu) if (0..MOST_PROCESSORS).contains(&cpu) => cpus.push(cpu as usize),
            _ => {
                r.report(Mistake::new(entry.at, format!("{} is not the number of a processor", entry.value)))
            }
        }
    }
    let clean = r.finish(mistakes);
    let (priority, share) = priority.zip(share).filter(|_| clean)?;
    let (name, priority) = (name.to_owned(), priority as u8);
    Some(Burden { name, priority, cpus, share, period, from, until })
}
