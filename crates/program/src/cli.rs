//! The command line: what can be said, and who does it.

use std::path::PathBuf;
use std::process::ExitCode;
use std::str::FromStr;

use clap::error::ErrorKind;
use clap::{Args, Parser, Subcommand, ValueEnum};
use runtime::Registry;
use types::Duration;

use crate::error::Failure;
use crate::{analyze, bench, calibrate, know, live, log, run, terminal, tools};

/// Many agents, one robot, in time: runs systems of agents on robots, in simulation and on recorded data.
///
/// To begin: sinew run exploration
#[derive(Debug, Parser)]
#[command(name = "sinew", version, max_term_width = 100, disable_help_subcommand = true)]
struct Line {
    /// Prints one JSON document, and nothing else, to standard output.
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Runs a system until its goal is met, the time is over, or Ctrl-C.
    Run(Box<RunArgs>),
    #[command(flatten)]
    Live(live::LiveCommand),
    /// Finds all mistakes of a system file without running it.
    Check(tools::CheckArgs),
    /// Says whether all deadlines are met, and with how much room: exact tests, a schedule as a picture.
    Analyze(analyze::AnalyzeArgs),
    /// Prints the JSON schema of system files, for editors.
    Schema,
    /// Looks into logs, draws them, plays them, mends them.
    #[command(subcommand)]
    Log(log::LogCommand),
    /// What is known from one run to the next: decision tables, facts, patterns, schedules, maps.
    Know(know::KnowArgs),
    /// Fits what a robot must know of itself to measurements: its wheels, distances in its picture.
    #[command(subcommand)]
    Calibrate(calibrate::CalibrateCommand),
    /// Writes a template that builds, runs and has a test.
    #[command(subcommand)]
    New(tools::NewCommand),
    /// Says whether this machine can do real time, what is missing, and how to mend it.
    Doctor,
    /// Measures; "sinew bench list" says what.
    Bench(bench::BenchArgs),
    /// Takes a share of a processor, as a process that has nothing to do with the run that it burdens.
    #[command(hide = true)]
    Burden(run::BurdenArgs),
}

/// What `sinew run` can be told.
#[derive(Args, Clone, Debug)]
pub(crate) struct RunArgs {
    /// A built-in scenario, or a system file.
    #[arg(value_name = "NAME|FILE")]
    pub(crate) system: String,
    /// The clock; simulated when every robot is simulated or recorded, else the wall's.
    #[arg(long, value_enum)]
    pub(crate) clock: Option<ClockChoice>,
    /// How many times as fast as real time: a number, or max. 10 on a terminal, else max.
    #[arg(long, value_name = "N|max")]
    pub(crate) speed: Option<Speed>,
    /// In simulated time, lets each step take the cost that the file declares, on so many virtual processors; else steps take no time.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=64))]
    pub(crate) processors: Option<u8>,
    /// Begins also where the analysis says that deadlines will be missed; the summary tells.
    #[arg(long)]
    pub(crate) force: bool,
    /// How long at most, as in 300s; else as long as the goal gives.
    #[arg(long = "for", value_name = "TIME", value_parser = duration)]
    pub(crate) limit: Option<Duration>,
    /// Ends a simulated run in which no robot has moved for so long, as in 60s: it has given up.
    #[arg(long, value_name = "TIME", value_parser = duration)]
    pub(crate) give_up: Option<Duration>,
    /// What the draws of [vary] and all noise come from.
    #[arg(long, value_name = "N", default_value_t = 1, conflicts_with = "seeds")]
    pub(crate) seed: u64,
    /// Many runs on all cores, with a table; no logs and figures unless --out is given.
    #[arg(long, value_name = "A..B")]
    pub(crate) seeds: Option<Seeds>,
    /// Changes an entry of the plan, as in agent.wall.keep=0.6; may be given several times.
    #[arg(long, value_name = "KEY=VALUE")]
    pub(crate) set: Vec<String>,
    /// Runs only these agents, and the wires between them.
    #[arg(long, value_name = "AGENTS", value_delimiter = ',')]
    pub(crate) only: Vec<String>,
    /// The knowledge base that the run reads, in the place of the one of the section [knowledge]; made where it is not there.
    #[arg(long, value_name = "F.db")]
    pub(crate) know: Option<PathBuf>,
    /// The file of a recorded robot, for the scenario "recorded": a CARMEN log, wheel counts, or our own .mcap.
    #[arg(long, value_name = "FILE")]
    pub(crate) from: Option<PathBuf>,
    /// The worlds of the scenario "barn", one a line; else generated ones.
    #[arg(long, value_name = "FILE")]
    pub(crate) worlds: Option<PathBuf>,
    /// The robot of the scenario "barn".
    #[arg(long, value_enum)]
    pub(crate) robot: Option<Shaped>,
    /// The log of a simulated run: runs it again with its seed and all that was asked in it while it went, and says whether the
    /// bytes are the same. Other options are to be those of that run.
    #[arg(long, value_name = "F.mcap", conflicts_with_all = ["seed", "seeds", "from"])]
    pub(crate) repeat: Option<PathBuf>,
    /// Where the log goes; else DIR/run.mcap.
    #[arg(long, value_name = "F.mcap", conflicts_with = "no_log")]
    pub(crate) log: Option<PathBuf>,
    /// Leaves out what the file asks for while it runs, its goal and its figures of that: all is asked for by you, as with sinew call.
    #[arg(long)]
    pub(crate) no_script: bool,
    /// Runs once, where the file has several runs to be compared.
    #[arg(long)]
    pub(crate) alone: bool,
    /// Writes no log, and so draws no figures.
    #[arg(long)]
    pub(crate) no_log: bool,
    /// How many camera pictures a second go into the log.
    #[arg(long, value_name = "HZ", default_value_t = 1.0, value_parser = rate)]
    pub(crate) images: f64,
    /// The folder for log and figures; else out/NAME-seedN.
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Serves the web page at this address.
    #[arg(long, value_name = "ADDR", conflicts_with = "no_web")]
    pub(crate) web: Option<String>,
    /// Serves no web page.
    #[arg(long)]
    pub(crate) no_web: bool,
}

/// Which clock a run keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ClockChoice {
    /// Real time.
    Wall,
    /// Simulated time.
    Sim,
}

/// Which outline a robot has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Shaped {
    /// Rectangular: 0.508 m by 0.43 m.
    #[default]
    Rectangular,
    /// Round: 0.68 m across.
    Round,
}

/// How fast simulated time goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Speed {
    /// So many times as fast as real time.
    Times(f64),
    /// As fast as it goes.
    Most,
}

impl FromStr for Speed {
    type Err = String;

    fn from_str(text: &str) -> Result<Speed, String> {
        match text.parse::<f64>() {
            _ if text == "max" => Ok(Speed::Most),
            Ok(times) if times > 0.0 && times.is_finite() => Ok(Speed::Times(times)),
            _ => Err("it is a number greater than zero, or \"max\"".into()),
        }
    }
}

/// Seeds from one to another, both included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Seeds {
    /// The first.
    pub(crate) first: u64,
    /// The last.
    pub(crate) last: u64,
}

/// More runs at once than anybody waits for.
const MOST_SEEDS: u64 = 1_000_000;

impl FromStr for Seeds {
    type Err = String;

    fn from_str(text: &str) -> Result<Seeds, String> {
        let form = || "it is two whole numbers as in 1..100, both included".to_owned();
        let (first, last) = text.split_once("..").ok_or_else(form)?;
        let number = |text: &str| text.trim_start_matches('=').trim().parse::<u64>().map_err(|_| form());
        let (first, last) = (number(first)?, number(last)?);
        if last < first {
            return Err(format!("{last} comes before {first}"));
        }
        if last - first >= MOST_SEEDS {
            return Err(format!("that is more than {MOST_SEEDS} runs"));
        }
        Ok(Seeds { first, last })
    }
}

/// A span of time as files have it.
pub(crate) fn duration(text: &str) -> Result<Duration, String> {
    match text.parse::<Duration>() {
        Ok(span) if span > Duration::ZERO => Ok(span),
        Ok(_) => Err("it must be longer than nothing".into()),
        Err(_) => Err("a time is a number with a unit, as in 300s, 250ms or 5min".into()),
    }
}

fn rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(rate) if (0.0..=1000.0).contains(&rate) => Ok(rate),
        _ => Err("it is a number from 0 to 1000".into()),
    }
}

/// The whole program, with these agents beside the ready-made ones.
///
/// ```no_run
/// use program::program;
/// use runtime::Registry;
///
/// fn main() -> std::process::ExitCode {
///     program(Registry::default())
/// }
/// ```
pub fn program(registry: Registry) -> ExitCode {
    let wants_json = std::env::args().any(|word| word == "--json");
    let line = match Line::try_parse() {
        Ok(line) => line,
        Err(error) => return not_understood(&error, wants_json),
    };
    let mut all = agents::registry();
    all.extend(registry.types().iter().cloned());
    match done(line.command, all, line.json) {
        Ok(code) => code,
        Err(failure) => failure.print(line.json),
    }
}

fn done(command: Command, registry: Registry, json: bool) -> Result<ExitCode, Failure> {
    match command {
        Command::Run(args) => run::run(&args, registry, json),
        Command::Live(command) => live::live(command, json),
        Command::Check(args) => tools::check(&args, &registry, json),
        Command::Analyze(args) => analyze::analyze(&args, &registry, json),
        Command::Schema => Ok(tools::print_schema(&registry)),
        Command::Log(command) => log::log(command, json),
        Command::Know(args) => know::know(&args, json),
        Command::Calibrate(command) => calibrate::calibrate(&command, json),
        Command::New(command) => tools::make(&command, json),
        Command::Doctor => Ok(tools::examine(json)),
        Command::Burden(args) => run::burden(&args),
        Command::Bench(args) => bench::bench(&args, &registry, json),
    }
}

/// Does what is typed behind the name of the program.
#[cfg(test)]
pub(crate) fn typed(words: &[&str]) -> Result<ExitCode, Failure> {
    let line = Line::try_parse_from(["sinew"].iter().chain(words));
    let line = line.map_err(|error| Failure::new(error.to_string()))?;
    done(line.command, agents::registry(), line.json)
}

/// What is typed behind `sinew`, beginning with "run", as a run is told it.
#[cfg(test)]
pub(crate) fn run_args(words: &[&str]) -> RunArgs {
    let line = Line::try_parse_from(["sinew"].iter().chain(words)).unwrap_or_else(|error| panic!("{error}"));
    match line.command {
        Command::Run(args) => *args,
        _ => panic!("{words:?} is no run"),
    }
}

/// Help and versions are answers; everything else is wrong usage.
fn not_understood(error: &clap::Error, json: bool) -> ExitCode {
    if matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) {
        terminal::say(&if terminal::coloured() {
            error.render().ansi().to_string()
        } else {
            error.render().to_string()
        });
        return ExitCode::SUCCESS;
    }
    if error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand && !json {
        terminal::tell(error.render().to_string().trim_end());
        return ExitCode::from(2);
    }
    let text = error.render().to_string();
    let text = text.trim_start_matches("error: ");
    let (what, rest) = text.split_once("\n\n").unwrap_or((text, ""));
    let tips = rest.lines().map(str::trim).filter(|line| !line.is_empty());
    let help: Vec<&str> = tips.map(|line| line.trim_start_matches("tip: ")).collect();
    let mut failure = Failure::new(what.split_whitespace().collect::<Vec<_>>().join(" "));
    if !help.is_empty() {
        failure = failure.help(help.join("; "));
    }
    failure.print(json)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory as _;

    #[test]
    fn the_command_line_is_consistent() {
        Line::command().debug_assert();
    }

    #[test]
    fn seeds_and_speeds_are_read_or_refused_with_the_right_form() {
        assert_eq!("1..100".parse(), Ok(Seeds { first: 1, last: 100 }));
        assert_eq!("7..=7".parse(), Ok(Seeds { first: 7, last: 7 }));
        assert!("5".parse::<Seeds>().unwrap_err().contains("1..100"));
        assert!("5..2".parse::<Seeds>().unwrap_err().contains("before"));
        assert!("0..99999999".parse::<Seeds>().unwrap_err().contains("more than"));
        assert_eq!("max".parse(), Ok(Speed::Most));
        assert_eq!("2.5".parse(), Ok(Speed::Times(2.5)));
        assert!(["0", "-1", "fast", "inf"].iter().all(|word| word.parse::<Speed>().is_err()));
        assert!(duration("300").is_err() && duration("0s").is_err());
        assert_eq!(duration("5min"), Ok(Duration::secs(300)));
    }
}
