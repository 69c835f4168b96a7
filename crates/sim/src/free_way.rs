//! Whether a robot can get through at all: a flood over a fine grid.

use libm::{ceil, floor, sqrt};
use types::Point;

use crate::outline;
use crate::plan::WorldPlan;
use crate::robot::CLEARANCE_LIMIT;

/// Side of a cell (m).
const CELL: f64 = 0.05;
/// What hangs higher than this is no obstacle (m): the height of a robot.
const HEADROOM: f64 = 1.1;

/// Whether a disc of diameter `width` (m) can get from `start` to every one of the named regions.
///
/// People count as obstacles unless they are hidden at first or walk. The answer "yes" is safe: between the middles of
/// two neighbouring cells the disc keeps clear because the obstacles are grown by half a cell more. A passage that is
/// wider than `width` by less than a cell may be taken for too narrow.
pub fn exists(plan: &WorldPlan, start: Point, through: &[&str], width: f64) -> bool {
    let grid = Grid::new(plan, width / 2.0 + CELL / 2.0);
    let reached = grid.flood(start);
    through.iter().all(|name| {
        plan.region(name).is_some_and(|region| {
            (0..reached.len()).any(|cell| reached[cell] && region.contains(grid.middle(cell)))
        })
    })
}

struct Grid {
    min: Point,
    columns: usize,
    rows: usize,
    blocked: Vec<bool>,
}

impl Grid {
    fn new(plan: &WorldPlan, grow: f64) -> Grid {
        let (field, _) = outline::raise(plan);
        let (min, max) = field.bounds();
        // Without an outer wall the way may lead around everything.
        let min = min - Point::new(CLEARANCE_LIMIT, CLEARANCE_LIMIT);
        let size = max + Point::new(CLEARANCE_LIMIT, CLEARANCE_LIMIT) - min;
        let (columns, rows) = (ceil(size.x / CELL) as usize, ceil(size.y / CELL) as usize);
        let mut grid = Grid { min, columns, rows, blocked: vec![false; columns * rows] };
        for face in field.faces.iter().filter(|face| face.low < HEADROOM) {
            let (a, b) = (face.segment.a, face.segment.b());
            let low = Point::new(a.x.min(b.x), a.y.min(b.y));
            let high = Point::new(a.x.max(b.x), a.y.max(b.y));
            grid.block(low, high, grow, |p| {
                let away = face.segment.nearest(p) - p;
                sqrt(away.dot(away))
            });
        }
        let posts = field.posts.iter().filter(|post| post.low < HEADROOM).map(|post| post.circle);
        let people = plan.people.iter().filter(|person| person.appears.is_none() && person.walk.is_empty());
        let people = people.map(|person| crate::shape::Circle { centre: person.at, radius: person.radius });
        for circle in posts.chain(people) {
            let corner = Point::new(circle.radius, circle.radius);
            grid.block(circle.centre - corner, circle.centre + corner, grow, |p| {
                let away = circle.centre - p;
                sqrt(away.dot(away)) - circle.radius
            });
        }
        grid
    }

    /// Blocks the cells in and around a rectangle whose `distance` is less than `grow` (m).
    fn block(&mut self, low: Point, high: Point, grow: f64, distance: impl Fn(Point) -> f64) {
        let cell = |x: f64, count: usize| (floor(x / CELL).max(0.0) as usize).min(count.saturating_sub(1));
        let (x0, x1) =
            (cell(low.x - grow - self.min.x, self.columns), cell(high.x + grow - self.min.x, self.columns));
        let (y0, y1) =
            (cell(low.y - grow - self.min.y, self.rows), cell(high.y + grow - self.min.y, self.rows));
        for y in y0..=y1 {
            for x in x0..=x1 {
                let index = y * self.columns + x;
                self.blocked[index] |= distance(self.middle(index)) < grow;
            }
        }
    }

    fn middle(&self, cell: usize) -> Point {
        let (x, y) = (cell % self.columns, cell / self.columns);
        self.min + Point::new((x as f64 + 0.5) * CELL, (y as f64 + 0.5) * CELL)
    }

    fn flood(&self, start: Point) -> Vec<bool> {
        let mut reached = vec![false; self.blocked.len()];
        let (x, y) = (floor((start.x - self.min.x) / CELL), floor((start.y - self.min.y) / CELL));
        if x < 0.0 || y < 0.0 || x >= self.columns as f64 || y >= self.rows as f64 {
            return reached;
        }
        let mut open = vec![y as usize * self.columns + x as usize];
        while let Some(cell) = open.pop() {
            if self.blocked[cell] || reached[cell] {
                continue;
            }
            reached[cell] = true;
            let (x, y) = (cell % self.columns, cell / self.columns);
            if x > 0 {
                open.push(cell - 1);
            }
            if x + 1 < self.columns {
                open.push(cell + 1);
            }
            if y > 0 {
                open.push(cell - self.columns);
            }
            if y + 1 < self.rows {
                open.push(cell + self.columns);
            }
        }
        reached
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::{Region, Wall};

    /// Two rooms with a gap of this width between them.
    fn rooms(gap: f64) -> WorldPlan {
        let mut plan = WorldPlan::hall(6.0, 4.0);
        for (from, to) in [(0.0, 2.0 - gap / 2.0), (2.0 + gap / 2.0, 4.0)] {
            plan.walls
                .push(Wall { line: vec![Point::new(3.0, from), Point::new(3.0, to)], ..Wall::default() });
        }
        let polygon = crate::shape::rectangle(Point::new(5.0, 2.0), Point::new(1.0, 1.0), 0.0).to_vec();
        plan.regions.push(Region { name: "other".into(), polygon });
        plan
    }

    #[test]
    fn a_disc_passes_a_gap_that_is_wider_than_itself() {
        for (gap, passes) in [(0.60, false), (0.64, false), (0.76, true), (0.9, true)] {
            assert_eq!(exists(&rooms(gap), Point::new(1.0, 1.0), &["other"], 0.65), passes, "gap of {gap} m");
        }
        assert!(!exists(&rooms(0.9), Point::new(0.1, 1.0), &["other"], 0.65), "it starts in the wall");
    }
}
