//! The hop with copper's log on, at a given rate.

use cu29::prelude::*;

use super::log::{LogFolder, iterations_in};
use super::part::Part;
use super::tasks::{self, Hand, Parcel, Sink, Source};
use super::{document, failed};
use crate::document::{Document, Figure};
use crate::machine::settle;
use crate::settings::Settings;

/// `iteration_each`, `hop`: as without a log. Of the processor, for each iteration, as means of a tenth of the run: `work`: what the
/// iteration itself takes of its thread; `thread`: the same with the sleep before it and with being measured; `process`: of all
/// threads. `idle`: `thread` where nothing is done. `missing`: iterations that are not in the log.
pub(crate) const FIGURES: &[&str] =
    &["iteration_each", "hop", "work", "thread", "process", "idle", "missing", "log_size"];

/// Five seconds where nobody says how long, at 10 000 iterations a second (ns).
const ITERATIONS: u64 = 50_000;
const PERIOD: u64 = 100_000;
/// In so many parts a run is divided, and in so many iterations nothing is done for comparison.
const PARTS: u64 = 10;
const IDLE: u64 = 5_000;

#[copper_runtime(config = "src/copper/logged.ron")]
struct Logged {}

/// Measures.
pub(crate) fn measure(settings: &Settings) -> Result<Document, String> {
    let folder = LogFolder::make()?;
    let granted = settle("hop_logged", settings, 0);
    let clock = RobotClock::default();
    let period = settings.period.unwrap_or(PERIOD);
    let part = settings.iterations_or(ITERATIONS).div_ceil(PARTS);
    tasks::stamp(true);
    let builder = Logged::builder().with_clock(clock.clone()).with_log_path(folder.base(), None);
    let app = builder.and_then(|builder| builder.build()).map_err(failed)?;
    let mut app = app.start().map_err(failed)?;
    let mut result = Ok(());
    let mut iterate = || {
        if result.is_ok() {
            result = app.run_one_iteration();
        }
    };
    let mut spans = Vec::new();
    let (mut work, mut thread, mut process) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..PARTS {
        let part = Part::run(part, period, &clock, &mut iterate);
        work.push(part.work);
        thread.push(part.thread);
        process.push(part.process);
        spans.extend(part.spans);
    }
    result.map_err(failed)?;
    drop(app.stop().map_err(failed)?);
    let idle = Part::run(IDLE, period, &clock, || ());
    work.iter_mut().for_each(|work| *work -= idle.work);
    let seen = tasks::seen();
    let written = iterations_in::<default::CuStampedDataSet>(&folder.base())?;
    let missing = (PARTS * part).saturating_sub(written) + seen.missing;
    Ok(document(
        granted,
        vec![
            Figure::times("iteration_each", spans),
            Figure::times("hop", seen.spans),
            Figure::new("work", "ns", work),
            Figure::new("thread", "ns", thread),
            Figure::new("process", "ns", process),
            Figure::new("idle", "ns", vec![idle.thread]),
            Figure::new("missing", "1", vec![missing as f64]),
            Figure::new("log_size", "B", vec![folder.size() as f64]),
        ],
    ))
}
