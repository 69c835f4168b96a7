//! The path planner: a way to a place, over what the robot has found to be free, at once and then as good as there is time for.
//!
//! ```text
//!  ranges ────▶ local map ─▶ ground ─▶ grid around the robot ─▶ field: a first way, then better ones
//!  odometry ──▶                                  ▲                │ pulled straight, rounded at its corners
//!  task, or the parameters ─▶ goal, by the wheels ┘               ▼ and with speeds within what the drive can do
//!                                                               path
//! ```
//!
//! The grid moves with the wheels, so that a correction of the localizer moves no wall; the goal of a task is on the map, and each correction
//! moves it in the grid.
//!
//! The first way is the part of a step that must be done. What follows is taken as long as the runtime allows; it says how good the path is.
//! Of what nothing is known it takes that one can go there.

use std::any::Any;

use navigation::ground::{CELL, Ground};
use navigation::path::{
    Anytime, Cell, DriveLimits, Field, Grid, Path as Found, Refined, Smoother, TimeTable,
};
use perception::local_map::{LocalMap, MapParams};
use runtime::{Agent, Fault, Input, Output, Step};
use types::geometry::{PI, whole};
use types::messages::{Motion, Odometry, Path, Ranges, Task, WAYPOINTS, Waypoint};
use types::params::Params;
use types::{Duration, Point, Pose, Time};

use crate::action::{Whereabouts, bounded};
use crate::odometry::ODOM;
use crate::shared::echoes;

/// Where to, and how much room the robot needs.
#[derive(Clone, Debug, Params)]
pub struct PlannerParams {
    /// Where to while no task says it, ahead of where the odometry began (m).
    #[param(default = 0.0, min = -1000.0, max = 1000.0)]
    pub goal_x: f64,
    /// Where to, to the left of where the odometry began (m).
    #[param(default = 0.0, min = -1000.0, max = 1000.0)]
    pub goal_y: f64,
    /// Radius of the robot (m). 0.225 is that of the exploring robot.
    #[param(default = 0.225, min = 0.01, max = 2.0)]
    pub radius: f64,
    /// Room kept beside the body (m). 0.05 is half a cell: what stands in a cell may reach so far towards the body.
    #[param(default = 0.05, min = 0.0, max = 2.0)]
    pub room: f64,
    /// Half the opening angle of one beam (rad). PI / 12 is 15°, that of a common ultrasonic transducer; 0 for a laser.
    #[param(default = PI / 12.0, min = 0.0, max = 1.6)]
    pub cone: f64,
    /// Highest speed on the way (m/s). 0.4 is a slow walk.
    #[param(default = 0.4, min = 0.02, max = 10.0)]
    pub speed: f64,
    /// Rate at which the speed grows and falls on the way (m/s²). 0.5 starts without slip on a smooth floor.
    #[param(default = 0.5, min = 0.01, max = 20.0)]
    pub acceleration: f64,
    /// Highest acceleration to the side, in curves (m/s²). 0.3 takes an arc of half a metre at 0.39 m/s.
    #[param(default = 0.3, min = 0.01, max = 20.0)]
    pub sideways: f64,
    /// Highest turn rate (rad/s). 1 turns around in three seconds.
    #[param(default = 1.0, min = 0.05, max = 20.0)]
    pub turn_rate: f64,
    /// A corner of the way is cut so much before it at most (m), where there is room. 0.5: a body's length.
    #[param(default = 0.5, min = 0.0, max = 5.0)]
    pub rounding: f64,
    /// How long what was near is remembered while no sensor hears it (time). 30 s: on the way of so long the odometry drifts by centimetres.
    #[param(default = Duration::secs(30), min = 0.0, max = 600.0)]
    pub remember: Duration,
}

impl PlannerParams {
    fn map(&self) -> MapParams {
        MapParams { rim: self.radius, cone: self.cone, keep: self.remember, ..MapParams::default() }
    }

    /// What the drive may do on a way on which a task wants at most `speed` (m/s); zero for no bound.
    fn limits(&self, speed: f64) -> DriveLimits {
        DriveLimits {
            speed: bounded(self.speed, speed),
            acceleration: self.acceleration,
            sideways: self.sideways,
            turn_rate: self.turn_rate,
            rounding: self.rounding,
            ..DriveLimits::default()
        }
    }
}

/// So many cells on a side has the grid around the robot: 12.8 m.
const SIDE: u32 = 128;
/// So far around it the robot takes over what it has heard (m): the echoes that go into its map.
const SEEN: f64 = 2.2;
/// A closed start or goal is moved up to so many cells (1 m) to where the robot fits.
const NEARBY: u32 = 10;

/// Plans a way to a place around what stands about, with a speed for each place on it: a coarse one at once, then better ones up to the shortest.
#[derive(Agent)]
#[agent(anytime)]
pub struct PathPlanner {
    /// What is around.
    ranges: Input<Ranges>,
    /// Where the robot believes to be; the path is in the same frame. Without it nothing is planned.
    odometry: Input<Odometry>,
    /// Where to: it plans while the task is to go along a path. Where it is not wired, the parameters say where to, always.
    task: Input<Task>,
    /// Where the robot is on the map, from the localizer: for tasks whose goal is there.
    pose: Input<Odometry>,
    /// The way, with a bound of how good it is.
    #[port(history = 64)]
    path: Output<Path>,
    params: PlannerParams,
    survey: Survey,
    place: Whereabouts,
    asked: Option<Task>,
    plan: Plan,
}

impl Agent for PathPlanner {
    /// What it remembers of the floor.
    fn take_over(&mut self, before: &mut dyn Any) {
        if let Some(before) = before.downcast_mut::<PathPlanner>() {
            core::mem::swap(&mut self.survey, &mut before.survey);
        }
    }

    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        self.place.listen(&mut self.odometry, &mut self.pose, step.now);
        if let Some(odometry) = self.place.odometry {
            self.survey.pose = Some(odometry.pose);
        }
        self.asked = self.task.latest().or(self.asked);
        if let Some(received) = self.ranges.newest() {
            let stamp = received.header().stamp;
            let at = self.odometry.at(stamp).map(|found| found.value().pose);
            self.survey.hear(&self.params, &received, at, stamp);
        }
        let Some(pose) = self.survey.pose else { return Ok(()) };
        let own = Point::new(self.params.goal_x, self.params.goal_y);
        let Some(goal) = goal(self.task.is_wired(), self.asked.as_ref(), own, &self.place) else {
            return Ok(());
        };
        self.plan.begin(&self.params, &self.survey.ground, pose, goal);
        while step.may_refine() {
            if self.plan.field.refine() == Refined::Final {
                break;
            }
        }
        let asked = self.asked.filter(|_| self.task.is_wired()).map_or(0.0, |task| task.linear);
        let present = self.place.odometry.map_or(0.0, |odometry| odometry.twist.linear);
        let path = self.plan.path(&self.params.limits(asked), present);
        step.set_quality(path.quality);
        self.path.send(path);
        Ok(())
    }
}

/// Where to, in the frame of the wheels; nothing where nobody asks, or nobody knows where that is.
fn goal(is_asked: bool, task: Option<&Task>, own: Point, place: &Whereabouts) -> Option<Point> {
    if !is_asked {
        return Some(own);
    }
    place.goal(task.filter(|task| task.motion == Motion::Path)?)
}

/// What is known of the floor, and where the robot is.
#[derive(Debug, Default)]
struct Survey {
    map: LocalMap,
    ground: Ground,
    pose: Option<Pose>,
}

impl Survey {
    /// Takes over ranges that were measured at `at`; without it the last pose that was heard counts.
    fn hear(&mut self, params: &PlannerParams, ranges: &Ranges, at: Option<Pose>, stamp: Time) {
        let Some(here) = at.or(self.pose) else { return };
        self.map.set_params(params.map());
        self.map.update(echoes(ranges), here, stamp);
        // The ground goes with the robot, and forgets what it has left far behind.
        self.ground.tread(here.position(), params.radius);
        for (first, row) in self.map.squares(here.position(), SEEN) {
            self.ground.see_row(first, row.known, row.free, row.taken);
        }
    }
}

/// The floor around the robot as cells, and the way over it.
#[derive(Debug)]
struct Plan {
    grid: Grid,
    field: Field,
    smoother: Smoother,
    table: TimeTable,
    /// The column and row on the floor of the first cell of the grid.
    corner: (i32, i32),
    /// Whether the goal lies beyond the grid.
    beyond: bool,
    /// Where the robot is and where to, where there is room for it: the path begins and ends there, and not in the middle of a cell.
    ends: [Option<Point>; 2],
}

impl Default for Plan {
    fn default() -> Plan {
        Plan {
            grid: Grid::new(SIDE, SIDE),
            field: Field::new(SIDE, SIDE),
            smoother: Smoother::new(SIDE, SIDE),
            // No more than a message has room for: each corner gives a point at least.
            table: TimeTable::new(WAYPOINTS),
            corner: (0, 0),
            beyond: false,
            ends: [None; 2],
        }
    }
}

impl Plan {
    /// Draws the floor around the robot, and finds a first way.
    fn begin(&mut self, params: &PlannerParams, ground: &Ground, pose: Pose, goal: Point) {
        let here = pose.position();
        let half = SIDE as i32 / 2;
        self.corner = (whole(here.x / CELL) - half, whole(here.y / CELL) - half);
        self.draw(ground);
        self.grid.inflate((params.radius + params.room) / CELL);
        let fit = |cell: Cell, grid: &Grid| grid.nearest_open(cell, NEARBY).unwrap_or(cell);
        let cells = [here, goal].map(|at| self.cell(at));
        let fitted = cells.map(|cell| fit(cell, &self.grid));
        self.beyond = self.middle(cells[1]).distance(goal) > CELL;
        self.ends = [
            (fitted[0] == cells[0]).then_some(here),
            (fitted[1] == cells[1] && !self.beyond).then_some(goal),
        ];
        // Why there is none stands in the path: it has no points.
        let _ = self.field.begin(&self.grid, fitted[0], fitted[1]);
    }

    fn draw(&mut self, ground: &Ground) {
        for y in 0..SIDE {
            for x in 0..SIDE {
                let cell = Cell::new(x, y);
                let taken = ground.is_tight(self.middle(cell), CELL / 4.0);
                self.grid.set(cell, taken);
            }
        }
    }

    /// The cell of a point; of one outside the nearest at the rim.
    fn cell(&self, at: Point) -> Cell {
        let along =
            |at: f64, first: i32| whole(at / CELL).saturating_sub(first).clamp(0, SIDE as i32 - 1) as u32;
        Cell::new(along(at.x, self.corner.0), along(at.y, self.corner.1))
    }

    fn middle(&self, cell: Cell) -> Point {
        let along = |i: u32, first: i32| (f64::from(first + i as i32) + 0.5) * CELL;
        Point::new(along(cell.x, self.corner.0), along(cell.y, self.corner.1))
    }

    /// The first corner of the grid on the floor.
    fn origin(&self) -> Point {
        Point::new(f64::from(self.corner.0), f64::from(self.corner.1)) * CELL
    }

    /// The best way so far, as a message, for a robot that drives at `present` (m/s).
    fn path(&mut self, limits: &DriveLimits, present: f64) -> Path {
        let origin = self.origin();
        let best: &Found = self.field.best();
        let [start, goal] = self.ends.map(|end| end.map(|at| at - origin));
        let corners = self.smoother.lead(&self.grid, best.cells(), CELL, start, goal);
        self.table.plan(&self.grid, corners, CELL, limits, present);
        let mut path = Path {
            frame: ODOM.into(),
            found: !corners.is_empty(),
            cut: self.beyond || corners.len() > WAYPOINTS,
            length: self.table.length(),
            quality: best.quality(),
            seconds: self.table.duration(),
            ..Path::default()
        };
        // Where the robot stands at its goal there is but that.
        let only = corners.last().filter(|_| path.seconds == 0.0).map(|only| (*only, 0.0));
        for (at, speed) in self.table.points().chain(only) {
            path.cut |= path.points.push(Waypoint { speed, ..(at + origin).into() }).is_err();
        }
        path
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::blank;
    use proptest::prelude::*;

    /// A survey that has heard walls around, with a gap at the right, from the middle of a room.
    fn room() -> Survey {
        let mut survey = Survey { pose: Some(Pose::default()), ..Survey::default() };
        let mut ranges = blank(12, 0.15, 5.0);
        ranges.values.fill(1.2);
        ranges.values[9] = 5.0;
        for i in 0..4 {
            let stamp = Time::ZERO + Duration::millis(250 * i);
            survey.hear(&PlannerParams { cone: 0.2, ..PlannerParams::default() }, &ranges, None, stamp);
        }
        survey
    }

    fn to(goal_x: f64, goal_y: f64) -> PlannerParams {
        PlannerParams { goal_x, goal_y, ..PlannerParams::default() }
    }

    /// The path after all refinements.
    fn path(params: &PlannerParams, survey: &Survey) -> Path {
        let mut plan = Plan::default();
        plan.begin(params, &survey.ground, Pose::default(), Point::new(params.goal_x, params.goal_y));
        while plan.field.refine() != Refined::Final {}
        plan.path(&params.limits(0.0), 0.0)
    }

    #[test]
    fn a_task_says_where_to_on_the_map_and_nobody_plans_without_one() {
        let own = Point::new(1.0, 2.0);
        let mut place = Whereabouts::default();
        assert_eq!(goal(false, None, own, &place), Some(own), "nobody can ask");
        let target = Pose::new(5.0, 1.0, 0.0);
        let task = Task { number: 1, motion: Motion::Path, frame: "map".into(), target, ..Task::default() };
        assert_eq!(goal(true, None, own, &place), None);
        assert_eq!(goal(true, Some(&Task { motion: Motion::Goto, ..task }), own, &place), None, "straight");
        assert_eq!(goal(true, Some(&task), own, &place), None, "nobody knows where the map is");
        place.map_from_odometry = Some(Pose::new(2.0, 1.0, PI));
        let there = goal(true, Some(&task), own, &place).unwrap();
        assert!((there.x + 3.0).abs() < 1e-12 && there.y.abs() < 1e-12, "{there:?}");
        let by_wheels = Task { frame: ODOM.into(), ..task };
        assert_eq!(goal(true, Some(&by_wheels), own, &place), Some(target.position()));
    }

    #[test]
    fn over_free_floor_the_way_is_straight() {
        let path = path(&to(3.0, 0.0), &Survey { pose: Some(Pose::default()), ..Survey::default() });
        assert!(path.found && !path.cut && path.quality == 1.0);
        assert!((path.length - 3.0).abs() < 1e-9, "{}", path.length);
        // From the robot to the place itself, not to the middles of their cells; 0.16 m to 0.4 m/s, and as much to brake.
        let points = path.points.iter().map(|point| (point.x, point.y, point.speed));
        let expected = [(0.0, 0.0, 0.0), (0.16, 0.0, 0.4), (2.84, 0.0, 0.4), (3.0, 0.0, 0.0)];
        for (point, expected) in points.zip(expected) {
            let off = [point.0 - expected.0, point.1 - expected.1, point.2 - expected.2];
            assert!(off.iter().all(|off| off.abs() < 1e-6), "{:?}", path.points);
        }
        assert!(path.points.len() == 4 && (path.seconds - (3.0 / 0.4 + 0.4 / 0.5)).abs() < 1e-9, "{path:?}");
    }

    #[test]
    fn out_of_a_room_the_way_leads_through_its_gap() {
        let survey = room();
        let path = path(&to(3.0, 0.0), &survey);
        assert!(path.found, "{path:?}");
        // The wall ahead is at 1.2 m, the gap at the right.
        assert!(path.length > 4.0, "{path:?}");
        assert!(path.points.iter().any(|point| point.y < -1.2 && point.x.abs() < 0.6), "{path:?}");
        let free = |point: &&types::messages::Waypoint| survey.ground.is_tight(Point::from(**point), 0.2);
        assert_eq!(path.points.iter().find(free), None);
    }

    #[test]
    fn a_goal_beyond_the_grid_is_neared_and_one_that_is_taken_is_met_beside() {
        let survey = room();
        let far = path(&to(0.0, -90.0), &survey);
        assert!((far.points.last().unwrap().y + 6.35).abs() < 1e-9 && far.cut, "{far:?}");
        let beside = path(&to(1.2, 0.0), &survey);
        let end = Point::from(*beside.points.last().unwrap());
        assert!(beside.found && end.distance(Point::new(1.2, 0.0)) < 0.5 && end.x < 1.0, "{end:?}");
    }

    #[test]
    fn a_robot_at_its_goal_has_a_way_of_one_point_and_one_without_a_way_has_none() {
        let survey = Survey { pose: Some(Pose::default()), ..Survey::default() };
        let there = path(&to(0.0, 0.0), &survey);
        assert!(there.found && (there.seconds, there.length) == (0.0, 0.0), "{there:?}");
        assert_eq!(there.points.last().map(|point| (point.x, point.y)), Some((0.0, 0.0)));
        let mut shut = Survey { pose: Some(Pose::default()), ..Survey::default() };
        (0..64).for_each(|i| {
            let side = f64::from(i) * CELL - 3.15;
            [(side, 1.05), (side, -1.05), (1.05, side), (-1.05, side)]
                .iter()
                .for_each(|(x, y)| stand(&mut shut, *x, *y));
        });
        let none = path(&to(3.0, 0.0), &shut);
        assert!(!none.found && none.points.is_empty() && none.quality == 0.0, "{none:?}");
    }

    /// Puts something into a cell.
    fn stand(survey: &mut Survey, x: f64, y: f64) {
        survey.ground.see_row(Point::new(x, y), 1, 0, 1);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(150))]

        /// Whatever stands about, the way that is published stays clear of it by the robot's radius, and ends in the very place.
        #[test]
        fn no_way_leads_through_what_stands_there_with_the_radius_of_the_robot(
            things in proptest::collection::vec((-40..40i32, -40..40i32, 1..8i32, 1..8i32), 0..40),
            goal in (-3.9..3.9f64, -3.9..3.9f64), start in (-0.049..0.049f64, -0.049..0.049f64), refined in 0..40u32,
            present in 0.0..0.4f64,
        ) {
            let start = Pose::new(start.0, start.1, 0.0);
            let params = PlannerParams { radius: 0.34, room: 0.08, ..to(goal.0, goal.1) };
            let mut survey = Survey { pose: Some(start), ..Survey::default() };
            let cells = things.iter().flat_map(|(x, y, w, h)| (0..*w).flat_map(move |i| (0..*h).map(move |j| (x + i, y + j))));
            let middle = |i: i32| (f64::from(i) + 0.5) * CELL;
            let cells: Vec<Point> = cells.map(|(i, j)| Point::new(middle(i), middle(j))).collect();
            cells.iter().for_each(|at| stand(&mut survey, at.x, at.y));
            let (mut plan, goal) = (Plan::default(), Point::new(goal.0, goal.1));
            plan.begin(&params, &survey.ground, start, goal);
            for _ in 0..refined {
                plan.field.refine();
            }
            let limits = params.limits(0.0);
            let path = plan.path(&limits, present);
            prop_assume!(path.found);
            let points: Vec<Point> = path.points.iter().map(|point| Point::from(*point)).collect();
            // The middle of a cell is no farther from what is in it than half its diagonal, by which the room is wider.
            for two in points.windows(2) {
                for i in 0..=40 {
                    let at = two[0] + (two[1] - two[0]) * (f64::from(i) / 40.0);
                    let near = cells.iter().map(|cell| cell.distance(at)).fold(f64::INFINITY, f64::min);
                    prop_assert!(near > params.radius, "{} m at {:?}", near, at);
                }
            }
            if !path.cut && plan.ends[1].is_some() {
                prop_assert!(points.last().unwrap().distance(goal) < 1e-12);
                prop_assert_eq!(path.points.last().unwrap().speed, 0.0);
            }
            for point in path.points.iter() {
                prop_assert!((0.0..=limits.speed).contains(&point.speed));
            }
        }
    }
}
