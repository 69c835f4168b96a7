//! What an operating-system thread runs: agents, one after another.
//!
//! The core is the same on every clock. It knows which agents are due or made ready and in which order they go; whoever owns
//! it says what time it is.

mod asked;
mod change;
mod due;
mod played;
mod ready;
mod serving;
mod step;

use std::any::Any;
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::sync::Arc;

use types::{AgentId, Duration, Name, Time};

pub(crate) use change::{Answer, Change, Link, Room};

use self::due::{Due, MANY};
use self::ready::ReadySet;
use crate::agent::{Body, Fault};
use crate::budget::Budget;
use crate::door::{CHANGES, Door};
use crate::fetch::{Depth, fetch};
use crate::handover::Running;
use crate::means::Means;
use crate::os;
use crate::port::{InputEnd, Rest};
use crate::processor::{Checks, rate};
use crate::ring::{self, ring};
use crate::stats::{AgentStats, bump, bump_by};

/// When an agent runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Timing {
    /// Zero for an agent that only messages make run.
    pub period: Duration,
    pub deadline: Duration,
    pub min_gap: Duration,
    /// The least time between two steps that it asks for itself; zero where none is declared.
    pub wake_gap: Duration,
    /// How long a step may last before it is taken for one that does not return.
    pub hang_after: Duration,
    /// What it needs where its executor runs by its deadline; nothing where that is not known.
    pub budget: Option<Budget>,
    pub means: Means,
}

/// An agent's place in an executor. What every step uses stands together.
#[repr(C, align(64))]
pub(crate) struct Seat {
    /// It stays here in a step, too: then only the thread that makes the step uses it.
    pub body: Option<Box<dyn Body>>,
    /// The inputs whose messages make it run.
    pub on: Vec<Arc<dyn InputEnd>>,
    pub stats: Arc<AgentStats>,
    pub id: AgentId,
    /// Whether the body is in a step.
    pub in_step: bool,
    pub started: bool,
    pub fault: StepFault,
    /// Whether any of its inputs takes messages out of a queue.
    pub serves: bool,
    pub timing: Timing,
    /// When the step is released that the agent asked for.
    pub alarm: Time,
    /// The step that a message asked for too soon after the last one: when it may be. The next step is that one, whatever for.
    pub put_off: Time,
    /// How many refinements its last step made.
    pub refined: u32,
    pub last_step: Time,
    /// Since when messages wait for it at least, where that is known.
    pub ready_at: Time,
    pub next_release: Time,
    /// Whether its time has come and its step has not begun: it is among those that are due, once.
    pub is_due: bool,
    /// Whether the agent is in a step that does not return. Its ends may be in use there, so nobody touches them; it gets others.
    pub lost: bool,
    pub name: Name,
    /// When that step was asked for; it is released later where it would be too soon after the last one of these, which was released then.
    pub wish: Time,
    pub last_wake: Time,
    /// The agent when all were stopped: it is not run any more.
    pub at_rest: Option<Box<dyn Body>>,
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
    /// Its steps take three times as long.
    Heavy,
}

/// How many times as long the steps of an agent take that is [`StepFault::Heavy`].
pub(crate) const HEAVY: i64 = 3;

/// Why an agent died.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Cause {
    /// Its step reported a fault.
    Fault(Fault),
    /// Its step panicked.
    Panic(String),
    /// Its step did not return.
    Hang,
    /// It did not return from its stop, or from taking over.
    Stop,
}

impl core::fmt::Display for Cause {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Cause::Fault(fault) => write!(f, "fault: {fault}"),
            Cause::Panic(said) => write!(f, "panic: {said}"),
            Cause::Hang => f.write_str("its step did not return"),
            Cause::Stop => f.write_str("it did not return from its stop, or from taking over"),
        }
    }
}

/// What is known of a death on the side where it happened, without memory of its own.
#[allow(clippy::large_enum_variant)] // the record is there so that no memory is needed for it
pub(crate) enum RawCause {
    Fault(Fault),
    Panic(crate::context::PanicRecord, Box<dyn Any + Send>),
    Hang,
    Stop,
}

/// An agent that is to run, and why.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Job {
    pub slot: u32,
    /// When it was due; the present for one that a message made run.
    pub release: Time,
    pub deadline: Time,
    /// Whether its time had come; else a message made it run.
    pub by_clock: bool,
}

type Releases = BinaryHeap<Reverse<(Time, u32)>>;

/// The agents of one executor and what is due among them.
pub(crate) struct Core {
    pub number: u32,
    pub seats: Vec<Option<Box<Seat>>>,
    ready: ReadySet,
    releases: Releases,
    due: Due,
    pub door: Arc<Door>,
    pub running: Arc<Running>,
    changes: ring::Receiver<Option<(u64, Change)>>,
    answers: ring::Sender<Option<Answer>>,
    /// The number of the change that is being committed.
    changing: Option<u64>,
    /// Nanoseconds in a tick, as [`scaled`](crate::processor::scaled) takes it.
    rate: u64,
    checks: Checks,
    /// How many stalls the witness had seen after the last step.
    stalls: u64,
    /// Whether it is to be known since when messages wait: on the wall clock.
    pub dates: bool,
    /// When the last step of any agent began: what came before that was seen before that.
    looked: Time,
    /// Since when agents are ready, by slot, where steps take time on a virtual processor: then who plays it counts them when they end.
    ready_since: Option<Vec<Time>>,
}

/// How many changes or answers can be under way.
const UNDER_WAY: usize = 1024;
/// Lines of an agent's own memory that are fetched before its turn.
const MOST_OF_A_BODY: usize = 4;
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
        let core = Core {
            number,
            seats: Vec::new(),
            ready: ReadySet::default(),
            releases: BinaryHeap::with_capacity(SPARE_ALARMS),
            due: Due::default(),
            door: door.clone(),
            running: running.clone(),
            changes,
            answers,
            changing: None,
            rate: rate(os::nanos_per_tick()),
            checks: Checks::default(),
            stalls: 0,
            dates: false,
            looked: Time(i64::MIN / 2),
            ready_since: None,
        };
        (core, Link { changes: change_in, answers: answer_out, given: 0, door, running })
    }

    /// When the next agent is due by the clock.
    #[inline]
    pub(crate) fn next_release(&self) -> Time {
        self.releases.peek().map_or(Time::NEVER, |Reverse((time, _))| *time)
    }

    /// The thread is there from now on: nobody who has not had a step yet was due before.
    pub(crate) fn begin_at(&mut self, now: Time) {
        self.looked = self.looked.max(now);
        for slot in 0..self.seats.len() {
            let Some(seat) = self.seats[slot].as_deref_mut() else { continue };
            if !seat.started && seat.next_release < now {
                seat.next_release = now;
                self.push_release(now, slot as u32);
            }
        }
    }

    /// What the one agent needs of an executor that runs by its deadline.
    pub(crate) fn budget(&self) -> Option<Budget> {
        self.seats.iter().flatten().next()?.timing.budget
    }

    /// Whether nobody has rung, nobody is ready and nothing is due: most looks find that.
    #[inline]
    pub(crate) fn is_idle(&self, now: Time) -> bool {
        !self.door.is_rung() && self.next_release() > now && self.due.is_empty() && self.ready.is_empty()
    }

    /// Takes what others have rung for. Says whether changes wait, which are then to be served.
    #[inline]
    pub(crate) fn look_at_door(&mut self) -> bool {
        self.door.is_rung() && self.answer_door()
    }

    #[inline(never)]
    fn answer_door(&mut self) -> bool {
        let bits = self.door.take();
        for slot in 0..self.seats.len() as u32 {
            if bits & crate::door::bit_of(slot) != 0 {
                self.find_whether_ready(slot);
            }
        }
        bits & CHANGES != 0
    }

    /// Finds ready agents by looking into the mailboxes: after a hand-over, when nobody knows what was rung.
    #[inline(never)]
    pub(crate) fn find_ready(&mut self) {
        (0..self.seats.len() as u32).for_each(|slot| self.find_whether_ready(slot));
    }

    fn find_whether_ready(&mut self, slot: u32) {
        let Some(seat) = &mut self.seats[slot as usize] else { return };
        if seat.on.iter().any(|input| input.has_message()) {
            if self.dates {
                seat.date(self.looked);
            }
            self.ready.mark(slot);
        } else {
            // Where it serves a queue and was called, another one was there first.
            self.rest_at_queues(slot, Rest::Ready);
        }
    }

    /// The agent that runs next: of those that are due the one with the earliest deadline, else the next one in data-flow order
    /// that a message made ready. Agents made ready behind the cursor wait for the next sweep.
    #[inline(always)]
    pub(crate) fn next(&mut self, now: Time) -> Option<Job> {
        if (self.next_release() <= now || !self.due.is_empty())
            && let Some(job) = self.next_due(now)
        {
            return Some(job);
        }
        loop {
            let slot = self.ready.take()?;
            let Some(seat) = self.seats.get(slot as usize).and_then(Option::as_deref) else { continue };
            let release = seat.ready_at.min(now);
            let deadline = release.saturating_add(seat.timing.deadline);
            let is_active = seat.timing.means.is_active;
            if seat.timing.min_gap > Duration::ZERO && self.is_put_off(slot, now) {
                continue;
            }
            if !is_active {
                self.rest_at_queues(slot, Rest::Away);
                continue;
            }
            return Some(Job { slot, release, deadline, by_clock: false });
        }
    }

    #[inline(never)]
    fn next_due(&mut self, now: Time) -> Option<Job> {
        self.collect_due(now);
        let (deadline, rank, slot, release) = self.due.pop()?;
        self.fetch_coming();
        if let Some(seat) = self.seats.get_mut(slot as usize).and_then(Option::as_deref_mut) {
            seat.is_due = false;
        }
        self.ready.clear(rank);
        Some(Job { slot, release, deadline, by_clock: true })
    }

    /// Has fetched what the next steps will touch, where it is known whose they are: part by part, each when the one that leads to it
    /// has come.
    #[inline]
    fn fetch_coming(&mut self) {
        if self.due.coming(0).is_none() {
            return;
        }
        if let Some(seat) = self.coming(8) {
            fetch(&raw const *seat, size_of::<Seat>().div_ceil(64));
        }
        if let Some(seat) = self.coming(6) {
            seat.stats.fetch();
            if let Some(body) = &seat.body {
                fetch(&raw const **body, size_of_val(&**body).div_ceil(64).min(MOST_OF_A_BODY));
            }
        }
        if let Some(seat) = self.coming(4) {
            seat.stats.fetch_last();
        }
        for (after, depth) in [(4, Depth::Ends), (2, Depth::Wires), (0, Depth::Places)] {
            if let Some(body) = self.coming(after).and_then(|seat| seat.body.as_deref_mut()) {
                body.fetch(depth);
            }
        }
    }

    #[inline]
    fn coming(&mut self, after: usize) -> Option<&mut Seat> {
        let slot = self.due.coming(after)?;
        self.seats.get_mut(slot as usize)?.as_deref_mut()
    }

    /// Whether a message came too soon after the last step. Then there is one step for all that come until it may be.
    #[inline(never)]
    fn is_put_off(&mut self, slot: u32, now: Time) -> bool {
        let Some(seat) = self.seats.get_mut(slot as usize).and_then(Option::as_deref_mut) else {
            return true;
        };
        let earliest = seat.last_step.saturating_add(seat.timing.min_gap);
        if earliest <= now {
            return false;
        }
        // It is released when it may be, not when the message came.
        seat.ready_at = Time::NEVER;
        let is_new = core::mem::replace(&mut seat.put_off, earliest) != earliest;
        if let Some(since) = self.ready_since.as_mut().and_then(|since| since.get_mut(slot as usize)) {
            *since = Time::NEVER;
        }
        if is_new {
            self.push_release(earliest, slot);
        }
        self.rest_at_queues(slot, Rest::Away);
        true
    }

    fn collect_due(&mut self, now: Time) {
        while let Some(Reverse((time, slot))) = self.releases.peek().copied() {
            if time > now {
                return;
            }
            self.releases.pop();
            self.fetch_released();
            let Some(seat) = self.seats.get_mut(slot as usize).and_then(Option::as_mut) else { continue };
            if !seat.timing.means.is_active {
                // It is released anew when it goes on.
                seat.next_release = Time::NEVER;
                continue;
            }
            let mut release = None;
            if seat.next_release <= now {
                // Releases that were passed over are counted and never made up for: no burst.
                let period = seat.timing.period;
                let passed = (now - seat.next_release).0 / period.0.max(1);
                if passed > 0 {
                    bump_by(&seat.stats.skipped, passed as u64);
                }
                let due = seat.next_release + period * passed;
                seat.next_release = due + period;
                release = Some(due);
                let next = seat.next_release;
                self.push_release(next, slot);
            }
            let Some(seat) = self.seats.get_mut(slot as usize).and_then(Option::as_mut) else { continue };
            if seat.alarm <= now {
                let asked_for = seat.wake();
                release = release.or(Some(asked_for));
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
                && !core::mem::replace(&mut seat.is_due, true)
            {
                let deadline = release.saturating_add(seat.timing.deadline);
                self.due.push((deadline, rank, slot, release));
            }
        }
    }

    /// Has fetched what the next releases will touch, where there are many: they are near the top.
    #[inline]
    fn fetch_released(&self) {
        if self.releases.len() < MANY {
            return;
        }
        for Reverse((_, slot)) in self.releases.as_slice().iter().take(7) {
            if let Some(seat) = self.seats.get(*slot as usize).and_then(Option::as_deref) {
                fetch(&raw const seat.timing, 2);
            }
        }
    }

    #[inline(never)]
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

    /// Takes an agent that does not come back from its step, or its stop, for dead. Its body is left to the thread that is in the step; where
    /// the step was only played, it goes to the control side. From here on nobody touches its ends: the thread that lost it may.
    pub(crate) fn give_up(&mut self, slot: u32, now: Time) {
        let Some(seat) = self.seats.get_mut(slot as usize).and_then(Option::as_mut) else { return };
        bump(&seat.stats.hangs);
        (seat.lost, seat.serves) = (true, false);
        seat.on.clear();
        let cause = if self.changing.is_some() { RawCause::Stop } else { RawCause::Hang };
        let body = seat.leave_behind();
        let died = Answer::Died { slot, id: seat.id, time: now, cause, body };
        self.answer(died);
        if let Some(number) = self.changing.take() {
            self.answer(Answer::Lost(number, None));
        }
    }
}
