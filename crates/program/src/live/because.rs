//! The changes of a decision as people read them.

use std::fmt::Write as _;

use serde_json::Value as Json;

use super::shown::{rows, text};

/// The last changes of the decision.
pub(super) fn why(answer: &Json) -> String {
    let changes = answer.as_array().map(Vec::as_slice).unwrap_or_default();
    if changes.is_empty() {
        return "nothing was decided yet".to_owned();
    }
    changes.iter().map(change).collect::<Vec<_>>().join("\n")
}

fn change(change: &Json) -> String {
    let whose = change["agent"].as_str().map(|agent| format!("{agent}: ")).unwrap_or_default();
    let say = match change["active"].as_str() {
        None | Some("") => "nobody has the say".to_owned(),
        Some(agent) => format!("{agent} has the say"),
    };
    let (time, changed) = (change["time_s"].as_f64().unwrap_or(0.0), &change["changed"]);
    let situation = text(&change["situation"]);
    let situation = match changed["situation"].is_null() {
        true => format!("still {situation}"),
        false => format!("{} → {situation}", text(&change["before"])),
    };
    let mut out = format!("{time:9.2} s  {whose}{situation}: {say}\n");
    line(&mut out, "began", list(&changed["began"]));
    line(&mut out, "ended", list(&changed["ended"]));
    line(&mut out, "active", list(&change["situations"]));
    line(&mut out, "because", because(change));
    line(&mut out, "weights", weights(change));
    line(&mut out, "orders", orders(&change["orders"], &changed["orders"]));
    if !change["goal"].is_null() || !changed["goal"].is_null() {
        let or_none = |goal: &Json| goal.as_str().unwrap_or("none").to_owned();
        let was = &changed["goal"];
        let was = if was.is_null() { String::new() } else { format!(" (was {})", or_none(&was[0])) };
        line(&mut out, "goal", or_none(&change["goal"]) + &was);
    }
    out
}

/// A line, if it says anything.
fn line(out: &mut String, key: &str, what: String) {
    if !what.is_empty() {
        let _ = writeln!(out, "{:13}{key:8} {what}", "");
    }
}

fn list(names: &Json) -> String {
    let names = names.as_array().map(Vec::as_slice).unwrap_or_default();
    names.iter().map(text).collect::<Vec<_>>().join(", ")
}

/// What it is, and what it was where that is something else.
fn with_was(is: &str, changed: &Json) -> String {
    if changed.is_null() { is.to_owned() } else { format!("{is} (was {})", value(&changed[0])) }
}

fn value(json: &Json) -> String {
    match json {
        Json::Null => "unknown".to_owned(),
        Json::Bool(truth) => if *truth { "yes" } else { "no" }.to_owned(),
        Json::Number(number) => format!("{:.3}", number.as_f64().unwrap_or(0.0)),
        other => text(other),
    }
}

/// The values that it was decided on.
fn because(change: &Json) -> String {
    let Some(values) = change["values"].as_object() else {
        let number = |key: &str| change[key].as_f64().unwrap_or(0.0);
        return format!("danger {:.3}, desire {:.3}", number("danger"), number("desire"));
    };
    let changed = &change["changed"]["values"];
    let part =
        |(signal, is): (&String, &Json)| format!("{signal} {}", with_was(&value(is), &changed[signal]));
    values.iter().map(part).collect::<Vec<_>>().join(", ")
}

/// The weights, each with the situation whose row says it.
fn weights(change: &Json) -> String {
    let changed = &change["changed"]["weights"];
    let part = |row: &Json| {
        let agent = text(&row["agent"]);
        let was = &changed[&agent];
        let was = if was.is_null() { String::new() } else { format!(", was {}", unsaid(&was[0])) };
        format!("{agent} {} by {}{was}", text(&row["weight"]), text(&row["by"]))
    };
    rows(change, "rows").map(part).collect::<Vec<_>>().join("; ")
}

fn unsaid(json: &Json) -> String {
    if json.is_null() { "unsaid".to_owned() } else { text(json) }
}

/// What agents are to do besides.
fn orders(orders: &Json, changed: &Json) -> String {
    let settings = |of: &Json| {
        let said = of.as_object().into_iter().flatten();
        said.map(|(key, value)| format!("{key} {}", text(value))).collect::<Vec<_>>().join(", ")
    };
    let mut parts: Vec<String> = Vec::new();
    for (agent, said) in orders.as_object().into_iter().flatten() {
        let news = if changed[agent].is_null() { "" } else { " (new)" };
        parts.push(format!("{agent} {}{news}", settings(said)));
    }
    let over = changed.as_object().into_iter().flatten().filter(|(_, pair)| pair[1].is_null());
    parts.extend(over.map(|(agent, _)| format!("{agent} nothing any more")));
    parts.join("; ")
}
