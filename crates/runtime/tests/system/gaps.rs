//! The least time between two steps.

use runtime::{Plan, Simulation};
use types::Duration;

use crate::{Sink, Source, SourceParams, at, heard, options, sink, types};

#[test]
fn a_least_gap_makes_an_agent_wait_for_messages_and_no_longer() {
    let mut plan = Plan::new("gap");
    let source = plan.add::<Source>("source", SourceParams::default());
    let end = plan.add::<Sink>("sink", sink("gap"));
    plan.wire(&source.out, &end.count);
    plan.every("source", Duration::millis(10));
    plan.on("sink", "count");
    plan.agent_mut("sink").unwrap().min_gap = Duration::millis(25);
    plan.requests = vec![
        at(105, "fault source off"),
        at(205, "fault source ok"),
        at(245, "set sink min_gap 0ms"),
        at(265, "fault source off"),
    ];
    let report = Simulation::new(&plan, &types(), options(400)).unwrap().run().unwrap();
    let heard: Vec<(i64, i64)> =
        heard("gap").iter().map(|(time, twist)| (time.0 / 1_000_000, twist.linear as i64)).collect();
    let expected = [
        // The first at once; then a step each 25 ms, which takes all that has come meanwhile, each message once.
        [(0, 1)].as_slice(),
        &[(25, 2), (25, 3)],
        &[(50, 4), (50, 5), (50, 6)],
        &[(75, 7), (75, 8)],
        &[(100, 9), (100, 10), (100, 11)],
        // After a pause longer than the gap nothing is waited for.
        &[(210, 12)],
        &[(235, 13), (235, 14)],
        // Without a gap the next message makes it run at once, and the step that was put off is not made up for.
        &[(245, 15)],
        &[(250, 16)],
        &[(260, 17)],
    ];
    assert_eq!(heard, expected.concat());
    let steps = &report.view.agents[1];
    assert_eq!(steps.counts.releases, expected.len() as u64, "no step without a message");
    assert_eq!((steps.counts.missed, steps.jitter.max), (0, 0.0), "waiting for the gap is not being late");
}

#[test]
fn a_least_gap_holds_for_messages_alone() {
    let mut plan = Plan::new("gap-period");
    let source = plan.add::<Source>("source", SourceParams::default());
    let end = plan.add::<Sink>("sink", sink("gap-period"));
    plan.wire(&source.out, &end.count);
    plan.every("source", Duration::millis(10));
    plan.on("sink", "count");
    plan.every("sink", Duration::millis(50));
    plan.agent_mut("sink").unwrap().min_gap = Duration::millis(30);
    let report = Simulation::new(&plan, &types(), options(199)).unwrap().run().unwrap();
    let mut steps: Vec<i64> = heard("gap-period").iter().map(|(time, _)| time.0 / 1_000_000).collect();
    steps.dedup();
    // By the clock at 0, 50, 100, 150; by messages 30 ms after the last step, whatever that was for.
    assert_eq!(steps, [0, 30, 50, 80, 100, 130, 150, 180]);
    assert_eq!(report.view.agents[1].counts.releases, steps.len() as u64);
}
