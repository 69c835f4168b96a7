//! The outline of a robot seen from above.

use libm::{fabs, fmax, fmin, hypot, sincos, sqrt};
use types::Point;

/// A body, given around the point about which the robot turns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Body {
    /// A disc.
    Round {
        /// Its radius (m).
        radius: f64,
    },
    /// A rectangle, as wide to the left as to the right.
    Rectangle {
        /// From the turning point to its front (m).
        front: f64,
        /// From the turning point to its rear (m).
        rear: f64,
        /// From the middle to each side (m).
        half_width: f64,
    },
}

impl Body {
    /// From the turning point to the edge in a direction (m): E in the terms of the Nearness Diagram.
    pub fn edge(&self, bearing: f64) -> f64 {
        match *self {
            Body::Round { radius } => radius,
            Body::Rectangle { front, rear, half_width } => {
                let (sine, cosine) = sincos(bearing);
                let along = if cosine > 0.0 { front / cosine } else { rear / fmax(-cosine, 1e-12) };
                fmin(along, half_width / fmax(fabs(sine), 1e-12))
            }
        }
    }

    /// From the edge to a point (m), the shortest way; negative inside.
    pub fn distance(&self, point: Point) -> f64 {
        match *self {
            Body::Round { radius } => hypot(point.x, point.y) - radius,
            Body::Rectangle { front, rear, half_width } => {
                let along = fmax(point.x - front, -point.x - rear);
                let across = fabs(point.y) - half_width;
                if along > 0.0 && across > 0.0 {
                    sqrt(along * along + across * across)
                } else {
                    fmax(along, across)
                }
            }
        }
    }

    /// Half of the narrowest passage that it fits through straight on (m).
    pub fn half_width(&self) -> f64 {
        match *self {
            Body::Round { radius } => radius,
            Body::Rectangle { half_width, .. } => half_width,
        }
    }

    /// Radius of the smallest disc about the turning point that holds all of it (m): with so much room it can turn.
    pub fn reach(&self) -> f64 {
        match *self {
            Body::Round { radius } => radius,
            Body::Rectangle { front, rear, half_width } => hypot(fmax(front, rear), half_width),
        }
    }

    /// Radius of the largest disc about the turning point that lies in it (m).
    pub fn core(&self) -> f64 {
        match *self {
            Body::Round { radius } => radius,
            Body::Rectangle { front, rear, half_width } => fmin(fmin(front, rear), half_width),
        }
    }

    /// From the turning point to its front (m).
    pub fn front(&self) -> f64 {
        match *self {
            Body::Round { radius } => radius,
            Body::Rectangle { front, .. } => front,
        }
    }

    /// From the turning point to its rear (m).
    pub fn rear(&self) -> f64 {
        match *self {
            Body::Round { radius } => radius,
            Body::Rectangle { rear, .. } => rear,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use types::geometry::PI;

    const LONG: Body = Body::Rectangle { front: 0.3, rear: 0.2, half_width: 0.1 };

    #[test]
    fn a_rectangle_is_as_long_and_as_wide_as_it_is_said_to_be() {
        for (bearing, edge) in
            [(0.0, 0.3), (PI, 0.2), (PI / 2.0, 0.1), (-PI / 2.0, 0.1), (PI / 4.0, 0.1 * libm::sqrt(2.0))]
        {
            assert!(fabs(LONG.edge(bearing) - edge) < 1e-9, "{bearing}: {}", LONG.edge(bearing));
        }
        // A triangle of 3, 4 and 5 off the corner in front on the left.
        assert!(fabs(LONG.distance(Point::new(0.6, 0.5)) - 0.5) < 1e-12);
        assert!(fabs(LONG.distance(Point::new(-0.25, 0.0)) - 0.05) < 1e-12);
        assert!(fabs(LONG.distance(Point::new(0.0, 0.04)) + 0.06) < 1e-12);
    }

    proptest! {
        #[test]
        fn a_point_on_the_edge_is_at_no_distance(bearing in -PI..PI) {
            for body in [LONG, Body::Round { radius: 0.2 }] {
                let edge = body.edge(bearing);
                prop_assert!(fabs(body.distance(Point::polar(edge, bearing))) < 1e-9);
                prop_assert!(edge <= body.reach() + 1e-9 && edge >= body.core() - 1e-9);
            }
        }
    }
}
