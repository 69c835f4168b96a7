//! When to be where: a way as straight lines, rounded at its corners, with a time for each place, so that the drive can follow.
//!
//! ```text
//!        B            the corner B is left at t before it, and met again at t behind it, on an arc of
//!       ╱ ╲           radius r = t / tan(θ / 2), where θ is the angle by which the way turns
//!      ╱.-.╲
//!     A     C         v ≤ v_max,   v ≤ √(a_side r),   v ≤ ω_max r,   |dv/dt| ≤ a
//! ```
//!
//! The arc lies in the triangle of B and the two places, so it is made so small that all cells which that triangle touches are open; it always can be, where B
//! is the middle of an open cell. Where the way turns back, the robot stops and turns on the spot. The speeds at the joints are the
//! greatest for which it can still brake for all that comes, and has been able to reach them: one pass forward, one backward (Bobrow, Dubowsky and
//! Gibson 1985, in the simple case of constant limits).

use types::{Point, Pose};

use super::grid::Grid;
use super::smooth::is_open;

/// What the drive can do on a way. All numbers are positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveLimits {
    /// Highest speed (m/s). 0.6 is a slow walk, so people can step aside.
    pub speed: f64,
    /// Highest rate at which the speed grows and falls (m/s²). 0.5 starts without slip on a smooth floor.
    pub acceleration: f64,
    /// Highest acceleration to the side, v²/r (m/s²). 0.5 is what the drive does ahead as well.
    pub sideways: f64,
    /// Highest turn rate (rad/s). 1 turns around in three seconds and smears no camera image.
    pub turn_rate: f64,
    /// Highest rate at which the turn rate changes on the spot (rad/s²). 3: as good as at once.
    pub turn_acceleration: f64,
    /// A corner is left so much before it at most (m). 0.5: an arc at full speed is no wider.
    pub rounding: f64,
}

impl Default for DriveLimits {
    fn default() -> DriveLimits {
        DriveLimits {
            speed: 0.6,
            acceleration: 0.5,
            sideways: 0.5,
            turn_rate: 1.0,
            turn_acceleration: 3.0,
            rounding: 0.5,
        }
    }
}

/// Where the robot is at a time, and how it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// In the frame of the grid: x along the columns, y along the rows from the first corner of the floor (m, rad).
    pub pose: Pose,
    /// Its speed (m/s).
    pub linear: f64,
    /// Its turn rate, positive from x to y (rad/s).
    pub angular: f64,
}

/// A stretch of one curvature, or a turn on the spot.
#[derive(Clone, Copy, Debug)]
struct Piece {
    from: Pose,
    /// How far it goes (m); on the spot how far it turns (rad, positive).
    length: f64,
    /// Turned for each metre (rad/m); on the spot 1 or −1.
    curvature: f64,
    is_turn: bool,
    /// Highest speed on it, and the speeds at its ends (m/s); on the spot turn rates (rad/s).
    most: f64,
    enter: f64,
    leave: f64,
    acceleration: f64,
    /// When it begins (s).
    begin: f64,
}

/// A way with times. The memory for the longest is taken when it is made.
#[derive(Clone, Debug)]
pub struct TimeTable {
    pieces: Vec<Piece>,
    duration: f64,
}

/// A turn by more than this stops the robot (rad): 120°. The arc would be so narrow that it would hardly move on it.
const BACK: f64 = 2.0 * core::f64::consts::FRAC_PI_3;
/// A turn by less than this is none (rad).
const STRAIGHT: f64 = 1e-9;
/// An arc becomes chords that turn by no more than this (rad): 20°, which cuts off 8 mm of one of half a metre.
const CHORD: f64 = core::f64::consts::PI / 9.0;
/// Points on a line that are nearer to each other than this are one (m).
const CLOSE: f64 = 0.01;

impl TimeTable {
    /// For ways with so many corners.
    pub fn new(corners: usize) -> TimeTable {
        TimeTable { pieces: Vec::with_capacity(2 * corners + 2), duration: 0.0 }
    }

    /// Makes the table for a way over open cells, from the speed that the robot has at `present` (m/s) to standing. `corners` are what
    /// [`Smoother::lead`](super::Smoother::lead) gives (m); a cell is `side` (m) wide. Without two corners it is empty; corners for which it has no room are left out,
    /// so make it for as many as there can be. Where there is no room to brake from the present speed, it begins with the one from which there is.
    pub fn plan(&mut self, grid: &Grid, corners: &[Point], side: f64, limits: &DriveLimits, present: f64) {
        self.pieces.clear();
        self.duration = 0.0;
        let corners = &corners[..corners.len().min((self.pieces.capacity() - 2) / 2)];
        // How much of a line the corner at its beginning has taken (m).
        let mut taken = 0.0;
        for (i, two) in corners.windows(2).enumerate() {
            let (a, b) = (two[0], two[1]);
            let heading = (b - a).bearing();
            let whole = a.distance(b);
            let corner = corners.get(i + 2).map(|next| {
                let c = *next;
                let turn = types::geometry::wrap((c - b).bearing() - heading);
                let most = limits.rounding.min(whole / 2.0).min(b.distance(c) / 2.0);
                (turn, if turn.abs() > BACK { 0.0 } else { open_triangle(grid, [a, b, c], most, side) })
            });
            let (turn, rounding) = corner.unwrap_or((0.0, 0.0));
            let from = a + Point::polar(taken, heading);
            self.push_line(Pose::new(from.x, from.y, heading), whole - taken - rounding, limits);
            taken = rounding;
            if turn.abs() <= STRAIGHT {
                continue;
            }
            let at = b + Point::polar(-rounding, heading);
            self.push_corner(Pose::new(at.x, at.y, heading), turn, rounding, limits);
        }
        self.speeds(if present > 0.0 { present.min(limits.speed) } else { 0.0 });
        self.times();
    }

    /// How long it takes (s).
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// How long the rounded way is (m).
    pub fn length(&self) -> f64 {
        self.pieces.iter().filter(|piece| !piece.is_turn).map(|piece| piece.length).sum()
    }

    /// Where the robot is `time` (s) after it has begun: at the start before, at the goal afterwards. None without a way.
    pub fn at(&self, time: f64) -> Option<Moment> {
        let time = time.clamp(0.0, self.duration);
        let next = self.pieces.partition_point(|piece| piece.begin <= time);
        let piece = self.pieces.get(next.saturating_sub(1))?;
        Some(piece.at(time - piece.begin))
    }

    /// The way as straight lines, with the speed at each point (m/s): between two points its square is linear along the line. What is cut off of the arcs lies in
    /// the triangles at the corners as the arcs do.
    pub fn points(&self) -> impl Iterator<Item = (Point, f64)> + '_ {
        let moving = self.pieces.iter().filter(|piece| !piece.is_turn);
        let end = moving.clone().next_back().map(|last| (last.pose(last.length).position(), last.leave));
        moving.flat_map(Piece::points).chain(end)
    }

    fn push_line(&mut self, from: Pose, length: f64, limits: &DriveLimits) {
        if length > 0.0 {
            let DriveLimits { speed, acceleration, .. } = *limits;
            self.push(Piece { curvature: 0.0, ..Piece::new(from, length, speed, acceleration) });
        }
    }

    fn push_corner(&mut self, from: Pose, turn: f64, rounding: f64, limits: &DriveLimits) {
        if rounding > 0.0 {
            let radius = rounding / libm::tan(turn.abs() / 2.0);
            let most = limits.speed.min(libm::sqrt(limits.sideways * radius)).min(limits.turn_rate * radius);
            let piece = Piece::new(from, turn.abs() * radius, most, limits.acceleration);
            self.push(Piece { curvature: turn.signum() / radius, ..piece });
        } else {
            let piece = Piece::new(from, turn.abs(), limits.turn_rate, limits.turn_acceleration);
            self.push(Piece { curvature: turn.signum(), is_turn: true, ..piece });
        }
    }

    fn push(&mut self, piece: Piece) {
        if self.pieces.len() < self.pieces.capacity() {
            self.pieces.push(piece);
        }
    }

    /// The greatest speeds at the joints, with the one at the beginning.
    fn speeds(&mut self, present: f64) {
        let mut before = self.pieces.first().map_or(0.0, |first| first.meets().min(present));
        for i in 0..self.pieces.len() {
            let next = self.pieces.get(i + 1).map_or(0.0, Piece::meets);
            let piece = &mut self.pieces[i];
            piece.enter = if piece.is_turn { 0.0 } else { before };
            let reached = libm::sqrt(piece.enter * piece.enter + 2.0 * piece.acceleration * piece.length);
            piece.leave = if piece.is_turn { 0.0 } else { reached.min(piece.most).min(next) };
            before = piece.leave;
        }
        let mut after = 0.0;
        for piece in self.pieces.iter_mut().rev().filter(|piece| !piece.is_turn) {
            piece.leave = piece.leave.min(after);
            let braked = libm::sqrt(piece.leave * piece.leave + 2.0 * piece.acceleration * piece.length);
            piece.enter = piece.enter.min(braked);
            after = piece.enter;
        }
    }

    fn times(&mut self) {
        for piece in &mut self.pieces {
            piece.begin = self.duration;
            self.duration += piece.spans().iter().sum::<f64>();
        }
    }
}

impl Piece {
    fn new(from: Pose, length: f64, most: f64, acceleration: f64) -> Piece {
        Piece {
            from,
            length,
            curvature: 0.0,
            is_turn: false,
            most,
            enter: 0.0,
            leave: 0.0,
            acceleration,
            begin: 0.0,
        }
    }

    /// The speed with which it can be entered.
    fn meets(&self) -> f64 {
        if self.is_turn { 0.0 } else { self.most }
    }

    /// The highest speed that is reached: so high that there is room to brake, and no higher than allowed.
    fn peak(&self) -> f64 {
        let square =
            self.acceleration * self.length + (self.enter * self.enter + self.leave * self.leave) / 2.0;
        libm::sqrt(square).min(self.most).max(self.enter).max(self.leave)
    }

    /// Where it is after so much of its length.
    fn pose(&self, gone: f64) -> Pose {
        self.from.along_arc(gone, gone * self.curvature)
    }

    /// The speed after so much of its length (m/s).
    fn speed(&self, gone: f64) -> f64 {
        let from = |speed: f64, far: f64| libm::sqrt(speed * speed + 2.0 * self.acceleration * far.max(0.0));
        from(self.enter, gone).min(from(self.leave, self.length - gone)).min(self.peak())
    }

    /// Its beginning and what lies within: of a line the places where it stops to grow faster and begins to brake, of an arc points that stand close.
    fn points(&self) -> impl Iterator<Item = (Point, f64)> + '_ {
        let square = |speed: f64| speed * speed / (2.0 * self.acceleration);
        let peak = square(self.peak());
        let line = [peak - square(self.enter), self.length - (peak - square(self.leave))];
        let chords = libm::ceil(self.length * self.curvature.abs() / CHORD);
        let inner = if self.curvature == 0.0 { 2 } else { (chords as usize).saturating_sub(1) };
        let places = (0..inner).map(move |i| match self.curvature == 0.0 {
            true => line[i],
            false => self.length * (i + 1) as f64 / chords,
        });
        let mut before = 0.0;
        let apart = move |gone: &f64| {
            let is_apart = *gone > before + CLOSE && *gone < self.length - CLOSE;
            before = if is_apart { *gone } else { before };
            is_apart
        };
        [0.0]
            .into_iter()
            .chain(places.filter(apart))
            .map(|gone| (self.pose(gone).position(), self.speed(gone)))
    }

    /// How long it grows faster, keeps its speed, and brakes (s).
    fn spans(&self) -> [f64; 3] {
        let (peak, acceleration) = (self.peak(), self.acceleration);
        let (faster, slower) = ((peak - self.enter) / acceleration, (peak - self.leave) / acceleration);
        let gone = (peak + self.enter) / 2.0 * faster + (peak + self.leave) / 2.0 * slower;
        let kept = ((self.length - gone) / peak.max(f64::MIN_POSITIVE)).max(0.0);
        [faster, kept, slower]
    }

    /// So long after it has begun (s).
    fn at(&self, time: f64) -> Moment {
        let [faster, kept, slower] = self.spans();
        let peak = self.peak();
        let first = time.min(faster);
        let second = (time - faster).clamp(0.0, kept);
        let third = (time - faster - kept).clamp(0.0, slower);
        let gone =
            self.enter * first + self.acceleration * first * first / 2.0 + peak * second + peak * third
                - self.acceleration * third * third / 2.0;
        let gone = gone.clamp(0.0, self.length);
        let speed = if time <= faster {
            self.enter + self.acceleration * first
        } else {
            peak - self.acceleration * third
        };
        let turned = gone * self.curvature;
        if self.is_turn {
            let heading = types::geometry::wrap(self.from.heading + turned);
            let pose = Pose::new(self.from.x, self.from.y, heading);
            return Moment { pose, linear: 0.0, angular: speed * self.curvature };
        }
        Moment { pose: self.pose(gone), linear: speed, angular: speed * self.curvature }
    }
}

/// How far before a corner the way can leave it so that what is cut off lies in open cells: at most `most`, else a half of it, a quarter …
fn open_triangle(grid: &Grid, [a, b, c]: [Point; 3], most: f64, side: f64) -> f64 {
    let mut rounding = most;
    for _ in 0..12 {
        let (p, q) = (toward(b, a, rounding), toward(b, c, rounding));
        if is_open(grid, [p, b, q], side) {
            return rounding;
        }
        rounding /= 2.0;
    }
    0.0
}

fn toward(from: Point, to: Point, far: f64) -> Point {
    from + Point::polar(far, (to - from).bearing())
}

#[cfg(test)]
mod tests {
    use super::super::smooth::middle;
    use super::super::tests::floors;
    use super::super::{Cell, Jump, Planner, Smoother};
    use super::*;
    use proptest::prelude::*;

    const LIMITS: DriveLimits = DriveLimits {
        speed: 0.6,
        acceleration: 0.5,
        sideways: 0.4,
        turn_rate: 1.0,
        turn_acceleration: 3.0,
        rounding: 0.5,
    };

    fn table(grid: &Grid, corners: &[Cell], side: f64) -> TimeTable {
        let corners: Vec<Point> = corners.iter().map(|cell| middle(*cell, side)).collect();
        moving(grid, &corners, side, 0.0)
    }

    fn moving(grid: &Grid, corners: &[Point], side: f64, present: f64) -> TimeTable {
        let mut table = TimeTable::new(corners.len());
        table.plan(grid, corners, side, &LIMITS, present);
        table
    }

    #[test]
    fn who_is_moving_goes_on_from_there_and_brakes_in_time() {
        let grid = Grid::new(101, 3);
        let way = |length: f64| [Point::new(0.05, 0.15), Point::new(0.05 + length, 0.15)];
        // 10 m at 0.6 m/s: only braking is lost, 0.6 / 0.5 / 2.
        let long = moving(&grid, &way(9.9), 0.1, 0.6);
        assert!((long.duration() - (9.9 / 0.6 + 0.6)).abs() < 1e-9, "{}", long.duration());
        // In 0.1 m it brakes from √(2 · 0.5 · 0.1), whatever it is told of the present.
        for present in [0.4, 5.0] {
            let short = moving(&grid, &way(0.1), 0.1, present);
            assert!((short.at(0.0).unwrap().linear - 0.1f64.sqrt()).abs() < 1e-9, "{present}");
        }
        assert_eq!(moving(&grid, &way(1.0), 0.1, f64::NAN).at(0.0).unwrap().linear, 0.0);
    }

    #[test]
    fn the_points_of_a_straight_way_are_where_its_speed_changes() {
        let grid = Grid::new(101, 3);
        // It is at 0.6 m/s after 0.36 m, and brakes 0.36 m before the end.
        let points: Vec<(Point, f64)> =
            table(&grid, &[Cell::new(0, 1), Cell::new(100, 1)], 0.1).points().collect();
        let expected = [(0.05, 0.0), (0.41, 0.6), (9.69, 0.6), (10.05, 0.0)];
        assert_eq!(points.len(), expected.len());
        for ((point, speed), (x, v)) in points.iter().zip(expected) {
            assert!((point.x - x).abs() < 1e-9 && (speed - v).abs() < 1e-6, "{points:?}");
        }
    }

    #[test]
    fn a_straight_way_is_a_trapezoid() {
        let grid = Grid::new(101, 3);
        // 10 m at 0.6 m/s with 0.5 m/s²: 10 / 0.6 + 0.6 / 0.5.
        let long = table(&grid, &[Cell::new(0, 1), Cell::new(100, 1)], 0.1);
        assert!((long.duration() - (10.0 / 0.6 + 1.2)).abs() < 1e-9, "{}", long.duration());
        let half = long.at(long.duration() / 2.0).unwrap();
        assert!((half.pose.x - 5.05).abs() < 1e-9 && half.linear == 0.6 && half.angular == 0.0, "{half:?}");
        // 0.4 m is too short for full speed: 2 √(0.4 / 0.5).
        let short = table(&grid, &[Cell::new(4, 1), Cell::new(0, 1)], 0.1);
        assert!((short.duration() - 2.0 * (0.4f64 / 0.5).sqrt()).abs() < 1e-9, "{}", short.duration());
        assert!((short.at(0.0).unwrap().pose.heading.abs() - types::geometry::PI).abs() < 1e-9);
    }

    #[test]
    fn a_right_angle_is_an_arc_of_the_radius_that_there_is_room_for() {
        let grid = Grid::new(60, 60);
        let corners = [Cell::new(5, 5), Cell::new(45, 5), Cell::new(45, 45)];
        let free = table(&grid, &corners, 0.1);
        // 8 m less what the arc of 0.5 m cuts off.
        let expect = 8.0 - 2.0 * 0.5 + 0.5 * core::f64::consts::FRAC_PI_2;
        assert!((free.length() - expect).abs() < 1e-9, "{}", free.length());
        // On the arc it is as fast as it may be sideways.
        let times = (0..1000).map(|i| free.at(f64::from(i) / 1000.0 * free.duration()).unwrap());
        let turning: Vec<Moment> = times.filter(|moment| moment.angular != 0.0).collect();
        let fastest = turning.iter().map(|moment| moment.linear).fold(0.0, f64::max);
        assert!((fastest - (0.4f64 * 0.5).sqrt()).abs() < 1e-9, "{fastest}");
        assert!(turning.iter().all(|moment| moment.angular > 0.0), "from x to y");
        // Something stands inside the corner.
        let mut grid = grid;
        grid.set(Cell::new(43, 7), true);
        grid.inflate(0.0);
        let narrow = table(&grid, &corners, 0.1);
        assert!(narrow.length() > free.length() && narrow.duration() > free.duration());
    }

    #[test]
    fn to_go_back_it_stops_and_turns_on_the_spot() {
        let grid = Grid::new(60, 3);
        let table = table(&grid, &[Cell::new(0, 1), Cell::new(50, 1), Cell::new(20, 1)], 0.1);
        let turning = (0..2000).filter_map(|i| table.at(f64::from(i) / 2000.0 * table.duration()));
        let turning: Vec<Moment> = turning.filter(|moment| moment.angular != 0.0).collect();
        assert!(
            !turning.is_empty() && turning.iter().all(|m| m.linear == 0.0 && (m.pose.x - 5.05).abs() < 1e-9)
        );
        // π at 1 rad/s with 3 rad/s².
        let expect = (5.0 / 0.6 + 1.2) + (3.0 / 0.6 + 1.2) + core::f64::consts::PI + 1.0 / 3.0;
        assert!((table.duration() - expect).abs() < 1e-9, "{} {expect}", table.duration());
        assert!(TimeTable::new(3).at(1.0).is_none());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]

        #[test]
        fn the_limits_are_kept_and_the_way_stays_in_open_cells((grid, start, goal) in floors(), side in 0.05..0.5f64) {
            let mut jump = Jump::new(grid.width(), grid.height());
            let Ok(path) = jump.plan(&grid, start, goal) else { return Ok(()) };
            let mut smoother = Smoother::new(grid.width(), grid.height());
            let corners = smoother.lead(&grid, path.cells(), side, None, None);
            prop_assume!(corners.len() > 1);
            let table = moving(&grid, corners, side, 0.0);
            let straight: f64 = corners.windows(2).map(|two| two[0].distance(two[1])).sum();
            prop_assert!(table.length() <= straight + 1e-9 && table.duration() >= table.length() / LIMITS.speed);
            let step = 0.04;
            let count = libm::ceil(table.duration() / step) as usize + 1;
            let moments: Vec<Moment> = (0..=count).filter_map(|i| table.at(i as f64 * step)).collect();
            let (first, last) = (moments[0], moments[count]);
            let near = |moment: Moment, cell: Cell| moment.pose.position().distance(middle(cell, side)) < 1e-6;
            prop_assert!(near(first, start) && near(last, goal));
            prop_assert!(first.linear.abs() < 1e-6 && last.linear.abs() < 1e-6, "{:?} {:?}", first, last);
            for moment in &moments {
                let cell = |at: f64| libm::floor(at / side) as u32;
                prop_assert!(!grid.is_closed(Cell::new(cell(moment.pose.x), cell(moment.pose.y))), "{:?}", moment);
                prop_assert!(moment.linear <= LIMITS.speed + 1e-9 && moment.linear >= -1e-9);
                prop_assert!(moment.angular.abs() <= LIMITS.turn_rate + 1e-9);
                prop_assert!((moment.linear * moment.angular).abs() <= LIMITS.sideways + 1e-9);
            }
            // The same of the straight lines that stand for it, with the square of the speed linear on each.
            let points: Vec<(Point, f64)> = table.points().collect();
            prop_assert!(points[0].0.distance(middle(start, side)) < 1e-9);
            let longest = points.windows(2).map(|two| two[0].0.distance(two[1].0)).sum::<f64>();
            prop_assert!(longest <= table.length() + 1e-9 && longest >= 0.98 * table.length());
            for two in points.windows(2) {
                let (way, squares) = (two[0].0.distance(two[1].0), two.iter().map(|(_, v)| v * v).collect::<Vec<_>>());
                prop_assert!(squares[1].max(squares[0]) <= LIMITS.speed * LIMITS.speed + 1e-9);
                // A chord is shorter than its arc, by half a hundredth at most.
                prop_assert!((squares[1] - squares[0]).abs() <= 2.0 * LIMITS.acceleration * way * 1.006 + 1e-6, "{:?}", two);
                for i in 0..=20 {
                    let at = two[0].0 + (two[1].0 - two[0].0) * (f64::from(i) / 20.0);
                    let cell = |at: f64| libm::floor(at / side) as u32;
                    prop_assert!(!grid.is_closed(Cell::new(cell(at.x), cell(at.y))), "{:?}", two);
                }
            }
            for two in moments.windows(2) {
                let (gone, faster) = (two[0].pose.position().distance(two[1].pose.position()), two[1].linear - two[0].linear);
                let turned = types::geometry::wrap(two[1].pose.heading - two[0].pose.heading).abs();
                prop_assert!(gone <= LIMITS.speed * step + 1e-9, "{} {:?}", gone, two);
                prop_assert!(faster.abs() <= LIMITS.acceleration * step + 1e-9, "{} {:?}", faster, two);
                prop_assert!(turned <= LIMITS.turn_rate * step + 1e-9, "{} {:?}", turned, two);
            }
        }
    }
}
