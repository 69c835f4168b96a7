//! Where the robot is, from the landmarks that it saw while that was not known.
//!
//! In plain words: what was seen in the last metres is drawn on a sheet, each thing where it was, with the wheels as the ruler; then the sheet is
//! laid over the map so that it fits. Two things whose names are known fit in one way only. Of things that all look the same it takes more, and
//! as long as they fit in two ways it is not decided.
//!
//! How it works: each pair of spots that is as far apart as a pair of landmarks gives a way to lay the sheet, which counts two for each spot with a
//! name that lies on its landmark, and one for each that lies on any and for each beacon that was heard from the right side. The best is taken when it
//! counts four or more, and two more than any other that puts the robot elsewhere; then the sheet is moved so that the squares of what is left over are
//! least (Arun, Huang and Blostein, "Least-squares fitting of two 3-D point sets", 1987, in the plane).

use libm::{atan2, fabs, hypot, sincos};
use types::geometry::wrap;
use types::messages::LandmarkSighting;
use types::{Point, Pose};

use super::filter::Parameters;
use super::marks::{HALF_SIDE, Mark, Marks, sighting};
use crate::linear::Matrix;

/// So many things are kept in mind.
const MOST: usize = 8;
/// The wheels are wrong by such a part of a way.
const DRIFT: f64 = 0.03;
/// What was seen so long a way ago (m) is forgotten.
const FORGOTTEN: f64 = 15.0;
/// Things nearer to each other (m) tell no direction.
const NEAR: f64 = 0.4;
/// Within so many standard deviations, and a little more (m), things are the same.
const SAME: (f64, f64) = (3.0, 0.05);
/// Two poses of the robot nearer than this (m, rad) are one.
const ONE: (f64, f64) = (0.5, 0.3);
/// What a way to lay the sheet must count, and by how much more than any other.
const SURE: (u32, u32) = (4, 2);

/// Something that was seen.
#[derive(Clone, Copy, Debug)]
struct Spot {
    /// 0 where it has no name.
    id: u32,
    /// Where it is in the frame of the wheels.
    at: Point,
    /// How well that was known (m).
    deviation: f64,
    /// The way of the robot until then (m).
    way: f64,
}

/// A beacon that was heard.
#[derive(Clone, Copy, Debug)]
struct Heard {
    id: u32,
    side: f64,
    /// Where the robot was, in the frame of the wheels.
    from: Point,
    way: f64,
}

/// What was seen and heard in the last metres.
#[derive(Clone, Debug)]
pub(super) struct Constellation {
    spots: Vec<Spot>,
    heard: Vec<Heard>,
    /// The way of the robot (m), and where the wheels last said that it is.
    way: f64,
    last: Option<Point>,
}

impl Default for Constellation {
    fn default() -> Constellation {
        let (spots, heard) = (Vec::with_capacity(MOST + 1), Vec::with_capacity(MOST + 1));
        Constellation { spots, heard, way: 0.0, last: None }
    }
}

/// Room for what comes: the oldest goes.
fn keep<T>(list: &mut Vec<T>, item: T) {
    if list.len() == MOST {
        list.remove(0);
    }
    list.push(item);
}

impl Constellation {
    pub(super) fn clear(&mut self) {
        self.spots.clear();
        self.heard.clear();
    }

    /// Takes what was seen by a robot whose wheels said that it is at `odometry`. Gives whether it may be known now where that is.
    pub(super) fn take(
        &mut self,
        odometry: Pose,
        parameters: &Parameters,
        marks: &Marks,
        seen: &LandmarkSighting,
    ) -> bool {
        let here = odometry.position();
        self.way += self.last.replace(here).map_or(0.0, |last| last.distance(here));
        let way = self.way;
        self.spots.retain(|spot| way - spot.way <= FORGOTTEN);
        self.heard.retain(|heard| way - heard.way <= FORGOTTEN);
        let id = seen.known_id().unwrap_or_default();
        if id != 0 && marks.of(id).is_none() {
            return false;
        }
        if let Some(sighting) = sighting(seen) {
            let at = odometry.transform(Point::polar(sighting.range, sighting.bearing));
            let range = parameters.range + parameters.range_part * sighting.range;
            let deviation = hypot(range, parameters.bearing * sighting.range);
            self.see(Spot { id, at, deviation, way });
            self.spots.len() > 1
        } else if let Some(side) = seen.known_side().filter(|_| id != 0) {
            self.heard.retain(|heard| heard.id != id);
            keep(&mut self.heard, Heard { id, side, from: here, way });
            self.spots.len() > 1
        } else {
            false
        }
    }

    /// A thing that was seen before is taken where it is seen now.
    fn see(&mut self, spot: Spot) {
        let reach = |known: &Spot| SAME.1 + SAME.0 * hypot(self.deviation(known), spot.deviation);
        let is_it = |known: &Spot| {
            let named = known.id != 0 && spot.id != 0;
            if named { known.id == spot.id } else { known.at.distance(spot.at) <= reach(known) }
        };
        let mut spot = spot;
        if let Some(place) = self.spots.iter().position(is_it) {
            let known = self.spots.remove(place);
            spot.id = if spot.id == 0 { known.id } else { spot.id };
        }
        keep(&mut self.spots, spot);
    }

    /// How well it is known where a thing is by now (m).
    fn deviation(&self, spot: &Spot) -> f64 {
        hypot(spot.deviation, DRIFT * (self.way - spot.way))
    }

    /// Where the robot is, with its covariance, when its wheels say that it is at `odometry`.
    pub(super) fn find(&self, odometry: Pose, marks: &Marks) -> Option<(Pose, Matrix)> {
        let mut best: Option<(u32, Pose)> = None;
        let mut second = 0;
        for (i, first) in self.spots.iter().enumerate() {
            for other in &self.spots[i + 1..] {
                let apart = first.at.distance(other.at);
                let wrong = SAME.1 + SAME.0 * hypot(self.deviation(first), self.deviation(other));
                if apart < NEAR.max(wrong) {
                    continue;
                }
                let fits = |a: &Mark, b: &Mark| {
                    is_named(first, a) && is_named(other, b) && fabs(a.at.distance(b.at) - apart) <= wrong
                };
                let pairs = marks.all().iter().flat_map(|a| marks.all().iter().map(move |b| (a, b)));
                for (a, b) in pairs.filter(|(a, b)| a.id != b.id && fits(a, b)) {
                    let sheet = laid([first.at, other.at], [a.at, b.at]);
                    let (count, pose) = (self.count(sheet, marks), sheet.then(odometry));
                    match best {
                        Some((most, known)) if is_one(known, pose) => {
                            best = Some(if count > most { (count, pose) } else { (most, known) });
                        }
                        Some((most, _)) if count <= most => second = second.max(count),
                        _ => {
                            second = second.max(best.map_or(0, |(most, _)| most));
                            best = Some((count, pose));
                        }
                    }
                }
            }
        }
        let (count, pose) = best?;
        let sheet = pose.then(odometry.inverse());
        (count >= SURE.0 && count >= second + SURE.1).then(|| self.fit(sheet, odometry, marks)).flatten()
    }

    /// The landmark on which a spot lies when the sheet is laid so.
    fn under<'a>(&self, sheet: Pose, spot: &Spot, marks: &'a Marks) -> Option<&'a Mark> {
        let at = sheet.transform(spot.at);
        let apart = |mark: &Mark| mark.at.distance(at);
        let nearest = marks
            .all()
            .iter()
            .filter(|mark| is_named(spot, mark))
            .min_by(|a, b| apart(a).total_cmp(&apart(b)));
        nearest.filter(|mark| apart(mark) <= SAME.1 + SAME.0 * self.deviation(spot))
    }

    /// What counts for a way to lay the sheet.
    fn count(&self, sheet: Pose, marks: &Marks) -> u32 {
        let spots = self.spots.iter().filter(|spot| self.under(sheet, spot, marks).is_some());
        let seen: u32 = spots.map(|spot| if spot.id == 0 { 1 } else { 2 }).sum();
        let is_right = |heard: &&Heard| {
            let wrong = SAME.1 + SAME.0 * DRIFT * (self.way - heard.way) + NEAR / 2.0;
            marks.of(heard.id).is_some_and(|mark| {
                let way = sheet.transform(heard.from) - mark.at;
                let aside = fabs(wrap(way.bearing() - mark.facing - heard.side)) - HALF_SIDE;
                way.norm() <= marks.reach() + wrong && aside.max(0.0) * way.norm() <= wrong
            })
        };
        seen + self.heard.iter().filter(is_right).count() as u32
    }

    /// The sheet laid so that what is left over is least.
    fn fit(&self, sheet: Pose, odometry: Pose, marks: &Marks) -> Option<(Pose, Matrix)> {
        let pairs = || self.spots.iter().filter_map(|spot| Some((spot, self.under(sheet, spot, marks)?)));
        let (mut weights, mut from, mut to) = (0.0, Point::default(), Point::default());
        for (spot, mark) in pairs() {
            let weight = 1.0 / (self.deviation(spot) * self.deviation(spot));
            weights += weight;
            (from, to) = (from + spot.at * weight, to + mark.at * weight);
        }
        let (from, to) = (from * (1.0 / weights), to * (1.0 / weights));
        let (mut dot, mut cross, mut lever) = (0.0, 0.0, 0.0);
        for (spot, mark) in pairs() {
            let weight = 1.0 / (self.deviation(spot) * self.deviation(spot));
            let (a, b) = (spot.at - from, mark.at - to);
            (dot, cross, lever) =
                (dot + weight * a.dot(b), cross + weight * a.cross(b), lever + weight * a.dot(a));
        }
        if !(weights > 0.0 && lever > 0.0 && weights.is_finite()) {
            return None;
        }
        let turn = atan2(cross, dot);
        let (s, c) = sincos(turn);
        let arm = odometry.position() - from;
        let arm = Point::new(c * arm.x - s * arm.y, s * arm.x + c * arm.y);
        let pose = Pose::new(to.x + arm.x, to.y + arm.y, wrap(odometry.heading + turn));
        // The heading is wrong by the lever, and takes the place along with it.
        let (place, heading) = (1.0 / weights, 1.0 / lever);
        let by = [-arm.y, arm.x, 1.0];
        let spread = core::array::from_fn(|i| {
            core::array::from_fn(|j| heading * by[i] * by[j] + if i == j && i < 2 { place } else { 0.0 })
        });
        Some((pose, spread))
    }
}

/// Whether a thing that was seen may be this landmark by its name.
const fn is_named(spot: &Spot, mark: &Mark) -> bool {
    spot.id == 0 || spot.id == mark.id
}

fn is_one(a: Pose, b: Pose) -> bool {
    a.position().distance(b.position()) <= ONE.0 && fabs(wrap(a.heading - b.heading)) <= ONE.1
}

/// How the sheet lies when two of its points lie on two of the map, or in the middle between.
fn laid(points: [Point; 2], on: [Point; 2]) -> Pose {
    let turn = (on[1] - on[0]).bearing() - (points[1] - points[0]).bearing();
    let middle = |[a, b]: [Point; 2]| (a + b) * 0.5;
    let turned = Pose::new(0.0, 0.0, turn).transform(middle(points));
    let at = middle(on) - turned;
    Pose::new(at.x, at.y, wrap(turn))
}
