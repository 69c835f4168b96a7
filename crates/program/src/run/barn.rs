//! `sinew run barn`: one run in each world of BARN, on all cores, with the whole system and the rules of the benchmark.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use record::figure::{Drawing, Panel, Sheet};
use serde_json::{Value as Json, json};
use sim::barn::{self, World};
use types::value::{Entry, Span, Table, Value};
use types::{Point, Time};

use super::judge::{Facts, What};
use super::prepare::Scenario;
use super::summary::{Summary, table};
use super::{One, Place, many, options};
use crate::cli::{RunArgs, Seeds, Shaped};
use crate::error::{Failure, Place as At, Problem};
use crate::{figures, terminal};

/// The scenario.
const NAME: &str = "barn";
/// How many worlds are generated when nobody says which.
const WORLDS: Seeds = Seeds { first: 1, last: 100 };
/// What is aimed at: shares of the worlds, and the mean score.
const SUCCESS: f64 = 0.95;
const METRIC: f64 = 0.40;

/// Whether the worlds of BARN are meant.
///
/// # Errors
/// For options of them with another scenario.
pub(super) fn is_meant(args: &RunArgs) -> Result<bool, Failure> {
    let meant = args.system == NAME;
    let option = args.worlds.as_ref().map(|_| "--worlds").or(args.robot.map(|_| "--robot"));
    match option {
        Some(option) if !meant => Err(Failure::new(format!("{option} belongs to the scenario \"{NAME}\""))
            .help(format!("as in: sinew run {NAME} {option} …"))),
        _ => Ok(meant),
    }
}

/// The changes to the plan that the robot asks for.
pub(super) fn sets(args: &RunArgs) -> Vec<String> {
    match args.robot {
        Some(Shaped::Round) if args.system == NAME => {
            ["robot.jackal.radius=0.34", "agent.navigator.length=0.0", "agent.navigator.width=0.68"]
                .map(str::to_owned)
                .to_vec()
        }
        _ => Vec::new(),
    }
}

/// What became of a world.
struct Outcome {
    summary: Summary,
    /// From when the clock of the benchmark started (s); nothing where the goal was not reached in time.
    seconds: Option<f64>,
    collided: bool,
    way: Vec<Point>,
}

impl Outcome {
    fn score(&self, world: &World) -> f64 {
        self.seconds.map_or(0.0, |seconds| world.score(seconds))
    }

    fn word(&self) -> &'static str {
        match self.seconds {
            Some(_) => "success",
            None if self.collided => "collided",
            None => "timeout",
        }
    }
}

/// All of them together.
struct Total {
    worlds: usize,
    success: f64,
    collided: f64,
    timeout: f64,
    /// Of the runs that succeeded (s); nothing where none did.
    time: Option<f64>,
    metric: f64,
}

/// Runs each world and prints what became of it.
pub(super) fn run(
    args: &RunArgs,
    scenario: &Scenario,
    asked_to_end: &Arc<AtomicBool>,
    json: bool,
) -> Result<ExitCode, Failure> {
    let worlds = worlds(args)?;
    if args.log.is_some() && worlds.len() > 1 {
        return Err(Failure::new("--log names one file, and there are many runs")
            .help("--seeds 7..7 runs the world 7 alone"));
    }
    let begun = terminal::host_now();
    let is_alone = worlds.len() == 1;
    let run = |place: usize| one(args, scenario, &worlds[place], is_alone, asked_to_end);
    let done = many::each("worlds", worlds.len(), asked_to_end, run)?;
    let took = begun.elapsed().as_secs_f64();
    let total = Total::of(&worlds, &done);
    let robot = args.robot.unwrap_or_default();
    let sheet = match &args.out {
        Some(out) => figures::write(&sheet(&worlds, &done).draw(), out, NAME).map_err(Failure::new)?,
        None => Vec::new(),
    };
    if json {
        terminal::say_json(&document(&worlds, &done, &total, robot, took, &sheet));
    } else {
        terminal::say(&text(&worlds, &done, &total, robot, took, &sheet));
    }
    let whole = done.len() == worlds.len();
    // The round robot is told of without a goal: it hardly fits.
    let reached =
        robot == Shaped::Round || total.success >= SUCCESS && total.collided == 0.0 && total.metric >= METRIC;
    Ok(if whole && reached { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn worlds(args: &RunArgs) -> Result<Vec<World>, Failure> {
    let Some(path) = &args.worlds else {
        let Seeds { first, last } = args.seeds.unwrap_or(WORLDS);
        return Ok((first..=last).map(barn::generate).collect());
    };
    let text = std::fs::read_to_string(path)
        .map_err(|error| Failure::new(format!("{} cannot be read: {error}", path.display())))?;
    let mut worlds = barn::read(&text).map_err(|error| wrong(path, &text, &error))?;
    if let Some(Seeds { first, last }) = args.seeds {
        worlds.retain(|world| (first..=last).contains(&world.number));
        if worlds.is_empty() {
            return Err(Failure::new(format!("{} has no world from {first} to {last}", path.display())));
        }
    }
    Ok(worlds)
}

/// The mistake at its line.
fn wrong(path: &Path, text: &str, error: &barn::NotWorlds) -> Failure {
    let form =
        "a line is: number, path length, radius of the largest disc, 64 rows of 30 bits in hexadecimal";
    let line = error.line.checked_sub(1).and_then(|i| text.lines().nth(i));
    let file = path.display().to_string();
    let Some(line) = line else { return Failure::new(format!("{file}: {}", error.what)).help(form) };
    // A whole row is longer than anybody reads.
    let start: String = line.chars().take(60).collect();
    let width = start.chars().count();
    let place = At { file, line: error.line, column: 1, text: start, width };
    let problem = Problem { what: error.what.clone(), help: Some(form.into()), place: Some(place) };
    Failure { problems: vec![problem], code: 2 }
}

/// The run in a world, seeded by its number. One that is alone has a log.
fn one(
    args: &RunArgs,
    scenario: &Scenario,
    world: &World,
    alone: bool,
    asked_to_end: &Arc<AtomicBool>,
) -> Result<Outcome, Failure> {
    let mut scenario = scenario.clone();
    if let Some(course) = &mut scenario.file.world {
        course.set("round", Value::List(world.cylinders().map(round).collect()));
    }
    let seed = world.number;
    let ready = scenario.prepare(seed)?;
    let clock = options::clock(args, &ready)?;
    let place = if alone { Place::of(args, NAME, seed)? } else { None };
    let facts = place.is_none().then(Facts::default);
    let run = One {
        args,
        scenario: &scenario,
        seed,
        clock,
        watched: false,
        place,
        asked_to_end: asked_to_end.clone(),
        serves: false,
        repeat: None,
        knowing: None,
        facts: facts.clone(),
    };
    let summary = run.run(ready)?;
    let way = facts.iter().flat_map(way).collect();
    Ok(judged(summary, way))
}

/// A cylinder, as the file of a world has it.
fn round(at: Point) -> Entry {
    let number = |x: f64| Entry { value: Value::Float(x), at: Span::default() };
    let mut row = Table::new();
    row.set("at", Value::List(vec![number(at.x), number(at.y)]));
    row.set("radius", Value::Float(barn::CYLINDER));
    row.set("height", Value::Float(1.0));
    Entry { value: Value::Table(row), at: Span::default() }
}

/// Where the robot truly was.
fn way(facts: &Facts) -> Vec<Point> {
    let all = std::iter::from_fn(|| facts.before(Time(i64::MAX)));
    let places = all.filter_map(|fact| match fact.what {
        What::Place(odometry) => Some(odometry.pose.position()),
        What::Asked { .. } => None,
    });
    places.collect()
}

fn judged(summary: Summary, way: Vec<Point>) -> Outcome {
    let robot = summary.robots.first();
    let stages: Vec<f64> = robot
        .map_or_else(Vec::new, |robot| robot.passed.iter().map(|at| at.since_start().seconds()).collect());
    let seconds = match stages[..] {
        [moved, reached, ..] => Some(reached - moved).filter(|seconds| *seconds <= barn::WITHIN),
        _ => None,
    };
    let collided = summary.collisions().is_some_and(|n| n > 0);
    Outcome { seconds: seconds.filter(|_| !collided), collided, summary, way }
}

impl Total {
    fn of(worlds: &[World], done: &BTreeMap<usize, Outcome>) -> Total {
        let n = done.len().max(1) as f64;
        let share =
            |what: &dyn Fn(&Outcome) -> bool| done.values().filter(|one| what(one)).count() as f64 / n;
        let times: Vec<f64> = done.values().filter_map(|one| one.seconds).collect();
        Total {
            worlds: done.len(),
            success: share(&|one| one.seconds.is_some()),
            collided: share(&|one| one.collided),
            timeout: share(&|one| one.seconds.is_none() && !one.collided),
            time: (!times.is_empty()).then(|| times.iter().sum::<f64>() / times.len() as f64),
            metric: done.iter().map(|(i, one)| one.score(&worlds[*i])).sum::<f64>() / n,
        }
    }
}

fn robot_name(robot: Shaped) -> &'static str {
    match robot {
        Shaped::Rectangular => "rectangular",
        Shaped::Round => "round",
    }
}

fn document(
    worlds: &[World],
    done: &BTreeMap<usize, Outcome>,
    total: &Total,
    robot: Shaped,
    took: f64,
    files: &[String],
) -> Json {
    let row = |(i, one): (&usize, &Outcome)| {
        json!({
            "world": worlds[*i].number,
            "result": one.word(),
            "time_s": one.seconds,
            "metric": one.score(&worlds[*i]),
            "path_length_m": worlds[*i].path_length,
            "closest_m": one.summary.closest(),
            "distance_m": one.summary.distance(),
        })
    };
    json!({
        "system": NAME,
        "robot": robot_name(robot),
        "barn": {
            "worlds": total.worlds,
            "success": total.success,
            "collided": total.collided,
            "timeout": total.timeout,
            "time_s": total.time,
            "metric": total.metric,
        },
        "wall_s": took,
        "files": files,
        "runs": done.iter().map(row).collect::<Vec<_>>(),
    })
}

fn text(
    worlds: &[World],
    done: &BTreeMap<usize, Outcome>,
    total: &Total,
    robot: Shaped,
    took: f64,
    files: &[String],
) -> String {
    let head = ["world", "result", "time", "metric", "closest", "distance"].map(str::to_owned);
    let number =
        |value: Option<f64>, unit: &str| value.map_or("-".to_owned(), |value| format!("{value:.2} {unit}"));
    let row = |(i, one): (&usize, &Outcome)| {
        [
            worlds[*i].number.to_string(),
            one.word().to_owned(),
            number(one.seconds, "s"),
            format!("{:.3}", one.score(&worlds[*i])),
            number(one.summary.closest(), "m"),
            number(one.summary.distance(), "m"),
        ]
    };
    let rows: Vec<[String; 6]> = std::iter::once(head).chain(done.iter().map(row)).collect();
    let mut out = table(&rows, 0);
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    out += &format!(
        "{NAME}, {} robot: {} worlds, {} succeeded, {} collided, {} out of time, {} in the mean, metric {:.4}, in {took:.1} s\n",
        robot_name(robot),
        total.worlds,
        percent(total.success),
        percent(total.collided),
        percent(total.timeout),
        number(total.time, "s"),
        total.metric,
    );
    out += "These are the worlds and the rules of the benchmark in our own simulator, not in the one of the challenge.\n";
    if done.len() < worlds.len() {
        out += &format!("interrupted: {} of {} worlds were run\n", done.len(), worlds.len());
    }
    for file in files {
        out += &format!("{file}\n");
    }
    out
}

/// All worlds on one sheet, with the ways that were taken.
fn sheet(worlds: &[World], done: &BTreeMap<usize, Outcome>) -> Sheet {
    let panel = |(i, one): (&usize, &Outcome)| {
        let world = &worlds[*i];
        let circles = world.cylinders().map(|at| (at, barn::CYLINDER)).collect();
        let title = match one.seconds {
            Some(seconds) => format!("{}: {seconds:.1} s", world.number),
            None => format!("{}: {}", world.number, one.word()),
        };
        Panel {
            title,
            drawing: Drawing { circles, ..Drawing::default() },
            way: one.way.clone(),
            alarm: one.seconds.is_none(),
        }
    };
    Sheet {
        panels: done.iter().map(panel).collect(),
        columns: 20,
        window: (Point::new(-4.6, 2.4), Point::new(0.1, 12.6)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_file_of_worlds_is_told_with_its_line() {
        let text = "# worlds\n1 12.0 zero\n";
        let failure = wrong(Path::new("w.txt"), text, &barn::read(text).unwrap_err());
        let [problem] = &failure.problems[..] else { panic!("{failure:?}") };
        let place = problem.place.as_ref().unwrap();
        assert_eq!((place.line, failure.code), (2, 2));
        assert!(problem.what.contains("\"zero\""), "{problem:?}");
        let failure = wrong(Path::new("w.txt"), "", &barn::read("").unwrap_err());
        assert!(failure.problems[0].what.contains("no world"), "{failure:?}");
    }

    fn args(words: &[&str]) -> RunArgs {
        crate::cli::run_args(&[&["run"], words].concat())
    }

    #[test]
    fn a_generated_world_is_passed_by_the_rules_of_the_benchmark() {
        let args = args(&["barn", "--no-log"]);
        let registry = crate::run::with_robots(agents::registry());
        let scenario = options::scenario(&args, registry).unwrap();
        let world = barn::generate(1);
        let outcome = one(&args, &scenario, &world, false, &Arc::default()).unwrap();
        let seconds = outcome.seconds.unwrap_or_else(|| panic!("{}", outcome.summary.why));
        assert!(!outcome.collided && (4.5..20.0).contains(&seconds), "{seconds}");
        // Nine metres and more, ten times a second at most 0.2 m apart.
        let steps = outcome.way.windows(2).map(|pair| pair[0].distance(pair[1]));
        assert!(outcome.way.len() > 40 && steps.clone().fold(0.0, f64::max) < 0.25);
        assert!(steps.sum::<f64>() > 8.5);
        assert!(outcome.score(&world) > METRIC, "{}", outcome.score(&world));
    }

    #[test]
    fn options_of_these_worlds_belong_to_them_alone() {
        assert!(is_meant(&args(&["barn", "--robot", "round"])).unwrap());
        let said = is_meant(&args(&["home", "--worlds", "w.txt"])).unwrap_err();
        assert!(said.problems[0].what.starts_with("--worlds belongs to"), "{said:?}");
        assert_eq!(sets(&args(&["barn"])), Vec::<String>::new());
        assert_eq!(sets(&args(&["barn", "--robot", "round"])).len(), 3);
    }
}
