//! Where a robot is on a known floor, when nobody knows at all: many guesses, of which those survive that agree with what is seen.
//!
//! In plain words: a thousand robots are imagined all over the floor. All move as the real one does; those whose walls are not where the laser
//! sees walls are forgotten, those that agree have offspring. Some new ones are always imagined anywhere, the more the worse all agree: so
//! a robot that was carried elsewhere is found again.
//!
//! ```text
//!   scatter ─▶ predict ─▶ weigh ─▶ hypotheses
//!                 ▲                    │
//!                 └──── resample ◀─────┘
//! ```
//!
//! How it works: augmented Monte Carlo localisation (Thrun, Burgard and Fox 2005, "Probabilistic Robotics", tables 8.2 and 8.3) over the likelihood
//! field (section 6.4), with resampling of low variance (table 4.4) and as many particles as the bound on the Kullback–Leibler
//! distance asks for (Fox 2003, "Adapting the sample size in particle filters through KLD-sampling", equation 7), within a fixed memory. What is new
//! here is the schedule: after all is scattered the field is wide, so that a particle decimetres off is not lost, and narrows from scan
//! to scan. All draws are functions of the stream and the number of the step.

mod bins;
mod clusters;

pub use clusters::{Hypothesis, MOST_HYPOTHESES};

use libm::{exp, sincos, sqrt};
use types::chance::Stream;
use types::geometry::{PI, wrap};
use types::{Point, Pose};

use crate::drift::Drift;
use crate::floor::{Distances, FreeFloor};
use crate::matching::{Beam, Scan};
use bins::Bins;

/// How a place is searched for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MonteCarloParams {
    /// Particles at least. 500: a cloud over one room still has some in every corner.
    pub particles_least: usize,
    /// Particles at most; memory is taken for so many. 8000: one for each 0.1 m² and 20° of a flat of 50 m².
    pub particles_most: usize,
    /// Beams that are looked at. 40 over half a turn are 4.5° apart, which is a door at 8 m.
    pub beams: usize,
    /// Deviation of the distances in the likelihood field at last (m). 0.08: what the spread of the particles leaves, far above that of the laser.
    pub noise: f64,
    /// The same when nothing is known (m). 0.4 is how far the nearest of the particles may be.
    pub noise_first: f64,
    /// So many deviations off, a beam counts no more (clutter, people). 2.5.
    pub cut: f64,
    /// All beams together count as so many. 12: neighbouring beams meet the same wall, and the errors of the plan are common to them.
    pub worth: f64,
    /// How fast the long mean of the likelihood follows (0 to 1). 0.03, in some thirty scans.
    pub slow: f64,
    /// How fast the short mean follows (0 to 1). 0.3, in some three scans.
    pub fast: f64,
    /// The share of particles that are always drawn anew (0 to 1). 0.05: so a second place that looks the same is found also late.
    pub fresh: f64,
    /// Bound of the distance between the cloud and what it stands for (nats). 0.02, met with the probability of 0.99.
    pub error: f64,
    /// Side of a bin of the bound (m) and its angle (rad). 0.4 m and 15°, about what one place is told from the next by.
    pub bin: (f64, f64),
}

impl Default for MonteCarloParams {
    fn default() -> MonteCarloParams {
        MonteCarloParams {
            particles_least: 500,
            particles_most: 8000,
            beams: 40,
            noise: 0.08,
            noise_first: 0.4,
            cut: 2.5,
            worth: 12.0,
            slow: 0.03,
            fast: 0.3,
            fresh: 0.05,
            error: 0.02,
            bin: (0.4, PI / 12.0),
        }
    }
}

/// The upper 0.99 quantile of the normal law.
const QUANTILE: f64 = 2.326;
/// So the field narrows from scan to scan.
const NARROWER: f64 = 0.8;
/// The share of new ones above which it begins anew (Lenser and Veloso 2000, "Sensor resetting localization").
const LOST: f64 = 0.8;
/// Offspring are strewn by so much of the width of the field, so that they are not copies.
const STREWN: f64 = 0.25;
/// A turn by so much moves what is seen as far as a metre aside does, at the distance of usual walls (rad/m).
const TURN: f64 = 0.4;

/// An imagined robot.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Particle {
    pub(crate) pose: Pose,
    pub(crate) weight: f64,
}

/// A cloud of imagined robots. All memory is taken when it is made: 64 bytes for each particle and as much for the bins.
#[derive(Clone, Debug)]
pub struct MonteCarlo {
    params: MonteCarloParams,
    free: FreeFloor,
    particles: Vec<Particle>,
    other: Vec<Particle>,
    /// For each particle, the number of its cluster.
    marks: Vec<u8>,
    bins: Bins,
    beams: Vec<Beam>,
    stream: Stream,
    /// How many times it was scattered, moved or resampled: the number of the next draw.
    number: u64,
    /// The width of the field now (m).
    width: f64,
    slow: f64,
    fast: f64,
}

impl MonteCarlo {
    /// A cloud over a floor on which a body of this radius (m) can stand; scattered all over.
    pub fn new(floor: &impl Distances, radius: f64, params: MonteCarloParams, stream: Stream) -> MonteCarlo {
        let most = params.particles_most.max(params.particles_least).max(1);
        let mut cloud = MonteCarlo {
            params: MonteCarloParams { particles_most: most, ..params },
            free: FreeFloor::new(floor, radius),
            particles: Vec::with_capacity(most),
            other: Vec::with_capacity(most),
            marks: vec![0; most],
            bins: Bins::new(most, params.bin),
            beams: Vec::with_capacity(params.beams),
            stream,
            number: 0,
            width: params.noise_first,
            slow: 0.0,
            fast: 0.0,
        };
        cloud.scatter();
        cloud
    }

    /// Nothing is known any more: robots anywhere.
    pub fn scatter(&mut self) {
        let draw = self.next();
        self.particles.clear();
        let most = self.params.particles_most;
        for i in 0..most {
            self.particles.push(Particle {
                pose: anywhere(&self.free, draw.sample(i as u64)),
                weight: 1.0 / most as f64,
            });
        }
        self.begin_anew();
    }

    /// Half of the robots are near to a place, with these deviations (m, rad), the others anywhere.
    pub fn gather(&mut self, around: Pose, place: f64, heading: f64) {
        self.scatter();
        let draw = self.next();
        for (i, particle) in self.particles.iter_mut().enumerate().step_by(2) {
            particle.pose = strewn(around, place, heading, draw.sample(i as u64));
        }
    }

    fn begin_anew(&mut self) {
        self.width = self.params.noise_first;
        (self.slow, self.fast) = (0.0, 0.0);
    }

    /// The robot has moved so, as far as its wheels tell (`before_from_now`).
    pub fn predict(&mut self, moved: Pose, drift: &Drift) {
        if moved == Pose::default() {
            return;
        }
        let draw = self.next();
        for (i, particle) in self.particles.iter_mut().enumerate() {
            particle.pose = particle.pose.then(drift.draw(moved, draw.sample(i as u64)));
        }
    }

    /// Weighs all by a scan. A scan of which nothing came back weighs nothing.
    pub fn weigh(&mut self, floor: &impl Distances, scan: &Scan) {
        self.choose(scan);
        if self.beams.is_empty() {
            return;
        }
        let (mut sum, mut mean) = (0.0, 0.0);
        for i in 0..self.particles.len() {
            let likelihood = self.likelihood(floor, self.particles[i].pose, self.width);
            let particle = &mut self.particles[i];
            mean += likelihood;
            particle.weight *= likelihood;
            sum += particle.weight;
        }
        let even = 1.0 / self.particles.len() as f64;
        if sum > 0.0 {
            self.particles.iter_mut().for_each(|particle| particle.weight /= sum);
        } else {
            self.particles.iter_mut().for_each(|particle| particle.weight = even);
        }
        self.follow(mean * even);
    }

    /// How likely the chosen beams are from a pose, over a field of a width (m).
    fn likelihood(&self, floor: &impl Distances, pose: Pose, width: f64) -> f64 {
        let scale = 1.0 / (2.0 * width * width);
        let most = self.params.cut * self.params.cut / 2.0;
        let (s, c) = sincos(pose.heading);
        let off = |beam: &Beam| {
            let turn = |p: Point| Point::new(c * p.x - s * p.y, s * p.x + c * p.y);
            floor
                .met_square(pose.position() + turn(beam.end), turn(beam.direction))
                .map_or(most, |square| (square * scale).min(most))
        };
        let sum: f64 = self.beams.iter().map(off).sum();
        exp(-self.params.worth / self.beams.len().max(1) as f64 * sum)
    }

    /// Evenly chosen beams of a scan.
    fn choose(&mut self, scan: &Scan) {
        self.beams.clear();
        let stride = scan.beams().len().div_ceil(self.params.beams.max(1)).max(1);
        self.beams
            .extend(scan.beams().iter().skip(stride / 2).step_by(stride).take(self.params.beams).copied());
    }

    /// The means of the likelihood. They are compared only while the field keeps its width.
    fn follow(&mut self, likelihood: f64) {
        if self.width > self.params.noise {
            self.width = (self.width * NARROWER).max(self.params.noise);
            (self.slow, self.fast) = (0.0, 0.0);
            return;
        }
        if self.slow == 0.0 {
            (self.slow, self.fast) = (likelihood, likelihood);
        }
        self.slow += self.params.slow * (likelihood - self.slow);
        self.fast += self.params.fast * (likelihood - self.fast);
    }

    /// The share of particles that are drawn anew next, from 0 to 1.
    pub fn fresh(&self) -> f64 {
        let worse = if self.slow > 0.0 { 1.0 - self.fast / self.slow } else { 0.0 };
        worse.max(self.params.fresh).min(1.0)
    }

    /// Those that agree with what was seen have offspring; as many as it takes, and some anywhere. Robots of equal weight take each other's place.
    pub fn resample(&mut self) {
        // Nothing that was thought agrees any more: half of all begin anew, and the field is wide again.
        let lost = self.fresh() > LOST;
        let count = if lost { self.params.particles_most } else { self.count() };
        let fresh =
            if lost { count / 2 } else { (self.fresh() * self.params.particles_most as f64) as usize };
        let kept = count - fresh.min(count / 2);
        if lost {
            self.begin_anew();
        }
        let (draw, offset) = (self.next(), self.next().uniform(0));
        self.other.clear();
        let step = 1.0 / kept.max(1) as f64;
        let (mut at, mut sum) = (0, self.particles[0].weight);
        for i in 0..kept {
            let target = (i as f64 + offset) * step;
            while sum < target && at + 1 < self.particles.len() {
                at += 1;
                sum += self.particles[at].weight;
            }
            let (place, heading) = (self.width * STREWN, self.width * STREWN * TURN);
            let pose = strewn(self.particles[at].pose, place, heading, draw.sample(i as u64));
            self.other.push(Particle { pose, weight: 0.0 });
        }
        for i in kept..count {
            self.other.push(Particle { pose: anywhere(&self.free, draw.sample(i as u64)), weight: 0.0 });
        }
        let even = 1.0 / count as f64;
        self.other.iter_mut().for_each(|particle| particle.weight = even);
        core::mem::swap(&mut self.particles, &mut self.other);
    }

    /// How many particles are needed for as many bins as there is weight in.
    fn count(&mut self) -> usize {
        let MonteCarloParams { particles_least: least, particles_most: most, error, .. } = self.params;
        self.bins.clear();
        let little = 0.02 / self.particles.len() as f64;
        let heavy = self.particles.iter().filter(|particle| particle.weight > little);
        heavy.for_each(|particle| self.bins.add(particle.pose, particle.weight));
        (needed(self.bins.len(), error) as usize).clamp(least.min(most), most)
    }

    /// The places where robots gather, the heaviest first; at most [`MOST_HYPOTHESES`]. Nothing is left in `out` of before.
    pub fn hypotheses(&mut self, out: &mut Vec<Hypothesis>) {
        let MonteCarlo { particles, marks, bins, .. } = self;
        clusters::find(particles, marks, bins, out);
    }

    /// Looks at so many robots anywhere on the floor that have nothing to do with the cloud, and gives the best three, with the likelihood as
    /// weight: those which a wide field holds for likely. So a place is found of which the cloud knows nothing.
    pub fn elsewhere(&mut self, floor: &impl Distances, scan: &Scan, count: usize) -> [Hypothesis; 3] {
        self.choose(scan);
        let draw = self.next();
        let mut best = [Hypothesis::default(); 3];
        for i in 0..count {
            let pose = anywhere(&self.free, draw.sample(i as u64));
            let weight = self.likelihood(floor, pose, self.params.noise_first / 2.0);
            if weight > best[2].weight {
                best[2] = Hypothesis { pose, weight, spread: 0.0 };
                best.sort_unstable_by(|a, b| b.weight.total_cmp(&a.weight));
            }
        }
        best
    }

    /// How much floor there is to be on (m²).
    pub fn area(&self) -> f64 {
        self.free.area()
    }

    /// How many particles there are.
    pub fn len(&self) -> usize {
        self.particles.len()
    }

    /// Whether there are none: never.
    pub fn is_empty(&self) -> bool {
        self.particles.is_empty()
    }

    /// Whether the field has become as narrow as it will be: that is some scans after all was scattered.
    pub fn is_settled(&self) -> bool {
        self.width <= self.params.noise
    }

    fn next(&mut self) -> Stream {
        self.number += 1;
        self.stream.sample(self.number)
    }
}

/// A pose anywhere on the floor, by the draws 0 to 3 of a stream.
fn anywhere(free: &FreeFloor, draw: Stream) -> Pose {
    let at = free.draw(draw);
    Pose::new(at.x, at.y, draw.between(3, -PI, PI))
}

/// A pose near to another, by the draws 0 and 1 of a stream.
fn strewn(around: Pose, place: f64, heading: f64, draw: Stream) -> Pose {
    let (x, y) = draw.normals(0);
    let at = around.position() + Point::new(x, y) * place;
    Pose::new(at.x, at.y, wrap(around.heading + heading * draw.normal(1)))
}

/// So many particles keep the distance below `error` (nats) with a probability of 0.99 where `bins` bins are occupied: Fox 2003, equation 7.
fn needed(bins: usize, error: f64) -> f64 {
    if bins <= 1 {
        return 0.0;
    }
    let free = (bins - 1) as f64;
    let part = 2.0 / (9.0 * free);
    let root = 1.0 - part + sqrt(part) * QUANTILE;
    free / (2.0 * error) * root * root * root
}

#[cfg(test)]
mod tests;
