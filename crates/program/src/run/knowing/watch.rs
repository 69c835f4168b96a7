//! Looking at the store while a run goes.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration as HostDuration;

use control::words;
use knowledge::{Knowledge, KnowledgeError, Schedule, Version, due};
use runtime::{Control, Incident, Refusal, Request};
use types::value::Value;
use types::{Duration, Time};

use super::firing::{self, Asks, called};
use super::known::Taken;
use super::{Knowing, take};
use crate::cli::ClockChoice;
use crate::file::knowledge::{TABLE, decider, table_of, with_table};
use crate::run::asked::Asked;
use crate::run::prepare::Scenario;
use crate::run::summary::seconds;
use crate::terminal;

/// How often the store is looked at. Whoever puts something sees it at work at once, and a schedule is no more than this late.
const EVERY: HostDuration = HostDuration::from_millis(100);
/// How long the end waits for the thread; one that still waits for a system that never answers is left alone.
const FAREWELL: HostDuration = HostDuration::from_millis(500);

/// A thread that looks at the store, while it lasts.
pub(crate) struct Looking {
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    /// Closed when the thread ends.
    gone: Receiver<()>,
}

impl Drop for Looking {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Release);
        let Some(thread) = self.thread.take() else { return };
        thread.thread().unpark();
        if self.gone.recv_timeout(FAREWELL) != Err(RecvTimeoutError::Timeout) {
            // One that panicked has said so.
            let _ = thread.join();
        }
    }
}

/// Begins to look.
pub(super) fn start(
    knowing: &Knowing,
    control: &Control,
    asked: &Asked,
    clock: ClockChoice,
) -> Result<Looking, String> {
    let mut watch = Watch::of(knowing, control, asked, clock).map_err(|error| error.to_string())?;
    let over = Arc::new(AtomicBool::new(false));
    let (here, gone) = sync_channel::<()>(0);
    let ends = over.clone();
    let begun = terminal::host_now();
    let work = move || {
        let _here = here;
        while !ends.load(Ordering::Acquire) {
            let since_start = i64::try_from(begun.elapsed().as_nanos()).unwrap_or(i64::MAX);
            if watch.look(Duration(since_start)).is_err() {
                return;
            }
            std::thread::park_timeout(EVERY);
        }
    };
    let thread = std::thread::Builder::new().name("sinew-knowledge".into()).spawn(work);
    let thread = thread.map_err(|error| format!("no thread could be started for the store: {error}"))?;
    Ok(Looking { over, thread: Some(thread), gone })
}

/// What was read of a store in which somebody has written.
struct News {
    newest: Option<Version>,
    schedules: Vec<Schedule>,
}

/// The system has ended: there is nobody to be asked.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Ended;

/// Compares the store with what is at work, and asks the system for what is new.
pub(super) struct Watch {
    knowing: Knowing,
    store: Knowledge,
    control: Control,
    asked: Asked,
    clock: ClockChoice,
    /// What the calendar showed at the start, counted from 1970.
    epoch: Duration,
    /// The number of writes of the store when it was read last.
    seen: Option<i64>,
    /// The table at work, and one that was refused.
    table: Option<Taken>,
    refused: Option<Taken>,
    schedules: Vec<Schedule>,
    /// Up to when schedules have fired, counted from the start.
    until: Duration,
    said: BTreeSet<String>,
}

impl Watch {
    pub(super) fn of(
        knowing: &Knowing,
        control: &Control,
        asked: &Asked,
        clock: ClockChoice,
    ) -> Result<Watch, KnowledgeError> {
        Ok(Watch {
            store: Knowledge::open_read_only(&knowing.store)?,
            control: control.clone(),
            asked: asked.clone(),
            clock,
            epoch: terminal::host_date().since_start(),
            seen: None,
            table: knowing.known.table.clone(),
            refused: None,
            schedules: knowing.schedules.clone(),
            until: Duration::ZERO,
            said: BTreeSet::new(),
            knowing: knowing.clone(),
        })
    }

    /// Looks once, so long after the start on the host's clock.
    pub(super) fn look(&mut self, since_start: Duration) -> Result<(), Ended> {
        match self.news() {
            Ok(None) => {}
            Ok(Some(News { newest, schedules })) => {
                self.learn_table(newest)?;
                self.learn_schedules(schedules);
            }
            Err(error) => self.say_once(format!("warning: {error}; what was read before stays")),
        }
        if self.clock == ClockChoice::Wall { self.fire(since_start) } else { Ok(()) }
    }

    /// What the store holds, if anybody has written since.
    fn news(&mut self) -> Result<Option<News>, KnowledgeError> {
        let writes = self.store.writes()?;
        if self.seen == Some(writes) {
            return Ok(None);
        }
        let now = self.store.read()?;
        let newest = match &self.knowing.section.decide {
            Some((name, _)) => now.newest(name)?,
            None => None,
        };
        let schedules = now.schedules()?;
        // What was written between the two is read once more.
        self.seen = Some(writes);
        Ok(Some(News { newest, schedules }))
    }

    fn learn_table(&mut self, newest: Option<Version>) -> Result<(), Ended> {
        let Some((name, _)) = self.knowing.section.decide.clone() else { return Ok(()) };
        let plan = &self.knowing.system.file.plan;
        let Some(maker) = decider(plan).map(|maker| maker.name.clone()) else { return Ok(()) };
        let before = self.table.as_ref().map_or(0, |taken| taken.version);
        let Some(Version { number: version, weights: table, .. }) = newest else {
            self.say_once(format!("{maker}: there is no table \"{name}\" any more; version {before} stays"));
            return Ok(());
        };
        let taken = Taken { version, table };
        if self.refused.as_ref() == Some(&taken) {
            return Ok(());
        }
        if self.table.as_ref().is_some_and(|at_work| at_work.table == taken.table) {
            self.table = Some(taken);
            return Ok(());
        }
        let done = self.ask_for(&maker, &name, &taken)?;
        let time = self.now()?;
        let what = match done {
            Ok(()) => {
                let since = seconds(self.since(time));
                (self.knowing.tell)(&format!("{maker}: table \"{name}\" version {version} since {since}"));
                (self.table, self.refused) = (Some(taken), None);
                format!("took table \"{name}\" version {version}")
            }
            Err(why) => {
                let why = format!("version {version} is refused ({why})");
                (self.knowing.tell)(&format!("{maker}: table \"{name}\" version {before} stays, for {why}"));
                self.refused = Some(taken);
                format!("kept table \"{name}\" version {before}, for {why}")
            }
        };
        self.asked.done(Incident { time, agent: maker, what });
        Ok(())
    }

    /// Asks the system for another table of its decision maker.
    fn ask_for(&self, maker: &str, name: &str, taken: &Taken) -> Result<Result<(), Refusal>, Ended> {
        let Scenario { file, registry } = &self.knowing.system;
        let mut file = file.clone();
        // Agents that came since the start may stand in it too.
        let (running, ..) = self.control.plan().map_err(|_| Ended)?;
        let new: Vec<_> =
            running.into_iter().filter(|agent| file.plan.agent(&agent.name).is_none()).collect();
        file.plan.agents.extend(new);
        let shown = take::shown(name, taken.version, &self.knowing.store);
        let judged = match with_table(&file, registry, &shown, &taken.table) {
            Ok(judged) => judged,
            Err(mistakes) => {
                let first = mistakes.list.first().map(ToString::to_string).unwrap_or_default();
                let more = match mistakes.list.len() {
                    0 | 1 => String::new(),
                    several => format!("; and {} more", several - 1),
                };
                return Ok(Err(Refusal::new(first + &more)));
            }
        };
        let Some(table) = decider(&judged.plan).and_then(table_of) else { return Ok(Ok(())) };
        let (agent, key, value) = (maker.to_owned(), TABLE.to_owned(), Value::Table(table.clone()));
        self.request(Request::Set { agent, key, value })
    }

    fn request(&self, request: Request) -> Result<Result<(), Refusal>, Ended> {
        self.asked.asks(&request);
        let quits = matches!(request, Request::Quit);
        match self.control.request(request) {
            Err(_) if !quits && self.control.view().is_err() => Err(Ended),
            done => Ok(done),
        }
    }

    fn learn_schedules(&mut self, schedules: Vec<Schedule>) {
        if self.clock == ClockChoice::Sim {
            if schedules != self.knowing.known.schedules {
                self.say_once(
                    "the schedules have changed; in simulated time that counts from the next run on".into(),
                );
            }
            return;
        }
        let (right, left_out) = firing::judged(&schedules);
        left_out.into_iter().for_each(|text| self.say_once(format!("warning: {text}")));
        self.schedules = right;
    }

    /// Asks for what has become due.
    fn fire(&mut self, since_start: Duration) -> Result<(), Ended> {
        let time = |since: Duration| Time::ZERO.saturating_add(since);
        for (_, name) in due(&self.schedules, self.epoch, time(self.until), time(since_start)) {
            let Some(schedule) = self.schedules.iter().find(|schedule| schedule.name == name) else {
                continue;
            };
            let words = schedule.words.clone();
            let Ok(asks) = firing::asks(&words) else { continue };
            self.fire_one(called(&name), &words, asks)?;
        }
        self.until = since_start;
        Ok(())
    }

    fn fire_one(&self, agent: String, words: &[String], asks: Asks) -> Result<(), Ended> {
        let request = match asks {
            // The judge does it, and tells.
            Asks::Deed(deed) => return self.asked.act_for(&agent, deed).map_err(|_| Ended),
            Asks::Request(request) => *request,
        };
        // What is asked for in the way of faults, the runtime tells by itself.
        let verb = if has_fault(&request) { "fired" } else { "asked" };
        let outcome = self.request(request)?.err().map_or(String::new(), |why| format!("; refused: {why}"));
        let (time, words) = (self.now()?, words::join(words));
        self.asked.done(Incident { time, agent, what: format!("{verb}: {words}{outcome}") });
        Ok(())
    }

    fn now(&self) -> Result<Time, Ended> {
        self.control.view().map(|view| view.now).map_err(|_| Ended)
    }

    /// How long a run has gone on at a time of its clock (s).
    fn since(&self, time: Time) -> f64 {
        let begun = if self.clock == ClockChoice::Wall { self.epoch } else { Duration::ZERO };
        (time.since_start() - begun).seconds()
    }

    fn say_once(&mut self, text: String) {
        if self.said.insert(text.clone()) {
            (self.knowing.tell)(&text);
        }
    }
}

fn has_fault(request: &Request) -> bool {
    match request {
        Request::Fault { .. } => true,
        Request::All(requests) => requests.iter().any(has_fault),
        Request::Forced(request) => has_fault(request),
        _ => false,
    }
}
