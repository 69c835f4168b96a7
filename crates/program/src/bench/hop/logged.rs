//! The chain with a log of all that is sent, 10 000 messages a second from the source, beside copper with its log; and the highest rate
//! at which neither loses anything.

use types::Duration;

use super::beside::{self, PERIOD, Ran, Work};
use super::chain::{self, Trace};
use super::recorded::{self, Kept};
use crate::bench::Setting;
use crate::bench::outcome::Outcome;
use crate::bench::turns::{Turns, mean};
use crate::error::Failure;

const WORK: Work = Work {
    name: "hop_logged",
    theirs: "hop_logged",
    ratios: ["hop_logged_median/copper_logged", "hop_logged/copper_logged", "hop_logged_p99/copper_logged"],
    prefix: "",
    messages: 4.0,
};
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

fn run(iterations: usize, period: Duration, outcome: &mut Outcome) -> Result<Ran, Failure> {
    let trace = Trace::of_iterations(iterations);
    let plan = chain::plan(period, true);
    let kept = recorded::run(&plan, &trace.registry(), trace.options(period), outcome)?;
    let (process, rate) = trace.each()?;
    let spans = trace.iteration.map_or(Ok(Vec::new()), |iteration| iteration.spans())?;
    Ok(Ran { spans, process, rate, kept })
}

/// Rounds of ours and of copper's, in turns.
pub(super) fn measure(setting: &Setting<'_>, outcome: &mut Outcome) -> Result<(), Failure> {
    let mut round = |iterations, outcome: &mut Outcome| run(iterations, PERIOD, outcome);
    beside::measure(setting, outcome, &WORK, &mut round)?;
    if setting.shorter <= 100 {
        fastest(setting, outcome)?;
    }
    Ok(())
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
    let rates = turns.take(&mut round, "rate", "1/s");
    let missing: f64 = turns.take(&mut round, "missing", "1").iter().sum();
    if missing > 0.0 {
        outcome.note(format!("copper as fast as it can be: its log lacks {missing} iterations"));
    } else if !rates.is_empty() {
        outcome.figure("hop_logged_highest_rate_copper", "1/s", vec![mean(&rates)]);
    }
    Ok(())
}
