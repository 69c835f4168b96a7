//! How much faster or costlier a task may become before a deadline is missed, under fixed priorities that stay as they are.

use num_traits::One;

use crate::Exact;
use crate::response::feasible;
use crate::task::{Row, Task, TaskSet};

/// The least period of a task with which all deadlines are still met, in nanoseconds; nothing where none is long enough. A deadline that is
/// the period goes with it; another one stays, and the period is no less. Exact.
///
/// In a time of `w` there are at most k jobs of it when T ≥ (w + J) / k; and with k jobs, a task below is done within the least
/// `w` that holds all the work: so the least of these quotients over k is what each task below asks.
pub fn least_period(set: &TaskSet, task: usize) -> Option<Exact> {
    let rows = set.rows();
    let own = &rows[task];
    // What goes before it does not hear of its period.
    let implicit = set.tasks()[task].deadline.is_none();
    let unbounded = Row { deadline: if implicit { i128::MAX >> 2 } else { own.deadline }, ..*own };
    if rows[..task].iter().map(Row::share).sum::<f64>() >= 1.0 - 1e-12 && implicit && task > 0 {
        // No time would ever be left for it, or as good as none.
        return None;
    }
    let response = crate::response::wait(&unbounded, rows[..task].iter().copied()).ok()?;
    let mut least = Exact::from_integer(if implicit { response } else { own.deadline });
    for below in task + 1..rows.len() {
        let needed = asked_by(rows, task, below)?;
        least = least.max(needed);
    }
    let all_before = (0..task).all(|at| crate::response::meets(&rows[at], rows[..at].iter().copied()));
    all_before.then(|| least / Exact::from_integer(set.ticks()))
}

/// The least period of `task` with which `below` meets its deadline, in ticks.
fn asked_by(rows: &[Row], task: usize, below: usize) -> Option<Exact> {
    let (own, low) = (&rows[task], &rows[below]);
    let others = || rows[..below].iter().enumerate().filter(|(at, _)| *at != task).map(|(_, row)| *row);
    let mut least: Option<Exact> = None;
    let mut jobs = 1;
    loop {
        let work = own.cost.saturating_mul(jobs);
        let with = Row { blocking: low.blocking.saturating_add(work), ..*low };
        let Ok(response) = crate::response::wait(&with, others()) else { return least };
        let window = response - low.jitter;
        let period = Exact::new(window + own.jitter, jobs);
        least = Some(least.map_or(period, |least| least.min(period)));
        // More jobs need a longer time; they cannot ask less than their own cost.
        if own.cost == 0 || least.is_some_and(|least| least <= Exact::from_integer(own.cost)) {
            return least;
        }
        jobs += 1;
    }
}

/// The largest factor by which the cost of a task may be multiplied; of all tasks when none is named. Nothing where even no cost at all is
/// too much, or where there is no bound. To nine digits, and never more than what is feasible.
pub fn largest_cost_factor(set: &TaskSet, task: Option<usize>) -> Option<f64> {
    let with = |factor: Exact| scaled(set, task, factor).is_some_and(|set| feasible(&set));
    largest(with)
}

fn scaled(set: &TaskSet, task: Option<usize>, factor: Exact) -> Option<TaskSet> {
    let tasks = set.tasks().iter().enumerate();
    let tasks = tasks.map(|(at, it)| {
        let cost = if task.is_none_or(|task| task == at) { it.cost * factor } else { it.cost };
        Task { cost, ..it.clone() }
    });
    TaskSet::new(tasks.collect()).ok()
}

/// One is 2^30 of these steps.
const STEPS_OF_ONE: i128 = 1 << 30;

/// The largest number for which something holds that holds for all smaller ones: exactly so where that is a whole number or a half of one or
/// the like, else a billionth less.
pub fn largest(holds: impl Fn(Exact) -> bool) -> Option<f64> {
    let at = |steps: i128| Exact::new(steps, STEPS_OF_ONE);
    if !holds(at(0)) {
        return None;
    }
    let (mut low, mut high) = if holds(Exact::one()) {
        let doubles = (1..60).map(|n| STEPS_OF_ONE << n);
        let high = doubles.into_iter().find(|steps| !holds(at(*steps)))?;
        (high / 2, high)
    } else {
        (0, STEPS_OF_ONE)
    };
    while high - low > 1 {
        let middle = low + (high - low) / 2;
        if holds(at(middle)) {
            low = middle;
        } else {
            high = middle;
        }
    }
    Some(low as f64 / STEPS_OF_ONE as f64)
}
