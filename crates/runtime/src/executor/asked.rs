//! Steps that an agent asks for itself: when they may be.
//!
//! ```text
//!   nothing ──a step asks──▶ waits until `alarm` ──its time comes──▶ released ──▶ nothing
//!                                │        ▲
//!                                └────────┘ a step asks for an earlier one, or the least time between is another
//! ```

use types::{Duration, Time};

use super::Seat;

impl Seat {
    /// Takes in that a step which began at `now` asks for another one at `wish`. Gives when that is released, where it is sooner than what is
    /// waited for already.
    pub(super) fn ask(&mut self, wish: Time, now: Time) -> Option<Time> {
        // Where a least time between them is declared, what lies behind is asked for now: nobody can do it sooner.
        let wish = if self.timing.wake_gap > Duration::ZERO { wish.max(now) } else { wish };
        self.wish = self.wish.min(wish);
        let alarm = self.earliest_alarm();
        let is_sooner = alarm < self.alarm;
        self.alarm = self.alarm.min(alarm);
        is_sooner.then_some(alarm)
    }

    /// The step that was asked for is released now, and counts from when it should have been. Gives that time.
    pub(super) fn wake(&mut self) -> Time {
        (self.last_wake, self.wish) = (self.alarm, Time::NEVER);
        core::mem::replace(&mut self.alarm, Time::NEVER)
    }

    /// When what was asked for is released after its timing was changed at `now`, or since it goes on; nothing where that stays as it is.
    pub(super) fn ask_anew(&mut self, now: Time, goes_on: bool) -> Option<Time> {
        if self.alarm == Time::NEVER {
            return None;
        }
        if goes_on {
            self.wish = self.wish.max(now);
        }
        let alarm = self.earliest_alarm();
        if alarm == self.alarm {
            return None;
        }
        self.alarm = alarm.max(now);
        Some(self.alarm)
    }

    /// An earlier wish is put off, and not lost.
    fn earliest_alarm(&self) -> Time {
        match self.timing.wake_gap {
            gap if gap > Duration::ZERO => self.wish.max(self.last_wake.saturating_add(gap)),
            _ => self.wish,
        }
    }
}
