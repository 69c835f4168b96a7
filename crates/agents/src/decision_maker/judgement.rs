//! From the values of the signals to a decision: no time, no ports, no memory but of what was active before.

use types::messages::{Decision, Held, MOST_AGENTS, MOST_SITUATIONS, Order, Orders, Reason, Reasons, Row};
use types::{Name, Sequence};

use super::DecisionParams;
use super::signal::{Known, Values};
use super::situation::{Recognised, Situation};
use super::table::{DecisionTable, SituationRow, When, filled};

/// What is decided, what that asks of agents, and what it was decided on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Verdict {
    /// Situation, goal and weights.
    pub decision: Decision,
    /// Importance, rate, activity and method of agents.
    pub orders: Orders,
    /// The values, and the situations before and after.
    pub reasons: Reasons,
}

/// What was decided before, as far as the next decision depends on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judgement {
    active: Sequence<Name, MOST_SITUATIONS>,
    situation: Name,
    before: Name,
}

impl Default for Judgement {
    /// At first nothing is known.
    fn default() -> Judgement {
        let blind = Situation::Blind.name().into();
        Judgement { active: Sequence::new(), situation: blind, before: blind }
    }
}

impl Judgement {
    /// What was before a decision that was recorded.
    pub fn before(decision: &Decision, reasons: &Reasons) -> Judgement {
        let active = reasons.situations.iter().filter(|held| held.was).map(|held| held.situation).collect();
        Judgement { active, situation: decision.before, before: decision.before }
    }

    /// Decides again on what was recorded of a decision, and on nothing else. With the parameters of that time the verdict is the same.
    pub fn again(&mut self, params: &DecisionParams, reasons: &Reasons) -> Verdict {
        self.judge(params, &Values::recorded(reasons, &params.table.told))
    }

    /// Decides.
    pub(super) fn judge(&mut self, params: &DecisionParams, values: &Values) -> Verdict {
        let table = &params.table;
        let recognised = Recognised::of(params, values, |situation| self.was_active(situation.name()));
        let (mut now_active, mut situations) = (Sequence::new(), Sequence::new());
        let mut is_active = [false; MOST_SITUATIONS];
        for (row, is) in table.rows.iter().zip(&mut is_active) {
            let was = self.was_active(row.name.as_str());
            *is = match &row.when {
                When::BuiltIn(situation) => recognised.is(*situation),
                When::Own { until: Some(until), .. } if was => !until.holds(values),
                When::Own { when, .. } => when.holds(values),
            };
            // There is room for all: a table with more rows is refused.
            let _ = situations.push(Held { situation: row.name, was, is: *is });
            if *is {
                let _ = now_active.push(row.name);
            }
        }
        self.active = now_active;
        let active = || table.rows.iter().zip(&is_active).filter(|(_, is)| **is).map(|(row, _)| row);
        let first = active().next().map_or(self.situation, |row| row.name);
        if first != self.situation {
            (self.before, self.situation) = (self.situation, first);
        }
        let weights = weights(active());
        let goal = active().map(|row| row.goal).find(|goal| !goal.is_empty()).unwrap_or_default();
        let decision = Decision {
            situation: first,
            before: self.before,
            active: strongest(&weights),
            danger: values.get(Known::Danger).unwrap_or(1.0),
            desire: values.get(Known::Desire).unwrap_or(0.0),
            goal,
            rows: weights,
        };
        let orders = Orders { goal, orders: orders(table, active) };
        Verdict { decision, orders, reasons: Reasons { situations, values: reasons(table, values) } }
    }

    /// The situation that was decided last.
    pub(super) fn situation(&self) -> Name {
        self.situation
    }

    fn was_active(&self, situation: &str) -> bool {
        self.active.iter().any(|active| active.as_str() == situation)
    }
}

/// The weight of each agent: what the first situation says that says one.
fn weights<'t>(active: impl Iterator<Item = &'t SituationRow>) -> Sequence<Row, MOST_AGENTS> {
    let mut weights: Sequence<Row, MOST_AGENTS> = Sequence::new();
    for row in active {
        for (agent, weight) in &row.weights {
            if !weights.iter().any(|known| known.agent == *agent) {
                let _ = weights.push(Row { agent: *agent, weight: *weight, by: row.name });
            }
        }
    }
    weights
}

/// The orders of each agent, each setting by the first situation that says it.
fn orders<'t, A: Iterator<Item = &'t SituationRow>>(
    table: &DecisionTable,
    active: impl Fn() -> A,
) -> Sequence<Order, MOST_AGENTS> {
    let order = |agent: &Name| {
        let said = active().filter_map(|row| row.orders.iter().find(|order| order.agent == *agent));
        said.fold(Order::of(*agent), |own, other| filled(&own, other))
    };
    table.ordered.iter().map(order).collect()
}

fn reasons<const N: usize>(table: &DecisionTable, values: &Values) -> Sequence<Reason, N> {
    let known = table.needed.iter().filter(|place| !values.at(**place).is_nan());
    known.map(|place| Reason { signal: table.signal(*place), value: values.at(*place) }).collect()
}

/// The agent with the greatest weight, the first of equals; nobody when all are silenced.
fn strongest(rows: &[Row]) -> Name {
    let none = Row::default();
    rows.iter().fold(none, |best, row| if row.weight > best.weight { *row } else { best }).agent
}
