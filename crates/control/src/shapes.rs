//! What is shown of a running system, as JSON. The shapes are stable: keys may be added, none goes or changes its meaning.
//!
//! | shape | keys |
//! |---|---|
//! | `ls` | `system`, `time_s`, `agents`: rows of `name`, `kind`, `state` (`running`, `restarting`, `dead`), `executor`, `asked`, `granted`, `period_s` (null without one), `deadline_s`, the counts, `last_death` (null when it never died), `params`; `queues` |
//! | `graph` | `system`, `time_s`, `agents`: rows of `name`, `kind`, `doc`, `executor`, `ports`: rows of `name`, `doc`, `direction` (`input`, `output`, `service`, `client`, `router`, `manager`), `message`, `sent`, of a reading `processing` (`raw`, `filtered`, `interpreted`), where it is `router` `asked`, `not_asked`; `wires`: rows of `from`, `to`, `message`, `depth`, `overload`, `filter`, `sent`, `taken`, `replaced` (displaced by newer ones before an input that only ever asks for the newest or looks into the sender's memory), `dropped`, `refused`, `expired`; `queues` |
//! | `top` | `system`, `time_s`, `messages`: `sent`, `taken`, `replaced`, `dropped`, `refused`, `expired` over all wires; `agents`: rows of `name`, `state`, `executor`, `asked`, `granted`, the counts, and the figures `exec`, `jitter`, `response` |
//! | counts | `releases`, `missed`, `stalled`, `skipped`, `faults`, `panics`, `hangs`, `restarts`, `refinements`, `overruns` (of the budget for refinements); how it does its step at the moment: `method` and `budget_s` (null without), `suspended`; of execution times `left_out` (a stall was in the step), `checked` (held against the clock of the thread) and `disagreed`; `allocations` (how often steps took or freed memory, where the program watches that) |
//! | figure | `name`, `unit`, `n`, `min`, `p50`, `p99`, `p999`, `max`: unfiltered; all values null while `n` is 0 |
//! | `queues` | rows of `name`, `message` (null before anybody is wired to it), `depth`, `overload`, `waiting`, `sent`, `dropped`, `refused`, `taken`, `receivers`: rows of `to`, `serving`, `taken`; what was sent and taken on wires that are gone counts too |
//! | filter | `category` (null for all), `priority` (the least), `marker`, `recipient` (the name of an agent, null for all), `every` |
//!
//! `time_s` is the system's own clock (s). `asked` and `granted` are the scheduling, as in `fifo 70`, or `deadline 2420us/20ms/20ms`. Whatever was asked for and
//! not granted, dropped or missed is in these numbers.

use runtime::{
    AgentPlan, AgentView, Figure, PlanParts, PortView, QueuePlan, QueueView, Refusal, Request, SystemView,
    WireFilter, WirePlan, WireView,
};
use serde_json::{Map, Value as Json, json};
use types::Duration;

use crate::json::table_to_json;
use crate::words;

/// A figure of spans of time (ns).
pub fn figure(name: &str, figure: &Figure) -> Json {
    let shown = |x: f64| if figure.n == 0 { Json::Null } else { Json::from(x) };
    json!({
        "name": name, "unit": "ns", "n": figure.n, "min": shown(figure.min), "p50": shown(figure.p50),
        "p99": shown(figure.p99), "p999": shown(figure.p999), "max": shown(figure.max),
    })
}

/// The agents and how they are.
pub fn ls(view: &SystemView) -> Json {
    system(view, view.agents.iter().map(ls_agent).collect(), [("queues", queues(view))])
}

/// Agents with their ports, and the wires between them.
pub fn graph(view: &SystemView) -> Json {
    let wires = view.wires.iter().map(graph_wire).collect();
    system(view, view.agents.iter().map(graph_agent).collect(), [("wires", wires), ("queues", queues(view))])
}

/// Timing and counts.
pub fn top(view: &SystemView) -> Json {
    let sum = |of: fn(&WireView) -> u64| view.wires.iter().map(of).sum::<u64>();
    let messages = json!({
        "sent": sum(|wire| wire.sent), "taken": sum(|wire| wire.taken), "replaced": sum(|wire| wire.replaced),
        "dropped": sum(|wire| wire.dropped), "refused": sum(|wire| wire.refused), "expired": sum(|wire| wire.expired),
    });
    system(view, view.agents.iter().map(top_agent).collect(), [("messages", messages)])
}

/// The running system as the requests that would build it, each as a row of words.
pub fn plan(name: &str, agents: &[AgentPlan], queues: &[QueuePlan], wires: &[WirePlan]) -> Json {
    let adds = agents.iter().map(|agent| words::words_of(&Request::Add(agent.clone())));
    let wires = wires.iter().map(|wire| words::words_of(&Request::Wire(wire.clone())));
    let queues = queues.iter().map(|queue| words::words_of(&Request::Queue(queue.clone())));
    json!({"system": name, "requests": adds.chain(queues).chain(wires).collect::<Vec<_>>()})
}

/// Reads what [`plan`] wrote.
///
/// # Errors
/// When it is something else.
pub fn read_plan(json: &Json) -> Result<PlanParts, Refusal> {
    let wrong = || Refusal::new("this is no plan of a running system");
    let (mut agents, mut queues, mut wires) = (Vec::new(), Vec::new(), Vec::new());
    for request in json["requests"].as_array().ok_or_else(wrong)? {
        let words: Option<Vec<String>> = request
            .as_array()
            .and_then(|row| row.iter().map(|word| word.as_str().map(str::to_owned)).collect());
        match words::parse(&words.ok_or_else(wrong)?)? {
            Request::Add(agent) => agents.push(agent),
            Request::Queue(queue) => queues.push(queue),
            Request::Wire(wire) => wires.push(wire),
            _ => return Err(wrong()),
        }
    }
    Ok((agents, queues, wires))
}

fn system<const N: usize>(view: &SystemView, agents: Vec<Json>, more: [(&str, Json); N]) -> Json {
    let mut shape = Map::new();
    shape.insert("system".into(), json!(view.name));
    shape.insert("time_s".into(), json!(view.now.seconds()));
    shape.insert("agents".into(), agents.into());
    shape.extend(more.map(|(key, value)| (key.to_owned(), value)));
    shape.into()
}

/// `row` with the counts of the agent.
fn with_counts(mut row: Json, agent: &AgentView) -> Json {
    let counts = &agent.counts;
    for (key, count) in [
        ("releases", counts.releases),
        ("missed", counts.missed),
        ("stalled", counts.stalled),
        ("skipped", counts.skipped),
        ("faults", counts.faults),
        ("panics", counts.panics),
        ("hangs", counts.hangs),
        ("restarts", counts.restarts),
        ("refinements", counts.refinements),
        ("overruns", counts.overruns),
        ("left_out", counts.left_out),
        ("checked", counts.checked),
        ("disagreed", counts.disagreed),
        ("allocations", counts.allocations),
    ] {
        row[key] = count.into();
    }
    row["method"] = agent.method.into();
    row["budget_s"] = agent.budget.map(Duration::seconds).into();
    row["suspended"] = agent.is_suspended.into();
    row
}

fn ls_agent(agent: &AgentView) -> Json {
    let row = json!({
        "name": agent.name, "kind": agent.kind, "state": agent.state.name(), "executor": agent.executor,
        "asked": agent.asked, "granted": agent.granted, "period_s": agent.period.map(Duration::seconds),
        "deadline_s": agent.deadline.seconds(), "last_death": agent.last_death,
        "params": table_to_json(&agent.params),
    });
    with_counts(row, agent)
}

fn top_agent(agent: &AgentView) -> Json {
    let row = json!({
        "name": agent.name, "state": agent.state.name(), "executor": agent.executor, "asked": agent.asked,
        "granted": agent.granted, "exec": figure("exec", &agent.exec),
        "jitter": figure("jitter", &agent.jitter), "response": figure("response", &agent.response),
    });
    with_counts(row, agent)
}

fn graph_agent(agent: &AgentView) -> Json {
    json!({
        "name": agent.name, "kind": agent.kind, "doc": agent.doc, "executor": agent.executor,
        "ports": agent.ports.iter().map(graph_port).collect::<Vec<_>>(),
    })
}

fn graph_port(port: &PortView) -> Json {
    let direction = port.direction.name();
    let mut row = json!({
        "name": port.name, "doc": port.doc, "direction": direction, "message": port.message, "sent": port.sent,
    });
    if let Some(processing) = port.processing {
        row["processing"] = processing.name().into();
    }
    if let Some((asked, not_asked)) = port.asked {
        (row["asked"], row["not_asked"]) = (asked.into(), not_asked.into());
    }
    row
}

fn graph_wire(wire: &WireView) -> Json {
    json!({
        "from": wire.from, "to": wire.to, "message": wire.message, "depth": wire.depth,
        "overload": wire.overload.name(), "filter": filter(&wire.filter), "sent": wire.sent,
        "taken": wire.taken, "replaced": wire.replaced, "dropped": wire.dropped, "refused": wire.refused,
        "expired": wire.expired,
    })
}

fn queues(view: &SystemView) -> Json {
    view.queues.iter().map(queue).collect()
}

fn queue(queue: &QueueView) -> Json {
    let receivers = queue.receivers.iter();
    let receivers = receivers.map(|to| json!({"to": to.to, "serving": to.serving, "taken": to.taken}));
    json!({
        "name": queue.name, "message": Some(queue.message).filter(|message| !message.is_empty()),
        "depth": queue.depth, "overload": queue.overload.name(), "waiting": queue.waiting, "sent": queue.sent,
        "dropped": queue.dropped, "refused": queue.refused, "taken": queue.taken,
        "receivers": receivers.collect::<Vec<_>>(),
    })
}

fn filter(filter: &WireFilter) -> Json {
    json!({
        "category": filter.category.map(|category| category.name()),
        "priority": filter.least_priority.0.name(), "marker": filter.marker,
        "recipient": filter.recipient, "every": filter.every.max(1),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_of_nothing_shows_no_numbers() {
        let empty = figure("exec", &Figure::default());
        assert!(empty["n"] == 0 && empty["max"].is_null() && empty["p50"].is_null());
        let one = Figure { n: 1, max: 5.0, ..Figure::default() };
        assert_eq!(figure("exec", &one)["max"], 5.0);
    }

    #[test]
    fn a_plan_is_read_as_it_was_written() {
        let mut agent = AgentPlan { name: "a".into(), kind: "b".into(), ..AgentPlan::default() };
        agent.params.set("side", types::value::Value::from("far left"));
        let wire = WirePlan { depth: Some(3), ..WirePlan::new("a.out", "c.in") };
        let queue = QueuePlan { depth: Some(5), ..QueuePlan::new("e") };
        let one = std::slice::from_ref;
        let json = plan("lab", one(&agent), std::slice::from_ref(&queue), std::slice::from_ref(&wire));
        assert_eq!(read_plan(&json), Ok((vec![agent], vec![queue], vec![wire])));
        assert!(read_plan(&json!({"requests": [["quit"]]})).is_err() && read_plan(&json!(3)).is_err());
    }
}
