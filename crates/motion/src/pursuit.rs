//! Following what a camera on a turning head sees: the head keeps it in the middle, the feet come close.
//!
//! ```text
//!          target seen                          share ≥ wanted
//!  ┌──────┐ ────────▶ ┌──────────┐ ──────────────────────────────▶ ┌─────────┐
//!  │ Idle │           │ Tracking │ ◀────────────────────────────── │ Arrived │
//!  └──────┘           └──────────┘  share < wanted less hysteresis └─────────┘
//!     ▲                lost │ ▲ seen
//!     │                     ▼ │
//!     │  patience over ┌───────────┐
//!     └─────────────── │ Searching │  turns to the side where it was last
//!                      └───────────┘
//! ```

use crate::kinematics::Twist;
use libm::{cos, fabs, fmax, fmin, sqrt};
use types::geometry::{PI, wrap};
use types::messages::Head;

/// What the camera sees of the target.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sighting {
    /// To the left of the picture's middle (rad).
    pub bearing: f64,
    /// Above the picture's middle (rad).
    pub elevation: f64,
    /// Share of the picture's area, above 0 up to 1.
    pub share: f64,
}

/// How to pursue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// Rate of the head for 1 rad off the middle (1/s).
    pub head_gain: f64,
    /// Highest rate of the head (rad/s).
    pub head_max: f64,
    /// The head's reach to each side (rad), and up and down.
    pub pan_max: f64,
    /// Up and down (rad).
    pub tilt_max: f64,
    /// Turn rate of the body for 1 rad between its heading and the target (1/s).
    pub turn_gain: f64,
    /// Highest turn rate (rad/s).
    pub turn_max: f64,
    /// Off by less than this, the body does not turn (rad).
    pub straight: f64,
    /// Share of the picture at which the robot is close enough.
    pub share_wanted: f64,
    /// It comes closer again when the share has fallen by this part of the wanted one.
    pub hysteresis: f64,
    /// Speed for being twice as far away as wanted (m/s).
    pub approach: f64,
    /// Highest speed (m/s).
    pub linear_max: f64,
    /// Speed of backing off when it is much too close (m/s); 0 for never.
    pub back_off: f64,
    /// How long it looks for a lost target (s).
    pub patience: f64,
    /// Turn rate while it looks for it (rad/s).
    pub search_turn: f64,
}

impl Default for Parameters {
    /// A camera at 15 pictures a second and an indoor base.
    ///
    /// A head gain of 3/s halves the error in four pictures and stays stable with two pictures of delay (3 · 0.13 s < π/2); the body is
    /// half as fast, so the head leads. 3° of straight is about the jitter of a blob's centre. A tenth of the picture is a thing of
    /// 0.3 m at about 1 m for a lens of 50°. 15 % of hysteresis is more than the noise of a blob's area. Never back off: few robots see
    /// behind. Five seconds at 0.6 rad/s look half around.
    fn default() -> Parameters {
        Parameters {
            head_gain: 3.0,
            head_max: 1.5,
            pan_max: PI / 2.0,
            tilt_max: 0.5,
            turn_gain: 1.5,
            turn_max: 1.0,
            straight: 0.05,
            share_wanted: 0.1,
            hysteresis: 0.15,
            approach: 0.3,
            linear_max: 0.4,
            back_off: 0.0,
            patience: 5.0,
            search_turn: 0.6,
        }
    }
}

/// What the pursuit is about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Mode {
    /// Nothing to pursue, or it was given up.
    #[default]
    Idle,
    /// Towards the target.
    Tracking,
    /// Close enough: only head and heading follow.
    Arrived,
    /// Turning to where the target was last.
    Searching,
}

/// What head and feet are to do.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Orders {
    /// Rate of the head to the left (rad/s).
    pub pan_rate: f64,
    /// Rate of the head upwards (rad/s).
    pub tilt_rate: f64,
    /// Motion of the body.
    pub twist: Twist,
    /// What it is about.
    pub mode: Mode,
}

/// The pursuit of one target. One `step` a picture.
#[derive(Clone, Copy, Debug)]
pub struct Pursuit {
    parameters: Parameters,
    mode: Mode,
    last_side: f64,
    lost_for: f64,
}

impl Pursuit {
    /// Idle until a target is seen.
    pub const fn new(parameters: Parameters) -> Pursuit {
        Pursuit { parameters, mode: Mode::Idle, last_side: 1.0, lost_for: 0.0 }
    }

    /// What it is about.
    pub const fn mode(&self) -> Mode {
        self.mode
    }

    /// The orders for a picture taken with the head at `head`, `dt` (s) after the one before.
    ///
    /// With image bearing b and pan p the target lies at p + b from the body's heading. The head turns by gain · b less the body's own
    /// turn, which carries it along. A target of fixed size has a share that falls with the square of its distance d, so
    /// d / d_wanted = √(share_wanted / share), and the speed is proportional to d / d_wanted − 1, less while it is not ahead.
    pub fn step(&mut self, seen: Option<Sighting>, head: Head, dt: f64) -> Orders {
        let usable = |s: &Sighting| s.bearing.is_finite() && s.elevation.is_finite() && s.share > 0.0;
        match seen.filter(usable) {
            Some(sighting) => self.track(sighting, head),
            None => self.miss(head, fmax(dt, 0.0)),
        }
    }

    fn track(&mut self, seen: Sighting, head: Head) -> Orders {
        let p = self.parameters;
        let direction = wrap(head.pan + seen.bearing);
        self.lost_for = 0.0;
        self.last_side = if direction < 0.0 { -1.0 } else { 1.0 };
        let close =
            if self.mode == Mode::Arrived { p.share_wanted * (1.0 - p.hysteresis) } else { p.share_wanted };
        self.mode = if seen.share >= close { Mode::Arrived } else { Mode::Tracking };
        let turn =
            if fabs(direction) > p.straight { bound(p.turn_gain * direction, p.turn_max) } else { 0.0 };
        Orders {
            pan_rate: within(bound(p.head_gain * seen.bearing - turn, p.head_max), head.pan, p.pan_max),
            tilt_rate: within(bound(p.head_gain * seen.elevation, p.head_max), head.tilt, p.tilt_max),
            twist: Twist::new(self.speed(seen.share, direction), turn),
            mode: self.mode,
        }
    }

    fn speed(&self, share: f64, direction: f64) -> f64 {
        let p = self.parameters;
        let farther = sqrt(p.share_wanted / share) - 1.0;
        match self.mode {
            Mode::Tracking => fmin(p.approach * fmax(farther, 0.0), p.linear_max) * fmax(cos(direction), 0.0),
            // Much too close is at less than four fifths of the wanted distance.
            Mode::Arrived if farther < -0.2 => -p.back_off,
            _ => 0.0,
        }
    }

    fn miss(&mut self, head: Head, dt: f64) -> Orders {
        let p = self.parameters;
        if self.mode != Mode::Idle {
            self.lost_for += dt;
            self.mode = if self.lost_for <= p.patience { Mode::Searching } else { Mode::Idle };
        }
        let turn = if self.mode == Mode::Searching { p.search_turn * self.last_side } else { 0.0 };
        // The head goes back to the middle: from there it sees as much to both sides, and its pan tells nothing false later.
        Orders {
            pan_rate: bound(-p.head_gain / 3.0 * head.pan, p.head_max / 3.0),
            tilt_rate: bound(-p.head_gain / 3.0 * head.tilt, p.head_max / 3.0),
            twist: Twist::new(0.0, turn),
            mode: self.mode,
        }
    }
}

fn bound(value: f64, most: f64) -> f64 {
    fmin(fmax(value, -most), most)
}

/// No rate that would press the head against its stop.
fn within(rate: f64, angle: f64, most: f64) -> f64 {
    if fabs(angle) >= most && rate * angle > 0.0 { 0.0 } else { rate }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use types::{Point, Pose};

    const PICTURE: f64 = 1.0 / 15.0;

    /// A target of 0.3 m at distance d fills 0.1/d² of the picture; the camera sees 25° to each side.
    fn sight(pose: Pose, pan: f64, target: Point) -> Option<Sighting> {
        let seen = pose.inverse().transform(target);
        let bearing = wrap(seen.bearing() - pan);
        let share = fmin(0.1 / (seen.norm() * seen.norm()), 1.0);
        (fabs(bearing) < 0.436).then_some(Sighting { bearing, elevation: 0.0, share })
    }

    #[test]
    fn it_never_backs_off_unless_asked() {
        let close = Some(Sighting { bearing: 0.0, elevation: 0.0, share: 0.5 });
        assert_eq!(
            Pursuit::new(Parameters::default()).step(close, Head::default(), PICTURE).twist.linear,
            0.0
        );
        let asked = Parameters { back_off: 0.1, ..Parameters::default() };
        assert_eq!(Pursuit::new(asked).step(close, Head::default(), PICTURE).twist.linear, -0.1);
    }

    #[test]
    fn a_lost_target_is_sought_where_it_was_last_and_then_given_up() {
        let mut pursuit = Pursuit::new(Parameters::default());
        assert_eq!(pursuit.step(None, Head::default(), PICTURE), Orders::default());
        let right = Some(Sighting { bearing: -0.3, elevation: 0.0, share: 0.01 });
        pursuit.step(right, Head::default(), PICTURE);
        let orders = pursuit.step(None, Head::default(), 1.0);
        assert_eq!((orders.mode, orders.twist), (Mode::Searching, Twist::new(0.0, -0.6)));
        let orders = pursuit.step(None, Head::default(), 4.5);
        assert_eq!((orders.mode, orders.twist), (Mode::Idle, Twist::ZERO));
    }

    #[test]
    fn arriving_has_a_hysteresis() {
        let mut pursuit = Pursuit::new(Parameters::default());
        let modes = [0.099, 0.1, 0.09, 0.084].map(|share| {
            pursuit
                .step(Some(Sighting { bearing: 0.0, elevation: 0.0, share }), Head::default(), PICTURE)
                .mode
        });
        assert_eq!(modes, [Mode::Tracking, Mode::Arrived, Mode::Arrived, Mode::Tracking]);
    }

    proptest! {
        #[test]
        fn a_target_is_centred_and_reached_but_not_touched(bearing in -0.4f64..0.4, distance in 1.2f64..5., pan in -0.8f64..0.8) {
            let mut pursuit = Pursuit::new(Parameters::default());
            let target = Point::polar(distance, bearing + pan);
            let (mut pose, mut head) = (Pose::default(), Head { pan, ..Head::default() });
            for _ in 0..(40.0 / PICTURE) as usize {
                let orders = pursuit.step(sight(pose, head.pan, target), head, PICTURE);
                prop_assert!(orders.mode == Mode::Tracking || orders.mode == Mode::Arrived, "lost it");
                pose = pose.advanced(orders.twist.linear, orders.twist.angular, PICTURE);
                head.pan += orders.pan_rate * PICTURE;
                prop_assert!(pose.position().distance(target) > 0.95);
            }
            let last = sight(pose, head.pan, target).unwrap();
            prop_assert!(fabs(last.bearing) < 0.02, "off by {}", last.bearing);
            prop_assert!(fabs(wrap(pose.inverse().transform(target).bearing())) < 0.06);
            // The approach is exponential: after 40 s what is left is a few centimetres.
            prop_assert!(pose.position().distance(target) < 1.05, "{}", pose.position().distance(target));
        }
    }
}
