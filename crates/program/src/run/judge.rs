//! The judge: looks at the truth from outside, keeps what the figures need of it, and says when a run is over.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use hardware::Latch;
use hardware::gate::Counts;
use hardware::latch::Cause;
use hardware::simulated::Truth;
use runtime::{Incident, Observer, Verdict};
use sim::hand::Standing;
use types::messages::{Odometry, Twist};
use types::{Duration, Name, Pose, Time};

use super::asked::{self, Asked, Deed, OUTSIDE};
use super::prepare::Ready;
use crate::{figures, terminal};

/// How often the judge looks. Goals and collisions are watched by the world itself in every step of physics, so this only
/// says how late a run ends.
const LOOK: Duration = Duration::millis(20);
/// Every so many looks the truth is kept: ten times a second, which at walking speed is every few centimetres.
const KEEP_EVERY: u64 = 5;
/// What is slower than this stands (m/s, rad/s).
const STANDS: (f64, f64) = (0.01, 0.01);
/// The frame of the simulated world in the log.
pub(crate) const WORLD: &str = "world";

/// What the judge has for the log.
#[derive(Clone, Debug)]
pub(crate) struct Fact {
    /// When, on the clock of the run.
    pub(crate) time: Time,
    /// What.
    pub(crate) what: What,
}

/// What a fact is of.
#[derive(Clone, Debug)]
pub(crate) enum What {
    /// Something truly was there.
    Place(Odometry),
    /// Somebody asked for something.
    Asked {
        /// Who.
        by: &'static str,
        /// For what, as a note has it.
        text: String,
    },
}

/// The truth on its way from the judge to the log.
#[derive(Clone, Debug, Default)]
pub(crate) struct Facts(Arc<Mutex<VecDeque<Fact>>>);

impl Facts {
    fn put(&self, fact: Fact) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push_back(fact);
    }

    /// The oldest fact, if it was true before `time`.
    pub(crate) fn before(&self, time: Time) -> Option<Fact> {
        let mut facts = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if facts.front().is_some_and(|fact| fact.time < time) { facts.pop_front() } else { None }
    }
}

/// Looks at a run and may end it.
pub(crate) struct Judge {
    truth: Option<Truth>,
    recordings: Vec<Arc<Counts>>,
    /// Set by a signal.
    asked_to_end: Arc<AtomicBool>,
    asked: Asked,
    latches: Vec<Latch>,
    /// How many times as fast as the host's clock the run may go at most, and when it began on both clocks.
    speed: Option<f64>,
    begun: Option<(Time, std::time::Instant)>,
    /// Where the truth goes; nobody wants it when nothing is logged.
    facts: Option<Facts>,
    people: Vec<String>,
    /// What was added to the world and is known to the log.
    added: Vec<Standing>,
    looks: u64,
    /// How many incidents it has seen.
    seen: usize,
    /// When a robot moved last, and how long it waits for the next time.
    moved: Option<Time>,
    patience: Option<Duration>,
}

/// Why runs end, in the words of the summary.
pub(crate) const DECIDED: &str = "the goal is decided";
/// See [`DECIDED`].
pub(crate) const INTERRUPTED: &str = "interrupted";
/// See [`DECIDED`].
pub(crate) const PLAYED: &str = "the recording is over";
/// See [`DECIDED`].
pub(crate) const GAVE_UP: &str = "the robot has given up: it has not moved for long";

impl Judge {
    pub(crate) fn new(
        ready: &Ready,
        asked_to_end: Arc<AtomicBool>,
        asked: Asked,
        facts: Option<Facts>,
    ) -> Judge {
        let recorded =
            ready.robots.iter().filter(|robot| robot.description.clock == hardware::ClockKind::Recorded);
        let people = ready.truth.iter().flat_map(|truth| truth.plan().people.iter());
        Judge {
            people: people.map(|person| person.name.clone()).collect(),
            truth: ready.truth.clone(),
            recordings: recorded.map(|robot| robot.counts.clone()).collect(),
            asked_to_end,
            asked,
            latches: ready.robots.iter().map(|robot| robot.latch.clone()).collect(),
            speed: None,
            begun: None,
            facts,
            added: Vec::new(),
            looks: 0,
            seen: 0,
            moved: None,
            patience: None,
        }
    }

    /// Lets the run go at most so many times as fast as the host's clock. It waits here and not in the runtime, which would
    /// answer requests while it waits: in the middle of an instant, where no repeated run could ask them again.
    pub(crate) fn paced(mut self, speed: Option<f64>) -> Judge {
        self.speed = speed;
        self
    }

    /// Ends the run when no robot has moved for so long.
    pub(crate) fn patient(mut self, patience: Option<Duration>) -> Judge {
        self.patience = patience;
        self
    }

    fn wait(&self, since_start: Duration) {
        let (Some(speed), Some((_, host))) = (self.speed, self.begun) else { return };
        let due = std::time::Duration::try_from_secs_f64(since_start.seconds() / speed);
        let due = due.unwrap_or(std::time::Duration::MAX);
        terminal::pause(due.saturating_sub(host.elapsed()));
    }

    /// Does what is asked of the robots. Says whether the run shall end by it.
    fn act(&self, now: Time, since_start: Duration) -> bool {
        let mut ends = false;
        for due in self.asked.due(since_start) {
            match &due.deed {
                Deed::Stop(_) => self.latches.iter().for_each(|latch| latch.set(Cause::Person, now)),
                Deed::Reset => self.latches.iter().for_each(|latch| {
                    latch.reset(now);
                }),
                Deed::Interrupt => ends = true,
            }
            self.note(now, due.by, &due.deed);
            self.asked.done(Incident { time: now, agent: due.of, what: due.deed.note() });
            if let Some(done) = due.done {
                // Whoever asked may be gone.
                let _ = done.try_send(());
            }
        }
        ends
    }

    fn note(&self, time: Time, by: &'static str, deed: &Deed) {
        if let Some(facts) = &self.facts {
            facts.put(Fact { time, what: What::Asked { by, text: deed.note() } });
        }
    }

    /// Keeps how far the robots had come when a fault began, and when they moved last.
    fn follow(&mut self, now: Time, incidents: &[Incident]) {
        let Some(truth) = &self.truth else { return };
        let (mut way, mut moves) = (0.0, false);
        for (_, robot) in truth.robots() {
            way += robot.truth.distance;
            moves |= robot.truth.linear.abs() > STANDS.0 || robot.truth.angular.abs() > STANDS.1;
        }
        if moves {
            self.moved = Some(now);
            self.asked.moved(now);
        }
        let new = incidents.get(self.seen..).unwrap_or_default();
        for incident in new.iter().filter(|incident| asked::is_fault(incident)) {
            self.asked.failed(incident, way);
        }
        self.seen = incidents.len();
    }

    fn keep(&mut self, time: Time) {
        let (Some(truth), Some(facts)) = (&self.truth, &self.facts) else { return };
        for (name, robot) in truth.robots() {
            let twist = Twist::new(robot.truth.linear, robot.truth.angular);
            facts.put(fact(time, &name, robot.truth.pose, twist));
        }
        // What was added to the running world, and what was moved in it, is noted: figures draw it.
        let added = truth.added();
        for thing in added.iter().filter(|thing| !self.added.contains(thing)) {
            facts.put(Fact { time, what: What::Asked { by: WORLD, text: figures::stands(thing) } });
        }
        self.added = added;
        for name in &self.people {
            if let Some(person) = truth.person(name).filter(|person| person.present) {
                let pose = Pose::new(person.at.x, person.at.y, person.facing);
                facts.put(fact(time, name, pose, Twist::ZERO));
            }
        }
    }
}

fn fact(time: Time, name: &str, pose: Pose, twist: Twist) -> Fact {
    let odometry = Odometry { frame: Name::new(WORLD), body: Name::new(name), pose, twist };
    Fact { time, what: What::Place(odometry) }
}

impl Drop for Judge {
    fn drop(&mut self) {
        self.asked.end();
    }
}

impl Observer for Judge {
    fn every(&self) -> Duration {
        LOOK
    }

    fn observe(&mut self, now: Time, incidents: &[Incident]) -> Verdict {
        let (begun, _) = *self.begun.get_or_insert_with(|| (now, terminal::host_now()));
        let since_start = Duration(now.0 - begun.0);
        self.wait(since_start);
        self.follow(now, incidents);
        if self.looks.is_multiple_of(KEEP_EVERY) {
            self.keep(now);
        }
        self.looks += 1;
        let ended = |why: &str| Verdict::End(why.to_owned());
        if self.act(now, since_start) {
            return ended(INTERRUPTED);
        }
        if self.asked_to_end.load(Ordering::Relaxed) {
            self.note(now, OUTSIDE, &Deed::Interrupt);
            return ended(INTERRUPTED);
        }
        if self.truth.as_ref().is_some_and(Truth::decided) {
            return ended(DECIDED);
        }
        let idle = now - self.moved.unwrap_or(begun);
        if self.truth.is_some() && self.patience.is_some_and(|patience| idle >= patience) {
            return ended(GAVE_UP);
        }
        if !self.recordings.is_empty() && self.recordings.iter().all(|counts| counts.ended()) {
            return ended(PLAYED);
        }
        Verdict::GoOn
    }
}
