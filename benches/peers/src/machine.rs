//! Clocks, sleeping, processors and priorities.

use rustix::thread::{CpuSet, sched_setaffinity};
use rustix::time::{ClockId, Timespec, clock_gettime};
use serde_json::{Value, json};

use crate::settings::Settings;

/// What a thread asked for and got.
pub(crate) struct Granted {
    thread: &'static str,
    cpu: Option<usize>,
    fifo: Option<i32>,
    refused: Vec<String>,
}

impl Granted {
    pub(crate) fn to_json(&self) -> Value {
        let policy = self.fifo.map_or("other".to_owned(), |priority| format!("fifo {priority}"));
        json!({"thread": self.thread, "cpu": self.cpu, "policy": policy, "refused": self.refused})
    }
}

/// Puts the calling thread where the settings want it: 0 is their first processor, 1 their second. What is refused is told.
pub(crate) fn settle(thread: &'static str, settings: &Settings, which: usize) -> Granted {
    let mut granted = Granted { thread, cpu: None, fifo: None, refused: Vec::new() };
    // An ordinary thread may be woken 50 µs late; that would be the peer's loss through no fault of its own.
    if let Err(error) = rustix::thread::set_current_timer_slack(std::num::NonZeroU64::new(1)) {
        granted.refused.push(format!("timer slack of 1 ns: {error}"));
    }
    if let Some(cpu) = settings.cpu(which) {
        let mut set = CpuSet::new();
        set.set(cpu);
        match sched_setaffinity(None, &set) {
            Ok(()) => granted.cpu = Some(cpu),
            Err(error) => granted.refused.push(format!("processor {cpu}: {error}")),
        }
    }
    if let Some(priority) = settings.fifo {
        match set_fifo(priority) {
            Ok(()) => granted.fifo = Some(priority),
            Err(error) => granted.refused.push(format!("fifo {priority}: {error}")),
        }
    }
    granted
}

#[allow(unsafe_code, reason = "no safe wrapper of this call is at hand")]
fn set_fifo(priority: i32) -> std::io::Result<()> {
    let parameters = libc::sched_param { sched_priority: priority };
    // SAFETY: 0 names the calling thread, and the parameters live until the call returns.
    let code = unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &parameters) };
    if code == 0 { Ok(()) } else { Err(std::io::Error::last_os_error()) }
}

fn nanoseconds(clock: ClockId) -> u64 {
    let time = clock_gettime(clock);
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}

/// The monotonic clock (ns).
#[inline]
pub(crate) fn now() -> u64 {
    nanoseconds(ClockId::Monotonic)
}

/// Processor time of the calling thread (ns).
pub(crate) fn thread_time() -> u64 {
    nanoseconds(ClockId::ThreadCPUTime)
}

/// Processor time of all threads of this process (ns).
pub(crate) fn process_time() -> u64 {
    nanoseconds(ClockId::ProcessCPUTime)
}

/// Sleeps until the monotonic clock shows a time (ns).
pub(crate) fn sleep_until(time: u64) {
    let wanted = Timespec { tv_sec: (time / 1_000_000_000) as _, tv_nsec: (time % 1_000_000_000) as _ };
    while rustix::thread::clock_nanosleep_absolute(ClockId::Monotonic, &wanted).is_err() && now() < time {}
}

/// Room for so many samples, written to once: a page that is mapped while something is timed would be the peer's loss.
pub(crate) fn room(samples: u64) -> Vec<u64> {
    let mut room = vec![1; samples as usize];
    room.clear();
    room
}

/// Runs a piece of work so many times and gives the mean time of each block (ns).
pub(crate) fn means(blocks: u64, block: u64, mut work: impl FnMut()) -> Vec<f64> {
    let mut means = Vec::with_capacity(blocks as usize);
    for _ in 0..blocks {
        let begun = now();
        (0..block).for_each(|_| work());
        means.push((now() - begun) as f64 / block as f64);
    }
    means
}

/// Starts a thread with a name.
pub(crate) fn start<T: Send + 'static>(
    name: &'static str,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<std::thread::JoinHandle<T>, String> {
    let thread = std::thread::Builder::new().name(name.to_owned()).spawn(work);
    thread.map_err(|error| format!("the thread \"{name}\" could not be started: {error}"))
}

/// Waits for the end of a thread.
pub(crate) fn end<T>(thread: std::thread::JoinHandle<T>) -> Result<T, String> {
    thread.join().map_err(|_| "a thread of the measurement panicked".to_owned())
}

/// The release of the kernel: the version of what it does itself.
pub(crate) fn kernel() -> String {
    rustix::system::uname().release().to_string_lossy().into_owned()
}
