//! A bare thread that sleeps until a time and looks how late it is: what the machine allows at best.

use crate::document::{Document, Figure};
use crate::machine::{kernel, now, room, settle, sleep_until};
use crate::settings::Settings;

/// The other system.
pub(crate) const PEER: &str = "clock_nanosleep";

/// `late`: from the release to the first instruction after it, of each release.
pub(crate) const FIGURES: &[&str] = &["late"];

/// Releases where nobody says how many, and the time between them (ns).
const ITERATIONS: u64 = 2000;
const PERIOD: u64 = 1_000_000;

/// Measures.
pub(crate) fn measure(settings: &Settings) -> Result<Document, String> {
    let granted = settle("sleeps", settings, 0);
    let period = settings.period.unwrap_or(PERIOD);
    let iterations = settings.iterations_or(ITERATIONS);
    let mut late = room(iterations);
    let begun = settings.first(now(), period);
    for round in 0..iterations {
        let release = begun + round * period;
        sleep_until(release);
        late.push(now().saturating_sub(release));
    }
    Ok(Document {
        peer: PEER,
        version: kernel(),
        granted: vec![granted],
        figures: vec![Figure::times("late", late)],
    })
}
