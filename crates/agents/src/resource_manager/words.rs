//! Why something was set, in words.

use runtime::HostReading;
use schedule::Exact;
use schedule::manage::{Cause, Change};

/// So many agents are named; more are counted.
const NAMED: usize = 3;

pub(super) fn cause(change: &Change, names: &[String], host: &HostReading) -> String {
    let name = |at: &usize| names.get(*at).map_or("?", String::as_str);
    let mut said = match &change.cause {
        Cause::Late(late) => {
            let said = late.iter().map(|late| {
                let deadline = millis(late.deadline);
                match late.response {
                    Some(response) => {
                        format!("{} would take {} of {deadline}", name(&late.agent), millis(response))
                    }
                    None => format!("{} might never be done within {deadline}", name(&late.agent)),
                }
            });
            listed(said.collect())
        }
        Cause::Missed(missed) => {
            listed(missed.iter().map(|at| format!("{} missed its deadline", name(at))).collect())
        }
        Cause::Fallen => "the load has fallen".to_owned(),
        Cause::Ordered(ordered) => {
            listed(ordered.iter().map(|at| format!("{} was ordered otherwise", name(at))).collect())
        }
    };
    if matches!(change.cause, Cause::Late(_)) {
        for burden in host.burdens.iter().filter(|burden| burden.share > 0.05) {
            said += &format!("; {} takes {:.0} % of a processor", burden.name, burden.share * 100.0);
        }
    }
    if !change.missing.is_empty() {
        let beyond: Vec<String> = change.missing.iter().map(|at| name(at).to_owned()).collect();
        said += &format!("; beyond help: {}", listed(beyond));
    }
    said
}

fn listed(mut all: Vec<String>) -> String {
    let more = all.len().saturating_sub(NAMED);
    all.truncate(NAMED);
    let all = all.join(", ");
    if more > 0 { format!("{all} and {more} more") } else { all }
}

fn millis(time: Exact) -> String {
    format!("{:.3} ms", *time.numer() as f64 / *time.denom() as f64 * 1e-6)
}
