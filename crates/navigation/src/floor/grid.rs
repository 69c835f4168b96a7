//! Distances to the taken cells of a grid.

use libm::{fabs, sqrt};
use types::Point;
use types::geometry::whole;

use super::{Distances, Nearest};

/// How far any point is from the middle of a taken cell: exact at the middles of cells, mixed from four of them in between.
///
/// A laser that found a wall in a cell found it, on average, in the middle of it. All memory is taken when it is made: 4 bytes a cell, and as much
/// again while it is made.
#[derive(Clone, Debug)]
pub struct GridField {
    corner: Point,
    cell: f64,
    width: i32,
    height: i32,
    /// Distances of the middles (m).
    distances: Vec<f32>,
    reach: f32,
    /// Of each cell whether it is known what is there; nothing where all are.
    known: Option<Box<[bool]>>,
}

/// Farther than anything on a grid (cells).
const FAR: f64 = 1e9;

impl GridField {
    /// The field of a grid whose first cell has its lower left corner at `corner`. `is_taken` tells of each column and row: of a grid of
    /// log-odds those above the level that counts as taken. Farther than `reach` (m) nothing is told.
    pub fn new(
        corner: Point,
        cell: f64,
        (width, height): (u32, u32),
        reach: f64,
        is_taken: impl Fn(u32, u32) -> bool,
    ) -> GridField {
        let (columns, rows) = (width as usize, height as usize);
        let mut squares = vec![FAR; columns * rows];
        for (place, square) in squares.iter_mut().enumerate() {
            if is_taken((place % columns.max(1)) as u32, (place / columns.max(1)) as u32) {
                *square = 0.0;
            }
        }
        transform(&mut squares, columns, rows);
        let distances = squares.iter().map(|square| (sqrt(*square) * cell) as f32).collect();
        GridField {
            corner,
            cell,
            width: width as i32,
            height: height as i32,
            distances,
            reach: reach as f32,
            known: None,
        }
    }

    /// The same field, of which only these cells (column, row) are known: in the others nobody stands. A learned map says nothing of what is behind
    /// its walls, and a robot that is searched for there too is searched for in vain, and found late.
    pub fn known_only(mut self, is_known: impl Fn(u32, u32) -> bool) -> GridField {
        let columns = (self.width as usize).max(1);
        let known = (0..self.distances.len())
            .map(|place| is_known((place % columns) as u32, (place / columns) as u32));
        self.known = Some(known.collect());
        self
    }

    fn at(&self, x: i32, y: i32) -> f64 {
        let (x, y) = (x.clamp(0, self.width - 1), y.clamp(0, self.height - 1));
        self.distances[(y * self.width + x) as usize].into()
    }
}

/// Puts the square of the distance to the nearest zero into every cell (cells²): the exact transform of Felzenszwalb and Huttenlocher 2012,
/// "Distance Transforms of Sampled Functions", one dimension after the other.
fn transform(squares: &mut [f64], width: usize, height: usize) {
    let longest = width.max(height);
    let mut line = Envelope::new(longest);
    for x in 0..width {
        line.run(squares, x, width, height);
    }
    for y in 0..height {
        line.run(squares, y * width, 1, width);
    }
}

/// The lower envelope of the parabolas that stand on a line of cells.
struct Envelope {
    values: Vec<f64>,
    feet: Vec<usize>,
    /// Where the parabola of the same number begins to be the lowest.
    begins: Vec<f64>,
}

impl Envelope {
    fn new(longest: usize) -> Envelope {
        Envelope { values: vec![0.0; longest], feet: vec![0; longest], begins: vec![0.0; longest + 1] }
    }

    /// Transforms the cells `first`, `first + step` … in place.
    fn run(&mut self, squares: &mut [f64], first: usize, step: usize, count: usize) {
        for i in 0..count {
            self.values[i] = squares[first + i * step];
        }
        let mut top = 0;
        (self.feet[0], self.begins[0], self.begins[1]) = (0, f64::NEG_INFINITY, f64::INFINITY);
        for i in 1..count {
            let mut meets = self.meets(i, self.feet[top]);
            while meets <= self.begins[top] {
                top -= 1;
                meets = self.meets(i, self.feet[top]);
            }
            top += 1;
            (self.feet[top], self.begins[top], self.begins[top + 1]) = (i, meets, f64::INFINITY);
        }
        let mut at = 0;
        for i in 0..count {
            while self.begins[at + 1] < i as f64 {
                at += 1;
            }
            let off = i as f64 - self.feet[at] as f64;
            squares[first + i * step] = off * off + self.values[self.feet[at]];
        }
    }

    /// Where two parabolas are equally low.
    fn meets(&self, a: usize, b: usize) -> f64 {
        let height = |i: usize| self.values[i] + (i * i) as f64;
        (height(a) - height(b)) / (2.0 * (a as f64 - b as f64))
    }
}

impl Distances for GridField {
    fn nearest(&self, at: Point) -> Option<Nearest> {
        let off = (at - self.corner) * (1.0 / self.cell) - Point::new(0.5, 0.5);
        let (x, y) = (whole(off.x), whole(off.y));
        if !(-1..self.width).contains(&x) || !(-1..self.height).contains(&y) {
            return None;
        }
        let (u, v) = (off.x - f64::from(x), off.y - f64::from(y));
        let [low, right, up, both] = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| self.at(x + dx, y + dy));
        let mix = |a: f64, b: f64, part: f64| a + (b - a) * part;
        let distance = mix(mix(low, right, u), mix(up, both, u), v);
        let slope = Point::new(mix(right - low, both - up, v), mix(up - low, both - right, u));
        (distance <= f64::from(self.reach)).then(|| Nearest { distance, away: slope * (1.0 / self.cell) })
    }

    fn bounds(&self) -> (Point, Point) {
        let size = Point::new(f64::from(self.width), f64::from(self.height)) * self.cell;
        (self.corner, self.corner + size)
    }

    fn is_free(&self, at: Point, radius: f64) -> bool {
        let off = (at - self.corner) * (1.0 / self.cell);
        let (x, y) = (whole(off.x), whole(off.y));
        if !(0..self.width).contains(&x) || !(0..self.height).contains(&y) {
            return false;
        }
        let place = (y * self.width + x) as usize;
        // Of what stands in a taken cell half may reach out of its middle.
        self.known.as_ref().is_none_or(|known| known[place])
            && f64::from(self.distances[place]) > radius + self.cell / 2.0
    }

    /// Sphere tracing: as far as nothing is near nothing can be met. What is met is told to a quarter of a cell.
    fn cast(&self, from: Point, direction: Point, most: f64) -> Option<f64> {
        let close = self.cell / 4.0;
        let mut t = 0.0;
        while t <= most {
            let nearest = self.nearest(from + direction * t);
            let free = nearest.map_or(f64::from(self.reach), |nearest| fabs(nearest.distance));
            if free <= close {
                return Some(t);
            }
            // Between the middles of cells the mixed distance may be too large by less than half a cell.
            t += (free - self.cell / 2.0).max(close);
        }
        None
    }
}
