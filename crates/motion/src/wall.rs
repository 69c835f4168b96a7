//! Wall following on a ring of ranges: a law that looks at one reading and remembers nothing.
//!
//! Mirrored so that the wall is always on the left, the wall on the right being its image.
//!
//! ```text
//!            front                err   = (β − 90°) + atan(gain · (d − keep)) − 90° · push
//!              ▲                  turn  = turn_gain · err
//!    wall ┃    │                  speed grows while the front is free and err is small
//!         ┃←d→(R)
//!         ┃                       β, d: bearing and distance of the nearest point of the wall
//!                                 push: 0 with a free front, 1 right before an obstacle
//! ```
//!
//! Along a straight wall β − 90° is the angle between wall and heading. Past a convex corner the nearest point is the corner itself,
//! which falls behind, so the same law draws an arc of radius `keep` around it. In a concave corner the push turns the robot away
//! from the wall in front until that is the wall at its side. At a door the far jamb stands in front as well; it is told from a corner
//! by the free way between it and the wall, and that way is taken.

use crate::kinematics::Twist;
use crate::ring::{Echo, Ring};
use libm::{atan, atan2, cos, fabs, fmax, fmin, sin};
use types::Point;
use types::geometry::{PI, wrap};

/// The side on which the wall is kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Side {
    /// Wall on the left; the robot goes around a room clockwise.
    #[default]
    Left,
    /// Wall on the right.
    Right,
}

impl Side {
    /// 1 for left, −1 for right.
    pub const fn sign(self) -> f64 {
        match self {
            Side::Left => 1.0,
            Side::Right => -1.0,
        }
    }
}

/// How to follow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// On which side the wall is.
    pub side: Side,
    /// Distance to keep from the wall to the robot's centre (m).
    pub keep: f64,
    /// Radius of the robot (m).
    pub radius: f64,
    /// Room wanted beside the body when it passes something in front (m).
    pub margin: f64,
    /// Half the opening angle of one beam (rad); 0 for a laser.
    pub cone: f64,
    /// A thing on the side counts as a wall up to this distance (m).
    pub reach: f64,
    /// Two neighbouring echoes farther apart than this are not one wall (m).
    pub gap: f64,
    /// Speed with all free (m/s).
    pub speed: f64,
    /// Speed at which it still creeps along while it turns (m/s).
    pub creep: f64,
    /// How fast the wished speed grows while all is free (m/s²).
    pub growth: f64,
    /// Highest turn rate (rad/s).
    pub turn_max: f64,
    /// Turn rate for an error of heading of 1 rad (1/s).
    pub turn_gain: f64,
    /// Slope of the approach: angle towards the wall for a distance error, near zero (rad/m).
    pub approach_gain: f64,
    /// Steepest approach (rad).
    pub approach_max: f64,
    /// Free way in front, from the body's edge, below which it begins to turn away (m).
    pub front_far: f64,
    /// Free way in front at which it turns in place (m).
    pub front_near: f64,
}

impl Parameters {
    /// For a round robot of `radius` (m) with beams of half width `cone` (rad).
    ///
    /// `keep` is two radii: at a door of four radii that is the middle. `reach` is three times `keep`, so a wall is caught from a bit
    /// off but the other side of a corridor is not. A `gap` of two radii and a margin is where the robot itself would fit through.
    /// 0.4 m/s and a turn gain of 1.5 need 0.27 m of way for an error to fall to 1/e, less than `keep`, also at four readings a second.
    /// `approach_max` of 40° lets the front beams still see the wall that is approached, and the gain is near critical damping for this
    /// turn gain and speed. It begins to turn away 2.5 radii before an obstacle, where an arc of radius `keep` still fits, and turns in
    /// place at 0.6, where the body has room for its own edge. Creeping at an eighth of the speed keeps the view changing, and two
    /// seconds to full speed let a false start be noticed. 5 cm of margin are twice the error of a sonar nearby.
    pub fn new(radius: f64, cone: f64) -> Parameters {
        Parameters {
            side: Side::Left,
            keep: 2.0 * radius,
            radius,
            margin: 0.05,
            cone,
            reach: 6.0 * radius,
            gap: 2.0 * radius + 0.1,
            speed: 0.4,
            creep: 0.05,
            growth: 0.2,
            turn_max: 1.0,
            turn_gain: 1.5,
            approach_gain: 1.8,
            approach_max: 0.7,
            front_far: 2.5 * radius,
            front_near: 0.6 * radius,
        }
    }
}

/// What is seen of the wall, mirrored to the left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// Distance of its nearest point from the robot's centre (m).
    pub distance: f64,
    /// Bearing of that point (rad), positive towards the wall's side.
    pub bearing: f64,
    /// How many echoes it rests on.
    pub echoes: usize,
}

/// Most echoes that are taken of one side; a denser ring is thinned.
const SIDE_ECHOES_MAX: usize = 64;

/// Bearings that count as the side (rad): from a little off the front to well behind, so a passed corner stays in view.
const SIDE_FROM: f64 = 0.35;
const SIDE_TO: f64 = 2.5;

/// The wall on the side, or `None` if nothing is within reach.
///
/// The echoes of the side that hang together with the nearest one are fitted by a line (least squares across it). A beam with a wide
/// cone hears the part of the wall that is nearest, not the part in its middle; so its point is placed where, within the cone, the
/// line of the round before is nearest, and the fit is repeated. Where the foot of the perpendicular lies beyond the seen end of the
/// line, that end is the nearest point: there is a corner.
pub fn look(parameters: &Parameters, ring: Ring<'_>) -> Option<Wall> {
    let mut echoes = [Echo { bearing: 0.0, range: 0.0 }; SIDE_ECHOES_MAX];
    let count = gather(parameters, ring, &mut echoes);
    let echoes = &echoes[..count];
    let nearest = (0..count).min_by(|&a, &b| echoes[a].range.total_cmp(&echoes[b].range))?;
    let first = echoes[nearest];
    let mut wall = Wall { distance: first.range, bearing: first.bearing, echoes: 1 };
    for _ in 0..4 {
        let points = Placed { echoes, cone: parameters.cone, normal: wall.bearing };
        let (from, to) = points.hanging_together(nearest, parameters.gap);
        wall = points.fit(from, to, wall);
    }
    Some(wall)
}

/// Mirrors, selects and sorts the echoes of the side by bearing.
fn gather(parameters: &Parameters, ring: Ring<'_>, echoes: &mut [Echo; SIDE_ECHOES_MAX]) -> usize {
    let mirrored = ring.echoes().map(|e| Echo { bearing: wrap(e.bearing * parameters.side.sign()), ..e });
    let wanted =
        mirrored.filter(|e| e.range <= parameters.reach && (SIDE_FROM..=SIDE_TO).contains(&e.bearing));
    let thin = wanted.clone().count().div_ceil(SIDE_ECHOES_MAX).max(1);
    let mut count = 0;
    for echo in wanted.step_by(thin) {
        echoes[count] = echo;
        count += 1;
    }
    echoes[..count].sort_unstable_by(|a, b| a.bearing.total_cmp(&b.bearing));
    count
}

/// Echoes with their points placed within the cones for a wall whose normal has a known bearing.
struct Placed<'a> {
    echoes: &'a [Echo],
    cone: f64,
    normal: f64,
}

impl Placed<'_> {
    fn point(&self, i: usize) -> Point {
        let Echo { bearing, range } = self.echoes[i];
        Point::polar(range, bearing + fmin(fmax(wrap(self.normal - bearing), -self.cone), self.cone))
    }

    /// The run of echoes around `seed` without a gap in between.
    fn hanging_together(&self, seed: usize, gap: f64) -> (usize, usize) {
        let near = |a: usize, b: usize| self.point(a).distance(self.point(b)) <= gap;
        let (mut from, mut to) = (seed, seed);
        while from > 0 && near(from - 1, from) {
            from -= 1;
        }
        while to + 1 < self.echoes.len() && near(to, to + 1) {
            to += 1;
        }
        (from, to)
    }

    /// The nearest point of the segment through the points `from` to `to`, weighted by 1/range² as near echoes are the surer ones.
    fn fit(&self, from: usize, to: usize, before: Wall) -> Wall {
        if from == to {
            return before;
        }
        let weight = |i: usize| 1.0 / (self.echoes[i].range * self.echoes[i].range);
        let (mut sum, mut mean) = (0.0, Point::default());
        for i in from..=to {
            sum += weight(i);
            mean = mean + self.point(i) * weight(i);
        }
        mean = mean * (1.0 / sum);
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for i in from..=to {
            let off = self.point(i) - mean;
            xx += weight(i) * off.x * off.x;
            xy += weight(i) * off.x * off.y;
            yy += weight(i) * off.y * off.y;
        }
        if xx + yy < 1e-9 {
            return before;
        }
        let along = Point::polar(1.0, atan2(2.0 * xy, xx - yy) / 2.0);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for i in from..=to {
            let s = (self.point(i) - mean).dot(along);
            (low, high) = (fmin(low, s), fmax(high, s));
        }
        let foot = fmin(fmax(-mean.dot(along), low), high);
        let nearest = mean + along * foot;
        Wall { distance: nearest.norm(), bearing: nearest.bearing(), echoes: to - from + 1 }
    }
}

/// Free way ahead from the body's edge (m), for a corridor of half width `half_width` (m) around the heading `bearing` (rad).
///
/// Every echo counts as a point in the middle of its beam, which is neither the best nor the worst case of a wide cone.
pub fn free_way(ring: Ring<'_>, bearing: f64, half_width: f64, radius: f64) -> f64 {
    let mut free = f64::INFINITY;
    for echo in ring.echoes().filter(|echo| echo.range.is_finite()) {
        let angle = wrap(echo.bearing - bearing);
        let (along, across) = (echo.range * cos(angle), fabs(echo.range * sin(angle)));
        if along > 0.0 && across < half_width {
            let contact = if across < radius { libm::sqrt(radius * radius - across * across) } else { 0.0 };
            free = fmin(free, fmax(along - contact, 0.0));
        }
    }
    free
}

/// What the law found, for whoever wants to know why.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Steering {
    /// Error of heading (rad), positive towards the wall's side.
    pub error: f64,
    /// From 0 (free) to 1 (right before something).
    pub push: f64,
    /// Speed that this allows (m/s).
    pub speed: f64,
}

/// Steers along `wall`, or straight on without one.
pub fn steer(parameters: &Parameters, ring: Ring<'_>, wall: Option<Wall>) -> Steering {
    let front = free_way(ring, 0.0, parameters.radius + parameters.margin, parameters.radius);
    let span = parameters.front_far - parameters.front_near;
    let push = fmin(fmax((parameters.front_far - front) / span, 0.0), 1.0);
    let follow = wall.map_or(0.0, |wall| {
        let off = wall.distance - keep_here(parameters, ring, &wall);
        let approach = fmin(
            fmax(atan(parameters.approach_gain * off), -parameters.approach_max),
            parameters.approach_max,
        );
        wall.bearing - PI / 2.0 + approach
    });
    let error = match opening(parameters, ring, wall).filter(|_| push > 0.0) {
        // What stands in front is the far side of a door: the way is between it and the corner.
        Some(heading) => heading,
        // Else an obstacle ahead outweighs the wall: the wish to turn towards the wall fades out with the push.
        None if follow > 0.0 => follow * (1.0 - push) - push * PI / 2.0,
        None => follow - push * PI / 2.0,
    };
    let straightness = fmax(1.0 - fabs(error) / 1.2, 0.0);
    let clearness = fmin(fmax((front - parameters.front_near) / (3.0 * span), 0.0), 1.0);
    let speed =
        fmax(parameters.speed * straightness * clearness, if push < 0.9 { parameters.creep } else { 0.0 });
    Steering { error, push, speed }
}

/// The heading (towards the wall's side) of a way between the corner that is being passed and whatever comes next, if the body fits.
fn opening(parameters: &Parameters, ring: Ring<'_>, wall: Option<Wall>) -> Option<f64> {
    wall.filter(|wall| wall.bearing > PI / 3.0)?;
    let free = |heading: f64| {
        let half_width = parameters.radius + parameters.margin;
        free_way(ring, heading * parameters.side.sign(), half_width, parameters.radius)
            >= parameters.front_far
    };
    (1..=9).map(|i| f64::from(i) * 0.15).find(|&heading| free(heading))
}

/// The distance to keep: the middle, where both sides are closer than twice `keep`.
fn keep_here(parameters: &Parameters, ring: Ring<'_>, wall: &Wall) -> f64 {
    let opposite = ring.nearest_within(-parameters.side.sign() * PI / 2.0, 1.0);
    let middle = (wall.distance + opposite) / 2.0;
    fmin(parameters.keep, fmax(middle, parameters.radius + parameters.margin))
}

/// The steering as a motion, on the right side again. The speed is at most `speed` (m/s).
pub fn drive(parameters: &Parameters, steering: &Steering, speed: f64) -> Twist {
    let turn = fmin(fmax(parameters.turn_gain * steering.error, -parameters.turn_max), parameters.turn_max);
    Twist::new(fmin(speed, steering.speed), turn * parameters.side.sign())
}

#[cfg(test)]
mod tests;
