//! A recording that was made: robots that roam among landmarks, with wheels and cameras that are wrong in known ways.
//!
//! | what | how wrong |
//! |---|---|
//! | ways, turns | each robot's own part, ± 6 % |
//! | curve | ± 0.1 rad/m, and 2.5 % of the way and 0.03 rad/√m of the turn by chance |
//! | range, bearing | 0.1 m and 2 % of the range, 0.01 rad and up to ± 0.015 rad of each camera; one of fifty ranges is wrong by up to 1 m |
//! | sight | 0.6 rad to either side, 6 m, three pictures a second, eight seconds of every minute blind |

use hardware::mrclam::{Mark, Member, Rates, Seen, Team};
use navigation::localisation::landmarks::Sighting;
use navigation::localisation::landmarks::sighting::seen_from;
use types::chance::Stream;
use types::geometry::{TAU, wrap};
use types::{Point, Pose, Time};

const ROBOTS: u32 = 5;
const LANDMARKS: u32 = 15;
/// Half the side of the ground (m).
const HALF: f64 = 5.0;
/// Steps a second, and every how many a pose of the truth and a picture are taken.
const RATE: u64 = 20;
const PICTURE: u64 = 7;
/// The wheels do what their rates say so many steps later, as those of the real ones.
const DELAY: usize = 4;

/// Robots for so many seconds.
pub(super) fn team(seed: u64, seconds: f64) -> Team {
    let stream = Stream::new(seed, "made team");
    let steps = (seconds * RATE as f64) as u64;
    let place = |number: u64| {
        let around = TAU * number as f64 / f64::from(LANDMARKS);
        Point::polar(HALF * stream.between(number, 0.6, 1.1), around)
    };
    let mark = |number: u32| Mark {
        subject: ROBOTS + 1 + number,
        at: place(u64::from(number)),
        deviation: [1e-4; 2],
    };
    let landmarks: Vec<Mark> = (0..LANDMARKS).map(mark).collect();
    let mut robots: Vec<Roamer> = (1..=ROBOTS).map(|subject| Roamer::new(seed, subject)).collect();
    for step in 0..steps {
        let poses: Vec<Pose> = robots.iter().map(|robot| robot.pose).collect();
        for robot in &mut robots {
            robot.go(step);
            if (step + u64::from(robot.member.subject)).is_multiple_of(PICTURE) {
                robot.look(step, &poses, &landmarks);
            }
        }
    }
    Team { robots: robots.into_iter().map(|robot| robot.member).collect(), landmarks }
}

struct Roamer {
    member: Member,
    pose: Pose,
    chance: Stream,
    /// Part of ways and turns that is not told, rad/m, and what the camera tells too much (rad).
    errors: [f64; 4],
    /// What was told and is not done yet (m/s, rad/s).
    waiting: [[f64; 2]; DELAY],
}

fn time(step: u64) -> Time {
    Time((step * 1_000_000_000 / RATE) as i64)
}

impl Roamer {
    fn new(seed: u64, subject: u32) -> Roamer {
        let chance = Stream::new(seed, "made robot").sample(u64::from(subject));
        let pose =
            Pose::new(f64::from(subject) - 3.0, chance.between(0, -2.0, 2.0), chance.between(1, -3.0, 3.0));
        let errors =
            [(2, 0.06), (3, 0.06), (4, 0.1), (5, 0.015)].map(|(n, most)| chance.between(n, -most, most));
        let member = Member { subject, truth: vec![(Time::ZERO, pose)], ..Member::default() };
        Roamer { member, pose, chance, errors, waiting: [[0.0; 2]; DELAY] }
    }

    /// Straight on, with a turn towards the middle near the edge, and one anywhere now and then.
    fn wish(&self, step: u64) -> [f64; 2] {
        let ahead = self.pose.position() + Point::polar(0.8, self.pose.heading);
        let home = wrap((Point::default() - self.pose.position()).bearing() - self.pose.heading);
        let whim = self.chance.sample(1_000_000 + step / 100);
        if ahead.norm() > HALF - 0.8 && home.abs() > 0.5 {
            [0.05, 0.4_f64.copysign(home)]
        } else if step % 100 < whim.index(0, 40) as u64 {
            [0.06, whim.between(1, -0.5, 0.5)]
        } else {
            [0.15, 0.0]
        }
    }

    fn go(&mut self, step: u64) {
        let [linear, angular] = self.wish(step);
        self.member.odometry.push(Rates { at: time(step), linear, angular });
        let [linear, angular] =
            core::mem::replace(&mut self.waiting[step as usize % DELAY], [linear, angular]);
        let dt = 1.0 / RATE as f64;
        let (a, b) = self.chance.sample(step).normals(0);
        let way = linear * dt;
        let turn = angular * dt * (1.0 + self.errors[1]) + self.errors[2] * way + 0.03 * a * way.abs().sqrt();
        self.pose = self.pose.along_arc(way * (1.0 + self.errors[0]) * (1.0 + 0.025 * b), turn);
        self.member.truth.push((time(step + 1), self.pose));
    }

    fn look(&mut self, step: u64, poses: &[Pose], landmarks: &[Mark]) {
        let second = step / RATE;
        if (second + 10 * u64::from(self.member.subject)) % 60 < 8 {
            return;
        }
        let others = poses.iter().zip(1..).filter(|(_, subject)| *subject != self.member.subject);
        let others = others.map(|(pose, subject)| (subject, pose.position()));
        let marks = landmarks.iter().map(|mark| (mark.subject, mark.at));
        let found: Vec<(u32, Sighting)> = others
            .chain(marks)
            .map(|(subject, at)| (subject, seen_from(self.pose, at)))
            .filter(|(_, seen)| seen.range < 6.0 && seen.range > 0.3 && seen.bearing.abs() < 0.6)
            .collect();
        for (subject, exact) in found {
            let chance = self.chance.sample(10_000_000 + step * 100 + u64::from(subject));
            let (a, b) = chance.normals(0);
            let wrong = if chance.uniform(2) < 0.02 { chance.between(3, -1.0, 1.0) } else { 0.0 };
            let range = exact.range + (0.1 + 0.02 * exact.range) * a + wrong;
            let bearing = exact.bearing + 0.01 * b + self.errors[3];
            // Of what was seen in the step the picture is at its end.
            let at = time(step + 1);
            self.member.seen.push(Seen { at, barcode: subject, subject: Some(subject), range, bearing });
        }
    }
}
