//! How a robot is kept track of.

use crate::drift::Drift;
use crate::matching::MatchParams;
use crate::monte_carlo::MonteCarloParams;

/// How a robot is kept track of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloorParams {
    /// Radius of the robot (m): where it can be at all. 0.2.
    pub radius: f64,
    /// How its wheels err.
    pub drift: Drift,
    /// How scans are laid over the floor.
    pub matching: MatchParams,
    /// How it is searched for.
    pub cloud: MonteCarloParams,
    /// Beams of a scan that are laid over the floor, at most 256. 181 are one a degree over half a turn.
    pub beams: usize,
    /// The share of points that must lie on the plan for a scan to fit while the robot is tracked. 0.4: a crowd may hide more than half.
    pub inliers_least: f64,
    /// The same for a place that was searched for, or that somebody said. 0.6: in a wrong place seldom more than half of the points lie on something.
    pub inliers_sure: f64,
    /// Squared deviations by which a scan may differ from what was expected. 25: the 0.99998 quantile of χ² of three numbers, as wheels err in the
    /// same way all the time.
    pub gate: f64,
    /// So many scans in a row must not fit before it is searched for. 3: somebody may walk by.
    pub misses: u32,
    /// The share of beams that may have come through what the plan shows for a scan that does not fit to be one of which people hide the rest: dead
    /// reckoning goes on. 0.1: in a wrong place of a room a third of the beams are too long.
    pub through_most: f64,
    /// Where no more than the share [`through_hidden`](FloorParams::through_hidden) has come through what the plan shows, so many points are enough: what
    /// is left is hidden by things that the plan does not show. 0.2: of a wall that was put up close before the robot two beams of three end on it.
    pub inliers_hidden: f64,
    /// See there. 0.03.
    pub through_hidden: f64,
    /// So many scans in a row may be hidden, while it is under way, before it is searched for. 400: twenty seconds of a laser at 20 Hz; nobody walks
    /// around a robot for ever.
    pub hidden_most: u32,
    /// Deviations of the place (m) and the heading (rad) above which it is not known any more. 0.4 m and 0.35 rad: from nearer a scan finds back by itself.
    pub lost: (f64, f64),
    /// A robot that moved less (m, rad) may see the same scan again. 5 mm and half a degree are less than what its noise hides.
    pub still: (f64, f64),
    /// Deviations around the last known place in which half of the cloud begins (m, rad).
    pub hint: (f64, f64),
    /// So many robots anywhere are looked at in each round of a search, for each square metre. 25: a second place that fits is found within ten scans.
    pub draws: f64,
    /// And at most so many. 4000 take some milliseconds, and are enough for 160 m².
    pub draws_most: u32,
    /// A search goes on for so many scans at least. 12: after so many a second place that fits was found too, but for one case in a thousand. On a
    /// floor on which [`draws_most`](FloorParams::draws_most) are too few to look so densely it takes as many more.
    pub searched: u32,
    /// A place must have fitted so many scans in a row. 4.
    pub fitted: u32,
    /// A place must be better than another by so much (nats) before that is left out. 6: one to four hundred.
    pub margin: f64,
    /// After so many scans without any place that fits everything begins anew. 50.
    pub give_up: u32,
}

impl Default for FloorParams {
    fn default() -> FloorParams {
        FloorParams {
            radius: 0.2,
            drift: Drift::default(),
            matching: MatchParams::default(),
            cloud: MonteCarloParams::default(),
            beams: 181,
            inliers_least: 0.4,
            inliers_sure: 0.6,
            gate: 25.0,
            misses: 3,
            through_most: 0.1,
            inliers_hidden: 0.2,
            through_hidden: 0.03,
            hidden_most: 400,
            lost: (0.4, 0.35),
            still: (0.005, 0.01),
            hint: (0.8, 0.6),
            draws: 25.0,
            draws_most: 4000,
            searched: 12,
            fitted: 4,
            margin: 6.0,
            give_up: 50,
        }
    }
}
