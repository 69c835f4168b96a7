//! What a laser saw a moment ago and cannot see now: what lies beside and behind a robot that looks only ahead.
//!
//! A reactive law takes a direction in which nothing was seen for a free one. With a laser over half a turn the border of the view cuts
//! through whatever the robot turns away from, and that cut looks like the end of the obstacle: it turns back, sees its mistake, turns away,
//! and so for ever. So each thing is kept at the place where it was seen until that place is looked at again, or it was too long ago.

use libm::{atan2, ceil, fabs, hypot};
use motion::ring::Ring;
use types::geometry::wrap;
use types::{Point, Pose};

use super::sectors::{SECTOR, SECTORS, Sectors, bearing, sector};

/// How long and how much.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// How long a thing is kept that is not looked at again (s): nothing is kept for 0.
    pub keep: f64,
    /// What is farther from the sensor is not kept (m).
    pub reach: f64,
    /// Between two things closer together than this there is no way (m): the smallest passage.
    pub passage: f64,
    /// Where the body is there is nothing (m): the radius of the largest disc about the turning point that lies in it.
    pub core: f64,
}

impl Parameters {
    /// For a body of this core radius (m) that needs such a passage (m).
    ///
    /// A robot that walks at 0.3 m/s needs some ten seconds to get past a thing of its own size, and in that time wheels lose a few
    /// centimetres. What is farther than 3 m does not move the laws.
    pub fn new(core: f64, passage: f64) -> Parameters {
        Parameters { keep: 10.0, reach: 3.0, passage, core }
    }
}

/// Where a thing was seen, in the frame of the odometry, and when (s).
#[derive(Clone, Copy, Debug)]
struct Thing {
    at: Point,
    seen: f64,
}

/// The nearest thing in each direction around the sensor. A step allocates nothing.
#[derive(Clone, Debug)]
pub struct Memory {
    parameters: Parameters,
    things: [Option<Thing>; SECTORS],
    before: [Option<Thing>; SECTORS],
    /// The newest scan, around the sensor.
    view: Sectors,
    /// When that was (s).
    looked: f64,
}

impl Memory {
    /// A memory without anything in it.
    pub fn new(parameters: Parameters) -> Memory {
        Memory {
            parameters,
            things: [None; SECTORS],
            before: [None; SECTORS],
            view: Sectors::new(),
            looked: f64::NEG_INFINITY,
        }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.things.fill(None);
    }

    /// Takes over a scan made at `now` (s) by a sensor at `sensor` in the frame of the odometry; ranges of `range_max` and more met
    /// nothing (m).
    pub fn look(&mut self, sensor: Pose, scan: Ring<'_>, range_max: f64, now: f64) {
        self.view.clear();
        self.view.add_scan(Pose::default(), scan, range_max);
        self.looked = now;
        std::mem::swap(&mut self.things, &mut self.before);
        self.things.fill(None);
        let sensor_from_odometry = sensor.inverse();
        for thing in self.before.iter().flatten() {
            let point = sensor_from_odometry.transform(thing.at);
            let (range, place) = (hypot(point.x, point.y), sector(atan2(point.y, point.x)));
            let is_known = range <= self.parameters.reach && now - thing.seen <= self.parameters.keep;
            // Whoever looks there knows better.
            if !is_known || self.view.is_viewed(place) {
                continue;
            }
            let is_nearer = |other: &Thing| sensor.position().distance(other.at) <= range;
            if !self.things[place].as_ref().is_some_and(is_nearer) {
                self.things[place] = Some(*thing);
            }
        }
        for (place, range) in self.view.distances().iter().enumerate() {
            if *range <= self.parameters.reach {
                let at = sensor.transform(Point::polar(*range, bearing(place)));
                self.things[place] = Some(Thing { at, seen: now });
            }
        }
    }

    /// Puts what is kept, and what it closes, around a robot at `robot` in the frame of the odometry.
    pub fn recall(&self, robot: Pose, around: &mut Sectors) {
        if self.parameters.keep <= 0.0 {
            return;
        }
        let robot_from_odometry = robot.inverse();
        let core = self.parameters.core;
        let here = |thing: &Thing| {
            let point = robot_from_odometry.transform(thing.at);
            (hypot(point.x, point.y) > core).then_some((point, thing.seen < self.looked))
        };
        // Around the circle once, from the last of them on.
        let things = || self.things.iter().flatten().filter_map(here);
        let mut last = things().next_back();
        for (point, is_kept) in things() {
            if is_kept {
                around.add_point(point);
            }
            if let Some((neighbour, _)) = last.filter(|(_, was_kept)| is_kept || *was_kept) {
                self.close(neighbour, point, around);
            }
            last = Some((point, is_kept));
        }
    }

    /// Puts in the line between two neighbours, where no way is between them.
    fn close(&self, from: Point, to: Point, around: &mut Sectors) {
        let apart = to - from;
        if apart.dot(apart) >= self.parameters.passage * self.parameters.passage {
            return;
        }
        let angle = fabs(wrap(atan2(to.y, to.x) - atan2(from.y, from.x)));
        // Twice as many points as sectors between them, and more near the nearer end of an oblique line.
        let steps = ceil(4.0 * angle / SECTOR);
        for i in 1..steps as usize {
            let point = from + apart * (i as f64 / steps);
            if hypot(point.x, point.y) > self.parameters.core {
                around.add_point(point);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use types::geometry::PI;

    /// A laser over half a turn that sees a wall straight ahead at 1 m, 0.6 m to each side, and else nothing.
    fn ranges(heading: f64) -> Vec<f32> {
        let range = |i: i32| {
            let ahead = wrap(f64::from(i - 90) * PI / 180.0 + heading);
            let range = 1.0 / libm::cos(ahead);
            if range > 0.0 && fabs(libm::tan(ahead)) < 0.6 { range as f32 } else { 8.0 }
        };
        (0..=180).map(range).collect()
    }

    fn look(memory: &mut Memory, heading: f64, now: f64) {
        let ranges = ranges(heading);
        let scan = Ring::Sweep { angle_min: -PI / 2.0, angle_step: PI / 180.0, ranges: &ranges };
        memory.look(Pose::new(0.0, 0.0, heading), scan, 8.0, now);
    }

    fn memory(keep: f64) -> Memory {
        Memory::new(Parameters { keep, ..Parameters::new(0.2, 0.44) })
    }

    fn recalled(memory: &Memory, robot: Pose) -> Sectors {
        let mut around = Sectors::new();
        memory.recall(robot, &mut around);
        around
    }

    #[test]
    fn what_the_robot_turned_away_from_is_where_it_was_until_it_is_too_long_ago() {
        let mut memory = memory(10.0);
        look(&mut memory, 0.0, 0.0);
        assert_eq!(recalled(&memory, Pose::default()), Sectors::new(), "it is in view");
        look(&mut memory, PI, 1.0);
        let around = recalled(&memory, Pose::new(0.0, 0.0, PI));
        assert!(fabs(around.distances()[0] - 1.0) < 0.01, "{}", around.distances()[0]);
        // 0.6 m to each side are 31°: 15 sectors to each side and that behind.
        let taken = around.distances().iter().filter(|range| range.is_finite()).count();
        assert!((29..=33).contains(&taken), "{taken}");
        look(&mut memory, PI, 10.5);
        assert_eq!(recalled(&memory, Pose::new(0.0, 0.0, PI)), Sectors::new());
    }

    #[test]
    fn what_is_looked_at_again_and_gone_is_forgotten() {
        let mut memory = memory(10.0);
        look(&mut memory, 0.0, 0.0);
        let nothing = [8.0f32; 181];
        let scan = Ring::Sweep { angle_min: -PI / 2.0, angle_step: PI / 180.0, ranges: &nothing };
        memory.look(Pose::default(), scan, 8.0, 1.0);
        look(&mut memory, PI, 2.0);
        assert_eq!(recalled(&memory, Pose::new(0.0, 0.0, PI)), Sectors::new());
    }

    #[test]
    fn a_wall_that_comes_nearer_has_no_holes() {
        let mut memory = memory(10.0);
        look(&mut memory, 0.0, 0.0);
        look(&mut memory, PI, 1.0);
        // Backwards to 0.3 m before it: what was 2° apart is 7° apart.
        let around = recalled(&memory, Pose::new(0.7, 0.0, PI));
        let behind = (-28..=28).map(|i: i32| around.distances()[i.rem_euclid(180) as usize]);
        assert!(behind.clone().all(|range| (0.29..0.7).contains(&range)), "{:?}", behind.collect::<Vec<_>>());
    }

    #[test]
    fn where_the_body_is_there_is_nothing() {
        let mut memory = memory(10.0);
        look(&mut memory, 0.0, 0.0);
        look(&mut memory, PI, 1.0);
        let around = recalled(&memory, Pose::new(0.9, 0.0, PI));
        assert!(around.distances().iter().all(|range| *range > 0.1), "only what is beside it stays");
        assert!(around.distances()[0].is_infinite());
    }
}
