//! From what there is to what the analysis sees of it, and what may be taken from whom.

use runtime::{Census, Foreign, HostReading, Resident};
use schedule::Exact;
use schedule::manage::{Anytime, Managed, Orders as Wanted, Way};
use schedule::system::{Agent, Executor, Source, System};
use types::messages::{Order, Orders};
use types::{Duration, Time};

use super::ResourceParams;

/// Who takes less of a processor disturbs no measurement.
const LEAST_SHARE: f32 = 0.02;
/// Where executors by deadline stand among the others, and so processes by deadline too.
const ABOVE_ALL: u8 = 100;

/// What is remembered of each agent.
#[derive(Debug, Default)]
pub(super) struct Model {
    seen: Vec<Seen>,
}

/// How long the steps of an agent were seen to take.
#[derive(Clone, Copy, Debug)]
struct Seen {
    /// By how much longer than is declared.
    times: f64,
    /// When that was seen last.
    at: Option<Time>,
    /// For how many times as long as usual it is believed: twice as long after each time that it was found to be so still.
    patience: i64,
    /// When another process took time from its steps last.
    disturbed: Option<Time>,
    /// Whether it was believed no more, and what it takes now is not seen yet.
    is_tried: bool,
}

/// An agent that is suspended is tried again no less often than after so many times the usual span.
const MOST_PATIENCE: i64 = 16;
/// For so long what was disturbed is among what steps took of late.
const SETTLES: Duration = Duration::millis(1200);
/// What takes so much longer than is declared is found to be so still.
const STILL: f64 = 1.25;

impl Default for Seen {
    fn default() -> Seen {
        Seen { times: 1.0, at: None, patience: 1, disturbed: None, is_tried: false }
    }
}

impl Model {
    /// All agents with what they take now by their methods at best, and with the work of others.
    pub(super) fn system(
        &mut self,
        census: &Census,
        host: &HostReading,
        params: &ResourceParams,
        now: Time,
    ) -> System {
        let mut system = census.system.clone();
        self.seen.resize(census.residents.len(), Seen::default());
        let residents = census.residents.iter().zip(&mut self.seen);
        for (agent, (resident, seen)) in system.agents.iter_mut().zip(residents) {
            let executor = &census.system.executors[agent.executor];
            // What another process takes from a step is in what the step is said to have taken.
            if host.burdens.iter().any(|burden| stands_over(burden, executor)) {
                seen.disturbed = Some(now);
            }
            if seen.disturbed.is_none_or(|at| now - at > SETTLES) {
                look(resident, seen, census.percent, now, params.believes);
            }
            agent.cost = exact(cost_of(resident, 0, seen.times) + census.overhead);
        }
        for burden in &host.burdens {
            let priority = Some(if burden.priority == 0 { ABOVE_ALL } else { burden.priority });
            system.executors.push(Executor { priority, may: burden.may });
            let period = params.burden_period;
            let work = Duration((period.0 as f64 * f64::from(burden.share)) as i64 / 1000 * 1000);
            system.agents.push(Agent {
                cost: exact(work),
                deadline: exact(period),
                executor: system.executors.len() - 1,
                sources: vec![Source::Clock { period: exact(period) }],
                least_gap: exact(Duration::ZERO),
            });
        }
        system
    }

    /// What may be taken from each.
    pub(super) fn managed(&self, census: &Census, orders: &Orders, own: &str) -> Vec<Managed> {
        let residents = census.residents.iter().enumerate();
        residents
            .map(|(at, resident)| {
                let name = resident.plan.name.as_str();
                let order = orders.orders.iter().find(|order| order.agent.as_str() == name);
                if resident.is_robot || name == own || resident.nominal.giving.is_rigid {
                    return Managed::rigid();
                }
                managed(resident, order, self.seen[at].times, census.overhead)
            })
            .collect()
    }
}

/// Whether another process takes time from the steps of an executor.
fn stands_over(burden: &Foreign, executor: &Executor) -> bool {
    let priority = if burden.priority == 0 { ABOVE_ALL } else { burden.priority };
    burden.share > LEAST_SHARE && burden.may & executor.may != 0 && Some(priority) > executor.priority
}

/// What steps took of late beside what is declared for them. Where there were none, what was seen last is believed for some time.
fn look(resident: &Resident, seen: &mut Seen, percent: i64, now: Time, believes: Duration) {
    let (steps, longest) = resident.recent;
    let declared = resident.plan.cost_of_step(resident.methods).unwrap_or(Duration::ZERO);
    if steps > 0 && declared > Duration::ZERO {
        // What an anytime agent took for refinements it took within its budget.
        let free = resident.plan.budget.unwrap_or(Duration::ZERO);
        let over = if free > Duration::ZERO { longest - free + declared } else { longest };
        let taken = Duration(over.0 * percent / 100);
        let times = (taken.0 as f64 / declared.0 as f64).max(1.0);
        let patience = match (seen.is_tried, times >= STILL) {
            (true, true) => (seen.patience * 2).min(MOST_PATIENCE),
            (_, false) => 1,
            (false, true) => seen.patience,
        };
        *seen = Seen { times, at: Some(now), patience, is_tried: false, ..*seen };
    } else if seen.at.is_some_and(|at| now - at > believes * seen.patience) {
        *seen = Seen { times: 1.0, at: None, is_tried: true, ..*seen };
    }
}

/// What a step takes by a method, with its whole budget.
fn cost_of(resident: &Resident, method: usize, times: f64) -> Duration {
    let base = base_of(resident, method, times);
    base.max(resident.nominal.budget.unwrap_or(Duration::ZERO))
}

/// What it takes without refinements.
fn base_of(resident: &Resident, method: usize, times: f64) -> Duration {
    let declared = match resident.methods.get(method) {
        Some(method) => resident.nominal.cost_by(method.name),
        None => resident.nominal.cost,
    };
    // Whole microseconds: the analysis is exact, and finer ones would cost it much.
    let micros = declared.unwrap_or(Duration::ZERO).0 as f64 * times / 1000.0;
    Duration((micros - 1e-6).ceil() as i64 * 1000)
}

/// The gap between two steps of an agent that only messages make run, at the rate at which they come; nothing where it has none to lengthen.
pub(super) fn nominal_gap(resident: &Resident) -> Option<Duration> {
    resident.nominal.giving.gap_max.and(resident.gap)
}

fn managed(resident: &Resident, order: Option<&Order>, times: f64, overhead: Duration) -> Managed {
    let plan = &resident.nominal;
    let (nominal, longest) = match plan.period {
        Some(period) => (Some(period), plan.period_range.map(|(_, longest)| longest)),
        None => (nominal_gap(resident), plan.giving.gap_max),
    };
    let way = |method: usize, quality: f64| Way {
        cost: exact(cost_of(resident, method, times) + overhead),
        quality,
    };
    let methods = resident.methods.iter().enumerate().map(|(at, method)| way(at, method.quality));
    let asked = plan.method.as_deref().and_then(|name| place_of(resident, name)).unwrap_or(0);
    let wanted = order.and_then(Order::method).and_then(|name| place_of(resident, name));
    let anytime = plan.budget.map(|budget| {
        let least = base_of(resident, asked, times);
        Anytime { least: exact(least + overhead), most: exact(least.max(budget) + overhead) }
    });
    Managed {
        rigid: false,
        nominal: nominal.map(exact),
        longest: longest.zip(nominal).map(|(longest, nominal)| exact(longest.max(nominal))),
        elasticity: if longest.is_some() { plan.giving.elasticity() } else { 0.0 },
        importance: order.and_then(Order::importance).unwrap_or(plan.giving.importance()),
        methods: methods.collect(),
        anytime,
        may_suspend: plan.giving.may_suspend,
        orders: Wanted {
            rate: order.and_then(Order::rate).unwrap_or(1.0),
            active: order.and_then(Order::active).unwrap_or(!plan.giving.is_suspended),
            method: wanted.unwrap_or(asked),
        },
    }
}

fn place_of(resident: &Resident, method: &str) -> Option<usize> {
    resident.methods.iter().position(|known| known.name == method)
}

fn exact(span: Duration) -> Exact {
    Exact::from_integer(span.0.into())
}
