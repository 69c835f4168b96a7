//! The one value that describes a system.

use types::header::LeastPriority;
use types::params::Params;
use types::value::{Mistake, Span, Table, Value};
use types::{AgentId, Category, Duration, Filter, Message};

use crate::agent::{ClientEnd, Declare, InputEnd as To, OutputEnd as From, ServiceEnd};
use crate::means::Method;
use crate::queue_plan::{MOST_SERVING, Queue, QueuePlan};
use crate::ring::Overload;

/// The one value that describes a system: agents, wires, executors, what happens when, and the sections of others.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plan {
    /// Its name.
    pub name: String,
    /// Executors besides the usual ones, or in their place.
    pub executors: Vec<ExecutorPlan>,
    /// Agents, in the order in which they are added.
    pub agents: Vec<AgentPlan>,
    /// Queues.
    pub queues: Vec<QueuePlan>,
    /// Wires, into queues and out of them too.
    pub wires: Vec<WirePlan>,
    /// What is asked of the running system at certain times.
    pub requests: Vec<TimedRequest>,
    /// Sections that the runtime does not know (`world`, `robot`, `goal` …), by name. Who owns one reads it.
    pub sections: Table,
}

/// By which rule the kernel lets the thread of an executor run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Policy {
    /// By its priority, first in, first out; where it has none it is an ordinary thread.
    #[default]
    Fifo,
    /// `SCHED_DEADLINE`: above all priorities, and among its like whoever has the earliest deadline. The kernel takes a thread in only if there is
    /// time left for it, and gives it no more than it asked for: in each period of its agent the declared cost and a fifth more, by the deadline.
    /// What makes the agent run besides its period, its messages and the steps that it asks for itself no sooner than it declares has to do with
    /// that: answers, say.
    ///
    /// The executor has one agent alone, which declares its cost, and where messages make it run a least time between. It has neither priority
    /// nor processors of its own (the kernel takes no such thread), and does not watch the clock in place of sleeping.
    Deadline,
}

impl Policy {
    /// All of them.
    pub const ALL: [Policy; 2] = [Policy::Fifo, Policy::Deadline];

    /// Its name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Policy::Fifo => "fifo",
            Policy::Deadline => "deadline",
        }
    }
}

/// Where executors under [`Policy::Deadline`] stand among the others: above the witness too.
pub(crate) const ABOVE_ALL: u8 = 100;

/// An executor in a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct ExecutorPlan {
    /// Its name.
    pub name: String,
    /// Real-time priority from 1 to 99; nothing for an ordinary thread.
    pub priority: Option<u8>,
    /// By which rule it runs.
    pub policy: Policy,
    /// The processors on which it may run; all when empty.
    pub cpus: Vec<usize>,
    /// How long before a release the thread stops sleeping and watches the clock instead: exact, at the cost of a processor.
    pub spin: Duration,
    /// Where it is written.
    pub at: Span,
}

/// What the supervisor does with an agent that died.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OnDeath {
    /// Start it again: after 0.1 s, then after twice the time, up to 5 s; at most five times in a minute.
    #[default]
    Restart,
    /// Leave it dead.
    Leave,
}

/// What a resource manager may take from an agent when there is not time enough for all, and how little it shall.
///
/// Its period gives way within [`AgentPlan::period_range`], its methods and its budget down to the cheapest. One that says nothing of all that is
/// not touched.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Giving {
    /// How important it is, from 0 to 1: who is more important gives way less, and later. 0.5 when nothing is said.
    pub importance: Option<f64>,
    /// How readily its period gives way, beside those of others; 1 when nothing is said, and 0 for not at all.
    pub elasticity: Option<f64>,
    /// Of an agent that messages make run: how far the least time between two of its steps may be lengthened.
    pub gap_max: Option<Duration>,
    /// Whether it may be suspended, when nothing else is left.
    pub may_suspend: bool,
    /// Whether it is not to be touched, whatever else is said.
    pub is_rigid: bool,
    /// Whether it is suspended: it makes no step.
    pub is_suspended: bool,
}

impl Giving {
    /// The importance of an agent that says none.
    pub const USUAL_IMPORTANCE: f64 = 0.5;

    /// How important it is, from 0 to 1.
    pub fn importance(&self) -> f64 {
        self.importance.unwrap_or(Giving::USUAL_IMPORTANCE)
    }

    /// How readily its period gives way, beside those of others.
    pub fn elasticity(&self) -> f64 {
        self.elasticity.unwrap_or(1.0)
    }
}

/// An agent in a plan.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AgentPlan {
    /// Its name.
    pub name: String,
    /// The registered type.
    pub kind: String,
    /// The robot to whose ports it is wired.
    pub robot: Option<String>,
    /// Time between two steps; nothing for an agent that only messages make run.
    pub period: Option<Duration>,
    /// The shortest and the longest period that its designer allows.
    pub period_range: Option<(Duration, Duration)>,
    /// Processor time of a step at worst, where its designer knows it: what analysis and admission count before steps were measured, and what a
    /// step takes on virtual processors.
    pub cost: Option<Duration>,
    /// The same for each of its methods, where it has several; one that is not here costs what `cost` says.
    pub methods: Vec<(String, Duration)>,
    /// The method with which it begins; its best when nothing is said.
    pub method: Option<String>,
    /// Processor time of one refinement at worst, of an anytime agent.
    pub refinement: Option<Duration>,
    /// How long a step of an anytime agent may take with its refinements: it is asked before each.
    pub budget: Option<Duration>,
    /// How far the resource manager may give way for it, and it for others.
    pub giving: Giving,
    /// How soon after its release a step must be done; the period when nothing is said.
    pub deadline: Option<Duration>,
    /// The inputs whose messages make it run.
    pub on: Vec<String>,
    /// The least time between two steps that messages make it run.
    pub min_gap: Duration,
    /// The least time between two steps that it asks for itself ([`Step::wake_at`](crate::Step::wake_at), and the time-outs of its calls): an earlier
    /// one is put off. Zero where nothing is said; then the analysis does not know of such steps.
    pub wake_gap: Duration,
    /// The executor; chosen by the deadline when nothing is said.
    pub executor: Option<String>,
    /// What happens when it dies.
    pub on_death: OnDeath,
    /// How long a step may last before the watchdog takes it for one that does not return.
    pub hang_after: Option<Duration>,
    /// Its parameters.
    pub params: Table,
    /// Where it is written.
    pub at: Span,
}

/// A wire in a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct WirePlan {
    /// The output, as in `sonar.filtered`; for calls the client. Or a queue.
    pub from: String,
    /// The input, as in `safety.ranges`; for calls the service. Or a queue.
    pub to: String,
    /// How many messages wait at most; the usual depth when nothing is said.
    pub depth: Option<usize>,
    /// What happens when there is no room; the usual policy when nothing is said.
    pub overload: Option<Overload>,
    /// Which messages pass.
    pub filter: WireFilter,
    /// Out of a queue: who is served first, from 0 to 99; the priority of the receiver's executor when nothing is said, which is 0
    /// for an ordinary one.
    pub serving: Option<u8>,
    /// Where it is written.
    pub at: Span,
}

/// Which messages pass a wire: a [`Filter`] as a plan says it, where agents have names and no numbers yet. Its default lets all
/// through.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct WireFilter {
    /// Only this category.
    pub category: Option<Category>,
    /// Only this priority or a higher one.
    pub least_priority: LeastPriority,
    /// Only this marker.
    pub marker: Option<u32>,
    /// Only messages for the agent of this name, or for everybody.
    pub recipient: Option<String>,
    /// Only every n-th message that the rest lets through; 0 and 1 let all through.
    pub every: u32,
}

impl WireFilter {
    /// The filter, when the recipient has the number `recipient`.
    pub(crate) fn with_recipient(&self, recipient: Option<AgentId>) -> Filter {
        let WireFilter { category, least_priority, marker, every, .. } = *self;
        Filter { category, least_priority, marker, recipient, every }
    }
}

/// A request and its time.
#[derive(Clone, Debug, PartialEq)]
pub struct TimedRequest {
    /// When, counted from the start.
    pub at: Duration,
    /// What is asked, as the command line would ask it: `["fault", "wall", "panic"]`.
    pub words: Vec<String>,
    /// Where it is written.
    pub place: Span,
}

/// Depth of a wire that does not make its receiver run: newest wins.
pub const USUAL_DEPTH: usize = 4;
/// Depth of a wire that makes its receiver run: refuse.
pub const USUAL_DEPTH_ON: usize = 16;

impl AgentPlan {
    /// What a step takes at worst by the method of this name, as far as the plan declares it.
    pub fn cost_by(&self, method: &str) -> Option<Duration> {
        let own = self.methods.iter().find(|(name, _)| name == method);
        own.map(|(_, cost)| *cost).or(self.cost)
    }

    /// What a step takes at worst without refinements, as far as the plan declares it: by the method that is set, or the best of `known`.
    pub fn cost_of_step(&self, known: &[Method]) -> Option<Duration> {
        let method = self.method.as_deref().or(known.first().map(|best| best.name));
        method.map_or(self.cost, |method| self.cost_by(method))
    }

    /// The same with refinements.
    pub fn cost_in_all(&self, known: &[Method]) -> Option<Duration> {
        self.cost_of_step(known).max(self.budget)
    }
}

impl WirePlan {
    /// A wire with the usual depth and policy.
    pub fn new(from: impl Into<String>, to: impl Into<String>) -> WirePlan {
        let (from, to) = (from.into(), to.into());
        let (filter, at) = (WireFilter::default(), Span::default());
        WirePlan { from, to, depth: None, overload: None, filter, serving: None, at }
    }
}

impl ExecutorPlan {
    /// An executor on all processors.
    pub fn new(name: &str, priority: Option<u8>) -> ExecutorPlan {
        let (name, at) = (name.to_owned(), Span::default());
        ExecutorPlan { name, priority, policy: Policy::Fifo, cpus: Vec::new(), spin: Duration::ZERO, at }
    }

    /// An executor whose thread runs by its agent's deadline.
    pub fn by_deadline(name: &str) -> ExecutorPlan {
        ExecutorPlan { policy: Policy::Deadline, ..ExecutorPlan::new(name, None) }
    }

    /// Whether it runs by its agent's deadline.
    pub fn is_by_deadline(&self) -> bool {
        self.policy == Policy::Deadline
    }

    /// Where it stands among the others, the greater above; nothing for an ordinary thread.
    pub fn level(&self) -> Option<u8> {
        if self.is_by_deadline() { Some(ABOVE_ALL) } else { self.priority }
    }

    /// Who is served first out of a queue, unless its wire says otherwise.
    pub(crate) fn usual_serving(&self) -> u8 {
        self.level().unwrap_or(0).min(MOST_SERVING)
    }

    /// The usual executors of a robot, the highest first.
    pub fn usual() -> Vec<ExecutorPlan> {
        [
            ("gate", Some(90)),
            ("receive", Some(80)),
            ("reflex", Some(70)),
            ("control", Some(60)),
            ("vision", Some(50)),
            ("ordinary", None),
        ]
        .map(|(name, priority)| ExecutorPlan::new(name, priority))
        .into()
    }
}

/// An output and an input of one type, or a client and a service: what can be wired.
pub trait Wirable<Other> {
    /// The names of both ends.
    fn ends(self, other: Other) -> (String, String);
}

impl<T: Message> Wirable<To<T>> for From<T> {
    fn ends(self, other: To<T>) -> (String, String) {
        (self.name, other.name)
    }
}

impl<Q: Message, A: Message> Wirable<ServiceEnd<Q, A>> for ClientEnd<Q, A> {
    fn ends(self, other: ServiceEnd<Q, A>) -> (String, String) {
        (self.name, other.name)
    }
}

impl Plan {
    /// An empty plan.
    pub fn new(name: &str) -> Plan {
        Plan { name: name.to_owned(), ..Plan::default() }
    }

    /// Adds an agent and gives its ports, to be wired.
    pub fn add<A: Declare>(&mut self, name: &str, params: A::Params) -> A::Ports {
        self.agents.push(AgentPlan {
            name: name.to_owned(),
            kind: A::KIND.to_owned(),
            params: params.to_table(),
            ..AgentPlan::default()
        });
        A::ports_of(name)
    }

    /// Wires an output to an input of the same type, or a client to a service. The compiler checks the types.
    pub fn wire<E, F>(&mut self, from: &E, to: &F)
    where
        E: Wirable<F> + Clone,
        F: Clone,
    {
        let (from, to) = from.clone().ends(to.clone());
        self.wires.push(WirePlan::new(from, to));
    }

    /// Adds a queue of messages of type `T`, to be wired like a port: outputs into it, and it into inputs.
    ///
    /// ```
    /// use runtime::{Agent, Fault, Input, Output, Plan, Step};
    /// use types::messages::Twist;
    ///
    /// # #[derive(Agent)]
    /// # struct Finder {
    /// #     /// What is to be done.
    /// #     work: Output<Twist>,
    /// # }
    /// # impl Agent for Finder {
    /// #     fn step(&mut self, _: &mut Step) -> Result<(), Fault> { Ok(()) }
    /// # }
    /// # #[derive(Agent)]
    /// # struct Worker {
    /// #     /// What is to be done.
    /// #     work: Input<Twist>,
    /// # }
    /// # impl Agent for Worker {
    /// #     fn step(&mut self, _: &mut Step) -> Result<(), Fault> { Ok(()) }
    /// # }
    /// let mut plan = Plan::new("yard");
    /// let finder = plan.add::<Finder>("finder", Default::default());
    /// let (one, two) = (plan.add::<Worker>("one", Default::default()), plan.add::<Worker>("two", Default::default()));
    /// let work = plan.queue::<Twist>("work");
    /// plan.wire(&finder.work, &work);
    /// plan.wire(&work, &one.work);
    /// plan.wire(&work, &two.work);
    /// ```
    pub fn queue<T: Message>(&mut self, name: &str) -> Queue<T> {
        self.queues.push(QueuePlan::new(name));
        Queue::new(name)
    }

    /// The queue with this name, to change it.
    pub fn queue_mut(&mut self, name: &str) -> Option<&mut QueuePlan> {
        self.queues.iter_mut().find(|queue| queue.name == name)
    }

    /// Whether this is the name of a queue.
    pub fn is_queue(&self, name: &str) -> bool {
        self.queues.iter().any(|queue| queue.name == name)
    }

    /// The agent with this name, to change it.
    pub fn agent_mut(&mut self, name: &str) -> Option<&mut AgentPlan> {
        self.agents.iter_mut().find(|agent| agent.name == name)
    }

    /// The agent with this name.
    pub fn agent(&self, name: &str) -> Option<&AgentPlan> {
        self.agents.iter().find(|agent| agent.name == name)
    }

    /// Gives an agent a period.
    pub fn every(&mut self, agent: &str, period: Duration) {
        if let Some(agent) = self.agent_mut(agent) {
            agent.period = Some(period);
        }
    }

    /// Makes an agent run when a message comes to one of its inputs.
    pub fn on(&mut self, agent: &str, input: &str) {
        if let Some(agent) = self.agent_mut(agent) {
            agent.on.push(input.to_owned());
        }
    }

    /// A section of somebody else's.
    pub fn section(&self, name: &str) -> Option<&Table> {
        self.sections.get(name).and_then(|entry| entry.value.as_table())
    }

    /// Keeps only these agents and the wires between them, and the robots that they are wired to.
    pub fn only(&mut self, names: &[String]) -> Result<(), Mistake> {
        for name in names {
            if self.agent(name).is_none() {
                let known = self.agents.iter().map(|agent| agent.name.as_str());
                return Err(Mistake::unknown(Span::default(), "agent", name, known));
            }
        }
        let robots =
            self.sections.get("robot").and_then(|entry| entry.value.as_table()).cloned().unwrap_or_default();
        let kept = |name: &str| names.iter().any(|kept| kept == name) || robots.get(name).is_some();
        self.agents.retain(|agent| kept(&agent.name));
        let queues: Vec<String> = self.queues.iter().map(|queue| queue.name.clone()).collect();
        let end = |name: &str| kept(owner(name)) || queues.iter().any(|queue| queue == name);
        self.wires.retain(|wire| end(&wire.from) && end(&wire.to));
        let wires = &self.wires;
        self.queues.retain(|queue| wires.iter().any(|wire| wire.from == queue.name || wire.to == queue.name));
        Ok(())
    }
}

/// The agent of a port's full name.
pub fn owner(port: &str) -> &str {
    port.rsplit_once('.').map_or(port, |(agent, _)| agent)
}

/// The value of a plan's entry as people type it on a command line: a number, a truth value, a list, else a text.
pub fn value_of(text: &str) -> Value {
    if let Ok(n) = text.parse::<i64>() {
        return Value::Int(n);
    }
    if let Ok(x) = text.parse::<f64>() {
        return Value::Float(x);
    }
    match text {
        "true" => Value::Bool(true),
        "false" => Value::Bool(false),
        _ => Value::Text(text.trim_matches('"').to_owned()),
    }
}
