//! A figure as SVG.

use std::fmt::Write as _;

use super::canvas::{Anchor, Colour, Item, Label, Pen, Picture};
use super::font::FAMILY;

/// A number with at most two decimals.
struct N(f64);

impl std::fmt::Display for N {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let text = format!("{:.2}", self.0);
        let short = text.trim_end_matches('0').trim_end_matches('.');
        f.write_str(if short == "-0" { "0" } else { short })
    }
}

pub(super) fn write(picture: &Picture) -> String {
    let (w, h) = (N(picture.width), N(picture.height));
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}pt\" height=\"{h}pt\" viewBox=\"0 0 {w} {h}\" \
         font-family=\"{FAMILY}\" stroke-linejoin=\"round\">\n<rect width=\"{w}\" height=\"{h}\" fill=\"#ffffff\"/>\n"
    );
    let mut clips = 0;
    let mut open = false;
    for item in &picture.items {
        if let Item::Clip(clip) = item {
            if std::mem::replace(&mut open, clip.is_some()) {
                out.push_str("</g>\n");
            }
            if let Some([l, t, r, b]) = clip {
                clips += 1;
                let (x, y, w, h) = (N(*l), N(*t), N(r - l), N(b - t));
                // Writing to a string cannot fail.
                let _ = writeln!(
                    out,
                    "<clipPath id=\"c{clips}\"><rect x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\"/></clipPath>\
                     <g clip-path=\"url(#c{clips})\">"
                );
            }
        } else {
            out.push_str(&element(item));
        }
    }
    out.push_str(if open { "</g>\n</svg>\n" } else { "</svg>\n" });
    out
}

fn element(item: &Item) -> String {
    match item {
        Item::Path { points, closed, fill, pen } => {
            let mut d = String::new();
            for (i, [x, y]) in points.iter().enumerate() {
                let _ = write!(d, "{}{} {}", if i == 0 { "M" } else { "L" }, N(*x), N(*y));
            }
            format!("<path d=\"{d}{}\"{}/>\n", if *closed { "Z" } else { "" }, style(*fill, *pen))
        }
        Item::Circle { at: [x, y], radius, fill, pen } => {
            format!(
                "<circle cx=\"{}\" cy=\"{}\" r=\"{}\"{}/>\n",
                N(*x),
                N(*y),
                N(*radius),
                style(*fill, *pen)
            )
        }
        // A line of no length with round ends is a dot, in a fifth of the letters of a circle.
        Item::Dots { at, radius, colour: of } => {
            let d: String = at.iter().map(|[x, y]| format!("M{} {}h0", N(*x), N(*y))).collect();
            let (stroke, width) = (colour("stroke", Some(*of)), N(radius * 2.0));
            format!(
                "<path d=\"{d}\" fill=\"none\"{stroke} stroke-width=\"{width}\" stroke-linecap=\"round\"/>\n"
            )
        }
        Item::Label(label) => text(label),
        Item::Clip(_) => String::new(),
    }
}

fn colour(name: &str, colour: Option<Colour>) -> String {
    match colour {
        None => format!(" {name}=\"none\""),
        Some(Colour { r, g, b, a: 255 }) => format!(" {name}=\"#{r:02x}{g:02x}{b:02x}\""),
        Some(Colour { r, g, b, a }) => {
            format!(" {name}=\"#{r:02x}{g:02x}{b:02x}\" {name}-opacity=\"{}\"", N(f64::from(a) / 255.0))
        }
    }
}

fn style(fill: Option<Colour>, pen: Option<Pen>) -> String {
    let mut out = colour("fill", fill);
    if let Some(pen) = pen {
        out += &colour("stroke", Some(pen.colour));
        let _ = write!(out, " stroke-width=\"{}\"", N(pen.width));
        if pen.dash != [0.0; 2] {
            let _ = write!(out, " stroke-dasharray=\"{} {}\"", N(pen.dash[0]), N(pen.dash[1]));
        }
    }
    out
}

fn text(label: &Label) -> String {
    let [x, y] = label.at;
    let anchor = match label.anchor {
        Anchor::Start => "",
        Anchor::Middle => " text-anchor=\"middle\"",
        Anchor::End => " text-anchor=\"end\"",
    };
    let turn =
        if label.upright { format!(" transform=\"rotate(-90 {} {})\"", N(x), N(y)) } else { String::new() };
    let fill = colour("fill", Some(label.colour));
    let size = N(label.size);
    let (x, y) = (N(x), N(y));
    let text = label.text.replace('&', "&amp;").replace('<', "&lt;");
    let element = |style: &str| {
        format!("<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\"{anchor}{turn}{style}>{text}</text>\n")
    };
    // The rim is a text of its own below the text: not every program knows `paint-order`.
    let rim = if label.rim {
        element(" fill=\"none\" stroke=\"#ffffff\" stroke-width=\"2\"")
    } else {
        String::new()
    };
    rim + &element(&fill)
}
