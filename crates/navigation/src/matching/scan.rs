//! The points of a scan, thinned.

use libm::sqrt;
use types::{Point, Pose};

/// So many beams of a scan are kept at most.
pub const MOST_BEAMS: usize = 256;

/// So many beams must have come back.
const RETURNS: usize = 10;

/// How the beams of a scan lie.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Geometry {
    /// Direction of the first beam (rad, counter-clockwise from ahead of the laser).
    pub angle_min: f64,
    /// From one beam to the next (rad).
    pub angle_step: f64,
    /// What is nearer cannot be told (m).
    pub range_min: f64,
    /// A range of this or more is no return (m).
    pub range_max: f64,
    /// `body_from_laser`.
    pub mount: Pose,
}

/// A beam that came back, in the frame of the body.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Beam {
    /// What it met (m).
    pub end: Point,
    /// Where it went, of length one.
    pub direction: Point,
}

/// The beams of a scan that came back, at most so many, evenly chosen. Memory is taken when it is made.
#[derive(Clone, Debug)]
pub struct Scan {
    beams: Vec<Beam>,
    /// Where the laser is, in the frame of the body.
    origin: Point,
}

impl Default for Scan {
    fn default() -> Scan {
        Scan::new()
    }
}

impl Scan {
    /// A scan of nothing.
    pub fn new() -> Scan {
        Scan { beams: Vec::with_capacity(MOST_BEAMS), origin: Point::default() }
    }

    /// Takes over the returns of a scan, every second, third … beam where there are more than `most` (at most 256). What is no number, too near
    /// or at the end of the range is left out.
    pub fn take(&mut self, ranges: &[f32], geometry: &Geometry, most: usize) {
        let most = most.clamp(1, MOST_BEAMS);
        let stride = ranges.len().div_ceil(most).max(1);
        let origin = geometry.mount.position();
        self.origin = origin;
        self.beams.clear();
        // The ones chosen lie as far from the first beam as from the last.
        let first = (ranges.len().saturating_sub(1) % stride) / 2;
        for (i, range) in ranges.iter().enumerate().skip(first).step_by(stride).take(most) {
            let range = f64::from(*range);
            let near = geometry.range_min.max(1e-6);
            if range.is_finite() && range >= near && range < geometry.range_max - 1e-4 {
                let bearing = geometry.mount.heading + geometry.angle_min + i as f64 * geometry.angle_step;
                let direction = Point::polar(1.0, bearing);
                self.beams.push(Beam { end: origin + direction * range, direction });
            }
        }
    }

    /// The beams that came back.
    pub fn beams(&self) -> &[Beam] {
        &self.beams
    }

    /// From where they went (m).
    pub fn origin(&self) -> Point {
        self.origin
    }

    /// Whether too few came back to tell anything.
    pub fn is_poor(&self) -> bool {
        self.beams.len() < RETURNS
    }

    /// How far its points are from the body in the mean square (m); one where there are none.
    pub(super) fn lever(&self) -> f64 {
        let sum: f64 = self.beams.iter().map(|beam| beam.end.dot(beam.end)).sum();
        if sum > 0.0 { sqrt(sum / self.beams.len() as f64) } else { 1.0 }
    }
}
