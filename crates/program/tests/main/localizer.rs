//! The localizer in a whole simulated system, against the truth: wheels that are wrong and slip, a laser with noise, furniture and people of
//! which the floor plan knows nothing.

use std::sync::{Arc, Mutex};

use hardware::simulated::{self, Truth};
use hardware::{Berth, Gate, Latch};
use program::file;
use runtime::{
    Agent, AgentType, Client, Declare, Fault, Input, NoParams, Options, Output, Simulation, Step, WirePlan,
};
use sim::{Model, WorldPlan};
use types::geometry::wrap;
use types::messages::{LaserScan, Localisation, Odometry, Twist, Whereabouts, WorldAnswer, WorldPlace};
use types::{Duration, Pose, Time};

use crate::registry;

/// The flat with what stands about in it; its plan shows neither the armchair nor the lamp, the pouf, the people or the things on tables.
const SYSTEM: &str = r#"
name = "localizing"
world = "home"

[robot.h1]
driver = "sim"
camera = false
sonar = false
bumper_latches = false
laser = { beams = 181, noise = 0.01 }
drive = { left_scale = 1.012, right_scale = 0.994, axle_scale = 1.015, slip = 0.004 }

[agent.odometry]
is = "odometry"
robot = "h1"
on = "ticks"

[agent.localizer]
is = "localizer"
robot = "h1"
period = "200ms"
floor = "world"
START

[agent.rover]
is = "rover"
robot = "h1"
period = "50ms"

[agent.witness]
is = "witness"
period = "10ms"

[wires]
"odometry.odometry" = ["localizer.odometry"]
"localizer.pose" = [{ to = "witness.pose", depth = 16 }]
"localizer.state" = [{ to = "witness.state", depth = 16 }]
"#;

/// Drives about: ahead where there is room, else it turns to where there is more.
#[derive(Agent)]
struct Rover {
    /// What is around.
    #[robot("scan")]
    scan: Input<LaserScan>,
    /// Where to drive.
    #[robot("drive")]
    drive: Output<Twist>,
    turning: f64,
}

impl Agent for Rover {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        if let Some(scan) = self.scan.newest() {
            let row = scan.row();
            let nearest = |part: &[f32]| part.iter().copied().fold(8.0f32, f32::min);
            let third = row.len() / 3;
            let ahead = nearest(&row[third..2 * third]);
            self.turning = match (ahead < 0.6, self.turning == 0.0) {
                (false, _) => 0.0,
                (true, false) => self.turning,
                (true, true) if nearest(&row[2 * third..]) > nearest(&row[..third]) => 0.8,
                (true, true) => -0.8,
            };
        }
        self.drive.send(if self.turning == 0.0 {
            Twist::new(0.4, 0.05)
        } else {
            Twist::new(0.0, self.turning)
        });
        Ok(())
    }
}

/// What was told, and what was true.
#[derive(Default)]
pub(crate) struct Diary {
    pub(crate) poses: Vec<(Time, Pose)>,
    /// What another localizer of the same robot told.
    pub(crate) others: Vec<(Time, Pose)>,
    /// Where its wheels alone said that it is, in the frame in which it began.
    pub(crate) reckoned: Vec<(Time, Pose)>,
    states: Vec<(Time, Localisation)>,
    pub(crate) truth: Vec<(Time, Pose)>,
}

/// Writes down what is told and what is true; at a time it puts the robot elsewhere.
#[derive(Agent)]
struct Witness {
    /// Where the robot is believed to be.
    pose: Input<Odometry>,
    /// Where another localizer believes it to be.
    other: Input<Odometry>,
    /// Where its wheels say that it is.
    reckoned: Input<Odometry>,
    /// How sure that is.
    state: Input<Localisation>,
    /// Puts the robot elsewhere.
    put: Client<WorldPlace, WorldAnswer>,
    judge: Option<Judge>,
}

#[derive(Clone)]
struct Judge {
    truth: Truth,
    carry: Option<(Time, Pose)>,
    diary: Arc<Mutex<Diary>>,
}

impl Agent for Witness {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        let Some(judge) = &mut self.judge else { return Ok(()) };
        if let Some((_, elsewhere)) = judge.carry.take_if(|(time, _)| step.now >= *time) {
            let Pose { x, y, heading } = elsewhere;
            let place = WorldPlace { name: "h1".into(), x, y, heading };
            self.put.call(place, Duration::secs(1)).map_err(|_| Fault::new("there are no hands"))?;
        }
        while let Some((_, reply)) = self.put.reply() {
            assert!(matches!(reply, runtime::Reply::Answer(answer) if answer.done), "{reply:?}");
        }
        let mut diary = judge.diary.lock().unwrap();
        while let Some(pose) = self.pose.take() {
            diary.poses.push((pose.header().stamp, pose.pose));
        }
        while let Some(pose) = self.other.take() {
            diary.others.push((pose.header().stamp, pose.pose));
        }
        while let Some(pose) = self.reckoned.take() {
            diary.reckoned.push((pose.header().stamp, pose.pose));
        }
        while let Some(state) = self.state.take() {
            diary.states.push((state.header().stamp, *state));
        }
        let moment = judge.truth.robot("h1").ok_or(Fault::new("no robot"))?;
        diary.truth.push((judge.truth.time(), moment.truth.pose));
        Ok(())
    }
}

impl Diary {
    /// Where the robot was at a time.
    fn truth_at(&self, time: Time) -> Pose {
        let after = self.truth.partition_point(|(at, _)| *at < time).min(self.truth.len() - 1);
        let ((from, a), (to, b)) = (self.truth[after.saturating_sub(1)], self.truth[after]);
        let part = if to > from { (time - from).seconds() / (to - from).seconds() } else { 1.0 };
        let turn = wrap(b.heading - a.heading);
        Pose::new(a.x + (b.x - a.x) * part, a.y + (b.y - a.y) * part, a.heading + turn * part)
    }

    /// How far off poses are that were told from a time to another (m), sorted, and the greatest error of the heading.
    pub(crate) fn off(&self, told: &[(Time, Pose)], from: f64, to: f64) -> (Vec<f64>, f64) {
        let within = told.iter().filter(|(stamp, _)| (from..to).contains(&stamp.seconds()));
        let off = within.map(|(stamp, pose)| {
            let truth = self.truth_at(*stamp);
            (pose.position().distance(truth.position()), wrap(pose.heading - truth.heading).abs())
        });
        let (mut places, headings): (Vec<f64>, Vec<f64>) = off.unzip();
        places.sort_by(f64::total_cmp);
        (places, headings.into_iter().fold(0.0, f64::max))
    }

    fn errors(&self, from: f64, to: f64) -> (Vec<f64>, f64) {
        self.off(&self.poses, from, to)
    }

    /// The way of the robot (m).
    pub(crate) fn way(&self) -> f64 {
        self.truth.windows(2).map(|pair| pair[0].1.position().distance(pair[1].1.position())).sum()
    }

    pub(crate) fn states(&self, from: f64, to: f64) -> impl Iterator<Item = Whereabouts> + '_ {
        let within = self.states.iter().filter(move |(stamp, _)| (from..to).contains(&stamp.seconds()));
        within.map(|(_, told)| told.state)
    }
}

const BEGIN: Pose = Pose::new(2.0, 3.2, 0.4);

/// Runs the system: how it starts, where the robot is put at a time, what is asked meanwhile.
fn run(
    seed: u64,
    start: &str,
    carry: Option<(f64, Pose)>,
    requests: &str,
    seconds: i64,
) -> Arc<Mutex<Diary>> {
    let text = format!("{}\n{requests}", SYSTEM.replace("START", start));
    play(&text, BEGIN, seed, carry, seconds)
}

/// Runs a system with the robot h1 and a witness, from where it begins.
pub(crate) fn play(
    text: &str,
    begin: Pose,
    seed: u64,
    carry: Option<(f64, Pose)>,
    seconds: i64,
) -> Arc<Mutex<Diary>> {
    let mut types = registry();
    types.extend([AgentType::of::<Rover>(), AgentType::of::<Witness>()]);
    let loaded = file::read(text, "localizing.toml", None, &[], &types)
        .unwrap_or_else(|mistakes| panic!("{mistakes}"));
    let (mut plan, mut mistakes) = (loaded.plan, Vec::new());
    let world = WorldPlan::read(&loaded.world.unwrap(), &mut mistakes).unwrap();
    let entry = plan.section("robot").unwrap().get("h1").unwrap().clone();
    let elsewhere = ["driver", "start", "bumper_latches"];
    let model = Model::read(entry.value.as_table().unwrap(), entry.at, &elsewhere, &mut mistakes);
    assert!(mistakes.is_empty(), "{mistakes:?}");
    let body = simulated::Robot { name: "h1".into(), model: model.unwrap(), start: begin, goal: None };
    let (mut drivers, truth) = simulated::raise(&world, seed, &[body]).unwrap();
    let (driver, diary) = (drivers.remove(0), Arc::<Mutex<Diary>>::default());
    let carry = carry.map(|(time, pose)| (Time::from_seconds(time), pose));
    let judge = Judge { truth, carry, diary: diary.clone() };
    let hands = driver.hands().agent_type("hands");
    types = registry();
    plan.agent_mut("h1").unwrap().kind = "h1".into();
    plan.add::<simulated::WorldAgent>("world", Default::default());
    plan.agent_mut("world").unwrap().kind = "hands".into();
    plan.agent_mut("world").unwrap().executor = Some("gate".into());
    simulated::SERVICES.iter().for_each(|service| plan.on("world", service));
    plan.wires.push(WirePlan::new("witness.put", "world.put"));
    types.extend([
        hands,
        Berth::with(Gate::new(driver, Latch::private())).agent_type("h1"),
        AgentType::of::<Rover>(),
        AgentType::made_by(move |_: NoParams| {
            let mut witness = <Witness as Declare>::build(NoParams);
            witness.judge = Some(judge.clone());
            witness
        }),
    ]);
    let (limit, parse) = (Some(Duration::secs(seconds)), control::words::parse);
    let options = Options { limit, parse, ..Options::default() };
    let report = Simulation::new(&plan, &types, options).unwrap().run().unwrap();
    let died = report.incidents.iter().filter(|incident| incident.what.contains("died")).count();
    assert_eq!(died, 0, "{:?}", report.incidents);
    diary
}

const KNOWN: &str = "known_start = true\nx = 2.02\ny = 3.17\nheading = 0.43";

pub(crate) fn quantile(sorted: &[f64], part: f64) -> f64 {
    sorted[((sorted.len() - 1) as f64 * part) as usize]
}

#[test]
fn with_wheels_that_are_wrong_and_furniture_that_was_moved_it_is_right_to_a_centimetre() {
    let diary = run(3, KNOWN, None, "", 60);
    let diary = diary.lock().unwrap();
    let way = diary.way();
    assert!(way > 8.0, "it drove about: {way} m");
    let (places, heading) = diary.errors(0.0, 60.0);
    let (half, most, worst) = (quantile(&places, 0.5), quantile(&places, 0.95), quantile(&places, 1.0));
    assert!(places.len() > 280, "{} of 300 scans", places.len());
    assert!(half < 0.005 && most < 0.01 && worst < 0.02, "{half} {most} {worst}");
    assert!(heading < 0.02, "{heading}");
    assert!(diary.states(0.0, 60.0).all(|state| state == Whereabouts::Tracking));
}

#[test]
fn from_an_unknown_start_and_after_it_was_carried_it_is_found() {
    let elsewhere = Pose::new(8.6, 3.4, -2.0);
    let diary = run(5, "", Some((25.0, elsewhere)), "", 60);
    let diary = diary.lock().unwrap();
    assert_eq!(diary.states(0.0, 1.0).next(), Some(Whereabouts::Searching));
    let (places, _) = diary.errors(0.0, 60.0);
    assert!(quantile(&places, 1.0) < 0.02, "nothing wrong was told: {}", quantile(&places, 1.0));
    assert!(diary.states(15.0, 25.0).all(|state| state == Whereabouts::Tracking), "found");
    assert!(diary.states(25.4, 27.0).any(|state| state == Whereabouts::Searching), "lost");
    assert!(diary.states(45.0, 60.0).all(|state| state == Whereabouts::Tracking), "found again");
}

#[test]
fn with_a_laser_that_is_stuck_it_says_that_it_is_lost_and_nothing_else() {
    let requests = "[[at]]\ntime = \"10s\"\ndo = \"fault h1.scan stuck\"\n[[at]]\ntime = \"11.5s\"\ndo = \"fault h1.scan ok\"";
    let diary = run(3, KNOWN, None, requests, 30);
    let diary = diary.lock().unwrap();
    assert!(
        diary.states(10.9, 11.4).all(|state| state == Whereabouts::Lost),
        "{:?}",
        diary.states(10.0, 12.0).collect::<Vec<_>>()
    );
    let (places, _) = diary.errors(0.0, 30.0);
    assert!(quantile(&places, 1.0) < 0.02, "nothing wrong was told: {}", quantile(&places, 1.0));
    assert!(diary.states(20.0, 30.0).all(|state| state == Whereabouts::Tracking), "it sees again");
}

#[test]
fn the_floor_of_the_world_is_a_table_in_the_plan() {
    let mut types = registry();
    types.extend([AgentType::of::<Rover>(), AgentType::of::<Witness>()]);
    let read = |text: &str| {
        file::read_plan(text, "localizing.toml", &types).unwrap_or_else(|mistakes| panic!("{mistakes}"))
    };
    let plan = read(&SYSTEM.replace("START", ""));
    let floor =
        |plan: &runtime::Plan| plan.agent("localizer").unwrap().params.get("floor").unwrap().value.clone();
    let table = floor(&plan);
    let count = |list: &str| table.as_table().unwrap().get(list).unwrap().value.as_list().unwrap().len();
    // Four outer walls, that along the corridor in three parts, one between the rooms; what can be moved is left out, as are low things.
    assert_eq!((count("walls"), count("discs")), (8, 4), "{table}");
    assert_eq!(count("boxes"), 8, "{table}");
    assert_eq!(floor(&read(&file::write_plan(&plan))), table);
}
