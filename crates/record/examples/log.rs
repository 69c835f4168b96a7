//! Writes a short log with one message of each kind into the file that is named: `cargo run --example log -- FILE`.

use std::error::Error;

use record::log::{RunInfo, Severity, Writer};
use record::picture;
use types::message::{Message, describe};
use types::messages::{
    Battery, Echo, Echoes, Encoding, FrameTransform, Gyro, Image, LaserScan, Odometry, Transforms, Twist,
};
use types::{Header, Pose, Time, cdr};

fn main() -> Result<(), Box<dyn Error>> {
    let file = std::env::args().nth(1).ok_or("name a file for the log")?;
    let run = RunInfo {
        system: "example".into(),
        seed: Some(1),
        plan: "name = \"example\"\n".into(),
        ..RunInfo::default()
    };
    let mut log = Writer::create(file, &run)?;
    for i in 0..20 {
        let time = Time::from_seconds(f64::from(i) * 0.1);
        put(&mut log, "/h1/drive", time, &Twist { linear: 0.1 * f64::from(i), angular: -0.5 }, &[])?;
        let pose = Pose { x: f64::from(i), y: 2.0, heading: 0.0 };
        put(
            &mut log,
            "/h1/odometry",
            time,
            &Odometry { frame: "odom".into(), body: "base_link".into(), pose, ..Odometry::default() },
            &[],
        )?;
        let scan =
            LaserScan { frame: "laser".into(), angle_step: 0.5, range_max: 8.0, ..LaserScan::default() };
        put(&mut log, "/h1/scan", time, &scan, &[1.5, 2.5, f32::from(i as u8)])?;
    }
    let time = Time::from_seconds(2.0);
    put(&mut log, "/h1/gyro", time, &Gyro { rate: 0.25 }, &[])?;
    put(&mut log, "/h1/battery", time, &Battery { voltage: 24.5, charge: 0.5 }, &[])?;
    let edge = FrameTransform {
        parent: "odom".into(),
        child: "base_link".into(),
        z: 0.1,
        ..FrameTransform::default()
    };
    put(&mut log, "/tf", time, &Transforms, &[edge])?;
    let echo = Echo { x: 0.2, y: 0.0, bearing: 0.0, range: 1.25 };
    put(
        &mut log,
        "/h1/sonar",
        time,
        &Echoes { range_max: 2.5, echoes: [echo, echo].into_iter().collect(), ..Echoes::default() },
        &[],
    )?;
    let image =
        Image { frame: "camera".into(), width: 4, height: 2, encoding: Encoding::Mono8, field_of_view: 1.0 };
    let pixels = [0, 50, 100, 150, 200, 250, 5, 10];
    put(&mut log, "/h1/image", time, &image, &pixels)?;
    let packed = log.channel("/h1/image/compressed", &picture::compressed_image())?;
    log.write(
        packed,
        &Header { stamp: time, ..Header::default() },
        time,
        &picture::compress(&image, &pixels, time)?,
    )?;
    log.note(time, Severity::Info, "example", "the end")?;
    log.finish()?;
    Ok(())
}

fn put<T: Message>(
    log: &mut Writer,
    topic: &str,
    time: Time,
    message: &T,
    row: &[T::Element],
) -> Result<(), Box<dyn Error>> {
    let channel = log.channel(topic, &describe::<T>())?;
    let mut bytes = cdr::Writer::new();
    message.encode(row, time, &mut bytes);
    Ok(log.write(channel, &Header { stamp: time, ..Header::default() }, time, bytes.bytes())?)
}
