//! The solid things of a world in a uniform grid: rays walk it cell by cell, bodies move from cell to cell.
//!
//! The cost of a ray grows with the cells it crosses and what lies in them, not with the world.
//! The walk is that of Amanatides and Woo, "A fast voxel traversal algorithm for ray tracing" (1987).

use libm::{fabs, floor, sqrt};
use types::Point;

use crate::shape::{Circle, Segment};
use crate::solid::{Rectangle, Solid};

/// Side of a cell (m). About the size of a robot: a body lies in four cells, a cell holds few segments.
const CELL: f64 = 0.5;
/// Free room around everything (m), so that a robot that left a world without walls is still in the grid.
const MARGIN: f64 = 2.0;

/// So many bodies find place in one cell beforehand; more have no room in it unless they stand on one another.
const CROWD: usize = 8;

const HAS_STATIC: u8 = 1;
const HAS_BODY: u8 = 2;

/// A straight face that stands still.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Face {
    pub segment: Segment,
    /// Lower and upper end (m above the floor).
    pub low: f64,
    pub high: f64,
    /// Index of its look.
    pub look: u32,
}

/// An upright cylinder that stands still.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Post {
    pub circle: Circle,
    pub low: f64,
    pub high: f64,
    pub look: u32,
}

/// An upright cylinder or box that moves: a robot or a person.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Body {
    pub solid: Solid,
    pub high: f64,
    /// Whether it is somebody who walks by himself.
    pub person: bool,
    /// A body that is hidden touches nothing and is seen by nothing.
    pub present: bool,
}

/// What a ray met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Met {
    Face(u32),
    Post(u32),
    Body(u32),
}

/// Where a ray met something, in lengths of its direction vector.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hit {
    pub t: f64,
    pub met: Met,
}

/// How near the nearest solid thing is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Near {
    /// From the centre or rim that was asked for to the surface (m).
    pub distance: f64,
    /// The nearest point of its surface.
    pub point: Point,
    /// Whose it is, when it is that of a body.
    pub body: Option<u32>,
}

/// Of `count` cells in a row the one at `offset` (m) from its begin, or the one nearest to there.
#[inline]
fn cell_at(offset: f64, count: u32) -> u32 {
    // Cutting off is rounding down above zero, and gives zero below.
    ((offset / CELL) as u32).min(count - 1)
}

/// How a ray crosses the cells along one axis.
struct Crossing {
    /// Where the ray leaves the present cell, in lengths of its direction.
    out: f64,
    /// From there to where it leaves the next.
    apart: f64,
    /// How many cells come before the border of the grid.
    left: u32,
    forward: bool,
}

impl Crossing {
    /// From cell `index` of `count`, for a ray that begins at `from` and goes `along` this axis; `inverse` is 1 / `along`.
    #[inline]
    fn new(index: u32, count: u32, from: f64, along: f64, inverse: f64) -> Crossing {
        let forward = along > 0.0;
        let left = if forward { count - 1 - index } else { index };
        if along == 0.0 {
            return Crossing { out: f64::INFINITY, apart: f64::INFINITY, left, forward };
        }
        let border = f64::from(index + u32::from(forward)) * CELL;
        Crossing { out: (border - from) * inverse, apart: CELL * fabs(inverse), left, forward }
    }

    /// Goes on to the next cell, which is `stride` away in the row of all cells, if there is one.
    #[inline]
    fn step(&mut self, cell: &mut usize, stride: u32) -> bool {
        let Some(left) = self.left.checked_sub(1) else { return false };
        self.left = left;
        self.out += self.apart;
        *cell = if self.forward { *cell + stride as usize } else { *cell - stride as usize };
        true
    }
}

/// Cells from `first` to `last` on both axes, both included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Block {
    first: (u32, u32),
    last: (u32, u32),
}

/// Everything solid, in cells.
#[derive(Clone, Debug)]
pub(crate) struct Field {
    min: Point,
    columns: u32,
    rows: u32,
    flags: Vec<u8>,
    /// Where the entries of a cell begin, in `faces_in` and `posts_in`; one more than there are cells.
    face_start: Vec<u32>,
    faces_in: Vec<u32>,
    post_start: Vec<u32>,
    posts_in: Vec<u32>,
    edge_start: Vec<u32>,
    edges_in: Vec<u32>,
    bodies_in: Vec<Vec<u32>>,
    pub faces: Vec<Face>,
    pub posts: Vec<Post>,
    /// Upright edges, with the span of heights in which they stand: they scatter sound to all sides.
    pub edges: Vec<(Point, f64, f64)>,
    pub bodies: Vec<Body>,
    /// The cells of each body; none of one that is nowhere.
    blocks: Vec<Option<Block>>,
}

impl Field {
    pub(crate) fn new(faces: Vec<Face>, posts: Vec<Post>, edges: Vec<(Point, f64, f64)>) -> Field {
        let mut min = Point::new(0.0, 0.0);
        let mut max = Point::new(0.0, 0.0);
        let mut first = true;
        let mut include = |p: Point, r: f64| {
            let (low, high) = (Point::new(p.x - r, p.y - r), Point::new(p.x + r, p.y + r));
            if first {
                (min, max, first) = (low, high, false);
            }
            min = Point::new(min.x.min(low.x), min.y.min(low.y));
            max = Point::new(max.x.max(high.x), max.y.max(high.y));
        };
        for face in &faces {
            include(face.segment.a, 0.0);
            include(face.segment.b(), 0.0);
        }
        for post in &posts {
            include(post.circle.centre, post.circle.radius);
        }
        let min = min - Point::new(MARGIN, MARGIN);
        let columns = (floor((max.x + MARGIN - min.x) / CELL) + 1.0) as u32;
        let rows = (floor((max.y + MARGIN - min.y) / CELL) + 1.0) as u32;
        let cells = (columns * rows) as usize;
        let mut field = Field {
            min,
            columns,
            rows,
            flags: vec![0; cells],
            face_start: Vec::new(),
            faces_in: Vec::new(),
            post_start: Vec::new(),
            posts_in: Vec::new(),
            edge_start: Vec::new(),
            edges_in: Vec::new(),
            bodies_in: vec![Vec::new(); cells],
            faces: Vec::new(),
            posts: Vec::new(),
            edges: Vec::new(),
            bodies: Vec::new(),
            blocks: Vec::new(),
        };
        (field.face_start, field.faces_in) = field.sort(&faces, |face, field| {
            let (a, b) = (face.segment.a, face.segment.b());
            let block =
                field.block(Point::new(a.x.min(b.x), a.y.min(b.y)), Point::new(a.x.max(b.x), a.y.max(b.y)));
            (block, Some(face.segment))
        });
        (field.post_start, field.posts_in) = field
            .sort(&posts, |post, field| (field.block_around(post.circle.centre, post.circle.radius), None));
        (field.edge_start, field.edges_in) =
            field.sort(&edges, |edge, field| (field.block_around(edge.0, 0.0), None));
        for cell in 0..cells {
            if field.face_start[cell] < field.face_start[cell + 1]
                || field.post_start[cell] < field.post_start[cell + 1]
            {
                field.flags[cell] = HAS_STATIC;
            }
        }
        (field.faces, field.posts, field.edges) = (faces, posts, edges);
        field
    }

    /// Sorts items into cells: a counting sort, so that the order in a cell is the order of the file.
    fn sort<T>(
        &self,
        items: &[T],
        place: impl Fn(&T, &Field) -> (Block, Option<Segment>),
    ) -> (Vec<u32>, Vec<u32>) {
        let mut pairs = Vec::new();
        for (index, item) in items.iter().enumerate() {
            let (block, segment) = place(item, self);
            for cell in self.cells(block) {
                if segment.is_none_or(|segment| self.crosses(cell, &segment)) {
                    pairs.push((cell as u32, index as u32));
                }
            }
        }
        pairs.sort_unstable();
        let mut start = vec![0u32; self.flags.len() + 1];
        for &(cell, _) in &pairs {
            start[cell as usize + 1] += 1;
        }
        for cell in 0..self.flags.len() {
            start[cell + 1] += start[cell];
        }
        (start, pairs.into_iter().map(|(_, index)| index).collect())
    }

    /// Whether a segment may pass through a cell: by its distance from the line of the segment.
    fn crosses(&self, cell: usize, segment: &Segment) -> bool {
        let (ix, iy) = (cell as u32 % self.columns, cell as u32 / self.columns);
        let half = CELL / 2.0 + 1e-9;
        let centre =
            Point::new(self.min.x + (f64::from(ix) + 0.5) * CELL, self.min.y + (f64::from(iy) + 0.5) * CELL);
        let off = fabs((centre - segment.a).dot(segment.normal));
        off <= half * (fabs(segment.normal.x) + fabs(segment.normal.y))
    }

    fn column(&self, x: f64) -> u32 {
        cell_at(x - self.min.x, self.columns)
    }

    fn row(&self, y: f64) -> u32 {
        cell_at(y - self.min.y, self.rows)
    }

    fn block(&self, min: Point, max: Point) -> Block {
        // A hair more on both sides: what touches the border of a cell belongs to both cells.
        Block {
            first: (self.column(min.x - 1e-9), self.row(min.y - 1e-9)),
            last: (self.column(max.x + 1e-9), self.row(max.y + 1e-9)),
        }
    }

    fn block_around(&self, centre: Point, radius: f64) -> Block {
        self.block(centre - Point::new(radius, radius), centre + Point::new(radius, radius))
    }

    fn cells(&self, block: Block) -> impl Iterator<Item = usize> + use<> {
        let columns = self.columns;
        (block.first.1..=block.last.1)
            .flat_map(move |iy| (block.first.0..=block.last.0).map(move |ix| (iy * columns + ix) as usize))
    }

    /// Adds a body and gives its number.
    pub(crate) fn add_body(&mut self, body: Body) -> u32 {
        let id = self.add_hidden();
        self.bodies[id as usize] = body;
        self.place_body(id, body.solid);
        id
    }

    /// Adds a body that is nowhere until it is placed, and gives its number.
    pub(crate) fn add_hidden(&mut self) -> u32 {
        let id = self.bodies.len() as u32;
        let solid = Solid::Round(Circle { centre: Point::new(0.0, 0.0), radius: 0.0 });
        self.bodies.push(Body { solid, high: 0.0, person: false, present: false });
        self.blocks.push(None);
        // A body that comes into a cell later finds its place there, without new memory.
        let room = self.bodies.len().min(CROWD);
        self.bodies_in.iter_mut().for_each(|bodies| bodies.reserve(room.saturating_sub(bodies.len())));
        id
    }

    /// Moves a body.
    pub(crate) fn place_body(&mut self, id: u32, solid: Solid) {
        let index = id as usize;
        self.bodies[index].solid = solid;
        let (min, max) = solid.bounds();
        let block = self.block(min, max);
        if self.blocks[index] == Some(block) {
            return;
        }
        self.leave(id);
        self.blocks[index] = Some(block);
        self.enter(id, block);
    }

    /// Takes a body away: it is nowhere until it is placed again.
    pub(crate) fn hide_body(&mut self, id: u32) {
        self.leave(id);
        self.bodies[id as usize].present = false;
    }

    fn leave(&mut self, id: u32) {
        let Some(old) = self.blocks[id as usize].take() else { return };
        for cell in self.cells(old) {
            self.bodies_in[cell].retain(|&other| other != id);
            if self.bodies_in[cell].is_empty() {
                self.flags[cell] &= !HAS_BODY;
            }
        }
    }

    fn enter(&mut self, id: u32, block: Block) {
        for cell in self.cells(block) {
            let bodies = &mut self.bodies_in[cell];
            // Kept in order, so that what is met does not depend on who came first.
            let at = bodies.partition_point(|&other| other < id);
            bodies.insert(at, id);
            self.flags[cell] |= HAS_BODY;
        }
    }

    /// Visits the cells along a ray in order, with the `t` at which the ray leaves each, until `visit` says stop.
    #[inline]
    pub(crate) fn walk(
        &self,
        origin: Point,
        direction: Point,
        limit: f64,
        mut visit: impl FnMut(usize, f64) -> bool,
    ) {
        let from = origin - self.min;
        let inverse = Point::new(1.0 / direction.x, 1.0 / direction.y);
        let Some((enter, leave)) = self.clip(from, direction, inverse, limit) else { return };
        let at = from + direction * enter;
        let (ix, iy) = (cell_at(at.x, self.columns), cell_at(at.y, self.rows));
        let mut x = Crossing::new(ix, self.columns, from.x, direction.x, inverse.x);
        let mut y = Crossing::new(iy, self.rows, from.y, direction.y, inverse.y);
        let mut cell = (iy * self.columns + ix) as usize;
        loop {
            let sideways = x.out < y.out;
            let out = if sideways { x.out } else { y.out };
            if visit(cell, out) || out >= leave {
                return;
            }
            let goes_on = if sideways { x.step(&mut cell, 1) } else { y.step(&mut cell, self.columns) };
            if !goes_on {
                return;
            }
        }
    }

    /// The `t` between which a ray may be in the grid; nothing when it passes by.
    #[inline]
    fn clip(&self, from: Point, direction: Point, inverse: Point, limit: f64) -> Option<(f64, f64)> {
        let size = Point::new(f64::from(self.columns) * CELL, f64::from(self.rows) * CELL);
        // A ray from inside ends at the border by itself; only a robot that got lost casts one from outside.
        if from.x >= 0.0 && from.x <= size.x && from.y >= 0.0 && from.y <= size.y {
            return Some((0.0, limit));
        }
        let (mut enter, mut leave) = (0.0f64, limit);
        for (o, d, inv, size) in
            [(from.x, direction.x, inverse.x, size.x), (from.y, direction.y, inverse.y, size.y)]
        {
            if d == 0.0 {
                if o < 0.0 || o > size {
                    return None;
                }
            } else {
                let (a, b) = (-o * inv, (size - o) * inv);
                enter = enter.max(a.min(b));
                leave = leave.min(a.max(b));
            }
        }
        (enter <= leave).then_some((enter, leave))
    }

    /// The faces of one cell.
    #[inline]
    pub(crate) fn faces_of(&self, cell: usize) -> &[u32] {
        &self.faces_in[self.face_start[cell] as usize..self.face_start[cell + 1] as usize]
    }

    /// The posts of one cell.
    #[inline]
    pub(crate) fn posts_of(&self, cell: usize) -> &[u32] {
        &self.posts_in[self.post_start[cell] as usize..self.post_start[cell + 1] as usize]
    }

    /// Whether something that stands still lies in this cell.
    #[inline]
    pub(crate) fn has_static(&self, cell: usize) -> bool {
        self.flags[cell] & HAS_STATIC != 0
    }

    /// The first thing at this height that a ray meets before `limit`; `skip` is a body it passes through.
    #[inline]
    pub(crate) fn cast(
        &self,
        origin: Point,
        direction: Point,
        limit: f64,
        height: f64,
        skip: u32,
    ) -> Option<Hit> {
        let mut best = limit;
        let mut met = None;
        self.walk(origin, direction, limit, |cell, out| {
            let flags = self.flags[cell];
            if flags & HAS_STATIC != 0 {
                for &index in self.faces_of(cell) {
                    let face = &self.faces[index as usize];
                    if let Some(t) = face.segment.meet(origin, direction, best)
                        && face.low <= height
                        && height <= face.high
                    {
                        (best, met) = (t, Some(Met::Face(index)));
                    }
                }
                for &index in self.posts_of(cell) {
                    let post = &self.posts[index as usize];
                    if let Some(t) = post.circle.meet(origin, direction, best)
                        && post.low <= height
                        && height <= post.high
                    {
                        (best, met) = (t, Some(Met::Post(index)));
                    }
                }
            }
            if flags & HAS_BODY != 0 {
                for &index in &self.bodies_in[cell] {
                    let body = &self.bodies[index as usize];
                    if index != skip
                        && let Some(t) = body.solid.meet(origin, direction, best)
                        && body.present
                        && height <= body.high
                    {
                        (best, met) = (t, Some(Met::Body(index)));
                    }
                }
            }
            best <= out
        });
        met.map(|met| Hit { t: best, met })
    }

    /// The nearest solid thing below `height` whose surface is less than `limit` from `centre`; `skip` is a body left out.
    pub(crate) fn nearest(&self, centre: Point, limit: f64, height: f64, skip: u32) -> Option<Near> {
        let mut best: Option<Near> = None;
        let mut reach = limit;
        let mut offer = |point: Point, distance: f64, body: Option<u32>| {
            if distance < reach {
                reach = distance;
                best = Some(Near { distance, point, body });
            }
        };
        for cell in self.cells(self.block_around(centre, limit)) {
            let flags = self.flags[cell];
            if flags & HAS_STATIC != 0 {
                for &index in self.faces_of(cell) {
                    let face = &self.faces[index as usize];
                    if face.low < height {
                        let point = face.segment.nearest(centre);
                        let away = point - centre;
                        offer(point, sqrt(away.dot(away)), None);
                    }
                }
                for &index in self.posts_of(cell) {
                    let post = &self.posts[index as usize];
                    if post.low < height {
                        let (distance, point) = post.circle.gap(centre);
                        offer(point, distance, None);
                    }
                }
            }
            if flags & HAS_BODY != 0 {
                for &index in &self.bodies_in[cell] {
                    let body = &self.bodies[index as usize];
                    if index != skip && body.present {
                        let (distance, point) = body.solid.gap_to_point(centre);
                        offer(point, distance, Some(index));
                    }
                }
            }
        }
        best
    }

    /// The nearest solid thing below `height` whose surface is less than `limit` from that of `solid` (m); `skip` is a body left out.
    pub(crate) fn clearance(&self, solid: &Solid, limit: f64, height: f64, skip: u32) -> Option<Near> {
        match solid {
            Solid::Round(Circle { centre, radius }) => {
                let near = self.nearest(*centre, radius + limit, height, skip)?;
                Some(Near { distance: near.distance - radius, ..near })
            }
            Solid::Square(rectangle) => self.nearest_to(rectangle, limit, height, skip),
        }
    }

    fn nearest_to(&self, this: &Rectangle, limit: f64, height: f64, skip: u32) -> Option<Near> {
        let mut best: Option<Near> = None;
        let mut reach = limit;
        let mut offer = |(distance, point): (f64, Point), body: Option<u32>| {
            if distance < reach {
                reach = distance;
                best = Some(Near { distance, point, body });
            }
        };
        let (min, max) = Solid::Square(*this).bounds();
        let margin = Point::new(limit, limit);
        for cell in self.cells(self.block(min - margin, max + margin)) {
            let flags = self.flags[cell];
            if flags & HAS_STATIC != 0 {
                let faces = self.faces_of(cell).iter().map(|&index| &self.faces[index as usize]);
                for face in faces.filter(|face| face.low < height) {
                    offer(this.gap_to_segment(&face.segment), None);
                }
                let posts = self.posts_of(cell).iter().map(|&index| &self.posts[index as usize]);
                for post in posts.filter(|post| post.low < height) {
                    offer(this.gap_to_circle(post.circle), None);
                }
            }
            if flags & HAS_BODY != 0 {
                for &index in self.bodies_in[cell].iter().filter(|&&index| index != skip) {
                    let body = &self.bodies[index as usize];
                    if body.present {
                        offer(Solid::Square(*this).gap_to(&body.solid), Some(index));
                    }
                }
            }
        }
        best
    }

    /// Visits upright edges and small round things around a rectangle of cells; each may come more than once.
    pub(crate) fn scatterers(&self, min: Point, max: Point, mut visit: impl FnMut(Scatterer)) {
        let Block { first, last } = self.block(min, max);
        for row in first.1..=last.1 {
            // Cells of a row lie one after another, and so does what is in them.
            let cells = (row * self.columns + first.0) as usize..(row * self.columns + last.0 + 1) as usize;
            let within = |start: &[u32]| start[cells.start] as usize..start[cells.end] as usize;
            for &index in &self.edges_in[within(&self.edge_start)] {
                visit(Scatterer::Edge(index));
            }
            for &index in &self.posts_in[within(&self.post_start)] {
                visit(Scatterer::Post(index));
            }
            for cell in cells {
                if self.flags[cell] & HAS_BODY != 0 {
                    self.bodies_in[cell].iter().for_each(|&index| visit(Scatterer::Body(index)));
                }
            }
        }
    }

    /// The corners of the whole.
    pub(crate) fn bounds(&self) -> (Point, Point) {
        let size = Point::new(f64::from(self.columns) * CELL, f64::from(self.rows) * CELL);
        let margin = Point::new(MARGIN, MARGIN);
        (self.min + margin, self.min + size - margin)
    }
}

/// What sends sound back to all sides.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Scatterer {
    Edge(u32),
    Post(u32),
    Body(u32),
}

#[cfg(test)]
mod tests {
    use super::*;
    use types::chance::Stream;
    use types::geometry::TAU;

    const NOBODY: u32 = u32::MAX;

    fn crowd() -> Field {
        let stream = Stream::new(3, "crowd");
        let mut faces = Vec::new();
        let mut posts = Vec::new();
        for k in 0..60 {
            let draw = stream.sample(k);
            let a = Point::new(draw.between(0, -6.0, 6.0), draw.between(1, -6.0, 6.0));
            let b = a + Point::polar(draw.between(2, 0.05, 4.0), draw.between(3, 0.0, TAU));
            faces.push(Face { segment: Segment::new(a, b), low: 0.0, high: 1.0, look: 0 });
            let centre = Point::new(draw.between(4, -6.0, 6.0), draw.between(5, -6.0, 6.0));
            let circle = Circle { centre, radius: draw.between(6, 0.02, 0.9) };
            posts.push(Post { circle, low: 0.0, high: 1.0, look: 0 });
        }
        let edges = faces.iter().map(|face| (face.segment.a, 0.0, 1.0)).collect();
        let mut field = Field::new(faces, posts, edges);
        for k in 0..20 {
            let draw = stream.sample(1000 + k);
            let solid = Solid::Round(Circle { centre: Point::new(0.0, 0.0), radius: 0.3 });
            let id = field.add_body(Body { solid, high: 1.7, person: false, present: k % 7 != 0 });
            let centre = Point::new(draw.between(0, -6.0, 6.0), draw.between(1, -6.0, 6.0));
            let solid = if k % 3 == 0 {
                let pose = types::Pose::new(centre.x, centre.y, draw.between(2, 0.0, TAU));
                Solid::Square(Rectangle::new(pose, draw.between(3, 0.1, 2.0), draw.between(4, 0.1, 1.0), 0.1))
            } else {
                Solid::Round(Circle { centre, radius: 0.3 })
            };
            field.place_body(id, solid);
        }
        field
    }

    fn by_hand(field: &Field, origin: Point, direction: Point, limit: f64) -> f64 {
        let mut best = limit;
        for face in &field.faces {
            best = face.segment.meet(origin, direction, best).unwrap_or(best);
        }
        for post in &field.posts {
            best = post.circle.meet(origin, direction, best).unwrap_or(best);
        }
        for body in field.bodies.iter().filter(|body| body.present) {
            best = body.solid.meet(origin, direction, best).unwrap_or(best);
        }
        best
    }

    proptest::proptest! {
        #[test]
        fn the_walk_finds_what_a_search_of_everything_finds(
            x in -18f64..18., y in -18f64..18., angle in 0f64..TAU, limit in 0.1f64..40.
        ) {
            // Places inside the grid and outside of it.
            let field = crowd();
            let (origin, direction) = (Point::new(x, y), Point::polar(1.0, angle));
            let found = field.cast(origin, direction, limit, 0.5, NOBODY).map_or(limit, |hit| hit.t);
            proptest::prop_assert_eq!(found, by_hand(&field, origin, direction, limit));
        }

        #[test]
        fn a_rectangle_gives_all_that_scatters_in_it(
            x in -12f64..12., y in -12f64..12., wide in 0f64..9., high in 0f64..9.
        ) {
            let field = crowd();
            let (min, max) = (Point::new(x, y), Point::new(x + wide, y + high));
            let inside = |p: Point| min.x <= p.x && p.x <= max.x && min.y <= p.y && p.y <= max.y;
            let mut seen = [[false; 60]; 3];
            field.scatterers(min, max, |what| match what {
                Scatterer::Edge(k) => seen[0][k as usize] = true,
                Scatterer::Post(k) => seen[1][k as usize] = true,
                Scatterer::Body(k) => seen[2][k as usize] = true,
            });
            for (k, edge) in field.edges.iter().enumerate() {
                proptest::prop_assert!(seen[0][k] || !inside(edge.0), "edge {}", k);
            }
            for (k, post) in field.posts.iter().enumerate() {
                proptest::prop_assert!(seen[1][k] || !inside(post.circle.centre), "post {}", k);
            }
            for (k, body) in field.bodies.iter().enumerate() {
                let (low, high) = body.solid.bounds();
                proptest::prop_assert!(seen[2][k] || !inside((low + high) * 0.5), "body {}", k);
            }
        }

        #[test]
        fn the_nearest_is_the_nearest_of_all(x in -6f64..6., y in -6f64..6., limit in 0.1f64..4.) {
            let field = crowd();
            let centre = Point::new(x, y);
            let found = field.nearest(centre, limit, 0.5, NOBODY).map_or(limit, |near| near.distance);
            let mut best = limit;
            for face in &field.faces {
                best = best.min(face.segment.nearest(centre).distance(centre));
            }
            for post in &field.posts {
                best = best.min(post.circle.centre.distance(centre) - post.circle.radius);
            }
            for body in field.bodies.iter().filter(|body| body.present) {
                best = best.min(body.solid.gap_to_point(centre).0);
            }
            proptest::prop_assert!((found - best).abs() < 1e-12, "{} {}", found, best);
        }

        #[test]
        fn the_nearest_to_a_rectangle_is_the_nearest_of_all(
            x in -6f64..6., y in -6f64..6., turn in 0f64..TAU, length in 0.1f64..1., limit in 0.1f64..2.
        ) {
            let field = crowd();
            let this = Rectangle::new(types::Pose::new(x, y, turn), length, 0.4, 0.1);
            let found = field.clearance(&Solid::Square(this), limit, 0.5, NOBODY).map_or(limit, |near| near.distance);
            let mut best = limit;
            for face in &field.faces {
                best = best.min(this.gap_to_segment(&face.segment).0);
            }
            for post in &field.posts {
                best = best.min(this.gap_to_circle(post.circle).0);
            }
            for body in field.bodies.iter().filter(|body| body.present) {
                best = best.min(match &body.solid {
                    Solid::Round(circle) => this.gap_to_circle(*circle).0,
                    Solid::Square(other) => this.gap_to_rectangle(other).0,
                });
            }
            proptest::prop_assert!((found - best).abs() < 1e-12, "{} {}", found, best);
        }
    }

    #[test]
    fn rays_along_the_borders_of_cells_meet_walls_across_them() {
        let wall = Segment::new(Point::new(2.0, -2.0), Point::new(2.0, 2.0));
        let field =
            Field::new(vec![Face { segment: wall, low: 0.0, high: 1.0, look: 0 }], Vec::new(), Vec::new());
        for y in [-1.5, -1.0, -0.5, 0.0, 0.5, 1.0] {
            let hit = field.cast(Point::new(0.0, y), Point::new(1.0, 0.0), 9.0, 0.5, NOBODY).unwrap();
            assert_eq!(hit.t, 2.0);
        }
    }
}
