//! The hop without a log: as fast as it can be, or paced.

use cu29::prelude::*;

use super::tasks::{self, Hand, Parcel, Sink, Source};
use super::{document, failed};
use crate::document::{Document, Figure};
use crate::machine::{means, now, room, settle, sleep_until};
use crate::settings::Settings;

/// `iteration`: mean over 1000 of them, unstamped. `iteration_each`: by copper's clock, with one reading of it. `hop`: from the
/// source's step to the sink's. `rate`: of the unstamped ones. Paced, there are no means and no rate.
pub(crate) const FIGURES: &[&str] = &["iteration", "iteration_each", "hop", "rate", "missing"];

/// Iterations where nobody says how many, and how many make a mean.
const ITERATIONS: u64 = 100_000;
const BLOCK: u64 = 1000;
/// Iterations before anything is measured.
const WARM_UP: u64 = 10_000;

#[copper_runtime(config = "src/copper/hop.ron")]
struct Hop {}

/// Measures.
pub(crate) fn measure(settings: &Settings) -> Result<Document, String> {
    let granted = settle("hop", settings, 0);
    let clock = RobotClock::default();
    let iterations = settings.iterations_or(ITERATIONS);
    tasks::stamp(false);
    let app = Hop::builder().with_clock(clock.clone()).build().map_err(failed)?;
    let mut app = app.start().map_err(failed)?;
    let mut result = Ok(());
    let mut iterate = || {
        if result.is_ok() {
            result = app.run_one_iteration();
        }
    };
    (0..WARM_UP.min(iterations)).for_each(|_| iterate());
    let mut figures = Vec::new();
    match settings.period {
        None => {
            let blocks = iterations.div_ceil(BLOCK);
            let begun = now();
            let iteration = means(blocks, BLOCK, &mut iterate);
            let rate = (blocks * BLOCK) as f64 * 1e9 / (now() - begun) as f64;
            tasks::stamp(true);
            figures.push(Figure::new("iteration", "ns", iteration));
            figures.push(Figure::times("iteration_each", each(iterations, &clock, &mut iterate)));
            figures.push(Figure::new("rate", "1/s", vec![rate]));
        }
        Some(period) => {
            tasks::stamp(true);
            let spans = paced(iterations, period, &clock, &mut iterate);
            figures.push(Figure::times("iteration_each", spans));
        }
    }
    result.map_err(failed)?;
    drop(app.stop().map_err(failed)?);
    let seen = tasks::seen();
    if seen.taken == 0 {
        return Err("nothing came to the sink".to_owned());
    }
    figures.push(Figure::times("hop", seen.spans));
    figures.push(Figure::new("missing", "1", vec![seen.missing as f64]));
    Ok(document(granted, figures))
}

/// Iterations one right after the other: the end of one is the beginning of the next, so each has one reading of the clock in it.
pub(super) fn each(iterations: u64, clock: &RobotClock, mut iterate: impl FnMut()) -> Vec<u64> {
    let mut spans = room(iterations);
    let mut before = clock.now();
    for _ in 0..iterations {
        iterate();
        let after = clock.now();
        spans.push((after - before).as_nanos());
        before = after;
    }
    spans
}

/// Iterations at a period (ns); between them the thread sleeps.
fn paced(iterations: u64, period: u64, clock: &RobotClock, mut iterate: impl FnMut()) -> Vec<u64> {
    let mut spans = room(iterations);
    let begun = now();
    for round in 1..=iterations {
        sleep_until(begun + round * period);
        let before = clock.now();
        iterate();
        spans.push((clock.now() - before).as_nanos());
    }
    spans
}
