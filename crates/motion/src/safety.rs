//! The law of the safety monitor: how fast is still safe, whether it may go forward at all, and where there is room.

use crate::kinematics::Twist;
use crate::ring::{Echo, Ring};
use libm::{fabs, fmax, fmin, sincos, sqrt};
use types::geometry::{PI, wrap};

/// What the robot is and how careful it shall be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// Radius of the round body (m).
    pub radius: f64,
    /// Half the opening angle of one beam (rad). An echo counts where in its cone it would be worst.
    pub cone: f64,
    /// Room kept on both sides of the swept corridor (m).
    pub side_margin: f64,
    /// Way left in front after stopping (m), from the body's edge.
    pub margin: f64,
    /// Way in front below which it must not move forward (m), from the body's edge.
    pub stop: f64,
    /// From an echo to the wheels' answer (s): a period of the sensor, one of the controller, and the lag of the motors.
    pub reaction: f64,
    /// Braking (m/s²).
    pub deceleration: f64,
    /// Highest speed at all (m/s).
    pub linear_max: f64,
    /// Room from the body's edge to both sides together, below which it is narrow (m).
    pub narrow: f64,
    /// Way from the body's edge beyond which nothing is a danger (m).
    pub horizon: f64,
}

impl Parameters {
    /// For a round robot of `radius` (m) with beams of half width `cone` (rad), read every `period` (s).
    ///
    /// The reaction is the period, during which something may have come near unseen, plus 0.1 s for controller and motors. 1 m/s² brakes
    /// without tipping. 5 cm are left after a stop, and at 10 cm it does not start again: the difference keeps it from creeping up. 2 cm
    /// at the sides let it through doors. Narrow is where it could not pass a second robot of its size. 1.5 m are four seconds
    /// at a slow walk.
    pub fn new(radius: f64, cone: f64, period: f64) -> Parameters {
        Parameters {
            radius,
            cone,
            side_margin: 0.02,
            margin: 0.05,
            stop: 0.1,
            reaction: period + 0.1,
            deceleration: 1.0,
            linear_max: 0.6,
            narrow: 2.0 * radius,
            horizon: 1.5,
        }
    }
}

/// What is allowed and what is advised.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Verdict {
    /// Whether it may move forward. Turning in place is always allowed: a round body sweeps nothing new.
    pub forward: bool,
    /// Highest forward speed (m/s); 0 while forward is forbidden.
    pub linear_max: f64,
    /// The wider side: positive is left, from −1 to 1.
    pub wider: f64,
    /// From 0, far from everything, to 1, too late to stop in time.
    pub danger: f64,
    /// Whether there is little room on both sides.
    pub narrow: bool,
    /// Free way ahead from the body's edge (m); infinite if nothing is there.
    pub ahead: f64,
    /// Distance from the body's edge to what is nearest (m), and where that is (rad).
    pub nearest: f64,
    /// Bearing of what is nearest (rad).
    pub nearest_bearing: f64,
}

/// The way needed to stop (m) from `speed` (m/s): d = v t + v²/2a, with the reaction time t (s) and the deceleration a (m/s²).
pub fn stopping_distance(speed: f64, reaction: f64, deceleration: f64) -> f64 {
    speed * reaction + speed * speed / (2.0 * deceleration)
}

/// The speed (m/s) from which it stops within `way` (m): v = √(a²t² + 2 a d) − a t; 0 for no way.
pub fn speed_to_stop_within(way: f64, reaction: f64, deceleration: f64) -> f64 {
    let lost = deceleration * reaction;
    if way > 0.0 { sqrt(lost * lost + 2.0 * deceleration * way) - lost } else { 0.0 }
}

/// What is left (m/s) of a `speed` that was judged to be safe `age` (s) ago, when a new word of it was due after `due` (s): nobody has
/// looked since, so the robot brakes with `deceleration` (m/s²), as it was counted on.
pub fn aged(speed: f64, age: f64, due: f64, deceleration: f64) -> f64 {
    fmax(speed - deceleration * fmax(age - due, 0.0), 0.0)
}

/// Judges a reading.
///
/// `raw` is the ring as it was measured, `filtered` after the sensor's filter. The filtered one sets the speed with the margin; the raw
/// one, which may hold a false echo but has no delay, is obeyed without the margin, so a single false echo far away costs no speed. Both
/// together decide whether it may move forward. `present` is how the robot moves; in a curve the corridor that it is about to sweep
/// counts as well as the straight one, as far as it takes to stop. With no echo at all in both rings it may not move forward: it is blind.
pub fn judge(parameters: &Parameters, raw: Ring<'_>, filtered: Ring<'_>, present: Twist) -> Verdict {
    let present = if crate::kinematics::is_finite(present) { present } else { Twist::ZERO };
    let ways = (ahead(parameters, raw, present), ahead(parameters, filtered, present));
    let way = way(parameters, (raw, filtered), ways, present);
    let (left, right) = (room(parameters, filtered, 1.0), room(parameters, filtered, -1.0));
    Verdict {
        forward: way.forward,
        linear_max: way.linear_max,
        wider: if left + right > 0.0 { (left - right) / (left + right) } else { 0.0 },
        danger: way.danger,
        narrow: is_narrow(parameters, filtered),
        ahead: way.ahead,
        nearest: way.nearest,
        nearest_bearing: way.nearest_bearing,
    }
}

/// What stands in the way, and how fast that lets the robot go: the part of a [`Verdict`] that does not ask how wide it is beside it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Way {
    /// Whether it may move forward. Turning is always allowed.
    pub forward: bool,
    /// Highest forward speed (m/s); 0 while forward is forbidden.
    pub linear_max: f64,
    /// From 0, far from everything, to 1, too late to stop in time.
    pub danger: f64,
    /// Free way ahead from the body's edge (m); infinite if nothing is there.
    pub ahead: f64,
    /// Distance from the body's edge to what is nearest (m).
    pub nearest: f64,
    /// Bearing of what is nearest (rad).
    pub nearest_bearing: f64,
}

/// The way alone, by one ring that is both: a third of the price where there are many points.
pub fn judge_way(parameters: &Parameters, ring: Ring<'_>, present: Twist) -> Way {
    let present = if crate::kinematics::is_finite(present) { present } else { Twist::ZERO };
    let free = ahead(parameters, ring, present);
    way(parameters, (ring, ring), (free, free), present)
}

fn way(
    parameters: &Parameters,
    (raw, filtered): (Ring<'_>, Ring<'_>),
    (heard, believed): (Ahead, Ahead),
    present: Twist,
) -> Way {
    let blind = raw.echoes().next().is_none() && filtered.echoes().next().is_none();
    let straight = fmin(heard.straight, believed.straight);
    let curved = fmin(heard.curved, believed.curved);
    let forward = !blind && straight > parameters.stop && curved > parameters.margin;
    let speed = |way: f64| speed_to_stop_within(way, parameters.reaction, parameters.deceleration);
    let safe = fmin(
        speed(fmin(heard.straight, heard.curved)),
        speed(fmin(believed.straight, believed.curved) - parameters.margin),
    );
    // What is believed tells it, unless that is nothing.
    let closest = if believed.nearest.range.is_finite() { believed.nearest } else { heard.nearest };
    let nearest = fmax(closest.range - parameters.radius, 0.0);
    let needed = stopping_distance(fmax(present.linear, 0.0), parameters.reaction, parameters.deceleration);
    // The curve will not be driven to its end, so there is no start to be forbidden; it must be stopped in time all the same.
    let share = |needed: f64, way: f64| if way > 0.0 { needed / way } else { 1.0 };
    let in_time = fmax(share(needed + parameters.stop, straight), share(needed, curved));
    let close = 1.0 - nearest / parameters.horizon;
    Way {
        forward,
        linear_max: if forward { fmin(safe, parameters.linear_max) } else { 0.0 },
        danger: if blind { 1.0 } else { fmin(fmax(fmax(in_time, close), 0.0), 1.0) },
        ahead: fmin(straight, curved),
        nearest,
        nearest_bearing: closest.bearing,
    }
}

/// What a ring shows before the body: free ways (m) from its edge, and what is nearest on any side.
#[derive(Clone, Copy)]
struct Ahead {
    straight: f64,
    /// On the present curve; infinite while it goes straight.
    curved: f64,
    /// Infinitely far where there is nothing.
    nearest: Echo,
}

/// Free way straight on and on the present curve, and what is nearest.
fn ahead(parameters: &Parameters, ring: Ring<'_>, present: Twist) -> Ahead {
    let curvature = if present.linear > 0.02 { present.angular / present.linear } else { 0.0 };
    let nothing = Echo { bearing: 0.0, range: f64::INFINITY };
    let free = Ahead { straight: f64::INFINITY, curved: f64::INFINITY, nearest: nothing };
    ring.echoes().filter(|echo| echo.range.is_finite()).fold(free, |way, echo| Ahead {
        straight: fmin(way.straight, way_straight(parameters, echo)),
        curved: if fabs(curvature) > 0.05 {
            fmin(way.curved, way_curved(parameters, echo, curvature))
        } else {
            way.curved
        },
        nearest: if echo.range < way.nearest.range { echo } else { way.nearest },
    })
}

/// The echo where in its cone it lies nearest to `bearing`.
fn worst(parameters: &Parameters, echo: Echo, bearing: f64) -> Echo {
    let off = wrap(echo.bearing - bearing);
    let near = if fabs(off) <= parameters.cone {
        0.0
    } else {
        off - parameters.cone * if off < 0.0 { -1.0 } else { 1.0 }
    };
    Echo { bearing: bearing + near, ..echo }
}

/// How far the body may roll straight on before it touches the echo.
fn way_straight(parameters: &Parameters, echo: Echo) -> f64 {
    let half_width = parameters.radius + parameters.side_margin;
    if is_surely_beside(fabs(echo.bearing) - parameters.cone, echo.range, half_width) {
        return f64::INFINITY;
    }
    let echo = worst(parameters, echo, 0.0);
    // What lies beside the middle of the body or behind it is not in the way.
    let (sine, cosine) = sincos(echo.bearing);
    let (along, across) = (echo.range * cosine, fabs(echo.range * sine));
    if along <= 0.0 || across >= half_width {
        return f64::INFINITY;
    }
    fmax(along - sqrt(fmax(parameters.radius * parameters.radius - across * across, 0.0)), 0.0)
}

/// Whether what lies `off` (rad) from straight ahead is behind the middle of the body or farther across than `half_width`, told without a
/// sine: that is so of most of what is around. It says no where rounding might decide.
fn is_surely_beside(off: f64, range: f64, half_width: f64) -> bool {
    let off = off - HAIR;
    // sin x ≥ x − x³/6.
    off > PI / 2.0 || (off > 0.0 && range * off * (1.0 - off * off / 6.0) > half_width)
}

/// More than rounding changes of an angle or a length (rad, m).
const HAIR: f64 = 1e-9;

/// How far along an arc the body may roll before it touches the echo, in the middle of its cone.
///
/// The centre of the turn lies at (0, 1/κ); a point is swept if its distance from there differs from |1/κ| by less than the half width.
fn way_curved(parameters: &Parameters, echo: Echo, curvature: f64) -> f64 {
    let turn_radius = fabs(1.0 / curvature);
    let half_width = parameters.radius + parameters.side_margin;
    if fabs(echo.bearing) > PI / 2.0 + HAIR {
        return f64::INFINITY;
    }
    let side = if curvature > 0.0 { 1.0 } else { -1.0 };
    if is_surely_off_the_curve(Echo { bearing: echo.bearing * side, ..echo }, turn_radius, half_width) {
        return f64::INFINITY;
    }
    // Mirrored to a left turn, seen from the centre of the turn; the robot stands straight below it.
    let (sine, cosine) = sincos(echo.bearing);
    let (x, y) = (echo.range * cosine, echo.range * sine * side - turn_radius);
    let from_centre = libm::hypot(x, y);
    if fabs(from_centre - turn_radius) >= half_width || from_centre < 1e-9 {
        return f64::INFINITY;
    }
    let angle = libm::atan2(x, -y);
    // What is beside or behind is left behind; a quarter turn ahead is as far as the present curve is believed.
    if angle <= 0.0 || angle > PI / 2.0 || x <= 0.0 {
        return f64::INFINITY;
    }
    // Touch when the body's centre is `radius` away from the point: law of cosines at the centre of the turn.
    let cosine = (turn_radius * turn_radius + from_centre * from_centre - half_width * half_width)
        / (2.0 * turn_radius * from_centre);
    fmax((angle - libm::acos(fmin(fmax(cosine, -1.0), 1.0))) * turn_radius, 0.0)
}

/// Whether what lies at `echo` is not swept on a left turn of `turn_radius`, told without a sine: that is so of most of what is ahead. It
/// says no where rounding might decide.
///
/// With R the radius of the turn, the square of the distance from its centre is R² + r² − 2 R r sin β.
fn is_surely_off_the_curve(echo: Echo, turn_radius: f64, half_width: f64) -> bool {
    let Echo { bearing, range } = echo;
    // x − x³/6 ≤ sin x ≤ x − x³/6 + x⁵/120 for a positive x, and the other way round for a negative one.
    let squared = bearing * bearing;
    let (third, fifth) = (1.0 - squared / 6.0, squared * squared / 120.0);
    let bounds = (bearing * third, bearing * (third + fifth));
    let (low, high) = if bearing > 0.0 { bounds } else { (bounds.1, bounds.0) };
    let wide = half_width + HAIR * (1.0 + turn_radius);
    let outside = range * (range - 2.0 * turn_radius * high) > wide * (2.0 * turn_radius + wide);
    let inside =
        turn_radius > wide && range * (range - 2.0 * turn_radius * low) < -wide * (2.0 * turn_radius - wide);
    outside || inside
}

/// Mean free way to a side (m), from 15° to 135°, none counted beyond the horizon.
fn room(parameters: &Parameters, ring: Ring<'_>, side: f64) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for echo in ring.echoes() {
        if (PI / 12.0..=0.75 * PI).contains(&(echo.bearing * side)) {
            sum += fmin(fmax(echo.range - parameters.radius, 0.0), parameters.horizon);
            count += 1.0;
        }
    }
    if count > 0.0 { sum / count } else { 0.0 }
}

fn is_narrow(parameters: &Parameters, ring: Ring<'_>) -> bool {
    let side = |sign: f64| ring.nearest_within(sign * PI / 2.0, PI / 6.0 + 1e-9) - parameters.radius;
    side(1.0) + side(-1.0) < parameters.narrow
}

#[cfg(test)]
mod tests {
    use super::*;
    use libm::{cos, sin};
    use proptest::prelude::*;
    use std::vec::Vec;

    fn parameters() -> Parameters {
        Parameters::new(0.225, PI / 12.0, 0.25)
    }

    /// Twelve beams: `ahead` in the front one, `left` and `right` in the three of each side, free elsewhere.
    fn ring(ahead: f64, left: f64, right: f64) -> Vec<(f64, f64)> {
        (0..12)
            .map(|i| {
                let range = match i {
                    0 => ahead,
                    2..=4 => left,
                    8..=10 => right,
                    _ => f64::INFINITY,
                };
                (f64::from(i) * PI / 6.0, range)
            })
            .collect()
    }

    fn verdict(ring: &[(f64, f64)], present: Twist) -> Verdict {
        judge(&parameters(), Ring::Beams(ring), Ring::Beams(ring), present)
    }

    #[test]
    fn the_stopping_distance_is_that_of_the_formula() {
        assert!(fabs(stopping_distance(0.3, 0.2, 1.0) - 0.105) < 1e-12);
    }

    #[test]
    fn too_close_ahead_forbids_moving_but_not_turning() {
        let out = verdict(&ring(0.3, 2.0, 0.6), Twist::ZERO);
        assert!(!out.forward && out.linear_max == 0.0 && out.wider > 0.0 && out.danger == 1.0, "{out:?}");
        let out = verdict(&ring(0.3, 0.6, 2.0), Twist::ZERO);
        assert!(out.wider < 0.0, "{out:?}");
    }

    #[test]
    fn what_is_beside_does_not_stop_it_and_makes_it_narrow() {
        let out = verdict(&ring(f64::INFINITY, 0.4, 0.4), Twist::new(0.3, 0.0));
        assert!(out.forward && out.linear_max == 0.6 && out.narrow, "{out:?}");
        assert!(!verdict(&ring(f64::INFINITY, 0.4, 2.0), Twist::ZERO).narrow);
    }

    #[test]
    fn one_false_echo_far_away_costs_no_speed_and_a_close_one_stops() {
        let (free, far, close) = (ring(6.0, 6.0, 6.0), ring(1.0, 6.0, 6.0), ring(0.3, 6.0, 6.0));
        let with =
            |raw: &[(f64, f64)]| judge(&parameters(), Ring::Beams(raw), Ring::Beams(&free), Twist::ZERO);
        assert_eq!(with(&far).linear_max, 0.6);
        assert!(!with(&close).forward);
    }

    #[test]
    fn a_curve_into_a_thing_is_seen_before_the_straight_corridor_meets_it() {
        // At 0.5 m to the left front; turning on a radius of 0.5 m leads there.
        let thing = [(PI / 4.0, 0.6), (PI, 3.0)];
        let laser = Parameters { cone: 0.0, ..parameters() };
        let ring = Ring::Beams(&thing);
        assert_eq!(judge(&laser, ring, ring, Twist::new(0.3, 0.0)).ahead, f64::INFINITY);
        assert!(judge(&laser, ring, ring, Twist::new(0.3, 0.6)).ahead < 0.45);
        assert_eq!(judge(&laser, ring, ring, Twist::new(0.3, -0.6)).ahead, f64::INFINITY);
    }

    #[test]
    fn the_blind_may_turn_only() {
        let out = verdict(&[(0.0, f64::NAN)], Twist::ZERO);
        assert!(!out.forward && out.danger == 1.0);
    }

    /// The ways as their laws say them, with every sine and length.
    fn ways_by_hand(parameters: &Parameters, echo: Echo, curvature: f64) -> (f64, f64) {
        let half_width = parameters.radius + parameters.side_margin;
        let seen = worst(parameters, echo, 0.0);
        let (along, across) = (seen.range * cos(seen.bearing), fabs(seen.range * sin(seen.bearing)));
        let straight = if along <= 0.0 || across >= half_width {
            f64::INFINITY
        } else {
            fmax(along - sqrt(fmax(parameters.radius * parameters.radius - across * across, 0.0)), 0.0)
        };
        let (turn_radius, side) = (fabs(1.0 / curvature), if curvature > 0.0 { 1.0 } else { -1.0 });
        let (x, y) = (echo.range * cos(echo.bearing), echo.range * sin(echo.bearing) * side - turn_radius);
        let (away, angle) = (libm::hypot(x, y), libm::atan2(x, -y));
        let beside = fabs(away - turn_radius) >= half_width || away < 1e-9;
        if beside || angle <= 0.0 || angle > PI / 2.0 || x <= 0.0 {
            return (straight, f64::INFINITY);
        }
        let cosine =
            (turn_radius * turn_radius + away * away - half_width * half_width) / (2.0 * turn_radius * away);
        let touch = libm::acos(fmin(fmax(cosine, -1.0), 1.0));
        (straight, fmax((angle - touch) * turn_radius, 0.0))
    }

    proptest! {
        #[test]
        fn the_short_ways_to_tell_what_is_beside_change_no_bit(
            bearing in -PI..PI, range in 0.01f64..4.0, cone in 0f64..0.5, curvature in prop_oneof![-9f64..-0.05, 0.05f64..9.0],
            edge in 0usize..6
        ) {
            let parameters = Parameters { cone, ..parameters() };
            let half_width = parameters.radius + parameters.side_margin;
            // On the edges of what is swept, where the last digit decides.
            let range = match edge {
                0 => half_width / sin(fmax(fabs(bearing) - cone, 0.01)),
                1 => half_width,
                // On the circles between which the body sweeps in the curve.
                4 | 5 => {
                    let along = sin(bearing) / curvature;
                    let (across, sign) = if edge == 4 { (half_width, 1.0) } else { (-half_width, -1.0) };
                    let gap = across * (2.0 / fabs(curvature) + across);
                    let range = along + sign * sqrt(fmax(along * along + gap, 0.0));
                    if range > 0.0 { range } else { half_width }
                }
                _ => range,
            };
            let bearing = if edge == 3 { PI / 2.0 } else { bearing };
            let echo = Echo { bearing, range };
            let ways = (way_straight(&parameters, echo), way_curved(&parameters, echo, curvature));
            prop_assert_eq!(ways, ways_by_hand(&parameters, echo, curvature));
        }

        #[test]
        fn the_way_alone_is_that_of_two_rings_that_are_the_same(
            beams in prop::collection::vec((-3.2f64..3.2, -0.1f64..3.0), 0..30), linear in -0.3f64..0.6, angular in -1f64..1.0
        ) {
            let (parameters, ring) = (Parameters::new(0.225, 0.1, 0.25), Ring::Beams(&beams));
            let present = Twist { linear, angular };
            let Verdict { forward, linear_max, danger, ahead, nearest, nearest_bearing, .. } =
                judge(&parameters, ring, ring, present);
            let way = Way { forward, linear_max, danger, ahead, nearest, nearest_bearing };
            prop_assert_eq!(judge_way(&parameters, ring, present), way);
        }

        #[test]
        fn speed_and_stopping_distance_are_inverse(way in 0.001f64..5., t in 0f64..1., a in 0.2f64..3.) {
            let v = speed_to_stop_within(way, t, a);
            prop_assert!(fabs(stopping_distance(v, t, a) - way) < 1e-9);
        }

        /// A robot that drives straight at a wall as fast as it is allowed, reading four times a second, with motors that start to
        /// brake 0.1 s late. It starts at any speed and distance from which stopping is possible at all.
        #[test]
        fn it_never_touches_the_wall(speed in 0f64..0.6, spare in 0.0f64..3., slant in -0.9f64..0.9) {
            let p = parameters();
            let mut v = speed;
            // Distance from the centre along the heading; the wall leans by `slant`.
            let edge = p.radius / cos(slant);
            let mut x = edge + stopping_distance(speed, p.reaction, p.deceleration) + 1e-6 + spare;
            let (mut order, mut obeyed) = (speed, speed);
            let (mut next_reading, mut obeys_at, dt) = (0.0, 0.0, 0.001);
            for k in 0..20_000 {
                let now = f64::from(k) * dt;
                if now >= next_reading {
                    next_reading += 0.25;
                    let normal = slant;
                    let beams: Vec<(f64, f64)> = (0..12).map(|i| {
                        let b = wrap(f64::from(i) * PI / 6.0);
                        let best = b + fmin(fmax(wrap(normal - b), -p.cone), p.cone);
                        let c = cos(best - normal);
                        (b, if c > 0.05 { x * cos(slant) / c } else { f64::INFINITY })
                    }).collect();
                    let out = judge(&p, Ring::Beams(&beams), Ring::Beams(&beams), Twist::new(v, 0.0));
                    order = out.linear_max;
                    obeys_at = now + 0.1;
                }
                if now >= obeys_at {
                    obeyed = order;
                }
                v = if obeyed < v { fmax(v - p.deceleration * dt, obeyed) } else { fmin(v + 0.5 * dt, obeyed) };
                x -= v * dt;
                prop_assert!(x > edge, "touched after {now} s at {v} m/s");
            }
            prop_assert!(v < 1e-9, "still rolling at {v} m/s, {} m before it", x - edge);
        }
    }
}
