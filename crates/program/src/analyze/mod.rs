//! `sinew analyze`: does it meet its deadlines, and with how much room?

mod paper;
mod report;
mod set;
mod system;
mod tasks;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use record::figure::{PeriodRow, Periods};
use runtime::Registry;
use schedule::simulate::Schedule;
use types::Duration;

use self::report::Report;
use crate::error::Failure;
use crate::file::Shelf;
use crate::{cli, figures, terminal};

/// What `sinew analyze` can be told.
#[derive(Args, Debug)]
pub(crate) struct AnalyzeArgs {
    /// A system file, a built-in scenario, or a bare task set: rows of [[task]] with name, wcet, period, and where needed deadline, jitter,
    /// blocking and processor.
    #[arg(value_name = "FILE|NAME", required_unless_present = "paper", conflicts_with = "paper")]
    system: Option<String>,
    /// Takes the execution times from a run: its log with timing.json beside it, or that file.
    #[arg(long, value_name = "run.mcap")]
    from: Option<PathBuf>,
    /// Changes an entry of a system file first, as in agent.wall.period=100ms.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// So many processors. Tasks of a set that name none go to the first on which all meet their deadlines; a system is played on them.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=64))]
    processors: u8,
    /// For a system: plays it so long in simulated time, where its steps take their execution times, and shows the longest responses.
    #[arg(long, value_name = "TIME", value_parser = cli::duration)]
    play: Option<Duration>,
    /// For a task set: how much of a schedule the picture shows; else some 25 of the shortest periods.
    #[arg(long = "for", value_name = "TIME", value_parser = cli::duration)]
    length: Option<Duration>,
    /// For a task set: the picture shows the earliest deadline going first.
    #[arg(long)]
    edf: bool,
    /// The folder for the picture; else out/NAME-analysis.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Draws nothing.
    #[arg(long, conflicts_with = "out")]
    no_picture: bool,
    /// The six tasks of the competition robot's paper (Table III): its figures beside ours.
    #[arg(long)]
    paper: bool,
}

/// Analyses it. The exit code is 1 when a deadline is missed.
pub(crate) fn analyze(args: &AnalyzeArgs, registry: &Registry, json: bool) -> Result<ExitCode, Failure> {
    let Some(name) = &args.system else { return paper::paper(args, json) };
    let report = match task_set(name)? {
        Some(_) if args.play.is_some() => {
            return Err(Failure::new(format!("--play is for systems; {name} is a bare task set"))
                .help("its picture shows its schedule"));
        }
        Some((text, file)) => set::analyse(&tasks::read(&text, &file)?, args)?,
        None => system::analyse(name, args, registry)?,
    };
    tell(&report, json);
    Ok(if report.pass() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The text of a file that is a bare task set.
fn task_set(name: &str) -> Result<Option<(String, String)>, Failure> {
    // What is wrong with a name is told by whoever reads systems.
    let found = Shelf::Scenarios.find(name, Path::new(""));
    Ok(found.ok().filter(|found| tasks::is_set(&found.text)).map(|found| (found.text, found.name)))
}

fn tell(report: &Report, json: bool) {
    if json { terminal::say_json(&report.to_json()) } else { terminal::say(&report.to_text()) }
}

/// Draws a schedule, a row for each of these names.
fn draw(schedule: &Schedule, names: &[String], folder: &Path) -> Result<Vec<String>, Failure> {
    let time = |ticks| schedule.seconds(ticks);
    let rows = names.iter().enumerate().map(|(task, name)| {
        let jobs = schedule.jobs.iter().filter(|job| job.task == task);
        let missed = jobs.clone().filter(|job| job.missed(schedule.length));
        PeriodRow {
            name: name.clone(),
            releases: jobs.map(|job| time(job.ready)).collect(),
            steps: schedule
                .pieces
                .iter()
                .filter(|piece| piece.task == task)
                .map(|piece| (time(piece.from), time(piece.to)))
                .collect(),
            misses: missed.map(|job| time(job.deadline)).collect(),
        }
    });
    let picture = Periods { rows: rows.collect(), window: Some((0.0, time(schedule.length))) }.draw();
    figures::write(&picture, folder, "schedule").map_err(Failure::new)
}

/// Where the picture goes; nothing when there shall be none.
fn folder(args: &AnalyzeArgs, name: &str) -> Option<PathBuf> {
    let usual = || Path::new("out").join(format!("{name}-analysis"));
    (!args.no_picture).then(|| args.out.clone().unwrap_or_else(usual))
}
