//! Agents that only messages make run, and that nobody sends any.

use runtime::{Direction, PortInfo, wires_of};
use types::value::Mistake;

use super::read::{ROBOT, Reader};

/// The section of what a system knows: its schedules can ask for wires.
const KNOWLEDGE: &str = "knowledge";

impl Reader<'_> {
    /// Tells who has no period, and no wire to any of the inputs that it is on. Nothing is said where that can change while the system runs.
    pub(super) fn untriggered(&mut self) {
        if self.lost_wires || self.plan.sections.get(KNOWLEDGE).is_some() || self.wires_itself() {
            return;
        }
        let wires = wires_of(&self.plan, self.registry);
        let mut found = Vec::new();
        for agent in self.plan.agents.iter().filter(|agent| agent.kind != ROBOT) {
            if agent.period.is_some() || agent.on.is_empty() {
                continue;
            }
            let Some(kind) = self.registry.get(&agent.kind) else { continue };
            // Services are called by people too, and what is wrong with an unknown input has been said.
            let is_input = |port: &PortInfo| port.shape.direction == Direction::Input;
            if !agent.on.iter().all(|on| kind.port(on).is_some_and(is_input)) {
                continue;
            }
            let mut ports = agent.on.iter().map(|on| format!("{}.{on}", agent.name));
            if ports.any(|port| wires.iter().any(|wire| wire.to == port) || self.is_wired_later(&port)) {
                continue;
            }
            let inputs: Vec<String> = agent.on.iter().map(|on| format!("\"{on}\"")).collect();
            let (inputs, first) = (inputs.join(" and "), format!("{}.{}", agent.name, agent.on[0]));
            let what = format!("{} would never run: it is on {inputs}, to which no wire leads", agent.name);
            let mut help = format!("lead a wire to \"{first}\" in [wires], or give it a period");
            let is_of_robot = |on: &String| kind.port(on).is_some_and(|port| port.options.robot.is_some());
            if agent.robot.is_none()
                && agent.on.iter().any(is_of_robot)
                && let Some(robot) = self.robots.rows().first()
            {
                help = format!("write robot = \"{}\", or {help}", robot.key);
            }
            found.push(Mistake::new(agent.at, what).help(help));
        }
        self.mistakes.extend(found);
    }

    /// Whether an agent is there that makes wires while the system runs.
    fn wires_itself(&self) -> bool {
        let kinds = self.plan.agents.iter().filter_map(|agent| self.registry.get(&agent.kind));
        let is_router = |port: &PortInfo| port.shape.direction == Direction::Router;
        kinds.into_iter().any(|kind| kind.ports.iter().any(is_router))
    }

    /// Whether a request of `[[at]]` names the port.
    fn is_wired_later(&self, port: &str) -> bool {
        self.plan.requests.iter().any(|request| request.words.iter().any(|word| word == port))
    }
}
