//! How much of what a system is for was done.

/// What an agent did in a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Work {
    /// How important it is, in 0..1.
    pub importance: f64,
    /// How many steps it should have done at its nominal rate.
    pub nominal: f64,
    /// How many it did within their deadlines.
    pub in_time: f64,
    /// How good they were on the mean, in 0..1.
    pub quality: f64,
}

/// The share of useful work that was done: W = Σ wᵢ min(1, doneᵢ / nominalᵢ) qᵢ / Σ wᵢ, in 0..1, with the importance w and the quality q.
///
/// Steps beyond the nominal number are of no use. Who should have done nothing does not count, and where nothing counts all was done.
pub fn useful_work(agents: &[Work]) -> f64 {
    let counted = agents.iter().filter(|work| work.nominal > 0.0 && work.importance > 0.0);
    let (mut sum, mut weight) = (0.0, 0.0);
    for work in counted {
        let share = (work.in_time / work.nominal).clamp(0.0, 1.0);
        sum += work.importance * share * work.quality.clamp(0.0, 1.0);
        weight += work.importance;
    }
    if weight > 0.0 { sum / weight } else { 1.0 }
}
