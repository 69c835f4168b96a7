//! When the steps of each agent were due and when they ran.

use super::axes::{Frame, SMALL, Scale, labelled};
use super::canvas::{ALARM, Anchor, Colour, GRID, INK, Pen, Picture};
use super::font;
use super::key::{Key, Sign};

/// The steps of an agent over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PeriodRow {
    /// The agent.
    pub name: String,
    /// When its steps were released (s).
    pub releases: Vec<f64>,
    /// When its steps began and ended (s).
    pub steps: Vec<(f64, f64)>,
    /// When a deadline was missed (s).
    pub misses: Vec<f64>,
}

/// The releases of all agents on one axis of time: periods can be seen to be kept, and to change.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Periods {
    /// The agents, the first on top.
    pub rows: Vec<PeriodRow>,
    /// The part of the time to be shown (s); all where it is nothing.
    pub window: Option<(f64, f64)>,
}

const WIDTH: f64 = 460.0;
const RIGHT: f64 = 12.0;
const ROW: f64 = 24.0;
const UNITS: [(f64, &str); 3] = [(1.0, "s"), (1e-3, "ms"), (1e-6, "µs")];

impl Periods {
    /// Draws it.
    pub fn draw(&self) -> Picture {
        let left =
            self.rows.iter().map(|row| font::width(&row.name, SMALL)).fold(30.0, f64::max).min(120.0) + 16.0;
        let key = self.key();
        let top = 8.0 + key.height(WIDTH - left - RIGHT);
        let bottom = top + ROW * self.rows.len().max(1) as f64 + 4.0;
        let mut picture = Picture::new(WIDTH, bottom + 34.0);
        key.draw(&mut picture, [left, 5.0], WIDTH - left - RIGHT);
        let area = [left, top, WIDTH - RIGHT, bottom];
        let frame = Frame { area, x: self.time(), y: Scale::linear(0.0, 1.0) };
        let ticks = frame.x.ticks(9);
        frame.grid(&mut picture, &ticks, &[]);
        for (i, row) in self.rows.iter().enumerate() {
            let base = top + ROW * (i + 1) as f64;
            picture.text([left - 7.0, base - 3.5], &row.name, SMALL, Anchor::End);
            picture.clip(Some(area));
            picture.line(vec![[left, base], [WIDTH - RIGHT, base]], Pen::new(GRID, 0.8));
            row.draw(&mut picture, &frame, base, Colour::of(i));
            picture.clip(None);
        }
        frame.border(&mut picture);
        // In the unit in which the ticks are numbers that people read.
        let length = frame.x.max - frame.x.min;
        let (scale, unit) =
            UNITS.into_iter().find(|(scale, _)| length >= 2.0 * scale).unwrap_or((1e-9, "ns"));
        let scaled: Vec<f64> = ticks.iter().map(|tick| tick / scale).collect();
        let texts = labelled(&scaled)
            .into_iter()
            .zip(&ticks)
            .map(|((_, text), tick)| (*tick, text))
            .collect::<Vec<_>>();
        frame.x_axis(&mut picture, &texts, &format!("time ({unit})"));
        picture
    }

    fn key(&self) -> Key {
        let mut key = Key::default();
        key.add(Sign::Tick(INK), "release");
        if self.rows.iter().any(|row| !row.steps.is_empty()) {
            key.add(Sign::Area(Colour::hex(0x888888).faint(0.6)), "step");
        }
        if self.rows.iter().any(|row| !row.misses.is_empty()) {
            key.add(Sign::Dot(ALARM), "deadline missed");
        }
        key
    }

    fn time(&self) -> Scale {
        if let Some((from, to)) = self.window.filter(|(from, to)| to > from) {
            return Scale::linear(from, to);
        }
        let releases = self.rows.iter().flat_map(|row| row.releases.iter().copied());
        let ends = self.rows.iter().flat_map(|row| row.steps.iter().map(|step| step.1));
        Scale::around(releases.chain(ends), 0.01, 1e-3)
    }
}

impl PeriodRow {
    fn draw(&self, picture: &mut Picture, frame: &Frame, base: f64, colour: Colour) {
        let [left, _, right, _] = frame.area;
        let seen = |time: f64| frame.at_x(time) >= left - 1.0 && frame.at_x(time) <= right + 1.0;
        for (from, to) in self.steps.iter().filter(|(from, to)| seen(*from) || seen(*to)) {
            // A short step is still seen.
            let (from, to) = (frame.at_x(*from), frame.at_x(*to).max(frame.at_x(*from) + 0.6));
            picture.rectangle([from, base - 9.0, to, base], Some(colour.faint(0.6)), None);
        }
        for release in self.releases.iter().filter(|release| seen(**release)) {
            let x = frame.at_x(*release);
            picture.line(vec![[x, base], [x, base - 14.0]], Pen::new(INK, 0.7));
        }
        for miss in self.misses.iter().filter(|miss| seen(**miss)) {
            picture.circle([frame.at_x(*miss), base - 17.0], 2.0, Some(ALARM), None);
        }
    }
}
