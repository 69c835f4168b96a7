//! What the actions of the reactive layer share: what they are to do, and where the robot is.

use motion::kinematics::Differential;
use motion::limits::Limits;
use runtime::Input;
use types::geometry::wrap;
use types::messages::{Mode, Odometry, Offer, Report, Task, Twist};
use types::{Duration, Point, Pose, Text, Time};

use crate::odometry::ODOM;

/// How long an offer of an action holds: five of its steps at 50 Hz.
pub(crate) const OFFER_HOLDS: Duration = Duration::millis(100);
/// The longest time between two steps that counts as one (s).
const LONGEST_STEP: f64 = 0.1;

/// What an action is to do.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Duty {
    mode: Option<Mode>,
    task: Task,
    /// The number and the start of the task on which it works.
    begun: Option<(u32, Time)>,
    last: Option<Time>,
}

impl Duty {
    /// Takes over what is new.
    pub(crate) fn listen(&mut self, mode: &mut Input<Mode>, task: &mut Input<Task>) {
        self.mode = mode.latest().or(self.mode);
        self.task = task.latest().unwrap_or(self.task);
    }

    #[cfg(test)]
    pub(crate) fn of(mode: Mode, task: Task) -> Duty {
        Duty { mode: Some(mode), task, ..Duty::default() }
    }

    /// The task, where there is one and the mode names the agent.
    pub(crate) fn task(&self, own: &str) -> Option<Task> {
        let mode = self.mode.as_ref()?;
        let is_mine = mode.name == self.task.mode && mode.row(own).is_some();
        (is_mine && self.task.number > 0).then_some(self.task)
    }

    /// Whether the mode names others, too.
    pub(crate) fn is_shared(&self) -> bool {
        self.mode.as_ref().is_some_and(|mode| mode.rows.len() > 1)
    }

    /// Whether the task is another than at the last step; notes that it has begun.
    pub(crate) fn is_new(&mut self, task: Option<&Task>, now: Time) -> bool {
        let number = task.map(|task| task.number);
        if number == self.begun.map(|(number, _)| number) {
            return false;
        }
        self.begun = number.map(|number| (number, now));
        number.is_some()
    }

    /// For how long the task has been done (s).
    pub(crate) fn seconds(&self, now: Time) -> f64 {
        self.begun.map_or(0.0, |(_, since)| (now - since).seconds())
    }

    /// The time since the last step (s), as control laws take it.
    pub(crate) fn dt(&mut self, now: Time) -> f64 {
        self.last.replace(now).map_or(0.0, |last| (now - last).seconds().min(LONGEST_STEP))
    }
}

/// An offer to drive so.
pub(crate) fn offer(twist: Twist, now: Time) -> Offer {
    Offer { twist, weight: 1.0, valid_until: now + OFFER_HOLDS, ..Offer::default() }
}

/// What an action that has nothing to do tells: that it is there.
pub(crate) const NOTHING: Report = Report {
    task: 0,
    progress: types::messages::Progress::Idle,
    distance: 0.0,
    angle: 0.0,
    seconds: 0.0,
    why: Text::EMPTY,
};

/// Why a task ends for which the robot cannot say where on the map it is.
pub(crate) const NO_POSE: &str =
    "the localizer gives no pose: the robot does not know where on the map it is";
/// Why a task ends with which the robot does not get on.
pub(crate) const HELD: &str =
    "it wishes to drive and gets nowhere: something holds it, or its latch is set (then: sinew reset)";
/// Why a task ends that takes too long.
pub(crate) const TOO_LONG: &str = "it took longer than it may";

/// A robot that is so far from where it was has got on (m, rad).
const GOT_ON: (f64, f64) = (0.1, 0.3);

/// Whether the robot gets on when it wishes to.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Held {
    /// Where it was last that it got on, by the wheels.
    at: Option<Pose>,
    /// How long ago that is (s).
    since: f64,
}

impl Held {
    /// For how long it has wished to drive and got nowhere (s).
    pub(crate) fn see(&mut self, odometry: Pose, wishes: bool, dt: f64) -> f64 {
        let at = *self.at.get_or_insert(odometry);
        let moved = at.position().distance(odometry.position()) > GOT_ON.0
            || wrap(odometry.heading - at.heading).abs() > GOT_ON.1;
        self.since = if moved || !wishes { 0.0 } else { self.since + dt };
        if moved {
            self.at = Some(odometry);
        }
        self.since
    }
}

/// Within this of its heading a robot has it (rad). One degree.
const ALIGNED: f64 = 0.0175;
/// Turn rate for a radian that is left (1/s): it bears a lag of 0.2 s without swinging.
const ALIGN_GAIN: f64 = 1.5;
/// So long nothing must have been ordered before it counts as standing (s): some lags of the drive.
const STILL: f64 = 0.3;

/// The turn on the spot to the heading of a task, at the end of its way.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Aligning {
    rate: f64,
    still: f64,
}

impl Aligning {
    /// The turn rate (rad/s) where so much is left to turn (rad), within the highest rate and its highest change; nothing once it is there and stands.
    pub(crate) fn step(&mut self, left: f64, (rate, change): (f64, f64), dt: f64) -> Option<f64> {
        let off = left.abs();
        let wish = (ALIGN_GAIN * off).min(libm::sqrt(2.0 * change * off)).min(rate);
        let wish = if off > ALIGNED { libm::copysign(wish, left) } else { 0.0 };
        self.rate += (wish - self.rate).clamp(-change * dt, change * dt);
        self.still = if self.rate == 0.0 { self.still + dt } else { 0.0 };
        (off > ALIGNED || self.still < STILL).then_some(self.rate)
    }
}

/// What is left to the heading of a task that asks for one, to the left (rad), where it leads to `target` and the robot is at `here`.
pub(crate) fn turn_left(task: &Task, target: Pose, here: Pose) -> f64 {
    if task.turned { wrap(target.heading - here.heading) } else { 0.0 }
}

/// Where the robot is, by its wheels and by a localizer.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Whereabouts {
    /// By the wheels, now.
    pub(crate) odometry: Option<Odometry>,
    /// The pose of odometry's frame on the map, by the last pose of the localizer.
    pub(crate) map_from_odometry: Option<Pose>,
    /// When that pose was true.
    pub(crate) corrected: Option<Time>,
    /// Whether it is new in this step.
    pub(crate) is_news: bool,
}

impl Whereabouts {
    /// Takes over what is new. The wheels' pose is predicted to `now`; that of the localizer counts at its own time.
    pub(crate) fn listen(&mut self, odometry: &mut Input<Odometry>, pose: &mut Input<Odometry>, now: Time) {
        self.is_news = false;
        if let Some(newest) = odometry.latest() {
            self.odometry = Some(newest);
        }
        if self.odometry.is_some() {
            self.odometry = odometry.at(now).map(|found| found.value()).or(self.odometry);
        }
        let Some(received) = pose.newest() else { return };
        let (found, stamp) = (received.pose, received.header().stamp);
        if received.frame.as_str() == ODOM {
            return;
        }
        if let Some(then) = odometry.at(stamp).map(|found| found.value().pose) {
            self.correct(found, then, stamp);
        }
    }

    /// Where a task leads, in the frame of the wheels; nothing without a task, or where nobody knows where the map is.
    pub(crate) fn target(&self, task: &Task) -> Option<Pose> {
        match task.frame.as_str() {
            _ if task.number == 0 => None,
            ODOM => Some(task.target),
            _ => Some(self.map_from_odometry?.inverse().then(task.target)),
        }
    }

    /// The place of it.
    pub(crate) fn goal(&self, task: &Task) -> Option<Point> {
        self.target(task).map(Pose::position)
    }

    fn correct(&mut self, map: Pose, odometry: Pose, stamp: Time) {
        self.map_from_odometry = Some(map.then(odometry.inverse()));
        self.corrected = Some(stamp);
        self.is_news = true;
    }
}

/// Limits of an action's own, for a drive of which it knows no wheels.
pub(crate) fn limits(
    linear_max: f64,
    angular_max: f64,
    acceleration: f64,
    angular_acceleration: f64,
) -> Limits {
    Limits {
        linear_max,
        backward_max: linear_max,
        angular_max,
        acceleration,
        deceleration: acceleration,
        angular_acceleration,
        // The drive behind it knows its wheels.
        wheel_max: 1e6,
        drive: Differential::new(0.1, 0.4),
    }
}

/// The lower of a task's own bound and what an action has for itself; zero is no bound.
pub(crate) fn bounded(own: f64, asked: f64) -> f64 {
    if asked > 0.0 { own.min(asked) } else { own }
}

#[cfg(test)]
mod tests {
    use super::*;
    use types::messages::ModeRow;

    #[test]
    fn a_task_is_done_in_its_mode_by_whom_the_mode_names() {
        let row = ModeRow { agent: "goto".into(), weight: 1.0, priority: 0 };
        let mode = Mode { name: "goto".into(), rows: [row].into_iter().collect(), ..Mode::default() };
        let task = Task { number: 3, mode: "goto".into(), ..Task::default() };
        let mut duty = Duty::of(mode, task);
        assert_eq!(duty.task("goto"), Some(task));
        assert_eq!(duty.task("avoid"), None, "not named");
        assert_eq!(Duty::of(mode, Task { mode: "move".into(), ..task }).task("goto"), None, "another mode");
        assert_eq!(Duty::of(mode, Task { number: 0, ..task }).task("goto"), None, "no task");
        let now = Time::from_seconds(1.0);
        assert!(duty.is_new(Some(&task), now) && !duty.is_new(Some(&task), now));
        assert!(duty.is_new(Some(&Task { number: 4, ..task }), now) && !duty.is_new(None, now));
        assert!(duty.is_new(Some(&task), now), "after a pause it begins again");
    }

    #[test]
    fn who_turns_to_a_heading_stands_there_within_a_degree() {
        for wanted in [-3.0, -0.5, 0.01, 1.0, 3.0] {
            let (mut aligning, mut heading, mut steps, mut fastest) = (Aligning::default(), 0.0, 0, 0.0_f64);
            while let Some(rate) = aligning.step(wrap(wanted - heading), (1.0, 3.0), 0.05) {
                (heading, steps, fastest) = (heading + 0.05 * rate, steps + 1, fastest.max(rate.abs()));
                assert!(steps < 400, "{wanted}: {heading}");
            }
            assert!((wanted - heading).abs() <= ALIGNED && fastest <= 1.0, "{wanted}: {heading}, {fastest}");
        }
    }

    #[test]
    fn who_wishes_to_drive_and_gets_nowhere_is_held() {
        let mut held = Held::default();
        let at = |x| Pose::new(x, 0.0, 0.0);
        assert_eq!(held.see(at(0.0), true, 0.5), 0.5);
        assert_eq!(held.see(at(0.05), true, 0.5), 1.0, "so little is the noise of wheels");
        assert_eq!(held.see(at(0.2), true, 0.5), 0.0);
        assert_eq!(held.see(at(0.2), false, 0.5), 0.0);
        assert_eq!(held.see(at(0.2), true, 0.5), 0.5);
    }

    #[test]
    fn a_late_pose_of_the_localizer_puts_odometry_right_where_it_was_then() {
        let mut place = Whereabouts::default();
        // Odometry began at (2, 1) of the map, looking up. At the time of the pose it had driven 1 m.
        place.correct(Pose::new(2.0, 2.0, types::geometry::PI / 2.0), Pose::new(1.0, 0.0, 0.0), Time::ZERO);
        let now = place.map_from_odometry.unwrap().then(Pose::new(1.5, 0.2, 0.0));
        assert!((now.x - 1.8).abs() < 1e-12 && (now.y - 2.5).abs() < 1e-12, "{now:?}");
    }
}
