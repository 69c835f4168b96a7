//! The decision maker: danger and desire make a situation, and a table says what the situation gives to whom.
//!
//! ```text
//!  safety ─▶ danger ─┐
//!  risk ────────────▶├─▶ situation ─▶ row of the table ─▶ decision (weights, and why)
//!  target ─▶ desire ─┘
//! ```
//!
//! | situation | when | before |
//! |---|---|---|
//! | `blind` | the safety monitor is silent or sees nothing | all |
//! | `target.near` | danger, and what is near is what is followed | `danger.near` |
//! | `danger.near` | danger | all below |
//! | `target.seen` | desire | all below |
//! | `narrow` | little room on both sides | `free` |
//! | `free` | else | |
//!
//! Danger and desire each have a level at which they begin and a lower one at which they end, so that a reading that trembles does not
//! make the robot tremble.

use runtime::{Agent, Fault, Input, Output, Step};
use types::geometry::wrap;
use types::messages::{Decision, Risk, Row, Safety, Target};
use types::params::Params;
use types::value::{Table, Value, nearest};
use types::{Duration, Name, Sequence, Time};

use crate::shared::Dated;

/// The levels, and the table of the decisions.
#[derive(Clone, Debug, Params)]
pub struct DecisionParams {
    /// For each situation the weight of each agent's offers, from 0 to 1, as in "danger.near" = { safety = 1.0, wall = 0.0 }. The section `[decide]` of a system file is this table.
    pub table: Table,
    /// Danger from which on it is near (0 to 1). 0.95: a door is 0.85 and a slow approach to a wall stays below.
    #[param(default = 0.95, min = 0.0, max = 1.0)]
    pub danger_from: f64,
    /// Danger below which it is over (0 to 1). 0.85: the way ahead is then a fifth longer than it must be.
    #[param(default = 0.85, min = 0.0, max = 1.0)]
    pub danger_until: f64,
    /// Desire from which on the target is followed (0 to 1). 0.5 is a target that was seen for a while, not once.
    #[param(default = 0.5, min = 0.0, max = 1.0)]
    pub desire_from: f64,
    /// Desire below which it is given up (0 to 1). 0.1 lets the tracker look for it.
    #[param(default = 0.1, min = 0.0, max = 1.0)]
    pub desire_until: f64,
    /// Half the width of the front in which risk counts as danger (rad). 0.3 is the front beam of a ring of twelve: at the sides a wall that is followed is always near.
    #[param(default = 0.3, min = 0.0, max = 3.2)]
    pub front: f64,
    /// How much of the risk in front counts as danger (0 to 1). 0.9: it shows and delays the end of a danger, but a noisy pair of samples begins none.
    #[param(default = 0.9, min = 0.0, max = 1.0)]
    pub risk_share: f64,
    /// What is near within this angle of the target is taken for the target (rad). 0.6 is a person's width at arm's length.
    #[param(default = 0.6, min = 0.0, max = 3.2)]
    pub target_width: f64,
    /// Share of the picture from which on the target can be what is near. 0.02 is a ball of 28 cm at 1.8 m.
    #[param(default = 0.02, min = 0.0, max = 1.0)]
    pub target_share: f64,
    /// A verdict of the safety monitor older than this is none (time). 700 ms is two missed readings of a sonar at 4 Hz.
    #[param(default = Duration::millis(700), min = 0.01, max = 60.0)]
    pub safety_age: Duration,
    /// A target older than this is none (time). 500 ms is seven pictures.
    #[param(default = Duration::millis(500), min = 0.01, max = 60.0)]
    pub target_age: Duration,
}

/// Recognises the situation from danger and desire, and gives every agent the weight that the table has for it.
#[derive(Agent)]
pub struct DecisionMaker {
    /// What the safety monitor says.
    safety: Input<Safety>,
    /// What the tracker sees.
    target: Input<Target>,
    /// The risk in each direction.
    risk: Input<Risk>,
    /// Situation, weights and reasons.
    #[port(history = 256)]
    decision: Output<Decision>,
    params: DecisionParams,
    judgement: Judgement,
}

impl Agent for DecisionMaker {
    fn start(&mut self, _: &mut Step) -> Result<(), Fault> {
        check(&self.params.table)
    }

    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        if let Some(received) = self.safety.newest() {
            self.judgement.safety = Some(Dated { value: *received, stamp: received.header().stamp });
        }
        if let Some(received) = self.target.newest() {
            self.judgement.target = Some(Dated { value: *received, stamp: received.header().stamp });
        }
        if let Some(received) = self.risk.newest() {
            self.judgement.risk = Some(Dated { value: *received, stamp: received.header().stamp });
        }
        let decision = self.judgement.decide(&self.params, step.now);
        self.decision.send(decision);
        Ok(())
    }
}

/// What the decision maker can recognise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Situation {
    /// Nothing is known of the surroundings.
    #[default]
    Blind,
    /// What is near is what is followed.
    TargetNear,
    /// Something is too near.
    DangerNear,
    /// There is something to follow.
    TargetSeen,
    /// There is little room on both sides.
    Narrow,
    /// Nothing of all that.
    Free,
}

impl Situation {
    /// All of them, the first before the others.
    pub const ALL: [Situation; 6] = [
        Situation::Blind,
        Situation::TargetNear,
        Situation::DangerNear,
        Situation::TargetSeen,
        Situation::Narrow,
        Situation::Free,
    ];

    /// Its key in the table.
    pub const fn name(self) -> &'static str {
        match self {
            Situation::Blind => "blind",
            Situation::TargetNear => "target.near",
            Situation::DangerNear => "danger.near",
            Situation::TargetSeen => "target.seen",
            Situation::Narrow => "narrow",
            Situation::Free => "free",
        }
    }

    /// The situation whose row counts where the table has none for this one.
    const fn next_best(self) -> Option<Situation> {
        match self {
            Situation::TargetNear => Some(Situation::TargetSeen),
            Situation::Narrow | Situation::TargetSeen => Some(Situation::Free),
            Situation::Blind | Situation::DangerNear | Situation::Free => None,
        }
    }
}

/// Refuses a table that names a situation which is never recognised, or a weight that is none.
fn check(table: &Table) -> Result<(), Fault> {
    let names = Situation::ALL.map(Situation::name);
    for row in table.rows() {
        let key = row.key.as_str();
        if !names.contains(&key) {
            let help = nearest(key, names).map_or(String::new(), |near| format!("; do you mean \"{near}\"?"));
            return Err(Fault::of(format!("no situation is called \"{key}\"{help}")));
        }
        let agents = row.entry.value.as_table().ok_or_else(|| {
            Fault::of(format!(
                "\"{key}\" needs a weight for each agent, as in {{ safety = 1.0, wall = 0.0 }}"
            ))
        })?;
        if let Some(bad) = agents.rows().iter().find(|row| weight(&row.entry.value).is_none()) {
            return Err(Fault::of(format!(
                "the weight of \"{}\" in \"{key}\" is a number from 0 to 1",
                bad.key
            )));
        }
    }
    Ok(())
}

fn weight(value: &Value) -> Option<f64> {
    value.as_float().filter(|weight| (0.0..=1.0).contains(weight))
}

/// What was heard last, and what was decided.
#[derive(Clone, Copy, Debug, Default)]
struct Judgement {
    safety: Option<Dated<Safety>>,
    target: Option<Dated<Target>>,
    risk: Option<Dated<Risk>>,
    endangered: bool,
    desiring: bool,
    situation: Situation,
    before: Situation,
}

impl Judgement {
    fn decide(&mut self, params: &DecisionParams, now: Time) -> Decision {
        let safety = Dated::fresh(&self.safety, now, params.safety_age).filter(|safety| !safety.blind);
        let target = Dated::fresh(&self.target, now, params.target_age).unwrap_or_default();
        let danger = safety.map_or(1.0, |safety| safety.danger.max(self.risk_ahead(params, now)));
        let with_hysteresis =
            |is: bool, value: f64, from: f64, until: f64| value >= if is { until.min(from) } else { from };
        self.endangered = with_hysteresis(self.endangered, danger, params.danger_from, params.danger_until);
        self.desiring =
            with_hysteresis(self.desiring, target.desire, params.desire_from, params.desire_until);
        let situation = match safety {
            None => Situation::Blind,
            Some(safety) if self.endangered && self.is_the_target(params, &safety, &target) => {
                Situation::TargetNear
            }
            Some(_) if self.endangered => Situation::DangerNear,
            Some(_) if self.desiring => Situation::TargetSeen,
            Some(safety) if safety.narrow => Situation::Narrow,
            Some(_) => Situation::Free,
        };
        if situation != self.situation {
            (self.before, self.situation) = (self.situation, situation);
            runtime::note!("another situation: danger {}, desire {}", danger, target.desire);
        }
        let rows = rows_of(&params.table, situation);
        Decision {
            situation: situation.name().into(),
            before: self.before.name().into(),
            active: strongest(&rows),
            danger,
            desire: target.desire,
            rows,
        }
    }

    /// The greatest risk in front, as far as it counts. A direction of which nothing is known adds none: safety judges that.
    fn risk_ahead(&self, params: &DecisionParams, now: Time) -> f64 {
        let Some(risk) = Dated::fresh(&self.risk, now, params.safety_age) else { return 0.0 };
        let bearing = |i: usize| wrap(f64::from(risk.angle_min) + i as f64 * f64::from(risk.angle_step));
        let ahead = risk.values.iter().enumerate().filter(|(i, _)| bearing(*i).abs() <= params.front);
        params.risk_share * ahead.map(|(_, risk)| f64::from(*risk)).fold(0.0, f64::max)
    }

    /// Whether the thing that is near is the one that is followed: then it is faced, not fled.
    fn is_the_target(&self, params: &DecisionParams, safety: &Safety, target: &Target) -> bool {
        let off = wrap(safety.nearest_bearing - target.bearing).abs();
        self.desiring && target.share >= params.target_share && off <= params.target_width
    }
}

/// The weights of a situation, or of the next best one that the table has.
fn rows_of(table: &Table, situation: Situation) -> Sequence<Row, 12> {
    let mut wanted = Some(situation);
    while let Some(situation) = wanted {
        if let Some(agents) = table.get(situation.name()).and_then(|entry| entry.value.as_table()) {
            let rows = agents.rows().iter();
            return rows
                .filter_map(|row| Some(Row { agent: Name::new(&row.key), weight: weight(&row.entry.value)? }))
                .collect();
        }
        wanted = situation.next_best();
    }
    Sequence::new()
}

/// The agent with the greatest weight, the first of equals; nobody when all are silenced.
fn strongest(rows: &[Row]) -> Name {
    let none = Row::default();
    rows.iter().fold(none, |best, row| if row.weight > best.weight { *row } else { best }).agent
}

#[cfg(test)]
mod tests {
    use super::*;

    fn weights(rows: &[(&str, f64)]) -> Table {
        let mut table = Table::new();
        rows.iter().for_each(|(agent, weight)| table.set(agent, Value::Float(*weight)));
        table
    }

    fn params() -> DecisionParams {
        let mut table = Table::new();
        for (situation, rows) in [
            ("danger.near", [("safety", 1.0), ("track", 0.0), ("wall", 0.0)]),
            ("target.seen", [("safety", 0.0), ("track", 1.0), ("wall", 0.0)]),
            ("free", [("safety", 0.0), ("track", 0.0), ("wall", 1.0)]),
        ] {
            table.set(situation, Value::Table(weights(&rows)));
        }
        DecisionParams { table, ..DecisionParams::default() }
    }

    /// A judgement that has just heard these.
    fn heard(danger: f64, desire: f64) -> Judgement {
        let safety = Safety { danger, nearest_bearing: 2.0, ..Safety::default() };
        let target = Target { desire, share: 0.05, visible: desire > 0.0, ..Target::default() };
        Judgement {
            safety: Some(Dated { value: safety, stamp: Time::ZERO }),
            target: Some(Dated { value: target, stamp: Time::ZERO }),
            ..Judgement::default()
        }
    }

    fn decide(mut judgement: Judgement) -> (String, String) {
        let decision = judgement.decide(&params(), Time::ZERO);
        (decision.situation.as_str().to_owned(), decision.active.as_str().to_owned())
    }

    fn pair(situation: &str, active: &str) -> (String, String) {
        (situation.to_owned(), active.to_owned())
    }

    #[test]
    fn danger_beats_desire_and_desire_beats_the_wall() {
        assert_eq!(decide(heard(0.2, 0.0)), pair("free", "wall"));
        assert_eq!(decide(heard(0.2, 1.0)), pair("target.seen", "track"));
        assert_eq!(decide(heard(1.0, 1.0)), pair("danger.near", "safety"));
    }

    #[test]
    fn what_is_near_and_followed_is_faced() {
        let mut judgement = heard(1.0, 1.0);
        judgement.safety.as_mut().unwrap().value.nearest_bearing = 0.3;
        assert_eq!(decide(judgement), pair("target.near", "track"), "with the row of the next best");
    }

    #[test]
    fn narrow_without_a_row_is_as_free() {
        let mut judgement = heard(0.2, 0.0);
        judgement.safety.as_mut().unwrap().value.narrow = true;
        assert_eq!(decide(judgement), pair("narrow", "wall"));
    }

    #[test]
    fn silence_of_safety_is_blindness_and_moves_nobody() {
        assert_eq!(decide(Judgement::default()), pair("blind", ""));
        let mut judgement = heard(0.2, 1.0);
        let late = Time::ZERO + Duration::millis(701);
        assert_eq!(judgement.decide(&params(), late).situation.as_str(), "blind");
    }

    #[test]
    fn a_trembling_reading_changes_nothing_between_the_two_levels() {
        let params = params();
        let mut judgement = heard(0.0, 0.0);
        let situations: Vec<_> = [0.94, 0.96, 0.94, 0.86, 0.84, 0.94]
            .into_iter()
            .map(|danger| {
                judgement.safety.as_mut().unwrap().value.danger = danger;
                judgement.decide(&params, Time::ZERO).situation.as_str().to_owned()
            })
            .collect();
        assert_eq!(situations, ["free", "danger.near", "danger.near", "danger.near", "free", "free"]);
        assert_eq!(judgement.decide(&params, Time::ZERO).before.as_str(), "danger.near");
    }

    #[test]
    fn risk_counts_in_front_only() {
        let params = params();
        let mut risk =
            Risk { angle_step: 1.0, values: [1.0, 0.0, 0.0].into_iter().collect(), ..Risk::default() };
        let danger = |risk: Risk| {
            let mut judgement = heard(0.2, 0.0);
            judgement.risk = Some(Dated { value: risk, stamp: Time::ZERO });
            judgement.decide(&params, Time::ZERO).danger
        };
        assert_eq!(danger(risk), 0.9);
        risk.values = [0.0, 1.0, 0.0].into_iter().collect();
        assert_eq!(danger(risk), 0.2);
    }

    #[test]
    fn a_table_with_a_wrong_word_is_refused_with_the_right_one() {
        let mut table = Table::new();
        table.set("danger.nearr", Value::Table(weights(&[("safety", 1.0)])));
        assert!(check(&table).unwrap_err().what.contains("do you mean \"danger.near\"?"));
        let mut table = Table::new();
        table.set("free", Value::Table(weights(&[("wall", 1.5)])));
        assert!(check(&table).unwrap_err().what.contains("\"wall\""));
        assert_eq!(check(&params().table), Ok(()));
    }
}
