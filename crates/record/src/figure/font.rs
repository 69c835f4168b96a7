//! The letters of a figure: a part of DejaVu Sans that is built in, so that a picture needs no font of the system.

use std::sync::OnceLock;

use tiny_skia::{Path, PathBuilder, Transform};
use ttf_parser::{Face, OutlineBuilder};

/// How other programs find the same or a like font.
pub(super) const FAMILY: &str = "DejaVu Sans, Bitstream Vera Sans, Verdana, Arial, sans-serif";

fn face() -> Option<&'static Face<'static>> {
    static FACE: OnceLock<Option<Face<'static>>> = OnceLock::new();
    FACE.get_or_init(|| Face::parse(include_bytes!("../../font/DejaVuSans.ttf"), 0).ok()).as_ref()
}

/// Width of a text (points) whose letters are `size` high.
pub(super) fn width(text: &str, size: f64) -> f64 {
    let Some(face) = face() else { return 0.0 };
    let units: f64 = text.chars().map(|c| advance(face, c)).sum();
    units * size / f64::from(face.units_per_em())
}

fn advance(face: &Face<'_>, c: char) -> f64 {
    let glyph = face.glyph_index(c).unwrap_or_default();
    f64::from(face.glyph_hor_advance(glyph).unwrap_or(0))
}

/// The outline of a text that begins at the origin, y downwards.
pub(super) fn outline(text: &str, size: f64) -> Option<Path> {
    let face = face()?;
    let scale = size as f32 / f32::from(face.units_per_em());
    let mut pen = Outline { path: PathBuilder::new(), x: 0.0 };
    for c in text.chars() {
        if let Some(glyph) = face.glyph_index(c) {
            face.outline_glyph(glyph, &mut pen);
        }
        pen.x += advance(face, c) as f32;
    }
    pen.path.finish()?.transform(Transform::from_scale(scale, -scale))
}

struct Outline {
    path: PathBuilder,
    x: f32,
}

impl OutlineBuilder for Outline {
    fn move_to(&mut self, x: f32, y: f32) {
        self.path.move_to(self.x + x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.path.line_to(self.x + x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.path.quad_to(self.x + x1, y1, self.x + x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.path.cubic_to(self.x + x1, y1, self.x + x2, y2, self.x + x, y);
    }

    fn close(&mut self) {
        self.path.close();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn widths_are_those_of_the_font() {
        // Advances of DejaVu Sans 2.37, in 1/2048 em: m 1995, i 569, space 651 (its hmtx table).
        assert_eq!(width("mi ", 2048.0), 1995.0 + 569.0 + 651.0);
    }

    #[test]
    fn every_sign_that_figures_use_is_there() {
        let face = face().unwrap();
        for c in "AZaz09äöüß°µπ·×−–²⁻≤≥→…()/.,:%".chars() {
            assert!(face.glyph_index(c).is_some(), "{c}");
        }
    }
}
