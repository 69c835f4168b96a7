//! Where a robot went, and which agent took it there.

use types::geometry::{Point, Pose};

use super::axes::Frame;
use super::canvas::{Colour, INK, PALETTE, Pen, Picture};
use super::key::{EventKey, Key, Sign, goal, numbered, start};
use super::plane::{Drawing, plane};
use super::{Band, Event, active, agents};

/// Where the robot was at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waypoint {
    /// When (s).
    pub time: f64,
    /// `world_from_robot`.
    pub pose: Pose,
}

/// The way of a robot on a map: its path in the colour of the agent that had the say, its outline now and then, what it
/// measured, where it began and was to go, and what happened on the way.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    /// What stands in the place.
    pub drawing: Drawing,
    /// The way, in the order of time.
    pub path: Vec<Waypoint>,
    /// Who had the say when.
    pub bands: Vec<Band>,
    /// What the robot measured, in the world's frame (m).
    pub points: Vec<Point>,
    /// What measured the points, for the key.
    pub points_name: String,
    /// Radius of the robot's outline (m).
    pub radius: f64,
    /// The corners of the robot in its own frame (m); without them it is drawn as a circle.
    pub outline: Vec<Point>,
    /// An outline is drawn each time so many seconds are over (s); none where it is zero.
    pub outline_every: f64,
    /// Where the robot was to go.
    pub goal: Option<Point>,
    /// What happened, by time.
    pub events: Vec<Event>,
    /// Ways of others, or the same way as somebody else saw it: a name and points.
    pub others: Vec<(String, Vec<Point>)>,
}

impl Default for Trajectory {
    /// Nothing yet; an outline of a robot of 0.25 m each 10 s, which stands apart at walking speed.
    fn default() -> Trajectory {
        Trajectory {
            drawing: Drawing::default(),
            path: Vec::new(),
            bands: Vec::new(),
            points: Vec::new(),
            points_name: "sonar".into(),
            radius: 0.25,
            outline: Vec::new(),
            outline_every: 10.0,
            goal: None,
            events: Vec::new(),
            others: Vec::new(),
        }
    }
}

/// Where no agent of the bands had the say.
const NOBODY: Colour = Colour::hex(0x9a9a9a);
pub(super) const POINT: Colour = Colour::hex(0x7d7d7d);

impl Trajectory {
    /// Draws it.
    pub fn draw(&self) -> Picture {
        let agents = agents(&self.bands);
        let reach = Point { x: self.radius, y: self.radius };
        let seen = self
            .path
            .iter()
            .flat_map(|w| [1.0, -1.0].map(|s| Point { x: w.pose.x + s * reach.x, y: w.pose.y + s * reach.y }))
            .chain(self.goal)
            .chain(self.others.iter().flat_map(|(_, points)| points.iter().copied()));
        plane(&self.drawing, seen, &self.key(&agents), &EventKey(&self.events), |picture, frame| {
            picture.dots(self.points.iter().map(|p| frame.at(p.x, p.y)).collect(), 0.9, POINT);
            self.outlines(picture, frame);
            for (i, (_, points)) in self.others.iter().enumerate() {
                picture.line(points.iter().map(|p| frame.at(p.x, p.y)).collect(), self.other(i));
            }
            self.way(picture, frame, &agents);
            if let Some(first) = self.path.first() {
                start(picture, frame.at(first.pose.x, first.pose.y), first.pose.heading);
            }
            if let Some(at) = self.goal {
                goal(picture, frame.at(at.x, at.y));
            }
            self.numbers(picture, frame);
        })
    }

    fn key(&self, agents: &[&str]) -> Key {
        let mut key = Key::default();
        for (i, agent) in agents.iter().enumerate() {
            key.add(Sign::Line(acting(i)), *agent);
        }
        if self.is_crowded() {
            key.add(Sign::Line(self.other(0)), format!("{} others", self.others.len()));
        } else {
            for (i, (name, _)) in self.others.iter().enumerate() {
                key.add(Sign::Line(self.other(i)), name);
            }
        }
        if !self.points.is_empty() {
            key.add(Sign::Dot(POINT), &self.points_name);
        }
        if self.outline_every > 0.0 {
            key.add(Sign::Ring(POINT, 4.0), format!("robot, each {} s", self.outline_every));
        }
        key.add(Sign::Start, "start");
        if self.goal.is_some() {
            key.add(Sign::Goal, "goal");
        }
        key
    }

    /// Whether there are so many others that no eye could tell their ways apart.
    fn is_crowded(&self) -> bool {
        self.others.len() > FEW
    }

    /// The way of another; those of a crowd lie pale behind that of the robot.
    fn other(&self, i: usize) -> Pen {
        if self.is_crowded() { Pen::new(CROWD, 0.5) } else { other(i) }
    }

    /// The path, a line for each stretch of one agent.
    fn way(&self, picture: &mut Picture, frame: &Frame, agents: &[&str]) {
        let who = |w: &Waypoint| active(&self.bands, agents, w.time);
        let place = |w: &Waypoint| frame.at(w.pose.x, w.pose.y);
        let mut from = 0;
        while from + 1 < self.path.len() {
            let agent = who(&self.path[from]);
            let len = self.path[from..].iter().take_while(|w| who(w) == agent).count();
            // One point more, so that stretches touch.
            let to = (from + len).min(self.path.len() - 1);
            let points = self.path[from..=to].iter().map(place).collect();
            let nobody = if agents.is_empty() { INK } else { NOBODY };
            picture.line(points, agent.map_or(Pen::new(nobody, 1.8), acting));
            from = to;
        }
    }

    /// The robot's outline with a line to where it looks.
    fn outlines(&self, picture: &mut Picture, frame: &Frame) {
        let mut next = f64::NEG_INFINITY;
        for waypoint in self.path.iter().filter(|_| self.outline_every > 0.0) {
            if waypoint.time >= next {
                next = waypoint.time + self.outline_every;
                let Pose { x, y, heading } = waypoint.pose;
                let nose =
                    frame.at(x + self.radius * libm::cos(heading), y + self.radius * libm::sin(heading));
                let at = frame.at(x, y);
                let pen = Pen::new(POINT, 0.6);
                let fill = Colour::hex(0xffffff).faint(0.6);
                if self.outline.is_empty() {
                    picture.circle(at, frame.at_x(x + self.radius) - at[0], Some(fill), Some(pen));
                } else {
                    let corner = |p: &Point| waypoint.pose.transform(*p);
                    let corners = self.outline.iter().map(corner).map(|p| frame.at(p.x, p.y)).collect();
                    picture.polygon(corners, Some(fill), Some(pen));
                }
                picture.line(vec![at, nose], pen);
            }
        }
    }

    /// The numbers of the events beside the path, with a thin line to where they happened.
    fn numbers(&self, picture: &mut Picture, frame: &Frame) {
        let mut taken: Vec<[f64; 2]> = Vec::new();
        for (i, event) in self.events.iter().enumerate() {
            let nearest = |a: &&Waypoint, b: &&Waypoint| {
                (a.time - event.time).abs().total_cmp(&(b.time - event.time).abs())
            };
            let Some(waypoint) = self.path.iter().min_by(nearest) else { return };
            let at = frame.at(waypoint.pose.x, waypoint.pose.y);
            let place = self.free_place(frame, at, &taken);
            picture.line(vec![at, place], Pen::new(INK, 0.6));
            picture.circle(at, 1.3, Some(INK), None);
            numbered(picture, place, i + 1);
            taken.push(place);
        }
    }

    /// A place for a number near `at` that covers the path and other numbers the least.
    fn free_place(&self, frame: &Frame, at: [f64; 2], taken: &[[f64; 2]]) -> [f64; 2] {
        let [left, top, right, bottom] = frame.area;
        let cost = |[x, y]: [f64; 2]| {
            let distance = |[a, b]: [f64; 2]| libm::hypot(a - x, b - y);
            let path = self.path.iter().filter(|w| distance(frame.at(w.pose.x, w.pose.y)) < 8.0).count();
            let numbers = taken.iter().filter(|other| distance(**other) < 12.0).count();
            let walls = self
                .drawing
                .segments
                .iter()
                .filter(|(a, b)| segment_distance([x, y], frame.at(a.x, a.y), frame.at(b.x, b.y)) < 7.0);
            let outside = x < left + 6.0 || x > right - 6.0 || y < top + 6.0 || y > bottom - 6.0;
            path.min(50) + numbers * 100 + walls.count() * 20 + usize::from(outside) * 1000
        };
        let places = [13.0, 19.0].into_iter().flat_map(|distance| {
            (0..16).map(move |i| {
                let angle = core::f64::consts::TAU * f64::from(i) / 16.0 - 0.8;
                [at[0] + distance * libm::cos(angle), at[1] + distance * libm::sin(angle)]
            })
        });
        places.min_by_key(|place| cost(*place)).unwrap_or(at)
    }
}

/// The path of agent `i`: when there are more agents than colours, the further ones are dashed.
fn acting(i: usize) -> Pen {
    let pen = Pen::new(Colour::of(i), 1.8);
    if i < PALETTE.len() { pen } else { pen.dashed(5.0, 1.5) }
}

/// Up to so many others each have a line of their own in the key.
const FEW: usize = 6;
const CROWD: Colour = Colour::hex(0xd6dade);

fn other(i: usize) -> Pen {
    Pen::new(if i == 0 { INK } else { Colour::of(i + 3) }, 1.0).dashed(4.0, 2.0)
}

/// Distance of `p` from the line between `a` and `b`.
fn segment_distance(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let along = ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / (dx * dx + dy * dy).max(1e-12);
    let along = along.clamp(0.0, 1.0);
    libm::hypot(p[0] - a[0] - along * dx, p[1] - a[1] - along * dy)
}
