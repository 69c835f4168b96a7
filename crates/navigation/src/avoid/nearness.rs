//! The Nearness Diagram: what is near is sorted into one of six situations, and each has its way out.
//!
//! ```text
//!                        is anything nearer than the security distance?
//!                     no │                                   │ yes
//!        goal in region? │                     on which sides of the way?
//!       yes │         no │                        one │           │ both
//!         HSGR    region wide?          goal in region?          LS2
//!                yes │    │ no           yes │    │ no
//!                  HSWR  HSNR              LSGR  LS1
//! ```
//!
//! Minguez and Montano, IEEE Transactions on Robotics and Automation 20(1), 2004; the sixth situation, LSGR, is that of the ND+ (Minguez,
//! Osuna and Montano, ICRA 2004).

use libm::{atan2, fabs, fmax, fmin, hypot};
use types::Point;
use types::geometry::{PI, wrap};
use types::messages::{Avoidance, Situation, Twist};

use super::body::Body;
use super::regions::{Chosen, Passage, Regions, Side, turn};
use super::sectors::{SECTORS, Sectors, bearing};

/// How the robot avoids.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// The outline of the robot.
    pub body: Body,
    /// Security distance from the edge in front (m), positive: what is nearer pushes the robot away.
    pub security_front: f64,
    /// The same at the rear (m), positive; in between it grows evenly with the angle.
    pub security_rear: f64,
    /// Width of the smallest passage that is tried (m).
    pub passage: f64,
    /// What is farther than this from the edge is not looked at (m): d_max.
    pub reach: f64,
    /// Highest forward speed (m/s).
    pub linear_max: f64,
    /// Highest turn rate (rad/s).
    pub angular_max: f64,
    /// How much of the speed is left near obstacles: K_obs, not negative. The result never exceeds the highest speed.
    pub gain: f64,
    /// Nearer to the goal than this the robot has reached it (m).
    pub goal_tolerance: f64,
    /// Of a rectangular body, the shell in which nothing may be (m): inside it the robot stands.
    pub shell: f64,
}

impl Parameters {
    /// For a body, with the defaults of the driver of the robots on which the method was published.
    ///
    /// 0.5 m of security at a walking 0.3 m/s, and 45°/s. A passage must be as wide as the body, and a tenth more for the noise of a
    /// laser. 3 m are looked at: ten seconds of way. A gain of 1 is the published law. The goal is reached within half a metre, for whoever
    /// wants to come closer has a controller for that. The shell is 3 cm: less than what a gap of that width leaves.
    pub fn new(body: Body) -> Parameters {
        Parameters {
            body,
            security_front: 0.5,
            security_rear: 0.5,
            passage: 2.2 * body.half_width(),
            reach: 3.0,
            linear_max: 0.3,
            angular_max: PI / 4.0,
            gain: 1.0,
            goal_tolerance: 0.5,
            shell: 0.03,
        }
    }
}

/// The Nearness Diagram with its memory. A step allocates nothing.
#[derive(Clone, Debug)]
pub struct NearnessDiagram {
    parameters: Parameters,
    regions: Regions,
    side: Side,
    /// From the turning point to the edge, a sector: E.
    edges: [f64; SECTORS],
    /// Security distance, a sector: d_s.
    security: [f64; SECTORS],
}

/// What is nearest among some sectors.
#[derive(Clone, Copy, Debug)]
struct Near {
    /// Distance from the edge over the security distance.
    ratio: f64,
    sector: usize,
}

const FAR: Near = Near { ratio: 1.0, sector: SECTORS };

impl NearnessDiagram {
    /// An avoidance with these parameters.
    pub fn new(parameters: Parameters) -> NearnessDiagram {
        let security = |i: usize| {
            let back = fabs(bearing(i)) / PI;
            fmax(
                parameters.security_front + (parameters.security_rear - parameters.security_front) * back,
                1e-3,
            )
        };
        NearnessDiagram {
            parameters,
            regions: Regions::new(),
            side: Side::default(),
            edges: std::array::from_fn(|i| parameters.body.edge(bearing(i))),
            security: std::array::from_fn(security),
        }
    }

    /// How it avoids.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// The motion towards `goal` (m, as the robot sees it) among what is around; nothing is around for sure where no reading is given,
    /// so it stands.
    pub fn step(&mut self, around: Option<&Sectors>, goal: Point) -> Avoidance {
        let goal_bearing = atan2(goal.y, goal.x);
        let quiet = Avoidance {
            goal: goal_bearing,
            left: 1.0,
            right: 1.0,
            nearest: f64::INFINITY,
            ..Avoidance::default()
        };
        let Some(around) = around.filter(|_| goal.x.is_finite() && goal.y.is_finite()) else {
            return quiet;
        };
        let distances = around.distances();
        let (nearest, nearest_bearing) = self.nearest(distances);
        let seen = Avoidance { nearest, nearest_bearing, ..quiet };
        if hypot(goal.x, goal.y) <= self.parameters.goal_tolerance {
            return Avoidance { situation: Situation::AtGoal, ..seen };
        }
        if nearest <= self.shell() {
            return Avoidance { situation: Situation::Touching, ..seen };
        }
        let passage = self.passage();
        self.regions.find(distances, &passage);
        match self.regions.choose(distances, goal, &passage, self.side) {
            Some(chosen) => self.act(distances, &chosen, seen),
            None => Avoidance { situation: Situation::NoWay, ..seen },
        }
    }

    /// Forgets on which side it goes round what is in the way: for another goal another one may be better.
    pub fn forget(&mut self) {
        self.side = Side::default();
    }

    fn passage(&self) -> Passage {
        let Parameters { passage, reach, security_front, body, .. } = self.parameters;
        Passage { width: passage, horizon: reach + body.half_width(), security: security_front }
    }

    /// A round body may turn with something at its edge; a rectangular one may not.
    fn shell(&self) -> f64 {
        match self.parameters.body {
            Body::Round { .. } => 0.0,
            Body::Rectangle { .. } => self.parameters.shell,
        }
    }

    /// Distance from the edge to what is nearest (m), and where that is (rad).
    fn nearest(&self, distances: &[f64; SECTORS]) -> (f64, f64) {
        nearest(&self.parameters.body, &self.edges, distances)
    }

    /// The motion into the chosen region.
    fn act(&mut self, distances: &[f64; SECTORS], chosen: &Chosen, seen: Avoidance) -> Avoidance {
        let (left, right) = self.dangers(distances, chosen.free);
        let situation = situation(chosen, left, right);
        self.side.keep(chosen, situation == Situation::HighSafetyGoalInRegion);
        let wanted = match situation {
            Situation::LowSafetyOneSide | Situation::LowSafetyGoalInRegion => {
                let near = if left.ratio < 1.0 { left } else { right };
                away_from_one(chosen.free, near.ratio, bearing(near.sector))
            }
            Situation::LowSafetyTwoSides => between_two(chosen.free, left.ratio, right.ratio),
            _ => chosen.free,
        };
        let direction = wanted.clamp(-PI / 2.0, PI / 2.0);
        let (region_right, region_left) = chosen.region.ends();
        let twist = speed(&self.parameters, direction, fmin(left.ratio, right.ratio));
        Avoidance {
            situation,
            twist: self.guarded(distances, twist),
            direction,
            free: chosen.free,
            region_right,
            region_left,
            left: left.ratio,
            right: right.ratio,
            ..seen
        }
    }

    /// The most dangerous obstacles to the left and to the right of a direction.
    fn dangers(&self, distances: &[f64; SECTORS], way: f64) -> (Near, Near) {
        let (mut left, mut right) = (FAR, FAR);
        for sector in 0..SECTORS {
            // Most are farther away.
            let beyond = distances[sector] - self.edges[sector];
            if beyond >= self.security[sector] {
                continue;
            }
            let near = Near { ratio: fmax(beyond / self.security[sector], 0.0), sector };
            let side = if turn(way, bearing(sector)) >= 0.0 { &mut left } else { &mut right };
            if near.ratio < side.ratio {
                *side = near;
            }
        }
        (left, right)
    }

    /// What of a motion a rectangular body may do: beside its rear half nothing may be swept, and what stands at a corner in front
    /// lets it only turn.
    fn guarded(&self, distances: &[f64; SECTORS], twist: Twist) -> Twist {
        let Body::Rectangle { front, half_width, .. } = self.parameters.body else { return twist };
        let (mut twist, shell) = (twist, self.parameters.shell);
        for sector in 0..SECTORS {
            if distances[sector] - self.edges[sector] > 4.0 * shell {
                continue;
            }
            let point = Point::polar(distances[sector], bearing(sector));
            let beside = fabs(point.y) - half_width;
            // The rear swings to the other side than the front.
            let swept = point.y * twist.angular < 0.0;
            if point.x < 0.0 && beside >= 0.0 && beside < 2.0 * shell && swept {
                twist.angular = 0.0;
            }
            if hypot(point.x - front, beside) < 2.0 * shell {
                twist.linear = 0.0;
            }
        }
        twist
    }
}

/// Distance from the edge to what is nearest (m), and where that is (rad).
pub(super) fn nearest(body: &Body, edges: &[f64; SECTORS], distances: &[f64; SECTORS]) -> (f64, f64) {
    let mut best = (f64::INFINITY, 0.0);
    for sector in 0..SECTORS {
        // The way along the sector is never shorter than the shortest, nor by more than the corner of a body makes it.
        if distances[sector] - edges[sector] < best.0 * 2.0 {
            let distance = match body {
                Body::Round { radius } => distances[sector] - radius,
                Body::Rectangle { .. } => body.distance(Point::polar(distances[sector], bearing(sector))),
            };
            if distance < best.0 {
                best = (distance, bearing(sector));
            }
        }
    }
    best
}

fn situation(chosen: &Chosen, left: Near, right: Near) -> Situation {
    match (left.ratio < 1.0, right.ratio < 1.0) {
        (true, true) => Situation::LowSafetyTwoSides,
        (false, false) if chosen.goal_in => Situation::HighSafetyGoalInRegion,
        (false, false) if chosen.region.is_wide() => Situation::HighSafetyWideRegion,
        (false, false) => Situation::HighSafetyNarrowRegion,
        _ if chosen.goal_in => Situation::LowSafetyGoalInRegion,
        _ => Situation::LowSafetyOneSide,
    }
}

/// θ = c θ_p + (1 − c) θ_o′, where θ_o′ is opposite to the obstacle, unwrapped next to θ_p, and c = d_r/d_s of the obstacle.
fn away_from_one(free: f64, ratio: f64, obstacle: f64) -> f64 {
    let opposite = free + turn(free, wrap(obstacle + PI));
    ratio * free + (1.0 - ratio) * opposite
}

/// θ = θ_d + (c_l − c_r)/(c_l + c_r) (π/2 ± θ_d): towards the side where there is more room, at most a right angle to it.
fn between_two(free: f64, left: f64, right: f64) -> f64 {
    let sum = left + right;
    let lean = if sum > 0.0 { (left - right) / sum } else { 0.0 };
    if left <= right { free + lean * (free + PI / 2.0) } else { free + lean * (PI / 2.0 - free) }
}

/// The law of the speed:
///
/// ```text
/// v = v_max · min(K_obs · d_obs/d_safe, 1) · (π/2 − |φ|)/(π/2)      ω = ω_max · φ/(π/2)
/// ```
///
/// with the direction φ, and d_obs/d_safe held within 0 to 1: nearer than the edge nothing can be, and what is farther than the security
/// distance takes no speed.
pub fn speed(parameters: &Parameters, direction: f64, ratio: f64) -> Twist {
    let straight = fmax((PI / 2.0 - fabs(direction)) / (PI / 2.0), 0.0);
    let room = ratio.clamp(0.0, 1.0);
    let room = if room < 1.0 { fmin(parameters.gain * room, 1.0) } else { 1.0 };
    Twist::new(
        parameters.linear_max * room * straight,
        parameters.angular_max * (direction / (PI / 2.0)).clamp(-1.0, 1.0),
    )
}
