//! EmergencyStop: ramps the robot down when it comes closer to something than it can still stop before, and lets it go when the way is clear.
//!
//! ```text
//!  scan, ranges ──▶ way ahead along the arc ─┐
//!  odometry, wish ─▶ where it drives ────────┴▶ critical range? ──▶ bound ──▶ reflex of the drive
//!  bumper, latch ──▶ told as a hard stop                            (the latch itself is set by the driver)
//! ```
//!
//! Where people walk about it is told how fast, and slows in time so that whoever runs into the robot finds it standing: [`motion::passive`].
//!
//! It only slows and stops: its bound goes past the coordinator, to the drive, whoever drives in whatever mode. The law is
//! [`motion::stopping`].

use motion::passive;
use motion::stopping::{Parameters, Stopping, Verdict, way_to};
use runtime::{Agent, Fault, Input, Output, Step};
use types::geometry::TAU;
use types::messages::{Bumper, EmergencyStop, LaserScan, Latch, Odometry, Ranges, StopKind, Twist};
use types::params::Params;
use types::{Duration, Point, Pose, Time};

use crate::shared::{Dated, echoes};
use crate::trust::Again;

/// The body, and how it brakes.
#[derive(Clone, Debug, Params)]
pub struct StopParams {
    /// Radius of the body (m): of one that is not round, that of the circle around it. 0.34 is that of the reactive layer's robot.
    #[param(default = 0.34, min = 0.01, max = 5.0)]
    pub radius: f64,
    /// Room kept beside the body (m).
    #[param(default = 0.02, min = 0.0, max = 1.0)]
    pub side_margin: f64,
    /// From seeing something to the answer of the wheels (s). 0.2 is a scan at 10 Hz, a step of the drive and the lag of the motors.
    #[param(default = 0.2, min = 0.0, max = 5.0)]
    pub reaction: f64,
    /// How hard the ramp brakes (m/s²); no harder than the drive can. 1 does not tip a tall body.
    #[param(default = 1.0, min = 0.05, max = 20.0)]
    pub deceleration: f64,
    /// What is left of the way after stopping (m).
    #[param(default = 0.1, min = 0.0, max = 5.0)]
    pub margin: f64,
    /// How much more way than critical it must be before it lets go (m).
    #[param(default = 0.1, min = 0.0, max = 5.0)]
    pub release: f64,
    /// For how long that must be so (s): who moves in front of it shall not make it stutter.
    #[param(default = 0.3, min = 0.0, max = 60.0)]
    pub calm: f64,
    /// From standing it lets go when there is as much way as this speed needs (m/s).
    #[param(default = 0.1, min = 0.0, max = 5.0)]
    pub least: f64,
    /// How fast people may come (m/s): it drives into nobody, whoever walks where. 0 where nobody walks; 1.5 is a brisk walk.
    #[param(default = 0.0, min = 0.0, max = 10.0)]
    pub people: f64,
    /// What is then left between the two (m). 5 cm are the noise of a laser and what a loose coat is wider than a body.
    #[param(default = 0.05, min = 0.0, max = 5.0)]
    pub people_margin: f64,
    /// Readings older than this are none, and who does not see stops (time). 350 ms are two missed scans at 10 Hz.
    #[param(default = Duration::millis(350), min = 0.01, max = 60.0)]
    pub stale: Duration,
}

impl StopParams {
    fn law(&self) -> Parameters {
        Parameters {
            radius: self.radius + self.side_margin,
            reaction: self.reaction,
            deceleration: self.deceleration,
            margin: self.margin,
            release: self.release,
            calm: self.calm,
            least: self.least,
        }
    }

    /// Where people walk about.
    fn passive(&self) -> Option<passive::Parameters> {
        (self.people > 0.0).then_some(passive::Parameters {
            radius: self.radius,
            reaction: self.reaction,
            deceleration: self.deceleration,
            margin: self.people_margin,
            people: self.people,
        })
    }
}

/// Bounds the motion when something comes nearer than the critical range, by a ramp, and lets go by itself.
#[derive(Agent)]
#[agent(kind = "emergency-stop")]
pub struct EmergencyStopAction {
    /// What is ahead, from a laser.
    #[robot("scan")]
    scan: Input<LaserScan>,
    /// What is around, from sonars or whatever measures ranges.
    ranges: Input<Ranges>,
    /// How the robot moves.
    odometry: Input<Odometry>,
    /// How it is about to move: from standing that says which way must be clear.
    wish: Input<Twist>,
    /// Whether it touches something.
    #[robot("bumper")]
    bumper: Input<Bumper>,
    /// Whether the robot is latched.
    #[robot("latch")]
    latch: Input<Latch>,
    /// The most that may be driven, for the drive's reflex, in each step: a drive that needs it stands when nobody tells.
    bound: Output<Twist>,
    /// What it makes of the way ahead.
    #[port(history = 64)]
    stop: Output<EmergencyStop>,
    params: StopParams,
    guard: Guard,
}

impl Agent for EmergencyStopAction {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        let now = step.now;
        if let Some(scan) = self.scan.newest() {
            let stamp = scan.header().stamp;
            let then = self.odometry.at(stamp).map(|found| found.value().pose);
            self.guard.again.scan(&scan, scan.row(), stamp, then);
            self.guard.look(&scan, scan.row(), stamp);
        }
        if let Some(ranges) = self.ranges.newest() {
            self.guard.hear(&ranges, ranges.header().stamp);
        }
        if let Some(odometry) = self.odometry.latest() {
            self.guard.motion = odometry.twist;
        }
        if let Some(wish) = self.wish.latest() {
            self.guard.wish = wish;
        }
        if let Some(bumper) = self.bumper.latest() {
            self.guard.touched = bumper.pressed();
        }
        if let Some(latch) = self.latch.latest() {
            self.guard.latched = latch.is_set;
        }
        let sees = [self.scan.is_wired(), self.ranges.is_wired()];
        let told = self.guard.judge(&self.params, sees, now);
        if told.kind == StopKind::Soft && !self.guard.told {
            runtime::note!(
                "critical range: {} m ahead at {} m/s, {} m are needed",
                told.ahead,
                told.speed,
                told.critical
            );
        }
        self.guard.told = told.kind == StopKind::Soft;
        // It may turn away on the spot.
        self.bound.send(Twist::new(told.allowed.min(ANY), ANY));
        self.stop.send(told);
        Ok(())
    }
}

/// More than anything drives and turns (m/s, rad/s).
const ANY: f64 = 1e3;
/// The most points that are looked at.
const POINTS: usize = 4096 + 64;
/// Slower than this it stands, and the wish says where to (m/s).
const STANDING: f64 = 0.02;
/// So little of a whole turn may lie between the last beam and the first (rad): a beam of a coarse laser.
const SLIT: f64 = 0.1;

#[derive(Debug)]
struct Guard {
    /// What a scan showed, from the robot's middle, and when. Its memory is taken when the agent is made.
    seen: Vec<Point>,
    seen_at: Option<Time>,
    /// Whether the scan went all around.
    sees_behind: bool,
    /// Whether the laser shows the same scan again and again.
    again: Again,
    heard: Option<Dated<Ranges>>,
    motion: Twist,
    wish: Twist,
    touched: bool,
    latched: bool,
    told: bool,
    forward: Stopping,
    backward: Stopping,
    last: Option<Time>,
}

impl Default for Guard {
    fn default() -> Guard {
        Guard {
            seen: Vec::with_capacity(POINTS),
            seen_at: None,
            sees_behind: false,
            again: Again::default(),
            heard: None,
            motion: Twist::ZERO,
            wish: Twist::ZERO,
            touched: false,
            latched: false,
            told: false,
            forward: Stopping::new(Parameters::default()),
            backward: Stopping::new(Parameters::default()),
            last: None,
        }
    }
}

impl Guard {
    fn look(&mut self, scan: &LaserScan, row: &[f32], stamp: Time) {
        let mount = Pose::new(scan.mount_x.into(), scan.mount_y.into(), scan.mount_heading.into());
        self.seen.clear();
        self.seen_at = Some(stamp);
        let field = row.len() as f64 * f64::from(scan.angle_step).abs();
        self.sees_behind = field > TAU - SLIT;
        for (i, range) in row.iter().enumerate().take(POINTS) {
            // A range that is no number is a beam that did not come back; the longest is a way that is free.
            if *range > scan.range_min && *range < scan.range_max {
                let bearing = f64::from(scan.angle_min) + i as f64 * f64::from(scan.angle_step);
                self.seen.push(mount.transform(Point::polar((*range).into(), bearing)));
            }
        }
    }

    fn hear(&mut self, ranges: &Ranges, stamp: Time) {
        self.heard = Some(Dated { value: *ranges, stamp });
    }

    /// The way ahead while moving so, from the robot's middle; nothing where one of those who are wired has not seen lately.
    fn ahead(&self, params: &StopParams, twist: Twist, [scans, hears]: [bool; 2], now: Time) -> Option<f64> {
        let is_fresh = |stamp: Time| now - stamp <= params.stale;
        let radius = params.radius + params.side_margin;
        // A laser that shows the same from everywhere shows nothing.
        let is_seeing = self.seen_at.is_some_and(is_fresh) && !self.again.is_frozen();
        if scans && !is_seeing || !(scans || hears) {
            return None;
        }
        let way = |x: f64, y: f64| way_to(radius, twist, x, y);
        let seen = if scans { &self.seen[..] } else { &[] };
        let mut ahead = seen.iter().fold(f64::INFINITY, |least, point| least.min(way(point.x, point.y)));
        if hears {
            let ranges = Dated::fresh(&self.heard, now, params.stale)?;
            for (bearing, range) in echoes(&ranges) {
                let point = Point::polar(range, bearing);
                ahead = ahead.min(way(point.x, point.y));
            }
        }
        Some(ahead)
    }

    /// The highest speed at which it stands before anybody who is seen, or may come where nobody looks, is there.
    fn among_people(&self, params: &StopParams, twist: Twist, [scans, hears]: [bool; 2]) -> f64 {
        let Some(law) = params.passive() else { return f64::INFINITY };
        if twist.linear < 0.0 && !hears && !self.sees_behind {
            return 0.0;
        }
        let speed = |least: f64, point: Point| least.min(passive::speed(&law, twist, point.x, point.y));
        let seen = if scans { &self.seen[..] } else { &[] };
        let least = seen.iter().fold(f64::INFINITY, |least, point| speed(least, *point));
        let heard = self.heard.as_ref().filter(|_| hears);
        heard
            .iter()
            .flat_map(|heard| echoes(&heard.value))
            .fold(least, |least, (bearing, range)| speed(least, Point::polar(range, bearing)))
    }

    fn judge(&mut self, params: &StopParams, sees: [bool; 2], now: Time) -> EmergencyStop {
        let dt = self.last.replace(now).map_or(0.0, |last| (now - last).seconds());
        let stands = self.motion.linear.abs() < STANDING;
        let turn = if stands { self.wish.angular } else { self.motion.angular };
        let is_back = if stands { self.wish.linear < 0.0 } else { self.motion.linear < 0.0 };
        let step = |is_way: bool, sign: f64, stopping: &mut Stopping| {
            stopping.set_parameters(params.law());
            let speed = if is_way { self.motion.linear.abs() } else { 0.0 };
            // From standing the way that counts is that of setting off: who turns more than drives meets less.
            let off = if stands && is_way { self.wish.linear.abs() } else { speed };
            let along = sign * off.max(STANDING);
            let ahead = self.ahead(params, Twist::new(along, turn), sees, now);
            (stopping.step(ahead, Twist::new(sign * speed, turn), dt), ahead.is_none())
        };
        let (mut forward, mut backward) = (self.forward, self.backward);
        let ahead = step(!is_back, 1.0, &mut forward);
        let behind = step(is_back, -1.0, &mut backward);
        (self.forward, self.backward) = (forward, backward);
        let (Verdict { stopping, allowed, ahead, critical }, blind) = if is_back { behind } else { ahead };
        let people =
            self.among_people(params, Twist::new(if is_back { -STANDING } else { STANDING }, turn), sees);
        let (stopping, allowed) = (stopping || people < self.motion.linear.abs(), allowed.min(people));
        let kind = match (self.touched || self.latched, stopping) {
            (true, _) => StopKind::Hard,
            (false, true) => StopKind::Soft,
            (false, false) => StopKind::None,
        };
        EmergencyStop {
            kind,
            blind,
            latched: self.latched,
            ahead,
            critical,
            allowed,
            speed: self.motion.linear,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LASER: [bool; 2] = [true, false];

    fn at(millis: i64) -> Time {
        Time::ZERO + Duration::millis(millis)
    }

    /// A wall `distance` ahead of the laser, which sits 0.2 m ahead of the middle.
    fn scan(distance: f32) -> (LaserScan, Vec<f32>) {
        let head = LaserScan {
            angle_min: -0.5,
            angle_step: 0.1,
            range_min: 0.05,
            range_max: 8.0,
            mount_x: 0.2,
            ..LaserScan::default()
        };
        let row = (0..11).map(|i| distance / (-0.5f32 + 0.1 * i as f32).cos()).collect();
        (head, row)
    }

    fn looking(distance: f32, stamp: Time) -> Guard {
        let mut guard = Guard::default();
        let (head, row) = scan(distance);
        guard.look(&head, &row, stamp);
        guard
    }

    #[test]
    fn a_wall_within_the_critical_range_ramps_it_down_and_a_farther_one_does_not() {
        let params = StopParams::default();
        // At 0.3 m/s: 0.06 + 0.045 + 0.1 = 0.205 m from the rim at 0.36 m, so 0.365 m from the laser.
        for (distance, expected) in [(0.37, StopKind::None), (0.36, StopKind::Soft)] {
            let mut guard = looking(distance, at(0));
            guard.motion = Twist::new(0.3, 0.0);
            let told = guard.judge(&params, LASER, at(0));
            assert_eq!(told.kind, expected, "{distance}: {told:?}");
            assert!((told.critical - 0.205).abs() < 1e-9 && !told.blind);
            assert!((told.ahead - (f64::from(distance) + 0.2 - 0.36)).abs() < 1e-3, "{told:?}");
        }
    }

    #[test]
    fn it_may_back_off_from_what_it_stopped_for() {
        let params = StopParams::default();
        let mut guard = looking(0.2, at(0));
        assert_eq!(guard.judge(&params, LASER, at(0)).kind, StopKind::Soft);
        guard.wish = Twist::new(-0.2, 0.0);
        let told = guard.judge(&params, LASER, at(20));
        assert_eq!((told.kind, told.allowed), (StopKind::None, f64::INFINITY));
        guard.wish = Twist::new(0.2, 0.0);
        assert_eq!(guard.judge(&params, LASER, at(40)).allowed, 0.0, "but not go on");
    }

    #[test]
    fn a_stale_sensor_is_an_obstacle_and_so_is_none_at_all() {
        let params = StopParams::default();
        let mut guard = looking(5.0, at(0));
        guard.motion = Twist::new(0.3, 0.0);
        assert_eq!(guard.judge(&params, LASER, at(350)).kind, StopKind::None);
        let told = guard.judge(&params, LASER, at(351));
        assert_eq!((told.kind, told.blind, told.ahead), (StopKind::Soft, true, 0.0));
        let both = looking(5.0, at(0)).judge(&params, [true, true], at(0));
        assert!(both.blind, "the sonars that are wired were not heard");
        assert!(Guard::default().judge(&params, [false, false], at(0)).blind);
    }

    #[test]
    fn a_laser_that_shows_the_same_from_elsewhere_is_an_obstacle_until_it_shows_something_else() {
        let params = StopParams::default();
        let mut guard = Guard::default();
        let mut kind = |distance: f32, millis: i64, x: f64| {
            let (head, row) = scan(distance);
            guard.again.scan(&head, &row, at(millis), Some(Pose::new(x, 0.0, 0.0)));
            guard.look(&head, &row, at(millis));
            let told = guard.judge(&params, LASER, at(millis));
            (told.kind, told.blind)
        };
        assert_eq!(kind(5.0, 0, 0.0), (StopKind::None, false));
        assert_eq!(kind(5.0, 100, 0.03), (StopKind::None, false));
        assert_eq!(kind(5.0, 200, 0.07), (StopKind::Soft, true));
        let well =
            [300, 400, 500, 600, 700, 800].map(|millis| kind(4.9 + millis as f32 * 1e-4, millis, 0.07));
        assert_eq!(well[5], (StopKind::None, false), "{well:?}");
    }

    #[test]
    fn where_people_walk_it_slows_for_what_is_beside_it_and_drives_back_only_where_it_looks() {
        let params = StopParams { people: 1.5, ..StopParams::default() };
        // One beam to the left, 1.14 m from the middle: 0.8 = 1.5 (0.2 + 0.3) + 0.05 from the rim.
        let beam = |field: f32| {
            let mut guard = Guard::default();
            let head = LaserScan {
                angle_min: -field / 2.0,
                angle_step: field / 360.0,
                range_max: 8.0,
                ..LaserScan::default()
            };
            let row: Vec<f32> = (0..360)
                .map(|i| if i == 180 + (90.0 * 360.0 / field.to_degrees()) as i32 { 1.14 } else { 8.0 })
                .collect();
            guard.look(&head, &row, at(0));
            guard
        };
        let all_around = TAU as f32;
        let mut guard = beam(all_around);
        guard.motion = Twist::new(0.29, 0.0);
        let told = guard.judge(&params, LASER, at(0));
        assert!(told.kind == StopKind::None && (told.allowed - 0.3).abs() < 2e-3, "{told:?}");
        guard.motion = Twist::new(0.31, 0.0);
        assert_eq!(guard.judge(&params, LASER, at(20)).kind, StopKind::Soft);
        let back = |mut guard: Guard| {
            guard.motion = Twist::new(-0.1, 0.0);
            guard.judge(&params, LASER, at(40)).allowed
        };
        assert!(back(beam(all_around)) > 0.2);
        assert_eq!(back(beam(270f32.to_radians())), 0.0, "somebody may be behind it");
    }

    #[test]
    fn a_touch_is_told_as_a_hard_stop() {
        let mut guard = looking(5.0, at(0));
        guard.touched = true;
        let told = guard.judge(&StopParams::default(), LASER, at(0));
        assert_eq!(
            (told.kind, told.allowed),
            (StopKind::Hard, f64::INFINITY),
            "the latch holds it, and it may back off after"
        );
    }
}
