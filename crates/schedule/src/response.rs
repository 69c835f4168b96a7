//! How long a task takes at worst under fixed priorities on one processor: exact response times.
//!
//! Joseph and Pandya 1986, Audsley and others 1993: w = C + B + Σ ⌈(w + Jⱼ) / Tⱼ⌉ Cⱼ over all of higher priority, its least solution. The
//! response is w + J, and holds where it is within the deadline; so a deadline is no later than the period. Without blocking the bound is
//! reached: when all become ready together, as late after their arrivals as they may.

use crate::Exact;
use crate::task::{Row, TaskSet};

/// How long a task takes at worst from its arrival on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Response {
    /// Its place in the set.
    pub task: usize,
    /// From its arrival to its end, in nanoseconds. Where the deadline is missed: by what time it is not done yet; the first that is found
    /// to be too late.
    pub at_worst: Exact,
    /// Whether that is within its deadline.
    pub meets: bool,
}

/// The responses of all tasks, in the order of their priorities.
pub fn responses(set: &TaskSet) -> Vec<Response> {
    (0..set.len()).map(|task| response(set, task)).collect()
}

/// Whether all deadlines are met.
pub fn feasible(set: &TaskSet) -> bool {
    let rows = set.rows();
    (0..rows.len()).all(|task| meets(&rows[task], rows[..task].iter().copied()))
}

/// The response of one task.
pub fn response(set: &TaskSet, task: usize) -> Response {
    let rows = set.rows();
    let (at_worst, meets) = match wait(&rows[task], rows[..task].iter().copied()) {
        Ok(time) => (time, true),
        Err(time) => (time, false),
    };
    Response { task, at_worst: set.time(at_worst), meets }
}

/// The response of `own` under those who go before it, when it is within the deadline; else a time at which it is not done yet.
pub(crate) fn wait(own: &Row, before: impl Iterator<Item = Row> + Clone) -> Result<i128, i128> {
    let mut ready = own.cost + own.blocking;
    loop {
        let response = ready.saturating_add(own.jitter);
        if response > own.deadline {
            return Err(response);
        }
        let work = before.clone().fold(own.cost + own.blocking, |sum, row| {
            // In no time at all everything that becomes ready at once is there already.
            sum.saturating_add(row.work_within(ready.max(1)))
        });
        if work == ready {
            return Ok(response);
        }
        ready = work;
    }
}

/// Whether `own` is done in time under those who go before it; a bound in closed form is asked first.
pub(crate) fn meets(own: &Row, before: impl Iterator<Item = Row> + Clone) -> bool {
    let (mut share, mut work) = (0.0, (own.cost + own.blocking) as f64);
    for row in before.clone() {
        // ⌈x⌉ C < x C + C
        share += row.share();
        work += row.cost as f64 + row.share() * row.jitter as f64;
    }
    let bound = work / (1.0 - share) + own.jitter as f64;
    if share < 0.999 && bound < own.deadline as f64 * 0.999 {
        return true;
    }
    wait(own, before).is_ok()
}
