//! The smooth Nearness Diagram: one rule for all situations, so nothing jumps where one situation becomes another.
//!
//! With the free way θ_d, the distance D_i of what is nearest in sector i, that of the edge E_i, and d_min = min (D_i − E_i):
//!
//! ```text
//! D_s = clamp(5 d_min, 0, D_s,max)              how far threats reach; it shrinks where it is narrow
//! s_i = clamp((D_s + E_i − D_i)/D_s, 0, 1)      the threat of a sector
//! Δ   = Σ s_i³ · turn(θ_d → θ_i + π) / Σ s_i²   each threat turns the way to its other side
//! θ   = clamp(θ_d + Δ, ±π/2)
//! ω   = ω_max θ/(π/2)
//! v   = v_max · [2 d_goal] · [d_min/D_s,max] · [(π/6 − |θ|)/(π/6)]      each bracket held within 0 to 1
//! ```
//!
//! Durham and Bullo, IROS 2008.

use libm::{asin, atan2, fabs, fmax, fmin, hypot};
use types::Point;
use types::geometry::{PI, wrap};
use types::messages::{Avoidance, Situation, Twist};

use super::body::Body;
use super::nearness::nearest;
use super::regions::{Chosen, Passage, Region, Regions, Side, rising_edge, turn};
use super::sectors::{SECTORS, Sectors, bearing};

/// How the robot avoids.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// The outline of the robot.
    pub body: Body,
    /// How far from the edge an obstacle is a threat at most (m): D_s,max.
    pub security: f64,
    /// Width of the smallest passage that is tried (m).
    pub passage: f64,
    /// What is farther than this from the turning point is not looked at (m): d_max.
    pub reach: f64,
    /// Highest forward speed (m/s).
    pub linear_max: f64,
    /// Highest turn rate (rad/s).
    pub angular_max: f64,
    /// Nearer to the goal than this the robot has reached it (m).
    pub goal_tolerance: f64,
}

impl Parameters {
    /// For a body, with the published defaults: threats reach four radii far, a passage is two radii wide, 0.5 m/s and 60°/s, and the goal is
    /// reached within half a radius. 3 m are looked at: six seconds of way.
    pub fn new(body: Body) -> Parameters {
        let radius = body.half_width();
        Parameters {
            body,
            security: 4.0 * radius,
            passage: 2.0 * radius,
            reach: 3.0,
            linear_max: 0.5,
            angular_max: PI / 3.0,
            goal_tolerance: radius / 2.0,
        }
    }
}

/// The smooth Nearness Diagram with its memory. A step allocates nothing.
#[derive(Clone, Debug)]
pub struct SmoothNearness {
    parameters: Parameters,
    regions: Regions,
    side: Side,
    edges: [f64; SECTORS],
}

impl SmoothNearness {
    /// An avoidance with these parameters.
    pub fn new(parameters: Parameters) -> SmoothNearness {
        SmoothNearness {
            parameters,
            regions: Regions::new(),
            side: Side::default(),
            edges: std::array::from_fn(|i| parameters.body.edge(bearing(i))),
        }
    }

    /// How it avoids.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// The motion towards `goal` (m, as the robot sees it) among what is around; without a reading it stands.
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
        let (nearest, nearest_bearing) = nearest(&self.parameters.body, &self.edges, distances);
        let seen = Avoidance { nearest, nearest_bearing, ..quiet };
        let distance = hypot(goal.x, goal.y);
        if distance <= self.parameters.goal_tolerance {
            return Avoidance { situation: Situation::AtGoal, ..seen };
        }
        let passage = Passage {
            width: self.parameters.passage,
            horizon: self.parameters.reach,
            security: self.parameters.security,
        };
        self.regions.find(distances, &passage);
        let free = self.free_way(distances, goal, &passage);
        let Some((chosen, free)) = free else {
            return Avoidance { situation: Situation::NoWay, ..seen };
        };
        let out = self.act(distances, &chosen, free, distance, seen);
        self.side.keep(&chosen, out.left.min(out.right) >= 1.0);
        out
    }

    /// Forgets on which side it goes round what is in the way: for another goal another one may be better.
    pub fn forget(&mut self) {
        self.side = Side::default();
    }

    /// Where to if nothing were a threat (rad), and the region in which that lies.
    fn free_way(
        &mut self,
        distances: &[f64; SECTORS],
        goal: Point,
        passage: &Passage,
    ) -> Option<(Chosen, f64)> {
        let goal_bearing = atan2(goal.y, goal.x);
        let radius = self.parameters.body.half_width();
        let straight = fmin(self.parameters.reach - radius, hypot(goal.x, goal.y) - radius);
        let chosen = self.regions.choose(distances, goal, passage, self.side);
        if self.regions.corridor_is_free(goal_bearing, radius, straight) {
            let chosen = chosen.unwrap_or(Chosen {
                region: Region {
                    first: super::sectors::sector(goal_bearing),
                    count: 1,
                    rises_right: false,
                    rises_left: false,
                },
                goal_in: true,
                free: goal_bearing,
                side: 0.0,
            });
            return Some((chosen, goal_bearing));
        }
        let chosen = chosen?;
        let (right, left) = chosen.region.ends();
        let Some((corner, _, inwards)) = rising_edge(&chosen.region, goal_bearing, self.side) else {
            return Some((chosen, chosen.free));
        };
        let off = asin(fmin((self.parameters.security + radius) / fmax(distances[corner], 1e-6), 1.0));
        // Past the middle it would come near to the other end.
        let middle = wrap((right + left) / 2.0);
        let to_middle = fabs(turn(bearing(corner), middle));
        let narrow = left - right < PI && to_middle < off;
        Some((chosen, if narrow { middle } else { wrap(bearing(corner) + inwards * off) }))
    }

    fn act(
        &self,
        distances: &[f64; SECTORS],
        chosen: &Chosen,
        free: f64,
        goal_distance: f64,
        seen: Avoidance,
    ) -> Avoidance {
        let Parameters { security, linear_max, angular_max, .. } = self.parameters;
        let reach = (5.0 * seen.nearest).clamp(0.0, security);
        let (mut cubes, mut squares) = (0.0, 0.0);
        let (mut left, mut right) = (1.0, 1.0);
        for sector in 0..SECTORS {
            let beyond = distances[sector] - self.edges[sector];
            if beyond >= reach && beyond > 0.0 {
                continue;
            }
            let threat = if reach > 0.0 { ((reach - beyond) / reach).clamp(0.0, 1.0) } else { 1.0 };
            cubes += threat * threat * threat * turn(free, wrap(bearing(sector) + PI));
            squares += threat * threat;
            let side = if turn(free, bearing(sector)) >= 0.0 { &mut left } else { &mut right };
            *side = fmin(*side, (beyond / security).clamp(0.0, 1.0));
        }
        let delta = if squares > 0.0 { cubes / squares } else { 0.0 };
        let direction = (free + delta).clamp(-PI / 2.0, PI / 2.0);
        let share = |x: f64| x.clamp(0.0, 1.0);
        let speed = linear_max
            * share(2.0 * goal_distance)
            * share(seen.nearest / security)
            * share((PI / 6.0 - fabs(direction)) / (PI / 6.0));
        let (region_right, region_left) = chosen.region.ends();
        Avoidance {
            situation: if seen.nearest > 0.0 { Situation::Moving } else { Situation::Touching },
            twist: Twist::new(speed, angular_max * direction / (PI / 2.0)),
            direction,
            free,
            region_right,
            region_left,
            left,
            right,
            ..seen
        }
    }
}
