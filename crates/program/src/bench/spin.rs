//! A round trip over two atomics between two threads that poll: how near the processors are to each other just now.
//!
//! It is printed beside all figures, because a host that moves the processors of a virtual machine changes it severalfold.

use std::hint::spin_loop;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use super::parcel::{pin, thread};
use crate::terminal::host_now;

/// Means at most, and the round trips in each.
const MEANS: u64 = 50;
const BLOCK: u64 = 100;
/// Where others want the processors too, a round trip can take a slice of the scheduler; after so long it is enough.
const LONGEST: std::time::Duration = std::time::Duration::from_millis(300);
/// The word that ends it.
const END: u64 = u64::MAX;
/// After so many looks the thread lets another run, which may be the one that it waits for.
const LOOKS: u32 = 10_000;

/// A word with a line of the cache for itself.
#[derive(Default)]
#[repr(align(128))]
struct Word(AtomicU64);

impl Word {
    /// Polls until the word has at least a value, and gives what it has. Acquire: partner of the releasing stores of the other thread.
    fn wait(&self, value: u64) -> u64 {
        let mut looks = 0u32;
        loop {
            let seen = self.0.load(Ordering::Acquire);
            if seen >= value {
                return seen;
            }
            spin_loop();
            looks += 1;
            if looks.is_multiple_of(LOOKS) {
                std::thread::yield_now();
            }
        }
    }
}

/// Means of round trips between the first two processors (ns); none where there is one alone.
pub(super) fn round_trips() -> Vec<f64> {
    if std::thread::available_parallelism().map_or(1, usize::from) < 2 {
        return Vec::new();
    }
    let words = Arc::new([Word::default(), Word::default()]);
    let theirs = words.clone();
    let answers = thread("bench-answers", move || {
        pin(1);
        for round in 1.. {
            if theirs[0].wait(round) == END {
                return;
            }
            theirs[1].0.store(round, Ordering::Release);
        }
    });
    let asks = thread("bench-asks", move || {
        pin(0);
        let (mut means, all) = (Vec::new(), host_now());
        for mean in 0..MEANS {
            if all.elapsed() > LONGEST {
                break;
            }
            let begun = host_now();
            for round in 1..=BLOCK {
                words[0].0.store(mean * BLOCK + round, Ordering::Release);
                words[1].wait(mean * BLOCK + round);
            }
            means.push(begun.elapsed().as_nanos() as f64 / BLOCK as f64);
        }
        words[0].0.store(END, Ordering::Release);
        means
    });
    let (Ok(answers), Ok(asks)) = (answers, asks) else { return Vec::new() };
    let means = asks.join().unwrap_or_default();
    // It has been told to end.
    let _ = answers.join();
    means
}
