//! Places that fit, followed from scan to scan until one is left.

use libm::sincos;
use types::geometry::wrap;
use types::{Point, Pose};

use super::{Fix, FloorParams};
use crate::floor::Distances;
use crate::linear::{Matrix, ZERO};
use crate::matching::{Beam, Scan, match_carefully};

/// So many places are followed at most.
pub const MOST_PLACES: usize = 8;
/// Two places nearer than this (m, rad) are one.
const SAME: (f64, f64) = (0.25, 0.2);
/// The evidence of ten scans counts.
const KEPT: f64 = 0.9;
/// Deviation (m) and limit (squared deviations over two) of a point's distance, and what all points are worth together.
const NOISE: f64 = 0.04;
const MOST: f64 = 3.0;
const WORTH: f64 = 15.0;
/// A place that did not fit so many times in a row is left.
const MISSES: u32 = 3;
/// A place that is worse than another by so many margins is left.
const HOPELESS: f64 = 3.0;

/// A place that fits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Place {
    /// Where.
    pub pose: Pose,
    /// The share of the points that lie on the plan.
    pub inliers: f64,
    /// How many scans fitted.
    pub fitted: u32,
    information: Matrix,
    unseen: u8,
    misses: u32,
    /// The sum of the evidence of its scans and that of their weights.
    evidence: f64,
    scans: f64,
}

impl Place {
    /// How much better it is than another (nats): by the scans that both have seen.
    fn over(&self, other: &Place) -> f64 {
        let mean = |place: &Place| place.evidence / place.scans.max(1.0);
        (mean(self) - mean(other)) * self.scans.min(other.scans)
    }

    fn is_same(&self, pose: Pose) -> bool {
        (self.pose.position() - pose.position()).is_within(SAME.0)
            && wrap(self.pose.heading - pose.heading).abs() <= SAME.1
    }

    /// Lays a scan over the floor from here. Gives whether it fits.
    fn fit(&mut self, floor: &impl Distances, scan: &Scan, params: &FloorParams) -> bool {
        let found = match_carefully(floor, scan, self.pose, &params.matching).ok();
        let found = found.filter(|found| found.inliers >= params.inliers_sure * 0.75);
        let Some(found) = found else { return false };
        let evidence = evidence(floor, scan, found.pose);
        *self = Place {
            pose: found.pose,
            inliers: found.inliers,
            fitted: self.fitted + 1,
            information: found.information,
            unseen: found.unseen,
            misses: 0,
            evidence: KEPT * self.evidence + evidence,
            scans: KEPT * self.scans + 1.0,
        };
        true
    }
}

/// How well a scan fits (nats, not positive).
fn evidence(floor: &impl Distances, scan: &Scan, pose: Pose) -> f64 {
    let (s, c) = sincos(pose.heading);
    let turn = |p: Point| Point::new(c * p.x - s * p.y, s * p.x + c * p.y);
    let met = |beam: &Beam| floor.met_square(pose.position() + turn(beam.end), turn(beam.direction));
    let off = |beam: &Beam| met(beam).map_or(MOST, |square| (square / (2.0 * NOISE * NOISE)).min(MOST));
    let sum: f64 = scan.beams().iter().map(off).sum();
    -WORTH * sum / scan.beams().len().max(1) as f64
}

/// The places, the best first.
#[derive(Clone, Debug)]
pub(super) struct Candidates {
    places: Vec<Place>,
}

impl Default for Candidates {
    fn default() -> Candidates {
        Candidates { places: Vec::with_capacity(MOST_PLACES + 1) }
    }
}

impl Candidates {
    pub(super) fn places(&self) -> &[Place] {
        &self.places
    }

    pub(super) fn clear(&mut self) {
        self.places.clear();
    }

    pub(super) fn predict(&mut self, moved: Pose) {
        self.places.iter_mut().for_each(|place| place.pose = place.pose.then(moved));
    }

    /// Lays the scan over the floor from each place.
    pub(super) fn follow(&mut self, floor: &impl Distances, scan: &Scan, params: &FloorParams) {
        for place in &mut self.places {
            if !place.fit(floor, scan, params) {
                place.misses += 1;
                place.fitted = 0;
                place.evidence = KEPT * place.evidence - WORTH * MOST;
                place.scans = KEPT * place.scans + 1.0;
            }
        }
        self.places.retain(|place| place.misses < MISSES);
        self.unite();
        if let Some(best) = self.places.first().copied() {
            self.places.retain(|place| best.over(place) <= HOPELESS * params.margin);
        }
    }

    /// Follows also a place that somebody proposes, if it fits and is none that is followed.
    pub(super) fn propose(&mut self, floor: &impl Distances, scan: &Scan, pose: Pose, params: &FloorParams) {
        if self.places.iter().any(|place| place.is_same(pose)) {
            return;
        }
        let mut place = Place { pose, information: ZERO, ..Place::default() };
        if place.fit(floor, scan, params) && !self.places.iter().any(|known| known.is_same(place.pose)) {
            self.places.push(place);
            self.unite();
            self.places.truncate(MOST_PLACES);
        }
    }

    /// The best first; of two that have become one the better stays.
    fn unite(&mut self) {
        let mean = |place: &Place| place.evidence / place.scans.max(1.0);
        self.places.sort_unstable_by(|a, b| mean(b).total_cmp(&mean(a)));
        let mut at = 0;
        while at < self.places.len() {
            let pose = self.places[at].pose;
            if self.places[..at].iter().any(|better| better.is_same(pose)) {
                self.places.remove(at);
            } else {
                at += 1;
            }
        }
    }

    /// The one place that fits, if no other fits as well.
    pub(super) fn winner(&self, params: &FloorParams) -> Option<Fix> {
        let (best, others) = self.places.split_first()?;
        let is_sure = best.fitted >= params.fitted && best.inliers >= params.inliers_sure && best.unseen == 0;
        let is_alone = others.iter().all(|other| best.over(other) > params.margin);
        (is_sure && is_alone).then_some((best.pose, best.information))
    }
}
