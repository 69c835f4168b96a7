//! The world of a run on the terminal, while it runs.
//!
//! A thread of its own looks at the truth and listens to a few outputs; the run never waits for it.

use std::io::{self, Write as _};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration as HostDuration;

use crossterm::cursor::{Hide, MoveTo, Show};
use crossterm::terminal::{Clear, ClearType, EnterAlternateScreen, LeaveAlternateScreen, size};
use crossterm::{execute, queue};
use hardware::simulated::Truth;
use runtime::{Control, Tap};
use types::message::Message as _;
use types::messages::{Decision, Echoes};
use types::{Point, Pose, Time, cdr};

use super::prepare::Ready;
use super::serve::{DECIDER, decoded};
use crate::error::Failure;
use crate::terminal::{coloured, paint};

/// How often it draws: as often as an eye needs it to see something move.
const FRAME: HostDuration = HostDuration::from_millis(66);
/// Lines below the picture.
const FOOT: u16 = 3;

/// A thread that draws. Dropping it gives the terminal back.
pub(super) struct Screen {
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Screen {
    pub(super) fn start(ready: &Ready, control: Control) -> Result<Screen, Failure> {
        let over = Arc::new(AtomicBool::new(false));
        let decider =
            ready.plan.agents.iter().find(|agent| agent.kind == DECIDER).map(|agent| agent.name.clone());
        let robots = ready.robots.iter().map(|robot| robot.name.clone()).collect();
        let view =
            View { name: ready.plan.name.clone(), truth: ready.truth.clone(), control, robots, decider };
        let mine = over.clone();
        let thread = std::thread::Builder::new()
            .name("sinew-screen".into())
            .spawn(move || view.keep_drawing(&mine))
            .map_err(|error| {
                Failure::new(format!("no thread could be started for the screen: {error}")).code(1)
            })?;
        Ok(Screen { over, thread: Some(thread) })
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            // One that panicked has said so.
            let _ = thread.join();
        }
    }
}

struct View {
    name: String,
    truth: Option<Truth>,
    control: Control,
    robots: Vec<String>,
    decider: Option<String>,
}

/// What was heard last.
#[derive(Default)]
struct Heard {
    decision: Option<Decision>,
    /// Where the sonars of each robot saw something, seen from the robot.
    echoes: Vec<Vec<Point>>,
}

impl View {
    fn keep_drawing(&self, over: &AtomicBool) {
        let mut out = io::stdout();
        if execute!(out, EnterAlternateScreen, Hide).is_err() {
            return;
        }
        let sonars: Vec<Option<Tap>> =
            self.robots.iter().map(|robot| self.control.tap(&format!("{robot}.sonar")).ok()).collect();
        let decisions =
            self.decider.as_ref().and_then(|decider| self.control.tap(&format!("{decider}.decision")).ok());
        let mut heard = Heard { echoes: vec![Vec::new(); self.robots.len()], ..Heard::default() };
        while !over.load(Ordering::Acquire) {
            if let Some(last) = decisions.as_ref().and_then(|tap| tap.take().0.pop()) {
                heard.decision = decoded(&last.cdr);
            }
            for (tap, points) in sonars.iter().zip(&mut heard.echoes) {
                if let Some(last) = tap.as_ref().and_then(|tap| tap.take().0.pop()) {
                    *points = seen(&last.cdr);
                }
            }
            if self.draw(&mut out, &heard).is_err() {
                break;
            }
            std::thread::park_timeout(FRAME);
        }
        // The terminal is given back even where drawing failed.
        let _ = execute!(out, Show, LeaveAlternateScreen);
    }

    fn draw(&self, out: &mut io::Stdout, heard: &Heard) -> io::Result<()> {
        let (columns, rows) = size().unwrap_or((80, 24));
        let mut text = String::new();
        if let Some(truth) = &self.truth {
            let height = rows.saturating_sub(FOOT).max(4);
            text += &picture(truth, heard, columns, height);
        }
        text += &self.foot(heard, usize::from(columns));
        queue!(out, MoveTo(0, 0))?;
        for line in text.lines() {
            out.write_all(line.as_bytes())?;
            queue!(out, Clear(ClearType::UntilNewLine))?;
            out.write_all(b"\r\n")?;
        }
        queue!(out, Clear(ClearType::FromCursorDown))?;
        out.flush()
    }

    /// Where the run stands, in words.
    fn foot(&self, heard: &Heard, columns: usize) -> String {
        let now = self.truth.as_ref().map_or(Time::ZERO, Truth::time);
        let mut first = format!("{} {:6.1} s", self.name, now.seconds());
        if let Some(decision) = &heard.decision {
            first += &format!("   {} in \"{}\"", decision.active, decision.situation);
        }
        if let Some(truth) = &self.truth {
            for (_, robot) in truth.robots() {
                first += &format!(
                    "   {:.2} m/s  closest {:.2} m  collisions {}",
                    robot.truth.linear, robot.truth.closest, robot.truth.collisions
                );
            }
        }
        let goal = self.robots.first().and_then(|robot| self.truth.as_ref()?.why(robot)).unwrap_or_default();
        let fault = self.control.view().ok().and_then(|view| {
            let mut died = view.agents.iter().filter_map(|agent| Some((agent, agent.last_death.as_ref()?)));
            died.next_back()
                .map(|(agent, why)| format!("last fault: {} {why} (now {})", agent.name, agent.state.name()))
        });
        let cut = |text: String| text.chars().take(columns.saturating_sub(1)).collect::<String>();
        let on = coloured();
        let mut out = paint(on, "1", &cut(first));
        out += &format!("\n{}\n", cut(goal));
        out += &paint(on, "33", &cut(fault.unwrap_or_default()));
        out
    }
}

/// Where a firing of the ring saw something, seen from the robot.
fn seen(bytes: &[u8]) -> Vec<Point> {
    let Some(ring) =
        cdr::Reader::new(bytes).ok().and_then(|mut reader| Echoes::decode(&mut reader, &mut Vec::new()).ok())
    else {
        return Vec::new();
    };
    let near = ring.echoes.iter().filter(|echo| echo.range.is_finite() && echo.range < ring.range_max - 0.01);
    near.map(|echo| {
        Pose::new(echo.x.into(), echo.y.into(), echo.bearing.into())
            .transform(Point::new(echo.range.into(), 0.0))
    })
    .collect()
}

/// Dots of the terminal's cells: two across and four down, as Braille has them.
struct Dots {
    columns: usize,
    rows: usize,
    cells: Vec<(u8, u8)>,
    letters: Vec<Option<char>>,
    low: Point,
    scale: f64,
}

/// What a dot belongs to; a greater one is drawn over a smaller one.
const WALL: u8 = 1;
const ECHO: u8 = 2;
const PERSON: u8 = 3;
const THING: u8 = 4;
const ROBOT: u8 = 5;

/// The colours of those on a terminal.
const COLOURS: [&str; 6] = ["0", "37", "36", "34", "1;31", "1;32"];

impl Dots {
    fn new((low, high): (Point, Point), columns: u16, rows: u16) -> Dots {
        let (columns, rows) = (usize::from(columns.max(2)) - 1, usize::from(rows));
        let (width, height) = ((high.x - low.x).max(0.1), (high.y - low.y).max(0.1));
        let scale = ((2 * columns) as f64 / width).min((4 * rows) as f64 / height) * 0.98;
        let used = ((height * scale / 4.0).ceil() as usize + 1).min(rows);
        Dots {
            columns,
            rows: used,
            cells: vec![(0, 0); columns * used],
            letters: vec![None; columns * used],
            low,
            scale,
        }
    }

    fn place(&self, point: Point) -> (f64, f64) {
        (
            (point.x - self.low.x) * self.scale,
            (4 * self.rows) as f64 - 1.0 - (point.y - self.low.y) * self.scale,
        )
    }

    fn cell(&self, x: f64, y: f64) -> Option<usize> {
        let inside = x >= 0.0 && y >= 0.0 && x < (2 * self.columns) as f64 && y < (4 * self.rows) as f64;
        inside.then_some((y as usize / 4) * self.columns + x as usize / 2)
    }

    fn dot(&mut self, x: f64, y: f64, kind: u8) {
        /// The bits of a Braille character, by column and row of the dot.
        const BITS: [[u8; 4]; 2] = [[0x01, 0x02, 0x04, 0x40], [0x08, 0x10, 0x20, 0x80]];
        if let Some(at) = self.cell(x, y) {
            let cell = &mut self.cells[at];
            cell.0 |= BITS[x as usize % 2][y as usize % 4];
            cell.1 = cell.1.max(kind);
        }
    }

    fn line(&mut self, from: Point, to: Point, kind: u8) {
        let ((x0, y0), (x1, y1)) = (self.place(from), self.place(to));
        let steps = (x1 - x0).abs().max((y1 - y0).abs()).ceil().clamp(1.0, 10_000.0) as usize;
        for i in 0..=steps {
            let share = i as f64 / steps as f64;
            self.dot(x0 + (x1 - x0) * share, y0 + (y1 - y0) * share, kind);
        }
    }

    fn circle(&mut self, centre: Point, radius: f64, kind: u8) {
        let steps = ((radius * self.scale * 7.0) as usize).clamp(6, 400);
        for i in 0..steps {
            let at = centre + Point::polar(radius, types::geometry::TAU * i as f64 / steps as f64);
            let (x, y) = self.place(at);
            self.dot(x, y, kind);
        }
    }

    fn letter(&mut self, at: Point, letter: char, kind: u8) {
        let (x, y) = self.place(at);
        if let Some(at) = self.cell(x, y) {
            self.letters[at] = Some(letter);
            self.cells[at].1 = kind;
        }
    }

    fn text(&self) -> String {
        let on = coloured();
        let mut out = String::new();
        for row in 0..self.rows {
            let mut last = 0;
            for column in 0..self.columns {
                let at = row * self.columns + column;
                let (bits, kind) = self.cells[at];
                if on && kind != last {
                    out += &format!("\u{1b}[{}m", COLOURS[usize::from(kind)]);
                    last = kind;
                }
                let braille = char::from_u32(0x2800 + u32::from(bits)).filter(|_| bits != 0);
                out.push(self.letters[at].or(braille).unwrap_or(' '));
            }
            out += if on { "\u{1b}[0m\n" } else { "\n" };
        }
        out
    }
}

fn picture(truth: &Truth, heard: &Heard, columns: u16, rows: u16) -> String {
    let scenery = truth.scenery();
    let snapshot = truth.snapshot();
    let mut dots = Dots::new(scenery.bounds, columns, rows);
    for line in &scenery.lines {
        dots.line(line.from, line.to, WALL);
    }
    for disc in &scenery.discs {
        dots.circle(disc.centre, disc.radius, WALL);
    }
    for thing in &snapshot.added {
        match thing.shape.corners(thing.pose) {
            None => dots.circle(thing.pose.position(), thing.shape.reach(), WALL),
            Some(corners) => (0..4).for_each(|k| dots.line(corners[k], corners[(k + 1) % 4], WALL)),
        }
    }
    for person in &snapshot.people {
        dots.circle(person.disc.centre, person.disc.radius, PERSON);
        dots.letter(person.disc.centre, 'P', PERSON);
    }
    for thing in &snapshot.things {
        dots.letter(thing.centre, '●', THING);
    }
    for (robot, echoes) in snapshot.robots.iter().zip(&heard.echoes) {
        for echo in echoes {
            let (x, y) = dots.place(robot.pose.transform(*echo));
            dots.dot(x, y, ECHO);
        }
    }
    for robot in &snapshot.robots {
        let at = robot.pose.position();
        match robot.shape.corners(robot.pose) {
            None => dots.circle(at, robot.shape.reach(), ROBOT),
            Some(corners) => (0..4).for_each(|k| dots.line(corners[k], corners[(k + 1) % 4], ROBOT)),
        }
        dots.line(at, at + Point::polar(2.0 * robot.shape.reach(), robot.pose.heading), ROBOT);
        dots.letter(at, arrow(robot.pose.heading), ROBOT);
    }
    dots.text()
}

/// The arrow that is nearest to a heading.
fn arrow(heading: f64) -> char {
    const ARROWS: [char; 8] = ['→', '↗', '↑', '↖', '←', '↙', '↓', '↘'];
    let eighth = types::geometry::TAU / 8.0;
    ARROWS[((heading / eighth).round() as i64).rem_euclid(8) as usize]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrows_point_where_the_robot_looks() {
        let quarter = std::f64::consts::FRAC_PI_2;
        assert_eq!(
            [0.0, quarter, -quarter, 2.0 * quarter, -1.9 * quarter].map(arrow),
            ['→', '↑', '↓', '←', '←']
        );
    }

    #[test]
    fn a_wall_is_drawn_where_it_stands_and_upright() {
        let mut dots = Dots::new((Point::new(0.0, 0.0), Point::new(10.0, 5.0)), 41, 20);
        dots.line(Point::new(0.0, 5.0), Point::new(10.0, 5.0), WALL);
        let used: Vec<usize> = (0..dots.rows)
            .filter(|row| dots.cells[row * dots.columns..][..dots.columns].iter().any(|cell| cell.0 != 0))
            .collect();
        assert!(used.len() == 1 && used[0] <= 1, "the upper side is on top: {used:?}");
    }
}
