//! Motion along one axis within limits of velocity, acceleration and jerk: the trapezoid and the S-curve of seven segments.
//!
//! ```text
//!  v_p ┤      ╭──────────╮                 jerk   +j  0  −j   0   −j  0  +j
//!      │     ╱            ╲                segment 1  2   3   4    5  6   7
//!  v_0 ┤ ───╯              ╲
//!  v_1 ┤                    ╰──  t         a change of velocity by Δ takes  Δ/a + a/j   if Δ ≥ a²/j, so that a is reached
//!      └─┴──┴─┴──────────┴─┴──┴─                                           2 √(Δ/j)     else
//! ```
//!
//! A change from v_0 to v_p in the time T covers T (v_0 + v_p)/2, as it is symmetric about its middle. So the way of both changes grows
//! with the peak v_p, and the fastest motion has the highest peak for which it fits: the limit, with a cruise for what is left, or that
//! at which nothing is left. Of all motions that begin and end without acceleration it is the one of least time.
//!
//! An infinite jerk makes the trapezoid, with T = d/v + v/a from rest to rest where v is reached; a finite one makes
//! T = d/v + v/a + a/j (Biagiotti, Melchiorri, *Trajectory Planning for Automatic Machines and Robots*, ch. 3).
//!
//! The axis may be a way (m) or an angle (rad); units are said for a way. It holds for an axis that follows at once; one that lags needs
//! the loop closed over it.

use libm::{copysign, fabs, fmax, fmin, sqrt};

/// What the axis may do, all positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Highest velocity (m/s).
    pub velocity: f64,
    /// Highest acceleration, and deceleration (m/s²).
    pub acceleration: f64,
    /// Highest jerk (m/s³); infinite for a trapezoid.
    pub jerk: f64,
}

impl Bounds {
    /// Bounds without one of jerk.
    pub const fn trapezoid(velocity: f64, acceleration: f64) -> Bounds {
        Bounds { velocity, acceleration, jerk: f64::INFINITY }
    }

    fn make_sense(&self) -> bool {
        let positive = |x: f64| x > 0.0;
        positive(self.velocity)
            && positive(self.acceleration)
            && positive(self.jerk)
            && self.velocity.is_finite()
            && self.acceleration.is_finite()
    }
}

/// Why there is no such motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unfit {
    /// A bound is not positive, or something is not a number: give bounds and velocities that are.
    Nonsense,
    /// It shall begin or end faster than the bound: begin later, when it is slower, or raise the bound.
    TooFast,
    /// It shall begin or end moving away from where it goes: stop first.
    WrongWay,
    /// There is no room for the change of velocity, which needs this much way (m): brake less far ahead, or harder.
    TooShort {
        /// Least way (m).
        needed: f64,
    },
}

impl core::fmt::Display for Unfit {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Unfit::Nonsense => write!(f, "a bound is not positive, or something is not a number"),
            Unfit::TooFast => write!(f, "it begins or ends faster than the bound allows"),
            Unfit::WrongWay => write!(f, "it begins or ends moving the wrong way: stop first"),
            Unfit::TooShort { needed } => write!(f, "the change of velocity needs {needed} m of way"),
        }
    }
}

impl core::error::Error for Unfit {}

/// Where the axis is to be at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    /// Way since the beginning (m).
    pub position: f64,
    /// Velocity (m/s).
    pub velocity: f64,
    /// Acceleration (m/s²).
    pub acceleration: f64,
    /// Jerk (m/s³); 0 where a trapezoid bends.
    pub jerk: f64,
}

impl State {
    /// The state after `seconds` with the jerk as it is.
    fn after(self, seconds: f64) -> State {
        let t = seconds;
        State {
            position: self.position
                + t * (self.velocity + t * (self.acceleration / 2.0 + t * self.jerk / 6.0)),
            velocity: self.velocity + t * (self.acceleration + t * self.jerk / 2.0),
            acceleration: self.acceleration + t * self.jerk,
            jerk: self.jerk,
        }
    }

    fn times(self, sign: f64) -> State {
        State {
            position: sign * self.position,
            velocity: sign * self.velocity,
            acceleration: sign * self.acceleration,
            jerk: sign * self.jerk,
        }
    }
}

/// A change of velocity: the times of growing and of full acceleration (s), and the acceleration reached (m/s²), with its sign.
#[derive(Clone, Copy)]
struct Change {
    growing: f64,
    full: f64,
    acceleration: f64,
    jerk: f64,
}

impl Change {
    fn new(bounds: &Bounds, from: f64, to: f64) -> Change {
        let by = fabs(to - from);
        if by == 0.0 {
            return Change { growing: 0.0, full: 0.0, acceleration: 0.0, jerk: 0.0 };
        }
        let (a, j) = (bounds.acceleration, bounds.jerk);
        let (growing, full, reached) = if by * j >= a * a {
            (a / j, fmax(by / a - a / j, 0.0), a)
        } else {
            let growing = sqrt(by / j);
            (growing, 0.0, j * growing)
        };
        // A step of the acceleration has no jerk that one could calculate with.
        let jerk = if growing > 0.0 { copysign(j, to - from) } else { 0.0 };
        Change { growing, full, acceleration: copysign(reached, to - from), jerk }
    }

    fn seconds(&self) -> f64 {
        2.0 * self.growing + self.full
    }
}

/// The least way (m) in which the velocity can go from `from` to `to` (m/s).
fn way(bounds: &Bounds, from: f64, to: f64) -> f64 {
    Change::new(bounds, from, to).seconds() * (from + to) / 2.0
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Segment {
    begins: f64,
    start: State,
}

/// A motion over a given way. Made once, asked at any time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    /// Each from when it begins, in order; those of no length are there too.
    segments: [Segment; 7],
    seconds: f64,
    end: State,
    peak: f64,
    sign: f64,
}

impl Profile {
    /// From rest to rest over `distance` (m), which may be negative.
    pub fn new(bounds: Bounds, distance: f64) -> Result<Profile, Unfit> {
        Profile::between(bounds, distance, 0.0, 0.0)
    }

    /// Over `distance` (m), which may be negative, from the velocity `start` to the velocity `end` (m/s). Both have the sign of the
    /// distance, or are zero.
    pub fn between(bounds: Bounds, distance: f64, start: f64, end: f64) -> Result<Profile, Unfit> {
        if !(bounds.make_sense() && distance.is_finite() && start.is_finite() && end.is_finite()) {
            return Err(Unfit::Nonsense);
        }
        let sign = if distance < 0.0 || (distance == 0.0 && start + end < 0.0) { -1.0 } else { 1.0 };
        let (distance, start, end) = (fabs(distance), sign * start, sign * end);
        if start < 0.0 || end < 0.0 {
            return Err(Unfit::WrongWay);
        }
        let least = fmax(start, end);
        if least > bounds.velocity {
            return Err(Unfit::TooFast);
        }
        let needed = way(&bounds, start, end);
        // What is missing by rounding alone is not missing.
        if needed > distance + 1e-12 * (1.0 + distance) {
            return Err(Unfit::TooShort { needed });
        }
        let peak = peak(&bounds, distance, start, end);
        Ok(Profile::over(&bounds, distance, [start, peak, end], sign))
    }

    /// The change of velocity from `start` to `end` (m/s) alone, in the least time. Both have one sign, or are zero.
    pub fn ramp(bounds: Bounds, start: f64, end: f64) -> Result<Profile, Unfit> {
        if !(bounds.make_sense() && start.is_finite() && end.is_finite()) {
            return Err(Unfit::Nonsense);
        }
        if start * end < 0.0 {
            return Err(Unfit::WrongWay);
        }
        let sign = if start + end < 0.0 { -1.0 } else { 1.0 };
        let (start, end) = (sign * start, sign * end);
        let distance = way(&bounds, start, end);
        Ok(Profile::over(&bounds, distance, [start, fmax(start, end), end], sign))
    }

    fn over(bounds: &Bounds, distance: f64, [start, peak, end]: [f64; 3], sign: f64) -> Profile {
        let (up, down) = (Change::new(bounds, start, peak), Change::new(bounds, peak, end));
        let left =
            fmax(distance - up.seconds() * (start + peak) / 2.0 - down.seconds() * (peak + end) / 2.0, 0.0);
        let cruise = if peak > 0.0 { left / peak } else { 0.0 };
        let mut profile = Profile {
            segments: [Segment::default(); 7],
            seconds: 0.0,
            end: State { position: distance, velocity: end, ..State::default() },
            peak: sign * peak,
            sign,
        };
        let mut now = State { velocity: start, ..State::default() };
        now = profile.change(0, now, up, peak);
        profile.segments[3] = Segment { begins: profile.seconds, start: now };
        profile.seconds += cruise;
        now = now.after(cruise);
        profile.change(4, now, down, end);
        profile
    }

    /// Puts the three segments of a change from `first` on, and gives the state after them.
    fn change(&mut self, first: usize, from: State, change: Change, to: f64) -> State {
        let Change { growing, full, acceleration, jerk } = change;
        let mut position = from.position;
        let mut velocity = from.velocity;
        for (i, seconds, acceleration, jerk) in
            [(0, growing, 0.0, jerk), (1, full, acceleration, 0.0), (2, growing, acceleration, -jerk)]
        {
            let start = State { position, velocity, acceleration, jerk };
            self.segments[first + i] = Segment { begins: self.seconds, start };
            self.seconds += seconds;
            let after = start.after(seconds);
            (position, velocity) = (after.position, after.velocity);
        }
        State { position, velocity: to, acceleration: 0.0, jerk: 0.0 }
    }

    /// Where the axis is to be `seconds` after the beginning: before it as it begins, from its end on as it ends, to the last bit.
    pub fn at(&self, seconds: f64) -> State {
        if seconds >= self.seconds {
            return self.end.times(self.sign);
        }
        let t = fmax(seconds, 0.0);
        let segment = self.segments.iter().rev().find(|segment| segment.begins <= t);
        segment.map_or(self.end, |segment| segment.start.after(t - segment.begins)).times(self.sign)
    }

    /// How long it takes (s).
    pub const fn seconds(&self) -> f64 {
        self.seconds
    }

    /// The way it covers (m), with its sign.
    pub const fn distance(&self) -> f64 {
        self.sign * self.end.position
    }

    /// The fastest it gets (m/s), with the sign of the way.
    pub const fn peak(&self) -> f64 {
        self.peak
    }
}

/// The highest velocity (m/s) that fits into `distance` (m): found by halving, as the way grows with it.
fn peak(bounds: &Bounds, distance: f64, start: f64, end: f64) -> f64 {
    let taken = |peak: f64| way(bounds, start, peak) + way(bounds, peak, end);
    let (mut low, mut high) = (fmax(start, end), bounds.velocity);
    if taken(high) <= distance {
        return high;
    }
    // 80 halvings are more than the digits of a velocity; what the last one leaves is cruised.
    for _ in 0..80 {
        let middle = (low + high) / 2.0;
        if middle <= low || middle >= high {
            break;
        }
        if taken(middle) <= distance { low = middle } else { high = middle }
    }
    fmin(low, high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use libm::{cbrt, pow};
    use proptest::prelude::*;

    fn close(a: f64, b: f64) -> bool {
        fabs(a - b) < 1e-9 * (1.0 + fabs(b))
    }

    #[test]
    fn a_trapezoid_takes_the_time_of_the_textbook() {
        let bounds = Bounds::trapezoid(0.3, 0.5);
        // d/v + v/a where 0.3 m/s is reached, 2 √(d/a) where it is not.
        for (distance, time) in [(2.0, 2.0 / 0.3 + 0.6), (0.18, 1.2), (0.08, 0.8), (-2.0, 2.0 / 0.3 + 0.6)] {
            let profile = Profile::new(bounds, distance).unwrap();
            assert!(close(profile.seconds(), time), "{distance}: {}", profile.seconds());
        }
        let profile = Profile::new(bounds, 2.0).unwrap();
        assert_eq!(profile.at(0.3).velocity, 0.15);
        assert!(close(profile.at(0.6).position, 0.09) && close(profile.at(3.0).velocity, 0.3));
        assert!(close(profile.at(3.0).position, 0.09 + 2.4 * 0.3));
    }

    #[test]
    fn an_s_curve_from_rest_to_rest_takes_the_time_of_its_closed_forms() {
        let (v, a, j) = (0.6, 0.5, 2.0);
        let bounds = Bounds { velocity: v, acceleration: a, jerk: j };
        // Both reached.
        let time = |d: f64| Profile::new(bounds, d).unwrap().seconds();
        assert!(close(time(3.0), 3.0 / v + v / a + a / j), "{}", time(3.0));
        // The acceleration alone: v_p²/a + v_p a/j = d.
        let d = 0.3;
        let peak = (-a * a / j + sqrt(pow(a, 4.0) / (j * j) + 4.0 * a * d)) / 2.0;
        assert!(close(time(d), 2.0 * (peak / a + a / j)), "{}", time(d));
        assert!(close(Profile::new(bounds, d).unwrap().peak(), peak));
        // Neither: d = 2 j T_j³.
        assert!(close(time(0.01), 4.0 * cbrt(0.01 / (2.0 * j))), "{}", time(0.01));
        // The velocity alone, with more acceleration than it needs: T_j = √(v/j).
        let soft = Bounds { velocity: 0.6, acceleration: 5.0, jerk: 2.0 };
        let reached = Profile::new(soft, 3.0).unwrap().seconds();
        assert!(close(reached, 3.0 / 0.6 + 2.0 * sqrt(0.6 / 2.0)), "{reached}");
    }

    /// Biagiotti and Melchiorri, examples 3.9 to 3.11: ten units of way.
    #[test]
    fn the_double_s_of_the_textbook_comes_out() {
        let bounds = |velocity| Bounds { velocity, acceleration: 10.0, jerk: 30.0 };
        let profile = Profile::between(bounds(5.0), 10.0, 1.0, 0.0).unwrap();
        assert!(fabs(profile.seconds() - 2.7100) < 1e-4, "{}", profile.seconds());
        assert!(close(profile.peak(), 5.0));
        let begins = |i: usize| profile.segments[i].begins;
        for (i, time) in [(1, 0.3333), (3, 0.7333), (4, 0.7333 + 1.1433)] {
            assert!(fabs(begins(i) - time) < 2e-4, "{i}: {}", begins(i));
        }
        let profile = Profile::between(bounds(10.0), 10.0, 1.0, 0.0).unwrap();
        assert!(fabs(profile.peak() - 8.4136) < 1e-4 && fabs(profile.seconds() - 2.2494) < 1e-4);
        // The book lowers the acceleration of both changes until it fits, and takes 1.9384 s; one change alone need not be that slow.
        let profile = Profile::between(bounds(10.0), 10.0, 7.0, 0.0).unwrap();
        assert!(profile.seconds() < 1.9384, "{}", profile.seconds());
    }

    #[test]
    fn what_cannot_be_is_refused_with_its_reason() {
        let bounds = Bounds { velocity: 1.0, acceleration: 0.5, jerk: f64::INFINITY };
        // Braking from 1 m/s at 0.5 m/s² takes a metre.
        assert_eq!(Profile::between(bounds, 0.5, 1.0, 0.0), Err(Unfit::TooShort { needed: 1.0 }));
        assert_eq!(Profile::between(bounds, 5.0, 1.1, 0.0), Err(Unfit::TooFast));
        assert_eq!(Profile::between(bounds, -5.0, 0.5, 0.0), Err(Unfit::WrongWay));
        assert_eq!(Profile::ramp(bounds, -0.5, 0.5), Err(Unfit::WrongWay));
        assert_eq!(Profile::new(bounds, f64::NAN), Err(Unfit::Nonsense));
        assert_eq!(Profile::new(Bounds { jerk: 0.0, ..bounds }, 1.0), Err(Unfit::Nonsense));
        let exact = Profile::between(bounds, 1.0, 1.0, 0.0).unwrap();
        assert!(close(exact.seconds(), 2.0));
    }

    #[test]
    fn no_way_takes_no_time() {
        let profile = Profile::new(Bounds { velocity: 1.0, acceleration: 1.0, jerk: 5.0 }, 0.0).unwrap();
        assert_eq!((profile.seconds(), profile.at(0.0)), (0.0, State::default()));
    }

    #[test]
    fn a_ramp_down_is_the_stop_of_the_textbook() {
        // v²/2a and v/a; with jerk v/a + a/j, and half of that times v.
        let hard = Profile::ramp(Bounds::trapezoid(1.0, 1.0), 0.3, 0.0).unwrap();
        assert!(close(hard.distance(), 0.045) && close(hard.seconds(), 0.3));
        let soft = Profile::ramp(Bounds { velocity: 1.0, acceleration: 1.0, jerk: 10.0 }, -0.3, 0.0).unwrap();
        assert!(close(soft.seconds(), 0.4) && close(soft.distance(), -0.06), "{soft:?}");
        assert!(close(soft.at(0.2).velocity, -0.15));
    }

    fn bounds() -> impl Strategy<Value = Bounds> {
        (0.05f64..2., 0.05f64..3., prop_oneof![Just(f64::INFINITY), 0.05f64..20.])
            .prop_map(|(velocity, acceleration, jerk)| Bounds { velocity, acceleration, jerk })
    }

    proptest! {
        #[test]
        fn limits_are_kept_and_the_end_is_exact(
            bounds in bounds(), distance in -20f64..20., start in 0f64..1., end in 0f64..1.,
        ) {
            let sign = copysign(1.0, distance);
            let (start, end) = (sign * start * bounds.velocity, sign * end * bounds.velocity);
            let profile = match Profile::between(bounds, distance, start, end) {
                Err(Unfit::TooShort { needed }) => {
                    prop_assert!(needed > fabs(distance));
                    return Ok(());
                }
                other => other.unwrap(),
            };
            let dt = profile.seconds() / 2000.0;
            let mut before = profile.at(0.0);
            prop_assert!(before.position == 0.0 && close(before.velocity, start));
            for i in 1..=2000 {
                let now = profile.at(i as f64 * dt);
                prop_assert!(fabs(now.velocity) <= bounds.velocity + 1e-9);
                prop_assert!(fabs(now.acceleration) <= bounds.acceleration + 1e-9);
                prop_assert!(fabs(now.jerk) <= bounds.jerk + 1e-9);
                // It never turns back, and each value is the integral of the next.
                prop_assert!((now.position - before.position) * sign >= -1e-9);
                let mean = (now.velocity + before.velocity) / 2.0;
                let bend = bounds.acceleration * dt * dt;
                prop_assert!(fabs(now.position - before.position - mean * dt) <= bend + 1e-9);
                prop_assert!(fabs(now.velocity - before.velocity) <= bounds.acceleration * dt + 1e-9);
                prop_assert!(bounds.jerk.is_infinite()
                    || fabs(now.acceleration - before.acceleration) <= bounds.jerk * dt + 1e-9);
                before = now;
            }
            // What the segments add up to is where it shall end; a nanosecond before, nothing is missing yet.
            let almost = profile.at(profile.seconds() - 1e-12);
            prop_assert!(fabs(almost.position - distance) < 1e-9 && fabs(almost.velocity - end) < 1e-9, "{almost:?}");
            prop_assert_eq!(profile.at(profile.seconds()).position, distance);
            prop_assert!(close(profile.at(profile.seconds() + 1.0).velocity, end));
        }

        #[test]
        fn from_rest_to_rest_it_is_symmetric(bounds in bounds(), distance in 0.001f64..20., part in 0f64..1.) {
            let profile = Profile::new(bounds, distance).unwrap();
            let (t, whole) = (part * profile.seconds(), profile.seconds());
            let (early, late) = (profile.at(t), profile.at(whole - t));
            prop_assert!(fabs(early.position + late.position - distance) < 1e-9);
            prop_assert!(fabs(early.velocity - late.velocity) < 1e-6);
        }

        #[test]
        fn no_way_shorter_in_time_is_left(bounds in bounds(), distance in 0.001f64..20.) {
            // Every motion with a lower peak takes longer; and a higher peak has no room.
            let profile = Profile::new(bounds, distance).unwrap();
            let lower = Profile::new(Bounds { velocity: profile.peak() * 0.999, ..bounds }, distance).unwrap();
            prop_assert!(lower.seconds() > profile.seconds());
            let higher = profile.peak() * 1.001;
            prop_assert!(higher > bounds.velocity || 2.0 * way(&bounds, 0.0, higher) > distance);
        }
    }
}
