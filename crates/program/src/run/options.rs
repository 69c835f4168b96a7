//! From the arguments of `run` to a scenario and a clock.

use std::io;
use std::path::{Path, PathBuf};

use hardware::{carmen, ticks};
use record::log::Reader;
use runtime::{Plan, Registry};
use types::value::Value;

use super::prepare::{Ready, Scenario};
use super::{barn, knowing};
use crate::cli::{ClockChoice, RunArgs};
use crate::error::Failure;
use crate::{figures, file};

/// Reads the system file, with the changes that the command line makes to its entries.
pub(super) fn scenario(args: &RunArgs, registry: Registry) -> Result<Scenario, Failure> {
    let sets = [barn::sets(args), knowing::sets(args)].concat();
    let mut loaded = file::load(&args.system, &sets, &registry)?;
    loaded.store = args.know.clone().or(loaded.store);
    if args.no_script {
        loaded.plan.requests.clear();
        for section in ["goal", "figure"] {
            loaded.plan.sections.remove(section);
        }
    }
    if let Some(from) = &args.from {
        let (driver, folder) = recording(from)?;
        let robots = loaded.plan.section("robot").map(|robots| robots.rows()).unwrap_or_default();
        let [robot] = robots else {
            return Err(Failure::new(format!(
                "--from gives one robot its recording, and the plan has {}",
                robots.len()
            ))
            .help("say it in the plan, as in driver = \"carmen:FILE\""));
        };
        let name = robot.key.clone();
        if let Some(recorded) = recorded_robot(from).filter(|recorded| *recorded != name) {
            rename(&mut loaded.plan, &name, &recorded);
        }
        let robots = loaded.plan.section("robot").map(|robots| robots.rows()).unwrap_or_default();
        let [robot] = robots else { return Err(Failure::new("the plan has no robot")) };
        let path = format!("robot.{}.driver", types::value::Key(&robot.key));
        let set = loaded.plan.sections.set_path(&path, Value::Text(driver));
        set.map_err(|mistake| Failure::new(mistake.what))?;
        loaded.folder = folder;
    } else if args.system == RECORDED {
        return Err(Failure::new("the scenario \"recorded\" needs the file of a recorded robot")
            .help("name it, as in: sinew run recorded --from fr079.log"));
    }
    Ok(Scenario { file: loaded, registry })
}

/// Leaves the agents that the command line wants, if it names any. What a store holds is for the whole system, so it is read before.
pub(super) fn only(args: &RunArgs, mut scenario: Scenario) -> Result<Scenario, Failure> {
    if !args.only.is_empty() {
        let names: Vec<String> = args.only.iter().map(|name| name.trim().to_owned()).collect();
        scenario.file.plan.only(&names).map_err(runtime::Refusal::from)?;
    }
    Ok(scenario)
}

/// The built-in scenario that is nothing without a file.
const RECORDED: &str = "recorded";

/// The driver that plays a file, and the folder in which it lies. The log keeps the name of the file and not where it lay.
fn recording(path: &Path) -> Result<(String, PathBuf), Failure> {
    let unreadable = |error: io::Error| Failure::new(format!("{} cannot be read: {error}", path.display()));
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let folder = path.parent().unwrap_or(Path::new("")).to_owned();
    if !path.is_file() {
        return Err(match path.metadata() {
            Ok(_) => Failure::new(format!("{} is no file", path.display())),
            Err(error) => unreadable(error),
        });
    }
    if path.extension().is_some_and(|ending| ending == "mcap") {
        return Ok((format!("replay:{name}"), folder));
    }
    if !carmen::open(path).map_err(unreadable)?.records.is_empty() {
        return Ok((format!("carmen:{name}"), folder));
    }
    if !ticks::open(path).map_err(unreadable)?.records.is_empty() {
        return Ok((format!("ticks:{name}"), folder));
    }
    Err(Failure::new(format!("{} is neither a CARMEN log nor a file of wheel counts", path.display()))
        .help("logs of our own end in .mcap"))
}

/// The only robot of a log of our own: the plan's takes its name, under which its messages are.
fn recorded_robot(path: &Path) -> Option<String> {
    let reader = Reader::open(path).ok()?;
    let mut robots = figures::robots(&reader.run()?.notes);
    if robots.len() == 1 { robots.pop() } else { None }
}

/// Gives a robot of a plan another name.
fn rename(plan: &mut Plan, from: &str, to: &str) {
    let port = |name: &mut String| {
        if let Some(port) = name.strip_prefix(from).filter(|rest| rest.starts_with('.')) {
            *name = format!("{to}{port}");
        }
    };
    for agent in &mut plan.agents {
        if agent.name == from {
            agent.name = to.to_owned();
        }
        if agent.robot.as_deref() == Some(from) {
            agent.robot = Some(to.to_owned());
        }
    }
    for wire in &mut plan.wires {
        port(&mut wire.from);
        port(&mut wire.to);
    }
    if let Some(Value::Table(robots)) = plan.sections.get_mut("robot").map(|entry| &mut entry.value) {
        robots.rows_mut().iter_mut().filter(|row| row.key == from).for_each(|row| row.key = to.to_owned());
    }
}

/// The clock that was asked for, or the one that fits the robots.
pub(super) fn clock(args: &RunArgs, ready: &Ready) -> Result<ClockChoice, Failure> {
    match args.clock {
        Some(ClockChoice::Sim) if ready.needs_wall => {
            Err(Failure::new("a robot of this plan is a thing in the world: only the wall clock will do"))
        }
        Some(ClockChoice::Wall) if args.speed.is_some() => {
            Err(Failure::new("the wall clock has one speed").help("--speed goes with --clock sim"))
        }
        Some(ClockChoice::Wall) if args.processors.is_some() => {
            Err(Failure::new("on the wall clock steps take the time that they take")
                .help("--processors goes with --clock sim"))
        }
        Some(clock) => Ok(clock),
        None if ready.needs_wall => Ok(ClockChoice::Wall),
        None => Ok(ClockChoice::Sim),
    }
}

/// Where the kernel tells which processors there are.
pub(super) const PROCESSORS: &str = "/sys/devices/system/cpu";

/// What is to be said of executors that shall run on processors which this machine has not: in simulated time no thread depends on them.
pub(super) fn absent_processors(plan: &Plan, known: &Path) -> Vec<String> {
    if !known.join("cpu0").exists() {
        return Vec::new();
    }
    let is_absent = |cpu: &&usize| !known.join(format!("cpu{cpu}")).exists();
    let told = plan.executors.iter().filter_map(|executor| {
        let absent: Vec<String> = executor.cpus.iter().filter(is_absent).map(usize::to_string).collect();
        let name = &executor.name;
        let runs =
            if absent.len() < executor.cpus.len() { "it runs on the others" } else { "it runs on any" };
        (!absent.is_empty()).then(|| {
            format!(
                "executor \"{name}\" names processor {}, which this machine has not: {runs}",
                absent.join(", ")
            )
        })
    });
    told.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_its_script_a_file_asks_for_nothing_and_strives_for_nothing() {
        let scripted = |more: &[&str]| {
            let args = crate::cli::run_args(&[&["run", "reactive"], more].concat());
            let plan = scenario(&args, crate::run::with_robots(agents::registry())).unwrap().file.plan;
            (plan.requests.len(), plan.section("goal").is_some(), plan.sections.get("figure").is_some())
        };
        let (requests, goal, figures) = scripted(&[]);
        assert!(requests > 10 && goal && figures);
        assert_eq!(scripted(&["--no-script"]), (0, false, false));
    }

    #[test]
    fn a_processor_that_the_machine_has_not_is_told_before_the_run() {
        let folder = std::env::temp_dir().join(format!("sinew-processors-{}", std::process::id()));
        for cpu in ["cpu0", "cpu1"] {
            std::fs::create_dir_all(folder.join(cpu)).unwrap();
        }
        let told = |cpus: &[usize]| {
            let mut plan = Plan::new("p");
            let executor = runtime::ExecutorPlan::new("fast", Some(60));
            plan.executors.push(runtime::ExecutorPlan { cpus: cpus.to_vec(), ..executor });
            absent_processors(&plan, &folder).join("\n")
        };
        assert_eq!(told(&[]), "");
        assert_eq!(told(&[0, 1]), "");
        let any = "executor \"fast\" names processor 77, which this machine has not: it runs on any";
        assert_eq!(told(&[77]), any);
        assert!(told(&[1, 77]).ends_with("it runs on the others"), "{}", told(&[1, 77]));
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(told(&[77]), "", "nobody can tell");
    }

    #[test]
    fn a_robot_of_another_name_is_wired_as_before() {
        let registry = crate::run::with_robots(agents::registry());
        let mut plan = file::load(RECORDED, &[], &registry).unwrap().plan;
        rename(&mut plan, "r1", "h1");
        assert_eq!(runtime::check(&plan, &registry), []);
        assert!(plan.wires.iter().any(|wire| wire.from == "h1.pose"));
        assert!(plan.agents.iter().all(|agent| agent.name != "r1" && agent.robot.as_deref() != Some("r1")));
        assert!(plan.section("robot").unwrap().get("h1").is_some());
    }
}
