//! The ground seen from above: what stands on it, with the same scale along both axes.

use types::geometry::Point;

use super::axes::{Frame, SMALL, Scale, bounds, labelled, number};
use super::canvas::{Anchor, Colour, INK, Label, Pen, Picture};
use super::font;
use super::key::{EventKey, Key};

/// What stands in a place: plain shapes in the world's frame (m).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drawing {
    /// Walls, from point to point.
    pub segments: Vec<(Point, Point)>,
    /// Round things: centre and radius.
    pub circles: Vec<(Point, f64)>,
    /// Things with corners.
    pub polygons: Vec<Vec<Point>>,
    /// Parts of the ground that mean something.
    pub regions: Vec<Region>,
    /// Names, centred at their places.
    pub labels: Vec<(Point, String)>,
}

/// A part of the ground, with its name in its middle where it has one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Region {
    /// Its corners.
    pub corners: Vec<Point>,
    /// Its name.
    pub name: String,
}

const WALL: Pen = Pen::new(INK, 1.3);
const THING: Colour = Colour::hex(0xd0d0d0);
const GROUND: Colour = Colour::hex(0xeef3e6);

/// Width of the whole figure and what stands around the plot (points).
const WIDTH: f64 = 460.0;
const LEFT: f64 = 40.0;
const RIGHT: f64 = 10.0;
const TOP: f64 = 8.0;
const BELOW: f64 = 34.0;
/// The plot is no higher than this (points), or it would not fit on a page.
const HIGHEST: f64 = 480.0;
const LOWEST: f64 = 70.0;
const NARROWEST: f64 = 150.0;

impl Drawing {
    /// All places that must be seen.
    fn extent(&self) -> Vec<Point> {
        let mut points = Vec::new();
        points.extend(self.segments.iter().flat_map(|(a, b)| [*a, *b]));
        for (c, r) in &self.circles {
            points.extend([Point { x: c.x - r, y: c.y - r }, Point { x: c.x + r, y: c.y + r }]);
        }
        points.extend(self.polygons.iter().flatten());
        points.extend(self.regions.iter().flat_map(|region| &region.corners));
        points
    }

    fn draw(&self, picture: &mut Picture, frame: &Frame) {
        let outline = |corners: &[Point]| corners.iter().map(|p| frame.at(p.x, p.y)).collect::<Vec<_>>();
        for region in &self.regions {
            let pen = Pen::new(Colour::hex(0x8aa05a), 0.6).dashed(3.0, 2.0);
            picture.polygon(outline(&region.corners), Some(GROUND), Some(pen));
        }
        for polygon in &self.polygons {
            picture.polygon(outline(polygon), Some(THING), Some(Pen::new(INK, 0.9)));
        }
        for (centre, radius) in &self.circles {
            let radius = frame.at_x(centre.x + radius) - frame.at_x(centre.x);
            picture.circle(frame.at(centre.x, centre.y), radius, Some(THING), Some(Pen::new(INK, 0.9)));
        }
        for (a, b) in &self.segments {
            picture.line(vec![frame.at(a.x, a.y), frame.at(b.x, b.y)], WALL);
        }
    }

    /// The names, to be drawn above everything else.
    fn names(&self, picture: &mut Picture, frame: &Frame) {
        for region in self.regions.iter().filter(|region| !region.corners.is_empty()) {
            let n = region.corners.len() as f64;
            let x = region.corners.iter().map(|p| p.x).sum::<f64>() / n;
            let top = region.corners.iter().map(|p| frame.at_y(p.y)).fold(f64::INFINITY, f64::min);
            name(picture, [frame.at_x(x), top + 9.0], &region.name, Colour::hex(0x5b6e33));
        }
        for (at, text) in &self.labels {
            let [x, y] = frame.at(at.x, at.y);
            name(picture, [x, y + 2.7], text, INK);
        }
    }
}

fn name(picture: &mut Picture, at: [f64; 2], text: &str, colour: Colour) {
    let (text, anchor) = (text.to_owned(), Anchor::Middle);
    picture.label(Label { at, text, size: 7.5, anchor, colour, upright: false, rim: true });
}

/// A figure of the ground: key above, events below, `data` on the drawing between them.
///
/// `seen` are further places that must be in the plot; `data` draws what moved and was measured.
pub(super) fn plane(
    drawing: &Drawing,
    seen: impl Iterator<Item = Point>,
    key: &Key,
    events: &EventKey<'_>,
    data: impl FnOnce(&mut Picture, &Frame),
) -> Picture {
    let mut all = drawing.extent();
    all.extend(seen.filter(|p| p.x.is_finite() && p.y.is_finite()));
    let (x, y) = (around(all.iter().map(|p| p.x)), around(all.iter().map(|p| p.y)));

    let room = WIDTH - LEFT - RIGHT;
    let per_metre = (room / (x.1 - x.0)).min(HIGHEST / (y.1 - y.0));
    let height = ((y.1 - y.0) * per_metre).max(LOWEST);
    let width = ((x.1 - x.0) * per_metre).clamp(NARROWEST, room);
    // What is left over in a high or flat plot is more ground, so that the scales stay equal.
    let (x, y) = (widened(x, width / per_metre), widened(y, height / per_metre));

    let top = TOP + key.height(room);
    let left = LEFT + (room - width) / 2.0;
    let area = [left, top, left + width, top + height];
    let frame = Frame { area, x: Scale::linear(x.0, x.1), y: Scale::linear(y.0, y.1) };
    let mut picture = Picture::new(WIDTH, top + height + BELOW + events.height(room));
    key.draw(&mut picture, [LEFT, TOP - 3.0], room);

    // The same ticks on both axes: a square of the grid is a square of the ground.
    let x_ticks = frame.x.ticks((width / 45.0) as usize);
    let step = if let [a, b, ..] = x_ticks[..] { b - a } else { 1.0 };
    let (first, last) = (libm::ceil(y.0 / step) as i64, libm::floor(y.1 / step) as i64);
    let y_ticks: Vec<f64> = (first..=last).map(|i| i as f64 * step).collect();

    picture.clip(Some(area));
    frame.grid(&mut picture, &x_ticks, &y_ticks);
    drawing.draw(&mut picture, &frame);
    data(&mut picture, &frame);
    drawing.names(&mut picture, &frame);
    picture.clip(None);
    frame.border(&mut picture);
    frame.x_axis(&mut picture, &labelled(&x_ticks), "x (m)");
    let y_labels: Vec<(f64, String)> = y_ticks.iter().map(|tick| (*tick, number(*tick, step))).collect();
    let widest = y_labels.iter().map(|(_, text)| font::width(text, SMALL)).fold(0.0, f64::max);
    frame.y_axis(&mut picture, &y_labels, "y (m)", widest + 11.0);
    events.draw(&mut picture, [LEFT, top + height + BELOW - 1.0], room);
    picture
}

/// Least and greatest value with a margin.
fn around(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (min, max) = bounds(values).unwrap_or((-1.0, 1.0));
    let margin = ((max - min) * 0.03).max(0.15);
    (min - margin, max + margin)
}

/// The span made at least `width` wide, around its middle.
fn widened((min, max): (f64, f64), width: f64) -> (f64, f64) {
    let more = ((width - (max - min)) / 2.0).max(0.0);
    (min - more, max + more)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_metre_is_as_long_upwards_as_to_the_side() {
        for (w, h) in [(10.0, 4.0), (2.0, 30.0), (0.0, 0.0), (40.0, 0.1)] {
            let corners = [Point { x: 0.0, y: 0.0 }, Point { x: w, y: h }];
            let mut scales = (0.0, 0.0);
            let picture = plane(
                &Drawing::default(),
                corners.into_iter(),
                &Key::default(),
                &EventKey(&[]),
                |_, frame| {
                    scales = (frame.at_x(1.0) - frame.at_x(0.0), frame.at_y(0.0) - frame.at_y(1.0));
                },
            );
            assert!((scales.0 - scales.1).abs() < 1e-9, "{scales:?}");
            assert!(picture.size().1 < 560.0);
        }
    }
}
