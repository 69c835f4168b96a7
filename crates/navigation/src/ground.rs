//! What a robot knows of the floor around it: where it is free, where something stands, and where the robot has been; and the way from here
//! to the nearest place that is new.
//!
//! In plain words: who explores an unknown house remembers which rooms he has seen, and goes to the nearest doorway behind which he has
//! not been. (Yamauchi 1997, "frontier-based exploration"; here ground is new until the robot has been *near* it, as a ring of
//! sonars sees a place only from nearby.)
//!
//! How it works: three layers of bits on a grid that moves with the robot. A body of some radius may go where no taken cell lies within
//! that radius: the taken cells, dilated by a disc, a row of 64 cells at a time. Over what remains Dijkstra's search with
//! Dial's buckets finds the nearest new cell; a cell with little room costs more, so a way keeps to the middle where there is one.

use crate::layer::{Layer, SIDE};
use crate::search::{Floor, Search};
use types::Point;
use types::geometry::whole;

/// Side of a cell (m).
pub const CELL: f64 = 0.1;
/// The robot is kept so far from the rim of the grid (cells).
const MARGIN: i32 = SIDE as i32 / 4;

/// What a sensor says of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seen {
    /// Nothing is there.
    Free,
    /// Something stands there.
    Taken,
}

/// How much room a body needs, and what a lack of it costs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Room {
    /// Distance from its middle to everything with which it still goes through (m).
    pub least: f64,
    /// Distance it wants (m).
    pub keep: f64,
}

/// What a place is worth is judged by the square of so many cells to each side of it: 0.9 m.
const AROUND: usize = 4;
const AREA: u32 = (2 * AROUND as u32 + 1) * (2 * AROUND as u32 + 1);
/// For a place around which all is new and known to be free it goes so many cells of way more (6 m).
const WORTH: u32 = 60;
/// A cell that is known to be free is worth this many more than one of which nothing is known: silence may be a wall met obliquely.
const FREE: u32 = 3;
/// A place around which fewer cells are new is a chink between things that stand about.
const LEAST: u32 = 30;
/// Where a body would stand freely, as far as is known, is no chink and no echo from behind a wall, which make spikes. Such cells
/// are counted in a square of so many cells to each side (1.5 m).
const WIDE_AROUND: usize = 7;
/// For each of them it goes so many cells of way more, up to 15 m: across a room to the door.
const WIDE_EACH: u32 = 2;
const WIDE_MOST: u32 = 150;
/// So many of them are wide ground: half a square metre, as is heard through a door.
const WIDE: u32 = 50;
/// How far beyond what it has been near to a place is looked for (cells).
const RIM: f64 = 2.0;

/// How many cells of a way are kept: 8 m, after which it is looked for anew.
const STEPS: usize = 80;

/// A way over the floor, from here on, as the middles of cells.
#[derive(Clone, Copy, Debug)]
pub struct Way {
    points: [Point; STEPS],
    len: usize,
    goal: Point,
    cost: f64,
}

impl Way {
    /// The places to go through, the nearest first: its beginning, where it is long.
    pub fn points(&self) -> &[Point] {
        &self.points[..self.len]
    }

    /// Where it leads to.
    pub const fn goal(&self) -> Point {
        self.goal
    }

    /// What it costs: its length (m), with what is narrow or unknown counted several times.
    pub const fn cost(&self) -> f64 {
        self.cost
    }
}

/// The floor around a robot, in the frame of its odometry.
#[derive(Clone, Debug)]
pub struct Ground {
    free: Layer,
    taken: Layer,
    trodden: Layer,
    /// Where it does not get to.
    given_up: Layer,
    /// The lowest cell of the grid.
    corner: (i32, i32),
    /// What a search works with.
    closed: Layer,
    tight: Layer,
    within: Layer,
    shut: Layer,
    new: Layer,
    open: Layer,
    roomy: Layer,
    search: Search,
}

impl Default for Ground {
    fn default() -> Ground {
        Ground::new()
    }
}

impl Ground {
    /// A floor of which nothing is known. The memory for all of it is taken here: 2.7 MB, most of it for the search.
    pub fn new() -> Ground {
        Ground {
            free: Layer::default(),
            taken: Layer::default(),
            trodden: Layer::default(),
            given_up: Layer::default(),
            corner: (-(SIDE as i32) / 2, -(SIDE as i32) / 2),
            closed: Layer::default(),
            tight: Layer::default(),
            within: Layer::default(),
            shut: Layer::default(),
            new: Layer::default(),
            open: Layer::default(),
            roomy: Layer::default(),
            search: Search::new(),
        }
    }

    /// Forgets everything.
    pub fn forget(&mut self) {
        self.free.clear();
        self.taken.clear();
        self.forget_trodden();
    }

    /// Forgets where the robot has been.
    pub fn forget_trodden(&mut self) {
        self.given_up.clear();
        self.trodden.clear();
    }

    /// Forgets where it did not get to: by now there may be a way.
    pub fn forget_given_up(&mut self) {
        self.given_up.clear();
    }

    /// Forgets what stands about: some of it may have been an echo of something else.
    pub fn forget_taken(&mut self) {
        self.taken.clear();
    }

    /// Whether it knows of anything that stands about.
    pub fn has_taken(&self) -> bool {
        !self.taken.is_empty()
    }

    /// Takes over what is known of the cell at a point, or that nothing is known any more. A point outside the grid is left out.
    pub fn see(&mut self, at: Point, seen: Option<Seen>) {
        let Some(cell) = self.cell(at) else { return };
        self.free.set(cell, seen == Some(Seen::Free));
        self.taken.set(cell, seen == Some(Seen::Taken));
    }

    /// Takes over what is known of up to 64 cells in a row, a bit for each: the lowest is that at the point `first`, the next ones follow along x.
    /// Where a bit of `known` is not set nothing is changed; where it is, but neither of the others, nothing is known any more. A row that is
    /// not wholly inside the grid is left out.
    pub fn see_row(&mut self, first: Point, known: u64, free: u64, taken: u64) {
        let (x, y) = index(first);
        let last = x.saturating_add(63 - known.leading_zeros() as i32);
        if known != 0
            && slot(self.corner, last, y).is_some()
            && let Some(cell) = slot(self.corner, x, y)
        {
            self.free.set_row(cell, known, free);
            self.taken.set_row(cell, known, taken);
        }
    }

    /// The robot is here, and knows what is within `near` (m, at most 6) of it. Returns how much of that was new ground (m²).
    pub fn tread(&mut self, here: Point, near: f64) -> f64 {
        self.follow(here);
        let near = near.clamp(0.0, f64::from(MARGIN - 4) * CELL);
        let ((x, y), span) = (index(here), (near / CELL) as i32 + 1);
        let mut new = 0;
        for iy in y - span..=y + span {
            for first in (x - span..=x + span).step_by(64) {
                let Some(cell) = slot(self.corner, first, iy) else { continue };
                // Most of it is trodden already, so it is looked at in rows.
                let mut left = !self.trodden.row_from(cell);
                while left != 0 && first + (left.trailing_zeros() as i32) <= x + span {
                    let ix = left.trailing_zeros() as i32;
                    left &= left - 1;
                    let middle = centre(first + ix, iy);
                    if (middle - here).is_within(near)
                        && self.is_seen(here, middle)
                        && let Some(cell) = self.cell(middle)
                    {
                        new += 1;
                        self.trodden.set(cell, true);
                    }
                }
            }
        }
        f64::from(new) * CELL * CELL
    }

    /// The robot does not get to a place, nor to what is within `near` (m) of it.
    pub fn give_up(&mut self, place: Point, near: f64) {
        for cell in self.disc(place, near) {
            self.given_up.set(cell, true);
        }
    }

    /// Whether nothing stands between two points.
    fn is_seen(&self, from: Point, to: Point) -> bool {
        let steps = whole(from.distance(to) / CELL);
        (1..steps).all(|i| {
            let at = from + (to - from) * (f64::from(i) / f64::from(steps));
            self.cell(at).is_none_or(|cell| !self.taken.get(cell))
        })
    }

    /// Whether the robot has been near a point, or does not get there; outside the grid nothing is known.
    pub fn is_known(&self, at: Point) -> bool {
        self.cell(at).is_some_and(|cell| self.trodden.get(cell) || self.given_up.get(cell))
    }

    /// Whether something stands within `room` (m) of a point.
    pub fn is_tight(&self, at: Point, room: f64) -> bool {
        self.disc(at, room).any(|cell| self.taken.get(cell))
    }

    /// The way from here to new ground that a body gets to, near and with much that is new around it, and best with room to stand in; none if
    /// there is none. To `goal`, where it was going, as long as that is new and there is a way.
    pub fn way_to_new(&mut self, here: Point, room: Room, goal: Option<Point>) -> Option<Way> {
        let start = self.cell(here)?;
        self.draw(room);
        let goal = goal.and_then(|goal| self.cell(goal));
        let Ground { closed, tight, taken, within, new, .. } = self;
        let floor = Floor { closed, tight, taken, within };
        // A place that was set out for is gone to as long as there is a way; else it would turn around for each that comes into sight.
        let again =
            goal.and_then(|goal| self.search.run(start, &floor, new, 0, |cell| (cell == goal).then_some(0)));
        let goal = again.or_else(|| self.best(start, 0))?;
        Some(self.way(goal))
    }

    /// The way from here to wide new ground, such as is heard through a door or along a corridor; none if there is none.
    pub fn way_to_wide(&mut self, here: Point, room: Room) -> Option<Way> {
        let start = self.cell(here)?;
        self.draw(room);
        let goal = self.best(start, WIDE)?;
        Some(self.way(goal))
    }

    /// The new cell that is near for what it is worth, of those around which so many are wide.
    fn best(&mut self, start: usize, least: u32) -> Option<usize> {
        let Ground { closed, tight, taken, within, new, shut, open, roomy, .. } = self;
        let floor = Floor { closed, tight, taken, within };
        self.search.run(start, &floor, new, WORTH + WIDE_MOST, |cell| {
            let area = AREA - shut.count(cell, AROUND);
            let sum = area + FREE * open.count(cell, AROUND);
            let wide = roomy.count(cell, WIDE_AROUND);
            let worth = sum * WORTH / ((1 + FREE) * AREA) + (WIDE_EACH * wide).min(WIDE_MOST);
            (wide >= least && (area >= LEAST || wide > 0)).then_some(worth)
        })
    }

    /// Draws the layers that a search looks at, from what is known.
    fn draw(&mut self, room: Room) {
        // What stands there may reach half a cell towards the body.
        self.closed.dilate(&self.taken, room.least / CELL - 0.5);
        self.tight.dilate(&self.taken, room.keep / CELL);
        self.new.unite(&self.trodden, &self.given_up);
        self.shut.unite(&self.new, &self.closed);
        self.open.difference(&self.free, &self.shut);
        // The body stands freely where no cell within its radius may be taken; two layers serve as paper.
        let Ground { free, taken, trodden, shut, roomy, new, within, .. } = self;
        new.unite(free, trodden);
        within.difference(new, taken);
        new.invert(within);
        within.dilate(new, room.least / CELL);
        new.unite(within, shut);
        roomy.invert(new);
        self.within.dilate(&self.trodden, RIM);
        self.new.difference(&self.within, &self.shut);
    }

    fn way(&self, goal: usize) -> Way {
        let mut points = [Point::default(); STEPS];
        let mut len = 0;
        // From the goal back to the start; of a long way the last kept are its beginning.
        let mut cell = goal;
        loop {
            points[len % STEPS] = self.middle(cell);
            len += 1;
            let Some(before) = self.search.before(cell) else { break };
            cell = before;
        }
        let kept = len.min(STEPS);
        points.rotate_left(if len > STEPS { len % STEPS } else { 0 });
        points[..kept].reverse();
        Way { points, len: kept, goal: self.middle(goal), cost: self.search.cost(goal) * CELL }
    }

    /// Keeps the robot away from the rim of the grid; what leaves it is forgotten.
    fn follow(&mut self, here: Point) {
        let (x, y) = index(here);
        let side = SIDE as i32;
        let shift = |low: i32, at: i32| (at - low - MARGIN).min(0) + (at - low - (side - 1 - MARGIN)).max(0);
        let (dx, dy) = (shift(self.corner.0, x), shift(self.corner.1, y));
        // What comes in on one side lies in the memory of what goes out on the other.
        let leaving = |low: i32, by: i32| {
            let (from, to) = if by > 0 { (low, low + by) } else { (low + by, low) };
            (from..to).take(SIDE).map(move |i| i.rem_euclid(side) as usize)
        };
        for layer in [&mut self.free, &mut self.taken, &mut self.trodden, &mut self.given_up] {
            leaving(self.corner.0, dx).for_each(|column| layer.clear_column(column));
            leaving(self.corner.1, dy).for_each(|row| layer.clear_row(row));
        }
        self.corner = (self.corner.0 + dx, self.corner.1 + dy);
    }

    /// The cells within a distance (m) of a point.
    fn disc(&self, middle: Point, radius: f64) -> impl Iterator<Item = usize> + use<> {
        let ((x, y), span) = (index(middle), (radius / CELL) as i32 + 1);
        let corner = self.corner;
        (y - span..=y + span)
            .flat_map(move |iy| (x - span..=x + span).map(move |ix| (ix, iy)))
            .filter(move |&(ix, iy)| (centre(ix, iy) - middle).is_within(radius))
            .filter_map(move |(ix, iy)| slot(corner, ix, iy))
    }

    fn cell(&self, at: Point) -> Option<usize> {
        let (x, y) = index(at);
        slot(self.corner, x, y)
    }

    fn middle(&self, cell: usize) -> Point {
        let side = SIDE as i32;
        let (column, row) = ((cell % SIDE) as i32, (cell / SIDE) as i32);
        let x = self.corner.0 + (column - self.corner.0).rem_euclid(side);
        let y = self.corner.1 + (row - self.corner.1).rem_euclid(side);
        centre(x, y)
    }
}

fn index(point: Point) -> (i32, i32) {
    (whole(point.x / CELL), whole(point.y / CELL))
}

fn centre(ix: i32, iy: i32) -> Point {
    Point::new((f64::from(ix) + 0.5) * CELL, (f64::from(iy) + 0.5) * CELL)
}

/// Where a cell lies in the layers, which are a torus; none outside the grid.
fn slot(corner: (i32, i32), ix: i32, iy: i32) -> Option<usize> {
    let side = SIDE as i32;
    let inside = |low: i32, i: i32| (low..low + side).contains(&i);
    (inside(corner.0, ix) && inside(corner.1, iy))
        // The side is a power of two: its bits are the remainder, of negative numbers too.
        .then(|| (iy & (side - 1)) as usize * SIDE + (ix & (side - 1)) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ROOM: Room = Room { least: 0.27, keep: 0.42 };

    /// Taken cells along a straight line.
    fn wall(ground: &mut Ground, from: (f64, f64), to: (f64, f64)) {
        let (a, b) = (Point::new(from.0, from.1), Point::new(to.0, to.1));
        let n = (a.distance(b) / (CELL / 2.0)) as usize;
        for i in 0..=n {
            ground.see(a + (b - a) * (i as f64 / n.max(1) as f64), Some(Seen::Taken));
        }
    }

    /// A square room, 4 m wide, around the origin, with a gap in the middle of its right wall.
    fn room(gap: f64) -> Ground {
        let mut ground = Ground::new();
        wall(&mut ground, (-2.0, -2.0), (-2.0, 2.0));
        wall(&mut ground, (-2.0, -2.0), (2.0, -2.0));
        wall(&mut ground, (-2.0, 2.0), (2.0, 2.0));
        wall(&mut ground, (2.0, -2.0), (2.0, -gap / 2.0));
        wall(&mut ground, (2.0, gap / 2.0), (2.0, 2.0));
        // It has been near everything inside.
        for x in -3..=3 {
            for y in -3..=3 {
                ground.tread(Point::new(0.5 * f64::from(x), 0.5 * f64::from(y)), 0.7);
            }
        }
        ground
    }

    #[test]
    fn out_of_a_known_room_the_way_leads_through_the_gap_when_the_body_fits() {
        let way = room(0.9).way_to_new(Point::new(-1.0, 1.0), ROOM, None).unwrap();
        assert!(way.goal().x > 2.0 && way.goal().y.abs() < 0.5, "{:?}", way.goal());
        let points = way.points();
        assert!(points[0].distance(Point::new(-1.0, 1.0)) < CELL);
        assert!(points.windows(2).all(|two| two[0].distance(two[1]) < 1.5 * CELL));
        // As the crow flies it is 3.2 m.
        assert!((3.0..5.0).contains(&way.cost()), "{}", way.cost());
        assert!(room(0.4).way_to_new(Point::new(-1.0, 1.0), ROOM, None).is_none());
    }

    /// All cells of a rectangle.
    fn see_all(ground: &mut Ground, from: (f64, f64), to: (f64, f64), seen: Seen) {
        let cells =
            |low: f64, high: f64| (0..((high - low) / CELL) as i32).map(move |i| low + CELL * f64::from(i));
        for x in cells(from.0, to.0) {
            for y in cells(from.1, to.1) {
                ground.see(Point::new(x + CELL / 2.0, y + CELL / 2.0), Some(seen));
            }
        }
    }

    #[test]
    fn wide_ground_far_away_is_worth_more_than_a_chink_nearby() {
        let mut ground = room(0.9);
        // Beyond the gap on the right a corridor is heard; on the left spikes behind the wall, and a hole in it.
        see_all(&mut ground, (2.1, -0.8), (3.1, 0.8), Seen::Free);
        for i in 0..6 {
            let y = -0.9 + 0.3 * f64::from(i);
            see_all(&mut ground, (-3.0, y), (-2.1, y + 0.2), Seen::Free);
        }
        for i in -3..=3 {
            ground.see(Point::new(-2.0, 0.1 * f64::from(i)), Some(Seen::Free));
        }
        let here = Point::new(-1.4, 0.0);
        let goal = ground.way_to_new(here, ROOM, None).unwrap().goal();
        assert!(goal.x > 1.9, "{goal:?}");
        let wide = ground.way_to_wide(here, ROOM).unwrap().goal();
        assert!(wide.x > 1.9, "{wide:?}");
        // Without the corridor there is only the hole.
        see_all(&mut ground, (2.0, -0.8), (3.1, 0.8), Seen::Taken);
        assert!(ground.way_to_wide(here, ROOM).is_none());
        assert!(ground.way_to_new(here, ROOM, None).unwrap().goal().x < -1.9);
    }

    #[test]
    fn what_stands_between_is_not_trodden_and_what_was_given_up_is_not_gone_to() {
        let mut ground = room(0.9);
        assert!(!ground.is_known(Point::new(2.3, 1.5)) && ground.is_known(Point::new(1.7, 1.5)));
        let goal = ground.way_to_new(Point::default(), ROOM, None).unwrap().goal();
        ground.give_up(goal, 1.5);
        assert!(ground.way_to_new(Point::default(), ROOM, None).is_none());
        ground.forget_given_up();
        assert_eq!(ground.way_to_new(Point::default(), ROOM, None).unwrap().goal(), goal);
    }

    #[test]
    fn a_search_knows_nothing_of_those_before() {
        let mut ground = room(0.9);
        for here in [(-1.0, 1.0), (1.5, -1.5), (0.0, 0.0), (-1.0, 1.0)] {
            let here = Point::new(here.0, here.1);
            let mut fresh = Ground { search: Search::new(), ..ground.clone() };
            let (way, first) = (ground.way_to_new(here, ROOM, None), fresh.way_to_new(here, ROOM, None));
            let (way, first) = (way.unwrap(), first.unwrap());
            assert_eq!((way.points(), way.cost()), (first.points(), first.cost()));
        }
    }

    #[test]
    fn new_ground_is_counted_once() {
        let mut ground = Ground::new();
        let first = ground.tread(Point::new(0.3, 0.3), 0.5);
        // π r² with half a cell of error around the rim.
        assert!((first - 0.785).abs() < 0.16, "{first}");
        assert_eq!(ground.tread(Point::new(0.3, 0.3), 0.5), 0.0);
    }

    #[test]
    fn far_away_it_forgets_what_it_has_left() {
        let mut ground = room(0.9);
        for i in 0..=60 {
            ground.tread(Point::new(0.5 * f64::from(i), 0.0), 0.5);
        }
        assert!(ground.is_known(Point::new(25.0, 0.0)) && !ground.is_known(Point::default()));
        // Nothing of the room lies where its memory is used again.
        assert!(!ground.is_tight(Point::new(25.6, 0.0), 1.9) && !ground.is_tight(Point::new(23.6, 2.0), 0.5));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        /// A row is seen as its cells are, one by one.
        #[test]
        fn rows_are_seen_as_cells_are(
            rows in proptest::collection::vec(
                ((-15.0..15.0f64, -15.0..15.0f64), any::<u64>(), any::<u64>(), any::<u64>()), 1..20,
            ),
        ) {
            let (mut ground, mut by_hand) = (Ground::new(), Ground::new());
            for ((x, y), known, free, taken) in rows {
                let (x, y) = index(Point::new(x, y));
                ground.see_row(centre(x, y), known, known & free & !taken, known & taken);
                let is_inside = slot(by_hand.corner, x + 63 - known.leading_zeros() as i32, y).is_some();
                for i in (0..64).filter(|i| is_inside && slot(ground.corner, x, y).is_some() && known >> i & 1 == 1) {
                    let seen = match (free >> i & 1, taken >> i & 1) {
                        (_, 1) => Some(Seen::Taken),
                        (1, _) => Some(Seen::Free),
                        _ => None,
                    };
                    by_hand.see(centre(x + i, y), seen);
                }
            }
            prop_assert!(ground.free == by_hand.free && ground.taken == by_hand.taken);
        }

        /// A way never leads where something stands nearer than the least room, but for its first steps.
        #[test]
        fn a_way_keeps_its_distance(
            things in proptest::collection::vec((-3.0..3.0f64, -3.0..3.0f64), 0..40),
        ) {
            let mut ground = Ground::new();
            for (x, y) in &things {
                if x.hypot(*y) > 0.6 {
                    ground.see(Point::new(*x, *y), Some(Seen::Taken));
                }
            }
            ground.tread(Point::default(), 1.0);
            if let Some(way) = ground.way_to_new(Point::default(), ROOM, None) {
                for point in way.points().iter().filter(|p| p.norm() > 0.6) {
                    prop_assert!(!ground.is_tight(*point, ROOM.least - CELL / 2.0 - 1e-9), "{point:?}");
                }
            }
        }
    }
}
