//! Goals: stages in order over the truth of the world, each with a condition and, if wanted, a time for which it must hold.

use types::value::{Mistake, Span, Table, TableReader};
use types::{Duration, Point, Time};

use crate::plan::WorldPlan;
use crate::read::{not_an_angle, read_angle};
use crate::simulator::{PHYSICS_STEP, RobotId, Simulator};

/// What a run must reach.
#[derive(Clone, Debug, PartialEq)]
pub struct Goal {
    /// The time for the whole.
    pub within: Duration,
    /// How many collisions are forgiven.
    pub collisions: u32,
    /// The stages, one after another.
    pub stages: Vec<Stage>,
}

/// One stage of a goal.
#[derive(Clone, Debug, PartialEq)]
pub struct Stage {
    /// What must come true.
    pub condition: Condition,
    /// For how long it must be true without a break.
    pub hold: Duration,
}

/// What can be asked of a robot.
#[derive(Clone, Debug, PartialEq)]
pub enum Condition {
    /// Its middle is inside the region.
    Inside(String),
    /// Its middle is nearer than this to the middle of a person, thing or landmark (m).
    Near(String, f64),
    /// It is farther than this from where it was when the stage began (m).
    Moved(f64),
    /// Since the stage began its heading has turned by this much in all, to either side (rad).
    Turned(f64),
    /// It was nearer than this to a person who walks (m), for this time in all.
    Follows(String, f64, Duration),
}

/// How far a run has come on the way to its goal.
#[derive(Clone, Debug, PartialEq)]
pub struct Progress {
    stage: usize,
    /// When the first stages were met.
    passed: [Time; TOLD],
    began: Option<(f64, Point)>,
    held: Duration,
    followed: Duration,
    /// The last measure of the condition, for the explanation: a distance (m) or an angle (rad).
    measure: Option<f64>,
    state: State,
}

/// Of so many stages the time is told at which they were met.
const TOLD: usize = 12;

#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    Open,
    Met(Time),
    TimeOver,
    Collided(u32),
}

impl Goal {
    /// Reads a goal over the names of a world. Gives nothing when there is a mistake, and all mistakes.
    ///
    /// ```toml
    /// within = "600s"
    /// collisions = 0
    /// stage = [
    ///     { inside = "corridor" },
    ///     { near = "balloon", distance = 1.2, hold = "1s" },
    ///     { moved = 0.5 },
    ///     { turned = "150deg" },
    ///     { follows = "guide", distance = 2.0, time = "10s" },
    /// ]
    /// ```
    pub fn read(table: &Table, at: Span, world: &WorldPlan, mistakes: &mut Vec<Mistake>) -> Option<Goal> {
        let before = mistakes.len();
        let mut reader = TableReader::new(table, at, "the goal");
        let within = reader.duration("within").unwrap_or(Duration::secs(600));
        if within <= Duration::ZERO {
            let what = format!("\"within\" is {within}: a run lasts longer than no time");
            reader.report(Mistake::new(reader.place("within"), what).help("as in within = \"600s\""));
        }
        let collisions = match reader.int("collisions") {
            Some(n) if (0..=1_000_000).contains(&n) => n as u32,
            Some(n) => {
                let at = reader.place("collisions");
                reader.report(Mistake::new(
                    at,
                    format!("\"collisions\" is {n}, it must lie from 0 to 1000000"),
                ));
                0
            }
            None => 0,
        };
        let stages: Vec<Stage> = reader
            .tables("stage")
            .into_iter()
            .filter_map(|(table, at)| read_stage(table, at, world, mistakes))
            .collect();
        if reader.entry("stage").is_none() {
            reader.missing("stage", "a list such as [{ inside = \"corridor\" }]");
        }
        reader.finish(mistakes);
        (mistakes.len() == before).then_some(Goal { within, collisions, stages })
    }

    /// The regions through which a way must lead, in order.
    pub fn regions(&self) -> Vec<&str> {
        self.stages
            .iter()
            .filter_map(|stage| match &stage.condition {
                Condition::Inside(region) => Some(region.as_str()),
                _ => None,
            })
            .collect()
    }

    /// The start of a run.
    pub fn begin(&self) -> Progress {
        Progress {
            stage: 0,
            passed: [Time::ZERO; TOLD],
            began: None,
            held: Duration::ZERO,
            followed: Duration::ZERO,
            measure: None,
            state: State::Open,
        }
    }

    /// Looks at the world after a step. To be called after every step; gives whether the run is decided.
    pub fn watch(&self, progress: &mut Progress, world: &Simulator, robot: RobotId) -> bool {
        if progress.state != State::Open {
            return true;
        }
        let truth = world.truth(robot);
        if truth.collisions > self.collisions {
            progress.state = State::Collided(truth.collisions);
            return true;
        }
        // Several stages may be met at once, as when a robot starts inside the first region.
        while let Some(stage) = self.stages.get(progress.stage) {
            let began = *progress.began.get_or_insert((truth.turned, truth.pose.position()));
            if !progress.holds(&stage.condition, world, robot, began) {
                progress.held = Duration::ZERO;
                break;
            }
            if progress.held < stage.hold {
                progress.held = Duration(progress.held.0 + PHYSICS_STEP.0);
                break;
            }
            let mut passed = progress.passed;
            if let Some(place) = passed.get_mut(progress.stage) {
                *place = world.time();
            }
            *progress = Progress { stage: progress.stage + 1, passed, ..self.begin() };
        }
        if progress.stage >= self.stages.len() {
            progress.state = State::Met(world.time());
        } else if world.time().since_start() >= self.within {
            progress.state = State::TimeOver;
        }
        progress.state != State::Open
    }

    /// Says in a sentence where the run stands: which stage, and what is missing.
    pub fn why(&self, progress: &Progress) -> String {
        let stages = self.stages.len();
        match progress.state {
            State::Met(time) => return format!("all {stages} stages met after {time}"),
            State::Collided(n) => {
                return format!(
                    "stage {} of {stages}: the robot touched something ({n} collisions)",
                    progress.stage + 1
                );
            }
            State::Open | State::TimeOver => {}
        }
        let missing = self.stages.get(progress.stage).map_or(String::new(), |stage| progress.missing(stage));
        let end = if progress.state == State::TimeOver {
            format!(" when the {} were over", self.within)
        } else {
            String::new()
        };
        format!("stage {} of {stages}: {missing}{end}", progress.stage + 1)
    }
}

impl Progress {
    /// Whether the goal is met.
    pub fn met(&self) -> bool {
        matches!(self.state, State::Met(_))
    }

    /// Whether the goal is met or can no longer be.
    pub fn decided(&self) -> bool {
        self.state != State::Open
    }

    /// The number of stages that are behind.
    pub fn stages_done(&self) -> usize {
        self.stage
    }

    /// When the stages that are behind were met, as far as is told: the first twelve.
    pub fn passed(&self) -> &[Time] {
        &self.passed[..self.stage.min(TOLD)]
    }

    fn holds(
        &mut self,
        condition: &Condition,
        world: &Simulator,
        robot: RobotId,
        began: (f64, Point),
    ) -> bool {
        let truth = world.truth(robot);
        let at = truth.pose.position();
        match condition {
            Condition::Inside(region) => {
                world.plan().region(region).is_some_and(|region| region.contains(at))
            }
            Condition::Near(what, within) => {
                self.measure = world.locate(what).map(|(place, _)| place.distance(at));
                self.measure.is_some_and(|distance| distance < *within)
            }
            Condition::Moved(distance) => {
                let moved = at.distance(began.1);
                self.measure = Some(moved);
                moved >= *distance
            }
            Condition::Turned(angle) => {
                let turned = libm::fabs(truth.turned - began.0);
                self.measure = Some(turned);
                turned >= *angle
            }
            Condition::Follows(who, within, time) => {
                self.measure = world.locate(who).map(|(place, _)| place.distance(at));
                if world.walks(who) && self.measure.is_some_and(|distance| distance < *within) {
                    self.followed = Duration(self.followed.0 + PHYSICS_STEP.0);
                }
                self.followed >= *time
            }
        }
    }

    fn missing(&self, stage: &Stage) -> String {
        let hold = if stage.hold > Duration::ZERO { format!(" for {}", stage.hold) } else { String::new() };
        match (&stage.condition, self.measure) {
            (Condition::Inside(region), _) => format!("the robot was not inside \"{region}\"{hold}"),
            (Condition::Near(what, within), Some(distance)) => {
                format!("the robot was not within {within} m of \"{what}\"{hold} (now {distance:.2} m)")
            }
            (Condition::Near(what, within), None) => {
                format!("the robot was not within {within} m of \"{what}\"{hold} (it is not there)")
            }
            (Condition::Moved(distance), measure) => {
                let moved = measure.unwrap_or(0.0);
                format!("the robot had moved by {moved:.2} of {distance} m{hold}")
            }
            (Condition::Turned(angle), measure) => {
                let turned = measure.unwrap_or(0.0).to_degrees();
                format!("the robot had turned by {turned:.0} of {:.0} degrees{hold}", angle.to_degrees())
            }
            (Condition::Follows(who, within, time), _) => {
                let so_far = self.followed.seconds();
                format!("the robot had followed \"{who}\" within {within} m for {so_far:.1} s of {time}")
            }
        }
    }
}

fn read_stage(table: &Table, at: Span, world: &WorldPlan, mistakes: &mut Vec<Mistake>) -> Option<Stage> {
    let mut reader = TableReader::new(table, at, "the stage");
    let hold = not_negative(&mut reader, "hold").unwrap_or(Duration::ZERO);
    let inside = reader.text("inside");
    let near = reader.text("near");
    let follows = reader.text("follows");
    let turned = reader.entry("turned");
    let mut conditions = Vec::new();
    if let Some(word) = inside {
        let regions = world.regions.iter().map(|region| region.name.as_str());
        check(&mut reader, "inside", "region", word, regions.collect());
        conditions.push(Condition::Inside(word.to_owned()));
    }
    if near.is_some() || follows.is_some() {
        let distance = reader.float_in("distance", 0.0, 1000.0).unwrap_or(1.0);
        let people = world.people.iter();
        let names: Vec<&str> = people.clone().map(|person| person.name.as_str()).collect();
        if let Some(word) = follows {
            check(&mut reader, "follows", "person", word, names.clone());
            let time = not_negative(&mut reader, "time").unwrap_or(Duration::secs(5));
            conditions.push(Condition::Follows(word.to_owned(), distance, time));
        }
        if let Some(word) = near {
            let carried = people.filter_map(|person| person.carries.as_ref()).chain(&world.things);
            let landmarks = world.landmarks.iter().map(|landmark| landmark.name.as_str());
            let all =
                names.into_iter().chain(carried.map(|thing| thing.name.as_str())).chain(landmarks).collect();
            check(&mut reader, "near", "person or thing", word, all);
            conditions.push(Condition::Near(word.to_owned(), distance));
        }
    }
    let moves = reader.entry("moved").is_some();
    if moves && let Some(distance) = reader.float_in("moved", 0.0, 1000.0) {
        conditions.push(Condition::Moved(distance));
    }
    if let Some(entry) = turned {
        match read_angle(&entry.value) {
            Some(angle) => conditions.push(Condition::Turned(libm::fabs(angle))),
            None => reader.report(not_an_angle("turned", entry)),
        }
    }
    if conditions.len() > 1 || (conditions.is_empty() && turned.is_none() && !moves) {
        reader.report(Mistake::new(at, "a stage has one condition").help(
            "it can be: inside = \"region\", near = \"name\", moved = 0.5, turned = \"150deg\", follows = \"name\"",
        ));
    }
    reader.finish(mistakes);
    conditions.pop().map(|condition| Stage { condition, hold })
}

/// For how long something must be so.
fn not_negative(reader: &mut TableReader<'_>, key: &str) -> Option<Duration> {
    let time = reader.duration(key)?;
    if time < Duration::ZERO {
        let what = format!("\"{key}\" is {time}, a time cannot be negative");
        reader.report(Mistake::new(reader.place(key), what).help(format!("as in {key} = \"1s\"")));
    }
    Some(time)
}

fn check(reader: &mut TableReader<'_>, key: &str, kind: &str, word: &str, known: Vec<&str>) {
    if !known.contains(&word) {
        let at = reader.place(key);
        reader.report(Mistake::unknown(at, kind, word, known.into_iter().filter(|name| !name.is_empty())));
    }
}
