//! The budget of an executor that runs by its agent's deadline: asked for by its own thread, between two steps, whenever it is another one.
//!
//! The thread sleeps as all do, until the time of its next release: under `SCHED_DEADLINE` it is woken then, with a new deadline and its whole budget.
//! To give up the rest of the budget instead (`sched_yield`) would wake it by the kernel's count of periods, which is not ours.

use core::sync::atomic::Ordering;
use std::io;

use types::{Duration, Time};

use super::Cell;
use crate::budget::Budget;
use crate::os;
use crate::plan::ABOVE_ALL;

/// How soon the kernel is asked again that had too little left. It is when another thread has ended, or needs less.
const AGAIN: Duration = Duration::millis(10);

/// What the thread of an executor has asked for.
#[derive(Debug, Default)]
pub(super) struct Asked {
    budget: Option<Budget>,
    /// When it is asked for again; nothing when it was granted, or never will be.
    again: Option<Time>,
}

impl Asked {
    /// Whether it is to be asked again for what was refused.
    #[inline]
    pub(super) fn is_due(&self, now: Time) -> bool {
        self.again.is_some_and(|again| again <= now)
    }

    /// Asks for what is needed now, if that is not what the thread has. What came of it, if it did.
    pub(super) fn ask(&mut self, needed: Option<Budget>, now: Time) -> Option<io::Result<()>> {
        if needed == self.budget && !self.is_due(now) {
            return None;
        }
        let said = needed.map_or_else(os::set_ordinary, |budget| os::set_deadline(0, budget));
        if said.is_err() && os::deadline_of(0).is_none() {
            // It may have waited for its executor above others.
            let _ = os::set_ordinary();
        }
        let full = said.as_ref().is_err_and(|error| error.raw_os_error() == Some(libc::EBUSY));
        (self.budget, self.again) = (needed, full.then(|| now + AGAIN));
        Some(said)
    }
}

/// Where the calling thread stands among executors: its real-time priority, zero for an ordinary one. Nothing but that, and its budget.
pub(super) fn standing() -> (u64, Option<Duration>) {
    match (os::deadline_of(0), os::granted()) {
        (Some(budget), _) => (ABOVE_ALL.into(), Some(budget.runtime)),
        (None, (libc::SCHED_FIFO, priority)) => (u64::try_from(priority).unwrap_or(0), None),
        (None, _) => (0, None),
    }
}

/// What a thread, zero for the calling one, was granted, and why not what it asked for.
fn granted(thread: i32, refused: Option<&io::Error>) -> String {
    let has = os::deadline_of(thread).map_or("ordinary".into(), |budget| budget.to_string());
    refused.map_or(has.clone(), |error| format!("{has} ({error})"))
}

/// The same for the calling thread.
pub(super) fn told(said: &io::Result<()>) -> String {
    granted(0, said.as_ref().err())
}

impl Cell {
    /// Notes what came of asking, in real time, for the control side.
    pub(super) fn note_asked(&self, said: &io::Result<()>) {
        let error = said.as_ref().err().and_then(io::Error::raw_os_error).unwrap_or(0);
        self.refused.store(error, Ordering::Relaxed);
        // Release: partner of the acquire in `asked_meanwhile`.
        self.has_asked.store(true, Ordering::Release);
    }

    /// What was granted since it was looked at last, where its thread has asked meanwhile.
    pub(super) fn asked_meanwhile(&self) -> Option<String> {
        if !self.has_asked.load(Ordering::Relaxed) || !self.has_asked.swap(false, Ordering::Acquire) {
            return None;
        }
        let refused = match self.refused.load(Ordering::Relaxed) {
            0 => None,
            error => Some(io::Error::from_raw_os_error(error)),
        };
        Some(granted(self.thread.load(Ordering::Acquire), refused.as_ref()))
    }
}
