//! The agent through which a running world is changed: things are added, moved and taken away, robots are pushed, carried and slip.
//!
//! ```text
//!   calls ─▶ World ─▶ the simulator that the drivers share ─▶ answers: done, or why not
//! ```
//!
//! It belongs on the executor of the gates, as the drivers do. What it is asked is in the log as any call is, so a run can be
//! repeated with it.

use std::sync::{Arc, Mutex};

use runtime::{Agent, AgentType, Fault, NoParams, Service, Step};
use sim::hand::{HandError, Standing};
use sim::model::Shape;
use sim::{Colour, Simulator};
use types::messages::{WorldAnswer, WorldName, WorldPlace, WorldPush, WorldSlip, WorldThing};
use types::{Duration, Name, Pose, Text};

use super::locked;
use super::world::World as Shared;

/// The services of the agent [`World`]: what makes it run.
pub const SERVICES: [&str; 5] = ["add", "remove", "put", "push", "slip"];
/// The height of a thing of which nothing else is said (m): a laser and a camera see it.
const USUAL_HEIGHT: f64 = 1.0;
/// The colour of a thing of which nothing else is said.
const USUAL_COLOUR: Colour = Colour([135, 137, 140]);

/// A way to a running world for who changes it. Clones lead to the same world.
#[derive(Clone, Debug)]
pub struct Hands(pub(super) Arc<Mutex<Shared>>);

/// The agent type that changes a world, without one: for who asks what services there are.
pub fn services() -> AgentType {
    AgentType::made_by(|_| <World as runtime::Declare>::build(NoParams))
}

impl Hands {
    /// The agent type that changes this world, under the name `kind` in plans.
    pub fn agent_type(&self, kind: &'static str) -> AgentType {
        let hands = self.clone();
        AgentType::made_by(move |_| {
            let mut world = <World as runtime::Declare>::build(NoParams);
            world.hands = Some(hands.clone());
            world
        })
        .named(kind)
    }
}

/// Changes the simulated world as it is asked to.
#[derive(Agent)]
#[agent(kind = "world")]
pub struct World {
    /// Puts a box or a cylinder into the world. It may not stand in a robot or a person.
    add: Service<WorldThing, WorldAnswer>,
    /// Takes a thing away that was added.
    remove: Service<WorldName, WorldAnswer>,
    /// Puts a thing that was added, or a robot, elsewhere.
    put: Service<WorldPlace, WorldAnswer>,
    /// Pushes a robot, up to the first contact.
    push: Service<WorldPush, WorldAnswer>,
    /// Lets the wheels of a robot slip for some time.
    slip: Service<WorldSlip, WorldAnswer>,
    hands: Option<Hands>,
}

impl Agent for World {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        let World { add, remove, put, push, slip, hands } = self;
        let Some(Hands(world)) = hands else { return Ok(()) };
        let mut world = locked(world);
        // What is done now is done to the world as it is now, whoever polled it last.
        world.advance(step.now);
        while let Some((thing, call)) = add.take() {
            let done = world.change(|simulator| simulator.add(standing(&thing)?).map(|()| 1.0));
            add.answer(&call, answer(done));
        }
        while let Some((thing, call)) = remove.take() {
            let done = world.change(|simulator| simulator.remove(thing.name.as_str()).map(|()| 1.0));
            remove.answer(&call, answer(done));
        }
        while let Some((place, call)) = put.take() {
            let pose = Pose::new(place.x, place.y, place.heading);
            let done = world.change(|simulator| simulator.relocate(place.name.as_str(), pose).map(|()| 1.0));
            put.answer(&call, answer(done));
        }
        while let Some((by, call)) = push.take() {
            let done = world.change(|simulator| {
                let robot = robot(simulator, &by.robot)?;
                simulator.push(robot, by.ahead, by.left, by.turn)
            });
            push.answer(&call, answer(done));
        }
        while let Some((lost, call)) = slip.take() {
            let done = world.change(|simulator| {
                let robot = robot(simulator, &lost.robot)?;
                let time = seconds(lost.seconds)?;
                simulator.slip(robot, lost.left, lost.right, time).map(|()| 1.0)
            });
            slip.answer(&call, answer(done));
        }
        Ok(())
    }
}

fn robot(simulator: &Simulator, name: &Name) -> Result<sim::RobotId, HandError> {
    simulator.find(name.as_str()).ok_or(HandError::NoSuch(*name))
}

fn seconds(seconds: f64) -> Result<Duration, HandError> {
    const LONGEST: f64 = 1e6;
    if !(0.0..=LONGEST).contains(&seconds) {
        return Err(HandError::Number("time"));
    }
    Ok(Duration::from_seconds(seconds))
}

fn standing(thing: &WorldThing) -> Result<Standing, HandError> {
    let shape = match thing.radius {
        0.0 => Shape::Rectangle { length: thing.length, width: thing.width, ahead: 0.0 },
        radius => Shape::Round { radius },
    };
    let colour = match thing.colour.as_str() {
        "" => USUAL_COLOUR,
        word => Colour::read(word).ok_or(HandError::Number("colour"))?,
    };
    Ok(Standing {
        name: thing.name,
        shape,
        pose: Pose::new(thing.x, thing.y, thing.heading),
        height: if thing.height == 0.0 { USUAL_HEIGHT } else { thing.height },
        colour,
    })
}

fn answer(done: Result<f64, HandError>) -> WorldAnswer {
    match done {
        Ok(part) => WorldAnswer { done: true, why: Text::default(), part },
        Err(error) => WorldAnswer { done: false, why: error.text(), part: 0.0 },
    }
}
