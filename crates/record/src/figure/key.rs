//! What stands around a figure to explain it: the key of its colours above, its numbered events below.

use super::Event;
use super::axes::SMALL;
use super::bands::hatch;
use super::canvas::{Anchor, Colour, INK, Pen, Picture, WHITE};
use super::font;

/// How an entry of the key looks in the figure.
#[derive(Clone, Copy, Debug)]
pub(super) enum Sign {
    Line(Pen),
    Area(Colour),
    Dot(Colour),
    /// A ring of a radius (points).
    Ring(Colour, f64),
    Start,
    Goal,
    Tick(Colour),
    Hatched,
}

/// Width of a sign and the gap behind it (points).
const SIGN: f64 = 15.0;
const GAP: f64 = 12.0;
const LINE: f64 = 12.5;

/// The places of texts of these widths that flow into lines, and how many lines there are.
fn flow(widths: &[f64], room: f64) -> (Vec<(f64, usize)>, usize) {
    let (mut x, mut line) = (0.0, 0);
    let places = widths
        .iter()
        .map(|width| {
            if x > 0.0 && x + width > room {
                (x, line) = (0.0, line + 1);
            }
            let place = (x, line);
            x += width + GAP;
            place
        })
        .collect();
    (places, if widths.is_empty() { 0 } else { line + 1 })
}

/// The key of a figure: its signs and what they stand for.
#[derive(Debug, Default)]
pub(super) struct Key {
    entries: Vec<(Sign, String)>,
}

impl Key {
    pub(super) fn add(&mut self, sign: Sign, text: impl Into<String>) {
        self.entries.push((sign, text.into()));
    }

    fn widths(&self) -> Vec<f64> {
        self.entries.iter().map(|(_, text)| SIGN + 4.0 + font::width(text, SMALL)).collect()
    }

    /// What it takes from the height of a figure that is `room` wide (points).
    pub(super) fn height(&self, room: f64) -> f64 {
        let (_, lines) = flow(&self.widths(), room);
        if lines == 0 { 0.0 } else { lines as f64 * LINE + 3.0 }
    }

    /// Draws it, its upper left corner at `at`.
    pub(super) fn draw(&self, picture: &mut Picture, at: [f64; 2], room: f64) {
        let (places, _) = flow(&self.widths(), room);
        for ((sign, text), (x, line)) in self.entries.iter().zip(places) {
            let (x, y) = (at[0] + x, at[1] + line as f64 * LINE + LINE / 2.0);
            draw_sign(*sign, picture, [x, y]);
            picture.text([x + SIGN + 4.0, y + SMALL * 0.36], text, SMALL, Anchor::Start);
        }
    }
}

fn draw_sign(sign: Sign, picture: &mut Picture, [x, y]: [f64; 2]) {
    let middle = [x + SIGN / 2.0, y];
    match sign {
        Sign::Line(pen) => picture.line(vec![[x, y], [x + SIGN, y]], pen),
        Sign::Area(colour) => {
            picture.rectangle([x + 1.5, y - 3.5, x + SIGN - 1.5, y + 3.5], Some(colour), None)
        }
        Sign::Dot(colour) => picture.circle(middle, 1.6, Some(colour), None),
        Sign::Ring(colour, radius) => picture.circle(middle, radius, None, Some(Pen::new(colour, 0.8))),
        Sign::Start => start(picture, middle, 0.0),
        Sign::Goal => goal(picture, middle),
        Sign::Tick(colour) => {
            picture.line(vec![[middle[0], y - 4.0], [middle[0], y + 4.0]], Pen::new(colour, 1.4))
        }
        Sign::Hatched => hatch(picture, [x + 1.5, y - 3.5, x + SIGN - 1.5, y + 3.5]),
    }
}

/// The mark of a start: a triangle that looks where the robot looked (rad, counter-clockwise from the right).
pub(super) fn start(picture: &mut Picture, [x, y]: [f64; 2], heading: f64) {
    let (s, c) = (libm::sin(heading), libm::cos(heading));
    let corners = [[-3.6, 4.2], [5.4, 0.0], [-3.6, -4.2]];
    let points = corners.map(|[ahead, left]| [x + c * ahead - s * left, y - s * ahead - c * left]);
    picture.polygon(points.to_vec(), Some(WHITE), Some(Pen::new(INK, 1.1)));
}

/// The mark of a goal: a cross in a square.
pub(super) fn goal(picture: &mut Picture, [x, y]: [f64; 2]) {
    let pen = Pen::new(INK, 1.1);
    picture.rectangle([x - 3.8, y - 3.8, x + 3.8, y + 3.8], Some(WHITE), Some(pen));
    picture.line(vec![[x - 3.8, y - 3.8], [x + 3.8, y + 3.8]], pen);
    picture.line(vec![[x - 3.8, y + 3.8], [x + 3.8, y - 3.8]], pen);
}

/// A number in a circle.
pub(super) fn numbered(picture: &mut Picture, [x, y]: [f64; 2], number: usize) {
    picture.circle([x, y], 5.2, Some(WHITE), Some(Pen::new(INK, 0.8)));
    picture.text([x, y + 2.3], number.to_string(), 6.5, Anchor::Middle);
}

/// The texts of events, to be set below a figure.
pub(super) struct EventKey<'a>(pub &'a [Event]);

impl EventKey<'_> {
    fn texts(&self) -> Vec<String> {
        let text = |event: &Event| match event.time.is_finite() {
            true => format!("{} ({:.1} s)", event.text, event.time),
            false => event.text.clone(),
        };
        self.0.iter().map(text).collect()
    }

    /// In one line as wide as each text is, in several as wide as the widest, so that they stand in columns.
    fn widths(&self, room: f64) -> Vec<f64> {
        let widths: Vec<f64> = self.texts().iter().map(|text| 15.0 + font::width(text, SMALL)).collect();
        let widest = widths.iter().copied().fold(0.0, f64::max);
        let (_, lines) = flow(&widths, room);
        if lines > 1 { vec![widest; widths.len()] } else { widths }
    }

    /// What it takes from the height of a figure that is `room` wide (points).
    pub(super) fn height(&self, room: f64) -> f64 {
        let (_, lines) = flow(&self.widths(room), room);
        if lines == 0 { 0.0 } else { lines as f64 * 14.0 + 4.0 }
    }

    /// Draws it, its upper left corner at `at`.
    pub(super) fn draw(&self, picture: &mut Picture, at: [f64; 2], room: f64) {
        let (places, _) = flow(&self.widths(room), room);
        for (i, (text, (x, line))) in self.texts().iter().zip(places).enumerate() {
            let (x, y) = (at[0] + x + 5.5, at[1] + line as f64 * 14.0 + 9.0);
            numbered(picture, [x, y], i + 1);
            picture.text([x + 9.0, y + SMALL * 0.36], text, SMALL, Anchor::Start);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_flows_into_lines_that_have_room() {
        let (places, lines) = flow(&[40.0, 40.0, 40.0, 200.0], 100.0);
        assert_eq!(places, [(0.0, 0), (52.0, 0), (0.0, 1), (0.0, 2)]);
        assert_eq!(lines, 3);
        assert_eq!(flow(&[], 100.0).1, 0);
    }
}
