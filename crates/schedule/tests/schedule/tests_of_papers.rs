//! Published task sets, and what others found for them.

use schedule::demand::{Demand, demand, demand_within};
use schedule::elastic::{Spring, compress};
use schedule::response::responses;
use schedule::sensitivity::{largest, largest_cost_factor, least_period};
use schedule::utilization::{hyperbolic, liu_layland, liu_layland_bound};
use schedule::{Exact, Task, TaskSet, encoder, response};

use crate::{n, set, table_iii};

fn found(set: &TaskSet) -> Vec<(Exact, bool)> {
    responses(set).iter().map(|response| (response.at_worst, response.meets)).collect()
}

fn whole(times: &[i128], last_misses: bool) -> Vec<(Exact, bool)> {
    let all = times.iter().enumerate();
    all.map(|(at, time)| (n(*time), !(last_misses && at + 1 == times.len()))).collect()
}

#[test]
fn bounds_of_liu_and_layland() {
    let bounds = [1.0, 0.828427, 0.779763, 0.756828, 0.743492, 0.734772];
    for (at, bound) in bounds.iter().enumerate() {
        assert!((liu_layland_bound(at + 1) - bound).abs() < 5e-7, "{}", at + 1);
    }
    assert!((liu_layland_bound(100_000_000) - std::f64::consts::LN_2).abs() < 5e-7);
}

#[test]
fn sets_of_textbooks() {
    // (set, utilisation, Liu and Layland, hyperbolic, responses, the last one misses)
    type Row<'a> = (&'a [(i128, i128)], f64, bool, bool, &'a [i128], bool);
    let rows: [Row; 8] = [
        (&[(10, 30), (10, 40), (12, 50)], 0.823333, false, false, &[10, 20, 52], true),
        (&[(4, 16), (5, 40), (32, 80)], 0.775, true, true, &[4, 9, 58], false),
        (&[(3, 7), (3, 12), (5, 20)], 0.928571, false, false, &[3, 6, 20], false),
        (&[(40, 100), (40, 150), (100, 350)], 0.952381, false, false, &[40, 80, 300], false),
        (&[(2, 5), (4, 7)], 0.971429, false, false, &[2, 8], true),
        (&[(1, 2), (1, 5)], 0.7, true, true, &[1, 2], false),
        (&[(1, 2), (2, 5)], 0.9, false, false, &[1, 4], false),
        (&[(1, 4), (2, 6), (3, 10)], 0.883333, false, false, &[1, 3, 10], false),
    ];
    for (tasks, utilization, ll, product, times, last_misses) in rows {
        let set = set(tasks);
        assert!((set.utilization() - utilization).abs() < 5e-7, "{tasks:?}");
        assert_eq!(liu_layland(&set).pass, ll, "{tasks:?}");
        assert_eq!(hyperbolic(&set).pass, product, "{tasks:?}");
        assert_eq!(found(&set), whole(times, last_misses), "{tasks:?}");
        assert_eq!(demand(&set), Demand::Met, "{tasks:?}");
    }
}

#[test]
fn a_set_that_is_just_within_the_hyperbolic_bound() {
    let tasks = vec![Task::new(n(1), n(2)), Task::new(n(1), n(4)), Task::new(Exact::new(8, 15), n(8))];
    let set = TaskSet::new(tasks.clone()).unwrap();
    assert!(!liu_layland(&set).pass);
    assert!(hyperbolic(&set).pass);
    assert_eq!(found(&set)[2], (n(3) + Exact::new(8, 15), true));
    let mut more = tasks;
    more[2].cost += Exact::new(1, 1_000_000_000_000);
    assert!(!hyperbolic(&TaskSet::new(more).unwrap()).pass);
}

#[test]
fn sets_that_fill_a_processor() {
    // As decimal fractions their sum is above 1 by rounding; two of them are exactly feasible under fixed priorities, too.
    let tenths = set(&[(1, 10), (2, 10), (3, 10), (4, 10)]);
    assert_eq!(demand(&tenths), Demand::Met);
    assert_eq!(found(&tenths), whole(&[1, 3, 6, 10], false));
    let thirds = set(&[(1, 3), (1, 3), (1, 3)]);
    assert_eq!(found(&thirds), whole(&[1, 2, 3], false));
    assert!(!liu_layland(&thirds).pass);
    assert_eq!(demand(&set(&[(1, 3), (1, 3), (100_000_001, 300_000_000)])), Demand::Overloaded);
    let one = set(&[(7, 7)]);
    assert!(liu_layland(&one).pass && hyperbolic(&one).pass);
    // U = 1 with a deadline before the period: 1 + 1 + 2 are due at 4, and the first comes again at 2.
    let tight = |deadline| {
        let last = Task::new(n(2), n(4)).with_deadline(n(deadline));
        TaskSet::new(vec![Task::new(n(1), n(2)), last]).unwrap()
    };
    assert_eq!(demand(&tight(3)), Demand::Met);
    assert_eq!(demand(&tight(2)), Demand::Exceeded { within: n(2), work: n(3) });
}

#[test]
fn deadlines_before_the_periods() {
    let task = |cost, period, deadline| Task::new(n(cost), n(period)).with_deadline(n(deadline));
    let tasks = vec![task(3, 20, 20), task(4, 10, 10), task(3, 20, 5), task(3, 15, 7)];
    let (set, order) = TaskSet::deadline_monotonic(tasks).unwrap();
    assert_eq!(order, [2, 3, 1, 0]);
    assert_eq!(found(&set), whole(&[3, 6, 10, 20], false));
    // By their periods: 4 of the 10, then 3 of the 15, and 7 is too late.
    let by_rate =
        TaskSet::new(vec![task(4, 10, 10), task(3, 15, 7), task(3, 20, 5), task(3, 20, 20)]).unwrap();
    assert!(!response::feasible(&by_rate));
}

#[test]
fn jitter_of_one_delays_those_below() {
    let mut tasks = set(&[(3, 7), (3, 12), (5, 20)]).tasks().to_vec();
    tasks[1].jitter = n(2);
    let set = TaskSet::new(tasks).unwrap();
    // Ready to end: 3, 6, 20, of which the second is told from its arrival, 2 before.
    assert_eq!(found(&set), whole(&[3, 8, 20], false));
}

#[test]
fn the_demand_of_a_textbook() {
    let task = |cost, deadline, period| Task::new(n(cost), n(period)).with_deadline(n(deadline));
    let set = TaskSet::new(vec![task(2, 4, 6), task(2, 5, 8), task(3, 7, 9)]).unwrap();
    assert!((set.utilization() - 0.916667).abs() < 5e-7);
    let points = [(4, 2), (5, 4), (7, 7), (10, 9), (13, 11), (16, 16), (21, 18), (22, 20), (25, 23)];
    for (length, work) in points {
        assert_eq!(demand_within(&set, n(length)), n(work), "{length}");
    }
    assert_eq!(demand(&set), Demand::Met);
}

#[test]
fn the_competition_robot() {
    let set = table_iii();
    assert!((set.utilization() - 0.691818).abs() < 5e-7);
    let (ll, product) = (liu_layland(&set), hyperbolic(&set));
    assert!(ll.pass && (ll.bound - 0.734772).abs() < 5e-7);
    assert!(product.pass && (product.value - 1.868984).abs() < 5e-7);
    let times = [163, 407, 651, 1711, 2561, 2923].map(|tenths| (n(tenths * 100), true));
    assert_eq!(found(&set), times);
    // By how much all costs may grow at once: by utilisation, by the product, by responses.
    let grown = |factor: Exact, test: &dyn Fn(&TaskSet) -> bool| {
        let tasks = set.tasks().iter().map(|task| Task { cost: task.cost * factor, ..task.clone() });
        TaskSet::new(tasks.collect()).is_ok_and(|set| test(&set))
    };
    let thousandths = |value: Option<f64>| (value.unwrap() * 1000.0).floor();
    assert_eq!(thousandths(largest(|factor| grown(factor, &|set| liu_layland(set).pass))), 1062.0);
    assert_eq!(thousandths(largest(|factor| grown(factor, &|set| hyperbolic(set).pass))), 1120.0);
    assert_eq!(thousandths(largest_cost_factor(&set, None)), 1371.0);
}

#[test]
fn each_job_of_the_competition_robot_costs_more_than_its_code() {
    let expected = [(1, 68.1, 0.7236), (2, 71.1, 0.7553), (3, 74.1, 0.7870), (5, 80.1, 0.8505)];
    for (more, response_w2, utilization) in expected {
        let tasks = table_iii().tasks().to_vec().into_iter();
        let tasks = tasks.map(|task| Task { cost: task.cost + n(more * 1000), ..task });
        let set = TaskSet::new(tasks.collect()).unwrap();
        assert_eq!(found(&set)[2], (n((response_w2 * 1000.0_f64).round() as i128), true));
        assert!((set.utilization() - utilization).abs() < 5e-5);
        assert_eq!(liu_layland(&set).pass, more < 2);
        assert!(response::feasible(&set));
    }
}

#[test]
fn the_least_periods_of_its_wheel_controllers() {
    let [w, a, m] = [24_400, 40_900, 19_900].map(n);
    let others = [(n(16_300), n(89_280)), (m, n(50_000_000)), (m, n(50_000_000))];
    let least = encoder::least_common_period(&[(a, n(20)), (w, n(1)), (w, n(1))], &others).unwrap();
    assert!((least - 92_209.966).abs() < 5e-3, "{least}");
    // The same by exact tests: T is found to a thousandth.
    let with = |t: Exact| {
        let times = [(n(16_300), n(89_280)), (w, t), (w, t), (a, t * n(20)), others[1], others[2]];
        TaskSet::new(times.into_iter().map(|(cost, period)| Task::new(cost, period)).collect()).unwrap()
    };
    let least = |test: &dyn Fn(&TaskSet) -> bool| {
        let speed = largest(|speed| speed <= Exact::new(1, 1000) || test(&with(n(100_000) / speed))).unwrap();
        // In microseconds, rounded up to what still passes.
        (1e5 / speed / 10.0 - 1e-3).ceil() / 100.0
    };
    assert_eq!(least(&|set| liu_layland(set).pass), 92.21);
    assert_eq!(least(&|set| hyperbolic(set).pass), 85.70);
    assert_eq!(least(&response::feasible), 65.10);
    assert_eq!(least(&|set| demand(set).pass()), 62.27);
    // One of them alone: the other one is done 65.1 µs after both came, and no second job of the first may come before.
    assert_eq!(least_period(&table_iii(), 1), Some(n(65_100)));
    // The last but one waits for nobody else's second job until then; the last one's own response is what it needs.
    assert_eq!(least_period(&table_iii(), 5), Some(n(292_300)));
}

#[test]
fn the_encoder_of_the_competition_robot() {
    let period = encoder::longest_period(n(150), n(4480)).unwrap();
    assert_eq!(period, Exact::new(60_000_000_000, 150 * 4480));
    let paper = 89_285.714;
    assert!((*period.numer() as f64 / *period.denom() as f64 - paper).abs() < 5e-4);
    assert_eq!(encoder::longest_period(n(0), n(4480)), None);
}

fn spring(cost: f64, nominal: f64, longest: f64, elasticity: f64) -> Spring {
    Spring { cost, nominal, longest, elasticity }
}

fn six_digits(periods: &[f64], expected: &[f64]) {
    assert_eq!(periods.len(), expected.len());
    for (period, expected) in periods.iter().zip(expected) {
        assert!((period - expected).abs() < 5e-7 * expected.max(1.0), "{periods:?}");
    }
}

#[test]
fn elastic_tasks_of_the_paper() {
    let four = [1.0, 1.0, 1.5, 2.0].map(|elasticity| spring(24.0, 100.0, 500.0, elasticity));
    six_digits(&compress(&four, 1.0).unwrap(), &[100.0; 4]);
    six_digits(&compress(&four, 0.8).unwrap(), &[113.793103, 113.793103, 122.222222, 132.0]);
    let mut rigid = four;
    rigid[0] = spring(24.0, 33.0, 500.0, 0.0);
    six_digits(&compress(&rigid, 1.0).unwrap(), &[33.0, 174.050633, 276.381910, 500.0]);
    let unbounded = rigid.map(|it| Spring { longest: 1e9, ..it });
    let periods = compress(&unbounded, 1.0).unwrap();
    for (period, expected) in periods.iter().zip([33.0, 170.69, 264.00, 582.35]) {
        assert!((period - expected).abs() < 5e-3, "{periods:?}");
    }
    let two = [spring(10.0, 20.0, 50.0, 1.0); 2];
    six_digits(&compress(&two, 0.8).unwrap(), &[25.0, 25.0]);
    let stiff = two.map(|it| Spring { longest: 22.0, ..it });
    assert!((compress(&stiff, 0.8).unwrap_err().least - 0.909091).abs() < 5e-7);
}

#[test]
fn elastic_wheel_controllers() {
    let mut springs: Vec<Spring> =
        [(16.3, 89.28), (24.4, 80.0), (24.4, 80.0), (40.9, 1600.0), (19.9, 5e4), (19.9, 5e4)]
            .map(|(cost, period)| spring(cost, period, period, 0.0))
            .into();
    for wheel in &mut springs[1..3] {
        (wheel.longest, wheel.elasticity) = (200.0, 1.0);
    }
    let periods = compress(&springs, liu_layland_bound(6)).unwrap();
    six_digits(&periods[1..3], &[92.803523, 92.803523]);
}
