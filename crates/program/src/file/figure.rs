//! `[[figure]]`: parts of a run that are drawn by themselves.

use runtime::Plan;
use types::value::{Mistake, Span, Table, TableReader, nearest};

use super::read::{Reader, span_of_time};

const FIGURE: &str = "figure";
/// What there is to draw.
const KINDS: [&str; 2] = ["way", "velocity"];
/// More figures than this nobody looks at.
const MOST: usize = 64;

/// A part of a run, to be drawn.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Part {
    /// The name of its files.
    pub(crate) name: String,
    /// Whether it shows the way on the floor, or else how the robot moved over time.
    pub(crate) is_way: bool,
    /// Its first and its last time (s).
    pub(crate) span: (f64, f64),
}

/// Reads the sections and keeps them in the plan.
pub(super) fn read(reader: &mut Reader<'_>, tree: &Table) {
    let Some(entry) = tree.get(FIGURE) else { return };
    if entry.value.as_list().is_none() {
        let what = format!("\"{FIGURE}\" is {}, not a list", entry.value.kind());
        let help = "write [[figure]] with two brackets, once for each figure";
        reader.mistakes.push(Mistake::new(entry.at, what).help(help));
        return;
    }
    let mut outer = TableReader::new(tree, Span::default(), "the file");
    let mut names: Vec<String> = Vec::new();
    for (table, at) in outer.tables(FIGURE) {
        if let Some(part) = one(table, at, &mut reader.mistakes) {
            if names.contains(&part.name) {
                reader.mistakes.push(Mistake::new(at, format!("there are two figures \"{}\"", part.name)));
            }
            names.push(part.name);
        }
    }
    if names.len() > MOST {
        reader.mistakes.push(Mistake::new(entry.at, format!("{} figures are more than {MOST}", names.len())));
    }
    reader.plan.sections.set(FIGURE, entry.clone());
}

/// The figures of a plan that was read without mistakes.
pub(crate) fn figures(plan: &Plan) -> Vec<Part> {
    let Some(list) = plan.sections.get(FIGURE).and_then(|entry| entry.value.as_list()) else {
        return Vec::new();
    };
    let tables = list.iter().filter_map(|entry| entry.value.as_table());
    tables.filter_map(|table| one(table, Span::default(), &mut Vec::new())).collect()
}

fn one(table: &Table, at: Span, mistakes: &mut Vec<Mistake>) -> Option<Part> {
    let mut r = TableReader::new(table, at, "[[figure]]");
    let name = r.required_text("name", "the name of its files").map(str::to_owned);
    let is_plain = |name: &str| name.chars().all(|c| c.is_ascii_alphanumeric() || "-_".contains(c));
    if let Some(name) = name.as_deref().filter(|name| name.is_empty() || !is_plain(name)) {
        let what = format!("\"{name}\" is no name of a figure: it has letters, digits, - and _");
        r.report(Mistake::new(r.place("name"), what));
    }
    let shows = r.required_text("shows", "what it shows: \"way\" or \"velocity\"");
    if let Some(shows) = shows.filter(|shows| !KINDS.contains(shows)) {
        let mistake =
            Mistake::new(r.place("shows"), format!("\"shows\" is \"{shows}\", not \"way\" or \"velocity\""));
        r.report(match nearest(shows, KINDS) {
            Some(near) => mistake.help(format!("did you mean \"{near}\"?")),
            None => mistake,
        });
    }
    for key in ["from", "until"] {
        if r.entry(key).is_none() {
            r.missing(key, &format!("as in {key} = \"30s\""));
        }
    }
    let (from, until) = (span_of_time(&mut r, "from"), span_of_time(&mut r, "until"));
    if let Some((from, until)) = from.zip(until).filter(|(from, until)| until <= from) {
        let what = format!("the figure ends at {until}, before it begins at {from}");
        r.report(Mistake::new(r.place("until"), what));
    }
    let clean = r.finish(mistakes);
    let (name, shows) = name.zip(shows).filter(|_| clean)?;
    Some(Part { name, is_way: shows == "way", span: (from?.seconds(), until?.seconds()) })
}
