//! A known floor: what stands on it as plain data, and how far any point is from what stands there.
//!
//! In plain words: a plan of a building says where its walls are. Whoever wants to know where he is on it lays what he sees over the plan, and
//! needs for each point that he sees the nearest line of the plan, at once.
//!
//! | to have | take |
//! |---|---|
//! | walls, boxes and pillars as numbers | [`FloorPlan`] |
//! | the distance from anywhere to them, exact | [`PlanField`] |
//! | the same for a grid of taken cells, as learned maps are | [`GridField`] |
//! | places on which a robot can stand | [`FreeFloor`] |
//!
//! How it works: the plane is cut into cells, and each cell names the few elements of the plan that can be the nearest to a point in it. The
//! distance to those is reckoned, not looked up: so it is exact where a table would be wrong by up to half a cell next to a wall, which is
//! just where a laser sees its points. A grid of taken cells knows no better than its cells: there the distances between the middles
//! of cells are kept, and mixed for what lies between.

mod element;
mod free;
mod grid;
mod plan_field;
mod read;

pub use free::FreeFloor;
pub use grid::GridField;
pub use plan_field::{PlanField, TooManyElements};

use element::Element;
use types::Point;
use types::geometry::Pose;

/// A straight wall.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wall {
    /// Where its middle line begins (m).
    pub from: Point,
    /// Where it ends (m).
    pub to: Point,
    /// Its thickness (m), half of it to either side; 0 is a line that is seen from both sides.
    pub thickness: f64,
}

/// A round thing: a pillar, a bin.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Disc {
    /// Its middle (m).
    pub centre: Point,
    /// Its radius (m).
    pub radius: f64,
}

/// A rectangular thing: a cupboard, a table with a closed body.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Block {
    /// Its middle, and how far it is turned.
    pub at: Pose,
    /// Length along its heading (m).
    pub length: f64,
    /// Depth across it (m).
    pub depth: f64,
}

/// What stands on a floor and stays there, as a plan of the building shows it. Metres and radians, x to the right, y up.
///
/// In a file: `{ walls = [[x0, y0, x1, y1], [x0, y0, x1, y1, thickness]], discs = [[x, y, radius]], boxes = [[x, y, length, depth, angle]] }`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FloorPlan {
    /// Walls.
    pub walls: Vec<Wall>,
    /// Round things.
    pub discs: Vec<Disc>,
    /// Rectangular things.
    pub boxes: Vec<Block>,
}

/// What is nearest to a point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Nearest {
    /// How far it is (m), not negative.
    pub distance: f64,
    /// The gradient of the distance: where to go to be farther from it. Of length one in a field of exact distances.
    pub away: Point,
}

/// A floor on which one can ask what is nearest.
pub trait Distances {
    /// What is nearest to a point; nothing where all is farther than the field reaches, or outside it.
    fn nearest(&self, at: Point) -> Option<Nearest>;

    /// The square of the distance to what is nearest (m²); nothing where that is farther than the field reaches.
    fn square(&self, at: Point) -> Option<f64> {
        self.nearest(at).map(|nearest| nearest.distance * nearest.distance)
    }

    /// What is nearest to the end of a beam in a direction of length one, of all that it can have met: not the far side of a wall. A field that
    /// knows no sides tells what is nearest.
    fn met(&self, at: Point, direction: Point) -> Option<Nearest> {
        let _ = direction;
        self.nearest(at)
    }

    /// The square of the distance to that (m²).
    fn met_square(&self, at: Point, direction: Point) -> Option<f64> {
        let _ = direction;
        self.square(at)
    }

    /// The lower left and the upper right corner of what the field covers (m).
    fn bounds(&self) -> (Point, Point);

    /// Whether a body of this radius (m, at most the reach of the field) can stand here.
    fn is_free(&self, at: Point, radius: f64) -> bool;

    /// How far a ray goes from a point in a direction of length one before it meets something (m), if it does within `most`.
    fn cast(&self, from: Point, direction: Point, most: f64) -> Option<f64>;
}

impl FloorPlan {
    /// An empty rectangular room with its lower left corner at the origin (m).
    pub fn room(width: f64, depth: f64) -> FloorPlan {
        let mut plan = FloorPlan::default();
        let corners = [(0.0, 0.0), (width, 0.0), (width, depth), (0.0, depth), (0.0, 0.0)];
        plan.line(&corners.map(|(x, y)| Point::new(x, y)));
        plan
    }

    /// Adds thin walls from each point to the next.
    pub fn line(&mut self, points: &[Point]) {
        let pieces = points.windows(2).map(|pair| Wall { from: pair[0], to: pair[1], thickness: 0.0 });
        self.walls.extend(pieces);
    }

    /// Whether nothing stands on it.
    pub fn is_empty(&self) -> bool {
        self.walls.is_empty() && self.discs.is_empty() && self.boxes.is_empty()
    }

    /// The lower left and the upper right corner of all that stands on it (m); nothing where nothing does.
    pub fn bounds(&self) -> Option<(Point, Point)> {
        let blocks = self.walls.iter().filter_map(Wall::block).chain(self.boxes.iter().copied());
        let walls = self.walls.iter().flat_map(|wall| [wall.from, wall.to]);
        let discs = self.discs.iter().flat_map(|disc| {
            let corner = Point::new(disc.radius, disc.radius);
            [disc.centre - corner, disc.centre + corner]
        });
        let points = blocks.flat_map(|block| block.corners()).chain(walls).chain(discs);
        points.map(|point| (point, point)).reduce(|(low, high), (point, _)| {
            let low = Point::new(low.x.min(point.x), low.y.min(point.y));
            (low, Point::new(high.x.max(point.x), high.y.max(point.y)))
        })
    }

    /// The lines and circles that are seen of it.
    fn elements(&self) -> Vec<Element> {
        let mut out = Vec::new();
        let blocks = self.walls.iter().filter_map(Wall::block).chain(self.boxes.iter().copied());
        for block in blocks {
            let corners = block.corners();
            out.extend((0..4).map(|i| Element::side(corners[i], corners[(i + 1) % 4])));
        }
        let thin = self.walls.iter().filter(|wall| wall.thickness <= 0.0);
        out.extend(thin.map(|wall| Element::segment(wall.from, wall.to)));
        out.extend(self.discs.iter().map(|disc| Element::circle(disc.centre, disc.radius)));
        out
    }

    /// Whether a point is inside something.
    fn is_solid(&self, at: Point) -> bool {
        self.discs.iter().any(|disc| (at - disc.centre).is_within(disc.radius))
            || self.boxes.iter().any(|block| block.contains(at))
            || self.walls.iter().filter_map(Wall::block).any(|block| block.contains(at))
    }
}

impl Wall {
    /// The body of a wall that has a thickness.
    fn block(&self) -> Option<Block> {
        let along = self.to - self.from;
        let middle = self.from + along * 0.5;
        let at = Pose::new(middle.x, middle.y, along.bearing());
        (self.thickness > 0.0).then(|| Block { at, length: along.norm(), depth: self.thickness })
    }
}

impl Block {
    fn corners(&self) -> [Point; 4] {
        let (x, y) = (self.length / 2.0, self.depth / 2.0);
        [(x, y), (-x, y), (-x, -y), (x, -y)].map(|(x, y)| self.at.transform(Point::new(x, y)))
    }

    fn contains(&self, at: Point) -> bool {
        let inside = self.at.inverse().transform(at);
        inside.x.abs() <= self.length / 2.0 && inside.y.abs() <= self.depth / 2.0
    }
}

#[cfg(test)]
mod tests;
