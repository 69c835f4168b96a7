//! Where the robot is on a known map, when nobody says where it began: many guesses, of which the good ones multiply.
//!
//! In plain words: guesses are scattered over all free floor. Each moves as the robot does, a little differently. Whenever a scan comes, those
//! from which the map would look like it are drawn again and again, and the others are not. Soon all are in one place. When what
//! is seen suits none of them as well as it used to, somebody has carried the robot away: some guesses are scattered anew.
//!
//! ```text
//!             scan ─▶ weigh ─▶ w = exp(γ Σ ln p)  ─▶ fit = Σ w · exp(mean ln p) / Σ w
//!                                                       slow ← slow + α_s (fit − slow)
//!   n by bins ◀─ draw: 1 − fast/usual of them anywhere ◀── fast ← fast + α_f (fit − fast)
//! ```
//!
//! The number of guesses goes by the number k of bins that they fill: so many that with a certainty of 0.99 (z = 2.326) what they say differs by
//! less than ε from what endless many would (Fox, "Adapting the sample size in particle filters through KLD-sampling", 2003, equation 7),
//!
//! ```text
//! n = (k−1)/(2ε) (1 − 2/(9(k−1)) + z √(2/(9(k−1))))³
//! ```
//!
//! γ is less than one since the beams of a scan are not independent of each other: all know the same map, and it is wrong somewhere. Drawing is of low variance; the
//! fit is that of the guesses that count, so that the scattered ones do not spoil it. (Thrun, Burgard and Fox, "Probabilistic Robotics", 2005,
//! tables 4.4, 8.2 and 8.3.)

mod bins;

use libm::{exp, fabs, sqrt};
use motion::odometry::Increment;
use types::chance::Stream;
use types::geometry::{PI, wrap};
use types::{Point, Pose};

use super::likelihood::LikelihoodField;
use crate::mapping::Beam;
use bins::Bins;

/// z of a certainty of 0.99.
const CERTAIN: f64 = 2.326;
/// Guesses within this of the fullest bin's middle belong to it (m, rad).
const NEAR: f64 = 0.7;
const NEAR_TURN: f64 = 0.5;

/// How guesses move, multiply and are scattered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// The most guesses. 20 000 are a hundred for each square metre of a large flat, in all directions.
    pub most: usize,
    /// The least. 400 still have the shape of what is not known.
    pub least: usize,
    /// ε: by how much what guesses say may differ from the truth of endless many. 0.05.
    pub differ: f64,
    /// So many beams of a scan are looked at. 40 see every corner of a room.
    pub beams: usize,
    /// γ: how much each beam counts. 0.15: as if seven neighbours told the same.
    pub weight: f64,
    /// Variance along the way for each metre (m). 0.002.
    pub along: f64,
    /// Variance of the heading for each radian turned (rad), and for each metre (rad²/m). 0.01 and 0.002: more than wheels err, so that
    /// guesses stay different.
    pub turning: f64,
    /// See [`Parameters::turning`].
    pub swerving: f64,
    /// A scan counts when the robot has gone so far (m) or turned so much (rad) since the last that did: two from one place tell the same twice.
    pub step: f64,
    /// See [`Parameters::step`].
    pub step_turn: f64,
    /// α_s and α_f: how fast the fit of long and of short ago follow. 0.02 and 0.3: fifty scans and three.
    pub slow: f64,
    /// See [`Parameters::slow`].
    pub fast: f64,
    /// The fit of short ago may be this part of that of long ago before guesses are scattered. 0.85: somebody stands in the way.
    pub patience: f64,
    /// A fit below this is bad whatever was before, as of guesses that all came together in a wrong place at first. 0.6: where they are right, and
    /// one beam of ten meets what is on no map, it is 0.8.
    pub poor: f64,
    /// Where the laser is: `robot_from_sensor`.
    pub sensor: Pose,
}

impl Default for Parameters {
    fn default() -> Parameters {
        Parameters {
            most: 20_000,
            least: 400,
            differ: 0.05,
            beams: 40,
            weight: 0.15,
            along: 2e-3,
            turning: 1e-2,
            swerving: 2e-3,
            step: 0.15,
            step_turn: 0.15,
            slow: 0.02,
            fast: 0.3,
            patience: 0.85,
            poor: 0.6,
            sensor: Pose::new(0.0, 0.0, 0.0),
        }
    }
}

/// What most guesses say.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Belief {
    /// Where they are in the mean.
    pub pose: Pose,
    /// Covariance of x (m), y (m), heading (rad) among them.
    pub spread: [[f64; 3]; 3],
    /// The share of all guesses that are among them. More than 0.8 is a robot that knows where it is.
    pub share: f64,
    /// How well the last scan suits, from 0 to 1.
    pub fit: f64,
}

/// Guesses on a map. All memory is taken when they are made.
#[derive(Clone, Debug)]
pub struct MonteCarlo {
    parameters: Parameters,
    field: LikelihoodField,
    stream: Stream,
    /// How often was drawn, so that no draw is the same.
    round: u64,
    guesses: Vec<Pose>,
    spare: Vec<Pose>,
    weights: Vec<f64>,
    fits: Vec<f64>,
    beams: Vec<Point>,
    bins: Bins,
    slow: f64,
    fast: f64,
    /// Scans that counted since nobody knew anything.
    scans: f64,
    /// Since the last scan that counted: the motion, and how far it went and turned.
    motion: Pose,
    way: f64,
    turned: f64,
    is_new: bool,
    belief: Belief,
}

impl MonteCarlo {
    /// Nobody knows where it is.
    pub fn new(parameters: Parameters, field: LikelihoodField, stream: Stream) -> MonteCarlo {
        let least = parameters.least.clamp(2, 1 << 20);
        let most = parameters.most.clamp(least, 1 << 20);
        let parameters = Parameters { most, least, beams: parameters.beams.clamp(1, 4096), ..parameters };
        let mut new = MonteCarlo {
            parameters,
            field,
            stream,
            round: 0,
            guesses: Vec::with_capacity(most),
            spare: Vec::with_capacity(most),
            weights: Vec::with_capacity(most),
            fits: Vec::with_capacity(most),
            beams: Vec::with_capacity(parameters.beams),
            bins: Bins::new(most),
            slow: 0.0,
            fast: 0.0,
            scans: 0.0,
            motion: Pose::default(),
            way: 0.0,
            turned: 0.0,
            is_new: true,
            belief: Belief::default(),
        };
        new.scatter();
        new
    }

    /// Forgets all, and guesses anywhere.
    pub fn scatter(&mut self) {
        self.round += 1;
        let chance = self.stream.sample(self.round);
        self.guesses.clear();
        for number in 0..self.parameters.most as u64 {
            self.guesses.push(anywhere(&self.field, chance, number));
        }
        (self.slow, self.fast, self.scans, self.is_new) = (0.0, 0.0, 0.0, true);
        self.believe(0.0);
    }

    /// A step of the wheels.
    pub fn moved(&mut self, step: Increment) {
        if step.distance.is_finite() && step.turn.is_finite() {
            self.motion = self.motion.along_arc(step.distance, step.turn);
            self.way += fabs(step.distance);
            self.turned += fabs(step.turn);
        }
    }

    /// A scan. Whether it counted: one from where the last was taken does not, nor does one in which nothing came back.
    pub fn sees(&mut self, scan: impl Iterator<Item = Beam> + Clone) -> bool {
        let has_moved = self.way >= self.parameters.step || self.turned >= self.parameters.step_turn;
        if !(has_moved || self.is_new) || !self.take(scan) {
            return false;
        }
        self.round += 1;
        self.advance();
        let fit = self.weigh();
        let anew = self.judge(fit);
        self.draw(anew);
        self.believe(fit);
        self.is_new = false;
        true
    }

    /// What most guesses say, of the time of the last step.
    pub fn belief(&self) -> Belief {
        Belief { pose: self.belief.pose.then(self.motion), ..self.belief }
    }

    /// All guesses, of the last scan that counted.
    pub fn guesses(&self) -> &[Pose] {
        &self.guesses
    }

    /// Keeps the ends of some beams, as the robot has them.
    fn take(&mut self, scan: impl Iterator<Item = Beam> + Clone) -> bool {
        let echo =
            |beam: &Beam| beam.echo && beam.bearing.is_finite() && beam.range.is_finite() && beam.range > 0.0;
        let count = scan.clone().filter(echo).count();
        let every = count.div_ceil(self.parameters.beams).max(1);
        let sensor = self.parameters.sensor;
        self.beams.clear();
        for beam in scan.filter(echo).step_by(every) {
            self.beams.push(sensor.transform(Point::polar(beam.range, beam.bearing)));
        }
        !self.beams.is_empty()
    }

    /// Each guess moves as the robot did, with errors of its own.
    fn advance(&mut self) {
        let motion = core::mem::take(&mut self.motion);
        let (way, turned) = (core::mem::take(&mut self.way), core::mem::take(&mut self.turned));
        let along = sqrt(self.parameters.along * way);
        let turning = sqrt(self.parameters.turning * turned + self.parameters.swerving * way);
        let chance = self.stream.sample(self.round).sample(0);
        for (number, guess) in (0u64..).zip(&mut self.guesses) {
            let (a, b) = chance.normals(4 * number);
            let (c, _) = chance.normals(4 * number + 2);
            let (ahead, aside) = (motion.x + along * a, motion.y + 0.5 * along * c);
            *guess = guess.then(Pose::new(ahead, aside, motion.heading + turning * b));
        }
    }

    /// Weighs all guesses by the scan. Gives how well it suits those that count.
    fn weigh(&mut self) -> f64 {
        self.weights.clear();
        self.fits.clear();
        let count = self.beams.len() as f64;
        let mut best = f64::NEG_INFINITY;
        for guess in &self.guesses {
            let mut sum = 0.0;
            for beam in &self.beams {
                sum += self.field.log(guess.transform(*beam));
            }
            // Nobody stands in a wall, but the map may be wrong by a cell.
            if !self.field.is_free(guess.position()) {
                sum -= 0.5 * count;
            }
            best = f64::max(best, sum);
            self.weights.push(sum);
            self.fits.push(exp(sum / count));
        }
        let (mut all, mut fit) = (0.0, 0.0);
        for (weight, fits) in self.weights.iter_mut().zip(&self.fits) {
            *weight = exp(self.parameters.weight * (*weight - best));
            all += *weight;
            fit += *weight * fits;
        }
        fit / all
    }

    /// Which share of the guesses is to be scattered anew.
    fn judge(&mut self, fit: f64) -> f64 {
        // At first they are the means of all: what the first scan fits is no measure of what is usual.
        self.scans += 1.0;
        self.slow += self.parameters.slow.max(1.0 / self.scans) * (fit - self.slow);
        self.fast += self.parameters.fast.max(1.0 / self.scans) * (fit - self.fast);
        let usual = (self.parameters.patience * self.slow).max(self.parameters.poor);
        (1.0 - self.fast / usual).clamp(0.0, 0.9)
    }

    /// Draws guesses by their weights, with low variance, and a share of them anywhere.
    fn draw(&mut self, anew: f64) {
        // Who is lost looks everywhere again, with all the guesses that there is room for.
        let scattered = (anew * self.parameters.most as f64) as usize;
        let kept = self.wanted().min(self.parameters.most - scattered);
        let chance = self.stream.sample(self.round).sample(1);
        let step = self.weights.iter().sum::<f64>() / kept as f64;
        let mut point = step * chance.uniform(0);
        let (mut guess, mut sum) = (0, self.weights[0]);
        self.spare.clear();
        for _ in 0..kept {
            while sum < point && guess + 1 < self.guesses.len() {
                guess += 1;
                sum += self.weights[guess];
            }
            self.spare.push(self.guesses[guess]);
            point += step;
        }
        for number in 0..scattered as u64 {
            self.spare.push(anywhere(&self.field, chance, 8 + number));
        }
        core::mem::swap(&mut self.guesses, &mut self.spare);
    }

    /// How many guesses it takes for the bins that those with weight fill.
    fn wanted(&mut self) -> usize {
        self.bins.clear();
        let heaviest = self.weights.iter().copied().fold(0.0, f64::max);
        for (guess, weight) in self.guesses.iter().zip(&self.weights) {
            // What will hardly be drawn fills no bin.
            if *weight > 0.01 * heaviest {
                self.bins.add(*guess);
            }
        }
        let others = self.bins.filled().max(2) as f64 - 1.0;
        let part = 2.0 / (9.0 * others);
        let root = 1.0 - part + CERTAIN * sqrt(part);
        let wanted = others / (2.0 * self.parameters.differ) * root * root * root;
        // The number falls by half at most: of few that are near the best becomes many first, and those find what lies between them.
        let least = self.parameters.least.max(self.guesses.len() / 2);
        (wanted as usize).clamp(least, self.parameters.most)
    }

    /// The mean of the guesses around the fullest bin.
    fn believe(&mut self, fit: f64) {
        self.bins.clear();
        for guess in &self.guesses {
            self.bins.add(*guess);
        }
        let mut middle = self.bins.fullest();
        for _ in 0..2 {
            if let Some((mean, ..)) = self.mean_near(middle) {
                middle = mean;
            }
        }
        let Some((pose, spread, count)) = self.mean_near(middle) else { return };
        self.belief = Belief { pose, spread, share: count / self.guesses.len() as f64, fit };
    }

    fn mean_near(&self, middle: Pose) -> Option<(Pose, [[f64; 3]; 3], f64)> {
        let off = |guess: &Pose| {
            let apart = guess.position() - middle.position();
            let turned = wrap(guess.heading - middle.heading);
            (apart.is_within(NEAR) && fabs(turned) < NEAR_TURN).then_some([apart.x, apart.y, turned])
        };
        let (mut sums, mut squares, mut count) = ([0.0; 3], [[0.0; 3]; 3], 0.0);
        for off in self.guesses.iter().filter_map(off) {
            count += 1.0;
            for i in 0..3 {
                sums[i] += off[i];
                for j in 0..3 {
                    squares[i][j] += off[i] * off[j];
                }
            }
        }
        if count == 0.0 {
            return None;
        }
        let mean = sums.map(|sum| sum / count);
        let pose = Pose::new(middle.x + mean[0], middle.y + mean[1], wrap(middle.heading + mean[2]));
        let spread =
            core::array::from_fn(|i| core::array::from_fn(|j| squares[i][j] / count - mean[i] * mean[j]));
        Some((pose, spread, count))
    }
}

/// A guess anywhere on free floor.
fn anywhere(field: &LikelihoodField, chance: Stream, number: u64) -> Pose {
    let draw = chance.sample(number);
    let half = field.side() / 2.0;
    let place = field.free_place(draw.index(0, field.free()));
    Pose::new(
        place.x + draw.between(1, -half, half),
        place.y + draw.between(2, -half, half),
        draw.between(3, -PI, PI),
    )
}

#[cfg(test)]
mod tests;
