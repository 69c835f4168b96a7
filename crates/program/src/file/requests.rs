//! `[[at]]`: what is asked of the running system at certain times, and what can be seen of it before.

use std::collections::BTreeSet;

use control::words::AND;
use runtime::{AgentPlan, FaultKind, Plan, Refusal, Request, TimedRequest, WirePlan, owner};
use types::Duration;
use types::value::{Mistake, Span, Table, TableReader, Value};

use super::calls;
use super::read::{Reader, span_of_time};
use crate::run::WORLD_AGENT;

/// The commands that change a running system.
const VERBS: [&str; 13] = [
    "add", "remove", "restart", "replace", "wire", "unwire", "set", "stop", "reset", "quit", "fault", "send",
    "call",
];

/// Those that robots take, and no router.
const ROBOT_VERBS: [&str; 2] = ["stop", "reset"];

/// A request as it is written.
struct Asked {
    time: Option<Duration>,
    words: Vec<String>,
    at: Span,
}

/// What there is when a request is made, as far as earlier ones can be foreseen.
struct Foreseen {
    /// Agents as they were set.
    agents: Vec<AgentPlan>,
    /// Agents and queues that came, went or became others: of these nothing is known.
    open: BTreeSet<String>,
}

impl Foreseen {
    fn is_open(&self, name: &str) -> bool {
        // In a simulated world this agent comes by itself.
        name == WORLD_AGENT || self.open.contains(name)
    }
}

fn of_refusal(at: Span, refusal: Refusal) -> Mistake {
    Mistake { at, what: refusal.what, help: refusal.help }
}

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
        let mut asked = Vec::new();
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
            asked.push(Asked { time, words: words.clone(), at });
            if let Some(time) = time {
                self.plan.requests.push(TimedRequest { at: time, words, place });
            }
        }
        tree.rows().iter().for_each(|row| outer.allow(&row.key));
        outer.finish(&mut self.mistakes);
        self.foresee(asked);
    }

    /// Judges the requests in the order in which they will be made.
    fn foresee(&mut self, mut asked: Vec<Asked>) {
        asked.sort_by_key(|asked| asked.time.unwrap_or(Duration(i64::MAX)));
        let mut foreseen = Foreseen { agents: self.plan.agents.clone(), open: BTreeSet::new() };
        for Asked { words, at, .. } in asked {
            self.judge(&words, at, &mut foreseen);
        }
    }

    /// What can be seen of a request before the system runs.
    fn judge(&mut self, words: &[String], at: Span, foreseen: &mut Foreseen) {
        let Some(verb) = words.first() else { return };
        if !VERBS.contains(&verb.as_str()) {
            self.mistakes.push(Mistake::unknown(at, "request", verb, VERBS));
        } else if calls::VERBS.contains(&verb.as_str()) {
            let is_open = words.get(1).is_some_and(|port| foreseen.open.contains(owner(port)));
            if let Err(refusal) = calls::in_bytes(words, &self.plan, self.registry)
                && !is_open
            {
                self.mistakes.push(of_refusal(at, refusal));
            }
        } else if verb == "fault" && !words.iter().any(|word| word == AND) {
            self.judge_fault(&words[1..], at, foreseen);
        } else if !ROBOT_VERBS.contains(&verb.as_str()) {
            match control::words::parse(words) {
                Ok(request) => self.judge_request(request, at, foreseen),
                Err(refusal) => self.mistakes.push(of_refusal(at, refusal)),
            }
        }
    }

    fn judge_fault(&mut self, words: &[String], at: Span, foreseen: &Foreseen) {
        let [target, kind] = words else {
            let what = "a fault has a target and a kind";
            self.mistakes
                .push(Mistake::new(at, what).help("as in \"fault wall panic\", or \"fault h1.sonar off\""));
            return;
        };
        self.judge_target(target, at, foreseen);
        if FaultKind::named(kind).is_none() {
            self.mistakes.push(Mistake::unknown(at, "fault", kind, FaultKind::ALL.map(FaultKind::name)));
        }
    }

    /// An agent, or an output of one.
    fn judge_target(&mut self, target: &str, at: Span, foreseen: &Foreseen) {
        let names_agent = self.plan.agent(target).is_some() || self.robots.get(target).is_some();
        if names_agent || foreseen.is_open(target) || foreseen.is_open(owner(target)) {
            return;
        }
        match target.rsplit_once('.') {
            Some((robot, _)) if self.robots.get(robot).is_some() && self.plan.agent(robot).is_none() => {}
            Some(_) => drop(self.end(target, at)),
            None => {
                let mistake = self.no_agent(target, at);
                self.mistakes.push(mistake);
            }
        }
    }

    fn judge_request(&mut self, request: Request, at: Span, foreseen: &mut Foreseen) {
        match request {
            Request::All(requests) => {
                requests.into_iter().for_each(|request| self.judge_request(request, at, foreseen));
            }
            Request::Forced(request) => self.judge_request(*request, at, foreseen),
            Request::Set { agent, key, value } => self.judge_set(&agent, &key, &value, at, foreseen),
            Request::Add(agent) => self.judge_add(agent, at, foreseen),
            Request::Queue(queue) => {
                foreseen.open.insert(queue.name.clone());
                self.judge_part(&Plan { queues: vec![queue], ..Plan::default() }, at);
            }
            Request::Remove(name) => {
                self.judge_name(&name, at, foreseen);
                foreseen.open.insert(name);
            }
            Request::Restart(name) => {
                self.judge_name(&name, at, foreseen);
            }
            Request::Replace { agent, kind, params } => {
                self.judge_name(&agent, at, foreseen);
                match self.registry.get(&kind) {
                    Some(kind) => {
                        let wrong = kind.check_params(&params);
                        self.mistakes.extend(wrong.into_iter().map(|mistake| Mistake { at, ..mistake }));
                    }
                    None => {
                        let known = self.registry.types().iter().map(|kind| kind.kind);
                        self.mistakes.push(Mistake::unknown(at, "type of agent", &kind, known));
                    }
                }
                foreseen.open.insert(agent);
            }
            Request::Wire(wire) => self.judge_wire(wire, at, foreseen),
            Request::Unwire { from, to } => self.judge_wire(WirePlan::new(from, to), at, foreseen),
            Request::Fault { target, .. } => self.judge_target(&target, at, foreseen),
            Request::Send { .. } | Request::Call { .. } | Request::Quit => {}
        }
    }

    fn judge_set(&mut self, name: &str, key: &str, value: &Value, at: Span, foreseen: &mut Foreseen) {
        if !self.judge_name(name, at, foreseen) {
            return;
        }
        let Some(agent) = foreseen.agents.iter_mut().find(|agent| agent.name == name) else { return };
        let Some(kind) = self.registry.get(&agent.kind) else { return };
        match runtime::with_set(agent, kind, key, value) {
            Ok(set) => *agent = set,
            Err(refusal) => self.mistakes.push(of_refusal(at, refusal)),
        }
    }

    /// Whether it is known what has this name now. Says so where nothing has.
    fn judge_name(&mut self, name: &str, at: Span, foreseen: &Foreseen) -> bool {
        if foreseen.is_open(name) {
            return false;
        }
        let is_there = self.plan.agent(name).is_some() || self.plan.is_queue(name);
        if !is_there && self.robots.get(name).is_none() {
            let mistake = self.no_agent(name, at);
            self.mistakes.push(mistake);
        }
        is_there
    }

    fn judge_add(&mut self, agent: AgentPlan, at: Span, foreseen: &mut Foreseen) {
        let name = agent.name.clone();
        let taken = self.plan.agent(&name).is_some() || self.plan.is_queue(&name);
        if taken && !foreseen.is_open(&name) {
            let what = format!("there is already something called \"{name}\"");
            self.mistakes.push(Mistake::new(at, what).help("names are given once"));
        }
        if let Some(robot) = agent.robot.as_ref().filter(|robot| self.robots.get(robot).is_none()) {
            let known = self.robots.rows().iter().map(|row| row.key.as_str());
            self.mistakes.push(Mistake::unknown(at, "robot", robot, known));
        }
        let executors = self.plan.executors.clone();
        self.judge_part(&Plan { agents: vec![agent], executors, ..Plan::default() }, at);
        foreseen.open.insert(name);
    }

    fn judge_wire(&mut self, wire: WirePlan, at: Span, foreseen: &Foreseen) {
        for end in [&wire.from, &wire.to] {
            let is_bare_robot =
                self.robots.get(owner(end)).is_some() && self.plan.agent(owner(end)).is_none();
            if is_bare_robot || foreseen.is_open(owner(end)) {
                return;
            }
        }
        if wire.filter.recipient.as_ref().is_some_and(|name| foreseen.is_open(name)) {
            return;
        }
        let (agents, queues) = (self.plan.agents.clone(), self.plan.queues.clone());
        self.judge_part(&Plan { agents, queues, wires: vec![wire], ..Plan::default() }, at);
    }

    /// Judges a part of a plan of which only what the request says has no place of its own.
    fn judge_part(&mut self, part: &Plan, at: Span) {
        let wrong = runtime::check(part, self.registry).into_iter();
        let wrong = wrong.filter(|mistake| mistake.at == Span::default());
        self.mistakes.extend(wrong.map(|mistake| Mistake { at, ..mistake }));
    }
}
