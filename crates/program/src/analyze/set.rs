//! A bare task set: on one processor or several, under fixed priorities by deadline, and with the earliest deadline first.

use schedule::demand::{Demand, demand};
use schedule::partition::first_fit;
use schedule::response::responses;
use schedule::sensitivity::{largest_cost_factor, least_period};
use schedule::simulate::{How, Policy, simulate};
use schedule::utilization::{hyperbolic, liu_layland};
use schedule::{Exact, Task, TaskSet};

use super::report::{Edf, Part, Report, Row, in_words};
use super::tasks::Set;
use super::{AnalyzeArgs, draw, folder};
use crate::error::Failure;

/// So many of the shortest periods are drawn.
const DRAWN: i128 = 25;

/// Analyses a set whose numbers make sense.
pub(super) fn analyse(set: &Set, args: &AnalyzeArgs) -> Result<Report, Failure> {
    let mut report = Report { name: set.name.clone(), ..Report::default() };
    if set.tasks.is_empty() {
        return Err(Failure::new(format!("there is no task in {}", set.name)).help("write rows of [[task]]"));
    }
    let wrong =
        |_| Failure::new("the times of the tasks cannot be reckoned exactly").help("take fewer digits");
    let tasks: Vec<Task> = set.tasks.iter().map(|named| named.task.clone()).collect();
    let (ordered, order) = TaskSet::deadline_monotonic(tasks).map_err(wrong)?;
    let placed = first_fit(ordered.tasks().to_vec(), args.processors.into()).map_err(wrong)?;
    let several = placed.processors.len() > 1;
    let mut rows: Vec<Row> = vec![Row::default(); set.tasks.len()];
    for (processor, (part, places)) in placed.processors.iter().enumerate() {
        report.parts.push(part_of(format!("processor {processor}"), part));
        for (at, response) in responses(part).iter().enumerate() {
            let (rank, task) = (places[at], &part.tasks()[at]);
            rows[order[rank]] = Row {
                name: set.tasks[order[rank]].name.clone(),
                cost: task.cost,
                period: Some(task.period),
                deadline: task.due(),
                priority: Some(rank as u32 + 1),
                processor: several.then_some(processor),
                response: response.meets.then_some(response.at_worst),
                counts: true,
                played: None,
                measured: None,
                least_period: least_period(part, at).map(|least| super::report::seconds(least) * 1e9),
                cost_factor: largest_cost_factor(part, Some(at)),
                remark: String::new(),
            };
        }
    }
    report.rows = rows;
    let names = placed.homeless.iter().map(|rank| set.tasks[order[*rank]].name.as_str()).collect::<Vec<_>>();
    if several && !names.is_empty() {
        report.notes.push(format!("on no processor there is room for {}", names.join(", ")));
    }
    if let Some(folder) = folder(args, &set.name) {
        let place = |rank: usize| placed.processor_of(rank).filter(|_| several);
        let tasks = ordered
            .tasks()
            .iter()
            .enumerate()
            .map(|(rank, task)| Task { processor: place(rank), ..task.clone() });
        let played = TaskSet::new(tasks.collect()).map_err(wrong)?;
        let shortest = played.tasks().iter().map(|task| task.period).min().unwrap_or_default();
        let length = args
            .length
            .map_or(shortest * Exact::from_integer(DRAWN), |span| Exact::from_integer(span.0.into()));
        let policy = if args.edf { Policy::EarliestDeadline } else { Policy::FixedPriority };
        let schedule = simulate(&played, How { policy, processors: placed.processors.len(), length });
        let names: Vec<String> = order.iter().map(|at| set.tasks[*at].name.clone()).collect();
        report.files = draw(&schedule, &names, &folder)?;
    }
    Ok(report)
}

/// What the tests say of one processor.
pub(super) fn part_of(name: String, set: &TaskSet) -> Part {
    Part {
        name,
        utilization: set.utilization(),
        liu_layland: liu_layland(set),
        hyperbolic: hyperbolic(set),
        response_time: schedule::response::feasible(set),
        edf: edf(set),
    }
}

fn edf(set: &TaskSet) -> Edf {
    let found = demand(set);
    let why = match found {
        Demand::Met => "the demand is met at all times".to_owned(),
        Demand::Exceeded { within, work } => format!("{} to do within {}", in_words(work), in_words(within)),
        Demand::Overloaded => "more than a whole processor".to_owned(),
        Demand::Open => "too close to a whole processor to tell".to_owned(),
    };
    Edf { pass: found.pass(), why }
}
