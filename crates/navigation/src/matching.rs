//! Laying a scan over a known floor: where was it taken?
//!
//! In plain words: the points that a laser sees lie on walls. From about the right place the scan is pushed and turned until its points lie
//! on the walls of the plan; points that lie on nothing (people, a chair that was moved) have no say.
//!
//! How it works: Levenberg–Marquardt over (x, y, heading) on the distances of the end points to what is nearest, each against its own
//! noise. A beam of noise `σ` along itself that meets a wall at the angle `β` from its normal is off the wall by
//!
//! ```text
//!   var = (σ cos β)² + m²        m: how far the plan is off the building
//! ```
//!
//! Points farther off than some deviations count nothing (Tukey's biweight); the limit begins wide, so that a guess may be off by
//! decimetres, and shrinks as the steps become short. What comes out is as good as the scan allows: the covariance is that of the bound of Cramér and Rao but for
//! the few per cent that the weights cost. In a direction for which too few beams speak — along a corridor without ends — nothing is
//! corrected, and the information is zero.
//!
//! The scan is taken as one glance. A laser that turns while the robot drives sees each beam from another place: at 0.5 m/s
//! and a scan of 25 ms that is 1 cm from the first to the last, and half of it in the mean.
//!
//! (Lu and Milios 1997, "Robot pose estimation in unknown environments by matching 2D range scans", for points against lines; Biber and Straßer 2003
//! for descent on a field; Censi 2007, "On achievable accuracy for range-finder localization", for the bound.)

mod scan;

pub use scan::{Beam, Geometry, MOST_BEAMS, Scan};

use libm::{fabs, sincos, sqrt};
use types::geometry::wrap;
use types::{Point, Pose};

use crate::floor::Distances;
use crate::linear::{Matrix, Vector, ZERO, directions, dot, times};

/// How a scan is laid over a floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MatchParams {
    /// Standard deviation of a range (m, above 0). 0.01 is that of a common scanner.
    pub noise: f64,
    /// Standard deviation of the plan from the building, and whatever else there is across a wall (m, above 0). 0.003 is less than what a tape
    /// measure does to a plan; it keeps beams that graze a wall from counting too much.
    pub plan_noise: f64,
    /// So far off a point may be at first and still count (m). 0.5: what a robot may have been pushed, and less than from one side of a door to the other.
    pub reach: f64,
    /// So many deviations off a point counts nothing in the end. 4.685 keeps 95 % of what points without outliers can tell (Holland and Welsch 1977).
    pub cut: f64,
    /// A point so near to the plan has met what the plan shows (m). 0.08 is eight deviations: nearer are chairs at a wall, and no matter.
    pub inlier: f64,
    /// A direction for which less than so many beams speak is not corrected. 4: one pillar that was moved must not move a robot.
    pub support: f64,
    /// Rounds at most. 40: ten until the limit is narrow, the rest until nothing moves.
    pub rounds: u32,
}

impl Default for MatchParams {
    fn default() -> MatchParams {
        MatchParams {
            noise: 0.01,
            plan_noise: 0.003,
            reach: 0.5,
            cut: 4.685,
            inlier: 0.08,
            support: 4.0,
            rounds: 40,
        }
    }
}

/// Where a scan was taken.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Match {
    /// `floor_from_body`.
    pub pose: Pose,
    /// The inverse of the covariance over (x, y, heading) on the floor; zero in directions that were not corrected.
    pub information: [[f64; 3]; 3],
    /// Root of the mean square of the distances of those points that count, as they count (m).
    pub residual: f64,
    /// The share of the points that lie on something that the plan shows, from 0 to 1.
    pub inliers: f64,
    /// How many directions were not corrected, 0 to 3.
    pub unseen: u8,
}

/// Why a scan could not be laid over a floor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoMatch {
    /// Fewer beams than ten came back; nothing is near, or the laser is covered.
    FewReturns,
    /// Hardly a point lies near to anything that the plan shows: the guess is wrong.
    NothingNear,
}

impl core::fmt::Display for NoMatch {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            NoMatch::FewReturns => "fewer than ten beams came back",
            NoMatch::NothingNear => "hardly a point lies near to anything of the plan",
        })
    }
}

impl core::error::Error for NoMatch {}

/// So the limit shrinks when a step was shorter than so much of it: faster, one guess in some hundreds that are off by decimetres was caught
/// between two walls.
const NARROWER: f64 = 0.65;
const SETTLED: f64 = 0.1;
/// A step shorter than this ends it (m and rad).
const STILL: f64 = 2e-5;

/// Finds where a scan was taken, near to a guess. Takes no memory.
///
/// # Errors
/// A scan of which hardly anything came back, or which does not fit anywhere near.
pub fn match_scan(
    floor: &impl Distances,
    scan: &Scan,
    guess: Pose,
    params: &MatchParams,
) -> Result<Match, NoMatch> {
    if scan.is_poor() {
        return Err(NoMatch::FewReturns);
    }
    // A radian moves the points by about so much, so that a step of the heading is as long as one of the place.
    let lever = scan.lever();
    let (mut pose, mut limit) = (guess, params.reach.max(params.noise));
    let mut narrow = false;
    for _ in 0..params.rounds {
        let normal = Normal::of(floor, scan, pose, params, limit);
        if normal.weight < 3.0 {
            return Err(NoMatch::NothingNear);
        }
        let step = normal.seen(lever, params).step;
        pose = Pose::new(pose.x + step[0], pose.y + step[1], wrap(pose.heading + step[2]));
        let length = fabs(step[0]) + fabs(step[1]) + fabs(step[2]) * lever;
        if narrow && length < STILL {
            break;
        }
        narrow = limit <= params.cut * params.plan_noise;
        if length < SETTLED * limit {
            limit *= NARROWER;
        }
    }
    let normal = Normal::of(floor, scan, pose, params, 0.0);
    let seen = normal.seen(lever, params);
    Ok(Match {
        pose,
        information: seen.information,
        residual: sqrt(normal.squares / normal.weight.max(1e-9)),
        inliers: f64::from(normal.inliers) / scan.beams().len() as f64,
        unseen: seen.unseen,
    })
}

/// From this share of points on, nothing better is looked for.
const ENOUGH: f64 = 0.95;

/// The same for a guess of which nobody knows whether it is off by millimetres or by the whole reach: first over a quarter of it, and where not
/// nearly all points lie on the plan then, over all of it. Of both the one with more points on the plan is taken.
///
/// A wide reach alone can lead away from a guess that is right, where little is seen and much stands near to it.
///
/// # Errors
/// As [`match_scan`].
pub fn match_carefully(
    floor: &impl Distances,
    scan: &Scan,
    guess: Pose,
    params: &MatchParams,
) -> Result<Match, NoMatch> {
    let near = match_scan(floor, scan, guess, &MatchParams { reach: params.reach / 4.0, ..*params });
    if let Ok(near) = near
        && near.inliers >= ENOUGH
    {
        return Ok(near);
    }
    match (near, match_scan(floor, scan, guess, params)) {
        (Ok(near), Ok(far)) if near.inliers >= far.inliers => Ok(near),
        (Ok(near), Err(_)) => Ok(near),
        (_, far) => far,
    }
}

/// The share of a scan's beams that would have come through what the plan shows if it was taken at `pose`: that lie `slack` (m) and more behind the
/// first thing in their way. People and things that the plan does not show make beams shorter, and only a wrong place makes them longer.
pub fn came_through(floor: &impl Distances, scan: &Scan, pose: Pose, slack: f64) -> f64 {
    let origin = pose.transform(scan.origin());
    let came_through = |beam: &&Beam| {
        let end = pose.transform(beam.end);
        let way = origin.distance(end) - slack;
        way > 0.0 && floor.cast(origin, (end - origin) * (1.0 / origin.distance(end)), way).is_some()
    };
    let many = scan.beams().iter().filter(came_through).count();
    many as f64 / scan.beams().len().max(1) as f64
}

/// The normal equations of one round.
#[derive(Clone, Copy, Debug, Default)]
struct Normal {
    information: Matrix,
    gradient: Vector,
    /// The sum of the weights, and of the weighted squares as distances (m²) and in deviations.
    weight: f64,
    squares: f64,
    deviations: f64,
    inliers: u32,
}

impl Normal {
    /// Points count up to `limit` (m) off, and up to some deviations where those are more.
    fn of(floor: &impl Distances, scan: &Scan, pose: Pose, params: &MatchParams, limit: f64) -> Normal {
        let mut normal = Normal { information: ZERO, ..Normal::default() };
        let (s, c) = sincos(pose.heading);
        let turn = |p: Point| Point::new(c * p.x - s * p.y, s * p.x + c * p.y);
        let widest = limit * limit / (params.cut * params.cut);
        for beam in scan.beams() {
            let arm = turn(beam.end);
            let direction = turn(beam.direction);
            let Some(nearest) = floor.met(pose.position() + arm, direction) else { continue };
            normal.inliers += u32::from(nearest.distance <= params.inlier);
            let along = params.noise * nearest.away.dot(direction);
            let var = along * along + params.plan_noise * params.plan_noise;
            let square = nearest.distance * nearest.distance;
            let off = square / (params.cut * params.cut * var.max(widest));
            if off < 1.0 {
                let weight = (1.0 - off) * (1.0 - off);
                let slope = [nearest.away.x, nearest.away.y, arm.cross(nearest.away)];
                normal.add(&slope, nearest.distance, weight, var);
                normal.squares += weight * square;
                normal.deviations += weight * square / var;
            }
        }
        normal
    }

    fn add(&mut self, slope: &Vector, distance: f64, weight: f64, var: f64) {
        let scaled = weight / var;
        for i in 0..3 {
            for j in 0..3 {
                self.information[i][j] += scaled * slope[i] * slope[j];
            }
            self.gradient[i] -= scaled * slope[i] * distance;
        }
        self.weight += weight;
    }

    /// The step to the least sum of squares, in the directions for which enough beams speak.
    fn seen(&self, lever: f64, params: &MatchParams) -> Seen {
        let scale = [1.0, 1.0, 1.0 / lever];
        let scaled: Matrix =
            core::array::from_fn(|i| core::array::from_fn(|j| self.information[i][j] * scale[i] * scale[j]));
        let gradient: Vector = core::array::from_fn(|i| self.gradient[i] * scale[i]);
        let (values, rows) = directions(&scaled);
        // Points that are scattered more than was said tell less.
        let spread = (self.deviations / self.weight.max(1e-9)).max(1.0);
        let noise = params.noise * params.noise + params.plan_noise * params.plan_noise;
        let mut seen = Seen { step: [0.0; 3], information: ZERO, unseen: 0 };
        for (value, row) in values.into_iter().zip(rows) {
            if value * noise < params.support {
                seen.unseen += 1;
                continue;
            }
            let along = dot(&row, &gradient) / value;
            for i in 0..3 {
                seen.step[i] += along * row[i] * scale[i];
                for j in 0..3 {
                    seen.information[i][j] += value / spread * row[i] * row[j] / (scale[i] * scale[j]);
                }
            }
        }
        seen
    }
}

/// What can be told from a round.
struct Seen {
    step: Vector,
    information: Matrix,
    unseen: u8,
}

/// How unlikely it is that two poses are the same, against what is known of their difference (squared deviations, of three numbers).
pub fn deviation(information: &[[f64; 3]; 3], from: Pose, to: Pose) -> f64 {
    let off = [to.x - from.x, to.y - from.y, wrap(to.heading - from.heading)];
    dot(&off, &times(information, &off))
}

#[cfg(test)]
mod tests;
