//! A system: agents on their executors, that make each other run.

use std::collections::BTreeMap;
use std::path::Path;

use runtime::{
    AgentPlan, Assumed, CannotRun, Direction, ExecutorPlan, Options, Registry, Simulation, Timetable, owner,
    timetable, why_unsound, wires_of,
};
use schedule::sensitivity::largest;
use schedule::system::{Found, Source, System};
use schedule::{Exact, Task, TaskSet};
use serde_json::Value as Json;
use types::Duration;

use super::report::{Chain, Part, Report, Row, SHOWN_CHAINS};
use super::{AnalyzeArgs, set};
use crate::error::Failure;
use crate::file;
use crate::run::{Ready, Scenario, failure, with_robots};

/// Chains have no more agents than this, and there are no more of them.
const LONGEST_CHAIN: usize = 12;
const MOST_CHAINS: usize = 256;

/// Analyses a system file or a scenario.
pub(super) fn analyse(name: &str, args: &AnalyzeArgs, registry: &Registry) -> Result<Report, Failure> {
    for (is, option) in [(args.edf, "--edf"), (args.length.is_some(), "--for")] {
        if is {
            return Err(Failure::new(format!("{option} is for bare task sets; {name} is a system"))
                .help("its executors say where they run"));
        }
    }
    let registry = with_robots(registry.clone());
    let file = file::check(name, &args.set, &registry)?;
    let measured = args.from.as_deref().map(Measured::read).transpose()?;
    let sources = file.sources.clone();
    let ready = Scenario { file, registry }.prepare(1)?;
    let mut report = report(&ready, measured, args.processors.into())?;
    if let Some(limit) = args.play {
        let played = play(ready, &mut report, limit, args.processors.into());
        played.map_err(|error| failure(error, &sources))?;
    }
    Ok(report)
}

/// Plays it with the execution times of the report, and puts the longest responses beside the analysed ones.
fn play(mut ready: Ready, report: &mut Report, limit: Duration, processors: usize) -> Result<(), CannotRun> {
    for (agent, row) in ready.plan.agents.iter_mut().zip(&report.rows) {
        agent.cost = Some(Duration(row.cost.ceil().to_integer() as i64));
        // The cost of the row is by the method that it has, and with its whole budget.
        agent.methods.clear();
        agent.budget = None;
    }
    // What is analysed is the system as it is written, not what happens to it.
    ready.plan.requests.clear();
    let managers: Vec<String> = managers(&ready);
    ready.plan.agents.iter_mut().filter(|agent| managers.contains(&agent.name)).for_each(|agent| {
        agent.giving.is_suspended = true;
    });
    let options = Options {
        limit: Some(limit),
        processors: Some(processors),
        parse: control::words::parse,
        ..Options::default()
    };
    let played = Simulation::new(&ready.plan, &ready.registry, options)?.run()?;
    for row in &mut report.rows {
        let agent = played.view.agents.iter().find(|agent| agent.name == row.name);
        row.played = agent.filter(|agent| agent.response.n > 0).map(|agent| agent.response.max * 1e-9);
    }
    let on = match processors {
        1 => "one virtual processor".to_owned(),
        several => format!("{several} virtual processors"),
    };
    report.notes.push(format!("played: the longest response in {limit} on {on}"));
    Ok(())
}

/// Agents that set what others may use.
fn managers(ready: &Ready) -> Vec<String> {
    let manages = |agent: &&AgentPlan| {
        let kind = ready.registry.get(&agent.kind);
        kind.is_some_and(|kind| kind.ports.iter().any(|port| port.shape.direction == Direction::Manager))
    };
    ready.plan.agents.iter().filter(manages).map(|agent| agent.name.clone()).collect()
}

fn report(ready: &Ready, measured: Option<Measured>, processors: usize) -> Result<Report, Failure> {
    let plan = &ready.plan;
    let is_simulated = |agent: &AgentPlan| {
        ready.robots.iter().any(|robot| robot.name == agent.name && robot.description.driver == "sim")
    };
    let methods_of = |agent: &AgentPlan| ready.registry.get(&agent.kind).map_or(&[][..], |kind| kind.methods);
    let known = |agent: &AgentPlan| {
        let measured = measured.as_ref().and_then(|measured| measured.costs.get(&agent.name).copied());
        let declared = agent.cost_in_all(methods_of(agent));
        // In the steps of a simulated robot is the work of its world.
        if is_simulated(agent) { declared.or(Some(Duration::ZERO)) } else { measured.or(declared) }
    };
    let cost = |agent: &AgentPlan| known(agent).unwrap_or(Duration::ZERO);
    let pace = |port: &str| ready.pace(port);
    let table = timetable(
        plan,
        &ready.registry,
        &Assumed { cost: &cost, processors, overhead: Duration::ZERO, pace: &pace },
    );
    let found = table.system.analyse().map_err(|unsound| {
        let names: Vec<String> = plan.agents.iter().map(|agent| agent.name.clone()).collect();
        Failure::from(why_unsound(&unsound, &names)).code(1)
    })?;
    let mut report = Report { name: plan.name.clone(), ..Report::default() };
    report.rows = rows(ready, &table, &found);
    report.parts = parts(&table, &found);
    report.chains = chains(ready, &table, &found);
    let hidden = report.chains.len().saturating_sub(SHOWN_CHAINS);
    if hidden > 0 {
        report.notes.push(format!("{hidden} longer chains are in the JSON"));
    }
    let unknown: Vec<&str> =
        plan.agents.iter().filter(|agent| known(agent).is_none()).map(|agent| agent.name.as_str()).collect();
    if !unknown.is_empty() {
        report.notes.push(format!(
            "no execution time is known of {}: they count as nothing. Declare it, as in cost = \"2ms\", or measure it: --from a run",
            unknown.join(", ")
        ));
    }
    if let Some(measured) = &measured {
        for row in &mut report.rows {
            row.measured = measured.responses.get(&row.name).copied();
        }
        report.notes.push(format!("execution times: the longest steps in {}", measured.file));
        if measured.clock == "sim" {
            let what = "in simulated time nobody leaves out of a step what the machine did otherwise: a run with --clock wall measures better";
            report.notes.push(what.to_owned());
        }
        for agent in &plan.agents {
            if let (Some(declared), Some(longest)) =
                (agent.cost_in_all(methods_of(agent)), measured.costs.get(&agent.name))
                && *longest > declared
            {
                report.notes.push(format!("{} took {longest} where {declared} is declared", agent.name));
            }
        }
    }
    Ok(report)
}

fn rows(ready: &Ready, table: &Timetable, found: &[Found]) -> Vec<Row> {
    let system = &table.system;
    let all_meet = |system: &System| system.is_feasible().unwrap_or(false);
    let agents = ready.plan.agents.iter().zip(&system.agents).zip(found).enumerate();
    let row = |(at, ((plan, agent), found)): (usize, ((&AgentPlan, &schedule::system::Agent), &Found))| {
        let executor = &table.executors[agent.executor];
        let counts = system.is_in_real_time(at);
        let with = |change: &dyn Fn(&mut schedule::system::Agent)| {
            let mut system = system.clone();
            change(&mut system.agents[at]);
            all_meet(&system)
        };
        let factor = (counts && agent.cost > Exact::default())
            .then(|| largest(|factor| with(&|agent| agent.cost *= factor)))
            .flatten();
        // How many times as fast its clock may go.
        let faster = |speed: Exact| {
            with(&|agent| {
                let zero = speed == Exact::default();
                for source in &mut agent.sources {
                    if let Source::Clock { period } = source {
                        *period = if zero { *period * Exact::from_integer(1 << 30) } else { *period / speed };
                        if plan.deadline.is_none() {
                            agent.deadline = *period;
                        }
                    }
                }
                let late =
                    |source: &Source| matches!(source, Source::Clock { period } if *period < agent.deadline);
                if agent.sources.iter().any(late) {
                    // No test holds for a deadline after the next release.
                    agent.cost = agent.deadline * Exact::from_integer(2);
                }
            })
        };
        let clock = plan.period.filter(|_| counts && agent.cost > Exact::default());
        let least_period = clock.and_then(|period| {
            largest(faster).filter(|speed| *speed > 0.0).map(|speed| period.0 as f64 / speed)
        });
        let waits_for: Vec<&str> = agent
            .sources
            .iter()
            .filter_map(Source::agent)
            .map(|at| ready.plan.agents[at].name.as_str())
            .collect();
        let mut waits_for = waits_for;
        waits_for.dedup();
        Row {
            name: plan.name.clone(),
            cost: agent.cost,
            period: found.streams.iter().map(|stream| stream.period).min(),
            deadline: agent.deadline,
            priority: executor.level().map(u32::from),
            processor: None,
            response: found.response.filter(|_| found.meets),
            counts,
            played: None,
            measured: None,
            least_period,
            cost_factor: factor,
            remark: match (under(executor), waits_for.as_slice()) {
                (executor, []) => executor,
                (executor, names) => format!("{executor}, on {}", names.join(" ")),
            },
        }
    };
    agents.map(row).collect()
}

/// An executor's name, and whether it runs by its agent's deadline.
fn under(executor: &ExecutorPlan) -> String {
    let policy = if executor.is_by_deadline() { ", by deadline" } else { "" };
    format!("{}{policy}", executor.name)
}

/// Executors that may keep each other waiting are analysed as if they shared one processor.
fn parts(table: &Timetable, found: &[Found]) -> Vec<Part> {
    let system = &table.system;
    let mut groups: Vec<(u64, Vec<usize>)> = Vec::new();
    for (at, agent) in system.agents.iter().enumerate().filter(|(at, _)| system.is_in_real_time(*at)) {
        let mut group = (system.executors[agent.executor].may, vec![at]);
        groups.retain_mut(|(may, members)| {
            let apart = *may & group.0 == 0;
            if !apart {
                group.0 |= *may;
                group.1.append(members);
            }
            apart
        });
        groups.push(group);
    }
    groups.sort_by_key(|(_, members)| members.iter().min().copied());
    let several = groups.len() > 1;
    let part = |(may, members): &(u64, Vec<usize>)| {
        let tasks = members.iter().flat_map(|at| {
            let (agent, streams) = (&system.agents[*at], &found[*at].streams);
            streams.iter().map(|stream| {
                let deadline = agent.deadline.min(stream.period);
                Task::new(agent.cost, stream.period).with_deadline(deadline)
            })
        });
        let (set, _) = TaskSet::deadline_monotonic(tasks.collect()).ok()?;
        let cpus =
            (0..64).filter(|cpu| may >> cpu & 1 == 1).map(|cpu: u32| cpu.to_string()).collect::<Vec<_>>();
        let name = if several {
            format!("processor {}", cpus.join(", "))
        } else {
            match system.processors {
                0 | 1 => "one processor".to_owned(),
                several => format!("{several} processors"),
            }
        };
        let meets = members.iter().all(|at| found[*at].meets);
        let mut part = Part { response_time: meets, ..set::part_of(name, &set) };
        part.edf.why = part.edf.why.replace(" at all times", ", nobody late");
        Some(part)
    };
    groups.iter().filter_map(part).collect()
}

/// From a robot's reading over agents to its command, each way once, the quickest first.
fn chains(ready: &Ready, table: &Timetable, found: &[Found]) -> Vec<Chain> {
    let plan = &ready.plan;
    let place = |name: &str| plan.agents.iter().position(|agent| agent.name == name);
    let mut next: Vec<Vec<usize>> = vec![Vec::new(); plan.agents.len()];
    for wire in wires_of(plan, &ready.registry) {
        let ends = if plan.is_queue(&wire.from) {
            let into = plan.wires.iter().filter(|into| into.to == wire.from);
            into.map(|into| into.from.clone()).collect()
        } else {
            vec![wire.from.clone()]
        };
        for from in ends {
            if let (Some(from), Some(to)) = (place(owner(&from)), place(owner(&wire.to)))
                && !next[from].contains(&to)
            {
                next[from].push(to);
            }
        }
    }
    let robots: Vec<usize> = ready.robots.iter().filter_map(|robot| place(&robot.name)).collect();
    let mut chains = Vec::new();
    for robot in &robots {
        let mut paths = vec![vec![*robot]];
        while let Some(path) = paths.pop() {
            let Some(last) = path.last() else { continue };
            for to in &next[*last] {
                let whole: Vec<usize> = path.iter().copied().chain([*to]).collect();
                if to == robot && chains.len() < MOST_CHAINS {
                    let agents = whole.iter().map(|at| plan.agents[*at].name.clone()).collect();
                    chains.push(Chain { agents, latency: table.system.latency(found, &whole) });
                } else if !path.contains(to) && !robots.contains(to) && whole.len() <= LONGEST_CHAIN {
                    paths.push(whole);
                }
            }
        }
    }
    let key =
        |chain: &Chain| (chain.latency.is_none(), chain.latency, chain.agents.len(), chain.agents.clone());
    chains.sort_by_key(key);
    chains
}

/// Execution times of a run.
struct Measured {
    file: String,
    /// The clock of the run.
    clock: String,
    costs: BTreeMap<String, Duration>,
    /// The longest responses (s).
    responses: BTreeMap<String, f64>,
}

impl Measured {
    /// Reads those beside a log, or a file of them.
    fn read(path: &Path) -> Result<Measured, Failure> {
        let file = if path.extension().is_some_and(|ending| ending == "json") {
            path.to_owned()
        } else {
            path.with_file_name("timing.json")
        };
        let shown = file.display().to_string();
        let text = std::fs::read_to_string(&file).map_err(|error| {
            Failure::new(format!("the execution times of the run cannot be read: {shown}: {error}"))
                .help("a run writes timing.json beside its log")
        })?;
        let wrong = |what: &str| {
            Failure::new(format!("{shown} is no file of execution times: {what}"))
                .help("a run writes timing.json beside its log")
        };
        let document: Json = serde_json::from_str(&text).map_err(|error| wrong(&error.to_string()))?;
        let agents = document["agents"].as_array().ok_or_else(|| wrong("it has no list \"agents\""))?;
        let (mut costs, mut responses) = (BTreeMap::new(), BTreeMap::new());
        for agent in agents {
            let name = agent["name"].as_str().ok_or_else(|| wrong("an agent has no name"))?;
            let figure = &agent["exec"];
            let longest =
                figure["max"].as_f64().ok_or_else(|| wrong(&format!("of {name} it has no exec.max")))?;
            let response = &agent["response"];
            let longest_response = response["max"].as_f64().filter(|_| response["n"].as_u64() > Some(0));
            if let Some(longest) = longest_response {
                responses.insert(name.to_owned(), longest * unit_of(response));
            }
            if figure["n"].as_u64() > Some(0) {
                costs.insert(name.to_owned(), Duration::from_seconds(longest * unit_of(figure)));
            }
        }
        let clock = document["clock"].as_str().unwrap_or_default().to_owned();
        Ok(Measured { file: shown, clock, costs, responses })
    }
}

/// What one of a figure's numbers is in seconds.
fn unit_of(figure: &Json) -> f64 {
    match figure["unit"].as_str() {
        Some("ns") => 1e-9,
        Some("us") => 1e-6,
        Some("ms") => 1e-3,
        _ => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use runtime::{Agent, Fault, Input, Output, Step, registry};
    use types::messages::Twist;

    use crate::analyze::report::seconds;
    use crate::run::WORLD_AGENT;

    use super::*;

    /// Sends on what it gets.
    #[derive(Agent)]
    struct Relay {
        /// What it gets.
        input: Input<Twist>,
        /// What it sends.
        output: Output<Twist>,
    }

    impl Agent for Relay {
        fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
            if let Some(twist) = self.input.latest() {
                self.output.send(twist);
            }
            Ok(())
        }
    }

    fn read(text: &str, measured: Option<Measured>) -> Result<Report, Failure> {
        let registry = with_robots(registry![Relay]);
        let file = file::read(text, "t.toml", None, &[], &registry).map_err(Failure::from)?;
        report(&Scenario { file, registry }.prepare(1).unwrap(), measured, 1)
    }

    const THREE: &str = r#"
[executor.high]
priority = 60
[executor.low]
priority = 50
[agent.source]
is = "relay"
period = "10ms"
cost = "3ms"
executor = "high"
[agent.filter]
is = "relay"
on = "input"
deadline = "10ms"
cost = "2ms"
executor = "low"
[agent.slow]
is = "relay"
period = "40ms"
cost = "1ms"
executor = "low"
[wires]
"source.output" = ["filter.input"]
"filter.output" = ["slow.input"]
"#;

    /// By hand, in ms: the filter has 2, 1 of the slow one that has just begun and 1 of its next step, and 3 above: 7. The slow one has 1, 2 of
    /// the filter that has just begun, 3 above, and two steps of the filter, which comes up to 3 late: 10.
    #[test]
    fn a_system_is_analysed_as_its_executors_run_it() {
        let report = read(THREE, None).unwrap();
        let found: Vec<_> =
            report.rows.iter().map(|row| (row.name.as_str(), row.response.map(|it| *it.numer()))).collect();
        assert_eq!(
            found,
            [("source", Some(3_000_000)), ("filter", Some(7_000_000)), ("slow", Some(10_000_000))]
        );
        assert!(report.pass());
        assert_eq!(report.rows[1].period, Some(Exact::from_integer(10_000_000)));
        // When the source needs c, its second message may come 10 − c after the first, and be done after two steps of the filter, the 2 for the
        // slow one and two of the source: 2 · 2 + 2 + 2 c − (10 − c) is 10 where c is 14 / 3.
        let factor = report.rows[0].cost_factor.unwrap();
        assert!((factor - 14.0 / 9.0).abs() < 1e-6, "{factor}");
        assert!(report.notes.is_empty(), "{:?}", report.notes);
    }

    #[test]
    fn measured_times_count_and_unknown_ones_are_named() {
        let costs = [("source".to_owned(), Duration::millis(9))].into();
        let measured =
            Measured { file: "timing.json".into(), clock: "wall".into(), costs, responses: BTreeMap::new() };
        let text = THREE.replace("cost = \"1ms\"\n", "");
        let report = read(&text, Some(measured)).unwrap();
        assert!(!report.pass());
        assert!(
            report.notes.iter().any(|note| note.contains("no execution time is known of slow:")),
            "{:?}",
            report.notes
        );
        assert!(report.notes.contains(&"source took 9ms where 3ms is declared".to_owned()));
    }

    /// No agent of a scenario takes longer on virtual processors than the analysis says.
    #[test]
    fn scenarios_take_no_longer_than_analysed() {
        for (name, processors, millis) in [
            ("exploration", 1, 12_000),
            ("exploration", 2, 6_000),
            ("annex", 1, 6_000),
            ("home", 2, 4_000),
            ("overload", 2, 4_000),
            ("reactive", 1, 12_000),
        ] {
            let registry = with_robots(agents::registry());
            let file = file::load(name, &[], &registry).unwrap();
            let scenario = Scenario { file, registry };
            let ready = scenario.prepare(1).unwrap();
            let mut told = report(&ready, None, processors).unwrap();
            assert!(told.pass(), "{name}");
            play(ready, &mut told, Duration::millis(millis), processors).unwrap();
            for row in &told.rows {
                // Nothing is promised to those who have no priority.
                let Some(told) = row.response.map(seconds) else { continue };
                let Some(played) = row.played else {
                    assert_eq!(row.name, WORLD_AGENT, "nobody but the world waits for calls of people");
                    continue;
                };
                assert!(played <= told + 1e-12, "{name}, {}: {played} s, told {told} s", row.name);
                assert!(played >= seconds(row.cost), "{name}, {}", row.name);
            }
        }
    }

    #[test]
    fn a_circle_is_named() {
        let text = THREE
            .replace("period = \"10ms\"", "on = \"input\"")
            .replace("[\"slow.input\"]", "[\"slow.input\", \"source.input\"]");
        let failure = read(&text, None).unwrap_err();
        let what = &failure.problems[0].what;
        assert!(
            ["source → filter → source", "filter → source → filter"]
                .iter()
                .any(|circle| what.ends_with(circle)),
            "{what}"
        );
    }
}
