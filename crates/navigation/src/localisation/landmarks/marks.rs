//! The landmarks that are known, and what is meant by what a sensor tells of them.
//!
//! In plain words: a camera tells how far and in which direction, and seldom which one; a receiver of infrared tells which one and from which
//! side, and neither how far nor where. Who hears a landmark stands in a quarter of a disc around it, and where in it is not known: that is
//! taken as the normal distribution with the same mean and covariance. For a sector of radius R and half opening α, along its axis x and
//! across it y:
//!
//! ```text
//! E x = (2/3) R sin α / α      E x² = (R²/4)(1 + sin 2α / 2α)      E y² = (R²/4)(1 − sin 2α / 2α)
//! ```
//!
//! and with α = 45°: 0.600 R away, known to 0.221 R along and to 0.301 R across. It is the same as long as the robot stays there, so it counts
//! once, when the robot comes in.

use libm::{sin, sincos};
use types::geometry::PI;
use types::messages::LandmarkSighting;
use types::{Duration, Point, Time};

use super::association::{Association, Landmark, associate};
use super::filter::{Filter, Parameters};
use super::sighting::{Sight, Sighting};

/// So many landmarks there are at most.
pub const MOST_MARKS: usize = 64;
/// A beacon that was not heard for so long (time) is heard anew. 1 s is ten readings of a common receiver.
const FORGOTTEN: Duration = Duration::secs(1);
/// Half of the opening of a side (rad).
pub(super) const HALF_SIDE: f64 = PI / 4.0;

/// A landmark whose place is known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mark {
    /// Its number, from 1.
    pub id: u32,
    /// Its place (m).
    pub at: Point,
    /// Where its first side looks (rad).
    pub facing: f64,
}

/// The landmarks that are known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Marks {
    marks: Vec<Mark>,
    /// The same, as the filter wants them.
    landmarks: Vec<Landmark>,
    /// How far their transmitters are heard (m).
    reach: f64,
}

/// What is meant by a sighting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Meant {
    /// This.
    Sight(Sight),
    /// It could be of two landmarks, or tells too little.
    Open,
    /// It is of none that is known.
    Nothing,
}

impl Marks {
    /// At most [`MOST_MARKS`] landmarks, whose transmitters are heard so far (m).
    pub fn new(marks: impl IntoIterator<Item = Mark>, reach: f64) -> Marks {
        let marks: Vec<Mark> = marks.into_iter().take(MOST_MARKS).collect();
        let landmarks = marks.iter().map(|mark| Landmark::exact(mark.at)).collect();
        Marks { marks, landmarks, reach }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.marks.is_empty()
    }

    pub(super) fn all(&self) -> &[Mark] {
        &self.marks
    }

    pub(super) const fn reach(&self) -> f64 {
        self.reach
    }

    pub(super) fn of(&self, id: u32) -> Option<&Mark> {
        self.marks.iter().find(|mark| mark.id == id)
    }

    /// What is meant by a sighting, for who believes to be somewhere.
    pub fn meant(&self, believed: &Filter, parameters: &Parameters, seen: &LandmarkSighting) -> Meant {
        let known = match seen.known_id().map(|id| self.of(id)) {
            Some(None) => return Meant::Nothing,
            Some(Some(mark)) => Some(mark),
            None => None,
        };
        let Some(sighting) = sighting(seen) else {
            let side = known.zip(seen.known_side());
            return side.map_or(Meant::Open, |(mark, side)| Meant::Sight(self.heard(mark, side)));
        };
        match known {
            Some(mark) => Meant::Sight(Landmark::exact(mark.at).seen(sighting)),
            None => match associate(believed, parameters, sighting, &self.landmarks) {
                Association::One(number) => Meant::Sight(self.landmarks[number].seen(sighting)),
                Association::Either(..) => Meant::Open,
                Association::None => Meant::Nothing,
            },
        }
    }

    /// Where a robot is that hears a landmark from a side (rad, to the left of where the landmark faces).
    fn heard(&self, mark: &Mark, side: f64) -> Sight {
        let flat = sin(2.0 * HALF_SIDE) / (2.0 * HALF_SIDE);
        let middle = 2.0 / 3.0 * self.reach * sin(HALF_SIDE) / HALF_SIDE;
        let quarter = self.reach * self.reach / 4.0;
        let (along, across) = (quarter * (1.0 + flat) - middle * middle, quarter * (1.0 - flat));
        let (s, c) = sincos(mark.facing + side);
        let both = (along - across) * s * c;
        let spread = [[along * c * c + across * s * s, both], [both, along * s * s + across * c * c]];
        Sight::Near(mark.at + Point::new(c, s) * middle, spread)
    }
}

/// Range and bearing, where both are known.
pub(super) fn sighting(seen: &LandmarkSighting) -> Option<Sighting> {
    Some(Sighting { range: seen.known_range()?, bearing: seen.known_bearing()? })
}

/// Which beacons are being heard.
#[derive(Clone, Debug)]
pub(super) struct Ears {
    heard: Vec<(u32, u8, Time)>,
}

impl Default for Ears {
    fn default() -> Ears {
        Ears { heard: Vec::with_capacity(MOST_MARKS) }
    }
}

impl Ears {
    /// Hears a beacon from a side. Gives whether it comes from there only now.
    pub(super) fn hear(&mut self, at: Time, id: u32, side: u8) -> bool {
        if let Some((_, from, last)) = self.heard.iter_mut().find(|(known, ..)| *known == id) {
            let is_new = *from != side || at - *last > FORGOTTEN;
            (*from, *last) = (side, at);
            return is_new;
        }
        if self.heard.len() == MOST_MARKS {
            self.heard.remove(0);
        }
        self.heard.push((id, side, at));
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use types::Pose;
    use types::chance::Stream;

    fn two() -> Marks {
        let mark = |id, x, y| Mark { id, at: Point::new(x, y), facing: PI / 2.0 };
        Marks::new([mark(3, 2.0, 0.0), mark(8, 2.0, 3.0)], 2.0)
    }

    #[test]
    fn who_hears_a_landmark_is_in_the_quarter_before_that_side() {
        // The mean and the covariance of the quarter, by a million points in it.
        let stream = Stream::new(2, "quarter");
        let (mut n, mut sums, mut squares) = (0.0, [0.0; 2], [[0.0; 2]; 2]);
        for k in 0..1_000_000u64 {
            let p = [stream.uniform(2 * k) * 4.0 - 2.0, stream.uniform(2 * k + 1) * 4.0 - 2.0];
            let bearing = p[1].atan2(p[0]);
            // The third side of a landmark that faces up looks down.
            if p[0].hypot(p[1]) <= 2.0 && (bearing + PI / 2.0).abs() <= PI / 4.0 {
                n += 1.0;
                for i in 0..2 {
                    sums[i] += p[i];
                    (0..2).for_each(|j| squares[i][j] += p[i] * p[j]);
                }
            }
        }
        let marks = two();
        let heard = LandmarkSighting { id: 3, side: 3, ..LandmarkSighting::default() };
        let parameters = Parameters::default();
        let filter = Filter::new(&parameters, Pose::default(), [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0; 3]]);
        let Meant::Sight(Sight::Near(at, spread)) = marks.meant(&filter, &parameters, &heard) else {
            panic!("it is near")
        };
        let mean = sums.map(|sum| sum / n);
        assert!((at.x - 2.0 - mean[0]).abs() < 0.005 && (at.y - mean[1]).abs() < 0.005, "{at:?} {mean:?}");
        for i in 0..2 {
            for j in 0..2 {
                let drawn = squares[i][j] / n - mean[i] * mean[j];
                assert!((spread[i][j] - drawn).abs() < 0.003, "{spread:?} {drawn}");
            }
        }
    }

    #[test]
    fn a_sighting_means_what_is_told_or_what_fits_alone() {
        let (marks, parameters) = (two(), Parameters::default());
        let spread = [[0.01, 0.0, 0.0], [0.0, 0.01, 0.0], [0.0, 0.0, 0.01]];
        let filter = Filter::new(&parameters, Pose::default(), spread);
        let seen = LandmarkSighting { range: 2.1, bearing: 0.02, ..LandmarkSighting::default() };
        let meant = |id| marks.meant(&filter, &parameters, &LandmarkSighting { id, ..seen });
        let of = |meant| match meant {
            Meant::Sight(Sight::Of(_, at, _)) => Some(at),
            _ => None,
        };
        assert_eq!(of(meant(0)), Some(Point::new(2.0, 0.0)), "it fits alone");
        assert_eq!(of(meant(8)), Some(Point::new(2.0, 3.0)), "who tells its number is believed");
        assert_eq!(meant(5), Meant::Nothing, "nobody knows that number");
        let behind = LandmarkSighting { bearing: 3.0, ..seen };
        assert_eq!(marks.meant(&filter, &parameters, &behind), Meant::Nothing);
        assert_eq!(marks.meant(&filter, &parameters, &LandmarkSighting::default()), Meant::Open);
    }

    #[test]
    fn a_beacon_counts_when_it_comes_and_when_its_side_changes() {
        let mut ears = Ears::default();
        let at = |tenths: i64| Time::ZERO + Duration::millis(100 * tenths);
        let heard = [(0, 1, 1), (1, 1, 1), (1, 2, 4), (2, 1, 2), (11, 1, 2), (22, 1, 2)];
        let new: Vec<bool> =
            heard.iter().map(|(tenths, id, side)| ears.hear(at(*tenths), *id, *side)).collect();
        assert_eq!(new, [true, false, true, true, false, true]);
    }
}
