//! What stands in the world, written into a log and read from it again, so that a log alone can be drawn.

use record::figure::{Drawing, Region};
use serde_json::{Value as Json, json};
use sim::hand::Standing;
use sim::snapshot::Scenery;
use types::{Point, Pose};

use super::Notes;
use crate::file::{self, Part};
use crate::run::Ready;

/// The name of the note with the scenery.
const SCENERY: &str = "scenery";
/// The name of the note with the robots.
const ROBOTS: &str = "robots";
/// The name of the note with the parts of the run that are drawn by themselves.
const FIGURES: &str = "figures";

/// What a log has to know of the world and the robots. It depends on the plan and the seed alone.
pub(crate) fn notes(ready: &Ready) -> Notes {
    let mut notes = Notes::new();
    if let Some(truth) = &ready.truth {
        notes.insert(SCENERY.into(), scenery(truth.scenery()).to_string());
    }
    let robots = ready.robots.iter().map(|robot| {
        let mut row = json!({
            "name": robot.name,
            "radius": robot.shape.reach(),
            "recorded": robot.description.clock == hardware::ClockKind::Recorded,
            "command": command_of(ready, &robot.name),
        });
        if let Some(corners) = robot.shape.corners(Pose::default()) {
            row["outline"] = corners.iter().map(|p| point(*p)).collect();
        }
        row
    });
    notes.insert(ROBOTS.into(), Json::Array(robots.collect()).to_string());
    let parts = file::figures(&ready.plan);
    if !parts.is_empty() {
        let row = |part: &Part| json!([part.name, part.is_way, part.span.0, part.span.1]);
        notes.insert(FIGURES.into(), parts.iter().map(row).collect::<Json>().to_string());
    }
    notes
}

/// The parts of a log's run that are drawn by themselves.
pub(super) fn parts(notes: &Notes) -> Vec<Part> {
    let rows = notes.get(FIGURES).and_then(|text| serde_json::from_str::<Vec<Json>>(text).ok());
    let part = |row: &Json| {
        let (name, is_way) = (row[0].as_str()?.to_owned(), row[1].as_bool()?);
        // A log is somebody's file: what is no name of a file is none of ours.
        let is_plain = name.chars().all(|c| c.is_ascii_alphanumeric() || "-_".contains(c));
        is_plain.then_some(Part { name, is_way, span: (row[2].as_f64()?, row[3].as_f64()?) })
    };
    rows.unwrap_or_default().iter().filter_map(part).collect()
}

/// The topic of what the robot's wheels are told: the output that is joined to its "drive".
fn command_of(ready: &Ready, robot: &str) -> Option<String> {
    let own = ready.plan.agents.iter().filter(|agent| agent.robot.as_deref() == Some(robot));
    let mut joined = own.filter_map(|agent| {
        let kind = ready.registry.get(&agent.kind)?;
        let port = kind.ports.iter().find(|port| port.options.robot == Some("drive"))?;
        Some(format!("/{}/{}", agent.name, port.name))
    });
    let wire = ready.plan.wires.iter().find(|wire| wire.to == format!("{robot}.drive"));
    joined.next_back().or(wire.map(|wire| format!("/{}", wire.from.replace('.', "/"))))
}

fn point(point: Point) -> Json {
    // Millimetres are finer than any figure, and keep the note short.
    json!([(point.x * 1e3).round() / 1e3, (point.y * 1e3).round() / 1e3])
}

fn scenery(scenery: &Scenery) -> Json {
    let lines = scenery.lines.iter().map(|line| json!([point(line.from), point(line.to)]));
    let discs = scenery.discs.iter().map(|disc| json!([point(disc.centre), disc.radius]));
    let regions = scenery.regions.iter().map(|region| {
        json!({"name": region.name, "polygon": region.polygon.iter().map(|p| point(*p)).collect::<Vec<_>>()})
    });
    json!({
        "lines": lines.collect::<Vec<_>>(),
        "discs": discs.collect::<Vec<_>>(),
        "regions": regions.collect::<Vec<_>>(),
    })
}

/// What a note of a thing begins with that was added while the run went.
const STANDS: &str = "stands: ";

/// The note of a thing that was added to the world.
pub(crate) fn stands(thing: &Standing) -> String {
    let outline = match thing.shape.corners(thing.pose) {
        Some(corners) => json!({"corners": corners.iter().map(|p| point(*p)).collect::<Vec<_>>()}),
        None => json!({"disc": [point(thing.pose.position()), thing.shape.reach()]}),
    };
    format!("{STANDS}{} {outline}", thing.name)
}

/// Draws the thing that a note tells of, if it tells of one.
pub(super) fn draw_standing(drawing: &mut Drawing, note: &str) {
    let Some(at) = note.strip_prefix(STANDS).and_then(|rest| rest.find('{').map(|at| &rest[at..])) else {
        return;
    };
    let Ok(json) = serde_json::from_str::<Json>(at) else { return };
    let corners: Vec<Point> =
        json["corners"].as_array().into_iter().flatten().filter_map(read_point).collect();
    for (k, corner) in corners.iter().enumerate() {
        drawing.segments.push((*corner, corners[(k + 1) % corners.len()]));
    }
    let disc = &json["disc"];
    drawing.circles.extend(read_point(&disc[0]).zip(disc[1].as_f64()));
}

fn read_point(json: &Json) -> Option<Point> {
    Some(Point::new(json.get(0)?.as_f64()?, json.get(1)?.as_f64()?))
}

/// The scenery of a log; nothing stands where the log knows nothing.
pub(super) fn drawing(notes: &Notes) -> Drawing {
    let Some(json) = notes.get(SCENERY).and_then(|text| serde_json::from_str::<Json>(text).ok()) else {
        return Drawing::default();
    };
    let rows = |key: &str| json[key].as_array().cloned().unwrap_or_default();
    let line = |row: &Json| Some((read_point(&row[0])?, read_point(&row[1])?));
    let disc = |row: &Json| Some((read_point(&row[0])?, row[1].as_f64()?));
    let region = |row: &Json| {
        let corners = row["polygon"].as_array()?.iter().filter_map(read_point).collect();
        Some(Region { corners, name: row["name"].as_str()?.to_owned() })
    };
    Drawing {
        segments: rows("lines").iter().filter_map(line).collect(),
        circles: rows("discs").iter().filter_map(disc).collect(),
        regions: rows("regions").iter().filter_map(region).collect(),
        ..Drawing::default()
    }
}

/// A robot of a log.
#[derive(Clone, Debug)]
pub(super) struct KnownRobot {
    pub(super) name: String,
    pub(super) radius: f64,
    /// The corners of its body around it (m); none of a round one.
    pub(super) outline: Vec<Point>,
    /// The topic of what its wheels are told.
    pub(super) command: Option<String>,
}

/// The robots of a log.
pub(super) fn robots(notes: &Notes) -> Vec<KnownRobot> {
    let rows =
        notes.get(ROBOTS).and_then(|text| serde_json::from_str::<Vec<Json>>(text).ok()).unwrap_or_default();
    let robot = |row: &Json| {
        Some(KnownRobot {
            name: row["name"].as_str()?.to_owned(),
            radius: row["radius"].as_f64()?,
            outline: row["outline"].as_array().into_iter().flatten().filter_map(read_point).collect(),
            command: row["command"].as_str().map(str::to_owned),
        })
    };
    rows.iter().filter_map(robot).collect()
}
