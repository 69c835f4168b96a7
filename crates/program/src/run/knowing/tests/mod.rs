//! Runs that read a store, and stores that change while runs go.

mod live;
mod note;
mod schedules;
mod start;

use std::fs;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex};

use knowledge::{DecisionTable, Item, Knowledge, Pattern, PatternKind, Schedule, When};

use runtime::{Agent, Fault, Options, Output, Registry, Simulation, Step};
use types::messages::Decision;
use types::params::Params;
use types::value::{Table, Value};
use types::{Duration, Time};

use super::known::{Known, Taken};
use super::watch::{Ended, Watch};
use super::{Knowing, begin, firing};
use crate::cli::{ClockChoice, RunArgs, run_args};
use crate::error::{Failure, Paint};
use crate::run::asked::{Asked, Repeat};
use crate::run::prepare::Scenario;
use crate::run::summary::Summary;
use crate::run::{One, Place, options, plan_text, with_robots};

/// What an eye looks for.
#[derive(Clone, Debug, Default, Params)]
struct EyeParams {
    /// The colours.
    pattern: Table,
}

/// Looks for a pattern.
#[derive(Agent)]
struct Eye {
    /// What it sees.
    seen: Output<Decision>,
    params: EyeParams,
}

impl Agent for Eye {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        let _ = (&self.seen, &self.params.pattern);
        Ok(())
    }
}

fn registry() -> Registry {
    let mut registry = with_robots(agents::registry());
    registry.extend(runtime::registry![Eye].types().iter().cloned());
    registry
}

/// Somebody who decides over nobody that moves: a run of a day takes a moment.
const SYSTEM: &str = "name = \"small\"
[agent.decision]
is = \"decision-maker\"
period = \"100ms\"
[agent.wall]
is = \"wall-follower\"
period = \"200ms\"
";
const DECIDE: &str = "[decide]\nfree = { wall = 1.0 }\n";
const KNOWS: &str = "[knowledge]\nfile = \"home.db\"\ndecide = \"home\"\n";

/// A folder with a system and its store, gone after the test.
struct Home(PathBuf);

impl Drop for Home {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

type Told = Arc<Mutex<Vec<String>>>;

impl Home {
    fn new(parts: &[&str]) -> Home {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let folder = std::env::temp_dir().join(format!("sinew-knowing-{}-{number}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join("small.toml"), parts.concat()).unwrap();
        Home(folder)
    }

    fn store(&self) -> Knowledge {
        Knowledge::open(self.0.join("home.db")).unwrap()
    }

    fn put(&self, item: impl Into<Item>) {
        self.store().put(item).unwrap();
    }

    fn args(&self, more: &[&str]) -> RunArgs {
        let system = self.0.join("small.toml").display().to_string();
        run_args(&[&["run", &system], more].concat())
    }

    fn begun(&self, more: &[&str]) -> Result<(Scenario, Knowing, Told), Failure> {
        let told = Told::default();
        let tells = told.clone();
        let scenario = options::scenario(&self.args(more), registry())?;
        let (scenario, knowing) = begin(scenario, None, move |text| tells.lock().unwrap().push(text.into()))?;
        Ok((scenario, knowing.unwrap(), told))
    }

    /// Why it does not begin, for people; the folder is left out.
    fn failure(&self, more: &[&str]) -> String {
        let failure = self.begun(more).err().unwrap();
        failure.to_text(Paint::Plain).replace(&format!("{}/", self.0.display()), "")
    }

    /// Runs it in simulated time, with a log in `out`.
    fn run(
        &self,
        out: &str,
        more: &[&str],
        repeat: Option<Repeat>,
        (scenario, knowing): (&Scenario, &Knowing),
        asked_to_end: Arc<AtomicBool>,
    ) -> Summary {
        let folder = self.0.join(out);
        let folder = folder.to_str().unwrap();
        let args = self.args(&[more, &["--out", folder]].concat());
        let place = Place::of(&args, "small", 1).unwrap();
        let ready = scenario.prepare(1).unwrap();
        let one = One {
            facts: None,
            args: &args,
            scenario,
            seed: 1,
            clock: ClockChoice::Sim,
            watched: false,
            place,
            asked_to_end,
            serves: false,
            repeat,
            knowing: Some(knowing),
        };
        one.run(ready).unwrap()
    }

    fn log(&self, out: &str) -> PathBuf {
        self.0.join(out).join("run.mcap")
    }
}

fn table(weight: f64) -> DecisionTable {
    let mut row = Table::new();
    row.set("wall", Value::Float(weight));
    let mut weights = Table::new();
    weights.set("free", Value::Table(row));
    DecisionTable { name: "home".into(), weights, time: Time::ZERO }
}

fn schedule(name: &str, when: When, words: &str) -> Schedule {
    Schedule { name: name.into(), when, words: control::words::split(words).unwrap() }
}

fn every(first: i64, period: i64) -> When {
    When::Every { first: Time::ZERO + Duration::secs(first), period: Duration::secs(period) }
}

fn weight_in(plan: &runtime::Plan) -> f64 {
    let table = &plan.agent("decision").unwrap().params.get("table").unwrap().value;
    table.as_table().unwrap().at_path("free.wall").unwrap().value.as_float().unwrap()
}

/// A simulation that goes on until all is done, and a look at the store that is taken by hand.
fn with_watch(
    (scenario, knowing): (&Scenario, &Knowing),
    clock: ClockChoice,
    work: impl FnOnce(&mut Watch, &Asked),
) {
    let ready = scenario.prepare(1).unwrap();
    let asked = Asked::default();
    let end = Arc::new(AtomicBool::new(false));
    let judge = crate::run::Judge::new(&ready, end.clone(), asked.clone(), None);
    let options = Options { observer: Box::new(judge), parse: control::words::parse, ..Options::default() };
    let simulation = Simulation::new(&ready.plan, &ready.registry, options).unwrap();
    let control = simulation.control();
    std::thread::scope(|scope| {
        let run = scope.spawn(|| simulation.run().unwrap());
        let mut watch = Watch::of(knowing, &control, &asked, clock).unwrap();
        // The run ends also where the work does not.
        let ends = Ends(end);
        work(&mut watch, &asked);
        drop(ends);
        run.join().unwrap();
    });
}

struct Ends(Arc<AtomicBool>);

impl Drop for Ends {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}
