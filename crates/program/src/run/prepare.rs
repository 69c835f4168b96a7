//! From a plan to one that a seed has drawn, with its robots behind their gates.

use std::collections::{BTreeSet, HashMap};
use std::sync::{Arc, Mutex, PoisonError};

use hardware::description::Periods;
use hardware::gate::Counts;
use hardware::robot::{CYCLE, RobotParams};
use hardware::simulated::{self, Hands, SERVICES, Truth};
use hardware::{Berth, ClockKind, Gate, Latch, RobotDescription, Spec};
use runtime::{Admission, AgentPlan, Params as _, Plan, Registry};
use sim::model::Shape;
use sim::{Drawn, Goal, Model, Vary, WorldPlan};
use types::Duration;
use types::value::{Mistake, Row, Span, Table};

use crate::error::Failure;
use crate::file::{Loaded, Mistakes};

/// A system file that was read: what every seed is drawn from.
#[derive(Clone, Debug)]
pub(crate) struct Scenario {
    /// The file.
    pub(crate) file: Loaded,
    /// The types of agents that it may name.
    pub(crate) registry: Registry,
}

/// A robot on the way into a run.
#[derive(Debug)]
pub(crate) struct RobotReady {
    /// Its name.
    pub(crate) name: String,
    /// Its outline; for drawing.
    pub(crate) shape: Shape,
    /// What it is.
    pub(crate) description: RobotDescription,
    /// Its latch.
    pub(crate) latch: Latch,
    /// What its gate counts.
    pub(crate) counts: Arc<Counts>,
    /// What was in its recording.
    pub(crate) report: Option<hardware::Report>,
}

/// A plan as a seed has drawn it, ready for a clock.
#[derive(Debug)]
pub(crate) struct Ready {
    /// The plan, with the agents of its robots.
    pub(crate) plan: Plan,
    /// All types of agents, those of the robots among them.
    pub(crate) registry: Registry,
    /// Its robots.
    pub(crate) robots: Vec<RobotReady>,
    /// What the judge knows, in a simulated world.
    pub(crate) truth: Option<Truth>,
    /// The goal, if there is one.
    pub(crate) goal: Option<Goal>,
    /// Whether any robot can only be driven by the wall clock.
    pub(crate) needs_wall: bool,
}

/// The outline of a robot of which nothing is known: that of the usual one.
const USUAL_SHAPE: Shape = Shape::Round { radius: 0.225 };

impl Scenario {
    fn table(&self, name: &str) -> Table {
        self.file.plan.section(name).cloned().unwrap_or_default()
    }

    fn place(&self, name: &str) -> Span {
        self.file.plan.sections.get(name).map(|entry| entry.at).unwrap_or_default()
    }

    fn wrong(&self, list: Vec<Mistake>) -> Failure {
        Mistakes { sources: self.file.sources.clone(), list }.into()
    }

    /// Draws what a seed changes, opens the robots, and puts their gates behind their agents.
    pub(crate) fn prepare(&self, seed: u64) -> Result<Ready, Failure> {
        let mut ready = Ready {
            plan: self.file.plan.clone(),
            registry: self.registry.clone(),
            robots: Vec::new(),
            truth: None,
            goal: None,
            needs_wall: false,
        };
        let mut simulated: Vec<&Row> = Vec::new();
        let robots = self.table("robot");
        for row in robots.rows() {
            match self.spec(row)? {
                (Spec::Simulated, _) => simulated.push(row),
                (_, driver) => self.open(row, &driver, &mut ready)?,
            }
        }
        if !simulated.is_empty() {
            self.raise(&simulated, seed, &mut ready)?;
        }
        Ok(ready)
    }

    fn spec(&self, row: &Row) -> Result<(Spec, String), Failure> {
        let driver = row.entry.value.as_table().and_then(|table| table.get("driver"));
        let (word, at) = match driver {
            Some(entry) => (entry.value.as_text().unwrap_or_default().to_owned(), entry.at),
            None => ("sim".to_owned(), row.key_at),
        };
        match Spec::parse(&word) {
            Ok(spec) => Ok((spec, word)),
            Err(error) => Err(self.wrong(vec![Mistake::new(at, error.to_string())])),
        }
    }

    fn open(&self, row: &Row, driver: &str, ready: &mut Ready) -> Result<(), Failure> {
        let at = row.entry.value.as_table().and_then(|table| table.get("driver")).map(|entry| entry.at);
        let opened = hardware::open(driver, &row.key, &self.file.folder)
            .map_err(|error| self.wrong(vec![Mistake::new(at.unwrap_or(row.key_at), error.to_string())]))?;
        // What is no robot of a simulated world may be a thing that other processes must be able to stop.
        let latch = match opened.driver.describe().clock {
            ClockKind::Wall => Latch::open(&self.file.plan.name, &row.key)
                .map_err(|error| Failure::new(format!("robot \"{}\": {error}", row.key)))?,
            ClockKind::Simulated | ClockKind::Recorded => Latch::private(),
        };
        ready.needs_wall |= opened.driver.describe().clock == ClockKind::Wall;
        let gate = Gate::of(opened.driver, latch);
        ready.enter(row, gate, USUAL_SHAPE, opened.report);
        Ok(())
    }

    /// The simulated robots, all in one world.
    fn raise(&self, rows: &[&Row], seed: u64, ready: &mut Ready) -> Result<(), Failure> {
        let Some(world) = &self.file.world else {
            let what = hardware::OpenError::NeedsWorld.to_string();
            return Err(self.wrong(vec![Mistake::new(rows[0].key_at, what)]));
        };
        let goal = self.goal(world)?;
        let drawn = self.drawn(world, rows, goal.as_ref(), seed)?;
        let mut mistakes = Vec::new();
        let mut robots = Vec::new();
        for (name, start) in &drawn.starts {
            let entry = drawn.robots.get(name);
            let table = entry.and_then(|entry| entry.value.as_table()).cloned().unwrap_or_default();
            let at = entry.map(|entry| entry.at).unwrap_or_default();
            let elsewhere = gate_keys().chain(["driver", "start"]).collect::<Vec<_>>();
            if let Some(model) = Model::read(&table, at, &elsewhere, &mut mistakes) {
                let (name, start, goal) = (name.clone(), *start, goal.clone());
                robots.push(simulated::Robot { name, model, start, goal });
            }
        }
        if !mistakes.is_empty() {
            return Err(self.wrong(mistakes));
        }
        let (drivers, truth) = simulated::raise(&drawn.plan, seed, &robots)
            .map_err(|error| self.wrong(vec![Mistake::new(rows[0].key_at, error.to_string())]))?;
        if let Some(driver) = drivers.first() {
            ready.open_to_hands(&driver.hands());
        }
        for (driver, robot) in drivers.into_iter().zip(&robots) {
            if let Some(row) = rows.iter().find(|row| row.key == robot.name) {
                ready.enter(row, Gate::new(driver, Latch::private()), robot.model.shape, None);
            }
        }
        (ready.truth, ready.goal) = (Some(truth), goal);
        Ok(())
    }

    fn goal(&self, world: &Table) -> Result<Option<Goal>, Failure> {
        let Some(goal) = self.file.plan.section("goal") else { return Ok(None) };
        let mut mistakes = Vec::new();
        let world = WorldPlan::read(world, &mut mistakes);
        let goal = world.and_then(|world| Goal::read(goal, self.place("goal"), &world, &mut mistakes));
        if mistakes.is_empty() { Ok(goal) } else { Err(self.wrong(mistakes)) }
    }

    fn drawn(&self, world: &Table, rows: &[&Row], goal: Option<&Goal>, seed: u64) -> Result<Drawn, Failure> {
        let mut mistakes = Vec::new();
        let mut robots = Table::new();
        rows.iter().for_each(|row| robots.push((*row).clone()));
        let of_world =
            world.get("vary").and_then(|entry| entry.value.as_table()).cloned().unwrap_or_default();
        let of_world = Vary::read(&of_world, &mut mistakes);
        let own = Vary::read(&self.table("vary"), &mut mistakes);
        let (Some(of_world), Some(own)) = (of_world, own) else { return Err(self.wrong(mistakes)) };
        let through = goal.map(Goal::regions).unwrap_or_default();
        of_world.with(own).draw(world, &robots, &through, seed).map_err(|mistakes| self.wrong(mistakes))
    }
}

/// The parameters of a gate, which stand in a robot's table beside those of its body.
fn gate_keys() -> impl Iterator<Item = &'static str> {
    RobotParams::fields().into_iter().map(|field| field.name)
}

/// How often a reading comes, if it does.
type Every = fn(&Periods) -> Option<Duration>;

/// The readings of a robot that come by a clock of its own.
const READINGS: [(&str, Every); 10] = [
    ("sonar", |periods| periods.sonar),
    ("scan", |periods| periods.scan),
    ("image", |periods| periods.image),
    ("ticks", |periods| periods.ticks),
    ("bumper", |periods| periods.bumper),
    ("gyro", |periods| periods.gyro),
    ("battery", |periods| periods.battery),
    ("head", |periods| periods.head),
    ("pose", |periods| periods.pose),
    ("landmarks", |periods| periods.landmarks),
];

impl Ready {
    /// The time between two readings at a port of a robot. What was recorded comes no more often than its gate looks.
    pub(crate) fn pace(&self, port: &str) -> Option<Duration> {
        let (robot, port) = port.rsplit_once('.')?;
        let periods = self.robots.iter().find(|known| known.name == robot)?.description.periods;
        let reading = READINGS.iter().find(|(name, _)| *name == port);
        let known = reading.and_then(|(_, of)| of(&periods)).filter(|period| *period > Duration::ZERO);
        Some(known.unwrap_or(CYCLE))
    }

    /// What admission counts with, when the runtime needs so much around each step.
    pub(crate) fn admission(&self, processors: usize, overhead: Duration, force: bool) -> Admission {
        let mut pace = HashMap::new();
        for robot in &self.robots {
            for (port, _) in READINGS {
                let port = format!("{}.{port}", robot.name);
                pace.extend(self.pace(&port).map(|every| (port, every)));
            }
        }
        Admission { processors, overhead, pace, force }
    }

    /// Adds the agent through which the world is changed, unless the plan has one of this name.
    fn open_to_hands(&mut self, hands: &Hands) {
        if self.plan.agent(WORLD_AGENT).is_some() {
            return;
        }
        self.registry.extend([hands.agent_type(WORLD_KIND)]);
        self.plan.agents.push(AgentPlan {
            name: WORLD_AGENT.to_owned(),
            kind: WORLD_KIND.to_owned(),
            on: SERVICES.map(str::to_owned).to_vec(),
            executor: Some("gate".to_owned()),
            ..AgentPlan::default()
        });
    }

    /// Puts a gate behind the agent of its robot. Each gate is a type of agent of its own.
    fn enter(&mut self, row: &Row, gate: Gate, shape: Shape, report: Option<hardware::Report>) {
        self.robots.push(RobotReady {
            name: row.key.clone(),
            shape,
            description: gate.description().clone(),
            latch: gate.latch().clone(),
            counts: gate.counts(),
            report,
        });
        let kind = kind_of(&row.key);
        self.registry.extend([Berth::with(gate).agent_type(kind)]);
        if let Some(agent) = self.plan.agent_mut(&row.key) {
            agent.kind = kind.to_owned();
        }
    }
}

/// The type of agent that stands for a robot. Each robot has a gate of its own and so a type of its own; types have names that
/// live as long as the program, so each is made once.
fn kind_of(robot: &str) -> &'static str {
    static KINDS: Mutex<BTreeSet<&'static str>> = Mutex::new(BTreeSet::new());
    let kind = format!("{ROBOT_KIND}{robot}");
    let mut kinds = KINDS.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(known) = kinds.get(kind.as_str()) {
        return known;
    }
    let kind: &'static str = kind.leak();
    kinds.insert(kind);
    kind
}

/// The agent through which a simulated world is changed.
pub(crate) const WORLD_AGENT: &str = "world";
/// Its type. No file can name it: each run has its own world.
pub(crate) const WORLD_KIND: &str = "simulated world";
/// What the types of robots' agents begin with.
pub(crate) const ROBOT_KIND: &str = "robot ";
