//! What a robot measured along its way.

use types::geometry::Point;

use super::canvas::{Colour, Pen, Picture};
use super::key::{EventKey, Key, Sign, start};
use super::plane::{Drawing, plane};
use super::trajectory::POINT;

/// A map as a recorded run gives it: the points that were measured, and the ways.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Map {
    /// What is known to stand in the place; often nothing.
    pub drawing: Drawing,
    /// What was measured, in the world's frame (m).
    pub points: Vec<Point>,
    /// What measured the points, for the key.
    pub points_name: String,
    /// Ways with their names, as in "odometry" and "corrected".
    pub paths: Vec<(String, Vec<Point>)>,
}

impl Map {
    /// Draws it.
    pub fn draw(&self) -> Picture {
        let mut key = Key::default();
        if !self.points.is_empty() {
            key.add(Sign::Dot(POINT), &self.points_name);
        }
        for (i, (name, _)) in self.paths.iter().enumerate() {
            key.add(Sign::Line(pen(i)), name);
        }
        if !self.paths.is_empty() {
            key.add(Sign::Start, "start");
        }
        let ways = self.paths.iter().flat_map(|(_, points)| points);
        let seen = self.points.iter().chain(ways).copied();
        plane(&self.drawing, seen, &key, &EventKey(&[]), |picture, frame| {
            picture.dots(
                self.points.iter().map(|p| frame.at(p.x, p.y)).collect(),
                0.55,
                Colour::hex(0x555555),
            );
            for (i, (_, points)) in self.paths.iter().enumerate() {
                picture.line(points.iter().map(|p| frame.at(p.x, p.y)).collect(), pen(i));
            }
            for (_, points) in &self.paths {
                if let Some(first) = points.first() {
                    // A way without headings says by its first steps where it leads.
                    let ahead = points.iter().find(|p| p.distance(*first) > 0.1).unwrap_or(first);
                    let heading = libm::atan2(ahead.y - first.y, ahead.x - first.x);
                    start(picture, frame.at(first.x, first.y), heading);
                }
            }
        })
    }
}

/// Each way has its colour, and every second one is dashed, so that they can be told apart where they cover each other.
fn pen(i: usize) -> Pen {
    let pen = Pen::new(Colour::of(i), 1.5);
    if i % 2 == 1 { pen.dashed(4.0, 2.0) } else { pen }
}
