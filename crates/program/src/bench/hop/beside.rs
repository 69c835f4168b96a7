//! Iterations with a log of all that is sent, at a pace, beside copper's: rounds of both in turns.
//!
//! Of copper an iteration is one call of its own loop's body: its five or seventeen tasks, what it does around them, and the writing of the
//! iteration's list into its log, which it does on the same thread. Both sides read the monotonic clock once before and once after.
//! A round of ours counts only when every message is in the file, one of copper's when every iteration is.

use types::Duration;

use super::CPU;
use super::recorded::Kept;
use crate::bench::Setting;
use crate::bench::outcome::{Measured, Outcome};
use crate::bench::turns::{Turns, mean};
use crate::error::Failure;

/// Ten thousand iterations a second.
pub(super) const PERIOD: Duration = Duration::micros(100);
/// Iterations of a round, and rounds.
const ITERATIONS: usize = 20_000;
const ROUNDS: usize = 9;

/// What is measured, and how it is called.
pub(super) struct Work {
    /// The figure, and what copper's program calls it.
    pub(super) name: &'static str,
    pub(super) theirs: &'static str,
    /// The ratios of the medians, of the means, and at 99 of 100.
    pub(super) ratios: [&'static str; 3],
    /// What stands before the figures of a message.
    pub(super) prefix: &'static str,
    /// Messages of an iteration.
    pub(super) messages: f64,
}

/// What a round of ours gives (ns, for an iteration).
pub(super) struct Ran {
    pub(super) spans: Vec<f64>,
    /// Processor time of all threads.
    pub(super) process: f64,
    /// Iterations in a second that there really were.
    pub(super) rate: f64,
    pub(super) kept: Kept,
}

/// One round of ours.
pub(super) type Round<'a> = dyn FnMut(usize, &mut Outcome) -> Result<Ran, Failure> + 'a;

/// Rounds of ours and of copper's, in turns.
pub(super) fn measure(
    setting: &Setting<'_>,
    outcome: &mut Outcome,
    work: &Work,
    run: &mut Round<'_>,
) -> Result<(), Failure> {
    let iterations = setting.of(ITERATIONS, 500);
    let mut turns = Turns::new(setting.peers.clone());
    let mut lost = None;
    let (mut ours, mut theirs) = (Side::default(), Side::default());
    let args = ["--iterations".to_owned(), iterations.to_string(), "--cpu".to_owned(), CPU.to_string()];
    for _ in 0..setting.of(ROUNDS, if setting.shorter > 100 { 1 } else { 3 }) {
        let ran = run(iterations, outcome)?;
        lost = ran.kept.failure().or(lost);
        ours.rates.push(ran.rate);
        ours.add(work, ran.spans, ran.process, ran.kept.size as f64 / iterations as f64);
        let mut round = turns.round(work.theirs, &args);
        let spans = turns.take(&mut round, "iteration_each", "ns");
        if spans.is_empty() {
            continue;
        }
        let missing: f64 = turns.take(&mut round, "missing", "1").iter().sum();
        if missing > 0.0 {
            let what = format!("copper's log lacks {missing} iterations");
            lost = Some(Failure::new(what).code(1)).or(lost);
        }
        let (process, size) =
            (turns.take(&mut round, "process", "ns"), turns.take(&mut round, "log_size", "B"));
        theirs.rates.extend(turns.take(&mut round, "rate", "1/s"));
        theirs.add(work, spans, mean(&process), mean(&size) / iterations as f64);
    }
    if lost.is_none() && !theirs.at.is_empty() {
        outcome.note(format!("{}: every message is in both logs, in every round", work.name));
    }
    let pairs: Vec<_> = ours.at.iter().copied().zip(theirs.at.iter().copied()).collect();
    ours.tell(outcome, work, "");
    theirs.tell(outcome, work, "_copper");
    let failure = lost.or(turns.failure());
    for (which, name) in work.ratios.into_iter().enumerate() {
        if failure.is_some() || pairs.is_empty() {
            outcome.without(name, failure.clone());
        } else {
            outcome.compare(name, pairs.iter().map(|(a, b)| (a[which], b[which])).collect());
        }
    }
    Ok(())
}

/// The figures of one side.
#[derive(Default)]
struct Side {
    spans: Vec<f64>,
    /// Of each round the median, the mean, and the value that 99 of 100 do not exceed (ns).
    at: Vec<[f64; 3]>,
    rates: Vec<f64>,
    process: Vec<f64>,
    size: Vec<f64>,
}

impl Side {
    fn add(&mut self, work: &Work, spans: Vec<f64>, process: f64, size: f64) {
        let round = Measured::new("round", "ns", spans.clone());
        self.at.push([round.at(0.5), mean(&spans), round.at(0.99)]);
        self.spans.extend(spans);
        self.process.push(process / work.messages);
        self.size.push(size / work.messages);
    }

    fn tell(self, outcome: &mut Outcome, work: &Work, whose: &str) {
        let Work { name, prefix, .. } = work;
        outcome.figure(format!("{name}{whose}"), "ns", self.spans);
        outcome.figure(format!("{name}_mean{whose}"), "ns", self.at.iter().map(|at| at[1]).collect());
        outcome.figure(format!("{name}_rate{whose}"), "1/s", self.rates);
        outcome.figure(format!("{prefix}message_process_time{whose}"), "ns", self.process);
        outcome.figure(format!("{prefix}message_log_size{whose}"), "B", self.size);
    }
}
