//! Laser ranges: one ray a beam, with noise and beams that do not return.

use libm::sincos;
use types::geometry::TAU;
use types::{Point, Pose};

use crate::field::Field;
use crate::model::Laser;
use types::chance::Stream;

/// The angle of beam `k` to the left of where the laser looks (rad).
///
/// The beams are spread over the field with one at each end; over a full turn they are spread without a double one.
pub fn beam_angle(laser: &Laser, k: u32) -> f64 {
    let gaps = if laser.field >= TAU - 1e-9 { laser.beams } else { laser.beams.saturating_sub(1) };
    if gaps == 0 { 0.0 } else { -laser.field / 2.0 + laser.field * f64::from(k) / f64::from(gaps) }
}

/// The directions of all beams in the frame of the robot.
pub(crate) fn beams(laser: &Laser) -> Vec<Point> {
    (0..laser.beams).map(|k| Point::polar(1.0, laser.heading + beam_angle(laser, k))).collect()
}

/// Fills `out` with the ranges of the beams.
pub(crate) fn scan(
    field: &Field,
    laser: &Laser,
    beams: &[Point],
    pose: Pose,
    body: u32,
    draw: Stream,
    out: &mut [f32],
) -> usize {
    let (s, c) = sincos(pose.heading);
    let origin = pose.position() + Point::new(c * laser.x - s * laser.y, s * laser.x + c * laser.y);
    let count = beams.len().min(out.len());
    for (pair, ranges) in out[..count].chunks_mut(2).enumerate() {
        // Two normal numbers come at the price of one.
        let normals = if laser.noise > 0.0 { draw.normals(pair as u64) } else { (0.0, 0.0) };
        for (k, range) in ranges.iter_mut().enumerate() {
            let beam = beams[2 * pair + k];
            let direction = Point::new(c * beam.x - s * beam.y, s * beam.x + c * beam.y);
            let lost = laser.dropout > 0.0 && draw.uniform((1 << 32) + (2 * pair + k) as u64) < laser.dropout;
            let hit =
                if lost { None } else { field.cast(origin, direction, laser.max_range, laser.height, body) };
            let noise = laser.noise * if k == 0 { normals.0 } else { normals.1 };
            *range = hit.map_or(laser.max_range, |hit| (hit.t + noise).clamp(0.0, laser.max_range)) as f32;
        }
    }
    count
}
