//! The lookout: puts the people that a camera sees among the distances that were heard, so that both keep the robot away from them.
//!
//! ```text
//!  ranges ─────────────────────────────────────┬─▶ in each direction the nearer of the two ─▶ ranges
//!  sightings ─▶ how far, by how large it looks ┘
//! ```
//!
//! A sonar hears nothing of soft clothes and smooth faces that it meets obliquely; a camera sees a face all the same. With the opening φ of
//! the camera from side to side and its height a in widths, a face of the area A that covers the share s of the picture is at the
//! distance
//!
//! ```text
//! d = √(A / (s a)) / (2 tan(φ/2))
//! ```
//!
//! and the body below it is as much nearer as it is thick. A face that is half hidden looks farther away than it is, so what is heard
//! counts where it is nearer. What is taken for a face and is none holds the robot back as a face does: better have a recogniser that
//! asks for a shape.

use libm::{asin, cos, sqrt, tan};
use runtime::{Agent, Envelope, Fault, Input, Output, Step};
use types::geometry::{PI, wrap};
use types::messages::{Ranges, Sighting};
use types::params::Params;
use types::{Duration, Time};

use crate::shared::Dated;

/// What is seen, and when it is believed.
#[derive(Clone, Debug, Params)]
pub struct LookoutParams {
    /// Area of what is recognised (m²). 0.026 is a face of 15 by 22 cm.
    #[param(default = 0.026, min = 0.0001, max = 10.0)]
    pub area: f64,
    /// Radius of the body to which it belongs (m). 0.25 is somebody with the arms hanging down.
    #[param(default = 0.25, min = 0.0, max = 2.0)]
    pub body: f64,
    /// Opening of the camera from side to side (rad). PI / 3 is 60°, common for web cameras.
    #[param(default = PI / 3.0, min = 0.1, max = 3.0)]
    pub field_of_view: f64,
    /// Height of the picture (widths of it). 0.75 is a picture of 4 to 3.
    #[param(default = 0.75, min = 0.1, max = 10.0)]
    pub aspect: f64,
    /// Sightings less sure than this are passed over (0 to 1). 0.5 is a region that is as compact as a face and has more than a few pixels.
    #[param(default = 0.5, min = 0.0, max = 1.0)]
    pub confidence_min: f64,
    /// What seems farther than this is left to the ranges (m). 3 is twice the way at which anything is a danger.
    #[param(default = 3.0, min = 0.0, max = 100.0)]
    pub reach: f64,
    /// How long a sighting counts (time). 500 ms is seven pictures.
    #[param(default = Duration::millis(500), min = 0.01, max = 60.0)]
    pub hold: Duration,
}

impl LookoutParams {
    /// How far away the middle of the body is over the floor (m).
    fn distance(&self, seen: &Sighting) -> f64 {
        let away = sqrt(self.area / (seen.share * self.aspect)) / (2.0 * tan(self.field_of_view / 2.0));
        away * cos(seen.elevation)
    }
}

/// Puts who is seen among the distances that were heard: in each direction what is nearer counts.
#[derive(Agent)]
pub struct Lookout {
    /// Distances as they were heard.
    heard: Input<Ranges>,
    /// Who is seen, by any number of recognisers.
    sightings: Input<Sighting>,
    /// The nearer of both in each direction.
    #[port(history = 16, interpreted)]
    ranges: Output<Ranges>,
    params: LookoutParams,
    crowd: Crowd,
}

impl Agent for Lookout {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while let Some(sighting) = self.sightings.take() {
            self.crowd.see(&sighting, sighting.header().stamp);
        }
        let Some(received) = self.heard.newest() else { return Ok(()) };
        let stamp = received.header().stamp;
        let mut ranges = *received;
        self.crowd.approach(&self.params, &mut ranges, stamp);
        self.ranges.send_as(Envelope { stamp: Some(stamp), ..Envelope::default() }, ranges);
        Ok(())
    }
}

/// So many different things are kept in mind; of more, those that were seen first are forgotten.
const KINDS: usize = 8;

/// What was last seen of each kind.
#[derive(Clone, Copy, Debug, Default)]
struct Crowd {
    kinds: [Option<Dated<Sighting>>; KINDS],
}

impl Crowd {
    fn see(&mut self, sighting: &Sighting, stamp: Time) {
        let same = |held: &Option<Dated<Sighting>>| held.is_none_or(|held| held.value.what == sighting.what);
        let place = self.kinds.iter().position(same).unwrap_or(0);
        // What is gone from the picture may still be there: it counts for as long as it would have.
        if sighting.visible {
            self.kinds[place] = Some(Dated { value: *sighting, stamp });
        }
    }

    /// Shortens the distances in the directions of what is seen.
    fn approach(&self, params: &LookoutParams, ranges: &mut Ranges, stamp: Time) {
        for held in &self.kinds {
            let seen = Dated::fresh(held, stamp, params.hold);
            let sure = |seen: &Sighting| seen.confidence >= params.confidence_min && seen.share > 0.0;
            let Some(seen) = seen.filter(sure) else { continue };
            let middle = params.distance(&seen);
            if middle <= params.reach {
                let half = asin((params.body / middle.max(1e-3)).min(1.0));
                shorten(ranges, seen.bearing, half, (middle - params.body).max(0.0) as f32);
            }
        }
    }
}

/// Nothing is farther than `range` (m) in the directions within `half` (rad) of a bearing, of which one is at least the nearest.
fn shorten(ranges: &mut Ranges, bearing: f64, half: f64, range: f32) {
    let half = half.max(f64::from(ranges.angle_step) / 2.0);
    for i in 0..ranges.values.len() {
        if wrap(ranges.bearing(i) - bearing).abs() <= half {
            // Of a direction of which nothing is known, this is known now.
            let known = ranges.values[i];
            ranges.values[i] = if known < range { known } else { range };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::blank;

    /// A face of the default area at a distance (m), with the share that it has in the picture of a pinhole camera of 60°.
    fn face(bearing: f64, away: f64) -> Sighting {
        let width = 2.0 * away * (PI / 6.0).tan();
        let share = 0.026 / (width * width * 0.75);
        Sighting {
            what: "face".into(),
            bearing,
            share,
            confidence: 0.9,
            visible: true,
            ..Sighting::default()
        }
    }

    fn silent() -> Ranges {
        let mut ranges = blank(12, 0.15, 6.0);
        ranges.values.fill(6.0);
        ranges
    }

    fn at(millis: i64) -> Time {
        Time::ZERO + Duration::millis(millis)
    }

    fn after(sighting: Sighting, mut ranges: Ranges, millis: i64) -> Vec<f32> {
        let mut crowd = Crowd::default();
        crowd.see(&sighting, Time::ZERO);
        crowd.approach(&LookoutParams::default(), &mut ranges, at(millis));
        ranges.values.to_vec()
    }

    #[test]
    fn who_is_seen_stands_where_nothing_was_heard() {
        let values = after(face(0.5, 1.5), silent(), 100);
        // 30° is 0.52: the second direction.
        assert!((values[1] - 1.25).abs() < 1e-5, "{values:?}");
        assert!(values.iter().enumerate().all(|(i, range)| i == 1 || *range == 6.0));
        // From nearby a body is as wide as several directions.
        let near = after(face(0.0, 0.4), silent(), 100);
        assert_eq!(near.iter().filter(|range| **range < 0.2).count(), 3, "{near:?}");
    }

    #[test]
    fn what_is_heard_nearer_counts_and_nothing_known_is_replaced() {
        let mut ranges = silent();
        (ranges.values[0], ranges.values[1]) = (0.7, f32::NAN);
        assert_eq!(after(face(0.0, 1.5), ranges, 0)[0], 0.7);
        assert!((after(face(0.5, 1.5), ranges, 0)[1] - 1.25).abs() < 1e-5);
    }

    #[test]
    fn the_old_the_unsure_and_the_far_are_passed_over() {
        let heard = |sighting, millis| after(sighting, silent(), millis)[0] == 6.0;
        assert!(!heard(face(0.0, 1.5), 500));
        assert!(heard(face(0.0, 1.5), 501));
        assert!(heard(Sighting { confidence: 0.4, ..face(0.0, 1.5) }, 0));
        assert!(heard(face(0.0, 3.1), 0));
        assert!(heard(Sighting { share: 0.0, ..face(0.0, 1.5) }, 0));
    }

    #[test]
    fn each_kind_has_its_place_and_what_is_gone_still_counts_for_a_while() {
        let mut crowd = Crowd::default();
        crowd.see(&face(0.0, 1.5), at(0));
        crowd.see(&Sighting { what: "back".into(), ..face(3.1, 1.0) }, at(0));
        crowd.see(&Sighting { visible: false, ..face(0.0, 1.5) }, at(100));
        let mut ranges = silent();
        crowd.approach(&LookoutParams::default(), &mut ranges, at(400));
        assert!(ranges.values[0] < 2.0 && ranges.values[6] < 2.0, "{:?}", ranges.values);
    }
}
