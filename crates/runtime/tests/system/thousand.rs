//! A system of a thousand agents in which one comes, is wired and goes, again and again. What it costs is printed, never asserted.

#![allow(clippy::disallowed_methods)] // what it costs is measured on the clock of the wall

use std::time::Instant;

use runtime::{AgentPlan, Control, Live, Options, Plan, Request, Simulation, WirePlan, registry};
use types::Duration;

use crate::{Relay, Source, at, options};

const AGENTS: usize = 1000;
const ROUNDS: usize = 300;

/// A source and relays in rows of ten, on two executors.
fn plan() -> Plan {
    let mut plan = Plan::new("thousand");
    plan.add::<Source>("source", Default::default());
    plan.every("source", Duration::secs(1));
    for i in 0..AGENTS - 1 {
        let name = format!("relay{i}");
        plan.add::<Relay>(&name, Default::default());
        plan.on(&name, "from");
        plan.agent_mut(&name).unwrap().executor = Some(["reflex", "control"][i / 500].into());
        let from = if i % 10 == 0 { "source.out".into() } else { format!("relay{}.to", i - 1) };
        plan.wires.push(WirePlan::new(from, format!("{name}.from")));
    }
    plan
}

/// Adds one, wires it, cuts that again and removes it: the median of each (µs).
fn rounds(control: &Control) -> [f64; 4] {
    let mut took = [(); 4].map(|()| Vec::new());
    for round in 0..ROUNDS {
        let guest = format!("guest{round}");
        let mut plan = AgentPlan { name: guest.clone(), kind: "relay".into(), ..AgentPlan::default() };
        (plan.executor, plan.on) = (Some("reflex".into()), vec!["from".into()]);
        let (from, to) = ("relay42.to".to_owned(), format!("{guest}.from"));
        let requests = [
            Request::Add(plan),
            Request::Wire(WirePlan::new(&from, &to)),
            Request::Unwire { from, to },
            Request::Remove(guest),
        ];
        for (took, request) in took.iter_mut().zip(requests) {
            let begun = Instant::now();
            control.request(request).unwrap();
            took.push(begun.elapsed().as_secs_f64() * 1e6);
        }
    }
    took.map(|mut took| {
        took.sort_by(f64::total_cmp);
        took[took.len() / 2]
    })
}

/// Measures beside a run, which then ends.
fn beside(control: Control) -> std::thread::JoinHandle<([f64; 4], usize, usize)> {
    let work = move || {
        let took = rounds(&control);
        let view = control.view().unwrap();
        control.request(Request::Quit).unwrap();
        (took, view.agents.len(), view.wires.len())
    };
    std::thread::Builder::new().name("asker".into()).spawn(work).unwrap()
}

#[test]
fn one_of_a_thousand_comes_and_goes() {
    let types = registry![Source, Relay];
    let built = Instant::now();
    let simulation =
        Simulation::new(&plan(), &types, Options { limit: None, speed: Some(1.0), ..options(0) }).unwrap();
    println!("{AGENTS} agents are built in {:.1} ms", built.elapsed().as_secs_f64() * 1e3);
    let asker = beside(simulation.control());
    simulation.run().unwrap();
    let live = Live::new(&plan(), &types, Options { limit: None, ..options(0) }).unwrap();
    let (simulated, live_asker) = (asker.join().unwrap(), beside(live.control()));
    live.run().unwrap();
    for (clock, (took, agents, wires)) in [("simulated", simulated), ("wall", live_asker.join().unwrap())] {
        let [add, wire, unwire, remove] = took;
        println!("{clock} (µs): add {add:.0}, wire {wire:.0}, unwire {unwire:.0}, remove {remove:.0}");
        assert_eq!((agents, wires), (AGENTS, AGENTS - 1));
    }
}

/// More changes than an executor can have under way, when all stand on one.
#[test]
fn a_system_of_many_wires_is_made_whole() {
    let mut plan = plan();
    plan.agents.iter_mut().for_each(|agent| agent.executor = Some("reflex".into()));
    for i in 0..AGENTS - 2 {
        // Across the rows, and filtered so that nothing goes there.
        let mut wire = WirePlan::new(format!("relay{}.to", i + 1), format!("relay{i}.from"));
        wire.filter.marker = Some(7);
        plan.wires.push(wire);
    }
    let report = Simulation::new(&plan, &registry![Source, Relay], options(500)).unwrap().run().unwrap();
    let silent: Vec<_> = report.view.agents.iter().filter(|agent| agent.counts.releases == 0).collect();
    assert!(silent.is_empty(), "{} agents have no step", silent.len());
    assert_eq!(report.view.wires.len(), plan.wires.len());
}

/// Agents that are all due at once step in data-flow order, however they stand in the plan: what the first sends is with the last at the
/// same instant, also after some have gone and come.
#[test]
fn of_many_that_are_due_at_once_each_steps_behind_those_it_hears() {
    const ROW: usize = 150;
    let mut plan = Plan::new("row");
    plan.add::<Source>("source", Default::default());
    for i in 0..ROW {
        // 77 and 150 share no divisor.
        plan.add::<Relay>(&format!("relay{}", i * 77 % ROW), Default::default());
    }
    for agent in &mut plan.agents {
        (agent.period, agent.executor) = (Some(Duration::millis(100)), Some("control".into()));
    }
    plan.wires.push(WirePlan::new("source.out", "relay0.from"));
    plan.wires
        .extend((1..ROW).map(|i| WirePlan::new(format!("relay{}.to", i - 1), format!("relay{i}.from"))));
    plan.requests = vec![at(450, "restart relay70"), at(730, "remove source")];
    let report = Simulation::new(&plan, &registry![Source, Relay], options(1000)).unwrap().run().unwrap();
    // At 0, 100, … 700 ms; nothing is left on the way.
    for wire in report.view.wires {
        assert_eq!((wire.sent, wire.taken), (8, 8), "{} to {}", wire.from, wire.to);
    }
}
