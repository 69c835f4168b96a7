//! What was logged of a robot comes back, byte for byte and at its time.

use std::collections::BTreeMap;
use std::path::PathBuf;

use hardware::driver::{FillImage, FillScan};
use hardware::replay::{ReplayError, Replayed};
use hardware::simulated::{self, Robot as Body};
use hardware::{Authority, Driver, Gate, Latch, Listening, Sink};
use record::log::{ChannelId, RunInfo, Writer};
use sim::plan::Landmark;
use sim::{Model, WorldPlan};
use types::messages::{
    Battery, Bumper, Echoes, FrameTransform, Gyro, Head, Image, Landmarks, LaserScan, Transforms, Twist,
    WheelTicks,
};
use types::{Duration, Header, Message, Point, Pose, Time};

/// What was heard: the port, the stamp, the bytes as they go to other programs.
type Heard = Vec<(&'static str, Time, Vec<u8>)>;

#[derive(Default)]
struct Encoded(Heard);

impl Encoded {
    fn take<T: Message>(&mut self, port: &'static str, stamp: Time, head: &T, row: &[T::Element]) {
        let mut out = types::cdr::Writer::new();
        head.encode(row, stamp, &mut out);
        self.0.push((port, stamp, out.bytes().to_vec()));
    }
}

impl Sink for Encoded {
    fn sonar(&mut self, stamp: Time, echoes: &Echoes) {
        self.take("sonar", stamp, echoes, &[]);
    }
    fn scan(&mut self, stamp: Time, fill: FillScan<'_>) {
        let (mut head, mut room) = (LaserScan::default(), vec![0.0; 4096]);
        let len = fill(&mut head, &mut room);
        self.take("scan", stamp, &head, &room[..len]);
    }
    fn image(&mut self, stamp: Time, fill: FillImage<'_>) {
        let (mut head, mut room) = (Image::default(), vec![0; 320 * 240 * 3]);
        let len = fill(&mut head, &mut room);
        self.take("image", stamp, &head, &room[..len]);
    }
    fn ticks(&mut self, stamp: Time, ticks: &WheelTicks) {
        self.take("ticks", stamp, ticks, &[]);
    }
    fn bumper(&mut self, stamp: Time, bumper: &Bumper) {
        self.take("bumper", stamp, bumper, &[]);
    }
    fn gyro(&mut self, stamp: Time, gyro: &Gyro) {
        self.take("gyro", stamp, gyro, &[]);
    }
    fn battery(&mut self, stamp: Time, battery: &Battery) {
        self.take("battery", stamp, battery, &[]);
    }
    fn head(&mut self, stamp: Time, head: &Head) {
        self.take("head", stamp, head, &[]);
    }
    fn landmarks(&mut self, stamp: Time, landmarks: &Landmarks) {
        self.take("landmarks", stamp, landmarks, &[]);
    }
}

/// A drive of two seconds in a hall.
fn driven() -> (Gate, Heard) {
    let mut model = Model::h1().with_laser(181, std::f64::consts::PI);
    model.landmarks = Some(Default::default());
    model.infrared = Some(Default::default());
    let mut plan = WorldPlan::hall(8.0, 6.0);
    plan.landmarks.push(Landmark { at: Point::new(5.5, 3.5), ..Landmark::default() });
    let body = Body { name: "h1".into(), model, start: Pose::new(4.0, 3.0, 0.3), goal: None };
    let (mut bodies, _) = simulated::raise(&plan, 5, &[body]).unwrap();
    let (mut gate, mut heard) = (Gate::new(bodies.remove(0), Latch::private()), Encoded::default());
    for cycle in 0..=200 {
        let now = Time(cycle * 10_000_000);
        gate.poll(now, &Listening::ALL, &mut heard).unwrap();
        gate.command(now, Authority::Robot, now, Twist::new(0.3, 0.2));
        gate.apply(now).unwrap();
    }
    (gate, heard.0)
}

fn log(name: &str, heard: &Heard, mounts: &[FrameTransform]) -> PathBuf {
    let path = std::env::temp_dir().join(format!("hardware-replay-{}-{name}.mcap", std::process::id()));
    let mut writer =
        Writer::create(&path, &RunInfo { system: "replayed".into(), ..RunInfo::default() }).unwrap();
    let mut channels: BTreeMap<&str, ChannelId> = BTreeMap::new();
    let mut definitions: BTreeMap<&str, types::definition::Definition> = BTreeMap::new();
    definitions.insert("sonar", Echoes::definition());
    definitions.insert("scan", LaserScan::definition());
    definitions.insert("image", Image::definition());
    definitions.insert("ticks", WheelTicks::definition());
    definitions.insert("bumper", Bumper::definition());
    definitions.insert("gyro", Gyro::definition());
    definitions.insert("battery", Battery::definition());
    definitions.insert("head", Head::definition());
    definitions.insert("landmarks", Landmarks::definition());
    let channel = writer.channel("h1.transforms", &Transforms::definition()).unwrap();
    let mut out = types::cdr::Writer::new();
    Transforms.encode(mounts, Time::ZERO, &mut out);
    writer.write(channel, &Header::default(), Time::ZERO, out.bytes()).unwrap();
    for (port, stamp, cdr) in heard {
        let channel = *channels
            .entry(port)
            .or_insert_with(|| writer.channel(&format!("h1.{port}"), &definitions[port]).unwrap());
        writer.write(channel, &Header { stamp: *stamp, ..Header::default() }, *stamp, cdr).unwrap();
    }
    writer.finish().unwrap();
    path
}

#[test]
fn a_logged_drive_is_replayed_byte_for_byte() {
    let (gate, heard) = driven();
    assert!(heard.iter().filter(|(port, ..)| *port == "image").count() == 30, "two seconds of pictures");
    let seen =
        |frame: &[u8]| heard.iter().any(|(port, _, cdr)| *port == "landmarks" && cdr.len() > frame.len());
    assert!(seen(&[0; 28]), "the tube is seen");
    let path = log("drive", &heard, &gate.description().mounts);
    let mut replayed = Replayed::open(&path, "h1").unwrap();
    let description = replayed.describe();
    assert_eq!((description.beams, description.picture), (181, 320 * 240 * 3));
    assert_eq!(description.mounts, gate.description().mounts);
    let (mut again, mut now) = (Encoded::default(), Time::ZERO);
    loop {
        let polled = replayed.poll(now, &Listening::ALL, &mut again).unwrap();
        if polled.ended {
            break;
        }
        now = polled.next.unwrap();
    }
    assert_eq!((replayed.bad(), now), (0, Time::ZERO + Duration::secs(2)));
    assert!(heard == again.0, "{} then, {} now", heard.len(), again.0.len());
    std::fs::remove_file(path).unwrap();
}

#[test]
fn a_log_without_the_robot_names_those_it_has() {
    let (gate, heard) = driven();
    let path = log("other", &heard[..20].to_vec(), &gate.description().mounts);
    let Err(error) = Replayed::open(&path, "h2") else { panic!("it holds no h2") };
    assert!(matches!(&error, ReplayError::NoRobot { found, .. } if found == "h1"), "{error}");
    std::fs::remove_file(path).unwrap();
}

#[test]
fn times_at_the_ends_of_their_range_overflow_nothing() {
    let path = std::env::temp_dir().join(format!("hardware-replay-{}-far.mcap", std::process::id()));
    let mut writer = Writer::create(&path, &RunInfo::default()).unwrap();
    let channel = writer.channel("h1.gyro", &Gyro::definition()).unwrap();
    let mut out = types::cdr::Writer::new();
    Gyro::default().encode(&[], Time::ZERO, &mut out);
    for (time, stamp) in [(0, i64::MIN), (0, i64::MAX), (i64::MAX, 0)] {
        let header = Header { stamp: Time(stamp), ..Header::default() };
        writer.write(channel, &header, Time(time), out.bytes()).unwrap();
    }
    writer.finish().unwrap();
    for now in [Time(i64::MIN), Time(1_900_000_000_000_000_000)] {
        let mut replayed = Replayed::open(&path, "h1").unwrap();
        let mut heard = Encoded::default();
        replayed.poll(now, &Listening::ALL, &mut heard).unwrap();
        assert_eq!((heard.0.len(), replayed.bad()), (2, 0));
    }
    std::fs::remove_file(path).unwrap();
}
