//! What is nearest in each direction around the robot, from whatever measured it.

use libm::{ceil, fabs, floor, sincos, sqrt};
use motion::ring::Ring;
use types::geometry::{TAU, wrap};
use types::{Point, Pose};

/// How many sectors there are: 2° each.
pub const SECTORS: usize = 180;
/// The width of one (rad).
pub const SECTOR: f64 = TAU / SECTORS as f64;

/// The distance from the robot's turning point to the nearest obstacle in each sector (m); infinite where there is none.
///
/// Sector `i` is centred at `(i − 90) · 2°`, to the left of ahead. A scan, a ring of sonars, or both are put in one after the other.
#[derive(Clone, Debug, PartialEq)]
pub struct Sectors {
    nearest: [f64; SECTORS],
    /// Whether a beam looked there.
    viewed: [bool; SECTORS],
}

impl Default for Sectors {
    fn default() -> Sectors {
        Sectors { nearest: [f64::INFINITY; SECTORS], viewed: [false; SECTORS] }
    }
}

/// The middle of a sector (rad).
pub fn bearing(sector: usize) -> f64 {
    (sector as f64 - (SECTORS / 2) as f64) * SECTOR
}

/// The sector in which a direction lies (rad, within ±2π).
pub fn sector(bearing: f64) -> usize {
    // Rounded to the nearest, around the circle.
    let place = floor(bearing / SECTOR + 0.5) as i64 + (SECTORS / 2) as i64;
    place.rem_euclid(SECTORS as i64) as usize
}

impl Sectors {
    /// Nothing around.
    pub fn new() -> Sectors {
        Sectors::default()
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.nearest.fill(f64::INFINITY);
        self.viewed.fill(false);
    }

    /// Whether a beam of a laser at the turning point looked into a sector, whatever it met.
    pub fn is_viewed(&self, sector: usize) -> bool {
        self.viewed[sector]
    }

    /// The distances (m).
    pub fn distances(&self) -> &[f64; SECTORS] {
        &self.nearest
    }

    /// Puts in all that another has.
    pub fn add(&mut self, other: &Sectors) {
        for (sector, range) in other.nearest.iter().enumerate() {
            self.put(sector, *range);
            self.viewed[sector] |= other.viewed[sector];
        }
    }

    /// Puts in a point, given around the turning point (m).
    pub fn add_point(&mut self, point: Point) {
        let range = sqrt(point.dot(point));
        if range.is_finite() {
            self.put(sector(libm::atan2(point.y, point.x)), range);
        }
    }

    /// Puts in a scan of any number of beams from a laser at `robot_from_sensor`; ranges of `range_max` and more met nothing (m).
    pub fn add_scan(&mut self, robot_from_sensor: Pose, scan: Ring<'_>, range_max: f64) {
        match scan {
            Ring::Sweep { angle_min, angle_step, ranges }
                if robot_from_sensor.x == 0.0 && robot_from_sensor.y == 0.0 =>
            {
                self.add_centred(robot_from_sensor.heading + angle_min, angle_step, ranges, range_max);
            }
            Ring::Sweep { angle_min, angle_step, ranges } => {
                self.add_sweep(robot_from_sensor, (angle_min, angle_step), ranges, range_max);
            }
            Ring::Beams(_) => {
                for echo in scan.echoes().filter(|echo| echo.range < range_max) {
                    self.add_point(robot_from_sensor.transform(echo.point()));
                }
            }
        }
    }

    /// A laser at the turning point: a beam lies in its sector whatever its range.
    fn add_centred(&mut self, first: f64, step: f64, ranges: &[f32], range_max: f64) {
        if !(first.is_finite() && step.is_finite()) {
            return;
        }
        let (first, step) = (wrap(first) / SECTOR + (SECTORS / 2) as f64 + 0.5, step / SECTOR);
        for (i, range) in ranges.iter().enumerate() {
            let range = f64::from(*range);
            if range > 0.0 {
                let place = types::geometry::whole(first + step * i as f64);
                let place = place.rem_euclid(SECTORS as i32) as usize;
                self.viewed[place] = true;
                if range < range_max {
                    self.put(place, range);
                }
            }
        }
    }

    fn add_sweep(&mut self, sensor: Pose, (first, step): (f64, f64), ranges: &[f32], range_max: f64) {
        if !(first.is_finite() && step.is_finite()) {
            return;
        }
        // The direction of the next beam is that of the last one turned by a step: no sine a beam.
        let (mut sine, mut cosine) = sincos(sensor.heading + first);
        let (turn_sine, turn_cosine) = sincos(step);
        for range in ranges {
            let range = f64::from(*range);
            if range > 0.0 && range < range_max {
                self.add_point(Point::new(sensor.x + range * cosine, sensor.y + range * sine));
            }
            (sine, cosine) =
                (sine * turn_cosine + cosine * turn_sine, cosine * turn_cosine - sine * turn_sine);
        }
    }

    /// Puts in the echo of a wide beam: whatever sent it back may stand anywhere on the arc of the cone at that range.
    ///
    /// `robot_from_sensor` is where the transducer sits and looks, `half_angle` half the opening of its cone (rad).
    pub fn add_echo(&mut self, robot_from_sensor: Pose, half_angle: f64, range: f64) {
        if !(range > 0.0 && range.is_finite() && half_angle.is_finite()) {
            return;
        }
        // So close together that no sector between two points of the arc is left out.
        let reach = range + sqrt(robot_from_sensor.position().dot(robot_from_sensor.position()));
        let steps = ceil(2.0 * fabs(half_angle) * range / (SECTOR * reach * 0.5)).clamp(1.0, SECTORS as f64);
        for i in 0..=steps as usize {
            let off = -half_angle + 2.0 * half_angle * i as f64 / steps;
            self.add_point(robot_from_sensor.transform(Point::polar(range, off)));
        }
    }

    fn put(&mut self, sector: usize, range: f64) {
        if range < self.nearest[sector] {
            self.nearest[sector] = range;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use types::geometry::PI;

    #[test]
    fn ahead_is_in_the_middle_and_the_left_comes_after_it() {
        assert_eq!(sector(0.0), 90);
        assert_eq!(sector(PI / 2.0), 135);
        assert_eq!(sector(-PI / 2.0), 45);
        assert_eq!((sector(PI), sector(-PI)), (0, 0));
        assert!(fabs(bearing(135) - PI / 2.0) < 1e-12);
    }

    #[test]
    fn a_laser_behind_the_centre_sees_farther_ahead_than_it_is_away() {
        let mut around = Sectors::new();
        let ranges = [1.0f32, 1.0, 1.0];
        let scan = Ring::Sweep { angle_min: -PI / 2.0, angle_step: PI / 2.0, ranges: &ranges };
        around.add_scan(Pose::new(-0.065, 0.0, 0.0), scan, 10.0);
        assert!(fabs(around.distances()[90] - 0.935) < 1e-6);
        // To the sides it is the hypotenuse.
        let side = libm::hypot(1.0, 0.065);
        let left = sector(libm::atan2(1.0, -0.065));
        assert!(fabs(around.distances()[left] - side) < 1e-6);
        assert_eq!(around.distances().iter().filter(|range| range.is_finite()).count(), 3);
    }

    #[test]
    fn an_echo_fills_the_sectors_of_its_cone_and_no_others() {
        let mut around = Sectors::new();
        around.add_echo(Pose::default(), 15.0 * PI / 180.0, 0.8);
        let taken: Vec<usize> = (0..SECTORS).filter(|i| around.distances()[*i].is_finite()).collect();
        let (first, last) = (taken[0], taken[taken.len() - 1]);
        assert_eq!(taken, (first..=last).collect::<Vec<_>>());
        assert!((82..=83).contains(&first) && (97..=98).contains(&last), "{first} to {last}");
        assert!(taken.iter().all(|i| fabs(around.distances()[*i] - 0.8) < 1e-9));
    }

    /// Whether some beam meets its point next to the border of the three sectors from one on.
    fn on_border(beams: &[(f64, f64)], mount: Pose, first: usize) -> bool {
        beams.iter().any(|(bearing, range)| {
            let at = mount.transform(Point::polar(*range, *bearing)).bearing() / SECTOR + 0.5;
            fabs(at - libm::round(at)) < 1e-6
                && ((libm::round(at) as i64 + 90 - first as i64).rem_euclid(180) % 3) == 0
        })
    }

    proptest! {
        #[test]
        fn all_forms_of_a_scan_tell_the_same(
            millimetres in proptest::collection::vec(50u16..12_000, 1..400), first in -PI..PI, heading in -PI..PI
        ) {
            let step = 0.0123;
            let ranges: Vec<f32> = millimetres.iter().map(|mm| f32::from(*mm) / 1000.0).collect();
            let beams: Vec<(f64, f64)> =
                ranges.iter().enumerate().map(|(i, r)| (first + step * i as f64, f64::from(*r))).collect();
            for mount in [Pose::new(0.0, 0.0, heading), Pose::new(-0.065, 0.02, heading)] {
                let (mut swept, mut listed) = (Sectors::new(), Sectors::new());
                swept.add_scan(mount, Ring::Sweep { angle_min: first, angle_step: step, ranges: &ranges }, 10.0);
                listed.add_scan(mount, Ring::Beams(&beams), 10.0);
                // A beam on the border of two sectors may fall to either side by rounding, so neighbours are compared together.
                let around = |sectors: &Sectors, i: usize| {
                    (i..i + 3).map(|i| sectors.distances()[i % SECTORS]).fold(f64::INFINITY, f64::min)
                };
                for i in 0..SECTORS {
                    let (a, b) = (around(&swept, i), around(&listed, i));
                    prop_assert!(a == b || fabs(a - b) < 1e-9 || on_border(&beams, mount, i), "{i}: {a} and {b}");
                }
            }
        }
    }
}
