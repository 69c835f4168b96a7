//! A running plan.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use types::{Duration, Time};

use crate::agent::Registry;
use crate::census::{Burden, Host};
use crate::check::{executors_of, wires_of};
use crate::executor::Core;
use crate::log::{LogChoice, Noted, Recorder};
use crate::names::Directory;
use crate::plan::Plan;
use crate::queue_plan::PlanParts;
use crate::request::{Refusal, Request, SystemView};
use crate::router::{Admission, ExecutorKnown, Fabric, Incident, OutsideCall, Router, ServiceShape, Staged};
use crate::tap::Tap;

/// What somebody wants of a running system, on the way to it.
pub(crate) enum Ask {
    Request(Box<Request>, SyncSender<Result<(), Refusal>>),
    View(SyncSender<SystemView>),
    Plan(SyncSender<PlanParts>),
    Service(String, SyncSender<Result<ServiceShape, Refusal>>),
    Call(OutsideCall),
    Tap(String, SyncSender<Result<Tap, Refusal>>),
    Untap(Tap),
}

/// A way to ask a running system, for any ordinary thread.
#[derive(Clone, Debug)]
pub struct Control {
    asks: SyncSender<Ask>,
}

/// How many requests can wait; more make their senders wait.
const ASKS: usize = 64;

impl Control {
    fn ask<T>(&self, make: impl FnOnce(SyncSender<T>) -> Ask) -> Result<T, Refusal> {
        let (answer, answered) = sync_channel(1);
        let gone = || Refusal::new("the system has ended");
        self.asks.send(make(answer)).map_err(|_| gone())?;
        answered.recv().map_err(|_| gone())
    }

    /// Checks a request and does it whole, or refuses it with a reason.
    pub fn request(&self, request: Request) -> Result<(), Refusal> {
        self.ask(|answer| Ask::Request(Box::new(request), answer))?
    }

    /// What there is.
    pub fn view(&self) -> Result<SystemView, Refusal> {
        self.ask(Ask::View)
    }

    /// The agents, queues and wires that run, as a plan would give them.
    pub fn plan(&self) -> Result<PlanParts, Refusal> {
        self.ask(Ask::Plan)
    }

    /// What a service takes and gives.
    pub fn service(&self, port: &str) -> Result<ServiceShape, Refusal> {
        self.ask(|answer| Ask::Service(port.to_owned(), answer))?
    }

    /// Calls a service with a question in CDR and waits for the answer, in CDR too, for as long as `within` on the clock of the
    /// system. Nobody has to be wired to the service, and no wire is touched.
    pub fn call(&self, service: &str, cdr: Vec<u8>, within: Duration) -> Result<Vec<u8>, Refusal> {
        let service = service.to_owned();
        self.ask(|asker| Ask::Call(OutsideCall { service, cdr, within, asker }))?
    }

    /// Listens to an output. What is not read in time is lost to the reader alone, and counted.
    pub fn tap(&self, port: &str) -> Result<Tap, Refusal> {
        self.ask(|answer| Ask::Tap(port.to_owned(), answer))?
    }

    /// Ends listening.
    pub fn untap(&self, tap: &Tap) {
        // A system that has ended has no taps.
        let _ = self.asks.send(Ask::Untap(tap.clone()));
    }
}

pub(crate) fn asks() -> (Control, Receiver<Ask>) {
    let (sender, receiver) = sync_channel(ASKS);
    (Control { asks: sender }, receiver)
}

/// Whether a run goes on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It does.
    GoOn,
    /// It ends, for this reason.
    End(String),
}

/// Somebody who watches a run from outside, on an ordinary thread or between the instants of simulated time, and may end it.
pub trait Observer: Send {
    /// How often it looks.
    fn every(&self) -> Duration;
    /// Looks.
    fn observe(&mut self, now: Time, incidents: &[Incident]) -> Verdict;
}

/// An observer of nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoObserver;

impl Observer for NoObserver {
    fn every(&self) -> Duration {
        Duration::secs(1)
    }
    fn observe(&mut self, _: Time, _: &[Incident]) -> Verdict {
        Verdict::GoOn
    }
}

/// How a system is run.
pub struct Options {
    /// How long at most; for ever when nothing is said.
    pub limit: Option<Duration>,
    /// Seconds of simulated time in a second of the wall; as fast as it goes when nothing is said.
    pub speed: Option<f64>,
    /// Where the log goes.
    pub recorder: Option<Box<dyn Recorder>>,
    /// Which outputs are logged.
    pub log: LogChoice,
    /// Who watches.
    pub observer: Box<dyn Observer>,
    /// What admission counts with; everything is admitted when nothing is said.
    pub admission: Option<Admission>,
    /// In simulated time: on how many virtual processors steps take the costs that the plan declares; none takes any time when nothing
    /// is said.
    pub processors: Option<usize>,
    /// On the wall clock, lets each step take what its plan declares for it, where that is longer than what it needs: it works on until then.
    pub as_declared: bool,
    /// What takes time of the virtual processors besides the agents.
    pub burdens: Vec<Burden>,
    /// Who tells resource managers how loaded the computer is, on the wall clock.
    pub host: Option<Box<dyn Host>>,
    /// How a timed request of the plan, in words, becomes a request.
    pub parse: fn(&[String]) -> Result<Request, Refusal>,
}

impl Default for Options {
    fn default() -> Options {
        Options {
            limit: None,
            speed: None,
            recorder: None,
            log: LogChoice::default(),
            observer: Box::new(NoObserver),
            admission: None,
            processors: None,
            as_declared: false,
            burdens: Vec::new(),
            host: None,
            parse: |words| Err(Refusal::new(format!("\"{}\" cannot be asked here", words.join(" ")))),
        }
    }
}

/// How a run ended.
#[derive(Clone, Debug)]
pub struct Report {
    /// Why.
    pub ended: String,
    /// How long it ran, on its own clock.
    pub time: Duration,
    /// How long it took, on the wall (s).
    pub wall: f64,
    /// What there was at the end.
    pub view: SystemView,
    /// What the supervisor did.
    pub incidents: Vec<Incident>,
    /// How often the witness saw a processor stand still.
    pub stalls: u64,
    /// Records that found no room in the log.
    pub log_dropped: u64,
    /// What the agents noted, logged or not.
    pub noted: Vec<Noted>,
}

/// Why a plan does not run.
#[derive(Clone, Debug, thiserror::Error)]
pub enum CannotRun {
    /// The plan has mistakes.
    #[error("the plan has {} mistakes, the first: {}", .0.len(), .0[0])]
    Mistakes(Vec<types::value::Mistake>),
    /// A request of its own was refused.
    #[error("{0}")]
    Refused(Refusal),
    /// The operating system gave no thread.
    #[error("no thread could be started: {0}")]
    NoThread(String),
    /// A step did not return.
    #[error("the step of {agent} did not return within {limit}")]
    Stuck {
        /// Whose.
        agent: String,
        /// Within which time of the host.
        limit: Duration,
    },
    /// Events follow each other without end and without time going on.
    #[error("endless events at {time}: {} make each other run without end", .agents.join(", "))]
    Endless {
        /// When.
        time: Time,
        /// Who.
        agents: Vec<String>,
    },
}

/// What both clocks start from: executors without threads, the router with all agents and wires in place.
pub(crate) struct Built {
    pub router: Router,
    pub cores: Vec<Core>,
    pub directory: Arc<Directory>,
}

/// Serves changes of cores that nobody runs meanwhile: at once.
pub(crate) struct Still<'a> {
    pub cores: &'a mut [Core],
    pub context: &'a crate::context::Context,
    pub now: Time,
}

impl Fabric for Still<'_> {
    fn ring(&mut self, executor: usize) {
        self.cores[executor].serve_changes_here(self.context, self.now);
    }

    fn wait(&mut self) -> bool {
        false
    }
}

/// Builds what a plan describes.
pub(crate) fn build(
    plan: &Plan,
    registry: &Registry,
    options: &mut Options,
    now: Time,
) -> Result<Built, CannotRun> {
    let mistakes = crate::check::check(plan, registry);
    if !mistakes.is_empty() {
        return Err(CannotRun::Mistakes(mistakes));
    }
    let directory = Arc::new(Directory::new());
    let (mut cores, mut executors) = (Vec::new(), Vec::new());
    for (number, executor) in executors_of(plan).into_iter().enumerate() {
        let (core, link) = Core::new(number as u32);
        cores.push(core);
        executors.push(ExecutorKnown::new(executor, link));
    }
    let robots =
        plan.section("robot").map(|robots| robots.rows().iter().map(|row| row.key.clone()).collect());
    let mut router =
        Router::new(&plan.name, registry.clone(), executors, robots.unwrap_or_default(), directory.clone());
    router.set_log(options.log.clone());
    router.set_admission(options.admission.clone());
    router.as_declared = options.as_declared;
    if let Some(host) = options.host.take() {
        router.set_host(Arc::new(std::sync::Mutex::new(host)));
    }
    let context = crate::context::Context::new(None, directory.clone());
    let wires = wires_of(plan, registry);
    let mut fabric = Still { cores: &mut cores, context: &context, now };
    let mut staged = Staged::default();
    let mut readers_of: HashMap<&str, usize> = HashMap::new();
    for wire in &wires {
        *readers_of.entry(&wire.from).or_default() += 1;
    }
    for agent in &plan.agents {
        let Some(kind) = registry.get(&agent.kind) else { continue };
        let readers = kind.ports.iter().map(|port| {
            let name = format!("{}.{}", agent.name, port.name);
            readers_of.get(name.as_str()).copied().unwrap_or(0)
        });
        let readers: Vec<usize> = readers.collect();
        router.add(agent.clone(), &readers, &mut staged).map_err(CannotRun::Refused)?;
    }
    for queue in &plan.queues {
        router.add_queue(queue.clone(), &mut staged).map_err(CannotRun::Refused)?;
    }
    for wire in &wires {
        router.wire(wire, &mut staged).map_err(CannotRun::Refused)?;
    }
    router.admit_all().map_err(CannotRun::Refused)?;
    router.settle(staged, &mut fabric);
    Ok(Built { router, cores, directory })
}
