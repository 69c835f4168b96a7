//! Figures of what agents do: written by the thread that runs them with plain stores, read by anybody at any time.

use core::sync::atomic::{AtomicU32, AtomicU64, Ordering::Relaxed};

use types::{Duration, Time};

use crate::fetch::fetch;

/// Steps of the histogram in each doubling.
const PER_OCTAVE: u32 = 8;
/// The first step holds all up to this many nanoseconds.
const FIRST: u32 = 5;
const OCTAVES: u32 = 36;
const BUCKETS: usize = (OCTAVES * PER_OCTAVE) as usize;

/// A figure of spans of time, kept by one writer.
///
/// What every value changes stands in one line of memory with the first steps: a span of nothing touches no other.
#[derive(Debug)]
#[repr(C, align(64))]
pub struct Histogram {
    n: AtomicU64,
    last: AtomicU64,
    sum: AtomicU64,
    min: AtomicU64,
    max: AtomicU64,
    buckets: [AtomicU32; BUCKETS],
}

/// A figure as it is shown, in nanoseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Figure {
    /// How many values.
    pub n: u64,
    /// The last.
    pub last: f64,
    /// The least.
    pub min: f64,
    /// The mean.
    pub mean: f64,
    /// Half are at most this.
    pub p50: f64,
    /// Of a hundred, ninety-nine are at most this.
    pub p99: f64,
    /// Of a thousand, all but one are at most this.
    pub p999: f64,
    /// The greatest, unfiltered.
    pub max: f64,
}

impl Default for Histogram {
    fn default() -> Histogram {
        Histogram {
            n: AtomicU64::new(0),
            last: AtomicU64::new(0),
            sum: AtomicU64::new(0),
            min: AtomicU64::new(u64::MAX),
            max: AtomicU64::new(0),
            buckets: [const { AtomicU32::new(0) }; BUCKETS],
        }
    }
}

fn bucket(nanos: u64) -> usize {
    let octave = 63 - (nanos | 1).leading_zeros();
    if octave < FIRST {
        return 0;
    }
    let within = (nanos >> (octave - 3)) as u32 & (PER_OCTAVE - 1);
    (((octave - FIRST) * PER_OCTAVE + within) as usize).min(BUCKETS - 1)
}

/// The upper end of a bucket (ns).
fn upper(bucket: usize) -> f64 {
    let (octave, within) = (bucket as u32 / PER_OCTAVE + FIRST, bucket as u32 % PER_OCTAVE);
    (1u64 << octave) as f64 * (1.0 + f64::from(within + 1) / f64::from(PER_OCTAVE))
}

impl Histogram {
    /// Adds a span. Only one thread may.
    #[inline]
    pub fn add(&self, nanos: u64) {
        let add =
            |counter: &AtomicU64, by: u64| counter.store(counter.load(Relaxed).wrapping_add(by), Relaxed);
        add(&self.n, 1);
        add(&self.sum, nanos);
        self.last.store(nanos, Relaxed);
        let (min, max) = (self.min.load(Relaxed), self.max.load(Relaxed));
        // One comparison where it is neither: most are not. Before the first, both are.
        if nanos.wrapping_sub(min) > max.wrapping_sub(min) || max < min {
            self.min.store(nanos.min(min), Relaxed);
            self.max.store(nanos.max(max), Relaxed);
        }
        let bucket = &self.buckets[bucket(nanos)];
        bucket.store(bucket.load(Relaxed).wrapping_add(1), Relaxed);
    }

    /// How many values lie in each of its steps that is not empty: the upper end of the step (ns), and the count.
    pub fn steps(&self) -> Vec<(f64, u32)> {
        steps(&[self])
    }

    /// What it shows now. Percentiles are the upper ends of steps of an eighth of a doubling.
    pub fn figure(&self) -> Figure {
        figure(&[self])
    }
}

/// The counts of several histograms as if they were one.
fn counts(parts: &[&Histogram]) -> Vec<u64> {
    let count = |bucket: usize| parts.iter().map(|part| u64::from(part.buckets[bucket].load(Relaxed))).sum();
    (0..BUCKETS).map(count).collect()
}

fn steps(parts: &[&Histogram]) -> Vec<(f64, u32)> {
    let counts = counts(parts).into_iter().enumerate();
    counts.filter(|(_, count)| *count > 0).map(|(bucket, count)| (upper(bucket), count as u32)).collect()
}

fn figure(parts: &[&Histogram]) -> Figure {
    let sum = |of: fn(&Histogram) -> &AtomicU64| parts.iter().map(|part| of(part).load(Relaxed)).sum::<u64>();
    let n = sum(|part| &part.n);
    if n == 0 {
        return Figure::default();
    }
    let min = parts.iter().map(|part| part.min.load(Relaxed)).min().unwrap_or(0) as f64;
    let max = parts.iter().map(|part| part.max.load(Relaxed)).max().unwrap_or(0) as f64;
    let counts = counts(parts);
    let counted: u64 = counts.iter().sum();
    let at = |share: f64| {
        let wanted = (share * counted as f64).ceil() as u64;
        let mut seen = 0;
        let found = counts.iter().position(|count| {
            seen += count;
            seen >= wanted
        });
        found.map_or(max, upper).clamp(min, max)
    };
    Figure {
        n,
        last: parts.first().map_or(0.0, |part| part.last.load(Relaxed) as f64),
        min,
        mean: sum(|part| &part.sum) as f64 / n as f64,
        p50: at(0.5),
        p99: at(0.99),
        p999: at(0.999),
        max,
    }
}

/// What steps took of late: since one time or another within the last two spans.
///
/// It is told from how the counts of histograms grow, so nobody who makes steps has to do with it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Window {
    /// The counts at the beginning of this span and of the one before.
    this: Vec<u64>,
    before: Vec<u64>,
    begun: Option<Time>,
    /// How many steps there had been when it was made.
    earlier: u64,
    /// Whether the next steps that are seen do not count: the first of them began before.
    passes_over: bool,
}

impl Window {
    /// One that begins with the first step from now on, not with one that is under way.
    pub(crate) fn of(stats: &AgentStats) -> Window {
        let counts = stats.exec_counts();
        let earlier = counts.iter().sum();
        Window { before: counts.clone(), this: counts, begun: None, earlier, passes_over: true }
    }

    /// How many steps there were since it was made.
    pub(crate) fn steps(&self, stats: &AgentStats) -> u64 {
        stats.longest().0.saturating_sub(self.earlier)
    }

    /// The longest step as far as the window has been looked at, and since.
    pub(crate) fn longest(&self, stats: &AgentStats) -> Duration {
        self.since_before(stats).1
    }

    /// How many steps there were, and the longest of them, to an eighth of a doubling.
    pub(crate) fn look(&mut self, stats: &AgentStats, now: Time, span: Duration) -> (u64, Duration) {
        let counts = stats.exec_counts();
        if self.passes_over && self.steps(stats) > 0 {
            *self = Window { passes_over: false, ..Window::of(stats) };
        }
        let begun = *self.begun.get_or_insert(now);
        if now - begun >= span {
            self.before = core::mem::replace(&mut self.this, counts);
            self.begun = Some(now);
        }
        self.since_before(stats)
    }

    fn since_before(&self, stats: &AgentStats) -> (u64, Duration) {
        let counts = stats.exec_counts();
        let new = |at: usize| counts[at] - self.before.get(at).copied().unwrap_or(0);
        let steps = (0..BUCKETS).map(new).sum();
        let longest = (0..BUCKETS).rev().find(|at| new(*at) > 0).map_or(0.0, upper);
        let (_, ever) = stats.longest();
        (steps, Duration(longest.ceil() as i64).min(ever))
    }
}

/// What is counted of an agent.
#[derive(Debug, Default)]
pub struct AgentStats {
    /// Steps that were due or made to run by a message.
    pub releases: AtomicU64,
    /// Steps that ended behind their deadline.
    pub missed: AtomicU64,
    /// Of those, the ones during which the witness saw a stall that nobody in the process caused.
    pub stalled: AtomicU64,
    /// Releases that were passed over because the step before them had not ended.
    pub skipped: AtomicU64,
    /// Steps that reported a fault.
    pub faults: AtomicU64,
    /// Steps that panicked.
    pub panics: AtomicU64,
    /// Steps that did not return.
    pub hangs: AtomicU64,
    /// Times that the agent was started again.
    pub restarts: AtomicU64,
    /// Steps that are not among those of `exec`, because the witness saw a stall in them.
    pub left_out: AtomicU64,
    /// Steps that were held against the thread's clock.
    pub checked: AtomicU64,
    /// Of those, the ones for which it said something else.
    pub disagreed: AtomicU64,
    /// How often its steps took or freed memory.
    pub allocations: AtomicU64,
    /// Refinements that steps made.
    pub refinements: AtomicU64,
    /// Steps that took longer than the budget that they had for refinements.
    pub overruns: AtomicU64,
    /// What steps lacked of the best result, in steps of [`Quality`](types::header::Quality), in all.
    pub quality_lost: AtomicU64,
    /// How long steps used their processor (ns): on the wall clock without what higher executors took from them. Those of `undisturbed`
    /// are not here.
    pub(crate) exec: Histogram,
    /// How late steps began whose time had come (ns). A step that a message made run is released when the message came, as far as that is known: when its executor was busy.
    pub jitter: Histogram,
    /// From the release to the end of the step (ns), but for those of `undisturbed`.
    pub(crate) response: Histogram,
    /// Steps that began when they were released and that nobody interrupted: what they used is what they took (ns).
    pub(crate) undisturbed: Histogram,
}

impl AgentStats {
    /// How long steps used their processor (ns): on the wall clock without what higher executors took from them.
    pub fn exec(&self) -> Figure {
        figure(&[&self.exec, &self.undisturbed])
    }

    /// The counts of all steps of the histogram of how long steps took.
    fn exec_counts(&self) -> Vec<u64> {
        counts(&[&self.exec, &self.undisturbed])
    }

    /// How long all steps together used their processor.
    pub(crate) fn used(&self) -> Duration {
        let parts = [&self.exec, &self.undisturbed];
        Duration(parts.iter().map(|part| part.sum.load(Relaxed)).sum::<u64>() as i64)
    }

    /// How many steps were timed, and how long the longest of them used its processor.
    pub(crate) fn longest(&self) -> (u64, Duration) {
        let parts = [&self.exec, &self.undisturbed];
        let longest = parts.iter().map(|part| part.max.load(Relaxed)).max().unwrap_or(0);
        let steps = parts.iter().map(|part| part.n.load(Relaxed)).sum();
        (steps, Duration(i64::try_from(longest).unwrap_or(i64::MAX)))
    }

    /// Has fetched what a step that is due adds to, but for the step of its histogram.
    #[inline]
    pub(crate) fn fetch(&self) {
        for figure in [&self.exec, &self.jitter, &self.response] {
            fetch(figure, 1);
        }
        fetch(&self.releases, 1);
    }

    /// And that: most steps take about as long as the one before.
    #[inline]
    pub(crate) fn fetch_last(&self) {
        let last = bucket(self.exec.last.load(Relaxed));
        fetch(&self.exec.buckets[last], 1);
    }

    /// The same as [`Histogram::steps`].
    pub fn exec_steps(&self) -> Vec<(f64, u32)> {
        steps(&[&self.exec, &self.undisturbed])
    }

    /// From the release to the end of the step (ns).
    pub fn response(&self) -> Figure {
        figure(&[&self.response, &self.undisturbed])
    }

    /// A step was held against the thread's clock.
    #[cold]
    pub(crate) fn check(&self, agrees: bool) {
        bump(&self.checked);
        if !agrees {
            bump(&self.disagreed);
        }
    }
}

/// Adds one to a counter that one thread writes.
#[inline]
pub(crate) fn bump(counter: &AtomicU64) {
    bump_by(counter, 1);
}

/// Adds to a counter that one thread writes.
#[inline]
pub(crate) fn bump_by(counter: &AtomicU64, count: u64) {
    counter.store(counter.load(Relaxed) + count, Relaxed);
}

/// A span that is not negative, in nanoseconds.
pub(crate) fn nanos(span: Duration) -> u64 {
    span.0.max(0) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_forgets_what_was_long_ago() {
        let stats = AgentStats::default();
        let mut window = Window::default();
        let at = |secs: i64| Time::ZERO + Duration::secs(secs);
        stats.exec.add(9_000_000);
        assert_eq!(window.look(&stats, at(0), Duration::secs(2)), (1, Duration::millis(9)));
        stats.undisturbed.add(1_000_000);
        assert_eq!(window.look(&stats, at(2), Duration::secs(2)), (2, Duration::millis(9)));
        stats.exec.add(1_000_000);
        let (steps, longest) = window.look(&stats, at(4), Duration::secs(2));
        assert_eq!(steps, 1, "the two before the span before this one are forgotten");
        assert!((1_000_000..=1_125_000).contains(&longest.0), "{longest}");
        assert_eq!(window.look(&stats, at(8), Duration::secs(2)), (0, Duration::ZERO));
    }

    #[test]
    fn a_step_that_was_under_way_when_a_window_began_does_not_count() {
        let stats = AgentStats::default();
        let at = |millis: i64| Time::ZERO + Duration::millis(millis);
        let look = |window: &mut Window, millis| window.look(&stats, at(millis), Duration::secs(1));
        let mut window = Window::of(&stats);
        assert_eq!(look(&mut window, 0).0, 0);
        stats.exec.add(9_000_000);
        assert_eq!(look(&mut window, 100).0, 0, "it began before");
        stats.exec.add(1_000_000);
        assert_eq!(look(&mut window, 200).0, 1);
        assert!(look(&mut window, 300).1 < Duration::millis(2));
    }

    proptest::proptest! {
        /// The percentile of the histogram lies within one step of the true one.
        #[test]
        fn percentiles_are_right_to_one_step(mut values in proptest::collection::vec(0u64..10_000_000_000, 1..300)) {
            let histogram = Histogram::default();
            values.iter().for_each(|value| histogram.add(*value));
            values.sort_unstable();
            let figure = histogram.figure();
            proptest::prop_assert_eq!(figure.max, values[values.len() - 1] as f64);
            proptest::prop_assert_eq!(figure.min, values[0] as f64);
            for (share, shown) in [(0.5, figure.p50), (0.99, figure.p99)] {
                let truth = values[((share * values.len() as f64).ceil() as usize).max(1) - 1] as f64;
                proptest::prop_assert!(shown >= truth * 0.999 && shown <= (truth * 1.13).max(37.0), "{} {}", shown, truth);
            }
        }
    }
}
