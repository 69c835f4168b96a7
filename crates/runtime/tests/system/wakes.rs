//! The least time between steps that an agent asks for itself.

use super::*;
use runtime::Report;

static STEPS: Mutex<Vec<(String, i64)>> = Mutex::new(Vec::new());

/// Notes when it runs, and asks for its next step.
#[derive(Agent)]
struct Waker {
    /// What makes it run, too.
    from: Input<Twist>,
    params: WakerParams,
}

/// Which steps it asks for.
#[derive(Clone, Debug, Params)]
struct WakerParams {
    /// The name of the test.
    test: String,
    /// How long after each step it wants the next one (ms).
    #[param(default = 5.0, min = -1000.0)]
    after: f64,
}

impl Agent for Waker {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        while self.from.take().is_some() {}
        STEPS.lock().unwrap().push((self.params.test.clone(), step.now.0 / 1_000_000));
        step.wake_at(step.now + Duration::from_seconds(self.params.after * 1e-3));
        Ok(())
    }
}

/// One that runs once a second and when it asks for it.
fn one(test: &str, after: f64, gap: i64) -> Plan {
    let mut plan = Plan::new(test);
    plan.add::<Waker>("waker", WakerParams { test: test.to_owned(), after });
    plan.every("waker", Duration::secs(1));
    plan.agent_mut("waker").unwrap().wake_gap = Duration::millis(gap);
    plan
}

fn run(plan: &Plan, millis: i64) -> (Vec<i64>, Report) {
    let report = Simulation::new(plan, &registry![Source, Waker], options(millis)).unwrap().run().unwrap();
    let steps = STEPS.lock().unwrap();
    (steps.iter().filter(|(test, _)| *test == plan.name).map(|(_, time)| *time).collect(), report)
}

/// Every step was released when it was made: who waits for the gap is not late.
fn all_in_time(steps: &[i64], report: &Report) {
    let waker = report.view.agents.iter().find(|agent| agent.name == "waker").unwrap();
    assert_eq!(waker.counts.releases, steps.len() as u64);
    assert_eq!((waker.counts.missed, waker.counts.skipped, waker.jitter.max), (0, 0, 0.0));
}

#[test]
fn a_step_that_is_asked_for_too_soon_is_put_off_and_never_lost() {
    let (steps, report) = run(&one("put-off", 5.0, 20), 90);
    // The first that it asks for is as soon as it likes: the one before came by the clock.
    assert_eq!(steps, [0, 5, 25, 45, 65, 85]);
    all_in_time(&steps, &report);
    let (steps, report) = run(&one("no-gap", 5.0, 0), 24);
    assert_eq!(steps, [0, 5, 10, 15, 20]);
    all_in_time(&steps, &report);
    // Who asks for less anyway has no gap to wait for.
    let (steps, _) = run(&one("far", 30.0, 20), 100);
    assert_eq!(steps, [0, 30, 60, 90]);
    // What lies behind the step that asks for it is asked for then.
    let mut past = one("past", -3.0, 20);
    past.agent_mut("waker").unwrap().deadline = Some(Duration::millis(1));
    let (steps, report) = run(&past, 59);
    assert_eq!(steps, [0, 0, 20, 40]);
    all_in_time(&steps, &report);
}

#[test]
fn a_least_time_between_them_holds_for_steps_that_are_asked_for_alone() {
    let mut plan = one("alone", 1.0, 25);
    plan.add::<Source>("source", SourceParams::default());
    plan.wires.push(WirePlan::new("source.out", "waker.from"));
    plan.every("source", Duration::millis(10));
    plan.on("waker", "from");
    let (steps, report) = run(&plan, 59);
    // For messages at 0, 10, 20 and so on, the first of which comes with the clock; what it asked for at 1, 26 and 51.
    assert_eq!(steps, [0, 1, 10, 20, 26, 30, 40, 50, 51]);
    all_in_time(&steps, &report);
}

#[test]
fn another_gap_holds_at_once_for_what_waits() {
    let mut plan = one("changed", 5.0, 100);
    plan.requests = vec![
        at(50, "set waker wake_gap 20ms"),
        at(95, "set waker wake_gap 0ms"),
        at(107, "set waker wake_gap 30ms"),
        at(140, "set waker wake_gap 40ms"),
    ];
    let (steps, report) = run(&plan, 200);
    // Asked for at 10, put off to 105, which by the shorter gap should have been at 25: it is made up for at once.
    let until = [0, 5, 50, 70, 90, 95, 100, 105];
    // Asked for at 110, put off to 135; then to 165, which is 175 by the gap that is longer by then.
    assert_eq!(steps, [until.as_slice(), &[135, 175]].concat());
    all_in_time(&steps, &report);
}

#[test]
fn who_is_suspended_gets_the_step_that_it_asked_for_when_it_goes_on() {
    for (test, gap) in [("rests", 0), ("rests-with-gap", 20)] {
        let mut plan = Plan::new(test);
        let waker = plan.add::<Waker>("waker", WakerParams { test: test.to_owned(), after: 30.0 });
        let source = plan.add::<Source>("source", SourceParams::default());
        plan.wire(&source.out, &waker.from);
        plan.every("source", Duration::secs(1));
        plan.on("waker", "from");
        let agent = plan.agent_mut("waker").unwrap();
        (agent.deadline, agent.wake_gap) = (Some(Duration::millis(2)), Duration::millis(gap));
        plan.requests = vec![at(10, "set waker suspended true"), at(50, "set waker suspended false")];
        let (steps, report) = run(&plan, 100);
        // It is released when it goes on, and is not late for having been suspended.
        assert_eq!(steps, [0, 50, 80]);
        all_in_time(&steps, &report);
    }
}

#[test]
fn a_gap_below_nothing_is_refused() {
    let refused = Simulation::new(&one("negative", 5.0, -1), &registry![Source, Waker], options(9)).err();
    let told = refused.unwrap().to_string();
    assert!(told.contains("the wake_gap of waker is -1ms") && told.contains("wake_gap = \"50ms\""), "{told}");
    let mut plan = one("set-negative", 5.0, 20);
    plan.requests = vec![at(10, "set waker wake_gap -1ms"), at(20, "set waker wake_gap soon")];
    let (_, report) = run(&plan, 40);
    let told: Vec<&str> = report.incidents.iter().map(|incident| incident.what.as_str()).collect();
    assert!(told[0].contains("the wake_gap of waker is -1ms"), "{told:?}");
    assert!(told[1].contains("wake_gap is \"soon\""), "{told:?}");
}
