//! The running world: commands in, sensor values and truth out, one step of 10 ms at a time.

use types::geometry::{Pose, wrap};
use types::{Duration, Point, Time};

use crate::field::{Body, Field};
use crate::hand::Added;
use crate::model::Model;
use crate::outline::{self, Look};
use crate::people::Walker;
use crate::plan::{Region, WorldPlan};
use crate::robot::{Charge, HeadState, Robot, Truth};
use crate::shape::Circle;
use crate::solid::Solid;
use crate::{laser, sonar};

/// The physics step.
pub const PHYSICS_STEP: Duration = Duration::millis(10);

/// A robot of a [`Simulator`]. It is valid for the simulator that gave it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RobotId(u32);

impl RobotId {
    /// Its number: robots are counted from zero in the order in which they were added.
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

/// A robot cannot be added.
#[derive(Clone, Debug, PartialEq)]
pub enum AddError {
    /// There is a robot of this name already: give it another.
    NameTaken(String),
    /// The place is not free: something is nearer to it than the robot is wide. Holds that distance (m).
    NotFree(f64),
    /// The pose is no place.
    NoPlace,
}

impl std::fmt::Display for AddError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            AddError::NameTaken(name) => {
                write!(f, "there is a robot \"{name}\" already; give this one another name")
            }
            AddError::NotFree(distance) => {
                write!(f, "the robot has no room there: something is {distance:.2} m from its middle")
            }
            AddError::NoPlace => f.write_str("a start needs finite coordinates"),
        }
    }
}

impl std::error::Error for AddError {}

/// A running world.
///
/// Sensors are read on demand with a sample number. The noise of a reading is a function of seed, robot, sensor and
/// sample number alone, so reading or leaving out a sensor changes nothing else.
#[derive(Clone, Debug)]
pub struct Simulator {
    pub(crate) plan: WorldPlan,
    pub(crate) field: Field,
    pub(crate) looks: Vec<Look>,
    pub(crate) robots: Vec<Robot>,
    pub(crate) people: Vec<Walker>,
    pub(crate) noise: crate::camera::NoiseTable,
    pub(crate) added: Added,
    pub(crate) seed: u64,
    steps: u64,
}

impl Simulator {
    /// The world of `plan` at time zero, without robots.
    pub fn new(plan: &WorldPlan, seed: u64) -> Simulator {
        let (mut field, looks) = outline::raise(plan);
        let plan = crate::crowd::peopled(plan, &field, seed);
        let people = plan
            .people
            .iter()
            .map(|person| {
                let solid = Solid::Round(Circle { centre: person.at, radius: person.radius });
                let present = person.appears.is_none();
                let body = field.add_body(Body { solid, high: person.height, person: true, present });
                Walker::new(person, body, &plan, seed)
            })
            .collect();
        let added = Added::new(&mut field);
        Simulator {
            plan,
            field,
            looks,
            robots: Vec::new(),
            people,
            noise: crate::camera::NoiseTable::new(seed),
            added,
            seed,
            steps: 0,
        }
    }

    /// Adds a robot. Its name is also the name of its streams of chance.
    ///
    /// # Errors
    /// When the name is taken or the place is not free; then nothing is added.
    pub fn add_robot(&mut self, name: &str, model: Model, pose: Pose) -> Result<RobotId, AddError> {
        if self.find(name).is_some() {
            return Err(AddError::NameTaken(name.to_owned()));
        }
        if !(pose.x.is_finite() && pose.y.is_finite() && pose.heading.is_finite()) {
            return Err(AddError::NoPlace);
        }
        let pose = Pose { heading: wrap(pose.heading), ..pose };
        let solid = model.shape.solid(pose);
        for walker in &mut self.people {
            walker.make_room(&solid, &mut self.field);
        }
        self.check_free(&solid, pose, model.height, u32::MAX)?;
        let body = self.field.add_body(Body { solid, high: model.height, person: false, present: true });
        self.robots.push(Robot::new(name, model, body, pose, self.seed));
        self.robots.iter_mut().for_each(Robot::look_again);
        Ok(RobotId(self.robots.len() as u32 - 1))
    }

    /// The robot of this name.
    pub fn find(&self, name: &str) -> Option<RobotId> {
        self.robots.iter().position(|robot| robot.name == name).map(|index| RobotId(index as u32))
    }

    /// All robots in the order in which they were added.
    pub fn robots(&self) -> impl Iterator<Item = RobotId> + use<> {
        (0..self.robots.len() as u32).map(RobotId)
    }

    /// The name of a robot.
    pub fn name(&self, id: RobotId) -> &str {
        &self.robots[id.index()].name
    }

    /// What a robot is made of.
    pub fn model(&self, id: RobotId) -> &Model {
        &self.robots[id.index()].model
    }

    /// The plan of the world, with all people of its crowds.
    pub fn plan(&self) -> &WorldPlan {
        &self.plan
    }

    /// Puts a robot elsewhere, as a hand would (to drag it, or to lift it out of a corner). It stands then.
    ///
    /// # Errors
    /// When the place is not free; then it stays where it is.
    pub fn put(&mut self, id: RobotId, pose: Pose) -> Result<(), AddError> {
        if !(pose.x.is_finite() && pose.y.is_finite() && pose.heading.is_finite()) {
            return Err(AddError::NoPlace);
        }
        let robot = &self.robots[id.index()];
        let (solid, body) = (robot.model.shape.solid(pose), robot.body);
        self.check_free(&solid, pose, robot.model.height, body)?;
        self.robots[id.index()].put(Pose { heading: wrap(pose.heading), ..pose });
        self.field.place_body(body, solid);
        self.robots.iter_mut().for_each(Robot::look_again);
        Ok(())
    }

    /// Whether nothing stands where a body of this height would.
    pub(crate) fn check_free(
        &self,
        solid: &Solid,
        pose: Pose,
        height: f64,
        skip: u32,
    ) -> Result<(), AddError> {
        match self.field.clearance(solid, 0.0, height, skip) {
            Some(near) => Err(AddError::NotFree(near.point.distance(pose.position()))),
            None => Ok(()),
        }
    }

    /// Sets the speeds of the wheels (rad/s, forward positive). They hold until the next command or the motor watchdog.
    ///
    /// Speeds beyond the motors' limit are cut; what is not a number counts as zero.
    pub fn command_wheels(&mut self, id: RobotId, left: f64, right: f64) {
        let now = self.time();
        self.robots[id.index()].command_wheels(left, right, now);
    }

    /// Turns the head towards `pan` (rad, left positive) and `tilt` (rad, up positive), at its own speed and within its limits.
    pub fn command_head(&mut self, id: RobotId, pan: f64, tilt: f64) {
        self.robots[id.index()].command_head(pan, tilt);
    }

    /// Simulated time since the start.
    pub fn time(&self) -> Time {
        Time(self.steps as i64 * PHYSICS_STEP.0)
    }

    /// One physics step of 10 ms: people walk, wheels turn, robots travel up to their first contact.
    pub fn step(&mut self) {
        let now = self.time();
        let mut drift = 0.0f64;
        for walker in &mut self.people {
            if walker.acts() {
                drift = drift.max(walker.step(now, &self.robots, &mut self.field));
                if let Some((robot, point)) = walker.touched.take() {
                    self.robots[robot].is_touched(&self.field, walker.body, point);
                }
            }
        }
        for robot in &mut self.robots {
            drift = drift.max(robot.turn_wheels(now, self.steps));
        }
        for robot in &mut self.robots {
            robot.travel(&mut self.field, drift);
        }
        self.steps += 1;
    }

    /// Steps until `time` is reached.
    pub fn run_until(&mut self, time: Time) {
        while self.time() < time {
            self.step();
        }
    }

    /// What the judge knows of a robot.
    pub fn truth(&self, id: RobotId) -> Truth {
        self.robots[id.index()].truth
    }

    /// Fills `out` with the ranges of the sonar ring (m) and gives their number: zero without sonars.
    ///
    /// The first looks straight ahead, the others follow to the left. No echo reads as the longest range.
    pub fn sonar(&self, id: RobotId, sample: u64, out: &mut [f32]) -> usize {
        let count = self.robots[id.index()]
            .model
            .sonar
            .as_ref()
            .map_or(0, |sonar| sonar.count as usize)
            .min(out.len());
        for (which, range) in out[..count].iter_mut().enumerate() {
            *range = self.sonar_range(id, which, sample).unwrap_or(0.0);
        }
        count
    }

    /// The range of one sonar (m); nothing when there is no such sensor. For rings that fire one after another.
    pub fn sonar_range(&self, id: RobotId, which: usize, sample: u64) -> Option<f32> {
        let robot = &self.robots[id.index()];
        let model = robot.model.sonar.as_ref()?;
        let echo = self.sonar_echo(id, which)?;
        Some(sonar::reading(model, echo, robot.streams.sonar.sample(sample).sample(which as u64)))
    }

    /// The distance of the first echo without noise (m), `Some(None)` without an echo; nothing when there is no such sensor.
    pub fn sonar_echo(&self, id: RobotId, which: usize) -> Option<Option<f64>> {
        let robot = &self.robots[id.index()];
        let (model, fan) = (robot.model.sonar.as_ref()?, robot.fan.as_ref()?);
        (which < model.count as usize)
            .then(|| fan.echo(&self.field, model, robot.truth.pose, robot.body, which))
    }

    /// Fills `out` with the ranges of the laser (m), from right to left, and gives their number: zero without a laser.
    ///
    /// The angle of each is [`beam_angle`](crate::laser::beam_angle). A beam without return reads as the longest range.
    pub fn scan(&self, id: RobotId, sample: u64, out: &mut [f32]) -> usize {
        let robot = &self.robots[id.index()];
        let Some(model) = &robot.model.laser else { return 0 };
        let draw = robot.streams.laser.sample(sample);
        laser::scan(&self.field, model, &robot.beams, robot.truth.pose, robot.body, draw, out)
    }

    /// The pressed sectors of the bumper ring, a bit each; bit 0 is straight ahead, the next is to its left.
    pub fn bumper(&self, id: RobotId) -> u32 {
        self.robots[id.index()].bumper()
    }

    /// Encoder ticks of the left and the right wheel since the start.
    pub fn ticks(&self, id: RobotId) -> [i64; 2] {
        self.robots[id.index()].ticks()
    }

    /// Turn rate as the gyro tells it (rad/s).
    pub fn gyro(&self, id: RobotId, sample: u64) -> f64 {
        let robot = &self.robots[id.index()];
        robot.truth.angular + robot.gyro_bias + robot.model.gyro.noise * robot.streams.gyro.normal(sample)
    }

    /// The battery.
    pub fn battery(&self, id: RobotId) -> Charge {
        self.robots[id.index()].charge()
    }

    /// Where the head looks.
    pub fn head(&self, id: RobotId) -> HeadState {
        self.robots[id.index()].head
    }

    /// Where a person, thing or landmark of this name is (m), and its radius (m); nothing while it is hidden or when there is none.
    ///
    /// A thing that a person carries is found by its own name.
    pub fn locate(&self, name: &str) -> Option<(Point, f64)> {
        if let Some(thing) = self.plan.things.iter().find(|thing| thing.name == name) {
            return Some((thing.at, thing.radius));
        }
        if let Some(landmark) = self.plan.landmarks.iter().find(|landmark| landmark.name == name) {
            return Some((landmark.at, landmark.radius));
        }
        self.people.iter().filter(|walker| walker.present).find_map(|walker| {
            if walker.plan.name == name {
                return Some((walker.at, walker.plan.radius));
            }
            let thing = walker.plan.carries.as_ref().filter(|thing| thing.name == name)?;
            Some((walker.hands()?, thing.radius))
        })
    }

    /// Where the person of this number in the plan is, and the middle of what the person carries (m); nothing while hidden.
    pub fn person(&self, index: usize) -> Option<(Point, Option<Point>)> {
        let walker = self.people.get(index).filter(|walker| walker.present)?;
        Some((walker.at, walker.hands()))
    }

    /// Whether the person of this name walked in the last step.
    pub fn walks(&self, name: &str) -> bool {
        self.people.iter().any(|walker| walker.present && walker.walking && walker.plan.name == name)
    }

    /// The regions in which a robot is.
    pub fn regions_of(&self, id: RobotId) -> impl Iterator<Item = &Region> {
        let at = self.robots[id.index()].truth.pose.position();
        self.plan.regions.iter().filter(move |region| region.contains(at))
    }
}
