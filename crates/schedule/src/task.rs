//! Tasks, and sets of them.

use num_traits::{ToPrimitive, Zero};

use crate::exact::{Exact, common_denominator, near};

/// What needs a processor again and again: every period, or at most that often. Times in nanoseconds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Task {
    /// Processor time of one job at worst: C.
    pub cost: Exact,
    /// The least time between two arrivals: T.
    pub period: Exact,
    /// How soon after its arrival a job must be done, D ≤ T; the period when nothing is said.
    pub deadline: Option<Exact>,
    /// How long after its arrival a job may become ready at worst: J.
    pub jitter: Exact,
    /// How long a job may be kept waiting by those of lower priority at worst: B.
    pub blocking: Exact,
    /// The processor that runs it; when nothing is said, one that is chosen for it.
    pub processor: Option<usize>,
}

impl Task {
    /// A task that is ready when it arrives, waits for nobody below it and may take its whole period.
    pub fn new(cost: Exact, period: Exact) -> Task {
        let none = Exact::zero();
        Task { cost, period, deadline: None, jitter: none, blocking: none, processor: None }
    }

    /// The same with a deadline.
    pub fn with_deadline(self, deadline: Exact) -> Task {
        Task { deadline: Some(deadline), ..self }
    }

    /// How soon after its arrival a job must be done.
    pub fn due(&self) -> Exact {
        self.deadline.unwrap_or(self.period)
    }

    /// The share of a processor that it needs at most.
    pub fn utilization(&self) -> Exact {
        self.cost / self.period
    }

    fn times(&self) -> [Exact; 5] {
        [self.cost, self.period, self.due(), self.jitter, self.blocking]
    }

    fn wrong(&self, task: usize) -> impl Iterator<Item = Wrong> {
        let none = Exact::zero();
        [
            (self.period <= none, What::Period),
            (self.cost < none, What::Cost),
            (self.deadline.is_some_and(|deadline| deadline <= none), What::Deadline),
            (self.due() > self.period && self.period > none, What::LateDeadline),
            (self.jitter < none, What::Jitter),
            (self.blocking < none, What::Blocking),
        ]
        .into_iter()
        .filter(|(is, _)| *is)
        .map(move |(_, what)| Wrong { task, what })
    }
}

/// Something in a task that makes no sense.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("task {task}: {what}")]
pub struct Wrong {
    /// Its place in the set.
    pub task: usize,
    /// What is wrong.
    pub what: What,
}

/// What can be wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum What {
    /// Nothing happens every zero seconds.
    #[error("the period must be more than zero")]
    Period,
    /// Time cannot be given back.
    #[error("the execution time must not be less than zero")]
    Cost,
    /// Nothing is done at once.
    #[error("the deadline must be more than zero")]
    Deadline,
    /// The tests hold for one job of a task at a time.
    #[error("the deadline must not be later than the period")]
    LateDeadline,
    /// Nothing is ready before it arrives.
    #[error("the jitter must not be less than zero")]
    Jitter,
    /// Waiting takes time.
    #[error("the blocking must not be less than zero")]
    Blocking,
    /// The fractions of all tasks together have too great a denominator, or too many tasks too long times.
    #[error("its times cannot be reckoned exactly with those of the others: take fewer digits")]
    TooFine,
}

/// Tasks whose numbers make sense, the one of highest priority first.
#[derive(Clone, Debug)]
pub struct TaskSet {
    tasks: Vec<Task>,
    rows: Vec<Row>,
    /// So many ticks are a nanosecond.
    ticks: i128,
}

/// A task in whole ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Row {
    pub cost: i128,
    pub period: i128,
    pub deadline: i128,
    pub jitter: i128,
    pub blocking: i128,
}

/// No time is longer, in ticks: so sums and products of them stay within 128 bits where they must.
const LONGEST: i128 = 1 << 80;

impl TaskSet {
    /// These tasks, the first of highest priority. What makes no sense in them, all at once.
    pub fn new(tasks: Vec<Task>) -> Result<TaskSet, Vec<Wrong>> {
        let wrong: Vec<Wrong> = tasks.iter().enumerate().flat_map(|(at, task)| task.wrong(at)).collect();
        if !wrong.is_empty() {
            return Err(wrong);
        }
        let too_fine = |task| vec![Wrong { task, what: What::TooFine }];
        let mut ticks = 1;
        for (at, task) in tasks.iter().enumerate() {
            let so_far = Exact::new(1, ticks);
            let all = std::iter::once(so_far).chain(task.times());
            ticks = common_denominator(all).ok_or_else(|| too_fine(at))?;
        }
        let mut rows = Vec::with_capacity(tasks.len());
        for (at, task) in tasks.iter().enumerate() {
            let mut whole = [0; 5];
            for (whole, time) in whole.iter_mut().zip(task.times()) {
                *whole = (ticks / time.denom())
                    .checked_mul(*time.numer())
                    .filter(|time| *time <= LONGEST)
                    .ok_or_else(|| too_fine(at))?;
            }
            let [cost, period, deadline, jitter, blocking] = whole;
            rows.push(Row { cost, period, deadline, jitter, blocking });
        }
        Ok(TaskSet { tasks, rows, ticks })
    }

    /// These tasks in the order of their deadlines, which is that of their periods where nothing else is said; those with the same
    /// deadline in the order given. With the place that each had.
    ///
    /// No other order of fixed priorities meets deadlines that this one misses, as long as nothing is late or blocked (Leung and
    /// Whitehead 1982).
    pub fn deadline_monotonic(tasks: Vec<Task>) -> Result<(TaskSet, Vec<usize>), Vec<Wrong>> {
        let mut order: Vec<usize> = (0..tasks.len()).collect();
        order.sort_by(|a, b| tasks[*a].due().cmp(&tasks[*b].due()));
        let sorted = order.iter().map(|at| tasks[*at].clone()).collect();
        match TaskSet::new(sorted) {
            Ok(set) => Ok((set, order)),
            Err(wrong) => Err(wrong.iter().map(|it| Wrong { task: order[it.task], ..*it }).collect()),
        }
    }

    /// The tasks, the one of highest priority first.
    pub fn tasks(&self) -> &[Task] {
        &self.tasks
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.tasks.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.tasks.is_empty()
    }

    pub(crate) fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// So many ticks are a nanosecond.
    pub(crate) fn ticks(&self) -> i128 {
        self.ticks
    }

    /// A time in ticks as what it is in nanoseconds.
    pub(crate) fn time(&self, ticks: i128) -> Exact {
        Exact::new(ticks, self.ticks)
    }

    /// A time in whole ticks, rounded up.
    pub(crate) fn whole(&self, time: Exact) -> i128 {
        (time * Exact::from_integer(self.ticks)).ceil().to_integer()
    }

    /// The utilisation, rounded.
    pub fn utilization(&self) -> f64 {
        self.tasks.iter().map(|task| near(task.cost) / near(task.period)).sum()
    }
}

impl Row {
    /// How many jobs become ready in a time of this length at most.
    pub(crate) fn jobs_within(&self, length: i128) -> i128 {
        let length = length.saturating_add(self.jitter);
        length / self.period + i128::from(length % self.period > 0)
    }

    /// What they need together.
    pub(crate) fn work_within(&self, length: i128) -> i128 {
        self.jobs_within(length).saturating_mul(self.cost)
    }

    /// The share of a processor, rounded.
    pub(crate) fn share(&self) -> f64 {
        self.cost.to_f64().unwrap_or(f64::INFINITY) / self.period.to_f64().unwrap_or(1.0)
    }
}
