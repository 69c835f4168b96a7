//! Ultrasonic ranges: the first echo in a cone, with what makes sonars hard.
//!
//! A smooth face answers only when it is met nearly at right angles; edges and round things answer always. The cone is a
//! fan of rays for the faces, and the edges and round things in it one by one. To the range come noise in proportion,
//! constant noise, and false short readings from the neighbours' pulses.

use libm::{cos, sincos, sqrt, tan};
use types::Point;

use crate::field::{Field, Met, Scatterer};
use crate::model::{Shape, Sonar};
use crate::shape::Circle;
use crate::solid::Solid;
use types::chance::Stream;

/// Rays of a fan. With 5° between them the range of a face errs by less than 0.1 %.
const RAYS: usize = 7;
/// The order of the rays: the middle first, because it is met first most often and then cuts the others short.
const ORDER: [f64; RAYS] = [0.0, -1.0, 1.0, -2.0, 2.0, -3.0, 3.0];

/// The directions of a ring in the frame of the robot, made once.
#[derive(Clone, Debug)]
pub(crate) struct Fan {
    axes: Vec<Point>,
    rays: Vec<[Point; RAYS]>,
    /// How far each sits from the middle of the robot (m).
    mounts: Vec<f64>,
    tangent: f64,
    oblique: f64,
}

impl Fan {
    /// The ring of `sonar` on the rim of a body.
    pub(crate) fn new(sonar: &Sonar, shape: &Shape) -> Fan {
        let bearing = |which: u32| sonar.bearing(which);
        let apart = sonar.half_angle / 3.0;
        Fan {
            axes: (0..sonar.count).map(|which| Point::polar(1.0, bearing(which))).collect(),
            rays: (0..sonar.count)
                .map(|which| ORDER.map(|k| Point::polar(1.0, bearing(which) + k * apart)))
                .collect(),
            mounts: (0..sonar.count).map(|which| shape.rim(bearing(which))).collect(),
            tangent: tan(sonar.half_angle),
            oblique: cos(sonar.specular_angle),
        }
    }

    /// The distance of the first echo of sensor `which`, if there is one (m).
    pub(crate) fn echo(
        &self,
        field: &Field,
        sonar: &Sonar,
        pose: types::Pose,
        body: u32,
        which: usize,
    ) -> Option<f64> {
        let (s, c) = sincos(pose.heading);
        let turn = |p: Point| Point::new(c * p.x - s * p.y, s * p.x + c * p.y);
        let axis = turn(self.axes[which]);
        let origin = pose.position() + axis * self.mounts[which];
        let mut best = sonar.max_range;
        for &ray in &self.rays[which] {
            let ray = turn(ray);
            if let Some(hit) = field.cast(origin, ray, best, sonar.height, body) {
                let normal = match hit.met {
                    Met::Face(index) => field.faces[index as usize].segment.normal,
                    Met::Post(index) => outward(field.posts[index as usize].circle, origin + ray * hit.t),
                    Met::Body(index) => field.bodies[index as usize].solid.normal(origin, ray, hit.t),
                };
                if libm::fabs(ray.dot(normal)) >= self.oblique {
                    best = hit.t;
                }
            }
        }
        self.scattered(field, sonar, origin, axis, body, &mut best);
        (best < sonar.max_range).then_some(best)
    }

    /// Shortens `best` to the nearest edge or round thing that is seen in the cone.
    fn scattered(&self, field: &Field, sonar: &Sonar, origin: Point, axis: Point, body: u32, best: &mut f64) {
        let side = Point::new(-axis.y, axis.x) * (*best * self.tangent);
        let far = origin + axis * *best;
        let corners = [origin, far + side, far - side];
        let min = corners.iter().fold(origin, |min, p| Point::new(min.x.min(p.x), min.y.min(p.y)));
        let max = corners.iter().fold(origin, |max, p| Point::new(max.x.max(p.x), max.y.max(p.y)));
        let mut offer = |circle: Circle, low: f64, high: f64| {
            let to = circle.centre - origin;
            let forward = to.dot(axis);
            if forward <= 0.0
                || libm::fabs(to.cross(axis)) > forward * self.tangent
                || sonar.height < low
                || sonar.height > high
            {
                return;
            }
            let distance = sqrt(to.dot(to));
            let range = distance - circle.radius;
            // A hair short of the surface: the thing itself must not hide itself.
            if range > 0.0
                && range < *best
                && field.cast(origin, to * (1.0 / distance), range * 0.999, sonar.height, body).is_none()
            {
                *best = range;
            }
        };
        field.scatterers(min, max, |what| match what {
            Scatterer::Edge(index) => {
                let (centre, low, high) = field.edges[index as usize];
                offer(Circle { centre, radius: 0.0 }, low, high);
            }
            Scatterer::Post(index) => {
                let post = &field.posts[index as usize];
                offer(post.circle, post.low, post.high);
            }
            Scatterer::Body(index) => {
                let other = &field.bodies[index as usize];
                if index != body && other.present {
                    match &other.solid {
                        Solid::Round(circle) => offer(*circle, 0.0, other.high),
                        // Its upright edges scatter, as those of walls do.
                        Solid::Square(rectangle) => rectangle
                            .corners()
                            .into_iter()
                            .for_each(|centre| offer(Circle { centre, radius: 0.0 }, 0.0, other.high)),
                    }
                }
            }
        });
    }
}

fn outward(circle: Circle, point: Point) -> Point {
    (point - circle.centre) * (1.0 / circle.radius)
}

/// What the sensor reads for an echo at this distance: `draw` is the stream of this sensor's sample.
pub(crate) fn reading(sonar: &Sonar, echo: Option<f64>, draw: Stream) -> f32 {
    let mut range = match echo {
        Some(range) => range + draw.normal(0) * (sonar.noise + sonar.relative_noise * range),
        None => sonar.max_range,
    };
    if sonar.crosstalk > 0.0 && draw.uniform(2) < sonar.crosstalk {
        range = draw.between(3, sonar.min_range, range.max(sonar.min_range));
    }
    range.clamp(sonar.min_range, sonar.max_range.max(sonar.min_range)) as f32
}
