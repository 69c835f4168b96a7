//! What several targets do.

use std::path::{Path, PathBuf};

use hardware::recording::Recording;
use hardware::{Driver, Listening, Sink};
use types::Time;

/// Takes whatever comes and looks at none of it.
pub struct Nobody;

impl Sink for Nobody {}

/// Plays a recording from an early and from a late time on, and looks at its account of the text it came from.
pub fn play(recording: Recording, text: &[u8]) {
    let report = &recording.report;
    let lines = text.split(|byte| *byte == b'\n').count() as u64;
    assert!(report.lines <= lines && report.told.iter().all(|told| (1..=lines).contains(&told.line)));
    assert!(report.bad == 0 || !report.told.is_empty(), "a bad line is told");
    assert!(recording.records.is_sorted_by_key(|(at, _)| *at));
    let _ = report.to_string();
    for now in [Time::ZERO, Time(1_900_000_000_000_000_000)] {
        drive(&mut recording.clone().play(), now);
    }
}

/// Polls a driver from `now` on, each time when it says that something comes.
pub fn drive(driver: &mut dyn Driver, mut now: Time) {
    for _ in 0..10_000 {
        match driver.poll(now, &Listening::ALL, &mut Nobody) {
            Ok(polled) if !polled.ended => match polled.next {
                Some(next) if next > now => now = next,
                _ => break,
            },
            _ => break,
        }
    }
}

/// A file of this process alone, for what can be read only from files.
pub fn scratch(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("sinew-fuzz-{}", std::process::id()));
    let _ = std::fs::create_dir_all(&folder);
    folder.join(name)
}

/// Writes a file for a target; a disk that is full says nothing about the parser.
pub fn put(path: &Path, bytes: &[u8]) -> bool {
    std::fs::write(path, bytes).is_ok()
}
