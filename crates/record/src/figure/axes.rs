//! Axes: from values to places, with ticks where people expect them.

use super::canvas::{Anchor, GRID, INK, Label, Pen, Picture};

/// Height of the letters at ticks (points).
pub(super) const SMALL: f64 = 7.5;
/// Height of the letters that name an axis (points).
pub(super) const NORMAL: f64 = 8.5;

/// The values of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Scale {
    pub min: f64,
    pub max: f64,
    pub log: bool,
}

impl Scale {
    pub(super) fn linear(min: f64, max: f64) -> Scale {
        Scale { min, max, log: false }
    }

    /// Around all finite values with a margin, at least `least` wide: the figure of a robot that stands still shows a flat
    /// line, not the noise in its last digit.
    pub(super) fn around(values: impl Iterator<Item = f64>, margin: f64, least: f64) -> Scale {
        let (min, max) = bounds(values).unwrap_or((0.0, 1.0));
        let more = ((least - (max - min)) / 2.0).max(0.0);
        let (min, max) = (min - more, max + more);
        Scale::linear(min - (max - min) * margin, max + (max - min) * margin)
    }

    /// Where a value stands between the ends, 0 to 1.
    pub(super) fn place(&self, value: f64) -> f64 {
        if self.log {
            libm::log10(value / self.min) / libm::log10(self.max / self.min)
        } else {
            (value - self.min) / (self.max - self.min)
        }
    }

    /// The values of about `count` ticks at round numbers.
    pub(super) fn ticks(&self, count: usize) -> Vec<f64> {
        if self.log {
            let first = libm::ceil(libm::log10(self.min) - 1e-9) as i32;
            let last = libm::floor(libm::log10(self.max) + 1e-9) as i32;
            return (first..=last).map(|power| libm::pow(10.0, f64::from(power))).collect();
        }
        let step = round_step((self.max - self.min) / count.max(1) as f64);
        let first = libm::ceil(self.min / step - 1e-9) as i64;
        let last = libm::floor(self.max / step + 1e-9) as i64;
        (first..=last).map(|i| i as f64 * step).collect()
    }
}

/// Least and greatest of the finite values.
pub(super) fn bounds(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.filter(|value| value.is_finite()).fold(None, |so_far, value| match so_far {
        None => Some((value, value)),
        Some((min, max)) => Some((min.min(value), max.max(value))),
    })
}

/// The least of 1, 2, 5 times a power of ten that is at least `step`.
fn round_step(step: f64) -> f64 {
    let power = libm::pow(10.0, libm::floor(libm::log10(step)));
    [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|n| n * power)
        .find(|round| *round >= step * (1.0 - 1e-9))
        .unwrap_or(step)
}

/// A number at a tick: the digits that the step between ticks needs, with a true minus.
pub(super) fn number(value: f64, step: f64) -> String {
    let decimals = (-libm::floor(libm::log10(step) + 1e-9)).clamp(0.0, 9.0) as usize;
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(digits) if digits.chars().all(|c| matches!(c, '0' | '.')) => digits.to_owned(),
        Some(digits) => format!("−{digits}"),
        None => text,
    }
}

/// A span of time with the unit that suits it: `20 µs`.
pub(super) fn seconds(value: f64) -> String {
    for (unit, scale) in [("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)] {
        if value >= scale * 0.9995 {
            return format!("{} {unit}", digits(value / scale));
        }
    }
    format!("{} ns", digits(value / 1e-9))
}

/// Three digits at most.
fn digits(value: f64) -> String {
    let text = if value >= 99.95 {
        format!("{value:.0}")
    } else if value >= 9.995 {
        format!("{value:.1}")
    } else {
        format!("{value:.2}")
    };
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

/// The box of a plot and its two axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    /// Left, top, right, bottom (points).
    pub area: [f64; 4],
    pub x: Scale,
    pub y: Scale,
}

impl Frame {
    /// Where a value stands on the page.
    pub(super) fn at(&self, x: f64, y: f64) -> [f64; 2] {
        [self.at_x(x), self.at_y(y)]
    }

    pub(super) fn at_x(&self, x: f64) -> f64 {
        let [left, _, right, _] = self.area;
        left + (right - left) * self.x.place(x)
    }

    pub(super) fn at_y(&self, y: f64) -> f64 {
        let [_, top, _, bottom] = self.area;
        bottom - (bottom - top) * self.y.place(y)
    }

    /// The thin lines behind the data, at the ticks.
    pub(super) fn grid(&self, picture: &mut Picture, x_ticks: &[f64], y_ticks: &[f64]) {
        let [left, top, right, bottom] = self.area;
        let pen = Pen::new(GRID, 0.5);
        for x in x_ticks.iter().map(|x| self.at_x(*x)) {
            picture.line(vec![[x, top], [x, bottom]], pen);
        }
        for y in y_ticks.iter().map(|y| self.at_y(*y)) {
            picture.line(vec![[left, y], [right, y]], pen);
        }
    }

    /// The box around the data.
    pub(super) fn border(&self, picture: &mut Picture) {
        picture.rectangle(self.area, None, Some(Pen::new(INK, 0.7)));
    }

    /// The ticks below with their texts.
    pub(super) fn x_axis(&self, picture: &mut Picture, ticks: &[(f64, String)], name: &str) {
        let [left, _, right, bottom] = self.area;
        for (value, text) in ticks {
            let x = self.at_x(*value);
            picture.line(vec![[x, bottom], [x, bottom + 3.0]], Pen::new(INK, 0.7));
            picture.text([x, bottom + 4.5 + SMALL], text, SMALL, Anchor::Middle);
        }
        picture.text([(left + right) / 2.0, bottom + 9.0 + SMALL + NORMAL], name, NORMAL, Anchor::Middle);
    }

    /// The ticks at the left with their texts, and the name of the axis so far from it (points).
    pub(super) fn y_axis(&self, picture: &mut Picture, ticks: &[(f64, String)], name: &str, distance: f64) {
        let [left, top, _, bottom] = self.area;
        for (value, text) in ticks {
            let y = self.at_y(*value);
            picture.line(vec![[left, y], [left - 3.0, y]], Pen::new(INK, 0.7));
            picture.text([left - 5.0, y + SMALL * 0.36], text, SMALL, Anchor::End);
        }
        let at = [left - distance, (top + bottom) / 2.0];
        let (text, anchor) = (name.to_owned(), Anchor::Middle);
        picture.label(Label { at, text, size: NORMAL, anchor, colour: INK, upright: true, rim: false });
    }
}

/// Ticks of a linear axis with their texts.
pub(super) fn labelled(ticks: &[f64]) -> Vec<(f64, String)> {
    let step = if let [a, b, ..] = ticks { b - a } else { 1.0 };
    ticks.iter().map(|tick| (*tick, number(*tick, step))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_stand_at_round_numbers() {
        assert_eq!(Scale::linear(-0.3, 2.2).ticks(5), [0.0, 0.5, 1.0, 1.5, 2.0]);
        assert_eq!(Scale::linear(0.0, 300.0).ticks(6), [0.0, 50.0, 100.0, 150.0, 200.0, 250.0, 300.0]);
        let decades = Scale { min: 1e-6, max: 1e-3, log: true }.ticks(5);
        assert_eq!(decades.len(), 4);
        let texts: Vec<String> = labelled(&[-0.5, 0.0, 0.5]).into_iter().map(|(_, text)| text).collect();
        assert_eq!(texts, ["−0.5", "0.0", "0.5"]);
    }

    #[test]
    fn spans_of_time_have_the_unit_that_suits_them() {
        for (value, text) in
            [(1e-6, "1 µs"), (0.0005, "500 µs"), (1.234e-3, "1.23 ms"), (2.0, "2 s"), (5e-8, "50 ns")]
        {
            assert_eq!(seconds(value), text);
        }
    }

    #[test]
    fn a_flat_line_has_an_axis() {
        let scale = Scale::around([0.4, 0.4].into_iter(), 0.1, 0.2);
        assert!(scale.min < 0.31 && scale.max > 0.49);
        assert_eq!(Scale::around([f64::NAN].into_iter(), 0.0, 0.2), Scale::linear(0.0, 1.0));
    }
}
