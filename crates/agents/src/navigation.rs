//! The navigation module: takes goals, manoeuvres and walls of people and programs, makes tasks of them, and tells what becomes of them.
//!
//! ```text
//!  go, drive, wall, halt ──▶ is that possible? ──▶ task ──▶ process supervisor ──▶ real-time supervisor ──▶ actions
//!                                                  └────▶ path planner
//!  pose of the localizer, path of the planner ──▶ no way, for too long? ──▶ halt
//!  status of the real-time supervisor ──▶ report
//! ```

use runtime::{Agent, Fault, Input, Output, Service, Step};
use types::messages::{
    Answer, Goal, Halt, Manoeuvre, Motion, Odometry, Path, Progress, Report, Task, WallWish,
};
use types::params::Params;
use types::{Duration, Name, Pose, Time};

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
    /// A place farther away than this is a slip of the one who asks (m).
    #[param(default = 1000.0, min = 1.0, max = 100000.0)]
    pub farthest: f64,
}

/// Takes goals and manoeuvres, gives tasks, and tells what becomes of them.
#[derive(Agent)]
#[agent(kind = "navigation")]
pub struct Navigation {
    /// To a place, as in sinew call navigation.go x=3 y=1; turned=true heading=1.57 for the heading at the end, dock=true for a centimetre; mode=path along a planned way, mode=move straight and by the wheels alone.
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
    /// What becomes of it: when that changes, and every 200 ms while it is being done.
    #[port(history = 64)]
    report: Output<Report>,
    params: NavigationParams,
    desk: Desk,
}

impl Agent for Navigation {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        let now = step.now;
        if let Some(pose) = self.pose.newest() {
            self.desk.pose = Some((pose.pose, pose.header().stamp));
        }
        let located = !self.pose.is_wired() || self.desk.is_located(now);
        while let Some((goal, call)) = self.go.take() {
            let made = if located { self.desk.goal(&self.params, &goal, now) } else { Err(LOST) };
            let answer = self.begin(made);
            self.go.answer(&call, answer);
        }
        while let Some((manoeuvre, call)) = self.drive.take() {
            let made = self.desk.manoeuvre(&self.params, &manoeuvre);
            let answer = self.begin(made);
            self.drive.answer(&call, answer);
        }
        while let Some((wish, call)) = self.wall.take() {
            let made = self.desk.wall(&self.params, &wish);
            let answer = self.begin(made);
            self.wall.answer(&call, answer);
        }
        while let Some((_, call)) = self.halt.take() {
            let task = self.desk.stand();
            self.task.send(task);
            let why = "it ramps down and stands".into();
            self.halt.answer(&call, Answer { accepted: true, task: task.number, why });
        }
        while let Some(path) = self.path.take() {
            self.desk.planned(path.found, now);
        }
        if self.desk.has_no_way(&self.params, now) {
            runtime::note!("no way to the goal: given up");
            let task = self.desk.stand();
            self.desk.ended = Some(Progress::Unreachable);
            self.task.send(task);
        }
        while let Some(refused) = self.refused.take() {
            self.desk.hear(&refused);
        }
        while let Some(status) = self.status.take() {
            self.desk.hear(&status);
        }
        if let Some(report) = self.desk.news(now) {
            self.report.send(report);
        }
        Ok(())
    }
}

impl Navigation {
    fn begin(&mut self, made: Result<Task, &'static str>) -> Answer {
        match made {
            Ok(task) => {
                self.task.send(task);
                Answer { accepted: true, task: task.number, why: task.mode.as_str().into() }
            }
            Err(why) => Answer { why: why.into(), ..Answer::default() },
        }
    }
}

const LOST: &str = "the robot does not know where it is: the localizer gives no pose";
/// A pose older than this is none: the localizer gives five a second.
const POSE_AGE: Duration = Duration::secs(1);
/// While a task is being done it is told so often how far it has come.
const TELL_EVERY: Duration = Duration::millis(200);

/// What was asked last and what became of it.
#[derive(Clone, Copy, Debug, Default)]
struct Desk {
    count: u32,
    task: Task,
    report: Report,
    /// How it ended, where it was this agent that ended it.
    ended: Option<Progress>,
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

    fn goal(&mut self, params: &NavigationParams, goal: &Goal, now: Time) -> Result<Task, &'static str> {
        let Goal { x, y, heading, turned, dock, speed, seconds, mode } = *goal;
        if ![x, y, heading, speed, seconds].iter().all(|number| number.is_finite()) {
            return Err("a goal is made of numbers");
        }
        if speed < 0.0 || seconds < 0.0 {
            return Err("speed and seconds are positive, or zero for the robot's own");
        }
        let here = self.pose.map_or(Pose::default(), |(pose, _)| pose);
        if here.position().distance(types::Point::new(x, y)) > params.farthest {
            return Err("the goal is farther away than the parameter \"farthest\" allows");
        }
        let usual = if dock { params.dock_mode } else { params.goto_mode };
        let mode = if mode.is_empty() { usual } else { mode };
        let motion = match dock {
            true => Motion::Dock,
            false if mode == params.path_mode => Motion::Path,
            false if mode == params.move_mode => Motion::To,
            false => Motion::Goto,
        };
        self.no_way = (motion == Motion::Path).then_some(now);
        Ok(self.begin(Task {
            mode,
            motion,
            frame: params.frame,
            target: Pose { x, y, heading },
            turned: turned || dock,
            linear: speed,
            seconds: if seconds > 0.0 { seconds } else { params.within.seconds() },
            ..Task::default()
        }))
    }

    fn manoeuvre(&mut self, params: &NavigationParams, wish: &Manoeuvre) -> Result<Task, &'static str> {
        let Manoeuvre { linear, angular, seconds, distance, angle } = *wish;
        if ![linear, angular, seconds, distance, angle].iter().all(|number| number.is_finite()) {
            return Err("a manoeuvre is made of numbers");
        }
        let motion = match (seconds != 0.0, distance != 0.0, angle != 0.0) {
            (true, false, false) if seconds > 0.0 => Motion::Velocity,
            (true, false, false) => return Err("seconds are positive"),
            (false, true, false) => Motion::Distance,
            (false, false, true) => Motion::Turn,
            (false, false, false) => return Err("say one of seconds, distance or angle"),
            _ => return Err("seconds, distance and angle are three manoeuvres: say one"),
        };
        self.no_way = None;
        let within = if motion == Motion::Velocity { seconds } else { params.within.seconds() };
        let mode = params.move_mode;
        Ok(self.begin(Task {
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

    fn wall(&mut self, params: &NavigationParams, wish: &WallWish) -> Result<Task, &'static str> {
        let WallWish { side, distance, speed, seconds } = *wish;
        if ![distance, speed, seconds].iter().all(|number| number.is_finite() && *number >= 0.0) {
            return Err("distance, speed and seconds are positive, or zero for the robot's own");
        }
        let left = match side.as_str() {
            "" | "left" => true,
            "right" => false,
            _ => return Err("the side of a wall is \"left\" or \"right\""),
        };
        self.no_way = None;
        Ok(self.begin(Task {
            mode: params.wall_mode,
            motion: Motion::Wall,
            linear: speed,
            distance,
            left,
            seconds: if seconds > 0.0 { seconds } else { params.within.seconds() },
            ..Task::default()
        }))
    }

    fn begin(&mut self, task: Task) -> Task {
        self.count += 1;
        self.task = Task { number: self.count, ..task };
        self.report = Report { task: self.count, progress: Progress::Underway, ..Report::default() };
        (self.ended, self.confirmed) = (None, false);
        self.task
    }

    /// The task that ends the present one.
    fn stand(&mut self) -> Task {
        self.no_way = None;
        if self.report.progress == Progress::Underway {
            self.ended = Some(Progress::Halted);
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
        }
    }

    /// What is to be told now.
    fn news(&mut self, now: Time) -> Option<Report> {
        if let Some(ended) = self.ended {
            self.report.progress = ended;
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

    #[test]
    fn goals_and_manoeuvres_become_tasks_that_count_up() {
        let (params, mut desk) = (NavigationParams::default(), Desk::default());
        let first = desk.goal(&params, &goal(3.0, 1.0), at(0)).unwrap();
        assert_eq!((first.number, first.motion, first.mode.as_str()), (1, Motion::Goto, "goto+avoid"));
        assert_eq!((first.target.x, first.seconds, first.turned), (3.0, 300.0, false));
        let path = Goal { mode: "path".into(), seconds: 20.0, ..goal(3.0, 1.0) };
        let second = desk.goal(&params, &path, at(0)).unwrap();
        assert_eq!((second.number, second.motion, second.seconds), (2, Motion::Path, 20.0));
        let dock = desk.goal(&params, &Goal { dock: true, ..goal(1.0, 1.0) }, at(0)).unwrap();
        assert_eq!((dock.motion, dock.turned, dock.mode.as_str()), (Motion::Dock, true, "goto"));
        let to = desk.goal(&params, &Goal { mode: "move".into(), ..goal(1.0, 1.0) }, at(0)).unwrap();
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
        let refused = |goal| Desk::default().goal(&params, &goal, at(0)).unwrap_err();
        assert!(refused(goal(f64::NAN, 0.0)).contains("numbers"));
        assert!(refused(goal(2000.0, 0.0)).contains("farther"));
        assert!(refused(Goal { speed: -0.1, ..goal(1.0, 0.0) }).contains("positive"));
        let drive = |wish| Desk::default().manoeuvre(&params, &wish).unwrap_err();
        let wish = Manoeuvre::default();
        let wall = |wish| Desk::default().wall(&params, &wish).unwrap_err();
        assert!(wall(WallWish { side: "above".into(), ..WallWish::default() }).contains("\"left\" or"));
        assert!(wall(WallWish { distance: -1.0, ..WallWish::default() }).contains("positive"));
        assert!(drive(wish).contains("say one of"));
        assert!(drive(Manoeuvre { distance: 1.0, angle: 1.0, ..wish }).contains("say one"));
        assert!(drive(Manoeuvre { seconds: -1.0, ..wish }).contains("positive"));
        assert!(drive(Manoeuvre { linear: f64::INFINITY, seconds: 1.0, ..wish }).contains("numbers"));
    }

    #[test]
    fn a_goal_without_a_way_is_given_up_after_a_while_and_told_once() {
        let (params, mut desk) = (NavigationParams::default(), Desk::default());
        let path = Goal { mode: "path".into(), ..goal(3.0, 1.0) };
        desk.goal(&params, &path, at(0)).unwrap();
        desk.planned(true, at(500));
        desk.planned(false, at(1000));
        assert!(!desk.has_no_way(&params, at(6000)));
        desk.planned(true, at(6000));
        desk.planned(false, at(7000));
        desk.planned(false, at(12000));
        assert!(desk.has_no_way(&params, at(12001)), "since 7 s");
        let stand = desk.stand();
        desk.ended = Some(Progress::Unreachable);
        assert_eq!((stand.number, stand.mode.as_str()), (0, IDLE));
        assert_eq!(desk.news(at(12001)).map(|report| report.progress), Some(Progress::Unreachable));
        desk.hear(&Report { task: 1, progress: Progress::Halted, ..Report::default() });
        assert_eq!(desk.news(at(13000)), None, "that it stands now is no news of the task");
    }

    #[test]
    fn a_task_that_the_real_time_side_drops_is_halted_and_one_that_it_has_not_yet_is_not() {
        let (params, mut desk) = (NavigationParams::default(), Desk::default());
        desk.goal(&params, &goal(3.0, 1.0), at(0)).unwrap();
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
        desk.goal(&params, &goal(3.0, 1.0), at(0)).unwrap();
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
