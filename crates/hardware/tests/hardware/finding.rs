//! A real robot on the map of a real building: where it is, from an unknown start. Run where the recording is.

use hardware::carmen;
use hardware::recording::{Record, Recording};
use motion::odometry::Increment;
use navigation::drift::Drift;
use navigation::floor::{FreeFloor, GridField};
use navigation::localisation::floor::{FloorLocalizer, FloorParams};
use navigation::mapping::Known;
use navigation::mapping::ray::Lattice;
use navigation::matching::{Geometry, MatchParams};
use navigation::monte_carlo::MonteCarloParams;
use types::chance::Stream;
use types::messages::LaserScan;
use types::{Point, Pose};

use super::data::file;
use super::mapping::{map, scans};

/// Side of a cell of the map (m).
const CELL: f64 = 0.05;
/// From one unknown start to the next (scans), and how many scans it may take to be found.
const STARTS: usize = 100;
const PATIENCE: usize = 60;

/// A scan, and where it was taken.
struct Look {
    pose: Pose,
    geometry: Geometry,
    ranges: Vec<f32>,
}

fn looks(recording: &Recording) -> Vec<Look> {
    let forms = recording.records.iter().filter_map(|(_, record)| match record {
        Record::Scan { form, .. } => Some((form, recording.ranges_of(record))),
        _ => None,
    });
    let look = |form: &LaserScan, ranges: &[f32], pose, mount| Look {
        pose,
        geometry: Geometry {
            angle_min: form.angle_min.into(),
            angle_step: form.angle_step.into(),
            range_min: form.range_min.into(),
            range_max: f64::from(form.range_max).min(25.0),
            mount,
        },
        ranges: ranges.to_vec(),
    };
    let taken = forms.zip(scans(recording));
    taken.map(|((form, ranges), (pose, mount, _))| look(form, ranges, pose, mount)).collect()
}

/// What wheels would have told, with what is wrong always and by chance.
fn spoiled(from: &Look, to: &Look, draw: Stream) -> Increment {
    let moved = from.pose.inverse().then(to.pose);
    let way = moved.position().norm().copysign(moved.x);
    Increment {
        distance: way * (1.03 + 0.05 * draw.normal(0)),
        turn: moved.heading + 0.02 * way + 0.03 * way.abs().sqrt() * draw.normal(1),
    }
}

#[test]
fn in_fr079_it_is_found_from_unknown_starts_and_told_nothing_wrong() {
    let Some(path) = file("carmen/fr079.log.gz") else { return };
    let recording = carmen::open(&path).unwrap();
    let looks = looks(&recording);
    let corner = |sign: f64| {
        let far = |a: f64, b: f64| if sign * a > sign * b { a } else { b };
        looks.iter().fold(looks[0].pose.position(), |p, look| {
            Point::new(far(p.x, look.pose.x), far(p.y, look.pose.y))
        })
    };
    let rim = Point::new(12.0, 12.0);
    let lattice = Lattice::covering(corner(-1.0) - rim, corner(1.0) + rim, CELL);
    let map = map(looks.iter().map(|look| look.pose), &scans(&recording), lattice);
    let size = (lattice.columns(), lattice.rows());
    let is_taken = |x: u32, y: u32| map.known((y * size.0 + x) as usize) == Known::Taken;
    let is_known = |x: u32, y: u32| map.known((y * size.0 + x) as usize) == Known::Free;
    let floor = GridField::new(lattice.corner(), CELL, size, 2.0, is_taken).known_only(is_known);
    let params = FloorParams {
        drift: Drift { wheel: 0.003, ..Drift::default() },
        matching: MatchParams { noise: 0.02, plan_noise: 0.03, ..MatchParams::default() },
        cloud: MonteCarloParams { particles_most: 20_000, ..MonteCarloParams::default() },
        draws_most: 25_000,
        ..FloorParams::default()
    };
    println!("{:.0} m² are known to be free", FreeFloor::new(&floor, params.radius).area());
    for start in (0..looks.len() - PATIENCE).step_by(STARTS) {
        let mut localizer = FloorLocalizer::new(floor.clone(), params, Stream::new(start as u64, "fr079"));
        let (mut odometry, mut off) = (Pose::default(), Vec::new());
        for (step, pair) in looks[start..start + PATIENCE].windows(2).enumerate() {
            let look = &pair[1];
            let moved = spoiled(&pair[0], look, Stream::new(7, "wheels").sample((start + step) as u64));
            odometry = odometry.along_arc(moved.distance, moved.turn);
            localizer.update(odometry, &look.ranges, &look.geometry);
            off.extend(localizer.fix().map(|pose| pose.position().distance(look.pose.position())));
        }
        // The poses of the recording are right to 5 cm themselves, and a cell of the map is as large.
        let worst = off.iter().copied().fold(0.0, f64::max);
        println!("from scan {start}: {} of {PATIENCE} poses told, at most {worst:.3} m off", off.len());
        assert!(!off.is_empty(), "from scan {start} it is not found");
        assert!(worst < 0.3, "from scan {start}: {worst} m");
    }
}
