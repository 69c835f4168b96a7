//! The earliest deadline first, on one processor: whether what must be done within any time can be done in it.
//!
//! Baruah, Rosier and Howell 1990: Σ max(0, ⌊(L − Dᵢ) / Tᵢ⌋ + 1) Cᵢ ≤ L for every absolute deadline L up to the end of the longest time in
//! which the processor is never idle. Who becomes ready late has that much less time; who may be blocked adds it from its
//! deadline on. Walked from the end as Zhang and Burns 2009 do, which meets few of the deadlines.

use crate::Exact;
use crate::task::{Row, TaskSet};
use crate::utilization::{rows_fill, rows_fit};

/// What the demand test says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Demand {
    /// All deadlines are met.
    Met,
    /// More must be done than can be.
    Exceeded {
        /// Within so long from the moment when all arrive together, in nanoseconds.
        within: Exact,
        /// So much is to be done.
        work: Exact,
    },
    /// More than a whole processor is needed in the long run.
    Overloaded,
    /// The processor is as good as full, and the time to be looked at is too long.
    Open,
}

impl Demand {
    /// Whether all deadlines are met.
    pub fn pass(self) -> bool {
        self == Demand::Met
    }
}

/// So many steps are gone at most to find the end of a busy time.
const STEPS: usize = 1_000_000;

/// Whether all deadlines of the set are met.
pub fn demand(set: &TaskSet) -> Demand {
    let rows = set.rows();
    if !rows_fit(rows) {
        return Demand::Overloaded;
    }
    let plain = |row: &Row| row.deadline == row.period && row.jitter == 0 && row.blocking == 0;
    if rows.iter().all(plain) || rows.is_empty() {
        return Demand::Met;
    }
    let Some(horizon) = horizon(rows) else { return Demand::Open };
    match exceeded(rows, horizon) {
        Ok(None) => Demand::Met,
        Ok(Some((within, work))) => Demand::Exceeded { within: set.time(within), work: set.time(work) },
        Err(()) => Demand::Open,
    }
}

/// What must be done within a time of this length (in nanoseconds) when all arrive together and as late as they may, in nanoseconds.
pub fn demand_within(set: &TaskSet, length: Exact) -> Exact {
    let ticks = (length * Exact::from_integer(set.ticks())).floor().to_integer();
    set.time(work_due(set.rows(), ticks))
}

/// When a job of the task that is `n` after the first must be done.
fn due(row: &Row) -> i128 {
    row.deadline - row.jitter
}

/// What must be done by then: h(L), and who is blocked.
fn work_due(rows: &[Row], length: i128) -> i128 {
    let jobs = rows.iter().map(|row| match length - due(row) {
        late if late < 0 => 0,
        time => (time / row.period + 1).saturating_mul(row.cost),
    });
    let blocked = rows.iter().filter(|row| due(row) <= length).map(|row| row.blocking).max();
    jobs.fold(blocked.unwrap_or(0), i128::saturating_add)
}

/// The last deadline before that.
fn deadline_before(rows: &[Row], length: i128) -> Option<i128> {
    let last = |row: &Row| {
        let time = length - 1 - due(row);
        (time >= 0).then(|| time / row.period * row.period + due(row))
    };
    rows.iter().filter_map(last).max()
}

/// After this nothing new is to be learnt.
fn horizon(rows: &[Row]) -> Option<i128> {
    let longest_wait = rows.iter().map(|row| row.blocking).max().unwrap_or(0);
    // The end of the time in which the processor is busy without a pause when all come together.
    let mut busy = rows.iter().fold(longest_wait, |sum, row| sum + row.cost).max(1);
    let mut ended = None;
    for _ in 0..STEPS {
        let work = rows.iter().fold(longest_wait, |sum, row| sum.saturating_add(row.work_within(busy)));
        if work <= busy {
            ended = Some(busy);
            break;
        }
        busy = work;
    }
    let latest = rows.iter().map(due).max().unwrap_or(0);
    // L* = (Σ (T − D) U + B) / (1 − U), rounded up.
    let bound = || {
        if rows_fill(rows) {
            return None;
        }
        let share: f64 = rows.iter().map(Row::share).sum();
        let early: f64 = rows.iter().map(|row| (row.period - due(row)) as f64 * row.share()).sum();
        let bound = (early + longest_wait as f64) / (1.0 - share) * (1.0 + 1e-6);
        (share < 1.0 - 1e-9 && bound < 1e30).then(|| (bound.ceil() as i128 + 1).max(latest))
    };
    match (ended, bound()) {
        (Some(a), Some(b)) => Some(a.min(b).max(1)),
        (one, other) => one.or(other),
    }
}

/// The time within which too much is to be done, and how much; nothing where there is none.
fn exceeded(rows: &[Row], horizon: i128) -> Result<Option<(i128, i128)>, ()> {
    let Some(first) = rows.iter().map(due).min() else { return Ok(None) };
    if first < 0 {
        return Ok(Some((0, work_due(rows, 0))));
    }
    let Some(mut at) = deadline_before(rows, horizon + 1) else { return Ok(None) };
    for _ in 0..STEPS {
        let work = work_due(rows, at);
        if work > at {
            return Ok(Some((at, work)));
        }
        if work <= first {
            // All of it is done before anything is due.
            return Ok(None);
        }
        at = match work {
            work if work < at => work,
            _ => match deadline_before(rows, at) {
                Some(before) => before,
                None => return Ok(None),
            },
        };
    }
    Err(())
}
