//! People who walk about: from one place of an area to another for ever, around what stands in their way.
//!
//! ```text
//!            ┌────────────── arrived, or blocked for a second ──────────────┐
//!            ▼                                                              │
//!   draw a free place ──▶ a step straight, else the least aside that is free┘
//! ```
//!
//! One who yields keeps [`POLITE`](crate::POLITE) from every robot, so stops or goes around it. One who does not walks straight on
//! until the two touch, and around then. Nobody walks into walls, things or other people.

use types::Point;
use types::chance::Stream;
use types::geometry::PI;

use crate::colour::Colour;
use crate::field::Field;
use crate::people::Walker;
use crate::plan::{Crowd, Person, Region, Roam, WorldPlan};
use crate::robot::{Robot, STEP};
use crate::solid::Solid;

/// So near to a place somebody has come there (m).
const THERE: f64 = 0.2;
/// Blocked for so many steps somebody goes elsewhere: a second.
const PATIENCE: u32 = 100;
/// Attempts to find a free place.
const PLACES: u64 = 100;
/// Places keep so far from what stands (m).
const ROOM: f64 = 0.1;
/// People begin so far from each other and from where robots start (m).
const APART: f64 = 1.0;
/// Ways beside the straight one, in the order in which they are tried (rad).
const WAYS: [f64; 7] = [0.0, PI / 6.0, -PI / 6.0, PI / 3.0, -PI / 3.0, PI / 2.0, -PI / 2.0];

/// What somebody needs to walk about.
#[derive(Clone, Debug)]
pub(crate) struct Roaming {
    area: Region,
    yields: bool,
    draw: Stream,
    /// How many places were drawn.
    drawn: u64,
    to: Option<Point>,
    blocked: u32,
}

impl Roaming {
    pub(crate) fn new(plan: &Person, world: &WorldPlan, seed: u64) -> Option<Roaming> {
        let Roam { area, yields } = plan.roams.as_ref()?;
        Some(Roaming {
            area: world.region(area)?.clone(),
            yields: *yields,
            draw: Stream::new(seed, &format!("people/{}", plan.name)),
            drawn: 0,
            to: None,
            blocked: 0,
        })
    }

    /// Another place of the area, free of what stands still.
    fn place(&mut self, radius: f64, height: f64, field: &Field) -> Option<Point> {
        let draw = self.draw.sample(self.drawn);
        self.drawn += 1;
        free_place(&self.area, radius + ROOM, height, field, draw)
    }
}

/// A place in a region with this much room around it, if one is found.
fn free_place(area: &Region, room: f64, height: f64, field: &Field, draw: Stream) -> Option<Point> {
    let (min, max) = area.bounds();
    (0..PLACES).find_map(|k| {
        let at = Point::new(draw.between(2 * k, min.x, max.x), draw.between(2 * k + 1, min.y, max.y));
        (area.contains(at) && field.nearest(at, room, height, u32::MAX).is_none()).then_some(at)
    })
}

/// The plan with all people of its crowds in it, each at a free place that `seed` draws.
pub(crate) fn peopled(plan: &WorldPlan, field: &Field, seed: u64) -> WorldPlan {
    let mut plan = plan.clone();
    let mut number = 0;
    for (crowd, draw) in
        std::mem::take(&mut plan.crowds).iter().zip((0..).map(|k| Stream::new(seed, "crowd").sample(k)))
    {
        let Some(area) = plan.region(&crowd.area).cloned() else { continue };
        for which in 0..crowd.count {
            let draw = draw.sample(u64::from(which));
            let apart = |at: Point| {
                plan.people
                    .iter()
                    .map(|other| other.at)
                    .chain([plan.start.position()])
                    .all(|other| other.distance(at) >= APART)
            };
            let places = (0..PLACES)
                .filter_map(|k| free_place(&area, crowd.radius + ROOM, 2.0, field, draw.sample(k)));
            let at = places.into_iter().find(|at| apart(*at));
            number += 1;
            if let Some(at) = at {
                let person = somebody(crowd, which, number, at, draw);
                plan.people.push(person);
            }
        }
    }
    plan
}

fn somebody(crowd: &Crowd, which: u32, number: u32, at: Point, draw: Stream) -> Person {
    // Of the first n people n times the share yield, rounded down.
    let yielding = |n: u32| libm::floor(f64::from(n) * crowd.yields + 1e-9);
    let yields = yielding(which + 1) > yielding(which);
    Person {
        name: format!("walker {number}"),
        at,
        facing: draw.between(PLACES + 1, -PI, PI),
        radius: crowd.radius,
        speed: draw.between(PLACES + 2, crowd.speed.0, crowd.speed.1),
        shirt: if yields { Colour([60, 140, 80]) } else { Colour([215, 180, 40]) },
        roams: Some(Roam { area: crowd.area.clone(), yields }),
        ..Person::default()
    }
}

impl Walker {
    /// One step of somebody who walks about; gives how far (m).
    pub(crate) fn roam(&mut self, robots: &[Robot], field: &mut Field) -> f64 {
        let Some(roaming) = &mut self.roaming else { return 0.0 };
        let arrived = roaming.to.is_none_or(|to| to.distance(self.at) < THERE);
        if arrived || roaming.blocked >= PATIENCE {
            roaming.blocked = 0;
            roaming.to = roaming.place(self.plan.radius, self.plan.height, field);
        }
        let (Some(to), yields) = (roaming.to, roaming.yields) else { return 0.0 };
        let (bearing, step) = ((to - self.at).bearing(), self.plan.speed * STEP);
        let ahead = WAYS.iter().find_map(|aside| {
            let next = self.at + Point::polar(step, bearing + aside);
            let free = self.fits(next, field) && (!yields || self.free(next, robots));
            free.then_some((next, bearing + aside, *aside == 0.0))
        });
        let straight = ahead.is_some_and(|(_, _, straight)| straight);
        // Whoever does not yield comes up to a robot before going around it.
        let touch = if straight || yields { None } else { self.comes_up(bearing, step, robots, field) };
        let (next, facing) = match (touch, ahead) {
            (Some((way, which, point)), _) => {
                self.touched = Some((which, point));
                (self.at + Point::polar(way, bearing), bearing)
            }
            (None, Some((next, facing, _))) => (next, facing),
            (None, None) => {
                if let Some(roaming) = &mut self.roaming {
                    roaming.blocked += 1;
                }
                return 0.0;
            }
        };
        let moved = next.distance(self.at);
        self.walking = true;
        (self.at, self.facing) = (next, facing);
        field.place_body(self.body, self.solid());
        moved
    }

    /// Whether nothing stands at `next`, or the step at least leads away from what stands there.
    fn fits(&self, next: Point, field: &Field) -> bool {
        let near = |at| field.nearest(at, self.plan.radius, self.plan.height, self.body);
        match near(next) {
            None => true,
            Some(after) => near(self.at).is_some_and(|before| after.distance > before.distance),
        }
    }

    /// How far it is straight on to a robot that a step would touch (m), which one it is, and where the two touch; nothing where
    /// something else stands there, or the two touch already.
    fn comes_up(
        &self,
        bearing: f64,
        step: f64,
        robots: &[Robot],
        field: &Field,
    ) -> Option<(f64, usize, Point)> {
        let solid = |robot: &Robot| robot.model.shape.solid(robot.truth.pose);
        let gap = |which: usize, way: f64| {
            let (distance, point) = solid(&robots[which]).gap_to_point(self.at + Point::polar(way, bearing));
            (distance - self.plan.radius, point)
        };
        let which = (0..robots.len()).find(|&which| gap(which, step).0 < 0.0)?;
        if gap(which, 0.0).0 < CLOSE {
            return None;
        }
        let (mut free, mut touch) = (0.0, step);
        for _ in 0..40 {
            let middle = (free + touch) / 2.0;
            if gap(which, middle).0 < 0.0 { touch = middle } else { free = middle }
        }
        let fits = self.fits(self.at + Point::polar(free, bearing), field);
        fits.then(|| (free, which, gap(which, free).1))
    }

    /// Goes elsewhere when a robot is put too near, as long as the world has not begun.
    pub(crate) fn make_room(&mut self, robot: &Solid, field: &mut Field) {
        let Some(roaming) = &mut self.roaming else { return };
        let far = |at: Point| robot.gap_to_point(at).0 >= APART;
        if far(self.at) {
            return;
        }
        let (radius, height) = (self.plan.radius, self.plan.height);
        match (0..PLACES).find_map(|_| roaming.place(radius, height, field).filter(|at| far(*at))) {
            Some(at) => {
                self.at = at;
                field.place_body(self.body, self.solid());
            }
            None => {
                self.present = false;
                field.hide_body(self.body);
            }
        }
    }
}

/// Nearer than this to a robot somebody touches it (m).
const CLOSE: f64 = 1e-6;
