//! A round trip over two atomics between two threads that poll: how near the processors are to each other just now.
//!
//! It is printed beside other figures, because a host that moves the processors of a virtual machine changes it severalfold.

use std::hint::spin_loop;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::document::{Document, Figure};
use crate::machine::{end, kernel, now, room, settle, start};
use crate::settings::Settings;

/// The other system.
pub(crate) const PEER: &str = "spin";

/// `round_trip`: mean of a block. `round_trip_each`: with one reading of the clock in each.
pub(crate) const FIGURES: &[&str] = &["round_trip", "round_trip_each"];

/// Round trips where nobody says how many, and how many make a mean.
const ITERATIONS: u64 = 100_000;
const BLOCK: u64 = 1000;
/// After so many looks the thread lets another run, which may be the one that it waits for.
const LOOKS: u32 = 10_000;

/// A word with a line of the cache for itself.
#[derive(Default)]
#[repr(align(128))]
struct Word(AtomicU64);

/// There and back.
#[derive(Default)]
struct Table {
    there: Word,
    back: Word,
}

impl Word {
    /// Polls until the word has a value. Acquire: partner of the releasing stores of the other thread.
    fn wait(&self, value: u64) {
        let mut looks = 0u32;
        while self.0.load(Ordering::Acquire) != value {
            spin_loop();
            looks += 1;
            if looks.is_multiple_of(LOOKS) {
                std::thread::yield_now();
            }
        }
    }
}

/// Measures, on processors 0 and 1 unless others are named.
pub(crate) fn measure(settings: &Settings) -> Result<Document, String> {
    let mut settings = settings.clone();
    if settings.cpus.is_empty() {
        settings.cpus = vec![0, 1];
    }
    let iterations = settings.iterations_or(ITERATIONS);
    let (blocks, table) = (iterations.div_ceil(BLOCK), Arc::new(Table::default()));
    let all = blocks * BLOCK + iterations;
    let (theirs, wanted) = (table.clone(), settings.clone());
    let answers = start("peers-answers", move || {
        let granted = settle("answers", &wanted, 1);
        for round in 1..=all {
            theirs.there.wait(round);
            theirs.back.0.store(round, Ordering::Release);
        }
        granted
    })?;
    let asks = start("peers-asks", move || {
        let granted = settle("asks", &settings, 0);
        let mut round = 0;
        let mut trip = || {
            round += 1;
            table.there.0.store(round, Ordering::Release);
            table.back.wait(round);
        };
        let means = crate::machine::means(blocks, BLOCK, &mut trip);
        let mut each = room(iterations);
        let mut before = now();
        for _ in 0..iterations {
            trip();
            let after = now();
            each.push(after - before);
            before = after;
        }
        (granted, means, each)
    })?;
    let (asks, means, each) = end(asks)?;
    let answers = end(answers)?;
    Ok(Document {
        peer: PEER,
        version: kernel(),
        granted: vec![asks, answers],
        figures: vec![Figure::new("round_trip", "ns", means), Figure::times("round_trip_each", each)],
    })
}
