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
const WIRES: [usize; 2] = [1, 2];
/// How often an agent is added and taken out.
const TIMES: usize = 200;
/// Agents in simulated time.
const SIMULATED: [usize; 4] = [300, 1000, 3000, 10_000];
/// How often each runs.
const PERIOD: Duration = Duration::millis(100);
/// How long they run in simulated time (s), and runs.
const LENGTH: usize = 20;
const RUNS: usize = 3;
/// Longer than this nobody waits for a system to be made (s).
const PATIENCE: f64 = 120.0;

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

/// What a run in simulated time gives.
struct Ran {
    /// What it took to make the system (s).
    made: f64,
    /// How many times as fast as real time it ran.
    speed: f64,
    /// The mean of a step (ns).
    step: f64,
}

fn simulated(count: usize, length: Duration) -> Result<Ran, Failure> {
    let failed = |error: runtime::CannotRun| Failure::new(error.to_string()).code(1);
    let options = Options { limit: Some(length), ..Options::default() };
    let begun = host_now();
    let simulation = Simulation::new(&plan(count, 1), &registry(), options).map_err(failed)?;
    let made = begun.elapsed().as_secs_f64();
    let begun = host_now();
    let report = simulation.run().map_err(failed)?;
    let wall = begun.elapsed().as_secs_f64();
    let steps: u64 = report.view.agents.iter().map(|agent| agent.counts.releases).sum();
    Ok(Ran { made, speed: length.seconds() / wall, step: wall * 1e9 / steps as f64 })
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
    outcome.compare("add_with_2_wires/add_with_1_wire", vec![(added_of[2], added_of[1])]);
    many_simulated(setting, &mut outcome)?;
    Ok(outcome)
}

/// More and more agents in simulated time, as long as it does not take too long to make them.
fn many_simulated(setting: &Setting<'_>, outcome: &mut Outcome) -> Result<(), Failure> {
    let shortest = setting.shorter > 100;
    let length = Duration::secs(setting.of(LENGTH, 1) as i64);
    let runs = setting.of(RUNS, 1);
    let mut first = Vec::new();
    let (mut last, mut before) = ((0.0, 0.0), (0.0, 0.0));
    for count in SIMULATED {
        let size = if shortest { count / 100 } else { count };
        if expected(before, last, size as f64) > PATIENCE / setting.shorter.min(10) as f64 {
            let (size_before, made) = last;
            let what = format!(
                "{size} agents were not tried: to make a system of {size_before} takes {made:.1} s, and the time grows faster than the agents"
            );
            outcome.without("step_of_10000/step_of_1000", Some(Failure::new(what).code(1)));
            return Ok(());
        }
        let ran = (0..runs).map(|_| simulated(size, length)).collect::<Result<Vec<Ran>, Failure>>()?;
        let figure = |of: fn(&Ran) -> f64| ran.iter().map(of).collect::<Vec<f64>>();
        (before, last) = (last, (size as f64, median(figure(|ran| ran.made))));
        outcome.figure(format!("agents_{size}"), "x real time", figure(|ran| ran.speed));
        outcome.figure(format!("agents_{size}_step"), "ns", figure(|ran| ran.step));
        outcome.figure(format!("agents_{size}_made"), "s", figure(|ran| ran.made));
        if count == SIMULATED[1] {
            first = figure(|ran| ran.step);
        } else if count == SIMULATED[3] {
            let rounds = figure(|ran| ran.step).into_iter().zip(first.iter().copied()).collect();
            outcome.compare("step_of_10000/step_of_1000", rounds);
        }
    }
    Ok(())
}

/// How long it will take to make a system of `count` agents (s), from the counts and times of two smaller ones: the time is taken for
/// a power of the count.
fn expected(before: (f64, f64), last: (f64, f64), count: f64) -> f64 {
    if before.0 == 0.0 || before.1 <= 0.0 || last.1 <= 0.0 {
        return 0.0;
    }
    let power = (last.1 / before.1).ln() / (last.0 / before.0).ln();
    last.1 * (count / last.0).powf(power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_grows_with_the_square_is_expected_to_go_on_so() {
        assert!((expected((10.0, 2.0), (20.0, 8.0), 40.0) - 32.0).abs() < 1e-9);
        assert_eq!(expected((0.0, 0.0), (20.0, 8.0), 40.0), 0.0);
    }
}
