//! The plain rule: who misses is slowed down.

use crate::Exact;
use crate::manage::change::shifts;
use crate::manage::room::Room;
use crate::manage::{Cause, Change, Managed, Patience, Setting};

/// Doubles the period of whoever missed a deadline since the last look, up to its longest, and halves it again towards the nominal one after a
/// while without. It asks neither who is to blame nor who is important: what many systems do, to compare a [`Governor`](crate::manage::Governor) with.
#[derive(Clone, Debug)]
pub struct Ladder {
    patience: Patience,
    rungs: Vec<Rung>,
    settings: Vec<Setting>,
}

/// How far an agent has been slowed down.
#[derive(Clone, Copy, Debug)]
struct Rung {
    /// How many times its period was doubled.
    doublings: u32,
    /// When it missed last, or was set otherwise; in nanoseconds.
    since: i64,
}

/// No period is doubled more often.
const HIGHEST: u32 = 30;

impl Ladder {
    /// Nobody has been slowed down.
    pub fn new(patience: Patience) -> Ladder {
        Ladder { patience, rungs: Vec::new(), settings: Vec::new() }
    }

    /// How the agents run, as far as they were looked at.
    pub fn settings(&self) -> &[Setting] {
        &self.settings
    }

    /// Looks at who has missed deadlines since the last look; what is to be otherwise from now on. `now` in nanoseconds of any clock.
    pub fn decide(&mut self, now: i64, managed: &[Managed], missed: &[bool]) -> Option<Change> {
        let rooms: Vec<Room> = managed.iter().map(Room::of).collect();
        if self.rungs.len() != rooms.len() {
            self.rungs = vec![Rung { doublings: 0, since: now }; rooms.len()];
            self.settings = rooms.iter().map(Room::most).collect();
        }
        let mut slower = Vec::new();
        let mut is_faster = false;
        for (at, (rung, room)) in self.rungs.iter_mut().zip(&rooms).enumerate() {
            if missed.get(at).is_some_and(|missed| *missed) {
                rung.since = now;
                if stretched(room, rung.doublings) < room.longest() && rung.doublings < HIGHEST {
                    rung.doublings += 1;
                    slower.push(at);
                }
            } else if rung.doublings > 0 && now.saturating_sub(rung.since) >= self.patience.back_after {
                *rung = Rung { doublings: rung.doublings - 1, since: now };
                is_faster = true;
            }
        }
        let set =
            |(room, rung): (&Room, &Rung)| Setting { period: stretched(room, rung.doublings), ..room.most() };
        let settings = rooms.iter().zip(&self.rungs).map(set).collect();
        let before = std::mem::replace(&mut self.settings, settings);
        let shifts = shifts(&before, &self.settings);
        let cause = match (slower.is_empty(), is_faster) {
            (false, _) => Cause::Missed(slower),
            (true, true) => Cause::Fallen,
            (true, false) => Cause::Ordered(shifts.iter().map(|shift| shift.agent).collect()),
        };
        (!shifts.is_empty()).then_some(Change { shifts, cause, stage: None, missing: Vec::new() })
    }
}

/// The ordered period, doubled so often.
fn stretched(room: &Room, doublings: u32) -> Option<Exact> {
    let (from, _) = room.period?;
    room.longest().map(|longest| (from * Exact::from_integer(1 << doublings)).min(longest))
}
