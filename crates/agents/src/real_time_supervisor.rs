//! The real-time supervisor: the one door between the ordinary side, which plans and decides, and the real-time side, which drives.
//!
//! ```text
//!   ordinary side                    real-time side
//!   mode, task ───▶ together, once ──▶ mode ─▶ coordinator, actions
//!                                      task ─▶ actions
//!   status ◀─────── is it over? ◀───── reports of the actions
//!                   is somebody silent? ─▶ idle, at once
//! ```
//!
//! A task goes through when its mode is there, so no action ever works on a task in the mode of another. Whoever the mode names must be heard
//! of again and again; who is not for too long makes the robot stand, without waiting for the ordinary side to notice. A task that is over
//! makes it stand, too, and a latch that is set ends the task: to reset it moves nothing.

use runtime::{Agent, Fault, Input, Output, Step};
use types::messages::{EmergencyStop, MOST_AGENTS, Mode, Progress, Report, Task};
use types::params::Params;
use types::{AgentId, Duration, Name, Sequence, Text, Time};

use crate::process_supervisor::IDLE;

/// How long somebody may be silent.
#[derive(Clone, Debug, Params)]
pub struct SupervisorParams {
    /// When no action of the mode has told of the task for so long, none does it, and it is refused (time). 1 s is fifty steps of an action.
    #[param(default = Duration::secs(1), min = 0.05, max = 60.0)]
    pub taken_up: Duration,
    /// An agent of the mode of which nothing is heard for so long is taken for dead (time). 250 ms is twelve steps of an action at 50 Hz, in which a robot at 0.6 m/s goes 15 cm.
    #[param(default = Duration::millis(250), min = 0.01, max = 60.0)]
    pub silence: Duration,
}

/// Passes modes and tasks to the real-time side, tells what becomes of them, and makes the robot stand when an action falls silent.
#[derive(Agent)]
#[agent(kind = "real-time-supervisor")]
pub struct RealTimeSupervisor {
    /// What the ordinary side wants to be in force.
    mode: Input<Mode>,
    /// What the ordinary side wants to be done.
    task: Input<Task>,
    /// What actions tell of their tasks; each tells something in every step.
    reports: Input<Report>,
    /// Whether the robot is latched: a task ends by that, or the robot would set off when somebody resets it.
    stop: Input<EmergencyStop>,
    /// The mode in force, when it changes and once a second.
    modes: Output<Mode>,
    /// The task, when it changes and once a second.
    tasks: Output<Task>,
    /// What becomes of the task.
    #[port(history = 64)]
    status: Output<Report>,
    params: SupervisorParams,
    door: Door,
    told: Option<Time>,
    said: Option<(Report, Time)>,
}

/// What stays the same is told again so often: an action that was started anew shall hear of it.
const TELL_AGAIN: Duration = Duration::secs(1);

/// The ordinary side hears so often how far a task has come, and at once when it is over.
const STATUS_EVERY: Duration = Duration::millis(100);

impl Agent for RealTimeSupervisor {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        let now = step.now;
        while let Some(mode) = self.mode.take() {
            self.door.wanted = Some(*mode);
        }
        while let Some(task) = self.task.take() {
            self.door.waiting = Some(*task);
        }
        let mut changed = self.door.open(now);
        let mut over = None;
        while let Some(report) = self.reports.take() {
            over = over.or(self.door.hear(report.header().sender, *report, now));
        }
        if let Some((progress, why)) = over {
            self.door.stand(progress, why);
            changed = true;
        }
        if self.stop.latest().is_some_and(|stop| stop.latched) && self.door.is_underway() {
            runtime::note!("the emergency stop is set: what was being done has ended");
            self.door.stand(Progress::Halted, "the emergency stop is set; sinew reset ends it".into());
            changed = true;
        }
        if let Some(name) = self.door.silent(&self.params, |name| step.agent_named(name), now) {
            runtime::note!("an action of the mode is silent: standing");
            let why = Text::format(format_args!("the action \"{name}\" is silent: it hangs or has died"));
            self.door.stand(Progress::Halted, why);
            changed = true;
        }
        if self.door.is_not_taken_up(&self.params, now) {
            runtime::note!("no action of the mode does the task: standing");
            let why =
                Text::format(format_args!("no action of the mode \"{}\" does this", self.door.mode.name));
            self.door.stand(Progress::Refused, why);
            changed = true;
        }
        if changed || self.told.is_none_or(|told| now - told >= TELL_AGAIN) {
            self.told = Some(now);
            self.modes.send(self.door.mode);
            self.tasks.send(self.door.task);
        }
        let status = self.door.status;
        let is_news = |(told, at): (Report, Time)| {
            (told.task, told.progress) != (status.task, status.progress) || now - at >= STATUS_EVERY
        };
        if self.said.is_none_or(is_news) {
            self.said = Some((status, now));
            self.status.send(status);
        }
        Ok(())
    }
}

/// What is in force.
#[derive(Clone, Copy, Debug)]
struct Door {
    mode: Mode,
    task: Task,
    status: Report,
    /// What the ordinary side wanted last.
    wanted: Option<Mode>,
    /// A task whose mode is not in force yet.
    waiting: Option<Task>,
    /// When the mode came into force, and when each of its agents was heard last.
    since: Time,
    /// When the task came into force, while no action has told of it.
    fresh: Option<Time>,
    heard: Sequence<(AgentId, Time), MOST_AGENTS>,
}

impl Default for Door {
    fn default() -> Door {
        Door {
            mode: Mode { name: IDLE.into(), ..Mode::default() },
            task: Task::default(),
            status: Report::default(),
            wanted: None,
            waiting: None,
            since: Time::ZERO,
            fresh: None,
            heard: Sequence::new(),
        }
    }
}

impl Door {
    /// Puts into force what is wanted and complete; says whether anything changed.
    fn open(&mut self, now: Time) -> bool {
        let Some(task) = self.waiting else {
            // Without a task only standing can be wanted by a mode alone, and people who drive by hand need no task either.
            return false;
        };
        let mode = self.wanted.filter(|mode| mode.name == task.mode);
        let Some(mode) = mode.or(Some(self.mode).filter(|mode| mode.name == task.mode)) else { return false };
        self.waiting = None;
        if mode.name != self.mode.name {
            self.since = now;
            self.heard = Sequence::new();
        }
        self.mode = Mode { before: self.mode.name, ..mode };
        self.task = task;
        // In a mode in which nobody is heard a task can only wait: for people who drive by hand.
        self.fresh = (task.number > 0 && !mode.rows.is_empty()).then_some(now);
        let progress = if task.number == 0 { Progress::Idle } else { Progress::Underway };
        self.status = Report { task: task.number, progress, ..Report::default() };
        true
    }

    /// Takes over a report; gives how and why the task ended when it is over by it.
    fn hear(&mut self, sender: AgentId, report: Report, now: Time) -> Option<(Progress, Text<127>)> {
        match self.heard.iter_mut().find(|(known, _)| *known == sender) {
            Some((_, at)) => *at = now,
            // More than a mode can name have no say in it.
            None => drop(self.heard.push((sender, now))),
        }
        if report.task != self.task.number || report.task == 0 || self.status.progress.is_over() {
            return None;
        }
        // One that only watches tells of no way that is left; the one who drives does.
        if report.progress != Progress::Idle {
            (self.status, self.fresh) = (report, None);
        }
        report.progress.is_over().then_some((report.progress, report.why))
    }

    /// Whether somebody drives for a task, and has told what is left of it.
    fn is_underway(&self) -> bool {
        self.task.number != 0 && !self.status.progress.is_over() && self.fresh.is_none()
    }

    /// Makes the robot stand; the status tells why.
    fn stand(&mut self, progress: Progress, why: Text<127>) {
        if self.task.number == 0 {
            self.status.progress = Progress::Idle;
        } else {
            (self.status.progress, self.status.why) = (progress, why);
        }
        self.fresh = None;
        self.mode = Mode { name: IDLE.into(), before: self.mode.name, ..Mode::default() };
        self.task = Task { number: self.task.number, mode: Name::new(IDLE), ..Task::default() };
    }

    /// Whether no action has told of the task for too long.
    fn is_not_taken_up(&self, params: &SupervisorParams, now: Time) -> bool {
        self.fresh.is_some_and(|since| now - since > params.taken_up)
    }

    /// Somebody whom the mode names and who was not heard of for too long.
    fn silent(
        &self,
        params: &SupervisorParams,
        find: impl Fn(&str) -> Option<AgentId>,
        now: Time,
    ) -> Option<Name> {
        let last = |name: &Name| {
            let id = find(name.as_str())?;
            self.heard.iter().find(|(known, _)| *known == id).map(|(_, at)| *at)
        };
        let mut agents = self.mode.rows.iter().map(|row| row.agent);
        // From its beginning an action has the same time as between two reports.
        agents.find(|agent| now - last(agent).unwrap_or(self.since).max(self.since) > params.silence)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use types::messages::{ModeRow, Motion};

    const GOTO: AgentId = AgentId(4);

    fn at(millis: i64) -> Time {
        Time::ZERO + Duration::millis(millis)
    }

    fn mode(name: &str) -> Mode {
        let row = ModeRow { agent: "goto".into(), weight: 1.0, priority: 1 };
        Mode { name: name.into(), rows: [row].into_iter().collect(), ..Mode::default() }
    }

    fn task(number: u32, mode: &str) -> Task {
        Task { number, mode: mode.into(), motion: Motion::Goto, ..Task::default() }
    }

    fn find(name: &str) -> Option<AgentId> {
        (name == "goto").then_some(GOTO)
    }

    fn underway() -> Door {
        let mut door = Door { wanted: Some(mode("goto")), waiting: Some(task(1, "goto")), ..Door::default() };
        assert!(door.open(at(0)));
        door
    }

    #[test]
    fn a_task_waits_for_its_mode_and_a_mode_for_its_task() {
        let mut door = Door { waiting: Some(task(1, "goto")), ..Door::default() };
        assert!(!door.open(at(0)), "its mode is not there");
        door.wanted = Some(mode("move"));
        assert!(!door.open(at(20)), "nor is it now");
        door.wanted = Some(mode("goto"));
        assert!(door.open(at(40)));
        assert_eq!((door.mode.name.as_str(), door.task.number), ("goto", 1));
        assert_eq!((door.status.task, door.status.progress), (1, Progress::Underway));
        assert!(!door.open(at(60)), "once");
        // The next task in the same mode needs no mode again.
        (door.wanted, door.waiting) = (None, Some(task(2, "goto")));
        assert!(door.open(at(80)));
        assert_eq!(door.task.number, 2);
    }

    #[test]
    fn what_is_over_makes_the_robot_stand_and_is_told_until_the_next_task() {
        let mut door = underway();
        let report = |progress| Report { task: 1, progress, distance: 0.004, ..Report::default() };
        assert_eq!(door.hear(GOTO, report(Progress::Underway), at(20)), None);
        assert_eq!(
            door.hear(GOTO, Report { task: 7, ..report(Progress::Arrived) }, at(40)),
            None,
            "another's"
        );
        let (over, why) = door.hear(GOTO, report(Progress::Arrived), at(60)).unwrap();
        door.stand(over, why);
        assert_eq!((door.mode.name.as_str(), door.mode.rows.len()), (IDLE, 0));
        assert_eq!((door.status.progress, door.status.distance), (Progress::Arrived, 0.004));
        assert_eq!(door.hear(GOTO, report(Progress::Unreachable), at(80)), None, "it has ended already");
        assert_eq!(door.status.progress, Progress::Arrived);
    }

    #[test]
    fn only_a_task_that_is_not_over_can_be_ended_by_the_latch() {
        let mut door = Door::default();
        assert!(!door.is_underway(), "there is none");
        door = underway();
        assert!(!door.is_underway(), "no action has told what is left of it");
        door.hear(GOTO, Report { task: 1, progress: Progress::Underway, ..Report::default() }, at(20));
        assert!(door.is_underway());
        door.stand(Progress::Halted, Text::default());
        assert!(!door.is_underway());
        assert_eq!((door.status.progress, door.mode.name.as_str()), (Progress::Halted, IDLE));
    }

    #[test]
    fn who_is_silent_for_too_long_makes_the_robot_stand() {
        let params = SupervisorParams::default();
        let mut door = underway();
        let is_silent = |door: &Door, millis| door.silent(&params, find, at(millis)).is_some();
        assert!(!is_silent(&door, 250));
        assert!(is_silent(&door, 251), "it never spoke");
        door.hear(GOTO, Report::default(), at(200));
        assert!(!is_silent(&door, 450));
        assert!(is_silent(&door, 451));
        assert_eq!(door.silent(&params, |_| None, at(451)), Some("goto".into()), "it is not there at all");
        door.stand(Progress::Halted, Text::EMPTY);
        assert!(!is_silent(&door, 9000), "nobody is needed to stand");
    }

    #[test]
    fn a_task_that_no_action_takes_up_is_not_underway_for_ever() {
        let params = SupervisorParams::default();
        let mut door = underway();
        door.hear(GOTO, Report::default(), at(900));
        assert!(!door.is_not_taken_up(&params, at(1000)));
        assert!(door.is_not_taken_up(&params, at(1001)), "all that it tells is that it is there");
        door.hear(GOTO, Report { task: 1, progress: Progress::Underway, ..Report::default() }, at(1000));
        assert!(!door.is_not_taken_up(&params, at(9000)));
        door.stand(Progress::Refused, "no action".into());
        assert_eq!((door.status.progress, door.status.why.as_str()), (Progress::Refused, "no action"));
        // While people drive by hand a task waits, and nobody is to take it up.
        let by_hand = Mode { name: "teleoperation".into(), ..Mode::default() };
        (door.wanted, door.waiting) = (Some(by_hand), Some(task(2, "teleoperation")));
        assert!(door.open(at(9000)) && !door.is_not_taken_up(&params, at(20000)));
    }
}
