//! Steps that take time: executors share virtual processors, on which the higher ones take precedence at once.
//!
//! A step reads what is there when it begins and what it sends is seen when it ends. Between the two it needs its cost of processor time, as
//! its plan declares; where none is declared it takes none. An agent that hangs keeps its processor until it is given up.

use std::sync::Arc;

use schedule::processors::{ANYWHERE, Mask, Processors};
use types::{AgentId, Duration, Time};

use super::Player;
use crate::executor::{Ended, Job};
use crate::plan::ExecutorPlan;
use crate::port::OutputEnd;
use crate::system::CannotRun;

/// Virtual processors, and what the executors do on them.
pub(super) struct Busy {
    processors: Processors,
    doing: Vec<Doing>,
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
}

/// A step that never ends.
const FOR_EVER: i128 = i128::MAX >> 8;

impl Busy {
    /// So many processors for these executors.
    pub(super) fn new<'a>(count: usize, executors: impl Iterator<Item = &'a ExecutorPlan>) -> Busy {
        let mut processors = Processors::new(count);
        let mut doing = Vec::new();
        for executor in executors {
            let may = executor.cpus.iter().fold(0, |may, cpu| may | Mask::from(1u8) << (cpu & 63));
            processors.thread(if may == 0 { ANYWHERE } else { may });
            doing.push(Doing::default());
        }
        Busy { processors, doing }
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
            for at in &ended {
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
            for at in begun {
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
        let (of, outputs, cost) = self.router.played(at, job.slot);
        outputs.iter().for_each(|output| output.hold());
        let ended = self.step(at, job);
        let doing = &mut busy.doing[at];
        doing.outputs = outputs;
        match ended {
            Some(Ended::AskedToHang(slot)) => {
                busy.processors.costs(at, FOR_EVER);
                self.hang(at, slot);
            }
            Some(Ended::Normally) => {
                busy.processors.costs(at, cost.0.into());
                doing.step = Some(Played { job, of, begun: self.now, cost });
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
        if let Some(Played { job, of, begun, cost }) = step {
            self.cores[at].count_played(&self.context, job, of, begun, self.now, cost);
        }
    }
}
