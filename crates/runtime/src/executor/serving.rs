//! What an executor does for agents that take messages out of a queue, between their steps.
//!
//! An agent that has nothing to do waits at its queue, and is called when a message comes. So a call must never be lost: whoever was
//! called and does not take the message, because it died, because its step was left out or must wait, passes the call on.

use super::{Core, Ended, Seat};
use crate::port::{Rest, Teller};

impl Core {
    /// The agent in this slot comes to rest. It runs again where a message waits for it.
    #[inline(never)]
    pub(super) fn rest(&mut self, slot: u32, why: Rest) {
        let Core { seats, ready, number, .. } = self;
        let Some(seat) = seats.get(slot as usize).and_then(Option::as_deref) else { return };
        let mut again = false;
        {
            let mut mark = |slot| ready.mark(slot);
            let mut teller = Teller { executor: *number, mark: &mut mark };
            for input in &seat.on {
                again |= input.rest(why, &mut teller);
            }
        }
        if again {
            ready.mark(slot);
        }
    }

    /// The same where it takes messages out of a queue and is alive; for others nothing is to be done.
    pub(super) fn rest_at_queues(&mut self, slot: u32, why: Rest) {
        let seat = self.seats.get(slot as usize).and_then(Option::as_deref);
        if seat.is_some_and(|seat| seat.serves && seat.body.is_some()) {
            self.rest(slot, why);
        }
    }

    /// Its step is not made, for this reason.
    #[cold]
    pub(super) fn not_made(&mut self, slot: u32, why: &Ended) {
        match why {
            // Nobody counts on it any more, as on one that is in a step.
            Ended::AskedToHang(_) => {
                if let Some(seat) = self.seats.get(slot as usize).and_then(Option::as_deref) {
                    seat.begin_serving();
                }
            }
            Ended::Normally | Ended::NotRun => self.rest_at_queues(slot, Rest::LeftOut),
        }
    }

    /// After a change of its inputs: whether the agent in this slot takes messages out of a queue.
    pub(super) fn note_serving(&mut self, slot: u32) -> bool {
        let Some(seat) = self.seats.get_mut(slot as usize).and_then(Option::as_deref_mut) else {
            return false;
        };
        seat.serves = seat.on.iter().any(|input| input.serves());
        seat.serves
    }
}

impl Seat {
    /// A step begins: whoever calls for somebody who waits passes it over.
    #[inline(never)]
    pub(super) fn begin_serving(&self) {
        self.on.iter().for_each(|input| input.begin_step());
    }

    /// Whether the message for which it was to run went to somebody else: then no step is made for it.
    pub(super) fn lost_to_others(&self) -> bool {
        self.serves && !self.on.iter().any(|input| input.has_message())
    }
}
