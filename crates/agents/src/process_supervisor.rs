//! The process supervisor: what works in which mode, and what happens when something of that dies.
//!
//! ```text
//!  people ─▶ change ─┐                        ┌▶ mode ─▶ real-time supervisor
//!  navigation ─▶ tasks ─┴─▶ table of modes ───┴▶ task ─▶
//!  router: who lives ─────▶ somebody died ─▶ the mode's "dies"
//!  people's hands ────────▶ the mode "teleoperation", and back when they let go
//! ```
//!
//! While people drive by hand no action is heard. A task that has a place waits for them to let go and is then begun anew from where they
//! left the robot; one without, such as to drive a metre, is over: half of it again would lead elsewhere.
//!
//! It belongs to the ordinary side: it may take its time. That nobody drives on in the meantime the real-time supervisor sees to, which needs
//! no table for it.

mod modes;

use runtime::{
    Agent, AgentState, Composition, Fault, Input, Member, MessageType, Output, Router, Service, Step,
};
use types::Name;
use types::messages::{Answer, ByHand, Mode, Motion, Report, Task};
use types::params::Params;
use types::value::{Mistake, Table, nearest};

use modes::Known;
pub use modes::{IDLE, ModeTable, RESERVED};

/// The modes.
#[derive(Clone, Debug, Params)]
#[params(check = whole)]
pub struct ProcessParams {
    /// In each mode, who is heard: an agent's weight from 0 to 1, or a table of weight and priority, as in goto = { priority = 1 }. What else a mode says: `by`, how one command is made ("priority", where nothing is said; "subsumption", "vector-sum" or "fuzzy"), and `dies`, the mode that follows when one of its agents dies ("idle", where nothing is said). The mode "idle", in which nobody is heard, is always there.
    pub modes: ModeTable,
    /// The mode in which it begins. "idle" moves nothing before somebody asks for it.
    #[param(default = "idle")]
    pub start: Name,
    /// The mode in which people drive by hand, with nobody in it whose wishes would count. Where the table has none of that name the mode stays while they drive.
    #[param(default = "teleoperation")]
    pub by_hand: Name,
}

fn whole(params: &ProcessParams, read: &Table) -> Vec<Mistake> {
    let written = read.get("modes").and_then(|entry| entry.value.as_table());
    let mut mistakes = written.map(ModeTable::mistakes).unwrap_or_default();
    if let Some(entry) = read.get("start").filter(|_| params.modes.find(params.start.as_str()).is_none()) {
        mistakes.push(Mistake::new(entry.at, no_mode(params, params.start.as_str())));
    }
    mistakes
}

fn no_mode(params: &ProcessParams, name: &str) -> String {
    match nearest(name, params.modes.names()) {
        Some(near) => format!("there is no mode \"{name}\"; did you mean \"{near}\"?"),
        None => {
            let all: Vec<&str> = params.modes.names().collect();
            format!("there is no mode \"{name}\"; there are: {}", all.join(", "))
        }
    }
}

/// Changes the mode when it is asked to, when a task needs another, and when somebody whom the mode needs has died.
#[derive(Agent)]
#[agent(kind = "process-supervisor")]
pub struct ProcessSupervisor {
    /// Changes the mode by hand, as in sinew call processes.change name=idle.
    change: Service<Mode, Answer>,
    /// What is to be done, and in which mode.
    tasks: Input<Task>,
    /// Whether people drive by hand.
    hand: Input<ByHand>,
    /// What becomes of the task: one that is over does not wait for people to let go.
    status: Input<Report>,
    /// Who there is, and who lives.
    router: Router,
    /// The mode, whenever it changes and before each task.
    mode: Output<Mode>,
    /// The task, after its mode.
    task: Output<Task>,
    /// Tasks that cannot be begun.
    refused: Output<Report>,
    params: ProcessParams,
    /// The mode that was told last.
    now: Option<Mode>,
    /// The task that is being done.
    doing: Task,
    /// While people drive: the mode and the task that wait for them to let go.
    waiting: Option<Task>,
    is_by_hand: bool,
}

impl Agent for ProcessSupervisor {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        if self.now.is_none() {
            self.enter(self.params.start);
        }
        while let Some((asked, call)) = self.change.take() {
            let answer = self.asked(asked.name);
            self.change.answer(&call, answer);
        }
        while let Some(status) = self.status.take() {
            if status.task == self.doing.number && status.progress.is_over() {
                self.doing = Task { mode: self.doing.mode, ..Task::default() };
            }
        }
        while let Some(hand) = self.hand.take().map(|received| *received) {
            match (hand.on, self.is_by_hand) {
                (true, false) => self.take_over(),
                (false, true) => self.give_back(),
                _ => {}
            }
        }
        while let Some(task) = self.tasks.take().map(|received| *received) {
            let Some(why) = self.why_not(task.mode).or_else(|| self.nobody_does(&task)) else {
                match self.waiting.is_some() {
                    true => self.wait(task),
                    false => self.begin(task),
                }
                continue;
            };
            runtime::note!("task {} is refused: its report says why", task.number);
            self.refused.send(Report::refused(task.number, &why));
        }
        self.look_after();
        Ok(())
    }
}

impl ProcessSupervisor {
    fn asked(&mut self, name: Name) -> Answer {
        if let Some(why) = self.why_not(name) {
            return Answer { why: why.as_str().into(), ..Answer::default() };
        }
        // A mode that is asked for has no task: what was being done is over.
        self.waiting = None;
        self.begin(Task { mode: name, ..Task::default() });
        Answer { accepted: true, task: 0, why: "the mode has changed".into() }
    }

    /// Why a mode cannot be entered.
    fn why_not(&self, name: Name) -> Option<String> {
        let Some(known) = self.params.modes.find(name.as_str()) else {
            return Some(no_mode(&self.params, name.as_str()));
        };
        let system = self.router.system();
        missing(&known.mode, &system)
            .map(|agent| format!("the mode \"{name}\" needs \"{agent}\", which is not there or not alive"))
    }

    /// Why a mode that is there is none for a task: nobody in it does such a thing.
    fn nobody_does(&self, task: &Task) -> Option<String> {
        let system = self.router.system();
        let does = |known: &Known| {
            known.mode.rows.iter().any(|row| {
                system.member(row.agent.as_str()).is_some_and(|member| may_do(member, task.motion))
            })
        };
        let known = self.params.modes.find(task.mode.as_str())?;
        if task.motion == Motion::Stand || does(known) {
            return None;
        }
        let what = words(task.motion);
        let others: Vec<&str> =
            self.params.modes.known().filter(|known| does(known)).map(Known::name).collect();
        let others = if others.is_empty() {
            "no mode has such a one".into()
        } else {
            format!("that is done in: {}", others.join(", "))
        };
        Some(format!("nobody in the mode \"{}\" {what}; {others}", task.mode))
    }

    fn begin(&mut self, task: Task) {
        self.enter(task.mode);
        self.doing = task;
        self.task.send(task);
    }

    /// People have taken the robot into their hands.
    fn take_over(&mut self) {
        self.is_by_hand = true;
        if self.params.modes.find(self.params.by_hand.as_str()).is_none() {
            return;
        }
        let mode = self.now.map_or(Name::new(IDLE), |now| now.name);
        self.wait(after_hands(Task { mode, ..self.doing }));
    }

    /// Lets a task wait while people drive. It is still being done, as far as who asked for it is told.
    fn wait(&mut self, task: Task) {
        self.waiting = Some(task);
        self.enter(self.params.by_hand);
        self.task.send(Task { number: task.number, mode: self.params.by_hand, ..Task::default() });
    }

    /// They have let go of it.
    fn give_back(&mut self) {
        self.is_by_hand = false;
        let Some(task) = self.waiting.take() else { return };
        match self.why_not(task.mode) {
            None => self.begin(task),
            Some(_) => self.begin(Task { mode: Name::new(IDLE), ..Task::default() }),
        }
    }

    fn enter(&mut self, name: Name) {
        let Some(known) = self.params.modes.find(name.as_str()) else { return };
        let before = match self.now {
            None => Name::EMPTY,
            Some(now) if now.name == name => now.before,
            Some(now) => now.name,
        };
        // It is told also when it stays the same: who hears it may have been started anew.
        let mode = Mode { before, ..known.mode };
        self.now = Some(mode);
        self.mode.send(mode);
    }

    /// Leaves a mode of which somebody has died.
    fn look_after(&mut self) {
        let Some(now) = self.now else { return };
        let dead = missing(&now, &self.router.system());
        if dead.is_none() {
            return;
        }
        let Some(known) = self.params.modes.find(now.name.as_str()) else { return };
        // What the table leads to may need the dead one, too: then the robot stands.
        let next = match self.why_not(known.dies) {
            None => known.dies,
            Some(_) => Name::new(IDLE),
        };
        if next != now.name {
            runtime::note!("somebody whom the mode needs has died: another mode");
            self.begin(Task { mode: next, ..Task::default() });
        }
    }
}

/// What is left of a task after people have driven the robot elsewhere: all of one that has a place, and of another no more than its mode.
fn after_hands(task: Task) -> Task {
    match task.motion {
        motion if motion.has_place() => task,
        Motion::Wall => task,
        _ => Task { mode: task.mode, ..Task::default() },
    }
}

/// Whether an agent may do such a motion: of our own actions that is known, of others only that they hear of tasks.
fn may_do(member: Member<'_>, motion: Motion) -> bool {
    match member.kind() {
        "goto" => matches!(motion, Motion::Goto | Motion::Dock),
        "navigator" => motion == Motion::Goto,
        "path-follower" => motion == Motion::Path,
        "move" => matches!(motion, Motion::Velocity | Motion::Distance | Motion::Turn | Motion::To),
        "along-wall" => motion == Motion::Wall,
        "avoid" | "escape" => false,
        _ => member.ports().any(|port| port.info().shape.input == Some(MessageType::of::<Task>())),
    }
}

fn words(motion: Motion) -> &'static str {
    match motion {
        Motion::Stand => "stands",
        Motion::Velocity => "drives at a speed",
        Motion::Distance => "drives a distance",
        Motion::Turn => "turns on the spot",
        Motion::Goto => "goes to a place",
        Motion::Path => "follows a path",
        Motion::Dock => "docks",
        Motion::To => "drives straight to a place",
        Motion::Wall => "follows a wall",
    }
}

/// The first agent of a mode that is not there or not alive.
fn missing(mode: &Mode, system: &Composition) -> Option<Name> {
    let lives = |agent: &Name| {
        system.member(agent.as_str()).is_some_and(|member| member.state() == AgentState::Running)
    };
    mode.rows.iter().map(|row| row.agent).find(|agent| !lives(agent))
}
