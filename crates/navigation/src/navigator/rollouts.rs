//! What would become of a motion: the pursuit of the way, played ahead with what the drive can do, and whether the body fits all along.
//!
//! A rollout drives for a while with some highest speed and some distance of looking ahead, then brakes until it stands. It counts only if the
//! body touches nothing until then; so at each moment there is a motion that ends well, in a world that does not move: to brake as it was
//! played. Of those that count, the one is taken that comes farthest along the way.

use libm::{fabs, fmax, fmin, sqrt};
use types::geometry::wrap;
use types::messages::Twist;
use types::{Point, Pose};

use super::Parameters;
use super::surroundings::Surroundings;
use crate::avoid::Body;

/// The step of a rollout (s).
pub(super) const STEP: f64 = 0.05;
/// The body is covered by so many discs, one behind the other.
const DISCS: usize = 3;
/// Room that is always kept (m): the error of a distance between cells.
const LEAST_ROOM: f64 = 0.012;

/// Discs that cover a body.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cover {
    /// Where they are ahead of the turning point (m).
    places: [f64; DISCS],
    /// Their radius (m).
    radius: f64,
    /// The middle and the corners of its front.
    bow: [Point; 3],
}

impl Cover {
    pub(super) fn new(body: &Body) -> Cover {
        let (front, half) = (body.front(), body.half_width());
        let corner = |side: f64| match body {
            Body::Round { .. } => Point::polar(front, side * 0.8),
            Body::Rectangle { .. } => Point::new(front, side * half),
        };
        let bow = [corner(1.0), Point::new(front, 0.0), corner(-1.0)];
        match *body {
            Body::Round { radius } => Cover { places: [0.0; DISCS], radius, bow },
            Body::Rectangle { front, rear, half_width } => {
                let length = (front + rear) / DISCS as f64;
                Cover {
                    places: std::array::from_fn(|i| -rear + (i as f64 + 0.5) * length),
                    radius: libm::hypot(length / 2.0, half_width),
                    bow,
                }
            }
        }
    }

    /// The same body seen by one who looks back.
    pub(super) fn reversed(&self) -> Cover {
        Cover { places: self.places.map(|ahead| -ahead), ..*self }
    }

    /// Whether what the front of the body comes into was seen: all of it.
    fn sees(&self, around: &Surroundings, pose: Pose) -> bool {
        self.bow.iter().all(|corner| around.is_known(pose.transform(*corner)))
    }

    /// The radius of the discs (m).
    pub(super) fn radius(&self) -> f64 {
        self.radius
    }

    /// Room around the body at a pose (m); negative where it does not fit.
    pub(super) fn room(&self, around: &Surroundings, pose: Pose) -> f64 {
        let (sine, cosine) = libm::sincos(pose.heading);
        let nearest = self.places.iter().fold(f64::INFINITY, |nearest, ahead| {
            fmin(nearest, around.distance_at(Point::new(pose.x + ahead * cosine, pose.y + ahead * sine)))
        });
        nearest - self.radius
    }
}

/// One way of going on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Try {
    /// Highest speed (m/s).
    pub(super) speed: f64,
    /// How far ahead on the way it aims (m).
    pub(super) ahead: f64,
    /// Off by more than this, it turns in place first (rad).
    pub(super) turn_first: f64,
}

/// What became of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Outcome {
    /// The motion that begins it.
    pub(super) first: Twist,
    /// How far along the way it comes (m).
    pub(super) progress: f64,
    /// The least room around the body until it stands (m).
    pub(super) room: f64,
}

/// A place on the way: the number of a point.
type Place = usize;

/// The way with the lengths up to its points.
#[derive(Clone, Debug)]
pub(super) struct Track {
    points: Vec<Point>,
    lengths: Vec<f64>,
}

impl Track {
    pub(super) fn new() -> Track {
        let points = super::route::POINTS;
        Track { points: Vec::with_capacity(points), lengths: Vec::with_capacity(points) }
    }

    pub(super) fn set(&mut self, points: &[Point]) {
        self.points.clear();
        self.lengths.clear();
        let mut length = 0.0;
        for (i, point) in points.iter().enumerate() {
            if i > 0 {
                length += points[i - 1].distance(*point);
            }
            self.points.push(*point);
            self.lengths.push(length);
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// The place next to `at`, from `from` on.
    fn advance(&self, from: Place, at: Point) -> Place {
        let mut best = from;
        let mut least = square(self.points[from] - at);
        // A curve may come near again, but not within so few points.
        for i in from + 1..self.points.len().min(from + 24) {
            let apart = square(self.points[i] - at);
            if apart < least {
                (best, least) = (i, apart);
            }
        }
        best
    }

    /// The point `ahead` (m) of a place.
    pub(super) fn ahead(&self, from: Place, ahead: f64) -> Point {
        let wanted = self.lengths[from] + ahead;
        let i = from + self.lengths[from..].partition_point(|length| *length < wanted);
        self.points[i.min(self.points.len() - 1)]
    }

    /// Its whole length (m).
    pub(super) fn lengths_left(&self) -> f64 {
        self.lengths.last().copied().unwrap_or(0.0)
    }

    /// What is left from a place to the end (m).
    fn left(&self, from: Place) -> f64 {
        self.lengths[self.lengths.len() - 1] - self.lengths[from]
    }
}

fn square(vector: Point) -> f64 {
    vector.dot(vector)
}

/// Plays the pursuit from `start` at `present`, with a part `care` of the room that is to be kept.
pub(super) fn play(
    parameters: &Parameters,
    cover: &Cover,
    around: &Surroundings,
    track: &Track,
    (start, present): (Pose, Twist),
    attempt: Try,
    care: f64,
) -> Option<Outcome> {
    let (mut pose, mut twist, mut place) = (start, present, 0);
    let mut first = None;
    let mut least = f64::INFINITY;
    let began = around_allowance(cover, around, start);
    let steps = (parameters.horizon / STEP) as usize;
    let mut progress = 0.0;
    let mut left = steps + (2.0 * parameters.linear_max / parameters.deceleration / STEP) as usize;
    let mut step = 0;
    while left > 0 {
        place = track.advance(place, pose.position());
        let brakes = step >= steps;
        let wish = pursue(parameters, track, place, pose, twist, attempt, brakes);
        twist = reach(parameters, twist, wish);
        first.get_or_insert(wish);
        pose = pose.advanced(twist.linear, twist.angular, STEP);
        let room = cover.room(around, pose);
        let kept = fmax(care * (parameters.margin + parameters.margin_time * fabs(twist.linear)), LEAST_ROOM);
        let needed = fmin(kept, began);
        let unseen = twist.linear > parameters.unseen_max && !cover.sees(around, pose);
        if room < needed || unseen && care > 0.0 {
            return None;
        }
        least = fmin(least, room);
        step += 1;
        left -= 1;
        if step == steps {
            let place = track.advance(place, pose.position());
            let off = track.points[place].distance(pose.position());
            progress = track.lengths[place] - off;
        }
        if brakes && fabs(twist.linear) < 1e-3 {
            break;
        }
    }
    first.map(|first| Outcome { first, progress, room: least })
}

/// Where the body stands already, it may have less room than is wished for, but not lose any.
fn around_allowance(cover: &Cover, around: &Surroundings, start: Pose) -> f64 {
    cover.room(around, start) - 1e-4
}

/// The motion that pursues the way: an arc through the point ahead, κ = 2 y/L².
fn pursue(
    parameters: &Parameters,
    track: &Track,
    place: Place,
    pose: Pose,
    present: Twist,
    attempt: Try,
    brakes: bool,
) -> Twist {
    let target = pose.inverse_transform(track.ahead(place, attempt.ahead));
    let squared = fmax(square(target), 1e-4);
    let off = libm::atan2(target.y, target.x);
    if fabs(off) > attempt.turn_first && !brakes {
        return Twist::new(0.0, (off * 4.0).clamp(-parameters.angular_max, parameters.angular_max));
    }
    let curvature = 2.0 * target.y / squared;
    let bend = fmax(fabs(curvature), 1e-6);
    let by_turn = fmin(parameters.angular_max / bend, sqrt(parameters.lateral_max / bend));
    // As fast as it can still stop at the end of the way.
    let by_end = sqrt(2.0 * parameters.deceleration * track.left(place));
    let speed = fmin(fmin(attempt.speed, by_turn), by_end);
    let speed = if brakes || target.x <= 0.0 { 0.0 } else { speed };
    // While it brakes it keeps to the arc.
    let rolled = if brakes { fmax(present.linear - parameters.deceleration * STEP, 0.0) } else { speed };
    let rolled = fmin(rolled, fmax(fabs(present.linear) + parameters.acceleration * STEP, 0.0));
    let turn =
        (curvature * fmax(rolled, fmin(0.1, speed))).clamp(-parameters.angular_max, parameters.angular_max);
    Twist::new(speed, turn)
}

/// What the drive makes of a wish within a step.
fn reach(parameters: &Parameters, present: Twist, wish: Twist) -> Twist {
    let up = parameters.acceleration * STEP;
    let down = parameters.deceleration * STEP;
    let turn = parameters.angular_acceleration * STEP;
    let (least, most) = if present.linear >= 0.0 { (-down, up) } else { (-up, down) };
    Twist::new(
        present.linear + (wish.linear - present.linear).clamp(least, most),
        present.angular + (wish.angular - present.angular).clamp(-turn, turn),
    )
}

/// Brakes as hard as it can on an arc that bends by `curvature` (1/m): the motion that begins it, and the least room on the way.
pub(super) fn brake(
    parameters: &Parameters,
    cover: &Cover,
    around: &Surroundings,
    (start, present): (Pose, Twist),
    curvature: f64,
) -> Outcome {
    let (mut pose, mut twist) = (start, present);
    let bent = |twist: Twist| {
        let turn = curvature * twist.linear;
        Twist::new(0.0, turn.clamp(-parameters.angular_max, parameters.angular_max))
    };
    let first = bent(reach(parameters, twist, Twist::ZERO));
    let mut least = cover.room(around, pose);
    for _ in 0..(2.0 * parameters.linear_max / parameters.deceleration / STEP) as usize {
        twist = reach(parameters, twist, bent(twist));
        pose = pose.advanced(twist.linear, twist.angular, STEP);
        least = fmin(least, cover.room(around, pose));
        if fabs(twist.linear) < 1e-3 {
            break;
        }
    }
    Outcome { first, progress: 0.0, room: least }
}

/// Whether the body fits while it follows `wish` for `seconds` and then stands; with the least room (m).
pub(super) fn sweep(
    parameters: &Parameters,
    cover: &Cover,
    around: &Surroundings,
    (start, present): (Pose, Twist),
    wish: Twist,
    seconds: f64,
) -> Option<f64> {
    let (mut pose, mut twist) = (start, present);
    let began = around_allowance(cover, around, start);
    let mut least = f64::INFINITY;
    let steps = (seconds / STEP) as usize;
    for step in 0..steps + 40 {
        let wish = if step < steps { wish } else { Twist::ZERO };
        twist = reach(parameters, twist, wish);
        pose = pose.advanced(twist.linear, twist.angular, STEP);
        let room = cover.room(around, pose);
        if room < fmin(fmax(0.5 * parameters.margin, LEAST_ROOM), began) {
            return None;
        }
        least = fmin(least, room);
        if step >= steps && fabs(twist.linear) < 1e-3 && fabs(twist.angular) < 1e-2 {
            break;
        }
    }
    Some(least)
}

/// A point as it is seen from a pose.
trait Seen {
    fn inverse_transform(&self, point: Point) -> Point;
}

impl Seen for Pose {
    fn inverse_transform(&self, point: Point) -> Point {
        let (sine, cosine) = libm::sincos(wrap(self.heading));
        let to = point - self.position();
        Point::new(to.x * cosine + to.y * sine, to.y * cosine - to.x * sine)
    }
}
