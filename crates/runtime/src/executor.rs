//! What an operating-system thread runs: agents, one after another.
//!
//! The core is the same on every clock. It knows which agents are due or made ready and in which order they go; whoever owns
//! it says what time it is. An agent's step is the only foreign code, and while it runs nobody holds a reference into the
//! core: a thread that does not come back from a step can lose the core to another.

#![allow(unsafe_code)]

mod change;
mod serving;

use std::any::Any;
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use types::{AgentId, Duration, Name, Time};

pub(crate) use change::{Answer, Change, Link, heaps_for};

use crate::agent::{Body, Fault, Step};
use crate::allocations;
use crate::context::{Context, ReadySet};
use crate::door::{CHANGES, Door};
use crate::handover::Running;
use crate::os;
use crate::port::{InputEnd, Rest};
use crate::processor::{Checks, Reading, Stopwatch, agrees};
use crate::ring::{self, ring};
use crate::stats::{AgentStats, bump, bump_by, nanos};
use crate::sync::{Ordering, light_barrier};
use crate::turn::Turn;

/// When an agent runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Timing {
    /// Zero for an agent that only messages make run.
    pub period: Duration,
    pub deadline: Duration,
    pub min_gap: Duration,
    /// How long a step may last before it is taken for one that does not return.
    pub hang_after: Duration,
}

/// An agent's place in an executor.
pub(crate) struct Seat {
    pub id: AgentId,
    pub name: Name,
    pub body: Option<Box<dyn Body>>,
    /// The inputs whose messages make it run.
    pub on: Vec<Arc<dyn InputEnd>>,
    pub timing: Timing,
    pub stats: Arc<AgentStats>,
    pub next_release: Time,
    /// The step that the agent asked for.
    pub alarm: Time,
    /// The step that a message asked for too soon after the last one: when it may be. The next step is that one, whatever for.
    pub put_off: Time,
    pub last_step: Time,
    pub started: bool,
    pub fault: StepFault,
}

/// How an agent misbehaves on request.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StepFault {
    /// It does not.
    #[default]
    None,
    /// Its steps are left out.
    Off,
    /// Its next step panics.
    Panic,
    /// Its next step does not return.
    Hang,
    /// Only every fourth of its steps is done.
    Slow,
}

/// Why an agent died.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Cause {
    /// Its step reported a fault.
    Fault(Fault),
    /// Its step panicked.
    Panic(String),
    /// Its step did not return.
    Hang,
}

impl core::fmt::Display for Cause {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Cause::Fault(fault) => write!(f, "fault: {fault}"),
            Cause::Panic(said) => write!(f, "panic: {said}"),
            Cause::Hang => f.write_str("its step did not return"),
        }
    }
}

/// What is known of a death on the side where it happened, without memory of its own.
#[allow(clippy::large_enum_variant)] // the record is there so that no memory is needed for it
pub(crate) enum RawCause {
    Fault(Fault),
    Panic(crate::context::PanicRecord, Box<dyn Any + Send>),
    Hang,
}

/// The time of a step.
struct Spent {
    /// From its beginning to its end, in [`os::ticks`].
    elapsed: u64,
    /// What higher executors had of that.
    others: u64,
    /// What the thread's clock says (ns), where it was asked.
    thread: Option<u64>,
    /// How often it took or freed memory.
    allocations: u64,
}

/// An agent that is to run, and why.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Job {
    pub slot: u32,
    /// When it was due; the present for one that a message made run.
    pub release: Time,
    pub deadline: Time,
}

type Releases = BinaryHeap<Reverse<(Time, u32)>>;
type Due = BinaryHeap<Reverse<(Time, u32, u32, Time)>>;

/// The agents of one executor and what is due among them.
pub(crate) struct Core {
    pub number: u32,
    pub seats: Vec<Option<Box<Seat>>>,
    order: Vec<u32>,
    ready: Box<ReadySet>,
    releases: Releases,
    due: Due,
    cursor: u32,
    pub door: Arc<Door>,
    pub running: Arc<Running>,
    changes: ring::Receiver<Option<(u64, Change)>>,
    turn: Arc<Turn>,
    answers: ring::Sender<Option<Answer>>,
    nanos_per_tick: f64,
    checks: Checks,
    /// How many stalls the witness had seen after the last step.
    stalls: u64,
}

/// How many changes or answers can be under way.
const UNDER_WAY: usize = 1024;
/// Room for alarms besides the one release of each agent.
const SPARE_ALARMS: usize = 64;

/// What a step did besides its work.
pub(crate) enum Ended {
    /// All is well, or what is not was told to the control side.
    Normally,
    /// The step was left out, or nobody was there.
    NotRun,
    /// On request, the agent shall be stuck now: the clock knows how.
    AskedToHang(u32),
}

impl Core {
    pub(crate) fn new(number: u32) -> (Core, Link) {
        let (change_in, changes) = ring(UNDER_WAY, false);
        let (answers, answer_out) = ring(UNDER_WAY, false);
        let door = Arc::new(Door::new());
        let running = Arc::new(Running::default());
        let turn = Arc::new(Turn::default());
        let core = Core {
            number,
            seats: Vec::new(),
            order: Vec::new(),
            ready: Box::default(),
            releases: BinaryHeap::with_capacity(SPARE_ALARMS),
            due: BinaryHeap::new(),
            cursor: 0,
            door: door.clone(),
            running: running.clone(),
            changes,
            turn: turn.clone(),
            answers,
            nanos_per_tick: os::nanos_per_tick(),
            checks: Checks::default(),
            stalls: 0,
        };
        (core, Link { changes: change_in, answers: answer_out, turn, given: 0, door, running })
    }

    /// When the next agent is due by the clock.
    pub(crate) fn next_release(&self) -> Time {
        self.releases.peek().map_or(Time::NEVER, |Reverse((time, _))| *time)
    }

    /// Whether nobody has rung, nobody is ready and nothing is due: most looks find that.
    #[inline]
    pub(crate) fn is_idle(&self, now: Time) -> bool {
        !self.door.is_rung() && self.next_release() > now && self.due.is_empty() && self.ready.is_empty()
    }

    /// Takes what others have rung for, and serves changes.
    pub(crate) fn look_at_door(&mut self, context: &Context, now: Time) {
        let bits = self.door.take();
        if bits == 0 {
            return;
        }
        for slot in 0..self.seats.len() as u32 {
            if bits & crate::door::bit_of(slot) != 0
                && let Some(seat) = &self.seats[slot as usize]
            {
                if seat.on.iter().any(|input| input.has_message()) {
                    self.ready.mark(slot);
                } else {
                    // Another one was there first.
                    self.rest_at_queues(slot, Rest::Ready);
                }
            }
        }
        if bits & CHANGES != 0 {
            self.serve_changes(context, now);
        }
    }

    /// Finds ready agents by looking into the mailboxes: after a hand-over, when nobody knows what was rung.
    pub(crate) fn find_ready(&mut self) {
        for slot in 0..self.seats.len() as u32 {
            if let Some(seat) = &self.seats[slot as usize]
                && seat.on.iter().any(|input| input.has_message())
            {
                self.ready.mark(slot);
            }
        }
    }

    /// The agent that runs next: of those that are due the one with the earliest deadline, else the next one in data-flow order
    /// that a message made ready. Agents made ready behind the cursor wait for the next sweep.
    pub(crate) fn next(&mut self, now: Time) -> Option<Job> {
        self.collect_due(now);
        if let Some(Reverse((deadline, rank, slot, release))) = self.due.pop() {
            self.ready.clear(rank);
            return Some(Job { slot, release, deadline });
        }
        loop {
            let rank = self.ready.next(self.cursor).or_else(|| self.ready.next(0))?;
            self.ready.clear(rank);
            self.cursor = rank + 1;
            let slot = self.order[rank as usize];
            let Some(seat) = self.seats[slot as usize].as_mut() else { continue };
            let earliest = seat.last_step.saturating_add(seat.timing.min_gap);
            if seat.timing.min_gap > Duration::ZERO && earliest > now {
                // One entry for all messages until then.
                if seat.put_off != earliest {
                    seat.put_off = earliest;
                    self.push_release(earliest, slot);
                }
                self.rest_at_queues(slot, Rest::Away);
                continue;
            }
            return Some(Job { slot, release: now, deadline: now.saturating_add(seat.timing.deadline) });
        }
    }

    fn collect_due(&mut self, now: Time) {
        while let Some(Reverse((time, slot))) = self.releases.peek().copied() {
            if time > now {
                return;
            }
            self.releases.pop();
            let Some(seat) = self.seats.get_mut(slot as usize).and_then(Option::as_mut) else { continue };
            let mut release = None;
            if seat.next_release <= now {
                // Releases that were passed over are counted and never made up for: no burst.
                let period = seat.timing.period;
                let passed = (now - seat.next_release).0 / period.0.max(1);
                let stats = &seat.stats;
                stats.skipped.store(stats.skipped.load(Ordering::Relaxed) + passed as u64, Ordering::Relaxed);
                let due = seat.next_release + period * passed;
                seat.next_release = due + period;
                release = Some(due);
                let next = seat.next_release;
                self.push_release(next, slot);
            }
            let Some(seat) = self.seats.get_mut(slot as usize).and_then(Option::as_mut) else { continue };
            if seat.alarm <= now {
                release = release.or(Some(seat.alarm));
                seat.alarm = Time::NEVER;
            }
            if seat.put_off <= now {
                let put_off = core::mem::replace(&mut seat.put_off, Time::NEVER);
                if release.is_none() && seat.lost_to_others() {
                    self.rest_at_queues(slot, Rest::Ready);
                    continue;
                }
                release = release.or(Some(put_off));
            }
            if let Some(release) = release
                && let Some(rank) = self.ready.rank_of(slot)
                && !self.due.iter().any(|Reverse((_, _, known, _))| *known == slot)
            {
                let deadline = release.saturating_add(seat.timing.deadline);
                self.due.push(Reverse((deadline, rank, slot, release)));
            }
        }
    }

    fn push_release(&mut self, time: Time, slot: u32) {
        if self.releases.len() == self.releases.capacity() {
            // Entries for which no seat waits any more are of no use; what is left has room.
            let seats = &self.seats;
            self.releases.retain(|Reverse((time, slot))| {
                seats
                    .get(*slot as usize)
                    .and_then(Option::as_ref)
                    .is_some_and(|seat| [seat.next_release, seat.alarm, seat.put_off].contains(time))
            });
        }
        self.releases.push(Reverse((time, slot)));
    }

    /// Runs one step. `now` is the time that the agent sees. On the wall clock, where there is a stopwatch, time goes on while it
    /// runs; in simulated time it takes none.
    ///
    /// # Safety
    /// `core` is valid and owned by the calling thread. `still_mine` says after the step whether that is so: if not, the core
    /// was handed to another thread meanwhile and is not touched any more.
    pub(crate) unsafe fn run(
        core: *mut Core,
        context: &Context,
        job: Job,
        now: Time,
        watch: Option<&Stopwatch<'_>>,
        still_mine: impl FnOnce() -> bool,
    ) -> Option<Ended> {
        let read = || watch.map_or_else(Reading::of_time, Stopwatch::read);
        let entered = allocations::so_far();
        let (body, mut step, checked, begun) = {
            // SAFETY: the caller owns the core; this borrow ends before the step.
            let core = unsafe { &mut *core };
            let Some(seat) = core.seats.get_mut(job.slot as usize).and_then(Option::as_mut) else {
                return Some(Ended::NotRun);
            };
            if seat.body.is_none() {
                return Some(Ended::NotRun);
            }
            bump(&seat.stats.releases);
            match seat.fault {
                StepFault::None | StepFault::Panic => {}
                StepFault::Off => return Some(core.left_out(job.slot)),
                StepFault::Slow if !seat.stats.releases.load(Ordering::Relaxed).is_multiple_of(4) => {
                    return Some(core.left_out(job.slot));
                }
                StepFault::Slow => {}
                StepFault::Hang => {
                    seat.fault = StepFault::None;
                    // Nobody counts on it any more, as on one that is in a step.
                    for input in &seat.on {
                        input.begin_step();
                    }
                    core.running.limit.store(seat.timing.hang_after.0 as u64, Ordering::Relaxed);
                    return Some(Ended::AskedToHang(job.slot));
                }
            }
            let Some(body) = seat.body.take() else { return Some(Ended::NotRun) };
            seat.last_step = now;
            seat.put_off = Time::NEVER;
            seat.stats.jitter.add(nanos(now - job.release));
            let (seat_id, seat_limit) = (seat.id, seat.timing.hang_after);
            let step = Step { now, deadline: job.deadline, agent: seat.id, period: seat.timing.period };
            context.begin(seat.id, now, core.number, &*core.ready);
            let checked = watch.and_then(|_| core.checks.begin(now));
            let begun = read();
            core.running.limit.store(seat_limit.0 as u64, Ordering::Relaxed);
            core.running.since.store(begun.ticks, Ordering::Relaxed);
            core.running.agent.store(seat_id.0, Ordering::Relaxed);
            core.running.begin(job.slot);
            (body, step, checked, begun)
        };
        let (first, panics, taken) = {
            // SAFETY: as above.
            let core = unsafe { &mut *core };
            let seat = core.seats[job.slot as usize].as_mut()?;
            let first = !core::mem::replace(&mut seat.started, true);
            let panics = seat.fault == StepFault::Panic;
            if panics {
                seat.fault = StepFault::None;
            }
            (first, panics, seat.on.iter().map(|input| input.begin_step()).sum::<u64>())
        };
        // SAFETY: as above. The figures are shared with the watchdog's side and outlive the core, whoever has it.
        let running = unsafe { &*Arc::as_ptr(&(*core).running) };
        let mut body = Some(body);
        let before = allocations::so_far();
        // A step that panics takes memory for that, and a start may; neither counts.
        let mut in_step = 0;
        let result = catch_unwind(AssertUnwindSafe(|| {
            if panics {
                panic!("asked to panic");
            }
            let Some(body) = body.as_mut() else { return Ok(()) };
            if first {
                body.start(&mut step)?;
            }
            let before = allocations::so_far();
            let result = body.step(&mut step);
            in_step = allocations::so_far() - before;
            result
        }));
        let after = allocations::so_far();
        let ended = read();
        // First the step is published as ended, then it is asked whose the core is: the watchdog does it the other way round,
        // with a barrier on all processors between, so that one of the two sees the other.
        running.end();
        light_barrier();
        if !still_mine() {
            // The watchdog gave the agent up; what it left behind is freed here, on a thread that has lost its priority.
            return None;
        }
        // SAFETY: the core is still this thread's.
        let core = unsafe { &mut *core };
        let spent = Spent {
            elapsed: begun.elapsed(&ended),
            others: begun.others(&ended),
            thread: checked.map(|before| os::thread_time().saturating_sub(before)),
            allocations: in_step,
        };
        let alarm = context.end();
        core.end(context, job, now, result, body, alarm, taken, spent, watch);
        core.note_allocations((before - entered) + (allocations::so_far() - after));
        Some(Ended::Normally)
    }

    #[allow(clippy::too_many_arguments)]
    fn end(
        &mut self,
        context: &Context,
        job: Job,
        now: Time,
        result: Result<Result<(), Fault>, Box<dyn Any + Send>>,
        mut body: Option<Box<dyn Body>>,
        alarm: Time,
        taken: u64,
        spent: Spent,
        watch: Option<&Stopwatch<'_>>,
    ) {
        let took = (spent.elapsed as f64 * self.nanos_per_tick) as u64;
        let Some(seat) = self.seats.get_mut(job.slot as usize).and_then(Option::as_mut) else { return };
        let end = if watch.is_some() { now + Duration(took as i64) } else { now };
        let stalls = watch.map_or(0, |watch| watch.witness.stalls());
        // A step in which the processor stood still says nothing of how long it takes.
        let stalled = stalls != self.stalls && {
            self.stalls = stalls;
            watch.is_some_and(|watch| watch.witness.saw_stall(now, end))
        };
        if stalled {
            bump(&seat.stats.left_out);
        } else {
            let own = match spent.others {
                0 => took,
                others => took.saturating_sub((others as f64 * self.nanos_per_tick) as u64),
            };
            seat.stats.exec.add(own);
            if let Some(used) = spent.thread {
                seat.stats.check(agrees(own, used));
            }
        }
        if spent.allocations > 0 {
            bump_by(&seat.stats.allocations, spent.allocations);
        }
        seat.stats.response.add(nanos(end - job.release));
        if end > job.deadline {
            bump(&seat.stats.missed);
            if watch.is_some_and(|watch| watch.witness.saw_stall(job.release, end)) {
                bump(&seat.stats.stalled);
            }
        }
        let cause = match result {
            Ok(Ok(())) => None,
            Ok(Err(fault)) => {
                bump(&seat.stats.faults);
                Some(RawCause::Fault(fault))
            }
            Err(payload) => {
                bump(&seat.stats.panics);
                Some(RawCause::Panic(context.panic_record(), payload))
            }
        };
        if let Some(cause) = cause {
            let id = seat.id;
            self.rest(job.slot, Rest::Away);
            self.answer(Answer::Died { slot: job.slot, id, time: end, cause, body: body.take() });
            return;
        }
        seat.body = body;
        if alarm < seat.alarm {
            seat.alarm = alarm;
            self.push_release(alarm, job.slot);
        }
        let Some(seat) = self.seats[job.slot as usize].as_ref() else { return };
        // What came meanwhile makes it run again; but an agent that does not take its messages is not run for them for ever.
        let took_some = seat.on.iter().map(|input| input.taken()).sum::<u64>() != taken;
        self.rest(job.slot, Rest::Stepped(took_some));
    }

    /// Takes an agent that does not come back from its step for dead. Its body is lost to the step; in simulated time it is
    /// still here, and goes to the control side.
    pub(crate) fn give_up(&mut self, slot: u32, now: Time) {
        let Some(seat) = self.seats.get_mut(slot as usize).and_then(Option::as_mut) else { return };
        bump(&seat.stats.hangs);
        let died =
            Answer::Died { slot, id: seat.id, time: now, cause: RawCause::Hang, body: seat.body.take() };
        self.answer(died);
    }
}
