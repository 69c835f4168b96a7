//! The path planner: a way to a place, over what the robot has found to be free, at once and then as good as there is time for.
//!
//! ```text
//!  ranges ────▶ local map ─▶ ground ─▶ grid around the robot ─▶ field: a first way, then better ones ─▶ path
//!  odometry ──▶                                  ▲
//!  task, or the parameters ─▶ goal, by the wheels ┘
//! ```
//!
//! The grid moves with the wheels, so that a correction of the localizer moves no wall; the goal of a task is on the map, and each correction
//! moves it in the grid.
//!
//! The first way is the part of a step that must be done. What follows is taken as long as the runtime allows; it says how good the path is.
//! Of what nothing is known it takes that one can go there.

use std::any::Any;

use navigation::ground::{CELL, Ground};
use navigation::path::{Anytime, Cell, Field, Grid, Path as Found, Refined};
use perception::local_map::{LocalMap, MapParams};
use runtime::{Agent, Fault, Input, Output, Step};
use types::geometry::{PI, whole};
use types::messages::{Motion, Odometry, Path, Ranges, Task};
use types::params::Params;
use types::{Duration, Point, Pose, Time};

use crate::action::Whereabouts;
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
    /// How long what was near is remembered while no sensor hears it (time). 30 s: on the way of so long the odometry drifts by centimetres.
    #[param(default = Duration::secs(30), min = 0.0, max = 600.0)]
    pub remember: Duration,
}

impl PlannerParams {
    fn map(&self) -> MapParams {
        MapParams { rim: self.radius, cone: self.cone, keep: self.remember, ..MapParams::default() }
    }
}

/// So many cells on a side has the grid around the robot: 12.8 m.
const SIDE: u32 = 128;
/// So far around it the robot takes over what it has heard (m): the echoes that go into its map.
const SEEN: f64 = 2.2;
/// A closed start or goal is moved up to so many cells (1 m) to where the robot fits.
const NEARBY: u32 = 10;

/// Plans a way to a place around what stands about: a coarse one at once, then better ones up to the shortest.
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
        let path = self.plan.path();
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
    let task = task.filter(|task| task.motion == Motion::Path && task.number > 0)?;
    if task.frame.as_str() == ODOM {
        return Some(task.target.position());
    }
    Some(place.map_from_odometry?.inverse().transform(task.target.position()))
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
    /// The column and row on the floor of the first cell of the grid.
    corner: (i32, i32),
    /// Whether the goal lies beyond the grid.
    beyond: bool,
}

impl Default for Plan {
    fn default() -> Plan {
        Plan { grid: Grid::new(SIDE, SIDE), field: Field::new(SIDE, SIDE), corner: (0, 0), beyond: false }
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
        let start = fit(self.cell(here), &self.grid);
        let cell = self.cell(goal);
        self.beyond = self.middle(cell).distance(goal) > CELL;
        let goal = fit(cell, &self.grid);
        // Why there is none stands in the path: it has no points.
        let _ = self.field.begin(&self.grid, start, goal);
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

    /// The best way so far, as a message.
    fn path(&self) -> Path {
        let best: &Found = self.field.best();
        let mut path = Path {
            frame: ODOM.into(),
            found: !best.cells().is_empty(),
            cut: self.beyond,
            length: best.length() * CELL,
            quality: best.quality(),
            ..Path::default()
        };
        for corner in best.corners() {
            path.cut |= path.points.push(self.middle(corner).into()).is_err();
        }
        path
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::blank;

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
        plan.path()
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
        assert_eq!(path.points.len(), 2);
        assert!((path.points[1].x - 3.05).abs() < 1e-9 && (path.points[1].y - 0.05).abs() < 1e-9);
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
}
