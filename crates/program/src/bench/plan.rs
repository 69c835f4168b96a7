//! Ways over maps: every planner beside A* of the crate `pathfinding`, on the same queries in the same run.
//!
//! | to find | look in |
//! |---|---|
//! | which maps and queries | [`maps`], [`own`] |
//! | how each answers, and what is timed | [`contender`] |
//! | the rounds in which they take turns, and what comes of them | [`rounds`] |
//! | the other system | [`peer`] |
//! | what is planned anew after a change | [`anew`] |
//! | the picture | [`picture`] |

mod anew;
mod contender;
mod maps;
mod own;
mod peer;
mod picture;
mod rounds;

use std::path::PathBuf;

use clap::Args;
use navigation::path::{Cell, Grid};
use serde_json::json;

use super::Setting;
use super::outcome::{Outcome, median};
use crate::error::Failure;
use rounds::{Answers, Row};

/// What only this measurement can be told.
#[derive(Args, Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct PlanArgs {
    /// plan: a folder with maps of the MovingAI benchmarks, as files .map or packed as .tar.xz; without it own maps are made.
    #[arg(long, value_name = "DIR")]
    pub(super) maps: Option<PathBuf>,
    /// plan: queries over these maps; without it all files .scen of the folder, and if there are none, queries of chance.
    #[arg(long, value_name = "FILE")]
    pub(super) scen: Option<PathBuf>,
    /// plan: where to put the picture of the potential (PNG); without it the folder for temporary files.
    #[arg(long, value_name = "FILE")]
    pub(super) picture: Option<PathBuf>,
}

/// Rounds in which all take turns.
const ROUNDS: usize = 5;
/// Lengths that differ by no more are the same (sides of a cell): the files have eight digits.
const SAME: f64 = 1e-4;

/// A map with its queries.
struct Floor {
    name: String,
    grid: Grid,
    queries: Vec<Query>,
}

/// From where to where, and how long the shortest way is (sides of a cell); none where there is none.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Query {
    start: Cell,
    goal: Cell,
    length: Option<f64>,
}

pub(super) fn measure(setting: &Setting<'_>) -> Result<Outcome, Failure> {
    let args = &setting.plan;
    let floors = match &args.maps {
        Some(folder) => maps::read(folder, args.scen.as_deref())?,
        None if args.scen.is_some() => {
            let failure = Failure::new("--scen names queries, but nothing says where their maps are");
            return Err(failure.help("name the folder of the maps: --maps DIR"));
        }
        None => own::floors(setting.shorter),
    };
    let picture = args.picture.clone().unwrap_or_else(|| std::env::temp_dir().join("sinew-bench-plan.png"));
    // Whoever cannot be given a picture is told before minutes have gone by.
    let drawn = picture::write(&floors, &picture)?;
    let answers = rounds::all(&floors, setting.of(ROUNDS, 1));
    let mut outcome = Outcome::default();
    outcome.text(crate::run::table(&rounds::table(&answers), 1));
    if floors.len() > 1 {
        outcome.text(crate::run::table(&rounds::maps(&floors, &answers), 1));
    }
    let (exact, field) = (answers.row(contender::EXACT), answers.row(contender::FIELD));
    for row in &answers.rows {
        outcome.figure(row.name, "us", row.spans());
    }
    outcome.figure("field_first", "us", field.firsts());
    anew::measure(&floors, &mut outcome);
    outcome.compare("plan/pathfinding", answers.rounds_of(exact));
    outcome.add("plan", document(&answers, exact, field));
    notes(&floors, &answers, &mut outcome);
    outcome.note(drawn);
    Ok(outcome)
}

/// The figures for programs.
fn document(answers: &Answers, exact: &Row, field: &Row) -> serde_json::Value {
    json!({
        "queries": answers.with_a_way(),
        "found": exact.found().min(field.found()),
        "exact_right": exact.right(),
        "exact_ratio": median(exact.speed_ups(answers.peer())),
        "field_first_ratio": median(field.first_speed_ups(answers.peer())),
        "field_optimal": field.optimal_share(answers.peer()),
        "without_a_way": answers.without_a_way(),
        "without_a_way_right": answers.rows.iter().map(Row::refused).min(),
    })
}

/// What the figures are of.
fn notes(floors: &[Floor], answers: &Answers, outcome: &mut Outcome) {
    let names: Vec<&str> = floors.iter().map(|floor| floor.name.as_str()).take(6).collect();
    let more = if floors.len() > names.len() { ", …" } else { "" };
    outcome.note(format!("maps: {} ({}{more})", floors.len(), names.join(", ")));
    outcome.note("all that a planner does from the bits of a map on is timed, each query for itself; the medians are over the queries, a query is the median of its rounds");
    outcome.note("pathfinding: its A* over numbers of cells with the octile distance, whole costs, neighbours in an array, and the map as an array of bytes made beforehand");
    let without = answers.without_a_way();
    if without > 0 {
        let right = answers.rows.iter().map(Row::refused).min().unwrap_or(0);
        outcome.note(format!("of {without} more queries there is no way: said by all planners of {right}"));
    }
}

#[cfg(test)]
mod tests;
