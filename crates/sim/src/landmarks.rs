//! Landmarks as sensors see and hear them: range and bearing, or code and side.
//!
//! What is told is a function of seed, robot, landmark and sample number: that another landmark comes into view changes nothing.
//! Ranges and bearings count from the point between the wheels and from ahead, whatever the head does.

use libm::{fabs, floor};
use types::Point;
use types::chance::Stream;
use types::geometry::{TAU, wrap};
use types::messages::{LandmarkSighting, MOST_LANDMARKS};

use crate::field::Field;
use crate::plan::Landmark;
use crate::robot::Robot;
use crate::simulator::{RobotId, Simulator};

/// What one reading tells, the nearest landmark first.
pub type Sightings = types::Sequence<LandmarkSighting, MOST_LANDMARKS>;

/// The nearest landmarks that were found so far, by true distance.
#[derive(Default)]
struct Nearest {
    sightings: [LandmarkSighting; MOST_LANDMARKS],
    distances: [f64; MOST_LANDMARKS],
    count: usize,
}

impl Nearest {
    fn offer(&mut self, distance: f64, sighting: LandmarkSighting) {
        let place = self.distances[..self.count].partition_point(|&known| known <= distance);
        if place == MOST_LANDMARKS {
            return;
        }
        self.count = (self.count + 1).min(MOST_LANDMARKS);
        self.distances[place..self.count].rotate_right(1);
        self.sightings[place..self.count].rotate_right(1);
        (self.distances[place], self.sightings[place]) = (distance, sighting);
    }

    fn all(&self) -> Sightings {
        self.sightings[..self.count].iter().copied().collect()
    }
}

impl Simulator {
    /// The landmarks that a robot sees: range, bearing and, where its sensor can tell, which; none without such a sensor.
    pub fn landmarks(&self, id: RobotId, sample: u64) -> Sightings {
        let robot = &self.robots[id.index()];
        let Some(sensor) = &robot.model.landmarks else { return Sightings::new() };
        let (pose, draw) = (robot.truth.pose, robot.streams.landmarks.sample(sample));
        let gaze = if sensor.on_head { robot.head.pan } else { 0.0 };
        let mut nearest = Nearest::default();
        for (k, landmark) in self.plan.landmarks.iter().enumerate() {
            let way = landmark.at - pose.position();
            let (distance, bearing) = (way.norm(), wrap(way.bearing() - pose.heading));
            let draw = draw.sample(k as u64);
            if !(sensor.min_range..=sensor.max_range).contains(&distance)
                || fabs(wrap(bearing - gaze)) > sensor.field / 2.0
                || landmark.height < sensor.height - HIGHER
                || draw.uniform(0) < sensor.miss
                || self.hidden(robot, landmark, sensor.height.min(landmark.height))
            {
                continue;
            }
            let range = distance + draw.normal(1) * (sensor.noise + sensor.relative_noise * distance);
            let bearing = wrap(bearing + draw.normal(2) * sensor.bearing_noise);
            let id = if sensor.identifies { self.told(k, sensor.mistake, draw) } else { 0 };
            let sighting =
                LandmarkSighting { id, range: range.max(0.0) as f32, bearing: bearing as f32, side: 0 };
            nearest.offer(distance, sighting);
        }
        nearest.all()
    }

    /// The landmarks whose transmitters a robot hears: which, and from which side; none without receivers.
    pub fn infrared(&self, id: RobotId, sample: u64) -> Sightings {
        let robot = &self.robots[id.index()];
        let Some(sensor) = &robot.model.infrared else { return Sightings::new() };
        let draw = robot.streams.infrared.sample(sample);
        let mut nearest = Nearest::default();
        for (k, landmark) in self.plan.landmarks.iter().enumerate().filter(|(_, it)| it.infrared) {
            let way = robot.truth.pose.position() - landmark.at;
            let distance = way.norm();
            if distance > sensor.max_range
                || draw.sample(k as u64).uniform(0) < sensor.miss
                || self.hidden(robot, landmark, sensor.height)
            {
                continue;
            }
            let side = side_of(wrap(way.bearing() - landmark.facing));
            nearest
                .offer(distance, LandmarkSighting { id: landmark.id, side, ..LandmarkSighting::default() });
        }
        nearest.all()
    }

    /// The number that is told for landmark `k`: its own, or by mistake that of another.
    fn told(&self, k: usize, mistake: f64, draw: Stream) -> u32 {
        let landmarks = &self.plan.landmarks;
        if landmarks.len() > 1 && draw.uniform(5) < mistake {
            let other = draw.index(6, landmarks.len() - 1);
            return landmarks[other + usize::from(other >= k)].id;
        }
        landmarks[k].id
    }

    /// Whether something stands between a robot and a landmark at this height.
    fn hidden(&self, robot: &Robot, landmark: &Landmark, height: f64) -> bool {
        hides(&self.field, robot.truth.pose.position(), landmark, height, robot.body)
    }
}

/// So much of a tube must stand above what looks at it from higher (m).
const HIGHER: f64 = 0.5;

fn hides(field: &Field, eye: Point, landmark: &Landmark, height: f64, own: u32) -> bool {
    let way = landmark.at - eye;
    let distance = way.norm();
    // A hair short of its surface: it must not hide itself.
    let reach = (distance - landmark.radius) * 0.999;
    reach > 0.0 && field.cast(eye, way * (1.0 / distance), reach, height, own).is_some()
}

/// The side in a direction to the left of where a landmark faces (rad): 1 to 4, a quarter turn each about its own direction.
fn side_of(direction: f64) -> u8 {
    (floor(direction / (TAU / 4.0) + 0.5) as i64).rem_euclid(4) as u8 + 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sides_are_quarters_around_their_middles() {
        for (degrees, side) in [
            (0.0f64, 1),
            (44.9, 1),
            (45.1, 2),
            (90.0, 2),
            (134.0, 2),
            (136.0, 3),
            (180.0, 3),
            (-179.0, 3),
            (-90.0, 4),
            (-44.0, 1),
        ] {
            assert_eq!(side_of(degrees.to_radians()), side, "{degrees}");
        }
    }

    #[test]
    fn of_too_many_the_nearest_are_kept_in_order() {
        let mut nearest = Nearest::default();
        for k in 0..50u32 {
            let distance = f64::from((k * 37) % 50);
            nearest
                .offer(distance, LandmarkSighting { id: 1 + (k * 37) % 50, ..LandmarkSighting::default() });
        }
        let ids: Vec<u32> = nearest.all().iter().map(|sighting| sighting.id).collect();
        assert_eq!(ids, (1..=16).collect::<Vec<u32>>());
    }
}
