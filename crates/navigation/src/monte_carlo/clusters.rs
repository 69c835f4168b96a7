//! Where the cloud is dense.

use libm::{fabs, sqrt};
use types::Pose;
use types::geometry::wrap;

use super::Particle;
use super::bins::Bins;

/// So many places are told at most.
pub const MOST_HYPOTHESES: usize = 8;
/// What is so near to the middle of a place belongs to it (m, rad).
const NEAR: f64 = 0.6;
const TURNED: f64 = 0.5;
/// Lighter places are not told.
const LEAST: f64 = 0.005;

/// A place where the robot may be.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Hypothesis {
    /// The mean of those that are there.
    pub pose: Pose,
    /// The share of all, from 0 to 1.
    pub weight: f64,
    /// How far they are from the mean, in the mean square (m).
    pub spread: f64,
}

/// Takes the heaviest bin and what is around it, then the heaviest of what is left.
pub(super) fn find(particles: &[Particle], marks: &mut [u8], bins: &mut Bins, out: &mut Vec<Hypothesis>) {
    out.clear();
    marks.fill(0);
    for mark in 1..=MOST_HYPOTHESES as u8 {
        bins.clear();
        let left = particles.iter().zip(&*marks).filter(|(_, mark)| **mark == 0);
        left.for_each(|(particle, _)| bins.add(particle.pose, particle.weight));
        let Some(first) = bins.heaviest() else { break };
        // Once more from the mean: the bin cuts off part of what is there.
        let middle = gather(particles, marks, first, None).pose;
        let found = gather(particles, marks, middle, Some(mark));
        if found.weight < LEAST {
            break;
        }
        out.push(found);
    }
    out.sort_unstable_by(|a, b| b.weight.total_cmp(&a.weight));
}

/// The mean of what is near to a pose and not yet marked; it is marked then.
fn gather(particles: &[Particle], marks: &mut [u8], around: Pose, mark: Option<u8>) -> Hypothesis {
    let (mut weight, mut x, mut y, mut turn, mut square) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (particle, place) in particles.iter().zip(marks).filter(|(_, mark)| **mark == 0) {
        let off = particle.pose.position() - around.position();
        let turned = wrap(particle.pose.heading - around.heading);
        if off.is_within(NEAR) && fabs(turned) <= TURNED {
            weight += particle.weight;
            x += particle.weight * off.x;
            y += particle.weight * off.y;
            turn += particle.weight * turned;
            square += particle.weight * off.dot(off);
            *place = mark.unwrap_or(*place);
        }
    }
    if weight <= 0.0 {
        return Hypothesis { pose: around, weight: 0.0, spread: 0.0 };
    }
    let (x, y) = (x / weight, y / weight);
    let pose = Pose::new(around.x + x, around.y + y, wrap(around.heading + turn / weight));
    Hypothesis { pose, weight, spread: sqrt((square / weight - x * x - y * y).max(0.0)) }
}
