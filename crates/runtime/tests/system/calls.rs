//! Calls from outside, who is nobody in the system and is wired to nothing.

use std::thread::JoinHandle;

use runtime::{Control, Live, Options, Plan, Refusal, Report, Request, Simulation};
use types::cdr::{Reader, Writer};
use types::messages::Twist;
use types::{Duration, Message, Time};

use crate::{Answerer, Asker, Sink, Source, at, heard, options, sink, types};

/// Ends the run, also when what the test asserts is not so.
struct Quits(Control);

impl Drop for Quits {
    fn drop(&mut self) {
        let _ = self.0.request(Request::Quit);
    }
}

/// Somebody else on another thread, who in the end quits the run.
fn outside(control: Control, work: impl FnOnce(&Control) + Send + 'static) -> JoinHandle<()> {
    let work = move || work(&Quits(control).0);
    std::thread::Builder::new().name("outside".into()).spawn(work).unwrap()
}

/// Runs the plan a hundred times as fast as the wall, with somebody outside.
fn run(plan: &Plan, work: impl FnOnce(&Control) + Send + 'static) -> Report {
    let options = Options { limit: None, speed: Some(100.0), ..options(0) };
    let simulation = Simulation::new(plan, &types(), options).unwrap();
    let outside = outside(simulation.control(), work);
    let report = simulation.run().unwrap();
    outside.join().unwrap();
    report
}

pub(crate) fn cdr(twist: Twist) -> Vec<u8> {
    let mut out = Writer::new();
    twist.encode(&[], Time::ZERO, &mut out);
    out.bytes().to_vec()
}

fn call(control: &Control, speed: f64, within: Duration) -> Result<f64, Refusal> {
    let answer = control.call("answerer.half", cdr(Twist::new(speed, 0.0)), within)?;
    Ok(Twist::decode(&mut Reader::new(&answer).unwrap(), &mut Vec::new()).unwrap().linear)
}

/// A source every 10 ms, so that time goes on, and somebody who answers, on another executor.
fn plan(name: &str) -> Plan {
    let mut plan = Plan::new(name);
    plan.add::<Source>("source", Default::default());
    plan.every("source", Duration::millis(10));
    plan.add::<Answerer>("answerer", Default::default());
    plan.on("answerer", "half");
    plan.agent_mut("answerer").unwrap().executor = Some("ordinary".into());
    plan
}

const SECOND: Duration = Duration::secs(1);

#[test]
fn any_service_is_called_without_a_wire() {
    let report = run(&plan("outside"), |control| {
        let shape = control.service("answerer.half").unwrap();
        assert_eq!(
            (shape.question.name, shape.answer.name),
            ("geometry_msgs/msg/Twist", "geometry_msgs/msg/Twist")
        );
        for n in 1..20 {
            assert_eq!(call(control, f64::from(n), SECOND).unwrap(), f64::from(n) / 2.0);
            assert!(control.view().unwrap().wires.is_empty());
        }
    });
    let answerer = report.view.agents.iter().find(|agent| agent.name == "answerer").unwrap();
    assert_eq!(answerer.counts.releases, 19, "each call makes it run once, and nothing else does");
}

#[test]
fn callers_at_once_and_a_wired_client_each_get_their_own_answers() {
    let mut plan = plan("callers");
    let asker = plan.add::<Asker>("asker", Default::default());
    plan.add::<Sink>("sink", sink("callers"));
    plan.wires.push(runtime::WirePlan::new("asker.half", "answerer.half"));
    plan.wires.push(runtime::WirePlan::new(asker.out.name.clone(), "sink.count"));
    plan.every("asker", Duration::millis(100));
    plan.on("sink", "count");
    run(&plan, |control| {
        let callers: Vec<JoinHandle<()>> = [1000.0, 2000.0, 3000.0]
            .map(|from| {
                let control = control.clone();
                let work = move || {
                    for n in 0..30 {
                        let speed = from + f64::from(n);
                        assert_eq!(call(&control, speed, SECOND).unwrap(), speed / 2.0);
                    }
                };
                std::thread::Builder::new().spawn(work).unwrap()
            })
            .into();
        callers.into_iter().for_each(|caller| caller.join().unwrap());
        while heard("callers").len() < 3 {
            control.view().unwrap();
        }
    });
    let answers: Vec<f64> = heard("callers").iter().map(|(_, twist)| twist.linear).collect();
    let expected: Vec<f64> = (1..=answers.len()).map(|n| n as f64).collect();
    assert_eq!(answers, expected, "the client in the system hears its own answers alone");
}

#[test]
fn an_answer_that_does_not_come_in_time_is_told_and_is_nobody_elses() {
    let mut plan = plan("late");
    plan.requests = vec![at(0, "fault answerer off")];
    run(&plan, |control| {
        let asked = control.view().unwrap().now;
        let late = call(control, 8.0, Duration::millis(50)).unwrap_err();
        assert_eq!(late.what, "answerer.half did not answer within 50ms");
        let told = control.view().unwrap().now;
        assert!(told >= asked + Duration::millis(50), "{asked} {told}: by the clock of the system");
        let (target, fault) = ("answerer".to_owned(), runtime::FaultKind::Ok);
        control.request(Request::Fault { target, fault }).unwrap();
        while call(control, 6.0, Duration::millis(50)).is_err() {}
        assert_eq!(call(control, 4.0, SECOND).unwrap(), 2.0);
    });
}

#[test]
fn what_cannot_be_called_is_refused_in_one_sentence() {
    let mut plan = plan("refused");
    plan.requests = vec![at(0, "fault answerer off")];
    run(&plan, |control| {
        let said = |service: &str, cdr| control.call(service, cdr, SECOND).unwrap_err().to_string();
        let twist = || cdr(Twist::ZERO);
        assert_eq!(
            said("anserer.half", twist()),
            "there is no agent \"anserer\"; did you mean \"answerer\"?"
        );
        assert_eq!(
            said("answerer.hlaf", twist()),
            "there is no service of answerer \"hlaf\"; did you mean \"half\"?"
        );
        assert!(said("source.out", twist()).starts_with("there is no service of source \"out\""));
        assert!(said("answerer", twist()).starts_with("\"answerer\" is no port"));
        assert!(
            said("answerer.half", vec![0, 1, 0, 0]).contains("end"),
            "{}",
            said("answerer.half", vec![0, 1, 0, 0])
        );

        // The call waits, and the agent goes.
        let waiting = control.clone();
        let caller = std::thread::Builder::new()
            .spawn(move || call(&waiting, 1.0, Duration::secs(3600)).unwrap_err().what)
            .unwrap();
        // Its question is in the mailbox once it has made the agent run, in vain.
        while control.view().unwrap().agents[1].counts.releases == 0 {}
        control.request(Request::Remove("answerer".into())).unwrap();
        assert_eq!(caller.join().unwrap(), "answerer.half was removed before it answered");
    });
}

#[test]
fn the_dead_are_not_called() {
    let mut plan = plan("dead");
    plan.agent_mut("answerer").unwrap().on_death = runtime::OnDeath::Leave;
    plan.every("answerer", Duration::millis(10));
    plan.requests = vec![at(0, "fault answerer panic")];
    run(&plan, |control| {
        while control.view().unwrap().agents[1].state.name() != "dead" {}
        let said = call(control, 1.0, SECOND).unwrap_err().to_string();
        assert_eq!(said, "answerer is dead and answers no calls; restart it, and call again");
    });
}

#[test]
fn a_service_answers_on_the_wall_clock_too() {
    let live = Live::new(&plan("wall-call"), &types(), Options { limit: None, ..options(0) }).unwrap();
    let outside = outside(live.control(), |control| {
        for n in 1..50 {
            assert_eq!(call(control, f64::from(n), Duration::secs(20)).unwrap(), f64::from(n) / 2.0);
        }
    });
    live.run().unwrap();
    outside.join().unwrap();
}

/// What somebody asks from outside can be asked in a plan, so that a run can be repeated: the service steps, and no end is left over.
#[test]
fn a_plan_calls_a_service_as_somebody_from_outside_does() {
    let mut plan = plan("planned calls");
    plan.requests = vec![
        at(103, "call answerer.half 3"),
        at(107, "call answerer.quarter 3"),
        at(111, "call answerer.half 3 ; quit"),
        at(203, "fault answerer off"),
        at(205, "call answerer.half 4"),
        at(303, "fault answerer ok"),
    ];
    let report = Simulation::new(&plan, &types(), options(500)).unwrap().run().unwrap();
    let answerer = report.view.agents.iter().find(|agent| agent.name == "answerer").unwrap();
    assert_eq!(answerer.counts.releases, 2);
    assert!(report.view.wires.is_empty());
    let said: Vec<&str> = report.incidents.iter().map(|incident| incident.what.as_str()).collect();
    let told = |what: &str| said.iter().filter(|said| said.contains(what)).count();
    assert_eq!(
        (told("refused"), told("no service of answerer \"quarter\""), told("together")),
        (2, 1, 1),
        "{said:?}"
    );
}
