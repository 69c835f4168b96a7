//! A schedule that is played: who runs when, and how long each job took. To see what the tests say, and to check them.

use std::collections::VecDeque;

use num_traits::ToPrimitive;

use crate::Exact;
use crate::processors::{ANYWHERE, Mask, Processors};
use crate::task::TaskSet;

/// Who goes first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Policy {
    /// The task that stands first in the set.
    #[default]
    FixedPriority,
    /// The job whose deadline is the earliest.
    EarliestDeadline,
}

/// How to play.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct How {
    /// Who goes first.
    pub policy: Policy,
    /// How many processors there are. A task runs on its own one where it has one, else on any.
    pub processors: usize,
    /// How long, in nanoseconds. What becomes ready later is not played; what is ready then is not played to its end.
    pub length: Exact,
}

/// What one job does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arrival {
    /// When it arrives, in nanoseconds; no earlier than the job before.
    pub at: Exact,
    /// How long after that it becomes ready.
    pub late: Exact,
    /// How much processor time it takes.
    pub cost: Exact,
}

/// A schedule. Times in ticks, of which [`Schedule::ticks_a_second`] are a second.
#[derive(Clone, Debug, PartialEq)]
pub struct Schedule {
    /// Who ran when, by their beginnings.
    pub pieces: Vec<Piece>,
    /// All jobs, by the times at which they became ready.
    pub jobs: Vec<Job>,
    /// When it ends.
    pub length: i128,
    /// How many ticks are a second.
    pub ticks_a_second: f64,
    ticks: i128,
}

/// That a job ran on a processor for a while.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Piece {
    /// Whose job.
    pub task: usize,
    /// On which processor.
    pub processor: usize,
    /// From when.
    pub from: i128,
    /// To when.
    pub to: i128,
}

/// A job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Job {
    /// Whose.
    pub task: usize,
    /// When it arrived.
    pub arrival: i128,
    /// When it became ready.
    pub ready: i128,
    /// When it must be done.
    pub deadline: i128,
    /// When it was done; nothing when it was not done at the end.
    pub end: Option<i128>,
}

impl Job {
    /// Whether it was not done in time, as far as can be told by `length`.
    pub fn missed(&self, length: i128) -> bool {
        self.end.map_or(length >= self.deadline, |end| end > self.deadline)
    }
}

impl Schedule {
    /// The longest time from arrival to end of the jobs of a task that were done, in nanoseconds.
    pub fn longest(&self, task: usize) -> Option<Exact> {
        let jobs = self.jobs.iter().filter(|job| job.task == task);
        jobs.filter_map(|job| job.end.map(|end| end - job.arrival))
            .max()
            .map(|ticks| Exact::new(ticks, self.ticks))
    }

    /// How many jobs of a task missed their deadlines.
    pub fn missed(&self, task: usize) -> usize {
        self.jobs.iter().filter(|job| job.task == task && job.missed(self.length)).count()
    }

    /// A time in seconds.
    pub fn seconds(&self, ticks: i128) -> f64 {
        ticks as f64 / self.ticks_a_second
    }
}

/// Plays a set from the moment when all become ready together, each as late after its arrival as it may, and from then on as often as
/// they may, each for as long as it may take: what is worst under fixed priorities on one processor.
pub fn simulate(set: &TaskSet, how: How) -> Schedule {
    play(set, how, &mut |task, job| {
        let it = &set.tasks()[task];
        let arrival = it.period * Exact::from_integer(job as i128) - it.jitter;
        let late = if job == 0 { it.jitter } else { (-arrival).max(Exact::from_integer(0)) };
        Some(Arrival { at: arrival, late, cost: it.cost })
    })
}

/// Plays what `arrivals` says of each task and its jobs, one after another; nothing when there are no more. Jobs of a task are done one after
/// another. Times are rounded up to ticks of the set.
pub fn play(set: &TaskSet, how: How, arrivals: &mut dyn FnMut(usize, usize) -> Option<Arrival>) -> Schedule {
    let length = set.whole(how.length);
    let mut stage = Stage {
        set,
        how,
        processors: Processors::new(how.processors).recording(),
        waiting: vec![VecDeque::new(); set.len()],
        jobs: Vec::new(),
    };
    for task in set.tasks() {
        stage.processors.thread(task.processor.map_or(ANYWHERE, |cpu| Mask::from(1u8) << cpu.min(63)));
    }
    let mut next: Vec<(usize, Option<(Job, i128)>)> = Vec::new();
    let mut following = |task: usize, job: usize| {
        let arrival = arrivals(task, job)?;
        let (at, ready) = (set.whole(arrival.at), set.whole(arrival.at + arrival.late));
        let job = Job { task, arrival: at, ready, deadline: at + set.rows()[task].deadline, end: None };
        Some((job, set.whole(arrival.cost)))
    };
    for task in 0..set.len() {
        next.push((0, following(task, 0)));
    }
    let mut pieces = Vec::new();
    loop {
        let now = stage.processors.now();
        for task in 0..next.len() {
            while let (count, Some((job, cost))) = next[task]
                && job.ready <= now
                && job.ready < length
            {
                stage.waiting[task].push_back((stage.jobs.len(), cost));
                stage.jobs.push(job);
                next[task] = (count + 1, following(task, count + 1));
            }
        }
        stage.submit();
        stage.processors.dispatch();
        if now >= length {
            break;
        }
        let soonest = next.iter().filter_map(|(_, job)| job.map(|(job, _)| job.ready)).min();
        let until = soonest.map_or(length, |ready| ready.clamp(now, length));
        stage.advance(until);
        stage.pieces(&mut pieces);
    }
    pieces.sort_by_key(|piece| (piece.from, piece.processor));
    let ticks = set.ticks();
    let ticks_a_second = ticks.to_f64().unwrap_or(1.0) * 1e9;
    Schedule { pieces, jobs: stage.jobs, length, ticks_a_second, ticks }
}

struct Stage<'a> {
    set: &'a TaskSet,
    how: How,
    processors: Processors,
    /// Of each task the jobs that are ready and not done, and what they cost; the first is being done.
    waiting: Vec<VecDeque<(usize, i128)>>,
    jobs: Vec<Job>,
}

impl Stage<'_> {
    fn submit(&mut self) {
        for task in 0..self.set.len() {
            if self.processors.is_busy(task) {
                continue;
            }
            let Some((job, cost)) = self.waiting[task].front() else { continue };
            let rank = match self.how.policy {
                Policy::FixedPriority => task as i128,
                Policy::EarliestDeadline => self.jobs[*job].deadline,
            };
            self.processors.submit(task, rank, *cost);
        }
    }

    fn advance(&mut self, until: i128) {
        let ended = self.processors.advance(until).to_vec();
        let now = self.processors.now();
        for task in ended {
            if let Some((job, _)) = self.waiting[task].pop_front() {
                self.jobs[job].end = Some(now);
            }
        }
    }

    fn pieces(&mut self, pieces: &mut Vec<Piece>) {
        for ran in self.processors.ran() {
            let piece = Piece { task: ran.thread, processor: ran.processor, from: ran.from, to: ran.to };
            let last =
                pieces.iter_mut().rev().take(64).find(|last: &&mut Piece| last.processor == piece.processor);
            match last {
                Some(last) if last.task == piece.task && last.to == piece.from => last.to = piece.to,
                _ => pieces.push(piece),
            }
        }
    }
}
