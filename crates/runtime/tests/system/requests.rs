//! What is asked of a system that runs.

use runtime::{Control, FaultKind, Live, Options, Request, Simulation, WirePlan};
use types::value::Value;

use crate::{at, chain, heard, options, types};

#[test]
fn an_output_misbehaves_as_it_is_asked_to() {
    let mut plan = chain("faults");
    let faults = ["stuck", "ok", "delayed", "ok", "off", "ok"];
    plan.requests = faults
        .iter()
        .enumerate()
        .map(|(i, kind)| at(95 + 100 * i as i64, &format!("fault source.out {kind}")))
        .collect();
    Simulation::new(&plan, &types(), options(700)).unwrap().run().unwrap();
    let heard: Vec<(i64, i64)> =
        heard("faults").iter().map(|(t, twist)| (t.0 / 1_000_000, twist.linear as i64)).collect();
    let at = |from: i64, to: i64| {
        heard.iter().filter(|(t, _)| (from..to).contains(t)).map(|(_, n)| *n).collect::<Vec<_>>()
    };
    assert_eq!(at(100, 195), [11; 10], "stuck at the first value of the fault");
    assert_eq!(at(200, 295), (21..=30).collect::<Vec<_>>(), "well again");
    assert_eq!(at(300, 395), (31..=37).collect::<Vec<_>>(), "three messages late");
    assert_eq!(at(500, 595), [], "off");
    assert_eq!(at(600, 695), (61..=70).collect::<Vec<_>>());
}

#[test]
fn wiring_changes_while_the_rest_runs() {
    let mut plan = chain("wiring");
    plan.requests = vec![
        at(205, "unwire source.out relay.from"),
        at(405, "wire source.out relay.from"),
        at(605, "remove relay"),
    ];
    let report = Simulation::new(&plan, &types(), options(1000)).unwrap().run().unwrap();
    let numbers: Vec<i64> = heard("wiring").iter().map(|(_, twist)| twist.linear as i64).collect();
    let expected: Vec<i64> = (1..=21).chain(42..=61).collect();
    assert_eq!(numbers, expected);
    assert_eq!(report.view.agents.len(), 2);
    assert!(report.view.wires.is_empty());
}

#[test]
fn a_parameter_and_a_period_change_between_steps() {
    let mut plan = chain("set");
    plan.requests = vec![at(95, "set source by 10"), at(195, "set source period 50ms")];
    Simulation::new(&plan, &types(), options(400)).unwrap().run().unwrap();
    let heard = heard("set");
    let numbers: Vec<i64> = heard.iter().map(|(_, twist)| twist.linear as i64).collect();
    assert_eq!(&numbers[..12], [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 20, 30]);
    let times: Vec<i64> = heard.iter().map(|(time, _)| time.0 / 1_000_000).filter(|t| *t >= 190).collect();
    assert_eq!(times, [190, 240, 290, 340, 390]);
}

#[test]
fn what_is_wrong_is_refused_with_the_reason_and_nothing_changes() {
    let mut plan = chain("refused");
    plan.requests = vec![
        at(10, "wire source.out sink.cuont"),
        at(20, "set source by -1"),
        at(30, "wire sorce.out sink.count"),
        at(40, "wire relay.from sink.count"),
    ];
    let report = Simulation::new(&plan, &types(), options(100)).unwrap().run().unwrap();
    let said: Vec<&str> = report.incidents.iter().map(|incident| incident.what.as_str()).collect();
    assert!(said[0].contains("there is no port of sink \"cuont\"; did you mean \"count\"?"), "{said:?}");
    assert!(said[1].contains("\"by\" must be at least 0, not -1"), "{said:?}");
    assert!(said[2].contains("did you mean \"source\"?"), "{said:?}");
    assert!(said[3].contains("relay.from is an input"), "{said:?}");
    assert_eq!(report.view.wires.len(), 2);
}

#[test]
fn all_mistakes_of_a_plan_are_found_at_once() {
    let mut plan = chain("mistakes");
    plan.agent_mut("source").unwrap().kind = "sorce".into();
    plan.agent_mut("relay").unwrap().on = vec!["frm".into()];
    plan.agent_mut("sink").unwrap().executor = Some("reflx".into());
    plan.wires.push(WirePlan::new("relay.to", "sink.counts"));
    plan.agent_mut("sink").unwrap().params.set("tset", Value::from("x"));
    let said: Vec<String> = runtime::check(&plan, &types()).iter().map(ToString::to_string).collect();
    for part in [
        "did you mean \"source\"?",
        "did you mean \"from\"?",
        "did you mean \"reflex\"?",
        "did you mean \"count\"?",
        "did you mean \"test\"?",
    ] {
        assert!(said.iter().any(|mistake| mistake.contains(part)), "{part} in {said:#?}");
    }
}

/// Asks for a fault of the relay, for one of nobody, and for the end.
fn ask_for_faults(control: &Control) {
    let fault = |target: &str, fault| Request::Fault { target: target.into(), fault };
    let both = vec![fault("relay", FaultKind::Panic), fault("source.out", FaultKind::Wrong)];
    control.request(Request::All(both)).unwrap();
    control.request(fault("nobody", FaultKind::Off)).unwrap_err();
    control.request(Request::Set { agent: "source".into(), key: "by".into(), value: 2.0.into() }).unwrap();
    control.request(Request::Quit).unwrap();
}

#[test]
fn a_fault_that_is_asked_while_it_runs_is_told_at_the_end_like_one_of_the_plan() {
    let options = || Options { limit: None, ..options(0) };
    let simulation = Simulation::new(&chain("live-sim"), &types(), options()).unwrap();
    let live = Live::new(&chain("live-wall"), &types(), options()).unwrap();
    let outside = [simulation.control(), live.control()].map(|control| {
        let work = move || ask_for_faults(&control);
        std::thread::Builder::new().name("outside".into()).spawn(work).unwrap()
    });
    for report in [simulation.run().unwrap(), live.run().unwrap()] {
        let asked: Vec<&str> = report
            .incidents
            .iter()
            .filter(|incident| incident.agent == "control")
            .map(|incident| incident.what.as_str())
            .collect();
        assert_eq!(asked[..2], ["asked: fault relay panic", "asked: fault source.out wrong"]);
        assert!(asked.len() == 3 && asked[2].contains("fault nobody off; refused: "), "{asked:?}");
    }
    outside.into_iter().for_each(|thread| thread.join().unwrap());
}
