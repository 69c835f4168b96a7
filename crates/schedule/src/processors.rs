//! Virtual processors that run threads by rank, and take a processor away from a thread when one that goes before it wants it.
//!
//! Whoever simulates says which jobs there are and when; this says who runs. Time goes on in turns of three calls:
//!
//! 1. [`submit`](Processors::submit) what has become ready now;
//! 2. [`dispatch`](Processors::dispatch) gives processors to those who go first, and tells which jobs begin; a job whose cost was not known is
//!    told it now ([`costs`](Processors::costs));
//! 3. [`advance`](Processors::advance) goes on to the next instant at which something ends, or to a given one.
//!
//! As in an operating system with fixed priorities a thread runs on one processor at a time, goes on where it was when it can, and of two with
//! the same rank the one that became ready first goes first.

/// What a thread may run on: a bit for each processor.
pub type Mask = u64;

/// All processors.
pub const ANYWHERE: Mask = Mask::MAX;

/// So many processors and the threads that share them. Times are whole numbers of any unit.
#[derive(Clone, Debug)]
pub struct Processors {
    now: i128,
    count: usize,
    threads: Vec<Thread>,
    /// Counts what was submitted.
    submitted: u64,
    ended: Vec<usize>,
    begun: Vec<usize>,
    /// Who runs where, in the order of the processors.
    running: Vec<Option<usize>>,
    ran: Option<Vec<Ran>>,
}

#[derive(Clone, Debug)]
struct Thread {
    may: Mask,
    job: Option<Job>,
}

#[derive(Clone, Copy, Debug)]
struct Job {
    rank: i128,
    turn: u64,
    left: i128,
    has_begun: bool,
    on: Option<usize>,
}

/// That a thread ran on a processor from one time to another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ran {
    /// Which thread.
    pub thread: usize,
    /// On which processor.
    pub processor: usize,
    /// From when.
    pub from: i128,
    /// To when.
    pub to: i128,
}

impl Processors {
    /// Some processors, 64 at most, without threads, at time 0.
    pub fn new(count: usize) -> Processors {
        let count = count.clamp(1, 64);
        Processors {
            now: 0,
            count,
            threads: Vec::new(),
            submitted: 0,
            ended: Vec::new(),
            begun: Vec::new(),
            running: vec![None; count],
            ran: None,
        }
    }

    /// Keeps who ran when, to be taken by [`Processors::ran`].
    pub fn recording(self) -> Processors {
        Processors { ran: Some(Vec::new()), ..self }
    }

    /// Another thread, which may run on these; its number. One that may run on none of those that there are may run on all.
    pub fn thread(&mut self, may: Mask) -> usize {
        let there = Mask::MAX >> (64 - self.count);
        let may = if may & there == 0 { there } else { may & there };
        self.threads.push(Thread { may, job: None });
        self.threads.len() - 1
    }

    /// How many processors there are.
    pub fn count(&self) -> usize {
        self.count
    }

    /// What time it is.
    pub fn now(&self) -> i128 {
        self.now
    }

    /// Whether a thread has something to do.
    pub fn is_busy(&self, thread: usize) -> bool {
        self.threads[thread].job.is_some()
    }

    /// Gives a thread that has nothing to do a job, ready now. Smaller ranks go first.
    pub fn submit(&mut self, thread: usize, rank: i128, cost: i128) {
        self.submitted += 1;
        let job = Job { rank, turn: self.submitted, left: cost, has_begun: false, on: None };
        self.threads[thread].job = Some(job);
    }

    /// Says what the job of a thread costs that has just begun.
    pub fn costs(&mut self, thread: usize, cost: i128) {
        if let Some(job) = &mut self.threads[thread].job {
            job.left = cost;
        }
    }

    /// Gives the processors to those who go first. The threads whose jobs begin with that.
    pub fn dispatch(&mut self) -> &[usize] {
        let mut order: Vec<usize> = (0..self.threads.len()).filter(|at| self.is_busy(*at)).collect();
        order.sort_by_key(|at| self.threads[*at].job.map(|job| (job.rank, job.turn)));
        let before = std::mem::replace(&mut self.running, vec![None; self.count]);
        // Of two processors the one whose thread goes last is taken away first, and an idle one before all.
        let place = |thread: Option<usize>| match thread.and_then(|at| order.iter().position(|it| *it == at))
        {
            Some(place) => place,
            None => usize::MAX,
        };
        let last: Vec<usize> = before.iter().map(|thread| place(*thread)).collect();
        self.begun.clear();
        for thread in order {
            let Thread { may, job: Some(job) } = &mut self.threads[thread] else { continue };
            let free = |cpu: &usize| *may >> cpu & 1 == 1 && self.running[*cpu].is_none();
            let home = job.on.filter(|cpu| free(cpu) && before[*cpu] == Some(thread));
            let cpu = home.or_else(|| {
                (0..self.count).filter(free).max_by_key(|cpu| (last[*cpu], std::cmp::Reverse(*cpu)))
            });
            job.on = cpu.or(job.on);
            let Some(cpu) = cpu else { continue };
            self.running[cpu] = Some(thread);
            if !job.has_begun {
                job.has_begun = true;
                self.begun.push(thread);
            }
        }
        &self.begun
    }

    /// Goes on to the first instant at which a job ends, but not beyond `until`. The threads whose jobs ended; none when `until` came first.
    pub fn advance(&mut self, until: i128) -> &[usize] {
        let end = self.next_end().unwrap_or(until).min(until);
        let step = (end - self.now).max(0);
        self.ended.clear();
        for cpu in 0..self.count {
            let Some(thread) = self.running[cpu] else { continue };
            let Some(job) = &mut self.threads[thread].job else { continue };
            job.left -= step;
            let is_over = job.left <= 0;
            note(&mut self.ran, Ran { thread, processor: cpu, from: self.now, to: self.now + step });
            if is_over {
                self.threads[thread].job = None;
                self.running[cpu] = None;
                self.ended.push(thread);
            }
        }
        self.now += step;
        &self.ended
    }

    /// When the first of those that run ends, if nothing comes between; nothing where nobody runs.
    pub fn next_end(&self) -> Option<i128> {
        let left = |thread: &usize| self.threads[*thread].job.map_or(0, |job| job.left);
        self.running.iter().flatten().map(left).min().map(|left| self.now.saturating_add(left))
    }

    /// Takes a thread's job away, done or not.
    pub fn cancel(&mut self, thread: usize) {
        self.threads[thread].job = None;
        self.running
            .iter_mut()
            .filter(|running| **running == Some(thread))
            .for_each(|running| *running = None);
    }

    /// Who ran when, as far as it was kept and not taken yet.
    pub fn ran(&mut self) -> Vec<Ran> {
        self.ran.as_mut().map(std::mem::take).unwrap_or_default()
    }
}

/// Keeps it, together with what went before when that is the same.
fn note(kept: &mut Option<Vec<Ran>>, new: Ran) {
    let Some(kept) = kept else { return };
    if new.from == new.to {
        return;
    }
    // The last of each processor is not far back.
    let last = kept.iter_mut().rev().take(64).find(|ran| ran.processor == new.processor);
    match last {
        Some(ran) if ran.thread == new.thread && ran.to == new.from => ran.to = new.to,
        _ => kept.push(new),
    }
}
