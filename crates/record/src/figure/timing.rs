//! How long the steps of each agent took, and how late they began.

use super::axes::{Frame, NORMAL, SMALL, Scale, bounds, seconds};
use super::canvas::{ALARM, Anchor, Colour, INK, Label, Pen, Picture};
use super::font;
use super::key::{Key, Sign};

/// The steps of an agent, counted in two histograms. A class of a histogram is the upper end of what it holds (s), and how
/// many steps it holds; empty classes may be left out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AgentTiming {
    /// The agent.
    pub name: String,
    /// How long steps took.
    pub execution: Vec<(f64, u64)>,
    /// How long after their release steps began.
    pub jitter: Vec<(f64, u64)>,
    /// The longest step (s); without it the end of the last class stands for it.
    pub execution_max: Option<f64>,
    /// The latest begin (s); without it the end of the last class stands for it.
    pub jitter_max: Option<f64>,
    /// Until when after the release a step must end (s); nothing without a deadline.
    pub deadline: Option<f64>,
    /// Releases whose deadline was missed.
    pub misses: u64,
    /// All releases.
    pub releases: u64,
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
/// A class whose lower neighbour is empty begins at most this factor below its end: the classes that are drawn here are an
/// eighth of a doubling wide, the first of a doubling the widest.
const CLASS: f64 = 1.125;

impl Timing {
    /// Draws it.
    pub fn draw(&self) -> Picture {
        let left =
            self.agents.iter().map(|a| font::width(&a.name, SMALL)).fold(30.0, f64::max).min(110.0) + 14.0;
        let missed = self.agents.iter().map(|a| font::width(&missed(a), SMALL));
        let right = missed.fold(46.0, f64::max).min(110.0) + 16.0;
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
        let [execution, jitter]: [Vec<Spread>; 2] = [
            self.agents.iter().map(|a| Spread::new(&a.execution, a.execution_max)).collect(),
            self.agents.iter().map(|a| Spread::new(&a.jitter, a.jitter_max)).collect(),
        ];
        let deadlines = self.agents.iter().filter_map(|a| a.deadline);
        let x = span(execution.iter().flat_map(Spread::ends).chain(deadlines));
        let late = span(jitter.iter().flat_map(Spread::ends));
        let y = Scale::linear(self.agents.len().max(1) as f64, 0.0);
        let first = Frame { area: [left, top, left + half, bottom], x, y };
        let second = Frame { area: [left + half + GAP, top, left + 2.0 * half + GAP, bottom], x: late, y };
        for (frame, name) in [(&first, "execution time"), (&second, "start jitter")] {
            frame.grid(&mut picture, &frame.x.ticks(9), &[]);
            axis(frame, &mut picture, name);
        }
        for (i, agent) in self.agents.iter().enumerate() {
            let base = top + ROW * (i + 1) as f64;
            picture.text([left - 6.0, base - ROW / 2.0 + 2.7], &agent.name, SMALL, Anchor::End);
            histogram(&mut picture, &first, base, &execution[i], EXECUTION);
            histogram(&mut picture, &second, base, &jitter[i], JITTER);
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

fn missed(agent: &AgentTiming) -> String {
    format!("{} of {}", agent.misses, agent.releases)
}

fn misses(picture: &mut Picture, at: [f64; 2], agent: &AgentTiming) {
    let text = missed(agent);
    let colour = if agent.misses > 0 { ALARM } else { INK };
    picture.label(Label { at, text, size: SMALL, anchor: Anchor::End, colour, upright: false, rim: false });
}

/// Around all values, with a margin and at least a decade wide.
fn span(values: impl Iterator<Item = f64>) -> Scale {
    let (min, max) = bounds(values.map(|value| value.max(LEAST))).unwrap_or((1e-6, 1e-3));
    let min = min / 1.6;
    Scale { min, max: (max * 1.6).max(min * 12.0), log: true }
}

/// A histogram that can be drawn: classes in their order, none of them empty.
struct Spread {
    classes: Vec<(f64, u64)>,
    greatest: f64,
}

impl Spread {
    fn new(classes: &[(f64, u64)], greatest: Option<f64>) -> Spread {
        let mut classes: Vec<(f64, u64)> =
            classes.iter().copied().filter(|(end, count)| end.is_finite() && *count > 0).collect();
        classes.sort_by(|a, b| a.0.total_cmp(&b.0));
        let last = classes.last().map_or(0.0, |class| class.0);
        let greatest = greatest.filter(|value| value.is_finite()).unwrap_or(last);
        // The last class ends where its greatest value is.
        classes.iter_mut().for_each(|class| class.0 = class.0.min(greatest));
        Spread { classes, greatest }
    }

    /// What an axis must hold.
    fn ends(&self) -> impl Iterator<Item = f64> {
        let greatest = (!self.classes.is_empty()).then_some(self.greatest);
        self.classes.iter().map(|class| class.0).chain(greatest)
    }

    /// The end of the class below or in which this share of all values lies.
    fn percentile(&self, share: f64) -> Option<f64> {
        let all: f64 = self.classes.iter().map(|class| class.1 as f64).sum();
        let wanted = (share * all).ceil();
        let mut seen = 0.0;
        let class = self.classes.iter().find(|class| {
            seen += class.1 as f64;
            seen >= wanted
        });
        class.map(|class| class.0)
    }

    /// How many values fall to each of the bars along an axis. A class that lies in several is shared out by its width on the
    /// axis, or bars that hold more classes than their neighbours would stand out like teeth.
    fn bars(&self, axis: &Scale, bars: usize) -> Vec<f64> {
        let place = |value: f64| (axis.place(value.max(axis.min)) * bars as f64).clamp(0.0, bars as f64);
        let mut counts = vec![0.0; bars];
        let mut before = 0.0_f64;
        for (end, count) in &self.classes {
            let (from, to) = (place(before.max(end / CLASS)), place(*end));
            before = *end;
            let first = (from as usize).min(bars - 1);
            let last = (to.ceil() as usize).clamp(first + 1, bars);
            for (bar, sum) in counts.iter_mut().enumerate().take(last).skip(first) {
                let inside = to.min(bar as f64 + 1.0) - from.max(bar as f64);
                let share = if to > from { inside.max(0.0) / (to - from) } else { 1.0 };
                *sum += *count as f64 * share;
            }
        }
        counts
    }
}

fn histogram(picture: &mut Picture, frame: &Frame, base: f64, spread: &Spread, colour: Colour) {
    let (Some(median), Some(common)) = (spread.percentile(0.5), spread.percentile(0.99)) else { return };
    let bars = (libm::log10(frame.x.max / frame.x.min) * BARS).round().max(1.0) as usize;
    let counts = spread.bars(&frame.x, bars);
    let most = counts.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let [left, _, right, _] = frame.area;
    let edge = |i: usize| left + (right - left) * i as f64 / bars as f64;
    let mut bar = 0;
    for run in counts.chunk_by(|a, b| (*a > 0.0) == (*b > 0.0)) {
        let mut outline = vec![[edge(bar), base]];
        for count in run {
            // The root shows the few late ones beside the many in time.
            let y = base - libm::sqrt(*count / most) * (ROW - 9.0);
            outline.extend([[edge(bar), y], [edge(bar + 1), y]]);
            bar += 1;
        }
        outline.push([edge(bar), base]);
        if run[0] > 0.0 {
            picture.polygon(outline, Some(colour.faint(0.35)), Some(Pen::new(colour, 0.7)));
        }
    }

    let y = base - ROW + 4.5;
    let [median, common, greatest] =
        [median, common, spread.greatest].map(|value| frame.at_x(value.max(frame.x.min)));
    picture.line(vec![[median, y], [common, y]], Pen::new(INK, 0.8));
    picture.line(vec![[median, y - 3.0], [median, y + 3.0]], Pen::new(INK, 1.4));
    picture.circle([greatest, y], 2.0, Some(Colour::hex(0xffffff)), Some(Pen::new(INK, 0.8)));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_count_what_each_class_holds() {
        // A hundred values: the 50th lies in the second class, the 99th in the third, the last alone above.
        let spread = Spread::new(&[(4e-3, 1), (1e-3, 49), (2e-3, 1), (3e-3, 49)], Some(3.7e-3));
        let shown = [0.5, 0.51, 0.99, 1.0].map(|share| spread.percentile(share));
        assert_eq!(shown, [Some(2e-3), Some(3e-3), Some(3e-3), Some(3.7e-3)]);
        assert_eq!(spread.greatest, 3.7e-3);
        assert_eq!(Spread::new(&[(1e-3, 2), (f64::NAN, 5), (2e-3, 0)], None).greatest, 1e-3);
        assert_eq!(Spread::new(&[], None).percentile(0.5), None);
    }

    #[test]
    fn bars_share_out_every_value_and_nothing_else() {
        let axis = Scale { min: 1e-6, max: 1e-2, log: true };
        // Ten bars a decade: the classes end at 10 µs, where the tenth bar does, within the eleventh, and where the twentieth does.
        let spread = Spread::new(&[(1e-5, 3), (1.07e-5, 5), (1e-4, 7)], None);
        let bars = spread.bars(&axis, 40);
        assert!((bars.iter().sum::<f64>() - 15.0).abs() < 1e-9, "{bars:?}");
        assert!((bars[9] - 3.0).abs() < 1e-9 && (bars[10] - 5.0).abs() < 1e-9, "{bars:?}");
        assert!((bars[19] - 7.0).abs() < 1e-9, "{bars:?}");
        // Half of its width on the axis lies on either side of the middle.
        let middle = 1e-4 * CLASS.sqrt();
        let halves = Spread::new(&[(middle, 8)], None).bars(&axis, 2);
        assert!((halves[0] - 4.0).abs() < 1e-9 && (halves[1] - 4.0).abs() < 1e-9, "{halves:?}");
        // What is less than any axis shows stands at its left end, whole.
        assert_eq!(Spread::new(&[(0.0, 6)], Some(0.0)).bars(&axis, 2), [6.0, 0.0]);
    }

    #[test]
    fn missed_deadlines_are_told_of_all_releases() {
        let agent = AgentTiming {
            name: "a".into(),
            execution: vec![(1e-3, 3)],
            misses: 2,
            releases: 4000,
            ..AgentTiming::default()
        };
        assert!(Timing { agents: vec![agent] }.draw().svg().contains(">2 of 4000</text>"));
    }
}
