//! Closed-loop steering of a unicycle to a pose: two laws on the same polar coordinates.
//!
//! ```text
//!              goal frame: x along the wanted final heading
//!                 ▲ y
//!      body       │                  e  distance from the body to the goal (m), not negative
//!        ◯────────│──▶ e             θ  direction of that way in the goal frame (rad)
//!         ╲ α  θ  │                  φ  heading of the body in the goal frame (rad)
//!          ▶      ✕───────▶ x        α  = θ − φ, the way seen from the body (rad)
//!
//!      e′ = −v cos α      α′ = −ω + v sin α / e      θ′ = v sin α / e
//! ```
//!
//! [`Law::Aicardi`] (Aicardi, Casalino, Bicchi, Balestrino, *Closed loop steering of unicycle-like vehicles via Lyapunov techniques*,
//! IEEE Robotics & Automation Magazine 2(1), 1995):
//!
//! ```text
//! v = γ e cos α                 ω = k α + γ (cos α sin α / α) (α + h θ)             γ, k, h > 0
//! ```
//!
//! With V = (λ e² + α² + h θ²)/2, λ > 0, it makes V′ = −λ γ e² cos²α − k α² ≤ 0, so (e, α, θ) → 0 from every start with e > 0. Near
//! the goal the poles are −γ and those of s² + k s + γ² h. It backs up while the goal lies behind.
//!
//! [`Law::Linear`] (Astolfi, *Exponential stabilization of a car-like vehicle*, ICRA 1995; Siegwart, Nourbakhsh, *Introduction to
//! Autonomous Mobile Robots*, ch. 3), with β = −θ:
//!
//! ```text
//! v = k_ρ e                     ω = k_α α + k_β β                                   k_ρ > 0, k_β < 0, k_α > k_ρ
//! ```
//!
//! Near the goal the poles are −k_ρ and those of s² + (k_α − k_ρ) s − k_ρ k_β. With k_α + (5/3) k_β − (2/π) k_ρ > 0 as well, a goal ahead
//! stays ahead, so it never changes direction. It drives forward always, and draws a loop to a goal behind.
//!
//! Where both are not defined or jump: sin α / α is its series near 0; at |α| = π or |θ| = π the sign of the step before is kept for a
//! while, so noise does not make the body swing; at e = 0 there is no direction, so within [`Parameters::near`] steering is over.

use crate::kinematics::{Twist, is_finite, scaled};
use libm::{fabs, fmax, hypot, sincos};
use types::Pose;
use types::geometry::{PI, TAU, wrap};

/// How the goal lies to the body. The angles are in [−π, π], and beyond by as much as the sign of the step before is kept.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Polar {
    /// e: distance to the goal (m).
    pub distance: f64,
    /// θ: direction of the way to the goal in the goal's frame (rad).
    pub theta: f64,
    /// α: direction of that way seen from the body (rad).
    pub alpha: f64,
}

impl Polar {
    /// How `goal` lies to a body at `pose`, both given in one frame. At the goal itself the way is taken to lead along the heading.
    pub fn of(pose: Pose, goal: Pose) -> Polar {
        let way = goal.position() - pose.position();
        let distance = hypot(way.x, way.y);
        let bearing = if distance > 0.0 { way.bearing() } else { pose.heading };
        Polar { distance, theta: wrap(bearing - goal.heading), alpha: wrap(bearing - pose.heading) }
    }

    /// The same with forward and backward exchanged, for the body as for the goal.
    fn mirrored(self) -> Polar {
        Polar { theta: wrap(self.theta + PI), alpha: wrap(self.alpha + PI), ..self }
    }
}

/// Which law steers, and its gains. A gain h or −k_β of 0 gives up the final heading: only the position is reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// Aicardi's: smooth from everywhere, forward and backward.
    Aicardi {
        /// γ (1/s): speed for a metre of distance.
        gamma: f64,
        /// k (1/s): how fast the body turns to the way.
        k: f64,
        /// h: how much the final heading counts.
        h: f64,
    },
    /// Linear in all three coordinates: one direction of driving.
    Linear {
        /// k_ρ (1/s): speed for a metre of distance.
        rho: f64,
        /// k_α (1/s): how fast the body turns to the way.
        alpha: f64,
        /// k_β (1/s), negative: how much the final heading counts.
        beta: f64,
    },
}

impl Law {
    /// Aicardi's with all poles at −`rate` (1/s): k = 2 γ √h with h = 1.
    pub const fn aicardi(rate: f64) -> Law {
        Law::Aicardi { gamma: rate, k: 2.0 * rate, h: 1.0 }
    }

    /// The linear one with the book's ratio of gains, 3 : 8 : −1.5, and k_ρ = `rate` (1/s).
    pub const fn linear(rate: f64) -> Law {
        Law::Linear { rho: rate, alpha: rate * 8.0 / 3.0, beta: -rate / 2.0 }
    }

    /// The same law for a goal without a heading.
    pub fn to_a_point(self) -> Law {
        match self {
            Law::Aicardi { gamma, k, .. } => Law::Aicardi { gamma, k, h: 0.0 },
            Law::Linear { rho, alpha, .. } => Law::Linear { rho, alpha, beta: 0.0 },
        }
    }

    /// What the law orders, without any limit.
    pub fn twist(self, at: Polar) -> Twist {
        match self {
            Law::Aicardi { gamma, k, h } => {
                let (sine, cosine) = sincos(at.alpha);
                let bend = gamma * cosine * sine_ratio(at.alpha, sine);
                Twist::new(gamma * at.distance * cosine, k * at.alpha + bend * (at.alpha + h * at.theta))
            }
            Law::Linear { rho, alpha, beta } => {
                Twist::new(rho * at.distance, alpha * at.alpha - beta * at.theta)
            }
        }
    }

    /// V of Aicardi's law with λ = 1, which never grows under it; `None` for the linear law, which has none of that form.
    pub fn lyapunov(self, at: Polar) -> Option<f64> {
        match self {
            Law::Aicardi { h, .. } => {
                let square = |x: f64| x * x;
                Some((square(at.distance) + square(at.alpha) + h * square(at.theta)) / 2.0)
            }
            Law::Linear { .. } => None,
        }
    }

    fn turn_gain(self) -> f64 {
        match self {
            Law::Aicardi { k, .. } => k,
            Law::Linear { alpha, .. } => alpha,
        }
    }
}

/// sin a / a, given a and its sine.
pub(crate) fn sine_ratio(angle: f64, sine: f64) -> f64 {
    if fabs(angle) < 1e-4 { 1.0 - angle * angle / 6.0 } else { sine / angle }
}

/// Scales both parts of `wish` by one factor so that neither is above its limit (m/s, rad/s): the shape of the path is kept, and V of
/// Aicardi's law still never grows.
pub fn saturated(wish: Twist, linear_max: f64, angular_max: f64) -> Twist {
    scaled(wish, 1.0 / fmax(fmax(fabs(wish.linear) / linear_max, fabs(wish.angular) / angular_max), 1.0))
}

/// What to do about a goal that lies behind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Behind {
    /// As the law has it: Aicardi's backs up, the linear one drives forward in a loop.
    AsLaw,
    /// Back up. The linear law exchanges forward and backward, and stays with that.
    Reverse,
    /// Turn in place until the goal is ahead, and drive forward only.
    #[default]
    Rotate,
}

/// How to steer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// The law and its gains.
    pub law: Law,
    /// What to do about a goal behind.
    pub behind: Behind,
    /// Highest speed (m/s), forward and backward.
    pub linear_max: f64,
    /// Highest turn rate (rad/s).
    pub angular_max: f64,
    /// Within this distance of the goal (m) steering is over: there the direction to it is noise.
    pub near: f64,
    /// How far an angle may go beyond ±π before its sign changes (rad); also how far beyond a right angle the goal must be to be turned
    /// to in place.
    pub hysteresis: f64,
}

impl Default for Parameters {
    /// For an indoor base.
    ///
    /// 0.3 m/s and 90 °/s are what the reactive layer's robot drove with. A rate of 1/s slows down over the last 0.3 m and bears
    /// a hold of the command of 0.3 s. A robot that sees only ahead turns first. A centimetre is half of what a goal allows. 0.2 rad are
    /// more than a localizer's noise at a decimetre from the goal.
    fn default() -> Parameters {
        Parameters {
            law: Law::aicardi(1.0),
            behind: Behind::Rotate,
            linear_max: 0.3,
            angular_max: PI / 2.0,
            near: 0.01,
            hysteresis: 0.2,
        }
    }
}

/// What steering does just now.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Mode {
    /// It drives.
    #[default]
    Driving,
    /// It turns in place towards the goal.
    Rotating,
    /// It is near: the goal's position is reached, and nothing is ordered.
    Near,
}

/// The order of one step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Order {
    /// What is to be driven.
    pub twist: Twist,
    /// What that is.
    pub mode: Mode,
    /// How the goal lay.
    pub polar: Polar,
}

/// Steering to one goal, or to one that moves slowly. It remembers signs only.
#[derive(Clone, Copy, Debug)]
pub struct Steering {
    parameters: Parameters,
    last: Option<Polar>,
    rotating: bool,
    backward: bool,
}

impl Steering {
    /// Nothing remembered.
    pub const fn new(parameters: Parameters) -> Steering {
        Steering { parameters, last: None, rotating: false, backward: false }
    }

    /// The same, with nothing remembered: for another goal.
    pub const fn forgotten(&self) -> Steering {
        Steering::new(self.parameters)
    }

    /// The order for a body at `pose` on the way to `goal`, both given in one frame. What is not finite stands still.
    pub fn step(&mut self, pose: Pose, goal: Pose) -> Order {
        let p = self.parameters;
        let polar = self.unrolled(Polar::of(pose, goal));
        if polar.distance <= p.near {
            return Order { twist: Twist::ZERO, mode: Mode::Near, polar };
        }
        self.look_behind(polar);
        let wish = if self.rotating {
            Twist::new(0.0, p.law.turn_gain() * polar.alpha)
        } else if self.backward {
            let forward = p.law.twist(polar.mirrored());
            Twist::new(-forward.linear, forward.angular)
        } else {
            p.law.twist(polar)
        };
        if !is_finite(wish) {
            *self = Steering::new(p);
            return Order { polar, ..Order::default() };
        }
        let mode = if self.rotating { Mode::Rotating } else { Mode::Driving };
        Order { twist: saturated(wish, p.linear_max, p.angular_max), mode, polar }
    }

    /// The angles with the signs of the step before, where they are near ±π.
    fn unrolled(&mut self, now: Polar) -> Polar {
        let band = self.parameters.hysteresis;
        let now = self.last.map_or(now, |last| Polar {
            distance: now.distance,
            theta: nearer(last.theta, now.theta, band),
            alpha: nearer(last.alpha, now.alpha, band),
        });
        self.last = Some(now);
        now
    }

    /// Whether to turn in place, and whether to take backward for forward.
    ///
    /// Both laws keep a goal ahead that is ahead, so the turn in place happens once.
    fn look_behind(&mut self, at: Polar) {
        let p = self.parameters;
        let (off, aside) = (fabs(at.alpha), PI / 2.0);
        match (p.behind, p.law) {
            (Behind::Rotate, _) => {
                let turns_until = if self.rotating { aside - p.hysteresis } else { aside };
                self.rotating = off > turns_until;
            }
            (Behind::Reverse, Law::Linear { .. }) => {
                let turns_at = if self.backward { aside - p.hysteresis } else { aside + p.hysteresis };
                self.backward = off > turns_at;
            }
            _ => {}
        }
    }
}

/// `angle` or the same a turn on, whichever is nearer to `last` without going beyond π by more than `band`.
fn nearer(last: f64, angle: f64, band: f64) -> f64 {
    let other = if angle < 0.0 { angle + TAU } else { angle - TAU };
    if fabs(other) <= PI + band && fabs(other - last) < fabs(angle - last) { other } else { angle }
}

#[cfg(test)]
mod tests;
