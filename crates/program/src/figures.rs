//! From a log to figures: where the robot went, how it moved, how long steps took, what it measured.

mod scenery;
mod trail;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use record::figure::{
    AgentTiming, Band, Event, Map, Periods, Picture, Series, Timing, Trajectory, Velocity, Waypoint,
};
use record::log::Reader;
use runtime::AgentView;
use types::Point;
use types::messages::Report;

use crate::file::Part;
pub(crate) use scenery::{notes, stands};
use trail::{Seen, Trail};

/// Dots in an inch of a PNG: what journals ask of line art at this size.
const DOTS: f64 = 200.0;
/// The part of a run that the figure of periods shows (s): a second or two, or the marks run into each other.
const WINDOW: f64 = 2.0;

/// Draws all that a log has to show into `folder`, and gives the files, and how its tasks ended.
pub(crate) fn of_log(
    log: &Path,
    folder: &Path,
    timing: Option<Timing>,
) -> Result<(Vec<PathBuf>, Vec<TaskOutcome>), String> {
    let mut reader = Reader::open(log).map_err(|error| error.to_string())?;
    let run = reader.run().cloned().unwrap_or_default();
    let (mut trail, parts) = (Trail::new(&run), scenery::parts(&run.notes));
    while let Some(message) = reader.next_message().map_err(|error| error.to_string())? {
        trail.take(&message);
    }
    trail.settle();
    std::fs::create_dir_all(folder)
        .map_err(|error| format!("{} cannot be made: {error}", folder.display()))?;
    let mut files = Files { folder, made: Vec::new() };
    let several = trail.robots.len() > 1;
    for (name, seen) in &trail.robots {
        let file = |what: &str| if several { format!("{what}-{name}") } else { what.to_owned() };
        if !seen.way.is_empty() {
            files.write(&file("trajectory"), &trajectory(&trail, seen).draw())?;
        }
        if !seen.speed.is_empty() || !seen.commanded.is_empty() {
            files.write(&file("velocity"), &velocity(&trail, seen).draw())?;
        }
        if !seen.scan_points.is_empty() {
            files.write(&file("map"), &map(seen).draw())?;
        }
        for part in &parts {
            let seen = seen.within(part.span);
            let name = file(&part.name);
            match part.is_way {
                true if !seen.way.is_empty() => {
                    files.write(&name, &within(trajectory(&trail, &seen), part).draw())?;
                }
                false if !seen.speed.is_empty() || !seen.commanded.is_empty() => {
                    files.write(&name, &velocity_within(velocity(&trail, &seen), part).draw())?;
                }
                _ => {}
            }
        }
    }
    if let Some(periods) = periods(&trail) {
        files.write("periods", &periods.draw())?;
    }
    if let Some(timing) = timing.filter(|timing| !timing.agents.is_empty()) {
        files.write("timing", &timing.draw())?;
    }
    Ok((files.made, trail.tasks))
}

/// How often agents sent something, what they missed, and when they were suspended.
#[derive(Debug, Default)]
pub(crate) struct Rates {
    /// When each agent sent something (s).
    pub(crate) sent: BTreeMap<String, Vec<f64>>,
    /// When each missed a deadline (s).
    pub(crate) misses: BTreeMap<String, Vec<f64>>,
    /// From when on each was suspended, or was not any more.
    rest: BTreeMap<String, Vec<(f64, bool)>>,
}

impl Rates {
    /// From when to when an agent was suspended, in a run that ended at `end` (s).
    pub(crate) fn suspended_of(&self, agent: &str, end: f64) -> Vec<(f64, f64)> {
        let Some(rest) = self.rest.get(agent) else { return Vec::new() };
        let ends = rest.iter().skip(1).map(|(time, _)| *time).chain([end]);
        let spans = rest.iter().zip(ends).filter(|((_, is), _)| *is);
        spans.map(|((from, _), to)| (*from, to)).collect()
    }
}

/// A task of the reactive layer, as its reports tell.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TaskOutcome {
    pub(crate) task: u32,
    /// When it was over (s).
    pub(crate) at: f64,
    pub(crate) last: Report,
    /// How far the robot truly was from the place then, where the truth is known and the place is one of the map (m).
    pub(crate) off: Option<f64>,
    /// And from its heading, where it has one (rad).
    pub(crate) turned: Option<f64>,
}

/// What a log tells of how often agents ran.
pub(crate) fn rates(log: &Path) -> Result<Rates, String> {
    let mut reader = Reader::open(log).map_err(|error| error.to_string())?;
    let mut trail = Trail::new(&reader.run().cloned().unwrap_or_default());
    while let Some(message) = reader.next_message().map_err(|error| error.to_string())? {
        trail.take(&message);
    }
    let Trail { sent, misses, rest, .. } = trail;
    Ok(Rates { sent, misses, rest })
}

/// Messages of one kind, each with its time (s).
#[cfg(test)]
pub(crate) type Told<T> = Vec<(f64, T)>;

/// Where the only robot of a log truly was.
#[cfg(test)]
pub(crate) fn way(log: &Path) -> Result<Told<types::Pose>, String> {
    let mut reader = Reader::open(log).map_err(|error| error.to_string())?;
    let mut trail = Trail::new(&reader.run().cloned().unwrap_or_default());
    while let Some(message) = reader.next_message().map_err(|error| error.to_string())? {
        trail.take(&message);
    }
    Ok(trail.robots.into_values().next().map(|seen| seen.way).unwrap_or_default())
}

/// What went out of a port in a simulated run; the topic is of the form "/agent/port".
#[cfg(test)]
pub(crate) fn told<T: types::message::Message>(log: &Path, topic: &str) -> Result<Told<T>, String> {
    let mut reader = Reader::open(log).map_err(|error| error.to_string())?;
    let mut told = Vec::new();
    while let Some(message) = reader.next_message().map_err(|error| error.to_string())? {
        if &*message.channel.topic == topic
            && let Some((head, _)) = trail::decode::<T>(&message)
        {
            told.push((message.time.seconds(), head));
        }
    }
    Ok(told)
}

/// The names of the robots of a log.
pub(crate) fn robots(notes: &Notes) -> Vec<String> {
    scenery::robots(notes).into_iter().map(|robot| robot.name).collect()
}

/// Writes one picture in both forms into a folder, which is made; gives the files.
pub(crate) fn write(picture: &Picture, folder: &Path, name: &str) -> Result<Vec<String>, String> {
    std::fs::create_dir_all(folder)
        .map_err(|error| format!("{} cannot be made: {error}", folder.display()))?;
    let mut files = Files { folder, made: Vec::new() };
    files.write(name, picture)?;
    Ok(files.made.iter().map(|file| file.display().to_string()).collect())
}

struct Files<'a> {
    folder: &'a Path,
    made: Vec<PathBuf>,
}

impl Files<'_> {
    /// Writes a picture in both forms.
    fn write(&mut self, name: &str, picture: &Picture) -> Result<(), String> {
        let png = picture.png(DOTS).map_err(|error| error.to_string())?;
        for (ending, bytes) in [("png", png), ("svg", picture.svg().into_bytes())] {
            let path = self.folder.join(format!("{name}.{ending}"));
            std::fs::write(&path, bytes)
                .map_err(|error| format!("{} cannot be written: {error}", path.display()))?;
            self.made.push(path);
        }
        Ok(())
    }
}

fn trajectory(trail: &Trail, seen: &Seen) -> Trajectory {
    let path: Vec<Waypoint> =
        seen.way.iter().map(|(time, pose)| Waypoint { time: *time, pose: *pose }).collect();
    let length = path.last().map_or(0.0, |last| last.time) - path.first().map_or(0.0, |first| first.time);
    let others = trail.people.iter().map(|(name, points)| (name.clone(), points.clone()));
    Trajectory {
        drawing: trail.drawing.clone(),
        path,
        bands: trail.bands(),
        points: thinned(&seen.points.points),
        points_name: seen.points_name.to_owned(),
        radius: trail.radius(&seen.name),
        outline: trail.outline(&seen.name),
        outline_every: (length / 100.0).ceil() * 5.0,
        goal: None,
        events: trail.events.clone(),
        others: others.collect(),
    }
}

/// The same with what happened in a part of the run alone.
fn within(all: Trajectory, part: &Part) -> Trajectory {
    let (bands, events) = of_part(&all.bands, &all.events, part);
    let seconds = part.span.1 - part.span.0;
    // What was seen in the whole run shows the room, not the part.
    Trajectory { bands, events, points: Vec::new(), outline_every: (seconds / 40.0).ceil() * 2.0, ..all }
}

fn velocity_within(all: Velocity, part: &Part) -> Velocity {
    let (bands, events) = of_part(&all.bands, &all.events, part);
    Velocity { bands, events, ..all }
}

fn of_part(bands: &[Band], events: &[Event], part: &Part) -> (Vec<Band>, Vec<Event>) {
    let (from, until) = part.span;
    let cut = |band: &Band| Band { from: band.from.max(from), to: band.to.min(until), ..band.clone() };
    let bands = bands.iter().filter(|band| band.to > from && band.from < until).map(cut).collect();
    let is_part = |event: &&Event| (from..=until).contains(&event.time);
    (bands, events.iter().filter(is_part).cloned().collect())
}

/// Every so many of the points, so that they show where things are and leave the rest to be seen.
fn thinned(points: &[Point]) -> Vec<Point> {
    points.iter().step_by(points.len().div_ceil(trail::SHOWN_POINTS).max(1)).copied().collect()
}

fn velocity(trail: &Trail, seen: &Seen) -> Velocity {
    let pick = |name: &str, rows: &[(f64, f64, f64)], which: usize| Series {
        name: name.to_owned(),
        points: rows.iter().map(|row| (row.0, if which == 1 { row.1 } else { row.2 })).collect(),
    };
    let both = |which| {
        let rows = [("measured", &seen.speed), ("commanded", &seen.commanded)];
        rows.into_iter()
            .filter(|(_, rows)| !rows.is_empty())
            .map(|(name, rows)| pick(name, rows, which))
            .collect()
    };
    let heading = [&seen.way, &seen.log_way, &seen.odometry].into_iter().find(|way| !way.is_empty());
    let heading = heading.into_iter().flatten();
    let heading = Series {
        name: "measured".into(),
        points: heading.map(|(time, pose)| (*time, pose.heading)).collect(),
    };
    Velocity {
        speed: both(1),
        angular_speed: both(2),
        heading: vec![heading],
        bands: trail.bands(),
        events: trail.events.clone(),
    }
}

/// The ways of a recording, as the log has it and by odometry, and where the laser saw something from there.
fn map(seen: &Seen) -> Map {
    let points =
        |way: &[(f64, types::Pose)]| way.iter().map(|(_, pose)| pose.position()).collect::<Vec<Point>>();
    let ways = [("the log's own poses", &seen.log_way), ("odometry", &seen.odometry)];
    let known = ways.into_iter().filter(|(_, way)| !way.is_empty());
    let paths = known.map(|(name, way)| (name.to_owned(), points(way))).collect();
    Map { points: seen.scan_points.points.clone(), points_name: "laser".into(), paths, ..Map::default() }
}

/// When each agent sent something, in the middle of the run.
fn periods(trail: &Trail) -> Option<Periods> {
    let (from, to) = trail.span?;
    let middle = from + (to - from) / 2.0;
    let window = (middle, (middle + WINDOW).min(to));
    let mut rows: BTreeMap<&str, record::figure::PeriodRow> = BTreeMap::new();
    for (name, times) in &trail.sent {
        let row = rows.entry(name).or_default();
        row.name = name.clone();
        row.releases = times.iter().copied().filter(|time| (window.0..=window.1).contains(time)).collect();
    }
    let rows: Vec<_> = rows.into_values().filter(|row| !row.releases.is_empty()).collect();
    (!rows.is_empty()).then_some(Periods { rows, window: Some(window) })
}

/// The histograms of each agent's steps, with the counts. An agent that never ran has no row.
pub(crate) fn timing(agents: &[AgentView]) -> Timing {
    let seconds = |nanos: f64| nanos * 1e-9;
    let classes = |steps: &[(f64, u32)]| -> Vec<(f64, u64)> {
        steps.iter().map(|(nanos, count)| (seconds(*nanos), u64::from(*count))).collect()
    };
    let ran = agents.iter().filter(|agent| !agent.exec_steps.is_empty());
    let rows = ran.map(|agent| AgentTiming {
        name: agent.name.clone(),
        execution: classes(&agent.exec_steps),
        jitter: classes(&agent.jitter_steps),
        execution_max: Some(seconds(agent.exec.max)),
        jitter_max: Some(seconds(agent.jitter.max)),
        deadline: Some(agent.deadline.seconds()),
        misses: agent.counts.missed,
        releases: agent.counts.releases,
    });
    Timing { agents: rows.collect() }
}

/// The notes of a log that figures are made from, and nothing that differs between two runs of the same seed.
pub(crate) type Notes = BTreeMap<String, String>;
