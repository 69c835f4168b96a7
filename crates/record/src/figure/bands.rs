//! How agents were run in several runs under the same load, one run above the other.

use super::axes::{Frame, NORMAL, SMALL, Scale, bounds, labelled};
use super::canvas::{ALARM, Anchor, Colour, GRID, INK, Label, Pen, Picture};
use super::font;
use super::key::{Key, Sign};

/// An agent over time: how often it ran of how often it wished to, and what it missed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BandRow {
    /// The agent.
    pub name: String,
    /// From this time on (s) this share of its nominal rate, from 0 to 1; in the order of time. Before the first it is not there.
    pub rate: Vec<(f64, f64)>,
    /// When a deadline was missed (s).
    pub misses: Vec<f64>,
    /// From when to when it was suspended (s).
    pub suspended: Vec<(f64, f64)>,
    /// A few words for the right margin, such as how many of its steps were useful.
    pub said: String,
}

/// The agents of one run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RateBand {
    /// What is special about the run.
    pub title: String,
    /// The agents, the first on top.
    pub rows: Vec<BandRow>,
}

/// A time in which something weighs on all runs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Span {
    /// Its start (s).
    pub from: f64,
    /// Its end (s).
    pub to: f64,
    /// What it is.
    pub label: String,
}

/// Runs under the same load on one axis of time: who gave way, who missed what, and who was put to rest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bands {
    /// The runs, the first on top.
    pub bands: Vec<RateBand>,
    /// What weighed on all of them, by time.
    pub spans: Vec<Span>,
    /// The part of the time to be shown (s); all where it is nothing.
    pub window: Option<(f64, f64)>,
}

const WIDTH: f64 = 460.0;
/// Least width of the margin at the right, and most of either margin (points).
const RIGHT: f64 = 10.0;
const MARGIN: f64 = 112.0;
/// Height of a row, and of a rate of 1 in it: the rest keeps the rows apart and has the ticks of misses (points).
const ROW: f64 = 15.0;
const FULL: f64 = 10.0;
/// Length of the tick of a miss (points).
const TICK: f64 = 5.0;
/// Height of a band's title, of the gap between bands, and of a line of labels of spans (points).
const TITLE: f64 = 13.0;
const GAP: f64 = 6.0;
const LANE: f64 = 11.5;
const BELOW: f64 = 34.0;
/// From one line of a hatched area to the next (points).
const HATCH: f64 = 3.2;

const RATE: Colour = Colour::hex(0x0072b2);
const SPAN: Colour = Colour::hex(0xe69f00);
const REST: Colour = Colour::hex(0x888888);

impl Bands {
    /// Draws it.
    pub fn draw(&self) -> Picture {
        let (left, right) = self.margins();
        let room = WIDTH - left - right;
        let key = self.key();
        let time = self.time();
        let mut frame = Frame { area: [left, 0.0, left + room, 0.0], x: time, y: Scale::linear(0.0, 1.0) };
        let lanes = self.lanes(&frame);
        let labels = lanes.iter().flatten().map(|(lane, _)| lane + 1).max().unwrap_or(0) as f64 * LANE;
        let top = 8.0 + key.height(WIDTH - left - 8.0) + labels;
        let bottom = top + self.bands.iter().map(RateBand::height).sum::<f64>().max(TITLE + ROW) - GAP;
        let mut picture = Picture::new(WIDTH, bottom + BELOW);
        key.draw(&mut picture, [left, 5.0], WIDTH - left - 8.0);

        let ticks = time.ticks(9);
        let mut upper = top;
        for band in &self.bands {
            frame.area = [left, upper + TITLE, left + room, upper + band.height() - GAP];
            band.draw(&mut picture, &frame, &self.spans, &ticks);
            upper += band.height();
        }
        frame.area = [left, top, left + room, bottom];
        for (span, place) in self.spans.iter().zip(&lanes) {
            if let Some((lane, middle)) = place {
                span.label(&mut picture, &frame, top - (*lane as f64) * LANE, *middle);
            }
        }
        frame.x_axis(&mut picture, &labelled(&ticks), "time (s)");
        picture
    }

    /// Wide enough for the names at the left and for what is said at the right.
    fn margins(&self) -> (f64, f64) {
        let rows = || self.bands.iter().flat_map(|band| &band.rows);
        let widest = |widths: &mut dyn Iterator<Item = f64>| widths.fold(0.0, f64::max);
        let names = widest(&mut rows().map(|row| font::width(&row.name, SMALL)));
        let said = widest(&mut rows().map(|row| font::width(&row.said, SMALL)));
        let right = if said > 0.0 { (said + 13.0).min(MARGIN) } else { RIGHT };
        ((names.max(30.0) + 13.0).min(MARGIN), right)
    }

    fn key(&self) -> Key {
        let rows = || self.bands.iter().flat_map(|band| &band.rows);
        let mut key = Key::default();
        key.add(Sign::Area(RATE.faint(0.45)), "share of the nominal rate");
        if rows().any(|row| !row.misses.is_empty()) {
            key.add(Sign::Tick(ALARM), "deadline missed");
        }
        if rows().any(|row| !row.suspended.is_empty()) {
            key.add(Sign::Hatched, "suspended");
        }
        key
    }

    fn time(&self) -> Scale {
        if let Some((from, to)) =
            self.window.filter(|(from, to)| to > from && from.is_finite() && to.is_finite())
        {
            return Scale::linear(from, to);
        }
        let rows = || self.bands.iter().flat_map(|band| &band.rows);
        let rates = rows().flat_map(|row| row.rate.iter().map(|step| step.0));
        let misses = rows().flat_map(|row| row.misses.iter().copied());
        let rests = rows().flat_map(|row| row.suspended.iter().flat_map(|rest| [rest.0, rest.1]));
        let spans = self.spans.iter().flat_map(|span| [span.from, span.to]);
        let all: Vec<f64> = rates.chain(misses).chain(rests).chain(spans).collect();
        // A rate that begins and never changes has a time, but no length of time.
        let least = if bounds(all.iter().copied()).is_some_and(|(min, max)| max > min) { 1e-3 } else { 1.0 };
        Scale::around(all.into_iter(), 0.0, least)
    }

    /// For each span that is seen the line of its label, counted from below, and the middle of it (points): labels that would cover
    /// each other stand above each other.
    fn lanes(&self, frame: &Frame) -> Vec<Option<(usize, f64)>> {
        let [left, _, right, _] = frame.area;
        let mut ends: Vec<f64> = Vec::new();
        let mut place = |span: &Span| {
            let (from, to) = seen(frame, span.from, span.to)?;
            let half = font::width(&span.label, SMALL) / 2.0;
            let middle = ((from + to) / 2.0).max(left + half).min((right - half).max(left + half));
            let (begin, end) = (from.min(middle - half), to.max(middle + half));
            let lane = ends.iter().position(|taken| *taken + 4.0 <= begin).unwrap_or(ends.len());
            ends.resize(ends.len().max(lane + 1), 0.0);
            ends[lane] = end;
            Some((lane, middle))
        };
        self.spans.iter().map(&mut place).collect()
    }
}

impl RateBand {
    /// With its title and the gap below (points).
    fn height(&self) -> f64 {
        TITLE + ROW * self.rows.len().max(1) as f64 + GAP
    }

    fn draw(&self, picture: &mut Picture, frame: &Frame, spans: &[Span], ticks: &[f64]) {
        let [left, top, right, _] = frame.area;
        heading(picture, [left, top - 3.5], &self.title);
        frame.grid(picture, ticks, &[]);
        for (from, to) in spans.iter().filter_map(|span| seen(frame, span.from, span.to)) {
            let [_, _, _, bottom] = frame.area;
            picture.rectangle([from, top, to, bottom], Some(SPAN.faint(0.16)), None);
        }
        for (i, row) in self.rows.iter().enumerate() {
            let base = top + ROW * (i + 1) as f64;
            picture.text([left - 6.0, base - 3.5], &row.name, SMALL, Anchor::End);
            picture.text([right + 6.0, base - 3.5], &row.said, SMALL, Anchor::Start);
            picture.clip(Some(frame.area));
            row.draw(picture, frame, base);
            picture.clip(None);
        }
        frame.border(picture);
    }
}

impl BandRow {
    fn draw(&self, picture: &mut Picture, frame: &Frame, base: f64) {
        let [left, _, right, _] = frame.area;
        for (from, to) in self.suspended.iter().filter_map(|(from, to)| seen(frame, *from, *to)) {
            hatch(picture, [from, base - FULL, to, base]);
        }
        let outline = self.outline(frame, base);
        if let (Some(first), Some(last)) = (outline.first(), outline.last()) {
            let mut area = outline.clone();
            area.extend([[last[0], base], [first[0], base]]);
            picture.polygon(area, Some(RATE.faint(0.45)), None);
            picture.line(outline, Pen::new(RATE, 0.9));
        }
        picture.line(vec![[left, base], [right, base]], Pen::new(Colour::hex(0xb8b8b8), 0.6));
        // Misses nearer to each other than the pen is wide look like one.
        let mut last = f64::NEG_INFINITY;
        for x in self.misses.iter().map(|miss| frame.at_x(*miss)) {
            if x >= left && x <= right && (x - last).abs() > 0.3 {
                picture.line(vec![[x, base - ROW + 0.8], [x, base - ROW + 0.8 + TICK]], Pen::new(ALARM, 0.9));
                last = x;
            }
        }
    }

    /// The corners of the curve, from step to step, up to the right end of the frame.
    fn outline(&self, frame: &Frame, base: f64) -> Vec<[f64; 2]> {
        let [left, _, right, _] = frame.area;
        let height = |share: f64| base - FULL * share.clamp(0.0, 1.0);
        let known = self.rate.iter().filter(|(time, share)| time.is_finite() && share.is_finite());
        let mut corners: Vec<[f64; 2]> = Vec::new();
        for (time, share) in known {
            let x = frame.at_x(*time).clamp(left, right);
            corners.extend(corners.last().map(|before| [x, before[1]]));
            corners.push([x, height(*share)]);
        }
        corners.extend(corners.last().map(|before| [right, before[1]]));
        corners
    }
}

impl Span {
    /// Its name above the bands, with a line as wide as the span under it.
    fn label(&self, picture: &mut Picture, frame: &Frame, bottom: f64, middle: f64) {
        let Some((from, to)) = seen(frame, self.from, self.to) else { return };
        picture.line(vec![[from, bottom - 0.5], [to, bottom - 0.5]], Pen::new(SPAN, 1.6));
        picture.text([middle, bottom - 3.2], &self.label, SMALL, Anchor::Middle);
    }
}

/// The part of a span of time that is inside the frame (points); nothing where none is.
fn seen(frame: &Frame, from: f64, to: f64) -> Option<(f64, f64)> {
    let [left, _, right, _] = frame.area;
    let (from, to) = (frame.at_x(from), frame.at_x(to));
    (from < to && from < right && to > left).then(|| (from.max(left), to.min(right)))
}

fn heading(picture: &mut Picture, at: [f64; 2], text: &str) {
    let (text, anchor) = (text.to_owned(), Anchor::Start);
    picture.label(Label { at, text, size: NORMAL, anchor, colour: INK, upright: false, rim: false });
}

/// A pale box with lines aslant, which is told from a colour in print too; neighbours go on with each other's lines.
pub(super) fn hatch(picture: &mut Picture, [left, top, right, bottom]: [f64; 4]) {
    picture.rectangle([left, top, right, bottom], Some(GRID.faint(0.8)), None);
    let height = bottom - top;
    let mut x = libm::floor((left - height) / HATCH) * HATCH;
    while x < right {
        // From the lower left to the upper right, cut to the box.
        let (from, to) = (x.max(left), (x + height).min(right));
        if from < to {
            picture.line(vec![[from, bottom - (from - x)], [to, bottom - (to - x)]], Pen::new(REST, 0.5));
        }
        x += HATCH;
    }
}

#[cfg(test)]
mod tests {
    use super::super::canvas::Item;
    use super::*;

    fn frame(from: f64, to: f64) -> Frame {
        Frame { area: [100.0, 0.0, 200.0, 50.0], x: Scale::linear(from, to), y: Scale::linear(0.0, 1.0) }
    }

    fn span(from: f64, to: f64, label: &str) -> Span {
        Span { from, to, label: label.into() }
    }

    #[test]
    fn a_rate_holds_until_the_next_and_the_last_to_the_end() {
        let row = BandRow { rate: vec![(2.0, 1.0), (5.0, 0.5), (7.0, 1.7)], ..BandRow::default() };
        let expect = [[120., 10.], [150., 10.], [150., 15.], [170., 15.], [170., 10.], [200., 10.]];
        assert_eq!(row.outline(&frame(0.0, 10.0), 20.0), expect);
        // What was before the window is drawn from its left end on.
        assert_eq!(
            row.outline(&frame(6.0, 10.0), 20.0)[..4],
            [[100., 10.], [100., 10.], [100., 15.], [125., 15.]]
        );
        assert_eq!(BandRow::default().outline(&frame(0.0, 1.0), 20.0), [[0.0; 2]; 0]);
    }

    #[test]
    fn labels_of_spans_stand_above_each_other_where_they_would_cover_each_other() {
        let bands = Bands {
            spans: vec![
                span(0.0, 4.0, "a"),
                span(3.0, 6.0, "b"),
                span(5.0, 8.0, "c"),
                span(20.0, 30.0, "outside"),
                span(f64::NAN, 1.0, "never"),
            ],
            ..Bands::default()
        };
        let lanes = bands.lanes(&frame(0.0, 10.0));
        let lines: Vec<_> = lanes.iter().map(|place| place.map(|(lane, _)| lane)).collect();
        assert_eq!(lines, [Some(0), Some(1), Some(0), None, None]);
        assert_eq!(lanes[0].map(|(_, middle)| middle), Some(120.0));
    }

    #[test]
    fn everything_is_drawn_inside_the_picture_and_every_miss_that_is_in_the_window() {
        let row = BandRow {
            name: "tracker".into(),
            rate: vec![(0.0, 1.0), (50.0, 0.0)],
            misses: vec![1.0, 2.0, 3.0, 99.0],
            suspended: vec![(4.0, 8.0), (50.0, 60.0)],
            said: "98 %, 4".into(),
        };
        let band = RateBand { title: "fixed".into(), rows: vec![row; 8] };
        let figure = Bands {
            bands: vec![band; 3],
            spans: vec![span(2.0, 5.0, "foreign load")],
            window: Some((0.0, 10.0)),
        };
        let picture = figure.draw();
        let (width, height) = picture.size();
        let ticks = |item: &&Item| matches!(item, Item::Path { pen: Some(pen), closed: false, .. } if pen.colour == ALARM);
        // One more is in the key.
        assert_eq!(picture.items.iter().filter(ticks).count(), 3 * 3 * 8 + 1);
        for item in &picture.items {
            if let Item::Path { points, .. } = item {
                assert!(
                    points.iter().all(|[x, y]| (0.0..=width).contains(x) && (0.0..=height).contains(y)),
                    "{item:?}"
                );
            }
        }
        assert!(picture.svg().matches(">98 %, 4</text>").count() == 24);
    }

    #[test]
    fn a_hatched_box_has_no_line_outside() {
        let mut picture = Picture::new(100.0, 100.0);
        hatch(&mut picture, [10.0, 20.0, 31.0, 30.0]);
        let lines: Vec<_> = picture
            .items
            .iter()
            .filter_map(|item| match item {
                Item::Path { points, closed: false, .. } => Some(points),
                _ => None,
            })
            .collect();
        assert!(lines.len() > 7, "{}", lines.len());
        let inside = |[x, y]: &[f64; 2]| (10.0..=31.0).contains(x) && (20.0..=30.0).contains(y);
        assert!(lines.iter().all(|line| line.iter().all(inside)));
    }
}
