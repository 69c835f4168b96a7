//! From a request to words.

use runtime::{AgentPlan, OnDeath, QueuePlan, Request, WirePlan};
use types::value::Table;
use types::{Duration, Priority};

use super::{AND, QUEUE, write_value};

/// The words that [`parse`](super::parse) reads as this request. Requests of several within requests of several become one row:
/// they are done together all the same.
///
/// A parameter with the name of a key of `add` (`period`, `on` …) cannot be said in words, nor in a system file.
pub fn words_of(request: &Request) -> Vec<String> {
    match request {
        Request::Add(plan) => add(plan),
        Request::Queue(plan) => queue(plan),
        Request::Remove(agent) => words(["remove", agent]),
        Request::Restart(agent) => words(["restart", agent]),
        Request::Replace { agent, kind, params } => {
            let mut out = words(["replace", agent, "is", kind]);
            push_params(&mut out, params);
            out
        }
        Request::Wire(plan) => wire(plan),
        Request::Unwire { from, to } => words(["unwire", from, to]),
        Request::Set { agent, key, value } => words(["set", agent, &format!("{key}={}", write_value(value))]),
        Request::Fault { target, fault } => words(["fault", target, fault.name()]),
        Request::Send { port, cdr } => words(["send", port, &digits(cdr)]),
        Request::Call { service, cdr, within } => {
            words(["call", service, &digits(cdr), &format!("within={within}")])
        }
        Request::Forced(request) => {
            let several: Vec<Vec<String>> = words_of(request).split(|word| word == AND).map(forced).collect();
            several.join(&AND.to_owned())
        }
        Request::Quit => words(["quit"]),
        Request::All(requests) => {
            let several: Vec<Vec<String>> = requests.iter().map(words_of).collect();
            several.join(&AND.to_owned())
        }
    }
}

fn forced(words: &[String]) -> Vec<String> {
    std::iter::once("force".to_owned()).chain(words.iter().cloned()).collect()
}

fn digits(cdr: &[u8]) -> String {
    let digits: String = cdr.iter().map(|byte| format!("{byte:02x}")).collect();
    format!("cdr={digits}")
}

fn words<const N: usize>(words: [&str; N]) -> Vec<String> {
    words.map(str::to_owned).into()
}

fn push(out: &mut Vec<String>, key: &str, value: Option<impl ToString>) {
    out.extend(value.map(|value| format!("{key}={}", value.to_string())));
}

fn push_params(out: &mut Vec<String>, params: &Table) {
    for row in params.rows() {
        push(out, &row.key, Some(write_value(&row.entry.value)));
    }
}

fn add(plan: &AgentPlan) -> Vec<String> {
    let mut out = words(["add", &plan.name, "is", &plan.kind]);
    push(&mut out, "robot", plan.robot.as_ref());
    push(&mut out, "executor", plan.executor.as_ref());
    push(&mut out, "period", plan.period);
    push(&mut out, "period_range", plan.period_range.map(|(least, most)| format!("{least}..{most}")));
    push(&mut out, "cost", plan.cost);
    push(&mut out, "deadline", plan.deadline);
    push(&mut out, "hang_after", plan.hang_after);
    push(&mut out, "min_gap", (plan.min_gap != Duration::ZERO).then_some(plan.min_gap));
    push(&mut out, "wake_gap", (plan.wake_gap != Duration::ZERO).then_some(plan.wake_gap));
    let methods = plan.methods.iter().map(|(name, cost)| format!("{name}:{cost}"));
    push(&mut out, "methods", (!plan.methods.is_empty()).then(|| methods.collect::<Vec<_>>().join(",")));
    push(&mut out, "method", plan.method.as_ref());
    push(&mut out, "refinement", plan.refinement);
    push(&mut out, "budget", plan.budget);
    let giving = &plan.giving;
    push(&mut out, "importance", giving.importance);
    push(&mut out, "elasticity", giving.elasticity);
    push(&mut out, "gap_max", giving.gap_max);
    for (key, is) in
        [("may_suspend", giving.may_suspend), ("rigid", giving.is_rigid), ("suspended", giving.is_suspended)]
    {
        push(&mut out, key, is.then_some(true));
    }
    push(&mut out, "on", (!plan.on.is_empty()).then(|| plan.on.join(",")));
    push(&mut out, "on_death", (plan.on_death == OnDeath::Leave).then_some("leave"));
    push_params(&mut out, &plan.params);
    out
}

fn queue(plan: &QueuePlan) -> Vec<String> {
    let mut out = words(["add", &plan.name, "is", QUEUE]);
    push(&mut out, "depth", plan.depth);
    push(&mut out, "overload", plan.overload.map(|policy| policy.name()));
    out
}

fn wire(plan: &WirePlan) -> Vec<String> {
    let mut out = words(["wire", &plan.from, &plan.to]);
    let filter = &plan.filter;
    let least = filter.least_priority.0;
    push(&mut out, "depth", plan.depth);
    push(&mut out, "overload", plan.overload.map(|policy| policy.name()));
    push(&mut out, "every", (filter.every != 0).then_some(filter.every));
    push(&mut out, "priority", (least != Priority::Low).then(|| least.name()));
    push(&mut out, "marker", filter.marker);
    push(&mut out, "category", filter.category.map(|category| category.name()));
    push(&mut out, "recipient", filter.recipient.as_ref());
    push(&mut out, "serving", plan.serving);
    out
}
