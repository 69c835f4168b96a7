//! A plan as the text of a system file.

use std::fmt::{self, Write as _};

use runtime::{
    AgentPlan, ExecutorPlan, OnDeath, Plan, Policy, QueuePlan, TimedRequest, WireFilter, WirePlan,
};
use types::Duration;
use types::value::{Entry, Key, Table, Value};

use super::decide;
use super::read::ROBOT;

/// Lists longer than this are written one item a line.
const LINE: usize = 100;

/// Writes a plan. Reading the text gives the same plan again, but that the wires of one output stand together, in the order
/// in which their outputs come first.
pub fn write_plan(plan: &Plan) -> String {
    let mut out = String::new();
    // Writing to a text cannot fail.
    let _ = write(plan, &mut out);
    out
}

fn write(plan: &Plan, out: &mut String) -> fmt::Result {
    writeln!(out, "name = {}", Value::from(plan.name.as_str()))?;
    for row in plan.sections.rows() {
        if row.entry.value.as_table().is_none() {
            writeln!(out, "{} = {}", Key(&row.key), row.entry.value)?;
        }
    }
    let robots = plan.section(ROBOT);
    for row in robots.map(Table::rows).unwrap_or_default() {
        robot(&row.key, row.entry.value.as_table(), plan.agent(&row.key), out)?;
    }
    for row in plan.sections.rows() {
        match &row.entry.value {
            Value::Table(table) if row.key == "world" => section(&row.key, table, out)?,
            _ => {}
        }
    }
    plan.executors.iter().try_for_each(|one| executor(one, out))?;
    let decisions = decisions(plan);
    let is_robot = |agent: &AgentPlan| {
        agent.kind == ROBOT && robots.is_some_and(|robots| robots.get(&agent.name).is_some())
    };
    for one in plan.agents.iter().filter(|one| !is_robot(one)) {
        agent(one, decisions.is_some(), out)?;
    }
    plan.queues.iter().try_for_each(|one| queue(one, out))?;
    wires(&plan.wires, out)?;
    if let Some(table) = decisions {
        section("decide", table, out)?;
    }
    for row in plan.sections.rows() {
        match &row.entry.value {
            Value::Table(table) if row.key != ROBOT && row.key != "world" => section(&row.key, table, out)?,
            _ => {}
        }
    }
    plan.requests.iter().try_for_each(|one| request(one, out))
}

/// The table of the decision maker, if it can be told whose it is.
fn decisions(plan: &Plan) -> Option<&Table> {
    let mut makers = plan.agents.iter().filter(|agent| agent.kind == decide::KIND);
    match (makers.next(), makers.next()) {
        (Some(maker), None) => maker.params.get(decide::PARAM)?.value.as_table(),
        _ => None,
    }
}

fn robot(name: &str, table: Option<&Table>, gate: Option<&AgentPlan>, out: &mut String) -> fmt::Result {
    let mut table = table.cloned().unwrap_or_default();
    for row in gate.map(|gate| gate.params.rows()).unwrap_or_default() {
        table.set(&row.key, row.entry.clone());
    }
    section(&format!("robot.{}", Key(name)), &table, out)
}

fn section(name: &str, table: &Table, out: &mut String) -> fmt::Result {
    writeln!(out, "\n[{name}]")?;
    table.rows().iter().try_for_each(|row| entry(&row.key, &row.entry, out))
}

fn entry(key: &str, entry: &Entry, out: &mut String) -> fmt::Result {
    let line = entry.value.to_string();
    match &entry.value {
        Value::List(items) if line.len() > LINE => {
            writeln!(out, "{} = [", Key(key))?;
            for item in items {
                writeln!(out, "    {},", item.value)?;
            }
            writeln!(out, "]")
        }
        _ => writeln!(out, "{} = {line}", Key(key)),
    }
}

fn span(key: &str, span: Option<Duration>, out: &mut String) -> fmt::Result {
    match span {
        Some(span) => writeln!(out, "{key} = \"{span}\""),
        None => Ok(()),
    }
}

fn executor(executor: &ExecutorPlan, out: &mut String) -> fmt::Result {
    writeln!(out, "\n[executor.{}]", Key(&executor.name))?;
    if executor.policy != Policy::default() {
        writeln!(out, "policy = {}", Value::from(executor.policy.name()))?;
    }
    if let Some(priority) = executor.priority {
        writeln!(out, "priority = {priority}")?;
    }
    if !executor.cpus.is_empty() {
        writeln!(out, "cpus = {:?}", executor.cpus)?;
    }
    span("spin", Some(executor.spin).filter(|spin| *spin != Duration::ZERO), out)
}

fn agent(agent: &AgentPlan, decides: bool, out: &mut String) -> fmt::Result {
    writeln!(out, "\n[agent.{}]", Key(&agent.name))?;
    writeln!(out, "is = {}", Value::from(agent.kind.as_str()))?;
    if let Some(robot) = &agent.robot {
        writeln!(out, "robot = {}", Value::from(robot.as_str()))?;
    }
    span("period", agent.period, out)?;
    if let Some((least, most)) = agent.period_range {
        span("period_min", Some(least), out)?;
        span("period_max", Some(most), out)?;
    }
    span("cost", agent.cost, out)?;
    means(agent, out)?;
    span("deadline", agent.deadline, out)?;
    match agent.on.as_slice() {
        [] => {}
        [one] => writeln!(out, "on = {}", Value::from(one.as_str()))?,
        several => writeln!(out, "on = {}", list(several))?,
    }
    span("min_gap", Some(agent.min_gap).filter(|gap| *gap != Duration::ZERO), out)?;
    span("wake_gap", Some(agent.wake_gap).filter(|gap| *gap != Duration::ZERO), out)?;
    if let Some(executor) = &agent.executor {
        writeln!(out, "executor = {}", Value::from(executor.as_str()))?;
    }
    if agent.on_death == OnDeath::Leave {
        writeln!(out, "on_death = \"leave\"")?;
    }
    span("hang_after", agent.hang_after, out)?;
    for row in agent.params.rows() {
        let is_section = decides && agent.kind == decide::KIND && row.key == decide::PARAM;
        if !is_section {
            entry(&row.key, &row.entry, out)?;
        }
    }
    Ok(())
}

fn means(agent: &AgentPlan, out: &mut String) -> fmt::Result {
    if !agent.methods.is_empty() {
        let costs = agent.methods.iter().map(|(name, cost)| format!("{} = \"{cost}\"", Key(name)));
        writeln!(out, "methods = {{ {} }}", costs.collect::<Vec<_>>().join(", "))?;
    }
    if let Some(method) = &agent.method {
        writeln!(out, "method = {}", Value::from(method.as_str()))?;
    }
    span("refinement", agent.refinement, out)?;
    span("budget", agent.budget, out)?;
    let giving = &agent.giving;
    for (key, number) in [("importance", giving.importance), ("elasticity", giving.elasticity)] {
        if let Some(number) = number {
            writeln!(out, "{key} = {}", Value::Float(number))?;
        }
    }
    span("gap_max", giving.gap_max, out)?;
    let flags =
        [("may_suspend", giving.may_suspend), ("rigid", giving.is_rigid), ("suspended", giving.is_suspended)];
    for (key, _) in flags.into_iter().filter(|(_, is)| *is) {
        writeln!(out, "{key} = true")?;
    }
    Ok(())
}

fn queue(queue: &QueuePlan, out: &mut String) -> fmt::Result {
    writeln!(out, "\n[queue.{}]", Key(&queue.name))?;
    if let Some(depth) = queue.depth {
        writeln!(out, "depth = {depth}")?;
    }
    if let Some(overload) = queue.overload {
        writeln!(out, "overload = {}", Value::from(overload.name()))?;
    }
    Ok(())
}

fn wires(wires: &[WirePlan], out: &mut String) -> fmt::Result {
    if wires.is_empty() {
        return Ok(());
    }
    writeln!(out, "\n[wires]")?;
    for (i, first) in wires.iter().enumerate() {
        if wires[..i].iter().any(|earlier| earlier.from == first.from) {
            continue;
        }
        let of_output = wires.iter().filter(|wire| wire.from == first.from);
        let targets = Value::List(of_output.map(|wire| Entry::from(target(wire))).collect());
        entry(&first.from, &targets.into(), out)?;
    }
    Ok(())
}

/// The input, or a table where there is more to say.
fn target(wire: &WirePlan) -> Value {
    let WirePlan { depth, overload, filter, .. } = wire;
    let mut table = Table::new();
    table.set("to", Value::from(wire.to.as_str()));
    if let Some(depth) = depth {
        table.set("depth", Value::Int(*depth as i64));
    }
    if let Some(overload) = overload {
        table.set("overload", Value::from(overload.name()));
    }
    if let Some(serving) = wire.serving {
        table.set("serving", Value::Int(serving.into()));
    }
    if filter.every != 0 {
        table.set("every", Value::from(filter.every));
    }
    if filter.least_priority != WireFilter::default().least_priority {
        table.set("priority", Value::from(filter.least_priority.0.name()));
    }
    if let Some(marker) = filter.marker {
        table.set("marker", Value::from(marker));
    }
    if let Some(category) = filter.category {
        table.set("category", Value::from(category.name()));
    }
    if let Some(recipient) = &filter.recipient {
        table.set("recipient", Value::from(recipient.as_str()));
    }
    if table.len() == 1 { Value::from(wire.to.as_str()) } else { Value::Table(table) }
}

fn request(request: &TimedRequest, out: &mut String) -> fmt::Result {
    writeln!(out, "\n[[at]]\ntime = \"{}\"", request.at)?;
    let plain = |word: &String| !word.is_empty() && !word.contains(char::is_whitespace);
    let words = match request.words.iter().all(plain) && !request.words.is_empty() {
        true => Value::from(request.words.join(" ")),
        false => list(&request.words),
    };
    writeln!(out, "do = {words}")
}

fn list(words: &[String]) -> Value {
    let mut text = Vec::new();
    words.iter().for_each(|word| text.push(Entry::from(Value::from(word.as_str()))));
    Value::List(text)
}

/// The same text, for those who only want to look at it.
#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_reads_as_one_would_write_it() {
        let mut plan = Plan::new("lesson");
        plan.agents.push(AgentPlan {
            name: "sonar".into(),
            kind: "sonar".into(),
            period: Some(Duration::millis(250)),
            on: vec!["echoes".into()],
            ..AgentPlan::default()
        });
        plan.wires.push(WirePlan::new("sonar.raw", "safety.raw"));
        plan.wires.push(WirePlan { depth: Some(8), ..WirePlan::new("sonar.raw", "wall.raw") });
        plan.sections.set("world", Value::from("laboratory"));
        let mut text = String::new();
        let _ = writeln!(text, "name = \"lesson\"\nworld = \"laboratory\"\n");
        let _ = writeln!(text, "[agent.sonar]\nis = \"sonar\"\nperiod = \"250ms\"\non = \"echoes\"\n");
        let _ =
            writeln!(text, "[wires]\n\"sonar.raw\" = [\"safety.raw\", {{ to = \"wall.raw\", depth = 8 }}]");
        assert_eq!(write_plan(&plan), text);
    }
}
