//! A map of what stands where, from poses and scans: a grid of odds.
//!
//! In plain words: a beam that comes back tells that something stands at its end, and nothing before. Each cell keeps how often one was
//! told and how often the other, so a wrong beam, or somebody who walked by, is outvoted.
//!
//! For each scan z a cell that it tells of gets the logarithm of the odds p/(1 − p) that z alone would give it,
//!
//! ```text
//! l ← clamp(l + l_hit)   where a beam ends      l ← clamp(l + l_miss)   where one passes      else l
//! ```
//!
//! at most once for each scan, and where one beam of a scan ends and another passes, it ends: else beams along a wall would rub it out.
//! (Moravec and Elfes 1985; Thrun, Burgard and Fox, "Probabilistic Robotics", 2005, table 9.1, with an inverse model of a beam of width zero.)
//!
//! | module | is |
//! |---|---|
//! | [`ray`] | the cells that a beam goes through, one after another |

pub mod ray;

use types::Pose;
use types::geometry::Point;

use ray::{Lattice, Ray};

/// How much a beam tells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// What the end of a beam adds to the odds (logarithm). 0.85: a probability of 0.7.
    pub hit: f32,
    /// What passing takes from them (logarithm, positive). 0.4: a probability of 0.4; passing tells less, since a cell may be half full.
    pub miss: f32,
    /// The odds stay within this (logarithm). 3.5 is 0.97: eight scans can turn anything around, so that a map follows a door.
    pub limit: f32,
    /// Beams are followed so far at most (m); one that ends beyond tells only what is free until there.
    pub reach: f64,
}

impl Default for Parameters {
    fn default() -> Parameters {
        Parameters { hit: 0.85, miss: 0.4, limit: 3.5, reach: 20.0 }
    }
}

/// What is known of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Known {
    /// Nothing, or as much for as against.
    Unknown,
    /// Nothing stands there.
    Free,
    /// Something stands there.
    Taken,
}

/// One beam of a scan, as the sensor has it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Beam {
    /// Its direction, from straight ahead of the sensor to the left (rad).
    pub bearing: f64,
    /// How far it came (m).
    pub range: f64,
    /// Whether something sent it back.
    pub echo: bool,
}

/// Odds larger than this (logarithm) are taken for known: 0.65 and 0.35.
const KNOWN: f32 = 0.62;

/// A grid of odds over a part of the floor. All memory is taken when it is made.
#[derive(Clone, Debug)]
pub struct Occupancy {
    parameters: Parameters,
    lattice: Lattice,
    odds: Box<[f32]>,
    /// The last scan that told of a cell.
    told: Box<[u32]>,
    scan: u32,
}

impl Occupancy {
    /// Nothing is known of the floor that a lattice covers.
    pub fn new(parameters: Parameters, lattice: Lattice) -> Occupancy {
        let cells = lattice.cells();
        Occupancy {
            parameters,
            lattice,
            odds: vec![0.0; cells].into_boxed_slice(),
            told: vec![0; cells].into_boxed_slice(),
            scan: 0,
        }
    }

    /// Where its cells lie.
    pub const fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// Takes a scan from where the sensor stands (`map_from_sensor`). Beams that are no numbers are passed over.
    pub fn see(&mut self, sensor: Pose, beams: impl Iterator<Item = Beam> + Clone) {
        if ![sensor.x, sensor.y, sensor.heading].iter().all(|x| x.is_finite()) {
            return;
        }
        self.scan = self.scan.wrapping_add(1).max(1);
        let reach = self.parameters.reach;
        let beams = beams.filter(|beam| beam.bearing.is_finite() && beam.range > 0.0);
        for beam in beams.clone().filter(|beam| beam.echo && beam.range <= reach) {
            let end = sensor.position() + Point::polar(beam.range, sensor.heading + beam.bearing);
            if let Some(cell) = self.lattice.cell(end) {
                self.tell(cell, self.parameters.hit);
            }
        }
        for beam in beams {
            let end = sensor.position() + Point::polar(beam.range.min(reach), sensor.heading + beam.bearing);
            for cell in Ray::new(&self.lattice, sensor.position(), end) {
                self.tell(cell, -self.parameters.miss);
            }
        }
    }

    /// What is known of a cell; outside nothing is.
    pub fn known(&self, cell: usize) -> Known {
        match self.odds.get(cell) {
            Some(odds) if *odds > KNOWN => Known::Taken,
            Some(odds) if *odds < -KNOWN => Known::Free,
            _ => Known::Unknown,
        }
    }

    /// What is known of a place.
    pub fn at(&self, point: Point) -> Known {
        self.lattice.cell(point).map_or(Known::Unknown, |cell| self.known(cell))
    }

    /// The probability that something stands in a cell.
    pub fn probability(&self, cell: usize) -> f64 {
        let odds = f64::from(self.odds.get(cell).copied().unwrap_or(0.0));
        1.0 / (1.0 + libm::exp(-odds))
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.odds.fill(0.0);
        self.told.fill(0);
        self.scan = 0;
    }

    fn tell(&mut self, cell: usize, odds: f32) {
        if core::mem::replace(&mut self.told[cell], self.scan) != self.scan {
            let limit = self.parameters.limit;
            self.odds[cell] = (self.odds[cell] + odds).clamp(-limit, limit);
        }
    }
}

#[cfg(test)]
mod tests;
