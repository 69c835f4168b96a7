//! The localizer: where the robot is on a known floor.
//!
//! ```text
//!  odometry at the stamp of the scan ─▶ prediction ─┐
//!  scan ─▶ laid over the floor ─────────────────────┴─▶ correction ─▶ pose, in the frame "map"
//!             └─ does not fit, three times ─▶ search ─▶ the places that fit ─▶ one of them
//!  place (somebody says where it is) ─▶ begin from there
//! ```
//!
//! A pose is sent right after a scan that fits, with the stamp of the scan; never one that is not believed. Who needs the pose of now goes on
//! from it by the odometry.

use std::any::Any;

use navigation::drift::Drift;
pub use navigation::floor::FloorPlan;
use navigation::floor::PlanField;
use navigation::localisation::State;
use navigation::localisation::floor::{FloorLocalizer, FloorParams};
use navigation::matching::{Geometry, MatchParams};
use navigation::monte_carlo::MonteCarloParams;
use runtime::{Agent, Envelope, Fault, Input, Output, Service, Step};
use types::chance::Stream;
use types::messages::{Guess, LaserScan, Localisation, Odometry, Placed, Placement, Whereabouts};
use types::params::{ParamValue as _, Params};
use types::value::{Mistake, Table};
use types::{Duration, Pose, Time};

use crate::shared::BODY;

/// The frame of the floor plan.
pub const MAP: &str = "map";

/// The floor, and how the robot is kept track of on it.
#[derive(Clone, Debug, Params)]
#[params(check = whole)]
pub struct LocalizerParams {
    /// What stands on the floor, as a plan of the building shows it (m): { walls = [[x0, y0, x1, y1]], discs = [[x, y, radius]], boxes = [[x, y, length, depth, angle]] }, a wall with a thickness as fifth number. In a system file also "world" for the still walls, boxes and pillars of the simulated world, or the name of a file with such a table, as in "office.toml". Another floor counts from the next start of the agent.
    #[param(default = FloorPlan::default())]
    pub floor: FloorPlan,
    /// Whether the robot begins at x, y and heading. False: it is searched for all over the floor.
    #[param(default = false)]
    pub known_start: bool,
    /// Where it begins, along x of the plan (m).
    #[param(default = 0.0, min = -100000.0, max = 100000.0)]
    pub x: f64,
    /// Where it begins, along y of the plan (m).
    #[param(default = 0.0, min = -100000.0, max = 100000.0)]
    pub y: f64,
    /// Where it looks in the beginning (rad, counter-clockwise from x).
    #[param(default = 0.0, min = -7.0, max = 7.0)]
    pub heading: f64,
    /// Standard deviation of a place that somebody tells, here or by `place` (m). 0.1: a robot that was put on a mark by hand.
    #[param(default = 0.1, min = 0.001, max = 10.0)]
    pub start_deviation: f64,
    /// Standard deviation of a heading that somebody tells (rad). 0.1 is 6°, which is seen with bare eyes.
    #[param(default = 0.1, min = 0.001, max = 3.0)]
    pub start_heading_deviation: f64,
    /// Radius of the robot (m): nearer to a wall it is not searched for. 0.225 is that of the exploring robot. Counts from the next start of the agent.
    #[param(default = 0.225, min = 0.0, max = 1.0)]
    pub radius: f64,
    /// Standard deviation of a range of the laser (m). 0.01 is that of a common scanner.
    #[param(default = 0.01, min = 0.0005, max = 0.5)]
    pub noise: f64,
    /// Standard deviation of the plan from the building (m). 0.003 for a plan that was measured, 0.02 for one that was drawn.
    #[param(default = 0.003, min = 0.0005, max = 0.5)]
    pub plan_noise: f64,
    /// Variance of the way of a wheel for each metre of it (m). 0.0005 is a deviation of 2 cm after a metre: more than wheels slip, as wheels that are larger than was thought go wrong in the same way all the time.
    #[param(default = 0.0005, min = 0.000001, max = 0.1)]
    pub wheel_noise: f64,
    /// From wheel to wheel (m). 0.36 is that of the exploring robot.
    #[param(default = 0.36, min = 0.01, max = 3.0)]
    pub track: f64,
    /// Beams of a scan that are laid over the floor. 181 are one a degree over half a turn; more make it slower and hardly more exact.
    #[param(default = 181u32, min = 20, max = 256)]
    pub beams: u32,
    /// Share of the points of a scan that must lie on the plan while the robot is tracked (0 to 1). 0.4: a crowd may hide more than half of it.
    #[param(default = 0.4, min = 0.05, max = 1.0)]
    pub inliers_least: f64,
    /// The same for a place that was searched for, or that somebody said (0 to 1). 0.6: in a wrong place seldom more than half of the points lie on something.
    #[param(default = 0.6, min = 0.1, max = 1.0)]
    pub inliers_sure: f64,
    /// So many scans in a row must not fit before the robot is searched for. 3: somebody may walk by.
    #[param(default = 3u32, min = 1, max = 100)]
    pub misses: u32,
    /// After so long without a scan it is said to be lost (time). 1 s is ten scans of a common scanner.
    #[param(default = Duration::secs(1), min = 0.05, max = 60.0)]
    pub silence: Duration,
    /// The most imagined robots in a search. 8000: one for each 0.1 m² and 20° of a flat of 50 m². They cost half a microsecond each a scan. Counts from the next start of the agent.
    #[param(default = 8000u32, min = 100, max = 100000)]
    pub particles: u32,
    /// Seed of what is drawn in a search. Runs with the same seed draw the same.
    #[param(default = 1u64)]
    pub seed: u64,
}

/// There must be something to find the way by, and each thing in it must be what it can be.
fn whole(params: &LocalizerParams, read: &Table) -> Vec<Mistake> {
    let Some(entry) = read.get("floor") else {
        let help = "write floor = \"world\" for that of the simulated world, floor = \"office.toml\" for that of a file, or floor = { walls = [[x0, y0, x1, y1], …] }";
        return vec![Mistake::new(Default::default(), "a localizer needs a floor").help(help)];
    };
    let is_right = FloorPlan::from_value(&entry.value).is_some();
    if is_right && params.floor.is_empty() {
        return vec![
            Mistake::new(entry.at, "nothing stands on this floor")
                .help("a robot is found by walls, discs and boxes"),
        ];
    }
    Vec::new()
}

impl LocalizerParams {
    fn floor_params(&self) -> FloorParams {
        FloorParams {
            radius: self.radius,
            drift: Drift { wheel: self.wheel_noise, track: self.track, ..Drift::default() },
            matching: MatchParams {
                noise: self.noise,
                plan_noise: self.plan_noise,
                ..MatchParams::default()
            },
            cloud: MonteCarloParams {
                particles_most: self.particles as usize,
                ..MonteCarloParams::default()
            },
            beams: self.beams as usize,
            inliers_least: self.inliers_least,
            inliers_sure: self.inliers_sure,
            misses: self.misses,
            ..FloorParams::default()
        }
    }
}

/// Tells where the robot is on a known floor, from what its laser sees and its wheels do; when that is not known it says so, and searches.
#[derive(Agent)]
pub struct Localizer {
    /// The scan.
    #[robot("scan")]
    scan: Input<LaserScan>,
    /// Where the wheels say that the robot is, with the past. Without it nothing is told.
    odometry: Input<Odometry>,
    /// Takes where the robot is from somebody who knows, or that nobody knows.
    place: Service<Placement, Placed>,
    /// The pose in the frame "map" and the velocity, with the stamp of the scan from which it is known.
    #[port(history = 64)]
    pose: Output<Odometry>,
    /// Whether it is known where the robot is, and how well.
    #[port(history = 16)]
    state: Output<Localisation>,
    params: LocalizerParams,
    tracker: Option<Tracker>,
}

impl Agent for Localizer {
    /// All memory is taken here.
    fn start(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.tracker = Some(Tracker::new(&self.params)?);
        Ok(())
    }

    /// Where the robot is, if the floor is the same.
    fn take_over(&mut self, before: &mut dyn Any) {
        if let Some(before) = before.downcast_mut::<Localizer>()
            && before
                .tracker
                .as_ref()
                .is_some_and(|tracker| *tracker.localizer.floor().plan() == self.params.floor)
        {
            core::mem::swap(&mut self.tracker, &mut before.tracker);
        }
    }

    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        let Localizer { scan, odometry, place, pose, state, params, tracker } = self;
        let Some(tracker) = tracker else { return Ok(()) };
        tracker.localizer.set_params(params.floor_params());
        place.serve(|placement| tracker.place(params, placement));
        if let Some(received) = scan.newest() {
            let stamp = received.header().stamp;
            let found = odometry.at(stamp).map(|found| found.value()).or_else(|| odometry.latest());
            let Some(moved) = found else { return Ok(()) };
            let envelope = Envelope { stamp: Some(stamp), ..Envelope::default() };
            if let Some(known) = tracker.hear(&received, received.row(), moved, stamp) {
                pose.send_as(envelope, known);
            }
            state.send_as(envelope, tracker.told());
        } else if let Some(moved) = odometry.latest()
            && tracker.is_silent(step.now, params.silence)
        {
            tracker.localizer.silence(moved.pose);
            state.send(tracker.told());
        }
        Ok(())
    }
}

/// What keeps track of the robot.
struct Tracker {
    localizer: FloorLocalizer<PlanField>,
    /// When the last scan was heard that was measured, or the agent began.
    heard: Option<Time>,
}

impl Tracker {
    fn new(params: &LocalizerParams) -> Result<Tracker, Fault> {
        let floor = PlanField::new(&params.floor).map_err(Fault::of)?;
        let stream = Stream::new(params.seed, "localizer");
        let mut localizer = FloorLocalizer::new(floor, params.floor_params(), stream);
        if params.known_start {
            let start = Pose::new(params.x, params.y, params.heading);
            localizer.place(start, params.start_deviation, params.start_heading_deviation);
        }
        Ok(Tracker { localizer, heard: None })
    }

    fn place(&mut self, params: &LocalizerParams, placement: &Placement) -> Placed {
        let Placement { x, y, heading, deviation, heading_deviation, anywhere } = *placement;
        if anywhere {
            self.localizer.forget();
            return Placed { taken: true };
        }
        let taken = [x, y, heading, deviation, heading_deviation].iter().all(|number| number.is_finite());
        if taken {
            let usual = |told: f64, usual: f64| if told > 0.0 { told } else { usual };
            let place = usual(deviation, params.start_deviation);
            let turn = usual(heading_deviation, params.start_heading_deviation);
            self.localizer.place(Pose::new(x, y, heading), place, turn);
        }
        Placed { taken }
    }

    /// Takes a scan, and gives the pose where it is believed.
    fn hear(&mut self, scan: &LaserScan, row: &[f32], moved: Odometry, stamp: Time) -> Option<Odometry> {
        self.heard = Some(stamp);
        let geometry = Geometry {
            angle_min: scan.angle_min.into(),
            angle_step: scan.angle_step.into(),
            range_min: scan.range_min.into(),
            range_max: scan.range_max.into(),
            mount: Pose::new(scan.mount_x.into(), scan.mount_y.into(), scan.mount_heading.into()),
        };
        self.localizer.update(moved.pose, row, &geometry);
        let pose = self.localizer.fix()?;
        Some(Odometry { frame: MAP.into(), body: BODY.into(), pose, twist: moved.twist })
    }

    /// Whether no scan has come for so long. The time is counted again from then on.
    fn is_silent(&mut self, now: Time, silence: Duration) -> bool {
        let since = *self.heard.get_or_insert(now);
        let is_silent = now - since > silence;
        if is_silent {
            self.heard = Some(now);
        }
        is_silent
    }

    fn told(&self) -> Localisation {
        let (deviation, heading_deviation) = self.localizer.deviations();
        let mut told = Localisation {
            state: match self.localizer.state() {
                State::Lost => Whereabouts::Lost,
                State::Searching => Whereabouts::Searching,
                State::Tracking => Whereabouts::Tracking,
            },
            deviation,
            heading_deviation,
            inliers: self.localizer.inliers(),
            ..Localisation::default()
        };
        for place in self.localizer.places() {
            let Pose { x, y, heading } = place.pose;
            // There is room for as many as there can be.
            let _ = told.guesses.push(Guess { x, y, heading, inliers: place.inliers });
        }
        told
    }
}
