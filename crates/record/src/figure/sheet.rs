//! Many places on one sheet, small, side by side: what stands in each, and the way that was taken through it.

use types::geometry::Point;

use super::axes::SMALL;
use super::canvas::{ALARM, Anchor, Colour, INK, Pen, Picture};
use super::plane::Drawing;

/// A place with what happened in it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Panel {
    /// What stands below it.
    pub title: String,
    /// What stands in it.
    pub drawing: Drawing,
    /// The way that was taken (m).
    pub way: Vec<Point>,
    /// Whether it went wrong.
    pub alarm: bool,
}

/// All of them, to the same scale.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sheet {
    /// In the order in which they stand, row by row.
    pub panels: Vec<Panel>,
    /// How many stand in a row.
    pub columns: usize,
    /// The corner of least x and y that is seen of each, and the opposite one (m).
    pub window: (Point, Point),
}

/// Width of a panel with the room between two, and the height of its title (points).
const WIDTH: f64 = 46.0;
const GAP: f64 = 6.0;
const TITLE: f64 = 9.0;
const THING: Colour = Colour::hex(0x9a9a9a);

impl Sheet {
    /// The picture.
    pub fn draw(&self) -> Picture {
        let (low, high) = self.window;
        let scale = (WIDTH - GAP) / (high.x - low.x).max(1e-6);
        let height = (high.y - low.y) * scale;
        let columns = self.columns.max(1);
        let rows = self.panels.len().div_ceil(columns);
        let whole = (columns as f64 * WIDTH + GAP, rows as f64 * (height + TITLE + GAP) + GAP);
        let mut picture = Picture::new(whole.0, whole.1);
        for (i, panel) in self.panels.iter().enumerate() {
            let (column, row) = ((i % columns) as f64, (i / columns) as f64);
            let left = GAP + column * WIDTH;
            let bottom = GAP + row * (height + TITLE + GAP) + height;
            let at = |p: Point| [left + (p.x - low.x) * scale, bottom - (p.y - low.y) * scale];
            let edge = [left, bottom - height, left + WIDTH - GAP, bottom];
            picture.clip(Some(edge));
            for (centre, radius) in &panel.drawing.circles {
                picture.circle(at(*centre), radius * scale, Some(THING), None);
            }
            for (a, b) in &panel.drawing.segments {
                picture.line(vec![at(*a), at(*b)], Pen::new(INK, 0.5));
            }
            let colour = if panel.alarm { ALARM } else { Colour::of(0) };
            picture.line(panel.way.iter().map(|p| at(*p)).collect(), Pen::new(colour, 0.8));
            picture.clip(None);
            let rim = Pen::new(if panel.alarm { ALARM } else { Colour::hex(0xbbbbbb) }, 0.4);
            picture.rectangle(edge, None, Some(rim));
            let middle = [left + (WIDTH - GAP) / 2.0, bottom + TITLE - 2.0];
            picture.text(middle, panel.title.clone(), SMALL * 0.8, Anchor::Middle);
        }
        picture
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_stand_in_rows_and_a_way_runs_upwards() {
        let panel = Panel {
            title: "7".into(),
            way: vec![Point::new(1.0, 0.0), Point::new(1.0, 4.0)],
            ..Panel::default()
        };
        let sheet = Sheet {
            panels: vec![panel; 5],
            columns: 2,
            window: (Point::new(0.0, 0.0), Point::new(2.0, 4.0)),
        };
        let picture = sheet.draw();
        // Three rows of panels that are twice as high as wide.
        let (width, height) = picture.size();
        assert!((width - (2.0 * WIDTH + GAP)).abs() < 1e-9);
        assert!((height - (3.0 * (2.0 * (WIDTH - GAP) + TITLE + GAP) + GAP)).abs() < 1e-9);
        assert_eq!(picture.svg().matches(">7<").count(), 5);
        assert!(Sheet::default().draw().svg().starts_with("<"));
    }
}
