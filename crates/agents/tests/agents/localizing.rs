//! The localizer in a system: it finds the robot, keeps it, is told, tells, and takes no memory in real time.

use std::sync::{Arc, Mutex};

use agents::Localizer;
use agents::localizer::{FloorPlan, LocalizerParams};
use navigation::floor::{Block, Distances, PlanField};
use runtime::{
    Agent, Client, Declare, Envelope, Fault, Input, NoParams, Output, Plan, Reply, Report, Simulation, Step,
    registry,
};
use types::chance::Stream;
use types::geometry::{PI, wrap};
use types::messages::{
    LandmarkSighting, Landmarks, LaserScan, Localisation, Odometry, Placed, Placement, Whereabouts,
};
use types::params::Params as _;
use types::{Duration, Point, Pose, Time};

const BEAMS: usize = 181;

/// A room that looks the same from no two places.
fn floor() -> FloorPlan {
    let mut plan = FloorPlan::room(6.0, 4.0);
    plan.boxes.push(Block { at: Pose::new(4.5, 3.0, 0.3), length: 1.0, depth: 0.5 });
    plan.line(&[Point::new(2.0, 0.0), Point::new(2.0, 1.0)]);
    plan
}

/// Where the body is at a time: on a circle, once in a minute.
fn truth(time: Time) -> Pose {
    let angle = 0.1 * time.seconds();
    Pose::new(3.2 + 0.7 * angle.cos(), 2.0 + 0.7 * angle.sin(), angle + PI / 2.0)
}

/// What its camera can see: number and place.
const MARKS: [(u32, f64, f64); 4] = [(3, 0.3, 0.2), (5, 5.8, 0.3), (7, 5.7, 3.8), (9, 0.2, 3.7)];

/// A robot with a laser and a camera on a circle. Its odometry began elsewhere.
#[derive(Agent)]
struct Body {
    /// What its laser sees.
    #[port(rows = 512)]
    scan: Output<LaserScan>,
    /// Where its wheels say that it is.
    #[port(history = 64)]
    odometry: Output<Odometry>,
    /// What its camera sees of landmarks.
    landmarks: Output<Landmarks>,
    n: u64,
    field: Option<PlanField>,
}

impl Agent for Body {
    fn start(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.field = Some(PlanField::new(&floor()).map_err(Fault::of)?);
        Ok(())
    }

    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        let Some(field) = &self.field else { return Ok(()) };
        let envelope = Envelope { stamp: Some(step.now), ..Envelope::default() };
        let pose = truth(step.now);
        let odom_from_map = Pose::new(1.0, 7.0, 0.4);
        self.odometry.send_as(envelope, Odometry { pose: odom_from_map.then(pose), ..Odometry::default() });
        self.n += 1;
        if self.n % 5 != 1 {
            return Ok(());
        }
        let draw = Stream::new(4, "laser").sample(self.n);
        let seen = MARKS.map(|(id, x, y)| {
            let way = Point::new(x, y) - pose.position();
            let bearing = wrap(way.bearing() - pose.heading) + 0.01 * draw.normal(1000 + u64::from(id));
            let range = way.norm() + 0.02 * draw.normal(2000 + u64::from(id));
            LandmarkSighting { id, range: range as f32, bearing: bearing as f32, side: 0 }
        });
        let in_view = |seen: &LandmarkSighting| seen.bearing.abs() < 0.6;
        let seen = seen.into_iter().filter(in_view).collect();
        self.landmarks.send_as(envelope, Landmarks { frame: "base_link".into(), seen });
        self.scan.send_with(|scan, row| {
            scan.angle_min = (-PI / 2.0) as f32;
            scan.angle_step = (PI / (BEAMS - 1) as f64) as f32;
            scan.range_max = 8.0;
            for (i, range) in row.iter_mut().enumerate().take(BEAMS) {
                let bearing =
                    pose.heading + f64::from(scan.angle_min) + i as f64 * f64::from(scan.angle_step);
                let met = field.cast(pose.position(), Point::polar(1.0, bearing), 8.0).unwrap_or(8.0);
                *range = (met + 0.01 * draw.normal(i as u64)) as f32;
            }
            BEAMS
        });
        Ok(())
    }
}

/// What was told: poses, how sure they are, and whether the word was taken.
#[derive(Default)]
struct Told {
    poses: Vec<(Time, Pose)>,
    states: Vec<(Time, Localisation)>,
    answers: Vec<bool>,
}

type Heard = Arc<Mutex<Told>>;

/// Writes down what is told, and at ten seconds says that the robot is elsewhere.
#[derive(Agent)]
struct Witness {
    /// Where the robot is.
    pose: Input<Odometry>,
    /// How sure that is.
    state: Input<Localisation>,
    /// Says where it is.
    place: Client<Placement, Placed>,
    heard: Heard,
    said: bool,
}

impl Agent for Witness {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        let mut heard = self.heard.lock().unwrap();
        while let Some(pose) = self.pose.take() {
            assert_eq!((pose.frame.as_str(), pose.body.as_str()), ("map", "base_link"));
            heard.poses.push((pose.header().stamp, pose.pose));
        }
        while let Some(state) = self.state.take() {
            heard.states.push((state.header().stamp, *state));
        }
        while let Some((_, reply)) = self.place.reply() {
            heard.answers.push(reply == Reply::Answer(Placed { taken: true }));
        }
        if step.now >= Time::from_seconds(10.0) && !self.said {
            self.said = true;
            let wrong = Placement { x: 1.0, y: 3.0, heading: 0.3, ..Placement::default() };
            self.place.call(wrong, Duration::secs(1)).map_err(|_| Fault::new("nobody answers"))?;
        }
        Ok(())
    }
}

fn run(params: LocalizerParams, seconds: f64) -> (Report, Heard) {
    let mut plan = Plan::new("localizing");
    let body = plan.add::<Body>("body", Default::default());
    let localizer = plan.add::<Localizer>("localizer", params);
    let witness = plan.add::<Witness>("witness", Default::default());
    plan.wire(&body.scan, &localizer.scan);
    plan.wire(&body.odometry, &localizer.odometry);
    plan.wire(&body.landmarks, &localizer.landmarks);
    plan.wire(&localizer.pose, &witness.pose);
    plan.wire(&localizer.state, &witness.state);
    plan.wire(&witness.place, &localizer.place);
    plan.every("body", Duration::millis(20));
    plan.every("localizer", Duration::millis(100));
    plan.every("witness", Duration::millis(100));
    plan.agent_mut("localizer").unwrap().executor = Some("control".into());
    let heard = Heard::default();
    let own = heard.clone();
    let mut registry = registry![Body, Localizer];
    registry.extend([runtime::AgentType::made_by(move |_: NoParams| {
        let mut witness = <Witness as Declare>::build(NoParams);
        witness.heard = own.clone();
        witness
    })]);
    let options = runtime::Options { limit: Some(Duration::from_seconds(seconds)), ..Default::default() };
    let report = Simulation::new(&plan, &registry, options).unwrap().run().unwrap();
    assert!(report.incidents.is_empty(), "{:?}", report.incidents);
    (report, heard)
}

#[test]
fn it_finds_the_robot_and_after_a_wrong_word_again_without_memory() {
    let (report, heard) = run(LocalizerParams { floor: floor(), ..LocalizerParams::default() }, 20.0);
    let heard = heard.lock().unwrap();
    let Told { poses, states, answers } = &*heard;
    let mut worst = 0.0f64;
    for (stamp, pose) in poses {
        worst = worst.max(pose.position().distance(truth(*stamp).position()));
    }
    assert!(worst < 0.01, "{worst}");
    let first = poses[0].0.seconds();
    assert!((1.0..3.0).contains(&first), "found at {first} s");
    assert_eq!(answers, &[true]);
    let known = |from: f64, to: f64| {
        let within = states.iter().filter(|(stamp, _)| (from..to).contains(&stamp.seconds()));
        within.map(|(_, told)| told.state == Whereabouts::Tracking).collect::<Vec<_>>()
    };
    assert!(known(4.0, 10.0).into_iter().all(|known| known));
    let states_of = |state| states.iter().filter(|(_, told)| told.state == state).count();
    assert!(
        states_of(Whereabouts::Searching) > 12 && known(10.5, 11.0).contains(&false),
        "the wrong word was seen through"
    );
    assert!(known(14.0, 20.0).into_iter().all(|known| known), "and the robot was found again");
    let last = states.last().unwrap().1;
    assert!(last.inliers > 0.95 && last.deviation < 0.005 && last.heading_deviation < 0.005, "{last:?}");
    // Every scan that is told of is one that was measured: at 100 ms each.
    assert!(poses.iter().all(|(stamp, _)| stamp.0 % 100_000_000 == 0));
    assert!(report.view.allocations_watched, "by the allocator of this program");
    for agent in &report.view.agents {
        if agent.name == "localizer" {
            assert_eq!(agent.counts.allocations, 0);
        }
    }
}

#[test]
fn a_start_that_is_known_is_begun_from() {
    let begin = truth(Time::ZERO);
    let params = LocalizerParams {
        floor: floor(),
        known_start: true,
        x: begin.x + 0.05,
        y: begin.y,
        heading: begin.heading - 0.05,
        ..LocalizerParams::default()
    };
    let (_, heard) = run(params, 2.0);
    let heard = heard.lock().unwrap();
    assert!(heard.poses[0].0.seconds() < 0.15, "with the first scan: {:?}", heard.poses[0]);
    assert!(heard.states.iter().all(|(_, told)| told.is_known()));
}

fn rows() -> Vec<Vec<f64>> {
    MARKS.iter().map(|(id, x, y)| vec![f64::from(*id), *x, *y]).collect()
}

#[test]
fn by_landmarks_alone_it_finds_the_robot_keeps_it_and_sees_through_a_wrong_word_without_memory() {
    let params = LocalizerParams { landmarks: rows(), ..LocalizerParams::default() };
    let (report, heard) = run(params, 80.0);
    let heard = heard.lock().unwrap();
    let Told { poses, states, .. } = &*heard;
    let off = |from: f64, to: f64| {
        let within = poses.iter().filter(|(stamp, _)| (from..to).contains(&stamp.seconds()));
        within.map(|(stamp, pose)| pose.position().distance(truth(*stamp).position())).fold(0.0, f64::max)
    };
    // It sees one landmark at a time: once around it has seen them all, and at 10 s it was told a wrong place.
    assert!(states[0].1.state == Whereabouts::Searching && poses.len() > 400, "{}", poses.len());
    // A sighting at 3 m is off by 2 cm and 3 cm; it is told to the agent to be off by as much again.
    let (last, lost) = (off(65.0, 80.0), off(10.2, 11.0));
    assert!(last < 0.12, "{last}");
    assert!(lost > 0.5 || poses.iter().all(|(stamp, _)| !(10.2..11.0).contains(&stamp.seconds())), "{lost}");
    assert!(states.iter().rev().take(100).all(|(_, told)| told.is_known() && told.inliers > 0.9));
    assert!(report.view.allocations_watched, "by the allocator of this program");
    let agent = report.view.agents.iter().find(|agent| agent.name == "localizer").unwrap();
    assert_eq!(agent.counts.allocations, 0);
}

#[test]
fn landmarks_that_cannot_be_are_told() {
    let said = |landmarks: Vec<Vec<f64>>| {
        let mut table = types::value::Table::new();
        table.set("landmarks", types::params::ParamValue::to_value(&landmarks));
        LocalizerParams::read(&table, "a localizer").err().map_or(0, |mistakes| mistakes.len())
    };
    assert_eq!(said(rows()), 0);
    assert_eq!(said(vec![vec![1.0, 2.0]]), 1);
    assert_eq!(said(vec![vec![0.0, 2.0, 3.0]]), 1);
    assert_eq!(said(vec![vec![1.0, 2.0, 3.0], vec![1.0, 4.0, 5.0]]), 1, "two with the same number");
    assert_eq!(said(vec![vec![1.0, f64::NAN, 3.0]]), 1);
}

#[test]
fn a_floor_is_needed_and_must_be_one() {
    let mut table = types::value::Table::new();
    let said = |table: &_| {
        LocalizerParams::read(table, "a localizer")
            .unwrap_err()
            .iter()
            .map(ToString::to_string)
            .collect::<Vec<_>>()
    };
    assert!(
        said(&table)[0].starts_with("a localizer needs a floor or landmarks; write floor = \"world\""),
        "{:?}",
        said(&table)
    );
    table.set("floor", types::value::Value::Table(types::value::Table::new()));
    assert!(said(&table)[0].starts_with("nothing stands on this floor"), "{:?}", said(&table));
    table.set("floor", types::value::Value::Int(3));
    assert_eq!(said(&table).len(), 1, "{:?}", said(&table));
}
