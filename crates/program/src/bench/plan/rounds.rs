//! Rounds in which all planners take turns over all queries, and what comes of them.
//!
//! In a round each planner answers all queries of a map before the next one has its turn, so none finds what another has left in the caches.

use super::super::outcome::median;
use super::contender::{self, Answer, EXACT, FIELD, PEER};
use super::{Floor, Query, SAME};

/// What all have answered, over all maps.
pub(super) struct Answers {
    queries: Vec<Query>,
    /// How many of them are on each map.
    counts: Vec<usize>,
    /// The other system first.
    pub(super) rows: Vec<Row>,
}

/// What one has answered: the rounds of each query.
#[derive(Clone)]
pub(super) struct Row {
    pub(super) name: &'static str,
    answers: Vec<Judged>,
}

/// The answers to one query, and whether they were right.
#[derive(Clone)]
struct Judged {
    optimum: Option<f64>,
    rounds: Vec<Answer>,
}

/// Lets all answer all queries so many times.
pub(super) fn all(floors: &[Floor], rounds: usize) -> Answers {
    let mut answers = Answers { queries: Vec::new(), counts: Vec::new(), rows: Vec::new() };
    for floor in floors {
        let mut contenders = contender::all(&floor.grid);
        if answers.rows.is_empty() {
            answers.rows.extend(contenders.iter().map(|(name, _)| Row { name, answers: Vec::new() }));
        }
        let before = answers.queries.len();
        answers.queries.extend(&floor.queries);
        answers.counts.push(floor.queries.len());
        for row in &mut answers.rows {
            row.answers.extend(
                floor.queries.iter().map(|query| Judged { optimum: query.length, rounds: Vec::new() }),
            );
        }
        for _ in 0..rounds {
            for ((_, contender), row) in contenders.iter_mut().zip(&mut answers.rows) {
                for (query, judged) in floor.queries.iter().zip(&mut row.answers[before..]) {
                    judged.rounds.push(contender.answer(query));
                }
            }
        }
    }
    answers
}

impl Judged {
    /// The median over the rounds of something of an answer (ns).
    fn middle(&self, of: impl Fn(&Answer) -> f64) -> f64 {
        median(self.rounds.iter().map(of).collect())
    }

    fn is_right(&self) -> bool {
        self.rounds.iter().all(|answer| match (answer.length, self.optimum) {
            (Some(length), Some(optimum)) => (length - optimum).abs() <= SAME,
            (length, optimum) => length.is_none() && optimum.is_none(),
        })
    }

    fn is_found(&self) -> bool {
        self.rounds.iter().all(|answer| answer.length.is_some())
    }
}

impl Row {
    /// The answers to the queries that have a way.
    fn ways(&self) -> impl Iterator<Item = &Judged> {
        self.answers.iter().filter(|judged| judged.optimum.is_some())
    }

    /// Of how many queries that have a way one was found.
    pub(super) fn found(&self) -> usize {
        self.ways().filter(|judged| judged.is_found()).count()
    }

    /// Of how many it was the shortest at last.
    pub(super) fn right(&self) -> usize {
        self.ways().filter(|judged| judged.is_right()).count()
    }

    /// Of how many queries that have none this was said.
    pub(super) fn refused(&self) -> usize {
        self.answers.iter().filter(|judged| judged.optimum.is_none() && judged.is_right()).count()
    }

    /// What each query took (µs).
    pub(super) fn spans(&self) -> Vec<f64> {
        self.ways().map(|judged| judged.middle(|answer| answer.whole) * 1e-3).collect()
    }

    /// What the first way of each query took (µs).
    pub(super) fn firsts(&self) -> Vec<f64> {
        self.ways().map(|judged| judged.middle(|answer| answer.first) * 1e-3).collect()
    }

    /// What the shortest way of each query took (µs); infinite where it never came.
    pub(super) fn optimals(&self) -> Vec<f64> {
        self.ways().map(|judged| judged.middle(|answer| answer.optimal) * 1e-3).collect()
    }

    /// How many times as long another took, query by query.
    pub(super) fn speed_ups(&self, other: &Row) -> Vec<f64> {
        self.spans().iter().zip(other.spans()).map(|(own, other)| other / own).collect()
    }

    /// How many times as long another took as this one to its first way.
    pub(super) fn first_speed_ups(&self, other: &Row) -> Vec<f64> {
        self.firsts().iter().zip(other.spans()).map(|(own, other)| other / own).collect()
    }

    /// The share of all queries in which the shortest way was there by the time that the other had finished.
    pub(super) fn optimal_share(&self, other: &Row) -> f64 {
        let (own, other) = (self.optimals(), other.spans());
        let in_time = own.iter().zip(&other).filter(|(own, other)| own <= other).count();
        in_time as f64 / own.len().max(1) as f64
    }
}

impl Answers {
    pub(super) fn row(&self, name: &str) -> &Row {
        self.rows.iter().find(|row| row.name == name).unwrap_or(&self.rows[0])
    }

    pub(super) fn peer(&self) -> &Row {
        self.row(PEER)
    }

    /// The same for each map by itself.
    fn by_map(&self) -> Vec<Answers> {
        let mut before = 0;
        let part = |count: &usize| {
            let part = before..before + count;
            before = part.end;
            let row = |row: &Row| Row { name: row.name, answers: row.answers[part.clone()].to_vec() };
            let rows = self.rows.iter().map(row).collect();
            Answers { queries: self.queries[part.clone()].to_vec(), counts: vec![*count], rows }
        };
        self.counts.iter().map(part).collect()
    }

    pub(super) fn with_a_way(&self) -> usize {
        self.queries.iter().filter(|query| query.length.is_some()).count()
    }

    pub(super) fn without_a_way(&self) -> usize {
        self.queries.len() - self.with_a_way()
    }

    /// The medians over the queries of one and of the other system, round by round (µs).
    pub(super) fn rounds_of(&self, row: &Row) -> Vec<(f64, f64)> {
        let rounds = row.ways().next().map_or(0, |judged| judged.rounds.len());
        let middle = |row: &Row, round: usize| {
            median(row.ways().map(|judged| judged.rounds[round].whole * 1e-3).collect())
        };
        (0..rounds).map(|round| (middle(row, round), middle(self.peer(), round))).collect()
    }
}

/// For people: a row for each planner.
pub(super) fn table(answers: &Answers) -> Vec<[String; 9]> {
    let head = ["planner", "queries", "found", "right", "us", "speed-up", "first us", "speed-up", "optimal"];
    let peer = answers.peer();
    let row = |row: &Row| {
        [
            row.name.to_owned(),
            answers.with_a_way().to_string(),
            row.found().to_string(),
            row.right().to_string(),
            number(median(row.spans())),
            number(median(row.speed_ups(peer))),
            number(median(row.firsts())),
            number(median(row.first_speed_ups(peer))),
            format!("{:.1} %", 100.0 * row.optimal_share(peer)),
        ]
    };
    [head.map(str::to_owned)].into_iter().chain(answers.rows.iter().map(row)).collect()
}

/// For people, of several maps: what is asked of the exact search and of the field, on each.
pub(super) fn maps(floors: &[Floor], answers: &Answers) -> Vec<[String; 5]> {
    let head = ["map", "queries", "jump: speed-up", "field: first", "field: optimal"];
    let row = |(floor, answers): (&Floor, Answers)| {
        let (peer, field) = (answers.peer(), answers.row(FIELD));
        [
            floor.name.clone(),
            answers.with_a_way().to_string(),
            number(median(answers.row(EXACT).speed_ups(peer))),
            number(median(field.first_speed_ups(peer))),
            format!("{:.1} %", 100.0 * field.optimal_share(peer)),
        ]
    };
    [head.map(str::to_owned)].into_iter().chain(floors.iter().zip(answers.by_map()).map(row)).collect()
}

fn number(x: f64) -> String {
    if x.is_nan() {
        // On a map whose queries have no way at all.
        return "–".to_owned();
    }
    if x >= 100.0 { format!("{x:.0}") } else { format!("{x:.1}") }
}
