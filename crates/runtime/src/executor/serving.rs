//! What an executor does for agents that take messages out of a queue, between their steps.
//!
//! An agent that has nothing to do waits at its queue, and is called when a message comes. So a call must never be lost: whoever was
//! called and does not take the message, because it died, because its step was left out or must wait, passes the call on.

use super::{Core, Ended, Seat};
use crate::port::{Rest, Teller};

impl Core {
    /// The agent in this slot comes to rest. It runs again where a message waits for it.
    pub(super) fn rest(&self, slot: u32, why: Rest) {
        let Some(seat) = self.seats.get(slot as usize).and_then(Option::as_ref) else { return };
        let teller = Teller { executor: self.number, ready: &self.ready };
        let mut again = false;
        for input in &seat.on {
            again |= input.rest(why, &teller);
        }
        if again {
            self.ready.mark(slot);
        }
    }

    /// Its step is left out.
    #[cold]
    pub(super) fn left_out(&self, slot: u32) -> Ended {
        self.rest_at_queues(slot, Rest::LeftOut);
        Ended::NotRun
    }

    /// Comes to rest where it takes messages out of a queue; for others nothing is to be done.
    pub(super) fn rest_at_queues(&self, slot: u32, why: Rest) {
        let seat = self.seats.get(slot as usize).and_then(Option::as_ref);
        if seat.is_some_and(|seat| seat.body.is_some() && seat.on.iter().any(|input| input.serves())) {
            self.rest(slot, why);
        }
    }
}

impl Seat {
    /// Whether the message for which it was to run went to somebody else: then no step is made for it.
    pub(super) fn lost_to_others(&self) -> bool {
        self.on.iter().any(|input| input.serves()) && !self.on.iter().any(|input| input.has_message())
    }
}
