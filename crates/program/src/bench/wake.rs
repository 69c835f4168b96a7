//! Waking: how long it takes to wake an agent by a message, and how late the clock wakes it.

mod jitter;
mod pairs;

use super::Setting;
use super::outcome::Outcome;
use crate::error::Failure;

/// The priority of all threads that are measured, on both sides.
const PRIORITY: u8 = 80;

pub(super) fn measure(setting: &Setting<'_>) -> Result<Outcome, Failure> {
    let mut outcome = Outcome::default();
    pairs::measure(setting, &mut outcome, "wake_same", "wake_same/futex", (0, 0))?;
    if std::thread::available_parallelism().map_or(1, usize::from) > 1 {
        pairs::measure(setting, &mut outcome, "wake_cross", "wake_cross/futex", (0, 1))?;
    } else {
        outcome.without("wake_cross/futex", None);
    }
    jitter::measure(setting, &mut outcome)?;
    Ok(outcome)
}
