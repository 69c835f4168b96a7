//! What people ask of a run while it goes, as events of its log; and from a log back, so that the run can be repeated.
//!
//! ```text
//!   sinew set, fault, wire … ──▶ runtime::Control ──▶ "asked: …" in the log ─┐
//!   sinew stop, reset, Ctrl-C ──▶ judge's next look ──▶ "asked: …" in the log ├─▶ Repeat ──▶ [[at]] of the next run
//!   [[at]] stop, reset        ──▶ judge's next look                          ┘
//! ```
//!
//! In simulated time the emergency stop goes through the judge, which looks at fixed instants: so it is an event like any other.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use control::words;
use record::log::{Clock, Message, ROSOUT, Reader};
use runtime::{Incident, Plan, Refusal, Request, TimedRequest};
use types::{Duration, Time};

use super::knowing::{self, Firing};
use crate::error::Failure;

/// Who asks from outside, in the notes of a log.
pub(super) const OUTSIDE: &str = "control";
/// Who asks in `[[at]]`, in the notes of a log and among the incidents.
pub(super) const PLAN: &str = "plan";
/// Who asks again what was asked in a repeated log, among the incidents.
pub(super) const LOG: &str = "log";
/// What a note of a request begins with.
const ASKED: &str = "asked: ";
/// What stands between a request and why it was refused.
const REFUSED: &str = "; refused: ";

/// What is asked of the robots and the run, and not of agents.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Deed {
    /// The emergency stop, and what the person said.
    Stop(String),
    /// The end of the emergency stop.
    Reset,
    /// The end of the run, by a signal.
    Interrupt,
}

impl Deed {
    pub(super) fn read(words: &[String]) -> Option<Deed> {
        let (verb, rest) = words.split_first()?;
        match verb.as_str() {
            "stop" => Some(Deed::Stop(rest.join(" "))),
            "reset" => Some(Deed::Reset),
            "interrupt" => Some(Deed::Interrupt),
            _ => None,
        }
    }

    /// The note of it.
    pub(super) fn note(&self) -> String {
        match self {
            Deed::Stop(why) if why.is_empty() => format!("{ASKED}stop"),
            Deed::Stop(why) => format!("{ASKED}{}", words::join(&["stop", why])),
            Deed::Reset => format!("{ASKED}reset"),
            Deed::Interrupt => format!("{ASKED}interrupt"),
        }
    }
}

/// A deed whose time has come.
pub(super) struct Due {
    pub(super) deed: Deed,
    /// Who asked.
    pub(super) by: &'static str,
    /// Whose incident it is: who asked, or the schedule that did.
    pub(super) of: String,
    /// Waits until it is done.
    pub(super) done: Option<SyncSender<()>>,
}

/// Where a timed request of the runtime comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Origin {
    /// The plan itself.
    Plan,
    /// A schedule of the store, as incidents call it.
    Schedule(String),
    /// A repeated log; with the words.
    Log(Vec<String>),
}

/// What is asked of one run. Clones are the same.
#[derive(Clone, Debug, Default)]
pub(crate) struct Asked(Arc<Mutex<Inner>>);

#[derive(Debug, Default)]
struct Inner {
    over: bool,
    /// With whose incident it is.
    waiting: VecDeque<(Deed, String, SyncSender<()>)>,
    /// By time, counted from the start; who asks, and whose incident it is.
    timed: VecDeque<(Duration, &'static str, String, Deed)>,
    /// Requests on their way to the runtime: how it will write them down, and their words.
    under_way: Vec<(String, String)>,
    /// Where each timed request of the runtime comes from, in the order of time.
    origins: Vec<Origin>,
    /// How many of them were told.
    told: usize,
    /// When the repeated run was asked to quit.
    quits: Option<Time>,
    /// What was done of the robots' deeds.
    done: Vec<Incident>,
    /// For each fault, when it was asked and how far the robots had come (m).
    faults: Vec<(Time, f64)>,
    /// When a robot moved last.
    moved: Option<Time>,
}

/// Whether a fault was asked, and not refused.
pub(super) fn is_fault(incident: &Incident) -> bool {
    incident.what.starts_with("asked: fault ") && !incident.what.contains(REFUSED)
}

impl Asked {
    /// Takes out of a plan what the runtime does not do, and adds what schedules ask and what was asked in a log.
    pub(super) fn of(plan: &mut Plan, firings: Vec<Firing>, repeat: Option<&Repeat>) -> Asked {
        let mut inner = Inner::default();
        let mut requests = Vec::new();
        for request in std::mem::take(&mut plan.requests) {
            match Deed::read(&request.words) {
                Some(deed) => inner.timed.push_back((request.at, PLAN, PLAN.to_owned(), deed)),
                None => requests.push((Origin::Plan, request)),
            }
        }
        for Firing { at, schedule, words } in firings {
            match Deed::read(&words) {
                Some(deed) => inner.timed.push_back((at, PLAN, schedule, deed)),
                None => {
                    let request = TimedRequest { at, words, place: Default::default() };
                    requests.push((Origin::Schedule(schedule), request));
                }
            }
        }
        for (time, words) in repeat.map_or(&[][..], |repeat| &repeat.asked) {
            let at = time.since_start();
            match Deed::read(words) {
                Some(deed) => inner.timed.push_back((at, OUTSIDE, OUTSIDE.to_owned(), deed)),
                None => {
                    if words == &["quit"] {
                        inner.quits.get_or_insert(*time);
                    }
                    let words = words.clone();
                    let origin = Origin::Log(words.clone());
                    requests.push((origin, TimedRequest { at, words, place: Default::default() }));
                }
            }
        }
        // Stable, as the runtime's own order: what the plan and the schedules ask comes before what people ask at the same instant.
        inner.timed.make_contiguous().sort_by_key(|(at, ..)| *at);
        requests.sort_by_key(|(_, request)| request.at);
        (inner.origins, plan.requests) = requests.into_iter().unzip();
        Asked(Arc::new(Mutex::new(inner)))
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Has a deed done at the judge's next look, and waits for it.
    pub(super) fn act(&self, deed: Deed) -> Result<(), Refusal> {
        self.act_for(OUTSIDE, deed)
    }

    /// The same, with the name that incidents shall have for whoever asks.
    pub(super) fn act_for(&self, who: &str, deed: Deed) -> Result<(), Refusal> {
        let gone = || Refusal::new("the system has ended");
        let (done, is_done) = sync_channel(1);
        {
            let mut inner = self.inner();
            if inner.over {
                return Err(gone());
            }
            inner.waiting.push_back((deed, who.to_owned(), done));
        }
        is_done.recv().map_err(|_| gone())
    }

    /// What is to be done at a look so long after the start.
    pub(super) fn due(&self, since_start: Duration) -> Vec<Due> {
        let mut inner = self.inner();
        let mut due = Vec::new();
        while inner.timed.front().is_some_and(|(at, ..)| *at <= since_start) {
            due.extend(inner.timed.pop_front().map(|(_, by, of, deed)| Due { deed, by, of, done: None }));
        }
        let waiting = inner.waiting.drain(..);
        due.extend(waiting.map(|(deed, of, done)| Due { deed, by: OUTSIDE, of, done: Some(done) }));
        due
    }

    /// A deed was done.
    pub(super) fn done(&self, deed: Incident) {
        self.inner().done.push(deed);
    }

    /// The deeds that were done.
    pub(super) fn deeds(&self) -> Vec<Incident> {
        self.inner().done.clone()
    }

    /// The robots moved.
    pub(super) fn moved(&self, now: Time) {
        self.inner().moved = Some(now);
    }

    /// When they moved last.
    pub(super) fn last_moved(&self) -> Option<Time> {
        self.inner().moved
    }

    /// A fault was asked when the robots had come so far (m).
    pub(super) fn failed(&self, fault: &Incident, way: f64) {
        self.inner().faults.push((fault.time, way));
    }

    /// How far the robots had come when a fault was asked (m).
    pub(super) fn way_before(&self, fault: &Incident) -> Option<f64> {
        self.inner().faults.iter().find(|(time, _)| *time == fault.time).map(|(_, way)| *way)
    }

    /// Nobody looks any more: who waits is told so.
    pub(super) fn end(&self) {
        let mut inner = self.inner();
        inner.over = true;
        inner.waiting.clear();
    }

    /// A request from outside is on its way to the runtime.
    pub(super) fn asks(&self, request: &Request) {
        let words = words::join(&words::words_of(request));
        let mut inner = self.inner();
        // Of a request that the runtime never wrote down, because the run ended, nobody will ask.
        if inner.under_way.len() < MOST_UNDER_WAY {
            inner.under_way.push((format!("{request:?}"), words));
        }
    }

    /// What the log says of a request: in words, that it can be repeated; nothing where a note tells of no request from outside.
    pub(super) fn told(&self, who: &str, text: &str) -> Option<String> {
        let said = text.strip_prefix(ASKED)?;
        let mut inner = self.inner();
        if who == PLAN {
            let at = inner.told;
            inner.told += 1;
            let Some(Origin::Log(words)) = inner.origins.get(at) else { return None };
            // The runtime joins words with blanks. In the log that is repeated they stood as they can be read again.
            let outcome = said.strip_prefix(&words.join(" ")).unwrap_or_default();
            let text = format!("{ASKED}{}{outcome}", words::join(words));
            if said == "quit" {
                inner.quits = None;
            }
            return Some(text);
        }
        if who != OUTSIDE {
            return None;
        }
        let outcome = |shape: &str| {
            said.strip_prefix(shape).filter(|rest| rest.is_empty() || rest.starts_with(REFUSED))
        };
        let found = inner
            .under_way
            .iter()
            .position(|(shape, _)| outcome(shape).is_some())
            .map(|at| inner.under_way.remove(at));
        let Some((shape, words)) = found else { return Some(text.to_owned()) };
        Some(format!("{ASKED}{words}{}", outcome(&shape).unwrap_or_default()))
    }

    /// The end of a repeated run by a request, where the runtime did not tell of it.
    pub(super) fn untold_end(&self) -> Option<(Time, String)> {
        self.inner().quits.take().map(|time| (time, format!("{ASKED}quit")))
    }

    /// Whose the timed request of this number is, in the order of time, where it is not the plan's.
    pub(super) fn origin(&self, number: usize) -> Option<String> {
        match self.inner().origins.get(number)? {
            Origin::Plan => None,
            Origin::Schedule(name) => Some(name.clone()),
            Origin::Log(_) => Some(LOG.to_owned()),
        }
    }
}

/// Requests on their way at once, at most: each client of the control interface has one.
const MOST_UNDER_WAY: usize = 1024;

/// What was asked in a run, from its log.
#[derive(Clone, Debug)]
pub(super) struct Repeat {
    /// The log.
    pub(super) path: PathBuf,
    /// The run's system file.
    pub(super) plan: String,
    /// From what its chance was drawn.
    pub(super) seed: u64,
    /// What it read of its store, as its log tells it.
    pub(super) known: Option<String>,
    /// What was asked from outside, in order.
    pub(super) asked: Vec<(Time, Vec<String>)>,
}

impl Repeat {
    /// Reads what was asked in the simulated run of a system.
    pub(super) fn read(path: &Path, system: &str) -> Result<Repeat, Failure> {
        let unreadable = |error: record::log::ReadError| Failure::new(error.to_string());
        let mut reader = Reader::open(path).map_err(unreadable)?;
        let name = path.display();
        let run = reader.run().cloned().unwrap_or_default();
        if run.clock != Clock::Simulated || run.seed.is_none() {
            return Err(Failure::new(format!("{name} is no log of a simulated run"))
                .help("a run on the wall clock never happens twice; sinew log play shows it"));
        }
        if run.system != system {
            return Err(Failure::new(format!(
                "{name} is the log of \"{}\", not of \"{system}\"",
                run.system
            ))
            .help(format!("sinew run {} --repeat {name}", run.system)));
        }
        let mut asked = Vec::new();
        while let Some(message) = reader.next_message().map_err(unreadable)? {
            if message.channel.topic == ROSOUT
                && let Some(said) = said(&message)
            {
                let words = understood(&said).ok_or_else(|| {
                    Failure::new(format!(
                        "{name}: what was asked {} after the start cannot be repeated: {said}",
                        message.time.since_start()
                    ))
                    .help("is it the log of a run by an older program?")
                })?;
                asked.push((message.time, words));
            }
        }
        let (seed, known) = (run.seed.unwrap_or_default(), run.notes.get(knowing::NOTE).cloned());
        Ok(Repeat { path: path.to_owned(), plan: run.plan, seed, known, asked })
    }
}

/// What a note says was asked from outside.
fn said(note: &Message) -> Option<String> {
    let value = note.value().ok()?;
    let text = |key: &str| value.as_table()?.get(key)?.value.as_text();
    let said = text("msg")?.strip_prefix(ASKED)?;
    (text("name")? == OUTSIDE).then(|| said.to_owned())
}

/// The words of a request that was asked, without what came of it.
fn understood(said: &str) -> Option<Vec<String>> {
    // Why it was refused may hold anything, and so may a quoted word: the request is the first part that is whole.
    let ends = said.match_indices(REFUSED).map(|(at, _)| at).chain([said.len()]);
    let words = ends.filter_map(|at| words::split(&said[..at]).ok()).next()?;
    (Deed::read(&words).is_some() || words::parse(&words).is_ok()).then_some(words)
}

/// Where two logs first differ; nothing when they are the same byte for byte.
pub(super) fn difference(before: &Path, after: &Path) -> Option<String> {
    let bytes = |path: &Path| {
        std::fs::read(path).map_err(|error| format!("{} cannot be read: {error}", path.display()))
    };
    match (bytes(before), bytes(after)) {
        (Ok(before), Ok(after)) if before == after => return None,
        (Err(error), _) | (_, Err(error)) => return Some(error),
        _ => {}
    }
    let (Ok(mut one), Ok(mut other)) = (Reader::open(before), Reader::open(after)) else {
        return Some("one of the logs cannot be read".into());
    };
    if one.run() != other.run() {
        return Some("in what the logs say of the run: the plan, the seed or the robots".into());
    }
    loop {
        let (one, other) = (one.next_message().ok().flatten(), other.next_message().ok().flatten());
        let at = |message: &Message| format!("{} after the start", message.time.since_start());
        match (&one, &other) {
            (Some(one), Some(other)) => {
                let same = one.channel.topic == other.channel.topic
                    && (one.time, one.header, &one.cdr) == (other.time, other.header, &other.cdr);
                if !same {
                    return Some(format!("from {} on, with {}", at(other), other.channel.topic));
                }
            }
            (Some(longer), None) => return Some(format!("it ends earlier, before {}", at(longer))),
            (None, Some(longer)) => return Some(format!("it goes on, with {}", at(longer))),
            (None, None) => return Some("in bytes that hold no message".into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use runtime::FaultKind;

    fn timed(at: i64, words: &str) -> TimedRequest {
        TimedRequest {
            at: Duration::secs(at),
            words: words::split(words).unwrap(),
            place: Default::default(),
        }
    }

    fn log_of(asked: &[(i64, &str)]) -> Repeat {
        let asked =
            asked.iter().map(|(at, said)| (Time::ZERO + Duration::secs(*at), words::split(said).unwrap()));
        Repeat { path: PathBuf::new(), plan: String::new(), seed: 1, known: None, asked: asked.collect() }
    }

    #[test]
    fn what_a_log_holds_comes_behind_what_the_plan_asks_at_the_same_time() {
        let mut plan = Plan {
            requests: vec![timed(9, "fault a off"), timed(2, "stop"), timed(3, "fault b off")],
            ..Plan::default()
        };
        let firing = |at: i64, words: &str| {
            let TimedRequest { at, words, .. } = timed(at, words);
            Firing { at, schedule: "schedule bell".into(), words }
        };
        let firings = vec![firing(3, "fault d off"), firing(4, "stop"), firing(5, "reset")];
        let log = log_of(&[(3, "fault c off"), (4, "reset"), (9, "quit")]);
        let asked = Asked::of(&mut plan, firings, Some(&log));
        let order: Vec<&str> =
            plan.requests.iter().map(|request| request.words.get(1).map_or("quit", String::as_str)).collect();
        assert_eq!(order, ["b", "d", "c", "a", "quit"]);
        let origins = [0, 1, 2, 3, 4, 5].map(|n| asked.origin(n));
        let origins = origins.each_ref().map(Option::as_deref);
        assert_eq!(origins, [None, Some("schedule bell"), Some(LOG), None, Some(LOG), None]);
        let due = |at| {
            asked
                .due(Duration::secs(at))
                .into_iter()
                .map(|due| (due.by, due.of, due.deed))
                .collect::<Vec<_>>()
        };
        assert_eq!(due(1), []);
        let (bell, stop) = ("schedule bell".to_owned(), Deed::Stop(String::new()));
        assert_eq!(
            due(5),
            [
                (PLAN, PLAN.to_owned(), stop.clone()),
                (PLAN, bell.clone(), stop),
                (OUTSIDE, OUTSIDE.to_owned(), Deed::Reset),
                (PLAN, bell, Deed::Reset)
            ]
        );
        assert_eq!(due(6), []);
    }

    #[test]
    fn a_request_is_written_down_in_words_that_are_read_again() {
        let asked = Asked::default();
        let request = Request::All(vec![
            Request::Fault { target: "wall".into(), fault: FaultKind::Panic },
            Request::Set {
                agent: "wall".into(),
                key: "name".into(),
                value: types::value::Value::Text("a; refused: b".into()),
            },
        ]);
        asked.asks(&request);
        let told = asked.told(OUTSIDE, &format!("asked: {request:?}; refused: no; refused: twice")).unwrap();
        let words = understood(told.strip_prefix(ASKED).unwrap()).unwrap();
        assert_eq!(format!("{:?}", words::parse(&words).unwrap()), format!("{request:?}"));
        assert_eq!(asked.told(OUTSIDE, "the run begins"), None);
        assert_eq!(asked.told("wall", "asked: for more"), None, "an agent may say what it likes");
        for who in [OUTSIDE, PLAN] {
            // Whatever an agent is called: in a repeated run it asks again by itself.
            assert_eq!(asked.told(who, "asked the router: wire a.b c.d"), None);
        }
        assert_eq!(understood("Send { port: \"a.b\" }"), None);
    }

    #[test]
    fn words_with_blanks_are_written_down_in_a_repeated_run_as_they_were_before() {
        let said = "set wall 'side=far left'";
        let asked = Asked::of(&mut Plan::default(), Vec::new(), Some(&log_of(&[(3, said), (4, said)])));
        assert_eq!(asked.told(PLAN, "asked: set wall side=far left").unwrap(), format!("asked: {said}"));
        let refused = asked.told(PLAN, "asked: set wall side=far left; refused: no").unwrap();
        assert_eq!(refused, format!("asked: {said}; refused: no"));
    }

    #[test]
    fn a_call_from_outside_is_written_down_in_words_that_are_read_again() {
        let asked = Asked::default();
        let call =
            Request::Call { service: "a.half".into(), cdr: vec![0, 255], within: Duration::millis(1500) };
        asked.asks(&call);
        let told = asked.told(OUTSIDE, &format!("asked: {call:?}")).unwrap();
        assert_eq!(told, "asked: call a.half cdr=00ff within=1500ms");
        let words = understood(told.strip_prefix(ASKED).unwrap()).unwrap();
        assert_eq!(format!("{:?}", words::parse(&words).unwrap()), format!("{call:?}"));
    }

    #[test]
    fn who_waits_for_a_stop_is_told_when_the_run_is_over() {
        let asked = Asked::default();
        std::thread::scope(|scope| {
            let stopper = scope.spawn(|| asked.act(Deed::Stop("a person".into())));
            let due = loop {
                let mut due = asked.due(Duration::ZERO);
                if let Some(due) = due.pop() {
                    break due;
                }
                std::thread::yield_now();
            };
            assert_eq!(due.deed.note(), "asked: stop 'a person'");
            assert_eq!(Deed::read(&words::split("stop 'a person'").unwrap()), Some(due.deed));
            due.done.unwrap().send(()).unwrap();
            assert_eq!(stopper.join().unwrap(), Ok(()));
        });
        asked.end();
        assert!(asked.act(Deed::Reset).unwrap_err().what.contains("ended"));
    }
}
