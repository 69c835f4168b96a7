//! The chain with a log of all that is sent, 10 000 messages a second from the source, beside copper with its log.
//!
//! Compared is what one iteration takes of the processor of the thread that runs the agents, less what a bare thread takes that
//! only sleeps as often. A round counts only when every message is in the file.

use types::Duration;

use super::CPU;
use super::chain::{self, Trace};
use super::recorded::{self, Kept};
use crate::bench::Setting;
use crate::bench::outcome::Outcome;
use crate::bench::turns::{Turns, mean};
use crate::error::Failure;

/// Iterations of a round, the time between them, and rounds.
const ITERATIONS: usize = 50_000;
const PERIOD: Duration = Duration::micros(100);
const ROUNDS: usize = 3;
/// Messages of an iteration.
const MESSAGES: f64 = 4.0;
/// The rates that are tried, as fractions of a second, and how long each is kept up.
const FASTER: [Duration; 6] = [
    Duration::micros(50),
    Duration::micros(25),
    Duration::micros(12),
    Duration::micros(6),
    Duration::micros(3),
    Duration::nanos(1500),
];
const FASTER_FOR: usize = 500_000_000;

/// What a round of ours gives (ns, for an iteration).
struct Ran {
    spans: Vec<f64>,
    thread: f64,
    process: f64,
    /// Iterations in a second that there really were.
    rate: f64,
    kept: Kept,
}

fn run(iterations: usize, period: Duration, outcome: &mut Outcome) -> Result<Ran, Failure> {
    let trace = Trace::of(iterations);
    let kept = recorded::run(&chain::plan(period), &trace.registry(), trace.options(period), outcome)?;
    let used = trace.used.take();
    let &[thread, process, whole] = &used[..] else {
        return Err(Failure::new("the messages were not all sent in time").code(1));
    };
    let each = |used: f64| used / iterations as f64;
    let rate = 1e9 / each(whole);
    Ok(Ran { spans: trace.spans.take(), thread: each(thread), process: each(process), rate, kept })
}

/// Rounds of ours and of copper's, in turns.
pub(super) fn measure(setting: &Setting<'_>, outcome: &mut Outcome) -> Result<(), Failure> {
    let iterations = setting.of(ITERATIONS, 500);
    let mut turns = Turns::new(setting.peers.clone());
    let (mut rounds, mut lossy) = (Vec::new(), None);
    let mut ours = Figures::default();
    let mut theirs = Figures::default();
    let args = ["--iterations".to_owned(), iterations.to_string(), "--cpu".to_owned(), CPU.to_string()];
    for _ in 0..setting.of(ROUNDS, if setting.shorter > 100 { 1 } else { 3 }) {
        let before = recorded::idle(PERIOD)?;
        let ran = run(iterations, PERIOD, outcome)?;
        let work = ran.thread - (before + recorded::idle(PERIOD)?) / 2.0;
        lossy = ran.kept.failure().or(lossy);
        ours.add(ran.spans, work, ran.process, ran.kept.size as f64 / iterations as f64);
        let mut round = turns.round("hop_logged", &args);
        let their_work = turns.take(&mut round, "work", "ns");
        if their_work.is_empty() {
            continue;
        }
        let missing: f64 = turns.take(&mut round, "missing", "1").iter().sum();
        if missing > 0.0 {
            outcome.note(format!("copper's log lacks {missing} iterations"));
        }
        rounds.push((work, mean(&their_work)));
        let (process, size) =
            (turns.take(&mut round, "process", "ns"), turns.take(&mut round, "log_size", "B"));
        let spans = turns.take(&mut round, "hop", "ns");
        theirs.add(spans, mean(&their_work), mean(&process), mean(&size) / iterations as f64);
    }
    ours.tell(outcome, "");
    theirs.tell(outcome, "_copper");
    match lossy {
        Some(failure) => outcome.without("hop_logged/copper_logged", Some(failure)),
        None => turns.compare(outcome, "hop_logged/copper_logged", rounds),
    }
    if setting.shorter <= 100 {
        fastest(setting, outcome)?;
    }
    Ok(())
}

/// The figures of one side.
#[derive(Default)]
struct Figures {
    spans: Vec<f64>,
    work: Vec<f64>,
    process: Vec<f64>,
    size: Vec<f64>,
}

impl Figures {
    fn add(&mut self, spans: Vec<f64>, work: f64, process: f64, size: f64) {
        self.spans.extend(spans);
        self.work.push(work);
        self.process.push(process / MESSAGES);
        self.size.push(size / MESSAGES);
    }

    fn tell(self, outcome: &mut Outcome, whose: &str) {
        outcome.figure(format!("hop_logged{whose}"), "ns", self.spans);
        outcome.figure(format!("hop_logged_work{whose}"), "ns", self.work);
        outcome.figure(format!("message_process_time{whose}"), "ns", self.process);
        outcome.figure(format!("message_log_size{whose}"), "B", self.size);
    }
}

/// The highest rate at which no message is lost, of those that there were when more and more was asked for; and copper's, whose
/// iterations wait for its log.
fn fastest(setting: &Setting<'_>, outcome: &mut Outcome) -> Result<(), Failure> {
    let mut best: f64 = 0.0;
    for period in FASTER {
        let iterations = FASTER_FOR / period.0 as usize;
        let ran = run(iterations, period, outcome)?;
        let Kept { sent, found, lost, .. } = ran.kept;
        if !ran.kept.is_all() {
            let rate = ran.rate;
            outcome.note(format!(
                "at {rate:.0} iterations a second, of {sent} messages {found} were in the log and {lost} dropped"
            ));
            break;
        }
        best = best.max(ran.rate);
    }
    let best = if best > 0.0 { vec![best] } else { Vec::new() };
    outcome.figure("hop_logged_highest_rate", "1/s", best);
    let mut turns = Turns::new(setting.peers.clone());
    let args = ["--iterations", "200000", "--period", "1000", "--cpu", "0"];
    let mut round = turns.round("hop_logged", &args);
    let spans = turns.take(&mut round, "iteration_each", "ns");
    if !spans.is_empty() {
        outcome.figure("hop_logged_highest_rate_copper", "1/s", vec![1e9 / mean(&spans)]);
    }
    Ok(())
}
