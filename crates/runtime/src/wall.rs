//! The wall clock: each executor is a thread of its own.
//!
//! The control side is the thread that called [`Live::run`]: it answers requests, starts the dead again and looks at the run.
//! Beside it stand a watchdog, which sees steps that do not return, and a witness for each processor, which sees stalls that
//! nobody in the process caused.

#![allow(unsafe_code)]

mod budget;
mod threads;
mod watchdog;

use core::sync::atomic::{AtomicBool, AtomicI32, AtomicU32, AtomicUsize, Ordering};
use std::cell::UnsafeCell;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration as HostDuration;

use types::{Duration, Time};

use self::budget::{Asked, standing, told};
use self::threads::Threads;
use self::watchdog::watch;
use crate::agent::Registry;
use crate::context::{Context, install_panic_hook};
use crate::door::{CHANGES, Door};
use crate::executor::{Core, Ended};
use crate::handover::{Owner, Running};
use crate::log::LogThread;
use crate::names::Directory;
use crate::nonblocking::RealTime;
use crate::os;
use crate::plan::{ExecutorPlan, Plan};
use crate::processor::{Processors, Stopwatch};
use crate::request::{Refusal, Request};
use crate::router::{Incident, OutsideCall, Router, Said};
use crate::sync::Futex;
use crate::system::{Ask, Built, CannotRun, Control, Options, Report, Verdict, asks, build};
use crate::trace;
use crate::witness::Witness;

/// The witness stands above everything, the watchdog next to it.
const WITNESS_PRIORITY: u8 = 95;
/// How often the control side looks without being asked.
const CONTROL_PERIOD: HostDuration = HostDuration::from_millis(10);
/// The same while somebody outside waits for the answer to a call.
const CALL_PERIOD: HostDuration = HostDuration::from_millis(1);
/// More steps than this that never returned, and the system stops.
const MOST_HUNG: usize = 4;
/// How long the control side waits for an executor to answer.
const PATIENCE: Duration = Duration::secs(2);

/// The time of the wall: the monotonic clock, counted from the Unix epoch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WallClock {
    offset: i64,
}

impl WallClock {
    fn start() -> WallClock {
        WallClock { offset: os::realtime() - os::monotonic() }
    }

    fn now(self) -> Time {
        Time(os::monotonic() + self.offset)
    }

    fn monotonic(self, time: Time) -> Option<i64> {
        (time != Time::NEVER).then(|| time.0 - self.offset)
    }
}

const NOBODY: u32 = 0;

/// An executor's core and whose it is. A thread touches the core while `owner` is its own number.
struct Cell {
    core: UnsafeCell<Core>,
    owner: Owner,
    /// The kernel's number of the owner's thread.
    thread: AtomicI32,
    /// The slot that was given up, for the thread that takes over.
    given_up: AtomicU32,
    /// What each thread that has the core in turn publishes, and which of them has it.
    running: Vec<Arc<Running>>,
    current: AtomicUsize,
    door: Arc<Door>,
    /// Where the spare thread waits to be called; it takes the call back when it has the core.
    call: Futex,
    /// Whether the spare thread has been used up, and another is to be made.
    needs_spare: AtomicBool,
    granted: Mutex<Option<String>>,
    /// Whether its thread has asked for another budget since anybody looked, and the number of the error with which it was refused, or zero.
    has_asked: AtomicBool,
    refused: AtomicI32,
    stop: AtomicBool,
}

impl Cell {
    fn running(&self) -> &Running {
        // Pairs with the release of the thread that took over, which changes it before anybody can lose the core again.
        &self.running[self.current.load(Ordering::Acquire) % self.running.len()]
    }
}

// SAFETY: the core is touched only by the thread whose number `owner` holds.
unsafe impl Sync for Cell {}
// SAFETY: everything in it can be sent; the core is only ever used by one thread at a time.
unsafe impl Send for Cell {}

/// A system on the wall clock, ready to run.
pub struct Live {
    built: Built,
    control: Control,
    asks: Receiver<Ask>,
    options: Options,
    timed: Vec<(Duration, Request, String)>,
    clock: WallClock,
}

impl Live {
    /// Builds what a plan describes.
    pub fn new(plan: &Plan, registry: &Registry, options: Options) -> Result<Live, CannotRun> {
        install_panic_hook();
        let clock = WallClock::start();
        let mut options = options;
        let mut built = build(plan, registry, &mut options, clock.now())?;
        built.router.measures = Some(crate::router::WITH_MARGIN);
        built.cores.iter_mut().for_each(|core| core.dates = true);
        let (control, asks) = asks();
        let mut timed = Vec::new();
        for request in &plan.requests {
            let parsed = (options.parse)(&request.words).map_err(CannotRun::Refused)?;
            timed.push((request.at, parsed, request.words.join(" ")));
        }
        timed.sort_by_key(|(at, _, _)| *at);
        Ok(Live { built, control, asks, options, timed, clock })
    }

    /// A way to ask the system while it runs, from another thread.
    pub fn control(&self) -> Control {
        self.control.clone()
    }

    /// Runs to the end. The calling thread becomes the control side.
    pub fn run(self) -> Result<Report, CannotRun> {
        Runner::start(self)?.run()
    }
}

struct Runner {
    router: Router,
    cells: Vec<Arc<Cell>>,
    threads: Vec<std::thread::JoinHandle<()>>,
    /// The watchdog and the witnesses.
    guards: Vec<std::thread::JoinHandle<()>>,
    over: Arc<AtomicBool>,
    hung: Arc<AtomicU32>,
    /// Whether an executor can be taken from a thread that does not come back.
    can_take: bool,
    spare_logs: SpareLogs,
    log: LogThread,
    asks: Receiver<Ask>,
    options: Options,
    timed: std::iter::Peekable<std::vec::IntoIter<(Duration, Request, String)>>,
    clock: WallClock,
    begun: Time,
    incidents_seen: usize,
    directory: Arc<Directory>,
    next_thread: u32,
    witness: Arc<Witness>,
    processors: Arc<Processors>,
}

/// Ends of log rings that were made ahead for spare threads.
type SpareLogs = Vec<trace::Writer>;

/// How many spare threads can be made while the system runs.
const SPARE_LOGS: usize = MOST_HUNG + 1;

impl Runner {
    fn start(live: Live) -> Result<Runner, CannotRun> {
        let Live { built, control, asks, mut options, timed, clock } = live;
        drop(control);
        let Built { router, cores, directory } = built;
        let can_take = os::register_barrier();
        if let Err(error) = &can_take {
            let what = format!(
                "no barrier on all processors: {error}; a step that does not return ends the run, for no other thread can go on safely"
            );
            router.log_shared.note(clock.now(), "sinew", &what);
        }
        let wants_real_time =
            router.executors.iter().any(|executor| executor.plan.level().is_some() && executor.is_used());
        if wants_real_time && let Err(error) = os::lock_memory() {
            let what = format!("memory is not locked: {error}; page faults can make steps late");
            router.log_shared.note(clock.now(), "sinew", &what);
        }
        let mut writers = Vec::new();
        let mut readers = Vec::new();
        for _ in 0..cores.len() * 2 + SPARE_LOGS {
            let (writer, reader) = trace::ring(trace::SMALL, false);
            writers.push(writer);
            readers.push(reader);
        }
        let log =
            LogThread::start(router.log_shared.clone(), readers, options.recorder.take(), directory.clone())?;
        let witness = Arc::new(Witness::new(cores.len()));
        let mut runner = Runner {
            cells: Vec::new(),
            threads: Vec::new(),
            guards: Vec::new(),
            over: Arc::default(),
            hung: Arc::default(),
            can_take: can_take.is_ok(),
            spare_logs: writers,
            log,
            asks,
            options,
            timed: timed.into_iter().peekable(),
            clock,
            begun: clock.now(),
            incidents_seen: 0,
            directory,
            next_thread: NOBODY,
            router,
            witness,
            processors: Arc::new(Processors::new()),
        };
        for core in cores {
            runner.start_executor(core)?;
        }
        runner.start_watchdog()?;
        if wants_real_time {
            runner.start_witnesses()?;
        }
        Ok(runner)
    }

    fn start_executor(&mut self, core: Core) -> Result<(), CannotRun> {
        let at = self.cells.len();
        if !self.router.executors[at].is_used() {
            // Nobody is on it yet: its thread is made, but asks for no priority until somebody comes.
            self.router.executors[at].granted = "idle".into();
        }
        self.next_thread += 1;
        let cell = Arc::new(Cell {
            owner: Owner::new(self.next_thread),
            thread: AtomicI32::new(0),
            given_up: AtomicU32::new(0),
            running: core::iter::once(core.running.clone())
                .chain((0..SPARE_LOGS).map(|_| Arc::new(core.running.beside())))
                .collect(),
            current: AtomicUsize::new(0),
            door: core.door.clone(),
            call: Futex::new(NOBODY),
            needs_spare: AtomicBool::new(false),
            granted: Mutex::new(None),
            has_asked: AtomicBool::new(false),
            refused: AtomicI32::new(0),
            stop: AtomicBool::new(false),
            core: UnsafeCell::new(core),
        });
        self.cells.push(cell);
        self.spawn(at, self.next_thread)?;
        self.spawn_spare(at)
    }

    /// A thread that waits until an executor is handed to it.
    fn spawn_spare(&mut self, at: usize) -> Result<(), CannotRun> {
        self.next_thread += 1;
        self.spawn(at, self.next_thread)
    }

    fn spawn(&mut self, at: usize, number: u32) -> Result<(), CannotRun> {
        let cell = self.cells[at].clone();
        let plan = self.router.executors[at].plan.clone();
        let (clock, directory) = (self.clock, self.directory.clone());
        let (witness, processors) = (self.witness.clone(), self.processors.clone());
        let log = self.spare_logs.pop();
        let thread = std::thread::Builder::new()
            .name(format!("sinew-{}", plan.name))
            .spawn(move || thread_main(&cell, number, &plan, clock, log, directory, (&witness, &processors)))
            .map_err(|error| CannotRun::NoThread(error.to_string()))?;
        self.threads.push(thread);
        Ok(())
    }

    fn start_watchdog(&mut self) -> Result<(), CannotRun> {
        let (cells, over, hung) = (self.cells.clone(), self.over.clone(), self.hung.clone());
        let can_take = self.can_take;
        let watchdog = std::thread::Builder::new()
            .name("sinew-watchdog".into())
            .spawn(move || watch(&cells, &over, &hung, can_take))
            .map_err(|error| CannotRun::NoThread(error.to_string()))?;
        self.guards.push(watchdog);
        Ok(())
    }

    fn start_witnesses(&mut self) -> Result<(), CannotRun> {
        for cpu in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            let (witness, over, offset) = (self.witness.clone(), self.over.clone(), self.clock.offset);
            let thread = std::thread::Builder::new()
                .name(format!("sinew-witness{cpu}"))
                .spawn(move || {
                    // A witness without priority would see its own process; it then does not run.
                    if os::set_affinity(&[cpu]).is_ok() && os::set_fifo(WITNESS_PRIORITY).is_ok() {
                        os::exact_timers();
                        witness.watch(cpu, &over, offset);
                    }
                })
                .map_err(|error| CannotRun::NoThread(error.to_string()))?;
            self.guards.push(thread);
        }
        Ok(())
    }

    fn run(mut self) -> Result<Report, CannotRun> {
        let host = os::monotonic();
        let mut next_look = self.begun;
        let ended = loop {
            if let Some(reason) = self.look(&mut next_look)? {
                break reason;
            }
            let pause = if self.router.has_calls() { CALL_PERIOD } else { CONTROL_PERIOD };
            match self.asks.recv_timeout(pause) {
                Ok(ask) => {
                    if let Some(reason) = self.answer(ask) {
                        break reason;
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => std::thread::park_timeout(CONTROL_PERIOD),
            }
        };
        let now = self.clock.now();
        // While there are threads that can be asked.
        self.note_grants();
        self.end();
        // A short run may be over before anybody has looked at what its threads were granted.
        self.note_grants();
        let view = self.router.view(now);
        let (log_dropped, noted) = self.log.finish();
        Ok(Report {
            ended,
            time: now - self.begun,
            wall: (os::monotonic() - host) as f64 * 1e-9,
            view,
            incidents: self.router.incidents,
            stalls: self.witness.stalls(),
            log_dropped,
            noted,
        })
    }

    /// What the control side does without being asked.
    fn look(&mut self, next_look: &mut Time) -> Result<Option<String>, CannotRun> {
        let now = self.clock.now();
        let since = now - self.begun;
        while let Some((at, request, words)) = self.timed.next_if(|(at, _, _)| *at <= since) {
            if matches!(request, Request::Quit) {
                return Ok(Some("the plan said quit".into()));
            }
            let said = match self.apply(request) {
                Ok(()) => format!("asked: {words}"),
                Err(refusal) => format!("asked: {words}; refused: {refusal}"),
            };
            self.router.incidents.push(Incident { time: self.begun + at, agent: "plan".into(), what: said });
        }
        self.note_grants();
        self.make_spares()?;
        let mut fabric = Threads::new(&self.cells);
        self.router.supervise(now, &mut fabric);
        self.router.answer_calls(now, &mut fabric);
        let mut said = self.router.decide_asked(now, &mut Threads::new(&self.cells));
        if self.router.is_managed() {
            said.extend(self.router.manage(now, None, &mut Threads::new(&self.cells)));
        }
        for Said { agent, what } in said {
            self.router.log_shared.note(now, &agent, &what);
        }
        for incident in &self.router.incidents[self.incidents_seen..] {
            self.router.log_shared.note(incident.time, &incident.agent, &incident.what);
        }
        self.incidents_seen = self.router.incidents.len();
        if self.hung.load(Ordering::Relaxed) as usize > MOST_HUNG {
            return Ok(Some(match self.can_take {
                true => format!("more than {MOST_HUNG} steps did not return"),
                false => "a step did not return, and no other thread can go on safely".into(),
            }));
        }
        if now >= *next_look {
            *next_look = now + self.options.observer.every().max(Duration::millis(1));
            if let Verdict::End(reason) = self.options.observer.observe(now, &self.router.incidents) {
                return Ok(Some(reason));
            }
        }
        Ok(self.options.limit.is_some_and(|limit| since >= limit).then(|| "the time is over".into()))
    }

    fn note_grants(&mut self) {
        for (cell, known) in self.cells.iter().zip(&mut self.router.executors) {
            if let Some(granted) = cell.granted.lock().unwrap_or_else(PoisonError::into_inner).take() {
                known.granted = granted;
            }
            if let Some(granted) = cell.asked_meanwhile() {
                known.granted = granted;
            }
        }
    }

    /// Where a spare thread has taken over, another is made.
    fn make_spares(&mut self) -> Result<(), CannotRun> {
        for at in 0..self.cells.len() {
            if self.cells[at].needs_spare.swap(false, Ordering::AcqRel) {
                self.spawn_spare(at)?;
            }
        }
        Ok(())
    }

    fn apply(&mut self, request: Request) -> Result<(), Refusal> {
        let mut fabric = Threads::new(&self.cells);
        self.router.apply(request, self.clock.now(), &mut fabric)
    }

    fn call(&mut self, call: OutsideCall, now: Time) {
        let said = call.said();
        let mut fabric = Threads::new(&self.cells);
        let refused = self.router.call(call, now, &mut fabric).err();
        let outcome = refused.map_or(String::new(), |refusal| format!("; refused: {refusal}"));
        self.router.log_shared.note(now, "control", &format!("asked: {said}{outcome}"));
    }

    fn answer(&mut self, ask: Ask) -> Option<String> {
        let now = self.clock.now();
        match ask {
            Ask::Request(request, answer) => {
                let quits = matches!(*request, Request::Quit);
                let said = format!("{request:?}");
                let faults = request.faults();
                let result = self.apply(*request);
                let outcome =
                    result.as_ref().err().map_or(String::new(), |refusal| format!("; refused: {refusal}"));
                self.router.log_shared.note(now, "control", &format!("asked: {said}{outcome}"));
                // It is in the log already.
                let incidents = Incident::of_faults(faults, now, &outcome);
                self.incidents_seen += incidents.len();
                let at = self.incidents_seen - incidents.len();
                self.router.incidents.splice(at..at, incidents);
                // Whoever asked may be gone.
                let _ = answer.send(result);
                return quits.then(|| "asked to quit".into());
            }
            Ask::View(answer) => drop(answer.send(self.router.view(now))),
            Ask::Plan(answer) => drop(answer.send(self.router.to_plan())),
            Ask::Service(port, answer) => drop(answer.send(self.router.service(&port))),
            Ask::Call(call) => self.call(call, now),
            Ask::Tap(port, answer) => drop(answer.send(self.router.tap(&port))),
            Ask::Untap(tap) => self.router.untap(&tap),
        }
        None
    }

    /// Stops the agents, then the threads. A thread in a step that does not return is left behind.
    fn end(&mut self) {
        let mut fabric = Threads::new(&self.cells);
        self.router.stop_all(&mut fabric);
        for cell in &self.cells {
            cell.stop.store(true, Ordering::Release);
            cell.call.word.store(STOPPED, Ordering::Release);
            cell.call.wake();
            cell.door.ring(CHANGES);
        }
        self.over.store(true, Ordering::Release);
        self.guards.drain(..).for_each(|thread| drop(thread.join()));
        let patience = os::monotonic() + PATIENCE.0;
        while self.threads.iter().any(|thread| !thread.is_finished()) && os::monotonic() < patience {
            for cell in &self.cells {
                cell.call.wake();
                cell.door.ring(CHANGES);
            }
            std::thread::park_timeout(HostDuration::from_millis(1));
        }
        self.threads.drain(..).filter(|thread| thread.is_finished()).for_each(|thread| drop(thread.join()));
    }
}

/// Of a spare thread whose executor runs by its agent's deadline: it asks for the budget, of which there is one, when it has the executor.
const SPARE_PRIORITY: u8 = 93;

/// What stands in the word on which a spare thread waits.
const CALLED: u32 = 1;
const STOPPED: u32 = 2;

fn thread_main(
    cell: &Cell,
    number: u32,
    plan: &ExecutorPlan,
    clock: WallClock,
    log: Option<trace::Writer>,
    directory: Arc<Directory>,
    (witness, processors): (&Witness, &Processors),
) {
    os::touch_stack();
    os::exact_timers();
    let mut granted = Some(ask_for(plan));
    let context = Context::new(log, directory);
    let _entered = context.enter();
    // A spare thread sleeps here until the core is its own.
    while !cell.owner.is(number) {
        if cell.stop.load(Ordering::Acquire) {
            return;
        }
        if cell.call.word.load(Ordering::Acquire) == CALLED && cell.owner.claim(number) {
            let given_up = cell.given_up.load(Ordering::Acquire);
            let current = cell.current.load(Ordering::Relaxed) + 1;
            // SAFETY: the claim made the core this thread's own.
            unsafe { (*cell.core.get()).running = cell.running[current % cell.running.len()].clone() };
            cell.current.store(current, Ordering::Release);
            cell.call.word.store(NOBODY, Ordering::Release);
            cell.needs_spare.store(true, Ordering::Release);
            // SAFETY: the claim made the core this thread's own.
            let core = unsafe { &mut *cell.core.get() };
            core.give_up(given_up, clock.now());
            core.find_ready();
            break;
        }
        cell.call.wait(cell.call.word.load(Ordering::Acquire) & !CALLED, None);
    }
    cell.thread.store(os::thread_id(), Ordering::Release);
    // SAFETY: the core is this thread's own, and the borrow ends here.
    let (executor, needed) = unsafe { ((*cell.core.get()).number, (*cell.core.get()).budget()) };
    let watch = Stopwatch::new(witness, processors, executor as usize, &plan.cpus, clock.offset);
    let mut asked = Asked::default();
    if plan.is_by_deadline() {
        if needed.is_none() {
            // A spare one, perhaps, whose agent has left meanwhile.
            let _ = os::set_ordinary();
        }
        granted = asked.ask(needed, clock.now()).map(|said| told(&said));
    }
    if granted.is_some() {
        *cell.granted.lock().unwrap_or_else(PoisonError::into_inner) = granted;
    }
    watch.stands_at(standing());
    run_core(cell, number, plan, clock, &context, &watch, asked);
}

/// Asks for what the plan says, and tells what was granted.
fn ask_for(plan: &ExecutorPlan) -> String {
    let mut told = String::new();
    if !plan.cpus.is_empty()
        && let Err(error) = os::set_affinity(&plan.cpus)
    {
        told = format!(", not on processors {:?}: {error}", plan.cpus);
    }
    if plan.is_by_deadline() {
        let _ = os::set_fifo(SPARE_PRIORITY);
        return told;
    }
    match plan.priority.map(os::set_fifo) {
        None => format!("ordinary{told}"),
        Some(Ok(())) => {
            let (policy, priority) = os::granted();
            if policy == libc::SCHED_FIFO {
                format!("fifo {priority}{told}")
            } else {
                format!("policy {policy}{told}")
            }
        }
        Some(Err(error)) => format!("ordinary ({error}){told}"),
    }
}

fn run_core(
    cell: &Cell,
    number: u32,
    plan: &ExecutorPlan,
    clock: WallClock,
    context: &Context,
    watch: &Stopwatch<'_>,
    mut asked: Asked,
) {
    let core = cell.core.get();
    let mut woken = watch.wake();
    let here = RealTime::enter(plan.level().is_some());
    let mut sleep = |until| {
        watch.rest(&woken);
        here.pause(|| cell.door.sleep(until));
        woken = watch.wake();
    };
    let mine = || here.still(cell.owner.keeps(number));
    let mut at = watch.fresh(Time::ZERO);
    // SAFETY: the core is this thread's own, and the borrow ends here.
    unsafe { (*core).begin_at(at.time) };
    loop {
        // SAFETY: the core is this thread's own, and the borrow ends here.
        let changes = unsafe { (*core).look_at_door() };
        // SAFETY: the core is this thread's own; the last says whether it still is when somebody was stopped.
        if changes && !unsafe { Core::serve_changes(core, context, at.time, &mine) } {
            return;
        }
        if changes || watch.is_old(&at) {
            at = watch.fresh(at.time);
        }
        if plan.is_by_deadline() && (changes || asked.is_due(at.time)) {
            // SAFETY: as above, and the borrow ends here.
            let needed = unsafe { (*core).budget() };
            if let Some(said) = asked.ask(needed, at.time) {
                cell.note_asked(&said);
                watch.stands_at(standing());
            }
        }
        // SAFETY: as above, and the borrow ends before the step.
        let job = unsafe { (*core).next(at.time) };
        if let Some(job) = job {
            // SAFETY: the core is this thread's own; `mine` says whether it still is after the step.
            match unsafe { Core::run(core, context, job, &mut at, Some(watch), mine) } {
                None => return,
                Some(Ended::AskedToHang(slot)) => {
                    if !hang(cell, number, slot) {
                        return;
                    }
                    at = watch.fresh(at.time);
                }
                Some(_) => {}
            }
            continue;
        }
        if cell.stop.load(Ordering::Acquire) {
            return;
        }
        // SAFETY: as above.
        let next = unsafe { (*core).next_release() };
        let until = clock.monotonic(next);
        match until {
            Some(until) if plan.spin > Duration::ZERO => {
                if until - os::monotonic() > plan.spin.0 {
                    sleep(Some(until - plan.spin.0));
                } else {
                    core::hint::spin_loop();
                }
            }
            _ => sleep(until),
        }
        at = watch.fresh(at.time);
    }
}

/// On request, an agent that does not return: the thread keeps its processor until the watchdog has given it up. Says whether
/// the core is still this thread's.
fn hang(cell: &Cell, number: u32, slot: u32) -> bool {
    let running = cell.running();
    running.since.store(os::ticks(), Ordering::Relaxed);
    let count = running.count().wrapping_add(1);
    running.begin(count, slot);
    while cell.owner.is_still(number) {
        if cell.stop.load(Ordering::Acquire) {
            running.end(count);
            return cell.owner.keeps(number);
        }
        core::hint::spin_loop();
    }
    false
}
