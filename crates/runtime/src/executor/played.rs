//! Steps that take time on a virtual processor: they are made when they begin, and counted when they end.

use types::{AgentId, Duration, Time};

use super::step::missed;
use super::{Core, Job};
use crate::context::Context;
use crate::processor::Moment;
use crate::stats::{bump, nanos};

impl Core {
    /// From now on whoever plays the processors counts the steps.
    pub(crate) fn count_elsewhere(&mut self) {
        self.ready_since = Some(Vec::new());
    }

    /// Notes since when agents are ready whom messages have made so.
    pub(crate) fn note_ready(&mut self, now: Time) {
        let slots = self.seats.len();
        let Some(since) = &mut self.ready_since else { return };
        since.resize(slots, Time::NEVER);
        for (slot, since) in since.iter_mut().enumerate() {
            let seat = self.seats[slot].as_deref();
            if seat.is_some_and(|seat| !seat.timing.means.is_active) {
                // What came for one that is suspended is released when it goes on.
                *since = Time::NEVER;
                continue;
            }
            if *since == Time::NEVER && self.ready.is_marked(slot as u32) {
                *since = now;
            }
        }
    }

    /// The agent that runs next. One that a message made run was released when it became ready.
    pub(crate) fn next_played(&mut self, now: Time) -> Option<Job> {
        self.note_ready(now);
        let mut job = self.next(now)?;
        let slot = job.slot as usize;
        let since = self.ready_since.as_mut().and_then(|since| since.get_mut(slot));
        let since = since.map_or(Time::NEVER, |since| core::mem::replace(since, Time::NEVER));
        if !job.by_clock && since < now {
            let deadline = self.seats[slot].as_ref().map_or(Duration::ZERO, |seat| seat.timing.deadline);
            (job.release, job.deadline) = (since, since.saturating_add(deadline));
        }
        Some(job)
    }

    /// Makes those ready to whom messages went that were kept back.
    pub(crate) fn mark_woken_by(&mut self, context: &Context) {
        self.mark_woken(context);
    }

    /// How many refinements the last step of an agent made.
    pub(crate) fn refined(&self, slot: u32) -> u32 {
        self.seats.get(slot as usize).and_then(Option::as_deref).map_or(0, |seat| seat.refined)
    }

    /// Counts a step that began at `begun`, ends now and used its processor for so long, where its agent is there still.
    #[allow(clippy::too_many_arguments)]
    pub(crate) fn count_played(
        &mut self,
        context: &Context,
        job: Job,
        of: AgentId,
        begun: Time,
        now: Time,
        cost: Duration,
        overran: bool,
    ) {
        let seat = self.seats.get(job.slot as usize).and_then(Option::as_deref);
        let Some(seat) = seat.filter(|seat| seat.id == of) else { return };
        seat.stats.exec.add(nanos(cost));
        if overran {
            bump(&seat.stats.overruns);
        }
        seat.stats.response.add(nanos(now - job.release));
        if now > job.deadline {
            let (begun, ended) = (Moment::simulated(begun), Moment::simulated(now));
            missed(context, seat, job, begun, ended, nanos(cost), None);
        }
    }
}
