//! What makes no sense is told, all at once.

use schedule::{Exact, Task, TaskSet, What, Wrong};

use crate::n;

#[test]
fn all_that_is_wrong_is_told_at_once() {
    let good = Task::new(n(1), n(10));
    let tasks = vec![
        good.clone(),
        Task::new(n(1), n(0)),
        Task::new(n(-1), n(10)),
        good.clone().with_deadline(n(11)),
        good.clone().with_deadline(n(0)),
        Task { jitter: n(-1), blocking: n(-1), ..good },
    ];
    let what = [
        (1, What::Period),
        (2, What::Cost),
        (3, What::LateDeadline),
        (4, What::Deadline),
        (5, What::Jitter),
        (5, What::Blocking),
    ];
    let expected: Vec<Wrong> = what.map(|(task, what)| Wrong { task, what }).into();
    assert_eq!(TaskSet::new(tasks).unwrap_err(), expected);
}

#[test]
fn fractions_without_end_are_refused() {
    let primes = [1_000_003, 1_000_033, 1_000_037, 1_000_039];
    let tasks = primes.map(|prime| Task::new(Exact::new(1, prime), n(1)));
    assert_eq!(TaskSet::new(tasks.into()).unwrap_err(), [Wrong { task: 3, what: What::TooFine }]);
    let long = Task::new(n(1), n(1 << 90));
    assert_eq!(TaskSet::new(vec![long]).unwrap_err(), [Wrong { task: 0, what: What::TooFine }]);
}

#[test]
fn a_mistake_is_told_by_the_place_that_the_task_had() {
    let tasks = vec![Task::new(n(1), n(9)), Task::new(n(1), n(5)).with_deadline(n(7))];
    assert_eq!(
        TaskSet::deadline_monotonic(tasks).unwrap_err(),
        [Wrong { task: 1, what: What::LateDeadline }]
    );
}

#[test]
fn no_task_misses_nothing() {
    let none = TaskSet::new(Vec::new()).unwrap();
    assert!(schedule::utilization::liu_layland(&none).pass);
    assert!(schedule::response::feasible(&none));
    assert!(schedule::demand::demand(&none).pass());
}
