//! A potential over cells, and the ways that go down in it.

use super::canvas::{Anchor, Colour, INK, Pen, Picture, WHITE};

/// Panels beside each other with one scale of colours.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Potential {
    /// From left to right.
    pub panels: Vec<PotentialPanel>,
    /// What the potential is, with its unit.
    pub unit: String,
}

/// One potential with its way.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PotentialPanel {
    /// What it shows.
    pub title: String,
    /// Columns of cells.
    pub columns: usize,
    /// The potential of each cell, row by row from the top; no number where none is known.
    pub values: Vec<f64>,
    /// Which cells nothing can go to; as many.
    pub closed: Vec<bool>,
    /// The way by the columns and rows of its cells, from its start on.
    pub way: Vec<(u32, u32)>,
}

/// Width of the figure, what stands around and between the panels, and the height of the scale (points).
const WIDTH: f64 = 520.0;
const EDGE: f64 = 10.0;
const GAP: f64 = 14.0;
const TITLE: f64 = 16.0;
const SCALE: f64 = 34.0;
/// Panels are no higher (points).
const HIGHEST: f64 = 420.0;
/// So many bands of equal potential from the least to the greatest.
const BANDS: usize = 24;
const CLOSED: Colour = Colour::hex(0x3b3b3b);
const UNKNOWN: Colour = Colour::hex(0xf2f2f2);
/// From low to high, dark to light, also for the colour-blind: "viridis" of matplotlib (van der Walt and Smith 2015) at eight places.
const COLOURS: [u32; 8] = [0x440154, 0x46327e, 0x365c8d, 0x277f8e, 0x1fa187, 0x4ac16d, 0xa0da39, 0xfde725];
const WAY: Colour = Colour::hex(0xd55e00);

impl Potential {
    /// Draws it.
    pub fn draw(&self) -> Picture {
        let count = self.panels.len().max(1) as f64;
        let width = (WIDTH - 2.0 * EDGE - (count - 1.0) * GAP) / count;
        let high = |panel: &PotentialPanel| width / panel.columns.max(1) as f64 * panel.rows() as f64;
        let tallest = self.panels.iter().map(high).fold(1.0, f64::max);
        let shrink = (HIGHEST / tallest).min(1.0);
        let mut picture = Picture::new(WIDTH, TITLE + tallest * shrink + SCALE + 2.0 * EDGE);
        let greatest = self.greatest();
        for (i, panel) in self.panels.iter().enumerate() {
            let left = EDGE + i as f64 * (width + GAP) + width * (1.0 - shrink) / 2.0;
            let side = width * shrink / panel.columns.max(1) as f64;
            panel.draw(&mut picture, [left, EDGE + TITLE], side, greatest);
        }
        self.scale(&mut picture, EDGE + TITLE + tallest * shrink + 10.0, greatest);
        picture
    }

    /// The greatest potential of all panels.
    fn greatest(&self) -> f64 {
        let values = self.panels.iter().flat_map(|panel| &panel.values);
        values.copied().filter(|value| value.is_finite()).fold(1.0, f64::max)
    }

    /// The colours from nothing to the greatest, and what stands for what.
    fn scale(&self, picture: &mut Picture, top: f64, greatest: f64) {
        let (left, width) = (EDGE + 4.0, 200.0);
        let step = width / BANDS as f64;
        for band in 0..BANDS {
            let at = left + band as f64 * step;
            picture.rectangle([at, top, at + step + 0.3, top + 8.0], Some(colour(band)), None);
        }
        picture.rectangle([left, top, left + width, top + 8.0], None, Some(Pen::new(INK, 0.5)));
        for share in [0.0, 0.5, 1.0] {
            let text = format!("{:.0}", greatest * share);
            picture.text([left + width * share, top + 17.0], text, 7.5, Anchor::Middle);
        }
        picture.text([left + width + 14.0, top + 17.0], &self.unit, 7.5, Anchor::Start);
        let mut at = left + width + 14.0;
        for (fill, name) in [(CLOSED, "closed"), (UNKNOWN, "not reached")] {
            picture.rectangle([at, top, at + 8.0, top + 8.0], Some(fill), Some(Pen::new(INK, 0.4)));
            picture.text([at + 11.0, top + 7.0], name, 7.5, Anchor::Start);
            at += 62.0;
        }
        picture.line(vec![[at, top + 4.0], [at + 14.0, top + 4.0]], Pen::new(WAY, 1.6));
        picture.text([at + 18.0, top + 7.0], "way, from the ring to the dot", 7.5, Anchor::Start);
    }
}

impl PotentialPanel {
    fn rows(&self) -> usize {
        self.values.len() / self.columns.max(1)
    }

    fn draw(&self, picture: &mut Picture, [left, top]: [f64; 2], side: f64, greatest: f64) {
        let (width, height) = (self.columns as f64 * side, self.rows() as f64 * side);
        picture.text([left, top - 5.0], &self.title, 9.0, Anchor::Start);
        picture.rectangle([left, top, left + width, top + height], Some(UNKNOWN), None);
        for y in 0..self.rows() {
            self.row(picture, [left, top], side, y, greatest);
        }
        picture.rectangle([left, top, left + width, top + height], None, Some(Pen::new(INK, 0.6)));
        let at = |(x, y): (u32, u32)| [left + (f64::from(x) + 0.5) * side, top + (f64::from(y) + 0.5) * side];
        let line: Vec<[f64; 2]> = self.way.iter().copied().map(at).collect();
        picture.line(line.clone(), Pen::new(WHITE, 3.0));
        picture.line(line, Pen::new(WAY, 1.6));
        if let (Some(start), Some(goal)) = (self.way.first(), self.way.last()) {
            picture.circle(at(*start), 3.2, Some(WHITE), Some(Pen::new(WAY, 1.6)));
            picture.circle(at(*goal), 3.2, Some(WAY), Some(Pen::new(WHITE, 1.0)));
        }
    }

    /// The cells of a row, as many at once as have one colour. Each box reaches a little under the next ones, so that no ground is seen between them.
    fn row(&self, picture: &mut Picture, [left, top]: [f64; 2], side: f64, y: usize, greatest: f64) {
        let fill = |x: usize| {
            let i = y * self.columns + x;
            let value = self.values[i];
            match self.closed.get(i) {
                Some(true) => Some(CLOSED),
                _ if value.is_finite() => {
                    Some(colour(((value / greatest * BANDS as f64) as usize).min(BANDS - 1)))
                }
                _ => None,
            }
        };
        let mut x = 0;
        while x < self.columns {
            let from = x;
            let colour = fill(from);
            while x < self.columns && fill(x) == colour {
                x += 1;
            }
            if colour.is_some() {
                let end = |at: usize| left + at as f64 * side;
                let (over, under) = (top + y as f64 * side, top + (y + 1) as f64 * side);
                let (more_right, more_below) =
                    (if x < self.columns { 0.25 } else { 0.0 }, if y + 1 < self.rows() { 0.25 } else { 0.0 });
                picture.rectangle([end(from), over, end(x) + more_right, under + more_below], colour, None);
            }
        }
    }
}

/// The colour of a band. Every second one is a little darker, so that the lines between them are seen.
fn colour(band: usize) -> Colour {
    let at = band.min(BANDS - 1) as f64 / (BANDS - 1) as f64 * (COLOURS.len() - 1) as f64;
    let (low, share) =
        ((at as usize).min(COLOURS.len() - 2), at - (at as usize).min(COLOURS.len() - 2) as f64);
    let (a, b) = (Colour::hex(COLOURS[low]), Colour::hex(COLOURS[low + 1]));
    let dim = if band % 2 == 1 { 0.86 } else { 1.0 };
    let mixed = |a: u8, b: u8| ((f64::from(a) * (1.0 - share) + f64::from(b) * share) * dim) as u8;
    Colour { r: mixed(a.r, b.r), g: mixed(a.g, b.g), b: mixed(a.b, b.b), a: 255 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_of_one_colour_are_one_box_and_what_is_not_reached_is_none() {
        let panel = PotentialPanel {
            columns: 4,
            values: vec![0.0, 0.0, f64::NAN, f64::NAN, 9.0, 9.0, 9.0, f64::NAN],
            closed: vec![false, false, false, true, false, false, false, false],
            way: vec![(2, 1), (1, 0)],
            ..PotentialPanel::default()
        };
        let figure = |panels: Vec<PotentialPanel>| Potential { panels, ..Potential::default() }.draw().svg();
        let count = |svg: &str, colour: Colour| {
            svg.matches(&format!("#{:02x}{:02x}{:02x}", colour.r, colour.g, colour.b)).count()
        };
        let (with, without) = (figure(vec![panel]), figure(vec![]));
        let more = |colour: Colour| count(&with, colour) - count(&without, colour);
        assert_eq!((more(colour(0)), more(CLOSED), more(colour(BANDS - 1))), (1, 1, 1));
        // Its rim is white, two lines and two circles.
        assert_eq!(more(WAY), 3);
    }

    #[test]
    fn lighter_is_higher() {
        let light = |band: usize| {
            let Colour { r, g, b, .. } = colour(band);
            0.3 * f64::from(r) + 0.59 * f64::from(g) + 0.11 * f64::from(b)
        };
        let even: Vec<f64> = (0..BANDS).step_by(2).map(light).collect();
        assert!(even.is_sorted(), "{even:?}");
    }
}
