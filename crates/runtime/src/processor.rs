//! What a step used of its processor: the time it took, less what higher executors took from it.
//!
//! ```text
//!   high              ┌──busy──┐ +8        ┌─busy─┐ +6
//!   low   ──┌─begin───┘        └───────────┘      └────end──┐──
//!           others = 0                              others = 14     own = end − begin − 14
//! ```
//!
//! For each processor there is one sum of what executors with a real-time priority have used of it. An executor adds to it
//! before it sleeps, less what the sum itself grew by meanwhile, so time is counted once. Whoever is pre-empted goes on when
//! the higher one has added its part, on the same processor: nothing is in flight between the two readings of a step.
//!
//! What it does not see: the switch between two threads itself, a microsecond or two each; the witness, the watchdog and other
//! processes with a priority; and a thread that changed its processor in a step, whose whole time then counts. Those err to the
//! long side. A thread that changed there and back again within a step can err to the short side. Now and then a step
//! is held against the thread's clock, and how often the two disagree is counted.

use core::cell::Cell;
use core::sync::atomic::{AtomicU64, Ordering};

use types::{Duration, Time};

use crate::os;
use crate::witness::Witness;

/// A line of memory of its own, or processors would take it from one another. Two, for those that fetch them in pairs.
#[derive(Debug, Default)]
#[repr(align(128))]
struct Line(AtomicU64);

/// What executors with a real-time priority have used of each processor, in [`os::ticks`].
#[derive(Debug)]
pub(crate) struct Processors {
    used: Box<[Line]>,
    /// The highest priority that any executor was granted.
    highest: Line,
}

/// Stands for a processor that is not known.
const NOWHERE: usize = usize::MAX;

/// The clock of a processor, read.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reading {
    pub ticks: u64,
    processor: usize,
    /// What had been used of the processor.
    used: u64,
}

impl Reading {
    /// A reading that tells of the time alone.
    #[inline]
    pub(crate) fn of_time() -> Reading {
        Reading { ticks: os::ticks(), processor: NOWHERE, used: 0 }
    }

    /// A reading on a processor of which `line` has been used.
    #[inline]
    fn on(processor: usize, line: &AtomicU64) -> Reading {
        let mut used = line.load(Ordering::Relaxed);
        loop {
            let ticks = os::ticks();
            let again = line.load(Ordering::Relaxed);
            // A higher executor that ran between the two would count as time and not as its own.
            if again == used {
                return Reading { ticks, processor, used };
            }
            used = again;
        }
    }

    /// The ticks from here to `end`.
    #[inline]
    pub(crate) fn elapsed(&self, end: &Reading) -> u64 {
        end.ticks.saturating_sub(self.ticks)
    }

    /// The ticks from here to `end` that others used, as far as they are known.
    #[inline]
    pub(crate) fn others(&self, end: &Reading) -> u64 {
        if self.processor == end.processor { end.used.wrapping_sub(self.used) } else { 0 }
    }

    /// The ticks from here to `end` without those of others.
    #[inline]
    pub(crate) fn own(&self, end: &Reading) -> u64 {
        self.elapsed(end).saturating_sub(self.others(end))
    }
}

impl Processors {
    pub(crate) fn new() -> Processors {
        let used = (0..os::processors()).map(|_| Line::default()).collect();
        Processors { used, highest: Line::default() }
    }

    /// A reading on a processor.
    #[inline]
    fn read(&self, processor: usize) -> Reading {
        let Some(Line(line)) = self.used.get(processor) else { return Reading::of_time() };
        Reading::on(processor, line)
    }

    /// Adds what an executor used of its processor.
    fn add(&self, from: &Reading, to: &Reading) {
        if let Some(Line(line)) = self.used.get(from.processor)
            && from.processor == to.processor
        {
            // The addition is one instruction, so a higher executor between load and store loses nothing.
            line.fetch_add(from.own(to), Ordering::Relaxed);
        }
    }
}

/// The time of the run by the ticks of the processor, held against the clock again and again.
///
/// To read the clock costs three times what reading the ticks does, and what happens between two steps reads it once.
#[derive(Debug)]
struct Pace {
    /// From the monotonic clock to the time of the run (ns).
    offset: i64,
    /// When the clock was last read: ticks, and the time of the run.
    ticks: Cell<u64>,
    time: Cell<i64>,
    /// Nanoseconds in a tick, in units of 2⁻³².
    rate: u64,
    /// After how many ticks the clock is read again.
    good_for: u64,
}

/// For how long the ticks alone tell the time (ns). A clock that is being corrected by the most that is usual, half a thousandth,
/// differs by half a microsecond then.
const GOOD_FOR: f64 = 1e6;

impl Pace {
    fn new(offset: i64) -> Pace {
        let nanos_per_tick = os::nanos_per_tick();
        let pace = Pace {
            offset,
            ticks: Cell::new(0),
            time: Cell::new(0),
            rate: rate(nanos_per_tick),
            good_for: (GOOD_FOR / nanos_per_tick) as u64,
        };
        pace.renew();
        pace
    }

    fn renew(&self) {
        let (monotonic, ticks) = os::monotonic_and_ticks();
        self.time.set(monotonic + self.offset);
        self.ticks.set(ticks);
    }

    #[inline]
    fn is_old(&self, ticks: u64) -> bool {
        ticks.wrapping_sub(self.ticks.get()) > self.good_for
    }

    #[inline]
    fn time(&self, ticks: u64) -> Time {
        // Ticks of another processor can be a few behind.
        Time(self.time.get() + scaled(ticks.saturating_sub(self.ticks.get()), self.rate) as i64)
    }
}

/// Nanoseconds in a tick, in units of 2⁻³².
pub(crate) fn rate(nanos_per_tick: f64) -> u64 {
    (nanos_per_tick * 4_294_967_296.0) as u64
}

/// Ticks in nanoseconds.
#[inline]
pub(crate) fn scaled(ticks: u64, rate: u64) -> u64 {
    ((u128::from(ticks) * u128::from(rate)) >> 32) as u64
}

/// A point in the run between two steps: the end of one, and the beginning of the next.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moment {
    /// What agents see.
    pub time: Time,
    pub reading: Reading,
}

impl Moment {
    /// In simulated time, which a step does not take.
    #[inline]
    pub(crate) fn simulated(time: Time) -> Moment {
        Moment { time, reading: Reading::of_time() }
    }
}

/// How often a step is held against the thread's clock: a prime number, to be in step with no agent.
const CHECK_EVERY: Duration = Duration::millis(97);
/// The least difference that is one (ns): two system calls, an interrupt, the witness and the watchdog.
const CHECK_SLACK: u64 = 20_000;

/// A thread's view of its processor, and of those who watch it.
pub(crate) struct Stopwatch<'a> {
    pub witness: &'a Witness,
    processors: &'a Processors,
    /// The real-time priority that was granted; zero for an ordinary thread.
    level: Cell<u64>,
    /// The processor time in a period that was granted under `SCHED_DEADLINE`.
    budget: Cell<Option<Duration>>,
    /// The executor's number.
    executor: usize,
    /// The one processor on which the thread may run, and what has been used of it.
    only: Option<(usize, &'a AtomicU64)>,
    pace: Pace,
}

impl<'a> Stopwatch<'a> {
    /// For the calling thread, which may run on `allowed`, on all when that is empty. `offset` leads from the monotonic clock to the
    /// time of the run (ns).
    pub(crate) fn new(
        witness: &'a Witness,
        processors: &'a Processors,
        executor: usize,
        allowed: &[usize],
        offset: i64,
    ) -> Stopwatch<'a> {
        let only = if let [only] = allowed { Some(*only) } else { None };
        let only = only.and_then(|only| Some((only, &processors.used.get(only)?.0)));
        let (level, budget) = (Cell::new(0), Cell::new(None));
        Stopwatch { witness, processors, level, budget, executor, only, pace: Pace::new(offset) }
    }

    /// Says where the thread stands now: its priority, and what it has under `SCHED_DEADLINE`, where others like it can pre-empt it.
    pub(crate) fn stands_at(&self, (level, budget): (u64, Option<Duration>)) {
        let above = level + u64::from(budget.is_some());
        self.processors.highest.0.fetch_max(above, Ordering::Relaxed);
        self.level.set(level);
        self.budget.set(budget);
        // It is awake.
        self.witness.works(self.executor, budget.unwrap_or(Duration::ZERO));
    }

    /// The present: the end of a step.
    #[inline]
    pub(crate) fn moment(&self) -> Moment {
        let reading = self.read();
        Moment { time: self.pace.time(reading.ticks), reading }
    }

    /// The present after something else than a step, or when the time is held against the clock. It never goes back behind `before`.
    #[inline]
    pub(crate) fn fresh(&self, before: Time) -> Moment {
        let reading = self.read();
        if self.pace.is_old(reading.ticks) {
            self.pace.renew();
        }
        Moment { time: self.pace.time(reading.ticks).max(before), reading }
    }

    /// Whether the clock is to be read again.
    #[inline]
    pub(crate) fn is_old(&self, moment: &Moment) -> bool {
        self.pace.is_old(moment.reading.ticks)
    }

    /// The beginning or the end of a step. Whom nobody can pre-empt reads the time alone.
    #[inline(always)]
    fn read(&self) -> Reading {
        match self.only {
            Some((only, line)) => Reading::on(only, line),
            None if self.processors.highest.0.load(Ordering::Relaxed) <= self.level.get() => {
                Reading::of_time()
            }
            None => self.read_any(),
        }
    }

    fn read_all(&self) -> Reading {
        match self.only {
            Some((only, line)) => Reading::on(only, line),
            None => self.read_any(),
        }
    }

    #[inline(never)]
    fn read_any(&self) -> Reading {
        self.processors.read(os::processor())
    }

    /// The thread has woken. Nothing for an ordinary one: it does not pre-empt, and may be in the middle of something when others
    /// run, so its time is nobody's loss.
    #[inline]
    pub(crate) fn wake(&self) -> Option<Reading> {
        if let Some(budget) = self.budget.get() {
            self.witness.works(self.executor, budget);
        }
        (self.level.get() > 0).then(|| self.read_all())
    }

    /// The thread is about to sleep: what it used since it woke becomes known.
    #[inline]
    pub(crate) fn rest(&self, woken: &Option<Reading>) {
        if let Some(woken) = woken {
            let now = self.read_all();
            self.processors.add(woken, &now);
            if self.budget.get().is_some() {
                self.rest_above(woken, &now);
            }
        }
    }

    /// The witness stands below a thread that runs by its deadline.
    fn rest_above(&self, woken: &Reading, now: &Reading) {
        let used = Duration(scaled(woken.own(now), self.pace.rate) as i64);
        let moved = (woken.processor != now.processor).then_some(now.processor);
        self.witness.rests(self.executor, [Some(woken.processor), moved], used);
    }
}

/// When a step is next held against the thread's clock.
#[derive(Debug, Default)]
pub(crate) struct Checks {
    next: Time,
}

impl Checks {
    /// Reads the thread's clock when it is time to (ns). The one permitted system call of a step.
    #[inline]
    pub(crate) fn begin(&mut self, now: Time) -> Option<u64> {
        if now < self.next {
            return None;
        }
        self.next = now + CHECK_EVERY;
        Some(os::thread_time())
    }
}

/// Whether a step of `own` ns by our count agrees with `used` ns by the thread's clock: to a sixteenth and a little.
pub(crate) fn agrees(own: u64, used: u64) -> bool {
    own.abs_diff(used) <= CHECK_SLACK + own.max(used) / 16
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(ticks: u64, processors: &Processors) -> Reading {
        Reading { ticks, processor: 0, used: processors.used[0].0.load(Ordering::Relaxed) }
    }

    #[test]
    fn those_who_are_pre_empted_count_their_own_time_and_no_time_counts_twice() {
        let all = Processors::new();
        let low = at(0, &all);
        let middle = at(10, &all);
        let high = at(20, &all);
        all.add(&high, &at(30, &all));
        assert_eq!(middle.own(&at(50, &all)), 30, "40 less the 10 of the higher one");
        all.add(&middle, &at(50, &all));
        let high = at(60, &all);
        all.add(&high, &at(65, &all));
        assert_eq!(low.own(&at(100, &all)), 55);
        assert_eq!(low.elapsed(&at(100, &all)), 100);
    }

    #[test]
    fn what_ran_on_another_processor_is_nobodys_loss() {
        let (begin, end) = (Reading { ticks: 5, processor: 0, used: 7 }, |processor, used| Reading {
            ticks: 25,
            processor,
            used,
        });
        assert_eq!(begin.own(&end(0, 7)), 20);
        assert_eq!(begin.own(&end(0, 15)), 12);
        assert_eq!(begin.own(&end(1, 9_000)), 20, "it moved: all of it counts");
        assert_eq!(begin.own(&end(0, 9_000)), 0, "never less than nothing");
        let known = Processors::new();
        known.add(&begin, &end(1, 7));
        known.add(&Reading { processor: NOWHERE, ..begin }, &end(NOWHERE, 7));
        assert!(known.used.iter().all(|line| line.0.load(Ordering::Relaxed) == 0));
    }

    #[test]
    fn a_clock_that_differs_by_more_than_a_sixteenth_and_a_little_disagrees() {
        assert!(agrees(1_000, 20_000) && agrees(1_000_000, 1_060_000));
        assert!(!agrees(1_000, 30_000) && !agrees(2_000_000, 1_000_000));
    }

    /// Plays an executor of this level, whose script says how long it works and when a higher one comes. Gives its own time.
    fn play(level: u32, script: &[u8], clock: &mut u64, all: &Processors) -> u64 {
        let (begin, mut own) = (at(*clock, all), 0);
        for word in script.iter().copied() {
            if word % 3 == 0 && level < 4 {
                play(level + 1, &[word / 3, word / 5, word / 7], clock, all);
            } else {
                *clock += u64::from(word);
                own += u64::from(word);
            }
        }
        let end = at(*clock, all);
        assert_eq!(begin.own(&end), own);
        all.add(&begin, &end);
        own
    }

    proptest::proptest! {
        /// However they pre-empt one another, each counts its own time, and all of it together is the time that went by.
        #[test]
        fn all_times_add_up(script in proptest::collection::vec(proptest::prelude::any::<u8>(), 0..40)) {
            let (all, mut clock) = (Processors::new(), 0);
            play(0, &script, &mut clock, &all);
            proptest::prop_assert_eq!(all.used[0].0.load(Ordering::Relaxed), clock);
        }
    }
}
