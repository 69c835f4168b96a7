//! Many agents: how long it takes to add one to a live system of many and to take it out again, and how fast many run in simulated
//! time.

use runtime::{
    Agent, AgentPlan, AgentType, Control, Fault, Input, Options, Output, Plan, Registry, Request, Simulation,
    Step, WirePlan,
};
use types::Duration;

use super::Setting;
use super::outcome::{Outcome, median};
use super::parcel::{self, Parcel, end, live, now, thread};
use crate::error::Failure;
use crate::terminal::host_now;

/// Agents of the live system, and of a small one beside it.
const MANY: usize = 1000;
const FEW: usize = 10;
/// Wires of each agent of the live system: to the next ones in a row. The cost of a change shall not depend on them.
const WIRES: [usize; 2] = [1, 8];
/// How often an agent is added and taken out.
const TIMES: usize = 200;
/// Agents in simulated time.
const SIMULATED: [usize; 3] = [1000, 3000, 10_000];
/// How often each runs.
const PERIOD: Duration = Duration::millis(100);
/// How long they run in simulated time (s), and runs.
const LENGTH: usize = 20;
const RUNS: usize = 3;

/// Takes what comes, and sends.
#[derive(Agent)]
struct Cell {
    /// What comes.
    take: Input<Parcel>,
    /// What goes.
    give: Output<Parcel>,
    taken: u64,
}

impl Agent for Cell {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while let Some(parcel) = self.take.take() {
            self.taken += parcel.number;
        }
        self.give.send(Parcel { number: 1, ..Parcel::default() });
        Ok(())
    }
}

fn registry() -> Registry {
    Registry::new([AgentType::of::<Cell>()])
}

/// So many agents, each wired to the next ones.
fn plan(count: usize, wires: usize) -> Plan {
    let mut plan = Plan::new("grow");
    for number in 0..count {
        let name = format!("cell{number}");
        plan.add::<Cell>(&name, Default::default());
        let next = (number + 1..count).take(wires);
        plan.wires.extend(next.map(|next| WirePlan::new(format!("{name}.give"), format!("cell{next}.take"))));
    }
    for agent in &mut plan.agents {
        (agent.period, agent.executor) = (Some(PERIOD), Some("ordinary".into()));
    }
    plan
}

/// Adds an agent with a wire from one that runs and a wire to another, and removes it, so many times. Gives how long each of the two
/// took (ns).
fn change(control: &Control, times: usize) -> Result<[Vec<f64>; 2], Failure> {
    let (mut added, mut removed) = (Vec::new(), Vec::new());
    let guest = || AgentPlan {
        name: "guest".into(),
        kind: "cell".into(),
        period: Some(PERIOD),
        executor: Some("ordinary".into()),
        ..AgentPlan::default()
    };
    for _ in 0..times {
        let wires = [WirePlan::new("cell0.give", "guest.take"), WirePlan::new("guest.give", "cell1.take")];
        let wires = wires.map(Request::Wire);
        let all = Request::All([Request::Add(guest())].into_iter().chain(wires).collect());
        for (request, spans) in [(all, &mut added), (Request::Remove("guest".into()), &mut removed)] {
            let begun = now();
            control.request(request).map_err(|refusal| Failure::new(refusal.to_string()).code(1))?;
            spans.push((now() - begun) as f64);
        }
    }
    Ok([added, removed])
}

/// The same in a live system of `count` agents.
fn change_live(
    count: usize,
    wires: usize,
    times: usize,
    outcome: &mut Outcome,
) -> Result<[Vec<f64>; 2], Failure> {
    let options = Options { limit: Some(Duration::secs(600)), ..Options::default() };
    let live = live(&plan(count, wires), &registry(), options)?;
    let control = live.control();
    let changes = thread("bench-changes", move || {
        let changed = change(&control, times);
        // A refusal would mean that the run has ended.
        let _ = control.request(Request::Quit);
        changed
    })?;
    let ran = parcel::run(live, outcome);
    let changed = end(changes)?;
    ran?;
    changed
}

/// How many times as fast as real time so many agents run, and the time of a step (ns).
fn simulated(count: usize, length: Duration) -> Result<(f64, f64), Failure> {
    let failed = |error: runtime::CannotRun| Failure::new(error.to_string()).code(1);
    let options = Options { limit: Some(length), ..Options::default() };
    let simulation = Simulation::new(&plan(count, 1), &registry(), options).map_err(failed)?;
    let begun = host_now();
    let report = simulation.run().map_err(failed)?;
    let wall = begun.elapsed().as_secs_f64();
    let steps: u64 = report.view.agents.iter().map(|agent| agent.counts.releases).sum();
    Ok((length.seconds() / wall, wall * 1e9 / steps as f64))
}

pub(super) fn measure(setting: &Setting<'_>) -> Result<Outcome, Failure> {
    let mut outcome = Outcome::default();
    let times = setting.of(TIMES, 5);
    let shortest = setting.shorter > 100;
    let many = if shortest { 30 } else { MANY };
    let mut added_of = Vec::new();
    for (count, wires) in [(FEW, WIRES[0]), (many, WIRES[0]), (many, WIRES[1])] {
        let [added, removed] = change_live(count, wires, times, &mut outcome)?;
        added_of.push(median(added.clone()));
        let of = format!("{count}_agents_{wires}_wires_each");
        outcome.figure(format!("add_to_{of}"), "ns", added);
        outcome.figure(format!("remove_from_{of}"), "ns", removed);
    }
    outcome.compare("add_with_8_wires/add_with_1_wire", vec![(added_of[2], added_of[1])]);
    let length = Duration::secs(setting.of(LENGTH, 1) as i64);
    let (mut first, mut rounds) = (Vec::new(), Vec::new());
    for count in SIMULATED {
        let count = if shortest { count / 100 } else { count };
        let (mut speeds, mut steps) = (Vec::new(), Vec::new());
        for _ in 0..setting.of(RUNS, if shortest { 1 } else { 3 }) {
            let (speed, step) = simulated(count, length)?;
            speeds.push(speed);
            steps.push(step);
        }
        rounds = steps.iter().copied().zip(first.iter().copied()).collect();
        if first.is_empty() {
            first = steps.clone();
        }
        outcome.figure(format!("agents_{count}"), "x real time", speeds);
        outcome.figure(format!("agents_{count}_step"), "ns", steps);
    }
    outcome.compare("step_of_10000/step_of_1000", rounds);
    Ok(outcome)
}
