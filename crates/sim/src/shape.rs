//! Segments, circles and polygons: where a ray meets them and how far a point is from them.

use libm::{hypot, sqrt};
use types::Point;

/// A straight piece from `a` to `a + along`, with its unit normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Where it begins (m).
    pub a: Point,
    /// From its begin to its end (m).
    pub along: Point,
    /// The unit vector to the right of `along`: outward for outlines that run counter-clockwise.
    pub normal: Point,
}

/// A circle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Circle {
    /// Its centre (m).
    pub centre: Point,
    /// Its radius (m).
    pub radius: f64,
}

impl Segment {
    /// The segment between two points.
    pub fn new(a: Point, b: Point) -> Segment {
        let along = b - a;
        let length = hypot(along.x, along.y);
        let normal =
            if length > 0.0 { Point::new(along.y / length, -along.x / length) } else { Point::new(1.0, 0.0) };
        Segment { a, along, normal }
    }

    /// Its other end (m).
    pub fn b(&self) -> Point {
        self.a + self.along
    }

    /// The `t` in [0, limit) for which `origin + t · direction` lies on the segment.
    #[inline]
    pub fn meet(&self, origin: Point, direction: Point, limit: f64) -> Option<f64> {
        let from = self.a - origin;
        let mut det = direction.cross(self.along);
        let mut t = from.cross(self.along);
        let mut s = from.cross(direction);
        if det < 0.0 {
            (det, t, s) = (-det, -t, -s);
        }
        // One division, and only for a true hit: the tests are made on the numerators.
        (s >= 0.0 && s <= det && t >= 0.0 && t < limit * det).then(|| t / det)
    }

    /// The point of the segment nearest to `point`.
    #[inline]
    pub fn nearest(&self, point: Point) -> Point {
        let length2 = self.along.dot(self.along);
        let s =
            if length2 > 0.0 { ((point - self.a).dot(self.along) / length2).clamp(0.0, 1.0) } else { 0.0 };
        self.a + self.along * s
    }
}

impl Circle {
    /// The smallest `t` in [0, limit) for which `origin + t · direction` lies on the circle, coming from outside.
    ///
    /// A ray that starts inside meets nothing.
    #[inline]
    pub fn meet(&self, origin: Point, direction: Point, limit: f64) -> Option<f64> {
        let to = self.centre - origin;
        let b = to.dot(direction);
        if b <= 0.0 {
            return None;
        }
        let a = direction.dot(direction);
        let c = to.dot(to) - self.radius * self.radius;
        let root = b * b - a * c;
        if c < 0.0 || root < 0.0 {
            return None;
        }
        let t = (b - sqrt(root)) / a;
        (t < limit).then_some(t)
    }
}

/// Whether `point` lies inside the polygon (crossing number; the border belongs to one side of it).
pub fn inside(polygon: &[Point], point: Point) -> bool {
    let mut odd = false;
    let mut last = match polygon.last() {
        Some(&last) => last,
        None => return false,
    };
    for &next in polygon {
        if (next.y > point.y) != (last.y > point.y)
            && point.x < (last.x - next.x) * (point.y - next.y) / (last.y - next.y) + next.x
        {
            odd = !odd;
        }
        last = next;
    }
    odd
}

/// The corners of a rectangle turned by `angle` (rad), counter-clockwise.
pub fn rectangle(centre: Point, size: Point, angle: f64) -> [Point; 4] {
    let frame = types::Pose::new(centre.x, centre.y, angle);
    let (x, y) = (size.x / 2.0, size.y / 2.0);
    [Point::new(-x, -y), Point::new(x, -y), Point::new(x, y), Point::new(-x, y)].map(|p| frame.transform(p))
}

#[cfg(test)]
mod tests {
    use super::*;
    use types::geometry::PI;

    #[test]
    fn a_ray_meets_a_wall_at_the_distance_over_the_cosine() {
        let wall = Segment::new(Point::new(2.0, -9.0), Point::new(2.0, 9.0));
        for degrees in [-60.0f64, -20.0, 0.0, 35.0, 70.0] {
            let angle = degrees.to_radians();
            let t = wall.meet(Point::default(), Point::polar(1.0, angle), 100.0).unwrap();
            assert!((t - 2.0 / angle.cos()).abs() < 1e-12, "{degrees}: {t}");
        }
        assert_eq!(wall.meet(Point::default(), Point::polar(1.0, PI), 100.0), None);
        assert_eq!(wall.meet(Point::default(), Point::new(1.0, 0.0), 1.9), None);
    }

    #[test]
    fn a_ray_meets_a_circle_where_the_quadratic_says() {
        let circle = Circle { centre: Point::new(3.0, 0.5), radius: 1.0 };
        let t = circle.meet(Point::default(), Point::new(1.0, 0.0), 100.0).unwrap();
        assert!((t - (3.0 - 0.75f64.sqrt())).abs() < 1e-12, "{t}");
        assert_eq!(circle.meet(Point::new(3.0, 0.0), Point::new(1.0, 0.0), 100.0), None);
        assert_eq!(circle.meet(Point::default(), Point::new(-1.0, 0.0), 100.0), None);
    }

    #[test]
    fn a_polygon_knows_its_inside() {
        let l = [(0., 0.), (4., 0.), (4., 1.), (1., 1.), (1., 3.), (0., 3.)].map(|(x, y)| Point::new(x, y));
        for (x, y, expect) in
            [(0.5, 2.5, true), (3.5, 0.5, true), (2.0, 2.0, false), (-0.1, 0.5, false), (5.0, 0.5, false)]
        {
            assert_eq!(inside(&l, Point::new(x, y)), expect, "({x}, {y})");
        }
    }

    proptest::proptest! {
        #[test]
        fn no_point_of_a_segment_is_nearer_than_the_nearest(x in -5f64..5., y in -5f64..5., s in 0f64..1.) {
            let segment = Segment::new(Point::new(-1.0, 2.0), Point::new(3.0, -1.0));
            let point = Point::new(x, y);
            let nearest = segment.nearest(point).distance(point);
            proptest::prop_assert!(nearest <= (segment.a + segment.along * s).distance(point) + 1e-12);
        }
    }
}
