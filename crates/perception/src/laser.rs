//! A laser scan as a ring of ranges around the robot, and the removal of stray points.
//!
//! In plain words: hundreds of beams, measured from where the laser is mounted, become the same few ranges around the
//! robot's centre that a ring of sonars gives, so that everything behind works on either.

use crate::picture::{WrongLength, check};
use libm::{atan2, cos, floor, hypot, sin};
use types::Pose;
use types::geometry::TAU;

/// Most directions of a ring.
pub const CAPACITY: usize = 64;

/// The beams of a laser: beam i looks along `angle_min` + i · `angle_step` in the laser's frame.
///
/// A range is a hit when it lies in `range_min` ..= `range_max`. All else is none: 0, not a number, infinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beams {
    /// Direction of the first beam, counter-clockwise from the laser's x axis (rad).
    pub angle_min: f64,
    /// From one beam to the next (rad).
    pub angle_step: f64,
    /// Shortest range that is measured (m).
    pub range_min: f32,
    /// Longest range that is measured (m).
    pub range_max: f32,
}

/// Which points of a scan are stray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SaltParams {
    /// A beam that hits the same thing differs by at most this (m). Default 0.10: three standard deviations of a small
    /// laser, and the depth of a chair leg.
    pub gap: f32,
    /// Or by at most this share of the range. Default 0.05: beams 1° apart that meet a wall at 20° differ by 5 %.
    pub gap_share: f32,
    /// Beams to each side that are asked. Default 2: one lost beam beside it does not make a point stray.
    pub window: usize,
    /// Beams among them that must hit the same thing. Default 1: what two beams hit is real.
    pub supporters: usize,
}

/// Which directions of a ring a laser looks into: bit i for direction i. The others are blind, not free.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Seen(pub u64);

impl Seen {
    /// Whether a beam looked into `direction`.
    pub fn sees(self, direction: usize) -> bool {
        direction < CAPACITY && self.0 >> direction & 1 == 1
    }
}

impl Default for Beams {
    /// A laser with a beam every degree over the front half, 0.1 m to 8 m: the old scanner of indoor robots.
    fn default() -> Beams {
        Beams { angle_min: -TAU / 4.0, angle_step: TAU / 360.0, range_min: 0.1, range_max: 8.0 }
    }
}

impl Default for SaltParams {
    fn default() -> SaltParams {
        SaltParams { gap: 0.10, gap_share: 0.05, window: 2, supporters: 1 }
    }
}

impl Beams {
    /// Whether `range` is a hit.
    pub fn is_hit(&self, range: f32) -> bool {
        // 0 is "nothing" even for a laser that says it measures from 0 on.
        range > 0.0 && range >= self.range_min && range <= self.range_max
    }
}

/// The direction of a ring of `n` into which `bearing` falls. Direction i is centred on i · 2π/n, counter-clockwise
/// from straight ahead, and reaches half the way to its neighbours. `n` is at least 1.
pub fn direction_of(bearing: f64, n: usize) -> usize {
    let turns = bearing / TAU + 0.5 / n as f64;
    // Rounding can land exactly on the whole turn.
    ((turns - floor(turns)) * n as f64) as usize % n
}

/// Reduces a scan to the distances (m) of the nearest hit in each direction of `ring`, measured from the robot's centre.
///
/// `robot_from_laser` is where the laser is mounted. A direction without a hit has the longest range of the laser; the
/// returned [`Seen`] tells which of them a beam looked into at all (a beam without a hit looks as far as its longest
/// range). The ring has at most [`CAPACITY`] directions; nothing is done for a ring of none.
pub fn reduce(
    beams: &Beams,
    ranges: &[f32],
    robot_from_laser: Pose,
    ring: &mut [f32],
) -> Result<Seen, WrongLength> {
    let n = ring.len();
    check("ring", n, n.min(CAPACITY))?;
    ring.fill(beams.range_max);
    let mut seen = Seen::default();
    if n == 0 {
        return Ok(seen);
    }
    for (i, range) in ranges.iter().enumerate() {
        let hit = beams.is_hit(*range);
        let length = f64::from(if hit { *range } else { beams.range_max });
        let angle = robot_from_laser.heading + beams.angle_min + i as f64 * beams.angle_step;
        let (x, y) = (robot_from_laser.x + length * cos(angle), robot_from_laser.y + length * sin(angle));
        let direction = direction_of(atan2(y, x), n);
        seen.0 |= 1 << direction;
        if hit {
            ring[direction] = ring[direction].min(hypot(x, y) as f32);
        }
    }
    Ok(seen)
}

/// Copies a scan to `clean` without its stray points: a hit that no beam beside it supports becomes not a number, which
/// is no hit. Mixed pixels at edges, dust and rain are such points; a rod so thin that one beam alone hits it is too.
///
/// The ends of the scan have neighbours on one side only. Returns how many points were taken out.
pub fn remove_salt(
    beams: &Beams,
    ranges: &[f32],
    params: &SaltParams,
    clean: &mut [f32],
) -> Result<usize, WrongLength> {
    check("clean", clean.len(), ranges.len())?;
    let mut removed = 0;
    for (i, range) in ranges.iter().enumerate() {
        let stray = beams.is_hit(*range) && supporters(beams, ranges, params, i) < params.supporters;
        clean[i] = if stray { f32::NAN } else { *range };
        removed += usize::from(stray);
    }
    Ok(removed)
}

/// Beams beside beam `i` that hit the same thing.
fn supporters(beams: &Beams, ranges: &[f32], params: &SaltParams, i: usize) -> usize {
    let gap = params.gap.max(params.gap_share * ranges[i]);
    let from = i.saturating_sub(params.window);
    let to = i.saturating_add(params.window).saturating_add(1).min(ranges.len());
    let same = |k: &usize| *k != i && beams.is_hit(ranges[*k]) && (ranges[*k] - ranges[i]).abs() <= gap;
    (from..to).filter(same).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test::single;
    use proptest::prelude::*;

    /// A laser that looks all around, a beam every half degree.
    const AROUND: Beams =
        Beams { angle_min: -TAU / 2.0, angle_step: TAU / 720.0, range_min: 0.05, range_max: 10.0 };

    /// The scan of a laser at `robot_from_laser` inside a circle of `radius` around the robot's centre: the positive root
    /// of |laser + r·direction| = radius.
    fn circle(radius: f64, robot_from_laser: Pose) -> Vec<f32> {
        let (x, y) = (robot_from_laser.x, robot_from_laser.y);
        (0..720)
            .map(|i| {
                let angle = robot_from_laser.heading + AROUND.angle_min + i as f64 * AROUND.angle_step;
                let along = x * angle.cos() + y * angle.sin();
                (-along + (along * along - x * x - y * y + radius * radius).sqrt()) as f32
            })
            .collect()
    }

    #[test]
    fn directions_are_centred_straight_ahead_and_count_to_the_left() {
        for (degrees, expect) in
            [(0.0, 0), (14.9, 0), (-14.9, 0), (15.1, 1), (90.0, 3), (179.0, 6), (-179.0, 6), (-30.0, 11)]
        {
            assert_eq!(direction_of(f64::to_radians(degrees), 12), expect, "{degrees}°");
        }
        assert_eq!((direction_of(3.0, 1), direction_of(-1e-17 - TAU / 24.0, 12)), (0, 0));
    }

    #[test]
    fn a_wall_ahead_is_nearest_where_its_foot_is() {
        // The laser is 0.2 m ahead of the centre and the wall 2 m ahead of the centre.
        let beams = Beams::default();
        let ranges: Vec<f32> = (0..181)
            .map(|i| (1.8 / (beams.angle_min + f64::from(i) * beams.angle_step).cos()) as f32)
            .collect();
        let mut ring = [0.0; 12];
        let seen = reduce(&beams, &ranges, Pose::new(0.2, 0.0, 0.0), &mut ring).unwrap();
        assert!((ring[0] - 2.0).abs() < 1e-5);
        // Direction 1 begins 15° to the left: 2 m / cos 15°, and the next beam is at most some centimetres further on.
        let edge = 2.0 / 15f32.to_radians().cos();
        assert!(ring[1] >= edge - 1e-5 && ring[1] < edge + 0.02, "{}", ring[1]);
        assert!((ring[1] - ring[11]).abs() < 1e-4);
        assert_eq!(ring[6], 8.0);
        assert!(seen.sees(0) && seen.sees(3) && !seen.sees(6) && !seen.sees(64));
    }

    #[test]
    fn what_is_no_hit_is_none() {
        let beams = Beams { range_min: 0.0, range_max: 4.0, ..AROUND };
        let mut ring = [0.0; 8];
        let ranges = [0.0, f32::NAN, f32::INFINITY, 4.1, -1.0];
        let seen = reduce(&beams, &ranges, Pose::default(), &mut ring).unwrap();
        assert_eq!((ring, seen), ([4.0; 8], Seen(1 << 4)));
        assert!(reduce(&beams, &ranges, Pose::default(), &mut [0.0; 65]).is_err());
        assert_eq!(reduce(&beams, &ranges, Pose::default(), &mut []), Ok(Seen(0)));
    }

    #[test]
    fn a_stray_point_is_taken_out_and_the_rest_is_kept() {
        let beams = Beams::default();
        let ranges = [3.0, 3.02, 0.7, 3.05, 0.0, 3.0, 1.5, 1.52, 6.0, 6.25, 2.0, f32::NAN];
        let mut clean = [9.0; 12];
        let removed = remove_salt(&beams, &ranges, &SaltParams::default(), &mut clean).unwrap();
        assert_eq!(removed, 2);
        let gone: Vec<usize> = (0..12).filter(|i| clean[*i].is_nan()).collect();
        assert_eq!(gone, [2, 10, 11], "6.25 is within 5 % of 6");
        assert_eq!((clean[4], clean[6], clean[9]), (0.0, 1.5, 6.25));
        assert!(remove_salt(&beams, &ranges, &SaltParams::default(), &mut clean[1..]).is_err());
    }

    proptest! {
        #[test]
        fn a_circle_around_the_robot_is_a_circle_wherever_the_laser_is(
            radius in 1.0..5.0f64, x in -0.5..0.5f64, y in -0.5..0.5f64, heading in -3.1..3.1f64, n in 1usize..=36,
        ) {
            let mount = Pose::new(x, y, heading);
            let mut ring = vec![0.0; n];
            let seen = reduce(&AROUND, &circle(radius, mount), mount, &mut ring).unwrap();
            for (i, range) in ring.iter().enumerate() {
                prop_assert!(seen.sees(i) && (f64::from(*range) - radius).abs() < 1e-5, "{} {}", i, range);
            }
        }

        #[test]
        fn the_nearest_hit_of_the_ring_is_the_nearest_hit_of_the_scan(
            ranges in proptest::collection::vec(prop_oneof![Just(0.0f32), single(0.05..12.0)], 720), n in 1usize..=64,
        ) {
            let mut ring = vec![0.0; n];
            reduce(&AROUND, &ranges, Pose::new(0.0, 0.0, 1.0), &mut ring).unwrap();
            let nearest = |it: &mut dyn Iterator<Item = f32>| it.fold(10.0, f32::min);
            let expect = nearest(&mut ranges.iter().copied().filter(|r| *r > 0.0));
            prop_assert!((nearest(&mut ring.iter().copied()) - expect).abs() < 1e-5);
        }
    }
}
