//! Iterations at a period: how long each takes the thread that does it, and what all threads take of the processor.

use crate::machine::{now, process_time, room, sleep_until, thread_time};

/// Iterations before anything is kept.
pub(super) const WARM_UP: u64 = 100;

/// A part of a run: the time of each iteration, and means of one (ns).
pub(super) struct Part {
    /// From before an iteration until after it, by the monotonic clock; nothing else is done between.
    pub(super) spans: Vec<u64>,
    /// From one to the next.
    pub(super) whole: f64,
    /// Processor time of the thread, with the sleep before each.
    pub(super) thread: f64,
    /// Processor time of all threads.
    pub(super) process: f64,
}

impl Part {
    /// Iterations at a period (ns); between them the thread sleeps. One that is late is not left out.
    pub(super) fn run(iterations: u64, period: u64, mut iterate: impl FnMut()) -> Part {
        let mut spans = room(iterations);
        let (begun, all, own) = (now(), process_time(), thread_time());
        for round in 1..=iterations {
            let wanted = begun + round * period;
            let mut before = now();
            if before < wanted {
                sleep_until(wanted);
                before = now();
            }
            iterate();
            spans.push(now() - before);
        }
        let mean = |total: u64| total as f64 / iterations as f64;
        let (whole, thread, process) =
            (mean(now() - begun), mean(thread_time() - own), mean(process_time() - all));
        Part { spans, whole, thread, process }
    }
}
