//! Answers of a running system as people read them.

use std::fmt::Write as _;

use serde_json::Value as Json;

use crate::run::{span, table};

pub(super) fn rows<'a>(json: &'a Json, key: &str) -> impl Iterator<Item = &'a Json> + use<'a> {
    json[key].as_array().map(Vec::as_slice).unwrap_or_default().iter()
}

pub(super) fn text(json: &Json) -> String {
    match json {
        Json::String(text) => text.clone(),
        Json::Null => "-".to_owned(),
        other => other.to_string(),
    }
}

/// How an agent is, and by which method it works where it has several.
fn state(agent: &Json) -> String {
    let state = match agent["suspended"].as_bool() {
        Some(true) => "suspended".to_owned(),
        _ => text(&agent["state"]),
    };
    match agent["method"].as_str() {
        Some(method) => format!("{state}, {method}"),
        None => state,
    }
}

fn milliseconds(json: &Json) -> String {
    json.as_f64().map_or("-".to_owned(), |seconds| span(seconds * 1e9))
}

/// The agents.
pub(super) fn ls(answer: &Json) -> String {
    let head = ["agent", "kind", "state", "executor", "asked", "granted", "period", "steps", "restarts"];
    let mut lines = vec![head.map(str::to_owned)];
    lines.extend(rows(answer, "agents").map(|agent| {
        [
            text(&agent["name"]),
            text(&agent["kind"]),
            state(agent),
            text(&agent["executor"]),
            text(&agent["asked"]),
            text(&agent["granted"]),
            milliseconds(&agent["period_s"]),
            text(&agent["releases"]),
            text(&agent["restarts"]),
        ]
    }));
    let mut out = format!(
        "{} at {:.2} s\n{}",
        text(&answer["system"]),
        answer["time_s"].as_f64().unwrap_or(0.0),
        table(&lines, 6)
    );
    for agent in rows(answer, "agents").filter(|agent| !agent["last_death"].is_null()) {
        let _ = writeln!(out, "  {} died last: {}", text(&agent["name"]), text(&agent["last_death"]));
    }
    queues(answer, &mut out);
    out
}

/// Queues with what waits in them, and who takes it.
fn queues(answer: &Json, out: &mut String) {
    for queue in rows(answer, "queues") {
        let _ = write!(out, "{} (queue", text(&queue["name"]));
        if !queue["message"].is_null() {
            let _ = write!(out, " of {}", text(&queue["message"]));
        }
        let _ =
            write!(out, "): {} waiting, {} sent, {} taken", queue["waiting"], queue["sent"], queue["taken"]);
        for (key, word) in [("dropped", "dropped"), ("refused", "given back")] {
            if queue[key].as_u64().is_some_and(|count| count > 0) {
                let _ = write!(out, ", {} {word}", queue[key]);
            }
        }
        let _ = writeln!(out);
        for to in rows(queue, "receivers") {
            let (port, serving, taken) = (text(&to["to"]), &to["serving"], &to["taken"]);
            let _ = writeln!(out, "  {} → {port}  serving {serving}, {taken} taken", text(&queue["name"]));
        }
    }
}

/// Agents with what leads out of them.
pub(super) fn graph(answer: &Json) -> String {
    let mut out = format!("{}\n", text(&answer["system"]));
    for agent in rows(answer, "agents") {
        let name = text(&agent["name"]);
        let _ = writeln!(out, "{name} ({}, {})", text(&agent["kind"]), text(&agent["executor"]));
        let own = |wire: &&Json| wire["from"].as_str().is_some_and(|from| runtime::owner(from) == name);
        for wire in rows(answer, "wires").filter(own) {
            let from = text(&wire["from"]);
            let port = rows(agent, "ports").find(|port| from.ends_with(&format!(".{}", text(&port["name"]))));
            let processing = port.and_then(|port| port["processing"].as_str()).map(|word| format!("{word} "));
            let mut line = format!(
                "  {from} → {}  {}{}, {} sent",
                text(&wire["to"]),
                processing.unwrap_or_default(),
                text(&wire["message"]),
                text(&wire["sent"])
            );
            for (key, word) in [
                ("replaced", "replaced by newer ones"),
                ("dropped", "dropped"),
                ("refused", "given back"),
                ("expired", "read too late"),
            ] {
                if wire[key].as_u64().is_some_and(|count| count > 0) {
                    let _ = write!(line, ", {} {word}", wire[key]);
                }
            }
            let _ = writeln!(out, "{line}");
        }
    }
    queues(answer, &mut out);
    out
}

/// The graph for Graphviz.
pub(super) fn dot(answer: &Json) -> String {
    let quoted = |json: &Json| format!("\"{}\"", text(json).replace('"', "\\\""));
    let mut out =
        format!("digraph {} {{\n  rankdir = LR;\n  node [shape = box];\n", quoted(&answer["system"]));
    for agent in rows(answer, "agents") {
        let _ = writeln!(
            out,
            "  {} [label = {}];",
            quoted(&agent["name"]),
            quoted(&format!("{}\n{}", text(&agent["name"]), text(&agent["kind"])).into())
        );
    }
    for queue in rows(answer, "queues") {
        let _ = writeln!(out, "  {} [shape = cds];", quoted(&queue["name"]));
    }
    let is_queue = |name: &str| rows(answer, "queues").any(|queue| queue["name"] == *name);
    for wire in rows(answer, "wires") {
        let (from, to) = (text(&wire["from"]), text(&wire["to"]));
        let label = |port: &str| port.rsplit_once('.').map_or(port.to_owned(), |(_, port)| port.to_owned());
        let end = |name: &str| if is_queue(name) { name.to_owned() } else { runtime::owner(name).to_owned() };
        let ends = [end(&from), end(&to)].map(|agent| quoted(&agent.into()));
        let _ = writeln!(
            out,
            "  {} -> {} [taillabel = {}, headlabel = {}];",
            ends[0],
            ends[1],
            quoted(&label(&from).into()),
            quoted(&label(&to).into())
        );
    }
    out + "}\n"
}

/// Timing of the agents.
pub(super) fn top(answer: &Json) -> String {
    let head = [
        "agent",
        "state",
        "granted",
        "steps",
        "missed",
        "skipped",
        "restarts",
        "exec p50",
        "p99",
        "max",
        "jitter p99",
        "max",
    ];
    let mut lines = vec![head.map(str::to_owned)];
    let figure = |agent: &Json, of: &str, key: &str| agent[of][key].as_f64().map_or("-".to_owned(), span);
    lines.extend(rows(answer, "agents").map(|agent| {
        [
            text(&agent["name"]),
            state(agent),
            text(&agent["granted"]),
            text(&agent["releases"]),
            text(&agent["missed"]),
            text(&agent["skipped"]),
            text(&agent["restarts"]),
            figure(agent, "exec", "p50"),
            figure(agent, "exec", "p99"),
            figure(agent, "exec", "max"),
            figure(agent, "jitter", "p99"),
            figure(agent, "jitter", "max"),
        ]
    }));
    let messages = &answer["messages"];
    format!(
        "{} at {:.2} s: {} messages sent, {} replaced by newer ones, {} dropped, {} given back\n{}",
        text(&answer["system"]),
        answer["time_s"].as_f64().unwrap_or(0.0),
        text(&messages["sent"]),
        text(&messages["replaced"]),
        text(&messages["dropped"]),
        text(&messages["refused"]),
        table(&lines, 3)
    )
}

/// A message with when it was sent and by whom.
pub(super) fn heard(header: &Json, message: &Json) -> String {
    let stamp = header["stamp_ns"].as_f64().unwrap_or(0.0) * 1e-9;
    let mut out = format!("{stamp:.6} s  #{} from {}", text(&header["sequence"]), text(&header["sender"]));
    for (key, usual) in [("category", "data"), ("priority", "normal")] {
        if header[key] != usual {
            let _ = write!(out, ", {} {key}", text(&header[key]));
        }
    }
    format!("{out}\n{}", self::message(message))
}

/// What the numbers of some fields mean, as the constants of a definition say it: `uint8 PROGRESS_ARRIVED=2` is of the field `progress`.
pub(super) struct Names(Vec<(String, i64)>);

impl Names {
    pub(super) fn of(definition: &str) -> Names {
        // Behind the first row of signs come the parts of the message.
        let lines = definition.lines().take_while(|line| !line.starts_with('='));
        let constants = lines.filter_map(|line| line.split_once(' ')?.1.split_once('='));
        Names(constants.filter_map(|(name, value)| Some((name.to_owned(), value.parse().ok()?))).collect())
    }

    /// The message with the names beside the numbers, for people.
    pub(super) fn put_into(&self, mut message: Json) -> Json {
        let Some(rows) = message.as_object_mut() else { return message };
        for (field, value) in rows {
            let Some(number) = value.as_i64() else { continue };
            let prefix = format!("{}_", field.to_uppercase());
            let mut named = self.0.iter().filter(|(_, known)| *known == number);
            if let Some(name) = named.find_map(|(name, _)| name.strip_prefix(&prefix)) {
                *value = format!("{number} ({})", name.to_lowercase().replace('_', " ")).into();
            }
        }
        message
    }
}

/// A message as one line a field.
pub(super) fn message(message: &Json) -> String {
    let mut out = String::new();
    fields(message, "  ", &mut out);
    out
}

fn fields(json: &Json, indent: &str, out: &mut String) {
    let Json::Object(rows) = json else {
        let _ = writeln!(out, "{indent}{}", text(json));
        return;
    };
    for (key, value) in rows {
        if value.is_object() {
            let _ = writeln!(out, "{indent}{key}:");
            fields(value, &format!("{indent}  "), out);
        } else {
            let _ = writeln!(out, "{indent}{key}: {}", text(value));
        }
    }
}
