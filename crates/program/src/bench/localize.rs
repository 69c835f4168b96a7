//! Five real robots among coded landmarks: how far what the localizer believes is from where they truly were.
//!
//! Estimators begin at the first true pose, hear what wheels and cameras tell in the order of its stamps and never earlier, and
//! are asked at each time of the truth. The same parameters serve all robots. Without a recording there are made ones ([`made`]).

mod drive;
mod made;
mod open;

use std::hint::black_box;
use std::path::{Path, PathBuf};

use hardware::mrclam::Team;
use motion::odometry::Increment;
use navigation::localisation::landmarks::Landmark;
use navigation::localisation::landmarks::{Filter, Parameters, Sighting};
use record::figure::{Drawing, Map};
use serde_json::json;
use types::{Point, Pose};

use super::Setting;
use super::outcome::{Outcome, median};
use crate::error::Failure;
use crate::terminal::host_now;
use drive::{Setup, Track, drive};

/// How often a step of the filter is measured.
const STEPS: usize = 20_000;
/// A recording that was made is so long (s).
const LENGTH: usize = 300;

pub(super) fn measure(setting: &Setting<'_>) -> Result<Outcome, Failure> {
    let mut outcome = Outcome::default();
    let team = match open::find(setting.data.as_deref())? {
        Some((path, team)) => {
            outcome.note(format!("recorded: {}", path.display()));
            team
        }
        None => {
            outcome.note("made: there is no recording here; --data names a folder or an archive with one");
            made::team(1, setting.of(LENGTH, 20) as f64)
        }
    };
    let together = drive(&team, &Setup::default())?;
    let alone = drive(&team, &Setup { alone: true, ..Setup::default() })?;
    let nameless = drive(&team, &Setup { nameless: true, ..Setup::default() })?;
    tell(&mut outcome, [&together, &alone, &nameless]);
    let steps = setting.of(STEPS, 20);
    outcome.figure("ekf_step", "ns", steps_of(steps));
    if let Some(folder) = &setting.out {
        for track in &together {
            let file = draw(&team, track, folder)?;
            outcome.note(format!("drawn: {file}"));
        }
    }
    Ok(outcome)
}

/// The rows of all robots, for programs and for people.
fn tell(outcome: &mut Outcome, [together, alone, nameless]: [&Vec<Track>; 3]) {
    let mut rows = vec![
        [
            "robot",
            "rmse m",
            "first half",
            "second",
            "alone",
            "nameless",
            "dead reckoning",
            "heading rad",
            "sights",
            "outliers",
            "times real time",
        ]
        .map(str::to_owned),
    ];
    let mut robots = Vec::new();
    for ((track, alone), nameless) in together.iter().zip(alone).zip(nameless) {
        let metres = |x: f64| format!("{x:.3}");
        rows.push([
            track.name.clone(),
            metres(track.rmse),
            metres(track.halves[0]),
            metres(track.halves[1]),
            metres(alone.rmse),
            metres(nameless.rmse),
            metres(track.dead_reckoning),
            metres(track.heading),
            track.sights.to_string(),
            track.outliers.to_string(),
            format!("{:.0}", track.times_real_time),
        ]);
        robots.push(json!({
            "robot": track.name,
            "rmse_m": track.rmse,
            "dead_reckoning_m": track.dead_reckoning,
            "times_real_time": track.times_real_time,
            "halves_m": track.halves,
            "alone_m": alone.rmse,
            "nameless_m": nameless.rmse,
            "heading_rad": track.heading,
            "sights": track.sights,
            "outliers": track.outliers,
        }));
    }
    let mean = |tracks: &[Track]| tracks.iter().map(|track| track.rmse).sum::<f64>() / tracks.len() as f64;
    outcome.note(format!(
        "mean of the robots {:.3} m, {:.3} m without sightings between robots, {:.3} m when landmarks do not say which they are",
        mean(together),
        mean(alone),
        mean(nameless)
    ));
    outcome.text(crate::run::table(&rows, 1));
    outcome.add("localize", json!(robots));
    let times: Vec<f64> = together.iter().map(|track| track.times_real_time).collect();
    outcome.note(format!(
        "times real time: of all robots together, {:.0} in the middle; the goal is 100",
        median(times)
    ));
}

/// How long a step of the filter takes (ns).
fn steps_of(steps: usize) -> Vec<f64> {
    let mut step = step_of_filter();
    let timed = |_| {
        let begin = host_now();
        step();
        begin.elapsed().as_nanos() as f64
    };
    (0..steps).map(timed).collect()
}

/// Steps of the wheels, each with a sighting of another landmark.
pub(super) fn step_of_filter() -> impl FnMut() {
    let parameters = Parameters::default();
    let mut filter =
        Filter::new(&parameters, Pose::default(), [[0.01, 0.0, 0.0], [0.0, 0.01, 0.0], [0.0, 0.0, 0.01]]);
    let places = [Point::new(3.0, 1.0), Point::new(-2.0, 2.0), Point::new(0.5, -3.0)].map(Landmark::exact);
    let mut step = 0;
    move || {
        let landmark = &places[step % places.len()];
        let seen = Sighting { range: 2.0 + 0.1 * (step % 7) as f64, bearing: 0.3 };
        filter.predict(&parameters, Increment { distance: 0.01, turn: 0.002 }, 0.05);
        black_box(filter.correct(&parameters, &landmark.seen(seen)));
        step += 1;
    }
}

fn draw(team: &Team, track: &Track, folder: &Path) -> Result<String, Failure> {
    let label = |at: Point, subject: u32| (Point::new(at.x, at.y + 0.12), subject.to_string());
    let map = Map {
        drawing: Drawing {
            circles: team.landmarks.iter().map(|mark| (mark.at, 0.05)).collect(),
            labels: team.landmarks.iter().map(|mark| label(mark.at, mark.subject)).collect(),
            ..Drawing::default()
        },
        paths: vec![
            ("truth".to_owned(), track.truth.clone()),
            ("believed".to_owned(), track.believed.clone()),
            ("dead reckoning".to_owned(), track.reckoned.clone()),
        ],
        ..Map::default()
    };
    let cannot = |why: String| Failure::new(why).code(1);
    std::fs::create_dir_all(folder)
        .map_err(|error| cannot(format!("{} cannot be made: {error}", folder.display())))?;
    crate::figures::write(&map.draw(), folder, &track.name).map(|files| files.join(", ")).map_err(cannot)
}

/// Where recordings are: what is named, else the folder of data of this machine.
fn folder(named: Option<&Path>) -> Option<PathBuf> {
    named.map(Path::to_path_buf).or_else(|| Some(super::data()?.join("mrclam")))
}

#[cfg(test)]
mod tests;
