//! Agents that share threads: by hand, and against steps that are played.

use proptest::prelude::*;
use schedule::processors::{ANYWHERE, Mask, Processors};
use schedule::system::{Agent, Executor, Source, Stream, System, Unsound};
use schedule::{Exact, response};

use crate::{n, set, table_iii};

fn clock(period: i128) -> Vec<Source> {
    vec![Source::Clock { period: n(period) }]
}

fn after(agent: usize) -> Vec<Source> {
    vec![Source::After { agent, every: 1, least: n(0), depth: 16 }]
}

fn agent(cost: i128, deadline: i128, executor: usize, sources: Vec<Source>) -> Agent {
    Agent { cost: n(cost), deadline: n(deadline), executor, sources, least_gap: n(0) }
}

fn executors(count: u8) -> Vec<Executor> {
    (0..count).map(|at| Executor { priority: Some(90 - at), may: 1 }).collect()
}

fn responses(system: &System) -> Vec<Option<Exact>> {
    system.analyse().unwrap().into_iter().map(|found| found.response).collect()
}

#[test]
fn each_on_a_thread_of_its_own_is_as_in_the_papers() {
    for set in [table_iii(), set(&[(3, 7), (3, 12), (5, 20)]), set(&[(1, 4), (2, 6), (3, 10)])] {
        let agents = set.tasks().iter().enumerate().map(|(at, task)| Agent {
            cost: task.cost,
            deadline: task.period,
            executor: at,
            sources: vec![Source::Clock { period: task.period }],
            least_gap: n(0),
        });
        let system =
            System { processors: 1, agents: agents.collect(), executors: executors(set.len() as u8) };
        let expected: Vec<_> = response::responses(&set).iter().map(|it| Some(it.at_worst)).collect();
        assert_eq!(responses(&system), expected);
        assert!(system.is_feasible().unwrap());
    }
}

#[test]
fn those_of_one_thread_wait_for_each_other() {
    // On one executor: 2 of 10 and 5 of 50; above it 1 of 5. By hand: the first waits for a step of the second that has just begun, for its
    // next one, and for one above in each 5: 2 + 5 + 5 = 12, and 3 above make 15. The second: 5 + 2 + 2 of 10 + 1 of 5 is at 14 what it
    // was: 7 + 2 * 2 + 3.
    let agents = vec![agent(1, 5, 0, clock(5)), agent(2, 10, 1, clock(10)), agent(5, 50, 1, clock(50))];
    let system = System { processors: 1, agents, executors: executors(2) };
    assert_eq!(responses(&system), [Some(n(1)), Some(n(15)), Some(n(14))]);
    assert!(!system.is_feasible().unwrap());
}

#[test]
fn one_that_another_makes_run_is_as_late_as_that_one_may_end() {
    // A chain on two threads: the source has 2 of 20, and 3 above it of 10; who runs for it comes up to 5 late.
    let agents = vec![agent(3, 10, 0, clock(10)), agent(2, 20, 1, clock(20)), agent(4, 20, 2, after(1))];
    let system = System { processors: 1, agents, executors: executors(3) };
    let found = system.analyse().unwrap();
    assert_eq!(found[1].response, Some(n(5)));
    assert_eq!(found[2].streams[0].jitter, n(5));
    assert_eq!(found[2].streams[0].period, n(20));
    // 4, and 2 of the source, and 3 of the first for each 10: 9; its successor is at 12 when the second 10 comes.
    assert_eq!(found[2].response, Some(n(9)));
    assert_eq!(system.latency(&found, &[1, 2]), Some(n(14)));
    // Who only looks at it every 30 has just looked.
    let mut seldom = system;
    seldom.agents[2] = agent(4, 30, 2, clock(30));
    let found = seldom.analyse().unwrap();
    assert_eq!(seldom.latency(&found, &[1, 2]), Some(n(5 + 30 + 9)));
}

#[test]
fn what_others_send_seldom_or_in_bursts_makes_run_as_often_as_allowed() {
    let mut system = System {
        processors: 1,
        agents: vec![agent(1, 10, 0, clock(10)), agent(1, 10, 1, after(0))],
        executors: executors(2),
    };
    system.agents[1].sources = vec![Source::After { agent: 0, every: 3, least: n(0), depth: 4 }];
    assert_eq!(system.analyse().unwrap()[1].streams[0].period, n(30));
    system.agents[1].sources = vec![Source::After { agent: 0, every: 1, least: n(25), depth: 4 }];
    assert_eq!(system.analyse().unwrap()[1].streams[0].period, n(25));
    system.agents[1].least_gap = n(40);
    let found = system.analyse().unwrap();
    assert_eq!((found[1].streams[0].period, found[1].streams[0].jitter), (n(40), n(0)));
}

#[test]
fn circles_are_named() {
    let agents = vec![
        agent(1, 9, 0, clock(9)),
        agent(1, 9, 0, after(3)),
        agent(1, 9, 0, after(1)),
        agent(1, 9, 0, after(2)),
    ];
    let system = System { processors: 1, agents, executors: executors(1) };
    let Err(Unsound::Circle(circle)) = system.analyse() else { panic!("no circle") };
    let first = circle.iter().position(|at| *at == 1).unwrap();
    let turned: Vec<usize> = (0..3).map(|at| circle[(first + at) % 3]).collect();
    assert_eq!(turned, [1, 2, 3]);
}

#[test]
fn nothing_is_promised_to_ordinary_threads_and_they_keep_nobody_waiting() {
    let ordinary = Executor { priority: None, may: ANYWHERE };
    let system = System {
        processors: 1,
        agents: vec![agent(1000, 10, 0, clock(10)), agent(2, 10, 1, clock(10)), agent(1, 20, 1, after(0))],
        executors: vec![ordinary, Executor { priority: Some(1), may: ANYWHERE }],
    };
    let found = system.analyse().unwrap();
    assert_eq!(found[0].response, None);
    assert!(!found[0].meets && found[1].meets);
    // Its releases that are passed over are not made up for: of what it sends two may come at once, and then one in each 10.
    assert_eq!(found[2].streams[0].jitter, n(20));
    assert!(system.is_feasible().unwrap());
}

#[test]
fn a_step_that_is_asked_for_counts_as_one_of_a_clock_and_answers_nobody() {
    // 1 of 4 by the clock above; below 2 of 10 by the clock, and the same again when it asks for it, beside 1 of its neighbour's asking.
    let asked = Source::Asked { least: n(10) };
    let both = [clock(10), vec![asked]].concat();
    let agents = vec![agent(1, 4, 0, clock(4)), agent(2, 10, 1, both), agent(1, 20, 1, vec![asked])];
    let system = System { processors: 1, agents, executors: executors(2) };
    let found = system.analyse().unwrap();
    let stream = Stream { period: n(10), jitter: n(0), after: None };
    assert_eq!(found[1].streams, [stream, stream]);
    // 2, a neighbour's step that has just begun, the other 2, the neighbour's next: 6, and 2 above make 8, when a third comes.
    assert_eq!(found[1].response, Some(n(8)));
    // 1, a step of 2 that has just begun, 2 and 2: 7, and 3 above make 10.
    assert_eq!(found[2].response, Some(n(10)));
    // Who runs only when it likes is not known to look at what another one has sent.
    assert_eq!(system.latency(&found, &[0, 2]), None);
    // Alone below the first: 2 + 1, and the next one of the first at 4 finds it done.
    let alone = vec![agent(1, 4, 0, clock(4)), agent(2, 5, 1, vec![asked])];
    let system = System { processors: 1, agents: alone, executors: executors(2) };
    assert_eq!(responses(&system), [Some(n(1)), Some(n(3))]);
}

#[test]
fn who_has_no_bound_takes_it_from_nobody_who_has_another_processor() {
    // 9 of 10 on the first processor leave too little for 6 of 50 there. Below both 10 of 100 may run on the second one, too: of what goes before
    // it, half counts. At 34 that is 27 + 4 of the first, and of the second what was left, what is new and what comes next, 3 * 6: 10 + 49 / 2.
    let agents = vec![agent(9, 10, 0, clock(10)), agent(6, 50, 1, clock(50)), agent(10, 100, 2, clock(100))];
    let threads =
        [(65, 1), (50, 1), (40, 3)].map(|(priority, may)| Executor { priority: Some(priority), may });
    let system = System { processors: 2, agents, executors: threads.into() };
    assert_eq!(responses(&system), [Some(n(9)), None, Some(n(34))]);
}

#[derive(Clone, Debug)]
pub(crate) struct Drawn {
    pub system: System,
    pub processors: usize,
    pub chance: u64,
}

fn drawn() -> impl Strategy<Value = Drawn> {
    let parts = (1i128..=12, 1usize..=4, 0usize..4, 0usize..6, 1u32..=3, 0u8..4);
    (
        proptest::collection::vec(parts, 1..=6),
        proptest::collection::vec((1u8..4, 1u64..4), 4),
        1usize..3,
        any::<u64>(),
    )
        .prop_map(|(agents, executors, processors, chance)| {
            let agents =
                agents.into_iter().enumerate().map(|(at, (cost, period, executor, before, every, how))| {
                    let period = period as i128 * 20;
                    let sources = match how {
                        0 => vec![Source::Asked { least: n(period) }],
                        1 | 2 if at > 0 => {
                            vec![Source::After { agent: before % at, every, least: n(0), depth: 8 }]
                        }
                        _ => clock(period),
                    };
                    agent(cost, period, executor, sources)
                });
            let executors = executors.into_iter().map(|(priority, may)| Executor {
                priority: Some(priority),
                may: if processors == 1 { 1 } else { may },
            });
            Drawn {
                system: System { processors, agents: agents.collect(), executors: executors.collect() },
                processors,
                chance,
            }
        })
}

struct Pending {
    agent: usize,
    since: i128,
}

/// Plays it for a while; the longest time of each agent from what made it run to the end of its step.
pub(crate) fn longest(drawn: &Drawn) -> Vec<i128> {
    let Drawn { system, processors, chance } = drawn;
    let mut state = chance | 1;
    let mut draw = |below: i128| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        i128::from(state >> 33) % below.max(1)
    };
    let agents = &system.agents;
    let mut cpus = Processors::new(*processors);
    for executor in &system.executors {
        let _: usize = cpus.thread(executor.may as Mask);
    }
    let period = |at: usize| match agents[at].sources.first() {
        Some(Source::Clock { period } | Source::Asked { least: period }) => Some(period.to_integer()),
        _ => None,
    };
    let is_asked = |at: usize| matches!(agents[at].sources.first(), Some(Source::Asked { .. }));
    let together = draw(2) == 0;
    let mut next: Vec<Option<i128>> = (0..agents.len())
        .map(|at| period(at).map(|period| if together { 0 } else { draw(period) }))
        .collect();
    let mut waiting: Vec<Vec<Pending>> = system.executors.iter().map(|_| Vec::new()).collect();
    let mut doing: Vec<Option<Pending>> = system.executors.iter().map(|_| None).collect();
    let mut sent = vec![0u32; agents.len()];
    let mut soonest = vec![0; agents.len()];
    let mut longest = vec![0; agents.len()];
    while cpus.now() < 2000 {
        let now = cpus.now();
        for at in 0..agents.len() {
            if let (Some(due), Some(period)) = (next[at], period(at))
                && due <= now
            {
                // Who asks for its steps cannot ask again before this one.
                next[at] = (!is_asked(at)).then_some(due + period);
                soonest[at] = due + period;
                let lane = &mut waiting[agents[at].executor];
                // One that was not done is passed over.
                lane.retain(|pending| pending.agent != at);
                lane.push(Pending { agent: at, since: now });
            }
        }
        for (lane, executor) in system.executors.iter().enumerate() {
            if doing[lane].is_none() && !waiting[lane].is_empty() {
                // In any order.
                let chosen = draw(waiting[lane].len() as i128) as usize;
                let pending = waiting[lane].remove(chosen);
                let cost = agents[pending.agent].cost.to_integer();
                let cost = if draw(3) == 0 { draw(cost) + 1 } else { cost };
                cpus.submit(lane, -i128::from(executor.priority.unwrap()), cost);
                doing[lane] = Some(pending);
            }
        }
        cpus.dispatch();
        let until = next.iter().flatten().min().copied().unwrap_or(2000).min(2000);
        let ended = cpus.advance(until).to_vec();
        let now = cpus.now();
        for lane in ended {
            let Some(Pending { agent: at, since }) = doing[lane].take() else { continue };
            longest[at] = longest[at].max(now - since);
            sent[at] += 1;
            if is_asked(at) {
                let later = if draw(2) == 0 { draw(soonest[at] - since) } else { 0 };
                next[at] = Some(soonest[at].max(now) + later);
            }
            for (other, agent) in agents.iter().enumerate() {
                let Some(Source::After { agent: source, every, depth, .. }) = agent.sources.first().copied()
                else {
                    continue;
                };
                let lane = &mut waiting[agent.executor];
                let room = lane.iter().filter(|pending| pending.agent == other).count() < depth as usize;
                if source == at && sent[at].is_multiple_of(every) && room {
                    lane.push(Pending { agent: other, since: now });
                }
            }
        }
    }
    longest
}

fn contradicted(drawn: &Drawn, told: &[Option<Exact>]) -> Option<String> {
    let longest = longest(drawn);
    let wrong = |(at, longest): (usize, &i128)| told[at].is_some_and(|told| n(*longest) > told);
    longest
        .iter()
        .enumerate()
        .find(|it| wrong(*it))
        .map(|(at, took)| format!("{at}: told {:?}, took {took}", told[at]))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(10_000))]

    #[test]
    fn no_step_takes_longer_than_told(drawn in drawn()) {
        prop_assert_eq!(contradicted(&drawn, &responses(&drawn.system)), None);
    }

    #[test]
    fn the_quick_verdict_is_that_of_the_analysis(drawn in drawn(), gaps in proptest::collection::vec(0i128..90, 6)) {
        let mut system = drawn.system;
        system.agents.iter_mut().zip(gaps).for_each(|(agent, gap)| agent.least_gap = n(gap));
        let found = system.analyse().unwrap();
        prop_assert_eq!(system.is_feasible().unwrap(), found.iter().all(|found| found.meets));
        for at in 0..found.len() {
            prop_assert_eq!(system.do_meet(|asked| asked == at).unwrap(), found[at].meets);
        }
    }
}

#[test]
fn who_forgets_that_steps_wait_for_others_is_found_out() {
    use proptest::strategy::ValueTree;
    let mut runner = proptest::test_runner::TestRunner::deterministic();
    // As if each agent had a thread of its own, or as if nobody were late.
    let alone = |drawn: &Drawn| {
        let mut system = drawn.system.clone();
        system.executors =
            drawn.system.agents.iter().map(|agent| drawn.system.executors[agent.executor]).collect();
        (0..system.agents.len()).for_each(|at| {
            system.agents[at].executor = at;
            system.executors[at].priority =
                system.executors[at].priority.map(|priority| priority * 10 + at as u8);
        });
        responses(&system)
    };
    let in_time = |drawn: &Drawn| {
        let mut system = drawn.system.clone();
        let found = system.analyse().unwrap();
        for (agent, found) in system.agents.iter_mut().zip(&found) {
            agent.sources = vec![Source::Clock { period: found.streams[0].period }];
        }
        responses(&system)
    };
    let mut is_found = |wrong: &dyn Fn(&Drawn) -> Vec<Option<Exact>>| {
        (0..20_000).any(|_| {
            let drawn = drawn().new_tree(&mut runner).unwrap().current();
            contradicted(&drawn, &wrong(&drawn)).is_some()
        })
    };
    assert!(is_found(&alone));
    assert!(is_found(&in_time));
}
