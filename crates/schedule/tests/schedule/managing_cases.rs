//! Systems to be managed, drawn and made by hand.

use proptest::prelude::*;
use schedule::Exact;
use schedule::manage::{Anytime, Found, Managed, Setting, Way, apply};
use schedule::system::{Agent, Executor, Source, System};

use crate::n;

/// An agent that gives way in its period.
pub(crate) fn elastic(nominal: i128, longest: i128, elasticity: f64, importance: f64) -> Managed {
    Managed {
        rigid: false,
        nominal: Some(n(nominal)),
        longest: Some(n(longest)),
        elasticity,
        importance,
        ..Managed::rigid()
    }
}

pub(crate) fn clocked(cost: i128, period: i128, executor: usize) -> Agent {
    Agent {
        cost: n(cost),
        deadline: n(period),
        executor,
        sources: vec![Source::Clock { period: n(period) }],
        least_gap: n(0),
    }
}

/// Executors of these priorities on these processors.
pub(crate) fn executors(threads: &[(u8, u64)]) -> Vec<Executor> {
    threads.iter().map(|(priority, may)| Executor { priority: Some(*priority), may: *may }).collect()
}

/// A system, and how its agents may give way.
#[derive(Clone, Debug)]
pub(crate) struct Case {
    pub system: System,
    pub managed: Vec<Managed>,
}

impl Case {
    pub(crate) fn applied(&self, settings: &[Setting]) -> System {
        apply(&self.system, &self.managed, settings)
    }

    /// Who of the managed ones misses.
    pub(crate) fn late(&self, settings: &[Setting]) -> Vec<usize> {
        let system = self.applied(settings);
        let found = system.analyse().unwrap();
        (0..self.managed.len()).filter(|at| system.is_in_real_time(*at) && !found[*at].meets).collect()
    }

    pub(crate) fn fits(&self, settings: &[Setting]) -> bool {
        self.late(settings).is_empty()
    }

    pub(crate) fn ordered(&self) -> Vec<Setting> {
        self.managed.iter().map(ordered).collect()
    }

    /// When everybody has given all of this kind and of those before it.
    pub(crate) fn given(&self, kinds: usize) -> Vec<Setting> {
        self.managed.iter().map(|it| given(it, kinds)).collect()
    }

    pub(crate) fn manage(&self) -> Found {
        schedule::manage::manage(&self.system, &self.managed).unwrap()
    }

    /// The same with all costs multiplied, rounded up.
    pub(crate) fn dearer(&self, factor: Exact) -> Case {
        let mut case = self.clone();
        case.system.agents.iter_mut().for_each(|agent| agent.cost = (agent.cost * factor).ceil());
        let ways = case.managed.iter_mut().flat_map(|managed| &mut managed.methods);
        ways.for_each(|way| way.cost = (way.cost * factor).ceil());
        case
    }
}

fn ordered(managed: &Managed) -> Setting {
    Setting {
        period: managed.nominal,
        method: 0,
        budget: managed.anytime.map(|anytime| anytime.most),
        active: true,
    }
}

fn given(managed: &Managed, kinds: usize) -> Setting {
    let mut setting = ordered(managed);
    if managed.rigid {
        return setting;
    }
    if kinds > 0 && managed.elasticity > 0.0 {
        setting.period = managed.nominal.map(|nominal| managed.longest.unwrap_or(nominal));
    }
    if kinds > 1 {
        let cheapest = (0..managed.methods.len()).min_by_key(|at| managed.methods[*at].cost);
        setting.method = cheapest.unwrap_or(0);
    }
    if kinds > 2 {
        setting.budget = managed.anytime.map(|anytime| anytime.least);
    }
    if kinds > 3 {
        setting.active = !managed.may_suspend;
    }
    setting
}

/// Agents on some threads with some room each, all in units of so many nanoseconds.
pub(crate) fn case(agents: std::ops::RangeInclusive<usize>, unit: i128) -> impl Strategy<Value = Case> {
    let system = (2i128..=14, 1usize..=4, 0usize..4, 0usize..6, 0u8..3, any::<bool>());
    let room = (1i128..=4, 0.0..3.0f64, 0.02..1.0f64, 0usize..3, 0i128..8, any::<bool>(), 0u8..6);
    let foreign = proptest::option::of((1i128..=18, 1u8..6, 1u64..4));
    (
        proptest::collection::vec((system, room), agents),
        proptest::collection::vec((1u8..6, 1u64..4), 4),
        1usize..3,
        foreign,
    )
        .prop_map(move |(agents, threads, processors, foreign)| {
            let may = |may: u64| if processors == 1 { 1 } else { may };
            let mut threads: Vec<(u8, u64)> =
                threads.into_iter().map(|(priority, cpus)| (priority, may(cpus))).collect();
            let mut system = System { processors, agents: Vec::new(), executors: Vec::new() };
            let mut managed = Vec::new();
            for (at, ((cost, period, executor, before, how, keeps_gap), room)) in
                agents.into_iter().enumerate()
            {
                let (cost, period) = (cost * unit, period as i128 * 20 * unit);
                let mut agent = clocked(cost, period, executor);
                let (factor, elasticity, importance, ways, spare, may_suspend, rigid) = room;
                let mut it = elastic(
                    period,
                    period * factor,
                    if elasticity < 0.3 { 0.0 } else { elasticity },
                    importance,
                );
                if how == 0 && at > 0 {
                    let from = before % at;
                    agent.sources = vec![Source::After { agent: from, every: 1, least: n(0), depth: 4 }];
                    match system.agents[from].sources[0] {
                        // As often as it is sent to; who sends to it keeps its period.
                        Source::Clock { period } if keeps_gap => {
                            let sender: &mut Managed = &mut managed[from];
                            sender.elasticity = 0.0;
                            (it.nominal, it.longest) = (Some(period), Some(period * n(factor)));
                        }
                        _ => (it.nominal, it.longest) = (None, None),
                    }
                }
                it.methods = (0..ways)
                    .map(|way| Way {
                        cost: n((cost * (4 - way as i128) / 4).max(unit)),
                        quality: 1.0 - 0.2 * way as f64,
                    })
                    .collect();
                let spare = n((spare * unit).min(cost / 2 / unit * unit));
                it.anytime = (spare > n(0)).then(|| Anytime { least: n(cost) - spare, most: n(cost) });
                (it.may_suspend, it.rigid) = (may_suspend, rigid == 0);
                system.agents.push(agent);
                managed.push(it);
            }
            if let Some((cost, priority, cpus)) = foreign {
                threads.push((priority, may(cpus)));
                system.agents.push(clocked(cost * unit, 20 * unit, threads.len() - 1));
            }
            system.executors = executors(&threads);
            Case { system, managed }
        })
}
