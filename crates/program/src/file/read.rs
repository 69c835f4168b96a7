//! The tree of a system file to a plan, with all mistakes at once.

use std::path::{Path, PathBuf};

use runtime::{
    AgentPlan, Assumed, ExecutorPlan, Plan, Policy, Refusal, Registry, not_by_deadline, timetable,
    why_unsound,
};
use schedule::system::Unsound;
use sim::{Goal, Model, Vary, WorldPlan};
use types::Duration;
use types::value::{Entry, Mistake, Span, Table, TableReader, Value, nearest};

use super::agent::Pending;
use super::group::Names;
use super::library::Shelf;
use super::sources::{Mistakes, Sources};
use super::wires::Written;
use super::{burden, compare, decide, figure, floor, knowledge, lasting, modes, set, tree};

/// The sections of a system file.
pub(crate) const SECTIONS: [&str; 18] = [
    "name",
    "world",
    "processors",
    "as_declared",
    "robot",
    "executor",
    "agent",
    "queue",
    "wires",
    "decide",
    "knowledge",
    "goal",
    "vary",
    "burden",
    "compare",
    "at",
    "figure",
    "for",
];
/// Longer than anything that robots do. Several such times can be added and each taken four times without an overflow.
const LONGEST: Duration = Duration::secs(10 * 365 * 24 * 3600);
/// The agent type that a robot is.
pub(super) const ROBOT: &str = "robot";
/// The entries of a robot that are not its model's.
pub(super) const OF_ROBOT: [&str; 2] = ["driver", "start"];

/// Sections of a system that no world has.
const OF_SYSTEM: [&str; 7] = ["agent", "executor", "queue", "wires", "decide", "goal", "burden"];

/// A system file that was read, with what belongs to it.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The plan.
    pub plan: Plan,
    /// The table of the world that it names, as the world's file has it.
    pub world: Option<Table>,
    /// The folder in which files that it names are looked for.
    pub folder: PathBuf,
    /// The texts it was read from, for mistakes that are found later.
    pub sources: Sources,
    /// The store that its section `[knowledge]` names.
    pub store: Option<PathBuf>,
}

/// Finds a system file by its path or the name of a built-in scenario, does the `KEY=VALUE` changes to it, and reads it.
///
/// # Errors
/// All mistakes of the file, its world and the files it uses.
pub fn load(name: &str, sets: &[String], registry: &Registry) -> Result<Loaded, Mistakes> {
    match Shelf::Scenarios.find(name, Path::new("")) {
        Ok(found) => {
            let folder = found.folder.as_deref().unwrap_or(Path::new(""));
            let reader = Reader { is_whole: true, ..Reader::new(registry, folder) };
            reader.file(&found.text, &found.name, sets)
        }
        Err(mistake) => Err(Mistakes { sources: Sources::default(), list: vec![mistake] }),
    }
}

/// The same as [`load`], and besides that whatever can only be seen by drawing the world once.
///
/// # Errors
/// As [`load`], and for entries of `[vary]` that lead nowhere, or a world without a free way.
pub fn check(name: &str, sets: &[String], registry: &Registry) -> Result<Loaded, Mistakes> {
    let loaded = load(name, sets, registry)?;
    match draw_once(&loaded, registry) {
        Ok(()) => Ok(loaded),
        Err(list) => Err(Mistakes { sources: loaded.sources, list }),
    }
}

/// Reads the text of a system file. `name` is what messages call it; files that it names are looked for in `folder`.
///
/// # Errors
/// All mistakes.
pub fn read(
    text: &str,
    name: &str,
    folder: Option<&Path>,
    sets: &[String],
    registry: &Registry,
) -> Result<Loaded, Mistakes> {
    Reader::new(registry, folder.unwrap_or(Path::new(""))).file(text, name, sets)
}

/// Reads the text of a system file to a plan.
///
/// # Errors
/// All mistakes.
pub fn read_plan(text: &str, path: &str, registry: &Registry) -> Result<Plan, Mistakes> {
    read(text, path, Path::new(path).parent(), &[], registry).map(|loaded| loaded.plan)
}

fn draw_once(loaded: &Loaded, registry: &Registry) -> Result<(), Vec<Mistake>> {
    let Some(world) = &loaded.world else { return Ok(()) };
    let mut mistakes = Vec::new();
    let section = |table: Option<&Table>, mistakes: &mut Vec<Mistake>| {
        table.and_then(|table| Vary::read(table, mistakes)).unwrap_or_default()
    };
    let own = world.get("vary").and_then(|entry| entry.value.as_table());
    let vary = section(own, &mut mistakes).with(section(loaded.plan.section("vary"), &mut mistakes));
    let robots = loaded.plan.section(ROBOT).cloned().unwrap_or_default();
    let drawn = vary.draw(world, &robots, &[], 0)?;
    let gate = registry.get(ROBOT).map(|kind| kind.params.iter().map(|field| field.name));
    let elsewhere: Vec<&str> = gate.into_iter().flatten().chain(OF_ROBOT).collect();
    for row in drawn.robots.rows() {
        let Some(table) = row.entry.value.as_table() else { continue };
        let driver = table.get("driver").and_then(|entry| entry.value.as_text());
        if matches!(driver.map(hardware::Spec::parse), Some(Ok(hardware::Spec::Simulated))) {
            Model::read(table, row.entry.at, &elsewhere, &mut mistakes);
        }
    }
    if mistakes.is_empty() { Ok(()) } else { Err(mistakes) }
}

/// Reads a system file and the files it uses.
pub(super) struct Reader<'r> {
    pub(super) registry: &'r Registry,
    pub(super) sources: Sources,
    pub(super) mistakes: Vec<Mistake>,
    pub(super) plan: Plan,
    /// Places of agents and wires in which a mistake was found: what follows from it is not said again.
    pub(super) spoiled: Vec<Span>,
    pub(super) robots: Table,
    pub(super) pending: Vec<Pending>,
    pub(super) written: Vec<Written>,
    pub(super) names: Names,
    pub(super) folder: PathBuf,
    pub(super) world: Option<Table>,
    /// Whether a wire was written that is not in the plan, because something is wrong with it or with its section.
    pub(super) lost_wires: bool,
    /// Whether this is the whole of a system that somebody wants to run: a plan in a log may be what a run left of it.
    is_whole: bool,
}

/// `word` is none of `known`, said in words of one's own.
pub(super) fn unknown<'a>(
    at: Span,
    what: String,
    word: &str,
    known: impl IntoIterator<Item = &'a str>,
) -> Mistake {
    let known: Vec<&str> = known.into_iter().collect();
    let mistake = Mistake::new(at, what);
    match nearest(word, known.iter().copied()) {
        Some(right) => mistake.help(format!("did you mean \"{right}\"?")),
        None if known.is_empty() => mistake,
        None => mistake.help(format!("there are: {}", known.join(", "))),
    }
}

impl<'r> Reader<'r> {
    pub(super) fn new(registry: &'r Registry, folder: &Path) -> Reader<'r> {
        Reader {
            registry,
            sources: Sources::default(),
            mistakes: Vec::new(),
            plan: Plan::default(),
            spoiled: Vec::new(),
            robots: Table::new(),
            pending: Vec::new(),
            written: Vec::new(),
            names: Names::default(),
            folder: folder.to_owned(),
            world: None,
            lost_wires: false,
            is_whole: false,
        }
    }

    /// Reads the text of a system file, with the `KEY=VALUE` changes to it.
    fn file(mut self, text: &str, name: &str, sets: &[String]) -> Result<Loaded, Mistakes> {
        let base = self.sources.add(name, text);
        if let Some(mut tree) = tree::read(&self.sources, base, &mut self.mistakes) {
            for assignment in sets {
                if let Err(mistake) = set::set(&mut tree, &mut self.sources, assignment) {
                    self.mistakes.push(mistake);
                }
            }
            self.system(&tree, name);
            compare::try_values(&mut self, &tree, name);
        }
        self.finish()
    }

    /// A reader that goes on where a system was read, with what is not yet in its plan.
    pub(super) fn over(loaded: &Loaded, registry: &'r Registry) -> Reader<'r> {
        let robots = loaded.plan.section(ROBOT).cloned().unwrap_or_default();
        let (plan, sources, world) = (loaded.plan.clone(), loaded.sources.clone(), loaded.world.clone());
        Reader { plan, sources, world, robots, ..Reader::new(registry, &loaded.folder) }
    }

    pub(super) fn finish(mut self) -> Result<Loaded, Mistakes> {
        self.mistakes.sort_by_key(|mistake| mistake.at.start);
        self.mistakes.dedup();
        if self.mistakes.is_empty() {
            let Reader { plan, world, folder, sources, .. } = self;
            let store = knowledge::store(&plan, &folder);
            Ok(Loaded { plan, world, folder, sources, store })
        } else {
            Err(Mistakes { sources: self.sources, list: self.mistakes })
        }
    }

    pub(super) fn system(&mut self, tree: &Table, file: &str) {
        self.sections(tree, &SECTIONS, "a system file");
        self.name(tree, file);
        self.executors(tree);
        self.read_robots(tree);
        let folder = self.folder.clone();
        self.agents(tree, "", &folder, None, &mut Vec::new());
        self.settle_executors();
        self.queues(tree, "");
        self.collect_wires(tree, "");
        self.settle_wires();
        decide::read(self, tree);
        modes::read(self);
        burden::read(self, tree);
        compare::read(self, tree);
        figure::read(self, tree);
        lasting::read(self, tree);
        knowledge::read(self, tree);
        self.read_world(tree);
        floor::read(self);
        self.requests(tree);
        if self.is_whole {
            self.untriggered();
        }
        let judged = runtime::check(&self.plan, self.registry);
        let spoiled = &self.spoiled;
        self.mistakes.extend(judged.into_iter().filter(|mistake| !spoiled.contains(&mistake.at)));
        self.circle();
    }

    /// Agents that make each other run without end.
    fn circle(&mut self) {
        let mut plan = self.plan.clone();
        if !self.mistakes.is_empty() {
            // What else is wrong is no part of it, and would be in the way of the analysis.
            for agent in &mut plan.agents {
                agent.period = agent.period.map(|period| period.max(Duration::millis(1)));
                agent.deadline = None;
            }
            let wrong = &self.mistakes;
            plan.wires.retain(|wire| !wrong.iter().any(|mistake| mistake.at == wire.at));
        }
        let is_robot = |port: &str| self.robots.get(runtime::owner(port)).is_some();
        let pace = |port: &str| is_robot(port).then_some(hardware::robot::CYCLE);
        let assumed =
            Assumed { cost: &|_| Duration::ZERO, processors: 1, overhead: Duration::ZERO, pace: &pace };
        let table = timetable(&plan, self.registry, &assumed);
        if let Err(unsound) = table.system.analyse()
            && (self.mistakes.is_empty() || matches!(unsound, Unsound::Circle(_)))
        {
            let names: Vec<String> = self.plan.agents.iter().map(|agent| agent.name.clone()).collect();
            let Refusal { what, help } = why_unsound(&unsound, &names);
            let agents: &[usize] = if let Unsound::Circle(circle) = &unsound { circle } else { &[] };
            let places = agents.iter().map(|at| self.plan.agents[*at].at);
            let at = places.min_by_key(|at| at.start).unwrap_or_default();
            self.mistakes.push(Mistake { at, what, help });
        }
    }

    /// Reports the sections that nobody knows.
    pub(super) fn sections(&mut self, tree: &Table, known: &[&str], what: &str) {
        for row in tree.rows().iter().filter(|row| !known.contains(&row.key.as_str())) {
            let said = match row.entry.value {
                Value::Table(_) => format!("there is no section [{}] in {what}", row.key),
                _ => format!("there is no entry \"{}\" at the top of {what}", row.key),
            };
            self.lost_wires |= nearest(&row.key, known.iter().copied()) == Some("wires");
            self.mistakes.push(unknown(row.key_at, said, &row.key, known.iter().copied()));
        }
    }

    fn name(&mut self, tree: &Table, file: &str) {
        let stem = Path::new(file).file_stem().map(|stem| stem.to_string_lossy().into_owned());
        let mut r = TableReader::new(tree, Span::default(), "the file");
        self.plan.name = r.text("name").map(str::to_owned).or(stem).unwrap_or_default();
        tree.rows().iter().for_each(|row| r.allow(&row.key));
        r.finish(&mut self.mistakes);
    }

    /// The tables of a section such as `[agent.NAME]`: name, place of the name, table.
    pub(super) fn each<'t>(&mut self, tree: &'t Table, section: &str) -> Vec<(&'t str, Span, &'t Table)> {
        let Some(entry) = tree.get(section) else { return Vec::new() };
        let Some(table) = entry.value.as_table() else {
            self.mistakes.push(
                Mistake::new(entry.at, format!("\"{section}\" is {}, not a section", entry.value.kind()))
                    .help(format!("write [{section}.NAME] and the entries below it")),
            );
            return Vec::new();
        };
        let mut found = Vec::new();
        for row in table.rows() {
            match &row.entry.value {
                Value::Table(inner) => found.push((row.key.as_str(), row.key_at, inner)),
                other => self.mistakes.push(
                    Mistake::new(row.entry.at, format!("\"{}\" is {}, not a table", row.key, other.kind()))
                        .help(format!("write [{section}.{}] and the entries below it", row.key)),
                ),
            }
        }
        found
    }

    pub(super) fn executors(&mut self, tree: &Table) {
        for (name, at, table) in self.each(tree, "executor") {
            let mut r = TableReader::new(table, at, format!("executor \"{name}\""));
            let before = self.mistakes.len();
            let mut executor = ExecutorPlan { at, ..ExecutorPlan::new(name, None) };
            executor.policy = policy(&mut r, name);
            if let Some(n) = r.int("priority") {
                match u8::try_from(n).ok().filter(|n| (1..=94).contains(n)) {
                    Some(n) => executor.priority = Some(n),
                    None => {
                        let what = format!("\"priority\" is {n}, it must lie from 1 to 94");
                        r.report(
                            Mistake::new(r.place("priority"), what)
                                .help("95 and above belong to the witness"),
                        );
                    }
                }
            }
            let cpus = r.list("cpus");
            if cpus.is_some_and(<[Entry]>::is_empty) {
                r.report(none_to_run_on(r.place("cpus")));
            }
            for entry in cpus.unwrap_or_default() {
                match entry.value {
                    Value::Int(n @ 0..=1023) => executor.cpus.push(n as usize),
                    _ => r.report(Mistake::new(
                        entry.at,
                        format!("a processor is a number from 0, not {}", entry.value),
                    )),
                }
            }
            executor.spin = span_of_time(&mut r, "spin").unwrap_or(Duration::ZERO);
            r.finish(&mut self.mistakes);
            if self.mistakes.len() > before {
                self.spoiled.push(at);
            }
            self.plan.executors.push(executor);
        }
    }

    fn read_robots(&mut self, tree: &Table) {
        for (name, at, table) in self.each(tree, "robot") {
            self.check_name(name, at);
            let kind = self.registry.get(ROBOT);
            let mut params = Table::new();
            let mut model = Table::new();
            for row in table.rows() {
                let of_gate = kind.is_some_and(|kind| kind.params.iter().any(|field| field.name == row.key));
                if of_gate { params.push(row.clone()) } else { model.push(row.clone()) }
            }
            self.check_robot(name, at, &model);
            if let Some(kind) = kind {
                let inputs = kind.ports.iter().filter(|port| port.shape.input.is_some());
                self.plan.agents.push(AgentPlan {
                    name: name.to_owned(),
                    kind: ROBOT.to_owned(),
                    period: Some(hardware::robot::CYCLE),
                    on: inputs.map(|port| port.name.to_owned()).collect(),
                    executor: Some("gate".to_owned()),
                    params,
                    at,
                    ..AgentPlan::default()
                });
            }
        }
        if let Some(entry) = tree.get("robot")
            && let Value::Table(robots) = &entry.value
        {
            self.robots = robots.clone();
            self.plan.sections.set("robot", entry.clone());
        }
    }

    /// Checks the driver of a robot, and where that is the simulator also what the robot is made of.
    fn check_robot(&mut self, name: &str, at: Span, model: &Table) {
        let mut r = TableReader::new(model, at, format!("robot \"{name}\""));
        let driver = r.required_text("driver", "as in driver = \"sim\"");
        let place = r.place("driver");
        model.rows().iter().for_each(|row| r.allow(&row.key));
        r.finish(&mut self.mistakes);
        match driver.map(hardware::Spec::parse) {
            None => {}
            Some(Err(hardware::OpenError::Unknown { word, .. })) => {
                let drivers = ["sim", "carmen", "ticks", "replay"];
                let what = format!("there is no driver \"{word}\"");
                self.mistakes.push(unknown(place, what, &word, drivers));
            }
            Some(Err(error)) => self.mistakes.push(Mistake::new(place, error.to_string())),
            Some(Ok(hardware::Spec::Simulated)) => {
                Model::read(model, at, &OF_ROBOT, &mut self.mistakes);
            }
            Some(Ok(_)) => {
                let gate = self.registry.get(ROBOT).map(|kind| kind.params.iter().map(|field| field.name));
                for row in model.rows().iter().filter(|row| row.key != "driver") {
                    let what = format!("robot \"{name}\" has no entry \"{}\"", row.key);
                    let known = ["driver"].into_iter().chain(gate.clone().into_iter().flatten());
                    self.mistakes.push(unknown(row.key_at, what, &row.key, known));
                }
            }
        }
    }

    /// Messages carry names of a fixed size.
    pub(super) fn check_name(&mut self, name: &str, at: Span) {
        const ROOM: usize = 23;
        if name.is_empty() || name.len() > ROOM {
            let what = format!("\"{name}\" cannot be a name: it has {} letters", name.len());
            self.mistakes.push(Mistake::new(at, what).help(format!("a name has 1 to {ROOM} letters")));
        }
    }

    fn read_world(&mut self, tree: &Table) {
        for section in ["world", "goal", "vary"] {
            if let Some(entry) = tree.get(section) {
                self.plan.sections.set(section, entry.clone());
            }
        }
        let world = tree.get("world").and_then(|entry| self.world_of(entry));
        if let Some(entry) = tree.get("vary") {
            match &entry.value {
                Value::Table(table) => {
                    let vary = Vary::read(table, &mut self.mistakes);
                    vary.into_iter().for_each(|vary| self.draws(&vary));
                }
                other => self.say(entry.at, format!("\"vary\" is {}, not a section", other.kind())),
            }
        }
        let Some(entry) = tree.get("goal") else { return };
        match (&entry.value, world) {
            (Value::Table(table), Some(world)) => {
                drop(Goal::read(table, entry.at, &world, &mut self.mistakes))
            }
            (Value::Table(_), None) if tree.get("world").is_none() => {
                let what = "a goal is measured in a simulated world, and there is none";
                self.mistakes
                    .push(Mistake::new(entry.at, what).help("name one, as in world = \"laboratory\""));
            }
            // What is wrong with the world has been said.
            (Value::Table(_), None) => {}
            (other, _) => self.say(entry.at, format!("\"goal\" is {}, not a section", other.kind())),
        }
    }

    /// Draws lead to robots that there are, or into the world.
    fn draws(&mut self, vary: &Vary) {
        for (path, at) in vary.paths() {
            let mut words = path.split('.');
            let section = words.next().unwrap_or_default();
            if section == ROBOT {
                let name = words.next().unwrap_or_default();
                if self.robots.get(name).is_none() {
                    let known = self.robots.rows().iter().map(|row| row.key.as_str());
                    self.mistakes.push(Mistake::unknown(at, "robot", name, known));
                }
            } else if OF_SYSTEM.contains(&section) {
                let what = format!(
                    "\"{path}\" is drawn by no seed: it is an entry of neither the world nor a robot"
                );
                let help = "several values of an entry are for [compare], or for --set from run to run";
                self.mistakes.push(Mistake::new(at, what).help(help));
            }
        }
    }

    /// The world that the entry names or holds.
    fn world_of(&mut self, entry: &Entry) -> Option<WorldPlan> {
        let table = match &entry.value {
            Value::Table(table) => table.clone(),
            Value::Text(name) => {
                let found = Shelf::Worlds.find(name, &self.folder);
                let found =
                    found.map_err(|mistake| self.mistakes.push(Mistake { at: entry.at, ..mistake })).ok()?;
                let base = self.sources.add(found.name, found.text);
                tree::read(&self.sources, base, &mut self.mistakes)?
            }
            other => {
                let what = format!("\"world\" is {}, not the name of a world", other.kind());
                self.say(entry.at, what);
                return None;
            }
        };
        if let Some(Value::Table(vary)) = table.get("vary").map(|entry| &entry.value) {
            Vary::read(vary, &mut self.mistakes);
        }
        let plan = WorldPlan::read(&table, &mut self.mistakes);
        self.world = Some(table);
        plan
    }

    pub(super) fn say(&mut self, at: Span, what: String) {
        self.mistakes.push(Mistake::new(at, what));
    }
}

/// A thread that may run on no processor at all.
pub(super) fn none_to_run_on(at: Span) -> Mistake {
    Mistake::new(at, "\"cpus\" names no processor, and a thread needs one to run on")
        .help("as in cpus = [0], or leave it out for all of them")
}

/// The policy of an executor, and whether what else is written of it goes with that.
fn policy(r: &mut TableReader<'_>, name: &str) -> Policy {
    let Some(word) = r.text("policy") else { return Policy::default() };
    match Policy::ALL.into_iter().find(|policy| policy.name() == word) {
        Some(Policy::Deadline) => {
            for entry in ["priority", "cpus", "spin"] {
                if r.entry(entry).is_some() {
                    r.report(not_by_deadline(name, entry, r.place(entry)));
                }
            }
            Policy::Deadline
        }
        Some(Policy::Fifo) => {
            if r.entry("priority").is_none() {
                let what = format!("executor \"{name}\" has no priority under policy \"fifo\"");
                let help = "write priority = 60, say, or no policy for an ordinary thread";
                r.report(Mistake::new(r.place("policy"), what).help(help));
            }
            Policy::Fifo
        }
        None => {
            let what = format!("there is no policy \"{word}\"");
            r.report(unknown(r.place("policy"), what, word, Policy::ALL.map(Policy::name)));
            Policy::default()
        }
    }
}

/// A span of time that is not negative. A bare number is told which units there are.
pub(super) fn span_of_time(r: &mut TableReader<'_>, key: &str) -> Option<Duration> {
    let entry = r.entry(key)?;
    if let Some(number) = entry.value.as_float() {
        let what = format!("\"{key}\" is {number} without a unit");
        r.report(
            Mistake::new(entry.at, what)
                .help(format!("write \"{number}ms\" or \"{number}s\", with the quotes")),
        );
        return None;
    }
    let span = r.duration(key)?;
    if span > LONGEST {
        r.report(Mistake::new(entry.at, format!("\"{key}\" is {span}, which is longer than ten years")));
        return None;
    }
    if span < Duration::ZERO {
        r.report(Mistake::new(entry.at, format!("\"{key}\" is {span}, a time cannot be negative")));
        return None;
    }
    Some(span)
}
