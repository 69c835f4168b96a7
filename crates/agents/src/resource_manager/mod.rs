//! The resource manager: sees how much time there is and who needs it, and keeps all in time by taking from those who matter least.
//!
//! ```text
//!  /proc or virtual processors ─▶ load ─────────────────────────┐
//!  census: plans, what steps took, deadlines ─▶ model of it all ─▶ schedule::manage ─▶ settings ─▶ all agents at once
//!  orders of the decision maker ─▶ importance, rate, method ────┘
//! ```
//!
//! What is set is reckoned from what people asked for and from the load, never from what was set before: the same load gives the same settings,
//! and nominal ones come back when it falls. Agents that are rigid, and those whose plan says nothing of giving way, are not touched.
//!
//! It is an ordinary agent of an ordinary thread; what it takes itself is in [`Load::cost`], and it stands in all tables like anybody.

mod model;
mod words;

use runtime::{Agent, Census, Fault, Given, HostReading, Input, Manager, Output, Resident, Step};
use schedule::manage::{Change, Governor, Ladder, Patience, Setting};
use types::messages::{Grant, Load, Orders};
use types::params::Params;
use types::{Duration, Name, Sequence, Text, Time};

use model::Model;

/// The rules by which it can manage.
const POLICIES: [&str; 3] = ["elastic", "ladder", "none"];

/// How it manages.
#[derive(Clone, Debug, Params)]
pub struct ResourceParams {
    /// By which rule: "elastic" takes from the least important as little as is needed; "ladder" halves the rate of whoever missed a deadline, as other systems do, for comparison; "none" looks on.
    #[param(default = "elastic", words = POLICIES)]
    pub policy: String,
    /// How long the load must have been low before anything is given back (time). 600 ms are three looks, and so no burst that is over at once.
    #[param(default = Duration::millis(600), min = 0.0, max = 60.0)]
    pub back_after: Duration,
    /// By how much all costs may grow before what is given back would have to be taken again (share). 0.05: more than what was measured trembles.
    #[param(default = 0.05, min = 0.0, max = 1.0)]
    pub margin: f64,
    /// How often other processes are thought to work that have a real-time priority (time). 10 ms: what the kernel tells is their share alone.
    #[param(default = Duration::millis(10), min = 0.0001, max = 10.0)]
    pub burden_period: Duration,
    /// How long what a suspended agent took last is taken for what it would take now (time). After 5 s it is tried again, and after twice as long each time that it takes as long still.
    #[param(default = Duration::secs(5), min = 0.1, max = 3600.0)]
    pub believes: Duration,
    /// Memory that this process may use (MB); 0 for any. What is more is told.
    #[param(default = 0.0, min = 0.0, max = 1e9)]
    pub memory: f64,
}

/// Keeps all agents in time: lengthens periods, chooses cheaper methods, shortens budgets and suspends, each as little as it must and of the least important first, and gives it back when the load falls.
#[derive(Agent)]
pub struct ResourceManager {
    /// What the decision maker wants of whom.
    orders: Input<Orders>,
    /// How loaded the computer is.
    #[port(history = 16)]
    load: Output<Load>,
    /// What an agent may use from now on.
    #[port(history = 64)]
    grants: Output<Grant>,
    /// What there is, and what is set.
    manager: Manager,
    params: ResourceParams,
    model: Model,
    rule: Option<Rule>,
    /// Who there was when the rule began.
    names: Vec<String>,
    orders_now: Orders,
    before: Option<(Time, Duration)>,
    /// Missed deadlines of each at the last look.
    missed: Vec<u64>,
    over_memory: bool,
    cause: String,
}

/// By which rule settings are found.
enum Rule {
    Elastic(Governor),
    Ladder(Ladder),
}

impl Agent for ResourceManager {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        if let Some(orders) = self.orders.latest() {
            self.orders_now = orders;
        }
        let host = self.manager.host();
        let Some(census) = self.manager.look() else { return Ok(()) };
        let own = step.name_of(step.agent).unwrap_or_default();
        let load = self.load_of(&census, &host, own.as_str(), step.now);
        self.watch_memory(&load);
        self.load.send(load);
        self.begin_anew_for_others(&census);
        let change = self.decide(&census, &host, own.as_str(), step.now)?;
        if let Some(change) = change {
            self.cause = words::cause(&change, &self.names, &host);
        }
        self.give(&census);
        Ok(())
    }
}

impl ResourceManager {
    fn load_of(&mut self, census: &Census, host: &HostReading, own: &str, now: Time) -> Load {
        let used = census.residents.iter().find(|agent| agent.plan.name == own);
        let used = used.map_or(Duration::ZERO, |agent| agent.used);
        let (then, before) = self.before.replace((now, used)).unwrap_or((now, used));
        let length = (now - then).seconds().max(1e-3);
        Load {
            processors: host.processors.iter().copied().collect::<Sequence<f32, 16>>(),
            foreign: host.foreign,
            memory: host.memory as f64,
            memory_free: host.memory_free as f64,
            pressure_cpu: host.pressure_cpu.unwrap_or(0.0),
            pressure_memory: host.pressure_memory.unwrap_or(0.0),
            cost: ((used - before).seconds() / length) as f32,
        }
    }

    fn watch_memory(&mut self, load: &Load) {
        let most = self.params.memory * 1e6;
        let is_over = most > 0.0 && load.memory > most;
        if is_over && !self.over_memory {
            runtime::note!(
                "the process uses {} MB of memory, and may use {} MB",
                load.memory * 1e-6,
                self.params.memory
            );
        }
        self.over_memory = is_over;
    }

    /// Where other agents are there, what was found for those before says nothing.
    fn begin_anew_for_others(&mut self, census: &Census) {
        let is_same = census.residents.iter().map(|agent| &agent.plan.name).eq(&self.names);
        if is_same && self.rule.is_some() {
            return;
        }
        self.names = census.residents.iter().map(|agent| agent.plan.name.clone()).collect();
        self.missed = census.residents.iter().map(misses).collect();
        self.model = Model::default();
        let patience = Patience { back_after: self.params.back_after.0, margin: self.params.margin };
        self.rule = match self.params.policy.as_str() {
            "elastic" => Some(Rule::Elastic(Governor::new(patience))),
            "ladder" => Some(Rule::Ladder(Ladder::new(patience))),
            _ => None,
        };
    }

    fn decide(
        &mut self,
        census: &Census,
        host: &HostReading,
        own: &str,
        now: Time,
    ) -> Result<Option<Change>, Fault> {
        let Some(rule) = &mut self.rule else { return Ok(None) };
        let Self { model, params, orders_now, .. } = self;
        let system = model.system(census, host, params, now);
        let managed = model.managed(census, orders_now, own);
        Ok(match rule {
            Rule::Elastic(governor) => governor.decide(now.0, &system, &managed).map_err(Fault::of)?,
            Rule::Ladder(ladder) => {
                let missed: Vec<u64> = census.residents.iter().map(misses).collect();
                let late: Vec<bool> = missed.iter().zip(&self.missed).map(|(now, then)| now > then).collect();
                self.missed = missed;
                ladder.decide(now.0, &managed, &late)
            }
        })
    }

    /// Sets what differs from what the rule has found, whoever changed it.
    fn give(&mut self, census: &Census) {
        let settings = match &self.rule {
            Some(Rule::Elastic(governor)) => governor.settings(),
            Some(Rule::Ladder(ladder)) => ladder.settings(),
            None => return,
        };
        let pairs = census.residents.iter().zip(settings);
        let given = pairs.filter_map(|(agent, setting)| given(agent, setting, census.overhead));
        let given: Vec<Given> = given.collect();
        if given.is_empty() {
            return;
        }
        for one in &given {
            let agent = census.residents.iter().find(|agent| agent.plan.name == one.agent);
            let grant = agent.map(|agent| grant(agent, one, &self.cause)).unwrap_or_default();
            self.grants.send(grant);
        }
        self.manager.give(given, self.cause.clone());
    }
}

/// Deadlines that an agent has missed by what happens in the system: not by a processor that stood still.
fn misses(agent: &Resident) -> u64 {
    agent.counts.missed.saturating_sub(agent.counts.stalled)
}

/// What is to be set of an agent, where it is otherwise than it shall be.
fn given(agent: &Resident, setting: &Setting, overhead: Duration) -> Option<Given> {
    if agent.is_robot || agent.nominal.giving.is_rigid {
        // What people ask of it holds.
        return None;
    }
    let nanos = |time: schedule::Exact| Duration(time.to_integer() as i64);
    let nominal = &agent.nominal;
    let is_periodic = nominal.period.is_some();
    let time = setting.period.map(nanos);
    let period = time.filter(|_| is_periodic);
    // At its nominal rate nothing holds it back.
    let gap = time.filter(|_| !is_periodic).map(|gap| match model::nominal_gap(agent) {
        // A hair more than that is rounding.
        Some(usual) if gap.0 <= usual.0 + usual.0 / 1000 => nominal.min_gap,
        _ => gap,
    });
    let method = agent.methods.get(setting.method).map(|method| method.name);
    let budget = setting.budget.map(nanos).map(|budget| (budget - overhead).max(Duration(1)));
    let is_suspended = !setting.active;
    let as_it_is = period.is_none_or(|period| agent.plan.period == Some(period))
        && gap.is_none_or(|gap| agent.plan.min_gap == gap)
        && method.is_none_or(|_| agent.method == setting.method)
        && budget.is_none_or(|budget| agent.plan.budget == Some(budget))
        && is_suspended == agent.plan.giving.is_suspended;
    let agent = nominal.name.clone();
    (!as_it_is).then_some(Given { agent, period, gap, method, budget, is_suspended })
}

fn grant(agent: &Resident, given: &Given, cause: &str) -> Grant {
    let usual = agent.nominal.period.or(model::nominal_gap(agent)).unwrap_or(Duration::ZERO).seconds();
    let now = given.period.or(given.gap).map_or(usual, Duration::seconds);
    let rate = if now > usual && usual > 0.0 { usual / now } else { 1.0 };
    Grant {
        agent: Name::new(&given.agent),
        rate: if given.is_suspended { 0.0 } else { rate },
        method: Name::new(given.method.unwrap_or_default()),
        budget: given.budget.map_or(0.0, Duration::seconds),
        suspended: given.is_suspended,
        cause: Text::new(cause),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use types::value::{Table, Value};

    #[test]
    fn a_rule_that_nobody_knows_is_told_with_the_nearest() {
        let read = |policy: &str| {
            let mut table = Table::new();
            table.set("policy", Value::from(policy));
            ResourceParams::read(&table, "resource-manager").err().unwrap_or_default()
        };
        assert!(POLICIES.iter().all(|policy| read(policy).is_empty()));
        let wrong = read("elastc");
        assert_eq!(wrong.len(), 1, "{wrong:?}");
        assert!(wrong[0].help.as_ref().is_some_and(|help| help.contains("\"elastic\"")), "{wrong:?}");
    }
}
