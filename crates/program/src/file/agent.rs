//! `[agent.NAME]`: an agent of a registered type, or a group of agents from another file.

use std::path::Path;

use runtime::{AgentPlan, AgentType, ExecutorPlan, OnDeath, executors_of};
use types::Duration;
use types::value::{Mistake, Span, Table, TableReader};

use super::read::{ROBOT, Reader, span_of_time, unknown};

/// The entries that every agent can have; all others are its parameters.
const ENTRIES: [&str; 24] = [
    "is",
    "robot",
    "period",
    "period_min",
    "period_max",
    "cost",
    "deadline",
    "on",
    "min_gap",
    "wake_gap",
    "executor",
    "on_death",
    "hang_after",
    "use",
    "methods",
    "method",
    "refinement",
    "budget",
    "importance",
    "elasticity",
    "gap_max",
    "may_suspend",
    "rigid",
    "suspended",
];

/// An executor's name that can be judged only when all executors are known.
pub(super) struct Pending {
    agent_at: Span,
    executor: String,
    at: Span,
}

impl Reader<'_> {
    /// Reads the agents of a file. Those of a group get its name as a prefix, and its robot.
    pub(super) fn agents(
        &mut self,
        tree: &Table,
        prefix: &str,
        folder: &Path,
        robot: Option<&str>,
        chain: &mut Vec<String>,
    ) {
        for (name, at, table) in self.each(tree, "agent") {
            let name = format!("{prefix}{name}");
            self.check_name(&name, at);
            if self.robots.get(&name).is_some() {
                self.say(at, format!("\"{name}\" is the name of a robot already"));
            }
            if table.get("use").is_some() {
                self.group(&name, at, table, folder, robot, chain);
            } else {
                self.agent(name, at, table, robot);
            }
        }
    }

    fn agent(&mut self, name: String, at: Span, table: &Table, group_robot: Option<&str>) {
        let before = self.mistakes.len();
        let mut r = TableReader::new(table, at, format!("agent \"{name}\""));
        let mut agent = AgentPlan { name, at, ..AgentPlan::default() };
        agent.kind = r
            .required_text("is", "the type of the agent, as in is = \"sonar\"")
            .unwrap_or_default()
            .to_owned();
        let kind = self.registry.get(&agent.kind);
        if kind.is_none() && !agent.kind.is_empty() {
            let known = self.registry.types().iter().map(|kind| kind.kind).filter(|kind| *kind != ROBOT);
            r.report(Mistake::unknown(r.place("is"), "type of agent", &agent.kind, known));
        }
        agent.robot = robot_of(&mut r, &self.robots, group_robot);
        timing(&mut r, &mut agent);
        means(&mut r, &mut agent);
        inputs(&mut r, &mut agent, kind);
        if let Some(executor) = r.text("executor") {
            agent.executor = Some(executor.to_owned());
            let at = r.place("executor");
            self.pending.push(Pending { agent_at: agent.at, executor: executor.to_owned(), at });
        }
        on_death(&mut r, &mut agent);
        parameters(&mut r, &mut agent, table, kind);
        r.finish(&mut self.mistakes);
        if self.mistakes.len() > before {
            self.spoiled.push(at);
        }
        if let Some(other) = self.plan.agents.iter().find(|other| other.name == agent.name)
            && !self.robots.rows().iter().any(|robot| robot.key == other.name)
        {
            let what = format!("there are two agents \"{}\"", agent.name);
            self.mistakes.push(Mistake::new(at, what).help("one comes from a group"));
            self.spoiled.push(at);
        }
        self.plan.agents.push(agent);
    }

    /// Judges the executors that agents named, when all files are read.
    pub(super) fn settle_executors(&mut self) {
        let known: Vec<ExecutorPlan> = executors_of(&self.plan);
        for pending in std::mem::take(&mut self.pending) {
            if !known.iter().any(|executor| executor.name == pending.executor) {
                let names = known.iter().map(|executor| executor.name.as_str());
                self.mistakes.push(Mistake::unknown(pending.at, "executor", &pending.executor, names));
                self.spoiled.push(pending.agent_at);
            }
        }
    }
}

fn robot_of(r: &mut TableReader<'_>, robots: &Table, group_robot: Option<&str>) -> Option<String> {
    let named = r.text("robot")?;
    if let Some(group_robot) = group_robot {
        return Some(group_robot.to_owned());
    }
    if robots.get(named).is_none() {
        let known = robots.rows().iter().map(|row| row.key.as_str());
        let mistake = Mistake::unknown(r.place("robot"), "robot", named, known);
        r.report(match robots.is_empty() {
            true => mistake.help(format!("write a section [robot.{named}] with its driver")),
            false => mistake,
        });
    }
    Some(named.to_owned())
}

fn timing(r: &mut TableReader<'_>, agent: &mut AgentPlan) {
    agent.period = span_of_time(r, "period");
    agent.cost = span_of_time(r, "cost");
    agent.deadline = span_of_time(r, "deadline");
    agent.min_gap = span_of_time(r, "min_gap").unwrap_or(Duration::ZERO);
    agent.wake_gap = span_of_time(r, "wake_gap").unwrap_or(Duration::ZERO);
    agent.hang_after = span_of_time(r, "hang_after");
    let stands_still = agent.period.is_some_and(|period| period <= Duration::ZERO);
    for (key, span) in [("period", agent.period), ("deadline", agent.deadline)] {
        if span.is_some_and(|span| span <= Duration::ZERO) {
            let what = format!("the {key} must be longer than zero");
            r.report(Mistake::new(r.place(key), what).help(format!("as in {key} = \"100ms\"")));
        }
    }
    if let (Some(period), Some(deadline)) = (agent.period, agent.deadline)
        && deadline > period
        && !stands_still
    {
        let what = format!("the deadline {deadline} is longer than the period {period}");
        r.report(
            Mistake::new(r.place("deadline"), what).help("a step must be done before the next one begins"),
        );
    }
    let (least, most) = (span_of_time(r, "period_min"), span_of_time(r, "period_max"));
    if least.is_none() && most.is_none() {
        return;
    }
    let (Some(least), Some(most)) = (least.or(agent.period), most.or(agent.period)) else {
        let key = if least.is_some() { "period_min" } else { "period_max" };
        r.report(
            Mistake::new(r.place(key), format!("\"{key}\" needs a period"))
                .help("write period = \"100ms\", say"),
        );
        return;
    };
    let period = agent.period.unwrap_or(least);
    if stands_still {
        // What its period lies between follows from the period.
    } else if least <= Duration::ZERO || least > period || period > most {
        let key = if least > Duration::ZERO && least <= period { "period_max" } else { "period_min" };
        let what = format!("the period {period} does not lie from {least} to {most}");
        r.report(Mistake::new(r.place(key), what));
    }
    agent.period_range = Some((least, most));
}

/// How it may do its step, and what a resource manager may take from it.
fn means(r: &mut TableReader<'_>, agent: &mut AgentPlan) {
    let at = r.place("methods");
    if let Some(methods) = r.table("methods") {
        let mut costs = TableReader::new(methods, at, "\"methods\"".to_owned());
        for row in methods.rows() {
            let cost = span_of_time(&mut costs, &row.key);
            agent.methods.extend(cost.map(|cost| (row.key.clone(), cost)));
        }
        let mut wrong = Vec::new();
        costs.finish(&mut wrong);
        wrong.into_iter().for_each(|mistake| r.report(mistake));
    }
    agent.method = r.text("method").map(str::to_owned);
    agent.refinement = span_of_time(r, "refinement");
    agent.budget = span_of_time(r, "budget");
    let giving = &mut agent.giving;
    giving.importance = r.float_in("importance", 0.0, 1.0);
    giving.elasticity = r.float_in("elasticity", 0.0, 1e6);
    giving.gap_max = span_of_time(r, "gap_max");
    giving.may_suspend = r.bool("may_suspend").unwrap_or(false);
    giving.is_rigid = r.bool("rigid").unwrap_or(false);
    giving.is_suspended = r.bool("suspended").unwrap_or(false);
}

fn inputs(r: &mut TableReader<'_>, agent: &mut AgentPlan, kind: Option<&AgentType>) {
    for (input, at) in r.texts("on").unwrap_or_default() {
        let takes = |kind: &AgentType| kind.port(input).is_some_and(|port| port.shape.comes_in());
        if let Some(kind) = kind.filter(|kind| !takes(kind)) {
            let known = kind.ports.iter().filter(|port| port.shape.comes_in()).map(|port| port.name);
            let what = format!("an agent of type \"{}\" has no input \"{input}\"", kind.kind);
            r.report(unknown(at, what, input, known));
        }
        agent.on.push(input.to_owned());
    }
}

fn on_death(r: &mut TableReader<'_>, agent: &mut AgentPlan) {
    agent.on_death = match r.text("on_death") {
        None | Some("restart") => OnDeath::Restart,
        Some("leave") => OnDeath::Leave,
        Some(other) => {
            let what = format!("\"on_death\" cannot be \"{other}\"");
            r.report(unknown(r.place("on_death"), what, other, ["restart", "leave"]));
            OnDeath::Restart
        }
    };
}

/// Whatever is no entry of every agent is a parameter, if the type has one of this name.
fn parameters(r: &mut TableReader<'_>, agent: &mut AgentPlan, table: &Table, kind: Option<&AgentType>) {
    for row in table.rows().iter().filter(|row| !ENTRIES.contains(&row.key.as_str())) {
        r.allow(&row.key);
        match kind {
            Some(kind) if !kind.params.iter().any(|field| field.name == row.key) => {
                let own = kind.params.iter().map(|field| field.name);
                let all = own.chain(ENTRIES);
                let what = format!("agent \"{}\" has no entry \"{}\"", agent.name, row.key);
                r.report(unknown(row.key_at, what, &row.key, all));
            }
            _ => agent.params.push(row.clone()),
        }
    }
}
