//! A plan as the analysis of schedules sees it.

use std::collections::HashMap;

use schedule::Exact;
use schedule::system::{Agent, Executor, Source, System, Unsound};
use types::Duration;

use crate::agent::Registry;
use crate::census::mask_of;
use crate::check::{executors_of, wires_of};
use crate::plan::{AgentPlan, ExecutorPlan, Plan, USUAL_DEPTH_ON, WirePlan, owner};
use crate::port::Direction;
use crate::request::Refusal;
use crate::router::{timing_of, usual_executor};

/// What is not in a plan and must be known of it.
pub struct Assumed<'a> {
    /// Processor time of a step of an agent at worst.
    pub cost: &'a dyn Fn(&AgentPlan) -> Duration,
    /// How many processors there are.
    pub processors: usize,
    /// What the runtime needs around each step: waking, choosing, counting.
    pub overhead: Duration,
    /// The time between two messages of an output that sends by a clock of its own, whatever makes its agent run: a robot's readings.
    pub pace: &'a dyn Fn(&str) -> Option<Duration>,
}

/// A plan as the analysis sees it: its agents stand in the order of the plan.
#[derive(Clone, Debug, Default)]
pub struct Timetable {
    /// Agents, threads and what makes whom run.
    pub system: System,
    /// The threads, in the order of the system's.
    pub executors: Vec<ExecutorPlan>,
}

/// A plan without mistakes as the analysis sees it.
///
/// An agent that calls a service runs once more for each answer, and answers are no more than its other steps: these count twice. Whoever takes
/// messages out of a queue may have to take all of them. Steps that an agent asks for itself ([`Step::wake_at`](crate::Step::wake_at)) are
/// counted where its plan declares a least time between them ([`AgentPlan::wake_gap`]): else nobody knows beforehand how many there will be.
pub fn timetable(plan: &Plan, registry: &Registry, assumed: &Assumed<'_>) -> Timetable {
    let executors = executors_of(plan);
    // Those by deadline stand above all others, on one level: each is taken to wait for all the rest, which it does at worst, whoever of them
    // has the earliest deadline. In the order of their deadlines the sum were less, and too little.
    let threads = executors
        .iter()
        .map(|executor| Executor { priority: executor.level(), may: mask_of(&executor.cpus) });
    let wires = wires_of(plan, registry);
    let ways = Ways::of(plan, registry, &wires);
    let agents = plan.agents.iter().map(|agent| {
        let timing = timing_of(agent).ok();
        let deadline = timing.map_or(Duration::ZERO, |timing| timing.deadline);
        let name = agent.executor.as_deref().unwrap_or(usual_executor(deadline));
        let mut sources: Vec<Source> =
            agent.period.iter().map(|period| Source::Clock { period: exact(*period) }).collect();
        sources.extend(ways.sources(agent, assumed));
        let asks = Some(agent.wake_gap).filter(|gap| *gap > Duration::ZERO);
        sources.extend(asks.map(|gap| Source::Asked { least: exact(gap) }));
        if ways.calls(agent) {
            sources.extend(sources.clone());
        }
        Agent {
            cost: exact((assumed.cost)(agent) + assumed.overhead),
            deadline: exact(deadline),
            executor: executors.iter().position(|executor| executor.name == name).unwrap_or(0),
            sources,
            least_gap: exact(agent.min_gap),
        }
    });
    let system =
        System { processors: assumed.processors, agents: agents.collect(), executors: threads.collect() };
    Timetable { system, executors }
}

/// Why a system of agents with these names cannot be analysed, in words.
pub fn why_unsound(unsound: &Unsound, names: &[String]) -> Refusal {
    match unsound {
        Unsound::Circle(circle) => {
            let around = circle.iter().chain(circle.first()).map(|at| names[*at].as_str());
            let around: Vec<&str> = around.collect();
            Refusal::new(format!("agents make each other run in a circle: {}", around.join(" → ")))
                .help("one of them should have a period, and not be on what the one before it sends")
        }
        Unsound::TooFine => Refusal::new(unsound.to_string()),
    }
}

fn exact(span: Duration) -> Exact {
    Exact::from_integer(span.0.into())
}

/// Who sends to whom.
struct Ways<'a> {
    plan: &'a Plan,
    registry: &'a Registry,
    /// The wires into each agent, and out of each queue.
    into: HashMap<&'a str, Vec<&'a WirePlan>>,
    /// The wires into each queue.
    queues: HashMap<&'a str, Vec<&'a WirePlan>>,
    /// The wires out of each agent.
    out_of: HashMap<&'a str, Vec<&'a WirePlan>>,
    places: HashMap<&'a str, usize>,
}

impl<'a> Ways<'a> {
    fn of(plan: &'a Plan, registry: &'a Registry, wires: &'a [WirePlan]) -> Ways<'a> {
        let places = plan.agents.iter().enumerate().map(|(at, agent)| (agent.name.as_str(), at)).collect();
        let mut ways = Ways {
            plan,
            registry,
            into: HashMap::new(),
            queues: HashMap::new(),
            out_of: HashMap::new(),
            places,
        };
        for wire in wires {
            if plan.is_queue(&wire.to) {
                ways.queues.entry(&wire.to).or_default().push(wire);
            } else {
                ways.into.entry(owner(&wire.to)).or_default().push(wire);
            }
            ways.out_of.entry(owner(&wire.from)).or_default().push(wire);
        }
        ways
    }

    fn sources(&self, agent: &AgentPlan, assumed: &Assumed<'_>) -> Vec<Source> {
        let mut sources = Vec::new();
        for wire in self.into.get(agent.name.as_str()).into_iter().flatten() {
            let port = wire.to.rsplit_once('.').map_or("", |(_, port)| port);
            if !agent.on.iter().any(|on| on == port) {
                continue;
            }
            let every = wire.filter.every.max(1);
            match self.queues.get(wire.from.as_str()) {
                Some(into) if self.plan.is_queue(&wire.from) => {
                    sources.extend(into.iter().filter_map(|into| self.source(into, every, assumed)));
                }
                _ => sources.extend(self.source(wire, every, assumed)),
            }
        }
        sources
    }

    fn source(&self, wire: &WirePlan, every: u32, assumed: &Assumed<'_>) -> Option<Source> {
        let agent = *self.places.get(owner(&wire.from))?;
        let depth = wire.depth.unwrap_or(USUAL_DEPTH_ON) as u32;
        Some(match (assumed.pace)(&wire.from) {
            Some(period) => Source::Paced { agent, period: exact(period * i64::from(every)) },
            None => Source::After { agent, every, least: Exact::from_integer(0), depth },
        })
    }

    /// Whether answers make it run.
    fn calls(&self, agent: &AgentPlan) -> bool {
        let Some(kind) = self.registry.get(&agent.kind) else { return false };
        self.out_of.get(agent.name.as_str()).into_iter().flatten().any(|wire| {
            let port = wire.from.rsplit_once('.').map_or("", |(_, port)| port);
            kind.port(port).is_some_and(|port| port.shape.direction == Direction::Client)
        })
    }
}
