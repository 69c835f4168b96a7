//! What stands around the robot, remembered for as long as it is near: a square of cells that goes along, and how far each is from what
//! stands.

use libm::{floor, sincos, sqrt};
use motion::ring::Ring;
use types::{Point, Pose};

/// Cells on a side: 12.8 m.
pub(super) const SIDE: usize = 256;
/// Size of a cell (m): a third of a thin leg, and half of what a gap may be wider than the robot.
pub(super) const CELL: f64 = 0.05;
/// How far the distance to what stands is told (cells).
const NEAR: usize = 20;
/// The same (m): what is farther away is as far as this.
pub(super) const FAR: f64 = NEAR as f64 * CELL;
/// So far a beam frees what it passes (m): farther away beams lie too far apart for that to pay.
const FREED: f64 = 5.0;
/// What a cell gains by being hit, what it can have, and from how much on something stands there. A hit is enough; nine scans that pass
/// take a thing away that was seen often.
const HIT: u8 = 3;
const MOST: u8 = 9;
const TAKEN: u8 = 2;
/// So far off the middle of the square the robot may be before the square follows (cells).
const SLACK: i32 = 16;

/// The cells around the robot, in the frame of its odometry.
#[derive(Clone, Debug)]
pub(super) struct Surroundings {
    /// The cell in the corner of least x and y, counted from the origin of the frame.
    corner: (i32, i32),
    placed: bool,
    weights: Box<[u8]>,
    /// Whether a beam has ever been in a cell.
    known: Box<[bool]>,
    /// The scan that touched a cell last.
    touched: Box<[u16]>,
    scan: u16,
    distances: Box<[f32]>,
    /// Where in a cell it was hit, of 256 parts of its side: a mean, the last hit counts a quarter.
    hits: Box<[[u8; 2]]>,
    /// Distances of the cells around one from a place in it, `2 NEAR + 1` in a row, one after the other for each of the places.
    discs: Box<[f32]>,
}

const DISC: usize = 2 * NEAR + 1;
/// So many places in a cell are told apart, along each side: 12.5 mm.
const PARTS: usize = 4;

impl Surroundings {
    pub(super) fn new() -> Surroundings {
        Surroundings {
            corner: (0, 0),
            placed: false,
            weights: vec![0; SIDE * SIDE].into_boxed_slice(),
            known: vec![false; SIDE * SIDE].into_boxed_slice(),
            touched: vec![0; SIDE * SIDE].into_boxed_slice(),
            scan: 0,
            distances: vec![FAR as f32; SIDE * SIDE].into_boxed_slice(),
            hits: vec![[128; 2]; SIDE * SIDE].into_boxed_slice(),
            discs: (0..PARTS * PARTS).flat_map(disc).collect(),
        }
    }

    pub(super) fn forget(&mut self) {
        self.weights.fill(0);
        self.known.fill(false);
        self.distances.fill(FAR as f32);
        self.placed = false;
    }

    /// Takes in a scan from a laser at `world_from_sensor`; the square follows it. Ranges of `range_max` and more met nothing (m). What no beam
    /// has touched for more than `keep` scans is forgotten.
    pub(super) fn look(
        &mut self,
        world_from_sensor: Pose,
        scan: Ring<'_>,
        range_max: f64,
        keep: Option<u16>,
    ) {
        self.follow(world_from_sensor.position());
        self.scan = self.scan.wrapping_add(1);
        // What was hit in this scan is not freed by it: a beam that grazes a thing passes its cells.
        for echo in scan.echoes().filter(|echo| echo.range < range_max) {
            self.hit(world_from_sensor.transform(echo.point()));
        }
        for echo in scan.echoes() {
            let range = if echo.range < range_max { echo.range - 1.5 * CELL } else { FREED };
            self.free(world_from_sensor, echo.bearing, range.min(FREED));
        }
        if let Some(keep) = keep {
            self.fade(keep);
        }
        self.measure();
    }

    fn hit(&mut self, point: Point) {
        let Some(cell) = self.cell(point) else { return };
        let part = |x: f64| ((x / CELL - floor(x / CELL)) * 256.0) as u8;
        let (new, known) = ([part(point.x), part(point.y)], self.weights[cell] > 0);
        let hit = &mut self.hits[cell];
        *hit = if known { std::array::from_fn(|i| mean(hit[i], new[i])) } else { new };
        self.weights[cell] = (self.weights[cell] + HIT).min(MOST);
        self.touched[cell] = self.scan;
        self.known[cell] = true;
    }

    /// Whatever a beam passed is not there, or no longer.
    fn free(&mut self, from: Pose, bearing: f64, range: f64) {
        let (sine, cosine) = sincos(from.heading + bearing);
        let (mut x, mut y) =
            (from.x / CELL - f64::from(self.corner.0), from.y / CELL - f64::from(self.corner.1));
        for _ in 0..(range / CELL) as usize {
            (x, y) = (x + cosine, y + sine);
            let (column, row) = (x as usize, y as usize);
            if x < 0.0 || y < 0.0 || column >= SIDE || row >= SIDE {
                return;
            }
            let cell = row * SIDE + column;
            self.known[cell] = true;
            if self.weights[cell] > 0 && self.touched[cell] != self.scan {
                self.weights[cell] -= 1;
                self.touched[cell] = self.scan;
            }
        }
    }

    fn fade(&mut self, keep: u16) {
        for (weight, touched) in self.weights.iter_mut().zip(&self.touched) {
            if *weight > 0 && self.scan.wrapping_sub(*touched) > keep {
                *weight = 0;
            }
        }
    }

    /// Moves the square with the robot; what falls out of it is forgotten.
    fn follow(&mut self, centre: Point) {
        let half = (SIDE / 2) as i32;
        let wanted = (floor(centre.x / CELL) as i32 - half, floor(centre.y / CELL) as i32 - half);
        if !self.placed {
            (self.corner, self.placed) = (wanted, true);
            return;
        }
        let (dx, dy) = (wanted.0 - self.corner.0, wanted.1 - self.corner.1);
        if dx.abs() <= SLACK && dy.abs() <= SLACK {
            return;
        }
        shift(&mut self.weights, dx, dy, 0);
        shift(&mut self.known, dx, dy, false);
        shift(&mut self.touched, dx, dy, 0);
        shift(&mut self.hits, dx, dy, [128; 2]);
        self.corner = wanted;
    }

    /// The distance of each cell from the nearest place where something was hit.
    fn measure(&mut self) {
        self.distances.fill(FAR as f32);
        for cell in 0..SIDE * SIDE {
            if self.weights[cell] >= TAKEN {
                let [x, y] = self.hits[cell].map(|part| usize::from(part) * PARTS / 256);
                self.spread(cell / SIDE, cell % SIDE, (y * PARTS + x) * DISC * DISC);
            }
        }
    }

    fn spread(&mut self, row: usize, column: usize, disc: usize) {
        let (left, right) = (column.saturating_sub(NEAR), (column + NEAR).min(SIDE - 1));
        let skipped = left + NEAR - column;
        for y in row.saturating_sub(NEAR)..=(row + NEAR).min(SIDE - 1) {
            let from = disc + (y + NEAR - row) * DISC + skipped;
            let disc = &self.discs[from..from + right - left + 1];
            for (distance, near) in self.distances[y * SIDE + left..=y * SIDE + right].iter_mut().zip(disc) {
                *distance = if *near < *distance { *near } else { *distance };
            }
        }
    }

    /// Column and row of a place, which may lie outside of the square.
    pub(super) fn place(&self, point: Point) -> (i32, i32) {
        (floor(point.x / CELL) as i32 - self.corner.0, floor(point.y / CELL) as i32 - self.corner.1)
    }

    /// The cell of a place; none outside of the square.
    pub(super) fn cell(&self, point: Point) -> Option<usize> {
        let (x, y) = self.place(point);
        let inside = (0..SIDE as i32).contains(&x) && (0..SIDE as i32).contains(&y);
        inside.then(|| y as usize * SIDE + x as usize)
    }

    /// The middle of a cell.
    pub(super) fn middle(&self, cell: usize) -> Point {
        let at = |cells: i32, corner: i32| (f64::from(cells + corner) + 0.5) * CELL;
        Point::new(at((cell % SIDE) as i32, self.corner.0), at((cell / SIDE) as i32, self.corner.1))
    }

    /// Whether a beam has ever been at a place.
    pub(super) fn is_known(&self, point: Point) -> bool {
        self.cell(point).is_some_and(|cell| self.known[cell])
    }

    pub(super) fn is_taken(&self, cell: usize) -> bool {
        self.weights[cell] >= TAKEN
    }

    /// From the middle of a cell to what stands nearest (m), at most [`FAR`].
    pub(super) fn distance(&self, cell: usize) -> f64 {
        f64::from(self.distances[cell])
    }

    /// From a place to what stands nearest (m), at most [`FAR`]: between the middles of four cells.
    pub(super) fn distance_at(&self, point: Point) -> f64 {
        let x = point.x / CELL - f64::from(self.corner.0) - 0.5;
        let y = point.y / CELL - f64::from(self.corner.1) - 0.5;
        let most = (SIDE - 1) as f64;
        if !(x >= 0.0 && y >= 0.0 && x < most && y < most) {
            return FAR;
        }
        let (column, row) = (x as usize, y as usize);
        let (fx, fy) = (x - column as f64, y - row as f64);
        let at = row * SIDE + column;
        let value = |i: usize| f64::from(self.distances[i]);
        let below = value(at) + (value(at + 1) - value(at)) * fx;
        let above = value(at + SIDE) + (value(at + SIDE + 1) - value(at + SIDE)) * fx;
        below + (above - below) * fy
    }

    /// Whether a cell lies at the border of the square, beyond which nothing is known.
    pub(super) fn is_at_border(cell: usize) -> bool {
        let (row, column) = (cell / SIDE, cell % SIDE);
        row == 0 || column == 0 || row == SIDE - 1 || column == SIDE - 1
    }
}

/// The distances of the cells around one from a place in it (m), row by row.
fn disc(part: usize) -> impl Iterator<Item = f32> {
    let off = |part: usize| (part as f64 + 0.5) / PARTS as f64 - 0.5;
    let (x, y) = (off(part % PARTS), off(part / PARTS));
    (0..DISC * DISC).map(move |i| {
        let (dx, dy) = ((i % DISC) as f64 - NEAR as f64 - x, (i / DISC) as f64 - NEAR as f64 - y);
        (sqrt(dx * dx + dy * dy) * CELL) as f32
    })
}

/// A mean of which the last counts a quarter.
fn mean(old: u8, new: u8) -> u8 {
    ((3 * u16::from(old) + u16::from(new) + 2) / 4) as u8
}

/// Moves a square of cells so that what stood at (dx, dy) stands in the corner; what comes in is `fresh`.
fn shift<T: Copy>(cells: &mut [T], dx: i32, dy: i32, fresh: T) {
    let side = SIDE as i32;
    let move_row = |cells: &mut [T], row: i32| {
        let to = row as usize * SIDE;
        let from = row + dy;
        if !(0..side).contains(&from) || dx.abs() >= side {
            cells[to..to + SIDE].fill(fresh);
            return;
        }
        let from = from as usize * SIDE;
        let (gone, kept) = (dx.unsigned_abs() as usize, SIDE - dx.unsigned_abs() as usize);
        if dx >= 0 {
            cells.copy_within(from + gone..from + SIDE, to);
            cells[to + kept..to + SIDE].fill(fresh);
        } else {
            cells.copy_within(from..from + kept, to + gone);
            cells[to..to + gone].fill(fresh);
        }
    };
    if dy >= 0 {
        (0..side).for_each(|row| move_row(cells, row));
    } else {
        (0..side).rev().for_each(|row| move_row(cells, row));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use libm::fabs;
    use types::geometry::{PI, TAU};

    /// A scan of a post of 0.1 m at a place, with nothing else around.
    fn scan(from: Pose, post: Option<Point>) -> Vec<f32> {
        (0..720)
            .map(|i| {
                let direction = Point::polar(1.0, from.heading - PI + TAU * f64::from(i) / 720.0);
                let Some(post) = post else { return 10.0 };
                let to = post - from.position();
                let (along, across) = (to.dot(direction), direction.cross(to));
                let hit = along > 0.0 && fabs(across) < 0.1;
                (if hit { along - sqrt(0.01 - across * across) } else { 10.0 }) as f32
            })
            .collect()
    }

    fn see(around: &mut Surroundings, from: Pose, post: Option<Point>) {
        let ranges = scan(from, post);
        let ring = Ring::Sweep { angle_min: -PI, angle_step: TAU / 720.0, ranges: &ranges };
        around.look(from, ring, 10.0, None);
    }

    #[test]
    fn what_no_beam_touches_any_more_is_forgotten_when_it_is_old_enough() {
        let mut around = Surroundings::new();
        see(&mut around, Pose::default(), Some(Point::new(1.0, 0.0)));
        // It looks to the other side.
        let away = [10.0; 100];
        let mut look = || {
            let ring = Ring::Sweep { angle_min: PI / 2.0, angle_step: PI / 100.0, ranges: &away };
            around.look(Pose::default(), ring, 10.0, Some(20));
            around.distance_at(Point::new(0.7, 0.0))
        };
        assert!((0..20).all(|_| look() < 0.3), "it may still be there");
        assert_eq!(look(), FAR);
    }

    #[test]
    fn what_was_seen_is_as_far_away_as_it_is_and_stays_while_the_square_moves() {
        let mut around = Surroundings::new();
        let post = Point::new(2.0, 1.0);
        for i in 0..60 {
            see(&mut around, Pose::new(f64::from(i) * 0.1 - 3.0, -0.5, 0.3), Some(post));
        }
        for place in [Point::new(2.0, 0.3), Point::new(1.2, 1.0), Point::new(2.4, 0.5)] {
            let distance = place.distance(post) - 0.1;
            let told = around.distance_at(place);
            assert!(fabs(told - distance) < CELL, "{place:?}: {told} for {distance}");
        }
        assert_eq!(around.distance_at(Point::new(0.0, 0.0)), FAR);
    }

    #[test]
    fn what_went_away_is_freed_by_the_beams_that_pass_and_what_is_not_seen_stays() {
        let mut around = Surroundings::new();
        let post = Point::new(1.0, 0.0);
        (0..5).for_each(|_| see(&mut around, Pose::default(), Some(post)));
        assert!(around.distance_at(Point::new(0.7, 0.0)) < 0.3);
        (0..20).for_each(|_| see(&mut around, Pose::default(), None));
        assert_eq!(around.distance_at(Point::new(0.7, 0.0)), FAR);
    }

    #[test]
    fn a_square_of_cells_moves_whole_in_all_directions() {
        let numbers: Vec<u16> = (0..SIDE * SIDE).map(|i| (i % 60_000) as u16 + 1).collect();
        for (dx, dy) in [(3, 5), (-3, 5), (3, -5), (-3, -5), (0, 17), (300, 0), (0, -300)] {
            let mut moved = numbers.clone();
            shift(&mut moved, dx, dy, 0);
            for cell in (0..SIDE * SIDE).step_by(97) {
                let (x, y) = ((cell % SIDE) as i32 + dx, (cell / SIDE) as i32 + dy);
                let inside = (0..SIDE as i32).contains(&x) && (0..SIDE as i32).contains(&y);
                let expected = if inside { numbers[y as usize * SIDE + x as usize] } else { 0 };
                assert_eq!(moved[cell], expected, "{dx} {dy} {cell}");
            }
        }
    }
}
