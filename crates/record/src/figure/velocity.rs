//! How a robot moved over time.

use std::f64::consts::PI;

use super::axes::{Frame, Scale, bounds, labelled};
use super::canvas::{Colour, INK, Pen, Picture};
use super::key::{EventKey, Key, Sign, numbered};
use super::{Band, Event, agents};

/// A quantity over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// What it is, as in "measured"; for the key.
    pub name: String,
    /// Time (s) and value.
    pub points: Vec<(f64, f64)>,
}

/// Speed, angular speed and heading over time, under the agents that had the say and the events.
///
/// Series of the same name in several panels are one entry of the key.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Velocity {
    /// Forward speed (m/s).
    pub speed: Vec<Series>,
    /// Angular speed (rad/s, counter-clockwise).
    pub angular_speed: Vec<Series>,
    /// Heading (rad); a jump by more than half a turn is not drawn as a line.
    pub heading: Vec<Series>,
    /// Who had the say when.
    pub bands: Vec<Band>,
    /// What happened, by time.
    pub events: Vec<Event>,
}

const WIDTH: f64 = 460.0;
const LEFT: f64 = 46.0;
const RIGHT: f64 = 10.0;
/// Height of a panel and the gap above the next one (points).
const PANEL: f64 = 92.0;
const GAP: f64 = 9.0;
const BELOW: f64 = 34.0;
/// Height of the strip that says who has the say.
const STRIP: f64 = 7.0;

/// A panel: its name, its series, whether it is an angle.
type Panel<'a> = (&'static str, &'a [Series], bool);

impl Velocity {
    /// Draws it.
    pub fn draw(&self) -> Picture {
        let room = WIDTH - LEFT - RIGHT;
        let panels: [Panel<'_>; 3] = [
            ("speed (m/s)", &self.speed, false),
            ("angular speed (rad/s)", &self.angular_speed, false),
            ("heading (rad)", &self.heading, true),
        ];
        let names = names(&panels);
        let agents = agents(&self.bands);
        let key = key(&names, &agents);
        let events = EventKey(&self.events);
        let numbers = if self.events.is_empty() { 0.0 } else { 13.0 };
        let strip = if agents.is_empty() { 0.0 } else { STRIP + 2.0 };
        let top = 8.0 + key.height(room) + numbers + strip;
        let height = 3.0 * PANEL + 2.0 * GAP;
        let mut picture = Picture::new(WIDTH, top + height + BELOW + events.height(room));
        key.draw(&mut picture, [LEFT, 5.0], room);

        let time = self.time();
        for (i, panel) in panels.iter().enumerate() {
            let upper = top + i as f64 * (PANEL + GAP);
            let area = [LEFT, upper, WIDTH - RIGHT, upper + PANEL];
            let frame = Frame { area, x: time, y: scale(panel) };
            self.panel(&mut picture, &frame, panel, &names, &agents, i == 2);
        }
        self.strip(&mut picture, time, top - strip, &agents);
        self.lines(&mut picture, time, [top - strip, top + height]);
        events.draw(&mut picture, [LEFT, top + height + BELOW - 1.0], room);
        picture
    }

    fn time(&self) -> Scale {
        let series = self.speed.iter().chain(&self.angular_speed).chain(&self.heading);
        let times = series.flat_map(|s| s.points.iter().map(|p| p.0));
        let all = times.chain(self.bands.iter().flat_map(|band| [band.from, band.to]));
        Scale::around(all, 0.0, 1e-3)
    }

    fn panel(
        &self,
        picture: &mut Picture,
        frame: &Frame,
        panel: &Panel<'_>,
        names: &[&str],
        agents: &[&str],
        last: bool,
    ) {
        let (name, all, angle) = *panel;
        let [left, top, right, bottom] = frame.area;
        let x_ticks = frame.x.ticks(10);
        let y_ticks = if angle { half_turns(&frame.y) } else { labelled(&frame.y.ticks(5)) };
        picture.clip(Some(frame.area));
        for band in &self.bands {
            let colour = agents.iter().position(|agent| *agent == band.agent).map_or(INK, Colour::of);
            let (from, to) = (frame.at_x(band.from).max(left), frame.at_x(band.to).min(right));
            picture.rectangle([from, top, to, bottom], Some(colour.faint(0.12)), None);
        }
        let values: Vec<f64> = y_ticks.iter().map(|tick| tick.0).collect();
        frame.grid(picture, &x_ticks, &values);
        if frame.y.min < 0.0 && frame.y.max > 0.0 {
            let zero = frame.at_y(0.0);
            picture.line(vec![[left, zero], [right, zero]], Pen::new(Colour::hex(0x999999), 0.6));
        }
        for series in all {
            let i = names.iter().position(|known| *known == series.name).unwrap_or(0);
            let jump = if angle { PI } else { f64::INFINITY };
            for part in unbroken(&series.points, jump) {
                picture.line(part.iter().map(|(t, value)| frame.at(*t, *value)).collect(), pen(i));
            }
        }
        picture.clip(None);
        frame.border(picture);
        frame.y_axis(picture, &y_ticks, name, 32.0);
        if last {
            frame.x_axis(picture, &labelled(&x_ticks), "time (s)");
        }
    }

    fn strip(&self, picture: &mut Picture, time: Scale, top: f64, agents: &[&str]) {
        let frame =
            Frame { area: [LEFT, top, WIDTH - RIGHT, top + STRIP], x: time, y: Scale::linear(0.0, 1.0) };
        picture.clip(Some(frame.area));
        for band in &self.bands {
            let colour = agents.iter().position(|agent| *agent == band.agent).map_or(INK, Colour::of);
            picture.rectangle(
                [frame.at_x(band.from), top, frame.at_x(band.to), top + STRIP],
                Some(colour),
                None,
            );
        }
        picture.clip(None);
    }

    /// The events as lines through all panels, their numbers on top; numbers that would cover each other move apart.
    fn lines(&self, picture: &mut Picture, time: Scale, [top, bottom]: [f64; 2]) {
        let frame = Frame { area: [LEFT, top, WIDTH - RIGHT, bottom], x: time, y: Scale::linear(0.0, 1.0) };
        let mut free = f64::NEG_INFINITY;
        for (i, event) in self.events.iter().enumerate() {
            let x = frame.at_x(event.time);
            let number = x.max(free);
            free = number + 11.5;
            picture.line(vec![[x, top], [x, bottom]], Pen::new(INK, 0.7).dashed(2.5, 2.0));
            picture.line(vec![[x, top], [number, top - 2.0]], Pen::new(INK, 0.7));
            numbered(picture, [number, top - 7.0], i + 1);
        }
    }
}

fn names<'a>(panels: &[Panel<'a>]) -> Vec<&'a str> {
    let mut names: Vec<&str> = Vec::new();
    for series in panels.iter().flat_map(|(_, all, _)| *all) {
        if !names.contains(&series.name.as_str()) {
            names.push(&series.name);
        }
    }
    names
}

fn key(names: &[&str], agents: &[&str]) -> Key {
    let mut key = Key::default();
    for (i, name) in names.iter().enumerate().filter(|(_, name)| !name.is_empty()) {
        key.add(Sign::Line(pen(i)), *name);
    }
    for (i, agent) in agents.iter().enumerate() {
        key.add(Sign::Area(Colour::of(i)), *agent);
    }
    key
}

/// Lines are ink, because the colours belong to the agents: the first whole, then dashed, then grey.
fn pen(i: usize) -> Pen {
    match i {
        0 => Pen::new(INK, 1.1),
        1 => Pen::new(Colour::hex(0x555555), 0.9).dashed(3.0, 1.6),
        _ => Pen::new(Colour::hex(0x888888), 0.9).dashed(1.2, 1.2),
    }
}

fn scale((_, all, angle): &Panel<'_>) -> Scale {
    let values = all.iter().flat_map(|series| series.points.iter().map(|p| p.1));
    if !*angle {
        return Scale::around(values, 0.08, 0.2);
    }
    // Whole quarters of a turn, so that the ticks are known angles.
    let (min, max) = bounds(values).unwrap_or((0.0, 0.0));
    let quarter = PI / 2.0;
    let low = libm::floor(min / quarter + 0.02) * quarter;
    let high = libm::ceil(max / quarter - 0.02) * quarter;
    Scale::linear(low - 0.15, high.max(low + quarter) + 0.15)
}

/// Ticks at quarters of a turn, or wider apart where a robot turned often: `−π/2`.
fn half_turns(scale: &Scale) -> Vec<(f64, String)> {
    let quarter = PI / 2.0;
    let all = libm::floor((scale.max - scale.min) / quarter) as i64;
    let step = [1, 2, 4, 8, 16, 32, 64].into_iter().find(|step| all / step <= 5).unwrap_or(128);
    let (first, last) = (libm::ceil(scale.min / quarter) as i64, libm::floor(scale.max / quarter) as i64);
    (first..=last).filter(|n| n.rem_euclid(step) == 0).map(|n| (n as f64 * quarter, turn(n))).collect()
}

/// `n` quarters of a turn.
fn turn(n: i64) -> String {
    let sign = if n < 0 { "−" } else { "" };
    match (n.abs() % 2, n.abs()) {
        (_, 0) => "0".to_owned(),
        (0, 2) => format!("{sign}π"),
        (0, n) => format!("{sign}{}π", n / 2),
        (_, 1) => format!("{sign}π/2"),
        (_, n) => format!("{sign}{n}π/2"),
    }
}

/// The stretches between jumps.
fn unbroken(points: &[(f64, f64)], jump: f64) -> impl Iterator<Item = &[(f64, f64)]> {
    points.chunk_by(move |a, b| (b.1 - a.1).abs() < jump && b.1.is_finite() && a.1.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_have_their_names() {
        let names: Vec<String> = (-3..=4).map(turn).collect();
        assert_eq!(names, ["−3π/2", "−π", "−π/2", "0", "π/2", "π", "3π/2", "2π"]);
    }

    #[test]
    fn a_wrapped_heading_is_not_joined() {
        let points = [(0.0, 3.0), (1.0, 3.1), (2.0, -3.1), (3.0, -3.0)];
        assert_eq!(unbroken(&points, PI).map(<[_]>::len).collect::<Vec<_>>(), [2, 2]);
        assert_eq!(unbroken(&points, f64::INFINITY).count(), 1);
    }
}
