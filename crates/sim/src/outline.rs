//! From the plan of a world to the faces, posts and edges that rays meet.

use libm::fabs;
use types::Point;

use crate::colour::Colour;
use crate::field::{Face, Field, Post};
use crate::plan::{Cuboid, Wall, WorldPlan};
use crate::shape::{self, Circle, Segment};

/// Radius of a table's leg (m).
pub(crate) const LEG: f64 = 0.025;
/// Thickness of the board of a table with legs (m).
pub(crate) const BOARD: f64 = 0.04;
/// A door belongs to a wall whose middle line passes at most this far from it (m).
const ON_WALL: f64 = 0.05;

/// How a face or a post looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Look {
    pub colour: Colour,
    /// Colour of the upper side.
    pub top: Colour,
    /// Faces of one closed outline share this number; zero is a thin wall, which is seen from both sides.
    pub body: u32,
    /// Whether there is a dark strip along the floor.
    pub skirting: bool,
}

/// The solid world and its looks.
pub(crate) fn raise(plan: &WorldPlan) -> (Field, Vec<Look>) {
    let mut raised = Raised::default();
    for wall in &plan.walls {
        raised.wall(plan, wall);
    }
    for item in &plan.boxes {
        raised.cuboid(item);
    }
    for item in &plan.rounds {
        let look = raised.look(Look { colour: item.colour, top: item.colour, body: 0, skirting: false });
        raised.post(item.at, item.radius, 0.0, item.height, look);
    }
    for tube in plan.landmarks.iter().filter(|landmark| landmark.radius > 0.0) {
        let middle = tube.height / 2.0;
        for (colour, low, high) in [(tube.colour, 0.0, middle), (tube.top, middle, tube.height)] {
            let look = raised.look(Look { colour, top: colour, body: 0, skirting: false });
            raised.post(tube.at, tube.radius, low, high, look);
        }
    }
    for thing in &plan.things {
        // A ball is drawn as a ball; to rays it is as wide as its middle over its whole height.
        let (low, high) = ((thing.height - thing.radius).max(0.0), thing.height + thing.radius);
        raised.post(thing.at, thing.radius, low, high, UNSEEN);
    }
    (Field::new(raised.faces, raised.posts, raised.edges), raised.looks)
}

/// The look of what the camera draws in another way.
pub(crate) const UNSEEN: u32 = u32::MAX;

#[derive(Default)]
struct Raised {
    faces: Vec<Face>,
    posts: Vec<Post>,
    edges: Vec<(Point, f64, f64)>,
    looks: Vec<Look>,
    bodies: u32,
}

impl Raised {
    fn look(&mut self, look: Look) -> u32 {
        self.looks.push(look);
        self.looks.len() as u32 - 1
    }

    fn post(&mut self, centre: Point, radius: f64, low: f64, high: f64, look: u32) {
        self.posts.push(Post { circle: Circle { centre, radius }, low, high, look });
    }

    /// The faces of an outline that runs counter-clockwise.
    fn outline(&mut self, corners: &[Point], low: f64, high: f64, look: u32) {
        for (k, &a) in corners.iter().enumerate() {
            let b = corners[(k + 1) % corners.len()];
            self.faces.push(Face { segment: Segment::new(a, b), low, high, look });
            self.edges.push((a, low, high));
        }
    }

    fn wall(&mut self, plan: &WorldPlan, wall: &Wall) {
        let look = Look { colour: wall.colour, top: wall.colour, body: 0, skirting: true };
        for (a, b) in pieces(plan, wall) {
            if wall.thickness > 0.0 {
                self.bodies += 1;
                let look = self.look(Look { body: self.bodies, ..look });
                let out = Segment::new(a, b).normal * (wall.thickness / 2.0);
                self.outline(&[a + out, b + out, b - out, a - out], 0.0, wall.height, look);
            } else {
                let look = self.look(look);
                self.faces.push(Face { segment: Segment::new(a, b), low: 0.0, high: wall.height, look });
                self.edges.push((a, 0.0, wall.height));
                self.edges.push((b, 0.0, wall.height));
            }
        }
    }

    fn cuboid(&mut self, item: &Cuboid) {
        self.bodies += 1;
        let look = self.look(Look { colour: item.colour, top: item.top, body: self.bodies, skirting: false });
        let corners = shape::rectangle(item.at, item.size, item.angle);
        let low = if item.legs { (item.height - BOARD).max(0.0) } else { 0.0 };
        self.outline(&corners, low, item.height, look);
        if item.legs {
            let inner = Point::new(item.size.x - 4.0 * LEG, item.size.y - 4.0 * LEG);
            let leg =
                self.look(Look { colour: Colour([70, 70, 74]), top: item.top, body: 0, skirting: false });
            for corner in shape::rectangle(item.at, inner, item.angle) {
                self.post(corner, LEG, 0.0, low, leg);
            }
        }
    }
}

/// The straight pieces of a wall that no open door takes away, from where to where its middle line goes. At a corner the pieces of a thick wall
/// overlap, so that it has no notch; at a door they end clean.
pub(crate) fn pieces(plan: &WorldPlan, wall: &Wall) -> Vec<(Point, Point)> {
    let closed = wall.line.len() > 2 && wall.line.first() == wall.line.last();
    let lines = wall.line.len().saturating_sub(1);
    let mut pieces = Vec::new();
    for (k, pair) in wall.line.windows(2).enumerate() {
        let segment = Segment::new(pair[0], pair[1]);
        let extra = wall.thickness / 2.0 / segment.along.norm();
        for (from, to) in solid_parts(plan, &segment) {
            let before = from == 0.0 && (k > 0 || closed);
            let after = to == 1.0 && (k + 1 < lines || closed);
            let a = segment.a + segment.along * (from - if before { extra } else { 0.0 });
            let b = segment.a + segment.along * (to + if after { extra } else { 0.0 });
            pieces.push((a, b));
        }
    }
    pieces
}

/// The parts of a wall's piece that no open door takes away, as fractions of its length.
fn solid_parts(plan: &WorldPlan, segment: &Segment) -> Vec<(f64, f64)> {
    let mut parts: Vec<(f64, f64)> = vec![(0.0, 1.0)];
    for door in &plan.doors {
        let Some((_, place)) = door.open.and_then(|open| door.places.get(open)) else { continue };
        let Some((from, to)) = gap(segment, *place, door.width) else { continue };
        parts = parts
            .into_iter()
            .flat_map(|(a, b)| [(a, b.min(from)), (a.max(to), b)])
            .filter(|(a, b)| b - a > 1e-9)
            .collect();
    }
    parts
}

/// The opening that a door at `place` makes in a piece of wall, as fractions of its length.
fn gap(segment: &Segment, place: Point, width: f64) -> Option<(f64, f64)> {
    let length = segment.along.norm();
    let from = place - segment.a;
    if length == 0.0 || fabs(from.dot(segment.normal)) > ON_WALL {
        return None;
    }
    let middle = from.dot(segment.along) / length;
    let (from, to) = (middle - width / 2.0, middle + width / 2.0);
    (from >= -1e-9 && to <= length + 1e-9).then_some((from / length, to / length))
}

/// Whether a door of this width has room in the wall at `place`.
pub(crate) fn opens(wall: &Wall, place: Point, width: f64) -> bool {
    wall.line.windows(2).any(|pair| gap(&Segment::new(pair[0], pair[1]), place, width).is_some())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::Door;

    #[test]
    fn an_open_door_leaves_its_width_free_and_no_more() {
        for thickness in [0.0, 0.14] {
            let mut plan = WorldPlan::hall(8.0, 6.0);
            plan.walls[0].thickness = thickness;
            plan.doors.push(Door {
                name: "door".into(),
                width: 0.9,
                places: vec![("east".into(), Point::new(8.0, 2.0)), ("north".into(), Point::new(3.0, 6.0))],
                open: Some(0),
            });
            let (field, _) = raise(&plan);
            let through = |field: &Field, y: f64| {
                field.cast(Point::new(4.0, y), Point::new(1.0, 0.0), 6.0, 1.0, u32::MAX).is_none()
            };
            for (y, free) in
                [(1.54, false), (1.56, true), (2.0, true), (2.44, true), (2.46, false), (5.0, false)]
            {
                assert_eq!(through(&field, y), free, "y = {y}, wall of {thickness} m");
            }
            plan.doors[0].open = Some(1);
            assert!(!through(&raise(&plan).0, 2.0), "the door is elsewhere now");
            plan.doors[0].open = None;
            let (field, _) = raise(&plan);
            assert!(field.cast(Point::new(3.0, 3.0), Point::new(0.0, 1.0), 6.0, 1.0, u32::MAX).is_some());
        }
    }

    #[test]
    fn a_table_on_legs_shows_its_legs_below_and_its_board_above() {
        let plan = WorldPlan {
            boxes: vec![Cuboid { at: Point::new(3.0, 0.0), legs: true, ..Cuboid::default() }],
            ..WorldPlan::default()
        };
        let (field, _) = raise(&plan);
        let forward = Point::new(1.0, 0.0);
        assert!(field.cast(Point::default(), forward, 9.0, 0.35, u32::MAX).is_none(), "between the legs");
        let board = field.cast(Point::default(), forward, 9.0, 0.73, u32::MAX).unwrap();
        assert!((board.t - 2.4).abs() < 1e-12);
        let leg = field.cast(Point::new(0.0, 0.25), forward, 9.0, 0.35, u32::MAX).unwrap();
        assert!((leg.t - (3.0 - 0.55 - LEG)).abs() < 1e-12, "{}", leg.t);
    }
}
