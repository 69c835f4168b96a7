//! The steps of agents, and what is counted of them.
//!
//! A step is the only foreign code, and while it runs nobody holds a reference into the core: a thread that does not come back from it
//! has lost the core to another. The end of a step is the beginning of the next: the clock is read once for both. And as long as one
//! step makes the next one ready, and nothing else is to be done between the two, one guard against panics stands around all of them.

#![allow(unsafe_code)]

use std::any::Any;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::ptr::NonNull;
use std::sync::Arc;

use types::Time;
use types::header::Quality;

use super::{Answer, Core, Ended, HEAVY, Job, RawCause, Seat, StepFault};
use crate::agent::{Body, Fault, Step};
use crate::allocations;
use crate::context::Context;
use crate::door::Door;
use crate::handover::Running;
use crate::means::{Means, Refining};
use crate::os;
use crate::port::Rest;
use crate::processor::{Moment, Stopwatch, agrees, scaled};
use crate::stats::{bump, bump_by, nanos};
use crate::sync::{Ordering, light_barrier};

/// What a step needs besides what every step does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Special {
    Nothing,
    /// It is the agent's first.
    Start,
    /// It panics on request.
    Panic,
    /// It takes longer than it needs, on request: several times as long, or as long as is declared.
    Longer,
}

/// How long a step is to take that takes longer than it needs.
#[derive(Clone, Copy, Debug, Default)]
struct Longer {
    /// What is declared for it, and for a refinement of it (ns); zero where it takes what it takes.
    declared: u64,
    refinement: u64,
    /// How many times that.
    times: u64,
}

/// The step that is being made, as a thread knows it that has perhaps lost the core.
struct Turn {
    job: Job,
    step: Step,
    /// The body in the seat. It is whose the seat is, unless the step was given up: then it is left to this thread.
    body: Option<NonNull<dyn Body>>,
    /// What the thread's clock said, where this step is held against it.
    checked: Option<u64>,
    /// How often the steps took or freed memory, and how often a start did, which may.
    foreign: u64,
    in_start: u64,
    longer: Longer,
}

impl Turn {
    /// Frees what a step that was given up leaves behind, on a thread that has lost its priority.
    ///
    /// # Safety
    /// The step was given up, so nobody else has its body.
    #[cold]
    unsafe fn free(&mut self) {
        if let Some(body) = self.body.take() {
            // SAFETY: it came out of a box, which was forgotten when the step was given up.
            drop(unsafe { Box::from_raw(body.as_ptr()) });
        }
    }
}

impl Core {
    /// Runs a step, which begins at `at`; afterwards `at` is the end of the last step. On the wall clock, where there is a stopwatch, time
    /// goes on while it runs, and further steps follow until something else is to be done; in simulated time it is one step, which
    /// takes none. Nothing when the core was handed to another thread meanwhile.
    ///
    /// # Safety
    /// `core` is valid and owned by the calling thread. `still_mine` says after a step whether that is so: if not, the core
    /// is not touched any more.
    #[inline(always)]
    pub(crate) unsafe fn run(
        core: *mut Core,
        context: &Context,
        job: Job,
        at: &mut Moment,
        watch: Option<&Stopwatch<'_>>,
        still_mine: impl Fn() -> bool,
    ) -> Option<Ended> {
        let before = allocations::so_far();
        // SAFETY: the caller owns the core; the borrow ends in this line.
        context.enter_executor(unsafe { (*core).number });
        let step = Step {
            now: at.time,
            deadline: job.deadline,
            agent: types::AgentId::NONE,
            period: types::Duration::ZERO,
            method: 0,
            refining: Refining::NONE,
        };
        let mut turn =
            Turn { job, step, body: None, checked: None, foreign: 0, in_start: 0, longer: Longer::default() };
        // SAFETY: the caller owns the core, and others keep this, too, for as long as the thread lives; the borrow ends in this line.
        let running: &Running = unsafe { &*Arc::as_ptr(&(*core).running) };
        // SAFETY: as the caller promises.
        let steps = || unsafe { Core::steps(core, context, &mut turn, at, watch, running, &still_mine) };
        let ended = match catch_unwind(AssertUnwindSafe(steps)) {
            Ok(ended) => ended,
            Err(payload) => {
                if !context.is_in_step() {
                    // It is no agent's fault.
                    resume_unwind(payload);
                }
                // A step that panics takes memory for that; it does not count.
                turn.foreign = allocations::so_far() - before;
                // SAFETY: as the caller promises.
                unsafe { Core::panicked(core, context, &mut turn, at, watch, running, &still_mine, payload) }
            }
        };
        if ended.is_some() {
            // SAFETY: the core is still this thread's.
            unsafe { &*core }.note_allocations(allocations::so_far() - before - turn.foreign);
        }
        ended
    }

    /// Makes steps until something else is to be done.
    ///
    /// # Safety
    /// As for [`Core::run`].
    #[allow(clippy::too_many_arguments)]
    #[inline(always)]
    unsafe fn steps(
        core: *mut Core,
        context: &Context,
        turn: &mut Turn,
        at: &mut Moment,
        watch: Option<&Stopwatch<'_>>,
        running: &Running,
        still_mine: &impl Fn() -> bool,
    ) -> Option<Ended> {
        // SAFETY: the caller owns the core, and others keep its door, too; the borrow ends in this line.
        let door: &Door = unsafe { &*Arc::as_ptr(&(*core).door) };
        let mut count = running.count();
        loop {
            let begun = *at;
            count = count.wrapping_add(1);
            // SAFETY: the core is this thread's; the borrow ends before the step.
            let (seat, mut body, special) =
                match unsafe { &mut *core }.begin(context, turn, begun, watch, running, count) {
                    Ok(begun) => begun,
                    Err(ended) => return Some(ended),
                };
            let before = allocations::so_far();
            // SAFETY: the body is used by this thread alone until the step is over.
            let body = unsafe { body.as_mut() };
            let result = match special {
                Special::Nothing => body.step(&mut turn.step),
                special => unusual(special, body, turn, before, watch.is_some()),
            };
            let used = allocations::so_far() - before;
            *at = now(watch, begun);
            // First the step is published as ended, then it is asked whose the core is: the watchdog does it the other way round,
            // with a barrier on all processors between, so that one of the two sees the other.
            running.end(count);
            light_barrier();
            if !still_mine() {
                // SAFETY: the step was given up.
                unsafe { turn.free() };
                return None;
            }
            // SAFETY: the core is still this thread's, and so its seats are where they were: they change only between steps.
            let (core, seat) = unsafe { (&mut *core, &mut *seat) };
            let alarm = core.account(context, seat, turn, begun, *at, watch);
            if used > 0 {
                turn.foreign += used;
                bump_by(&seat.stats.allocations, used - core::mem::take(&mut turn.in_start));
            }
            if let Err(fault) = result {
                core.reported(turn, at.time, fault);
                return Some(Ended::Normally);
            }
            if let Some(alarm) = alarm.and_then(|wish| seat.ask(wish, begun.time)) {
                core.push_release(alarm, turn.job.slot);
            }
            core.after_step(context, seat, turn.job.slot);
            let Some(watch) = watch else { return Some(Ended::Normally) };
            if door.is_rung() || watch.is_old(at) {
                return Some(Ended::Normally);
            }
            match core.next(at.time) {
                // Part by part: they stay in registers.
                Some(Job { slot, release, deadline, by_clock }) => {
                    turn.job.slot = slot;
                    turn.job.release = release;
                    turn.job.deadline = deadline;
                    turn.job.by_clock = by_clock;
                }
                None => return Some(Ended::Normally),
            }
        }
    }

    /// Begins a step, or says why there is none. Gives the seat, the body and what is special about the step.
    #[inline(always)]
    fn begin(
        &mut self,
        context: &Context,
        turn: &mut Turn,
        begun: Moment,
        watch: Option<&Stopwatch<'_>>,
        running: &Running,
        count: u32,
    ) -> Result<(*mut Seat, NonNull<dyn Body>, Special), Ended> {
        let slot = turn.job.slot;
        let Some(seat) = self.seats.get_mut(slot as usize).and_then(Option::as_deref_mut) else {
            return Err(Ended::NotRun);
        };
        let Some(body) = seat.body.as_deref_mut() else { return Err(Ended::NotRun) };
        let body = NonNull::from(body);
        bump(&seat.stats.releases);
        let mut special = Special::Nothing;
        if seat.fault != StepFault::None || !seat.started || seat.timing.means.fills {
            special = match seat.prepare(slot) {
                Ok(special) => {
                    turn.longer = seat.longer();
                    special
                }
                Err(ended) => {
                    running.limit.store(seat.timing.hang_after.0 as u64, Ordering::Relaxed);
                    self.not_made(slot, &ended);
                    return Err(ended);
                }
            };
        }
        seat.last_step = begun.time;
        seat.put_off = Time::NEVER;
        seat.ready_at = Time::NEVER;
        self.looked = begun.time;
        if turn.job.by_clock {
            seat.stats.jitter.add(nanos(begun.time - turn.job.release));
        }
        turn.step = Step {
            now: begun.time,
            deadline: turn.job.deadline,
            agent: seat.id,
            period: seat.timing.period,
            method: 0,
            refining: Refining::NONE,
        };
        turn.body = Some(body);
        context.begin(seat.id, begun.time);
        if !seat.timing.means.is_plain() {
            let clock = watch.map(|_| (begun.reading.ticks, self.rate));
            seat.choose(context, &mut turn.step, clock);
        }
        if seat.serves {
            seat.begin_serving();
        }
        turn.checked = watch.and_then(|_| self.checks.begin(begun.time));
        seat.in_step = true;
        running.limit.store(seat.timing.hang_after.0 as u64, Ordering::Relaxed);
        running.since.store(begun.reading.ticks, Ordering::Relaxed);
        running.agent.store(seat.id.0, Ordering::Relaxed);
        running.begin(count, slot);
        Ok((&raw mut *seat, body, special))
    }

    /// What came meanwhile makes the agent run again; but one that does not take its messages is not run for them for ever.
    #[inline(always)]
    fn after_step(&mut self, context: &Context, seat: &mut Seat, slot: u32) {
        let (step, left_open) = context.left_open();
        if left_open || seat.serves {
            self.settle(seat, slot, step);
        }
    }

    #[inline(never)]
    fn settle(&mut self, seat: &mut Seat, slot: u32, step: u64) {
        let (mut took, mut left) = (false, false);
        for input in &seat.on {
            let settled = input.settle(step);
            took |= settled.took;
            left |= settled.left;
        }
        if seat.serves {
            self.rest(slot, Rest::Stepped(took));
        } else if took && left {
            if self.dates {
                seat.date(seat.last_step);
            }
            self.ready.mark(slot);
        }
    }

    /// Makes those ready to whom messages went.
    #[inline(always)]
    pub(super) fn mark_woken(&mut self, context: &Context) {
        match context.take_woken() {
            Some([]) => {}
            Some([only]) => self.ready.mark(only.get()),
            Some(slots) => self.mark_all(slots),
            None => self.find_ready(),
        }
    }

    #[inline(never)]
    fn mark_all(&mut self, slots: &[Cell<u32>]) {
        slots.iter().for_each(|slot| self.ready.mark(slot.get()));
    }

    /// Ends a step, and counts it. Gives the time for which the agent asked to be woken.
    #[inline(always)]
    fn account(
        &mut self,
        context: &Context,
        seat: &mut Seat,
        turn: &Turn,
        begun: Moment,
        ended: Moment,
        watch: Option<&Stopwatch<'_>>,
    ) -> Option<Time> {
        seat.in_step = false;
        if context.quality() != Quality::FULL || turn.step.refining.count > 0 || seat.refined > 0 {
            seat.note_quality(context, turn, begun, ended, watch.is_some(), self.rate);
        }
        let alarm = context.end();
        self.mark_woken(context);
        if self.ready_since.is_some() {
            return alarm;
        }
        let took = match watch {
            Some(_) => nanos(ended.time - begun.time),
            // In simulated time a step takes none; what it took of the host's is counted.
            None => scaled(begun.reading.elapsed(&ended.reading), self.rate),
        };
        let others = begun.reading.others(&ended.reading);
        let stalls = watch.map_or(0, |watch| watch.witness.stalls());
        if !turn.job.by_clock
            && turn.job.release == begun.time
            && others == 0
            && stalls == self.stalls
            && turn.checked.is_none()
        {
            // It began when it was released, and nobody interrupted it: what it used is what it took.
            seat.stats.undisturbed.add(took);
        } else {
            let own = took.saturating_sub(scaled(others, self.rate));
            self.account_disturbed(seat, turn, begun, ended, own, stalls, watch);
        }
        if ended.time > turn.job.deadline {
            let own = watch.map_or(0, |_| took.saturating_sub(scaled(others, self.rate)));
            missed(context, seat, turn.job, begun, ended, own, watch);
        }
        alarm
    }

    #[allow(clippy::too_many_arguments)]
    #[inline(never)]
    fn account_disturbed(
        &mut self,
        seat: &Seat,
        turn: &Turn,
        begun: Moment,
        ended: Moment,
        own: u64,
        stalls: u64,
        watch: Option<&Stopwatch<'_>>,
    ) {
        let stats = &*seat.stats;
        // A step in which the processor stood still says nothing of how long it takes.
        let stalled = core::mem::replace(&mut self.stalls, stalls) != stalls
            && watch.is_some_and(|watch| watch.witness.saw_stall(begun.time, ended.time));
        if stalled {
            bump(&stats.left_out);
        } else {
            stats.exec.add(own);
            if let Some(before) = turn.checked {
                stats.check(agrees(own, os::thread_time().saturating_sub(before)));
            }
        }
        stats.response.add(nanos(ended.time - turn.job.release));
    }

    /// Its step said that it could not do its work.
    #[cold]
    fn reported(&mut self, turn: &Turn, time: Time, fault: Fault) {
        let Some(seat) = self.seats.get_mut(turn.job.slot as usize).and_then(Option::as_deref_mut) else {
            return;
        };
        bump(&seat.stats.faults);
        self.died(turn.job.slot, time, RawCause::Fault(fault));
    }

    /// A step has panicked.
    ///
    /// # Safety
    /// As for [`Core::run`].
    #[allow(clippy::too_many_arguments)]
    #[cold]
    #[inline(never)]
    unsafe fn panicked(
        core: *mut Core,
        context: &Context,
        turn: &mut Turn,
        at: &mut Moment,
        watch: Option<&Stopwatch<'_>>,
        running: &Running,
        still_mine: &dyn Fn() -> bool,
        payload: Box<dyn Any + Send>,
    ) -> Option<Ended> {
        let begun = *at;
        *at = now(watch, begun);
        running.end(running.count());
        light_barrier();
        if !still_mine() {
            // SAFETY: the step was given up.
            unsafe { turn.free() };
            return None;
        }
        // SAFETY: the core is still this thread's.
        let core = unsafe { &mut *core };
        let slot = turn.job.slot;
        if let Some(seat) =
            core.seats.get_mut(slot as usize).and_then(Option::as_deref_mut).map(|seat| &raw mut *seat)
        {
            // SAFETY: a seat stands in a box of its own, and what is counted of its step needs the others and not itself.
            let seat = unsafe { &mut *seat };
            core.account(context, seat, turn, begun, *at, watch);
            bump(&seat.stats.panics);
        }
        core.died(slot, at.time, RawCause::Panic(context.panic_record(), payload));
        Some(Ended::Normally)
    }

    fn died(&mut self, slot: u32, time: Time, cause: RawCause) {
        let Some(seat) = self.seats.get_mut(slot as usize).and_then(Option::as_deref_mut) else { return };
        let (id, serves, body) = (seat.id, seat.serves, seat.body.take());
        if serves {
            self.rest(slot, Rest::Away);
        }
        self.answer(Answer::Died { slot, id, time, cause, body });
    }
}

/// The present: the end of a step that began at `begun`.
#[inline(always)]
fn now(watch: Option<&Stopwatch<'_>>, begun: Moment) -> Moment {
    match watch {
        Some(watch) => {
            let now = watch.moment();
            Moment { time: now.time.max(begun.time), ..now }
        }
        None => Moment::simulated(begun.time),
    }
}

impl Seat {
    /// The body of an agent that is given up, unless a step is using it: then it is left to the thread that is in that step.
    pub(super) fn leave_behind(&mut self) -> Option<Box<dyn Body>> {
        if core::mem::take(&mut self.in_step) {
            // Written over, and not even moved: it is in use.
            // SAFETY: the place is valid; what was in it goes to that thread.
            unsafe { core::ptr::write(&raw mut self.body, None) };
        }
        self.body.take()
    }

    /// Notes since when messages wait for it: since they were stamped, but no longer than since a time at which they were not there.
    #[inline(never)]
    pub(super) fn date(&mut self, looked: Time) {
        let oldest = self.on.iter().filter_map(|input| input.oldest()).min();
        if let Some(oldest) = oldest {
            self.ready_at = self.ready_at.min(oldest.max(looked));
        }
    }

    /// How long a step takes that takes longer than it needs.
    fn longer(&self) -> Longer {
        let Means { cost, refinement, fills, .. } = self.timing.means;
        let times = if self.fault == StepFault::Heavy { HEAVY as u64 } else { 1 };
        let of = |span| if fills { nanos(span) } else { 0 };
        Longer { declared: of(cost), refinement: of(refinement), times }
    }

    /// Says how the step shall be done, and for how long.
    #[inline(never)]
    fn choose(&self, context: &Context, step: &mut Step, clock: Option<(u64, u64)>) {
        let mut means = self.timing.means;
        if self.fault == StepFault::Heavy {
            (means.cost, means.refinement) = (means.cost * HEAVY, means.refinement * HEAVY);
        }
        step.method = usize::from(means.method);
        // Where steps take what is declared, so do refinements.
        let clock = clock.filter(|_| !means.fills);
        step.refining = Refining::of(&means, step.now, step.deadline, clock);
        context.set_quality(means.quality);
    }

    /// Keeps what the step says of its result.
    #[inline(never)]
    fn note_quality(
        &mut self,
        context: &Context,
        turn: &Turn,
        begun: Moment,
        ended: Moment,
        on_the_wall: bool,
        rate: u64,
    ) {
        bump_by(&self.stats.quality_lost, u64::from(u8::MAX - context.quality().0));
        self.refined = turn.step.refining.count;
        bump_by(&self.stats.refinements, u64::from(self.refined));
        let own = scaled(begun.reading.own(&ended.reading), rate);
        if on_the_wall && self.refined > 0 && own > nanos(self.timing.means.budget) {
            bump(&self.stats.overruns);
        }
    }

    /// What is special about the step that comes; or the step is left out.
    #[cold]
    fn prepare(&mut self, slot: u32) -> Result<Special, Ended> {
        match self.fault {
            StepFault::Off => return Err(Ended::NotRun),
            StepFault::Slow if !self.stats.releases.load(Ordering::Relaxed).is_multiple_of(4) => {
                return Err(Ended::NotRun);
            }
            StepFault::Hang => {
                self.fault = StepFault::None;
                return Err(Ended::AskedToHang(slot));
            }
            StepFault::None | StepFault::Panic | StepFault::Slow | StepFault::Heavy => {}
        }
        let first = !core::mem::replace(&mut self.started, true);
        if self.fault == StepFault::Panic {
            self.fault = StepFault::None;
            return Ok(Special::Panic);
        }
        Ok(match self.fault {
            _ if first => Special::Start,
            StepFault::Heavy => Special::Longer,
            _ if self.timing.means.fills => Special::Longer,
            _ => Special::Nothing,
        })
    }
}

#[cold]
fn unusual(
    special: Special,
    body: &mut dyn Body,
    turn: &mut Turn,
    before: u64,
    on_the_wall: bool,
) -> Result<(), Fault> {
    if special == Special::Panic {
        panic!("asked to panic");
    }
    if special == Special::Longer {
        // Of the thread's own time: what others take meanwhile is not work.
        let begun = if on_the_wall { os::thread_time() } else { 0 };
        let done = body.step(&mut turn.step);
        let Longer { declared, refinement, times } = turn.longer;
        let used = || os::thread_time().saturating_sub(begun);
        let all = match declared {
            0 if on_the_wall => used() * times,
            _ => (declared + refinement * u64::from(turn.step.refining.count)) * times,
        };
        while on_the_wall && used() < all {
            core::hint::spin_loop();
        }
        return done;
    }
    let started = body.start(&mut turn.step);
    turn.in_start = allocations::so_far() - before;
    started?;
    body.step(&mut turn.step)
}

/// Counts a step that ended behind its deadline, and notes in the log what was to blame: the greatest part of what it took from its release
/// on. `own` is what it used of its processor (ns).
#[cold]
pub(super) fn missed(
    context: &Context,
    seat: &Seat,
    job: Job,
    begun: Moment,
    ended: Moment,
    own: u64,
    watch: Option<&Stopwatch<'_>>,
) {
    bump(&seat.stats.missed);
    let millis = |nanos: u64| nanos as f64 * 1e-6;
    let behind = millis(nanos(ended.time - job.deadline));
    let late = nanos(begun.time - job.release);
    let others = nanos(ended.time - begun.time).saturating_sub(own);
    let note = |text, numbers: &[f64]| {
        context.log(|log| log.note(ended.time, seat.id, text, numbers));
    };
    if watch.is_some_and(|watch| watch.witness.saw_stall(job.release, ended.time)) {
        bump(&seat.stats.stalled);
        note("missed its deadline by {} ms: a processor stood still", &[behind]);
    } else if late >= own.max(others) {
        note(
            "missed its deadline by {} ms: its step began {} ms late, behind others",
            &[behind, millis(late)],
        );
    } else if others > own {
        note(
            "missed its deadline by {} ms: higher executors took {} ms of its step",
            &[behind, millis(others)],
        );
    } else {
        note("missed its deadline by {} ms: its step took {} ms", &[behind, millis(own)]);
    }
}
