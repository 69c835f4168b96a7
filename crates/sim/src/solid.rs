//! The outlines of bodies that move: discs and turned rectangles, how far they are from things, and where rays meet them.
//!
//! A rectangle is measured in its own frame, where it is |x| ≤ a and |y| ≤ b. What is apart has a positive distance; what
//! overlaps has a negative one, whose size says only that it is not zero.

use libm::{fabs, hypot, sincos};
use types::{Point, Pose};

use crate::shape::{Circle, Segment};

/// A rectangle that is turned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rectangle {
    pub middle: Point,
    /// Half of its length and of its width (m).
    pub half: Point,
    /// The unit vector along its length.
    axis: Point,
}

/// What a body covers of the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Solid {
    Round(Circle),
    Square(Rectangle),
}

/// How far something is, and its nearest point (m).
pub(crate) type Gap = (f64, Point);

impl Rectangle {
    /// The rectangle of this length and width whose middle lies `ahead` of the pose.
    pub(crate) fn new(pose: Pose, length: f64, width: f64, ahead: f64) -> Rectangle {
        let (s, c) = sincos(pose.heading);
        let axis = Point::new(c, s);
        Rectangle {
            middle: pose.position() + axis * ahead,
            half: Point::new(length / 2.0, width / 2.0),
            axis,
        }
    }

    /// A point of the world in the frame of the rectangle.
    #[inline]
    fn local(&self, point: Point) -> Point {
        let away = point - self.middle;
        Point::new(away.dot(self.axis), self.axis.cross(away))
    }

    /// A point of the frame of the rectangle in the world.
    #[inline]
    fn world(&self, point: Point) -> Point {
        self.middle + self.axis * point.x + Point::new(-self.axis.y, self.axis.x) * point.y
    }

    /// Its corners, counter-clockwise.
    pub(crate) fn corners(&self) -> [Point; 4] {
        let Point { x, y } = self.half;
        [Point::new(-x, -y), Point::new(x, -y), Point::new(x, y), Point::new(-x, y)].map(|p| self.world(p))
    }

    /// Its sides, with their normals outward.
    pub(crate) fn sides(&self) -> [Segment; 4] {
        let [a, b, c, d] = self.corners();
        [Segment::new(a, b), Segment::new(b, c), Segment::new(c, d), Segment::new(d, a)]
    }

    /// How far a point in the frame of the rectangle is from it (m), and the point of the rectangle nearest to it.
    fn gap_inside(&self, point: Point) -> Gap {
        let Point { x: a, y: b } = self.half;
        let on = Point::new(point.x.clamp(-a, a), point.y.clamp(-b, b));
        if on != point {
            return (hypot(point.x - on.x, point.y - on.y), on);
        }
        // Inside: the nearest side.
        let (x, y) = (a - fabs(point.x), b - fabs(point.y));
        let side = |half: f64, x: f64| if x < 0.0 { -half } else { half };
        if x < y {
            (-x, Point::new(side(a, point.x), point.y))
        } else {
            (-y, Point::new(point.x, side(b, point.y)))
        }
    }

    /// How far a point is from the rectangle (m), negative inside, and the point of its border nearest to it.
    pub(crate) fn gap_to_point(&self, point: Point) -> Gap {
        let (distance, on) = self.gap_inside(self.local(point));
        (distance, self.world(on))
    }

    /// How far a circle is from the rectangle (m), and the point of the circle nearest to it.
    pub(crate) fn gap_to_circle(&self, circle: Circle) -> Gap {
        let (distance, on) = self.gap_to_point(circle.centre);
        let way = on - circle.centre;
        let length = hypot(way.x, way.y);
        let point = if length > 0.0 { circle.centre + way * (circle.radius / length) } else { on };
        (distance - circle.radius, point)
    }

    /// How far a segment is from the rectangle (m), and the point of the segment nearest to it.
    pub(crate) fn gap_to_segment(&self, segment: &Segment) -> Gap {
        let (from, to) = (self.local(segment.a), self.local(segment.b()));
        if let Some(chord) = self.chord(from, to) {
            let (depth, _) = self.gap_inside(chord);
            return (depth.min(0.0), self.world(chord));
        }
        let mut best = (f64::INFINITY, from);
        for end in [from, to] {
            let (distance, _) = self.gap_inside(end);
            if distance < best.0 {
                best = (distance, end);
            }
        }
        let local = Segment::new(from, to);
        let Point { x, y } = self.half;
        for corner in [Point::new(-x, -y), Point::new(x, -y), Point::new(x, y), Point::new(-x, y)] {
            let near = local.nearest(corner);
            let distance = hypot(near.x - corner.x, near.y - corner.y);
            if distance < best.0 {
                best = (distance, near);
            }
        }
        (best.0, self.world(best.1))
    }

    /// The middle of the part of a segment, in the frame of the rectangle, that lies in it. Liang and Barsky (1984).
    fn chord(&self, from: Point, to: Point) -> Option<Point> {
        let along = to - from;
        let (mut enter, mut leave) = (0.0f64, 1.0f64);
        for (o, d, half) in [(from.x, along.x, self.half.x), (from.y, along.y, self.half.y)] {
            if d == 0.0 {
                if fabs(o) > half {
                    return None;
                }
            } else {
                let (p, q) = ((-half - o) / d, (half - o) / d);
                enter = enter.max(p.min(q));
                leave = leave.min(p.max(q));
            }
        }
        (enter <= leave).then(|| from + along * ((enter + leave) / 2.0))
    }

    /// How far another rectangle is from this one (m), and its point nearest to this one.
    pub(crate) fn gap_to_rectangle(&self, other: &Rectangle) -> Gap {
        // A side of the other that crosses this one, or lies in it, has a negative distance by itself.
        let inside = other.gap_to_point(self.middle);
        if inside.0 < 0.0 {
            return inside;
        }
        let gaps = other.sides().map(|side| self.gap_to_segment(&side));
        gaps.into_iter()
            .fold((f64::INFINITY, other.middle), |best, gap| if gap.0 < best.0 { gap } else { best })
    }

    /// The smallest `t` in [0, limit) for which `origin + t · direction` enters it; a ray that starts inside meets nothing.
    pub(crate) fn meet(&self, origin: Point, direction: Point, limit: f64) -> Option<f64> {
        self.through(origin, direction).map(|(enter, _, _)| enter).filter(|enter| *enter < limit)
    }

    /// Where a ray from outside enters and leaves, and the normal of the side by which it enters.
    pub(crate) fn through(&self, origin: Point, direction: Point) -> Option<(f64, f64, Point)> {
        let from = self.local(origin);
        let along = Point::new(direction.dot(self.axis), self.axis.cross(direction));
        let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
        let mut normal = Point::new(0.0, 0.0);
        let sides = [(from.x, along.x, self.half.x, self.axis), (from.y, along.y, self.half.y, self.left())];
        for (o, d, half, outward) in sides {
            if d == 0.0 {
                if fabs(o) > half {
                    return None;
                }
                continue;
            }
            let (p, q) = ((-half - o) / d, (half - o) / d);
            if p.min(q) > enter {
                enter = p.min(q);
                normal = outward * if d > 0.0 { -1.0 } else { 1.0 };
            }
            leave = leave.min(p.max(q));
        }
        (enter >= 0.0 && enter <= leave).then_some((enter, leave, normal))
    }

    fn left(&self) -> Point {
        Point::new(-self.axis.y, self.axis.x)
    }
}

impl Solid {
    /// The corners of the smallest upright rectangle around it (m).
    pub(crate) fn bounds(&self) -> (Point, Point) {
        let (middle, reach) = match self {
            Solid::Round(circle) => (circle.centre, Point::new(circle.radius, circle.radius)),
            Solid::Square(it) => {
                let (axis, half) = (Point::new(fabs(it.axis.x), fabs(it.axis.y)), it.half);
                let reach = Point::new(axis.x * half.x + axis.y * half.y, axis.y * half.x + axis.x * half.y);
                (it.middle, reach)
            }
        };
        (middle - reach, middle + reach)
    }

    /// The smallest `t` in [0, limit) for which `origin + t · direction` enters it; a ray that starts inside meets nothing.
    #[inline]
    pub(crate) fn meet(&self, origin: Point, direction: Point, limit: f64) -> Option<f64> {
        match self {
            Solid::Round(circle) => circle.meet(origin, direction, limit),
            Solid::Square(rectangle) => rectangle.meet(origin, direction, limit),
        }
    }

    /// The unit vector outward where a ray meets it at `t`.
    pub(crate) fn normal(&self, origin: Point, direction: Point, t: f64) -> Point {
        match self {
            Solid::Round(circle) => (origin + direction * t - circle.centre) * (1.0 / circle.radius),
            Solid::Square(it) => {
                it.through(origin, direction).map_or(Point::new(0.0, 0.0), |(_, _, normal)| normal)
            }
        }
    }

    /// How far another is from it (m), negative where they overlap, and the point of the other nearest to it.
    pub(crate) fn gap_to(&self, other: &Solid) -> Gap {
        match (self, other) {
            (Solid::Round(this), Solid::Round(other)) => {
                let (distance, point) = other.gap(this.centre);
                (distance - this.radius, point)
            }
            (Solid::Round(this), Solid::Square(other)) => {
                let (distance, point) = other.gap_to_point(this.centre);
                (distance - this.radius, point)
            }
            (Solid::Square(this), Solid::Round(other)) => this.gap_to_circle(*other),
            (Solid::Square(this), Solid::Square(other)) => this.gap_to_rectangle(other),
        }
    }

    /// How far a point is from it (m), negative inside, and the point of its border nearest to the point.
    #[inline]
    pub(crate) fn gap_to_point(&self, point: Point) -> Gap {
        match self {
            Solid::Round(circle) => circle.gap(point),
            Solid::Square(rectangle) => rectangle.gap_to_point(point),
        }
    }
}

impl Circle {
    /// How far a point is from the circle (m), negative inside, and the point of the circle nearest to the point.
    #[inline]
    pub(crate) fn gap(&self, point: Point) -> Gap {
        let from = point - self.centre;
        let length = libm::sqrt(from.dot(from));
        let out = if length > 0.0 { from * (1.0 / length) } else { Point::new(1.0, 0.0) };
        (length - self.radius, self.centre + out * self.radius)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use types::geometry::{PI, TAU};

    fn rectangles() -> impl Strategy<Value = Rectangle> {
        (-3f64..3., -3f64..3., -PI..PI, 0.05f64..2., 0.05f64..2., -0.5f64..0.5).prop_map(
            |(x, y, heading, length, width, ahead)| {
                Rectangle::new(Pose::new(x, y, heading), length, width, ahead)
            },
        )
    }

    /// Points of the sides and of the inside, about a centimetre apart.
    fn samples(it: &Rectangle) -> Vec<Point> {
        let steps = 60;
        let part = |k: i32| f64::from(k) / f64::from(steps) * 2.0 - 1.0;
        (0..=steps)
            .flat_map(|i| (0..=steps).map(move |j| Point::new(part(i), part(j))))
            .map(|p| it.world(Point::new(p.x * it.half.x, p.y * it.half.y)))
            .collect()
    }

    /// Half of the longest step between two samples (m).
    fn fineness(it: &Rectangle) -> f64 {
        hypot(it.half.x, it.half.y) / 60.0 + 1e-9
    }

    proptest! {
        #[test]
        fn the_distance_of_a_segment_is_that_of_a_dense_sampling(
            it in rectangles(), x in -3f64..3., y in -3f64..3., angle in 0f64..TAU, length in 0.01f64..3.
        ) {
            let a = Point::new(x, y);
            let segment = Segment::new(a, a + Point::polar(length, angle));
            let (distance, point) = it.gap_to_segment(&segment);
            let sampled = samples(&it)
                .into_iter()
                .map(|p| segment.nearest(p).distance(p))
                .fold(f64::INFINITY, f64::min);
            // The samples lie in the rectangle: none is nearer than the distance, and one is nearly as near.
            prop_assert!(sampled >= distance - 1e-12, "{} {}", sampled, distance);
            prop_assert!(sampled <= distance.max(0.0) + fineness(&it), "{} {}", sampled, distance);
            prop_assert!(segment.nearest(point).distance(point) < 1e-9, "the point lies on the segment");
            if distance > 0.0 {
                prop_assert!((it.gap_to_point(point).0 - distance).abs() < 1e-9);
            }
        }

        #[test]
        fn the_distance_of_rectangles_is_that_of_a_dense_sampling(it in rectangles(), other in rectangles()) {
            let (distance, point) = it.gap_to_rectangle(&other);
            let sampled =
                samples(&other).into_iter().map(|p| it.gap_to_point(p).0).fold(f64::INFINITY, f64::min);
            if distance > 0.0 {
                prop_assert!(sampled >= distance - 1e-12 && sampled <= distance + fineness(&other));
                prop_assert!(other.gap_to_point(point).0.abs() < 1e-9, "the point lies on its border");
                prop_assert!((it.gap_to_point(point).0 - distance).abs() < 1e-9);
            } else {
                prop_assert!(sampled <= fineness(&other), "{} {}", sampled, distance);
            }
            // Who is asked makes no difference.
            let back = other.gap_to_rectangle(&it).0;
            prop_assert!((back - distance).abs() < 1e-9 || (back <= 0.0 && distance <= 0.0), "{} {}", back, distance);
        }

        #[test]
        fn the_distance_of_a_circle_is_that_of_its_centre_less_its_radius(
            it in rectangles(), x in -3f64..3., y in -3f64..3., radius in 0.01f64..1.
        ) {
            let circle = Circle { centre: Point::new(x, y), radius };
            let (distance, point) = it.gap_to_circle(circle);
            let sampled = samples(&it)
                .into_iter()
                .map(|p| p.distance(circle.centre) - radius)
                .fold(f64::INFINITY, f64::min);
            prop_assert!(sampled >= distance - 1e-12);
            prop_assert!(sampled <= distance.max(-radius) + fineness(&it), "{} {}", sampled, distance);
            prop_assert!((point.distance(circle.centre) - radius).abs() < 1e-9);
        }

        #[test]
        fn a_ray_meets_the_nearest_of_the_four_sides(
            it in rectangles(), x in -4f64..4., y in -4f64..4., angle in 0f64..TAU
        ) {
            let (origin, direction) = (Point::new(x, y), Point::polar(1.0, angle));
            prop_assume!(it.gap_to_point(origin).0 > 1e-6);
            let met = it.meet(origin, direction, 20.0);
            let by_sides = it.sides().into_iter().filter_map(|side| Some((side.meet(origin, direction, 20.0)?, side.normal)));
            let best = by_sides.fold(None, |best: Option<(f64, Point)>, hit| {
                if best.is_none_or(|best| hit.0 < best.0) { Some(hit) } else { best }
            });
            match (met, best) {
                (Some(t), Some((by_side, normal))) => {
                    prop_assert!((t - by_side).abs() < 1e-9, "{} {}", t, by_side);
                    let ours = Solid::Square(it).normal(origin, direction, t);
                    let corner = it.corners().iter().any(|c| c.distance(origin + direction * t) < 1e-6);
                    prop_assert!(corner || ours.distance(normal) < 1e-9);
                }
                (met, best) => {
                    // Only a ray through a corner may be told differently.
                    let corner = |t: f64| it.corners().iter().any(|c| c.distance(origin + direction * t) < 1e-6);
                    prop_assert!(met.is_none_or(corner) && best.is_none_or(|(t, _)| corner(t)));
                }
            }
        }

        #[test]
        fn the_bounds_hold_the_corners_and_no_more(it in rectangles()) {
            let (min, max) = Solid::Square(it).bounds();
            let corners = it.corners();
            let least = |of: fn(&Point) -> f64| corners.iter().map(of).fold(f64::INFINITY, f64::min);
            let most = |of: fn(&Point) -> f64| corners.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
            prop_assert!(Point::new(least(|p| p.x), least(|p| p.y)).distance(min) < 1e-9);
            prop_assert!(Point::new(most(|p| p.x), most(|p| p.y)).distance(max) < 1e-9);
        }
    }
}
