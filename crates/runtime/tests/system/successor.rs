//! Who comes in the place of another.

use std::any::Any;
use std::sync::Mutex;

use runtime::{Agent, Fault, Output, Params, Plan, Registry, Simulation, Step, registry};
use types::Duration;
use types::messages::Twist;

use crate::{Sink, at, heard, options, sink};

/// Which counters were stopped, by test and at which count.
static STOPPED: Mutex<Vec<(String, i64)>> = Mutex::new(Vec::new());

/// Counts its steps, and goes on with the count of whom it replaces.
#[derive(Agent)]
struct Counter {
    /// The count, as a speed.
    out: Output<Twist>,
    params: CounterParams,
    count: i64,
    started: bool,
}

/// Who it is.
#[derive(Clone, Debug, Default, Params)]
struct CounterParams {
    /// The name of the test.
    test: String,
    /// Whether it panics when it takes over.
    clumsy: bool,
}

impl Agent for Counter {
    fn start(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.started = true;
        Ok(())
    }

    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        assert!(self.started, "a step before the start");
        self.count += 1;
        self.out.send(Twist::new(self.count as f64, 0.0));
        Ok(())
    }

    fn take_over(&mut self, before: &mut dyn Any) {
        assert!(!self.params.clumsy, "dropped it");
        assert!(!self.started, "started before it took over");
        if let Some(before) = before.downcast_mut::<Counter>() {
            self.count = before.count;
        }
    }

    fn stop(&mut self, _: &mut Step) {
        STOPPED.lock().unwrap().push((self.params.test.clone(), self.count));
    }
}

/// Counts down; it has the ports of a counter.
#[derive(Agent)]
struct Reverse {
    /// The count, as a speed.
    out: Output<Twist>,
    params: CounterParams,
    count: i64,
}

impl Agent for Reverse {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        assert!(!self.params.clumsy);
        self.count -= 1;
        self.out.send(Twist::new(self.count as f64, 0.0));
        Ok(())
    }

    fn take_over(&mut self, before: &mut dyn Any) {
        if let Some(before) = before.downcast_mut::<Counter>() {
            self.count = before.count;
        }
    }
}

fn types() -> Registry {
    registry![Counter, Reverse, Sink]
}

fn plan(test: &str, clumsy: bool, requests: &[(i64, &str)]) -> Plan {
    let mut plan = Plan::new(test);
    let counter = plan.add::<Counter>("counter", CounterParams { test: test.into(), clumsy });
    let end = plan.add::<Sink>("sink", sink(test));
    plan.wire(&counter.out, &end.count);
    plan.every("counter", Duration::millis(10));
    plan.on("sink", "count");
    plan.requests = requests.iter().map(|(millis, words)| at(*millis, words)).collect();
    plan
}

fn counts(test: &str) -> Vec<i64> {
    heard(test).iter().map(|(_, twist)| twist.linear as i64).collect()
}

fn stopped(test: &str) -> Vec<i64> {
    let stopped = STOPPED.lock().unwrap();
    stopped.iter().filter(|(name, _)| name == test).map(|(_, count)| *count).collect()
}

#[test]
fn a_replacement_goes_on_where_the_one_before_stood_and_a_restart_begins_anew() {
    let test = "successor";
    let requests = [(45, "replace counter counter"), (85, "replace counter reverse")];
    let report =
        Simulation::new(&plan(test, false, &requests), &types(), options(115)).unwrap().run().unwrap();
    assert_eq!(counts(test), [1, 2, 3, 4, 5, 6, 7, 8, 9, 8, 7, 6]);
    // The second counter was made without the parameters of the first, so it stops under no name.
    assert_eq!(stopped(test), [5], "who is replaced is stopped, once");
    assert_eq!(report.view.agents[0].kind, "reverse");

    let test = "successor-restart";
    let restarts = [(45, "restart counter")];
    Simulation::new(&plan(test, false, &restarts), &types(), options(75)).unwrap().run().unwrap();
    assert_eq!(counts(test), [1, 2, 3, 4, 5, 1, 2, 3]);
    assert_eq!(stopped(test), [5, 3]);
}

#[test]
fn a_panic_while_taking_over_is_a_death_like_any_other() {
    let test = "successor-clumsy";
    let mut plan = plan(test, false, &[]);
    plan.requests = vec![at(45, "replace counter counter clumsy")];
    let report = Simulation::new(&plan, &types(), options(200)).unwrap().run().unwrap();
    let said: Vec<&str> = report.incidents.iter().map(|incident| incident.what.as_str()).collect();
    assert!(said.iter().any(|what| what.starts_with("panic: dropped it")), "{said:?}");
    assert!(said.contains(&"started again"), "{said:?}");
    let counts = counts(test);
    assert_eq!(counts[..6], [1, 2, 3, 4, 5, 1], "it knows nothing of what was before");
    assert_eq!(stopped(test), [5], "who was replaced is stopped all the same");
}
