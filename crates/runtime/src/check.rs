//! All mistakes of a plan at once, without running anything.

use std::collections::HashMap;

use types::Duration;
use types::value::{Mistake, Span};

use crate::agent::{AgentType, PortInfo, Registry};
use crate::budget::budget_of;
use crate::means::Means;
use crate::message_type::MessageType;
use crate::plan::{AgentPlan, ExecutorPlan, Plan, WirePlan};
use crate::port::Direction;
use crate::queue_plan::{QueueSide, check_wire, other_type, serving_elsewhere};
use crate::request::Refusal;
use crate::router::{commanded_by_two, has_its_agent, robot_wires, timing_of, usual_executor};

/// All mistakes of a plan, in the order of the file as far as places are known.
pub fn check(plan: &Plan, registry: &Registry) -> Vec<Mistake> {
    let mut agents = HashMap::with_capacity(plan.agents.len());
    for agent in &plan.agents {
        agents.entry(agent.name.as_str()).or_insert(agent);
    }
    let mut checker = Checker { plan, agents, registry, mistakes: Vec::new() };
    checker.executors();
    checker.agents();
    checker.queues();
    for wire in &plan.wires {
        checker.wire(wire);
    }
    checker.commands();
    checker.mistakes.sort_by_key(|mistake| mistake.at.start);
    checker.mistakes
}

/// The executors of a plan: the usual ones, changed and added to by its own.
pub fn executors_of(plan: &Plan) -> Vec<ExecutorPlan> {
    let mut executors = ExecutorPlan::usual();
    for own in &plan.executors {
        match executors.iter_mut().find(|usual| usual.name == own.name) {
            Some(usual) => *usual = own.clone(),
            None => executors.push(own.clone()),
        }
    }
    executors
}

/// All wires of a plan: its own, and those that join agents to their robots. A wire that the plan names itself takes the place
/// of the one to the robot's port.
pub fn wires_of(plan: &Plan, registry: &Registry) -> Vec<WirePlan> {
    let mut wires = Vec::new();
    for agent in &plan.agents {
        let (Some(robot), Some(kind)) = (&agent.robot, registry.get(&agent.kind)) else { continue };
        let own = robot_wires(agent, kind, robot).into_iter();
        wires.extend(
            own.filter(|wire| !plan.wires.iter().any(|given| given.to == wire.to && given.from == wire.from)),
        );
    }
    wires.extend(plan.wires.iter().cloned());
    wires
}

/// An executor that runs by its agent's deadline has something that it cannot have.
pub fn not_by_deadline(executor: &str, what: &str, at: Span) -> Mistake {
    let why = match what {
        "priority" => "stands above all priorities",
        "cpus" => "runs on all processors: the kernel takes no other",
        _ => "sleeps until its time",
    };
    Mistake::new(at, format!("executor \"{executor}\" has \"{what}\" under policy \"deadline\""))
        .help(format!("one by deadline {why}"))
}

struct Checker<'a> {
    plan: &'a Plan,
    /// The first of each name.
    agents: HashMap<&'a str, &'a AgentPlan>,
    registry: &'a Registry,
    mistakes: Vec<Mistake>,
}

impl<'a> Checker<'a> {
    fn say(&mut self, at: Span, what: String) {
        self.mistakes.push(Mistake::new(at, what));
    }

    fn executors(&mut self) {
        for (i, executor) in self.plan.executors.iter().enumerate() {
            if executor.priority.is_some_and(|priority| !(1..=94).contains(&priority)) {
                let what = format!(
                    "the priority of executor \"{}\" must lie from 1 to 94; 95 and above belong to the witness",
                    executor.name
                );
                self.say(executor.at, what);
            }
            if executor.is_by_deadline() {
                self.by_deadline(executor);
            }
            if self.plan.executors[..i].iter().any(|other| other.name == executor.name) {
                self.say(executor.at, format!("there are two executors \"{}\"", executor.name));
            }
        }
    }

    /// What an executor cannot have that runs by its agent's deadline.
    fn by_deadline(&mut self, executor: &ExecutorPlan) {
        let has = [
            ("priority", executor.priority.is_some()),
            ("cpus", !executor.cpus.is_empty()),
            ("spin", executor.spin != Duration::ZERO),
        ];
        for (what, _) in has.iter().filter(|(_, has)| *has) {
            self.mistakes.push(not_by_deadline(&executor.name, what, executor.at));
        }
    }

    fn agents(&mut self) {
        let executors = executors_of(self.plan);
        // Who is the first on each executor that runs by its agent's deadline.
        let mut first: HashMap<&str, &str> = HashMap::new();
        for agent in &self.plan.agents {
            if self.agents.get(agent.name.as_str()).is_some_and(|first| !core::ptr::eq(*first, agent)) {
                self.say(agent.at, format!("there are two agents \"{}\"", agent.name));
            }
            if let Some(name) = &agent.executor
                && !executors.iter().any(|known| known.name == *name)
            {
                let known = executors.iter().map(|executor| executor.name.as_str());
                self.mistakes.push(Mistake::unknown(agent.at, "executor", name, known));
            }
            let Some(kind) = self.registry.get(&agent.kind) else {
                let known = self.registry.types().iter().map(|kind| kind.kind);
                self.mistakes.push(Mistake::unknown(agent.at, "type of agent", &agent.kind, known));
                continue;
            };
            self.mistakes.extend(kind.check_params(&agent.params));
            for input in &agent.on {
                if kind.port(input).is_none_or(|port| !port.shape.comes_in()) {
                    let known = kind.ports.iter().filter(|port| port.shape.comes_in()).map(|port| port.name);
                    self.mistakes.push(Mistake::unknown(
                        agent.at,
                        &format!("input of {}", agent.kind),
                        input,
                        known,
                    ));
                }
            }
            if let Err(against) = Means::of(agent, kind) {
                against.into_iter().for_each(|refusal| self.refuse(agent.at, refusal));
            }
            let timing = match timing_of(agent) {
                Ok(timing) => timing,
                Err(refusal) => {
                    self.refuse(agent.at, refusal);
                    continue;
                }
            };
            let name = agent.executor.as_deref().unwrap_or(usual_executor(timing.deadline));
            let executor = executors.iter().find(|executor| executor.name == name);
            let manages = |port: &PortInfo| port.shape.direction == Direction::Manager;
            if let Some(executor) = executor.filter(|executor| executor.level().is_some())
                && kind.ports.iter().any(manages)
            {
                let what = format!(
                    "{} manages, and executor \"{}\" is in real time: managing takes memory and locks",
                    agent.name, executor.name
                );
                let help = "write executor = \"ordinary\"";
                self.mistakes.push(Mistake::new(agent.at, what).help(help));
            }
            let Some(executor) = executor.filter(|executor| executor.is_by_deadline()) else { continue };
            match first.get(executor.name.as_str()) {
                Some(other) => self.refuse(agent.at, has_its_agent(&executor.name, other, &agent.name)),
                None => drop(first.insert(&executor.name, &agent.name)),
            }
            if let Err(against) = budget_of(agent, &timing) {
                against.into_iter().for_each(|refusal| self.refuse(agent.at, refusal));
            }
        }
    }

    fn end(&mut self, name: &str, at: Span) -> Option<(&'a AgentPlan, &'a AgentType, usize)> {
        let Some((agent_name, port)) = name.rsplit_once('.') else {
            self.mistakes.push(
                Mistake::new(at, format!("\"{name}\" is no port")).help("write it as in \"sonar.filtered\""),
            );
            return None;
        };
        let Some(agent) = self.agents.get(agent_name).copied() else {
            let known = self.plan.agents.iter().map(|agent| agent.name.as_str());
            self.mistakes.push(Mistake::unknown(at, "agent", agent_name, known));
            return None;
        };
        // An unknown type has been said already.
        let kind = self.registry.get(&agent.kind)?;
        let place = kind.ports.iter().position(|known| known.name == port);
        if place.is_none() {
            let known = kind.ports.iter().map(|port| port.name);
            self.mistakes.push(Mistake::unknown(at, &format!("port of {agent_name}"), port, known));
        }
        Some((agent, kind, place?))
    }

    fn queues(&mut self) {
        for (i, queue) in self.plan.queues.iter().enumerate() {
            let name = &queue.name;
            if self.plan.queues[..i].iter().any(|other| other.name == *name) {
                self.say(queue.at, format!("there are two queues \"{name}\""));
            }
            if self.agents.contains_key(name.as_str()) {
                self.say(queue.at, format!("\"{name}\" is an agent and a queue; names are given once"));
            }
            if let Err(refusal) = queue.check() {
                self.refuse(queue.at, refusal);
            }
        }
    }

    fn refuse(&mut self, at: Span, refusal: Refusal) {
        self.mistakes.push(Mistake { at, what: refusal.what, help: refusal.help });
    }

    /// What a queue holds: the messages of the first port that is wired to it in the right way.
    fn holds(&self, queue: &str) -> Option<&'static MessageType> {
        self.plan.wires.iter().find_map(|wire| {
            let (port, is_sender) = match queue {
                _ if wire.to == queue => (&wire.from, true),
                _ if wire.from == queue => (&wire.to, false),
                _ => return None,
            };
            let (agent, port) = port.rsplit_once('.')?;
            let shape = self.registry.get(&self.agents.get(agent)?.kind)?.port(port)?.shape;
            let message = if is_sender { shape.output } else { shape.input };
            message.filter(|message| !message.large)
        })
    }

    fn queue_wire(&mut self, wire: &WirePlan, side: QueueSide) {
        let (queue, port) = match side {
            QueueSide::Into => (&wire.to, &wire.from),
            QueueSide::OutOf => (&wire.from, &wire.to),
        };
        let Some((_, kind, at)) = self.end(port, wire.at) else { return };
        let shape = &kind.ports[at].shape;
        let mut checked = check_wire(wire, side, shape);
        let message = if side == QueueSide::Into { shape.output } else { shape.input };
        if let (Some(message), Some(holds)) = (message, self.holds(queue))
            && holds != message
        {
            checked = checked.and(Err(other_type(queue, holds, port, message)));
        }
        if let Err(refusal) = checked {
            self.refuse(wire.at, refusal);
        }
    }

    /// Inputs that take one sender have one.
    fn commands(&mut self) {
        let wires = wires_of(self.plan, self.registry);
        let mut first: HashMap<&str, &str> = HashMap::new();
        for wire in &wires {
            let Some((agent, port)) = wire.to.rsplit_once('.') else { continue };
            let kind = self.agents.get(agent).and_then(|agent| self.registry.get(&agent.kind));
            if !kind.and_then(|kind| kind.port(port)).is_some_and(|port| port.options.single) {
                continue;
            }
            let sender = wire
                .from
                .rsplit_once('.')
                .and_then(|(agent, port)| self.registry.get(&self.agents.get(agent)?.kind)?.port(port));
            if sender.is_none_or(|sender| !sender.options.is_ordinary()) {
                continue;
            }
            match first.get(wire.to.as_str()) {
                Some(one) => self.refuse(wire.at, commanded_by_two(one, &wire.from, &wire.to)),
                None => drop(first.insert(&wire.to, &wire.from)),
            }
        }
    }

    fn wire(&mut self, wire: &WirePlan) {
        if let Some(name) = &wire.filter.recipient
            && !self.agents.contains_key(name.as_str())
        {
            let known = self.plan.agents.iter().map(|agent| agent.name.as_str());
            self.mistakes.push(Mistake::unknown(wire.at, "agent", name, known));
        }
        match self.plan.queue_side(wire) {
            Ok(None) if wire.serving.is_some() => self.refuse(wire.at, serving_elsewhere(wire)),
            Ok(None) => {}
            Ok(Some(side)) => return self.queue_wire(wire, side),
            Err(refusal) => return self.refuse(wire.at, refusal),
        }
        let (from, to) = (self.end(&wire.from, wire.at), self.end(&wire.to, wire.at));
        let (Some((_, out_kind, out)), Some((_, in_kind, into))) = (from, to) else { return };
        let (out, into) = (&out_kind.ports[out].shape, &in_kind.ports[into].shape);
        match (out.direction, into.direction) {
            (Direction::Output, Direction::Input) | (Direction::Client, Direction::Service) => {
                let fits = out.output == into.input
                    && (out.direction == Direction::Output || out.input == into.output);
                if let (false, Some(sends), Some(takes)) = (fits, out.output, into.input) {
                    let what = format!(
                        "{} sends {}, {} takes {}",
                        wire.from,
                        sends.short_name(),
                        wire.to,
                        takes.short_name()
                    );
                    self.say(wire.at, what);
                }
            }
            (a, b) => {
                let what = format!("{} is an {}, {} an {}", wire.from, a.name(), wire.to, b.name());
                let help = "a wire leads from an output to an input, or from a client to a service";
                self.mistakes.push(Mistake::new(wire.at, what).help(help));
            }
        }
    }
}
