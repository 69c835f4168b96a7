//! The one place that turns mistakes into text for people, or into JSON for programs.

use std::fmt::Write as _;
use std::io::{self, IsTerminal as _, Write as _};
use std::process::ExitCode;

use runtime::Refusal;
use serde_json::{Map, Value as Json, json};
use types::value::Mistake;

use crate::file::{Mistakes, Sources};

/// Something wrong, with its place if it has one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// What is wrong, as a sentence without the place.
    pub what: String,
    /// How to mend it.
    pub help: Option<String>,
    /// Where it is wrong.
    pub place: Option<Place>,
}

/// A place in a file, as people count.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The file.
    pub file: String,
    /// The line, from 1.
    pub line: usize,
    /// The column in characters, from 1.
    pub column: usize,
    /// The line's text.
    pub text: String,
    /// How many characters of the line are meant.
    pub width: usize,
}

/// Why a command could not do its work: what is wrong, and the exit code that says so.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// What is wrong; at least one.
    pub problems: Vec<Problem>,
    /// The exit code: 1 when a goal was not met or a check failed, 2 for wrong usage or a bad file.
    pub code: u8,
}

impl Problem {
    /// Something wrong at no place of a file.
    pub fn new(what: impl Into<String>) -> Problem {
        Problem { what: what.into(), help: None, place: None }
    }

    /// A mistake with its place looked up.
    pub fn of(mistake: &Mistake, sources: &Sources) -> Problem {
        let place = sources.place(mistake.at);
        Problem { what: mistake.what.clone(), help: mistake.help.clone(), place }
    }

    /// The shape `{"what","file","line","column","help"}`; what is not known is `null`.
    pub fn to_json(&self) -> Json {
        let place = self.place.as_ref();
        json!({
            "what": self.what,
            "file": place.map(|place| &place.file),
            "line": place.map(|place| place.line),
            "column": place.map(|place| place.column),
            "help": self.help,
        })
    }

    /// What people read: the sentence, the place with its line, a mark under the word, the advice.
    pub fn to_text(&self, paint: Paint) -> String {
        let mut out = String::new();
        paint.write(&mut out, "1;31", "error");
        paint.write(&mut out, "1", &format!(": {}\n", self.what));
        let mut margin = 1;
        if let Some(place) = &self.place {
            let number = place.line.to_string();
            margin = number.len() + 1;
            let bar = |out: &mut String, number: &str| {
                paint.write(out, "1;34", &format!("{number:<margin$}|"));
            };
            let pad = " ".repeat(margin - 1);
            paint.write(&mut out, "1;34", &format!("{pad}-->"));
            let _ = writeln!(out, " {}:{}:{}", place.file, place.line, place.column);
            bar(&mut out, &number);
            let _ = writeln!(out, " {}", place.text);
            bar(&mut out, "");
            // A tab before the word stays a tab, so that the mark stands under it whatever a tab is wide.
            let before = place.text.chars().take(place.column - 1);
            let lead: String = before.map(|c| if c == '\t' { '\t' } else { ' ' }).collect();
            let _ = write!(out, " {lead}");
            paint.write(&mut out, "1;31", &"^".repeat(place.width.max(1)));
            out.push('\n');
        }
        if let Some(help) = &self.help {
            let pad = " ".repeat(margin);
            paint.write(&mut out, "1;34", &format!("{pad}= "));
            let _ = writeln!(out, "help: {help}");
        }
        out
    }
}

impl From<Refusal> for Problem {
    fn from(refusal: Refusal) -> Problem {
        Problem { what: refusal.what, help: refusal.help, place: None }
    }
}

impl Failure {
    /// Wrong usage or a bad file: exit code 2.
    pub fn new(what: impl Into<String>) -> Failure {
        Failure { problems: vec![Problem::new(what)], code: 2 }
    }

    /// The same with advice.
    pub fn help(mut self, help: impl Into<String>) -> Failure {
        if let Some(last) = self.problems.last_mut() {
            last.help = Some(help.into());
        }
        self
    }

    /// The same with another exit code.
    pub fn code(mut self, code: u8) -> Failure {
        self.code = code;
        self
    }

    /// `word` is none of `known`.
    pub fn unknown<'a>(kind: &str, word: &str, known: impl IntoIterator<Item = &'a str>) -> Failure {
        Refusal::unknown(kind, word, known).into()
    }

    /// `{"error":{…}}` for one problem, `{"errors":[…]}` for several.
    pub fn to_json(&self) -> Json {
        let mut problems: Vec<Json> = self.problems.iter().map(Problem::to_json).collect();
        let mut document = Map::new();
        if problems.len() == 1 {
            document.insert("error".to_owned(), problems.swap_remove(0));
        } else {
            document.insert("errors".to_owned(), Json::Array(problems));
        }
        Json::Object(document)
    }

    /// What people read: every problem, and how many there were when they were several.
    pub fn to_text(&self, paint: Paint) -> String {
        let mut out: Vec<String> = self.problems.iter().map(|problem| problem.to_text(paint)).collect();
        if self.problems.len() > 1 {
            out.push(format!("{} errors\n", self.problems.len()));
        }
        out.join("\n")
    }

    /// Prints the failure, to standard error for people, or to standard output as one JSON document, and gives the exit code.
    pub fn print(&self, as_json: bool) -> ExitCode {
        // Nobody is left to be told when the streams are closed.
        let _ = if as_json {
            writeln!(io::stdout().lock(), "{}", self.to_json())
        } else {
            io::stderr().lock().write_all(self.to_text(Paint::for_stderr()).as_bytes())
        };
        ExitCode::from(self.code)
    }
}

impl From<Refusal> for Failure {
    fn from(refusal: Refusal) -> Failure {
        Failure { problems: vec![refusal.into()], code: 2 }
    }
}

impl From<Mistakes> for Failure {
    fn from(mistakes: Mistakes) -> Failure {
        let problems = mistakes.list.iter().map(|mistake| Problem::of(mistake, &mistakes.sources));
        Failure { problems: problems.collect(), code: 2 }
    }
}

/// Whether text is coloured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Paint {
    /// For files, pipes and tests.
    Plain,
    /// For a terminal.
    Coloured,
}

impl Paint {
    /// Colours for a terminal, unless `NO_COLOR` says otherwise or the terminal is a dumb one.
    pub fn for_stderr() -> Paint {
        let refused = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty())
            || std::env::var_os("TERM").is_some_and(|value| value == "dumb");
        if io::stderr().is_terminal() && !refused { Paint::Coloured } else { Paint::Plain }
    }

    fn write(self, out: &mut String, code: &str, text: &str) {
        let _ = match self {
            Paint::Plain => write!(out, "{text}"),
            Paint::Coloured => write!(out, "\u{1b}[{code}m{text}\u{1b}[0m"),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use types::value::Span;

    fn failure() -> Failure {
        let mut sources = Sources::default();
        sources.add("first.toml", "name = \"ä\"\n\tis = \"sonr\"\n");
        let at = sources.text_span("sonr");
        let mistake = Mistake::new(at, "there is no type of agent \"sonr\"").help("did you mean \"sonar\"?");
        let list = vec![mistake, Mistake::new(Span::default(), "nothing runs")];
        Mistakes { sources, list }.into()
    }

    #[test]
    fn people_see_the_line_the_word_and_the_advice() {
        let wanted = "\
error: there is no type of agent \"sonr\"
 --> first.toml:2:8
2 | \tis = \"sonr\"
  | \t      ^^^^
  = help: did you mean \"sonar\"?

error: nothing runs

2 errors
";
        assert_eq!(failure().to_text(Paint::Plain), wanted);
        assert!(failure().to_text(Paint::Coloured).contains("\u{1b}[1;31m^^^^\u{1b}[0m"));
    }

    #[test]
    fn programs_see_the_documented_shape() {
        let json = failure().to_json();
        assert_eq!(json["errors"][0]["line"], 2);
        assert_eq!(json["errors"][0]["column"], 8);
        assert_eq!(json["errors"][1]["file"], Json::Null);
        let one = Failure::new("no").help("yes").to_json();
        assert_eq!(
            one,
            json!({"error": {"what": "no", "file": null, "line": null, "column": null, "help": "yes"}})
        );
    }
}
