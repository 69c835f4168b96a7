//! Where a robot is on a known floor: dead reckoning, corrected by what a laser sees; and a search when that does not fit.
//!
//! ```text
//!            place            three scans in a row do not fit
//!   Searching ────▶ Tracking ─────────────────────────────────▶ Searching
//!       │  ▲           ▲  │                                        │
//!       │  └───────────│──┼── scans come again ── Lost ◀───────────┤ no scan, the same scan again
//!       └──────────────┘  └──────────────────────▲                 ▼ and again
//!        one place alone fits     the same scan again and again
//! ```
//!
//! While it tracks: an extended Kalman filter over (x, y, heading). The wheels predict ([`drift`](crate::drift)), a scan that is laid over the floor
//! ([`crate::matching`]) corrects, in the form of information, so that what a scan does not tell is not touched:
//!
//! ```text
//!   P⁻ = F P Fᵀ + G Q Gᵀ,  Λ = (P⁻)⁻¹ + I,  x = x⁻ + Λ⁻¹ I (z − x⁻)
//!   gate: (z − x⁻)ᵀ (I − I Λ⁻¹ I) (z − x⁻) ≤ χ²
//! ```
//!
//! Landmarks that are seen meanwhile ([`FloorLocalizer::sees`]) correct the same belief by their range and bearing, as
//! [`sighting`](super::landmarks::sighting) has it; what fits counts as a scan that fits does, so the robot is searched for when neither does.
//!
//! While it searches: a cloud ([`crate::monte_carlo`]) and draws from anywhere propose places; each is laid over the floor and followed
//! from scan to scan. It is decided when one fits and no other fits as well ([`FloorLocalizer::places`] tells them); on a floor that looks the same from
//! two places that is never.
//!
//! A pose is given only right after a scan that fits. In between, dead reckoning goes on from there: [`FloorLocalizer::pose_at`].

mod belief;
mod candidates;
mod params;

pub use candidates::{MOST_PLACES, Place};
pub use params::FloorParams;

use types::chance::Stream;
use types::messages::LandmarkSighting;
use types::{Pose, Time};

use crate::floor::Distances;
use crate::linear::{Matrix, deviations, diagonal};
use crate::localisation::State;
use crate::localisation::landmarks::{Believer, Effect, Errors, Filter, Parameters, Sight, Watch};
use crate::matching::{Geometry, Match, MatchParams, NoMatch, Scan, came_through, match_carefully};
use crate::monte_carlo::{Hypothesis, MOST_HYPOTHESES, MonteCarlo};
use belief::Belief;
use candidates::Candidates;

/// What became of a scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It fits: the pose is that of the scan.
    Fixed,
    /// It helped in the search.
    Searched,
    /// It is, to the last bit, the one before, and the robot stands: nothing is learnt.
    Repeated,
    /// It is, to the last bit, the one before, though the robot has moved: the laser is stuck.
    Stuck,
    /// Too little came back: dead reckoning goes on.
    Empty,
    /// Something hides what the plan shows, and nothing speaks against where the robot should be: dead reckoning goes on.
    Hidden,
    /// It does not fit where the robot should be.
    Misfit,
}

/// Where the robot is. All memory is taken when it is made: that of the floor, and 2 MB for 8000 particles.
#[derive(Clone, Debug)]
pub struct FloorLocalizer<F> {
    floor: F,
    params: FloorParams,
    state: State,
    belief: Belief,
    /// Where the wheels said that the robot is when the belief was true.
    odometry: Option<Pose>,
    scan: Scan,
    /// The digest of the last scan, and where the wheels said that it was first seen.
    last: Option<(u64, Pose)>,
    misses: u32,
    /// Scans in a row that were hidden while the robot was under way.
    hidden: u32,
    /// Whether the wheels have rolled since the scan before.
    is_moving: bool,
    /// Whether the last scan that was not a repetition fits.
    is_fixed: bool,
    /// Whether a scan has confirmed what somebody said.
    is_confirmed: bool,
    inliers: f64,
    cloud: MonteCarlo,
    candidates: Candidates,
    hypotheses: Vec<Hypothesis>,
    /// Scans since the search began.
    searched: u32,
}

impl<F: Distances> FloorLocalizer<F> {
    /// Of a robot that may be anywhere.
    pub fn new(floor: F, params: FloorParams, stream: Stream) -> FloorLocalizer<F> {
        let cloud = MonteCarlo::new(&floor, params.radius, params.cloud, stream);
        FloorLocalizer {
            floor,
            params,
            state: State::Searching,
            belief: Belief::default(),
            odometry: None,
            scan: Scan::new(),
            last: None,
            misses: 0,
            hidden: 0,
            is_moving: false,
            is_fixed: false,
            is_confirmed: false,
            inliers: 0.0,
            cloud,
            candidates: Candidates::default(),
            hypotheses: Vec::with_capacity(MOST_HYPOTHESES),
            searched: 0,
        }
    }

    /// Somebody says where the robot is, with deviations of the place (m) and the heading (rad).
    pub fn place(&mut self, pose: Pose, place: f64, heading: f64) {
        let (place, heading) = (place.max(1e-3), heading.max(1e-3));
        self.belief =
            Belief { pose, covariance: diagonal([place * place, place * place, heading * heading]) };
        (self.state, self.misses) = (State::Tracking, 0);
        (self.is_fixed, self.is_confirmed) = (false, false);
    }

    /// Nothing is known any more: the robot may be anywhere.
    pub fn forget(&mut self) {
        self.search(None);
    }

    /// Other parameters from now on. Those of the cloud stay.
    pub fn set_params(&mut self, params: FloorParams) {
        self.params = FloorParams { cloud: self.params.cloud, radius: self.params.radius, ..params };
    }

    /// Takes a scan, and where the wheels said that the robot was when it was taken (in any frame that does not jump).
    pub fn update(&mut self, odometry: Pose, ranges: &[f32], geometry: &Geometry) -> Outcome {
        let moved = self.moved(odometry);
        self.predict(odometry, moved);
        self.is_moving = moved != Pose::default();
        let digest = digest(ranges);
        if let Some((before, first)) = self.last
            && before == digest
        {
            let since = first.inverse().then(odometry);
            let still =
                since.position().norm() < self.params.still.0 && since.heading.abs() < self.params.still.1;
            return if still { Outcome::Repeated } else { self.miss(Outcome::Stuck) };
        }
        self.last = Some((digest, odometry));
        self.scan.take(ranges, geometry, self.params.beams);
        let outcome = match self.state {
            State::Tracking => self.track(),
            State::Searching | State::Lost => self.look(moved),
        };
        self.is_fixed = outcome == Outcome::Fixed;
        outcome
    }

    /// For so long no scan came that the robot is lost. Dead reckoning goes on, as a hint for the search when scans come again.
    pub fn silence(&mut self, odometry: Pose) {
        let moved = self.moved(odometry);
        self.predict(odometry, moved);
        (self.state, self.is_fixed) = (State::Lost, false);
    }

    /// Takes what was seen of landmarks at a time, when the wheels said that the robot is at `odometry`. Gives whether anything in it told where that
    /// is. A place that landmarks tell in a search is as one that [somebody says](FloorLocalizer::place): the next scan must confirm it.
    pub fn sees(&mut self, watch: &mut Watch, at: Time, odometry: Pose, seen: &[LandmarkSighting]) -> bool {
        if watch.marks().is_empty() {
            return false;
        }
        let moved = self.moved(odometry);
        self.predict(odometry, moved);
        let (parameters, is_known) = (*watch.parameters(), self.state == State::Tracking);
        let mut believer = Corrected { belief: &mut self.belief, parameters, is_known };
        let told = watch.take(at, odometry, seen, &mut believer);
        if let Some((pose, spread)) = told.found {
            let (place, heading) = deviations(&spread);
            self.place(pose, place, heading);
        }
        if told.fitted > 0 {
            self.misses = 0;
        }
        told.fitted > 0 || told.found.is_some()
    }

    /// Takes a pose that somebody else has measured for the time of the last scan, with the inverse of its covariance. Gives whether it was
    /// believed: while the robot is tracked, and as far as it agrees.
    pub fn correct(&mut self, measured: Pose, information: &[[f64; 3]; 3]) -> bool {
        self.state == State::Tracking && self.belief.correct(measured, information, self.params.gate)
    }

    /// What is known.
    pub fn state(&self) -> State {
        self.state
    }

    /// Where the robot was at the last scan; nothing unless that is known.
    pub fn pose(&self) -> Option<Pose> {
        (self.state == State::Tracking).then_some(self.belief.pose)
    }

    /// Where the robot was at the last scan, if that scan itself fits: what others may be told.
    pub fn fix(&self) -> Option<Pose> {
        self.pose().filter(|_| self.is_fixed)
    }

    /// Where the robot is when its wheels say this, going on from the last scan; nothing unless that is known.
    pub fn pose_at(&self, odometry: Pose) -> Option<Pose> {
        let before = self.odometry?;
        self.pose().map(|pose| pose.then(before.inverse().then(odometry)))
    }

    /// The covariance of that pose over (x, y, heading).
    pub fn covariance(&self) -> [[f64; 3]; 3] {
        self.belief.covariance
    }

    /// Deviations of the place, along the axis in which it is larger (m), and of the heading (rad).
    pub fn deviations(&self) -> (f64, f64) {
        self.belief.deviations()
    }

    /// The share of the last scan's points that lie on something that the floor plan shows.
    pub fn inliers(&self) -> f64 {
        self.inliers
    }

    /// The places that fit while it searches, the best first.
    pub fn places(&self) -> &[Place] {
        self.candidates.places()
    }

    /// The floor.
    pub fn floor(&self) -> &F {
        &self.floor
    }

    fn moved(&mut self, odometry: Pose) -> Pose {
        self.odometry.replace(odometry).map_or(Pose::default(), |before| before.inverse().then(odometry))
    }

    fn predict(&mut self, odometry: Pose, moved: Pose) {
        self.odometry = Some(odometry);
        self.belief.predict(moved, &self.params.drift);
        self.candidates.predict(moved);
        let (place, heading) = self.belief.deviations();
        if self.state == State::Tracking && (place > self.params.lost.0 || heading > self.params.lost.1) {
            self.search(Some(self.belief.pose));
        }
    }

    fn track(&mut self) -> Outcome {
        let params = self.params.matching;
        let reach = self.belief.reach(&self.params);
        let found =
            match_carefully(&self.floor, &self.scan, self.belief.pose, &MatchParams { reach, ..params });
        let found = match found {
            Ok(found) => found,
            Err(NoMatch::FewReturns) => return Outcome::Empty,
            Err(NoMatch::NothingNear) => return self.misfit(),
        };
        self.inliers = found.inliers;
        if !self.fits(&found) || !self.belief.correct(found.pose, &found.information, self.params.gate) {
            return self.misfit();
        }
        (self.misses, self.hidden, self.is_confirmed) = (0, 0, true);
        Outcome::Fixed
    }

    /// Whether enough of the scan lies on the plan: less where the rest is only hidden, by things that the plan does not show.
    fn fits(&self, found: &Match) -> bool {
        let FloorParams { inliers_least, inliers_sure, inliers_hidden, through_hidden, .. } = self.params;
        if !self.is_confirmed {
            return found.inliers >= inliers_sure;
        }
        found.inliers >= inliers_least
            || found.inliers >= inliers_hidden
                && came_through(&self.floor, &self.scan, found.pose, SLACK) <= through_hidden
    }

    /// What does not fit: since something hides what the plan shows, or since the robot is not where it should be.
    fn misfit(&mut self) -> Outcome {
        let FloorParams { through_most, hidden_most, .. } = self.params;
        // What the wheels may have missed is no contradiction.
        let slack = SLACK + 2.0 * self.belief.deviations().0;
        if self.is_confirmed
            && self.hidden < hidden_most
            && came_through(&self.floor, &self.scan, self.belief.pose, slack) <= through_most
        {
            // One that stands still gets nowhere by what it does not see.
            self.hidden += u32::from(self.is_moving);
            self.is_fixed = false;
            return Outcome::Hidden;
        }
        self.miss(Outcome::Misfit)
    }

    fn miss(&mut self, outcome: Outcome) -> Outcome {
        self.misses += 1;
        self.is_fixed = false;
        if self.misses >= self.params.misses {
            if outcome == Outcome::Stuck {
                self.state = State::Lost;
            } else {
                self.search(Some(self.belief.pose));
            }
        }
        outcome
    }

    /// Begins a search, with a place where the robot might be.
    fn search(&mut self, hint: Option<Pose>) {
        match hint {
            Some(hint) => self.cloud.gather(hint, self.params.hint.0, self.params.hint.1),
            None => self.cloud.scatter(),
        }
        self.candidates.clear();
        (self.state, self.searched, self.inliers) = (State::Searching, 0, 0.0);
        (self.misses, self.hidden) = (0, 0);
        if let Some(hint) = hint {
            self.candidates.propose(&self.floor, &self.scan, hint, &self.params);
        }
    }

    /// One round of the search.
    fn look(&mut self, moved: Pose) -> Outcome {
        if self.scan.is_poor() {
            return self.miss(Outcome::Stuck);
        }
        if self.state == State::Lost {
            self.search(Some(self.belief.pose).filter(|_| self.belief.is_known()));
        }
        self.misses = 0;
        self.searched += 1;
        let FloorLocalizer { floor, scan, cloud, candidates, hypotheses, params, .. } = self;
        cloud.predict(moved, &params.drift);
        cloud.weigh(floor, scan);
        cloud.hypotheses(hypotheses);
        cloud.resample();
        candidates.follow(floor, scan, params);
        let draws = (cloud.area() * params.draws).min(params.draws_most as f64) as usize;
        let elsewhere = cloud.elsewhere(floor, scan, draws);
        let proposed = hypotheses.iter().chain(&elsewhere).filter(|proposed| proposed.weight > 0.0);
        proposed.for_each(|proposed| candidates.propose(floor, scan, proposed.pose, params));
        self.inliers = candidates.places().first().map_or(0.0, |place| place.inliers);
        // On a floor that is too large to be looked at as densely in each round it takes as many more.
        let rounds =
            (self.cloud.area() * self.params.draws / f64::from(self.params.draws_most.max(1))).max(1.0);
        if f64::from(self.searched) >= f64::from(self.params.searched) * rounds
            && let Some((pose, information)) = self.candidates.winner(&self.params)
        {
            self.belief = Belief::of(pose, &information);
            (self.state, self.is_confirmed) = (State::Tracking, true);
            self.candidates.clear();
            return Outcome::Fixed;
        }
        if self.searched >= self.params.give_up && self.candidates.places().is_empty() {
            self.search(None);
        }
        Outcome::Searched
    }
}

/// The belief, for sightings of landmarks.
struct Corrected<'a> {
    belief: &'a mut Belief,
    parameters: Parameters,
    is_known: bool,
}

impl Corrected<'_> {
    /// A filter of which only the pose counts: lasting errors of wheels are not learnt here.
    fn filter(&self) -> Filter {
        let parameters = Parameters { usual: Errors::default(), ..self.parameters };
        Filter::new(&parameters, self.belief.pose, self.belief.covariance)
    }
}

impl Believer for Corrected<'_> {
    fn belief(&self) -> Option<Filter> {
        self.is_known.then(|| self.filter())
    }

    fn take(&mut self, sight: &Sight) -> Effect {
        let mut filter = self.filter();
        let effect = filter.correct(&self.parameters, sight);
        *self.belief = Belief { pose: filter.pose(), covariance: filter.spread() };
        effect
    }
}

/// A number that differs for scans that differ, but for a chance of one to 2⁶⁴: FNV-1a over the bits.
fn digest(ranges: &[f32]) -> u64 {
    let fold =
        |hash: u64, range: &f32| (hash ^ u64::from(range.to_bits())).wrapping_mul(0x0000_0100_0000_01b3);
    ranges.iter().fold(0xcbf2_9ce4_8422_2325 ^ ranges.len() as u64, fold)
}

/// A beam that ends so much behind something has come through it (m): more than noise, and less than what a robot is pushed unnoticed.
const SLACK: f64 = 0.2;

/// What a scan says of a pose.
type Fix = (Pose, Matrix);

#[cfg(test)]
mod tests;
