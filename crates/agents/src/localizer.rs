//! The localizer: where the robot is on a known floor, or among known landmarks.
//!
//! ```text
//!  odometry at the stamp of what is seen ─▶ prediction ─┐
//!  scan ─▶ laid over the floor ─────────────────────────┼─▶ correction ─▶ pose, in the frame "map"
//!  landmarks, as a camera or infrared tell them ────────┘
//!             └─ nothing fits, again and again ─▶ search ─▶ the places that fit ─▶ one of them
//!  place (somebody says where it is) ─▶ begin from there
//! ```
//!
//! On a floor a pose is sent right after a scan or a landmark that fits, with its stamp; never one that is not believed. Who needs the pose of now
//! goes on from it by the odometry. By landmarks alone it is sent in every step, for the last that the wheels told: between two landmarks there may be
//! a long way, on which nobody but them tells anything.
//!
//! Both corrections go into one filter, each with its own noise, so the one that knows more counts more: beside a laser landmarks matter where the
//! scan tells little, as along a corridor, where it does not fit, and while the robot is searched for. A place that landmarks tell in a search is one
//! that the next scan must confirm.

use std::any::Any;

use navigation::drift::Drift;
pub use navigation::floor::FloorPlan;
use navigation::floor::PlanField;
use navigation::localisation::State;
use navigation::localisation::floor::{FloorLocalizer, FloorParams};
use navigation::localisation::landmarks::{
    LandmarkTracker, Mark, Marks, Parameters, TrackerParams, Watch, marks::MOST_MARKS,
};
use navigation::matching::{Geometry, MatchParams};
use navigation::monte_carlo::MonteCarloParams;
use runtime::{Agent, Envelope, Fault, Input, Output, Service, Step};
use types::chance::Stream;
use types::messages::{
    Guess, LandmarkSighting, Landmarks, LaserScan, Localisation, Odometry, Placed, Placement, Whereabouts,
};
use types::params::{ParamValue as _, Params};
use types::value::{Mistake, Table};
use types::{Duration, Point, Pose, Time};

use crate::shared::BODY;

/// The frame of the floor plan.
pub const MAP: &str = "map";

/// The floor and the landmarks, and how the robot is kept track of by them.
#[derive(Clone, Debug, Params)]
#[params(check = whole)]
pub struct LocalizerParams {
    /// What stands on the floor, as a plan of the building shows it (m): { walls = [[x0, y0, x1, y1]], discs = [[x, y, radius]], boxes = [[x, y, length, depth, angle]] }, a wall with a thickness as fifth number. In a system file also "world" for the still walls, boxes and pillars of the simulated world, or the name of a file with such a table, as in "office.toml". Another floor counts from the next start of the agent.
    #[param(default = FloorPlan::default())]
    pub floor: FloorPlan,
    /// The landmarks and where they stand: [[id, x, y], …], or [id, x, y, facing] with the direction in which the first of its transmitters of infrared looks (m, m, rad). With a floor they help; without one they are all that the robot is found by. Others count from the next start of the agent.
    pub landmarks: Vec<Vec<f64>>,
    /// Whether the robot begins at x, y and heading. False: it is searched for everywhere.
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
    /// Standard deviation of the range to a landmark (m). 0.02 is a tube at a metre in a picture of 320 pixels.
    #[param(default = 0.02, min = 0.001, max = 10.0)]
    pub landmark_noise: f64,
    /// What is added to it for each metre of the range (m). 0.02: at 3 m half a pixel is 5 cm and more.
    #[param(default = 0.02, min = 0.0, max = 1.0)]
    pub landmark_noise_part: f64,
    /// Standard deviation of the bearing to a landmark (rad). 0.01 is three pixels of a picture of 320 and 60°: a head that turns is late by about that.
    #[param(default = 0.01, min = 0.0005, max = 1.0)]
    pub landmark_bearing_noise: f64,
    /// By landmarks alone: after so many readings in a row in which nothing is where it should be the robot is searched for. 15: a second and more of pictures, in which somebody with colourful clothes may walk by.
    #[param(default = 15u32, min = 1, max = 10000)]
    pub landmark_misses: u32,
    /// How far the infrared of a landmark is heard (m). 2 is that of the transmitters of the simulator. Counts from the next start of the agent.
    #[param(default = 2.0, min = 0.1, max = 100.0)]
    pub infrared_reach: f64,
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
    let mut mistakes = Vec::new();
    match (read.get("floor"), read.get("landmarks")) {
        (None, None) => {
            let help = "write floor = \"world\" for that of the simulated world, floor = \"office.toml\" for that of a file, floor = { walls = [[x0, y0, x1, y1], …] }, or landmarks = [[id, x, y], …]";
            mistakes
                .push(Mistake::new(Default::default(), "a localizer needs a floor or landmarks").help(help));
        }
        (Some(entry), _)
            if params.floor.is_empty()
                && params.landmarks.is_empty()
                && FloorPlan::from_value(&entry.value).is_some() =>
        {
            let mistake = Mistake::new(entry.at, "nothing stands on this floor");
            mistakes.push(mistake.help("a robot is found by walls, discs and boxes"));
        }
        _ => {}
    }
    if let Some(entry) = read.get("landmarks").filter(|_| !are_whole(&params.landmarks)) {
        let what = format!(
            "landmarks are at most {MOST_MARKS} of [id, x, y] or [id, x, y, facing], each with an id of its own from 1"
        );
        mistakes.push(Mistake::new(entry.at, what));
    }
    mistakes
}

/// Whether each landmark is what one can be.
fn are_whole(landmarks: &[Vec<f64>]) -> bool {
    let is_one = |row: &Vec<f64>| {
        matches!(row.len(), 3 | 4)
            && row.iter().all(|number| number.is_finite())
            && (1.0..=1e6).contains(&row[0])
            && row[0] % 1.0 == 0.0
    };
    let is_alone =
        |place: usize| landmarks[..place].iter().all(|other| other.first() != landmarks[place].first());
    landmarks.len() <= MOST_MARKS
        && landmarks.iter().enumerate().all(|(place, row)| is_one(row) && is_alone(place))
}

impl LocalizerParams {
    fn drift(&self) -> Drift {
        Drift { wheel: self.wheel_noise, track: self.track, ..Drift::default() }
    }

    fn landmark_params(&self) -> Parameters {
        Parameters {
            range: self.landmark_noise,
            range_part: self.landmark_noise_part,
            bearing: self.landmark_bearing_noise,
            ..Parameters::of_wheels(&self.drift())
        }
    }

    fn tracker_params(&self) -> TrackerParams {
        TrackerParams { misses: self.landmark_misses, ..TrackerParams::default() }
    }

    fn marks(&self) -> Marks {
        let mark = |row: &Vec<f64>| {
            let [id, x, y] = row.first_chunk().copied()?;
            Some(Mark {
                id: id as u32,
                at: Point::new(x, y),
                facing: row.get(3).copied().unwrap_or_default(),
            })
        };
        Marks::new(self.landmarks.iter().filter_map(mark), self.infrared_reach)
    }

    fn watch(&self) -> Watch {
        Watch::new(self.marks(), self.landmark_params())
    }

    fn floor_params(&self) -> FloorParams {
        FloorParams {
            radius: self.radius,
            drift: self.drift(),
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

/// Tells where the robot is on a known floor or among known landmarks, from what its laser, its camera and its infrared tell and its wheels do; when that is not known it says so, and searches.
#[derive(Agent)]
pub struct Localizer {
    /// The scan.
    #[robot("scan")]
    scan: Input<LaserScan>,
    /// What is seen of landmarks, or heard by infrared, by any number of sensors. What a robot senses of them comes here by itself.
    #[robot("landmarks")]
    landmarks: Input<Landmarks>,
    /// Where the wheels say that the robot is, with the past. Without it nothing is told.
    odometry: Input<Odometry>,
    /// Takes where the robot is from somebody who knows, or that nobody knows.
    place: Service<Placement, Placed>,
    /// The pose in the frame "map" and the velocity, with the stamp of what it is known from.
    #[port(history = 64, interpreted)]
    pose: Output<Odometry>,
    /// Whether it is known where the robot is, and how well.
    #[port(history = 16, interpreted)]
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

    /// Where the robot is, if floor and landmarks are the same.
    fn take_over(&mut self, before: &mut dyn Any) {
        if let Some(before) = before.downcast_mut::<Localizer>()
            && before.tracker.as_ref().is_some_and(|tracker| tracker.is_of(&self.params))
        {
            core::mem::swap(&mut self.tracker, &mut before.tracker);
        }
    }

    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        let Localizer { scan, landmarks, odometry, place, pose, state, params, tracker } = self;
        let Some(tracker) = tracker else { return Ok(()) };
        tracker.set_params(params);
        place.serve(|placement| tracker.place(params, placement));
        if let Some(received) = odometry.newest() {
            tracker.reckon(received.header().stamp, *received);
        }
        // The wheels as they were at a time, or as they were last heard.
        let reckoned = tracker.reckoned;
        let wheels = |stamp| odometry.at(stamp).map(|found| found.value()).or(reckoned.map(|(_, last)| last));
        let mut tell = |stamp, known: Option<Odometry>, told| {
            let envelope = Envelope { stamp: Some(stamp), ..Envelope::default() };
            if let Some(known) = known {
                pose.send_as(envelope, known);
            }
            state.send_as(envelope, told);
        };
        while let Some(received) = landmarks.take() {
            let stamp = received.header().stamp;
            let Some(moved) = wheels(stamp) else { continue };
            if let Some(known) = tracker.see(&received.seen, moved, stamp) {
                tell(stamp, Some(known), tracker.told());
            }
        }
        let heard = scan.newest().and_then(|received| {
            let stamp = received.header().stamp;
            Some((stamp, tracker.hear(&received, received.row(), wheels(stamp)?, stamp)?))
        });
        if let Some((stamp, known)) = heard.or_else(|| tracker.go_on(step.now, params.silence)) {
            tell(stamp, known, tracker.told());
        }
        Ok(())
    }
}

/// By what it is known where the robot is.
enum Keeper {
    /// A floor, and landmarks where there are some.
    Floor(Box<FloorLocalizer<PlanField>>, Box<Watch>),
    /// Landmarks alone.
    Landmarks(Box<LandmarkTracker>),
}

/// What keeps track of the robot.
struct Tracker {
    keeper: Keeper,
    /// When a scan or a landmark was last taken, or the agent began.
    heard: Option<Time>,
    /// What the wheels last told, and of when.
    reckoned: Option<(Time, Odometry)>,
    /// Whether that was told on.
    is_told: bool,
}

impl Tracker {
    fn new(params: &LocalizerParams) -> Result<Tracker, Fault> {
        let keeper = if params.floor.is_empty() {
            Keeper::Landmarks(Box::new(LandmarkTracker::new(params.watch(), params.tracker_params())))
        } else {
            let floor = PlanField::new(&params.floor).map_err(Fault::of)?;
            let stream = Stream::new(params.seed, "localizer");
            Keeper::Floor(
                Box::new(FloorLocalizer::new(floor, params.floor_params(), stream)),
                Box::new(params.watch()),
            )
        };
        let mut tracker = Tracker { keeper, heard: None, reckoned: None, is_told: true };
        if params.known_start {
            let start = Pose::new(params.x, params.y, params.heading);
            tracker.put(start, params.start_deviation, params.start_heading_deviation);
        }
        Ok(tracker)
    }

    /// Whether it keeps track on this floor, by these landmarks.
    fn is_of(&self, params: &LocalizerParams) -> bool {
        let (is_floor, watch) = match &self.keeper {
            Keeper::Floor(localizer, watch) => (*localizer.floor().plan() == params.floor, &**watch),
            Keeper::Landmarks(tracker) => (params.floor.is_empty(), tracker.watch()),
        };
        is_floor && *watch.marks() == params.marks()
    }

    fn set_params(&mut self, params: &LocalizerParams) {
        match &mut self.keeper {
            Keeper::Floor(localizer, watch) => {
                localizer.set_params(params.floor_params());
                watch.set_parameters(params.landmark_params());
            }
            Keeper::Landmarks(tracker) => {
                tracker.set_parameters(params.landmark_params(), params.tracker_params())
            }
        }
    }

    fn put(&mut self, pose: Pose, place: f64, heading: f64) {
        match &mut self.keeper {
            Keeper::Floor(localizer, _) => localizer.place(pose, place, heading),
            Keeper::Landmarks(tracker) => tracker.place(pose, place, heading),
        }
    }

    fn place(&mut self, params: &LocalizerParams, placement: &Placement) -> Placed {
        let Placement { x, y, heading, deviation, heading_deviation, anywhere } = *placement;
        if anywhere {
            match &mut self.keeper {
                Keeper::Floor(localizer, watch) => {
                    localizer.forget();
                    watch.forget();
                }
                Keeper::Landmarks(tracker) => tracker.forget(),
            }
            return Placed { taken: true };
        }
        let taken = [x, y, heading, deviation, heading_deviation].iter().all(|number| number.is_finite());
        if taken {
            let usual = |told: f64, usual: f64| if told > 0.0 { told } else { usual };
            let place = usual(deviation, params.start_deviation);
            let turn = usual(heading_deviation, params.start_heading_deviation);
            self.put(Pose::new(x, y, heading), place, turn);
        }
        Placed { taken }
    }

    /// Takes what the wheels tell.
    fn reckon(&mut self, stamp: Time, moved: Odometry) {
        self.reckoned = Some((stamp, moved));
        self.is_told = false;
        if let Keeper::Landmarks(tracker) = &mut self.keeper {
            tracker.moved(stamp, moved.pose);
        }
    }

    /// Takes what is seen or heard of landmarks. Gives the pose where a floor is known and they have told it; without one [it goes on](Tracker::go_on).
    fn see(&mut self, seen: &[LandmarkSighting], moved: Odometry, stamp: Time) -> Option<Odometry> {
        let pose = match &mut self.keeper {
            Keeper::Floor(localizer, watch) => {
                localizer.sees(watch, stamp, moved.pose, seen).then(|| localizer.pose()).flatten()
            }
            Keeper::Landmarks(tracker) => {
                tracker.sees(stamp, moved.pose, seen);
                None
            }
        };
        if pose.is_some() {
            self.heard = Some(stamp);
        }
        pose.map(|pose| on_map(pose, moved))
    }

    /// Takes a scan where a floor is known, and gives the pose where it is believed.
    fn hear(
        &mut self,
        scan: &LaserScan,
        row: &[f32],
        moved: Odometry,
        stamp: Time,
    ) -> Option<Option<Odometry>> {
        let Keeper::Floor(localizer, _) = &mut self.keeper else { return None };
        self.heard = Some(stamp);
        let geometry = Geometry {
            angle_min: scan.angle_min.into(),
            angle_step: scan.angle_step.into(),
            range_min: scan.range_min.into(),
            range_max: scan.range_max.into(),
            mount: Pose::new(scan.mount_x.into(), scan.mount_y.into(), scan.mount_heading.into()),
        };
        localizer.update(moved.pose, row, &geometry);
        Some(localizer.fix().map(|pose| on_map(pose, moved)))
    }

    /// No scan has come: by landmarks alone the pose by the wheels; on a floor, after too long a silence, that it is lost. The time is counted again from
    /// then on.
    fn go_on(&mut self, now: Time, silence: Duration) -> Option<(Time, Option<Odometry>)> {
        let (_, moved) = self.reckoned.filter(|_| !self.is_told)?;
        match &mut self.keeper {
            Keeper::Landmarks(tracker) => {
                self.is_told = true;
                let known = tracker.pose();
                Some(known.map_or((now, None), |(stamp, pose)| (stamp, Some(on_map(pose, moved)))))
            }
            Keeper::Floor(localizer, _) => {
                let since = *self.heard.get_or_insert(now);
                if now - since <= silence {
                    return None;
                }
                (self.heard, self.is_told) = (Some(now), true);
                localizer.silence(moved.pose);
                Some((now, None))
            }
        }
    }

    fn told(&self) -> Localisation {
        let (state, (deviation, heading_deviation), inliers) = match &self.keeper {
            Keeper::Floor(localizer, _) => (localizer.state(), localizer.deviations(), localizer.inliers()),
            Keeper::Landmarks(tracker) => (tracker.state(), tracker.deviations(), tracker.fitting()),
        };
        let state = match state {
            State::Lost => Whereabouts::Lost,
            State::Searching => Whereabouts::Searching,
            State::Tracking => Whereabouts::Tracking,
        };
        let mut told =
            Localisation { state, deviation, heading_deviation, inliers, ..Localisation::default() };
        if let Keeper::Floor(localizer, _) = &self.keeper {
            for place in localizer.places() {
                let Pose { x, y, heading } = place.pose;
                // There is room for as many as there can be.
                let _ = told.guesses.push(Guess { x, y, heading, inliers: place.inliers });
            }
        }
        told
    }
}

/// A pose on the map, with the velocity that the wheels told.
fn on_map(pose: Pose, moved: Odometry) -> Odometry {
    Odometry { frame: MAP.into(), body: BODY.into(), pose, twist: moved.twist }
}
