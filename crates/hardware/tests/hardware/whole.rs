//! Whole robots in simulated time.

use std::sync::{Arc, Mutex};

use hardware::simulated::{self, Robot as Body};
use hardware::{Berth, Cause, Gate, Latch, Robot};
use runtime::{
    Agent, Envelope, Fault, Input, Options, Output, Plan, Registry, Report, Simulation, Step, registry,
};
use sim::{Model, WorldPlan};
use types::messages::{Bumper, Echoes, Gyro, Image, Transforms, Twist, WheelTicks};
use types::{Duration, Pose, Priority, Time};

type Diary = Arc<Mutex<Vec<(Time, i64)>>>;

/// Drives ahead for as long as it is told to, and writes down what it hears.
#[derive(Agent)]
struct Driver {
    /// Where to drive.
    #[port(priorities = "urgent, high, normal")]
    drive: Output<Twist>,
    /// What touches.
    bumper: Input<Bumper>,
    until: Time,
    speed: f64,
    again_from: Time,
    priority: Priority,
    diary: Diary,
}

impl Agent for Driver {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        while let Some(bumper) = self.bumper.take() {
            if bumper.pressed() {
                self.diary.lock().unwrap().push((bumper.header().stamp, i64::from(bumper.sectors)));
            }
        }
        if step.now < self.until || step.now >= self.again_from {
            let envelope = Envelope { priority: self.priority, ..Envelope::default() };
            self.drive.send_as(envelope, Twist::new(self.speed, 0.0));
        }
        Ok(())
    }
}

/// Counts what the sensors say.
#[derive(Agent)]
struct Ears {
    /// Sonars.
    sonar: Input<Echoes>,
    /// Pictures.
    image: Input<Image>,
    /// Wheels.
    ticks: Input<WheelTicks>,
    /// Turn rate.
    gyro: Input<Gyro>,
    /// Mounts.
    transforms: Input<Transforms>,
    counts: Arc<Mutex<[u32; 5]>>,
}

impl Agent for Ears {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        let mut counts = self.counts.lock().unwrap();
        while let Some(sonar) = self.sonar.take() {
            assert_eq!(sonar.echoes.len(), 12);
            counts[0] += 1;
        }
        while let Some(image) = self.image.take() {
            assert_eq!(image.row().len(), 320 * 240 * 3);
            counts[1] += 1;
        }
        counts[2] += std::iter::from_fn(|| self.ticks.take().map(|_| ())).count() as u32;
        counts[3] += std::iter::from_fn(|| self.gyro.take().map(|_| ())).count() as u32;
        while let Some(transforms) = self.transforms.take() {
            // Twelve sonars and the camera.
            assert_eq!(transforms.row().len(), 13);
            counts[4] += 1;
        }
        Ok(())
    }
}

/// Robots with the usual body in a hall ten metres wide and deep, its corner at the origin.
fn hall(names: &[(&str, Pose)]) -> (Vec<simulated::Simulated>, simulated::Truth) {
    let bodies: Vec<Body> = names
        .iter()
        .map(|(name, start)| Body { name: (*name).to_owned(), model: Model::h1(), start: *start, goal: None })
        .collect();
    simulated::raise(&WorldPlan::hall(10.0, 10.0), 7, &bodies).unwrap()
}

fn middle() -> Pose {
    Pose::new(5.0, 5.0, 0.0)
}

struct Drive {
    name: &'static str,
    until: f64,
    again_from: f64,
    speed: f64,
    priority: Priority,
}

const DRIVE: Drive =
    Drive { name: "driver", until: 1e9, again_from: 1e9, speed: 0.4, priority: Priority::Normal };

fn with_drivers(
    plan: &mut Plan,
    registry: &mut Registry,
    drives: &[Drive],
    robot: &hardware::robot::RobotPorts,
) -> Vec<Diary> {
    drives
        .iter()
        .map(|drive| {
            let diary = Diary::default();
            let ports = plan.add::<Driver>(drive.name, Default::default());
            plan.agent_mut(drive.name).unwrap().kind = drive.name.to_owned();
            plan.every(drive.name, Duration::millis(50));
            plan.wire(&ports.drive, &robot.drive);
            plan.wire(&robot.bumper, &ports.bumper);
            let (until, again_from) = (Time::from_seconds(drive.until), Time::from_seconds(drive.again_from));
            let (speed, priority, own) = (drive.speed, drive.priority, diary.clone());
            let make = move |()| {
                let mut driver = <Driver as runtime::Declare>::build(runtime::NoParams);
                (driver.until, driver.again_from, driver.speed) = (until, again_from, speed);
                (driver.priority, driver.diary) = (priority, own.clone());
                driver
            };
            registry.extend([
                runtime::AgentType::made_by(move |_: runtime::NoParams| make(())).named(drive.name)
            ]);
            diary
        })
        .collect()
}

fn with_robot(
    plan: &mut Plan,
    registry: &mut Registry,
    name: &'static str,
    gate: Gate,
) -> hardware::robot::RobotPorts {
    let ports = plan.add::<Robot>(name, Default::default());
    plan.agent_mut(name).unwrap().kind = name.to_owned();
    plan.every(name, hardware::robot::CYCLE);
    plan.on(name, "drive");
    registry.extend([Berth::with(gate).agent_type(name)]);
    ports
}

fn run(plan: &Plan, registry: &Registry, seconds: i64) -> Report {
    let options = Options { limit: Some(Duration::secs(seconds)), ..Options::default() };
    let report = Simulation::new(plan, registry, options).unwrap().run().unwrap();
    assert!(report.incidents.is_empty(), "{:?}", report.incidents);
    report
}

#[test]
fn a_silent_controller_stops_the_robot_after_the_age_limit() {
    let (mut bodies, truth) = hall(&[("h1", middle())]);
    let gate = Gate::new(bodies.remove(0), Latch::private());
    let counts = gate.counts();
    let (mut plan, mut registry) = (Plan::new("silent"), registry![Robot]);
    let robot = with_robot(&mut plan, &mut registry, "h1", gate);
    with_drivers(&mut plan, &mut registry, &[Drive { until: 2.0, ..DRIVE }], &robot);
    run(&plan, &registry, 5);
    let h1 = truth.robot("h1").unwrap();
    // 0.4 m/s from the first command at 0 to 0.3 s after the last at 1.95 s; start and stop lag alike.
    assert!((h1.truth.distance - 0.4 * 2.25).abs() < 0.02, "{}", h1.truth.distance);
    assert!(h1.truth.linear.abs() < 1e-3 && h1.truth.collisions == 0);
    assert_eq!(counts.stale.get(), 1);
    assert_eq!(truth.time(), Time::from_seconds(5.0));
}

#[test]
fn a_bump_latches_and_the_robot_stands_though_the_controller_pushes_on() {
    let (mut bodies, truth) = hall(&[("h1", middle())]);
    let latch = Latch::private();
    let gate = Gate::new(bodies.remove(0), latch.clone());
    let counts = gate.counts();
    let (mut plan, mut registry) = (Plan::new("bump"), registry![Robot]);
    let robot = with_robot(&mut plan, &mut registry, "h1", gate);
    let diary = with_drivers(&mut plan, &mut registry, &[DRIVE], &robot).remove(0);
    run(&plan, &registry, 20);
    let h1 = truth.robot("h1").unwrap();
    assert_eq!(h1.truth.collisions, 1);
    assert!(h1.touching && latch.state().has(Cause::Bumper));
    assert_eq!((counts.bumps.get(), counts.latch_sets.get()), (1, 1));
    assert!(counts.latched.get() > 50, "commands against the latch are counted");
    let (told, sectors) = diary.lock().unwrap()[0];
    assert_eq!(sectors, 1, "straight ahead");
    // The half of a ten-metre hall less half of the robot, at 0.4 m/s; the set time is that of the cycle.
    assert!((latch.set_at().seconds() - told.seconds()).abs() < 0.011, "{:?} {told:?}", latch.set_at());
}

#[test]
fn a_person_stands_above_the_robot_and_leaves_it_to_itself_afterwards() {
    let (mut bodies, truth) = hall(&[("h1", middle())]);
    let gate = Gate::new(bodies.remove(0), Latch::private());
    let counts = gate.counts();
    let (mut plan, mut registry) = (Plan::new("person"), registry![Robot]);
    let robot = with_robot(&mut plan, &mut registry, "h1", gate);
    let person = Drive { name: "person", until: 4.0, speed: 0.0, priority: Priority::High, ..DRIVE };
    with_drivers(&mut plan, &mut registry, &[DRIVE, person], &robot);
    run(&plan, &registry, 6);
    // The person's last command is of 3.95 s and holds for 0.3 s; the lag of the wheels costs 0.1 s.
    let driven = truth.robot("h1").unwrap().truth.distance;
    assert!((driven - 0.4 * (6.0 - 4.25 - 0.1)).abs() < 0.03, "{driven}");
    assert!(counts.overruled.get() > 70);
}

#[test]
fn sensors_come_at_their_rates_and_only_to_those_who_listen() {
    let (mut bodies, _) = hall(&[("h1", middle())]);
    let gate = Gate::new(bodies.remove(0), Latch::private());
    let (mut plan, mut registry) = (Plan::new("ears"), registry![Robot]);
    let robot = with_robot(&mut plan, &mut registry, "h1", gate);
    let ears = plan.add::<Ears>("ears", Default::default());
    plan.every("ears", Duration::millis(10));
    plan.wire(&robot.sonar, &ears.sonar);
    plan.wire(&robot.image, &ears.image);
    plan.wire(&robot.ticks, &ears.ticks);
    plan.wire(&robot.gyro, &ears.gyro);
    plan.wire(&robot.transforms, &ears.transforms);
    let counts: Arc<Mutex<[u32; 5]>> = Arc::default();
    let own = counts.clone();
    registry.extend([runtime::AgentType::made_by(move |_| {
        let mut ears = <Ears as runtime::Declare>::build(runtime::NoParams);
        ears.counts = own.clone();
        ears
    })]);
    let report = run(&plan, &registry, 10);
    let heard = *counts.lock().unwrap();
    // From 0 to 10 s, both ends in it; the last release may come after the listener's last step.
    for (heard, rate) in heard.into_iter().zip([4, 15, 50, 100, 1]) {
        assert!((10 * rate..=10 * rate + 1).contains(&heard), "{heard} of {rate} a second");
    }
    assert!(report.time >= Duration::secs(10));
}

#[test]
fn two_robots_share_a_world_and_see_the_same_time() {
    let m = middle();
    let starts = [("h1", m), ("h2", Pose::new(m.x, m.y + 2.0, std::f64::consts::PI))];
    let (bodies, truth) = hall(&starts);
    let (mut plan, mut registry) = (Plan::new("two"), registry![Robot]);
    let mut ports = Vec::new();
    for (body, name) in bodies.into_iter().zip(["h1", "h2"]) {
        ports.push(with_robot(&mut plan, &mut registry, name, Gate::new(body, Latch::private())));
    }
    with_drivers(&mut plan, &mut registry, &[Drive { name: "one", ..DRIVE }], &ports[0]);
    with_drivers(&mut plan, &mut registry, &[Drive { name: "two", speed: 0.2, ..DRIVE }], &ports[1]);
    run(&plan, &registry, 5);
    assert_eq!(truth.time(), Time::from_seconds(5.0));
    let way = |name: &str| truth.robot(name).unwrap().truth.distance;
    assert!(
        (way("h1") - 0.4 * 4.9).abs() < 0.02 && (way("h2") - 0.2 * 4.9).abs() < 0.02,
        "{} {}",
        way("h1"),
        way("h2")
    );
    let snapshot = truth.snapshot();
    assert_eq!(snapshot.robots[1].name, "h2");
    assert!(snapshot.robots[1].pose.x < m.x && snapshot.robots[0].pose.x > m.x);
}

/// The only request that these tests make.
fn panics(_: &[String]) -> Result<runtime::Request, runtime::Refusal> {
    Ok(runtime::Request::Fault { target: "h1".into(), fault: runtime::FaultKind::Panic })
}

#[test]
fn the_gate_outlives_the_death_of_its_agent() {
    let (mut bodies, truth) = hall(&[("h1", middle())]);
    let gate = Gate::new(bodies.remove(0), Latch::private());
    let counts = gate.counts();
    let (mut plan, mut registry) = (Plan::new("death"), registry![Robot]);
    let robot = with_robot(&mut plan, &mut registry, "h1", gate);
    with_drivers(&mut plan, &mut registry, &[DRIVE], &robot);
    plan.requests.push(runtime::TimedRequest {
        at: Duration::secs(2),
        words: Vec::new(),
        place: Default::default(),
    });
    let options = Options { limit: Some(Duration::secs(6)), parse: panics, ..Options::default() };
    let report = Simulation::new(&plan, &registry, options).unwrap().run().unwrap();
    assert!(!report.incidents.is_empty());
    // A tenth of a second later the next agent drives on: the wheels' own watchdog of 0.5 s bridged the gap.
    let driven = truth.robot("h1").unwrap().truth.distance;
    assert!((driven - 0.4 * 5.9).abs() < 0.06, "{driven}");
    assert!((640..=730).contains(&counts.cycles.get()), "{}", counts.cycles.get());
}

#[test]
fn the_same_seed_gives_the_same_drive_whether_or_not_somebody_listens() {
    let drive = |listens: bool| {
        let (mut bodies, truth) = hall(&[("h1", Pose::new(5.0, 5.0, 0.7))]);
        let (mut plan, mut registry) = (Plan::new("same"), registry![Robot, Ears]);
        let robot = with_robot(&mut plan, &mut registry, "h1", Gate::new(bodies.remove(0), Latch::private()));
        with_drivers(&mut plan, &mut registry, &[DRIVE], &robot);
        if listens {
            let ears = plan.add::<Ears>("ears", Default::default());
            plan.every("ears", Duration::millis(10));
            plan.wire(&robot.image, &ears.image);
            plan.wire(&robot.sonar, &ears.sonar);
        }
        run(&plan, &registry, 8);
        truth.robot("h1").unwrap().truth
    };
    assert_eq!(drive(false), drive(true));
}
