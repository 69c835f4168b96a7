//! Agents die under load, by chance, and the others miss nothing.
//!
//! ```text
//!   source0 → relay0 → sink0   survivors, spread over the executors; each source also sends to a victim, who sends to a sink of its own
//!      └────→ victim0 → after0 victims: they panic, hang, flood, are removed and come again
//! ```

use core::sync::atomic::{AtomicBool, Ordering};
use std::collections::BTreeMap;

use runtime::{
    Agent, AgentPlan, AgentView, Fault, FaultKind, Incident, Input, Live, Options, Output, Overload, Params,
    Plan, Registry, Report, Request, Simulation, Step, SystemView, WirePlan, registry,
};
use types::chance::Stream;
use types::messages::Twist;
use types::value::Value;
use types::{Duration, Time};

use crate::{Relay, Sink, Source, TimedRequest, at, heard, options, sink};

/// How many chains there are of survivors, and so many victims.
const CHAINS: usize = 6;
/// The executors on which nobody hangs, and that on which somebody may.
const CALM: [&str; 2] = ["reflex", "control"];
const WILD: &str = "vision";

/// Whether a victim that does not return from a step in which it goes on sending may end it.
static LET_GO: AtomicBool = AtomicBool::new(false);

/// Passes on what comes, until something happens to it.
#[derive(Agent)]
struct Victim {
    /// What comes.
    from: Input<Twist>,
    /// What goes.
    to: Output<Twist>,
    params: VictimParams,
}

/// What happens to it.
#[derive(Clone, Debug, Params)]
struct VictimParams {
    /// How many messages it sends for each that comes, besides that one.
    #[param(default = 0.0, min = 0.0)]
    flood: f64,
    /// Whether it goes on sending and does not return.
    #[param(default = false)]
    clings: bool,
}

impl Agent for Victim {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while let Some(twist) = self.from.take() {
            let twist = *twist;
            for _ in 0..=self.params.flood as u64 {
                self.to.send(twist);
            }
        }
        while self.params.clings && !LET_GO.load(Ordering::Acquire) {
            self.to.send(Twist::ZERO);
        }
        Ok(())
    }
}

fn types() -> Registry {
    registry![Source, Relay, Sink, Victim]
}

fn victim(i: usize) -> AgentPlan {
    let mut plan = AgentPlan { name: format!("victim{i}"), kind: "victim".into(), ..AgentPlan::default() };
    plan.executor = Some(if hangs(i) { WILD } else { CALM[i % 2] }.into());
    plan.on = vec!["from".into()];
    plan.hang_after = Some(Duration::millis(300));
    plan
}

/// Whether that victim may hang: then it stands where the time of survivors does not matter.
fn hangs(i: usize) -> bool {
    i % 3 == 2
}

fn plan(test: &str) -> Plan {
    let mut plan = Plan::new(test);
    for i in 0..CHAINS {
        let names = ["source", "relay", "sink", "after"].map(|name| format!("{name}{i}"));
        plan.add::<Source>(&names[0], Default::default());
        plan.every(&names[0], Duration::millis(5 + i as i64));
        plan.add::<Relay>(&names[1], Default::default());
        plan.on(&names[1], "from");
        for end in &names[2..] {
            plan.add::<Sink>(end, sink(&format!("{test}-{end}")));
            plan.on(end, "count");
        }
        plan.agents.push(victim(i));
        // The relay of one chain in three stands beside those who hang: it waits with them, and loses nothing.
        let executors = [CALM[i % 2], if hangs(i) { WILD } else { CALM[0] }, CALM[(i + 1) % 2], CALM[i % 2]];
        for (name, executor) in names.iter().zip(executors) {
            let agent = plan.agent_mut(name).unwrap();
            (agent.executor, agent.hang_after) = (Some(executor.into()), Some(Duration::secs(60)));
        }
        for (from, to, depth) in [
            (format!("source{i}.out"), format!("relay{i}.from"), 4096),
            (format!("relay{i}.to"), format!("sink{i}.count"), 4096),
            (format!("source{i}.out"), format!("victim{i}.from"), 16),
            (format!("victim{i}.to"), format!("after{i}.count"), 16),
        ] {
            let mut wire = WirePlan::new(from, to);
            (wire.depth, wire.overload) = (Some(depth), Some(Overload::Refuse));
            plan.wires.push(wire);
        }
    }
    plan
}

/// What happens by chance to a victim, in words; nothing happens to one that is not there.
fn mishap(draws: &Stream, here: &mut [bool; CHAINS]) -> Vec<String> {
    let i = draws.index(0, CHAINS);
    let name = format!("victim{i}");
    if !core::mem::replace(&mut here[i], true) {
        let wires = [format!("wire source{i}.out {name}.from"), format!("wire {name}.to after{i}.count")];
        return [vec![format!("add {name}")], wires.into()].concat();
    }
    vec![match draws.index(1, 6) {
        0 | 1 if hangs(i) => format!("fault {name} hang"),
        0..=2 => format!("fault {name} panic"),
        3 => format!("set {name} flood {}", [0, 40][draws.index(2, 2)]),
        4 => format!("restart {name}"),
        _ => {
            here[i] = false;
            format!("remove {name}")
        }
    }]
}

fn parse(words: &[String]) -> Result<Request, runtime::Refusal> {
    match words {
        [add, name] if add == "add" => {
            Ok(Request::Add(victim(name.trim_start_matches("victim").parse().unwrap())))
        }
        _ => crate::parse(words),
    }
}

fn schedule(seed: u64, seconds: i64) -> Vec<TimedRequest> {
    let (stream, mut here, mut time) = (Stream::new(seed, "deaths"), [true; CHAINS], 200);
    let mut requests = Vec::new();
    for n in 0.. {
        let draws = stream.sample(n);
        requests.extend(mishap(&draws, &mut here).iter().map(|words| at(time, words)));
        time += 20 + draws.index(3, 1200) as i64;
        if time > seconds * 1000 - 1000 {
            break;
        }
    }
    requests
}

/// What was heard at the end of a chain of survivors.
fn numbers(test: &str, i: usize) -> Vec<i64> {
    heard(&format!("{test}-sink{i}")).iter().map(|(_, twist)| twist.linear as i64).collect()
}

fn agent<'a>(view: &'a SystemView, name: &str) -> &'a AgentView {
    view.agents.iter().find(|agent| agent.name == name).unwrap()
}

/// Each death names its cause and is followed by a restart after a pause that doubles, or by being left dead after five in a minute.
/// Gives how many deaths there were.
fn deaths_are_in_order(incidents: &[Incident], is_exact: bool) -> usize {
    let mut of: BTreeMap<&str, Vec<&Incident>> = BTreeMap::new();
    for incident in incidents.iter().filter(|incident| incident.agent.starts_with("victim")) {
        of.entry(&incident.agent).or_default().push(incident);
    }
    let mut all = 0;
    for (name, incidents) in of {
        let mut deaths: Vec<Time> = Vec::new();
        let mut waits: Option<(Time, Duration)> = None;
        for Incident { time, what, .. } in incidents {
            if what == "started again" {
                let (died, pause) = waits.take().unwrap_or_else(|| panic!("{name}: nobody had died"));
                let waited = *time - died;
                let as_said = if is_exact { waited == pause } else { waited >= pause };
                assert!(as_said, "{name} waited {waited} and not {pause}");
                continue;
            }
            assert!(
                what.starts_with("panic: asked to panic") || what.starts_with("its step did not return"),
                "{name}: {what}"
            );
            all += 1;
            deaths.retain(|death| *death + Duration::secs(60) > *time);
            deaths.push(*time);
            let left = deaths.len() > 5;
            assert_eq!(what.ends_with("left dead after 5 restarts within a minute"), left, "{name}: {what}");
            waits = (!left)
                .then(|| (*time, Duration::millis(100 << (deaths.len() - 1).min(5)).min(Duration::secs(5))));
        }
    }
    all
}

/// What the schedule removes has a new life afterwards, of which this test does not know: its deaths are its own.
fn lives(report: &Report) -> Vec<Vec<Incident>> {
    let mut lives = vec![Vec::new()];
    for incident in &report.incidents {
        if incident.what.starts_with("asked: remove ") && !incident.what.contains("refused") {
            let name = incident.what.trim_start_matches("asked: remove ");
            let (its, others) =
                core::mem::take(&mut lives[0]).into_iter().partition(|i: &Incident| i.agent == name);
            lives[0] = others;
            lives.push(its);
        }
        lives[0].push(incident.clone());
    }
    lives
}

#[test]
fn in_simulated_time_the_survivors_hear_the_same_as_if_nobody_had_died() {
    const SECONDS: i64 = 90;
    let run = |test: &str, requests| {
        let plan = Plan { requests, ..plan(test) };
        let options = Options { parse, ..options(SECONDS * 1000) };
        Simulation::new(&plan, &types(), options).unwrap().run().unwrap()
    };
    let calm = run("deaths-calm", Vec::new());
    for seed in 1..=4 {
        let test = format!("deaths-{seed}");
        let report = run(&test, schedule(seed, SECONDS));
        for i in 0..CHAINS {
            let (theirs, expected) = (numbers(&test, i), numbers("deaths-calm", i));
            assert_eq!(theirs, expected, "seed {seed}, chain {i}");
            if !hangs(i) {
                let same = heard(&format!("{test}-sink{i}")) == heard(&format!("deaths-calm-sink{i}"));
                assert!(same, "seed {seed}, chain {i}: at other times, or other messages");
            }
            for name in ["source", "relay", "sink"].map(|name| format!("{name}{i}")) {
                // Who writes down what it hears takes memory for that, now and then.
                let of = |view| runtime::Counts { allocations: 0, ..agent(view, &name).counts };
                let (its, expected) = (of(&report.view), of(&calm.view));
                if !hangs(i) || name != format!("relay{i}") {
                    assert_eq!((its.missed, its.skipped), (0, 0), "seed {seed}: {name}");
                    assert!(hangs(i) || its == expected, "seed {seed}: {name}: {its:?}, not {expected:?}");
                }
            }
        }
        for wire in report
            .view
            .wires
            .iter()
            .filter(|wire| !wire.from.starts_with("victim") && !wire.to.starts_with("victim"))
        {
            assert_eq!((wire.sent, wire.dropped, wire.refused), (wire.taken, 0, 0), "seed {seed}: {wire:?}");
        }
        let deaths: usize = lives(&report).iter().map(|life| deaths_are_in_order(life, true)).sum();
        let hung = report.incidents.iter().filter(|i| i.what.starts_with("its step did not return")).count();
        println!("seed {seed}: {deaths} deaths, {hung} of them hung");
        assert!(deaths > 20 && hung > 2, "seed {seed}: {deaths} {hung}");
    }
}

#[test]
fn on_the_wall_clock_nothing_is_lost_between_survivors() {
    let test = "deaths-wall";
    let live = Live::new(&plan(test), &types(), Options { limit: None, ..options(0) }).unwrap();
    let control = live.control();
    let asker = std::thread::Builder::new().name("asker".into()).spawn(move || {
        let ask = |words: &str| {
            let words: Vec<String> = words.split(' ').map(str::to_owned).collect();
            control.request(parse(&words).unwrap())
        };
        // Half a minute in which nothing comes, and something is wrong.
        let wait = |what: &dyn Fn() -> bool| {
            (0..30_000).any(|_| {
                std::thread::park_timeout(std::time::Duration::from_millis(1));
                what()
            })
        };
        let goes_on = |by: usize| {
            let before: Vec<usize> = (0..CHAINS).map(|i| numbers(test, i).len()).collect();
            wait(&|| (0..CHAINS).all(|i| numbers(test, i).len() >= before[i] + by))
        };
        let (stream, mut here) = (Stream::new(5, "deaths on the wall"), [true; CHAINS]);
        let (mut hung, mut goes) = (0, true);
        for n in 0..60 {
            for words in mishap(&stream.sample(n), &mut here) {
                hung += usize::from(words.ends_with("hang"));
                // Five lost threads end a run.
                if !words.ends_with("hang") || hung <= 2 {
                    let _ = ask(&words);
                }
            }
            goes &= goes_on(3);
        }
        // One that goes on sending in a step that it does not leave.
        let there = |view: &SystemView| view.agents.iter().any(|agent| agent.name == "victim5");
        if !there(&control.view().unwrap()) {
            for words in ["add victim5", "wire source5.out victim5.from", "wire victim5.to after5.count"] {
                ask(words).unwrap();
            }
        }
        let _ = ask("restart victim5");
        let (agent, key) = ("victim5".to_owned(), "clings".to_owned());
        control.request(Request::Set { agent, key, value: Value::from(true) }).unwrap();
        let lost = |view: SystemView| agent_hangs(&view, "victim5");
        let before = lost(control.view().unwrap());
        let clings = wait(&|| lost(control.view().unwrap()) > before);
        let (agent, key) = ("victim5".to_owned(), "clings".to_owned());
        control.request(Request::Set { agent, key, value: Value::from(false) }).unwrap();
        goes &= goes_on(20);
        LET_GO.store(true, Ordering::Release);
        goes &= goes_on(20);
        for source in (0..CHAINS).map(|i| format!("source{i}")) {
            control.request(Request::Fault { target: source, fault: FaultKind::Off }).unwrap();
        }
        let all_taken =
            wait(&|| between_survivors(&control.view().unwrap()).all(|(sent, taken, _)| sent == taken));
        control.request(Request::Quit).unwrap();
        (goes, clings, all_taken)
    });
    let report = live.run().unwrap();
    let (goes, clings, all_taken) = asker.unwrap().join().unwrap();
    assert_eq!(report.ended, "asked to quit", "{:#?}", report.incidents);
    assert!(goes && clings && all_taken, "{goes} {clings} {all_taken} {:#?}", report.incidents);
    for i in 0..CHAINS {
        let numbers = numbers(test, i);
        assert_eq!(numbers, (1..=numbers.len() as i64).collect::<Vec<_>>(), "chain {i}");
        for name in ["source", "relay", "sink"].map(|name| format!("{name}{i}")) {
            let its = agent(&report.view, &name);
            assert_eq!((its.counts.panics, its.counts.hangs, its.counts.restarts), (0, 0, 0), "{name}");
            // How late they were is a matter of the machine; those beside the ones that hang waited for the watchdog.
            println!(
                "{name}: {} steps, {} late, {} of them while the machine stood still",
                its.counts.releases, its.counts.missed, its.counts.stalled
            );
        }
    }
    assert!(between_survivors(&report.view).all(|(_, _, lost)| lost == 0), "{:#?}", report.view.wires);
    // What was asked for stands there as well.
    let of_itself = || report.incidents.iter().filter(|incident| incident.agent != "control");
    let deaths = of_itself().filter(|incident| incident.what != "started again").count();
    println!("{deaths} deaths, {} stalls", report.stalls);
    for incident in of_itself() {
        let known = ["panic: asked to panic", "its step did not return", "started again"];
        assert!(known.iter().any(|cause| incident.what.starts_with(cause)), "{incident:?}");
        assert!(incident.agent.starts_with("victim"), "{incident:?}");
    }
}

fn agent_hangs(view: &SystemView, name: &str) -> u64 {
    view.agents.iter().find(|agent| agent.name == name).map_or(0, |agent| agent.counts.hangs)
}

/// What was sent, taken and lost on the wires between survivors.
fn between_survivors(view: &SystemView) -> impl Iterator<Item = (u64, u64, u64)> + '_ {
    let wires = view.wires.iter().filter(|wire| wire.to.starts_with("relay") || wire.to.starts_with("sink"));
    wires.map(|wire| (wire.sent, wire.taken, wire.dropped + wire.refused))
}
