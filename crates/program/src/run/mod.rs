//! `sinew run`: from a name to a summary, a log and figures.
//!
//! ```text
//!   file ──load──▶ Scenario ──prepare(seed)──▶ Ready ──▶ Simulation or Live ──▶ Report ──▶ Summary
//!                                                ▲              │  │
//!                                     Judge ─────┘         log ◀┘  └▶ screen, control
//! ```

#[cfg(test)]
mod admitted;
mod asked;
mod barn;
mod burden;
mod compare;
#[cfg(test)]
mod deeds;
mod judge;
mod knowing;
mod many;
mod options;
mod place;
mod prepare;
mod recorder;
mod screen;
mod seeds;
mod serve;
mod summary;
mod tasks;
mod timing;
#[cfg(test)]
mod trial;
#[cfg(test)]
mod trouble;
mod useful;

use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, PoisonError};

use hardware::Berth;
use hardware::host::ProcHost;
use record::log::RunInfo;
use runtime::{CannotRun, Control, Host, Live, Options, Plan, Recorder, Registry, Report, Simulation};
use types::Duration;

use crate::cli::{ClockChoice, RunArgs, Speed};
use crate::doctor::probe;
use crate::error::Failure;
use crate::signals::Signals;
use crate::{figures, file, terminal};
use asked::Repeat;
use burden::Burdens;
use knowing::Knowing;
use place::Place;

pub(crate) use asked::Asked;
pub(crate) use burden::{BurdenArgs, burden};
pub(crate) use judge::{Facts, Judge, WORLD};
pub(crate) use prepare::{ROBOT_KIND, Ready, Scenario, WORLD_AGENT, WORLD_KIND};
pub(crate) use recorder::{LogFile, choice};
pub(crate) use serve::start as serve;
pub(crate) use summary::{Summary, failure, span, table};

/// How long a simulated system without a goal runs when nobody says: long enough to see what it does.
const WITHOUT_GOAL: Duration = Duration::secs(60);
/// How fast a run goes that people look at.
const WATCHED_SPEED: f64 = 10.0;

/// Runs what the command line says.
pub(crate) fn run(args: &RunArgs, registry: Registry, json: bool) -> Result<ExitCode, Failure> {
    if args.web.is_some() {
        terminal::tell("the web page is not there yet; the run goes on without it");
    }
    // Before any thread is there that could take one.
    let signals = Signals::take()
        .map_err(|error| Failure::new(format!("signals cannot be handled: {error}")).code(1))?;
    let scenario = options::scenario(args, with_robots(registry))?;
    let name = &scenario.file.plan.name;
    let repeat = args.repeat.as_ref().map(|path| Repeat::read(path, name)).transpose()?;
    let (scenario, knowing) = knowing::begin(scenario, repeat.as_ref(), terminal::tell)?;
    let scenario = options::only(args, scenario)?;
    let knowing = knowing.as_ref();
    if barn::is_meant(args)? {
        return barn::run(args, &scenario, signals.asked_to_end(), json);
    }
    if let Some(range) = args.seeds {
        return seeds::run(args, &scenario, knowing, range, signals.asked_to_end(), json);
    }
    let name = &scenario.file.plan.name;
    let seed = repeat.as_ref().map_or(args.seed, |repeat| repeat.seed);
    let ready = scenario.prepare(seed)?;
    let clock = options::clock(args, &ready)?;
    if repeat.is_some() && clock == ClockChoice::Wall {
        return Err(
            Failure::new("a run on the wall clock never happens twice").help("leave out --clock wall")
        );
    }
    if clock == ClockChoice::Wall {
        // In simulated time the judge stops them, at an instant that the log can tell.
        signals.stop(ready.robots.iter().map(|robot| robot.latch.clone()).collect());
        for told in options::absent_processors(&ready.plan, Path::new(options::PROCESSORS)) {
            terminal::tell(&format!("warning: {told}"));
        }
    }
    let asked_to_end = signals.asked_to_end().clone();
    let watched = !json && terminal::watched();
    let place = Place::of(args, name, seed)?;
    let (scenario, serves) = (&scenario, true);
    let whole = One {
        args,
        scenario,
        seed,
        clock,
        watched,
        place,
        asked_to_end,
        serves,
        repeat,
        knowing,
        facts: None,
    };
    let mut summary = whole.run(ready)?;
    if let Some(compared) = compare::asked(args, &whole.scenario.file.plan) {
        summary.compared = compare::run(&whole, &summary, &compared)?;
    }
    if json {
        terminal::say_json(&summary.to_json());
    } else {
        terminal::say(&summary.to_text(terminal::coloured()));
    }
    Ok(if summary.is_success() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// A registry that knows robots too, for reading files. Each run puts gates in the place of this type.
pub(crate) fn with_robots(mut registry: Registry) -> Registry {
    registry.extend([Berth::default().agent_type("robot")]);
    registry
}

/// One run of a scenario.
struct One<'a> {
    args: &'a RunArgs,
    scenario: &'a Scenario,
    seed: u64,
    clock: ClockChoice,
    /// Whether somebody looks at it on a terminal.
    watched: bool,
    place: Option<Place>,
    asked_to_end: Arc<AtomicBool>,
    /// Whether others can ask it while it runs.
    serves: bool,
    /// The log of the run that this one repeats.
    repeat: Option<Repeat>,
    /// What it knows from a store.
    knowing: Option<&'a Knowing>,
    /// Where the truth goes, where there is no log.
    facts: Option<Facts>,
}

impl One<'_> {
    fn run(&self, ready: Ready) -> Result<Summary, Failure> {
        let plays = self.clock == ClockChoice::Wall || self.virtual_processors(&ready).is_some();
        if !plays && !file::burdens(&ready.plan).is_empty() {
            let what = "a [burden] takes time of processors, and simulated steps take none here";
            return Err(
                Failure::new(what).help("write processors = 2 at the top of the file, or say --processors 2")
            );
        }
        let mut plan = ready.plan.clone();
        let mut firings = self.knowing.map(|knowing| knowing.firings(self.clock, self.limit(&ready)));
        let scheduled = firings.iter_mut().flatten().map(|firing| &mut firing.words);
        let said = file::calls::ready(&mut plan, scheduled, &ready.registry);
        let asked = Asked::of(&mut plan, firings.unwrap_or_default(), self.repeat.as_ref());
        let log = self.log(&ready, &asked)?;
        let facts = log.as_ref().map(|(_, facts, _)| facts.clone()).or_else(|| self.facts.clone());
        let judge = judge::Judge::new(&ready, self.asked_to_end.clone(), asked.clone(), facts);
        let judge = judge.paced(self.speed().filter(|_| self.clock == ClockChoice::Sim));
        let judge = judge.patient(self.args.give_up);
        let (recorder, outcome) = match log {
            Some((file, _, outcome)) => (Some(Box::new(file) as Box<dyn Recorder>), Some(outcome)),
            None => (None, None),
        };
        let options = Options {
            limit: self.limit(&ready),
            // The judge waits for the host's clock.
            speed: None,
            log: if recorder.is_some() {
                recorder::choice(&ready, self.args.images)
            } else {
                Default::default()
            },
            recorder,
            observer: Box::new(judge),
            admission: Some(ready.admission(self.processors(&ready), self.overhead(), self.args.force)),
            processors: self.virtual_processors(&ready),
            as_declared: file::as_declared(&ready.plan),
            burdens: if self.clock == ClockChoice::Sim { file::burdens(&ready.plan) } else { Vec::new() },
            host: (self.clock == ClockChoice::Wall).then(|| Box::new(ProcHost::new()) as Box<dyn Host>),
            parse: control::words::parse,
        };
        let report = self.play(&ready, &plan, &asked, options)?;
        let mut summary = Summary::new(&ready, self.seed, clock_name(self.clock), report);
        for incident in &mut summary.incidents {
            if let Some((bytes, words)) = said.iter().find(|(bytes, _)| incident.what.contains(bytes)) {
                incident.what = incident.what.replace(bytes, words);
            }
        }
        summary.done = useful::done(&ready, &summary.agents, summary.time);
        summary.images = self.args.images;
        summary.log = outcome.map(|outcome| outcome.lock().unwrap_or_else(PoisonError::into_inner).clone());
        summary.repeats(&asked);
        summary.tells(&asked);
        summary.repeat = self.repeat.as_ref().map(|repeat| self.compared(repeat, &ready));
        self.write_files(&mut summary);
        Ok(summary)
    }

    /// On how many virtual processors steps take their time; nothing where they take none.
    fn virtual_processors(&self, ready: &Ready) -> Option<usize> {
        let said = self.args.processors.map(usize::from).or_else(|| file::processors(&ready.plan));
        said.filter(|_| self.clock == ClockChoice::Sim)
    }

    /// How many processors admission counts with: those that are played, or those of the machine.
    fn processors(&self, ready: &Ready) -> usize {
        let there = || std::thread::available_parallelism().map_or(1, usize::from);
        self.virtual_processors(ready).unwrap_or_else(there)
    }

    /// What the runtime needs around a step: in simulated time nothing.
    fn overhead(&self) -> Duration {
        match self.clock {
            ClockChoice::Sim => Duration::ZERO,
            ClockChoice::Wall => probe::overhead().unwrap_or_default().median,
        }
    }

    /// What became of a repeated run.
    fn compared(&self, repeat: &Repeat, ready: &Ready) -> summary::Repeated {
        let log = self.place.as_ref().and_then(|place| place.log.as_ref());
        let differs = match log {
            Some(log) if repeat.plan == plan_text(ready) => asked::difference(&repeat.path, log),
            Some(_) => Some("the plan is another one".to_owned()),
            None => Some("nothing was logged that could be compared".to_owned()),
        };
        summary::Repeated { log: repeat.path.clone(), requests: repeat.asked.len(), differs }
    }

    fn log(
        &self,
        ready: &Ready,
        asked: &Asked,
    ) -> Result<Option<(recorder::LogFile, judge::Facts, recorder::SharedOutcome)>, Failure> {
        let Some(path) = self.place.as_ref().and_then(|place| place.log.as_ref()) else { return Ok(None) };
        let run = RunInfo {
            system: ready.plan.name.clone(),
            seed: Some(self.seed),
            clock: match self.clock {
                ClockChoice::Sim => record::log::Clock::Simulated,
                ClockChoice::Wall => record::log::Clock::Wall,
            },
            plan: plan_text(ready),
            notes: figures::notes(ready).into_iter().chain(self.knowing.map(Knowing::note)).collect(),
        };
        let facts = judge::Facts::default();
        let file = recorder::LogFile::create(path, &run, self.args.images, facts.clone(), asked.clone());
        let (file, outcome) = file.map_err(|error| {
            Failure::new(error.to_string()).help("--log names another file, --no-log writes none")
        })?;
        Ok(Some((file, facts, outcome)))
    }

    fn limit(&self, ready: &Ready) -> Option<Duration> {
        // The judge ends a run whose goal can no longer be met in time; the limit stands behind it.
        let of_goal = ready.goal.as_ref().map(|goal| goal.within + Duration::secs(1));
        let recorded =
            ready.robots.iter().any(|robot| robot.description.clock == hardware::ClockKind::Recorded);
        let usual = (self.clock == ClockChoice::Sim && !recorded).then_some(WITHOUT_GOAL);
        let of_plan = file::lasting(&ready.plan).filter(|_| self.clock == ClockChoice::Sim);
        self.args.limit.or(of_goal).or(of_plan).or(usual)
    }

    fn speed(&self) -> Option<f64> {
        match self.args.speed {
            Some(Speed::Times(times)) => Some(times),
            Some(Speed::Most) => None,
            None => self.watched.then_some(WATCHED_SPEED),
        }
    }

    /// Runs it, and meanwhile draws it and answers others.
    fn play(&self, ready: &Ready, plan: &Plan, asked: &Asked, options: Options) -> Result<Report, Failure> {
        let sources = &self.scenario.file.sources;
        let cannot = |error: CannotRun| summary::failure(error, sources);
        match self.clock {
            ClockChoice::Sim => {
                let simulation = Simulation::new(plan, &ready.registry, options).map_err(cannot)?;
                let beside = self.beside(ready, simulation.control(), asked)?;
                let report = simulation.run();
                beside.end();
                report.map_err(cannot)
            }
            ClockChoice::Wall => {
                let live = Live::new(plan, &ready.registry, options).map_err(cannot)?;
                let beside = self.beside(ready, live.control(), asked)?;
                let report = live.run();
                beside.end();
                report.map_err(cannot)
            }
        }
    }

    fn beside(&self, ready: &Ready, control: Control, asked: &Asked) -> Result<Beside, Failure> {
        Ok(Beside {
            server: if self.serves { serve::start(ready, &control, asked, self.clock) } else { None },
            burdens: (self.clock == ClockChoice::Wall)
                .then(|| Burdens::start(file::burdens(&ready.plan)))
                .flatten(),
            looking: self.knowing.and_then(|knowing| knowing.look(&control, asked, self.clock)),
            screen: if self.watched { Some(screen::Screen::start(ready, control)?) } else { None },
        })
    }

    fn write_files(&self, summary: &mut Summary) {
        let Some(place) = &self.place else { return };
        let timing = place.folder.join("timing.json");
        match std::fs::write(&timing, timing::to_json(summary).to_string()) {
            Ok(()) => summary.files.push(timing),
            Err(error) => {
                terminal::tell(&format!("warning: {} cannot be written: {error}", timing.display()))
            }
        }
        let Some(log) = &place.log else { return };
        if log.is_file() {
            summary.files.insert(0, log.clone());
        }
        let made = figures::of_log(log, &place.folder, Some(figures::timing(&summary.agents)));
        match made {
            Ok((files, tasks)) => {
                summary.files.extend(files);
                summary.tasks = tasks;
            }
            Err(error) => terminal::tell(&format!("warning: no figures: {error}")),
        }
    }
}

/// What goes on beside a run. All of it ends with the run.
struct Beside {
    burdens: Option<Burdens>,
    server: Option<serve::Serving>,
    looking: Option<knowing::Looking>,
    screen: Option<screen::Screen>,
}

impl Beside {
    fn end(self) {
        drop(self.burdens);
        drop(self.looking);
        drop(self.server);
        drop(self.screen);
    }
}

/// The system file of a run.
fn plan_text(ready: &Ready) -> String {
    file::write_plan(&plan_of_file(ready.plan.clone()))
}

/// The plan as its file has it: the gates' own types are a matter of the run, and so is the agent that changes its world.
pub(crate) fn plan_of_file(mut plan: Plan) -> Plan {
    plan.agents.retain(|agent| agent.kind != WORLD_KIND);
    for agent in plan.agents.iter_mut().filter(|agent| agent.kind.starts_with(ROBOT_KIND)) {
        agent.kind = "robot".to_owned();
    }
    plan
}

fn clock_name(clock: ClockChoice) -> &'static str {
    match clock {
        ClockChoice::Sim => "sim",
        ClockChoice::Wall => "wall",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use record::log::Reader;
    use runtime::TimedRequest;
    use types::Message as _;
    use types::messages::Transforms;

    /// Ten seconds of the scenario with a log; gives the log's bytes.
    fn log_of(seed: u64, folder: &Path) -> Vec<u8> {
        let path = folder.join(format!("{seed}.mcap"));
        log_to(&path, seed, &[], Duration::secs(10));
        std::fs::read(path).unwrap()
    }

    /// Runs the exploration as long as that, with these settings, and logs it.
    fn log_to(path: &Path, seed: u64, sets: &[String], limit: Duration) {
        let registry = with_robots(agents::registry());
        let scenario = Scenario { file: file::load("exploration", sets, &registry).unwrap(), registry };
        let ready = scenario.prepare(seed).unwrap();
        let facts = Facts::default();
        let run = RunInfo { notes: figures::notes(&ready), seed: Some(seed), ..RunInfo::default() };
        let (log, _) = LogFile::create(path, &run, 1.0, facts.clone(), Asked::default()).unwrap();
        let options = Options {
            limit: Some(limit),
            log: choice(&ready, 1.0),
            recorder: Some(Box::new(log)),
            observer: Box::new(Judge::new(&ready, Arc::default(), Asked::default(), Some(facts))),
            parse: control::words::parse,
            ..Options::default()
        };
        Simulation::new(&ready.plan, &ready.registry, options).unwrap().run().unwrap();
    }

    /// Runs the exploration with this asked in `[[at]]`, and gives its summary.
    fn summary_of(at: Duration, asked: &str, limit: Duration, give_up: Option<Duration>) -> Summary {
        let told = crate::cli::run_args(&["run", "exploration", "--no-log"]);
        let args = RunArgs { limit: Some(limit), give_up, ..told };
        let mut scenario = options::scenario(&args, with_robots(agents::registry())).unwrap();
        let words = control::words::split(asked).unwrap();
        scenario.file.plan.requests = vec![TimedRequest { at, words, place: Default::default() }];
        let ready = scenario.prepare(1).unwrap();
        let (clock, asked_to_end) = (ClockChoice::Sim, Arc::default());
        let one = One {
            args: &args,
            scenario: &scenario,
            seed: 1,
            clock,
            watched: false,
            place: None,
            asked_to_end,
            serves: false,
            repeat: None,
            knowing: None,
            facts: None,
        };
        one.run(ready).unwrap()
    }

    #[test]
    fn the_summary_tells_what_became_of_a_fault() {
        let secs = Duration::secs;
        let summary = summary_of(secs(8), "fault h1.sonar off", secs(60), Some(secs(20)));
        let document = summary.to_json();
        let fault = &document["incidents"][0];
        assert_eq!((&fault["what"], &fault["time_s"]), (&"asked: fault h1.sonar off".into(), &8.0.into()));
        let effect = fault["effect"].as_str().unwrap();
        assert!(
            effect.starts_with("it went on for 0.") && effect.contains(" and has stood since "),
            "{effect}"
        );
        assert_eq!(summary.ended, judge::GAVE_UP);
        assert!(summary.time < secs(35), "{}", summary.time);
        let text = summary.to_text(false);
        let told = "safety: blind: no ranges that can be trusted (at 8.";
        assert!(
            text.contains(told) && text.contains("the plan asked for \"fault h1.sonar off\" at 8 s; "),
            "{text}"
        );
    }

    #[test]
    fn the_summary_tells_who_set_the_latch_and_when() {
        let secs = Duration::secs;
        let nonsense = summary_of(secs(8), "fault drive garbage", secs(20), None);
        let document = nonsense.to_json();
        let latch = &document["robots"][0]["latch"];
        assert_eq!(latch["causes"], serde_json::json!(["nonsense"]));
        assert!((8.0..9.0).contains(&latch["set_s"].as_f64().unwrap()), "{latch}");
        assert!(document["incidents"][0]["effect"].as_str().unwrap().contains("(nonsense)"));
        let stop = summary_of(secs(3), "stop", secs(5), None);
        let text = stop.to_text(false);
        assert!(text.contains("the plan asked for \"stop\" at 3 s"), "{text}");
        assert!(text.contains("set at 3 s (person)"), "{text}");
    }

    #[test]
    fn pictures_of_any_size_are_logged_whole() {
        let path = std::env::temp_dir().join(format!("sinew-picture-{}.mcap", std::process::id()));
        let sets = ["robot.h1.camera.width=640", "robot.h1.camera.height=480"].map(str::to_owned);
        log_to(&path, 1, &sets, Duration::millis(200));
        let mut reader = Reader::open(&path).unwrap();
        let mut pictures = Vec::new();
        while let Some(message) = reader.next_message().unwrap() {
            if message.channel.topic == "/h1/image/compressed" {
                pictures.push(message.cdr.clone());
            }
        }
        std::fs::remove_file(&path).unwrap();
        assert_eq!(pictures.len(), 1);
        // The header of a PNG holds width and height, most significant byte first.
        let png = pictures[0].windows(4).position(|four| four == b"IHDR").unwrap();
        assert_eq!(pictures[0][png + 4..png + 12], [0, 0, 2, 128, 0, 0, 1, 224]);
    }

    #[test]
    fn the_same_seed_gives_the_same_log_with_pictures_truth_and_frame_tree_in_it() {
        let folder = std::env::temp_dir().join(format!("sinew-run-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let first = log_of(7, &folder);
        assert_eq!(first, log_of(7, &folder), "same plan and seed, same bytes");
        assert_ne!(first, log_of(8, &folder), "another seed is another run");
        let mut reader = Reader::open(folder.join("7.mcap")).unwrap();
        let mut counts = std::collections::BTreeMap::new();
        let mut last = types::Time::ZERO;
        let (mut edges, mut mounted) = (Vec::new(), std::collections::BTreeSet::new());
        while let Some(message) = reader.next_message().unwrap() {
            *counts.entry(message.channel.topic.clone()).or_insert(0) += 1;
            if message.channel.topic == "/truth/h1" {
                assert!(message.time >= last, "the truth is in order");
                last = message.time;
            }
            if message.channel.topic == "/tf" {
                edges.clear();
                let mut cdr = types::cdr::Reader::new(&message.cdr).unwrap();
                Transforms::decode(&mut cdr, &mut edges).unwrap();
                let of_base = edges.iter().filter(|edge| edge.parent.as_str() == "base_link");
                mounted.extend(of_base.map(|edge| edge.child.as_str().to_owned()));
            }
        }
        std::fs::remove_dir_all(&folder).unwrap();
        assert!((10..=11).contains(&counts["/h1/image/compressed"]), "one a second: {counts:?}");
        assert!((99..=101).contains(&counts["/truth/h1"]), "ten a second: {counts:?}");
        assert!(
            (109..=113).contains(&counts["/tf"]),
            "the mounts each second, the body ten times: {counts:?}"
        );
        let sonars: Vec<String> = (0..12).map(|k| format!("sonar_{k}")).collect();
        let missing: Vec<&String> = sonars.iter().filter(|sonar| !mounted.contains(*sonar)).collect();
        assert!(missing.is_empty() && mounted.contains("camera"), "{missing:?} are not in {mounted:?}");
        assert_eq!(counts["/sonar/filtered"], 41);
        assert!(!counts.contains_key("/h1/image"));
    }

    #[test]
    fn a_plan_is_the_files_again_without_the_gates() {
        let registry = with_robots(agents::registry());
        let loaded = file::load("exploration", &[], &registry).unwrap();
        let scenario = Scenario { file: loaded.clone(), registry };
        let ready = scenario.prepare(1).unwrap();
        assert_eq!(ready.plan.agents[0].kind, "robot h1");
        assert_eq!(plan_of_file(ready.plan), loaded.plan);
    }
}
