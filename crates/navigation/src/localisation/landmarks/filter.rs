//! The pose and the lasting errors of what tells of it: an extended Kalman filter.
//!
//! In plain words: wheels of which one is a little larger, a track that is not quite what was measured, a camera that looks a little
//! to the left are wrong in the same way all day long. So they can be learnt while driving, wherever sightings tell the pose.
//!
//! The state is the pose and five errors ([`Errors`]); a step of the wheels (Δs, Δφ) in a time Δt moves the pose along an arc of
//!
//! ```text
//! Δs' = Δs (1 + e_s − e_c |Δφ|/Δt)        Δφ' = Δφ (1 + e_t) + e_d Δs
//! ```
//!
//! and the covariance P grows as F P Fᵀ + Q, F the derivative of the step by the state at the middle heading (exact to second order in the turn of one
//! step, so steps should turn by less than about 0.5 rad). Q has noise along and across the way, of the heading, and what the errors drift by.
//!
//! | symbol | is | unit |
//! |---|---|---|
//! | e_s, e_t | part by which ways and turns are told too short | 1 |
//! | e_d | turn that goes with each metre: unequal wheels | rad/m |
//! | e_c | part of the speed that is lost for each rad/s of turning: wheels that scrape, a speed that was only wished for | s/rad |
//!
//! (Thrun, Burgard and Fox, "Probabilistic Robotics", 2005, chapters 5 and 7; errors as part of the state: Larsen, Hansen, Andersen and
//! Ravn, "Location estimation for an autonomously guided vehicle using an augmented Kalman filter", 1999.)

use libm::{fabs, sincos};
use motion::odometry::Increment;
use nalgebra::{SMatrix, SVector};
use types::Pose;
use types::geometry::wrap;

use crate::drift::Drift;

/// x, y, heading and five errors.
pub const STATES: usize = 8;
pub(super) type Vector = SVector<f64, STATES>;
/// Covariance of the state, in its order: x, y, heading, then [`Errors`] as they are declared.
pub type Covariance = SMatrix<f64, STATES, STATES>;

/// Lasting errors, or something about each of them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Errors {
    /// Part of the way that is not told (1).
    pub distance: f64,
    /// Part of the turn that is not told (1).
    pub turn: f64,
    /// Turn that goes with each metre (rad/m).
    pub curve: f64,
    /// Part of the speed that is lost for each rad/s of turning (s/rad).
    pub slowing: f64,
    /// What the camera tells too much of a bearing (rad).
    pub bearing: f64,
}

impl Errors {
    const fn row(self) -> [f64; 5] {
        [self.distance, self.turn, self.curve, self.slowing, self.bearing]
    }
}

/// What is known beforehand of wheels and eyes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// Variance along the way for each metre (m). 0.0005: 2 cm after a metre.
    pub along: f64,
    /// Variance across the way for each metre (m). 0.00005: wheels roll, they hardly slide.
    pub across: f64,
    /// Variance of the heading for each radian turned (rad). 0.01: a tenth of a radian after one; commanded turns are no better.
    pub turning: f64,
    /// Variance of the heading for each metre (rad²/m). 0.005: 4° after a metre.
    pub swerving: f64,
    /// What the lasting errors usually are (standard deviations). A tenth of all ways and turns, 0.1 rad/m, a third of the speed at
    /// 1 rad/s, and a degree of the camera are more than careful builders leave, so that others are served too.
    pub usual: Errors,
    /// What they drift by in a second (standard deviations, 1/√s). A thousandth: as floors and batteries change in minutes; the camera thirty times less.
    pub drift: Errors,
    /// Standard deviation of a range (m), and the part of the range that is added to it. 0.1 and 0.05: heights of tubes in the picture.
    pub range: f64,
    /// See [`Parameters::range`].
    pub range_part: f64,
    /// Standard deviation of a bearing (rad). 0.015: a few pixels.
    pub bearing: f64,
    /// Sightings farther off than this are outliers (squared Mahalanobis distance). 13.8 is passed by one of a thousand good ones: χ² of two.
    pub gate: f64,
    /// What is done with outliers: nothing, and they are left out; a number, and range and bearing are taken as of Student's distribution with so
    /// many degrees of freedom. Then the less one fits, the less it pulls, but a filter that has lost its way comes back. 4 is between the
    /// normal distribution and that of Cauchy.
    pub tails: Option<f64>,
    /// By how much the covariance of another robot is multiplied when that is seen or sees. Both may know the same from each other already,
    /// and then it would count twice. 3 keeps that small; the exact value matters little.
    pub doubt: f64,
    /// Where on another robot the marker is that is seen (standard deviation, m). 0.03: on its middle, within its size.
    pub body: f64,
}

impl Default for Parameters {
    fn default() -> Parameters {
        Parameters {
            along: 5e-4,
            across: 5e-5,
            turning: 1e-2,
            swerving: 5e-3,
            usual: Errors { distance: 0.1, turn: 0.1, curve: 0.1, slowing: 0.3, bearing: 0.02 },
            drift: Errors { distance: 1e-3, turn: 1e-3, curve: 1e-3, slowing: 1e-3, bearing: 3e-5 },
            range: 0.1,
            range_part: 0.05,
            bearing: 0.015,
            gate: 13.8,
            tails: Some(4.0),
            doubt: 3.0,
            body: 0.03,
        }
    }
}

impl Parameters {
    /// Of a robot whose wheels err by themselves, and not because they were only told to turn. What lasts is a hundredth or two of all ways and
    /// turns, and half a percent between wheels that are a third of a metre apart.
    pub fn of_wheels(drift: &Drift) -> Parameters {
        let track = drift.track;
        Parameters {
            along: drift.wheel / 2.0,
            across: drift.aside * drift.aside,
            turning: drift.wheel / track,
            swerving: 2.0 * drift.wheel / (track * track),
            usual: Errors { distance: 0.02, turn: 0.03, curve: 0.015, slowing: 0.0, bearing: 0.01 },
            drift: Errors { distance: 1e-4, turn: 1e-4, curve: 1e-4, slowing: 0.0, bearing: 3e-5 },
            ..Parameters::default()
        }
    }
}

/// Pose and errors, with their covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Filter {
    pub(super) state: Vector,
    pub(super) covariance: Covariance,
}

impl Filter {
    /// Begins at `pose`, known as well as `spread` says (covariance of x, y, heading), with errors as they usually are.
    pub fn new(parameters: &Parameters, pose: Pose, spread: [[f64; 3]; 3]) -> Filter {
        let mut filter = Filter { state: Vector::zeros(), covariance: Covariance::zeros() };
        for (i, usual) in parameters.usual.row().into_iter().enumerate() {
            filter.covariance[(3 + i, 3 + i)] = usual * usual;
        }
        filter.relocate(pose, spread);
        filter
    }

    /// Puts it where something else has found the robot to be. What it has learnt of errors stays.
    pub fn relocate(&mut self, pose: Pose, spread: [[f64; 3]; 3]) {
        self.set_pose(pose);
        // A pose from elsewhere has nothing to do with the errors of before.
        self.covariance.fixed_view_mut::<3, 5>(0, 3).fill(0.0);
        self.covariance.fixed_view_mut::<5, 3>(3, 0).fill(0.0);
        for (i, row) in spread.iter().enumerate() {
            for (j, entry) in row.iter().enumerate() {
                self.covariance[(i, j)] = *entry;
            }
        }
    }

    /// The errors as they are believed to be, in the place of what was learnt; how certain they are stays.
    pub fn with_errors(mut self, errors: Errors) -> Filter {
        for (i, error) in errors.row().into_iter().enumerate() {
            self.state[3 + i] = error;
        }
        self
    }

    /// Where the robot is believed to be.
    pub fn pose(&self) -> Pose {
        Pose::new(self.state[0], self.state[1], self.state[2])
    }

    /// Covariance of x (m), y (m), heading (rad).
    pub fn spread(&self) -> [[f64; 3]; 3] {
        core::array::from_fn(|i| core::array::from_fn(|j| self.covariance[(i, j)]))
    }

    /// Covariance of the whole state.
    pub const fn covariance(&self) -> &Covariance {
        &self.covariance
    }

    /// What it has learnt of lasting errors.
    pub fn errors(&self) -> Errors {
        let e = &self.state;
        Errors { distance: e[3], turn: e[4], curve: e[5], slowing: e[6], bearing: e[7] }
    }

    /// Takes a step of the wheels that lasted `dt` (s). One that does not last is none.
    pub fn predict(&mut self, parameters: &Parameters, step: Increment, dt: f64) {
        if dt <= 0.0 {
            return;
        }
        let mended = self.mended(step, dt);
        let (s, c) = sincos(self.state[2] + mended.turn / 2.0);
        self.spread_out(parameters, step, mended, dt, [s, c]);
        self.set_pose(self.pose().along_arc(mended.distance, mended.turn));
    }

    /// The pose after a step, without what it does to the rest: a look ahead.
    pub fn ahead(&self, step: Increment, dt: f64) -> Pose {
        if dt <= 0.0 {
            return self.pose();
        }
        let mended = self.mended(step, dt);
        self.pose().along_arc(mended.distance, mended.turn)
    }

    /// What the wheels should have told.
    fn mended(&self, step: Increment, dt: f64) -> Increment {
        let errors = self.errors();
        Increment {
            distance: step.distance * (1.0 + errors.distance - errors.slowing * fabs(step.turn) / dt),
            turn: step.turn * (1.0 + errors.turn) + errors.curve * step.distance,
        }
    }

    fn spread_out(
        &mut self,
        parameters: &Parameters,
        told: Increment,
        done: Increment,
        dt: f64,
        [s, c]: [f64; 2],
    ) {
        // Only the rows of the pose depend on anything but themselves.
        let mut by_state = SMatrix::<f64, 3, STATES>::identity();
        let half = done.distance / 2.0;
        let (by_distance, by_slowing) = (told.distance, -told.distance * fabs(told.turn) / dt);
        let by_turn = [told.turn, told.distance];
        by_state[(0, 2)] = -done.distance * s;
        by_state[(1, 2)] = done.distance * c;
        for (column, travel) in [(3, by_distance), (6, by_slowing)] {
            by_state[(0, column)] = travel * c;
            by_state[(1, column)] = travel * s;
        }
        for (column, turn) in [(4, by_turn[0]), (5, by_turn[1])] {
            by_state[(0, column)] = -half * s * turn;
            by_state[(1, column)] = half * c * turn;
            by_state[(2, column)] = turn;
        }
        let p = &mut self.covariance;
        let rows = by_state * *p;
        p.fixed_rows_mut::<3>(0).copy_from(&rows);
        let columns = *p * by_state.transpose();
        p.fixed_columns_mut::<3>(0).copy_from(&columns);

        let (way, turned) = (fabs(done.distance), fabs(done.turn));
        let (along, across) = (parameters.along * way, parameters.across * way);
        p[(0, 0)] += c * c * along + s * s * across;
        p[(1, 1)] += s * s * along + c * c * across;
        p[(0, 1)] += c * s * (along - across);
        p[(1, 0)] += c * s * (along - across);
        p[(2, 2)] += parameters.turning * turned + parameters.swerving * way;
        for (i, drift) in parameters.drift.row().into_iter().enumerate() {
            p[(3 + i, 3 + i)] += drift * drift * dt;
        }
    }

    fn set_pose(&mut self, pose: Pose) {
        self.state[0] = pose.x;
        self.state[1] = pose.y;
        self.state[2] = wrap(pose.heading);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn exact() -> Parameters {
        Parameters {
            along: 0.0,
            across: 0.0,
            turning: 0.0,
            swerving: 0.0,
            drift: Errors::default(),
            ..Parameters::default()
        }
    }

    /// The end of a path for a start and errors that differ from none by `state`.
    fn end(parameters: &Parameters, state: Vector, steps: &[(f64, f64)]) -> [f64; 3] {
        let mut filter = Filter { state, covariance: Covariance::zeros() };
        for (distance, turn) in steps {
            filter.predict(parameters, Increment { distance: *distance, turn: *turn }, 0.1);
        }
        let pose = filter.pose();
        [pose.x, pose.y, pose.heading]
    }

    #[test]
    fn covariance_grows_as_differences_of_paths_say() {
        let parameters = exact();
        let steps: Vec<(f64, f64)> = (0..80).map(|i| (0.02, 0.03 * libm::sin(f64::from(i) * 0.1))).collect();
        let spread = [[0.01, 0.0, 0.0], [0.0, 0.01, 0.0], [0.0, 0.0, 0.01]];
        let mut filter = Filter::new(&parameters, Pose::default(), spread);
        // Errors that go together, so that the sign of each gradient counts.
        for (k, l) in [(3, 6), (3, 4), (4, 5), (2, 5), (0, 3)] {
            let together = 0.5 * (filter.covariance[(k, k)] * filter.covariance[(l, l)]).sqrt();
            filter.covariance[(k, l)] = together;
            filter.covariance[(l, k)] = together;
        }
        let before = filter.covariance;
        for (distance, turn) in &steps {
            filter.predict(&parameters, Increment { distance: *distance, turn: *turn }, 0.1);
        }
        let by: Vec<[f64; 3]> = (0..STATES)
            .map(|k| {
                let mut off = Vector::zeros();
                off[k] = 1e-5;
                let (more, less) = (end(&parameters, off, &steps), end(&parameters, -off, &steps));
                core::array::from_fn(|i| (more[i] - less[i]) / 2e-5)
            })
            .collect();
        let mut wanted = [[0.0; 3]; 3];
        for (k, l) in (0..STATES).flat_map(|k| (0..STATES).map(move |l| (k, l))) {
            for i in 0..3 {
                for j in 0..3 {
                    wanted[i][j] += by[k][i] * before[(k, l)] * by[l][j];
                }
            }
        }
        for (got, want) in filter.spread().iter().flatten().zip(wanted.iter().flatten()) {
            assert!(fabs(got - want) < 2e-3 * wanted[1][1], "{:?} for {wanted:?}", filter.spread());
        }
    }

    #[test]
    fn straight_travel_grows_the_covariance_as_the_integral_says() {
        let usual = Errors::default();
        let parameters = Parameters { usual, drift: usual, ..Parameters::default() };
        let mut filter = Filter::new(&parameters, Pose::default(), [[0.0; 3]; 3]);
        for _ in 0..4000 {
            filter.predict(&parameters, Increment { distance: 1e-3, turn: 0.0 }, 0.01);
        }
        // L = 4 m; along L, heading w L, across q L + w L³/3, and the correlation w L²/2.
        let (p, length) = (filter.spread(), 4.0);
        let w = parameters.swerving;
        for (got, want) in [
            (p[0][0], parameters.along * length),
            (p[2][2], w * length),
            (p[1][1], parameters.across * length + w * length * length * length / 3.0),
            (p[1][2], w * length * length / 2.0),
        ] {
            assert!(fabs(got / want - 1.0) < 2e-3, "{got} for {want}");
        }
    }

    #[test]
    fn known_errors_mend_what_the_wheels_tell() {
        let parameters = exact();
        let errors = Errors { distance: 0.05, turn: -0.1, curve: 0.2, slowing: 0.5, bearing: 0.0 };
        let mut filter = Filter::new(&parameters, Pose::default(), [[0.0; 3]; 3]).with_errors(errors);
        // Told are 2 m at a turn rate of 0.4 rad/s for 2 s: 0.8 rad.
        for _ in 0..200 {
            filter.predict(&parameters, Increment { distance: 0.01, turn: 0.004 }, 0.01);
        }
        let want = Pose::default().along_arc(2.0 * (1.0 + 0.05 - 0.5 * 0.4), 0.8 * 0.9 + 0.2 * 2.0);
        assert!(filter.pose().position().distance(want.position()) < 1e-9, "{:?}", filter.pose());
        assert!(fabs(filter.pose().heading - want.heading) < 1e-9);
    }
}
