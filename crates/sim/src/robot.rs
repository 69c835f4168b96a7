//! A robot in the world: how it follows its commands, and what judges it.

use libm::{exp, fabs, floor, sqrt};
use types::geometry::{PI, Pose, TAU, wrap};
use types::{Point, Time};

use crate::field::{Field, Near};
use crate::model::{Battery, Head, Model, Shape};
use crate::sonar::Fan;
use types::chance::Stream;

/// The physics step (s).
pub(crate) const STEP: f64 = 0.01;
/// Clearance is told up to this (m): what is further away is not looked for.
pub const CLEARANCE_LIMIT: f64 = 2.0;
/// Nearer than this is a touch (m): the accuracy of a contact.
const TOUCH: f64 = 1e-6;
/// A robot in touch that finds itself blocked after this part of its arc is pushing.
const PUSHING: f64 = 1e-4;
/// Slower than this towards a person a robot does not drive into that person (m/s).
const TOWARDS: f64 = 1e-3;
/// Somebody who comes up to a robot that drives away touches it in step after step: that is one touch, as long as no more steps
/// than these lie between (half a second).
const NUDGE: u32 = 50;
/// A touch ends when the clearance exceeds this (m).
const RELEASE: f64 = 1e-3;
/// Along an arc that turns corners the next look is at most this far on where something is near (m).
const FINE: f64 = 5e-4;
/// How far such a look goes (m): more than a corner moves in one step.
const FEEL: f64 = 0.05;
/// How much further than the closest clearance so far the neighbourhood is searched (m): the robot can move this far
/// before it must look again.
const LOOK_AHEAD: f64 = 0.25;

/// What the judge knows of a robot, and the robot does not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    /// Where it is.
    pub pose: Pose,
    /// How often it began to touch something by its own doing.
    ///
    /// A touch that begins is another's doing where a person is touched and the robot does not move towards that person (it
    /// stands, leaves or turns away), or where a hand pushed the robot. All other touches are the robot's own.
    pub collisions: u32,
    /// How often it began to touch something by another's doing: a person walked into it, or it was pushed.
    pub bumped: u32,
    /// The smallest distance of its outline to anything so far (m); at most [`CLEARANCE_LIMIT`].
    pub closest: f64,
    /// Length of its way so far (m).
    pub distance: f64,
    /// Its heading without the jump at half a turn (rad): how far it has turned since the start, left positive.
    pub turned: f64,
    /// Its forward speed over the last step (m/s).
    pub linear: f64,
    /// Its turn rate over the last step (rad/s).
    pub angular: f64,
}

/// What a battery shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Charge {
    /// What is left of a full battery, 0 to 1.
    pub fraction: f64,
    /// Voltage (V).
    pub voltage: f64,
}

/// Where a head looks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HeadState {
    /// To the left of straight ahead (rad).
    pub pan: f64,
    /// Above the horizon (rad).
    pub tilt: f64,
}

/// Motion over one step, before anything is in the way.
#[derive(Clone, Copy, Debug, Default)]
struct Motion {
    /// Length of the arc (m).
    distance: f64,
    /// Turn along it (rad).
    turn: f64,
    /// Turns of the wheels (rad).
    wheels: [f64; 2],
}

/// The streams of chance of one robot.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Streams {
    pub sonar: Stream,
    pub laser: Stream,
    pub gyro: Stream,
    pub camera: Stream,
    pub landmarks: Stream,
    pub infrared: Stream,
    slip: Stream,
}

/// Goes along an arc by what is surely free, and gives two parts of it: one that is free and a later one that is not.
///
/// A corner can pass a thin end of wall within a step, so the end of the step alone does not tell. No point moves further than
/// `stride` (m) in the whole arc, so from a place with some clearance the arc is free for that clearance; where it is less than
/// [`FINE`] the next look is that far on, and what is touched for less than that stays unseen.
fn first_blocked(stride: f64, clearance: impl Fn(f64) -> f64) -> Option<(f64, f64)> {
    let (mut free, mut part) = (0.0, 0.0);
    loop {
        let room = clearance(part);
        if room < 0.0 && part > 0.0 {
            return Some((free, part));
        }
        if part >= 1.0 || stride <= 0.0 {
            return None;
        }
        free = part;
        part = (part + room.max(FINE) / stride).min(1.0);
    }
}

/// A robot and its state.
#[derive(Clone, Debug)]
pub(crate) struct Robot {
    pub name: String,
    pub model: Model,
    pub body: u32,
    pub truth: Truth,
    pub head: HeadState,
    pub streams: Streams,
    pub fan: Option<Fan>,
    pub beams: Vec<Point>,
    pub gyro_bias: f64,
    /// The point that the robot touches.
    pub contact: Option<Point>,
    head_goal: HeadState,
    wheel_speeds: [f64; 2],
    wheel_angles: [f64; 2],
    command: [f64; 2],
    /// When the motors stop without a new command.
    command_until: Time,
    /// How much of a wheel's speed error is left after one step.
    decay: f64,
    used: f64,
    /// The share of its way that each wheel loses, and until when.
    lost: [f64; 2],
    lost_until: Time,
    touching: bool,
    /// For so many steps more whoever comes up to the robot again goes on with the same touch.
    nudged: u32,
    /// Nothing is nearer to the rim than this (m); shrinks with every motion until the robot looks again.
    reach: f64,
    motion: Motion,
}

impl Robot {
    pub(crate) fn new(name: &str, model: Model, body: u32, pose: Pose, seed: u64) -> Robot {
        let stream = |part: &str| Stream::new(seed, &format!("robot/{name}/{part}"));
        let streams = Streams {
            sonar: stream("sonar"),
            laser: stream("laser"),
            gyro: stream("gyro"),
            camera: stream("camera"),
            landmarks: stream("landmarks"),
            infrared: stream("infrared"),
            slip: stream("slip"),
        };
        let truth = Truth {
            pose,
            collisions: 0,
            bumped: 0,
            closest: CLEARANCE_LIMIT,
            distance: 0.0,
            turned: 0.0,
            linear: 0.0,
            angular: 0.0,
        };
        Robot {
            name: name.to_owned(),
            body,
            truth,
            head: HeadState::default(),
            fan: model.sonar.as_ref().map(|sonar| Fan::new(sonar, &model.shape)),
            beams: model.laser.as_ref().map(crate::laser::beams).unwrap_or_default(),
            gyro_bias: model.gyro.bias * stream("gyro bias").normal(0),
            contact: None,
            streams,
            head_goal: HeadState::default(),
            wheel_speeds: [0.0; 2],
            wheel_angles: [0.0; 2],
            command: [0.0; 2],
            command_until: Time::ZERO,
            decay: if model.drive.lag > 0.0 { exp(-STEP / model.drive.lag) } else { 0.0 },
            used: 0.0,
            lost: [0.0; 2],
            lost_until: Time::ZERO,
            touching: false,
            nudged: 0,
            reach: 0.0,
            motion: Motion::default(),
            model,
        }
    }

    pub(crate) fn command_wheels(&mut self, left: f64, right: f64, now: Time) {
        let most = self.model.drive.max_wheel_speed;
        // A command that is no number must not poison the world: it is a stop.
        let limit = |x: f64| if x.is_finite() { x.clamp(-most, most) } else { 0.0 };
        self.command = [limit(left), limit(right)];
        self.command_until = now.saturating_add(types::Duration::from_seconds(self.model.drive.watchdog));
    }

    pub(crate) fn command_head(&mut self, pan: f64, tilt: f64) {
        let Head { max_pan, max_tilt, .. } = self.model.head;
        let limit = |x: f64, most: f64| if x.is_finite() { x.clamp(-most, most) } else { 0.0 };
        self.head_goal = HeadState { pan: limit(pan, max_pan), tilt: limit(tilt, max_tilt) };
    }

    /// Turns the wheels for one step and gives how far no point of the rim moves beyond what follows (m).
    pub(crate) fn turn_wheels(&mut self, now: Time, step: u64) -> f64 {
        self.turn_head();
        let drive = &self.model.drive;
        let alive = now < self.command_until && self.used < self.model.battery.capacity * 3600.0;
        let target = if alive { self.command } else { [0.0; 2] };
        let quiet = |speed: f64| fabs(speed) < 1e-9;
        if target == [0.0; 2] && self.wheel_speeds.iter().all(|&speed| quiet(speed)) {
            self.wheel_speeds = [0.0; 2];
            self.motion = Motion::default();
            self.used += self.model.battery.idle * STEP;
            return 0.0;
        }
        let mut wheels = [0.0; 2];
        for side in 0..2 {
            let error = self.wheel_speeds[side] - target[side];
            // The exact integral of the exponential with which the wheel follows.
            wheels[side] = target[side] * STEP + error * drive.lag * (1.0 - self.decay);
            self.wheel_speeds[side] = target[side] + error * self.decay;
        }
        let mut left = wheels[0] * drive.wheel_radius * drive.left_scale;
        let mut right = wheels[1] * drive.wheel_radius * drive.right_scale;
        if drive.slip > 0.0 {
            let (a, b) = self.streams.slip.normals(step);
            left += a * drive.slip * sqrt(fabs(left));
            right += b * drive.slip * sqrt(fabs(right));
        }
        if now < self.lost_until {
            left *= 1.0 - self.lost[0];
            right *= 1.0 - self.lost[1];
        }
        let turn = (right - left) / (drive.axle * drive.axle_scale);
        self.motion = Motion { distance: (left + right) / 2.0, turn, wheels };
        self.used += self.model.battery.idle * STEP + self.model.battery.drive * fabs(self.motion.distance);
        self.stride()
    }

    /// How far no point of the rim moves beyond in this step (m): the length of the arc, and for what is not round the turn of
    /// its furthest corner.
    fn stride(&self) -> f64 {
        let Motion { distance, turn, .. } = self.motion;
        match self.model.shape {
            Shape::Round { .. } => fabs(distance),
            shape => fabs(distance) + fabs(turn) * shape.reach(),
        }
    }

    fn turn_head(&mut self) {
        if self.head != self.head_goal {
            let most = self.model.head.speed * STEP;
            self.head.pan += (self.head_goal.pan - self.head.pan).clamp(-most, most);
            self.head.tilt += (self.head_goal.tilt - self.head.tilt).clamp(-most, most);
        }
    }

    /// Moves along the arc of this step, up to the first contact; `drift` is how far others may have moved (m).
    pub(crate) fn travel(&mut self, field: &mut Field, drift: f64) {
        let Motion { distance, turn, wheels } = self.motion;
        let moved = distance != 0.0 || turn != 0.0;
        self.reach -= self.stride() + drift;
        let mut part = 1.0;
        if self.reach > self.truth.closest {
            if moved {
                self.truth.pose = self.truth.pose.along_arc(distance, turn);
            }
        } else if moved || drift > 0.0 || self.reach <= 0.0 {
            part = self.approach(field, distance, turn);
        }
        if part < 1.0 {
            self.wheel_speeds = [0.0; 2];
        }
        self.truth.linear = distance * part / STEP;
        self.truth.angular = turn * part / STEP;
        self.nudged = self.nudged.saturating_sub(1);
        if moved {
            self.truth.distance += fabs(distance) * part;
            self.truth.turned += turn * part;
            self.wheel_angles[0] += wheels[0] * part;
            self.wheel_angles[1] += wheels[1] * part;
            field.place_body(self.body, self.model.shape.solid(self.truth.pose));
        }
    }

    /// The same with something near: gives the part of the arc that was free.
    fn approach(&mut self, field: &Field, distance: f64, turn: f64) -> f64 {
        let start = self.truth.pose;
        let limit = self.truth.closest + LOOK_AHEAD;
        let (height, shape, body) = (self.model.height, self.model.shape, self.body);
        let look = |part: f64, limit: f64| {
            let pose = if part == 0.0 { start } else { start.along_arc(distance * part, turn * part) };
            let near = field.clearance(&shape.solid(pose), limit, height, body);
            (pose, near.map_or(limit, |near| near.distance), near)
        };
        let mut part = 1.0;
        let first = match shape {
            Shape::Round { .. } => None,
            _ => first_blocked(self.stride(), |part| look(part, FEEL).1),
        };
        let (mut pose, mut clearance, mut near) = look(1.0, limit);
        if clearance < 0.0 || first.is_some() {
            // The last free part of the arc, to less than a nanometre. A robot that goes on pushing gets nowhere: one look
            // tells that.
            let (mut free, mut blocked) = first.unwrap_or((0.0, 1.0));
            let pushing = self.touching && look(PUSHING, RELEASE).1 < 0.0;
            if pushing {
                free = 0.0;
            }
            for _ in 0..if pushing { 0 } else { 30 } {
                let middle = (free + blocked) / 2.0;
                if look(middle, RELEASE).1 < 0.0 { blocked = middle } else { free = middle }
            }
            part = free;
            (pose, clearance, near) = look(part, limit);
            clearance = clearance.max(0.0);
        }
        self.truth.pose = pose;
        self.truth.closest = self.truth.closest.min(clearance);
        self.reach = clearance.min(limit);
        if clearance <= TOUCH {
            if let Some(near) = &near {
                self.touch(field, near);
            }
            self.touching = true;
            self.contact = near.map(|near| near.point);
        } else if clearance > RELEASE && self.nudged < NUDGE {
            self.touching = false;
            self.contact = None;
        }
        part
    }

    /// Somebody came up to the robot until the two touched.
    pub(crate) fn is_touched(&mut self, field: &Field, body: u32, point: Point) {
        let near = Near { distance: 0.0, point, body: Some(body) };
        self.touch(field, &near);
        (self.touching, self.contact, self.reach, self.nudged) = (true, Some(point), 0.0, NUDGE);
        self.truth.closest = 0.0;
    }

    /// Counts a touch, where it begins.
    fn touch(&mut self, field: &Field, near: &Near) {
        let person = near.body.is_some_and(|index| field.bodies[index as usize].person);
        if self.touching || (person && self.nudged > 0) {
            return;
        }
        let own = self.drives_into(field, near);
        *if own { &mut self.truth.collisions } else { &mut self.truth.bumped } += 1;
    }

    /// Whether a touch that begins is the robot's own doing: see [`Truth::collisions`].
    fn drives_into(&self, field: &Field, near: &Near) -> bool {
        let Some(body) = near.body.map(|index| &field.bodies[index as usize]).filter(|body| body.person)
        else {
            return true;
        };
        let Pose { heading, .. } = self.truth.pose;
        let lever = near.point - self.truth.pose.position();
        // How the point of the robot that is touched moves by what the wheels roll in this step: slip by chance leads nowhere.
        let drive = &self.model.drive;
        let [left, right] = self.motion.wheels;
        let (left, right) =
            (left * drive.wheel_radius * drive.left_scale, right * drive.wheel_radius * drive.right_scale);
        let (distance, turn) = ((left + right) / 2.0, (right - left) / (drive.axle * drive.axle_scale));
        let moves = Point::polar(distance, heading) + Point::new(-lever.y, lever.x) * turn;
        let (low, high) = body.solid.bounds();
        let towards = (low + high) * 0.5 - near.point;
        moves.dot(towards) > TOWARDS * STEP * towards.norm()
    }

    /// Pushes the robot by this much (m, in the world) and turns it (rad), up to the first contact; its wheels count nothing of
    /// it. Gives the part of the way that was free.
    pub(crate) fn push(&mut self, field: &mut Field, by: Point, turn: f64) -> f64 {
        let (start, shape) = (self.truth.pose, self.model.shape);
        let at = |part: f64| {
            Pose::new(start.x + by.x * part, start.y + by.y * part, wrap(start.heading + turn * part))
        };
        let look = |part: f64| {
            let near = field.clearance(&shape.solid(at(part)), FEEL, self.model.height, self.body);
            (near.map_or(FEEL, |near| near.distance), near)
        };
        let blocked = first_blocked(by.norm() + fabs(turn) * shape.reach(), |part| look(part).0);
        let mut part = 1.0;
        if let Some((mut free, mut blocked)) = blocked {
            for _ in 0..30 {
                let middle = (free + blocked) / 2.0;
                if look(middle).0 < 0.0 { blocked = middle } else { free = middle }
            }
            part = free;
            let (clearance, near) = look(part);
            self.truth.closest = self.truth.closest.min(clearance.max(0.0));
            self.truth.bumped += u32::from(!self.touching);
            self.touching = true;
            self.contact = near.map(|near| near.point);
        }
        self.truth.pose = at(part);
        self.truth.turned += turn * part;
        self.reach = 0.0;
        field.place_body(self.body, shape.solid(self.truth.pose));
        part
    }

    /// Until then each wheel loses this share of its way, which its encoder counts.
    pub(crate) fn lose_grip(&mut self, shares: [f64; 2], until: Time) {
        (self.lost, self.lost_until) = (shares, until);
    }

    /// Something appeared or was put elsewhere: look again.
    pub(crate) fn look_again(&mut self) {
        self.reach = 0.0;
    }

    /// Puts the robot elsewhere, as a hand would.
    pub(crate) fn put(&mut self, pose: Pose) {
        self.truth.pose = pose;
        self.wheel_speeds = [0.0; 2];
        self.motion = Motion::default();
        self.reach = 0.0;
    }

    pub(crate) fn ticks(&self) -> [i64; 2] {
        self.wheel_angles.map(|angle| floor(angle / TAU * self.model.drive.ticks_per_turn) as i64)
    }

    pub(crate) fn charge(&self) -> Charge {
        let Battery { capacity, full, empty, .. } = self.model.battery;
        let fraction = (1.0 - self.used / (capacity * 3600.0)).max(0.0);
        Charge { fraction, voltage: empty + (full - empty) * fraction }
    }

    /// The bits of the bumper sectors that are pressed.
    pub(crate) fn bumper(&self) -> u32 {
        let Some(point) = self.contact else { return 0 };
        let bearing = wrap((point - self.truth.pose.position()).bearing() - self.truth.pose.heading);
        let sectors = f64::from(self.model.bumper_sectors);
        let sector = floor(bearing / TAU * sectors + 0.5 + 2.0 * sectors) as u32 % self.model.bumper_sectors;
        debug_assert!((-PI..PI).contains(&bearing));
        1 << sector
    }
}
