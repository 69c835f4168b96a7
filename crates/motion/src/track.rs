//! Following a path: regulated pure pursuit over a polyline.
//!
//! ```text
//!                          ╭ lookahead point, where the circle of radius L leaves the path
//!     path ────●───────────✕──────●        κ = 2 y / L²          y: how far to the left of the body the point lies
//!              ┊         ╱                 ω = κ v
//!              ┊      ╱ L                  L = v t, within [L_min, L_max]
//!      nearest ┊   ╱
//!        point ◯▶                          v = wanted · min(1, r/r_min) · min(1, g d/d_near) · min(1, left/approach),  r = 1/|κ|
//! ```
//!
//! The arc of curvature κ through the body, along its heading, meets the point (Coulter, *Implementation of the Pure Pursuit Path Tracking
//! Algorithm*, CMU-RI-TR-92-01); on a circle it is that circle, whatever L is. Near a straight line an error across decays over the way s
//! as exp(−s/L) (cos s/L + sin s/L): poles (−1 ± i)/L. The speed is regulated by the curvature, by what is near (d, from the body's edge;
//! the gain g is 1 or less) and by the end (Macenski, Singh, Martín, Ginés, *Regulated pure pursuit for robot path tracking*, Autonomous
//! Robots 2023).
//!
//! Where the path has speeds, they take the place of `wanted` and of the regulation by the curvature: who planned them has reckoned with
//! curves and with braking. Between two points the square of the speed is linear along the path, as it is with a constant acceleration. What
//! is near, the end, and the turn rate that the drive can do bound them all the same.
//!
//! The way along the path only grows: the nearest point is sought from that of the step before on, as far as one lookahead along the path
//! or as the lookahead point. So a path may cross itself, or lead back beside itself, farther on than that. The lookahead point is sought
//! from that of the step before, so that it does not leap between the places where a winding path leaves the circle. Where the path begins
//! behind, the body turns to it in place.
//!
//! ```text
//!  ┌─────────┐  ahead  ┌───────────┐  end   ┌─────────┐
//!  │ Turning │ ──────▶ │ Following │ ─────▶ │ Arrived │
//!  └─────────┘ ◀────── └───────────┘        └─────────┘
//!               behind
//! ```

use crate::blend::is_finite;
use crate::kinematics::Twist;
use crate::limits::{Forward, Limits, limit};
use crate::steering::saturated;
use libm::{fabs, fmax, fmin, sqrt};
use types::{Point, Pose};

/// How to follow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// Speed where nothing asks for less (m/s).
    pub speed: f64,
    /// Least speed in a curve and before the end (m/s); an obstacle may stop it all the same.
    pub creep: f64,
    /// t: how far ahead it looks, in time (s).
    pub lookahead: f64,
    /// L_min and L_max: how far at least and at most (m).
    pub lookahead_within: (f64, f64),
    /// r_min: in curves of a smaller radius than this it slows (m).
    pub radius: f64,
    /// d_near: what is nearer than this slows it (m).
    pub proximity: f64,
    /// g: by how much more than in proportion, from 0 to 1.
    pub caution: f64,
    /// On this last part of the way it slows (m).
    pub approach: f64,
    /// Within this of the end, along the path, it is there (m).
    pub near: f64,
    /// A path farther than this off the heading is turned to in place (rad).
    pub turn_above: f64,
    /// And until it is less than this (rad).
    pub turn_until: f64,
    /// Turn rate for a radian while it turns in place (1/s).
    pub turn_gain: f64,
    /// What the drive can do.
    pub limits: Limits,
}

impl Parameters {
    /// For a drive with these limits.
    ///
    /// It looks 1.5 s ahead: at half a walk's speed that is 0.45 m, a body's length; 0.3 m at least keep it from swinging at 0.1 s of lag, and
    /// 0.9 m at most keep it from cutting doors. It slows where a curve is tighter than 0.9 m and what is beside it nearer than 0.5 m, and on
    /// the last 0.5 m. 2 cm is what a localizer tells. It turns in place where the path is as good as beside it, and drives when it is ahead.
    pub fn new(limits: Limits) -> Parameters {
        Parameters {
            speed: fmin(0.4, limits.linear_max),
            creep: 0.05,
            lookahead: 1.5,
            lookahead_within: (0.3, 0.9),
            radius: 0.9,
            proximity: 0.5,
            caution: 1.0,
            approach: 0.5,
            near: 0.02,
            turn_above: 1.2,
            turn_until: 0.3,
            turn_gain: 1.5,
            limits,
        }
    }
}

/// What it is about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Mode {
    /// Along the path.
    #[default]
    Following,
    /// Turning in place to where the path goes on.
    Turning,
    /// At its end.
    Arrived,
    /// There is no path, or something is not finite: it brakes.
    Lost,
}

/// What to drive, and how it stands.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Report {
    /// What is to be driven.
    pub twist: Twist,
    /// What it is about.
    pub mode: Mode,
    /// How far the body is to the left of the path (m).
    pub across: f64,
    /// Way left along the path (m), counted up to what matters: the approach or the lookahead. Off the path by more than the least
    /// lookahead, the way to it counts as well.
    pub left: f64,
    /// The piece of the path that it is beside, from 0.
    pub piece: usize,
    /// Where it heads for.
    pub target: Point,
    /// Curvature of the arc to there (1/m), positive to the left.
    pub curvature: f64,
}

/// A place on a polyline: so much of the piece from point `piece` on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Place {
    piece: usize,
    part: f64,
}

/// The following of one path, which is handed to every step. For another path make another.
#[derive(Clone, Copy, Debug)]
pub struct Track {
    parameters: Parameters,
    place: Place,
    target: Place,
    turning: bool,
    arrived: bool,
    last: Twist,
}

impl Track {
    /// At the beginning of a path, moving by `present`.
    pub const fn new(parameters: Parameters, present: Twist) -> Track {
        Track {
            parameters,
            place: Place { piece: 0, part: 0.0 },
            target: Place { piece: 0, part: 0.0 },
            turning: false,
            arrived: false,
            last: present,
        }
    }

    /// Tells that something else drove it since the last step, and that it moves by `present` now: the next order goes on from there.
    pub const fn yielded(&mut self, present: Twist) {
        self.last = present;
    }

    /// The next order for a body at `pose`, `dt` (s) after the one before, on a path given in the same frame, with nothing nearer to the
    /// body's edge than `clearance` (m, infinite for nothing). `speeds` are those at the points of the path (m/s), or none.
    pub fn step(&mut self, path: &[Point], speeds: &[f64], pose: Pose, clearance: f64, dt: f64) -> Report {
        let mut report = self.look(path, pose);
        let wish = match report.mode {
            Mode::Following => self.regulated(&report, planned(speeds, self.place), clearance),
            Mode::Turning => {
                let off = pose.inverse().transform(report.target).bearing();
                saturated(
                    Twist::new(0.0, self.parameters.turn_gain * off),
                    1.0,
                    self.parameters.limits.angular_max,
                )
            }
            Mode::Arrived | Mode::Lost => Twist::ZERO,
        };
        self.last = limit(&self.parameters.limits, wish, self.last, Forward::Allowed, dt).twist;
        report.twist = self.last;
        report
    }

    /// Where it is on the path and where it heads for; nothing is ordered yet.
    fn look(&mut self, path: &[Point], pose: Pose) -> Report {
        let lost = Report { mode: Mode::Lost, ..Report::default() };
        let p = self.parameters;
        let body = pose.position();
        if path.is_empty() || !is_finite(pose) {
            return lost;
        }
        let (least, most) = p.lookahead_within;
        let reach = fmin(fmax(fabs(self.last.linear) * p.lookahead, least), most);
        self.place = nearest(path, self.place, self.target.piece, body, reach);
        self.target = ahead(path, self.place, self.target, body, reach);
        let target = point(path, self.target);
        let seen = pose.inverse().transform(target);
        let curvature = 2.0 * seen.y / fmax(seen.dot(seen), 1e-9);
        let across = across(path, self.place, body);
        let left =
            way_left(path, self.place, fmax(p.approach, reach), body) + fmax(fabs(across) - least, 0.0);
        if !(curvature.is_finite() && left.is_finite()) {
            return lost;
        }
        self.arrived |= left <= p.near;
        let turns_at = if self.turning { p.turn_until } else { p.turn_above };
        self.turning = fabs(seen.bearing()) > turns_at;
        let mode = match (self.arrived, self.turning) {
            (true, _) => Mode::Arrived,
            (false, true) => Mode::Turning,
            (false, false) => Mode::Following,
        };
        Report { twist: Twist::ZERO, mode, across, left, piece: self.place.piece, target, curvature }
    }

    /// The speed that curve, obstacles and end leave, on the arc to the target.
    fn regulated(&self, report: &Report, planned: Option<f64>, clearance: f64) -> Twist {
        let p = &self.parameters;
        let end = p.speed * fmin(report.left / p.approach, 1.0);
        let curve = match planned {
            Some(planned) => fmin(planned, p.limits.angular_max / fmax(fabs(report.curvature), 1e-9)),
            None => p.speed / fmax(fabs(report.curvature) * p.radius, 1.0),
        };
        let speed = fmin(fmax(fmin(curve, end), p.creep), p.speed);
        let stoppable = sqrt(2.0 * p.limits.deceleration * report.left);
        // What is not a number is nothing that one could trust in.
        let beside =
            if clearance < p.proximity { p.caution * fmax(clearance, 0.0) / p.proximity } else { 1.0 };
        let beside = if clearance.is_nan() { 0.0 } else { beside };
        let speed = fmin(speed * beside, stoppable);
        Twist::new(speed, speed * report.curvature)
    }
}

/// The speed at a place, where there are speeds (m/s).
fn planned(speeds: &[f64], at: Place) -> Option<f64> {
    let from = speeds.get(at.piece).copied()?;
    let to = speeds.get(at.piece + 1).copied().unwrap_or(from);
    let speed = sqrt(fmax(from * from + (to * to - from * from) * at.part, 0.0));
    // What is no number is no speed with which one could drive.
    Some(if speed.is_finite() { speed } else { 0.0 })
}

/// The piece from point `piece` on: where it begins, and the vector to its end. The last point is a piece of no length.
fn piece(path: &[Point], piece: usize) -> (Point, Point) {
    let last = path.len() - 1;
    let from = path[piece.min(last)];
    (from, path[(piece + 1).min(last)] - from)
}

fn pieces(path: &[Point]) -> usize {
    (path.len() - 1).max(1)
}

/// The place nearest to `body`, not before `from`, and not beyond the piece `until` unless that is within `reach` (m) along the path.
fn nearest(path: &[Point], from: Place, until: usize, body: Point, reach: f64) -> Place {
    let mut best = (f64::INFINITY, from);
    let (mut way, mut part) = (0.0, from.part);
    for index in from.piece.min(pieces(path) - 1)..pieces(path) {
        let (begin, along) = piece(path, index);
        let square = along.dot(along);
        let foot = if square > 0.0 { (body - begin).dot(along) / square } else { 0.0 };
        let length = sqrt(square);
        // The window ends inside the piece, or behind it.
        let within = if length > 0.0 { fmin(1.0, part + (reach - way) / length) } else { 1.0 };
        let most = if index <= until { 1.0 } else { within };
        let at = fmin(fmax(foot, part), most);
        let off = body - (begin + along * at);
        let off = off.dot(off);
        if off < best.0 {
            best = (off, Place { piece: index, part: at });
        }
        way += (1.0 - part) * length;
        if way >= reach && index >= until {
            break;
        }
        part = 0.0;
    }
    best.1
}

/// Where the circle of radius `reach` (m) around `body` leaves the path, which is sought from where it left it before (`last`): onward
/// from there if that is inside by now, else back, as far as `from`. So it does not leap between the places where a winding path leaves
/// the circle. For a body beside the last piece, that is drawn out past its end.
fn ahead(path: &[Point], from: Place, last: Place, body: Point, reach: f64) -> Place {
    let last = if (last.piece, last.part) < (from.piece, from.part) { from } else { last };
    if (point(path, last) - body).is_within(reach) {
        onward(path, from.piece, last, body, reach)
    } else {
        backward(path, from, last, body, reach)
    }
}

/// From inside of the circle to where the path first leaves it. The body is beside the piece `beside`.
fn onward(path: &[Point], beside: usize, last: Place, body: Point, reach: f64) -> Place {
    let end = path[path.len() - 1];
    for index in last.piece..pieces(path) {
        let (begin, along) = piece(path, index);
        let rest = &path[(index + 1).min(path.len() - 1)..];
        // Pieces of no length may follow the last one that has a direction.
        let drawn_out =
            index == beside && along != Point::default() && rest.iter().all(|point| *point == end);
        if drawn_out || !(rest[0] - body).is_within(reach) {
            return Place { piece: index, part: leaves(begin - body, along, reach).unwrap_or(1.0) };
        }
    }
    Place { piece: pieces(path) - 1, part: 1.0 }
}

/// From outside of the circle back to where the path is inside of it, or to `from` if it is so nowhere.
fn backward(path: &[Point], from: Place, last: Place, body: Point, reach: f64) -> Place {
    for index in (from.piece..=last.piece).rev() {
        let (begin, along) = piece(path, index);
        let least = if index == from.piece { from.part } else { 0.0 };
        let most = if index == last.piece { last.part } else { 1.0 };
        let left = leaves(begin - body, along, reach);
        if let Some(part) = left.filter(|part| (least..=most).contains(part)) {
            return Place { piece: index, part };
        }
    }
    from
}

/// The larger t at which |from + t · along| = reach, where there is one.
fn leaves(from: Point, along: Point, reach: f64) -> Option<f64> {
    let (a, half_b, c) = (along.dot(along), from.dot(along), from.dot(from) - reach * reach);
    let root = half_b * half_b - a * c;
    (a > 0.0 && root >= 0.0).then(|| (sqrt(root) - half_b) / a)
}

fn point(path: &[Point], place: Place) -> Point {
    let (begin, along) = piece(path, place.piece);
    begin + along * place.part
}

/// Way along the path from `from` to its end (m), counted until it is more than `most`. Where the path is but a point, it is the way there.
fn way_left(path: &[Point], from: Place, most: f64, body: Point) -> f64 {
    let (begin, along) = piece(path, from.piece);
    if along == Point::default() && begin == path[path.len() - 1] {
        return body.distance(begin);
    }
    let mut way = along.norm() * (1.0 - from.part);
    for index in from.piece + 1..pieces(path) {
        if way > most {
            break;
        }
        way += piece(path, index).1.norm();
    }
    way
}

/// How far `body` is to the left of the path at `place` (m).
fn across(path: &[Point], place: Place, body: Point) -> f64 {
    let (_, along) = piece(path, place.piece);
    let off = body - point(path, place);
    if along.cross(off) < 0.0 { -off.norm() } else { off.norm() }
}

#[cfg(test)]
mod tests;
