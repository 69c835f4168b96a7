//! `[[at]]`: what is asked of the running system at certain times.

use runtime::{FaultKind, TimedRequest};
use types::value::{Mistake, Span, Table, TableReader};

use super::calls;
use super::read::{Reader, span_of_time};

/// The commands that change a running system.
const VERBS: [&str; 13] = [
    "add", "remove", "restart", "replace", "wire", "unwire", "set", "stop", "reset", "quit", "fault", "send",
    "call",
];

impl Reader<'_> {
    pub(super) fn requests(&mut self, tree: &Table) {
        if let Some(entry) = tree.get("at")
            && entry.value.as_list().is_none()
        {
            let what = format!("\"at\" is {}, not a list", entry.value.kind());
            self.mistakes.push(
                Mistake::new(entry.at, what).help("write [[at]] with two brackets, once for each request"),
            );
            return;
        }
        let mut outer = TableReader::new(tree, Span::default(), "the file");
        for (table, place) in outer.tables("at") {
            let mut r = TableReader::new(table, place, "[[at]]");
            if r.entry("time").is_none() {
                r.missing("time", "as in time = \"30s\"");
            }
            let time = span_of_time(&mut r, "time");
            if r.entry("do").is_none() {
                r.missing("do", "as in do = \"fault wall panic\"");
            }
            let at = r.place("do");
            let words: Vec<String> = match r.texts("do").unwrap_or_default().as_slice() {
                [(text, _)] => text.split_whitespace().map(str::to_owned).collect(),
                several => several.iter().map(|(word, _)| (*word).to_owned()).collect(),
            };
            r.finish(&mut self.mistakes);
            self.judge(&words, at);
            if let Some(time) = time {
                self.plan.requests.push(TimedRequest { at: time, words, place });
            }
        }
        tree.rows().iter().for_each(|row| outer.allow(&row.key));
        outer.finish(&mut self.mistakes);
    }

    /// What can be seen of a request before the system runs.
    fn judge(&mut self, words: &[String], at: Span) {
        let Some((verb, rest)) = words.split_first() else { return };
        if !VERBS.contains(&verb.as_str()) {
            self.mistakes.push(Mistake::unknown(at, "request", verb, VERBS));
            return;
        }
        if calls::VERBS.contains(&verb.as_str())
            && let Err(refusal) = calls::in_bytes(words, &self.plan, self.registry)
        {
            let mistake = Mistake::new(at, refusal.what);
            self.mistakes.push(match refusal.help {
                Some(help) => mistake.help(help),
                None => mistake,
            });
        }
        if verb != "fault" {
            return;
        }
        let [target, kind] = rest else {
            let what = "a fault has a target and a kind";
            self.mistakes
                .push(Mistake::new(at, what).help("as in \"fault wall panic\", or \"fault h1.sonar off\""));
            return;
        };
        let names_agent = self.plan.agent(target).is_some() || self.robots.get(target).is_some();
        if !names_agent {
            match target.rsplit_once('.') {
                Some((robot, _)) if self.robots.get(robot).is_some() && self.plan.agent(robot).is_none() => {}
                Some(_) => drop(self.end(target, at)),
                None => {
                    let mistake = self.no_agent(target, at);
                    self.mistakes.push(mistake);
                }
            }
        }
        if FaultKind::named(kind).is_none() {
            self.mistakes.push(Mistake::unknown(at, "fault", kind, FaultKind::ALL.map(FaultKind::name)));
        }
    }
}
