//! Settings over time.

use proptest::prelude::*;
use schedule::Exact;
use schedule::manage::{Cause, Change, Governor, Ladder, Late, Managed, Orders, Patience, Setting, Stage};
use schedule::system::System;

use crate::managing_cases::{Case, case, clocked, elastic, executors};
use crate::n;

const MS: i128 = 1_000_000;
const LOOK: i64 = 200_000_000;

/// Two on one processor: 4 of 10 and, below, 30 of 100, which may go down to 400.
fn two() -> Case {
    let agents = vec![clocked(4 * MS, 10 * MS, 0), clocked(30 * MS, 100 * MS, 1)];
    let system = System { processors: 1, agents, executors: executors(&[(9, 1), (8, 1)]) };
    Case { system, managed: vec![Managed::rigid(), elastic(100 * MS, 400 * MS, 1.0, 1.0)] }
}

/// The same when the first one needs so much of its 10 ms.
fn when_it_needs(ms: i128) -> Case {
    let mut case = two();
    case.system.agents[0].cost = n(ms * MS);
    case
}

fn decided(governor: &mut Governor, look: i64, case: &Case) -> Option<Change> {
    governor.decide(look * LOOK, &case.system, &case.managed).unwrap()
}

#[test]
fn it_tightens_at_once_and_loosens_after_a_second() {
    let mut governor = Governor::new(Patience::default());
    assert_eq!(decided(&mut governor, 0, &two()), None);
    let change = decided(&mut governor, 1, &when_it_needs(8)).unwrap();
    let [shift] = change.shifts[..] else { panic!("{change:?}") };
    assert_eq!(
        (shift.agent, shift.before.period, change.stage),
        (1, Some(n(100 * MS)), Some(Stage::Periods))
    );
    // 30 and 8 of each 10: 150, and a twentieth more of all that makes 31.5 and 8.4: 197.
    assert!(shift.after.period >= Some(n(150 * MS)) && shift.after.period <= Some(n(210 * MS)), "{shift:?}");
    let Cause::Late(late) = &change.cause else { panic!("{change:?}") };
    assert_eq!((late[0].agent, late[0].response, late[0].deadline), (1, None, n(100 * MS)));
    // The load has gone: nothing for a second, then as ordered.
    let changes: Vec<Option<Change>> = (2..10).map(|look| decided(&mut governor, look, &two())).collect();
    let when: Vec<usize> = (0..changes.len()).filter(|at| changes[*at].is_some()).collect();
    assert_eq!(when, [5]);
    let change = changes[5].clone().unwrap();
    assert_eq!((change.cause, change.shifts[0].after.period), (Cause::Fallen, Some(n(100 * MS))));
}

#[test]
fn it_says_by_how_much_somebody_would_have_been_late() {
    // 38 below 9 of each 15: 101.
    let agents = vec![clocked(9 * MS, 15 * MS, 0), clocked(38 * MS, 100 * MS, 1)];
    let system = System { processors: 1, agents, executors: executors(&[(9, 1), (8, 1)]) };
    let case = Case { system, managed: vec![elastic(15 * MS, 30 * MS, 1.0, 1.0), Managed::rigid()] };
    let change = decided(&mut Governor::new(Patience::default()), 0, &case).unwrap();
    let late = Late { agent: 1, response: Some(n(101 * MS)), deadline: n(100 * MS) };
    assert_eq!((change.cause, change.shifts[0].agent, change.shifts.len()), (Cause::Late(vec![late]), 0, 1));
}

#[test]
fn one_look_at_a_high_load_makes_it_wait_again() {
    let mut governor = Governor::new(Patience::default());
    decided(&mut governor, 0, &when_it_needs(8)).unwrap();
    for look in 1..40 {
        let load = if look % 5 == 0 { 8 } else { 4 };
        assert_eq!(decided(&mut governor, look, &when_it_needs(load)), None, "{look}");
    }
}

#[test]
fn what_would_hardly_hold_is_not_given_back() {
    // As ordered it needs 30 + 10 * 7 of its 100 when the other has 7 of 10: it just fits.
    let mut governor = Governor::new(Patience::default());
    assert_eq!(decided(&mut governor, 0, &when_it_needs(7)), None);
    decided(&mut governor, 1, &when_it_needs(8)).unwrap();
    for look in 2..40 {
        if let Some(change) = decided(&mut governor, look, &when_it_needs(7)) {
            assert!(change.shifts[0].after.period > Some(n(100 * MS)), "{change:?}");
        }
    }
    assert!(governor.settings()[1].period > Some(n(100 * MS)));
}

#[test]
fn orders_are_done_at_once_both_ways() {
    let mut governor = Governor::new(Patience::default());
    let mut case = two();
    case.managed[1].orders = Orders { rate: 0.5, ..Orders::default() };
    let change = decided(&mut governor, 0, &case).unwrap();
    assert_eq!((change.cause, change.shifts[0].after.period), (Cause::Ordered(vec![1]), Some(n(200 * MS))));
    case.managed[1].orders = Orders::default();
    let change = decided(&mut governor, 1, &case).unwrap();
    assert_eq!(change.shifts[0].after.period, Some(n(100 * MS)));
}

#[test]
fn the_ladder_slows_down_whoever_misses() {
    let mut ladder = Ladder::new(Patience::default());
    let managed = [elastic(100, 300, 1.0, 1.0), elastic(100, 300, 1.0, 0.0), Managed::rigid()];
    let period = |ladder: &Ladder, at: usize| ladder.settings()[at].period;
    assert_eq!(ladder.decide(0, &managed, &[false; 3]), None);
    let change = ladder.decide(LOOK, &managed, &[true, false, true]).unwrap();
    assert_eq!(
        (change.cause, period(&ladder, 0), period(&ladder, 1)),
        (Cause::Missed(vec![0]), Some(n(200)), Some(n(100)))
    );
    ladder.decide(2 * LOOK, &managed, &[true, false, false]).unwrap();
    assert_eq!(period(&ladder, 0), Some(n(300)));
    assert_eq!(ladder.decide(3 * LOOK, &managed, &[true, false, false]), None);
    // Each second without a miss it goes one step back.
    let changes = (4..20).filter_map(|look| Some((look, ladder.decide(look * LOOK, &managed, &[false; 3])?)));
    let back: Vec<(i64, Exact)> =
        changes.map(|(look, change)| (look, change.shifts[0].after.period.unwrap())).collect();
    assert_eq!(back, [(8, n(200)), (13, n(100))]);
}

fn looser_than(after: &Setting, before: &Setting) -> bool {
    after.period < before.period
        || after.method < before.method
        || after.budget > before.budget
        || after.active && !before.active
}

/// The case with each cost up to so much less, by chance.
fn trembling(case: &Case, thousandths: i128, state: &mut u64) -> Case {
    let mut case = case.clone();
    let mut less = |cost: &mut Exact| {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let part = i128::from(*state >> 33) % (thousandths + 1);
        *cost = (*cost * Exact::new(1000 - part, 1000)).ceil();
    };
    case.system.agents.iter_mut().for_each(|agent| less(&mut agent.cost));
    case.managed.iter_mut().flat_map(|managed| &mut managed.methods).for_each(|way| less(&mut way.cost));
    case
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// Costs that tremble by less than the margin change nothing, once it has settled; where somebody can be helped at some of them only, there
    /// is no margin to be had.
    #[test]
    fn it_does_not_flutter(case in case(2..=5, MS), chance: u64) {
        let missing = |thousandths: i128| case.dearer(Exact::new(thousandths, 1000)).manage().missing;
        prop_assume!(missing(960) == missing(1105));
        let mut governor = Governor::new(Patience::default());
        let mut state = chance | 1;
        for look in 0..100 {
            let seen = trembling(&case, 40, &mut state);
            let change = decided(&mut governor, look, &seen);
            prop_assert!(look < 40 || change.is_none(), "at look {look}: {change:?}");
        }
    }

    /// Whatever the load does from look to look: who can be helped is helped at once, and nothing is given back before its time.
    #[test]
    fn it_is_never_too_late_and_never_hasty(case in case(2..=5, MS), loads in proptest::collection::vec(20i128..150, 5)) {
        let mut governor = Governor::new(Patience::default());
        let mut last_tighter = 0;
        // Each load stays for some looks, so that there is something to wait for.
        for look in 0..8 * loads.len() {
            let seen = case.dearer(Exact::new(loads[look / 8], 100));
            let change = decided(&mut governor, look as i64, &seen);
            let found = seen.manage();
            let late = seen.late(governor.settings());
            prop_assert!(
                late.iter().all(|at| found.missing.contains(at) || governor.missing().contains(at)),
                "{late:?} {found:?}"
            );
            if let Some(change) = change {
                let looser = change.shifts.iter().any(|shift| looser_than(&shift.after, &shift.before));
                match change.cause {
                    Cause::Fallen => prop_assert!(look - last_tighter >= 5, "{look}"),
                    _ => {
                        prop_assert!(!looser || !found.feasible, "{change:?}");
                        last_tighter = look;
                    }
                }
            }
        }
    }
}
