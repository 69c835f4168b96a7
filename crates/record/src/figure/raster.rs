//! A figure as PNG.

use tiny_skia::{
    FillRule, LineCap, LineJoin, Mask, Paint, Path, PathBuilder, Pixmap, Rect, Stroke, StrokeDash, Transform,
};

use super::canvas::{Anchor, Colour, Item, Label, Pen, Picture, WHITE};
use super::font;

/// Why a figure cannot be made a picture of dots.
#[derive(Debug, thiserror::Error)]
pub enum RasterError {
    /// It would have no dots, or too many for the memory.
    #[error("a figure of {width} × {height} dots cannot be drawn")]
    Size {
        /// Dots from left to right.
        width: f64,
        /// Dots from top to bottom.
        height: f64,
    },
    /// The packer refused it.
    #[error("the figure cannot be packed: {0}")]
    Png(#[from] png::EncodingError),
}

/// More dots than this are a mistake: a page at 1200 dots per inch.
const MOST_DOTS: f64 = 1.5e8;

pub(super) fn write(picture: &Picture, dots_per_inch: f64) -> Result<Vec<u8>, RasterError> {
    let scale = dots_per_inch / 72.0;
    let (width, height) = (libm::ceil(picture.width * scale), libm::ceil(picture.height * scale));
    let wrong = || RasterError::Size { width, height };
    if !(width >= 1.0 && height >= 1.0 && width * height <= MOST_DOTS) {
        return Err(wrong());
    }
    let pixels = Pixmap::new(width as u32, height as u32).ok_or_else(wrong)?;
    let mut easel = Easel { pixels, mask: None, scale: Transform::from_scale(scale as f32, scale as f32) };
    easel.pixels.fill(tiny_skia::Color::WHITE);
    for item in &picture.items {
        easel.draw(item);
    }
    let opaque: Vec<u8> =
        easel.pixels.data().chunks_exact(4).flat_map(|rgba| [rgba[0], rgba[1], rgba[2]]).collect();
    let compression = png::Compression::Balanced;
    Ok(crate::picture::encode(width as u32, height as u32, png::ColorType::Rgb, compression, &opaque)?)
}

struct Easel {
    pixels: Pixmap,
    mask: Option<Mask>,
    scale: Transform,
}

impl Easel {
    fn draw(&mut self, item: &Item) {
        match item {
            Item::Path { points, closed, fill, pen } => {
                if let Some(path) = polyline(points, *closed) {
                    self.shape(&path, *fill, *pen);
                }
            }
            Item::Circle { at: [x, y], radius, fill, pen } => {
                if let Some(path) = PathBuilder::from_circle(*x as f32, *y as f32, *radius as f32) {
                    self.shape(&path, *fill, *pen);
                }
            }
            Item::Dots { at, radius, colour } => {
                let mut path = PathBuilder::new();
                for [x, y] in at {
                    path.push_circle(*x as f32, *y as f32, *radius as f32);
                }
                if let Some(path) = path.finish() {
                    self.shape(&path, Some(*colour), None);
                }
            }
            Item::Label(label) => self.label(label),
            Item::Clip(to) => self.mask = to.and_then(|to| self.masked(to)),
        }
    }

    fn masked(&self, [l, t, r, b]: [f64; 4]) -> Option<Mask> {
        let mut mask = Mask::new(self.pixels.width(), self.pixels.height())?;
        let rect = Rect::from_ltrb(l as f32, t as f32, r as f32, b as f32)?;
        mask.fill_path(&PathBuilder::from_rect(rect), FillRule::Winding, true, self.scale);
        Some(mask)
    }

    fn shape(&mut self, path: &Path, fill: Option<Colour>, pen: Option<Pen>) {
        if let Some(colour) = fill {
            self.pixels.fill_path(path, &paint(colour), FillRule::Winding, self.scale, self.mask.as_ref());
        }
        if let Some(pen) = pen {
            let dash = (pen.dash != [0.0; 2])
                .then(|| StrokeDash::new(vec![pen.dash[0] as f32, pen.dash[1] as f32], 0.0))
                .flatten();
            let stroke = Stroke {
                width: pen.width as f32,
                line_join: LineJoin::Round,
                line_cap: LineCap::Butt,
                dash,
                ..Stroke::default()
            };
            self.pixels.stroke_path(path, &paint(pen.colour), &stroke, self.scale, self.mask.as_ref());
        }
    }

    fn label(&mut self, label: &Label) {
        let shift = match label.anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => -font::width(&label.text, label.size) / 2.0,
            Anchor::End => -font::width(&label.text, label.size),
        };
        let mut place = Transform::from_translate(label.at[0] as f32, label.at[1] as f32);
        if label.upright {
            place = place.pre_rotate(-90.0);
        }
        let placed = font::outline(&label.text, label.size)
            .and_then(|path| path.transform(place.pre_translate(shift as f32, 0.0)));
        if let Some(path) = placed {
            if label.rim {
                self.shape(&path, None, Some(Pen::new(WHITE, 2.0)));
            }
            self.shape(&path, Some(label.colour), None);
        }
    }
}

fn polyline(points: &[[f64; 2]], closed: bool) -> Option<Path> {
    let mut path = PathBuilder::new();
    for (i, [x, y]) in points.iter().enumerate() {
        if i == 0 { path.move_to(*x as f32, *y as f32) } else { path.line_to(*x as f32, *y as f32) }
    }
    if closed {
        path.close();
    }
    path.finish()
}

fn paint(Colour { r, g, b, a }: Colour) -> Paint<'static> {
    let mut paint = Paint { anti_alias: true, ..Paint::default() };
    paint.set_color_rgba8(r, g, b, a);
    paint
}
