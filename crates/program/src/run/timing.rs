//! What the host's clock said of a run: all that must not be in the log of a simulated one.

use runtime::{AgentView, Figure};
use serde_json::{Value as Json, json};

use super::summary::{Summary, figure_json};

/// The documented shape of `timing.json`.
pub(super) fn to_json(summary: &Summary) -> Json {
    json!({
        "system": summary.system,
        "seed": summary.seed,
        "clock": summary.clock,
        "time_s": summary.time.seconds(),
        "wall_s": summary.wall,
        "agents": summary.agents.iter().map(agent).collect::<Vec<_>>(),
    })
}

fn agent(agent: &AgentView) -> Json {
    json!({
        "name": agent.name,
        "releases": agent.counts.releases,
        "missed": agent.counts.missed,
        "deadline_s": agent.deadline.seconds(),
        "exec": with_steps("exec", &agent.exec, &agent.exec_steps),
        "jitter": with_steps("jitter", &agent.jitter, &agent.jitter_steps),
        "response": figure_json("response", &agent.response),
    })
}

/// A figure with its histogram: for each step that is not empty its upper end (ns) and how many values it holds.
fn with_steps(name: &str, figure: &Figure, steps: &[(f64, u32)]) -> Json {
    let mut json = figure_json(name, figure);
    json["steps"] = json!(steps);
    json
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_steps_of_a_histogram_stand_beside_its_figure() {
        let figure = Figure { n: 5, max: 70.0, ..Figure::default() };
        let json = with_steps("exec", &figure, &[(36.0, 3), (72.0, 2)]);
        assert_eq!(json["steps"].to_string(), "[[36.0,3],[72.0,2]]");
        assert_eq!((json["n"].as_u64(), json["max"].as_f64()), (Some(5), Some(70.0)));
    }
}
