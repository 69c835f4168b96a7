//! `sinew calibrate`: from measurements of a robot to what it must know of itself.

mod landmark;
mod odometry;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Subcommand};
use serde_json::Value as Json;
use types::value::{Entry, Mistake, Span, Table, TableReader};

use crate::error::Failure;
use crate::file::{Mistakes, Sources, tree};
use crate::terminal;

/// What can be calibrated.
#[derive(Debug, Subcommand)]
pub(crate) enum CalibrateCommand {
    /// Radii of the wheels and the track, from squares driven both ways around (UMBmark), from stretches, or from both.
    Odometry(Samples),
    /// The distance of a two-coloured tube by how far apart its colours are in the picture.
    Landmark(Samples),
}

/// Where the measurements are.
#[derive(Args, Debug)]
pub(crate) struct Samples {
    /// The measurements in TOML; docs/calibration has an example of each kind.
    #[arg(value_name = "FILE")]
    file: PathBuf,
}

/// What a fit says, for people and for programs.
#[derive(Debug)]
struct Answer {
    text: String,
    json: Json,
}

/// Fits, and prints parameters that can be pasted, and what is left over.
pub(crate) fn calibrate(command: &CalibrateCommand, json: bool) -> Result<ExitCode, Failure> {
    let answer = match command {
        CalibrateCommand::Odometry(samples) => odometry::fit(&Read::open(&samples.file)?)?,
        CalibrateCommand::Landmark(samples) => landmark::fit(&Read::open(&samples.file)?)?,
    };
    if json {
        terminal::say_json(&answer.json)
    } else {
        terminal::say(&answer.text)
    }
    Ok(ExitCode::SUCCESS)
}

/// A file of measurements.
struct Read {
    sources: Sources,
    tree: Table,
}

impl Read {
    fn open(file: &Path) -> Result<Read, Failure> {
        let cannot = |error| Failure::new(format!("{} cannot be read: {error}", file.display()));
        let text = std::fs::read_to_string(file).map_err(cannot)?;
        Read::parse(&file.display().to_string(), &text)
    }

    fn parse(name: &str, text: &str) -> Result<Read, Failure> {
        let mut sources = Sources::default();
        let base = sources.add(name, text);
        let mut list = Vec::new();
        match tree::read(&sources, base, &mut list) {
            Some(tree) if list.is_empty() => Ok(Read { sources, tree }),
            _ => Err(Mistakes { sources, list }.into()),
        }
    }

    /// All that is wrong with a file that was read, in its order.
    fn wrong(&self, mut list: Vec<Mistake>) -> Failure {
        list.sort_by_key(|mistake| mistake.at.start);
        Mistakes { sources: self.sources.clone(), list }.into()
    }
}

/// A number that must be there and be greater than zero.
fn length(r: &mut TableReader<'_>, key: &str, wanted: &str) -> Option<f64> {
    let number = number(r, key, wanted)?;
    if number > 0.0 {
        return Some(number);
    }
    r.report(Mistake::new(r.place(key), format!("\"{key}\" is {number}, it must be greater than zero")));
    None
}

/// A number that must be there.
fn number(r: &mut TableReader<'_>, key: &str, wanted: &str) -> Option<f64> {
    if r.entry(key).is_none() {
        r.missing(key, wanted);
    }
    let number = r.float(key)?;
    if number.is_finite() {
        return Some(number);
    }
    r.report(Mistake::new(r.place(key), format!("\"{key}\" is {number}, which is no number to reckon with")));
    None
}

/// Pairs of numbers with their places.
fn pairs(r: &mut TableReader<'_>, key: &str, wanted: &str) -> Vec<([f64; 2], Span)> {
    let Some(entry) = r.entry(key) else {
        r.missing(key, wanted);
        return Vec::new();
    };
    let pair = |entry: &Entry| {
        let [a, b] = entry.value.as_list()? else { return None };
        let number = |entry: &Entry| entry.value.as_float().filter(|number| number.is_finite());
        Some(([number(a)?, number(b)?], entry.at))
    };
    let Some(list) = entry.value.as_list() else {
        let what = format!("\"{key}\" must be a list of pairs, not {}", entry.value.kind());
        r.report(Mistake::new(entry.at, what));
        return Vec::new();
    };
    let mut found = Vec::new();
    for entry in list {
        match pair(entry) {
            Some(pair) => found.push(pair),
            None => {
                let what = format!("a row of \"{key}\" must be two numbers, not {}", entry.value);
                r.report(Mistake::new(entry.at, what));
            }
        }
    }
    found
}
