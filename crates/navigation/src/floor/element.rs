//! A piece of outline: a segment or a circle.

use libm::{fabs, sqrt};
use types::Point;

use super::Nearest;

/// What is seen of a floor is made of these.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Element {
    /// A line from a point on, in a direction of length one. One that bounds a body has that on its left, and is seen from its right alone.
    Segment { from: Point, along: Point, length: f64, bounds: bool },
    /// A circle, seen from outside.
    Circle { centre: Point, radius: f64 },
}

/// Nearer than this to a line its direction tells which way is away (m).
const ON_IT: f64 = 1e-9;

impl Element {
    /// A side of a body that lies on its left.
    pub(super) fn side(from: Point, to: Point) -> Element {
        match Element::segment(from, to) {
            Element::Segment { from, along, length, .. } => {
                Element::Segment { from, along, length, bounds: true }
            }
            circle => circle,
        }
    }

    pub(super) fn segment(from: Point, to: Point) -> Element {
        let length = from.distance(to);
        let along = if length > 0.0 { (to - from) * (1.0 / length) } else { Point::new(1.0, 0.0) };
        Element::Segment { from, along, length, bounds: false }
    }

    pub(super) fn circle(centre: Point, radius: f64) -> Element {
        Element::Circle { centre, radius }
    }

    /// Whether a beam that ends at a point can have met it: not the far side of a body.
    #[inline]
    pub(super) fn is_met(&self, at: Point, direction: Point) -> bool {
        match *self {
            Element::Segment { along, bounds, .. } => !bounds || along.cross(direction) > 0.0,
            Element::Circle { centre, .. } => direction.dot(at - centre) <= 0.0,
        }
    }

    /// Whether it and another are sides of bodies that look in opposite directions.
    pub(super) fn is_opposite(&self, other: &Element) -> bool {
        match (self, other) {
            (
                Element::Segment { along: a, bounds: true, .. },
                Element::Segment { along: b, bounds: true, .. },
            ) => a.dot(*b) < -0.5,
            _ => false,
        }
    }

    /// From the nearest place on it to a point (m).
    #[inline]
    fn offset(&self, at: Point) -> Point {
        match *self {
            Element::Segment { from, along, length, .. } => {
                let off = at - from;
                off - along * off.dot(along).clamp(0.0, length)
            }
            Element::Circle { centre, radius } => {
                let off = at - centre;
                let far = sqrt(off.dot(off));
                if far > 0.0 { off * (1.0 - radius / far) } else { Point::new(radius, 0.0) }
            }
        }
    }

    /// The square of the distance (m²).
    #[inline]
    pub(super) fn square(&self, at: Point) -> f64 {
        let off = self.offset(at);
        off.dot(off)
    }

    pub(super) fn distance(&self, at: Point) -> f64 {
        sqrt(self.square(at))
    }

    pub(super) fn nearest(&self, at: Point) -> Nearest {
        let off = self.offset(at);
        let distance = sqrt(off.dot(off));
        let away = if distance > ON_IT { off * (1.0 / distance) } else { self.normal(at) };
        Nearest { distance, away }
    }

    /// Its normal at a point on it.
    fn normal(&self, at: Point) -> Point {
        match *self {
            Element::Segment { along, .. } => Point::new(-along.y, along.x),
            Element::Circle { centre, .. } => {
                let off = at - centre;
                let far = off.norm();
                if far > 0.0 { off * (1.0 / far) } else { Point::new(1.0, 0.0) }
            }
        }
    }

    /// How far a ray goes before it meets it (m).
    pub(super) fn cast(&self, origin: Point, direction: Point) -> Option<f64> {
        match *self {
            Element::Segment { from, along, length, .. } => {
                let slant = direction.cross(along);
                if fabs(slant) < 1e-12 {
                    return None;
                }
                let off = from - origin;
                let (t, s) = (off.cross(along) / slant, off.cross(direction) / slant);
                (t >= 0.0 && (-1e-9..=length + 1e-9).contains(&s)).then_some(t)
            }
            Element::Circle { centre, radius } => {
                let off = centre - origin;
                let middle = off.dot(direction);
                let aside = off.cross(direction);
                let half = sqrt((radius * radius - aside * aside).max(0.0));
                let hits = fabs(aside) <= radius;
                [middle - half, middle + half].into_iter().find(|t| hits && *t >= 0.0)
            }
        }
    }

    /// The corners of the smallest upright rectangle around it.
    pub(super) fn bounds(&self) -> (Point, Point) {
        let (a, b, room) = match *self {
            Element::Segment { from, along, length, .. } => (from, from + along * length, 0.0),
            Element::Circle { centre, radius } => (centre, centre, radius),
        };
        let low = Point::new(a.x.min(b.x) - room, a.y.min(b.y) - room);
        (low, Point::new(a.x.max(b.x) + room, a.y.max(b.y) + room))
    }
}
