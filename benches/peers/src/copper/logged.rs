//! The hop with copper's log on, at a given rate.

use cu29::prelude::*;

use super::log::{LogFolder, iterations_in};
use super::part::{Part, WARM_UP};
use super::tasks::{self, Hand, Parcel, Sink, Source};
use super::{document, failed};
use crate::document::{Document, Figure};
use crate::machine::settle;
use crate::settings::Settings;

/// `iteration_each`: each call of the body of copper's loop, with the writing of its log. As means of a tenth of the run, for each iteration:
/// `thread`: processor time of its thread, with the sleep before it and with being measured; `process`: of all threads; `rate`: iterations
/// in a second. `missing`: iterations that are not in the log.
pub(crate) const FIGURES: &[&str] = &["iteration_each", "rate", "thread", "process", "missing", "log_size"];

/// Five seconds where nobody says how long, at 10 000 iterations a second (ns).
const ITERATIONS: u64 = 50_000;
const PERIOD: u64 = 100_000;
/// In so many parts a run is divided.
const PARTS: u64 = 10;

#[copper_runtime(config = "src/copper/logged.ron")]
struct Logged {}

/// Measures.
pub(crate) fn measure(settings: &Settings) -> Result<Document, String> {
    let folder = LogFolder::make()?;
    let granted = settle("hop_logged", settings, 0);
    let period = settings.period.unwrap_or(PERIOD);
    let part = settings.iterations_or(ITERATIONS).div_ceil(PARTS);
    // What a task reads of the clock would be a part of the iteration.
    tasks::stamp(false);
    let builder = Logged::builder().with_clock(RobotClock::default()).with_log_path(folder.base(), None);
    let app = builder.and_then(|builder| builder.build()).map_err(failed)?;
    let mut app = app.start().map_err(failed)?;
    let mut result = Ok(());
    let mut iterate = || {
        if result.is_ok() {
            result = app.run_one_iteration();
        }
    };
    (0..WARM_UP).for_each(|_| iterate());
    let parts: Vec<Part> = (0..PARTS).map(|_| Part::run(part, period, &mut iterate)).collect();
    result.map_err(failed)?;
    drop(app.stop().map_err(failed)?);
    let seen = tasks::seen();
    let written = iterations_in::<default::CuStampedDataSet>(&folder.base())?;
    let missing = (WARM_UP + PARTS * part).saturating_sub(written) + seen.missing;
    let means = |of: fn(&Part) -> f64| parts.iter().map(of).collect();
    Ok(document(
        granted,
        vec![
            Figure::new("rate", "1/s", means(|part| 1e9 / part.whole)),
            Figure::new("thread", "ns", means(|part| part.thread)),
            Figure::new("process", "ns", means(|part| part.process)),
            Figure::new("missing", "1", vec![missing as f64]),
            Figure::new("log_size", "B", vec![folder.size() as f64]),
            Figure::times("iteration_each", parts.into_iter().flat_map(|part| part.spans).collect()),
        ],
    ))
}
