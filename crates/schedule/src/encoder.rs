//! What a wheel controller asks of its periods: equations (3) and (5) of the competition robot's paper.

use num_traits::Zero;

use crate::Exact;
use crate::exact::near;
use crate::utilization::liu_layland_bound;

/// The longest period in which no more than one edge of an encoder comes, in nanoseconds: 60 s / (n_max pulses), eq. (3). For speeds in
/// revolutions a minute and pulses a revolution; nothing where the wheel does not turn.
pub fn longest_period(revolutions_a_minute: Exact, pulses_a_revolution: Exact) -> Option<Exact> {
    let pulses = revolutions_a_minute * pulses_a_revolution;
    (pulses > Exact::zero()).then(|| Exact::from_integer(60_000_000_000) / pulses)
}

/// The least common period T of some tasks that passes the test of Liu and Layland, beside others whose periods stand, eq. (5):
/// T ≥ Σ cᵢ / rᵢ / (n (2^(1/n) − 1) − U), for tasks with cost cᵢ and period rᵢ T. In the unit of the costs; nothing where the
/// others leave no room.
pub fn least_common_period(tied: &[(Exact, Exact)], others: &[(Exact, Exact)]) -> Option<f64> {
    let room = liu_layland_bound(tied.len() + others.len())
        - others.iter().map(|(cost, period)| near(*cost) / near(*period)).sum::<f64>();
    let work: f64 = tied.iter().map(|(cost, ratio)| near(*cost) / near(*ratio)).sum();
    (room > 0.0).then(|| work / room)
}
