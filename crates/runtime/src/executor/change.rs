//! Changes of an executor: prepared on the control side, committed between two steps, and given back to be freed.

use std::any::Any;
use std::cmp::Reverse;
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
use crate::port::{Envelope, InputEnd, OutputEnd, Rest, WireId};
use crate::ring;
use crate::stats::{bump, bump_by};
use crate::turn::Turn;

/// A change, prepared on the control side. It comes back as an answer, with what is to be freed in it.
pub(crate) enum Change {
    Seat {
        slot: u32,
        seat: Option<Box<Seat>>,
        seats: Vec<Option<Box<Seat>>>,
        room: usize,
    },
    Unseat {
        slot: u32,
        seat: Option<Box<Seat>>,
    },
    Order {
        order: Vec<u32>,
        ranks: Vec<u32>,
        words: Vec<u64>,
        releases: Releases,
        due: Due,
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
    },
    Route {
        end: Arc<dyn OutputEnd>,
        route: Box<dyn Any + Send>,
    },
    Forget {
        end: Arc<dyn OutputEnd>,
        wire: WireId,
        into: Box<dyn Any + Send>,
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
    },
    /// Sends a message that comes from outside, on the thread that owns the routes.
    Send {
        end: Arc<dyn OutputEnd>,
        message: Box<dyn Any + Send>,
        envelope: Envelope,
    },
    /// Changes nothing: who asks knows that the executor answers.
    Nothing,
    /// Ends all agents.
    Stop,
}

/// Room in the heaps of an executor of this many agents, for [`Change::Order`].
pub(crate) fn heaps_for(agents: usize) -> (Releases, Due) {
    (BinaryHeap::with_capacity(agents * 3 + SPARE_ALARMS), BinaryHeap::with_capacity(agents + SPARE_ALARMS))
}

/// What an executor tells the control side.
pub(crate) enum Answer {
    /// With the number of the change.
    Done(u64, Change),
    NotDrained(u64, Change),
    /// It had been taken back before the executor came upon it.
    TakenBack(Change),
    Died {
        slot: u32,
        id: AgentId,
        time: Time,
        cause: RawCause,
        body: Option<Box<dyn Body>>,
    },
}

/// The control side's ends of an executor.
pub(crate) struct Link {
    pub(super) changes: ring::Sender<Option<(u64, Change)>>,
    pub(super) answers: ring::Receiver<Option<Answer>>,
    pub(super) turn: Arc<Turn>,
    /// The number of the last change that was given.
    pub(super) given: u64,
    pub door: Arc<Door>,
    pub running: Arc<Running>,
}

impl Link {
    /// Gives a change to the executor, unless too many are under way.
    pub(crate) fn change(&mut self, change: Change) -> bool {
        let has_room = self.changes.has_room();
        if has_room {
            self.given += 1;
            let number = self.given;
            self.changes.push(|slot| *slot = Some((number, change)));
        }
        has_room
    }

    /// The number of the change that was given last.
    pub(crate) fn last_given(&self) -> u64 {
        self.given
    }

    /// Takes the last change back. False when the executor has begun it: then its answer is on the way.
    pub(crate) fn take_back(&mut self) -> bool {
        self.turn.decide(self.given)
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

    /// Commits the changes that wait. Each goes back to the control side, to be freed there.
    pub(crate) fn serve_changes(&mut self, context: &Context, now: Time) {
        while self.answers.has_room() && self.changes.advance() {
            let Some((number, mut change)) = self.changes.current_mut().take() else { return };
            if !self.turn.decide(number) {
                self.answer(Answer::TakenBack(change));
                continue;
            }
            let before = allocations::so_far();
            let done = self.commit(&mut change, context, now);
            // An agent that is stopped may free what it likes.
            if !matches!(change, Change::Stop | Change::Unseat { .. } | Change::Body { .. }) {
                self.note_allocations(allocations::so_far() - before);
            }
            self.answer(if done { Answer::Done(number, change) } else { Answer::NotDrained(number, change) });
        }
    }

    #[inline]
    pub(super) fn note_allocations(&self, count: u64) {
        if count > 0 {
            bump_by(&self.running.allocations, count);
        }
    }

    /// Says whether it is done; a wire that still has messages is not cut yet.
    fn commit(&mut self, change: &mut Change, context: &Context, now: Time) -> bool {
        match change {
            Change::Seat { slot, seat, seats, room } => {
                if self.seats.capacity() < *room {
                    seats.append(&mut self.seats);
                    core::mem::swap(&mut self.seats, seats);
                }
                if self.seats.len() <= *slot as usize {
                    self.seats.resize_with(*slot as usize + 1, || None);
                }
                if let Some(mut new) = seat.take() {
                    if new.timing.period > Duration::ZERO {
                        new.next_release = now;
                        self.push_release(now, *slot);
                    }
                    *seat = self.seats[*slot as usize].replace(new);
                }
            }
            Change::Unseat { slot, seat } => {
                *seat = self.seats.get_mut(*slot as usize).and_then(Option::take);
                if let Some(seat) = seat {
                    self.stop_agent(seat, context, now);
                }
                self.due.retain(|Reverse((_, _, known, _))| *known != *slot);
            }
            Change::Order { order, ranks, words, releases, due } => {
                self.reorder(order, ranks, words);
                if releases.capacity() > self.releases.capacity() {
                    // One by one: `append` would exchange the two when this one is longer, and the room would go back.
                    releases.extend(self.releases.drain());
                    core::mem::swap(releases, &mut self.releases);
                }
                if due.capacity() > self.due.capacity() {
                    due.extend(self.due.drain());
                    core::mem::swap(due, &mut self.due);
                }
            }
            Change::Join { end, lanes, slot } => {
                end.join(lanes.as_mut());
                if end.serves() {
                    self.rest_at_queues(*slot, Rest::Ready);
                }
            }
            Change::Leave { end, wire, into, force } => {
                if !*force && !end.is_drained(*wire) {
                    return false;
                }
                end.leave(*wire, into.as_mut());
            }
            Change::Route { end, route } => end.add_route(route.as_mut()),
            Change::Forget { end, wire, into } => end.forget(*wire, into.as_mut()),
            Change::Body { slot, body, hands_over } => self.put_body(*slot, body, *hands_over, context, now),
            Change::Params { slot, params } => {
                let seat = self.seats.get_mut(*slot as usize).and_then(Option::as_mut);
                if let Some(body) = seat.and_then(|seat| seat.body.as_mut()) {
                    body.swap_params(params.as_mut());
                }
            }
            Change::Timing { slot, timing } => {
                if let Some(seat) = self.seats.get_mut(*slot as usize).and_then(Option::as_mut) {
                    // A longer period holds at once, a shorter one from the next release on.
                    let next = if timing.period <= Duration::ZERO {
                        Time::NEVER
                    } else if seat.next_release == Time::NEVER {
                        now
                    } else if timing.period > seat.timing.period {
                        seat.next_release - seat.timing.period + timing.period
                    } else {
                        seat.next_release
                    };
                    seat.timing = *timing;
                    seat.next_release = next;
                    if seat.put_off < Time::NEVER {
                        // Whether it still has to wait is seen when it is looked at next.
                        seat.put_off = Time::NEVER;
                        self.ready.mark(*slot);
                    }
                    if next < Time::NEVER {
                        self.push_release(next, *slot);
                    }
                }
            }
            Change::Fault { slot, fault } => {
                if let Some(seat) = self.seats.get_mut(*slot as usize).and_then(Option::as_mut) {
                    seat.fault = *fault;
                }
                self.rest_at_queues(*slot, Rest::Ready);
            }
            Change::Nothing => {}
            Change::OutputFault { end, faulty } => end.set_fault(faulty.as_mut()),
            Change::Send { end, message, envelope } => {
                context.begin(AgentId::NONE, now, self.number, &*self.ready);
                end.send_prepared(envelope, message.as_ref());
                context.end();
            }
            Change::Stop => {
                let mut seats = core::mem::take(&mut self.seats);
                for seat in seats.iter_mut().flatten() {
                    self.stop_agent(seat, context, now);
                }
                self.seats = seats;
            }
        }
        true
    }

    /// Puts another instance in the place of the present one, which is stopped if it is alive.
    fn put_body(
        &mut self,
        slot: u32,
        body: &mut Option<Box<dyn Body>>,
        hands_over: bool,
        context: &Context,
        now: Time,
    ) {
        let Some(mut seat) = self.seats.get_mut(slot as usize).and_then(Option::take) else { return };
        if let (Some(new), Some(old)) = (body.as_mut(), seat.body.as_mut())
            && hands_over
        {
            context.begin(seat.id, now, self.number, &*self.ready);
            let handed = catch_unwind(AssertUnwindSafe(|| new.take_over(&mut **old)));
            context.end();
            if let Err(payload) = handed {
                // The new one dies of it. The old one goes with it: what it knew may be half moved.
                bump(&seat.stats.panics);
                let cause = RawCause::Panic(context.panic_record(), payload);
                self.answer(Answer::Died { slot, id: seat.id, time: now, cause, body: body.take() });
            }
        }
        self.stop_agent(&mut seat, context, now);
        core::mem::swap(&mut seat.body, body);
        seat.started = false;
        let why = if seat.body.is_some() { Rest::Ready } else { Rest::Away };
        self.seats[slot as usize] = Some(seat);
        self.rest(slot, why);
    }

    fn stop_agent(&self, seat: &mut Seat, context: &Context, now: Time) {
        let Some(body) = seat.body.as_mut() else { return };
        if !seat.started {
            return;
        }
        context.begin(seat.id, now, self.number, &*self.ready);
        let mut step = Step { now, deadline: now, agent: seat.id, period: seat.timing.period };
        let stopped = catch_unwind(AssertUnwindSafe(|| body.stop(&mut step)));
        context.end();
        if stopped.is_err() {
            bump(&seat.stats.panics);
        }
    }

    fn reorder(&mut self, order: &mut Vec<u32>, ranks: &mut Vec<u32>, words: &mut Vec<u64>) {
        let mut from = 0;
        while let Some(rank) = self.ready.next(from) {
            from = rank + 1;
            let slot = self.order[rank as usize];
            if let Some(new) = ranks.get(slot as usize).copied().filter(|rank| *rank != u32::MAX) {
                words[new as usize / 64] |= 1 << (new % 64);
            }
        }
        core::mem::swap(&mut self.order, order);
        self.ready.set_order(ranks, words);
        self.cursor = 0;
    }
}
