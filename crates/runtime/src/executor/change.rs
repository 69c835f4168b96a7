//! Changes of an executor: prepared on the control side, committed between two steps, and given back to be freed.

#![allow(unsafe_code)]

use std::any::Any;
use std::collections::BinaryHeap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use types::{AgentId, Duration, Time};

use super::{Core, Due, RawCause, Releases, SPARE_ALARMS, Seat, StepFault, Timing};
use crate::agent::{Body, Step};
use crate::allocations;
use crate::context::Context;
use crate::door::Door;
use crate::handover::Running;
use crate::means::Refining;
use crate::os;
use crate::port::{Envelope, InputEnd, OutputEnd, Rest, RouterEnd, Told, WireId};
use crate::ring;
use crate::stats::{bump, bump_by};
use crate::sync::{Ordering, light_barrier};

/// A change, prepared on the control side. It comes back as an answer, with what is to be freed in it.
///
/// Whatever touches an end of an agent, or the agent itself, says in which slot it sits: while the agent is lost in a step that does
/// not return, the thread that lost it may be using its ends, and nobody else may.
pub(crate) enum Change {
    Seat {
        slot: u32,
        seat: Option<Box<Seat>>,
    },
    Unseat {
        slot: u32,
        seat: Option<Box<Seat>>,
    },
    Order {
        order: Vec<u32>,
        ranks: Vec<u32>,
        words: Vec<u64>,
        room: Option<Box<Room>>,
    },
    Join {
        end: Arc<dyn InputEnd>,
        lanes: Box<dyn Any + Send>,
        slot: u32,
    },
    Leave {
        end: Arc<dyn InputEnd>,
        wire: WireId,
        into: Box<dyn Any + Send>,
        force: bool,
        slot: u32,
    },
    Route {
        end: Arc<dyn OutputEnd>,
        route: Box<dyn Any + Send>,
        slot: u32,
    },
    Forget {
        end: Arc<dyn OutputEnd>,
        wire: WireId,
        into: Box<dyn Any + Send>,
        slot: u32,
    },
    Body {
        slot: u32,
        body: Option<Box<dyn Body>>,
        /// Whether the new one takes over what the present one has learnt.
        hands_over: bool,
    },
    Params {
        slot: u32,
        params: Box<dyn Any + Send>,
    },
    Timing {
        slot: u32,
        timing: Timing,
    },
    Fault {
        slot: u32,
        fault: StepFault,
    },
    /// Makes an output misbehave, or behave again.
    OutputFault {
        end: Arc<dyn OutputEnd>,
        faulty: Box<dyn Any + Send>,
        slot: u32,
    },
    /// Sends a message that comes from outside, on the thread that owns the routes.
    Send {
        end: Arc<dyn OutputEnd>,
        message: Box<dyn Any + Send>,
        envelope: Envelope,
        slot: u32,
    },
    /// Tells an agent what the system is made of, and what was decided for it.
    Tell {
        end: Arc<RouterEnd>,
        told: Box<Told>,
        slot: u32,
    },
    /// Changes nothing: who asks knows that the executor answers.
    Nothing,
    /// Ends all agents.
    Stop,
}

/// Room for the agents of an executor, where they have become more than it had room for.
pub(crate) struct Room {
    seats: Vec<Option<Box<Seat>>>,
    releases: Releases,
    due: Due,
}

impl Room {
    pub(crate) fn of(agents: usize) -> Room {
        Room {
            seats: Vec::with_capacity(agents),
            releases: BinaryHeap::with_capacity(agents * 3 + SPARE_ALARMS),
            due: Due::with_capacity(agents + SPARE_ALARMS),
        }
    }

    /// Exchanges it for what an executor has. What was that goes back, to be freed elsewhere.
    fn exchange(&mut self, core: &mut Core) {
        self.seats.append(&mut core.seats);
        core::mem::swap(&mut self.seats, &mut core.seats);
        // One by one: `append` would exchange the two when this one is longer, and the room would go back.
        self.releases.extend(core.releases.drain());
        core::mem::swap(&mut self.releases, &mut core.releases);
        self.due.take_over(&mut core.due);
        core::mem::swap(&mut self.due, &mut core.due);
    }
}

impl Change {
    /// The slot of the agent whose ends or body it touches.
    fn touches(&self) -> Option<u32> {
        match self {
            Change::Join { slot, .. }
            | Change::Leave { slot, .. }
            | Change::Route { slot, .. }
            | Change::Forget { slot, .. }
            | Change::Body { slot, .. }
            | Change::Params { slot, .. }
            | Change::Timing { slot, .. }
            | Change::Fault { slot, .. }
            | Change::OutputFault { slot, .. }
            | Change::Send { slot, .. }
            | Change::Tell { slot, .. } => Some(*slot),
            // A seat is exchanged or taken away whole, and what is lost has left it.
            Change::Seat { .. }
            | Change::Unseat { .. }
            | Change::Order { .. }
            | Change::Nothing
            | Change::Stop => None,
        }
    }
}

/// What an executor tells the control side.
#[allow(clippy::large_enum_variant)] // what is known of a death comes without memory of its own
pub(crate) enum Answer {
    /// With the number of the change, as of the others.
    Done(u64, Change),
    /// The wire has messages still.
    NotDrained(u64, Change),
    /// It was not done, because the agent is lost, or died of it; or somebody was lost in it, and then it did not come back.
    Lost(u64, Option<Change>),
    Died {
        slot: u32,
        id: AgentId,
        time: Time,
        cause: RawCause,
        body: Option<Box<dyn Body>>,
    },
}

/// What became of a change.
enum Outcome {
    Done,
    NotDrained,
    Lost,
}

/// The control side's ends of an executor.
pub(crate) struct Link {
    pub(super) changes: ring::Sender<Option<(u64, Change)>>,
    pub(super) answers: ring::Receiver<Option<Answer>>,
    /// The number of the last change that was given.
    pub(super) given: u64,
    pub door: Arc<Door>,
    pub running: Arc<Running>,
}

impl Link {
    /// Whether there is room for a change: too many may be under way.
    pub(crate) fn has_room(&mut self) -> bool {
        self.changes.has_room()
    }

    /// Gives a change to the executor, which serves them in this order. Gives its number. There must be room.
    pub(crate) fn change(&mut self, change: Change) -> u64 {
        self.given += 1;
        let number = self.given;
        self.changes.push(|slot| *slot = Some((number, change)));
        number
    }

    /// The number of the change that was given last.
    pub(crate) fn last_given(&self) -> u64 {
        self.given
    }

    /// The next answer.
    pub(crate) fn answer(&mut self) -> Option<Answer> {
        if self.answers.advance() { self.answers.current_mut().take() } else { None }
    }
}

impl Core {
    /// Tells the control side. There is room: changes are served only while there is, and one agent dies once before the
    /// control side has taken the news and given it a successor.
    pub(super) fn answer(&mut self, answer: Answer) {
        if self.answers.has_room() {
            self.answers.push(|slot| *slot = Some(answer));
        } else {
            // Memory is not freed on this side.
            std::mem::forget(answer);
        }
    }

    /// Commits the changes that wait. Each goes back to the control side, to be freed there. False when the core was lost meanwhile
    /// to another thread, because somebody did not return from its stop.
    ///
    /// # Safety
    /// As for [`Core::run`].
    pub(crate) unsafe fn serve_changes(
        core: *mut Core,
        context: &Context,
        now: Time,
        still_mine: &dyn Fn() -> bool,
    ) -> bool {
        loop {
            // SAFETY: the caller owns the core; this borrow ends here.
            let Some((number, mut change)) = (unsafe { &mut *core }).next_change() else { return true };
            let before = allocations::so_far();
            // SAFETY: as the caller promises.
            let Some((outcome, foreign)) = (unsafe { commit(core, &mut change, context, now, still_mine) })
            else {
                // What is left of the change is freed here, on a thread that has lost its priority.
                return false;
            };
            // SAFETY: the core is still this thread's.
            let core = unsafe { &mut *core };
            core.changing = None;
            core.note_allocations(allocations::so_far() - before - foreign);
            core.answer(match outcome {
                Outcome::Done => Answer::Done(number, change),
                Outcome::NotDrained => Answer::NotDrained(number, change),
                Outcome::Lost => Answer::Lost(number, Some(change)),
            });
        }
    }

    /// The same where nobody can take the core over.
    pub(crate) fn serve_changes_here(&mut self, context: &Context, now: Time) {
        // SAFETY: the core is borrowed here, and nobody else takes it.
        unsafe { Core::serve_changes(self, context, now, &|| true) };
    }

    fn next_change(&mut self) -> Option<(u64, Change)> {
        if !self.answers.has_room() || !self.changes.advance() {
            return None;
        }
        let next = self.changes.current_mut().take();
        self.changing = next.as_ref().map(|(number, _)| *number);
        next
    }

    fn is_lost(&self, slot: u32) -> bool {
        self.seats.get(slot as usize).and_then(Option::as_ref).is_some_and(|seat| seat.lost)
    }

    #[inline]
    pub(super) fn note_allocations(&self, count: u64) {
        if count > 0 {
            bump_by(&self.running.allocations, count);
        }
    }

    /// Does what needs nobody else's code. False for a wire that still has messages: it is not cut yet.
    fn commit(&mut self, change: &mut Change, context: &Context, now: Time) -> bool {
        match change {
            Change::Seat { slot, seat } => {
                if self.seats.len() <= *slot as usize {
                    self.seats.resize_with(*slot as usize + 1, || None);
                }
                if let Some(mut new) = seat.take() {
                    self.due.forget(*slot);
                    if new.timing.period > Duration::ZERO && new.timing.means.is_active {
                        new.next_release = now;
                        self.push_release(now, *slot);
                    }
                    *seat = self.seats[*slot as usize].replace(new);
                    self.note_serving(*slot);
                }
            }
            Change::Order { order, ranks, words, room } => {
                self.ready.set_order(order, ranks, words);
                if let Some(room) = room {
                    room.exchange(self);
                }
            }
            Change::Join { end, lanes, slot } => {
                end.join(lanes.as_mut());
                if self.note_serving(*slot) {
                    self.rest_at_queues(*slot, Rest::Ready);
                }
            }
            Change::Leave { end, wire, into, force, slot } => {
                if !*force && !end.is_drained(*wire) {
                    return false;
                }
                end.leave(*wire, into.as_mut());
                self.note_serving(*slot);
            }
            Change::Route { end, route, .. } => end.add_route(route.as_mut()),
            Change::Forget { end, wire, into, .. } => end.forget(*wire, into.as_mut()),
            Change::Params { slot, params } => {
                let seat = self.seats.get_mut(*slot as usize).and_then(Option::as_mut);
                if let Some(body) = seat.and_then(|seat| seat.body.as_mut()) {
                    body.swap_params(params.as_mut());
                }
            }
            Change::Timing { slot, timing } => self.set_timing(*slot, *timing, now),
            Change::Fault { slot, fault } => {
                if let Some(seat) = self.seats.get_mut(*slot as usize).and_then(Option::as_mut) {
                    seat.fault = *fault;
                }
                self.rest_at_queues(*slot, Rest::Ready);
            }
            Change::OutputFault { end, faulty, .. } => end.set_fault(faulty.as_mut()),
            Change::Send { end, message, envelope, .. } => {
                context.enter_executor(self.number);
                context.begin(AgentId::NONE, now);
                end.send_prepared(envelope, message.as_ref());
                context.end();
                self.mark_woken(context);
            }
            Change::Tell { end, told, slot } => {
                end.tell(told);
                self.find_whether_ready(*slot);
            }
            // With agents that have a word in it: not here.
            Change::Nothing | Change::Unseat { .. } | Change::Body { .. } | Change::Stop => {}
        }
        true
    }

    fn set_timing(&mut self, slot: u32, timing: Timing, now: Time) {
        let Some(seat) = self.seats.get_mut(slot as usize).and_then(Option::as_mut) else { return };
        // A longer period holds at once, a shorter one from the next release on.
        let goes_on = timing.means.is_active && !seat.timing.means.is_active;
        let next = if timing.period <= Duration::ZERO || !timing.means.is_active {
            Time::NEVER
        } else if seat.next_release == Time::NEVER {
            now
        } else if timing.period > seat.timing.period {
            seat.next_release - seat.timing.period + timing.period
        } else {
            seat.next_release
        };
        seat.timing = timing;
        seat.next_release = next;
        if seat.put_off < Time::NEVER {
            // Whether it still has to wait is seen when it is looked at next.
            seat.put_off = Time::NEVER;
            self.ready.mark(slot);
        }
        // What it asked for: sooner or later than before, or while it was suspended.
        let alarm = seat.ask_anew(now, goes_on);
        if next < Time::NEVER {
            self.push_release(next, slot);
        }
        if let Some(alarm) = alarm {
            self.push_release(alarm, slot);
        }
        if goes_on {
            // What came before or while it was suspended.
            self.find_whether_ready(slot);
        }
    }
}

/// What happened, and how often agents took or freed memory in it; nothing when the core was lost.
type Committed = Option<(Outcome, u64)>;

/// Commits one change. While an agent's own code runs in it, nobody holds a reference into the core and the watchdog looks on, as in
/// a step.
///
/// # Safety
/// As for [`Core::run`].
unsafe fn commit(
    core: *mut Core,
    change: &mut Change,
    context: &Context,
    now: Time,
    still_mine: &dyn Fn() -> bool,
) -> Committed {
    let mut foreign = 0;
    let visit = Visit { core, context, now, still_mine };
    // SAFETY: the caller owns the core; this borrow ends here.
    if change.touches().is_some_and(|slot| unsafe { &*core }.is_lost(slot)) {
        return Some((Outcome::Lost, 0));
    }
    match change {
        Change::Unseat { slot, seat } => {
            // SAFETY: as above, and each borrow ends in its line.
            unsafe { visit.stop(*slot, &mut foreign) }?;
            // SAFETY: as above.
            let core = unsafe { &mut *core };
            *seat = core.seats.get_mut(*slot as usize).and_then(Option::take);
            core.due.forget(*slot);
        }
        Change::Body { slot, body, hands_over } => {
            // SAFETY: as above.
            let lives = unsafe { visit.put_body(*slot, body, *hands_over, &mut foreign) }?;
            return Some((if lives { Outcome::Done } else { Outcome::Lost }, foreign));
        }
        Change::Stop => {
            // SAFETY: as above.
            for slot in 0..unsafe { &*core }.seats.len() as u32 {
                // SAFETY: as above.
                unsafe { visit.stop(slot, &mut foreign) }?;
                // SAFETY: as above.
                if let Some(seat) = unsafe { &mut *core }.seats[slot as usize].as_deref_mut() {
                    // Nobody has a step after his stop, though messages may still come.
                    seat.at_rest = seat.body.take();
                }
            }
        }
        plain => {
            // SAFETY: as above.
            let done = unsafe { &mut *core }.commit(plain, context, now);
            return Some((if done { Outcome::Done } else { Outcome::NotDrained }, 0));
        }
    }
    Some((Outcome::Done, foreign))
}

/// An agent's own code between two steps.
struct Visit<'a> {
    core: *mut Core,
    context: &'a Context,
    now: Time,
    still_mine: &'a dyn Fn() -> bool,
}

impl Visit<'_> {
    /// Calls into the agent in a slot. Nothing when it did not return in time: then the core is another thread's.
    ///
    /// # Safety
    /// The core is this thread's, and what `work` uses is not in it.
    unsafe fn call(
        &self,
        slot: u32,
        foreign: &mut u64,
        work: &mut dyn FnMut(&mut Step),
    ) -> Option<std::thread::Result<()>> {
        let (mut step, running) = {
            // SAFETY: as the caller promises; this borrow ends before the agent's code.
            let core = unsafe { &mut *self.core };
            let Some(seat) = core.seats.get(slot as usize).and_then(Option::as_ref) else {
                return Some(Ok(()));
            };
            self.context.enter_executor(core.number);
            self.context.begin(seat.id, self.now);
            core.running.limit.store(seat.timing.hang_after.0 as u64, Ordering::Relaxed);
            core.running.since.store(os::ticks(), Ordering::Relaxed);
            core.running.agent.store(seat.id.0, Ordering::Relaxed);
            let step = Step {
                now: self.now,
                deadline: self.now,
                agent: seat.id,
                period: seat.timing.period,
                method: usize::from(seat.timing.means.method),
                refining: Refining::NONE,
            };
            // From here on the core may be another thread's.
            let running = Arc::as_ptr(&core.running);
            core.running.begin(core.running.count().wrapping_add(1), slot);
            (step, running)
        };
        let before = allocations::so_far();
        let result = catch_unwind(AssertUnwindSafe(|| work(&mut step)));
        *foreign += allocations::so_far() - before;
        // SAFETY: the figures outlive the core, whoever has it.
        let running = unsafe { &*running };
        running.end(running.count());
        // As at the end of a step.
        light_barrier();
        if !(self.still_mine)() {
            return None;
        }
        self.context.end();
        // SAFETY: the core is still this thread's.
        unsafe { &mut *self.core }.mark_woken(self.context);
        Some(result)
    }

    /// Stops the agent in a slot, if it has begun.
    ///
    /// # Safety
    /// As for [`Core::run`].
    unsafe fn stop(&self, slot: u32, foreign: &mut u64) -> Option<()> {
        let mut body = {
            // SAFETY: this borrow ends before the agent's code.
            let core = unsafe { &mut *self.core };
            let Some(seat) = core.seats.get_mut(slot as usize).and_then(Option::as_mut) else {
                return Some(());
            };
            if !core::mem::take(&mut seat.started) {
                return Some(());
            }
            let Some(body) = seat.body.take() else { return Some(()) };
            body
        };
        // SAFETY: the body is out of the core.
        let stopped = unsafe { self.call(slot, foreign, &mut |step| body.stop(step)) }?;
        // SAFETY: the core is still this thread's.
        let core = unsafe { &mut *self.core };
        if let Some(seat) = core.seats.get_mut(slot as usize).and_then(Option::as_mut) {
            if stopped.is_err() {
                bump(&seat.stats.panics);
            }
            seat.body = Some(body);
        }
        Some(())
    }

    /// Puts another instance in the place of the present one, which is stopped if it is alive. Says whether the new one lives: it can die
    /// of taking over.
    ///
    /// # Safety
    /// As for [`Core::run`].
    unsafe fn put_body(
        &self,
        slot: u32,
        body: &mut Option<Box<dyn Body>>,
        hands_over: bool,
        foreign: &mut u64,
    ) -> Option<bool> {
        let old = {
            // SAFETY: this borrow ends before the agent's code.
            let core = unsafe { &mut *self.core };
            let Some(seat) = core.seats.get_mut(slot as usize).and_then(Option::as_mut) else {
                return Some(true);
            };
            if hands_over { seat.body.take() } else { None }
        };
        let mut lives = true;
        if let (Some(mut old), Some(new)) = (old, body.as_mut()) {
            // SAFETY: both bodies are out of the core.
            let handed = unsafe { self.call(slot, foreign, &mut |_| new.take_over(&mut *old)) }?;
            // SAFETY: the core is still this thread's.
            let core = unsafe { &mut *self.core };
            if let Some(seat) = core.seats.get_mut(slot as usize).and_then(Option::as_mut) {
                seat.body = Some(old);
                if let Err(payload) = handed {
                    // The new one dies of it. The old one goes with it: what it knew may be half moved.
                    lives = false;
                    bump(&seat.stats.panics);
                    let cause = RawCause::Panic(self.context.panic_record(), payload);
                    let id = seat.id;
                    core.answer(Answer::Died { slot, id, time: self.now, cause, body: body.take() });
                }
            }
        }
        // SAFETY: as for this function.
        unsafe { self.stop(slot, foreign) }?;
        // SAFETY: the core is still this thread's.
        let core = unsafe { &mut *self.core };
        let Some(seat) = core.seats.get_mut(slot as usize).and_then(Option::as_mut) else {
            return Some(true);
        };
        core::mem::swap(&mut seat.body, body);
        seat.started = false;
        let has_message = seat.on.iter().any(|input| input.has_message());
        if seat.serves {
            let why = if seat.body.is_some() { Rest::Ready } else { Rest::Away };
            core.rest(slot, why);
        } else if has_message {
            core.ready.mark(slot);
        }
        Some(lives)
    }
}
