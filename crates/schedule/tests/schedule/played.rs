//! The analysis against schedules that are played.

use std::collections::HashMap;

use proptest::prelude::*;
use schedule::demand::demand;
use schedule::elastic::{Spring, compress, compress_to_deadlines};
use schedule::partition::first_fit;
use schedule::response::{feasible, responses};
use schedule::sensitivity::{largest_cost_factor, least_period};
use schedule::simulate::{Arrival, How, Policy, Schedule, play, simulate};
use schedule::{Exact, Task, TaskSet};

use crate::n;

const HOW: How = How { policy: Policy::FixedPriority, processors: 1, length: Exact::new_raw(0, 1) };

fn task() -> impl Strategy<Value = Task> {
    // Periods from a few ticks to many, costs up to a half; deadlines that are the period or shorter.
    (prop_oneof![4i128..=12, 10i128..=60, 50i128..=300], 1u32..=50, 60u32..=140, 0u32..=60).prop_map(
        |(period, share, due, late)| {
            let part = |percent: u32| period * i128::from(percent) / 100;
            let task = Task {
                jitter: n(part(late.saturating_sub(30))),
                ..Task::new(n(part(share).max(1)), n(period))
            };
            if due < 100 { task.with_deadline(n(part(due).max(1))) } else { task }
        },
    )
}

fn tasks() -> impl Strategy<Value = Vec<Task>> {
    proptest::collection::vec(task(), 1..=6)
}

fn sorted(tasks: Vec<Task>) -> TaskSet {
    TaskSet::deadline_monotonic(tasks).unwrap().0
}

fn long_enough(set: &TaskSet) -> Exact {
    set.tasks().iter().map(|task| task.period).max().unwrap() * n(3)
}

/// Says what is wrong with a formula for response times, when played schedules contradict it.
fn contradicted(
    set: &TaskSet,
    respond: &dyn Fn(&TaskSet) -> Vec<(Exact, bool)>,
    chance: u64,
) -> Option<String> {
    let told = respond(set);
    let how = How { length: long_enough(set), ..HOW };
    let worst = simulate(set, how);
    let any = play(set, how, &mut at_random(set, chance));
    for (at, (told, meets)) in told.into_iter().enumerate() {
        for played in [&worst, &any] {
            let longest = played.longest(at);
            if meets && (longest.is_some_and(|longest| longest > told) || played.missed(at) > 0) {
                return Some(format!("{at}: told {told}, took {longest:?}, {} missed", played.missed(at)));
            }
        }
        let first = worst.jobs.iter().find(|job| job.task == at).unwrap();
        let took = first.end.map(|end| Exact::from_integer(end - first.arrival));
        if meets && took != Some(told) {
            return Some(format!("{at}: when all come together it takes {took:?}, told {told}"));
        }
        if !meets && took.is_some_and(|took| took <= set.tasks()[at].due()) {
            return Some(format!("{at}: told to miss its deadline, and took {took:?}"));
        }
    }
    None
}

/// Arrivals as the tasks allow them: not before the period is over, late by up to the jitter, at a cost that is no more than it may be.
fn at_random(set: &TaskSet, chance: u64) -> impl FnMut(usize, usize) -> Option<Arrival> + '_ {
    let mut state = chance | 1;
    let mut draw = move |up_to: Exact| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        n(i128::from(state >> 33) % (up_to.to_integer() + 1))
    };
    let mut last: HashMap<usize, Exact> = HashMap::new();
    move |at, _| {
        let task = &set.tasks()[at];
        let after = last.get(&at).map_or(n(0), |last| *last + task.period);
        let arrival = after + if draw(n(3)) == n(0) { draw(task.period) } else { n(0) };
        last.insert(at, arrival);
        Some(Arrival { at: arrival, late: draw(task.jitter), cost: task.cost - draw(task.cost / n(4)) })
    }
}

fn ours(set: &TaskSet) -> Vec<(Exact, bool)> {
    responses(set).iter().map(|response| (response.at_worst, response.meets)).collect()
}

/// The same with one error: a job that becomes ready just as the others are done is left out, or counted too early.
fn with_an_error(set: &TaskSet, error: i128) -> Vec<(Exact, bool)> {
    let tasks = set.tasks();
    let respond = |at: usize| {
        let task = &tasks[at];
        let mut ready = task.cost;
        while ready + task.jitter <= task.due() {
            let jobs = |other: &Task| ((ready + other.jitter + n(error)) / other.period).floor() + n(1);
            let work = tasks[..at].iter().fold(task.cost, |sum, other| sum + jobs(other) * other.cost);
            if work == ready {
                break;
            }
            ready = work;
        }
        (ready + task.jitter, ready + task.jitter <= task.due())
    };
    (0..tasks.len()).map(respond).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(10_000))]

    #[test]
    fn no_job_takes_longer_than_told_and_one_takes_as_long(tasks in tasks(), chance: u64) {
        prop_assert_eq!(contradicted(&sorted(tasks), &ours, chance), None);
    }
}

#[test]
fn an_error_in_the_formula_is_found() {
    use proptest::strategy::ValueTree;
    let mut runner = proptest::test_runner::TestRunner::deterministic();
    for error in [0, -2] {
        let found = (0..1000u64).any(|chance| {
            let set = sorted(tasks().new_tree(&mut runner).unwrap().current());
            contradicted(&set, &|set| with_an_error(set, error), chance).is_some()
        });
        assert!(found, "{error}");
    }
    let right = |chance| {
        let set = sorted(tasks().new_tree(&mut runner).unwrap().current());
        contradicted(&set, &|set| with_an_error(set, -1), chance)
    };
    assert_eq!((0..1000u64).find_map(right), None);
}

/// Everything that happens until the same begins again, when all arrive together at first.
fn all_of_it(set: &TaskSet, policy: Policy) -> Option<Schedule> {
    let cycle =
        set.tasks().iter().fold(1i128, |cycle, task| num_integer_lcm(cycle, task.period.to_integer()));
    (cycle < 20_000).then(|| simulate(set, How { policy, length: n(cycle), ..HOW }))
}

fn num_integer_lcm(a: i128, b: i128) -> i128 {
    let (mut x, mut y) = (a, b);
    while y != 0 {
        (x, y) = (y, x % y);
    }
    a / x * b
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// Without jitter all deadlines are met when they are met from the moment when all come together.
    #[test]
    fn the_demand_test_says_what_is_played(tasks in tasks()) {
        let plain = tasks.into_iter().map(|task| Task { jitter: n(0), ..task });
        let set = TaskSet::new(plain.collect()).unwrap();
        let Some(played) = all_of_it(&set, Policy::EarliestDeadline) else { return Ok(()) };
        let missed = (0..set.len()).any(|at| played.missed(at) > 0) || set.utilization() > 1.0 + 1e-9;
        prop_assert_eq!(demand(&set).pass(), !missed, "{:?}", demand(&set));
    }

    #[test]
    fn what_meets_deadlines_by_priority_meets_them_by_deadline(tasks in tasks()) {
        let set = sorted(tasks);
        prop_assert!(!feasible(&set) || demand(&set).pass());
    }

    #[test]
    fn the_least_period_is_the_least(tasks in tasks(), which: usize) {
        let set = sorted(tasks);
        let which = which % set.len();
        let with = |period: Exact| {
            let mut tasks = set.tasks().to_vec();
            tasks[which].period = period;
            TaskSet::new(tasks).is_ok_and(|set| feasible(&set))
        };
        match least_period(&set, which) {
            Some(least) => {
                prop_assert!(with(least), "{least} is not enough");
                prop_assert!(!with(least * Exact::new(999_999, 1_000_000)), "{least} is more than is needed");
            }
            None => prop_assert!(!with(n(1_000_000_000))),
        }
    }

    #[test]
    fn the_largest_cost_is_the_largest(tasks in tasks(), which: usize) {
        let set = sorted(tasks);
        let which = which % set.len();
        let with = |factor: f64| {
            let mut tasks = set.tasks().to_vec();
            tasks[which].cost *= Exact::new((factor * (1u64 << 31) as f64) as i128, 1 << 31);
            feasible(&TaskSet::new(tasks).unwrap())
        };
        if let Some(factor) = largest_cost_factor(&set, Some(which)) {
            prop_assert!(with(factor));
            prop_assert!(!with(factor * 1.000_001 + 1e-6));
            prop_assert_eq!(factor >= 1.0, feasible(&set));
        } else {
            prop_assert!(!with(0.0));
        }
    }

    #[test]
    fn what_first_fit_places_meets_its_deadlines(tasks in tasks(), more in tasks(), processors in 1usize..4) {
        let all: Vec<Task> = sorted(tasks.into_iter().chain(more).collect()).tasks().to_vec();
        let count = all.len();
        let placed = first_fit(all, processors).unwrap();
        let mut seen: Vec<usize> = placed.processors.iter().flat_map(|(_, places)| places.clone()).collect();
        seen.sort_unstable();
        prop_assert_eq!(seen, (0..count).collect::<Vec<_>>());
        let meet = placed.processors.iter().all(|(set, _)| feasible(set));
        prop_assert_eq!(meet, placed.homeless.is_empty());
    }

    #[test]
    fn springs_give_as_much_as_they_must(
        springs in proptest::collection::vec((1.0..50.0f64, 50.0..200.0f64, 1.0..4.0f64, 0.0..3.0f64), 1..8),
        target in 0.1..1.5f64,
    ) {
        let springs: Vec<Spring> = springs
            .into_iter()
            .map(|(cost, nominal, factor, elasticity)| Spring { cost, nominal, longest: nominal * factor, elasticity })
            .collect();
        let used = |periods: &[f64]| springs.iter().zip(periods).map(|(it, period)| it.cost / period).sum::<f64>();
        let nominal: Vec<f64> = springs.iter().map(|it| it.nominal).collect();
        match compress(&springs, target) {
            Ok(periods) => {
                for (spring, period) in springs.iter().zip(&periods) {
                    prop_assert!(*period >= spring.nominal * (1.0 - 1e-12) && *period <= spring.longest * (1.0 + 1e-12));
                    prop_assert!(spring.elasticity > 0.0 || *period == spring.nominal);
                }
                let wanted = used(&nominal).min(target);
                prop_assert!((used(&periods) - wanted).abs() < 1e-9, "{} instead of {}", used(&periods), wanted);
                // Between the limits, what each gives is in proportion to its elasticity.
                let per = |at: usize| (springs[at].cost / nominal[at] - springs[at].cost / periods[at]) / springs[at].elasticity;
                let inside: Vec<f64> = (0..springs.len())
                    .filter(|at| springs[*at].elasticity > 1e-3 && periods[*at] < springs[*at].longest * (1.0 - 1e-9))
                    .map(per)
                    .collect();
                prop_assert!(inside.iter().all(|it| (it - inside[0]).abs() < 1e-6), "{inside:?}");
            }
            Err(too_much) => prop_assert!(too_much.least > target),
        }
    }

    #[test]
    fn stretched_periods_meet_their_deadlines(tasks in tasks(), give in proptest::collection::vec((1.0..6.0f64, 0.0..2.0f64), 6)) {
        let set = sorted(tasks.into_iter().map(|task| Task { jitter: n(0), deadline: None, ..task }).collect());
        let give: Vec<(f64, f64)> = set
            .tasks()
            .iter()
            .zip(give)
            .map(|(task, (factor, elasticity))| (task.period.to_integer() as f64 * factor, elasticity))
            .collect();
        let with = |periods: &[Exact]| {
            let tasks = set.tasks().iter().zip(periods).map(|(task, period)| Task { period: *period, ..task.clone() });
            feasible(&TaskSet::new(tasks.collect()).unwrap())
        };
        match compress_to_deadlines(set.tasks(), &give) {
            Some(periods) => {
                prop_assert!(with(&periods));
                let nominal: Vec<Exact> = set.tasks().iter().map(|task| task.period).collect();
                prop_assert!(!feasible(&set) || periods == nominal);
            }
            None => prop_assert!(!feasible(&set)),
        }
    }
}

#[test]
fn two_processors_run_two_tasks_at_once() {
    let task = |cost, period| Task::new(n(cost), n(period));
    // Dhall's effect: three tasks, two processors; the two short ones go first, and the long one misses what it would meet beside one of them.
    let set = TaskSet::new(vec![task(1, 10), task(1, 10), task(10, 11).with_deadline(n(10))]).unwrap();
    let global = simulate(&set, How { processors: 2, length: n(10), ..HOW });
    assert_eq!(global.missed(2), 1);
    let partitioned = first_fit(set.tasks().to_vec(), 2).unwrap();
    assert!(partitioned.homeless.is_empty());
    let placed: Vec<Task> = (0..3)
        .map(|at| Task { processor: partitioned.processor_of(at), ..set.tasks()[at].clone() })
        .collect();
    let played = simulate(&TaskSet::new(placed).unwrap(), How { processors: 2, length: n(10), ..HOW });
    assert_eq!((0..3).map(|at| played.missed(at)).sum::<usize>(), 0);
    assert_eq!(played.pieces.len(), 3);
}

#[test]
fn a_job_is_set_aside_and_goes_on() {
    // (2,5) goes before (4,7): 0-2, 5-7 the first; 2-5, 7-8 the second, which is too late by 1.
    let set = crate::set(&[(2, 5), (4, 7)]);
    let played = simulate(&set, How { length: n(8), ..HOW });
    let pieces: Vec<_> = played.pieces.iter().map(|piece| (piece.task, piece.from, piece.to)).collect();
    assert_eq!(pieces, [(0, 0, 2), (1, 2, 5), (0, 5, 7), (1, 7, 8)]);
    assert_eq!((played.missed(0), played.missed(1)), (0, 1));
    // By deadlines: at 5 the second one's 7 goes before the first one's 10.
    let played = simulate(&set, How { length: n(8), policy: Policy::EarliestDeadline, ..HOW });
    let pieces: Vec<_> = played.pieces.iter().map(|piece| (piece.task, piece.from, piece.to)).collect();
    assert_eq!(pieces, [(0, 0, 2), (1, 2, 6), (0, 6, 8)]);
}
