//! Agents that ask what the system is made of, wire themselves, and choose to whom they send.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex};

use proptest::prelude::*;
use runtime::{
    Agent, AgentPlan, AgentState, Client, Decision, End, Fault, Input, Live, NotAsked, Observer, Options,
    Output, Overload, Params, Plan, PortAt, REQUESTS_UNDER_WAY, Recorder, Registry, Report, Router,
    Simulation, Step, Verdict, Why, WireFilter, WirePlan, Wiring, registry,
};
use types::messages::{Image, Twist};
use types::{Duration, Filter, Time};

use crate::{Answerer, Sink, Source, Written, at, heard, options, sink};

/// What agents wrote down of their decisions, under the name of their test.
static TOLD: Mutex<Vec<(String, String)>> = Mutex::new(Vec::new());

fn tell(test: &str, what: String) {
    TOLD.lock().unwrap().push((test.to_owned(), what));
}

fn told(test: &str) -> Vec<String> {
    let told = TOLD.lock().unwrap();
    told.iter().filter(|(name, _)| name == test).map(|(_, what)| what.clone()).collect()
}

/// Whose notes these are.
#[derive(Clone, Debug, Default, Params)]
struct Noted {
    /// The name of the test.
    test: String,
}

fn noted(test: &str) -> Noted {
    Noted { test: test.to_owned() }
}

/// Hears all outputs of speeds that there are but its own, whoever comes and goes, and takes no memory for it.
#[derive(Agent)]
struct Follower {
    /// What others send.
    count: Input<Twist>,
    /// Who there is.
    router: Router,
    /// What came, one after another.
    heard: Output<Twist>,
}

impl Agent for Follower {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        if let (Some(system), Some(own)) = (self.router.news(), self.router.own(&self.count)) {
            let others = system.outputs::<Twist>().filter(|output| output.agent().id() != own.agent);
            for output in others.filter(|output| !system.is_wired(output.at(), own)) {
                let _ = self.router.subscribe(&self.count, output);
            }
        }
        while let Some((_, decision)) = self.router.decision() {
            // On the wall clock somebody may go meanwhile, or what an instance before it asked for be done.
            let passes = |why| matches!(why, Why::Unknown | Why::AlreadyWired | Why::Busy);
            assert!(!matches!(decision, Decision::Refused { why, .. } if !passes(why)), "{decision:?}");
        }
        while let Some(twist) = self.count.take() {
            let twist = *twist;
            self.heard.send(twist);
        }
        Ok(())
    }
}

fn follower(plan: &mut Plan, test: &str) {
    let follower = plan.add::<Follower>("follower", Default::default());
    let end = plan.add::<Sink>("end", sink(test));
    plan.wire(&follower.heard, &end.count);
    plan.on("follower", "router");
    plan.on("follower", "count");
    plan.on("end", "count");
    let follower = plan.agent_mut("follower").unwrap();
    follower.executor = Some("reflex".into());
    // It writes down what it hears, and takes memory for that.
    plan.agent_mut("end").unwrap().executor = Some("ordinary".into());
}

fn source(name: &str, by: f64) -> AgentPlan {
    let mut plan = Plan::new("");
    plan.add::<Source>(name, crate::SourceParams { by });
    plan.every(name, Duration::millis(10));
    plan.agents.remove(0)
}

fn types() -> Registry {
    registry![Source, Sink, Follower, Chooser, Script, Answerer, Eager, Watcher, Restless]
}

fn simulate(plan: &Plan, millis: i64) -> Report {
    Simulation::new(plan, &types(), options(millis)).unwrap().run().unwrap()
}

fn wires(report: &Report) -> Vec<(String, String)> {
    report.view.wires.iter().map(|wire| (wire.from.clone(), wire.to.clone())).collect()
}

fn nobody_took_memory(report: &Report) {
    assert!(report.view.allocations_watched);
    let real_time =
        |name: &str| report.view.executors.iter().any(|executor| executor.name == name && executor.real_time);
    let agents = report.view.agents.iter().filter(|agent| real_time(&agent.executor));
    let agents = agents.map(|agent| (agent.name.clone(), agent.counts.allocations));
    let executors = report.view.executors.iter().filter(|executor| executor.real_time);
    let executors = executors.map(|executor| (executor.name.clone(), executor.allocations));
    let took: Vec<_> = agents.chain(executors).filter(|(_, took)| *took > 0).collect();
    assert!(took.is_empty(), "{took:?}");
}

#[test]
fn it_hears_whoever_sends_and_follows_those_who_come_and_go() {
    let mut plan = Plan::new("follow");
    plan.agents.push(source("first", 1.0));
    follower(&mut plan, "follow");
    plan.requests = vec![at(55, "add second source"), at(105, "remove first")];
    let report = simulate(&plan, 150);
    let heard: Vec<(i64, i64)> = heard("follow")
        .iter()
        .map(|(time, twist)| (time.since_start().0 / 1_000_000, twist.linear as i64))
        .collect();
    // The first message goes out at the instant at which it is decided that somebody listens. The second source begins when it comes.
    let first = (1..=10).map(|n| (n * 10, n + 1));
    let second = (1..=9).map(|n| (55 + n * 10, n + 1));
    let expected: BTreeSet<(i64, i64)> = first.chain(second).collect();
    assert_eq!(heard, expected.into_iter().collect::<Vec<_>>());
    let ends = [("follower.heard", "end.count"), ("second.out", "follower.count")];
    let ends = ends.map(|(from, to)| (from.to_owned(), to.to_owned()));
    assert_eq!(wires(&report), ends, "people see the wires that agents asked for");
    let ports = &report.view.agents.iter().find(|agent| agent.name == "follower").unwrap().ports;
    let router = ports.iter().find(|port| port.name == "router").unwrap();
    assert_eq!((router.direction.name(), router.asked), ("router", Some((2, 0))));
    nobody_took_memory(&report);
}

/// Ends a run when a test has heard enough.
struct Enough(&'static str, usize);

impl Observer for Enough {
    fn every(&self) -> Duration {
        Duration::millis(10)
    }
    fn observe(&mut self, _: Time, _: &[runtime::Incident]) -> Verdict {
        match heard(self.0).len() >= self.1 {
            true => Verdict::End("enough".into()),
            false => Verdict::GoOn,
        }
    }
}

#[test]
fn on_the_wall_clock_it_takes_no_memory_and_hears_the_same() {
    let mut plan = Plan::new("follow-wall");
    plan.agents.push(source("first", 1.0));
    follower(&mut plan, "follow-wall");
    plan.requests = vec![
        at(50, "add second source"),
        at(100, "fault follower panic"),
        at(150, "add third source"),
        at(200, "remove first"),
        at(250, "restart follower"),
        at(300, "remove second"),
    ];
    // Only the third sends so many.
    let observer = Box::new(Enough("follow-wall", 150));
    let options = Options { observer, ..options(20_000) };
    let report = Live::new(&plan, &types(), options).unwrap().run().unwrap();
    assert_eq!(report.ended, "enough", "{:?}", report.incidents);
    let follower = report.view.agents.iter().find(|agent| agent.name == "follower").unwrap();
    // On a busy machine it is asked to begin anew while it is dead still, and does both in one.
    assert_eq!(follower.counts.panics, 1);
    assert!((1..=2).contains(&follower.counts.restarts), "{:?}", report.incidents);
    let ends = [("follower.heard", "end.count"), ("third.out", "follower.count")];
    assert_eq!(wires(&report), ends.map(|(from, to)| (from.to_owned(), to.to_owned())));
    nobody_took_memory(&report);
}

/// Sends its count to the listeners whose names begin with `pick`, in turn, one at a time; wires itself to them.
#[derive(Agent)]
struct Chooser {
    /// The count.
    out: Output<Twist>,
    /// Who listens.
    router: Router,
    params: Noted,
    n: u32,
    picked: Vec<PortAt>,
}

impl Agent for Chooser {
    fn start(&mut self, _: &mut Step) -> Result<(), Fault> {
        let system = self.router.system();
        self.picked = system
            .inputs::<Twist>()
            .filter(|input| input.agent().name().starts_with("pick"))
            .map(|input| input.at())
            .collect();
        for input in &self.picked {
            self.router.connect(&self.out, *input).map_err(Fault::of)?;
        }
        Ok(())
    }

    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        if self.router.decision().is_some() || self.picked.is_empty() {
            return Ok(());
        }
        self.n += 1;
        let chosen = self.picked[self.n as usize % self.picked.len()].agent;
        let sent = self.out.send_to(chosen, Twist::new(f64::from(self.n), 0.0));
        tell(&self.params.test, format!("{}: {}", step.name_of(chosen).unwrap_or_default(), sent.taken));
        Ok(())
    }
}

#[test]
fn it_chooses_one_of_those_who_listen() {
    let mut plan = Plan::new("choose");
    plan.add::<Chooser>("chooser", noted("choose"));
    plan.every("chooser", Duration::millis(10));
    for name in ["pick-a", "pick-b", "all", "other"] {
        plan.add::<Sink>(name, sink(&format!("choose-{name}")));
        plan.on(name, "count");
    }
    plan.wires.push(WirePlan::new("chooser.out", "all.count"));
    simulate(&plan, 70);
    let heard = |name: &str| -> Vec<i64> {
        heard(&format!("choose-{name}")).iter().map(|(_, twist)| twist.linear as i64).collect()
    };
    // Two steps take decisions. What is sent before anybody is wired finds nobody.
    let all = told("choose");
    assert_eq!(all[0], "pick-b: 0");
    assert!(all[1..].iter().all(|sent| sent.ends_with(": 1")), "{all:?}");
    let (a, b) = (heard("pick-a"), heard("pick-b"));
    assert!(a.len() >= 2 && b.len() >= 2, "{a:?} {b:?}");
    assert!(a.iter().all(|n| n % 2 == 0) && b.iter().all(|n| n % 2 == 1), "{a:?} {b:?}");
    assert_eq!(heard("all"), [0i64; 0], "others who are wired hear nothing of it");
    assert_eq!(heard("other"), [0i64; 0]);
}

/// Does what its lines say, one a step, and writes down what became of each.
#[derive(Agent)]
struct Script {
    /// Speeds.
    count: Input<Twist>,
    /// Pictures.
    picture: Input<Image>,
    /// Speeds.
    out: Output<Twist>,
    /// Halves.
    half: Client<Twist, Twist>,
    /// The router.
    router: Router,
    params: Lines,
    line: usize,
    /// A port that nobody ever put in front of anything.
    strange: (Input<Twist>,),
}

/// What it does.
#[derive(Clone, Debug, Default, Params)]
struct Lines {
    /// The name of the test.
    test: String,
    /// Lines, divided by `;`.
    lines: String,
}

impl Script {
    fn asks(&self, line: &str) -> Result<(), NotAsked> {
        let words: Vec<&str> = line.split(' ').collect();
        let router = &self.router;
        let filter = Filter { marker: Some(7), ..Filter::ALL };
        let special = Wiring { depth: Some(2), overload: Some(Overload::Refuse), filter, serving: None };
        match words[..] {
            ["subscribe", from] => router.subscribe(&self.count, from),
            ["specially", from] => router.subscribe_with(&self.count, from, special),
            ["pictures", from] => router.subscribe(&self.picture, from),
            ["strange", from] => router.subscribe(&self.strange.0, from),
            ["unsubscribe", from] => router.unsubscribe(&self.count, from),
            ["connect", to] => router.connect(&self.out, to),
            ["disconnect", to] => router.disconnect(&self.out, to),
            ["call", to] => router.connect(&self.half, to),
            ["hang-up", to] => router.disconnect(&self.half, to),
            _ => panic!("{line}"),
        }
        .map(drop)
    }
}

impl Agent for Script {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        while let Some((_, decision)) = self.router.decision() {
            let said = match decision {
                Decision::Done => "done".to_owned(),
                Decision::Refused { why, what } => format!("{why:?}: {what}"),
            };
            tell(&self.params.test, said);
        }
        // A decision makes it run at the same instant: one line for each ten milliseconds.
        if step.now.since_start().0 % 10_000_000 != 0
            || step.now.since_start().0 / 10_000_000 < self.line as i64
        {
            return Ok(());
        }
        if let Some(line) = self.params.lines.split("; ").nth(self.line).filter(|line| !line.is_empty()) {
            if let Err(error) = self.asks(line) {
                tell(&self.params.test, format!("{error:?}"));
            }
            self.line += 1;
        }
        while self.count.take().is_some() {}
        Ok(())
    }
}

fn script(plan: &mut Plan, test: &str, lines: &[&str]) {
    plan.add::<Script>("script", Lines { test: test.into(), lines: lines.join("; ") });
    plan.every("script", Duration::millis(10));
}

#[test]
fn what_is_wrong_is_refused_with_its_reason_and_nothing_changes() {
    let mut plan = Plan::new("refused-asks");
    plan.agents.push(source("source", 1.0));
    plan.add::<Answerer>("answerer", Default::default());
    plan.on("answerer", "half");
    let long = "a".repeat(96);
    let cases = [
        ("subscribe sorce.out", "Unknown: there is no agent \"sorce\"; did you mean \"source\"?"),
        ("subscribe source.uot", "Unknown: there is no port of source \"uot\"; did you mean \"out\"?"),
        ("subscribe source", "Unknown: \"source\" is no port; write it as in \"sonar.filtered\""),
        ("pictures source.out", "Unfit: source.out sends Twist, script.picture takes Image"),
        ("subscribe script.count", "Unfit: script.count sends nothing, script.count takes Twist"),
        ("connect answerer.half", "Unfit: script.out sends Twist, answerer.half takes Twist"),
        ("unsubscribe source.out", "NotWired: source.out is not wired to script.count"),
        ("subscribe source.out", "done"),
        ("subscribe source.out", "AlreadyWired: source.out is already wired to script.count"),
        ("strange source.out", "NotMine"),
        (&format!("subscribe {long}"), "NameTooLong"),
        ("unsubscribe source.out", "done"),
        ("call answerer.half", "done"),
        ("hang-up answerer.half", "done"),
    ];
    script(&mut plan, "refused-asks", &cases.map(|(line, _)| line));
    let report = simulate(&plan, 300);
    assert_eq!(told("refused-asks"), cases.map(|(_, told)| told));
    assert_eq!(wires(&report), []);
}

#[test]
fn a_wire_is_as_it_was_asked_for() {
    let mut plan = Plan::new("special");
    plan.agents.push(source("source", 1.0));
    script(&mut plan, "special", &["specially source.out"]);
    let report = simulate(&plan, 50);
    let wire = &report.view.wires[0];
    let filter = WireFilter { marker: Some(7), ..WireFilter::default() };
    assert_eq!((wire.depth, wire.overload, &wire.filter), (2, Overload::Refuse, &filter));
}

/// Asks for the same in every step, and never takes a decision.
#[derive(Agent)]
struct Eager {
    /// Speeds.
    count: Input<Twist>,
    /// The router.
    router: Router,
    params: Noted,
}

impl Agent for Eager {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        let asked = self.router.subscribe(&self.count, "source.out");
        tell(&self.params.test, format!("{:?} {}", asked.err(), self.router.under_way()));
        Ok(())
    }
}

#[test]
fn who_asks_in_every_step_and_takes_no_decision_is_turned_away_and_counted() {
    let mut plan = Plan::new("eager");
    plan.agents.push(source("source", 1.0));
    plan.add::<Eager>("eager", noted("eager"));
    plan.every("eager", Duration::millis(10));
    // Another instance starts anew: what was decided for the one before it does not stand in its way.
    plan.requests = vec![at(205, "restart eager")];
    let report = simulate(&plan, 400);
    let told = told("eager");
    let asked = (1..=REQUESTS_UNDER_WAY).map(|n| format!("None {n}"));
    let turned_away = |steps: usize| {
        std::iter::repeat_n(format!("Some(TooMany) {REQUESTS_UNDER_WAY}"), steps - REQUESTS_UNDER_WAY)
    };
    // Decisions make it run, too: each gives a step more at the same instant, in which it asks again.
    let (first, second) = told.split_at(told.iter().rposition(|told| told == "None 1").unwrap());
    for life in [first, second] {
        let expected: Vec<String> = asked.clone().chain(turned_away(life.len())).collect();
        assert_eq!(life, expected);
    }
    let eager = report.view.agents.iter().find(|agent| agent.name == "eager").unwrap();
    let asked = eager.ports[1].asked.unwrap();
    let all = 2 * REQUESTS_UNDER_WAY as u64;
    assert_eq!(asked, (all, told.len() as u64 - all));
}

/// Looks at everything in every step, and writes down what it sees of it.
#[derive(Agent)]
struct Watcher {
    /// The router.
    router: Router,
    params: Noted,
}

impl Agent for Watcher {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        let before = self.router.version();
        let Some(system) = self.router.news() else { return Ok(()) };
        let state = |state| if state == AgentState::Running { "" } else { "!" };
        let members: Vec<String> = system
            .members()
            .map(|member| format!("{}{}:{}", state(member.state()), member.name(), member.kind()))
            .collect();
        let end = |end: End<'_>| match end {
            End::Port(port) => format!("{}.{}", port.agent().name(), port.name()),
            End::Queue(queue) => queue.name().to_owned(),
        };
        let wires: Vec<String> =
            system.wires().map(|wire| format!("{}>{}", end(wire.from), end(wire.to))).collect();
        let joined: Vec<&str> = system.joined_since(before).map(|member| member.name()).collect();
        let left: Vec<&str> = system.left_since(before).map(|left| &*left.name).collect();
        assert_eq!(system.member_at(step.agent).map(|own| own.name()), Some("watcher"));
        let joined = if before == 0 { Vec::new() } else { joined };
        let at = step.now.since_start().0 / 1_000_000;
        let line = format!(
            "{at} {} | {} | +{} -{}",
            members.join(" "),
            wires.join(" "),
            joined.join(","),
            left.join(",")
        );
        tell(&self.params.test, line);
        Ok(())
    }
}

fn watcher(plan: &mut Plan, test: &str) {
    plan.add::<Watcher>("watcher", noted(test));
    plan.on("watcher", "router");
}

#[test]
fn who_looks_sees_all_that_changes_and_when() {
    let mut plan = Plan::new("look");
    plan.agents.push(source("source", 1.0));
    plan.add::<Sink>("sink", sink("look"));
    plan.on("sink", "count");
    watcher(&mut plan, "look");
    plan.requests = vec![
        at(15, "wire source.out sink.count"),
        at(25, "set source by 2"),
        at(35, "fault sink panic"),
        at(165, "queue work"),
        at(175, "wire work sink.count"),
        at(185, "add more source"),
        at(195, "remove source"),
        at(205, "restart watcher"),
    ];
    simulate(&plan, 250);
    let nobody = "sink:sink source:source watcher:watcher";
    let wire = "source.out>sink.count";
    let expected = [
        format!("0 {nobody} |  | + -"),
        format!("15 {nobody} | {wire} | + -"),
        format!("40 !sink:sink source:source watcher:watcher | {wire} | + -"),
        format!("140 {nobody} | {wire} | + -"),
        format!("165 {nobody} | {wire} | + -"),
        format!("175 {nobody} | {wire} work>sink.count | + -"),
        format!("185 more:source {nobody} | {wire} work>sink.count | +more -"),
        "195 more:source sink:sink watcher:watcher | work>sink.count | + -source".to_owned(),
        "205 more:source sink:sink watcher:watcher | work>sink.count | + -".to_owned(),
    ];
    let told = told("look");
    // To another instance all is new, also who left.
    let last = expected[8].replace("+ -", "+ -source");
    assert_eq!(told[..8], expected[..8]);
    assert_eq!(told[8..], [last]);
}

#[test]
fn who_dies_hangs_or_goes_in_the_middle_leaves_wires_to_the_router_and_others_as_they_were() {
    for (test, request, runs) in [
        ("middle-panic", "fault follower panic", true),
        ("middle-hang", "fault follower hang", true),
        ("middle-restart", "restart follower", true),
        ("middle-replace", "replace follower follower", true),
        ("middle-remove", "remove follower", false),
    ] {
        let mut plan = Plan::new(test);
        follower(&mut plan, test);
        watcher(&mut plan, test);
        // They come and are asked for while the follower is about to go.
        plan.requests = (0..12)
            .flat_map(|n| [at(50 + n * 10, &format!("add s{n} source"))])
            .chain([at(100, request)])
            .collect();
        plan.requests.sort_by_key(|request| request.at);
        let report = simulate(&plan, 1500);
        let refused: Vec<_> = report.incidents.iter().filter(|it| it.what.contains("refused")).collect();
        assert!(refused.is_empty(), "{test}: {refused:?}");
        let to_follower = wires(&report).iter().filter(|(_, to)| to == "follower.count").count();
        assert_eq!(to_follower, if runs { 12 } else { 0 }, "{test}: {:?}", wires(&report));
        if runs {
            let late = heard(test).iter().filter(|(time, _)| *time > Time::from_seconds(1.4)).count();
            assert!(late >= 12 * 9, "{test}: it hears all of them again: {late}");
        }
    }
}

/// Asks for a wire and for its cut in turn: as soon as the one is decided, for the other.
#[derive(Agent)]
struct Restless {
    /// Speeds.
    count: Input<Twist>,
    /// The router.
    router: Router,
    params: Noted,
    n: u32,
}

impl Agent for Restless {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        while let Some((_, decision)) = self.router.decision() {
            assert_eq!(decision, Decision::Done);
            tell(&self.params.test, format!("{}", step.now.since_start().0 / 1000));
        }
        if self.router.under_way() == 0 {
            let asked = match self.n % 2 {
                0 => self.router.subscribe(&self.count, "source.out"),
                _ => self.router.unsubscribe(&self.count, "source.out"),
            };
            asked.map_err(Fault::of)?;
            self.n += 1;
        }
        Ok(())
    }
}

#[test]
fn an_agent_that_asks_at_each_decision_keeps_no_run_from_going_on() {
    let mut plan = Plan::new("restless");
    plan.agents.push(source("source", 1.0));
    plan.add::<Restless>("restless", noted("restless"));
    plan.every("restless", Duration::secs(1));
    simulate(&plan, 50);
    // At once where it is the first of its instant, else a millisecond later.
    assert_eq!(told("restless"), (0..=50).map(|n| format!("{}", n * 1000)).collect::<Vec<_>>());
}

fn written(plan: &Plan, millis: i64, control: impl FnOnce(&Simulation)) -> Vec<u8> {
    let bytes = Arc::<Mutex<Vec<u8>>>::default();
    let log = runtime::LogChoice::by(|_, _| 1);
    let recorder: Box<dyn Recorder> = Box::new(Written(bytes.clone()));
    let options = Options { recorder: Some(recorder), log, ..options(millis) };
    let simulation = Simulation::new(plan, &types(), options).unwrap();
    control(&simulation);
    simulation.run().unwrap();
    bytes.lock().unwrap().clone()
}

#[test]
fn two_runs_in_which_agents_wire_themselves_write_the_same_bytes_and_tell_of_it() {
    let run = || {
        let mut plan = Plan::new("ask-bytes");
        follower(&mut plan, "ask-bytes");
        plan.add::<Chooser>("chooser", noted("ask-bytes"));
        plan.every("chooser", Duration::millis(7));
        plan.requests = (0..20)
            .map(|n| at(10 + n * 11, &format!("add s{n} source")))
            .chain([at(120, "fault follower hang")])
            .collect();
        plan.requests.sort_by_key(|request| request.at);
        written(&plan, 1000, |_| {})
    };
    let (a, b) = (run(), run());
    assert!(a.len() > 10_000);
    assert!(a == b, "the bytes differ");
    let log = String::from_utf8_lossy(&a).into_owned();
    let said = "followerasked the router: wire s3.out follower.count";
    assert_eq!(log.matches(said).count(), 1);
    assert!(
        !log.contains("controlasked"),
        "nobody outside asked, so nothing is asked again when the run is repeated"
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// Whatever an agent asks for in whatever order: the wires are those of a plain set, each decision says whether that changed, and
    /// what was undone leaves nothing behind.
    #[test]
    fn the_wires_are_those_of_a_plain_set(asked in prop::collection::vec((0usize..4, 0usize..3), 1..30)) {
        static RUN: std::sync::atomic::AtomicU32 = std::sync::atomic::AtomicU32::new(0);
        let test = format!("set-{}", RUN.fetch_add(1, std::sync::atomic::Ordering::Relaxed));
        let mut plan = Plan::new(&test);
        for n in 0..3 {
            plan.agents.push(source(&format!("source{n}"), 1.0));
            plan.add::<Sink>(&format!("sink{n}"), sink("nobody asks"));
            plan.on(&format!("sink{n}"), "count");
        }
        let deeds = ["subscribe", "unsubscribe", "connect", "disconnect"];
        let mut lines: Vec<String> = Vec::new();
        let mut model = BTreeSet::new();
        let mut expected = Vec::new();
        for (deed, n) in &asked {
            let other = if *deed < 2 { format!("source{n}.out") } else { format!("sink{n}.count") };
            lines.push(format!("{} {other}", deeds[*deed]));
            let wire = if *deed < 2 { (other, "script.count".to_owned()) } else { ("script.out".to_owned(), other) };
            let makes = deed % 2 == 0;
            let changed = if makes { model.insert(wire) } else { model.remove(&wire) };
            expected.push(match (changed, makes) {
                (true, _) => "done",
                (false, true) => "AlreadyWired",
                (false, false) => "NotWired",
            });
        }
        let script_lines: Vec<&str> = lines.iter().map(String::as_str).collect();
        script(&mut plan, &test, &script_lines);
        let report = simulate(&plan, 10 * asked.len() as i64 + 20);
        let told: Vec<String> = told(&test).iter().map(|told| told.split(':').next().unwrap().to_owned()).collect();
        prop_assert_eq!(told, expected);
        let there: BTreeSet<(String, String)> = wires(&report).into_iter().collect();
        prop_assert_eq!(there, model);
    }
}
