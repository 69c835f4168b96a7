//! The laws of the reactive layer in a system: who goes around things, stops before them, and believes where it is by landmarks takes no
//! memory in real time, from the first step on.

use std::sync::{Arc, Mutex};

use agents::avoid::AvoidParams;
use agents::{Avoid, Coordinator, DriveBase, EmergencyStopAction, Navigator};
use navigation::floor::{Disc, Distances, FloorPlan, PlanField};
use navigation::localisation::landmarks::association::Landmark;
use navigation::localisation::landmarks::sighting::seen_from;
use navigation::localisation::landmarks::{Filter, LandmarkLocalizer, Parameters};
use runtime::{
    Agent, AgentType, Declare, Fault, Input, NoParams, Output, Plan, Report, Simulation, Step, registry,
};
use types::geometry::PI;
use types::messages::{
    Avoidance, Doing, EmergencyStop, LaserScan, Navigation, Odometry, Path, Situation, StopKind, Twist,
};
use types::{Duration, Point, Pose};

const BEAMS: usize = 181;
const STEP: Duration = Duration::millis(20);
/// It goes from one of these to the other and back.
const PLACES: [Point; 2] = [Point::new(1.0, 2.5), Point::new(7.0, 2.5)];
/// Its laser is silent for a second at this time, on the way.
const SILENT: f64 = 5.0;

/// A room with pillars between the two places, and a thin wall across.
fn floor() -> FloorPlan {
    let mut plan = FloorPlan::room(8.0, 5.0);
    let pillars = [(2.5, 2.4), (3.8, 1.4), (3.9, 3.6), (6.0, 2.2), (6.1, 3.4)];
    plan.discs.extend(pillars.map(|(x, y)| Disc { centre: Point::new(x, y), radius: 0.15 }));
    plan.line(&[Point::new(4.8, 1.8), Point::new(4.8, 3.2)]);
    plan
}

/// A robot that does as it is told, and says what it sees and where it is.
#[derive(Agent)]
struct Body {
    /// How it is to move.
    wish: Input<Twist>,
    /// What its laser sees.
    #[port(rows = 512)]
    scan: Output<LaserScan>,
    /// Where it is.
    #[port(history = 64)]
    odometry: Output<Odometry>,
    /// Where it is to go.
    goal: Output<Path>,
    twist: Twist,
    pose: Pose,
    n: u64,
    field: Option<PlanField>,
}

impl Agent for Body {
    fn start(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.field = Some(PlanField::new(&floor()).map_err(Fault::of)?);
        self.pose = Pose::new(PLACES[0].x, PLACES[0].y, 0.0);
        Ok(())
    }

    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        let Some(field) = &self.field else { return Ok(()) };
        self.twist = self.wish.latest().unwrap_or(self.twist);
        let twist = self.twist;
        self.pose = self.pose.advanced(twist.linear, twist.angular, STEP.seconds());
        self.odometry.send(Odometry { pose: self.pose, twist, ..Odometry::default() });
        if self.n.is_multiple_of(1000) {
            let end = PLACES[1 - (self.n / 1000 % 2) as usize];
            let points = [end.into()].into_iter().collect();
            self.goal.send(Path { found: true, points, ..Path::default() });
        }
        self.n += 1;
        let is_silent = (SILENT..SILENT + 1.0).contains(&step.now.seconds());
        if self.n % 5 != 1 || is_silent {
            return Ok(());
        }
        let pose = self.pose;
        self.scan.send_with(|scan, row| {
            scan.angle_min = (-PI / 2.0) as f32;
            scan.angle_step = (PI / (BEAMS - 1) as f64) as f32;
            scan.range_max = 8.0;
            for (i, range) in row.iter_mut().enumerate().take(BEAMS) {
                let bearing =
                    pose.heading + f64::from(scan.angle_min) + i as f64 * f64::from(scan.angle_step);
                let met = field.cast(pose.position(), Point::polar(1.0, bearing), 8.0);
                *range = met.unwrap_or(8.0) as f32;
            }
            BEAMS
        });
        Ok(())
    }
}

/// Corners of the room, which it sees in turns.
const CORNERS: [Point; 4] =
    [Point::new(0.0, 0.0), Point::new(8.0, 0.0), Point::new(8.0, 5.0), Point::new(0.0, 5.0)];

/// A camera takes so long to find them in its picture.
const LATE: Duration = Duration::millis(60);

/// Believes where it is, by the speed and landmarks that it sees with a delay.
#[derive(Agent)]
struct Believer {
    /// How it moves, and where it truly is.
    odometry: Input<Odometry>,
    /// Where it believes to be.
    pose: Output<Odometry>,
    localizer: Option<LandmarkLocalizer>,
    n: usize,
}

impl Agent for Believer {
    fn start(&mut self, step: &mut Step) -> Result<(), Fault> {
        let parameters = Parameters::default();
        let pose = Pose::new(PLACES[0].x + 0.05, PLACES[0].y, 0.02);
        let filter = Filter::new(&parameters, pose, [[0.01, 0.0, 0.0], [0.0, 0.01, 0.0], [0.0, 0.0, 0.01]]);
        self.localizer = Some(LandmarkLocalizer::new(parameters, filter, step.now, 128));
        Ok(())
    }

    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        let (Some(localizer), Some(odometry)) = (&mut self.localizer, self.odometry.latest()) else {
            return Ok(());
        };
        let Twist { linear, angular } = odometry.twist;
        localizer.drives(step.now, linear, angular).map_err(Fault::of)?;
        self.n += 1;
        if self.n < 10 {
            return Ok(());
        }
        let then = step.now - LATE;
        let Some(truth) = self.odometry.at(then).map(|found| found.value().pose) else { return Ok(()) };
        let corner = CORNERS[self.n % 4];
        let seen = seen_from(truth, corner);
        // Every other one says which it is.
        let landmarks = CORNERS.map(Landmark::exact);
        if self.n.is_multiple_of(2) {
            localizer.sees(then, landmarks[self.n % 4].seen(seen)).map_err(Fault::of)?;
        } else {
            localizer.sees_one_of(then, seen, &landmarks).map_err(Fault::of)?;
        }
        if let Some(pose) = localizer.pose_at(step.now) {
            self.pose.send(Odometry { pose, ..Odometry::default() });
        }
        Ok(())
    }
}

/// What was told.
#[derive(Default)]
struct Told {
    nearness: Vec<Situation>,
    smooth: Vec<Situation>,
    doing: Vec<Doing>,
    stops: Vec<StopKind>,
    places: Vec<Point>,
    believed: Vec<f64>,
    commands: usize,
}

type Heard = Arc<Mutex<Told>>;

/// Writes down what is told.
#[derive(Agent)]
struct Witness {
    /// Of one law.
    nearness: Input<Avoidance>,
    /// Of the other.
    smooth: Input<Avoidance>,
    /// Of the navigator.
    navigation: Input<Navigation>,
    /// Of the emergency stop.
    stop: Input<EmergencyStop>,
    /// Where it is.
    odometry: Input<Odometry>,
    /// Where it believes to be.
    believed: Input<Odometry>,
    /// What a drive makes of the wishes of an avoidance.
    command: Input<Twist>,
    heard: Heard,
}

impl Agent for Witness {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        let mut heard = self.heard.lock().unwrap();
        while let Some(told) = self.nearness.take() {
            heard.nearness.push(told.situation);
        }
        while let Some(told) = self.smooth.take() {
            heard.smooth.push(told.situation);
        }
        while let Some(told) = self.navigation.take() {
            heard.doing.push(told.doing);
        }
        while let Some(told) = self.stop.take() {
            heard.stops.push(told.kind);
        }
        if let Some(truth) = self.odometry.latest() {
            heard.places.push(truth.pose.position());
            if let Some(believed) = self.believed.latest() {
                heard.believed.push(believed.pose.position().distance(truth.pose.position()));
            }
        }
        while self.command.take().is_some_and(|command| command.linear > 0.0) {
            heard.commands += 1;
        }
        Ok(())
    }
}

/// All of them around one body, which the navigator drives.
fn run(seconds: f64) -> (Report, Heard) {
    let mut plan = Plan::new("reacting");
    let body = plan.add::<Body>("body", Default::default());
    let avoid = |law: &str| AvoidParams { law: law.into(), cone: 0.0, ..AvoidParams::default() };
    let nearness = plan.add::<Avoid>("nearness", avoid("nearness"));
    let smooth = plan.add::<Avoid>("smooth", avoid("smooth"));
    let navigator = plan.add::<Navigator>("navigator", Default::default());
    let stop = plan.add::<EmergencyStopAction>("stop", Default::default());
    let coordinator = plan.add::<Coordinator>("coordinator", Default::default());
    let drive = plan.add::<DriveBase>("drive", Default::default());
    let believer = plan.add::<Believer>("believer", Default::default());
    let witness = plan.add::<Witness>("witness", Default::default());
    for avoid in [&nearness, &smooth] {
        plan.wire(&body.scan, &avoid.scan);
        plan.wire(&body.odometry, &avoid.odometry);
        plan.wire(&body.goal, &avoid.goal);
        plan.wire(&avoid.drive, &coordinator.offers);
    }
    plan.wire(&body.scan, &navigator.scan);
    plan.wire(&body.odometry, &navigator.odometry);
    plan.wire(&body.goal, &navigator.goal);
    plan.wire(&navigator.wish, &body.wish);
    plan.wire(&body.scan, &stop.scan);
    plan.wire(&body.odometry, &stop.odometry);
    plan.wire(&navigator.wish, &stop.wish);
    plan.wire(&stop.bound, &drive.reflex);
    plan.wire(&coordinator.command, &drive.wish);
    plan.wire(&body.odometry, &believer.odometry);
    plan.wire(&nearness.situation, &witness.nearness);
    plan.wire(&smooth.situation, &witness.smooth);
    plan.wire(&navigator.state, &witness.navigation);
    plan.wire(&stop.stop, &witness.stop);
    plan.wire(&body.odometry, &witness.odometry);
    plan.wire(&believer.pose, &witness.believed);
    plan.wire(&drive.command, &witness.command);
    for name in ["body", "stop", "coordinator", "drive", "believer", "witness"] {
        plan.every(name, STEP);
    }
    for name in ["nearness", "smooth", "navigator"] {
        plan.every(name, Duration::millis(100));
    }
    for name in REAL_TIME {
        plan.agent_mut(name).unwrap().executor = Some("control".into());
    }
    plan.agent_mut("witness").unwrap().executor = Some("ordinary".into());
    let heard = Heard::default();
    let own = heard.clone();
    let mut registry =
        registry![Body, Avoid, Navigator, EmergencyStopAction, Coordinator, DriveBase, Believer];
    registry.extend([AgentType::made_by(move |_: NoParams| {
        let mut witness = <Witness as Declare>::build(NoParams);
        witness.heard = own.clone();
        witness
    })]);
    let options = runtime::Options { limit: Some(Duration::from_seconds(seconds)), ..Default::default() };
    let report = Simulation::new(&plan, &registry, options).unwrap().run().unwrap();
    assert!(report.incidents.is_empty(), "{:?}", report.incidents);
    (report, heard)
}

/// Those that are looked at.
const REAL_TIME: [&str; 7] = ["nearness", "smooth", "navigator", "stop", "coordinator", "drive", "believer"];

#[test]
fn avoidance_rollouts_soft_stop_and_filter_take_no_memory() {
    let (report, heard) = run(38.0);
    assert!(report.view.allocations_watched, "by the allocator of this program");
    let agents = report.view.agents.iter().filter(|agent| REAL_TIME.contains(&agent.name.as_str()));
    let steps: Vec<_> =
        agents.map(|agent| (agent.name.as_str(), agent.counts.releases, agent.counts.allocations)).collect();
    assert_eq!(steps.len(), REAL_TIME.len());
    assert!(steps.iter().all(|(_, releases, took)| *releases > 300 && *took == 0), "{steps:?}");

    // And they had something to do: it went there and back past what is in the way, was blind for a while, and had to be stopped.
    let heard = heard.lock().unwrap();
    for place in PLACES {
        let from_start = heard.places.iter().skip(500);
        let nearest = from_start.map(|at| at.distance(place)).fold(f64::INFINITY, f64::min);
        assert!(nearest < 0.25, "{nearest} m from {place:?}");
    }
    for situations in [&heard.nearness, &heard.smooth] {
        assert!(situations.contains(&Situation::Blind));
    }
    let kinds = |of: &[Situation]| {
        let mut kinds: Vec<String> = of.iter().map(|one| format!("{one:?}")).collect();
        kinds.sort();
        kinds.dedup();
        kinds.len()
    };
    assert!(kinds(&heard.nearness) > 4, "{:?}", heard.nearness);
    for doing in [Doing::Blind, Doing::Pursuing, Doing::Arrived] {
        assert!(heard.doing.contains(&doing), "{doing:?}");
    }
    assert!(heard.stops.contains(&StopKind::Soft) && heard.stops.contains(&StopKind::None));
    assert!(heard.commands > 100);
    let lately = &heard.believed[100..];
    let worst = lately.iter().fold(0.0, |worst: f64, off| worst.max(*off));
    assert!(lately.len() > 1000 && worst < 0.05, "{worst} m, {}", lately.len());
}
