//! What a run comes to, for people and for programs.
//!
//! | to find | look in |
//! |---|---|
//! | what is known of a run | [`Summary`] |
//! | what programs read of it | [`document`] |
//! | what people read | [`text`] |
//! | numbers and tables, as people read them | [`words`] |

mod document;
mod text;
mod words;

use std::path::PathBuf;

use runtime::{AgentView, CannotRun, Incident, Noted, Report, SystemView};
use types::{Duration, Time};

use super::asked::{self, Asked};
use super::compare::Compared;
use super::judge;
use super::prepare::Ready;
use super::recorder::LogOutcome;
use super::useful::Done;
use crate::figures::TaskOutcome;

pub(crate) use document::figure_json;
pub(crate) use words::{seconds, span, table};

/// What became of a robot.
#[derive(Clone, Debug)]
pub(crate) struct RobotOutcome {
    pub(crate) name: String,
    /// What the judge knows; nothing for a robot that is not simulated.
    pub(crate) truth: Option<sim::Truth>,
    /// When it met the stages of its goal that are behind it.
    pub(crate) passed: Vec<Time>,
    pub(crate) commands: u64,
    pub(crate) stale: u64,
    pub(crate) clamped: u64,
    pub(crate) slowed: u64,
    /// Since when and why its latch is set; nothing where it is not.
    pub(crate) latch: Option<(Time, Vec<&'static str>)>,
    /// Whether its commands went nowhere, because it is a recording.
    pub(crate) shadow: bool,
    pub(crate) report: Option<hardware::Report>,
}

/// What became of a repeated run.
#[derive(Clone, Debug)]
pub(crate) struct Repeated {
    /// The log of the run before.
    pub(crate) log: PathBuf,
    /// How often something was asked in it.
    pub(crate) requests: usize,
    /// Where this run differs; nothing when the bytes are the same.
    pub(crate) differs: Option<String>,
}

/// What a run comes to.
#[derive(Clone, Debug)]
pub(crate) struct Summary {
    pub(crate) system: String,
    pub(crate) seed: u64,
    /// `sim` or `wall`.
    pub(crate) clock: &'static str,
    pub(crate) time: Duration,
    pub(crate) wall: f64,
    /// Whether the goal was met, nothing for a plan without one; and why.
    pub(crate) met: Option<bool>,
    pub(crate) why: String,
    pub(crate) ended: String,
    pub(crate) robots: Vec<RobotOutcome>,
    pub(crate) agents: Vec<AgentView>,
    pub(crate) sent: u64,
    /// Messages that newer ones displaced before who would have passed over them.
    pub(crate) replaced: u64,
    /// Messages that were lost.
    pub(crate) dropped: u64,
    pub(crate) refused: u64,
    pub(crate) log_dropped: u64,
    /// Who took or freed memory in real time, and how often; nothing where nobody watched.
    pub(crate) allocations: Option<Vec<(String, u64)>>,
    pub(crate) incidents: Vec<Incident>,
    /// What became of the faults that were asked: when, and in words.
    pub(crate) effects: Vec<(Time, String)>,
    /// What the agents noted.
    pub(crate) noted: Vec<Noted>,
    /// When the run began on its own clock.
    pub(crate) begun: Time,
    pub(crate) log: Option<LogOutcome>,
    /// Pictures a second that were to be kept.
    pub(crate) images: f64,
    pub(crate) files: Vec<PathBuf>,
    /// What became of the tasks of the reactive layer, where there is a log.
    pub(crate) tasks: Vec<TaskOutcome>,
    pub(crate) repeat: Option<Repeated>,
    /// What the agents did whose plan says how important they are.
    pub(crate) done: Vec<Done>,
    /// The runs that this one is compared with.
    pub(crate) compared: Compared,
}

impl Summary {
    pub(crate) fn new(ready: &Ready, seed: u64, clock: &'static str, report: Report) -> Summary {
        let truth = ready.truth.as_ref();
        let robots: Vec<RobotOutcome> = ready
            .robots
            .iter()
            .map(|robot| RobotOutcome {
                name: robot.name.clone(),
                truth: truth.and_then(|truth| truth.robot(&robot.name)).map(|moment| moment.truth),
                passed: truth.map_or_else(Vec::new, |truth| truth.passed(&robot.name)),
                commands: robot.counts.commands.get(),
                stale: robot.counts.stale.get(),
                clamped: robot.counts.clamped.get(),
                slowed: robot.counts.slowed.get(),
                latch: robot.latch.is_set().then(|| {
                    let causes = robot.latch.state().causes().map(hardware::latch::Cause::name);
                    (robot.latch.set_at(), causes.collect())
                }),
                shadow: robot.description.clock == hardware::ClockKind::Recorded,
                report: robot.report.clone(),
            })
            .collect();
        let met = ready.goal.as_ref().and(truth).map(hardware::simulated::Truth::met);
        let why = match truth.filter(|_| met.is_some()) {
            Some(truth) => {
                let each = robots.iter().filter_map(|robot| {
                    let why = truth.why(&robot.name)?;
                    Some(if robots.len() > 1 { format!("{}: {why}", robot.name) } else { why })
                });
                each.collect::<Vec<_>>().join("; ")
            }
            None => report.ended.clone(),
        };
        let wires = &report.view.wires;
        Summary {
            system: report.view.name.clone(),
            seed,
            clock,
            time: report.time,
            wall: report.wall,
            met,
            why,
            ended: report.ended,
            robots,
            sent: wires.iter().map(|wire| wire.sent).sum(),
            replaced: wires.iter().map(|wire| wire.replaced).sum(),
            dropped: wires.iter().map(|wire| wire.dropped + wire.expired).sum(),
            refused: wires.iter().map(|wire| wire.refused).sum(),
            log_dropped: report.log_dropped,
            allocations: allocations(&report.view),
            incidents: report.incidents,
            effects: Vec::new(),
            noted: report.noted,
            begun: Time(report.view.now.0 - report.time.0),
            agents: report.view.agents,
            log: None,
            images: 0.0,
            files: Vec::new(),
            tasks: Vec::new(),
            repeat: None,
            done: Vec::new(),
            compared: Compared::default(),
        }
    }

    /// Says of the requests of a repeated log, and of those of schedules, that the plan did not ask for them.
    pub(crate) fn repeats(&mut self, asked: &Asked) {
        let timed = self.incidents.iter_mut().filter(|incident| incident.agent == asked::PLAN);
        for (number, incident) in timed.enumerate() {
            if let Some(whose) = asked.origin(number) {
                incident.agent = whose;
            }
        }
    }

    /// Takes in what was done to the robots, and tells what became of each fault.
    pub(crate) fn tells(&mut self, asked: &Asked) {
        self.incidents.extend(asked.deeds());
        self.incidents.sort_by_key(|incident| incident.time);
        let faults = self.incidents.iter().filter(|incident| asked::is_fault(incident));
        let effect = |fault: &Incident| {
            let way = self.distance()? - asked.way_before(fault)?;
            Some((fault.time, self.effect(fault.time, way, asked.last_moved())))
        };
        self.effects = faults.filter_map(effect).collect();
    }

    /// What became of a robot after a fault, since which it went so far (m).
    fn effect(&self, fault: Time, way: f64, moved: Option<Time>) -> String {
        let at = |time: Time| seconds((time - self.begun).seconds());
        let latch = self.robots.iter().filter_map(|robot| robot.latch.as_ref());
        let end = Time(self.begun.0 + self.time.0);
        let stands_since = moved.map_or(self.begun, |moved| moved.max(fault));
        let went = format!("it went on for {way:.1} m");
        if let Some((time, causes)) = latch.min_by_key(|(time, _)| *time).filter(|(time, _)| *time >= fault) {
            format!("{went}, until the latch was set at {} ({})", at(*time), causes.join(", "))
        } else if self.met == Some(true) {
            format!("{went} and met its goal")
        } else if end - stands_since > STANDS {
            format!("{went} and has stood since {}", at(stands_since))
        } else {
            went
        }
    }

    /// Whether the run did what it was to do: met its goal, or without one ran to its end; a repeated one gave the same bytes.
    pub(crate) fn is_success(&self) -> bool {
        let same = self.repeat.as_ref().is_none_or(|repeat| repeat.differs.is_none());
        self.met.unwrap_or(self.ended != judge::INTERRUPTED) && same
    }

    fn truths(&self) -> impl Iterator<Item = &sim::Truth> {
        self.robots.iter().filter_map(|robot| robot.truth.as_ref())
    }

    /// Collisions of all robots; nothing where nobody knows.
    pub(crate) fn collisions(&self) -> Option<u32> {
        self.truths().map(|truth| truth.collisions).reduce(|a, b| a + b)
    }

    /// How often others ran into any robot; nothing where nobody knows.
    pub(crate) fn bumped(&self) -> Option<u32> {
        self.truths().map(|truth| truth.bumped).reduce(|a, b| a + b)
    }

    /// The smallest distance of any robot to anything (m).
    pub(crate) fn closest(&self) -> Option<f64> {
        self.truths().map(|truth| truth.closest).reduce(f64::min)
    }

    /// How far all robots went together (m).
    pub(crate) fn distance(&self) -> Option<f64> {
        self.truths().map(|truth| truth.distance).reduce(|a, b| a + b)
    }

    fn count(&self, of: impl Fn(&AgentView) -> u64) -> u64 {
        self.agents.iter().map(of).sum()
    }

    /// When the stages that the first robot with a goal has behind it were met (s of the run).
    fn stages(&self) -> Vec<f64> {
        let robot = self.robots.iter().find(|robot| !robot.passed.is_empty());
        robot.map_or_else(Vec::new, |robot| robot.passed.iter().map(|at| at.seconds()).collect())
    }

    /// A time of the run (s since its start).
    fn since(&self, time: Time) -> f64 {
        (time - self.begun).seconds()
    }

    /// What became of a fault; nothing of what is none, or where nobody knows.
    fn effect_of(&self, incident: &Incident) -> Option<&str> {
        let of = self.effects.iter().find(|(time, _)| *time == incident.time);
        of.filter(|_| asked::is_fault(incident)).map(|(_, effect)| effect.as_str())
    }
}

/// The agents and executors that took or freed memory in real time, and how often.
fn allocations(view: &SystemView) -> Option<Vec<(String, u64)>> {
    let real_time = |name: &str| view.executors.iter().any(|known| known.name == name && known.real_time);
    let agents = view.agents.iter().filter(|agent| real_time(&agent.executor));
    let agents = agents.map(|agent| (agent.name.clone(), agent.counts.allocations));
    let executors = view.executors.iter().filter(|executor| executor.real_time);
    let executors = executors.map(|known| (format!("executor {}", known.name), known.allocations));
    view.allocations_watched.then(|| agents.chain(executors).filter(|(_, count)| *count > 0).collect())
}

/// Who has not moved for so long at the end has given up.
const STANDS: Duration = Duration::secs(5);

/// Why a plan did not run, as a failure with its places.
pub(crate) fn failure(error: CannotRun, sources: &crate::file::Sources) -> crate::Failure {
    match error {
        CannotRun::Mistakes(list) => crate::file::Mistakes { sources: sources.clone(), list }.into(),
        CannotRun::Refused(refusal) => refusal.into(),
        // These are no matter of the file but of an agent or of the machine.
        other @ (CannotRun::NoThread(_) | CannotRun::Stuck { .. } | CannotRun::Endless { .. }) => {
            crate::Failure::new(other.to_string()).code(1)
        }
    }
}
