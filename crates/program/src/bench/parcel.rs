//! What the agents of the measurements share: the message, the clock, a place for what was measured.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

use runtime::{Incident, Live, Observer, Options, Plan, Registry, Report, Verdict};
use rustix::thread::{CpuSet, sched_setaffinity};
use rustix::time::{ClockId, clock_gettime};
use types::{Duration, Message, Time};

use super::outcome::Outcome;
use crate::error::Failure;

/// A message of 64 bytes.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
pub(super) struct Parcel {
    /// When it was sent, on the monotonic clock (ns).
    pub(super) sent: u64,
    /// Its number.
    pub(super) number: u64,
    /// Whatever fills it up.
    pub(super) load: [u64; 6],
}

fn nanoseconds(clock: ClockId) -> u64 {
    let time = clock_gettime(clock);
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}

/// The monotonic clock (ns).
#[inline]
pub(super) fn now() -> u64 {
    nanoseconds(ClockId::Monotonic)
}

/// How far the time of agents on the wall clock is before the monotonic one (ns).
pub(super) fn offset() -> u64 {
    nanoseconds(ClockId::Realtime) - now()
}

/// A time of a wall-clock system on the monotonic clock (ns).
pub(super) fn monotonic(time: Time, offset: u64) -> u64 {
    (time.0 as u64).saturating_sub(offset)
}

/// Processor time of all threads of this process (ns).
pub(super) fn process_time() -> u64 {
    nanoseconds(ClockId::ProcessCPUTime)
}

/// Where an agent puts what it measured, when it is stopped: in its steps it fills room of its own.
#[derive(Clone, Debug, Default)]
pub(super) struct Shelf {
    values: Arc<Mutex<Vec<f64>>>,
    /// Whether somebody has measured all that there is room for.
    over: Arc<AtomicBool>,
}

impl Shelf {
    pub(super) fn put(&self, values: &[f64]) {
        self.values.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(values);
    }

    pub(super) fn take(&self) -> Vec<f64> {
        std::mem::take(&mut *self.values.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Shelf {
    /// Adds a value to those of an agent. When its room is full the run is over.
    pub(super) fn keep(&self, values: &mut Vec<f64>, value: f64) {
        keep(values, value);
        if values.len() == values.capacity() {
            self.over.store(true, Ordering::Release);
        }
    }

    /// Options of a run that ends when somebody's room is full, which should take `length`.
    pub(super) fn until_full(&self, length: Duration) -> Options {
        until(&self.over, length)
    }
}

/// Room for so many values, written to once: a page that is mapped while something is timed would be ours to pay.
pub(super) fn room(values: usize) -> Vec<f64> {
    let mut room = vec![1.0; values];
    room.clear();
    room
}

/// Adds a value while there is room.
pub(super) fn keep(values: &mut Vec<f64>, value: f64) {
    if values.len() < values.capacity() {
        values.push(value);
    }
}

/// Keeps the calling thread on a processor. Where that is refused, the figure is that of wherever it ran.
pub(super) fn pin(cpu: usize) {
    let mut set = CpuSet::new();
    set.set(cpu);
    let _ = sched_setaffinity(None, &set);
}

/// Starts a thread with a name.
pub(super) fn thread<T: Send + 'static>(
    name: &str,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<JoinHandle<T>, Failure> {
    let thread = std::thread::Builder::new().name(name.to_owned()).spawn(work);
    thread.map_err(|error| Failure::new(format!("no thread could be started: {error}")).code(1))
}

/// Waits for the end of a thread.
pub(super) fn end<T>(thread: JoinHandle<T>) -> Result<T, Failure> {
    thread.join().map_err(|_| Failure::new("a thread of the measurement panicked").code(1))
}

/// A plan made ready for the wall clock.
pub(super) fn live(plan: &Plan, registry: &Registry, options: Options) -> Result<Live, Failure> {
    Live::new(plan, registry, options).map_err(|error| Failure::new(error.to_string()).code(1))
}

/// Runs it to its end and writes down which policies it got. Who died did not do its work.
pub(super) fn run(live: Live, outcome: &mut Outcome) -> Result<Report, Failure> {
    let report = live.run().map_err(|error| Failure::new(error.to_string()).code(1))?;
    for agent in &report.view.agents {
        outcome.grant(&agent.executor, &agent.granted);
        if agent.counts.faults + agent.counts.panics + agent.counts.hangs > 0 {
            let cause = agent.last_death.as_deref().unwrap_or("nobody knows why");
            return Err(Failure::new(format!("{} of the measurement died: {cause}", agent.name)).code(1));
        }
    }
    Ok(report)
}

/// Ends a run when somebody in it has done all.
struct Finish(Arc<AtomicBool>);

impl Observer for Finish {
    fn every(&self) -> Duration {
        Duration::millis(1)
    }
    fn observe(&mut self, _: Time, _: &[Incident]) -> Verdict {
        if self.0.load(Ordering::Acquire) {
            return Verdict::End("all is done".into());
        }
        Verdict::GoOn
    }
}

/// Options of a run that ends when all is done. What should take `length` is given up after three times as long and half a minute.
pub(super) fn until(over: &Arc<AtomicBool>, length: Duration) -> Options {
    let limit = Some(length * 3 + Duration::secs(30));
    Options { limit, observer: Box::new(Finish(over.clone())), ..Options::default() }
}
