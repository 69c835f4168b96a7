//! What a run does for those who control it from another process.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration as HostDuration;

use control::words::Usage;
use control::{Hooks, Server};
use hardware::Latch;
use hardware::latch::Cause;
use record::{dynamic, schema::Schema};
use runtime::{
    AgentPlan, Control, Overload, Plan, QueuePlan, Refusal, Registry, Request, RunFolder, Tap, WirePlan,
};
use serde_json::Value as Json;
use types::Time;
use types::definition::Definition;
use types::message::Message as _;
use types::messages::{Decision, Orders, Reasons};
use types::value::{Entry, Mistake, Table, Value};

use super::asked::{Asked, Deed};
use super::prepare::Ready;
use crate::cli::ClockChoice;
use crate::file::decide;
use crate::live::why::{self, Changes};
use crate::terminal;

/// The control interface of a run, while it lasts.
pub(crate) struct Serving {
    _server: Server,
    over: Arc<AtomicBool>,
    listener: Option<JoinHandle<()>>,
}

/// How many changes of the decision are kept.
const KEPT: usize = 256;
/// How often the decisions are fetched: before a tap is full, however fast the run.
const FETCH: HostDuration = HostDuration::from_millis(10);

/// Opens the control interface. A run without it is still a run, so what goes wrong is told and no more.
pub(crate) fn start(ready: &Ready, control: &Control, asked: &Asked, clock: ClockChoice) -> Option<Serving> {
    let warn = |text: String| {
        terminal::tell(&format!("warning: {text}; nobody can control this run from outside"));
        None
    };
    let folder = match RunFolder::open() {
        Ok(folder) => folder,
        Err(error) => return warn(error.to_string()),
    };
    let decisions = Arc::new(Mutex::new(Changes::new(KEPT)));
    let decider =
        ready.plan.agents.iter().find(|agent| agent.kind == DECIDER).map(|agent| agent.name.clone());
    let hooks = RunHooks {
        control: control.clone(),
        latches: ready.robots.iter().map(|robot| robot.latch.clone()).collect(),
        decisions: decisions.clone(),
        decides: decider.is_some(),
        plan: ready.plan.clone(),
        registry: ready.registry.clone(),
        asked: asked.clone(),
        clock,
    };
    let server = match Server::start(&folder, &ready.plan.name, control.clone(), Arc::new(hooks)) {
        Ok(server) => server,
        Err(error) => return warn(error.to_string()),
    };
    let over = Arc::new(AtomicBool::new(false));
    let listener = decider.and_then(|decider| listen(control.clone(), decider, decisions, over.clone()));
    Some(Serving { _server: server, over, listener })
}

impl Drop for Serving {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Release);
        if let Some(thread) = self.listener.take() {
            thread.thread().unpark();
            // One that panicked has said so.
            let _ = thread.join();
        }
    }
}

/// The type of agent that decides.
pub(super) const DECIDER: &str = "decision-maker";

type Decisions = Arc<Mutex<Changes>>;

/// Keeps the changes of the decision.
fn listen(
    control: Control,
    decider: String,
    decisions: Decisions,
    over: Arc<AtomicBool>,
) -> Option<JoinHandle<()>> {
    let work = move || {
        let Ok(tap) = control.tap(&format!("{decider}.decision")) else { return };
        let reasons = control.tap(&format!("{decider}.reasons")).ok();
        let orders = control.tap(&format!("{decider}.orders")).ok();
        while !over.load(Ordering::Acquire) {
            // Reasons are sent before their decision: those of what is taken here are there when they are taken behind it.
            let decided = tap.take().0;
            let told = |tap: &Option<Tap>| tap.as_ref().map(|tap| tap.take().0).unwrap_or_default();
            let heard =
                [(Reasons::NAME, told(&reasons)), (Decision::NAME, decided), (Orders::NAME, told(&orders))];
            let mut changes = decisions.lock().unwrap_or_else(PoisonError::into_inner);
            for (definition, messages) in heard {
                messages.iter().for_each(|heard| changes.hear(definition, &heard.header, &heard.cdr));
            }
            drop(changes);
            std::thread::park_timeout(FETCH);
        }
    };
    std::thread::Builder::new().name("sinew-why".into()).spawn(work).ok()
}

/// A decision from its bytes.
pub(super) fn decoded(bytes: &[u8]) -> Option<Decision> {
    why::decoded(bytes)
}

struct RunHooks {
    control: Control,
    latches: Vec<Latch>,
    decisions: Decisions,
    decides: bool,
    /// The plan that was run, for what the runtime does not know.
    plan: Plan,
    registry: Registry,
    asked: Asked,
    clock: ClockChoice,
}

/// What a run answers besides what every system does.
const MORE: [Usage; 1] = [Usage { verb: "file", form: "file", does: "the running system as a system file" }];

impl RunHooks {
    fn now(&self) -> Time {
        self.control.view().map_or(Time::ZERO, |view| view.now)
    }

    /// The plan as it is now. Wires that follow from the robot of an agent are not written: they come back by themselves.
    fn running(&self) -> Result<Plan, Refusal> {
        let (agents, queues, wires) = self.control.plan()?;
        let queues = queues.into_iter().map(usual_queue).collect();
        let own = |agent: &AgentPlan| {
            let (robot, kind) = (agent.robot.as_ref()?, self.registry.get(&agent.kind)?);
            Some(runtime::robot_wires(agent, kind, robot))
        };
        let implied: Vec<_> = agents.iter().filter_map(own).flatten().collect();
        let is_implied =
            |wire: &WirePlan| implied.iter().any(|own| own.from == wire.from && own.to == wire.to);
        let wires = wires.into_iter().filter(|wire| !is_implied(wire)).map(usual).collect();
        Ok(Plan { agents, queues, wires, ..self.plan.clone() })
    }

    /// A decision table names agents, and the decision maker does not know who there is.
    fn judge_table(&self, maker: &str, table: &Table) -> Result<(), Refusal> {
        let (agents, ..) = self.control.plan()?;
        if !agents.iter().any(|agent| agent.name == maker && agent.kind == decide::KIND) {
            return Ok(());
        }
        let mistakes = decide::strangers(&agents, &self.registry, table);
        if mistakes.is_empty() {
            return Ok(());
        }
        let told = |mistake: &Mistake| match &mistake.help {
            Some(help) => format!("{}; {help}", mistake.what),
            None => mistake.what.clone(),
        };
        let all: Vec<String> = mistakes.iter().map(told).collect();
        Err(Refusal::new(all.join("; ")).help("the table that was in force stays"))
    }

    fn robots(&self) -> Result<(), Refusal> {
        if self.latches.is_empty() { Err(Refusal::new("this system has no robot")) } else { Ok(()) }
    }
}

impl Hooks for RunHooks {
    fn asks(&self, request: &Request) -> Result<(), Refusal> {
        if let Request::Set { agent, key, value: Value::Table(table) } = request
            && key == decide::PARAM
        {
            self.judge_table(agent, table)?;
        }
        self.asked.asks(request);
        Ok(())
    }

    fn stop(&self, why: &str) -> Result<(), Refusal> {
        self.robots()?;
        if self.clock == ClockChoice::Sim {
            return self.asked.act(Deed::Stop(why.to_owned()));
        }
        // First stop, then look at the clock: asking for the time can wait for a step.
        self.latches.iter().for_each(|latch| latch.set(Cause::Person, Time::ZERO));
        Ok(())
    }

    fn reset(&self) -> Result<(), Refusal> {
        self.robots()?;
        if self.clock == ClockChoice::Sim {
            return self.asked.act(Deed::Reset);
        }
        let now = self.now();
        self.latches.iter().for_each(|latch| {
            latch.reset(now);
        });
        Ok(())
    }

    fn why(&self, n: usize) -> Result<Json, Refusal> {
        if !self.decides {
            return Err(Refusal::new("nobody in this system decides")
                .help("a decision maker has the type \"decision-maker\""));
        }
        let decisions = self.decisions.lock().unwrap_or_else(PoisonError::into_inner);
        Ok(decisions.last(n).into())
    }

    fn decode(&self, definition: &Definition, cdr: &[u8]) -> Result<Json, String> {
        let schema = schema(definition)?;
        let value = dynamic::decode_short(&schema, cdr, SHORT).map_err(|error| error.to_string())?;
        Ok(control::json::to_json(&value))
    }

    fn more(&self) -> &[Usage] {
        &MORE
    }

    fn command(&self, _: &[String]) -> Result<Json, Refusal> {
        Ok(crate::file::write_plan(&super::plan_of_file(self.running()?)).into())
    }

    fn encode(&self, definition: &Definition, message: &Json) -> Result<Vec<u8>, String> {
        let entry = Entry { value: control::json::from_json(message), at: Default::default() };
        dynamic::encode(&Schema::from(definition), &entry)
            .map_err(|mistakes| mistakes.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))
    }
}

/// A wire without what it would have anyway.
fn usual(mut wire: WirePlan) -> WirePlan {
    let has = |depth, overload| wire.depth == Some(depth) && wire.overload == Some(overload);
    if has(runtime::USUAL_DEPTH, Overload::NewestWins) || has(runtime::USUAL_DEPTH_ON, Overload::Refuse) {
        (wire.depth, wire.overload) = (None, None);
    }
    wire
}

/// The same for a queue.
fn usual_queue(mut queue: QueuePlan) -> QueuePlan {
    queue.depth = queue.depth.filter(|depth| *depth != runtime::USUAL_DEPTH_ON);
    queue.overload = queue.overload.filter(|policy| *policy != Overload::Refuse);
    queue
}

/// Of a row with more values than this the rest is left out: nobody reads the pixels of a picture.
const SHORT: usize = 400;

fn schema(definition: &Definition) -> Result<Schema, String> {
    Schema::parse(definition.name, &definition.text()).map_err(|error| error.to_string())
}
