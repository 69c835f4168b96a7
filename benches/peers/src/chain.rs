//! A chain of bare threads on one processor: the first wakes the second, that the third, and that the first again, each by a
//! futex. The first has the highest priority, the last the lowest, as the agents between a contact and the wheels.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use rustix::thread::futex::{Flags, wait, wake};

use crate::document::{Document, Figure};
use crate::machine::{end, kernel, now, room, settle, sleep_until, start};
use crate::settings::Settings;

/// The other system.
pub(crate) const PEER: &str = "futex";

/// `chain`: from before the first wake until the first thread is back, of each round.
pub(crate) const FIGURES: &[&str] = &["chain"];

/// Rounds where nobody says how many, and the time between them (ns).
const ITERATIONS: u64 = 1000;
const PERIOD: u64 = 2_000_000;
/// From the priority of one thread to the next.
const LOWER: i32 = 10;

/// A word that counts wakes, and a thread that waits on it.
#[derive(Default)]
struct Bell(AtomicU32);

impl Bell {
    fn ring(&self) {
        // Release: partner of the acquiring load in `wait`.
        self.0.fetch_add(1, Ordering::Release);
        let _ = wake(&self.0, Flags::PRIVATE, 1);
    }

    /// Waits until it has rung more often than `seen`.
    fn wait(&self, seen: u32) {
        // Acquire: partner of the releasing addition in `ring`.
        while self.0.load(Ordering::Acquire) <= seen {
            // An error means that the word had changed already, or a signal: the loop looks again.
            let _ = wait(&self.0, Flags::PRIVATE, seen, None);
        }
    }
}

/// Measures.
pub(crate) fn measure(settings: &Settings) -> Result<Document, String> {
    let iterations = settings.iterations_or(ITERATIONS) as u32;
    let period = settings.period.unwrap_or(PERIOD);
    let bells: Arc<[Bell; 3]> = Arc::default();
    let mut hands = Vec::new();
    for (number, name) in [(0, "second"), (1, "third")] {
        let (bells, wanted) = (bells.clone(), lower(settings, number as i32 + 1));
        hands.push(start("peers-chain", move || {
            let granted = settle(name, &wanted, 0);
            for round in 0..iterations {
                bells[number].wait(round);
                bells[number + 1].ring();
            }
            granted
        })?);
    }
    let wanted = settings.clone();
    let first = start("peers-chain", move || {
        let granted = settle("first", &wanted, 0);
        let mut spans = room(iterations.into());
        let begun = wanted.first(now(), period);
        for round in 0..iterations {
            sleep_until(begun + u64::from(round) * period);
            let contact = now();
            bells[0].ring();
            bells[2].wait(round);
            spans.push(now() - contact);
        }
        (granted, spans)
    })?;
    let (granted, spans) = end(first)?;
    let mut all = vec![granted];
    for hand in hands {
        all.push(end(hand)?);
    }
    Ok(Document { peer: PEER, version: kernel(), granted: all, figures: vec![Figure::times("chain", spans)] })
}

/// The same with a priority that is so many steps lower.
fn lower(settings: &Settings, steps: i32) -> Settings {
    let fifo = settings.fifo.map(|fifo| (fifo - steps * LOWER).max(1));
    Settings { fifo, ..settings.clone() }
}
