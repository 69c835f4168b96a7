//! Lets every robot of a recording believe, and judges what it believes.

use hardware::mrclam::{Member, Seen, Team};
use navigation::localisation::landmarks::{Association, Landmark};
use navigation::localisation::landmarks::{Filter, LandmarkLocalizer, Parameters, Sight, Sighting};
use types::geometry::wrap;
use types::{Duration, Point, Pose, Time};

use crate::error::Failure;
use crate::terminal::host_now;

/// Steps and sightings that a localizer remembers: two seconds and more of odometry at 50 Hz.
const MEMORY: usize = 128;
/// A figure has so many points of a way at most.
const POINTS: usize = 1500;

/// How the robots are to believe.
#[derive(Clone, Debug)]
pub(super) struct Setup {
    /// The same for all robots.
    pub(super) parameters: Parameters,
    /// So much later than their stamps the wheels do what their rates say. The rates of these robots are commands: the turn rate that was
    /// measured from outside follows them after 0.15 to 0.25 s, of all five robots alike.
    pub(super) delay: Duration,
    /// Robots do not look at each other.
    pub(super) alone: bool,
    /// Landmarks do not say which they are.
    pub(super) nameless: bool,
}

impl Default for Setup {
    fn default() -> Setup {
        Setup {
            parameters: Parameters::default(),
            delay: Duration::millis(200),
            alone: false,
            nameless: false,
        }
    }
}

/// How a robot fared.
#[derive(Clone, Debug, Default)]
pub(super) struct Track {
    /// Its name.
    pub(super) name: String,
    /// Root of the mean squared distance of what it believed to the truth (m), over all times of the truth.
    pub(super) rmse: f64,
    /// Of both halves of the times.
    pub(super) halves: [f64; 2],
    /// Likewise of its heading (rad).
    pub(super) heading: f64,
    /// Likewise of what its wheels alone told (m).
    pub(super) dead_reckoning: f64,
    /// How many seconds of the recording went by in a second of work for all robots.
    pub(super) times_real_time: f64,
    /// Sightings that were used, and those among them that only one of a thousand good ones would be.
    pub(super) sights: usize,
    pub(super) outliers: usize,
    /// The ways, thinned out for figures.
    pub(super) truth: Vec<Point>,
    pub(super) believed: Vec<Point>,
    pub(super) reckoned: Vec<Point>,
}

/// What comes, in the order in which it comes at one instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Odometry,
    Sight,
    Truth,
}

/// A robot that believes.
struct Believer<'a> {
    member: &'a Member,
    localizer: LandmarkLocalizer,
    wheels: Wheels,
    judge: Judge,
    sights: usize,
    outliers: usize,
}

/// Speeds of the wheels added up, as they are told.
struct Wheels {
    pose: Pose,
    at: Time,
    rates: [f64; 2],
}

impl Wheels {
    fn until(&mut self, at: Time) -> Pose {
        let dt = (at - self.at).seconds().max(0.0);
        self.pose = self.pose.advanced(self.rates[0], self.rates[1], dt);
        self.at = self.at.max(at);
        self.pose
    }
}

/// Sums of squares over the times of the truth.
#[derive(Default)]
struct Judge {
    squares: Vec<f64>,
    heading: f64,
    reckoned: f64,
    truth: Vec<Point>,
    believed: Vec<Point>,
    by_wheels: Vec<Point>,
}

impl Judge {
    fn take(&mut self, truth: Pose, believed: Pose, by_wheels: Pose, every: usize) {
        let apart = |pose: Pose| truth.position() - pose.position();
        if self.squares.len().is_multiple_of(every) {
            self.truth.push(truth.position());
            self.believed.push(believed.position());
            self.by_wheels.push(by_wheels.position());
        }
        self.squares.push(apart(believed).dot(apart(believed)));
        self.reckoned += apart(by_wheels).dot(apart(by_wheels));
        let turned = wrap(truth.heading - believed.heading);
        self.heading += turned * turned;
    }
}

/// Root of the mean of squares; nothing has none.
fn root_mean(squares: &[f64]) -> f64 {
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

/// Lets all robots go through their recordings together.
pub(super) fn drive(team: &Team, setup: &Setup) -> Result<Vec<Track>, Failure> {
    let begin = host_now();
    let mut robots = team.robots.iter().map(|member| start(member, setup)).collect::<Result<Vec<_>, _>>()?;
    let landmark = |mark: &hardware::mrclam::Mark| {
        let [dx, dy] = mark.deviation;
        Landmark { at: mark.at, spread: [[dx * dx, 0.0], [0.0, dy * dy]] }
    };
    let landmarks: Vec<Landmark> = team.landmarks.iter().map(landmark).collect();
    for (at, kind, which, number) in events(team) {
        match kind {
            Kind::Odometry => robots[which].hear(number, setup.delay),
            Kind::Sight => {
                let seen = robots[which].member.seen[number];
                see(team, &landmarks, &mut robots, which, &seen, setup);
            }
            Kind::Truth => robots[which].be_judged(at, number),
        }
    }
    let seconds = begin.elapsed().as_secs_f64();
    Ok(robots.into_iter().map(|robot| robot.track(seconds)).collect())
}

fn start<'a>(member: &'a Member, setup: &Setup) -> Result<Believer<'a>, Failure> {
    let nowhere = || Failure::new(format!("robot {} has no true pose to begin at", member.subject));
    let &(at, pose) = member.truth.first().ok_or_else(nowhere)?;
    // A millimetre and a milliradian: the truth is a measurement, too.
    let known = [[1e-6, 0.0, 0.0], [0.0, 1e-6, 0.0], [0.0, 0.0, 1e-6]];
    let filter = Filter::new(&setup.parameters, pose, known);
    Ok(Believer {
        member,
        localizer: LandmarkLocalizer::new(setup.parameters, filter, at, MEMORY),
        wheels: Wheels { pose, at, rates: [0.0; 2] },
        judge: Judge::default(),
        sights: 0,
        outliers: 0,
    })
}

/// All that comes, in the order of its stamps.
fn events(team: &Team) -> Vec<(Time, Kind, usize, usize)> {
    let mut events = Vec::new();
    for (which, robot) in team.robots.iter().enumerate() {
        let Some(&(start, _)) = robot.truth.first() else { continue };
        let mut add = |kind, times: &mut dyn Iterator<Item = Time>| {
            events
                .extend(times.enumerate().filter(|(_, at)| *at >= start).map(|(i, at)| (at, kind, which, i)));
        };
        add(Kind::Odometry, &mut robot.odometry.iter().map(|rates| rates.at));
        add(Kind::Sight, &mut robot.seen.iter().map(|seen| seen.at));
        add(Kind::Truth, &mut robot.truth.iter().map(|(at, _)| *at));
    }
    events.sort_unstable();
    events
}

impl Believer<'_> {
    fn hear(&mut self, number: usize, delay: Duration) {
        let rates = self.member.odometry[number];
        self.wheels.until(rates.at);
        self.wheels.rates = [rates.linear, rates.angular];
        // Rates come in the order of their stamps, so none is refused.
        let _ = self.localizer.drives(rates.at + delay, rates.linear, rates.angular);
    }

    /// A sight that is older than the memory is none.
    fn take(&mut self, at: Time, sight: Sight) {
        let Ok(effect) = self.localizer.sees(at, sight) else { return };
        self.sights += usize::from(effect.used);
        self.outliers += usize::from(effect.surprise > self.localizer.parameters().gate);
    }

    fn be_judged(&mut self, at: Time, number: usize) {
        let (_, truth) = self.member.truth[number];
        let by_wheels = self.wheels.until(at);
        let every = self.member.truth.len().div_ceil(POINTS);
        if let Some(believed) = self.localizer.pose_at(at) {
            self.judge.take(truth, believed, by_wheels, every);
        }
    }

    fn track(self, seconds: f64) -> Track {
        let count = self.judge.squares.len();
        let (first, second) = self.judge.squares.split_at(count / 2);
        let length = match (self.member.truth.first(), self.member.truth.last()) {
            (Some((first, _)), Some((last, _))) => (*last - *first).seconds(),
            _ => 0.0,
        };
        Track {
            name: format!("robot{}", self.member.subject),
            rmse: root_mean(&self.judge.squares),
            halves: [root_mean(first), root_mean(second)],
            heading: (self.judge.heading / count as f64).sqrt(),
            dead_reckoning: (self.judge.reckoned / count as f64).sqrt(),
            times_real_time: length / seconds,
            sights: self.sights,
            outliers: self.outliers,
            truth: self.judge.truth,
            believed: self.judge.believed,
            reckoned: self.judge.by_wheels,
        }
    }
}

/// What a robot saw: a landmark, or another robot, which learns of it as well.
fn see(
    team: &Team,
    landmarks: &[Landmark],
    robots: &mut [Believer<'_>],
    which: usize,
    seen: &Seen,
    setup: &Setup,
) {
    let sighting = Sighting { range: seen.range, bearing: seen.bearing };
    let Some(subject) = seen.subject else { return };
    if let Some(place) = team.landmarks.iter().position(|mark| mark.subject == subject) {
        if setup.nameless {
            let found = robots[which].localizer.sees_one_of(seen.at, sighting, landmarks);
            robots[which].sights += usize::from(matches!(found, Ok(Association::One(_))));
        } else {
            robots[which].take(seen.at, landmarks[place].seen(sighting));
        }
        return;
    }
    let Some(other) = team.robot(subject).filter(|other| *other != which && !setup.alone) else { return };
    // Both tell what they believed before: else each would hear its own belief back.
    let told = [which, other].map(|robot| robots[robot].localizer.at(seen.at).map(|filter| filter.view()));
    if let [Some(mine), Some(theirs)] = told {
        robots[which].take(seen.at, Sight::OfRobot(sighting, theirs));
        robots[other].take(seen.at, Sight::FromRobot(sighting, mine));
    }
}
