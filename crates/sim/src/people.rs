//! People: they stand, walk their way-points, appear when a robot comes, and lead it.

use types::geometry::{PI, Pose};
use types::{Duration, Point, Time};

use crate::crowd::Roaming;
use crate::field::Field;
use crate::model::Shape;
use crate::plan::{Person, Region, WorldPlan};
use crate::robot::{Robot, STEP};
use crate::shape::Circle;
use crate::solid::Solid;

/// People keep this far from a robot (m, surface to surface): they never walk into one.
pub const POLITE: f64 = 0.15;
/// Within this of a place where a robot stands a person has come there (m): both side by side.
const PLACE: f64 = 0.8;
/// How far aside a person looks for a way around a robot (rad): 30°, 60° and 90°.
const ASIDE: [f64; 3] = [PI / 6.0, PI / 3.0, PI / 2.0];

/// A person in the world.
#[derive(Clone, Debug)]
pub(crate) struct Walker {
    pub plan: Person,
    pub body: u32,
    pub at: Point,
    pub facing: f64,
    pub present: bool,
    /// Whether the person walked in the last step.
    pub walking: bool,
    /// The robot that the person came up to in the last step until the two touched, and where.
    pub touched: Option<(usize, Point)>,
    appears: Option<Region>,
    whens: Vec<Option<Region>>,
    leg: usize,
    /// How somebody walks about who follows no script.
    pub roaming: Option<Roaming>,
    /// When the present leg begins; not yet known while its trigger has not come.
    begins: Option<Time>,
}

impl Walker {
    pub(crate) fn new(plan: &Person, body: u32, world: &WorldPlan, seed: u64) -> Walker {
        let region = |name: &Option<String>| name.as_deref().and_then(|name| world.region(name)).cloned();
        Walker {
            body,
            at: plan.at,
            facing: plan.facing,
            present: plan.appears.is_none(),
            walking: false,
            touched: None,
            appears: region(&plan.appears),
            whens: plan.walk.iter().map(|leg| region(&leg.when)).collect(),
            leg: 0,
            roaming: Roaming::new(plan, world, seed),
            begins: None,
            plan: plan.clone(),
        }
    }

    /// What the person covers of the floor.
    pub(crate) fn solid(&self) -> Solid {
        Solid::Round(Circle { centre: self.at, radius: self.plan.radius })
    }

    /// Whether the person can ever do anything but stand.
    pub(crate) fn acts(&self) -> bool {
        !self.present || !self.plan.walk.is_empty() || self.plan.gap.is_some() || self.roaming.is_some()
    }

    /// Where the middle of a carried thing is (m).
    pub(crate) fn hands(&self) -> Option<Point> {
        let thing = self.plan.carries.as_ref()?;
        Some(self.at + Point::polar(self.plan.radius + thing.radius + 0.05, self.facing))
    }

    /// One step; gives how far the person moved (m), infinity when somebody appeared.
    pub(crate) fn step(&mut self, now: Time, robots: &[Robot], field: &mut Field) -> f64 {
        self.walking = false;
        let near = nearest(robots, self.at);
        if self.plan.gap.is_some()
            && let Some((_, pose)) = near
        {
            self.facing = (pose.position() - self.at).bearing();
        }
        if !self.present {
            return self.appear(robots, field);
        }
        if self.roaming.is_some() {
            return self.roam(robots, field);
        }
        if !self.ready(now, robots) {
            return 0.0;
        }
        if let Some(gap) = self.plan.gap
            && near.is_none_or(|(distance, _)| distance >= gap)
        {
            return 0.0;
        }
        self.walk(robots, field)
    }

    fn appear(&mut self, robots: &[Robot], field: &mut Field) -> f64 {
        let called = self.appears.as_ref().is_none_or(|region| someone_in(robots, region));
        if !called || !self.free(self.at, robots) {
            return 0.0;
        }
        self.present = true;
        field.bodies[self.body as usize].present = true;
        field.place_body(self.body, self.solid());
        f64::INFINITY
    }

    /// Whether the present leg has begun.
    fn ready(&mut self, now: Time, robots: &[Robot]) -> bool {
        let Some(leg) = self.plan.walk.get(self.leg) else { return false };
        if self.begins.is_none() {
            let called = self.whens[self.leg].as_ref().is_none_or(|region| someone_in(robots, region));
            self.begins = called.then(|| now.saturating_add(leg.wait.max(Duration::ZERO)));
        }
        self.begins.is_some_and(|begins| now >= begins)
    }

    fn walk(&mut self, robots: &[Robot], field: &mut Field) -> f64 {
        let to = self.plan.walk[self.leg].to;
        let way = to - self.at;
        let (left, most) = (way.norm(), self.plan.speed * STEP);
        let straight = if left <= most { to } else { self.at + way * (most / left) };
        let next = if self.free(straight, robots) {
            straight
        } else if left < PLACE && !self.free(to, robots) {
            // A robot stands in that place: this is as near as it gets.
            self.arrive();
            return 0.0;
        } else {
            let Some(aside) = self.around(way.bearing(), most, robots, field) else { return 0.0 };
            aside
        };
        if next == to {
            self.arrive();
        }
        if self.plan.gap.is_none() && left > 0.0 {
            self.facing = way.bearing();
        }
        let moved = next.distance(self.at);
        self.walking = true;
        self.at = next;
        field.place_body(self.body, self.solid());
        moved
    }

    /// The next leg.
    fn arrive(&mut self) {
        self.begins = None;
        self.leg += 1;
        if self.plan.repeat && self.leg == self.plan.walk.len() {
            self.leg = 0;
        }
    }

    /// A step around a robot that stands in the way: the one that leads least aside, without touching anything.
    fn around(&self, ahead: f64, step: f64, robots: &[Robot], field: &Field) -> Option<Point> {
        ASIDE.iter().flat_map(|aside| [ahead + aside, ahead - aside]).find_map(|bearing| {
            let next = self.at + Point::polar(step, bearing);
            let touches = field.nearest(next, self.plan.radius, self.plan.height, self.body).is_some();
            (!touches && self.free(next, robots)).then_some(next)
        })
    }

    /// Whether no robot would be too near at `next`, or the step at least leads away from it.
    pub(crate) fn free(&self, next: Point, robots: &[Robot]) -> bool {
        robots.iter().all(|robot| match robot.model.shape {
            Shape::Round { radius } => {
                let centre = robot.truth.pose.position();
                let keep = self.plan.radius + radius + POLITE;
                let distance = next.distance(centre);
                distance >= keep || (self.present && distance > self.at.distance(centre))
            }
            shape => {
                let body = shape.solid(robot.truth.pose);
                let distance = body.gap_to_point(next).0;
                let keep = self.plan.radius + POLITE;
                distance >= keep || (self.present && distance > body.gap_to_point(self.at).0)
            }
        })
    }
}

fn someone_in(robots: &[Robot], region: &Region) -> bool {
    robots.iter().any(|robot| region.contains(robot.truth.pose.position()))
}

fn nearest(robots: &[Robot], at: Point) -> Option<(f64, Pose)> {
    let mut best: Option<(f64, Pose)> = None;
    for robot in robots {
        let distance = robot.truth.pose.position().distance(at);
        if best.is_none_or(|(least, _)| distance < least) {
            best = Some((distance, robot.truth.pose));
        }
    }
    best
}
