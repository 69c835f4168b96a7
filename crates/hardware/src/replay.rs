//! Plays what a robot sensed in a run of which there is a log.
//!
//! The outputs of the robot are found by their names: for a robot `h1` those are `h1.scan` or `/h1/scan`, and so on. A log of a
//! simulated run keeps its times; one of a real robot begins at its first message.
//!
//! The file is read while it plays, which allocates: a replay is not for real-time executors.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use record::log::{Clock, Message as Logged, ReadError, Reader};
use types::messages::{
    Battery, Bumper, Echoes, Gyro, Head, Image, Landmarks, LaserScan, Odometry, Transforms, Twist, WheelTicks,
};
use types::{Duration, Message, Time, cdr};

use crate::description::{ClockKind, LASER, RobotDescription};
use crate::driver::{Driver, DriverError, Listening, Polled, Sink};
use crate::gate::Permit;

/// Why a log cannot be played.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// It cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// Nothing in it is of this robot.
    #[error("{path} holds no output of a robot \"{robot}\"; it holds {found}")]
    NoRobot {
        /// The file.
        path: PathBuf,
        /// The robot.
        robot: String,
        /// The robots that it does hold.
        found: String,
    },
}

/// The outputs of a robot that can be played.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Port {
    Sonar,
    Scan,
    Image,
    Ticks,
    Bumper,
    Gyro,
    Battery,
    Head,
    Pose,
    Landmarks,
    Transforms,
}

/// The robot and the port of a topic.
fn port_of(topic: &str) -> Option<(&str, Port)> {
    let (robot, port) = topic.trim_start_matches('/').rsplit_once(['.', '/'])?;
    let port = match port {
        "sonar" => Port::Sonar,
        "scan" => Port::Scan,
        "image" => Port::Image,
        "ticks" => Port::Ticks,
        "bumper" => Port::Bumper,
        "gyro" => Port::Gyro,
        "battery" => Port::Battery,
        "head" => Port::Head,
        "pose" => Port::Pose,
        "landmarks" => Port::Landmarks,
        "transforms" => Port::Transforms,
        _ => return None,
    };
    Some((robot, port))
}

fn decode<T: Message>(bytes: &[u8], row: &mut Vec<T::Element>) -> Result<T, cdr::Error> {
    row.clear();
    T::decode(&mut cdr::Reader::new(bytes)?, row)
}

/// What a log holds of one robot, found in a first passage over it.
struct Survey {
    description: RobotDescription,
    origin: Time,
    messages: u64,
}

fn survey(path: &Path, robot: &str) -> Result<Survey, ReplayError> {
    let mut reader = Reader::open(path)?;
    let mut description = RobotDescription::bare("replay", ClockKind::Recorded);
    let (mut first, mut messages) = (None, 0);
    let mut others = std::collections::BTreeSet::new();
    let (mut ranges, mut bytes, mut mounts) = (Vec::new(), Vec::new(), Vec::new());
    while let Some(logged) = reader.next_message()? {
        first.get_or_insert(logged.time);
        let Some((of, port)) = port_of(&logged.channel.topic) else { continue };
        if of != robot {
            if !others.contains(of) {
                others.insert(of.to_owned());
            }
            continue;
        }
        messages += 1;
        let periods = &mut description.periods;
        let place = match port {
            Port::Sonar => &mut periods.sonar,
            Port::Scan => &mut periods.scan,
            Port::Image => &mut periods.image,
            Port::Ticks => &mut periods.ticks,
            Port::Bumper => &mut periods.bumper,
            Port::Gyro => &mut periods.gyro,
            Port::Battery => &mut periods.battery,
            Port::Head => &mut periods.head,
            Port::Pose => &mut periods.pose,
            Port::Landmarks => &mut periods.landmarks,
            Port::Transforms => {
                if decode::<Transforms>(&logged.cdr, &mut mounts).is_ok() {
                    description.mounts.clone_from(&mounts);
                }
                continue;
            }
        };
        *place = Some(Duration::ZERO);
        match port {
            Port::Scan if decode::<LaserScan>(&logged.cdr, &mut ranges).is_ok() => {
                description.beams = description.beams.max(ranges.len());
            }
            Port::Image if decode::<Image>(&logged.cdr, &mut bytes).is_ok() => {
                description.picture = description.picture.max(bytes.len());
            }
            _ => {}
        }
    }
    if messages == 0 {
        let found = if others.is_empty() { "no robot".to_owned() } else { Vec::from_iter(others).join(", ") };
        return Err(ReplayError::NoRobot { path: path.to_owned(), robot: robot.to_owned(), found });
    }
    let simulated = reader.run().is_some_and(|run| run.clock == Clock::Simulated);
    let origin = if simulated { Time::ZERO } else { first.unwrap_or_default() };
    Ok(Survey { description, origin, messages })
}

/// The driver that plays a log. What it is told to do goes nowhere.
pub struct Replayed {
    reader: Reader,
    robot: String,
    description: RobotDescription,
    /// The log's time at which the replay begins.
    log_origin: Time,
    /// The caller's time at which it begins.
    origin: Option<Time>,
    waiting: Option<(Port, Logged)>,
    messages: u64,
    bad: u64,
    ranges: Vec<f32>,
    bytes: Vec<u8>,
}

impl Replayed {
    /// Opens the log and looks through it for the outputs of `robot`.
    ///
    /// # Errors
    /// When the log cannot be read, or holds nothing of this robot.
    pub fn open(path: &Path, robot: &str) -> Result<Replayed, ReplayError> {
        let Survey { description, origin, messages } = survey(path, robot)?;
        Ok(Replayed {
            reader: Reader::open(path)?,
            robot: robot.to_owned(),
            description,
            log_origin: origin,
            origin: None,
            waiting: None,
            messages,
            bad: 0,
            ranges: Vec::new(),
            bytes: Vec::new(),
        })
    }

    /// The messages of the robot in the log.
    pub fn messages(&self) -> u64 {
        self.messages
    }

    /// Those that could not be decoded so far, and were left out.
    pub fn bad(&self) -> u64 {
        self.bad
    }

    /// The next message of the robot.
    fn next(&mut self) -> Result<Option<(Port, Logged)>, ReadError> {
        if let Some(waiting) = self.waiting.take() {
            return Ok(Some(waiting));
        }
        while let Some(logged) = self.reader.next_message()? {
            match port_of(&logged.channel.topic) {
                Some((of, port)) if of == self.robot => return Ok(Some((port, logged))),
                _ => {}
            }
        }
        Ok(None)
    }

    fn deliver(
        &mut self,
        port: Port,
        logged: &Logged,
        stamp: Time,
        wanted: &Listening,
        sink: &mut dyn Sink,
    ) -> Result<(), cdr::Error> {
        let (cdr, none) = (&logged.cdr, &mut Vec::new());
        match port {
            Port::Sonar if wanted.sonar => sink.sonar(stamp, &decode::<Echoes>(cdr, none)?),
            Port::Ticks if wanted.ticks => sink.ticks(stamp, &decode::<WheelTicks>(cdr, none)?),
            Port::Bumper if wanted.bumper => sink.bumper(stamp, &decode::<Bumper>(cdr, none)?),
            Port::Gyro if wanted.gyro => sink.gyro(stamp, &decode::<Gyro>(cdr, none)?),
            Port::Battery if wanted.battery => sink.battery(stamp, &decode::<Battery>(cdr, none)?),
            Port::Head if wanted.head => sink.head(stamp, &decode::<Head>(cdr, none)?),
            Port::Pose if wanted.pose => sink.pose(stamp, &decode::<Odometry>(cdr, none)?),
            Port::Landmarks if wanted.landmarks => sink.landmarks(stamp, &decode::<Landmarks>(cdr, none)?),
            Port::Scan if wanted.scan => {
                let plain = decode::<LaserScan>(cdr, &mut self.ranges)?;
                let form = self.mounted(plain);
                let ranges = &self.ranges;
                sink.scan(stamp, &mut |head, room| {
                    *head = form;
                    fill(ranges, room)
                });
            }
            Port::Image if wanted.image => {
                let form = decode::<Image>(cdr, &mut self.bytes)?;
                let bytes = &self.bytes;
                sink.image(stamp, &mut |head, room| {
                    *head = form;
                    fill(bytes, room)
                });
            }
            _ => {}
        }
        Ok(())
    }

    /// ROS 2's scan does not say where the laser sits; the frame tree of the log does.
    fn mounted(&self, scan: LaserScan) -> LaserScan {
        let is_laser =
            |child: &types::Name| *child == scan.frame || (scan.frame.is_empty() && child.as_str() == LASER);
        let edge = self.description.mounts.iter().find(|edge| is_laser(&edge.child));
        let pose = edge.map_or_else(Default::default, |edge| edge.pose);
        LaserScan {
            mount_x: pose.x as f32,
            mount_y: pose.y as f32,
            mount_heading: pose.heading as f32,
            ..scan
        }
    }
}

fn fill<T: Copy>(from: &[T], room: &mut [T]) -> usize {
    let len = from.len().min(room.len());
    room[..len].copy_from_slice(&from[..len]);
    len
}

impl Driver for Replayed {
    fn describe(&self) -> &RobotDescription {
        &self.description
    }

    fn poll(&mut self, now: Time, wanted: &Listening, sink: &mut dyn Sink) -> Result<Polled, DriverError> {
        let origin = *self.origin.get_or_insert(now);
        // A log may hold any times, and what lies at the ends of their range stays there.
        let shift = Duration(origin.0.saturating_sub(self.log_origin.0));
        loop {
            let next = self.next().map_err(|error| DriverError { what: Cow::Owned(error.to_string()) })?;
            let Some((port, logged)) = next else { return Ok(Polled { ended: true, ..Polled::default() }) };
            let due = logged.time.saturating_add(shift);
            if due > now {
                self.waiting = Some((port, logged));
                return Ok(Polled { next: Some(due), ..Polled::default() });
            }
            let stamp = logged.header.map_or(logged.time, |header| header.stamp).saturating_add(shift);
            if self.deliver(port, &logged, stamp, wanted, sink).is_err() {
                self.bad += 1;
            }
        }
    }

    fn drive(&mut self, _: &Permit, _: Time, _: Twist) -> Result<(), DriverError> {
        Ok(())
    }

    fn turn_head(&mut self, _: &Permit, _: Time, _: Head) -> Result<(), DriverError> {
        Ok(())
    }

    fn hold_head(&mut self, _: &Permit, _: Time) -> Result<(), DriverError> {
        Ok(())
    }
}
