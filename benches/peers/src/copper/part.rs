//! Iterations at a period, and what each takes of the processor.

use cu29::prelude::RobotClock;

use crate::machine::{now, process_time, room, sleep_until, thread_time};

/// A part of a run: the time of each iteration, and mean processor times of one (ns).
pub(super) struct Part {
    pub(super) spans: Vec<u64>,
    /// Of the thread, in the iterations alone, with what reading the clocks takes.
    pub(super) work: f64,
    /// Of the thread, with all that it does.
    pub(super) thread: f64,
    /// Of all threads.
    pub(super) process: f64,
}

impl Part {
    /// Iterations at a period (ns); between them the thread sleeps.
    pub(super) fn run(iterations: u64, period: u64, clock: &RobotClock, mut iterate: impl FnMut()) -> Part {
        let mut spans = room(iterations);
        let (begun, all, own) = (now(), process_time(), thread_time());
        let mut work = 0;
        for round in 1..=iterations {
            sleep_until(begun + round * period);
            let used = thread_time();
            let before = clock.now();
            iterate();
            spans.push((clock.now() - before).as_nanos());
            work += thread_time() - used;
        }
        let mean = |total: u64| total as f64 / iterations as f64;
        let (thread, process) = (mean(thread_time() - own), mean(process_time() - all));
        Part { spans, work: mean(work), thread, process }
    }
}
