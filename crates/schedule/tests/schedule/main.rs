//! The analysis against numbers that were not made here, and against schedules that are played.
#![allow(clippy::unwrap_used)] // helpers of tests are tests

mod bad;
mod governing;
mod managing;
mod managing_cases;
mod played;
mod systems;
mod tests_of_papers;

use schedule::{Exact, Task, TaskSet};

/// A whole number.
fn n(number: i128) -> Exact {
    Exact::from_integer(number)
}

/// Tasks of (cost, period), the first of highest priority.
fn set(tasks: &[(i128, i128)]) -> TaskSet {
    TaskSet::new(tasks.iter().map(|(cost, period)| Task::new(n(*cost), n(*period))).collect()).unwrap()
}

/// The six tasks of the competition robot's paper, Table III, in nanoseconds, by their rates: S, W1, W2, A, M, R.
fn table_iii() -> TaskSet {
    let us = |tenths: i128| Exact::new(tenths * 100, 1);
    let tasks = [(163, Exact::from_integer(89_280)), (244, us(1000)), (244, us(1000)), (409, us(20_000))];
    let rest = [(199, us(500_000)); 2];
    let tasks = tasks.into_iter().chain(rest);
    TaskSet::new(tasks.map(|(cost, period)| Task::new(us(cost), period)).collect()).unwrap()
}
