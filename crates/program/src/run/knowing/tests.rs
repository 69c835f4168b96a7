//! Runs that read a store, and stores that change while runs go.

use std::fs;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex};

use knowledge::{DecisionTable, Item, Knowledge, Pattern, PatternKind, Schedule, When};
use proptest::prelude::*;
use runtime::{Agent, Fault, Options, Output, Registry, Simulation, Step};
use types::messages::Decision;
use types::params::Params;
use types::value::{Table, Value};
use types::{Duration, Time};

use super::known::{Known, Taken};
use super::watch::Watch;
use super::{Knowing, begin, firing};
use crate::cli::{ClockChoice, RunArgs};
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
        #[derive(clap::Parser)]
        struct Line {
            #[command(flatten)]
            run: RunArgs,
        }
        let system = self.0.join("small.toml").display().to_string();
        let words = ["run", &system].into_iter().chain(more.iter().copied());
        let line: Line = clap::Parser::try_parse_from(words).unwrap();
        line.run
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

#[test]
fn a_table_may_name_agents_that_this_run_leaves_out() {
    let eye = "[agent.eye]\nis = \"eye\"\nperiod = \"1s\"\n";
    let home = Home::new(&[SYSTEM, DECIDE, eye, KNOWS]);
    home.put(table(0.5));
    let only = ["--only", "decision,eye"];
    let (scenario, knowing, told) = home.begun(&only).unwrap();
    let scenario = options::only(&home.args(&only), scenario).unwrap();
    assert!(scenario.file.plan.agent("wall").is_none());
    with_watch((&scenario, &knowing), ClockChoice::Sim, |watch, asked| {
        home.put(table(0.75));
        watch.look(Duration::ZERO).unwrap();
        assert_eq!(asked.deeds()[0].what, "took table \"home\" version 2", "{told:?}");
    });
}

fn weight_in(plan: &runtime::Plan) -> f64 {
    let table = &plan.agent("decision").unwrap().params.get("table").unwrap().value;
    table.as_table().unwrap().at_path("free.wall").unwrap().value.as_float().unwrap()
}

#[test]
fn the_table_of_the_store_is_the_decision_makers() {
    let home = Home::new(&[SYSTEM, DECIDE, KNOWS]);
    home.put(table(0.25));
    home.put(table(0.5));
    let (scenario, knowing, told) = home.begun(&[]).unwrap();
    assert_eq!(weight_in(&scenario.file.plan), 0.5);
    assert_eq!(knowing.known.table.as_ref().unwrap().version, 2);
    assert!(told.lock().unwrap().is_empty());
}

#[test]
fn a_table_that_only_the_file_has_becomes_the_first_version() {
    let home = Home::new(&[SYSTEM, DECIDE, KNOWS]);
    let (scenario, _, told) = home.begun(&[]).unwrap();
    assert_eq!(weight_in(&scenario.file.plan), 1.0);
    let said = told.lock().unwrap().join("\n");
    assert!(
        said.starts_with("[decide] is now table \"home\", version 1, in ") && said.ends_with("home.db"),
        "{said}"
    );
    let mut store = home.store();
    assert_eq!(store.read().unwrap().newest("home").unwrap().unwrap().weights, table(1.0).weights);
    // The second time it is there.
    let (_, _, told) = home.begun(&[]).unwrap();
    assert!(told.lock().unwrap().is_empty());
    assert_eq!(store.read().unwrap().history("home").unwrap().len(), 1);
}

#[test]
fn the_command_line_names_a_store_in_the_place_of_the_files() {
    let home = Home::new(&[SYSTEM, DECIDE]);
    let other = home.0.join("other.db").display().to_string();
    let (scenario, knowing, _) = home.begun(&["--know", &other]).unwrap();
    assert!(knowing.store.ends_with("other.db") && knowing.store.exists(), "it is made");
    let text = plan_text(&scenario.prepare(1).unwrap());
    assert!(text.contains("[knowledge]\nfile = \"other.db\"\n"), "the log knows no folder: {text}");
    fs::write(&other, "this is a text").unwrap();
    let said = home.failure(&["--know", &other]);
    let wanted = "error: other.db is no knowledge base: it does not begin as a database does\n = help: it was left as it is; ";
    assert!(said.starts_with(wanted), "{said}");
}

#[test]
fn what_cannot_be_read_is_told_with_its_place_and_what_mends_it() {
    for (system, wanted) in [
        (
            format!("{SYSTEM}[knowledge]\nfile = \"nowhere/home.db\"\n"),
            "error: nowhere/home.db cannot be read or written: unable to open database file: nowhere/home.db
 --> small.toml:9:8
9 | file = \"nowhere/home.db\"
  |        ^^^^^^^^^^^^^^^^^
  = help: nothing was changed; look at the folder, the rights of both, and the room on the disk
",
        ),
        (
            format!("{SYSTEM}[knowledge]\nfile = \"small.toml\"\n"),
            "error: small.toml is no knowledge base: it does not begin as a database does
 --> small.toml:9:8
9 | file = \"small.toml\"
  |        ^^^^^^^^^^^^
  = help: it was left as it is; name another file, which is made when something is put into it
",
        ),
        (
            format!(
                "{SYSTEM}[knowledge]\nfile = \"home.db\"\nbegins = \"2026-02-30 07:59\"\ndecade = \"home\"\n"
            ),
            "error: \"begins\" is \"2026-02-30 07:59\", which is no date
  --> small.toml:10:10
10 | begins = \"2026-02-30 07:59\"
   |          ^^^^^^^^^^^^^^^^^^
   = help: a date is as in \"2026-03-02 07:59\", with or without the time of day, from 1678 to 2261

error: there is no entry in [knowledge] \"decade\"
  --> small.toml:11:1
11 | decade = \"home\"
   | ^^^^^^
   = help: did you mean \"decide\"?

2 errors
",
        ),
        (
            format!("{SYSTEM}[knowledge]\nfile = \"home.db\"\ndecide = \"hose\"\n"),
            "error: there is no decision table \"hose\" in home.db, and no section [decide]
  --> small.toml:10:10
10 | decide = \"hose\"
   |          ^^^^^^
   = help: did you mean \"home\"?
",
        ),
        (
            format!("{SYSTEM}[knowledge]\nfile = \"home.db\"\ndecide = \"garden\"\n"),
            "error: there is no decision table \"garden\" in home.db, and no section [decide]
  --> small.toml:10:10
10 | decide = \"garden\"
   |          ^^^^^^^^
   = help: put one: sinew know --file home.db put table garden FILE
",
        ),
        (
            "name = \"small\"\n[knowledge]\nfile = \"home.db\"\ndecide = \"home\"\n".to_owned(),
            "error: nobody reads the decision table
 --> small.toml:4:10
4 | decide = \"home\"
  |          ^^^^^^
  = help: add an agent with is = \"decision-maker\", or take \"decide\" out
",
        ),
        (
            format!("{SYSTEM}[knowledge]\n"),
            "error: [knowledge] needs \"file\", as in file = \"home.db\"
 --> small.toml:8:1
8 | [knowledge]
  | ^^^^^^^^^^^
",
        ),
    ] {
        let home = Home::new(&[&system]);
        home.put(table(0.5));
        assert_eq!(home.failure(&[]), wanted, "{system}");
    }
}

#[test]
fn a_table_with_mistakes_stops_the_start_with_its_name_version_and_place() {
    let home = Home::new(&[SYSTEM, DECIDE, KNOWS]);
    home.put(table(0.5));
    let mut bad = table(0.5);
    let mut row = Table::new();
    row.set("wal", Value::Float(1.0));
    bad.weights.set("danger.neer", Value::Table(row));
    home.put(bad);
    assert_eq!(
        home.failure(&[]),
        "error: there is no situation \"danger.neer\"
 --> table \"home\", version 2, in home.db:2:1
2 | \"danger.neer\" = { wal = 1.0 }
  | ^^^^^^^^^^^^^
  = help: did you mean \"danger.near\"?

error: there is no agent \"wal\"
 --> table \"home\", version 2, in home.db:2:19
2 | \"danger.neer\" = { wal = 1.0 }
  |                   ^^^
  = help: did you mean \"wall\"?

2 errors
"
    );
}

#[test]
fn an_agent_is_given_the_numbers_of_the_pattern_that_it_names() {
    let eye = "[agent.eye]\nis = \"eye\"\nperiod = \"1s\"\npattern = \"ball\"\n";
    let section = "[knowledge]\nfile = \"home.db\"\n";
    let home = Home::new(&[SYSTEM, eye, section]);
    let pattern = |name: &str, kind| {
        let mut parameters = Table::new();
        parameters.set("hue_from", Value::Int(350));
        parameters.set("saturation", Value::Float(0.4));
        let bytes = if kind == PatternKind::Image { vec![1] } else { Vec::new() };
        Pattern { name: name.into(), kind, media_type: String::new(), bytes, parameters }
    };
    home.put(pattern("bull", PatternKind::ColourRange));
    let said = home.failure(&[]);
    let wanted = "error: there is no pattern \"ball\" in home.db
  --> small.toml:11:11
11 | pattern = \"ball\"
   |           ^^^^^^
   = help: did you mean \"bull\"?
";
    assert_eq!(said, wanted);
    home.put(pattern("ball", PatternKind::Image));
    let said = home.failure(&[]);
    assert!(
        said.contains("\"ball\" in home.db cannot be used: it is a picture")
            && said.contains("small.toml:11"),
        "{said}"
    );
    home.put(pattern("ball", PatternKind::ColourRange));
    let (scenario, knowing, _) = home.begun(&[]).unwrap();
    let params = &scenario.file.plan.agent("eye").unwrap().params;
    assert_eq!(params.get("pattern").unwrap().value.to_string(), "{ hue_from = 350.0, saturation = 0.4 }");
    // The log holds the numbers, and a repeated run needs no store.
    let ready = scenario.prepare(1).unwrap();
    assert!(plan_text(&ready).contains("pattern = { hue_from = 350.0, saturation = 0.4 }"));
    assert_eq!(Known::of_note(&knowing.known.to_note()), Some(knowing.known.clone()));
    let without = Home::new(&[SYSTEM, eye]);
    let said = without.failure(&[]);
    assert!(said.contains("there is no store of patterns") && said.contains("--know FILE"), "{said}");
}

/// Ends the run as soon as something is told that has these words.
fn until(words: &'static str) -> (Arc<AtomicBool>, Told, impl Fn(&str) + Send + Sync + 'static) {
    let (end, told) = (Arc::new(AtomicBool::new(false)), Told::default());
    let (ends, tells) = (end.clone(), told.clone());
    let tell = move |text: &str| {
        tells.lock().unwrap().push(text.to_owned());
        if text.contains(words) {
            ends.store(true, Ordering::Relaxed);
        }
    };
    (end, told, tell)
}

#[test]
fn a_table_that_is_put_while_a_run_goes_is_taken_and_the_run_can_be_repeated() {
    let home = Home::new(&[SYSTEM, DECIDE, KNOWS]);
    let (end, told, tell) = until("version 2 since");
    let scenario = options::scenario(&home.args(&[]), registry()).unwrap();
    let (scenario, knowing) = begin(scenario, None, tell).unwrap();
    let knowing = knowing.unwrap();
    home.put(table(0.25));
    let limit = ["--for", "10000h"];
    let summary = home.run("first", &limit, None, (&scenario, &knowing), end);
    let told = told.lock().unwrap().join("\n");
    assert!(told.contains("decision: table \"home\" version 2 since "), "{told}");
    let took = summary.incidents.iter().find(|incident| incident.what == "took table \"home\" version 2");
    assert_eq!(took.unwrap().agent, "decision");
    let table =
        summary.agents.iter().find(|agent| agent.name == "decision").unwrap().params.get("table").unwrap();
    assert_eq!(table.value.to_string(), "{ free = { wall = 0.25 } }");

    // Whatever is in the store by then.
    home.put(self::table(0.75));
    let repeat = Repeat::read(&home.log("first"), "small").unwrap();
    assert!(
        repeat.asked.iter().any(|(_, words)| words.starts_with(&["set".into(), "decision".into()])),
        "{:?}",
        repeat.asked
    );
    let scenario = options::scenario(&home.args(&[]), registry()).unwrap();
    let (scenario, knowing) = begin(scenario, Some(&repeat), |_| {}).unwrap();
    assert_eq!(weight_in(&scenario.file.plan), 1.0, "as it was at its start");
    let again = home.run("again", &limit, Some(repeat), (&scenario, &knowing.unwrap()), Arc::default());
    assert_eq!(again.repeat.unwrap().differs, None);
    assert!(fs::read(home.log("first")).unwrap() == fs::read(home.log("again")).unwrap());
}

#[test]
fn a_table_that_is_refused_is_told_once_and_the_old_one_stays() {
    let home = Home::new(&[SYSTEM, DECIDE, KNOWS]);
    let (scenario, knowing, told) = home.begun(&[]).unwrap();
    with_watch((&scenario, &knowing), ClockChoice::Sim, |watch, asked| {
        watch.look(Duration::ZERO).unwrap();
        let mut bad = table(0.5);
        bad.weights.set("freee", bad.weights.get("free").unwrap().clone());
        home.put(bad);
        watch.look(Duration::ZERO).unwrap();
        home.put(schedule("bell", every(0, 1), "restart wall"));
        watch.look(Duration::ZERO).unwrap();
        assert_eq!(
            *told.lock().unwrap(),
            [
                knowing_first(&home),
                "decision: table \"home\" version 1 stays, for version 2 is refused (there is no situation \"freee\"; did you mean \"free\"?)".into(),
                "the schedules have changed; in simulated time that counts from the next run on".into(),
            ]
        );
        let kept = asked.deeds();
        assert_eq!(kept.len(), 1);
        assert!(
            kept[0].what.starts_with("kept table \"home\" version 1, for version 2 is refused ("),
            "{kept:?}"
        );
        home.put(table(0.75));
        watch.look(Duration::ZERO).unwrap();
        assert_eq!(asked.deeds()[1].what, "took table \"home\" version 3");
        home.store().remove(knowledge::Kind::Table, "home").unwrap();
        watch.look(Duration::ZERO).unwrap();
        let last = told.lock().unwrap().last().unwrap().clone();
        assert_eq!(last, "decision: there is no table \"home\" any more; version 3 stays");
    });
}

fn knowing_first(home: &Home) -> String {
    format!("[decide] is now table \"home\", version 1, in {}", home.0.join("home.db").display())
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

#[test]
fn schedules_fire_in_simulated_time_the_same_each_time() {
    let begins = "begins = \"2026-03-02 07:59\"\n";
    let home = Home::new(&[SYSTEM, DECIDE, KNOWS, begins]);
    home.put(schedule("bell", every(10, 30), "set wall keep=0.6"));
    home.put(schedule("eight", When::Cron("0 8 * * mon".parse().unwrap()), "set wall keep=0.7"));
    home.put(schedule("once", When::Once(Time::ZERO + Duration::secs(50)), "restart nobody"));
    home.put(schedule("wrong", every(0, 1), "falt wall panic"));
    let run = |out: &str| {
        let (scenario, knowing, told) = home.begun(&[]).unwrap();
        let told = told.lock().unwrap().last().cloned();
        (home.run(out, &["--for", "100s"], None, (&scenario, &knowing), Arc::default()), told)
    };
    let (summary, told) = run("first");
    let wrong =
        "warning: schedule \"wrong\" does not fire: there is no request \"falt\"; did you mean \"fault\"?";
    assert_eq!(told.as_deref(), Some(wrong));
    let fired: Vec<_> = summary
        .incidents
        .iter()
        .map(|incident| (incident.time.seconds(), incident.agent.as_str(), incident.what.as_str()))
        .collect();
    let (bell, keep) = ("schedule \"bell\"", "asked: set wall keep=0.6");
    assert_eq!(
        fired,
        [
            (10.0, bell, keep),
            (40.0, bell, keep),
            (
                50.0,
                "schedule \"once\"",
                "asked: restart nobody; refused: there is no agent \"nobody\"; it can be: decision, wall"
            ),
            (60.0, "schedule \"eight\"", "asked: set wall keep=0.7"),
            (70.0, bell, keep),
        ]
    );
    let text = summary.to_text(false);
    for line in [
        "schedule \"bell\" asked for \"set wall keep=0.6\" at 10 s, and 2 more times until 70 s\n",
        "schedule \"eight\" asked for \"set wall keep=0.7\" at 60 s\n",
        "schedule \"once\" asked for \"restart nobody\"; refused: there is no agent \"nobody\"; it can be: decision, wall at 50 s\n",
    ] {
        assert!(text.contains(line), "{line}: {text}");
    }
    run("second");
    let first = fs::read(home.log("first")).unwrap();
    assert!(first == fs::read(home.log("second")).unwrap(), "the same store, the same log");
    // The schedules of the log are asked again, and not those of the store.
    home.store().remove(knowledge::Kind::Schedule, "bell").unwrap();
    let repeat = Repeat::read(&home.log("first"), "small").unwrap();
    let scenario = options::scenario(&home.args(&[]), registry()).unwrap();
    let (scenario, knowing) = begin(scenario, Some(&repeat), |_| {}).unwrap();
    let limit = ["--for", "100s"];
    let again = home.run("again", &limit, Some(repeat), (&scenario, &knowing.unwrap()), Arc::default());
    assert_eq!(again.repeat.unwrap().differs, None);
    run("without");
    assert!(first != fs::read(home.log("without")).unwrap());
}

#[test]
fn schedules_fire_on_the_wall_clock_as_they_become_due_and_new_ones_too() {
    let home = Home::new(&[SYSTEM, DECIDE, KNOWS]);
    home.put(schedule("bell", every(10, 30), "set wall keep=0.6"));
    home.put(schedule("late", When::Once(Time::ZERO + Duration::secs(45)), "stop"));
    let (scenario, knowing, told) = home.begun(&[]).unwrap();
    with_watch((&scenario, &knowing), ClockChoice::Wall, |watch, asked| {
        let mut fired = |seconds: i64| {
            let before = asked.deeds().len();
            watch.look(Duration::secs(seconds)).unwrap();
            let deeds = asked.deeds().split_off(before);
            deeds.into_iter().map(|deed| format!("{}: {}", deed.agent, deed.what)).collect::<Vec<_>>()
        };
        let bell = "schedule \"bell\": asked: set wall keep=0.6";
        assert_eq!(fired(10), [] as [&str; 0], "a time is due when it is over");
        assert_eq!(fired(11), [bell]);
        assert_eq!(fired(39), [] as [&str; 0]);
        home.put(schedule("new", every(0, 20), "set wall keep=0.7"));
        home.put(schedule("wrong", every(0, 20), "falt wall"));
        let new = "schedule \"new\": asked: set wall keep=0.7";
        assert_eq!(fired(41), [bell, new]);
        assert_eq!(fired(50), ["schedule \"late\": asked: stop"]);
        home.store().remove(knowledge::Kind::Schedule, "bell").unwrap();
        assert_eq!(fired(101), [new, new, new]);
        let told = told.lock().unwrap();
        assert!(
            told.iter().filter(|text| text.contains("schedule \"wrong\" does not fire")).count() == 1,
            "{told:?}"
        );
    });
}

#[test]
fn a_run_that_has_ended_is_not_asked() {
    let home = Home::new(&[SYSTEM, DECIDE, KNOWS]);
    let (scenario, knowing, told) = home.begun(&[]).unwrap();
    let before = told.lock().unwrap().len();
    let ready = scenario.prepare(1).unwrap();
    let simulation = Simulation::new(&ready.plan, &ready.registry, Options::default()).unwrap();
    let mut watch = Watch::of(&knowing, &simulation.control(), &Asked::default(), ClockChoice::Sim).unwrap();
    drop(simulation);
    home.put(table(0.5));
    assert_eq!(watch.look(Duration::ZERO), Err(super::watch::Ended));
    assert_eq!(told.lock().unwrap().len(), before, "its end is no refusal");
}

#[test]
fn a_schedule_that_never_ends_asks_for_no_more_than_can_be() {
    let bell = [schedule("bell", every(0, 1), "restart wall")];
    let (firings, until) = firing::firings(&bell, Duration::ZERO, Some(Duration(i64::MAX)));
    assert_eq!((firings.len(), until), (100_000, Some(Duration::secs(100_000))));
    let (firings, until) = firing::firings(&bell, Duration::ZERO, None);
    assert_eq!((firings.len(), until), (86_400, None));
    let (firings, _) = firing::firings(&[], Duration::ZERO, Some(Duration(i64::MAX)));
    assert!(firings.is_empty());
}

fn known() -> impl Strategy<Value = Known> {
    let number = any::<f64>().prop_filter("finite", |x| x.is_finite()).prop_map(Value::Float);
    let value =
        prop_oneof![number, any::<bool>().prop_map(Value::Bool), any::<String>().prop_map(Value::Text)];
    let rows = prop::collection::btree_map(any::<String>(), value, 0..4);
    let rows = rows.prop_map(|rows| {
        let mut table = Table::new();
        rows.into_iter().for_each(|(key, value)| table.set(&key, value));
        table
    });
    let nested = (any::<String>(), rows.clone()).prop_map(|(key, rows)| {
        let mut table = Table::new();
        table.set(&key, Value::Table(rows));
        table
    });
    let when = prop_oneof![
        any::<i64>().prop_map(|at| When::Once(Time(at))),
        (any::<i64>(), any::<i64>())
            .prop_map(|(first, period)| When::Every { first: Time(first), period: Duration(period) }),
        Just(When::Cron("30 8 * * mon-fri".parse().unwrap())),
    ];
    let schedules = prop::collection::btree_map(
        any::<String>(),
        (when, prop::collection::vec(any::<String>(), 0..3)),
        0..4,
    );
    let patterns = prop::collection::btree_map(any::<String>(), rows, 0..3);
    let table = proptest::option::of((any::<u32>(), nested));
    (table, patterns, schedules).prop_map(|(table, patterns, schedules)| Known {
        table: table.map(|(version, table)| Taken { version, table }),
        patterns: patterns.into_iter().collect(),
        schedules: schedules
            .into_iter()
            .map(|(name, (when, words))| Schedule { name, when, words })
            .collect(),
    })
}

proptest! {
    #[test]
    fn what_is_known_is_read_from_a_log_as_it_was_written(known in known()) {
        prop_assert_eq!(Known::of_note(&known.to_note()), Some(known));
    }

    #[test]
    fn any_note_is_read_or_refused(text in "(decide|pattern|schedule) = [{} =a-z0-9\"\\[\\]]{0,30}|.{0,20}") {
        let _ = Known::of_note(&text);
    }
}
