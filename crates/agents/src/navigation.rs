//! The navigation module: takes goals, manoeuvres and walls of people and programs, makes tasks of them, and tells what becomes of them.
//!
//! ```text
//!  go, drive, wall, halt ──▶ is that possible? ──▶ task ──▶ process supervisor ──▶ real-time supervisor ──▶ actions
//!                                                  └────▶ path planner
//!  pose of the localizer, path of the planner ──▶ no way, for too long? ──▶ halt
//!  status of the real-time supervisor ──▶ report
//!                                         └──▶ the answer to who asked
//! ```
//!
//! Who asks is answered when the supervisors have the task or refuse it, a few steps later: what they refuse is told with its reason, and what
//! was being done before goes on. What a new task replaces is told to have been replaced.

use runtime::{Agent, Call, Fault, Input, Output, Service, Step};
use types::messages::{
    Answer, Goal, Halt, Manoeuvre, Motion, Odometry, Path, Progress, Report, Task, WallWish,
};
use types::params::Params;
use types::{Duration, Name, Point, Pose, Text, Time};

use crate::localizer::FloorPlan;
use crate::process_supervisor::IDLE;

/// Modes, and how much patience there is.
#[derive(Clone, Debug, Params)]
pub struct NavigationParams {
    /// The mode in which it goes to a place when the request names none. It is to have an action that goes to places.
    #[param(default = "goto+avoid")]
    pub goto_mode: Name,
    /// The mode in which it follows planned paths; a goal that names this mode waits for a path.
    #[param(default = "path")]
    pub path_mode: Name,
    /// The mode in which it does manoeuvres without a place; a goal that names this mode is driven to by the wheels alone.
    #[param(default = "move")]
    pub move_mode: Name,
    /// The mode in which it follows walls.
    #[param(default = "wall-following")]
    pub wall_mode: Name,
    /// The mode in which it docks.
    #[param(default = "goto")]
    pub dock_mode: Name,
    /// The frame of goals: that of the localizer's poses, or "odom" where there is none.
    #[param(default = "map")]
    pub frame: Name,
    /// How long a task may take when the request does not say it (time). 5 min is a way of 100 m with all that comes in between.
    #[param(default = Duration::secs(300), min = 0.1, max = 86400.0)]
    pub within: Duration,
    /// For so long the planner may find no way before that is told (time). 5 s: people who stand in a door go on, walls do not.
    #[param(default = Duration::secs(5), min = 0.0, max = 600.0)]
    pub patience: Duration,
    /// What stands on the floor, as the localizer has it: "world" for that of the simulated world, the name of a file, or a table of walls, discs and boxes. A goal outside it is refused; without a floor none is.
    pub floor: FloorPlan,
    /// A place farther away than this is a slip of the one who asks (m).
    #[param(default = 1000.0, min = 1.0, max = 100000.0)]
    pub farthest: f64,
}

/// Takes goals and manoeuvres, gives tasks, and tells what becomes of them.
#[derive(Agent)]
#[agent(kind = "navigation")]
pub struct Navigation {
    /// To a place, as in sinew call navigation.go x=3 y=1; heading=1.57 for the heading at the end, dock=true for a centimetre; mode=path along a planned way, mode=move straight and by the wheels alone.
    go: Service<Goal, Answer>,
    /// Without a place: sinew call navigation.drive distance=1, or angle=1.57, or linear=0.2 angular=0.1 seconds=5.
    drive: Service<Manoeuvre, Answer>,
    /// Along a wall, as in sinew call navigation.wall side=right distance=0.7 seconds=60.
    wall: Service<WallWish, Answer>,
    /// Ends what is being done: the robot ramps down and stands.
    halt: Service<Halt, Answer>,
    /// Where the robot is, from the localizer; where it does not know that, no goal is accepted.
    pose: Input<Odometry>,
    /// The planned path; while there is none for too long, the goal cannot be reached.
    path: Input<Path>,
    /// What becomes of the task.
    status: Input<Report>,
    /// Tasks that could not be begun.
    refused: Input<Report>,
    /// What is to be done.
    task: Output<Task>,
    /// What becomes of it: when that changes, and every 200 ms while it is being done. The field "progress" is 0 idle, 1 underway, 2 arrived, 3 timed out, 4 unreachable, 5 halted, 6 refused, 7 lost, 8 replaced by another task; "why" says the reason.
    #[port(history = 64)]
    report: Output<Report>,
    params: NavigationParams,
    desk: Desk,
    owed: Option<Owed>,
}

impl Agent for Navigation {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        let now = step.now;
        if let Some(pose) = self.pose.newest() {
            self.desk.pose = Some((pose.pose, pose.header().stamp));
        }
        let located = !self.pose.is_wired() || self.desk.is_located(now);
        while let Some((goal, call)) = self.go.take() {
            let made = if located { self.desk.goal(&self.params, &goal) } else { Err(LOST.into()) };
            self.begin(made, (Via::Go, call), now);
        }
        while let Some((manoeuvre, call)) = self.drive.take() {
            let made = self.desk.manoeuvre(&self.params, &manoeuvre);
            self.begin(made, (Via::Drive, call), now);
        }
        while let Some((wish, call)) = self.wall.take() {
            let made = self.desk.wall(&self.params, &wish);
            self.begin(made, (Via::Wall, call), now);
        }
        while let Some((_, call)) = self.halt.take() {
            self.adopt();
            let task = self.desk.stand("it was told to halt");
            self.task.send(task);
            let why = "it ramps down and stands".into();
            self.halt.answer(&call, Answer { accepted: true, task: task.number, why });
        }
        while let Some(path) = self.path.take() {
            self.desk.planned(path.found, now);
        }
        if self.desk.has_no_way(&self.params, now) {
            runtime::note!("no way to the goal: given up");
            let task = self.desk.stand("");
            self.desk.ended = Some((Progress::Unreachable, "the planner finds no way to the goal"));
            self.task.send(task);
        }
        while let Some(refused) = self.refused.take().map(|received| *received) {
            match self.desk.asked.filter(|asked| asked.task.number == refused.task) {
                // Nothing has become of it, so what is being done goes on.
                Some(_) => {
                    self.desk.asked = None;
                    self.answer(Err(refused.why.as_str()));
                }
                None => self.desk.hear(&refused),
            }
        }
        while let Some(status) = self.status.take().map(|received| *received) {
            if self.desk.asked.is_some_and(|asked| asked.task.number == status.task) {
                self.adopt();
            }
            self.desk.hear(&status);
        }
        self.settle(now);
        if let Some(report) = self.desk.news(now) {
            self.report.send(report);
        }
        Ok(())
    }
}

impl Navigation {
    /// Gives a task to the supervisors, or says at once why there is none. The answer to the former waits for what they say of it.
    fn begin(&mut self, made: Result<Task, Why>, (via, call): (Via, Call), now: Time) {
        // One is asked at a time: the one before is taken for accepted.
        self.adopt();
        if self.owed.is_some() {
            self.answer(Ok(()));
        }
        let owed = |number, mode| Some(Owed { via, call, number, mode, at: now });
        match made {
            Ok(task) => {
                self.owed = owed(task.number, task.mode);
                self.task.send(task);
                self.desk.asked = Some(Asked { task, at: now });
            }
            Err(why) => {
                self.owed = owed(0, Name::EMPTY);
                self.answer(Err(why.as_str()));
            }
        }
    }

    /// Makes the task that was asked the one that is done, and tells what it replaces.
    fn adopt(&mut self) {
        let replaced = self.desk.adopt();
        if let Some(replaced) = replaced {
            runtime::note!("task {} is replaced by task {}", replaced.task, self.desk.report.task);
            self.report.send(replaced);
        }
    }

    /// Answers who asked last, once it is known what becomes of it or nobody says so in time.
    fn settle(&mut self, now: Time) {
        let Some(owed) = self.owed else { return };
        let waited = now - owed.at;
        if self.desk.asked.is_some() {
            if self.status.is_wired() && waited < NO_WORD {
                return;
            }
            self.adopt();
        }
        let Report { progress, why, .. } = self.desk.report;
        match progress {
            Progress::Refused => self.answer(Err(why.as_str())),
            Progress::Underway if self.status.is_wired() && waited < SETTLED => {}
            _ => self.answer(Ok(())),
        }
    }

    fn answer(&mut self, what: Result<(), &str>) {
        let Some(Owed { via, call, number, mode, .. }) = self.owed.take() else { return };
        let answer = match what {
            Ok(()) => Answer { accepted: true, task: number, why: mode.as_str().into() },
            Err(why) => Answer { why: why.into(), ..Answer::default() },
        };
        match via {
            Via::Go => self.go.answer(&call, answer),
            Via::Drive => self.drive.answer(&call, answer),
            Via::Wall => self.wall.answer(&call, answer),
        }
    }
}

/// By which service somebody asked.
#[derive(Clone, Copy, Debug)]
enum Via {
    Go,
    Drive,
    Wall,
}

/// An answer that is owed.
#[derive(Clone, Copy, Debug)]
struct Owed {
    via: Via,
    call: Call,
    number: u32,
    mode: Name,
    at: Time,
}

/// Why not: short enough to be handed back by value.
type Why = Text<119>;

const LOST: &str = "the robot does not know where it is: the localizer gives no pose";
/// For so long an answer waits for an action to refuse what it cannot do: some steps of it.
const SETTLED: Duration = Duration::millis(60);
/// When nobody says a word about a task for so long, its report will tell.
const NO_WORD: Duration = Duration::millis(500);
/// A pose older than this is none: the localizer gives five a second.
const POSE_AGE: Duration = Duration::secs(1);
/// While a task is being done it is told so often how far it has come.
const TELL_EVERY: Duration = Duration::millis(200);

/// A task that the supervisors have not said anything about yet.
#[derive(Clone, Copy, Debug)]
struct Asked {
    task: Task,
    at: Time,
}

/// What is being done and what became of it.
#[derive(Clone, Copy, Debug, Default)]
struct Desk {
    count: u32,
    asked: Option<Asked>,
    task: Task,
    report: Report,
    /// How and why it ended, where it was this agent that ended it.
    ended: Option<(Progress, &'static str)>,
    pose: Option<(Pose, Time)>,
    /// Whether the real-time side has the task.
    confirmed: bool,
    /// Since when the planner finds no way.
    no_way: Option<Time>,
    told: Option<(Report, Time)>,
}

impl Desk {
    fn is_located(&self, now: Time) -> bool {
        self.pose.is_some_and(|(_, stamp)| now - stamp <= POSE_AGE)
    }

    fn goal(&mut self, params: &NavigationParams, goal: &Goal) -> Result<Task, Why> {
        let Goal { x, y, heading, turned, dock, speed, seconds, mode } = *goal;
        match (x.is_nan(), y.is_nan()) {
            (true, true) => return Err("x and y are needed, as in x=3 y=1".into()),
            (true, false) => return Err("x is needed as well as y, as in x=3 y=1".into()),
            (false, true) => return Err("y is needed as well as x, as in x=3 y=1".into()),
            (false, false) => {}
        }
        // A heading that is said is wanted.
        let turned = turned || dock || !heading.is_nan();
        let heading = if heading.is_nan() { 0.0 } else { heading };
        if ![x, y, heading, speed, seconds].iter().all(|number| number.is_finite()) {
            return Err("a goal is made of numbers".into());
        }
        if speed < 0.0 || seconds < 0.0 {
            return Err("speed and seconds are positive, or zero for the robot's own".into());
        }
        let here = self.pose.map_or(Pose::default(), |(pose, _)| pose);
        if here.position().distance(Point::new(x, y)) > params.farthest {
            return Err("the goal is farther away than the parameter \"farthest\" allows".into());
        }
        if let Some((low, high)) = params.floor.bounds()
            && !((low.x..=high.x).contains(&x) && (low.y..=high.y).contains(&y))
        {
            return Err(Text::format(format_args!(
                "the goal lies outside the floor: x goes from {:.2} to {:.2} m and y from {:.2} to {:.2} m there",
                low.x, high.x, low.y, high.y
            )));
        }
        let usual = if dock { params.dock_mode } else { params.goto_mode };
        let mode = if mode.is_empty() { usual } else { mode };
        let motion = match dock {
            true => Motion::Dock,
            false if mode == params.path_mode => Motion::Path,
            false if mode == params.move_mode => Motion::To,
            false => Motion::Goto,
        };
        Ok(self.numbered(Task {
            mode,
            motion,
            frame: params.frame,
            target: Pose { x, y, heading },
            turned,
            linear: speed,
            seconds: if seconds > 0.0 { seconds } else { params.within.seconds() },
            ..Task::default()
        }))
    }

    fn manoeuvre(&mut self, params: &NavigationParams, wish: &Manoeuvre) -> Result<Task, Why> {
        let Manoeuvre { linear, angular, seconds, distance, angle } = *wish;
        if ![linear, angular, seconds, distance, angle].iter().all(|number| number.is_finite()) {
            return Err("a manoeuvre is made of numbers".into());
        }
        let motion = match (seconds != 0.0, distance != 0.0, angle != 0.0) {
            (true, false, false) if seconds > 0.0 => Motion::Velocity,
            (true, false, false) => return Err("seconds are positive".into()),
            (false, true, false) => Motion::Distance,
            (false, false, true) => Motion::Turn,
            (false, false, false) => return Err("say one of seconds, distance or angle".into()),
            _ => return Err("seconds, distance and angle are three manoeuvres: say one".into()),
        };
        let within = if motion == Motion::Velocity { seconds } else { params.within.seconds() };
        let mode = params.move_mode;
        Ok(self.numbered(Task {
            mode,
            motion,
            linear,
            angular,
            distance,
            angle,
            seconds: within,
            ..Task::default()
        }))
    }

    fn wall(&mut self, params: &NavigationParams, wish: &WallWish) -> Result<Task, Why> {
        let WallWish { side, distance, speed, seconds } = *wish;
        if ![distance, speed, seconds].iter().all(|number| number.is_finite() && *number >= 0.0) {
            return Err("distance, speed and seconds are positive, or zero for the robot's own".into());
        }
        let left = match side.as_str() {
            "" | "left" => true,
            "right" => false,
            _ => return Err("the side of a wall is \"left\" or \"right\"".into()),
        };
        Ok(self.numbered(Task {
            mode: params.wall_mode,
            motion: Motion::Wall,
            linear: speed,
            distance,
            left,
            seconds: if seconds > 0.0 { seconds } else { params.within.seconds() },
            ..Task::default()
        }))
    }

    fn numbered(&mut self, task: Task) -> Task {
        self.count += 1;
        Task { number: self.count, ..task }
    }

    /// Makes the task that was asked the present one; gives the report of the one that it replaces.
    fn adopt(&mut self) -> Option<Report> {
        let Asked { task, at } = self.asked.take()?;
        let before = self.report;
        let is_replaced = before.progress == Progress::Underway && self.ended.is_none();
        self.task = task;
        self.report = Report { task: task.number, progress: Progress::Underway, ..Report::default() };
        (self.ended, self.confirmed) = (None, false);
        self.no_way = (task.motion == Motion::Path).then_some(at);
        let why = Text::format(format_args!("task {} has taken its place", task.number));
        is_replaced.then_some(Report { progress: Progress::Replaced, why, ..before })
    }

    /// The task that ends the present one.
    fn stand(&mut self, why: &'static str) -> Task {
        self.no_way = None;
        if self.report.progress == Progress::Underway {
            self.ended = Some((Progress::Halted, why));
        }
        Task { mode: Name::new(IDLE), ..Task::default() }
    }

    fn planned(&mut self, found: bool, now: Time) {
        if self.task.motion == Motion::Path && !self.report.progress.is_over() {
            self.no_way = if found { None } else { self.no_way.or(Some(now)) };
        }
    }

    fn has_no_way(&self, params: &NavigationParams, now: Time) -> bool {
        self.report.progress == Progress::Underway
            && self.ended.is_none()
            && self.no_way.is_some_and(|since| now - since > params.patience)
    }

    fn hear(&mut self, report: &Report) {
        if self.ended.is_some() || self.report.task == 0 || self.report.progress.is_over() {
            return;
        }
        if report.task == self.report.task {
            self.report = *report;
            self.confirmed = true;
        } else if self.confirmed {
            // The real-time side had it and has it no more: somebody changed the mode, or somebody whom it needs has died.
            self.report.progress = Progress::Halted;
            self.report.why =
                "somebody changed the mode or drove by hand, or an agent that it needs has died".into();
        }
    }

    /// What is to be told now.
    fn news(&mut self, now: Time) -> Option<Report> {
        if let Some((ended, why)) = self.ended {
            (self.report.progress, self.report.why) = (ended, why.into());
        }
        let report = self.report;
        let changed = |told: &Report| (told.task, told.progress) != (report.task, report.progress);
        let is_due = match &self.told {
            None => report.task != 0,
            Some((told, at)) => {
                changed(told) || !report.progress.is_over() && report.task != 0 && now - *at >= TELL_EVERY
            }
        };
        is_due.then(|| {
            self.told = Some((report, now));
            report
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(millis: i64) -> Time {
        Time::ZERO + Duration::millis(millis)
    }

    fn goal(x: f64, y: f64) -> Goal {
        Goal { x, y, ..Goal::default() }
    }

    /// Asks for a goal, and lets the supervisors take it; gives what it replaces.
    fn asked(desk: &mut Desk, params: &NavigationParams, goal: &Goal) -> Option<Report> {
        let task = desk.goal(params, goal).unwrap();
        desk.asked = Some(Asked { task, at: at(0) });
        desk.adopt()
    }

    #[test]
    fn goals_and_manoeuvres_become_tasks_that_count_up() {
        let (params, mut desk) = (NavigationParams::default(), Desk::default());
        let first = desk.goal(&params, &goal(3.0, 1.0)).unwrap();
        assert_eq!((first.number, first.motion, first.mode.as_str()), (1, Motion::Goto, "goto+avoid"));
        assert_eq!((first.target.x, first.seconds, first.turned), (3.0, 300.0, false));
        let path = Goal { mode: "path".into(), seconds: 20.0, ..goal(3.0, 1.0) };
        let second = desk.goal(&params, &path).unwrap();
        assert_eq!((second.number, second.motion, second.seconds), (2, Motion::Path, 20.0));
        let dock = desk.goal(&params, &Goal { dock: true, ..goal(1.0, 1.0) }).unwrap();
        assert_eq!((dock.motion, dock.turned, dock.mode.as_str()), (Motion::Dock, true, "goto"));
        let to = desk.goal(&params, &Goal { mode: "move".into(), ..goal(1.0, 1.0) }).unwrap();
        assert_eq!((to.motion, to.mode.as_str(), to.frame.as_str()), (Motion::To, "move", "map"));
        let wall =
            desk.wall(&params, &WallWish { side: "right".into(), distance: 0.7, ..WallWish::default() });
        let wall = wall.unwrap();
        assert_eq!((wall.motion, wall.mode.as_str()), (Motion::Wall, "wall-following"));
        assert_eq!((wall.left, wall.distance, wall.seconds), (false, 0.7, 300.0));
        let drive = |wish| Desk::default().manoeuvre(&params, &wish).map(|task| task.motion);
        let wish = Manoeuvre::default();
        assert_eq!(drive(Manoeuvre { linear: 0.2, seconds: 5.0, ..wish }), Ok(Motion::Velocity));
        assert_eq!(drive(Manoeuvre { distance: -1.0, ..wish }), Ok(Motion::Distance));
        assert_eq!(drive(Manoeuvre { angle: 1.0, ..wish }), Ok(Motion::Turn));
    }

    #[test]
    fn what_cannot_be_done_is_refused_with_the_reason() {
        let params = NavigationParams::default();
        let refused = |goal| Desk::default().goal(&params, &goal).unwrap_err().as_str().to_owned();
        assert!(refused(goal(f64::INFINITY, 0.0)).contains("numbers"));
        assert!(refused(Goal::default()).contains("x and y are needed"));
        assert!(refused(Goal { x: 9.0, ..Goal::default() }).contains("y is needed"));
        assert!(refused(Goal { y: 9.0, ..Goal::default() }).contains("x is needed"));
        assert!(refused(Goal { heading: f64::INFINITY, ..goal(1.0, 0.0) }).contains("numbers"));
        assert!(refused(goal(2000.0, 0.0)).contains("farther"));
        assert!(refused(Goal { speed: -0.1, ..goal(1.0, 0.0) }).contains("positive"));
        let drive = |wish| Desk::default().manoeuvre(&params, &wish).unwrap_err().as_str().to_owned();
        let wish = Manoeuvre::default();
        let wall = |wish| Desk::default().wall(&params, &wish).unwrap_err().as_str().to_owned();
        assert!(wall(WallWish { side: "above".into(), ..WallWish::default() }).contains("\"left\" or"));
        assert!(wall(WallWish { distance: -1.0, ..WallWish::default() }).contains("positive"));
        assert!(drive(wish).contains("say one of"));
        assert!(drive(Manoeuvre { distance: 1.0, angle: 1.0, ..wish }).contains("say one"));
        assert!(drive(Manoeuvre { seconds: -1.0, ..wish }).contains("positive"));
        assert!(drive(Manoeuvre { linear: f64::INFINITY, seconds: 1.0, ..wish }).contains("numbers"));
    }

    #[test]
    fn a_heading_that_is_said_is_wanted_and_old_calls_mean_the_same() {
        let params = NavigationParams::default();
        let target = |goal| {
            let task = Desk::default().goal(&params, &goal).unwrap();
            (task.turned, task.target.heading)
        };
        assert_eq!(target(goal(1.0, 0.0)), (false, 0.0));
        assert_eq!(target(Goal { heading: 1.57, ..goal(1.0, 0.0) }), (true, 1.57));
        assert_eq!(target(Goal { heading: 0.0, ..goal(1.0, 0.0) }), (true, 0.0));
        assert_eq!(target(Goal { heading: 1.57, turned: true, ..goal(1.0, 0.0) }), (true, 1.57));
        assert_eq!(target(Goal { turned: true, ..goal(1.0, 0.0) }), (true, 0.0));
        assert_eq!(target(Goal { dock: true, ..goal(1.0, 0.0) }), (true, 0.0));
    }

    #[test]
    fn a_goal_outside_the_floor_is_refused_with_where_the_floor_is() {
        let params = NavigationParams { floor: FloorPlan::room(8.0, 6.0), ..NavigationParams::default() };
        assert!(Desk::default().goal(&params, &goal(7.9, 0.1)).is_ok());
        for (x, y) in [(8.1, 1.0), (-0.1, 1.0), (1.0, 6.5), (50.0, 50.0)] {
            let why = Desk::default().goal(&params, &goal(x, y)).unwrap_err();
            assert!(
                why.as_str().ends_with("x goes from 0.00 to 8.00 m and y from 0.00 to 6.00 m there"),
                "{why}"
            );
        }
    }

    #[test]
    fn a_task_that_another_replaces_is_told_to_be_and_one_that_was_asked_in_vain_replaces_nothing() {
        let (params, mut desk) = (NavigationParams::default(), Desk::default());
        assert_eq!(asked(&mut desk, &params, &goal(3.0, 1.0)), None);
        desk.hear(&Report { task: 1, progress: Progress::Underway, distance: 2.0, ..Report::default() });
        let replaced = asked(&mut desk, &params, &goal(5.0, 1.0)).unwrap();
        assert_eq!((replaced.task, replaced.progress, replaced.distance), (1, Progress::Replaced, 2.0));
        assert_eq!(replaced.why.as_str(), "task 2 has taken its place");
        assert_eq!((desk.report.task, desk.report.progress), (2, Progress::Underway));
        // The third is refused: the second is still being done.
        desk.goal(&params, &goal(6.0, 1.0)).unwrap();
        assert_eq!(desk.adopt(), None);
        assert_eq!((desk.report.task, desk.report.progress), (2, Progress::Underway));
        desk.hear(&Report { task: 2, progress: Progress::Arrived, ..Report::default() });
        assert_eq!(asked(&mut desk, &params, &goal(5.0, 1.0)), None, "what has ended is not replaced");
    }

    #[test]
    fn a_goal_without_a_way_is_given_up_after_a_while_and_told_once() {
        let (params, mut desk) = (NavigationParams::default(), Desk::default());
        let path = Goal { mode: "path".into(), ..goal(3.0, 1.0) };
        asked(&mut desk, &params, &path);
        desk.planned(true, at(500));
        desk.planned(false, at(1000));
        assert!(!desk.has_no_way(&params, at(6000)));
        desk.planned(true, at(6000));
        desk.planned(false, at(7000));
        desk.planned(false, at(12000));
        assert!(desk.has_no_way(&params, at(12001)), "since 7 s");
        let stand = desk.stand("");
        desk.ended = Some((Progress::Unreachable, "no way"));
        assert_eq!((stand.number, stand.mode.as_str()), (0, IDLE));
        assert_eq!(desk.news(at(12001)).map(|report| report.progress), Some(Progress::Unreachable));
        desk.hear(&Report { task: 1, progress: Progress::Halted, ..Report::default() });
        assert_eq!(desk.news(at(13000)), None, "that it stands now is no news of the task");
    }

    #[test]
    fn a_task_that_the_real_time_side_drops_is_halted_and_one_that_it_has_not_yet_is_not() {
        let (params, mut desk) = (NavigationParams::default(), Desk::default());
        asked(&mut desk, &params, &goal(3.0, 1.0));
        let status = |task| Report { task, progress: Progress::Underway, ..Report::default() };
        desk.hear(&status(0));
        assert_eq!(desk.report.progress, Progress::Underway, "it is on its way there");
        desk.hear(&status(1));
        desk.hear(&Report::default());
        assert_eq!(desk.report.progress, Progress::Halted);
        desk.hear(&status(1));
        assert_eq!(desk.report.progress, Progress::Halted, "it stays so");
    }

    #[test]
    fn how_far_it_has_come_is_told_again_and_again_and_the_end_once() {
        let (params, mut desk) = (NavigationParams::default(), Desk::default());
        assert_eq!(desk.news(at(0)), None);
        asked(&mut desk, &params, &goal(3.0, 1.0));
        let mut told = 0;
        for millis in (0..1000).step_by(20) {
            let report = Report { task: 1, progress: Progress::Underway, distance: 1.0, ..Report::default() };
            desk.hear(&report);
            told += usize::from(desk.news(at(millis)).is_some());
        }
        assert_eq!(told, 5, "five times a second");
        desk.hear(&Report { task: 1, progress: Progress::Arrived, ..Report::default() });
        assert!(desk.news(at(1000)).is_some_and(|report| report.progress == Progress::Arrived));
        assert_eq!(desk.news(at(9000)), None);
    }
}
