//! What programs read of a run.

use std::collections::BTreeMap;

use runtime::{AgentView, Figure};
use serde_json::{Value as Json, json};
use types::Time;

use super::{RobotOutcome, Summary};
use crate::run::tasks;
use crate::run::useful::useful;

impl Summary {
    /// The documented shape of a run.
    pub(crate) fn to_json(&self) -> Json {
        let agents: Vec<Json> = self.agents.iter().map(agent_json).collect();
        let robots: Vec<Json> = self.robots.iter().map(|robot| robot_json(robot, self.begun)).collect();
        let incidents = self.incidents.iter().map(|incident| {
            let mut told =
                json!({"time_s": self.since(incident.time), "agent": incident.agent, "what": incident.what});
            if let Some(effect) = self.effect_of(incident) {
                told["effect"] = effect.into();
            }
            told
        });
        let noted = self.noted.iter().map(|noted| {
            json!({
                "agent": noted.agent,
                "what": noted.what,
                "first_s": self.since(noted.first),
                "last_s": self.since(noted.last),
                "count": noted.count,
            })
        });
        json!({
            "system": self.system,
            "seed": self.seed,
            "clock": self.clock,
            "time_s": self.time.seconds(),
            "wall_s": self.wall,
            "ended": self.ended,
            "goal": {"met": self.met, "why": self.why, "stages_s": self.stages()},
            "collisions": self.collisions(),
            "bumped": self.bumped(),
            "closest_m": self.closest(),
            "distance_m": self.distance(),
            "deadlines": {
                "of": self.count(|agent| agent.counts.releases),
                "missed": self.count(|agent| agent.counts.missed),
                "stalled": self.count(|agent| agent.counts.stalled),
            },
            "useful": useful(&self.done).map(|share| json!({
                "share": share,
                "agents": self.done.iter().map(|done| json!({
                    "name": done.name, "share": done.share(), "importance": done.work.importance,
                    "nominal": done.work.nominal, "in_time": done.work.in_time, "quality": done.work.quality,
                })).collect::<Vec<_>>(),
            })),
            "tasks": tasks::document(&self.tasks),
            "compared": self.compared.document,
            "messages": {
                "sent": self.sent,
                "replaced": self.replaced,
                "dropped": self.dropped,
                "refused": self.refused,
            },
            "allocations": self.allocations.as_ref().map(|by| json!({
                "real_time": by.iter().map(|(_, count)| count).sum::<u64>(),
                "by": by.iter().cloned().collect::<BTreeMap<String, u64>>(),
            })),
            "agents": agents,
            "robots": robots,
            "incidents": incidents.collect::<Vec<_>>(),
            "notes": noted.collect::<Vec<_>>(),
            "log": self.log.as_ref().map(|log| json!({
                "messages": log.tally.safe,
                "lost": log.tally.lost + self.log_dropped,
                "images": log.images,
                "images_hz": self.images,
                "errors": log.errors,
            })),
            "files": self.files.iter().map(|file| file.display().to_string()).collect::<Vec<_>>(),
            "repeat": self.repeat.as_ref().map(|repeat| json!({
                "log": repeat.log.display().to_string(),
                "requests": repeat.requests,
                "same": repeat.differs.is_none(),
                "differs": repeat.differs,
            })),
        })
    }
}

fn agent_json(agent: &AgentView) -> Json {
    json!({
        "name": agent.name,
        "kind": agent.kind,
        "executor": agent.executor,
        "asked": agent.asked,
        "granted": agent.granted,
        "state": agent.state.name(),
        "releases": agent.counts.releases,
        "missed": agent.counts.missed,
        "stalled": agent.counts.stalled,
        "skipped": agent.counts.skipped,
        "restarts": agent.counts.restarts,
        "left_out": agent.counts.left_out,
        "allocations": agent.counts.allocations,
        "checked": agent.counts.checked,
        "disagreed": agent.counts.disagreed,
        "exec": figure_json("exec", &agent.exec),
        "jitter": figure_json("jitter", &agent.jitter),
        "response": figure_json("response", &agent.response),
    })
}

/// The documented shape of a figure of spans of time.
pub(crate) fn figure_json(name: &str, figure: &Figure) -> Json {
    json!({
        "name": name,
        "unit": "ns",
        "n": figure.n,
        "min": figure.min,
        "p50": figure.p50,
        "p99": figure.p99,
        "p999": figure.p999,
        "max": figure.max,
    })
}

fn robot_json(robot: &RobotOutcome, begun: Time) -> Json {
    json!({
        "name": robot.name,
        "collisions": robot.truth.map(|truth| truth.collisions),
        "bumped": robot.truth.map(|truth| truth.bumped),
        "closest_m": robot.truth.map(|truth| truth.closest),
        "distance_m": robot.truth.map(|truth| truth.distance),
        "commands": robot.commands,
        "stale": robot.stale,
        "clamped": robot.clamped,
        "slowed": robot.slowed,
        "latched": robot.latch.is_some(),
        "latch": robot.latch.as_ref().map(|(time, causes)| json!({
            "set_s": (*time - begun).seconds(),
            "causes": causes,
        })),
        "shadow": robot.shadow,
        "recording": robot.report.as_ref().map(|report| json!({
            "lines": report.lines,
            "scans": report.scans,
            "odometry": report.odometry,
            "bad": report.bad,
            "bad_lines": report.told.iter().map(|told| json!({"line": told.line, "why": told.why})).collect::<Vec<_>>(),
        })),
    })
}
