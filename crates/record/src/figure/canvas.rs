//! What a figure is made of: a few plain shapes, in points (1/72 inch) from the upper left corner.

use super::raster::{self, RasterError};
use super::svg;

/// A colour with its opacity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Colour {
    /// Red.
    pub r: u8,
    /// Green.
    pub g: u8,
    /// Blue.
    pub b: u8,
    /// 255 covers all, 0 nothing.
    pub a: u8,
}

impl Colour {
    /// Opaque `0xrrggbb`.
    pub const fn hex(rgb: u32) -> Colour {
        Colour { r: (rgb >> 16) as u8, g: (rgb >> 8) as u8, b: rgb as u8, a: 255 }
    }

    /// The same with another opacity, from 0 to 1.
    pub fn faint(self, opacity: f64) -> Colour {
        Colour { a: (opacity * 255.0) as u8, ..self }
    }

    /// Colour `i` for things to be told apart: those of Okabe and Ito ("Color Universal Design", 2008), without the yellow,
    /// which is too light for a line on white; then three of Tol's "muted" scheme ("Colour Schemes", SRON/EPS/TN/09-002).
    /// Behind them they begin again.
    pub fn of(i: usize) -> Colour {
        Colour::hex(PALETTE[i % PALETTE.len()])
    }
}

pub(super) const PALETTE: [u32; 10] =
    [0x0072b2, 0xd55e00, 0x009e73, 0xcc79a7, 0xe69f00, 0x56b4e9, 0x666666, 0x332288, 0x882255, 0x999933];
pub(super) const INK: Colour = Colour::hex(0x222222);
pub(super) const WHITE: Colour = Colour::hex(0xffffff);
pub(super) const GRID: Colour = Colour::hex(0xe4e4e4);
pub(super) const ALARM: Colour = Colour::hex(0xd55e00);

/// How a line is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pen {
    pub colour: Colour,
    pub width: f64,
    /// Length of a dash and of a gap; both zero for a whole line.
    pub dash: [f64; 2],
}

impl Pen {
    pub(super) const fn new(colour: Colour, width: f64) -> Pen {
        Pen { colour, width, dash: [0.0; 2] }
    }

    pub(super) const fn dashed(self, dash: f64, gap: f64) -> Pen {
        Pen { dash: [dash, gap], ..self }
    }
}

/// Which part of a text stands at its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// A row of letters.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Label {
    /// Where the anchor's end of the base line is.
    pub at: [f64; 2],
    pub text: String,
    pub size: f64,
    pub anchor: Anchor,
    pub colour: Colour,
    /// Read from below.
    pub upright: bool,
    /// With a white rim, to be read on top of lines.
    pub rim: bool,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Item {
    Path {
        points: Vec<[f64; 2]>,
        closed: bool,
        fill: Option<Colour>,
        pen: Option<Pen>,
    },
    Circle {
        at: [f64; 2],
        radius: f64,
        fill: Option<Colour>,
        pen: Option<Pen>,
    },
    /// Many dots of one colour, which do not grow darker where they cover each other.
    Dots {
        at: Vec<[f64; 2]>,
        radius: f64,
        colour: Colour,
    },
    Label(Label),
    /// What follows is seen only inside this box (left, top, right, bottom); nothing ends it.
    Clip(Option<[f64; 4]>),
}

/// A finished figure.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    pub(super) width: f64,
    pub(super) height: f64,
    pub(super) items: Vec<Item>,
}

impl Picture {
    pub(super) fn new(width: f64, height: f64) -> Picture {
        Picture { width, height, items: Vec::new() }
    }

    /// Width and height (points of 1/72 inch).
    pub fn size(&self) -> (f64, f64) {
        (self.width, self.height)
    }

    /// The text of an SVG file.
    pub fn svg(&self) -> String {
        svg::write(self)
    }

    /// The bytes of a PNG file with `dots_per_inch`; 220 serves print as well as screens.
    pub fn png(&self, dots_per_inch: f64) -> Result<Vec<u8>, RasterError> {
        raster::write(self, dots_per_inch)
    }

    /// What is no number stands nowhere: such points are left out. So are points that are too near to the one before to be
    /// told from it, which are most of a long run.
    pub(super) fn line(&mut self, mut points: Vec<[f64; 2]>, pen: Pen) {
        points.retain(|[x, y]| x.is_finite() && y.is_finite());
        let end = points.last().copied();
        let mut kept = [f64::INFINITY; 2];
        points.retain(|point| {
            let far = libm::hypot(point[0] - kept[0], point[1] - kept[1]) > 0.1;
            kept = if far { *point } else { kept };
            far
        });
        points.extend(end.filter(|end| points.last() != Some(end)));
        self.items.push(Item::Path { points, closed: false, fill: None, pen: Some(pen) });
    }

    pub(super) fn polygon(&mut self, mut points: Vec<[f64; 2]>, fill: Option<Colour>, pen: Option<Pen>) {
        points.retain(|[x, y]| x.is_finite() && y.is_finite());
        self.items.push(Item::Path { points, closed: true, fill, pen });
    }

    /// A box from its left upper to its right lower corner.
    pub(super) fn rectangle(&mut self, [l, t, r, b]: [f64; 4], fill: Option<Colour>, pen: Option<Pen>) {
        self.polygon(vec![[l, t], [r, t], [r, b], [l, b]], fill, pen);
    }

    pub(super) fn circle(&mut self, at: [f64; 2], radius: f64, fill: Option<Colour>, pen: Option<Pen>) {
        if at.iter().chain([&radius]).all(|number| number.is_finite()) {
            self.items.push(Item::Circle { at, radius, fill, pen });
        }
    }

    pub(super) fn dots(&mut self, mut at: Vec<[f64; 2]>, radius: f64, colour: Colour) {
        at.retain(|[x, y]| x.is_finite() && y.is_finite());
        self.items.push(Item::Dots { at, radius, colour });
    }

    pub(super) fn clip(&mut self, to: Option<[f64; 4]>) {
        self.items.push(Item::Clip(to));
    }

    pub(super) fn text(&mut self, at: [f64; 2], text: impl Into<String>, size: f64, anchor: Anchor) {
        let text = text.into();
        self.label(Label { at, text, size, anchor, colour: INK, upright: false, rim: false });
    }

    pub(super) fn label(&mut self, label: Label) {
        if label.at.iter().all(|number| number.is_finite()) {
            self.items.push(Item::Label(label));
        }
    }
}
