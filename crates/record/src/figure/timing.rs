//! How long the steps of each agent took, and how late they began.

use super::axes::{Frame, NORMAL, SMALL, Scale, bounds, seconds};
use super::canvas::{ALARM, Anchor, Colour, INK, Label, Pen, Picture};
use super::font;
use super::key::{Key, Sign};

/// The steps of an agent.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AgentTiming {
    /// The agent.
    pub name: String,
    /// How long each step took (s).
    pub execution: Vec<f64>,
    /// How long after its release each step began (s).
    pub jitter: Vec<f64>,
    /// Until when after the release a step must end (s); nothing without a deadline.
    pub deadline: Option<f64>,
    /// Releases whose deadline was missed.
    pub misses: u64,
}

/// Histograms of execution time and start jitter, a row for each agent, on logarithmic axes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Timing {
    /// The agents, the first on top.
    pub agents: Vec<AgentTiming>,
}

const WIDTH: f64 = 460.0;
const ROW: f64 = 30.0;
const GAP: f64 = 22.0;
/// Bars of a histogram in a decade.
const BARS: f64 = 12.0;
const EXECUTION: Colour = Colour::hex(0x0072b2);
const JITTER: Colour = Colour::hex(0x009e73);
/// No clock of a robot tells less (s); smaller values stand at the left end.
const LEAST: f64 = 1e-8;

impl Timing {
    /// Draws it.
    pub fn draw(&self) -> Picture {
        let left =
            self.agents.iter().map(|a| font::width(&a.name, SMALL)).fold(30.0, f64::max).min(110.0) + 14.0;
        let right = 62.0;
        let mut key = Key::default();
        key.add(Sign::Tick(INK), "median");
        key.add(Sign::Line(Pen::new(INK, 0.8)), "up to 99 %");
        key.add(Sign::Ring(INK, 2.0), "greatest");
        key.add(Sign::Tick(ALARM), "deadline");
        let top = 22.0 + key.height(WIDTH - left);
        let bottom = top + ROW * self.agents.len().max(1) as f64;
        let mut picture = Picture::new(WIDTH, bottom + 20.0);
        key.draw(&mut picture, [left, 5.0], WIDTH - left);

        let half = (WIDTH - left - right - GAP) / 2.0;
        let execution = span(self.agents.iter().flat_map(|a| a.execution.iter().copied().chain(a.deadline)));
        let jitter = span(self.agents.iter().flat_map(|a| a.jitter.iter().copied()));
        let y = Scale::linear(self.agents.len().max(1) as f64, 0.0);
        let first = Frame { area: [left, top, left + half, bottom], x: execution, y };
        let second = Frame { area: [left + half + GAP, top, left + 2.0 * half + GAP, bottom], x: jitter, y };
        for (frame, name) in [(&first, "execution time"), (&second, "start jitter")] {
            frame.grid(&mut picture, &frame.x.ticks(9), &[]);
            axis(frame, &mut picture, name);
        }
        for (i, agent) in self.agents.iter().enumerate() {
            let base = top + ROW * (i + 1) as f64;
            picture.text([left - 6.0, base - ROW / 2.0 + 2.7], &agent.name, SMALL, Anchor::End);
            histogram(&mut picture, &first, base, &agent.execution, EXECUTION);
            histogram(&mut picture, &second, base, &agent.jitter, JITTER);
            if let Some(deadline) = agent.deadline {
                let x = first.at_x(deadline.max(first.x.min));
                picture.line(vec![[x, base - ROW + 3.0], [x, base]], Pen::new(ALARM, 1.4));
            }
            misses(&mut picture, [WIDTH - 8.0, base - ROW / 2.0 + 2.7], agent);
            if i > 0 {
                for frame in [&first, &second] {
                    let y = base - ROW;
                    picture.line(
                        vec![[frame.area[0], y], [frame.area[2], y]],
                        Pen::new(Colour::hex(0xbbbbbb), 0.5),
                    );
                }
            }
        }
        picture.text([WIDTH - 8.0, top - 5.0], "missed", NORMAL, Anchor::End);
        first.border(&mut picture);
        second.border(&mut picture);
        picture
    }
}

fn axis(frame: &Frame, picture: &mut Picture, name: &str) {
    let [left, top, right, _] = frame.area;
    let decades = frame.x.ticks(9);
    // Only as many texts as have room beside each other.
    let every = (decades.len() as f64 * 34.0 / (right - left)).ceil().max(1.0) as usize;
    let texts: Vec<(f64, String)> =
        decades.iter().step_by(every).map(|tick| (*tick, seconds(*tick))).collect();
    frame.x_axis(picture, &texts, "");
    picture.text([(left + right) / 2.0, top - 5.0], name, NORMAL, Anchor::Middle);
}

fn misses(picture: &mut Picture, at: [f64; 2], agent: &AgentTiming) {
    let text = format!("{} of {}", agent.misses, agent.execution.len());
    let colour = if agent.misses > 0 { ALARM } else { INK };
    picture.label(Label { at, text, size: SMALL, anchor: Anchor::End, colour, upright: false, rim: false });
}

/// Around all values, with a margin and at least a decade wide.
fn span(values: impl Iterator<Item = f64>) -> Scale {
    let (min, max) = bounds(values.map(|value| value.max(LEAST))).unwrap_or((1e-6, 1e-3));
    let min = min / 1.6;
    Scale { min, max: (max * 1.6).max(min * 12.0), log: true }
}

fn histogram(picture: &mut Picture, frame: &Frame, base: f64, values: &[f64], colour: Colour) {
    let mut sorted: Vec<f64> = values.iter().filter(|v| v.is_finite()).map(|v| v.max(frame.x.min)).collect();
    sorted.sort_by(f64::total_cmp);
    let (Some(&median), Some(&greatest)) = (sorted.get(sorted.len() / 2), sorted.last()) else { return };
    let common = sorted[(sorted.len() * 99 / 100).min(sorted.len() - 1)];
    let bars = (libm::log10(frame.x.max / frame.x.min) * BARS).round().max(1.0) as usize;
    let mut counts = vec![0usize; bars];
    for value in &sorted {
        let bar = (frame.x.place(*value) * bars as f64) as usize;
        counts[bar.min(bars - 1)] += 1;
    }
    let most = counts.iter().copied().max().unwrap_or(1) as f64;
    let [left, _, right, _] = frame.area;
    let edge = |i: usize| left + (right - left) * i as f64 / bars as f64;
    let mut bar = 0;
    for run in counts.chunk_by(|a, b| (*a == 0) == (*b == 0)) {
        let mut outline = vec![[edge(bar), base]];
        for count in run {
            // The root shows the few late ones beside the many in time.
            let y = base - libm::sqrt(*count as f64 / most) * (ROW - 9.0);
            outline.extend([[edge(bar), y], [edge(bar + 1), y]]);
            bar += 1;
        }
        outline.push([edge(bar), base]);
        if run[0] > 0 {
            picture.polygon(outline, Some(colour.faint(0.35)), Some(Pen::new(colour, 0.7)));
        }
    }

    let y = base - ROW + 4.5;
    let [median, common, greatest] = [median, common, greatest].map(|value| frame.at_x(value));
    picture.line(vec![[median, y], [common, y]], Pen::new(INK, 0.8));
    picture.line(vec![[median, y - 3.0], [median, y + 3.0]], Pen::new(INK, 1.4));
    picture.circle([greatest, y], 2.0, Some(Colour::hex(0xffffff)), Some(Pen::new(INK, 0.8)));
}
