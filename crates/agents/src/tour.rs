//! The tour: to one place after another, as somebody would ask for them.

use runtime::{Agent, Client, Fault, Input, Reply, Step};
use types::chance::Stream;
use types::geometry::{PI, TAU};
use types::messages::{Answer, Goal, Report};
use types::params::Params;
use types::value::{Mistake, Table};
use types::{Duration, Name, Time};

/// Where to.
#[derive(Clone, Debug, Params)]
#[params(check = whole)]
pub struct TourParams {
    /// The places, one after another, as [x, y] or with a final heading as [x, y, heading] (m, m, rad).
    pub places: Vec<Vec<f64>>,
    /// So many more places are drawn, evenly over `area`; every other one with a heading.
    #[param(default = 0u32, max = 1000000)]
    pub random: u32,
    /// Where they are drawn: [x0, y0, x1, y1] (m).
    pub area: Vec<f64>,
    /// What is drawn depends on it alone.
    #[param(default = 1u64)]
    pub seed: u64,
    /// Whether to dock there, at those that have a heading; of those that are drawn all have one then.
    #[param(default = false)]
    pub dock: bool,
    /// The mode in which it goes there; empty for the choice of the navigation module.
    pub mode: Name,
    /// Between the end of one and the next (time): the robot stands for so long.
    #[param(default = Duration::secs(1), min = 0.0, max = 3600.0)]
    pub rest: Duration,
    /// When it begins (time).
    #[param(default = Duration::secs(1), min = 0.0, max = 86400.0)]
    pub begin: Duration,
}

fn whole(params: &TourParams, read: &Table) -> Vec<Mistake> {
    let mut mistakes = Vec::new();
    if let Some(entry) = read.get("places").and_then(|entry| entry.value.as_list().map(|list| (entry, list)))
    {
        let wrong = |place: &&Vec<f64>| !matches!(place.len(), 2 | 3) || !place.iter().all(|x| x.is_finite());
        if params.places.iter().any(|place| wrong(&place)) {
            mistakes.push(Mistake::new(entry.0.at, "a place is [x, y] or [x, y, heading]"));
        }
    }
    let is_area = matches!(params.area[..], [x0, y0, x1, y1] if x0 < x1 && y0 < y1);
    if !is_area && (params.random > 0 || !params.area.is_empty()) {
        let at = read.get("area").or(read.get("random")).map(|entry| entry.at).unwrap_or_default();
        mistakes.push(Mistake::new(at, "\"area\" is [x0, y0, x1, y1], the lower left corner first"));
    }
    mistakes
}

impl TourParams {
    fn count(&self) -> usize {
        self.places.len() + self.random as usize
    }

    /// The place of this number, counted from zero.
    fn goal(&self, number: usize) -> Option<Goal> {
        let goal = Goal { mode: self.mode, ..Goal::default() };
        if let Some(place) = self.places.get(number) {
            let (x, y) = (*place.first()?, *place.get(1)?);
            let heading = place.get(2).copied();
            let dock = heading.is_some() && self.dock;
            return Some(Goal { x, y, heading: heading.unwrap_or(goal.heading), dock, ..goal });
        }
        let [x0, y0, x1, y1] = self.area[..] else { return None };
        let drawn = number - self.places.len();
        let draw = |what: &str| Stream::new(self.seed, what).uniform(drawn as u64);
        let is_turned = drawn % 2 == 1 || self.dock;
        (drawn < self.random as usize).then(|| Goal {
            x: x0 + (x1 - x0) * draw("tour/x"),
            y: y0 + (y1 - y0) * draw("tour/y"),
            heading: if is_turned { TAU * draw("tour/heading") - PI } else { goal.heading },
            dock: self.dock,
            ..goal
        })
    }
}

/// Asks the navigation module for one place after another, each when the one before has ended, well or badly.
#[derive(Agent)]
pub struct Tour {
    /// The navigation module.
    go: Client<Goal, Answer>,
    /// What became of what was asked.
    report: Input<Report>,
    params: TourParams,
    next: usize,
    /// What is being done, once it was accepted.
    task: Option<u32>,
    asked: bool,
    /// From when on the next may be asked.
    from: Option<Time>,
}

impl Agent for Tour {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        let now = step.now;
        let from = *self.from.get_or_insert(now + self.params.begin);
        while let Some((_, reply)) = self.go.reply() {
            self.asked = false;
            match reply {
                Reply::Answer(answer) if answer.accepted => self.task = Some(answer.task),
                // It is asked again: the localizer may not have found itself yet.
                _ => (self.next, self.from) = (self.next - 1, Some(now + Duration::secs(1))),
            }
        }
        while let Some(report) = self.report.take() {
            if report.progress.is_over() && self.task == Some(report.task) {
                self.task = None;
                self.from = Some(now + self.params.rest);
            }
        }
        let is_free = !self.asked && self.task.is_none() && now >= from;
        if let Some(goal) = self.params.goal(self.next).filter(|_| is_free) {
            self.next += 1;
            self.asked = self.go.call(goal, Duration::secs(2)).is_ok();
            if self.next == self.params.count() {
                runtime::note!("the last place of the tour");
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use types::value::Value;

    #[test]
    fn places_come_in_order_and_then_those_that_are_drawn() {
        let params = TourParams {
            places: vec![vec![1.0, 2.0], vec![3.0, 4.0, 1.5]],
            random: 200,
            area: vec![-1.0, 2.0, 3.0, 4.0],
            ..TourParams::default()
        };
        let at = |number| params.goal(number).unwrap();
        assert_eq!((at(0).x, at(0).y, at(0).heading.is_nan()), (1.0, 2.0, true));
        assert_eq!(at(1).heading, 1.5);
        let drawn: Vec<Goal> = (2..202).map(at).collect();
        assert!(drawn.iter().all(|goal| (-1.0..3.0).contains(&goal.x) && (2.0..4.0).contains(&goal.y)));
        let mean = drawn.iter().map(|goal| goal.x).sum::<f64>() / 200.0;
        assert!((mean - 1.0).abs() < 0.3, "evenly: {mean}");
        assert_eq!(drawn.iter().filter(|goal| goal.heading.is_finite()).count(), 100);
        assert_eq!(params.goal(202), None);
        assert_eq!(params.goal(5), params.goal(5), "the same again, with a heading");
    }

    #[test]
    fn what_is_no_place_is_a_mistake() {
        let mut table = Table::new();
        table.set("places", Value::List(vec![]));
        table.set("random", Value::Int(3));
        let params = TourParams { places: vec![vec![1.0]], random: 3, ..TourParams::default() };
        let told: Vec<String> = whole(&params, &table).into_iter().map(|mistake| mistake.what).collect();
        assert_eq!(told.len(), 2, "{told:?}");
        assert!(told[0].contains("[x, y]") && told[1].contains("lower left"), "{told:?}");
        assert!(whole(&TourParams::default(), &Table::new()).is_empty());
    }
}
