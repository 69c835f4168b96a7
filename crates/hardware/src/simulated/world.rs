//! The world that several drivers share.

use sim::camera::Canvas;
use sim::{Goal, PHYSICS_STEP, Progress, RobotId, Simulator, WorldPlan};
use types::{Duration, Time};

use super::truth::{Moment, Truth, truth};
use super::{Robot, SetupError};
use crate::newest::Publisher;

/// The most physics steps that one poll makes up for. Beyond it the world slips behind the clock: a stall of the host must not
/// make the gate's thread compute for long.
const CATCH_UP: Duration = Duration::secs(1);

/// A robot in the world, with what its driver must know of every physics step.
#[derive(Debug)]
struct Seat {
    id: RobotId,
    pressed: u32,
    newly_pressed: u32,
    goal: Option<(Goal, Progress)>,
}

/// A simulator with its robots, goals and the clock of who polls it.
#[derive(Debug)]
pub(super) struct World {
    simulator: Simulator,
    seats: Vec<Seat>,
    /// The caller's time at the world's time zero.
    origin: Option<Time>,
    slipped: Duration,
    publisher: Publisher<Moment>,
}

impl World {
    pub(super) fn new(plan: &WorldPlan, seed: u64, robots: &[Robot]) -> Result<(World, Truth), SetupError> {
        let mut simulator = Simulator::new(plan, seed);
        let mut seats = Vec::with_capacity(robots.len());
        for robot in robots {
            let added = simulator.add_robot(&robot.name, robot.model.clone(), robot.start);
            let id = added.map_err(|cause| SetupError::Add { robot: robot.name.clone(), cause })?;
            let goal = robot.goal.clone().map(|goal| {
                let progress = goal.begin();
                (goal, progress)
            });
            seats.push(Seat { id, pressed: 0, newly_pressed: 0, goal });
        }
        let (publisher, truth) = truth(&simulator, robots);
        Ok((World { simulator, seats, origin: None, slipped: Duration::ZERO, publisher }, truth))
    }

    /// The memory for the pictures of a robot.
    pub(super) fn canvas(&self, id: RobotId) -> Canvas {
        self.simulator.canvas(id)
    }

    pub(super) fn ids(&self) -> impl Iterator<Item = RobotId> + use<> {
        self.simulator.robots()
    }

    pub(super) fn simulator(&self) -> &Simulator {
        &self.simulator
    }

    /// Has the world changed from outside, and tells of it at once.
    pub(super) fn change<T>(&mut self, deed: impl FnOnce(&mut Simulator) -> T) -> T {
        let done = deed(&mut self.simulator);
        self.publish();
        done
    }

    /// Steps the world to the caller's time, never beyond it. Gives the caller's time of the state that it is in then.
    pub(super) fn advance(&mut self, now: Time) -> Time {
        let origin = *self.origin.get_or_insert(now);
        let mut target = Time::ZERO + (now - origin - self.slipped);
        let behind = target - self.simulator.time();
        if behind > CATCH_UP {
            self.slipped += behind - CATCH_UP;
            target = self.simulator.time() + CATCH_UP;
        }
        let before = self.simulator.time();
        while self.simulator.time() + PHYSICS_STEP <= target {
            self.step();
        }
        if self.simulator.time() != before {
            self.publish();
        }
        origin + self.slipped + self.simulator.time().since_start()
    }

    /// One physics step. A bumper that becomes pressed stops its robot's wheels before anybody is told.
    fn step(&mut self) {
        self.simulator.step();
        for seat in &mut self.seats {
            let pressed = self.simulator.bumper(seat.id);
            let new = pressed & !seat.pressed;
            seat.pressed = pressed;
            if new != 0 {
                seat.newly_pressed |= new;
                self.simulator.command_wheels(seat.id, 0.0, 0.0);
            }
            if let Some((goal, progress)) = seat.goal.as_mut().filter(|(_, progress)| !progress.decided()) {
                goal.watch(progress, &self.simulator, seat.id);
            }
        }
    }

    /// The sectors that became pressed since the last call.
    pub(super) fn take_presses(&mut self, id: RobotId) -> u32 {
        self.seats.get_mut(id.index()).map_or(0, |seat| core::mem::take(&mut seat.newly_pressed))
    }

    pub(super) fn command_wheels(&mut self, id: RobotId, left: f64, right: f64) {
        self.simulator.command_wheels(id, left, right);
    }

    pub(super) fn command_head(&mut self, id: RobotId, pan: f64, tilt: f64) {
        self.simulator.command_head(id, pan, tilt);
    }

    fn publish(&self) {
        let progress =
            |robot: usize| self.seats.get(robot)?.goal.as_ref().map(|(_, progress)| progress.clone());
        // Where four readers sleep over old values this moment is left out, and the next comes in 10 ms.
        self.publisher.publish(|moment| moment.take(&self.simulator, self.slipped, progress));
    }
}

#[cfg(test)]
mod tests {
    use sim::Model;
    use types::Pose;

    use super::*;

    fn world(start: Pose) -> (World, RobotId) {
        let robot = Robot { name: "h1".into(), model: Model::h1(), start, goal: None };
        let (world, _) = World::new(&WorldPlan::hall(10.0, 10.0), 1, &[robot]).unwrap();
        let id = world.ids().next().unwrap();
        (world, id)
    }

    #[test]
    fn a_press_stops_the_wheels_before_anybody_is_told() {
        // 3 cm in front of the wall, with a command that holds for half a second.
        let (mut world, id) = world(Pose::new(10.0 - 0.225 - 0.03, 5.0, 0.0));
        world.advance(Time::ZERO);
        world.command_wheels(id, 5.0, 5.0);
        world.advance(Time::from_seconds(0.3));
        assert_eq!((world.take_presses(id), world.take_presses(id)), (1, 0));
        // Lifted away from the wall it would drive on, were the command still in force.
        world.simulator.put(id, Pose::new(5.0, 5.0, 0.0)).unwrap();
        world.advance(Time::from_seconds(0.4));
        assert_eq!(world.simulator.truth(id).linear, 0.0);
        world.command_wheels(id, 5.0, 5.0);
        world.advance(Time::from_seconds(0.5));
        assert!(world.simulator.truth(id).linear > 0.1, "a new command moves it");
    }

    #[test]
    fn it_is_never_ahead_of_its_caller_and_slips_behind_a_stalled_one() {
        let (mut world, _) = world(Pose::new(5.0, 5.0, 0.0));
        let start = Time::from_seconds(1e9);
        assert_eq!(world.advance(start), start);
        assert_eq!(world.advance(start + Duration::millis(19)), start + Duration::millis(10));
        let late = start + Duration::millis(5010);
        assert_eq!(world.advance(late), late);
        assert_eq!((world.simulator.time(), world.slipped), (Time(1_010_000_000), Duration::secs(4)));
        assert_eq!(world.advance(late + Duration::millis(10)), late + Duration::millis(10));
    }
}
