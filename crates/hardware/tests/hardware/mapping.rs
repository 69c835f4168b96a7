//! A map of a real building from its scans. Run where the recording is.

use hardware::carmen;
use hardware::recording::{Record, Recording};
use motion::odometry::Increment;
use navigation::mapping::ray::Lattice;
use navigation::mapping::{Beam, Known, Occupancy, Parameters};
use types::messages::LaserScan;
use types::{Point, Pose};

use super::data::file;

/// Scans with the pose of the robot at their time, as the recording has it, and where the laser is on the robot.
pub(super) fn scans(recording: &Recording) -> Vec<(Pose, Pose, Vec<Beam>)> {
    let mut pose = Pose::default();
    let mut scans = Vec::new();
    for (_, record) in &recording.records {
        match record {
            Record::Pose(odometry) => pose = odometry.pose,
            Record::Scan { form, .. } => {
                let mount = Pose::new(
                    f64::from(form.mount_x),
                    f64::from(form.mount_y),
                    f64::from(form.mount_heading),
                );
                scans.push((pose, mount, beams(form, recording.ranges_of(record))));
            }
            Record::Ticks(_) => {}
        }
    }
    scans
}

fn beams(form: &LaserScan, ranges: &[f32]) -> Vec<Beam> {
    let most = form.range_max.min(25.0);
    let beam = |(i, range): (usize, &f32)| Beam {
        bearing: f64::from(form.angle_min) + i as f64 * f64::from(form.angle_step),
        range: f64::from(range.min(most)),
        echo: *range < most,
    };
    ranges.iter().enumerate().map(beam).collect()
}

/// What the wheels would have told, with a scale and a drift.
fn spoiled(scans: &[(Pose, Pose, Vec<Beam>)]) -> Vec<Increment> {
    let step = |pair: &[(Pose, Pose, Vec<Beam>)]| {
        let moved = pair[0].0.inverse().then(pair[1].0);
        let way = moved.position().norm().copysign(moved.x);
        Increment { distance: 1.03 * way, turn: moved.heading + 0.02 * way }
    };
    scans.windows(2).map(step).collect()
}

pub(super) fn map(
    poses: impl Iterator<Item = Pose>,
    scans: &[(Pose, Pose, Vec<Beam>)],
    lattice: Lattice,
) -> Occupancy {
    let mut map = Occupancy::new(Parameters::default(), lattice);
    for (pose, (_, mount, beams)) in poses.zip(scans) {
        map.see(pose.then(*mount), beams.iter().copied());
    }
    map
}

/// The share of the ends of beams that lie where the map says that something stands.
fn sharpness(map: &Occupancy, poses: impl Iterator<Item = Pose>, scans: &[(Pose, Pose, Vec<Beam>)]) -> f64 {
    let (mut ends, mut on) = (0usize, 0usize);
    for (pose, (_, mount, beams)) in poses.zip(scans) {
        let sensor = pose.then(*mount);
        for beam in beams.iter().filter(|beam| beam.echo) {
            ends += 1;
            on +=
                usize::from(map.at(sensor.transform(Point::polar(beam.range, beam.bearing))) == Known::Taken);
        }
    }
    on as f64 / ends as f64
}

#[test]
fn fr079_gives_a_sharp_map_by_its_poses_and_a_blurred_one_by_wheels() {
    let Some(path) = file("carmen/fr079.log.gz") else { return };
    let recording = carmen::open(&path).unwrap();
    let scans = scans(&recording);
    assert_eq!(scans.len(), 1464);
    let poses = || scans.iter().map(|(pose, ..)| *pose);
    let (low, high) = poses().fold((Point::new(1e9, 1e9), Point::new(-1e9, -1e9)), |(low, high), pose| {
        (Point::new(low.x.min(pose.x), low.y.min(pose.y)), Point::new(high.x.max(pose.x), high.y.max(pose.y)))
    });
    let rim = Point::new(12.0, 12.0);
    let lattice = Lattice::covering(low - rim, high + rim, 0.1);
    let sharp = map(poses(), &scans, lattice);
    let steps = spoiled(&scans);
    let mut pose = scans[0].0;
    let by_wheels: Vec<Pose> = std::iter::once(pose)
        .chain(steps.iter().map(|step| {
            pose = pose.along_arc(step.distance, step.turn);
            pose
        }))
        .collect();
    let blurred = map(by_wheels.iter().copied(), &scans, lattice);
    let shares = [sharpness(&sharp, poses(), &scans), sharpness(&blurred, by_wheels.iter().copied(), &scans)];
    println!("ends of beams on what the map has: {shares:?}");
    assert!(shares[0] > 0.7 && shares[0] > 2.0 * shares[1], "{shares:?}");
}
