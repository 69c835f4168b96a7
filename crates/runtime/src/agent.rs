//! What makes a type an agent.

use std::any::Any;
use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;

use types::params::{Fields, Params, Refused};
use types::value::{Mistake, Table, Value};
use types::{AgentId, Duration, Message, Time};

use crate::fetch::Depth;
use crate::means::{Method, Refining};
use crate::port::{PortOptions, PortShape, PortVisit};

pub use macros::Agent;

/// State, ports and one step.
///
/// `#[derive(Agent)]` writes the table of ports ([`Declare`]); the step is written by hand:
///
/// ```
/// use runtime::{Agent, Fault, Input, Output, Step};
/// use types::messages::{Ranges, Twist};
///
/// /// Drives forward until something is near.
/// #[derive(Agent)]
/// pub struct Cautious {
///     /// What is around.
///     ranges: Input<Ranges>,
///     /// Where to drive.
///     drive: Output<Twist>,
/// }
///
/// impl Agent for Cautious {
///     fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
///         let Some(ranges) = self.ranges.latest() else { return Ok(()) };
///         let nearest = ranges.values.iter().copied().fold(f32::INFINITY, f32::min);
///         self.drive.send(Twist::new(if nearest > 0.5 { 0.3 } else { 0.0 }, 0.0));
///         Ok(())
///     }
/// }
/// ```
pub trait Agent: Send + 'static {
    /// Called once before the first step, when the ports are wired.
    fn start(&mut self, step: &mut Step) -> Result<(), Fault> {
        let _ = step;
        Ok(())
    }

    /// Reads ports, calls an algorithm, writes ports. It may not block, and in a real-time executor it may not allocate.
    fn step(&mut self, step: &mut Step) -> Result<(), Fault>;

    /// Takes over what the agent in whose place it comes has learnt: called once, before `start`, when it replaces one that is alive. Who
    /// that was, it sees by `downcast_mut`; what is moved out of it is kept, the rest is stopped and freed. Like a start or a stop it may
    /// take memory, which is not counted; but like a step it keeps the other agents of its executor waiting, and is given up when it lasts
    /// too long: exchange buffers, do not copy them.
    ///
    /// ```
    /// # use runtime::{Agent, Fault, Output, Step};
    /// # use types::messages::Twist;
    /// # use std::any::Any;
    /// # #[derive(Agent)]
    /// # /// A map.
    /// # struct Mapper {
    /// #     /// Nothing.
    /// #     out: Output<Twist>,
    /// #     map: Vec<u8>,
    /// # }
    /// # impl Agent for Mapper {
    /// # fn step(&mut self, _: &mut Step) -> Result<(), Fault> { Ok(()) }
    /// fn take_over(&mut self, before: &mut dyn Any) {
    ///     if let Some(before) = before.downcast_mut::<Mapper>() {
    ///         core::mem::swap(&mut self.map, &mut before.map);
    ///     }
    /// }
    /// # }
    /// ```
    fn take_over(&mut self, before: &mut dyn Any) {
        let _ = before;
    }

    /// Called once after the last step of an agent that is removed, replaced or restarted on request, or whose system ends.
    fn stop(&mut self, step: &mut Step) {
        let _ = step;
    }
}

/// What a step gets from the runtime.
#[derive(Debug)]
pub struct Step {
    /// The time of the step: that of its release, or of the message that made it run.
    pub now: Time,
    /// When the step shall be done.
    pub deadline: Time,
    /// The agent itself.
    pub agent: AgentId,
    /// The time between two steps; zero for an agent that only messages make run.
    pub period: Duration,
    /// Which of its methods it shall use, as a place among them; 0 for the best, and where it has one alone.
    pub method: usize,
    pub(crate) refining: Refining,
}

impl Step {
    /// Whether there is time for one more refinement: an anytime agent asks before each, after it has done what must be done.
    ///
    /// On the wall clock one is begun only where the longest so far would end within the step's budget and before its deadline. In simulated
    /// time each takes the cost that the plan declares for it. An agent whose plan gives no budget may not refine.
    ///
    /// ```
    /// # use runtime::{Agent, Fault, Output, Step};
    /// # use types::messages::Twist;
    /// /// Comes nearer to the root of two, as long as it may.
    /// #[derive(Agent)]
    /// #[agent(anytime)]
    /// struct Root {
    ///     /// The root, as a speed.
    ///     out: Output<Twist>,
    /// }
    ///
    /// impl Agent for Root {
    ///     fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
    ///         let mut root = 1.0;
    ///         while step.may_refine() {
    ///             root = (root + 2.0 / root) / 2.0;
    ///         }
    ///         step.set_quality(1.0 - f64::abs(root * root - 2.0));
    ///         self.out.send(Twist::new(root, 0.0));
    ///         Ok(())
    ///     }
    /// }
    /// ```
    pub fn may_refine(&mut self) -> bool {
        self.refining.may_go_on()
    }

    /// How many refinements this step was given.
    pub fn refined(&self) -> u32 {
        self.refining.count
    }

    /// Says how good the result is, from 0 to 1 for the best that the agent can do. What it sends after this in the step carries it
    /// ([`Header::quality`](types::Header::quality)); else it carries that of the agent's method.
    pub fn set_quality(&self, quality: f64) {
        if let Some(context) = crate::context::current() {
            context.set_quality(types::header::Quality::of(quality));
        }
    }

    /// Asks for one more step at `time`, besides those that are due anyway. It comes later where the plan declares a least time between such steps
    /// ([`AgentPlan::wake_gap`](crate::AgentPlan::wake_gap)) and the last one is not so long ago.
    pub fn wake_at(&mut self, time: Time) {
        if let Some(context) = crate::context::current() {
            context.wake_at(time);
        }
    }

    /// The number of the agent with this name, if there is one.
    pub fn agent_named(&self, name: &str) -> Option<AgentId> {
        crate::context::current()?.directory().find(name)
    }

    /// The name of the agent with this number.
    pub fn name_of(&self, agent: AgentId) -> Option<types::Name> {
        crate::context::current()?.directory().name(agent)
    }

    /// How long the step may take.
    pub fn budget(&self) -> Duration {
        self.deadline - self.now
    }
}

/// Why a step could not do its work. The supervisor restarts the agent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// What is wrong.
    pub what: Cow<'static, str>,
}

impl Fault {
    /// A fault that a static text tells: it needs no memory and so is fit for a real-time step.
    pub const fn new(what: &'static str) -> Fault {
        Fault { what: Cow::Borrowed(what) }
    }

    /// A fault that is told with the help of `error`, outside of real time.
    pub fn of(error: impl fmt::Display) -> Fault {
        Fault { what: Cow::Owned(error.to_string()) }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.what)
    }
}

impl std::error::Error for Fault {}

/// The table of an agent's ports and parameters, as `#[derive(Agent)]` writes it.
pub trait Declare: Agent + Sized {
    /// The name of the type in system files.
    const KIND: &'static str;
    /// What the agent does, in a sentence.
    const DOC: &'static str;
    /// The ways in which it can do its step, the best first; none where there is one alone.
    const METHODS: &'static [Method] = &[];
    /// Whether its step goes on refining its result while it may ([`Step::may_refine`]).
    const IS_ANYTIME: bool = false;
    /// Its parameters.
    type Params: Params;
    /// Its ports in a plan.
    type Ports;

    /// Makes one.
    fn build(params: Self::Params) -> Self;
    /// Exchanges its parameters, between two steps.
    fn swap_params(&mut self, params: &mut Self::Params);
    /// Shows its ports, always in the same order.
    fn visit_ports(&mut self, visit: &mut dyn FnMut(PortVisit<'_>));
    /// The ports of the agent with this name in a plan.
    fn ports_of(agent: &str) -> Self::Ports;
}

/// The parameters of an agent that has none.
#[derive(Clone, Debug, Default)]
pub struct NoParams;

impl Params for NoParams {
    fn fields() -> Fields {
        Fields::new()
    }
    fn set(&mut self, _: &str, _: &Value) -> Option<Result<(), Refused>> {
        None
    }
    fn get(&self, _: &str) -> Option<Value> {
        None
    }
}

/// An agent with its type erased: what an executor runs.
pub(crate) trait Body: Send {
    fn start(&mut self, step: &mut Step) -> Result<(), Fault>;
    fn step(&mut self, step: &mut Step) -> Result<(), Fault>;
    fn stop(&mut self, step: &mut Step);
    fn take_over(&mut self, before: &mut dyn Body);
    fn as_any(&mut self) -> &mut dyn Any;
    fn visit_ports(&mut self, visit: &mut dyn FnMut(PortVisit<'_>));
    fn swap_params(&mut self, params: &mut (dyn Any + Send));
    /// Has fetched what its ports will touch.
    fn fetch(&mut self, depth: Depth);
}

impl<A: Declare> Body for A {
    fn start(&mut self, step: &mut Step) -> Result<(), Fault> {
        Agent::start(self, step)
    }
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        Agent::step(self, step)
    }
    fn stop(&mut self, step: &mut Step) {
        Agent::stop(self, step);
    }
    fn take_over(&mut self, before: &mut dyn Body) {
        Agent::take_over(self, before.as_any());
    }
    fn as_any(&mut self) -> &mut dyn Any {
        self
    }
    fn visit_ports(&mut self, visit: &mut dyn FnMut(PortVisit<'_>)) {
        Declare::visit_ports(self, visit);
    }
    fn swap_params(&mut self, params: &mut (dyn Any + Send)) {
        if let Some(params) = params.downcast_mut::<A::Params>() {
            Declare::swap_params(self, params);
        }
    }
    fn fetch(&mut self, depth: Depth) {
        Declare::visit_ports(self, &mut |visit| visit.port.fetch(depth));
    }
}

/// What is known of a port.
#[derive(Clone, Debug)]
pub struct PortInfo {
    /// Its name.
    pub name: &'static str,
    /// What it is for.
    pub doc: &'static str,
    /// What it takes and gives.
    pub shape: PortShape,
    /// How it is made.
    pub options: PortOptions,
}

type BuildResult = Result<Box<dyn Body>, Vec<Mistake>>;
type ReadResult = Result<(Box<dyn Any + Send>, Table), Vec<Mistake>>;

/// A type of agent with its Rust type erased: what a registry holds.
#[derive(Clone)]
pub struct AgentType {
    /// The name of the type in system files.
    pub kind: &'static str,
    /// What the agent does.
    pub doc: &'static str,
    /// Its ports.
    pub ports: Vec<PortInfo>,
    /// Its parameters.
    pub params: Fields,
    /// The ways in which it can do its step, the best first; none where there is one alone.
    pub methods: &'static [Method],
    /// Whether its step refines its result while it may.
    pub is_anytime: bool,
    build: std::sync::Arc<dyn Fn(&Table) -> BuildResult + Send + Sync>,
    read_params: fn(&Table) -> ReadResult,
}

impl fmt::Debug for AgentType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.kind)
    }
}

fn read_params<A: Declare>(table: &Table) -> ReadResult {
    let params = A::Params::read(table, A::KIND)?;
    let table = params.to_table();
    Ok((Box::new(params), table))
}

impl AgentType {
    /// The erased form of `A`.
    pub fn of<A: Declare>() -> AgentType {
        AgentType::made_by(A::build)
    }

    /// The erased form of `A`, made in a way of its own: for one that needs more than its parameters.
    pub fn made_by<A: Declare>(make: impl Fn(A::Params) -> A + Send + Sync + 'static) -> AgentType {
        let mut ports = Vec::new();
        make(A::Params::default()).visit_ports(&mut |visit| {
            let PortVisit { name, doc, options, port } = visit;
            ports.push(PortInfo { name, doc, shape: port.shape(), options });
        });
        AgentType {
            kind: A::KIND,
            doc: A::DOC,
            ports,
            params: A::Params::fields(),
            methods: A::METHODS,
            is_anytime: A::IS_ANYTIME,
            build: std::sync::Arc::new(move |table| Ok(Box::new(make(A::Params::read(table, A::KIND)?)))),
            read_params: read_params::<A>,
        }
    }

    /// The same type under another name: where several of a kind are made in different ways.
    pub fn named(mut self, kind: &'static str) -> AgentType {
        self.kind = kind;
        self
    }

    /// What is known of a port.
    pub fn port(&self, name: &str) -> Option<&PortInfo> {
        self.ports.iter().find(|port| port.name == name)
    }

    pub(crate) fn build(&self, params: &Table) -> BuildResult {
        (self.build)(params)
    }

    /// Reads parameters: the value that [`Declare::swap_params`] takes, and all of them as a table.
    pub(crate) fn read_params(&self, params: &Table) -> ReadResult {
        (self.read_params)(params)
    }

    /// All mistakes in a table of parameters.
    pub fn check_params(&self, params: &Table) -> Vec<Mistake> {
        self.read_params(params).err().unwrap_or_default()
    }
}

/// The types of agents that a program knows.
#[derive(Clone, Debug, Default)]
pub struct Registry {
    types: Vec<AgentType>,
}

impl Registry {
    /// A registry of these types. A later one takes the place of an earlier one of the same name.
    pub fn new(types: impl IntoIterator<Item = AgentType>) -> Registry {
        let mut registry = Registry::default();
        registry.extend(types);
        registry
    }

    /// The type with this name.
    pub fn get(&self, kind: &str) -> Option<&AgentType> {
        self.types.iter().find(|known| known.kind == kind)
    }

    /// All types.
    pub fn types(&self) -> &[AgentType] {
        &self.types
    }
}

impl Extend<AgentType> for Registry {
    fn extend<I: IntoIterator<Item = AgentType>>(&mut self, types: I) {
        for new in types {
            match self.types.iter_mut().find(|known| known.kind == new.kind) {
                Some(known) => *known = new,
                None => self.types.push(new),
            }
        }
    }
}

/// A registry of agent types: `registry![Sonar, MyAgent]`.
#[macro_export]
macro_rules! registry {
    ($($agent:ty),* $(,)?) => {
        $crate::Registry::new([$($crate::AgentType::of::<$agent>()),*])
    };
}

macro_rules! end {
    ($($(#[$doc:meta])* $name:ident<$($t:ident),*>),*) => { $(
        $(#[$doc])*
        #[derive(Clone, Debug)]
        pub struct $name<$($t: Message),*> {
            /// The agent and the port, as in `sonar.filtered`.
            pub name: String,
            types: PhantomData<fn() -> ($($t,)*)>,
        }

        impl<$($t: Message),*> $name<$($t),*> {
            /// The port `port` of the agent `agent`.
            pub fn new(agent: &str, port: &str) -> Self {
                Self { name: format!("{agent}.{port}"), types: PhantomData }
            }
        }
    )* };
}

end! {
    /// An input in a plan.
    InputEnd<T>,
    /// An output in a plan.
    OutputEnd<T>,
    /// A service in a plan.
    ServiceEnd<Q, A>,
    /// A client in a plan.
    ClientEnd<Q, A>
}
