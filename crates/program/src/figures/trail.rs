//! What figures need of a log, taken from it message by message.

use std::collections::BTreeMap;

use record::figure::{Band, Drawing, Event};
use record::log::{Message, RunInfo};
use types::cdr::Reader;
use types::message::Message as Typed;
use types::messages::{Decision, Echoes, LaserScan, Odometry, Twist};
use types::{Point, Pose, Time};

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
    pub(super) points: Vec<Point>,
    /// The sensor that saw it.
    pub(super) points_name: &'static str,
    /// Where the laser saw something, from the log's own poses.
    pub(super) scan_points: Vec<Point>,
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
    /// The first and the last time.
    pub(super) span: Option<(f64, f64)>,
    known: Vec<KnownRobot>,
    begun: Option<Time>,
}

/// More points than this make a figure heavy and not clearer.
const MOST_POINTS: usize = 60_000;
/// More events than this cannot be explained below a figure.
const MOST_EVENTS: usize = 12;

fn decode<T: Typed>(message: &Message) -> Option<(T, Vec<T::Element>)> {
    let mut row = Vec::new();
    let head = T::decode(&mut Reader::new(&message.cdr).ok()?, &mut row).ok()?;
    Some((head, row))
}

impl Trail {
    pub(super) fn new(run: &RunInfo) -> Trail {
        Trail { drawing: scenery::drawing(&run.notes), known: scenery::robots(&run.notes), ..Trail::default() }
    }

    pub(super) fn radius(&self, robot: &str) -> f64 {
        self.known.iter().find(|known| known.name == robot).map_or(0.225, |known| known.radius)
    }

    fn is_robot(&self, name: &str) -> bool {
        self.known.iter().any(|known| known.name == name)
    }

    /// Who had the say when.
    pub(super) fn bands(&self) -> Vec<Band> {
        let end = self.span.map_or(0.0, |span| span.1);
        let ends = self.says.iter().skip(1).map(|(time, _)| *time).chain([end]);
        self.says.iter().zip(ends).map(|((from, agent), to)| Band { from: *from, to, agent: agent.clone() }).collect()
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
            if topic == record::log::ROSOUT {
                self.note(time, message);
            }
            return;
        };
        if agent == "truth" {
            self.truth(time, port, message);
            return;
        }
        self.sent.entry(agent.to_owned()).or_default().push(time);
        match message.channel.definition.as_str() {
            Decision::NAME => self.decision(time, message),
            Echoes::NAME if self.is_robot(agent) => self.echoes(agent, message),
            LaserScan::NAME if self.is_robot(agent) && port == "scan" => self.scan(agent, message),
            Odometry::NAME => self.odometry(time, agent, port, message),
            Twist::NAME => self.command(time, port, message),
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
            add(&mut seen.points, at);
        }
    }

    fn scan(&mut self, robot: &str, message: &Message) {
        let Some((scan, ranges)) = decode::<LaserScan>(message) else { return };
        let seen = self.robot(robot);
        let truth = seen.way.last().map(|(_, pose)| *pose);
        let Some(pose) = truth.or(seen.log_way.last().map(|(_, pose)| *pose)) else { return };
        let mount = Pose::new(scan.mount_x.into(), scan.mount_y.into(), scan.mount_heading.into());
        let far = scan.range_max - 0.01;
        for (i, range) in ranges.iter().enumerate() {
            if !range.is_finite() || *range <= scan.range_min.max(0.02) || *range >= far {
                continue;
            }
            let bearing = f64::from(scan.angle_min) + i as f64 * f64::from(scan.angle_step);
            let at = pose.then(mount).transform(Point::polar(f64::from(*range), bearing));
            match truth {
                Some(_) => add(&mut seen.points, at),
                None => add(&mut seen.scan_points, at),
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
            seen.log_way.push((time, odometry.pose));
            seen.speed.push((time, odometry.twist.linear, odometry.twist.angular));
        } else if let [only] = &self.known[..] {
            let name = only.name.clone();
            self.robot(&name).odometry.push((time, odometry.pose));
        }
    }

    /// What the wheels are told, where it is plain whose they are.
    fn command(&mut self, time: f64, port: &str, message: &Message) {
        let ([only], "command" | "drive") = (&self.known[..], port) else { return };
        let Some((twist, _)) = decode::<Twist>(message) else { return };
        let name = only.name.clone();
        self.robot(&name).commanded.push((time, twist.linear, twist.angular));
    }

    fn note(&mut self, time: f64, message: &Message) {
        let Ok(value) = message.value() else { return };
        let Some(table) = value.as_table() else { return };
        let text = |key: &str| table.get(key).and_then(|entry| entry.value.as_text()).unwrap_or_default();
        let (who, what) = (text("name"), text("msg"));
        let tells = ["panicked", "did not return", "started again", "latch is set", "latch is reset"];
        if self.events.len() < MOST_EVENTS && tells.iter().any(|word| what.contains(word)) {
            self.events.push(Event { time, text: format!("{who}: {what}") });
        }
    }
}

/// Times below this are counted from a start, above it from the Unix epoch (ns).
const ONE_DAY: i64 = 86_400 * 1_000_000_000;
/// A cone is a metre wide beyond this range (m), and its echo says little of where something is.
const NEAR: f32 = 3.0;

/// Adds a point; when there are too many, every second one goes.
fn add(points: &mut Vec<Point>, point: Point) {
    if points.len() >= MOST_POINTS {
        let mut keep = false;
        points.retain(|_| {
            keep = !keep;
            keep
        });
    }
    points.push(point);
}
