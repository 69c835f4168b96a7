//! Methods, refinements and rest, and a manager that sees and sets them.

use super::*;
use runtime::{Admission, Burden, Given, Manager, Report};

/// Says by which method it works, and how often it refined.
#[derive(Agent)]
#[agent(methods(exact = 1.0, rough = 0.6), anytime)]
struct Worker {
    /// Method and refinements, as a speed.
    out: Output<Twist>,
    /// What makes it run, where its plan says so.
    from: Input<Twist>,
}

impl Agent for Worker {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        while self.from.take().is_some() {}
        while step.may_refine() {}
        if step.refined() > 0 {
            step.set_quality(1.0 - 0.5 / f64::from(step.refined()));
        }
        self.out.send(Twist::new(step.method as f64, step.refined().into()));
        Ok(())
    }
}

/// Notes what comes, with its quality.
#[derive(Agent)]
struct Ear {
    /// What comes.
    from: Input<Twist>,
}

impl Agent for Ear {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while let Some(heard) = self.from.take() {
            let quality = (heard.header().quality.share() * 100.0).round();
            runtime::note!("method {}, refined {}, quality {}", heard.linear, heard.angular, quality);
        }
        Ok(())
    }
}

/// Gives what its parameters say at the third look.
#[derive(Agent)]
struct Boss {
    /// What there is.
    manager: Manager,
    params: BossParams,
    looks: u32,
}

/// What it gives.
#[derive(Clone, Debug, Params)]
struct BossParams {
    /// Whom.
    whom: String,
    /// To which period.
    #[param(default = Duration::millis(40))]
    period: Duration,
    /// Whether to rest.
    rests: bool,
}

impl Agent for Boss {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        let Some(census) = self.manager.look() else { return Ok(()) };
        self.looks += 1;
        let (agents, host) = (census.residents.len(), self.manager.host());
        let load: f32 = host.processors.iter().sum();
        runtime::note!(
            "{} agents, load {} %, foreign {} %",
            agents,
            (load * 100.0).round(),
            (host.foreign * 100.0).round()
        );
        if let Some(agent) = census.residents.iter().find(|agent| agent.plan.name == "worker") {
            let millis = |period: Option<Duration>| period.map_or(0.0, |period| period.0 as f64 * 1e-6);
            let (asked, now) = (millis(agent.nominal.period), millis(agent.plan.period));
            runtime::note!("asked for {} ms, now {} ms", asked, now);
        }
        if let Some(refused) = &census.refused {
            runtime::note!("refused");
            assert!(refused.what.contains("must lie from"), "{refused}");
        }
        if self.looks == 3 {
            let given = Given {
                agent: self.params.whom.clone(),
                period: Some(self.params.period),
                is_suspended: self.params.rests,
                ..Given::default()
            };
            self.manager.give(vec![given], "it was told so".into());
        }
        Ok(())
    }
}

fn team() -> Plan {
    let mut plan = Plan::new("team");
    let worker = plan.add::<Worker>("worker", Default::default());
    let ear = plan.add::<Ear>("ear", Default::default());
    plan.wire(&worker.out, &ear.from);
    plan.every("worker", Duration::millis(20));
    plan.on("ear", "from");
    plan
}

fn words(words: &[String]) -> Result<Request, Refusal> {
    match &words.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["set", agent, key, value] => {
            let value = match *value {
                "true" | "false" => Value::Bool(*value == "true"),
                text => Value::Text(text.into()),
            };
            Ok(Request::Set { agent: (*agent).into(), key: (*key).into(), value })
        }
        ["fault", target, fault] => {
            Ok(Request::Fault { target: (*target).into(), fault: FaultKind::named(fault).unwrap() })
        }
        other => Err(Refusal::new(format!("{other:?}"))),
    }
}

fn run(mut plan: Plan, options: Options, requests: &[(i64, &str)]) -> Report {
    for (at, request) in requests {
        let words = request.split(' ').map(str::to_owned).collect();
        plan.requests.push(TimedRequest { at: Duration::millis(*at), words, place: Span::default() });
    }
    let limit = options.limit.or(Some(Duration::millis(99)));
    let options = Options { limit, parse: words, ..options };
    Simulation::new(&plan, &registry![Worker, Ear, Boss], options).unwrap().run().unwrap()
}

fn noted(report: &Report) -> Vec<(String, u64)> {
    report.noted.iter().map(|noted| (noted.what.clone(), noted.count)).collect()
}

fn said(report: &Report) -> Vec<&str> {
    report.incidents.iter().map(|incident| incident.what.as_str()).collect()
}

/// What each step sends, in the order of time: one look every 20 ms.
fn heard(plan: Plan, requests: &[(i64, &str)]) -> Vec<String> {
    use std::cell::RefCell;
    // Notes of one text are told together: each is looked at in a run that ends with it.
    let all = RefCell::new(Vec::new());
    for millis in [1, 21, 41, 61, 81] {
        let options = Options { limit: Some(Duration::millis(millis)), ..Options::default() };
        let due: Vec<_> = requests.iter().copied().filter(|(at, _)| *at < millis).collect();
        let report = run(plan.clone(), options, &due);
        all.borrow_mut().extend(report.noted.last().map(|noted| noted.what.clone()));
    }
    all.into_inner()
}

#[test]
fn a_method_is_chosen_and_changed_and_its_quality_travels() {
    let requests = [(10, "set worker method rough"), (50, "set worker method exact")];
    let told = heard(team(), &requests);
    let (exact, rough) = ("method 0, refined 0, quality 100", "method 1, refined 0, quality 60");
    assert_eq!(told, [exact, rough, rough, exact, exact]);
    let wrong =
        run(team(), Options::default(), &[(10, "set worker method ruogh"), (10, "set ear method exact")]);
    let said = said(&wrong);
    assert!(
        said[0].contains("no method of worker is called \"ruogh\"") || said[0].contains("\"rough\""),
        "{said:?}"
    );
    assert!(said[1].contains("a \"ear\" has no methods, but ear names \"exact\""), "{said:?}");
}

#[test]
fn refinements_fill_the_budget_and_what_they_cost_is_played() {
    let mut plan = team();
    let worker = plan.agent_mut("worker").unwrap();
    worker.methods = vec![("exact".into(), Duration::millis(4)), ("rough".into(), Duration::millis(1))];
    (worker.refinement, worker.budget) = (Some(Duration::millis(2)), Some(Duration::millis(11)));
    // 4 + 2 + 2 + 2 = 10 of 11; then 1 + 2 * 5 = 11; then 1 + 2 + 2 of 6.
    let requests = [(10, "set worker method rough"), (50, "set worker budget 6ms")];
    let told = heard(plan.clone(), &requests);
    assert_eq!(told[0], "method 0, refined 3, quality 84");
    assert_eq!(told[1], "method 1, refined 5, quality 90");
    assert_eq!(told[3], "method 1, refined 2, quality 75");
    let options = Options { processors: Some(1), ..Options::default() };
    let played = run(plan.clone(), options, &[]);
    let worker = &played.view.agents[0];
    assert_eq!((worker.exec.max, worker.exec.min), (10e6, 10e6), "what a step takes with three refinements");
    assert_eq!((worker.counts.refinements, worker.counts.overruns), (15, 0));
    assert!((worker.counts.quality_lost - 5.0 / 6.0).abs() < 0.02, "{}", worker.counts.quality_lost);
    let options = Options { processors: Some(1), ..Options::default() };
    // Three times as long: 12 is more than 11 already, and there is none.
    let heavy = run(plan, options, &[(10, "fault worker heavy")]);
    let worker = &heavy.view.agents[0];
    assert_eq!((worker.exec.max, worker.counts.refinements), (12e6, 3));
}

#[test]
fn what_does_not_fit_the_type_is_a_mistake_before_anything_begins() {
    let mut plan = team();
    plan.agent_mut("worker").unwrap().budget = Some(Duration::millis(5));
    let ear = plan.agent_mut("ear").unwrap();
    ear.budget = Some(Duration::millis(5));
    ear.giving.importance = Some(2.0);
    plan.add::<Boss>("boss", BossParams::default());
    plan.every("boss", Duration::millis(10));
    plan.agent_mut("boss").unwrap().executor = Some("control".into());
    let mistakes: Vec<String> = runtime::check(&plan, &registry![Worker, Ear, Boss])
        .into_iter()
        .map(|mistake| mistake.what)
        .collect();
    assert_eq!(
        mistakes,
        [
            "worker has a budget for refinements, and does not say what one takes",
            "ear has a budget, and a \"ear\" does not refine",
            "the importance of ear must lie from 0 to 1, not 2",
            "boss manages, and executor \"control\" is in real time: managing takes memory and locks",
        ]
    );
}

#[test]
fn who_is_suspended_makes_no_step_and_goes_on_with_what_came() {
    let requests = [(10, "set worker suspended true"), (50, "set worker suspended false")];
    let report = run(team(), Options::default(), &requests);
    // At 0, then anew from 50 on: 50, 70, 90.
    assert_eq!(report.view.agents[0].counts.releases, 4);
    assert_eq!(report.view.agents[0].counts.skipped, 0, "nothing is made up for");
    let requests = [(10, "set ear suspended true"), (50, "set ear suspended false")];
    let report = run(team(), Options::default(), &requests);
    let ear = &report.view.agents[1];
    // 0, then 20 and 40 at 50, then 60 and 80.
    assert_eq!(ear.counts.releases, 4);
    assert_eq!(report.view.wires[0].taken, 5, "and nothing was lost");
    let played = Options { processors: Some(1), ..Options::default() };
    let report = run(team(), played, &requests);
    assert_eq!(report.view.agents[1].response.max, 0.0, "what waited was released when it went on");
    let report = run(team(), Options::default(), &[(10, "set ear suspended true")]);
    assert!(report.view.agents[1].is_suspended);
    assert_eq!(report.view.agents[1].counts.releases, 1);
}

fn managed(rests: bool, period: i64) -> Plan {
    let mut plan = team();
    let worker = plan.agent_mut("worker").unwrap();
    worker.period_range = Some((Duration::millis(20), Duration::millis(50)));
    let (whom, period) = ("worker".to_owned(), Duration::millis(period));
    plan.add::<Boss>("boss", BossParams { whom, period, rests });
    plan.every("boss", Duration::millis(100));
    plan.agent_mut("boss").unwrap().executor = Some("ordinary".into());
    plan
}

#[test]
fn a_manager_sets_what_agents_may_use_and_what_was_asked_for_stays_known() {
    let secs = |secs| Options { limit: Some(Duration::secs(secs)), ..Options::default() };
    let report = run(managed(false, 40), secs(1), &[]);
    // The first look finds nothing, so the third is at 300 ms: 15 steps until 280, the next after 40 ms at 320, and so to 1 s.
    assert_eq!(report.view.agents[0].period, Some(Duration::millis(40)));
    assert_eq!(
        report.view.agents[0].counts.releases,
        15 + 1 + 17,
        "from 300 on, which was released already, every 40"
    );
    let told = noted(&report);
    assert!(told.iter().any(|(what, _)| what == "asked for 20 ms, now 40 ms"), "{told:?}");
    let rests = run(managed(true, 40), secs(1), &[]);
    assert!(rests.view.agents[0].is_suspended);
    let refused = run(managed(false, 60), secs(1), &[]);
    assert_eq!(refused.view.agents[0].period, Some(Duration::millis(20)));
    assert!(
        noted(&refused).iter().any(|(what, count)| what == "refused" && *count == 1),
        "{:?}",
        noted(&refused)
    );
}

/// By hand: the burden takes 3 of every 10 ms above the worker, which takes 8: from 3 to 10, and from 13 to 14.
#[test]
fn a_burden_takes_time_from_those_below_it_and_is_seen() {
    let mut plan = managed(false, 40);
    plan.agent_mut("worker").unwrap().cost = Some(Duration::millis(8));
    let burden = Burden {
        name: "hog".into(),
        priority: 65,
        cpus: vec![0],
        share: 0.3,
        period: Duration::millis(10),
        from: Duration::millis(0),
        until: Duration::millis(250),
    };
    let options =
        || Options { processors: Some(1), limit: Some(Duration::millis(250)), ..Options::default() };
    let calm = run(plan.clone(), options(), &[]);
    assert_eq!(calm.view.agents[0].response.max, 8e6);
    let burdened = run(plan.clone(), Options { burdens: vec![burden.clone()], ..options() }, &[]);
    assert_eq!(burdened.view.agents[0].response.max, 14e6);
    // 30 % and 8 of every 20 ms.
    let told = noted(&burdened);
    assert!(told.iter().any(|(what, _)| what == "3 agents, load 70 %, foreign 30 %"), "{told:?}");
    // Below it nothing waits.
    let below = Burden { priority: 40, ..burden };
    let report = run(plan, Options { burdens: vec![below], ..options() }, &[]);
    assert_eq!(report.view.agents[0].response.max, 8e6);
}

#[test]
fn who_outgrows_what_it_was_admitted_with_is_told_at_once() {
    let mut plan = team();
    plan.agent_mut("worker").unwrap().cost = Some(Duration::millis(2));
    let admission = Some(Admission { processors: 1, ..Admission::default() });
    let options =
        Options { processors: Some(1), admission, limit: Some(Duration::secs(1)), ..Options::default() };
    let report = run(plan, options, &[(500, "fault worker heavy")]);
    let told: Vec<&str> = said(&report).into_iter().filter(|what| what.contains("admitted with")).collect();
    assert_eq!(told, ["took 6.000 ms for a step, and was admitted with 2.000 ms"]);
}

#[test]
fn on_the_wall_clock_steps_take_what_is_declared_where_that_is_asked_for() {
    let mut plan = team();
    let worker = plan.agent_mut("worker").unwrap();
    worker.cost = Some(Duration::millis(2));
    (worker.refinement, worker.budget) = (Some(Duration::millis(1)), Some(Duration::micros(4500)));
    let options = Options { as_declared: true, limit: Some(Duration::millis(300)), ..Options::default() };
    let report = runtime::Live::new(&plan, &registry![Worker, Ear, Boss], options).unwrap().run().unwrap();
    let worker = &report.view.agents[0];
    // Two of them, and with the two milliseconds that a step takes without: but for the first, which is its start.
    assert!(worker.exec.p50 >= 3.6e6, "{:?}", worker.exec);
    assert!(worker.counts.refinements >= 2 * (worker.counts.releases - 2), "{:?}", worker.counts);
}
