//! Simulated time: one thread plays all executors, in the order of time, executor priority and data flow. Same plan, same
//! requests, same bytes.

#![allow(unsafe_code)]

mod busy;

use core::cmp::Reverse;
use core::sync::atomic::{AtomicBool, Ordering};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::Duration as HostDuration;

use types::{Duration, Time};

use self::busy::Busy;
use crate::agent::Registry;
use crate::census::HostReading;
use crate::context::{Context, install_panic_hook};
use crate::executor::{Core, Ended, Job};
use crate::handover::Running;
use crate::log::LogThread;
use crate::os;
use crate::plan::Plan;
use crate::processor::Moment;
use crate::request::{Refusal, Request};
use crate::router::{Incident, OutsideCall, Router, Said};
use crate::system::{Ask, Built, CannotRun, Control, Options, Report, Still, Verdict, asks, build};
use crate::trace;

/// How long a step may keep the host busy before the run is given up.
const HOST_LIMIT: Duration = Duration::secs(10);
/// So many steps at one instant for each agent are taken for an endless loop.
const STEPS_AT_ONCE: u64 = 10_000;
/// What agents ask of the router is decided once at an instant; what they ask after that, so much later at most.
const DECIDES_AGAIN: Duration = Duration::millis(1);

/// A system in simulated time, ready to run.
pub struct Simulation {
    built: Built,
    control: Control,
    asks: Receiver<Ask>,
    options: Options,
    timed: Vec<(Time, Request, String)>,
}

impl Simulation {
    /// Builds what a plan describes.
    pub fn new(plan: &Plan, registry: &Registry, options: Options) -> Result<Simulation, CannotRun> {
        install_panic_hook();
        let mut options = options;
        let built = build(plan, registry, &mut options, Time::ZERO)?;
        let (control, asks) = asks();
        let mut timed = Vec::new();
        for request in &plan.requests {
            let parsed = (options.parse)(&request.words).map_err(CannotRun::Refused)?;
            timed.push((Time::ZERO + request.at, parsed, request.words.join(" ")));
        }
        timed.sort_by_key(|(at, _, _)| *at);
        Ok(Simulation { built, control, asks, options, timed })
    }

    /// A way to ask the system while it runs, from another thread.
    pub fn control(&self) -> Control {
        self.control.clone()
    }

    /// Runs to the end. The steps run on a thread of their own, so that one that does not return can be told.
    pub fn run(self) -> Result<Report, CannotRun> {
        os::gather_heap();
        let running: Vec<Arc<Running>> = self.built.cores.iter().map(|core| core.running.clone()).collect();
        let directory = self.built.directory.clone();
        let (done, ended) = sync_channel(1);
        let over = Arc::new(AtomicBool::new(false));
        let thread = std::thread::Builder::new()
            .name("sinew-simulation".into())
            .spawn(move || {
                // Whoever waits may have given up.
                let _ = done.send(play(self));
            })
            .map_err(|error| CannotRun::NoThread(error.to_string()))?;
        let mut watched = None;
        let mut since = os::monotonic();
        loop {
            match ended.recv_timeout(HostDuration::from_millis(200)) {
                Ok(report) => {
                    over.store(true, Ordering::Relaxed);
                    let _ = thread.join();
                    return report;
                }
                Err(std::sync::mpsc::RecvTimeoutError::Disconnected) => {
                    return Err(CannotRun::NoThread("the simulation's own thread panicked".into()));
                }
                Err(std::sync::mpsc::RecvTimeoutError::Timeout) => {}
            }
            let in_step = |(at, running): (usize, &Arc<Running>)| running.in_step().map(|step| (at, step));
            let seen = running.iter().enumerate().find_map(in_step);
            if seen != watched || seen.is_none() {
                (watched, since) = (seen, os::monotonic());
            } else if os::monotonic() - since > HOST_LIMIT.0 {
                let agent = seen.map_or(u32::MAX, |(at, _)| running[at].agent.load(Ordering::Relaxed));
                let agent = directory
                    .name(types::AgentId(agent))
                    .map_or("an agent".into(), |name| name.as_str().to_owned());
                return Err(CannotRun::Stuck { agent, limit: HOST_LIMIT });
            }
        }
    }
}

struct Player {
    router: Router,
    cores: Vec<Core>,
    /// Executors, the highest priority first.
    order: Vec<usize>,
    context: Box<Context>,
    now: Time,
    /// Until when an executor is kept busy by an agent that hangs.
    blocked: Vec<Time>,
    /// Agents that hang: when they are given up, their executor and slot.
    hung: Vec<(Time, usize, u32)>,
    /// Where steps take time.
    busy: Option<Box<Busy>>,
    incidents_seen: usize,
    /// When requests of agents were decided last.
    decided: Time,
}

/// The place of an executor: the highest first, and of those by deadline the one whose agent has the shorter one, which at one instant is the earlier.
fn place_of(router: &Router, cores: &[Core], at: usize) -> (Reverse<u8>, Duration) {
    let plan = &router.executors[at].plan;
    let budget = cores[at].budget().filter(|_| plan.is_by_deadline());
    (Reverse(plan.level().unwrap_or(0)), budget.map_or(Duration::ZERO, |budget| budget.deadline))
}

fn play(simulation: Simulation) -> Result<Report, CannotRun> {
    let Simulation { built, control, asks, options, timed } = simulation;
    // The run's own end of the way to ask would keep it from ever being closed.
    drop(control);
    let Built { router, cores, directory } = built;
    let (writer, reader) = trace::ring(trace::LARGE, true);
    let Options { limit, speed, recorder, mut observer, processors, burdens, .. } = options;
    let log_shared = router.log_shared.clone();
    let log = LogThread::start(log_shared, vec![reader], recorder, directory.clone())?;
    let mut order: Vec<usize> = (0..cores.len()).collect();
    order.sort_by_key(|at| place_of(&router, &cores, *at));
    let context = Context::new(Some(writer), directory);
    let blocked = vec![Time::ZERO; cores.len()];
    let mut player = Player {
        router,
        cores,
        order,
        context,
        now: Time::ZERO,
        blocked,
        hung: Vec::new(),
        busy: None,
        incidents_seen: 0,
        decided: Time(i64::MIN),
    };

    if let Some(count) = processors {
        player.router.measures = Some(crate::router::AS_PLAYED);
        player.cores.iter_mut().for_each(Core::count_elsewhere);
        let executors = player.router.executors.iter().map(|executor| &executor.plan);
        let told = player.router.has_manager();
        player.busy = Some(Box::new(Busy::new(count, executors, burdens, told)));
    }
    let entered = player.context.enter();
    let begun = os::monotonic();
    let end = limit.map_or(Time::NEVER, |limit| Time::ZERO + limit);
    let mut timed = timed.into_iter().peekable();
    let mut next_look = Time::ZERO;
    let mut quits = false;
    let ended = loop {
        while let Some((at, request, words)) = timed.next_if(|(at, _, _)| *at <= player.now) {
            quits |= matches!(request, Request::Quit);
            let said = match player.apply(request) {
                Ok(()) => format!("asked: {words}"),
                Err(refusal) => format!("asked: {words}; refused: {refusal}"),
            };
            player.router.incidents.push(Incident { time: at, agent: "plan".into(), what: said });
        }
        if quits {
            break "the plan said quit".into();
        }
        if let Some(reason) = player.serve(&asks) {
            break reason;
        }
        player.instant()?;
        let next_supervision = player.supervise();
        player.decide_asked();
        // Who was started again may have messages to take at this very instant, or something was decided for somebody.
        player.instant()?;
        let next_decision = player.next_decision();
        let next_call = player.answer_calls();
        if player.now >= next_look {
            next_look = player.now + observer.every().max(Duration::millis(1));
            if let Verdict::End(reason) = observer.observe(player.now, &player.router.incidents) {
                break reason;
            }
        }
        let next_timed = timed.peek().map_or(Time::NEVER, |(at, _, _)| *at);
        let next = player
            .next_event()
            .min(next_timed)
            .min(next_look)
            .min(next_supervision)
            .min(next_call)
            .min(next_decision)
            .min(end);
        if player.now >= end {
            break "the time is over".into();
        }
        if next == Time::NEVER {
            break "nothing is left to do".into();
        }
        match player.pace(next, speed, begun, &asks) {
            Paced::Due => player.now = next.max(player.now),
            // What was asked may have made agents ready at this very instant.
            Paced::Asked => {}
            Paced::Ended(reason) => break reason,
        }
    };
    player.stop();
    drop(entered);
    let Player { router, context, now, .. } = player;
    // The writer goes first, so that the log thread finds the ring at rest.
    drop(context);
    let (log_dropped, noted) = log.finish();
    Ok(Report {
        ended,
        time: now.since_start(),
        wall: (os::monotonic() - begun) as f64 * 1e-9,
        view: router.view(now),
        incidents: router.incidents,
        stalls: 0,
        log_dropped,
        noted,
    })
}

/// How waiting for the next instant ended.
enum Paced {
    /// It is time.
    Due,
    /// Something was asked, and answered.
    Asked,
    /// The run ends, for this reason.
    Ended(String),
}

impl Player {
    /// Does everything that is to be done at this instant.
    fn instant(&mut self) -> Result<(), CannotRun> {
        if let Some(mut busy) = self.busy.take() {
            let done = self.busy_instant(&mut busy);
            self.busy = Some(busy);
            return done;
        }
        let mut steps = 0u64;
        'again: loop {
            for place in 0..self.order.len() {
                let at = self.order[place];
                if self.blocked[at] > self.now || self.cores[at].is_idle(self.now) {
                    continue;
                }
                loop {
                    let core = &mut self.cores[at];
                    // Changes are served where they are given.
                    let _ = core.look_at_door();
                    let Some(job) = core.next(self.now) else {
                        // One that must wait has passed a call on.
                        if self.is_rung_before(place) {
                            continue 'again;
                        }
                        break;
                    };
                    let ended = self.step(at, job);
                    steps += 1;
                    if steps > STEPS_AT_ONCE * (1 + self.router.agents_count() as u64) {
                        return Err(self.endless());
                    }
                    if let Some(Ended::AskedToHang(slot)) = ended {
                        self.hang(at, slot);
                        continue 'again;
                    }
                    // A step makes others ready at this instant by ringing at their doors, and in no other way.
                    if self.order[..place].iter().any(|higher| self.cores[*higher].door.is_rung()) {
                        continue 'again;
                    }
                    if self.cores[at].is_idle(self.now) {
                        break;
                    }
                }
            }
            return Ok(());
        }
    }

    /// Makes a step of an agent of an executor.
    #[inline(always)]
    fn step(&mut self, executor: usize, job: Job) -> Option<Ended> {
        let core = &mut self.cores[executor];
        let mut moment = Moment::simulated(self.now);
        // SAFETY: the core lives in this thread's own array, and nobody else takes it.
        unsafe { Core::run(core, &self.context, job, &mut moment, None, || true) }
    }

    /// Whether somebody has rung at an executor that goes before this one and is not kept busy.
    fn is_rung_before(&self, place: usize) -> bool {
        self.order[..place].iter().any(|at| self.blocked[*at] <= self.now && self.cores[*at].door.is_rung())
    }

    /// An agent is stuck in virtual time: its executor does nothing until the watchdog has given it up.
    fn hang(&mut self, executor: usize, slot: u32) {
        let limit = self.router.hang_limit(executor, slot);
        self.blocked[executor] = self.now + limit;
        self.hung.push((self.now + limit, executor, slot));
    }

    fn give_up_hung(&mut self) {
        let now = self.now;
        let due: Vec<_> = self.hung.iter().filter(|(at, _, _)| *at <= now).copied().collect();
        self.hung.retain(|(at, _, _)| *at > now);
        for (_, executor, slot) in due {
            if let Some(mut busy) = self.busy.take() {
                busy.give_up(executor);
                self.end(&mut busy, executor);
                self.busy = Some(busy);
            }
            self.cores[executor].give_up(slot, now);
        }
    }

    /// The agents that ran last, when time does not go on.
    fn endless(&mut self) -> CannotRun {
        let mut agents = Vec::new();
        for _ in 0..64 {
            for place in 0..self.order.len() {
                let at = self.order[place];
                let core = &mut self.cores[at];
                let _ = core.look_at_door();
                let Some(job) = core.next(self.now) else { continue };
                if let Some(seat) = core.seats[job.slot as usize].as_ref() {
                    let name = seat.name.as_str().to_owned();
                    if !agents.contains(&name) {
                        agents.push(name);
                    }
                }
                self.step(at, job);
                break;
            }
        }
        CannotRun::Endless { time: self.now, agents }
    }

    fn apply(&mut self, request: Request) -> Result<(), Refusal> {
        let mut fabric = Still { cores: &mut self.cores, context: &self.context, now: self.now };
        let done = self.router.apply(request, self.now, &mut fabric);
        // Deadlines may be others now.
        self.order.sort_by_key(|at| place_of(&self.router, &self.cores, *at));
        done
    }

    fn supervise(&mut self) -> Time {
        self.give_up_hung();
        let mut fabric = Still { cores: &mut self.cores, context: &self.context, now: self.now };
        let next = self.router.supervise(self.now, &mut fabric);
        for incident in &self.router.incidents[self.incidents_seen..] {
            self.context.log(|log| log.line(incident.time, &incident.agent, &incident.what));
        }
        self.incidents_seen = self.router.incidents.len();
        next
    }

    /// Decides what agents have asked of the router, once at each instant, so that a run goes on whatever they ask.
    fn decide_asked(&mut self) {
        if !(self.router.is_asked() || self.router.is_managed()) || self.decided == self.now {
            return;
        }
        self.decided = self.now;
        let now = self.now;
        let mut fabric = Still { cores: &mut self.cores, context: &self.context, now };
        let mut said = self.router.decide_asked(now, &mut fabric);
        if self.router.is_managed() {
            let busy = &mut self.busy;
            let mut host = || busy.as_mut().map_or_else(HostReading::default, |busy| busy.reading(now));
            said.extend(self.router.manage(now, Some(&mut host), &mut fabric));
            self.order.sort_by_key(|at| place_of(&self.router, &self.cores, *at));
        }
        for Said { agent, what } in said {
            self.context.log(|log| log.line(now, &agent, &what));
        }
    }

    /// When what was asked since then is decided.
    fn next_decision(&self) -> Time {
        if self.router.is_asked() || self.router.is_managed() {
            self.now + DECIDES_AGAIN
        } else {
            Time::NEVER
        }
    }

    /// Answers what was asked from outside. Says why the run ends, if it does.
    fn serve(&mut self, asks: &Receiver<Ask>) -> Option<String> {
        while let Ok(ask) = asks.try_recv() {
            if let Some(reason) = self.answer(ask) {
                return Some(reason);
            }
        }
        None
    }

    fn answer(&mut self, ask: Ask) -> Option<String> {
        match ask {
            Ask::Request(request, answer) => {
                let quits = matches!(*request, Request::Quit);
                let said = format!("{request:?}");
                let faults = request.faults();
                let result = self.apply(*request);
                let outcome =
                    result.as_ref().err().map_or(String::new(), |refusal| format!("; refused: {refusal}"));
                self.context.log(|log| log.line(self.now, "control", &format!("asked: {said}{outcome}")));
                // It is in the log already.
                let incidents = Incident::of_faults(faults, self.now, &outcome);
                self.incidents_seen += incidents.len();
                let at = self.incidents_seen - incidents.len();
                self.router.incidents.splice(at..at, incidents);
                // Whoever asked may be gone.
                let _ = answer.send(result);
                return quits.then(|| "asked to quit".into());
            }
            Ask::View(answer) => drop(answer.send(self.router.view(self.now))),
            Ask::Plan(answer) => drop(answer.send(self.router.to_plan())),
            Ask::Service(port, answer) => drop(answer.send(self.router.service(&port))),
            Ask::Call(call) => self.call(call),
            Ask::Tap(port, answer) => drop(answer.send(self.router.tap(&port))),
            Ask::Untap(tap) => self.router.untap(&tap),
        }
        None
    }

    fn call(&mut self, call: OutsideCall) {
        let said = call.said();
        let mut fabric = Still { cores: &mut self.cores, context: &self.context, now: self.now };
        let refused = self.router.call(call, self.now, &mut fabric).err();
        let outcome = refused.map_or(String::new(), |refusal| format!("; refused: {refusal}"));
        self.context.log(|log| log.line(self.now, "control", &format!("asked: {said}{outcome}")));
    }

    fn answer_calls(&mut self) -> Time {
        let mut fabric = Still { cores: &mut self.cores, context: &self.context, now: self.now };
        self.router.answer_calls(self.now, &mut fabric)
    }

    fn next_event(&self) -> Time {
        let hung = self.hung.iter().map(|(at, _, _)| *at).min().unwrap_or(Time::NEVER);
        if let Some(busy) = &self.busy {
            let free = self.cores.iter().enumerate().filter(|(at, _)| !busy.is_busy(*at));
            let releases = free.map(|(_, core)| core.next_release());
            return releases
                .min()
                .unwrap_or(Time::NEVER)
                .min(hung)
                .min(busy.next_end())
                .min(busy.next_burden());
        }
        let releases =
            self.cores.iter().zip(&self.blocked).map(|(core, blocked)| core.next_release().max(*blocked));
        releases.min().unwrap_or(Time::NEVER).min(hung)
    }

    /// Where the run shall not be faster than a clock, waits for it, or until something is asked.
    fn pace(&mut self, next: Time, speed: Option<f64>, begun: i64, asks: &Receiver<Ask>) -> Paced {
        let Some(speed) = speed.filter(|speed| *speed > 0.0) else { return Paced::Due };
        let due = begun + (next.seconds() / speed * 1e9) as i64;
        loop {
            let left = due - os::monotonic();
            if left <= 0 {
                return Paced::Due;
            }
            match asks.recv_timeout(HostDuration::from_nanos(left as u64)) {
                Ok(ask) => return self.answer(ask).map_or(Paced::Asked, Paced::Ended),
                Err(std::sync::mpsc::RecvTimeoutError::Timeout) => return Paced::Due,
                Err(std::sync::mpsc::RecvTimeoutError::Disconnected) => {
                    std::thread::park_timeout(HostDuration::from_nanos(left as u64));
                }
            }
        }
    }

    fn stop(&mut self) {
        if let Some(mut busy) = self.busy.take() {
            self.end_all(&mut busy);
        }
        let mut fabric = Still { cores: &mut self.cores, context: &self.context, now: self.now };
        self.router.stop_all(&mut fabric);
    }
}
