//! What a sensor tells of the landmarks around it.

use crate::message::{Field, Message};
use crate::text::{Name, Sequence};

/// The most landmarks that one message tells of; where more are seen it tells of the nearest.
pub const MOST_LANDMARKS: usize = 16;

/// One landmark as a sensor sees it. What the sensor cannot know says so.
#[derive(Clone, Copy, Debug, PartialEq, Field)]
#[repr(C)]
pub struct LandmarkSighting {
    /// Which one it is, counted from 1; 0 where that is not known.
    pub id: u32,
    /// How far its middle is (m); no number (NaN) where that is not known.
    pub range: f32,
    /// Where its middle is (rad, counter-clockwise from ahead); no number (NaN) where that is not known.
    pub bearing: f32,
    /// From which side it is seen: 1 is the side to which it faces, 2 to 4 follow counter-clockwise, a quarter turn each; 0 where
    /// that is not known.
    pub side: u8,
}

impl Default for LandmarkSighting {
    /// Something of which nothing is known.
    fn default() -> LandmarkSighting {
        LandmarkSighting { id: 0, range: f32::NAN, bearing: f32::NAN, side: 0 }
    }
}

impl LandmarkSighting {
    /// Which one it is, if that is known.
    pub fn known_id(&self) -> Option<u32> {
        (self.id != 0).then_some(self.id)
    }

    /// How far it is (m), if that is known.
    pub fn known_range(&self) -> Option<f64> {
        self.range.is_finite().then_some(f64::from(self.range))
    }

    /// Where it is (rad), if that is known.
    pub fn known_bearing(&self) -> Option<f64> {
        self.bearing.is_finite().then_some(f64::from(self.bearing))
    }

    /// The direction in which the observer lies as the landmark sees it: the middle of its side, to the left of where it faces
    /// (rad). It is known to an eighth of a turn.
    pub fn known_side(&self) -> Option<f64> {
        let quarter = crate::geometry::TAU / 4.0;
        (1..=4).contains(&self.side).then(|| crate::geometry::wrap(f64::from(self.side - 1) * quarter))
    }
}

/// All landmarks that a sensor sees at one moment, the nearest first; none is a message, too.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct Landmarks {
    /// The frame from whose origin ranges and bearings count.
    pub frame: Name,
    /// What is seen.
    pub seen: Sequence<LandmarkSighting, MOST_LANDMARKS>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cdr::{Reader, Writer};
    use crate::time::Time;
    use alloc::vec::Vec;

    #[test]
    fn what_is_not_known_says_so_also_after_a_journey() {
        let near = LandmarkSighting { id: 3, range: 1.5, bearing: -0.25, ..LandmarkSighting::default() };
        let code = LandmarkSighting { id: 7, side: 4, ..LandmarkSighting::default() };
        let sent = Landmarks { frame: Name::new("base_link"), seen: [near, code].into_iter().collect() };
        let mut out = Writer::new();
        sent.encode(&[], Time::ZERO, &mut out);
        let mut input = Reader::new(out.bytes()).unwrap();
        let back = Landmarks::decode(&mut input, &mut Vec::new()).unwrap();
        let [a, b] = [back.seen[0], back.seen[1]];
        assert_eq!(a, near.clone());
        assert_eq!(
            (a.known_id(), a.known_range(), a.known_bearing(), a.known_side()),
            (Some(3), Some(1.5), Some(-0.25), None)
        );
        assert_eq!((b.known_id(), b.known_range(), b.known_bearing()), (Some(7), None, None));
        assert!((b.known_side().unwrap() + crate::geometry::PI / 2.0).abs() < 1e-12);
        assert_eq!(LandmarkSighting::default().known_id(), None);
    }
}
