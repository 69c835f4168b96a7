//! What was near a moment ago, and cannot be heard just now.
//!
//! Between two neighbouring sonars on the rim lies a strip that neither hears: their cones never meet, since the edges of both run in
//! one direction. A corner that moves into the strip is as hard as before. So the echoes of the last seconds are kept as points in the frame of the
//! odometry, until they are too old, or a sensor that looks there hears something behind them.

use libm::hypot;
use types::geometry::wrap;
use types::messages::Ranges;
use types::{Duration, Point, Pose, Time};

/// The most points that are kept.
const POINTS: usize = 192;
/// Points nearer to each other than this are one (m).
const SAME: f64 = 0.05;
/// An echo this much behind a point says that the point is not there (m): three standard deviations of a range, and the odometry.
const BEHIND: f64 = 0.12;
/// The part of a cone at whose ends points are placed too, besides its middle.
const ARC: f64 = 0.6;

/// What is known of the sensors, and how long to remember.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sensors {
    /// From the robot's centre to the sensors (m).
    pub(crate) rim: f64,
    /// Half the opening of a cone (rad).
    pub(crate) cone: f64,
    /// Echoes farther than this from the robot's centre are not kept (m).
    pub(crate) reach: f64,
    /// How long a point is kept.
    pub(crate) keep: Duration,
}

/// Echoes of the last seconds, as points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Recall {
    points: [(Point, Time); POINTS],
    len: usize,
}

impl Default for Recall {
    fn default() -> Recall {
        Recall { points: [(Point::default(), Time::ZERO); POINTS], len: 0 }
    }
}

impl Recall {
    /// Takes over a reading that was made at `pose`.
    pub(crate) fn update(&mut self, sensors: &Sensors, ranges: &Ranges, pose: Pose, now: Time) {
        self.retain(|point, stamp| {
            now - stamp <= sensors.keep && !is_contradicted(sensors, ranges, pose.inverse().transform(point))
        });
        let heard = f64::from(ranges.range_max).min(sensors.reach);
        for (bearing, range) in ranges.polar().filter(|(_, range)| *range < heard) {
            for part in [-ARC, 0.0, ARC] {
                let beyond = Point::polar((range - sensors.rim).max(0.0), bearing + part * sensors.cone);
                self.put(pose.transform(Point::polar(sensors.rim, bearing) + beyond), now);
            }
        }
    }

    /// Bearing (rad) and distance (m) of the points, seen from `pose`.
    pub(crate) fn around<'a>(
        &self,
        pose: Pose,
        room: &'a mut [(f64, f64); POINTS_AROUND],
    ) -> &'a [(f64, f64)] {
        for (out, (point, _)) in room.iter_mut().zip(&self.points[..self.len]) {
            let local = pose.inverse().transform(*point);
            *out = (local.bearing(), local.norm());
        }
        &room[..self.len]
    }

    fn put(&mut self, point: Point, now: Time) {
        if let Some(known) =
            self.points[..self.len].iter_mut().find(|(known, _)| known.distance(point) < SAME)
        {
            known.1 = now;
            return;
        }
        if self.len == POINTS {
            // The oldest makes room.
            let oldest = (0..POINTS).min_by_key(|&i| self.points[i].1).unwrap_or(0);
            self.points[oldest] = (point, now);
        } else {
            self.points[self.len] = (point, now);
            self.len += 1;
        }
    }

    fn retain(&mut self, keep: impl Fn(Point, Time) -> bool) {
        let mut kept = 0;
        for i in 0..self.len {
            let (point, stamp) = self.points[i];
            if keep(point, stamp) {
                self.points[kept] = (point, stamp);
                kept += 1;
            }
        }
        self.len = kept;
    }
}

/// Room for all points.
pub(crate) const POINTS_AROUND: usize = POINTS;

/// Whether the robot stands where the point is, or a sensor that looks at the point hears something behind it. Silence says nothing: a
/// smooth face that is met obliquely is silent too.
fn is_contradicted(sensors: &Sensors, ranges: &Ranges, point: Point) -> bool {
    if point.norm() < sensors.rim - SAME {
        return true;
    }
    ranges.polar().any(|(bearing, range)| {
        let seen = point - Point::polar(sensors.rim, bearing);
        let well_inside = wrap(seen.bearing() - bearing).abs() < 0.8 * sensors.cone;
        well_inside
            && range < f64::from(ranges.range_max)
            && hypot(seen.x, seen.y) + sensors.rim + BEHIND < range
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::blank;
    use types::geometry::PI;

    const SENSORS: Sensors = Sensors { rim: 0.2, cone: PI / 12.0, reach: 1.5, keep: Duration::secs(4) };

    fn heard(direction: usize, range: f32) -> Ranges {
        let mut ranges = blank(12, 0.3, 6.2);
        ranges.values.fill(6.2);
        ranges.values[direction] = range;
        ranges
    }

    fn nearest(recall: &Recall, pose: Pose) -> (f64, f64) {
        let mut room = [(0.0, 0.0); POINTS_AROUND];
        let points = recall.around(pose, &mut room);
        points.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0.0, f64::INFINITY))
    }

    #[test]
    fn a_thing_that_is_not_heard_any_more_is_still_where_it_was() {
        let mut recall = Recall::default();
        recall.update(&SENSORS, &heard(0, 1.0), Pose::default(), Time::ZERO);
        let later = Pose::new(0.4, 0.0, PI / 2.0);
        recall.update(&SENSORS, &heard(0, 6.2), later, Time::from_seconds(1.0));
        let (bearing, distance) = nearest(&recall, later);
        assert!((distance - 0.6).abs() < 0.02 && (bearing + PI / 2.0).abs() < 0.3, "{bearing} {distance}");
        recall.update(&SENSORS, &heard(0, 6.2), later, Time::from_seconds(4.1));
        assert_eq!(nearest(&recall, later).1, f64::INFINITY, "too old");
    }

    #[test]
    fn an_echo_from_behind_takes_the_point_away_and_silence_does_not() {
        let mut recall = Recall::default();
        recall.update(&SENSORS, &heard(0, 1.0), Pose::default(), Time::ZERO);
        recall.update(&SENSORS, &heard(0, 6.2), Pose::default(), Time::from_seconds(0.2));
        assert!(nearest(&recall, Pose::default()).1 < 1.01);
        recall.update(&SENSORS, &heard(0, 1.6), Pose::default(), Time::from_seconds(0.4));
        assert_eq!(nearest(&recall, Pose::default()).1, f64::INFINITY);
    }

    #[test]
    fn when_all_places_are_taken_the_oldest_makes_room() {
        let mut recall = Recall::default();
        for i in 0..=POINTS {
            recall.put(Point::new(i as f64, 0.0), Time(i as i64));
        }
        assert_eq!(recall.len, POINTS);
        assert!(nearest(&recall, Pose::new(0.0, 0.0, 0.0)).1 == 1.0, "the first is gone");
    }
}
