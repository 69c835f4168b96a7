//! How long an iteration takes the thread that does it: from the beginning of its first step to the end of its last.
//!
//! ```text
//!   choose  source  account │ choose  hand  account │ …   sink  account │ choose  last
//!           ├──────────────────────── an iteration ──────────────────────────────────┤
//! ```
//!
//! The first agent reads the clock when its step begins. The end is read by an agent of its own, the last in data-flow order, when its step
//! begins: it is the next thing that the executor does. So all that the runtime does after each of the steps is inside: counting it, sending
//! and logging what it sent, choosing who is next. That agent has a wire of its own from the last output, which is inside too.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use super::super::parcel::{Shelf, keep, now, room};
use crate::error::Failure;

/// So many iterations can be under way: a disturbed thread begins the next before the last has come to its end.
const UNDER_WAY: usize = 64;

/// What the ends of an iteration share, on one thread.
#[derive(Clone, Debug)]
pub(super) struct Iteration(Arc<Ends>);

#[derive(Debug)]
struct Ends {
    /// Sinks of an iteration.
    sinks: u64,
    /// Iterations that are kept, after so many that are not.
    room: usize,
    warm_up: u64,
    /// When each began (ns).
    begun: [AtomicU64; UNDER_WAY],
    /// How many began, and steps of sinks that ended.
    count: AtomicU64,
    ended: AtomicU64,
    /// Iterations whose last step was not the last.
    disorder: AtomicU64,
    spans: Shelf,
}

impl Iteration {
    pub(super) fn of(sinks: u64, warm_up: u64, iterations: usize) -> Iteration {
        Iteration(Arc::new(Ends {
            sinks,
            room: iterations,
            warm_up,
            begun: std::array::from_fn(|_| AtomicU64::new(0)),
            count: AtomicU64::new(0),
            ended: AtomicU64::new(0),
            disorder: AtomicU64::new(0),
            spans: Shelf::default(),
        }))
    }

    /// The first step begins; gives the time (ns).
    #[inline]
    pub(super) fn begin(&self) -> u64 {
        let number = next(&self.0.count);
        let time = now();
        self.0.begun[number as usize % UNDER_WAY].store(time, Ordering::Relaxed);
        time
    }

    /// A sink has done its work.
    #[inline]
    pub(super) fn sink(&self) {
        next(&self.0.ended);
    }

    /// How long each took (ns). That an agent stood in the wrong place of the data flow makes all of it worthless.
    pub(super) fn spans(&self) -> Result<Vec<f64>, Failure> {
        let disorder = self.0.disorder.load(Ordering::Relaxed);
        if disorder > 0 {
            return Err(Failure::new(format!("{disorder} iterations ended before their sinks")).code(1));
        }
        Ok(self.0.spans.take())
    }
}

/// Adds one; the thread is the only one that does.
fn next(count: &AtomicU64) -> u64 {
    let number = count.load(Ordering::Relaxed);
    count.store(number + 1, Ordering::Relaxed);
    number
}

/// What the last agent keeps.
#[derive(Debug, Default)]
pub(super) struct Ending {
    iteration: Option<Iteration>,
    number: u64,
    spans: Vec<f64>,
}

impl Ending {
    pub(super) fn of(iteration: &Iteration) -> Ending {
        Ending { iteration: Some(iteration.clone()), number: 0, spans: room(iteration.0.room) }
    }

    /// An iteration has ended at `time` (ns).
    pub(super) fn end(&mut self, time: u64) {
        let Some(Iteration(ends)) = &self.iteration else { return };
        let begun = ends.begun[self.number as usize % UNDER_WAY].load(Ordering::Relaxed);
        self.number += 1;
        if ends.ended.load(Ordering::Relaxed) < ends.sinks * self.number {
            next(&ends.disorder);
        }
        if self.number > ends.warm_up {
            keep(&mut self.spans, time.saturating_sub(begun) as f64);
        }
    }

    /// All is done.
    pub(super) fn put(&self) {
        if let Some(Iteration(ends)) = &self.iteration {
            ends.spans.put(&self.spans);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn iterations_that_overlap_are_each_timed_from_their_own_beginning() {
        let iteration = Iteration::of(1, 1, 10);
        let mut ending = Ending::of(&iteration);
        let begun: Vec<u64> = (0..3).map(|_| iteration.begin()).collect();
        (0..3).for_each(|_| iteration.sink());
        begun.iter().for_each(|begun| ending.end(begun + 500));
        ending.put();
        assert_eq!(iteration.spans().unwrap(), [500.0, 500.0]);
    }

    #[test]
    fn an_end_before_a_sink_is_refused() {
        let iteration = Iteration::of(2, 0, 10);
        let mut ending = Ending::of(&iteration);
        ending.end(iteration.begin());
        ending.put();
        assert!(iteration.spans().is_err());
    }
}
