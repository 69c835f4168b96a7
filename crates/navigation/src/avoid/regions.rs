//! Free regions between the discontinuities of what is near, and whether a robot can get into one.

use libm::{atan2, fabs, fmax, fmin, sincos};
use types::Point;
use types::geometry::{TAU, wrap};

use super::sectors::{SECTOR, SECTORS, bearing, sector};

/// How a region is found and entered.
#[derive(Clone, Copy, Debug)]
pub(super) struct Passage {
    /// Width of the smallest passage (m): w_min.
    pub(super) width: f64,
    /// What is farther from the turning point is not looked at (m).
    pub(super) horizon: f64,
    /// Room kept to the obstacle that makes an edge (m).
    pub(super) security: f64,
}

/// A set of neighbouring sectors without a discontinuity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Region {
    /// The sector at its right end.
    pub(super) first: usize,
    /// How many sectors it has.
    pub(super) count: usize,
    /// Whether the neighbour beyond the right end is nearer: the end is a rising edge, seen from the region.
    pub(super) rises_right: bool,
    /// The same beyond the left end.
    pub(super) rises_left: bool,
}

/// A region that was chosen, and how it is entered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Chosen {
    pub(super) region: Region,
    /// Whether the goal lies in it.
    pub(super) goal_in: bool,
    /// Where to if nothing is near (rad).
    pub(super) free: f64,
    /// The side of the goal on which it is entered: 1 for the left, −1 for the right.
    pub(super) side: f64,
}

/// So much nearer to the goal the way on the other side must be before it is taken instead (rad).
///
/// Two ways round a thing are equally good before its middle, and there the noise of the sensor would choose anew at each step. 30° are
/// fifteen sectors: more than an edge moves by noise, or by what the robot drives before it has turned away.
pub(super) const MARGIN: f64 = types::geometry::PI / 6.0;

/// On which side of the goal the robot goes round what is in its way, while it does.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Side(Option<f64>);

impl Side {
    /// How far an edge is from the goal (rad), by the angle at which it lies to the left of it.
    ///
    /// On the other side than the one kept to it counts the margin more; but whoever goes on round gets there as well.
    fn distance(self, edge: f64) -> f64 {
        match self.0 {
            Some(side) if side * edge < 0.0 => fmin(fabs(edge) + MARGIN, TAU - fabs(edge)),
            _ => fabs(edge),
        }
    }

    /// Keeps to what was chosen; `safe` tells that nothing is near.
    pub(super) fn keep(&mut self, chosen: &Chosen, safe: bool) {
        if !chosen.goal_in {
            self.0 = Some(chosen.side);
        } else if safe {
            self.0 = None;
        }
    }
}

impl Region {
    /// Its right and left end (rad); the left one is the larger number.
    pub(super) fn ends(&self) -> (f64, f64) {
        let right = bearing(self.first) - SECTOR / 2.0;
        (right, right + self.count as f64 * SECTOR)
    }

    /// Whether it is wider than a quarter of the circle.
    pub(super) fn is_wide(&self) -> bool {
        self.count > SECTORS / 4
    }

    fn holds(&self, sector: usize) -> bool {
        (sector + SECTORS - self.first) % SECTORS < self.count
    }

    fn last(&self) -> usize {
        (self.first + self.count - 1) % SECTORS
    }

    /// Its middle (rad).
    fn middle(&self) -> f64 {
        let (right, left) = self.ends();
        wrap((right + left) / 2.0)
    }
}

/// The memory of the search for a region.
#[derive(Clone, Debug)]
pub(super) struct Regions {
    /// Nearness of each sector: PND.
    nearness: [f64; SECTORS],
    found: [Region; SECTORS],
    count: usize,
    /// What is near, as points.
    points: [Point; SECTORS],
    directions: [(f64, f64); SECTORS],
    left: [Point; SECTORS],
    right: [Point; SECTORS],
}

const NO_REGION: Region = Region { first: 0, count: SECTORS, rises_right: false, rises_left: false };

impl Regions {
    pub(super) fn new() -> Regions {
        Regions {
            nearness: [0.0; SECTORS],
            found: [NO_REGION; SECTORS],
            count: 0,
            points: [Point::default(); SECTORS],
            directions: std::array::from_fn(|i| sincos(bearing(i))),
            left: [Point::default(); SECTORS],
            right: [Point::default(); SECTORS],
        }
    }

    /// The regions of a reading.
    pub(super) fn find(&mut self, distances: &[f64; SECTORS], passage: &Passage) {
        for i in 0..SECTORS {
            // What is looked at at all is nearer than nothing by more than a passage: whatever shuts a way has an edge beside which there may
            // be another.
            self.nearness[i] = fmax(passage.horizon + passage.width - distances[i], 0.0);
            let (sine, cosine) = self.directions[i];
            // What is too far away gives no point that is asked for.
            let range = if distances[i] < passage.horizon { distances[i] } else { 1e9 };
            self.points[i] = Point::new(range * cosine, range * sine);
        }
        self.count = 0;
        let nearness = self.nearness;
        let breaks = |i: usize| fabs(nearness[i] - nearness[(i + 1) % SECTORS]) > passage.width;
        let Some(start) = (0..SECTORS).find(|i| breaks(*i)) else {
            // Without a discontinuity all around is one.
            self.found[0] = NO_REGION;
            self.count = 1;
            return;
        };
        let mut first = (start + 1) % SECTORS;
        let mut count = 0;
        for step in 1..=SECTORS {
            let i = (start + step) % SECTORS;
            count += 1;
            if breaks(i) {
                let (before, after) = ((first + SECTORS - 1) % SECTORS, (i + 1) % SECTORS);
                self.found[self.count] = Region {
                    first,
                    count,
                    rises_right: nearness[before] > nearness[first],
                    rises_left: nearness[after] > nearness[i],
                };
                self.count += 1;
                (first, count) = (after, 0);
            }
        }
    }

    /// The region whose rising edge is next to the goal and that the robot can get into; the one with the goal in it comes first.
    ///
    /// A goal in front of an obstacle lies in no valley, and needs none: its region is asked all the same. A region whose way to the goal is
    /// shut may still be entered by its rising edge: it may be all around the robot but for a wall.
    pub(super) fn choose(
        &mut self,
        distances: &[f64; SECTORS],
        goal: Point,
        passage: &Passage,
        side: Side,
    ) -> Option<Chosen> {
        let goal_bearing = atan2(goal.y, goal.x);
        let goal_sector = sector(goal_bearing);
        // Those that are nearer than the last one asked were asked already.
        let mut asked = -1.0;
        loop {
            let to_goal = |region: &Region| {
                let chosen = Chosen { region: *region, goal_in: true, free: goal_bearing, side: 0.0 };
                region.holds(goal_sector).then_some((0.0, chosen, goal))
            };
            let by_edge = |i: usize| self.by_edge(i, distances, goal_bearing, passage, side);
            let (score, chosen, target) = (0..self.count)
                .flat_map(|i| [to_goal(&self.found[i]), by_edge(i)])
                .flatten()
                .filter(|(score, ..)| *score > asked)
                .min_by(|a, b| a.0.total_cmp(&b.0))?;
            if self.reaches(target, passage.width) {
                return Some(chosen);
            }
            asked = score;
        }
    }

    /// A region entered by its rising edge: how far that is from the goal, the way, and the point to which it must be free.
    fn by_edge(
        &self,
        index: usize,
        distances: &[f64; SECTORS],
        goal_bearing: f64,
        passage: &Passage,
        side: Side,
    ) -> Option<(f64, Chosen, Point)> {
        let region = self.found[index];
        let (obstacle, border, inwards) = rising_edge(&region, goal_bearing, side)?;
        let distance = distances[obstacle];
        let free = if region.is_wide() {
            wrap(bearing(obstacle) + inwards * atan2(passage.width / 2.0 + passage.security, distance))
        } else {
            region.middle()
        };
        // Into the gap between the obstacle and what is seen behind it: halfway, but no farther in than the body needs.
        let gap = fmin((distances[border] - distance) / 2.0, passage.width);
        let target = Point::polar(distance + gap, bearing(obstacle) + inwards * SECTOR / 2.0);
        let edge = turn(goal_bearing, bearing(border));
        // A hair by its place, so that no two are equally far, and none as near as the goal itself.
        let score = side.distance(edge) + (index + 1) as f64 * 1e-9;
        let side = if edge < 0.0 { -1.0 } else { 1.0 };
        Some((score, Chosen { region, goal_in: false, free, side }, target))
    }

    /// Whether a way to `target` passes between what is near: nothing lies around the target, and no two obstacles on both sides of
    /// the straight line are closer together than `width` (m).
    fn reaches(&mut self, target: Point, width: f64) -> bool {
        let length = libm::hypot(target.x, target.y);
        if length < 1e-9 {
            return true;
        }
        let (cosine, sine) = (target.x / length, target.y / length);
        let (mut lefts, mut rights) = (0, 0);
        for point in &self.points {
            let (x, y) = (point.x * cosine + point.y * sine, point.y * cosine - point.x * sine);
            let (dx, square) = (x - length, width * width / 4.0);
            if dx * dx + y * y < square {
                return false;
            }
            if x < 0.0 || x >= length || fabs(y) > width {
                continue;
            }
            if y > 0.0 {
                self.left[lefts] = Point::new(x, y);
                lefts += 1;
            } else {
                self.right[rights] = Point::new(x, y);
                rights += 1;
            }
        }
        self.left[..lefts].iter().all(|left| {
            self.right[..rights].iter().all(|right| {
                let apart = *left - *right;
                apart.dot(apart) >= width * width
            })
        })
    }

    /// Whether a corridor of half width `half` straight to `bearing` is free for `length` (m).
    pub(super) fn corridor_is_free(&self, towards: f64, half: f64, length: f64) -> bool {
        let (sine, cosine) = sincos(towards);
        self.points.iter().all(|point| {
            let (x, y) = (point.x * cosine + point.y * sine, point.y * cosine - point.x * sine);
            x <= 0.0 || x >= length || fabs(y) >= half
        })
    }
}

/// The rising edge of a region next to a direction (rad), by the side that is kept to: the sector of the obstacle that makes it, that of the region's border, and 1 if
/// the region lies to its left, −1 if to its right.
pub(super) fn rising_edge(region: &Region, goal: f64, side: Side) -> Option<(usize, usize, f64)> {
    let right = region.rises_right.then(|| ((region.first + SECTORS - 1) % SECTORS, region.first, 1.0));
    let left = region.rises_left.then(|| ((region.last() + 1) % SECTORS, region.last(), -1.0));
    // Both ends of a region of one sector are in it: then that counts whose obstacle is towards the goal.
    let away = |edge: &(usize, usize, f64)| {
        [edge.1, edge.0].map(|sector| side.distance(turn(goal, bearing(sector))))
    };
    match (right, left) {
        (Some(right), Some(left)) => Some(if away(&left) < away(&right) { left } else { right }),
        (one, other) => one.or(other),
    }
}

/// The angle by which `to` lies to the left of `from` (rad), the short way.
pub(super) fn turn(from: f64, to: f64) -> f64 {
    wrap(to - from)
}
