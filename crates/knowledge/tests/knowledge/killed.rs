//! A process that is killed while it writes: what it was told to be written is there.

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::{Command, Stdio};

use knowledge::{Fact, Knowledge, Query};
use types::Time;
use types::chance::Stream;

use crate::Folder;

const ROUNDS: u64 = 20;
/// Facts of one write.
const TOGETHER: i64 = 3;
/// Names the file to the process that is killed.
const FILE: &str = "SINEW_KNOWLEDGE_TEST_FILE";
const WRITTEN: &str = "written ";

/// Writes without an end and says after each write which it was. It runs in a process of its own, and does nothing elsewhere.
#[test]
fn the_process_that_is_killed() {
    let Some(file) = std::env::var_os(FILE) else { return };
    let mut knowledge = Knowledge::open(file).unwrap();
    for number in 0.. {
        let facts = (0..TOGETHER)
            .map(|part| Fact::new(number.to_string(), "has", part.to_string(), Time(number)).into());
        knowledge.put_all(facts).unwrap();
        let mut out = std::io::stdout().lock();
        writeln!(out, "{WRITTEN}{number}").unwrap();
        out.flush().unwrap();
    }
}

/// Kills a writer after so many answers and some more work, and gives the number of its last answer.
fn kill_after(file: &Path, answers: usize, work: u64) -> i64 {
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "killed::the_process_that_is_killed", "--nocapture", "--test-threads=1"])
        .env(FILE, file)
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines().map_while(Result::ok);
    let number = |line: &String| line.split_once(WRITTEN).and_then(|(_, number)| number.parse::<i64>().ok());
    let mut last = None;
    for line in lines.by_ref() {
        last = number(&line).or(last);
        if last.is_some_and(|last| last + 1 >= answers as i64) {
            break;
        }
    }
    // Some work, so that the end comes at another moment of a write each time.
    std::hint::black_box((0..work).fold(0u64, |sum, n| std::hint::black_box(sum.wrapping_mul(31) + n)));
    child.kill().unwrap();
    let rest = lines.filter_map(|line| number(&line)).last();
    assert!(!child.wait().unwrap().success(), "it writes until it is killed");
    rest.or(last).unwrap()
}

#[test]
fn whatever_was_answered_outlives_a_kill() {
    for round in 0..ROUNDS {
        let folder = Folder::new();
        let stream = Stream::new(round, "kill");
        let last = kill_after(&folder.file(), 1 + stream.index(0, 25), stream.bits(1) % 2_000_000);
        let mut knowledge = Knowledge::open(folder.file()).unwrap();
        let mut facts = knowledge.read().unwrap().facts(&Query::default()).unwrap();
        facts.sort_by_key(|fact| fact.time);
        let writes = facts.len() as i64 / TOGETHER;
        assert_eq!(
            facts.len() as i64 % TOGETHER,
            0,
            "round {round}: each write is there whole or not at all"
        );
        assert!(
            writes == last + 1 || writes == last + 2,
            "round {round}: {writes} writes are there, {} were answered",
            last + 1
        );
        for (at, fact) in facts.iter().enumerate() {
            assert_eq!(fact.time, Time(at as i64 / TOGETHER), "round {round}: without a gap");
        }
        knowledge.put(Fact::new("it", "goes", "on", Time::NEVER)).unwrap();
    }
}
