//! What is known, for people and for programs.

use std::path::Path;

use knowledge::{Date, Fact, Item, Kind, Listed, Map, Pattern, Reach, Reached, Schedule, Version, When};
use serde_json::{Value as Json, json};
use types::value::{Key, Table};

use super::Answer;
use crate::run::table as columns;

pub(super) fn lists(file: &Path, lists: &[(Kind, Vec<Listed>)]) -> Answer {
    let all = lists.iter().flat_map(|(kind, list)| list.iter().map(move |one| (kind.name(), one)));
    let rows: Vec<[String; 3]> =
        all.clone().map(|(kind, one)| [kind.to_owned(), one.name.clone(), one.what.clone()]).collect();
    let known: Vec<Json> =
        all.map(|(kind, one)| json!({"kind": kind, "name": one.name, "what": one.what})).collect();
    let text = if rows.is_empty() { format!("{} holds none", file.display()) } else { columns(&rows, 3) };
    Answer::new(text, json!({"file": file.display().to_string(), "known": known}))
}

/// The rows of a table, as a file has them.
fn lines(weights: &Table) -> String {
    weights.rows().iter().map(|row| format!("{} = {}\n", Key(&row.key), row.entry.value)).collect()
}

fn version_json(version: &Version) -> Json {
    json!({
        "version": version.number,
        "time_s": version.time.seconds(),
        "weights": control::json::table_to_json(&version.weights),
    })
}

pub(super) fn table(name: &str, version: &Version) -> Answer {
    let mut document = version_json(version);
    document["name"] = name.into();
    Answer::new(lines(&version.weights), document)
}

pub(super) fn history(name: &str, versions: &[Version]) -> Answer {
    let text: Vec<String> = versions
        .iter()
        .map(|version| {
            format!(
                "# version {}, {} UTC\n{}",
                version.number,
                Date::of(version.time),
                lines(&version.weights)
            )
        })
        .collect();
    let versions: Vec<Json> = versions.iter().map(version_json).collect();
    Answer::new(text.join("\n"), json!({"name": name, "versions": versions}))
}

pub(super) fn facts(facts: &[Fact]) -> Answer {
    let rows: Vec<[String; 6]> = facts
        .iter()
        .map(|fact| {
            let source = if fact.source.is_empty() { "-" } else { &fact.source };
            let parts = [&fact.subject, &fact.predicate, &fact.object].map(String::clone);
            let [subject, predicate, object] = parts;
            let date = Date::of(fact.time).to_string();
            [subject, predicate, object, fact.confidence.to_string(), source.to_owned(), date]
        })
        .collect();
    let list: Vec<Json> = facts
        .iter()
        .map(|fact| {
            json!({
                "subject": fact.subject,
                "predicate": fact.predicate,
                "object": fact.object,
                "confidence": fact.confidence,
                "source": fact.source,
                "time_s": fact.time.seconds(),
            })
        })
        .collect();
    Answer::new(columns(&rows, 6), json!({"facts": list}))
}

pub(super) fn reached(reach: &Reach, reached: &[Reached]) -> Answer {
    let rows: Vec<[String; 2]> = reached
        .iter()
        .map(|one| {
            let steps = if one.steps == 1 { "1 step".to_owned() } else { format!("{} steps", one.steps) };
            [one.name.clone(), steps]
        })
        .collect();
    let list: Vec<Json> = reached.iter().map(|one| json!({"name": one.name, "steps": one.steps})).collect();
    Answer::new(columns(&rows, 2), json!({"from": reach.from, "predicate": reach.predicate, "reached": list}))
}

pub(super) fn pattern(pattern: &Pattern) -> Answer {
    let mut text = format!("kind = \"{}\"\n", pattern.kind.name());
    if !pattern.bytes.is_empty() {
        text += &format!("media_type = \"{}\"\nbytes = {}\n", pattern.media_type, pattern.bytes.len());
    }
    text += &lines(&pattern.parameters);
    let document = json!({
        "name": pattern.name,
        "kind": pattern.kind.name(),
        "media_type": pattern.media_type,
        "bytes": pattern.bytes.len(),
        "parameters": control::json::table_to_json(&pattern.parameters),
    });
    Answer::new(text, document)
}

pub(super) fn schedule(schedule: &Schedule) -> Answer {
    let (when, document) = match &schedule.when {
        When::Once(time) => (format!("at = \"{}\"", time.since_start()), json!({"at_s": time.seconds()})),
        When::Every { first, period } => (
            format!("every = \"{period}\"\nat = \"{}\"", first.since_start()),
            json!({"every_s": period.seconds(), "at_s": first.seconds()}),
        ),
        When::Cron(cron) => (format!("cron = \"{cron}\""), json!({"cron": cron.to_string()})),
    };
    let words = control::words::join(&schedule.words);
    let document = json!({"name": schedule.name, "when": document, "do": schedule.words});
    Answer::new(format!("{when}\ndo = {}\n", types::value::Value::from(words)), document)
}

pub(super) fn map(map: &Map) -> Answer {
    let types::Pose { x, y, heading } = map.origin;
    let text = format!(
        "resolution = {} # m\norigin = [{x}, {y}, {heading}] # m, m, rad\nwidth = {}\nheight = {}\n",
        map.resolution, map.width, map.height
    );
    let document = json!({
        "name": map.name,
        "time_s": map.time.seconds(),
        "resolution_m": map.resolution,
        "origin": {"x": x, "y": y, "heading": heading},
        "width": map.width,
        "height": map.height,
    });
    Answer::new(text, document)
}

/// That something was put, and what.
pub(super) fn put(file: &Path, item: &Item, version: Option<u32>) -> Answer {
    let (kind, name) = match item {
        Item::Table(one) => (Kind::Table, one.name.clone()),
        Item::Fact(one) => (Kind::Fact, format!("{} {} {}", one.subject, one.predicate, one.object)),
        Item::Pattern(one) => (Kind::Pattern, one.name.clone()),
        Item::Schedule(one) => (Kind::Schedule, one.name.clone()),
        Item::Map(one) => (Kind::Map, one.name.clone()),
    };
    let shown = version.map_or(String::new(), |version| format!(", version {version}"));
    let mut document =
        json!({"file": file.display().to_string(), "put": {"kind": kind.name(), "name": name}});
    if let Some(version) = version {
        document["put"]["version"] = version.into();
    }
    Answer::new(format!("{}: put {} {name}{shown}", file.display(), kind.name()), document)
}

pub(super) fn removed(file: &Path, kind: Kind, name: &[String], count: usize) -> Answer {
    let (file, name) = (file.display().to_string(), name.join(" "));
    let text = match kind {
        Kind::Fact if count > 1 => format!("{file}: removed {count} facts"),
        kind => format!("{file}: removed {} {name}", kind.name()),
    };
    Answer::new(text, json!({"file": file, "removed": {"kind": kind.name(), "name": name, "count": count}}))
}
