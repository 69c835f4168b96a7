//! What can be asked of a running system, and what it answers.

use core::sync::atomic::Ordering::Relaxed;

use types::params::Fields;
use types::value::{Table, Value};
use types::{AgentId, Duration, Time};

use crate::executor::StepFault;
use crate::plan::{AgentPlan, WireFilter, WirePlan};
use crate::port::{Direction, OutputFault, Processing, WireCounts};
use crate::queue_plan::QueuePlan;
use crate::ring::Overload;
use crate::stats::Figure;

/// A request to a running system. All of it is checked first; it is refused with a reason, or done whole.
#[allow(clippy::large_enum_variant)] // requests are few, and plans are kept by value everywhere
#[derive(Clone, Debug)]
pub enum Request {
    /// Adds an agent, wired to its robot where the plan says so.
    Add(AgentPlan),
    /// Adds a queue, to be wired.
    Queue(QueuePlan),
    /// Removes an agent and its wires; or a queue that holds nothing and that nobody is wired to.
    Remove(String),
    /// Starts an agent anew.
    Restart(String),
    /// Puts another agent of the same ports in the place of one that runs.
    Replace {
        /// The one that runs.
        agent: String,
        /// The type of its successor.
        kind: String,
        /// The successor's parameters.
        params: Table,
    },
    /// Makes a wire.
    Wire(WirePlan),
    /// Cuts a wire, when what is on it has arrived.
    Unwire {
        /// The output.
        from: String,
        /// The input.
        to: String,
    },
    /// Sets a parameter, or an entry of [`TIMING_KEYS`](crate::TIMING_KEYS).
    Set {
        /// Whose.
        agent: String,
        /// Which.
        key: String,
        /// To what.
        value: Value,
    },
    /// Makes an agent, or an output of one, misbehave or behave again.
    Fault {
        /// The agent, or its output as in `h1.sonar`.
        target: String,
        /// How.
        fault: FaultKind,
    },
    /// Sends a message to an input, or out of an output, given as CDR.
    Send {
        /// The port.
        port: String,
        /// The message.
        cdr: Vec<u8>,
    },
    /// Calls a service with a question in CDR. It is done when the question is on its way, and stands alone; whoever wants the answer uses
    /// [`Control::call`](crate::Control::call).
    Call {
        /// The service.
        service: String,
        /// The question.
        cdr: Vec<u8>,
        /// How long the answer is waited for.
        within: Duration,
    },
    /// Ends the run.
    Quit,
    /// Several, done together or not at all.
    All(Vec<Request>),
    /// One that is done also where deadlines are missed by it.
    Forced(Box<Request>),
}

impl Request {
    /// The faults in it, in words.
    pub(crate) fn faults(&self) -> Vec<String> {
        match self {
            Request::Fault { target, fault } => vec![format!("fault {target} {}", fault.name())],
            Request::All(requests) => requests.iter().flat_map(Request::faults).collect(),
            Request::Forced(request) => request.faults(),
            _ => Vec::new(),
        }
    }
}

/// How somebody misbehaves on request. The names are those of PX4's failure injection.
///
/// Of an agent, what is sent is meant of all its outputs; its steps go on, and so does what it believes. So an actuator agent that is stuck
/// gives its robot one command for ever, fresh each time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultKind {
    /// Behaves again.
    Ok,
    /// Does or sends nothing.
    Off,
    /// Sends the first value of the fault again and again, each time with the stamp of now.
    Stuck,
    /// Sends numbers out of nowhere.
    Garbage,
    /// Sends numbers that are wrong but look right.
    Wrong,
    /// Does a quarter of its steps.
    Slow,
    /// Sends each message some messages later, with its own stamp.
    Delayed,
    /// Sends every other message, by chance.
    Intermittent,
    /// Panics in its next step.
    Panic,
    /// Does not return from its next step.
    Hang,
    /// Takes three times as long for its steps.
    Heavy,
}

impl FaultKind {
    /// All kinds.
    pub const ALL: [FaultKind; 11] = [
        FaultKind::Ok,
        FaultKind::Off,
        FaultKind::Stuck,
        FaultKind::Garbage,
        FaultKind::Wrong,
        FaultKind::Slow,
        FaultKind::Delayed,
        FaultKind::Intermittent,
        FaultKind::Panic,
        FaultKind::Hang,
        FaultKind::Heavy,
    ];

    /// Its name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            FaultKind::Ok => "ok",
            FaultKind::Off => "off",
            FaultKind::Stuck => "stuck",
            FaultKind::Garbage => "garbage",
            FaultKind::Wrong => "wrong",
            FaultKind::Slow => "slow",
            FaultKind::Delayed => "delayed",
            FaultKind::Intermittent => "intermittent",
            FaultKind::Panic => "panic",
            FaultKind::Hang => "hang",
            FaultKind::Heavy => "heavy",
        }
    }

    /// The kind with this name.
    pub fn named(name: &str) -> Option<FaultKind> {
        FaultKind::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// What it means for the steps of an agent; nothing where it is a matter of what is sent.
    pub(crate) const fn of_step(self) -> Option<StepFault> {
        match self {
            FaultKind::Ok => Some(StepFault::None),
            FaultKind::Off => Some(StepFault::Off),
            FaultKind::Slow => Some(StepFault::Slow),
            FaultKind::Panic => Some(StepFault::Panic),
            FaultKind::Hang => Some(StepFault::Hang),
            FaultKind::Heavy => Some(StepFault::Heavy),
            _ => None,
        }
    }

    /// What it means for an output; nothing where it is a matter of steps.
    pub(crate) const fn of_output(self) -> Option<OutputFault> {
        match self {
            FaultKind::Ok => Some(OutputFault::None),
            FaultKind::Off => Some(OutputFault::Off),
            FaultKind::Stuck => Some(OutputFault::Stuck),
            FaultKind::Garbage => Some(OutputFault::Garbage),
            FaultKind::Wrong => Some(OutputFault::Wrong),
            FaultKind::Delayed => Some(OutputFault::Delayed),
            FaultKind::Intermittent => Some(OutputFault::Intermittent),
            _ => None,
        }
    }
}

/// Why a request was refused. Nothing of it was done.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// What is wrong.
    pub what: String,
    /// How to mend it.
    pub help: Option<String>,
}

impl Refusal {
    /// A refusal without advice.
    pub fn new(what: impl Into<String>) -> Refusal {
        Refusal { what: what.into(), help: None }
    }

    /// The same with advice.
    pub fn help(mut self, help: impl Into<String>) -> Refusal {
        self.help = Some(help.into());
        self
    }

    /// `word` is none of `known`.
    pub fn unknown<'a>(kind: &str, word: &str, known: impl IntoIterator<Item = &'a str>) -> Refusal {
        types::value::Mistake::unknown(types::value::Span::default(), kind, word, known).into()
    }
}

impl From<types::value::Mistake> for Refusal {
    fn from(mistake: types::value::Mistake) -> Refusal {
        Refusal { what: mistake.what, help: mistake.help }
    }
}

impl std::fmt::Display for Refusal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.what)?;
        self.help.as_ref().map_or(Ok(()), |help| write!(f, "; {help}"))
    }
}

impl std::error::Error for Refusal {}

/// How an agent is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AgentState {
    /// It runs.
    Running,
    /// It died and will be started again.
    Restarting,
    /// It died and stays dead.
    Dead,
}

impl AgentState {
    /// Its name on the screen.
    pub const fn name(self) -> &'static str {
        match self {
            AgentState::Running => "running",
            AgentState::Restarting => "restarting",
            AgentState::Dead => "dead",
        }
    }
}

/// What a running system says of an agent.
#[derive(Clone, Debug)]
pub struct AgentView {
    /// Its number.
    pub id: AgentId,
    /// Its name.
    pub name: String,
    /// Its type.
    pub kind: &'static str,
    /// What the type does.
    pub doc: &'static str,
    /// Its executor.
    pub executor: String,
    /// The scheduling that was asked for, as in `fifo 70`, or `deadline 2420us/20ms/20ms`: processor time, by when, and how often.
    pub asked: String,
    /// The scheduling that was granted.
    pub granted: String,
    /// How it is.
    pub state: AgentState,
    /// Why it died last.
    pub last_death: Option<String>,
    /// The time between two steps, if it has a period.
    pub period: Option<Duration>,
    /// The method that it uses, where it has several.
    pub method: Option<&'static str>,
    /// How long its steps may take with refinements, if it makes any.
    pub budget: Option<Duration>,
    /// Whether it is suspended.
    pub is_suspended: bool,
    /// How soon a step must be done.
    pub deadline: Duration,
    /// Its parameters.
    pub params: Table,
    /// What is known of its parameters.
    pub fields: Fields,
    /// Its ports.
    pub ports: Vec<PortView>,
    /// What was counted.
    pub counts: Counts,
    /// How long steps used their processor (ns): on the wall clock without what higher executors took from them.
    pub exec: Figure,
    /// How late steps began (ns).
    pub jitter: Figure,
    /// From the release to the end (ns).
    pub response: Figure,
    /// The histogram of how long steps ran: upper ends of its steps (ns) and counts.
    pub exec_steps: Vec<(f64, u32)>,
    /// The histogram of how late steps began.
    pub jitter_steps: Vec<(f64, u32)>,
}

/// What is counted of an agent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Counts {
    /// Steps.
    pub releases: u64,
    /// Steps that ended too late.
    pub missed: u64,
    /// Of those, the ones during a stall that the witness saw.
    pub stalled: u64,
    /// Releases that were passed over.
    pub skipped: u64,
    /// Steps that reported a fault.
    pub faults: u64,
    /// Steps that panicked.
    pub panics: u64,
    /// Steps that did not return.
    pub hangs: u64,
    /// Times that it was started again.
    pub restarts: u64,
    /// Refinements that its steps made.
    pub refinements: u64,
    /// Steps that took longer than the budget that they had for refinements.
    pub overruns: u64,
    /// What its results lacked of the best that it can do, summed over its steps: of one without any result, 1.
    pub quality_lost: f64,
    /// Steps that are not among those of the figure of execution times, because the witness saw a stall in them.
    pub left_out: u64,
    /// Steps whose execution time was held against the thread's own clock.
    pub checked: u64,
    /// Of those, the ones for which it said something else.
    pub disagreed: u64,
    /// How often its steps took or freed memory; zero where nobody watches that. What it takes once in its life, when it starts, takes
    /// over from another or stops, is not counted, here or elsewhere.
    pub allocations: u64,
}

/// What a running system says of a port.
#[derive(Clone, Debug)]
pub struct PortView {
    /// Its name.
    pub name: &'static str,
    /// What it is for.
    pub doc: &'static str,
    /// Which way messages go.
    pub direction: Direction,
    /// What goes through it.
    pub message: &'static str,
    /// How far what it gives is from the hardware, where it gives a reading.
    pub processing: Option<Processing>,
    /// Messages sent out of it.
    pub sent: u64,
    /// Where it leads to the router: requests that were asked, and those that were not because too many were under way.
    pub asked: Option<(u64, u64)>,
}

/// What a running system says of a wire.
#[derive(Clone, Debug)]
pub struct WireView {
    /// The output.
    pub from: String,
    /// The input.
    pub to: String,
    /// What goes through it.
    pub message: &'static str,
    /// How many messages wait at most.
    pub depth: usize,
    /// What happens when there is no room.
    pub overload: Overload,
    /// Which messages pass.
    pub filter: WireFilter,
    /// Messages put into it.
    pub sent: u64,
    /// Messages that newer ones displaced before a receiver that only ever asks for the newest, or looks into the sender's memory.
    pub replaced: u64,
    /// Messages that were displaced or dropped, and that the receiver would have taken.
    pub dropped: u64,
    /// Messages that were given back.
    pub refused: u64,
    /// Messages taken out of it.
    pub taken: u64,
    /// Links that were read too late.
    pub expired: u64,
}

/// What went over wires.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WireTotals {
    /// Messages put into them.
    pub sent: u64,
    /// Messages that newer ones displaced before a receiver that only ever asks for the newest, or looks into the sender's memory: it
    /// would have passed over them.
    pub replaced: u64,
    /// Messages that were displaced or dropped otherwise, or lay in a wire that was cut and were never taken.
    pub dropped: u64,
    /// Messages that were given back.
    pub refused: u64,
    /// Messages taken out of them.
    pub taken: u64,
    /// Links that were read too late.
    pub expired: u64,
}

impl WireTotals {
    pub(crate) fn of(counts: &WireCounts) -> WireTotals {
        let [displaced, dropped, one_by_one, newest, looked] =
            [&counts.displaced, &counts.dropped, &counts.taken, &counts.newest, &counts.looked]
                .map(|count| count.load(Relaxed));
        // Whoever takes one message after the other misses each that is displaced, and of who takes none nobody knows.
        let (replaced, lost) =
            if one_by_one == 0 && newest + looked > 0 { (displaced, 0) } else { (0, displaced) };
        WireTotals {
            sent: counts.sent.load(Relaxed),
            replaced,
            dropped: dropped + lost,
            refused: counts.refused.load(Relaxed),
            taken: one_by_one + newest,
            expired: counts.expired.load(Relaxed),
        }
    }

    /// What went over a ring that is no more. What was in it still is lost.
    pub(crate) fn at_the_end(counts: &WireCounts) -> WireTotals {
        let mut totals = WireTotals::of(counts);
        let gone = totals.taken + totals.expired + counts.displaced.load(Relaxed);
        totals.dropped += totals.sent.saturating_sub(gone);
        totals
    }
}

impl core::ops::AddAssign for WireTotals {
    fn add_assign(&mut self, more: WireTotals) {
        self.sent += more.sent;
        self.replaced += more.replaced;
        self.dropped += more.dropped;
        self.refused += more.refused;
        self.taken += more.taken;
        self.expired += more.expired;
    }
}

/// What a running system says of a queue.
#[derive(Clone, Debug)]
pub struct QueueView {
    /// Its name.
    pub name: String,
    /// What it holds; nothing before anybody is wired to it.
    pub message: &'static str,
    /// How many messages of one sender and one priority wait at most.
    pub depth: usize,
    /// What happens when there is no room.
    pub overload: Overload,
    /// Messages that wait.
    pub waiting: usize,
    /// Messages put into it, by senders that are gone too.
    pub sent: u64,
    /// Messages that were displaced or dropped.
    pub dropped: u64,
    /// Messages that were given back.
    pub refused: u64,
    /// Messages taken out of it, by receivers that are gone too.
    pub taken: u64,
    /// Who takes them.
    pub receivers: Vec<ReceiverView>,
}

/// What a running system says of an input that takes messages out of a queue.
#[derive(Clone, Debug)]
pub struct ReceiverView {
    /// The input.
    pub to: String,
    /// Who is served first; the highest.
    pub serving: u8,
    /// Messages that it took.
    pub taken: u64,
}

/// What a running system says of an executor.
#[derive(Clone, Debug)]
pub struct ExecutorView {
    /// Its name.
    pub name: String,
    /// Whether it is to run in real time.
    pub real_time: bool,
    /// How often it took or freed memory besides the steps of its agents; zero where nobody watches that.
    pub allocations: u64,
}

/// What a running system says of itself.
#[derive(Clone, Debug)]
pub struct SystemView {
    /// Its name.
    pub name: String,
    /// The time on its clock.
    pub now: Time,
    /// Its executors.
    pub executors: Vec<ExecutorView>,
    /// Whether it is known who takes memory: the program stands on [`Watched`](crate::Watched).
    pub allocations_watched: bool,
    /// Its agents.
    pub agents: Vec<AgentView>,
    /// Its queues.
    pub queues: Vec<QueueView>,
    /// Its wires, to and from queues too: there messages are sent on the one and taken on the other.
    pub wires: Vec<WireView>,
    /// What went over wires that are cut. What is on its way still is not among it, nor what a queue counts that is there still.
    pub past: WireTotals,
}
