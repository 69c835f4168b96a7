//! The mode table: in which mode whose wishes are heard, how they become one command, and what becomes of the mode when somebody dies.

use types::Name;
use types::messages::{Coordination, MOST_AGENTS, Mode, ModeRow};
use types::params::ParamValue;
use types::value::{Entry, Mistake, Row, Span, Table, Value, nearest};

/// The mode in which nobody is heard and the robot stands. It is there without being written.
pub const IDLE: &str = "idle";
/// The keys of a mode that name no agent.
pub const RESERVED: [&str; 2] = ["by", "dies"];
/// What a mode can say of an agent.
const SETTINGS: [&str; 2] = ["weight", "priority"];
/// The most modes.
const MOST_MODES: usize = 16;
/// What a `Name` holds (bytes).
const LONGEST: usize = 23;
const HIGHEST: i64 = 1000;

/// The modes as they are written, and as the steps need them.
#[derive(Clone, Debug)]
pub struct ModeTable {
    written: Table,
    rows: Vec<Known>,
}

/// A mode, and where it leads when one of its actions dies.
#[derive(Clone, Copy, Debug)]
pub(super) struct Known {
    pub(super) mode: Mode,
    pub(super) dies: Name,
}

impl Known {
    pub(super) fn name(&self) -> &str {
        self.mode.name.as_str()
    }
}

impl ModeTable {
    /// Makes a table ready. What is wrong in it counts for nothing: [`mistakes`](Self::mistakes) says what that is.
    pub fn new(written: &Table) -> ModeTable {
        ModeTable { rows: read(written).0, written: written.clone() }
    }

    /// All that is wrong with a table, with the places.
    pub fn mistakes(written: &Table) -> Vec<Mistake> {
        read(written).1
    }

    /// The rows of a table's modes that name agents, with their places.
    pub fn agents(written: &Table) -> impl Iterator<Item = &Row> {
        let modes = written.rows().iter().filter_map(|row| row.entry.value.as_table());
        modes.flat_map(Table::rows).filter(|row| !RESERVED.contains(&row.key.as_str()))
    }

    pub(super) fn find(&self, name: &str) -> Option<&Known> {
        self.rows.iter().find(|known| known.mode.name.as_str() == name)
    }

    /// The modes, in the order of the table.
    pub(super) fn known(&self) -> impl Iterator<Item = &Known> + Clone {
        self.rows.iter()
    }

    /// Their names, in the same order.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> + Clone {
        self.known().map(Known::name)
    }
}

impl Default for ModeTable {
    /// Only [`IDLE`].
    fn default() -> ModeTable {
        ModeTable::new(&Table::new())
    }
}

/// Tables are equal when they say the same.
impl PartialEq for ModeTable {
    fn eq(&self, other: &ModeTable) -> bool {
        self.written == other.written
    }
}

impl ParamValue for ModeTable {
    const KIND: &'static str = "a table of modes";

    fn from_value(value: &Value) -> Option<ModeTable> {
        value.as_table().map(ModeTable::new)
    }

    fn to_value(&self) -> Value {
        Value::Table(self.written.clone())
    }
}

/// Reads a table, with all that is wrong in it.
fn read(written: &Table) -> (Vec<Known>, Vec<Mistake>) {
    let mut mistakes = Vec::new();
    let mut rows: Vec<Known> = Vec::new();
    for row in written.rows() {
        let Some(table) = row.entry.value.as_table() else {
            let what = format!("the mode \"{}\" is {}, not a table", row.key, row.entry.value.kind());
            mistakes.push(Mistake::new(row.entry.at, what).help("as in { by = \"priority\", goto = 1.0 }"));
            continue;
        };
        if rows.len() == MOST_MODES {
            let what = format!("\"{}\" is one mode too many: {MOST_MODES} have room", row.key);
            mistakes.push(Mistake::new(row.key_at, what));
            break;
        }
        rows.push(mode(&row.key, row.key_at, table, &mut mistakes));
    }
    if rows.iter().all(|known| known.mode.name.as_str() != IDLE) {
        rows.push(Known { mode: Mode { name: IDLE.into(), ..Mode::default() }, dies: IDLE.into() });
    }
    for (known, row) in rows.iter().zip(written.rows()) {
        let said = row.entry.value.as_table().and_then(|table| table.get("dies"));
        let Some(entry) = said.filter(|_| rows.iter().all(|other| other.mode.name != known.dies)) else {
            continue;
        };
        let word = known.dies.as_str();
        mistakes.push(unknown("mode", word, entry.at, rows.iter().map(|known| known.mode.name.as_str())));
    }
    (rows, mistakes)
}

fn mode(name: &str, at: Span, table: &Table, mistakes: &mut Vec<Mistake>) -> Known {
    let mut out =
        Mode { name: short(name, at, mistakes), coordination: Coordination::Priority, ..Mode::default() };
    let mut dies = Name::new(IDLE);
    for Row { key, key_at, entry } in table.rows() {
        match key.as_str() {
            "by" => out.coordination = method(entry, mistakes).unwrap_or_default(),
            "dies" => dies = text("dies", entry, mistakes).unwrap_or(dies),
            _ => {
                let row = row(key, *key_at, entry, mistakes);
                if out.rows.push(row).is_err() {
                    let what = format!("\"{key}\" is one agent too many for a mode: {MOST_AGENTS} have room");
                    mistakes.push(Mistake::new(*key_at, what));
                }
            }
        }
    }
    Known { mode: out, dies }
}

/// What a mode gives one agent: a weight, or a table of weight and priority.
fn row(agent: &str, at: Span, entry: &Entry, mistakes: &mut Vec<Mistake>) -> ModeRow {
    let mut out = ModeRow { agent: short(agent, at, mistakes), weight: 1.0, priority: 0 };
    let weight = |entry: &Entry, mistakes: &mut Vec<Mistake>| {
        let number = entry.value.as_float().filter(|number| (0.0..=1.0).contains(number));
        if number.is_none() {
            let what = format!("the weight of \"{agent}\" is {}, not a number from 0 to 1", entry.value);
            mistakes.push(Mistake::new(entry.at, what));
        }
        number.unwrap_or(1.0)
    };
    let Some(settings) = entry.value.as_table() else {
        out.weight = weight(entry, mistakes);
        return out;
    };
    for Row { key, key_at, entry } in settings.rows() {
        match key.as_str() {
            "weight" => out.weight = weight(entry, mistakes),
            "priority" => match entry.value {
                Value::Int(n) if (0..=HIGHEST).contains(&n) => out.priority = n as u32,
                ref other => {
                    let what = format!("\"priority\" is {other}, not a whole number from 0 to {HIGHEST}");
                    mistakes.push(Mistake::new(entry.at, what));
                }
            },
            _ => mistakes.push(Mistake::unknown(*key_at, "setting of an agent", key, SETTINGS)),
        }
    }
    out
}

fn method(entry: &Entry, mistakes: &mut Vec<Mistake>) -> Option<Coordination> {
    let word = entry.value.as_text().unwrap_or_default();
    let found = Coordination::ALL.into_iter().find(|method| method.word() == word);
    if found.is_none() {
        let words = Coordination::ALL.map(Coordination::word);
        mistakes.push(unknown("way to coordinate", word, entry.at, words.into_iter()));
    }
    found
}

fn text(key: &str, entry: &Entry, mistakes: &mut Vec<Mistake>) -> Option<Name> {
    let text = entry.value.as_text();
    if text.is_none() {
        mistakes.push(Mistake::new(entry.at, format!("\"{key}\" is {}, not a name", entry.value.kind())));
    }
    text.map(|text| short(text, entry.at, mistakes))
}

fn short(name: &str, at: Span, mistakes: &mut Vec<Mistake>) -> Name {
    if name.is_empty() || name.len() > LONGEST {
        let what = format!("\"{name}\" is no name: it has 1 to {LONGEST} characters");
        mistakes.push(Mistake::new(at, what));
    }
    Name::new(name)
}

fn unknown<'a>(what: &str, word: &str, at: Span, known: impl Iterator<Item = &'a str> + Clone) -> Mistake {
    let mistake = Mistake::new(at, format!("there is no {what} \"{word}\""));
    match nearest(word, known.clone()) {
        Some(near) => mistake.help(format!("did you mean \"{near}\"?")),
        None => {
            let all: Vec<String> = known.map(|name| format!("\"{name}\"")).collect();
            mistake.help(format!("there are {}", all.join(", ")))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(rows: &[(&str, Value)]) -> Table {
        let mut table = Table::new();
        rows.iter().for_each(|(key, value)| table.set(key, value.clone()));
        table
    }

    fn nested(rows: &[(&str, Value)]) -> Value {
        Value::Table(table(rows))
    }

    #[test]
    fn a_mode_says_who_is_heard_and_idle_is_always_there() {
        let avoid = nested(&[("weight", Value::Float(0.5)), ("priority", Value::Int(2))]);
        let written = table(&[(
            "around",
            nested(&[
                ("by", Value::Text("subsumption".into())),
                ("avoid", avoid),
                ("goto", Value::Float(1.0)),
            ]),
        )]);
        assert!(ModeTable::mistakes(&written).is_empty());
        let modes = ModeTable::new(&written);
        assert_eq!(modes.names().collect::<Vec<_>>(), ["around", "idle"]);
        let known = modes.find("around").unwrap();
        assert_eq!((known.mode.coordination, known.dies.as_str()), (Coordination::Subsumption, IDLE));
        let row = |agent: &str| known.mode.row(agent).map(|row| (row.weight, row.priority));
        assert_eq!((row("avoid"), row("goto"), row("wall")), (Some((0.5, 2)), Some((1.0, 0)), None));
        assert!(modes.find(IDLE).unwrap().mode.rows.is_empty());
    }

    #[test]
    fn all_that_is_wrong_is_told_at_once() {
        let written = table(&[
            ("go", nested(&[("by", Value::Text("priorty".into())), ("goto", Value::Float(2.0))])),
            ("rest", nested(&[("dies", Value::Text("gone".into()))])),
            ("flat", Value::Int(3)),
            ("odd", nested(&[("goto", nested(&[("wieght", Value::Int(1)), ("priority", Value::Int(-1))]))])),
        ]);
        let told: Vec<String> =
            ModeTable::mistakes(&written).iter().map(|mistake| mistake.what.clone()).collect();
        let expected = [
            "there is no way to coordinate \"priorty\"",
            "the weight of \"goto\" is 2.0, not a number from 0 to 1",
            "the mode \"flat\" is a whole number, not a table",
            "there is no setting of an agent \"wieght\"",
            "\"priority\" is -1, not a whole number from 0 to 1000",
            "there is no mode \"gone\"",
        ];
        for words in expected {
            assert!(told.iter().any(|what| what.contains(words)), "{words}: {told:#?}");
        }
        assert_eq!(told.len(), expected.len(), "{told:#?}");
    }
}
