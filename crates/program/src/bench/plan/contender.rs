//! Who answers queries, and what is timed of it.

use navigation::path::{
    AStar, Anytime, Ara, AraParams, DStarLite, Dijkstra, Field, Grid, Jump, Path, Planner, Refined,
};

use super::peer::Peer;
use super::{Query, SAME};
use crate::terminal::host_now;

/// Names of rows, as figures are called.
pub(super) const PEER: &str = "pathfinding";
pub(super) const EXACT: &str = "jump";
pub(super) const FIELD: &str = "field";

/// An answer and when it came (ns since it was asked).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Answer {
    /// How long the last way is (sides of a cell).
    pub(super) length: Option<f64>,
    /// When there was a way, or was known that there is none.
    pub(super) first: f64,
    /// When the way was the shortest; infinite where it never was.
    pub(super) optimal: f64,
    /// When the search was over.
    pub(super) whole: f64,
}

/// Somebody who answers.
pub(super) trait Contender {
    fn answer(&mut self, query: &Query) -> Answer;
}

/// All of them for one map, with the names of their rows; the other system first.
pub(super) fn all(grid: &Grid) -> Vec<(&'static str, Box<dyn Contender + '_>)> {
    let (width, height) = (grid.width(), grid.height());
    let whole = |planner: Box<dyn Planner>| -> Box<dyn Contender + '_> { Box::new(Whole { planner, grid }) };
    let rising =
        |planner: Box<dyn Anytime>| -> Box<dyn Contender + '_> { Box::new(Rising { planner, grid }) };
    vec![
        (PEER, Box::new(Other(Peer::new(grid)))),
        (EXACT, whole(Box::new(Jump::new(width, height)))),
        (FIELD, rising(Box::new(Field::new(width, height)))),
        ("ara_star", rising(Box::new(Ara::new(width, height, AraParams::default())))),
        ("a_star", whole(Box::new(AStar::new(width, height)))),
        ("d_star_lite", whole(Box::new(DStarLite::new(width, height)))),
        ("dijkstra", whole(Box::new(Dijkstra::new(width, height)))),
    ]
}

struct Other(Peer);

impl Contender for Other {
    fn answer(&mut self, query: &Query) -> Answer {
        let begun = host_now();
        let length = self.0.length(query.start, query.goal);
        at_once(length, begun.elapsed().as_nanos() as f64)
    }
}

struct Whole<'a> {
    planner: Box<dyn Planner>,
    grid: &'a Grid,
}

impl Contender for Whole<'_> {
    fn answer(&mut self, query: &Query) -> Answer {
        let begun = host_now();
        let length = self.planner.plan(self.grid, query.start, query.goal).ok().map(Path::length);
        at_once(length, begun.elapsed().as_nanos() as f64)
    }
}

/// One who has nothing before it is done.
fn at_once(length: Option<f64>, span: f64) -> Answer {
    Answer { length, first: span, optimal: span, whole: span }
}

struct Rising<'a> {
    planner: Box<dyn Anytime>,
    grid: &'a Grid,
}

impl Contender for Rising<'_> {
    fn answer(&mut self, query: &Query) -> Answer {
        let begun = host_now();
        let is_there = self.planner.begin(self.grid, query.start, query.goal).is_ok();
        let first = begun.elapsed().as_nanos() as f64;
        if !is_there {
            return at_once(None, first);
        }
        let is_optimal = |length: f64| query.length.is_some_and(|optimum| length <= optimum + SAME);
        let mut optimal = if is_optimal(self.planner.best().length()) { first } else { f64::INFINITY };
        loop {
            let refined = self.planner.refine();
            let now = begun.elapsed().as_nanos() as f64;
            let length = self.planner.best().length();
            if optimal.is_infinite() && is_optimal(length) {
                optimal = now;
            }
            if refined == Refined::Final {
                return Answer { length: Some(length), first, optimal, whole: now };
            }
        }
    }
}
