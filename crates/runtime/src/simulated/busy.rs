//! Steps that take time: executors share virtual processors, on which the higher ones take precedence at once.
//!
//! A step reads what is there when it begins and what it sends is seen when it ends. Between the two it needs its cost of processor time, as
//! its plan declares; where none is declared it takes none. An agent that hangs keeps its processor until it is given up.

use std::sync::Arc;

use schedule::processors::Processors;
use types::{AgentId, Duration, Time};

use super::Player;
use crate::census::{Burden, Foreign, HostReading, mask_of};
use crate::executor::{Ended, Job};
use crate::plan::ExecutorPlan;
use crate::port::OutputEnd;
use crate::system::CannotRun;

/// Virtual processors, and what the executors do on them.
pub(super) struct Busy {
    processors: Processors,
    doing: Vec<Doing>,
    /// What else takes time of them, as threads behind those of the executors, and when each has more to do.
    burdens: Vec<(Burden, Time)>,
    /// Since when what ran where has not been told.
    told: Time,
}

#[derive(Default)]
struct Doing {
    step: Option<Played>,
    /// Keep back what the step sends.
    outputs: Vec<Arc<dyn OutputEnd>>,
}

/// A step between its beginning and its end.
#[derive(Clone, Copy)]
struct Played {
    job: Job,
    of: AgentId,
    begun: Time,
    cost: Duration,
    /// Whether it takes longer than its budget for refinements.
    overran: bool,
}

/// A step that never ends.
const FOR_EVER: i128 = i128::MAX >> 8;

impl Busy {
    /// So many processors for these executors, and for what else burdens them. What runs where is kept where somebody wants to be `told`.
    pub(super) fn new<'a>(
        count: usize,
        executors: impl Iterator<Item = &'a ExecutorPlan>,
        burdens: Vec<Burden>,
        told: bool,
    ) -> Busy {
        let mut processors = Processors::new(count);
        if told {
            processors = processors.recording();
        }
        let mut doing = Vec::new();
        for executor in executors {
            processors.thread(mask_of(&executor.cpus));
            doing.push(Doing::default());
        }
        for burden in &burdens {
            processors.thread(mask_of(&burden.cpus));
        }
        let begins = |burden: Burden| {
            let first = Time::ZERO + burden.from;
            (burden, first)
        };
        Busy { processors, doing, burdens: burdens.into_iter().map(begins).collect(), told: Time::ZERO }
    }

    /// When a burden has more to do.
    pub(super) fn next_burden(&self) -> Time {
        self.burdens.iter().map(|(_, next)| *next).min().unwrap_or(Time::NEVER)
    }

    /// Gives burdens what they have to do now. One that is not done with the last yet passes over it.
    fn burden(&mut self, now: Time) {
        for (place, (burden, next)) in self.burdens.iter_mut().enumerate() {
            if *next > now {
                continue;
            }
            let thread = self.doing.len() + place;
            if !self.processors.is_busy(thread) {
                self.processors.submit(thread, -i128::from(burden.priority), burden.work().0.into());
            }
            *next += burden.period.max(Duration(1));
            if *next - Time::ZERO >= burden.until {
                *next = Time::NEVER;
            }
        }
    }

    /// What ran where since this was asked last.
    pub(super) fn reading(&mut self, now: Time) -> HostReading {
        let length = (now - self.told).0 as f64;
        self.told = now;
        let mut processors = vec![0.0; self.processors.count()];
        let mut burdens = vec![0.0; self.burdens.len()];
        for ran in self.processors.ran() {
            let share = (ran.to - ran.from) as f64 / length.max(1.0);
            processors[ran.processor] += share;
            if let Some(place) = ran.thread.checked_sub(self.doing.len()) {
                burdens[place] += share;
            }
        }
        let foreign = self.burdens.iter().zip(&burdens).filter(|(_, share)| **share > 0.0);
        let foreign = foreign.map(|((burden, _), share)| Foreign {
            name: burden.name.clone(),
            priority: burden.priority,
            may: mask_of(&burden.cpus),
            share: *share as f32,
        });
        HostReading {
            processors: processors.into_iter().map(|share: f64| share as f32).collect(),
            foreign: burdens.iter().sum::<f64>() as f32,
            burdens: foreign.collect(),
            ..HostReading::default()
        }
    }

    /// When the next of the steps ends that are under way, as far as nothing comes between.
    pub(super) fn next_end(&self) -> Time {
        self.processors.next_end().map_or(Time::NEVER, |at| Time(i64::try_from(at).unwrap_or(i64::MAX)))
    }

    pub(super) fn is_busy(&self, executor: usize) -> bool {
        self.processors.is_busy(executor)
    }

    /// What an executor does is given up: its processor is free again.
    pub(super) fn give_up(&mut self, executor: usize) {
        self.processors.cancel(executor);
        self.doing[executor].step = None;
    }
}

impl Player {
    /// Does everything that is to be done at this instant: ends what is over, and begins what has a processor.
    pub(super) fn busy_instant(&mut self, busy: &mut Busy) -> Result<(), CannotRun> {
        let most = super::STEPS_AT_ONCE * (1 + self.router.agents_count() as u64);
        let now = i128::from(self.now.0);
        for _ in 0..most {
            let ended = busy.processors.advance(now).to_vec();
            busy.burden(self.now);
            let executors = busy.doing.len();
            for at in ended.iter().filter(|at| **at < executors) {
                self.end(busy, *at);
            }
            for at in self.order.clone() {
                let core = &mut self.cores[at];
                let _ = core.look_at_door();
                core.note_ready(self.now);
                if !busy.is_busy(at) && !core.is_idle(self.now) {
                    let rank = self.rank(at);
                    busy.processors.submit(at, rank, 0);
                }
            }
            let mut begun = busy.processors.dispatch().to_vec();
            // One that begins and takes no time ends at this very instant.
            if begun.is_empty() && ended.is_empty() {
                return Ok(());
            }
            begun.sort_by_key(|at| self.order.iter().position(|place| place == at));
            for at in begun.into_iter().filter(|at| *at < executors) {
                self.begin(busy, at);
            }
        }
        Err(self.endless())
    }

    /// The smaller goes first: by deadline before all priorities, and among themselves by when they must be done. What their steps take
    /// beyond their budget is not held back here.
    fn rank(&self, executor: usize) -> i128 {
        let plan = &self.router.executors[executor].plan;
        match self.cores[executor].budget().filter(|_| plan.is_by_deadline()) {
            Some(budget) => {
                i128::from(i64::MIN) - i128::from(i64::MAX) + i128::from((self.now + budget.deadline).0)
            }
            None => -i128::from(plan.level().unwrap_or(0)),
        }
    }

    fn begin(&mut self, busy: &mut Busy, at: usize) {
        let Some(job) = self.cores[at].next_played(self.now) else { return };
        let Some(played) = self.router.played(at, job.slot) else { return };
        played.outputs.iter().for_each(|output| output.hold());
        let ended = self.step(at, job);
        let refined = self.cores[at].refined(job.slot);
        let (of, cost) = (played.of, played.cost + played.refinement * i64::from(refined));
        let overran = refined > 0 && cost > played.budget;
        let doing = &mut busy.doing[at];
        doing.outputs = played.outputs;
        match ended {
            Some(Ended::AskedToHang(slot)) => {
                busy.processors.costs(at, FOR_EVER);
                self.hang(at, slot);
            }
            Some(Ended::Normally) => {
                busy.processors.costs(at, cost.0.into());
                doing.step = Some(Played { job, of, begun: self.now, cost, overran });
            }
            Some(Ended::NotRun) | None => {}
        }
    }

    /// Sends what steps have sent that are under way, before all are stopped.
    pub(super) fn end_all(&mut self, busy: &mut Busy) {
        for at in 0..self.cores.len() {
            busy.doing[at].step = None;
            self.end(busy, at);
        }
    }

    /// A step ends: what it sent goes out.
    pub(super) fn end(&mut self, busy: &mut Busy, at: usize) {
        let Doing { step, outputs } = std::mem::take(&mut busy.doing[at]);
        if !outputs.is_empty() {
            self.context.enter_executor(self.cores[at].number);
            self.context.begin(step.map_or(AgentId::NONE, |step| step.of), self.now);
            outputs.iter().for_each(|output| output.release());
            self.context.end();
            self.cores[at].mark_woken_by(&self.context);
        }
        if let Some(Played { job, of, begun, cost, overran }) = step {
            self.cores[at].count_played(&self.context, job, of, begun, self.now, cost, overran);
        }
    }
}
