//! The competition robot's task set, Table III of its paper, and what the paper found for it.

use std::process::ExitCode;

use schedule::demand::demand;
use schedule::sensitivity::{largest, largest_cost_factor};
use schedule::utilization::{hyperbolic, liu_layland, liu_layland_bound};
use schedule::{Exact, Task, TaskSet, encoder, response};
use serde_json::json;

use super::{AnalyzeArgs, set, tasks};
use crate::error::Failure;
use crate::run::table;
use crate::terminal;

const TABLE_III: &str = include_str!("table_iii.toml");

/// A figure of the paper and ours.
struct Row {
    what: &'static str,
    unit: &'static str,
    paper: Option<f64>,
    ours: f64,
}

/// Prints the table, and the paper's figures beside ours.
pub(super) fn paper(args: &AnalyzeArgs, json: bool) -> Result<ExitCode, Failure> {
    let read = tasks::read(TABLE_III, "table_iii.toml")?;
    let report = set::analyse(&read, args)?;
    let tasks: Vec<Task> = read.tasks.into_iter().map(|named| named.task).collect();
    let rows = rows(&tasks).ok_or_else(|| Failure::new("the paper's tasks are not as they were"))?;
    if json {
        let mut document = report.to_json();
        let row =
            |row: &Row| json!({"what": row.what, "unit": row.unit, "paper": row.paper, "ours": row.ours});
        document["paper"] = rows.iter().map(row).collect();
        terminal::say_json(&document);
    } else {
        let head = ["", "the paper", "ours", ""].map(str::to_owned);
        let number = |x: f64| format!("{x:.6}").trim_end_matches('0').trim_end_matches('.').to_owned();
        let line = |row: &Row| {
            let paper = row.paper.map_or("-".to_owned(), number);
            [row.what.to_owned(), paper, number(row.ours), row.unit.to_owned()]
        };
        let lines: Vec<[String; 4]> = std::iter::once(head).chain(rows.iter().map(line)).collect();
        terminal::say(&format!("{}\n{}", report.to_text(), table(&lines, 1)));
    }
    Ok(if report.pass() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn rows(tasks: &[Task]) -> Option<Vec<Row>> {
    let set = TaskSet::new(tasks.to_vec()).ok()?;
    let [s, w1, w2, autopilot, manual, referee] = tasks else { return None };
    let micros = 1e-3;
    let encoder = encoder::longest_period(Exact::from_integer(150), Exact::from_integer(4480))?;
    let ratio = Exact::from_integer(20);
    let one = Exact::from_integer(1);
    let tied = [(w1.cost, one), (w2.cost, one), (autopilot.cost, ratio)];
    let others = [s, manual, referee].map(|task| (task.cost, task.period));
    let equation_5 = encoder::least_common_period(&tied, &others)?;
    // T of both wheel controllers, and 20 T of the autopilot: the least that passes.
    let at = |period: Exact| {
        let mut tasks = tasks.to_vec();
        (tasks[1].period, tasks[2].period, tasks[3].period) = (period, period, period * ratio);
        TaskSet::new(tasks).ok()
    };
    let least = |test: &dyn Fn(&TaskSet) -> bool| {
        let nominal = w1.period;
        let slow = Exact::new(1, 1000);
        let speed = largest(|speed| speed <= slow || at(nominal / speed).is_some_and(|set| test(&set)))?;
        Some(*nominal.numer() as f64 / *nominal.denom() as f64 / speed * micros)
    };
    let grown = |test: &dyn Fn(&TaskSet) -> bool| {
        largest(|factor| {
            let tasks = tasks.iter().map(|task| Task { cost: task.cost * factor, ..task.clone() });
            TaskSet::new(tasks.collect()).is_ok_and(|set| test(&set))
        })
    };
    let row = |what, unit, paper, ours| Row { what, unit, paper, ours };
    Some(vec![
        row(
            "longest T of S, eq. (3)",
            "µs",
            Some(89.28),
            *encoder.numer() as f64 / *encoder.denom() as f64 * micros,
        ),
        row("utilisation, eq. (4), left", "", None, set.utilization()),
        row("its bound, eq. (4), right", "", None, liu_layland_bound(tasks.len())),
        row("T of W1 and W2, eq. (5)", "µs", Some(100.0), equation_5 * micros),
        row("least T of W1 and W2: Liu and Layland", "µs", None, least(&|set| liu_layland(set).pass)?),
        row("… hyperbolic", "µs", None, least(&|set| hyperbolic(set).pass)?),
        row("… response times", "µs", None, least(&response::feasible)?),
        row("… earliest deadline first", "µs", None, least(&|set| demand(set).pass())?),
        row("all C may grow: Liu and Layland", "×", None, grown(&|set| liu_layland(set).pass)?),
        row("… hyperbolic", "×", None, grown(&|set| hyperbolic(set).pass)?),
        row("… response times", "×", None, largest_cost_factor(&set, None)?),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ours_are_the_figures_that_others_reckoned() {
        let read = tasks::read(TABLE_III, "table_iii.toml").unwrap();
        let tasks: Vec<Task> = read.tasks.into_iter().map(|named| named.task).collect();
        let ours: Vec<f64> = rows(&tasks).unwrap().iter().map(|row| row.ours).collect();
        let expected =
            [89.285714, 0.691818, 0.734772, 92.209966, 92.21, 85.70, 65.10, 62.27, 1.062, 1.120, 1.371];
        for (at, (ours, expected)) in ours.iter().zip(expected).enumerate() {
            assert!((ours - expected).abs() < if at < 4 { 1e-6 } else { 1e-2 }, "{at}: {ours}, {expected}");
        }
    }
}
