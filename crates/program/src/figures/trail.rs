//! What figures need of a log, taken from it message by message.

use std::collections::BTreeMap;

use record::figure::{Band, Drawing, Event};
use record::log::{Message, RunInfo};
use types::cdr::Reader;
use types::message::Message as Typed;
use types::messages::{Decision, Echoes, Grant, LaserScan, Odometry, Report, Task, Transforms, Twist};
use types::{Point, Pose, Time};

use super::TaskOutcome;
use super::scenery::{self, KnownRobot};
use crate::run::WORLD;

/// Of a robot: where it was, what it measured, what it was told.
#[derive(Clone, Debug, Default)]
pub(super) struct Seen {
    pub(super) name: String,
    /// Where it truly was, in the world.
    pub(super) way: Vec<(f64, Pose)>,
    /// Where its log says that it was.
    pub(super) log_way: Vec<(f64, Pose)>,
    /// Where it believed to be.
    pub(super) odometry: Vec<(f64, Pose)>,
    /// Time, speed and turn rate: true, or as the recording has them.
    pub(super) speed: Vec<(f64, f64, f64)>,
    /// The same as commanded.
    pub(super) commanded: Vec<(f64, f64, f64)>,
    /// Where its sensors saw something, in the world.
    pub(super) points: Cloud,
    /// The sensor that saw it.
    pub(super) points_name: &'static str,
    /// Where the laser saw something, from the log's own poses, or where there are none by odometry.
    pub(super) scan_points: Cloud,
}

/// What figures need of a log.
#[derive(Debug, Default)]
pub(super) struct Trail {
    pub(super) drawing: Drawing,
    pub(super) robots: BTreeMap<String, Seen>,
    /// The ways of people.
    pub(super) people: BTreeMap<String, Vec<Point>>,
    /// When who began to have the say.
    says: Vec<(f64, String)>,
    pub(super) events: Vec<Event>,
    /// When each agent sent something.
    pub(super) sent: BTreeMap<String, Vec<f64>>,
    /// When each agent missed a deadline.
    pub(super) misses: BTreeMap<String, Vec<f64>>,
    /// From when on each agent was suspended, or was not any more.
    pub(super) rest: BTreeMap<String, Vec<(f64, bool)>>,
    /// How tasks ended, in the order of their ends.
    pub(super) tasks: Vec<TaskOutcome>,
    /// The first and the last time.
    pub(super) span: Option<(f64, f64)>,
    /// The tasks, by their numbers.
    asked: BTreeMap<u32, Task>,
    known: Vec<KnownRobot>,
    begun: Option<Time>,
    /// Where the laser sits on the robot.
    laser: Pose,
}

/// More points than this make a figure heavy and not clearer.
const MOST_POINTS: usize = 60_000;
/// So many points of the ring of sonars show a room and do not cover it.
pub(super) const SHOWN_POINTS: usize = 2_500;
/// Commands nearer to each other than this run into one line (s).
const COMMANDS: f64 = 0.04;
/// A band shorter than this cannot be seen (s).
const SHORTEST: f64 = 0.3;
/// A person who moved less than this stands (m).
const STANDS: f64 = 0.3;
/// Radius of a person as drawn (m): from above, with the arms.
const PERSON: f64 = 0.25;
/// More events than this cannot be explained below a figure.
const MOST_EVENTS: usize = 12;

pub(super) fn decode<T: Typed>(message: &Message) -> Option<(T, Vec<T::Element>)> {
    let mut row = Vec::new();
    let head = T::decode(&mut Reader::new(&message.cdr).ok()?, &mut row).ok()?;
    Some((head, row))
}

impl Seen {
    /// The same in a part of the run; what was seen of the surroundings stays.
    pub(super) fn within(&self, (from, until): (f64, f64)) -> Seen {
        let is_part = |time: f64| (from..=until).contains(&time);
        let ways = |way: &[(f64, Pose)]| way.iter().filter(|row| is_part(row.0)).copied().collect();
        let rows = |rows: &[(f64, f64, f64)]| rows.iter().filter(|row| is_part(row.0)).copied().collect();
        Seen {
            way: ways(&self.way),
            log_way: ways(&self.log_way),
            odometry: ways(&self.odometry),
            speed: rows(&self.speed),
            commanded: rows(&self.commanded),
            ..self.clone()
        }
    }
}

impl Trail {
    pub(super) fn new(run: &RunInfo) -> Trail {
        Trail {
            drawing: scenery::drawing(&run.notes),
            known: scenery::robots(&run.notes),
            ..Trail::default()
        }
    }

    pub(super) fn radius(&self, robot: &str) -> f64 {
        self.known.iter().find(|known| known.name == robot).map_or(0.225, |known| known.radius)
    }

    /// The corners of a robot's body around it (m); none of a round one.
    pub(super) fn outline(&self, robot: &str) -> Vec<Point> {
        self.known
            .iter()
            .find(|known| known.name == robot)
            .map_or_else(Vec::new, |known| known.outline.clone())
    }

    fn is_robot(&self, name: &str) -> bool {
        self.known.iter().any(|known| known.name == name)
    }

    /// Who had the say when.
    pub(super) fn bands(&self) -> Vec<Band> {
        let end = self.span.map_or(0.0, |span| span.1);
        let ends = self.says.iter().skip(1).map(|(time, _)| *time).chain([end]);
        let mut bands: Vec<Band> = Vec::new();
        for ((from, agent), to) in self.says.iter().zip(ends) {
            match bands.last_mut() {
                // What is too short to be seen belongs to who had the say before, and so does what follows of the same.
                Some(last) if to - from < SHORTEST || last.agent == *agent => last.to = to,
                None if to - from < SHORTEST => {}
                _ => bands.push(Band { from: *from, to, agent: agent.clone() }),
            }
        }
        bands
    }

    /// The ways of the people who walked; those who stand become part of the drawing.
    pub(super) fn settle(&mut self) {
        let people = std::mem::take(&mut self.people);
        for (name, way) in people {
            let Some(first) = way.first().copied() else { continue };
            if way.iter().any(|at| at.distance(first) > STANDS) {
                self.people.insert(name, way);
            } else {
                self.drawing.circles.push((first, PERSON));
            }
        }
    }

    /// Takes in a message; what no figure needs is passed over.
    pub(super) fn take(&mut self, message: &Message) {
        let begun = *self.begun.get_or_insert(message.time);
        // Simulated time is counted from zero whatever the first message.
        let time = if begun.0 < ONE_DAY { message.time.seconds() } else { (message.time - begun).seconds() };
        let span = self.span.get_or_insert((time, time));
        *span = (span.0.min(time), span.1.max(time));
        let topic = message.channel.topic.clone();
        let Some((agent, port)) = topic.strip_prefix('/').and_then(|topic| topic.split_once('/')) else {
            match topic.as_str() {
                record::log::ROSOUT => self.note(time, message),
                "/tf" => self.mounts(message),
                _ => {}
            }
            return;
        };
        if agent == "truth" {
            self.truth(time, port, message);
            return;
        }
        self.sent.entry(agent.to_owned()).or_default().push(time);
        match &*message.channel.definition {
            Decision::NAME => self.decision(time, message),
            Echoes::NAME if self.is_robot(agent) => self.echoes(agent, message),
            LaserScan::NAME if self.is_robot(agent) && port == "scan" => self.scan(agent, message),
            Odometry::NAME => self.odometry(time, agent, port, message),
            Twist::NAME => self.command(time, &topic, message),
            Report::NAME => self.report(time, message),
            Task::NAME => self.task(message),
            Grant::NAME => {
                if let Some((grant, _)) = decode::<Grant>(message) {
                    let name = grant.agent.as_str().to_owned();
                    self.rest.entry(name).or_default().push((time, grant.suspended));
                }
            }
            _ => {}
        }
    }

    fn robot(&mut self, name: &str) -> &mut Seen {
        let seen = self.robots.entry(name.to_owned()).or_default();
        if seen.name.is_empty() {
            seen.name = name.to_owned();
            seen.points_name = "sonar";
        }
        seen
    }

    fn truth(&mut self, time: f64, name: &str, message: &Message) {
        let Some((odometry, _)) = decode::<Odometry>(message) else { return };
        debug_assert_eq!(odometry.frame.as_str(), WORLD);
        if self.is_robot(name) {
            let seen = self.robot(name);
            seen.way.push((time, odometry.pose));
            seen.speed.push((time, odometry.twist.linear, odometry.twist.angular));
        } else {
            self.people.entry(name.to_owned()).or_default().push(odometry.pose.position());
        }
    }

    fn decision(&mut self, time: f64, message: &Message) {
        let Some((decision, _)) = decode::<Decision>(message) else { return };
        let active = decision.active.as_str();
        let active = if active.is_empty() { decision.situation.as_str() } else { active };
        if self.says.last().is_none_or(|(_, last)| last != active) {
            self.says.push((time, active.to_owned()));
        }
    }

    fn echoes(&mut self, robot: &str, message: &Message) {
        let Some((ring, _)) = decode::<Echoes>(message) else { return };
        let seen = self.robot(robot);
        let Some((_, pose)) = seen.way.last().copied() else { return };
        let far = ring.range_max - 0.01;
        for echo in ring.echoes.iter().filter(|echo| echo.range.is_finite() && echo.range < far.min(NEAR)) {
            let place = Pose::new(echo.x.into(), echo.y.into(), echo.bearing.into());
            let at = pose.then(place).transform(Point::new(echo.range.into(), 0.0));
            seen.points.add(at);
        }
    }

    /// Where the laser sits. A scan does not say it.
    fn mounts(&mut self, message: &Message) {
        let Some((_, edges)) = decode::<Transforms>(message) else { return };
        if let Some(edge) = edges.iter().find(|edge| edge.child.as_str() == hardware::description::LASER) {
            self.laser = edge.pose;
        }
    }

    fn scan(&mut self, robot: &str, message: &Message) {
        let Some((scan, ranges)) = decode::<LaserScan>(message) else { return };
        let mount = self.laser;
        let seen = self.robot(robot);
        let last = |way: &[(f64, Pose)]| way.last().map(|(_, pose)| *pose);
        let truth = last(&seen.way);
        let believed = if seen.log_way.is_empty() { last(&seen.odometry) } else { last(&seen.log_way) };
        let Some(pose) = truth.or(believed) else { return };
        let far = scan.range_max - 0.01;
        for (i, range) in ranges.iter().enumerate() {
            if !range.is_finite() || *range <= scan.range_min.max(0.02) || *range >= far {
                continue;
            }
            let bearing = f64::from(scan.angle_min) + i as f64 * f64::from(scan.angle_step);
            let at = pose.then(mount).transform(Point::polar(f64::from(*range), bearing));
            match truth {
                Some(_) => seen.points.add(at),
                None => seen.scan_points.add(at),
            }
        }
        if truth.is_some() {
            seen.points_name = "laser";
        }
    }

    fn odometry(&mut self, time: f64, agent: &str, port: &str, message: &Message) {
        let Some((odometry, _)) = decode::<Odometry>(message) else { return };
        if self.is_robot(agent) && port == "pose" {
            let seen = self.robot(agent);
            // Many recordings tell where the robot was and not how fast: that is the way between two poses.
            if let Some((before, last)) =
                seen.log_way.last().copied().filter(|(before, _)| time - before > 1e-3)
            {
                let (span, way) = (time - before, last.inverse().then(odometry.pose));
                seen.speed.push((time, way.x / span, way.heading / span));
            }
            seen.log_way.push((time, odometry.pose));
        } else if let [only] = &self.known[..] {
            let name = only.name.clone();
            self.robot(&name).odometry.push((time, odometry.pose));
        }
    }

    /// What the wheels are told.
    fn command(&mut self, time: f64, topic: &str, message: &Message) {
        let told = self.known.iter().find(|known| known.command.as_deref() == Some(topic));
        let Some(name) = told.map(|known| known.name.clone()) else { return };
        let Some((twist, _)) = decode::<Twist>(message) else { return };
        let commanded = &mut self.robot(&name).commanded;
        if commanded.last().is_none_or(|last| time - last.0 >= COMMANDS) {
            commanded.push((time, twist.linear, twist.angular));
        }
    }

    /// The first that tells that a task is over counts: the others pass it on.
    fn report(&mut self, time: f64, message: &Message) {
        let Some((last, _)) = decode::<Report>(message) else { return };
        let is_told = self.tasks.iter().any(|known| known.task == last.task);
        if last.task > 0 && last.progress.is_over() && !is_told {
            let (off, turned) = self.off(last.task);
            self.tasks.push(TaskOutcome { task: last.task, at: time, last, off, turned });
        }
    }

    fn task(&mut self, message: &Message) {
        if let Some((task, _)) = decode::<Task>(message) {
            self.asked.insert(task.number, task);
        }
    }

    /// How far the only robot truly is from the place of a task (m) and from its heading (rad), where that is one of the map.
    fn off(&self, task: u32) -> (Option<f64>, Option<f64>) {
        let on_map = |task: &&Task| task.motion.has_place() && task.frame.as_str() == agents::localizer::MAP;
        let task = self.asked.get(&task).filter(on_map);
        let mut robots = self.robots.values().filter_map(|seen| seen.way.last());
        let (Some(task), Some((_, pose)), None) = (task, robots.next(), robots.next()) else {
            return (None, None);
        };
        let turned = types::geometry::wrap(pose.heading - task.target.heading).abs();
        (Some(pose.position().distance(task.target.position())), task.turned.then_some(turned))
    }

    fn note(&mut self, time: f64, message: &Message) {
        let Ok(value) = message.value() else { return };
        let Some(table) = value.as_table() else { return };
        let text = |key: &str| table.get(key).and_then(|entry| entry.value.as_text()).unwrap_or_default();
        let (who, what) = (text("name"), text("msg"));
        if who == WORLD {
            return scenery::draw_standing(&mut self.drawing, what);
        }
        if what.starts_with("missed its deadline") {
            self.misses.entry(who.to_owned()).or_default().push(time);
        }
        let tells = ["panic: ", "did not return", "started again", "latch is set", "latch is reset"];
        if self.events.len() < MOST_EVENTS && who != "plan" && tells.iter().any(|word| what.contains(word)) {
            let what = what.split(" (").next().unwrap_or(what);
            self.events.push(Event { time, text: format!("{who}: {what}") });
        }
    }
}

/// Times below this are counted from a start, above it from the Unix epoch (ns).
const ONE_DAY: i64 = 86_400 * 1_000_000_000;
/// Beyond this range a cone is a metre wide (m), and its echo says little of where something is.
const NEAR: f32 = 2.0;

/// Points, thinned evenly where there are too many.
#[derive(Clone, Debug)]
pub(super) struct Cloud {
    pub(super) points: Vec<Point>,
    /// Every so many points one is kept.
    stride: usize,
    offered: usize,
}

impl Default for Cloud {
    fn default() -> Cloud {
        Cloud { points: Vec::new(), stride: 1, offered: 0 }
    }
}

impl Cloud {
    pub(super) fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    fn add(&mut self, point: Point) {
        if self.offered.is_multiple_of(self.stride) {
            if self.points.len() >= MOST_POINTS {
                let mut number = 0;
                self.points.retain(|_| {
                    number += 1;
                    number % 2 == 1
                });
                self.stride *= 2;
            }
            if self.offered.is_multiple_of(self.stride) {
                self.points.push(point);
            }
        }
        self.offered += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cloud_that_is_too_large_keeps_its_early_and_its_late_points_alike() {
        let mut cloud = Cloud::default();
        (0..MOST_POINTS * 5).for_each(|i| cloud.add(Point::new(i as f64, 0.0)));
        assert!(cloud.points.len() <= MOST_POINTS && cloud.points.len() > MOST_POINTS / 4);
        let gaps: Vec<f64> = cloud.points.windows(2).map(|pair| pair[1].x - pair[0].x).collect();
        assert!(gaps.iter().all(|gap| *gap == gaps[0]), "all as dense");
    }

    #[test]
    fn short_bands_and_the_same_again_are_one() {
        let says = [(0.0, "blind"), (0.1, "wall"), (5.0, "safety"), (5.1, "wall"), (9.0, "track")];
        let says = says.map(|(time, agent)| (time, agent.to_owned())).to_vec();
        let bands = Trail { says, span: Some((0.0, 12.0)), ..Trail::default() }.bands();
        let bands: Vec<_> = bands.iter().map(|band| (band.from, band.to, band.agent.as_str())).collect();
        assert_eq!(bands, [(0.1, 9.0, "wall"), (9.0, 12.0, "track")]);
    }
}
