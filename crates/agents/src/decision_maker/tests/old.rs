//! The decision maker as it was when six situations were all that it knew: one situation at a time, and its row whole. What whole rows
//! say must not have changed.

use types::geometry::wrap;
use types::messages::{Row, Safety, Target};
use types::value::Table;
use types::{Name, Sequence, Time};

use super::super::hearing::Hearing;
use super::super::{DecisionParams, Situation};
use crate::shared::Dated;

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Judgement {
    endangered: bool,
    desiring: bool,
    situation: Situation,
    before: Situation,
}

/// Situation, the one before, active agent, danger, desire, weights.
pub(super) type Decided = (Name, Name, Name, f64, f64, Vec<(Name, f64)>);

impl Judgement {
    pub(super) fn decide(
        &mut self,
        params: &DecisionParams,
        table: &Table,
        heard: &Hearing,
        now: Time,
    ) -> Decided {
        let safety = Dated::fresh(&heard.safety, now, params.safety_age).filter(|safety| !safety.blind);
        let target = Dated::fresh(&heard.target, now, params.target_age).unwrap_or_default();
        let danger = safety.map_or(1.0, |safety| safety.danger.max(0.0));
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
        }
        let row = table.get(situation.name()).and_then(|entry| entry.value.as_table()).unwrap();
        let rows: Sequence<Row, 12> = row
            .rows()
            .iter()
            .map(|row| Row {
                agent: Name::new(&row.key),
                weight: row.entry.value.as_float().unwrap(),
                ..Row::default()
            })
            .collect();
        let none = Row::default();
        let active =
            rows.iter().fold(none, |best, row| if row.weight > best.weight { *row } else { best }).agent;
        let rows = rows.iter().map(|row| (row.agent, row.weight)).collect();
        (situation.name().into(), self.before.name().into(), active, danger, target.desire, rows)
    }

    fn is_the_target(&self, params: &DecisionParams, safety: &Safety, target: &Target) -> bool {
        let off = wrap(safety.nearest_bearing - target.bearing).abs();
        self.desiring && target.share >= params.target_share && off <= params.target_width
    }
}
