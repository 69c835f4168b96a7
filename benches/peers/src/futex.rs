//! A bare wake: one thread waits on a futex, another wakes it. No system on this machine wakes a thread faster by blocking.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use rustix::thread::futex::{Flags, wait, wake};

use crate::document::{Document, Figure};
use crate::machine::{end, kernel, now, room, settle, sleep_until, start};
use crate::settings::Settings;

/// The other system.
pub(crate) const PEER: &str = "futex";

/// `wake`: from before the wake to after the wait has returned, of every wake. `awake`: how many of them found the thread awake,
/// since it was late for the one before.
pub(crate) const FIGURES: &[&str] = &["wake", "awake"];

/// Wakes where nobody says how many, and the time between them (ns).
const ITERATIONS: u64 = 1000;
const PERIOD: u64 = 1_000_000;

/// What the two threads share.
struct Shared {
    /// Counts the wakes; it is what the other thread waits on.
    word: AtomicU32,
    /// When each wake began (ns). Written before the word, read after it.
    begun: Vec<AtomicU64>,
}

/// Measures: the first processor wakes, the second waits.
pub(crate) fn measure(settings: &Settings) -> Result<Document, String> {
    let iterations = settings.iterations_or(ITERATIONS);
    let period = settings.period.unwrap_or(PERIOD);
    let shared = Arc::new(Shared {
        word: AtomicU32::new(0),
        begun: (0..iterations).map(|_| AtomicU64::new(0)).collect(),
    });
    let (theirs, wanted) = (shared.clone(), settings.clone());
    let waits = start("peers-waits", move || {
        let granted = settle("waits", &wanted, 1);
        let (spans, awake) = take(&theirs);
        (granted, spans, awake)
    })?;
    let wanted = settings.clone();
    let wakes = start("peers-wakes", move || {
        let granted = settle("wakes", &wanted, 0);
        let begun = now() + period;
        for (round, at) in (0..).zip(&shared.begun) {
            sleep_until(begun + round * period);
            at.store(now(), Ordering::Relaxed);
            // Release: partner of the acquiring load in `take`, which then sees the time.
            shared.word.fetch_add(1, Ordering::Release);
            let _ = wake(&shared.word, Flags::PRIVATE, 1);
        }
        granted
    })?;
    let wakes = end(wakes)?;
    let (waits, spans, awake) = end(waits)?;
    Ok(Document {
        peer: PEER,
        version: kernel(),
        granted: vec![wakes, waits],
        figures: vec![Figure::times("wake", spans), Figure::new("awake", "1", vec![awake as f64])],
    })
}

/// Waits for every wake. Gives the time of each, and how many found the thread awake.
fn take(shared: &Shared) -> (Vec<u64>, u64) {
    let mut spans = room(shared.begun.len() as u64);
    let mut awake = 0;
    for (seen, at) in (0..).zip(&shared.begun) {
        let mut slept = false;
        // Acquire: partner of the releasing addition; the time of this wake is there when the word is.
        while shared.word.load(Ordering::Acquire) <= seen {
            // An error means that the word had changed already, or a signal: the loop looks again.
            slept = wait(&shared.word, Flags::PRIVATE, seen, None).is_ok();
        }
        spans.push(now().saturating_sub(at.load(Ordering::Relaxed)));
        awake += u64::from(!slept);
    }
    (spans, awake)
}
