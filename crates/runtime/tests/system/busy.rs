//! Steps that take time on virtual processors.

use proptest::prelude::*;
use runtime::{Assumed, Report, timetable};

use super::*;

/// Sends the time of its step, and notes what it got and when.
#[derive(Agent)]
struct Stamp {
    /// Times of others (s).
    from: Input<Twist>,
    /// Its own time (s).
    out: Output<Twist>,
    params: StampParams,
}

/// What it notes.
#[derive(Clone, Debug, Params)]
struct StampParams {
    /// Whether it notes.
    #[param(default = false)]
    notes: bool,
    /// How long after each step it asks for another one (ms); nothing below zero.
    #[param(default = -1.0, min = -1.0)]
    asks: f64,
}

impl Agent for Stamp {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        self.out.send(Twist::new(step.now.seconds(), 0.0));
        if self.params.asks >= 0.0 {
            step.wake_at(step.now + Duration::from_seconds(self.params.asks * 1e-3));
        }
        while let Some(got) = self.from.take() {
            if self.params.notes {
                runtime::note!("sent at {} s, seen at {} s", got.linear, step.now.seconds());
            }
        }
        Ok(())
    }
}

fn on(plan: &mut Plan, name: &str, executor: &str, period: i64, cost: i64) {
    plan.add::<Stamp>(name, StampParams { notes: false, asks: -1.0 });
    plan.every(name, Duration::millis(period));
    let agent = plan.agent_mut(name).unwrap();
    agent.executor = Some(executor.to_owned());
    agent.cost = Some(Duration::millis(cost));
}

fn played(plan: &Plan, processors: usize, millis: i64) -> Report {
    let limit = Some(Duration::millis(millis));
    let options = Options { limit, processors: Some(processors), parse: words, ..Options::default() };
    Simulation::new(plan, &registry![Stamp], options).unwrap().run().unwrap()
}

/// The requests that these tests need.
fn words(words: &[String]) -> Result<Request, Refusal> {
    let [_, target, fault] = words else { return Err(Refusal::new("three words")) };
    Ok(Request::Fault { target: target.clone(), fault: FaultKind::named(fault).unwrap() })
}

/// The longest response of an agent (ms), steps, misses and releases passed over.
fn of(report: &Report, name: &str) -> (f64, u64, u64, u64) {
    let agent = report.view.agents.iter().find(|agent| agent.name == name).unwrap();
    (agent.response.max * 1e-6, agent.counts.releases, agent.counts.missed, agent.counts.skipped)
}

/// By hand: on one processor the high one runs from 0 to 3 and from 10 to 13, the low one from 3 to 10 and from 13 to 16.
#[test]
fn a_higher_executor_takes_the_processor_away() {
    let mut plan = Plan::new("two");
    on(&mut plan, "high", "reflex", 10, 3);
    on(&mut plan, "low", "control", 40, 10);
    let one = played(&plan, 1, 399);
    assert_eq!(of(&one, "high"), (3.0, 40, 0, 0));
    assert_eq!(of(&one, "low"), (16.0, 10, 0, 0));
    let two = played(&plan, 2, 399);
    assert_eq!(of(&two, "high"), (3.0, 40, 0, 0));
    assert_eq!(of(&two, "low"), (10.0, 10, 0, 0));
    // Both on the second of two: as on one.
    plan.executors = runtime::executors_of(&plan);
    plan.executors.iter_mut().for_each(|executor| executor.cpus = vec![1]);
    assert_eq!(of(&played(&plan, 2, 399), "low"), (16.0, 10, 0, 0));
}

/// By hand: from 0 the short one, then the long one from 4 to 10 and, as its deadline is the earlier one, on to 13. The long one of 16 waits for two
/// of the others and ends at 30. At 47 the one with a priority has its first millisecond; the second is at 78, after the short one of 70.
#[test]
fn executors_by_deadline_go_before_all_and_the_earliest_deadline_first() {
    let mut plan = Plan::new("edf");
    on(&mut plan, "urgent", "gate", 100, 2);
    on(&mut plan, "long", "control", 16, 9);
    on(&mut plan, "short", "reflex", 10, 4);
    plan.executors = ["control", "reflex"].map(runtime::ExecutorPlan::by_deadline).into();
    let report = played(&plan, 1, 99);
    assert_eq!(["short", "long", "urgent"].map(|name| of(&report, name).0), [8.0, 14.0, 79.0]);
}

/// By hand: each waits for the other's step that has begun: 10 + 3, and 3 + 10.
#[test]
fn agents_of_one_executor_do_not_interrupt_each_other() {
    let mut plan = Plan::new("one");
    on(&mut plan, "short", "control", 20, 3);
    on(&mut plan, "long", "control", 50, 10);
    plan.agent_mut("short").unwrap().deadline = Some(Duration::millis(5));
    let report = played(&plan, 2, 999);
    // At 0 the short one goes first, by its deadline; at 300 as well; at 100 too. At 150 the long one begins, and at 160 the short one is due.
    assert_eq!(of(&report, "long").0, 13.0);
    let (longest, _, missed, _) = of(&report, "short");
    assert_eq!((longest, missed), (3.0, 0));
    plan.agent_mut("long").unwrap().cost = Some(Duration::millis(15));
    let (longest, _, missed, _) = of(&played(&plan, 2, 999), "short");
    // At 150 the long one begins, at 160 the short one is released, at 165 it begins: once in 100 ms, but not where both are released together.
    assert_eq!((longest, missed), (8.0, 10));
}

#[test]
fn a_step_reads_when_it_begins_and_is_heard_when_it_ends() {
    let mut plan = Plan::new("heard");
    on(&mut plan, "slow", "control", 100, 30);
    on(&mut plan, "looks", "reflex", 10, 0);
    plan.agent_mut("looks").unwrap().params.set("notes", Value::Bool(true));
    plan.wires.push(WirePlan::new("slow.out", "looks.from"));
    let report = played(&plan, 1, 135);
    let [noted] = &report.noted[..] else { panic!("{:?}", report.noted) };
    assert_eq!((noted.count, noted.first.seconds(), noted.last.seconds()), (2, 0.03, 0.13));
}

#[test]
fn who_takes_longer_than_its_period_passes_releases_over() {
    let mut plan = Plan::new("long");
    on(&mut plan, "long", "control", 10, 25);
    let (longest, steps, missed, skipped) = of(&played(&plan, 1, 299), "long");
    // It begins at 0, at 25 for the release at 20, at 50 for that at 50, and so on, the twelfth time at 275 for the 28th release. Eleven have ended.
    assert_eq!((longest, steps, missed, skipped), (30.0, 12, 11, 28 - 12));
}

#[test]
fn who_hangs_keeps_its_processor_until_it_is_given_up() {
    let mut plan = Plan::new("hang");
    on(&mut plan, "high", "reflex", 10, 1);
    on(&mut plan, "low", "control", 20, 1);
    plan.agent_mut("high").unwrap().hang_after = Some(Duration::millis(55));
    let words = ["fault", "high", "hang"].map(str::to_owned).into();
    plan.requests.push(TimedRequest { at: Duration::millis(95), words, place: Span::default() });
    let report = played(&plan, 1, 999);
    // From 100 to 155 nobody below runs. Then what was due at 100 and 120 is passed over, and what was due at 140 ends at 156.
    let (longest, _, _, skipped) = of(&report, "low");
    assert_eq!((longest, skipped), (16.0, 2));
    let high = report.view.agents.iter().find(|agent| agent.name == "high").unwrap();
    assert_eq!((high.counts.hangs, high.counts.restarts), (1, 1));
    assert_eq!(of(&played(&plan, 2, 999), "low").0, 1.0);
}

#[derive(Clone, Debug)]
struct Drawn {
    plan: Plan,
    processors: usize,
}

fn drawn() -> impl Strategy<Value = Drawn> {
    // Some ask for steps themselves, sooner or later than they may.
    let asks = proptest::option::weighted(0.4, (0i64..60, 1i64..=6));
    let one = (1i64..=8, 1i64..=6, 0usize..4, proptest::option::of(0usize..5), 1u32..3, asks);
    (
        proptest::collection::vec(one, 1..=6),
        proptest::collection::vec(0usize..3, 4),
        proptest::collection::vec(any::<bool>(), 6),
        1usize..=2,
    )
        .prop_map(|(agents, pins, deadlines, processors)| {
            let names = ["receive", "reflex", "control", "vision"];
            let mut plan = Plan::new("drawn");
            plan.executors = runtime::executors_of(&plan);
            for (name, pin) in names.iter().zip(pins) {
                let executor = plan.executors.iter_mut().find(|executor| executor.name == *name).unwrap();
                executor.cpus = if pin < processors { vec![pin] } else { Vec::new() };
            }
            for (at, (cost, tens, executor, source, every, asks)) in agents.into_iter().enumerate() {
                let name = format!("a{at}");
                on(&mut plan, &name, names[executor], tens * 20, cost);
                if let Some((after, tens)) = asks {
                    let agent = plan.agent_mut(&name).unwrap();
                    agent.params.set("asks", Value::from(after as f64));
                    agent.wake_gap = Duration::millis(tens * 20);
                }
                if let Some(source) = source.filter(|_| at > 0) {
                    let agent = plan.agent_mut(&name).unwrap();
                    agent.deadline = agent.period.take();
                    agent.on.push("from".to_owned());
                    let mut wire = WirePlan::new(format!("a{}.out", source % at), format!("{name}.from"));
                    wire.filter.every = every;
                    plan.wires.push(wire);
                }
            }
            // Some executors of one agent run by its deadline.
            for (at, executor) in plan.executors.iter_mut().enumerate() {
                let runs = |agent: &&AgentPlan| agent.executor.as_deref() == Some(&executor.name);
                let mut agents = plan.agents.iter().filter(runs);
                if let (Some(agent), None) = (agents.next(), agents.next())
                    && deadlines[at % deadlines.len()]
                    && agent.on.is_empty()
                    && agent.wake_gap == Duration::ZERO
                {
                    *executor = runtime::ExecutorPlan::by_deadline(&executor.name);
                }
            }
            Drawn { plan, processors }
        })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn no_step_takes_longer_than_analysed(drawn in drawn()) {
        let Drawn { plan, processors } = drawn;
        let cost = |agent: &AgentPlan| agent.cost.unwrap_or_default();
        let assumed = Assumed { cost: &cost, overhead: Duration::ZERO, processors, pace: &|_| None };
        let table = timetable(&plan, &registry![Stamp], &assumed);
        let found = table.system.analyse().unwrap();
        let report = played(&plan, processors, 4000);
        for (agent, found) in plan.agents.iter().zip(found) {
            let (longest, steps, missed, _) = of(&report, &agent.name);
            if let Some(told) = found.response {
                let told = *told.numer() as f64 / *told.denom() as f64 * 1e-6;
                prop_assert!(longest <= told + 1e-9, "{}: told {told}, took {longest} in {steps} steps", agent.name);
                prop_assert!(!found.meets || missed == 0, "{}: told to meet its deadline, and missed {missed}", agent.name);
            }
        }
        let again = played(&plan, processors, 4000);
        let responses = |report: &Report| plan.agents.iter().map(|agent| of(report, &agent.name)).collect::<Vec<_>>();
        prop_assert_eq!(responses(&report), responses(&again));
    }
}
