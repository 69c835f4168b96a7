//! `[wires]`: from each output to its inputs.

use runtime::{Overload, QueuePlan, WireFilter, WirePlan};
use types::value::{Entry, Mistake, Span, Table, TableReader, Value, nearest};
use types::{Category, Priority};

use super::read::{Reader, unknown};

/// An output and its inputs as they are written, to be judged when all agents are known.
pub(super) struct Written {
    prefix: String,
    from: String,
    from_at: Span,
    targets: Entry,
}

impl Reader<'_> {
    /// Takes the queues of a file; those inside a group get its prefix.
    pub(super) fn queues(&mut self, tree: &Table, prefix: &str) {
        for (name, at, table) in self.each(tree, "queue") {
            self.check_name(name, at);
            let mut r = TableReader::new(table, at, format!("queue \"{name}\""));
            let mut queue = QueuePlan { at, ..QueuePlan::new(format!("{prefix}{name}")) };
            queue.depth = whole(&mut r, "depth", 1, runtime::MOST_MESSAGES as i64).map(|n| n as usize);
            queue.overload = policy(&mut r);
            r.finish(&mut self.mistakes);
            self.plan.queues.push(queue);
        }
    }

    /// Takes the wires of a file; names inside a group get its prefix.
    pub(super) fn collect_wires(&mut self, tree: &Table, prefix: &str) {
        let Some(entry) = tree.get("wires") else { return };
        let Some(table) = entry.value.as_table() else {
            self.say(entry.at, format!("\"wires\" is {}, not a section", entry.value.kind()));
            return;
        };
        let mut rows = Vec::new();
        flatten(table, "", Span::default(), &mut rows);
        self.written.extend(rows.into_iter().map(|(name, from_at, targets)| Written {
            prefix: prefix.to_owned(),
            from: format!("{prefix}{name}"),
            from_at,
            targets,
        }));
    }

    /// Judges the wires and puts them into the plan.
    pub(super) fn settle_wires(&mut self) {
        for written in std::mem::take(&mut self.written) {
            let from = self.end(&written.from, written.from_at);
            let single = [written.targets.clone()];
            let targets = written.targets.value.as_list().unwrap_or(&single);
            for target in targets {
                self.wire(&written.prefix, from.as_deref(), target);
            }
        }
    }

    fn wire(&mut self, prefix: &str, from: Option<&str>, target: &Entry) {
        let mut wire = WirePlan { at: target.at, ..WirePlan::new(from.unwrap_or_default(), "") };
        let to = match &target.value {
            Value::Text(to) => Some((to.as_str(), target.at)),
            Value::Table(table) => self.details(prefix, table, target.at, &mut wire),
            other => {
                let what = format!("a wire leads to an input, not to {} ({other})", other.kind());
                self.mistakes.push(Mistake::new(target.at, what).help("write it as in \"safety.ranges\""));
                None
            }
        };
        let to = to.and_then(|(to, at)| self.end(&format!("{prefix}{to}"), at));
        let (Some(to), Some(_)) = (to, from) else {
            self.lost_wires = true;
            return;
        };
        wire.to = to;
        if self.plan.wires.iter().any(|other| other.from == wire.from && other.to == wire.to) {
            self.say(target.at, format!("there are two wires from {} to {}", wire.from, wire.to));
        }
        self.plan.wires.push(wire);
    }

    /// Reads `{ to = "e.f", depth = 8, … }` into the wire; gives the input's name.
    fn details<'t>(
        &mut self,
        prefix: &str,
        table: &'t Table,
        at: Span,
        wire: &mut WirePlan,
    ) -> Option<(&'t str, Span)> {
        let mut r = TableReader::new(table, at, "the wire");
        let to = r.required_text("to", "the input it leads to");
        let place = r.place("to");
        wire.depth = whole(&mut r, "depth", 1, runtime::MOST_MESSAGES as i64).map(|n| n as usize);
        wire.overload = policy(&mut r);
        wire.serving = whole(&mut r, "serving", 0, runtime::MOST_SERVING.into()).map(|n| n as u8);
        wire.filter = WireFilter {
            every: whole(&mut r, "every", 0, u32::MAX.into()).unwrap_or(0) as u32,
            marker: whole(&mut r, "marker", 0, u32::MAX.into()).map(|n| n as u32),
            category: word(
                &mut r,
                "category",
                "category",
                &Category::ALL.map(Category::name),
                Category::named,
            ),
            ..WireFilter::default()
        };
        if let Some(least) =
            word(&mut r, "priority", "priority", &Priority::ALL.map(Priority::name), Priority::named)
        {
            wire.filter.least_priority.0 = least;
        }
        let recipient = r.text("recipient").map(|name| (format!("{prefix}{name}"), r.place("recipient")));
        r.finish(&mut self.mistakes);
        wire.filter.recipient = recipient.and_then(|(name, at)| self.recipient(name, at));
        to.map(|to| (to, place))
    }

    /// The agent of this full name; none, and said why, when there is none.
    fn recipient(&mut self, name: String, at: Span) -> Option<String> {
        if self.plan.agent(&name).is_some() {
            return Some(name);
        }
        let mistake = if self.names.is_group(&name) {
            Mistake::new(at, format!("\"{name}\" is a group, and messages are for one agent"))
                .help(format!("name the agent in it, as in \"{name}.AGENT\""))
        } else {
            self.no_agent(&name, at)
        };
        self.mistakes.push(mistake);
        None
    }

    /// The full name of the port that `name` means; none, and said why, when there is none.
    pub(super) fn end(&mut self, name: &str, at: Span) -> Option<String> {
        let name = self.names.resolve(name);
        if self.plan.is_queue(name) {
            return Some(name.to_owned());
        }
        let Some((agent, port)) = name.rsplit_once('.') else {
            let what = format!("\"{name}\" is no port");
            self.mistakes.push(Mistake::new(at, what).help(self.no_port_help(name)));
            return None;
        };
        if self.names.is_group(agent) {
            let what = format!("group \"{agent}\" has no port \"{port}\"");
            let known: Vec<&str> = self.names.ports_of(agent).collect();
            let mistake = unknown(at, what, port, known.iter().copied());
            self.mistakes.push(mistake);
            return None;
        }
        let Some(known) = self.plan.agent(agent) else {
            let mistake = self.no_agent(agent, at);
            self.mistakes.push(mistake);
            return None;
        };
        // An unknown type has been said already.
        if let Some(kind) = self.registry.get(&known.kind)
            && kind.port(port).is_none()
        {
            let what = format!("agent \"{agent}\" has no port \"{port}\"");
            let mistake = unknown(at, what, port, kind.ports.iter().map(|port| port.name));
            self.mistakes.push(mistake);
            return None;
        }
        Some(name.to_owned())
    }

    /// What to write in the place of a name that is no port: the nearest queue, if there are any.
    fn no_port_help(&self, name: &str) -> String {
        let queues: Vec<&str> = self.plan.queues.iter().map(|queue| queue.name.as_str()).collect();
        match nearest(name, queues.iter().copied()) {
            Some(right) => format!("did you mean the queue \"{right}\"?"),
            None if queues.is_empty() => "write agent and port, as in \"sonar.filtered\"".to_owned(),
            None => format!("write agent and port, or a queue: {}", queues.join(", ")),
        }
    }

    /// There is no agent of this name.
    pub(super) fn no_agent(&self, name: &str, at: Span) -> Mistake {
        let agents = self.plan.agents.iter().map(|agent| agent.name.as_str());
        let robots = self.robots.rows().iter().map(|row| row.key.as_str());
        let robots = robots.filter(|robot| self.plan.agent(robot).is_none());
        let known: Vec<&str> = agents.chain(self.names.groups()).chain(robots).collect();
        let help = match nearest(name, known.iter().copied()) {
            Some(right) => format!("did you mean \"{right}\"?"),
            None => format!("write a section [agent.{name}], or name one of: {}", known.join(", ")),
        };
        Mistake::new(at, format!("there is no agent \"{name}\"")).help(help)
    }
}

/// The rows of the section. Names without quotes are tables in tables for TOML: they are joined again.
fn flatten(table: &Table, prefix: &str, prefix_at: Span, rows: &mut Vec<(String, Span, Entry)>) {
    for row in table.rows() {
        let name = if prefix.is_empty() { row.key.clone() } else { format!("{prefix}.{}", row.key) };
        let start = if prefix.is_empty() { row.key_at.start } else { prefix_at.start };
        let at = Span { start, end: row.key_at.end };
        match &row.entry.value {
            Value::Table(inner) if inner.get("to").is_none() => flatten(inner, &name, at, rows),
            _ => rows.push((name, at, row.entry.clone())),
        }
    }
}

fn policy(r: &mut TableReader<'_>) -> Option<Overload> {
    let policies = [Overload::NewestWins, Overload::OldestWins, Overload::Refuse].map(Overload::name);
    word(r, "overload", "overload policy", &policies, Overload::named)
}

fn whole(r: &mut TableReader<'_>, key: &str, least: i64, most: i64) -> Option<i64> {
    let n = r.int(key)?;
    if (least..=most).contains(&n) {
        return Some(n);
    }
    r.report(Mistake::new(r.place(key), format!("\"{key}\" is {n}, it must lie from {least} to {most}")));
    None
}

fn word<T>(
    r: &mut TableReader<'_>,
    key: &str,
    what: &str,
    known: &[&str],
    named: impl Fn(&str) -> Option<T>,
) -> Option<T> {
    let word = r.text(key)?;
    let value = named(word);
    if value.is_none() {
        r.report(Mistake::unknown(r.place(key), what, word, known.iter().copied()));
    }
    value
}
