//! Roaming through an unknown place: along the walls while that leads to new ground, else to the nearest ground that is new.
//!
//! ```text
//!             something in the way            nothing new for long, or no way on
//!  ┌────────┐ ─────────────────▶ ┌───────────┐ ──────────────────────────────▶ ┌─────────┐
//!  │ Search │                    │ Following │                                 │ Leaving │
//!  └────────┘ ◀───────────────── └───────────┘                                 └─────────┘
//!     │ ▲        nothing near                                                     ▲   │
//!     │ └─────────────────────────────────────────────────────────────────────────┼───┘
//!     │                           it has come to new ground                       │
//!     └───────────────────────────────────────────────────────────────────────────┘
//!             something in the way, and near it wide ground that is new
//! ```
//!
//! The hand rule alone circles islands, and of a loop of rooms it may never see the middle. What is known of the [`Ground`] tells when
//! walking on along the wall is of no more use, and where there is more to see. Without the hand rule, the other way round, the
//! robot would stop at every place to look for the next.

use crate::ground::{Ground, Room, Way};
use libm::{fabs, fmax, fmin};
use motion::boundary::{Compass, Fan, apart, bearing, direction};
use motion::kinematics::Twist;
use motion::wall::Side;
use types::geometry::wrap;
use types::{Point, Pose};

/// How to roam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// On which side the wall is.
    pub side: Side,
    /// Distance to keep from the robot's middle to everything where there is room (m).
    pub keep: f64,
    /// Distance with which it still goes through (m).
    pub least: f64,
    /// Way that must be free ahead (m). A niche that is not deeper is wall.
    pub look: f64,
    /// Speed with all free (m/s).
    pub speed: f64,
    /// Speed at which it still creeps along while it turns (m/s).
    pub creep: f64,
    /// How fast the wished speed grows while all is free (m/s²).
    pub growth: f64,
    /// Highest turn rate (rad/s).
    pub turn_max: f64,
    /// Turn rate for an error of heading of 1 rad (1/s).
    pub turn_gain: f64,
    /// Ground that it has come as near to is not new any more (m).
    pub near: f64,
    /// It leaves what it follows when it has come to no new ground for this long (s).
    pub restless: f64,
    /// It gives up a place that it does not get to when it has not got away from one spot for this long (s), or has come no nearer for this
    /// long and the time that the way should take.
    pub patience: f64,
}

impl Parameters {
    /// For a round robot of `radius` (m).
    ///
    /// `keep` is two radii less a little: at a door of four radii that is the middle. The least room is 4 cm beside the body: twice the error of a
    /// sonar nearby. It looks three radii ahead, which is what a turn in place needs and the step aside after it. 0.4 m/s and a gain of 2
    /// need 0.2 m of way for an error to fall to 1/e, less than `keep`. It creeps at an eighth of the speed, so the view changes. Two seconds to
    /// full speed let a false start be noticed. A place four radii away is seen well. Four seconds are a metre and a half of way, fifteen are enough to turn around twice.
    pub fn new(radius: f64) -> Parameters {
        Parameters {
            side: Side::Left,
            keep: 1.9 * radius,
            least: radius + 0.04,
            look: 3.0 * radius,
            speed: 0.4,
            creep: 0.05,
            growth: 0.3,
            turn_max: 1.0,
            turn_gain: 2.0,
            near: 4.0 * radius,
            restless: 4.0,
            patience: 15.0,
        }
    }
}

/// On which sides something may be nearer than the points tell, because the sensors tell nothing of what is so near.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Beside {
    /// To the left, up to straight to the side.
    pub left: bool,
    /// To the right.
    pub right: bool,
}

impl Beside {
    /// The turn (rad) that does not lead nearer to what is beside it: a little away from it, except for one that is made in place. Between two
    /// such things it goes as wanted.
    fn shy(self, error: f64) -> f64 {
        match (self.left, self.right) {
            (true, false) if error < IN_PLACE => fmin(error, -SHY),
            (false, true) if error > -IN_PLACE => fmax(error, SHY),
            _ => error,
        }
    }
}

/// What the roamer is about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Mode {
    /// Straight on until something is in the way.
    #[default]
    Search,
    /// Along a wall.
    Following,
    /// To new ground.
    Leaving,
}

/// A roomier way is taken in place of the one along the wall when it leads nearly the same way (rad): 35° is how far the two differ along a
/// straight wall. What differs more is a gap.
const SAME_WAY: f64 = 0.6;
/// A touched point is let go when it is this far behind the side (rad): 115°.
const BEHIND: f64 = 2.0;
/// A touched point is still there when something is within this of it (m): three cells of a map of 5 cm.
const STILL_THERE: f64 = 0.15;
/// The part of the way ahead that is enough where there is no other.
const LAST: f64 = 0.35;
/// A turn by this and more is made in place (rad).
const IN_PLACE: f64 = 0.8;
/// How far it turns away from what is as near as can be told (rad): a hand's width in a metre.
const SHY: f64 = 0.1;
/// The part of the speed with which it begins, while it has heard nothing but from one place.
const YOUNG: f64 = 0.25;
/// After this way it has heard what is around from several places (m).
const SEEN_AROUND: f64 = 1.0;
/// As long as it moves no farther than this it has not got away (m).
const SPOT: f64 = 0.5;
/// Less new ground than this is none (m²): an edge of what was seen before.
const SOME: f64 = 0.05;
/// How long a way is good for before it is looked for anew, with what was seen on it (s).
const WAY_LASTS: f64 = 2.0;
/// A way that costs so much less than before leads on (m).
const GAIN: f64 = 0.2;
/// A way that is lost from sight is gone on with for so long: it may be an echo that seems to close a door (s).
const WAY_HOLDS: f64 = 6.0;
/// Where its way is blocked it looks for so long before it goes around: from nearby an echo of something else is told (s).
const LOOKS: f64 = 2.0;
/// A metre of way takes no longer than this, in a narrow place (s).
const SLOW: f64 = 5.0;
/// After this it forgets which places it gave up (s).
const TRIES_AGAIN: f64 = 90.0;
/// Wide new ground within this way is gone to, rather than along what is in the way (m).
const AT_HAND: f64 = 3.0;
/// How far ahead on its way it steers to, at most and at least (m).
const CARROT: f64 = 1.0;
const STRIDE: f64 = 0.2;
/// How far off the way it may go around what is in it (rad): 60°.
const ASIDE: f64 = 1.05;

/// What is in the way; it is gone through several times.
trait Points: Iterator<Item = Point> + Clone {}

impl<P: Iterator<Item = Point> + Clone> Points for P {}

/// The free ways with much room, with some and with the least.
type Fans<'a, P> = [Fan<'a, P>; 3];

/// Roams. One `step` a reading, or more often.
#[derive(Clone, Copy, Debug)]
pub struct Roamer {
    parameters: Parameters,
    compass: Compass,
    mode: Mode,
    /// Where it is, mirrored so that the wall is on the left.
    pose: Pose,
    speed: f64,
    anchor: Point,
    /// Where it goes while it searches (rad).
    heading: f64,
    /// Where it goes while it leaves, not mirrored, and how old that is (s).
    way: Option<Way>,
    way_age: f64,
    /// The least that this way has cost, and how long it costs no less (s).
    least_cost: f64,
    gain_age: f64,
    /// For how long there is no way to where it goes, for how long it is blocked, and how long ago it gave up a place (s).
    lost_age: f64,
    blocked_age: f64,
    given_up_age: f64,
    /// How far it has gone (m).
    travelled: f64,
    spot: Point,
    spot_since: f64,
    /// How long it has come to nothing new (s).
    stale: f64,
    left: usize,
}

impl Roamer {
    /// Begins with a search, straight on from `pose`.
    pub fn new(parameters: Parameters, pose: Pose) -> Roamer {
        let pose = mirrored(pose, parameters.side);
        Roamer {
            parameters,
            compass: Compass::default(),
            mode: Mode::Search,
            pose,
            speed: parameters.creep,
            anchor: Point::default(),
            heading: pose.heading,
            way: None,
            way_age: 0.0,
            least_cost: 0.0,
            gain_age: 0.0,
            lost_age: 0.0,
            blocked_age: 0.0,
            given_up_age: 0.0,
            travelled: 0.0,
            spot: pose.position(),
            spot_since: 0.0,
            stale: 0.0,
            left: 0,
        }
    }

    /// What it is about.
    pub const fn mode(&self) -> Mode {
        self.mode
    }

    /// How often it has left what it followed.
    pub const fn times_left(&self) -> usize {
        self.left
    }

    /// Changes how to roam. A change of side begins anew.
    pub fn set_parameters(&mut self, parameters: Parameters) {
        if parameters.side != self.parameters.side {
            *self = Roamer::new(parameters, self.real_pose());
        }
        self.parameters = parameters;
    }

    /// The motion among `points` (m, in the frame of the robot), at `pose` on the `ground`, `dt` (s) after the step before.
    pub fn step(
        &mut self,
        points: impl Iterator<Item = Point> + Clone,
        beside: Beside,
        pose: Pose,
        ground: &mut Ground,
        dt: f64,
    ) -> Twist {
        let sign = self.parameters.side.sign();
        let points = points.map(|p| Point::new(p.x, p.y * sign));
        self.remember(pose, ground, fmax(dt, 0.0));
        // A copy: the ways are looked at while the roamer changes.
        let compass = self.compass;
        let fans = self.fans(&compass, points.clone());
        let wanted = match self.mode {
            Mode::Search => self.search(&fans, ground),
            Mode::Following => self.follow(points, &fans, ground),
            Mode::Leaving => self.leave(&fans, ground),
        };
        let beside = if sign > 0.0 { beside } else { Beside { left: beside.right, right: beside.left } };
        let twist = self.drive(wanted, &fans, beside, dt);
        Twist::new(twist.linear, twist.angular * sign)
    }

    fn real_pose(&self) -> Pose {
        mirrored(self.pose, self.parameters.side)
    }

    fn remember(&mut self, pose: Pose, ground: &mut Ground, dt: f64) {
        let before = self.pose.position();
        self.pose = mirrored(pose, self.parameters.side);
        self.travelled += before.distance(self.pose.position());
        let new = ground.tread(pose.position(), self.parameters.near);
        self.stale = if new >= SOME { 0.0 } else { self.stale + dt };
        self.way_age += dt;
        self.gain_age += dt;
        self.blocked_age += dt;
        self.given_up_age += dt;
        if self.given_up_age > TRIES_AGAIN {
            self.given_up_age = 0.0;
            ground.forget_given_up();
        }
        let here = self.pose.position();
        if here.distance(self.spot) > SPOT {
            (self.spot, self.spot_since) = (here, 0.0);
        }
        self.spot_since += dt;
    }

    /// Those among `points`.
    fn fans<'a, P: Points>(&self, compass: &'a Compass, points: P) -> Fans<'a, P> {
        let Parameters { keep, least, .. } = self.parameters;
        [keep, (keep + least) / 2.0, least].map(|room| Fan::new(compass, points.clone(), room))
    }

    /// Straight on, or along what is in the way.
    fn search(&mut self, fans: &Fans<'_, impl Points>, ground: &mut Ground) -> Option<usize> {
        if self.stale > self.parameters.restless && self.set_out(ground) {
            return self.leave(fans, ground);
        }
        let ahead = direction(wrap(self.heading - self.pose.heading));
        let look = self.parameters.look;
        let free = fans.iter().find_map(|fan| fan.nearest_free(ahead, look, SAME_WAY));
        if free.is_none() {
            let wide = ground.way_to_wide(self.real_pose().position(), self.room());
            if let Some(way) = wide.filter(|way| way.cost() <= AT_HAND) {
                self.go(way);
                return self.leave(fans, ground);
            }
            if let Some(stop) = fans[2].stop(ahead) {
                self.anchor = self.pose.transform(stop);
            }
            self.mode = Mode::Following;
            return fans[2].sweep(ahead, look).map(|found| found.direction);
        }
        free
    }

    fn follow<P: Points>(&mut self, points: P, fans: &Fans<'_, P>, ground: &mut Ground) -> Option<usize> {
        let Parameters { look, restless, patience, .. } = self.parameters;
        if (self.stale > restless || self.spot_since > patience) && self.set_out(ground) {
            return self.leave(fans, ground);
        }
        if !self.find_anchor(points) {
            self.search_ahead();
            return Some(0);
        }
        let start = direction(self.pose.inverse().transform(self.anchor).bearing());
        let found = fans[2].sweep(start, look).or_else(|| fans[2].sweep(start, LAST * look))?;
        let behind = bearing(start) > BEHIND || bearing(start) < -BEHIND;
        if behind && let Some(touched) = fans[2].touched(found) {
            self.anchor = self.pose.transform(touched);
        }
        let roomy = fans[..2].iter().find_map(|fan| {
            let way = fan.sweep(start, look)?.direction;
            (apart(way, found.direction) <= SAME_WAY).then_some(way)
        });
        Some(roomy.unwrap_or(found.direction))
    }

    /// Whether there is something to follow: what is touched, or else what is nearest on the wall's side.
    fn find_anchor(&mut self, points: impl Points) -> bool {
        let local = self.pose.inverse().transform(self.anchor);
        if points.clone().any(|p| (p - local).is_within(STILL_THERE)) {
            return true;
        }
        let reach = self.parameters.look + self.parameters.keep;
        let beside = points.filter(|p| p.y > 0.0 && p.norm() <= reach);
        let nearest = beside.fold(None, |best: Option<Point>, p| match best {
            Some(known) if known.norm() <= p.norm() => best,
            _ => Some(p),
        });
        if let Some(point) = nearest {
            self.anchor = self.pose.transform(point);
        }
        nearest.is_some()
    }

    fn search_ahead(&mut self) {
        self.mode = Mode::Search;
        self.heading = self.pose.heading;
    }

    /// Sets out for new ground, if there is any. Where there seems to be none, what stands about is looked at anew, and after that the floor.
    fn set_out(&mut self, ground: &mut Ground) -> bool {
        self.stale = 0.0;
        self.stay();
        let goal = self.goal(ground);
        let way = ground.way_to_new(self.real_pose().position(), self.room(), goal);
        if let Some(way) = way {
            self.go(way);
        } else if ground.has_taken() {
            ground.forget_taken();
        } else {
            ground.forget_trodden();
        }
        way.is_some()
    }

    /// Sets out on a way.
    fn go(&mut self, way: Way) {
        self.stale = 0.0;
        self.stay();
        self.take(way);
        self.mode = Mode::Leaving;
        (self.gain_age, self.blocked_age) = (0.0, 0.0);
        self.left += 1;
    }

    /// Looks from here on how far it gets.
    fn stay(&mut self) {
        (self.spot, self.spot_since) = (self.pose.position(), 0.0);
    }

    const fn room(&self) -> Room {
        Room { least: self.parameters.least, keep: self.parameters.keep }
    }

    /// Where it goes to, as long as that is new.
    fn goal(&self, ground: &Ground) -> Option<Point> {
        self.way.map(|way| way.goal()).filter(|goal| !ground.is_known(*goal))
    }

    fn take(&mut self, way: Way) {
        if self.way.map(|before| before.goal()) != Some(way.goal()) {
            self.least_cost = way.cost();
        } else if way.cost() < self.least_cost - GAIN {
            (self.least_cost, self.gain_age) = (way.cost(), 0.0);
        }
        (self.way, self.way_age, self.lost_age) = (Some(way), 0.0, 0.0);
    }

    /// Looks anew for the way to where it goes, and, where there is none for some time, to another place.
    fn find_way(&mut self, ground: &mut Ground) -> bool {
        let goal = self.goal(ground);
        let way = ground.way_to_new(self.real_pose().position(), self.room(), goal);
        if goal.is_some() && way.map(|way| way.goal()) != goal {
            self.lost_age += self.way_age;
            if self.lost_age < WAY_HOLDS {
                self.way_age = 0.0;
                return true;
            }
        }
        match way {
            Some(way) => self.take(way),
            None => (self.way, self.lost_age) = (None, 0.0),
        }
        way.is_some()
    }

    /// Along the way to new ground, around what is in it.
    fn leave(&mut self, fans: &Fans<'_, impl Points>, ground: &mut Ground) -> Option<usize> {
        let patience = self.parameters.patience;
        if self.gain_age > patience + SLOW * self.least_cost || self.spot_since > patience {
            // It does not get there.
            if let Some(way) = &self.way {
                ground.give_up(way.goal(), self.parameters.near);
            }
            (self.way, self.gain_age, self.given_up_age) = (None, 0.0, 0.0);
            self.stay();
        }
        let arrived = self.way.is_some_and(|way| ground.is_known(way.goal()));
        if arrived {
            self.search_ahead();
            return self.search(fans, ground);
        }
        if (self.way.is_none() || self.way_age > WAY_LASTS) && !self.find_way(ground) {
            self.search_ahead();
            return self.search(fans, ground);
        }
        let (ahead, far) = self.carrot(&fans[2])?;
        if fans[2].is_free(ahead, far) {
            self.blocked_age = 0.0;
        }
        if self.blocked_age < LOOKS {
            return Some(ahead);
        }
        let least = LAST * self.parameters.look;
        let around = fans.iter().find_map(|fan| fan.nearest_free(ahead, least, ASIDE));
        around.or_else(|| fans[2].sweep(ahead, least).map(|found| found.direction))
    }

    /// The direction and the distance (m) of the place on the way that it steers to: the farthest to which it may go straight, or else the nearest.
    fn carrot(&self, fan: &Fan<'_, impl Points>) -> Option<(usize, f64)> {
        let way = self.way.as_ref()?;
        let here = self.real_pose();
        let away = |i: usize| way.points()[i].distance(here.position());
        let nearest = (0..way.points().len()).fold(0, |best, i| if away(i) < away(best) { i } else { best });
        let ahead = &way.points()[nearest..];
        let seen = ahead.iter().map(|point| {
            let local = here.inverse().transform(*point);
            (direction(local.bearing() * self.parameters.side.sign()), local.norm())
        });
        let seen = seen.skip_while(|(_, far)| *far < STRIDE).take_while(|(_, far)| *far <= CARROT);
        let straight = seen.clone().take_while(|(way, far)| fan.is_free(*way, *far)).last();
        straight.or_else(|| seen.clone().next()).or_else(|| {
            let local = here.inverse().transform(way.goal());
            Some((direction(local.bearing() * self.parameters.side.sign()), local.norm()))
        })
    }

    fn drive(
        &mut self,
        wanted: Option<usize>,
        fans: &Fans<'_, impl Points>,
        beside: Beside,
        dt: f64,
    ) -> Twist {
        let p = self.parameters;
        let Some(wanted) = wanted else {
            // No way at all: look around, what was heard may not be there any more.
            self.speed = 0.0;
            return Twist::new(0.0, -p.turn_max / 2.0);
        };
        let error = beside.shy(bearing(wanted));
        let straightness = fmax(1.0 - fabs(error) / IN_PLACE, 0.0);
        let ahead = fmin(fans[2].way(0), fans[2].way(wanted));
        let clearness = fmin(fmax(ahead / p.look, 0.0), 1.0);
        let known = fmin(YOUNG + (1.0 - YOUNG) * self.travelled / SEEN_AROUND, 1.0);
        let allowed = p.speed * straightness * clearness * known;
        let allowed = if ahead > 0.1 && straightness > 0.0 { fmax(allowed, p.creep) } else { 0.0 };
        self.speed = fmin(allowed, self.speed + p.growth * fmax(dt, 0.0));
        Twist::new(self.speed, fmin(fmax(p.turn_gain * error, -p.turn_max), p.turn_max))
    }
}

/// The image of a pose when the wall is on the right; twice is the pose itself.
fn mirrored(pose: Pose, side: Side) -> Pose {
    Pose::new(pose.x, pose.y * side.sign(), pose.heading * side.sign())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ground::Seen;
    use types::geometry::PI;

    /// A straight wall, a point every 5 cm.
    fn wall(from: (f64, f64), to: (f64, f64)) -> Vec<Point> {
        let (a, b) = (Point::new(from.0, from.1), Point::new(to.0, to.1));
        let n = (a.distance(b) / 0.05) as usize;
        (0..=n).map(|i| a + (b - a) * (i as f64 / n as f64)).collect()
    }

    fn square(at: (f64, f64), side: f64) -> Vec<Point> {
        let (x, y, h) = (at.0, at.1, side / 2.0);
        let corners = [(x - h, y - h), (x + h, y - h), (x + h, y + h), (x - h, y + h)];
        (0..4).flat_map(|i| wall(corners[i], corners[(i + 1) % 4])).collect()
    }

    /// A room of 5 m by 4 m with a door of 0.9 m in its upper wall.
    fn room() -> Vec<Point> {
        let mut points = wall((0.0, 0.0), (5.0, 0.0));
        points.extend(wall((5.0, 0.0), (5.0, 4.0)));
        points.extend(wall((5.0, 4.0), (3.9, 4.0)));
        points.extend(wall((3.0, 4.0), (0.0, 4.0)));
        points.extend(wall((0.0, 4.0), (0.0, 0.0)));
        points
    }

    /// A drive: where it ended, how near it came to anything, how far it turned in all, and what drove.
    struct Driven {
        pose: Pose,
        nearest: f64,
        turned: f64,
        roamer: Roamer,
        ground: Ground,
    }

    impl Driven {
        /// Drives until `done` says so, five steps a second, with a sensor that sees two metres far.
        fn go(&mut self, world: &[Point], seconds: f64, mut done: impl FnMut(&Roamer, Pose) -> bool) {
            let Driven { pose, nearest, turned, roamer, ground } = self;
            for _ in 0..(seconds / 0.2) as usize {
                let inverse = pose.inverse();
                let seen = world.iter().map(|p| inverse.transform(*p)).filter(|p| p.norm() < 2.0);
                *nearest = seen.clone().fold(*nearest, |near, p| fmin(near, p.norm()));
                for point in seen.clone() {
                    ground.see(pose.transform(point), Some(Seen::Taken));
                }
                let twist = roamer.step(seen, Beside::default(), *pose, ground, 0.2);
                *pose = pose.along_arc(0.2 * twist.linear, 0.2 * twist.angular);
                *turned += 0.2 * fabs(twist.angular);
                if done(roamer, *pose) {
                    break;
                }
            }
        }
    }

    fn at_start(parameters: Parameters, pose: Pose) -> Driven {
        let roamer = Roamer::new(parameters, pose);
        Driven { pose, nearest: f64::INFINITY, turned: 0.0, roamer, ground: Ground::new() }
    }

    fn drive(
        parameters: Parameters,
        world: &[Point],
        start: Pose,
        seconds: f64,
        done: impl Fn(&Roamer, Pose) -> bool,
    ) -> Driven {
        let mut driven = at_start(parameters, start);
        driven.go(world, seconds, done);
        driven
    }

    #[test]
    fn it_leaves_a_room_by_its_door_from_anywhere_with_the_wall_on_either_side() {
        for side in [Side::Left, Side::Right] {
            for (x, y, heading) in [(2.5, 2.0, 0.0), (1.0, 1.0, 2.0), (4.0, 1.0, -1.5), (2.0, 3.0, 3.0)] {
                let parameters = Parameters { side, ..Parameters::new(0.225) };
                let start = Pose::new(x, y, heading);
                let Driven { pose, nearest, .. } =
                    drive(parameters, &room(), start, 200.0, |_, pose| pose.y > 4.3);
                assert!(pose.y > 4.3, "{side:?} from {start:?}: at {pose:?}");
                assert!(nearest > 0.25, "{side:?} from {start:?}: {nearest} m");
            }
        }
    }

    #[test]
    fn it_circles_an_island_once_and_leaves_it_for_new_ground() {
        let start = Pose::new(-1.5, 0.0, 0.0);
        let driven = drive(Parameters::new(0.225), &square((0.0, 0.0), 0.6), start, 120.0, |_, pose| {
            pose.x.hypot(pose.y) > 2.5
        });
        assert!(driven.pose.position().norm() > 2.5, "{:?}", driven.pose);
        assert!(driven.roamer.times_left() > 0 && driven.nearest > 0.25, "{}", driven.nearest);
    }

    #[test]
    fn of_two_rooms_it_has_been_near_all_ground_before_it_knows_of_nothing_new() {
        let mut world = room();
        // The same room again, beyond the door.
        world.extend(room().iter().map(|p| Point::new(p.x, 8.0 - p.y)));
        let start = Pose::new(1.0, 1.0, 0.0);
        let driven = drive(Parameters::new(0.225), &world, start, 400.0, |_, _| false);
        for (x, y) in [(1.0, 3.0), (4.3, 0.7), (0.7, 0.7), (0.7, 7.3), (4.3, 7.3), (2.5, 5.5)] {
            assert!(driven.ground.is_known(Point::new(x, y)), "({x}, {y})");
        }
        assert!(driven.nearest > 0.25, "{}", driven.nearest);
    }

    #[test]
    fn at_the_end_of_a_corridor_it_goes_around_the_corner_and_not_back_along_the_other_wall() {
        let corners =
            [(-1.0, 6.0), (-1.0, 0.0), (1.0, 0.0), (1.0, 8.0), (-5.0, 8.0), (-5.0, 6.0), (-1.0, 6.0)];
        let world: Vec<Point> = corners.windows(2).flat_map(|two| wall(two[0], two[1])).collect();
        let mut driven = at_start(Parameters::new(0.225), Pose::new(-0.4, 1.0, PI / 2.0));
        // Up to the upper wall the corridor is free, and it is heard that its left part is.
        for i in 0..720 {
            let (x, y) = (0.95 - 0.1 * f64::from(i % 40), 6.15 + 0.1 * f64::from(i / 40));
            driven.ground.see(Point::new(x, y), Some(Seen::Free));
        }
        let mut lowest_after = f64::INFINITY;
        driven.go(&world, 60.0, |_, pose| {
            if pose.y > 6.5 || lowest_after.is_finite() {
                lowest_after = lowest_after.min(pose.y);
            }
            pose.x < -3.0
        });
        assert!(driven.pose.x < -3.0 && lowest_after > 6.0, "{:?} {lowest_after}", driven.pose);
        assert!(driven.nearest > 0.25, "{}", driven.nearest);
    }

    /// On the way out of a known room, to what is free beyond its door.
    fn on_the_way_out() -> (Driven, Vec<Point>) {
        let world = room();
        let mut driven = at_start(Parameters::new(0.225), Pose::new(1.0, 1.0, 0.0));
        for i in 0..99 {
            driven
                .ground
                .tread(Point::new(0.5 + 0.4 * f64::from(i % 11), 0.4 + 0.4 * f64::from(i / 11)), 0.9);
        }
        for i in 0..400 {
            let beyond = Point::new(2.45 + 0.1 * f64::from(i % 20), 4.15 + 0.1 * f64::from(i / 20));
            driven.ground.see(beyond, Some(Seen::Free));
        }
        driven.go(&world, 20.0, |roamer, _| roamer.mode == Mode::Leaving);
        (driven, world)
    }

    /// Goes on for so long with a door in which something seems to stand; tells where it then goes to.
    fn with_a_closed_door(driven: &mut Driven, world: &[Point], seconds: f64) -> Option<Point> {
        let mut closed = world.to_vec();
        closed.extend(wall((3.0, 4.0), (3.9, 4.0)));
        for point in &closed {
            driven.ground.see(*point, Some(Seen::Taken));
        }
        driven.go(world, seconds, |_, _| false);
        driven.roamer.way.map(|way| way.goal())
    }

    #[test]
    fn a_way_that_is_lost_from_sight_is_gone_on_with_for_a_while() {
        let (mut driven, world) = on_the_way_out();
        let goal = driven.roamer.way.map(|way| way.goal());
        assert!(driven.roamer.mode == Mode::Leaving && goal.is_some_and(|goal| goal.y > 4.0), "{goal:?}");
        assert_eq!(with_a_closed_door(&mut driven, &world, 3.0), goal);
        assert_ne!(with_a_closed_door(&mut driven, &world, 6.0), goal);
    }

    #[test]
    fn where_it_does_not_get_on_it_looks_then_goes_around_and_at_last_gives_up() {
        let (Driven { mut pose, mut roamer, mut ground, .. }, mut world) = on_the_way_out();
        let goal = roamer.way.map(|way| way.goal()).unwrap();
        // What it sees stands in the door; the ground does not know of it.
        world.extend(wall((3.0, 4.0), (3.9, 4.0)));
        let (mut blocked, mut looked, mut turned_away, mut seconds) = (0.0, true, false, 0.0);
        while !ground.is_known(goal) && seconds < 120.0 {
            let inverse = pose.inverse();
            let seen = world.iter().map(|p| inverse.transform(*p)).filter(|p| p.norm() < 2.0);
            let twist = roamer.step(seen, Beside::default(), pose, &mut ground, 0.2);
            pose = pose.along_arc(0.2 * twist.linear, 0.2 * twist.angular);
            seconds += 0.2;
            if pose.y > 3.0 {
                blocked += 0.2;
                let away = fabs(wrap((goal - pose.position()).bearing() - pose.heading)) > 1.2;
                looked &= blocked > LOOKS || !away;
                turned_away |= away;
            }
        }
        assert!(ground.is_known(goal) && pose.y < 4.0, "{pose:?} after {seconds} s");
        assert!(looked && turned_away, "{looked} {turned_away}");
    }

    #[test]
    fn a_place_that_was_given_up_is_tried_again() {
        let place = Point::new(3.0, 0.0);
        let mut driven = at_start(Parameters::new(0.225), Pose::default());
        driven.ground.give_up(place, 0.5);
        let walls = square((0.0, 0.0), 0.6);
        driven.go(&walls, TRIES_AGAIN - 1.0, |_, _| false);
        assert!(driven.ground.is_known(place));
        driven.go(&walls, 2.0, |_, _| false);
        assert!(!driven.ground.is_known(place));
    }

    #[test]
    fn all_around_closed_it_looks_around_and_does_not_move() {
        let start = Pose::new(0.0, 0.0, 0.0);
        let driven = drive(Parameters::new(0.225), &square((0.0, 0.0), 0.6), start, 10.0, |_, _| false);
        assert!(driven.pose.position().norm() < 0.1, "{:?}", driven.pose);
        assert!(driven.turned > 1.0);
    }

    #[test]
    fn with_the_wall_on_the_other_side_it_drives_the_mirrored_way() {
        let world = room();
        let flipped: Vec<Point> = world.iter().map(|p| Point::new(p.x, -p.y)).collect();
        let (left, right) =
            (Parameters::new(0.225), Parameters { side: Side::Right, ..Parameters::new(0.225) });
        // The grid of the ground has no mirror line, so the two are compared until new ground is first looked for.
        let one =
            drive(left, &world, Pose::new(2.5, 2.0, 0.3), 60.0, |roamer, _| roamer.mode() == Mode::Leaving);
        let other = drive(right, &flipped, Pose::new(2.5, -2.0, -0.3), 60.0, |roamer, _| {
            roamer.mode() == Mode::Leaving
        });
        let (a, b) = (one.pose, other.pose);
        assert!((a.x - b.x).abs() < 0.3 && (a.y + b.y).abs() < 0.3, "{a:?} {b:?}");
    }

    #[test]
    fn it_does_not_turn_towards_what_may_be_nearer_than_told_except_in_place() {
        let left = Beside { left: true, right: false };
        assert_eq!([0.3, 0.0, -0.4, 1.2].map(|error| left.shy(error)), [-SHY, -SHY, -0.4, 1.2]);
        let both = Beside { left: true, right: true };
        assert_eq!(both.shy(0.3), 0.3);
    }
}
