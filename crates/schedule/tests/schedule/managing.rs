//! Who gives way, and how far.

use proptest::prelude::*;
use schedule::elastic::compress_to_deadlines;
use schedule::manage::{
    Anytime, Found, Managed, Orders, Setting, Stage, Way, Work, apply, budgets, lengthen, manage, useful_work,
};
use schedule::system::{Agent, Source, System};
use schedule::utilization::liu_layland_bound;
use schedule::{Exact, Task};

use crate::managing_cases::{Case, case, clocked, elastic, executors};
use crate::n;
use crate::systems::{Drawn, longest};

/// Tasks of (cost, nominal, longest, elasticity) on threads of their own, of one processor that has lost this share, whose deadlines are so far
/// away that they are met where the processor is not asked for more than it has.
fn for_utilisation(tasks: &[(i128, i128, i128, f64)], lost: i128) -> Case {
    let mut agents: Vec<Agent> = tasks
        .iter()
        .enumerate()
        .map(|(at, (cost, nominal, ..))| Agent {
            deadline: n(1_000_000_000_000),
            ..clocked(*cost, *nominal, at)
        })
        .collect();
    agents.push(clocked(lost, 1_000_000, tasks.len()));
    let threads: Vec<(u8, u64)> =
        (0..=tasks.len()).map(|at| (if at < tasks.len() { 60 - at as u8 } else { 90 }, 1)).collect();
    let managed =
        tasks.iter().map(|(_, nominal, longest, elasticity)| elastic(*nominal, *longest, *elasticity, 1.0));
    Case {
        system: System { processors: 1, agents, executors: executors(&threads) },
        managed: managed.collect(),
    }
}

fn periods(found: &Found, unit: f64) -> Vec<f64> {
    let period = |setting: &Setting| *setting.period.unwrap().numer() as f64 / unit;
    found.settings.iter().map(period).collect()
}

fn about(periods: &[f64], expected: &[f64]) {
    assert_eq!(periods.len(), expected.len());
    for (period, expected) in periods.iter().zip(expected) {
        assert!((period / expected - 1.0).abs() < 2e-3, "{periods:?}");
    }
}

const MS: i128 = 1_000_000;

#[test]
fn elastic_tasks_of_the_paper() {
    let task = |nominal: i128, elasticity| (24 * MS, nominal * MS, 500 * MS, elasticity);
    // What is taken of the processor makes the target.
    let four = [task(100, 1.0), task(100, 1.0), task(100, 1.5), task(100, 2.0)];
    let found = for_utilisation(&four, 0).manage();
    assert_eq!((found.stage, periods(&found, 1e6)), (Stage::Nothing, vec![100.0; 4]));
    let found = for_utilisation(&four, 200_000).manage();
    about(&periods(&found, 1e6), &[113.793103, 113.793103, 122.222222, 132.0]);
    let rigid = [task(33, 0.0), four[1], four[2], four[3]];
    let found = for_utilisation(&rigid, 0).manage();
    about(&periods(&found, 1e6), &[33.0, 174.050633, 276.381910, 500.0]);
    assert_eq!((found.stage, found.feasible), (Stage::Periods, true));
    let two = [(10 * MS, 20 * MS, 50 * MS, 1.0); 2];
    about(&periods(&for_utilisation(&two, 200_000).manage(), 1e6), &[25.0, 25.0]);
    // They need 0.909 of the 0.8 at their longest periods: the second one cannot be helped, and the first one need not give anything for it.
    let stiff = two.map(|(cost, nominal, _, elasticity)| (cost, nominal, 22 * MS, elasticity));
    let found = for_utilisation(&stiff, 200_000).manage();
    assert_eq!((found.feasible, found.missing.clone()), (false, vec![1]));
    about(&periods(&found, 1e6), &[20.0, 22.0]);
}

#[test]
fn elastic_wheel_controllers() {
    let tasks = [
        (16_300, 89_280, 89_280, 0.0),
        (24_400, 80_000, 200_000, 1.0),
        (24_400, 80_000, 200_000, 1.0),
        (40_900, 1_600_000, 1_600_000, 0.0),
        (19_900, 50_000_000, 50_000_000, 0.0),
        (19_900, 50_000_000, 50_000_000, 0.0),
    ];
    let lost = 1_000_000 - (liu_layland_bound(6) * 1e6).floor() as i128;
    let found = for_utilisation(&tasks, lost).manage();
    about(&periods(&found, 1e3)[1..3], &[92.803523, 92.803523]);
}

/// Two processors; what others have brought takes 90 % of the first one above whoever runs only there.
fn beside_a_foreign_load() -> Case {
    // One that may run on the first processor only, one that may run on both, one on the second only, and one on the first above the load.
    let agents = vec![
        clocked(6 * MS, 50 * MS, 0),
        clocked(10 * MS, 100 * MS, 1),
        clocked(10 * MS, 50 * MS, 2),
        clocked(MS, 50 * MS, 3),
        clocked(9 * MS, 10 * MS, 4),
    ];
    let executors = executors(&[(50, 1), (40, 3), (60, 2), (80, 1), (65, 1)]);
    // The first one needs 60 ms, whatever the others do: 6 of its own, and 9 of the load in each 10.
    let managed = [(50, 55), (100, 400), (50, 200), (50, 200)];
    let managed = managed.map(|(nominal, longest)| elastic(nominal * MS, longest * MS, 1.0, 0.5));
    Case { system: System { processors: 2, agents, executors }, managed: managed.into() }
}

#[test]
fn who_cannot_be_helped_pulls_nobody_down() {
    let case = beside_a_foreign_load();
    let found = case.manage();
    assert_eq!(found.missing, [0]);
    // It gives way itself; all others run as they should.
    let expected: Vec<Exact> = [55, 100, 50, 50].map(|ms| n(ms * MS)).into();
    assert_eq!(found.settings.iter().map(|it| it.period.unwrap()).collect::<Vec<_>>(), expected);
    assert_eq!(case.late(&found.settings), [0]);
    // The one on both needs some of the second processor: the one there gives way, and the one on the first, which is above the load too.
    let mut tight = case.clone();
    tight.system.agents[1].cost = n(34 * MS);
    tight.managed[1].elasticity = 0.0;
    let found = tight.manage();
    assert_eq!((found.missing.clone(), found.stage), (vec![0], Stage::Periods));
    assert!(found.settings[2].period > Some(n(50 * MS)));
    assert_eq!(found.settings[1].period, Some(n(100 * MS)));
    // When it may be put to sleep, it is, and for nobody's harm.
    let mut asleep = case;
    asleep.managed[0].may_suspend = true;
    asleep.managed[1].may_suspend = true;
    let found = asleep.manage();
    assert!(found.feasible);
    assert_eq!(found.settings.iter().map(|it| it.active).collect::<Vec<_>>(), [false, true, true, true]);
    assert_eq!(found.settings[2], asleep.ordered()[2]);
}

#[test]
fn who_is_suspended_makes_nobody_run() {
    let agents = vec![
        clocked(6, 10, 0),
        clocked(5, 10, 1),
        Agent {
            sources: vec![Source::After { agent: 1, every: 1, least: n(0), depth: 1 }],
            ..clocked(5, 10, 2)
        },
        Agent { sources: vec![Source::Paced { agent: 1, period: n(10) }], ..clocked(2, 10, 3) },
    ];
    let system = System { processors: 1, agents, executors: executors(&[(9, 1), (8, 1), (7, 1), (6, 1)]) };
    let mut managed = vec![Managed::rigid(); 4];
    (managed[1].rigid, managed[1].may_suspend) = (false, true);
    let case = Case { system, managed };
    let found = case.manage();
    assert_eq!((found.feasible, found.stage, found.settings[1].active), (true, Stage::Lives, false));
    let system = case.applied(&found.settings);
    assert!(system.analyse().unwrap()[2..].iter().all(|found| found.streams.is_empty()));
    // The fourth one does not see them any more either, and the first one has all the time.
    assert!(system.agents[2..].iter().all(|agent| agent.sources.is_empty()));
}

#[test]
fn who_runs_for_messages_gives_way_by_a_gap() {
    // 5 of 10 on the message of one that has 5 of 10 and is rigid, and 2 of 20 below both.
    let agents = vec![
        clocked(5, 10, 0),
        Agent {
            sources: vec![Source::After { agent: 0, every: 1, least: n(0), depth: 1 }],
            deadline: n(20),
            ..clocked(5, 10, 1)
        },
        clocked(2, 40, 2),
    ];
    let system = System { processors: 1, agents, executors: executors(&[(9, 1), (8, 1), (7, 1)]) };
    let case = Case { system, managed: vec![Managed::rigid(), elastic(10, 40, 1.0, 1.0), Managed::rigid()] };
    let found = case.manage();
    assert!(found.feasible && found.settings[1].period > Some(n(10)));
    assert_eq!(case.applied(&found.settings).agents[1].least_gap, found.settings[1].period.unwrap());
}

#[test]
fn orders_come_first() {
    let mut case = beside_a_foreign_load();
    let order = |rate, active, method| Orders { rate, active, method };
    let ways = [8, 4, 2].map(|ms| Way { cost: n(ms * MS), quality: 1.0 });
    case.managed[0].orders = order(1.0, false, 0);
    case.managed[1].orders = order(0.1, true, 0);
    (case.managed[2].methods, case.managed[2].orders) = (ways.into(), order(0.4, true, 1));
    (case.managed[3].rigid, case.managed[3].orders) = (true, order(0.5, false, 0));
    let found = case.manage();
    let set =
        |period: i128, method, active| Setting { period: Some(n(period * MS)), method, budget: None, active };
    // No slower than the designer allows, and rigid ones hear no orders.
    assert_eq!(found.settings, [set(50, 0, false), set(400, 0, true), set(125, 1, true), set(50, 0, true)]);
    assert_eq!((found.feasible, found.stage), (true, Stage::Nothing));
}

#[test]
fn budgets_are_shared_by_importance() {
    // 40 are left of 100 at mandatory parts of 30 and 30; one wants 60 more and the other one 30, and counts half as much.
    let agents = vec![clocked(90 * MS, 100 * MS, 0), clocked(60 * MS, 100 * MS, 1)];
    let system = System { processors: 1, agents, executors: executors(&[(9, 1), (8, 1)]) };
    let anytime = |most: i128, importance| Managed {
        rigid: false,
        anytime: Some(Anytime { least: n(30 * MS), most: n(most * MS) }),
        importance,
        ..Managed::rigid()
    };
    let managed = [anytime(90, 1.0), anytime(60, 0.5)];
    let found = manage(&system, &managed).unwrap();
    assert_eq!((found.stage, found.feasible), (Stage::Budgets, true));
    // 60 s + 30 s / 2 = 40: s = 0.5333.
    let shared: Vec<f64> = found.settings.iter().map(|it| *it.budget.unwrap().numer() as f64 / 1e6).collect();
    about(&shared, &[62.0, 38.0]);
    let alone = budgets(&system, &managed, &found.settings).unwrap().unwrap();
    assert_eq!(alone, found.settings.iter().map(|it| it.budget).collect::<Vec<_>>());
    // No mandatory part is cut.
    let mut full = system;
    full.agents.push(clocked(50 * MS, 100 * MS, 0));
    assert_eq!(budgets(&full, &managed, &[]).unwrap(), None);
}

#[test]
fn useful_work_counts_what_is_important_and_in_time() {
    let work = |importance, nominal, in_time, quality| Work { importance, nominal, in_time, quality };
    assert_eq!(useful_work(&[]), 1.0);
    assert_eq!(useful_work(&[work(1.0, 100.0, 50.0, 1.0)]), 0.5);
    // Of the three quarters of the weight half is done at quality 0.8, and the rest more than well.
    let both = [work(0.75, 100.0, 50.0, 0.8), work(0.25, 10.0, 12.0, 1.0), work(1.0, 0.0, 0.0, 1.0)];
    assert!((useful_work(&both) - 0.55).abs() < 1e-12);
}

/// As many agents as a robot has, on two processors, with more to do than there is time for.
fn a_robot_in_need(agents: usize, load: i128) -> Case {
    let mut system = System {
        processors: 2,
        agents: Vec::new(),
        executors: executors(&[(80, 3), (70, 3), (60, 1), (50, 3), (65, 1)]),
    };
    let mut managed = Vec::new();
    for at in 0..agents {
        let period = [20, 33, 50, 100, 200][at % 5] * MS;
        let mut agent = clocked(period * load / (100 * agents as i128), period, at % 4);
        let mut it = elastic(period, period * 3, 1.0 + (at % 3) as f64, 0.2 + 0.04 * at as f64);
        if at % 3 == 2 {
            agent.sources = vec![Source::After { agent: at - 1, every: 1, least: n(0), depth: 4 }];
        }
        it.methods =
            (0..3).map(|way| Way { cost: n(*agent.cost.numer() * (4 - way) / 4), quality: 1.0 }).collect();
        it.anytime = (at % 4 == 0).then(|| Anytime { least: agent.cost / n(2), most: agent.cost });
        it.may_suspend = at % 2 == 0;
        system.agents.push(agent);
        managed.push(it);
    }
    system.agents.push(clocked(7 * MS, 10 * MS, 4));
    Case { system, managed }
}

#[test]
fn a_robot_is_managed_by_few_tests() {
    let mut stages = Vec::new();
    for load in (4..100).step_by(4).chain((100..500).step_by(50)) {
        let case = a_robot_in_need(20, load);
        let found = case.manage();
        println!("load {load} %: {:?}, missing {:?}, {} tests", found.stage, found.missing, found.tests);
        // Twice: three looks at all, five at kinds, the halvings of two ranges and of the steps, and one test for each thing that is given back.
        assert!(found.tests <= 2 * (3 + 5 + 2 * 13 + 6 + 20 + 2 * 20 + 10), "{}", found.tests);
        assert_eq!(case.late(&found.settings), found.missing);
        stages.push(found.stage);
    }
    stages.dedup();
    assert!(
        stages.len() >= 3 && stages.contains(&Stage::Nothing) && stages.contains(&Stage::Periods),
        "{stages:?}"
    );
}

fn stage_of(kinds: usize) -> Stage {
    [Stage::Nothing, Stage::Periods, Stage::Methods, Stage::Budgets, Stage::Lives][kinds]
}

#[test]
fn room_for_one_comes_from_those_in_its_way_by_elasticity_over_importance() {
    // 4 of 10, 8 of 20 and the one that comes, below both: 20 of 100 that it has to be done in. By hand, with as much as they want: no time left
    // but 100 - 40 - 40 = 20 ms, which just fits; with 30 ms it is 10 too much.
    let mut agents =
        vec![clocked(4 * MS, 10 * MS, 0), clocked(8 * MS, 20 * MS, 1), clocked(20 * MS, 100 * MS, 2)];
    agents.push(clocked(MS, 100 * MS, 3));
    let system =
        System { processors: 1, agents, executors: executors(&[(60, 1), (50, 1), (40, 1), (30, 1)]) };
    let give = |importance| elastic(10 * MS, 40 * MS, 1.0, importance);
    let mut managed =
        vec![give(0.5), Managed { nominal: Some(n(20 * MS)), longest: Some(n(80 * MS)), ..give(0.5) }];
    managed.extend([Managed::rigid(), elastic(100 * MS, 400 * MS, 1.0, 0.01)]);
    let periods = |system: &System, managed: &[Managed], must: [bool; 4]| {
        let settings = lengthen(system, managed, &must).unwrap()?;
        Some(
            settings
                .iter()
                .map(|it| it.period.map(|period| *period.numer() as f64 / 1e6))
                .collect::<Vec<_>>(),
        )
    };
    let three = [true, true, true, false];
    let nominal = Some(vec![Some(10.0), Some(20.0), None, Some(100.0)]);
    assert_eq!(periods(&system, &managed, three), nominal);
    let mut more = system.clone();
    more.agents[2].cost = n(30 * MS);
    let both = periods(&more, &managed, three).unwrap();
    // The one below is in nobody's way, and who is late there is not asked about.
    assert_eq!(both[3], Some(100.0));
    let used = |periods: &[Option<f64>]| [4.0 / periods[0].unwrap(), 8.0 / periods[1].unwrap()];
    let [one, other] = used(&both);
    assert!((one - other).abs() < 0.01 && one < 0.4, "equal springs of equal length: {both:?}");
    // Who is twice as important gives half as much.
    let mut unlike = managed.clone();
    unlike[0].importance = 1.0;
    let [one, other] = used(&periods(&more, &unlike, three).unwrap());
    let (given, twice) = (0.4 - one, 0.4 - other);
    assert!((twice / given - 2.0).abs() < 0.2, "{given} {twice}");
    // Not even with all that they may give.
    more.agents[2].cost = n(81 * MS);
    assert_eq!(periods(&more, &managed, three), None);
    // It is late, and was so before: nobody makes room for it.
    assert_eq!(periods(&more, &managed, [true, true, false, false]), nominal);
}

/// On threads of their own by rates, on one processor: the periods that are found for tasks of a cost (ms), a period (10 ms), how often that
/// its longest is, and an elasticity. None is longer than the elastic one of the largest utilisation, and nobody could have half of what it gave back.
fn elastic_periods_of(tasks: &[(i128, i128, i128, f64)]) -> Result<(), TestCaseError> {
    let mut tasks = tasks.to_vec();
    tasks.sort_by_key(|(_, period, ..)| *period);
    let agents =
        tasks.iter().enumerate().map(|(at, (cost, period, ..))| clocked(cost * MS, period * 10 * MS, at));
    let system =
        System { processors: 1, agents: agents.collect(), executors: executors(&[(9, 1), (8, 1), (7, 1)]) };
    let managed = tasks.iter().map(|(_, period, factor, elasticity)| {
        elastic(period * 10 * MS, period * 10 * factor * MS, *elasticity, 1.0)
    });
    let managed: Vec<Managed> = managed.collect();
    let found = manage(&system, &managed).unwrap();
    let classic: Vec<Task> =
        tasks.iter().map(|(cost, period, ..)| Task::new(n(cost * MS), n(period * 10 * MS))).collect();
    let give: Vec<(f64, f64)> = tasks
        .iter()
        .map(|(_, period, factor, elasticity)| ((period * 10 * factor * MS) as f64, *elasticity))
        .collect();
    match compress_to_deadlines(&classic, &give) {
        Some(periods) => {
            prop_assert!(found.feasible);
            for (at, period) in periods.iter().enumerate() {
                let (ours, theirs) = (found.settings[at].period.unwrap(), *period);
                let apart = *ours.numer() as f64 / *theirs.numer() as f64 - 1.0;
                // A 4096th of the utilisation that may be given may be much of a period that gives nearly all of its own.
                prop_assert!(apart < 0.03, "{at}: {ours} {theirs}");
                let nominal = managed[at].nominal.unwrap();
                if ours > nominal * n(1001) / n(1000) {
                    let mut back = found.settings.clone();
                    back[at].period = Some(((ours + nominal) / n(2)).floor());
                    prop_assert!(!apply(&system, &managed, &back).is_feasible().unwrap(), "{at}: {ours}");
                }
            }
        }
        None => prop_assert!(!found.feasible),
    }
    Ok(())
}

/// The others were held first, and the one that is left could have had more once they had settled.
#[test]
fn nobody_is_held_by_how_finely_the_others_were_found() {
    let tasks = [
        (6, 1, 4, 2.760_926_675_399_262_7),
        (11, 3, 4, 1.924_579_610_858_48),
        (3, 4, 3, 1.904_761_570_747_212_8),
    ];
    elastic_periods_of(&tasks).unwrap();
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    #[test]
    fn all_meet_their_deadlines_but_those_who_never_do(case in case(2..=6, 1)) {
        let found = case.manage();
        prop_assert_eq!(&found.missing, &case.late(&case.given(4)));
        prop_assert_eq!(found.feasible, found.missing.is_empty());
        prop_assert_eq!(&case.late(&found.settings), &found.missing);
        if case.fits(&case.ordered()) {
            prop_assert_eq!(found.settings, case.ordered());
        }
    }

    #[test]
    fn nobody_gives_more_than_he_may(case in case(2..=6, 1)) {
        let found = case.manage();
        prop_assert_eq!(found.settings.len(), case.managed.len());
        let (most, least) = (case.ordered(), case.given(4));
        for (at, setting) in found.settings.iter().enumerate() {
            prop_assert!(setting.period >= most[at].period && setting.period <= least[at].period, "{at}");
            prop_assert!(setting.budget <= most[at].budget && setting.budget >= least[at].budget, "{at}");
            prop_assert!(setting.method <= least[at].method && setting.active >= least[at].active, "{at}");
        }
    }

    /// Of periods alone it is the same, also where not everybody has to be in time; and where it is not enough nothing is.
    #[test]
    fn longer_periods_make_room_where_any_do(case in case(2..=6, 1), must in proptest::collection::vec(any::<bool>(), 6)) {
        let is_late = |settings: &[Setting]| case.late(settings).into_iter().any(|at| must[at]);
        let longest: Vec<Setting> = case.ordered().into_iter().zip(case.given(1))
            .map(|(ordered, given)| Setting { period: given.period, ..ordered }).collect();
        let Some(settings) = lengthen(&case.system, &case.managed, &must).unwrap() else {
            prop_assert!(is_late(&longest));
            return Ok(());
        };
        prop_assert!(!is_late(&settings));
        for ((setting, ordered), longest) in settings.iter().zip(case.ordered()).zip(&longest) {
            prop_assert_eq!(Setting { period: ordered.period, ..*setting }, ordered);
            prop_assert!(setting.period >= ordered.period && setting.period <= longest.period);
        }
        if !is_late(&case.ordered()) {
            prop_assert_eq!(&settings, &case.ordered());
        }
        let found = case.manage();
        if must[..case.managed.len()].iter().all(|must| *must) && found.feasible && found.stage <= Stage::Periods {
            prop_assert_eq!(settings, found.settings);
        }
    }

    /// Each kind of concession is made only where all of those before it are not enough.
    #[test]
    fn the_order_of_giving_way_is_kept(case in case(2..=6, 1)) {
        let found = case.manage();
        if !found.feasible {
            return Ok(());
        }
        let enough = (0..5).find(|kinds| case.fits(&case.given(*kinds)));
        prop_assert_eq!(Some(found.stage), enough.map(stage_of));
        let has_given = |is: fn(&Setting, &Setting) -> bool| {
            found.settings.iter().zip(case.ordered()).any(|(setting, most)| is(setting, &most))
        };
        prop_assert!(!has_given(|it, most| it.period != most.period) || found.stage >= Stage::Periods);
        prop_assert!(!has_given(|it, most| it.method != most.method) || found.stage >= Stage::Methods);
        prop_assert!(!has_given(|it, most| it.budget != most.budget) || found.stage >= Stage::Budgets);
        prop_assert!(!has_given(|it, _| !it.active) || found.stage >= Stage::Lives);
    }

    #[test]
    fn more_load_is_met_by_no_earlier_stage(case in case(2..=6, 1000), percent in 101i128..200) {
        let more = case.dearer(Exact::new(percent, 100)).manage();
        let less = case.manage();
        // Who cannot be helped with less cannot be helped with more.
        prop_assert!(less.missing.iter().all(|at| more.missing.contains(at)), "{less:?} {more:?}");
        prop_assert!(!more.feasible || less.stage <= more.stage, "{less:?} {more:?}");
    }

    /// A better method for somebody would not do, even where all who are less important had their cheapest ones.
    #[test]
    fn the_least_important_lose_their_methods_first(case in case(2..=6, 1)) {
        let found = case.manage();
        if found.stage != Stage::Methods || !found.feasible {
            return Ok(());
        }
        let given = case.given(2);
        for at in (0..found.settings.len()).filter(|at| found.settings[*at].method > 0) {
            let mut settings = case.given(1);
            for (other, setting) in settings.iter_mut().enumerate() {
                let less = case.managed[other].importance < case.managed[at].importance;
                setting.method = if less { given[other].method } else { found.settings[other].method };
            }
            settings[at].method -= 1;
            prop_assert!(!case.fits(&settings), "{at} {found:?}");
        }
    }

    /// Of all ways to suspend some, the one that keeps the most important, then the next one, and so on.
    #[test]
    fn lives_are_kept_by_importance(case in case(3..=3, 1)) {
        let found = case.manage();
        if found.stage != Stage::Lives || !found.feasible {
            return Ok(());
        }
        let mut order: Vec<usize> = (0..3).collect();
        order.sort_by(|a, b| case.managed[*b].importance.total_cmp(&case.managed[*a].importance));
        let lives = |alive: usize| -> Vec<bool> { order.iter().map(|at| alive >> at & 1 == 1).collect() };
        let best = (0..8usize)
            .filter(|alive| {
                let mut settings = case.given(3);
                settings.iter_mut().enumerate().for_each(|(at, setting)| setting.active = alive >> at & 1 == 1);
                let may = |at: usize| case.managed[at].may_suspend && !case.managed[at].rigid;
                (0..3).all(|at| settings[at].active || may(at)) && case.fits(&settings)
            })
            .map(lives)
            .max();
        let kept: Vec<bool> = order.iter().map(|at| found.settings[*at].active).collect();
        // Those who can help nobody live on; in this small world all can.
        prop_assert_eq!(Some(kept), best, "{:?}", found);
    }

    #[test]
    fn periods_are_no_longer_than_those_of_the_largest_utilisation(
        tasks in proptest::collection::vec((1i128..=12, 1i128..=5, 1i128..=4, 0.1..3.0f64), 3),
    ) {
        elastic_periods_of(&tasks)?;
    }

    /// No step that is played takes longer than its deadline.
    #[test]
    fn what_is_found_holds_when_it_is_played(case in case(2..=6, 1), chance: u64) {
        let mut case = case;
        for (agent, managed) in case.system.agents.iter().zip(&mut case.managed) {
            // Gaps are not played.
            if matches!(agent.sources[0], Source::After { .. }) {
                (managed.nominal, managed.longest) = (None, None);
            }
        }
        let found = case.manage();
        if !found.feasible || found.stage == Stage::Nothing {
            return Ok(());
        }
        let system = case.applied(&found.settings);
        let played = longest(&Drawn { processors: system.processors, system: system.clone(), chance });
        for (at, played) in played.iter().enumerate().take(case.managed.len()) {
            prop_assert!(n(*played) <= system.agents[at].deadline, "{at} took {played}: {found:?}");
        }
    }
}
