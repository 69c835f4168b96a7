//! What is on a wire when it is cut.

use runtime::{
    Agent, Fault, Input, Options, Output, Overload, Plan, Report, Simulation, Step, WirePlan, WireTotals,
    registry,
};
use types::Duration;
use types::messages::{Odometry, Twist};

use crate::{Sink, Source, SourceParams, at, heard, options, sink, types};

/// A source every 10 ms and a sink that looks every second, with room for all that comes meanwhile.
fn run(test: &str, requests: &[(i64, &str)], millis: i64) -> (Vec<i64>, Report) {
    let mut plan = Plan::new(test);
    plan.add::<Source>("source", SourceParams::default());
    plan.add::<Sink>("sink", sink(test));
    let mut wire = WirePlan::new("source.out", "sink.count");
    (wire.depth, wire.overload) = (Some(128), Some(Overload::Refuse));
    plan.wires.push(wire);
    plan.every("source", Duration::millis(10));
    plan.every("sink", Duration::secs(1));
    plan.requests = requests.iter().map(|(millis, words)| at(*millis, words)).collect();
    let report = Simulation::new(&plan, &types(), Options { ..options(millis) }).unwrap().run().unwrap();
    let heard = heard(test).iter().map(|(_, twist)| twist.linear as i64).collect();
    (heard, report)
}

#[test]
fn a_receiver_takes_what_was_sent_before_the_wire_was_cut_however_long_that_takes_it() {
    for (test, request) in [("cut-unwired", "unwire source.out sink.count"), ("cut-sender", "remove source")]
    {
        let (heard, report) = run(test, &[(505, request)], 3000);
        assert_eq!(heard, (1..=51).collect::<Vec<_>>(), "{request}");
        let all = WireTotals { sent: 51, taken: 51, ..WireTotals::default() };
        assert_eq!((report.view.wires.len(), report.view.past), (0, all), "{request}");
    }
}

#[test]
fn a_wire_that_is_made_again_brings_what_comes_after_what_came_before() {
    let again = [(505, "unwire source.out sink.count"), (605, "wire source.out sink.count")];
    let (heard, _) = run("cut-again", &again, 1005);
    // The new wire is an ordinary one: it keeps the newest four of the forty that come until the sink looks.
    assert_eq!(heard, (1..=51).chain(98..=101).collect::<Vec<_>>());
}

#[test]
fn what_nobody_took_is_counted_as_dropped() {
    // It does nothing any more: five seconds after the cut it is not waited for.
    let off = [(5, "fault sink off"), (505, "unwire source.out sink.count")];
    let (heard, before) = run("cut-off-soon", &off, 5500);
    assert_eq!((heard.len(), before.view.past), (1, WireTotals::default()));
    let (_, after) = run("cut-off-late", &off, 5600);
    let lost = WireTotals { sent: 51, taken: 1, dropped: 50, ..WireTotals::default() };
    assert_eq!(after.view.past, lost);

    let (heard, removed) = run("cut-removed", &[(505, "remove sink")], 600);
    assert_eq!((heard.len(), removed.view.past), (1, lost), "a mailbox goes with its agent");
}

/// Tells a pose now and then.
#[derive(Agent)]
struct Walker {
    /// Where it is.
    #[port(history = 8)]
    pose: Output<Odometry>,
}

impl Agent for Walker {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.pose.send(Odometry::default());
        Ok(())
    }
}

/// Looks up where somebody was, and takes nothing.
#[derive(Agent)]
struct Looker {
    /// Where.
    pose: Input<Odometry>,
}

impl Agent for Looker {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        self.pose.at(step.now).map(drop).ok_or_else(|| Fault::new("nobody was anywhere"))
    }
}

/// Asks for the newest alone.
#[derive(Agent)]
struct Gauge {
    /// What comes.
    count: Input<Twist>,
}

impl Agent for Gauge {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.count.latest();
        Ok(())
    }
}

#[test]
fn what_a_newer_one_displaced_is_replaced_for_who_asks_for_the_newest_and_dropped_for_others() {
    let mut plan = Plan::new("replaced");
    plan.add::<Source>("source", SourceParams { by: 1.0 });
    plan.add::<Gauge>("gauge", Default::default());
    plan.add::<Sink>("sink", sink("replaced"));
    plan.every("source", Duration::millis(10));
    for name in ["gauge", "sink"] {
        plan.every(name, Duration::millis(100));
        plan.wires.push(WirePlan::new("source.out", format!("{name}.count")));
    }
    let types = registry![Source, Sink, Gauge];
    let report = Simulation::new(&plan, &types, options(1000)).unwrap().run().unwrap();
    let counts = report.view.wires.iter().map(|wire| (wire.sent, wire.taken, wire.replaced, wire.dropped));
    // One at once, then ten looks, each at the last four of ten.
    assert_eq!(counts.collect::<Vec<_>>(), [(101, 41, 60, 0), (101, 41, 0, 60)]);

    // Of those that came after its first look the last four lay there when the wire was cut, and were never passed over.
    plan.agent_mut("gauge").unwrap().period = Some(Duration::secs(60));
    plan.requests = vec![at(505, "unwire source.out gauge.count")];
    plan.wires.truncate(1);
    let report = Simulation::new(&plan, &types, options(6000)).unwrap().run().unwrap();
    let past = WireTotals { sent: 51, taken: 1, replaced: 46, dropped: 4, ..WireTotals::default() };
    assert_eq!(report.view.past, past);
}

#[test]
fn what_is_looked_up_in_memory_and_never_taken_is_not_lost() {
    let mut plan = Plan::new("looked");
    let walker = plan.add::<Walker>("walker", Default::default());
    let looker = plan.add::<Looker>("looker", Default::default());
    plan.wire(&walker.pose, &looker.pose);
    plan.every("walker", Duration::millis(10));
    plan.every("looker", Duration::millis(10));
    let report = Simulation::new(&plan, &registry![Walker, Looker], options(1000)).unwrap().run().unwrap();
    assert!(report.incidents.is_empty(), "{:?}", report.incidents);
    let [wire] = &report.view.wires[..] else { panic!("{:?}", report.view.wires) };
    // Four lie in the mailbox still.
    assert_eq!((wire.sent, wire.taken, wire.replaced, wire.dropped), (101, 0, 97, 0));
}
