//! One step of an agent, and what is counted of it.
//!
//! The step is the only foreign code, and while it runs nobody holds a reference into the core: a thread that does not come back from it
//! has lost the core to another. The end of a step is the beginning of the next: the clock is read once for both.

#![allow(unsafe_code)]

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

use types::Time;

use super::{Answer, Core, Ended, Job, RawCause, Seat, StepFault};
use crate::agent::{Body, Fault, Step};
use crate::allocations;
use crate::context::Context;
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
}

impl Core {
    /// Runs one step, which begins at `at`; afterwards `at` is its end. On the wall clock, where there is a stopwatch, time goes on while
    /// it runs; in simulated time it takes none. Nothing when the core was handed to another thread meanwhile.
    ///
    /// # Safety
    /// `core` is valid and owned by the calling thread. `still_mine` says after the step whether that is so: if not, the core
    /// is not touched any more.
    #[inline]
    pub(crate) unsafe fn run(
        core: *mut Core,
        context: &Context,
        job: Job,
        at: &mut Moment,
        watch: Option<&Stopwatch<'_>>,
        still_mine: impl FnOnce() -> bool,
    ) -> Option<Ended> {
        let entered = allocations::so_far();
        let begun = *at;
        let (seat, mut body, mut step, special, checked, running) = {
            // SAFETY: the caller owns the core; this borrow ends before the step.
            let core = unsafe { &mut *core };
            let Some(seat) = core.seats.get_mut(job.slot as usize).and_then(Option::as_deref_mut) else {
                return Some(Ended::NotRun);
            };
            let running = &*core.running;
            let Some(body) = seat.body.take() else { return Some(Ended::NotRun) };
            bump(&seat.stats.releases);
            let mut special = Special::Nothing;
            if seat.fault != StepFault::None || !seat.started {
                special = match seat.prepare(job.slot) {
                    Ok(special) => special,
                    Err(ended) => {
                        seat.body = Some(body);
                        running.limit.store(seat.timing.hang_after.0 as u64, Ordering::Relaxed);
                        core.not_made(job.slot, &ended);
                        return Some(ended);
                    }
                };
            }
            seat.last_step = begun.time;
            seat.put_off = Time::NEVER;
            if job.by_clock {
                seat.stats.jitter.add(nanos(begun.time - job.release));
            }
            let step =
                Step { now: begun.time, deadline: job.deadline, agent: seat.id, period: seat.timing.period };
            context.begin(seat.id, begun.time, core.number);
            if seat.serves {
                seat.begin_serving();
            }
            let checked = watch.and_then(|_| core.checks.begin(begun.time));
            running.limit.store(seat.timing.hang_after.0 as u64, Ordering::Relaxed);
            running.since.store(begun.reading.ticks, Ordering::Relaxed);
            running.agent.store(seat.id.0, Ordering::Relaxed);
            running.begin(job.slot);
            (&raw mut *seat, body, step, special, checked, &raw const *running)
        };
        let before = allocations::so_far();
        // A step that panics takes memory for that, and a start may; neither counts.
        let mut in_start = 0;
        let result = catch_unwind(AssertUnwindSafe(|| {
            let result = match special {
                Special::Nothing => body.step(&mut step),
                special => unusual(special, body.as_mut(), &mut step, before, &mut in_start),
            };
            match result {
                Ok(()) => true,
                Err(fault) => {
                    context.set_fault(fault);
                    false
                }
            }
        }));
        let after = allocations::so_far();
        *at = match watch {
            Some(watch) => {
                let now = watch.moment();
                Moment { time: now.time.max(begun.time), ..now }
            }
            None => Moment::simulated(begun.time),
        };
        // First the step is published as ended, then it is asked whose the core is: the watchdog does it the other way round,
        // with a barrier on all processors between, so that one of the two sees the other.
        // SAFETY: the words are shared with the watchdog's side and outlive the core, whoever has it.
        unsafe { (*running).end() };
        light_barrier();
        if !still_mine() {
            // The watchdog gave the agent up; what it left behind is freed here, on a thread that has lost its priority.
            return None;
        }
        // SAFETY: the core is still this thread's, and so its seats are where they were: they change only between steps.
        let (core, seat) = unsafe { (&mut *core, &mut *seat) };
        let alarm = context.end();
        core.mark_woken(context);
        core.account(context, seat, job, begun, *at, checked, watch);
        let used = after - before - in_start;
        if !matches!(result, Ok(true)) {
            core.died(context, job.slot, at.time, result, body, used);
            return Some(Ended::Normally);
        }
        if used > 0 {
            bump_by(&seat.stats.allocations, used);
        }
        seat.body = Some(body);
        if alarm < seat.alarm {
            seat.alarm = alarm;
            core.push_release(alarm, job.slot);
        }
        // What came meanwhile makes it run again; but an agent that does not take its messages is not run for them for ever.
        let (mut took, mut left) = (false, false);
        for input in &seat.on {
            let settled = input.settle();
            took |= settled.took;
            left |= settled.left;
        }
        if seat.serves {
            core.rest(job.slot, Rest::Stepped(took));
        } else if took && left {
            core.ready.mark(job.slot);
        }
        core.note_allocations((before - entered) + (allocations::so_far() - after));
        Some(Ended::Normally)
    }

    /// Makes those ready to whom messages went.
    #[inline]
    pub(super) fn mark_woken(&mut self, context: &Context) {
        match context.take_woken() {
            Some(slots) => slots.iter().for_each(|slot| self.ready.mark(slot.get())),
            None => self.find_ready(),
        }
    }

    /// Counts a step.
    #[inline]
    #[allow(clippy::too_many_arguments)]
    fn account(
        &mut self,
        context: &Context,
        seat: &Seat,
        job: Job,
        begun: Moment,
        ended: Moment,
        checked: Option<u64>,
        watch: Option<&Stopwatch<'_>>,
    ) {
        let took = scaled(begun.reading.elapsed(&ended.reading), self.rate);
        let others = begun.reading.others(&ended.reading);
        let stalls = watch.map_or(0, |watch| watch.witness.stalls());
        if !job.by_clock && others == 0 && stalls == self.stalls && checked.is_none() {
            // It began when it was released, and nobody interrupted it: what it used is what it took.
            seat.stats.undisturbed.add(took);
        } else {
            let own = took.saturating_sub(scaled(others, self.rate));
            self.account_disturbed(seat, job, begun, ended, own, stalls, checked, watch);
        }
        if ended.time > job.deadline {
            // In simulated time a step takes none.
            let own = watch.map_or(0, |_| took.saturating_sub(scaled(others, self.rate)));
            missed(context, seat, job, begun, ended, own, watch);
        }
    }

    #[allow(clippy::too_many_arguments)]
    #[inline(never)]
    fn account_disturbed(
        &mut self,
        seat: &Seat,
        job: Job,
        begun: Moment,
        ended: Moment,
        own: u64,
        stalls: u64,
        checked: Option<u64>,
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
            if let Some(before) = checked {
                stats.check(agrees(own, os::thread_time().saturating_sub(before)));
            }
        }
        stats.response.add(nanos(ended.time - job.release));
    }

    #[cold]
    fn died(
        &mut self,
        context: &Context,
        slot: u32,
        time: Time,
        result: Result<bool, Box<dyn Any + Send>>,
        body: Box<dyn Body>,
        allocations: u64,
    ) {
        let Some(seat) = self.seats.get_mut(slot as usize).and_then(Option::as_deref_mut) else { return };
        let cause = match result {
            Ok(_) => {
                bump(&seat.stats.faults);
                if allocations > 0 {
                    bump_by(&seat.stats.allocations, allocations);
                }
                RawCause::Fault(context.take_fault().unwrap_or(Fault::new("it did not say what")))
            }
            Err(payload) => {
                bump(&seat.stats.panics);
                RawCause::Panic(context.panic_record(), payload)
            }
        };
        let (id, serves) = (seat.id, seat.serves);
        if serves {
            self.rest(slot, Rest::Away);
        }
        self.answer(Answer::Died { slot, id, time, cause, body: Some(body) });
    }
}

impl Seat {
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
            StepFault::None | StepFault::Panic | StepFault::Slow => {}
        }
        let first = !core::mem::replace(&mut self.started, true);
        if self.fault == StepFault::Panic {
            self.fault = StepFault::None;
            return Ok(Special::Panic);
        }
        Ok(if first { Special::Start } else { Special::Nothing })
    }
}

#[cold]
fn unusual(
    special: Special,
    body: &mut dyn Body,
    step: &mut Step,
    before: u64,
    in_start: &mut u64,
) -> Result<(), Fault> {
    if special == Special::Panic {
        panic!("asked to panic");
    }
    body.start(step)?;
    *in_start = allocations::so_far() - before;
    body.step(step)
}

/// Counts a step that ended behind its deadline, and notes in the log what was to blame: the greatest part of what it took from its release
/// on. `own` is what it used of its processor (ns).
#[cold]
fn missed(
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
