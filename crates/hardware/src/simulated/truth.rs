//! What the judge knows: read from any thread, reachable for no agent.

use std::sync::Arc;

use sim::hand::{MOST_ADDED, Standing};
use sim::snapshot::{Disc, PersonMark, RobotMark, Scenery, Snapshot};
use sim::{Goal, HeadState, Progress, Simulator, WorldPlan};
use types::{Duration, Point, Time};

use super::Robot;
use crate::newest::{Newest, Publisher, newest};

/// A robot at one moment.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotMoment {
    /// Where it is, how it moves, what it touched.
    pub truth: sim::Truth,
    /// Where its head looks.
    pub head: HeadState,
    /// Whether it touches something.
    pub touching: bool,
    /// How far it has come on the way to its goal, if it has one.
    pub progress: Option<Progress>,
}

/// A person at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PersonMoment {
    /// Where the person is (m).
    pub at: Point,
    /// Where the person looks (rad): the way of a carried thing or of the last steps.
    pub facing: f64,
    /// The middle of the carried thing (m).
    pub carried: Option<Point>,
    /// Whether the person is there.
    pub present: bool,
}

/// Everything that moves, at one moment. Its rows have the length of the world's: it is written without memory being asked for.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Moment {
    time: Time,
    slipped: Duration,
    robots: Vec<RobotMoment>,
    people: Vec<PersonMoment>,
    added: [Option<Standing>; MOST_ADDED],
}

impl Moment {
    fn first(simulator: &Simulator, robots: &[Robot]) -> Moment {
        let robot = |(id, robot): (_, &Robot)| RobotMoment {
            truth: simulator.truth(id),
            head: simulator.head(id),
            touching: false,
            progress: robot.goal.as_ref().map(Goal::begin),
        };
        let people = simulator.plan().people.iter().map(|person| PersonMoment {
            at: person.at,
            facing: person.facing,
            carried: None,
            present: false,
        });
        let mut moment = Moment {
            time: Time::ZERO,
            slipped: Duration::ZERO,
            robots: simulator.robots().zip(robots).map(robot).collect(),
            people: people.collect(),
            added: *simulator.added(),
        };
        moment.take_people(simulator);
        moment
    }

    /// Takes in the present state of the world.
    pub(super) fn take(
        &mut self,
        simulator: &Simulator,
        slipped: Duration,
        progress: impl Fn(usize) -> Option<Progress>,
    ) {
        self.time = simulator.time();
        self.slipped = slipped;
        self.added = *simulator.added();
        for (id, robot) in simulator.robots().zip(&mut self.robots) {
            *robot = RobotMoment {
                truth: simulator.truth(id),
                head: simulator.head(id),
                touching: simulator.bumper(id) != 0,
                progress: progress(id.index()),
            };
        }
        self.take_people(simulator);
    }

    fn take_people(&mut self, simulator: &Simulator) {
        for (index, moment) in self.people.iter_mut().enumerate() {
            let place = simulator.person(index);
            moment.present = place.is_some();
            let Some((at, carried)) = place else { continue };
            let way = carried.map_or(at - moment.at, |thing| thing - at);
            if way.norm() > 1e-6 {
                moment.facing = way.bearing();
            }
            (moment.at, moment.carried) = (at, carried);
        }
    }
}

/// What stays the same, for the reader's side.
#[derive(Debug)]
struct Fixed {
    scenery: Scenery,
    plan: WorldPlan,
    robots: Vec<Robot>,
}

/// The truth of a simulated world, for the judge and for pictures. Reading it never makes the world wait.
#[derive(Clone, Debug)]
pub struct Truth {
    newest: Newest<Moment>,
    fixed: Arc<Fixed>,
}

pub(super) fn truth(simulator: &Simulator, robots: &[Robot]) -> (Publisher<Moment>, Truth) {
    let (publisher, newest) = newest(Moment::first(simulator, robots));
    let fixed =
        Fixed { scenery: simulator.scenery(), plan: simulator.plan().clone(), robots: robots.to_vec() };
    (publisher, Truth { newest, fixed: Arc::new(fixed) })
}

impl Truth {
    /// The world's own time: that of its last physics step.
    pub fn time(&self) -> Time {
        self.newest.read(|moment| moment.time)
    }

    /// How far the world has fallen behind the clock of who drives it; zero on a simulated clock.
    pub fn slipped(&self) -> Duration {
        self.newest.read(|moment| moment.slipped)
    }

    fn index(&self, robot: &str) -> Option<usize> {
        self.fixed.robots.iter().position(|known| known.name == robot)
    }

    /// A robot by its name.
    pub fn robot(&self, name: &str) -> Option<RobotMoment> {
        let index = self.index(name)?;
        self.newest.read(|moment| moment.robots.get(index).cloned())
    }

    /// All robots, by name, in the order in which they were added.
    pub fn robots(&self) -> Vec<(String, RobotMoment)> {
        let names = self.fixed.robots.iter().map(|robot| robot.name.clone());
        self.newest.read(|moment| names.clone().zip(moment.robots.iter().cloned()).collect())
    }

    /// A person by the name.
    pub fn person(&self, name: &str) -> Option<PersonMoment> {
        let index = self.fixed.plan.people.iter().position(|person| person.name == name)?;
        self.newest.read(|moment| moment.people.get(index).copied())
    }

    /// Whether every robot's goal is met or can no longer be; false when no robot has one.
    pub fn decided(&self) -> bool {
        self.newest.read(|moment| {
            let mut goals = moment.robots.iter().filter_map(|robot| robot.progress.as_ref()).peekable();
            goals.peek().is_some() && goals.all(Progress::decided)
        })
    }

    /// Whether every robot that has a goal met it; false when no robot has one.
    pub fn met(&self) -> bool {
        self.newest.read(|moment| {
            let mut goals = moment.robots.iter().filter_map(|robot| robot.progress.as_ref()).peekable();
            goals.peek().is_some() && goals.all(Progress::met)
        })
    }

    /// Says in a sentence where a robot stands on the way to its goal; nothing when it has none.
    pub fn why(&self, robot: &str) -> Option<String> {
        let index = self.index(robot)?;
        let goal = self.fixed.robots[index].goal.as_ref()?;
        let progress = self.newest.read(|moment| moment.robots.get(index)?.progress.clone())?;
        Some(goal.why(&progress))
    }

    /// When a robot met the stages that are behind it, the first twelve of them.
    pub fn passed(&self, robot: &str) -> Vec<Time> {
        let Some(index) = self.index(robot) else { return Vec::new() };
        let progress = self.newest.read(|moment| moment.robots.get(index)?.progress.clone());
        progress.map_or_else(Vec::new, |progress| progress.passed().to_vec())
    }

    /// What was added to the running world and stands there now.
    pub fn added(&self) -> Vec<Standing> {
        self.newest.read(|moment| moment.added.iter().flatten().copied().collect())
    }

    /// What stands still, to draw.
    pub fn scenery(&self) -> &Scenery {
        &self.fixed.scenery
    }

    /// The world that is simulated.
    pub fn plan(&self) -> &WorldPlan {
        &self.fixed.plan
    }

    /// What moves, to draw.
    pub fn snapshot(&self) -> Snapshot {
        let moment = self.newest.read(Moment::clone);
        let plan = &self.fixed.plan;
        let people = || plan.people.iter().zip(&moment.people).filter(|(_, person)| person.present);
        let standing = plan.things.iter().map(|thing| (thing, thing.at));
        let carried = people().filter_map(|(plan, person)| Some((plan.carries.as_ref()?, person.carried?)));
        Snapshot {
            time: moment.time,
            people: people()
                .map(|(plan, person)| PersonMark {
                    name: plan.name.clone(),
                    disc: Disc { centre: person.at, radius: plan.radius, colour: plan.shirt },
                    facing: person.facing,
                })
                .collect(),
            things: standing
                .chain(carried)
                .map(|(thing, centre)| Disc { centre, radius: thing.radius, colour: thing.colour })
                .collect(),
            added: moment.added.iter().flatten().copied().collect(),
            robots: self
                .fixed
                .robots
                .iter()
                .zip(&moment.robots)
                .map(|(robot, moment)| RobotMark {
                    name: robot.name.clone(),
                    pose: moment.truth.pose,
                    shape: robot.model.shape,
                    gaze: moment.truth.pose.heading + moment.head.pan,
                    touching: moment.touching,
                    colour: robot.model.colour,
                })
                .collect(),
        }
    }
}
