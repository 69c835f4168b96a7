//! Noticing that the robot is stuck, and getting it out: a few tries, then it is told.
//!
//! ```text
//!            stuck                     room behind used up, or time over
//!  ┌──────┐ ───────▶ ┌─────────┐ ─────────────────────────────────────▶ ┌─────────┐
//!  │ Free │          │ Backing │                                        │ Turning │
//!  └──────┘ ◀─┐      └─────────┘ ◀──┐ stuck, tries left                 └─────────┘
//!     ▲       │                     │                                        │
//!     │       │ far enough away  ┌──────────┐    turned, or time over        │
//!     │       └───────────────── │ Watching │ ◀──────────────────────────────┘
//!     │ reset                    └──────────┘
//!  ┌─────────┐   stuck, no try left   │
//!  │ GivenUp │ ◀──────────────────────┘
//!  └─────────┘
//! ```

use libm::{fabs, fmax, fmin};
use types::Pose;
use types::geometry::wrap;
use types::messages::Twist;

/// When the robot counts as stuck, and how it gets out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// It is stuck when it wished to move for so long (s) …
    pub patience: f64,
    /// … and came less far than this (m) …
    pub distance: f64,
    /// … and turned by less than this (rad).
    pub turned: f64,
    /// How many tries it has to get out.
    pub tries: u32,
    /// How far it backs off in one (m).
    pub back: f64,
    /// How fast (m/s), positive.
    pub back_speed: f64,
    /// Room that is left behind it (m).
    pub margin: f64,
    /// How far it turns then (rad): more each time by as much again, to one side and the other.
    pub turn: f64,
    /// How fast (rad/s).
    pub turn_rate: f64,
    /// How long each of the two may take (s).
    pub patience_out: f64,
    /// So far away from where it was stuck it is free again (m).
    pub freed: f64,
}

impl Default for Parameters {
    /// Stuck as in the driver of the Nearness Diagram in Player: 2 s, 0.25 m, 20°.
    ///
    /// Four tries look to both sides twice. 0.3 m back is a body's half, at 0.15 m/s, since few robots see well behind; 5 cm are left there.
    /// The first turn of 40° is more than a sector of a sonar. Half a metre away something else is around it.
    fn default() -> Parameters {
        Parameters {
            patience: 2.0,
            distance: 0.25,
            turned: 20.0 * types::geometry::PI / 180.0,
            tries: 4,
            back: 0.3,
            back_speed: 0.15,
            margin: 0.05,
            turn: 0.7,
            turn_rate: 0.8,
            patience_out: 3.0,
            freed: 0.5,
        }
    }
}

/// Notices that wished motion does not come.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stuck {
    /// When and where the last progress was made.
    since: Option<(f64, Pose)>,
}

impl Stuck {
    /// Nothing noticed yet.
    pub fn new() -> Stuck {
        Stuck::default()
    }

    /// Whether the robot is stuck at `now` (s) at `pose`, if it `wishes` to move. One that does not wish to is not stuck.
    pub fn step(&mut self, parameters: &Parameters, now: f64, pose: Pose, wishes: bool) -> bool {
        let (since, from) = *self.since.get_or_insert((now, pose));
        let progress = pose.position().distance(from.position()) >= parameters.distance
            || fabs(wrap(pose.heading - from.heading)) >= parameters.turned;
        if progress || !wishes {
            self.since = Some((now, pose));
            return false;
        }
        now - since >= parameters.patience
    }
}

/// What the escape is about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Phase {
    /// Others drive.
    #[default]
    Free,
    /// It backs off.
    Backing,
    /// It turns.
    Turning,
    /// Others drive again, and it looks whether that helps.
    Watching,
    /// All tries were of no use: it stands until it is reset.
    GivenUp,
}

/// What is around a robot that is stuck.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Room {
    /// Free way behind the body (m); nothing if that cannot be seen.
    pub behind: f64,
    /// The wider side: positive is left.
    pub wider: f64,
}

/// Gets a robot out that is stuck.
#[derive(Clone, Copy, Debug)]
pub struct Escape {
    parameters: Parameters,
    stuck: Stuck,
    phase: Phase,
    /// When the phase began, where, and how far the robot has to turn in it.
    began: (f64, Pose),
    /// Where it was stuck first.
    place: Pose,
    tries: u32,
    side: f64,
    turned: f64,
    last_heading: f64,
}

impl Escape {
    /// An escape that has nothing to do yet.
    pub fn new(parameters: Parameters) -> Escape {
        Escape {
            parameters,
            stuck: Stuck::new(),
            phase: Phase::Free,
            began: (0.0, Pose::default()),
            place: Pose::default(),
            tries: 0,
            side: 1.0,
            turned: 0.0,
            last_heading: 0.0,
        }
    }

    /// What it is about.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// How many tries it made since the robot was free.
    pub fn tries(&self) -> u32 {
        self.tries
    }

    /// Begins anew, after it has given up or with a new goal.
    pub fn reset(&mut self) {
        *self = Escape::new(self.parameters);
    }

    /// The motion to get out at `now` (s); nothing while others drive, who `wish` to move or not.
    pub fn step(&mut self, now: f64, pose: Pose, wish: bool, room: Room) -> Option<Twist> {
        match self.phase {
            Phase::Free | Phase::Watching => self.watch(now, pose, wish, room),
            Phase::Backing | Phase::Turning => {}
            Phase::GivenUp => return Some(Twist::ZERO),
        }
        if self.phase == Phase::Backing && self.is_backed(now, pose, room) {
            self.enter(Phase::Turning, now, pose);
        }
        if self.phase == Phase::Turning {
            self.turned += fabs(wrap(pose.heading - self.last_heading));
            self.last_heading = pose.heading;
            if self.turned >= self.wanted_turn() || now - self.began.0 >= self.parameters.patience_out {
                self.stuck = Stuck::new();
                self.enter(Phase::Watching, now, pose);
            }
        }
        let Parameters { back_speed, turn_rate, .. } = self.parameters;
        match self.phase {
            Phase::Backing => {
                // Slower where there is little room left.
                let left = fmax(room.behind - self.parameters.margin, 0.0);
                Some(Twist::new(-fmin(back_speed, 2.0 * left), 0.0))
            }
            Phase::Turning => Some(Twist::new(0.0, turn_rate * self.side)),
            Phase::GivenUp => Some(Twist::ZERO),
            Phase::Free | Phase::Watching => None,
        }
    }

    fn watch(&mut self, now: f64, pose: Pose, wish: bool, room: Room) {
        let away = pose.position().distance(self.place.position());
        if self.phase == Phase::Watching && away >= self.parameters.freed {
            (self.phase, self.tries) = (Phase::Free, 0);
        }
        if !self.stuck.step(&self.parameters, now, pose, wish) {
            return;
        }
        if self.tries >= self.parameters.tries {
            self.phase = Phase::GivenUp;
            return;
        }
        if self.tries == 0 {
            self.place = pose;
            self.side = if room.wider >= 0.0 { 1.0 } else { -1.0 };
        } else {
            self.side = -self.side;
        }
        self.tries += 1;
        self.enter(Phase::Backing, now, pose);
    }

    /// Farther each time.
    fn wanted_turn(&self) -> f64 {
        self.parameters.turn * f64::from(self.tries)
    }

    fn is_backed(&self, now: f64, pose: Pose, room: Room) -> bool {
        let (since, from) = self.began;
        room.behind <= self.parameters.margin + 0.01
            || pose.position().distance(from.position()) >= self.parameters.back
            || now - since >= self.parameters.patience_out
    }

    fn enter(&mut self, phase: Phase, now: f64, pose: Pose) {
        self.phase = phase;
        self.began = (now, pose);
        (self.turned, self.last_heading) = (0.0, pose.heading);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const STEP: f64 = 0.05;

    #[test]
    fn a_robot_is_stuck_after_two_seconds_within_a_quarter_of_a_metre_and_twenty_degrees() {
        let parameters = Parameters::default();
        let run = |speed: f64, rate: f64, wishes: bool| {
            let mut stuck = Stuck::new();
            (0..100)
                .map(|i| f64::from(i) * STEP)
                .find(|t| stuck.step(&parameters, *t, Pose::new(speed * t, 0.0, wrap(rate * t)), wishes))
        };
        assert!(run(0.0, 0.0, true).is_some_and(|at| fabs(at - 2.0) < 1e-9));
        assert_eq!(run(0.0, 0.0, false), None);
        // 0.25 m in 2 s are 0.125 m/s, 20° are 0.1745 rad/s.
        assert_eq!(run(0.13, 0.0, true), None);
        assert!(run(0.12, 0.0, true).is_some());
        assert_eq!(run(0.0, 0.18, true), None);
        assert!(run(0.0, 0.17, true).is_some());
    }

    /// Plays an escape in which the robot moves as it is told, and others never move it.
    fn play(parameters: Parameters, behind: f64, seconds: f64) -> (Escape, Pose, f64) {
        let mut escape = Escape::new(parameters);
        let mut pose = Pose::default();
        let mut farthest = 0.0f64;
        for i in 0..(seconds / STEP) as u32 {
            let room = Room { behind: behind - fmax(-pose.x, 0.0), wider: -0.5 };
            let twist = escape.step(f64::from(i) * STEP, pose, true, room).unwrap_or(Twist::ZERO);
            // Beside: only what is backed straight is limited by the room.
            pose = pose.advanced(twist.linear, twist.angular, STEP);
            farthest = farthest.max(-pose.x);
        }
        (escape, pose, farthest)
    }

    #[test]
    fn a_try_backs_off_and_turns_to_the_wider_side_and_then_lets_others_drive() {
        let (escape, pose, _) = play(Parameters::default(), 5.0, 2.0 + 2.1 + 1.0);
        assert_eq!((escape.phase(), escape.tries()), (Phase::Watching, 1));
        assert!(fabs(pose.x + 0.3) < 0.02 && pose.heading < -0.65 && pose.heading > -0.8, "{pose:?}");
    }

    #[test]
    fn it_gives_up_after_its_tries_and_stands_until_it_is_reset() {
        let parameters = Parameters { freed: 9.0, ..Parameters::default() };
        let (mut escape, pose, _) = play(parameters, 9.0, 120.0);
        assert_eq!((escape.phase(), escape.tries()), (Phase::GivenUp, 4));
        assert_eq!(escape.step(121.0, pose, true, Room::default()), Some(Twist::ZERO));
        escape.reset();
        assert_eq!(escape.step(122.0, pose, true, Room::default()), None);
    }

    #[test]
    fn a_robot_that_gets_away_has_all_its_tries_again() {
        let mut escape = Escape::new(Parameters::default());
        let mut pose = Pose::default();
        for i in 0..400 {
            let now = f64::from(i) * STEP;
            let room = Room { behind: 1.0, wider: 1.0 };
            match escape.step(now, pose, true, room) {
                Some(twist) => pose = pose.advanced(twist.linear, twist.angular, STEP),
                None if escape.tries() == 1 => pose = pose.advanced(0.3, 0.0, STEP),
                None => {}
            }
            if escape.tries() == 0 && i > 100 {
                assert_eq!(escape.phase(), Phase::Free);
                return;
            }
        }
        panic!("it never counted as free: {escape:?}");
    }

    proptest! {
        #[test]
        fn it_never_backs_into_what_is_behind(behind in 0f64..0.5) {
            let (_, _, farthest) = play(Parameters { tries: 1, ..Parameters::default() }, behind, 8.0);
            prop_assert!(farthest <= fmax(behind - 0.04, 0.0) + 1e-9, "{farthest} of {behind}");
        }
    }
}
