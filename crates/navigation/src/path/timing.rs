//! When to be where: a way as straight lines, rounded at its corners, with a time for each place, so that the drive can follow.
//!
//! ```text
//!        B            the corner B is left at t before it, and met again at t behind it, on an arc of
//!       ╱ ╲           radius r = t / tan(θ / 2), where θ is the angle by which the way turns
//!      ╱.-.╲
//!     A     C         v ≤ v_max,   v ≤ √(a_side r),   v ≤ ω_max r,   |dv/dt| ≤ a
//! ```
//!
//! The arc lies in the triangle of B and the two places, so it is made so small that all cells which that triangle touches are open; it always can be, since B
//! is the middle of an open cell. Where the way turns back, the robot stops and turns on the spot. The speeds at the joints are the
//! greatest for which it can still brake for all that comes, and has been able to reach them: one pass forward, one backward (Bobrow, Dubowsky and
//! Gibson 1985, in the simple case of constant limits).

use types::{Point, Pose};

use super::grid::{Cell, Grid};

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

impl TimeTable {
    /// For ways with so many corners.
    pub fn new(corners: usize) -> TimeTable {
        TimeTable { pieces: Vec::with_capacity(2 * corners + 2), duration: 0.0 }
    }

    /// Makes the table for a way over open cells, from standing to standing. `corners` are what a [`Smoother`](super::Smoother) gives; a cell is `side` (m) wide. Without
    /// two corners it is empty; corners for which it has no room are left out, so make it for as many as there can be.
    pub fn plan(&mut self, grid: &Grid, corners: &[Cell], side: f64, limits: &DriveLimits) {
        self.pieces.clear();
        self.duration = 0.0;
        let corners = &corners[..corners.len().min((self.pieces.capacity() - 2) / 2)];
        // How much of a line the corner at its beginning has taken (m).
        let mut taken = 0.0;
        for (i, two) in corners.windows(2).enumerate() {
            let (a, b) = (middle(two[0], side), middle(two[1], side));
            let heading = (b - a).bearing();
            let whole = a.distance(b);
            let corner = corners.get(i + 2).map(|next| {
                let c = middle(*next, side);
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
        self.speeds();
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

    /// The greatest speeds at the joints.
    fn speeds(&mut self) {
        let mut before = 0.0;
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
        Moment { pose: self.from.along_arc(gone, turned), linear: speed, angular: speed * self.curvature }
    }
}

/// The middle of a cell (m).
fn middle(cell: Cell, side: f64) -> Point {
    Point::new((f64::from(cell.x) + 0.5) * side, (f64::from(cell.y) + 0.5) * side)
}

/// How far before a corner the way can leave it so that what is cut off lies in open cells: at most `most`, else a half of it, a quarter …
fn open_triangle(grid: &Grid, [a, b, c]: [Point; 3], most: f64, side: f64) -> f64 {
    let mut rounding = most;
    for _ in 0..12 {
        let (p, q) = (toward(b, a, rounding), toward(b, c, rounding));
        if is_open(grid, [p, b, q].map(|at| Point::new(at.x / side - 0.5, at.y / side - 0.5))) {
            return rounding;
        }
        rounding /= 2.0;
    }
    0.0
}

fn toward(from: Point, to: Point, far: f64) -> Point {
    from + Point::polar(far, (to - from).bearing())
}

/// Whether all cells that a triangle touches are open; in sides of a cell, from the middle of the first one. A cell counts where its middle is nearer to the triangle than
/// its corners are: then more of them count than must.
fn is_open(grid: &Grid, corners: [Point; 3]) -> bool {
    let least = |of: fn(&Point) -> f64| corners.iter().map(of).fold(f64::INFINITY, f64::min);
    let most = |of: fn(&Point) -> f64| corners.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
    let whole = |x: f64| libm::floor(x.max(0.0)) as u32;
    let (columns, rows) = (
        whole(least(|p| p.x) - 1.0)..=whole(most(|p| p.x) + 2.0),
        whole(least(|p| p.y) - 1.0)..=whole(most(|p| p.y) + 2.0),
    );
    rows.into_iter().all(|y| {
        columns.clone().all(|x| {
            let at = Point::new(f64::from(x), f64::from(y));
            !grid.is_closed(Cell::new(x, y)) || distance(at, corners) > core::f64::consts::FRAC_1_SQRT_2
        })
    })
}

/// How far a point is from a triangle; nothing inside.
fn distance(at: Point, [a, b, c]: [Point; 3]) -> f64 {
    let sides = [(a, b), (b, c), (c, a)];
    let left = sides.map(|(p, q)| (q - p).cross(at - p) >= 0.0);
    if left == [true; 3] || left == [false; 3] {
        return 0.0;
    }
    let to_line = |(p, q): (Point, Point)| {
        let (along, square) = ((at - p).dot(q - p), (q - p).dot(q - p));
        let share = if square > 0.0 { (along / square).clamp(0.0, 1.0) } else { 0.0 };
        at.distance(Point::new(p.x + (q.x - p.x) * share, p.y + (q.y - p.y) * share))
    };
    sides.map(to_line).into_iter().fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::super::tests::floors;
    use super::super::{Jump, Planner, Smoother};
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
        let mut table = TimeTable::new(corners.len());
        table.plan(grid, corners, side, &LIMITS);
        table
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
            let corners = smoother.smooth(&grid, path.cells());
            prop_assume!(corners.len() > 1);
            let table = table(&grid, corners, side);
            let straight: f64 = super::super::smooth::length(corners) * side;
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
