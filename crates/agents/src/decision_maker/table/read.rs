//! A table as it is written becomes one for the steps; all mistakes at once, each with its place.

use types::Name;
use types::messages::{Activity, MOST_AGENTS, MOST_SITUATIONS, Order};
use types::value::{Entry, Mistake, Row, Span, Table, Value, nearest};

use super::super::condition::{Condition, Words, compile};
use super::super::situation::Situation;
use super::{DecisionTable, SETTINGS, SituationRow, When};

/// The priority of a situation of one's own where the table says none: below what must not wait, above what the robot does for itself.
const USUAL: i32 = 50;
const HIGHEST: i64 = 1000;
/// What a `Name` holds (bytes).
const LONGEST: usize = 23;

/// Reads a table, with all that is wrong in it.
pub(super) fn read(written: &Table, declared: Option<&[String]>) -> (DecisionTable, Vec<Mistake>) {
    let mut reader =
        Reader { words: Words::new(declared), rows: Vec::new(), agents: Vec::new(), mistakes: Vec::new() };
    written.rows().iter().for_each(|row| reader.row(row));
    reader.add_missing();
    reader.silence();
    reader.rows.sort_by_key(|row| core::cmp::Reverse(row.priority));
    let Reader { words, rows, agents, mistakes } = reader;
    let has_order =
        |agent: &Name| rows.iter().any(|row| row.orders.iter().any(|order| order.agent == *agent));
    let ordered = agents.iter().copied().filter(has_order).collect();
    let (told, needed) = words.into_used();
    (DecisionTable { written: written.clone(), rows, ordered, told, needed }, mistakes)
}

struct Reader<'r> {
    words: Words<'r>,
    rows: Vec<SituationRow>,
    /// All agents that are named.
    agents: Vec<Name>,
    mistakes: Vec<Mistake>,
}

impl Reader<'_> {
    fn say(&mut self, at: Span, what: impl Into<String>) {
        self.mistakes.push(Mistake::new(at, what));
    }

    fn row(&mut self, row: &Row) {
        let built_in = Situation::named(&row.key);
        let Some(table) = row.entry.value.as_table() else {
            if built_in.is_none() {
                self.mistakes.push(no_situation(row));
            }
            self.mistakes.push(
                Mistake::new(row.entry.at, format!("\"{}\" must be a table of weights", row.key))
                    .help("as in { safety = 1.0, wall = 0.0 }"),
            );
            return;
        };
        let when = self.when(row, table, built_in);
        let name = self.name(&row.key, row.key_at);
        let mut read = SituationRow {
            name,
            when: When::BuiltIn(Situation::Free),
            priority: built_in.map_or(USUAL, Situation::priority),
            goal: Name::EMPTY,
            weights: Vec::new(),
            orders: Vec::new(),
        };
        for entry in table.rows() {
            self.entry(entry, &mut read);
        }
        let Some(when) = when else { return };
        let own = self.rows.iter().filter(|row| matches!(row.when, When::Own { .. })).count();
        if built_in.is_none() && own == MOST_SITUATIONS - Situation::ALL.len() {
            let what = format!("\"{}\" is one situation too many: {own} of one's own have room", row.key);
            self.say(row.key_at, what);
            return;
        }
        self.rows.push(SituationRow { when, ..read });
    }

    /// When the situation of a row is active.
    fn when(&mut self, row: &Row, table: &Table, built_in: Option<Situation>) -> Option<When> {
        let (when, until) = (table.get("when"), table.get("until"));
        if let Some(built_in) = built_in {
            for (key, entry) in [("when", when), ("until", until)] {
                if let Some(entry) = entry {
                    let what = format!("\"{}\" is recognised by itself, it takes no \"{key}\"", row.key);
                    self.say(entry.at, what);
                }
            }
            return Some(When::BuiltIn(built_in));
        }
        if when.is_none() {
            self.mistakes.push(no_situation(row));
        }
        let until_is_given = until.is_some();
        let (when, until) = (
            when.and_then(|entry| self.condition("when", entry)),
            until.and_then(|entry| self.condition("until", entry)),
        );
        if until_is_given && until.is_none() {
            return None;
        }
        Some(When::Own { when: when?, until })
    }

    fn condition(&mut self, key: &str, entry: &Entry) -> Option<Condition> {
        let Some(text) = entry.value.as_text() else {
            self.mistakes.push(
                Mistake::new(entry.at, format!("\"{key}\" is {}, not a condition", entry.value.kind()))
                    .help(format!("as in {key} = \"battery < 0.2\"")),
            );
            return None;
        };
        let found = compile(text, &mut self.words);
        found
            .map_err(|wrong| {
                self.mistakes.extend(wrong.into_iter().map(|wrong| placed(wrong, text, entry.at)))
            })
            .ok()
    }

    /// One key of a row.
    fn entry(&mut self, row: &Row, out: &mut SituationRow) {
        let Row { key, key_at, entry } = row;
        match key.as_str() {
            "when" | "until" => {}
            "priority" => match entry.value {
                Value::Int(n) if (0..=HIGHEST).contains(&n) => out.priority = n as i32,
                ref other => {
                    self.say(
                        entry.at,
                        format!("\"priority\" is {other}, not a whole number from 0 to {HIGHEST}"),
                    );
                }
            },
            "goal" => out.goal = self.word("goal", entry),
            _ => {
                let agent = self.name(key, *key_at);
                self.note_agent(agent, *key_at);
                match &entry.value {
                    Value::Table(settings) => self.settings(agent, settings, out),
                    _ => out.weights.extend(self.weight(key, entry).map(|weight| (agent, weight))),
                }
            }
        }
    }

    fn weight(&mut self, agent: &str, entry: &Entry) -> Option<f64> {
        let what = format!("the weight of \"{agent}\"");
        self.number(&what, entry, "from 0 to 1", |weight| (0.0..=1.0).contains(&weight))
    }

    fn number(
        &mut self,
        what: &str,
        entry: &Entry,
        range: &str,
        is_within: impl Fn(f64) -> bool,
    ) -> Option<f64> {
        let number = entry.value.as_float().filter(|number| is_within(*number));
        if number.is_none() {
            self.say(entry.at, format!("{what} is {}, not a number {range}", entry.value));
        }
        number
    }

    /// What a row says of one agent.
    fn settings(&mut self, agent: Name, settings: &Table, out: &mut SituationRow) {
        let mut order = Order::of(agent);
        let within = |number: f64| (0.0..=1.0).contains(&number);
        for Row { key, key_at, entry } in settings.rows() {
            let what = format!("the {key} of \"{agent}\"");
            match key.as_str() {
                "weight" => {
                    out.weights.extend(self.weight(agent.as_str(), entry).map(|weight| (agent, weight)))
                }
                "importance" => {
                    order.importance =
                        self.number(&what, entry, "from 0 to 1", within).unwrap_or(Order::UNSAID);
                }
                "rate" => {
                    let rate = self.number(&what, entry, "above 0, to 1", |rate| rate > 0.0 && rate <= 1.0);
                    order.rate = rate.unwrap_or(Order::UNSAID);
                }
                "active" => match entry.value {
                    Value::Bool(true) => order.activity = Activity::Active,
                    Value::Bool(false) => order.activity = Activity::Inactive,
                    ref other => self.say(entry.at, format!("\"active\" is {other}, not true or false")),
                },
                "method" => order.method = self.word("method", entry),
                _ => self.mistakes.push(Mistake::unknown(*key_at, "setting of an agent", key, SETTINGS)),
            }
        }
        if order != Order::of(agent) {
            out.orders.push(order);
        }
    }

    /// A word that is handed on.
    fn word(&mut self, key: &str, entry: &Entry) -> Name {
        match entry.value.as_text() {
            Some("") => self.say(entry.at, format!("\"{key}\" is empty")),
            Some(word) => return self.name(word, entry.at),
            None => self.say(entry.at, format!("\"{key}\" is {}, not a text", entry.value)),
        }
        Name::EMPTY
    }

    fn name(&mut self, word: &str, at: Span) -> Name {
        if word.len() > LONGEST {
            self.say(at, format!("the name \"{word}\" is longer than {LONGEST} letters"));
        }
        Name::new(word)
    }

    fn note_agent(&mut self, agent: Name, at: Span) {
        if self.agents.contains(&agent) {
            return;
        }
        if self.agents.len() == MOST_AGENTS {
            self.say(at, format!("\"{agent}\" is one agent too many: a table has room for {MOST_AGENTS}"));
        }
        self.agents.push(agent);
    }

    /// Situations that are built in are recognised also where the table has no row for them.
    fn add_missing(&mut self) {
        for situation in Situation::ALL {
            if !self
                .rows
                .iter()
                .any(|row| matches!(row.when, When::BuiltIn(built_in) if built_in == situation))
            {
                self.rows.push(SituationRow {
                    name: situation.name().into(),
                    when: When::BuiltIn(situation),
                    priority: situation.priority(),
                    goal: Name::EMPTY,
                    weights: Vec::new(),
                    orders: Vec::new(),
                });
            }
        }
    }

    /// Where the table forgot danger, nobody moves in it.
    fn silence(&mut self) {
        let rows = &self.rows;
        let weighed =
            |agent: &&Name| rows.iter().any(|row| row.weights.iter().any(|(known, _)| known == *agent));
        let nobody: Vec<(Name, f64)> =
            self.agents.iter().filter(weighed).map(|agent| (*agent, 0.0)).collect();
        for row in self.rows.iter_mut().filter(|row| row.weights.is_empty()) {
            if matches!(row.when, When::BuiltIn(situation) if situation.silences()) {
                row.weights.clone_from(&nobody);
            }
        }
    }
}

fn no_situation(row: &Row) -> Mistake {
    let mistake = Mistake::new(row.key_at, format!("there is no situation \"{}\"", row.key));
    match nearest(&row.key, Situation::ALL.map(Situation::name)) {
        Some(right) => mistake.help(format!("did you mean \"{right}\"?")),
        None => {
            mistake.help("one of your own needs a condition, as in { when = \"battery < 0.2\", wall = 0.0 }")
        }
    }
}

/// The mistake with its place in the file, where the text stands there letter by letter.
fn placed(mistake: Mistake, text: &str, at: Span) -> Mistake {
    let quotes = (at.end - at.start).checked_sub(text.len() as u32);
    let at = match quotes {
        // None, one before and behind, or three.
        Some(quotes @ (0 | 2 | 6)) => {
            let start = at.start + quotes / 2;
            Span { start: start + mistake.at.start, end: start + mistake.at.end }
        }
        _ => at,
    };
    Mistake { at, ..mistake }
}
