//! Schedules as what they ask, and when.

use knowledge::{Schedule, due};
use runtime::{Refusal, Request};
use types::{Duration, Time};

use crate::run::asked::Deed;

/// Something that a schedule asks at a time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Firing {
    /// When, counted from the start.
    pub(crate) at: Duration,
    /// The schedule, as incidents call it.
    pub(crate) schedule: String,
    /// What it asks.
    pub(crate) words: Vec<String>,
}

/// What the words of a schedule ask.
#[derive(Debug)]
pub(super) enum Asks {
    /// Something of the robots.
    Deed(Deed),
    /// Something of the system.
    Request(Box<Request>),
}

/// What incidents call a schedule.
pub(super) fn called(name: &str) -> String {
    format!("schedule \"{name}\"")
}

/// Whether an incident is of a schedule.
pub(crate) fn is_schedule(who: &str) -> bool {
    who.starts_with("schedule \"")
}

/// What words ask.
pub(super) fn asks(words: &[String]) -> Result<Asks, Refusal> {
    // The two that no request to the router is.
    let deed = words.first().filter(|verb| ["stop", "reset"].contains(&verb.as_str()));
    match deed.and_then(|_| Deed::read(words)) {
        Some(deed) => Ok(Asks::Deed(deed)),
        None => control::words::parse(words).map(|request| Asks::Request(Box::new(request))),
    }
}

/// The schedules whose words are right, and what is to be told of the others.
pub(super) fn judged(schedules: &[Schedule]) -> (Vec<Schedule>, Vec<String>) {
    let (mut right, mut told) = (Vec::new(), Vec::new());
    for schedule in schedules {
        match asks(&schedule.words) {
            Ok(_) => right.push(schedule.clone()),
            Err(refusal) => told.push(format!("{} does not fire: {refusal}", called(&schedule.name))),
        }
    }
    (right, told)
}

/// How far ahead it is looked when nobody knows how long the run will be: longer than a battery.
const AHEAD: Duration = Duration::secs(24 * 3600);
/// More requests than this in a run: a schedule is no agent.
const MOST: usize = 100_000;

/// All that schedules ask in a run of this length, in its order; and until when, where there would be more than can be.
pub(super) fn firings(
    schedules: &[Schedule],
    begins: Duration,
    limit: Option<Duration>,
) -> (Vec<Firing>, Option<Duration>) {
    let end = Time::ZERO.saturating_add(limit.unwrap_or(AHEAD));
    let mut firings = Vec::new();
    let mut from = Time::ZERO;
    // A day at a time, so that a long run takes no more memory than it may.
    while from < end && !schedules.is_empty() {
        let to = from.saturating_add(AHEAD).min(end);
        for (time, name) in due(schedules, begins, from, to) {
            let at = time.since_start();
            if firings.len() == MOST {
                return (firings, Some(at));
            }
            let words = schedules.iter().find(|schedule| schedule.name == name);
            let words = words.map(|schedule| schedule.words.clone()).unwrap_or_default();
            firings.push(Firing { at, schedule: called(&name), words });
        }
        from = to;
    }
    (firings, None)
}
